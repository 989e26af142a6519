// Support mapping of a multi-patch body (paper eq. 4): the point furthest along a direction.
#pragma once

#include <limits>

#include "body/shape.h"
#include "nurbs/tolerances.h"
#include "nurbs/types.h"

namespace nurbs {

struct Support {
  SurfacePoint where;
  Vec3 point = Vec3::Zero();   // shape frame, scale 1
  Vec3 normal = Vec3::Zero();  // unit, of the surface there; d itself where the surface has none of its own
  double h = 0;                // d . point: a lower bound of the support function ...
  double upper = 0;            // ... and a certified upper bound
  double slope = 1;            // of d . x along the surface at the point, rad
  int iterations = 0;          // of Newton, and boxes of the search over patches
  bool converged = false;
};

// A local maximum of d . x over `shape`, d unit (shape frame), by box-constrained Newton in one Bezier patch
// that moves to the neighbour through the links when a parameter leaves its patch. `start` nullptr (or no
// point of the body): from the atlas. A body without dents has no other maximum than the support; where the
// surface normal at the end does not prove the point to be it (poles, creases, corners, a start on the far
// side), this is find_hull_support.
Support find_support(const Shape& shape, const Vec3& d, const SurfacePoint* start = nullptr);

// The support of the body's convex hull, whatever its patches look like. h and upper differ by `enough` at
// most, a length, or by a few ulp of the bounding radius. Inside of a patch Newton may end at a slope of
// `flat`, rad: the point is then as far from the support's, over the radius of curvature, and its height
// lacks the square of that. 0.1 to 0.5 us by the meridian or where Newton's end is proven to be the support,
// some us where the patches have to be searched (patch_maximum.h).
Support find_hull_support(const Shape& shape, const Vec3& d, const SurfacePoint* start = nullptr,
                          double enough = 0, double flat = kSlopeTolerance);

// The same within kFeatureSupport of the body's size: bodies of rounded digits, whose joints leave a few
// round-offs more open than others', would be searched for those.
Support find_feature_support(const Shape& shape, const Vec3& d, const SurfacePoint* start = nullptr);

// A sphero-polyhedron's (Shape::core) in closed form, 10 ns to 0.1 us: h is right to what `upper` is above
// it, and `where` on the surface the point lies isn't known (patch -1).
Support core_support(const Shape& shape, const Vec3& d);

// As find_feature_support where the point and its height are all that is asked for: of sphero-polyhedra,
// right to ten times that, core_support(). ruled_line() and what else asks for lines there need no `where` of
// those.
Support find_feature_top(const Shape& shape, const Vec3& d, const SurfacePoint* start = nullptr);

// The same from every patch, knowing no more than the height of one point: slow, for tables and tests.
Support search_all_patches(const Shape& shape, const Vec3& d, const SurfacePoint& at);

// A point that has d as its normal, or nearly, taken for the support: with no bound. 50 ns.
Support look_at(const Shape& shape, const Vec3& d, const SurfacePoint& at);

// The hull's support within `enough`, knowing a point that has d as its normal, or nearly.
Support confirm_support(const Shape& shape, const Vec3& d, const SurfacePoint& at, double enough = 0);

// Of a body with dents: the best other local maximum reached from the corners of d's atlas cell, which lie on
// either side of the groove that d bridges; false if there is none.
bool find_rival(const Shape& shape, const Vec3& d, const Support& best, Support* rival);

// Step (du, dv) from `at` in its patch's parameters, carried across edges through the links (orientation and
// patch changes); collapsed edges and unmatched ends clamp.
SurfacePoint walk(const Shape& shape, SurfacePoint at, double du, double dv);

}  // namespace nurbs

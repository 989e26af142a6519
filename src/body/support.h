// Support mapping of a multi-patch body (paper eq. 4): the point furthest along a direction.
#pragma once

#include <limits>

#include "body/shape.h"
#include "nurbs/types.h"

namespace nurbs {

struct Support {
  SurfacePoint where;
  Vec3 point = Vec3::Zero();  // shape frame, scale 1
  double h = 0;               // d . point: a lower bound of the support function ...
  double upper = 0;           // ... and a certified upper bound
  double slope = 1;           // of d . x along the surface at the point, rad
  double rival = -std::numeric_limits<double>::infinity();  // h of the best other local maximum met
  int iterations = 0;
  bool converged = false;
};

// Support point of `shape` in unit direction d (shape frame), by box-constrained Newton in one Bezier patch
// that moves to the neighbour through the links when a parameter leaves its patch. `start` nullptr: from the
// atlas. Never fails: at the iteration cap the best point so far is returned with converged = false.
Support find_support(const Shape& shape, const Vec3& d, const SurfacePoint* start = nullptr);

// Support of the convex hull of a body with dents: the best of the local maxima reached from `start` and from
// the corners of d's atlas cell, which lie on either side of the groove that d bridges. Its `upper` trusts
// that search and leaves Shape::support_excess out. On a body without dents this is find_support.
Support find_hull_support(const Shape& shape, const Vec3& d, const SurfacePoint* start = nullptr);

// Step (du, dv) from `at` in its patch's parameters, carried across edges through the links (orientation and
// patch changes); collapsed edges and unmatched ends clamp.
SurfacePoint walk(const Shape& shape, SurfacePoint at, double du, double dv);

}  // namespace nurbs

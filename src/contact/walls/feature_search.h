// A body against the sharp features of a wall: a line (the edge of a mesh, the axis of a cylinder) and a
// point (a vertex). As for a plane, the gap is the largest over the directions that the feature allows,
//
//     gap = max over unit d of f(d),    f(d) = min over b in B of d . (b - a) - radius,    a on the feature,
//
// with d square to a line, free at a point. d points from the wall to the body. f is concave near its maximum
// as long as the body's curvature radii there exceed the overlap; a direction with f > 0 proves the body
// clear of the whole feature and ends the search.
#pragma once

#include "contact/contact.h"

namespace nurbs {

struct FeatureContact {
  bool touching = false;        // else nothing below means anything
  double gap = 0;               // < 0
  Vec3 normal = Vec3::Zero();   // unit d, lab
  Vec3 on_body = Vec3::Zero();  // the body's deepest point, relative to its centre of mass, lab axes
  double along = 0;             // place of it on the line, from `a`
  SurfacePoint where;           // the body's surface point, to start from next time
};

// A line through `a` with unit `direction`. `low` and `high` are unit, square to the line and less than half
// a turn apart, f rising from `low` towards `high` and falling from `high` towards `low` again: the maximum
// lies between them. Equal ones are the answer themselves. Bisection where f has a kink, secant where it is
// smooth: 3 to 8 support searches, fewer when the body is clear. The normal is right to 1e-11 rad.
FeatureContact find_line_contact(const Particle& particle, const Vec3& a, const Vec3& direction,
                                 const Vec3& low, const Vec3& high, double radius, const SurfacePoint* start);

// A point `a`; `guess` is a unit direction near the answer. Newton by the body's curvature, 2 to 4 support
// searches; where that fails (kinks, flats) the polytope of the support points met: at most kPointCuts.
FeatureContact find_point_contact(const Particle& particle, const Vec3& a, const Vec3& guess,
                                  const SurfacePoint* start);

// f(d) along a unit direction, with the body's support point.
struct FeatureGap {
  double gap;
  Vec3 on_body;
  SurfacePoint where;
};
FeatureGap gap_along(const Particle& particle, const Vec3& a, const Vec3& d, const SurfacePoint* start);

}  // namespace nurbs

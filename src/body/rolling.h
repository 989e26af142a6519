// Balls that roll inside and around a body: what turns one surface point and its normal into bounds on the
// whole body (contact/certificate.h).
#pragma once

#include <array>
#include <cmath>
#include <vector>

#include "body/direction_atlas.h"

namespace nurbs {

struct Shape;

// How far a point is from the nearest kinked joint, at least: per patch and edge the length of surface
// crossed per unit of parameter, infinite where the joint is smooth.
struct JointDistance {
  std::vector<std::array<double, 4>> speed;
  double width = 0;    // least width of a patch: no kinked joint beyond a smooth one is nearer than this
  double convex = 0;   // largest kink that opens, rad
  double concave = 0;  // largest kink that closes, rad
  bool none() const { return convex == 0 && concave == 0; }
};

// At a surface point x with outward normal n:
//   a ball of radius `inner` that touches at x lies inside the body;
//   h(d) <= d.x + outer (1 - d.n) + slack for every unit d;
//   h(d) <= d.x + near (1 - d.n) for unit d with |d - n| <= kNormalMargin, where `near` is finite.
struct RollingRadii {
  double inner, outer, slack, near;
};

// How far a ball of radius `outer` that touches at x rises above d.x, for |d - n|^2 = chord2: outer (1 -
// d.n); where that is infinite (flats, grooves), at most the slope of the tangent plane times the body's
// diameter.
inline double rolling_excess(double outer, double bounding_radius, double chord2) {
  const double rolling = 0.5 * outer * chord2;  // NaN on a flat met square
  const double wedge = 2 * bounding_radius * std::sqrt(chord2);
  return rolling < wedge ? rolling : wedge;
}

// Of a shape whose patches and links, with their kinks, are done.
JointDistance measure_joint_distance(const Shape& shape);

// Let r0 and P0 be the least and largest curvature radius inside the patches and s the distance to the
// nearest kinked joint. Without kinks the radii are r0 and P0 (Blaschke). Otherwise, in a normal section, the
// ball of radius r <= r0/2 drops s^2/(2r) below the tangent plane and the surface at most s^2/(2 r0) + kink
// (s' - s) beyond the joint, so r <= s/kink suffices; a quarter of that is used, for corners where several
// joints meet. Likewise a closing kink stays inside the ball of radius 2 P0 once s >= P0 kink; nearer, the
// surface may rise by shape.support_excess. `near` is the normal map's. A few ns.
RollingRadii rolling_radii(const Shape& shape, const SurfacePoint& at, const Vec3& normal);

}  // namespace nurbs

// Balls that roll inside and around a body: what turns one surface point and its normal into bounds on the
// whole body (contact/certificate.h).
#pragma once

#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "body/direction_atlas.h"
#include "body/kink_segments.h"
#include "body/small_kinks.h"
#include "nurbs/tolerances.h"

namespace nurbs {

struct Shape;

// How far a point is from the nearest kinked joint, at least: per patch and edge the length of surface
// crossed per unit of parameter (proven), infinite where the joint is smooth.
struct JointDistance {
  std::vector<std::array<double, 4>> speed;
  double width = 0;       // least width of a patch: no kinked joint beyond a smooth one is nearer than this
  double convex = 0;      // largest kink that opens, rad
  double concave = 0;     // largest kink that closes, rad
  KinkSegments segments;  // where the width is next to nothing; else empty
  bool none() const { return convex == 0 && concave == 0; }
};
template <class Archive>
void archive(Archive& a, JointDistance& s) {
  auto& [speed, width, convex, concave, segments] = s;
  a(speed, width, convex, concave, segments);
}

// At a surface point x with outward normal n:
//   a ball of radius `inner` that touches at x lies inside the body;
//   h(d) <= d.x + outer (1 - d.n) + slack for every unit d;
//   h(d) <= d.x + near (1 - d.n) for unit d with |d - n| <= kNormalMargin, where `near` is finite;
// but for what small kinks add.
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

// h(d) - d.x at most, for |d - n|^2 = chord2.
inline double rolling_excess(const RollingRadii& radii, const SmallKinks& kinks, double bounding_radius,
                             double chord2) {
  const bool near = chord2 <= kNormalMargin * kNormalMargin && radii.near < kFarAway;
  const double smooth =
      near ? 0.5 * radii.near * chord2 : rolling_excess(radii.outer, bounding_radius, chord2) + radii.slack;
  if (!(kinks.met > 0)) return smooth;
  const double chord = std::sqrt(chord2);
  return smooth + (near ? kinks.excess(radii.near, chord) : kinks.excess_outside(radii.outer, chord));
}

// Of a shape whose patches and links, with their kinks, are done.
JointDistance measure_joint_distance(const Shape& shape);

// Let r0 and P0 be the least and largest curvature radius inside the patches, s the distance to the nearest
// kinked joint, I and O the inner and bounding radius about the body's centre c.
//
// Without kinks the radii are r0 and P0: Blaschke's rolling theorem, whose hypotheses are a closed convex
// surface with continuous normals and all curvature radii in [r0, P0]. Normals that jump by up to kNoKink
// have been taken off the radii, but for a rise that brackets count (small_kinks.h).
//
// With kinks, a ball of radius r that touches at x lies in the body K if K's surface over the disc of radius
// r of the tangent plane at x is above it, and r <= t I / (t + O) for some t >= r such that it covers the
// disc of radius t. For, with l = t / (t + O), K holds (1 - l) y + l z for y over that disc and z in the ball
// (c, I), so by choice of y, which makes up for c's offset to the side, a ball of radius l I below x, at
// least as deep as it is wide; with the surface above, K holds the cylinder between. Two ways to meet the
// hypotheses, the better one is used:
//   * no kinked joint within s: the surface is above a ball of radius r0 there, and covers a disc of t = r0
//     sin(s / r0) >= 0.84 min(s, r0); r = min(r0, t I / (t + O)). True for creases of any angle.
//   * small kinks (kSmallKink): up to the width of a patch, four are crossed at most (four patches meet in a
//     corner: not checked). In a normal section the ball of radius r <= r0/2 drops v^2 / (2 r) below the
//     tangent plane at distance v and the surface at most v^2 / (2 r0) + 4 kink (v - s), so r <= s / (4 kink)
//     suffices; and t as above with the width for s.
// Either holds with the least radius of the surface around x as far as that is known (LocalRate::room), taken
// for s: a body that bends sharply elsewhere has larger balls. Balls of radius `enough` are not looked into
// further.
//
// Likewise a closing kink stays inside the ball of radius 2 P0 once s >= P0 kink; nearer, the surface may
// rise by shape.support_excess. `near` is the normal map's. A few ns.
RollingRadii rolling_radii(const Shape& shape, const SurfacePoint& at, const Vec3& normal,
                           double enough = std::numeric_limits<double>::infinity());

}  // namespace nurbs

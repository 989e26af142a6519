// The certificate: rigorous bounds on the gap from one pair of surface points, whatever way they were found.
//
// Theorem. Let A and B be convex, a on A with outward unit normal na and b on B with nb, such that
//   (1) a ball of radius rho_A that touches at a lies in A, likewise B;
//   (2) h_A(d) <= d.a + P_A (1 - d.na) for the d used below, likewise B: A is in a ball that touches at a.
// Then, with a' = a - rho_A na and b' = b - rho_B nb,
//         gap <= |b' - a'| - rho_A - rho_B,
// the gap of the two balls in A and B, which is no smaller than A's and B's; and
//         gap >= -p(d) >= d.(b - a) - P_A (1 - d.na) - P_B (1 + d.nb)      for every unit d.
// With d = (b' - a') / |b' - a'| the bracket is (P_A - rho_A)(1 - d.na) + (P_B - rho_B)(1 + d.nb) wide:
// quadratic in the angles between the normals and d, and zero for spheres at once. At a stationary pair (na =
// -nb = d* along b' - a') with an overlap below rho_A + rho_B both bounds are the overlap: it is the global
// minimum, whatever other stationary pairs there are. Radii of the whole body are not needed for that, only
// (1) at these two points. Where (1) and (2) come from, and under which conditions: body/rolling.h; on bodies
// with flats or dents the normal map gives a smaller P_K, with no allowance for the dents, that holds near
// the normal. Sides of a joint that do not meet (Shape::joint_slack) widen both bounds.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "contact/pair_frame.h"
#include "nurbs/tolerances.h"

namespace nurbs {

// rad: what a normal errs by that is none, or points anywhere.
constexpr double kNoNormal = M_PI;

// |Su x Sv|^2 up to which so much of a normal is the tangents' round-off, both short or in line, that it
// counts: `speed2` is |Su|^2 + |Sv|^2 and `size` the body's.
template <class Number>
Number lost_area2(const Number& speed2, const Number& size) {
  constexpr double kLost = kTangentNoise / kNormalLost;
  return kLost * kLost * size * size * speed2;
}

// |d - n|^2 at most, where n may be off by `noise` rad.
template <class Number>
Number widened_chord2(const Number& chord2, const Number& noise) {
  return chord2 + noise * (2.0 * root(chord2) + noise);
}
// By how much a ball of radius rho that touches along n instead may seem nearer, its centre being off by rho
// noise to the side; `chord` is |d - n|, and the balls' centres are `distance` apart.
template <class Number>
Number ball_beside(const Number& rho, const Number& noise, const Number& chord, const Number& distance) {
  return rho * noise * (chord + noise * (1.0 + rho / distance));
}

// By how much the overlap along the normal that Newton's last step makes may be off, a length, where the
// bracket's normals were off by an angle of this square: the new one errs by some kTurnRate times that, which
// counts squared, by the larger body's reach. Of bodies of like sizes closed brackets see to it.
template <class Number>
Number turn_error(const Number& angle2, const Number& reach) {
  return kTurnRate * kTurnRate * reach * angle2 * angle2;
}

struct Bracket {
  double lower, upper;  // of the gap
  Vec3 direction;       // the unit d the lower bound was taken along
  double angle2;  // larger squared angle between d and a normal: the points' error after a Newton step is of
                  // its order
  double unique;  // rho_A + rho_B: a shallower overlap has no other minimiser
  bool dented = true;  // a dent may be near a normal
  double width() const { return upper - lower; }
};

// Excess of h(d) over d . (surface point with normal n). `noise`: what n may err by, rad.
inline double support_excess(const Shape& shape, double scale, const RollingRadii& radii, const Vec3& d,
                             const Vec3& n, double noise = 0) {
  double chord2 = (d - n).squaredNorm();  // 2 (1 - cos), without cancellation
  if (noise > 0) chord2 = widened_chord2(chord2, noise);
  return scale * rolling_excess(radii, shape.small_kinks, shape.bounding_radius, chord2);
}

// Radii at a point whose normal is n in axes that `axes` turns the shape's into.
inline RollingRadii radii_at(const Shape& shape, const SurfacePoint& at, const Mat3* axes, const Vec3& n) {
  if (shape.joints.none() && shape.normal_map.cells == 0)
    return {shape.patch_curvature.min_radius, shape.patch_curvature.max_radius, shape.support_excess,
            std::numeric_limits<double>::infinity()};
  return rolling_radii(shape, at, axes ? Vec3(axes->transpose() * n) : n);
}

inline Bracket certify(const PairFrame& pair, const PointPair& p, double noise_a, double noise_b) {
  const RollingRadii radii_a = radii_at(*pair.a, p.on_a, nullptr, p.na),
                     radii_b = radii_at(*pair.b, p.on_b, &pair.turn, p.nb);
  // Where the normal points anywhere none is known to touch.
  const double depth = p.na.dot(p.a - p.b);
  const auto ball = [&](const Shape& shape, double inner, double noise) {
    return noise < kNoNormal ? std::min(inner, pair.largest_ball(shape, depth)) : 0;
  };
  const double rho_a = ball(*pair.a, pair.scale_a * radii_a.inner, noise_a),
               rho_b = ball(*pair.b, pair.scale_b * radii_b.inner, noise_b);
  const Vec3 core = (p.b - rho_b * p.nb) - (p.a - rho_a * p.na);
  const double distance = core.norm();
  const Vec3 mean = p.na - p.nb;
  Bracket bracket;
  // Cores this close have no direction of their own; along the normals the bracket is at most 2 |core| wide.
  const bool apart = core.dot(mean) > 0 && distance > kNoDirection * pair.reach;
  bracket.direction = apart ? Vec3(core / distance) : Vec3(mean.normalized());
  const Vec3& d = bracket.direction;
  bracket.angle2 = std::max((d - p.na).squaredNorm(), (d + p.nb).squaredNorm());
  bracket.unique = rho_a + rho_b;
  const auto dented = [](const Shape& shape, const RollingRadii& radii) {
    return radii.slack > kRoundoff * shape.bounding_radius && !(radii.near < kFarAway);
  };
  bracket.dented = dented(*pair.a, radii_a) || dented(*pair.b, radii_b);
  const auto beside = [&](double rho, double noise, const Vec3& out) {
    return noise > 0 ? ball_beside(rho, std::min(noise, 1.0), (d - out).norm(), distance) : 0;
  };
  bracket.upper = distance - rho_a - rho_b + pair.joint_slack() + pair.roundoff +
                  pair.rise_between(rho_a, rho_b, distance) + beside(rho_a, noise_a, p.na) +
                  beside(rho_b, noise_b, -p.nb);
  bracket.lower = d.dot(p.b - p.a) - support_excess(*pair.a, pair.scale_a, radii_a, d, p.na, noise_a) -
                  support_excess(*pair.b, pair.scale_b, radii_b, -d, p.nb, noise_b) - pair.roundoff;
  if (!(d.squaredNorm() > 0)) bracket.lower = -kFarAway;
  return bracket;
}

}  // namespace nurbs

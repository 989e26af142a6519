// The certificate of certificate.h at two hull supports along one direction, with balls that touch there from
// inside.
#pragma once

#include "contact/certificate.h"
#include "contact/pair_frame.h"

namespace nurbs {

// A ball that touches at a point from inside, lab lengths; `normal` outward there, shape axes.
struct TouchingBall {
  double radius;  // 0: none is known; infinite on flats
  Vec3 normal;
};

// At a surface point whose unit normal is `normal`; none where that is not `along`, the direction that the
// point is a support of (both shape axes). A ball of radius `enough` serves, a length of the lab.
inline TouchingBall touching_ball(const Shape& shape, const SurfacePoint& at, const Vec3& normal,
                                  double scale, const Vec3& along,
                                  double enough = std::numeric_limits<double>::infinity()) {
  const bool met = (normal - along).squaredNorm() <= kStationary * kStationary;
  return {met ? scale * rolling_radii(shape, at, normal, enough / scale).inner : 0, normal};
}

// The bracket at points p.a, p.b of the hulls whose supports along d are at most `upper` = p(d).
inline Bracket bracket_along(const PairFrame& pair, const Vec3& d, double upper, const PointPair& p,
                             const TouchingBall& a, const TouchingBall& b) {
  const double depth = d.dot(p.a - p.b), rho_a = std::min(a.radius, pair.largest_ball(*pair.a, depth)),
               rho_b = std::min(b.radius, pair.largest_ball(*pair.b, depth));
  const Vec3 core = (p.b - rho_b * (pair.turn * b.normal)) - (p.a - rho_a * a.normal);
  const double unique = rho_a + rho_b, distance = core.norm();
  const double most = core.dot(d) > 0 ? distance - unique + pair.joint_slack() + pair.roundoff +
                                            pair.rise_between(rho_a, rho_b, distance)
                                      : kFarAway;
  return {-upper, most, d, 0, unique};
}

}  // namespace nurbs

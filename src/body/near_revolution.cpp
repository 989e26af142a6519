#include "body/near_revolution.h"

#include <algorithm>
#include <cmath>

#include "body/shape.h"
#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

constexpr double kSameEnd = 1e-9;  // of the body's size: pieces of the profile that follow each other

// The way along the profile between two places, in parameters, by an end that both pieces have where they are
// two; infinite where there is none. `gap`: what such ends are apart.
double way(const Meridian& m, const Meridian::Place& a, const Meridian::Place& b, double size, double* gap) {
  *gap = 0;
  if (a.piece == b.piece) return std::abs(a.t - b.t);
  double best = kFarAway;
  for (const double end_a : {0.0, 1.0})
    for (const double end_b : {0.0, 1.0}) {
      const auto end = [&](int piece, double t) {
        const Meridian::Piece& p = m.pieces[piece];
        const int k = t > 0 ? p.degree : 0;
        return Vec2(p.r[k] / p.w[k], p.z[k] / p.w[k]);
      };
      const double apart = (end(a.piece, end_a) - end(b.piece, end_b)).norm(),
                   length = std::abs(a.t - end_a) + std::abs(b.t - end_b);
      if (!(apart <= kSameEnd * size && length < best)) continue;
      best = length;
      *gap = apart;
    }
  return best;
}

}  // namespace

NearRevolution find_near_revolution(const std::vector<BezierPatch>& patches, const Mat3& inertia,
                                    double size) {
  NearRevolution near;
  near.revolution = find_revolution(patches, inertia, size, kNearRevolution);
  near.meridian = make_meridian(patches, near.revolution, size, kNearRevolution);
  if (near.meridian.empty()) return {};
  near.radii = make_profile_radii(near.meridian, patches, size, kNearKink);
  return near;
}

const Revolution& revolution_of(const Shape& shape) {
  return shape.revolution.found ? shape.revolution : shape.near_revolution.revolution;
}

// The body has the product's points but for the ripple, so that its support is no less than that at the
// product's place for d, which is where the profile bends by no less than the radius (but within kinks, which
// take a share of what it rises by), less what the ripple changes by from the places given: those for
// directions within reach lie between the outermost two.
ProfileBall ball_within(const NearRevolution& near, const Vec3& own, double reach, const Meridian::Place& one,
                        const Meridian::Place& two, double size) {
  const Vec3 axis = near.revolution.axis;
  const double cosine = axis.dot(own), sine = axis.cross(own).norm(), angle = std::atan2(sine, cosine);
  const double radius = near.radii.within(cosine, sine, reach);
  if (!(radius > 0) || one.piece < 0 || two.piece < 0) return {};
  double furthest = 0, apart = 0;
  for (const double side : {-reach, reach}) {
    const double at = std::clamp(angle + side, 0.0, M_PI);
    ProfilePoint end;
    if (!find_profile_point(near.meridian, std::sin(at), std::cos(at), size, {}, &end)) return {};
    for (const Meridian::Place& place : {one, two}) {
      double gap;
      const double length = way(near.meridian, end.place, place, size, &gap);
      if (!(length < kFarAway)) return {};
      furthest = std::max(furthest, length);
      apart = std::max(apart, gap);
    }
  }
  const Ripple& ripple = near.meridian.ripple;
  return {radius, std::min(ripple.along * furthest + apart, 2 * ripple.most) +
                      2 * radius * near.radii.kinks * (reach + near.radii.kinks)};
}

}  // namespace nurbs

// See overlap_test.h.
#include "contact/overlap/overlap_test.h"

#include "body/hull_point.h"
#include "contact/overlap/difference_simplex.h"

namespace nurbs {
namespace {

constexpr int kMostSteps = 24;
constexpr double kNearOrigin = 1e-9;  // of the larger body: the direction to the origin is round-off

}  // namespace

std::optional<bool> test_overlap(const PairFrame& pair, double tolerance) {
  const HullPoints points_a(*pair.a, kSupportShare * tolerance / pair.scale_a, tolerance / pair.scale_a),
      points_b(*pair.b, kSupportShare * tolerance / pair.scale_b, tolerance / pair.scale_b);
  DifferenceSimplex simplex(pair.reach);
  Vec3 d = pair.offset.norm() > kNearOrigin * pair.reach ? Vec3(pair.offset.normalized()) : Vec3::UnitX();
  HullPoint a, b;
  // First the atlas's points, as long as they lead on.
  bool rough = true, follows = false;
  for (int k = 0; k < kMostSteps; ++k) {
    const Vec3 on_b = pair.direction_on_b(d);
    a = rough ? points_a.near(d) : points_a.along(d, follows ? &a.where : nullptr);
    b = rough ? points_b.near(on_b) : points_b.along(on_b, follows ? &b.where : nullptr);
    follows = !rough;
    if (pair.overlap_along(d, a.upper, b.upper) < -tolerance) return false;
    if (!simplex.add(pair.place_a(a.point) - pair.place_b(b.point))) {
      if (!rough) return std::nullopt;
      rough = false;
      continue;
    }
    if (simplex.surrounds_origin()) return true;
    const Vec3 nearest = simplex.nearest();
    const double distance = nearest.norm();
    if (!(distance > kNearOrigin * pair.reach)) return std::nullopt;
    d = -nearest / distance;
  }
  return std::nullopt;
}

}  // namespace nurbs

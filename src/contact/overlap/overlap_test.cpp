// See overlap_test.h.
#include "contact/overlap/overlap_test.h"

#include <algorithm>
#include <cmath>

#include "body/hull_point.h"
#include "contact/overlap/growing_hull.h"

namespace nurbs {
namespace {

constexpr int kMostSteps = 24;
constexpr double kInsideBy = 1e-9;    // of the larger body: heights of the origin over the faces round it
constexpr double kNearOrigin = 1e-9;  // of it: the direction to the origin is round-off
constexpr double kSamePoint = 1e-24;  // of its square

// Up to four points of the difference, and the point of their hull that is nearest to the origin.
class DifferenceSimplex {
 public:
  explicit DifferenceSimplex(double reach) : reach_(reach) {}

  // False where the point is there already.
  bool add(const Vec3& x) {
    for (int k = 0; k < count_; ++k)
      if ((x - point_[k]).squaredNorm() <= kSamePoint * reach_ * reach_) return false;
    point_[count_++] = x;
    return true;
  }
  bool surrounds_origin() const {
    if (count_ < 4) return false;
    for (int k = 0; k < 4; ++k) {
      const Vec3 &p = point_[(k + 1) % 4], &q = point_[(k + 2) % 4], &r = point_[(k + 3) % 4];
      const Vec3 n = (q - p).cross(r - p).normalized();
      const double own = n.dot(point_[k] - p), origin = -n.dot(p);
      if (!(origin * own > 0 && std::abs(origin) > kInsideBy * reach_)) return false;
    }
    return true;
  }
  // Drops the points that do not hold it.
  Vec3 nearest() {
    Vec4 weight = Vec4::Zero();
    if (count_ == 1) {
      weight[0] = 1;
    } else if (count_ == 2) {
      const Vec3 way = point_[1] - point_[0];
      weight[1] = std::clamp(-point_[0].dot(way) / way.squaredNorm(), 0.0, 1.0);
      weight[0] = 1 - weight[1];
    } else {
      double least = kFarAway;
      for (int without = count_ == 3 ? 3 : 0; without < 4; ++without) {
        const int i = without == 0 ? 1 : 0, j = without <= 1 ? 2 : 1, k = without <= 2 ? 3 : 2;
        const Vec3 w = nearest_on_triangle(point_[i], point_[j], point_[k]);
        const double distance2 = (w[0] * point_[i] + w[1] * point_[j] + w[2] * point_[k]).squaredNorm();
        if (!(distance2 < least)) continue;
        least = distance2;
        weight.setZero();
        weight[i] = w[0], weight[j] = w[1], weight[k] = w[2];
      }
    }
    Vec3 x = Vec3::Zero();
    int kept = 0;
    for (int k = 0; k < count_; ++k) {
      if (!(weight[k] > 0)) continue;
      x += weight[k] * point_[k];
      point_[kept++] = point_[k];
    }
    count_ = kept;
    return x;
  }

 private:
  double reach_;
  Vec3 point_[4];
  int count_ = 0;
};

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

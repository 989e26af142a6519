// Up to four points of the difference of two bodies, and the point of their hull that is nearest to the
// origin: what the distance algorithm of Gilbert, Johnson & Keerthi (1988) goes on from.
#pragma once

#include <cmath>

#include "contact/overlap/growing_hull.h"
#include "nurbs/tolerances.h"
#include "nurbs/types.h"

namespace nurbs {

class DifferenceSimplex {
 public:
  struct Corner {
    Vec3 x;
    int a = 0, b = 0;   // numbers of the two bodies' points
    double weight = 0;  // in the nearest point
  };

  // `reach`: size of the larger body, a length.
  explicit DifferenceSimplex(double reach) : reach_(reach) {}

  int count() const { return count_; }
  const Corner& corner(int k) const { return corner_[k]; }

  // False where the point is there already.
  bool add(const Vec3& x, int a = 0, int b = 0) {
    constexpr double kSamePoint = 1e-24;  // of the square of the reach
    for (int k = 0; k < count_; ++k)
      if ((x - corner_[k].x).squaredNorm() <= kSamePoint * reach_ * reach_) return false;
    corner_[count_++] = {x, a, b, 0};
    return true;
  }

  bool surrounds_origin() const {
    constexpr double kInsideBy = 1e-9;  // of the reach: heights of the origin over the faces round it
    if (count_ < 4) return false;
    for (int k = 0; k < 4; ++k) {
      const Vec3 &p = corner_[(k + 1) % 4].x, &q = corner_[(k + 2) % 4].x, &r = corner_[(k + 3) % 4].x;
      const Vec3 n = (q - p).cross(r - p).normalized();
      const double own = n.dot(corner_[k].x - p), origin = -n.dot(p);
      if (!(origin * own > 0 && std::abs(origin) > kInsideBy * reach_)) return false;
    }
    return true;
  }

  // Drops the points that do not hold it: three are left at most. Not for an origin inside of four.
  Vec3 nearest() {
    weigh();
    Vec3 x = Vec3::Zero();
    int kept = 0;
    for (int k = 0; k < count_; ++k) {
      if (!(corner_[k].weight > 0)) continue;
      x += corner_[k].weight * corner_[k].x;
      corner_[kept++] = corner_[k];
    }
    count_ = kept;
    return x;
  }

 private:
  void weigh() {
    if (count_ == 1) {
      corner_[0].weight = 1;
    } else if (count_ == 2) {
      const Vec3 way = corner_[1].x - corner_[0].x;
      corner_[1].weight = std::fmin(std::fmax(-corner_[0].x.dot(way) / way.squaredNorm(), 0.0), 1.0);
      corner_[0].weight = 1 - corner_[1].weight;
    } else {
      double least = kFarAway;
      for (int without = count_ == 3 ? 3 : 0; without < 4; ++without) {
        const int i = without == 0 ? 1 : 0, j = without <= 1 ? 2 : 1, k = without <= 2 ? 3 : 2;
        const Vec3 w = nearest_on_triangle(corner_[i].x, corner_[j].x, corner_[k].x);
        const double distance2 =
            (w[0] * corner_[i].x + w[1] * corner_[j].x + w[2] * corner_[k].x).squaredNorm();
        if (!(distance2 < least)) continue;
        least = distance2;
        for (Corner& c : corner_) c.weight = 0;
        corner_[i].weight = w[0], corner_[j].weight = w[1], corner_[k].weight = w[2];
      }
    }
  }

  double reach_;
  Corner corner_[4];
  int count_ = 0;
};

}  // namespace nurbs

// How far the triangles of a hull are from a point that is not its origin, kept while the hull grows.
#pragma once

#include <algorithm>
#include <array>

#include "contact/overlap/growing_hull.h"

namespace nurbs {

// Asked again and again for the triangle nearest to a target. Most triangles are still there the next time:
// those whose number has other vertices, which do not move, are looked at. 70 kB, left uninitialised.
class FaceDistances {
 public:
  // -1: no triangle.
  struct Nearest {
    int face;
    double distance2;
  };

  // The hull has been started again, maybe with its points elsewhere.
  void forget() { known_ = 0; }

  // The living triangle nearest to the target without those that have a vertex of number v with
  // is_left_out(v), which may not change from call to call.
  template <class LeftOut>
  Nearest nearest(const GrowingHull& hull, const Vec3& target, LeftOut is_left_out) {
    if (target != target_) forget();
    target_ = target;
    Nearest near{-1, kFarAway};
    for (int k = 0; k < hull.faces(); ++k) {
      const GrowingHull::Face& f = hull.face(k);
      if (!f.alive) {
        vertex_[k].fill(-1);
        continue;
      }
      const bool known = k < known_ && vertex_[k] == f.vertex;
      if (!known) vertex_[k] = f.vertex;
      if (known && !(distance2_[k] < near.distance2)) continue;
      if (!known || !exact_[k]) {
        exact_[k] = true;
        const double above = f.normal.dot(target) - f.offset;  // 0 of slivers
        if (std::any_of(f.vertex.begin(), f.vertex.end(), is_left_out)) {
          distance2_[k] = kFarAway;
        } else if (above * above > kPlaneBeyond * near.distance2) {
          distance2_[k] = above * above / kPlaneBeyond;
          exact_[k] = false;
        } else {
          const Vec3 p = hull.point(f.vertex[0]) - target, q = hull.point(f.vertex[1]) - target,
                     r = hull.point(f.vertex[2]) - target, w = nearest_on_triangle(p, q, r);
          distance2_[k] = (w[0] * p + w[1] * q + w[2] * r).squaredNorm();
        }
      }
      if (distance2_[k] < near.distance2) near = {k, distance2_[k]};
    }
    known_ = hull.faces();
    return near;
  }

 private:
  static constexpr double kPlaneBeyond = 4;  // times the least distance, squared: no triangle in it is nearer

  Vec3 target_ = Vec3::Zero();
  int known_ = 0;  // triangles looked at, dead ones included
  std::array<short, 3> vertex_[kHullFaces];
  double distance2_[kHullFaces];  // or, unless `exact_`, no more than that
  bool exact_[kHullFaces];
};

}  // namespace nurbs

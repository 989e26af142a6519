// Leaves of every patch, and the kinked joints, painted onto the nodes of the direction atlas; see
// inner_map.h.
#include "body/inner_map.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "body/shape.h"
#include "body/surface_bounds.h"
#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

constexpr int kCaps = static_cast<int>(kInnerCaps.size()), kStretches = static_cast<int>(kStretchCaps.size());
constexpr double kAround = 0.65;     // rad: the widest cap, leaves of 0.1 and a node's own reach
constexpr double kLeastShare = 0.8;  // of the least eigenvalue that a stretch keeps: the rest is its room
constexpr double kTiltShare = 0.05;  // of a stretch given away for the tilt of its direction
constexpr double kCosineRoundoff = 1e-6;  // of the nodes' normals, which are kept as floats here
constexpr float kLarge = std::numeric_limits<float>::max();

float down(double x) {
  return x > 0 ? std::nextafter(static_cast<float>(std::min(x, 1e30)), 0.0f) : 0.0f;
}

// Of each of the atlas's directions those within kAround, all that a narrow leaf nearest to it may touch: the
// same for all shapes.
const std::vector<std::vector<int>>& neighbours(const DirectionAtlas& atlas) {
  static const std::vector<std::vector<int>> around = [&] {
    const int count = atlas.nodes();
    std::vector<Vec3> d(count);
    for (int i = 0; i < count; ++i) d[i] = atlas.direction(i).normalized();
    std::vector<std::vector<int>> near(count);
    for (int i = 0; i < count; ++i)
      for (int j = 0; j < count; ++j)
        if (d[i].dot(d[j]) >= std::cos(kAround)) near[i].push_back(j);
    return near;
  }();
  return around;
}

// The largest kink of the joints that a leaf touches.
double kink_at(const Shape& shape, const Cell& c) {
  const auto& links = shape.links[c.patch];
  const bool touches[4] = {c.u0 <= 0, c.u0 + c.du >= 1, c.v0 <= 0, c.v0 + c.dv >= 1};
  double kink = 0;
  for (int e = 0; e < 4; ++e)
    if (touches[e]) kink = std::max({kink, std::abs(links[e].kink), links[e].kink_bound});
  return kink;
}

class Painter {
 public:
  Painter(const Shape& shape, InnerMap& map) : shape_(shape), map_(map), count_(map.nodes.size()) {
    for (auto& n : normal_) n.resize(count_);
    for (std::size_t i = 0; i < count_; ++i)
      for (int k = 0; k < 3; ++k) normal_[k][i] = static_cast<float>(map.nodes[i].normal[k]);
    Least none;
    none.radius.fill(kLarge);
    none.least.fill(kLarge);
    least_.assign(count_, none);
    nearest_.assign(count_, -2);
    cosine_.resize(count_);
  }

  void paint(const std::vector<Leaf>& leaves) {
    // Four patches meet in a corner: no two normals there are further apart than their kinks together.
    const double widest = kGapsCrossed * std::max(shape_.proofs.opening, shape_.proofs.closing);
    for (const Leaf& leaf : leaves) {
      const CellBounds& b = leaf.bounds;
      const float radius = b.regular ? down(b.min_radius) : 0, least = b.regular ? down(stretch(b)) : 0;
      const double crease = b.regular && kink_at(shape_, leaf.cell) > kNoKink ? widest : 0;
      see(b.axis, b.regular ? threshold(b.cone + crease + kInnerCaps.back()) : -2);
      lower(b.regular ? b.cone : M_PI, radius, least);
      if (crease > 0) lower(b.cone + crease, 0, 0);
      follow(b);
    }
    const double all = shape_.joints.none() ? shape_.patch_curvature.min_radius : 0;
    for (std::size_t i = 0; i < count_; ++i)
      for (int k = 0; k < kCaps; ++k)
        map_.nodes[i].radius[k] = std::max(down(all), least_[i].radius[k] < kLarge ? least_[i].radius[k] : 0);
    begin_stretches();
    for (const Leaf& leaf : leaves) limit(leaf);
    for (InnerStretch& s : map_.stretches)
      for (int k = 0; k < kStretches; ++k) {
        if (!(s.least[k] < down(all))) continue;
        s.least[k] = down(all);
        s.most[k] = 0;
      }
  }

 private:
  static double stretch(const CellBounds& b) { return b.stretch.least * std::cos(b.cone) * std::cos(b.cone); }
  static float threshold(double angle) {
    return angle < M_PI ? static_cast<float>(std::cos(angle) - kCosineRoundoff) : -2;
  }

  // The nodes whose normals have a cosine above `from` with a leaf's axis.
  void see(const Vec3& axis, float from) {
    const auto x = static_cast<float>(axis[0]), y = static_cast<float>(axis[1]),
               z = static_cast<float>(axis[2]);
    seen_.clear();
    const auto look = [&](int i) {
      cosine_[i] = x * normal_[0][i] + y * normal_[1][i] + z * normal_[2][i];
      if (cosine_[i] >= from) seen_.push_back(i);
    };
    if (from > narrow_) {
      for (const int i : neighbours(shape_.atlas)[shape_.atlas.nearest(axis)]) look(i);
    } else {
      for (int i = 0; i < static_cast<int>(count_); ++i) look(i);
    }
  }
  // What may touch a cap is within `cone` of the axis.
  void lower(double cone, float radius, float least) {
    float in_cap[kCaps], in_stretch[kStretches];
    for (int k = 0; k < kCaps; ++k) in_cap[k] = threshold(cone + kInnerCaps[k]);
    for (int k = 0; k < kStretches; ++k) in_stretch[k] = threshold(cone + kStretchCaps[k]);
    for (const int i : seen_) {
      Least& to = least_[i];
      for (int k = kCaps - 1; k >= 0 && cosine_[i] >= in_cap[k]; --k)
        to.radius[k] = std::min(to.radius[k], radius);
      for (int k = kStretches - 1; k >= 0 && cosine_[i] >= in_stretch[k]; --k)
        to.least[k] = std::min(to.least[k], least);
    }
  }

  // Each node's direction of stretch is that of the leaf nearest to it.
  void follow(const CellBounds& b) {
    for (const int i : seen_) {
      if (!(cosine_[i] > nearest_[i])) continue;
      nearest_[i] = cosine_[i];
      for (int k = 0; k < 3; ++k) map_.stretches[i].along[k] = static_cast<float>(b.stretch.along[k]);
    }
  }

  void begin_stretches() {
    for (std::size_t i = 0; i < count_; ++i) {
      InnerStretch& s = map_.stretches[i];
      const Vec3& n = map_.nodes[i].normal;
      Vec3 f(s.along[0], s.along[1], s.along[2]);
      f -= n.dot(f) * n;
      const bool some = f.norm() > 0.5;
      if (some) f.normalize();
      for (int k = 0; k < 3; ++k) s.along[k] = static_cast<float>(f[k]);
      for (int k = 0; k < kStretches; ++k) {
        const bool seen = some && least_[i].least[k] < kLarge;
        s.least[k] = seen ? down(kLeastShare * least_[i].least[k]) : 0;
        s.most[k] = seen && s.least[k] > 0 ? 1e30f : 0;
      }
    }
  }

  // On a leaf W(v, v) >= l1 (v.f1)^2 + l2 (v.f2)^2, where (v.f1)^2 + (v.f2)^2 >= cos^2 cone and |v.axis| <=
  // sin cone. With f = x f1 + y f2 + z axis, (f.v)^2 <= (1 + t) (x v1 + y v2)^2 + (1 + 1/t) z^2 sin^2 cone,
  // so that most r and least m hold if, with m' = (m + r (1 + 1/t) z^2 sin^2 cone) / cos^2 cone, the matrix
  // (l1 - m', 0; 0, l2 - m') - (1 + t) r (x, y)(x, y)' has no negative eigenvalue.
  void limit(const Leaf& leaf) {
    const CellBounds& b = leaf.bounds;
    if (!b.regular) return;  // there the least is 0, and so is the most
    float within[kStretches];
    for (int k = 0; k < kStretches; ++k) within[k] = threshold(b.cone + kStretchCaps[k]);
    see(b.axis, within[kStretches - 1]);
    const double c2 = std::cos(b.cone) * std::cos(b.cone), s2 = 1 - c2;
    const Vec3 &f1 = b.stretch.along, f2 = b.axis.cross(f1);
    for (const int i : seen_) {
      InnerStretch& s = map_.stretches[i];
      const Vec3 f(s.along[0], s.along[1], s.along[2]);
      const double x = f.dot(f1), y = f.dot(f2), z = f.dot(b.axis);
      for (int k = 0; k < kStretches; ++k) {
        if (!(s.most[k] > 0) || !(cosine_[i] >= within[k])) continue;
        double r = std::min<double>(s.most[k], b.stretch.most);
        const double m = (s.least[k] + r * (1 + 1 / kTiltShare) * z * z * s2) / c2;
        const double d1 = b.stretch.most - m, d2 = b.stretch.least - m;
        const double worth = x * x * d2 + y * y * d1;
        r = d1 > 0 && d2 > 0 ? std::min(r, d1 * d2 / (worth * (1 + kTiltShare))) : 0;
        s.most[k] = down(r * (1 - 1e-6));
      }
    }
  }

  const Shape& shape_;
  InnerMap& map_;
  const std::size_t count_;
  std::array<std::vector<float>, 3> normal_;
  struct Least {
    std::array<float, kCaps> radius;
    std::array<float, kStretches> least;
  };
  std::vector<Least> least_;
  std::vector<float> nearest_, cosine_;
  std::vector<int> seen_;
  const float narrow_ = static_cast<float>(std::cos(kAround - M_SQRT2 / kAtlasCells) + kCosineRoundoff);
};

}  // namespace

InnerMap make_inner_map(const Shape& shape, const SurfaceBounds& bounds) {
  InnerMap map;
  if (shape.dented() || shape.joint_slack > 0) return map;
  const DirectionAtlas& atlas = shape.atlas;
  map.nodes.resize(atlas.nodes());
  map.stretches.resize(atlas.nodes());
  for (int i = 0; i < atlas.nodes(); ++i) {
    map.nodes[i].point = atlas.point[i];
    map.nodes[i].normal = atlas.direction(i).normalized();
  }
  Painter(shape, map).paint(bounds.leaves);
  return map;
}

}  // namespace nurbs

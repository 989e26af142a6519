// Leaves of every patch, and the kinked joints, painted onto the nodes of the direction atlas; see
// inner_map.h.
#include "body/inner_map.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "body/cube_map.h"
#include "body/shape.h"
#include "body/surface_bounds.h"
#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

constexpr int kCaps = static_cast<int>(kInnerCaps.size()), kStretches = static_cast<int>(kStretchCaps.size());
constexpr double kAround = 0.65;        // rad: the widest cap, leaves of 0.1 and a node's own reach
constexpr double kWidestKink = 0.3;     // rad: bodies of sharper edges have next to nothing to tell
constexpr double kLeafCone = 0.015;     // rad: leaves as narrow are not halved for their eigenvalues ...
constexpr double kLeafTightness = 1.1;  // ... nor those that are known as well
constexpr int kMostLeafCells = 9000,
              kMostFlatCells = 24000;  // of round bodies and of those with a normal map
constexpr double kLeastShare = 0.9;    // of the least eigenvalue that a stretch keeps: the rest is its room
constexpr double kTiltShare = 0.05;    // of a stretch given away for the tilt of its direction
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

// What no leaf has touched is 0, as what a leaf without normals has.
float or_none(float x) {
  return x < kLarge ? x : 0;
}
float threshold(double angle) {
  return angle < M_PI ? static_cast<float>(std::cos(angle) - kCosineRoundoff) : -2;
}
// Of W, for unit tangents of the leaf.
double upright_least(const CellBounds& b) {
  return b.stretch.least * std::cos(b.cone) * std::cos(b.cone);
}
// Four patches meet in a corner: no two normals there are further apart than their kinks together.
double widest_kink(const Shape& shape) {
  return kGapsCrossed * std::max(shape.proofs.opening, shape.proofs.closing);
}

// The radii.
class NodePainter {
 public:
  NodePainter(const Shape& shape, InnerMap& map) : shape_(shape), map_(map), count_(map.nodes.size()) {
    for (auto& n : normal_) n.resize(count_);
    for (std::size_t i = 0; i < count_; ++i)
      for (int k = 0; k < 3; ++k) normal_[k][i] = static_cast<float>(map.nodes[i].normal[k]);
    std::array<float, kCaps> none;
    none.fill(kLarge);
    least_.assign(count_, none);
    cosine_.resize(count_);
  }

  void paint(const std::vector<Leaf>& leaves) {
    for (const Leaf& leaf : leaves) {
      const CellBounds& b = leaf.bounds;
      const double crease = b.regular && kink_at(shape_, leaf.cell) > kNoKink ? widest_kink(shape_) : 0;
      see(b.axis, b.regular ? threshold(b.cone + crease + kInnerCaps.back()) : -2);
      lower(b.regular ? b.cone : M_PI, b.regular ? down(std::max(b.min_radius, upright_least(b))) : 0);
      if (crease > 0) lower(b.cone + crease, 0);
    }
    const double all = shape_.joints.none() ? shape_.patch_curvature.min_radius : 0;
    for (std::size_t i = 0; i < count_; ++i)
      for (int k = 0; k < kCaps; ++k) map_.nodes[i].radius[k] = std::max(down(all), or_none(least_[i][k]));
  }

 private:
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
  void lower(double cone, float radius) {
    float within[kCaps];
    for (int k = 0; k < kCaps; ++k) within[k] = threshold(cone + kInnerCaps[k]);
    for (const int i : seen_)
      for (int k = kCaps - 1; k >= 0 && cosine_[i] >= within[k]; --k)
        least_[i][k] = std::min(least_[i][k], radius);
  }

  const Shape& shape_;
  InnerMap& map_;
  const std::size_t count_;
  std::array<std::vector<float>, 3> normal_;
  std::vector<std::array<float, kCaps>> least_;
  std::vector<float> cosine_;
  std::vector<int> seen_;
  const float narrow_ = static_cast<float>(std::cos(kAround - M_SQRT2 / kAtlasCells) + kCosineRoundoff);
};

// The stretches.
class StretchPainter {
 public:
  StretchPainter(const Shape& shape, InnerMap& map)
      : shape_(shape), cells_(map.stretches), nearest_(cells_.size(), -2) {
    for (InnerStretch& s : cells_) s.least.fill(kLarge);
  }

  void paint(const std::vector<Leaf>& leaves) {
    for (const Leaf& leaf : leaves) {
      const CellBounds& b = leaf.bounds;
      lower(b, b.cone, b.regular ? down(upright_least(b)) : 0, true);
      if (b.regular && kink_at(shape_, leaf.cell) > kNoKink) lower(b, b.cone + widest_kink(shape_), 0, false);
    }
    begin();
    for (const Leaf& leaf : leaves) limit(leaf);
    const float all = down(shape_.joints.none() ? shape_.patch_curvature.min_radius : 0);
    for (InnerStretch& s : cells_)
      for (int k = 0; k < kStretches; ++k) {
        if (!(s.least[k] < all)) continue;
        s.least[k] = all;
        s.most[k] = 0;
      }
  }

 private:
  static const std::vector<Vec3>& middles() {
    static const std::vector<Vec3> all = [] {
      std::vector<Vec3> d(6 * kStretchCells * kStretchCells);
      for (std::size_t i = 0; i < d.size(); ++i) d[i] = InnerMap::middle(static_cast<int>(i));
      return d;
    }();
    return all;
  }

  // Calls visit(cell, cosine, caps) for cells of which the `caps` widest may be touched by what is within
  // `cone` of the axis.
  template <class Visit>
  void visit(const CellBounds& b, double cone, const Visit& visit) const {
    const std::vector<Vec3>& middle = middles();
    float within[kStretches];
    for (int k = 0; k < kStretches; ++k) within[k] = b.regular ? threshold(cone + kStretchCaps[k]) : -2;
    const auto look = [&](int cell) {
      const auto cosine = static_cast<float>(b.axis.dot(middle[cell]));
      int first = kStretches;
      while (first > 0 && cosine >= within[first - 1]) --first;
      if (first < kStretches) visit(cell, cosine, first);
    };
    const double widest = cone + kStretchCaps[kStretches - 1] + 1e-3;
    if (b.regular && widest <= 0.3)
      visit_cells(b.axis, widest, kStretchCells, look);
    else
      for (int cell = 0; cell < static_cast<int>(cells_.size()); ++cell) look(cell);
  }

  // A cell's direction is that of the leaf nearest to it.
  void lower(const CellBounds& b, double cone, float least, bool lead) {
    visit(b, cone, [&](int cell, float cosine, int first) {
      InnerStretch& s = cells_[cell];
      for (int k = first; k < kStretches; ++k) s.least[k] = std::min(s.least[k], least);
      if (!lead || !(cosine > nearest_[cell])) return;
      nearest_[cell] = cosine;
      for (int k = 0; k < 3; ++k) s.along[k] = static_cast<float>(b.stretch.along[k]);
    });
  }

  void begin() {
    for (std::size_t i = 0; i < cells_.size(); ++i) {
      InnerStretch& s = cells_[i];
      const Vec3& n = middles()[i];
      Vec3 f(s.along[0], s.along[1], s.along[2]);
      f -= n.dot(f) * n;
      const bool some = f.norm() > 0.5;
      if (some) f.normalize();
      for (int k = 0; k < 3; ++k) s.along[k] = static_cast<float>(f[k]);
      for (int k = 0; k < kStretches; ++k) {
        s.least[k] = some ? down(kLeastShare * or_none(s.least[k])) : 0;
        s.most[k] = s.least[k] > 0 ? 1e30f : 0;
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
    const double c2 = std::cos(b.cone) * std::cos(b.cone), s2 = 1 - c2;
    const Vec3 &f1 = b.stretch.along, f2 = b.axis.cross(f1);
    visit(b, b.cone, [&](int cell, float, int first) {
      InnerStretch& s = cells_[cell];
      const Vec3 f(s.along[0], s.along[1], s.along[2]);
      const double x = f.dot(f1), y = f.dot(f2), z = f.dot(b.axis);
      for (int k = first; k < kStretches; ++k) {
        if (!(s.most[k] > 0)) continue;
        double r = std::min<double>(s.most[k], b.stretch.most);
        const double m = (s.least[k] + r * (1 + 1 / kTiltShare) * z * z * s2) / c2;
        const double d1 = b.stretch.most - m, d2 = b.stretch.least - m;
        const double worth = x * x * d2 + y * y * d1;
        r = d1 > 0 && d2 > 0 ? std::min(r, d1 * d2 / (worth * (1 + kTiltShare))) : 0;
        s.most[k] = down(r * (1 - 1e-6));
      }
    });
  }

  const Shape& shape_;
  std::vector<InnerStretch>& cells_;
  std::vector<float> nearest_;
};

}  // namespace

Vec3 InnerMap::middle(int cell) {
  constexpr int n = kStretchCells;
  return cell_middle(cell / (n * n), cell / n % n, cell % n, n).normalized();
}

int InnerMap::cell(const Vec3& d) {
  const CubePoint c = to_cube(d);
  return (c.face * kStretchCells + cube_cell(c.a, kStretchCells)) * kStretchCells +
         cube_cell(c.b, kStretchCells);
}

InnerMap make_inner_map(const Shape& shape) {
  InnerMap map;
  if (shape.dented() || shape.joint_slack > 0 || widest_kink(shape) > kWidestKink) return map;
  SurfaceBounds bounds = bound_surface(shape, shape.proofs.sphere, {false, true});
  // A leaf that may have any normal leaves no direction a radius.
  const auto tells = [](const Leaf& leaf) { return leaf.bounds.regular; };
  if (!std::all_of(bounds.leaves.begin(), bounds.leaves.end(), tells)) return map;
  const DirectionAtlas& atlas = shape.atlas;
  map.nodes.resize(atlas.nodes());
  map.stretches.resize(6 * kStretchCells * kStretchCells);
  for (int i = 0; i < atlas.nodes(); ++i) {
    map.nodes[i].point = atlas.point[i];
    map.nodes[i].normal = atlas.direction(i).normalized();
  }
  if (!shape.proofs.sphere)
    refine_stretches(kLeafCone, kLeafTightness, shape.normal_map.cells > 0 ? kMostFlatCells : kMostLeafCells,
                     &bounds);
  NodePainter(shape, map).paint(bounds.leaves);
  StretchPainter(shape, map).paint(bounds.leaves);
  return map;
}

}  // namespace nurbs

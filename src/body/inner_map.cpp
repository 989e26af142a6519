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
constexpr int kBlock = 16;              // nodes painted side by side
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
// Less what joints take that count as smooth.
double least_of(const Shape& shape, const CellBounds& b) {
  return shape.small_kinks.inside(std::max(b.min_radius, upright_least(b)));
}
// Where joints open, normals between their sides' are supported there. Four patches meet in a corner: no two
// normals there are further apart than their kinks together.
bool opens(const Shape& shape) {
  return shape.proofs.opening > kNoKink;
}
double widest_kink(const Shape& shape) {
  return opens(shape) ? kGapsCrossed * std::max(shape.proofs.opening, shape.proofs.closing) : 0;
}
// Whether a leaf touches a joint beside which there may be such normals.
bool may_fan(const Shape& shape, const Cell& c) {
  if (!opens(shape)) return false;
  const auto& links = shape.links[c.patch];
  const bool touches[4] = {c.u0 <= 0, c.u0 + c.du >= 1, c.v0 <= 0, c.v0 + c.dv >= 1};
  for (int e = 0; e < 4; ++e)
    if (touches[e] && links[e].kinked()) return true;
  return false;
}

// The radii. Nodes lie in blocks, neighbours mostly: those too far from a leaf are left out as one.
class NodePainter {
 public:
  NodePainter(const Shape& shape, InnerMap& map) : shape_(shape), map_(map) {
    const std::size_t count = map.nodes.size();
    block_.resize((count + kBlock - 1) / kBlock);
    for (std::size_t b = 0; b < block_.size(); ++b) {
      Block& block = block_[b];
      Vec3 sum = Vec3::Zero();
      for (int i = 0; i < kBlock; ++i) {
        const Vec3& n = map.nodes[std::min(b * kBlock + i, count - 1)].normal;
        sum += n;
        for (int k = 0; k < 3; ++k) block.normal[k][i] = static_cast<float>(n[k]);
        for (int k = 0; k < kCaps; ++k) block.least[k][i] = kLarge;
      }
      block.middle = sum.normalized();
      double least = 1;
      for (int i = 0; i < kBlock; ++i)
        least = std::min(least, block.middle.dot(map.nodes[std::min(b * kBlock + i, count - 1)].normal));
      block.cosine = least - kCosineRoundoff;
      block.sine = std::sqrt(std::max(0.0, 1 - block.cosine * block.cosine));
    }
  }

  void paint(const std::vector<Leaf>& leaves) {
    for (const Leaf& leaf : leaves) {
      const CellBounds& b = leaf.bounds;
      if (!b.regular) {
        lower(b.axis, M_PI, 0);
        continue;
      }
      lower(b.axis, b.cone, down(least_of(shape_, b)));
      if (may_fan(shape_, leaf.cell)) lower(b.axis, b.cone + widest_kink(shape_), 0);
    }
    const double all = shape_.joints.none() ? shape_.patch_curvature.min_radius : 0;
    for (std::size_t i = 0; i < map_.nodes.size(); ++i)
      for (int k = 0; k < kCaps; ++k)
        map_.nodes[i].radius[k] = std::max(down(all), or_none(block_[i / kBlock].least[k][i % kBlock]));
  }

 private:
  struct Block {
    float normal[3][kBlock];
    float least[kCaps][kBlock];
    Vec3 middle;
    double cosine, sine;  // of the angle from it to the furthest
  };

  // What may touch a node's cap is within `cone` of the axis.
  void lower(const Vec3& axis, double cone, float radius) {
    const auto x = static_cast<float>(axis[0]), y = static_cast<float>(axis[1]),
               z = static_cast<float>(axis[2]);
    float within[kCaps];
    for (int k = 0; k < kCaps; ++k) within[k] = threshold(cone + kInnerCaps[k]);
    const double widest = cone + kInnerCaps.back(), c = std::cos(widest), s = std::sin(widest);
    const bool all = widest >= 0.5 * M_PI;
    for (Block& block : block_) {
      if (!all && axis.dot(block.middle) < c * block.cosine - s * block.sine) continue;
      for (int i = 0; i < kBlock; ++i) {
        const float cosine = x * block.normal[0][i] + y * block.normal[1][i] + z * block.normal[2][i];
        for (int k = 0; k < kCaps; ++k) {
          const float seen = cosine >= within[k] ? radius : kLarge;
          block.least[k][i] = seen < block.least[k][i] ? seen : block.least[k][i];
        }
      }
    }
  }

  const Shape& shape_;
  InnerMap& map_;
  std::vector<Block> block_;
};

// The stretches.
class StretchPainter {
 public:
  StretchPainter(const Shape& shape, InnerMap& map)
      : shape_(shape), cells_(map.stretches), nearest_(cells_.size(), -2), most_(cells_.size()) {
    for (InnerStretch& s : cells_) s.least.fill(kLarge);
  }

  void paint(const std::vector<Leaf>& leaves) {
    for (const Leaf& leaf : leaves) {
      const CellBounds& b = leaf.bounds;
      lower(b, b.cone, b.regular ? down(b.convex ? upright_least(b) : b.min_radius) : 0, true);
      if (b.regular && may_fan(shape_, leaf.cell)) lower(b, b.cone + widest_kink(shape_), 0, false);
    }
    begin();
    for (const Leaf& leaf : leaves) limit(leaf);
    for (std::size_t i = 0; i < cells_.size(); ++i)
      for (int k = 0; k < kStretches; ++k) cells_[i].most[k] = down(most_[i][k] * (1 - 1e-6));
    const float all = down(shape_.joints.none() ? shape_.patch_curvature.min_radius : 0);
    for (InnerStretch& s : cells_)
      for (int k = 0; k < kStretches; ++k) {
        take_small_kinks(&s.least[k], &s.most[k]);
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

  // Concave in the radius along a tangent: a chord is below.
  void take_small_kinks(float* least, float* most) const {
    const SmallKinks& kinks = shape_.small_kinks;
    const double before = *least, low = kinks.inside(before), high = kinks.inside(before + *most);
    *least = down(low);
    *most = down((high - low) * (1 - 1e-6));
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
        most_[i][k] = s.least[k] > 0 ? kFarAway : 0;
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
    const double c2 = std::cos(b.cone) * std::cos(b.cone), s2 = 1 - c2, over = 1 / c2;
    const Vec3 &f1 = b.stretch.along, f2 = b.axis.cross(f1);
    visit(b, b.cone, [&](int cell, float, int first) {
      InnerStretch& s = cells_[cell];
      const Vec3 f(s.along[0], s.along[1], s.along[2]);
      const double x = f.dot(f1), y = f.dot(f2), z = f.dot(b.axis),
                   tilted = (1 + 1 / kTiltShare) * z * z * s2;
      for (int k = first; k < kStretches; ++k) {
        double& most = most_[cell][k];
        if (!(most > 0)) continue;
        most = std::min(most, b.stretch.most);
        const double m = (s.least[k] + most * tilted) * over;
        const double d1 = b.stretch.most - m, d2 = b.stretch.least - m;
        const double worth = (x * x * d2 + y * y * d1) * (1 + kTiltShare);
        if (!(d1 > 0 && d2 > 0))
          most = 0;
        else if (d1 * d2 < most * worth)
          most = d1 * d2 / worth;
      }
    });
  }

  const Shape& shape_;
  std::vector<InnerStretch>& cells_;
  std::vector<float> nearest_;
  std::vector<std::array<double, kStretches>> most_;
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
  if (shape.joint_slack > 0 || widest_kink(shape) > kWidestKink) return map;
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

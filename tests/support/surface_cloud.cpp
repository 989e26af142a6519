// See surface_cloud.h.
#include "support/surface_cloud.h"

#include <algorithm>
#include <cmath>

namespace nurbs::test {
namespace {

constexpr int kPoints = 5000;  // about
constexpr int kBlock = 4;      // points of a patch's grid, either way

// Newton where d . x is concave, else along the gradient; inside the patch, only ever up.
Vec3 ascend(const BezierPatch& patch, const Vec3& d, double u, double v) {
  Jet2 jet = evaluate2(patch, u, v);
  double h = d.dot(jet.s);
  for (int iteration = 0; iteration < 1000; ++iteration) {  // dents take hundreds
    Eigen::Vector2d g(d.dot(jet.su), d.dot(jet.sv));
    Eigen::Matrix2d m;
    m << d.dot(jet.suu), d.dot(jet.suv), d.dot(jet.suv), d.dot(jet.svv);
    const double at[2] = {u, v};
    for (int k = 0; k < 2; ++k)
      if ((at[k] <= 0 && g[k] <= 0) || (at[k] >= 1 && g[k] >= 0)) {  // held by an edge
        g[k] = 0;
        m(0, 1) = m(1, 0) = 0;
        m(k, k) = -1;
      }
    const double metric[2] = {jet.su.squaredNorm() + 1e-12, jet.sv.squaredNorm() + 1e-12};
    Eigen::Vector2d step(g[0] / metric[0], g[1] / metric[1]);
    if (m.determinant() > 1e-14 * m.squaredNorm() && m.trace() < 0) step = -m.inverse() * g;
    bool moved = false;
    for (int halving = 0; halving < 30 && !moved; ++halving, step *= 0.5) {
      const double u2 = std::clamp(u + step[0], 0.0, 1.0), v2 = std::clamp(v + step[1], 0.0, 1.0);
      if (std::abs(u2 - u) + std::abs(v2 - v) < 1e-13) return jet.s;
      const Jet2 next = evaluate2(patch, u2, v2);
      const double h2 = d.dot(next.s);
      if (!(h2 > h)) continue;
      u = u2;
      v = v2;
      h = h2;
      jet = next;
      moved = true;
    }
    if (!moved) break;
  }
  return jet.s;
}

}  // namespace

SurfaceCloud::SurfaceCloud(const Shape& shape) : shape_(shape) {
  const int patches = static_cast<int>(shape.patches.size());
  per_side_ = std::max(5, static_cast<int>(std::sqrt(kPoints / patches)));
  points_.resize(patches * per_side_ * per_side_, 3);
  for (int p = 0, at = 0; p < patches; ++p)
    for (int i = 0; i < per_side_; ++i)
      for (int j = 0; j < per_side_; ++j, ++at)
        points_.row(at) = evaluate0(shape.patches[p], parameter(i), parameter(j)).array();
}

double SurfaceCloud::coarse(const Vec3& d) const {
  return (points_.col(0) * d[0] + points_.col(1) * d[1] + points_.col(2) * d[2]).maxCoeff();
}

Vec3 SurfaceCloud::exact_point(const Vec3& d) const {
  const int count = per_side_ * per_side_;
  heights_ = points_.col(0) * d[0] + points_.col(1) * d[1] + points_.col(2) * d[2];
  int top;
  double best = heights_.maxCoeff(&top);
  Vec3 point = points_.row(top);
  const double near = best - 0.01 * shape_.bounding_radius;
  using Grid = Eigen::Map<const Eigen::Array<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>;
  for (size_t p = 0; p < shape_.patches.size(); ++p) {
    const Grid grid(heights_.data() + p * count, per_side_, per_side_);
    // On a dented face several maxima lie side by side: the highest point of each block of the grid is a
    // start.
    for (int i0 = 0; i0 < per_side_; i0 += kBlock)
      for (int j0 = 0; j0 < per_side_; j0 += kBlock) {
        int i, j;
        const auto block =
            grid.block(i0, j0, std::min(kBlock, per_side_ - i0), std::min(kBlock, per_side_ - j0));
        if (block.maxCoeff(&i, &j) < near) continue;
        const Vec3 x = ascend(shape_.patches[p], d, parameter(i0 + i), parameter(j0 + j));
        if (x.dot(d) <= best) continue;
        best = x.dot(d);
        point = x;
      }
  }
  return point;
}

}  // namespace nurbs::test

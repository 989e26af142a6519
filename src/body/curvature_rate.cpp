// Difference quotients of the inverse Weingarten map over a grid; see curvature_rate.h.
#include "body/curvature_rate.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

struct Node {
  Vec3 normal;
  Mat3 w;
  bool valid;
};

Node node_at(const BezierPatch& patch, double u, double v) {
  const Jet2 jet = evaluate2(patch, u, v);
  Node node;
  const Vec3 cross = jet.su.cross(jet.sv);
  node.normal = cross.normalized();
  Mat2 second;
  second << -node.normal.dot(jet.suu), -node.normal.dot(jet.suv), -node.normal.dot(jet.suv),
      -node.normal.dot(jet.svv);
  const double det = second.determinant();
  node.valid = cross.squaredNorm() > 0 && det > 0 && second(0, 0) > 0;
  if (!node.valid) return node;
  Eigen::Matrix<double, 3, 2> j;
  j << jet.su, jet.sv;
  Mat2 inverse;
  inverse << second(1, 1), -second(0, 1), -second(1, 0), second(0, 0);
  node.w = j * (inverse / det) * j.transpose();
  return node;
}

// |W_b - Q W_a Q'| per radian, Q the shortest turn of a's normal into b's.
double quotient(const Node& a, const Node& b) {
  const double angle = angle_between(a.normal, b.normal);
  if (!(angle > 0)) return 0;
  const Vec3 axis = a.normal.cross(b.normal);
  // Never opposite, which would have no shortest turn: neighbours on a grid. (Eigen's FromTwoVectors brings
  // in a singular value decomposition for that case, half the time this file takes to compile.)
  const Mat3 q = Quat(1 + a.normal.dot(b.normal), axis[0], axis[1], axis[2]).normalized().toRotationMatrix();
  return (b.w - q * a.w * q.transpose()).norm() / angle;
}

}  // namespace

double bound_curvature_rate(const BezierPatch& patch) {
  constexpr int n = kRateSamples;
  std::vector<Node> grid;
  grid.reserve((n + 1) * (n + 1));
  const auto at = [](int i) { return kRateInset + (1 - 2 * kRateInset) * i / n; };
  for (int i = 0; i <= n; ++i)
    for (int j = 0; j <= n; ++j) grid.push_back(node_at(patch, at(i), at(j)));
  double rate = 0;
  for (int i = 0; i <= n; ++i)
    for (int j = 0; j <= n; ++j) {
      const Node& here = grid[i * (n + 1) + j];
      if (!here.valid) return std::numeric_limits<double>::infinity();
      if (i < n) rate = std::max(rate, quotient(here, grid[(i + 1) * (n + 1) + j]));
      if (j < n) rate = std::max(rate, quotient(here, grid[i * (n + 1) + j + 1]));
      if (i < n && j < n) rate = std::max(rate, quotient(here, grid[(i + 1) * (n + 1) + j + 1]));
    }
  return kRateSafety * rate;
}

}  // namespace nurbs

// Spline bases and joint conditions over a cube.
#include "shapes/smooth_cube.h"

#include <Eigen/SparseCholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>

namespace nurbs {
namespace {

int knot_multiplicity(int degree) {
  return degree <= 3 ? std::max(degree - 1, 1) : degree - 2;
}

std::vector<double> span_ends(int spans, CubeKind kind) {
  std::vector<double> ends;
  for (int k = 0; k <= spans; ++k) {
    const double at = static_cast<double>(k) / spans, inside = std::tan((2 * at - 1) * M_PI / 4);
    ends.push_back(kind == CubeKind::points ? at : k == 0 ? -1 : k == spans ? 1 : inside);
  }
  return ends;
}

std::vector<double> spline_knots(int degree, const std::vector<double>& ends, int multiplicity) {
  std::vector<double> knots(degree + 1, ends.front());
  for (size_t k = 1; k + 1 < ends.size(); ++k) knots.insert(knots.end(), multiplicity, ends[k]);
  knots.insert(knots.end(), degree + 1, ends.back());
  return knots;
}

// The q + 1 splines of degree q alive on the span that ends at knot k + 1 (NURBS Book A2.2).
void splines(const std::vector<double>& knots, int q, int k, double t, double* b) {
  b[0] = 1;
  for (int p = 1; p <= q; ++p) {
    double saved = 0;
    for (int r = 0; r < p; ++r) {
      const double right = knots[k + r + 1], left = knots[k + 1 - p + r], share = b[r] / (right - left);
      b[r] = saved + (right - t) * share;
      saved = (t - left) * share;
    }
    b[p] = saved;
  }
}

// Coefficients over splines of degree q - 1 become those of the derivative's splines of degree q: the
// transpose of differencing control points (NURBS Book eq. 2.7).
void raise(const std::vector<double>& knots, int q, int k, const double* lower, double* out) {
  for (int r = 0; r <= q; ++r) {
    const int i = k - q + r;
    const double before = r > 0 ? lower[r - 1] / (knots[i + q] - knots[i]) : 0;
    const double after = r < q ? lower[r] / (knots[i + q + 1] - knots[i + 1]) : 0;
    out[r] = q * (before - after);
  }
}

}  // namespace

SmoothCube::SmoothCube(int degree, int spans, CubeKind kind)
    : kind_(kind),
      degree_(degree),
      spans_(spans),
      multiplicity_(knot_multiplicity(degree)),
      breaks_(span_ends(spans, kind)),
      knots_(spline_knots(degree, breaks_, multiplicity_)),
      net_(net_size(degree, spans)),
      conditions_(joint_conditions()) {}

int SmoothCube::net_size(int degree, int spans) {
  return (spans - 1) * knot_multiplicity(degree) + degree + 1;
}

std::vector<SmoothCube::Piece> SmoothCube::pieces() const {
  std::vector<Piece> pieces;
  for (int f = 0; f < kCubeFaces; ++f)
    for (int a = 0; a < spans_; ++a)
      for (int b = 0; b < spans_; ++b) {
        Piece piece{f, a, b, {}};
        for (int i = 0; i <= degree_; ++i)
          for (int j = 0; j <= degree_; ++j) piece.columns.push_back(index(f, a, b, i, j));
        pieces.push_back(std::move(piece));
      }
  return pieces;
}

SmoothCube::Shares SmoothCube::shares(const Basis& u, const Basis& v) const {
  const int n = degree_ + 1;
  Shares out(n * n, 6);
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j)
      out.row(i * n + j) << u.value[i] * v.value[j], u.slope[i] * v.value[j], u.value[i] * v.slope[j],
          u.bend[i] * v.value[j], u.slope[i] * v.slope[j], u.value[i] * v.bend[j];
  return out;
}

int SmoothCube::span_of(double parameter) const {
  int a = 0;
  while (a + 1 < spans_ && parameter > breaks_[a + 1]) ++a;
  return a;
}

SmoothCube::Basis SmoothCube::basis(int a, double t) const {
  const int k = degree_ + a * multiplicity_;
  const double at = parameter(a, t);
  Basis out{};
  splines(knots_, degree_, k, at, out.value);
  double lower[kMaxDegree + 1];
  splines(knots_, degree_ - 1, k, at, lower);
  raise(knots_, degree_, k, lower, out.slope);
  if (degree_ < 2) return out;
  double lowest[kMaxDegree + 1];
  splines(knots_, degree_ - 2, k, at, lowest);
  raise(knots_, degree_ - 1, k, lowest, lower);
  raise(knots_, degree_, k, lower, out.bend);
  return out;
}

// D1 + D2 - (2 t - 1) e', or D1 + D2 - (t g' - g), at degree + 1 places of every span, which makes it vanish
// all along.
Eigen::SparseMatrix<double> SmoothCube::joint_conditions() const {
  const int last = net_.size() - 1;
  const Basis start = basis(0, 0);
  std::vector<Eigen::Triplet<double>> entries;
  int rows = 0;
  for (int edge = 0; edge < 12; ++edge) {
    const int axis = edge / 4;
    const int b0 = edge & 1 ? last : 0, b1 = edge & 1 ? last - 1 : 1;
    const int c0 = edge & 2 ? last : 0, c1 = edge & 2 ? last - 1 : 1;
    const auto at = [&](int k, int b, int c) {
      std::array<int, 3> p{};
      p[axis] = k;
      p[(axis + 1) % 3] = b;
      p[(axis + 2) % 3] = c;
      return net_.index(p);
    };
    for (int a = 0; a < spans_; ++a) {
      for (int place = 0; place <= degree_; ++place) {
        const double t = (place + 0.5) / (degree_ + 1), whole = parameter(a, t);
        const Basis s = basis(a, t);
        std::map<int, double> row;
        for (int k = 0; k <= degree_; ++k) {
          const int at_k = a * multiplicity_ + k;
          const double across = start.slope[1] * s.value[k];
          row[at(at_k, b1, c0)] += across;
          row[at(at_k, b0, c1)] += across;
          const double along =
              kind_ == CubeKind::points ? (2 * whole - 1) * s.slope[k] : whole * s.slope[k] - s.value[k];
          row[at(at_k, b0, c0)] -= 2 * across + along;
        }
        double length = 0;
        for (const auto& [column, value] : row) length += value * value;
        for (const auto& [column, value] : row) entries.emplace_back(rows, column, value / std::sqrt(length));
        ++rows;
      }
    }
  }
  Eigen::SparseMatrix<double> out(rows, net_.count());
  out.setFromTriplets(entries.begin(), entries.end());
  return out;
}

// The shortest correction, four times.
Eigen::MatrixXd SmoothCube::tidied(Eigen::MatrixXd points) const {
  const Eigen::SparseMatrix<double> normal =
      conditions_ * Eigen::SparseMatrix<double>(conditions_.transpose());
  Eigen::SparseMatrix<double> regular(normal.rows(), normal.rows());
  regular.setIdentity();
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(
      Eigen::SparseMatrix<double>(normal + 1e-11 * regular));
  for (int pass = 0; pass < 4; ++pass)
    points -= conditions_.transpose() * Eigen::MatrixXd(solver.solve(Eigen::MatrixXd(conditions_ * points)));
  return points;
}

std::vector<NurbsSurface> SmoothCube::surfaces(const NetPoints& points) const {
  std::vector<Vec4> homogeneous;
  homogeneous.reserve(points.rows());
  for (int k = 0; k < points.rows(); ++k)
    homogeneous.emplace_back(points(k, 0), points(k, 1), points(k, 2), 1);
  return cube_surfaces(net_, degree_, knots_, homogeneous);
}

// y is linear over a face, so that its control points are y at the knots' means.
std::vector<NurbsSurface> SmoothCube::surfaces(const Eigen::VectorXd& gauge) const {
  std::vector<double> knots, means;
  for (double knot : knots_) knots.push_back(0.5 * (knot + 1));
  for (int i = 0; i < net_.size(); ++i) {
    double sum = 0;
    for (int k = 1; k <= degree_; ++k) sum += knots_[i + k];
    means.push_back(sum / degree_);
  }
  std::vector<Vec4> homogeneous(static_cast<size_t>(count()));
  for (int f = 0; f < kCubeFaces; ++f)
    for (int i = 0; i < net_.size(); ++i)
      for (int j = 0; j < net_.size(); ++j) {
        const int at = net_.index(f, i, j);
        homogeneous[at].head<3>() = cube_direction(f, means[i], means[j]);
        homogeneous[at][3] = gauge[at];
      }
  return cube_surfaces(net_, degree_, knots, homogeneous);
}

}  // namespace nurbs

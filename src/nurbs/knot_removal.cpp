#include "nurbs/knot_removal.h"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>

namespace nurbs {
namespace {

constexpr double kKnotRemoval = 1e-14;  // of the largest coordinate, and of weights, times the degree
constexpr double kJoinedWeights = 10;   // largest over smallest: an arc of 168 degrees; more if the spans'
                                        // own, that of a linear weight, make it so
constexpr double kSliver = 1e-3;        // of both spans: one that is joined even if that takes ...
constexpr double kSliverWeights = 1e9;  // ... such weights

using Points = std::vector<Vec4>;

// What a surface is between two of its knots of u: Bezier in u, one curve for each control point of v.
struct Span {
  double from = 0, to = 0;
  std::vector<Points> curves;
  double length() const { return to - from; }
};

// Bernstein polynomials at `t`, row i of degree i.
Eigen::MatrixXd bernstein(int degree, double t) {
  Eigen::MatrixXd b = Eigen::MatrixXd::Zero(degree + 1, degree + 1);
  b(0, 0) = 1;
  for (int i = 1; i <= degree; ++i)
    for (int k = 0; k <= i; ++k)
      b(i, k) = (k < i ? (1 - t) * b(i - 1, k) : 0) + (k > 0 ? t * b(i - 1, k - 1) : 0);
  return b;
}

// The linear map of a Bezier curve's points to those of its parts before and after `share` (NURBS Book,
// section 1.7: the sides of de Casteljau's triangle).
Eigen::MatrixXd cut_at(int degree, double share) {
  const Eigen::MatrixXd b = bernstein(degree, share);
  Eigen::MatrixXd map = Eigen::MatrixXd::Zero(2 * degree + 2, degree + 1);
  map.topRows(degree + 1) = b;
  for (int i = 0; i <= degree; ++i)
    map.row(degree + 1 + i).segment(i, degree - i + 1) = b.row(degree - i).head(degree - i + 1);
  return map;
}

struct Weights {
  double least = std::numeric_limits<double>::infinity(), most = 0;
  // Infinite if one is not positive.
  double spread() const { return least > 0 ? most / least : std::numeric_limits<double>::infinity(); }
};
Weights weights_of(const std::vector<Points>& curves) {
  Weights w;
  for (const Points& curve : curves)
    for (const Vec4& p : curve) w.least = std::min(w.least, p[3]), w.most = std::max(w.most, p[3]);
  return w;
}

// Both spans as one in `out`, if they are one polynomial: its ends are theirs, the points between those whose
// parts come closest to the spans. `reach`: of the largest coordinate. What a part's point is off, over its
// weight, bounds what the surface is.
bool join(const Span& left, const Span& right, double reach, Span& out) {
  const int degree = static_cast<int>(left.curves[0].size()) - 1, inner = degree - 1;
  const double length = left.length() + right.length(), digits = degree * kKnotRemoval;
  const Eigen::MatrixXd map = cut_at(degree, left.length() / length);
  const Weights of_left = weights_of(left.curves), of_right = weights_of(right.curves);
  const bool even =
      std::max(of_left.most, of_right.most) <= kJoinedWeights * std::min(of_left.least, of_right.least);
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> solver;
  if (inner > 0 && even) solver.compute(map.middleCols(1, inner));
  out = {left.from, right.to, left.curves};
  for (size_t k = 0; k < left.curves.size(); ++k) {
    const Points &before = left.curves[k], &after = right.curves[k];
    Eigen::MatrixX4d parts(2 * degree + 2, 4), whole(degree + 1, 4);
    for (int i = 0; i <= degree; ++i) {
      parts.row(i) = before[i];
      parts.row(degree + 1 + i) = after[i];
    }
    whole.row(0) = before.front();
    whole.row(degree) = after.back();
    if (inner > 0) {
      const Eigen::MatrixX4d rest = parts - map.col(0) * whole.row(0) - map.col(degree) * whole.row(degree);
      if (even) {
        whole.middleRows(1, inner) = solver.solve(rest);
      } else {
        const auto shares = parts.col(3).cwiseInverse().asDiagonal();
        whole.middleRows(1, inner) =
            (shares * map.middleCols(1, inner)).colPivHouseholderQr().solve(shares * rest);
      }
    }
    const Eigen::MatrixX4d off = (map * whole - parts).cwiseAbs();
    for (int i = 0; i < off.rows(); ++i)
      if (!(off.row(i).head<3>().maxCoeff() <= digits * reach * parts(i, 3) &&
            off(i, 3) <= digits * parts(i, 3)))
        return false;
    for (int i = 0; i <= degree; ++i) out.curves[k][i] = whole.row(i);
  }
  const bool sliver = std::min(left.length(), right.length()) <= kSliver * length;
  return weights_of(out.curves).spread() <=
         (sliver ? kSliverWeights : std::max(kJoinedWeights, of_left.spread() * of_right.spread()));
}

std::vector<Span> spans_of(const NurbsSurface& s) {
  std::vector<Span> spans;
  for (int k = s.degree_u; k < s.size_u; ++k) {
    if (!(s.knots_u[k] < s.knots_u[k + 1])) continue;
    Span span{s.knots_u[k], s.knots_u[k + 1], {}};
    for (int j = 0; j < s.size_v; ++j) {
      span.curves.push_back(bezier_points_u(s, k, j));
    }
    spans.push_back(std::move(span));
  }
  return spans;
}

NurbsSurface surface_of(const NurbsSurface& s, const std::vector<Span>& spans) {
  NurbsSurface out = s;
  out.knots_u.assign(static_cast<size_t>(s.degree_u) + 1, spans.front().from);
  for (const Span& span : spans) out.knots_u.insert(out.knots_u.end(), s.degree_u, span.to);
  out.knots_u.push_back(spans.back().to);
  out.size_u = static_cast<int>(spans.size()) * s.degree_u + 1;
  out.points.resize(static_cast<size_t>(out.size_u) * s.size_v);
  for (size_t k = 0; k < spans.size(); ++k)
    for (int j = 0; j < s.size_v; ++j)
      for (int i = k == 0 ? 0 : 1; i <= s.degree_u; ++i)
        out.point(static_cast<int>(k) * s.degree_u + i, j) = spans[k].curves[j][i];
  return out;
}

}  // namespace

NurbsSurface remove_knots_u(const NurbsSurface& s, int* removed) {
  *removed = 0;
  std::vector<Span> spans = spans_of(s);
  double reach = 0;
  for (const Vec4& p : s.points) reach = std::max(reach, p.head<3>().cwiseAbs().maxCoeff() / p[3]);
  // Short spans first: what is long is prolonged by little.
  std::vector<char> needed(spans.size(), false);  // the knot at the end of a span
  for (;;) {
    size_t next = spans.size();
    double shortest = std::numeric_limits<double>::infinity();
    for (size_t k = 0; k + 1 < spans.size(); ++k) {
      const double length = std::min(spans[k].length(), spans[k + 1].length());
      if (!needed[k] && length < shortest) shortest = length, next = k;
    }
    if (next == spans.size()) break;
    Span both;
    needed[next] = !join(spans[next], spans[next + 1], reach, both);
    if (needed[next]) continue;
    spans[next] = std::move(both);
    spans.erase(spans.begin() + static_cast<long>(next) + 1);
    needed.erase(needed.begin() + static_cast<long>(next));
    ++*removed;
  }
  return *removed == 0 ? s : surface_of(s, spans);
}

}  // namespace nurbs

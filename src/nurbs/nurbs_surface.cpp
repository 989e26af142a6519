// De Boor evaluation of a NURBS surface and its exact split into Bezier patches.
#include "nurbs/nurbs_surface.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <sstream>

namespace nurbs {
namespace {

constexpr double kMostWeights = 1e15;  // largest weight of a surface over its least

using Column = std::array<Vec4, kMaxDegree + 1>;  // the control points that act on one span

// The index k of the non-empty span with knots[k] <= t < knots[k + 1]; the last one at the end of the domain.
int find_span(const std::vector<double>& knots, int degree, int size, double t) {
  const auto first = knots.begin() + degree + 1, last = knots.begin() + size;
  int k = static_cast<int>(std::upper_bound(first, last, t) - knots.begin()) - 1;
  while (k > degree && knots[k] == knots[k + 1]) --k;  // t at the end of a domain whose last knots repeat
  return k;
}

// Blossom of the span k at `args[0..degree-1]`, by de Boor's triangle with one argument per level. `c` holds
// the points k - degree .. k on entry and is overwritten.
Vec4 blossom(const std::vector<double>& knots, int degree, int k, const double* args, Column& c) {
  for (int level = 1; level <= degree; ++level) {
    for (int i = degree; i >= level; --i) {
      const double left = knots[k - degree + i], right = knots[k + 1 + i - level];
      const double a = (args[level - 1] - left) / (right - left);
      c[i] = (1 - a) * c[i - 1] + a * c[i];
    }
  }
  return c[degree];
}

// Bezier points of the span k from the B-spline points `net[k - degree .. k]`.
Column bezier_points(const std::vector<double>& knots, int degree, int k, const Column& net) {
  Column out;
  double args[kMaxDegree];
  for (int i = 0; i <= degree; ++i) {
    for (int l = 0; l < degree; ++l) args[l] = l < degree - i ? knots[k] : knots[k + 1];
    Column work = net;
    out[i] = blossom(knots, degree, k, args, work);
  }
  return out;
}

// Non-empty spans inside the domain.
std::vector<int> spans_of(const std::vector<double>& knots, int degree, int size) {
  std::vector<int> spans;
  for (int k = degree; k < size; ++k) {
    if (knots[k] < knots[k + 1]) spans.push_back(k);
  }
  return spans;
}

bool weights_equal(const std::vector<Vec4>& points, double tolerance) {
  for (const Vec4& p : points) {
    if (std::abs(p[3] - points[0][3]) > tolerance * points[0][3]) return false;
  }
  return true;
}

void divide_by_weights(std::vector<Vec4>& points) {
  for (Vec4& p : points) p = Vec4(p[0] / p[3], p[1] / p[3], p[2] / p[3], 1);
}

BezierPatch bezier_patch(const NurbsSurface& s, int ku, int kv) {
  BezierPatch patch;
  patch.degree_u = s.degree_u;
  patch.degree_v = s.degree_v;
  patch.points.resize(static_cast<size_t>(s.degree_u + 1) * (s.degree_v + 1));
  std::array<Column, kMaxDegree + 1> rows;  // split in v, still B-spline in u
  for (int i = 0; i <= s.degree_u; ++i) {
    Column net;
    for (int j = 0; j <= s.degree_v; ++j) net[j] = s.point(ku - s.degree_u + i, kv - s.degree_v + j);
    rows[i] = bezier_points(s.knots_v, s.degree_v, kv, net);
  }
  for (int j = 0; j <= s.degree_v; ++j) {
    Column net;
    for (int i = 0; i <= s.degree_u; ++i) net[i] = rows[i][j];
    const Column column = bezier_points(s.knots_u, s.degree_u, ku, net);
    for (int i = 0; i <= s.degree_u; ++i) patch.point(i, j) = column[i];
  }
  patch.rational = !weights_equal(patch.points, 8 * std::numeric_limits<double>::epsilon());
  if (!patch.rational) divide_by_weights(patch.points);
  return patch;
}

std::string knot_defect(const std::vector<double>& knots, int degree, int size, char name) {
  std::ostringstream out;
  out.precision(17);
  const int expected = size + degree + 1, count = static_cast<int>(knots.size());
  if (size < degree + 1) {
    out << "size_" << name << " = " << size << ", must be at least degree_" << name
        << " + 1 = " << degree + 1;
    return out.str();
  }
  if (count != expected) {
    out << "knotvector_" << name << " has " << count << " knots, must have size_" << name << " + degree_"
        << name << " + 1 = " << expected;
    return out.str();
  }
  for (int i = 0, run = 1; i < count; ++i) {
    if (!std::isfinite(knots[i])) {
      out << "knotvector_" << name << "[" << i << "] = " << knots[i] << ", must be finite";
      return out.str();
    }
    if (i == 0) continue;
    if (knots[i] < knots[i - 1]) {
      out << "knotvector_" << name << "[" << i << "] = " << knots[i] << " is less than the knot before it, "
          << knots[i - 1] << ": knots must not decrease";
      return out.str();
    }
    run = knots[i] == knots[i - 1] ? run + 1 : 1;
    const bool inside = knots[i] > knots[degree] && knots[i] < knots[size];
    const int allowed = inside ? degree : degree + 1;
    if (run > allowed) {
      out << "knotvector_" << name << ": the knot " << knots[i] << " is repeated more than " << allowed
          << " times, the most allowed " << (inside ? "inside" : "at an end") << " for degree " << degree;
      return out.str();
    }
  }
  if (!(knots[degree] < knots[size])) {
    out << "knotvector_" << name << ": empty domain, knot " << degree << " = knot " << size << " = "
        << knots[size];
    return out.str();
  }
  return {};
}

}  // namespace

std::string find_defect(const NurbsSurface& s) {
  std::ostringstream out;
  out.precision(17);
  for (int d = 0; d < 2; ++d) {
    const int degree = d == 0 ? s.degree_u : s.degree_v;
    if (degree >= 1 && degree <= kMaxDegree) continue;
    out << "degree_"
        << "uv"[d] << " = " << degree << ", must be 1.." << kMaxDegree;
    return out.str();
  }
  std::string defect = knot_defect(s.knots_u, s.degree_u, s.size_u, 'u');
  if (defect.empty()) defect = knot_defect(s.knots_v, s.degree_v, s.size_v, 'v');
  if (!defect.empty()) return defect;
  const size_t expected = static_cast<size_t>(s.size_u) * s.size_v;
  if (s.points.size() != expected) {
    out << s.points.size() << " control points, must be size_u * size_v = " << expected;
    return out.str();
  }
  double lightest = std::numeric_limits<double>::infinity(), heaviest = 0;
  for (size_t i = 0; i < s.points.size(); ++i) {
    const double w = s.points[i][3];
    lightest = std::min(lightest, w);
    heaviest = std::max(heaviest, w);
    if (!(w > 0) || !std::isfinite(w)) {
      out << "weight[" << i << "] = " << w << ", must be > 0 and finite";
      return out.str();
    }
    for (int c = 0; c < 3; ++c) {
      if (std::isfinite(s.points[i][c])) continue;
      out << "control point " << i << " has "
          << "xyz"[c] << " = " << s.points[i][c] / w << ", must be finite";
      return out.str();
    }
  }
  if (heaviest > kMostWeights * lightest) {
    out.precision(6);
    out << "weights from " << lightest << " to " << heaviest << ", must be within a factor of "
        << kMostWeights;
    return out.str();
  }
  return {};
}

Vec3 evaluate(const NurbsSurface& s, double u, double v) {
  u = std::clamp(u, s.knots_u[s.degree_u], s.knots_u[s.size_u]);
  v = std::clamp(v, s.knots_v[s.degree_v], s.knots_v[s.size_v]);
  const int ku = find_span(s.knots_u, s.degree_u, s.size_u, u);
  const int kv = find_span(s.knots_v, s.degree_v, s.size_v, v);
  double args[kMaxDegree];
  std::fill(args, args + kMaxDegree, v);
  Column row, column;
  for (int i = 0; i <= s.degree_u; ++i) {
    for (int j = 0; j <= s.degree_v; ++j) row[j] = s.point(ku - s.degree_u + i, kv - s.degree_v + j);
    column[i] = blossom(s.knots_v, s.degree_v, kv, args, row);
  }
  std::fill(args, args + kMaxDegree, u);
  const Vec4 h = blossom(s.knots_u, s.degree_u, ku, args, column);
  return h.head<3>() / h[3];
}

std::vector<BezierPiece> split_to_bezier(const NurbsSurface& surface) {
  NurbsSurface s = surface;
  // Dividing exactly equal weights out first keeps the control points of a polynomial surface to the last
  // bit.
  if (weights_equal(s.points, 0)) divide_by_weights(s.points);
  std::vector<BezierPiece> pieces;
  const std::vector<int> spans_u = spans_of(s.knots_u, s.degree_u, s.size_u);
  const std::vector<int> spans_v = spans_of(s.knots_v, s.degree_v, s.size_v);
  for (int ku : spans_u) {
    for (int kv : spans_v) {
      pieces.push_back(
          {bezier_patch(s, ku, kv), s.knots_u[ku], s.knots_u[ku + 1], s.knots_v[kv], s.knots_v[kv + 1]});
    }
  }
  return pieces;
}

NurbsSurface bezier_surface(int degree_u, int degree_v, std::vector<Vec4> points) {
  const auto knots = [](int degree) {
    std::vector<double> k(static_cast<size_t>(degree) + 1, 0.0);
    k.insert(k.end(), k.size(), 1.0);
    return k;
  };
  NurbsSurface s;
  s.degree_u = degree_u;
  s.degree_v = degree_v;
  s.knots_u = knots(degree_u);
  s.knots_v = knots(degree_v);
  s.size_u = degree_u + 1;
  s.size_v = degree_v + 1;
  s.points = std::move(points);
  return s;
}

std::vector<Vec4> bezier_points_u(const NurbsSurface& s, int k, int j) {
  Column net;
  for (int i = 0; i <= s.degree_u; ++i) net[i] = s.point(k - s.degree_u + i, j);
  const Column points = bezier_points(s.knots_u, s.degree_u, k, net);
  return {points.begin(), points.begin() + s.degree_u + 1};
}

NurbsSurface insert_knot_u(const NurbsSurface& s, double u) {
  const int p = s.degree_u, k = find_span(s.knots_u, p, s.size_u, u);
  const auto repeated = static_cast<int>(std::count(s.knots_u.begin(), s.knots_u.end(), u));
  NurbsSurface out = s;
  out.knots_u.insert(out.knots_u.begin() + k + 1, u);
  ++out.size_u;
  out.points.resize(static_cast<size_t>(out.size_u) * s.size_v);
  for (int i = 0; i < out.size_u; ++i) {
    // Below the span the points stay, above it they move up by one; in it they are weighed.
    const bool below = i <= k - p, above = i > k - repeated;
    const double a = below ? 1 : above ? 0 : (u - s.knots_u[i]) / (s.knots_u[i + p] - s.knots_u[i]);
    for (int j = 0; j < s.size_v; ++j) {
      if (a == 1)
        out.point(i, j) = s.point(i, j);
      else if (a == 0)
        out.point(i, j) = s.point(i - 1, j);
      else
        out.point(i, j) = a * s.point(i, j) + (1 - a) * s.point(i - 1, j);
    }
  }
  return out;
}

NurbsSurface swap_uv(const NurbsSurface& s) {
  NurbsSurface out;
  out.degree_u = s.degree_v;
  out.degree_v = s.degree_u;
  out.knots_u = s.knots_v;
  out.knots_v = s.knots_u;
  out.size_u = s.size_v;
  out.size_v = s.size_u;
  out.points.resize(s.points.size());
  for (int i = 0; i < s.size_u; ++i) {
    for (int j = 0; j < s.size_v; ++j) out.point(j, i) = s.point(i, j);
  }
  return out;
}

}  // namespace nurbs

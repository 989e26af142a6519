// Derivatives by the azimuth from those by the arc's parameter; see ripple.h.
#include "body/ripple.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "nurbs/bernstein.h"
#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

using Real = ArcNet::Real;
using Row = std::vector<Real>;
using Vector = Eigen::Matrix<Real, 3, 1>;
using Number = Eigen::Matrix<Real, 1, 1>;

constexpr int kArcHalvings = 3;
constexpr double kSlack = 1.01;  // of the product's circles, which are nearly that

Row square_of(const UnitArc& arc) {  // x^2 + y^2
  Row sum = multiply(arc.x, arc.x);
  const Row y2 = multiply(arc.y, arc.y);
  for (size_t k = 0; k < sum.size(); ++k) sum[k] += y2[k];
  return sum;
}
Real least(const Row& a) {
  return *std::min_element(a.begin(), a.end());
}
Real largest(const Row& a) {
  Real most = 0;
  for (const Real x : a) most = std::max(most, std::abs(x));
  return most;
}

// What a function and its first two derivatives are at most.
struct Most {
  Real f = 0, f1 = 0, f2 = 0;

  void include(const Most& other) {
    f = std::max(f, other.f);
    f1 = std::max(f1, other.f1);
    f2 = std::max(f2, other.f2);
  }
};
Most operator+(const Most& a, const Most& b) {
  return {a.f + b.f, a.f1 + b.f1, a.f2 + b.f2};
}
Most operator*(const Most& a, const Most& b) {
  return {a.f * b.f, a.f1 * b.f + a.f * b.f1, a.f2 * b.f + 2 * a.f1 * b.f1 + a.f * b.f2};
}

Most most_of(const Row& a) {
  const Row first = derivative(a);
  return {largest(a), largest(first), largest(derivative(first))};
}
// Of 1 / f, f no less than `least` > 0.
Most inverse(const Most& f, Real least) {
  return {1 / least, f.f1 / (least * least),
          f.f2 / (least * least) + 2 * f.f1 * f.f1 / (least * least * least)};
}

// Derivatives of the parameter by the azimuth.
struct ByAzimuth {
  Real first, second;

  Most of(const Most& by_parameter) const {
    return {by_parameter.f, by_parameter.f1 * first,
            by_parameter.f2 * first * first + by_parameter.f1 * second};
  }
};

// phi = atan2(y, x), phi' = (x y' - y x') / (x^2 + y^2).
bool by_azimuth(const UnitArc& arc, const Row& square, ByAzimuth* by) {
  Row turn = difference(multiply(arc.x, derivative(arc.y)), multiply(arc.y, derivative(arc.x)));
  if (turn[0] < 0)
    for (Real& t : turn) t = -t;
  if (!(least(turn) > 0 && least(square) > 0)) return false;
  by->first = largest(square) / least(turn);
  const Row bend = difference(multiply(derivative(turn), square), multiply(turn, derivative(square)));
  by->second = largest(bend) / (least(square) * least(square)) * by->first * by->first * by->first;
  return true;
}

// A net, the product near it and their arc, or a part of all three along the arc.
struct Lines {
  ArcNet net, product;
  UnitArc arc;

  // Each line round the axis divided by the profile's weight there.
  void normalise() {
    for (int j = 0; j <= net.profile; ++j) {
      const Real factor = arc.w[0] / product.at(0, j)[3];
      for (int i = 0; i <= net.arc; ++i)
        for (ArcNet* of : {&net, &product})
          of->points[static_cast<size_t>(i) * (net.profile + 1) + j] *= factor;
    }
  }
  // Keeps the first half; the second one.
  Lines halve() {
    Lines second(*this);
    for (const auto& [of, to] : {std::pair(&net, &second.net), std::pair(&product, &second.product)})
      halve_net(of->points.data(), to->points.data(), of->arc, of->profile, true);
    for (const auto& [of, to] : {std::pair(&arc.x, &second.arc.x), std::pair(&arc.y, &second.arc.y),
                                 std::pair(&arc.w, &second.arc.w)})
      halve_row(of->data(), to->data(), net.arc, 1);
    return second;
  }

  Vector points_off(int i, int j) const { return (net.at(i, j) - product.at(i, j)).template head<3>(); }
  Number weights_off(int i, int j) const { return Number(net.at(i, j)[3] - product.at(i, j)[3]); }
  Number weights(int i, int j) const { return Number(net.at(i, j)[3]); }

  // Of one of these along line j round the axis.
  template <class Value>
  Most along_arc(int j, Value value) const {
    const auto at = [&](int i) { return (this->*value)(i, j); };
    const int n = net.arc;
    Most m;
    for (int i = 0; i <= n; ++i) {
      m.f = std::max<Real>(m.f, at(i).norm());
      if (i + 1 <= n) m.f1 = std::max<Real>(m.f1, n * (at(i + 1) - at(i)).norm());
      if (i + 2 <= n) m.f2 = std::max<Real>(m.f2, n * (n - 1) * (at(i + 2) - 2 * at(i + 1) + at(i)).norm());
    }
    return m;
  }
  // Its first derivative along the profile, at most.
  template <class Value>
  Real along_profile(Value value) const {
    Real most = 0;
    for (int i = 0; i <= net.arc; ++i)
      for (int j = 0; j < net.profile; ++j)
        most = std::max<Real>(most, net.profile * ((this->*value)(i, j + 1) - (this->*value)(i, j)).norm());
    return most;
  }
};

// The least weight, and how far a control point is from the axis point at most.
struct Extent {
  Real least_weight = std::numeric_limits<Real>::infinity(), furthest = 0;
  explicit Extent(const ArcNet& net) {
    for (const ArcNet::Point& p : net.points) {
      least_weight = std::min(least_weight, p[3]);
      furthest = std::max<Real>(furthest, p.head<3>().norm() / p[3]);
    }
  }
};

// By how much the arc's radius, the root of 1 + g, is off 1; nothing where that is not little.
std::optional<Most> radius_off(const UnitArc& arc) {
  const Row square = square_of(arc), w2 = multiply(arc.w, arc.w);
  if (!(least(w2) > 0)) return {};
  const Most g = most_of(difference(square, w2)) * inverse(most_of(w2), least(w2));
  if (!(g.f < 0.01)) return {};
  return Most{0.51L * g.f, 0.51L * g.f1, 0.51L * g.f2 + 0.26L * g.f1 * g.f1};
}

// What the lines round the axis are off the product's, `along` left out.
bool include_rows(const Lines& l, std::vector<Ripple>* rows) {
  ByAzimuth by;
  if (!by_azimuth(l.arc, square_of(l.arc), &by)) return false;
  const std::optional<Most> by_parameter = radius_off(l.arc);
  const Extent extent(l.net);
  if (!by_parameter || !(extent.least_weight > 0)) return false;
  const Most radius = by.of(*by_parameter);
  // P - P0 = (a - P0 b) / w, with what the nets differ by, a and, of weights, b. P0 runs round circles.
  Most w;
  for (int j = 0; j <= l.net.profile; ++j) w.include(by.of(l.along_arc(j, &Lines::weights)));
  const Most over = inverse(w, extent.least_weight);
  const Real round = kSlack * extent.furthest;
  for (int j = 0; j <= l.net.profile; ++j) {
    const Most a = by.of(l.along_arc(j, &Lines::points_off)), b = by.of(l.along_arc(j, &Lines::weights_off)),
               off = (a + Most{round, round, round} * b) * over;
    Real wide = 0;
    for (int i = 0; i <= l.net.arc; ++i)
      wide = std::max<Real>(wide, l.net.at(i, j).head<2>().norm() / extent.least_weight);
    wide *= kSlack;
    // In the turning half plane.
    (*rows)[j].include({static_cast<double>(off.f + wide * radius.f),
                        static_cast<double>(off.f1 + off.f + wide * radius.f1),
                        static_cast<double>(off.f2 + 2 * off.f1 + off.f + wide * radius.f2), 0});
  }
  return true;
}

// In parts of the arc: over short ones a bound is not far from what it bounds.
bool include_rows(Lines first, int halvings, std::vector<Ripple>* rows) {
  if (halvings == 0) return include_rows(first, rows);
  Lines second = first.halve();
  return include_rows(std::move(first), halvings - 1, rows) &&
         include_rows(std::move(second), halvings - 1, rows);
}

// What the ripple changes by along the profile.
double ripple_along(const Lines& l, double speed, Real radius_off) {
  const Extent extent(l.net);
  const Real round = kSlack * extent.furthest;
  Real most_top = 0, most_off = 0;
  for (int j = 0; j <= l.net.profile; ++j) {
    const Real off = l.along_arc(j, &Lines::weights_off).f;
    most_top = std::max(most_top, l.along_arc(j, &Lines::points_off).f + round * off);
    most_off = std::max(most_off, off);
  }
  const Real top_along = l.along_profile(&Lines::points_off) + kSlack * speed * most_off +
                         round * l.along_profile(&Lines::weights_off),
             along = (top_along + most_top * l.along_profile(&Lines::weights) / extent.least_weight) /
                     extent.least_weight;
  return static_cast<double>(along + kSlack * speed * radius_off);
}

}  // namespace

std::vector<Ripple> ripple_of(const ArcNet& net, const ArcNet& product, const UnitArc& arc, double speed) {
  const auto heavy = [](const ArcNet::Point& p) { return p[3] > 0; };
  if (net.arc < 2 || !std::all_of(net.points.begin(), net.points.end(), heavy) ||
      !std::all_of(product.points.begin(), product.points.end(), heavy))
    return {};
  Lines lines{net, product, arc};
  const std::optional<Most> radius = radius_off(arc);
  if (!radius) return {};
  const double along = ripple_along(lines, speed, radius->f);
  lines.normalise();
  std::vector<Ripple> rows(static_cast<size_t>(net.profile) + 1);
  if (!include_rows(std::move(lines), kArcHalvings, &rows)) return {};
  for (Ripple& r : rows) r.along = along;
  return rows;
}

}  // namespace nurbs

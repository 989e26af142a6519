// Derivatives by the azimuth from those by the arc's parameter; see ripple.h.
#include "body/ripple.h"

#include <algorithm>
#include <cmath>

#include "nurbs/bernstein.h"
#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

using Real = ArcNet::Real;
using Row = std::vector<Real>;

Row times(const Row& a, const Row& b) {
  return multiply(a, b, [](Real x, Real y) { return x * y; });
}
Row square_of(const UnitArc& arc) {  // x^2 + y^2
  Row sum = times(arc.x, arc.x);
  const Row y2 = times(arc.y, arc.y);
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
  Row turn = difference(times(arc.x, derivative(arc.y)), times(arc.y, derivative(arc.x)));
  if (turn[0] < 0)
    for (Real& t : turn) t = -t;
  if (!(least(turn) > 0 && least(square) > 0)) return false;
  by->first = largest(square) / least(turn);
  const Row bend = difference(times(derivative(turn), square), times(turn, derivative(square)));
  by->second = largest(bend) / (least(square) * least(square)) * by->first * by->first * by->first;
  return true;
}

// The first derivative along the profile, at most.
template <class Value>
Real along_profile(const ArcNet& net, const Value& value) {
  Real most = 0;
  for (int i = 0; i <= net.arc; ++i)
    for (int j = 0; j < net.profile; ++j)
      most = std::max<Real>(most, net.profile * (value(i, j + 1) - value(i, j)).norm());
  return most;
}

// Along line j round the axis, of one component of the nets or of what they differ by.
template <class Value>
Most along_arc(const ArcNet& net, int j, const Value& value) {
  const int n = net.arc;
  Most m;
  for (int i = 0; i <= n; ++i) {
    m.f = std::max<Real>(m.f, value(i, j).norm());
    if (i + 1 <= n) m.f1 = std::max<Real>(m.f1, n * (value(i + 1, j) - value(i, j)).norm());
    if (i + 2 <= n)
      m.f2 = std::max<Real>(m.f2, n * (n - 1) * (value(i + 2, j) - 2 * value(i + 1, j) + value(i, j)).norm());
  }
  return m;
}

}  // namespace

std::vector<Ripple> ripple_of(const ArcNet& net, const ArcNet& product, const UnitArc& arc, double speed) {
  constexpr double kSlack = 1.01;  // of the product's circles, which are nearly that
  ByAzimuth by;
  const Row square = square_of(arc), w2 = times(arc.w, arc.w);
  if (net.arc < 2 || !by_azimuth(arc, square, &by)) return {};
  using Vector = Eigen::Matrix<Real, 3, 1>;
  using Number = Eigen::Matrix<Real, 1, 1>;
  Real least_weight = net.at(0, 0)[3], furthest = 0;
  for (const ArcNet::Point& p : net.points) {
    if (!(p[3] > 0)) return {};
    least_weight = std::min(least_weight, p[3]);
    furthest = std::max<Real>(furthest, p.head<3>().norm() / p[3]);
  }
  // P - P0 = (a - P0 b) / w, with what the nets differ by, a and, of weights, b. P0 runs round circles.
  const auto points_off = [&](int i, int j) -> Vector {
    return (net.at(i, j) - product.at(i, j)).template head<3>();
  };
  const auto weights_off = [&](int i, int j) -> Number {
    return Number(net.at(i, j)[3] - product.at(i, j)[3]);
  };
  const auto weights = [&](int i, int j) -> Number { return Number(net.at(i, j)[3]); };
  Most w;
  for (int j = 0; j <= net.profile; ++j) w.include(by.of(along_arc(net, j, weights)));
  const Most over = inverse(w, least_weight);
  const Real round = kSlack * furthest;
  // The arc's own radius is the root of 1 + g.
  if (!(least(w2) > 0)) return {};
  const Most g = by.of(most_of(difference(square, w2)) * inverse(most_of(w2), least(w2)));
  if (!(g.f < 0.01)) return {};
  const Most radius{0.51L * g.f, 0.51L * g.f1, 0.51L * g.f2 + 0.26L * g.f1 * g.f1};
  Real most_top = 0, most_off = 0;
  std::vector<Ripple> rows;
  for (int j = 0; j <= net.profile; ++j) {
    const Most a = by.of(along_arc(net, j, points_off)), b = by.of(along_arc(net, j, weights_off)),
               top = a + Most{round, round, round} * b, off = top * over;
    Real wide = 0;
    for (int i = 0; i <= net.arc; ++i)
      wide = std::max<Real>(wide, net.at(i, j).head<2>().norm() / least_weight);
    wide *= kSlack;
    most_top = std::max(most_top, top.f);
    most_off = std::max(most_off, b.f);
    // In the turning half plane.
    rows.push_back({static_cast<double>(off.f + wide * radius.f),
                    static_cast<double>(off.f1 + off.f + wide * radius.f1),
                    static_cast<double>(off.f2 + 2 * off.f1 + off.f + wide * radius.f2), 0});
  }
  const Real top_along = along_profile(net, points_off) + kSlack * speed * most_off +
                         round * along_profile(net, weights_off),
             along = (top_along + most_top * along_profile(net, weights) / least_weight) / least_weight;
  for (Ripple& r : rows) r.along = static_cast<double>(along + kSlack * speed * radius.f);
  return rows;
}

}  // namespace nurbs

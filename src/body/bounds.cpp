// Branch and bound on Bernstein coefficients of the squared distance from the origin.
#include "body/bounds.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <queue>

#include "nurbs/bernstein.h"
#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

constexpr int kMostOutside = 500;  // halvings of a patch that may lie outside a ball

// The field num / den over a rectangle.
struct Field : SquaredDistance {
  double upper = 0;  // largest ratio of coefficients: bounds the field since den > 0
};

void update_upper(Field& f) {
  f.upper = -std::numeric_limits<double>::infinity();
  for (size_t i = 0; i < f.num.size(); ++i) f.upper = std::max(f.upper, f.num[i] / f.den[i]);
}

// Value at the corners, where coefficients are values.
double corner_value(const Field& f) {
  double best = -std::numeric_limits<double>::infinity();
  for (int i : {0, f.m}) {
    for (int j : {0, f.n}) {
      const size_t k = static_cast<size_t>(i) * (f.n + 1) + j;
      best = std::max(best, f.num[k] / f.den[k]);
    }
  }
  return best;
}

Field signed_distance(const BezierPatch& patch, double sign) {
  Field f{squared_distance(patch)};
  for (double& c : f.num) c *= sign;
  update_upper(f);
  return f;
}

std::pair<Field, Field> halve_field(Field f, bool in_u) {
  Field g = f;
  halve_net(f.num.data(), g.num.data(), f.m, f.n, in_u);
  halve_net(f.den.data(), g.den.data(), f.m, f.n, in_u);
  update_upper(f);
  update_upper(g);
  return {std::move(f), std::move(g)};
}

// Whether the field bends more along u than along v (largest second difference of the numerator).
bool bends_more_in_u(const Field& f) {
  double du = 0, dv = 0;
  const auto at = [&](int i, int j) {
    const size_t k = static_cast<size_t>(i) * (f.n + 1) + j;
    return f.num[k] / f.den[k];
  };
  for (int i = 0; i <= f.m; ++i) {
    for (int j = 0; j <= f.n; ++j) {
      if (i > 0 && i < f.m)
        du = std::max(du, std::abs(at(i - 1, j) - 2 * at(i, j) + at(i + 1, j)) * f.m * f.m);
      if (j > 0 && j < f.n)
        dv = std::max(dv, std::abs(at(i, j - 1) - 2 * at(i, j) + at(i, j + 1)) * f.n * f.n);
    }
  }
  return du >= dv;
}

// Upper bound of sign * |x|^2 over all patches.
double bound_squared(const std::vector<BezierPatch>& patches, double sign) {
  const auto lower = [](const Field& a, const Field& b) { return a.upper < b.upper; };
  std::priority_queue<Field, std::vector<Field>, decltype(lower)> open(lower);
  double reached = -std::numeric_limits<double>::infinity(), magnitude = 0;
  for (const BezierPatch& patch : patches) {
    Field f = signed_distance(patch, sign);
    reached = std::max(reached, corner_value(f));
    magnitude = std::max(magnitude, std::abs(f.upper));
    open.push(std::move(f));
  }
  for (int split = 0; split < kMaxSplits; ++split) {
    const Field& worst = open.top();
    if (worst.upper - reached <= kBoundWidth * std::abs(reached)) break;
    const bool in_u = bends_more_in_u(worst);
    auto [f, g] = halve_field(worst, in_u);
    open.pop();
    reached = std::max({reached, corner_value(f), corner_value(g)});
    open.push(std::move(f));
    open.push(std::move(g));
  }
  return open.top().upper + kBernsteinRoundoff * magnitude;
}

}  // namespace

SquaredDistance squared_distance(const BezierPatch& patch, double less) {
  SquaredDistance f;
  f.m = 2 * patch.degree_u;
  f.n = 2 * patch.degree_v;
  f.num.assign(static_cast<size_t>(f.m + 1) * (f.n + 1), 0);
  f.den = f.num;
  visit_products(patch, [&](size_t at, double c, const Vec4& a, const Vec4& b) {
    const double weight = a[3] * b[3];
    f.num[at] += c * (a.head<3>().dot(b.head<3>()) - less * weight);
    f.den[at] += c * weight;
  });
  for (size_t at = 0; at < f.num.size(); ++at) {
    const double c = product_weight(f.m, f.n, at);
    f.num[at] /= c;
    f.den[at] /= c;
  }
  return f;
}

double bound_off_unit_sphere(const BezierPatch& patch) {
  const SquaredDistance square = squared_distance(patch, 1);
  double most = 0;
  for (size_t k = 0; k < square.num.size(); ++k)
    most = std::max(most, std::abs(square.num[k]) / square.den[k]);
  return most;
}

bool lies_outside_unit_ball(const BezierPatch& patch, double slack) {
  Field whole{squared_distance(patch, 1)};
  for (double& c : whole.num) c = -c;
  update_upper(whole);
  std::vector<Field> open{std::move(whole)};
  for (int split = 0; !open.empty(); ++split) {
    Field worst = std::move(open.back());
    open.pop_back();
    if (worst.upper <= slack) continue;
    if (split == kMostOutside || corner_value(worst) > slack) return false;
    const bool in_u = bends_more_in_u(worst);
    auto [f, g] = halve_field(std::move(worst), in_u);
    open.push_back(std::move(f));
    open.push_back(std::move(g));
  }
  return true;
}

Vec3 bilinear_normal(const BezierPatch& patch) {
  const auto corner = [&](int i, int j) { return Vec3(patch.point(i, j).head<3>() / patch.point(i, j)[3]); };
  const Vec3 a = corner(0, 0), b = corner(0, 1), c = corner(1, 0), d = corner(1, 1);
  const auto off = [&](const Vec3& n) {
    return std::max({std::abs(n.dot(b - a)), std::abs(n.dot(c - a)), std::abs(n.dot(d - a))});
  };
  const Vec3 middle = ((c - a) + (d - b)).cross((b - a) + (d - c)).normalized();
  Vec3 best = middle;
  for (const Vec3& n :
       {(c - a).cross(b - a), (d - b).cross(b - a), (c - a).cross(d - c), (d - b).cross(d - c)})
    if (n.dot(middle) > 0 && off(n.normalized()) < off(best)) best = n.normalized();
  return best;
}

RadiusBounds bound_radius(const std::vector<BezierPatch>& patches) {
  RadiusBounds bounds;
  bounds.outer = std::sqrt(std::max(0.0, bound_squared(patches, 1)));
  bounds.inner = std::sqrt(std::max(0.0, -bound_squared(patches, -1)));
  return bounds;
}

}  // namespace nurbs

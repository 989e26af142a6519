// See hidden_dents.h.
#include "support/hidden_dents.h"

#include <algorithm>
#include <cmath>

#include "nurbs/bezier_patch.h"
#include "shapes/revolved.h"

namespace nurbs::test {
namespace {

constexpr double kBase = -2;

// An arc of the top's profile, from where the last one ends: Bernstein coefficients of f.
struct TopArc {
  double to;
  std::vector<double> z;
};

std::vector<NurbsSurface> block_under(const std::vector<TopArc>& arcs, double dome) {
  std::vector<NurbsSurface> surfaces;
  const auto add = [&](int across, const std::vector<Vec3>& points) {
    std::vector<Vec4> net;
    for (const Vec3& p : points) net.push_back(Vec4(p[0], p[1], p[2], 1));
    surfaces.push_back(bezier_surface(static_cast<int>(net.size()) / (across + 1) - 1, across, net));
  };
  const double bulge[] = {-0.5 * dome, 0.5 * dome, -0.5 * dome};  // over y = -1, 0, 1
  double from = -1;
  for (const TopArc& arc : arcs) {
    std::vector<Vec3> top, base, front, back;
    const double n = static_cast<double>(arc.z.size()) - 1;
    for (size_t k = 0; k < arc.z.size(); ++k) {
      const double x = from + (arc.to - from) * static_cast<double>(k) / n, z = arc.z[k];
      for (int j = 0; j < 3; ++j) top.emplace_back(x, j - 1, z + bulge[j]);
      const Vec3 near(x, -1, z + bulge[0]), far(x, 1, z + bulge[0]), low(x, -1, kBase), deep(x, 1, kBase);
      base.insert(base.end(), {deep, low});
      front.insert(front.end(), {low, near});
      back.insert(back.end(), {far, deep});
    }
    add(2, top);
    for (const auto& points : {base, front, back}) add(1, points);
    from = arc.to;
  }
  for (const bool last : {false, true}) {
    const double x = last ? 1 : -1, z = last ? arcs.back().z.back() : arcs.front().z.front();
    std::vector<Vec3> end;
    for (int j = 0; j < 3; ++j) {
      const Vec3 low(x, j - 1, kBase), high(x, j - 1, z + bulge[j]);
      end.insert(end.end(), {last ? high : low, last ? low : high});
    }
    add(1, end);
  }
  return surfaces;
}

// Of a block. `best` gives the x at which slope x + f(x) is largest.
template <class Top, class Best>
std::function<Vec3(const Vec3&)> block_support(const Top& top, const Best& best, double dome) {
  return [=](const Vec3& d) {
    const Vec3 base(d[0] < 0 ? -1 : 1, d[1] < 0 ? -1 : 1, kBase);
    if (!(d[2] > 0)) return base;
    const double flat = d[1] > 0   ? 1
                        : d[1] < 0 ? -1
                                   : 0,
                 y = dome > 0 ? std::clamp(d[1] / (d[2] * dome), -1.0, 1.0) : flat, x = best(d[0] / d[2]);
    const Vec3 on_top(x, y, top(x) - 0.5 * dome * y * y);
    return d.dot(on_top) > d.dot(base) ? on_top : base;
  };
}

// f(x) = -bend t^4 / 12 + bend w^2 t^2 / 2 + slope t, t = x - x0, from `low` to 1: a groove between t = -w
// and w.
struct Groove {
  double bend, w, x0, slope, low;

  double operator()(double x) const {
    const double t = x - x0;
    return -bend * t * t * t * t / 12 + bend * w * w * t * t / 2 + slope * t;
  }
  // Bernstein coefficients of degree 4 from blossoms: of t^m the mean of products of m of the arguments, j of
  // which are q.
  std::vector<double> coefficients() const {
    std::vector<double> z;
    const double p = low - x0, q = 1 - x0;
    for (int j = 0; j <= 4; ++j) {
      const double n = j;
      const double two = (n * (n - 1) * q * q + 2 * n * (4 - n) * p * q + (4 - n) * (3 - n) * p * p) / 12;
      z.push_back(-bend / 12 * std::pow(p, 4 - j) * std::pow(q, j) + bend * w * w / 2 * two +
                  slope * (n * q + (4 - n) * p) / 4);
    }
    return z;
  }
  // The x at which s x + f(x) is largest.
  double best(double s) const {
    const auto rises = [&](double x) {
      const double t = x - x0;
      return s + slope - bend * t * t * t / 3 + bend * w * w * t;
    };
    double at = low, most = -1e300;
    const auto look = [&](double x) {
      if (const double there = s * x + (*this)(x); there > most) most = there, at = x;
    };
    look(low);
    look(1);
    // Between the inflections the slope goes one way.
    const double ends[] = {low, std::clamp(x0 - w, low, 1.0), std::clamp(x0 + w, low, 1.0), 1};
    for (int k = 0; k < 3; ++k) {
      double from = ends[k], to = ends[k + 1];
      if (!(rises(from) > 0 && rises(to) <= 0)) continue;
      for (int step = 0; step < 60; ++step) {
        const double middle = 0.5 * (from + to);
        (rises(middle) > 0 ? from : to) = middle;
      }
      look(0.5 * (from + to));
    }
    return at;
  }
  double width() const { return 3 * bend * w * w * w; }
  double depth() const { return 0.75 * bend * std::pow(w, 4); }
};

}  // namespace

HiddenDent grooved_block(double bend, double w, double x0, double slope, double dome) {
  const Groove top{bend, w, x0, slope, -1};
  return {block_under({{1, top.coefficients()}}, dome), Vec3(-slope, 0, 1).normalized(), top.width(),
          top.depth(),
          block_support(
              top, [=](double s) { return top.best(s); }, dome)};
}

HiddenDent ringed_cone(double bend, double w, double r0, double shear) {
  // Steep enough at the tip.
  const Groove top{bend, w, r0, -0.5 - bend * r0 * (w * w + r0 * r0), 0};
  const std::vector<double> z = top.coefficients();
  std::vector<Vec3> curve;
  for (int k = 4; k >= 0; --k) curve.emplace_back(k / 4.0, z[k], 1);
  HiddenDent out;
  out.surfaces = {surface_of_revolution({Vec3(0, z[4], 1), Vec3(1, z[4], 1)}), surface_of_revolution(curve)};
  Mat3 affine = Mat3::Identity();
  affine(0, 2) = shear;
  affine(1, 1) = 1 + shear;
  for (NurbsSurface& s : out.surfaces)
    for (Vec4& p : s.points) p.head<3>() = (affine * p.head<3>()).eval();
  const double base = z[4];
  out.support = [=](const Vec3& d) -> Vec3 {
    const Vec3 e = affine.transpose() * d;
    const double across = std::hypot(e[0], e[1]), r = e[2] > 0 ? top.best(across / e[2]) : 1;
    const Vec2 along = across > 0 ? Vec2(e[0] / across, e[1] / across) : Vec2(1, 0);
    return affine * Vec3(r * along[0], r * along[1], e[2] > 0 ? top(r) : base);
  };
  out.normal = (affine.inverse().transpose() * Vec3(-top.slope, 0, 1)).normalized();
  out.width = top.width();
  out.depth = out.normal.dot(affine.col(2)) * top.depth();  // at this azimuth
  return out;
}

HiddenDent valley_block(double bend, double close, double x0, double slope, double dome) {
  const auto top = [=](double x) {
    const double t = x - x0;
    return slope * t + 0.5 * close * std::abs(t) - 0.5 * bend * t * t;
  };
  const auto corner = [=](double from, double to) {  // the middle coefficient: the polar form
    return 0.5 * slope * (from + to) + 0.25 * close * std::abs(from + to) - 0.5 * bend * from * to;
  };
  const auto best = [=](double s) {
    double at = -1, most = -1e300;
    for (const double side : {-1.0, 1.0}) {
      const double t = (s + slope + side * 0.5 * close) / bend, end = side - x0;
      const double x = x0 + (side > 0 ? std::clamp(t, 0.0, end) : std::clamp(t, end, 0.0));
      if (const double there = s * x + top(x); there > most) most = there, at = x;
    }
    return at;
  };
  return {block_under({{x0, {top(-1), corner(-1 - x0, 0), 0}}, {1, {0, corner(0, 1 - x0), top(1)}}}, dome),
          Vec3(-slope, 0, 1).normalized(), close, 0, block_support(top, best, dome)};
}

HiddenDent twisted_frustum(double off) {
  constexpr double kTop = 0.6;
  HiddenDent out;
  const double w = std::sqrt(0.5);
  for (int quarter = 0; quarter < 4; ++quarter) {
    const double c[3] = {1, 1, 0}, s[3] = {0, 1, 1}, weight[3] = {1, w, 1}, turn = 0.5 * M_PI * quarter;
    std::vector<Vec4> wall, bottom, top;
    for (int k = 0; k < 3; ++k) {
      const double x = std::cos(turn) * c[k] - std::sin(turn) * s[k],
                   y = std::sin(turn) * c[k] + std::cos(turn) * s[k],
                   other = weight[k] * std::pow(1 + off, k);
      const Vec4 low = weight[k] * Vec4(x, y, -1, 1), high = other * Vec4(kTop * x, kTop * y, 1, 1);
      wall.insert(wall.end(), {low, high});
      bottom.insert(bottom.end(), {weight[k] * Vec4(0, 0, -1, 1), low});
      top.insert(top.end(), {high, other * Vec4(0, 0, 1, 1)});
    }
    for (const auto& points : {wall, bottom, top}) out.surfaces.push_back(bezier_surface(2, 1, points));
  }
  out.normal = Vec3(2, 0, 1 - kTop).normalized();  // in the cone's meridian of azimuth 0
  out.width = 1e-3;
  // How far below the cone the wall is, at most.
  out.depth = 0;
  for (double u = 0; u <= 1; u += 0.05)
    for (double v = 0; v <= 1; v += 0.1) {
      const Vec3 x = evaluate(out.surfaces[0], u, v);
      out.depth = std::max(out.depth, out.normal.dot(Vec3(1 - std::hypot(x[0], x[1]), 0, -1 - x[2])));
    }
  out.support = [](const Vec3& d) {
    const double across = std::hypot(d[0], d[1]), high = kTop * across + d[2], low = across - d[2];
    const double r = high > low ? kTop : 1.0, z = high > low ? 1 : -1;
    return across > 0 ? Vec3(r * d[0] / across, r * d[1] / across, z) : Vec3(0, 0, z);
  };
  return out;
}

}  // namespace nurbs::test

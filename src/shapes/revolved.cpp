// Profiles, their revolution, and rounded boxes.
#include "shapes/revolved.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <string>

#include "body/shape.h"

namespace nurbs {
namespace {

constexpr double kLeastTurn = 1e-7;   // rad: corners that turn less are none
constexpr double kWholeEdge = 0.98;   // of an edge that only one corner takes from
constexpr double kLeastLine = 1e-12;  // of the profile: shorter ones are left out

ProfileArc line(const Vec2& from, const Vec2& to) {
  return {from, 0.5 * (from + to), to, 0};
}

// Arc of a circle about `center` from the polar angle a to b (rad, b > a, less than a half turn).
ProfileArc arc(const Vec2& center, double radius, double a, double b) {
  const auto at = [&](double t) { return Vec2(center + radius * Vec2(std::cos(t), std::sin(t))); };
  const double half = 0.5 * (b - a), middle = 0.5 * (a + b);
  return {at(a), center + radius / std::cos(half) * Vec2(std::cos(middle), std::sin(middle)), at(b),
          std::cos(half)};
}

NurbsSurface revolve(const ProfileArc& a) {
  const Vec3 from(a.from[0], a.from[1], 1), to(a.to[0], a.to[1], 1);
  if (a.weight > 0) return surface_of_revolution({from, {a.corner[0], a.corner[1], a.weight}, to});
  return surface_of_revolution({from, to});
}

// The profile below the equator, given from the pole outward, and its mirror image.
Profile mirrored(Profile lower) {
  const auto flip = [](const Vec2& p) { return Vec2(p[0], -p[1]); };
  for (int k = static_cast<int>(lower.size()) - 1; k >= 0; --k) {
    const ProfileArc a = lower[k];
    if (k == static_cast<int>(lower.size()) - 1 && a.weight == 0 && a.from[1] < 0 && a.to[1] > 0) continue;
    lower.push_back({flip(a.to), flip(a.corner), flip(a.from), a.weight});
  }
  return lower;
}

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.9g", value);
  return text;
}

// Cap of radius `cap` whose edge is rounded by `rim` up to the cylinder of `radius`, below a band.
Profile cap_and_rim(double radius, double band, double cap, double rim) {
  if (!(cap >= radius))
    throw ShapeError("the cap's radius is " + number(cap) + ", must be the body's radius, " + number(radius) +
                     ", at least");
  if (!(rim > 0 && rim < radius))
    throw ShapeError("the rim's radius is " + number(rim) + ", must be less than the body's radius, " +
                     number(radius));
  // The rim's centre is on r = radius - rim, inside the cap's sphere by cap - rim.
  const double across = radius - rim, down = std::sqrt((cap - radius) * (cap + radius - 2 * rim));
  const Vec2 rim_center(across, -0.5 * band), cap_center(0, -0.5 * band + down);
  const double joint = std::atan2(-down, across);  // polar angle of the common normal
  Profile out{arc(cap_center, cap, -M_PI / 2, joint)};
  if (joint < 0) out.push_back(arc(rim_center, rim, joint, 0));  // none below a half sphere
  return out;
}

// --- rounded box

constexpr double kHalf = 0.70710678118654752;

// Patch of degrees 1 or 2 from points and weights, v fastest.
NurbsSurface patch(int p, int q, const std::vector<Vec3>& points, const std::vector<double>& weights) {
  std::vector<Vec4> net;
  for (size_t k = 0; k < points.size(); ++k) {
    const Vec3 x = weights[k] * points[k];
    net.emplace_back(x[0], x[1], x[2], weights[k]);
  }
  return bezier_surface(p, q, std::move(net));
}

// A quarter cylinder between the faces of axes b and c (signs sb, sc), along axis a; a sphere's octant.
NurbsSurface quarter_cylinder(const Vec3& core, double r, int a, int b, int c, int sb, int sc) {
  std::vector<Vec3> points;
  for (int end : {-1, 1})
    for (const auto& [x, y] : {std::array{1, 0}, std::array{1, 1}, std::array{0, 1}}) {
      Vec3 p;
      p[a] = end * core[a];
      p[b] = sb * (core[b] + r * x);
      p[c] = sc * (core[c] + r * y);
      points.push_back(p);
    }
  return patch(1, 2, points, {1, kHalf, 1, 1, kHalf, 1});
}

NurbsSurface octant(const Vec3& core, double r, const std::array<int, 3>& sign) {
  std::vector<Vec3> points;
  std::vector<double> weights;
  constexpr int kQuarter[3][2] = {{1, 0}, {1, 1}, {0, 1}};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      const Vec3 p(r * kQuarter[i][0] * kQuarter[j][0], r * kQuarter[i][1] * kQuarter[j][0],
                   r * kQuarter[j][1]);
      points.emplace_back(sign[0] * (core[0] + p[0]), sign[1] * (core[1] + p[1]), sign[2] * (core[2] + p[2]));
      weights.push_back((i == 1 ? kHalf : 1) * (j == 1 ? kHalf : 1));
    }
  return patch(2, 2, points, weights);
}

}  // namespace

NurbsSurface surface_of_revolution(int degree, const std::vector<double>& knots,
                                   const std::vector<Vec3>& curve) {
  constexpr int kCircle[9][2] = {{1, 0},   {1, 1},  {0, 1},  {-1, 1}, {-1, 0},
                                 {-1, -1}, {0, -1}, {1, -1}, {1, 0}};
  NurbsSurface s;
  s.degree_u = 2;
  s.degree_v = degree;
  s.knots_u = {0, 0, 0, 0.25, 0.25, 0.5, 0.5, 0.75, 0.75, 1, 1, 1};
  s.knots_v = knots;
  s.size_u = 9;
  s.size_v = static_cast<int>(curve.size());
  for (int i = 0; i < s.size_u; ++i)
    for (const Vec3& p : curve) {
      const double w = p[2] * (i % 2 ? std::sqrt(0.5) : 1);
      s.points.push_back(w * Vec4(p[0] * kCircle[i][0], p[0] * kCircle[i][1], p[1], 1));
    }
  return s;
}

NurbsSurface surface_of_revolution(const std::vector<Vec3>& segment) {
  const size_t count = segment.size();
  std::vector<double> knots(2 * count, 0);
  std::fill_n(knots.begin() + static_cast<std::ptrdiff_t>(count), count, 1);
  return surface_of_revolution(static_cast<int>(count) - 1, knots, segment);
}

Profile rounded_profile(const std::vector<Vec2>& polygon, double cut) {
  const int last = static_cast<int>(polygon.size()) - 1;
  double size = 0;
  for (const Vec2& p : polygon) size = std::max(size, (p - polygon[0]).norm());
  std::vector<double> heading(last), half(last + 1);  // of edges; half the turn at each corner
  for (int k = 0; k < last; ++k) {
    const Vec2 edge = polygon[k + 1] - polygon[k];
    heading[k] = std::atan2(edge[1], edge[0]);
  }
  half[0] = heading[0];  // the mirror image comes in at - heading
  half[last] = M_PI - heading[last - 1];
  for (int k = 1; k < last; ++k) half[k] = 0.5 * (heading[k] - heading[k - 1]);
  const auto rounded = [&](int k) { return half[k] > kLeastTurn; };
  const auto reach = [&](int k, int other) {  // along the edge to another corner
    const double length = (polygon[k] - polygon[other]).norm();
    return rounded(other) ? 0.5 * length : kWholeEdge * length;
  };
  Profile out;
  Vec2 at = polygon[0];
  const auto draw_line = [&](const Vec2& to) {
    if ((to - at).norm() > kLeastLine * size) out.push_back(line(at, to));
  };
  for (int k = 0; k <= last; ++k) {
    if (!rounded(k)) {
      if (k > 0) draw_line(polygon[k]);
      at = polygon[k];
      continue;
    }
    const double room = std::min(k > 0 ? reach(k, k - 1) : 1e300, k < last ? reach(k, k + 1) : 1e300);
    const double radius = std::min(cut / (1 / std::cos(half[k]) - 1), room / std::tan(half[k]));
    // Polar angle of the corner's bisector, outward.
    const double outward = k == 0 ? -M_PI / 2 : k == last ? M_PI / 2 : heading[k - 1] + half[k] - M_PI / 2;
    const Vec2 center = polygon[k] - radius / std::cos(half[k]) * Vec2(std::cos(outward), std::sin(outward));
    ProfileArc a =
        arc(center, radius, k == 0 ? outward : outward - half[k], k == last ? outward : outward + half[k]);
    if (k == 0) a.from[0] = 0, a.corner[1] = a.from[1];
    if (k == last) a.to[0] = 0, a.corner[1] = a.to[1];
    if (k > 0) draw_line(a.from);
    if (k > 0 && (a.from - at).norm() <= kLeastLine * size) a.from = at;
    out.push_back(a);
    at = a.to;
  }
  return out;
}

std::vector<NurbsSurface> revolve(const Profile& profile) {
  std::vector<NurbsSurface> out;
  for (const ProfileArc& a : profile) out.push_back(revolve(a));
  return out;
}

std::vector<NurbsSurface> capsule(double radius, double length) {
  const Vec2 low(0, -0.5 * length), high(0, 0.5 * length);
  return revolve(Profile{arc(low, radius, -M_PI / 2, 0), line({radius, low[1]}, {radius, high[1]}),
                         arc(high, radius, 0, M_PI / 2)});
}

std::vector<NurbsSurface> tablet(double radius, double height, double rim) {
  if (!(rim > 0 && rim < radius && rim <= 0.5 * height))
    throw ShapeError("the rim's radius is " + number(rim) + ", must be less than the body's radius, " +
                     number(radius) + ", and at most half the height, " + number(0.5 * height));
  const double low = -0.5 * height, inner = radius - rim;
  Profile lower{line({0, low}, {inner, low}), arc({inner, low + rim}, rim, -M_PI / 2, 0)};
  if (rim < 0.5 * height) lower.push_back(line({radius, low + rim}, {radius, -low - rim}));
  return revolve(mirrored(lower));
}

std::vector<NurbsSurface> biconvex_tablet(double radius, double band, double cap, double rim) {
  Profile lower = cap_and_rim(radius, band, cap, rim);
  if (band > 0) lower.push_back(line({radius, -0.5 * band}, {radius, 0.5 * band}));
  return revolve(mirrored(lower));
}

std::vector<NurbsSurface> lens(double radius, double cap, double rim) {
  return biconvex_tablet(radius, 0, cap, rim);
}

std::vector<NurbsSurface> egg(double radius, double blunt, double pointed) {
  return revolve(Profile{{{0, -blunt}, {radius, -blunt}, {radius, 0}, kHalf},
                         {{radius, 0}, {radius, pointed}, {0, pointed}, kHalf}});
}

std::vector<NurbsSurface> rounded_box(const Vec3& half_extents, double radius) {
  const Vec3 core = half_extents - Vec3::Constant(radius);
  std::vector<NurbsSurface> out;
  for (int a = 0; a < 3; ++a) {
    const int b = (a + 1) % 3, c = (a + 2) % 3;
    for (int side : {-1, 1}) {
      if (core[b] > 0 && core[c] > 0) {
        std::vector<Vec3> points;
        for (int i : {-1, 1})
          for (int j : {-1, 1}) {
            Vec3 p;
            p[a] = side * half_extents[a];
            p[b] = side * i * core[b];
            p[c] = j * core[c];
            points.push_back(p);
          }
        out.push_back(patch(1, 1, points, {1, 1, 1, 1}));
      }
    }
    for (int sb : {-1, 1})
      for (int sc : {-1, 1})
        if (core[a] > 0) out.push_back(quarter_cylinder(core, radius, a, b, c, sb, sc));
  }
  for (int k = 0; k < 8; ++k)
    out.push_back(octant(core, radius, {k & 1 ? 1 : -1, k & 2 ? 1 : -1, k & 4 ? 1 : -1}));
  return out;
}

}  // namespace nurbs

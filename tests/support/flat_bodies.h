// Bodies with flat faces and straight lines for the tests: cylinder, tablet, rounded box, prism.
#pragma once

#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "body/shape.h"
#include "shapes/primitives.h"

namespace nurbs::test {

// A profile in the half plane (radius, z) as a NURBS curve, from the lower to the upper end of the axis.
struct Profile {
  int degree = 1;
  std::vector<double> knots;
  std::vector<Vec3> points;  // (radius, z, weight), not homogeneous
};

// The profile turned about z: u runs round in four quarters (NURBS Book, section 8.5), v along the profile.
inline std::vector<NurbsSurface> revolve(const Profile& profile) {
  constexpr int kCircle[9][2] = {{1, 0},   {1, 1},  {0, 1},  {-1, 1}, {-1, 0},
                                 {-1, -1}, {0, -1}, {1, -1}, {1, 0}};
  NurbsSurface s;
  s.degree_u = 2;
  s.degree_v = profile.degree;
  s.knots_u = {0, 0, 0, 0.25, 0.25, 0.5, 0.5, 0.75, 0.75, 1, 1, 1};
  s.knots_v = profile.knots;
  s.size_u = 9;
  s.size_v = static_cast<int>(profile.points.size());
  for (int i = 0; i < s.size_u; ++i) {
    for (const Vec3& p : profile.points) {
      const double w = p[2] * (i % 2 == 0 ? 1 : std::sqrt(0.5));
      s.points.push_back(w * Vec4(p[0] * kCircle[i][0], p[0] * kCircle[i][1], p[1], 1));
    }
  }
  return {s};
}

inline std::vector<NurbsSurface> cylinder(double radius, double half_height) {
  return revolve(
      {1,
       {0, 0, 1, 2, 3, 3},
       {{0, -half_height, 1}, {radius, -half_height, 1}, {radius, half_height, 1}, {0, half_height, 1}}});
}

// A cylinder whose rims are rounded by quarter circles of radius `edge`: flat caps, smooth all over.
inline std::vector<NurbsSurface> rounded_cylinder(double radius, double half_height, double edge) {
  const double r = radius, h = half_height, w = std::sqrt(0.5);
  return revolve({2,
                  {0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 5, 5, 5},
                  {{0, -h, 1},
                   {0.5 * (r - edge), -h, 1},
                   {r - edge, -h, 1},
                   {r, -h, w},
                   {r, -h + edge, 1},
                   {r, 0, 1},
                   {r, h - edge, 1},
                   {r, h, w},
                   {r - edge, h, 1},
                   {0.5 * (r - edge), h, 1},
                   {0, h, 1}}});
}

// A tablet: a band of the given radius and half height between two spherical caps of height `cap`.
inline std::vector<NurbsSurface> tablet(double radius, double half_height, double cap) {
  const double sphere = (radius * radius + cap * cap) / (2 * cap);
  const double half_angle = 0.5 * std::asin(radius / sphere);
  const double h = half_height, z = h + cap, w = std::cos(half_angle), t = sphere * std::tan(half_angle);
  return revolve(
      {2,
       {0, 0, 0, 1, 1, 2, 2, 3, 3, 3},
       {{0, -z, 1}, {t, -z, w}, {radius, -h, 1}, {radius, 0, 1}, {radius, h, 1}, {t, z, w}, {0, z, 1}}});
}

// A bilinear patch (a b / c d: a to b along u, a to c along v), outward by the right-hand rule.
inline NurbsSurface bilinear(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
  NurbsSurface s;
  s.degree_u = s.degree_v = 1;
  s.knots_u = s.knots_v = {0, 0, 1, 1};
  s.size_u = s.size_v = 2;
  for (const Vec3& p : {a, c, b, d}) s.points.emplace_back(p[0], p[1], p[2], 1);
  return s;
}

// A box with half extents `half` whose edges and corners are rounded by `edge`: six flat faces, twelve
// quarter cylinders, eight octants of a sphere.
inline std::vector<NurbsSurface> rounded_box(const Vec3& half, double edge) {
  const Vec3 core = half - Vec3::Constant(edge);
  const double w = std::sqrt(0.5);
  std::vector<NurbsSurface> out;
  const auto add = [&](int degree_u, int degree_v, const std::vector<Vec4>& points) {
    NurbsSurface s;
    s.degree_u = degree_u;
    s.degree_v = degree_v;
    const auto knots = [](int degree) {
      std::vector<double> k(2 * (degree + 1), 0.0);
      for (int i = degree + 1; i < 2 * (degree + 1); ++i) k[i] = 1;
      return k;
    };
    s.knots_u = knots(degree_u);
    s.knots_v = knots(degree_v);
    s.size_u = degree_u + 1;
    s.size_v = degree_v + 1;
    for (const Vec4& p : points) s.points.emplace_back(p[3] * p[0], p[3] * p[1], p[3] * p[2], p[3]);
    out.push_back(s);
  };
  const auto point = [](const Vec3& p, double weight) { return Vec4(p[0], p[1], p[2], weight); };
  for (int axis = 0; axis < 3; ++axis) {
    const int i = (axis + 1) % 3, j = (axis + 2) % 3;
    for (const double side : {-1.0, 1.0}) {  // faces
      std::vector<Vec4> points;
      for (const double a : {-1.0, 1.0})
        for (const double b : {-1.0, 1.0}) {
          Vec3 p;
          p[axis] = side * half[axis];
          p[i] = a * core[i];
          p[j] = b * core[j];
          points.push_back(point(p, 1));
        }
      add(1, 1, points);
    }
    for (const double a : {-1.0, 1.0})  // edges along the axis
      for (const double b : {-1.0, 1.0}) {
        std::vector<Vec4> points;
        for (int k = 0; k < 3; ++k)
          for (const double end : {-1.0, 1.0}) {
            Vec3 p;
            p[axis] = end * core[axis];
            p[i] = a * (core[i] + (k < 2 ? edge : 0));
            p[j] = b * (core[j] + (k > 0 ? edge : 0));
            points.push_back(point(p, k == 1 ? w : 1));
          }
        add(2, 1, points);
      }
  }
  for (int corner = 0; corner < 8; ++corner) {
    const Vec3 sign(corner & 1 ? 1 : -1, corner & 2 ? 1 : -1, corner & 4 ? 1 : -1);
    std::vector<Vec4> points;
    constexpr int kArc[3][2] = {{1, 0}, {1, 1}, {0, 1}};
    for (const auto& turn : kArc)
      for (const auto& rise : kArc) {
        const Vec3 p(rise[0] * turn[0], rise[0] * turn[1], rise[1]);
        const double weight = (&turn == &kArc[1] ? w : 1) * (&rise == &kArc[1] ? w : 1);
        points.push_back(point(sign.cwiseProduct(core + edge * p), weight));
      }
    add(2, 2, points);
  }
  return out;  // make_shape turns what faces inward
}

// A right prism over a regular polygon with `sides` corners on the circle of `radius`. Its ends are fans of
// triangles.
inline std::vector<NurbsSurface> prism(int sides, double radius, double half_height) {
  std::vector<NurbsSurface> out;
  const auto corner = [&](int k, double z) {
    const double angle = 2 * M_PI * k / sides;
    return Vec3(radius * std::cos(angle), radius * std::sin(angle), z);
  };
  const Vec3 top(0, 0, half_height), bottom = -top;
  for (int k = 0; k < sides; ++k) {
    const Vec3 a = corner(k, -half_height), b = corner(k + 1, -half_height);
    const Vec3 c = corner(k, half_height), d = corner(k + 1, half_height);
    out.push_back(bilinear(a, b, c, d));
    out.push_back(bilinear(c, d, top, top));
    out.push_back(bilinear(b, a, bottom, bottom));
  }
  return out;
}

}  // namespace nurbs::test

// Bodies with flat faces and straight lines for the tests: cylinder, tablet, rounded box, prism.
#pragma once

#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "body/shape.h"
#include "shapes/primitives.h"
#include "shapes/revolved.h"
#include "shapes/rounded_polyhedron.h"

namespace nurbs::test {

// A Platonic solid with corners 1 from its centre, and edges rounded by balls.
inline std::shared_ptr<const Shape> rounded_solid(const std::string& solid, double rounding) {
  return make_shape(solid, rounded_polyhedron(platonic_solid(solid, 1), Vec3::Zero(), rounding));
}

inline std::vector<NurbsSurface> cylinder(double radius, double half_height) {
  return {surface_of_revolution(
      1, {0, 0, 1, 2, 3, 3},
      {{0, -half_height, 1}, {radius, -half_height, 1}, {radius, half_height, 1}, {0, half_height, 1}})};
}

// A cylinder whose rims are rounded by quarter circles of radius `edge`: flat caps, smooth all over.
inline std::vector<NurbsSurface> rounded_cylinder(double radius, double half_height, double edge) {
  const double r = radius, h = half_height, w = std::sqrt(0.5);
  return {surface_of_revolution(2, {0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 5, 5, 5},
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
                                 {0, h, 1}})};
}

// A tablet with sharp rims: a band of the given radius and half height between two spherical caps of height
// `cap`.
inline std::vector<NurbsSurface> sharp_tablet(double radius, double half_height, double cap) {
  const double sphere = (radius * radius + cap * cap) / (2 * cap);
  const double half_angle = 0.5 * std::asin(radius / sphere);
  const double h = half_height, z = h + cap, w = std::cos(half_angle), t = sphere * std::tan(half_angle);
  return {surface_of_revolution(
      2, {0, 0, 0, 1, 1, 2, 2, 3, 3, 3},
      {{0, -z, 1}, {t, -z, w}, {radius, -h, 1}, {radius, 0, 1}, {radius, h, 1}, {t, z, w}, {0, z, 1}})};
}

// A bilinear patch (a b / c d: a to b along u, a to c along v), outward by the right-hand rule.
inline NurbsSurface bilinear(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
  std::vector<Vec4> points;
  for (const Vec3& p : {a, c, b, d}) points.emplace_back(p[0], p[1], p[2], 1);
  return bezier_surface(1, 1, points);
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

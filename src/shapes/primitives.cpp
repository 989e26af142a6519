// Ready-made bodies: fitted ellipsoids and superellipsoids, pebble, revolved ellipsoid, box.
#include "shapes/primitives.h"

#include <array>
#include <cmath>
#include <utility>

#include "nurbs/affine.h"
#include "shapes/cube_net.h"
#include "shapes/revolved.h"
#include "shapes/surface_fit.h"

namespace nurbs {
namespace {

FitTarget unit_sphere() {
  return {[](const Vec3& d) { return d; },
          [](const Vec3& x, const Vec3&) {
            return SurfaceOffset{x.norm() - 1, x.normalized()};
          }};
}

// Gauge function (|x|^e + |y|^e + |z|^e)^(1/e): 1 on the unit superellipsoid, homogeneous of degree 1.
FitTarget unit_superellipsoid(double e) {
  const auto gauge = [e](const Vec3& x) { return std::pow(x.array().abs().pow(e).sum(), 1 / e); };
  const auto offset = [e, gauge](const Vec3& x, const Vec3&) {
    const double value = gauge(x);
    const Vec3 gradient = (x / value).array().abs().pow(e - 1) * x.array().sign();
    return SurfaceOffset{(value - 1) / gradient.norm(), gradient.normalized()};
  };
  return {[gauge](const Vec3& d) { return Vec3(d / gauge(d)); }, offset};
}

// The pebble's support function on unit directions, h = 1 + q(d) + c(d) with a quadratic and a cubic form,
// and its point grad h of the extension of degree 1, h(d) = |d| + q(d) / |d| + c(d) / |d|^2. Small forms keep
// it convex.
double pebble_support(const Vec3& d) {
  const auto [x, y, z] = std::array{d[0], d[1], d[2]};
  const double quadratic = -0.06 * x * x + 0.045 * z * z + 0.075 * x * y + 0.03 * y * z;
  const double cubic = 0.18 * x * y * z + 0.0225 * x * (x * x - 3 * y * y) + 0.06 * z * z * z;
  return 1 + quadratic + cubic;
}

Vec3 pebble_point(const Vec3& d) {
  const auto [x, y, z] = std::array{d[0], d[1], d[2]};
  const double quadratic = -0.06 * x * x + 0.045 * z * z + 0.075 * x * y + 0.03 * y * z;
  const double cubic = 0.18 * x * y * z + 0.0225 * x * (x * x - 3 * y * y) + 0.06 * z * z * z;
  const Vec3 quadratic_slope(-0.12 * x + 0.075 * y, 0.075 * x + 0.03 * z, 0.09 * z + 0.03 * y);
  const Vec3 cubic_slope(0.18 * y * z + 0.0675 * (x * x - y * y), 0.18 * x * z - 0.135 * x * y,
                         0.18 * x * y + 0.18 * z * z);
  return d + quadratic_slope - quadratic * d + cubic_slope - 2 * cubic * d;
}

std::vector<NurbsSurface> scaled_fit(const FitTarget& target, const FitOptions& options,
                                     const Vec3& semi_axes, double* error) {
  SurfaceFit fit = fit_cube_body(target, options);
  if (error) *error = fit.error * semi_axes.maxCoeff();
  transform(fit.surfaces, semi_axes.asDiagonal(), Vec3::Zero());
  return std::move(fit.surfaces);
}

}  // namespace

std::vector<NurbsSurface> fitted_ellipsoid(const Vec3& semi_axes, int spans, double* error) {
  return scaled_fit(unit_sphere(), {spans, Joints::kKinked, 0, 0}, semi_axes, error);
}

std::vector<NurbsSurface> smooth_ellipsoid(const Vec3& semi_axes, double* error) {
  return scaled_fit(unit_sphere(), {1, Joints::kSmooth, 0, 0}, semi_axes, error);
}

std::vector<NurbsSurface> fitted_superellipsoid(const Vec3& semi_axes, double exponent, int spans,
                                                double* error) {
  return scaled_fit(unit_superellipsoid(exponent), {spans, Joints::kKinked, 0.3, 1e-7}, semi_axes, error);
}

std::vector<NurbsSurface> pebble() {
  const FitTarget target{pebble_point, [](const Vec3& x, const Vec3& normal) {
                           return SurfaceOffset{normal.dot(x) - pebble_support(normal), normal};
                         }};
  SurfaceFit fit = fit_cube_body(target, {1, Joints::kSmooth, 0, 0});
  center(fit.surfaces);
  return std::move(fit.surfaces);
}

std::vector<NurbsSurface> revolved_ellipsoid(double equatorial, double polar) {
  // A half circle as two rational quadratics (NURBS Book, example 7.2), stretched.
  const double w = std::sqrt(0.5);
  return {surface_of_revolution(
      2, {0, 0, 0, 0.5, 0.5, 1, 1, 1},
      {{0, -polar, 1}, {equatorial, -polar, w}, {equatorial, 0, 1}, {equatorial, polar, w}, {0, polar, 1}})};
}

std::vector<NurbsSurface> box(const Vec3& half_extents) {
  const CubeNet net(2);
  std::vector<Vec4> points(net.count());
  for (int corner = 0; corner < 8; ++corner) {
    const std::array<int, 3> p{corner & 1, corner >> 1 & 1, corner >> 2};
    Vec4& point = points[net.index(p)];
    for (int c = 0; c < 3; ++c) point[c] = p[c] ? half_extents[c] : -half_extents[c];
    point[3] = 1;
  }
  return cube_surfaces(net, 1, uniform_knots(1, 1), points);
}

std::vector<NurbsSurface> ellipsoid_with_gyration(const Mat3& gyration) {
  std::vector<NurbsSurface> body = smooth_ellipsoid(Vec3::Ones());
  match_gyration(body, gyration);
  return body;
}

}  // namespace nurbs

// The ladder of strictly convex fits to a superellipsoid, in the frame of equal semi-axes.
#include "shapes/superellipsoid.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>

#include "body/shape.h"
#include "nurbs/affine.h"
#include "shapes/convex_fit.h"
#include "shapes/primitives.h"

namespace nurbs {
namespace {

constexpr int kDegree = 4, kMostSpans = 4;
constexpr double kFlattest = 0.02, kSharpest = 1e3;
constexpr double kSlide = 2;         // edges gather parameter lines
constexpr double kStart = 0.97;      // of the exact size: from inside
constexpr int kErrorGrid = 100;      // per patch parameter
constexpr double kFarTooCoarse = 6;  // times the tolerance: the curvature is not raised

// Signed distance to first order from |x|^e + |y|^e + |z|^e = 1: the gauge function over its slope.
TargetOffset offset(const Vec3& x, double e) {
  const double gauge = std::pow(x.array().abs().pow(e).sum(), 1 / e);
  const Vec3 gradient = (x / gauge).array().abs().pow(e - 1) * x.array().sign();
  return {(gauge - 1) / gradient.norm(), gradient.normalized()};
}

double largest_offset(const std::vector<NurbsSurface>& surfaces, double e) {
  double most = 0;
  for (const NurbsSurface& s : surfaces)
    for (int i = 0; i <= kErrorGrid; ++i)
      for (int j = 0; j <= kErrorGrid; ++j) {
        const Vec3 x = evaluate(s, static_cast<double>(i) / kErrorGrid, static_cast<double>(j) / kErrorGrid);
        most = std::max(most, std::abs(offset(x, e).distance));
      }
  return most;
}

bool strictly_convex(const std::vector<NurbsSurface>& surfaces) {
  try {
    const auto shape = make_shape("superellipsoid", surfaces);
    return shape->proofs.convex && std::isfinite(shape->patch_curvature.max_radius) && shape->smooth;
  } catch (const ShapeError&) {
    return false;
  }
}

}  // namespace

Superellipsoid convex_superellipsoid(const Vec3& semi_axes, double exponent, double tolerance) {
  if (exponent == 2) return {exact_ellipsoid(semi_axes), 0};
  const OffsetTarget target = [exponent](const Vec3& x, const Vec3&, int&) { return offset(x, exponent); };
  ConvexFitOptions options;
  options.tolerance = tolerance;
  options.most_curvature = kSharpest;
  options.cut_weight = 1;
  options.slide = kSlide;
  double least = 1e300;
  for (int spans = 1; spans <= kMostSpans; ++spans) {
    const SmoothCube cube(kDegree, spans);
    const auto start = [&](int f, double u, double v) {
      const Vec3 d = cube_direction(f, std::tan((2 * u - 1) * M_PI / 4), std::tan((2 * v - 1) * M_PI / 4));
      return Vec3(kStart * d / std::pow(d.array().abs().pow(exponent).sum(), 1 / exponent));
    };
    options.least_curvature = kFlattest;
    std::optional<Superellipsoid> best;
    const auto accept = [&](const ConvexFit& fit) {
      Superellipsoid body{cube.surfaces(fit.points), 0};
      body.error = largest_offset(body.surfaces, exponent);
      least = std::min(least, body.error);
      if (body.error > tolerance || !strictly_convex(body.surfaces)) return false;
      best = std::move(body);
      return true;
    };
    const ConvexFit fit = fit_convex(cube, fit_points(cube, start), target, options);
    if (fit.error > kFarTooCoarse * tolerance) continue;
    if (accept(fit)) raise_curvature(cube, fit, target, options, accept);
    if (!best) continue;
    transform(best->surfaces, semi_axes.asDiagonal(), Vec3::Zero());
    best->error *= semi_axes.maxCoeff();
    return *best;
  }
  char line[160];
  std::snprintf(
      line, sizeof line,
      "no strictly convex body is within the tolerance of %.3g %% of the largest semi-axis; the best is "
      "within %.3g %%: raise it",
      100 * tolerance, 100 * least);
  throw ShapeError(line);
}

}  // namespace nurbs

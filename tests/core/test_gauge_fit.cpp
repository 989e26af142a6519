// Fits by gauge functions: convex and smooth by construction, whatever the tolerance, and right about their
// error.
#include <gtest/gtest.h>

#include "body/shape.h"
#include "shapes/gauge_fit.h"
#include "shapes/hull_fit.h"
#include "support/random.h"

namespace nurbs::test_gauge_fit {
namespace {

using test::Random;

ConvexHull rough_hull(unsigned seed) {
  Random random(seed);
  std::vector<Vec3> points;
  for (int k = 0; k < 400; ++k) points.push_back(random.uniform(0.9, 1) * random.direction());
  return ConvexHull(points);
}

TEST(GaugeFit, reaches_a_tolerance_that_can_be_had) {
  for (unsigned seed = 1; seed <= 3; ++seed) {
    const ConvexHull hull = rough_hull(seed);
    GaugeFitOptions options;
    options.inward = options.outward = 0.05;
    options.least_curvature = 0.05;
    const GaugeFit fit = fit_gauge(4, 3, hull, options);
    ASSERT_LE(fit.error, 1);
    const auto shape = make_shape("gauge", fit.surfaces);
    EXPECT_TRUE(shape->proofs.convex);
    EXPECT_GT(shape->patch_curvature.min_radius, 0);
    EXPECT_LT(shape->patch_curvature.max_radius, 100);
    for (const auto& edges : shape->links)
      for (const EdgeLink& link : edges) EXPECT_LT(std::abs(link.kink), 1e-9);
    const HullDistance d = hull_distance(*shape, hull, 1e-4);
    EXPECT_LT(d.worst(), 1.2 * 0.05);
    EXPECT_GT(d.worst(), 0.5 * 0.05);  // what the tolerance leaves is used
  }
}

TEST(GaugeFit, goes_as_far_as_it_can_towards_one_that_can_not) {
  const ConvexHull hull = rough_hull(4);
  GaugeFitOptions options;
  options.inward = options.outward = 1e-3;
  options.least_curvature = 0.05;
  double before = 1e300;
  for (int spans = 1; spans <= 4; ++spans) {
    const GaugeFit fit = fit_gauge(3, spans, hull, options);
    EXPECT_GT(fit.error, 1);
    EXPECT_LT(fit.error, spans == 1 ? before : 0.9 * before);
    before = fit.error;
    const auto shape = make_shape("gauge", fit.surfaces);
    EXPECT_LT(shape->concavity, 1e-4);
    const double found = hull_distance(*shape, hull, 1e-4).worst() / 1e-3;
    EXPECT_GT(found, 0.95 * fit.error);
    EXPECT_LT(found, 1.3 * fit.error);
  }
}

}  // namespace
}  // namespace nurbs::test_gauge_fit

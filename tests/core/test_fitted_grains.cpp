// Fits of irregular hulls in contact: the ladder against brute force over dense samples of both surfaces.
#include <gtest/gtest.h>

#include <cmath>

#include "contact/pair_search.h"
#include "shapes/hull_fit.h"
#include "shapes/rounded_polyhedron.h"
#include "support/pairs.h"

namespace nurbs::test_fitted_grains {
namespace {

using test::Random;

// A rough ellipsoid's hull.
ConvexHull rough_hull(unsigned seed) {
  Random random(seed);
  const Vec3 axes(random.uniform(0.9, 1.5), 1, random.uniform(0.6, 1));
  std::vector<Vec3> points;
  for (int k = 0; k < 120; ++k)
    points.push_back(random.uniform(0.85, 1.1) * axes.cwiseProduct(random.direction()));
  return ConvexHull(points);
}

struct Samples {
  std::vector<Vec3> points, normals;
};

Samples sample(const Shape& shape, int total) {
  Samples out;
  const int n = std::max(3, static_cast<int>(std::sqrt(total / static_cast<double>(shape.patches.size()))));
  for (const BezierPatch& patch : shape.patches)
    for (int i = 0; i <= n; ++i)
      for (int j = 0; j <= n; ++j) {
        const Jet1 at = evaluate1(patch, static_cast<double>(i) / n, static_cast<double>(j) / n);
        const Vec3 cross = at.su.cross(at.sv);
        if (!(cross.norm() > 1e-9)) continue;
        out.points.push_back(at.s);
        out.normals.push_back(cross.normalized());
      }
  return out;
}

// The least overlap over the normals of A's samples, with B's samples for its support.
double brute_overlap(const Particle& a, const Samples& of_a, const Particle& b, const Samples& of_b) {
  double least = 1e300;
  const Mat3 to_b = b.q.toRotationMatrix().transpose() * a.q.toRotationMatrix();
  const Vec3 offset = a.q.conjugate() * (b.x - a.x);
  for (size_t k = 0; k < of_a.points.size(); ++k) {
    const Vec3& n = of_a.normals[k];
    const Vec3 d = -(to_b * n);
    double h = -1e300;
    for (const Vec3& y : of_b.points) h = std::max(h, d.dot(y));
    least = std::min(least, a.scale * n.dot(of_a.points[k]) + b.scale * h - n.dot(offset));
  }
  return least;
}

class FittedGrains : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    HullFitOptions options;
    options.tolerance = 0.08;
    for (unsigned seed = 1; seed <= 4; ++seed) shapes_.push_back(fit_hull(rough_hull(seed), options).shape);
    shapes_.push_back(
        make_shape("crystal", rounded_polyhedron(platonic_solid("dodecahedron", 1), Vec3::Zero(), 0.1)));
    for (const auto& s : shapes_) {
      directions_.push_back(sample(*s, 2500));
      clouds_.push_back(sample(*s, 12000));
    }
  }
  static std::vector<std::shared_ptr<const Shape>> shapes_;
  static std::vector<Samples> directions_, clouds_;
};
std::vector<std::shared_ptr<const Shape>> FittedGrains::shapes_;
std::vector<Samples> FittedGrains::directions_, FittedGrains::clouds_;

TEST_F(FittedGrains, agree_with_brute_force) {
  Random random(17);
  const int count = static_cast<int>(shapes_.size());
  for (int k = 0; k < 40; ++k) {
    const int i = k % count, j = k / count % count;
    const test::Pair pair = test::random_pair(random, *shapes_[i], *shapes_[j], random.uniform(-0.1, 0.1));
    double memory[kPairMemorySize] = {0};
    const ContactResult r = find_contact(pair.a, pair.b, ContactSettings(), memory);
    ASSERT_EQ(r.status, Status::converged) << k;
    const double brute = brute_overlap(pair.a, directions_[i], pair.b, clouds_[j]);
    // Both grids err to second order in their spacing, some 0.04 and 0.02 of the radius, over radii of
    // curvature.
    EXPECT_NEAR(-r.gap, brute, 3e-3) << k;
    EXPECT_LT(-r.gap, brute + 1e-3) << k;  // no sampled direction is lower
    EXPECT_NEAR(test::overlap_along(pair.a, pair.b, r.normal), -r.gap, 1e-8) << k;
  }
}

// Warm and cold, tumbling in contact: resolved and inside the bracket every step.
TEST_F(FittedGrains, tumble_in_contact) {
  Random random(18);
  for (const auto& shape : shapes_) {
    const test::Pair start = test::random_pair_at(random, *shape, -0.01);
    double memory[kPairMemorySize] = {0};
    for (const test::Pair& pair : test::tumble(random, start, 5e-3, 200)) {
      double none[kPairMemorySize] = {0};
      const ContactResult r = find_contact(pair.a, pair.b, ContactSettings(), memory),
                          cold = find_contact(pair.a, pair.b, ContactSettings(), none);
      ASSERT_EQ(r.status, Status::converged);
      ASSERT_EQ(cold.status, Status::converged);
      EXPECT_NEAR(r.gap, cold.gap, 2e-9);
    }
  }
}

}  // namespace
}  // namespace nurbs::test_fitted_grains

// Bodies that are spheres: found so by proven bounds, and solved in closed form.
#include <gtest/gtest.h>

#include <cmath>

#include "contact/effective_radius.h"
#include "contact/sphere_search.h"
#include "shapes/primitives.h"
#include "support/pairs.h"

namespace nurbs::test_sphere_search {
namespace {

using test::Random;

std::shared_ptr<const Shape> six_patches() {
  return make_shape("six", exact_ellipsoid(Vec3::Constant(1.5)));
}
std::shared_ptr<const Shape> one_patch() {
  return make_shape("one", revolved_ellipsoid(0.7, 0.7));
}
std::shared_ptr<const Shape> nearly_round() {
  return make_shape("near", fitted_ellipsoid(Vec3::Ones(), 3));
}

Particle placed(Random& random, const Shape& shape, double scale, const Vec3& x) {
  return {&shape, scale, x, random.turn()};
}

TEST(SphereSearch, who_is_a_sphere) {
  for (const auto& s : {six_patches(), one_patch()}) {
    EXPECT_TRUE(s->proofs.sphere);
    EXPECT_LE(roundness(*s).width, 1e-12 * s->bounding_radius);
    EXPECT_LE(roundness(*s).slope, 1e-12);
  }
  const auto near = nearly_round();
  EXPECT_FALSE(near->proofs.sphere);
  EXPECT_GT(roundness(*near).width, 1e-6);
  EXPECT_LT(roundness(*near).slope, 0.01);
  const auto egg = make_shape("egg", exact_ellipsoid(Vec3(1, 1, 1.01)));
  const Particle p{egg.get(), 1, Vec3::Zero(), Quat::Identity()};
  EXPECT_FALSE(is_round(p, 1e-3, 1e-3));
  EXPECT_TRUE(is_round(p, 0.02, 0.1));
}

// No normal of a body is further from the direction of its point than roundness().slope.
TEST(SphereSearch, slope_is_a_bound) {
  for (const auto& s : {nearly_round(), make_shape("egg", exact_ellipsoid(Vec3(1, 1, 1.01))),
                        make_shape("lens", exact_ellipsoid(Vec3(1, 0.9, 1.1)))}) {
    double worst = 0;
    for (const BezierPatch& patch : s->patches)
      for (int i = 0; i <= 40; ++i)
        for (int j = 0; j <= 40; ++j) {
          const Jet1 at = evaluate1(patch, i / 40.0, j / 40.0);
          const Vec3 n = at.su.cross(at.sv).normalized(), x = at.s.normalized();
          worst = std::max(worst, std::atan2(n.cross(x).norm(), n.dot(x)));
        }
    EXPECT_GT(worst, 0) << s->name;
    EXPECT_LE(worst, roundness(*s).slope) << s->name;
  }
}

TEST(SphereSearch, pairs_of_spheres) {
  const auto six = six_patches(), one = one_patch();
  Random random(5);
  for (int k = 0; k < 300; ++k) {
    const Shape &sa = k % 2 ? *six : *one, &sb = k % 3 ? *six : *one;
    const double ra = std::pow(10, random.uniform(-3, 3)), rb = ra * random.uniform(0.2, 5);
    const double radius_a = ra * roundness(sa).radius, radius_b = rb * roundness(sb).radius;
    const double gap = random.uniform(-0.5, 0.5) * std::min(radius_a, radius_b);
    const Vec3 n = random.direction(), at = random.uniform(0, 10) * ra * random.direction();
    const Particle a = placed(random, sa, ra, at),
                   b = placed(random, sb, rb, at + (radius_a + radius_b + gap) * n);
    double memory[kPairMemorySize] = {0};
    for (int again = 0; again < 2; ++again) {  // solved, then served by the model that it left
      const ContactResult r = find_contact(a, b, ContactSettings(), memory);
      const double allowed = 1e-14 * (at.norm() + radius_a + radius_b) + 2e-12 * (radius_a + radius_b);
      ASSERT_EQ(r.status, Status::converged);
      EXPECT_EQ(r.rung, Rung::local_model);
      EXPECT_NEAR(r.gap, gap, allowed);
      EXPECT_LE(r.lower, r.gap);
      EXPECT_GE(r.upper, r.gap);
      EXPECT_LT((r.normal - n).norm(), 1e-12);
      EXPECT_NEAR(r.normal.dot(r.point_b - r.point_a), r.gap, allowed);
      EXPECT_NEAR(r.point_a.norm(), radius_a, allowed);
    }
    PointMemory none{-1, 0, 0, {0, 0}, {0, 0}};
    const SurfaceCurvature c = curvature_at(a, none, n);
    ASSERT_TRUE(c.known);
    const Vec3 t = n.unitOrthogonal();
    EXPECT_NEAR(t.dot(c.tensor * t) * radius_a, 1, 1e-9);
    EXPECT_LT((c.tensor * n).norm() * radius_a, 1e-9);
  }
}

// What it leaves behind serves as the bodies roll, up to half a radian, with the closed form's answer.
TEST(SphereSearch, model_of_rolling_spheres) {
  const auto six = six_patches();
  Random random(6);
  Particle a{six.get(), 1, Vec3::Zero(), random.turn()}, b{six.get(), 0.5, Vec3(2.2, 0, 0), random.turn()};
  double memory[kPairMemorySize] = {0};
  find_contact(a, b, ContactSettings(), memory);
  EXPECT_GT(memory_at(memory).model.unique, 0);
  for (int k = 1; k < 40; ++k) {
    a.q = Quat(Eigen::AngleAxisd(0.01, Vec3(1, 2, 3).normalized())) * a.q;
    b.x = 2.2 * Vec3(std::cos(0.002 * k), std::sin(0.002 * k), 0);
    const ContactResult r = find_contact(a, b, ContactSettings(), memory);
    EXPECT_NEAR(r.gap, 2.2 - 2.25, 1e-11);
    EXPECT_LT((r.normal - b.x.normalized()).norm(), 1e-11);
  }
}

TEST(SphereSearch, on_a_plane) {
  const auto one = one_patch();
  Random random(7);
  for (int k = 0; k < 100; ++k) {
    const Vec3 n = random.direction(), foot = random.direction();
    const double gap = random.uniform(-0.2, 0.2);
    Particle p = placed(random, *one, 2, foot + (1.4 + gap) * n);
    double memory[kPairMemorySize] = {0};
    for (int again = 0; again < 2; ++again) {
      const ContactResult r = find_plane_contact(p, foot, n, ContactSettings(), memory);
      ASSERT_EQ(r.status, Status::converged);
      EXPECT_NEAR(r.gap, gap, 3e-12);
      EXPECT_LT((r.point_b + 1.4 * n).norm(), 3e-12);
      p.q = Quat(Eigen::AngleAxisd(0.1, random.direction())) * p.q;
    }
  }
}

// A body that is no sphere runs as one where the tolerance allows: the bracket holds the tighter answer.
TEST(SphereSearch, within_a_tolerance) {
  const auto near = nearly_round();
  Random random(8);
  ContactSettings loose, tight;
  loose.tolerance = 0.02;
  int closed = 0;
  for (int k = 0; k < 200; ++k) {
    const test::Pair pair = test::random_pair_at(random, *near, random.uniform(-0.01, 0.01));
    double memory[kPairMemorySize] = {0}, other[kPairMemorySize] = {0};
    const ContactResult r = find_contact(pair.a, pair.b, loose, memory),
                        truth = find_contact(pair.a, pair.b, tight, other);
    ASSERT_EQ(r.status, Status::converged);
    closed += memory_at(memory).on_a.patch < 0;
    EXPECT_LE(r.lower, truth.upper);
    EXPECT_GE(r.upper, truth.lower);
    EXPECT_LT((r.normal - truth.normal).norm(), 0.02);
  }
  EXPECT_EQ(closed, 200);
}

// Without a line of centres the ladder answers.
TEST(SphereSearch, concentric) {
  const auto six = six_patches();
  const Particle a{six.get(), 1, Vec3::Zero(), Quat::Identity()},
      b{six.get(), 0.5, Vec3::Zero(), Quat::Identity()};
  double memory[kPairMemorySize] = {0};
  const ContactResult r = find_contact(a, b, ContactSettings(), memory);
  EXPECT_EQ(r.status, Status::converged);
  EXPECT_NEAR(r.gap, -2.25, 1e-8);
}

}  // namespace
}  // namespace nurbs::test_sphere_search

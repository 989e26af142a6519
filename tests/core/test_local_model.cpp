// The certified local model against closed forms and against solves from scratch, while the contact rolls.
#include <gtest/gtest.h>

#include "contact/pair_search.h"
#include "shapes/primitives.h"
#include "support/as_surface.h"
#include "support/random.h"

namespace nurbs::test_local_model {
namespace {

ContactSettings settings(double tolerance) {
  ContactSettings s;
  s.tolerance = tolerance;
  return s;
}

Quat turned_by(const Vec3& vector, const Quat& q) {
  return (Quat(Eigen::AngleAxisd(vector.norm(), vector.normalized())) * q).normalized();
}

// A sphere's curvature never changes: its model serves until one linear step no longer finds the normal,
// which is off by the third order of the angle rolled, to the tolerance.
TEST(LocalModel, SpheresAreRightToTheToleranceWhileTheyRoll) {
  const auto sphere = make_shape("sphere", exact_ellipsoid(Vec3(1, 1, 1)));
  double memory[kPairMemorySize] = {};
  Particle a, b;
  a.shape = b.shape = sphere.get();
  a.q = Quat(0.1, 0.7, -0.1, 0.7).normalized();
  b.q = Quat(0.5, 0.2, -0.1, 0.3).normalized();
  int served = 0;
  for (int i = 0; i < 400; ++i) {
    b.x = 1.99 * Vec3(1.995, 1e-3 * i, -5e-4 * i).normalized();
    a.q = turned_by(Vec3(3e-4, -1e-4, 2e-4), a.q);
    const ContactResult r = find_contact(a, b, settings(1e-9), memory);
    served += r.rung == Rung::local_model;
    ASSERT_EQ(r.status, Status::converged);
    ASSERT_NEAR(r.gap, -0.01, 1e-11) << "step " << i << " rung " << static_cast<int>(r.rung);
    ASSERT_LT((r.normal - b.x.normalized()).norm(), 2e-9);
    ASSERT_LT((r.point_a - b.x.normalized()).norm(), 1e-6);
  }
  EXPECT_GT(served, 200);
}

TEST(LocalModel, SphereOnPlaneIsExact) {
  const auto sphere = make_shape("sphere", exact_ellipsoid(Vec3(1, 1, 1)));
  double memory[kPairMemorySize] = {};
  Particle p;
  p.shape = sphere.get();
  p.x = Vec3(0, 0, 0.995);
  int served = 0;
  for (int i = 0; i < 400; ++i) {
    p.q = turned_by(Vec3(0.01, 0.004, 0.001), p.q);
    const ContactResult r = find_plane_contact(p, Vec3::Zero(), Vec3::UnitZ(), settings(1e-13), memory);
    served += r.rung == Rung::local_model;
    ASSERT_NEAR(r.gap, -0.005, 1e-13) << "step " << i;
  }
  EXPECT_GT(served, 200);
}

// Bodies that turn and slide a little at a time: the model's bracket holds the answer of a solve from
// scratch.
TEST(LocalModel, BracketHoldsTheTrueGap) {
  test::Random random(5);
  const auto first = test::as_surface(*make_shape("first", exact_ellipsoid(Vec3(1, 0.9, 0.7))));
  const auto second = test::as_surface(*make_shape("second", exact_ellipsoid(Vec3(0.8, 0.8, 0.6))));
  int served = 0;
  for (double tolerance : {1e-4, 1e-7, 1e-10})
    for (int run = 0; run < 20; ++run) {
      double memory[kPairMemorySize] = {};
      Particle a, b;
      a.shape = first.get();
      b.shape = second.get();
      a.q = turned_by(random.vector(), a.q);
      b.q = turned_by(random.vector(), b.q);
      const Vec3 line = random.vector().normalized();
      double fresh_memory[kPairMemorySize] = {};
      b.x = 2 * line;
      b.x = (2 - find_contact(a, b, settings(1e-13), fresh_memory).gap - 0.01) * line;
      const Vec3 spin_a = 1e-3 * random.vector(), spin_b = 1e-3 * random.vector();
      for (int i = 0; i < 60; ++i) {
        a.q = turned_by(spin_a, a.q);
        b.q = turned_by(spin_b, b.q);
        const ContactResult r = find_contact(a, b, settings(tolerance), memory);
        if (r.rung != Rung::local_model) continue;
        ++served;
        double none[kPairMemorySize] = {};
        const ContactResult exact = find_contact(a, b, settings(1e-13), none);
        ASSERT_GE(exact.gap, r.lower - 1e-13);
        ASSERT_LE(exact.gap, r.upper + 1e-13);
        ASSERT_NEAR(r.normal.dot(r.point_b - r.point_a), r.gap, 1e-14);
      }
    }
  EXPECT_GT(served, 500);
}

}  // namespace
}  // namespace nurbs::test_local_model

// Effective radii of contacts against closed forms: elliptic integrals, ellipsoids, spheres, cylinders.
#include <gtest/gtest.h>

#include <cmath>

#include "contact/effective_radius.h"
#include "contact/pair_search.h"
#include "support/bodies.h"
#include "support/random.h"

namespace nurbs::test_effective_radius {
namespace {

using test::Random;

// Elliptical Hertz contact (Johnson, Contact Mechanics, 4.2): F / (E* overlap^1.5).
double exact_stiffness(double k_a, double k_b) {
  const auto integrals = [](double m, double* k, double* e) {
    *k = std::comp_ellint_1(std::sqrt(m));
    *e = std::comp_ellint_2(std::sqrt(m));
  };
  double low = 1e-13, high = 1 - 1e-13, k = 0, e = 0;  // square of the contact ellipse's eccentricity
  for (int i = 0; i < 200; ++i) {
    const double m = 0.5 * (low + high);
    integrals(m, &k, &e);
    ((e / (1 - m) - k) / (k - e) < k_b / k_a ? low : high) = m;
  }
  return 2.0 / 3 * M_PI * std::sqrt((k - e) / (0.5 * k_a * low * k)) / k;
}

TEST(EffectiveRadius, StiffnessIsThatOfTheEllipticIntegrals) {
  for (const double ratio : {1.001, 1.1, 2.0, 5.0, 20.0, 60.0, 100.0}) {
    const double fit = 4.0 / 3 * std::sqrt(hertz_radius(3, 3 * ratio));
    EXPECT_NEAR(fit / exact_stiffness(3, 3 * ratio), 1, 6.5e-5) << ratio;
  }
  EXPECT_DOUBLE_EQ(hertz_radius(4, 4), 0.25);
}

// W of an ellipsoid's support function h: Hess h = M / h - (M d)(M d)' / h^3, M = R diag(axes^2) R'.
Mat3 inverse_weingarten(const Vec3& axes, const Quat& q, const Vec3& d) {
  const Mat3 r = q.toRotationMatrix(), m = r * axes.cwiseAbs2().asDiagonal() * r.transpose();
  const double h = std::sqrt(d.dot(m * d));
  return m / h - (m * d) * (m * d).transpose() / (h * h * h);
}

// The surface point where the outward normal is `d`, by a search against a plane.
PointMemory point_of(const Particle& p, const Vec3& d) {
  ContactSettings settings;
  settings.tolerance = 1e-13;
  PairMemory memory{};
  adopt(stamp(p), &memory);
  solve_plane_contact(p, 0.5 * p.scale, -d, settings, memory);
  return memory.on_b;
}

TEST(EffectiveRadius, CurvatureOfAnEllipsoid) {
  Random random(1);
  const Vec3 axes(1, 0.8, 0.6);
  for (int i = 0; i < 200; ++i) {
    Particle p{test::ellipsoid().get(), random.log_uniform(0.01, 10), random.vector(), random.turn()};
    const Vec3 d = random.direction();
    const SurfaceCurvature c = curvature_at(p, point_of(p, d), d);
    ASSERT_TRUE(c.known);
    const Mat3 w = p.scale * inverse_weingarten(axes, p.q, d), across = Mat3::Identity() - d * d.transpose();
    EXPECT_LT((c.tensor * w - across).norm(), 1e-6);
  }
}

TEST(EffectiveRadius, AtThePolesOfARevolvedBody) {
  const auto shape = test::polar();  // 1 across, 0.5 along its axis
  Particle p;
  p.shape = shape.get();
  const Vec3 axis = Vec3::UnitZ();
  const double least = 0.5;
  for (const double side : {1.0, -1.0}) {
    const SurfaceCurvature c = curvature_at(p, point_of(p, side * axis), side * axis);
    ASSERT_TRUE(c.known);
    const SphereCurvatures k = sphere_curvatures(plane_curvature(), c, -side * axis, 1, true);
    EXPECT_NEAR(k.b, least / (1.0 * 1.0), 1e-5);  // b / a^2
  }
}

TEST(EffectiveRadius, SpheresGetTheirOwnRadii) {
  Random random(2);
  for (int i = 0; i < 50; ++i) {
    const Vec3 d = random.direction();
    Particle a{test::sphere().get(), random.log_uniform(0.1, 10), random.vector(), random.turn()};
    Particle b{test::sphere().get(), random.log_uniform(0.1, 10), random.vector(), random.turn()};
    const SurfaceCurvature of_a = curvature_at(a, point_of(a, d), d),
                           of_b = curvature_at(b, point_of(b, -d), -d);
    const SphereCurvatures k = sphere_curvatures(of_a, of_b, d, std::min(a.scale, b.scale), false);
    EXPECT_NEAR(k.a * a.scale, 1, 1e-12);
    EXPECT_NEAR(k.b * b.scale, 1, 1e-12);
    EXPECT_NEAR(sphere_curvatures(plane_curvature(), of_b, d, b.scale, true).b * b.scale, 1, 1e-12);
  }
}

TEST(EffectiveRadius, FlatFacesCreasesAndCylinders) {
  const Vec3 up = Vec3::UnitZ();
  Particle box;
  box.shape = test::cuboid().get();
  const double cap = box.shape->bounding_radius;
  const SurfaceCurvature face = curvature_at(box, point_of(box, up), up);
  EXPECT_TRUE(face.known);
  EXPECT_LT(face.tensor.norm(), 1e-12);
  EXPECT_DOUBLE_EQ(sphere_curvatures(plane_curvature(), face, up, cap, true).b, 1 / cap);
  const Vec3 corner = Vec3(1, 1, 1).normalized();
  EXPECT_FALSE(curvature_at(box, point_of(box, corner), corner).known);
  EXPECT_FALSE(curvature_at(box, PointMemory{-1, 0, 0, {0, 0}, {0, 0}}, corner).known);
  // What is remembered of a face may be its corner, as a point of another patch; the answer goes by the
  // normal.
  for (double patch = -1; patch < 6; ++patch)
    for (const double u : {0.0, 0.3, 1.0})
      for (const double v : {0.0, 1.0})
        for (const double angle : {0.0, 0.02, 0.1}) {
          const Vec3 leaning(std::sin(angle), 0, std::cos(angle));
          const SurfaceCurvature c = curvature_at(box, PointMemory{patch, u, v, {0, 0}, {0, 0}}, leaning);
          EXPECT_EQ(c.known, angle * angle < kCreaseAngle2) << patch << ": " << angle;
          EXPECT_LT(c.tensor.norm(), 1e-12);
        }

  // A ball on a face of a box: the ball's own radius. Between two cylinders' sides, as k_a and k_b add.
  Particle ball;
  ball.shape = test::sphere().get();
  ball.scale = 0.1;
  const SurfaceCurvature round = curvature_at(ball, point_of(ball, -up), -up);
  const SphereCurvatures k = sphere_curvatures(face, round, up, ball.scale, false);
  EXPECT_NEAR(k.a, 0, 1e-10);
  EXPECT_NEAR(k.b, 10, 1e-10);

  // A ball of radius 0.1 in and on a cylinder of radius 0.5 about x.
  for (const double inside : {1.0, -1.0}) {
    const Vec3 point(3, 1, -0.5 + 2), normal = inside * up;  // at the bottom of the cylinder about (., 1, 2)
    const SurfaceCurvature wall = cylinder_curvature(Vec3(0, 1, 2), Vec3::UnitX(), 0.5, point, normal);
    EXPECT_NEAR(1 / sphere_curvatures(wall, round, normal, 0.1, true).b, hertz_radius(10 - inside * 2, 10),
                1e-12);
  }
}

}  // namespace
}  // namespace nurbs::test_effective_radius

// Bodies that are ellipsoids: found so by a proof, and solved in closed form, against solves over their
// surfaces and against a descent of its own in long double.
#include <gtest/gtest.h>

#include <cmath>

#include "body/support.h"
#include "contact/effective_radius.h"
#include "contact/ellipsoid_search.h"
#include "shapes/primitives.h"
#include "shapes/random_pebble.h"
#include "support/as_surface.h"
#include "support/bodies.h"
#include "support/ellipsoid_oracle.h"
#include "support/pairs.h"

namespace nurbs::test_ellipsoid_search {
namespace {

using test::as_surface;
using test::Pair;
using test::Random;
using test::ShapePointer;

const std::vector<Vec3>& some_axes() {
  static const std::vector<Vec3> axes = {{1, 1, 1},       {1, 0.8, 0.6}, {1, 1, 0.1}, {1, 0.3, 0.2},
                                         {0.05, 0.07, 1}, {3, 1, 2},     {1, 1.5, 2}, {1, 0.02, 0.01}};
  return axes;
}

// The surfaces moved as a whole.
std::vector<NurbsSurface> moved(std::vector<NurbsSurface> surfaces, const Quat& q, double scale,
                                const Vec3& x) {
  for (NurbsSurface& s : surfaces)
    for (Vec4& p : s.points) p.head<3>() = scale * (q * p.head<3>()) + p[3] * x;
  return surfaces;
}

ContactResult solve(const Pair& pair, double tolerance = 1e-9) {
  double memory[kPairMemorySize] = {};
  ContactSettings settings;
  settings.tolerance = tolerance;
  return find_contact(pair.a, pair.b, settings, memory);
}

TEST(Ellipsoids, are_found_whatever_their_patches_and_axes) {
  Random random(3);
  for (const Vec3& axes : some_axes()) {
    const Quat q = random.turn();
    const double scale = std::pow(10, random.uniform(-3, 3));
    const auto body = make_shape("turned", moved(exact_ellipsoid(axes), q, scale, scale * random.vector()));
    const Ellipsoid& e = body->ellipsoid;
    ASSERT_TRUE(e.found) << axes.transpose();
    EXPECT_LE(e.error, 1e-13) << axes.transpose();
    Vec3 wanted = scale * axes, found = e.semi;
    std::sort(wanted.begin(), wanted.end());
    std::sort(found.begin(), found.end());
    EXPECT_LE((wanted - found).cwiseQuotient(wanted).norm(), 1e-11) << axes.transpose();
    EXPECT_LE((e.axes.transpose() * e.axes - Mat3::Identity()).norm(), 1e-14);
    for (int k = 0; k < 50; ++k) {  // h(d) = |root d| against the highest point of the surface
      const Vec3 d = random.direction();
      EXPECT_NEAR((e.root * d).norm(), find_hull_support(*body, d).h, 4e-15 * body->bounding_radius);
    }
  }
  EXPECT_TRUE(make_shape("revolved", revolved_ellipsoid(1, 0.5))->ellipsoid.found);
}

TEST(Ellipsoids, others_are_none) {
  EXPECT_FALSE(make_shape("fitted", fitted_ellipsoid(Vec3(1, 0.8, 0.6), 6))->ellipsoid.found);
  EXPECT_FALSE(make_shape("blocky", fitted_superellipsoid(Vec3(1, 0.9, 0.8), 2.001, 3))->ellipsoid.found);
  EXPECT_FALSE(make_shape("pebble", random_pebble(5, PebbleForm()))->ellipsoid.found);
  EXPECT_FALSE(make_shape("box", box(Vec3(1, 1, 1)))->ellipsoid.found);
  // A control point moved by a millionth of a millionth of the size, and ten of them.
  for (const double off : {1e-14, 1e-11}) {
    std::vector<NurbsSurface> surfaces = exact_ellipsoid(Vec3(1, 0.8, 0.6));
    NurbsSurface& s = surfaces[0];
    s.points[s.points.size() / 2].head<3>() *= 1 + off;
    EXPECT_EQ(make_shape("bent", surfaces)->ellipsoid.found, off < kEllipsoid) << off;
  }
}

// The certificate's ball: no point of the ball of radius l^2 / h that touches at x is outside.
TEST(Ellipsoids, hold_the_ball_of_the_certificate) {
  Random random(4);
  for (const Vec3& axes : some_axes())
    for (int k = 0; k < 200; ++k) {
      const Vec3 d = random.direction();
      const double h = axes.cwiseProduct(d).norm(), rho = axes.minCoeff() * axes.minCoeff() / h;
      const Vec3 x = axes.cwiseAbs2().cwiseProduct(d) / h, center = x - rho * d;
      double most = 0;
      for (int i = 0; i < 200; ++i)
        most = std::max(most, (center + rho * random.direction()).cwiseQuotient(axes).norm());
      EXPECT_LE(most, 1 + 1e-12) << axes.transpose();
    }
}

TEST(EllipsoidSearch, pairs_agree_with_an_oracle_and_with_the_surfaces) {
  Random random(5);
  std::vector<ShapePointer> closed, surface;
  for (const Vec3& axes : some_axes()) {
    closed.push_back(make_shape("closed", exact_ellipsoid(axes)));
    surface.push_back(as_surface(*closed.back()));
  }
  int served = 0, compared = 0, total = 0;
  for (int k = 0; k < 3000; ++k, ++total) {
    const int i = random.below(static_cast<int>(closed.size())),
              j = random.below(static_cast<int>(closed.size()));
    const double size = std::min(some_axes()[i].minCoeff(), some_axes()[j].minCoeff());
    Pair pair = test::random_pair(random, *closed[i], *closed[j], size * random.uniform(-0.5, 0.5));
    const ContactResult r = solve(pair);
    ASSERT_EQ(r.status, Status::converged);
    if (r.rung != Rung::local_model) continue;  // too deep for the closed form
    ++served;
    const auto a = oracle::make_ellipsoid(pair.a.scale * some_axes()[i], pair.a.x, pair.a.q);
    const auto b = oracle::make_ellipsoid(pair.b.scale * some_axes()[j], pair.b.x, pair.b.q);
    const double truth = static_cast<double>(oracle::signed_distance(a, b, 40).gap);
    const double radius = pair.a.scale + 3 * pair.b.scale, noise = 4e-15 * radius;
    ASSERT_GE(truth, r.lower - noise);
    ASSERT_LE(truth, r.upper + noise);
    ASSERT_NEAR(r.gap, truth, noise + 1e-9 * std::abs(truth)) << k;
    ASSERT_NEAR(r.normal.dot(r.point_b - r.point_a), r.gap, noise);
    pair.a.shape = surface[i].get();
    pair.b.shape = surface[j].get();
    const ContactResult other = solve(pair);
    if (other.rung == Rung::fallback) continue;
    ++compared;
    ASSERT_LE((other.normal - r.normal).norm(), 3e-8) << k;
  }
  EXPECT_GT(served, total / 2);
  EXPECT_GT(compared, total / 4);
}

// One after the other, as bodies tumble, and in all sizes.
TEST(EllipsoidSearch, sequences_stay_right) {
  Random random(6);
  for (const Vec3& axes : some_axes()) {
    const auto body = make_shape("closed", exact_ellipsoid(axes)), plain = as_surface(*body);
    for (const double turn : {1e-7, 1e-4, 1e-2, 0.3})
      for (int k = 0; k < 4; ++k) {
        const double overlap = axes.minCoeff() * std::pow(10, random.uniform(-6, -1));
        double memory[kPairMemorySize] = {};
        for (Pair pair : test::tumble(random, test::random_pair_at(random, *body, -overlap), turn, 40)) {
          const ContactResult r = find_contact(pair.a, pair.b, ContactSettings(), memory);
          pair.a.shape = pair.b.shape = plain.get();
          const ContactResult fresh = solve(pair, 1e-12);
          ASSERT_EQ(r.status, Status::converged);
          ASSERT_LE(r.lower, fresh.upper + 1e-14);
          ASSERT_GE(r.upper, fresh.lower - 1e-14);
        }
      }
  }
}

TEST(EllipsoidSearch, on_a_plane_it_is_the_support_function) {
  Random random(7);
  for (const Vec3& axes : some_axes()) {
    const auto body = make_shape("closed", exact_ellipsoid(axes));
    double memory[kPairMemorySize] = {};
    for (int k = 0; k < 100; ++k) {
      Particle p{body.get(), random.uniform(0.5, 2), random.vector(), random.turn()};
      const Vec3 n = random.direction();
      const double h = p.scale * axes.cwiseProduct(p.q.conjugate() * n).norm(), depth = 0.1 * h;
      const ContactResult r = find_plane_contact(p, p.x - (h - depth) * n, n, ContactSettings(), memory);
      ASSERT_EQ(r.status, Status::converged);
      ASSERT_NEAR(r.gap, -depth, 4e-15 * p.scale * body->bounding_radius);
      ASSERT_NEAR(n.dot(r.point_b), -h, 4e-15 * p.scale * body->bounding_radius);
      ASSERT_LE((r.point_a - r.point_b + r.gap * n).norm(), 1e-14 * p.scale * body->bounding_radius);
    }
  }
}

TEST(EllipsoidSearch, curvature_is_that_of_the_surface) {
  Random random(8);
  for (const Vec3& axes : some_axes()) {
    const auto body = make_shape("closed", exact_ellipsoid(axes));
    for (int k = 0; k < 30; ++k) {
      const Particle p{body.get(), random.uniform(0.5, 2), Vec3::Zero(), random.turn()};
      const Support s = find_hull_support(*body, random.direction());
      const PointMemory point{static_cast<double>(s.where.patch), s.where.u, s.where.v, {0, 0}, {0, 0}},
          none{-1, 0, 0, {0, 0}, {0, 0}};
      const Vec3 outward = p.q * s.normal;
      const SurfaceCurvature closed = curvature_at(p, none, outward),
                             measured = curvature_at(p, point, outward);
      ASSERT_TRUE(closed.known && measured.known);
      EXPECT_LE((closed.tensor - measured.tensor).norm(), 1e-5 * measured.tensor.norm()) << axes.transpose();
    }
  }
}

// Overlaps beyond the balls are others' work; centres that meet, numbers that are none.
TEST(EllipsoidSearch, hands_on_what_it_cannot_prove) {
  const auto body = make_shape("closed", exact_ellipsoid(Vec3(1, 0.8, 0.6)));
  Random random(9);
  for (int k = 0; k < 50; ++k) {
    Pair pair{{body.get(), 1, Vec3::Zero(), random.turn()}, {body.get(), 1, Vec3::Zero(), random.turn()}};
    pair.b.x = std::pow(10, random.uniform(-20, -0.3)) * random.direction();
    const ContactResult r = solve(pair);
    EXPECT_EQ(r.status, Status::converged);
    EXPECT_LT(r.gap, -0.5);
  }
  Pair none{{body.get(), 1, Vec3::Zero(), Quat::Identity()}, {body.get(), 1, Vec3::Zero(), Quat::Identity()}};
  none.b.x[1] = std::nan("");
  EXPECT_EQ(solve(none).rung, Rung::none);
}

}  // namespace
}  // namespace nurbs::test_ellipsoid_search

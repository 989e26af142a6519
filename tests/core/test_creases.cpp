// Contacts on creases that open: supports and gaps there are certified without a search over patches, and
// agree with those that know nothing of creases.
#include <gtest/gtest.h>

#include <array>

#include "body/connectivity.h"
#include "body/local_form.h"
#include "contact/overlap/polytope.h"
#include "contact/pair_frame.h"
#include "contact/pair_search.h"
#include "nurbs/tolerances.h"
#include "support/bodies.h"
#include "support/pairs.h"
#include "support/random.h"

namespace nurbs::test_creases {
namespace {

using namespace test;

// Bodies with creases of 1 degree, without and with a normal map.
std::vector<ShapePointer> creased_shapes() {
  static const ShapePointer blocky = make_shape("blocky", fitted_superellipsoid({1, 0.9, 0.8}, 3, 2));
  return {kinked(), blocky};
}

// A point of a crease and a direction of the fan between its sides' normals.
struct OnCrease {
  Vec3 x, d;
};
bool find_crease(const Shape& shape, Random& random, OnCrease* out) {
  for (int k = 0; k < 10000; ++k) {
    const int p = static_cast<int>(random.uniform(0, 0.999 * static_cast<double>(shape.patches.size()))),
              e = static_cast<int>(random.uniform(0, 3.999));
    const EdgeLink& link = shape.links[p][e];
    if (link.collapsed || link.kink < 1e-4) continue;
    const Vec2 at = edge_parameters(e, random.uniform(0.02, 0.98));
    const SurfacePoint there = across(shape.patches, link, {p, at[0], at[1]}, e);
    const LocalForm a = local_form(shape.patches[p], at[0], at[1]),
                    b = local_form(shape.patches[there.patch], there.u, there.v);
    if (!(angle_between(a.normal, b.normal) > 1e-5) || !(a.point - b.point).isZero(1e-14)) continue;
    const double share = random.uniform(0.1, 0.9);
    *out = {a.point, (share * a.normal + (1 - share) * b.normal).normalized()};
    return true;
  }
  return false;
}

TEST(Creases, supports_are_certified_at_once) {
  Random random(3);
  for (const ShapePointer& shape : creased_shapes())
    for (int k = 0; k < 200; ++k) {
      OnCrease c;
      ASSERT_TRUE(find_crease(*shape, random, &c)) << shape->name;
      // Within the fan, on its rim and beyond.
      const Vec3 d = (c.d + random.uniform(0, 3e-3) * random.direction()).normalized();
      const Support s = find_hull_support(*shape, d);
      EXPECT_GE(s.upper, s.h) << shape->name;
      EXPECT_LE(s.upper - s.h, 1e-13) << shape->name;
      EXPECT_GE(s.h, d.dot(c.x) - 1e-14) << shape->name;
      if (k % 20 > 0) continue;
      EXPECT_LE(sampled_support(*shape, d), s.upper + 1e-14) << shape->name;
    }
}

TEST(Creases, warm_contacts_need_no_polytope_and_agree_with_it) {
  Random random(4);
  int creases = 0, dear = 0;
  for (const ShapePointer& shape : creased_shapes())
    for (int k = 0; k < 20; ++k) {
      OnCrease c;
      ASSERT_TRUE(find_crease(*shape, random, &c));
      const ShapePointer other = k % 2 ? ellipsoid() : smooth_pebble();
      Particle a{shape.get(), 1.0, Vec3::Zero(), random.turn()},
          b{other.get(), random.uniform(0.5, 2), Vec3::Zero(), random.turn()};
      const Vec3 d = a.q * c.d;
      const Support sb = find_support(*other, b.q.conjugate() * -d);
      b.x = a.q * c.x - b.q * (b.scale * sb.point) - 10 * kForceDepth * random.uniform(0.01, 1) * d;
      std::array<double, kPairMemorySize> memory{};
      ContactSettings settings;
      settings.reach = 0;
      const double turn = std::pow(10, random.uniform(-7, -3));
      const Vec3 axis = random.direction();
      for (int step = 0; step < 40; ++step) {
        const ContactResult warm = find_contact(a, b, settings, memory.data());
        ASSERT_EQ(warm.status, Status::converged) << shape->name;
        const PairFrame pair(a, b);
        const double tolerance = settings.tolerance * pair.size;
        EXPECT_LE(warm.upper - warm.lower, tolerance * (1 + 1e-9));
        if (warm.rung == Rung::fallback && step > 0) ++dear;
        if (step % 10 == 0) {
          const PolytopeResult hull = solve_polytope(pair, Vec3::UnitX(), tolerance, 0);
          EXPECT_LE(hull.bracket.lower, warm.upper) << shape->name;
          EXPECT_GE(hull.bracket.upper, warm.lower) << shape->name;
          // p along our normal is the gap: an upper bound of the overlap that shares nothing with the search.
          const double p = sampled_support(*shape, a.q.conjugate() * warm.normal) +
                           b.scale * sampled_support(*other, b.q.conjugate() * -warm.normal) -
                           warm.normal.dot(b.x - a.x);
          EXPECT_NEAR(-p, warm.gap, tolerance);
          EXPECT_NEAR(warm.normal.dot(warm.point_b - warm.point_a), warm.gap, 1e-14);
          ++creases;
        }
        a.q = (Quat(Eigen::AngleAxisd(turn, axis)) * a.q).normalized();
      }
    }
  EXPECT_EQ(creases, 160);
  EXPECT_LE(dear, 8);
}

// Contacts that bridge a dent from one support point to another, with bodies that turn: solved from nothing
// they take the polytope, which agrees; followed they don't.
TEST(Creases, contacts_over_dents_are_followed) {
  const ShapePointer body = make_shape("blocky", fitted_superellipsoid({1, 0.9, 0.8}, 4, 3));
  ASSERT_TRUE(body->dented());
  Random random(11);
  ContactSettings settings;
  settings.reach = 0;
  int polytopes = 0, followed = 0;
  for (int k = 0; k < 100; ++k) {
    const auto path =
        tumble(random, random_pair_at(random, *body, -std::pow(10.0, random.uniform(-4, -2))), 2e-3, 12);
    double memory[kPairMemorySize] = {};
    for (std::size_t i = 0; i < path.size(); ++i) {
      const ContactResult r = find_contact(path[i].a, path[i].b, settings, memory);
      if (i < 2) continue;
      double nothing[kPairMemorySize] = {};
      const ContactResult cold = find_contact(path[i].a, path[i].b, settings, nothing);
      ASSERT_EQ(r.status, Status::converged);
      ASSERT_EQ(cold.status, Status::converged);
      const double size = std::min(path[i].a.scale, path[i].b.scale) * body->bounding_radius;
      EXPECT_NEAR(r.gap, cold.gap, 2 * settings.tolerance * size);
      EXPECT_LE(r.lower, r.gap);
      EXPECT_LE(r.gap, r.upper);
      EXPECT_LE(-overlap_along(path[i].a, path[i].b, r.normal), r.gap + settings.tolerance * size);
      EXPECT_GE(-overlap_along(path[i].a, path[i].b, r.normal), r.gap - settings.tolerance * size);
      if (cold.rung != Rung::fallback) continue;
      ++polytopes;
      followed += r.rung == Rung::warm;
    }
  }
  EXPECT_GE(polytopes, 8);
  EXPECT_GE(followed, 0.8 * polytopes);
}

}  // namespace
}  // namespace nurbs::test_creases

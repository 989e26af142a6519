// Joints that count as smooth but are kinked by less than kNoKink: what they take from balls inside a body.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "body/small_kinks.h"
#include "body/support.h"
#include "contact/pair_search.h"
#include "support/least_overlap.h"
#include "support/pairs.h"
#include "support/random.h"
#include "support/solids.h"

namespace nurbs::test_small_kinks {
namespace {

using test::Random;

double support(const Shape& shape, const Vec3& d) {
  return find_hull_support(shape, d, nullptr, 1e-15, 1e-15).upper;
}

TEST(SmallKinks, balls_that_have_given_way_stay_inside) {
  for (const double r : {0.1, 1.0, 7.0})
    for (const double kink : {1e-15, 1e-11, 1e-9, 2e-8, 1e-7}) {
      std::vector<std::array<EdgeLink, 4>> links(1);
      for (EdgeLink& link : links[0]) link.kink = link.kink_bound = kink;
      const SmallKinks small = find_small_kinks(links, 1);
      const double inside = small.inside(r), slack = small.slack + 4e-16;
      EXPECT_LE(inside, r);
      EXPECT_GE(small.outside(r), r);
      EXPECT_LE(slack, 1e-12);
      if (kink <= 1e-9) {
        EXPECT_GT(inside, r * (1 - 0.02 * r));
      }
      // A corner whose fan is four kinks wide, and beside it a ball of radius r.
      for (double t = 1e-9; t < 1.5; t *= 1.3) {
        const double beyond = std::max(0.0, t - 4 * kink), half = std::sin(0.5 * t),
                     rest = std::sin(0.5 * beyond);
        EXPECT_GE(2 * r * rest * rest, 2 * inside * half * half - slack) << r << " " << kink << " " << t;
        const double ball = 2 * r * half * half, body = 2 * r * rest * rest, around = small.outside(r);
        EXPECT_LE(ball - body, 2 * r * (small.met + 4e-15) * half + 4e-16) << r << " " << kink << " " << t;
        EXPECT_LE(0.5 * ball - body, r * small.met * small.met + 4e-16) << r << " " << kink << " " << t;
        EXPECT_LE(ball + r * small.met * std::sin(t),
                  2 * around * half * half + small.excess_outside(around, 2 * half) + 4e-16)
            << r << " " << kink << " " << t;
      }
    }
}

// The radius of the two balls was taken for one that rolls all through the body, kinks up to 1e-7 for none:
// depths came out too large by the kink times the radius, closed.
TEST(SmallKinks, common_parts_of_two_balls_are_not_their_hull) {
  Random random(5);
  const std::vector<Vec3> many = test::spiral(400);
  for (const double apart : {4e-8, 1e-8, 1e-9, 1e-11}) {
    const test::Solid solid = test::slight_lens(random, 2 * apart);  // balls `apart` from its middle
    const auto& body = solid.shape;
    ASSERT_NEAR(body->proofs.opening, 2 * apart, 1e-3 * apart + 1e-14);
    ASSERT_FALSE(body->inner_map().nodes.empty());
    for (int k = 0; k < 4000; ++k) {
      const InnerNode& node = body->inner_map().nodes[random.below(body->atlas.nodes())];
      const int cap = random.below(kInnerCaps.size());
      const Vec3 t = node.normal.cross(random.direction()).normalized();
      const double turn = random.uniform(0, kInnerCaps[cap]);
      const Vec3 d = std::cos(turn) * node.normal + std::sin(turn) * t;
      const double ball = d.dot(node.point) + node.radius[cap] * 0.5 * (d - node.normal).squaredNorm();
      ASSERT_GE(support(*body, d), ball - body->small_kinks.slack - 1e-15) << apart;
    }
    if (body->core.found()) {
      for (const Vec3& d : many)
        EXPECT_NEAR(support(*body, d), d.dot(body->core.points[body->core.support(d)]) + body->core.radius,
                    body->core.error + 1e-15);
    }
    int closed = 0;
    for (int k = 0; k < 60; ++k) {
      const Particle a{body.get(), 1, Vec3::Zero(), random.turn()};
      const Vec3 way = k % 2 ? Vec3(a.q * solid.normals[0]) : random.direction();
      const double away = k % 3 ? random.log_uniform(1e-3, 1) : random.log_uniform(1e-8, 1e-3);
      const Particle b{body.get(), 1, Vec3(away * way), k % 4 < 2 ? a.q : random.turn()};
      double memory[kPairMemorySize] = {0};
      ContactSettings settings;
      settings.tolerance = 1e-9;
      const ContactResult r = find_contact(a, b, settings, memory);
      closed += r.status == Status::converged;
      std::vector<Vec3> starts = many;
      for (const Vec3& d : {r.normal, way, Vec3(-way)}) starts.push_back(d);
      const double least = test::least_overlap(
          [&](const Vec3& d) {
            return support(*body, a.q.conjugate() * d) + support(*body, b.q.conjugate() * -d) - d.dot(b.x);
          },
          starts, test::Compass(), random);
      EXPECT_LE(-r.upper, least + 1e-14) << apart << " pair " << k << ", away " << away;
    }
    EXPECT_GE(closed, 20) << apart;
  }
}

// Unresolved: what kinks may hide counted by the larger body's size.
TEST(SmallKinks, count_by_a_smaller_mates_size) {
  Random random(6);
  const test::Solid solid = test::slight_lens(random, 4e-8);
  const auto& body = solid.shape;
  ASSERT_GT(body->small_kinks.slack, 1e-13);
  const Vec3 n = solid.normals[0];
  for (const double ratio : {0.02, 1e-3, 1e-4, 1e-6})
    for (int k = 0; k < 60; ++k) {
      const Particle a{body.get(), 1, Vec3::Zero(), random.turn()};
      Particle b{body.get(), ratio, Vec3::Zero(), random.turn()};
      // On the crease, next to it, and anywhere.
      const Vec3 rim = n.cross(random.direction()).normalized();
      const Vec3 d =
          a.q * (k % 3 == 2 ? random.direction()
                            : (rim + (k % 3 ? 1e-7 : 1e-8) * random.uniform(-1, 1) * n).normalized());
      const Vec3 of_a = test::support_of(solid, a, d), of_b = test::support_of(solid, b, -d);
      b.x = of_a - of_b - ratio * random.log_uniform(1e-6, 0.5) * d;
      double memory[kPairMemorySize] = {0};
      const ContactResult r = find_contact(a, b, {}, memory);
      EXPECT_EQ(r.status, Status::converged) << ratio << " pair " << k;
      const double least = test::least_overlap(
          [&](const Vec3& along) {
            return (test::support_of(solid, a, along) - test::support_of(solid, b, -along) - b.x).dot(along);
          },
          test::starts_beside(r.normal, 1, random), {}, random);
      EXPECT_LE(-r.upper, least + 1e-15) << ratio << " pair " << k;
      EXPECT_LE(least, -r.lower + 1e-9 * ratio + 4e-15) << ratio << " pair " << k;
    }
}

}  // namespace
}  // namespace nurbs::test_small_kinks

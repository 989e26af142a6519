// The ladder: every rung conservative against full solves over long motions, nothing allocated, nothing
// poisoned.
#include <gtest/gtest.h>

#include <array>
#include <map>

#include "body/support.h"
#include "contact/pair_search.h"
#include "support/allocations.h"
#include "support/bodies.h"
#include "support/pairs.h"

namespace nurbs::test_ladder {
namespace {

using namespace test;
using Memory = std::array<double, kPairMemorySize>;

ContactResult full_solve(const Pair& pair, double tolerance = 1e-9) {
  Memory memory{};
  ContactSettings settings;
  settings.tolerance = tolerance;
  return find_contact(pair.a, pair.b, settings, memory.data());
}

// Two bodies that tumble and drift about each other, in and out of contact.
class Tumble {
 public:
  Tumble(Random& random, const Shape& sa, const Shape& sb, double turn, double drift)
      : pair_(random_pair(random, sa, sb, 0.02)),
        axis_a_(random.direction()),
        axis_b_(random.direction()),
        start_(pair_.b.x - pair_.a.x),
        turn_(turn),
        drift_(drift) {}

  const Pair& step() {
    ++count_;
    pair_.a.q = (Quat(Eigen::AngleAxisd(turn_, axis_a_)) * pair_.a.q).normalized();
    pair_.b.q = (Quat(Eigen::AngleAxisd(0.7 * turn_, axis_b_)) * pair_.b.q).normalized();
    pair_.b.x = pair_.a.x + start_ * (1 + 0.06 * std::sin(drift_ * count_));
    return pair_;
  }

 private:
  Pair pair_;
  Vec3 axis_a_, axis_b_, start_;
  double turn_, drift_;
  int count_ = 0;
};

TEST(Ladder, never_skips_a_pair_that_touches_and_agrees_with_full_solves) {
  Random random(21);
  std::map<Rung, int> served;
  ContactSettings settings;
  settings.reach = 0;
  for (const ShapePointer& shape : all_shapes())
    for (const double turn : {1e-5, 1e-3, 3e-2}) {
      Tumble tumble(random, *shape, *ellipsoid(), turn, std::max(10 * turn, 7e-3));
      Memory memory{};
      for (int k = 0; k < 1000; ++k) {
        const Pair& pair = tumble.step();
        const ContactResult quick = find_contact(pair.a, pair.b, settings, memory.data());
        const ContactResult full = full_solve(pair);
        ++served[quick.rung];
        ASSERT_NE(full.status, Status::unresolved) << shape->name;
        if (quick.status == Status::separated) {
          ASSERT_GT(full.upper, 0) << shape->name << " rung " << int(quick.rung);
          ASSERT_LE(quick.gap, full.upper + 1e-12) << shape->name << " rung " << int(quick.rung);
        } else {
          ASSERT_EQ(quick.status, Status::converged) << shape->name << " step " << k;
          const double allowed = 2e-9;
          ASSERT_NEAR(quick.gap, full.gap, allowed) << shape->name << " rung " << int(quick.rung);
          ASSERT_LE(quick.lower, full.upper + 1e-14) << shape->name << " rung " << int(quick.rung);
          ASSERT_GE(quick.upper, full.lower - 1e-14) << shape->name << " rung " << int(quick.rung);
        }
      }
    }
  for (const Rung rung : {Rung::safe, Rung::bounds, Rung::local_model, Rung::warm, Rung::cold})
    EXPECT_GT(served[rung], 0) << "rung " << int(rung) << " was never walked";
}

TEST(LocalModel, errs_by_less_than_its_bound) {
  Random random(22);
  ContactSettings settings;
  settings.tolerance = 1e-4;  // the model is used far from its reference
  int served = 0;
  double worst_share = 0;
  for (const ShapePointer& shape : {sphere(), ellipsoid(), smooth_pebble(), disc()})
    for (int k = 0; k < 300; ++k) {
      Pair pair = random_pair(random, *shape, *ellipsoid(), -1e-3);
      Memory memory{};
      for (int warm = 0; warm < 3; ++warm) find_contact(pair.a, pair.b, settings, memory.data());
      const double angle = std::pow(10, random.uniform(-4, -1.3));
      pair.a.q = random.turn_by(angle) * pair.a.q;
      pair.b.q = random.turn_by(angle) * pair.b.q;
      pair.b.x += 0.1 * angle * random.direction();
      const ContactResult r = find_contact(pair.a, pair.b, settings, memory.data());
      if (r.rung != Rung::local_model) continue;
      ++served;
      const ContactResult full = full_solve(pair, 1e-12);
      const double error = std::abs(r.gap - full.gap), bound = 0.5 * (r.upper - r.lower);
      ASSERT_LE(error, bound + 1e-14) << shape->name;
      if (bound > 1e-12) worst_share = std::max(worst_share, error / bound);
      ASSERT_LT((r.normal - full.normal).norm(), 20 * angle * angle + 1e-7) << shape->name;
    }
  EXPECT_GT(served, 300);
  EXPECT_GT(worst_share, 1e-3) << "the bound is so loose that the test shows nothing";
}

TEST(Ladder, tolerance_is_honoured) {
  Random random(23);
  for (const double tolerance : {1e-2, 1e-4, 1e-6, 1e-9, 1e-12})
    for (const ShapePointer& shape : smooth_shapes())
      for (int k = 0; k < 100; ++k) {
        const Pair pair = random_pair(random, *shape, *smooth_pebble(), -1e-3);
        const ContactResult r = full_solve(pair, tolerance);
        const double size =
            std::min(pair.a.scale * shape->bounding_radius, pair.b.scale * smooth_pebble()->bounding_radius);
        ASSERT_EQ(r.status, Status::converged) << shape->name << " " << tolerance;
        ASSERT_LE(r.upper - r.lower, tolerance * size);
        ASSERT_LE(r.lower, -1e-3 + 1e-13);
        ASSERT_GE(r.upper, -1e-3 - 1e-13);
      }
}

TEST(Ladder, allocates_nothing) {
  Random random(24);
  std::vector<Pair> pairs;
  for (const ShapePointer& shape : all_shapes())
    for (const double gap : {0.1, -1e-3, -0.3})
      pairs.push_back(random_pair(random, *shape, *ellipsoid(), gap));
  ContactSettings settings;
  settings.reach = 0;
  Memory warm{};
  find_contact(pairs[0].a, pairs[0].b, settings, warm.data());  // tables made once ...
  for (const Pair& pair : pairs) {                              // ... and for every shape
    pair.a.shape->inner_map();
    pair.b.shape->inner_map();
  }
  const long before = allocations();
  for (const Pair& pair : pairs)
    for (int repeat = 0; repeat < 3; ++repeat) {
      Memory memory{};
      find_contact(pair.a, pair.b, settings, memory.data());
      find_contact(pair.a, pair.b, settings, memory.data());
      find_plane_contact(pair.a, Vec3::Zero(), Vec3::UnitZ(), settings, memory.data());
    }
  EXPECT_EQ(allocations(), before);
}

TEST(Ladder, numbers_that_are_none_are_reported_not_spread) {
  Random random(25);
  const double none = std::nan("");
  const Pair good = random_pair(random, *ellipsoid(), *ellipsoid(), -1e-3);
  for (int what = 0; what < 4; ++what) {
    Pair pair = good;
    if (what == 0) pair.b.x[1] = none;
    if (what == 1) pair.a.q.x() = none;
    if (what == 2) pair.a.x[0] = 1 / 0.0;
    if (what == 3) pair.b.scale = none;
    Memory memory{};
    const ContactResult r = find_contact(pair.a, pair.b, ContactSettings(), memory.data());
    EXPECT_EQ(r.status, Status::unresolved);
    EXPECT_TRUE(std::isfinite(r.gap) && r.normal.allFinite());
    const ContactResult after = find_contact(good.a, good.b, ContactSettings(), memory.data());
    EXPECT_NEAR(after.gap, -1e-3, 1e-9) << "memory was poisoned";
  }
}

TEST(Ladder, deep_overlap_is_the_global_minimum) {
  Random random(26);
  for (const ShapePointer& shape : {ellipsoid(), disc(), smooth_pebble(), cuboid()})
    for (int k = 0; k < 50; ++k) {
      const Pair pair = random_pair(random, *shape, *ellipsoid(), random.uniform(-1, -0.2));
      const ContactResult r = full_solve(pair, 1e-6);
      double least = 1e300;
      for (int i = 0; i < 400; ++i)
        least = std::min(least, overlap_along(pair.a, pair.b, random.direction()));
      ASSERT_LE(-r.upper, least + 1e-9) << shape->name;  // nothing sampled beats it
      ASSERT_NEAR(overlap_along(pair.a, pair.b, r.normal), -r.gap, 2e-6) << shape->name;
    }
}

TEST(Plane, gap_of_an_ellipsoid_is_the_closed_form) {
  Random random(27);
  const Vec3 axes(1, 0.8, 0.6);
  ContactSettings settings;
  for (int k = 0; k < 500; ++k) {
    Particle p{ellipsoid().get(), random.uniform(0.5, 2), random.direction(), random.turn()};
    const Vec3 n = random.direction(), origin = p.x - random.uniform(0.5, 1.5) * n;
    Memory memory{};
    for (int step = 0; step < 4; ++step) {  // cold, warm, local model twice
      const ContactResult r = find_plane_contact(p, origin, n, settings, memory.data());
      const Vec3 d = p.q.conjugate() * -n;
      const double h = p.scale * axes.cwiseProduct(d).norm();
      ASSERT_NEAR(r.gap, n.dot(p.x - origin) - h, 1e-9);
      ASSERT_NEAR(n.dot(r.point_b - r.point_a), r.gap, 1e-12);
      ASSERT_LT((r.point_b - p.q * (p.scale * p.scale / h * axes.cwiseProduct(axes).cwiseProduct(d))).norm(),
                1e-6);
      p.q = random.turn_by(1e-4) * p.q;
    }
  }
}

// A loose solve moves its point on to second order: that may lie beside the surface, and bounds nothing.
TEST(Plane, loose_brackets_hold_the_gap) {
  Random random(28);
  ContactSettings settings;
  settings.tolerance = 1e-4;
  const ShapePointer shapes[] = {kinked(), smooth_pebble(), polar(), disc()};
  int warm = 0;
  for (int k = 0; k < 2000; ++k) {
    Particle p{shapes[k % 4].get(), random.uniform(0.5, 2), random.direction(), random.turn()};
    const Vec3 n = random.direction(), origin = p.x - random.uniform(0.5, 1.5) * n;
    const double turn = random.log_uniform(1e-3, 0.1), allowed = 1e-14 * p.scale;
    Memory memory{};
    for (int step = 0; step < 4; ++step) {
      const ContactResult r = find_plane_contact(p, origin, n, settings, memory.data());
      const double gap = n.dot(p.x - origin) - p.scale * find_hull_support(*p.shape, p.q.conjugate() * -n).h;
      ASSERT_LE(r.lower, gap + allowed);
      ASSERT_GE(r.upper, gap - allowed);
      warm += r.rung == Rung::warm;
      p.q = random.turn_by(turn) * p.q;
    }
  }
  EXPECT_GT(warm, 500);
}

}  // namespace
}  // namespace nurbs::test_ladder

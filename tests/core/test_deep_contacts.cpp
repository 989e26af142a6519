// Deep overlaps, where p(d) has several local minima: the answer is the global one, and this is what stays
// continuous when another minimum takes over.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "body/support.h"
#include "contact/pair_search.h"
#include "io/pair_case.h"
#include "shapes/primitives.h"
#include "shapes/revolved.h"
#include "support/bodies.h"
#include "support/cases.h"
#include "support/pairs.h"

namespace nurbs::test_deep_contacts {
namespace {

using namespace test;

ContactResult solve(const Pair& pair, double* memory) {
  return find_contact(pair.a, pair.b, ContactSettings(), memory);
}

struct Path {
  int steps = 0, jumps = 0;  // jumps: of the normal, by more than 0.5 rad in a step
  double worst_change = 0;   // of the gap in a step, over the bound
  double worst_turn = 0;     // of the normal in a step that is no jump
  double worst_memory = 0;   // difference from the answer without memory
  double energy_change = 0, work = 0, largest_force = 0;  // of a spring of stiffness 1
};

// Follows `pair` over `steps` steps; `move` takes it to a step and returns the bound on the change of the
// gap.
template <class Move>
Path follow(Pair pair, int steps, Move move) {
  Path path;
  double memory[kPairMemorySize] = {0};
  ContactResult last;
  Vec3 x;
  for (int step = 0; step <= steps; ++step) {
    const double bound = move(pair, step);
    const ContactResult r = solve(pair, memory);
    EXPECT_EQ(r.status, Status::converged);
    EXPECT_LT(r.gap, -0.1);
    double none[kPairMemorySize] = {0};
    path.worst_memory = std::max(path.worst_memory, std::abs(solve(pair, none).gap - r.gap));
    path.largest_force = std::max(path.largest_force, -r.gap);
    if (step > 0) {
      ++path.steps;
      const double turn = std::acos(std::clamp(r.normal.dot(last.normal), -1.0, 1.0));
      if (turn > 0.5)
        ++path.jumps;
      else
        path.worst_turn = std::max(path.worst_turn, turn);
      path.worst_change = std::max(path.worst_change, std::abs(r.gap - last.gap) / bound);
      path.energy_change += 0.5 * (r.gap * r.gap - last.gap * last.gap);
      path.work += 0.5 * (last.gap * last.normal + r.gap * r.normal).dot(pair.b.x - x);
    }
    last = r;
    x = pair.b.x;
  }
  return path;
}

// B passes from one side of A's middle to the other.
Path pass_through(int steps) {
  Random random(41);
  Pair pair{{ellipsoid().get(), 1, Vec3::Zero(), random.turn()},
            {smooth_pebble().get(), 0.5, Vec3::Zero(), random.turn()}};
  const Vec3 thin = pair.a.q * Vec3::UnitZ(), start = pair.a.q * Vec3(0.1, -0.05, 0.3);
  const double length = 0.6;
  return follow(pair, steps, [&](Pair& p, int step) {
    p.b.x = start - length * step / steps * thin;
    return length / steps;
  });
}

TEST(DeepContacts, gap_changes_no_faster_than_the_bodies_move_apart) {
  const Path path = pass_through(1000);
  EXPECT_LE(path.worst_change, 1 + 1e-5);
  EXPECT_EQ(path.jumps, 1);
  EXPECT_LT(path.worst_turn, 0.01);
  EXPECT_LT(path.worst_memory, 2e-9);  // no memory of the minimum that was
}

// Force times way equals the change of the energy, up to the one step in which the normal jumps.
TEST(DeepContacts, force_derives_from_an_energy_across_the_switch) {
  for (const int steps : {250, 500, 1000}) {
    const Path path = pass_through(steps);
    EXPECT_EQ(path.jumps, 1);
    EXPECT_LT(std::abs(path.work - path.energy_change), 2 * path.largest_force * 0.6 / steps) << steps;
  }
}

TEST(DeepContacts, turning_changes_the_gap_by_no_more_than_the_way_of_the_outermost_point) {
  Random random(42);
  Pair pair{{disc().get(), 1, Vec3::Zero(), Quat::Identity()},
            {disc().get(), 0.8, Vec3(0.3, 0.1, 0.02), Quat::Identity()}};
  pair.b.q = random.turn();
  const Quat start = pair.b.q;
  const double angle = M_PI;
  const int steps = 1000;
  const Path path = follow(pair, steps, [&](Pair& p, int step) {
    p.b.q = (Quat(Eigen::AngleAxisd(angle * step / steps, Vec3(0.6, 0, 0.8))) * start).normalized();
    return p.b.scale * p.b.shape->bounding_radius * angle / steps;
  });
  EXPECT_LE(path.worst_change, 1 + 1e-5);
  EXPECT_GE(path.jumps, 1);
  EXPECT_LT(path.worst_memory, 2e-9);
}

// An eighth of a ball deep inside an ellipsoid of 1e4 its size. The hull of directions is coarse where caps
// prove the minimum, and its nearest triangle was taken for the contact points: they lay 0.7 off their
// bodies, along the normal, one outside and one inside.
TEST(DeepContacts, points_lie_on_their_bodies_where_caps_prove_the_minimum) {
  const PairCase c = read_pair_case(case_file("octant-in-large-ellipsoid"));
  for (const bool maps : {false, true}) {
    if (maps) c.a.shape->inner_map(), c.b.shape->inner_map();
    double memory[kPairMemorySize] = {0};
    const ContactResult r = find_contact(c.a, c.b, c.settings, memory);
    ASSERT_EQ(r.status, Status::converged);
    const double allowed = c.settings.tolerance * c.a.scale * c.a.shape->bounding_radius;
    const auto beyond = [&](const Particle& p, const Vec3& d, const Vec3& point) {
      return d.dot(point) - p.scale * find_hull_support(*p.shape, p.q.conjugate() * d).h;
    };
    EXPECT_NEAR(beyond(c.a, r.normal, r.point_a), 0, allowed);
    EXPECT_NEAR(beyond(c.b, -r.normal, r.point_b - (c.b.x - c.a.x)), 0, allowed);
  }
}

// Across a strip of 1e-9 of the body a tangent is as short as next to a pole, where the normal is a limit: it
// was taken for that, pointed anywhere, and a ball in the body came back as 300 away, certified.
TEST(DeepContacts, a_narrow_strip_is_no_pole) {
  Random random(7);
  const ShapePointer ball = make_shape("ball", exact_ellipsoid(Vec3(1, 1, 1)));
  for (const double length : {1e-12, 1e-10, 1e-9}) {
    const ShapePointer about = make_shape("about", capsule(0.5, length));
    for (int k = 0; k < 150; ++k) {
      const Particle a{ball.get(), 1, Vec3::Zero(), random.turn()},
          b{about.get(), random.log_uniform(0.1, 1e3), random.log_uniform(1e-12, 0.1) * random.direction(),
            random.turn()};
      double memory[kPairMemorySize] = {0};
      ContactSettings settings;
      settings.reach = 0;
      const ContactResult r = find_contact(a, b, settings, memory);
      const double gap = b.x.norm() - 1 - b.scale * 0.5, allowed = 1e-5 * (1 + b.scale);
      ASSERT_NE(r.status, Status::separated) << length << " " << k;
      ASSERT_LE(r.lower, gap + allowed);
      ASSERT_GE(r.upper, gap - allowed);
      ASSERT_NEAR(r.gap, gap, allowed);
    }
  }
}

// A round apex deep over the middle of a face: the bracket closed by other means, the hull stayed coarse, and
// the point of the apex came out beside it by up to 0.4 of its size, gap and normal right.
TEST(DeepContacts, AnApexOverAFaceIsTouchedThere) {
  Random random(1);
  const ShapePointer face = make_shape("tablet", tablet(1, 0.8, 0.05));
  for (const ShapePointer& round :
       {make_shape("lens", lens(1, 2, 0.05)), make_shape("ellipsoid", exact_ellipsoid(Vec3(1, 0.8, 0.6)))})
    for (const double depth : {0.1, 0.3, 0.6})
      for (int k = 0; k < 40; ++k) {
        Particle a, b;
        a.shape = face.get();
        a.q = random.turn();
        const Vec3 up = a.q * Vec3::UnitZ();
        b.shape = round.get();
        b.scale = 0.7;
        b.q = (Quat(Eigen::AngleAxisd(random.uniform(0, 6), up)) * a.q).normalized();
        b.x = (0.4 + b.scale * find_hull_support(*round, Vec3::UnitZ()).h - depth) * up;
        double memory[kPairMemorySize] = {0};
        const ContactResult r = find_contact(a, b, ContactSettings(), memory);
        ASSERT_EQ(r.status, Status::converged);
        ASSERT_NEAR(r.gap, -depth, 1e-9);
        EXPECT_LT((r.point_b - b.x).cross(up).norm(), 1e-3) << round->name << " " << depth;
        EXPECT_LT((r.point_b - r.point_a).cross(up).norm(), 1e-3) << round->name << " " << depth;
      }
}

}  // namespace
}  // namespace nurbs::test_deep_contacts

// The polytope fallback against the separating-axis theorem on boxes, and on bodies Newton can't treat.
#include <gtest/gtest.h>

#include "contact/overlap/polytope.h"
#include "contact/pair_search.h"
#include "support/bodies.h"
#include "support/pairs.h"

namespace nurbs::test_polytope {
namespace {

using namespace test;

// Penetration depth of two overlapping boxes: least overlap over the 15 candidate axes (Gottschalk et al.
// 1996). Negative when an axis separates (then only its sign is meaningful).
double separating_axis_overlap(const Pair& pair, const Vec3& half) {
  const Mat3 ra = pair.a.q.toRotationMatrix(), rb = pair.b.q.toRotationMatrix();
  const Vec3 offset = pair.b.x - pair.a.x;
  double least = 1e300;
  const auto try_axis = [&](const Vec3& axis) {
    const double length = axis.norm();
    if (length < 1e-9) return;
    const Vec3 d = axis / length;
    const double reach = pair.a.scale * (ra.transpose() * d).cwiseAbs().dot(half) +
                         pair.b.scale * (rb.transpose() * d).cwiseAbs().dot(half);
    least = std::min(least, reach - std::abs(d.dot(offset)));
  };
  for (int i = 0; i < 3; ++i) {
    try_axis(ra.col(i));
    try_axis(rb.col(i));
    for (int j = 0; j < 3; ++j) try_axis(ra.col(i).cross(rb.col(j)));
  }
  return least;
}

TEST(Polytope, box_penetration_equals_the_separating_axis_theorem) {
  Random random(11);
  int overlapping = 0;
  for (int k = 0; k < 2000; ++k) {
    const Pair pair = random_pair(random, *cuboid(), *cuboid(), random.uniform(-0.8, 0.1));
    const double overlap = separating_axis_overlap(pair, Vec3(1, 0.8, 0.6));
    const PolytopeResult r = solve_polytope(PairFrame(pair.a, pair.b), Vec3::Zero(), 1e-10, kFarAway);
    ASSERT_TRUE(r.converged) << k;
    if (overlap <= 0) {
      ASSERT_GT(r.gap, -1e-9);
      continue;
    }
    ++overlapping;
    ASSERT_NEAR(-r.gap, overlap, 1e-9) << k;
    const Vec3 apart = r.points.b - r.points.a;
    ASSERT_LT((apart - r.gap * r.bracket.direction).norm(), 1e-8) << k;  // witnesses face each other
    ASSERT_LE(r.bracket.lower, r.gap);
    ASSERT_GE(r.bracket.upper, r.gap);
  }
  EXPECT_GT(overlapping, 500);
}

// Their faces all but parallel, in both orders: needles in the hull, with corners up to 1e4 times as far from
// the origin as its nearest point. The overlap is along the large box's normal.
TEST(Polytope, small_boxes_on_large_ones) {
  Random random(5);
  const Vec3 half(1, 0.8, 0.6);
  for (int k = 0; k < 20000; ++k) {
    const double ratio = random.log_uniform(1e2, 1e4);
    Particle small{cuboid().get(), 1 / ratio, Vec3::Zero(), random.turn_by(random.log_uniform(1e-12, 1e-1))};
    const Particle large{cuboid().get(), 1, Vec3::Zero(), Quat::Identity()};
    const double radius = small.scale * cuboid()->bounding_radius;
    const double gap = radius * random.log_uniform(1e-12, 1e-2) * random.sign();
    const double reach = small.scale * (small.q.toRotationMatrix().row(2).cwiseAbs() * half)(0);
    small.x = Vec3(0, 0, half[2] + reach + gap) +
              radius * random.log_uniform(1e-9, 10) * Vec3::UnitZ().cross(random.direction());
    const double allowed = 1e-9 * radius + 16 * kRoundoff * large.scale * cuboid()->bounding_radius;
    for (const bool swapped : {false, true}) {
      double memory[kPairMemorySize] = {0};
      const ContactResult r =
          swapped ? find_contact(large, small, {}, memory) : find_contact(small, large, {}, memory);
      ASSERT_NE(r.status, Status::unresolved) << k;
      ASSERT_LE(r.lower, gap + allowed) << k;
      if (r.status == Status::converged) {
        ASSERT_GE(r.upper, gap - allowed) << k;
      }
    }
  }
}

TEST(Polytope, aligned_faces_edges_and_corners) {
  ContactSettings settings;
  const auto gap = [&](const Vec3& x, const Quat& q) {
    Particle a{cuboid().get(), 1, Vec3::Zero(), Quat::Identity()}, b{cuboid().get(), 1, x, q};
    double memory[kPairMemorySize] = {0};
    const ContactResult r = find_contact(a, b, settings, memory);
    EXPECT_EQ(r.status, Status::converged);
    EXPECT_NEAR(r.normal.norm(), 1, 1e-12);
    return r.gap;
  };
  EXPECT_NEAR(gap(Vec3(0, 0, 1.1), Quat::Identity()), -0.1, 1e-9);         // face on face
  EXPECT_NEAR(gap(Vec3(0.3, 0.2, 1.1), Quat::Identity()), -0.1, 1e-9);     // shifted
  EXPECT_NEAR(gap(Vec3(2.3, 1.6 + 0.4, 0), Quat::Identity()), 0.5, 1e-9);  // edge to edge, apart
  EXPECT_NEAR(gap(Vec3(0, 0, 1.2), Quat::Identity()), 0, 1e-9);            // just touching
  const Quat quarter(Eigen::AngleAxisd(M_PI / 4, Vec3::UnitX()));
  const double reach = (0.8 + 0.6) / std::sqrt(2.0);  // an edge pointing down
  EXPECT_NEAR(gap(Vec3(0, 0, 0.6 + reach - 0.05), quarter), -0.05, 1e-9);
}

TEST(Polytope, concentric_bodies_get_a_valid_answer) {
  for (const ShapePointer& shape : all_shapes()) {
    Particle a{shape.get(), 1, Vec3::Zero(), Quat::Identity()}, b = a;
    double memory[kPairMemorySize] = {0};
    const ContactResult r = find_contact(a, b, ContactSettings(), memory);
    ASSERT_TRUE(std::isfinite(r.gap)) << shape->name;
    ASSERT_NEAR(r.normal.norm(), 1, 1e-12);
    // The depth is twice the least half-width, known for these symmetric bodies.
    if (shape != smooth_pebble() && shape != kinked()) {
      EXPECT_NEAR(r.gap, -2 * shape->inner_radius, 1e-6) << shape->name;
    }
  }
}

// Turned so that round-off makes needles of coplanar supports, whose normals are anything.
TEST(Polytope, concentric_boxes_of_one_turn) {
  Particle a{cuboid().get(), 1, Vec3::Zero(),
             Quat(-0.83435395672909496, -0.24542780093477598, -0.39674083801244098, -0.29362455086727618)};
  const Particle b = a;
  double memory[kPairMemorySize] = {0};
  const ContactResult r = find_contact(a, b, ContactSettings(), memory);
  EXPECT_EQ(r.status, Status::converged);
  EXPECT_NEAR(r.gap, -1.2, 1e-9);
}

}  // namespace
}  // namespace nurbs::test_polytope

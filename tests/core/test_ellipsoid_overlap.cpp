// The least overlap of ellipsoids, capsules and balls by intervals of the ratio of their heights, against a
// search over directions and closed forms.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "contact/overlap/ellipsoid_overlap.h"
#include "contact/pair_search.h"
#include "nurbs/tolerances.h"
#include "shapes/primitives.h"
#include "shapes/revolved.h"
#include "support/bodies.h"
#include "support/least_overlap.h"
#include "support/pairs.h"

namespace nurbs::test_ellipsoid_overlap {
namespace {

using test::Random;

SweptEllipsoid ellipsoid(const Vec3& semi, const Quat& q) {
  const Mat3 turn = q.toRotationMatrix();
  return {turn * semi.asDiagonal() * turn.transpose(), semi.minCoeff(), semi.maxCoeff(), 0};
}

double overlap(const SweptEllipsoid& a, const SweptEllipsoid& b, const Vec3& offset, const Vec3& d) {
  return a.height(d) + a.ball + b.height(d) + b.ball - offset.dot(d);
}

// Nothing found by other means may lie below the level, and the overlap is that along its direction.
void expect_least(const SweptEllipsoid& a, const SweptEllipsoid& b, const Vec3& offset, double tolerance,
                  const LeastOverlap& found, Random& random) {
  const auto p = [&](const Vec3& d) { return overlap(a, b, offset, d); };
  const double noise = 1e-14 * (a.most + b.most + a.ball + b.ball);
  EXPECT_NEAR(found.direction.norm(), 1, 1e-14);
  EXPECT_NEAR(p(found.direction), found.overlap, noise);
  EXPECT_LE(found.level, found.overlap);
  EXPECT_GE(found.level, found.overlap - tolerance);
  const double searched = test::least_overlap(p, test::spiral(400), test::Compass(), random);
  EXPECT_GE(searched, found.level - noise);
  for (int k = 0; k < 30; ++k) {
    const Vec3 near = (found.direction + random.log_uniform(1e-7, 1) * random.direction()).normalized();
    EXPECT_GE(p(near), found.level - noise);
  }
}

// From any direction; what is found is held against that. False where nothing is.
bool solve(const SweptEllipsoid& a, const SweptEllipsoid& b, const Vec3& offset, double tolerance,
           Random& random, LeastOverlap* found) {
  if (!find_least_overlap(a, b, offset, random.direction(), tolerance, found)) return false;
  expect_least(a, b, offset, tolerance, *found, random);
  return true;
}

TEST(EllipsoidOverlap, nothing_lies_below_its_level) {
  Random random(31);
  int solved = 0;
  constexpr int kPairs = 1500;
  for (int k = 0; k < kPairs; ++k) {
    const auto semi = [&] {
      Vec3 s(1, random.log_uniform(0.02, 1), random.log_uniform(0.02, 1));
      if (random.below(3) == 0) s[1] = s[2];
      if (random.below(4) == 0) s[1] = 1;
      return s;
    };
    const double scale = random.log_uniform(1e-2, 1e2);
    const Quat turn = random.turn();
    const SweptEllipsoid a = ellipsoid(semi(), turn),
                         b = ellipsoid(scale * semi(), random.below(3) ? random.turn() : turn);
    const double deep = std::min(a.least, b.least),
                 tolerance = 1e-9 * std::min(a.most, b.most) * random.log_uniform(0.1, 1e3);
    const Vec3 offset =
        random.below(8) ? Vec3(random.log_uniform(1e-8, 1) * deep * random.direction()) : Vec3(Vec3::Zero());
    LeastOverlap found;
    solved += solve(a, b, offset, tolerance, random, &found);
    ASSERT_FALSE(HasFailure()) << k;
  }
  EXPECT_GT(solved, kPairs * 99 / 100);
}

TEST(EllipsoidOverlap, of_segments_and_balls) {
  Random random(32);
  int solved = 0, at_creases = 0;
  constexpr int kPairs = 800;
  for (int k = 0; k < kPairs; ++k) {
    const SweptEllipsoid a =
        ellipsoid(Vec3(1, random.log_uniform(0.1, 1), random.log_uniform(0.1, 1)), random.turn());
    const SweptEllipsoid b = SweptEllipsoid::along(
        random.below(5) ? Vec3(random.log_uniform(1e-2, 10) * random.direction()) : Vec3(Vec3::Zero()),
        random.log_uniform(1e-2, 1));
    const double tolerance = 1e-9;
    const Vec3 offset = random.log_uniform(1e-6, 0.9) * a.least * random.direction();
    // Either may come first.
    const bool first = random.below(2) == 0;
    LeastOverlap found;
    if (!solve(first ? a : b, first ? b : a, offset, tolerance, random, &found)) continue;
    ++solved;
    ASSERT_FALSE(HasFailure()) << k;
    at_creases += b.most > 0 && b.height(found.direction) < 1e-9 * b.most;
  }
  EXPECT_GT(solved, kPairs * 99 / 100);
  EXPECT_GT(at_creases, kPairs / 10);
}

// Two balls, concentric ellipsoids alike, a ball in an ellipsoid of revolution: whole spheres and circles of
// directions are as good.
TEST(EllipsoidOverlap, of_many_directions_alike) {
  Random random(33);
  const auto least = [&](const Vec3& semi_a, const Vec3& semi_b, const Vec3& offset) {
    LeastOverlap found{};
    EXPECT_TRUE(find_least_overlap(ellipsoid(semi_a, Quat::Identity()), ellipsoid(semi_b, Quat::Identity()),
                                   offset, random.direction(), 1e-10, &found));
    return found.overlap;
  };
  EXPECT_NEAR(least(Vec3(1, 1, 1), Vec3(2, 2, 2), Vec3::Zero()), 3, 1e-14);
  EXPECT_NEAR(least(Vec3(1, 1, 1), Vec3(2, 2, 2), Vec3(0, 0.5, 0)), 2.5, 1e-10);
  EXPECT_NEAR(least(Vec3(1, 0.7, 0.4), Vec3(2, 1.4, 0.8), Vec3::Zero()), 1.2, 1e-10);
  EXPECT_NEAR(least(Vec3(1, 0.5, 0.5), Vec3(0.3, 0.3, 0.3), Vec3::Zero()), 0.8, 1e-10);
  EXPECT_NEAR(least(Vec3(1, 0.5, 0.5), Vec3(0.3, 0.3, 0.3), Vec3(1e-3, 0, 0)), 0.8, 1e-4);
}

// Where the offset has no share of the least axis of a test's matrix, its weight is known but for round-off:
// axes and offset in line, a ball on an ellipsoid's axis, needles that hardly overlap but along it.
TEST(EllipsoidOverlap, of_bodies_in_line) {
  Random random(35);
  int solved = 0;
  constexpr int kPairs = 1200;
  for (int k = 0; k < kPairs; ++k) {
    const Quat turn = k % 2 ? random.turn() : Quat::Identity();
    const auto semi = [&] {
      const double across = random.log_uniform(0.02, 1);
      return k % 3 == 0 ? Vec3(1, across, across) : Vec3(1, across, random.log_uniform(0.02, 1));
    };
    const SweptEllipsoid a = ellipsoid(semi(), turn);
    const double scale = random.log_uniform(0.1, 10);
    const SweptEllipsoid b =
        k % 4 == 0 ? ellipsoid(Vec3(scale, scale, scale), turn) : ellipsoid(scale * semi(), turn);
    const int axis = random.below(3);
    const Vec3 e = turn * Vec3(Vec3::Unit(axis));
    const Vec3 offset = random.uniform(0, 0.99) * (a.height(e) + b.height(e)) * e;
    const double tolerance = 1e-9 * std::min(a.most, b.most);
    LeastOverlap found;
    solved += solve(a, b, offset, tolerance, random, &found);
    ASSERT_FALSE(HasFailure()) << k;
  }
  EXPECT_GT(solved, kPairs * 99 / 100);
}

// Bodies that touch or are apart belong to other searches; so do size ratios that take all digits.
TEST(EllipsoidOverlap, says_what_it_cannot_do) {
  LeastOverlap found;
  const SweptEllipsoid ball = ellipsoid(Vec3(1, 1, 1), Quat::Identity()),
                       capsule = SweptEllipsoid::along(Vec3(0, 0, 1), 0.5);
  EXPECT_FALSE(find_least_overlap(ball, ball, Vec3(3, 0, 0), Vec3::UnitX(), 1e-9, &found));
  EXPECT_FALSE(find_least_overlap(ball, ball, Vec3(2, 0, 0), Vec3::UnitX(), 1e-9, &found));
  EXPECT_FALSE(find_least_overlap(ball, capsule, Vec3(1.2, 0, 0), Vec3::UnitX(), 1e-9, &found))
      << "only the capsule's ball overlaps";
  const SweptEllipsoid point = SweptEllipsoid::along(Vec3::Zero(), 1);
  EXPECT_FALSE(find_least_overlap(point, point, Vec3::Zero(), Vec3::UnitX(), 1e-9, &found));
  EXPECT_FALSE(find_least_overlap(capsule, capsule, Vec3::Zero(), Vec3::UnitX(), 1e-9, &found));
  const SweptEllipsoid large = ellipsoid(1e7 * Vec3(1, 0.9, 0.8), Quat::Identity());
  EXPECT_FALSE(find_least_overlap(ball, large, Vec3::Zero(), Vec3::UnitX(), 1e-9, &found));
}

// Whole pairs: what find_contact says of a capsule in an ellipsoid, points on both bodies.
TEST(EllipsoidOverlap, a_capsule_in_an_ellipsoid) {
  Random random(34);
  const auto round = make_shape("round", exact_ellipsoid(Vec3(1, 0.8, 0.5))),
             rod = make_shape("rod", capsule(0.2, 1.1));
  ASSERT_TRUE(round->ellipsoid.found);
  ASSERT_TRUE(rod->core.found());
  for (int k = 0; k < 300; ++k) {
    test::Pair pair{{round.get(), 1, Vec3::Zero(), random.turn()},
                    {rod.get(), random.log_uniform(0.3, 3), Vec3::Zero(), random.turn()}};
    pair.b.x = random.log_uniform(1e-4, 0.2) * random.direction();
    if (k % 2) std::swap(pair.a, pair.b);
    double memory[kPairMemorySize] = {0};
    const ContactSettings settings;
    const ContactResult r = find_contact(pair.a, pair.b, settings, memory);
    ASSERT_EQ(r.status, Status::converged);
    const double size = std::min(pair.a.scale * pair.a.shape->bounding_radius,
                                 pair.b.scale * pair.b.shape->bounding_radius),
                 allowed = settings.tolerance * size;
    EXPECT_LE(r.upper - r.lower, allowed * (1 + 1e-9));
    const auto p = [&](const Vec3& d) { return test::overlap_along(pair.a, pair.b, d); };
    EXPECT_NEAR(p(r.normal), -r.gap, allowed);
    for (int i = 0; i < 200; ++i) {
      const double near = random.log_uniform(1e-6, 3);
      ASSERT_GE(p((r.normal + near * random.direction()).normalized()), -r.upper - allowed) << k;
    }
    // Supports along the normal, both of them, one above the other: else they would not be the contact's.
    EXPECT_NEAR(r.normal.dot(r.point_a), r.normal.dot(r.point_b) - r.gap, allowed);
    EXPECT_LT((r.point_b - r.point_a - r.gap * r.normal).norm(), 1e-4 * size) << k;
  }
}

}  // namespace
}  // namespace nurbs::test_ellipsoid_overlap

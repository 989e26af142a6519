// The quick test for overlap against planes that separate the bodies, and against the brackets of the search.
#include <gtest/gtest.h>

#include "contact/overlap/overlap_test.h"
#include "contact/pair_search.h"
#include "support/bodies.h"
#include "support/random.h"
#include "support/solid_families.h"

namespace nurbs::test_overlap_test {
namespace {

using families::any_solid;
using test::Random;
using test::Solid;

constexpr double kTolerance = 1e-6;

// B stands off A by `gap` times the smaller radius along n, which separates them where that is above 0.
void place_beside(const Solid& sa, const Solid& sb, Random& random, double gap, Particle* a, Particle* b) {
  *a = {sa.shape.get(), 1 / sa.shape->bounding_radius, Vec3(3, -2, 1), random.turn()};
  *b = {sb.shape.get(), random.log_uniform(0.3, 3) / sb.shape->bounding_radius, Vec3::Zero(), random.turn()};
  const Vec3 n = random.direction();
  const double size = std::min(1.0, b->scale * sb.shape->bounding_radius);
  b->x = a->x + support_of(sa, *a, n) - support_of(sb, *b, -n) + size * gap * n;
}

TEST(OverlapTest, bodies_apart_are_never_said_to_overlap) {
  Random random(411);
  int seen = 0, count = 0;
  for (int k = 0; k < 3000; ++k) {
    Particle a, b;
    place_beside(any_solid(random), any_solid(random), random, random.log_uniform(2 * kTolerance, 1), &a, &b);
    const PairFrame pair(a, b);
    const std::optional<bool> found = test_overlap(pair, kTolerance * pair.size);
    ASSERT_FALSE(found.value_or(false)) << a.shape->name << ", " << b.shape->name << " " << k;
    seen += found.has_value();
    ++count;
  }
  EXPECT_GT(seen, 0.8 * count);
}

TEST(OverlapTest, agrees_with_the_search_and_mostly_knows) {
  Random random(412);
  int overlaps = 0;
  for (int k = 0; k < 3000; ++k) {
    Particle a, b;
    place_beside(any_solid(random), any_solid(random), random, -random.log_uniform(1e-12, 1), &a, &b);
    ContactSettings settings;
    double memory[kPairMemorySize] = {};
    const ContactResult r = find_contact(a, b, settings, memory);
    const PairFrame pair(a, b);
    const std::optional<bool> found = test_overlap(pair, kTolerance * pair.size);
    if (!found) continue;
    overlaps += *found;
    if (*found)
      ASSERT_LE(r.lower, kTolerance * pair.size) << a.shape->name << ", " << b.shape->name << " " << k;
    else
      ASSERT_GE(r.upper, kTolerance * pair.size) << a.shape->name << ", " << b.shape->name << " " << k;
  }
  EXPECT_GT(overlaps, 800);
}

TEST(OverlapTest, bodies_about_one_centre_overlap) {
  Random random(413);
  for (int k = 0; k < 500; ++k) {
    Particle a, b;
    place_beside(any_solid(random), any_solid(random), random, 0, &a, &b);
    b.x = a.x;
    const PairFrame pair(a, b);
    EXPECT_TRUE(test_overlap(pair, kTolerance * pair.size).value_or(true)) << k;
  }
  for (const test::ShapePointer& shape : test::all_shapes()) {
    const Particle a{shape.get(), 1, Vec3::Zero(), Quat::Identity()},
        b{shape.get(), 0.7, Vec3(0.01, 0.02, -0.01) * shape->bounding_radius, random.turn()};
    EXPECT_TRUE(test_overlap(PairFrame(a, b), kTolerance).value_or(true)) << shape->name;
  }
}

}  // namespace
}  // namespace nurbs::test_overlap_test

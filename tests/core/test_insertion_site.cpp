// Insertion sites against asking every body, and against the closed form for spheres.
#include <gtest/gtest.h>

#include "contact/pair_search.h"
#include "scene/insertion_site.h"
#include "support/bodies.h"
#include "support/random.h"

namespace nurbs::test_insertion_site {
namespace {

using namespace test;

Particle random_body(Random& random, const ShapePointer& shape, double low, double high, double room) {
  Particle body;
  body.shape = shape.get();
  body.scale = random.log_uniform(low, high);
  for (int k = 0; k < 3; ++k) body.x[k] = random.uniform(-room, room);
  body.q = random.turn();
  return body;
}

bool touch(const Particle& a, const Particle& b) {
  ContactSettings settings;
  settings.tolerance = 1e-9;
  double memory[kPairMemorySize] = {};
  return find_contact(a, b, settings, memory).gap <= 0;
}

// Sizes 1:30 in cells made for the largest, the smallest and one in between.
TEST(InsertionSite, finds_what_asking_every_body_finds) {
  for (const double size : {0.1, 0.6, 3.0}) {
    Random random(7);
    InsertionSite site;
    site.clear(size);
    std::vector<Particle> placed;
    int found = 0;
    for (int k = 0; k < 1500; ++k) {
      const Particle body = random_body(random, all_shapes()[k % all_shapes().size()], 0.1, 3, 8);
      bool expected = false;
      for (const Particle& other : placed) {
        const double reach =
            body.scale * body.shape->bounding_radius + other.scale * other.shape->bounding_radius;
        expected |= (body.x - other.x).norm() < reach && touch(other, body);
        if (expected) break;
      }
      ASSERT_EQ(site.overlaps(body, Overlap::exact), expected) << k;
      found += expected;
      if (expected) continue;
      site.add(body);
      placed.push_back(body);
    }
    EXPECT_EQ(site.count(), static_cast<int>(placed.size()));
    EXPECT_GT(found, 100);
    EXPECT_GT(placed.size(), 100u);
  }
}

TEST(InsertionSite, tells_spheres_at_a_hair) {
  InsertionSite site;
  site.clear(1);
  Particle ball;
  ball.shape = sphere().get();
  ball.x = Vec3(-1e-12, 7, -3);  // at a border of cells
  site.add(ball);
  Random random(3);
  for (int k = 0; k < 200; ++k) {
    Particle other = ball;
    other.scale = random.uniform(0.01, 20);
    const Vec3 d = random.direction();
    for (const double gap : {-1e-4, 1e-4}) {
      other.x = ball.x + (1 + other.scale + gap) * d;
      for (const Overlap judge : {Overlap::exact, Overlap::sphere})
        ASSERT_EQ(site.overlaps(other, judge), gap < 0) << other.scale;
    }
  }
  site.clear(1);
  EXPECT_FALSE(site.overlaps(ball, Overlap::exact));
}

// A shape file in mm among grains in m, say: laid out over cells made for the grains it would fill the
// memory.
TEST(InsertionSite, holds_a_body_thousands_of_times_as_large) {
  InsertionSite site;
  site.clear(1);
  Particle large;
  large.shape = sphere().get();
  large.scale = 3e4;
  large.x = Vec3(3e4, 0, 0);
  Particle grain;
  grain.shape = sphere().get();
  grain.x = Vec3(-5, 0, 0);
  site.add(grain);
  EXPECT_FALSE(site.overlaps(large, Overlap::exact));
  grain.x.x() = -0.5;
  EXPECT_FALSE(site.overlaps(grain, Overlap::exact));
  site.add(large);
  EXPECT_TRUE(site.overlaps(grain, Overlap::exact));
  EXPECT_TRUE(site.overlaps(large, Overlap::sphere));
  grain.x.x() = -1.001;
  grain.x.y() = 40;  // beside the first
  EXPECT_FALSE(site.overlaps(grain, Overlap::exact));
  EXPECT_EQ(site.count(), 2);
}

}  // namespace
}  // namespace nurbs::test_insertion_site

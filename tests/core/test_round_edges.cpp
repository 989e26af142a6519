// Arcs found on the edges of bodies, against what the bodies were made of.
#include <gtest/gtest.h>

#include <cmath>

#include "body/round_edges.h"
#include "body/shape.h"
#include "body/support.h"
#include "support/random.h"
#include "support/solids.h"

namespace nurbs::test_round_edges {
namespace {

using test::Random;
using test::Solid;

// No point of an arc is outside the body, and all touch it from inside: along the arc's own outward direction
// or tilted from it, some support is there.
void expect_on_body(const Shape& shape, const RoundEdges& e) {
  EXPECT_NEAR(e.axis.norm(), 1, 1e-14);
  EXPECT_NEAR(e.axis.dot(e.start), 0, 1e-14);
  EXPECT_LT(e.error, 1e-12);
  for (const RoundEdges::Circle& c : e.edges)
    for (int k = 0; k <= 40; ++k) {
      const Vec3 out = e.outward(e.from + (e.to - e.from) * k / 40);
      const Vec3 x = e.point + c.z * e.axis + c.radius * out;
      double off = 1e300;
      for (int i = -20; i <= 20; ++i) {
        const double tilt = 0.0785 * i;
        const Vec3 d = std::cos(tilt) * out + std::sin(tilt) * e.axis;
        off = std::min(off, find_hull_support(shape, d).h - d.dot(x));
        EXPECT_GE(find_hull_support(shape, d).h - d.dot(x), -1e-13);
      }
      EXPECT_LT(off, 1e-13);
    }
}

TEST(RoundEdges, two_half_circles_make_a_sphericon) {
  Random random(5);
  const Solid solid = test::sphericon(random);
  ASSERT_EQ(solid.shape->round_edges.size(), 2u);
  for (const RoundEdges& e : solid.shape->round_edges) {
    ASSERT_EQ(e.edges.size(), 1u);
    EXPECT_NEAR(e.edges[0].radius, 1, 1e-14);
    EXPECT_NEAR(e.to - e.from, M_PI, 1e-12);
    expect_on_body(*solid.shape, e);
  }
}

TEST(RoundEdges, arcs_about_one_axis_go_together) {
  Random random(6);
  const Solid solid = test::reuleaux_prism(random, 0.4);
  ASSERT_EQ(solid.shape->round_edges.size(), 3u);
  for (const RoundEdges& e : solid.shape->round_edges) {
    ASSERT_EQ(e.edges.size(), 2u);
    EXPECT_NEAR(std::abs(e.edges[0].z - e.edges[1].z), 0.8, 1e-13);
    EXPECT_NEAR(e.edges[0].radius, e.edges[1].radius, 1e-13);
    EXPECT_NEAR(e.to - e.from, M_PI / 3, 1e-12);
    expect_on_body(*solid.shape, e);
  }
}

TEST(RoundEdges, whole_circles_close) {
  Random random(7);
  const Solid solid = test::frustum(random, 0.9, 0.5, 1);
  EXPECT_TRUE(solid.shape->round_edges.empty());  // it is of revolution itself
  const std::vector<RoundEdges> found = find_round_edges(*solid.shape);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_TRUE(found[0].whole());
  EXPECT_TRUE(found[0].holds(17, 3));
  ASSERT_EQ(found[0].edges.size(), 2u);
  const double low = std::min(found[0].edges[0].radius, found[0].edges[1].radius);
  EXPECT_NEAR(low, 0.5, 1e-13);
  expect_on_body(*solid.shape, found[0]);
}

TEST(RoundEdges, ellipses_are_none) {
  Random random(8);
  const Solid solid = test::stretched(random, test::cylinder(random, 0.7, 0.5), 0.5);
  EXPECT_TRUE(find_round_edges(*solid.shape).empty());
}

TEST(RoundEdges, an_arc_holds_what_lies_within_its_ends) {
  RoundEdges e;
  e.from = -0.5;
  e.to = 1;
  EXPECT_TRUE(e.holds(0, 0.5));
  EXPECT_TRUE(e.holds(2 * M_PI, 0.4));
  EXPECT_TRUE(e.holds(-2 * M_PI + 0.7, 0.25));
  EXPECT_FALSE(e.holds(0, 0.6));
  EXPECT_FALSE(e.holds(0.7, 0.4));
  EXPECT_FALSE(e.holds(3, 0));
}

}  // namespace
}  // namespace nurbs::test_round_edges

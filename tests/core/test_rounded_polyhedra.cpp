// Hulls of random points with rounded edges: erosion leaves needles and slivers in their corners.
#include <gtest/gtest.h>

#include "body/proofs.h"
#include "body/shape.h"
#include "body/support.h"
#include "shapes/hull_fit.h"
#include "shapes/rounded_polyhedron.h"
#include "support/random.h"

namespace nurbs::test_rounded_polyhedra {
namespace {

using test::Random;

ConvexHull random_hull(Random& random, int points) {
  std::vector<Vec3> all;
  for (int k = 0; k < points; ++k)
    all.push_back(random.uniform(0.6, 1.4) * random.direction().cwiseProduct(Vec3(1.2, 1, 0.7)));
  return ConvexHull(all);
}

std::shared_ptr<const Shape> rounded(const ConvexHull& hull, double rounding) {
  return make_shape("rounded", rounded_polyhedron(facets(hull, 300), hull.properties().center, rounding));
}

// Planes, cylinders and balls are known as such, whatever their form: no more than a cell or two each.
TEST(RoundedPolyhedra, are_proven_convex_at_once) {
  Random random(31);
  for (int trial = 0; trial < 4; ++trial) {
    const double rounding = random.log_uniform(0.015, 0.05);
    const auto shape = rounded(random_hull(random, random.whole(15, 40)), rounding);
    EXPECT_TRUE(proven_without_dents(*shape)) << trial;
    EXPECT_LT(shape->proofs.cells, 4 * static_cast<int>(shape->patches.size())) << trial;
    EXPECT_GT(shape->patch_curvature.min_radius, 0.8 * rounding) << trial;
    EXPECT_LE(shape->patch_curvature.min_radius, 1.0001 * rounding) << trial;
  }
}

// Normals of needles are round-off, and no sign of a dent that supports might miss, which leaves contacts
// unresolved.
TEST(RoundedPolyhedra, have_no_dents_of_roundoff) {
  for (const unsigned seed : {22, 27, 43, 58}) {
    Random random(seed);
    const auto shape = rounded(random_hull(random, 22), 0.03);
    EXPECT_LT(shape->support_excess, 5e-11 * shape->bounding_radius) << seed;
  }
}

// In slivers a search over their boxes ends wide of what the normal at a point already proves: next to none
// of their supports stays open.
TEST(RoundedPolyhedra, supports_are_certified) {
  Random random(34);
  int open = 0, all = 0;
  for (const unsigned seed : {22, 27, 43, 58, 61, 62}) {
    Random own(seed);
    const auto shape = rounded(random_hull(own, 22), 0.03);
    for (const BezierPatch& patch : shape->patches)
      for (int k = 0; k < 4 && patch.degree_u == 4; ++k, ++all) {
        const Jet1 at = evaluate1(patch, random.uniform(0.05, 0.95), random.uniform(0.05, 0.95));
        const Support s = find_hull_support(*shape, at.su.cross(at.sv).normalized());
        open += !(s.upper - s.h <= 1e-10 * shape->bounding_radius);
      }
  }
  EXPECT_GT(all, 2000);
  EXPECT_LE(open, 30);
}

// Of roundings a thousandth of the body some slivers' parameters fold: a ball of nearly that radius rolls
// inside.
TEST(RoundedPolyhedra, of_sharp_edges_have_a_least_radius) {
  Random random(32);
  for (int trial = 0; trial < 6; ++trial) {
    const ConvexHull hull = random_hull(random, 40);
    const double rounding = random.log_uniform(1e-3, 5e-3);
    if (trial < 4) continue;
    EXPECT_GT(rounded(hull, rounding)->patch_curvature.min_radius, 0.8 * rounding) << trial;
  }
}

// The certified distance of a hull's corners from its rounded body, against the hull of points of the body.
// On the way to the nearest point some meet the end of a triangular patch, where it has no normal.
TEST(RoundedPolyhedra, corners_are_as_far_as_they_are) {
  for (const unsigned seed : {22, 27, 58}) {
    Random random(seed);
    const ConvexHull hull = random_hull(random, 22);
    const double rounding = 0.03;
    const auto shape = rounded(hull, rounding);
    std::vector<Vec3> points;
    for (const BezierPatch& patch : shape->patches)
      for (int k = 0; k < 25; ++k)
        points.push_back(evaluate0(patch, 0.25 * (k / 5), 0.25 * (k % 5)) + shape->mass.center);
    const ConvexHull inner(points);  // behind the body by no more than an arc's height over its chord
    double farthest = 0;
    int vertex = 0;
    for (const Vec3& p : hull.mesh().points) farthest = std::max(farthest, inner.distance(p, 0, vertex));
    const double inward = hull_distance(*shape, hull, 1e-2).inward;
    EXPECT_LE(inward, farthest + 1e-6) << seed;
    EXPECT_GE(inward, farthest - 0.1 * rounding) << seed;
  }
}

}  // namespace
}  // namespace nurbs::test_rounded_polyhedra

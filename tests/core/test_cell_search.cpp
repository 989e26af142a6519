// Cells to second order: what they close is the least overlap, by a search that knows nothing but p(d).
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "contact/overlap/cell_search.h"
#include "support/least_overlap.h"
#include "support/random.h"
#include "support/solids.h"

namespace nurbs::test_cell_search {
namespace {

using test::Random;
using test::Solid;

TEST(CellSearch, finds_the_least_overlap_from_any_direction) {
  Random random(11);
  const std::vector<Solid> solids = {
      test::capsule(random, 0.3, 0.7), test::conic_of_revolution(random, 0.5, 0.3, 0.01),
      test::lens(random, 1.5),         test::turned_reuleaux(random),
      test::cone(random, 0.8, 1, 1),   test::frustum(random, 0.5, 0.3, 1, 1)};
  int closed = 0, tried = 0;
  for (int k = 0; k < 60; ++k) {
    const Solid &a = solids[random.below(static_cast<int>(solids.size()))],
                &b = solids[random.below(static_cast<int>(solids.size()))];
    const Particle pa{a.shape.get(), 1, Vec3::Zero(), random.turn()},
        pb{b.shape.get(), random.log_uniform(0.3, 3), random.uniform(0, 0.6) * random.direction(),
           random.turn()};
    const PairFrame pair(pa, pb);
    const auto overlap = [&](const Vec3& d) -> double {  // in the pair frame
      return d.dot(a.support(d)) +
             pb.scale * (pair.turn.transpose() * d).dot(-b.support(pair.turn.transpose() * -d)) -
             d.dot(pair.offset);
    };
    const double tolerance = 1e-9 * pair.size;
    const Vec3 d = random.direction();
    if (!(overlap(d) > 0)) continue;
    ++tried;
    PolytopeResult r;
    r.iterations = 0;
    r.bracket.direction = d;
    r.bracket.lower = -overlap(d);
    r.bracket.upper = 1e300;
    const bool done = search_cells(pair, tolerance, &r);
    const double least = test::least_overlap(overlap, test::spiral(3000), test::Compass(), random);
    if (!done) continue;
    ++closed;
    const double allowed = tolerance + 1e-13 * pair.reach;
    EXPECT_GE(least, -r.bracket.upper - allowed) << k;
    EXPECT_LE(r.bracket.width(), tolerance) << k;
    EXPECT_NEAR(overlap(r.bracket.direction), -r.bracket.lower, allowed) << k;
    EXPECT_NEAR(r.bracket.direction.dot(r.points.b - r.points.a), r.gap, allowed) << k;
  }
  EXPECT_GT(tried, 30);
  EXPECT_GT(4 * closed, tried);  // poses of any depth: a third to a half, the rest is given up
}

}  // namespace
}  // namespace nurbs::test_cell_search

// The normal map's promise, against searches of the whole surface.
#include <gtest/gtest.h>

#include "nurbs/tolerances.h"
#include "support/bodies.h"
#include "support/random.h"

namespace nurbs {
namespace {

using namespace test;

ShapePointer blocky() {  // flats dented and joints kinked by the fit
  static const ShapePointer s = make_shape("blocky", fitted_superellipsoid(Vec3(1, 0.9, 0.8), 4, 3));
  return s;
}

struct Seen {
  int promised = 0, all = 0;
  double closest = 0;  // largest share of the promised excess that was there
};

Seen check(const Shape& shape, int directions) {
  Random random(4);
  Seen seen;
  for (int k = 0; k < directions; ++k) {
    const Vec3 n = random.direction();
    const double r = shape.normal_map.radius_at(n);
    ++seen.all;
    if (!(r < kFarAway)) continue;
    ++seen.promised;
    const Support at = find_support(shape, n);
    EXPECT_NEAR(at.h, exhaustive_support(shape, n), 1e-13) << shape.name << " has two support points";
    const Vec3 d = (n + random.uniform(0, 0.99) * kNormalMargin * n.unitOrthogonal()).normalized();
    const double excess = exhaustive_support(shape, d) - d.dot(at.point);
    const double allowed = 0.5 * r * (d - n).squaredNorm();
    EXPECT_LE(excess, allowed + 1e-14) << shape.name;
    if (allowed > 1e-9) seen.closest = std::max(seen.closest, excess / allowed);
  }
  return seen;
}

TEST(NormalMap, bounds_supports_near_every_normal_it_promises_for) {
  const Seen disc_seen = check(*disc(), 600), blocky_seen = check(*blocky(), 120);
  EXPECT_EQ(disc_seen.promised, disc_seen.all);
  EXPECT_GT(blocky_seen.promised, 0.6 * blocky_seen.all);
  for (const Seen& seen : {disc_seen, blocky_seen})
    EXPECT_GT(seen.closest, 0.3) << "the promise is so loose that the test shows nothing";
}

TEST(NormalMap, promises_nothing_across_dents) {
  // Where two support points compete, on either side of a closing joint, nothing may be promised.
  const Shape& shape = *blocky();
  Random random(5);
  int rivals = 0;
  for (int k = 0; k < 700; ++k) {
    const Vec3 d = random.direction();
    const Maxima found = all_maxima(shape, d);
    if (!(found.rival > found.best - 1e-4)) continue;
    ++rivals;
    EXPECT_FALSE(shape.normal_map.radius_at(d) < kFarAway);
  }
  EXPECT_GT(rivals, 10);
}

TEST(NormalMap, is_not_made_where_one_radius_serves) {
  EXPECT_EQ(smooth_pebble()->normal_map.cells, 0);
  EXPECT_EQ(ellipsoid()->normal_map.cells, 0);
}

}  // namespace
}  // namespace nurbs

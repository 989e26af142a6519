// The plane hull under rings of directions, against a dense scan of angles.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "contact/overlap/half_plane_hull.h"
#include "nurbs/tolerances.h"
#include "support/random.h"

namespace nurbs::test_half_plane_hull {
namespace {

using test::Random;

constexpr double kNoise = 1e-15;

Angle at(double angle) {
  return {std::cos(angle), std::sin(angle)};
}
double reach(const HalfPlaneHull& hull, const Angle& e) {
  double most = -kFarAway;
  for (int k = 0; k < hull.size(); ++k) most = std::max(most, hull.r(k) * e.s + hull.z(k) * e.c);
  return most;
}
double angle_of(const Angle& e) {
  return std::atan2(e.s, e.c);
}

// The least is that of a scan, to what that can tell; its points are level there and reach furthest; outside
// the range given back the reach is at least the threshold.
void expect_right(HalfPlaneHull* hull, double low, double high, double threshold) {
  const HalfPlaneHull::Least least = hull->least(at(low), at(high), threshold, kNoise);
  ASSERT_GE(std::min(least.from, least.to), 0);
  ASSERT_LT(std::max(least.from, least.to), hull->size());
  double scanned = kFarAway;
  constexpr int kScan = 4000;
  for (int k = 0; k <= kScan; ++k) {
    const double angle = low + (high - low) * k / kScan, h = reach(*hull, at(angle));
    scanned = std::min(scanned, h);
    const bool outside = angle < angle_of(least.low) - 1e-12 || angle > angle_of(least.high) + 1e-12;
    if (outside) {
      EXPECT_GE(h, threshold - 1e-12);
    }
  }
  if (!(scanned > 1e-3)) {
    EXPECT_LE(least.value, scanned + 1e-12);
    return;
  }
  EXPECT_LE(least.value, scanned + 1e-12);
  EXPECT_GE(least.value, scanned - 3 * (high - low) / kScan);
  EXPECT_NEAR(reach(*hull, least.at), least.value, 1e-12);
  for (const int k : {least.from, least.to})
    EXPECT_NEAR(hull->r(k) * least.at.s + hull->z(k) * least.at.c, least.value, 1e-12);
}

TEST(HalfPlaneHull, finds_the_least_reach_of_random_points) {
  Random random(1);
  for (int k = 0; k < 400; ++k) {
    HalfPlaneHull hull;
    hull.clear();
    const int count = random.whole(1, random.below(4) ? 40 : HalfPlaneHull::kMost);
    for (int i = 0; i < count; ++i) {
      const double angle = random.uniform(0, M_PI), r = random.uniform(0.3, 1);
      hull.add(r * std::sin(angle), r * std::cos(angle));
    }
    const double low = random.below(2) ? 0 : random.uniform(0, 1), high = random.below(2) ? M_PI : 1.5;
    expect_right(&hull, low, high, random.uniform(0, 1));
  }
}

// Points that are one, or on one line, or the first of all, which fills the lanes: numbers stay in range.
TEST(HalfPlaneHull, takes_equal_points_and_lines) {
  Random random(2);
  for (int k = 0; k < 400; ++k) {
    HalfPlaneHull hull;
    hull.clear();
    const int count = random.whole(1, 30);
    double r = 0, z = 0;
    for (int i = 0; i < count; ++i) {
      if (random.below(3)) {
        const int steps = random.whole(-2, 2);
        r = 0.7 + 0.1 * steps;
        z = 0.4 - 0.2 * (random.below(2) ? steps : random.whole(-4, 4));
      }
      hull.add(r, z);
    }
    expect_right(&hull, 0, M_PI, 0.5);
  }
}

TEST(HalfPlaneHull, of_one_point_the_least_is_at_an_end) {
  HalfPlaneHull hull;
  hull.clear();
  hull.add(1, 0.5);
  const HalfPlaneHull::Least least = hull.least(at(0.3), at(1), 0, kNoise);
  EXPECT_NEAR(least.value, std::min(reach(hull, at(0.3)), reach(hull, at(1))), 1e-15);
  EXPECT_EQ(least.from, 0);
  EXPECT_EQ(least.to, 0);
}

}  // namespace
}  // namespace nurbs::test_half_plane_hull

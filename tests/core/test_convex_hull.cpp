// Hulls of many points: supports from any start, and affine images, against all points.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "shapes/convex_hull.h"
#include "support/random.h"

namespace nurbs::test_convex_hull {
namespace {

using test::Random;

double brute(const std::vector<Vec3>& points, const Vec3& d) {
  double h = -1e300;
  for (const Vec3& p : points) h = std::max(h, d.dot(p));
  return h;
}

// Round clouds, needles, and points of which most crowd in one corner, few and many.
std::vector<Vec3> cloud(Random& random, int kind, int count) {
  std::vector<Vec3> points;
  for (int k = 0; k < count; ++k) {
    Vec3 p = random.direction();
    if (kind == 1) p = p.cwiseProduct(Vec3(1, 1e-3, 1e-2));
    if (kind == 2 && k > 20) p = 10 * Vec3::Ones() + 0.1 * p;
    points.push_back(p);
  }
  return points;
}

TEST(ConvexHull, supports_are_those_of_all_points_whatever_the_start) {
  Random random(3);
  for (int kind = 0; kind < 3; ++kind)
    for (int count : {50, 5000}) {
      const std::vector<Vec3> points = cloud(random, kind, count);
      const ConvexHull hull(points);
      const int vertices = static_cast<int>(hull.mesh().points.size());
      for (int k = 0; k < 500; ++k) {
        const Vec3 d = random.log_uniform(1e-3, 1e3) * random.direction();
        const int at = hull.support(d, random.below(vertices));
        EXPECT_NEAR(d.dot(hull.mesh().points[at]), brute(points, d), 1e-13 * d.norm())
            << kind << " " << count;
      }
      EXPECT_EQ(hull.support(Vec3::Zero(), vertices - 1), vertices - 1);
    }
}

TEST(ConvexHull, its_image_is_the_hull_of_the_points_images) {
  Random random(4);
  for (int kind = 0; kind < 3; ++kind) {
    std::vector<Vec3> points = cloud(random, kind, 2000);
    Mat3 m;
    m << 3, 0.5, 0, 0.2, 0.1, 0.3, 0, -0.4, 2;
    ASSERT_GT(m.determinant(), 0);
    const Vec3 shift(1, -2, 3);
    const ConvexHull image = ConvexHull(points).image(m, shift);
    for (Vec3& p : points) p = m * p + shift;
    const ConvexHull direct(points);
    EXPECT_NEAR(image.properties().volume / direct.properties().volume, 1, 1e-12);  // wound outward, too
    for (int k = 0; k < 300; ++k) {
      const Vec3 d = random.direction(), x = shift + 4 * random.direction();
      int a = 0, b = 0;
      EXPECT_NEAR(d.dot(image.mesh().points[image.support(d, 0)]), brute(points, d), 1e-12);
      EXPECT_NEAR(image.distance(x, 0, a), direct.distance(x, 0, b), 1e-7);
    }
  }
}

}  // namespace
}  // namespace nurbs::test_convex_hull

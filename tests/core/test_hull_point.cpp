// Supports for searches over directions: closed forms against those of the patches, and how they turn against
// differences.
#include <gtest/gtest.h>

#include <cmath>

#include "body/hull_point.h"
#include "body/support.h"
#include "nurbs/tolerances.h"
#include "shapes/primitives.h"
#include "shapes/revolved.h"
#include "support/bodies.h"
#include "support/flat_bodies.h"
#include "support/random.h"

namespace nurbs::test_hull_point {
namespace {

using test::Random;
using test::ShapePointer;

std::vector<ShapePointer> bodies() {
  std::vector<ShapePointer> all = test::all_shapes();
  all.push_back(make_shape("cylinder", test::cylinder(1, 0.8)));
  all.push_back(make_shape("capsule", capsule(0.5, 1.3)));
  all.push_back(make_shape("lens", lens(1, 1.5, 0.1)));
  all.push_back(make_shape("egg", egg(1, 0.8, 1.5)));
  all.push_back(make_shape("exact", exact_ellipsoid(Vec3(1, 0.3, 0.6))));
  return all;
}

TEST(HullPoints, are_the_hulls_supports) {
  Random random(41);
  int closed = 0;
  for (const ShapePointer& shape : bodies()) {
    const double size = shape->bounding_radius, enough = 1e-10 * size;
    const HullPoints points(*shape, enough, 1e-10 * size);
    EXPECT_LE(points.error(), 1e-10 * size) << shape->name;
    HullPoint last;
    Vec3 d = random.direction();
    for (int k = 0; k < 400; ++k) {
      const bool beside = k % 3 != 0;
      d = beside ? Vec3((d + random.log_uniform(1e-9, 1) * random.direction()).normalized())
                 : random.direction();
      const HullPoint here = points.along(d, beside ? &last.where : nullptr);
      const Support known = find_hull_support(*shape, d, nullptr, 0);
      const double noise = 1e-14 * size + points.error();
      EXPECT_GE(here.upper, known.h - noise) << shape->name;
      EXPECT_LE(here.upper, known.upper + enough + 2 * noise) << shape->name;
      EXPECT_GE(d.dot(here.point), here.upper - enough - 2 * noise) << shape->name;
      EXPECT_NEAR(here.normal.norm(), 1, 1e-12);
      // No further out than the body along any other direction, its own normal among them.
      for (const Vec3& other : {here.normal, random.direction()})
        EXPECT_LE(other.dot(here.point), find_hull_support(*shape, other, nullptr, 0).upper + noise)
            << shape->name;
      closed += here.where.on_surface.patch < 0;
      last = here;
      if (HasFailure()) FAIL() << shape->name << " " << k << " " << d.transpose();
    }
  }
  EXPECT_GT(closed, 1500) << "closed forms were hardly asked";
}

// Of a direction beside: a point of the body with its own normal, so that a ball that rolls inside, set back
// along it, stays inside; and an upper bound along the direction asked for.
TEST(HullPoints, beside_a_direction) {
  Random random(43);
  for (const ShapePointer& shape : bodies()) {
    const double size = shape->bounding_radius, noise = 1e-13 * size;
    const HullPoints points(*shape, 1e-10 * size, 1e-10 * size);
    const double ball = std::min(shape->curvature.min_radius, shape->inner_radius);
    for (int k = 0; k < 200; ++k) {
      const Vec3 d = random.direction();
      const HullPoint beside = points.near(d);
      EXPECT_GE(beside.upper, find_hull_support(*shape, d, nullptr, 0).h - points.error() - noise);
      EXPECT_TRUE(ball == 0 || (beside.normal - d).norm() < 0.5) << shape->name;
      const Vec3 center = beside.point - ball * beside.normal;
      for (int i = 0; i < 20; ++i) {
        const Vec3 other =
            i % 2 ? random.direction()
                  : (beside.normal + random.log_uniform(1e-6, 1) * random.direction()).normalized();
        ASSERT_LE(other.dot(center) + ball,
                  find_hull_support(*shape, other, nullptr, 0).upper + points.error() + noise)
            << shape->name;
      }
    }
  }
}

// d(point)/d(direction), square to the direction, against central differences where the body bends.
TEST(HullPoints, turn_as_their_differences_do) {
  Random random(42);
  int compared = 0;
  for (const ShapePointer& shape : bodies()) {
    if (shape->dented()) continue;
    const double size = shape->bounding_radius;
    const HullPoints points(*shape, 1e-14 * size, 1e-10 * size);
    for (int k = 0; k < 40; ++k) {
      const Vec3 d = random.direction(), t = d.unitOrthogonal(), s = d.cross(t);
      const HullPoint here = points.along(d);
      Mat2 turn;
      if (!points.turn(here.where, d, d, t, s, &turn)) continue;
      constexpr double kStep = 1e-5;
      Mat2 seen;
      double skew = 0;
      for (int i = 0; i < 2; ++i) {
        const Vec3 by = kStep * (i ? s : t);
        const Vec3 up = points.along((d + by).normalized(), &here.where).point,
                   down = points.along((d - by).normalized(), &here.where).point;
        const Vec3 rate = (up - down) / (2 * kStep);
        seen(0, i) = t.dot(rate);
        seen(1, i) = s.dot(rate);
        skew = std::max(skew, (up - 2 * here.point + down).norm() / kStep);
      }
      if (skew > 1e-3 * size) continue;  // at a crease, or where the curvature jumps
      EXPECT_LT((turn - seen).norm(), 2e-3 * (size + turn.norm())) << shape->name << " " << d.transpose();
      EXPECT_NEAR(turn(0, 1), turn(1, 0), 1e-9 * (size + turn.norm()));
      ++compared;
    }
  }
  EXPECT_GT(compared, 400);
}

}  // namespace
}  // namespace nurbs::test_hull_point

// Lower bounds of W about a support point, against the map of support points elsewhere.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "body/support_turn.h"
#include "contact/local_bend.h"
#include "shapes/random_pebble.h"
#include "shapes/revolved.h"
#include "support/bodies.h"
#include "support/random.h"

namespace nurbs::test_local_bend {
namespace {

using test::Random;
using test::ShapePointer;

TEST(LocalBend, bounds_the_map_of_support_points_as_far_as_it_reaches) {
  Random random(91);
  std::vector<ShapePointer> shapes = test::smooth_shapes();
  shapes.push_back(make_shape("long", exact_ellipsoid(Vec3(1, 0.3, 0.2))));
  shapes.push_back(make_shape("tablet", tablet(1, 0.6, 0.2)));
  shapes.push_back(make_shape("egg", egg(0.7, 0.5, 1.2)));
  int known = 0;
  for (const ShapePointer& shape : shapes) {
    double closest = kFarAway;
    for (int k = 0; k < 1500; ++k) {
      const double scale = random.log_uniform(0.1, 10), size = scale * shape->bounding_radius;
      const Vec3 d = random.direction();
      const Support at = find_hull_support(*shape, d);
      JetLanes jet;
      evaluate2(shape->patches[at.where.patch], at.where.u, at.where.v, &jet);
      nurbs::scale(scale, &jet);
      // Right- and left-handed: the same plane serves a body and its mate, whose outward side is the other.
      const Vec3 t = d.cross(random.direction()).normalized(), s = random.sign() * d.cross(t);
      const LocalBend bend = local_bend(*shape, scale, at.where, jet, d, t, s);
      if (!(bend.reach > 1e-4)) continue;
      ++known;
      const double angle = random.log_uniform(1e-4, 1) * bend.reach;
      const Vec3 towards = d.cross(random.direction()).normalized();
      const Quat turn(Eigen::AngleAxisd(angle, towards));
      const Vec3 there = turn * d;
      const Support other = find_hull_support(*shape, there, &at.where);
      Mat2 w;
      if (!support_turn(*shape, other.where, there, there, turn * t, turn * s, scale, &w)) continue;
      const Mat2 over = w - bend.turn + bend.rate * angle * Mat2::Identity();
      ASSERT_GE(extremes(over).least, -1e-7 * (size + w.trace())) << shape->name << " " << k << " " << angle;
      closest = std::min(closest, extremes(over).most / w.trace());
    }
    EXPECT_LT(closest, 0.01) << shape->name << ": so loose that the test shows nothing";
  }
  EXPECT_GT(known, 5000);
}

TEST(LocalBend, a_quadratic_stays_above_zero_only_if_it_does) {
  Random random(92);
  int stays = 0, falls_below = 0;
  for (int k = 0; k < 20000; ++k) {
    const double room = random.log_uniform(1e-3, 1), falls = random.log_uniform(1e-3, 3),
                 bend = random.uniform(-2, 2), to = random.uniform(0, 1);
    double least = room;
    for (int i = 0; i <= 200; ++i) {
      const double x = to * i / 200;
      least = std::min(least, room - falls * x + bend * x * x);
    }
    if (stays_above(room, falls, bend, to)) {
      ++stays;
      ASSERT_GE(least, -1e-12) << k;
    } else {
      ++falls_below;
    }
  }
  EXPECT_GT(stays, 1000);
  EXPECT_GT(falls_below, 1000);
}

}  // namespace
}  // namespace nurbs::test_local_bend

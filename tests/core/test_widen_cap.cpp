// Caps about minima of p(d), against supports along thousands of directions in them.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "contact/local_bend.h"
#include "contact/overlap/widen_cap.h"
#include "shapes/rounded_polyhedron.h"
#include "support/bodies.h"
#include "support/pairs.h"

namespace nurbs::test_widen_cap {
namespace {

using namespace test;

double overlap(const PairFrame& pair, const Vec3& d) {
  return pair.overlap_along(d, find_hull_support(*pair.a, d).upper,
                            find_hull_support(*pair.b, pair.direction_on_b(d)).upper);
}

// Downhill on p from a direction, by smaller and smaller steps: no minimum to round-off.
Vec3 descend(const PairFrame& pair, Vec3 d, Random& random) {
  double p = overlap(pair, d);
  for (double step = 0.3; step > 1e-5; step *= 0.8)
    for (int k = 0; k < 4; ++k) {
      const Vec3 other = (d + step * random.direction()).normalized();
      if (const double q = overlap(pair, other); q < p) {
        p = q;
        d = other;
      }
    }
  return d;
}

struct Asked {
  CappedMinimum minimum;
  CapBalls balls;
  double proven;
};

// About d with a level that the supports along d keep to a small angle.
Asked ask(const PairFrame& pair, const Vec3& d, double below, bool with_balls) {
  const Support a = find_hull_support(*pair.a, d), b = find_hull_support(*pair.b, pair.direction_on_b(d));
  const Vec3 t = d.unitOrthogonal(), u = d.cross(t), g = pair.place_a(a.point) - pair.place_b(b.point);
  const double y = d.dot(g), falls = (g - y * d).norm(), level = y - below;
  JetLanes jet_a, jet_b;
  evaluate2(pair.a->patches[a.where.patch], a.where.u, a.where.v, &jet_a);
  evaluate2(pair.b->patches[b.where.patch], b.where.u, b.where.v, &jet_b);
  scale(pair.scale_a, &jet_a);
  scale(pair.scale_b, &jet_b);
  const Mat3 back = pair.turn.transpose();
  const Mat2 turn = local_bend(*pair.a, pair.scale_a, a.where, jet_a, d, t, u).turn +
                    local_bend(*pair.b, pair.scale_b, b.where, jet_b, -(back * d), back * t, back * u).turn;
  Asked asked{{d, t, u, a.where, b.where, turn, level, 1e-9 * pair.size}, {}, 0};
  asked.proven = 2 * below / (falls + std::sqrt(falls * falls + 2 * y * below));
  const InnerMap &map_a = pair.a->inner_map(), &map_b = pair.b->inner_map();
  if (!with_balls || map_a.nodes.empty() || map_b.nodes.empty()) return asked;
  const InnerNode &na = map_a.nodes[pair.a->atlas.nearest(d)],
                  &nb = map_b.nodes[pair.b->atlas.nearest(pair.direction_on_b(d))];
  const double off = std::max(angle_between(d, na.normal), angle_between(pair.direction_on_b(d), nb.normal));
  asked.balls = {pair.scale_a * na.radius[2], pair.scale_b * nb.radius[2], kInnerCaps[2] - off - 1e-7};
  return asked;
}

// Directions within what is proven have an overlap of the level at least; just beyond they often have less.
TEST(WidenCap, holds_for_every_direction_within) {
  std::vector<ShapePointer> bodies = all_shapes();
  bodies.push_back(make_shape("blocky", fitted_superellipsoid(Vec3(1, 0.9, 0.8), 6, 3)));
  bodies.push_back(make_shape("slender", exact_ellipsoid(Vec3(1, 0.3, 0.2))));
  Random random(15);
  int grown = 0, most = 0, with_balls = 0;
  for (int k = 0; k < 400; ++k) {
    const auto any = [&] { return bodies[random.below(bodies.size())]; };
    const ShapePointer shape_a = any(), shape_b = any();
    const Particle a{shape_a.get(), 1, Vec3::Zero(), random.turn()},
        b{shape_b.get(), random.log_uniform(0.2, 1), 0.3 * random.direction(), random.turn()};
    const PairFrame pair(a, b);
    Vec3 d = random.direction();
    if (k % 4 > 0) d = descend(pair, d, random);  // the rest: a slope
    const double below = pair.size * random.log_uniform(1e-8, 1e-4);
    const Asked asked = ask(pair, d, below, k % 2 == 0);
    if (!(asked.minimum.level > 0)) continue;
    int spent = 0;
    const double angle = widen_cap(pair, asked.minimum, asked.balls, asked.proven, 0.4, 150, &spent);
    ASSERT_GE(angle, asked.proven);
    ASSERT_LE(spent, 150);
    grown += angle > 1.2 * asked.proven;
    most += angle > 0.2;
    with_balls += angle > 1.2 * asked.proven && asked.balls.radius_a + asked.balls.radius_b > 0;
    for (int i = 0; i < 300; ++i) {
      // As many at small angles as at large ones.
      const double turned =
          i % 2 ? angle : asked.proven * std::pow(angle / asked.proven, random.uniform(0, 1));
      const Vec3 aside = d.cross(random.direction()).normalized();
      const Vec3 within = std::cos(turned) * d + std::sin(turned) * aside;
      ASSERT_GE(overlap(pair, within), asked.minimum.level - 1e-13)
          << shape_a->name << ' ' << shape_b->name << " pair " << k << " at " << turned << " of " << angle;
    }
  }
  EXPECT_GT(grown, 100);
  EXPECT_GT(with_balls, 30);
  EXPECT_GT(most, 80);
}

// The least overlap lies beside the cap's middle.
TEST(WidenCap, stops_where_the_overlap_comes_down_to_the_level) {
  const ShapePointer body = ellipsoid();
  Random random(3);
  int stopped = 0;
  for (int k = 0; k < 200; ++k) {
    const Particle a{body.get(), 1, Vec3::Zero(), random.turn()},
        b{body.get(), 0.7, 0.5 * random.direction(), random.turn()};
    const PairFrame pair(a, b);
    const Vec3 d = descend(pair, random.direction(), random);
    const Vec3 beside = (d + random.uniform(0.05, 0.3) * d.unitOrthogonal()).normalized();
    const Asked asked = ask(pair, beside, 1e-6, false);  // the minimum is lower
    int spent = 0;
    const double angle = widen_cap(pair, asked.minimum, asked.balls, asked.proven, 0.4, 150, &spent);
    double free = 0.4;
    for (double t = 0.4; t > 0.5 * asked.proven; t *= 0.97)
      for (int i = 0; i < 32; ++i) {
        const Vec3 aside =
            std::cos(i * M_PI / 16) * asked.minimum.t + std::sin(i * M_PI / 16) * asked.minimum.u;
        if (overlap(pair, std::cos(t) * beside + std::sin(t) * aside) < asked.minimum.level) free = t;
      }
    EXPECT_LE(angle, free);
    stopped += free < 0.4;
  }
  EXPECT_GT(stopped, 150);
}

}  // namespace
}  // namespace nurbs::test_widen_cap

// Sphero-polyhedra: found where bodies are some, their supports as the surfaces' own, and contacts of two
// against closed forms.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "body/sphero_polyhedron.h"
#include "body/support.h"
#include "contact/overlap/polytope.h"
#include "contact/pair_search.h"
#include "io/pair_case.h"
#include "shapes/primitives.h"
#include "shapes/revolved.h"
#include "shapes/rounded_polyhedron.h"
#include "support/bodies.h"
#include "support/cases.h"
#include "support/flat_bodies.h"
#include "support/least_overlap.h"
#include "support/pairs.h"
#include "support/random.h"

namespace nurbs::test_sphero_polyhedron {
namespace {

using test::Random;
using test::rounded_solid;
using Body = std::shared_ptr<const Shape>;

void expect_supports(const Shape& shape, size_t points, double radius) {
  const SpheroPolyhedron& core = shape.core;
  ASSERT_EQ(core.points.size(), points) << shape.name;
  EXPECT_NEAR(core.radius, radius, 1e-12 * shape.bounding_radius);
  EXPECT_LT(core.error, 1e-12 * shape.bounding_radius);
  for (const Vec3& d : test::spiral(2000)) {
    const double h = d.dot(core.points[core.support(d)]) + core.radius;
    EXPECT_NEAR(find_hull_support(shape, d).h, h, 2e-13 * shape.bounding_radius) << shape.name;
  }
}

TEST(SpheroPolyhedron, of_bodies_that_are_some) {
  expect_supports(*make_shape("capsule", capsule(0.5, 2)), 2, 0.5);
  expect_supports(*make_shape("needle", capsule(0.001, 2)), 2, 0.001);
  expect_supports(*make_shape("rounded-box", rounded_box({1, 0.7, 0.4}, 0.1)), 8, 0.1);
  expect_supports(*make_shape("plate", rounded_box({1, 1, 0.01}, 0.002)), 8, 0.002);
  expect_supports(*make_shape("box", box({1, 0.7, 0.4})), 8, 0);
  expect_supports(*rounded_solid("tetrahedron", 0.1), 4, 0.1);
  expect_supports(*rounded_solid("dodecahedron", 0.05), 20, 0.05);
  expect_supports(*rounded_solid("icosahedron", 1e-4), 12, 1e-4);
}

TEST(SpheroPolyhedron, of_no_others) {
  EXPECT_FALSE(make_shape("ellipsoid", exact_ellipsoid({1, 0.8, 0.6}))->core.found());
  EXPECT_FALSE(make_shape("tablet", tablet(1, 1, 0.2))->core.found());
  EXPECT_FALSE(make_shape("lens", lens(1, 2, 0.1))->core.found());
  EXPECT_FALSE(make_shape("egg", egg(1, 0.9, 0.5))->core.found());
  EXPECT_FALSE(make_shape("pebble", pebble())->core.found());
  // A cap that is a spheroid's.
  std::vector<NurbsSurface> body = capsule(0.5, 2);
  for (NurbsSurface& s : body)
    for (Vec4& p : s.points)
      if (p[2] > 1.0001 * p[3]) p[2] = p[3] + (1 + 1e-7) * (p[2] - p[3]);
  EXPECT_FALSE(make_shape("almost", std::move(body))->core.found());
}

// Distance of two segments, by a search that knows nothing else: convex in both parameters.
double segments_apart(const Vec3& p, const Vec3& u, const Vec3& q, const Vec3& v) {
  const double a = u.dot(u), b = u.dot(v), c = v.dot(v);
  const Vec3 w = p - q;
  double best = 1e300, t = 0, s = 0;
  const auto consider = [&](double x, double y) {
    x = std::clamp(x, -1.0, 1.0);
    y = std::clamp((w + x * u).dot(v) / c, -1.0, 1.0);
    x = std::clamp((q + y * v - p).dot(u) / a, -1.0, 1.0);
    y = std::clamp((w + x * u).dot(v) / c, -1.0, 1.0);
    const double d = (w + x * u - y * v).norm();
    if (d < best) best = d, t = x, s = y;
  };
  const double det = a * c - b * b;
  if (det > 1e-12 * a * c) consider((b * w.dot(v) - c * w.dot(u)) / det, 0);
  for (const double x : {-1.0, 1.0}) consider(x, 0);
  for (int k = 0; k <= 20; ++k) consider(0.1 * k - 1, 0);
  return best;
}

// Capsules whose segments miss each other by anything down to round-off: the depth is the sum of the radii,
// less that distance.
TEST(SpheroPolyhedron, capsules_against_segments) {
  const Body body = make_shape("capsule", capsule(0.3, 2));
  const double radius = body->core.radius;
  Random random(5);
  for (int k = 0; k < 400; ++k) {
    const Particle a{body.get(), 1, Vec3::Zero(), random.turn()};
    Particle b{body.get(), random.log_uniform(0.5, 2), Vec3::Zero(), random.turn()};
    const auto end = [](const Particle& p) -> Vec3 { return p.q * (p.scale * p.shape->core.points[0]); };
    const Vec3 u = end(a), v = end(b), across = u.cross(v).normalized();
    const double apart = k % 8 ? random.log_uniform(1e-12, 0.5) : 0;
    b.x = apart * across + random.uniform(-0.8, 0.8) * u - random.uniform(-0.8, 0.8) * v;
    double memory[kPairMemorySize] = {0};
    const ContactResult r = find_contact(a, b, ContactSettings(), memory);
    EXPECT_EQ(r.status, Status::converged) << k << ", segments " << apart << " apart";
    EXPECT_NEAR(r.gap, segments_apart(a.x, u, b.x, v) - (1 + b.scale) * radius, 3e-9) << k;
  }
}

// One axis, or nearly: all round it is as good.
TEST(SpheroPolyhedron, capsules_on_one_axis) {
  const Body body = make_shape("capsule", capsule(0.3, 2)),
             ball = make_shape("ball", exact_ellipsoid({1, 1, 1}));
  const double radius = body->core.radius;
  Random random(6);
  for (int k = 0; k < 100; ++k) {
    const bool other = k % 3 == 0;
    const Particle a{body.get(), 1, Vec3::Zero(), random.turn()};
    const double tilt = k % 4 ? random.log_uniform(1e-16, 1e-3) : 0,
                 off = k % 5 ? random.log_uniform(1e-16, 0.1) : 0;
    const Particle b{other ? ball.get() : body.get(), random.log_uniform(0.2, 2),
                     a.q * Vec3(0, 0, random.uniform(-0.9, 0.9)) + off * random.direction(),
                     (random.turn_by(tilt) * a.q).normalized()};
    const Vec3 u = a.q * body->core.points[0],
               v = other ? Vec3(1e-30, 0, 0) : Vec3(b.q * (b.scale * body->core.points[0]));
    double memory[kPairMemorySize] = {0};
    const ContactResult r = find_contact(a, b, ContactSettings(), memory);
    EXPECT_EQ(r.status, Status::converged) << k << " tilt " << tilt << " off " << off;
    EXPECT_NEAR(r.gap, segments_apart(a.x, u, b.x, v) - radius - b.scale * (other ? 1 : radius), 3e-9) << k;
  }
}

// Left open, with brackets of 1e-8 to 1e-6, by hulls and rings that took enclosed least radii for the balls'.
TEST(SpheroPolyhedron, saved_pairs) {
  for (const char* name : {"capsule-in-conic", "capsule-on-conic-axis", "capsule-at-reuleaux-saddle",
                           "twin-rounded-boxes", "conic-twins-at-saddle"}) {
    const PairCase c = read_pair_case(test::case_file(name));
    double memory[kPairMemorySize] = {0};
    const ContactResult r = find_contact(c.a, c.b, c.settings, memory);
    EXPECT_EQ(r.status, Status::converged) << name;
    const auto overlap = [&](const Vec3& d) {
      return c.a.scale * find_hull_support(*c.a.shape, c.a.q.conjugate() * d).h +
             c.b.scale * find_hull_support(*c.b.shape, c.b.q.conjugate() * -d).h - d.dot(c.b.x - c.a.x);
    };
    Random random(3);
    const double size =
                     std::min(c.a.scale * c.a.shape->bounding_radius, c.b.scale * c.b.shape->bounding_radius),
                 least = test::least_overlap(overlap, test::spiral(4000), test::Compass(), random);
    EXPECT_GT(least, -r.gap - 1.1e-9 * size) << name;
    EXPECT_NEAR(overlap(r.normal), -r.gap, 1.1e-9 * size) << name;
  }
}

// Hardly more than balls: searched as such, before their points were, they took 10 to 50 ms.
TEST(SpheroPolyhedron, that_are_nearly_balls_about_one_centre) {
  Random random(8);
  for (const char* name : {"tetrahedron", "cube", "octahedron"})
    for (const double share : {0.98, 0.999, 0.9999}) {
      const auto faces = platonic_solid(name, 1);
      const double inner = faces[0].offset;
      const Body body = make_shape(name, rounded_polyhedron(faces, Vec3::Zero(), share * inner));
      for (int k = 0; k < 10; ++k) {
        const Particle a{body.get(), 1, Vec3::Zero(), random.turn()},
            b{body.get(), random.below(2) ? 1 : random.uniform(0.5, 2),
              inner * random.log_uniform(1e-6, 0.1) * random.direction(), random.turn()};
        double memory[kPairMemorySize] = {0};
        const ContactResult r = find_contact(a, b, ContactSettings(), memory);
        EXPECT_EQ(r.status, Status::converged) << name << ' ' << share;
        SearchedBalls balls;
        const PairFrame pair(a, b);
        EXPECT_TRUE(solve_polytope(pair, pair.offset, 1e-9 * pair.size, 0, &balls).converged);
        EXPECT_FALSE(balls.has_value()) << name << ' ' << share;
        const auto overlap = [&](const Vec3& d) { return test::overlap_along(a, b, d); };
        EXPECT_GT(test::least_overlap(overlap, test::starts_beside(r.normal, 2, random), {}, random),
                  -r.gap - 2e-9);
        EXPECT_NEAR(overlap(r.normal), -r.gap, 2e-9);
      }
    }
}

// Balls of radii `low` about the origin and `high` about (0, 0, length), and the cone between, which ends in
// a tip there if that is 0.
Body tapered(double low, double high, double length) {
  const double tilt = std::asin((low - high) / length);
  const auto arc = [](double z, double r, double from, double to) {
    const double half = 0.5 * (to - from), middle = 0.5 * (from + to);
    const auto at = [&](double radius, double angle) {
      return Vec2(std::abs(angle) > 0.5 * M_PI - 1e-9 ? 0 : radius * std::cos(angle),
                  z + radius * std::sin(angle));
    };
    return ProfileArc{at(r, from), at(r / std::cos(half), middle), at(r, to), std::cos(half)};
  };
  const double pole = 0.5 * M_PI, turn = 0.5 * (tilt - pole);
  Profile profile = {arc(0, low, -pole, turn), arc(0, low, turn, tilt)};
  const ProfileArc end = arc(length, high, tilt, pole);
  profile.push_back({profile.back().to, Vec2::Zero(), high > 0 ? end.from : Vec2(0, length), 0});
  if (high > 0) profile.push_back(end);
  return make_shape("tapered capsule", revolve(profile));
}

TEST(BallHull, of_tapered_capsules) {
  const Body body = tapered(1, 0.5, 1.5);
  ASSERT_EQ(body->ball_hull.centres.size(), 2u);
  const bool first = body->ball_hull.radii[0] > 0.75;
  EXPECT_NEAR(body->ball_hull.radii[first ? 0 : 1], 1, 1e-12);
  EXPECT_NEAR(body->ball_hull.radii[first ? 1 : 0], 0.5, 1e-12);
  EXPECT_LT((body->ball_hull.centres[first ? 0 : 1] + body->mass.center).norm(), 1e-12);
  for (const Vec3& d : test::spiral(2000))
    EXPECT_NEAR(find_hull_support(*body, d).h, std::max(1.0, 0.5 + 1.5 * d[2]) - d.dot(body->mass.center),
                1e-12);
  for (const Body& other : {make_shape("egg", egg(1, 0.9, 0.5)), make_shape("tablet", tablet(1, 1, 0.2)),
                            make_shape("capsule", capsule(0.5, 2)), make_shape("pebble", pebble()),
                            rounded_solid("tetrahedron", 0.1)})
    EXPECT_TRUE(other->ball_hull.centres.empty()) << other->name;
}

// A ball and a point: the cone's tip is a ball of no radius.
TEST(BallHull, of_a_ball_and_a_tip) {
  const Body body = tapered(1, 0, 2.5);
  ASSERT_EQ(body->ball_hull.centres.size(), 2u);
  const bool first = body->ball_hull.radii[0] > 0;
  EXPECT_NEAR(body->ball_hull.radii[first ? 0 : 1], 1, 1e-12);
  EXPECT_EQ(body->ball_hull.radii[first ? 1 : 0], 0);
  EXPECT_LT((body->ball_hull.centres[first ? 1 : 0] + body->mass.center - Vec3(0, 0, 2.5)).norm(), 1e-12);
  for (const Vec3& d : test::spiral(2000))
    EXPECT_NEAR(find_hull_support(*body, d).h, std::max(1.0, 2.5 * d[2]) - d.dot(body->mass.center), 1e-12);
  // A tip over a sharp rim is no such body.
  const Profile cone = {{Vec2(0, 0), Vec2::Zero(), Vec2(1, 0), 0}, {Vec2(1, 0), Vec2::Zero(), Vec2(0, 2), 0}};
  EXPECT_TRUE(make_shape("cone", revolve(cone))->ball_hull.centres.empty());
}

// Against supports that know nothing of balls: the overlap along the normal is the one found, and no
// direction of thousands, nor the best of them refined, has less.
ContactResult expect_least_overlap(const Particle& a, const Particle& b, Random& random) {
  static const std::vector<Vec3> spiral = test::spiral(1500);
  double memory[kPairMemorySize] = {0};
  ContactResult r = find_contact(a, b, ContactSettings(), memory);
  EXPECT_EQ(r.status, Status::converged);
  const auto overlap = [&](const Vec3& d) { return test::overlap_along(a, b, d); };
  const double size = std::min(a.scale * a.shape->bounding_radius, b.scale * b.shape->bounding_radius);
  EXPECT_NEAR(overlap(r.normal), -r.gap, 1e-9 * size);
  EXPECT_GE(test::least_overlap(overlap, spiral, test::Compass(), random), -r.gap - 1e-9 * size);
  EXPECT_NEAR(r.normal.dot(r.point_b - r.point_a), r.gap, 1e-12 * size + 1e-12);
  const double h = a.scale * find_hull_support(*a.shape, a.q.conjugate() * r.normal).h;
  EXPECT_NEAR(r.normal.dot(r.point_a), h, 1e-9 * size);
  return r;
}

TEST(BallHull, contacts_of_two_are_least_overlaps) {
  Random random(8);
  const std::vector<Body> bodies = {tapered(1, 0.5, 1.5),
                                    tapered(0.8, 0.3, 1),
                                    tapered(1, 0.9, 0.3),
                                    tapered(0.7, 0, 2),
                                    make_shape("capsule", capsule(0.5, 2)),
                                    make_shape("ball", exact_ellipsoid({0.7, 0.7, 0.7})),
                                    rounded_solid("tetrahedron", 0.1)};
  for (int k = 0; k < 240; ++k) {
    const Shape &sa = *bodies[random.below(4)], &sb = k % 8 == 1 ? sa : *bodies[random.below(7)];
    Particle a{&sa, 1, Vec3::Zero(), random.turn()},
        b{&sb, random.log_uniform(0.3, 3), Vec3::Zero(), random.turn()};
    if (k % 4 == 1) b.q = a.q;
    const double off[] = {k % 16 < 8 ? 0 : 1e-11, 1e-8, 1e-5, 1e-3, 0.03, 0.3, 1, 2.2};
    // About the big balls' centres, or the centres of mass.
    const Vec3 centre_a = k % 3 ? Vec3(a.q * -sa.mass.center) : Vec3(Vec3::Zero()),
               centre_b = k % 3 ? Vec3(b.scale * (b.q * -sb.mass.center)) : Vec3(Vec3::Zero());
    b.x = centre_a - centre_b + off[k % 8] * random.direction();
    SCOPED_TRACE(k);
    const ContactResult r = expect_least_overlap(a, b, random);
    const double size = std::min(sa.bounding_radius, b.scale * sb.bounding_radius);
    EXPECT_LT((r.point_b - r.point_a).cross(r.normal).norm(), 1e-5 * size) << k << " gap " << r.gap;
  }
}

// A ball cut flat below.
Body cut_ball(double depth) {
  const double rim = std::sqrt(1 - depth * depth), turn = std::asin(depth) + 0.5 * M_PI,
               c = std::cos(0.25 * turn);
  const auto at = [&](double angle, double r) { return Vec2(r * std::cos(angle), r * std::sin(angle)); };
  const double low = -std::asin(depth), middle = low + 0.5 * turn;
  return make_shape("cut ball",
                    revolve({{Vec2(0, -depth), Vec2::Zero(), Vec2(rim, -depth), 0},
                             {Vec2(rim, -depth), at(0.5 * (low + middle), 1 / c), at(middle, 1), c},
                             {at(middle, 1), at(0.5 * (middle + 0.5 * M_PI), 1 / c), Vec2(0, 1), c}}));
}

// Of bodies whose surface is a ball's in part; along the cylinder they may be moved.
TEST(InnerBalls, are_found_and_lie_inside) {
  const struct {
    Body body;
    std::vector<double> heights;  // of the centres, of balls of radius 1
  } cases[] = {{make_shape("bullet", test::bullet(2)), {0, -1}},
               {make_shape("stub", test::bullet(0.5)), {}},  // the ball reaches through the base
               {make_shape("egg", egg(1, 1, 1.4)), {0}},
               {make_shape("egg, pointed below", egg(1, 1.4, 1)), {0}},
               {make_shape("flat egg", egg(1, 1, 0.9)), {}},
               {cut_ball(0.8), {}},
               {make_shape("ellipsoid", exact_ellipsoid({1, 0.8, 0.6})), {}},
               {make_shape("pebble", pebble()), {}}};
  for (const auto& [body, heights] : cases) {
    const BallHull& balls = body->inner_balls;
    ASSERT_EQ(balls.centres.size(), heights.size()) << body->name;
    for (size_t k = 0; k < heights.size(); ++k) {
      EXPECT_NEAR(balls.radii[k], 1, 1e-12) << body->name;
      EXPECT_LT((balls.centres[k] + body->mass.center - Vec3(0, 0, heights[k])).norm(), 1e-6) << body->name;
      for (const Vec3& d : test::spiral(2000))
        EXPECT_GE(find_hull_support(*body, d).h, d.dot(balls.centres[k]) + balls.radii[k] - balls.error);
    }
  }
  // Hulls of balls are known as such.
  EXPECT_FALSE(tapered(1, 0.5, 1.5)->inner_balls.found());
  EXPECT_FALSE(make_shape("capsule", capsule(0.5, 2))->inner_balls.found());
}

// Small balls at the corners of a profile, which the surface leaves alone outside of the body as well.
TEST(InnerBalls, lie_inside_however_small) {
  Random random(10);
  int found = 0;
  for (int k = 0; k < 12; ++k) {
    const double half = random.uniform(0.3, 1.2), bulge = random.uniform(0.3, 1);
    const Body body = make_shape(
        "profile", revolve(rounded_profile({{0, -half}, {bulge, random.uniform(-0.5, 0.5) * half}, {0, half}},
                                           random.log_uniform(1e-3, 0.2))));
    const BallHull& balls = body->inner_balls;
    found += balls.found();
    for (size_t i = 0; i < balls.centres.size(); ++i)
      for (const Vec3& d : test::spiral(300))
        EXPECT_GE(find_hull_support(*body, d).h, d.dot(balls.centres[i]) + balls.radii[i] - balls.error) << k;
  }
  EXPECT_GT(found, 6);
}

// Parts of balls about one centre: p(d) is the same over regions of directions, which no hull of points
// closes.
TEST(InnerBalls, contacts_about_one_centre_are_least_overlaps) {
  Random random(9);
  const std::vector<Body> bodies = {make_shape("bullet", test::bullet(2)), make_shape("egg", egg(1, 1, 1.4)),
                                    tapered(1, 0, 2.5), make_shape("ball", exact_ellipsoid({1, 1, 1}))};
  const auto centre = [](const Shape& s) {
    return s.inner_balls.found() ? s.inner_balls.centres[0]
           : s.ball_hull.found() ? s.ball_hull.centres[s.ball_hull.radii[0] > 0 ? 0 : 1]
                                 : Vec3(Vec3::Zero());
  };
  for (int k = 0; k < 320; ++k) {
    const Shape &sa = *bodies[k % 4], &sb = *bodies[k / 4 % 4];
    Particle a{&sa, 1, Vec3::Zero(), random.turn()},
        b{&sb, random.log_uniform(0.3, 3), Vec3::Zero(), random.turn()};
    const bool eggs = k % 4 == 1 || k / 4 % 4 == 1;
    const double off[] = {0, 1e-14, 1e-12, 1e-11, 1e-10, 1e-8, 1e-5, 1e-3, 0.03, 0.3};
    const int which = k / 16 % (eggs ? 4 : 10);
    b.x = a.q * centre(sa) - b.scale * (b.q * centre(sb)) +
          off[which] * std::min(1.0, b.scale) * random.direction();
    SCOPED_TRACE(k);
    const ContactResult r = expect_least_overlap(a, b, random);
    const double size = std::min(sa.bounding_radius, b.scale * sb.bounding_radius);
    if (off[which] < 1e-9) {
      EXPECT_NEAR(-r.gap, 1 + b.scale, 2e-9 * size) << k;
    }
  }
}

}  // namespace
}  // namespace nurbs::test_sphero_polyhedron

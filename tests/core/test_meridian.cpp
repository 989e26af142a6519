// Meridians of bodies of revolution against the search over their patches, closed forms, and bodies that have
// none.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "body/near_revolution.h"
#include "body/support.h"
#include "contact/pair_search.h"
#include "shapes/primitives.h"
#include "shapes/revolved.h"
#include "support/bodies.h"
#include "support/flat_bodies.h"
#include "support/random.h"
#include "support/solids.h"

namespace nurbs::test_meridian {
namespace {

using test::Random;
using test::Solid;
using ShapePointer = std::shared_ptr<const Shape>;

std::vector<ShapePointer> bodies_of_revolution(Random& random) {
  std::vector<ShapePointer> all;
  for (const double weights : {1.0, 100.0})
    for (const Solid& solid :
         {test::cone(random, random.log_uniform(0.1, 10), 1, weights),
          test::double_cone(random, 1, random.log_uniform(0.1, 1), random.log_uniform(0.1, 1), weights),
          test::cylinder(random, random.log_uniform(0.1, 10), 1, weights),
          test::frustum(random, 0.5, random.uniform(0.1, 0.4), 1, weights)})
      all.push_back(solid.shape);
  for (const Solid& solid :
       {test::capsule(random, 0.5, 0.3), test::lens(random, 1.5), test::spherical_segment(random, -0.5, 0.3),
        test::conic_of_revolution(random, 0.5, 0.3, 0.01), test::turned_reuleaux(random)})
    all.push_back(solid.shape);
  all.push_back(make_shape("tablet", tablet(1, 0.8, 0.2)));
  all.push_back(make_shape("biconvex", biconvex_tablet(1, 0.4, 1.5, 0.05)));
  all.push_back(make_shape("rounded lens", lens(1, 2, 0.1)));
  all.push_back(make_shape("egg", egg(1, 0.8, 1.5)));
  all.push_back(make_shape("rounded cylinder", test::rounded_cylinder(1, 0.8, 0.2)));
  all.push_back(make_shape("polar", revolved_ellipsoid(1, 0.2)));
  // From pole to pole: no arc at any patch's rim; and arcs in u of some patches, in v of others.
  const NurbsSurface whole =
      surface_of_revolution({Vec3(0, -1, 1), Vec3(0.9, -1, 1), Vec3(0.7, 1.5, 1), Vec3(0, 1.5, 1)});
  all.push_back(make_shape("one curve", {whole}));
  std::vector<NurbsSurface> mixed = biconvex_tablet(1, 0.4, 1.5, 0.05);
  for (size_t k = 0; k < mixed.size(); k += 2) mixed[k] = swap_uv(mixed[k]);
  all.push_back(make_shape("mixed", mixed));
  return all;
}

// Any, or near the axis, or nearly square to it.
Vec3 direction_for(const Shape& shape, Random& random) {
  const Vec3 axis = shape.revolution.axis, any = random.direction();
  const double off = random.log_uniform(1e-17, 1);
  switch (random.below(3)) {
    case 0:
      return any;
    case 1:
      return (random.sign() * axis + off * any).normalized();
    default:
      return (axis.cross(random.direction()).normalized() + off * any).normalized();
  }
}

TEST(Meridian, agrees_with_the_search_over_patches) {
  Random random(1);
  for (const ShapePointer& shape : bodies_of_revolution(random)) {
    ASSERT_FALSE(shape->meridian.empty()) << shape->name;
    Shape patches = *shape;
    patches.meridian = {};
    const double noise = 8 * kRoundoff * shape->bounding_radius;
    int unproven = 0;
    for (int k = 0; k < 1500; ++k) {
      const Vec3 d = direction_for(*shape, random);
      const SurfacePoint start{random.below(static_cast<int>(shape->patches.size())), random.uniform(0, 1),
                               random.uniform(0, 1)};
      const SurfacePoint* from = k % 2 ? &start : nullptr;
      MeridianSupport found;
      if (!find_meridian_support(shape->meridian, d, shape->bounding_radius, from, &found)) {
        ++unproven;
        continue;
      }
      const double h = d.dot(evaluate0(shape->patches[found.where.patch], found.where.u, found.where.v));
      const Support truth = find_hull_support(patches, d);
      ASSERT_TRUE(truth.converged);
      EXPECT_GE(found.upper, truth.h) << shape->name << " " << k;
      EXPECT_LE(found.upper, truth.upper + noise) << shape->name << " " << k;
      EXPECT_GE(h, truth.h - noise) << shape->name << " " << k;
      EXPECT_LE(h, truth.upper + noise) << shape->name << " " << k;
    }
    EXPECT_LE(unproven, 15) << shape->name;
  }
}

// Along a line of the profile every point is as high: the start's is kept, so that contacts do not wander.
TEST(Meridian, stays_where_it_starts_on_a_line) {
  const ShapePointer shape = make_shape("rounded cylinder", test::rounded_cylinder(1, 0.8, 0.2));
  Random random(2);
  int kept = 0;
  for (int patch = 0; patch < static_cast<int>(shape->patches.size()); ++patch) {
    for (int k = 0; k < 20; ++k) {
      const SurfacePoint start{patch, random.uniform(0, 1), random.uniform(0, 1)};
      const Jet1 jet = evaluate1(shape->patches[patch], start.u, start.v);
      if (std::abs(jet.s.z()) > 0.55) continue;  // not on the band
      const Vec3 d = Vec3(jet.s.x(), jet.s.y(), 0).normalized();
      const Support s = find_hull_support(*shape, d, &start);
      EXPECT_NEAR(s.point.z(), jet.s.z(), 1e-12);
      ++kept;
    }
  }
  EXPECT_GT(kept, 50);
}

TEST(Meridian, is_of_bodies_of_revolution_only) {
  Random random(3);
  EXPECT_TRUE(test::polyhedron(random, 20, 0.7).shape->meridian.empty());
  EXPECT_TRUE(test::ellipsoid_solid(Vec3(1, 0.8, 0.6)).shape->meridian.empty());
  EXPECT_TRUE(test::ellipsoid_solid(Vec3(1, 1, 0.6)).shape->meridian.empty());  // cube patches: no products
  EXPECT_TRUE(test::reuleaux_prism(random, 0.5).shape->meridian.empty());
}

// What a body is off its meridian counts; off by more it has none.
TEST(Meridian, is_kept_with_its_error_where_a_body_is_a_little_off_round) {
  Random random(3);
  const Solid round = test::cylinder(random, 1, 1);
  const auto oval = [&](double by) {
    std::vector<NurbsSurface> surfaces = round.shape->surfaces;
    for (NurbsSurface& s : surfaces)
      for (Vec4& p : s.points) p.x() *= 1 + by;
    return make_shape("oval", surfaces);
  };
  EXPECT_TRUE(round.shape->meridian.exact);
  EXPECT_TRUE(oval(1e-8)->meridian.empty());
  const std::shared_ptr<const Shape> near = oval(1e-12);
  ASSERT_FALSE(near->meridian.empty());
  EXPECT_FALSE(near->meridian.exact);
  double most = 0;
  for (int k = 0; k < 2000; ++k) {
    const Vec3 d = random.direction();
    MeridianSupport found;
    ASSERT_TRUE(find_meridian_support(near->meridian, d, near->bounding_radius, nullptr, &found));
    const double h = search_all_patches(*near, d, near->atlas.place(d)).h;
    EXPECT_GE(found.upper, h);
    most = std::max(most, found.upper - h);
  }
  EXPECT_LT(most, 2 * near->meridian.error + 1e-14);
  EXPECT_GT(near->meridian.error, 2e-13);
}

// Certified wrong, by 45 tolerances beside a sphere of 1e-3 of the size: weights of 1 / sqrt(2) cut after a
// few digits make arcs that dip inside their circle, where points were taken that the body does not have.
TEST(Meridian, circles_that_dip_inside_count) {
  const std::shared_ptr<const Shape> ball = make_shape("ball", exact_ellipsoid(Vec3(1, 1, 1)));
  for (const double w : {0.70710678, 0.707106781, 0.7071067811, 0.70710678118, 0.70710678119, 0.7071068}) {
    NurbsSurface s = surface_of_revolution(1, {0, 0, 1. / 3, 2. / 3, 1, 1},
                                           {{0, -1, 1}, {1, -1, 1}, {1, 1, 1}, {0, 1, 1}});
    for (Vec4& p : s.points)
      if (p[3] < 0.9) p = w * (p / p[3]).eval();
    const std::shared_ptr<const Shape> cylinder = make_shape("cylinder", {s});
    const long double exact = w;
    const auto middle =
        static_cast<double>(std::sqrt(2.0L) * (1 + 2 * exact) / (2 + 2 * exact));  // of the arc
    if (!cylinder->meridian.empty()) {
      EXPECT_GE(cylinder->meridian.error, std::abs(1 - middle) * (1 - 1e-3)) << w;
    }
    const Vec3 out = Vec3(1, 1, 0).normalized();
    for (const double ratio : {0.7, 1e-2, 1e-3, 1e-6})
      for (const double depth : {0.5, 0.1, 1e-3, -1e-6, -0.01})
        for (const double tolerance : {1e-9, 1e-12}) {
          SCOPED_TRACE(testing::Message() << w << " ratio " << ratio << " depth " << depth);
          const double away = 1 + ratio - depth * ratio;
          const Particle a{cylinder.get(), 1, Vec3::Zero(), Quat::Identity()},
              b{ball.get(), ratio, away * out, Quat::Identity()};
          double memory[kPairMemorySize] = {0};
          ContactSettings settings;
          settings.tolerance = tolerance;
          const ContactResult r = find_contact(a, b, settings, memory);
          const double gap = away - ratio - middle;
          EXPECT_LE(r.lower, gap + 1e-15);
          EXPECT_GE(r.upper, gap - 1e-15);
        }
  }
}

// Bodies of revolution whose files have few digits: solid, decimals.
std::vector<ShapePointer> rippled_bodies(Random& random) {
  std::vector<ShapePointer> all;
  for (const int decimals : {9, 8, 7, 6})
    for (const std::vector<NurbsSurface>& surfaces :
         {test::cone(random, 1.5, 1).shape->surfaces, test::double_cone(random, 1, 0.4, 0.8).shape->surfaces,
          test::capsule(random, 0.5, 0.3).shape->surfaces, test::lens(random, 1.5).shape->surfaces,
          egg(1, 0.8, 1.5), test::turned_reuleaux(random).shape->surfaces})
      all.push_back(make_shape("rippled", test::with_decimals(surfaces, decimals)));
  return all;
}

// Along a line round the axis: from one place on it, its slopes and the ripple's bend bound it in its patch,
// the slopes and the seam beyond, and it is nowhere further off than twice the ripple.
TEST(NearRevolution, a_line_round_the_axis_stays_within_its_ripple) {
  Random random(5);
  int near = 0, beyond = 0;
  double tightest = 0;
  for (const ShapePointer& shape : rippled_bodies(random)) {
    EXPECT_FALSE(shape->revolution.found);
    if (!shape->near_revolution.found()) continue;
    ++near;
    const Meridian& m = shape->near_revolution.meridian;
    const Mat3 to_shape = m.axes.transpose();
    const double size = shape->bounding_radius, noise = 64 * kRoundoff * size;
    for (int k = 0; k < 400; ++k) {
      const double angle = std::acos(random.uniform(-1, 1)), phi = random.uniform(-3.1, 3.1),
                   turn = random.sign() * random.log_uniform(1e-3, 3);
      const auto at = [&](double azimuth, RoundPoint* point) {
        const Vec3 d(std::sin(angle) * std::cos(azimuth), std::sin(angle) * std::sin(azimuth),
                     std::cos(angle));
        return find_round_point(m, shape->patches, to_shape * d, size, {-1, 0, 0}, point);
      };
      RoundPoint p, q;
      if (!at(phi, &p) || !at(phi + turn, &q)) continue;
      // On a line of the profile the place may be any.
      if (q.profile.place.piece != p.profile.place.piece ||
          std::abs(q.profile.place.t - p.profile.place.t) > 1e-9)
        continue;
      const double off = std::hypot(q.r - p.r, q.z - p.z),
                   bent = std::hypot(q.r - p.r - turn * p.slope_r, q.z - p.z - turn * p.slope_z),
                   past = std::max({0.0, -turn - p.before, turn - p.after}),
                   slope = std::hypot(p.slope_r, p.slope_z);
      double allowed = 0.5 * p.ripple.bend * turn * turn;
      if (past > 0) allowed += (p.ripple.slope + slope) * past + m.seam;
      EXPECT_LE(off, 2 * p.ripple.most + noise);
      EXPECT_LE(bent, allowed + noise);
      EXPECT_LE(slope, p.ripple.slope + noise);
      beyond += past > 0;
      tightest = std::max(tightest, (bent - noise) / allowed);
    }
  }
  EXPECT_GT(near, 16);
  EXPECT_GT(beyond, 500);
  EXPECT_GT(tightest, 0.1) << "no bound, only a large number";
}

// About an axis, but with a patch that is no product of a profile and an arc: nothing is known of it.
TEST(NearRevolution, is_whole_or_none) {
  for (const ShapePointer& shape : test::all_shapes()) {
    const NearRevolution& near = shape->near_revolution;
    EXPECT_EQ(near.found(), near.revolution.found) << shape->name;
    EXPECT_FALSE(near.found() && shape->revolution.found) << shape->name;
  }
}

// The balls that such a body holds along its meridian, against the support over its patches.
TEST(NearRevolution, balls_along_the_meridian_are_bounds_of_the_support) {
  Random random(6);
  int balls = 0;
  for (const ShapePointer& shape : rippled_bodies(random)) {
    const NearRevolution& near = shape->near_revolution;
    if (!near.found()) continue;
    const double size = shape->bounding_radius;
    const Vec3 axis = near.revolution.axis, across = axis.unitOrthogonal(), beside = axis.cross(across);
    for (int k = 0; k < 200; ++k) {
      const double angle = std::acos(random.uniform(-1, 1)), phi = random.uniform(-3.1, 3.1),
                   reach = random.log_uniform(1e-4, 0.2);
      const Vec3 out = std::cos(phi) * across + std::sin(phi) * beside;
      const auto direction = [&](double a) { return Vec3(std::cos(a) * axis + std::sin(a) * out); };
      RoundPoint on;
      const double asked = std::clamp(angle + random.uniform(-reach, reach), 1e-9, M_PI - 1e-9);
      if (!find_round_point(near.meridian, shape->patches, direction(asked), size,
                            find_hull_support(*shape, direction(asked)).where, &on))
        continue;
      const ProfilePoint& profile = on.profile;
      const double normal = std::atan2(profile.turn_r, profile.turn_z);
      if (std::abs(normal - angle) > reach) continue;
      const ProfileBall ball = ball_within(near, direction(angle), reach, profile.place, profile.place, size);
      if (!(ball.radius > 0)) continue;
      ++balls;
      const Vec3 point = evaluate0(shape->patches[on.where.patch], on.where.u, on.where.v);
      for (int j = 0; j < 4; ++j) {
        const double a = angle + random.uniform(-reach, reach);
        if (a < 0 || a > M_PI) continue;
        const Vec3 d = direction(a);
        const double h = find_hull_support(*shape, d).upper;
        EXPECT_GE(h + 64 * kRoundoff * size,
                  d.dot(point - ball.radius * direction(normal)) + ball.radius - ball.off);
      }
    }
  }
  EXPECT_GT(balls, 300);
}

// From one direction to another over a meridian the support rises at least as a ball of the least radius
// between them has it: H(a + t) >= H(a) cos t + H'(a) sin t + R (1 - cos t), H' from the support point.
TEST(ProfileRadii, are_bounds_of_the_support) {
  Random random(7);
  for (const ShapePointer& shape : bodies_of_revolution(random)) {
    const double noise = 32 * kRoundoff * shape->bounding_radius;
    const Vec3 axis = shape->revolution.axis, across = axis.unitOrthogonal();
    const auto at = [&](double a) { return Vec3(std::cos(a) * axis + std::sin(a) * across); };
    const auto support = [&](double a, Vec3* point) {
      MeridianSupport found;
      if (!find_meridian_support(shape->meridian, at(a), shape->bounding_radius, nullptr, &found))
        return false;
      *point = evaluate0(shape->patches[found.where.patch], found.where.u, found.where.v);
      return true;
    };
    int known = 0;
    for (int k = 0; k < 20000; ++k) {
      const double a = random.uniform(0.06, M_PI - 0.06), t = random.sign() * random.log_uniform(1e-4, 0.05);
      const double radius = shape->profile_radii.within(std::cos(a), std::sin(a), std::abs(t));
      Vec3 x, y;
      if (!(radius > 0) || !support(a, &x) || !support(a + t, &y)) continue;
      ++known;
      const double h = at(a).dot(x), slope = at(a + 0.5 * M_PI).dot(x);
      const double least = h * std::cos(t) + slope * std::sin(t) + radius * 2 * std::pow(std::sin(t / 2), 2);
      ASSERT_GE(at(a + t).dot(y), least - noise) << shape->name << " " << a << " " << t << " " << radius;
    }
    if (shape->curvature.min_radius > 0) {
      EXPECT_GT(known, 15000) << shape->name;
    }
  }
}

// Semi-axes 1 and c: W = c^2 / H^3, H^2 = c^2 cos^2 + sin^2.
TEST(ProfileRadii, of_spheroids_are_tight) {
  for (const double c : {0.03, 0.2, 3.0}) {
    const ShapePointer shape = make_shape("spheroid", revolved_ellipsoid(1, c));
    ASSERT_FALSE(shape->profile_radii.least.empty());
    for (double a = 0; a < M_PI; a += 0.01) {
      const double h = std::hypot(c * std::cos(a), std::sin(a)), w = c * c / (h * h * h);
      const double radius = shape->profile_radii.within(std::cos(a), std::sin(a), 0);
      EXPECT_LE(radius, w * (1 + 1e-6)) << c << " " << a;
      EXPECT_GE(radius, (c < 0.1 ? 0.6 : 0.9) * w) << c << " " << a;
    }
  }
}

// Kinks have none: the fans of normals at a cone's tip and rim, a lens's edge.
TEST(ProfileRadii, are_zero_at_kinks) {
  Random random(8);
  const Solid cone = test::cone(random, 1, 1, 1);
  for (const float r : cone.shape->profile_radii.least) EXPECT_EQ(r, 0);
  const Solid sharp = test::lens(random, 1.5);
  ASSERT_FALSE(sharp.shape->profile_radii.least.empty());
  EXPECT_EQ(sharp.shape->profile_radii.within(0, 1, 0.01), 0);
  EXPECT_NEAR(sharp.shape->profile_radii.within(0.99, std::sqrt(1 - 0.99 * 0.99), 0.01), 1.5,
              1e-6);  // an arc, exactly
}

}  // namespace
}  // namespace nurbs::test_meridian

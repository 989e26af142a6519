// Bodies of revolution, tablets and bands from files of few digits: what rounding leaves of their axes,
// joints and fillets, against a search over directions that knows nothing but supports.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "contact/pair_search.h"
#include "nurbs/tolerances.h"
#include "shapes/primitives.h"
#include "shapes/random_pebble.h"
#include "shapes/revolved.h"
#include "support/least_overlap.h"
#include "support/pairs.h"
#include "support/solids.h"

namespace nurbs::test_few_digits {
namespace {

using test::Random;

// Whether an answer closes for bodies that overlap, about an axis the least; what a search finds, about the
// axis and elsewhere, is no less than it says.
bool closes_about(const Vec3& axis, const Particle& a, const Particle& b, Random& random) {
  double memory[kPairMemorySize] = {0};
  ContactSettings settings;
  settings.tolerance = 1e-9;
  const ContactResult r = find_contact(a, b, settings, memory);
  const auto overlap = [&](const Vec3& d) { return test::overlap_along(a, b, d); };
  std::vector<Vec3> starts = test::spiral(300);
  for (int k = 0; k < 64; ++k) starts.push_back(Eigen::AngleAxisd(M_PI / 32 * k, axis) * r.normal);
  const double least = test::least_overlap(overlap, starts, test::Compass(), random);
  EXPECT_LE(-r.upper - least, 1e-12);
  EXPECT_NEAR(overlap(r.normal), -r.gap, 2e-9);
  return r.status == Status::converged;
}

// A body of revolution by a file of few digits, and its axis.
struct Rippled {
  std::shared_ptr<const Shape> shape;
  Vec3 axis;
  Rippled(const std::vector<NurbsSurface>& surfaces, int decimals)
      : shape(make_shape("rippled", test::with_decimals(surfaces, decimals))) {
    EXPECT_TRUE(shape->near_revolution.found()) << decimals;
    shape->inner_map();
    axis = shape->near_revolution.revolution.axis;
  }
};

// Tip on tip the least overlap is nearly the same all round the axis; of few digits, which keep the bodies
// from being ones of revolution, it was left open by up to 4e-5, where 15 digits closed it.
TEST(FewDigits, tips_close) {
  Random random(21);
  struct Case {
    std::vector<NurbsSurface> surfaces;
    int decimals;  // that it closes with, and more
  };
  const Case cases[] = {{test::double_cone(random, 1, 0.8, 0.8).shape->surfaces, 8},
                        {test::lens(random, 1.2).shape->surfaces, 6},
                        {test::capsule(random, 0.4, 0.5).shape->surfaces, 8}};
  for (const int decimals : {9, 8, 7, 6})
    for (const Case& c : cases) {
      const Rippled body(c.surfaces, decimals);
      for (const double overlap : {1e-5, 1e-3, 0.1, 0.7}) {
        SCOPED_TRACE(std::to_string(decimals) + " decimals, " + std::to_string(overlap));
        const Particle a{body.shape.get(), 1, Vec3::Zero(), random.turn()};
        Particle b{body.shape.get(), 1, Vec3::Zero(), random.turn_by(random.log_uniform(1e-12, 1e-3)) * a.q};
        b.q.normalize();
        const Vec3 along = a.q * body.axis;
        b.x = (test::overlap_along(a, b, along) - overlap) * along;
        const bool closes = closes_about(along, a, b, random);
        EXPECT_TRUE(closes || decimals < c.decimals);
      }
    }
}

// Unlike ones, one in the other or nearly so, on one axis. Such pairs, one in thirty of random ones at 7
// decimals, were open by 1e-5 to 1e-3 before what few digits bend was bounded part by part.
TEST(FewDigits, unlike_bodies_close_on_one_axis) {
  Random random(22);
  int open = 0;
  const std::vector<NurbsSurface> solids[] = {
      test::cone(random, 1.5, 1).shape->surfaces, test::double_cone(random, 1, 0.4, 0.8).shape->surfaces,
      egg(1, 0.8, 1.5), test::capsule(random, 0.5, 0.3).shape->surfaces};
  for (const int decimals : {8, 7, 6, 5})
    for (int k = 0; k < 4; ++k) {
      const Rippled of_a(solids[k], decimals), of_b(solids[(k + 1) % 4], decimals);
      SCOPED_TRACE(std::to_string(decimals) + " decimals, " + std::to_string(k));
      const Particle a{of_a.shape.get(), 1, Vec3::Zero(), random.turn()};
      const Vec3 along = a.q * of_a.axis;
      Particle b{of_b.shape.get(), random.uniform(0.3, 0.8), random.uniform(-0.3, 0.3) * along,
                 Quat::FromTwoVectors(of_b.axis, random.sign() * along)};
      b.q = (random.turn_by(1e-7) * b.q).normalized();
      open += !closes_about(along, a, b, random);
    }
  EXPECT_LE(open, 1) << "of 16";
}

// Much larger than their mates: unresolved, 55 to 73 of 200 of 9 and 7 decimals.
TEST(FewDigits, bodies_close_with_much_smaller_ones) {
  Random random(23);
  const std::vector<NurbsSurface> solids[] = {test::cone(random, 1.5, 1).shape->surfaces,
                                              test::lens(random, 1.2).shape->surfaces, tablet(1, 0.6, 0.2),
                                              egg(1, 0.8, 1.5), exact_ellipsoid(Vec3(1, 0.7, 0.5))};
  for (const int decimals : {9, 8, 7, 6}) {
    std::vector<std::shared_ptr<const Shape>> bodies;
    for (const auto& surfaces : solids)
      bodies.push_back(make_shape("solid", test::with_decimals(surfaces, decimals)));
    for (int k = 0; k < 60; ++k) {
      SCOPED_TRACE(std::to_string(decimals) + " decimals, " + std::to_string(k));
      const double ratio = random.log_uniform(1e-6, 1e-3);
      const Particle a{bodies[k % 5].get(), 1, Vec3::Zero(), random.turn()};
      Particle b{bodies[random.below(5)].get(), ratio, Vec3::Zero(), random.turn()};
      const auto overlap = [&](const Vec3& d) { return test::overlap_along(a, b, d); };
      const Vec3 d = random.direction();
      b.x = (overlap(d) - ratio * random.log_uniform(1e-6, 0.3)) * d;
      double memory[kPairMemorySize] = {0};
      const ContactResult r = find_contact(a, b, {}, memory);
      EXPECT_EQ(r.status, Status::converged);
      const std::vector<Vec3> starts = test::starts_beside(r.normal, 2, random);
      EXPECT_LE(-r.upper, test::least_overlap(overlap, starts, {}, random) + 1e-15);
    }
  }
}

// A small body about the centre of a large one of revolution: whether it closes, against a search in the
// directions beside the answer and round the large one's axis there.
bool closes_inside(const Shape& large, const Vec3& axis, const Shape& small, double ratio, Random& random) {
  const Particle a{&large, ratio * small.bounding_radius / large.bounding_radius, Vec3::Zero(),
                   random.turn()};
  const Particle b{&small, 1, random.log_uniform(1e-12, 1) * small.bounding_radius * random.direction(),
                   random.turn()};
  double memory[kPairMemorySize] = {0};
  const ContactResult r = find_contact(a, b, {}, memory);
  const double roundoff = kLeastTolerance * ratio * small.bounding_radius,
               tolerance = std::max(1e-9 * small.bounding_radius, roundoff);
  const auto overlap = [&](const Vec3& d) { return test::overlap_along(a, b, d); };
  std::vector<Vec3> starts = test::starts_beside(r.normal, 2, random);
  for (int k = 0; k < 64; ++k) starts.push_back(Eigen::AngleAxisd(M_PI / 32 * k, a.q * axis) * r.normal);
  EXPECT_LE(-r.upper, test::least_overlap(overlap, starts, {}, random) + roundoff);
  EXPECT_NEAR(overlap(r.normal), -r.gap, tolerance + roundoff);
  return r.status == Status::converged;
}

// Brackets were held to less than what round-off leaves of rings: of 732 with sizes of more than 1e5 : 1, 353
// were left open.
TEST(FewDigits, small_bodies_close_about_the_centre_of_large_ones) {
  Random random(25);
  const auto pebble = make_shape("pebble", random_pebble(1, {})),
             plank = make_shape("box", box({1, 0.7, 0.5}));
  for (const auto& surfaces : {capsule(0.5, 1), tablet(1, 2, 0.1), egg(1, 1.2, 2), tablet(1, 0.3, 0.02)}) {
    const auto large = make_shape("large", surfaces);
    ASSERT_TRUE(large->revolution.found);
    for (int k = 0; k < 10; ++k) {
      const Shape& small = k % 2 ? *pebble : *plank;
      const double ratio = random.log_uniform(1e5, 1e6);
      SCOPED_TRACE(std::to_string(k) + ", ratio " + std::to_string(ratio));
      EXPECT_TRUE(closes_inside(*large, large->revolution.axis, small, ratio, random));
    }
  }
}

// With more digits than make ripples that count between bodies of one size: they were taken as of
// revolution, to less than a much smaller mate wants. Of 275, 198 were left open.
TEST(FewDigits, small_bodies_close_about_the_centre_of_rippled_ones) {
  Random random(26);
  const auto pebble = make_shape("pebble", random_pebble(1, {})),
             plank = make_shape("box", box({1, 0.7, 0.5}));
  int open = 0;
  for (const int decimals : {11, 12, 13}) {
    const Rippled large(egg(1, 1.2, 2), decimals);
    EXPECT_TRUE(large.shape->revolution.found);
    for (int k = 0; k < 12; ++k) {
      const Shape& small = k % 2 ? *pebble : *plank;
      SCOPED_TRACE(std::to_string(decimals) + " decimals, " + std::to_string(k));
      open += !closes_inside(*large.shape, large.axis, small, random.log_uniform(1e3, 1e5), random);
    }
  }
  EXPECT_LE(open, 4) << "of 36";
}

// Of bodies of revolution whose patches each lie a little off their place, also round the axis, and so leave
// gaps: their twins about one centre were left open one time in five.
TEST(FewDigits, bodies_with_gaping_joints_close_about_one_centre) {
  Random random(27);
  int open = 0;
  for (const double gap : {1e-10, 1e-9, 1e-8, 1e-7})
    for (const std::vector<NurbsSurface>& exact :
         {capsule(0.4, 0.6), egg(0.7, 0.5, 1), tablet(1, 0.6, 0.1)}) {
      std::vector<NurbsSurface> surfaces;
      for (const NurbsSurface& s : exact) {
        std::vector<NurbsSurface> moved = {s};
        transform(moved, Mat3::Identity(), gap * random.direction());
        surfaces.push_back(moved[0]);
      }
      const auto body = make_shape("gaping", surfaces);
      ASSERT_GT(body->joint_slack, 0);
      ASSERT_TRUE(body->near_revolution.found());
      for (int k = 0; k < 10; ++k)
        open += !closes_inside(*body, body->near_revolution.revolution.axis, *body, 1, random);
    }
  EXPECT_LE(open, 4) << "of 120";
}

// Edges across a band narrower than the join tolerance counted as points: 16 times its width of slack, and
// some hundred times the time of any contact.
TEST(FewDigits, bands_narrower_than_digits_are_joined) {
  Random random(24);
  for (const double half : {1e-4, 1e-6, 1e-7, 1e-8, 2e-9}) {
    const auto body = test::capsule(random, 1, half).shape;
    EXPECT_EQ(body->joint_slack, 0) << half;
    EXPECT_FALSE(body->meridian.empty()) << half;
  }
}

// Refused as dented by a sixth of their size: a fillet a few thousand digits wide ends at an angle to the
// face that is large and makes a groove no deeper than the digits.
TEST(FewDigits, small_fillets_are_accepted) {
  for (const int decimals : {6, 7, 8})
    for (const double fillet : {1e-2, 1e-3, 1e-4}) {
      const auto body = make_shape("tablet", test::with_decimals(tablet(1, 0.8, fillet), decimals));
      EXPECT_LT(body->concavity, 20 * std::pow(10.0, -decimals)) << fillet;
    }
}

}  // namespace
}  // namespace nurbs::test_few_digits

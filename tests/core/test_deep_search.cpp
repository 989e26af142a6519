// Proofs for deep overlaps: the inner map against dense evaluation, the search over directions against
// supports along thousands of them and against the polytope.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <thread>
#include <vector>

#include "body/local_form.h"
#include "contact/overlap/deep_search.h"
#include "contact/overlap/polytope.h"
#include "contact/pair_search.h"
#include "nurbs/affine.h"
#include "shapes/random_pebble.h"
#include "shapes/revolved.h"
#include "support/bodies.h"
#include "support/pairs.h"

namespace nurbs::test_deep_search {
namespace {

using namespace test;

ShapePointer slender() {
  static const ShapePointer s = make_shape("slender", exact_ellipsoid(Vec3(1, 0.3, 0.2)));
  return s;
}
// Eccentricity 20, curvature that changes a thousandfold.
ShapePointer needle() {
  static const ShapePointer s = make_shape("needle", exact_ellipsoid(Vec3(1, 0.1, 0.05)));
  return s;
}

// Joints that close by up to 40 mrad, 10 mrad, ..., between faces that are nearly flat.
const std::vector<ShapePointer>& dented() {
  static const std::vector<ShapePointer> made = [] {
    std::vector<ShapePointer> all = {
        make_shape("blocky", fitted_superellipsoid(Vec3(1, 0.9, 0.8), 6, 3)),
        make_shape("less blocky", fitted_superellipsoid(Vec3(1, 0.7, 0.8), 4, 3)),
        make_shape("coarse", fitted_superellipsoid(Vec3(1, 1, 0.5), 4, 2))};
    for (const ShapePointer& s : all) EXPECT_TRUE(s->dented() && s->joints.concave > 0) << s->name;
    return all;
  }();
  return made;
}

std::vector<ShapePointer> bodies() {
  std::vector<ShapePointer> all = all_shapes();
  for (const ShapePointer& s : {slender(), needle()}) all.push_back(s);
  for (const ShapePointer& s : dented()) all.push_back(s);
  return all;
}

// A unit vector within `angle` of n, its square even.
Vec3 near(const Vec3& n, double angle, Random& random) {
  const Vec3 t = n.cross(random.direction()).normalized();
  const double turn = angle * std::sqrt(random.uniform(0, 1));
  return std::cos(turn) * n + std::sin(turn) * t;
}

TEST(InnerMap, balls_of_every_node_bound_the_supports_around_it) {
  Random random(71);
  for (const ShapePointer& shape : bodies()) {
    if (shape->inner_map().nodes.empty()) continue;
    double closest = 1e300;
    for (int k = 0; k < 4000; ++k) {
      const InnerNode& node = shape->inner_map().nodes[random.below(shape->atlas.nodes())];
      const int cap = random.below(kInnerCaps.size());
      const Vec3 d = near(node.normal, kInnerCaps[cap], random);
      const double ball = d.dot(node.point) + node.radius[cap] * 0.5 * (d - node.normal).squaredNorm();
      const double over = find_hull_support(*shape, d).h - ball;
      ASSERT_GE(over, -1e-13) << shape->name << " cap " << cap;
      if (node.radius[cap] > 0) closest = std::min(closest, over);
    }
    if (!shape->smooth) continue;
    EXPECT_LT(closest, 1e-3) << shape->name << ": so loose that the test shows nothing";
  }
}

TEST(InnerMap, stretches_of_every_node_bound_the_curvature_around_it) {
  Random random(72);
  for (const ShapePointer& shape : bodies()) {
    if (shape->inner_map().nodes.empty()) continue;
    double closest = 1e300;
    long pairs = 0, wide = 0;
    std::vector<Vec3> middles;
    for (std::size_t i = 0; i < shape->inner_map().stretches.size(); ++i)
      middles.push_back(InnerMap::middle(static_cast<int>(i)));
    for (int k = 0; k < 600; ++k) {
      const int patch = random.below(static_cast<int>(shape->patches.size()));
      const LocalForm form = local_form(shape->patches[patch], random.uniform(0, 1), random.uniform(0, 1));
      if (!(form.k_min > 0)) continue;
      // W of a unit tangent v that is J q: |J^-T ...|, by W = J II^-1 J'.
      const Vec3 v = form.normal.cross(random.direction()).normalized();
      const Vec2 along(v.dot(form.su), v.dot(form.sv));
      const double w = along.dot(form.second.inverse() * along);
      for (std::size_t i = 0; i < shape->inner_map().stretches.size(); ++i) {
        if (middles[i].dot(form.normal) < std::cos(kStretchCaps.back())) continue;
        const double angle = angle_between(middles[i], form.normal);
        const InnerStretch& s = shape->inner_map().stretches[i];
        const double f = s.along[0] * v[0] + s.along[1] * v[1] + s.along[2] * v[2];
        for (std::size_t cap = 0; cap < kStretchCaps.size(); ++cap) {
          if (angle > kStretchCaps[cap]) continue;
          const double bound = s.least[cap] + s.most[cap] * f * f;
          ASSERT_LE(bound, w * (1 + 1e-9)) << shape->name << " cap " << cap << " cell " << i;
          ++pairs;
          wide += s.most[cap] > s.least[cap];
          if (bound > 0) closest = std::min(closest, w / bound);
        }
      }
      for (int i = 0; i < shape->atlas.nodes(); ++i) {
        const InnerNode& node = shape->inner_map().nodes[i];
        if (node.normal.dot(form.normal) < std::cos(kInnerCaps.back())) continue;
        const double angle = angle_between(node.normal, form.normal);
        for (std::size_t cap = 0; cap < kInnerCaps.size(); ++cap) {
          if (angle > kInnerCaps[cap]) continue;
          ASSERT_LE(node.radius[cap], w * (1 + 1e-9)) << shape->name;
        }
      }
    }
    if (!shape->smooth) continue;
    EXPECT_LT(closest, 1.6) << shape->name << ": so loose that the test shows nothing";
    if (shape != slender()) continue;
    EXPECT_GT(wide, pairs / 4);
  }
}

TEST(InnerMap, promises_nothing_where_normals_jump) {
  EXPECT_TRUE(cuboid()->inner_map().nodes.empty());
}

TEST(InnerMap, is_made_of_dented_bodies) {
  for (const ShapePointer& shape : dented()) EXPECT_FALSE(shape->inner_map().nodes.empty()) << shape->name;
}

TEST(InnerMap, is_made_once_for_a_shape_and_its_copies) {
  const ShapePointer shape = make_shape("once", exact_ellipsoid(Vec3(1, 0.9, 0.7)));
  const Shape copy = *shape;
  std::array<const InnerMap*, 4> seen{};
  std::vector<std::thread> threads;
  for (std::size_t k = 0; k < seen.size(); ++k)
    threads.emplace_back([&, k] { seen[k] = k % 2 ? &copy.inner_map() : &shape->inner_map(); });
  for (std::thread& t : threads) t.join();
  for (const InnerMap* map : seen) EXPECT_EQ(map, seen[0]);
  EXPECT_FALSE(seen[0]->nodes.empty());
}

// Overlaps of any depth, among them bodies on nearly one centre, where opposite directions are as good.
Pair deep_pair(const Shape& a, const Shape& b, Random& random) {
  Pair pair{{&a, 1, Vec3::Zero(), random.turn()},
            {&b, random.log_uniform(0.2, 2), Vec3::Zero(), random.turn()}};
  const double size = std::min(a.bounding_radius, pair.b.scale * b.bounding_radius);
  const double offset = random.below(3) ? random.uniform(0, 1) : random.log_uniform(1e-10, 0.1);
  pair.b.x = offset * size * random.direction();
  return pair;
}

// Whose bodies have their inner maps.
PairFrame mapped(const Pair& p) {
  p.a.shape->inner_map();
  p.b.shape->inner_map();
  return PairFrame(p.a, p.b);
}

// Pairs that can do without never make a map, however many are deep; with one they find the same.
TEST(InnerMap, is_used_where_it_is_there_and_not_made_by_pairs_that_do_without) {
  const std::vector<NurbsSurface> grain = pebble();
  const ShapePointer shape = make_shape("without", grain), known = make_shape("with", grain);
  known->inner_map();
  Random random(76);
  ContactSettings settings;
  int by_maps = 0;
  for (int contacts = 0; contacts < 200; ++contacts) {
    Pair pair = deep_pair(*shape, *shape, random);
    std::array<double, kPairMemorySize> memory{}, other{};
    const ContactResult r = find_contact(pair.a, pair.b, settings, memory.data());
    pair.a.shape = pair.b.shape = known.get();
    const ContactResult with = find_contact(pair.a, pair.b, settings, other.data());
    ASSERT_EQ(r.status, Status::converged);
    ASSERT_EQ(with.status, Status::converged);
    const double tolerance = settings.tolerance * std::min(1.0, pair.b.scale) * shape->bounding_radius;
    ASSERT_NEAR(r.gap, with.gap, tolerance);
    by_maps += r.gap != with.gap || r.iterations != with.iterations;
  }
  EXPECT_FALSE(shape->lazy_inner_map.made());
  EXPECT_TRUE(shape->lazy_inner_map.known().nodes.empty());
  EXPECT_GT(by_maps, 50);
}

// That a proven minimum is one: its normal has it, and of so many directions anywhere and beside it none
// overlaps by less.
void expect_minimum(const Pair& p, const PairFrame& pair, const JointSolution& s, double tolerance,
                    int anywhere, int beside, Random& random) {
  const auto overlap = [&](const Vec3& d) { return overlap_along(p.a, p.b, pair.axes_a * d); };
  const double least = -s.bracket.upper, noise = 1e-14 * pair.reach;
  ASSERT_TRUE(s.converged);
  EXPECT_LE(s.bracket.width(), tolerance);
  EXPECT_NEAR(overlap(s.normal), -s.gap, tolerance + noise);
  for (int i = 0; i < anywhere; ++i) ASSERT_GE(overlap(random.direction()), least - noise);
  for (int i = 0; i < beside; ++i)
    ASSERT_GE(overlap(near(s.normal, random.log_uniform(1e-6, 0.3), random)), least - noise);
}

// Whether the search proves one from nothing; then it is.
bool prove(const Pair& p, const PairFrame& pair, int anywhere, int beside, Random& random, JointSolution* s) {
  const double tolerance = 1e-9 * pair.size;
  s->iterations = 0;
  if (!search_deep(pair, tolerance, s)) return false;
  expect_minimum(p, pair, *s, tolerance, anywhere, beside, random);
  return true;
}

TEST(DeepSearch, no_direction_overlaps_by_less_than_is_proven) {
  Random random(73);
  const ShapePointer shapes[] = {ellipsoid(), disc(), slender(), smooth_pebble(), polar(), needle()};
  int proven = 0, tried = 0;
  for (int k = 0; k < 600; ++k) {
    const Pair p = deep_pair(*shapes[random.below(6)], *shapes[random.below(6)], random);
    const PairFrame pair = mapped(p);
    SCOPED_TRACE(k);
    JointSolution s;
    ++tried;
    if (!prove(p, pair, 400, 100, random, &s)) continue;
    ++proven;
    if (HasFatalFailure()) return;
    if (k % 4) continue;
    const double noise = 1e-14 * pair.reach;
    const PolytopeResult hull = solve_polytope(pair, s.normal, 1e-9 * pair.size, kFarAway);
    EXPECT_LE(s.bracket.lower, hull.bracket.upper + noise) << k;
    EXPECT_GE(s.bracket.upper, hull.bracket.lower - noise) << k;
  }
  EXPECT_GT(proven, tried / 2);
}

// Of pebbles W changes much within the stretches' caps. At the minimum it is known, and so is its rate.
TEST(DeepSearch, proves_minima_of_pebbles) {
  Random random(79);
  const ShapePointer shapes[] = {make_shape("pebble", random_pebble(1, PebbleForm())),
                                 make_shape("other", random_pebble(3, PebbleForm()))};
  int proven = 0;
  for (int k = 0; k < 400; ++k) {
    const Shape& shape = *shapes[k % 2];
    Pair p;
    p.a.shape = p.b.shape = &shape;
    p.b.scale = random.log_uniform(0.5, 2);
    p.a.q = random.turn();
    p.b.q = random.turn();
    p.b.x = random.uniform(0, 0.4) * shape.inner_radius * random.direction();
    const PairFrame pair = mapped(p);
    SCOPED_TRACE(k);
    JointSolution s;
    proven += prove(p, pair, 100, 100, random, &s);
    if (HasFatalFailure()) return;
  }
  EXPECT_GT(proven, 340);
}

// Over dents the hull's supports jump, and minima lie on faces, where the overlap rises from them as from a
// corner's.
TEST(DeepSearch, proves_minima_of_dented_bodies) {
  Random random(82);
  std::vector<ShapePointer> shapes = dented();
  for (const ShapePointer& s : {smooth_pebble(), kinked(), ellipsoid()}) shapes.push_back(s);
  int proven = 0, tried = 0;
  for (int k = 0; k < 600; ++k) {
    Pair p;
    p.a.shape = shapes[random.below(3)].get();
    p.b.shape = shapes[random.below(6)].get();
    p.b.scale = random.log_uniform(0.3, 2);
    p.a.q = random.turn();
    p.b.q = random.turn();
    p.b.x = random.uniform(0, 0.8) * p.a.shape->inner_radius * random.direction();
    const PairFrame pair = mapped(p);
    SCOPED_TRACE(k);
    JointSolution s;
    ++tried;
    proven += prove(p, pair, 300, 300, random, &s);
    if (HasFatalFailure()) return;
  }
  EXPECT_GT(proven, tried / 5);
}

// Bodies with flats, poles, creases: what the polytope's caps about minima prove, too.
TEST(Polytope, no_direction_overlaps_by_less_than_is_proven) {
  Random random(76);
  const ShapePointer shapes[] = {disc(),
                                 polar(),
                                 smooth_pebble(),
                                 slender(),
                                 cuboid(),
                                 make_shape("tablet", tablet(1, 0.6, 0.2)),
                                 make_shape("egg", egg(0.7, 0.5, 1.2)),
                                 make_shape("biconvex", biconvex_tablet(1, 0.3, 1.6, 0.1))};
  int proven = 0;
  for (int k = 0; k < 400; ++k) {
    const Pair p = deep_pair(*shapes[random.below(8)], *shapes[random.below(8)], random);
    const PairFrame pair = mapped(p);
    const PolytopeResult hull = solve_polytope(pair, Vec3::Zero(), 1e-9 * pair.size, kFarAway);
    proven += hull.converged;
    const double least = -hull.bracket.upper, noise = 1e-13 * pair.reach;
    const Vec3 d = hull.bracket.direction;
    const auto overlap = [&](const Vec3& n) { return overlap_along(p.a, p.b, pair.axes_a * n); };
    for (int i = 0; i < 300; ++i) ASSERT_GE(overlap(random.direction()), least - noise) << k;
    for (int i = 0; i < 300; ++i)
      ASSERT_GE(overlap(near(d, random.log_uniform(1e-5, 0.5), random)), least - noise) << k;
  }
  EXPECT_GT(proven, 390);
}

TEST(DeepSearch, a_local_minimum_is_not_taken_for_the_least) {
  // Along the disc's rim the overlap has a local minimum; across it, a far lesser one.
  Random random(74);
  int found = 0;
  for (int k = 0; k < 40; ++k) {
    Pair p = deep_pair(*disc(), *ellipsoid(), random);
    p.b.scale = 0.3;
    p.b.x = p.a.q * Vec3(0.6, 0.1, 0.05);
    const PairFrame pair = mapped(p);
    const Vec3 rim = Vec3::UnitX(), on_b = pair.direction_on_b(rim);
    JointSolution s = solve_joint(pair, find_hull_support(*pair.a, rim).where,
                                  find_hull_support(*pair.b, on_b).where, 1e-9, kFarAway, 20);
    if (!s.stationary || s.normal[0] < 0.5) continue;
    const double before = -s.gap;
    if (!search_deep(pair, 1e-9 * pair.size, &s)) continue;
    ++found;
    EXPECT_LT(-s.gap, 0.9 * before);
    EXPECT_GT(std::abs(s.normal[2]), 0.8);
  }
  EXPECT_GT(found, 5);
}

// Twins of nearly round bodies whose joints open by 0.2 degrees, about one centre, quarter turns apart: p has
// several minima nearly as low as each other, in valleys next to creases, where no ball rolls.
TEST(DeepSearch, kinked_twins_about_one_centre) {
  Random random(83);
  int last = 0;
  for (const Vec3& axes : {Vec3(1, 0.99, 0.92), Vec3(1, 0.9, 0.85)}) {
    const ShapePointer shape = make_shape("kinked", fitted_ellipsoid(axes, 1));
    for (int k = 0; k < 3; ++k)
      for (const double off : {0.0, 1e-6}) {
        Pair p;
        p.a.shape = p.b.shape = shape.get();
        p.b.q = Quat(Eigen::AngleAxisd(M_PI / 2, Vec3::Unit(k)));
        p.b.x = off * random.direction();
        const PairFrame pair = mapped(p);
        JointSolution s;
        s.iterations = 0;
        last += !search_deep(pair, 1e-9 * pair.size, &s);
        double memory[kPairMemorySize] = {0};
        const ContactResult r = find_contact(p.a, p.b, ContactSettings(), memory);
        ASSERT_EQ(r.status, Status::converged) << axes.transpose() << " axis " << k << " off " << off;
        for (int i = 0; i < 3000; ++i)
          ASSERT_GE(overlap_along(p.a, p.b, random.direction()), -r.upper - 1e-13);
        for (int i = 0; i < 3000; ++i)
          ASSERT_GE(overlap_along(p.a, p.b, near(r.normal, random.log_uniform(1e-5, 0.5), random)),
                    -r.upper - 1e-13);
      }
  }
  EXPECT_GT(last, 5);
}

// At d two bodies bend far more one way than the other, both the same way, and p has a saddle with two lower
// minima beside it. Bends are summed in one frame: crossed by mistake they would make it a minimum.
TEST(DeepSearch, a_saddle_is_not_taken_for_a_minimum) {
  Random random(81);
  int proven = 0;
  for (int k = 0; k < 120; ++k) {
    const double b = k % 2 ? 0.8 : 0.5, c = 0.4;
    const Mat3 turn = random.turn().toRotationMatrix();
    std::vector<NurbsSurface> surfaces = exact_ellipsoid(Vec3(1, b, c));
    transform(surfaces, turn, Vec3(Vec3::Zero()));
    const ShapePointer shape = make_shape("ellipsoid", surfaces);
    Pair p;
    p.a.shape = p.b.shape = shape.get();
    const Vec3 d = turn.col(1);
    p.b.x = (2 - random.log_uniform(0.02, 0.5)) * (b - c * c / b) * d;
    const PairFrame pair = mapped(p);
    const double tolerance = 1e-9 * pair.size;
    JointSolution s = solve_joint(pair, find_hull_support(*shape, d).where,
                                  find_hull_support(*shape, -d).where, tolerance, kFarAway, 20);
    if (!search_deep(pair, tolerance, &s)) continue;
    ++proven;
    const double least = -s.bracket.upper, noise = 1e-14 * pair.reach;
    for (double angle = 0; angle < M_PI / 2; angle += 2e-3)
      ASSERT_GE(overlap_along(p.a, p.b, std::cos(angle) * d + std::sin(angle) * turn.col(2)), least - noise)
          << k << " " << angle;
  }
  EXPECT_GT(proven, 5);
}

// Follows a pair with and without memory; how many steps were answered by a proof of an earlier one.
int follow(Pair pair, double speed, int steps, Random& random) {
  const double size =
      std::min(pair.a.scale * pair.a.shape->bounding_radius, pair.b.scale * pair.b.shape->bounding_radius);
  const Vec3 way = speed * size * random.direction(), axis = random.direction(), other = random.direction();
  const double common = random.uniform(0, 0.1);  // rad a step, of both: uses up nothing
  double memory[kPairMemorySize] = {0};
  int warm = 0;
  for (int step = 0; step < steps; ++step) {
    const Quat turn(Eigen::AngleAxisd(common, other));
    pair.a.q = (turn * pair.a.q).normalized();
    pair.b.q = (turn * Quat(Eigen::AngleAxisd(speed, axis)) * pair.b.q).normalized();
    pair.b.x = turn * (pair.b.x + way);
    double none[kPairMemorySize] = {0};
    const ContactResult r = find_contact(pair.a, pair.b, ContactSettings(), memory),
                        cold = find_contact(pair.a, pair.b, ContactSettings(), none);
    EXPECT_EQ(r.status, Status::converged);
    EXPECT_NEAR(r.gap, cold.gap, 2e-9 * size) << "step " << step << " rung " << static_cast<int>(r.rung);
    EXPECT_LE(r.lower, cold.upper + 1e-14);
    EXPECT_GE(r.upper, cold.lower - 1e-14);
    warm += r.rung == Rung::warm;
  }
  return warm;
}

// How many of the steps of random deep pairs were.
double follow_some(const std::vector<ShapePointer>& shapes, double speed, std::uint64_t seed) {
  Random random(seed);
  constexpr int kPairs = 30, kSteps = 40;
  int warm = 0;
  for (int k = 0; k < kPairs; ++k) {
    const int count = static_cast<int>(shapes.size());
    Pair p = deep_pair(*shapes[random.below(count)], *shapes[random.below(count)], random);
    p.b.x *= 0.5;
    warm += follow(p, speed, kSteps, random);
  }
  return double(warm) / (kPairs * kSteps);
}

TEST(DeepProof, outlives_steps_and_never_the_minimum) {
  const std::vector<ShapePointer> round = {ellipsoid(), disc(), slender(), smooth_pebble(), polar()};
  for (const double speed : {1e-5, 1e-3, 0.03}) {  // the last switches minima again and again
    EXPECT_GT(follow_some(round, speed, 75), speed < 1e-4 ? 0.5 : speed < 0.01 ? 0.25 : -1);
    EXPECT_GT(follow_some(dented(), speed, 83), speed < 1e-4 ? 0.03 : -1);
  }
}

}  // namespace
}  // namespace nurbs::test_deep_search

// Contact polygons: closed forms, dense sampling, finite differences, hand-overs.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <vector>

#include "body/flat_faces.h"
#include "body/support.h"
#include "contact/pair_search.h"
#include "contact/polygons/contact_polygon.h"
#include "support/bodies.h"
#include "support/flat_bodies.h"
#include "support/random.h"

namespace nurbs::test_contact_polygon {
namespace {

using namespace test;

ShapePointer roller() {
  static const ShapePointer s = make_shape("cylinder", cylinder(0.7, 1.5));
  return s;
}
ShapePointer pill() {
  static const ShapePointer s = make_shape("tablet", sharp_tablet(1, 0.3, 0.2));
  return s;
}
ShapePointer soap() {
  static const ShapePointer s = make_shape("rounded box", rounded_box(Vec3(1, 0.8, 0.6), 0.2));
  return s;
}
ShapePointer slab() {
  static const ShapePointer s = make_shape("slab", box(Vec3(3, 2.5, 0.2)));
  return s;
}

ShapePointer hexagon() {
  static const ShapePointer s = make_shape("prism", prism(6, 0.8, 0.5));
  return s;
}
ShapePointer round_rimmed() {
  static const ShapePointer s = make_shape("rounded cylinder", rounded_cylinder(0.8, 0.4, 0.1));
  return s;
}

// A scene turned and moved at random: bodies are placed in it as if it were the lab.
struct Scene {
  Quat q;
  Vec3 x;
  explicit Scene(Random& random) : q(random.turn()), x(3 * random.direction()) {}
  Particle place(const Shape& shape, const Vec3& at, const Quat& turn, double scale = 1) const {
    Particle p;
    p.shape = &shape;
    p.scale = scale;
    p.x = x + q * at;
    p.q = (q * turn).normalized();
    return p;
  }
};

Quat about(const Vec3& axis, double angle) {
  return Quat(Eigen::AngleAxisd(angle, axis.normalized()));
}

Vec3 pressure_centre(const ContactPolygon& polygon, const PolygonState& state) {
  Vec3 sum = Vec3::Zero();
  for (int i = 0; i < state.count; ++i) sum += polygon.weight[i] * state.arm_a[i];
  return sum;
}

double total_weight(const ContactPolygon& polygon) {
  double sum = 0;
  for (int i = 0; i < polygon.count; ++i) {
    EXPECT_GT(polygon.weight[i], 0);
    sum += polygon.weight[i];
  }
  return sum;
}

// --- plane

struct OnPlane {
  ShapePointer shape;
  Quat turn;
  double height;  // of the centre when it touches
  int points;     // 0: a single point
  bool rolling;
};

TEST(PlanePolygon, faces_lines_and_points) {
  Random random(1);
  const double half = std::sqrt(0.5);
  const std::vector<OnPlane> cases = {
      {cuboid(), Quat::Identity(), 0.6, 4, false},
      {cuboid(), about(Vec3::UnitX(), M_PI / 2), 0.8, 4, false},
      {cuboid(), about(Vec3::UnitX(), M_PI / 4), half * 1.4, 2, false},
      {roller(), Quat::Identity(), 1.5, 8, false},
      {roller(), about(Vec3(0.3, 0.4, 0), M_PI / 2), 0.7, 2, true},
      {pill(), about(Vec3::UnitY(), M_PI / 2), 1, 2, true},
      {pill(), Quat::Identity(), 0.5, 0, false},
      {soap(), Quat::Identity(), 0.6, 4, false},
      {soap(), about(Vec3::UnitX(), M_PI / 4), half * 1.0 + 0.2, 2, true},
      {sphere(), Quat::Identity(), 1, 0, false},
  };
  for (const OnPlane& c : cases) {
    const Scene scene(random);
    const double scale = random.uniform(0.5, 2), overlap = 1e-3;
    const Vec3 spin = Vec3::UnitZ();
    const Particle p = scene.place(*c.shape, Vec3(0.4, -0.7, scale * c.height - overlap),
                                   about(spin, random.uniform(0, 6)) * c.turn, scale);
    const Vec3 normal = scene.q * Vec3::UnitZ();
    ContactPolygon polygon;
    EXPECT_EQ(make_plane_polygon(p, scene.x, normal, kReach * overlap, &polygon), c.points > 0);
    ASSERT_EQ(polygon.count, c.points) << c.shape->name;
    EXPECT_EQ(polygon.rolling, c.rolling ? 1 : 0);
    if (c.points == 0) continue;
    EXPECT_NEAR(total_weight(polygon), 1, 1e-14);
    const PolygonState state = evaluate(polygon, plane_frame(scene.x), body_frame(p));
    EXPECT_LT((state.normal - normal).norm(), 1e-15);
    for (int i = 0; i < state.count; ++i) {
      EXPECT_NEAR(state.gap[i], -overlap, 1e-12);
      EXPECT_NEAR(state.arm_a[i].dot(normal), -0.5 * overlap, 1e-12);
      EXPECT_LT((scene.x + state.arm_a[i] - p.x - state.arm_b[i]).norm(), 1e-14);
    }
    const Vec3 foot = p.x - scene.x - normal * normal.dot(p.x - scene.x);
    const bool askew = std::abs(c.turn.w() - std::cos(M_PI / 8)) < 1e-9;  // on an edge not below the centre
    const Vec3 off = pressure_centre(polygon, state) + 0.5 * overlap * normal - foot;
    EXPECT_NEAR(off.norm(), askew ? 0.2 * half * scale : 0, 1e-9);
    EXPECT_NEAR(support_gap(polygon, nullptr, p, scene.x), -overlap, 1e-12);
    EXPECT_NEAR(stored_energy(polygon, state), 0.5 * overlap * overlap, 1e-14);
    EXPECT_EQ(judge(polygon, state), c.rolling       ? PolygonVerdict::moved
                                     : c.points == 2 ? PolygonVerdict::tilted
                                                     : PolygonVerdict::keep);
  }
}

TEST(PlanePolygon, a_tilt_beyond_reach_leaves_one_edge_then_one_corner) {
  const double overlap = 1e-3;
  const auto count = [&](const Quat& turn) {
    Particle p;
    p.shape = cuboid().get();
    p.q = turn;
    p.x[2] = find_support(*p.shape, turn.conjugate() * -Vec3::UnitZ()).h - overlap;
    ContactPolygon polygon;
    make_plane_polygon(p, Vec3::Zero(), Vec3::UnitZ(), kReach * overlap, &polygon);
    return polygon.count;
  };
  EXPECT_EQ(count(about(Vec3::UnitY(), 1.4e-3)), 4);  // 2.8e-3 over the length of 2
  EXPECT_EQ(count(about(Vec3::UnitY(), 1.6e-3)), 2);
  EXPECT_EQ(count(about(Vec3::UnitY(), 0.3)), 2);
  EXPECT_EQ(count(about(Vec3::UnitX(), 3e-3) * about(Vec3::UnitY(), 0.3)), 0);
}

// A whole round face stands on a ring of springs: closed form of the half-closed ring, whatever the heading.
TEST(PlanePolygon, a_leaning_disc_has_no_preferred_directions) {
  Random random(2);
  for (int trial = 0; trial < 50; ++trial) {
    const double tilt = random.uniform(2e-4, 1e-3), heading = random.uniform(0, 2 * M_PI), r = 0.7;
    Particle p;
    p.shape = roller().get();
    p.q = about(Vec3(-std::sin(heading), std::cos(heading), 0), tilt) * about(Vec3::UnitZ(), 1.3 * trial);
    p.x[2] = 1.5 * std::cos(tilt);  // the face's centre in the plane: half of the rim overlaps
    const double overlap = r * std::sin(tilt);
    ContactPolygon polygon;
    ASSERT_TRUE(make_plane_polygon(p, Vec3::Zero(), Vec3::UnitZ(), kReach * overlap, &polygon));
    EXPECT_EQ(polygon.count, 8);
    EXPECT_GT(polygon.ring, 0);
    const PolygonState state = evaluate(polygon, plane_frame(Vec3::Zero()), body_frame(p));
    EXPECT_NEAR(state.least, -overlap, 0.003 * overlap);
    Vec3 sum = Vec3::Zero();
    double force = 0;
    for (int i = 0; i < state.count; ++i) {
      const double share = polygon.weight[i] * std::max(0.0, -state.gap[i]);
      force += share;
      sum += share * state.arm_a[i];
    }
    // Means of o cos and o cos^2 over the closed half, o the largest overlap.
    EXPECT_NEAR(force, overlap / M_PI, 0.01 * force);
    EXPECT_NEAR(stored_energy(polygon, state), overlap * overlap / 8, 0.01 * overlap * overlap);
    const Vec3 centre = p.q * Vec3(0, 0, -1.5) + p.x;
    const Vec3 arm = sum / force - centre;
    EXPECT_NEAR(arm.head<2>().norm(), M_PI / 4 * r, 0.01);
    EXPECT_LT(angle_between(Vec3(arm[0], arm[1], 0), Vec3(std::cos(heading), std::sin(heading), 0)), 0.01);
    EXPECT_EQ(judge(polygon, state), PolygonVerdict::tilted);
    EXPECT_FALSE(outgrown(state, support_gap(polygon, nullptr, p)));
  }
}

// --- pair

struct Region {
  double area = 0;
  Vec3 centre = Vec3::Zero();  // scene
};

// The region of the plane z = 0 under the first face and over the second, by sampling their support
// functions' own definition: a point is under a face when it is inside all side planes of the sampled
// outline.
template <class InA, class InB>
Region sample(const InA& in_a, const InB& in_b, double extent) {
  constexpr int kGrid = 800;
  const double cell = 2 * extent / kGrid;
  Region region;
  for (int i = 0; i < kGrid; ++i)
    for (int j = 0; j < kGrid; ++j) {
      const Vec3 x(-extent + cell * (i + 0.5), -extent + cell * (j + 0.5), 0);
      if (!in_a(x) || !in_b(x)) continue;
      region.area += cell * cell;
      region.centre += cell * cell * x;
    }
  region.centre /= region.area;
  return region;
}

TEST(PairPolygon, boxes_face_to_face_against_dense_sampling) {
  Random random(3);
  for (int trial = 0; trial < 40; ++trial) {
    const Scene scene(random);
    const double overlap = 1e-4, angle = random.uniform(0, 2 * M_PI), scale = random.uniform(0.5, 1.5);
    const Vec3 shift(random.uniform(-1, 1), random.uniform(-0.8, 0.8), 0.6 + 0.6 * scale - overlap);
    const Particle a = scene.place(*cuboid(), Vec3::Zero(), Quat::Identity());
    const Particle b = scene.place(*cuboid(), shift, about(Vec3::UnitZ(), angle), scale);
    const Vec3 normal = scene.q * Vec3::UnitZ();
    ContactPolygon polygon, reversed;
    ASSERT_TRUE(make_pair_polygon(a, b, normal, overlap, kReach * overlap, nullptr, &polygon));
    const PolygonState state = evaluate(polygon, body_frame(a), body_frame(b));
    EXPECT_LT((state.normal - normal).norm(), 1e-14);
    EXPECT_NEAR(total_weight(polygon), 1, 1e-13);
    for (int i = 0; i < state.count; ++i) {
      EXPECT_NEAR(state.gap[i], -overlap, 1e-13);
      EXPECT_LT((state.arm_b[i] - (state.arm_a[i] + a.x - b.x)).norm(), 1e-13);
    }
    const Region region = sample([](const Vec3& x) { return std::abs(x[0]) <= 1 && std::abs(x[1]) <= 0.8; },
                                 [&](const Vec3& x) {
                                   const Vec3 y =
                                       about(Vec3::UnitZ(), -angle) * (x - Vec3(shift[0], shift[1], 0));
                                   return std::abs(y[0]) <= scale && std::abs(y[1]) <= 0.8 * scale;
                                 },
                                 1.1);
    Vec3 centre = scene.q.conjugate() * pressure_centre(polygon, state);
    centre[2] = 0;
    EXPECT_LT((centre - region.centre).norm(), 5e-3) << trial;

    // The other way round: the same points under the same names but for the roles of A and B.
    ASSERT_TRUE(make_pair_polygon(b, a, -normal, overlap, kReach * overlap, nullptr, &reversed));
    ASSERT_EQ(reversed.count, polygon.count);
    const PolygonState back = evaluate(reversed, body_frame(b), body_frame(a));
    for (int i = 0; i < state.count; ++i) {
      double least = 1, weight = 0;
      for (int j = 0; j < back.count; ++j) {
        const double d = (back.arm_b[j] - state.arm_a[i]).norm();
        if (d < least) least = d, weight = reversed.weight[j];
      }
      EXPECT_LT(least, 1e-12);
      EXPECT_NEAR(weight, polygon.weight[i], 1e-12);
    }
  }
}

TEST(PairPolygon, disc_over_the_border_of_a_box) {
  Random random(4);
  const auto disc = make_shape("short cylinder", cylinder(0.7, 0.4));
  for (int trial = 0; trial < 20; ++trial) {
    const Scene scene(random);
    const double overlap = 1e-4;
    const Vec3 shift(random.uniform(-1.4, 1.4), random.uniform(-1.2, 1.2), 1.0 - overlap);
    if (std::abs(shift[0]) > 1.2 && std::abs(shift[1]) > 1) continue;
    const Particle a = scene.place(*cuboid(), Vec3::Zero(), Quat::Identity());
    const Particle b = scene.place(*disc, shift, about(Vec3::UnitZ(), random.uniform(0, 6)));
    ContactPolygon polygon;
    ASSERT_TRUE(
        make_pair_polygon(a, b, scene.q * Vec3::UnitZ(), overlap, kReach * overlap, nullptr, &polygon));
    EXPECT_LE(polygon.count, 8);
    const PolygonState state = evaluate(polygon, body_frame(a), body_frame(b));
    const Region region =
        sample([](const Vec3& x) { return std::abs(x[0]) <= 1 && std::abs(x[1]) <= 0.8; },
               [&](const Vec3& x) { return std::hypot(x[0] - shift[0], x[1] - shift[1]) <= 0.7; }, 1.1);
    Vec3 centre = scene.q.conjugate() * pressure_centre(polygon, state);
    centre[2] = 0;
    EXPECT_LT((centre - region.centre).norm(), 1e-2);
  }
}

TEST(PairPolygon, edges_lines_and_single_points) {
  Random random(5);
  const double overlap = 1e-4, half = std::sqrt(0.5);
  struct Case {
    ShapePointer a, b;
    Vec3 at;
    Quat turn;
    int points;
    bool rolling;
    double length;  // of the segment
  };
  const std::vector<Case> cases = {
      // a box on its edge, whole on the slab
      {slab(), cuboid(), Vec3(0.1, 0.2, 0.2 + 1.4 * half), about(Vec3::UnitX(), M_PI / 4), 2, false, 2},
      // half of it beyond the border
      {slab(), cuboid(), Vec3(3, 0.2, 0.2 + 1.4 * half), about(Vec3::UnitX(), M_PI / 4), 2, false, 1},
      // a corner
      {slab(), cuboid(), Vec3(0.1, 0.2, 0.2 + std::sqrt(2.0)), Quat::Identity(), 0, false, 0},
      // a cylinder on its side
      {slab(), roller(), Vec3(0.1, 0.2, 0.9), about(Vec3::UnitX(), M_PI / 2), 2, true, 3},
      {slab(), roller(), Vec3(0.1, 2, 0.9), about(Vec3::UnitX(), M_PI / 2), 2, true, 2},
      // two cylinders, parallel and crossed
      {roller(), roller(), Vec3(1.4, 0, 0.5), Quat::Identity(), 2, true, 2.5},
      {roller(), roller(), Vec3(1.4, 0, 0.5), about(Vec3::UnitX(), 0.5), 0, false, 0},
      // a sphere on a box
      {slab(), sphere(), Vec3(0.1, 0.2, 1.2), Quat::Identity(), 0, false, 0},
      // a rounded box on its face
      {slab(), soap(), Vec3(0.1, 0.2, 0.8), Quat::Identity(), 4, false, 0},
  };
  for (size_t k = 0; k < cases.size(); ++k) {
    const Case& c = cases[k];
    const Scene scene(random);
    const Vec3 d = k == 5 || k == 6 ? Vec3::UnitX() : Vec3::UnitZ();
    const Quat turn = k == 2 ? Quat::FromTwoVectors(Vec3(1, 0.8, 0.6), -Vec3::UnitZ()) : c.turn;
    for (const bool swap : {false, true}) {
      const Particle a = scene.place(*c.a, Vec3::Zero(), Quat::Identity());
      const Particle b = scene.place(*c.b, c.at - overlap * d, turn);
      ContactPolygon polygon;
      const Vec3 normal = (swap ? -1 : 1) * (scene.q * d);
      make_pair_polygon(swap ? b : a, swap ? a : b, normal, overlap, kReach * overlap, nullptr, &polygon);
      ASSERT_EQ(polygon.count, c.points) << k << swap;
      EXPECT_EQ(polygon.rolling, c.rolling ? 1 : 0) << k;
      if (c.points == 0) continue;
      const PolygonState state = evaluate(polygon, body_frame(swap ? b : a), body_frame(swap ? a : b));
      EXPECT_LT((state.normal - normal).norm(), 1e-12);
      for (int i = 0; i < state.count; ++i) EXPECT_NEAR(state.gap[i], -overlap, 1e-11) << k;
      const double length = (state.arm_a[0] - state.arm_a[1]).norm();
      EXPECT_TRUE(c.points != 2 || std::abs(length - c.length) < 1e-9) << k;
    }
  }
}

// A face inside another one's outline is incident, whoever is A: it may slide without a remake.
TEST(PairPolygon, a_small_face_owns_the_points) {
  const double overlap = 1e-4;
  Particle a, b;
  a.shape = slab().get();
  b.shape = cuboid().get();
  b.x = Vec3(0.5, -0.3, 0.8 - overlap);
  ContactPolygon polygon;
  ASSERT_TRUE(make_pair_polygon(a, b, Vec3::UnitZ(), overlap, kReach * overlap, nullptr, &polygon));
  EXPECT_EQ(polygon.reference, 0);
  EXPECT_NEAR(polygon.room, 1.4, 1e-12);
  ContactPolygon other;
  ASSERT_TRUE(make_pair_polygon(b, a, -Vec3::UnitZ(), overlap, kReach * overlap, nullptr, &other));
  EXPECT_EQ(other.reference, 1);
  EXPECT_NEAR(other.room, 1.4, 1e-12);
  b.x[0] += 0.3;
  PolygonState state = evaluate(polygon, body_frame(a), body_frame(b));
  EXPECT_NEAR(state.slid, 0.9, 1e-12);  // a bound: 0.3 at both marks
  EXPECT_EQ(judge(polygon, state), PolygonVerdict::keep);
  b.x[0] += 0.3;
  state = evaluate(polygon, body_frame(a), body_frame(b));
  EXPECT_EQ(judge(polygon, state), PolygonVerdict::moved);
  b.x[2] += 2 * overlap;
  state = evaluate(polygon, body_frame(a), body_frame(b));
  EXPECT_EQ(judge(polygon, state), PolygonVerdict::open);
}

// --- energy

// Moves along coordinate k: three translations, three turns about the centre, lab axes.
Particle moved(Particle p, int k, double by) {
  if (k < 3)
    p.x[k] += by;
  else
    p.q = Quat(Eigen::AngleAxisd(by, Vec3::Unit(k - 3))) * p.q;
  return p;
}

TEST(PairPolygon, forces_are_the_gradient_of_the_energy) {
  Random random(6);
  for (int trial = 0; trial < 60; ++trial) {
    const Scene scene(random);
    const double overlap = 0.03, h = 1e-6;
    const bool disc = trial % 3 == 0;  // a ring of springs, part of it open
    const Particle a = scene.place(*slab(), Vec3(0, 0, 0.4), random.turn_by(0.02));
    const Particle b =
        scene.place(disc ? *roller() : *cuboid(), Vec3(0.3, 0.4, 0.6 + (disc ? 1.05 : 0.42) - overlap),
                    about(Vec3::UnitZ(), random.uniform(0, 6)) * random.turn_by(0.02), 0.7);
    ContactPolygon polygon;
    const bool from_a = trial % 2 == 0;
    const Particle &first = from_a ? a : b, &second = from_a ? b : a;
    ASSERT_TRUE(make_pair_polygon(first, second, (from_a ? 1 : -1) * (scene.q * Vec3::UnitZ()), overlap, 0.3,
                                  nullptr, &polygon));
    ASSERT_GE(polygon.count, 3);
    EXPECT_EQ(polygon.ring > 0, disc);
    polygon.factor = random.uniform(0.5, 2);
    const auto energy = [&](const Particle& p, const Particle& q) {
      return stored_energy(polygon, evaluate(polygon, body_frame(p), body_frame(q)));
    };
    const PolygonState state = evaluate(polygon, body_frame(first), body_frame(second));
    Eigen::Matrix<double, 6, 1> on_first = Eigen::Matrix<double, 6, 1>::Zero(), on_second = on_first;
    for (int i = 0; i < state.count; ++i) {
      const Vec3 f = polygon.factor * polygon.weight[i] * std::max(0.0, -state.gap[i]) * state.normal;
      on_first.head<3>() -= f;
      on_first.tail<3>() -= state.arm_a[i].cross(f);
      on_second.head<3>() += f;
      on_second.tail<3>() += state.arm_b[i].cross(f);
    }
    const double size = on_first.norm();
    ASSERT_GT(size, 1e-3);
    for (int k = 0; k < 6; ++k) {
      const double first_slope =
          (energy(moved(first, k, h), second) - energy(moved(first, k, -h), second)) / (2 * h);
      const double second_slope =
          (energy(first, moved(second, k, h)) - energy(first, moved(second, k, -h))) / (2 * h);
      EXPECT_NEAR(on_first[k], -first_slope, 1e-7 * size) << k;
      EXPECT_NEAR(on_second[k], -second_slope, 1e-7 * size) << k;
    }
  }
}

// A rounded edge lies on a face, a hair askew: its support is on the ball at one end, and was taken for one
// contact there, which a turn of 1e-7 rad moved to the other end. Leaning further it bears at one end only.
TEST(PairPolygon, a_rounded_edge_on_a_face_bears_on_both_ends) {
  const ShapePointer body = soap();
  const double overlap = 0.02;
  for (const bool swap : {false, true})
    for (const double askew : {0.0, 1e-4, -1e-4, 1e-3, -1e-3, 5e-3, 0.05, -0.05}) {
      SCOPED_TRACE(std::to_string(askew) + (swap ? " swapped" : ""));
      Random random(31);
      const Scene scene(random);
      const Quat turn =
          Quat(Eigen::AngleAxisd(askew, Vec3::UnitY())) * Quat(Eigen::AngleAxisd(0.3, Vec3::UnitX()));
      const Particle face = scene.place(*body, Vec3::Zero(), Quat::Identity());
      Particle edge = scene.place(*body, Vec3::Zero(), turn);
      const Vec3 up = scene.q * Vec3::UnitZ();
      const double low = find_hull_support(*body, edge.q.conjugate() * -up).h;
      edge.x = face.x + (0.6 + low - overlap) * up;
      const Particle &a = swap ? edge : face, &b = swap ? face : edge;
      double memory[kPairMemorySize] = {0};
      const ContactResult r = find_contact(a, b, {}, memory);
      ASSERT_NEAR(r.gap, -overlap, 0.1 * overlap);
      ContactPolygon polygon;
      const bool made = make_pair_polygon(a, b, r.normal, -r.gap, -kReach * r.gap, nullptr, &polygon);
      ASSERT_EQ(made, std::abs(askew) < 0.01);
      if (made) {
        EXPECT_EQ(polygon.count, 2);
        EXPECT_EQ(polygon.rolling, 1);
      }
    }
}

// A ruled line is remade every step: its energy is then a function of the pose, and the same forces its
// gradient.
TEST(PlanePolygon, a_rolling_line_has_a_potential) {
  const double overlap = 1e-2, h = 1e-6;
  Particle p;
  p.shape = roller().get();
  p.q = about(Vec3::UnitY(), 2e-3) * about(Vec3::UnitX(), M_PI / 2 - 1e-3) * about(Vec3::UnitZ(), 0.3);
  p.x[2] = find_support(*p.shape, p.q.conjugate() * -Vec3::UnitZ()).h - overlap;
  const auto polygon_at = [&](const Particle& at) {
    ContactPolygon polygon;
    EXPECT_TRUE(make_plane_polygon(at, Vec3::Zero(), Vec3::UnitZ(), 2 * overlap, &polygon));
    return polygon;
  };
  const auto energy = [&](const Particle& at) {
    const ContactPolygon polygon = polygon_at(at);
    return stored_energy(polygon, evaluate(polygon, plane_frame(Vec3::Zero()), body_frame(at)));
  };
  const ContactPolygon polygon = polygon_at(p);
  const PolygonState state = evaluate(polygon, plane_frame(Vec3::Zero()), body_frame(p));
  Eigen::Matrix<double, 6, 1> force = Eigen::Matrix<double, 6, 1>::Zero();
  for (int i = 0; i < state.count; ++i) {
    const Vec3 f = -polygon.weight[i] * state.gap[i] * state.normal;
    force.head<3>() += f;
    force.tail<3>() += state.arm_b[i].cross(f);
  }
  for (int k = 0; k < 6; ++k) {
    const double slope = (energy(moved(p, k, h)) - energy(moved(p, k, -h))) / (2 * h);
    EXPECT_NEAR(force[k], -slope, 1e-7 * force.norm()) << k;
  }
}

TEST(ContactPolygon, hand_over_keeps_the_energy_and_relaxing_books_it) {
  Particle p;
  p.shape = cuboid().get();
  const double overlap = 1e-3;
  p.q = about(Vec3(1, 1, 0), 1e-3);
  p.x[2] = find_support(*p.shape, p.q.conjugate() * -Vec3::UnitZ()).h - overlap;
  ContactPolygon polygon;
  ASSERT_TRUE(make_plane_polygon(p, Vec3::Zero(), Vec3::UnitZ(), kReach * overlap, &polygon));
  const PolygonState state = evaluate(polygon, plane_frame(Vec3::Zero()), body_frame(p));
  const double single = 0.5 * overlap * overlap;
  polygon.factor = continuity_factor(single, stored_energy(polygon, state));
  EXPECT_GT(polygon.factor, 1);
  EXPECT_LE(polygon.factor, 4);
  EXPECT_NEAR(stored_energy(polygon, state), single, 1e-15 * single);
  const double work = relax(polygon, state, 1);
  EXPECT_EQ(polygon.factor, 1);
  EXPECT_LT(work, 0);
  EXPECT_NEAR(stored_energy(polygon, state), single + work, 1e-15 * single);
  EXPECT_EQ(continuity_factor(0, stored_energy(polygon, state)), 1);
}

// By the factor what is more than its own, by the plane's shift what is less; both ways and back.
TEST(ContactPolygon, is_given_an_energy_by_its_factor_or_its_shift) {
  Random random(8);
  for (int trial = 0; trial < 300; ++trial) {
    Particle p;
    p.shape = (trial % 3 ? cuboid() : roller()).get();
    const double overlap = random.log_uniform(1e-4, 1e-2);
    p.q = random.turn_by(random.uniform(0, overlap));
    p.x[2] = find_support(*p.shape, p.q.conjugate() * -Vec3::UnitZ()).h - overlap;
    ContactPolygon polygon;
    ASSERT_TRUE(make_plane_polygon(p, Vec3::Zero(), Vec3::UnitZ(), kKeptReach * overlap, &polygon));
    const BodyFrame plane = plane_frame(Vec3::Zero()), body = body_frame(p);
    const double own = stored_energy(polygon, evaluate(polygon, plane, body));
    for (const double share : {1e-9, 0.3, 0.999, 1.0, 2.5, 0.01, 20.0, 0.5, 0.0, 0.7}) {
      const PolygonState state = give_energy(share * own, 8, plane, body, &polygon);
      EXPECT_NEAR(stored_energy(polygon, state), std::min(share, 8.0) * own, 1e-11 * own)
          << trial << " " << share;
      if (trial % 3) {
        EXPECT_NEAR(state.least, -overlap + polygon.shift, 1e-12);
      }
      if (share > 1) {
        EXPECT_EQ(polygon.shift, 0);
      } else {
        EXPECT_NEAR(polygon.factor, 1, 1e-12);
        EXPECT_LE(polygon.shift, overlap * (1 + 1e-12));
      }
      EXPECT_NEAR(support_gap(polygon, nullptr, p), -overlap + polygon.shift, 1e-12);
    }
  }
}

// --- sliding

TEST(PairPolygon, sliding_over_a_border_is_continuous) {
  const double overlap = 1e-4;
  Particle a, b;
  a.shape = b.shape = cuboid().get();
  b.q = about(Vec3::UnitZ(), 0.4);
  ContactPolygon polygon = {};
  PolygonState state;
  int remakes = 0, named = 0, points = 0;
  Vec3 before = Vec3::Zero();
  constexpr int kSteps = 4000;
  for (int k = 0; k < kSteps; ++k) {
    b.x = Vec3(-1.2 + 2.4 * k / kSteps, 0.3, 1.2 - overlap);
    if (polygon.count > 0) {
      state = evaluate(polygon, body_frame(a), body_frame(b));
      EXPECT_NEAR(state.least, -overlap, 1e-13);
      if (judge(polygon, state) != PolygonVerdict::moved) continue;
    }
    const ContactPolygon old = polygon;
    ASSERT_TRUE(make_pair_polygon(a, b, Vec3::UnitZ(), overlap, kReach * overlap, &old, &polygon));
    const PolygonState now = evaluate(polygon, body_frame(a), body_frame(b));
    const Vec3 centre = pressure_centre(polygon, now);
    if (old.count > 0) {
      EXPECT_EQ(polygon.reference, old.reference);
      EXPECT_LT((centre - before).norm(), 5e-3);
      EXPECT_NEAR(stored_energy(polygon, now), stored_energy(old, state), 1e-12 * overlap * overlap);
      int source[kContactPoints];
      match(old, state, polygon, now, source);
      for (int i = 0; i < polygon.count; ++i) {
        ASSERT_GE(source[i], 0);
        EXPECT_LT((now.arm_a[i] - state.arm_a[source[i]]).norm(), 0.2);
        named += old.id[source[i]] == polygon.id[i];
        ++points;
      }
      ++remakes;
    }
    before = centre;
  }
  EXPECT_GT(remakes, 100);
  EXPECT_GT(named, 0.95 * points);  // names change only where a corner passes a side
}

// --- no polygon, and for how long

// Moves a body so that its points go no further than `way`, centre's path and turn together.
void move(Random& random, double way, Particle* p) {
  const double turned = random.below(3) == 0 ? 0 : random.uniform(0, 1);
  p->x += (1 - turned) * way * random.direction();
  p->q =
      (about(random.direction(), turned * way / (p->scale * p->shape->bounding_radius)) * p->q).normalized();
}

std::vector<ShapePointer> flat_shapes() {
  return {cuboid(), roller(), pill(), soap(), slab(), hexagon(), round_rimmed()};
}

TEST(PairPolygon, where_there_is_none_there_is_none_on_the_clear_way) {
  const std::vector<ShapePointer> shapes = flat_shapes();
  const ContactSettings settings;
  Random random(21);
  int asked = 0, facing = 0;
  for (int n = 0; n < 4000; ++n) {
    Particle a, b;
    a.shape = shapes[random.below(static_cast<int>(shapes.size()))].get();
    b.shape = shapes[random.below(static_cast<int>(shapes.size()))].get();
    b.scale = random.uniform(0.4, 1.5);
    a.q = random.turn();
    const auto &faces_a = a.shape->flats.faces, &faces_b = b.shape->flats.faces;
    const bool face_to_face = n % 3 != 0 && !faces_a.empty() && !faces_b.empty();
    const double far = a.shape->bounding_radius + b.scale * b.shape->bounding_radius;
    if (face_to_face) {  // all but; or some part of B on A's face
      const Vec3 up = a.q * faces_a[n % faces_a.size()].normal;
      const Vec3 down = n % 2 == 0 ? faces_b[n / 7 % faces_b.size()].normal : random.direction();
      b.q = about(random.direction(), random.log_uniform(1e-5, 0.3)) * Quat::FromTwoVectors(down, -up);
      b.x = far * up + random.uniform(0, 0.8) * random.direction();
    } else {
      b.q = random.turn();
      b.x = far * random.direction();
    }
    const auto contact = [&] {
      double memory[kPairMemorySize] = {};
      return find_contact(a, b, settings, memory);
    };
    const double overlap = random.log_uniform(1e-5, 1e-2);
    ContactResult r = contact();
    for (int k = 0; k < 20 && std::abs(r.gap + overlap) > 0.1 * overlap; ++k) {
      b.x -= (r.gap + overlap) * r.normal;
      r = contact();
    }
    if (!(r.gap < 0)) continue;
    ContactPolygon polygon;
    double clear = 0;
    if (make_pair_polygon(a, b, r.normal, -r.gap, -kReach * r.gap, nullptr, &polygon, &clear)) continue;
    const Particle a0 = a, b0 = b;
    for (int k = 0; k < 8 && clear > 0; ++k) {
      a = a0;
      b = b0;
      const double share = random.uniform(0, 1), way = random.uniform(0.3, 0.999) * clear;
      move(random, share * way, &a);
      move(random, (1 - share) * way, &b);
      const ContactResult now = contact();
      if (!(now.gap < 0) || now.normal.dot(r.normal) < 0.99) continue;
      if (way + kClearGrowth * std::abs(r.gap - now.gap) > clear) continue;
      ++asked;
      facing += face_to_face;
      EXPECT_FALSE(make_pair_polygon(a, b, now.normal, -now.gap, -kReach * now.gap, nullptr, &polygon))
          << a.shape->name << ", " << b.shape->name << ", " << n << ": " << clear;
    }
  }
  EXPECT_GT(asked, 4000);
  EXPECT_GT(facing, 2000);
}

// Boxes that cross at their edges, deep: a face's normal far from the contact's is another contact's. Such
// polygons, made one step and left the next, put energy into shaken boxes.
TEST(PairPolygon, keeps_to_the_contacts_normal) {
  const ShapePointer box = cuboid();
  const ContactSettings settings;
  constexpr double kEightDegrees = 0.9898;
  Random random(22);
  int made = 0, remade = 0;
  for (int n = 0; n < 4000; ++n) {
    Particle a, b;
    a.shape = b.shape = box.get();
    a.q = random.turn();
    b.q = about(random.direction(), random.log_uniform(1e-3, 0.3)) * a.q;  // edges nearly parallel
    b.x = 3 * box->bounding_radius * random.direction();
    const double overlap = random.uniform(0.002, 0.03) * box->bounding_radius;
    ContactResult r;
    for (int k = 0; k < 20 && std::abs(r.gap + overlap) > 0.1 * overlap; ++k) {
      double memory[kPairMemorySize] = {};
      r = find_contact(a, b, settings, memory);
      b.x -= (r.gap + overlap) * r.normal;
    }
    if (!(r.gap < 0)) continue;
    ContactPolygon polygon, next;
    if (!make_pair_polygon(a, b, r.normal, -r.gap, -kReach * r.gap, nullptr, &polygon)) continue;
    ++made;
    PolygonState state = evaluate(polygon, body_frame(a), body_frame(b));
    const double deepest = support_gap(polygon, &a, b, Vec3::Zero());
    EXPECT_TRUE(state.normal.dot(r.normal) > kEightDegrees || deepest > 1.11 * r.gap) << n;
    move(random, 0.01 * box->bounding_radius, &b);
    state = evaluate(polygon, body_frame(a), body_frame(b));
    const double now = std::max(-state.least, -support_gap(polygon, &a, b, Vec3::Zero()));
    if (!(now > 0) || !make_pair_polygon(a, b, state.normal, now, kKeptReach * now, &polygon, &next))
      continue;
    ++remade;
    EXPECT_GT(evaluate(next, body_frame(a), body_frame(b)).normal.dot(state.normal), kEightDegrees) << n;
  }
  EXPECT_GT(made, 500);
  EXPECT_GT(remade, 300);
}

// Poses a little into the plane z = 0 that `polygon_of(particle, reach, &clear)` finds none for are moved by
// nearly the way it calls clear, as far as there is one; how many moved ones there were to ask.
template <class PolygonOf>
int expect_none_on_the_clear_way(int seed, PolygonOf polygon_of) {
  const std::vector<ShapePointer> shapes = flat_shapes();
  Random random(seed);
  int asked = 0;
  for (int n = 0; n < 3000; ++n) {
    Particle p;
    p.shape = shapes[random.below(static_cast<int>(shapes.size()))].get();
    p.scale = random.uniform(0.4, 1.5);
    const auto& faces = p.shape->flats.faces;
    const Vec3 down = n % 2 == 0 && !faces.empty() ? faces[n / 7 % faces.size()].normal : random.direction();
    p.q =
        about(random.direction(), random.log_uniform(1e-5, 0.5)) * Quat::FromTwoVectors(down, -Vec3::UnitZ());
    const auto lowest = [&] {
      return p.x[2] - p.scale * find_support(*p.shape, p.q.conjugate() * -Vec3::UnitZ()).h;
    };
    p.x[2] -= lowest() + random.log_uniform(1e-5, 1e-2);
    double clear = 0;
    if (polygon_of(p, -kReach * lowest(), &clear)) continue;
    const Particle start = p;
    for (int k = 0; k < 8 && clear > 0; ++k) {
      p = start;
      move(random, 0.999 * clear, &p);
      if (!(lowest() < 0)) continue;
      ++asked;
      EXPECT_FALSE(polygon_of(p, -kReach * lowest(), nullptr)) << p.shape->name << ", " << n << ": " << clear;
    }
  }
  return asked;
}

TEST(PlanePolygon, where_there_is_none_there_is_none_on_the_clear_way) {
  const int asked = expect_none_on_the_clear_way(22, [](const Particle& p, double reach, double* clear) {
    ContactPolygon polygon;
    return make_plane_polygon(p, Vec3::Zero(), Vec3::UnitZ(), reach, &polygon, clear);
  });
  EXPECT_GT(asked, 4000);
}

// Over all of a plane, and over a table whose border runs beneath the bodies: two cells that share a side.
TEST(RegionPolygon, where_there_is_none_there_is_none_on_the_clear_way) {
  PlaneCells table;
  const Vec3 corners[] = {{-0.3, -0.2, 0}, {4, -0.2, 0}, {4, 4, 0}, {-0.3, 4, 0}};
  for (const int k : {0, 1, 2, 0, 2, 3}) table.corners.push_back(corners[k]);
  table.ends = {3, 6};
  for (int k = 0; k < 4; ++k) table.border.insert(table.border.end(), {corners[k], corners[(k + 1) % 4]});
  int found[3] = {};
  for (const PlaneCells* cells :
       {static_cast<const PlaneCells*>(nullptr), static_cast<const PlaneCells*>(&table)}) {
    const PlaneRegion region = {Vec3(0.1, 0.2, 0), Vec3::UnitZ(), cells};
    const int asked = expect_none_on_the_clear_way(23, [&](const Particle& p, double reach, double* clear) {
      ContactPolygon polygon;
      const RegionContact contact = make_region_polygon(p, region, p.x, reach, &polygon, clear);
      if (clear) ++found[static_cast<int>(contact)];
      return contact == RegionContact::polygon;
    });
    EXPECT_GT(asked, 4000);
  }
  for (const int count : found) EXPECT_GT(count, 50);  // points, features beside the region, polygons
}

// A capsule's long line and a tablet's short one: the polygon is the same whichever of the bodies comes
// first.
TEST(ContactPolygon, lines_side_by_side_do_not_know_which_body_is_first) {
  const ShapePointer shapes[] = {make_shape("capsule", capsule(1, 2)), round_rimmed(), roller()};
  Random random(15);
  int made = 0;
  for (int k = 0; k < 600; ++k) {
    Particle a, b;
    a.shape = shapes[k % 3].get();
    b.shape = shapes[(k + 1) % 3].get();
    a.q = random.turn();
    b.q = (random.turn_by(random.log_uniform(1e-4, 0.1)) * a.q).normalized();
    const Vec3 axis = a.q * Vec3::UnitZ(), aside = axis.cross(random.direction()).normalized();
    b.x = 2.5 * aside + random.uniform(-1, 1) * axis;
    const double target = -random.log_uniform(1e-4, 1e-2);
    ContactResult r;
    for (int i = 0; i < 40; ++i) {
      double memory[kPairMemorySize] = {0};
      r = find_contact(a, b, {}, memory);
      b.x += (target - r.gap) * r.normal;
    }
    if (!(std::abs(r.gap - target) < 1e-6) || std::abs(r.normal.dot(axis)) > 0.2) continue;
    ContactPolygon one, other;
    make_pair_polygon(a, b, r.normal, -r.gap, -kReach * r.gap, nullptr, &one);
    make_pair_polygon(b, a, -r.normal, -r.gap, -kReach * r.gap, nullptr, &other);
    ASSERT_EQ(one.count, other.count) << k;
    if (one.count == 0) continue;
    ++made;
    const double energy = evaluate(one, body_frame(a), body_frame(b)).energy;
    EXPECT_NEAR(evaluate(other, body_frame(b), body_frame(a)).energy, energy, 1e-9 * energy) << k;
  }
  EXPECT_GT(made, 100);
}

// A fitted prism came down on one edge and went on to the next, shorter one: as a line rolled there, the old
// points would have held a hundred times their energy, far out on the new edge's line.
TEST(ContactPolygon, another_edge_is_no_line_that_rolled) {
  ContactPolygon old{}, polygon{};
  old.count = polygon.count = 2;
  old.rolling = polygon.rolling = 1;
  const auto place = [](double x, double y, double* to) { to[0] = x, to[1] = y, to[2] = 0; };
  place(-1.1347, -0.9061, old.point[0]);
  place(-1.5476, -0.8278, old.point[1]);
  place(-1.5639, -0.8080, polygon.point[0]);
  place(-1.5470, -0.8238, polygon.point[1]);
  EXPECT_FALSE(rolled_along(old, polygon));  // another way
  place(-1.5476, -0.8278, polygon.point[0]);
  place(-1.5276, -0.8316, polygon.point[1]);
  EXPECT_FALSE(rolled_along(old, polygon));  // the same, but a short part of it
  place(-1.5476, -0.8278 + 0.01, polygon.point[0]);
  place(-1.1347, -0.9061 + 0.01, polygon.point[1]);
  EXPECT_TRUE(rolled_along(old, polygon));
  polygon.reference = 1;
  EXPECT_FALSE(rolled_along(old, polygon));
}

TEST(ContactPolygon, is_plain_data) {
  Particle p;
  p.shape = cuboid().get();
  p.x[2] = 0.6 - 1e-4;
  ContactPolygon polygon, copy;
  ASSERT_TRUE(make_plane_polygon(p, Vec3::Zero(), Vec3::UnitZ(), 3e-4, &polygon));
  std::memcpy(&copy, &polygon, sizeof copy);
  const PolygonState x = evaluate(polygon, plane_frame(Vec3::Zero()), body_frame(p));
  const PolygonState y = evaluate(copy, plane_frame(Vec3::Zero()), body_frame(p));
  for (int i = 0; i < x.count; ++i) EXPECT_EQ(x.gap[i], y.gap[i]);
}

}  // namespace
}  // namespace nurbs::test_contact_polygon

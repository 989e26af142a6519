// Contact polygons at work in small velocity-Verlet loops with a linear spring and damper per point: bodies
// on flat faces come to rest, tip at the angle of statics, slide evenly, keep their energy.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "contact/pair_memory.h"
#include "contact/pair_search.h"
#include "contact/polygons/contact_polygon.h"
#include "motion/rotation.h"
#include "support/bodies.h"
#include "support/flat_bodies.h"
#include "support/random.h"

namespace nurbs::test_flat_statics {
namespace {

using namespace test;

constexpr double kRelaxation = 0.6;  // some periods of a contact

struct Law {
  double kn = 1e4, cn = 60, kt = 8e3, ct = 40, mu = 2;
  double typical = 2e-4;  // overlap
};

struct Mover {
  Particle p;
  double mass = 1;
  bool fixed = false;
  Vec3 v = Vec3::Zero(), momentum = Vec3::Zero(), force = Vec3::Zero(), torque = Vec3::Zero();

  Vec3 principal() const { return mass * p.scale * p.scale * p.shape->principal_gyration; }
  Vec3 spin() const {
    return fixed ? Vec3(Vec3::Zero()) : angular_velocity(momentum, p.q, p.shape->principal_axes, principal());
  }
  double kinetic() const {
    return 0.5 * mass * v.squaredNorm() +
           rotational_energy(momentum, p.q, p.shape->principal_axes, principal());
  }
};

// One pair of movers, or (a null) a mover and the plane z = 0.
struct Touch {
  Mover* a;
  Mover* b;
  Touch(Mover* first, Mover* second) : a(first), b(second) {}
  ContactPolygon polygon{};
  double single = 0;  // factor of a single point's spring; 0: no contact
  Vec3 spring[kContactPoints] = {};
  double memory[kPairMemorySize] = {};
  int remakes = 0, singles = 0;
  double elastic = 0, booked = 0;  // energies: in the springs, and put in by jumps and by relaxing

  BodyFrame frame_a() const { return a ? body_frame(a->p) : plane_frame(Vec3::Zero()); }

  ContactResult find() {
    ContactSettings settings;
    settings.reach = 0;
    ContactResult r = a ? find_contact(a->p, b->p, settings, memory)
                        : find_plane_contact(b->p, Vec3::Zero(), Vec3::UnitZ(), settings, memory);
    if (!a) {  // points from the plane's origin, as for a pair from A
      r.point_a += b->p.x;
      r.point_b += b->p.x;
    }
    return r;
  }

  bool make(const ContactResult& r, double reach, ContactPolygon* out) {
    return a ? make_pair_polygon(a->p, b->p, r.normal, -r.gap, reach, &polygon, out)
             : make_plane_polygon(b->p, Vec3::Zero(), r.normal, reach, out);
  }

  // Polygon or single point (state->count = 1) for this step.
  PolygonState update(const Law& law) {
    PolygonState state = evaluate(polygon, frame_a(), body_frame(b->p));
    bool remake = true;
    if (polygon.count > 0) {
      const PolygonVerdict verdict = judge(polygon, state);
      if (verdict == PolygonVerdict::open) {
        polygon = {};
        single = 0;
      } else if (verdict == PolygonVerdict::tilted) {
        remake = outgrown(state, support_gap(polygon, a ? &a->p : nullptr, b->p));
      } else {
        remake = verdict == PolygonVerdict::moved;
      }
    }
    if (!remake) return state;
    const ContactResult r = find();
    if (!(r.status != Status::separated && r.gap < 0)) {
      polygon = {};
      single = 0;
      return {};
    }
    ContactPolygon next = {};
    const double energy = polygon.count > 0 ? stored_energy(polygon, state) : 0.5 * single * r.gap * r.gap;
    const double lag = polygon.count > 0 ? kKeptReach : kReach;
    if (make(r, std::max(lag * -r.gap, law.typical), &next)) {
      const PolygonState now = evaluate(next, frame_a(), body_frame(b->p));
      int source[kContactPoints];
      Vec3 old[kContactPoints];
      std::copy(spring, spring + kContactPoints, old);
      match(polygon, state, next, now, source);
      const bool fresh = polygon.count == 0 && single == 0;
      for (int i = 0; i < next.count; ++i)
        spring[i] = fresh ? Vec3(Vec3::Zero()) : old[polygon.count > 0 ? source[i] : 0];
      // While it slides the jump is booked; a body that leans on other points keeps its force.
      const bool slides = polygon.count > 0 && state.slid > polygon.room;
      next.factor = slides ? polygon.factor : continuity_factor(energy, stored_energy(next, now));
      if (polygon.count > 0) booked += law.kn * (stored_energy(next, now) - energy);
      polygon = next;
      ++remakes;
      return now;
    }
    single = energy > 0 ? energy / (0.5 * r.gap * r.gap) : 1;
    if (polygon.count > 0) {
      const Vec3 lowest = spring[std::min_element(state.gap, state.gap + state.count) - state.gap];
      spring[0] = lowest;
    } else if (energy == 0) {
      spring[0].setZero();
    }
    polygon = {};
    ++singles;
    PolygonState one;
    one.count = 1;
    one.normal = r.normal;
    one.gap[0] = one.least = one.most = r.gap;
    one.arm_a[0] = 0.5 * (r.point_a + r.point_b);
    one.arm_b[0] = one.arm_a[0] - (b->p.x - frame_a().x);
    return one;
  }

  void apply(const Law& law, double dt) {
    const PolygonState state = update(law);
    if (polygon.count > 0 && law.cn > 0) booked += law.kn * relax(polygon, state, dt / kRelaxation);
    elastic = law.kn *
              (polygon.count > 0 ? stored_energy(polygon, state) : 0.5 * single * state.least * state.least);
    const Vec3 spin_a = a ? a->spin() : Vec3::Zero(), spin_b = b->spin(), v_a = a ? a->v : Vec3::Zero();
    for (int i = 0; i < state.count; ++i) {
      if (!(state.gap[i] < 0)) {
        spring[i].setZero();
        continue;
      }
      const double share = polygon.count > 0 ? polygon.factor * polygon.weight[i] : single;
      const Vec3 rate = b->v + spin_b.cross(state.arm_b[i]) - v_a - spin_a.cross(state.arm_a[i]);
      const double along = rate.dot(state.normal);
      const double fn = std::max(0.0, share * (-law.kn * state.gap[i] - law.cn * along));
      const Vec3 slip = rate - along * state.normal;
      Vec3& xi = spring[i];
      xi += dt * slip;
      xi -= xi.dot(state.normal) * state.normal;
      Vec3 ft = -share * (law.kt * xi + law.ct * slip);
      const double most = law.mu * fn;
      if (ft.norm() > most) {
        ft *= most / ft.norm();
        if (law.kt > 0) xi = -(ft / share + law.ct * slip) / law.kt;
      }
      const Vec3 f = fn * state.normal + ft;
      b->force += f;
      b->torque += state.arm_b[i].cross(f);
      if (a) {
        a->force -= f;
        a->torque -= state.arm_a[i].cross(f);
      }
    }
  }
};

struct World {
  Law law;
  double dt = 1e-3;
  Vec3 gravity{0, 0, -1};
  std::vector<Mover> movers;
  std::vector<Touch> touches;

  void forces() {
    for (Mover& m : movers) {
      m.force = m.mass * gravity;
      m.torque.setZero();
    }
    for (Touch& t : touches) t.apply(law, dt);
  }
  void step() {
    for (Mover& m : movers) {
      if (m.fixed) continue;
      m.v += 0.5 * dt * m.force / m.mass;
      m.momentum += 0.5 * dt * m.torque;
      m.p.x += dt * m.v;
      rotate_free(RotationScheme::symplectic, m.principal(), m.p.shape->principal_axes, dt, m.p.q,
                  m.momentum);
    }
    forces();
    for (Mover& m : movers) {
      if (m.fixed) continue;
      m.v += 0.5 * dt * m.force / m.mass;
      m.momentum += 0.5 * dt * m.torque;
    }
  }
  void run(double time) {
    for (int k = 0; k < time / dt; ++k) step();
  }
  double kinetic() const {
    double sum = 0;
    for (const Mover& m : movers) sum += m.kinetic();
    return sum;
  }
  double energy() const {
    double sum = kinetic();
    for (const Mover& m : movers) sum -= m.mass * gravity.dot(m.p.x);
    for (const Touch& t : touches) sum += t.elastic;
    return sum;
  }
};

ShapePointer block() {
  static const ShapePointer s = make_shape("block", box(Vec3(0.3, 0.4, 0.6)));
  return s;
}
ShapePointer can() {
  static const ShapePointer s = make_shape("can", cylinder(0.3, 0.6));
  return s;
}
ShapePointer soap() {
  static const ShapePointer s = make_shape("soap", rounded_box(Vec3(0.6, 0.5, 0.4), 0.1));
  return s;
}
ShapePointer pill() {
  static const ShapePointer s = make_shape("pill", sharp_tablet(0.5, 0.3, 0.1));
  return s;
}

Mover at(const ShapePointer& shape, const Vec3& x, const Quat& q = Quat::Identity()) {
  Mover m;
  m.p.shape = shape.get();
  m.p.x = x;
  m.p.q = q;
  return m;
}

Quat about(const Vec3& axis, double angle) {
  return Quat(Eigen::AngleAxisd(angle, axis.normalized()));
}

TEST(FlatStatics, bodies_dropped_on_a_plane_come_to_rest) {
  struct Case {
    ShapePointer shape;
    double height;
    Quat turn;
    int points;
  };
  const Quat tilt = about(Vec3(0.5, 1, 0), 0.01);
  const std::vector<Case> cases = {
      {block(), 0.6, tilt, 4},
      {can(), 0.6, about(Vec3(0.5, 1, 0), 1e-3), 8},  // more, and it wobbles round its rim for long
      {soap(), 0.4, tilt, 4},
      {block(), 0.3, tilt * about(Vec3::UnitY(), M_PI / 2), 4}};
  for (const Case& c : cases) {
    World w;
    const double fall = 0.1;
    w.movers = {at(c.shape, Vec3(0, 0, c.height + fall), c.turn)};
    w.touches.emplace_back(nullptr, w.movers.data());
    w.run(30);
    const Touch& t = w.touches[0];
    EXPECT_EQ(t.polygon.count, c.points) << c.shape->name;
    EXPECT_LT(w.kinetic(), 1e-12 * fall) << c.shape->name;
    EXPECT_NEAR(t.polygon.factor, 1, 1e-12);
    EXPECT_NEAR(w.movers[0].p.x[2], c.height - 1 / w.law.kn, 1e-8);
    const int remakes = t.remakes, singles = t.singles;
    w.run(1);
    EXPECT_EQ(t.remakes, remakes);  // at rest nothing is made anew
    EXPECT_EQ(t.singles, singles);
    EXPECT_LT(w.kinetic(), 1e-16);
  }
}

TEST(FlatStatics, a_cylinder_and_a_tablet_lie_on_their_side) {
  for (const ShapePointer& shape : {can(), pill()}) {
    World w;
    const double radius = shape == can() ? 0.3 : 0.5;
    w.movers = {at(shape, Vec3(0, 0, radius + 0.05), about(Vec3::UnitX(), M_PI / 2 + 0.02))};
    w.touches.emplace_back(nullptr, w.movers.data());
    w.run(30);
    EXPECT_EQ(w.touches[0].polygon.count, 2);
    EXPECT_LT(w.kinetic(), 1e-12 * 0.05) << shape->name;
  }
}

TEST(FlatStatics, a_stack_of_five_boxes_lies_still) {
  World w;
  w.law.cn = w.law.ct = 100;
  const ShapePointer brick = make_shape("brick", box(Vec3(0.4, 0.3, 0.15)));
  Random random(1);
  const double fall = 0.02;
  for (int k = 0; k < 5; ++k)
    w.movers.push_back(at(
        brick, Vec3(random.uniform(-0.05, 0.05), random.uniform(-0.05, 0.05), 0.15 + fall + k * (0.3 + fall)),
        about(Vec3::UnitZ(), random.uniform(-0.3, 0.3))));
  w.touches.emplace_back(nullptr, w.movers.data());
  for (int k = 0; k < 4; ++k) w.touches.emplace_back(&w.movers[k], &w.movers[k + 1]);
  w.run(40);
  EXPECT_LT(w.kinetic(), 1e-12 * 5 * fall);
  for (const Touch& t : w.touches) EXPECT_GE(t.polygon.count, 4);
  const int remakes = w.touches[2].remakes;
  w.run(2);
  EXPECT_EQ(w.touches[2].remakes, remakes);
  EXPECT_LT(w.kinetic(), 1e-18);
}

// Gravity turned slowly to `angle` (rad) towards `heading`: how far the body leans in the end, rad.
double lean(World& w, Mover& body, double angle, double heading) {
  const double ramp = 20, hold = 25;
  const Quat start = body.p.q;
  for (int k = 0; k < (ramp + hold) / w.dt; ++k) {
    const double t = angle * std::min(1.0, k * w.dt / ramp);
    w.gravity = Vec3(std::sin(t) * std::cos(heading), std::sin(t) * std::sin(heading), -std::cos(t));
    w.step();
    if (body.p.q.angularDistance(start) > 0.2) break;
  }
  return body.p.q.angularDistance(start);
}

// The steepest slope on which a disc on a ring of springs stands: the largest over all leans of the angle at
// which the centre of pressure is seen from the centre of mass, less the lean itself. `overlap`: m g / kn.
double ring_tipping_angle(double radius, double height, double overlap) {
  double best = 0;
  for (double tilt = 1e-7; tilt < 0.1; tilt *= 1.02) {
    // Closed arc of half angle e: mean overlap r tilt (sin e - e cos e) / pi, its moment r (e - sin e cos e)
    // / 2.
    double low = 0, high = M_PI;
    for (int k = 0; k < 60; ++k) {
      const double e = 0.5 * (low + high);
      (radius * tilt * (std::sin(e) - e * std::cos(e)) / M_PI < overlap ? low : high) = e;
    }
    const double e = low;
    const double arm = radius * (e - std::sin(e) * std::cos(e)) / (2 * (std::sin(e) - e * std::cos(e)));
    best = std::max(best, std::atan2(arm, height) - tilt);
  }
  return best;
}

TEST(FlatStatics, tipping_at_the_angle_of_statics) {
  struct Case {
    ShapePointer shape;
    double heading, angle;
  };
  // A disc's rim yields: it tips a little early, the same way all round. Rigid in the limit.
  const double degree = M_PI / 180, disc = ring_tipping_angle(0.3, 0.6, 1e-5);
  EXPECT_NEAR(disc, std::atan2(0.3, 0.6), 0.8 * degree);
  EXPECT_NEAR(ring_tipping_angle(0.3, 0.6, 1e-9), std::atan2(0.3, 0.6), 0.03 * degree);
  const std::vector<Case> cases = {{block(), 0, std::atan2(0.3, 0.6)},
                                   {block(), M_PI / 2, std::atan2(0.4, 0.6)},
                                   {can(), 0, disc},
                                   {can(), M_PI / 8, disc},
                                   {can(), 0.1, disc},
                                   {soap(), M_PI / 2, std::atan2(0.4, 0.4)}};
  for (const bool on_body : {false, true})
    for (const Case& c : cases) {
      for (const double beyond : {-0.1, 0.1}) {
        World w;
        w.law = {1e5, 200, 8e4, 150, 2, 2e-5};  // stiff: a body leans by its points' overlap before it tips
        const ShapePointer slab = make_shape("slab", box(Vec3(2, 2, 0.5)));
        const double half = c.shape == soap() ? 0.4 : 0.6;
        w.movers = {at(c.shape, Vec3(0, 0, half - 1e-5)), at(slab, Vec3(0, 0, -0.5))};
        w.movers[1].fixed = true;
        w.touches.emplace_back(on_body ? &w.movers[1] : nullptr, w.movers.data());
        w.forces();
        const double leans = lean(w, w.movers[0], c.angle + beyond * degree, c.heading);
        EXPECT_EQ(leans > 0.2, beyond > 0) << c.shape->name << " " << c.heading << " on body " << on_body;
        EXPECT_TRUE(beyond > 0 || leans < 0.01) << leans;
      }
    }
}

// A block slides down a slope and over the border of the slab it lies on: even acceleration, no rocking.
TEST(FlatStatics, sliding_without_chatter) {
  World w;
  w.law.mu = 0.3;
  const ShapePointer slab = make_shape("slab", box(Vec3(2, 2, 0.5))),
                     brick = make_shape("brick", box(Vec3(0.4, 0.3, 0.1)));
  w.movers = {at(brick, Vec3(0, 0, 0.1 - 1e-4), about(Vec3::UnitZ(), 0.3)), at(slab, Vec3(0, 0, -0.5))};
  w.movers[1].fixed = true;
  w.touches.emplace_back(&w.movers[1], w.movers.data());
  const double slope = 0.4;
  w.gravity = Vec3(std::sin(slope), 0, -std::cos(slope));
  w.forces();
  const double a = std::sin(slope) - w.law.mu * std::cos(slope);
  w.run(2);  // the start decays
  double rocking = 0;
  while (w.movers[0].p.x[0] < 1.9) {  // from 1.5 on, ever more of it is beyond the border
    w.step();
    const Vec3 spin = w.movers[0].spin();
    rocking = std::max(rocking, std::hypot(spin[0], spin[1]));
    ASSERT_GT(w.movers[0].v[0], 0);
  }
  const double time = w.movers[0].v[0] / a;
  EXPECT_NEAR(w.movers[0].p.x[0], 0.5 * a * time * time, 0.02);
  EXPECT_LT(rocking, 2e-3);
  EXPECT_EQ(w.touches[0].singles, 0);
}

// Without damping and friction: a block rocking on its face keeps its energy while its points stay.
TEST(FlatStatics, frictionless_rocking_keeps_the_energy) {
  World w;
  w.law.cn = w.law.ct = w.law.kt = w.law.mu = 0;
  w.dt = 2e-4;
  w.movers = {at(block(), Vec3(0, 0, 0.6 - 1e-4), about(Vec3(1, 0.5, 0), 2e-4))};
  w.touches.emplace_back(nullptr, w.movers.data());
  w.forces();
  const double before = w.energy();
  double worst = 0, least = 1, most = 0;
  for (int k = 0; k < 50000; ++k) {
    w.step();
    worst = std::max(worst, std::abs(w.energy() - w.touches[0].booked - before));
    least = std::min(least, w.kinetic());
    most = std::max(most, w.kinetic());
  }
  EXPECT_GT(most, 1e-6);
  EXPECT_LT(worst, 1e-3 * most);
  EXPECT_EQ(w.touches[0].singles, 0);
}

}  // namespace
}  // namespace nurbs::test_flat_statics

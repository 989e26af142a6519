// The force law in small velocity-Verlet loops with closed-form contact geometry (spheres, an ellipsoid on a
// plane): closed forms, order in the time step, momentum, the energy ledger.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "laws/contact_law.h"
#include "motion/rotation.h"

namespace nurbs::test_contact_law {
namespace {

struct Body {
  Vec3 x = Vec3::Zero(), v = Vec3::Zero(), momentum = Vec3::Zero();
  Quat q = Quat::Identity();
  Vec3 axes = Vec3::Ones();  // semi-axes of the ellipsoid
  double mass = 1;
  Vec3 gravity = Vec3::Zero();
  Vec3 force = Vec3::Zero(), torque = Vec3::Zero();

  Vec3 principal() const {
    const Vec3 s = axes.cwiseAbs2();
    return mass / 5 * Vec3(s.y() + s.z(), s.x() + s.z(), s.x() + s.y());
  }
  Vec3 spin() const { return angular_velocity(momentum, q, Quat::Identity(), principal()); }
  void set_spin(const Vec3& w) { momentum = angular_momentum(w, q, Quat::Identity(), principal()); }
  double energy() const {
    return 0.5 * mass * v.squaredNorm() + rotational_energy(momentum, q, Quat::Identity(), principal()) -
           mass * gravity.dot(x);
  }
  BodyMotion motion(double dt) const {
    return body_motion(v, spin(), mass, principal(), q.toRotationMatrix(), dt);
  }
  void kick(double dt) {
    v += dt * (force / mass + gravity);
    momentum += dt * torque;
  }
  void drift(double dt) {
    x += dt * v;
    rotate_free(RotationScheme::exact, principal(), Quat::Identity(), dt, q, momentum);
  }
};

// Two spheres, or (a == nullptr) an ellipsoid on the plane z = 0.
struct Scene {
  Body* a;
  Body* b;
  ContactCoefficients law;
  ContactState state{};
  EnergyLedger ledger{};

  ContactGeometry geometry() const {
    if (a != nullptr) {
      const Vec3 apart = b->x - a->x, n = apart.normalized();
      const double overlap = a->axes.x() + b->axes.x() - apart.norm();
      const Vec3 arm = (a->axes.x() - 0.5 * overlap) * n;
      return {overlap, n, arm, arm - apart};
    }
    const Vec3 n = Vec3::UnitZ(), d = b->q.conjugate() * -n;
    const Vec3 lowest = b->q * Vec3(b->axes.cwiseAbs2().cwiseProduct(d) / b->axes.cwiseProduct(d).norm());
    const double overlap = -(b->x.z() + lowest.z());
    const Vec3 arm = lowest + 0.5 * overlap * n;
    return {overlap, n, b->x + arm, arm};
  }

  void forces(double dt) {
    const ContactGeometry g = geometry();
    const BodyMotion motion_a = a != nullptr ? a->motion(dt) : BodyMotion{}, motion_b = b->motion(dt);
    if (dt == 0 && g.overlap > 0) {
      set_contact(law, g, motion_a, motion_b, state);
    } else if (g.overlap > 0) {
      ASSERT_TRUE(advance_contact(law, g, motion_a, motion_b, dt, state, ledger));
    } else {
      end_contact(law, motion_a, motion_b, dt, state, ledger);
    }
    const EnergyLedger stored = stored_energy(law, state);
    ledger.normal_spring = stored.normal_spring;
    ledger.tangential_spring = stored.tangential_spring;
    const Vec3 f = state.active != 0 ? force_on_b(state) : Vec3(Vec3::Zero());
    b->force = f;
    b->torque = g.arm_b.cross(f);
    if (a != nullptr) {
      a->force = -f;
      a->torque = -g.arm_a.cross(f);
    }
  }

  void step(double dt) {
    for (Body* body : {a, b})
      if (body != nullptr) {
        body->kick(0.5 * dt);
        body->drift(dt);
      }
    forces(dt);
    for (Body* body : {a, b})
      if (body != nullptr) body->kick(0.5 * dt);
  }

  double total() const {
    return (a != nullptr ? a->energy() : 0) + b->energy() + ledger.elastic() + ledger.damping +
           ledger.friction;
  }
};

Body sphere(double x, double v, double mass = 1, double radius = 0.5) {
  Body body;
  body.x = {x, 0, 0};
  body.v = {v, 0, 0};
  body.mass = mass;
  body.axes = Vec3::Constant(radius);
  return body;
}

// Least-squares slope of log(error) over log(dt).
double slope(const std::vector<double>& dt, const std::vector<double>& error) {
  double mx = 0, my = 0, xy = 0, xx = 0;
  const double n = static_cast<double>(dt.size());
  for (size_t i = 0; i < dt.size(); ++i) mx += std::log(dt[i]) / n, my += std::log(error[i]) / n;
  for (size_t i = 0; i < dt.size(); ++i) {
    xy += (std::log(dt[i]) - mx) * (std::log(error[i]) - my);
    xx += (std::log(dt[i]) - mx) * (std::log(dt[i]) - mx);
  }
  return xy / xx;
}

// Restitution of m x'' + cn x' + kn x = 0 from x = 0 until the force vanishes (no attraction).
double restitution(double m, double kn, double cn) {
  const double w0 = std::sqrt(kn / m), zeta = cn / (2 * std::sqrt(kn * m));
  if (zeta < 1) {
    const double wd = w0 * std::sqrt(1 - zeta * zeta);
    double t = std::atan2(2 * zeta * std::sqrt(1 - zeta * zeta), 2 * zeta * zeta - 1);  // in (0, pi): force 0
    return std::exp(-zeta * w0 * t / wd);
  }
  const double root = std::sqrt(zeta * zeta - 1);
  const double t = std::log((zeta + root) / (zeta - root)) / root;
  return std::exp(-zeta * t / 1.0);
}

// `phase`: how far into a step the contact begins.
double measured_restitution(double kn, double cn, double dt, double m1, double m2, double phase) {
  const double speed = 1;
  Body a = sphere(0, 0.3, m1), b = sphere(1 + (100 + phase) * speed * dt, 0.3 - speed, m2);
  Scene scene{&a, &b, {kn, 0, cn, 0, 0}};
  scene.forces(0);
  for (int i = 0; i < 105 || (scene.state.active != 0 && i < 1000000); ++i) scene.step(dt);
  while (scene.geometry().overlap > 0) scene.step(dt);
  scene.step(dt);
  EXPECT_EQ(scene.state.active, 0);
  return b.v.x() - a.v.x();
}

TEST(ContactLaw, head_on_restitution_of_the_damped_spring_is_second_order) {
  const double m1 = 1.3, m2 = 0.8, m = m1 * m2 / (m1 + m2), kn = 1e5;
  for (const double zeta : {0.05, 0.3, 0.8, 3.0}) {
    const double cn = 2 * zeta * std::sqrt(kn * m), exact = restitution(m, kn, cn);
    std::vector<double> steps, errors;
    for (double dt = 1e-4; dt > 2e-6; dt *= 0.5) {
      double worst = 0;
      for (double phase = 0.03; phase < 1; phase += 0.06)
        worst = std::max(worst, std::abs(measured_restitution(kn, cn, dt, m1, m2, phase) - exact));
      steps.push_back(dt);
      errors.push_back(worst);
    }
    const double order = slope(steps, errors);
    std::printf("  damping ratio %.2f: restitution %.6f, order %.2f, error %.1e .. %.1e\n", zeta, exact,
                order, errors.front(), errors.back());
    EXPECT_GT(order, 1.85) << "damping ratio " << zeta;
    EXPECT_LT(errors.back(), 1e-6) << "damping ratio " << zeta;
    EXPECT_LT(exact, 1);
  }
}

TEST(ContactLaw, undamped_frictionless_contact_dissipates_exactly_nothing) {
  Body a = sphere(0, 0.3), b = sphere(1.01, -0.7);
  b.x.y() = 0.3;
  a.set_spin({1, 2, 3});
  Scene scene{&a, &b, {1e5, 3e4, 0, 0, 0}};
  const double before = scene.total();
  for (int i = 0; i < 4000; ++i) scene.step(5e-5);
  EXPECT_EQ(scene.ledger.damping, 0);
  EXPECT_EQ(scene.ledger.friction, 0);
  EXPECT_NEAR(scene.total(), before, 1e-5 * before);
  EXPECT_GT((b.v - Vec3(-0.7, 0, 0)).norm(), 0.1);
}

TEST(ContactLaw, momentum_is_conserved_to_round_off) {
  Body a = sphere(0, 0.3, 1.7, 0.6), b = sphere(1.05, -0.7, 0.6, 0.4);
  b.x.y() = 0.2;
  a.set_spin({10, 2, 30});
  b.set_spin({0, -20, 5});
  Scene scene{&a, &b, {1e5, 3e4, 50, 20, 0.4}};
  const auto linear = [&] { return Vec3(a.mass * a.v + b.mass * b.v); };
  const auto angular = [&] {
    return Vec3(a.momentum + b.momentum + a.mass * a.x.cross(a.v) + b.mass * b.x.cross(b.v));
  };
  const Vec3 p = linear(), l = angular();
  for (int i = 0; i < 4000; ++i) scene.step(5e-5);
  EXPECT_GT(scene.ledger.friction, 0);
  EXPECT_LT((linear() - p).norm(), 1e-12);
  EXPECT_LT((angular() - l).norm(), 1e-12 * l.norm());
}

TEST(ContactLaw, sphere_sliding_on_a_plane_starts_to_roll_at_5_7_of_its_speed) {
  const double mu = 0.3, g = 9.81, v0 = 2;
  Body b = sphere(0, v0);
  b.gravity = {0, 0, -g};
  Scene scene{nullptr, &b, {1e6, 5e5, 0, 200, mu}};
  b.x.z() = 0.5 - g / 1e6;  // resting
  scene.forces(0);
  const double end = 2 * v0 / (7 * mu * g), dt = 2e-5;
  for (double t = 0; t < 0.95 * end; t += dt) scene.step(dt);
  EXPECT_NEAR(b.v.x(), v0 - mu * g * 0.95 * end, 1e-3);
  for (double t = 0; t < 0.3 * end; t += dt) scene.step(dt);
  EXPECT_NEAR(b.v.x(), 5.0 / 7.0 * v0, 1e-4);
  EXPECT_NEAR(b.spin().y() * 0.5, b.v.x(), 1e-3);
  const double lost = 0.5 * v0 * v0 * 2.0 / 7.0;
  EXPECT_NEAR(scene.ledger.friction, lost, 1e-3 * lost);
}

struct Residual {
  double largest, dissipated;
};

// A tilted, spinning triaxial ellipsoid dropped on a rough plane: bounces, slides, rolls.
Residual tumbling_residual(double dt, const ContactCoefficients& law) {
  Body b;
  b.axes = {0.04, 0.03, 0.022};
  b.mass = 0.3;
  b.q = Quat(0.8, 0.3, -0.5, 0.2).normalized();
  b.x = {0, 0, 0.0391};
  b.v = {0.4, -0.2, -0.3};
  b.set_spin({8, -5, 12});
  b.gravity = {0, 0, -9.81};
  Scene scene{nullptr, &b, law};
  scene.forces(0);
  const double before = scene.total();
  Residual r{0, 0};
  const int steps = static_cast<int>(std::round(0.1 / dt));
  for (int i = 0; i < steps; ++i) {
    scene.step(dt);
    r.largest = std::max(r.largest, std::abs(scene.total() - before));
  }
  r.dissipated = scene.ledger.damping + scene.ledger.friction;
  return r;
}

void expect_second_order_ledger(const ContactCoefficients& law, double dt, double bound) {
  std::vector<double> steps, errors;
  Residual r{};
  for (int k = 0; k < 4; ++k, dt *= 0.5) {
    double worst = 0;  // over where in a step the contacts begin and end
    for (int phase = 0; phase < 4; ++phase) {
      r = tumbling_residual(dt * (1 + 0.01 * phase), law);
      worst = std::max(worst, r.largest);
    }
    steps.push_back(dt);
    errors.push_back(worst);
  }
  const double order = slope(steps, errors);
  std::printf("  ledger: order %.2f, residual %.2e .. %.2e of %.3e dissipated\n", order,
              errors.front() / r.dissipated, errors.back() / r.dissipated, r.dissipated);
  EXPECT_GT(order, 1.7);
  EXPECT_LT(errors.back(), bound * r.dissipated);
}

TEST(ContactLaw, ledger_friction_only) {
  expect_second_order_ledger({1e5, 5e4, 0, 0, 0.3}, 2e-5, 1e-3);
}
TEST(ContactLaw, ledger_light_damping) {
  expect_second_order_ledger({1e5, 5e4, 20, 5, 0.3}, 2e-5, 1e-3);
}
TEST(ContactLaw, ledger_damping_ten_times_critical) {
  const double cn = 10 * 2 * std::sqrt(1e5 * 0.3);
  expect_second_order_ledger({1e5, 1e4, cn, 0, 0.3}, 4e-5, 1e-3);
}
TEST(ContactLaw, ledger_rolling_without_sliding) {
  expect_second_order_ledger({1e5, 5e4, 100, 20, 5.0}, 2e-5, 1e-3);
}

TEST(ContactLaw, spring_follows_a_rigid_turn_of_the_pair) {
  // Both bodies turn together as one rigid body: the spring must turn with them.
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  for (int trial = 0; trial < 20; ++trial) {
    const auto vector = [&] { return Vec3(normal(random), normal(random), normal(random)); };
    const Vec3 turn = vector();
    Body a = sphere(0, 0), b = sphere(0.99, 0);
    Scene scene{&a, &b, {1e3, 1e3, 0, 0, 1e3}};
    scene.forces(0);
    const Vec3 spring0(0, 1e-3, 2e-3);
    Eigen::Map<Vec3>{scene.state.spring} = spring0;
    const double dt = 1e-3;
    const int steps = 1000;
    for (int i = 1; i <= steps; ++i) {
      const Quat r(Eigen::AngleAxisd(i * dt * turn.norm(), turn.normalized()));
      const Vec3 x = r * Vec3(0.99, 0, 0);
      b.v = (x - b.x) / dt;
      b.x = x;
      a.set_spin(turn);
      b.set_spin(turn);
      scene.forces(dt);
    }
    const Quat r(Eigen::AngleAxisd(steps * dt * turn.norm(), turn.normalized()));
    EXPECT_LT((Vec3(scene.state.spring) - r * spring0).norm(),
              5e-5 * spring0.norm() * (1 + std::pow(turn.norm(), 3)));
  }
}

TEST(ContactLaw, force_stays_in_the_cone_and_never_attracts) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  const auto vector = [&] { return Vec3(normal(random), normal(random), normal(random)); };
  for (int trial = 0; trial < 10000; ++trial) {
    ContactState state{};
    EnergyLedger ledger;
    const ContactCoefficients law{1e3, 5e2, 30 * std::abs(normal(random)), 30 * std::abs(normal(random)),
                                  0.5};
    BodyMotion a, b;
    for (BodyMotion* m : {&a, &b}) {
      m->velocity = vector();
      m->spin = m->spin_before = vector();
      m->inverse_mass = 1;
      m->inverse_inertia = 5 * Mat3::Identity();
    }
    for (int step = 0; step < 3; ++step) {
      const Vec3 n = vector().normalized();
      const ContactGeometry g{0.01 * std::abs(normal(random)), n, 0.5 * n, -0.5 * n};
      ASSERT_TRUE(advance_contact(law, g, a, b, 1e-3, state, ledger));
      const Vec3 ft(state.tangential_force), xi(state.spring);
      EXPECT_GE(state.normal_force, 0);
      EXPECT_LE(ft.norm(), law.mu * state.normal_force * (1 + 1e-12) + 1e-14);
      EXPECT_LT(std::abs(ft.dot(n)), 1e-12 * (1 + ft.norm()));
      EXPECT_LT(std::abs(xi.dot(n)), 1e-12);
    }
  }
}

TEST(ContactLaw, numbers_that_are_not_finite_leave_no_force_and_no_state) {
  ContactState state{};
  EnergyLedger ledger;
  BodyMotion b;
  b.velocity = {0, 0, -std::numeric_limits<double>::infinity()};
  b.inverse_mass = 1;
  const ContactGeometry g{1e-3, Vec3::UnitZ(), Vec3::Zero(), -Vec3::UnitZ()};
  EXPECT_FALSE(advance_contact({1e3, 1e3, 1, 1, 0.5}, g, BodyMotion{}, b, 1e-3, state, ledger));
  EXPECT_EQ(state.active, 0);
  EXPECT_EQ(ledger.damping, 0);
  ContactGeometry bad = g;
  bad.overlap = std::numeric_limits<double>::quiet_NaN();
  b.velocity = {0, 0, -1};
  EXPECT_FALSE(advance_contact({1e3, 1e3, 1, 1, 0.5}, bad, BodyMotion{}, b, 1e-3, state, ledger));
  EXPECT_EQ(state.active, 0);
}

TEST(ContactLaw, resolved_step_names_the_stricter_of_stiffness_and_damping) {
  EXPECT_NEAR(resolved_time_step({1e4, 0, 0, 0, 0}, 1), 0.1 * 2 * M_PI / 100, 1e-12);
  EXPECT_NEAR(resolved_time_step({1e4, 0, 1e4, 0, 0}, 1), 1e-4, 1e-15);
}

}  // namespace
}  // namespace nurbs::test_contact_law

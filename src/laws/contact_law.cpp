#include "laws/contact_law.h"

#include <algorithm>
#include <cmath>

namespace nurbs {
namespace {

constexpr double kPi = 3.14159265358979323846;

using ConstMap = Eigen::Map<const Vec3>;
Vec3 load(const double (&v)[3]) {
  return ConstMap(v);
}
void store(const Vec3& from, double (&to)[3]) {
  Eigen::Map<Vec3>{to} = from;
}

// Velocity of B relative to A at the contact point.
Vec3 relative_velocity(const BodyMotion& a, const BodyMotion& b, const Vec3& arm_a, const Vec3& arm_b) {
  return b.velocity - a.velocity + b.spin.cross(arm_b) - a.spin.cross(arm_a);
}
// The same momenta seen in the orientations and at the contact point of the last step.
Vec3 earlier_velocity(const BodyMotion& a, const BodyMotion& b, const ContactState& state) {
  return b.velocity - a.velocity + b.spin_before.cross(load(state.arm_b)) -
         a.spin_before.cross(load(state.arm_a));
}

Vec3 across(const Vec3& v, const Vec3& normal) {
  return v - normal.dot(v) * normal;
}

// Acceleration of the contact point per unit force along `d`.
double compliance_along(const BodyMotion& body, const Vec3& arm, const Vec3& d) {
  const Vec3 lever = arm.cross(d);
  return body.inverse_mass + lever.dot(body.inverse_inertia * lever);
}
double compliance_trace(const BodyMotion& body, const Vec3& arm) {
  return 3 * body.inverse_mass + arm.squaredNorm() * body.inverse_inertia.trace() -
         arm.dot(body.inverse_inertia * arm);
}
struct Compliance {
  double normal, tangential;  // tangential: mean over the tangent plane
};
Compliance compliance(const BodyMotion& a, const BodyMotion& b, const ContactGeometry& g) {
  const double along = compliance_along(a, g.arm_a, g.normal) + compliance_along(b, g.arm_b, g.normal);
  const double trace = compliance_trace(a, g.arm_a) + compliance_trace(b, g.arm_b);
  return {along, 0.5 * (trace - along)};
}

// Carries a vector tangent at unit `from` to the tangent plane at unit `to` by the smallest rotation, keeping
// its length. Opposite normals have no smallest rotation: the vector is dropped.
Vec3 carry(const Vec3& t, const Vec3& from, const Vec3& to) {
  const double cosine = from.dot(to);
  if (cosine < -0.5) return Vec3::Zero();
  return t - (t.dot(to) / (1 + cosine)) * (from + to);
}
Vec3 twist(const Vec3& t, const Vec3& normal, double angle) {
  return std::cos(angle) * t + std::sin(angle) * normal.cross(t);
}

// Relative motion at n - 1/2, seen from the middle of the step and carried to the tangent plane of step n,
// which turns by `angle` in a whole step.
struct Sliding {
  double rate;
  Vec3 slip;
};
Sliding midstep_motion(const ContactState& state, const ContactGeometry& g, const Vec3& now,
                       const Vec3& before, double angle) {
  if (state.active == 0) return {-g.normal.dot(now), across(now, g.normal)};
  const Vec3 middle = (load(state.normal) + g.normal).normalized();
  const Vec3 velocity = 0.5 * (now + before);
  return {-middle.dot(velocity),
          twist(carry(across(velocity, middle), middle, g.normal), g.normal, 0.5 * angle)};
}

// A contact that begins inside a step: the share of the step it lasted, and the share of the kick (from n -
// 1/2 to n + 1/2) that a force present at once should carry.
struct Onset {
  double share = 1, kick = 1;
};
Onset onset(const ContactState& state, double overlap, double rate, double dt) {
  if (state.active != 0 || rate <= 0) return {};
  const double share = overlap / (rate * dt);
  if (share > 1.5) return {};  // placed in overlap, not moved into it
  return {std::min(share, 1.0), 0.5 + std::min(share, 1.0)};
}

struct NormalForce {
  double total, damping;
};
// kn overlap + cn (rate + lag (rest - total c)), clipped at zero.
NormalForce normal_force(const ContactCoefficients& law, double cn, double overlap, double rate, double lag,
                         double rest, double c) {
  const double spring = law.kn * overlap;
  if (cn == 0) return {spring, 0};
  const double total = (spring + cn * (rate + lag * rest)) / (1 + cn * c * lag);
  if (total < 0) return {0, -spring};
  return {total, total - spring};
}

struct TangentialForce {
  Vec3 total = Vec3::Zero(), spring = Vec3::Zero();
  bool slides = false;
};
// -(kt spring + ct slip_n) with slip_n = foreseen + lag c total, returned to |total| <= cone by shortening
// the spring.
TangentialForce tangential_force(const ContactCoefficients& law, double ct, double cone, const Vec3& spring,
                                 const Vec3& foreseen, double lag, double c) {
  const double implicit = 1 + ct * c * lag;
  const Vec3 elastic = law.kt / implicit * spring, viscous = ct / implicit * foreseen;
  const Vec3 trial = -(elastic + viscous);
  if (trial.squaredNorm() <= cone * cone) return {trial, spring, false};
  if (viscous.squaredNorm() >= cone * cone) {
    const double length = viscous.norm();
    return {length > 0 ? Vec3(-(cone / length) * viscous) : Vec3::Zero(), Vec3::Zero(), true};
  }
  // |s elastic + viscous| = cone has one root in (0, 1).
  const double a2 = elastic.squaredNorm(), half_b = elastic.dot(viscous);
  const double under = half_b * half_b - a2 * (viscous.squaredNorm() - cone * cone);
  const double s = (std::sqrt(under) - half_b) / a2;
  return {-(s * elastic + viscous), s * spring, true};
}

// Viscous part of a stored tangential force; exactly zero without ct.
Vec3 viscous_force(const ContactCoefficients& law, const ContactState& state) {
  if (law.ct == 0) return Vec3::Zero();
  return load(state.tangential_force) + law.kt * load(state.spring);
}

// What the dissipative forces of the last step did over the half kick that followed it (velocities `before`
// are the later ones), less what was counted ahead. Across the normal: friction if the contact slid, else
// damping.
struct HalfWork {
  double normal = 0, tangential = 0;
};
HalfWork later_half(const ContactCoefficients& law, const ContactState& state, const Vec3& before,
                    double dt) {
  const Vec3 normal = load(state.normal), viscous = viscous_force(law, state);
  const double rate = -normal.dot(before);
  HalfWork work{0.5 * dt * state.damping_force * rate - state.normal_correction,
                -0.5 * dt * viscous.dot(before) - state.tangential_correction};
  if (state.dt == 0) {  // the kick began at the last step itself, not half a step before
    work.normal += 0.25 * dt * state.damping_force * (state.rate - rate);
    work.tangential -= 0.25 * dt * viscous.dot(load(state.slip) - across(before, normal));
  }
  return work;
}
void add_work(const HalfWork& work, double sliding, EnergyLedger& ledger) {
  ledger.damping += work.normal;
  (sliding != 0 ? ledger.friction : ledger.damping) += work.tangential;
}

void store_geometry(const ContactGeometry& g, ContactState& state) {
  state.active = 1;
  state.overlap = g.overlap;
  store(g.normal, state.normal);
  store(g.arm_a, state.arm_a);
  store(g.arm_b, state.arm_b);
}

bool finite(const ContactState& state) {
  double sum = state.normal_force + state.overlap + state.rate;
  for (int k = 0; k < 3; ++k)
    sum += state.tangential_force[k] + state.arm_a[k] + state.arm_b[k] + state.normal[k];
  return std::isfinite(sum);
}

}  // namespace

BodyMotion body_motion(const Vec3& velocity, const Vec3& spin, double mass, const Vec3& principal_inertia,
                       const Mat3& axes, double dt) {
  // Euler: I dw/dt = -w x I w, in principal axes.
  const Vec3 w = axes.transpose() * spin, inverse = principal_inertia.cwiseInverse();
  const Vec3 before = w + dt * inverse.cwiseProduct(w.cross(principal_inertia.cwiseProduct(w)));
  return {velocity, spin, axes * before, 1 / mass, axes * inverse.asDiagonal() * axes.transpose()};
}

ContactGeometry pair_geometry(const ContactResult& result, const Vec3& separation) {
  const Vec3 point = 0.5 * (result.point_a + result.point_b);
  return {-result.gap, result.normal, point, point - separation};
}

ContactGeometry wall_geometry(const ContactResult& result, const Vec3& separation) {
  const Vec3 point = 0.5 * (result.point_a + result.point_b);
  return {-result.gap, result.normal, point + separation, point};
}

bool advance_contact(const ContactCoefficients& law, const ContactGeometry& g, const BodyMotion& a,
                     const BodyMotion& b, double dt, ContactState& state, EnergyLedger& ledger) {
  const bool active = state.active != 0;
  const double lag = 0.5 * dt, interval = 0.5 * (state.dt + dt);
  const Vec3 now = relative_velocity(a, b, g.arm_a, g.arm_b);
  const Vec3 before = active ? earlier_velocity(a, b, state) : now;
  const double angle = 0.25 * dt * g.normal.dot(a.spin + a.spin_before + b.spin + b.spin_before);
  const Sliding motion = midstep_motion(state, g, now, before, angle);
  const Onset start = onset(state, g.overlap, motion.rate, dt);
  const Compliance c = compliance(a, b, g);
  EnergyLedger work;
  if (active) add_work(later_half(law, state, before, dt), state.sliding, work);

  const double rest = active ? (motion.rate - state.rate) / interval + c.normal * state.normal_force : 0;
  const NormalForce fn = normal_force(law, start.kick * law.cn, g.overlap, motion.rate, lag, rest, c.normal);

  const Vec3 old_normal = active ? load(state.normal) : g.normal;
  const Vec3 carried = twist(carry(load(state.spring), old_normal, g.normal), g.normal, angle);
  Vec3 foreseen = motion.slip;
  if (active && law.ct > 0) {
    const Vec3 slip = twist(carry(load(state.slip), old_normal, g.normal), g.normal, angle);
    const Vec3 force = twist(carry(load(state.tangential_force), old_normal, g.normal), g.normal, angle);
    foreseen += lag * ((motion.slip - slip) / interval - c.tangential * force);
  }
  const TangentialForce ft =
      tangential_force(law, start.kick * law.ct, law.mu * fn.total, carried + start.share * dt * motion.slip,
                       foreseen, lag, c.tangential);

  if (ft.slides)  // mean spring force times the motion that did not load the spring
    work.friction += 0.5 * law.kt * (carried + ft.spring).dot(carried + dt * motion.slip - ft.spring);

  store_geometry(g, state);
  state.dt = dt;
  state.rate = motion.rate;
  store(motion.slip, state.slip);
  state.normal_force = fn.total;
  state.damping_force = fn.damping;
  store(ft.total, state.tangential_force);
  store(ft.spring, state.spring);
  state.sliding = ft.slides;

  const Vec3 viscous = viscous_force(law, state);
  const Vec3 slip_change = foreseen + lag * c.tangential * ft.total - motion.slip;
  state.normal_correction = 0.5 * lag * lag * fn.damping * (rest - c.normal * fn.total);
  state.tangential_correction = -0.5 * lag * viscous.dot(slip_change);
  add_work({-lag * fn.damping * g.normal.dot(now) + state.normal_correction,
            -lag * viscous.dot(now) + state.tangential_correction},
           state.sliding, work);

  if (!finite(state) || !std::isfinite(work.damping + work.friction)) {
    state = ContactState{};
    return false;
  }
  ledger.add(work, 1);
  const EnergyLedger stored = stored_energy(law, state);
  ledger.normal_spring = stored.normal_spring;
  ledger.tangential_spring = stored.tangential_spring;
  return true;
}

bool set_contact(const ContactCoefficients& law, const ContactGeometry& g, const BodyMotion& a,
                 const BodyMotion& b, ContactState& state) {
  const Vec3 old_normal = state.active != 0 ? load(state.normal) : g.normal;
  const Vec3 velocity = relative_velocity(a, b, g.arm_a, g.arm_b);
  const double rate = -g.normal.dot(velocity);
  const Vec3 slip = across(velocity, g.normal);
  const NormalForce fn = normal_force(law, law.cn, g.overlap, rate, 0, 0, 0);
  const TangentialForce ft = tangential_force(law, law.ct, law.mu * fn.total,
                                              carry(load(state.spring), old_normal, g.normal), slip, 0, 0);
  store_geometry(g, state);
  state.dt = 0;
  state.rate = rate;
  store(slip, state.slip);
  state.normal_force = fn.total;
  state.damping_force = fn.damping;
  store(ft.total, state.tangential_force);
  store(ft.spring, state.spring);
  state.sliding = ft.slides;
  state.normal_correction = state.tangential_correction = 0;
  if (finite(state)) return true;
  state = ContactState{};
  return false;
}

void end_contact(const ContactCoefficients& law, const BodyMotion& a, const BodyMotion& b, double dt,
                 ContactState& state, EnergyLedger& ledger) {
  if (state.active == 0) return;
  const Vec3 before = earlier_velocity(a, b, state), spring = load(state.spring);
  EnergyLedger work;
  add_work(later_half(law, state, before, dt), state.sliding, work);
  work.friction += 0.5 * law.kt * spring.dot(spring + dt * across(before, load(state.normal)));
  state = ContactState{};
  if (std::isfinite(work.damping + work.friction)) ledger.add(work, 1);
}

EnergyLedger stored_energy(const ContactCoefficients& law, const ContactState& state) {
  EnergyLedger energy;
  if (state.active == 0) return energy;
  energy.normal_spring = 0.5 * law.kn * state.overlap * state.overlap;
  energy.tangential_spring = 0.5 * law.kt * load(state.spring).squaredNorm();
  return energy;
}

bool same_geometry(const ContactState& state, const ContactGeometry& g, double tolerance) {
  const Vec3 separation = load(state.arm_a) - load(state.arm_b);
  return state.active != 0 && std::abs(state.overlap - g.overlap) <= tolerance &&
         (separation - (g.arm_a - g.arm_b)).norm() <= tolerance;
}

Vec3 force_on_b(const ContactState& state) {
  return state.normal_force * load(state.normal) + load(state.tangential_force);
}

double resolved_time_step(const ContactCoefficients& law, double mass) {
  const double tangential_mass = 2.0 / 7.0 * mass;
  double step = 0.1 * 2 * kPi * std::sqrt(mass / law.kn);
  if (law.mu > 0 && law.kt > 0) step = std::min(step, 0.1 * 2 * kPi * std::sqrt(tangential_mass / law.kt));
  if (law.cn > 0) step = std::min(step, mass / law.cn);
  if (law.mu > 0 && law.ct > 0) step = std::min(step, tangential_mass / law.ct);
  return step;
}

}  // namespace nurbs

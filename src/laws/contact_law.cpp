#include <algorithm>
#include <cmath>
#include <cstring>

#include "laws/linear_law.h"

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

BodyMotionOf<double> as_values(const BodyMotion& m) {
  const Mat3& i = m.inverse_inertia;
  return {triple(m.velocity),
          triple(m.spin),
          triple(m.spin_before),
          m.inverse_mass,
          i(0, 0),
          i(1, 1),
          i(2, 2),
          i(0, 1),
          i(0, 2),
          i(1, 2)};
}
LinearLawOf<double> as_values(const ContactCoefficients& law) {
  return {law.kn, law.kt, law.cn, law.ct, law.mu};
}
// Velocity of B relative to A with the same momenta, in the orientations and at the contact point of the last
// step.
Vec3 earlier_velocity(const BodyMotion& a, const BodyMotion& b, const ContactState& state) {
  return b.velocity - a.velocity + b.spin_before.cross(load(state.arm_b)) -
         a.spin_before.cross(load(state.arm_a));
}

ContactStateOf<double> as_values(const ContactState& state) {
  ContactStateOf<double> s;
  std::memcpy(&s, &state, sizeof s);
  return s;
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
  ContactStateOf<double> s = as_values(state);
  ContactWorkOf<double> work;
  advance_linear<double, true>(as_values(law),
                               {g.overlap, triple(g.normal), triple(g.arm_a), triple(g.arm_b)}, as_values(a),
                               as_values(b), dt, &s, &work);
  std::memcpy(&state, &s, sizeof s);
  if (!finite(state) || !std::isfinite(work.damping + work.friction)) {
    state = ContactState{};
    return false;
  }
  ledger.damping += work.damping;
  ledger.friction += work.friction;
  const EnergyLedger stored = stored_energy(law, state);
  ledger.normal_spring = stored.normal_spring;
  ledger.tangential_spring = stored.tangential_spring;
  return true;
}

bool set_contact(const ContactCoefficients& law, const ContactGeometry& g, const BodyMotion& a,
                 const BodyMotion& b, ContactState& state) {
  using namespace law_detail;
  const Triple<double> n = triple(g.normal), old_normal = state.active != 0 ? triple(state.normal) : n;
  const Vec3 velocity = b.velocity - a.velocity + b.spin.cross(g.arm_b) - a.spin.cross(g.arm_a);
  const double rate = -g.normal.dot(velocity), spring_force = law.kn * g.overlap;
  const Triple<double> slip = across(triple(velocity), n);
  const double normal_force = std::max(0.0, spring_force + law.cn * rate);
  const Friction<double> f = return_to_cone(
      law.mu * normal_force, Carry<double>(old_normal, n)(triple(state.spring)), law.kt, law.ct * slip);
  store_geometry(g, state);
  state.dt = 0;
  state.rate = rate;
  store(vec(slip), state.slip);
  state.normal_force = normal_force;
  state.damping_force = normal_force - spring_force;
  store(vec(f.force), state.tangential_force);
  store(vec(f.spring), state.spring);
  state.sliding = f.slides;
  state.normal_correction = state.tangential_correction = 0;
  if (finite(state)) return true;
  state = ContactState{};
  return false;
}

void finish_contact(const ContactCoefficients& law, const BodyMotion& a, const BodyMotion& b, double dt,
                    const ContactState& state, EnergyLedger& ledger) {
  if (state.active == 0) return;
  ContactWorkOf<double> work{};
  law_detail::add_work(
      law_detail::later_half(as_values(law), as_values(state), triple(earlier_velocity(a, b, state)), dt),
      state.sliding, &work);
  if (!std::isfinite(work.damping + work.friction)) return;
  ledger.damping += work.damping;
  ledger.friction += work.friction;
}

void end_contact(const ContactCoefficients& law, const BodyMotion& a, const BodyMotion& b, double dt,
                 ContactState& state, EnergyLedger& ledger) {
  if (state.active == 0) return;
  finish_contact(law, a, b, dt, state, ledger);
  const Vec3 before = earlier_velocity(a, b, state), spring = load(state.spring), normal = load(state.normal);
  const double lost = 0.5 * law.kt * spring.dot(spring + dt * (before - normal.dot(before) * normal));
  state = ContactState{};
  if (std::isfinite(lost)) ledger.friction += lost;
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

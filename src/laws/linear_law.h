// The linear law of contact_law.h as a kernel: one step of one contact, or of several side by side. Plain
// arithmetic on values; lanes in which nothing touches may hold anything, and their results are not used.
#pragma once

#include "laws/contact_law.h"
#include "nurbs/wide.h"

namespace nurbs {

template <class Real>
struct LinearLawOf {
  Real kn, kt, cn, ct, mu;
};

// BodyMotion; the inverse inertia by its six numbers.
template <class Real>
struct BodyMotionOf {
  Triple<Real> velocity, spin, spin_before;
  Real inverse_mass;
  Real xx, yy, zz, xy, xz, yz;

  NURBS_INLINE Triple<Real> inverse_inertia(const Triple<Real>& v) const {
    return {xx * v.x + xy * v.y + xz * v.z, xy * v.x + yy * v.y + yz * v.z, xz * v.x + yz * v.y + zz * v.z};
  }
};

template <class Real>
struct ContactGeometryOf {
  Real overlap;
  Triple<Real> normal, arm_a, arm_b;
};

// ContactState, field by field.
template <class Real>
struct ContactStateOf {
  Real active, dt, overlap;
  Triple<Real> normal, arm_a, arm_b;
  Real rate;
  Triple<Real> slip;
  Real normal_force;
  Triple<Real> tangential_force, spring;
  Real damping_force, sliding, normal_correction, tangential_correction;
};
static_assert(sizeof(ContactStateOf<double>) == sizeof(ContactState));

// Dissipated in one step.
template <class Real>
struct ContactWorkOf {
  Real damping, friction;
};

namespace law_detail {

// Velocity of B relative to A at a point with these arms.
template <class Real>
NURBS_INLINE Triple<Real> relative_velocity(const Triple<Real>& velocity, const Triple<Real>& spin_a,
                                            const Triple<Real>& arm_a, const Triple<Real>& spin_b,
                                            const Triple<Real>& arm_b) {
  return velocity + cross(spin_b, arm_b) - cross(spin_a, arm_a);
}
template <class Real>
NURBS_INLINE Triple<Real> across(const Triple<Real>& v, const Triple<Real>& normal) {
  return v - dot(normal, v) * normal;
}

// Carries vectors tangent at unit `from` to the tangent plane at unit `to` by the smallest rotation, keeping
// their length. Opposite normals have no smallest rotation: the vector is dropped.
template <class Real>
struct Carry {
  Triple<Real> to, sum;
  Real factor;
  Mask<Real> possible;
  NURBS_INLINE Carry(const Triple<Real>& from, const Triple<Real>& target) : to(target), sum(from + target) {
    const Real cosine = dot(from, target);
    possible = cosine >= -0.5;
    factor = 1.0 / (1.0 + cosine);
  }
  NURBS_INLINE Triple<Real> operator()(const Triple<Real>& t) const {
    const Triple<Real> carried = t - (factor * dot(t, to)) * sum;
    return select<Real>(possible, carried, Triple<Real>{});
  }
};

// Rotation about the normal. Rational in h = tan(angle / 2), so that lengths are kept whatever the angle; the
// series of h is exact to 1e-12 below a tenth of a radian.
template <class Real>
struct Twist {
  Triple<Real> normal;
  Real cosine, sine;
  NURBS_INLINE Twist(const Triple<Real>& n, const Real& angle) : normal(n) {
    const Real y = 0.5 * angle, y2 = y * y;
    const Real h = y * (1.0 + y2 * (1.0 / 3 + y2 * (2.0 / 15 + y2 * (17.0 / 315)))), h2 = h * h;
    const Real r = 1.0 / (1.0 + h2);
    cosine = (1.0 - h2) * r;
    sine = 2.0 * h * r;
  }
  NURBS_INLINE Twist twice() const {
    Twist t = *this;
    t.cosine = cosine * cosine - sine * sine;
    t.sine = 2.0 * sine * cosine;
    return t;
  }
  NURBS_INLINE Triple<Real> operator()(const Triple<Real>& t) const {
    return cosine * t + sine * cross(normal, t);
  }
};

template <class Real>
NURBS_INLINE Real compliance_along(const BodyMotionOf<Real>& body, const Triple<Real>& arm,
                                   const Triple<Real>& d) {
  const Triple<Real> lever = cross(arm, d);
  return body.inverse_mass + dot(lever, body.inverse_inertia(lever));
}
template <class Real>
NURBS_INLINE Real compliance_trace(const BodyMotionOf<Real>& body, const Triple<Real>& arm) {
  return 3.0 * body.inverse_mass + dot(arm, arm) * (body.xx + body.yy + body.zz) -
         dot(arm, body.inverse_inertia(arm));
}

// Viscous part of a stored tangential force; exactly zero without ct.
template <class Real>
NURBS_INLINE Triple<Real> viscous_force(const LinearLawOf<Real>& law, const Triple<Real>& force,
                                        const Triple<Real>& spring) {
  return select<Real>(law.ct == 0.0, Triple<Real>{}, force + law.kt * spring);
}

template <class Real>
struct HalfWork {
  Real normal, tangential;
};
// What the dissipative forces of the last step did over the half kick that followed it (velocities `before`
// are the later ones), less what was counted ahead.
template <class Real>
NURBS_INLINE HalfWork<Real> later_half(const LinearLawOf<Real>& law, const ContactStateOf<Real>& s,
                                       const Triple<Real>& before, double dt) {
  const Triple<Real> viscous = viscous_force(law, s.tangential_force, s.spring);
  const Real rate = -dot(s.normal, before);
  HalfWork<Real> work{0.5 * dt * s.damping_force * rate - s.normal_correction,
                      -0.5 * dt * dot(viscous, before) - s.tangential_correction};
  // At the start of a run the kick began at the last step itself, not half a step before.
  const Mask<Real> whole = s.dt == 0.0;
  const Real normal = work.normal + 0.25 * dt * s.damping_force * (s.rate - rate);
  const Real tangential = work.tangential - 0.25 * dt * dot(viscous, s.slip - across(before, s.normal));
  return {select(whole, normal, work.normal), select(whole, tangential, work.tangential)};
}

// Across the normal: friction if the contact slid, else damping.
template <class Real>
NURBS_INLINE void add_work(const HalfWork<Real>& work, const Real& sliding, ContactWorkOf<Real>* to) {
  const Mask<Real> slid = sliding != 0.0;
  to->damping = to->damping + work.normal + select(slid, Real{}, work.tangential);
  to->friction = to->friction + select(slid, work.tangential, Real{});
}

template <class Real>
struct Friction {
  Triple<Real> force, spring;
  Mask<Real> slides;
};
// -(stiffness spring + viscous), returned to length <= cone by shortening the spring.
template <class Real>
NURBS_INLINE Friction<Real> return_to_cone(const Real& cone, const Triple<Real>& spring,
                                           const Real& stiffness, const Triple<Real>& viscous) {
  const Real zero{}, one = all<Real>(1), cone2 = cone * cone;
  const Triple<Real> elastic = stiffness * spring, trial = elastic + viscous;
  const Real viscous2 = dot(viscous, viscous), elastic2 = dot(elastic, elastic),
             half_b = dot(elastic, viscous);
  const Mask<Real> slides = dot(trial, trial) > cone2, no_spring = viscous2 >= cone2;
  // |keep elastic + viscous| = cone has one root in (0, 1).
  const Real under = larger(half_b * half_b - elastic2 * (viscous2 - cone2), zero);
  const Real root_of = (root(under) - half_b) / select(elastic2 > 0.0, elastic2, one);
  const Real keep = select(slides, select(no_spring, zero, root_of), one);
  const Real fast = select(viscous2 > 0.0, cone / root(select(viscous2 > 0.0, viscous2, one)), zero);
  const Real drag = select(slides & no_spring, fast, one);
  return {Triple<Real>{} - (keep * elastic + drag * viscous), keep * spring, slides};
}

}  // namespace law_detail

// One time step of touching contacts, see advance_contact. `Ledger`: whether the work is wanted; without it
// the motion is the same, the corrections in the state are not kept, and `work` is not written.
template <class Real, bool Ledger>
NURBS_INLINE void advance_linear(const LinearLawOf<Real>& law, const ContactGeometryOf<Real>& g,
                                 const BodyMotionOf<Real>& a, const BodyMotionOf<Real>& b, double dt,
                                 ContactStateOf<Real>* state, ContactWorkOf<Real>* work) {
  using namespace law_detail;
  using V = Triple<Real>;
  ContactStateOf<Real>& s = *state;
  const Mask<Real> active = s.active != 0.0;
  const double lag = 0.5 * dt;
  const Real zero{}, interval = 0.5 * (s.dt + dt);
  const V velocity = b.velocity - a.velocity;
  const V now = relative_velocity(velocity, a.spin, g.arm_a, b.spin, g.arm_b);
  // The same momenta seen in the orientations and at the contact point of the last step.
  const V earlier = relative_velocity(velocity, a.spin_before, s.arm_a, b.spin_before, s.arm_b);
  const V before = select<Real>(active, earlier, now), old_normal = select<Real>(active, s.normal, g.normal);
  const Real spins = dot(g.normal, a.spin + a.spin_before + b.spin + b.spin_before);
  const Twist<Real> half(g.normal, select(active, 0.125 * dt * spins, zero)), whole = half.twice();

  // Relative motion at n - 1/2, seen from the middle of the step and carried to the tangent plane of step n.
  const V sum = old_normal + g.normal;
  const V middle = (1.0 / root(dot(sum, sum))) * sum, mean = all<Real>(0.5) * (now + before);
  const Real rate = -dot(middle, mean);
  const V slip = half(Carry<Real>(middle, g.normal)(across(mean, middle)));

  // A contact that begins inside a step: the share of the step it lasted, and the share of the kick (from n -
  // 1/2 to n + 1/2) that a force present at once should carry. Not for one placed in overlap.
  const Real lasted = g.overlap / (rate * dt);
  const Mask<Real> begins = (s.active == 0.0) & (rate > 0.0) & (lasted <= 1.5);
  const Real share = select(begins, smaller(lasted, all<Real>(1)), all<Real>(1));
  const Real kick = select(begins, 0.5 + share, all<Real>(1));

  const Real along = compliance_along(a, g.arm_a, g.normal) + compliance_along(b, g.arm_b, g.normal);
  const Real mean_across = 0.5 * (compliance_trace(a, g.arm_a) + compliance_trace(b, g.arm_b) - along);
  if (Ledger) {
    *work = ContactWorkOf<Real>{};
    HalfWork<Real> later = later_half(law, s, before, dt);
    later.normal = select(active, later.normal, zero);
    later.tangential = select(active, later.tangential, zero);
    add_work(later, s.sliding, work);
  }

  // kn overlap + cn (rate + lag (rest - total c)), clipped at zero.
  const Real rest = select(active, (rate - s.rate) / interval + along * s.normal_force, zero);
  const Real cn = kick * law.cn, spring_force = law.kn * g.overlap;
  const Real damped = (spring_force + cn * (rate + lag * rest)) / (1.0 + cn * along * lag);
  const Real pull = select(cn == 0.0, spring_force, damped);  // nothing dissipated, to the last bit
  const Real normal_force = larger(pull, zero), damping_force = normal_force - spring_force;

  const Carry<Real> carry(old_normal, g.normal);
  const V carried = whole(carry(select<Real>(active, s.spring, V{})));
  V foreseen = slip;
  if (!none_of(law.ct > 0.0)) {
    const V force = whole(carry(s.tangential_force)), was = whole(carry(s.slip));
    foreseen =
        select<Real>(active, slip + (lag / interval) * (slip - was) - (lag * mean_across) * force, slip);
  }
  const Real ct = kick * law.ct, implicit = 1.0 / (1.0 + ct * mean_across * lag);
  const Friction<Real> f = return_to_cone(law.mu * normal_force, carried + (share * dt) * slip,
                                          law.kt * implicit, (ct * implicit) * foreseen);
  const V &force = f.force, &spring = f.spring;
  // Mean spring force times the motion that did not load the spring.
  if (Ledger)
    work->friction =
        work->friction +
        select(f.slides, 0.5 * law.kt * dot(carried + spring, carried + all<Real>(dt) * slip - spring), zero);

  s.active = all<Real>(1);
  s.dt = all<Real>(dt);
  s.overlap = g.overlap;
  s.normal = g.normal;
  s.arm_a = g.arm_a;
  s.arm_b = g.arm_b;
  s.rate = rate;
  s.slip = slip;
  s.normal_force = normal_force;
  s.damping_force = damping_force;
  s.tangential_force = force;
  s.spring = spring;
  s.sliding = select(f.slides, all<Real>(1), zero);
  if (Ledger) {
    const V drags = viscous_force(law, force, spring);
    const V slip_change = foreseen + (lag * mean_across) * force - slip;
    s.normal_correction = 0.5 * lag * lag * damping_force * (rest - along * normal_force);
    s.tangential_correction = -0.5 * lag * dot(drags, slip_change);
    add_work({-lag * damping_force * dot(g.normal, now) + s.normal_correction,
              -lag * dot(drags, now) + s.tangential_correction},
             s.sliding, work);
  } else {
    s.normal_correction = s.tangential_correction = zero;
  }
}

}  // namespace nurbs

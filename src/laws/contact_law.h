// The force law of one contact: penalty spring and damper along the normal, sliding spring and damper with a
// Coulomb cone across it (design, section 4), made for velocity Verlet, whose forces at step n see velocities
// of step n - 1/2, and the exact discrete work of its dissipative parts.
//
// Notation: A and B are the bodies in tag order (for a wall, A is the wall), `normal` points from A to B, the
// rate is d(overlap)/dt, the slip the tangential velocity of B relative to A at the contact point. Lab axes,
// consistent units. Nothing here throws, prints or allocates.
#pragma once

#include <type_traits>

#include "contact/contact.h"
#include "laws/energy_ledger.h"
#include "nurbs/types.h"

namespace nurbs {

struct ContactCoefficients {
  double kn = 0, kt = 0;  // normal and tangential stiffness, force / length
  double cn = 0, ct = 0;  // normal and tangential damping, force / velocity
  double mu = 0;          // friction coefficient
};

// One body as the force law sees it at step n. An immobile body is all zeros.
struct BodyMotion {
  Vec3 velocity = Vec3::Zero();  // of the centre of mass at n - 1/2
  Vec3 spin = Vec3::Zero();  // angular velocity of the momentum at n - 1/2 in the orientation of step n ...
  Vec3 spin_before = Vec3::Zero();  // ... and in that of step n - 1
  double inverse_mass = 0;
  Mat3 inverse_inertia = Mat3::Zero();
};

// A free body that turns about its centre of mass: `axes` turns principal axes into lab axes, `spin` is its
// angular velocity now. spin_before, the angular velocity `dt` ago under constant angular momentum, is right
// to dt^2.
BodyMotion body_motion(const Vec3& velocity, const Vec3& spin, double mass, const Vec3& principal_inertia,
                       const Mat3& axes, double dt);

struct ContactGeometry {
  double overlap = 0;          // > 0
  Vec3 normal = Vec3::Zero();  // unit, A to B
  Vec3 arm_a = Vec3::Zero();   // contact point (midpoint of the two) from A's centre of mass ...
  Vec3 arm_b = Vec3::Zero();   // ... and from B's
};

// `result` of find_contact; `separation` = centre of B - centre of A.
ContactGeometry pair_geometry(const ContactResult& result, const Vec3& separation);
// `result` of find_plane_contact, whose points are relative to the particle (B); `separation` = centre of B -
// a fixed point of the wall.
ContactGeometry wall_geometry(const ContactResult& result, const Vec3& separation);

// What a contact remembers from step to step; plain doubles, so that it lives in the host's contact history
// and crosses ranks and restarts. All zeros: no contact. Independent of the order in which the host lists the
// pair.
struct ContactState {
  double active;   // 1 in contact
  double dt;       // time step that led here; 0: the velocities were those of a whole step
  double overlap;  // geometry of this step, see ContactGeometry
  double normal[3];
  double arm_a[3], arm_b[3];
  double rate, slip[3];                             // half a step ago
  double normal_force;                              // on B along normal, >= 0
  double tangential_force[3];                       // on B
  double spring[3];                                 // tangential, in the tangent plane
  double damping_force;                             // the part of normal_force that is not kn overlap
  double sliding;                                   // 1 when tangential_force was returned to the cone
  double normal_correction, tangential_correction;  // work counted ahead, from half a step ago to this step
};
constexpr int kContactStateSize = 27;
static_assert(std::is_trivially_copyable_v<ContactState> &&
              sizeof(ContactState) == kContactStateSize * sizeof(double));

// One time step of a touching pair (geometry.overlap > 0): forces of step n into `state`, dissipation since
// step n - 1 added to `ledger`, whose spring energies are set to those of step n. False when a number was not
// finite: then the state is emptied and there is no force.
//
//   Fn = max(0, kn overlap + cn rate_n),   rate_n = rate_(n-1/2) + dt/2 (R - Fn / m)
//
// with 1/m the compliance of the two bodies along the normal and R the acceleration of the overlap by
// everything but this contact, taken from the last step: second order in dt, and for a lone contact the
// trapezoidal rule, stable for any cn. Where a contact begins inside a step, the jump of the damping force is
// weighted by the time it lasts, which keeps second order. Ft likewise, with the mean tangential compliance;
// the spring follows the tangent plane and the mean spin of the bodies about the normal, keeping its length,
// and is shortened to return to the cone |Ft| <= mu Fn.
bool advance_contact(const ContactCoefficients& law, const ContactGeometry& geometry, const BodyMotion& a,
                     const BodyMotion& b, double dt, ContactState& state, EnergyLedger& ledger);

// The same before the first step of a run, where velocities belong to the same instant as positions. A state
// that is already active keeps its spring; nothing is dissipated.
bool set_contact(const ContactCoefficients& law, const ContactGeometry& geometry, const BodyMotion& a,
                 const BodyMotion& b, ContactState& state);

// Closes a contact that has opened since the last step: finishes its dissipation and empties the state.
void end_contact(const ContactCoefficients& law, const BodyMotion& a, const BodyMotion& b, double dt,
                 ContactState& state, EnergyLedger& ledger);

// Finishes the dissipation of a contact up to now, as end_contact does, but leaves its spring: for one whose
// place is taken by others.
void finish_contact(const ContactCoefficients& law, const BodyMotion& a, const BodyMotion& b, double dt,
                    const ContactState& state, EnergyLedger& ledger);

// Coefficients of a contact that carries a share of a pair's stiffness.
inline ContactCoefficients scaled(const ContactCoefficients& law, double weight) {
  return {weight * law.kn, weight * law.kt, weight * law.cn, weight * law.ct, law.mu};
}

// Elastic energies of a state.
EnergyLedger stored_energy(const ContactCoefficients& law, const ContactState& state);

// Whether `geometry` is, within `tolerance` (length; overlap and distance of the centres), the one of
// `state`.
bool same_geometry(const ContactState& state, const ContactGeometry& geometry, double tolerance);

// Force on B (A gets the opposite), acting at the contact point.
Vec3 force_on_b(const ContactState& state);

// Largest time step that resolves a contact of reduced mass `mass`: a tenth of the shortest period, and cn dt
// <= mass; across the normal with 2/7 of the mass, as for a solid sphere.
double resolved_time_step(const ContactCoefficients& law, double mass);

}  // namespace nurbs

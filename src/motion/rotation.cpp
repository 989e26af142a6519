// Rotation of one rigid body.
#include "motion/rotation.h"

#include <cmath>

#include "motion/free_rotor.h"
#include "motion/rotor.h"

namespace nurbs {
namespace {

// The rotation by |vector| about `vector`; exact to round-off down to zero.
Quat rotation_by(const Vec3& vector) {
  const double angle = vector.norm();
  const double half = 0.5 * angle;
  // sin(half) / angle; below this its series 1/2 (1 - half^2 / 6) is 1/2 to round-off.
  const double factor = half < 1e-8 ? 0.5 : std::sin(half) / angle;
  Quat turn;
  turn.w() = std::cos(half);
  turn.vec() = factor * vector;
  return turn;
}

// q turns principal axes into lab axes.
void step_richardson(const Vec3& inertia, double dt, Quat& q, const Vec3& l_lab) {
  const auto turn_in_body = [&](const Quat& at, double time) {
    return rotation_by(time * Vec3((at.conjugate() * l_lab).cwiseQuotient(inertia)));
  };
  const Quat whole = q * turn_in_body(q, dt);
  Quat halves = q * turn_in_body(q, 0.5 * dt);
  halves = halves * turn_in_body(halves, 0.5 * dt);
  q.coeffs() = 2 * halves.coeffs() - whole.coeffs();
}

}  // namespace

void rotate_free(RotationScheme scheme, const Vec3& principal_inertia, const Quat& principal_axes, double dt,
                 Quat& q, const Vec3& angular_momentum) {
  if (scheme == RotationScheme::symplectic) {
    RotorBatch one;
    one.set_q(0, q);
    one.set_momentum(0, angular_momentum);
    drift(make_rotor(principal_inertia, principal_axes), dt, &one);
    q = one.get_q(0);
    return;
  }
  Quat principal = q * principal_axes;
  if (scheme == RotationScheme::richardson)
    step_richardson(principal_inertia, dt, principal, angular_momentum);
  else
    advance_free_rotor(principal_inertia, dt, principal, angular_momentum);
  q = principal * principal_axes.conjugate();
  q.normalize();
}

Vec3 angular_velocity(const Vec3& angular_momentum, const Quat& q, const Quat& principal_axes,
                      const Vec3& principal_inertia) {
  const Quat principal = q * principal_axes;
  return principal * Vec3((principal.conjugate() * angular_momentum).cwiseQuotient(principal_inertia));
}

Vec3 angular_momentum(const Vec3& angular_velocity, const Quat& q, const Quat& principal_axes,
                      const Vec3& principal_inertia) {
  const Quat principal = q * principal_axes;
  return principal * Vec3((principal.conjugate() * angular_velocity).cwiseProduct(principal_inertia));
}

double rotational_energy(const Vec3& angular_momentum, const Quat& q, const Quat& principal_axes,
                         const Vec3& principal_inertia) {
  const Quat principal = q * principal_axes;
  const Vec3 l = principal.conjugate() * angular_momentum;
  return 0.5 * l.dot(l.cwiseQuotient(principal_inertia));
}

}  // namespace nurbs

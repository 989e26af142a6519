// Rotation of one rigid body.
#include "motion/rotation.h"

#include <cmath>

#include "motion/free_rotor.h"

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

// Index of the intermediate of three values; of equal ones the lowest.
int intermediate(const Vec3& value) {
  for (int i = 0; i < 3; ++i) {
    const double next = value[(i + 1) % 3], last = value[(i + 2) % 3];
    if ((value[i] - next) * (value[i] - last) <= 0) return i;
  }
  return 0;
}

// Turns by dt along the flow of the energy excess * l_axis^2 / 2: a rotation about one principal axis.
void turn_about(int axis, double excess, double dt, Quat& q, const Vec3& l_lab) {
  const Vec3 l = q.conjugate() * l_lab;
  q = q * rotation_by(excess * l[axis] * dt * Vec3::Unit(axis));
}

// Here and below q turns principal axes into lab axes.
void step_symplectic(const Vec3& inertia, double dt, Quat& q, const Vec3& l_lab) {
  const Vec3 inverse = inertia.cwiseInverse();
  const int middle = intermediate(inertia);
  const int first = (middle + 1) % 3, second = (middle + 2) % 3;
  const Vec3 excess = inverse - Vec3::Constant(inverse[middle]);
  turn_about(first, excess[first], 0.5 * dt, q, l_lab);
  turn_about(second, excess[second], dt, q, l_lab);
  turn_about(first, excess[first], 0.5 * dt, q, l_lab);
  q = rotation_by(inverse[middle] * dt * l_lab) * q;
}

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
  Quat principal = q * principal_axes;
  switch (scheme) {
    case RotationScheme::symplectic:
      step_symplectic(principal_inertia, dt, principal, angular_momentum);
      break;
    case RotationScheme::richardson:
      step_richardson(principal_inertia, dt, principal, angular_momentum);
      break;
    case RotationScheme::exact:
      advance_free_rotor(principal_inertia, dt, principal, angular_momentum);
      break;
  }
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

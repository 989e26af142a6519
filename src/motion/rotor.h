// Rotation of many rigid bodies a step, the symplectic way: what depends on the shape alone is kept in a
// Rotor, made once per shape, and bodies of one shape are turned side by side.
//
// Frames: `q` turns shape axes into lab axes; angular momentum and velocity are in lab axes. The moments of
// inertia of a body are `size` times those its Rotor was made from: size = mass * scale^2 for a Rotor made
// from Shape::principal_gyration. Units are the caller's, consistent. Nothing throws.
#pragma once

#include "nurbs/types.h"

namespace nurbs {

// Principal moments, as inverses, their axes ordered for the splitting. The kinetic energy of angular
// momentum l along these axes is (middle * |l|^2 + first * l0^2 + second * l1^2) / (2 * size).
struct Rotor {
  enum class Kind {
    sphere,  // all moments equal: first = second = 0
    top,     // two equal: first = 0
    asymmetric,
  };
  Kind kind = Kind::sphere;
  double middle = 0;             // 1 / the intermediate moment; of a top, 1 / the two equal ones
  double first = 0, second = 0;  // 1 / the two other moments, less `middle`
  Mat3 axes = Mat3::Identity();  // columns: axes of first, second, middle, in shape axes; right-handed
};

// `moments` > 0, any order, about the axes that `principal_axes` turns the shape's into. Moments that agree
// to 1e-13, a shape's round-off, count as equal: an error of at most 1e-13 of the angle turned through.
Rotor make_rotor(const Vec3& moments, const Quat& principal_axes);

// Bodies of one Rotor side by side. Lanes in use hold valid numbers; the others may hold any, and are best
// left as they were.
struct RotorBatch {
  static constexpr int kBodies = 8;

  RotorBatch();  // all at rest, unit size, unturned
  void set_q(int lane, const Quat& to);
  void set_momentum(int lane, const Vec3& to);
  Quat get_q(int lane) const { return {q[0][lane], q[1][lane], q[2][lane], q[3][lane]}; }
  Vec3 get_velocity(int lane) const { return {velocity[0][lane], velocity[1][lane], velocity[2][lane]}; }

  alignas(64) double q[4][kBodies];  // w, x, y, z
  double momentum[3][kBodies];
  double velocity[3][kBodies];  // output: angular velocity at the end
  double inverse_size[kBodies];
};

// Turns free bodies by dt at constant angular momentum, and finds their angular velocities at the end. The
// splitting is that of RotationScheme::symplectic (see rotation.h): the rotation of a sphere of the
// intermediate moment about the momentum, which commutes with the rest, and rotations about the two other
// principal axes, first - second - first. A sphere has only the former, a top only one of the latter. q stays
// unit to round-off however often this is done; one that is not unit is made so.
//
// Nothing here depends on other lanes or on the vector width. ~5, 8, 12 ns a body (sphere, top, asymmetric)
// on AVX-512, 1.5 times that on AVX2, as long as it turns less than a radian.
void drift(const Rotor& rotor, double dt, RotorBatch* batch);

// Angular velocities of bodies at rest or not, from their momenta. ~3 ns a body.
void find_angular_velocity(const Rotor& rotor, RotorBatch* batch);

}  // namespace nurbs

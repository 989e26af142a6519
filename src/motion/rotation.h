// Rotation of one rigid body: angular momentum, angular velocity, energy, and the free drift of the
// orientation between torque kicks. The time step of a body under torque is L += dt/2 tau; rotate_free(dt); L
// += dt/2 tau.
//
// Frames: `q` turns shape axes into lab axes, `principal_axes` principal axes into shape axes
// (Shape::principal_axes); `principal_inertia` are the body's principal moments (mass * scale^2 *
// Shape::principal_gyration), all > 0, any order. Angular momentum and velocity are in lab axes. Units are
// the caller's, consistent. Nothing throws.
#pragma once

#include "nurbs/types.h"

namespace nurbs {

enum class RotationScheme {
  symplectic,  // splitting about the principal axes: second order, symplectic, time reversible
  richardson,  // two half steps against one whole step, as LAMMPS does: second order
  exact,       // the free rotor's closed form
};

// Turns a free body by dt at constant angular momentum `angular_momentum`; q is left normalised.
//
// symplectic: the kinetic energy is split into that of a sphere of the intermediate moment, whose rotation
// about L commutes with all else, and a rotation about each of the two other principal axes, composed
// symmetrically (Dullweber, Leimkuhler & McLachlan, J. Chem. Phys. 107 (1997) 5840; this splitting: Fasso, J.
// Comput. Phys. 189 (2003) 527). Exact for spheres and symmetric tops. rotor.h has it for many steps of many
// bodies, at a tenth of the cost. richardson: LAMMPS's scheme, but each of its Euler steps is a rotation and
// not a normalised sum, so that a rotation about a principal axis is exact. exact: see free_rotor.h.
void rotate_free(RotationScheme scheme, const Vec3& principal_inertia, const Quat& principal_axes, double dt,
                 Quat& q, const Vec3& angular_momentum);

Vec3 angular_velocity(const Vec3& angular_momentum, const Quat& q, const Quat& principal_axes,
                      const Vec3& principal_inertia);
Vec3 angular_momentum(const Vec3& angular_velocity, const Quat& q, const Quat& principal_axes,
                      const Vec3& principal_inertia);

// Rotational kinetic energy, omega . L / 2.
double rotational_energy(const Vec3& angular_momentum, const Quat& q, const Quat& principal_axes,
                         const Vec3& principal_inertia);

}  // namespace nurbs

// The torque-free rigid body in closed form: the oracle that the rotation schemes are judged by, and a scheme
// itself.
#pragma once

#include "nurbs/types.h"

namespace nurbs {

// Turns a free body by `dt` (any size and sign) along the exact solution of Euler's equations. `inertia`:
// principal moments, all > 0, any order; `q`: principal axes into lab axes, unit, updated;
// `angular_momentum`: lab axes, constant. Angular momentum in the body by Jacobi elliptic functions and their
// addition theorem, attitude by the precession integral (van Zon & Schofield, J. Comput. Phys. 225 (2007)
// 145), done here by Gauss quadrature over at most one period and by the complete integral for whole periods.
// Departs from the source in that every quantity is a sum of positive terms: spheres, symmetric tops, bodies
// at rest and the separatrix need no series and lose no digits. Errors are a few ulp of 1 + |L| |dt| /
// min(inertia), times exp(time / time constant) for rotation about the intermediate axis, which is unstable.
// Cost ~ 2 us for a step of less than half a radian.
void advance_free_rotor(const Vec3& inertia, double dt, Quat& q, const Vec3& angular_momentum);

// Time after which the angular momentum in the body repeats; infinite on the separatrix and for steady
// rotation.
double free_rotor_period(const Vec3& inertia, const Vec3& angular_momentum_body);

// Jacobi elliptic functions of real u for complementary parameter m1 = 1 - m in [0, 1], by descending Landen
// transformations (Bulirsch, Numer. Math. 7 (1965) 78). Absolute error a few ulp of 1 + |u|.
struct JacobiElliptic {
  double sn, cn, dn;
};
JacobiElliptic jacobi_elliptic(double u, double m1);

// Complete elliptic integrals K and Pi(-n) for n >= 0 and m1 = 1 - m in (0, 1], by the arithmetic-geometric
// mean (DLMF 19.8.5 and 19.8.7): the integrals of du and of du / (1 + n sn^2 u) from 0 to K.
struct CompleteElliptic {
  double k, pi;
};
CompleteElliptic complete_elliptic(double n, double m1);

}  // namespace nurbs

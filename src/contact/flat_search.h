// Contacts of flat bodies at one point: of a face with whatever is deepest below it, and of two straight
// creases that cross. The direction is known beforehand, so that there is nothing to iterate.
#pragma once

#include "contact/joint_newton.h"
#include "contact/pair_frame.h"

namespace nurbs {

// The contact along the normal of the face of either body that is nearest to `direction` (unit, pair frame),
// or along the common normal of the creases that lie furthest that way. True: *s is converged, its bracket no
// wider than `tolerance` (a length); else *s stays. One hull support for each face that is tried, two for
// creases, started at s->points.
//
// Proof. Let p(d) = h_A(d) + h_B(-d) - d . offset be `overlap` along the unit n, and A - B, moved so that
// the offset is the origin, hold the disc of radius m square to n about overlap n: because A's face does,
// around the foot of B's deepest point, or because the two creases span it. It also holds -offset, the
// difference of the centres. For d at an angle t from n
//     p(d) >= overlap cos t + m sin t   >= overlap   for t <= 2 atan(m / overlap),
//     p(d) >= -(offset . n) cos t - |offset across n| sin t,
// and the second, where it is positive a concave function of t, is at least `overlap` from there to pi if it
// is so at both ends. Then `overlap` is the least of p. Bodies a gap apart need only (1) the supports along n
// and (2) the two points.
bool meet_flat(const PairFrame& pair, const Vec3& direction, double tolerance, JointSolution* s);

}  // namespace nurbs

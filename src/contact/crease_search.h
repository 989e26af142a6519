// Contacts on a crease, where the surfaces have no common normal.
#pragma once

#include "contact/joint_newton.h"
#include "contact/pair_frame.h"

namespace nurbs {

// Newton on p(d) from `direction` (unit, pair frame) and the points s->points, its gradient the offset of the
// supports across d, its Hessian W_A + W_B - p with what a crease leaves of W. The certificate is that of
// certificate.h, with no ball in the body whose normal is not d. True: *s is converged, its bracket no wider
// than `tolerance` (a length) and its normal right to `tilt` rad; else *s stays. Two hull supports a step.
bool meet_crease(const PairFrame& pair, const Vec3& direction, double tolerance, double tilt,
                 JointSolution* s);

}  // namespace nurbs

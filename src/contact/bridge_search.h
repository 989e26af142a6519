// Contacts on a bridge, where the convex hull spans a dent or a closing joint from one support point to
// another.
#pragma once

#include "contact/joint_newton.h"
#include "contact/pair_frame.h"

namespace nurbs {

// What a contact on a bridge remembers besides its points, in place of a local model, as plain doubles: the
// other support of the body that has two.
struct Bridge {
  double patch = -1, u = 0, v = 0;  // patch < 0: not known
  double of_a = 0;                  // 1: of A, 0: of B
  double share = 0;                 // l of the support among the contact's points
  bool known() const { return patch >= 0; }
};
constexpr double kBridge = -4;  // LocalModel::unique of a memory that holds one

// The least of p(d) where one body has two supports, x_1 and x_2, one either side of a dent, and the other
// body one: p is the larger of two smooth functions there, and the minimum is where they are equal and a mean
// of their gradients vanishes, l g_1 + (1 - l) g_2 = 0; Newton on d and l (Nocedal & Wright, ch. 18), and on
// the three points' parameters along with them. The contact is then at x = l x_1 + (1 - l) x_2 on the hull.
// With n_1 = n_2 = d the balls of radii r_1, r_2 that touch at x_1, x_2 from inside (body/rolling.h) touch
// the plane square to d, and their hull holds the ball of radius min(r_1, r_2) that touches it at x: the
// certificate of certificate.h holds. From `direction` (unit, pair frame) and the points s->points. True: *s
// is converged, its bracket no wider than `tolerance` (a length) and its normal right to `tilt` rad; else *s
// stays. `bridge`: what an earlier step left, from which this one starts (1 us), or one that is not known,
// for which the supports are searched (4 us); what is found is left there.
bool meet_bridge(const PairFrame& pair, const Vec3& direction, double tolerance, double tilt,
                 JointSolution* s, Bridge* bridge);

}  // namespace nurbs

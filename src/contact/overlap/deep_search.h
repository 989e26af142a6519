// The global minimum of p(d) where bodies overlap deeply: the local minima that joint Newton finds, and the
// proof that no other direction overlaps by less, from the inner maps (body/inner_map.h) alone.
#pragma once

#include "contact/joint_newton.h"

namespace nurbs {

// Makes *best, a stationary pair or nothing (iterations 0), the global minimum of p(d) = h_A(d) + h_B(-d) -
// d . offset, with a closed bracket; false, and *best as it was, where the proof does not succeed: bodies
// with flats or sharp edges, joints that gape, minima that are hardly ones or lie in creases or over dents. 5
// to 20 us.
//
// Proof, for a depth T a quarter of `tolerance` below the least p found. The sphere of directions is covered
// by
//   * cells of a cube map, halved until every direction in them has p(d) >= T. By the inner maps' nodes
//     nearest to the cell's middle (x_K, n_K, and radii r_K that hold as far as the cell's corners), for
//     small cells by the supports along the middle,
//         p(d) >= d . g + r_A + r_B,   g = (x_A - r_A n_A) - (x_B - r_B n_B) - offset,
//     and D . g - (T - r_A - r_B) |D|, D = d times any factor, is concave on the cube's face, radii being cut
//     to T in sum: what holds at the four corners holds in the cell.
//   * caps about local minima. If W_A + W_B >= m (as forms) for all directions within t of d, then by p'' + p
//     >= m along great circles p there is at least the solution of y'' + y = m with y(0) = d . (a - b), a and
//     b any points of the bodies, and y'(0) = -s, s a bound of p's slope at d: |a - b across d| and the
//     largest curvature radii times the angles between d and the normals at a and b. m comes from W at a and
//     b, less its rate times the angle, as far as that is known, then from the nodes and cells nearest to d,
//     in steps over their caps. The first of these is of the points themselves, wherever they lie; of a
//     dented body no step to the next is known, but p is no less than the overlap of the points reached,
//     p'' + p = 0: about a minimum on a face, from which p rises as from a corner's, that reaches far. Where
//     all that reaches too little, as in valleys, and where cells would want many supports, caps are widened
//     by points of both bodies round the minimum (widen_cap.h).
// Hypotheses: those of the inner maps and rates; all are checked. Minima of dented bodies are confirmed by
// the hulls' supports. `proof`, if
// asked for, is filled for the steps to come: cells then have to lie above T by a margin, and caps are cut,
// which costs some more cells; its level is 0 where none is to be had, as of two minima as good as each
// other.
struct DeepProof;
enum class DeepEffort {
  usual,  // given up where the polytope is likely to cost less
  last,   // where all else has failed: more and smaller cells, and minima without caps; 1 to 15 ms
};
bool search_deep(const PairFrame& pair, double tolerance, JointSolution* best, DeepProof* proof = nullptr,
                 DeepEffort effort = DeepEffort::usual);

// What a deep pair remembers, in place of a local model, as plain doubles: at the pose given, p is at least
// `level` for all directions further than the cap's angle from `direction`. B is seen from A, so that a pair
// that turns as one uses nothing up.
struct DeepProof {
  double direction[3];  // unit, A's axes
  double angle;         // rad
  double level;         // length; not positive: no proof
  double offset[3];     // of B's centre, A's axes
  double turn[4];       // B's axes into A's, w x y z
};
constexpr double kDeepProof = -1;  // LocalModel::unique of a memory that holds one

// Whether a stationary pair that Newton found is still the global minimum; its bracket is then closed. Since
// the proof p has changed by at most D = |change of offset| + 2 R_B |change of turn| for every direction (see
// proven_gap), so that with least the p found here, less a quarter of the tolerance, p >= level - D >= least
// outside the old cap; and the cap about the new direction, for which p >= least is proven anew, must hold
// the old one. 0.1 us.
bool still_deepest(const PairFrame& pair, double tolerance, const DeepProof& proof, JointSolution* s);

}  // namespace nurbs

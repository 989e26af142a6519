// Two sphero-polyhedra (body/sphero_polyhedron.h: capsules, boxes and polyhedra with rounded edges, balls) in
// closed form: the distance of their cores, less the balls' radii.
//
// With cores K and radii r the support functions are h = h_K + r, so that
//     p(d) = h_KA(d) + h_KB(-d) - d . offset + r_A + r_B.
// Where the cores are apart, of p over all unit d the one least value is r_A + r_B - |z|, along z, the
// shortest way from K_A to K_B: the overlap, however deep. For any d and any points x, y of the cores
//     -p(d) <= gap <= |y - x| - r_A - r_B,
// and both meet at the nearest points, which the algorithm of Gilbert, Johnson & Keerthi (1988) finds in a
// few steps; of a contact that goes on, in one, from the corners of the cores that it was between. That the
// bodies are such to `error` widens both bounds. Hypotheses, checked: the bodies are sphero-polyhedra to
// little more than round-off of the tolerance (PairFrame::is_swept), and the cores so far apart that the
// normal is right to the tolerance.
#pragma once

#include "contact/pair_frame.h"
#include "contact/pair_memory.h"

namespace nurbs {

// What such a pair remembers, in place of a local model: the corners between which the cores are nearest.
struct CorePair {
  double count;             // of them, 1 to 3
  double of_a[3], of_b[3];  // numbers of the cores' points
};
static_assert(sizeof(CorePair) <= 28 * sizeof(double), "in the place of the model's halves");
constexpr double kCorePair = -5;  // LocalModel::unique of a memory that holds one

// Gap, normal and points of two such bodies, 0.1 us where the contact goes on; false, and nothing done but
// what is remembered of such a pair dropped, where they are none, the cores meet or nearly do, or round-off
// leaves the bracket open. Else the pair is proven apart, or the result converged to `tolerance`, a length; a
// CorePair is then left in `memory`, and no surface points.
bool solve_cores(const PairFrame& pair, double tolerance, const Particle& a, const Particle& b,
                 const ContactSettings& settings, PairMemory& memory, ContactResult* r);

}  // namespace nurbs

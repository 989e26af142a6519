// Random placements of two particles, for tests and benchmarks.
#pragma once

#include <vector>

#include "contact/contact.h"
#include "support/random.h"

namespace nurbs::test {

struct Pair {
  Particle a, b;
};

// Random orientations, B's scale 0.5 to 1.5; the supports along a random direction are `gap` apart (< 0:
// overlapping) along it, so the true gap is `gap` for smooth bodies that are apart or overlap little.
Pair random_pair(Random& random, const Shape& sa, const Shape& sb, double gap, Vec3* direction = nullptr);

// Two particles of one shape, orientations random, scales 1 and 0.8 to 1.25, whose gap is `gap` (< 0:
// overlap) times the smaller bounding radius. Exact up to round-off when the contact is the only one (shallow
// overlap of a smooth body).
Pair random_pair_at(Random& random, const Shape& shape, double gap);

// The same pair over `steps` time steps: either body turns by `angle` a step about its own fixed random axis,
// and B is shifted along the normal so that the gap stays what it was. Element 0 is `start`.
std::vector<Pair> tumble(Random& random, const Pair& start, double angle, int steps);

// p(d) = h_A(d) + h_B(-d) - d . (x_B - x_A), d in the lab.
double overlap_along(const Particle& a, const Particle& b, const Vec3& d);

}  // namespace nurbs::test

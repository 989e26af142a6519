// Where to begin: the direction of least overlap as the bodies' direction atlases see it.
#pragma once

#include "contact/pair_frame.h"

namespace nurbs {

struct DirectionGuess {
  Vec3 d;    // unit, pair frame
  double p;  // upper bound of p(d) from the atlases: p < 0 proves the bodies apart
};

// p(d) = h_A(d) + h_B(-d) - d . offset from the atlases: an upper bound for any unit d. About 20 ns.
double atlas_overlap(const PairFrame& pair, const Vec3& d);
void atlas_overlaps(const PairFrame& pair, const Triple<Lane4>& d, Lane4* p);  // of four at once

// Along the line of centres; returns how many guesses that makes (0 for concentric bodies).
int guess_from_centres(const PairFrame& pair, DirectionGuess* guess);

// The lowest of kScanCells^2 directions per cube face, at most `count`, no two within kDistinct of each
// other. Returns how many (>= 1), best first.
int guess_directions(const PairFrame& pair, DirectionGuess* guesses, int count);

// A guess moved downhill to the atlases' own resolution, by compass search.
DirectionGuess refine_guess(const PairFrame& pair, DirectionGuess guess);

}  // namespace nurbs

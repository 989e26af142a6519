// Two capsules, in closed form: their overlap is that of two segments and a ball.
#pragma once

#include "contact/polytope.h"

namespace nurbs {

// Of two bodies that are balls swept along segments (body/sphero_polyhedron.h): with x and y the points of
// the segments nearest to each other, the gap is no more than |x - y| less the radii, and no less than what
// the supports along x - y, or square to both segments where these cross, leave of it. False where the two
// differ by more than the tolerance: ends that meet.
bool search_segments(const PairFrame& pair, double tolerance, PolytopeResult* result);

}  // namespace nurbs

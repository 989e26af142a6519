// Two capsules, in closed form: their overlap is that of two segments and a ball; and a capsule in an
// ellipsoid.
#pragma once

#include "contact/overlap/polytope.h"

namespace nurbs {

// Of two bodies that are balls swept along segments, or balls (body/sphero_polyhedron.h): with x and y the
// points of the segments nearest to each other, the gap is no more than |x - y| less the radii, and no less
// than what the supports along y - x leave of it, or square to both segments where they cross, or to one
// where they are on one line. False where the two differ by more than the tolerance.
bool search_segments(const PairFrame& pair, double tolerance, PolytopeResult* result);

// Of such a body and an ellipsoid that overlap by more than its ball (ellipsoid_overlap.h); else false. 5 us.
bool search_segment_in_ellipsoid(const PairFrame& pair, const Vec3& seed, double tolerance,
                                 PolytopeResult* result);

}  // namespace nurbs

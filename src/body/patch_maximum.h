// The highest point of a patch along a direction, by subdivision of its Bernstein form: certified whatever
// the patch looks like (poles, collapsed edges, creases, flats, dents), where Newton has nothing to hold on
// to.
#pragma once

#include "body/direction_atlas.h"
#include "nurbs/bezier_patch.h"
#include "nurbs/types.h"

namespace nurbs {

// The highest surface point found so far along a unit d, and the bound on what may have been missed.
struct Highest {
  SurfacePoint where;
  double h;      // d . x there
  double upper;  // no point looked at so far is higher; h + slack unless the cap was met
  int boxes;     // looked at
};

// A rectangle of a patch's parameters; the whole patch unless said otherwise.
struct PatchPiece {
  int patch = 0;
  float u0 = 0, u1 = 1, v0 = 0, v1 = 1;
  bool whole() const { return u0 == 0 && u1 == 1 && v0 == 0 && v1 == 1; }
};

// Searches a piece of `patch` for points higher than `best->h` by more than `slack` (length, some ulp of
// the body at least) and raises best. With f = d . wx - best w the patch is no higher where all Bernstein
// coefficients of f - slack w are negative; a box where f is monotone in a parameter, or of degree one in it,
// is replaced by its edges; where the Hessian's coefficients prove f concave, Newton finds its maximum and
// the gradient left bounds it; every other box is halved. Exact up to round-off: a few ulp of |x|. No
// allocation; 0.1 to 3 us a patch that has anything near the maximum. Hansen & Walster 2004, ch. 12, describe
// the tests on intervals.
void raise(const BezierPatch& patch, const PatchPiece& piece, const Vec3& d, double slack, Highest* best);

}  // namespace nurbs

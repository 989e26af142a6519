// How fast a surface's inverse Weingarten map changes: the remainder bound of the local contact model.
#pragma once

#include "nurbs/bezier_patch.h"

namespace nurbs {

// Bound of |dW/dn| over a patch, W the map from changes of the unit normal to displacements (3 x 3, length),
// n the normal, spectral norm, transported along the turn of n; infinite where a principal curvature is not
// positive. The largest difference quotient between neighbours of a kRateSamples^2 grid, times kRateSafety:
// safe where the grid resolves the surface. Not a proof.
double bound_curvature_rate(const BezierPatch& patch);

}  // namespace nurbs

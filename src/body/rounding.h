// Bodies rounded by balls: planes, cylinders of revolution and spheres, whose least radius is known exactly.
#pragma once

#include <vector>

#include "nurbs/bezier_patch.h"

namespace nurbs {

constexpr double kTwoNormals = 1e-3;  // rad: closer ones give no radius

// A surface point and the unit normal there.
struct PointAndNormal {
  Vec3 x, n;
};

// Of one patch: 0 if it is none of these, infinite if it is plane.
double rounding(const BezierPatch& patch);

// Curvature, times the square of the patch's width, over an error of position that is known all over it:
// second derivatives of a Bernstein polynomial of degree n on the unit interval are at most 4 n (n - 1) times
// its largest coefficient. Of the squared distance n is twice the patch's degree; four times that for weights
// and uneven parameters.
double bent_by(const BezierPatch& patch);

// The least radius of the cylinders and spheres if every patch lies in one, or in a plane, to kRounded of its
// size (proven from Bernstein coefficients), less what their round-off may bend them by; 0 where a patch does
// not, infinite where all are plane. Enclosed curvatures (surface_bounds.h) are tight to kRadiusTightness
// only: with those, a sphere about a point of a mate's axis would not be told from one a little beside it,
// and neither would the ring of directions in which they overlap by the same.
double least_rounding(const std::vector<BezierPatch>& patches);

}  // namespace nurbs

// Where a cell lies in its patch, turned so that its pole, if it has one, is at u = 0, and the affine
// coordinates it is enclosed in (enclosure.h).
#pragma once

#include "body/enclosure.h"
#include "nurbs/types.h"

namespace nurbs::cells {

// Coefficient (i, j) of a patch, turned so that the pole is at u = 0 (a rotation of the
// parameters: normals stay outward).
const Vec4& turned_point(const BezierPatch& patch, int pole, int i, int j);
// The cell's distance from the pole, in parameters.
double from_pole(const Cell& cell);

// Parameters from `low` to `high` of a patch turned as its pole wants it.
struct Section {
  double low, high;
};
Section rows_of(const Cell& cell);
Section columns_of(const Cell& cell);

// Affine coordinates of a cell: x = origin + back y.
struct Frame {
  Vec3 origin;
  Mat3 back, to;
  double det;                                      // of `back`
  double least_curvature, min_radius, max_radius;  // in the middle of the cell; infinite where it is flat
};

// From the surface at the cell's middle: unit tangents, and the second form's mean of unit size along the
// third axis, which is the mean of the second derivatives (affine normal), or the normal if `upright`. False
// where there is none.
bool make_frame(const BezierPatch& patch, const Cell& cell, const Vec3& origin, bool upright, Frame* frame);

}  // namespace nurbs::cells

// Normal and curvatures of a patch at a point (do Carmo, section 3.3).
#pragma once

#include "nurbs/bezier_patch.h"
#include "nurbs/tolerances.h"
#include "nurbs/types.h"

namespace nurbs {

// Curvatures are counted positive where the surface bends away from its normal Su x Sv, as a convex body's
// does from the outward normal.
struct LocalForm {
  double u = 0, v = 0;  // where it was taken: see regular_point
  Vec3 point = Vec3::Zero();
  Vec3 normal = Vec3::Zero();  // unit
  Vec3 su = Vec3::Zero(), sv = Vec3::Zero();
  Mat2 first = Mat2::Zero();    // E F G
  Mat2 second = Mat2::Zero();   // -(L M N)
  double k_min = 0, k_max = 0;  // principal curvatures, 1/length
  double noise = 0;             // of them: round-off, about

  // Tangents in line: the normal is what the last digits of the control points make of it.
  bool in_line() const { return sine() <= kLeastSine; }
  double sine() const { return su.cross(sv).norm() / (su.norm() * sv.norm()); }
};

// Form at (u, v); where the parametrisation is singular (pole, collapsed edge, corner with parallel edges),
// at the nearest regular point on the way to the patch's middle, at most 1e-3 away in parameters.
LocalForm local_form(const BezierPatch& patch, double u, double v);

// Curvature of the normal section along the tangent direction t (any length > 0).
double normal_curvature(const LocalForm& form, const Vec3& t);

}  // namespace nurbs

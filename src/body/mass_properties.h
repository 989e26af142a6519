// Volume, centre of mass and inertia of the solid inside a closed set of patches.
#pragma once

#include <vector>

#include "body/shape.h"

namespace nurbs {

// Uniform solid of unit density. The patches must be closed and consistently oriented; the volume is negative
// when they face inward. By the divergence theorem applied to homogeneous moments about a reference point,
//   int_V f dV = 1/(3 + k) int_S f (x . n) dA   for f = 1, x, x x^T  (degree k = 0, 1, 2),
// with Gauss-Legendre quadrature: exact for polynomial patches, adaptively subdivided to 1e-12 of each moment
// for rational ones (relative error of the result below 1e-11). Cost: 0.05 to 1 ms per patch. `done`: false
// if that took more cells than a body may have, where the result is less exact.
MassProperties integrate_mass(const std::vector<BezierPatch>& patches, bool* done = nullptr);

// Principal moments, ascending, and the rotation that turns principal axes into the axes of `tensor`
// (symmetric). A tensor that is diagonal to round-off keeps its axes, merely reordered.
struct PrincipalFrame {
  Vec3 moments = Vec3::Zero();
  Quat axes = Quat::Identity();
};
PrincipalFrame principal_frame(const Mat3& tensor);

}  // namespace nurbs

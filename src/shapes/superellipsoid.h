// Blocky bodies |x/a|^e + |y/b|^e + |z/c|^e = 1 as smooth, strictly convex splines.
#pragma once

#include <vector>

#include "nurbs/nurbs_surface.h"
#include "nurbs/types.h"

namespace nurbs {

struct Superellipsoid {
  std::vector<NurbsSurface> surfaces;  // six patches, centred at the origin
  double error = 0;                    // largest distance from the exact surface on a dense grid, length
};

// The fewest biquartic pieces that come within `tolerance` (a share of the largest semi-axis) of the exact
// surface, with joints smooth to round-off; of the bodies on them the one of the largest least curvature
// found: the exact faces are flat in the middle for e > 2, ours bulge by what the tolerance leaves, which is
// what keeps contacts on them cheap. Proven convex without flats. Exact for e = 2. Throws ShapeError where
// none is found; takes 1 to 60 s, more for higher exponents (up to 12) and smaller tolerances.
Superellipsoid convex_superellipsoid(const Vec3& semi_axes, double exponent, double tolerance);

}  // namespace nurbs

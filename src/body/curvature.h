// A dense sample of a body's surface, and what kinks do to the bounds of its curvature.
#pragma once

#include <vector>

#include "body/connectivity.h"
#include "body/shape.h"

namespace nurbs {

struct SurfaceSample {
  SurfacePoint where;
  Vec3 point, normal;   // normal outward
  double k_min, k_max;  // principal curvatures, positive on a convex body
  double noise;         // round-off of them
  double spacing;       // distance to the next sample, about
};

// A square grid on every patch, edges included, but for corners without a normal: about 3,000 points in all,
// at least 4 x 4 a patch.
std::vector<SurfaceSample> sample_surface(const std::vector<BezierPatch>& patches);

// The strict bounds of the whole body's convex hull: an opening kink is a crease (radius 0), a closing one is
// bridged by a flat strip (infinite radius). Kinks up to kNoKink are no creases (small_kinks.h). Imperfect
// joints therefore give (0, infinity).
CurvatureBounds add_kinks(const CurvatureBounds& patches, const KinkSummary& kinks);

}  // namespace nurbs

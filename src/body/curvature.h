// A dense sample of a body's surface, and bounds on its curvature from it.
#pragma once

#include <vector>

#include "body/connectivity.h"
#include "body/shape.h"

namespace nurbs {

struct SurfaceSample {
  SurfacePoint where;
  Vec3 point, normal;   // normal outward
  double k_min, k_max;  // principal curvatures, positive on a convex body
  double spacing;       // distance to the next sample, about
};

// A square grid on every patch, edges included: about 3,000 points in all, at least 4 x 4 a patch.
std::vector<SurfaceSample> sample_surface(const std::vector<BezierPatch>& patches);

// Curvature bounds inside the patches (joints left out). The extreme sample of every patch is refined by a
// pattern search, then widened by a tenth of the difference to its neighbours on the grid plus 1e-6: safe
// when curvature is resolved by the grid (a feature narrower than 1/20 of a six-patch body's patch can be
// missed). Not a proof.
CurvatureBounds bound_patch_curvature(const std::vector<BezierPatch>& patches,
                                      const std::vector<SurfaceSample>& samples);

// The strict bounds of the whole body's convex hull: an opening kink is a crease (radius 0), a closing one is
// bridged by a flat strip (infinite radius). Kinks up to kNoKink count as none. Imperfect joints therefore
// give (0, infinity).
CurvatureBounds add_kinks(const CurvatureBounds& patches, const KinkSummary& kinks);

}  // namespace nurbs

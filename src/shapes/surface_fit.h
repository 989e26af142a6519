// Least-squares fit of a closed body by six bicubic B-spline patches over a cube.
#pragma once

#include <functional>
#include <vector>

#include "nurbs/nurbs_surface.h"
#include "nurbs/types.h"

namespace nurbs {

// Signed distance to first order from a target surface, outside positive, and its gradient.
struct SurfaceOffset {
  double distance;
  Vec3 gradient;
};

// The body to fit.
struct FitTarget {
  std::function<Vec3(const Vec3& direction)>
      point;  // a surface point for a unit direction: the starting parametrisation
  std::function<SurfaceOffset(const Vec3& point, const Vec3& normal)>
      offset;  // of a nearby point with unit normal
};

// kKinked: neighbours share their edge curve only. kSmooth (one span): they share tangent planes, to
// round-off.
enum class Joints { kKinked, kSmooth };

struct FitOptions {
  int spans = 1;  // Bezier pieces per patch in each direction; patches are C2 inside
  Joints joints = Joints::kKinked;
  // Weight of errors in slope, per span: calms fits of bodies with flats and sharp bends.
  double slope_weight = 0;
  // Weight of second differences of the control points: keeps points from sliding into folds.
  double fairing = 0;
};

struct SurfaceFit {
  std::vector<NurbsSurface> surfaces;
  double error = 0;  // largest |offset| found on a dense grid
};

// Fits six patches to `target`: linear fit to the starting parametrisation, then Levenberg-Marquardt on the
// offsets (and slopes) alone, which leaves the points free to slide in the surface.
//
// Smooth joints: with the edge curve e(t), t in [0,1], and the derivatives D1, D2 across it, pointing into
// either patch, D1 + D2 = (2t - 1) e'(t) makes both tangent planes equal. That is linear in the control
// points, and at the cube's three-patch corners it reads e1' + e2' + e3' = 0, so all twelve edges hold at
// once: of 56 control points, a 24-dimensional space remains, the same for each coordinate and so closed
// under affine maps.
//
// Deterministic. One span takes about 20 ms, four 1 s; time grows as spans^3 or so.
SurfaceFit fit_cube_body(const FitTarget& target, const FitOptions& options);

}  // namespace nurbs

// Fit of a rational spline body to a convex hull by its gauge function: a convex programme, whose answer does
// not depend on where it starts.
#pragma once

#include <vector>

#include "nurbs/nurbs_surface.h"
#include "nurbs/types.h"
#include "shapes/convex_hull.h"

namespace nurbs {

struct GaugeFitOptions {
  double inward = 0.01, outward = 0.01;  // largest distances wanted, lengths
  double least_curvature = 1e-3;         // of normal sections, 1 / length: kept at the samples, about
  Mat3 metric = Mat3::Identity();        // distances count over |metric n|, n normal: see ConvexFitOptions
};

struct GaugeFit {
  std::vector<NurbsSurface> surfaces;
  double error = 1e300;  // largest distance found, over that wanted, at samples and the hull's vertices
};

// With splines of `degree` over `spans` x `spans` spans of each face for the gauge function g
// (smooth_cube.h), the body is convex where g is, and joints are smooth where a linear condition holds.
// Distances are convex in g, too: outward ones along the facet that a ray meets, inward ones from the hull's
// vertices. From a ball on, a primal-dual interior-point method (Mehrotra's predictor and corrector; forms of
// curvature by the direction of Helmberg, Rendl, Vanderbei and Wolkowicz) presses the largest distance,
// relative to that wanted, down to 1 or as far as it goes; from 1 on it goes to the centre of what the wanted
// distances leave either way, where curvature is far from its bounds, and looks between the samples for
// dents. `hull` contains the origin and is about 1 in size; degree 3 or 4. Deterministic; 0.1 s for 600
// control points, 0.3 s for 1200, 2 s for 2900. They are two to three times as many as polynomial patches
// need (fit_convex), whose points crowd where edges are sharp, but it always converges.
GaugeFit fit_gauge(int degree, int spans, const ConvexHull& hull, const GaugeFitOptions& options);

}  // namespace nurbs

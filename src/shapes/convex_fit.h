// Fit of a smooth, strictly convex spline body to a convex body given by its support function.
#pragma once

#include <functional>
#include <vector>

#include "shapes/smooth_cube.h"

namespace nurbs {

// Signed distance to first order from the target's surface, outside positive, and its unit gradient. `hint`
// is the caller's to keep for one place of the fit: 0 at first, then what the last call left there.
struct TargetOffset {
  double distance;
  Vec3 gradient;
};
using OffsetTarget = std::function<TargetOffset(const Vec3& point, const Vec3& normal, int& hint)>;

struct ConvexFitOptions {
  double least_curvature = 0.01;  // of normal sections anywhere, 1 / length: kept
  double most_curvature = 100;    // wanted, as far as the other aims allow
  double tolerance = 0.01;        // length: the fit stops when it is met at the samples
  double cut_weight = 1.5;        // of errors where the fit is inside: a corner cut off is farther than faces
  double slide = 0.05;  // distance from its ray that costs a point as much as an error of the tolerance
  Mat3 metric = Mat3::Identity();  // support errors count over |metric n|: those of the body mapped by the
                                   // transposed inverse of `metric`
};

struct ConvexFit {
  NetPoints points;            // the best strictly convex net met; `start` if there was none
  double error = 0;            // largest distance over |metric gradient| on a grid, about; 1e300 if none
  double least_curvature = 0;  // found on that grid
  NetPoints last;              // the last net, convex or not: a start for a richer cube
};

// Starts from `start`, a net of smooth joints, and minimises, over nets of smooth joints, the sum over
// samples of the squared distance to the target, with penalties where a normal curvature falls below the
// least one wanted (damped Gauss-Newton; curvature is linearised exactly in the control points), then weights
// what errs most and asks for more curvature where it lacks. Points stay near the rays of an equal-angle cube
// map. Target and net in one frame, about the origin, about 1 in size. Deterministic. A second for some
// hundred points.
ConvexFit fit_convex(const SmoothCube& cube, const NetPoints& start, const OffsetTarget& target,
                     const ConvexFitOptions& options);

// Asks a fit that met its tolerance for twice the least curvature, and again, as long as the tolerance is
// met, `accept` takes the result and its least curvature grows: the flattest places bulge by what the
// tolerance leaves, which contacts on them are the cheaper for. Returns the last that was accepted.
ConvexFit raise_curvature(const SmoothCube& cube, ConvexFit fit, const OffsetTarget& target,
                          ConvexFitOptions options, const std::function<bool(const ConvexFit&)>& accept);

// The net of smooth joints nearest, in the mean square, to points given over faces and their parameters in
// [0, 1]^2.
using NetTarget = std::function<Vec3(int face, double u, double v)>;
NetPoints fit_points(const SmoothCube& cube, const NetTarget& target);

}  // namespace nurbs

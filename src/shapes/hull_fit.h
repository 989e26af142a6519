// Fit of a smooth convex body to a convex hull, with as few control points as a tolerance allows, and the
// certificate of its error.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "body/shape.h"
#include "shapes/convex_hull.h"

namespace nurbs {

// Distances between a body and a hull, upper bounds but for round-off: that of each hull vertex to the body
// is measured to a point of the body; each surface piece lies in the hull of its control points, whose
// distances to the hull are measured, pieces being halved until that says little more than a surface point.
struct HullDistance {
  double outward = 0;  // of the body's farthest point from the hull
  double inward = 0;   // of the hull's farthest point from the body
  double worst() const { return outward > inward ? outward : inward; }
};
HullDistance hull_distance(const Shape& shape, const ConvexHull& hull, double resolution);

size_t control_points(const std::vector<NurbsSurface>& surfaces);  // all together

// Of the least body that fits hulls of any form, all surfaces together: six bicubic patches.
constexpr size_t kLeastPoints = 96;

struct HullFitOptions {
  double tolerance = 0.01;                           // of the hull's bounding radius about its centre of mass
  int spans = 0;                                     // per patch and direction, 0: as few as do
  size_t most_points = 0;                            // in all surfaces together, 0: any number
  std::function<void(const std::string&)> progress;  // told what was tried, a line at a time
};

struct HullFit {
  std::vector<NurbsSurface> surfaces;  // in the hull's frame
  std::shared_ptr<const Shape> shape;  // the same
  HullDistance distance;
  double radius = 0;  // the hull's bounding radius
  std::string kind;   // "sphere" or "bicubic, 2 x 2 spans", ...
};

// The first, by growing numbers of control points, of: an exact sphere; bodies of revolution and polyhedra
// with their edges rounded, where the hull is nearly one of few corners (those of up to twelve faces before
// patches of more than a span, so that flat faces stay); bicubic and biquartic bodies of smooth joints on six
// patches of growing numbers of spans, polynomial ones (convex_fit.h), then rational ones (gauge_fit.h), as
// far as the errors of those before leave hope; whose certified distance is within the tolerance, which load
// without a dent and are proven convex; of that many spans then the one of the largest least curvature found.
// Where none is proven convex, the first that is within the tolerance; where none is, a rounded polyhedron of
// up to 300 faces, the hull's own or fewer about it. Throws ShapeError when there is none, naming the best
// that was reached. Seconds; 10 to 30 where a rough hull wants thousands of points.
HullFit fit_hull(const ConvexHull& hull, const HullFitOptions& options);

}  // namespace nurbs

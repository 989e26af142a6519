// How far a body is from convex: the depth of its dents.
#pragma once

#include <vector>

#include "body/connectivity.h"
#include "body/curvature.h"
#include "body/shape.h"
#include "body/surface_bounds.h"

namespace nurbs {

struct Dent {
  double depth =
      0;  // largest distance, along the surface normal, from the surface to the convex hull's boundary
  SurfacePoint where;  // of the deepest point found
  double excess =
      0;  // largest h(n) - n . x over surface points x with normal n: what a local maximum of d . x
          // may lack of the support function h(d); up to about 4 times the depth in a shallow dent
};

// Deepest dent of a shape whose patches, links and bounding radius are done. A closed surface with no
// negative curvature and no concave kink is convex (van Heijenoort 1952): the leaves of `bounds` and `kinks`
// prove it, and what is left to see is whether it passes through itself, by comparing the samples with each
// other's tangent planes. Where a cell shows negative curvature or a kink closes, the worst places, of cells
// and samples, are measured with the support mapping and refined: depth and excess are then right to a few
// per cent; they are measured, not proven. About 2 ms, up to 100 ms with dents.
Dent find_dent(const Shape& shape, const std::vector<SurfaceSample>& samples, const SurfaceBounds& bounds,
               const KinkSummary& kinks);

}  // namespace nurbs

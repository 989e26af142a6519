// Bounds over whole patches, from enclosures of cells that are halved until the bounds are tight: curvature
// radii, the rate at which curvature changes, convexity.
#pragma once

#include <vector>

#include "body/enclosure.h"
#include "body/shape.h"

namespace nurbs {

// A cell as it was left, of the patch `SurfaceBounds::even` has.
struct Leaf {
  Cell cell;
  CellBounds bounds;
  SurfacePoint middle;  // in the shape's own parameters
  int depth = 0;        // halvings of the patch
};

struct SurfaceBounds {
  CurvatureBounds radii;         // inside the patches, proven
  std::vector<PatchRate> rates;  // per patch, proven
  std::vector<Leaf> leaves;      // cover every patch
  std::vector<Leaf> hollows;     // cells seen to bend inward, in patches of which leaves are left open
  // The patches with weights as even as a change of parameters makes them (u = r s / (1 + (r - 1) s)), which
  // is what cells are cut from: uneven weights make uneven parameters, and more cells.
  std::vector<BezierPatch> even;
  double seen_min = 0, seen_max = 0, seen_rate = 0;  // that occur: what the bounds can at best be
  int cells = 0;                                     // enclosed
};

// Of a shape whose patches and links with their kinks are done, and its radii. Leaves are halved, all patches
// alike, until every one is proven convex, flat, or seen not to be; the radii are within kRadiusTightness of
// ones that occur, and each leaf's rate within kRateTightness of one that occurs in it or small beside its
// patch's; or until kMostCells are spent: bounds are then looser, and hold. Of a `sphere`, whose radii are
// known, only convexity. Without rates as far as the radii. Tens of ms.
SurfaceBounds bound_surface(const Shape& shape, bool sphere = false, Wanted wanted = {true, false});

// Whether a leaf has no negative curvature beyond round-off, though not all are positive: flat or ruled.
bool is_flat(const CellBounds& bounds, double size);
// Whether one was seen to have negative curvature beyond that.
bool is_hollow(const CellBounds& bounds, double size);

// Halves the leaves further until the normals of each are within `round` (rad) of its axis, within `flat`
// where it is not convex, and its largest radius within the factor `spread` of one that occurs there, `cells`
// allowing: what the normal map is painted with.
void refine_normals(double round, double flat, double spread, int cells, SurfaceBounds* bounds);

// Halves those that are wider than `cone` while the least eigenvalue proven of them (CellBounds::stretch) is
// not within the factor `tightness` of the one in their middle, `cells` allowing.
void refine_stretches(double cone, double tightness, int cells, SurfaceBounds* bounds);

}  // namespace nurbs

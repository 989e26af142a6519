// Enclosures: bounds of a patch's differential geometry over a cell of its parameters that hold at every
// point of the cell, not only where it was looked at.
//
// A cell has its own control net (de Casteljau), whose differences bound the derivatives (a Bezier function
// lies in the hull of its net); quotient rule, normal and fundamental forms follow in affine arithmetic
// (affine_form.h). It is done in affine coordinates in which the cell's middle has unit tangents and a
// unit second form, since the sign and the ratios of D = -(x_u cross x_v) . x_ij do not change with them:
// a needle needs no more cells than a sphere to be proven convex. Then, with N = x_u cross x_v, the inverse
// Weingarten map is W = |N| J D^-1 J', J = (x_u, x_v).
//
// On a patch with a pole, which a collapsed edge u = 0 is, x = pole + u z(u, v) with z the quotient of nets
// of degree one less. N = u N', N' = (z + u z_u) cross z_v, and in the basis (x_u, z_v) D is u times (E, F;
// F, G) with E = -N' . (2 z_u + u z_uu), F = -N' . z_uv and u G = -N' . z_vv: W = |N'| (x_u, z_v) (E, F; F,
// G)^-1 (x_u, z_v)'. Where the pole is smooth N' . z_vv vanishes at u = 0 (all z(0, v) are tangents), so that
// in a cell that touches the pole G is enclosed by the derivative of that product with respect to u (mean
// value theorem): everything is regular there.
#pragma once

#include <vector>

#include "nurbs/bezier_patch.h"

namespace nurbs {

// A rectangle of a patch; whole as it is made.
struct Cell {
  int patch = 0;
  int pole = -1;  // edge of the patch that is a smooth pole, or -1
  double u0 = 0, v0 = 0, du = 1, dv = 1;
};

// W(v, v) >= most (v . along)^2 + least (v . other)^2 for every tangent v of a cell, `along` and `other` at
// right angles to each other and to the cell's axis: for bodies that bend much more one way than the other.
struct Stretch {
  Vec3 along = Vec3::Zero();  // unit
  double most = 0, least = 0;
};

struct CellBounds {
  bool regular = false;                   // the surface has a normal everywhere in the cell
  bool convex = false;                    // all its normal curvatures are positive there
  Vec3 axis = Vec3::Zero();               // unit: all outward normals lie within ...
  double cone = 0;                        // ... this angle of it, rad
  double min_radius = 0, max_radius = 0;  // of curvature; 0 and infinity where nothing is proven
  double least_curvature = 0;  // no normal curvature is below this; minus infinity where nothing is proven
  Stretch stretch;             // 0 where nothing is proven
  double rate = 0;             // bound of |dW/dn|, infinite where none is proven
  double speed_u = 0, speed_v = 0;  // least length of surface crossed per unit of the patch's u and v, square
                                    // to the other parameter line
  double seen_min = 0, seen_max = 0, seen_rate = 0;  // in the middle of the cell: what the bounds can't beat
  double seen_curvature = 0;                         // the least one there
  bool split_u = true;                               // the likely way to halve it
  double doubt = 0;  // how much tangents and normal vary over the cell, relatively: what halving is to lessen
};

void halve(const Cell& cell, bool in_u, Cell* first, Cell* second);
// Its own control net, homogeneous, v fastest.
std::vector<Vec4> net_of(const BezierPatch& patch, const Cell& cell);

// What is asked for beside normals and curvature radii: the rate costs as much again.
struct Wanted {
  bool rate = false, stretch = false;
};
// Bounds over a cell. Several are enclosed side by side where they are of one kind (degrees, pole, what is
// wanted), for a third of the cost or less.
struct Enclosed {
  const BezierPatch* patch;
  const Cell* cell;
  Wanted wanted;
  CellBounds bounds;  // the result
};
void enclose(Enclosed* cells, int count);
CellBounds enclose(const BezierPatch& patch, const Cell& cell, Wanted wanted);

}  // namespace nurbs

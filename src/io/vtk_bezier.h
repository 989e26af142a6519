// Bezier patches as VTK's rational Bezier cells (VTK_BEZIER_QUADRILATERAL): point order, weights, degrees.
#pragma once

#include <vector>

#include "nurbs/bezier_patch.h"
#include "nurbs/types.h"

namespace nurbs {

constexpr int kVtkBezierQuadrilateral = 77;  // the cell type in vtkCellType.h

// Control points of one cell in VTK's order, projected (x, y, z) with their weights beside them.
struct VtkBezierCell {
  int degree_u = 0, degree_v = 0;  // VTK's first and second parametric direction
  std::vector<Vec3> points;        // (degree_u + 1) (degree_v + 1) of them
  std::vector<double> weights;     // 1 for a polynomial patch
};

// Place of control point (i, j), i along u, in a cell of these degrees: four corners counter-clockwise from
// (0, 0), then the inner points of the edges v = 0, u = 1, v = 1, u = 0, each with rising parameter, then the
// interior, i fastest (vtkHigherOrderQuadrilateral::PointIndexFromIJK).
int vtk_point_index(int i, int j, int degree_u, int degree_v);

// The cell of a patch, in the patch's frame and orientation: Su x Sv stays the cell's normal.
VtkBezierCell vtk_bezier_cell(const BezierPatch& patch);

}  // namespace nurbs

// VTK numbers the control points of a cell from its corners inwards; a patch stores them row by row.
#include "io/vtk_bezier.h"

namespace nurbs {

int vtk_point_index(int i, int j, int degree_u, int degree_v) {
  const bool u_end = i == 0 || i == degree_u;
  const bool v_end = j == 0 || j == degree_v;
  if (u_end && v_end) return j == 0 ? (i == 0 ? 0 : 1) : (i == 0 ? 3 : 2);
  const int inner_u = degree_u - 1, inner_v = degree_v - 1;
  if (v_end) return 4 + (j == 0 ? 0 : inner_u + inner_v) + (i - 1);
  if (u_end) return 4 + (i == 0 ? 2 * inner_u + inner_v : inner_u) + (j - 1);
  return 4 + 2 * (inner_u + inner_v) + (j - 1) * inner_u + (i - 1);
}

VtkBezierCell vtk_bezier_cell(const BezierPatch& patch) {
  VtkBezierCell cell;
  cell.degree_u = patch.degree_u;
  cell.degree_v = patch.degree_v;
  cell.points.resize(patch.points.size());
  cell.weights.resize(patch.points.size());
  for (int i = 0; i <= patch.degree_u; ++i) {
    for (int j = 0; j <= patch.degree_v; ++j) {
      const Vec4& p = patch.point(i, j);
      const int k = vtk_point_index(i, j, patch.degree_u, patch.degree_v);
      cell.points[k] = p.head<3>() / p[3];
      cell.weights[k] = p[3];
    }
  }
  return cell;
}

}  // namespace nurbs

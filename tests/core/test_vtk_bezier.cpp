// Bezier patches as VTK cells: the point order against VTK's own, and that nothing of the patch is lost.
#include <gtest/gtest.h>

#include <set>
#include <vector>

#include "io/vtk_bezier.h"
#include "nurbs/bezier_patch.h"
#include "support/random.h"

namespace nurbs::test_vtk_bezier {
namespace {

// From vtkHigherOrderQuadrilateral::PointIndexFromIJK (VTK 9.1), rows i along u, columns j along v.
TEST(VtkPointIndex, is_vtks_for_degrees_3_and_2) {
  const int expected[4][3] = {{0, 9, 3}, {4, 10, 7}, {5, 11, 8}, {1, 6, 2}};
  for (int i = 0; i <= 3; ++i) {
    for (int j = 0; j <= 2; ++j) EXPECT_EQ(vtk_point_index(i, j, 3, 2), expected[i][j]) << i << " " << j;
  }
}

TEST(VtkPointIndex, numbers_every_control_point_once) {
  for (int p = 1; p <= kMaxDegree; ++p) {
    for (int q = 1; q <= kMaxDegree; ++q) {
      std::set<int> seen;
      for (int i = 0; i <= p; ++i) {
        for (int j = 0; j <= q; ++j) seen.insert(vtk_point_index(i, j, p, q));
      }
      EXPECT_EQ(seen.size(), static_cast<size_t>((p + 1) * (q + 1)));
      EXPECT_EQ(*seen.begin(), 0);
      EXPECT_EQ(*seen.rbegin(), (p + 1) * (q + 1) - 1);
    }
  }
}

TEST(VtkBezierCell, holds_the_projected_control_points_and_weights) {
  test::Random random(7);
  BezierPatch patch;
  patch.degree_u = 4;
  patch.degree_v = 3;
  for (int k = 0; k < 20; ++k) {
    {
      const Vec3 p = random.box(0.5, 2);
      patch.points.emplace_back(p[0], p[1], p[2], random.uniform(0.5, 2));
    }
  }
  const VtkBezierCell cell = vtk_bezier_cell(patch);
  EXPECT_EQ(cell.degree_u, 4);
  EXPECT_EQ(cell.degree_v, 3);
  ASSERT_EQ(cell.points.size(), 20u);
  for (int i = 0; i <= 4; ++i) {
    for (int j = 0; j <= 3; ++j) {
      const int k = vtk_point_index(i, j, 4, 3);
      EXPECT_EQ(cell.weights[k], patch.point(i, j)[3]);
      EXPECT_LT((cell.points[k] * cell.weights[k] - patch.point(i, j).head<3>()).norm(), 1e-15);
    }
  }
}

}  // namespace
}  // namespace nurbs::test_vtk_bezier

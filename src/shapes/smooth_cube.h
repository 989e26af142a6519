// Closed surfaces of six spline patches over a cube whose joints are tangent-continuous by construction.
#pragma once

#include <Eigen/Sparse>
#include <vector>

#include "nurbs/nurbs_surface.h"
#include "nurbs/types.h"
#include "shapes/cube_net.h"

namespace nurbs {

// x, y, z of every control point, by net index.
using NetPoints = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;

// Patches of one degree over `spans` x `spans` equal spans, C1 inside for degrees up to 3 and C2 above.
//
// With the edge curve e(t), t in [0, 1], and the derivatives D1, D2 across it into either patch, the joint's
// tangent planes agree if D1 + D2 = (2 t - 1) e'(t); at the cube's corners, where three patches meet, that
// says e1' + e2' + e3' = 0, so all twelve edges hold at once. The condition is linear in the control points,
// the same for each coordinate, and so kept by affine maps.
class SmoothCube {
 public:
  SmoothCube(int degree, int spans);

  int degree() const { return degree_; }
  int spans() const { return spans_; }
  int count() const { return net_.count(); }  // control points, those on common edges counted once
  // Index of control point (i, j), 0..degree, of span (a, b) of face f.
  int index(int f, int a, int b, int i, int j) const {
    return net_.index(f, a * multiplicity_ + i, b * multiplicity_ + j);
  }
  // Rows r with r . points = 0 on smooth joints, each of unit length. Some depend on others.
  const Eigen::SparseMatrix<double>& conditions() const { return conditions_; }

  // Values, first and second derivatives, at t in [0, 1] of span a, of the degree + 1 splines alive there;
  // the derivatives by the patch's whole parameter.
  struct Basis {
    double value[kMaxDegree + 1], slope[kMaxDegree + 1], bend[kMaxDegree + 1];
  };
  Basis basis(int a, double t) const;

  std::vector<NurbsSurface> surfaces(const NetPoints& points) const;

 private:
  Eigen::SparseMatrix<double> joint_conditions() const;

  int degree_, spans_, multiplicity_;
  std::vector<double> knots_;
  CubeNet net_;
  Eigen::SparseMatrix<double> conditions_;
};

}  // namespace nurbs

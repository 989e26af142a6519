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

// What the splines over a cube are: the points of a body, x(u, v), or its gauge function, g(y) = least t with
// y / t inside, on the cube: the body is y / g(y) then, in rational patches with g for weights.
enum class CubeKind { points, gauge };

// Patches of one degree over `spans` x `spans` spans, equal ones of [0, 1] for points and of equal angles of
// [-1, 1] for a gauge; C1 inside for degrees up to 3 and C2 above.
//
// Points: with the edge curve e(t), t in [0, 1], and the derivatives D1, D2 across it into either patch, the
// joint's tangent planes agree if D1 + D2 = (2 t - 1) e'(t); at the cube's corners, where three patches meet,
// that says e1' + e2' + e3' = 0, so all twelve edges hold at once. The condition is linear in the control
// points, the same for each coordinate, and so kept by affine maps. Gauge: its gradient is that of either
// face on an edge if y . grad g = g (Euler) with the derivative across from each, linear as well.
class SmoothCube {
 public:
  SmoothCube(int degree, int spans, CubeKind kind = CubeKind::points);

  int degree() const { return degree_; }
  int spans() const { return spans_; }
  int count() const { return net_.count(); }  // control points, those on common edges counted once
  // Index of control point (i, j), 0..degree, of span (a, b) of face f.
  int index(int f, int a, int b, int i, int j) const {
    return net_.index(f, a * multiplicity_ + i, b * multiplicity_ + j);
  }
  // Rows r with r . points = 0 on smooth joints, each of unit length. Some depend on others.
  const Eigen::SparseMatrix<double>& conditions() const { return conditions_; }
  // Points less what round-off left of the conditions.
  Eigen::MatrixXd tidied(Eigen::MatrixXd points) const;

  // The parameter at t in [0, 1] of span a, and the span of a parameter.
  double parameter(int a, double t) const { return breaks_[a] + (breaks_[a + 1] - breaks_[a]) * t; }
  int span_of(double parameter) const;

  // Values, first and second derivatives, at t in [0, 1] of span a, of the degree + 1 splines alive there;
  // the derivatives by the patch's whole parameter.
  struct Basis {
    double value[kMaxDegree + 1], slope[kMaxDegree + 1], bend[kMaxDegree + 1];
  };
  Basis basis(int a, double t) const;

  // One span of one face, with the indices of its control points.
  struct Piece {
    int face, a, b;
    std::vector<int> columns;
  };
  std::vector<Piece> pieces() const;

  // What each control point of a piece adds at one place: columns value, u, v, uu, uv, vv.
  using Shares = Eigen::Matrix<double, Eigen::Dynamic, 6>;
  Shares shares(const Basis& u, const Basis& v) const;

  // Control points along one parameter of a face.
  static int net_size(int degree, int spans);

  std::vector<NurbsSurface> surfaces(const NetPoints& points) const;
  std::vector<NurbsSurface> surfaces(const Eigen::VectorXd& gauge) const;

 private:
  Eigen::SparseMatrix<double> joint_conditions() const;

  CubeKind kind_;
  int degree_, spans_, multiplicity_;
  std::vector<double> breaks_, knots_;
  CubeNet net_;
  Eigen::SparseMatrix<double> conditions_;
};

}  // namespace nurbs

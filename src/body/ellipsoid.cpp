// A guess from the moments, a better one from points of the surface, and the proof.
#include "body/ellipsoid.h"

#include <Eigen/Eigenvalues>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "body/bounds.h"
#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

// Semi-axes from the moments; they lose digits where one is much longer.
bool guess(const Mat3& gyration, Ellipsoid* e) {
  const Eigen::SelfAdjointEigenSolver<Mat3> solver(gyration);
  e->axes = solver.eigenvectors();
  const Vec3 square = 2.5 * (Vec3::Constant(solver.eigenvalues().sum()) - 2 * solver.eigenvalues());
  if (!(square.minCoeff() > 0)) return false;
  e->semi = square.cwiseSqrt();
  return true;
}

// Points in coordinates in which the ellipsoid is the unit ball.
Vec3 to_ball(const Ellipsoid& e, const Vec3& x) {
  return (e.axes.transpose() * x).cwiseQuotient(e.semi);
}

// How far points of the surface are from it, in those coordinates.
bool fits(const std::vector<BezierPatch>& patches, const Ellipsoid& e) {
  for (const BezierPatch& patch : patches)
    for (const double u : {0.25, 0.75})
      for (const double v : {0.25, 0.75})
        if (!(std::abs(to_ball(e, evaluate0(patch, u, v)).squaredNorm() - 1) <= kEllipsoidGuess))
          return false;
  return true;
}

// The quadric through points of the surface by least squares, in those coordinates: y' (I + S) y + l' y = 1.
// A centre off the centre of mass, l, is none of a body that will be found.
void improve(const std::vector<BezierPatch>& patches, Ellipsoid* e) {
  constexpr int kPoints = 4;  // per parameter
  Eigen::Matrix<double, 9, 9> normal = Eigen::Matrix<double, 9, 9>::Zero();
  Eigen::Matrix<double, 9, 1> right = Eigen::Matrix<double, 9, 1>::Zero();
  for (const BezierPatch& patch : patches)
    for (int i = 0; i < kPoints; ++i)
      for (int k = 0; k < kPoints; ++k) {
        const Vec3 y = to_ball(*e, evaluate0(patch, (i + 0.5) / kPoints, (k + 0.5) / kPoints));
        Eigen::Matrix<double, 9, 1> row;
        row << y[0] * y[0], y[1] * y[1], y[2] * y[2], 2 * y[0] * y[1], 2 * y[0] * y[2], 2 * y[1] * y[2], y;
        normal += row * row.transpose();
        right += (1 - y.squaredNorm()) * row;
      }
  const Eigen::Matrix<double, 9, 1> off = normal.ldlt().solve(right);
  if (!(off.cwiseAbs().maxCoeff() < kEllipsoidGuess)) return;
  // To first order, which a repetition squares: y = (I - S / 2) z takes the unit ball of z to the quadric.
  Mat3 ball = Mat3::Identity();
  ball(0, 0) -= 0.5 * off[0];
  ball(1, 1) -= 0.5 * off[1];
  ball(2, 2) -= 0.5 * off[2];
  ball(0, 1) = ball(1, 0) = -0.5 * off[3];
  ball(0, 2) = ball(2, 0) = -0.5 * off[4];
  ball(1, 2) = ball(2, 1) = -0.5 * off[5];
  const Eigen::JacobiSVD<Mat3> svd(e->axes * e->semi.asDiagonal() * ball, Eigen::ComputeFullU);
  e->axes = svd.matrixU();
  e->semi = svd.singularValues();
}

// Bound of ||y|^2 - 1| over the patch, y as above.
double off_ball(BezierPatch patch, const Ellipsoid& e) {
  for (Vec4& p : patch.points) p.head<3>() = to_ball(e, p.head<3>());
  return bound_off_unit_sphere(patch);
}

}  // namespace

Ellipsoid find_ellipsoid(const std::vector<BezierPatch>& patches, const Mat3& gyration) {
  Ellipsoid e;
  if (!guess(gyration, &e) || !fits(patches, e)) return {};
  for (int k = 0; k < 3; ++k) improve(patches, &e);
  for (const BezierPatch& patch : patches) {
    e.error = std::max(e.error, off_ball(patch, e));  // of the square: twice the error of |y|
    if (!(e.error <= kEllipsoid)) return {};
  }
  e.root = e.axes * e.semi.asDiagonal() * e.axes.transpose();
  e.found = true;
  return e;
}

}  // namespace nurbs

// Affine maps of bodies and the match of an inertia tensor.
#include "nurbs/affine.h"

#include <Eigen/Eigenvalues>
#include <utility>

#include "body/mass_properties.h"

namespace nurbs {
namespace {

using SymmetricSolver = Eigen::SelfAdjointEigenSolver<Mat3>;

// Covariance of position from inertia / mass: J = tr(C) I - C.
Mat3 covariance(const Mat3& gyration) {
  return 0.5 * gyration.trace() * Mat3::Identity() - gyration;
}

}  // namespace

MassProperties solid_properties(const std::vector<NurbsSurface>& surfaces) {
  std::vector<BezierPatch> patches;
  for (const NurbsSurface& s : surfaces) {
    for (BezierPiece& piece : split_to_bezier(s)) patches.push_back(std::move(piece.patch));
  }
  return integrate_mass(patches);
}

void transform(std::vector<NurbsSurface>& surfaces, const Mat3& a, const Vec3& b) {
  for (NurbsSurface& s : surfaces) {
    for (Vec4& p : s.points) p.head<3>() = a * p.head<3>() + p[3] * b;
  }
}

void center(std::vector<NurbsSurface>& surfaces) {
  for (int pass = 0; pass < 2; ++pass) {  // the second removes the round-off of the first
    transform(surfaces, Mat3::Identity(), -solid_properties(surfaces).center);
  }
}

void match_gyration(std::vector<NurbsSurface>& surfaces, const Mat3& gyration) {
  const Mat3 wanted = covariance(gyration);
  const double least = SymmetricSolver(wanted, Eigen::EigenvaluesOnly).eigenvalues()[0];
  if (!(least > 1e-12 * wanted.trace())) {
    throw ShapeError(
        "inertia: the principal moments of a solid are positive and each is less than the sum of the other "
        "two");
  }
  const MassProperties mass = solid_properties(surfaces);
  const SymmetricSolver before(covariance(mass.inertia / mass.volume));
  const Mat3 root = before.operatorSqrt(), inverse_root = before.operatorInverseSqrt();
  const Mat3 map = inverse_root * SymmetricSolver(Mat3(root * wanted * root)).operatorSqrt() * inverse_root;
  transform(surfaces, 0.5 * (map + map.transpose()), Vec3::Zero());
  center(surfaces);
}

}  // namespace nurbs

// Bodies that are ellipsoids: found, and proven to be such, at load.
#pragma once

#include <vector>

#include "nurbs/bezier_patch.h"
#include "nurbs/types.h"

namespace nurbs {

// E = {x : |(axes diag(semi)^-1 axes') x| <= 1} about the centre of mass. Its support function is h(d) =
// |root d|, met at root' root d / h, with root = axes diag(semi) axes'.
struct Ellipsoid {
  bool found = false;
  Mat3 axes = Mat3::Identity();  // principal axes, columns, shape axes
  Vec3 semi = Vec3::Zero();      // semi-axes, lengths at scale 1
  Mat3 root = Mat3::Zero();      // symmetric
  double error = 0;              // the body lies between (1 - error) E and (1 + error) E

  double least() const { return semi.minCoeff(); }
};
template <class Archive>
void archive(Archive& a, Ellipsoid& s) {
  auto& [found, axes, semi, root, error] = s;
  a(found, axes, semi, root, error);
}

// Of h(d) = |root d| along unit d: where it is met, and d(point)/d(direction) in the tangent plane of d
// spanned by t and s. Zero where h is, square to a segment.
struct RootSupport {
  Vec3 point = Vec3::Zero();
  Mat2 turn = Mat2::Zero();
};
inline RootSupport root_support(const Mat3& root, const Vec3& d, const Vec3& t, const Vec3& s) {
  RootSupport found;
  const Vec3 at = root * d, at_t = root * t, at_s = root * s;
  const double h = at.norm();
  if (!(h > 0)) return found;
  const double xt = at.dot(at_t) / h, xs = at.dot(at_s) / h, ts = (at_t.dot(at_s) - xt * xs) / h;
  found.point = root * at / h;
  found.turn << (at_t.squaredNorm() - xt * xt) / h, ts, ts, (at_s.squaredNorm() - xs * xs) / h;
  return found;
}

// Of a closed body with inertia over mass `gyration` about its centre of mass, the origin. Proven: in
// coordinates in which E is the unit ball, the Bernstein coefficients of |x|^2 - w^2, x and w the patch's
// homogeneous coordinates, are small beside those of w^2, whatever the patches' parameters are. Found where
// the error is at most kEllipsoid.
Ellipsoid find_ellipsoid(const std::vector<BezierPatch>& patches, const Mat3& gyration);

}  // namespace nurbs

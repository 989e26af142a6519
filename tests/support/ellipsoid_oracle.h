// Signed distance of two solid ellipsoids by a method of its own, in long double: the support function of an
// ellipsoid is known in closed form, so p(d) = h_A(d) + h_B(-d) needs no surface, and its minimum over the
// sphere of directions is found from many starts. Shares no code with src/.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <vector>

namespace oracle {

using Real = long double;
using Vector = Eigen::Matrix<Real, 3, 1>;
using Matrix = Eigen::Matrix<Real, 3, 3>;

struct Ellipsoid {
  Vector center;
  Matrix square;  // Q diag(a^2, b^2, c^2) Q^T: h(d) = sqrt(d . square d) about the centre
};

inline Ellipsoid make_ellipsoid(const Eigen::Vector3d& semi_axes, const Eigen::Vector3d& center,
                                const Eigen::Quaterniond& q) {
  const Matrix turn = q.cast<Real>().normalized().toRotationMatrix();
  const Vector squares = semi_axes.cast<Real>().cwiseAbs2();
  return {center.cast<Real>(), turn * squares.asDiagonal() * turn.transpose()};
}

// Overlap along d with its gradient and Hessian in the tangent plane spanned by the columns of `basis`.
struct Overlap {
  Real p;
  Eigen::Matrix<Real, 2, 1> gradient;
  Eigen::Matrix<Real, 2, 2> hessian;
  Eigen::Matrix<Real, 3, 2> basis;
  Vector point_a, point_b;
};

inline Overlap overlap_along(const Ellipsoid& a, const Ellipsoid& b, const Vector& d) {
  Overlap o;
  const Vector ad = a.square * d, bd = b.square * d;
  const Real ha = std::sqrt(d.dot(ad)), hb = std::sqrt(d.dot(bd));
  o.point_a = a.center + ad / ha;
  o.point_b = b.center - bd / hb;
  o.p = d.dot(a.center - b.center) + ha + hb;
  const Vector e1 = d.unitOrthogonal();
  o.basis << e1, d.cross(e1);
  o.gradient = o.basis.transpose() * (o.point_a - o.point_b);
  const Matrix full = a.square / ha - ad * ad.transpose() / (ha * ha * ha) + b.square / hb -
                      bd * bd.transpose() / (hb * hb * hb);
  o.hessian = o.basis.transpose() * full * o.basis - o.p * Eigen::Matrix<Real, 2, 2>::Identity();
  return o;
}

// Damped Newton descent of p from d to a stationary point with positive semi-definite Hessian.
inline Vector descend(const Ellipsoid& a, const Ellipsoid& b, Vector d) {
  Overlap here = overlap_along(a, b, d);
  for (int iteration = 0; iteration < 200; ++iteration) {
    const Real trace = here.hessian.trace(), det = here.hessian.determinant();
    const Real least = trace / 2 - std::sqrt(std::max(Real(0), trace * trace / 4 - det));
    const Real size = std::abs(trace) + std::abs(here.p);
    const Real shift = std::max(Real(0), Real(1e-6L) * size - least);
    Eigen::Matrix<Real, 2, 2> h = here.hessian + shift * Eigen::Matrix<Real, 2, 2>::Identity();
    Eigen::Matrix<Real, 2, 1> step;
    step << h(1, 1) * here.gradient[0] - h(0, 1) * here.gradient[1],
        h(0, 0) * here.gradient[1] - h(1, 0) * here.gradient[0];
    step /= -h.determinant();
    if (step.norm() > 0.5L) step *= 0.5L / step.norm();
    bool moved = false;
    for (int halving = 0; halving < 40 && !moved; ++halving, step /= 2) {
      const Vector next_d = (d + here.basis * step).normalized();
      const Overlap next = overlap_along(a, b, next_d);
      if (next.p < here.p || (halving == 0 && next.gradient.norm() < here.gradient.norm() / 2 &&
                              next.p <= here.p + 1e-17L * size)) {
        d = next_d;
        here = next;
        moved = true;
      }
    }
    if (!moved || step.norm() < 1e-19L) break;
  }
  return d;
}

struct Answer {
  Real gap;       // minus the least overlap: > 0 apart, < 0 overlap depth
  Vector normal;  // from A towards B
  Vector point_a, point_b;
  Real runner_up;  // gap of the next local minimum of p with another direction, -infinity when there is none
};

// The global minimum of p over unit d: Newton from the best of `starts` directions spread evenly (golden
// spiral) and all that are lower than their neighbours by being lowest in one of 26 sectors.
inline Answer signed_distance(const Ellipsoid& a, const Ellipsoid& b, int starts = 2000) {
  struct Start {
    Real p = INFINITY;
    Vector d = Vector::Zero();
  };
  std::vector<Start> sectors(27);
  const Real golden = std::acos(Real(-1)) * (3 - std::sqrt(Real(5)));
  for (int i = 0; i < starts; ++i) {
    const Real z = 1 - (2 * i + 1) / Real(starts), r = std::sqrt(1 - z * z);
    const Vector d(r * std::cos(golden * i), r * std::sin(golden * i), z);
    const Vector ad = a.square * d, bd = b.square * d;
    const Real p = d.dot(a.center - b.center) + std::sqrt(d.dot(ad)) + std::sqrt(d.dot(bd));
    int sector = 0;
    for (int k = 0; k < 3; ++k) sector = 3 * sector + (d[k] > 0.4L ? 2 : d[k] < -0.4L ? 0 : 1);
    if (p < sectors[sector].p) sectors[sector] = {p, d};
  }
  std::vector<Vector> minima;
  for (const Start& start : sectors)
    if (std::isfinite(start.p)) minima.push_back(descend(a, b, start.d));
  const auto overlap = [&](const Vector& d) { return overlap_along(a, b, d).p; };
  const Vector best = *std::min_element(minima.begin(), minima.end(), [&](const Vector& x, const Vector& y) {
    return overlap(x) < overlap(y);
  });
  Real second = INFINITY;
  for (const Vector& d : minima)
    if ((d - best).norm() > 1e-3L) second = std::min(second, overlap(d));
  const Overlap o = overlap_along(a, b, best);
  return {-o.p, best, o.point_a, o.point_b, -second};
}

}  // namespace oracle

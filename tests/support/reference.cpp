// Long-double evaluation of Bezier patches and Newton on a pair of contact points.
#include "support/reference.h"

#include <Eigen/LU>
#include <cmath>

#include "contact/pair_memory.h"
#include "contact/pair_search.h"

namespace nurbs::test {
namespace {

using Real = long double;
using Vector = Eigen::Matrix<Real, 3, 1>;
using Matrix = Eigen::Matrix<Real, 3, 3>;
using Vector4 = Eigen::Matrix<Real, 4, 1>;
using Matrix4 = Eigen::Matrix<Real, 4, 4>;

constexpr int kNewtonSteps = 12;
constexpr Real kConverged = 1e-17L;  // last step in the parameters
constexpr double kOutsideBracket =
    1e-13;                        // by which the polished gap may leave the certified bracket, relative
constexpr Real kOutside = 1e-9L;  // by which a parameter may leave its patch

struct Jet {
  Vector s, u, v, uu, uv, vv;
};

// Bernstein polynomials of degree n at t.
void bernstein(int n, Real t, Real* b) {
  b[0] = 1;
  for (int m = 1; m <= n; ++m) {
    b[m] = t * b[m - 1];
    for (int i = m - 1; i > 0; --i) b[i] = (1 - t) * b[i] + t * b[i - 1];
    b[0] *= 1 - t;
  }
}

// The basis and its first two derivatives: differences of the bases one and two degrees lower.
void basis(int n, Real t, Real (&b)[3][kMaxDegree + 1]) {
  bernstein(n, t, b[0]);
  for (int order = 1; order <= 2; ++order) {
    Real low[kMaxDegree + 3] = {};
    if (n >= order) bernstein(n - order, t, low + order);  // low[order + i] is B_i; zero around it
    for (int i = 0; i <= n; ++i) {
      const auto at = [&](int k) { return k < 0 || k > n - order ? Real(0) : low[order + k]; };
      b[order][i] =
          order == 1 ? n * (at(i - 1) - at(i)) : Real(n) * (n - 1) * (at(i - 2) - 2 * at(i - 1) + at(i));
    }
  }
}

Jet evaluate(const BezierPatch& patch, Real u, Real v) {
  Real bu[3][kMaxDegree + 1], bv[3][kMaxDegree + 1];
  basis(patch.degree_u, u, bu);
  basis(patch.degree_v, v, bv);
  Vector4 h[3][3];
  for (auto& row : h)
    for (auto& x : row) x.setZero();
  for (int i = 0; i <= patch.degree_u; ++i)
    for (int j = 0; j <= patch.degree_v; ++j) {
      const Vector4 c = patch.point(i, j).cast<Real>();
      for (int k = 0; k <= 2; ++k)
        for (int l = 0; k + l <= 2; ++l) h[k][l] += bu[k][i] * bv[l][j] * c;
    }
  const Real w = h[0][0][3];
  Jet r;
  r.s = h[0][0].head<3>() / w;
  r.u = (h[1][0].head<3>() - h[1][0][3] * r.s) / w;
  r.v = (h[0][1].head<3>() - h[0][1][3] * r.s) / w;
  r.uu = (h[2][0].head<3>() - 2 * h[1][0][3] * r.u - h[2][0][3] * r.s) / w;
  r.uv = (h[1][1].head<3>() - h[1][0][3] * r.v - h[0][1][3] * r.u - h[1][1][3] * r.s) / w;
  r.vv = (h[0][2].head<3>() - 2 * h[0][1][3] * r.v - h[0][2][3] * r.s) / w;
  return r;
}

// The jet of a placed body, relative to A's centre.
Jet place(const Particle& p, const Vector& offset, const Jet& j) {
  const Matrix turn = Real(p.scale) * p.q.cast<Real>().normalized().toRotationMatrix();
  return {offset + turn * j.s, turn * j.u, turn * j.v, turn * j.uu, turn * j.uv, turn * j.vv};
}

struct System {
  Vector4 residual;
  Matrix4 jacobian;
};

// g.A_u = g.A_v = 0, B_u.N = B_v.N = 0 with g = A - B, N = A_u x A_v.
System contact_equations(const Jet& a, const Jet& b) {
  const Vector g = a.s - b.s, n = a.u.cross(a.v);
  const Vector nu = a.uu.cross(a.v) + a.u.cross(a.uv), nv = a.uv.cross(a.v) + a.u.cross(a.vv);
  System s;
  s.residual << g.dot(a.u), g.dot(a.v), b.u.dot(n), b.v.dot(n);
  s.jacobian << a.u.dot(a.u) + g.dot(a.uu), a.v.dot(a.u) + g.dot(a.uv), -b.u.dot(a.u), -b.v.dot(a.u),
      a.u.dot(a.v) + g.dot(a.uv), a.v.dot(a.v) + g.dot(a.vv), -b.u.dot(a.v), -b.v.dot(a.v),  //
      b.u.dot(nu), b.u.dot(nv), b.uu.dot(n), b.uv.dot(n),                                    //
      b.v.dot(nu), b.v.dot(nv), b.uv.dot(n), b.vv.dot(n);
  return s;
}

}  // namespace

Reference make_reference(const Pair& pair) {
  ContactSettings settings;
  settings.tolerance = 1e-14;
  PairMemory memory = {};
  const ContactResult ours = find_contact(pair.a, pair.b, settings, reinterpret_cast<double*>(&memory));
  const Reference fallback{ours.gap, ours.normal, ours.point_a, ours.point_b, false};
  const BezierPatch &patch_a = pair.a.shape->patches[static_cast<int>(memory.on_a.patch)],
                    &patch_b = pair.b.shape->patches[static_cast<int>(memory.on_b.patch)];
  const Vector offset = pair.b.x.cast<Real>() - pair.a.x.cast<Real>();
  Vector4 at(memory.on_a.u, memory.on_a.v, memory.on_b.u, memory.on_b.v);
  Real last = 1;
  for (int k = 0; k < kNewtonSteps && last > kConverged; ++k) {
    const System s = contact_equations(place(pair.a, Vector::Zero(), evaluate(patch_a, at[0], at[1])),
                                       place(pair.b, offset, evaluate(patch_b, at[2], at[3])));
    const Vector4 step = s.jacobian.fullPivLu().solve(s.residual);
    at -= step;
    last = step.cwiseAbs().maxCoeff();
    if (!(last < 0.1L) || at.minCoeff() < -kOutside || at.maxCoeff() > 1 + kOutside) return fallback;
  }
  const Jet a = place(pair.a, Vector::Zero(), evaluate(patch_a, at[0], at[1]));
  const Jet b = place(pair.b, offset, evaluate(patch_b, at[2], at[3]));
  const Vector normal = a.u.cross(a.v).normalized();
  const double gap = static_cast<double>(normal.dot(b.s - a.s));
  const double slack = kOutsideBracket * pair.a.scale * pair.a.shape->bounding_radius;
  if (last > 1e-14L || normal.dot(ours.normal.cast<Real>()) < 0.999L || gap < ours.lower - slack ||
      gap > ours.upper + slack)
    return fallback;
  return {gap, normal.cast<double>(), a.s.cast<double>(), b.s.cast<double>(), true};
}

}  // namespace nurbs::test

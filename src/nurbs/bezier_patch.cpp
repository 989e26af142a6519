// Tensor-product Bernstein evaluation in homogeneous coordinates, four lanes (wx, wy, wz, w) at a time, then
// the quotient rule (NURBS Book, eqs 4.8 and 4.20). Degrees 1 to 4 in both directions are unrolled at compile
// time; every other pair of degrees runs the same code with run-time bounds.
#include "nurbs/bezier_patch.h"

#include "nurbs/lanes.h"

namespace nurbs {
namespace {

// Bernstein polynomials of degree n and their first `Order` derivatives at t, the latter over n!/(n-k)!:
// b[k][i] is the k-th backward difference of the basis of degree n - k. The basis is raised one degree at a
// time. N is the degree, or 0 to take it at run time; Real a number, or several side by side.
template <int N, int Order, class Real>
NURBS_INLINE void bernstein(int degree, const Real& t, Real (&b)[Order + 1][kMaxDegree + 1]) {
  const int n = N ? N : degree;
  const Real zero = t - t, s = 1.0 - t;
  Real row[kMaxDegree + 1] = {zero + 1.0};
#pragma GCC unroll 10
  for (int m = 0; m <= n; ++m) {
    const int k = n - m;
    if (k <= Order) {
      Real* const out = b[k];
#pragma GCC unroll 10
      for (int i = 0; i <= m; ++i) out[i] = row[i];
#pragma GCC unroll 4
      for (int j = m; j < n; ++j) {
        out[j + 1] = out[j];
#pragma GCC unroll 10
        for (int i = j; i > 0; --i) out[i] = out[i - 1] - out[i];
        out[0] = -out[0];
      }
    }
    if (m == n) break;
    Real carry = zero;
#pragma GCC unroll 10
    for (int i = 0; i <= m; ++i) {
      const Real term = row[i];
      row[i] = carry + s * term;
      carry = t * term;
    }
    row[m + 1] = carry;
  }
  for (int k = n + 1; k <= Order; ++k)
    for (int i = 0; i <= n; ++i) b[k][i] = zero;
}

constexpr int kJetSize[] = {1, 3, 6, 10};

// Position of the (a, b) derivative in a jet ordered s, u, v, uu, uv, vv, uuu, uuv, uvv, vvv.
constexpr int slot(int a, int b) {
  return (a + b) * (a + b + 1) / 2 + b;
}

// n!/(n-k)!
constexpr double falling(int n, int k) {
  return k == 0 ? 1.0 : n * falling(n - 1, k - 1);
}

// Homogeneous derivatives of the net at (u, v). P and Q are the degrees, or 0 to take them at run time.
template <int P, int Q, int Order>
NURBS_INLINE void homogeneous(const BezierPatch& patch, double u, double v, Lane4* sum) {
  const int p = P ? P : patch.degree_u;
  const int q = Q ? Q : patch.degree_v;
  double bu[Order + 1][kMaxDegree + 1], bv[Order + 1][kMaxDegree + 1];
  if constexpr (P > 0 && P == Q) {  // both at once
    Lane2 both[Order + 1][kMaxDegree + 1];
    bernstein<P, Order>(p, Lane2{u, v}, both);
#pragma GCC unroll 4
    for (int k = 0; k <= Order; ++k)
#pragma GCC unroll 10
      for (int i = 0; i <= P; ++i) bu[k][i] = both[k][i][0], bv[k][i] = both[k][i][1];
  } else {
    bernstein<P, Order>(p, u, bu);
    bernstein<Q, Order>(q, v, bv);
  }
  const Vec4* point = patch.points.data();
#pragma GCC unroll 5
  for (int i = 0; i <= p; ++i) {
    Lane4 row[Order + 1];
#pragma GCC unroll 5
    for (int j = 0; j <= q; ++j, ++point) {
      Lane4 c;
      load(*point, c);
#pragma GCC unroll 4
      for (int k = 0; k <= Order; ++k) row[k] = j == 0 ? bv[k][j] * c : row[k] + bv[k][j] * c;
    }
#pragma GCC unroll 4
    for (int a = 0; a <= Order; ++a)
#pragma GCC unroll 4
      for (int b = 0; a + b <= Order; ++b) {
        Lane4& to = sum[slot(a, b)];
        to = i == 0 ? bu[a][i] * row[b] : to + bu[a][i] * row[b];
      }
  }
#pragma GCC unroll 4
  for (int a = 0; a <= Order; ++a)
#pragma GCC unroll 4
    for (int b = 0; a + b <= Order; ++b)
      if (a + b > 0) sum[slot(a, b)] *= falling(p, a) * falling(q, b);
}

// Quotient rule in place: homogeneous derivatives become derivatives of the Cartesian surface.
template <int Order>
NURBS_INLINE void divide_by_weight(Lane4* a) {
  const double r = 1.0 / a[0][3];
  const auto w = [&](int k) { return a[k][3]; };
  Lane4 s[kJetSize[Order]];
  s[0] = r * a[0];
  if constexpr (Order >= 1) {
    s[1] = r * (a[1] - w(1) * s[0]);
    s[2] = r * (a[2] - w(2) * s[0]);
  }
  if constexpr (Order >= 2) {
    s[3] = r * (a[3] - 2.0 * w(1) * s[1] - w(3) * s[0]);
    s[4] = r * (a[4] - w(1) * s[2] - w(2) * s[1] - w(4) * s[0]);
    s[5] = r * (a[5] - 2.0 * w(2) * s[2] - w(5) * s[0]);
  }
  if constexpr (Order >= 3) {
    s[6] = r * (a[6] - 3.0 * (w(1) * s[3] + w(3) * s[1]) - w(6) * s[0]);
    s[7] = r * (a[7] - 2.0 * (w(1) * s[4] + w(4) * s[1]) - w(2) * s[3] - w(3) * s[2] - w(7) * s[0]);
    s[8] = r * (a[8] - 2.0 * (w(2) * s[4] + w(4) * s[2]) - w(1) * s[5] - w(5) * s[1] - w(8) * s[0]);
    s[9] = r * (a[9] - 3.0 * (w(2) * s[5] + w(5) * s[2]) - w(9) * s[0]);
  }
  for (int k = 0; k < kJetSize[Order]; ++k) a[k] = s[k];
}

template <int Order>
NURBS_INLINE void jet(const BezierPatch& patch, double u, double v, Lane4* a) {
  switch (patch.degree_u == patch.degree_v ? patch.degree_u : 0) {
    case 1:
      homogeneous<1, 1, Order>(patch, u, v, a);
      break;
    case 2:
      homogeneous<2, 2, Order>(patch, u, v, a);
      break;
    case 3:
      homogeneous<3, 3, Order>(patch, u, v, a);
      break;
    case 4:
      homogeneous<4, 4, Order>(patch, u, v, a);
      break;
    default:
      homogeneous<0, 0, Order>(patch, u, v, a);
  }
  if (patch.rational) divide_by_weight<Order>(a);
}

template <int Order>
NURBS_INLINE void jet(const BezierPatch& patch, double u, double v, Vec3* const* out) {
  Lane4 a[kJetSize[Order]] = {};
  jet<Order>(patch, u, v, a);
  for (int k = 0; k < kJetSize[Order]; ++k) to_vec3(a[k], *out[k]);
}

}  // namespace

Vec3 evaluate0(const BezierPatch& patch, double u, double v) {
  Vec3 s;
  Vec3* const out[] = {&s};
  jet<0>(patch, u, v, out);
  return s;
}

Jet1 evaluate1(const BezierPatch& patch, double u, double v) {
  Jet1 j;
  Vec3* const out[] = {&j.s, &j.su, &j.sv};
  jet<1>(patch, u, v, out);
  return j;
}

Jet2 evaluate2(const BezierPatch& patch, double u, double v) {
  Jet2 j;
  Vec3* const out[] = {&j.s, &j.su, &j.sv, &j.suu, &j.suv, &j.svv};
  jet<2>(patch, u, v, out);
  return j;
}

void evaluate2(const BezierPatch& patch, double u, double v, JetLanes* out) {
  Lane4 a[8] = {};
  jet<2>(patch, u, v, a);
  Lane4 low[4], high[4];
  transpose({a[0], a[1], a[2], a[3]}, low);
  transpose({a[4], a[5], a[6], a[7]}, high);
  Lane8* const row[] = {&out->x, &out->y, &out->z};
  for (int k = 0; k < 3; ++k) join(low[k], high[k], *row[k]);
}

Jet3 evaluate3(const BezierPatch& patch, double u, double v) {
  Jet3 j;
  Vec3* const out[] = {&j.s, &j.su, &j.sv, &j.suu, &j.suv, &j.svv, &j.suuu, &j.suuv, &j.suvv, &j.svvv};
  jet<3>(patch, u, v, out);
  return j;
}

}  // namespace nurbs

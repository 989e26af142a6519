// Tensor-product Bernstein evaluation in homogeneous coordinates, four lanes (wx, wy, wz, w) at a time, then
// the quotient rule (NURBS Book, eqs 4.8 and 4.20). Degrees 1 to 4 in both directions are unrolled at compile
// time; every other pair of degrees runs the same code with run-time bounds.
#include "geometry/bezier_patch.h"

#include <cstring>

namespace nurbs {
namespace {

using Lane4 = double __attribute__((vector_size(32)));

// Helpers are inlined so that no vector crosses a call: the calling convention then does not depend on the
// ARCH.
#define NURBS_INLINE inline __attribute__((always_inline))

NURBS_INLINE void load(const Vec4& from, Lane4& to) {
  std::memcpy(&to, from.data(), sizeof to);
}

NURBS_INLINE void to_vec3(const Lane4& lanes, Vec3& out) {
  out[0] = lanes[0];
  out[1] = lanes[1];
  out[2] = lanes[2];
}

// Bernstein polynomials of degree n and their first `Order` derivatives at t: b[k][i] is the k-th derivative
// of B_{i,n}. The basis is raised one degree at a time; the k-th derivative is n!/(n-k)! times the k-th
// backward difference of the basis of degree n - k. N is the degree, or 0 to take it at run time.
template <int N, int Order>
NURBS_INLINE void bernstein(int degree, double t, double (&b)[Order + 1][kMaxDegree + 1]) {
  const int n = N ? N : degree;
  const double s = 1.0 - t;
  double row[kMaxDegree + 1] = {1.0};
#pragma GCC unroll 10
  for (int m = 0; m <= n; ++m) {
    const int k = n - m;
    if (k <= Order) {
      double scale = 1.0;
#pragma GCC unroll 4
      for (int j = 0; j < k; ++j) scale *= n - j;
      double* const out = b[k];
#pragma GCC unroll 10
      for (int i = 0; i <= m; ++i) out[i] = scale * row[i];
#pragma GCC unroll 4
      for (int j = m; j < n; ++j) {
        out[j + 1] = out[j];
#pragma GCC unroll 10
        for (int i = j; i > 0; --i) out[i] = out[i - 1] - out[i];
        out[0] = -out[0];
      }
    }
    if (m == n) break;
    double carry = 0.0;
#pragma GCC unroll 10
    for (int i = 0; i <= m; ++i) {
      const double term = row[i];
      row[i] = carry + s * term;
      carry = t * term;
    }
    row[m + 1] = carry;
  }
  for (int k = n + 1; k <= Order; ++k)
    for (int i = 0; i <= n; ++i) b[k][i] = 0.0;
}

constexpr int kJetSize[] = {1, 3, 6, 10};

// Position of the (a, b) derivative in a jet ordered s, u, v, uu, uv, vv, uuu, uuv, uvv, vvv.
constexpr int slot(int a, int b) {
  return (a + b) * (a + b + 1) / 2 + b;
}

// Homogeneous derivatives of the net at (u, v). P and Q are the degrees, or 0 to take them at run time.
template <int P, int Q, int Order>
NURBS_INLINE void homogeneous(const BezierPatch& patch, double u, double v, Lane4* out) {
  const int p = P ? P : patch.degree_u;
  const int q = Q ? Q : patch.degree_v;
  double bu[Order + 1][kMaxDegree + 1], bv[Order + 1][kMaxDegree + 1];
  bernstein<P, Order>(p, u, bu);
  bernstein<Q, Order>(q, v, bv);
  Lane4 sum[kJetSize[Order]];
  for (Lane4& lanes : sum) lanes = Lane4{0, 0, 0, 0};
  const Vec4* point = patch.points.data();
#pragma GCC unroll 5
  for (int i = 0; i <= p; ++i) {
    Lane4 row[Order + 1];
    for (Lane4& lanes : row) lanes = Lane4{0, 0, 0, 0};
#pragma GCC unroll 5
    for (int j = 0; j <= q; ++j, ++point) {
      Lane4 c;
      load(*point, c);
      for (int k = 0; k <= Order; ++k) row[k] += bv[k][j] * c;
    }
    for (int a = 0; a <= Order; ++a)
      for (int b = 0; a + b <= Order; ++b) sum[slot(a, b)] += bu[a][i] * row[b];
  }
  for (int k = 0; k < kJetSize[Order]; ++k) out[k] = sum[k];
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
NURBS_INLINE void jet(const BezierPatch& patch, double u, double v, Vec3* const* out) {
  Lane4 a[kJetSize[Order]];
  const int p = patch.degree_u;
  if (p != patch.degree_v)
    homogeneous<0, 0, Order>(patch, u, v, a);
  else if (p == 3)
    homogeneous<3, 3, Order>(patch, u, v, a);
  else if (p == 4)
    homogeneous<4, 4, Order>(patch, u, v, a);
  else if (p == 2)
    homogeneous<2, 2, Order>(patch, u, v, a);
  else if (p == 1)
    homogeneous<1, 1, Order>(patch, u, v, a);
  else
    homogeneous<0, 0, Order>(patch, u, v, a);
  if (patch.rational) divide_by_weight<Order>(a);
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

Jet3 evaluate3(const BezierPatch& patch, double u, double v) {
  Jet3 j;
  Vec3* const out[] = {&j.s, &j.su, &j.sv, &j.suu, &j.suv, &j.svv, &j.suuu, &j.suuv, &j.suvv, &j.svvv};
  jet<3>(patch, u, v, out);
  return j;
}

}  // namespace nurbs

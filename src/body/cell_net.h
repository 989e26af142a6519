// Control nets of cells, of one or of kWidth side by side, and hulls of what they and their derivatives are:
// the first half of an enclosure (enclosure.h).
#pragma once

#include <algorithm>
#include <array>

#include "body/affine_form.h"
#include "nurbs/bezier_patch.h"

namespace nurbs::cells {

// Numbers of one cell, or of kWidth side by side.
template <class Real>
constexpr int kLanes = static_cast<int>(sizeof(Real) / sizeof(double));
NURBS_INLINE double get(double x, int) {
  return x;
}
NURBS_INLINE double get(const Wide& x, int lane) {
  return x[lane];
}
NURBS_INLINE void put(double value, int, double* x) {
  *x = value;
}
NURBS_INLINE void put(double value, int lane, Wide* x) {
  (*x)[lane] = value;
}
template <class Real>
NURBS_INLINE void put(const Vec3& value, int lane, Triple<Real>* x) {
  put(value[0], lane, &x->x);
  put(value[1], lane, &x->y);
  put(value[2], lane, &x->z);
}
template <class Real>
NURBS_INLINE void put(const Mat3& value, int lane, Turn<Real>* x) {
  for (int k = 0; k < 3; ++k) put(Vec3(value.row(k)), lane, &x->row[k]);
}

// Coordinates of a vector and a weight; side by side in one register, as GCC 12 takes them to be.
template <class Real>
struct Point {
  alignas(4 * sizeof(double)) alignas(Real) Real at[4];
};
// A net of at most kMaxDegree + 1 rows, v fastest.
template <class Real>
struct Net {
  int m = 0, n = 0;  // degrees
  Point<Real> c[(kMaxDegree + 1) * (kMaxDegree + 1)];
  Point<Real>& at(int i, int j) { return c[i * (n + 1) + j]; }
  const Point<Real>& at(int i, int j) const { return c[i * (n + 1) + j]; }
};
// Those coordinates that a net has: a patch that is not rational has no weights.
struct Coordinates {
  int first, end;
};

template <class Real>
void differ_u(const Net<Real>& f, Coordinates which, Net<Real>* d) {
  d->m = std::max(f.m - 1, 0);
  d->n = f.n;
  for (int i = 0; i <= d->m; ++i)
    for (int j = 0; j <= d->n; ++j)
      for (int k = which.first; k < which.end; ++k)
        d->at(i, j).at[k] = f.m > 0 ? Real(double(f.m) * (f.at(i + 1, j).at[k] - f.at(i, j).at[k])) : Real{};
}
template <class Real>
void differ_v(const Net<Real>& f, Coordinates which, Net<Real>* d) {
  d->m = f.m;
  d->n = std::max(f.n - 1, 0);
  for (int i = 0; i <= d->m; ++i)
    for (int j = 0; j <= d->n; ++j)
      for (int k = which.first; k < which.end; ++k)
        d->at(i, j).at[k] = f.n > 0 ? Real(double(f.n) * (f.at(i, j + 1).at[k] - f.at(i, j).at[k])) : Real{};
}

// A function and its derivatives up to the third order: vector and weight.
enum Order { k0, kU, kV, kUU, kUV, kVV, kUUU, kUUV, kUVV, kVVV, kOrders };
template <class Real>
struct Hull {
  AffineVector<Real> x;
  Affine<Real> w;
};
template <class Real>
using Hulls = std::array<Hull<Real>, kOrders>;

// The plane through the net's corners on the average, and how far the other coefficients are from it: a
// linear function is its own net at equally spaced parameters.
template <class Real>
Affine<Real> plane_of(const Net<Real>& f, int k, const Real& noise) {
  const Real &p = f.at(0, 0).at[k], &q = f.at(0, f.n).at[k], &r = f.at(f.m, 0).at[k],
             &s = f.at(f.m, f.n).at[k];
  Real c = 0.25 * (p + q + r + s);
  const Real a = 0.25 * (r + s - p - q), b = 0.25 * (q + s - p - r);
  const Real step_a = f.m > 0 ? Real((2.0 / f.m) * a) : Real{},
             step_b = f.n > 0 ? Real((2.0 / f.n) * b) : Real{};
  Real row = c;
  if (f.m > 0) row = row - a;
  if (f.n > 0) row = row - b;
  Real low = p - row, high = low;
  for (int i = 0; i <= f.m; ++i, row = row + step_a) {
    Real plane = row;
    for (int j = 0; j <= f.n; ++j, plane = plane + step_b) {
      const Real off = f.at(i, j).at[k] - plane;
      low = smaller(off, low);
      high = larger(off, high);
    }
  }
  return {c + 0.5 * (low + high), a, b, 0.5 * (high - low) + noise};
}
template <class Real>
void hull_of(const Net<Real>& f, Coordinates which, const Point<Real>& noise, double factor,
             Hull<Real>* hull) {
  Affine<Real>* const to[] = {&hull->x.x, &hull->x.y, &hull->x.z, &hull->w};
  for (int k = which.first; k < which.end; ++k) *to[k] = plane_of<Real>(f, k, factor * noise.at[k]);
}

// `noise`: bound of the round-off of a coefficient, which each difference at most doubles before its factor.
template <class Real>
void hulls_of(const Net<Real>& f, Coordinates which, const Point<Real>& noise, bool third, Hulls<Real>* h) {
  Net<Real> u, v, w;
  const double m = 2 * f.m, n = 2 * f.n;
  hull_of(f, which, noise, 1, &(*h)[k0]);
  differ_u(f, which, &u);
  hull_of(u, which, noise, m, &(*h)[kU]);
  differ_v(u, which, &v);
  hull_of(v, which, noise, m * n, &(*h)[kUV]);
  if (third) {
    differ_v(v, which, &w);
    hull_of(w, which, noise, m * n * n, &(*h)[kUVV]);
    differ_u(v, which, &w);
    hull_of(w, which, noise, m * m * n, &(*h)[kUUV]);
  }
  differ_u(u, which, &w);
  hull_of(w, which, noise, m * m, &(*h)[kUU]);
  if (third) {
    differ_u(w, which, &v);
    hull_of(v, which, noise, m * m * m, &(*h)[kUUU]);
  }
  differ_v(f, which, &v);
  hull_of(v, which, noise, n, &(*h)[kV]);
  differ_v(v, which, &w);
  hull_of(w, which, noise, n * n, &(*h)[kVV]);
  if (third) {
    differ_v(w, which, &v);
    hull_of(v, which, noise, n * n * n, &(*h)[kVVV]);
  }
}

template <class Real>
using Derivatives = std::array<AffineVector<Real>, kOrders>;

// Of the quotient x / w by Leibniz' rule; where w may vanish it says nothing. `rational`: else w is 1.
template <class Real>
void divide(const Hulls<Real>& h, bool rational, bool third, Derivatives<Real>* y) {
  if (!rational) {
    for (int k = 0; k < (third ? kOrders : kUUU); ++k) (*y)[k] = h[k].x;
    return;
  }
  const auto w = [&](Order k) -> const Affine<Real>& { return h[k].w; };
  const Affine<Real> one = inverse(w(k0));
  Derivatives<Real>& d = *y;
  d[k0] = one * h[k0].x;
  d[kU] = one * (h[kU].x - w(kU) * d[k0]);
  d[kV] = one * (h[kV].x - w(kV) * d[k0]);
  d[kUU] = one * (h[kUU].x - 2.0 * (w(kU) * d[kU]) - w(kUU) * d[k0]);
  d[kUV] = one * (h[kUV].x - w(kU) * d[kV] - w(kV) * d[kU] - w(kUV) * d[k0]);
  d[kVV] = one * (h[kVV].x - 2.0 * (w(kV) * d[kV]) - w(kVV) * d[k0]);
  if (!third) return;
  d[kUUU] = one * (h[kUUU].x - 3.0 * (w(kU) * d[kUU]) - 3.0 * (w(kUU) * d[kU]) - w(kUUU) * d[k0]);
  d[kUUV] = one * (h[kUUV].x - 2.0 * (w(kU) * d[kUV]) - w(kV) * d[kUU] - w(kUU) * d[kV] -
                   2.0 * (w(kUV) * d[kU]) - w(kUUV) * d[k0]);
  d[kUVV] = one * (h[kUVV].x - 2.0 * (w(kV) * d[kUV]) - w(kU) * d[kVV] - w(kVV) * d[kU] -
                   2.0 * (w(kUV) * d[kV]) - w(kUVV) * d[k0]);
  d[kVVV] = one * (h[kVVV].x - 3.0 * (w(kV) * d[kVV]) - 3.0 * (w(kVV) * d[kV]) - w(kVVV) * d[k0]);
}

// De Casteljau at `high`, then what is left at `low`, of coefficients `stride` apart.
template <class Real>
void restrict_row(const Real& high, const Real& low_share, int degree, int stride, int k, Point<Real>* c) {
  const Real below = 1.0 - high, above = 1.0 - low_share;
  for (int step = 1; step <= degree; ++step)
    for (int i = degree; i >= step; --i)
      c[i * stride].at[k] = below * c[(i - 1) * stride].at[k] + high * c[i * stride].at[k];
  for (int step = 1; step <= degree; ++step)
    for (int i = 0; i <= degree - step; ++i)
      c[i * stride].at[k] = above * c[i * stride].at[k] + low_share * c[(i + 1) * stride].at[k];
}

// Where the cells are in their patches: each parameter's upper end, and the lower one's share of it.
template <class Real>
struct Sections {
  Real high_u, low_u, high_v, low_v;
};
template <class Real>
void restrict_net(const Sections<Real>& to, Coordinates which, Net<Real>* net) {
  const int row = net->n + 1;
  for (int k = which.first; k < which.end; ++k) {
    for (int j = 0; j < row; ++j) restrict_row(to.high_u, to.low_u, net->m, row, k, net->c + j);
    for (int i = 0; i <= net->m; ++i) restrict_row(to.high_v, to.low_v, net->n, 1, k, net->c + i * row);
  }
}

}  // namespace nurbs::cells

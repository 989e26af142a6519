// Numbers that depend on two parameters, known to first order: c + a s + b t + e for s, t in [-1, 1] and some
// |e| <= r. Sums and products hold whatever the true values are (affine arithmetic; de Figueiredo & Stolfi
// 2004), and what is common to two factors is not counted twice: the excess is of second order in the size of
// a cell. Round-off is not counted here: enclosure.cpp adds it once.
#pragma once

#include <cmath>

#include "nurbs/types.h"
#include "nurbs/wide.h"

namespace nurbs {

// `Real` is a double, or Wide: forms of as many cells side by side.
template <class Real>
struct Affine {
  Real c{}, a{}, b{}, r{};
  Real spread() const { return magnitude(a) + magnitude(b) + r; }
  Real low() const { return c - spread(); }
  Real high() const { return c + spread(); }
  Real most() const { return magnitude(c) + spread(); }  // largest |x|
};
template <class Real>
NURBS_INLINE Affine<Real> operator+(const Affine<Real>& x, const Affine<Real>& y) {
  return {x.c + y.c, x.a + y.a, x.b + y.b, x.r + y.r};
}
template <class Real>
NURBS_INLINE Affine<Real> operator-(const Affine<Real>& x, const Affine<Real>& y) {
  return {x.c - y.c, x.a - y.a, x.b - y.b, x.r + y.r};
}
// By a number: a double, the same for all cells, or one for each.
template <class Real>
NURBS_INLINE Affine<Real> scaled(const Real& k, const Affine<Real>& x) {
  return {k * x.c, k * x.a, k * x.b, magnitude(k) * x.r};
}
template <class Real>
NURBS_INLINE Affine<Real> operator*(double k, const Affine<Real>& x) {
  return {k * x.c, k * x.a, k * x.b, std::abs(k) * x.r};
}
template <class Real>
inline Affine<Real> operator*(const Affine<Real>& x, const Affine<Real>& y) {
  const Real aa = x.a * y.a, bb = x.b * y.b;  // s^2 and t^2 lie in [0, 1]
  return {x.c * y.c + 0.5 * (aa + bb), x.c * y.a + x.a * y.c, x.c * y.b + x.b * y.c,
          0.5 * (magnitude(aa) + magnitude(bb)) + magnitude(x.a * y.b + x.b * y.a) +
              (magnitude(x.c) + magnitude(x.a) + magnitude(x.b)) * y.r +
              (magnitude(y.c) + magnitude(y.a) + magnitude(y.b)) * x.r + x.r * y.r};
}
template <class Real>
inline Affine<Real> square(const Affine<Real>& x) {
  return x * x;
}
// A chord's slope with half its largest distance from a convex curve.
template <class Real>
NURBS_INLINE Affine<Real> along_chord(const Affine<Real>& x, const Real& slope, const Real& at_ends,
                                      const Real& at_touch) {
  return {slope * x.c + 0.5 * (at_ends + at_touch), slope * x.a, slope * x.b,
          magnitude(slope) * x.r + 0.5 * magnitude(at_ends - at_touch)};
}
// 1 / x of a positive x.
template <class Real>
inline Affine<Real> inverse(const Affine<Real>& x) {
  const Real low = x.low(), high = x.high(), slope = -1.0 / (low * high);
  return along_chord<Real>(x, slope, 1.0 / low + 1.0 / high, 2.0 / root(low * high));
}
// Root of a positive x.
template <class Real>
inline Affine<Real> root(const Affine<Real>& x) {
  const Real low = root(x.low()), high = root(x.high()), slope = 1.0 / (low + high);
  return along_chord<Real>(x, slope, low * high * slope, 0.25 / slope);
}

// Three of them.
template <class Real>
struct AffineVector {
  Affine<Real> x, y, z;
  Triple<Real> center() const { return {x.c, y.c, z.c}; }
};
template <class Real>
NURBS_INLINE AffineVector<Real> operator+(const AffineVector<Real>& p, const AffineVector<Real>& q) {
  return {p.x + q.x, p.y + q.y, p.z + q.z};
}
template <class Real>
NURBS_INLINE AffineVector<Real> operator-(const AffineVector<Real>& p, const AffineVector<Real>& q) {
  return {p.x - q.x, p.y - q.y, p.z - q.z};
}
template <class Real>
NURBS_INLINE AffineVector<Real> scaled(const Real& k, const AffineVector<Real>& p) {
  return {scaled(k, p.x), scaled(k, p.y), scaled(k, p.z)};
}
template <class Real>
NURBS_INLINE AffineVector<Real> operator*(double k, const AffineVector<Real>& p) {
  return {k * p.x, k * p.y, k * p.z};
}
template <class Real>
inline AffineVector<Real> operator*(const Affine<Real>& k, const AffineVector<Real>& p) {
  return {k * p.x, k * p.y, k * p.z};
}
template <class Real>
inline AffineVector<Real> operator*(const Turn<Real>& m, const AffineVector<Real>& p) {
  const auto row = [&](const Triple<Real>& r) {
    return scaled(r.x, p.x) + scaled(r.y, p.y) + scaled(r.z, p.z);
  };
  return {row(m.row[0]), row(m.row[1]), row(m.row[2])};
}
template <class Real>
inline Affine<Real> dot(const AffineVector<Real>& p, const AffineVector<Real>& q) {
  return p.x * q.x + p.y * q.y + p.z * q.z;
}
template <class Real>
inline AffineVector<Real> cross(const AffineVector<Real>& p, const AffineVector<Real>& q) {
  return {p.y * q.z - p.z * q.y, p.z * q.x - p.x * q.z, p.x * q.y - p.y * q.x};
}

}  // namespace nurbs

// One arithmetic for one contact and for several side by side: kernels are templates on their number,
// `double` or `Wide`, the widest vector of doubles the ARCH has. Every lane goes through the same operations
// in the same order, so results do not depend on the width.
#pragma once

#include <cmath>

#include "nurbs/lanes.h"

namespace nurbs {

#ifdef __AVX512F__
constexpr int kWidth = 8;
#else
constexpr int kWidth = 4;
#endif
using Wide = double __attribute__((vector_size(8 * kWidth)));
using WideMask = long long __attribute__((vector_size(8 * kWidth)));

template <class Real>
struct MaskOf;
template <>
struct MaskOf<double> {
  using type = bool;
};
template <>
struct MaskOf<Wide> {
  using type = WideMask;
};
template <class Real>
using Mask = typename MaskOf<Real>::type;

NURBS_INLINE double select(bool mask, double yes, double no) {
  return mask ? yes : no;
}
NURBS_INLINE Wide select(const WideMask& mask, const Wide& yes, const Wide& no) {
  return mask ? yes : no;
}
NURBS_INLINE double root(double x) {
  return std::sqrt(x);
}
NURBS_INLINE Wide root(const Wide& x) {
  Wide r;
  for (int k = 0; k < kWidth; ++k) r[k] = __builtin_sqrt(x[k]);
  return r;
}
NURBS_INLINE bool none_of(bool mask) {
  return !mask;
}
NURBS_INLINE bool none_of(const WideMask& mask) {
  long long any = 0;
  for (int k = 0; k < kWidth; ++k) any |= mask[k];
  return any == 0;
}
template <class Real>
NURBS_INLINE Real larger(const Real& a, const Real& b) {
  return select(a > b, a, b);
}
template <class Real>
NURBS_INLINE Real smaller(const Real& a, const Real& b) {
  return select(a < b, a, b);
}
template <class Real>
NURBS_INLINE Real magnitude(const Real& x) {
  return select(x < 0.0, -x, x);
}
// Every lane the same number.
template <class Real>
NURBS_INLINE Real all(double x) {
  return Real{} + x;
}

// A vector in space of either number.
template <class Real>
struct Triple {
  Real x, y, z;
};
template <class Real>
NURBS_INLINE Triple<Real> operator+(const Triple<Real>& a, const Triple<Real>& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <class Real>
NURBS_INLINE Triple<Real> operator-(const Triple<Real>& a, const Triple<Real>& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
template <class Real>
NURBS_INLINE Triple<Real> operator*(const Real& f, const Triple<Real>& a) {
  return {f * a.x, f * a.y, f * a.z};
}
template <class Real>
NURBS_INLINE Real dot(const Triple<Real>& a, const Triple<Real>& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <class Real>
NURBS_INLINE Triple<Real> cross(const Triple<Real>& a, const Triple<Real>& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
template <class Real>
NURBS_INLINE Triple<Real> select(const Mask<Real>& mask, const Triple<Real>& yes, const Triple<Real>& no) {
  return {select(mask, yes.x, no.x), select(mask, yes.y, no.y), select(mask, yes.z, no.z)};
}
NURBS_INLINE Triple<double> triple(const Vec3& v) {
  return {v[0], v[1], v[2]};
}
NURBS_INLINE Triple<double> triple(const double* v) {
  return {v[0], v[1], v[2]};
}
NURBS_INLINE Vec3 vec(const Triple<double>& v) {
  return {v.x, v.y, v.z};
}

// A rotation matrix of either number, by rows.
template <class Real>
struct Turn {
  Triple<Real> row[3];
  NURBS_INLINE Triple<Real> operator*(const Triple<Real>& v) const {
    return {dot(row[0], v), dot(row[1], v), dot(row[2], v)};
  }
};
NURBS_INLINE Turn<double> turn(const Mat3& m) {
  return {{{m(0, 0), m(0, 1), m(0, 2)}, {m(1, 0), m(1, 1), m(1, 2)}, {m(2, 0), m(2, 1), m(2, 2)}}};
}

}  // namespace nurbs

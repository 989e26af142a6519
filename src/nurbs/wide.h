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
using Mask4 = long long __attribute__((vector_size(32)));
using Mask8 = long long __attribute__((vector_size(64)));

template <class Real>
struct MaskOf;
template <>
struct MaskOf<double> {
  using type = bool;
};
template <>
struct MaskOf<Lane4> {
  using type = Mask4;
};
template <>
struct MaskOf<Lane8> {
  using type = Mask8;
};
template <class Real>
using Mask = typename MaskOf<Real>::type;

#ifdef __AVX512F__
using Wide = Lane8;
#else
using Wide = Lane4;
#endif
using WideMask = Mask<Wide>;

NURBS_INLINE Wide load_wide(const double* from) {
  Wide x;
  std::memcpy(&x, from, sizeof x);
  return x;
}
NURBS_INLINE double select(bool mask, double yes, double no) {
  return mask ? yes : no;
}
NURBS_INLINE Lane4 select(const Mask4& mask, const Lane4& yes, const Lane4& no) {
  return mask ? yes : no;
}
NURBS_INLINE Lane8 select(const Mask8& mask, const Lane8& yes, const Lane8& no) {
  return mask ? yes : no;
}
NURBS_INLINE double root(double x) {
  return std::sqrt(x);
}
NURBS_INLINE Lane4 root(const Lane4& x) {
  Lane4 r;
  for (int k = 0; k < 4; ++k) r[k] = __builtin_sqrt(x[k]);
  return r;
}
NURBS_INLINE Lane8 root(const Lane8& x) {
  Lane8 r;
  for (int k = 0; k < 8; ++k) r[k] = __builtin_sqrt(x[k]);
  return r;
}
NURBS_INLINE bool none_of(bool mask) {
  return !mask;
}
NURBS_INLINE bool none_of(const Mask4& mask) {
  return (mask[0] | mask[1] | mask[2] | mask[3]) == 0;
}
NURBS_INLINE bool none_of(const Mask8& mask) {
  return (mask[0] | mask[1] | mask[2] | mask[3] | mask[4] | mask[5] | mask[6] | mask[7]) == 0;
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

// One lane's vector, in and out; masks as bits, one a lane.
template <class Real>
NURBS_INLINE Vec3 lane(const Triple<Real>& v, int l) {
  return {v.x[l], v.y[l], v.z[l]};
}
template <class Real>
NURBS_INLINE void set_lane(const Triple<double>& from, int l, Triple<Real>* to) {
  to->x[l] = from.x;
  to->y[l] = from.y;
  to->z[l] = from.z;
}
NURBS_INLINE WideMask mask_of(unsigned bits) {
  WideMask m;
  for (int l = 0; l < kWidth; ++l) m[l] = bits >> l & 1 ? -1 : 0;
  return m;
}
NURBS_INLINE unsigned bits_of(const WideMask& m) {
  unsigned bits = 0;
  for (int l = 0; l < kWidth; ++l) bits |= (m[l] != 0) << l;
  return bits;
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

// Rows become columns: kWidth x kWidth numbers.
NURBS_INLINE void transpose(Wide (&m)[kWidth]) {
#ifdef __AVX512F__
  Wide t[8], u[8];
  for (int k = 0; k < 8; k += 2) {
    t[k] = __builtin_shufflevector(m[k], m[k + 1], 0, 8, 2, 10, 4, 12, 6, 14);
    t[k + 1] = __builtin_shufflevector(m[k], m[k + 1], 1, 9, 3, 11, 5, 13, 7, 15);
  }
  for (int k = 0; k < 8; k += 4)
    for (int odd = 0; odd < 2; ++odd) {
      const Wide &low = t[k + odd], &high = t[k + odd + 2];
      u[k + odd] = __builtin_shufflevector(low, high, 0, 1, 8, 9, 4, 5, 12, 13);
      u[k + odd + 2] = __builtin_shufflevector(low, high, 2, 3, 10, 11, 6, 7, 14, 15);
    }
  for (int k = 0; k < 4; ++k) {
    m[k] = __builtin_shufflevector(u[k], u[k + 4], 0, 1, 2, 3, 8, 9, 10, 11);
    m[k + 4] = __builtin_shufflevector(u[k], u[k + 4], 4, 5, 6, 7, 12, 13, 14, 15);
  }
#else
  Lane4 columns[4];
  transpose({m[0], m[1], m[2], m[3]}, columns);
  for (int k = 0; k < 4; ++k) m[k] = columns[k];
#endif
}

// `count` (a multiple of kWidth) numbers of each of kWidth records: number k of lane l is to[k][l].
template <int count>
NURBS_INLINE void gather(const double* const (&record)[kWidth], Wide (&to)[count]) {
  static_assert(count % kWidth == 0);
  for (int first = 0; first < count; first += kWidth) {
    Wide m[kWidth];
    for (int l = 0; l < kWidth; ++l) std::memcpy(&m[l], record[l] + first, sizeof m[l]);
    transpose(m);
    for (int k = 0; k < kWidth; ++k) to[first + k] = m[k];
  }
}
// The reverse, 8 numbers a record.
NURBS_INLINE void scatter(const Wide (&from)[8], double (&record)[kWidth][8]) {
  for (int first = 0; first < 8; first += kWidth) {
    Wide m[kWidth];
    for (int k = 0; k < kWidth; ++k) m[k] = from[first + k];
    transpose(m);
    for (int l = 0; l < kWidth; ++l) std::memcpy(record[l] + first, &m[l], sizeof m[l]);
  }
}

}  // namespace nurbs

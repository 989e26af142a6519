// Numbers that depend on two parameters, known to first order: c + a s + b t + e for s, t in [-1, 1] and some
// |e| <= r. Sums and products hold whatever the true values are (affine arithmetic; de Figueiredo & Stolfi
// 2004), and what is common to two factors is not counted twice: the excess is of second order in the size of
// a cell. Round-off is not counted here: enclosure.cpp adds it once.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "nurbs/types.h"

namespace nurbs {

struct AffineForm {
  double c = 0, a = 0, b = 0, r = 0;
  double spread() const { return std::abs(a) + std::abs(b) + r; }
  double low() const { return c - spread(); }
  double high() const { return c + spread(); }
  double most() const { return std::abs(c) + spread(); }  // largest |x|
};
inline AffineForm operator+(const AffineForm& x, const AffineForm& y) {
  return {x.c + y.c, x.a + y.a, x.b + y.b, x.r + y.r};
}
inline AffineForm operator-(const AffineForm& x, const AffineForm& y) {
  return {x.c - y.c, x.a - y.a, x.b - y.b, x.r + y.r};
}
inline AffineForm operator*(double k, const AffineForm& x) {
  return {k * x.c, k * x.a, k * x.b, std::abs(k) * x.r};
}
inline AffineForm operator*(const AffineForm& x, const AffineForm& y) {
  const double aa = x.a * y.a, bb = x.b * y.b;  // s^2 and t^2 lie in [0, 1]
  return {x.c * y.c + 0.5 * (aa + bb), x.c * y.a + x.a * y.c, x.c * y.b + x.b * y.c,
          0.5 * (std::abs(aa) + std::abs(bb)) + std::abs(x.a * y.b + x.b * y.a) +
              (std::abs(x.c) + std::abs(x.a) + std::abs(x.b)) * y.r +
              (std::abs(y.c) + std::abs(y.a) + std::abs(y.b)) * x.r + x.r * y.r};
}
inline AffineForm square(const AffineForm& x) {
  return x * x;
}
// A chord's slope with half its largest distance from a convex curve.
inline AffineForm along_chord(const AffineForm& x, double slope, double at_ends, double at_touch) {
  return {slope * x.c + 0.5 * (at_ends + at_touch), slope * x.a, slope * x.b,
          std::abs(slope) * x.r + 0.5 * std::abs(at_ends - at_touch)};
}
// 1 / x of a positive x.
inline AffineForm inverse(const AffineForm& x) {
  const double low = x.low(), high = x.high(), slope = -1 / (low * high);
  return along_chord(x, slope, 1 / low + 1 / high, 2 / std::sqrt(low * high));
}
// Root of a positive x.
inline AffineForm root(const AffineForm& x) {
  const double low = std::sqrt(x.low()), high = std::sqrt(x.high()), slope = 1 / (low + high);
  return along_chord(x, slope, low * high * slope, 0.25 / slope);
}

// Three of them.
struct AffineVector {
  AffineForm x, y, z;
  Vec3 center() const { return {x.c, y.c, z.c}; }
};
inline AffineVector operator+(const AffineVector& p, const AffineVector& q) {
  return {p.x + q.x, p.y + q.y, p.z + q.z};
}
inline AffineVector operator-(const AffineVector& p, const AffineVector& q) {
  return {p.x - q.x, p.y - q.y, p.z - q.z};
}
inline AffineVector operator*(double k, const AffineVector& p) {
  return {k * p.x, k * p.y, k * p.z};
}
inline AffineVector operator*(const AffineForm& k, const AffineVector& p) {
  return {k * p.x, k * p.y, k * p.z};
}
inline AffineVector operator*(const Mat3& m, const AffineVector& p) {
  const auto row = [&](int i) { return m(i, 0) * p.x + m(i, 1) * p.y + m(i, 2) * p.z; };
  return {row(0), row(1), row(2)};
}
inline AffineForm dot(const AffineVector& p, const AffineVector& q) {
  return p.x * q.x + p.y * q.y + p.z * q.z;
}
inline AffineVector cross(const AffineVector& p, const AffineVector& q) {
  return {p.y * q.z - p.z * q.y, p.z * q.x - p.x * q.z, p.x * q.y - p.y * q.x};
}

}  // namespace nurbs

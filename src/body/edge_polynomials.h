// Edges of patches as polynomials of their parameter, homogeneous, in Bernstein form.
#pragma once

#include <algorithm>

#include "nurbs/bernstein.h"
#include "nurbs/types.h"

namespace nurbs {

using Homogeneous = Bernstein<Vec4>;

inline const auto kProduct = [](double x, double y) { return x * y; };
inline const auto kScale = [](const Vec3& x, double w) { return Vec3(x * w); };
inline const auto kCross = [](const Vec3& x, const Vec3& y) { return Vec3(x.cross(y)); };

inline Vec3 place(const Vec4& p) {
  return p.head<3>() / p[3];
}
inline Bernstein<Vec3> positions(const Homogeneous& points) {
  Bernstein<Vec3> x;
  for (const Vec4& p : points) x.push_back(p.head<3>());
  return x;
}
inline Bernstein<double> weights(const Homogeneous& points) {
  Bernstein<double> w;
  for (const Vec4& p : points) w.push_back(p[3]);
  return w;
}

// The point of a curve at t, by de Casteljau.
inline Vec3 point_at(Homogeneous curve, double t) {
  for (size_t n = curve.size() - 1; n > 0; --n)
    for (size_t i = 0; i < n; ++i) curve[i] = (1 - t) * curve[i] + t * curve[i + 1];
  return place(curve[0]);
}

// Positions as seen from the first one of an edge, so that small patches far from the origin cancel little.
inline void count_from(const Vec4& first, Homogeneous* points) {
  const Vec3 origin = place(first);
  for (Vec4& p : *points) p.head<3>() -= p[3] * origin;
}

// w X' - w' X of a curve (X, w): w^2 times its derivative.
inline Bernstein<Vec3> hodograph(const Homogeneous& curve) {
  const Homogeneous along = derivative(curve);
  return difference(multiply(positions(along), weights(curve), kScale),
                    multiply(positions(curve), weights(along), kScale));
}

inline double largest(const Bernstein<Vec3>& f) {
  double most = 0;
  for (const Vec3& x : f) most = std::max(most, x.norm());
  return most;
}

// A straight piece, and the distance from it.
struct Chord {
  Vec3 from, to;

  explicit Chord(const Homogeneous& curve) : from(place(curve.front())), to(place(curve.back())) {}
  double distance(const Vec3& x) const {
    const Vec3 along = to - from, y = x - from;
    const double t = along.squaredNorm() > 0 ? std::clamp(y.dot(along) / along.squaredNorm(), 0.0, 1.0) : 0;
    return (y - t * along).norm();
  }
};

// A curve strays no farther from its chord than its control points do.
inline double stray(const Homogeneous& curve) {
  const Chord chord(curve);
  double most = 0;
  for (const Vec4& p : curve) most = std::max(most, chord.distance(place(p)));
  return most;
}

}  // namespace nurbs

// What a pair remembers between steps, and the one place that says how. Plain doubles, so that it lives in
// the host's contact history: it migrates, survives reneighbouring and restarts with the pair.
#pragma once

#include <cmath>
#include <cstring>
#include <limits>

#include "contact/local_model.h"
#include "contact/pair_search.h"

namespace nurbs {

// A surface point.
struct PointMemory {
  double patch, u, v;
  double step[2];  // how far it went from the solve before, in (u, v); 0 across patches
};

struct PairMemory {
  double known;  // 0 empty; 1 the reference pose and `lower` are set; 2 the surface points too; 3 the local
                 // model too
  // Reference pose: where the bodies were when `lower` was proven.
  double offset[3];  // x_B - x_A, lab
  double q_a[4];     // orientations, w x y z
  double q_b[4];
  double direction[3];     // unit d, lab, along which ...
  double lower;            // ... the gap was proven at least this large
  PointMemory on_a, on_b;  // of the last solve, the warm start
  // Local quadratic model at the reference pose, and the overlap below which its contact is the only one.
  LocalModel model;
  double unique;
  double spare;

  // Whether the last solve could not prove the pair further apart than `reach`.
  bool touched(double reach) const { return known >= 2 && lower <= reach; }
};
static_assert(sizeof(PairMemory) == kPairMemorySize * sizeof(double),
              "the host allots kPairMemorySize doubles");

// The host's doubles seen as a pair's memory, in place: copying them would cost more than the cheapest rung.
inline PairMemory& memory_at(double* doubles) {
  return *reinterpret_cast<PairMemory*>(doubles);
}

inline void store(const Vec3& v, double* to) {
  std::memcpy(to, v.data(), 3 * sizeof(double));
}
inline Vec3 load(const double* from) {
  return {from[0], from[1], from[2]};
}
inline void store(const Quat& q, double* to) {
  to[0] = q.w();
  to[1] = q.x();
  to[2] = q.y();
  to[3] = q.z();
}

// Where a surface point would be had it moved on as it last did; if that leaves the patch, where it was.
inline SurfacePoint warm_point(const PointMemory& m, const Shape& shape) {
  const int p = static_cast<int>(m.patch);
  if (p < 0 || p >= static_cast<int>(shape.patches.size())) return {};
  const double u = m.u + m.step[0], v = m.v + m.step[1];
  const bool inside = u >= 0 && u <= 1 && v >= 0 && v <= 1;
  return inside ? SurfacePoint{p, u, v} : SurfacePoint{p, m.u, m.v};
}
// `follows`: what is stored is the point of the solve before.
inline void remember_point(const SurfacePoint& now, bool follows, PointMemory* m) {
  const bool on = follows && m->patch == now.patch;
  *m = {static_cast<double>(now.patch), now.u, now.v, {on ? now.u - m->u : 0, on ? now.v - m->v : 0}};
}

// |q - q0| of unit quaternions is 2 sin(angle / 4); a point at distance R from the centre has moved by
// 2 R sin(angle / 2) <= 2 R |q - q0|. Here (2 |q - q0|)^2.
inline double turned2(const Quat& q, const double* q0) {
  const double w = q.w() - q0[0], x = q.x() - q0[1], y = q.y() - q0[2], z = q.z() - q0[3];
  return 4 * (w * w + x * x + y * y + z * z);
}
inline double turned(const Quat& q, const double* q0) {
  return std::sqrt(turned2(q, q0));
}

inline bool finite(const Particle& p) {
  return std::isfinite(p.x.sum() + p.q.coeffs().sum() + p.scale) && p.scale > 0;
}

// Makes a default result one of a pair proven apart.
inline void set_apart(double lower, Rung rung, ContactResult* r) {
  r->status = Status::separated;
  r->rung = rung;
  r->gap = r->lower = lower;
  r->upper = std::numeric_limits<double>::infinity();
}

}  // namespace nurbs

// A surface to second order with its six vectors side by side: one fused operation acts on all of them.
#pragma once

#include "nurbs/lanes.h"
#include "nurbs/tolerances.h"

namespace nurbs {

// Coordinates of s, su, sv, suu, suv, svv, then two zeros.
struct JetLanes {
  Lane8 x, y, z;

  enum Slot { kS, kSu, kSv, kSuu, kSuv, kSvv };
  NURBS_INLINE Vec3 at(Slot k) const { return {x[k], y[k], z[k]}; }
};

NURBS_INLINE void scale(double factor, JetLanes* j) {
  j->x *= factor;
  j->y *= factor;
  j->z *= factor;
}

// The jet seen from other axes: turn * every vector, the position moved by `offset`.
NURBS_INLINE void place(const Mat3& turn, const Vec3& offset, JetLanes* j) {
  const JetLanes from = *j;
  const auto row = [&](int k, Lane8* to) {
    *to = turn(k, 0) * from.x + turn(k, 1) * from.y + turn(k, 2) * from.z;
    (*to)[0] += offset[k];
  };
  row(0, &j->x);
  row(1, &j->y);
  row(2, &j->z);
}

// d . each vector.
NURBS_INLINE void dot(const JetLanes& j, const Vec3& d, Lane8* out) {
  *out = d[0] * j.x + d[1] * j.y + d[2] * j.z;
}

// Whether the tangents change so little in a step (du, dv) that the normal turns linearly and the Taylor
// series is worth its terms: not next to a pole.
NURBS_INLINE bool turns_linearly(const JetLanes& j, double du, double dv) {
  const Lane8 length2 = j.x * j.x + j.y * j.y + j.z * j.z;
  const double uu = du * du, vv = dv * dv;
  constexpr double kTrust = 0.5 * kNormalTrust * kNormalTrust;
  return uu * length2[JetLanes::kSuu] + vv * length2[JetLanes::kSuv] <= kTrust * length2[JetLanes::kSu] &&
         uu * length2[JetLanes::kSuv] + vv * length2[JetLanes::kSvv] <= kTrust * length2[JetLanes::kSv];
}

// The surface point after a step (du, dv), from the Taylor series.
NURBS_INLINE Vec3 taylor(const JetLanes& j, double du, double dv) {
  const Lane8 weight{1, du, dv, 0.5 * du * du, du * dv, 0.5 * dv * dv, 0, 0};
  Lane8 rows[3] = {weight * j.x, weight * j.y, weight * j.z};
  Lane4 halves[3][2];
  std::memcpy(&halves, &rows, sizeof rows);
  const Lane4 zero{0, 0, 0, 0};
  Lane4 columns[4];
  transpose({halves[0][0] + halves[0][1], halves[1][0] + halves[1][1], halves[2][0] + halves[2][1], zero},
            columns);
  Vec3 point;
  to_vec3(columns[0] + columns[1] + columns[2] + columns[3], point);
  return point;
}

}  // namespace nurbs

// The plane problem under rings of directions (ring_search.h): of points in a half plane that an axis bounds,
// the direction along which their convex hull reaches least.
#pragma once

#include <cmath>

#include "nurbs/wide.h"

namespace nurbs {

// A direction of the half plane by cosine and sine of its angle from the axis, [0, pi]; or any vector of it.
struct Angle {
  double c, s;
};
inline double cross(const Angle& x, const Angle& y) {
  return x.c * y.s - x.s * y.c;
}
inline Angle unit(const Angle& x) {
  const double length = std::sqrt(x.c * x.c + x.s * x.s);
  return {x.c / length, x.s / length};
}
// Half way between two angles of [0, pi], low first.
Angle middle(const Angle& low, const Angle& high);

// Points (r, z): distance from the axis, negative ones too, and height. Fixed-size storage, left
// uninitialised.
class HalfPlaneHull {
 public:
  static constexpr int kMost = 256;

  // What the points reach, h(e) = max r e.s + z e.c, over a range of angles.
  struct Least {
    double value;     // least of h; minus infinity where that is not positive
    Angle at;         // where
    int from, to;     // points level there, equal at an end of the range
    Angle low, high;  // the angles at which h is below the threshold lie between
    int corners;      // of the hull that were passed
  };

  void clear() { count_ = 0; }
  void add(double r, double z) {
    r_[count_] = r;
    z_[count_++] = z;
  }
  int size() const { return count_; }
  double r(int k) const { return r_[k]; }
  double z(int k) const { return z_[k]; }

  // From angle `low` to `high`, corner by corner: each compares all points, eight at a time, 0.5 ns a point.
  // Between corners h is a sine and, where positive, concave: it is least at one or at an end. `noise`:
  // round-off of the points. There has to be one.
  Least least(const Angle& low, const Angle& high, double threshold, double noise);

 private:
  // The point that comes above `top` first from the angle `now` on, before `*next`, which is then where, of
  // no length; `top` where none does.
  int corner_after(int top, const Angle& now, double noise, Angle* next) const;
  int level_with(int top, const Angle& now, double noise) const;
  int highest(const Angle& e) const;
  double height(int k, const Angle& e) const { return r_[k] * e.s + z_[k] * e.c; }

  int count_ = 0;
  alignas(64) double r_[kMost + kWidth];
  alignas(64) double z_[kMost + kWidth];
};

}  // namespace nurbs

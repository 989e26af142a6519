// How a body's support bends near a direction, from the point there and how fast its curvature may change.
#pragma once

#include <algorithm>
#include <cmath>

#include "body/shape.h"
#include "body/support.h"

namespace nurbs {

// Eigenvalues of a symmetric matrix.
struct Extremes {
  double least, most;
};
inline Extremes extremes(const Mat2& m) {
  const double mean = 0.5 * m.trace(), spread = std::hypot(0.5 * (m(0, 0) - m(1, 1)), m(0, 1));
  return {mean - spread, mean + spread};
}

// Unit eigenvector of the least eigenvalue, as extremes() has it.
inline Vec2 least_axis(const Mat2& m, double least) {
  const Vec2 x(m(0, 1), least - m(0, 0)), y(least - m(1, 1), m(0, 1));
  const Vec2& longer = x.squaredNorm() > y.squaredNorm() ? x : y;
  const double length = longer.norm();
  return length > 0 ? Vec2(longer / length) : Vec2(1, 0);
}

// Of W, the inverse Weingarten map (the Hessian of the support function), in the plane square to d: for
// directions within `reach` of d, rad, W is at least turn - rate times the angle, as forms.
struct LocalBend {
  Mat2 turn = Mat2::Zero();
  double rate = 0, reach = 0;  // reach 0: nothing is known
};

// Of a body at its support point in direction d, whose normal may be off d by some 1e-3 rad; `jet` of the
// point, scaled. The plane is spanned by t and s, square to each other and to d; all in the jet's axes. Two
// bodies' bends may be summed if they share t and s. Rests on the patch's curvature rate and room.
LocalBend local_bend(const Shape& shape, double scale, const SurfacePoint& at, const JetLanes& jet,
                     const Vec3& d, const Vec3& t, const Vec3& s);

// Whether room - falls x + bend x^2 >= 0 for all x in [0, to]; room > 0, falls >= 0.
inline bool stays_above(double room, double falls, double bend, double to) {
  if (bend > 0 && falls * falls <= 4 * bend * room) return true;
  return room - falls * to + std::min(0.0, bend) * to * to >= 0;
}

}  // namespace nurbs

// Cosine and sine of half a rotation angle, from its square: what makes a quaternion of a rotation vector.
// Needs no square root, and no sine as long as the angle is as small as a time step's.
#pragma once

#include "nurbs/lanes.h"

namespace nurbs {

template <class Lane>
struct HalfTurn {
  Lane cosine;  // cos(x)
  Lane sinc;    // sin(x) / x
};

// As half_turn, of one angle of any size, by the library's sine and cosine.
HalfTurn<double> half_turn_any(double square);

// Of half angles x given by square = x * x >= 0, rad^2; NaN and infinity give NaN. The rotation by the vector
// r is the quaternion (cosine, sinc * r / 2) at square = |r|^2 / 4.
//
// Below half a radian Taylor series: what they leave out is below 1e-21, so both numbers are good to 1 ulp,
// at 8 fused products each. A lane beyond goes through the library. What a lane gets does not depend on the
// others.
template <class Lane>
NURBS_INLINE void half_turn(const Lane& square, HalfTurn<Lane>* out) {
  constexpr double kCosine[] = {-1.0 / 2,       1.0 / 24,          -1.0 / 720,          1.0 / 40320,
                                -1.0 / 3628800, 1.0 / 479001600.0, -1.0 / 87178291200.0};
  constexpr double kSinc[] = {-1.0 / 6,        1.0 / 120,          -1.0 / 5040,           1.0 / 362880,
                              -1.0 / 39916800, 1.0 / 6227020800.0, -1.0 / 1307674368000.0};
  Lane cosine = kCosine[6] + square * (1.0 / 20922789888000.0);
  Lane sinc = kSinc[6] + square * (1.0 / 355687428096000.0);
  for (int k = 5; k >= 0; --k) {
    cosine = kCosine[k] + square * cosine;
    sinc = kSinc[k] + square * sinc;
  }
  out->cosine = 1 + square * cosine;
  out->sinc = 1 + square * sinc;

  constexpr int kLanes = sizeof(Lane) / sizeof(double);
  const auto small = square < 0.25;
  auto all = small[0];
  for (int k = 1; k < kLanes; ++k) all &= small[k];
  if (__builtin_expect(all != 0, 1)) return;
  for (int k = 0; k < kLanes; ++k) {
    if (small[k]) continue;
    const HalfTurn<double> one = half_turn_any(square[k]);
    out->cosine[k] = one.cosine;
    out->sinc[k] = one.sinc;
  }
}

}  // namespace nurbs

// Caps about minima of p(d), widened by points of both bodies.
#pragma once

#include "contact/pair_frame.h"

namespace nurbs {

// A minimum of p(d) = h_A(d) + h_B(-d) - d . offset, and what is known about it.
struct CappedMinimum {
  Vec3 d, t, u;             // unit and square to each other, pair frame; d: where it is
  SurfacePoint on_a, on_b;  // points there
  Mat2 turn;                // W_A + W_B at d along t and u: no more than a guess
  double level;             // that p is to be proven no less than
  double tolerance;         // of supports, a length
};

// Balls that roll inside about d, as in body/inner_map.h, for directions within `valid` of it; radii 0 hold
// everywhere. Lengths of the lab.
struct CapBalls {
  double radius_a = 0, radius_b = 0;
  double valid = M_PI;
  double sum() const { return radius_a + radius_b; }
};

// The angle about the minimum, up to `wanted`, within which p is proven to be at least the level, given that
// it is within `proven` > 0; no less than that. Takes *spent pairs of points to `most` at most, and none
// where those would not do. 0.3 to 1 us each.
//
// Any points a of A and b of B, with normals n and m within `valid` of d and -d, have p(d') >= d' . g + r_A +
// r_B, g = (a - r_A n) - (b - r_B m), for d' within `valid` (of radii 0: for any d'). Let l = level - r_A -
// r_B >= 0 and g = y d + e, e square to d, y lowered to l at most. At an angle s < pi / 2 from d that is no
// less than l for azimuths within acos c of e's, c = (l - y cos s) / (|e| sin s). As l >= y, c is convex in
// s: between two angles c is no more than the greater of both. Where such arcs of some points cover the
// circle, the ring between the angles is proven. Points are asked for where gaps are left.
// Hypotheses: those of the balls; over dents, that the points are the hulls' supports. Both are checked.
double widen_cap(const PairFrame& pair, const CappedMinimum& minimum, const CapBalls& balls, double proven,
                 double wanted, int most, int* spent);

}  // namespace nurbs

// A pair as a search for rings of directions sees it: one body of revolution and its mate.
#pragma once

#include "body/shape.h"
#include "contact/pair_frame.h"

namespace nurbs {

constexpr double kNearAxis = 0.2;  // sine between the axes up to which both bodies' circles are used

// One body of revolution K and its mate M: axes and lengths of the pair frame, e = sign d.
struct RingView {
  const Shape *k, *m;
  double scale_k, scale_m, sign;
  Mat3 turn_k, turn_m;
  Vec3 axis, mate_axis;    // unit; the second one not against the first
  Vec3 offset;             // M's centre from K's
  Vec3 point, mate_point;  // on the axes, from the bodies' centres
  bool circles;            // of M are used
  double tilt = 0;         // sine between the axes, if so
  double mate_error = 0;   // what the mate turns out of itself by, a length of its shape
  double ball = 0;         // that rolls inside M, whose points are those of its core, the ball's centres ...
  double ball_k = 0;       // ... and inside K
  const SpheroPolyhedron* swept = nullptr;  // M, if it is one
  double error = 0;                         // of those that are
  const RoundEdges* arcs;                   // of K, where that is of revolution no further
  const NearRevolution* near_k = nullptr;   // that K nearly is, if it is one no further ...
  const NearRevolution* near_m = nullptr;   // ... and M, if its circles are used
  Ripple ripple;                            // of both together ...
  double seam = 0;                          // ... and where their patches meet
  double turn_m_sign = 1;                   // of M's azimuth, as K's grows

  RingView(const PairFrame& pair, bool k_is_a, bool core, double tolerance, const RoundEdges* part);
  Vec3 across(const Vec3& x) const { return x - axis.dot(x) * axis; }
  bool rippled() const { return near_k || near_m; }
  // Of M, instead of its circles.
  void use_points();

 private:
  void add_ripple(const NearRevolution& near, double scale);
};

}  // namespace nurbs

// Newton on the four surface parameters of a pair of contact points at once: the warm rung of the ladder.
#pragma once

#include "contact/certificate.h"
#include "contact/dents.h"
#include "contact/pair_frame.h"

namespace nurbs {

struct JointSolution {
  PointPair points;             // refined by the last Newton step: position error O(angle^2), see solve_joint
  SurfacePoint base_a, base_b;  // the parameters evaluated last ...
  JetLanes jet_a, jet_b;        // ... and the surfaces there, pair frame, lengths of the lab
  Bracket bracket;              // certified, of the pair of points evaluated last
  Vec3 normal;                  // unit, from A towards B
  double gap;      // normal . (b - a) at the refined points, error O(angle^3), kept inside the bracket
  bool dented;     // a dent may be near: another support point may be about to take over
  int iterations;  // Newton systems solved
  bool converged =
      false;  // bracket no wider than the tolerance asked for, or the gap proven larger than `enough`
  bool stationary = false;  // a common normal within kStationary, or what the last step makes one of next to
                            // a dent, certified or not

  NormalSide side_a(const PairFrame& pair) const { return {*pair.a, pair.scale_a, normal, points.on_a}; }
  NormalSide side_b(const PairFrame& pair) const {
    return {*pair.b, pair.scale_b, pair.direction_on_b(normal), points.on_b};
  }

  // Converged at points found in another way, after `solved` more systems. Their bracket is along the normal.
  void set_met(const PointPair& at, const Bracket& along, int solved);
};

// Solves g.A_u = g.A_v = 0, B_u.n_A = B_v.n_A = 0 with g = A - B and A's unit normal n_A, starting from
// `on_a`, `on_b`; regular at g = 0. Stops as soon as the certificate's bracket is within `tolerance` (a
// length), then spends the step already solved for on a second-order update of the points: their normals were
// within sqrt(tolerance / size) of the answer's, the updated one is within about tolerance / size. Where the
// update can't be trusted, one iteration more. Two second-derivative evaluations an iteration; gives up
// (converged = false) after `cap` iterations or where the relative curvature is singular.
JointSolution solve_joint(const PairFrame& pair, const SurfacePoint& on_a, const SurfacePoint& on_b,
                          double tolerance, double enough, int cap);

// A common normal of bodies with dents is certified by the hulls' supports along it: raises the bracket's
// lower end, where those are higher than what dents may hide leaves.
void confirm_lower(const PairFrame& pair, double tolerance, JointSolution* s);
// The same where it may close the bracket: whether it does.
bool confirm_joint(const PairFrame& pair, double tolerance, JointSolution* s);

}  // namespace nurbs

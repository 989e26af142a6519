// What goes into and comes out of a contact search. Signs and frames are defined here, once (design: p(d) =
// h_A(d) + h_B(-d), overlap = min over unit d of p).
#pragma once

#include <limits>

#include "body/shape.h"
#include "nurbs/types.h"

namespace nurbs {

// One particle as the host holds it: surface point y(u, v) = x + scale * R(q) s(u, v), s from shape->patches.
struct Particle {
  const Shape* shape = nullptr;
  double scale = 1;
  Vec3 x = Vec3::Zero();      // centre of mass, lab frame
  Quat q = Quat::Identity();  // unit; shape axes into lab axes
};

enum class Status {
  separated,   // proven apart; gap may be only a lower bound > 0 (points and normal then not set)
  converged,   // bracket [lower, upper] closer than the tolerance
  unresolved,  // bracket wider than the tolerance: gap is that of the best points and normal found, in the
               // bracket (cso, the reference: its lower end, the overlap along that normal)
};

// Which rung of the ladder answered (compute nurbs/stats).
enum class Rung { none, safe, bounds, local_model, warm, cold, fallback };

struct ContactResult {
  Status status = Status::unresolved;
  Rung rung = Rung::none;
  double gap = 0;               // > 0 apart, < 0 overlap depth; length
  double lower = 0, upper = 0;  // certified bracket of the gap
  Vec3 normal = Vec3::Zero();   // unit d, from A towards B, lab axes
  Vec3 point_a = Vec3::Zero();  // contact point on A, relative to A's centre of mass, lab axes
  Vec3 point_b = Vec3::Zero();  // contact point on B, ALSO relative to A's centre of mass: gap = normal .
                                // (point_b - point_a)
  int iterations = 0;           // Newton iterations spent
};

enum class Solver { ladder, cso };

struct ContactSettings {
  Solver solver = Solver::ladder;
  double tolerance = 1e-9;  // of the gap over the smaller bounding radius, and of the force: pair_search.h
  // A pair proven further apart than this (length) needs no more: its gap is then a lower bound, its points
  // and normal are not set. The host asks 0: only contacts matter. Infinity asks for the full answer always.
  double reach = std::numeric_limits<double>::infinity();
};

}  // namespace nurbs

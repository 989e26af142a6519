// Newton on the surface parameters of kWidth pairs side by side, for contacts that go on: what joint_newton.h
// does one at a time, without its ways out. Evaluation goes surface by surface; all else, the certificate
// included, is vectors. A pair that meets a joint, a pole, or anything else that is not the usual is left to
// the ladder.
#pragma once

#include "body/support.h"
#include "contact/contact.h"
#include "contact/dents.h"
#include "nurbs/jet_lanes.h"
#include "nurbs/wide.h"

namespace nurbs {

struct JointLanes {
  // The pairs; of a lane that is not asked for anything will do. Lab axes, from A's centre.
  const Shape *a[kWidth], *b[kWidth];
  Wide scale_a, scale_b;
  Turn<Wide> turn_a, turn_b;  // shape axes into the lab's
  Triple<Wide> offset;        // of B's centre
  Wide size, reach;           // smaller and larger bounding radius
  Wide tolerance;             // of the bracket, a length
  // Where to start, then the contact points' parameters.
  SurfacePoint on_a[kWidth], on_b[kWidth];

  // Results, of the lanes that are found: as JointSolution's.
  Triple<Wide> normal, point_a, point_b;
  Triple<Wide> direction;  // along which the bracket's lower bound was taken
  Wide gap, lower, upper;
  Wide unique;  // a shallower overlap has no other minimiser
  int iterations[kWidth];
  bool dented[kWidth];
  JetLanes jet_a[kWidth], jet_b[kWidth];        // surfaces where evaluated last, as stored ...
  SurfacePoint base_a[kWidth], base_b[kWidth];  // ... and where that was

  // A lane's bodies along its normal.
  NormalSide side_a(int l) const {
    return {*a[l], scale_a[l], on_shape(turn_a, lane(normal, l), l), on_a[l]};
  }
  NormalSide side_b(int l) const {
    return {*b[l], scale_b[l], on_shape(turn_b, -lane(normal, l), l), on_b[l]};
  }

 private:
  static Vec3 on_shape(const Turn<Wide>& turn, const Vec3& d, int l) {
    return d[0] * lane(turn.row[0], l) + d[1] * lane(turn.row[1], l) + d[2] * lane(turn.row[2], l);
  }
};

// Solves the pairs `asked` for, a bit a lane; the bits of those found: in contact or nearly (not proven
// further apart than `enough`), bracket no wider than the tolerance, points refined to second order. Each
// lane goes its own way: its result does not depend on the others. Some 60 ns a pair, 0.5 us next to a dent.
unsigned follow_joints(unsigned asked, double enough, JointLanes* pairs);

}  // namespace nurbs

// How a plane or cylinder of fix wall/nurbs moves, in the words of the host's fix move/mesh:
//   move linear VX VY VZ
//   move rotate origin PX PY PZ axis AX AY AZ period T
//   move wiggle amplitude AX AY AZ period T
#ifndef LMP_NURBS_WALL_MOTION_H
#define LMP_NURBS_WALL_MOTION_H

#include <string>

#include "nurbs/types.h"
#include "pointers.h"
#include "scene/surface_wall.h"

namespace LAMMPS_NS::nurbs_host {

class WallMotion {
 public:
  // Reads the words behind `move`, at arg[0]; returns how many it took. Ends the run when they are wrong.
  // Collective.
  int parse(LAMMPS* lmp, const std::string& user, int narg, char** arg);

  bool moves() const { return kind_ != none; }
  // Where a point and a direction have come to after `time` of motion.
  nurbs::Vec3 point(const nurbs::Vec3& x, double time) const;
  nurbs::Vec3 direction(const nurbs::Vec3& d, double time) const;
  // Of the wall's points at that time. The lab's origin is the centre of a wall that doesn't turn.
  nurbs::WallMotion velocity(double time) const;
  // A way that no point within `reach` of `about` exceeds from one time to another.
  double way(const nurbs::Vec3& about, double reach, double from, double to) const;

 private:
  enum Kind { none, linear, rotate, wiggle } kind_ = none;
  nurbs::Vec3 vector_ = nurbs::Vec3::Zero();  // velocity, unit axis or amplitude
  nurbs::Vec3 centre_ = nurbs::Vec3::Zero();
  double rate_ = 0;  // rad / time
};

}  // namespace LAMMPS_NS::nurbs_host

#endif

// fix move: the host's own under the host's name, but `rotate` turns NURBS particles as it moves them.
#ifdef FIX_CLASS

FixStyle(move,FixMoveNurbs)

#else

#ifndef LMP_FIX_MOVE_NURBS_H
#define LMP_FIX_MOVE_NURBS_H

#include "fix_move.h"
#include "nurbs/types.h"

namespace LAMMPS_NS {

class FixMoveNurbs : public FixMove {
 public:
  FixMoveNurbs(LAMMPS* lmp, int narg, char** arg);

  void init() override;
  void initial_integrate(int vflag) override;

 private:
  bool rotates_ = false;
  nurbs::Vec3 spin_ = nurbs::Vec3::Zero();
};

}  // namespace LAMMPS_NS

#endif
#endif

// fix set/nurbs: shape, scale, orientation and density of the group's particles, once, where it stands in the
// input script; for where the command `set` is not reached.
//   fix ID group set/nurbs [shape NAME] [scale S] [quat QX QY QZ ANGLE] [quat/random SEED] [density D]
#ifdef FIX_CLASS

FixStyle(set/nurbs,FixSetNurbs)

#else

#ifndef LMP_FIX_SET_NURBS_H
#define LMP_FIX_SET_NURBS_H

#include "fix.h"

namespace LAMMPS_NS {

class FixSetNurbs : public Fix {
 public:
  FixSetNurbs(LAMMPS* lmp, int narg, char** arg);
  int setmask() override { return 0; }
};

}  // namespace LAMMPS_NS

#endif
#endif

// compute wall/gran/local with NURBS particles: one line that says what to use instead. Else the host's own.
#ifdef COMPUTE_CLASS

ComputeStyle(wall/gran/local,ComputeWallGranLocalNurbs)

#else

#ifndef LMP_COMPUTE_WALL_GRAN_LOCAL_NURBS_H
#define LMP_COMPUTE_WALL_GRAN_LOCAL_NURBS_H

#include "compute_pair_gran_local.h"
#include "liggghts/refuse_style.h"

namespace LAMMPS_NS {

class ComputeWallGranLocalNurbs : public ComputePairGranLocal {
 public:
  ComputeWallGranLocalNurbs(LAMMPS* lmp, int& iarg, int narg, char** arg)
      : ComputePairGranLocal(nurbs_host::refuse_style(lmp, "Compute wall/gran/local",
                                                      "compute nurbs/local, whose id2 is 0 at walls"),
                             iarg, narg, arg) {}
};

}  // namespace LAMMPS_NS

#endif
#endif

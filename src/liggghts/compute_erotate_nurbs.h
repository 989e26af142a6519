// compute erotate/nurbs: rotational kinetic energy of the group.
//   compute ID group erotate/nurbs
#ifdef COMPUTE_CLASS

ComputeStyle(erotate/nurbs,ComputeERotateNurbs)

#else

#ifndef LMP_COMPUTE_EROTATE_NURBS_H
#define LMP_COMPUTE_EROTATE_NURBS_H

#include "compute.h"

namespace LAMMPS_NS {

class ComputeERotateNurbs : public Compute {
 public:
  ComputeERotateNurbs(LAMMPS* lmp, int& iarg, int narg, char** arg);

  void init() override;
  double compute_scalar() override;
};

}  // namespace LAMMPS_NS

#endif
#endif

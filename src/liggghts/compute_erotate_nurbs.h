// compute erotate/nurbs: rotational kinetic energy of the group.
//   compute ID group erotate/nurbs
#ifdef COMPUTE_CLASS

ComputeStyle(erotate/nurbs,ComputeERotateNurbs) ComputeStyle(erotate,ComputeERotateAny)

#else

#ifndef LMP_COMPUTE_EROTATE_NURBS_H
#define LMP_COMPUTE_EROTATE_NURBS_H

#include "compute.h"
#include "compute_erotate.h"

namespace LAMMPS_NS {

class ComputeERotateNurbs : public Compute {
 public:
  ComputeERotateNurbs(LAMMPS* lmp, int& iarg, int narg, char** arg);

  void init() override;
  double compute_scalar() override;
};

// compute erotate, which is thermo's keyword erotate: the host's, which knows spheres and would say 0 here.
class ComputeERotateAny : public ComputeERotate {
 public:
  ComputeERotateAny(LAMMPS* lmp, int& iarg, int narg, char** arg) : ComputeERotate(lmp, iarg, narg, arg) {}
  double compute_scalar() override;
};

}  // namespace LAMMPS_NS

#endif
#endif

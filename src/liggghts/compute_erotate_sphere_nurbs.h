// compute erotate/sphere with NURBS particles: one line that says what to use instead. Else the host's own.
#ifdef COMPUTE_CLASS

ComputeStyle(erotate/sphere,ComputeERotateSphereNurbs)

#else

#ifndef LMP_COMPUTE_EROTATE_SPHERE_NURBS_H
#define LMP_COMPUTE_EROTATE_SPHERE_NURBS_H

#include "compute_erotate_sphere.h"
#include "liggghts/refuse_style.h"

namespace LAMMPS_NS {

class ComputeERotateSphereNurbs : public ComputeERotateSphere {
 public:
  ComputeERotateSphereNurbs(LAMMPS* lmp, int& iarg, int narg, char** arg)
      : ComputeERotateSphere(nurbs_host::refuse_style(lmp, "Compute erotate/sphere", "compute erotate/nurbs"),
                             iarg, narg, arg) {}
};

}  // namespace LAMMPS_NS

#endif
#endif

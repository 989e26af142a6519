// fix nve/sphere with NURBS particles: one line that says what to use instead. Else the host's own.
#ifdef FIX_CLASS

FixStyle(nve/sphere,FixNVESphereNurbs)

#else

#ifndef LMP_FIX_NVE_SPHERE_NURBS_H
#define LMP_FIX_NVE_SPHERE_NURBS_H

#include "fix_nve_sphere.h"
#include "liggghts/refuse_style.h"

namespace LAMMPS_NS {

class FixNVESphereNurbs : public FixNVESphere {
 public:
  FixNVESphereNurbs(LAMMPS* lmp, int narg, char** arg)
      : FixNVESphere(nurbs_host::refuse_style(lmp, "Fix nve/sphere", "fix nve/nurbs"), narg, arg) {}
};

}  // namespace LAMMPS_NS

#endif
#endif

// fix nve/nurbs: moves NURBS particles by velocity Verlet, the rotation by a free-rotor step between torque
// kicks.
//   fix ID group nve/nurbs [rotation symplectic|richardson|exact]
#ifdef FIX_CLASS

FixStyle(nve/nurbs,FixNVENurbs)

#else

#ifndef LMP_FIX_NVE_NURBS_H
#define LMP_FIX_NVE_NURBS_H

#include "fix_nve.h"
#include "motion/rotation.h"

namespace LAMMPS_NS {

class FixNVENurbs : public FixNVE {
 public:
  FixNVENurbs(LAMMPS* lmp, int narg, char** arg);

  void init() override;
  void initial_integrate(int vflag) override;
  void final_integrate() override;

 private:
  int group_count() const;
  void kick(int i) const;

  nurbs::RotationScheme scheme_ = nurbs::RotationScheme::symplectic;
};

}  // namespace LAMMPS_NS

#endif
#endif

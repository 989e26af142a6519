// fix nve/nurbs: moves NURBS particles by velocity Verlet, the rotation by a free-rotor step between torque
// kicks.
//   fix ID group nve/nurbs [rotation symplectic|richardson|exact]
#ifdef FIX_CLASS

FixStyle(nve/nurbs,FixNVENurbs)

#else

#ifndef LMP_FIX_NVE_NURBS_H
#define LMP_FIX_NVE_NURBS_H

#include <vector>

#include "fix_nve.h"
#include "motion/rotation.h"
#include "motion/rotor.h"

namespace LAMMPS_NS {

class AtomVecNurbs;

class FixNVENurbs : public FixNVE {
 public:
  FixNVENurbs(LAMMPS* lmp, int narg, char** arg);

  void init() override;
  void initial_integrate(int vflag) override;
  void final_integrate() override;

 private:
  // Particles of one shape that wait to be rotated together.
  struct Waiting {
    int count = 0;
    int list[nurbs::RotorBatch::kBodies];
  };

  int group_count() const;
  void kick(AtomVecNurbs& bodies, int i) const;
  template <class Each, class Together>
  void sweep(Each each, Together together);

  nurbs::RotationScheme scheme_ = nurbs::RotationScheme::symplectic;
  std::vector<Waiting> waiting_;  // per shape
};

}  // namespace LAMMPS_NS

#endif
#endif

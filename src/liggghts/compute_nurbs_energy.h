// compute nurbs/energy: the contact part of the energy ledger, of all pairs and walls on all ranks.
//   compute ID group nurbs/energy     vector: 1 normal springs, 2 tangential springs, 3 dissipated by
//   damping, 4
//                                     dissipated by friction
#ifdef COMPUTE_CLASS

ComputeStyle(nurbs/energy,ComputeNurbsEnergy)

#else

#ifndef LMP_COMPUTE_NURBS_ENERGY_H
#define LMP_COMPUTE_NURBS_ENERGY_H

#include "compute.h"

namespace LAMMPS_NS {

class ComputeNurbsEnergy : public Compute {
 public:
  ComputeNurbsEnergy(LAMMPS* lmp, int& iarg, int narg, char** arg);
  ~ComputeNurbsEnergy() override { vector = nullptr; }

  void init() override;
  void compute_vector() override;

 private:
  double values_[4] = {};
  bool warned_ = false;
};

}  // namespace LAMMPS_NS

#endif
#endif

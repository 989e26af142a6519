// compute nurbs/atom: per-particle values of atom_style nurbs.
//   compute ID group nurbs/atom NAME ...      of qw qx qy qz shape scale volume mass
#ifdef COMPUTE_CLASS

ComputeStyle(nurbs/atom,ComputeNurbsAtom)

#else

#ifndef LMP_COMPUTE_NURBS_ATOM_H
#define LMP_COMPUTE_NURBS_ATOM_H

#include <vector>

#include "compute.h"

namespace LAMMPS_NS {

class ComputeNurbsAtom : public Compute {
 public:
  ComputeNurbsAtom(LAMMPS* lmp, int& iarg, int narg, char** arg);
  ~ComputeNurbsAtom() override;

  void init() override;
  void compute_peratom() override;
  double memory_usage() override;

 private:
  enum class Value { qw, qx, qy, qz, shape, scale, volume, mass };
  static Value parse(LAMMPS* lmp, const char* name);
  void grow();
  double value(Value which, int i) const;

  std::vector<Value> columns_;  // of the output
  int rows_ = 0;                // particles there is room for
};

}  // namespace LAMMPS_NS

#endif
#endif

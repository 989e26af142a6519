// compute nurbs/local: one row per contact, of pairs and walls.
//   compute ID group nurbs/local NAME ...     of id1 id2 (0 = wall) gap nx ny nz px py pz fnx fny fnz ftx fty
//   ftz
// gap < 0 is overlap; n, unit, points from 2 to 1; p is the contact point; fn and ft are the normal and
// tangential force on 1, and act at p. id1 < id2 but for walls. Both particles of a pair must be in the
// group.
#ifdef COMPUTE_CLASS

ComputeStyle(nurbs/local,ComputeNurbsLocal)

#else

#ifndef LMP_COMPUTE_NURBS_LOCAL_H
#define LMP_COMPUTE_NURBS_LOCAL_H

#include <vector>

#include "compute.h"
#include "liggghts/nurbs_contact.h"

namespace LAMMPS_NS {

class ComputeNurbsLocal : public Compute {
 public:
  ComputeNurbsLocal(LAMMPS* lmp, int& iarg, int narg, char** arg);
  ~ComputeNurbsLocal() override;

  void init() override {}
  void compute_local() override;
  double memory_usage() override;

 private:
  static int parse(LAMMPS* lmp, const char* name);
  void resize(int rows);

  std::vector<int> columns_;  // of the output, each a ContactRow::Column
  std::vector<nurbs_host::ContactRow> contacts_;
  std::vector<double> values_;
  std::vector<double*> rows_;
};

}  // namespace LAMMPS_NS

#endif
#endif

// compute nurbs/stats: how the contact search answered in the last force evaluation, pairs and walls, all
// ranks.
//   compute ID group nurbs/stats      vector: 1 neighbour pairs, 2 skipped as safe, 3 rejected by bounds, 4
//   served by the
//                                     local model, 5 solved warm, 6 solved cold, 7 by the fallback, 8
//                                     contacts, 9 Newton iterations, 10 unresolved, 11
//                                     deeper than a tenth of the smaller bounding radius
// A pair across two ranks is searched on both and counts half on each. A particle counts as a wall's
// neighbour when its bounding sphere reaches the wall.
#ifdef COMPUTE_CLASS

ComputeStyle(nurbs/stats,ComputeNurbsStats)

#else

#ifndef LMP_COMPUTE_NURBS_STATS_H
#define LMP_COMPUTE_NURBS_STATS_H

#include "compute.h"
#include "liggghts/nurbs_contact.h"

namespace LAMMPS_NS {

class ComputeNurbsStats : public Compute {
 public:
  ComputeNurbsStats(LAMMPS* lmp, int& iarg, int narg, char** arg);
  ~ComputeNurbsStats() override { vector = nullptr; }

  void init() override {}
  void compute_vector() override;

 private:
  nurbs_host::ContactCounts all_;
};

}  // namespace LAMMPS_NS

#endif
#endif

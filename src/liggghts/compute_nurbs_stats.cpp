// See compute_nurbs_stats.h.
#include "liggghts/compute_nurbs_stats.h"

#include <string>

#include "liggghts/fix_wall_nurbs.h"
#include "liggghts/host_error.h"
#include "liggghts/pair_gran_nurbs.h"
#include "update.h"

namespace LAMMPS_NS {

using nurbs_host::ContactCounts;

ComputeNurbsStats::ComputeNurbsStats(LAMMPS* lmp, int& iarg, int narg, char** arg)
    : Compute(lmp, iarg, narg, arg) {
  if (iarg < narg)
    nurbs_host::fail_all(FLERR, lmp, std::string("Compute nurbs/stats: unknown keyword ") + arg[iarg]);
  AtomVecNurbs::require(lmp, "Compute nurbs/stats");
  vector_flag = 1;
  size_vector = ContactCounts::size;
  extvector = 1;
  vector = all_.value.data();
}

void ComputeNurbsStats::compute_vector() {
  invoked_vector = update->ntimestep;
  ContactCounts mine;
  const auto add = [&mine](const ContactCounts& counts) {
    for (int k = 0; k < ContactCounts::size; ++k) mine.value[k] += counts.value[k];
  };
  if (const PairGranNurbs* pair = PairGranNurbs::find(lmp)) add(pair->counts());
  for (const FixWallNurbs* wall : FixWallNurbs::all(lmp)) add(wall->counts());
  MPI_Allreduce(mine.value.data(), all_.value.data(), ContactCounts::size, MPI_DOUBLE, MPI_SUM, world);
}

}  // namespace LAMMPS_NS

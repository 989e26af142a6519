// See compute_nurbs_energy.h.
#include "liggghts/compute_nurbs_energy.h"

#include <string>

#include "liggghts/fix_wall_nurbs.h"
#include "liggghts/host_error.h"
#include "liggghts/pair_gran_nurbs.h"
#include "update.h"

namespace LAMMPS_NS {

ComputeNurbsEnergy::ComputeNurbsEnergy(LAMMPS* lmp, int& iarg, int narg, char** arg)
    : Compute(lmp, iarg, narg, arg) {
  if (iarg < narg)
    nurbs_host::fail_all(FLERR, lmp, std::string("Compute nurbs/energy: unknown keyword ") + arg[iarg]);
  AtomVecNurbs::require(lmp, "Compute nurbs/energy");
  if (igroup != 0)
    nurbs_host::warn(FLERR, lmp, "Compute nurbs/energy: it counts all contacts, whatever its group");
  vector_flag = 1;
  size_vector = 4;
  extvector = 1;
  vector = values_;
}

// What a contact model doesn't tell is in none of the springs: it counts as dissipated, and comes back as
// negative.
void ComputeNurbsEnergy::init() {
  const auto warn = [this](const std::string& user, const nurbs_host::HostModels* models) {
    const std::string unknown = models != nullptr ? models->unknown_energies() : "";
    if (unknown.empty() || warned_) return;
    warned_ = true;
    nurbs_host::warn(FLERR, lmp,
                     "Compute nurbs/energy: the models of " + user + " don't tell the energy of" + unknown +
                         "; it counts as dissipated while it is stored");
  };
  if (const PairGranNurbs* pair = PairGranNurbs::find(lmp)) warn("pair gran/nurbs", pair->models());
  for (const FixWallNurbs* wall : FixWallNurbs::all(lmp))
    warn(std::string("fix wall/nurbs ") + wall->id, wall->models());
}

void ComputeNurbsEnergy::compute_vector() {
  invoked_vector = update->ntimestep;
  nurbs::EnergyLedger sum;
  if (const PairGranNurbs* pair = PairGranNurbs::find(lmp)) sum.add(pair->energy(), 1);
  for (const FixWallNurbs* wall : FixWallNurbs::all(lmp)) sum.add(wall->energy(), 1);
  double mine[4] = {sum.normal_spring, sum.tangential_spring, sum.damping, sum.friction};
  MPI_Allreduce(mine, values_, 4, MPI_DOUBLE, MPI_SUM, world);
}

}  // namespace LAMMPS_NS

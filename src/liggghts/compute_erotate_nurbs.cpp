// compute erotate/nurbs. See compute_erotate_nurbs.h.
#include "liggghts/compute_erotate_nurbs.h"

#include <mpi.h>

#include "atom.h"
#include "force.h"
#include "liggghts/atom_vec_nurbs.h"
#include "liggghts/host_error.h"
#include "update.h"

namespace LAMMPS_NS {

namespace {

// Of the group's particles on all ranks. Collective.
double rotational_energy(const LAMMPS& lmp, int groupbit) {
  const Atom& atom = *lmp.atom;
  const auto& bodies = static_cast<const AtomVecNurbs&>(*atom.avec);
  double mine = 0, all = 0;
  for (int i = 0; i < atom.nlocal; ++i) {
    if (!(atom.mask[i] & groupbit)) continue;
    mine += 0.5 * nurbs::Vec3::Map(atom.omega[i]).dot(bodies.angular_momentum(i));
  }
  mine *= lmp.force->mvv2e;
  MPI_Allreduce(&mine, &all, 1, MPI_DOUBLE, MPI_SUM, lmp.world);
  return all;
}

}  // namespace

ComputeERotateNurbs::ComputeERotateNurbs(LAMMPS* lmp, int& iarg, int narg, char** arg)
    : Compute(lmp, iarg, narg, arg) {
  if (narg != iarg) nurbs_host::fail_all(FLERR, lmp, "Compute erotate/nurbs takes no arguments");
  scalar_flag = 1;
  extscalar = 1;
  AtomVecNurbs::require(lmp, "Compute erotate/nurbs");
}

void ComputeERotateNurbs::init() {
  AtomVecNurbs::require(lmp, "Compute erotate/nurbs");
}

double ComputeERotateNurbs::compute_scalar() {
  invoked_scalar = update->ntimestep;
  return scalar = rotational_energy(*lmp, groupbit);
}

double ComputeERotateAny::compute_scalar() {
  if (dynamic_cast<AtomVecNurbs*>(atom->avec) == nullptr) return ComputeERotate::compute_scalar();
  invoked_scalar = update->ntimestep;
  return scalar = rotational_energy(*lmp, groupbit);
}

}  // namespace LAMMPS_NS

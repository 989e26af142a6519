// See fix_move_nurbs.h.
#include "liggghts/fix_move_nurbs.h"

#include <mpi.h>

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <string>

#include "atom.h"
#include "liggghts/atom_vec_nurbs.h"
#include "liggghts/host_error.h"
#include "update.h"

namespace LAMMPS_NS {

using nurbs::Vec3;

// fix ID group move rotate PX PY PZ RX RY RZ PERIOD, checked by the host.
FixMoveNurbs::FixMoveNurbs(LAMMPS* lmp, int narg, char** arg) : FixMove(lmp, narg, arg) {
  rotates_ = narg >= 11 && std::strcmp(arg[3], "rotate") == 0;
  if (!rotates_) return;
  const Vec3 axis(std::atof(arg[7]), std::atof(arg[8]), std::atof(arg[9]));
  spin_ = 2 * M_PI / std::atof(arg[10]) * axis.stableNormalized();
}

void FixMoveNurbs::init() {
  FixMove::init();
  if (rotates_ || dynamic_cast<AtomVecNurbs*>(atom->avec) == nullptr) return;
  int mine = 0, any = 0;
  for (int i = 0; i < atom->nlocal; ++i)
    if (atom->mask[i] & groupbit) mine |= !Vec3::Map(atom->omega[i]).isZero(0);
  MPI_Allreduce(&mine, &any, 1, MPI_INT, MPI_MAX, world);
  if (any)
    nurbs_host::warn(
        FLERR, lmp,
        std::string("Fix move ") + id + " doesn't turn its particles, but some have an omega; set it to 0");
}

void FixMoveNurbs::initial_integrate(int vflag) {
  FixMove::initial_integrate(vflag);
  auto* bodies = dynamic_cast<AtomVecNurbs*>(atom->avec);
  if (!rotates_ || bodies == nullptr) return;
  const nurbs::Quat turn(Eigen::AngleAxisd(spin_.norm() * update->dt, spin_.normalized()));
  for (int i = 0; i < atom->nlocal; ++i) {
    if (!(atom->mask[i] & groupbit)) continue;
    bodies->turn(i, turn);
    Vec3::Map(atom->omega[i]) = spin_;
  }
}

}  // namespace LAMMPS_NS

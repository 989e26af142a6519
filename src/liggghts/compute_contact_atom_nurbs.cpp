// See compute_contact_atom_nurbs.h.
#include "liggghts/compute_contact_atom_nurbs.h"

#include <algorithm>

#include "atom.h"
#include "liggghts/host_error.h"
#include "liggghts/pair_gran_nurbs.h"
#include "memory.h"
#include "update.h"

namespace LAMMPS_NS {

LentSphereFlag::LentSphereFlag(LAMMPS* lmp) : own_(lmp->atom->sphere_flag) {
  if (dynamic_cast<AtomVecNurbs*>(lmp->atom->avec) != nullptr) lmp->atom->sphere_flag = 1;
}

void LentSphereFlag::give_back(LAMMPS* lmp) const {
  lmp->atom->sphere_flag = own_;
}

ComputeContactAtomNurbs::ComputeContactAtomNurbs(LAMMPS* lmp, int& iarg, int narg, char** arg)
    : LentSphereFlag(lmp),
      ComputeContactAtom(lmp, iarg, narg, arg),
      serves_nurbs_(dynamic_cast<AtomVecNurbs*>(lmp->atom->avec) != nullptr) {
  give_back(lmp);
  if (serves_nurbs_ && skin != 0)
    nurbs_host::fail_all(FLERR, lmp,
                         "Compute contact/atom: skin can't be used with NURBS particles; contacts are exact");
}

void ComputeContactAtomNurbs::init() {
  if (!serves_nurbs_) return ComputeContactAtom::init();
  if (PairGranNurbs::find(lmp) == nullptr)
    nurbs_host::fail_all(FLERR, lmp, "Compute contact/atom needs pair_style gran/nurbs");
}

void ComputeContactAtomNurbs::compute_peratom() {
  if (!serves_nurbs_) return ComputeContactAtom::compute_peratom();
  invoked_peratom = update->ntimestep;
  if (atom->nmax > nmax) {
    memory->destroy(contact);
    nmax = atom->nmax;
    memory->create(contact, nmax, "contact/atom:contact");
    vector_atom = contact;
  }
  std::fill_n(contact, nmax, 0.0);
  PairGranNurbs::find(lmp)->count_contacts(contact);
  for (int i = 0; i < atom->nlocal; ++i)
    if (!(atom->mask[i] & groupbit)) contact[i] = 0;
}

}  // namespace LAMMPS_NS

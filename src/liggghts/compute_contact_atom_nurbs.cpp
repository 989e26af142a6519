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

template <class HostCompute>
ComputeContactAtomNurbs<HostCompute>::ComputeContactAtomNurbs(LAMMPS* lmp, int& iarg, int narg, char** arg)
    : LentSphereFlag(lmp),
      HostCompute(lmp, iarg, narg, arg),
      serves_nurbs_(dynamic_cast<AtomVecNurbs*>(lmp->atom->avec) != nullptr) {
  give_back(lmp);
  if (serves_nurbs_ && this->skin != 0)
    nurbs_host::fail_all(FLERR, lmp,
                         "Compute contact/atom: skin can't be used with NURBS particles; contacts are exact");
}

template <class HostCompute>
void ComputeContactAtomNurbs<HostCompute>::init() {
  if (!serves_nurbs_) return HostCompute::init();
  if (PairGranNurbs::find(this->lmp) == nullptr)
    nurbs_host::fail_all(FLERR, this->lmp, "Compute contact/atom needs pair_style gran/nurbs");
}

template <class HostCompute>
void ComputeContactAtomNurbs<HostCompute>::compute_peratom() {
  if (!serves_nurbs_) return HostCompute::compute_peratom();
  const Atom& atom = *this->atom;
  double*& contact = this->contact;
  this->invoked_peratom = this->update->ntimestep;
  if (atom.nmax > this->nmax) {
    this->memory->destroy(contact);
    this->nmax = atom.nmax;
    this->memory->create(contact, this->nmax, "contact/atom:contact");
    this->vector_atom = contact;
  }
  std::fill_n(contact, this->nmax, 0.0);
  PairGranNurbs::find(this->lmp)->count_contacts(contact);
  for (int i = 0; i < atom.nlocal; ++i)
    if (!(atom.mask[i] & this->groupbit)) contact[i] = 0;
}

template class ComputeContactAtomNurbs<ComputeContactAtom>;
template class ComputeContactAtomNurbs<ComputeContactAtomGran>;

}  // namespace LAMMPS_NS

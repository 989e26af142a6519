// compute contact/atom and contact/atom/gran, as the host's, for NURBS particles: how many particles each one
// touches. The host's counts overlapping bounding spheres and wants spheres. With another atom style it is
// the host's compute.
#ifdef COMPUTE_CLASS

ComputeStyle(contact/atom,ComputeContactAtomAny) ComputeStyle(contact/atom/gran,ComputeContactAtomGranAny)

#else

#ifndef LMP_COMPUTE_CONTACT_ATOM_NURBS_H
#define LMP_COMPUTE_CONTACT_ATOM_NURBS_H

#include "compute_contact_atom.h"
#include "compute_contact_atom_gran.h"

namespace LAMMPS_NS {

// The host's constructor stops at atom styles that aren't spheres; for the time of that call this one is.
class LentSphereFlag {
 protected:
  explicit LentSphereFlag(LAMMPS* lmp);
  void give_back(LAMMPS* lmp) const;

 private:
  int own_;
};

template <class HostCompute>
class ComputeContactAtomNurbs : private LentSphereFlag, public HostCompute {
 public:
  ComputeContactAtomNurbs(LAMMPS* lmp, int& iarg, int narg, char** arg);

  void init() override;
  void compute_peratom() override;

 private:
  bool serves_nurbs_;
};

using ComputeContactAtomAny = ComputeContactAtomNurbs<ComputeContactAtom>;
using ComputeContactAtomGranAny = ComputeContactAtomNurbs<ComputeContactAtomGran>;
extern template class ComputeContactAtomNurbs<ComputeContactAtom>;
extern template class ComputeContactAtomNurbs<ComputeContactAtomGran>;

}  // namespace LAMMPS_NS

#endif
#endif

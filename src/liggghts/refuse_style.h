// One line for styles of the host's that take the particles for spheres, and what to use instead.
#pragma once

#include <string>

#include "atom.h"
#include "liggghts/atom_vec_nurbs.h"
#include "liggghts/host_error.h"

namespace LAMMPS_NS::nurbs_host {

// Ends the run if the particles are NURBS particles; else returns `lmp`, for a base class. Collective.
inline LAMMPS* refuse_style(LAMMPS* lmp, const char* style, const char* instead) {
  if (dynamic_cast<AtomVecNurbs*>(lmp->atom->avec) != nullptr)
    fail_all(FLERR, lmp, std::string(style) + " can't be used with atom_style nurbs; use " + instead);
  return lmp;
}

}  // namespace LAMMPS_NS::nurbs_host

// What pair gran/nurbs and fix wall/nurbs share: coefficients as a user writes them, the warning of deep
// contacts, and the rows of compute nurbs/local.
#ifndef LMP_NURBS_CONTACT_H
#define LMP_NURBS_CONTACT_H

#include <array>
#include <string>

#include "contact/contact.h"
#include "laws/contact_law.h"
#include "liggghts/atom_vec_nurbs.h"
#include "pointers.h"
#include "scene/contact_stages.h"

namespace LAMMPS_NS::nurbs_host {

using nurbs::ContactCounts;

// Reads `kn KN kt KT [cn CN] [ct CT] mu MU` (any order) from arg[first..narg); `user` opens the error
// messages. Ends the run when a keyword is unknown, missing or twice there, or a value out of range.
// Collective.
nurbs::ContactCoefficients parse_coefficients(LAMMPS* lmp, const std::string& user, int first, int narg,
                                              char** arg);

// A number out of an input script, finite and in [low, infinity) or (low, infinity). Ends the run otherwise.
// Collective.
double parse_number(LAMMPS* lmp, const std::string& what, const char* text);
double parse_positive(LAMMPS* lmp, const std::string& what, const char* text);
double parse_not_negative(LAMMPS* lmp, const std::string& what, const char* text);

// An atom type, in [1, ntypes]. Ends the run otherwise. Collective.
int parse_atom_type(LAMMPS* lmp, const std::string& what, const char* text);

// Four numbers, w x y z, normalised; not all 0. Ends the run otherwise. Collective.
nurbs::Quat parse_quaternion(LAMMPS* lmp, const std::string& what, char** text);

// Edge k of the box as a vector.
nurbs::Vec3 box_edge(const class Domain& domain, int k);

// Settings of the host: a pair proven apart needs no more.
inline nurbs::ContactSettings contacts_only() {
  nurbs::ContactSettings settings;
  settings.reach = 0;
  return settings;
}

// Contacts that are too deep for a penalty law, of all ranks, at the start of a run or of particles just
// inserted, as `when` says: one warning, not repeated while `last` is the same. Collective.
void warn_deep(LAMMPS* lmp, const nurbs::DeepContacts& mine, const std::string& user, const std::string& when,
               const std::string& hint, std::string& last);

// The same at the end of a run, of those of its steps.
void warn_deep_run(LAMMPS* lmp, const nurbs::DeepContacts& mine, const std::string& user);

// Whether an input script has asked for the energies of the contacts (compute nurbs/energy).
bool wants_ledger(const LAMMPS* lmp);

// A row of compute nurbs/local. Vectors in lab axes; forces act on particle 1.
struct ContactRow {
  enum Column { id1, id2, gap, nx, ny, nz, px, py, pz, fnx, fny, fnz, ftx, fty, ftz, size };
  std::array<double, size> value;

  static const char* name(int column);
};

// `sign`: +1 when particle 1 is body B of the state (a wall's contact), -1 when it is A. `point`: in the lab.
ContactRow make_row(double id1, double id2, const nurbs::ContactState& state, double sign,
                    const nurbs::Vec3& point);

}  // namespace LAMMPS_NS::nurbs_host

#endif

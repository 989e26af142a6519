// What pair gran/nurbs and fix wall/nurbs share: coefficients as a user writes them, a particle's motion as
// the force law wants it, one step of one contact with its history, the counts of compute nurbs/stats and the
// rows of compute nurbs/local.
#ifndef LMP_NURBS_CONTACT_H
#define LMP_NURBS_CONTACT_H

#include <array>
#include <string>

#include "contact/contact.h"
#include "contact/pair_search.h"
#include "laws/contact_law.h"
#include "liggghts/atom_vec_nurbs.h"
#include "pointers.h"

namespace LAMMPS_NS::nurbs_host {

// History of one contact, plain doubles: the state of the force law, then the memory of the contact search.
constexpr int kHistorySize = nurbs::kContactStateSize + nurbs::kPairMemorySize;

inline nurbs::ContactState& state_of(double* history) {
  return *reinterpret_cast<nurbs::ContactState*>(history);
}
inline const nurbs::ContactState& state_of(const double* history) {
  return *reinterpret_cast<const nurbs::ContactState*>(history);
}
inline double* memory_of(double* history) {
  return history + nurbs::kContactStateSize;
}

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

// Particle i (owned or ghost); immobile when in the group of a fix freeze.
nurbs::BodyMotion motion_of(const AtomVecNurbs& bodies, const class Atom& atom, int i, double dt,
                            int freeze_groupbit);

// Edge k of the box as a vector.
nurbs::Vec3 box_edge(const class Domain& domain, int k);

// Settings of the host: a pair proven apart needs no more.
inline nurbs::ContactSettings contacts_only() {
  nurbs::ContactSettings settings;
  settings.reach = 0;
  return settings;
}

// Counts of compute nurbs/stats, in the order of its vector.
struct ContactCounts {
  enum Index {
    neighbours,
    safe,
    bounds,
    local_model,
    warm,
    cold,
    fallback,
    contacts,
    iterations,
    unresolved,
    size
  };
  std::array<double, size> value{};

  void add(const nurbs::ContactResult& result, double weight);
  void add_safe(double weight);
};

// Contacts at the start of a run that are too deep for a penalty law: counted by all ranks, then told once.
struct DeepContacts {
  static constexpr double kDepth = 0.1;  // of the (smaller) bounding radius
  double count = 0, deepest = 0;

  void add(const nurbs::ContactResult& result, double radius, double weight);
  // Collective. One warning, not repeated while `last` is the same; empties the counts.
  void warn(LAMMPS* lmp, const std::string& user, const std::string& hint, std::string& last);
};

// How a contact is to be advanced.
struct ContactStep {
  bool setup = false;  // forces before the first step of a run: nothing may move on
  double dt = 0;
  double same = 0;  // setup: largest difference of a geometry that counts as unchanged (length)
};

// Whether the result of a contact search is a contact.
bool touches(const nurbs::ContactResult& result);

// One step of one contact: force law, history, ledger. At setup the state stays as it is when the bodies are
// where it was made, so that a run in two parts moves as one; else it is made anew. Returns whether state is
// in contact. `dissipated` receives what was dissipated, times `weight`.
bool step_contact(const nurbs::ContactCoefficients& law, const nurbs::ContactResult& result,
                  const nurbs::ContactGeometry& geometry, const nurbs::BodyMotion& a,
                  const nurbs::BodyMotion& b, const ContactStep& step, nurbs::ContactState& state,
                  double weight, nurbs::EnergyLedger& dissipated, ContactCounts& counts);

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

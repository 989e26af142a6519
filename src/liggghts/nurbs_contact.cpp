// See nurbs_contact.h.
#include "liggghts/nurbs_contact.h"

#include <mpi.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "atom.h"
#include "compute.h"
#include "domain.h"
#include "lammps.h"
#include "liggghts/host_error.h"
#include "modify.h"

namespace LAMMPS_NS::nurbs_host {

using nurbs::ContactCoefficients;
using nurbs::ContactState;
using nurbs::Vec3;

namespace {

[[noreturn]] void out_of_range(LAMMPS* lmp, const std::string& what, const char* text, const char* range) {
  fail_all(FLERR, lmp, what + " = " + text + " must be a number" + range);
}

double parse_finite(LAMMPS* lmp, const std::string& what, const char* text, const char* range) {
  char* end = nullptr;
  const double value = std::strtod(text, &end);
  if (end == text || *end != '\0' || !std::isfinite(value)) out_of_range(lmp, what, text, range);
  return value;
}

struct Keyword {
  const char* name;
  double ContactCoefficients::*value;
  bool required, positive;
};
constexpr Keyword kKeywords[] = {{"kn", &ContactCoefficients::kn, true, true},
                                 {"kt", &ContactCoefficients::kt, true, false},
                                 {"cn", &ContactCoefficients::cn, false, false},
                                 {"ct", &ContactCoefficients::ct, false, false},
                                 {"mu", &ContactCoefficients::mu, true, false}};

nurbs::DeepContacts of_all_ranks(LAMMPS* lmp, const nurbs::DeepContacts& mine) {
  nurbs::DeepContacts all;
  MPI_Allreduce(&mine.count, &all.count, 1, MPI_DOUBLE, MPI_SUM, lmp->world);
  MPI_Allreduce(&mine.deepest, &all.deepest, 1, MPI_DOUBLE, MPI_MAX, lmp->world);
  MPI_Allreduce(&mine.through, &all.through, 1, MPI_DOUBLE, MPI_MAX, lmp->world);
  return all;
}

int index_of(const std::string& name) {
  for (int k = 0; k < 5; ++k)
    if (name == kKeywords[k].name) return k;
  return -1;
}

}  // namespace

double parse_number(LAMMPS* lmp, const std::string& what, const char* text) {
  return parse_finite(lmp, what, text, "");
}

double parse_positive(LAMMPS* lmp, const std::string& what, const char* text) {
  const double value = parse_finite(lmp, what, text, " > 0");
  if (value <= 0) out_of_range(lmp, what, text, " > 0");
  return value;
}

double parse_not_negative(LAMMPS* lmp, const std::string& what, const char* text) {
  const double value = parse_finite(lmp, what, text, " >= 0");
  if (value < 0) out_of_range(lmp, what, text, " >= 0");
  return value;
}

int parse_atom_type(LAMMPS* lmp, const std::string& what, const char* text) {
  const double type = parse_number(lmp, what, text);
  const int types = lmp->atom->ntypes;
  if (type != std::floor(type) || type < 1 || type > types)
    fail_all(FLERR, lmp,
             what + " = " + text + " must be an atom type, in [1, " + std::to_string(types) + "]");
  return static_cast<int>(type);
}

nurbs::Quat parse_quaternion(LAMMPS* lmp, const std::string& what, char** text) {
  double q[4];
  for (int k = 0; k < 4; ++k) q[k] = parse_number(lmp, what, text[k]);
  const double length = nurbs::Quat(q[0], q[1], q[2], q[3]).coeffs().stableNorm();
  if (!(length > 0)) fail_all(FLERR, lmp, what + " 0 0 0 0 must have a length > 0");
  return nurbs::Quat(q[0] / length, q[1] / length, q[2] / length, q[3] / length).normalized();
}

ContactCoefficients parse_coefficients(LAMMPS* lmp, const std::string& user, int first, int narg,
                                       char** arg) {
  ContactCoefficients law;
  bool given[5] = {};
  for (int k = first; k < narg; k += 2) {
    const int which = index_of(arg[k]);
    if (which < 0)
      fail_all(FLERR, lmp, user + ": unknown keyword " + arg[k] + "; allowed are kn kt cn ct mu");
    if (given[which]) fail_all(FLERR, lmp, user + ": keyword " + arg[k] + " is there twice");
    if (k + 1 == narg) fail_all(FLERR, lmp, user + ": keyword " + arg[k] + " needs a value");
    const Keyword& keyword = kKeywords[which];
    const std::string what = user + ": " + keyword.name;
    law.*keyword.value =
        keyword.positive ? parse_positive(lmp, what, arg[k + 1]) : parse_not_negative(lmp, what, arg[k + 1]);
    given[which] = true;
  }
  for (int k = 0; k < 5; ++k)
    if (kKeywords[k].required && !given[k])
      fail_all(FLERR, lmp, user + ": missing keyword " + kKeywords[k].name);
  return law;
}

Vec3 box_edge(const Domain& domain, int k) {
  if (k == 0) return {domain.xprd, 0, 0};
  if (k == 1) return {domain.triclinic ? domain.xy : 0, domain.yprd, 0};
  return {domain.triclinic ? domain.xz : 0, domain.triclinic ? domain.yz : 0, domain.zprd};
}

void warn_deep(LAMMPS* lmp, const nurbs::DeepContacts& mine, const std::string& user, const std::string& when,
               const std::string& hint, std::string& last) {
  const nurbs::DeepContacts all = of_all_ranks(lmp, mine);
  if (all.count == 0) return;
  char numbers[128];
  std::snprintf(numbers, sizeof numbers,
                "contacts deeper than %g %% of the bounding radius: %.0f, deepest %.3g %%",
                100 * nurbs::DeepContacts::kDepth, all.count, 100 * all.deepest);
  warn_news(FLERR, lmp, user + ": " + when + " " + numbers + "; " + hint, last);
}

void warn_deep_run(LAMMPS* lmp, const nurbs::DeepContacts& mine, const std::string& user) {
  const nurbs::DeepContacts all = of_all_ranks(lmp, mine);
  static constexpr char kQuestion[] = "are they too soft, or is the time step too long?";
  char words[256];
  if (all.count > 0) {
    std::snprintf(
        words, sizeof words,
        "in the run contacts were as deep as %.3g %% of the bounding radius; beyond %g %% with flat "
        "faces, %g %% without, they need not keep energy: %s",
        100 * all.deepest, 100 * nurbs::DeepContacts::kFlatInRun, 100 * nurbs::DeepContacts::kRoundInRun,
        kQuestion);
    warn(FLERR, lmp, user + ": " + words);
  }
  if (all.through > 0) {
    std::snprintf(
        words, sizeof words,
        "in the run bodies overlapped by as much as %.3g %% of what both are thick (the radii of balls "
        "inside them); near 100 %% they go through each other: %s",
        100 * all.through, kQuestion);
    warn(FLERR, lmp, user + ": " + words);
  }
}

bool wants_ledger(const LAMMPS* lmp) {
  for (int k = 0; k < lmp->modify->ncompute; ++k)
    if (std::strcmp(lmp->modify->compute[k]->style, "nurbs/energy") == 0) return true;
  return false;
}

const char* ContactRow::name(int column) {
  static constexpr const char* names[] = {"id1", "id2", "gap", "nx",  "ny",  "nz",  "px", "py",
                                          "pz",  "fnx", "fny", "fnz", "ftx", "fty", "ftz"};
  return names[column];
}

ContactRow make_row(double id1, double id2, const ContactState& state, double sign, const Vec3& point) {
  ContactRow row;
  row.value[ContactRow::id1] = id1;
  row.value[ContactRow::id2] = id2;
  row.value[ContactRow::gap] = -state.overlap;
  for (int k = 0; k < 3; ++k) {
    row.value[ContactRow::nx + k] = sign * state.normal[k];
    row.value[ContactRow::px + k] = point[k];
    row.value[ContactRow::fnx + k] = sign * state.normal_force * state.normal[k];
    row.value[ContactRow::ftx + k] = sign * state.tangential_force[k];
  }
  return row;
}

}  // namespace LAMMPS_NS::nurbs_host

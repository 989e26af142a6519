// See nurbs_contact.h.
#include "liggghts/nurbs_contact.h"

#include <mpi.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "atom.h"
#include "domain.h"
#include "lammps.h"
#include "liggghts/host_error.h"

namespace LAMMPS_NS::nurbs_host {

using nurbs::BodyMotion;
using nurbs::ContactCoefficients;
using nurbs::ContactResult;
using nurbs::ContactState;
using nurbs::Status;
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

BodyMotion motion_of(const AtomVecNurbs& bodies, const Atom& atom, int i, double dt, int freeze_groupbit) {
  const Vec3 velocity(atom.v[i][0], atom.v[i][1], atom.v[i][2]);
  const Vec3 spin(atom.omega[i][0], atom.omega[i][1], atom.omega[i][2]);
  if (atom.mask[i] & freeze_groupbit) {
    BodyMotion frozen;
    frozen.velocity = velocity;
    frozen.spin = frozen.spin_before = spin;
    return frozen;
  }
  const double* q = atom.quaternion[i];
  const nurbs::Quat axes = nurbs::Quat(q[0], q[1], q[2], q[3]) * bodies.shape(i)->principal_axes;
  return nurbs::body_motion(velocity, spin, atom.rmass[i], bodies.principal_inertia(i),
                            axes.toRotationMatrix(), dt);
}

Vec3 box_edge(const Domain& domain, int k) {
  if (k == 0) return {domain.xprd, 0, 0};
  if (k == 1) return {domain.triclinic ? domain.xy : 0, domain.yprd, 0};
  return {domain.triclinic ? domain.xz : 0, domain.triclinic ? domain.yz : 0, domain.zprd};
}

void ContactCounts::add_safe(double weight) {
  value[neighbours] += weight;
  value[safe] += weight;
}

void ContactCounts::add(const ContactResult& result, double weight) {
  value[neighbours] += weight;
  if (result.rung != nurbs::Rung::none) value[safe + static_cast<int>(result.rung) - 1] += weight;
  if (touches(result)) value[contacts] += weight;
  value[iterations] += weight * result.iterations;
  if (result.status == Status::unresolved) value[unresolved] += weight;
}

void DeepContacts::add(const ContactResult& result, double radius, double weight) {
  if (!touches(result) || -result.gap <= kDepth * radius) return;
  count += weight;
  deepest = std::max(deepest, -result.gap / radius);
}

void DeepContacts::warn(LAMMPS* lmp, const std::string& user, const std::string& hint, std::string& last) {
  DeepContacts all;
  MPI_Allreduce(&count, &all.count, 1, MPI_DOUBLE, MPI_SUM, lmp->world);
  MPI_Allreduce(&deepest, &all.deepest, 1, MPI_DOUBLE, MPI_MAX, lmp->world);
  *this = DeepContacts{};
  if (all.count == 0) return;
  char numbers[128];
  std::snprintf(numbers, sizeof numbers,
                "contacts deeper than %g %% of the bounding radius: %.0f, deepest %.3g %%", 100 * kDepth,
                all.count, 100 * all.deepest);
  const std::string warning = user + ": at the start of the run " + numbers + "; " + hint;
  warn_news(FLERR, lmp, warning, last);
}

bool touches(const ContactResult& result) {
  return result.status != Status::separated && result.gap < 0 && result.normal.squaredNorm() > 0.5;
}

bool step_contact(const ContactCoefficients& law, const ContactResult& result,
                  const nurbs::ContactGeometry& geometry, const BodyMotion& a, const BodyMotion& b,
                  const ContactStep& step, ContactState& state, double weight,
                  nurbs::EnergyLedger& dissipated, ContactCounts& counts) {
  if (step.setup) {
    if (!touches(result)) return state = ContactState{}, false;
    if (state.dt > 0 && same_geometry(state, geometry, step.same)) return true;
    if (set_contact(law, geometry, a, b, state)) return true;
    counts.value[ContactCounts::unresolved] += weight;
    return false;
  }
  nurbs::EnergyLedger work;
  if (touches(result)) {
    if (!advance_contact(law, geometry, a, b, step.dt, state, work))
      counts.value[ContactCounts::unresolved] += weight;
  } else {
    end_contact(law, a, b, step.dt, state, work);
  }
  dissipated.damping += weight * work.damping;
  dissipated.friction += weight * work.friction;
  return state.active != 0;
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

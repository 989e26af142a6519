// See pair_gran_nurbs.h.
#include "liggghts/pair_gran_nurbs.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "atom.h"
#include "comm.h"
#include "compute_pair_gran_local.h"
#include "domain.h"
#include "error.h"
#include "fix_contact_property_atom.h"
#include "force.h"
#include "io/pair_case.h"
#include "liggghts/fix_contact_history_nurbs.h"
#include "liggghts/host_error.h"
#include "modify.h"
#include "neigh_list.h"
#include "update.h"

namespace LAMMPS_NS {

using nurbs::ContactCoefficients;
using nurbs::ContactState;
using nurbs::Vec3;
using nurbs_host::fail_all;
using nurbs_host::kHistorySize;
using nurbs_host::memory_of;
using nurbs_host::state_of;
using Vec3Map = Eigen::Map<Vec3>;

namespace {

constexpr const char* kUser = "Pair gran/nurbs";
constexpr double kMinTolerance = 1e-15, kMaxTolerance = 0.1;

// Host styles that take the particles for spheres or want another pair style's data, and what to use instead.
struct Refused {
  const char* prefix;
  const char* instead;
};
constexpr Refused kRefused[] = {{"wall/gran", "; use fix wall/nurbs"},
                                {"heat/gran", ""},
                                {"multicontact", ""},
                                {"rigid", "; use fix nve/nurbs"},
                                {"multisphere", "; use fix nve/nurbs"}};

}  // namespace

struct PairGranNurbs::Neighbours {
  int i, j;       // as the host lists them: i is owned
  int a, b;       // in tag order
  double weight;  // this rank's share of the pair
};

PairGranNurbs::PairGranNurbs(LAMMPS* lmp) : PairGran(lmp) {
  // Tag order makes every value independent of who lists the pair: none changes sign ("0").
  for (int k = 0; k < kHistorySize; ++k) add_history_value("nurbs" + std::to_string(k), "0");
}

PairGranNurbs* PairGranNurbs::find(LAMMPS* lmp) {
  return dynamic_cast<PairGranNurbs*>(lmp->force->pair);
}

void PairGranNurbs::settings(int narg, char** arg) {
  settings_ = nurbs_host::contacts_only();
  for (int k = 0; k < narg; k += 2) {
    const std::string keyword = arg[k];
    if (keyword != "tolerance" && keyword != "solver")
      fail_all(FLERR, lmp,
               "Pair style gran/nurbs: unknown keyword " + keyword + "; allowed are tolerance solver");
    if (k + 1 == narg) fail_all(FLERR, lmp, "Pair style gran/nurbs: keyword " + keyword + " needs a value");
    const std::string value = arg[k + 1];
    if (keyword == "tolerance") {
      settings_.tolerance = nurbs_host::parse_number(lmp, "Pair style gran/nurbs: tolerance", arg[k + 1]);
      if (settings_.tolerance < kMinTolerance || settings_.tolerance > kMaxTolerance)
        fail_all(FLERR, lmp, "Pair style gran/nurbs: tolerance = " + value + " must be in [1e-15, 0.1]");
    } else if (value == "default" || value == "cso") {
      settings_.solver = value == "cso" ? nurbs::Solver::cso : nurbs::Solver::ladder;
    } else {
      fail_all(FLERR, lmp, "Pair style gran/nurbs: solver " + value + " must be default or cso");
    }
  }
}

// The host stops at a type without coefficients before it asks the style, and doesn't say which pair. So its
// flags are all set, and require_all_laws has the say.
void PairGranNurbs::allocate_laws() {
  if (!allocated) allocate();
  ntypes_ = atom->ntypes;
  laws_.resize(static_cast<size_t>(ntypes_ + 1) * (ntypes_ + 1));
  for (int i = 1; i <= ntypes_; ++i)
    for (int j = i; j <= ntypes_; ++j) setflag[i][j] = 1;
}

void PairGranNurbs::coeff(int narg, char** arg) {
  if (narg < 2) fail_all(FLERR, lmp, "Pair coeff: needs two particle types");
  allocate_laws();
  int ilo, ihi, jlo, jhi;
  force->bounds(arg[0], ntypes_, ilo, ihi);
  force->bounds(arg[1], ntypes_, jlo, jhi);
  const std::string user = std::string("Pair coeff ") + arg[0] + " " + arg[1];
  const ContactCoefficients given = nurbs_host::parse_coefficients(lmp, user, 2, narg, arg);
  bool any = false;
  for (int i = ilo; i <= ihi; ++i)
    for (int j = std::max(jlo, i); j <= jhi; ++j) {
      law(i, j) = law(j, i) = given;
      any = true;
    }
  if (!any) fail_all(FLERR, lmp, user + ": names no pair of types I <= J");
}

void PairGranNurbs::require_host_settings() {
  if (force->pair != this) fail_all(FLERR, lmp, std::string(kUser) + " can't be part of a hybrid pair style");
  if (force->newton_pair) fail_all(FLERR, lmp, std::string(kUser) + " needs 'newton off'");
  if (!comm->ghost_velocity) fail_all(FLERR, lmp, std::string(kUser) + " needs 'communicate single vel yes'");
}

void PairGranNurbs::refuse_sphere_features() {
  for (const Refused& refused : kRefused)
    if (const char* style = nurbs_host::fix_style_with(lmp, refused.prefix))
      fail_all(FLERR, lmp,
               std::string("Fix ") + style + " can't be used with pair_style gran/nurbs" + refused.instead);
  ComputePairGranLocal* local = cpl();
  if (local == nullptr) return;
  if (local->offset_fn() >= 0 || local->offset_ft() >= 0 || local->offset_torquen() >= 0 ||
      local->offset_torquet() >= 0 || local->offset_area() >= 0 || local->offset_delta() >= 0)
    nurbs_host::warn(
        FLERR, lmp,
        "Compute pair/gran/local: contactArea, delta, *_normal and *_tangential take the particles for "
        "their bounding spheres; compute nurbs/local has the contact's own");
}

void PairGranNurbs::require_all_laws() {
  for (int i = 1; i <= ntypes_; ++i)
    for (int j = i; j <= ntypes_; ++j)
      if (!law(i, j))
        fail_all(
            FLERR, lmp,
            "Pair gran/nurbs: missing pair_coeff for types " + std::to_string(i) + " " + std::to_string(j));
}

void PairGranNurbs::init_style() {
  bodies_ = AtomVecNurbs::require(lmp, kUser);
  require_host_settings();
  require_all_laws();
  refuse_sphere_features();
  PairGran::init_style();
  history_fix_ = dynamic_cast<FixContactHistoryNurbs*>(fix_history);
  if (history_fix_ == nullptr)
    fail_all(FLERR, lmp, "Pair gran/nurbs: fix contacthistory is not the NURBS one");
  warn_short_box();
  warn_time_step();
}

// Two particles can touch twice, across a short periodic edge, but have one history.
void PairGranNurbs::warn_short_box() {
  double mine = 0, largest = 0;
  for (int i = 0; i < atom->nlocal; ++i) mine = std::max(mine, atom->radius[i]);
  MPI_Allreduce(&mine, &largest, 1, MPI_DOUBLE, MPI_MAX, world);
  for (int k = 0; k < 3 && !short_box_warned_; ++k) {
    const double length = nurbs_host::box_edge(*domain, k).norm();
    if (!domain->periodicity[k] || length >= 4 * largest) continue;
    short_box_warned_ = true;
    nurbs_host::warn(FLERR, lmp,
                     std::string("Pair gran/nurbs: the periodic box is ") + nurbs_host::show(length) +
                         " long in " + "xyz"[k] + "; two largest bounding diameters, " +
                         nurbs_host::show(4 * largest) +
                         ", are needed, or two particles that touch twice share one contact history");
  }
}

void PairGranNurbs::reset_dt() {
  PairGran::reset_dt();
  warn_time_step();
}

// Names the pair of types that asks for the shortest step, by their lightest particles; says a thing once.
void PairGranNurbs::warn_time_step() {
  constexpr double none = 1e300;
  std::vector<double> mine(ntypes_ + 1, none), mass(ntypes_ + 1, none);
  for (int i = 0; i < atom->nlocal; ++i) mine[atom->type[i]] = std::min(mine[atom->type[i]], atom->rmass[i]);
  MPI_Allreduce(mine.data(), mass.data(), ntypes_ + 1, MPI_DOUBLE, MPI_MIN, world);
  double shortest = none;
  int first = 0, second = 0;
  for (int i = 1; i <= ntypes_; ++i)
    for (int j = i; j <= ntypes_; ++j) {
      if (mass[i] == none || mass[j] == none) continue;
      const double step = nurbs::resolved_time_step(*law(i, j), mass[i] * mass[j] / (mass[i] + mass[j]));
      if (step < shortest) shortest = step, first = i, second = j;
    }
  if (update->dt <= shortest) return;
  const std::string warning = "Pair gran/nurbs: time step " + nurbs_host::show(update->dt) +
                              " does not resolve contacts of types " + std::to_string(first) + " and " +
                              std::to_string(second) + "; use " + nurbs_host::show(shortest) + " or less";
  nurbs_host::warn_news(FLERR, lmp, warning, last_warning_);
}

PairGranNurbs::Neighbours PairGranNurbs::order(int i, int j) const {
  const bool swap = atom->tag[j] < atom->tag[i];
  return {i, j, swap ? j : i, swap ? i : j, j < atom->nlocal ? 1.0 : 0.5};
}

// Calls visit(pair, touch flag, history) for the pairs of the neighbour list.
template <class Visit>
void PairGranNurbs::for_each_neighbour(Visit visit) const {
  const int length = const_cast<PairGranNurbs*>(this)->dnum();
  for (int ii = 0; ii < list->inum; ++ii) {
    const int i = list->ilist[ii];
    int* touch = listgranhistory->firstneigh[i];
    double* history = listgranhistory->firstdouble[i];
    for (int jj = 0; jj < list->numneigh[i]; ++jj, history += length)
      visit(order(i, list->firstneigh[i][jj] & NEIGHMASK), touch[jj], history);
  }
}

void PairGranNurbs::compute_force(int eflag, int vflag, int addflag) {
  if (addflag) return report_contacts();
  if (eflag || vflag)
    ev_setup(eflag, vflag);
  else
    evflag = vflag_fdotr = 0;
  step_.setup = shearupdate_ == 0;
  step_.dt = update->dt;
  stored_ = nurbs::EnergyLedger{};
  counts_ = nurbs_host::ContactCounts{};
  for_each_neighbour(
      [this](const Neighbours& pair, int& touch, double* history) { compute_pair(pair, touch, history); });
  if (step_.setup) deep_.warn(lmp, kUser, "do particles overlap?", last_deep_warning_);
  if (storeContactForces()) fix_contact_forces()->do_forward_comm();
  if (storeContactForcesStress()) fix_contact_forces_stress()->do_forward_comm();
}

void PairGranNurbs::compute_pair(const Neighbours& pair, int& touch, double* history) {
  const Vec3 separation = Vec3Map(atom->x[pair.b]) - Vec3Map(atom->x[pair.a]);
  const double reach = atom->radius[pair.a] + atom->radius[pair.b];
  ContactState& state = state_of(history);
  nurbs::ContactResult result;
  result.status = nurbs::Status::separated;
  double scratch[nurbs::kPairMemorySize], *memory = memory_of(history);
  touch = 0;
  if (separation.squaredNorm() > reach * reach) {
    counts_.add_safe(pair.weight);
    if (state.active == 0) return;
  } else {
    // At setup the memory stays as the last step left it, so that a run in two parts moves as one.
    if (step_.setup) {
      std::copy_n(memory, nurbs::kPairMemorySize, scratch);
      memory = scratch;
    }
    result = find_contact(bodies_->particle(pair.a), bodies_->particle(pair.b), settings_, memory);
    counts_.add(result, pair.weight);
    if (step_.setup) deep_.add(result, std::min(atom->radius[pair.a], atom->radius[pair.b]), pair.weight);
    if (result.status == nurbs::Status::unresolved) keep_case(pair);
    if (!nurbs_host::touches(result) && state.active == 0) return;
  }

  const ContactCoefficients& coefficients = *law(atom->type[pair.a], atom->type[pair.b]);
  const nurbs::ContactGeometry geometry = nurbs::pair_geometry(result, separation);
  step_.same = 10 * settings_.tolerance * std::min(atom->radius[pair.a], atom->radius[pair.b]) +
               1e-13 * (separation.norm() + Vec3Map(atom->x[pair.a]).norm());
  if (!step_contact(coefficients, result, geometry,
                    nurbs_host::motion_of(*bodies_, *atom, pair.a, update->dt, freeze_group_bit_),
                    nurbs_host::motion_of(*bodies_, *atom, pair.b, update->dt, freeze_group_bit_), step_,
                    state, pair.weight, history_fix_->dissipated(), counts_))
    return;
  touch = 1;
  apply(pair, coefficients, state);
}

// The first unresolved pair a rank meets, as a file that tests can replay (io/pair_case.h).
void PairGranNurbs::keep_case(const Neighbours& pair) {
  if (case_kept_) return;
  case_kept_ = true;
  const std::string file =
      "unresolved-" + std::to_string(atom->tag[pair.a]) + "-" + std::to_string(atom->tag[pair.b]) + ".json";
  const bool written =
      nurbs::write_pair_case(file, bodies_->particle(pair.a), bodies_->particle(pair.b), settings_);
  const std::string where =
      written ? "; the first is kept in " + file : "; " + file + " could not be written";
  error->warning(
      FLERR, ("Pair gran/nurbs: a contact is not resolved to the tolerance, see compute nurbs/stats" + where)
                 .c_str());
}

// Adds the forces of a contact to the owned particles, and what the host wants to know of it.
void PairGranNurbs::apply(const Neighbours& pair, const ContactCoefficients& coefficients,
                          const ContactState& state) {
  const Vec3 force_b = force_on_b(state);
  const Vec3 torque_a = -Eigen::Map<const Vec3>(state.arm_a).cross(force_b);
  const Vec3 torque_b = Eigen::Map<const Vec3>(state.arm_b).cross(force_b);
  const bool i_is_a = pair.i == pair.a;
  double on_i[6], on_j[6];
  Vec3Map{on_i} = i_is_a ? Vec3(-force_b) : force_b;
  Vec3Map{on_i + 3} = i_is_a ? torque_a : torque_b;
  Vec3Map{on_j} = i_is_a ? force_b : Vec3(-force_b);
  Vec3Map{on_j + 3} = i_is_a ? torque_b : torque_a;

  for (const auto& [k, load] : {std::pair(pair.i, on_i), std::pair(pair.j, on_j)}) {
    if (k >= atom->nlocal) continue;
    const double factor = relax(k);
    Vec3Map(atom->f[k]) += factor * Vec3Map(load);
    Vec3Map(atom->torque[k]) += factor * Vec3Map(load + 3);
    if (store_sum_normal_force()) *get_sum_normal_force_ptr(k) += state.normal_force;
  }

  const nurbs::EnergyLedger energy = stored_energy(coefficients, state);
  stored_.add(energy, pair.weight);
  if (evflag) {
    const Vec3 apart = Vec3Map(atom->x[pair.i]) - Vec3Map(atom->x[pair.j]);
    ev_tally_xyz(pair.i, pair.j, atom->nlocal, 0, energy.elastic(), 0, on_i[0], on_i[1], on_i[2], apart.x(),
                 apart.y(), apart.z());
  }
  keep_contact_force(pair, on_i, on_j);
}

// For host fixes that asked for the force of every contact.
void PairGranNurbs::keep_contact_force(const Neighbours& pair, const double* on_i, const double* on_j) {
  const int *tag = atom->tag, i = pair.i, j = pair.j;
  if (storeContactForces() && update->ntimestep % storeContactForcesEvery() == 0) {
    FixContactPropertyAtom* keep = fix_contact_forces();
    if (keep->has_partner(i, tag[j]) == -1) keep->add_partner(i, tag[j], on_i);
    if (keep->has_partner(j, tag[i]) == -1) keep->add_partner(j, tag[i], on_j);
  }
  if (storeContactForcesStress()) {
    FixContactPropertyAtom* keep = fix_contact_forces_stress();
    const double of_i[] = {on_i[0], on_i[1], on_i[2], static_cast<double>(j)};
    const double of_j[] = {on_j[0], on_j[1], on_j[2], static_cast<double>(i)};
    if (keep->has_partner(i, tag[j]) == -1) keep->add_partner(i, tag[j], of_i);
    if (keep->has_partner(j, tag[i]) == -1) keep->add_partner(j, tag[i], of_j);
  }
}

// compute pair/gran/local: the contacts as the history holds them; nothing is computed anew.
void PairGranNurbs::report_contacts() {
  ComputePairGranLocal* local = cpl();
  if (local == nullptr) return;
  for_each_neighbour([&](const Neighbours& pair, int&, double* history) {
    const ContactState& state = state_of(history);
    if (state.active == 0) return;
    const bool i_is_a = pair.i == pair.a;
    const Vec3 force = i_is_a ? Vec3(-force_on_b(state)) : force_on_b(state);
    const Vec3 arm(i_is_a ? state.arm_a : state.arm_b);
    const Vec3 torque = arm.cross(force), point = Vec3Map(atom->x[pair.i]) + arm;
    local->add_pair(pair.i, pair.j, force.x(), force.y(), force.z(), torque.x(), torque.y(), torque.z(),
                    history, point.data());
  });
  cpl_pair_finalize();
}

void PairGranNurbs::append_rows(int groupbit, std::vector<nurbs_host::ContactRow>& rows) const {
  if (list == nullptr || listgranhistory == nullptr) return;
  for_each_neighbour([&](const Neighbours& pair, int&, double* history) {
    const ContactState& state = state_of(history);
    if (state.active == 0 || !(atom->mask[pair.i] & atom->mask[pair.j] & groupbit)) return;
    if (pair.j >= atom->nlocal && pair.i != pair.a) return;
    double point[3];
    Vec3Map{point} = Vec3Map(atom->x[pair.a]) + Eigen::Map<const Vec3>(state.arm_a);
    domain->remap(point);
    rows.push_back(nurbs_host::make_row(atom->tag[pair.a], atom->tag[pair.b], state, -1, Vec3(point)));
  });
}

nurbs::EnergyLedger PairGranNurbs::energy() const {
  nurbs::EnergyLedger all = stored_;
  if (history_fix_ != nullptr) all.add(history_fix_->dissipated(), 1);
  return all;
}

void PairGranNurbs::write_restart_settings(FILE* file) {
  const double values[] = {settings_.tolerance, static_cast<double>(settings_.solver)};
  std::fwrite(values, sizeof values, 1, file);
}

void PairGranNurbs::read_restart_settings(FILE* file, const int, const int) {
  double values[2] = {0, 0};
  if (comm->me == 0 && std::fread(values, sizeof values, 1, file) != 1)
    nurbs_host::fail_one(lmp, "Restart file is cut off in pair gran/nurbs");
  MPI_Bcast(values, 2, MPI_DOUBLE, 0, world);
  settings_.tolerance = values[0];
  settings_.solver = static_cast<nurbs::Solver>(static_cast<int>(values[1]));
}

void PairGranNurbs::write_restart(FILE* file) {
  write_restart_settings(file);
  for (int i = 1; i <= atom->ntypes; ++i)
    for (int j = i; j <= atom->ntypes; ++j) {
      const bool set = allocated && law(i, j);
      const ContactCoefficients c = set ? *law(i, j) : ContactCoefficients{};
      const double values[] = {set ? 1.0 : 0.0, c.kn, c.kt, c.cn, c.ct, c.mu};
      std::fwrite(values, sizeof values, 1, file);
    }
}

void PairGranNurbs::read_restart(FILE* file, const int major, const int minor) {
  read_restart_settings(file, major, minor);
  allocate_laws();
  for (int i = 1; i <= ntypes_; ++i)
    for (int j = i; j <= ntypes_; ++j) {
      double values[6] = {};
      if (comm->me == 0 && std::fread(values, sizeof values, 1, file) != 1)
        nurbs_host::fail_one(lmp, "Restart file is cut off in pair gran/nurbs");
      MPI_Bcast(values, 6, MPI_DOUBLE, 0, world);
      if (values[0] != 0)
        law(i, j) = law(j, i) = ContactCoefficients{values[1], values[2], values[3], values[4], values[5]};
    }
}

}  // namespace LAMMPS_NS

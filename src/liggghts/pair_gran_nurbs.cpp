// See pair_gran_nurbs.h.
#include "liggghts/pair_gran_nurbs.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <set>

#include "atom.h"
#include "comm.h"
#include "compute_pair_gran_local.h"
#include "domain.h"
#include "error.h"
#include "fix_contact_property_atom.h"
#include "fix_property_global.h"
#include "force.h"
#include "io/pair_case.h"
#include "liggghts/fix_contact_history_nurbs.h"
#include "liggghts/host_error.h"
#include "modify.h"
#include "neigh_list.h"
#include "neighbor.h"
#include "update.h"

namespace LAMMPS_NS {

using nurbs::ContactCoefficients;
using nurbs::ContactState;
using nurbs::Vec3;
using nurbs_host::fail_all;
using Vec3Map = Eigen::Map<Vec3>;

namespace {

constexpr const char* kUser = "Pair gran/nurbs";
constexpr double kMinTolerance = 1e-15, kMaxTolerance = 0.1;

}  // namespace

PairGranNurbs::PairGranNurbs(LAMMPS* lmp) : PairGran(lmp) {
  // Tag order makes every value independent of who lists the pair: none changes sign ("0").
  for (int k = 0; k < nurbs::kProofSize; ++k) add_history_value("nurbs" + std::to_string(k), "0");
}

// The base class would delete the history.
PairGranNurbs::~PairGranNurbs() {
  auto* history = dynamic_cast<FixContactHistoryNurbs*>(fix_history);
  if (history == nullptr) return;
  history->bequeath({std::move(stages_.pool()), stages_.dissipated(), fingerprint_, layout()});
  fix_history = nullptr;
}

// Of a pair style gran/nurbs before this one.
void PairGranNurbs::go_on_with_contacts() {
  auto* history = dynamic_cast<FixContactHistoryNurbs*>(modify->find_fix_style_strict("contacthistory", 0));
  if (history == nullptr || !history->bequeathed()) return;
  fix_history = history;
  FixContactHistoryNurbs::Legacy legacy = history->inherit();
  stages_.dissipated() = legacy.dissipated;
  fingerprint_ = legacy.fingerprint;
  if (legacy.models == layout()) {
    stages_.pool() = std::move(legacy.contacts);
    return;
  }
  history->forget_contacts();
  nurbs_host::warn(
      FLERR, lmp,
      std::string(kUser) +
          ": its models are others than those of the pair_style before; all contacts begin anew, "
          "without their friction springs");
}

PairGranNurbs* PairGranNurbs::find(LAMMPS* lmp) {
  return dynamic_cast<PairGranNurbs*>(lmp->force->pair);
}

void PairGranNurbs::settings(int narg, char** arg) {
  require_alone();
  settings_ = nurbs_host::contacts_only();
  std::unique_ptr<nurbs_host::HostModels> models;
  std::set<std::string> given;
  for (int k = 0; k < narg; k += 2) {
    const std::string keyword = arg[k];
    if (nurbs_host::HostModels::named_by(narg - k, arg + k)) {
      models = std::make_unique<nurbs_host::HostModels>(lmp, "Pair style gran/nurbs", 0, narg - k, arg + k);
      break;
    }
    if (keyword == "tangential" || keyword == "cohesion" || keyword == "rolling_friction")
      fail_all(FLERR, lmp, "Pair style gran/nurbs: model NORMAL must stand before " + keyword);
    if (keyword != "tolerance" && keyword != "solver")
      fail_all(FLERR, lmp,
               "Pair style gran/nurbs: unknown keyword " + keyword +
                   "; allowed are tolerance solver radius model");
    if (k + 1 == narg) fail_all(FLERR, lmp, "Pair style gran/nurbs: keyword " + keyword + " needs a value");
    if (!given.insert(keyword).second)
      fail_all(FLERR, lmp, "Pair style gran/nurbs: keyword " + keyword + " is there twice");
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
  set_models(std::move(models));
}

// Contacts keep their history if it is of the same models.
void PairGranNurbs::set_models(std::unique_ptr<nurbs_host::HostModels> models) {
  const std::string before = layout();
  models_ = std::move(models);
  if (layout() == before) return;
  stages_.pool().clear();
  stages_.pool().set_memory_size(models_ ? nurbs::kModelMemory + models_->history_size() : 0);
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
  if (models_) {
    if (narg > 2)
      fail_all(FLERR, lmp,
               user + " " + arg[2] +
                   ": with model .. the materials are those of fix property/global; "
                   "write pair_coeff * *");
    return;
  }
  if (narg == 2)
    fail_all(FLERR, lmp, user + ": needs kn KN kt KT mu MU, or a pair_style gran/nurbs with model NORMAL ..");
  const ContactCoefficients given = nurbs_host::parse_coefficients(lmp, user, 2, narg, arg);
  bool any = false;
  for (int i = ilo; i <= ihi; ++i)
    for (int j = std::max(jlo, i); j <= jhi; ++j) {
      law(i, j) = law(j, i) = given;
      any = true;
    }
  if (!any) fail_all(FLERR, lmp, user + ": names no pair of types I <= J");
}

// The host makes a hybrid's parts, and reads their words, when the hybrid is the pair style already.
void PairGranNurbs::require_alone() {
  if (force->pair != this) fail_all(FLERR, lmp, std::string(kUser) + " can't be part of a hybrid pair style");
}

void PairGranNurbs::require_host_settings() {
  require_alone();
  if (force->newton_pair) fail_all(FLERR, lmp, std::string(kUser) + " needs 'newton off'");
  if (!comm->ghost_velocity) fail_all(FLERR, lmp, std::string(kUser) + " needs 'communicate single vel yes'");
}

void PairGranNurbs::warn_of_sphere_values() {
  ComputePairGranLocal* local = cpl();
  if (local == nullptr) return;
  if (local->offset_fn() >= 0 || local->offset_ft() >= 0 || local->offset_torquen() >= 0 ||
      local->offset_torquet() >= 0 || local->offset_area() >= 0 || local->offset_delta() >= 0)
    nurbs_host::warn_news(
        FLERR, lmp,
        "Compute pair/gran/local: contactArea, delta, *_normal and *_tangential take the particles for "
        "their bounding spheres; compute nurbs/local has the contact's own",
        last_sphere_warning_);
}

void PairGranNurbs::require_all_laws() {
  if (models_) return;
  for (int i = 1; i <= ntypes_; ++i)
    for (int j = i; j <= ntypes_; ++j)
      if (!law(i, j))
        fail_all(
            FLERR, lmp,
            "Pair gran/nurbs: missing pair_coeff for types " + std::to_string(i) + " " + std::to_string(j));
}

// The host has just forgotten all materials.
void PairGranNurbs::init_granular() {
  if (models_) models_->init();
}

void PairGranNurbs::init_style() {
  bodies_ = AtomVecNurbs::require(lmp, kUser);
  require_host_settings();
  require_all_laws();
  warn_of_sphere_values();
  if (fix_history == nullptr) go_on_with_contacts();
  PairGran::init_style();
  if (dynamic_cast<FixContactHistoryNurbs*>(fix_history) == nullptr)
    fail_all(FLERR, lmp, "Pair gran/nurbs: fix contacthistory is not the NURBS one");
  law_table_.assign(laws_.size(), nurbs::ContactCoefficients{});
  for (size_t k = 0; k < laws_.size(); ++k)
    if (laws_[k]) law_table_[k] = *laws_[k];
  ledger_ = nurbs_host::wants_ledger(lmp);
  warn_time_step();
}

// Where there are no particles yet, or no more, the host would stop: "Atom sorting has bin size = 0.0".
double PairGranNurbs::init_one(int i, int j) {
  const double reach = PairGran::init_one(i, j);
  return reach > 0 ? reach : neighbor->skin;
}

// Across a short periodic edge two particles, or one and its image, can touch twice: each is a contact of its
// own. What is remembered goes by the partner's number alone; of several it is that of this image, not what
// the host may have found first.
void PairGranNurbs::recall_images(int i, double images_apart) {
  const auto& history = static_cast<const FixContactHistoryNurbs&>(*fix_history);
  const int *tag = atom->tag, count = list->numneigh[i];
  auto* proofs = reinterpret_cast<nurbs::PairProof*>(listgranhistory->firstdouble[i]);
  const auto partner = [&](int jj) { return list->firstneigh[i][jj] & NEIGHMASK; };
  for (int jj = 0; jj < count; ++jj) {
    const int j = partner(jj);
    const Vec3 way = Vec3Map(atom->x[j]) - Vec3Map(atom->x[i]);
    proofs[jj] = nurbs::PairProof{};
    history.recall(i, tag[j], is_swapped(i, j) ? Vec3(-way) : way, images_apart, proofs + jj);
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
  if (models_) return;  // fix check/timestep/gran has the say
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

// A pair is solved in tag order, so that ranks that both own half of it compute the same bits. A body and its
// own image are there twice, each time with the other side's force; they are solved from low to high place,
// which makes both the same contact.
bool PairGranNurbs::is_swapped(int i, int j) const {
  if (atom->tag[i] != atom->tag[j]) return atom->tag[j] < atom->tag[i];
  for (int k = 0; k < 3; ++k) {
    const double way = atom->x[j][k] - atom->x[i][k];
    if (std::abs(way) > 0.5 * nurbs_host::box_edge(*domain, k)[k]) return way < 0;
  }
  return false;
}

void PairGranNurbs::hand_in_neighbours() {
  stages_.begin_neighbours();
  double shortest = nurbs::kFarAway, radius = 0;
  for (int k = 0; k < 3; ++k)
    if (domain->periodicity[k]) shortest = std::min(shortest, nurbs_host::box_edge(*domain, k).norm());
  for (int i = 0; i < atom->nlocal + atom->nghost; ++i) radius = std::max(radius, atom->radius[i]);
  const bool short_box = shortest < 4 * radius + 2 * neighbor->skin;
  const auto& history = static_cast<const FixContactHistoryNurbs&>(*fix_history);
  const int* tag = atom->tag;
  for (int ii = 0; ii < list->inum; ++ii) {
    const int i = list->ilist[ii];
    auto* proofs = reinterpret_cast<nurbs::PairProof*>(listgranhistory->firstdouble[i]);
    if (short_box) recall_images(i, shortest);
    for (int jj = 0; jj < list->numneigh[i]; ++jj) {
      const int j = list->firstneigh[i][jj] & NEIGHMASK;
      // Of several images of one pair a tag does not tell which.
      if (!short_box && proofs[jj].stamp == 0) history.recall(i, tag[j], proofs + jj);
      const bool swap = is_swapped(i, j);
      stages_.add_neighbour(swap ? j : i, swap ? i : j, proofs + jj);
    }
  }
  stages_.end_neighbours();
}

// Of all ranks: motion and mass of every body, and what contacts are computed with, in whatever order.
// Positions are not in it, which wrap; contacts see themselves whether bodies have been moved.
std::uint64_t PairGranNurbs::fingerprint() const {
  const auto add = [](double value, std::uint64_t* to) {
    *to = nurbs::body_stamp(*to, value + 0.0);  // -0 is 0
  };
  std::uint64_t mine = 0, all = 0, rest = 1;
  int frozen = 0;
  for (int k = 0; k < modify->nfix; ++k)
    if (std::strcmp(modify->fix[k]->style, "freeze") == 0) frozen |= modify->fix[k]->groupbit;
  for (int i = 0; i < atom->nlocal; ++i) {
    std::uint64_t body = static_cast<std::uint64_t>(atom->tag[i]);
    for (int k = 0; k < 3; ++k) {
      add(atom->v[i][k], &body);
      add(atom->omega[i][k], &body);
    }
    add(atom->rmass[i], &body);
    add(atom->type[i], &body);
    add((atom->mask[i] & frozen) != 0, &body);
    mine += body;
  }
  MPI_Allreduce(&mine, &all, 1, MPI_UINT64_T, MPI_SUM, world);
  for (const Law& given : laws_) {
    const nurbs::ContactCoefficients law = given ? *given : nurbs::ContactCoefficients{};
    for (const double value : {law.kn, law.kt, law.cn, law.ct, law.mu}) add(value, &rest);
  }
  for (int k = 0; k < modify->nfix; ++k)
    if (auto* property = dynamic_cast<FixPropertyGlobal*>(modify->fix[k])) {
      std::uint64_t own = 1;
      for (const char* c = property->id; *c != '\0'; ++c) add(*c, &own);
      for (int n = 0; n < property->size_vector; ++n) add(property->compute_vector(n), &own);
      for (int n = 0; n < property->size_array_rows; ++n)
        for (int m = 0; m < property->size_array_cols; ++m) add(property->compute_array(n, m), &own);
      all += own;
    }
  return nurbs::mix(all + rest) | 1;
}

std::uint64_t PairGranNurbs::last_fingerprint() const {
  return update->whichflag != 0 ? fingerprint() : fingerprint_;
}

void PairGranNurbs::compute_force(int eflag, int vflag, int addflag) {
  if (addflag) return report_contacts();
  if (eflag || vflag)
    ev_setup(eflag, vflag);
  else
    evflag = vflag_fdotr = 0;
  nurbs::ContactStages::Step step;
  step.bodies = &bodies_->update_bodies(freeze_group_bit_);
  const bool inserted = neighbor->ago == 0 && atom->natoms > checked_particles_;
  if (inserted) {  // they may be lighter
    checked_particles_ = atom->natoms;
    warn_time_step();
  }
  if (neighbor->ago == 0) hand_in_neighbours();
  step.owned = atom->nlocal;
  step.dt = update->dt;
  step.setup = shearupdate_ == 0;
  changed_ = step.setup && fingerprint_ != 0 && fingerprint() != fingerprint_;
  step.changed = changed_;
  step.ledger = ledger_;
  step.settings = settings_;
  if (inserted) step.tags = atom->tag;
  step.last_tag = last_tag_;
  step.types = atom->type;
  step.type_count = ntypes_ + 1;
  step.laws = law_table_.data();
  step.model = models_.get();
  stages_.compute(step);
  add_forces();
  if (evflag || storeContactForces() || storeContactForcesStress())
    stages_.for_each_contact([this](const nurbs::ContactView& contact) { tally(contact); });
  keep_case();
  if (step.setup || inserted) {
    nurbs_host::warn_deep(lmp, step.setup ? stages_.deep() : stages_.deep_inserted(), kUser,
                          step.setup ? "at the start of the run" : "particles just inserted have",
                          "do particles overlap?", last_deep_warning_);
    last_tag_ = atom->tag_max();
  }
  if (storeContactForces()) fix_contact_forces()->do_forward_comm();
  if (storeContactForcesStress()) fix_contact_forces_stress()->do_forward_comm();
}

void PairGranNurbs::warn_deep_run() {
  nurbs_host::warn_deep_run(lmp, stages_.deep_in_run(), kUser);
}

void PairGranNurbs::add_forces() {
  for (const int i : stages_.loaded()) {
    const nurbs::ContactStages::Sum sum = stages_.sum(i);
    const double factor = relax(i);
    Vec3Map(atom->f[i]) += factor * sum.force;
    Vec3Map(atom->torque[i]) += factor * sum.torque;
    if (store_sum_normal_force()) *get_sum_normal_force_ptr(i) += sum.normal;
  }
}

// The first unresolved pair a rank meets, as a file that tests can replay (io/pair_case.h).
void PairGranNurbs::keep_case() {
  const nurbs::ContactStages::Unresolved& pair = stages_.unresolved();
  if (case_kept_ || !pair.any) return;
  case_kept_ = true;
  const std::string file =
      "unresolved-" + std::to_string(atom->tag[pair.a]) + "-" + std::to_string(atom->tag[pair.b]) + ".json";
  const bool written = nurbs::write_pair_case(file, pair.particle_a, pair.particle_b, settings_);
  const std::string where =
      written ? "; the first is kept in " + file : "; " + file + " could not be written";
  error->warning(
      FLERR, ("Pair gran/nurbs: a contact is not resolved to the tolerance, see compute nurbs/stats" + where)
                 .c_str());
}

// Energy and virial of one contact, and its force for host fixes that asked for it.
void PairGranNurbs::tally(const nurbs::ContactView& contact) {
  const ContactState& state = contact.state;
  const Vec3 force = force_on_b(state);
  double on_a[6], on_b[6];
  Vec3Map{on_a} = -force;
  Vec3Map{on_a + 3} = -Eigen::Map<const Vec3>(state.arm_a).cross(force) - contact.torque;
  Vec3Map{on_b} = force;
  Vec3Map{on_b + 3} = Eigen::Map<const Vec3>(state.arm_b).cross(force) + contact.torque;
  if (evflag) {
    const Vec3 apart = Vec3Map(atom->x[contact.a]) - Vec3Map(atom->x[contact.b]);
    ev_tally_xyz(contact.a, contact.b, atom->nlocal, 0, contact.stored.elastic(), 0, on_a[0], on_a[1],
                 on_a[2], apart.x(), apart.y(), apart.z());
  }
  keep_contact_force(contact, on_a, on_b);
}

void PairGranNurbs::keep_contact_force(const nurbs::ContactView& contact, const double* on_a,
                                       const double* on_b) {
  const int *tag = atom->tag, a = contact.a, b = contact.b;
  if (storeContactForces() && update->ntimestep % storeContactForcesEvery() == 0) {
    FixContactPropertyAtom* keep = fix_contact_forces();
    if (keep->has_partner(a, tag[b]) == -1) keep->add_partner(a, tag[b], on_a);
    if (keep->has_partner(b, tag[a]) == -1) keep->add_partner(b, tag[a], on_b);
  }
  if (storeContactForcesStress()) {
    FixContactPropertyAtom* keep = fix_contact_forces_stress();
    const double of_a[] = {on_a[0], on_a[1], on_a[2], static_cast<double>(b)};
    const double of_b[] = {on_b[0], on_b[1], on_b[2], static_cast<double>(a)};
    if (keep->has_partner(a, tag[b]) == -1) keep->add_partner(a, tag[b], of_a);
    if (keep->has_partner(b, tag[a]) == -1) keep->add_partner(b, tag[a], of_b);
  }
}

// compute pair/gran/local: the contacts as they were left; nothing is computed anew. As `history` it shows
// normal, tangential spring, arm, tangential force (three numbers each), overlap, normal force, and whether
// it slides.
void PairGranNurbs::report_contacts() {
  ComputePairGranLocal* local = cpl();
  if (local == nullptr) return;
  stages_.for_each_contact([&](const nurbs::ContactView& contact) {
    const ContactState& state = contact.state;
    const bool i_is_a = contact.a < atom->nlocal;
    const int i = i_is_a ? contact.a : contact.b, j = i_is_a ? contact.b : contact.a;
    const Vec3 force = i_is_a ? Vec3(-force_on_b(state)) : force_on_b(state);
    const Vec3 arm(i_is_a ? state.arm_a : state.arm_b);
    const Vec3 torque = arm.cross(force) + (i_is_a ? -1 : 1) * contact.torque,
               point = Vec3Map(atom->x[i]) + arm;
    double shown[nurbs::kProofSize];
    std::copy_n(state.normal, 3, shown);
    std::copy_n(state.spring, 3, shown + 3);
    std::copy_n(arm.data(), 3, shown + 6);
    std::copy_n(state.tangential_force, 3, shown + 9);
    shown[12] = state.overlap;
    shown[13] = state.normal_force;
    shown[14] = state.sliding;
    double at[3] = {point.x(), point.y(), point.z()};
    local->add_pair(i, j, force.x(), force.y(), force.z(), torque.x(), torque.y(), torque.z(), shown, at);
  });
  cpl_pair_finalize();
}

void PairGranNurbs::append_rows(int groupbit, std::vector<nurbs_host::ContactRow>& rows) const {
  stages_.for_each_contact([&](const nurbs::ContactView& contact) {
    const int a = contact.a, b = contact.b;
    if (a >= atom->nlocal || !(atom->mask[a] & atom->mask[b] & groupbit)) return;
    double point[3];
    Vec3Map{point} = Vec3Map(atom->x[a]) + Eigen::Map<const Vec3>(contact.state.arm_a);
    domain->remap(point);
    rows.push_back(nurbs_host::make_row(atom->tag[a], atom->tag[b], contact.state, -1, Vec3(point)));
  });
}

// The points of a polygon, which follow each other, are one contact.
void PairGranNurbs::count_contacts(double* count) const {
  const nurbs::PairProof* last = nullptr;
  stages_.for_each_contact([&](const nurbs::ContactView& contact) {
    if (contact.proof == last) return;
    last = contact.proof;
    for (const int i : {contact.a, contact.b})
      if (i < atom->nlocal) ++count[i];
  });
}

void PairGranNurbs::write_restart_settings(FILE* file) {
  const double values[] = {settings_.tolerance, static_cast<double>(settings_.solver)};
  std::fwrite(values, sizeof values, 1, file);
  const std::string text = models_ ? models_->text() : "";
  const int length = static_cast<int>(text.size());
  std::fwrite(&length, sizeof length, 1, file);
  std::fwrite(text.data(), 1, text.size(), file);
}

void PairGranNurbs::read_restart_settings(FILE* file, const int, const int) {
  double values[2] = {0, 0};
  if (comm->me == 0 && std::fread(values, sizeof values, 1, file) != 1)
    nurbs_host::fail_one(lmp, "Restart file is cut off in pair gran/nurbs");
  MPI_Bcast(values, 2, MPI_DOUBLE, 0, world);
  settings_.tolerance = values[0];
  settings_.solver = static_cast<nurbs::Solver>(static_cast<int>(values[1]));
  constexpr int kMostText = 10000;
  int length = 0;
  if (comm->me == 0 && (std::fread(&length, sizeof length, 1, file) != 1 || length < 0 || length > kMostText))
    nurbs_host::fail_one(lmp, "Restart file is cut off in pair gran/nurbs");
  MPI_Bcast(&length, 1, MPI_INT, 0, world);
  std::string text(length, ' ');
  if (comm->me == 0 && std::fread(text.data(), 1, text.size(), file) != text.size())
    nurbs_host::fail_one(lmp, "Restart file is cut off in pair gran/nurbs");
  MPI_Bcast(text.data(), length, MPI_CHAR, 0, world);
  set_models(length == 0 ? nullptr
                         : std::make_unique<nurbs_host::HostModels>(lmp, "Pair style gran/nurbs", 0, text));
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

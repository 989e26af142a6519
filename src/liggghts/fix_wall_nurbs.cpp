// See fix_wall_nurbs.h.
#include "liggghts/fix_wall_nurbs.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>

#include "atom.h"
#include "comm.h"
#include "domain.h"
#include "force.h"
#include "liggghts/host_error.h"
#include "liggghts/pair_gran_nurbs.h"
#include "memory.h"
#include "modify.h"
#include "neighbor.h"
#include "update.h"

namespace LAMMPS_NS {

using nurbs::Vec3;
using nurbs_host::fail_all;
using Vec3Map = Eigen::Map<Vec3>;

namespace {

constexpr int kPlaneArguments = 7;  // plane PX PY PZ NX NY NZ

}  // namespace

FixWallNurbs::FixWallNurbs(LAMMPS* lmp, int narg, char** arg) : Fix(lmp, narg, arg) {
  AtomVecNurbs::require(lmp, "Fix wall/nurbs");
  parse_plane(narg, arg);
  parse_law(3 + kPlaneArguments, narg, arg);

  scalar_flag = vector_flag = 1;
  size_vector = 6;
  global_freq = 1;
  extscalar = extvector = 1;
  restart_global = restart_peratom = 1;
  create_attribute = 1;

  grow_arrays(atom->nmax);
  for (int i = 0; i < atom->nlocal; ++i) set_arrays(i);
  atom->add_callback(0);
  atom->add_callback(1);
}

FixWallNurbs::~FixWallNurbs() {
  atom->delete_callback(id, 0);
  atom->delete_callback(id, 1);
  memory->destroy(proofs_);
}

void FixWallNurbs::parse_plane(int narg, char** arg) {
  if (narg < 4 || std::strcmp(arg[3], "plane") != 0)
    fail_all(FLERR, lmp,
             std::string("Fix wall/nurbs: kind of wall ") + (narg < 4 ? "is missing;" : arg[3]) +
                 " must be plane");
  if (narg < 3 + kPlaneArguments) fail_all(FLERR, lmp, "Fix wall/nurbs plane needs PX PY PZ NX NY NZ");
  Vec3 normal;
  for (int k = 0; k < 3; ++k) {
    origin_[k] = nurbs_host::parse_number(lmp, "Fix wall/nurbs plane: point", arg[4 + k]);
    normal[k] = nurbs_host::parse_number(lmp, "Fix wall/nurbs plane: normal", arg[7 + k]);
  }
  const double length = normal.stableNorm();
  if (!(length > 0)) fail_all(FLERR, lmp, "Fix wall/nurbs plane: normal = 0 0 0 must have a length > 0");
  normal_ = normal / length;
}

void FixWallNurbs::parse_law(int first, int narg, char** arg) {
  if (narg <= first || std::strcmp(arg[first], "type") != 0) {
    if (nurbs_host::HostModels::named_by(narg - first, arg + first))
      fail_all(FLERR, lmp,
               std::string("Fix wall/nurbs: type T, the wall's atom type, must stand before ") + arg[first]);
    law_ = nurbs_host::parse_coefficients(lmp, "Fix wall/nurbs", first, narg, arg);
    return;
  }
  const std::string value = narg > first + 1 ? arg[first + 1] : "";
  char* end = nullptr;
  const long type = std::strtol(value.c_str(), &end, 10);
  if (value.empty() || *end != '\0' || type < 1 || type > atom->ntypes)
    fail_all(FLERR, lmp,
             "Fix wall/nurbs: type = " + value + " must be an atom type, in [1, " +
                 std::to_string(atom->ntypes) + "]");
  models_ = std::make_unique<nurbs_host::HostModels>(lmp, "Fix wall/nurbs", static_cast<int>(type),
                                                     narg - first - 2, arg + first + 2);
  stages_.pool().set_memory_size(nurbs::kModelMemory + models_->history_size());
}

std::vector<FixWallNurbs*> FixWallNurbs::all(LAMMPS* lmp) {
  std::vector<FixWallNurbs*> walls;
  for (int k = 0; k < lmp->modify->nfix; ++k)
    if (auto* wall = dynamic_cast<FixWallNurbs*>(lmp->modify->fix[k])) walls.push_back(wall);
  return walls;
}

int FixWallNurbs::setmask() {
  return FixConst::POST_FORCE | FixConst::THERMO_ENERGY;
}

void FixWallNurbs::init() {
  bodies_ = AtomVecNurbs::require(lmp, "Fix wall/nurbs");
  if (const PairGranNurbs* pair = PairGranNurbs::find(lmp)) settings_ = pair->contact_settings();
  freeze_groupbit_ = 0;
  for (int k = 0; k < modify->nfix; ++k)
    if (std::strcmp(modify->fix[k]->style, "freeze") == 0) freeze_groupbit_ = modify->fix[k]->groupbit;
  const int walls = static_cast<int>(all(lmp).size());
  comm->maxexchange_fix =
      std::max(comm->maxexchange_fix, walls * (nurbs::kProofSize + nurbs::kMostContactSize));
  ledger_ = nurbs_host::wants_ledger(lmp);
  if (models_) models_->init();
  warn_periodic();
  warn_time_step();
}

void FixWallNurbs::warn_periodic() {
  std::string directions;
  for (int k = 0; k < 3; ++k) {
    const Vec3 edge = nurbs_host::box_edge(*domain, k);
    if (domain->periodicity[k] && std::abs(normal_.dot(edge)) > 1e-9 * edge.norm())
      directions += std::string(" ") + "xyz"[k];
  }
  if (directions.empty() || periodic_warned_) return;
  periodic_warned_ = true;
  nurbs_host::warn(FLERR, lmp,
                   std::string("Fix wall/nurbs ") + id + ": the plane's normal lies along periodic" +
                       directions +
                       "; particles that leave there come back behind the plane; use boundary f");
}

void FixWallNurbs::warn_time_step() {
  if (models_) return;  // fix check/timestep/gran has the say
  double mine = 1e300, lightest = 0;
  for (int i = 0; i < atom->nlocal; ++i)
    if (atom->mask[i] & groupbit) mine = std::min(mine, atom->rmass[i]);
  MPI_Allreduce(&mine, &lightest, 1, MPI_DOUBLE, MPI_MIN, world);
  if (lightest == 1e300) return;
  const double step = nurbs::resolved_time_step(law_, lightest);
  if (update->dt <= step) return;
  const std::string warning = std::string("Fix wall/nurbs ") + id + ": time step " +
                              nurbs_host::show(update->dt) + " does not resolve its contacts; use " +
                              nurbs_host::show(step) + " or less";
  nurbs_host::warn_news(FLERR, lmp, warning, last_warning_);
}

void FixWallNurbs::setup(int vflag) {
  post_force(vflag);
  nurbs_host::warn_deep(lmp, stages_.deep(), std::string("Fix wall/nurbs ") + id,
                        "do particles reach through the wall, or is its normal reversed?",
                        last_deep_warning_);
}

void FixWallNurbs::hand_in_neighbours() {
  stages_.begin_neighbours();
  for (int i = 0; i < atom->nlocal; ++i)
    if (atom->mask[i] & groupbit) stages_.add_neighbour(-1, i, &proof(i));
  stages_.end_neighbours();
}

// The wall is A: a plane of infinite mass whose normal no particle changes.
void FixWallNurbs::post_force(int) {
  const PairGranNurbs* pair = PairGranNurbs::find(lmp);
  nurbs::ContactStages::Step step;
  step.bodies = pair != nullptr ? &bodies_->bodies() : &bodies_->update_bodies(freeze_groupbit_);
  if (neighbor->ago == 0) hand_in_neighbours();
  Vec3Map{wall_.x} = origin_;
  for (int k = 0; k < 9; k += 4) wall_.turn[k] = 1;
  wall_.radius = nurbs::kFarAway;
  step.wall = &wall_;
  step.wall_normal = normal_;
  step.owned = atom->nlocal;
  step.dt = update->dt;
  step.setup = update->setupflag != 0;
  step.ledger = ledger_;
  step.settings = settings_;
  step.laws = &law_;
  step.model = models_.get();
  stages_.compute(step);
  for (const int i : stages_.loaded()) {
    const nurbs::ContactStages::Sum sum = stages_.sum(i);
    Vec3Map(atom->f[i]) += sum.force;
    Vec3Map(atom->torque[i]) += sum.torque;
  }
}

double FixWallNurbs::compute_scalar() {
  double mine = stages_.stored().elastic(), all = 0;
  MPI_Allreduce(&mine, &all, 1, MPI_DOUBLE, MPI_SUM, world);
  return all;
}

double FixWallNurbs::compute_vector(int n) {
  const nurbs::ContactStages::Sum sum = stages_.wall_sum();
  double mine = n < 3 ? sum.force[n] : sum.torque[n - 3], all = 0;
  MPI_Allreduce(&mine, &all, 1, MPI_DOUBLE, MPI_SUM, world);
  return all;
}

void FixWallNurbs::append_rows(int rows_groupbit, std::vector<nurbs_host::ContactRow>& rows) const {
  stages_.for_each_contact([&](const nurbs::ContactView& contact) {
    const int i = contact.b;
    if (!(atom->mask[i] & groupbit) || !(atom->mask[i] & rows_groupbit)) return;
    double point[3];
    Vec3Map{point} = Vec3Map(atom->x[i]) + Eigen::Map<const Vec3>(contact.state.arm_b);
    domain->remap(point);
    rows.push_back(nurbs_host::make_row(atom->tag[i], 0, contact.state, 1, Vec3(point)));
  });
}

void FixWallNurbs::grow_arrays(int n) {
  memory->grow(proofs_, n, nurbs::kProofSize, "wall/nurbs:proofs");
}

void FixWallNurbs::copy_arrays(int from, int to, int) {
  proof(to) = proof(from);
}

void FixWallNurbs::set_arrays(int i) {
  proof(i) = nurbs::PairProof{};
}

// The proof, and behind it the contact if there is one; its number in another rank's or run's pool means only
// that it follows.
int FixWallNurbs::pack_exchange(int i, double* buffer) {
  nurbs::PairProof& own = proof(i);
  const bool touching = stages_.pool().holds(own.contact);
  if (!touching) own.contact = 0;
  std::memcpy(buffer, &own, sizeof own);
  if (!touching) return nurbs::kProofSize;
  return nurbs::kProofSize + stages_.pool().pack(own.contact, buffer + nurbs::kProofSize);
}

int FixWallNurbs::unpack_exchange(int i, double* buffer) {
  nurbs::PairProof& own = proof(i);
  std::memcpy(&own, buffer, sizeof own);
  if (own.contact == 0) return nurbs::kProofSize;
  int size = 0;
  own.contact = stages_.pool().unpack(buffer + nurbs::kProofSize, &size);
  return nurbs::kProofSize + size;
}

void FixWallNurbs::write_restart(FILE* file) {
  const nurbs::EnergyLedger& done = stages_.dissipated();
  double mine[2] = {done.damping, done.friction}, all[2] = {0, 0};
  MPI_Reduce(mine, all, 2, MPI_DOUBLE, MPI_SUM, 0, world);
  if (comm->me != 0) return;
  const int size = sizeof all;
  std::fwrite(&size, sizeof size, 1, file);
  std::fwrite(all, sizeof all, 1, file);
}

void FixWallNurbs::restart(char* buffer) {
  const double* values = reinterpret_cast<const double*>(buffer);
  nurbs::EnergyLedger& done = stages_.dissipated();
  done = nurbs::EnergyLedger{};
  if (comm->me != 0) return;
  done.damping = values[0];
  done.friction = values[1];
}

int FixWallNurbs::size_restart(int i) {
  return 1 + nurbs::kProofSize +
         (stages_.pool().holds(proof(i).contact) ? stages_.pool().packed_size(proof(i).contact) : 0);
}

int FixWallNurbs::pack_restart(int i, double* buffer) {
  buffer[0] = 1 + pack_exchange(i, buffer + 1);
  return static_cast<int>(buffer[0]);
}

void FixWallNurbs::unpack_restart(int i, int nth) {
  double* values = atom->extra[i];
  for (int k = 0; k < nth; ++k) values += static_cast<int>(*values);
  unpack_exchange(i, values + 1);
}

double FixWallNurbs::memory_usage() {
  return static_cast<double>(atom->nmax) * sizeof(nurbs::PairProof) + static_cast<double>(stages_.bytes());
}

}  // namespace LAMMPS_NS

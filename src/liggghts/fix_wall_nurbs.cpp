// See fix_wall_nurbs.h.
#include "liggghts/fix_wall_nurbs.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "atom.h"
#include "comm.h"
#include "domain.h"
#include "force.h"
#include "liggghts/host_error.h"
#include "liggghts/pair_gran_nurbs.h"
#include "memory.h"
#include "modify.h"
#include "update.h"

namespace LAMMPS_NS {

using nurbs::ContactState;
using nurbs::Vec3;
using nurbs_host::fail_all;
using nurbs_host::kHistorySize;
using nurbs_host::memory_of;
using nurbs_host::state_of;
using Vec3Map = Eigen::Map<Vec3>;

namespace {

constexpr int kPlaneArguments = 7;  // plane PX PY PZ NX NY NZ

}  // namespace

FixWallNurbs::FixWallNurbs(LAMMPS* lmp, int narg, char** arg) : Fix(lmp, narg, arg) {
  AtomVecNurbs::require(lmp, "Fix wall/nurbs");
  parse_plane(narg, arg);
  law_ = nurbs_host::parse_coefficients(lmp, "Fix wall/nurbs", 3 + kPlaneArguments, narg, arg);

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
  memory->destroy(history_);
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
  comm->maxexchange_fix = std::max(comm->maxexchange_fix, walls * kHistorySize);
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
  deep_.warn(lmp, std::string("Fix wall/nurbs ") + id,
             "do particles reach through the wall, or is its normal reversed?", last_deep_warning_);
}

void FixWallNurbs::post_force(int) {
  step_.setup = update->setupflag != 0;
  step_.dt = update->dt;
  stored_ = nurbs::EnergyLedger{};
  counts_ = nurbs_host::ContactCounts{};
  force_ = torque_ = Vec3::Zero();
  for (int i = 0; i < atom->nlocal; ++i)
    if (atom->mask[i] & groupbit) compute_particle(i);
}

// As PairGranNurbs::compute_pair; here A is the wall.
void FixWallNurbs::compute_particle(int i) {
  const Vec3 separation = Vec3Map(atom->x[i]) - origin_;
  const double height = normal_.dot(separation);
  ContactState& state = state_of(history_[i]);
  nurbs::ContactResult result;
  result.status = nurbs::Status::separated;
  if (height > atom->radius[i]) {
    if (state.active == 0) return;
  } else {
    double scratch[nurbs::kPairMemorySize], *memory = memory_of(history_[i]);
    if (step_.setup) {
      std::copy_n(memory, nurbs::kPairMemorySize, scratch);
      memory = scratch;
    }
    result = find_plane_contact(bodies_->particle(i), origin_, normal_, settings_, memory);
    counts_.add(result, 1);
    if (step_.setup) deep_.add(result, atom->radius[i], 1);
    if (!nurbs_host::touches(result) && state.active == 0) return;
  }
  step_.same = 10 * settings_.tolerance * atom->radius[i] + 1e-13 * (separation.norm() + origin_.norm());
  if (step_contact(law_, result, nurbs::wall_geometry(result, separation), nurbs::BodyMotion{},
                   nurbs_host::motion_of(*bodies_, *atom, i, update->dt, freeze_groupbit_), step_, state, 1,
                   dissipated_, counts_))
    apply(i, state);
}

void FixWallNurbs::apply(int i, const ContactState& state) {
  const Vec3 force = force_on_b(state);
  Vec3Map(atom->f[i]) += force;
  Vec3Map(atom->torque[i]) += Eigen::Map<const Vec3>(state.arm_b).cross(force);
  force_ -= force;
  torque_ -= Eigen::Map<const Vec3>(state.arm_a).cross(force);
  stored_.add(stored_energy(law_, state), 1);
}

double FixWallNurbs::compute_scalar() {
  double mine = stored_.elastic(), all = 0;
  MPI_Allreduce(&mine, &all, 1, MPI_DOUBLE, MPI_SUM, world);
  return all;
}

double FixWallNurbs::compute_vector(int n) {
  double mine = n < 3 ? force_[n] : torque_[n - 3], all = 0;
  MPI_Allreduce(&mine, &all, 1, MPI_DOUBLE, MPI_SUM, world);
  return all;
}

void FixWallNurbs::append_rows(int rows_groupbit, std::vector<nurbs_host::ContactRow>& rows) const {
  for (int i = 0; i < atom->nlocal; ++i) {
    const ContactState& state = state_of(history_[i]);
    if (state.active == 0 || !(atom->mask[i] & groupbit) || !(atom->mask[i] & rows_groupbit)) continue;
    double point[3];
    Vec3Map{point} = Vec3Map(atom->x[i]) + Eigen::Map<const Vec3>(state.arm_b);
    domain->remap(point);
    rows.push_back(nurbs_host::make_row(atom->tag[i], 0, state, 1, Vec3(point)));
  }
}

void FixWallNurbs::grow_arrays(int n) {
  memory->grow(history_, n, kHistorySize, "wall/nurbs:history");
}

void FixWallNurbs::copy_arrays(int from, int to, int) {
  std::copy_n(history_[from], kHistorySize, history_[to]);
}

void FixWallNurbs::set_arrays(int i) {
  std::fill_n(history_[i], kHistorySize, 0.0);
}

int FixWallNurbs::pack_exchange(int i, double* buffer) {
  std::copy_n(history_[i], kHistorySize, buffer);
  return kHistorySize;
}

int FixWallNurbs::unpack_exchange(int i, double* buffer) {
  std::copy_n(buffer, kHistorySize, history_[i]);
  return kHistorySize;
}

void FixWallNurbs::write_restart(FILE* file) {
  double mine[2] = {dissipated_.damping, dissipated_.friction}, all[2] = {0, 0};
  MPI_Reduce(mine, all, 2, MPI_DOUBLE, MPI_SUM, 0, world);
  if (comm->me != 0) return;
  const int size = sizeof all;
  std::fwrite(&size, sizeof size, 1, file);
  std::fwrite(all, sizeof all, 1, file);
}

void FixWallNurbs::restart(char* buffer) {
  const double* values = reinterpret_cast<const double*>(buffer);
  dissipated_ = nurbs::EnergyLedger{};
  if (comm->me != 0) return;
  dissipated_.damping = values[0];
  dissipated_.friction = values[1];
}

int FixWallNurbs::pack_restart(int i, double* buffer) {
  buffer[0] = kHistorySize + 1;
  std::copy_n(history_[i], kHistorySize, buffer + 1);
  return kHistorySize + 1;
}

void FixWallNurbs::unpack_restart(int i, int nth) {
  const double* values = atom->extra[i];
  for (int k = 0; k < nth; ++k) values += static_cast<int>(*values);
  std::copy_n(values + 1, kHistorySize, history_[i]);
}

double FixWallNurbs::memory_usage() {
  return static_cast<double>(atom->nmax) * kHistorySize * sizeof(double);
}

}  // namespace LAMMPS_NS

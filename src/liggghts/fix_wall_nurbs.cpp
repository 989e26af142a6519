// See fix_wall_nurbs.h.
#include "liggghts/fix_wall_nurbs.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <set>

#include "atom.h"
#include "comm.h"
#include "domain.h"
#include "fix_mesh_surface.h"
#include "fix_neighlist_mesh.h"
#include "force.h"
#include "liggghts/host_error.h"
#include "liggghts/pair_gran_nurbs.h"
#include "memory.h"
#include "mesh_module_stress.h"
#include "modify.h"
#include "neighbor.h"
#include "update.h"

namespace LAMMPS_NS {

using nurbs::Vec3;
using nurbs_host::fail_all;
using nurbs_host::name_of;
using Vec3Map = Eigen::Map<Vec3>;

namespace {

constexpr int kPlaneArguments = 7;     // plane PX PY PZ NX NY NZ
constexpr int kCylinderArguments = 5;  // cylinder x|y|z RADIUS C1 C2
constexpr double kListFormat = 3;      // of restarts: counts on where ContactStages::pack_list changes

bool begins_law(const char* word) {
  for (const char* first : {"kn", "kt", "cn", "ct", "mu", "type", "model", "radius", "move"})
    if (std::strcmp(word, first) == 0) return true;
  return false;
}

}  // namespace

FixWallNurbs::FixWallNurbs(LAMMPS* lmp, int narg, char** arg) : Fix(lmp, narg, arg) {
  AtomVecNurbs::require(lmp, "Fix wall/nurbs");
  const std::string kind = narg < 4 ? "" : arg[3];
  if (kind != "plane" && kind != "cylinder" && kind != "mesh")
    fail_all(FLERR, lmp,
             "Fix wall/nurbs: kind of wall " + (kind.empty() ? "is missing;" : kind) +
                 " must be plane, cylinder or mesh" +
                 (kind == "primitive"
                      ? "; for primitive type T zplane C write plane 0 0 C 0 0 1 type T, for "
                        "zcylinder R C1 C2 write cylinder z R C1 C2 type T, for ycylinder R C1 C2 cylinder y "
                        "R C2 C1 type T"
                      : ""));
  const int first = kind == "plane"      ? parse_plane(narg, arg)
                    : kind == "cylinder" ? parse_cylinder(narg, arg)
                                         : parse_mesh(narg, arg);
  narg = parse_motion(narg, arg);
  parse_law(first, narg, arg);
  surface_ = nurbs::SurfaceWall(kind_);
  // The host deletes a fix whose ID is given again, and leaves its place empty for the new one.
  if (update->ntimestep > 0 && std::count(modify->fix, modify->fix + modify->nfix, nullptr) > 0)
    nurbs_host::warn(FLERR, lmp,
                     name_of(*this) +
                         ": a wall of this ID was there; all its contacts begin anew, without their friction "
                         "springs");

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

int FixWallNurbs::parse_plane(int narg, char** arg) {
  if (narg < 3 + kPlaneArguments) fail_all(FLERR, lmp, "Fix wall/nurbs plane needs PX PY PZ NX NY NZ");
  Vec3 normal;
  for (int k = 0; k < 3; ++k) {
    origin_[k] = nurbs_host::parse_number(lmp, "Fix wall/nurbs plane: point", arg[4 + k]);
    normal[k] = nurbs_host::parse_number(lmp, "Fix wall/nurbs plane: normal", arg[7 + k]);
  }
  const double length = normal.stableNorm();
  if (!(length > 0)) fail_all(FLERR, lmp, "Fix wall/nurbs plane: normal = 0 0 0 must have a length > 0");
  normal_ = normal / length;
  return 3 + kPlaneArguments;
}

int FixWallNurbs::parse_cylinder(int narg, char** arg) {
  kind_ = Kind::cylinder;
  if (narg < 3 + kCylinderArguments) fail_all(FLERR, lmp, "Fix wall/nurbs cylinder needs x|y|z RADIUS C1 C2");
  const int axis = arg[4][0] - 'x';
  if (std::strlen(arg[4]) != 1 || axis < 0 || axis > 2)
    fail_all(FLERR, lmp, std::string("Fix wall/nurbs cylinder: axis ") + arg[4] + " must be x, y or z");
  radius_ = nurbs_host::parse_positive(lmp, "Fix wall/nurbs cylinder: radius", arg[5]);
  normal_ = Vec3::Unit(axis);
  origin_ = Vec3::Zero();
  origin_[axis == 0 ? 1 : 0] = nurbs_host::parse_number(lmp, "Fix wall/nurbs cylinder: C1", arg[6]);
  origin_[axis == 2 ? 1 : 2] = nurbs_host::parse_number(lmp, "Fix wall/nurbs cylinder: C2", arg[7]);
  return 3 + kCylinderArguments;
}

int FixWallNurbs::parse_mesh(int narg, char** arg) {
  kind_ = Kind::mesh;
  int k = 4;
  for (; k < narg && !begins_law(arg[k]); ++k) {
    const std::string name = arg[k];
    Fix* fix = modify->find_fix_id(arg[k]);
    if (fix == nullptr)
      fail_all(FLERR, lmp,
               "Fix wall/nurbs mesh: there is no fix " + name +
                   (name == "n_meshes" || name == "meshes" ? "; for mesh n_meshes 1 meshes ID write mesh ID"
                                                           : ""));
    if (dynamic_cast<FixMeshSurface*>(fix) == nullptr)
      fail_all(FLERR, lmp,
               "Fix wall/nurbs mesh: fix " + name + " is a " + fix->style + "; it must be a mesh/surface");
    for (const Mesh& mesh : meshes_)
      if (mesh.id == name) fail_all(FLERR, lmp, "Fix wall/nurbs mesh: fix " + name + " is there twice");
    meshes_.push_back({name, nullptr, nullptr, false, {}, {}});
  }
  if (meshes_.empty()) fail_all(FLERR, lmp, "Fix wall/nurbs mesh needs the ID of a fix mesh/surface");
  if (meshes_.size() > nurbs::SurfaceWall::kMostMeshes)
    fail_all(FLERR, lmp,
             "Fix wall/nurbs mesh: " + std::to_string(meshes_.size()) + " meshes; at most " +
                 std::to_string(nurbs::SurfaceWall::kMostMeshes) + " are possible in one wall");
  return k;
}

// Reads `move` and its words, and puts them behind all others; how many these are.
int FixWallNurbs::parse_motion(int narg, char** arg) {
  for (int k = 3; k < narg; ++k) {
    if (kind_ != Kind::mesh && std::strcmp(arg[k], "shear") == 0)
      fail_all(FLERR, lmp,
               "Fix wall/nurbs: for shear write move linear VX VY VZ, along a wall that stays where it is");
    if (std::strcmp(arg[k], "move") != 0) continue;
    if (kind_ == Kind::mesh)
      fail_all(FLERR, lmp,
               "Fix wall/nurbs mesh: move is for planes and cylinders; meshes have fix move/mesh");
    const int taken = motion_.parse(lmp, "Fix wall/nurbs", narg - k - 1, arg + k + 1);
    std::rotate(arg + k, arg + k + 1 + taken, arg + narg);
    return parse_motion(narg - 1 - taken, arg);
  }
  return narg;
}

void FixWallNurbs::parse_law(int first, int narg, char** arg) {
  if (narg <= first || std::strcmp(arg[first], "type") != 0) {
    if (nurbs_host::HostModels::named_by(narg - first, arg + first))
      fail_all(FLERR, lmp,
               std::string("Fix wall/nurbs: type T, the wall's atom type, must stand before ") + arg[first]);
    if (narg <= first)
      fail_all(
          FLERR, lmp,
          "Fix wall/nurbs needs a law behind the wall: kn KN kt KT [cn CN] [ct CT] mu MU, or type T model "
          "NORMAL ..");
    law_ = nurbs_host::parse_coefficients(lmp, "Fix wall/nurbs", first, narg, arg);
    return;
  }
  wall_type_ =
      nurbs_host::parse_atom_type(lmp, "Fix wall/nurbs: type", narg > first + 1 ? arg[first + 1] : "");
  models_ = std::make_unique<nurbs_host::HostModels>(lmp, "Fix wall/nurbs", wall_type_, narg - first - 2,
                                                     arg + first + 2);
  stages_.pool().set_memory_size(nurbs::kModelMemory + models_->history_size());
}

std::vector<FixWallNurbs*> FixWallNurbs::all(LAMMPS* lmp) {
  std::vector<FixWallNurbs*> walls;
  for (int k = 0; k < lmp->modify->nfix; ++k)
    if (auto* wall = dynamic_cast<FixWallNurbs*>(lmp->modify->fix[k])) walls.push_back(wall);
  return walls;
}

// Lists of the particles near the meshes' triangles, made by the host.
void FixWallNurbs::post_create() {
  for (Mesh& mesh : meshes_) {
    mesh.fix = dynamic_cast<FixMeshSurface*>(modify->find_fix_id(mesh.id.c_str()));
    mesh.list = mesh.fix->createOtherNeighList(igroup, id);
    serve(mesh);
  }
}

void FixWallNurbs::pre_delete(bool unfixflag) {
  if (!unfixflag) return;
  for (Mesh& mesh : meshes_)
    if (auto* fix = dynamic_cast<FixMeshSurface*>(modify->find_fix_id(mesh.id.c_str()))) {
      fix->deleteOtherNeighList(id);
      if (!mesh.serves) continue;
      fix->deleteWallNeighList();
      for (FixWallNurbs* wall : all(lmp))
        for (Mesh& other : wall->meshes_)
          if (wall != this && other.id == mesh.id) wall->serve(other);
    }
}

// A servo stops the run unless its mesh has the list of a fix wall/gran, which it asks whether anything is
// near. The wall that made it takes it away: the host can't bear that a fix goes that stands before the one
// unfixed.
void FixWallNurbs::serve(Mesh& mesh) {
  if (std::strcmp(mesh.fix->style, "mesh/surface/stress/servo") != 0 || mesh.fix->hasNeighList()) return;
  mesh.fix->createWallNeighList(igroup);
  mesh.serves = true;
}

int FixWallNurbs::setmask() {
  int mask = FixConst::POST_FORCE | FixConst::THERMO_ENERGY | FixConst::PRE_EXCHANGE;
  if (motion_.moves()) mask |= FixConst::INITIAL_INTEGRATE;
  if (!meshes_.empty()) mask |= FixConst::PRE_FORCE;
  return mask;
}

void FixWallNurbs::init() {
  bodies_ = AtomVecNurbs::require(lmp, "Fix wall/nurbs");
  if (const PairGranNurbs* pair = PairGranNurbs::find(lmp)) {
    settings_ = pair->contact_settings();
    warn_models(*pair);
  }
  freeze_groupbit_ = 0;
  for (int k = 0; k < modify->nfix; ++k)
    if (std::strcmp(modify->fix[k]->style, "freeze") == 0) freeze_groupbit_ = modify->fix[k]->groupbit;
  for (Mesh& mesh : meshes_) {
    mesh.fix = dynamic_cast<FixMeshSurface*>(modify->find_fix_id(mesh.id.c_str()));
    if (mesh.fix == nullptr)
      fail_all(FLERR, lmp,
               name_of(*this) + ": its fix mesh/surface " + mesh.id + " is gone; unfix the wall first");
    // The host makes a fix of the same ID in the place of the one before, whose lists go with it.
    if (modify->find_fix_id(("neighlist_" + std::string(id) + "_" + mesh.id).c_str()) != mesh.list)
      fail_all(FLERR, lmp,
               name_of(*this) + ": its fix mesh/surface " + mesh.id +
                   " was made anew; unfix the wall before, and repeat its line behind the mesh's");
  }
  surface_.count_by_triangle(std::any_of(meshes_.begin(), meshes_.end(), [](const Mesh& mesh) {
    return mesh.fix->get_module("stress") != nullptr;
  }));
  if (!meshes_.empty() && neighbor->style != 1)
    fail_all(FLERR, lmp, "Fix wall/nurbs mesh needs neighbor SKIN bin");
  ledger_ = nurbs_host::wants_ledger(lmp);
  if (models_) models_->init();
  warn_periodic();
  warn_mesh_types();
  warn_time_step();
}

// The host's walls go without it silently, too; `off` says that it is meant.
void FixWallNurbs::warn_models(const PairGranNurbs& pair) {
  if (models_ == nullptr || pair.models() == nullptr) return;
  std::string missing;
  for (const char* kind : {"tangential", "cohesion", "rolling_friction"}) {
    const std::string pairs = pair.models()->named(kind);
    if (!pairs.empty() && pairs != "off" && models_->named(kind).empty())
      missing += (missing.empty() ? "" : " and ") + std::string(kind) + " " + pairs;
  }
  if (missing.empty()) return;
  nurbs_host::warn_news(FLERR, lmp,
                        name_of(*this) + " has no " + missing +
                            ", which pair_style gran/nurbs has; say it behind the wall's model too, or off",
                        last_model_warning_);
}

void FixWallNurbs::warn_periodic() {
  if (kind_ != Kind::plane) return;
  std::string directions;
  for (int k = 0; k < 3; ++k) {
    const Vec3 edge = nurbs_host::box_edge(*domain, k);
    if (domain->periodicity[k] && std::abs(normal_.dot(edge)) > 1e-9 * edge.norm())
      directions += std::string(" ") + "xyz"[k];
  }
  if (directions.empty() || periodic_warned_) return;
  periodic_warned_ = true;
  nurbs_host::warn(FLERR, lmp,
                   name_of(*this) + ": the plane's normal lies along periodic" + directions +
                       "; particles that leave there come back behind the plane; use boundary f");
}

// In the host's own walls the mesh's type is the material.
void FixWallNurbs::warn_mesh_types() {
  if (!models_ || types_warned_) return;
  for (const Mesh& mesh : meshes_) {
    const int own = mesh.fix->atomTypeWall();
    if (own == wall_type_) continue;
    types_warned_ = true;
    nurbs_host::warn(FLERR, lmp,
                     name_of(*this) + ": fix " + mesh.id + " has type " + std::to_string(own) +
                         ", but this wall's type " + std::to_string(wall_type_) +
                         " is its material; give meshes of another material a wall of their own");
  }
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
  const std::string warning = name_of(*this) + ": time step " + nurbs_host::show(update->dt) +
                              " does not resolve its contacts; use " + nurbs_host::show(step) + " or less";
  nurbs_host::warn_news(FLERR, lmp, warning, last_warning_);
}

void FixWallNurbs::setup(int vflag) {
  checked_particles_ = atom->natoms;
  post_force(vflag);
  if (all(lmp).back() == this) sum_mesh_forces();
  warn_deep(stages_.deep(), "at the start of the run");
  last_tag_ = atom->tag_max();
}

void FixWallNurbs::warn_deep(const nurbs::DeepContacts& contacts, const char* when) {
  nurbs_host::warn_deep(lmp, contacts, name_of(*this), when,
                        "do particles reach through the wall, or is its normal reversed?",
                        last_deep_warning_);
}

// The most in one step of the run.
void FixWallNurbs::warn_left_out() {
  int most = 0;
  MPI_Allreduce(&most_overflows_, &most, 1, MPI_INT, MPI_MAX, world);
  most_overflows_ = 0;
  if (most == 0) return;
  nurbs_host::warn(FLERR, lmp,
                   name_of(*this) + ": " + std::to_string(most) + " particle(s) touched more than " +
                       std::to_string(nurbs::kSurfaceContacts) +
                       " pieces of the mesh at once; the others were left out, so that forces are too small. "
                       "Use a coarser mesh");
}

void FixWallNurbs::post_run() {
  nurbs_host::warn_deep_run(lmp, stages_.deep_in_run(), name_of(*this));
  warn_left_out();
}

void FixWallNurbs::hand_in_neighbours() {
  stages_.begin_neighbours();
  for (int i = 0; i < atom->nlocal; ++i)
    if (atom->mask[i] & groupbit) stages_.add_neighbour(-1, i, &proof(i));
  stages_.end_neighbours();
}

void FixWallNurbs::initial_integrate(int) {
  time_ += update->dt;
}

int FixWallNurbs::contacts_size(int i) const {
  const std::int32_t contact = proof(i).contact;
  if (listed()) return stages_.list_size(contact);
  return nurbs::kProofSize + (stages_.pool().holds(contact) ? stages_.pool().packed_size(contact) : 0);
}

int FixWallNurbs::most_exchanged() {
  int most = nurbs::kProofSize;
  for (int i = 0; i < atom->nlocal; ++i) most = std::max(most, contacts_size(i));
  return most;
}

// The host takes the largest of what its fixes ask for, but a particle sends all of theirs.
void FixWallNurbs::pre_exchange() {
  int most = 0;
  for (FixWallNurbs* wall : all(lmp)) most += wall->most_exchanged();
  comm->maxexchange_fix = std::max(comm->maxexchange_fix, most);
}

int FixWallNurbs::maxsize_restart() {
  int mine = most_exchanged(), most = 0;
  MPI_Allreduce(&mine, &most, 1, MPI_INT, MPI_MAX, world);
  return 1 + most;
}

// --- walls whose contacts are lists by particle

// The total force on a mesh starts anew at every step, but the host forgets to do so before a run.
void FixWallNurbs::setup_pre_force(int) {
  for (Mesh& mesh : meshes_)
    if (auto* stress = dynamic_cast<MeshModuleStress*>(mesh.fix->get_module("stress"))) stress->pre_force(0);
}

// The host sums them over triangles and ranks at the end of a step, and has none yet when a run begins. What
// would be wear then is none: no time has passed.
void FixWallNurbs::sum_mesh_forces() {
  std::set<FixMeshSurface*> summed;
  for (FixWallNurbs* wall : all(lmp))
    for (Mesh& mesh : wall->meshes_) {
      auto* stress = dynamic_cast<MeshModuleStress*>(mesh.fix->get_module("stress"));
      if (stress == nullptr || !summed.insert(mesh.fix).second) continue;
      if (auto* wear = mesh.fix->triMesh()->prop().getElementProperty<ScalarContainer<double> >("wear_step"))
        wear->setAll(0.);
      if (stress->trackStress()) mesh.fix->triMesh()->reverseComm(std::string("f"));
      stress->final_integrate();
    }
}

// Brings the copies of the meshes' nodes up to date; returns a way that no node has exceeded since the last
// call, or 0 where the triangles are others than then.
double FixWallNurbs::read_meshes(bool others) {
  double moved2 = 0;
  triangles_.resize(meshes_.size());
  for (std::size_t m = 0; m < meshes_.size(); ++m) {
    TriMesh* mesh = meshes_[m].fix->triMesh();
    nurbs::TriangleArray& t = triangles_[m];
    t.count = mesh->sizeLocal() + mesh->sizeGhost();
    std::vector<double>& nodes = meshes_[m].nodes;
    const bool same = !others && nodes.size() == 9 * static_cast<std::size_t>(t.count);
    if (!same || mesh->isMoving() || mesh->isDeforming()) {
      nodes.resize(9 * static_cast<std::size_t>(t.count));
      for (int k = 0; k < 3 * t.count; ++k) {
        double x[3];
        mesh->node(k / 3, k % 3, x);
        Vec3Map at(nodes.data() + 3 * k);
        if (same) moved2 = std::max(moved2, (Vec3Map(x) - at).squaredNorm());
        at = Vec3Map(x);
      }
    }
    t.nodes = nodes.data();
    auto* velocity = mesh->prop().getElementProperty<MultiVectorContainer<double, 3, 3> >("v");
    t.velocity = velocity != nullptr && t.count > 0 ? &velocity->begin()[0][0][0] : nullptr;
    t.id = meshes_[m].ids.data();
  }
  return std::sqrt(moved2);
}

// Triangles without area have no plane; the first one, by number, ends the run.
void FixWallNurbs::check_meshes() {
  meshes_checked_ = true;
  for (std::size_t m = 0; m < meshes_.size(); ++m) {
    int mine = std::numeric_limits<int>::max(), first = 0;
    for (int t = 0; t < triangles_[m].count; ++t) {
      const double* x = triangles_[m].nodes + 9 * t;
      const Vec3 a = Vec3::Map(x), b = Vec3::Map(x + 3), c = Vec3::Map(x + 6);
      const double longest2 = std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
      if (!((b - a).cross(c - a).norm() > 1e-12 * longest2)) mine = std::min(mine, meshes_[m].ids[t]);
    }
    MPI_Allreduce(&mine, &first, 1, MPI_INT, MPI_MIN, world);
    if (first != std::numeric_limits<int>::max())
      fail_all(FLERR, lmp,
               name_of(*this) + ": triangle " + std::to_string(first + 1) + " of mesh " + meshes_[m].id +
                   " has no area");
  }
}

// The contacts' lists follow the particles; near are those that the host's lists have, or all.
void FixWallNurbs::hand_in_surface() {
  const int nlocal = atom->nlocal;
  stages_.begin_lists();
  for (int i = 0; i < nlocal; ++i) {
    if (atom->mask[i] & groupbit)
      stages_.keep_list(i, proof(i).contact);
    else
      proof(i).contact = 0;
  }
  stages_.end_lists();
  surface_.begin_near(nlocal);
  if (kind_ != Kind::mesh)
    for (int i = 0; i < nlocal; ++i)
      if (atom->mask[i] & groupbit) surface_.add_near(i, 0, 0);
  for (std::size_t m = 0; m < meshes_.size(); ++m) {
    Mesh& mesh = meshes_[m];
    TriMesh* tri_mesh = mesh.fix->triMesh();
    mesh.ids.resize(triangles_[m].count);
    for (int t = 0; t < triangles_[m].count; ++t) {
      mesh.ids[t] = tri_mesh->id(t);
      for (const int i : mesh.list->get_contact_list(t))
        if (i < nlocal && (atom->mask[i] & groupbit)) surface_.add_near(i, static_cast<int>(m), t);
    }
    triangles_[m].id = mesh.ids.data();
  }
  if (!meshes_checked_) check_meshes();
  surface_.end_near(triangles_);
}

void FixWallNurbs::compute_surface(nurbs::ContactStages::Step& step) {
  double moved = 0;
  if (kind_ == Kind::mesh) {
    moved = read_meshes(neighbor->ago == 0);
  } else {
    const double half = 0.5 * (domain->boxhi[0] - domain->boxlo[0] + domain->boxhi[1] - domain->boxlo[1] +
                               domain->boxhi[2] - domain->boxlo[2]);
    const Vec3 middle = 0.5 * (Vec3Map(domain->boxlo) + Vec3Map(domain->boxhi));
    moved = motion_.way(middle, half, last_time_, time_);
    last_time_ = time_;
    // The law's velocities are those half a step ago.
    surface_.place(motion_.point(origin_, time_), motion_.direction(normal_, time_), radius_,
                   motion_.velocity(step.setup ? time_ : time_ - 0.5 * step.dt));
  }
  if (neighbor->ago == 0) hand_in_surface();
  if (kind_ == Kind::cylinder)
    step.cylinder = {motion_.point(origin_, time_), motion_.direction(normal_, time_), radius_};
  stages_.begin_step(step);
  surface_.find(step, triangles_, moved, reinterpret_cast<nurbs::PairProof*>(proofs_[0]), &stages_);
  stages_.end_step(surface_.neighbours());
  most_overflows_ = std::max(most_overflows_, surface_.overflows());
  if (kind_ == Kind::mesh) tell_meshes();
}

// What the meshes count: forces, wear.
void FixWallNurbs::tell_meshes() {
  stages_.for_each_contact([&](const nurbs::ContactView& contact) {
    const int mark = stages_.mark(contact.a);
    double force[3], arm[3], velocity[3];
    Vec3Map{force} = force_on_b(contact.state);
    Vec3Map{arm} = Eigen::Map<const Vec3>(contact.state.arm_b);
    Vec3Map{velocity} = stages_.wall_velocity(contact);
    meshes_[surface_.mesh_of(mark)].fix->add_particle_contribution(contact.b, force, arm,
                                                                   surface_.triangle_of(mark), velocity);
  });
}

// The wall is A: a plane of infinite mass whose normal no particle changes.
void FixWallNurbs::post_force(int) {
  const PairGranNurbs* pair = PairGranNurbs::find(lmp);
  nurbs::ContactStages::Step step;
  const bool first = pair == nullptr && all(lmp).front() == this;
  step.bodies = first ? &bodies_->update_bodies(freeze_groupbit_) : &bodies_->bodies();
  step.owned = atom->nlocal;
  step.dt = update->dt;
  step.setup = update->setupflag != 0;
  step.changed = pair != nullptr && pair->changed();
  step.ledger = ledger_;
  for (int k = 0; k < 3; ++k)
    if (domain->periodicity[k]) step.period[k] = nurbs_host::box_edge(*domain, k);
  step.settings = settings_;
  const bool inserted = neighbor->ago == 0 && atom->natoms > checked_particles_;
  if (inserted) step.tags = atom->tag;
  step.last_tag = last_tag_;
  step.laws = &law_;
  step.model = models_.get();
  if (listed()) {
    compute_surface(step);
  } else {
    if (neighbor->ago == 0) hand_in_neighbours();
    Vec3Map{wall_.x} = origin_;
    for (int k = 0; k < 9; k += 4) wall_.turn[k] = 1;
    wall_.radius = wall_.inner = nurbs::kFarAway;
    step.wall = &wall_;
    step.wall_normal = normal_;
    stages_.compute(step);
  }
  if (inserted) {
    checked_particles_ = atom->natoms;
    warn_deep(stages_.deep_inserted(), "particles just inserted have");
    last_tag_ = atom->tag_max();
  }
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
  nurbs::ContactStages::Sum sum = stages_.wall_sum();
  if (listed() && kind_ != Kind::mesh)  // their sums are about the lab's origin
    sum.torque -= motion_.point(origin_, time_).cross(sum.force);
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
  if (listed()) return stages_.pack_list(proof(i).contact, buffer);
  nurbs::PairProof& own = proof(i);
  const bool touching = stages_.pool().holds(own.contact);
  if (!touching) own.contact = 0;
  std::memcpy(buffer, &own, sizeof own);
  if (!touching) return nurbs::kProofSize;
  return nurbs::kProofSize + stages_.pool().pack(own.contact, buffer + nurbs::kProofSize);
}

int FixWallNurbs::unpack_exchange(int i, double* buffer) {
  nurbs::PairProof& own = proof(i);
  if (listed()) {
    int taken = 0;
    own = nurbs::PairProof{};
    own.contact = stages_.unpack_list(buffer, &taken);
    return taken;
  }
  std::memcpy(&own, buffer, sizeof own);
  if (own.contact == 0) return nurbs::kProofSize;
  int size = 0;
  own.contact = stages_.pool().unpack(buffer + nurbs::kProofSize, &size);
  return nurbs::kProofSize + size;
}

// What a restart holds of a wall.
struct FixWallNurbs::Kept {
  double damping, friction;  // dissipated
  double time;               // of the motion
  double format, kind;       // of the contacts: 0 one a body, else of lists (ContactStages::pack_list)
  double point[3], normal[3], radius;  // of a plane or cylinder: where it was
};

void FixWallNurbs::write_restart(FILE* file) {
  const nurbs::EnergyLedger& done = stages_.dissipated();
  double mine[2] = {done.damping, done.friction}, all[2] = {0, 0};
  MPI_Reduce(mine, all, 2, MPI_DOUBLE, MPI_SUM, 0, world);
  if (comm->me != 0) return;
  Kept kept = {all[0], all[1], time_,  listed() ? kListFormat : 0.0, static_cast<double>(kind_),
               {},     {},     radius_};
  Vec3Map{kept.point} = motion_.point(origin_, time_);
  Vec3Map{kept.normal} = motion_.direction(normal_, time_);
  const int size = sizeof kept;
  std::fwrite(&size, sizeof size, 1, file);
  std::fwrite(&kept, sizeof kept, 1, file);
}

// How far this plane or cylinder is, somewhere in the box, from where it was: the difference is linear in
// place.
double FixWallNurbs::way_since(const Kept& kept) const {
  const Vec3 old_point = Vec3::Map(kept.point), old_normal = Vec3::Map(kept.normal);
  const Vec3 point = motion_.point(origin_, time_), normal = motion_.direction(normal_, time_);
  double most = 0;
  for (int corner = 0; corner < 8; ++corner) {
    Vec3 x;
    for (int k = 0; k < 3; ++k) x[k] = corner >> k & 1 ? domain->boxhi[k] : domain->boxlo[k];
    if (kind_ == Kind::plane) {
      most = std::max(most, std::abs(normal.dot(x - point) - old_normal.dot(x - old_point)));
      continue;
    }
    const auto foot = [&](const Vec3& p, const Vec3& n) -> Vec3 { return p + n.dot(x - p) * n; };
    most = std::max(
        most, (foot(point, normal) - foot(old_point, old_normal)).norm() + std::abs(radius_ - kept.radius));
  }
  return most;
}

void FixWallNurbs::restart(char* buffer) {
  Kept kept;
  std::memcpy(&kept, buffer, sizeof kept);
  nurbs::EnergyLedger& done = stages_.dissipated();
  done = nurbs::EnergyLedger{};
  time_ = last_time_ = kept.time;
  was_another_kind_ = kept.format != (listed() ? kListFormat : 0);
  if (was_another_kind_)
    nurbs_host::warn(
        FLERR, lmp,
        name_of(*this) +
            ": in the restart, the wall of this ID was of another kind (a plane at rest, or a moving "
            "plane, cylinder or mesh), or written by another version; its contacts begin anew");
  if (kind_ != Kind::mesh && static_cast<double>(kind_) == kept.kind) {
    const Vec3 edges = Vec3Map(domain->boxhi) - Vec3Map(domain->boxlo);
    const double way = way_since(kept);
    if (way > 1e-9 * edges.norm())
      nurbs_host::warn(FLERR, lmp,
                       name_of(*this) + ": the wall is " + nurbs_host::show(way) +
                           " from where it was in the restart; repeat the line it had, 'move ..' included");
  }
  if (comm->me != 0) return;
  done.damping = kept.damping;
  done.friction = kept.friction;
}

int FixWallNurbs::size_restart(int i) {
  return 1 + contacts_size(i);
}

int FixWallNurbs::pack_restart(int i, double* buffer) {
  buffer[0] = 1 + pack_exchange(i, buffer + 1);
  return static_cast<int>(buffer[0]);
}

void FixWallNurbs::unpack_restart(int i, int nth) {
  double* values = atom->extra[i];
  if (was_another_kind_) {  // what is remembered is none of this wall's
    proof(i) = nurbs::PairProof{};
    return;
  }
  for (int k = 0; k < nth; ++k) values += static_cast<int>(*values);
  unpack_exchange(i, values + 1);
}

double FixWallNurbs::memory_usage() {
  return static_cast<double>(atom->nmax) * sizeof(nurbs::PairProof) +
         static_cast<double>(stages_.bytes() + surface_.bytes());
}

}  // namespace LAMMPS_NS

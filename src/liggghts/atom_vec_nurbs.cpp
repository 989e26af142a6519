// atom_style nurbs. See atom_vec_nurbs.h; data files are told in examples/README.md.
#include "liggghts/atom_vec_nurbs.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <vector>

#include "atom.h"
#include "comm.h"
#include "domain.h"
#include "error.h"
#include "fix.h"
#include "lammps.h"
#include "liggghts/host_error.h"
#include "liggghts/host_rules.h"
#include "memory.h"
#include "modify.h"
#include "neighbor.h"
#include "update.h"

namespace LAMMPS_NS {

using nurbs::Quat;
using nurbs::RotationScheme;
using nurbs::RotorBatch;
using nurbs::Vec3;

namespace {

constexpr int kGrowth = 10000;  // particles added to the arrays at a time, as in the host

// Doubles per particle in the messages of the style (the host sizes its buffers by them).
constexpr int kPosition = 3, kOrientation = 4, kVelocity = 6, kForce = 6;
constexpr int kIds = 3;   // tag, type, mask
constexpr int kBody = 5;  // shape number, scale, density, radius, mass
constexpr int kMomentum = 3;
constexpr int kState =
    1 + kPosition + kIds + 1 + kOrientation + kVelocity + kMomentum + kBody;  // count first; ids and image

// 2 ulp: a quaternion this close to a unit one was normalised before, and is kept bit for bit.
constexpr double kUnitTolerance = 8 * std::numeric_limits<double>::epsilon();

Quat to_quat(const double* q) {
  return Quat(q[0], q[1], q[2], q[3]);
}

Quat normalised(const Quat& q) {
  const double length2 = q.squaredNorm();
  if (std::abs(length2 - 1) <= kUnitTolerance) return q;
  if (std::isnormal(length2)) return q.normalized();
  return Quat(q.coeffs() / q.coeffs().stableNorm());  // components whose squares are out of range
}

// Reads a whole word as a finite number.
bool parse(const char* word, double& value) {
  char* end = nullptr;
  value = std::strtod(word, &end);
  return end != word && *end == '\0' && std::isfinite(value);
}

// Reads a whole word as an integer.
bool parse(const char* word, int& value) {
  char* end = nullptr;
  const long number = std::strtol(word, &end, 10);
  value = static_cast<int>(number);
  return end != word && *end == '\0' && value == number;
}

// Mass the host's `set density` and `set diameter` give a particle: that of its bounding sphere.
double sphere_mass(double radius, double density) {
  return 4.0 * M_PI / 3.0 * radius * radius * radius * density;
}

// Everybody's numbers, on all ranks in their order. Collective.
std::vector<double> gather_all(MPI_Comm world, const std::vector<double>& mine) {
  int ranks = 0, count = static_cast<int>(mine.size());
  MPI_Comm_size(world, &ranks);
  std::vector<int> counts(ranks), starts(ranks + 1, 0);
  MPI_Allgather(&count, 1, MPI_INT, counts.data(), 1, MPI_INT, world);
  for (int k = 0; k < ranks; ++k) starts[k + 1] = starts[k] + counts[k];
  std::vector<double> all(starts[ranks]);
  MPI_Allgatherv(mine.data(), count, MPI_DOUBLE, all.data(), counts.data(), starts.data(), MPI_DOUBLE, world);
  return all;
}

bool close(double a, double b) {
  return std::abs(a - b) <= 1e-14 * std::abs(b);
}

}  // namespace

AtomVecNurbs* AtomVecNurbs::require(LAMMPS* lmp, const std::string& user) {
  auto* style = dynamic_cast<AtomVecNurbs*>(lmp->atom->avec);
  if (style == nullptr) nurbs_host::fail_all(FLERR, lmp, user + " requires atom_style nurbs");
  return style;
}

AtomVecNurbs::AtomVecNurbs(LAMMPS* lmp) : AtomVec(lmp), shapes_(lmp) {
  molecular = 0;
  comm_x_only = 0;
  comm_f_only = 0;
  size_forward = kPosition + kOrientation;
  size_reverse = kForce;
  size_border = kPosition + kIds + kBody + kOrientation;
  size_velocity = kVelocity;
  size_data_atom = 12;
  size_data_vel = 7;
  xcol_data = 6;

  // Not sphere_flag: what the host offers for spheres alone (fix nve/sphere, compute erotate/sphere, ...)
  // must refuse these particles. shapetype_flag is what the host's PairGran asks of non-spherical ones.
  atom->shapetype_flag = 1;
  atom->radius_flag = atom->rmass_flag = atom->density_flag = 1;
  atom->omega_flag = atom->torque_flag = 1;
}

AtomVecNurbs::~AtomVecNurbs() {
  memory->destroy(scale_);
}

nurbs::Particle AtomVecNurbs::particle(int i) const {
  nurbs::Particle particle;
  particle.shape = shape(i);
  particle.scale = scale_[i];
  particle.x = Vec3(x_[i][0], x_[i][1], x_[i][2]);
  particle.q = to_quat(quaternion_[i]);
  return particle;
}

const nurbs::Bodies& AtomVecNurbs::update_bodies(int immobile) {
  if (static_cast<int>(shape_table_.size()) != shapes_.count() + 1) {
    shape_table_.assign(1, nullptr);
    for (int k = 1; k <= shapes_.count(); ++k) shape_table_.push_back(shapes_.shape(k));
  }
  nurbs::BodyArrays arrays;
  arrays.count = atom->nlocal + atom->nghost;
  if (arrays.count > 0) {
    arrays.x = x_[0];
    arrays.velocity = v_[0];
    arrays.spin = omega_[0];
    arrays.quaternion = quaternion_[0];
    arrays.mass = rmass_;
    arrays.scale = scale_;
    arrays.radius = radius_;
    arrays.shape = shapetype_;
    arrays.shapes = shape_table_.data();
    arrays.mask = mask_;
    arrays.immobile = immobile;
  }
  bodies_.update(arrays, update->dt, neighbor->ago == 0);
  return bodies_;
}

Vec3 AtomVecNurbs::principal_inertia(int i) const {
  return size(i) * shape(i)->principal_gyration;
}

Vec3 AtomVecNurbs::momentum_of_spin(int i) const {
  return nurbs::angular_momentum(Vec3::Map(omega_[i]), to_quat(quaternion_[i]), shape(i)->principal_axes,
                                 principal_inertia(i));
}

void AtomVecNurbs::record_spin(int i) {
  SpinRecord& made = spin_[i];
  for (int k = 0; k < 3; ++k) made.omega[k] = omega_[i][k];
  for (int k = 0; k < 4; ++k) made.q[k] = quaternion_[i][k];
  made.size = size(i);
}

void AtomVecNurbs::load_batch(const int* list, int count) {
  for (int lane = 0; lane < count; ++lane) {
    const int i = list[lane];
    for (int k = 0; k < 4; ++k) batch_.q[k][lane] = quaternion_[i][k];
    for (int k = 0; k < 3; ++k) batch_.momentum[k][lane] = angmom_[i][k];
    batch_.inverse_size[lane] = 1 / size(i);
  }
}

// From a lane of the batch to the particle and to its record.
void AtomVecNurbs::store_omega(int i, int lane) {
  for (int k = 0; k < 3; ++k) omega_[i][k] = spin_[i].omega[k] = batch_.velocity[k][lane];
}

void AtomVecNurbs::store_q(int i, int lane) {
  for (int k = 0; k < 4; ++k) quaternion_[i][k] = spin_[i].q[k] = batch_.q[k][lane];
}

void AtomVecNurbs::rotate(RotationScheme scheme, const int* list, int count, double dt) {
  if (scheme != RotationScheme::symplectic) {
    for (int lane = 0; lane < count; ++lane) {
      const int i = list[lane];
      Quat q = to_quat(quaternion_[i]);
      nurbs::rotate_free(scheme, principal_inertia(i), shape(i)->principal_axes, dt, q, kept_momentum(i));
      put_quaternion(i, q);
    }
    update_omega(list, count);
    return;
  }
  load_batch(list, count);
  nurbs::drift(shapes_.rotor(shapetype_[list[0]]), dt, &batch_);
  for (int lane = 0; lane < count; ++lane) {
    const int i = list[lane];
    store_omega(i, lane);
    store_q(i, lane);
    spin_[i].size = size(i);
  }
}

void AtomVecNurbs::update_omega(const int* list, int count) {
  load_batch(list, count);
  nurbs::find_angular_velocity(shapes_.rotor(shapetype_[list[0]]), &batch_);
  for (int lane = 0; lane < count; ++lane) {
    const int i = list[lane];
    store_omega(i, lane);
    store_q(i, lane);
    spin_[i].size = size(i);
  }
}

void AtomVecNurbs::set_body(int i, int shape_number, double scale, double density, const Quat& orientation) {
  shapetype_[i] = shape_number;
  scale_[i] = scale;
  density_[i] = density;
  put_quaternion(i, normalised(orientation));
  update_size(i);
  spin_[i].size = 0;  // the angular momentum kept was another body's
}

void AtomVecNurbs::put_quaternion(int i, const Quat& q) {
  quaternion_[i][0] = q.w();
  quaternion_[i][1] = q.x();
  quaternion_[i][2] = q.y();
  quaternion_[i][3] = q.z();
}

// Mass and bounding radius from shape, scale and density.
void AtomVecNurbs::update_size(int i) {
  const nurbs::Shape& body = *shape(i);
  radius_[i] = scale_[i] * body.bounding_radius;
  rmass_[i] = density_[i] * body.mass.volume * scale_[i] * scale_[i] * scale_[i];
}

void AtomVecNurbs::settings(int narg, char** arg) {
  if (atom->avec != this)
    nurbs_host::fail_all(FLERR, lmp, "atom_style nurbs cannot be part of atom_style hybrid");
  // read_restart creates the style without arguments and then calls read_restart_settings.
  if (arg == nullptr) return;
  if (narg < 1)
    nurbs_host::fail_all(FLERR, lmp,
                         "atom_style nurbs needs at least one shape file: atom_style nurbs FILE [FILE ...]");
  shapes_.read_files(std::vector<std::string>(arg, arg + narg));
}

void AtomVecNurbs::init() {
  AtomVec::init();
  if (shapes_.count() == 0) nurbs_host::fail_all(FLERR, lmp, "atom_style nurbs has no shapes");
  nurbs_host::check_host(lmp, &told_);
  follow_set_commands();
  check_ids();
  if (const std::string bad = check_all_owned(); !bad.empty()) nurbs_host::fail_one(lmp, bad);
  warn_default_density();
  check_wider_than_box();
}

// In the course of a step the host has its ghosts, of one step before, but drops them after an insertion; the
// next fix insert/* of that step could not know what reaches over from other ranks or periodic images.
void AtomVecNurbs::begin_insertion(double radius) {
  site_size_ = std::max(site_size_, radius);
  foreign_.clear();
  bigint mine[2] = {atom->nlocal, atom->nghost}, all[2];
  MPI_Allreduce(mine, all, 2, MPI_LMP_BIGINT, MPI_SUM, world);
  if (all[0] > 0 && all[1] == 0) foreign_ = foreign_bodies(site_size_);
}

nurbs::InsertionSite& AtomVecNurbs::insertion_site() {
  if (site_size_ > 0) {
    site_.clear(site_size_);
    for (int i = 0; i < atom->nlocal + atom->nghost; ++i) site_.add(particle(i));
    for (const nurbs::Particle& body : foreign_) site_.add(body);
    site_size_ = 0;
  }
  return site_;
}

// Bodies and periodic images that may be in the way of one of this radius whose centre is on this rank, other
// than the rank's own bodies. Collective; gives every rank what is near some rank's border.
std::vector<nurbs::Particle> AtomVecNurbs::foreign_bodies(double radius) const {
  const auto outside = [&](const double* x, double by) {
    bool out = false;
    for (int k = 0; k < 3; ++k) out |= x[k] < domain->sublo[k] - by || x[k] > domain->subhi[k] + by;
    return out;
  };
  std::vector<double> mine;
  for (int i = 0; i < atom->nlocal; ++i) {
    if (!outside(x_[i], -(radius + radius_[i]))) continue;
    mine.push_back(shapetype_[i]);
    mine.push_back(scale_[i]);
    mine.insert(mine.end(), x_[i], x_[i] + 3);
    mine.insert(mine.end(), quaternion_[i], quaternion_[i] + 4);
  }
  const std::vector<double> all = gather_all(world, mine);
  const double length[3] = {domain->xprd, domain->yprd, domain->zprd};
  std::vector<nurbs::Particle> found;
  for (std::size_t at = 0; at < all.size(); at += 9) {
    nurbs::Particle body;
    body.shape = shapes_.shape(static_cast<int>(all[at]));
    body.scale = all[at + 1];
    body.q = to_quat(&all[at + 5]);
    for (int image = 0; image < 27; ++image) {
      const int shift[3] = {image % 3 - 1, image / 3 % 3 - 1, image / 9 - 1};
      bool exists = true;
      for (int k = 0; k < 3; ++k) {
        exists &= shift[k] == 0 || domain->periodicity[k] != 0;
        body.x[k] = all[at + 2 + k] + shift[k] * length[k];
      }
      if (exists && outside(body.x.data(), 0) &&
          !outside(body.x.data(), radius + body.scale * body.shape->bounding_radius))
        found.push_back(body);
    }
  }
  return found;
}

void AtomVecNurbs::turn(int i, const Quat& by) {
  put_quaternion(i, (by * to_quat(quaternion_[i])).normalized());
}

void AtomVecNurbs::follow_set_commands() {
  for (int i = 0; i < atom->nlocal; ++i) follow_set_command(i);
}

// Once: create_atoms has no word for it, and a forgotten `set density` leaves bodies of 1 kg/m3.
void AtomVecNurbs::warn_default_density() {
  int mine = 0, all = 0;
  for (int i = 0; i < atom->nlocal; ++i) mine += density_[i] == 1;
  MPI_Allreduce(&mine, &all, 1, MPI_INT, MPI_SUM, world);
  if (density_wanted_ && all > 0)
    nurbs_host::warn(FLERR, lmp,
                     std::to_string(all) +
                         " particles made by create_atoms have density 1; say so by 'set group all density "
                         "1' or give theirs");
  density_wanted_ = false;
}

// Shape files in millimetres and a deck in metres end in the host's 'Neighbor list overflow', or, where a
// list is written past its end before that, in nothing. A long body in a short box may be meant; one whose
// inner sphere is wider is not: it is warned of once, and refused where it would overlap its own image.
void AtomVecNurbs::check_wider_than_box() {
  double mine = 0, widest = 0;
  for (int i = 0; i < atom->nlocal; ++i) mine = std::max(mine, 2 * scale_[i] * shape(i)->inner_radius);
  MPI_Allreduce(&mine, &widest, 1, MPI_DOUBLE, MPI_MAX, world);
  double shortest = nurbs::kInfinity, period = nurbs::kInfinity;
  for (int k = 0; k < 3; ++k) {
    const double edge = domain->boxhi[k] - domain->boxlo[k];
    shortest = std::min(shortest, edge);
    if (domain->periodicity[k]) period = std::min(period, edge);
  }
  if (widest <= shortest) return;
  const std::string words = "There are particles of inner diameter " + nurbs_host::show(widest) + " in a " +
                            (widest > period ? "periodic " : "") + "box " +
                            nurbs_host::show(widest > period ? period : shortest) +
                            " wide; are the shape file's lengths the deck's? 'set group all nurbs/scale S' "
                            "scales them";
  if (widest > period) nurbs_host::fail_all(FLERR, lmp, words);
  if (told_.insert("wider than the box").second) nurbs_host::warn(FLERR, lmp, words);
}

// The host's `set` command treats a particle as a sphere. `set diameter` (of the bounding sphere) means a
// scale here, `set density` a mass, `set mass` a density.
void AtomVecNurbs::follow_set_command(int i) {
  const nurbs::Shape& body = *shape(i);
  if (!close(radius_[i], scale_[i] * body.bounding_radius)) scale_[i] = radius_[i] / body.bounding_radius;
  const double volume = body.mass.volume * scale_[i] * scale_[i] * scale_[i];
  const bool mass_was_set = std::isnormal(volume) && !close(rmass_[i], density_[i] * volume) &&
                            !close(rmass_[i], sphere_mass(radius_[i], density_[i]));
  if (mass_was_set) density_[i] = rmass_[i] / volume;
  update_size(i);
}

// What a `set` command can have spoilt; empty when all is well.
std::string AtomVecNurbs::check_all_owned() const {
  for (int i = 0; i < atom->nlocal; ++i) {
    const std::string who = "Atom " + std::to_string(tag_[i]) + ": ";
    if (!(scale_[i] > 0)) return who + "scale " + nurbs_host::show(scale_[i]) + " must be > 0";
    if (!(density_[i] > 0)) return who + "density " + nurbs_host::show(density_[i]) + " must be > 0";
    if (const std::string bad = check_size(i); !bad.empty()) return who + bad;
  }
  return "";
}

std::string AtomVecNurbs::check_size(int i) const {
  if (std::isnormal(rmass_[i]) && std::isnormal(radius_[i])) return "";
  return "scale " + nurbs_host::show(scale_[i]) + " and density " + nurbs_host::show(density_[i]) +
         " give a mass of " + nurbs_host::show(rmass_[i]) + ", which must be above " +
         nurbs_host::show(std::numeric_limits<double>::min()) + " and finite";
}

// Each id is looked at on the rank of its remainder. The smallest there twice is named.
void AtomVecNurbs::check_ids() {
  int mine = data_read_, any = 0;
  MPI_Allreduce(&mine, &any, 1, MPI_INT, MPI_MAX, world);
  data_read_ = false;
  if (any == 0) return;
  const int ranks = comm->nprocs;
  std::vector<std::vector<int>> to(ranks);
  for (int i = 0; i < atom->nlocal; ++i) to[tag_[i] % ranks].push_back(tag_[i]);
  std::vector<int> sent(ranks), got(ranks), from(ranks), at(ranks), all;
  for (int r = 0; r < ranks; ++r) {
    from[r] = static_cast<int>(all.size());
    sent[r] = static_cast<int>(to[r].size());
    all.insert(all.end(), to[r].begin(), to[r].end());
  }
  MPI_Alltoall(sent.data(), 1, MPI_INT, got.data(), 1, MPI_INT, world);
  int count = 0;
  for (int r = 0; r < ranks; ++r) at[r] = count, count += got[r];
  std::vector<int> here(count);
  MPI_Alltoallv(all.data(), sent.data(), from.data(), MPI_INT, here.data(), got.data(), at.data(), MPI_INT,
                world);
  std::sort(here.begin(), here.end());
  const auto twice = std::adjacent_find(here.begin(), here.end());
  int least = twice == here.end() ? std::numeric_limits<int>::max() : *twice, first = 0;
  MPI_Allreduce(&least, &first, 1, MPI_INT, MPI_MIN, world);
  if (first < std::numeric_limits<int>::max())
    nurbs_host::fail_all(FLERR, lmp,
                         "Atom " + std::to_string(first) + " in the Atoms section: id " +
                             std::to_string(first) + " is there twice; ids must differ");
}

void AtomVecNurbs::grow(int n) {
  nmax = n == 0 ? nmax + kGrowth : n;
  atom->nmax = nmax;
  if (nmax < 0 || nmax > MAXSMALLINT) error->one(FLERR, "Per-processor system is too big");

  memory->grow(atom->tag, nmax, "atom:tag");
  memory->grow(atom->type, nmax, "atom:type");
  memory->grow(atom->mask, nmax, "atom:mask");
  memory->grow(atom->image, nmax, "atom:image");
  memory->grow(atom->x, nmax, 3, "atom:x");
  memory->grow(atom->v, nmax, 3, "atom:v");
  memory->grow(atom->f, nmax * comm->nthreads, 3, "atom:f");
  memory->grow(atom->radius, nmax, "atom:radius");
  memory->grow(atom->density, nmax, "atom:density");
  memory->grow(atom->rmass, nmax, "atom:rmass");
  memory->grow(atom->omega, nmax, 3, "atom:omega");
  memory->grow(atom->angmom, nmax, 3, "atom:angmom");
  memory->grow(atom->torque, nmax * comm->nthreads, 3, "atom:torque");
  memory->grow(atom->quaternion, nmax, 4, "atom:quaternion");
  memory->grow(atom->shapetype, nmax, "atom:shapetype");
  memory->grow(scale_, nmax, "atom:scale");
  spin_.resize(nmax);
  grow_reset();

  for (int k = 0; k < atom->nextra_grow; ++k) modify->fix[atom->extra_grow[k]]->grow_arrays(nmax);
}

void AtomVecNurbs::grow_reset() {
  tag_ = atom->tag;
  type_ = atom->type;
  mask_ = atom->mask;
  image_ = atom->image;
  x_ = atom->x;
  v_ = atom->v;
  f_ = atom->f;
  radius_ = atom->radius;
  density_ = atom->density;
  rmass_ = atom->rmass;
  omega_ = atom->omega;
  angmom_ = atom->angmom;
  torque_ = atom->torque;
  quaternion_ = atom->quaternion;
  shapetype_ = atom->shapetype;
}

void AtomVecNurbs::copy(int from, int to, int delflag) {
  double state[kState];
  put_state(from, state);
  get_state(to, state);
  for (int k = 0; k < atom->nextra_grow; ++k)
    modify->fix[atom->extra_grow[k]]->copy_arrays(from, to, delflag);
}

AtomVecNurbs::ImageShift AtomVecNurbs::image_shift(int pbc_flag, const int* pbc, Stage stage) const {
  ImageShift shift;
  if (pbc_flag == 0) return shift;
  if (!domain->triclinic)
    shift.x = Vec3(pbc[0] * domain->xprd, pbc[1] * domain->yprd, pbc[2] * domain->zprd);
  else if (stage == Stage::border)
    shift.x = Vec3(pbc[0], pbc[1], pbc[2]);  // borders are exchanged in lamda coordinates
  else
    shift.x = Vec3(pbc[0] * domain->xprd + pbc[5] * domain->xy + pbc[4] * domain->xz,
                   pbc[1] * domain->yprd + pbc[3] * domain->yz, pbc[2] * domain->zprd);
  if (deform_vremap)
    shift.v = Vec3(pbc[0] * h_rate[0] + pbc[5] * h_rate[5] + pbc[4] * h_rate[4],
                   pbc[1] * h_rate[1] + pbc[3] * h_rate[3], pbc[2] * h_rate[2]);
  return shift;
}

// put_x appends particle i's x at p and returns the end; get_x reads it back.

double* AtomVecNurbs::put_position(int i, const ImageShift& shift, double* p) const {
  for (int k = 0; k < 3; ++k) *p++ = x_[i][k] + shift.x[k];
  return p;
}

double* AtomVecNurbs::get_position(int i, double* p) {
  for (int k = 0; k < 3; ++k) x_[i][k] = *p++;
  return p;
}

double* AtomVecNurbs::put_orientation(int i, double* p) const {
  for (int k = 0; k < 4; ++k) *p++ = quaternion_[i][k];
  return p;
}

double* AtomVecNurbs::get_orientation(int i, double* p) {
  for (int k = 0; k < 4; ++k) quaternion_[i][k] = *p++;
  return p;
}

double* AtomVecNurbs::put_velocity(int i, const ImageShift& shift, double* p) const {
  const double factor = (mask_[i] & deform_groupbit) ? 1 : 0;
  for (int k = 0; k < 3; ++k) *p++ = v_[i][k] + factor * shift.v[k];
  for (int k = 0; k < 3; ++k) *p++ = omega_[i][k];
  return p;
}

double* AtomVecNurbs::get_velocity(int i, double* p) {
  for (int k = 0; k < 3; ++k) v_[i][k] = *p++;
  for (int k = 0; k < 3; ++k) omega_[i][k] = *p++;
  return p;
}

double* AtomVecNurbs::put_body(int i, double* p) const {
  *p++ = ubuf(shapetype_[i]).d;
  *p++ = scale_[i];
  *p++ = density_[i];
  *p++ = radius_[i];
  *p++ = rmass_[i];
  return p;
}

double* AtomVecNurbs::get_body(int i, double* p) {
  shapetype_[i] = static_cast<int>(ubuf(*p++).i);
  scale_[i] = *p++;
  density_[i] = *p++;
  radius_[i] = *p++;
  rmass_[i] = *p++;
  return p;
}

// All that makes a particle; position first, as the host's exchange and read_restart expect. Leaves p[0] to
// the count. The angular momentum goes along, so that it need not be made from omega again; if omega has been
// set, it is the momentum of that.
double* AtomVecNurbs::put_state(int i, double* p) const {
  p = put_position(i, {}, p + 1);
  *p++ = ubuf(tag_[i]).d;
  *p++ = ubuf(type_[i]).d;
  *p++ = ubuf(mask_[i]).d;
  *p++ = ubuf(image_[i]).d;
  Vec3::Map(p) = angular_momentum(i);
  p += kMomentum;
  return put_body(i, put_velocity(i, {}, put_orientation(i, p)));
}

double* AtomVecNurbs::get_state(int i, double* p) {
  p = get_position(i, p + 1);
  tag_[i] = static_cast<int>(ubuf(*p++).i);
  type_[i] = static_cast<int>(ubuf(*p++).i);
  mask_[i] = static_cast<int>(ubuf(*p++).i);
  image_[i] = static_cast<tagint>(ubuf(*p++).i);
  for (int k = 0; k < 3; ++k) angmom_[i][k] = *p++;
  p = get_body(i, get_velocity(i, get_orientation(i, p)));
  record_spin(i);
  return p;
}

int AtomVecNurbs::pack_comm(int n, int* list, double* buf, int pbc_flag, int* pbc) {
  const ImageShift shift = image_shift(pbc_flag, pbc, Stage::comm);
  double* p = buf;
  for (int k = 0; k < n; ++k) p = put_orientation(list[k], put_position(list[k], shift, p));
  return static_cast<int>(p - buf);
}

void AtomVecNurbs::unpack_comm(int n, int first, double* buf) {
  for (int i = first; i < first + n; ++i) buf = get_orientation(i, get_position(i, buf));
}

int AtomVecNurbs::pack_comm_vel(int n, int* list, double* buf, int pbc_flag, int* pbc) {
  const ImageShift shift = image_shift(pbc_flag, pbc, Stage::comm);
  double* p = buf;
  for (int k = 0; k < n; ++k)
    p = put_velocity(list[k], shift, put_orientation(list[k], put_position(list[k], shift, p)));
  return static_cast<int>(p - buf);
}

void AtomVecNurbs::unpack_comm_vel(int n, int first, double* buf) {
  for (int i = first; i < first + n; ++i) buf = get_velocity(i, get_orientation(i, get_position(i, buf)));
}

int AtomVecNurbs::pack_reverse(int n, int first, double* buf) {
  double* p = buf;
  for (int i = first; i < first + n; ++i) {
    for (int k = 0; k < 3; ++k) *p++ = f_[i][k];
    for (int k = 0; k < 3; ++k) *p++ = torque_[i][k];
  }
  return static_cast<int>(p - buf);
}

void AtomVecNurbs::unpack_reverse(int n, int* list, double* buf) {
  for (int j = 0; j < n; ++j) {
    for (int k = 0; k < 3; ++k) f_[list[j]][k] += *buf++;
    for (int k = 0; k < 3; ++k) torque_[list[j]][k] += *buf++;
  }
}

double* AtomVecNurbs::put_border(int n, const int* list, const ImageShift& shift, bool velocity,
                                 double* p) const {
  for (int k = 0; k < n; ++k) {
    const int i = list[k];
    p = put_position(i, shift, p);
    *p++ = ubuf(tag_[i]).d;
    *p++ = ubuf(type_[i]).d;
    *p++ = ubuf(mask_[i]).d;
    p = put_orientation(i, put_body(i, p));
    if (velocity) p = put_velocity(i, shift, p);
  }
  for (int k = 0; k < atom->nextra_border; ++k)
    p += modify->fix[atom->extra_border[k]]->pack_border(n, const_cast<int*>(list), p);
  return p;
}

double* AtomVecNurbs::get_border(int n, int first, bool velocity, double* p) {
  for (int i = first; i < first + n; ++i) {
    if (i == nmax) grow(0);
    p = get_position(i, p);
    tag_[i] = static_cast<int>(ubuf(*p++).i);
    type_[i] = static_cast<int>(ubuf(*p++).i);
    mask_[i] = static_cast<int>(ubuf(*p++).i);
    p = get_orientation(i, get_body(i, p));
    if (velocity) p = get_velocity(i, p);
  }
  for (int k = 0; k < atom->nextra_border; ++k)
    p += modify->fix[atom->extra_border[k]]->unpack_border(n, first, p);
  return p;
}

int AtomVecNurbs::pack_border(int n, int* list, double* buf, int pbc_flag, int* pbc) {
  return static_cast<int>(put_border(n, list, image_shift(pbc_flag, pbc, Stage::border), false, buf) - buf);
}

int AtomVecNurbs::pack_border_vel(int n, int* list, double* buf, int pbc_flag, int* pbc) {
  return static_cast<int>(put_border(n, list, image_shift(pbc_flag, pbc, Stage::border), true, buf) - buf);
}

void AtomVecNurbs::unpack_border(int n, int first, double* buf) {
  get_border(n, first, false, buf);
}

void AtomVecNurbs::unpack_border_vel(int n, int first, double* buf) {
  get_border(n, first, true, buf);
}

int AtomVecNurbs::pack_exchange(int i, double* buf) {
  double* p = put_state(i, buf);
  for (int k = 0; k < atom->nextra_grow; ++k) p += modify->fix[atom->extra_grow[k]]->pack_exchange(i, p);
  buf[0] = static_cast<double>(p - buf);
  return static_cast<int>(p - buf);
}

int AtomVecNurbs::unpack_exchange(double* buf) {
  const int i = atom->nlocal;
  if (i == nmax) grow(0);
  double* p = get_state(i, buf);
  for (int k = 0; k < atom->nextra_grow; ++k) p += modify->fix[atom->extra_grow[k]]->unpack_exchange(i, p);
  ++atom->nlocal;
  return static_cast<int>(p - buf);
}

int AtomVecNurbs::size_restart() {
  int n = kState * atom->nlocal;
  for (int k = 0; k < atom->nextra_restart; ++k)
    for (int i = 0; i < atom->nlocal; ++i) n += modify->fix[atom->extra_restart[k]]->size_restart(i);
  return n;
}

int AtomVecNurbs::pack_restart(int i, double* buf) {
  double* p = put_state(i, buf);
  for (int k = 0; k < atom->nextra_restart; ++k) p += modify->fix[atom->extra_restart[k]]->pack_restart(i, p);
  buf[0] = static_cast<double>(p - buf);
  return static_cast<int>(p - buf);
}

int AtomVecNurbs::unpack_restart(double* buf) {
  const int i = atom->nlocal;
  if (i == nmax) {
    grow(0);
    if (atom->nextra_store) memory->grow(atom->extra, nmax, atom->nextra_store, "atom:extra");
  }
  double* p = get_state(i, buf);
  if (atom->nextra_store) {
    const int extra = static_cast<int>(buf[0]) - static_cast<int>(p - buf);
    for (int k = 0; k < extra; ++k) atom->extra[i][k] = *p++;
  }
  ++atom->nlocal;
  return static_cast<int>(p - buf);
}

// A new owned particle at rest, its body not yet set; returns its index.
int AtomVecNurbs::append_atom(int type, const double* coord, tagint image) {
  const int i = atom->nlocal;
  if (i == nmax) grow(0);
  tag_[i] = 0;
  type_[i] = type;
  mask_[i] = 1;
  image_[i] = image;
  for (int k = 0; k < 3; ++k) {
    x_[i][k] = coord[k];
    v_[i][k] = omega_[i][k] = angmom_[i][k] = 0;
  }
  ++atom->nlocal;
  return i;
}

void AtomVecNurbs::create_atom(int type, double* coord) {
  constexpr tagint home =
      (static_cast<tagint>(IMGMAX) << IMG2BITS) | (static_cast<tagint>(IMGMAX) << IMGBITS) | IMGMAX;
  set_body(append_atom(type, coord, home), 1, 1, 1, Quat::Identity());
}

// values: id type shape scale density x y z qw qx qy qz
void AtomVecNurbs::data_atom(double* coord, tagint image, char** values) {
  const auto fail = [&](const std::string& message) {
    nurbs_host::fail_one(lmp, std::string("Atom ") + values[0] + " in the Atoms section: " + message);
  };
  int tag = 0, type = 0, shape_number = 0;
  double scale = 0, density = 0, q[4];
  if (!parse(values[0], tag) || tag <= 0) fail("id must be an integer > 0");
  if (!parse(values[1], type) || type < 1 || type > atom->ntypes)
    fail(std::string("type ") + values[1] + " must be 1 to " + std::to_string(atom->ntypes));
  if (!parse(values[2], shape_number) || shape_number < 1 || shape_number > shapes_.count())
    fail(std::string("shape ") + values[2] + " must be 1 to " + std::to_string(shapes_.count()) +
         ", the number of shapes of atom_style nurbs");
  if (!parse(values[3], scale) || scale <= 0) fail(std::string("scale ") + values[3] + " must be > 0");
  if (!parse(values[4], density) || density <= 0) fail(std::string("density ") + values[4] + " must be > 0");
  double ignored = 0;
  for (int k = 5; k < 8; ++k)  // the host reads these itself, and takes anything
    if (!parse(values[k], ignored)) fail(std::string("coordinate ") + values[k] + " must be a number");
  for (int k = 0; k < 4; ++k)
    if (!parse(values[8 + k], q[k]))
      fail(std::string("quaternion component ") + values[8 + k] + " must be a number");
  if (!(to_quat(q).coeffs().stableNorm() > 0)) fail("quaternion 0 0 0 0 must have a length > 0");

  const int i = append_atom(type, coord, image);
  tag_[i] = tag;
  set_body(i, shape_number, scale, density, to_quat(q));
  if (const std::string bad = check_size(i); !bad.empty()) fail(bad);
  data_read_ = true;
}

// values: vx vy vz wx wy wz
void AtomVecNurbs::data_vel(int i, char** values) {
  const std::string who = "Atom " + std::to_string(tag_[i]) + " in the Velocities section: ";
  for (int k = 0; k < 6; ++k) {
    double& target = k < 3 ? v_[i][k] : omega_[i][k - 3];
    if (values[k] == nullptr)  // the host counts the first line's, and takes what lacks from the next line
      nurbs_host::fail_one(lmp, who + std::to_string(k) +
                                    " values behind the id; there must be 6 in its line and the line before");
    if (!parse(values[k], target)) nurbs_host::fail_one(lmp, who + values[k] + " must be a number");
  }
}

void AtomVecNurbs::pack_data(double** buf, int tag_offset) {
  for (int i = 0; i < atom->nlocal; ++i) {
    double* p = buf[i];
    *p++ = ubuf(tag_[i] + tag_offset).d;
    *p++ = ubuf(type_[i]).d;
    *p++ = ubuf(shapetype_[i]).d;
    *p++ = scale_[i];
    *p++ = density_[i];
    p = put_orientation(i, put_position(i, {}, p));
    *p++ = ubuf((image_[i] & IMGMASK) - IMGMAX).d;
    *p++ = ubuf((image_[i] >> IMGBITS & IMGMASK) - IMGMAX).d;
    *p++ = ubuf((image_[i] >> IMG2BITS) - IMGMAX).d;
  }
}

void AtomVecNurbs::write_data(FILE* file, int n, double** buf) {
  const auto integer = [](double word) { return static_cast<int>(ubuf(word).i); };
  for (int i = 0; i < n; ++i) {
    const double* p = buf[i];
    std::fprintf(file, "%d %d %d", integer(p[0]), integer(p[1]), integer(p[2]));
    for (int k = 3; k < 12; ++k) std::fprintf(file, " %.17g", p[k]);
    std::fprintf(file, " %d %d %d\n", integer(p[12]), integer(p[13]), integer(p[14]));
  }
}

void AtomVecNurbs::pack_vel(double** buf, int tag_offset) {
  for (int i = 0; i < atom->nlocal; ++i) {
    buf[i][0] = ubuf(tag_[i] + tag_offset).d;
    put_velocity(i, {}, buf[i] + 1);
  }
}

void AtomVecNurbs::write_vel(FILE* file, int n, double** buf) {
  for (int i = 0; i < n; ++i) {
    std::fprintf(file, "%d", static_cast<int>(ubuf(buf[i][0]).i));
    for (int k = 1; k < 7; ++k) std::fprintf(file, " %.17g", buf[i][k]);
    std::fprintf(file, "\n");
  }
}

bigint AtomVecNurbs::memory_usage() {
  bigint bytes = 0;
  const auto count = [&](const char* name, auto... array) {
    if (atom->memcheck(name)) bytes += memory->usage(array...);
  };
  count("tag", tag_, nmax);
  count("type", type_, nmax);
  count("mask", mask_, nmax);
  count("image", image_, nmax);
  count("x", x_, nmax, 3);
  count("v", v_, nmax, 3);
  count("f", f_, nmax * comm->nthreads, 3);
  count("radius", radius_, nmax);
  count("density", density_, nmax);
  count("rmass", rmass_, nmax);
  count("omega", omega_, nmax, 3);
  count("angmom", angmom_, nmax, 3);
  count("torque", torque_, nmax * comm->nthreads, 3);
  count("quaternion", quaternion_, nmax, 4);
  count("shapetype", shapetype_, nmax);
  count("scale", scale_, nmax);
  return bytes + static_cast<bigint>(spin_.capacity() * sizeof(SpinRecord));
}

}  // namespace LAMMPS_NS

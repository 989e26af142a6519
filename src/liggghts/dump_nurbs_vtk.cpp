// Dump::write gathers (pack on every rank, write_data on rank 0 for one rank after the other); the file is
// made from the gathered particles at the end. So the base class is told of one file that is never opened
// (multifile = 0).
#include "liggghts/dump_nurbs_vtk.h"

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>

#include "atom.h"
#include "liggghts/atom_vec_nurbs.h"
#include "liggghts/host_error.h"
#include "update.h"

using nurbs::VtuBody;

namespace LAMMPS_NS {
namespace {

// What is gathered of a particle: id, type, shape number, scale, position, quaternion (w, x, y, z), velocity,
// omega.
constexpr int kParticleSize = 17;

VtuBody unpack_particle(const double* p) {
  VtuBody body;
  body.id = static_cast<int>(p[0]);
  body.type = static_cast<int>(p[1]);
  body.shape = static_cast<int>(p[2]) - 1;
  body.scale = p[3];
  body.position = {p[4], p[5], p[6]};
  body.orientation = nurbs::Quat(p[7], p[8], p[9], p[10]);
  body.velocity = {p[11], p[12], p[13]};
  body.omega = {p[14], p[15], p[16]};
  return body;
}

std::string without_folder(const std::string& path) {
  const std::size_t slash = path.rfind('/');
  return slash == std::string::npos ? path : path.substr(slash + 1);
}

// "run/scene-*.vtu" has its collection in "run/scene.pvd".
std::string collection_name(std::string before_star) {
  while (!before_star.empty() && std::strchr("-_.", before_star.back()) != nullptr) before_star.pop_back();
  if (before_star.empty() || before_star.back() == '/') before_star += "dump";
  return before_star + ".pvd";
}

}  // namespace

DumpNurbsVtk::DumpNurbsVtk(LAMMPS* lmp, int narg, char** arg) : Dump(lmp, narg, arg) {
  const std::string file = arg[4];
  const std::size_t star = file.find('*');
  const bool vtu = file.size() > 4 && file.compare(file.size() - 4, 4, ".vtu") == 0;
  if (!vtu || star == std::string::npos || file.find('%') != std::string::npos) {
    nurbs_host::fail_all(
        FLERR, lmp, "dump nurbs/vtk: the file name must contain * and no % and end in .vtu, got " + file);
  }
  if (narg > 5) nurbs_host::fail_all(FLERR, lmp, std::string("dump nurbs/vtk: unknown keyword ") + arg[5]);
  file_before_star_ = file.substr(0, star);
  file_after_star_ = file.substr(star + 1);
  multifile = 0;
  flush_flag = 0;
  size_one = kParticleSize;
}

void DumpNurbsVtk::init_style() {
  AtomVecNurbs::require(lmp, "dump nurbs/vtk");
}

void DumpNurbsVtk::write() {
  bodies_.clear();
  Dump::write();
  if (filewriter) save_snapshot();
}

void DumpNurbsVtk::pack(int* ids) {
  const auto* avec = static_cast<const AtomVecNurbs*>(atom->avec);
  double* p = buf;
  for (int i = 0; i < atom->nlocal; ++i) {
    if (!(atom->mask[i] & groupbit)) continue;
    if (ids != nullptr) *ids++ = atom->tag[i];
    *p++ = atom->tag[i];
    *p++ = atom->type[i];
    *p++ = atom->shapetype[i];
    *p++ = avec->scale(i);
    p = std::copy_n(atom->x[i], 3, p);
    p = std::copy_n(atom->quaternion[i], 4, p);
    p = std::copy_n(atom->v[i], 3, p);
    p = std::copy_n(atom->omega[i], 3, p);
  }
}

void DumpNurbsVtk::write_data(int n, double* particles) {
  for (int i = 0; i < n; ++i) bodies_.push_back(unpack_particle(particles + i * kParticleSize));
}

// Of a snapshot's file without its folder; -1: it is none of this dump's.
bigint DumpNurbsVtk::step_of(const std::string& file) const {
  const std::string before = without_folder(file_before_star_);
  if (file.compare(0, before.size(), before) != 0) return -1;
  const std::string rest = file.substr(before.size());
  char* end = nullptr;
  const long long step = std::strtoll(rest.c_str(), &end, 10);
  return end == rest.c_str() || file_after_star_ != end ? -1 : step;
}

// A run that starts at a later step (after read_restart) keeps the snapshots of steps before it.
void DumpNurbsVtk::read_film() {
  std::ifstream in(collection_name(file_before_star_));
  for (const auto& [time, file] : nurbs::read_pvd(in)) {
    const bigint step = step_of(file);
    if (step >= 0 && step < update->firststep) snapshots_.emplace_back(time, file);
  }
}

// Snapshots from this step on are of a run that reset_timestep took back. The host may count time from zero
// again, there and after read_restart: the film's goes on.
void DumpNurbsVtk::continue_film() {
  if (snapshots_.empty() && update->firststep > 0) read_film();
  const auto later = [this](const auto& snapshot) { return step_of(snapshot.second) >= update->ntimestep; };
  snapshots_.erase(std::remove_if(snapshots_.begin(), snapshots_.end(), later), snapshots_.end());
  if (snapshots_.empty()) {
    earlier_time_ = 0;
    return;
  }
  const auto& [time, file] = snapshots_.back();
  if (earlier_time_ + update->get_cur_time() <= time)
    earlier_time_ =
        time + static_cast<double>(update->ntimestep - step_of(file)) * update->dt - update->get_cur_time();
}

void DumpNurbsVtk::save_snapshot() {
  continue_film();
  std::sort(bodies_.begin(), bodies_.end(), [](const VtuBody& a, const VtuBody& b) { return a.id < b.id; });
  const ShapeLibrary& library = static_cast<const AtomVecNurbs*>(atom->avec)->shapes();
  std::vector<const nurbs::Shape*> shapes;
  for (int number = 1; number <= library.count(); ++number) shapes.push_back(library.shape(number));

  char step[32];
  std::snprintf(step, sizeof step, "%0*lld", padflag, static_cast<long long>(update->ntimestep));
  const std::string file = file_before_star_ + step + file_after_star_;
  const double time = earlier_time_ + update->get_cur_time();
  save(file, [&](std::ostream& out) { nurbs::write_vtu(out, bodies_, shapes, time); });

  snapshots_.emplace_back(time, without_folder(file));
  save(collection_name(file_before_star_), [&](std::ostream& out) { nurbs::write_pvd(out, snapshots_); });
}

void DumpNurbsVtk::save(const std::string& file, const std::function<void(std::ostream&)>& content) {
  const std::string unfinished = file + ".part";
  errno = 0;
  std::ofstream out(unfinished, std::ios::binary);
  content(out);
  out.close();
  if (!out || std::rename(unfinished.c_str(), file.c_str()) != 0) {
    const std::string reason = std::strerror(errno);
    std::remove(unfinished.c_str());
    nurbs_host::fail_one(lmp, "dump nurbs/vtk: cannot write " + file + ": " + reason);
  }
}

}  // namespace LAMMPS_NS

// See fix_check_timestep_gran_nurbs.h.
#include "liggghts/fix_check_timestep_gran_nurbs.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>

#include "atom.h"
#include "comm.h"
#include "error.h"
#include "fix_mesh_surface.h"
#include "fix_property_global.h"
#include "force.h"
#include "liggghts/atom_vec_nurbs.h"
#include "liggghts/host_error.h"
#include "liggghts/pair_gran_nurbs.h"
#include "modify.h"
#include "neighbor.h"
#include "properties.h"
#include "update.h"

namespace LAMMPS_NS {

// The host's constructor has checked the words; its own values are private.
FixCheckTimestepGranNurbs::FixCheckTimestepGranNurbs(LAMMPS* lmp, int narg, char** arg)
    : FixCheckTimestepGran(lmp, narg, arg) {
  int k = std::strcmp(arg[3], "check_every_time") == 0 ? 5 : 4;
  if (k + 1 >= narg)
    nurbs_host::fail_all(FLERR, lmp, "Illegal fix check/timestep/gran command, not enough arguments");
  rayleigh_limit_ = std::atof(arg[k]);
  hertz_limit_ = std::atof(arg[k + 1]);
  for (k += 2; k + 1 < narg; k += 2) {
    const bool yes = std::strcmp(arg[k + 1], "yes") == 0;
    if (std::strcmp(arg[k], "warn") == 0) warns_ = yes;
    if (std::strcmp(arg[k], "error") == 0) stops_ = yes;
    if (std::strcmp(arg[k], "vmax") == 0) least_speed_ = std::atof(arg[k + 1]);
  }
}

AtomVecNurbs* FixCheckTimestepGranNurbs::bodies() const {
  return dynamic_cast<AtomVecNurbs*>(atom->avec);
}

void FixCheckTimestepGranNurbs::init() {
  if (bodies() == nullptr) return FixCheckTimestepGran::init();
  const PairGranNurbs* pair = PairGranNurbs::find(lmp);
  const int types = atom->get_properties()->max_type();
  const auto find = [&](const char* name) {
    return static_cast<FixPropertyGlobal*>(
        modify->find_fix_property(name, "property/global", "peratomtype", types, 0, style, false));
  };
  young_ = find("youngsModulus");
  poisson_ = find("poissonsRatio");
  if (pair == nullptr || young_ == nullptr || poisson_ == nullptr)
    nurbs_host::fail_all(
        FLERR, lmp,
        "Fix check/timestep/gran needs pair_style gran/nurbs and fix property/global youngsModulus and "
        "poissonsRatio; with kn .. the pair style itself checks the time step");
}

FixCheckTimestepGranNurbs::Extremes FixCheckTimestepGranNurbs::extremes() const {
  const AtomVecNurbs& shapes = *bodies();
  Extremes mine;
  for (int i = 0; i < atom->nlocal; ++i) {
    if (!(atom->mask[i] & groupbit)) continue;
    const double young = young_->get_values()[atom->type[i] - 1],
                 nu = poisson_->get_values()[atom->type[i] - 1];
    const double inside = shapes.shape(i)->inner_radius * shapes.scale(i), shear = young / (2 * (1 + nu));
    const double rayleigh = M_PI * inside * std::sqrt(atom->density[i] / shear) / (0.1631 * nu + 0.8766);
    const double effective = 0.5 * young / (1 - nu * nu), mass = atom->rmass[i];
    const double hertz = 2.87 * std::pow(mass * mass / (0.5 * atom->radius[i] * effective * effective), 0.2);
    const nurbs::Vec3 v(atom->v[i]);
    mine.rayleigh = std::min(mine.rayleigh, rayleigh);
    mine.hertz = std::min(mine.hertz, hertz);
    mine.radius = std::min(mine.radius, inside);
    mine.speed = std::max(mine.speed, v.squaredNorm());
  }
  double low[4] = {mine.rayleigh, mine.hertz, mine.radius, -mine.speed}, all[4];
  MPI_Allreduce(low, all, 4, MPI_DOUBLE, MPI_MIN, world);
  return {all[0], all[1], all[2], std::max(-all[3], least_speed_ * least_speed_)};
}

// The largest speed of a node of a moving mesh.
double FixCheckTimestepGranNurbs::mesh_speed() const {
  double mine = 0, all = 0;
  for (int k = 0; k < modify->nfix; ++k) {
    auto* fix = dynamic_cast<FixMeshSurface*>(modify->fix[k]);
    if (fix == nullptr || !fix->triMesh()->isMoving()) continue;
    TriMesh& mesh = *fix->triMesh();
    auto* nodes = mesh.prop().getElementProperty<MultiVectorContainer<double, 3, 3>>("v");
    if (nodes == nullptr) continue;
    for (int t = 0; t < mesh.sizeLocal(); ++t)
      for (int n = 0; n < 3; ++n) mine = std::max(mine, nurbs::Vec3(nodes->begin()[t][n]).norm());
  }
  MPI_Allreduce(&mine, &all, 1, MPI_DOUBLE, MPI_MAX, world);
  return all;
}

void FixCheckTimestepGranNurbs::end_of_step() {
  if (bodies() == nullptr) return FixCheckTimestepGran::end_of_step();
  const Extremes found = extremes();
  const double speed = std::sqrt(found.speed), relative = std::max(2 * speed, speed + mesh_speed());
  const double dt = update->dt, hertz = relative > 0 ? found.hertz * std::pow(relative, -0.2) : 1e6;
  fractions_[0] = dt / found.rayleigh;
  fractions_[1] = dt / hertz;
  fractions_[2] = relative * dt / neighbor->skin;
  report(fractions_[0], rayleigh_limit_, "rayleigh");
  report(fractions_[1], hertz_limit_, "hertz");
  if (fractions_[2] > 1)
    tell("time step too large or skin too small - particles may relatively travel a distance of " +
         nurbs_host::show(relative * dt) + " per time-step, but skin is " + nurbs_host::show(neighbor->skin));
  if (relative * dt > found.radius)
    tell("time step way too large - particles relatively move further than the minimum radius in one step");
}

void FixCheckTimestepGranNurbs::report(double fraction, double limit, const char* time) {
  if (fraction > limit) tell("time-step is " + nurbs_host::show(100 * fraction) + " % of " + time + " time");
}

void FixCheckTimestepGranNurbs::tell(const std::string& message) {
  if (stops_)
    nurbs_host::fail_all(FLERR, lmp, "Fix check/timestep/gran (id " + std::string(id) + "): " + message);
  if (warns_) nurbs_host::warn(FLERR, lmp, message);
}

double FixCheckTimestepGranNurbs::compute_vector(int n) {
  return bodies() == nullptr ? FixCheckTimestepGran::compute_vector(n) : fractions_[n];
}

}  // namespace LAMMPS_NS

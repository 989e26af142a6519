// fix nve/nurbs. See fix_nve_nurbs.h.
//
// A step is: half kick of v and of the angular momentum L, drift of x and of the orientation at constant L,
// half kick.
#include "liggghts/fix_nve_nurbs.h"

#include <cmath>
#include <cstring>
#include <string>

#include "atom.h"
#include "liggghts/atom_vec_nurbs.h"
#include "liggghts/host_error.h"

namespace LAMMPS_NS {

using nurbs::RotationScheme;
using nurbs::Vec3;

namespace {

RotationScheme parse_scheme(LAMMPS* lmp, const std::string& name) {
  if (name == "symplectic") return RotationScheme::symplectic;
  if (name == "richardson") return RotationScheme::richardson;
  if (name == "exact") return RotationScheme::exact;
  nurbs_host::fail_all(FLERR, lmp,
                       "Fix nve/nurbs rotation " + name + " must be symplectic, richardson or exact");
}

}  // namespace

FixNVENurbs::FixNVENurbs(LAMMPS* lmp, int narg, char** arg) : FixNVE(lmp, narg, arg) {
  time_integrate = 1;
  AtomVecNurbs::require(lmp, "Fix nve/nurbs");
  for (int i = 3; i < narg; i += 2) {
    const std::string keyword = arg[i];
    if (keyword != "rotation")
      nurbs_host::fail_all(FLERR, lmp, "Fix nve/nurbs: unknown keyword " + keyword + "; allowed is rotation");
    if (i + 1 == narg)
      nurbs_host::fail_all(FLERR, lmp, "Fix nve/nurbs rotation needs one of symplectic, richardson, exact");
    scheme_ = parse_scheme(lmp, arg[i + 1]);
  }
}

void FixNVENurbs::init() {
  FixNVE::init();
  AtomVecNurbs::require(lmp, "Fix nve/nurbs");
}

int FixNVENurbs::group_count() const {
  return igroup == atom->firstgroup ? atom->nfirst : atom->nlocal;
}

// Half a step of force and torque on particle i's velocity and angular momentum; omega does not follow yet.
inline void FixNVENurbs::kick(AtomVecNurbs& bodies, int i) const {
  const double *f = atom->f[i], *torque = atom->torque[i], per_mass = dtf / atom->rmass[i];
  double* v = atom->v[i];
  for (int k = 0; k < 3; ++k) v[k] += per_mass * f[k];
  bodies.keep_momentum(i, bodies.angular_momentum(i) + dtf * Vec3(torque[0], torque[1], torque[2]));
}

// Does each(i) for every particle i of the group and then together(list, count) for all of them, in lists of
// one shape.
template <class Each, class Together>
void FixNVENurbs::sweep(Each each, Together together) {
  const auto& bodies = static_cast<const AtomVecNurbs&>(*atom->avec);
  waiting_.resize(bodies.shapes().count());
  const int n = group_count();
  for (int i = 0; i < n; ++i) {
    if (!(atom->mask[i] & groupbit)) continue;
    each(i);
    Waiting& waiting = waiting_[bodies.shape_number(i) - 1];
    waiting.list[waiting.count++] = i;
    if (waiting.count < nurbs::RotorBatch::kBodies) continue;
    together(waiting.list, waiting.count);
    waiting.count = 0;
  }
  for (Waiting& waiting : waiting_) {
    if (waiting.count > 0) together(waiting.list, waiting.count);
    waiting.count = 0;
  }
}

void FixNVENurbs::initial_integrate(int) {
  auto& bodies = static_cast<AtomVecNurbs&>(*atom->avec);
  sweep(
      [&](int i) {
        kick(bodies, i);
        for (int k = 0; k < 3; ++k) atom->x[i][k] += dtv * atom->v[i][k];
      },
      [&](const int* list, int count) { bodies.rotate(scheme_, list, count, dtv); });
}

void FixNVENurbs::final_integrate() {
  auto& bodies = static_cast<AtomVecNurbs&>(*atom->avec);
  sweep([&](int i) { kick(bodies, i); },
        [&](const int* list, int count) { bodies.update_omega(list, count); });
}

}  // namespace LAMMPS_NS

// See fix_insert_region_nurbs.h.
#include "liggghts/fix_insert_region_nurbs.h"

#include <mpi.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string>
#include <vector>

#include "atom.h"
#include "domain.h"
#include "fix_property_atom.h"
#include "liggghts/atom_vec_nurbs.h"
#include "liggghts/host_error.h"
#include "liggghts/nurbs_contact.h"
#include "modify.h"
#include "region.h"
#include "update.h"

namespace LAMMPS_NS {

namespace {

bool holds_nurbs(const Atom& atom) {
  return dynamic_cast<AtomVecNurbs*>(atom.avec) != nullptr;
}

// Ends the run when no particle of this bounding radius is in the region as a whole.
void require_room(LAMMPS* lmp, const Fix& fix, const Region& region, double radius) {
  const double extent[3] = {region.extent_xhi - region.extent_xlo, region.extent_yhi - region.extent_ylo,
                            region.extent_zhi - region.extent_zlo};
  for (int k = 0; k < 3; ++k)
    if (region.bboxflag && extent[k] < 2 * radius)
      nurbs_host::fail_all(FLERR, lmp,
                           nurbs_host::name_of(fix) + ": region " + region.id + " is " +
                               nurbs_host::show(extent[k]) + " long in " + "xyz"[k] +
                               ", too short for all_in yes and particles of bounding diameter " +
                               nurbs_host::show(2 * radius));
}

// Processors insert each in their own part of the region: warns where a part has no room for a particle of
// this bounding radius.
void warn_of_narrow_parts(LAMMPS* lmp, const Fix& fix, const Region& region, double radius) {
  const double low[3] = {region.extent_xlo, region.extent_ylo, region.extent_zlo};
  const double high[3] = {region.extent_xhi, region.extent_yhi, region.extent_zhi};
  double mine[3], shortest[3];
  bool empty = !region.bboxflag;
  for (int k = 0; k < 3; ++k) {
    mine[k] = std::min(high[k], lmp->domain->subhi[k]) - std::max(low[k], lmp->domain->sublo[k]);
    empty = empty || !(mine[k] > 0);
  }
  if (empty) std::fill(mine, mine + 3, 1e300);
  MPI_Allreduce(mine, shortest, 3, MPI_DOUBLE, MPI_MIN, lmp->world);
  for (int k = 0; k < 3; ++k)
    if (shortest[k] < 2 * radius)
      nurbs_host::warn(FLERR, lmp,
                       nurbs_host::name_of(fix) + ": a processor's part of region " + region.id + " is " +
                           nurbs_host::show(shortest[k]) + " long in " + "xyz"[k] +
                           ", too short for all_in yes and particles of bounding diameter " +
                           nurbs_host::show(2 * radius) +
                           "; it inserts none there. Use fewer processors along " + "xyz"[k] +
                           " (command 'processors')");
}

void check_room(LAMMPS* lmp, const Fix& fix, const Region& region, double radius) {
  require_room(lmp, fix, region, radius);
  warn_of_narrow_parts(lmp, fix, region, radius);
}

// Whether `orientation constant QW QX QY QZ` is among the words; the four are checked.
bool is_oriented(LAMMPS* lmp, const Fix& fix, int narg, char** arg) {
  if (!holds_nurbs(*lmp->atom)) return false;
  for (int k = 3; k + 1 < narg; ++k)
    if (std::strcmp(arg[k], "orientation") == 0 && std::strcmp(arg[k + 1], "constant") == 0) {
      if (k + 5 >= narg)
        nurbs_host::fail_all(FLERR, lmp,
                             nurbs_host::name_of(fix) + ": orientation constant needs QW QX QY QZ");
      nurbs_host::parse_quaternion(lmp, nurbs_host::name_of(fix) + ": orientation", arg + k + 2);
      return true;
    }
  return false;
}

}  // namespace

template <class Host>
OrientedInsert<Host>::OrientedInsert(LAMMPS* lmp, int narg, char** arg)
    : Host(lmp, narg, arg), oriented_(is_oriented(lmp, *this, narg, arg)) {}

template <class Host>
int OrientedInsert<Host>::calc_ninsert_this() {
  if (auto* bodies = dynamic_cast<AtomVecNurbs*>(this->atom->avec)) bodies->orient_insertion(oriented_);
  return Host::calc_ninsert_this();
}

template class OrientedInsert<FixInsertPack>;
template class OrientedInsert<FixInsertRateRegion>;
template class OrientedInsert<FixInsertStream>;

void FixInsertPackNurbs::calc_insertion_properties() {
  if (ins_region != nullptr && all_in_flag && holds_nurbs(*atom))
    check_room(lmp, *this, *ins_region, max_r_bound());
  FixInsertPack::calc_insertion_properties();
}

void FixInsertRateRegionNurbs::calc_insertion_properties() {
  if (ins_region != nullptr && all_in_flag && holds_nurbs(*atom))
    check_room(lmp, *this, *ins_region, max_r_bound());
  FixInsertRateRegion::calc_insertion_properties();
}

// For the time of the host's count every radius is that of the sphere of the particle's volume.
int FixInsertPackNurbs::calc_ninsert_this() {
  if (!holds_nurbs(*atom)) return OrientedInsert::calc_ninsert_this();
  std::vector<double> radius(atom->nlocal + 1);
  for (int i = 0; i < atom->nlocal; ++i)
    radius[i] = std::cbrt(3 * atom->rmass[i] / (4 * M_PI * atom->density[i]));
  double* const bounding = atom->radius;
  atom->radius = radius.data();
  const int count = OrientedInsert::calc_ninsert_this();
  atom->radius = bounding;
  return count;
}

// Particles behind the face keep the insertion velocity until their step of release, which a restart holds.
// The host scales what is left of it from the time step that there was to the present one: before the input
// script's `timestep` that is a default, often a thousandth, and they would fly on through all they meet.
void FixInsertStreamNurbs::post_create() {
  FixInsertStream::post_create();
  if (!holds_nurbs(*atom) || update->timestep_set || !modify->fix_restart_in_progress()) return;
  auto* release = dynamic_cast<FixPropertyAtom*>(
      modify->find_fix_property("release_fix_insert_stream", "property/atom", "vector", 5, 0, style, false));
  if (release == nullptr) return;
  int mine = 0, all = 0;
  for (int i = 0; i < atom->nlocal; ++i)
    mine += release->array_atom[i][4] > static_cast<double>(update->ntimestep);
  MPI_Allreduce(&mine, &all, 1, MPI_INT, MPI_SUM, world);
  if (all > 0)
    nurbs_host::fail_all(FLERR, lmp,
                         nurbs_host::name_of(*this) + ": " + std::to_string(all) +
                             " particles of the restart are on their way to the insertion face; give the "
                             "'timestep' before this fix");
}

}  // namespace LAMMPS_NS

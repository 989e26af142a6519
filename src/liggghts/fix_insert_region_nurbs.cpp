// See fix_insert_region_nurbs.h.
#include "liggghts/fix_insert_region_nurbs.h"

#include <cmath>
#include <string>
#include <vector>

#include "atom.h"
#include "liggghts/atom_vec_nurbs.h"
#include "liggghts/host_error.h"
#include "region.h"

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

}  // namespace

void FixInsertPackNurbs::calc_insertion_properties() {
  if (ins_region != nullptr && all_in_flag && holds_nurbs(*atom))
    require_room(lmp, *this, *ins_region, max_r_bound());
  FixInsertPack::calc_insertion_properties();
}

void FixInsertRateRegionNurbs::calc_insertion_properties() {
  if (ins_region != nullptr && all_in_flag && holds_nurbs(*atom))
    require_room(lmp, *this, *ins_region, max_r_bound());
  FixInsertRateRegion::calc_insertion_properties();
}

// For the time of the host's count every radius is that of the sphere of the particle's volume.
int FixInsertPackNurbs::calc_ninsert_this() {
  if (!holds_nurbs(*atom)) return FixInsertPack::calc_ninsert_this();
  std::vector<double> radius(atom->nlocal + 1);
  for (int i = 0; i < atom->nlocal; ++i)
    radius[i] = std::cbrt(3 * atom->rmass[i] / (4 * M_PI * atom->density[i]));
  double* const bounding = atom->radius;
  atom->radius = radius.data();
  const int count = FixInsertPack::calc_ninsert_this();
  atom->radius = bounding;
  return count;
}

}  // namespace LAMMPS_NS

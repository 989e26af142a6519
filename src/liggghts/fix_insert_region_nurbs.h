// fix insert/pack and insert/rate/region: the host's own under the host's names, with two things changed for
// NURBS particles. `volumefraction_region` counts the volume of those that are in the region already, where
// the host would count their bounding spheres'; and a region that holds none of them is refused in one line.
// fix insert/stream refuses to go on after a restart where the host would release its particles too late.
#ifdef FIX_CLASS

FixStyle(insert/pack,FixInsertPackNurbs) FixStyle(insert/rate/region,FixInsertRateRegionNurbs)
                                                      FixStyle(insert/stream,FixInsertStreamNurbs)

#else

#ifndef LMP_FIX_INSERT_REGION_NURBS_H
#define LMP_FIX_INSERT_REGION_NURBS_H

#include "fix_insert_pack.h"
#include "fix_insert_rate_region.h"
#include "fix_insert_stream.h"

namespace LAMMPS_NS {

class FixInsertPackNurbs : public FixInsertPack {
 public:
  FixInsertPackNurbs(LAMMPS* lmp, int narg, char** arg) : FixInsertPack(lmp, narg, arg) {}

 protected:
  void calc_insertion_properties() override;
  int calc_ninsert_this() override;
};

class FixInsertRateRegionNurbs : public FixInsertRateRegion {
 public:
  FixInsertRateRegionNurbs(LAMMPS* lmp, int narg, char** arg) : FixInsertRateRegion(lmp, narg, arg) {}

 protected:
  void calc_insertion_properties() override;
};

class FixInsertStreamNurbs : public FixInsertStream {
 public:
  FixInsertStreamNurbs(LAMMPS* lmp, int narg, char** arg) : FixInsertStream(lmp, narg, arg) {}
  void post_create() override;
};

}  // namespace LAMMPS_NS

#endif
#endif

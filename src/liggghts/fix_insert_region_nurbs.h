// fix insert/pack and insert/rate/region: the host's own under the host's names, with some things changed for
// NURBS particles. `volumefraction_region` counts the volume of those that are in the region already, where
// the host would count their bounding spheres'; and a region that holds none of them is refused in one line.
// fix insert/stream refuses to go on after a restart where the host would release its particles too late. And
// `orientation constant Q` is an orientation: it takes the place of a template's random one.
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

// One of the host's, that tells templates before it draws particles whether it orients them itself.
template <class Host>
class OrientedInsert : public Host {
 public:
  OrientedInsert(LAMMPS* lmp, int narg, char** arg);

 protected:
  int calc_ninsert_this() override;

 private:
  bool oriented_;  // `orientation constant` is given
};

class FixInsertPackNurbs : public OrientedInsert<FixInsertPack> {
 public:
  using OrientedInsert::OrientedInsert;

 protected:
  void calc_insertion_properties() override;
  int calc_ninsert_this() override;
};

class FixInsertRateRegionNurbs : public OrientedInsert<FixInsertRateRegion> {
 public:
  using OrientedInsert::OrientedInsert;

 protected:
  void calc_insertion_properties() override;
};

class FixInsertStreamNurbs : public OrientedInsert<FixInsertStream> {
 public:
  using OrientedInsert::OrientedInsert;
  void post_create() override;
};

}  // namespace LAMMPS_NS

#endif
#endif

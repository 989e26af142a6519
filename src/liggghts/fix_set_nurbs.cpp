// See fix_set_nurbs.h.
#include "liggghts/fix_set_nurbs.h"

#include <string>
#include <vector>

#include "atom.h"
#include "liggghts/body_setter.h"
#include "liggghts/host_error.h"

namespace LAMMPS_NS {

FixSetNurbs::FixSetNurbs(LAMMPS* lmp, int narg, char** arg) : Fix(lmp, narg, arg) {
  BodySetter setter(lmp, "Fix set/nurbs", "");
  if (narg < 4) nurbs_host::fail_all(FLERR, lmp, "Fix set/nurbs needs one of " + setter.words());
  std::vector<int> chosen;
  for (int i = 0; i < atom->nlocal; ++i)
    if (atom->mask[i] & groupbit) chosen.push_back(i);
  for (int k = 3; k < narg; k += setter.length(arg[k])) {
    if (setter.length(arg[k]) == 0)
      nurbs_host::fail_all(
          FLERR, lmp,
          std::string("Fix set/nurbs: unknown keyword ") + arg[k] + "; allowed are " + setter.words());
    setter.apply(narg - k, arg + k, chosen);
  }
}

}  // namespace LAMMPS_NS

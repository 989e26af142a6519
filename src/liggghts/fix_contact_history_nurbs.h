// fix contacthistory, as pair gran/nurbs needs it: the host's own (per-pair history across reneighbouring,
// ranks and restarts) under the host's name, with four things changed. It finds the pair style under a name
// other than "gran"; it keeps the history of neighbours that don't touch but have something to remember; its
// pages have room for a long history; and it carries the dissipated energy, so that restarts do. With another
// pair style it is the host's fix.
#ifdef FIX_CLASS

FixStyle(contacthistory,FixContactHistoryNurbs)

#else

#ifndef LMP_FIX_CONTACT_HISTORY_NURBS_H
#define LMP_FIX_CONTACT_HISTORY_NURBS_H

#include "fix_contact_history.h"
#include "laws/energy_ledger.h"

namespace LAMMPS_NS {

class FixContactHistoryNurbs : public FixContactHistory {
 public:
  FixContactHistoryNurbs(LAMMPS* lmp, int narg, char** arg) : FixContactHistory(lmp, narg, arg) {}

  void init() override;
  void pre_exchange() override;
  void setup_pre_exchange() override;
  void write_restart(FILE* file) override;
  void restart(char* buffer) override;

  // Dissipated by this rank's share of the pairs since the start (damping, friction).
  nurbs::EnergyLedger& dissipated() { return dissipated_; }

 protected:
  void allocate_pages() override;

 private:
  bool serves_nurbs() const;
  template <class Flag>
  void for_each_neighbour(Flag flag) const;

  nurbs::EnergyLedger dissipated_;
};

}  // namespace LAMMPS_NS

#endif
#endif

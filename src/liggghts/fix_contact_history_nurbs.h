// fix contacthistory, as pair gran/nurbs needs it: the host's own (per-pair history across reneighbouring,
// ranks and restarts) under the host's name, with six things changed. It finds the pair style under a name
// other than "gran"; it keeps the history of neighbours that don't touch but have something proven, the
// PairProof, which is all that the host's history holds, also where the bounding spheres are apart; the
// contacts of those that touch, which the pair style owns (scene/contact_pool.h), travel behind it; it
// carries the dissipated energy; and it outlives its pair style, for the next `pair_style gran/nurbs` to go
// on with. With another pair style it is the host's fix.
#ifdef FIX_CLASS

FixStyle(contacthistory,FixContactHistoryNurbs)

#else

#ifndef LMP_FIX_CONTACT_HISTORY_NURBS_H
#define LMP_FIX_CONTACT_HISTORY_NURBS_H

#include <cstdint>
#include <string>
#include <vector>

#include "fix_contact_history.h"
#include "laws/energy_ledger.h"
#include "scene/contact_pool.h"

namespace LAMMPS_NS {

class FixContactHistoryNurbs : public FixContactHistory {
 public:
  FixContactHistoryNurbs(LAMMPS* lmp, int narg, char** arg) : FixContactHistory(lmp, narg, arg) {}

  void init() override;
  void pre_exchange() override;
  void setup_pre_exchange() override;
  void post_run() override;
  int pack_exchange(int i, double* buffer) override;
  int unpack_exchange(int i, double* buffer) override;
  void write_restart(FILE* file) override;
  void restart(char* buffer) override;
  int pack_restart(int i, double* buffer) override;
  void unpack_restart(int i, int nth) override;
  int size_restart(int i) override;
  int maxsize_restart() override;
  // A pair style asks every fix, first thing when it begins: the host's would stop at this one.
  int n_history_extra() override;

  // The host wants type 1 in use, which it need not be where particles come later or are gone.
  int min_type() override { return 1; }
  int max_type() override { return 1; }

  // What owned particle i remembered of the particle `tag` when the neighbour lists were last made; the host
  // forgets it where the bounding spheres are apart. Nothing when it remembered nothing.
  void recall(int i, int tag, nurbs::PairProof* to) const;
  // The same where there may be several images of it: `way`, from A's centre to B's; no two images are closer
  // than `images_apart`.
  void recall(int i, int tag, const nurbs::Vec3& way, double images_apart, nurbs::PairProof* to) const;

  // What a pair style leaves to the next between two runs.
  struct Legacy {
    nurbs::ContactPool contacts;
    nurbs::EnergyLedger dissipated;
    std::uint64_t fingerprint = 0;
    std::string models;  // whose contacts they are
  };
  void bequeath(Legacy legacy);
  bool bequeathed() const { return orphaned_; }
  Legacy inherit();
  void forget_contacts();

  // `alive`: the IDs of all particles, ascending. What is remembered of others is forgotten; with `compress`
  // these get their places in the list, from 1, as IDs. Between runs.
  void follow_ids(const std::vector<int>& alive, bool compress);

 protected:
  void allocate_pages() override;

 private:
  class PairGranNurbs* pair() const;
  bool serves_nurbs() const { return pair() != nullptr; }
  template <class Flag>
  void for_each_neighbour(Flag flag) const;

  bool orphaned_ = false;  // the pair style is gone
  Legacy legacy_;

  nurbs::PairProof& proof(int i, int n) const;
  bool offset(std::int32_t contact, nurbs::Vec3* apart) const;
  nurbs::ContactPool& pool() const;
  void ask_for_room();
  int contacts_size(int i) const;
  int put_contacts(int i, double* buffer) const;
  int get_contacts(int i, const double* buffer);
};

}  // namespace LAMMPS_NS

#endif
#endif

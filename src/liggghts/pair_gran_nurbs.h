// pair_style gran/nurbs: contact forces between NURBS particles.
//   pair_style gran/nurbs [tolerance VALUE] [solver default|cso]
//   pair_coeff I J kn KN kt KT [cn CN] [ct CT] mu MU
// A PairGran, whose name contains "gran", so that host features made for granular pair styles find it.
#ifdef PAIR_CLASS

PairStyle(gran/nurbs,PairGranNurbs)

#else

#ifndef LMP_PAIR_GRAN_NURBS_H
#define LMP_PAIR_GRAN_NURBS_H

#include <optional>
#include <string>
#include <vector>

#include "liggghts/nurbs_contact.h"
#include "pair_gran.h"

namespace LAMMPS_NS {

class FixContactHistoryNurbs;

class PairGranNurbs : public PairGran {
 public:
  explicit PairGranNurbs(LAMMPS* lmp);

  // The pair style of `lmp`, or nullptr when it is another.
  static PairGranNurbs* find(LAMMPS* lmp);

  void settings(int narg, char** arg) override;
  void coeff(int narg, char** arg) override;
  void init_style() override;
  void reset_dt() override;

  void write_restart(FILE* file) override;
  void read_restart(FILE* file, const int major, const int minor) override;
  void write_restart_settings(FILE* file) override;
  void read_restart_settings(FILE* file, const int major, const int minor) override;

  bool contact_match(const std::string, const std::string) override { return false; }
  double stressStrainExponent() override { return 1; }
  int64_t hashcode() override { return 0x4e5552425331; }

  const nurbs::ContactSettings& contact_settings() const { return settings_; }
  // This rank's share, a pair across two ranks counting half on each.
  nurbs::EnergyLedger energy() const;
  const nurbs_host::ContactCounts& counts() const { return counts_; }
  // Appends the contacts of the last force evaluation between particles of a group; a pair across two ranks
  // is listed by the owner of the smaller tag.
  void append_rows(int groupbit, std::vector<nurbs_host::ContactRow>& rows) const;

 protected:
  void compute_force(int eflag, int vflag, int addflag) override;

 private:
  struct Neighbours;  // i, j of the host's list, and the same as A, B in tag order
  using Law = std::optional<nurbs::ContactCoefficients>;

  Law& law(int itype, int jtype) { return laws_[static_cast<size_t>(itype) * (ntypes_ + 1) + jtype]; }
  const Law& law(int itype, int jtype) const {
    return laws_[static_cast<size_t>(itype) * (ntypes_ + 1) + jtype];
  }
  void allocate_laws();
  void require_host_settings();
  void refuse_sphere_features();
  void require_all_laws();
  void warn_short_box();
  void warn_time_step();

  Neighbours order(int i, int j) const;
  template <class Visit>
  void for_each_neighbour(Visit visit) const;
  void keep_case(const Neighbours&);
  void compute_pair(const Neighbours& pair, int& touch, double* history);
  void apply(const Neighbours& pair, const nurbs::ContactCoefficients& law, const nurbs::ContactState& state);
  void keep_contact_force(const Neighbours& pair, const double* on_i, const double* on_j);
  void report_contacts();

  nurbs::ContactSettings settings_ = nurbs_host::contacts_only();
  bool case_kept_ = false;  // an unresolved pair was written
  int ntypes_ = 0;
  std::vector<Law> laws_;
  AtomVecNurbs* bodies_ = nullptr;
  FixContactHistoryNurbs* history_fix_ = nullptr;
  nurbs_host::ContactStep step_;
  nurbs::EnergyLedger stored_;
  nurbs_host::ContactCounts counts_;
  bool short_box_warned_ = false;
  nurbs_host::DeepContacts deep_;
  std::string last_warning_, last_deep_warning_;
};

}  // namespace LAMMPS_NS

#endif
#endif

// pair_style gran/nurbs: contact forces between NURBS particles.
//   pair_style gran/nurbs [tolerance VALUE] [solver default|cso]
//   pair_coeff I J kn KN kt KT [cn CN] [ct CT] mu MU
// or with the host's own contact models and its materials (host_models.h):
//   pair_style gran/nurbs [tolerance VALUE] [solver ..] [radius curvature|volume] model NORMAL [tangential T]
//   ... pair_coeff * *
// A PairGran, whose name contains "gran", so that host features made for granular pair styles find it.
#ifdef PAIR_CLASS

PairStyle(gran/nurbs,PairGranNurbs)

#else

#ifndef LMP_PAIR_GRAN_NURBS_H
#define LMP_PAIR_GRAN_NURBS_H

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "liggghts/host_models.h"
#include "liggghts/nurbs_contact.h"
#include "pair_gran.h"

namespace LAMMPS_NS {

class PairGranNurbs : public PairGran {
 public:
  explicit PairGranNurbs(LAMMPS* lmp);
  ~PairGranNurbs() override;

  // The pair style of `lmp`, or nullptr when it is another.
  static PairGranNurbs* find(LAMMPS* lmp);

  void settings(int narg, char** arg) override;
  void coeff(int narg, char** arg) override;
  void init_style() override;
  double init_one(int i, int j) override;
  void init_granular() override;
  void reset_dt() override;

  void write_restart(FILE* file) override;
  void read_restart(FILE* file, const int major, const int minor) override;
  void write_restart_settings(FILE* file) override;
  void read_restart_settings(FILE* file, const int major, const int minor) override;

  bool contact_match(const std::string kind, const std::string name) override {
    return models_ != nullptr && models_->matches(kind, name);
  }
  double stressStrainExponent() override { return models_ ? models_->stress_strain_exponent() : 1; }
  int64_t hashcode() override { return models_ ? models_->hashcode() : 0x4e5552425331; }

  // The host's contact models, or nullptr where the linear law serves.
  const nurbs_host::HostModels* models() const { return models_.get(); }

  const nurbs::ContactSettings& contact_settings() const { return settings_; }
  // This rank's share, a pair across two ranks counting half on each. Dissipation is counted while there is a
  // compute nurbs/energy.
  nurbs::EnergyLedger energy() const { return stages_.stored().add(stages_.dissipated(), 1); }
  const nurbs_host::ContactCounts& counts() const { return stages_.counts(); }
  // Appends the contacts of the last force evaluation between particles of a group; a pair across two ranks
  // is listed by the owner of the smaller tag.
  void append_rows(int groupbit, std::vector<nurbs_host::ContactRow>& rows) const;

  // Adds to count[i] the particles that owned particle i touched at the last force evaluation.
  void count_contacts(double* count) const;

  // The contacts themselves, for fix contacthistory, which carries them across ranks and restarts.
  nurbs::ContactStages& stages() { return stages_; }

  // For fix contacthistory, at the end of a run, and for walls: whether somebody has changed since then how
  // bodies move or what they are made of, so that forces at the start of the next run are not those of the
  // end of the last. `as_at_end`: that nobody has yet. Collective.
  void end_run() { fingerprint_ = fingerprint(); }
  // The same for restarts, which may be written within a run. Collective.
  std::uint64_t last_fingerprint() const;
  void go_on_from(std::uint64_t fingerprint) { fingerprint_ = fingerprint; }
  void warn_deep_run();
  bool as_at_end() const { return fingerprint_ != 0 && fingerprint() == fingerprint_; }
  bool changed() const { return changed_; }

  double memory_usage() override { return static_cast<double>(stages_.bytes() + bodies_->bodies().bytes()); }

 protected:
  void compute_force(int eflag, int vflag, int addflag) override;

 private:
  using Law = std::optional<nurbs::ContactCoefficients>;

  Law& law(int itype, int jtype) { return laws_[static_cast<size_t>(itype) * (ntypes_ + 1) + jtype]; }
  const Law& law(int itype, int jtype) const {
    return laws_[static_cast<size_t>(itype) * (ntypes_ + 1) + jtype];
  }
  void set_models(std::unique_ptr<nurbs_host::HostModels> models);
  void allocate_laws();
  std::string layout() const { return models_ ? "model " + models_->layout() : ""; }
  void go_on_with_contacts();
  void require_alone();
  void require_host_settings();
  void warn_of_sphere_values();
  void require_all_laws();
  bool is_swapped(int i, int j) const;
  void recall_images(int i, double images_apart);
  void warn_time_step();

  std::uint64_t fingerprint() const;
  void hand_in_neighbours();
  void add_forces();
  void keep_case();
  void tally(const nurbs::ContactView& contact);
  void keep_contact_force(const nurbs::ContactView& contact, const double* on_a, const double* on_b);
  void report_contacts();

  nurbs::ContactSettings settings_ = nurbs_host::contacts_only();
  bool case_kept_ = false;  // an unresolved pair was written
  int ntypes_ = 0;
  std::vector<Law> laws_;
  std::vector<nurbs::ContactCoefficients> law_table_;  // laws_, all of them given
  std::unique_ptr<nurbs_host::HostModels> models_;     // instead of these
  AtomVecNurbs* bodies_ = nullptr;
  nurbs::ContactStages stages_;
  bool ledger_ = false;
  std::uint64_t fingerprint_ = 0;  // at the end of the last run, 0 before the first
  bool changed_ = false;
  bigint checked_particles_ = 0;  // when the time step was last checked
  int last_tag_ = 0;              // the largest one then
  std::string last_warning_, last_deep_warning_, last_sphere_warning_;
};

}  // namespace LAMMPS_NS

#endif
#endif

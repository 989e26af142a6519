// fix wall/nurbs: an immobile plane for NURBS particles, with the force law of pair gran/nurbs.
//   fix ID group wall/nurbs plane PX PY PZ NX NY NZ kn KN kt KT [cn CN] [ct CT] mu MU
// or with the host's contact models (host_models.h) and atom type T for the wall's material:
//   fix ID group wall/nurbs plane PX PY PZ NX NY NZ type T [radius curvature|volume] model NORMAL [tangential
//   T] ...
// The normal points to the particles. Scalar: elastic energy. Vector: force of the particles on the wall
// (1-3) and its torque about P (4-6).
#ifdef FIX_CLASS

FixStyle(wall/nurbs,FixWallNurbs)

#else

#ifndef LMP_FIX_WALL_NURBS_H
#define LMP_FIX_WALL_NURBS_H

#include <memory>
#include <string>
#include <vector>

#include "fix.h"
#include "liggghts/host_models.h"
#include "liggghts/nurbs_contact.h"

namespace LAMMPS_NS {

class FixWallNurbs : public Fix {
 public:
  FixWallNurbs(LAMMPS* lmp, int narg, char** arg);
  ~FixWallNurbs() override;

  // The walls of `lmp`, in the order of the input script.
  static std::vector<FixWallNurbs*> all(LAMMPS* lmp);

  int setmask() override;
  void init() override;
  void setup(int vflag) override;
  void post_force(int vflag) override;
  void reset_dt() override { warn_time_step(); }
  double compute_scalar() override;
  double compute_vector(int n) override;

  void grow_arrays(int n) override;
  void copy_arrays(int from, int to, int delflag) override;
  void set_arrays(int i) override;
  int pack_exchange(int i, double* buffer) override;
  int unpack_exchange(int i, double* buffer) override;
  void write_restart(FILE* file) override;
  void restart(char* buffer) override;
  int pack_restart(int i, double* buffer) override;
  void unpack_restart(int i, int nth) override;
  int size_restart(int i) override;
  int maxsize_restart() override { return 1 + nurbs::kProofSize + nurbs::kMostContactSize; }
  double memory_usage() override;

  // This rank's share. Dissipation is counted while there is a compute nurbs/energy.
  nurbs::EnergyLedger energy() const { return stages_.stored().add(stages_.dissipated(), 1); }
  const nurbs_host::HostModels* models() const { return models_.get(); }
  const nurbs_host::ContactCounts& counts() const { return stages_.counts(); }
  void append_rows(int groupbit, std::vector<nurbs_host::ContactRow>& rows) const;

 private:
  void parse_plane(int narg, char** arg);
  void parse_law(int first, int narg, char** arg);
  nurbs::PairProof& proof(int i) const { return *reinterpret_cast<nurbs::PairProof*>(proofs_[i]); }
  void hand_in_neighbours();
  void warn_periodic();
  void warn_time_step();

  nurbs::Vec3 origin_ = nurbs::Vec3::Zero(), normal_ = nurbs::Vec3::UnitZ();
  nurbs::ContactCoefficients law_;                  // or ...
  std::unique_ptr<nurbs_host::HostModels> models_;  // ... the host's models
  nurbs::ContactSettings settings_ = nurbs_host::contacts_only();
  AtomVecNurbs* bodies_ = nullptr;
  int freeze_groupbit_ = 0;
  double** proofs_ = nullptr;  // a PairProof per owned particle
  nurbs::ContactStages stages_;
  nurbs::BodyRecord wall_{};
  bool ledger_ = false;
  bool periodic_warned_ = false;
  std::string last_warning_, last_deep_warning_;
};

}  // namespace LAMMPS_NS

#endif
#endif

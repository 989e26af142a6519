// The host's own contact models (hertz, hooke, ..., history, sjkr, cdt, epsd, ...) on contacts of NURBS
// bodies: its compiled classes with its `fix property/global` materials, shown two spheres that touch as the
// bodies do (laws/contact_model.h). Used by pair gran/nurbs and fix wall/nurbs.
//   [radius curvature|volume] model NORMAL [tangential T] [cohesion C] [rolling_friction R] [settings of
//   these]
#ifndef LMP_NURBS_HOST_MODELS_H
#define LMP_NURBS_HOST_MODELS_H

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "laws/contact_model.h"
#include "pointers.h"

namespace LAMMPS_NS::nurbs_host {

class HostModels : public nurbs::ContactModel {
 public:
  // Whether these words name host models rather than coefficients: they begin with `model` or `radius`.
  static bool named_by(int narg, char** arg);
  // From all of arg[0..narg); `user` opens the error messages. `wall_type` is a wall's atom type, 0 for
  // pairs. Ends the run when a word is unknown, out of order or asks for what NURBS bodies can't give.
  // Collective.
  HostModels(LAMMPS* lmp, const std::string& user, int wall_type, int narg, char** arg);
  // The same from text(), as a restart has it.
  HostModels(LAMMPS* lmp, const std::string& user, int wall_type, const std::string& text);
  ~HostModels() override;

  // Connects the models with the materials; the host forgets these at every init. Ends the run, in the host's
  // words, when one is missing. Collective.
  void init();

  // The words, for restarts.
  const std::string& text() const { return text_; }
  // Names of the history values: the same names, the same history.
  std::string layout() const;
  // As the host's own pair style answers.
  bool matches(const std::string& kind, const std::string& name) const;
  // The name behind model, tangential, cohesion or rolling_friction, or empty.
  std::string named(const std::string& kind) const;
  std::int64_t hashcode() const;
  double stress_strain_exponent() const;
  // What compute nurbs/energy can't know of these models, empty if nothing.
  std::string unknown_energies() const;

  int history_size() const override;
  double kind() const override { return kind_; }
  void force(nurbs::ModelContact& contact) const override;
  bool volume_radius() const override { return volume_radius_; }

 private:
  class Combination;
  void build(int narg, char** arg);

  LAMMPS* lmp_;
  std::string user_;
  int wall_type_;
  bool volume_radius_ = false;
  std::string text_;
  double kind_ = 0;  // of the layout
  std::unique_ptr<Combination> models_;
};

}  // namespace LAMMPS_NS::nurbs_host

#endif

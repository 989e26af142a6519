// fix check/timestep/gran, as the host's, for NURBS particles with the host's contact models: the host's own
// fix wants the pair style gran and takes every particle for its bounding sphere. Same words, same output.
// With another atom style it is the host's fix.
//   Rayleigh: pi r sqrt(density / G) / (0.1631 nu + 0.8766), r the radius of the largest sphere about the
//   centre of
//     mass inside the body.
//   Hertz: 2.87 (m^2 / (R E^2 v))^(1/5), m the particle's mass, R half its bounding radius, v the largest
//   relative
//     velocity (as the host takes a sphere against itself).
#ifdef FIX_CLASS

FixStyle(check/timestep/gran,FixCheckTimestepGranNurbs)

#else

#ifndef LMP_FIX_CHECK_TIMESTEP_GRAN_NURBS_H
#define LMP_FIX_CHECK_TIMESTEP_GRAN_NURBS_H

#include <string>
#include <vector>

#include "fix_check_timestep_gran.h"

namespace LAMMPS_NS {

class FixCheckTimestepGranNurbs : public FixCheckTimestepGran {
 public:
  FixCheckTimestepGranNurbs(LAMMPS* lmp, int narg, char** arg);

  void init() override;
  void end_of_step() override;
  double compute_vector(int n) override;

 private:
  struct Extremes {
    double rayleigh = 1e300, hertz = 1e300;  // times; hertz but for the velocity
    double radius = 1e300, speed = 0;        // of particles; the largest speed squared
  };
  class AtomVecNurbs* bodies() const;
  Extremes extremes() const;
  double mesh_speed() const;
  void report(double fraction, double limit, const char* time);
  void tell(const std::string& message);

  double rayleigh_limit_ = 0, hertz_limit_ = 0, least_speed_ = 0;
  bool warns_ = true, stops_ = false;
  double fractions_[3] = {0, 0, 0};  // Rayleigh, Hertz, skin
  class FixPropertyGlobal *young_ = nullptr, *poisson_ = nullptr;
};

}  // namespace LAMMPS_NS

#endif
#endif

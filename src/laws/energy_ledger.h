// The energy a set of contacts holds and has dissipated. Kinetic energy + gravity + springs + dissipated is
// constant up to the square of the time step (design, section 4).
#pragma once

namespace nurbs {

struct EnergyLedger {
  double normal_spring = 0;      // kn overlap^2 / 2, at this step
  double tangential_spring = 0;  // kt |spring|^2 / 2, at this step
  double damping = 0;            // dissipated by cn and ct since the start
  double friction = 0;           // dissipated by sliding since the start

  double elastic() const { return normal_spring + tangential_spring; }

  EnergyLedger& add(const EnergyLedger& other, double weight) {
    normal_spring += weight * other.normal_spring;
    tangential_spring += weight * other.tangential_spring;
    damping += weight * other.damping;
    friction += weight * other.friction;
    return *this;
  }
};

}  // namespace nurbs

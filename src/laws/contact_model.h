// A force law that the core does not have: the host's own contact models (liggghts/host_models.h), asked
// contact by contact where the linear law serves eight at a time.
//
// It sees two spheres that touch as the bodies do (contact/effective_radius.h) and velocities at the true
// contact point, and its force acts there. What is remembered of a contact lies beside the contact:
// ModelMemory, then the model's own numbers; all zeros where a contact begins.
#pragma once

#include "laws/contact_law.h"

namespace nurbs {

// Of every contact of a model; plain doubles.
struct ModelMemory {
  double kind;                      // of the model whose numbers follow
  double curvature_a, curvature_b;  // of the equivalent spheres, 1 / length; both 0: not yet known
  double phase;  // since the contact began, of an oscillator with its mass and stiffness, rad
  double normal_energy, tangential_energy;  // in the springs
  double torque[3];                         // beside that of the force, on B, lab axes
};
constexpr int kModelMemory = sizeof(ModelMemory) / sizeof(double);
constexpr int kMostModelMemory = 40;  // doubles of a contact, the model's own included

struct ModelContact {
  // What the model is asked.
  int a, b;     // bodies; a < 0: a wall
  Vec3 normal;  // unit, from A to B
  double overlap;
  double radius_a, radius_b;  // of the equivalent spheres; radius_a is 0 at walls
  Vec3 velocity, spin;        // of B relative to A, the velocity at the contact point
  double mass_a, mass_b;
  double mass;      // reduced; a body that nothing moves counts as infinitely heavy
  bool moves_on;    // a time step has passed, history goes on; else only the force is wanted
  double* history;  // the model's own numbers

  // What it answers, for the whole stiffness.
  Vec3 force = Vec3::Zero();   // on B, at the contact point
  Vec3 torque = Vec3::Zero();  // on B, beside that of the force; A gets the opposite
  double stiffness = 0;        // normal, force / length
  double normal_energy = 0, tangential_energy = 0;
  double elastic_energy = 0;  // the normal one without what pulls; 0 of models that don't tell
  bool slides = false;
};

class ContactModel {
 public:
  virtual ~ContactModel() = default;
  // The model's own numbers of a contact: at most kMostModelMemory - kModelMemory.
  virtual int history_size() const = 0;
  // A whole number that tells models with different numbers apart.
  virtual double kind() const = 0;
  virtual void force(ModelContact& contact) const = 0;
  // The equivalent spheres have the bodies' volumes instead of their curvatures.
  virtual bool volume_radius() const = 0;
};

}  // namespace nurbs

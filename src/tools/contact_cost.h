// What a contact between two copies of a body costs on this machine.
#pragma once

#include <string>

#include "body/shape.h"

namespace nurbs {

struct ContactCost {   // ns, medians over pairs of random orientation that overlap by 1e-4 of the radius
  double resting = 0;  // bodies that do not move
  double turning = 0;  // ... that turn by 1 mrad a step
  double cold = 0;     // ... that were not neighbours before
  int unresolved = 0;  // of the cold pairs
};

// Some tenths of a second, less for round bodies.
ContactCost measure_contact_cost(const Shape& shape);

// In a word: what such bodies cost beside others.
std::string cost_class(const ContactCost& cost);

}  // namespace nurbs

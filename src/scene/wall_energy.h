// What flat_stage.cpp and wall_energy.cpp agree on: how contacts that hand over to each other come back to
// their own stiffness.
#pragma once

#include "scene/contact_stages.h"

namespace nurbs {

// Of its distance to 1 that a factor moves in a step, and of a wall's shift: a corner that has come down flat
// is up to four times too stiff, and the spring energy that it gives up is booked. Contacts wait for it until
// they rest: what raising a factor puts in is booked too, and is then no more than the springs hold under the
// bodies' weight.
constexpr double kRelaxation = 2e-3;
constexpr double kResting = 1e-4;  // of its overlap that a contact at rest moves along the normal in a step
constexpr double kStiffest = 8;    // factor or weight of a contact; four is what a corner needs
constexpr double kSoftest = 1e-3;  // weight of one whose polygon held nothing over its part of a mesh's
                                   // plane, beside which the body's deepest point may lie

// A contact of a body in the balance.
struct ContactStages::Holding {
  std::int32_t number = 0;
  bool begins = false;       // with this piece of the wall, at a finite overlap
  bool negative = false;     // takes others off
  ContactGeometry geometry;  // before the wall stands back
  double unit = 0;           // energy without shift, at weight 1
  double energy = 0;         // as it is
  double target = 0;
};

}  // namespace nurbs

// Bodies that tumble about each other or on a plane for many steps, the memory kept from step to step, and
// every answer judged by supports that share nothing with the solver: closed forms, or samples of the surface
// drawn together about the highest.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "contact/contact.h"
#include "support/random.h"
#include "support/solids.h"

namespace nurbs::sequences {

// A body with its truth.
struct Actor {
  std::string name;
  test::Solid solid;
  double accuracy = 2e-14;  // of the support function, over the bounding radius
  int every = 1;            // steps between two that are judged: closed forms are cheap
};

// Cones, cylinders, capsules, lenses, polyhedra, tablets, rounded boxes, eggs, boxes, ellipsoids; and those
// whose supports are sampled: pebbles, a grain, blocky bodies. Made once.
const std::vector<Actor>& all_actors();

struct Report {
  long steps = 0, judged = 0, touching = 0;
  long unresolved = 0, wrong = 0, bracket = 0;  // wrong: the gap, its sign, the normal or the points
  double worst = 0;                             // error of the gap over what is allowed
  std::string first;                            // failure, in words
  long failed() const { return unresolved + wrong + bracket; }
};

// `a` and `b` for `steps` steps. Turns a step: 1e-7 to 0.3 rad, in spells; gaps from a tenth of the smaller
// body to the same overlap, passing zero again and again, and now and then a jump. Apart, the gap is right by
// construction: two supports face each other. Overlapping, p(normal) = -gap and no other direction looked at
// has less overlap: hundreds near the normal and flat faces' at every judged step, thousands at some.
Report run_pair(const Actor& a, const Actor& b, std::uint64_t seed, long steps);

// `a` on a plane, likewise: the truth is its support.
Report run_plane(const Actor& a, std::uint64_t seed, long steps);

}  // namespace nurbs::sequences

// The failure table's families of bodies that are no smooth ovals: cones, cylinders, capsules, lenses,
// polyhedra of degenerate patches, bodies of very different sizes, dents too narrow for samples, and balls'
// parts about one centre, with truths from closed forms.
#pragma once

#include <vector>

#include "support/families.h"
#include "support/solids.h"

namespace nurbs::families {

// A dozen bodies of each kind, made once.
enum class Kind { cone, cylinder, capsule, lens, polyhedron };
constexpr int kKinds = 5;
const std::vector<test::Solid>& solids_of(Kind kind);
// One of them, of any kind.
const test::Solid& any_solid(test::Random& random);

const std::vector<Family>& solid_families();

}  // namespace nurbs::families

// The bodies that the benchmarks share.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "body/shape.h"
#include "support/pairs.h"
#include "support/reference.h"

namespace nurbs::bench {

using test::make_reference;
using test::Pair;
using test::Random;
using test::Reference;

struct Body {
  std::string name;   // as in the CSV files
  std::string about;  // one phrase for legends
  std::shared_ptr<const Shape> shape;
  Vec3 semi_axes = Vec3::Zero();  // of an exact ellipsoid, zero for any other body
};

// Exact ellipsoid 1 : 0.8 : 0.6 (biquartic rational), pebble (bicubic), blocky superellipsoid of exponent 4
// (bicubic, 54 pieces) and disc 10 : 1 (exact ellipsoid 1 : 1 : 0.1), the ellipsoids' closed forms unused.
// Built once, about a second.
const std::vector<Body>& smooth_bodies();
// The first of them with its closed form.
const Body& closed_ellipsoid();

}  // namespace nurbs::bench

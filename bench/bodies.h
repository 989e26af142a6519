// The bodies that benchmarks and the failure table share, and random placements of pairs of them.
#pragma once

#include <memory>
#include <random>
#include <string>
#include <vector>

#include "body/shape.h"
#include "contact/contact.h"

namespace nurbs::bench {

struct Body {
  std::string name;   // as in the CSV files
  std::string about;  // one phrase for legends
  std::shared_ptr<const Shape> shape;
  Vec3 semi_axes = Vec3::Zero();  // of an exact ellipsoid, zero for any other body
};

// Exact ellipsoid 1 : 0.8 : 0.6 (biquartic rational), pebble (bicubic), blocky superellipsoid of exponent 4
// (bicubic, 54 pieces) and disc 10 : 1 (exact ellipsoid 1 : 1 : 0.1). Built once, about a second.
const std::vector<Body>& smooth_bodies();

class Random {
 public:
  explicit Random(unsigned seed) : engine_(seed) {}
  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  Vec3 direction();  // unit, isotropic
  Quat turn();       // uniform over rotations

 private:
  std::mt19937_64 engine_;
};

struct Pair {
  Particle a, b;
};

// Two particles of one shape, orientations random, scales 1 and 0.8 to 1.25, with gap `gap` (< 0: overlap)
// times the smaller bounding radius. Exact up to round-off when the contact is the only one (shallow overlap
// of a smooth body).
Pair random_pair(Random& random, const Shape& shape, double gap);

// The same pair over `steps` time steps: either body turns by `angle` a step about its own fixed random axis,
// and B is shifted along the normal so that the gap stays what it was. Element 0 is `start`.
std::vector<Pair> tumble(Random& random, const Pair& start, double angle, int steps);

}  // namespace nurbs::bench

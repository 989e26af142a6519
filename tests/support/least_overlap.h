// The least overlap of two bodies by a search over directions, knowing nothing but p(d).
#pragma once

#include <functional>
#include <vector>

#include "support/random.h"

namespace nurbs::test {

// Unit directions spread evenly over the sphere.
const std::vector<Vec3>& spiral(int count);
// d, and four each about 1e-9, 1e-8, .. beside it, below `widest` (rad, but for large ones).
std::vector<Vec3> starts_beside(const Vec3& d, double widest, Random& random);

// A compass that turns at random: it moves to the best of four directions a stride (rad) away.
struct Compass {
  int minima = 8;           // of the best starts, those in one basin counted once, that are followed
  double one_basin = 0.99;  // cosine
  double stride = 0.05;     // the first ...
  double finest = 1e-12;    // ... and the last
  double longer = 1.5, shorter = 0.7;  // its factors after a move and without one
  int moves = 600;                     // at most
};

// The least p found from `starts`, unit: what can be found is no proof, but the minimum is not above it.
// `random` is a copy: how much a search draws depends on the last digits, and what its caller draws next must
// not.
double least_overlap(const std::function<double(const Vec3&)>& p, const std::vector<Vec3>& starts,
                     const Compass& compass, Random random);

}  // namespace nurbs::test

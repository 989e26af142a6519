// Seeded random numbers for tests and benchmarks: the same on every machine with this standard library. (The
// numbers are drawn one by one, since arguments of a call are evaluated in any order.)
#pragma once

#include <cmath>
#include <cstdint>
#include <random>

#include "nurbs/types.h"

namespace nurbs::test {

class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}

  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  double log_uniform(double low, double high) { return std::exp(uniform(std::log(low), std::log(high))); }
  // A whole number, both ends included.
  int whole(int low, int high) { return std::uniform_int_distribution<int>(low, high)(engine_); }
  int below(int n) { return whole(0, n - 1); }
  double sign() { return below(2) ? 1 : -1; }

  // Uniform in a box.
  Vec3 box(double low, double high) {
    const double x = uniform(low, high), y = uniform(low, high), z = uniform(low, high);
    return Vec3(x, y, z);
  }
  // Normally distributed components.
  Vec3 vector() {
    std::normal_distribution<double> normal;
    const double x = normal(engine_), y = normal(engine_), z = normal(engine_);
    return Vec3(x, y, z);
  }
  // Unit, isotropic.
  Vec3 direction() { return vector().normalized(); }
  // Uniform over rotations.
  Quat turn() {
    std::normal_distribution<double> normal;
    const double w = normal(engine_), x = normal(engine_), y = normal(engine_), z = normal(engine_);
    return Quat(w, x, y, z).normalized();
  }
  // Turn by `angle` about a random axis.
  Quat turn_by(double angle) { return Quat(Eigen::AngleAxisd(angle, direction())); }

  // For the standard library's own algorithms.
  std::mt19937_64& engine() { return engine_; }

 private:
  std::mt19937_64 engine_;
};

}  // namespace nurbs::test

// Rotation of many rigid bodies. See rotor.h.
#include "motion/rotor.h"

#include <algorithm>
#include <cmath>

#include "motion/rotor_kernel.h"

namespace nurbs {
namespace {

#ifdef __AVX512F__
using Lane = Lane8;
#else
using Lane = Lane4;
#endif
constexpr int kLanes = sizeof(Lane) / sizeof(double);

constexpr double kEqual = 1e-13;  // relative; the moments of a shape are good to some 1e-15

bool equal(double a, double b) {
  return std::abs(a - b) <= kEqual * std::max(a, b);
}

// Index of the intermediate of three values no two of which are equal.
int intermediate(const Vec3& value) {
  for (int i = 0; i < 3; ++i) {
    const double next = value[(i + 1) % 3], last = value[(i + 2) % 3];
    if ((value[i] - next) * (value[i] - last) < 0) return i;
  }
  return 0;
}

}  // namespace

HalfTurn<double> half_turn_any(double square) {
  const double x = std::sqrt(square);
  return {std::cos(x), std::sin(x) / x};
}

Rotor make_rotor(const Vec3& moments, const Quat& principal_axes) {
  Rotor rotor;
  rotor.kind = Rotor::Kind::asymmetric;
  int middle = intermediate(moments);
  for (int odd = 0; odd < 3; ++odd) {
    const double next = moments[(odd + 1) % 3], last = moments[(odd + 2) % 3];
    if (!equal(next, last)) continue;
    const bool all = equal(moments[odd], next) && equal(moments[odd], last);
    rotor.kind = all ? Rotor::Kind::sphere : Rotor::Kind::top;
    middle = (odd + 1) % 3;  // the axis that is not like the others comes second
    break;
  }
  const int first = (middle + 1) % 3, second = (middle + 2) % 3;
  rotor.middle = 1 / moments[middle];
  if (rotor.kind == Rotor::Kind::asymmetric) rotor.first = 1 / moments[first] - rotor.middle;
  if (rotor.kind != Rotor::Kind::sphere) rotor.second = 1 / moments[second] - rotor.middle;
  const Mat3 axes = principal_axes.toRotationMatrix();
  rotor.axes << axes.col(first), axes.col(second), axes.col(middle);
  return rotor;
}

RotorBatch::RotorBatch() {
  for (int lane = 0; lane < kBodies; ++lane) {
    set_q(lane, Quat::Identity());
    set_momentum(lane, Vec3::Zero());
    for (auto& component : velocity) component[lane] = 0;
    inverse_size[lane] = 1;
  }
}

void RotorBatch::set_q(int lane, const Quat& to) {
  q[0][lane] = to.w();
  for (int k = 0; k < 3; ++k) q[k + 1][lane] = to.vec()[k];
}

void RotorBatch::set_momentum(int lane, const Vec3& to) {
  for (int k = 0; k < 3; ++k) momentum[k][lane] = to[k];
}

void drift(const Rotor& rotor, double dt, RotorBatch* batch) {
  for (int lane = 0; lane < RotorBatch::kBodies; lane += kLanes)
    rotor_kernel::drift<Lane>(rotor, dt, batch, lane);
}

void find_angular_velocity(const Rotor& rotor, RotorBatch* batch) {
  for (int lane = 0; lane < RotorBatch::kBodies; lane += kLanes)
    rotor_kernel::find_angular_velocity<Lane>(rotor, batch, lane);
}

}  // namespace nurbs

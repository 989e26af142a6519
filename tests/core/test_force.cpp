// Forces to the tolerance: what a law makes of overlap and normal, against closed forms and contacts polished
// in long double, on every rung of the ladder.
#include <gtest/gtest.h>

#include <array>
#include <map>

#include "contact/pair_search.h"
#include "nurbs/tolerances.h"
#include "support/bodies.h"
#include "support/pairs.h"
#include "support/random.h"
#include "support/reference.h"

namespace nurbs::test_force {
namespace {

using namespace test;

constexpr double kFew = 3;  // times the tolerance that a force may be off by
constexpr int kPaths = 12, kSteps = 20;

struct Exact {
  double overlap;
  Vec3 normal;
  bool known;
};

Exact exact_contact(const Pair& pair) {
  if (pair.a.shape == sphere().get() && pair.b.shape == sphere().get()) {
    const Vec3 offset = pair.b.x - pair.a.x;
    return {pair.a.scale + pair.b.scale - offset.norm(), offset.normalized(), true};
  }
  const Reference r = make_reference({pair.a, pair.b});
  return {-r.gap, r.normal, r.polished};
}

// A pair whose bodies turn about fixed axes, overlapping by the same all the way.
std::vector<Pair> path(Random& random, const Shape& shape, double overlap, double turn) {
  std::vector<Pair> path{random_pair(random, shape, shape, -overlap)};
  const Vec3 axis_a = random.direction(), axis_b = random.direction();
  for (int k = 1; k < kSteps; ++k) {
    Pair pair = path.back();
    pair.a.q = (Quat(Eigen::AngleAxisd(turn, axis_a)) * pair.a.q).normalized();
    pair.b.q = (Quat(Eigen::AngleAxisd(0.7 * turn, axis_b)) * pair.b.q).normalized();
    const Exact now = exact_contact(pair);
    pair.b.x += (now.overlap - overlap) * now.normal;
    path.push_back(pair);
  }
  return path;
}

class Forces : public testing::TestWithParam<double> {};

// Linear and Hertz's: off by a few times the tolerance of themselves, of the force at an overlap of
// kForceDepth when they are smaller.
TEST_P(Forces, are_right_to_the_tolerance_on_every_rung) {
  const double tolerance = GetParam();
  std::map<Rung, int> seen;
  ContactSettings settings;
  settings.tolerance = tolerance;
  settings.reach = 0;
  for (const ShapePointer& shape : {sphere(), ellipsoid(), closed_ellipsoid(), smooth_pebble(), disc()}) {
    Random random(31);
    std::map<Rung, double> worst;
    for (const double turn : {1e-5, 1e-4, 2e-3, 2e-2})
      for (int k = 0; k < kPaths; ++k) {
        std::array<double, kPairMemorySize> memory{};
        const bool cold = k % 3 == 0;
        for (const Pair& pair : path(random, *shape, std::pow(10, random.uniform(-5, -2)), turn)) {
          if (cold) memory = {};
          const Exact exact = exact_contact(pair);
          const ContactResult r = find_contact(pair.a, pair.b, settings, memory.data());
          ASSERT_EQ(r.status, Status::converged);
          if (!exact.known || !(exact.overlap > 0)) continue;
          ++seen[r.rung];
          const double size = shape->bounding_radius * std::min(pair.a.scale, pair.b.scale);
          const double scale = std::max(exact.overlap, kForceDepth * size);
          const double overlap = std::max(-r.gap, 0.0);
          const double linear = (overlap * r.normal - exact.overlap * exact.normal).norm() / scale;
          const double hertz =
              (std::pow(overlap, 1.5) * r.normal - std::pow(exact.overlap, 1.5) * exact.normal).norm() /
              std::pow(scale, 1.5);
          worst[r.rung] = std::max({worst[r.rung], linear / tolerance, hertz / 1.5 / tolerance});
          ASSERT_LE((r.normal - exact.normal).norm(), kFew * tolerance)
              << shape->name << " turning " << turn << " rung " << int(r.rung);
          ASSERT_LE(linear, kFew * tolerance)
              << shape->name << " turning " << turn << " rung " << int(r.rung);
          ASSERT_LE(hertz, 1.5 * kFew * tolerance)
              << shape->name << " turning " << turn << " rung " << int(r.rung);
        }
      }
    for (const auto& [rung, error] : worst)
      RecordProperty(shape->name + "_rung_" + std::to_string(int(rung)), std::to_string(error));
  }
  for (const Rung rung : {Rung::local_model, Rung::warm, Rung::cold})
    EXPECT_GT(seen[rung], 100) << "rung " << int(rung);
}

INSTANTIATE_TEST_SUITE_P(Tolerances, Forces, testing::Values(1e-4, 1e-6, 1e-9));

}  // namespace
}  // namespace nurbs::test_force

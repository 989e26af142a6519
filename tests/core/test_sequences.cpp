// Warm sequences in small: every body on a plane and with one other, memory kept from step to step. The long
// ones are bench/sequences.
#include <gtest/gtest.h>

#include <stdexcept>

#include "support/sequences.h"

namespace nurbs::sequences {
namespace {

long steps_of(const Actor& a, long usual) {
  return a.every > 1 ? usual / 10 : usual;
}

void expect_right(const Report& r, const std::string& what) {
  EXPECT_EQ(r.failed(), 0) << what << ": " << r.unresolved << " unresolved, " << r.wrong << " wrong, "
                           << r.bracket << " brackets; " << r.first;
}

TEST(Sequences, on_planes) {
  std::uint64_t seed = 1;
  for (const Actor& a : all_actors()) {
    const Report r = run_plane(a, seed++, steps_of(a, 300));
    expect_right(r, a.name);
    EXPECT_GT(r.touching, r.steps / 4) << a.name;
  }
}

TEST(Sequences, pairs) {
  const int count = static_cast<int>(all_actors().size());
  for (int k = 0; k < count; ++k) {
    const Actor &a = all_actors()[k], &b = all_actors()[(7 * k + 3) % count];
    const long steps = std::min(steps_of(a, 200), steps_of(b, 200));
    const Report r = run_pair(a, b, 100 + k, steps);
    expect_right(r, a.name + ", " + b.name);
    EXPECT_GT(r.touching, steps / 10) << a.name << ", " << b.name;
  }
}

// Upper ends of the bracket 1e-13 too low: balls about contacts on creases were put along the direction
// asked, which is not quite the normal.
TEST(Sequences, contacts_on_creases) {
  const auto of = [](const std::string& name) -> const Actor& {
    for (const Actor& a : all_actors())
      if (a.name == name) return a;
    throw std::runtime_error("no actor " + name);
  };
  expect_right(run_pair(of("cylinder 2"), of("capsule 3"), 1039, 4500), "cylinder, capsule");
  expect_right(run_pair(of("polyhedron 1"), of("ball"), 1104, 16000), "polyhedron, ball");
}

// The judge itself: a body a hair larger than its truth must be seen.
TEST(Sequences, a_wrong_body_is_seen) {
  Actor wrong = all_actors()[0];
  const auto right = wrong.solid.support;
  wrong.solid.support = [right](const Vec3& d) -> Vec3 { return (1 + 1e-7) * right(d); };
  EXPECT_GT(run_plane(wrong, 1, 300).failed(), 0);
  EXPECT_GT(run_pair(wrong, all_actors()[21], 1, 300).failed(), 0);
}

}  // namespace
}  // namespace nurbs::sequences

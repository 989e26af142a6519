// A pair that could not be certified can be written and replayed bit for bit.
#include <gtest/gtest.h>

#include <cstdio>
#include <cstring>
#include <fstream>

#include "contact/pair_search.h"
#include "io/pair_case.h"
#include "support/bodies.h"
#include "support/pairs.h"

namespace nurbs::test_pair_case {
namespace {

using namespace test;

ContactResult solve(const Particle& a, const Particle& b, const ContactSettings& settings) {
  double memory[kPairMemorySize] = {0};
  return find_contact(a, b, settings, memory);
}

TEST(PairCase, replays_to_the_same_result) {
  Random random(31);
  const Pair pair = random_pair(random, *smooth_pebble(), *cuboid(), -0.02);
  ContactSettings settings;
  settings.tolerance = 1e-7;
  const std::string file = ::testing::TempDir() + "pair_case.json";
  ASSERT_TRUE(write_pair_case(file, pair.a, pair.b, settings));
  const PairCase replay = read_pair_case(file);
  const ContactResult before = solve(pair.a, pair.b, settings),
                      after = solve(replay.a, replay.b, replay.settings);
  EXPECT_EQ(before.status, after.status);
  EXPECT_EQ(before.gap, after.gap);
  EXPECT_EQ(before.normal, after.normal);
  EXPECT_EQ(before.iterations, after.iterations);
  std::remove(file.c_str());
}

TEST(PairCase, keeps_numbers_that_are_none) {
  Random random(32);
  Pair pair = random_pair(random, *ellipsoid(), *ellipsoid(), -0.02);
  pair.b.x[1] = std::nan("");
  const std::string file = ::testing::TempDir() + "pair_case_nan.json";
  ASSERT_TRUE(write_pair_case(file, pair.a, pair.b, ContactSettings()));
  const PairCase replay = read_pair_case(file);
  EXPECT_TRUE(std::isnan(replay.b.x[1]));
  EXPECT_EQ(replay.b.x[0], pair.b.x[0]);
  EXPECT_EQ(solve(replay.a, replay.b, replay.settings).status, Status::unresolved);
  std::remove(file.c_str());
}

TEST(PairCase, says_what_is_wrong_with_a_file) {
  EXPECT_FALSE(write_pair_case("/no/such/folder/case.json", Particle{ellipsoid().get()},
                               Particle{ellipsoid().get()}, ContactSettings()));
  EXPECT_THROW(read_pair_case("no such file"), ShapeError);
  const std::string file = ::testing::TempDir() + "cut_case.json";
  std::ofstream(file) << "{\"tolerance\": \"0x1p-30\"";
  EXPECT_THROW(read_pair_case(file), ShapeError);
  std::remove(file.c_str());
}

}  // namespace
}  // namespace nurbs::test_pair_case

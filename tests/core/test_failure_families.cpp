// A sample of the failure table's pairs (bench/families.h) through the default solver, and the judge itself:
// it must see every kind of failure.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "body/support.h"
#include "contact/contact.h"
#include "nurbs/wide.h"
#include "support/families.h"

namespace nurbs::families {
namespace {

#ifdef __SANITIZE_ADDRESS__
constexpr long kSearchedSample = 20;
#else
constexpr long kSearchedSample = 60;
#endif

// Families that name few pairs have dear truths.
long sample_of(const Family& family) {
  return family.pairs > 20000 ? 100 : kSearchedSample;
}

TEST(FailureFamilies, no_answer_of_ours_fails) {
  for (const Family& family : all_families())
    for (long k = 0; k < sample_of(family); ++k) {
      const PairCase pair = pair_of(family, k);
      const Answer answer = solve(pair, Solver::ladder);
      const Verdict verdict = judge(pair, answer);
      EXPECT_EQ(verdict.failure, Failure::none)
          << family.name << ", pair " << k << ": " << kFailureNames[static_cast<int>(verdict.failure)]
          << ", error " << verdict.error << ", allowed " << verdict.allowed;
    }
}

// Contacts that go on, side by side: what is found there is right, whatever the family and the lane, and
// most contacts of smooth bodies are found.
TEST(FailureFamilies, no_contact_followed_side_by_side_fails) {
  long given = 0, asked = 0;
  for (const Family& family : all_families())
    for (long k = 0; k < sample_of(family); ++k) {
      const PairCase pair = pair_of(family, k);
      if (pair.truth.gap > 0) continue;
      const Answer answer = follow(pair, static_cast<int>(k % kWidth));
      ++asked;
      if (!answer.given) continue;
      ++given;
      const Verdict verdict = judge(pair, answer);
      EXPECT_EQ(verdict.failure, Failure::none)
          << family.name << ", pair " << k << ": " << kFailureNames[static_cast<int>(verdict.failure)]
          << ", error " << verdict.error << ", allowed " << verdict.allowed;
      const Answer alone = follow(pair, static_cast<int>((k + 1) % kWidth));
      EXPECT_TRUE(alone.given && alone.gap == answer.gap && alone.normal == answer.normal);
    }
  EXPECT_GT(given, asked / 10);
}

const Family& family_named(const std::string& name) {
  return *std::find_if(all_families().begin(), all_families().end(),
                       [&](const Family& f) { return name == f.name; });
}

// Pairs that earlier versions left unresolved: needle triangles of the hull with normals of round-off,
// supports at the flat pole of a puck that were certified to 1e-9 only; needles between a small body's
// details and a corner of a large one, whose nearest points were; rings about a tip, where what was left of
// the proof that a body is one of revolution was more than the tolerance. The last two had a right gap and
// a polished normal along which the bodies overlap by more.
TEST(FailureFamilies, pairs_that_once_failed) {
  const std::pair<const char*, long> once[] = {
      {"concentric", 5563},     {"concentric", 91614},    {"near planar", 3636},    {"near planar", 6820},
      {"near planar", 22991},   {"near planar", 44637},   {"near planar", 79401},   {"size ratio 1e6", 335},
      {"size ratio 1e6", 368},  {"size ratio 1e6", 1805}, {"size ratio 1e6", 5897}, {"size ratio 1e6", 2868},
      {"size ratio 1e6", 3173}, {"size ratio 1e6", 8888}};
  for (const auto& [name, k] : once) {
    const PairCase pair = pair_of(family_named(name), k);
    EXPECT_EQ(judge(pair, solve(pair, Solver::ladder)).failure, Failure::none) << name << ", pair " << k;
  }
}

TEST(FailureFamilies, support_of_a_flat_pole_is_certified_to_round_off) {
  const PairCase pair = pair_of(family_named("near planar"), 3636);
  ASSERT_EQ(pair.a.shape->name, "puck");
  for (const double side : {-1.0, 1.0}) {
    const Support s = find_support(*pair.a.shape, side * Vec3::UnitZ());
    EXPECT_LT(s.upper - s.h, 1e-14);
  }
}

TEST(FailureFamilies, any_pair_can_be_replayed_alone) {
  for (const Family& family : all_families()) {
    const PairCase first = pair_of(family, 3);
    pair_of(family, 4);
    const PairCase again = pair_of(family, 3);
    EXPECT_EQ(first.b.x, again.b.x) << family.name;
    EXPECT_EQ(first.a.q.coeffs(), again.a.q.coeffs()) << family.name;
    EXPECT_EQ(first.truth.gap, again.truth.gap) << family.name;
  }
}

TEST(FailureFamilies, both_signs_of_the_gap_occur) {
  for (const char* name : {"slender", "tiny gap", "disc on plate", "aligned faces", "near planar"}) {
    const Family& family = family_named(name);
    int apart = 0, overlapping = 0;
    for (long k = 0; k < 100; ++k) {
      const double gap = pair_of(family, k).truth.gap;
      apart += gap > 0;
      overlapping += gap < 0;
    }
    EXPECT_GT(apart, 20) << name;
    EXPECT_GT(overlapping, 20) << name;
  }
}

// --- the judge
// -------------------------------------------------------------------------------------------------

class Judge : public testing::Test {
 protected:
  void SetUp() override {
    const Family& slender = all_families().front();
    for (long k = 0; pair.truth.gap > -1e-4; ++k) pair = pair_of(slender, k);
    good = solve(pair, Solver::ladder);
    ASSERT_EQ(judge(pair, good).failure, Failure::none);
    allowed = judge(pair, good).allowed;
  }
  Failure failure_of(const Answer& answer, double mesh_error = 0) {
    return judge(pair, answer, mesh_error).failure;
  }
  PairCase pair;  // overlapping
  Answer good;
  double allowed = 0;
};

TEST_F(Judge, allows_the_tolerance_and_little_more) {
  const double size = 0.15;
  EXPECT_GE(allowed, pair.tolerance * size);
  EXPECT_LE(allowed, pair.tolerance * size + 1e-14 * size);
}

TEST_F(Judge, sees_that_there_is_no_answer) {
  Answer answer = good;
  answer.given = false;
  EXPECT_EQ(failure_of(answer), Failure::no_answer);
  answer = good;
  answer.unresolved = true;
  EXPECT_EQ(failure_of(answer), Failure::unresolved);
}

TEST_F(Judge, sees_numbers_that_are_none) {
  Answer answer = good;
  answer.gap = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(failure_of(answer), Failure::not_a_number);
  answer = good;
  answer.normal[1] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(failure_of(answer), Failure::not_a_number);
}

TEST_F(Judge, sees_a_wrong_sign) {
  Answer answer = good;
  answer.gap = -good.gap;
  EXPECT_EQ(failure_of(answer), Failure::sign);
  EXPECT_EQ(failure_of(answer, 0.1 * std::abs(good.gap)), Failure::sign);
  answer.gap = 2 * allowed;  // small, but further from zero than is allowed
  EXPECT_EQ(failure_of(answer), Failure::sign);
}

TEST_F(Judge, sees_a_flipped_normal) {
  Answer answer = good;
  answer.normal = -good.normal;
  EXPECT_EQ(failure_of(answer), Failure::flipped);
  EXPECT_EQ(failure_of(answer, 1e-3), Failure::flipped);
}

TEST_F(Judge, sees_a_wrong_gap) {
  Answer answer = good;
  answer.gap = pair.truth.gap - 2 * allowed;
  EXPECT_EQ(failure_of(answer), Failure::error);
  answer.gap = pair.truth.gap + 2 * allowed;
  EXPECT_EQ(failure_of(answer), Failure::error);
  EXPECT_EQ(failure_of(answer, 10 * allowed), Failure::none);  // of a mesh that coarse
}

// The gap is right, but along this normal the bodies overlap by more: it can't be where they part first.
TEST_F(Judge, sees_a_normal_that_does_not_belong_to_the_gap) {
  Answer answer = good;
  answer.normal = (good.normal + 0.1 * good.normal.unitOrthogonal()).normalized();
  EXPECT_EQ(failure_of(answer), Failure::error);
}

TEST_F(Judge, sees_a_bracket_that_misses_the_truth_or_is_too_wide) {
  Answer answer = good;
  answer.lower = pair.truth.gap + 0.1 * allowed;
  answer.upper = answer.lower + 0.1 * allowed;
  EXPECT_EQ(failure_of(answer), Failure::bracket);
  answer = good;
  answer.upper = pair.truth.gap - 0.1 * allowed;
  answer.lower = answer.upper - 0.1 * allowed;
  EXPECT_EQ(failure_of(answer), Failure::bracket);
  answer = good;
  answer.lower = good.lower - 2 * allowed;
  EXPECT_EQ(failure_of(answer), Failure::bracket);
}

TEST_F(Judge, sees_points_that_are_not_that_far_apart) {
  Answer answer = good;
  answer.point_b += 2 * allowed * good.normal;
  EXPECT_EQ(failure_of(answer), Failure::points);
}

}  // namespace
}  // namespace nurbs::families

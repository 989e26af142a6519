// Random bodies in random poses, most of them deep (support/deep_fuzz.h): a sample of what bench/deep_fuzz
// runs, and pairs that earlier versions left unresolved.
#include <gtest/gtest.h>

#include <utility>

#include "contact/pair_search.h"
#include "support/deep_fuzz.h"

namespace nurbs::deep_fuzz {
namespace {

const Fuzz& fuzz() {
  static const Fuzz made(1, 32);
  return made;
}

Judgement answer(Pose pose, long k, bool search) {
  const families::PairCase c = fuzz().pair(pose, k);
  double memory[kPairMemorySize] = {0};
  ContactSettings settings;
  settings.tolerance = c.tolerance;
  const ContactResult r = find_contact(c.a, c.b, settings, memory);
  return judge(fuzz(), c, search ? fuzz().truth(c, static_cast<std::uint64_t>(k)) : c.truth, r);
}

TEST(DeepFuzz, a_sample_of_every_pose) {
  for (int pose = 0; pose < kPoses; ++pose)
    for (long k = 0; k < 100; ++k) {
      const Judgement j = answer(static_cast<Pose>(pose), k, k % 25 == 0);
      EXPECT_STREQ(j.wrong, "") << kPoseNames[pose] << " " << k << ": " << j.error << " of " << j.allowed;
    }
}

// Two bodies of revolution on nearly one axis that part sideways: a ring of directions is as good to within
// the tolerance or little more, and the minimum in it turns with the tilt.
TEST(DeepFuzz, nearly_coaxial_bodies_that_part_sideways) {
  const std::pair<Pose, long> once[] = {{Pose::coaxial, 33}, {Pose::centred, 106}, {Pose::centred, 182}};
  for (const auto& [pose, k] : once) {
    const Judgement j = answer(pose, k, true);
    EXPECT_STREQ(j.wrong, "") << kPoseNames[static_cast<int>(pose)] << " " << k << ": " << j.error << " of "
                              << j.allowed;
  }
}

// The judge sees what it is there for.
TEST(DeepFuzz, the_judge_sees_wrong_answers) {
  const families::PairCase c = fuzz().pair(Pose::deep, 0);
  double memory[kPairMemorySize] = {0};
  const ContactResult good = find_contact(c.a, c.b, ContactSettings(), memory);
  const families::Truth truth = fuzz().truth(c, 0);
  ASSERT_STREQ(judge(fuzz(), c, truth, good).wrong, "");
  ContactResult r = good;
  r.normal = (r.normal + 1e-2 * r.normal.unitOrthogonal()).normalized();
  EXPECT_STREQ(judge(fuzz(), c, truth, r).wrong, "normal");
  r = good;
  r.lower = r.upper = r.gap = good.gap - 1e-6;
  EXPECT_STREQ(judge(fuzz(), c, truth, r).wrong, "depth");
  r = good;
  r.point_a += 1e-6 * r.normal;
  EXPECT_STREQ(judge(fuzz(), c, truth, r).wrong, "points");
  r = good;
  r.status = Status::unresolved;
  EXPECT_STREQ(judge(fuzz(), c, truth, r).wrong, "unresolved");
}

}  // namespace
}  // namespace nurbs::deep_fuzz

// Random bodies in random poses, most of them deep (support/deep_fuzz.h): a sample of what bench/deep_fuzz
// runs, and pairs that earlier versions left unresolved.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "contact/pair_search.h"
#include "support/deep_fuzz.h"

namespace nurbs::deep_fuzz {
namespace {

const Fuzz& fuzz() {
  static const Fuzz made(1, 32);
  return made;
}

Judgement answer(const Fuzz& of, Pose pose, long k, bool search) {
  const families::PairCase c = of.pair(pose, k);
  double memory[kPairMemorySize] = {0};
  ContactSettings settings;
  settings.tolerance = c.tolerance;
  const ContactResult r = find_contact(c.a, c.b, settings, memory);
  return judge(of, c, search ? of.truth(c, static_cast<std::uint64_t>(k)) : c.truth, r);
}

void expect_sample_right(const Fuzz& of, long pairs) {
  for (int pose = 0; pose < kPoses; ++pose)
    for (long k = 0; k < pairs; ++k) {
      const Judgement j = answer(of, static_cast<Pose>(pose), k, k % 25 == 0);
      EXPECT_STREQ(j.wrong, "") << kPoseNames[pose] << " " << k << ": " << j.error << " of " << j.allowed;
    }
}

TEST(DeepFuzz, a_sample_of_every_pose) {
  expect_sample_right(fuzz(), 100);
}
TEST(DeepFuzz, a_sample_of_further_bodies) {
  expect_sample_right(Fuzz(2, 24, Kinds::further), 100);
}

// Without what was found of it but its patches' bounds: balls, meridians, hulls and ellipsoids.
std::shared_ptr<const Shape> bare(const Shape& shape) {
  auto copy = std::make_shared<Shape>(shape);
  ++copy->stamp;
  copy->ellipsoid = {};
  copy->revolution = {};
  copy->meridian = {};
  copy->profile_radii = {};
  copy->core = {};
  copy->ball_hull = copy->inner_balls = {};
  copy->round_edges.clear();
  return copy;
}

// Two ways to the same answer: both brackets hold it, and so have it in common. (Balls taken to be inside a
// body that they lay outside of were found so.)
TEST(DeepFuzz, brackets_meet_with_and_without_the_forms_found) {
  std::map<const Shape*, std::shared_ptr<const Shape>> bare_ones;
  const auto strip = [&](Particle* p) {
    std::shared_ptr<const Shape>& b = bare_ones[p->shape];
    if (!b) b = bare(*p->shape);
    p->shape = b.get();
  };
  const Fuzz further(12, 48, Kinds::further);
  int agree = 0;
  for (const Fuzz* of : {&fuzz(), &further})
    for (int pose = 0; pose < kPoses; ++pose)
      for (long k = 0; k < 80; ++k) {
        families::PairCase c = of->pair(static_cast<Pose>(pose), k);
        const double size = std::max(c.a.shape->bounding_radius, c.b.scale * c.b.shape->bounding_radius);
        ContactResult r[2];
        for (const bool stripped : {false, true}) {
          if (stripped) {
            strip(&c.a);
            strip(&c.b);
          }
          double memory[kPairMemorySize] = {0};
          ContactSettings settings;
          settings.tolerance = c.tolerance;
          r[stripped] = find_contact(c.a, c.b, settings, memory);
        }
        EXPECT_LE(std::max(r[0].lower, r[1].lower), std::min(r[0].upper, r[1].upper) + 1e-14 * size)
            << kPoseNames[pose] << " " << k;
        agree += r[0].status == Status::converged && r[1].status == Status::converged;
      }
  EXPECT_GT(agree, 900);
}

void expect_right(const std::vector<std::pair<Pose, long>>& pairs) {
  for (const auto& [pose, k] : pairs) {
    const Judgement j = answer(fuzz(), pose, k, true);
    EXPECT_STREQ(j.wrong, "") << kPoseNames[static_cast<int>(pose)] << " " << k << ": " << j.error << " of "
                              << j.allowed;
  }
}

// A sphere's part whose centre is on the mate's axis, on its edge or in a plane of its symmetry: a ring of
// directions is exactly as good, and a ball a little smaller than the sphere would not tell.
TEST(DeepFuzz, spheres_about_a_point_of_the_mates_axis) {
  expect_right({{Pose::deep, 271},
                {Pose::deep, 2533},
                {Pose::deep, 5288},
                {Pose::deep, 6151},
                {Pose::deep, 7451},
                {Pose::deep, 7577},
                {Pose::deep, 9586},
                {Pose::features, 2480},
                {Pose::features, 9649},
                {Pose::features, 10520},
                {Pose::sizes, 998},
                {Pose::sizes, 7391},
                {Pose::sizes, 11261}});
}

// Contact on a flat within a millionth of its pole, where normals are mostly round-off: certified, and wrong
// by the flat's radius times that.
TEST(DeepFuzz, flats_touched_beside_their_pole) {
  expect_right({{Pose::coaxial, 1389}, {Pose::coaxial, 4203}});
}

// A blunt pole in a cone a hundred thousand times as large.
TEST(DeepFuzz, a_pole_in_a_wide_tip) {
  expect_right({{Pose::sizes, 4969}});
}

// Two bodies of revolution on nearly one axis that part sideways: a ring of directions is as good to within
// the tolerance or little more, and the minimum in it turns with the tilt.
TEST(DeepFuzz, nearly_coaxial_bodies_that_part_sideways) {
  expect_right({{Pose::coaxial, 33}, {Pose::centred, 106}, {Pose::centred, 182}});
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

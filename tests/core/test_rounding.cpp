// Least radii of bodies made of planes, cylinders and spheres.
#include <gtest/gtest.h>

#include "body/rounding.h"
#include "nurbs/tolerances.h"
#include "shapes/primitives.h"
#include "shapes/revolved.h"
#include "shapes/rounded_polyhedron.h"
#include "support/bodies.h"
#include "support/random.h"

namespace nurbs {
namespace {

double rounding_of(std::vector<NurbsSurface> surfaces) {
  return least_rounding(make_shape("body", std::move(surfaces))->patches);
}

TEST(Rounding, is_the_radius_that_bodies_were_rounded_by) {
  EXPECT_NEAR(rounding_of(rounded_box(Vec3(1, 0.7, 0.4), 0.15)), 0.15, 2e-11);
  EXPECT_NEAR(rounding_of(capsule(0.6, 0.8)), 0.6, 2e-11);
  EXPECT_NEAR(rounding_of(rounded_polyhedron(platonic_solid("dodecahedron", 1), Vec3::Zero(), 0.07)), 0.07,
              2e-11);
  EXPECT_LE(rounding_of(capsule(0.6, 0.8)), 0.6);
}

TEST(Rounding, is_none_of_other_bodies) {
  EXPECT_EQ(rounding_of(exact_ellipsoid(Vec3(1, 1, 1 + 1e-9))), 0);
  EXPECT_EQ(rounding_of(egg(0.7, 0.5, 1.2)), 0);
  EXPECT_EQ(rounding_of(tablet(1, 0.6, 0.2)), 0);  // a torus
  EXPECT_EQ(rounding_of(box(Vec3(1, 0.5, 0.2))), kFarAway);
}

// Moved by 1e-9 in one control point, a cylinder is none.
TEST(Rounding, sees_a_control_point_that_is_off) {
  std::vector<BezierPatch> patches = make_shape("body", capsule(0.6, 0.8))->patches;
  ASSERT_GT(least_rounding(patches), 0);
  for (BezierPatch& patch : patches) {
    Vec4& p = patch.points[patch.points.size() / 2];
    const Vec4 before = p;
    p.head<3>() *= 1 + 1e-9;
    EXPECT_EQ(least_rounding(patches), 0);
    p = before;
  }
}

}  // namespace
}  // namespace nurbs

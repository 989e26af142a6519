// Least radii of bodies made of planes, cylinders and spheres.
#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "body/rounding.h"
#include "body/surface_bounds.h"
#include "nurbs/tolerances.h"
#include "shapes/primitives.h"
#include "shapes/revolved.h"
#include "shapes/rounded_polyhedron.h"
#include "support/bodies.h"
#include "support/random.h"

namespace nurbs::test_rounding {
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

// Of a row of homogeneous points the part from a to b (its blossom).
std::vector<Vec4> part(const std::vector<Vec4>& row, double a, double b) {
  const auto n = static_cast<int>(row.size()) - 1;
  std::vector<Vec4> out;
  for (int i = 0; i <= n; ++i) {
    std::vector<Vec4> p = row;
    for (int k = 0; k < n; ++k) {
      const double t = k < i ? b : a;
      for (int j = 0; j < n - k; ++j) p[j] += t * (p[j + 1] - p[j]);
    }
    out.push_back(p[0]);
  }
  return out;
}

NurbsSurface part(const BezierPatch& patch, double u0, double u1, double v0, double v1) {
  const int p = patch.degree_u, q = patch.degree_v;
  BezierPatch out = patch;
  for (int i = 0; i <= p; ++i) {
    std::vector<Vec4> row;
    for (int j = 0; j <= q; ++j) row.push_back(patch.point(i, j));
    row = part(row, v0, v1);
    for (int j = 0; j <= q; ++j) out.point(i, j) = row[j];
  }
  for (int j = 0; j <= q; ++j) {
    std::vector<Vec4> row;
    for (int i = 0; i <= p; ++i) row.push_back(out.point(i, j));
    row = part(row, u0, u1);
    for (int i = 0; i <= p; ++i) out.point(i, j) = row[i];
  }
  return bezier_surface(p, q, out.points);
}

// The middle of a patch a thousandth of the body wide, moved by what passes for round-off, bends it by 1e-6.
// The radii proven there hold all the same.
TEST(Rounding, of_small_patches_on_balls_allows_for_what_round_off_may_bend) {
  const std::vector<BezierPatch> whole = make_shape("body", capsule(1, 2))->patches;
  const std::array<double, 4> cuts = {0, 0.4995, 0.5005, 1};
  std::vector<NurbsSurface> surfaces;
  for (const BezierPatch& patch : whole)
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) {
        surfaces.push_back(part(patch, cuts[i], cuts[i + 1], cuts[j], cuts[j + 1]));
        NurbsSurface& s = surfaces.back();
        if (i == 1 && j == 1 && s.degree_u == 2 && s.degree_v == 2) s.point(1, 1).head<3>() *= 1 + 4e-14;
      }
  const auto body = make_shape("body", std::move(surfaces));
  double least = kFarAway;
  for (const Leaf& leaf : bound_surface(*body).leaves) {
    if (!leaf.bounds.regular) continue;
    const Jet2 j = evaluate2(body->patches[leaf.middle.patch], leaf.middle.u, leaf.middle.v);
    const Vec3 n = j.su.cross(j.sv).normalized();
    Mat2 first, second;
    first << j.su.dot(j.su), j.su.dot(j.sv), j.su.dot(j.sv), j.sv.dot(j.sv);
    second << -n.dot(j.suu), -n.dot(j.suv), -n.dot(j.suv), -n.dot(j.svv);
    const Mat2 w = first.inverse() * second;
    const double mean = 0.5 * w.trace(), apart = 0.5 * (w(0, 0) - w(1, 1)),
                 root = std::sqrt(std::max(apart * apart + w(0, 1) * w(1, 0), 0.0)),
                 radius = 1 / (mean + root);
    least = std::min(least, radius);
    EXPECT_LE(leaf.bounds.min_radius, radius * (1 + 1e-9)) << leaf.middle.patch;
    EXPECT_GE(leaf.bounds.max_radius, (1 - 1e-9) / (mean - root)) << leaf.middle.patch;
  }
  EXPECT_LT(least, 1 - 1e-8);  // that the test shows something
}

}  // namespace
}  // namespace nurbs::test_rounding

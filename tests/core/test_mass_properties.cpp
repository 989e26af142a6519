// Volume, centre of mass and inertia against closed forms, in random poses.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "body/mass_properties.h"
#include "shapes/primitives.h"
#include "shapes/revolved.h"
#include "support/random.h"

namespace nurbs::test_mass_properties {
namespace {

using test::Random;

std::vector<BezierPatch> split_all(const std::vector<NurbsSurface>& surfaces) {
  std::vector<BezierPatch> patches;
  for (const NurbsSurface& s : surfaces) {
    for (BezierPiece& piece : split_to_bezier(s)) patches.push_back(piece.patch);
  }
  return patches;
}

void move(std::vector<BezierPatch>& patches, const Mat3& rotation, const Vec3& offset) {
  for (BezierPatch& patch : patches) {
    for (Vec4& p : patch.points) p.head<3>() = (rotation * p.head<3>() + p[3] * offset).eval();
  }
}

// Second moments of the unit solid (x x^T integrated), from which inertia follows.
Mat3 inertia_of(const Mat3& second) {
  return second.trace() * Mat3::Identity() - second;
}

struct Expected {
  double volume;
  Vec3 second;  // about the centre, along the body's axes
};

Expected ellipsoid(const Vec3& a) {
  const double volume = 4 * M_PI / 3 * a.prod();
  return {volume, volume / 5 * a.cwiseProduct(a)};
}

Expected cuboid(const Vec3& half) {
  const double volume = 8 * half.prod();
  return {volume, volume / 3 * half.cwiseProduct(half)};
}

void expect_mass(const std::vector<NurbsSurface>& body, const Expected& expected, Random& random,
                 double tolerance) {
  std::vector<BezierPatch> patches = split_all(body);
  const Mat3 r = random.turn().toRotationMatrix();
  const double size = std::cbrt(expected.volume);
  const Vec3 offset = size * random.box(-3, 3);
  move(patches, r, offset);
  const MassProperties mass = integrate_mass(patches);
  const Mat3 inertia = r * inertia_of(expected.second.asDiagonal()) * r.transpose();
  EXPECT_NEAR(mass.volume / expected.volume, 1, tolerance);
  EXPECT_LT((mass.center - offset).norm(), tolerance * size);
  EXPECT_LT((mass.inertia - inertia).norm(), tolerance * inertia.norm());
}

TEST(MassProperties, ExactEllipsoids) {
  Random random(1);
  for (int trial = 0; trial < 20; ++trial) {
    const Vec3 a = random.box(0.3, 3);
    expect_mass(exact_ellipsoid(a), ellipsoid(a), random, 1e-10);
  }
}

TEST(MassProperties, OnePatchEllipsoidsWithPolesAndSeam) {
  Random random(2);
  for (int trial = 0; trial < 20; ++trial) {
    const double a = random.uniform(0.3, 3), c = random.uniform(0.3, 3);
    expect_mass(revolved_ellipsoid(a, c), ellipsoid({a, a, c}), random, 1e-10);
  }
}

TEST(MassProperties, ThinDiscAndNeedle) {
  Random random(3);
  for (const Vec3& a : {Vec3(1, 1, 1e-3), Vec3(1, 1e-3, 1e-3)}) {
    expect_mass(exact_ellipsoid(a), ellipsoid(a), random, 1e-10);
  }
}

TEST(MassProperties, SmallAndLargeUnits) {
  Random random(4);
  for (double unit : {1e-6, 1e3}) {
    const Vec3 a = unit * Vec3(1, 2, 1.5);
    expect_mass(exact_ellipsoid(a), ellipsoid(a), random, 1e-10);
  }
}

TEST(MassProperties, BoxIsIntegratedToRoundOff) {
  Random random(5);
  for (int trial = 0; trial < 20; ++trial) {
    const Vec3 half = random.box(0.3, 3);
    expect_mass(box(half), cuboid(half), random, 2e-13);
  }
}

// The same surface, u -> c u / (1 + (c - 1) u) and v likewise: at 1e3 all of a patch crowds into a thousandth
// of its parameters, which quadrature there missed silently.
TEST(MassProperties, UnevenWeights) {
  Random random(7);
  const Vec3 a(1, 2, 1.5);
  for (const double c : {1e-3, 0.1, 30.0, 1e3}) {
    std::vector<NurbsSurface> body = exact_ellipsoid(a);
    for (NurbsSurface& s : body)
      for (int i = 0; i < s.size_u; ++i)
        for (int j = 0; j < s.size_v; ++j) s.point(i, j) *= std::pow(c, i) * std::pow(c, -0.5 * j);
    expect_mass(body, ellipsoid(a), random, 1e-10);
  }
}

// Two arcs of conics turned about z: with a heavy middle point all of the arc but
// the corner crowds into strips beside the ends of the parameters, whose cells ran out. Volume by frusta.
TEST(MassProperties, HeavyMiddlePoints) {
  for (const Vec2& w : {Vec2(1, 1), Vec2(150, 150), Vec2(1000, 1000), Vec2(922, 1e-3), Vec2(1e-3, 1000)}) {
    const Profile profile{{{0, -1}, {1, -1}, {1, 0}, w[0]}, {{1, 0}, {1, 1}, {0, 1}, w[1]}};
    const auto frusta = [&](int count) {
      double volume = 0, moment = 0;
      for (const ProfileArc& arc : profile) {
        Vec2 last = arc.from;
        for (int k = 1; k <= count; ++k) {
          const double s = std::tan(0.5 * M_PI * k / (count + 1.0));  // t / (1 - t), graded to both ends
          const double t = k == count ? 1 : s / (1 + s), b = 2 * arc.weight * t * (1 - t);
          const Vec2 x = ((1 - t) * (1 - t) * arc.from + b * arc.corner + t * t * arc.to) /
                         ((1 - t) * (1 - t) + b + t * t);
          const double area = M_PI * (last[0] * last[0] + last[0] * x[0] + x[0] * x[0]) / 3;
          volume += area * (x[1] - last[1]);
          moment += area * (x[1] - last[1]) * 0.5 * (x[1] + last[1]);
          last = x;
        }
      }
      return Vec2(volume, moment / volume);
    };
    const Vec2 coarse = frusta(200000), fine = frusta(400000), truth = fine + (fine - coarse) / 3;
    bool done = false;
    const MassProperties mass = integrate_mass(split_all(revolve(profile)), &done);
    EXPECT_TRUE(done);
    EXPECT_NEAR(mass.volume / truth[0], 1, 1e-8) << w.transpose();
    EXPECT_NEAR(mass.center[2], truth[1], 1e-8) << w.transpose();
  }
}

TEST(MassProperties, InwardPatchesGiveNegativeVolume) {
  std::vector<NurbsSurface> body = exact_ellipsoid({1, 2, 3});
  const double volume = integrate_mass(split_all(body)).volume;
  for (NurbsSurface& s : body) s = swap_uv(s);
  EXPECT_NEAR(integrate_mass(split_all(body)).volume, -volume, 1e-12 * volume);
}

TEST(PrincipalFrame, DiagonalisesARotatedTensor) {
  Random random(6);
  for (int trial = 0; trial < 100; ++trial) {
    Vec3 moments = random.box(1, 2);
    std::sort(moments.data(), moments.data() + 3);
    const Mat3 r = random.turn().toRotationMatrix();
    const Mat3 tensor = r * moments.asDiagonal() * r.transpose();
    const PrincipalFrame frame = principal_frame(tensor);
    EXPECT_LT((frame.moments - moments).norm(), 1e-14);
    const Mat3 axes = frame.axes.toRotationMatrix();
    EXPECT_NEAR(axes.determinant(), 1, 1e-14);
    EXPECT_LT((axes * moments.asDiagonal() * axes.transpose() - tensor).norm(), 1e-14);
  }
}

TEST(PrincipalFrame, DiagonalTensorKeepsItsAxes) {
  Mat3 tensor = Vec3(1, 2, 3).asDiagonal();
  tensor(0, 1) = tensor(1, 0) = 1e-17;
  EXPECT_LT(principal_frame(tensor).axes.angularDistance(Quat::Identity()), 1e-15);
  EXPECT_LT(principal_frame(Mat3::Identity()).axes.angularDistance(Quat::Identity()), 1e-15);
}

}  // namespace
}  // namespace nurbs::test_mass_properties

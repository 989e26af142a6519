// Ready-made bodies: exactness, stated fit errors, joints, convexity, and bodies made to an inertia tensor.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "body/local_form.h"
#include "body/proofs.h"
#include "body/shape.h"
#include "body/support.h"
#include "io/shape_file.h"
#include "nurbs/affine.h"
#include "shapes/primitives.h"
#include "shapes/revolved.h"
#include "shapes/superellipsoid.h"
#include "support/random.h"

namespace nurbs::test_primitives {
namespace {

using Surfaces = std::vector<NurbsSurface>;
using test::Random;

// Calls visit(patch, u, v) on a grid of every Bezier piece, edges included, that lines up with no fit sample.
void for_each_point(const Surfaces& body,
                    const std::function<void(const BezierPatch&, double, double)>& visit) {
  constexpr int kGrid = 37;
  for (const NurbsSurface& surface : body) {
    for (const BezierPiece& piece : split_to_bezier(surface)) {
      for (int i = 0; i <= kGrid; ++i) {
        for (int j = 0; j <= kGrid; ++j) {
          visit(piece.patch, static_cast<double>(i) / kGrid, static_cast<double>(j) / kGrid);
        }
      }
    }
  }
}

double largest(const Surfaces& body, const std::function<double(const Vec3&)>& measure) {
  double most = 0;
  for_each_point(body, [&](const BezierPatch& p, double u, double v) {
    most = std::max(most, std::abs(measure(evaluate0(p, u, v))));
  });
  return most;
}

double off_unit_sphere(const Vec3& x) {
  return x.norm() - 1;
}

struct Curvatures {
  double least = 1e300, most = -1e300;
};
Curvatures curvatures(const Surfaces& body) {
  Curvatures out;
  for_each_point(body, [&](const BezierPatch& p, double u, double v) {
    const LocalForm form = local_form(p, u, v);
    out.least = std::min(out.least, form.k_min);
    out.most = std::max(out.most, form.k_max);
  });
  return out;
}

struct Kinks {
  double opening = 0, closing = 0;
};
Kinks kinks(const Shape& shape) {
  Kinks out;
  for (const auto& edges : shape.links) {
    for (const EdgeLink& link : edges) {
      out.opening = std::max(out.opening, link.kink);
      out.closing = std::max(out.closing, -link.kink);
    }
  }
  return out;
}

std::vector<Vec4> edge_points(const NurbsSurface& s, int edge) {
  std::vector<Vec4> out;
  const int n = edge < 2 ? s.size_v : s.size_u;
  for (int k = 0; k < n; ++k) {
    out.push_back(edge == 0   ? s.point(0, k)
                  : edge == 1 ? s.point(s.size_u - 1, k)
                  : edge == 2 ? s.point(k, 0)
                              : s.point(k, s.size_v - 1));
  }
  return out;
}

// Every edge of every surface is, bit for bit and either way round, an edge of exactly one other surface.
void expect_closed_exactly(const Surfaces& body) {
  for (size_t a = 0; a < body.size(); ++a) {
    for (int edge = 0; edge < 4; ++edge) {
      const std::vector<Vec4> mine = edge_points(body[a], edge);
      int partners = 0;
      for (size_t b = 0; b < body.size(); ++b) {
        for (int other = 0; b != a && other < 4; ++other) {
          std::vector<Vec4> theirs = edge_points(body[b], other);
          bool same = theirs == mine;
          std::reverse(theirs.begin(), theirs.end());
          partners += same || theirs == mine;
        }
      }
      EXPECT_EQ(partners, 1) << "surface " << a << " edge " << edge;
    }
  }
}

// --- exact bodies
// --------------------------------------------------------------------------------------------

TEST(ExactSphere, liesOnTheUnitSphereToRoundOff) {
  const Surfaces sphere = exact_ellipsoid(Vec3::Ones());
  ASSERT_EQ(sphere.size(), 6u);
  EXPECT_LT(largest(sphere, off_unit_sphere), 1e-15);
}

TEST(ExactSphere, hasPositiveWeightsAndSharedEdges) {
  const Surfaces sphere = exact_ellipsoid(Vec3::Ones());
  for (const NurbsSurface& s : sphere) {
    EXPECT_EQ(s.degree_u, 4);
    EXPECT_EQ(s.degree_v, 4);
    ASSERT_EQ(s.points.size(), 25u);
    for (const Vec4& p : s.points) EXPECT_GT(p[3], 0.5);
  }
  expect_closed_exactly(sphere);
}

TEST(ExactSphere, isParametrisedRegularlyWithOutwardNormals) {
  for_each_point(exact_ellipsoid(Vec3::Ones()), [](const BezierPatch& p, double u, double v) {
    const Jet1 s = evaluate1(p, u, v);
    const Vec3 n = s.su.cross(s.sv);
    EXPECT_GT(n.norm(), 0.5);
    EXPECT_LT((n.normalized() - s.s).norm(), 1e-14);
  });
}

TEST(ExactEllipsoid, satisfiesItsEquationAndHasItsMass) {
  const Vec3 axes(0.5, 3, 1.25);
  const Surfaces body = exact_ellipsoid(axes);
  EXPECT_LT(largest(body, [&](const Vec3& x) { return off_unit_sphere(x.cwiseQuotient(axes)); }), 1e-15);
  EXPECT_NEAR(solid_properties(body).volume, 4 * M_PI / 3 * axes.prod(), 1e-11);
  EXPECT_TRUE(make_shape("ellipsoid", body)->smooth);
}

TEST(Revolved, isAnExactSpheroidOfOneSurface) {
  const Surfaces body = revolved_ellipsoid(2, 0.75);
  ASSERT_EQ(body.size(), 1u);
  EXPECT_LT(
      largest(body, [](const Vec3& x) { return off_unit_sphere(Vec3(x[0] / 2, x[1] / 2, x[2] / 0.75)); }),
      1e-15);
  const auto shape = make_shape("revolved", body);
  EXPECT_NEAR(shape->mass.volume, 4 * M_PI, 1e-10);
  EXPECT_LT(shape->concavity, 1e-12);
}

TEST(Box, hasItsVolumeFacesOutAndCreasesOfARightAngle) {
  const Surfaces body = box(Vec3(0.5, 1, 2));
  expect_closed_exactly(body);
  EXPECT_NEAR(solid_properties(body).volume, 8, 1e-12);
  const auto shape = make_shape("box", body);
  EXPECT_NEAR(kinks(*shape).opening, M_PI / 2, 1e-12);
  EXPECT_EQ(kinks(*shape).closing, 0);
}

// --- fitted bodies
// -------------------------------------------------------------------------------------------

TEST(FittedEllipsoid, staysWithinItsStatedErrorWhichFallsWithTheSpans) {
  const double bound[] = {5e-4, 1e-4, 3e-5};
  for (int spans = 1; spans <= 3; ++spans) {
    double error = 0;
    const Surfaces body = fitted_ellipsoid(Vec3::Ones(), spans, &error);
    expect_closed_exactly(body);
    EXPECT_LT(error, bound[spans - 1]) << spans;
    const double measured = largest(body, off_unit_sphere);
    EXPECT_LT(measured, 1.05 * error) << spans;
    EXPECT_GT(measured, 0.8 * error) << spans;
  }
}

TEST(FittedEllipsoid, isConvexAndItsJointsOpen) {
  for (const Vec3& axes : {Vec3(1, 1, 1), Vec3(1, 0.8, 0.6), Vec3(2, 0.5, 1)}) {
    for (int spans : {1, 2}) {
      const Surfaces body = fitted_ellipsoid(axes, spans);
      EXPECT_GT(curvatures(body).least, 0);
      const auto shape = make_shape("fitted", body);
      EXPECT_LT(kinks(*shape).closing, 1e-9);
      EXPECT_LT(kinks(*shape).opening, spans == 1 ? 0.06 : 0.012);
      EXPECT_LT(shape->concavity, 1e-12);
    }
  }
  EXPECT_GT(kinks(*make_shape("fitted", fitted_ellipsoid(Vec3::Ones()))).opening,
            1e-3);  // imperfect, as intended
}

TEST(SmoothEllipsoid, hasJointsSmoothToRoundOff) {
  double error = 0;
  const Surfaces body = smooth_ellipsoid(Vec3::Ones(), &error);
  expect_closed_exactly(body);
  for (const NurbsSurface& s : body) EXPECT_EQ(s.points.size(), 16u);
  EXPECT_LT(error, 1.6e-3);
  EXPECT_LT(largest(body, off_unit_sphere), 1.05 * error);
  const Curvatures k = curvatures(body);
  EXPECT_GT(k.least, 0.94);
  EXPECT_LT(k.most, 1.06);
  for (const Vec3& axes : {Vec3(1, 1, 1), Vec3(1, 0.3, 4)}) {
    const auto shape = make_shape("smooth", smooth_ellipsoid(axes));
    EXPECT_LT(std::max(kinks(*shape).opening, kinks(*shape).closing), 1e-12);
    EXPECT_TRUE(shape->smooth);
    EXPECT_LT(shape->concavity, 1e-12);
  }
}

TEST(Pebble, isConvexSmoothAndWithoutSymmetry) {
  const Surfaces body = pebble();
  ASSERT_EQ(body.size(), 6u);
  for (const NurbsSurface& s : body) EXPECT_EQ(s.points.size(), 16u);
  expect_closed_exactly(body);
  const Curvatures k = curvatures(body);
  EXPECT_GT(k.least, 0.5);
  EXPECT_LT(k.most, 3);
  const auto shape = make_shape("pebble", body);
  EXPECT_TRUE(shape->smooth);
  EXPECT_LT(shape->concavity, 1e-12);
  EXPECT_LT(shape->mass.center.norm(), 1e-15);
  EXPECT_LT(shape->bounding_radius, 1.3);
  EXPECT_GT(shape->inner_radius, 0.8);
  const Vec3 p = shape->principal_gyration;
  EXPECT_GT(std::min(p[1] - p[0], p[2] - p[1]), 0.01 * p[2]);
  const Mat3 axes =
      shape->principal_axes.toRotationMatrix();  // no mirror image in, nor half turn about, any of them
  const auto h = [&](const Vec3& d) { return d.dot(find_support(*shape, d).point); };
  Random random(1);
  for (int mirror = 1; mirror < 8; ++mirror) {
    const Vec3 sign(mirror & 1 ? -1 : 1, mirror & 2 ? -1 : 1, mirror & 4 ? -1 : 1);
    double most = 0;
    for (int k = 0; k < 100; ++k) {
      const Vec3 d = random.direction();
      most = std::max(most, std::abs(h(axes * d) - h(axes * sign.cwiseProduct(d))));
    }
    EXPECT_GT(most, 0.01) << mirror;
  }
}

TEST(Superellipsoid, staysWithinItsStatedErrorAndConvex) {
  const Vec3 axes(1, 0.8, 1.5);
  for (double e : {4.0, 8.0}) {
    double error = 0;
    const Surfaces body = fitted_superellipsoid(axes, e, 3, &error);
    expect_closed_exactly(body);
    EXPECT_LT(error, 6e-3) << e;
    // |gauge - 1| <= distance / inner radius (1 for the unit body), and the map to `axes` stretches by 1.5 at
    // most.
    const double off = largest(body, [&](const Vec3& x) {
      return std::pow(x.cwiseQuotient(axes).array().abs().pow(e).sum(), 1 / e) - 1;
    });
    EXPECT_LT(1.5 * off, 1.1 * error * std::sqrt(3.0)) << e;
    const auto shape = make_shape("superellipsoid", body);
    EXPECT_LT(shape->concavity, 1e-3 * shape->bounding_radius) << e;
  }
}

// Against the exact support function, (sum |a_k d_k|^q)^(1/q) with 1/q + 1/e = 1: the largest difference of
// the supports of two convex bodies is their Hausdorff distance.
TEST(Superellipsoid, convexOnesAreWithinTheirStatedErrorAndProvenStrictlyConvex) {
  const Vec3 axes(1, 0.8, 1.5);
  Random random(2);
  for (const auto& [e, tolerance] : {std::pair{2.5, 2e-3}, {4.0, 2e-3}, {4.0, 5e-4}}) {
    const Superellipsoid body = convex_superellipsoid(axes, e, tolerance);
    expect_closed_exactly(body.surfaces);
    EXPECT_LE(body.error, tolerance * 1.5) << e;
    std::vector<std::string> warnings;
    const auto shape = make_shape("blocky", body.surfaces, std::nullopt, &warnings);
    EXPECT_TRUE(warnings.empty()) << e;
    EXPECT_TRUE(shape->smooth && proven_without_dents(*shape)) << e;
    EXPECT_LT(shape->patch_curvature.max_radius, 1e4) << e;
    const double q = e / (e - 1);
    for (int k = 0; k < 4000; ++k) {
      const Vec3 d = random.direction();
      const double exact = std::pow(d.cwiseProduct(axes).array().abs().pow(q).sum(), 1 / q);
      EXPECT_NEAR(find_support(*shape, d).h + d.dot(shape->mass.center), exact, 1.05 * body.error) << e;
    }
  }
  EXPECT_THROW(convex_superellipsoid(axes, 12, 2e-4), ShapeError);
  EXPECT_LT(largest(convex_superellipsoid(Vec3::Ones(), 2, 1e-3).surfaces, off_unit_sphere), 1e-14);
}

TEST(Superellipsoid, ofExponentTwoIsAnEllipsoid) {
  double error = 0;
  const Surfaces body = fitted_superellipsoid(Vec3::Ones(), 2, 2, &error);
  EXPECT_LT(largest(body, off_unit_sphere), 1e-3);
  EXPECT_LT(error, 1e-3);
}

TEST(Fits, areDeterministic) {
  const ShapeFileContent a{smooth_ellipsoid(Vec3::Ones()), std::nullopt},
      b{smooth_ellipsoid(Vec3::Ones()), std::nullopt};
  EXPECT_EQ(write_shape(a), write_shape(b));
}

// --- bodies of a given inertia
// -------------------------------------------------------------------------------

Mat3 tensor(double xx, double yy, double zz, double xy, double xz, double yz) {
  Mat3 t;
  t << xx, xy, xz, xy, yy, yz, xz, yz, zz;
  return t;
}

TEST(Inertia, ofRandomTensorsIsMetToRoundOffFromAnyBody) {
  Random random(7);
  const Surfaces stone = pebble(), cuboid = box(Vec3(1, 2, 3));
  for (int k = 0; k < 20; ++k) {
    const Vec3 axes = random.box(0.2, 1);
    const Mat3 q = Quat(Eigen::AngleAxisd(random.uniform(0, 3), random.direction())).toRotationMatrix();
    const Vec3 square = axes.cwiseAbs2();
    const Mat3 gyration =
        1e-3 * q * Mat3((square.sum() * Vec3::Ones() - square).asDiagonal()) * q.transpose();
    Surfaces body = k % 2 == 0 ? stone : cuboid;
    match_gyration(body, gyration);
    const MassProperties mass = solid_properties(body);
    EXPECT_LT((mass.inertia / mass.volume - gyration).norm(), 1e-13 * gyration.norm());
    EXPECT_LT(mass.center.norm(), 1e-15);
  }
}

TEST(Inertia, thatNoSolidHasIsRefused) {
  EXPECT_THROW(ellipsoid_with_gyration(tensor(1, 1, 2.1, 0, 0, 0)), ShapeError);
  EXPECT_THROW(ellipsoid_with_gyration(tensor(1, 1, 2, 0, 0, 0)), ShapeError);  // a flat plate: no volume
  EXPECT_THROW(ellipsoid_with_gyration(tensor(-1, 1, 1, 0, 0, 0)), ShapeError);
  EXPECT_THROW(ellipsoid_with_gyration(tensor(1, 1, 1, 5, 0, 0)), ShapeError);
  EXPECT_THROW(ellipsoid_with_gyration(tensor(NAN, 1, 1, 0, 0, 0)), ShapeError);
}

struct PaperParticle {
  const char* file;
  double mass, density;
  Mat3 inertia;
  double height;  // of the centre of mass above the plane
};

// The paper's Table 1, whose J is per unit density.
const PaperParticle kPaper[] = {
    {"examples/two_particles/particle_a.json", 0.4874, 2697.6,
     2697.6e-7 * tensor(1.0292, 0.9332, 0.7996, -0.0361, 0.0243, 0.0915), 0.06},
    {"examples/two_particles/particle_b.json", 0.4619, 2692.3,
     2692.3e-7 * tensor(0.7675, 0.7862, 1.1259, 0, 0, 0), 0.13},
};

TEST(PaperParticles, ofTheExampleHaveMassAndInertiaOfTable1) {
  for (const PaperParticle& particle : kPaper) {
    std::vector<std::string> warnings;
    const auto shape = read_shape_file(particle.file, &warnings);
    EXPECT_TRUE(warnings.empty());
    ASSERT_EQ(shape->surfaces.size(), 6u);
    for (const NurbsSurface& s : shape->surfaces) EXPECT_EQ(s.points.size(), 16u);
    const double mass = particle.density * shape->mass.volume;
    EXPECT_NEAR(mass, particle.mass, 1e-4 * particle.mass);
    EXPECT_LT((mass * shape->gyration - particle.inertia).norm(), 1e-4 * particle.inertia.norm());
    EXPECT_LT((particle.mass * shape->gyration - particle.inertia).norm(), 1e-12 * particle.inertia.norm());
    EXPECT_LT(shape->mass.center.norm(), 1e-15);
    EXPECT_TRUE(shape->smooth);
    EXPECT_LT(shape->concavity, 1e-12 * shape->bounding_radius);
  }
}

TEST(PaperParticles, touchThePlaneWhenEllipsoidsOfThatInertiaDo) {
  const auto shape = read_shape_file(kPaper[0].file);
  const double fall = kPaper[0].height + find_support(*shape, -Vec3::UnitZ()).point.z();
  EXPECT_NEAR(std::sqrt(2 * fall / 9.81), 0.0637, 2e-4);
}

// --- rounded profiles

// The volume about z of a polygon (r, z).
double cone_volume(const std::vector<Vec2>& polygon) {
  double sum = 0;
  for (size_t k = 1; k < polygon.size(); ++k) {
    const double a = polygon[k - 1][0], b = polygon[k][0];
    sum += (polygon[k][1] - polygon[k - 1][1]) * (a * a + a * b + b * b) * M_PI / 3;
  }
  return sum;
}

TEST(RoundedProfile, bodies_lie_within_the_cut_of_their_polygon) {
  const std::vector<std::vector<Vec2>> polygons = {
      {{0, -1}, {1, -1}, {1, 1}, {0, 1}},                 // cylinder
      {{0, 0}, {1, 0}, {0, 2}},                           // cone
      {{0, -1}, {1, 0}, {0, 1.5}},                        // double cone
      {{0, 0}, {0.5, 0}, {1, 0.3}, {0.9, 1}, {0, 1.1}}};  // anything
  for (const auto& polygon : polygons)
    for (const double cut : {0.1, 0.01}) {
      const auto body = make_shape("body", revolve(rounded_profile(polygon, cut)));
      EXPECT_TRUE(body->smooth);
      EXPECT_LE(body->concavity, 1e-11);  // round-off, the more the flatter
      double far = 0;                     // of the body from a corner, most, the corners the farthest
      for (const Vec2& corner : polygon) {
        const Vec3 x = Vec3(corner[0], 0, corner[1]) - body->mass.center;
        double least = 1e300;
        for (const BezierPatch& patch : body->patches)
          for (int i = 0; i <= 64; ++i)
            for (int j = 0; j <= 64; ++j)
              least = std::min(least, (evaluate0(patch, i / 64.0, j / 64.0) - x).norm());
        far = std::max(far, least);
      }
      EXPECT_LE(far, 1.05 * cut + 1e-3);  // the grid's own distance
      const double whole = cone_volume(polygon);
      EXPECT_LT(body->mass.volume, whole * (1 + 1e-12));
      EXPECT_GT(body->mass.volume, whole * (1 - 4 * cut));
    }
}

TEST(RoundedProfile, of_a_cylinder_is_a_tablet) {
  const double rim = 0.2, cut = rim * (std::sqrt(2.0) - 1);
  const auto a = make_shape("a", revolve(rounded_profile({{0, -0.5}, {1, -0.5}, {1, 0.5}, {0, 0.5}}, cut))),
             b = make_shape("b", tablet(1, 1, rim));
  EXPECT_NEAR(a->mass.volume, b->mass.volume, 1e-12);
  EXPECT_NEAR(a->bounding_radius, b->bounding_radius, 1e-6);
  EXPECT_NEAR(a->patch_curvature.min_radius, b->patch_curvature.min_radius, 1e-9);
}

}  // namespace
}  // namespace nurbs::test_primitives

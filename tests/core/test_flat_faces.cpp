// Flat faces, creases, ruled lines and support sets of bodies whose features are known; polygons against
// dense sampling.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "body/flat_faces.h"
#include "body/support.h"
#include "nurbs/affine.h"
#include "support/bodies.h"
#include "support/flat_bodies.h"
#include "support/random.h"
#include "support/solids.h"

namespace nurbs::test_flat_faces {
namespace {

using namespace test;

// The body turned at random, so that nothing is aligned with an axis.
ShapePointer turned(const std::string& name, std::vector<NurbsSurface> body, const Quat& q) {
  transform(body, q.toRotationMatrix(), Vec3(0.3, -0.2, 0.5));
  return make_shape(name, std::move(body));
}

const FlatFace* face_along(const Shape& shape, const Vec3& d) {
  const int f = nearest_face(shape.flats, d, 1 - 1e-12);
  return f < 0 ? nullptr : &shape.flats.faces[f];
}

// Every outline: convex, counterclockwise from outside, in its plane, on the surface.
void expect_sound(const Shape& shape) {
  const FlatFeatures& flats = shape.flats;
  for (const FlatFace& face : flats.faces) {
    ASSERT_GE(face.corners.size(), 3u);
    ASSERT_LE(face.corners.size(), size_t(kContactPoints));
    ASSERT_LE(face.outline.size(), size_t(kOutlinePoints));
    EXPECT_NEAR(face.normal.dot(face.axis_u), 0, 1e-15);
    const int n = static_cast<int>(face.outline.size());
    for (int i = 0; i < n; ++i) {
      const Vec3& x = flats.vertices[face.outline[i]];
      EXPECT_NEAR(face.normal.dot(x), face.offset, 1e-12);
      const Vec3 d = (flats.vertices[face.outline[(i + 1) % n]] - x).cross(face.normal).normalized();
      for (const int v : face.outline) EXPECT_LE(d.dot(flats.vertices[v] - x), 1e-12);
      // A corner of the outline is where the body ends: a little outside its support, in the face's plane.
      const Vec3 out = (x - face.centroid).normalized();
      EXPECT_NEAR(find_hull_support(shape, face.normal).h, face.offset, 1e-12);
      EXPECT_GE(find_hull_support(shape, out).h, out.dot(x) - 1e-12);
    }
  }
  for (const StraightEdge& e : flats.edges) {
    const Vec3 arm = flats.vertices[e.ends[1]] - flats.vertices[e.ends[0]];
    EXPECT_NEAR(arm.normalized().dot(e.direction), 1, 1e-14);
  }
}

TEST(FlatFaces, round_bodies_have_none) {
  for (const ShapePointer& s : smooth_shapes()) EXPECT_TRUE(s->flats.empty()) << s->name;
  EXPECT_TRUE(kinked()->flats.empty());
  EXPECT_TRUE(make_shape("block", fitted_superellipsoid(Vec3(1, 1, 1), 6, 3))->flats.empty());
}

TEST(FlatFaces, box) {
  Random random(1);
  for (int trial = 0; trial < 5; ++trial) {
    const Quat q = random.turn();
    const Vec3 half(1, 0.8, 0.6);
    const ShapePointer s = turned("box", box(half), q);
    ASSERT_EQ(s->flats.faces.size(), 6u);
    ASSERT_EQ(s->flats.edges.size(), 12u);
    ASSERT_EQ(s->flats.vertices.size(), 8u);
    EXPECT_TRUE(s->flats.ruling.empty());
    expect_sound(*s);
    for (int k = 0; k < 3; ++k)
      for (const double side : {-1.0, 1.0}) {
        const FlatFace* f = face_along(*s, q * (side * Vec3::Unit(k)));
        ASSERT_NE(f, nullptr);
        EXPECT_NEAR(f->offset, half[k], 1e-14);
        EXPECT_NEAR(f->area, 4 * half[(k + 1) % 3] * half[(k + 2) % 3], 1e-13);
        EXPECT_LT((f->centroid - q * (side * half[k] * Vec3::Unit(k))).norm(), 1e-14);
        EXPECT_EQ(f->corners.size(), 4u);
        EXPECT_FALSE(f->round);
      }
  }
}

TEST(FlatFaces, cylinder_has_octagons_on_its_rims_and_lines_on_its_side) {
  Random random(2);
  const Quat q = random.turn();
  const ShapePointer s = turned("cylinder", cylinder(0.7, 1.5), q);
  ASSERT_EQ(s->flats.faces.size(), 2u);
  EXPECT_TRUE(s->flats.edges.empty());
  ASSERT_FALSE(s->flats.ruling.empty());
  EXPECT_EQ(std::count(s->flats.ruling.begin(), s->flats.ruling.end(), Ruling::along_v), 4);
  expect_sound(*s);
  for (const double side : {-1.0, 1.0}) {
    const FlatFace* f = face_along(*s, q * Vec3(0, 0, side));
    ASSERT_NE(f, nullptr);
    EXPECT_NEAR(f->area, M_PI * 0.49, 1e-11);
    EXPECT_LT((f->centroid - q * Vec3(0, 0, 1.5 * side)).norm(), 1e-12);
    EXPECT_TRUE(f->round);
    EXPECT_EQ(f->outline.size(), size_t(kOutlinePoints));
    ASSERT_EQ(f->corners.size(), 8u);
    const auto corner = [&](int i) { return s->flats.vertices[f->corners[i % 8]]; };
    for (int i = 0; i < 8; ++i) {
      EXPECT_NEAR((corner(i) - f->centroid).norm(), 0.7, 1e-12);
      EXPECT_NEAR((corner(i) - corner(i + 1)).norm(), 2 * 0.7 * std::sin(M_PI / 8), 1e-9);
    }
  }
  // Side lines: known from one support point anywhere on them.
  for (int trial = 0; trial < 20; ++trial) {
    const double angle = random.uniform(0, 2 * M_PI);
    const Vec3 d(std::cos(angle), std::sin(angle), 0);
    const SupportSet set = support_set(*s, q * d, 1e-9);
    ASSERT_EQ(set.count, 2);
    EXPECT_TRUE(set.ruled);
    for (int i = 0; i < 2; ++i) {
      const double z = (q.conjugate() * set.point[i])[2];
      EXPECT_LT((set.point[i] - q * (0.7 * d + Vec3(0, 0, z))).norm(), 1e-9);
      EXPECT_NEAR(std::abs(z), 1.5, 1e-12);
    }
    // Tilted by 1e-4 the ends lag by 3e-4.
    const Vec3 tilted = (q * (d + Vec3(0, 0, trial % 2 ? 1e-4 : -1e-4))).normalized();
    EXPECT_EQ(support_set(*s, tilted, 2e-4).count, 1);
    EXPECT_EQ(support_set(*s, tilted, 4e-4).count, 2);
  }
  EXPECT_EQ(support_set(*s, q * Vec3::UnitZ(), 1e-9).count, 8);
}

TEST(FlatFaces, tablet_has_a_ruled_band) {
  const ShapePointer s = make_shape("tablet", sharp_tablet(1, 0.3, 0.2));
  EXPECT_TRUE(s->flats.faces.empty());
  EXPECT_TRUE(s->flats.edges.empty());
  ASSERT_FALSE(s->flats.ruling.empty());
  const SupportSet set = support_set(*s, Vec3(0.6, 0.8, 0), 1e-9);
  ASSERT_EQ(set.count, 2);
  EXPECT_NEAR((set.point[0] - set.point[1]).norm(), 0.6, 1e-12);
  EXPECT_EQ(support_set(*s, Vec3(0.1, 0.2, 1).normalized(), 1e-9).count, 1);
}

TEST(FlatFaces, rounded_bodies) {
  Random random(3);
  const Quat q = random.turn();
  const ShapePointer s = turned("rounded box", rounded_box(Vec3(1, 0.8, 0.6), 0.2), q);
  ASSERT_EQ(s->flats.faces.size(), 6u);
  EXPECT_TRUE(s->flats.edges.empty());
  expect_sound(*s);
  EXPECT_NEAR(face_along(*s, q * Vec3::UnitZ())->area, 4 * 0.8 * 0.6, 1e-12);
  EXPECT_EQ(support_set(*s, q * Vec3::UnitZ(), 1e-9).count, 4);
  const SupportSet line = support_set(*s, q * Vec3(0, 0.6, 0.8), 1e-9);
  ASSERT_EQ(line.count, 2);
  EXPECT_NEAR((line.point[0] - line.point[1]).norm(), 1.6, 1e-12);
  EXPECT_EQ(support_set(*s, q * Vec3(1, 1, 1).normalized(), 1e-9).count, 1);

  const ShapePointer c = make_shape("rounded cylinder", rounded_cylinder(1, 1.5, 0.2));
  ASSERT_EQ(c->flats.faces.size(), 2u);
  expect_sound(*c);
  EXPECT_NEAR(c->flats.faces[0].area, M_PI * 0.64, 1e-11);
  EXPECT_EQ(c->flats.faces[0].corners.size(), 8u);
  // Its side is two rows of patches: the line crosses both.
  const SupportSet side = support_set(*c, Vec3(0.6, -0.8, 0), 1e-9);
  ASSERT_EQ(side.count, 2);
  EXPECT_NEAR((side.point[0] - side.point[1]).norm(), 2.6, 1e-12);
}

TEST(FlatFaces, prisms_join_fans_to_one_face) {
  for (const int sides : {3, 5, 8, 12, 40}) {
    const ShapePointer s = make_shape("prism", prism(sides, 1, 0.7));
    ASSERT_EQ(s->flats.faces.size(), size_t(sides + 2));
    ASSERT_EQ(s->flats.edges.size(), size_t(3 * sides));
    expect_sound(*s);
    const FlatFace* end = face_along(*s, Vec3::UnitZ());
    ASSERT_NE(end, nullptr);
    EXPECT_EQ(end->round, sides > kOutlinePoints);
    EXPECT_EQ(end->outline.size(), size_t(std::min(sides, kOutlinePoints)));
    EXPECT_EQ(end->corners.size(), size_t(std::min(sides, 8)));
    EXPECT_NEAR(end->area, 0.5 * sides * std::sin(2 * M_PI / sides), 1e-12);
  }
}

TEST(FlatFaces, pieces_of_a_face_and_of_an_edge_are_joined) {
  // A box whose faces are 2 x 2 surfaces each. (Knots alone would be taken out.)
  std::vector<NurbsSurface> body;
  for (const NurbsSurface& face : box(Vec3(1, 0.8, 0.6)))
    for (int k = 0; k < 4; ++k) {
      std::vector<Vec4> points;
      for (int i = 0; i < 2; ++i)
        for (int j = 0; j < 2; ++j) {
          const double u = 0.5 * (k / 2 + i), v = 0.5 * (k % 2 + j);
          points.push_back((1 - u) * ((1 - v) * face.points[0] + v * face.points[1]) +
                           u * ((1 - v) * face.points[2] + v * face.points[3]));
        }
      body.push_back(bezier_surface(1, 1, points));
    }
  const ShapePointer s = make_shape("pieces", body);
  EXPECT_EQ(s->patches.size(), 24u);
  EXPECT_EQ(s->flats.faces.size(), 6u);
  EXPECT_EQ(s->flats.edges.size(), 12u);
  for (const FlatFace& f : s->flats.faces) EXPECT_EQ(f.outline.size(), 4u);
}

// The support set is whole or a point; each point is within the tolerance, and no feature is overlooked.
TEST(FlatFaces, support_sets_against_vertices_of_a_box) {
  Random random(4);
  const ShapePointer s = cuboid();
  for (int trial = 0; trial < 2000; ++trial) {
    const int zeros = trial % 3;
    Vec3 d = random.direction();
    for (int k = 0; k < zeros; ++k) d[(trial / 3 + k) % 3] = random.uniform(-1e-4, 1e-4);
    d.normalize();
    const double tolerance = random.uniform(0, 5e-4);
    std::vector<Vec3> within;
    double h = -1, margin = 1;
    for (const Vec3& v : s->flats.vertices) h = std::max(h, d.dot(v));
    for (const Vec3& v : s->flats.vertices) {
      if (d.dot(v) >= h - tolerance) within.push_back(v);
      margin = std::min(margin, std::abs(d.dot(v) - (h - tolerance)));
    }
    if (margin < 1e-12) continue;
    const SupportSet set = support_set(*s, d, tolerance);
    EXPECT_NEAR(set.h, h, 1e-14);
    // Three corners within: the longer or lower of two edges; never the face.
    EXPECT_EQ(set.count, within.size() == 3 ? 2 : static_cast<int>(within.size()));
    for (int i = 0; i < set.count; ++i) EXPECT_GE(d.dot(set.point[i]), h - tolerance - 1e-14);
  }
}

// --- polygons

ConvexPolygon random_polygon(Random& random, int corners, const Vec2& middle, double radius) {
  std::vector<double> angle(corners);
  for (double& a : angle) a = random.uniform(0, 2 * M_PI);
  std::sort(angle.begin(), angle.end());
  ConvexPolygon p;
  for (const double a : angle) p.add(middle + radius * Vec2(std::cos(a), 0.6 * std::sin(a)));
  return p;
}

TEST(ConvexPolygon, intersection_against_dense_sampling) {
  Random random(5);
  int overlapping = 0;
  for (int trial = 0; trial < 60; ++trial) {
    const ConvexPolygon a = random_polygon(random, 3 + trial % 9, Vec2::Zero(), 1);
    const ConvexPolygon b = random_polygon(random, 3 + trial % 7,
                                           Vec2(random.uniform(-0.8, 0.8), random.uniform(-0.5, 0.5)), 0.8);
    const ConvexPolygon cut = intersect(a, b, 1e-12);
    const SideLines inside_a(a), inside_b(b), inside_cut(cut);
    constexpr int kGrid = 400;
    const double cell = 4.0 / kGrid;
    double area = 0;
    Vec2 sum = Vec2::Zero();
    for (int i = 0; i < kGrid; ++i)
      for (int j = 0; j < kGrid; ++j) {
        const Vec2 at(-2 + cell * (i + 0.5), -2 + cell * (j + 0.5));
        if (inside_a.depth_inside(at) < 0 || inside_b.depth_inside(at) < 0) continue;
        area += cell * cell;
        sum += cell * cell * at;
        EXPECT_TRUE(cut.count == 0 || inside_cut.depth_inside(at) >= -1e-12);
      }
    if (cut.count == 0) {
      EXPECT_LT(area, 20 * cell * cell);
      continue;
    }
    ++overlapping;
    EXPECT_NEAR(polygon_area(cut), area, 0.02);
    EXPECT_TRUE(area < 0.1 || (polygon_centroid(cut) - sum / area).norm() < 0.02);
    double least = HUGE_VAL;
    for (int i = 0; i < cut.count; ++i) least = std::min(least, inside_b.depth_inside(cut.corner[i]));
    EXPECT_NEAR(depth_inside(b, cut), least, 1e-15);  // two ways of rounding
    EXPECT_GE(least, -1e-12);
    // Sources: every corner lies on the sides it is said to come from.
    for (int i = 0; i < cut.count; ++i)
      for (const int k : {i, cut.before(i)}) {
        const ConvexPolygon& from = cut.owner[k] == 0 ? a : b;
        const Vec2& p = from.corner[cut.side[k]];
        const Vec2 along = (from.corner[from.next(cut.side[k])] - p).normalized();
        EXPECT_NEAR(cross2(along, cut.corner[i] - p), 0, 1e-9);
      }
  }
  EXPECT_GT(overlapping, 30);
}

TEST(ConvexPolygon, coinciding_polygons_keep_their_own_corners) {
  Random random(6);
  const ConvexPolygon a = random_polygon(random, 8, Vec2::Zero(), 1);
  for (int trial = 0; trial < 50; ++trial) {
    ConvexPolygon b = a;
    for (int i = 0; i < b.count; ++i)
      b.corner[i] += 1e-13 * Vec2(random.uniform(-1, 1), random.uniform(-1, 1));
    const ConvexPolygon cut = intersect(a, b, 1e-9);
    ASSERT_EQ(cut.count, a.count);
    for (int i = 0; i < cut.count; ++i) EXPECT_EQ(cut.owner[i], 0);
  }
}

TEST(ConvexPolygon, weights_stand_for_a_uniform_load) {
  Random random(7);
  for (int trial = 0; trial < 200; ++trial) {
    const ConvexPolygon p = random_polygon(random, 3 + trial % 6, Vec2(0.3, -0.2), 1);
    if (polygon_area(p) < 0.05) continue;
    double w[ConvexPolygon::kMost];
    corner_weights(p, polygon_centroid(p), w);
    double sum = 0;
    Vec2 centre = Vec2::Zero();
    for (int i = 0; i < p.count; ++i) {
      EXPECT_GT(w[i], 0);
      sum += w[i];
      centre += w[i] * p.corner[i];
    }
    EXPECT_NEAR(sum, 1, 1e-14);
    EXPECT_LT((centre - polygon_centroid(p)).norm(), 1e-14);
    // Another centre, within the bounds set to weights.
    if (polygon_area(p) < 0.5) continue;
    const Vec2 moved = polygon_centroid(p) + Vec2(0.01, -0.02);
    corner_weights(p, moved, w);
    centre.setZero();
    for (int i = 0; i < p.count; ++i) centre += w[i] * p.corner[i];
    EXPECT_LT((centre - moved).norm(), 1e-13);
  }
  ConvexPolygon rectangle;
  for (const Vec2& c : {Vec2(-3, -1), Vec2(3, -1), Vec2(3, 1), Vec2(-3, 1)}) rectangle.add(c);
  double w[ConvexPolygon::kMost];
  corner_weights(rectangle, Vec2::Zero(), w);
  for (int i = 0; i < 4; ++i) EXPECT_DOUBLE_EQ(w[i], 0.25);
  // Cutting off a tiny corner shares its weight between the two that replace it.
  ConvexPolygon cut;
  for (const Vec2& c : {Vec2(-3, -1), Vec2(3, -1), Vec2(3, 1 - 1e-7), Vec2(3 - 1e-7, 1), Vec2(-3, 1)})
    cut.add(c);
  corner_weights(cut, polygon_centroid(cut), w);
  EXPECT_NEAR(w[2] + w[3], 0.25, 1e-6);
  EXPECT_NEAR(w[0], 0.25, 1e-6);
}

TEST(ConvexPolygon, thinning_keeps_regular_polygons_regular_and_the_lead) {
  ConvexPolygon p;
  for (int k = 0; k < 32; ++k) p.add(Vec2(std::cos(k * M_PI / 16), std::sin(k * M_PI / 16)));
  for (int lead = 0; lead < 32; ++lead) {
    int kept[ConvexPolygon::kMost];
    ASSERT_EQ(thin(p, 8, lead, kept), 8);
    for (int i = 0; i < 8; ++i) EXPECT_EQ(kept[i] % 4, lead % 4);
  }
}

// A crease beside a ruled side that bulges past it lags behind the support. The points that a body stands on
// were the crease's all the same, above the plane: a prism over a Reuleaux triangle that rolled on a plane
// had no contact in every sixth step.
TEST(FlatFaces, creases_beside_the_support_are_none) {
  Random random(7);
  const Solid prism = reuleaux_prism(random, 0.6);
  const Shape& shape = *prism.shape;
  const int cap = shape.flats.faces.empty() ? -1 : 0;
  ASSERT_EQ(cap, 0);
  const Vec3 axis = shape.flats.faces[cap].normal;
  int ruled = 0, creases = 0;
  for (int k = 0; k < 4000; ++k) {
    const double lean = random.uniform(-0.05, 0.05);  // of the axis out of the plane
    const Vec3 d = (axis.cross(random.direction()).normalized() + lean * axis).normalized();
    const double overlap = random.log_uniform(1e-4, 0.03);
    for (const double reach : {3.0, 12.0}) {
      const SupportSet set = support_set(shape, d, reach * overlap);
      if (set.count < 2) continue;
      double highest = -1e300, lowest = 1e300;
      for (int i = 0; i < set.count; ++i) {
        highest = std::max(highest, d.dot(set.point[i]));
        lowest = std::min(lowest, d.dot(set.point[i]));
      }
      EXPECT_GE(highest, set.h - 0.5 * overlap - 1e-12);
      EXPECT_GE(lowest, set.h - reach * overlap - 1e-12);
      ++(set.ruled ? ruled : creases);
    }
  }
  EXPECT_GT(ruled, 500);
  EXPECT_GT(creases, 500);
}

}  // namespace
}  // namespace nurbs::test_flat_faces

// The growing hull alone: convex and closed after every point, whatever order and however degenerate, and
// untouched by a growth that fails.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "contact/overlap/face_distances.h"
#include "contact/overlap/growing_hull.h"
#include "support/random.h"

namespace nurbs::test_growing_hull {
namespace {

using test::Random;
using Growth = GrowingHull::Growth;

constexpr double kSliverHeight = 1e-13, kEps = 1e-13;

int alive(const GrowingHull& hull) {
  int n = 0;
  for (int k = 0; k < hull.faces(); ++k) n += hull.face(k).alive;
  return n;
}

// How far the highest stored point lies above a face.
double worst_height(const GrowingHull& hull) {
  double worst = 0;
  for (int k = 0; k < hull.faces(); ++k) {
    const GrowingHull::Face& f = hull.face(k);
    if (!f.alive || f.sliver) continue;
    for (int p = 0; p < hull.points(); ++p) worst = std::max(worst, f.normal.dot(hull.point(p)) - f.offset);
  }
  return worst;
}

std::unique_ptr<GrowingHull> tetrahedron() {
  auto hull = std::make_unique<GrowingHull>(kSliverHeight);
  for (const Vec3& p : {Vec3(1, 1, 1), Vec3(1, -1, -1), Vec3(-1, 1, -1), Vec3(-1, -1, 1)}) hull->store(p);
  EXPECT_TRUE(hull->start(0, 1, 2, 3));
  return hull;
}

TEST(GrowingHull, a_tetrahedron_is_closed_and_knows_its_nearest_face) {
  const auto hull = tetrahedron();
  EXPECT_TRUE(hull->closed());
  EXPECT_EQ(alive(*hull), 4);
  const GrowingHull::Nearest near = hull->nearest();
  EXPECT_TRUE(near.inside);
  EXPECT_NEAR(std::sqrt(near.distance2), 1 / std::sqrt(3.0), 1e-15);
}

// A needle along a line that passes the origin closely: corners 1 away, height and distance a 1e-11th of it.
TEST(GrowingHull, foot_of_a_needle) {
  Random random(7);
  for (int k = 0; k < 2000; ++k) {
    const Quat turn = random.turn();
    const double height = random.log_uniform(1e-11, 1), in = random.uniform(0.1, 0.9) * height,
                 off = random.log_uniform(1e-12, 1e-2), at = random.uniform(-0.9, 0.9);
    // The third corner stands over the long side where the foot does, give or take.
    Vec3 corner[3] = {Vec3(-1, -in, off), Vec3(1, -in, off), Vec3(at, height - in, off)};
    const double between = in / height;
    if (!(std::abs(at * between) < 1 - between)) continue;
    auto hull = std::make_unique<GrowingHull>(kSliverHeight);
    const int first = random.below(3);
    for (int i = 0; i < 3; ++i) hull->store(turn * corner[(first + i) % 3]);
    hull->store(turn * Vec3(0, 0, 5));
    ASSERT_TRUE(hull->start(0, 1, 2, 3));
    const GrowingHull::Nearest near = hull->nearest();
    EXPECT_FALSE(near.inside) << k;
    EXPECT_NEAR(std::sqrt(near.distance2), off, 1e-15 + 2e-3 * off) << k;
  }
}

// Of triangles without some vertices, while the hull grows, moves to other targets and begins again.
TEST(FaceDistances, are_those_of_all_triangles_however_the_hull_grows) {
  Random random(3);
  const auto left_out = [](short v) { return v % 5 == 3; };
  for (int body = 0; body < 30; ++body) {
    const auto hull = tetrahedron();
    const auto distances = std::make_unique<FaceDistances>();
    Vec3 target = random.uniform(0, 3) * random.direction();
    for (int k = 0; k < 150; ++k) {
      if (random.below(20) == 0) target = random.uniform(0, 3) * random.direction();
      if (k == 100) {
        ASSERT_TRUE(hull->start(4, 5, 6, 7));
        distances->forget();
      }
      const FaceDistances::Nearest near = distances->nearest(*hull, target, left_out);
      double least = kFarAway;
      for (int f = 0; f < hull->faces(); ++f) {
        const GrowingHull::Face& face = hull->face(f);
        if (!face.alive || std::any_of(face.vertex.begin(), face.vertex.end(), left_out)) continue;
        const Vec3 p = hull->point(face.vertex[0]) - target, q = hull->point(face.vertex[1]) - target,
                   r = hull->point(face.vertex[2]) - target, w = nearest_on_triangle(p, q, r);
        least = std::min(least, (w[0] * p + w[1] * q + w[2] * r).squaredNorm());
      }
      ASSERT_EQ(near.distance2, least) << body << " " << k;
      ASSERT_EQ(near.face < 0, least == kFarAway);
      hull->grow(hull->store(random.uniform(0.8, 2) * random.direction()), kEps);
    }
  }
}

TEST(GrowingHull, stays_convex_and_closed_over_random_points) {
  Random random(1);
  for (int body = 0; body < 40; ++body) {
    auto hull = std::make_unique<GrowingHull>(kSliverHeight);
    for (int k = 0; k < 4; ++k) hull->store(random.direction());
    ASSERT_TRUE(hull->start(0, 1, 2, 3));
    for (int k = 0; k < 150; ++k) {
      const bool on_ball = k % 2;
      const Vec3 p = on_ball ? random.direction() : random.box(-1, 1);
      const Growth growth = hull->grow(hull->store(p), kEps);
      ASSERT_TRUE(growth == Growth::grown || growth == Growth::inside);
    }
    EXPECT_TRUE(hull->closed());
    EXPECT_LT(worst_height(*hull), 1e-12);
    EXPECT_EQ(alive(*hull) % 2, 0);  // Euler: F = 2 V - 4
  }
}

// Points of a lattice: many on every plane, edge and corner, in any order. Some are refused there (what they
// see is no disc up to round-off); the surface stays closed and inside the true hull.
TEST(GrowingHull, stays_closed_and_inside_on_a_lattice) {
  Random random(2);
  for (int body = 0; body < 60; ++body) {
    const Quat turn = body % 3 ? random.turn() : Quat::Identity();
    std::vector<Vec3> points;
    for (int i = 0; i < 5; ++i)
      for (int j = 0; j < 5; ++j)
        for (int k = 0; k < 5; ++k) points.push_back(turn * Vec3(i - 2, j - 2, k - 2));
    std::shuffle(points.begin(), points.end(), random.engine());
    auto hull = std::make_unique<GrowingHull>(kSliverHeight);
    for (const Vec3& corner : {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, 1)})
      hull->store(turn * corner);
    ASSERT_TRUE(hull->start(0, 1, 2, 3));
    for (const Vec3& p : points) ASSERT_NE(hull->grow(hull->store(p), 1e-12), Growth::full);
    EXPECT_TRUE(hull->closed());
    if (hull->nearest().inside) {
      EXPECT_LE(std::sqrt(hull->nearest().distance2), 2 + 1e-12);
    }
  }
}

// Needles between a small body's details and a corner of one a million times as large, whose nearest point to
// the origin is known: the plane of the triangle is `height` away, its foot inside or beside an edge.
TEST(GrowingHull, needles_know_their_plane_and_their_nearest_point) {
  Random random(4);
  for (int k = 0; k < 2000; ++k) {
    const double length = random.log_uniform(1, 1e6), width = random.log_uniform(1e-6, 1),
                 height = random.log_uniform(1e-6, 1);
    const int where = k % 3;
    const double back = where == 1 ? random.uniform(1, 2) * width : random.log_uniform(1e-6, 1);
    const Quat turn = random.turn();
    const auto at = [&](double x, double y) -> Vec3 { return turn * Vec3(x, y, height); };
    // The foot is inside, beside a long edge, or before the short one.
    const double shift = where == 1 ? 2 * width : 0;
    const Vec3 tip = at(length, shift), low = at(where == 2 ? back : -back, shift - width),
               high = at(where == 2 ? back : -back, shift + width);
    Vec3 corner[3] = {tip, low, high};
    std::rotate(corner, corner + k % 5 % 3, corner + 3);
    double nearest = height;
    if (where == 1) {
      const double along = length + back,
                   off = (2 * width * along - width * length) / std::hypot(along, width);
      nearest = std::hypot(height, off);
    } else if (where == 2) {
      nearest = std::hypot(height, back);
    }
    const Vec3 w = nearest_on_triangle(corner[0], corner[1], corner[2]);
    EXPECT_NEAR(w.sum(), 1, 1e-15);
    EXPECT_GE(w.minCoeff(), 0);
    const double found = (w[0] * corner[0] + w[1] * corner[1] + w[2] * corner[2]).norm();
    const double allowed = 1e-14 + 4e-16 / width * nearest;  // the corners' own round-off
    EXPECT_NEAR(found, nearest, allowed) << k << ": " << length << " x " << width << ", " << height;
    GrowingHull hull(1e-13 * length);
    for (const Vec3& c : corner) hull.store(c);
    hull.store(turn * Vec3(0, 0, -length));
    ASSERT_TRUE(hull.start(0, 1, 2, 3));
    const GrowingHull::Face& f = hull.face(0);
    if (!f.sliver) {
      EXPECT_NEAR(f.offset, height, 4e-16 * length + allowed) << k << ": " << length << " x " << width;
    }
  }
}

// Two corners a round-off apart, far from the origin: what is nearest on the edge between them is any of it,
// and no place beyond.
TEST(GrowingHull, nearest_point_of_a_far_needle_is_on_it) {
  Random random(13);
  for (int k = 0; k < 2000; ++k) {
    const double far = random.log_uniform(1e3, 1e8);
    const Vec3 p = far * random.direction(),
               q = p + random.log_uniform(1e-17, 1e-14) * far * random.direction(),
               r = p * random.uniform(1, 3) + far * random.direction();
    const Vec3 w = nearest_on_triangle(p, q, r);
    EXPECT_GE(w.minCoeff(), 0) << k;
    EXPECT_NEAR(w.sum(), 1, 1e-15) << k;
  }
}

TEST(GrowingHull, four_points_of_a_plane_are_no_start) {
  GrowingHull hull(kSliverHeight);
  for (const Vec3& p : {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(1, 1, 0), Vec3(0, 0, 1)})
    hull.store(p);
  EXPECT_FALSE(hull.start(0, 1, 2, 3));
  EXPECT_EQ(hull.nearest().face, -1);
  EXPECT_TRUE(hull.start(0, 1, 2, 4));
  EXPECT_TRUE(hull.closed());
}

// A growth that fails leaves the surface as it was, and the next one that succeeds starts from that.
TEST(GrowingHull, a_point_that_is_refused_changes_nothing) {
  const auto hull = tetrahedron();
  const int before = alive(*hull);
  EXPECT_EQ(hull->grow(hull->store(Vec3(0.1, 0, 0)), kEps), Growth::inside);
  EXPECT_EQ(hull->grow(hull->store(Vec3::Constant(std::nan(""))), kEps), Growth::inside);
  EXPECT_EQ(alive(*hull), before);
  EXPECT_TRUE(hull->closed());
  EXPECT_EQ(hull->grow(hull->store(Vec3(-2, -2, -2)), kEps), Growth::grown);
  EXPECT_EQ(alive(*hull), 6);
  EXPECT_TRUE(hull->closed());
}

TEST(GrowingHull, says_when_it_is_full) {
  Random random(3);
  const auto hull = tetrahedron();
  while (hull->points() < kHullVertices)
    ASSERT_EQ(hull->grow(hull->store(2 * random.direction()), kEps) == Growth::broken, false);
  EXPECT_EQ(hull->store(Vec3::Zero()), -1);
  EXPECT_TRUE(hull->closed());
}

TEST(GrowingHull, origin_outside_is_as_far_as_the_nearest_triangle) {
  auto hull = std::make_unique<GrowingHull>(kSliverHeight);
  for (const Vec3& p : {Vec3(3, 1, 0), Vec3(3, -1, 0), Vec3(4, 0, 1), Vec3(4, 0, -1)}) hull->store(p);
  ASSERT_TRUE(hull->start(0, 1, 2, 3));
  const GrowingHull::Nearest near = hull->nearest();
  EXPECT_FALSE(near.inside);
  EXPECT_NEAR(std::sqrt(near.distance2), 3, 1e-15);
}

}  // namespace
}  // namespace nurbs::test_growing_hull

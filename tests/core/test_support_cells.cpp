// The pieces of patches that a cell of directions keeps hold every support along them, whatever the body, and
// searches that look at nothing else find the same as those over all patches.
#include <gtest/gtest.h>

#include <thread>

#include "body/connectivity.h"
#include "body/cube_map.h"
#include "body/local_form.h"
#include "body/patch_maximum.h"
#include "nurbs/tolerances.h"
#include "shapes/revolved.h"
#include "support/bodies.h"
#include "support/random.h"
#include "support/solids.h"

namespace nurbs::test_support_cells {
namespace {

using namespace test;

ShapePointer blocky() {  // closing joints and dents: a seventh of its directions need the cells
  static const ShapePointer s = make_shape("blocky", fitted_superellipsoid(Vec3(1, 0.9, 0.8), 4, 3));
  return s;
}
std::vector<ShapePointer> dented_shapes() {
  static const ShapePointer even = make_shape("even", fitted_superellipsoid({1, 0.7, 0.5}, 4, 4)),
                            boxy = make_shape("boxy", fitted_superellipsoid({1, 1, 0.4}, 8, 3));
  return {blocky(), even, boxy};
}
// Of every kind: rational and not, poles, collapsed edges, creases, corners.
std::vector<ShapePointer> any_shapes() {
  static const std::vector<ShapePointer> solids = [] {
    Random random(8);
    std::vector<ShapePointer> s;
    for (const Solid& solid : {cone(random, 1, 1.5, 30), lens(random, 1.2), sphericon(random),
                               polyhedron(random, 20, 0.7, 5), reuleaux_prism(random, 0.4)})
      s.push_back(solid.shape);
    for (const auto& surfaces : {capsule(0.5, 0.5), tablet(1, 0.5, 0.2), egg(1, 1.1, 1.4)})
      s.push_back(make_shape("of revolution", surfaces));
    return s;
  }();
  std::vector<ShapePointer> shapes = dented_shapes();
  for (const ShapePointer& s : {kinked(), ellipsoid(), disc(), smooth_pebble(), polar(), cuboid()})
    shapes.push_back(s);
  shapes.insert(shapes.end(), solids.begin(), solids.end());
  return shapes;
}

// Random directions, ones on the cells' borders and corners, and normals beside joints.
Vec3 some_direction(const Shape& shape, Random& random) {
  const auto on_border = [&] { return 2.0 * random.below(kSupportCells + 1) / kSupportCells - 1; };
  switch (random.below(4)) {
    case 0:
      return random.direction();
    case 1:
      return from_cube(random.below(6), on_border(), random.uniform(-1, 1)).normalized();
    case 2:
      return from_cube(random.below(6), on_border(), on_border()).normalized();
    default:
      break;
  }
  const int p = random.below(static_cast<int>(shape.patches.size())), edge = random.below(4);
  Vec2 at = edge_parameters(edge, random.uniform(0, 1));
  at[edge / 2] += (edge % 2 ? -1 : 1) * std::pow(10.0, random.uniform(-9, -1.5));
  const Vec3 n = local_form(shape.patches[p], at[0], at[1]).normal;
  if (!(n.norm() > 0.5)) return random.direction();
  return (n + std::pow(10.0, random.uniform(-9, -2)) * random.direction()).normalized();
}

Support over_all(const Shape& shape, const Vec3& d, Random& random) {
  const SurfacePoint start{random.below(static_cast<int>(shape.patches.size())), random.uniform(0, 1),
                           random.uniform(0, 1)};
  return search_all_patches(shape, d, start);
}

TEST(SupportCells, hold_every_support_of_any_body) {
  Random random(1);
  for (const ShapePointer& shape : any_shapes()) {
    const double size = shape->bounding_radius, slack = kSupportSlack * kRoundoff * size;
    for (int k = 0; k < 1500; ++k) {
      const Vec3 d = some_direction(*shape, random);
      Highest top{{-1, 0, 0}, -size, -size + slack, 0};
      for (const PatchPiece& piece : shape->support_cells.at(*shape, d)->pieces)
        raise(shape->patches[piece.patch], piece, d, slack, &top);
      const double all = over_all(*shape, d, random).h;
      ASSERT_NEAR(top.h, all, 1e-14 * size) << shape->name;
      ASSERT_GE(top.upper, all - kRoundoff * size) << shape->name;
      if (k % 100 != 0) continue;
      const double sampled = sampled_support(*shape, d);  // shares nothing but the surface with either
      ASSERT_LE(sampled, top.upper + kRoundoff * size) << shape->name;
      ASSERT_GE(sampled, top.h - 1e-4 * size) << shape->name;
    }
  }
}

TEST(SupportCells, searches_of_dented_bodies_find_the_highest_of_all_patches) {
  Random random(2);
  for (const ShapePointer& shape : dented_shapes()) {
    int searched = 0;
    for (int k = 0; k < 20000 && searched < 3000; ++k) {
      const Vec3 d = some_direction(*shape, random);
      if (shape->normal_map.radius_at(d) < kFarAway) continue;
      ++searched;
      const Support all = over_all(*shape, d, random), hull = find_hull_support(*shape, d);
      ASSERT_NEAR(hull.h, all.h, 1e-14) << shape->name;
      ASSERT_TRUE(hull.upper >= all.h && hull.upper <= all.upper + 1e-14) << shape->name;
      // From any point, also one far below.
      const SurfacePoint low{random.below(static_cast<int>(shape->patches.size())), random.uniform(0, 1),
                             random.uniform(0, 1)};
      const Support confirmed = confirm_support(*shape, d, low);
      ASSERT_NEAR(confirmed.h, all.h, 1e-14) << shape->name;
      ASSERT_GE(confirmed.upper, all.h) << shape->name;
    }
    EXPECT_TRUE(shape->dented() && searched > 300) << shape->name << ", " << searched;
  }
}

TEST(SupportCells, are_small_where_a_body_is_round) {
  Random random(3);
  double area = 0;
  int pieces = 0;
  for (int k = 0; k < 1000; ++k)
    for (const PatchPiece& piece : blocky()->support_cells.at(*blocky(), random.direction())->pieces) {
      area += (piece.u1 - piece.u0) * (piece.v1 - piece.v0);
      ++pieces;
    }
  EXPECT_LT(pieces, 2000);  // of 54 patches
  EXPECT_LT(area, 100);
}

TEST(SupportCells, do_not_depend_on_who_asks_first) {
  const auto shape = [] { return make_shape("even", fitted_superellipsoid({1, 0.7, 0.5}, 3, 2)); };
  const ShapePointer one = shape(), other = shape();
  Random random(4);
  std::vector<Vec3> directions;
  for (int k = 0; k < 400; ++k) directions.push_back(random.direction());
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t)
    threads.emplace_back([&, t] {
      for (size_t k = 0; k < directions.size(); ++k)
        one->support_cells.at(*one, directions[(k + 50 * t) % directions.size()]);
    });
  for (std::thread& thread : threads) thread.join();
  const auto same = [](const PatchPiece& a, const PatchPiece& b) {
    return a.patch == b.patch && a.u0 == b.u0 && a.u1 == b.u1 && a.v0 == b.v0 && a.v1 == b.v1;
  };
  for (auto d = directions.rbegin(); d != directions.rend(); ++d) {
    const auto &a = one->support_cells.at(*one, *d)->pieces, &b = other->support_cells.at(*other, *d)->pieces;
    ASSERT_TRUE(a.size() == b.size() && std::equal(a.begin(), a.end(), b.begin(), same));
  }
}

TEST(SupportCells, have_none_for_what_is_no_direction) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(blocky()->support_cells.at(*blocky(), Vec3::Zero()), nullptr);
  EXPECT_EQ(blocky()->support_cells.at(*blocky(), Vec3(nan, nan, nan)), nullptr);
}

// A piece's highest point is in it, and no sample of it is higher.
TEST(PatchMaximum, of_a_piece_is_that_of_its_part_of_the_patch) {
  Random random(5);
  for (const ShapePointer& shape : any_shapes()) {
    if (shape->bilinear) continue;  // their pieces are not cut
    const double size = shape->bounding_radius, slack = kSupportSlack * kRoundoff * size;
    for (int k = 0; k < 100; ++k) {
      const int p = random.below(static_cast<int>(shape->patches.size()));
      const auto range = [&](float* low, float* high) {
        const int a = random.below(kSupportPieces), b = random.below(kSupportPieces);
        *low = static_cast<float>(std::min(a, b)) / kSupportPieces;
        *high = static_cast<float>(std::max(a, b) + 1) / kSupportPieces;
      };
      PatchPiece piece{p};
      range(&piece.u0, &piece.u1);
      range(&piece.v0, &piece.v1);
      const Vec3 d = random.direction();
      Highest top{{-1, 0, 0}, -2 * size, -2 * size, 0};
      raise(shape->patches[p], piece, d, slack, &top);
      ASSERT_EQ(top.where.patch, p);
      if (shape->patches[p].degree_u > 1 || shape->patches[p].degree_v > 1) {
        ASSERT_TRUE(top.where.u >= piece.u0 && top.where.u <= piece.u1) << shape->name;
        ASSERT_TRUE(top.where.v >= piece.v0 && top.where.v <= piece.v1) << shape->name;
      }
      ASSERT_NEAR(evaluate0(shape->patches[p], top.where.u, top.where.v).dot(d), top.h, 1e-14 * size);
      constexpr int n = 30;
      for (int i = 0; i <= n; ++i)
        for (int j = 0; j <= n; ++j) {
          const double u = piece.u0 + (piece.u1 - piece.u0) * i / n,
                       v = piece.v0 + (piece.v1 - piece.v0) * j / n;
          ASSERT_LE(evaluate0(shape->patches[p], u, v).dot(d), top.upper + kRoundoff * size) << shape->name;
        }
    }
  }
}

}  // namespace
}  // namespace nurbs::test_support_cells

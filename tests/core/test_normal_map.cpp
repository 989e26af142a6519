// The normal map's promise, against searches of the whole surface.
#include <gtest/gtest.h>

#include "body/joints.h"
#include "contact/pair_search.h"
#include "nurbs/tolerances.h"
#include "shapes/revolved.h"
#include "support/bodies.h"
#include "support/hidden_dents.h"
#include "support/random.h"

namespace nurbs::test_normal_map {
namespace {

using namespace test;

ShapePointer blocky() {  // flats dented and joints kinked by the fit
  static const ShapePointer s = make_shape("blocky", fitted_superellipsoid(Vec3(1, 0.9, 0.8), 4, 3));
  return s;
}

struct Seen {
  int promised = 0, all = 0;
  double closest = 0;  // largest share of the promised excess that was there
};

Seen check(const Shape& shape, int directions) {
  Random random(4);
  Seen seen;
  for (int k = 0; k < directions; ++k) {
    const Vec3 n = random.direction();
    const double r = shape.normal_map.radius_at(n);
    ++seen.all;
    if (!(r < kFarAway)) continue;
    ++seen.promised;
    const Support at = find_support(shape, n);
    EXPECT_NEAR(at.h, exhaustive_support(shape, n), 1e-13) << shape.name << " has two support points";
    const Vec3 d = (n + random.uniform(0, 0.99) * kNormalMargin * n.unitOrthogonal()).normalized();
    const double excess = exhaustive_support(shape, d) - d.dot(at.point);
    const double allowed = 0.5 * r * (d - n).squaredNorm();
    EXPECT_LE(excess, allowed + 1e-14) << shape.name;
    if (allowed > 1e-9) seen.closest = std::max(seen.closest, excess / allowed);
  }
  return seen;
}

TEST(NormalMap, bounds_supports_near_every_normal_it_promises_for) {
  const Seen disc_seen = check(*disc(), 600), blocky_seen = check(*blocky(), 120);
  EXPECT_EQ(disc_seen.promised, disc_seen.all);
  EXPECT_GT(blocky_seen.promised, 0.6 * blocky_seen.all);
  for (const Seen& seen : {disc_seen, blocky_seen})
    EXPECT_GT(seen.closest, 0.3) << "the promise is so loose that the test shows nothing";
}

TEST(NormalMap, promises_nothing_across_dents) {
  // Where two support points compete, on either side of a closing joint, nothing may be promised.
  const Shape& shape = *blocky();
  Random random(5);
  int rivals = 0;
  for (int k = 0; k < 700; ++k) {
    const Vec3 d = random.direction();
    const Maxima found = all_maxima(shape, d);
    if (!(found.rival > found.best - 1e-4)) continue;
    ++rivals;
    EXPECT_FALSE(shape.normal_map.radius_at(d) < kFarAway);
  }
  EXPECT_GT(rivals, 10);
}

TEST(NormalMap, is_not_made_where_one_radius_serves) {
  EXPECT_EQ(smooth_pebble()->normal_map.cells, 0);
  EXPECT_EQ(ellipsoid()->normal_map.cells, 0);
}

// A block whose top is z = f(x) + g(y), sharp-edged: f of degree 4 with a dent in the middle for `dent` >
// 0.01, g a parabola of height `crown` / 2, 0: the top is ruled. `uneven`: ratio of the weights along x,
// which moves parameters and no point.
struct Block {
  double f[5], crown;
  ShapePointer shape;

  Block(double dent, double crown, double uneven) : f{0, 0.06, 0.06 - 5 * dent, 0.06, 0}, crown(crown) {
    std::vector<NurbsSurface> s;
    const double depth = 1;
    const auto net = [&](int nx, int ny, const auto& point) {
      std::vector<Vec4> points;
      for (int i = 0; i <= nx; ++i)
        for (int j = 0; j <= ny; ++j) {
          const double w = std::pow(uneven, nx == 4 ? i / 4.0 : 0);
          const Vec3 x = point(i, j);
          points.emplace_back(w * x[0], w * x[1], w * x[2], w);
        }
      s.push_back(bezier_surface(nx, ny, points));
    };
    const auto top = [&](int i, int j) { return f[i] + (j == 1 ? crown : 0); };
    net(4, 2, [&](int i, int j) { return Vec3(-1 + i / 2.0, -1 + j, top(i, j)); });
    net(4, 2, [&](int i, int j) { return Vec3(-1 + i / 2.0, -1 + j, -depth); });
    for (const int end : {0, 4})
      net(2, 1, [&](int j, int k) { return Vec3(-1 + end / 2.0, -1 + j, k ? -depth : top(end, j)); });
    for (const int end : {0, 2})
      net(4, 1, [&](int i, int k) { return Vec3(-1 + i / 2.0, -1 + end, k ? -depth : top(i, end)); });
    shape = make_shape("block", s);
  }

  // Of directions that look up, from the two polynomials alone.
  double support(const Vec3& d) const {
    const auto along_x = [&](double t) {
      const double u = 1 - t;
      const double z = f[0] * u * u * u * u + 4 * f[1] * u * u * u * t + 6 * f[2] * u * u * t * t +
                       4 * f[3] * u * t * t * t + f[4] * t * t * t * t;
      return d[0] * (2 * t - 1) + d[2] * z;
    };
    const int n = 1000;
    double best = -1e300;
    for (int i = 0; i <= n; ++i) {
      const double here = along_x(double(i) / n);
      if ((i > 0 && along_x((i - 1.0) / n) > here) || (i < n && along_x((i + 1.0) / n) > here)) continue;
      double low = std::max(0.0, (i - 1.0) / n), high = std::min(1.0, (i + 1.0) / n);
      for (int k = 0; k < 100; ++k) {
        const double a = low + 0.382 * (high - low), b = low + 0.618 * (high - low);
        (along_x(a) < along_x(b) ? low : high) = along_x(a) < along_x(b) ? a : b;
      }
      best = std::max(best, along_x(0.5 * (low + high)));
    }
    const double y = crown > 0 ? std::clamp(d[1] / (crown * d[2]), -1.0, 1.0) : (d[1] > 0 ? 1 : -1);
    return best + d[1] * y + d[2] * 0.5 * crown * (1 - y * y) - d.dot(shape->mass.center);
  }
};

// Between the sides of a sharp edge that runs through a dent two points of the edge compete.
TEST(NormalMap, promises_nothing_on_edges_that_run_through_dents) {
  Random random(6);
  for (const double uneven : {1.0, 30.0, 3e3})
    for (const double crown : {0.2, 0.0}) {
      const Block block(0.014, crown, uneven);
      EXPECT_GT(block.shape->concavity, 2e-4 * block.shape->bounding_radius) << uneven << " " << crown;
      for (int k = 0; k < 3000; ++k) {
        const Vec3 d =
            Vec3((k % 2 ? 1 : -1) * random.log_uniform(1e-8, 0.1), random.uniform(-0.4, 0.4), 1).normalized();
        const double h = block.support(d);
        const Support found = find_hull_support(*block.shape, d);
        ASSERT_NEAR(found.h, h, 1e-9) << d.transpose() << " uneven " << uneven << " crown " << crown;
        ASSERT_GE(found.upper, h - 1e-12) << d.transpose();
      }
    }
  const Block convex(0.009, 0.2, 1);
  EXPECT_FALSE(convex.shape->dented());
}

TEST(Dents, of_walls_hardly_twisted_are_seen) {
  const Vec3 slope = Vec3(2, 0, 0.4).normalized();  // the cone's normal in its meridian
  Random random(7);
  for (const double off : {3e-6, 1e-5, 1e-4, 3e-4, 1e-3}) {
    SCOPED_TRACE(off);
    const HiddenDent dent = twisted_frustum(off);
    const ShapePointer shape = make_shape("twisted", dent.surfaces);
    const double depth = dent.depth;
    ASSERT_GT(depth, 0.01 * off * off);
    EXPECT_GE(shape->support_excess, depth);
    EXPECT_LE(shape->support_excess, 10 * depth);
    EXPECT_LE(shape->concavity, shape->support_excess);
    EXPECT_GE(shape->concavity, 0.5 * depth);
    // Small balls on the wall: the hull's is the cone's.
    for (int k = 0; k < 60; ++k) {
      const double size = random.log_uniform(1e-4, 1), turn = random.uniform(0, 2 * M_PI),
                   z = random.uniform(-0.6, 0.6), r = 0.8 - 0.2 * z,
                   gap = random.uniform(-1, 1) * size * random.log_uniform(1e-7, 1e-2);
      const Vec3 n(std::cos(turn) * slope[0], std::sin(turn) * slope[0], slope[2]),
          at(r * std::cos(turn), r * std::sin(turn), z);
      const Particle body{shape.get(), 1, Vec3::Zero(), Quat::Identity()},
          ball{sphere().get(), size, at - shape->mass.center + (size + gap) * n, random.turn()};
      double memory[kPairMemorySize] = {0};
      ContactSettings settings;
      settings.tolerance = 1e-9;
      const ContactResult found = find_contact(body, ball, settings, memory);
      EXPECT_EQ(found.status, Status::converged);
      EXPECT_LE(found.lower, gap + 2e-15);
      EXPECT_GE(found.upper, gap - 2e-15);
    }
  }
}

// Planes and balls on the hull over a dent.
void expect_contacts_over(const Shape& shape, const HiddenDent& dent) {
  Random random(3);
  const Vec3 across = dent.normal.cross(Vec3::UnitY()).normalized();
  for (int k = 0; k < 60; ++k) {
    const Vec3 d = (dent.normal + random.uniform(-1, 1) * dent.width * across).normalized();
    const double size = k % 2 ? 1 : random.log_uniform(1e-3, 1),
                 gap = random.uniform(-1, 1) * size * random.log_uniform(1e-9, 1e-2);
    const Particle body{&shape, 1, Vec3::Zero(), Quat::Identity()};
    const Vec3 on = dent.support(d) - shape.mass.center;
    double memory[kPairMemorySize] = {0};
    ContactSettings settings;
    settings.tolerance = 1e-9;
    ContactResult found;
    if (k % 2) {
      found = find_plane_contact(body, on + gap * d, -d, settings, memory);
    } else {
      const Particle ball{sphere().get(), size, on + (size + gap) * d, random.turn()};
      found = find_contact(body, ball, settings, memory);
    }
    EXPECT_EQ(found.status, Status::converged);
    EXPECT_LE(found.lower, gap + 4e-15);
    EXPECT_GE(found.upper, gap - 4e-15);
    EXPECT_NEAR(found.gap, gap, 1.01e-9 * size + 4e-15);
  }
}

// Far narrower than a sample's step.
TEST(Dents, of_narrow_grooves_are_seen) {
  Random random(11);
  for (int k = 0; k < 40; ++k) {
    const double bend = random.log_uniform(0.1, 2), w = random.log_uniform(1e-3, 0.2);
    const HiddenDent dent =
        grooved_block(bend, w, random.uniform(-0.6, 0.6), random.uniform(-0.3, 0.3), k % 2 ? 0 : 0.3);
    SCOPED_TRACE("groove " + std::to_string(k));
    const ShapePointer shape = make_shape("groove", dent.surfaces);
    EXPECT_GE(shape->support_excess, 0.99 * dent.depth) << w;
    EXPECT_LE(shape->support_excess, 6 * dent.depth + 1e-14) << w;
    EXPECT_GE(shape->concavity, 0.5 * dent.depth - 1e-13) << w;
    expect_contacts_over(*shape, dent);
  }
}

// Round a tip, about which no cells have bounds.
TEST(Dents, of_ring_grooves_about_a_tip_are_seen) {
  Random random(13);
  for (int k = 0; k < 24; ++k) {
    const double bend = random.log_uniform(0.2, 2), w = random.log_uniform(8e-3, 0.1);
    const HiddenDent dent = ringed_cone(bend, w, random.uniform(0.3, 0.8), random.uniform(0.05, 0.4));
    SCOPED_TRACE("ring " + std::to_string(k));
    const ShapePointer shape = make_shape("ring", dent.surfaces);
    EXPECT_GT(shape->support_excess, 0.3 * dent.depth);
    expect_contacts_over(*shape, dent);
  }
}

// Two panels, hardly bent, that close by less than what is a kink.
TEST(Dents, of_valleys_between_nearly_flat_panels_are_seen) {
  Random random(12);
  for (int k = 0; k < 40; ++k) {
    const double bend = random.log_uniform(1e-9, 1e-4), close = random.log_uniform(1e-9, 1e-7);
    const HiddenDent dent =
        valley_block(bend, close, random.uniform(-0.6, 0.6), random.uniform(-0.3, 0.3), k % 4 ? 0.3 : 0);
    SCOPED_TRACE("valley " + std::to_string(k));
    expect_contacts_over(*make_shape("valley", dent.surfaces), dent);
  }
}

TEST(DentedParts, are_those_of_dents) {
  std::vector<ShapePointer> convex = all_shapes();
  for (const ShapePointer& s :
       {make_shape("cone", revolve({{{0, 0}, {}, {1, 0}, 0}, {{1, 0}, {}, {0, 2}, 0}})),
        Block(0.009, 0.2, 1).shape, Block(0.009, 0.0, 1e3).shape, make_shape("lens", lens(1, 1.5, 0.05))})
    convex.push_back(s);
  for (const ShapePointer& shape : convex)
    for (const BezierPatch& patch : shape->patches)
      for (int edge = 0; edge < 4; ++edge)
        EXPECT_TRUE(find_dented_parts(patch, edge).empty()) << shape->name << " edge " << edge;
  for (const double uneven : {1.0, 1e3}) {
    const Block block(0.014, 0.2, uneven);
    int edges = 0;
    for (const BezierPatch& patch : block.shape->patches)
      for (int edge = 0; edge < 4; ++edge) edges += !find_dented_parts(patch, edge).empty();
    EXPECT_GE(edges, 2) << "both edges of the top, at least";
  }
}

}  // namespace
}  // namespace nurbs::test_normal_map

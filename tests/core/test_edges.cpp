// Contacts on sharp edges and vertices that go on from step to step, against closed forms and searches that
// know nothing of edges; what they rest on, against dense evaluation.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "body/connectivity.h"
#include "body/edge_curves.h"
#include "body/kink_segments.h"
#include "body/locate_point.h"
#include "body/support.h"
#include "contact/edge_search.h"
#include "contact/pair_search.h"
#include "support/least_overlap.h"
#include "support/random.h"
#include "support/solids.h"

namespace nurbs::test_edges {
namespace {

using namespace test;

std::vector<Solid> sharp_solids(std::uint64_t seed) {
  Random random(seed);
  std::vector<Solid> solids{cylinder(random, 1, 0.7),
                            cylinder(random, 1, 1, 30),
                            lens(random, 1.6),
                            cone(random, 1, 1.5),
                            double_cone(random, 1, 0.6, 1.2),
                            frustum(random, 1, 0.6, 0.9, 5),
                            spherical_segment(random, -0.3, 0.8),
                            reuleaux_prism(random, 0.5),
                            sphericon(random),
                            polyhedron(random, 14, 0.8)};
  const size_t exact = solids.size();
  for (size_t k = 0; k < exact; k += 2) solids.push_back(stretched(random, solids[k], 0.5));
  return solids;
}

template <class Visit>
void visit_sharp_edges(const Shape& shape, const Visit& visit) {
  for (size_t p = 0; p < shape.edge_curves.size(); ++p)
    for (int e = 0; e < 4; ++e)
      if (shape.edge_curves[p][e].sharp()) visit(static_cast<int>(p), e);
}

TEST(Edges, curvatures_are_bounded) {
  int edges = 0, bent = 0;
  for (const Solid& solid : sharp_solids(3))
    visit_sharp_edges(*solid.shape, [&](int p, int e) {
      const EdgeCurve& curve = solid.shape->edge_curves[p][e];
      const BezierPatch& patch = solid.shape->patches[p];
      double most = 0, slowest = 1e300;
      for (int k = 0; k <= 2000; ++k) {
        const Vec2 at = edge_parameters(e, k / 2000.0);
        const Jet2 j = evaluate2(patch, at[0], at[1]);
        const Vec3 first = e < 2 ? j.sv : j.su, second = e < 2 ? j.svv : j.suu;
        most = std::max(most, first.cross(second).norm() / std::pow(first.norm(), 3));
        slowest = std::min(slowest, first.norm());
      }
      const double size = solid.shape->bounding_radius;
      EXPECT_GE(curve.bend, most - 1e-9 / size);
      EXPECT_LE(curve.bend, 1.5 * most + 1e-6 / size);
      EXPECT_LE(curve.speed, slowest);
      EXPECT_GE(curve.speed, 0.5 * slowest);
      ++edges;
      bent += most * size > 0.1;
    });
  EXPECT_GE(edges, 200);
  EXPECT_GE(bent, 100);
}

TEST(Edges, distances_to_kinked_joints_are_bounds) {
  Random random(5);
  int bodies = 0;
  for (const Solid& solid : sharp_solids(7)) {
    const Shape& shape = *solid.shape;
    const KinkSegments segments = find_kink_segments(shape);
    ASSERT_FALSE(segments.empty());
    ++bodies;
    std::vector<Vec3> joints;
    for (size_t p = 0; p < shape.patches.size(); ++p)
      for (int e = 0; e < 4; ++e) {
        const EdgeLink& link = shape.links[p][e];
        if (std::max(std::abs(link.kink), link.kink_bound) <= kNoKink) continue;
        for (int k = 0; k <= 200; ++k) {
          const Vec2 at = edge_parameters(e, k / 200.0);
          joints.push_back(evaluate0(shape.patches[p], at[0], at[1]));
        }
      }
    for (int k = 0; k < 60; ++k) {
      const int p = random.below(static_cast<int>(shape.patches.size()));
      const Vec3 x = evaluate0(shape.patches[p], random.uniform(0, 1), random.uniform(0, 1));
      double nearest = 1e300;
      for (const Vec3& y : joints) nearest = std::min(nearest, (x - y).norm());
      const double found = segments.distance(p, x);
      EXPECT_LE(found, nearest + 1e-14);
      EXPECT_GE(found, nearest - 0.02 * shape.bounding_radius);
    }
  }
  EXPECT_GE(bodies, 15);
}

// A ball of the radius that is promised lies inside, beside sharp edges and poles too.
TEST(Edges, balls_lie_inside) {
  Random random(11);
  int balls = 0;
  for (const Solid& solid : sharp_solids(13)) {
    const Shape& shape = *solid.shape;
    for (int k = 0; k < 80; ++k) {
      const int p = random.below(static_cast<int>(shape.patches.size()));
      const double u = random.below(2) ? random.uniform(0, 1) : random.log_uniform(1e-4, 0.1);
      const double v = random.below(2) ? random.uniform(0, 1) : 1 - random.log_uniform(1e-4, 0.1);
      const Jet1 j = evaluate1(shape.patches[p], u, v);
      const Vec3 cross = j.su.cross(j.sv);
      if (!(cross.norm() > 1e-6 * j.su.norm() * j.sv.norm())) continue;
      const Vec3 n = cross.normalized();
      const RollingRadii radii = rolling_radii(shape, {p, u, v}, n);
      if (!(radii.inner > 0)) continue;
      const double r = std::min(radii.inner, shape.bounding_radius);
      const Vec3 center = j.s - r * n;
      ++balls;
      for (int i = 0; i < 120; ++i) {
        const Vec3 d = (n + std::pow(10.0, random.uniform(-4, 1)) * random.direction()).normalized();
        EXPECT_LE(d.dot(center) + r, d.dot(solid.support(d)) + 1e-9 * shape.bounding_radius) << shape.name;
      }
    }
  }
  EXPECT_GE(balls, 800);
}

TEST(Edges, points_are_located) {
  Random random(17);
  int points = 0, left = 0;
  for (const Solid& solid : sharp_solids(19)) {
    const Shape& shape = *solid.shape;
    for (int k = 0; k < 40; ++k) {
      const int p = random.below(static_cast<int>(shape.patches.size()));
      const SurfacePoint at{p, random.uniform(0.05, 0.95), random.uniform(0.05, 0.95)};
      const Vec3 x = evaluate0(shape.patches[p], at.u, at.v);
      const SurfacePoint start{p, std::clamp(at.u + random.uniform(-0.2, 0.2), 0.0, 1.0),
                               std::clamp(at.v + random.uniform(-0.2, 0.2), 0.0, 1.0)};
      const SurfacePoint found = locate_point(shape, start, x);
      ++points;
      if (found.patch == start.patch && found.u == start.u && found.v == start.v)
        ++left;  // beside a pole
      else
        EXPECT_LE((evaluate0(shape.patches[found.patch], found.u, found.v) - x).norm(),
                  1e-7 * shape.bounding_radius);
    }
    // On a sharp edge exactly; and nothing that is not on the body.
    visit_sharp_edges(shape, [&](int p, int e) {
      const Vec2 at = edge_parameters(e, random.uniform(0.1, 0.9)), from = edge_parameters(e, 0.5);
      const Vec3 x = evaluate0(shape.patches[p], at[0], at[1]);
      const SurfacePoint found = locate_point(shape, {p, from[0], from[1]}, x);
      EXPECT_TRUE(is_on_edge(shape, found));
      EXPECT_LE((evaluate0(shape.patches[found.patch], found.u, found.v) - x).norm(),
                1e-7 * shape.bounding_radius);
      const SurfacePoint start{p, from[0], from[1]};
      const SurfacePoint none = locate_point(shape, start, 1.1 * x);
      EXPECT_TRUE(none.patch == start.patch && none.u == start.u && none.v == start.v);
    });
  }
  EXPECT_GE(points, 500);
  EXPECT_LE(left, points / 40);
}

// Edges across edges, faces, vertices: overlaps along their own normals in closed form, the gap as it is
// found from nothing, and now and then no direction that overlaps less. Few need the polytope.
TEST(Edges, contacts_are_followed) {
  const std::vector<Solid> solids = sharp_solids(23);
  Random random(29);
  long contacts = 0, followed = 0, searched = 0;
  for (int path = 0; path < 500; ++path) {
    const Solid &sa = solids[random.below(static_cast<int>(solids.size()))],
                &sb = solids[random.below(static_cast<int>(solids.size()))];
    Particle a{sa.shape.get(), 1 / sa.shape->bounding_radius, Vec3::Zero(), random.turn()},
        b{sb.shape.get(), random.uniform(0.5, 2) / sb.shape->bounding_radius, Vec3::Zero(), random.turn()};
    const double size = std::min(1.0, b.scale * sb.shape->bounding_radius);
    const Vec3 n = random.direction();
    b.x = support_of(sa, a, n) - support_of(sb, b, -n) - size * random.log_uniform(1e-5, 3e-3) * n;
    const Vec3 turn_a = random.direction(), turn_b = random.direction();
    const double rate = random.log_uniform(1e-6, 3e-3);
    const auto overlap = [&](const Vec3& d) {
      return d.dot(support_of(sa, a, d) - support_of(sb, b, -d) - (b.x - a.x));
    };
    double memory[kPairMemorySize] = {};
    ContactSettings settings;
    settings.reach = 0;
    for (int step = 0; step < 12; ++step) {
      const ContactResult r = find_contact(a, b, settings, memory);
      const double allowed = 1.5 * settings.tolerance * size;
      ASSERT_NE(r.status, Status::unresolved);
      if (step > 2 && r.status == Status::converged) {
        ++contacts;
        followed += r.rung != Rung::fallback;
        EXPECT_NEAR(-overlap(r.normal), r.gap, allowed);
        EXPECT_NEAR(r.normal.dot(r.point_b - r.point_a), r.gap, allowed);
        double nothing[kPairMemorySize] = {};
        const ContactResult cold = find_contact(a, b, settings, nothing);
        EXPECT_NEAR(cold.gap, r.gap, allowed);
        for (int k = 0; k < 10; ++k) {
          const Vec3 d = (r.normal + std::pow(10.0, random.uniform(-6, 0)) * random.direction()).normalized();
          EXPECT_LE(-overlap(d), r.gap + allowed);
          EXPECT_LE(d.dot(r.point_a), d.dot(support_of(sa, a, d)) + 3 * allowed);
        }
        if (path % 10 == 0 && step == 8) {
          std::vector<Vec3> starts = spiral(600);
          starts.push_back(r.normal);
          Compass compass;
          compass.finest = 1e-11;
          EXPECT_LE(-least_overlap(overlap, starts, compass, random), r.upper + allowed);
          ++searched;
        }
      }
      a.q = (Quat(Eigen::AngleAxisd(rate, turn_a)) * a.q).normalized();
      b.q = (Quat(Eigen::AngleAxisd(rate, turn_b)) * b.q).normalized();
    }
  }
  EXPECT_GE(contacts, 2500);
  EXPECT_GE(searched, 20);
  EXPECT_GE(static_cast<double>(followed), 0.75 * static_cast<double>(contacts));
}

// Rims of two cylinders that cross, by hand: x = 1 on A's, the same of B turned by 90 degrees about x.
TEST(Edges, two_rims_that_cross) {
  Random random(31);
  const Solid solid = cylinder(random, 1, 0.5);
  const Vec3 axis = solid.shape->revolution.axis, side = axis.unitOrthogonal();
  Particle a{solid.shape.get(), 1, Vec3::Zero(), Quat::Identity()}, b = a;
  // A's axis along (1, 0, 1), so that its rim is outermost along x; B's along (-1, 1, 0).
  const auto stand = [&](const Vec3& up, const Vec3& out) {
    Mat3 from, to;
    from << axis, side, axis.cross(side);
    to << up, out, up.cross(out);
    return Quat(to * from.transpose()).normalized();
  };
  a.q = stand(Vec3(1, 0, 1).normalized(), Vec3(1, 0, -1).normalized());
  b.q = stand(Vec3(-1, 1, 0).normalized(), Vec3(-1, -1, 0).normalized());
  const double out = 1.5 / std::sqrt(2.0);  // of the rim along x
  const double depth = 1e-3;
  const Vec3 rim_a(out, 0, (0.5 - 1) / std::sqrt(2.0)), rim_b(-out, (0.5 - 1) / std::sqrt(2.0), 0);
  b.x = rim_a - rim_b - depth * Vec3::UnitX();
  double memory[kPairMemorySize] = {};
  ContactSettings settings;
  for (int step = 0; step < 4; ++step) {
    const ContactResult r = find_contact(a, b, settings, memory);
    ASSERT_EQ(r.status, Status::converged);
    EXPECT_NEAR(r.gap, -depth, 1e-9);
    EXPECT_LE((r.normal - Vec3::UnitX()).norm(), 1e-8);
    EXPECT_LE((r.point_a - rim_a).norm(), 1e-8);
    if (step > 0) {
      EXPECT_EQ(r.rung, Rung::warm);
    }
  }
}

}  // namespace
}  // namespace nurbs::test_edges

// Contacts of sphero-polyhedra by the distance of their cores, against all pairs of vertices, edges and
// triangles of both, and the lines along which they touch against the surfaces'.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <vector>

#include "body/support.h"
#include "contact/core_search.h"
#include "contact/effective_radius.h"
#include "contact/pair_search.h"
#include "shapes/primitives.h"
#include "shapes/revolved.h"
#include "support/bodies.h"
#include "support/flat_bodies.h"
#include "support/random.h"

namespace nurbs::test_core_search {
namespace {

using test::Random;
using test::rounded_solid;
using Body = std::shared_ptr<const Shape>;

std::vector<Body> swept_bodies() {
  return {make_shape("capsule", capsule(0.3, 2)),
          make_shape("needle", capsule(0.01, 3)),
          make_shape("ball", exact_ellipsoid({1, 1, 1})),
          make_shape("die", rounded_box({1, 0.8, 0.6}, 0.2)),
          make_shape("plate", rounded_box({1, 0.7, 0.05}, 0.05)),
          make_shape("sharp", rounded_box({1, 0.8, 0.6}, 0.01)),
          rounded_solid("tetrahedron", 0.15),
          rounded_solid("octahedron", 0.1),
          rounded_solid("icosahedron", 0.3)};
}

const Shape& any_of(const std::vector<Body>& bodies, Random& random) {
  return *bodies[random.below(static_cast<int>(bodies.size()))];
}

// Corners of the core where the body is.
std::vector<Vec3> corners(const Particle& p) {
  std::vector<Vec3> out;
  for (const Vec3& x : p.shape->core.points) out.push_back(p.x + p.q * (p.scale * x));
  return out;
}

double to_segment(const Vec3& x, const Vec3& p, const Vec3& q) {
  const Vec3 way = q - p;
  const double t = std::clamp((x - p).dot(way) / way.squaredNorm(), 0.0, 1.0);
  return (x - p - t * way).norm();
}
double segment_to_segment(const Vec3& p, const Vec3& q, const Vec3& r, const Vec3& s) {
  const Vec3 u = q - p, v = s - r, n = u.cross(v);
  double best = std::min(std::min(to_segment(p, r, s), to_segment(q, r, s)),
                         std::min(to_segment(r, p, q), to_segment(s, p, q)));
  if (!(n.squaredNorm() > 1e-24 * u.squaredNorm() * v.squaredNorm())) return best;
  const double t = (r - p).cross(v).dot(n) / n.squaredNorm(), w = (r - p).cross(u).dot(n) / n.squaredNorm();
  if (t >= 0 && t <= 1 && w >= 0 && w <= 1) best = std::min(best, std::abs((r - p).dot(n)) / n.norm());
  return best;
}
// Of a point over the triangle's inside; far otherwise, where its sides are nearer.
double to_inside(const Vec3& x, const Vec3& p, const Vec3& q, const Vec3& r) {
  const Vec3 n = (q - p).cross(r - p);
  if (!(n.norm() > 1e-12)) return 1e300;
  const bool inside =
      n.cross(q - p).dot(x - p) >= 0 && n.cross(r - q).dot(x - q) >= 0 && n.cross(p - r).dot(x - r) >= 0;
  return inside ? std::abs(n.dot(x - p)) / n.norm() : 1e300;
}

// Distance of the hulls of two sets of points that are apart: every segment and triangle of points lies in
// its hull, and the hull's own edges and faces are made of such.
double hulls_apart(const std::vector<Vec3>& a, const std::vector<Vec3>& b) {
  double best = 1e300;
  for (const Vec3& x : a)
    for (const Vec3& y : b) best = std::min(best, (x - y).norm());
  const auto one_way = [&](const std::vector<Vec3>& points, const std::vector<Vec3>& hull) {
    for (const Vec3& x : points)
      for (size_t i = 0; i < hull.size(); ++i)
        for (size_t j = 0; j < i; ++j) {
          best = std::min(best, to_segment(x, hull[i], hull[j]));
          for (size_t k = 0; k < j; ++k) best = std::min(best, to_inside(x, hull[i], hull[j], hull[k]));
        }
  };
  one_way(a, b);
  one_way(b, a);
  for (size_t i = 0; i < a.size(); ++i)
    for (size_t j = 0; j < i; ++j)
      for (size_t k = 0; k < b.size(); ++k)
        for (size_t l = 0; l < k; ++l) best = std::min(best, segment_to_segment(a[i], a[j], b[k], b[l]));
  return best;
}

double height(const std::vector<Vec3>& points, const Vec3& d) {
  double most = -1e300;
  for (const Vec3& x : points) most = std::max(most, d.dot(x));
  return most;
}

// B beside A so that the cores are about `apart` radii from each other along a random direction, or with a
// face, edge or corner of each facing the other.
void place(Random& random, const Shape& sa, const Shape& sb, double apart, bool features, Particle* a,
           Particle* b) {
  *a = {&sa, 1 / sa.bounding_radius, Vec3(0.3, -2, 1), random.turn()};
  *b = {&sb, random.log_uniform(0.2, 5) / sb.bounding_radius, Vec3::Zero(), random.turn()};
  Vec3 n = random.direction();
  if (features) {
    const auto feature = [&](const Particle& p) {  // mean of a few corners
      const std::vector<Vec3>& points = p.shape->core.points;
      Vec3 sum = points[random.below(static_cast<int>(points.size()))];
      for (int k = random.below(3); k > 0; --k) sum += points[random.below(static_cast<int>(points.size()))];
      return Vec3(p.q * sum).normalized();
    };
    n = feature(*a);
    if (!(n.norm() > 0.5)) n = random.direction();
    const Vec3 other = feature(*b);
    if (other.norm() > 0.5) b->q = (Quat::FromTwoVectors(other, -n) * b->q).normalized();
  }
  const double radii = a->scale * sa.core.radius + b->scale * sb.core.radius;
  const double reach = height(corners(*a), n) + height(corners(*b), -n);
  b->x += (reach + apart * radii) * n;
}

TEST(CoreSearch, against_all_features_of_the_cores) {
  const std::vector<Body> bodies = swept_bodies();
  Random random(771);
  int solved = 0, apart = 0;
  for (int k = 0; k < 6000; ++k) {
    const Shape &sa = any_of(bodies, random), &sb = any_of(bodies, random);
    Particle a, b;
    place(random, sa, sb, 1 + (k % 2 ? -1 : 1) * random.log_uniform(1e-6, 0.9), k % 3 == 0, &a, &b);
    if (k % 5 == 0)
      b.x += random.uniform(0, 1) * random.direction() * a.scale * sa.core.radius;  // beside each other
    ContactSettings settings;
    settings.tolerance = k % 4 ? 1e-9 : 1e-5;
    if (k % 3) settings.reach = 0;
    PairMemory memory{};
    adopt(1, &memory);
    ContactResult r;
    const PairFrame pair(a, b);
    const double tolerance = settings.tolerance * pair.size;
    const double distance = hulls_apart(corners(a), corners(b)),
                 gap = distance - a.scale * sa.core.radius - b.scale * sb.core.radius;
    const double noise = 1e-13 * (a.scale * sa.bounding_radius + b.scale * sb.bounding_radius);
    if (!solve_cores(pair, tolerance, a, b, settings, memory, &r)) {
      EXPECT_LT(distance, 1e-4) << k << " " << sa.name << " " << sb.name;
      continue;
    }
    ASSERT_LE(r.lower, gap + noise) << k << " " << sa.name << " " << sb.name;
    ASSERT_GE(r.upper, gap - noise) << k;
    if (r.status == Status::separated) {
      ++apart;
      EXPECT_GE(r.lower, (gap - noise) / 2) << k;
      continue;
    }
    ++solved;
    EXPECT_EQ(r.status, Status::converged);
    EXPECT_LE(r.upper - r.lower, tolerance);
    EXPECT_NEAR(r.gap, gap, noise) << k << " " << sa.name << " " << sb.name;
    // The normal is along the way between the cores, and the overlap along it is the least.
    EXPECT_NEAR(r.normal.norm(), 1, 1e-14);
    EXPECT_NEAR(-height(corners(a), r.normal) - height(corners(b), -r.normal), distance, noise) << k;
    EXPECT_NEAR(r.normal.dot(r.point_b - r.point_a), r.gap, noise);
    // Both points are the balls' highest.
    EXPECT_NEAR(r.normal.dot(a.x + r.point_a), height(corners(a), r.normal) + a.scale * sa.core.radius,
                noise);
    EXPECT_NEAR(-r.normal.dot(a.x + r.point_b), height(corners(b), -r.normal) + b.scale * sb.core.radius,
                noise);
    EXPECT_LE((r.point_b - r.point_a - r.gap * r.normal).norm(), noise);
  }
  EXPECT_GT(solved, 2000);
  EXPECT_GT(apart, 1500);
}

// Cores that meet are others' to solve, and the gap goes on where they do.
TEST(CoreSearch, cores_that_meet_are_left_to_the_other_rungs) {
  const std::vector<Body> bodies = swept_bodies();
  Random random(772);
  for (int k = 0; k < 300; ++k) {
    const Shape &sa = any_of(bodies, random),
                &sb = *bodies[3 + random.below(static_cast<int>(bodies.size()) - 3)];
    Particle a, b;
    place(random, sa, sb, -random.uniform(0.01, 0.5), false, &a, &b);
    const Vec3 n = random.direction();
    double memory[kPairMemorySize] = {}, last = 0;
    constexpr double kWay = 1e-3;
    for (int step = 0; step < 40; ++step, b.x += kWay * n) {
      const ContactResult r = find_contact(a, b, ContactSettings(), memory);
      ASSERT_NE(r.status, Status::unresolved) << k << " " << sa.name << " " << sb.name;
      if (r.status == Status::separated) break;
      if (step > 0) {
        ASSERT_LE(std::abs(r.gap - last), kWay * (1 + 1e-5)) << k;
      }
      last = r.gap;
    }
  }
}

// A contact that goes on takes a step or two, whatever its features, and gives what a new one gives.
TEST(CoreSearch, goes_on_from_the_last_corners) {
  const std::vector<Body> bodies = swept_bodies();
  Random random(773);
  int steps = 0, iterations = 0;
  for (int k = 0; k < 200; ++k) {
    const Shape &sa = any_of(bodies, random), &sb = any_of(bodies, random);
    Particle a, b;
    place(random, sa, sb, random.uniform(0.5, 0.9), k % 2 == 0, &a, &b);
    double memory[kPairMemorySize] = {};
    const Vec3 spin_a = random.direction(), spin_b = random.direction();
    for (int step = 0; step < 40; ++step) {
      a.q = (Quat(Eigen::AngleAxisd(2e-3, spin_a)) * a.q).normalized();
      b.q = (Quat(Eigen::AngleAxisd(2e-3, spin_b)) * b.q).normalized();
      const ContactResult r = find_contact(a, b, ContactSettings(), memory);
      if (r.status != Status::converged || memory_at(memory).model.unique != kCorePair) break;
      double empty[kPairMemorySize] = {};
      const ContactResult anew = find_contact(a, b, ContactSettings(), empty);
      ASSERT_NEAR(r.gap, anew.gap, 1e-14) << k << " " << sa.name << " " << sb.name;
      ASSERT_LE((r.normal - anew.normal).norm(), 1e-9) << k;
      if (step == 0) continue;
      ++steps;
      iterations += r.iterations;
    }
  }
  EXPECT_GT(steps, 5000);
  EXPECT_LT(iterations, 1.3 * steps);
}

// Memory of other bodies' corners, or none at all, does no harm.
TEST(CoreSearch, memory_out_of_range) {
  const Body die = make_shape("die", rounded_box({1, 0.8, 0.6}, 0.2)),
             rod = make_shape("rod", capsule(0.3, 2));
  const Particle a{die.get(), 1, Vec3::Zero(), Quat::Identity()},
      b{rod.get(), 1, Vec3(0, 0, 0.85), Quat(0.6, 0.8, 0, 0)};
  for (const double number : {-1.0, 8.0, 1e300, std::nan("")}) {
    PairMemory memory{};
    adopt(1, &memory);
    const CorePair last{number < 0 ? 3 : number, {number, 1, 7}, {0, number, 5}};
    std::memcpy(static_cast<void*>(&memory.model), &last, sizeof last);
    memory.model.unique = kCorePair;
    ContactResult r;
    const PairFrame pair(a, b);
    ASSERT_TRUE(solve_cores(pair, 1e-9, a, b, ContactSettings(), memory, &r));
    EXPECT_NEAR(r.gap, hulls_apart(corners(a), corners(b)) - 0.5, 1e-13);
  }
}

// A body's lines are those that its surface has.
TEST(CoreEdges, are_the_surfaces_lines) {
  Random random(774);
  for (const Body& body : swept_bodies()) {
    const bool ball = body->core.points.size() == 1;
    ASSERT_EQ(body->core.edges.empty(), ball) << body->name;
    if (ball) continue;
    Shape plain = *body;
    plain.core.edges.clear();
    for (int k = 0; k < 500; ++k) {
      const SpheroPolyhedron::Edge& edge =
          body->core.edges[random.below(static_cast<int>(body->core.edges.size()))];
      const Vec3 normal =
          (random.uniform(0.05, 1) * edge.from + random.uniform(0.05, 1) * edge.to).normalized();
      const Vec3 d = (normal + random.log_uniform(1e-6, 0.03) * random.direction()).normalized();
      RuledLine line, seen;
      const Support there = find_feature_support(plain, d), top = find_feature_top(*body, d);
      EXPECT_NEAR(there.h, top.h, 1e-12);
      EXPECT_LE((there.point - top.point).norm(), 1e-5 + 4 * (d - normal).norm()) << body->name;
      ASSERT_TRUE(ruled_line(*body, {-1, 0, 0}, d, 0.5, &line)) << body->name << " " << k;
      ASSERT_TRUE(ruled_line(plain, there.where, d, 0.5, &seen)) << body->name << " " << k;
      const bool same = (line.ends[0] - seen.ends[0]).norm() < (line.ends[0] - seen.ends[1]).norm();
      for (int i = 0; i < 2; ++i) {
        const Vec3& other = seen.ends[same ? i : 1 - i];
        EXPECT_LE((line.ends[i] - other).norm(), 0.1) << body->name << " " << k;
        // Of those the one that lies higher.
        EXPECT_GE(std::min(d.dot(line.ends[0]), d.dot(line.ends[1])),
                  std::min(d.dot(seen.ends[0]), d.dot(seen.ends[1])) - 1e-9);
      }
      EXPECT_LE(turn_to_ruled_line(*body, {-1, 0, 0}, d), 1.1 * (d - normal).norm() + 1e-9) << body->name;
    }
  }
}

// Curvature without a surface point against the surface's own.
TEST(CoreSearch, curvature_is_the_surfaces) {
  Random random(775);
  for (const Body& body : swept_bodies()) {
    const Particle p{body.get(), 0.7, Vec3::Zero(), random.turn()};
    for (int k = 0; k < 300; ++k) {
      const int patch = random.below(static_cast<int>(body->patches.size()));
      const SurfacePoint at{patch, random.uniform(0.05, 0.95), random.uniform(0.05, 0.95)};
      const Support there = look_at(*body, Vec3::UnitX(), at);
      const Vec3 outward = p.q * there.normal;
      const SurfaceCurvature seen = curvature_at(p, point_memory(at), outward),
                             known = curvature_at(p, point_memory({-1, 0, 0}), outward);
      ASSERT_TRUE(seen.known && known.known) << body->name;
      EXPECT_LE((seen.tensor - known.tensor).norm(), 1e-9 / (p.scale * body->core.radius)) << body->name;
    }
  }
}

}  // namespace
}  // namespace nurbs::test_core_search

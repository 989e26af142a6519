// Contacts along a face's normal or two creases' common one, against the separating axis test over all of
// them, which is exact for polyhedra.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "body/flat_faces.h"
#include "contact/flat_search.h"
#include "contact/pair_search.h"
#include "support/bodies.h"
#include "support/flat_bodies.h"
#include "support/random.h"

namespace nurbs::test_flat_search {
namespace {

using namespace test;

struct Polyhedron {
  ShapePointer shape;
  std::vector<Vec3> corners;  // of its flats

  explicit Polyhedron(ShapePointer s) : shape(std::move(s)) {
    for (const FlatFace& face : shape->flats.faces)
      for (const int v : face.outline) corners.push_back(shape->flats.vertices[v]);
  }
  double support(const Particle& p, const Vec3& d) const {
    double most = -std::numeric_limits<double>::infinity();
    for (const Vec3& x : corners) most = std::max(most, d.dot(p.x + p.scale * (p.q * x)));
    return most;
  }
};

// All directions in which the overlap of two polyhedra may be least, from A to B.
std::vector<Vec3> candidates(const Particle& a, const Particle& b) {
  std::vector<Vec3> all;
  for (const FlatFace& f : a.shape->flats.faces) all.push_back(a.q * f.normal);
  for (const FlatFace& f : b.shape->flats.faces) all.push_back(b.q * -f.normal);
  for (const StraightEdge& e : a.shape->flats.edges)
    for (const StraightEdge& f : b.shape->flats.edges) {
      const Vec3 square = (a.q * e.direction).cross(b.q * f.direction);
      if (square.norm() < 1e-6) continue;
      all.push_back(square.normalized());
      all.push_back(-all.back());
    }
  return all;
}

// Of a body's faces, the one most along a lab direction.
Vec3 nearest_normal(const Particle& p, const Vec3& d) {
  const auto& faces = p.shape->flats.faces;
  return std::max_element(faces.begin(), faces.end(),
                          [&](const FlatFace& x, const FlatFace& y) {
                            return (p.q * x.normal).dot(d) < (p.q * y.normal).dot(d);
                          })
      ->normal;
}

struct Placed {
  const Polyhedron &of_a, &of_b;
  Particle a, b;
  double overlap(const Vec3& d) const { return of_a.support(a, d) + of_b.support(b, -d); }
};

// At any depth, whatever direction it is asked for: an answer is the least overlap of all.
TEST(FlatSearch, what_it_finds_is_the_least_overlap) {
  const std::vector<Polyhedron> bodies = {Polyhedron(cuboid()),
                                          Polyhedron(make_shape("plate", box(Vec3(1, 0.9, 0.05)))),
                                          Polyhedron(make_shape("stick", box(Vec3(1, 0.1, 0.08)))),
                                          Polyhedron(make_shape("prism", prism(6, 0.8, 0.5))),
                                          Polyhedron(make_shape("wedge", prism(3, 0.9, 0.4)))};
  Random random(5);
  int found = 0, deep = 0, apart = 0, creases = 0, shallow = 0;
  for (int n = 0; n < 1500; ++n) {
    const Polyhedron &of_a = bodies[random.below(static_cast<int>(bodies.size()))],
                     &of_b = bodies[random.below(static_cast<int>(bodies.size()))];
    Placed pair{of_a, of_b, {}, {}};
    Particle &a = pair.a, &b = pair.b;
    a.shape = of_a.shape.get();
    b.shape = of_b.shape.get();
    a.q = random.turn();
    b.q = random.turn();
    b.scale = random.log_uniform(0.1, 3);
    a.x = random.box(-2, 2);
    b.x = a.x + 0.5 * (a.shape->bounding_radius + b.scale * b.shape->bounding_radius) * random.direction();
    const std::vector<Vec3> directions = candidates(a, b);
    const auto best = [&] {
      return *std::min_element(directions.begin(), directions.end(), [&](const Vec3& x, const Vec3& y) {
        return pair.overlap(x) < pair.overlap(y);
      });
    };
    const double wanted = random.log_uniform(1e-7, 1) * b.scale * (n % 4 == 0 ? -1 : 1);
    for (int k = 0; k < 4; ++k) b.x += (pair.overlap(best()) - wanted) * best();
    const double least = pair.overlap(best());
    const PairFrame frame(a, b);
    const double size = std::max(a.shape->bounding_radius, b.scale * b.shape->bounding_radius);
    bool found_least = false;
    for (const Vec3& d : directions) {
      JointSolution s;
      s.iterations = 0;
      if (!meet_flat(frame, frame.axes_a.transpose() * d, 1e-9 * size, &s)) continue;
      const Vec3 normal = frame.axes_a * s.normal;
      ++found;
      deep += s.gap < -0.1 * b.scale;
      creases += std::abs(normal.dot(a.q * nearest_normal(a, normal))) < 1 - 1e-9 &&
                 std::abs(normal.dot(b.q * nearest_normal(b, -normal))) < 1 - 1e-9;
      EXPECT_NEAR(pair.overlap(normal), -s.gap, 1e-11 * size);
      EXPECT_NEAR(normal.dot(frame.axes_a * (s.points.b - s.points.a)), s.gap, 1e-11 * size);
      if (least > 0) {
        EXPECT_NEAR(-s.gap, least, 1e-10 * size)
            << a.shape->name << ", " << b.shape->name << ", " << n << ", depth " << least;
        found_least = true;
      } else {
        // Apart the gap is the distance of the two points, which are the bodies' own.
        ++apart;
        EXPECT_GE(s.gap, -least - 1e-11 * size);
        const Vec3 between = s.points.b - s.points.a;
        EXPECT_NEAR(between.norm(), s.gap, 1e-11 * size);
      }
    }
    shallow += least > 0 && least < 0.05 * b.scale && found_least;
  }
  EXPECT_GT(found, 1000);
  EXPECT_GT(deep, 75);
  EXPECT_GT(apart, 50);
  EXPECT_GT(shallow, 200);
  EXPECT_GT(creases, 100);
}

// What the ladder remembers of a contact of polyhedra serves it from then on.
TEST(FlatSearch, contacts_that_go_on_are_served) {
  const std::vector<ShapePointer> shapes = {cuboid(), make_shape("prism", prism(6, 0.8, 0.5))};
  Random random(6);
  const ContactSettings settings;
  int steps = 0, warm = 0;
  for (int n = 0; n < 200; ++n) {
    Particle a, b;
    a.shape = shapes[n % 2].get();
    b.shape = shapes[n / 2 % 2].get();
    a.q = random.turn();
    b.q = random.turn();
    const Vec3 line = random.direction();
    double near = 0, far = 4;
    while (far - near > 1e-6) {
      double nothing[kPairMemorySize] = {};
      b.x = 0.5 * (near + far) * line;
      (find_contact(a, b, settings, nothing).gap < -1e-3 ? near : far) = 0.5 * (near + far);
    }
    double memory[kPairMemorySize] = {};
    const Vec3 axis = random.direction(), way = 1e-5 * random.direction();
    for (int k = 0; k < 20; ++k) {
      b.x += way;
      b.q = (Quat(Eigen::AngleAxisd(1e-4, axis)) * b.q).normalized();
      const ContactResult r = find_contact(a, b, settings, memory);
      double nothing[kPairMemorySize] = {};
      const ContactResult cold = find_contact(a, b, settings, nothing);
      if (!(cold.gap < 0)) continue;
      ++steps;
      warm += r.rung == Rung::warm;
      EXPECT_EQ(r.status, Status::converged);
      EXPECT_NEAR(r.gap, cold.gap, 2 * settings.tolerance);
    }
  }
  EXPECT_GT(steps, 2500);
  EXPECT_GT(warm, 0.9 * steps);
}

}  // namespace
}  // namespace nurbs::test_flat_search

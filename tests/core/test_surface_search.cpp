// Contacts of a body with a triangle mesh against brute force over directions, piece by piece; and what must
// not depend on how the mesh is cut.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <map>

#include "body/support.h"
#include "contact/walls/feature_search.h"
#include "contact/walls/surface_search.h"
#include "shapes/primitives.h"
#include "shapes/revolved.h"
#include "shapes/superellipsoid.h"
#include "support/bodies.h"
#include "support/random.h"
#include "support/solid_families.h"

namespace nurbs::test_surface_search {
namespace {

using test::Random;

// The point of a triangle, segment or point nearest to c.
Vec3 nearest(const std::vector<Vec3>& hull, const Vec3& c) {
  const auto on_segment = [&](const Vec3& a, const Vec3& b) -> Vec3 {
    const double t = (c - a).dot(b - a) / (b - a).squaredNorm();
    return a + std::clamp(t, 0.0, 1.0) * (b - a);
  };
  if (hull.size() == 1) return hull[0];
  if (hull.size() == 2) return on_segment(hull[0], hull[1]);
  const Vec3 n = (hull[1] - hull[0]).cross(hull[2] - hull[0]).normalized();
  const Vec3 foot = c - n.dot(c - hull[0]) * n;
  bool inside = true;
  Vec3 best = hull[0];
  for (int k = 0; k < 3; ++k) {
    const Vec3 &p = hull[k], &q = hull[(k + 1) % 3];
    inside = inside && n.cross(q - p).dot(foot - p) >= 0;
    const Vec3 y = on_segment(p, q);
    if ((y - c).norm() < (best - c).norm()) best = y;
  }
  return inside ? foot : best;
}

// Signed distance of a point from a body's surface, < 0 inside, by compass search over directions from d.
double brute_point_gap(const Particle& p, const Vec3& y, Vec3* d, double step) {
  const Mat3 axes = p.q.toRotationMatrix();
  const auto gap = [&](const Vec3& u) {
    return u.dot(p.x - y) - p.scale * find_support(*p.shape, axes.transpose() * -u).h;
  };
  double most = gap(*d);
  for (; step > 1e-8; step *= 0.4)
    for (bool better = true; better;) {
      better = false;
      const Vec3 t = d->unitOrthogonal(), s = d->cross(t);
      for (const Vec3& side : {t, s, Vec3(-t), Vec3(-s)}) {
        const Vec3 u = (*d + step * side).normalized();
        const double g = gap(u);
        if (g > most) most = g, *d = u, better = true;
      }
    }
  return most;
}

// Gap between a body and the convex hull of some points, by alternating projections between the hull and the
// body's core: what is left of the body when its surface moves in by less than its curvature radii.
double brute_gap(const Particle& p, const std::vector<Vec3>& hull) {
  const double depth = 0.5 * p.scale * p.shape->patch_curvature.min_radius;
  Vec3 y = nearest(hull, p.x), d = (p.x - y).normalized();
  if ((p.x - y).norm() > p.scale * p.shape->bounding_radius) return 1;
  double gap = brute_point_gap(p, y, &d, 0.2);
  for (int k = 0; k < 400; ++k) {
    if (gap > 0.2) return 1;
    const Vec3 next = nearest(hull, y + (gap + depth) * d);
    const double moved = (next - y).norm();
    y = next;
    gap = brute_point_gap(p, y, &d, 2 * moved + 1e-7);
    if (moved < 1e-9) break;
  }
  return gap;
}

double phi(double gap) {
  return gap < 0 ? 0.5 * gap * gap : 0;
}

struct Mesh {
  std::vector<Triangle> triangles;
  void add(const Vec3& a, const Vec3& b, const Vec3& c) { triangles.push_back({a, b, c}); }
};

// U by inclusion and exclusion over all triangles, edges and vertices.
double brute_energy(const Particle& p, const Mesh& mesh) {
  std::vector<Vec3> points;
  const auto number = [&](const Vec3& x) {
    for (std::size_t k = 0; k < points.size(); ++k)
      if ((points[k] - x).norm() < 1e-9) return static_cast<int>(k);
    points.push_back(x);
    return static_cast<int>(points.size()) - 1;
  };
  std::map<std::pair<int, int>, int> edges;
  std::map<int, int> coefficient;
  double sum = 0;
  for (const Triangle& t : mesh.triangles) {
    int n[3];
    for (int k = 0; k < 3; ++k) n[k] = number(t[k]);
    for (int k = 0; k < 3; ++k) {
      ++edges[{std::min(n[k], n[(k + 1) % 3]), std::max(n[k], n[(k + 1) % 3])}];
      coefficient.emplace(n[k], 1).first->second -= 1;
    }
    sum += phi(brute_gap(p, {t[0], t[1], t[2]}));
  }
  for (const auto& [ends, count] : edges) {
    for (const int v : {ends.first, ends.second}) coefficient[v] -= 1 - count;
    if (count != 1) sum += (1 - count) * phi(brute_gap(p, {points[ends.first], points[ends.second]}));
  }
  for (const auto& [v, c] : coefficient)
    if (c != 0) sum += c * phi(brute_gap(p, {points[v]}));
  return sum;
}

struct Sum {
  double energy = 0;
  Vec3 force = Vec3::Zero(), torque = Vec3::Zero();
  int count = 0, negative = 0;
  double deepest = 0;
  bool flat = false;
};

Sum search(const Particle& p, const Mesh& mesh, double crack = 0) {
  MeshPatch patch;
  patch.build(mesh.triangles.data(), static_cast<int>(mesh.triangles.size()), 1e-7, 0, crack);
  ContactSettings settings;
  settings.reach = 0;
  SurfaceContacts contacts;
  find_surface_contacts(p, patch, settings, 0, nullptr, 0, &contacts);
  Sum s;
  s.count = contacts.count;
  for (int k = 0; k < contacts.count; ++k) {
    const SurfaceContact& c = contacts.contact[k];
    s.energy += c.weight * phi(c.gap);
    const Vec3 force = -c.weight * c.gap * c.normal;
    s.force += force;
    s.torque += (c.on_body - 0.5 * c.gap * c.normal).cross(force);
    s.negative += c.weight < 0;
    s.flat |= c.flat;
    s.deepest = std::max(s.deepest, -c.gap);
  }
  return s;
}

// A sheet over a grid in x and y, each square cut along one of its diagonals.
Mesh sheet(int n, double size, const std::function<double(double, double)>& height, Random& random) {
  Mesh mesh;
  const auto at = [&](int i, int j) {
    const double x = size * (2.0 * i / n - 1), y = size * (2.0 * j / n - 1);
    return Vec3(x, y, height(x, y));
  };
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) {
      const Vec3 a = at(i, j), b = at(i + 1, j), c = at(i + 1, j + 1), d = at(i, j + 1);
      if (random.below(2)) {
        mesh.add(a, b, c);
        mesh.add(a, c, d);
      } else {
        mesh.add(a, b, d);
        mesh.add(b, c, d);
      }
    }
  return mesh;
}

// Every triangle into three at a random place, some into two.
Mesh cut(const Mesh& mesh, Random& random) {
  Mesh fine;
  for (const Triangle& t : mesh.triangles) {
    const double a = random.uniform(0.1, 0.8), b = random.uniform(0.1, 0.9 - a);
    const Vec3 middle = t[0] + a * (t[1] - t[0]) + b * (t[2] - t[0]);
    for (int k = 0; k < 3; ++k) fine.add(t[k], t[(k + 1) % 3], middle);
  }
  return fine;
}

std::vector<test::ShapePointer> bodies() {
  return {test::sphere(), test::ellipsoid(), test::smooth_pebble()};
}

// A body moved down on the mesh until it overlaps by about `depth` at the deepest.
Particle pressed(const test::ShapePointer& shape, const Mesh& mesh, double depth, Random& random,
                 double spread) {
  Particle p;
  p.shape = shape.get();
  p.q = random.turn();
  p.x = Vec3(random.uniform(-spread, spread), random.uniform(-spread, spread), 0);
  double low = 0, high = 3;
  for (int k = 0; k < 20; ++k) {
    p.x[2] = 0.5 * (low + high);
    (search(p, mesh).deepest > depth ? low : high) = p.x[2];
  }
  return p;
}

TEST(SurfaceSearch, EnergyIsInclusionAndExclusionOverThePieces) {
  Random random(1);
  int tried = 0, negative = 0, several = 0;
  for (const auto& shape : bodies())
    for (int round = 0; round < 10; ++round) {
      const double steep = random.log_uniform(0.002, 0.4);
      std::map<std::pair<double, double>, double> heights;
      const Mesh mesh = sheet(
          4, 1.6,
          [&](double x, double y) {
            return heights.emplace(std::make_pair(x, y), random.uniform(-steep, steep)).first->second;
          },
          random);
      const Particle p = pressed(shape, mesh, random.log_uniform(1e-3, 3e-2), random, 0.5);
      const Sum s = search(p, mesh);
      const double truth = brute_energy(p, mesh);
      ++tried;
      several += s.count > 1;
      negative += s.negative > 0;
      EXPECT_NEAR(s.energy, truth, 1e-6 * truth + 1e-11)
          << shape->name << " round " << round << " contacts " << s.count << " negative " << s.negative;
    }
  std::printf("%d poses, %d with several contacts, %d with negative ones\n", tried, several, negative);
}

// A body pushed to the mesh anywhere: ridges, valleys and vertices of all slopes, the sheet's border.
struct Scene {
  Mesh mesh;
  Particle body;
};
Scene random_scene(const test::ShapePointer& shape, Random& random, double spread = 0.9) {
  const double steep = random.log_uniform(1e-3, 0.4);
  std::map<std::pair<double, double>, double> heights;
  Scene s;
  s.mesh = sheet(
      8, 1.0,
      [&](double x, double y) {
        return heights.emplace(std::make_pair(x, y), random.uniform(-steep, steep)).first->second;
      },
      random);
  s.body = pressed(shape, s.mesh, random.log_uniform(1e-3, 3e-2), random, spread);
  return s;
}

TEST(SurfaceSearch, ForceAndEnergyDoNotKnowHowTheMeshIsCut) {
  Random random(2);
  for (const auto& shape : bodies())
    for (int round = 0; round < 40; ++round) {
      const Scene scene = random_scene(shape, random);
      const Sum whole = search(scene.body, scene.mesh);
      const Mesh fine = cut(cut(scene.mesh, random), random);
      const Sum parts = search(scene.body, fine);
      Mesh shuffled = fine;
      std::shuffle(shuffled.triangles.begin(), shuffled.triangles.end(), random.engine());
      const Sum other = search(scene.body, shuffled);
      const double size = whole.force.norm() + 1e-12;
      EXPECT_NEAR((whole.force - parts.force).norm(), 0, 1e-7 * size) << shape->name << " " << round;
      EXPECT_NEAR((whole.torque - parts.torque).norm(), 0, 1e-6 * size);
      EXPECT_NEAR((whole.force - other.force).norm(), 0, 1e-7 * size);
    }
}

// Some triangles halved at a side, which the neighbour there knows nothing of.
Mesh halved(const Mesh& mesh, Random& random) {
  Mesh fine;
  for (const Triangle& t : mesh.triangles) {
    const int k = random.below(3);
    const Vec3 &a = t[k], &b = t[(k + 1) % 3], &c = t[(k + 2) % 3],
               middle = a + random.uniform(0.2, 0.8) * (b - a);
    if (random.below(2)) {
      fine.add(a, b, c);
    } else if (random.below(2)) {
      fine.add(a, middle, c);
      fine.add(c, middle, b);
    } else {
      fine.add(middle, b, c);
      fine.add(c, a, middle);
    }
  }
  std::shuffle(fine.triangles.begin(), fine.triangles.end(), random.engine());
  return fine;
}

// The pieces of a ridge that is cut on one side run either way: a sharp body on it had no contact, or two.
TEST(SurfaceSearch, SidesMayBeCutOnOneSideOnly) {
  Random random(17);
  auto sharper = bodies();
  sharper.push_back(make_shape("rounded box", rounded_box({1, 0.8, 0.6}, 0.1)));
  sharper.push_back(make_shape("box", box({1, 0.8, 0.6})));
  sharper.push_back(make_shape("blocky", convex_superellipsoid({1, 0.8, 0.6}, 4, 1e-2).surfaces));
  sharper.push_back(make_shape("tablet", tablet(1, 0.6, 0.1)));
  int off = 0;
  for (const auto& shape : sharper)
    for (int round = 0; round < 100; ++round) {
      const Scene scene = random_scene(shape, random);
      const Sum whole = search(scene.body, scene.mesh),
                parts = search(scene.body, halved(scene.mesh, random));
      off += !((whole.force - parts.force).norm() <= 1e-5 * whole.force.norm() + 1e-12);
    }
  EXPECT_EQ(off, 0);
}

double rounded(double x, int digits) {
  char text[40];
  std::snprintf(text, sizeof text, "%.*g", digits, x);
  return std::atof(text);
}

// Two rectangles that meet at an angle along x = 0, > 0 where they make a ridge, turned and then rounded: the
// one of two triangles, the other in strips of them, or in one.
Mesh bent(double angle, int strips, const Mat3& turn, int digits, double gap = 0) {
  constexpr double size = 1;
  Mesh mesh;
  const auto at = [&](double x, double y) {
    Vec3 p = turn * (x > 0 ? Vec3(x * std::cos(angle), y, -x * std::sin(angle)) : Vec3(x, y, 0));
    for (int i = 0; i < 3; ++i) p[i] = rounded(p[i], digits);
    return p;
  };
  const auto strip = [&](double from, double to, double low, double high) {
    mesh.add(at(from, low), at(to, low), at(to, high));
    mesh.add(at(from, low), at(to, high), at(from, high));
  };
  strip(-size, 0, -size, size);
  for (int k = 0; k < strips; ++k)
    strip(gap, size, (2.0 * k / strips - 1) * size, (2.0 * (k + 1) / strips - 1) * size);
  return mesh;
}

// A body that its support is `depth` below such a seam, `off` beside it; what the seam's whole sides and one
// of strips make of it, of as many digits.
struct OnSeam {
  Vec3 whole, cut;  // forces

  OnSeam(const Shape& shape, double angle, int digits, double off, Random& random) {
    constexpr double scale = 0.1, depth = 1e-3;
    const Mat3 turn = random.turn().toRotationMatrix();
    Particle p;
    p.shape = &shape;
    p.scale = scale;
    p.q = random.turn();
    const Vec3 up = turn * Vec3(std::sin(angle / 2), 0, std::cos(angle / 2));
    const Vec3 seam = turn * Vec3(off, random.uniform(-0.7, 0.7), 0);
    p.x = seam - scale * (p.q * find_support(shape, p.q.conjugate() * -up).point) - depth * scale * up;
    whole = search(p, bent(angle, 1, turn, 17)).force;
    cut = search(p, bent(angle, 7, turn, digits), 1e-4 * scale).force;
  }
};

// Corners on another triangle's side are off it by the digits that they are written with, and leave wedges in
// which a body exactly on the seam would be on no triangle.
TEST(SurfaceSearch, SeamsOfFewDigitsHold) {
  Random random(12);
  for (const test::ShapePointer& shape : {test::sphere(), test::ellipsoid()})
    for (const double angle : {0.0, 1e-4, -1e-4, 0.1, -0.1, 0.8, -0.8, 1.5, -1.5})
      for (const int digits : {17, 8, 7, 6})
        for (int k = 0; k < 20; ++k) {
          const double off = k % 2 ? random.sign() * random.log_uniform(1e-12, 1e-5) : 0;
          const OnSeam force(*shape, angle, digits, off, random);
          EXPECT_LT((force.cut - force.whole).norm(), (digits > 16 ? 1e-6 : 0.05) * force.whole.norm())
              << angle << " " << digits << " " << off;
        }
}

// So do cracks along a row of corners, up to where they are told from none.
TEST(SurfaceSearch, NarrowCracksAreNone) {
  Particle p;
  p.shape = test::sphere().get();
  p.x = Vec3(0, 0.3, 0.99);
  const auto force = [&](double gap) {
    return search(p, bent(0, 1, Mat3::Identity(), 17, gap), 1e-4).force[2];
  };
  for (const double gap : {1e-12, 1e-8, 1e-5, 9e-5}) EXPECT_NEAR(force(gap), 0.01, 1e-6) << gap;
  EXPECT_NEAR(force(2e-4), 0.02, 1e-4);  // two borders, both of which the body meets
}

// A corner of a box near the line of a ridge, which is as many lines as there are strips: it may count for
// both faces where they are equally far, and for no more. One whose vertices were taken for tips gave it all
// the box's size.
TEST(SurfaceSearch, CornersOnSeamsOfFewDigits) {
  Random random(13);
  for (const double angle : {0.1, -0.1, 0.8, -0.8, 1.5, -1.5})
    for (const int digits : {17, 6})
      for (int k = 0; k < 150; ++k) {
        const double off = random.sign() * random.log_uniform(1e-12, 1e-3);
        const OnSeam force(*test::cuboid(), angle, digits, off, random);
        EXPECT_LE(force.cut.norm(), 2.5 * force.whole.norm()) << angle << " " << digits << " " << k;
        EXPECT_GE(force.cut.norm(), 0.4 * force.whole.norm()) << angle << " " << digits << " " << k;
      }
}

// As where two meshes have a plate in common, each with its own side of it.
TEST(SurfaceSearch, TrianglesThatAreThereTwiceCountOnce) {
  Random random(11);
  for (const auto& shape : bodies())
    for (int round = 0; round < 20; ++round) {
      const Scene scene = random_scene(shape, random);
      const Sum once = search(scene.body, scene.mesh);
      ASSERT_GT(once.force.norm(), 0);
      Mesh twice = scene.mesh;
      for (const Triangle& t : scene.mesh.triangles) {
        if (random.below(3) > 0) twice.add(t[0], t[2], t[1]);
        if (random.below(3) > 0) twice.add(t[1], t[2], t[0]);
      }
      std::shuffle(twice.triangles.begin(), twice.triangles.end(), random.engine());
      const Sum other = search(scene.body, twice);
      EXPECT_NEAR((once.force - other.force).norm(), 0, 1e-7 * once.force.norm()) << shape->name << round;
      EXPECT_EQ(once.count, other.count);
    }
}

// One triangle of a conforming sheet is cut at a side's middle, its neighbour is not.
TEST(SurfaceSearch, SidesThatDoNotConformAreNoBorders) {
  Mesh mesh, torn;
  const Vec3 a(-2, -2, 0), b(2, -2, 0), c(2, 2, 0), d(-2, 2, 0);
  mesh.add(a, b, c);
  mesh.add(a, c, d);
  torn.add(a, b, c);
  const Vec3 middle = 0.5 * (a + c);
  torn.add(a, middle, d);
  torn.add(middle, c, d);
  Random random(3);
  for (int round = 0; round < 50; ++round) {
    Particle p;
    p.shape = test::ellipsoid().get();
    p.q = random.turn();
    p.x = Vec3(0, 0, 0.55 + random.uniform(0, 0.3));
    p.x.head<2>() = round < 25 ? Vec2::Constant(random.uniform(-1, 1)) : Vec2(random.box(-1, 1).head<2>());
    const Sum one = search(p, mesh), other = search(p, torn);
    EXPECT_EQ(one.count, other.count);
    EXPECT_NEAR((one.force - other.force).norm(), 0, 1e-12);
    EXPECT_LE(one.count, 1);
  }
}

TEST(SurfaceSearch, ForceIsTheGradientOfAContinuousEnergy) {
  Random random(4);
  int several = 0, negative = 0;
  for (const auto& shape : bodies())
    for (int round = 0; round < 40; ++round) {
      Scene scene = random_scene(shape, random, 1.0);
      const Vec3 way = random.direction();
      const double h = 1e-6, stride = 2e-3;
      Sum last;
      // Along a path the energy's change is the force's work, and the force does not jump.
      for (int k = 0; k < 12; ++k) {
        const Sum here = search(scene.body, scene.mesh);
        Particle to = scene.body, from = scene.body;
        to.x += h * way;
        from.x -= h * way;
        const double slope = (search(to, scene.mesh).energy - search(from, scene.mesh).energy) / (2 * h);
        EXPECT_NEAR(-slope, here.force.dot(way), 2e-6 * (here.force.norm() + 1e-4))
            << shape->name << " " << round << " " << k;
        if (k > 0) {
          EXPECT_LT((here.force - last.force).norm(), 4 * stride) << shape->name << " " << round;
        }
        last = here;
        several += here.count > 1;
        negative += here.negative > 0;
        scene.body.x += stride * way;
      }
    }
  std::printf("several contacts %d, negative %d\n", several, negative);
}

// A ball in a trough of facets: as the facets become finer, the force becomes that of the round trough.
TEST(SurfaceSearch, FinerTroughsAndRollsTendToTheRoundOnes) {
  for (const bool trough : {true, false}) {
    const double radius = 4;
    std::vector<double> errors;
    for (const int facets : {40, 80, 160, 320, 640}) {
      Mesh mesh;
      const auto at = [&](int k, double y) {
        const double angle = 2 * M_PI * k / facets;
        return Vec3(radius * std::sin(angle), y,
                    trough ? radius - radius * std::cos(angle) : radius * std::cos(angle) - radius);
      };
      for (int k = -facets / 8; k < facets / 8; ++k) {
        mesh.add(at(k, -1.5), at(k + 1, -1.5), at(k + 1, 1.5));
        mesh.add(at(k, -1.5), at(k + 1, 1.5), at(k, 1.5));
      }
      double worst = 0;
      for (int k = 0; k < 37; ++k) {
        const double overlap = 0.02, angle = 0.01 * k;
        const double reach = trough ? radius - 1 + overlap : radius + 1 - overlap;
        Particle p;
        p.shape = test::sphere().get();
        p.x = Vec3(reach * std::sin(angle), 0.1,
                   trough ? radius - reach * std::cos(angle) : reach * std::cos(angle) - radius);
        const Vec3 normal =
            (trough ? -1 : 1) * Vec3(std::sin(angle), 0, trough ? -std::cos(angle) : std::cos(angle));
        worst = std::max(worst, (search(p, mesh).force - overlap * normal).norm() / overlap);
      }
      errors.push_back(worst);
    }
    std::printf("%s: error of the force", trough ? "trough" : "roll");
    for (const double e : errors) std::printf(" %.3g", e);
    std::printf("\n");
    EXPECT_LT(errors.back(), 0.02);
    EXPECT_LT(errors.back(), 0.2 * errors[1]);
  }
}

Mesh ridge_along_y(double slope) {
  Mesh mesh;
  for (const double side : {-1.0, 1.0})
    mesh.add(Vec3(0, -3, 0), Vec3(0, 3, 0), Vec3(3 * side, 0, -3 * slope));
  return mesh;
}

// A box's corners on the faces and its edges across the ridge: the force acts where they cross. (The search
// for the direction once ended at the kink, whose normal is right, with the point of another direction.)
TEST(SurfaceSearch, ForceOfABoxOnARidgeIsTheGradientOfItsEnergy) {
  Random random(11);
  int crossings = 0, jumps = 0;
  for (const double slope : {0.2, 1.0})
    for (int round = 0; round < 200; ++round) {
      const Mesh mesh = ridge_along_y(slope);
      const Particle p = pressed(test::cuboid(), mesh, 0.01, random, 0.5);
      const Sum s = search(p, mesh);
      if (s.count != 1 || s.flat) continue;  // a polygon's energy is that of its points
      const Vec3 way = random.direction(), axis = random.direction();
      constexpr double h = 1e-6;
      double energy[2];
      for (const int side : {0, 1}) {
        Particle q = p;
        q.x += (2 * side - 1) * h * way;
        q.q = Quat(Eigen::AngleAxisd((2 * side - 1) * h, axis)) * p.q;
        energy[side] = search(q, mesh).energy;
      }
      if (std::abs(energy[1] - 2 * s.energy + energy[0]) >
          1e-3 * h * s.force.norm()) {  // another corner or edge
        ++jumps;
        continue;
      }
      const double slope_of = (energy[1] - energy[0]) / (2 * h);
      EXPECT_NEAR(slope_of, -s.force.dot(way) - s.torque.dot(axis), 1e-5 * s.force.norm()) << round;
      crossings += std::abs(s.force.normalized().y()) < 1e-9 &&
                   std::abs(s.force.normalized().z() - 1 / std::hypot(1, slope)) > 1e-6;
    }
  EXPECT_GT(crossings, 50);
  EXPECT_LT(jumps, 8);
}

// A box across a ridge may be far below the plane of one side, but only beyond the ridge.
TEST(SurfaceSearch, APlaneHoldsNothingBesideItsTriangles) {
  Random random(12);
  constexpr double slope = 0.2;
  const Mesh mesh = ridge_along_y(slope);
  int clear = 0, touching = 0;
  for (int round = 0; round < 2000; ++round) {
    Particle box;
    box.shape = test::cuboid().get();
    box.q = random.turn_by(random.uniform(0, 0.15));
    box.x = Vec3(random.uniform(-0.4, 0.4), random.uniform(-0.4, 0.4), random.uniform(0.55, 0.8));
    const Vec3 half(1, 0.8, 0.6);
    bool meets = false;  // a corner below both sides, or the ridge within the box
    for (int corner = 0; corner < 8; ++corner) {
      const Vec3 sign(corner & 1 ? 1 : -1, corner & 2 ? 1 : -1, corner & 4 ? 1 : -1);
      const Vec3 at = box.x + box.q * half.cwiseProduct(sign);
      meets |= at.z() < -slope * std::abs(at.x());
    }
    for (double y = -3; y < 3; y += 1e-3)
      meets |= ((box.q.conjugate() * (Vec3(0, y, 0) - box.x)).cwiseAbs() - half).maxCoeff() < 0;
    EXPECT_EQ(search(box, mesh).count > 0, meets) << round;
    ++(meets ? touching : clear);
  }
  EXPECT_GT(clear, 500);
  EXPECT_GT(touching, 300);
}

// A body that leans over a plate's border may have its deepest point over one triangle, and meet the plate in
// another one only.
TEST(SurfaceSearch, SharpBodiesAtTheBorderOfAPlateMeetAnyOfItsTriangles) {
  Random random(13);
  int met = 0, missed = 0, wrong = 0;
  for (int round = 0; round < 20000; ++round) {
    const test::Solid solid = families::any_solid(random);
    const double size = random.log_uniform(0.5, 30);
    const Mesh plate = sheet(
        2, size, [](double, double) { return 0.0; }, random);
    Particle p{solid.shape.get(), 1 / solid.shape->bounding_radius, Vec3::Zero(), random.turn()};
    const Vec3 lowest = p.q * (p.scale * find_hull_support(*p.shape, p.q.conjugate() * -Vec3::UnitZ()).point);
    const Vec3 at(size - random.log_uniform(1e-6, 0.05),
                  random.below(2) ? random.uniform(-1, 1) * size : random.uniform(-0.01, 0.01),
                  -random.log_uniform(1e-5, 1e-2));
    p.x = at - lowest;
    bool clear = true;  // of every triangle, by a plane that parts them
    for (const Triangle& t : plate.triangles) clear = clear && is_clear_of(p, t.data(), 3);
    const int count = search(p, plate).count;
    wrong += (count > 0) == clear;
    ++(clear ? missed : met);
  }
  EXPECT_LE(wrong, 1);  // once 6
  EXPECT_GT(missed, 200);
  EXPECT_GT(met, 10000);
}

// Beside the end of a valley a body may be below the one face's plane, and the valley an edge that stands out
// on the other side: a needle that touched neither face had a contact deeper than it is thick.
TEST(SurfaceSearch, NeedlesInAValleyMeetItsFacesOnly) {
  const auto shape = make_shape("needle", exact_ellipsoid({1, 0.15, 0.15}));
  Random random(18);
  int clear = 0, met = 0, phantoms = 0;
  for (int round = 0; round < 20000; ++round) {
    const double low = random.uniform(-0.4, -0.1);
    const Vec3 a(0, -0.8, random.uniform(-0.1, 0.1)), b(0, 0, low), c(-0.8, 0, random.uniform(0, 0.3)),
        d(0.8, 0, random.uniform(0, 0.3));
    Mesh mesh;
    mesh.add(a, b, c);
    mesh.add(a, d, b);
    Particle p;
    p.shape = shape.get();
    p.q = random.turn();
    p.x = Vec3(random.uniform(-1, 1), random.uniform(-1.4, 0.4), random.uniform(0, 0.4));
    const Mat3 to_ball = Vec3(1, 1 / 0.15, 1 / 0.15).asDiagonal() * p.q.toRotationMatrix().transpose();
    double least = kFarAway;  // to the faces, where the needle is the unit ball
    for (const Triangle& t : mesh.triangles) {
      std::vector<Vec3> hull;
      for (const Vec3& x : t) hull.push_back(to_ball * (x - p.x));
      least = std::min(least, nearest(hull, Vec3::Zero()).norm());
    }
    const Sum found = search(p, mesh);
    if (least > 1 + 1e-9) {
      ++clear;
      EXPECT_EQ(found.count, 0) << round << " " << found.deepest;
    } else if (least > 0.9 && least < 1 - 1e-9) {
      ++met;
      EXPECT_GT(found.count, 0) << round << " " << least;
      phantoms += least > 0.95 && found.deepest > 0.15;
    }
  }
  EXPECT_GT(clear, 5000);
  EXPECT_GT(met, 300);
  EXPECT_LE(phantoms, 2);  // of those that reach round the border of the wall
}

// A peak between ridges and valleys in turn, in a body's sharp edge or beside it: each ridge may have the
// edge past the peak, while one of them climbs along every normal of the edge. A box had no contact there
// then.
TEST(SurfaceSearch, PeaksBetweenRidgesInASharpEdge) {
  const Vec3 peak(0.8, 0, 0.1963);
  const std::vector<Vec3> round = {{0, -0.8, 0.0306}, {0.8, -0.8, -0.219}, {1.6, -0.8, 0.0628},
                                   {1.6, 0, -0.1287}, {1.6, 0.8, 0.153},   {0.8, 0.8, -0.2214},
                                   {0, 0.8, 0.1517},  {0, 0, -0.2602}};
  Mesh mesh;
  for (std::size_t k = 0; k < 8; ++k) mesh.add(peak, round[k], round[(k + 1) % 8]);
  const Vec3 half(1, 0.8, 0.6);
  const auto shape = make_shape("box", box(half));
  // Past both ridges; deep enough in the one face for its way out to lead through the other.
  const Sum past =
                search({shape.get(),
                        1,
                        {0.84133857, 0.14511646, 1.51318718},
                        Quat(0.14369818857095248, -0.831981555847496, -0.153482138714979, 0.513420640826294)},
                       mesh),
            face = search({shape.get(),
                           1,
                           {-0.01458845, -0.6642325, 1.005267588},
                           Quat(-0.70601771611554, 0.706969444463862, 0.022448042510401, -0.035061011293245)},
                          mesh);
  ASSERT_EQ(past.count, 1);
  EXPECT_NEAR(past.deepest, 0.0101, 1e-3);
  ASSERT_EQ(face.count, 1);
  EXPECT_NEAR(face.deepest, 0.0072, 1e-3);

  Random random(19);
  int met = 0, missed = 0;
  for (int trial = 0; trial < 20000; ++trial) {
    Particle p{shape.get(), 1, Vec3::Zero(), random.turn()};
    const Vec3 down = p.q.conjugate() * -Vec3::UnitZ();  // the edge that is lowest, and a point of it
    const int along = random.below(3);
    Vec3 at;
    for (int k = 0; k < 3; ++k)
      at[k] = k == along ? random.uniform(-0.9, 0.9) * half[k]
                         : (down[k] > 0 ? 1 : -1) * (half[k] - random.log_uniform(1e-4, 1e-2));
    p.x = peak - p.q * at;
    const bool alone = std::none_of(round.begin(), round.end(), [&](const Vec3& x) {
      return ((p.q.conjugate() * (x - p.x)).cwiseAbs() - half).maxCoeff() < 0;
    });
    met += alone;
    missed += alone && search(p, mesh).count == 0;
  }
  EXPECT_GT(met, 10000);
  EXPECT_EQ(missed, 0);  // once 140
}

// Outside an icosahedron a needle is behind the planes of faces that it passes: it had a second contact, with
// the face at the other side, half of its size deep.
TEST(SurfaceSearch, NeedlesBesideASolidMeetNoFaceFromWithin) {
  const double golden = 0.5 * (1 + std::sqrt(5.0)), size = 0.8 / std::sqrt(1 + golden * golden);
  std::vector<Vec3> corners;
  for (int k = 0; k < 12; ++k) {
    Vec3 x;
    x[k % 3] = 0;
    x[(k + 1) % 3] = (k / 3 & 1) ? size : -size;
    x[(k + 2) % 3] = (k / 6 & 1) ? size * golden : -size * golden;
    corners.push_back(x);
  }
  Mesh mesh;
  const auto is_side = [&](int i, int j) { return (corners[i] - corners[j]).norm() < 2.1 * size; };
  for (int i = 0; i < 12; ++i)
    for (int j = i + 1; j < 12; ++j)
      for (int k = j + 1; k < 12; ++k)
        if (is_side(i, j) && is_side(j, k) && is_side(i, k)) mesh.add(corners[i], corners[j], corners[k]);
  ASSERT_EQ(mesh.triangles.size(), 20u);
  const auto needle = make_shape("needle", exact_ellipsoid({1, 0.15, 0.15}));
  const Sum one = search({needle.get(),
                          1,
                          {0.78688, 0.36755, 0.18539},
                          Quat(-0.455516, 0.611776, 0.019618, -0.646414).normalized()},
                         mesh),
            other = search({needle.get(),
                            1,
                            {-0.29659, -0.66171, -0.43416},
                            Quat(0.835206, 0.093879, -0.50639, -0.19284).normalized()},
                           mesh);
  EXPECT_EQ(one.count, 1);
  EXPECT_NEAR(one.deepest, 0.00402, 1e-4);
  EXPECT_EQ(other.count, 1);
  EXPECT_NEAR(other.deepest, 0.00077, 1e-4);
}

TEST(SurfaceSearch, RidgeValleyAndVertex) {
  Particle ball;
  ball.shape = test::sphere().get();
  Mesh ridge, valley, pyramid;
  for (const double side : {-1.0, 1.0}) {
    ridge.add(Vec3(0, -3, 0), Vec3(0, 3, 0), Vec3(3 * side, 0, -3));
    valley.add(Vec3(0, -5, 0), Vec3(0, 5, 0), Vec3(5 * side, 0, 5));
  }
  for (int k = 0; k < 4; ++k) {
    const double a = k * M_PI / 2, b = a + M_PI / 2;
    pyramid.add(Vec3(0, 0, 0), Vec3(2 * std::cos(a), 2 * std::sin(a), -2),
                Vec3(2 * std::cos(b), 2 * std::sin(b), -2));
  }
  ball.x = Vec3(0.02, 0.3, 0.99);
  Sum s = search(ball, ridge);
  EXPECT_EQ(s.count, 1);
  const Vec3 from_ridge = (ball.x - Vec3(0, 0.3, 0));
  EXPECT_NEAR((s.force - (1 - from_ridge.norm()) * from_ridge.normalized()).norm(), 0, 1e-12);
  ball.x = Vec3(0.01, 0.02, 0.99);
  s = search(ball, pyramid);
  EXPECT_EQ(s.count, 1);
  EXPECT_NEAR((s.force - (1 - ball.x.norm()) * ball.x.normalized()).norm(), 0, 1e-10);
  ball.x = Vec3(0, 0.2, std::sqrt(2.0) * 0.999);
  s = search(ball, valley);
  EXPECT_EQ(s.count, 2);
  EXPECT_NEAR((s.force - Vec3(0, 0, 2 * 0.001 * std::sqrt(0.5))).norm(), 0, 1e-12);
}

}  // namespace
}  // namespace nurbs::test_surface_search

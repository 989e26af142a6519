// See deep_fuzz.h.
#include "support/deep_fuzz.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

#include "nurbs/tolerances.h"
#include "shapes/primitives.h"
#include "shapes/random_pebble.h"
#include "shapes/revolved.h"
#include "shapes/rounded_polyhedron.h"
#include "support/least_overlap.h"
#include "support/surface_cloud.h"

namespace nurbs::deep_fuzz {

using families::Known;
using families::PairCase;
using families::Truth;
using test::Random;
using test::Solid;

const char* const kPoseNames[kPoses] = {"deep", "coaxial", "centred", "features", "sizes", "saddles"};

namespace {

// --- bodies
// ----------------------------------------------------------------------------------------------------

// Half spaces about the unit sphere; the corners of what they leave when moved inwards by `rounding`.
Solid rounded_solid(Random& random, int faces, double rounding) {
  std::vector<HalfSpace> half = platonic_solid("octahedron", 1.3);
  for (int k = static_cast<int>(half.size()); k < faces; ++k)
    half.push_back({random.direction(), random.uniform(0.7, 1)});
  std::vector<Vec3> corners, normals;
  for (const HalfSpace& h : half) normals.push_back(h.normal);
  for (size_t i = 0; i < half.size(); ++i)
    for (size_t j = 0; j < i; ++j)
      for (size_t k = 0; k < j; ++k) {
        Mat3 m;
        m << half[i].normal.transpose(), half[j].normal.transpose(), half[k].normal.transpose();
        if (std::abs(m.determinant()) < 1e-9) continue;
        const Vec3 x =
            m.inverse() * (Vec3(half[i].offset, half[j].offset, half[k].offset) - Vec3::Constant(rounding));
        if (std::all_of(half.begin(), half.end(),
                        [&](const HalfSpace& h) { return h.normal.dot(x) <= h.offset - rounding + 1e-12; }))
          corners.push_back(x);
      }
  const auto support = [corners, rounding](const Vec3& d) -> Vec3 {
    return *std::max_element(corners.begin(), corners.end(), [&](const Vec3& x, const Vec3& y) {
      return d.dot(x) < d.dot(y);
    }) + rounding * d.normalized();
  };
  return turned_solid(random, "rounded polyhedron", rounded_polyhedron(half, Vec3::Zero(), rounding), support,
                      normals);
}

Body searched(const std::string& name, std::vector<NurbsSurface> surfaces) {
  Body body;
  body.solid.shape = make_shape(name, std::move(surfaces));
  const auto cloud = std::make_shared<test::SurfaceCloud>(*body.solid.shape);
  body.solid.support = [cloud](const Vec3& d) -> Vec3 { return cloud->exact_point(d.normalized()); };
  body.accuracy = 1e-12;
  body.cheap = false;
  return body;
}

Vec3 log_axes(Random& random, double least) {
  Vec3 axes(1, random.log_uniform(least, 1), random.log_uniform(least, 1));
  if (random.below(3) == 0) axes[random.whole(1, 2)] = 1;
  if (random.below(6) == 0) axes[1] = axes[2];
  return axes;
}

Body make_body(Random& random, int kind) {
  const double weights = random.below(3) ? 1 : 1e3;
  const auto closed = [](Solid solid) { return Body{std::move(solid)}; };
  switch (kind) {
    case 0: {
      const Vec3 axes = log_axes(random, random.below(3) ? 0.1 : 1e-3);
      return closed(turned_solid(random, "ellipsoid", exact_ellipsoid(axes),
                                 [=](const Vec3& d) { return test::ellipsoid_support(d, axes); }));
    }
    case 1:
      if (random.below(2))
        return closed(test::double_cone(random, random.log_uniform(0.1, 2), random.uniform(0.05, 1.5),
                                        random.uniform(0.05, 1.5), weights));
      return closed(test::cone(random, random.log_uniform(0.1, 2), random.uniform(0.1, 2), weights));
    case 2:
      if (random.below(2))
        return closed(test::frustum(random, random.uniform(0.05, 1.2), random.uniform(0.05, 1.2),
                                    random.uniform(0.1, 1.5), weights));
      return closed(
          test::cylinder(random, random.log_uniform(0.05, 1.2), random.log_uniform(0.05, 1), weights));
    case 3:
      return closed(test::capsule(random, random.log_uniform(0.05, 1), random.uniform(0.05, 1)));
    case 4:
      return closed(test::lens(random, random.log_uniform(1.02, 30)));
    case 5:
      return closed(test::polyhedron(random, random.whole(4, 9), random.log_uniform(0.05, 1), weights));
    case 6: {
      const Vec3 half = log_axes(random, 0.05);
      return closed(turned_solid(
          random, "box", box(half), [=](const Vec3& d) { return test::box_support(d, half, 0); },
          test::axes_normals()));
    }
    case 7: {
      const Vec3 half = log_axes(random, 0.1);
      const double r = half.minCoeff() * random.uniform(0.05, 0.95);
      return closed(turned_solid(
          random, "rounded box", rounded_box(half, r),
          [=](const Vec3& d) { return test::box_support(d, half - Vec3::Constant(r), r); },
          test::axes_normals()));
    }
    case 8:
      return closed(rounded_solid(random, random.whole(8, 12), random.uniform(0.05, 0.4)));
    case 9: {
      const double height = random.log_uniform(0.05, 2),
                   rim = 0.5 * height * random.uniform(0.1, 0.9) / std::max(1.0, height);
      return closed(turned_solid(
          random, "tablet", tablet(1, height, rim),
          [=](const Vec3& d) { return test::disc_support(d, 1 - rim, 0.5 * height - rim, rim); },
          test::poles()));
    }
    case 10: {
      const double blunt = random.uniform(0.2, 1), pointed = random.uniform(0.5, 2);
      return closed(turned_solid(
          random, "egg", egg(0.7, blunt, pointed),
          [=](const Vec3& d) {
            return test::ellipsoid_support(d, Vec3(0.7, 0.7, d[2] > 0 ? pointed : blunt));
          },
          test::poles()));
    }
    case 11: {
      const double polar = random.log_uniform(0.05, 5);
      return closed(turned_solid(
          random, "polar", revolved_ellipsoid(1, polar),
          [=](const Vec3& d) { return test::ellipsoid_support(d, Vec3(1, 1, polar)); }, test::poles()));
    }
    case 12:
      return searched("pebble", random_pebble(static_cast<std::uint64_t>(random.below(1000)),
                                              {random.uniform(0.1, 1), random.uniform(0.4, 1),
                                               random.uniform(0.4, 1), 1}));
    case 13:
      return searched("biconvex", biconvex_tablet(1, random.uniform(0.05, 0.5), random.uniform(1.3, 5),
                                                  random.uniform(0.02, 0.2)));
    case 14:
      return searched("kinked", fitted_ellipsoid(Vec3(1, random.uniform(0.3, 1), random.uniform(0.3, 1)),
                                                 random.whole(1, 3)));
    default:
      return searched("blocky", fitted_superellipsoid(Vec3(1, random.uniform(0.5, 1), random.uniform(0.5, 1)),
                                                      random.uniform(2.5, 8), 3));
  }
}
constexpr int kKinds = 16;
constexpr int kClosedKinds = 12;  // of them, supports in closed form

Body make_further(Random& random, int kind) {
  const auto closed = [](Solid solid) { return Body{std::move(solid)}; };
  const auto image = [&](const Solid& solid, double least) {
    return Body{test::stretched(random, solid, least)};
  };
  switch (kind) {
    case 0:
    case 1:
      return image(make_body(random, random.below(kClosedKinds)).solid, random.log_uniform(0.02, 0.5));
    case 2: {
      const double low = random.below(3) ? random.uniform(-1, 0.8) : 0,
                   high = random.below(3) ? 1 : random.uniform(std::min(0.95, low + 0.05), 1);
      const Solid segment = test::spherical_segment(random, low, high);
      return random.below(2) ? closed(segment) : image(segment, 0.1);
    }
    case 3:
      return closed(test::conic_of_revolution(random, random.log_uniform(0.1, 2), random.log_uniform(0.1, 2),
                                              random.log_uniform(1e-3, 1e3)));
    case 4:
      return closed(test::reuleaux_prism(random, random.log_uniform(0.02, 1)));
    case 5: {
      const Solid body = random.below(2) ? test::sphericon(random) : test::turned_reuleaux(random);
      return random.below(2) ? closed(body) : image(body, 0.1);
    }
    case 6:
      return closed(test::polyhedron(random, random.whole(10, 32), random.log_uniform(0.02, 1)));
    case 7:
      return closed(rounded_solid(random, random.whole(8, 14), random.log_uniform(1e-4, 0.02)));
    case 8: {
      std::vector<Vec2> corners{{0, -random.uniform(0.2, 1)}};
      const int count = random.whole(1, 4);
      for (int k = 0; k < count; ++k) {  // on an ellipse: convex
        const double angle = M_PI * ((k + random.uniform(0.2, 0.8)) / count - 0.5);
        corners.push_back({std::cos(angle), -corners[0][1] * std::sin(angle)});
      }
      corners.push_back({0, -corners[0][1]});
      return searched("rounded profile", revolve(rounded_profile(corners, random.log_uniform(1e-3, 0.2))));
    }
    case 9:
      return searched(
          "superellipsoid",
          fitted_superellipsoid(Vec3(1, random.uniform(0.3, 1), random.uniform(0.3, 1)),
                                random.below(2) ? random.uniform(2.01, 2.4) : random.uniform(8, 12),
                                random.whole(3, 5)));
    case 10: {
      const double thin = random.log_uniform(1e-3, 0.05);
      switch (random.below(4)) {
        case 0:
          return closed(test::cylinder(random, 1, thin));
        case 1:
          return closed(test::cylinder(random, thin, 1));
        case 2:
          return closed(test::capsule(random, thin, 1));
        default: {
          const Vec3 half(1, random.below(2) ? 1 : thin, thin);
          return closed(turned_solid(
              random, "plate", box(half), [=](const Vec3& d) { return test::box_support(d, half, 0); },
              test::axes_normals()));
        }
      }
    }
    default:
      return image(closed(test::polyhedron(random, random.whole(4, 8), 1, 1e3)).solid, 0.2);
  }
}
constexpr int kFurtherKinds = 12;

// --- poses
// -----------------------------------------------------------------------------------------------------

double radius_of(const Particle& p) {
  return p.scale * p.shape->bounding_radius;
}

// Of revolution, or one that looks like it; shape frame.
Vec3 axis_of(const Shape& shape, Random& random) {
  if (shape.revolution.found) return shape.revolution.axis;
  return shape.principal_axes * Vec3::Unit(random.below(3));
}

Vec3 some_direction(const Body& body, Random& random) {
  const Solid& solid = body.solid;
  Vec3 d = random.direction();
  if (!solid.normals.empty() && random.below(3) == 0)
    d = solid.normals[random.below(static_cast<int>(solid.normals.size()))];
  else if (random.below(4) == 0)
    d = solid.support(d).normalized();
  else if (random.below(4) == 0)
    d = random.sign() * axis_of(*solid.shape, random);
  if (random.below(2)) d = (d + random.log_uniform(1e-12, 0.1) * random.direction()).normalized();
  return d;
}

// The rotation of least angle that takes unit x to unit y.
Quat taking(const Vec3& x, const Vec3& y) {
  return Quat::FromTwoVectors(x, y).normalized();
}
double small(Random& random, double most) {
  return random.below(4) == 0 ? 0 : random.log_uniform(1e-12, most);
}

// Supports along n face each other `gap` apart.
void face(const Body& a, const Body& b, const Vec3& n, double gap, PairCase* c) {
  c->b.x = support_of(a.solid, c->a, n) - support_of(b.solid, c->b, -n) + gap * n;
}

// Least eigenvalue of the bend of p along n, W_A + W_B, by differences: of no use at edges and on faces.
double least_bend(const Body& a, const Body& b, const PairCase& c, const Vec3& n) {
  constexpr double kStep = 1e-4;
  const Vec3 t = n.unitOrthogonal(), s = n.cross(t);
  const auto apart = [&](const Vec3& d) {
    return support_of(a.solid, c.a, d) - support_of(b.solid, c.b, -d);
  };
  const auto turns = [&](const Vec3& along) -> Vec3 {
    return (apart((n + kStep * along).normalized()) - apart((n - kStep * along).normalized())) / (2 * kStep);
  };
  const Vec3 by_t = turns(t), by_s = turns(s);
  const double tt = by_t.dot(t), ss = by_s.dot(s), ts = 0.5 * (by_t.dot(s) + by_s.dot(t));
  return std::max(0.0, 0.5 * (tt + ss) - std::hypot(0.5 * (tt - ss), ts));
}

void place(const Body& a, const Body& b, Pose pose, Random& random, PairCase* c) {
  c->a = {a.solid.shape.get(), 1, Vec3::Zero(), random.below(4) ? random.turn() : Quat::Identity()};
  c->b = {b.solid.shape.get(), random.below(3) ? random.log_uniform(0.1, 10) : 1, Vec3::Zero(),
          random.turn()};
  if (pose == Pose::sizes) c->b.scale = std::pow(random.log_uniform(1e2, 1e6), random.sign());
  const double size = std::min(radius_of(c->a), radius_of(c->b));
  const Vec3 n = (c->a.q * some_direction(a, random)).normalized();
  const auto meet = [&] {  // one of B's own directions along it
    if (random.below(2)) return;
    const Vec3 own = c->b.q * some_direction(b, random);
    if (own.dot(n) < 0.5) c->b.q = (taking(own, -n) * c->b.q).normalized();
  };
  const auto align = [&] {
    const Vec3 to = random.sign() * (c->a.q * axis_of(*c->a.shape, random)),
               from = c->b.q * axis_of(*c->b.shape, random);
    c->b.q = (random.turn_by(small(random, 0.3)) * taking(from, to) * c->b.q).normalized();
    return to;
  };
  switch (pose) {
    case Pose::deep:
      if (random.below(2))
        c->b.x = random.uniform(0, 1.2) * size * random.direction();
      else
        face(a, b, n, -size * random.log_uniform(1e-4, 2), c);
      break;
    case Pose::coaxial: {
      const Vec3 axis = align();
      if (random.below(2)) {
        const double room = axis.dot(support_of(a.solid, c->a, axis) - support_of(b.solid, c->b, -axis));
        c->b.x = (room - size * random.log_uniform(1e-6, 2)) * axis;
      } else {
        c->b.x = random.uniform(-1, 1) * size * axis;
      }
      c->b.x += small(random, 0.3) * size * axis.cross(random.direction()).normalized();
      break;
    }
    case Pose::centred:
      if (random.below(2)) align();
      c->b.x = small(random, 0.1) * size * random.direction();
      break;
    case Pose::features:
      meet();
      face(a, b, n, -size * random.log_uniform(1e-9, 1), c);
      break;
    case Pose::sizes:
      meet();
      if (random.below(4))
        face(a, b, n, -size * random.log_uniform(1e-9, 10), c);
      else
        c->b.x = random.uniform(0, 1) * std::max(radius_of(c->a), radius_of(c->b)) * random.direction();
      break;
    case Pose::saddles: {
      if (&a == &b) {
        c->b.q = c->a.q;
        if (random.below(3) == 0) c->b.q = Quat(Eigen::AngleAxisd(M_PI, n)) * c->b.q;
        c->b.q = (random.turn_by(small(random, 0.1)) * c->b.q).normalized();
        if (random.below(2)) c->b.scale = 1;
      } else {
        meet();
      }
      const double bend = least_bend(a, b, *c, n);
      const double deep = bend > 1e-6 * size && bend < 2 * size
                              ? bend * (1 + random.sign() * random.log_uniform(1e-6, 0.5))
                              : size * random.log_uniform(1e-3, 1);
      face(a, b, n, -deep, c);
      break;
    }
  }
}

}  // namespace

Fuzz::Fuzz(std::uint64_t seed, int count, Kinds kinds) : seed_(seed) {
  Random random(seed);
  for (int k = 0; k < count; ++k)
    bodies_.push_back(kinds == Kinds::first ? make_body(random, k % kKinds)
                                            : make_further(random, k % kFurtherKinds));
}

const Body& Fuzz::body_of(const Particle& p) const {
  return *std::find_if(bodies_.begin(), bodies_.end(),
                       [&](const Body& b) { return b.solid.shape.get() == p.shape; });
}

PairCase Fuzz::pair(Pose pose, long k) const {
  constexpr std::uint64_t kSeeds = 5;  // of the poses when pairs were first saved by number
  Random random(1000003 * (seed_ * kSeeds + static_cast<std::uint64_t>(pose)) +
                static_cast<std::uint64_t>(k));
  const int count = static_cast<int>(bodies_.size());
  const Body &a = bodies_[random.below(count)], &other = bodies_[random.below(count)],
             &b = pose == Pose::saddles && random.below(2) ? a : other;
  PairCase c;
  place(a, b, pose, random, &c);
  c.truth.gap = -std::numeric_limits<double>::infinity();
  c.overlap = [&a, &b, ca = c.a, cb = c.b](const Vec3& d) {
    return d.dot(support_of(a.solid, ca, d)) - d.dot(support_of(b.solid, cb, -d)) - d.dot(cb.x - ca.x);
  };
  return c;
}

Truth Fuzz::truth(const PairCase& c, std::uint64_t seed) const {
  Random random(seed);
  const Body &a = body_of(c.a), &b = body_of(c.b);
  const bool cheap = a.cheap && b.cheap;
  std::vector<Vec3> starts;
  for (const Vec3& d : test::spiral(2000))
    if (cheap || random.below(4) == 0) starts.push_back(d);
  for (const Vec3& n : a.solid.normals) starts.push_back(c.a.q * n);
  for (const Vec3& n : b.solid.normals) starts.push_back(c.b.q * -n);
  for (int k = 0; k < 3; ++k)
    for (const double side : {1.0, -1.0}) {
      starts.push_back(c.a.q * (c.a.shape->principal_axes * (side * Vec3::Unit(k))));
      starts.push_back(c.b.q * (c.b.shape->principal_axes * (side * Vec3::Unit(k))));
    }
  test::Compass compass;
  if (!cheap) compass.minima = 3, compass.moves = 100;
  Truth truth;
  truth.known = Known::bound;
  truth.gap = -test::least_overlap(c.overlap, starts, compass, random);
  return truth;
}

Judgement judge(const Fuzz& fuzz, const PairCase& c, const Truth& truth, const ContactResult& r) {
  double noise = 0;
  for (const Particle* p : {&c.a, &c.b}) noise += fuzz.body_of(*p).accuracy * radius_of(*p);
  const double reach = std::max(radius_of(c.a), radius_of(c.b)),
               size = std::min(radius_of(c.a), radius_of(c.b));
  Judgement j;
  j.allowed = c.tolerance * size + noise + 10 * kRoundoff * reach;
  const auto fails = [&](const char* what, double error) {
    j.error = error;
    j.wrong = error <= j.allowed ? "" : what;
    return !(error <= j.allowed);
  };
  if (!(std::isfinite(r.gap) && r.normal.allFinite() && r.point_a.allFinite() && r.point_b.allFinite())) {
    j.wrong = "no number";
    return j;
  }
  // The true gap is at least the truth found.
  if (fails("depth", truth.gap - r.upper) || fails("bracket", r.lower - r.upper)) return j;
  if (r.status == Status::separated) return j;
  const double along = -c.overlap(r.normal);
  if (fails("normal", std::abs(along - r.gap)) || fails("gap", truth.gap - r.gap) ||
      fails("outside", std::max(r.lower - r.gap, r.gap - r.upper)) ||
      fails("points", std::abs(r.normal.dot(r.point_b - r.point_a) - r.gap)))
    return j;
  if (r.status == Status::unresolved) {
    j.wrong = "unresolved";
    j.error = r.upper - r.lower;
  } else {
    fails("width", r.upper - r.lower);
  }
  return j;
}

}  // namespace nurbs::deep_fuzz

// Poses and truths; see solid_families.h. Apart, two support points that face each other are the answer;
// overlapping, the least overlap is searched with the closed forms.
#include "support/solid_families.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "nurbs/affine.h"
#include "shapes/primitives.h"
#include "shapes/revolved.h"
#include "support/bodies.h"
#include "support/hidden_dents.h"
#include "support/least_overlap.h"
#include "support/pairs.h"

namespace nurbs::families {

using test::Solid;

namespace {

constexpr int kBodies = 6;

Solid make_solid(Kind kind, Random& random, int k) {
  const double weights = k % 3 == 2 ? 1e3 : 1;
  switch (kind) {
    case Kind::cone:
      return k % 2 ? test::double_cone(random, random.uniform(0.3, 1.5), random.uniform(0.1, 1.5),
                                       random.uniform(0.1, 1.5), weights)
                   : test::cone(random, random.uniform(0.3, 1.5), random.uniform(0.3, 2), weights);
    case Kind::cylinder:
      return k % 2 ? test::frustum(random, random.uniform(0.2, 1.2), random.uniform(0.2, 1.2),
                                   random.uniform(0.1, 1.5), weights)
                   : test::cylinder(random, random.uniform(0.1, 1.2), random.uniform(0.05, 1), weights);
    case Kind::capsule:
      return test::capsule(random, random.uniform(0.1, 1), random.uniform(0.1, 1));
    case Kind::lens:
      return test::lens(random, random.log_uniform(1.02, 30));
    default:
      return test::polyhedron(random, 4 + k, k % 4 == 3 ? 0.05 : random.uniform(0.3, 1));
  }
}

const Solid& unit_ball() {
  static const Solid ball = test::ellipsoid_solid(Vec3(1, 1, 1));
  return ball;
}

const Solid& any_of(Kind kind, Random& random) {
  return solids_of(kind)[random.below(kBodies)];
}

// A partner for a body of `kind`: of its own kind, any other kind, or a ball.
const Solid& partner(Kind kind, Random& random) {
  const int which = random.below(4);
  if (which == 0) return unit_ball();
  return which == 1 ? any_solid(random) : any_of(kind, random);
}

// Directions that matter: any, of a face, along the support of a vertex, and next to those.
Vec3 some_direction(const Solid& solid, Random& random) {
  Vec3 d = random.direction();
  if (!solid.normals.empty() && random.below(3) == 0)
    d = solid.normals[random.below(static_cast<int>(solid.normals.size()))];
  else if (random.below(4) == 0)
    d = solid.support(d).normalized();
  if (random.below(2)) d = (d + random.log_uniform(1e-12, 0.1) * random.direction()).normalized();
  return d;
}

// Least overlap: a scan, directions of faces, and a compass that turns at random from the best.
Truth search_least(const PairCase& c, const Solid& a, const Solid& b, Random& random) {
  std::vector<Vec3> starts = test::spiral(2000);
  for (const Vec3& n : a.normals) starts.push_back(c.a.q * n);
  for (const Vec3& n : b.normals) starts.push_back(c.b.q * -n);
  Truth truth;
  truth.known = Known::bound;
  truth.gap = -test::least_overlap(c.overlap, starts, {}, random);
  return truth;
}

// p(d) of two placed bodies, by their closed forms; the bodies must outlive it.
std::function<double(const Vec3&)> overlap_of(const Solid& a, const Solid& b, const PairCase& c) {
  return [&a, &b, ca = c.a, cb = c.b](const Vec3& d) {
    return d.dot(support_of(a, ca, d)) - d.dot(support_of(b, cb, -d)) - d.dot(cb.x - ca.x);
  };
}

// B's supports along unit n from A, lab, `gap` apart along it: the truth, apart.
void face(const Solid& a, const Solid& b, const Vec3& n, double gap, PairCase* c) {
  c->b.x = support_of(a, c->a, n) - support_of(b, c->b, -n) + gap * n;
  c->overlap = overlap_of(a, b, *c);
  c->truth.gap = gap;
  c->truth.has_normal = true;
  c->truth.normal = n;
}

// The same; overlapping ones are searched.
void face_or_search(Random& random, const Solid& a, const Solid& b, const Vec3& n, double gap, PairCase* c) {
  face(a, b, n, gap, c);
  if (!(gap > 0)) c->truth = search_least(*c, a, b, random);
}

// Supports along a direction, `gap` apart along it; overlapping ones are searched.
PairCase place(Random& random, const Solid& a, const Solid& b, double scale, double least, double most) {
  PairCase c;
  c.a = {a.shape.get(), 1, Vec3::Zero(), random.below(8) ? random.turn() : Quat::Identity()};
  c.b = {b.shape.get(), scale, Vec3::Zero(), random.turn()};
  const Vec3 n = (c.a.q * some_direction(a, random)).normalized();
  if (random.below(3) == 0) {  // one of B's own directions along it
    const Vec3 own = c.b.q * some_direction(b, random);
    if (own.dot(n) < 0.5) c.b.q = (Quat::FromTwoVectors(own, -n) * c.b.q).normalized();
  }
  const double size = std::min(a.shape->bounding_radius, scale * b.shape->bounding_radius);
  const double gap = random.sign() * size * random.log_uniform(least, most);
  face_or_search(random, a, b, n, gap, &c);
  return c;
}

PairCase of_kind(Kind kind, Random& random) {
  const Solid &a = any_of(kind, random), &b = partner(kind, random);
  const double scale = random.below(3) ? random.uniform(0.3, 1.5) : 1.0;
  PairCase c = place(random, a, b, scale, 1e-9, random.below(4) ? 1e-2 : 0.5);
  if (random.below(3) == 0) {
    c.warm = true;
    c.a_before = c.a;
    c.b_before = c.b;
    c.b_before.q = random.below(2) ? random.turn() : (random.turn_by(0.01) * c.b.q).normalized();
  }
  return c;
}

// A ball, cone, lens or polyhedron a million times smaller or larger than its partner.
PairCase far_sizes(Random& random, long) {
  const auto body = [&]() -> const Solid& {
    static const Solid oval = test::ellipsoid_solid(Vec3(1, 0.8, 0.6));
    const int which = random.below(7);
    return which == 6 ? oval : which == 5 ? unit_ball() : any_of(static_cast<Kind>(which), random);
  };
  const Solid &a = body(), &b = body();
  const double ratio = random.log_uniform(1e3, 1e6);
  PairCase c = place(random, a, b, random.below(2) ? ratio : 1 / ratio, 1e-6, 1e-2);
  return c;
}

// Bodies with dents that samples do not show, and where those are.
struct DentedSolid {
  Solid solid;  // its first normal is the hull's over the dent
  double width;
};
const std::vector<DentedSolid>& dented_solids() {
  static const std::vector<DentedSolid> all = [] {
    Random random(1010);
    std::vector<DentedSolid> made;
    for (int k = 0; k < 18; ++k) {
      const double x0 = random.uniform(-0.6, 0.6), slope = random.uniform(-0.3, 0.3),
                   dome = k % 2 ? 0 : random.uniform(0.1, 0.5);
      const test::HiddenDent dent =
          k < 8    ? test::grooved_block(random.log_uniform(0.1, 2), random.log_uniform(1e-3, 0.1), x0, slope,
                                         dome)
          : k < 14 ? test::valley_block(random.log_uniform(1e-9, 1e-4), random.log_uniform(1e-9, 1e-7), x0,
                                        slope, dome)
                   : test::twisted_frustum(random.log_uniform(1e-5, 1e-3));
      made.push_back(
          {test::turned_solid(random, "dented", dent.surfaces, dent.support, {dent.normal}), dent.width});
    }
    return made;
  }();
  return all;
}

// A ball, or apart an ellipsoid, down to a thousandth of the body, over its dent.
PairCase hidden_dent(Random& random, long) {
  static const Solid oval = test::ellipsoid_solid(Vec3(1, 0.8, 0.6));
  const auto& bodies = dented_solids();
  const DentedSolid& dented = bodies[random.below(static_cast<int>(bodies.size()))];
  const Solid &a = dented.solid, &b = random.below(2) ? oval : unit_ball();
  PairCase c;
  c.a = {a.shape.get(), 1, Vec3::Zero(), random.turn()};
  c.b = {b.shape.get(), random.log_uniform(1e-3, 1), Vec3::Zero(), random.turn()};
  const double off = random.below(3) ? dented.width * random.uniform(0, 2) : random.log_uniform(1e-9, 0.3);
  const Vec3 n = (c.a.q * (a.normals[0] + off * random.direction())).normalized();
  const double gap = c.b.scale * random.log_uniform(1e-9, 1e-2) * (&b == &oval ? 1 : random.sign());
  // Of a ball whose centre is outside the hull the gap's sign makes no difference: the nearest point is
  // known.
  face(a, b, n, gap, &c);
  return c;
}

// Bodies that hold a ball of radius 1 which part of their surface lies on, its centre at the file's origin.
const std::vector<Solid>& balls_in_part() {
  static const std::vector<Solid> all = [] {
    Random random(1011);
    const auto round = [](const Vec3& d, double tall, double low) {  // a ball above, more below
      const double across = std::hypot(d[0], d[1]);
      if (d[2] >= 0) return Vec3(d.normalized());
      const Vec2 along = across > 0 ? Vec2(d[0] / across, d[1] / across) : Vec2(1, 0);
      if (low > 0) return Vec3(along[0], along[1], -low);
      const double h = std::hypot(across, tall * d[2]);
      return Vec3(across * along[0] / h, across * along[1] / h, tall * tall * d[2] / h);
    };
    std::vector<Solid> made = {unit_ball()};
    for (int k = 0; k < 2; ++k) {
      made.push_back(test::turned_solid(random, "bullet", test::bullet(1.5),
                                        [=](const Vec3& d) { return round(d, 1, 1.5); }));
      made.push_back(
          test::turned_solid(random, "egg", egg(1, 1.4, 1), [=](const Vec3& d) { return round(d, 1.4, 0); }));
    }
    return made;
  }();
  return all;
}

// Of two such about one centre every direction in which both show the balls is as good.
PairCase one_centre(Random& random, long) {
  const std::vector<Solid>& bodies = balls_in_part();
  const Solid &a = bodies[random.below(5)], &b = bodies[random.below(5)];
  PairCase c;
  c.a = {a.shape.get(), 1, Vec3::Zero(), random.turn()};
  c.b = {b.shape.get(), random.log_uniform(0.2, 5), Vec3::Zero(), random.turn()};
  c.b.x = c.a.q * -a.shape->mass.center - c.b.scale * (c.b.q * -b.shape->mass.center);
  c.overlap = overlap_of(a, b, c);
  c.truth.gap = -(1 + c.b.scale);
  return c;
}

// Images of the solids, 300 to 1000 times as long as thick.
const std::vector<Solid>& needles() {
  static const std::vector<Solid> all = [] {
    Random random(1012);
    std::vector<Solid> made;
    for (int k = 0; k < 3 * kKinds; ++k)
      made.push_back(test::stretched(random, solids_of(static_cast<Kind>(k % kKinds))[k / kKinds],
                                     random.log_uniform(1e-3, 3e-3)));
    return made;
  }();
  return all;
}

// Each against itself, not turned at all, hardly, by half a turn or anyhow, or against another.
PairCase needle_pair(Random& random, long) {
  const auto& bodies = needles();
  const auto any = [&]() -> const Solid& { return bodies[random.below(static_cast<int>(bodies.size()))]; };
  const Solid& a = any();
  const bool twins = random.below(3) > 0;
  const Solid& b = twins ? a : any();
  const double scale = random.below(2) ? 1 : random.uniform(0.3, 1.5);
  if (!twins) return place(random, a, b, scale, 1e-9, 1);
  PairCase c;
  c.a = {a.shape.get(), 1, Vec3::Zero(), random.turn()};
  c.b = {b.shape.get(), scale, Vec3::Zero(), c.a.q};
  const Vec3 n = (c.a.q * some_direction(a, random)).normalized();
  const int turn = random.below(4);
  if (turn == 1) c.b.q = (random.turn_by(random.log_uniform(1e-12, 1e-2)) * c.b.q).normalized();
  if (turn == 2) c.b.q = (Quat(Eigen::AngleAxisd(M_PI, random.direction())) * c.b.q).normalized();
  if (turn == 3) c.b.q = random.turn();
  const double gap = random.sign() * scale * random.log_uniform(1e-9, 1);
  face_or_search(random, a, b, n, gap, &c);
  return c;
}

// The solids above, control points to 12 to 14 decimals.
struct RoundedSolid {
  Solid solid;
  double off;  // a length
};
const std::vector<RoundedSolid>& rounded_solids() {
  static const std::vector<RoundedSolid> all = [] {
    std::vector<RoundedSolid> made;
    for (int k = 0; k < 2 * kKinds + 6; ++k) {
      const int decimals = 12 + k % 3;
      Solid solid = k < 2 * kKinds ? solids_of(static_cast<Kind>(k / 2))[k % 2] : balls_in_part()[k % 5];
      solid.shape = make_shape(solid.shape->name, test::with_decimals(solid.shape->surfaces, decimals));
      // Masses and so centres are integrated to 1e-12.
      made.push_back({solid, 5 * (1e-12 + std::pow(10.0, -decimals)) * solid.shape->bounding_radius});
    }
    return made;
  }();
  return all;
}

// Anyhow, or deep on one axis, or about one centre.
PairCase few_digits(Random& random, long) {
  const auto& bodies = rounded_solids();
  const auto any = [&]() -> const RoundedSolid& {
    return bodies[random.below(static_cast<int>(bodies.size()))];
  };
  const RoundedSolid &of_a = any(), &of_b = any();
  const Solid &a = of_a.solid, &b = of_b.solid;
  const double scale = random.below(3) ? random.uniform(0.3, 3) : 1.0;
  PairCase c;
  if (random.below(2)) {
    c = place(random, a, b, scale, 1e-9, random.below(4) ? 1e-2 : 0.5);
  } else {
    const auto axis_of = [](const Shape& s) -> Vec3 {
      return s.revolution.found ? s.revolution.axis : s.principal_axes * Vec3::UnitZ();
    };
    c.a = {a.shape.get(), 1, Vec3::Zero(), random.turn()};
    c.b = {b.shape.get(), scale, Vec3::Zero(), Quat::Identity()};
    const Vec3 axis = c.a.q * axis_of(*a.shape);
    c.b.q = Quat::FromTwoVectors(axis_of(*b.shape), random.sign() * axis).normalized();
    if (random.below(2)) c.b.q = (random.turn_by(random.log_uniform(1e-12, 0.1)) * c.b.q).normalized();
    const int steps = random.below(3);
    c.b.x = steps * random.uniform(-1, 1) * axis;
    if (random.below(2)) c.b.x += random.log_uniform(1e-12, 0.1) * random.direction();
    c.overlap = overlap_of(a, b, c);
    c.truth = search_least(c, a, b, random);
  }
  c.rounded = of_a.off + scale * of_b.off;
  return c;
}

// What two balls have in common whose centres are hardly apart, and images of it: joints with kinks that
// count as none.
const std::vector<Solid>& kinked_slightly() {
  static const std::vector<Solid> all = [] {
    Random random(1013);
    std::vector<Solid> made;
    for (int k = 0; k < 12; ++k) {
      Solid solid = test::slight_lens(random, random.log_uniform(1e-11, 1e-7));
      if (k % 3 == 2) solid = test::stretched(random, solid, random.uniform(0.3, 0.9));
      made.push_back(solid);
    }
    return made;
  }();
  return all;
}

PairCase slight_kinks(Random& random, long) {
  const auto& bodies = kinked_slightly();
  const auto any = [&]() -> const Solid& { return bodies[random.below(static_cast<int>(bodies.size()))]; };
  const Solid &a = any(), &b = random.below(2) ? any() : partner(Kind::lens, random);
  return place(random, a, b, random.below(3) ? random.uniform(0.3, 3) : 1.0, 1e-9,
               random.below(4) ? 1e-2 : 0.5);
}

// Spheres as files of 7 to 11 decimals have them.
const std::vector<std::shared_ptr<const Shape>>& nearly_balls() {
  static const std::vector<std::shared_ptr<const Shape>> all = [] {
    Random random(1014);
    std::vector<std::shared_ptr<const Shape>> made;
    for (int k = 0; k < 15; ++k) {
      auto surfaces = k % 2 ? exact_ellipsoid(Vec3(1, 1, 1)) : revolved_ellipsoid(1, 1);
      transform(surfaces, random.uniform(0.7, 1.4) * random.turn().toRotationMatrix(), random.vector());
      made.push_back(make_shape("sphere", test::with_decimals(surfaces, 7 + k / 3)));
    }
    return made;
  }();
  return all;
}

// About one centre, to a tenth of their size; supports are the library's.
PairCase nearly_ball_pair(Random& random, long) {
  const auto& bodies = nearly_balls();
  const auto any = [&] { return bodies[random.below(static_cast<int>(bodies.size()))].get(); };
  PairCase c;
  c.a = {any(), 1, random.vector(), random.turn()};
  c.b = {random.below(3) ? any() : unit_ball().shape.get(), random.below(2) ? 1 : random.log_uniform(0.2, 5),
         Vec3::Zero(), random.turn()};
  c.b.x = c.a.x;
  if (random.below(4))
    c.b.x += std::min(1.0, c.b.scale) * random.log_uniform(1e-13, 0.1) * random.direction();
  c.truth.known = Known::bound;
  c.truth.gap = -test::least_overlap([&](const Vec3& d) { return test::overlap_along(c.a, c.b, d); },
                                     test::spiral(500), {}, random);
  return c;
}

}  // namespace

const std::vector<Solid>& solids_of(Kind kind) {
  static std::map<Kind, std::vector<Solid>> made;
  std::vector<Solid>& solids = made[kind];
  if (!solids.empty()) return solids;
  Random random(1000 + static_cast<int>(kind));
  for (int k = 0; k < kBodies; ++k) solids.push_back(make_solid(kind, random, k));
  return solids;
}

const Solid& any_solid(Random& random) {
  return any_of(static_cast<Kind>(random.below(kKinds)), random);
}

const std::vector<Family>& solid_families() {
  constexpr long kPairs = 20000;
  static const std::vector<Family> all = {
      {"cones", "cones and double cones on each other, balls and others", kPairs,
       [](Random& r, long) { return of_kind(Kind::cone, r); }},
      {"cylinders", "cylinders and frusta, flat caps of collapsed edges", kPairs,
       [](Random& r, long) { return of_kind(Kind::cylinder, r); }},
      {"capsules", "capsules: straight sides, smooth poles", kPairs,
       [](Random& r, long) { return of_kind(Kind::capsule, r); }},
      {"lenses", "two caps and a sharp rim, thickness 1 to 1/60 of it", kPairs,
       [](Random& r, long) { return of_kind(Kind::lens, r); }},
      {"triangles", "polyhedra of bilinear patches with an edge collapsed", kPairs,
       [](Random& r, long) { return of_kind(Kind::polyhedron, r); }},
      {"size ratio 1e6", "the same, sizes 1e3 to 1e6 : 1", kPairs, far_sizes},
      {"hidden dents", "grooves, valleys and twisted walls that samples do not show, under balls to 1 : 1000",
       kPairs, hidden_dent},
      {"one centre", "balls, bullets and eggs whose balls are about one centre", kPairs, one_centre},
      {"needles", "images of cones, cylinders, capsules, lenses and polyhedra, 1 : 300 to 1 : 1000, twins",
       kPairs, needle_pair},
      {"few digits", "all these, control points to 12 to 14 decimals, on one axis and anyhow", kPairs,
       few_digits},
      {"slight kinks", "two balls' common parts and images of them, kinks of 1e-11 to 1e-7 rad, and lenses",
       kPairs, slight_kinks},
      {"nearly balls", "spheres of 7 to 11 decimals about one centre, to 0.1 of it, and balls", 10000,
       nearly_ball_pair},
  };
  return all;
}

}  // namespace nurbs::families

// Bodies and placements of the benchmarks; see bodies.h.
#include "bench/bodies.h"

#include <algorithm>

#include "body/support.h"
#include "contact/pair_search.h"
#include "shapes/primitives.h"

namespace nurbs::bench {
namespace {

ContactResult exact_contact(const Pair& pair) {
  ContactSettings settings;
  settings.tolerance = 1e-14;
  double memory[kPairMemorySize] = {};
  return find_contact(pair.a, pair.b, settings, memory);
}

double size_of(const Pair& pair) {
  return std::min(pair.a.scale * pair.a.shape->bounding_radius, pair.b.scale * pair.b.shape->bounding_radius);
}

// Moves B along the normal until the gap is `gap`: the minimising direction stays what it is.
void set_gap(Pair& pair, double gap) {
  const ContactResult now = exact_contact(pair);
  pair.b.x += (gap - now.gap) * now.normal;
}

}  // namespace

const std::vector<Body>& smooth_bodies() {
  static const std::vector<Body> bodies = [] {
    const Vec3 ellipsoid(1, 0.8, 0.6), disc(1, 1, 0.1);
    return std::vector<Body>{
        {"ellipsoid", "exact ellipsoid 1 : 0.8 : 0.6", make_shape("ellipsoid", exact_ellipsoid(ellipsoid)),
         ellipsoid},
        {"pebble", "pebble, bicubic", make_shape("pebble", pebble()), Vec3::Zero()},
        {"blocky", "superellipsoid, exponent 4, bicubic",
         make_shape("blocky", fitted_superellipsoid(Vec3(1, 0.9, 0.8), 4, 3)), Vec3::Zero()},
        {"disc", "exact ellipsoid 1 : 1 : 0.1", make_shape("disc", exact_ellipsoid(disc)), disc}};
  }();
  return bodies;
}

Vec3 Random::direction() {
  std::normal_distribution<double> normal;
  Vec3 d;
  for (int k = 0; k < 3; ++k) d[k] = normal(engine_);
  return d.normalized();
}

Quat Random::turn() {
  std::normal_distribution<double> normal;
  double q[4];
  for (double& x : q) x = normal(engine_);
  return Quat(q[0], q[1], q[2], q[3]).normalized();
}

Pair random_pair(Random& random, const Shape& shape, double gap) {
  Pair pair;
  pair.a.shape = pair.b.shape = &shape;
  pair.a.q = random.turn();
  pair.b.q = random.turn();
  pair.b.scale = random.uniform(0.8, 1.25);
  const Vec3 d = random.direction();
  const Vec3 on_a = pair.a.q * find_hull_support(shape, pair.a.q.conjugate() * d).point;
  const Vec3 on_b = pair.b.q * find_hull_support(shape, pair.b.q.conjugate() * -d).point;
  pair.b.x = on_a - pair.b.scale * on_b;
  set_gap(pair, gap * size_of(pair));
  return pair;
}

std::vector<Pair> tumble(Random& random, const Pair& start, double angle, int steps) {
  const double gap = exact_contact(start).gap;
  const Quat turn_a(Eigen::AngleAxisd(angle, random.direction())),
      turn_b(Eigen::AngleAxisd(angle, random.direction()));
  std::vector<Pair> path{start};
  for (int k = 1; k < steps; ++k) {
    Pair next = path.back();
    next.a.q = (turn_a * next.a.q).normalized();
    next.b.q = (turn_b * next.b.q).normalized();
    set_gap(next, gap);
    path.push_back(next);
  }
  return path;
}

}  // namespace nurbs::bench

// See pairs.h.
#include "support/pairs.h"

#include <algorithm>

#include "body/support.h"
#include "contact/pair_search.h"

namespace nurbs::test {
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

Pair random_pair(Random& random, const Shape& sa, const Shape& sb, double gap, Vec3* direction) {
  Pair pair;
  pair.a.shape = &sa;
  pair.b.shape = &sb;
  pair.a.q = random.turn();
  pair.b.q = random.turn();
  pair.b.scale = random.uniform(0.5, 1.5);
  const Vec3 d = random.direction();
  const Vec3 on_a = pair.a.q * find_support(sa, pair.a.q.conjugate() * d).point;
  const Vec3 on_b = pair.b.q * find_support(sb, pair.b.q.conjugate() * -d).point;
  pair.b.x = on_a - pair.b.scale * on_b + gap * d;
  if (direction) *direction = d;
  return pair;
}

Pair random_pair_at(Random& random, const Shape& shape, double gap) {
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

double overlap_along(const Particle& a, const Particle& b, const Vec3& d) {
  return a.scale * find_hull_support(*a.shape, a.q.conjugate() * d).h +
         b.scale * find_hull_support(*b.shape, b.q.conjugate() * -d).h - d.dot(b.x - a.x);
}

}  // namespace nurbs::test

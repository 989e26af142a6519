// One pair at a time; the stages of a scene take contacts that go on side by side.
#include "contact/ellipsoid_search.h"

#include <algorithm>
#include <cmath>

#include "contact/overlap/ellipsoid_overlap.h"

namespace nurbs {
namespace {

using V = Triple<double>;
using Placed = PlacedEllipsoidOf<double>;

constexpr double kLeastBend = 0.1;  // of the Hessian's size, where it is made definite

double norm(const V& v) {
  return root(dot(v, v));
}

// A body's share of what the pair remembers; returns it placed.
Placed put(const Particle& p, double (&root)[6], double& least2) {
  const Ellipsoid& e = p.shape->ellipsoid;
  const Mat3& r = e.root;
  const double values[6] = {r(0, 0), r(1, 1), r(2, 2), r(0, 1), r(0, 2), r(1, 2)};
  for (int k = 0; k < 6; ++k) root[k] = p.scale * values[k];
  const double least = p.scale * e.least();
  least2 = least * least;
  return place_ellipsoid(root, least2, turn(p.q.toRotationMatrix()));
}

SweptEllipsoid swept_ellipsoid(const Particle& p) {
  return SweptEllipsoid::of(p.shape->ellipsoid, p.scale, p.q.toRotationMatrix());
}

// A pair of bodies and how well it is to be solved.
struct Problem {
  Placed a, b;
  V offset;
  double tolerance, size, noise;
  double reach;  // proven further apart is enough
};

struct Solution {
  V d{};
  EllipsoidContactOf<double> contact;
  int iterations = 0;
};

// A descent direction of Newton's length, where the Hessian may be indefinite: its eigenvalues are lifted.
V downhill(const EllipsoidStepOf<double>& s) {
  const double mean = 0.5 * (s.bend_tt + s.bend_ss),
               half = std::hypot(0.5 * (s.bend_tt - s.bend_ss), s.bend_ts);
  const double least = kLeastBend * (std::abs(mean) + half), lift = std::max(0.0, least - (mean - half));
  const double tt = s.bend_tt + lift, ss = s.bend_ss + lift, det = tt * ss - s.bend_ts * s.bend_ts;
  if (!(det > 0)) return {};
  return ((s.bend_ts * s.slope_s - ss * s.slope_t) / det) * s.t +
         ((s.bend_ts * s.slope_t - tt * s.slope_s) / det) * s.s;
}

// Newton with halved steps from d; false where no minimum is certified.
bool descend(const Problem& q, V d, Solution* out) {
  V base = d, by{};
  double best = kFarAway;
  for (out->iterations = 1; out->iterations <= kEllipsoidColdSteps; ++out->iterations) {
    const EllipsoidStepOf<double> s = newton_step(q.a, q.b, q.offset, 1.0, d);
    if (!(s.p <= best + q.noise)) {
      by = 0.5 * by;
      d = turned(base, by);
      continue;
    }
    best = std::min(best, s.p);
    base = d;
    if (-s.p - q.noise > q.reach) {
      out->contact = look_along(q.a, q.b, q.offset, 1.0, d);
      out->d = d;
      if (out->contact.beyond <= 0.5 * (out->contact.gap - q.noise - q.reach)) return true;
    }
    by = s.minimum ? s.x * s.t + s.y * s.s : downhill(s);
    const double turn = norm(by);
    if (!(turn < kFarAway)) return false;
    if (turn > kEllipsoidTurn) by = (kEllipsoidTurn / turn) * by;
    d = turned(base, by);
    if (!s.minimum || turn > kEllipsoidNear) continue;
    out->contact = look_along(q.a, q.b, q.offset, 1.0, d);
    out->d = d;
    const double tilt2 = out->contact.across2 * s.soft * s.soft;
    if (good_enough(out->contact, tilt2, q.tolerance, q.size, q.noise)) return true;
    if (turn < kEllipsoidStalled && !(out->contact.beyond < kFarAway)) return false;
  }
  return false;
}

// Of overlaps beyond the balls of the certificate.
bool descend_deep(const Problem& q, const Particle& a, const Particle& b, double allowed, Solution* out) {
  const Vec3 start = dot(out->d, out->d) > 0 ? vec(out->d) : Vec3(Vec3::UnitX());
  LeastOverlap least;
  if (!find_least_overlap(swept_ellipsoid(a), swept_ellipsoid(b), vec(q.offset), start, 0.5 * allowed,
                          &least))
    return false;
  out->d = triple(least.direction);
  out->contact = look_along(q.a, q.b, q.offset, 1.0, out->d);
  out->contact.beyond = least.overlap - least.level;
  out->iterations += least.tests;
  return true;
}

// Directions to start from: where the contact would be, had it moved on as it last did; the line of centres.
// Not the last proof's: when that was made depends on when the host built its lists.
bool solve(const Problem& q, const PairMemory& memory, Solution* out) {
  if (memory.model.unique == kEllipsoidPair) {
    EllipsoidPair last;
    std::memcpy(&last, &memory.model, sizeof last);
    if (descend(q, turned(last.direction, last.change), out)) return true;
  }
  const double apart = norm(q.offset);
  return apart > kNoDirection * q.size && descend(q, (1 / apart) * q.offset, out);
}

// The proof, and of a pair that is not apart where to go on.
void remember(const Solution& s, const ContactResult& r, EllipsoidPair pair, const Vec3& offset,
              const Quat& q_a, const Quat& q_b, PairMemory* memory) {
  const bool apart = r.status == Status::separated;
  set_proof(r.normal, r.lower, offset, q_a, q_b, &memory->proof);
  memory->proof.contact = !apart;
  memory->on_a.patch = memory->on_b.patch = -1;
  if (apart) return drop_model(&memory->model);
  EllipsoidPair last;
  std::memcpy(&last, &memory->model, sizeof last);
  pair.direction = s.d;
  pair.change = memory->model.unique == kEllipsoidPair ? s.d - last.direction : V{};
  std::memcpy(static_cast<void*>(&memory->model), &pair, sizeof pair);
  memory->model.unique = kEllipsoidPair;
}

// The bracket; false if it is wider than allowed.
bool set_result(const Solution& s, double slack, double allowed, double reach, ContactResult* r) {
  r->rung = Rung::local_model;
  r->iterations = s.iterations;
  r->normal = vec(s.d);
  r->gap = s.contact.gap;
  r->lower = r->gap - slack;
  r->upper = r->gap + s.contact.beyond + slack;
  r->point_a = vec(s.contact.point_a);
  r->point_b = vec(s.contact.point_b);
  r->status = r->lower > reach ? Status::separated : Status::converged;
  if (r->status == Status::separated) r->gap = r->lower;
  return r->status == Status::separated || r->upper - r->lower <= allowed;
}

}  // namespace

bool solve_ellipsoids(const Particle& a, const Particle& b, const ContactSettings& settings,
                      PairMemory& memory, ContactResult* r) {
  const Ellipsoid &ea = a.shape->ellipsoid, &eb = b.shape->ellipsoid;
  if (!ea.found || !eb.found) return give_up(kEllipsoidPair, &memory);
  const double ra = a.scale * a.shape->bounding_radius, rb = b.scale * b.shape->bounding_radius;
  const double size = std::min(ra, rb);
  const double allowed = std::max(settings.tolerance * size, kLeastTolerance * std::max(ra, rb));
  EllipsoidPair pair{};
  pair.error = ea.error + eb.error;
  if (pair.error * (ra + rb) > kEllipsoidError * allowed) return give_up(kEllipsoidPair, &memory);
  Problem q;
  q.a = put(a, pair.root_a, pair.least2_a);
  q.b = put(b, pair.root_b, pair.least2_b);
  const Vec3 offset = b.x - a.x;
  q.offset = triple(offset);
  q.tolerance = settings.tolerance;
  q.size = size;
  q.noise = gap_roundoff(ra, rb, q.offset);
  q.reach = settings.reach;
  Solution s;
  ContactResult found;
  if (!(solve(q, memory, &s) || descend_deep(q, a, b, allowed, &s)) ||
      !set_result(s, pair.error * (ra + rb) + q.noise, allowed, settings.reach, &found))
    return give_up(kEllipsoidPair, &memory);
  *r = found;
  remember(s, found, pair, offset, a.q, b.q, &memory);
  return true;
}

bool solve_ellipsoid_on_plane(const Particle& particle, double height, const Vec3& normal,
                              const ContactSettings& settings, PairMemory& memory, ContactResult* r) {
  const Ellipsoid& e = particle.shape->ellipsoid;
  if (!e.found) return give_up(kEllipsoidPair, &memory);
  const double radius = particle.scale * particle.shape->bounding_radius;
  EllipsoidPair pair{};
  pair.error = e.error;
  const double noise = kRoundoff * (std::abs(height) + radius), slack = pair.error * radius + noise;
  if (!(2 * slack <= settings.tolerance * radius)) return give_up(kEllipsoidPair, &memory);
  const Placed plane{}, body = put(particle, pair.root_b, pair.least2_b);
  Solution s;
  s.d = triple(normal);
  s.contact = look_along(plane, body, height * s.d, 0.0, s.d);
  set_result(s, slack, kFarAway, settings.reach, r);
  const Vec3 apart = height * normal;  // points are relative to the particle
  r->point_a -= apart;
  r->point_b -= apart;
  remember(s, *r, pair, apart, Quat::Identity(), particle.q, &memory);
  return true;
}

}  // namespace nurbs

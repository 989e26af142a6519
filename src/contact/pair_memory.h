// What a pair that touches, or is close to it, remembers between steps, as plain doubles: the proof that
// every neighbour keeps, the points of the last solve, and the local model made from it.
#pragma once

#include <cmath>
#include <cstring>
#include <limits>

#include "contact/local_model.h"
#include "contact/pair_search.h"
#include "contact/proof.h"

namespace nurbs {

// A surface point.
struct PointMemory {
  double patch, u, v;  // patch < 0: none
  float step[2];       // how far it went from the solve before, in (u, v); 0 across patches
  float change[2];     // how much further than from the one before that; 0 where not a small share
};

// Empty when proof.stamp is 0; then nothing else means anything. proof.contact: whether the last solve could
// not prove the pair further apart than `reach`.
struct PairMemory {
  PairProof proof;
  PointMemory on_a, on_b;  // of the last solve, the warm start
  LocalModel model;        // of the last solve
};
static_assert(sizeof(PairMemory) == kPairMemorySize * sizeof(double),
              "callers allot kPairMemorySize doubles");

// A caller's doubles seen as a pair's memory, in place: copying them would cost more than the cheapest rung.
inline PairMemory& memory_at(double* doubles) {
  return *reinterpret_cast<PairMemory*>(doubles);
}

inline void drop_model(LocalModel* model) {
  model->unique = -std::numeric_limits<double>::infinity();
}

// Whether something else stands in a model's place, which its `unique` then says: kDeepProof (deep_search.h),
// kEllipsoidPair (ellipsoid_search.h), kCorePair (core_search.h), kBridge (bridge_search.h).
inline bool is_mark(double unique) {
  return unique < 0 && std::isfinite(unique);
}

// Forgets what a closed form left in a model's place under that mark, which the other rungs know nothing of;
// false.
inline bool give_up(double mark, PairMemory* m) {
  if (m->model.unique == mark) drop_model(&m->model);
  return false;
}

// What is remembered of other bodies, other sizes or by another solver is worth nothing: dropped whole.
inline void adopt(std::uint64_t stamp, PairMemory* m) {
  if (m->proof.stamp == stamp) return;
  *m = PairMemory{};
  m->proof.stamp = stamp;
  m->on_a.patch = m->on_b.patch = -1;
  drop_proof(&m->proof);
  drop_model(&m->model);
}

inline SurfacePoint surface_point(const PointMemory& m) {
  return {static_cast<int>(m.patch), m.u, m.v};
}
inline PointMemory point_memory(const SurfacePoint& at) {
  return {static_cast<double>(at.patch), at.u, at.v, {0, 0}, {0, 0}};
}

// Where a surface point would be had it moved on as it last did, its step changing as it last did; if that
// leaves the patch, where it was.
inline SurfacePoint warm_point(const PointMemory& m, const Shape& shape) {
  const SurfacePoint last = surface_point(m),
                     next{last.patch, m.u + (m.step[0] + m.change[0]), m.v + (m.step[1] + m.change[1])};
  if (!has_patch(shape, last)) return {};
  return next.on_patch() ? next : last;
}
inline void remember_point(const SurfacePoint& now, PointMemory* m) {
  const PointMemory last = *m;
  *m = point_memory(now);
  if (last.patch != m->patch) return;
  const float du = m->u - last.u, dv = m->v - last.v, ddu = du - last.step[0], ddv = dv - last.step[1];
  m->step[0] = du;
  m->step[1] = dv;
  constexpr float kSmall = 0.25;  // more is no change of a steady motion
  if (!(ddu * ddu + ddv * ddv <= kSmall * kSmall * (du * du + dv * dv))) return;
  m->change[0] = ddu;
  m->change[1] = ddv;
}

inline CoarsePoint coarse(const PointMemory& m) {
  constexpr double kSteps = 65535;
  if (!(m.patch >= 0 && m.patch < kSteps && surface_point(m).on_patch())) return {65535, 0, 0};
  const auto step = [](double x) { return static_cast<std::uint16_t>(std::floor(x * kSteps + 0.5)); };
  return {static_cast<std::uint16_t>(m.patch), step(m.u), step(m.v)};
}
inline PointMemory fine(const CoarsePoint& c) {
  constexpr double kSteps = 65535;
  return {c.patch == 65535 ? -1.0 : c.patch, c.u / kSteps, c.v / kSteps, {0, 0}, {0, 0}};
}

// Whether the local model's answer is good enough for the force, on its patches, and shallow enough to be the
// only contact: the overlap's error below half the tolerance times the overlap, the normal's below it.
template <class Real>
NURBS_INLINE Mask<Real> serves(const LocalContactOf<Real>& c, const Real& unique, double tolerance,
                               const Real& size) {
  const Real allowed = tolerance * size;
  return c.valid & (-c.gap <= unique) &
         (c.error <= 0.5 * tolerance * larger(magnitude(c.gap), kForceDepth * size)) &
         (c.tilt2 <= tolerance * tolerance) & (c.drift <= kLocalDrift * allowed);
}

// The rate at a point of a body, lengths of the lab.
inline LocalRate local_rate(const Shape& shape, double scale, const SurfacePoint& at) {
  const LocalRate r = rate_near(shape.rates[at.patch], at);
  return {scale * r.rate, scale * r.room, scale * r.least};
}

// Whether a model made now is worth its 50 ns: bodies that turn as they did since the last solve, at the
// worst once more than the last model served, would be served at least once. `gap`: of the contact, a length.
inline bool may_serve(double rate_a, double rate_b, double turned2_a, double turned2_b, double gap,
                      double tolerance, double size) {
  const double a2 = 0.25 * turned2_a, b2 = 0.25 * turned2_b;
  return kRemainderShare * 0.5 * (rate_a * a2 + rate_b * b2) <= tolerance * size &&
         cubic_remainder(rate_a, a2) + cubic_remainder(rate_b, b2) <=
             0.5 * tolerance * std::fmax(std::abs(gap), kForceDepth * size);
}

// One body of a solved contact: its jet there in axes that `axes` turns into its own, lengths of the lab, its
// centre of mass in those axes, and the square of what it has turned since the last solve, rad^2.
struct ModelSide {
  const Shape& shape;
  double scale;
  const SurfacePoint& at;
  const JetLanes& jet;
  Mat3 axes;
  Vec3 center;
  double turned2;
};

// Whether the models of two bodies that turn as they did would serve once more: by the error that they would
// report then. `turn_b` turns B's axes into A's.
inline bool serves_next(const ModelSide& a, const ModelSide& b, const Mat3& turn_b, const LocalModel& m,
                        double gap, double tolerance, double size) {
  const Vec3 ta = vec(m.a.tangent), sa = vec(m.a.normal).cross(ta), tb = turn_b * vec(m.b.tangent),
             sb = (turn_b * vec(m.b.normal)).cross(tb);
  const double tt = tb.dot(ta), ts = tb.dot(sa), st = sb.dot(ta), ss = sb.dot(sa);
  // W_A + W_B along t_A and s_A; beside them the overlap is small.
  const double m11 = m.a.w0 + tt * (m.b.w0 * tt + m.b.w1 * st) + st * (m.b.w1 * tt + m.b.w2 * st),
               m12 = m.a.w1 + tt * (m.b.w0 * ts + m.b.w1 * ss) + st * (m.b.w1 * ts + m.b.w2 * ss),
               m22 = m.a.w2 + ts * (m.b.w0 * ts + m.b.w1 * ss) + ss * (m.b.w1 * ts + m.b.w2 * ss);
  const double soft = (m11 + m22) / (m11 * m22 - m12 * m12), a2 = 0.25 * a.turned2, b2 = 0.25 * b.turned2,
               left = 0.5 * (m.a.rate * a2 + m.b.rate * b2),
               error = cubic_remainder(m.a.rate, a2) + cubic_remainder(m.b.rate, b2) +
                       2 * kRemainderSafety * left * left * soft;
  const double changes = m.a.rate * std::sqrt(a2) + m.b.rate * std::sqrt(b2) +
                         (m.a.rate + m.b.rate) * 2 * soft * left;  // of W, to the minimum
  return soft > 0 && changes * soft <= 0.5 &&
         error <= 0.5 * tolerance * std::fmax(std::abs(gap), kForceDepth * size) &&
         kRemainderShare * left * soft <= tolerance;
}

// The local model of a contact at a gap that is its pair's only one below an overlap of `unique`, and whose
// normal may turn by turn() rad before another support point takes over; none where it would not serve or
// there can't be one. turn_b() turns B's axes into A's. 100 ns, and what turn() takes.
template <class TurnB, class Turn>
void make_local_model(const ModelSide& a, const ModelSide& b, const TurnB& turn_b, double gap,
                      double tolerance, double size, double unique, const Turn& turn, LocalModel* model) {
  const LocalRate rate_a = local_rate(a.shape, a.scale, a.at), rate_b = local_rate(b.shape, b.scale, b.at);
  if (!may_serve(rate_a.rate, rate_b.rate, a.turned2, b.turned2, gap, tolerance, size)) return;
  if (!make_support_model(a.axes, a.center, a.jet, rate_a, &model->a)) return;
  if (!make_support_model(b.axes, b.center, b.jet, rate_b, &model->b)) return;
  if (!serves_next(a, b, turn_b(), *model, gap, tolerance, size)) return;
  const double most = turn();
  if (!(most > 0)) return;
  limit_turn(a.shape, most, &model->a);
  limit_turn(b.shape, most, &model->b);
  model->unique = unique;
}

// The same of one body against a wall; false where it would not serve or there can't be one. `jet`: its jet
// there in its own axes, shape lengths on entry and the lab's on return.
inline bool make_wall_model(const Particle& particle, const SurfacePoint& at, double turned2, double gap,
                            double tolerance, double size, JetLanes& jet, SupportModel* model) {
  const LocalRate local = local_rate(*particle.shape, particle.scale, at);
  if (!may_serve(0, local.rate, 0, turned2, gap, tolerance, size)) return false;
  scale(particle.scale, &jet);
  if (!make_support_model(Mat3::Identity(), Vec3::Zero(), jet, local, model)) return false;
  limit_turn(*particle.shape, kNormalMargin, model);
  return true;
}

inline void set_local(const LocalContact& c, const Vec3& offset, double reach, ContactResult* r) {
  const double error = c.error + kRoundoff * offset.lpNorm<1>();
  r->rung = Rung::local_model;
  r->gap = c.gap;
  r->lower = c.gap - error;
  r->upper = c.gap + error;
  r->normal = vec(c.normal);
  r->point_a = vec(c.point_a);
  r->point_b = vec(c.point_b);
  r->status = r->lower > reach ? Status::separated : Status::converged;
}

// Names the body for proofs: its shape's contents and its size.
inline std::uint64_t stamp(const Particle& p) {
  return body_stamp(p.shape->stamp, p.scale);
}

// Names a plane by its normal: it is moved as bodies are, but not turned.
inline std::uint64_t stamp(const Vec3& normal) {
  return body_stamp(body_stamp(body_stamp(0, normal[0]), normal[1]), normal[2]);
}

// The rungs that evaluate surfaces (pair_search.h), for memory that the caller keeps: bounds, Newton from the
// last points, cold start, polytope. find_contact without its first and third rung.
ContactResult solve_contact(const Particle& a, const Particle& b, const ContactSettings& settings,
                            PairMemory& memory);
ContactResult solve_plane_contact(const Particle& particle, double height, const Vec3& normal,
                                  const ContactSettings& settings, PairMemory& memory);

// Up to round-off. A quaternion that is none, or no number, isn't.
inline bool is_unit(const Quat& q) {
  return std::abs(q.squaredNorm() - 1) <= kUnitTurn;
}
// Drifted quaternions would scale the bodies.
inline Particle with_unit_turn(const Particle& p) {
  Particle unit = p;
  unit.q.normalize();
  return unit;
}

inline bool finite(const Particle& p) {
  return std::isfinite(p.x.sum() + p.q.coeffs().sum() + p.scale) && p.scale > 0;
}

// Makes a default result one of a pair proven apart.
inline void set_apart(double lower, Rung rung, ContactResult* r) {
  r->status = Status::separated;
  r->rung = rung;
  r->gap = r->lower = lower;
  r->upper = std::numeric_limits<double>::infinity();
}

}  // namespace nurbs

// A particle against a plane: the direction is known (paper, Remark 1), so one support mapping is all a solve
// takes. The rungs are those of a pair, with a plane that does not turn.
#include <algorithm>
#include <cmath>

#include "contact/pair_memory.h"
#include "contact/pair_search.h"
#include "geometry/tolerances.h"

namespace nurbs {
namespace {

// A plane asks one support only; its local model needs no uniqueness, but no dents either.
void remember_plane_model(const Particle& particle, const Mat3& axes, const Vec3& d, const Support& support,
                          PairMemory& m) {
  const Shape& shape = *particle.shape;
  if (shape.support_excess > kRoundoff * shape.bounding_radius && !(shape.normal_map.radius_at(d) < kFarAway))
    return;
  JetLanes jet;
  evaluate2(shape.patches[support.where.patch], support.where.u, support.where.v, &jet);
  scale(particle.scale, &jet);
  const double rate = particle.scale * shape.curvature_rate[support.where.patch];
  if (!make_support_model(axes, Vec3::Zero(), support.where, jet, rate, &m.model.b)) return;
  if (shape.normal_map.cells > 0)  // as for a pair: no turn that may reach another support point
    m.model.b.room =
        std::min(m.model.b.room, kNormalMargin * particle.scale * shape.patch_curvature.min_radius);
  m.known = 3;
}

}  // namespace

ContactResult find_plane_contact(const Particle& particle, const Vec3& origin, const Vec3& normal,
                                 const ContactSettings& settings, double* memory) {
  PairMemory& m = memory_at(memory);
  const double radius = particle.scale * particle.shape->bounding_radius;
  const double height = normal.dot(particle.x - origin);
  double safe = height - radius;
  // The budget of the last solve, as for a pair (Ladder::safe_gap) with a plane that does not turn.
  if (m.known > 0)
    safe = std::max(safe, m.lower + (height - m.offset[0]) - radius * turned(particle.q, m.q_a));
  ContactResult r;
  if (safe > settings.reach) {
    set_apart(safe, Rung::safe, &r);
    return r;
  }
  if (!finite(particle)) return r;
  const double tolerance = settings.tolerance * radius;
  r.normal = normal;
  if (m.known >= 3) {
    const LocalSupport s = evaluate_local_support(m.model.b, turn_since(particle.q, m.q_a), -normal);
    if (s.valid && s.error <= 0.5 * tolerance && s.drift <= kLocalDrift * tolerance) {
      r.rung = Rung::local_model;
      r.gap = height - s.h;
      const double error = s.error + kRoundoff * radius;
      r.lower = r.gap - error;
      r.upper = r.gap + error;
      r.point_b = s.point;
      r.point_a = r.point_b - r.gap * normal;
      r.status = r.lower > settings.reach ? Status::separated : Status::converged;
      return r;
    }
  }
  const Mat3 axes = particle.q.toRotationMatrix();
  const Vec3 d = axes.transpose() * -normal;
  if (const double lower = height - particle.scale * particle.shape->atlas.support_upper(d);
      lower > settings.reach) {
    m.known = std::clamp(m.known, 1.0, 2.0);
    m.offset[0] = height;
    store(particle.q, m.q_a);
    m.lower = lower;
    r.normal.setZero();
    set_apart(lower, Rung::bounds, &r);
    return r;
  }
  const SurfacePoint start{static_cast<int>(m.patch_b), m.u_b, m.v_b};
  const bool warm = m.known >= 2;
  const Support support = find_hull_support(*particle.shape, d, warm ? &start : nullptr);
  r.rung = warm ? Rung::warm : Rung::cold;
  r.iterations = support.iterations;
  r.gap = r.upper = height - particle.scale * support.h;
  r.lower = height - particle.scale * support.upper;
  r.point_b = axes * (particle.scale * support.point);
  r.point_a = r.point_b - r.gap * normal;
  r.status = r.lower > settings.reach         ? Status::separated
             : r.upper - r.lower <= tolerance ? Status::converged
                                              : Status::unresolved;
  m.known = 2;
  m.offset[0] = height;
  store(particle.q, m.q_a);
  m.lower = r.lower;
  m.patch_b = support.where.patch;
  m.u_b = support.where.u;
  m.v_b = support.where.v;
  if (warm && r.status == Status::converged) remember_plane_model(particle, axes, d, support, m);
  return r;
}

}  // namespace nurbs

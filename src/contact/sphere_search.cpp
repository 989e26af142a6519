// The line of centres; see sphere_search.h.
#include "contact/sphere_search.h"

#include <cmath>

#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

// Half a local model: the same all over the ball. `outward` in the lab.
SupportModel ball_model(const Particle& p, const Vec3& outward) {
  const double radius = p.scale * roundness(*p.shape).radius;
  const Vec3 n = p.q.conjugate() * outward;
  SupportModel m{};
  m.arm = triple(radius * n);
  m.normal = triple(n);
  m.tangent = triple(n.unitOrthogonal());
  m.w0 = m.w2 = radius;
  m.rate = kSphere * radius;
  m.room = kFarAway;
  return m;
}

bool to_roundoff(const Particle& p) {
  return p.shape->proofs.sphere;
}

void forget_points(PairMemory& memory) {
  memory.on_a.patch = memory.on_b.patch = -1;
}

void rank(double tolerance, double reach, ContactResult* r) {
  r->rung = Rung::local_model;
  r->status = r->lower > reach                   ? Status::separated
              : r->upper - r->lower <= tolerance ? Status::converged
                                                 : Status::unresolved;
}

}  // namespace

bool solve_spheres(const Particle& a, const Particle& b, const ContactSettings& settings, PairMemory& memory,
                   ContactResult* r) {
  const double outer_a = a.scale * a.shape->bounding_radius, outer_b = b.scale * b.shape->bounding_radius;
  const double tolerance = settings.tolerance * std::fmin(outer_a, outer_b);
  if (!is_round(a, 0.25 * tolerance, settings.tolerance) ||
      !is_round(b, 0.25 * tolerance, settings.tolerance))
    return false;
  const Vec3 offset = b.x - a.x;
  const double apart = offset.norm(), noise = kRoundoff * (apart + outer_a + outer_b);
  if (!(apart > kNoDirection * std::fmax(outer_a, outer_b)) || 4 * noise > tolerance) return false;
  const double radius_a = a.scale * roundness(*a.shape).radius,
               radius_b = b.scale * roundness(*b.shape).radius;
  r->normal = offset / apart;
  r->gap = apart - radius_a - radius_b;
  r->lower = apart - outer_a - outer_b - noise;
  r->upper = apart - a.scale * a.shape->inner_radius - b.scale * b.shape->inner_radius + noise;
  r->point_a = radius_a * r->normal;
  r->point_b = offset - radius_b * r->normal;
  rank(tolerance, settings.reach, r);
  if (r->status == Status::separated) r->gap = r->lower;

  set_proof(r->normal, r->lower, offset, a.q, b.q, &memory.proof);
  memory.proof.contact = r->status != Status::separated;
  drop_model(&memory.model);
  forget_points(memory);
  if (r->status != Status::converged || !to_roundoff(a) || !to_roundoff(b)) return true;
  memory.model.a = ball_model(a, r->normal);
  memory.model.b = ball_model(b, -r->normal);
  memory.model.unique = 0.5 * (radius_a + radius_b);  // p has one minimum wherever the centres are apart
  return true;
}

bool solve_sphere_on_plane(const Particle& particle, double height, const Vec3& normal,
                           const ContactSettings& settings, PairMemory& memory, ContactResult* r) {
  const double outer = particle.scale * particle.shape->bounding_radius,
               tolerance = settings.tolerance * outer;
  const double noise = kRoundoff * (std::abs(height) + outer);
  if (!is_round(particle, 0.5 * tolerance, settings.tolerance) || 4 * noise > tolerance) return false;
  const double radius = particle.scale * roundness(*particle.shape).radius;
  r->normal = normal;
  r->gap = height - radius;
  r->lower = height - outer - noise;
  r->upper = height - particle.scale * particle.shape->inner_radius + noise;
  r->point_b = -radius * normal;
  r->point_a = r->point_b - r->gap * normal;
  rank(tolerance, settings.reach, r);

  set_proof(normal, r->lower, height * normal, Quat::Identity(), particle.q, &memory.proof);
  memory.proof.contact = r->status != Status::separated;
  drop_model(&memory.model);
  forget_points(memory);
  if (r->status != Status::converged || !to_roundoff(particle)) return true;
  memory.model.a = plane_model(normal);
  memory.model.b = ball_model(particle, -normal);
  memory.model.unique = kFarAway;
  return true;
}

}  // namespace nurbs

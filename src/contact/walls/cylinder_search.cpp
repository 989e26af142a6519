// See cylinder_search.h.
#include "contact/walls/cylinder_search.h"

#include <algorithm>
#include <cmath>

#include "contact/sphere_search.h"
#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

constexpr double kLevel = 16 * kRoundoff;  // of sizes: values that are one

void find_outside(const Particle& particle, const Vec3& origin, const Vec3& axis, double radius,
                  SurfaceContacts* out) {
  const Vec3 apart = particle.x - origin, across = apart - apart.dot(axis) * axis;
  const double distance = across.norm();
  if (!(distance > 0) || distance > radius + particle.scale * particle.shape->bounding_radius) return;
  // The slope of the gap at the line of centres says to which side d turns; at a right angle it is past.
  const Vec3 d = across / distance, side = axis.cross(d);
  const FeatureGap g = gap_along(particle, origin, d, nullptr);
  if (!(g.gap - radius < 0)) return;
  const double slope = side.dot(apart + g.on_body);
  FeatureContact f;
  if (slope > 0)
    f = find_line_contact(particle, origin, axis, d, side, radius, &g.where);
  else if (slope < 0)
    f = find_line_contact(particle, origin, axis, -side, d, radius, &g.where);
  else
    f = find_line_contact(particle, origin, axis, d, d, radius, &g.where);
  if (!f.touching) return;
  SurfaceContact c = surface_contact(f, 0);
  c.memory = cylinder_memory(particle, f.where);
  out->add(c);
}

// A body that is a ball, by the line of centres.
void touch_ball(const Particle& particle, const CylinderPose& pose, SurfaceContacts* out) {
  const double r = particle.scale * roundness(*particle.shape).radius, distance = pose.apart.norm();
  CylinderContact c;
  c.gap = pose.side * (pose.radius - distance) - r;
  if (!(c.gap < 0)) return;
  c.normal = -pose.side / distance * pose.apart;
  c.on_body = -r * c.normal;
  c.rung = Rung::local_model;
  out->add(surface_contact(c, cylinder_memory(particle, {})));
}

}  // namespace

void find_cylinder_contacts(const Particle& particle, const Vec3& origin, const Vec3& axis, double radius,
                            const ContactSettings& settings, double path, const FormerContact* former,
                            int former_count, TubeSurvey* survey, SurfaceContacts* out) {
  out->count = 0;
  out->full = false;
  out->expiry = -kFarAway;
  const Vec3 apart = particle.x - origin, across = apart - apart.dot(axis) * axis;
  const double distance = across.norm(), size = particle.scale * particle.shape->bounding_radius;
  const double clear = std::max(radius - distance, distance - radius) - size;
  const auto keep_away = [&](double gap) {
    if (gap > 0) out->expiry = path + (1 - 1e-12) * gap;
  };
  if (clear > 0) return keep_away(clear);
  const CylinderPose pose{axis, across, radius, distance < radius ? 1.0 : -1.0,
                          kLevel * (size + apart.norm())};
  if ((pose.side < 0 || !wants_survey(particle, radius)) && distance > pose.noise &&
      is_round(particle, settings.tolerance * size, settings.tolerance)) {
    touch_ball(particle, pose, out);
    return;
  }
  if (pose.side > 0) {
    const double away = find_in_tube(particle, pose, settings, former, former_count, survey, out);
    if (out->count == 0) keep_away(away);
    return;
  }
  CylinderContact next;
  for (int k = 0; k < former_count; ++k) {
    PairMemory memory = *former[k].memory;
    if (!follow_on_cylinder(particle, pose, settings, &memory, &next)) continue;
    if (next.gap < 0) out->add(surface_contact(next, memory));
    return;
  }
  find_outside(particle, origin, axis, radius, out);
}

}  // namespace nurbs

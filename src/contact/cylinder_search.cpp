// See cylinder_search.h.
#include "contact/cylinder_search.h"

#include <algorithm>
#include <cmath>

#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

constexpr int kDirections = 8;    // around the axis, where maxima are looked for first ...
constexpr double kFinest = 2e-3;  // rad, and where there may be some

SurfaceContact surface_contact(const FeatureContact& f) {
  SurfaceContact c;
  c.gap = f.gap;
  c.normal = f.normal;
  c.on_body = f.on_body;
  c.triangle = 0;
  c.rung = Rung::warm;
  c.memory = PairMemory{};
  drop_proof(&c.memory.proof);
  drop_model(&c.memory.model);
  c.memory.on_a.patch = -1;
  c.memory.on_b = {static_cast<double>(f.where.patch), f.where.u, f.where.v, {0, 0}};
  c.memory.proof.stamp = 1;
  return c;
}

// F and its slope along the circle, from one support search.
struct Reach {
  double angle = 0, value = 0, slope = 0;
  Vec3 on_body = Vec3::Zero();
  SurfacePoint where;
};

class Tube {
 public:
  // `ahead`: where angles are counted from, square to the axis; may be zero.
  Tube(const Particle& particle, const Vec3& origin, const Vec3& axis, const Vec3& ahead)
      : particle_(particle),
        u_(ahead.squaredNorm() > 0 ? Vec3(ahead.normalized()) : axis.unitOrthogonal()),
        v_(axis.cross(u_)),
        apart_(particle.x - origin) {}

  Vec3 direction(double angle) const { return std::cos(angle) * u_ + std::sin(angle) * v_; }
  Reach look(double angle) const {
    Reach r;
    r.angle = angle;
    const Vec3 d = direction(angle);
    const FeatureGap g = gap_along(particle_, Vec3::Zero(), -d, nullptr);
    r.on_body = g.on_body;
    r.where = g.where;
    const Vec3 x = apart_ + r.on_body;
    r.value = d.dot(x);
    r.slope = (std::cos(angle) * v_ - std::sin(angle) * u_).dot(x);
    return r;
  }

  // The maximum between a rise and a fall of F. The slope jumps where the body is flat.
  Reach top(Reach low, Reach high) const {
    double weight_low = 1, weight_high = 1;
    int raised = 0;
    for (int k = 0; k < 80 && high.angle - low.angle > 1e-13; ++k) {
      const double l = weight_low * low.slope, h = weight_high * high.slope;
      const double t = k % 4 == 3 ? 0.5 : std::clamp(l / (l - h), 1e-7, 1 - 1e-7);
      const double angle = low.angle + t * (high.angle - low.angle);
      const Reach next = look(angle);
      const double moved = std::min(angle - low.angle, high.angle - angle);
      if (next.slope > 0) {
        weight_high = raised == 1 ? 0.5 * weight_high : 1;
        weight_low = 1;
        raised = 1;
        low = next;
      } else {
        weight_low = raised == -1 ? 0.5 * weight_low : 1;
        weight_high = 1;
        raised = -1;
        high = next;
      }
      if (moved < 1e-11 && std::abs(next.slope) < 1e-14 * particle_.scale * particle_.shape->bounding_radius)
        break;
    }
    Reach best = low.value > high.value ? low : high;
    const double drop = low.slope - high.slope;
    if (low.slope > 0 && high.slope < 0 && drop > 0)
      best.on_body = low.on_body + low.slope / drop * (high.on_body - low.on_body);
    return best;
  }

 private:
  const Particle& particle_;
  const Vec3 u_, v_, apart_;
};

// Directions from low to high angle, closer together where F may exceed the radius.
struct Samples {
  static constexpr int kMost = 512;
  Reach at[kMost];
  int count = 0;
};

void sample(Tube& tube, const Reach& low, const Reach& high, double lever, double radius, Samples* samples) {
  const double width = high.angle - low.angle;
  const bool may = std::max(low.value, high.value) + 0.5 * lever * width > radius;
  if (may && width > kFinest && samples->count < Samples::kMost - 2) {
    const Reach middle = tube.look(0.5 * (low.angle + high.angle));
    sample(tube, low, middle, lever, radius, samples);
    sample(tube, middle, high, lever, radius, samples);
    return;
  }
  samples->at[samples->count++] = high;
}

void add_inside(const Tube& tube, const Reach& top, double radius, SurfaceContacts* out) {
  if (!(top.value > radius)) return;
  FeatureContact f;
  f.touching = true;
  f.gap = radius - top.value;
  f.normal = -tube.direction(top.angle).normalized();
  f.on_body = top.on_body;
  f.where = top.where;
  out->add(surface_contact(f));
}

void find_inside(const Particle& particle, const Vec3& origin, const Vec3& axis, double radius,
                 SurfaceContacts* out) {
  const Vec3 apart = particle.x - origin, across = apart - apart.dot(axis) * axis;
  const double size = particle.scale * particle.shape->bounding_radius, distance = across.norm();
  Tube tube(particle, origin, axis, across);
  // F'' = (curvature radius of the body's outline) - F: where the body is everywhere more curved than the
  // tube, F has one maximum above the radius, if any.
  if (!particle.shape->dented() && distance > 0 &&
      particle.scale * particle.shape->patch_curvature.max_radius < radius) {
    const Reach ahead = tube.look(0);
    Reach other = ahead;
    const double side = ahead.slope > 0 ? 1 : -1;
    for (double turn = 0.05; turn < 1.6 && other.slope * side > 0; turn *= 2) other = tube.look(side * turn);
    if (other.slope * side > 0 || ahead.slope == 0) {
      if (ahead.slope == 0) add_inside(tube, ahead, radius, out);
      return;
    }
    add_inside(tube, side > 0 ? tube.top(ahead, other) : tube.top(other, ahead), radius, out);
    return;
  }
  static thread_local Samples samples;
  samples.count = 0;
  Reach low = tube.look(0);
  samples.at[samples.count++] = low;
  for (int k = 1; k <= kDirections; ++k) {
    const Reach high = tube.look(k * 2 * M_PI / kDirections);
    sample(tube, low, high, distance + size, radius, &samples);
    low = high;
  }
  for (int k = 1; k < samples.count; ++k) {
    const Reach &from = samples.at[k - 1], &to = samples.at[k];
    if (from.slope > 0 && to.slope <= 0) add_inside(tube, tube.top(from, to), radius, out);
  }
}

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
  if (f.touching) out->add(surface_contact(f));
}

}  // namespace

void find_cylinder_contacts(const Particle& particle, const Vec3& origin, const Vec3& axis, double radius,
                            double path, SurfaceContacts* out) {
  out->count = 0;
  out->full = false;
  out->expiry = -kFarAway;
  const Vec3 apart = particle.x - origin, across = apart - apart.dot(axis) * axis;
  const double distance = across.norm(), size = particle.scale * particle.shape->bounding_radius;
  const double clear = std::max(radius - distance, distance - radius) - size;
  if (clear > 0) {
    out->expiry = path + (1 - 1e-12) * clear;
    return;
  }
  if (distance < radius)
    find_inside(particle, origin, axis, radius, out);
  else
    find_outside(particle, origin, axis, radius, out);
}

}  // namespace nurbs

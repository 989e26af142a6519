// See cylinder_search.h.
#include "contact/cylinder_search.h"

#include <algorithm>
#include <cmath>

#include "contact/cylinder_follow.h"
#include "contact/sphere_search.h"
#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

constexpr double kCoarsest = M_PI / 4;     // rad, between directions where maxima are looked for first ...
constexpr double kFinest = 2e-3;           // and where there may be some,
constexpr double kNearest = 0.02;          // or this far apart on the wall, in sizes of the body
constexpr double kLevel = 16 * kRoundoff;  // of sizes: values that are one

// F and its slope along the circle, from one support search.
struct Reach {
  double angle = 0, value = 0, slope = 0;
  Vec3 on_body = Vec3::Zero();
  SurfacePoint where;
};

class Tube {
 public:
  // `ahead`: where angles are counted from; may be zero.
  Tube(const Particle& particle, const Vec3& origin, const Vec3& axis, const Vec3& ahead)
      : particle_(particle),
        u_(ahead.squaredNorm() > 0 ? Vec3((ahead - ahead.dot(axis) * axis).normalized())
                                   : axis.unitOrthogonal()),
        v_(axis.cross(u_)),
        apart_(particle.x - origin) {}

  Vec3 direction(double angle) const { return std::cos(angle) * u_ + std::sin(angle) * v_; }
  // `start`: where the search begins.
  Reach look(double angle, const Reach* start = nullptr) const {
    Reach r;
    r.angle = angle;
    const Vec3 d = direction(angle);
    const FeatureGap g = gap_along(particle_, Vec3::Zero(), -d, start ? &start->where : nullptr);
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
      const Reach next = look(angle, t < 0.5 ? &low : &high);
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
    Reach best = low.slope < -high.slope ? low : high;  // values near a maximum differ by round-off
    const double drop = low.slope - high.slope;
    if (low.slope > 0 && high.slope < 0 && drop > 0)
      best.on_body = low.on_body + low.slope / drop * (high.on_body - low.on_body);
    return best;
  }

 private:
  const Particle& particle_;
  const Vec3 u_, v_, apart_;
};

// Directions in the order of their angles, closer together where F may exceed the radius.
struct Samples {
  static constexpr int kMost = 512;
  Reach at[kMost];
  int count = 0;
  double bound = 0;  // F is nowhere larger
};

// F is at most this between two directions less than pi apart: the support lines' corner, as F is sublinear.
double most_between(const Reach& low, const Reach& high) {
  const double c = std::cos(high.angle - low.angle), s = std::sin(high.angle - low.angle), l = low.value,
               h = high.value, ends = std::max(l, h);
  return h > c * l && l > c * h ? std::max(ends, std::sqrt(l * l + h * h - 2 * l * h * c) / s) : ends;
}

// Where F stays below the radius, half of its distance from it is to be known.
void sample(const Tube& tube, const Reach& low, const Reach& high, double radius, double finest,
            Samples* samples) {
  const double width = high.angle - low.angle, ends = std::max(low.value, high.value),
               most = most_between(low, high) * (1 + 1e-12);
  const bool may = most > std::min(radius, 0.5 * (radius + ends));
  if (may && width > finest && samples->count < Samples::kMost - 32) {
    const Reach middle = tube.look(0.5 * (low.angle + high.angle), low.value > high.value ? &low : &high);
    sample(tube, low, middle, radius, finest, samples);
    sample(tube, middle, high, radius, finest, samples);
    return;
  }
  samples->bound = std::max(samples->bound, most);
  samples->at[samples->count++] = high;
}

void add_found(const Particle& particle, const FeatureContact& f, SurfaceContacts* out) {
  SurfaceContact c = surface_contact(f, 0);
  c.memory = cylinder_memory(particle, f.where);
  out->add(c);
}

void add_inside(const Particle& particle, const Tube& tube, const Reach& top, double radius,
                SurfaceContacts* out) {
  if (!(top.value > radius)) return;
  FeatureContact f;
  f.touching = true;
  f.gap = radius - top.value;
  f.normal = -tube.direction(top.angle).normalized();
  f.on_body = top.on_body;
  f.where = top.where;
  add_found(particle, f, out);
}

// Returns what F is nowhere larger than, or infinity.
double find_inside(const Particle& particle, const Vec3& origin, const Vec3& axis, double radius,
                   SurfaceContacts* out) {
  const Vec3 apart = particle.x - origin;
  const double size = particle.scale * particle.shape->bounding_radius;
  Vec3 across = apart - apart.dot(axis) * axis;
  const double same = kLevel * (size + apart.norm());
  if (across.norm() < same) across.setZero();  // its direction would be round-off's
  const double distance = across.norm();
  const Tube tube(particle, origin, axis, across);
  // F'' = (curvature radius of the body's outline) - F: where the body is everywhere more curved than the
  // tube, F has one maximum above the radius, if any.
  const double flattest = particle.scale * particle.shape->patch_curvature.max_radius;
  if (!particle.shape->dented() && distance > 0 && flattest < radius) {
    const Reach ahead = tube.look(0);
    Reach other = ahead;
    const double side = ahead.slope > 0 ? 1 : -1;
    for (double turn = 0.05; turn < 1.6 && other.slope * side > 0; turn *= 2)
      other = tube.look(side * turn, &other);
    if (other.slope * side > 0) return HUGE_VAL;
    const Reach top = ahead.slope == 0 ? ahead : side > 0 ? tube.top(ahead, other) : tube.top(other, ahead);
    add_inside(particle, tube, top, radius, out);
    return std::max(top.value * (1 + 1e-9), flattest);
  }
  // F < distance cos(angle) + size: elsewhere it stays below `level`.
  const Reach ahead = tube.look(0);
  const double level = std::min(radius, 0.5 * (radius + ahead.value));
  const double reach = level - size > -distance ? std::acos(std::min((level - size) / distance, 1.0)) : M_PI;
  const int parts = static_cast<int>(std::ceil(2 * reach / kCoarsest));
  const double finest = std::max(kFinest, kNearest * size / radius);
  static thread_local Samples samples;
  samples.count = 0;
  samples.bound = level;
  Reach low = tube.look(-reach, &ahead);
  samples.at[samples.count++] = low;
  Reach last = low;  // all around: the same direction, with the same slope
  last.angle = reach;
  for (int k = 1; k <= parts; ++k) {
    const Reach high = k == parts && reach == M_PI ? last : tube.look((2.0 * k / parts - 1) * reach, &low);
    sample(tube, low, high, radius, finest, &samples);
    low = high;
  }
  // A round body along the axis of a narrower tube touches it all around, where slopes are round-off: of
  // maxima that F does not fall between, one stands for all.
  const Reach* highest = &samples.at[0];
  double last_top = HUGE_VAL, least = -HUGE_VAL;  // of F since the last maximum
  for (int k = 1; k < samples.count; ++k) {
    const Reach &from = samples.at[k - 1], &to = samples.at[k];
    if (to.value > highest->value) highest = &to;
    if (from.slope > 0 && to.slope <= 0 && most_between(from, to) > radius) {
      const Reach top = tube.top(from, to);
      if (least < std::min(last_top, top.value) - same) add_inside(particle, tube, top, radius, out);
      last_top = least = top.value;
    }
    least = std::min(least, to.value);
  }
  if (out->count == 0) add_inside(particle, tube, *highest, radius, out);
  return samples.bound;
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
  if (f.touching) add_found(particle, f, out);
}

// A body that is a ball, by the line of centres.
void touch_ball(const Particle& particle, const CylinderPose& pose, SurfaceContacts* out) {
  const double r = particle.scale * roundness(*particle.shape).radius, distance = pose.apart.norm();
  SurfaceContact c;
  c.gap = pose.side * (pose.radius - distance) - r;
  if (!(c.gap < 0)) return;
  c.normal = -pose.side / distance * pose.apart;
  c.on_body = -r * c.normal;
  c.triangle = 0;
  c.rung = Rung::local_model;
  c.memory = cylinder_memory(particle, {});
  out->add(c);
}

// Goes on with one of the last step's contacts, where the body has no other.
bool go_on(const Particle& particle, const CylinderPose& pose, const ContactSettings& settings,
           const FormerContact* former, int former_count, SurfaceContact* c) {
  for (int k = 0; k < former_count; ++k) {
    PairMemory memory = *former[k].memory;
    CylinderContact next;
    if (!follow_on_cylinder(particle, pose, settings, &memory, &next)) continue;
    *c = SurfaceContact{};
    c->gap = next.gap;
    c->normal = next.normal;
    c->on_body = next.on_body;
    c->triangle = 0;
    c->rung = next.rung;
    c->iterations = next.iterations;
    c->memory = memory;
    return true;
  }
  return false;
}

}  // namespace

void find_cylinder_contacts(const Particle& particle, const Vec3& origin, const Vec3& axis, double radius,
                            const ContactSettings& settings, double path, const FormerContact* former,
                            int former_count, SurfaceContacts* out) {
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
  const CylinderPose pose{axis, across, radius, distance < radius ? 1.0 : -1.0};
  // F'' = (curvature radius of the body's outline) - F: where the body is everywhere more curved than the
  // tube, F has one maximum above the radius, if any.
  const double flattest = particle.scale * particle.shape->patch_curvature.max_radius;
  const bool alone = pose.side < 0 || (flattest < radius && !particle.shape->dented());
  SurfaceContact next;
  if (alone && distance > kLevel * (size + apart.norm()) &&
      is_round(particle, settings.tolerance * size, settings.tolerance)) {
    touch_ball(particle, pose, out);
    return;
  }
  if (alone && go_on(particle, pose, settings, former, former_count, &next)) {
    if (next.gap < 0)
      out->add(next);
    else
      keep_away(pose.side > 0 ? std::min(next.gap - 1e-9 * radius, radius - flattest) : 0);
    return;
  }
  if (pose.side > 0) {
    const double most = find_inside(particle, origin, axis, radius, out);
    if (out->count == 0) keep_away(radius - most);
  } else {
    find_outside(particle, origin, axis, radius, out);
  }
}

}  // namespace nurbs

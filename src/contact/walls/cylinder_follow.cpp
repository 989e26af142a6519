// See cylinder_follow.h.
#include "contact/walls/cylinder_follow.h"

#include <algorithm>
#include <cmath>

#include "body/support.h"
#include "body/support_turn.h"
#include "contact/certificate.h"
#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

std::uint64_t stamp_of(const Particle& particle) {
  return pair_stamp(0, stamp(particle), Solver::ladder);
}

class Follower {
 public:
  Follower(const Particle& particle, const CylinderPose& pose, const ContactSettings& settings,
           PairMemory* memory, CylinderContact* contact)
      : particle_(particle),
        shape_(*particle.shape),
        pose_(pose),
        tolerance_(settings.tolerance),
        size_(particle.scale * shape_.bounding_radius),
        axes_(particle.q.toRotationMatrix()),
        memory_(*memory),
        contact_(*contact) {}

  bool local() {
    if (memory_.model.unique != kCylinderModel) return false;
    const SupportModel& m = memory_.model.b;
    const Vec3 arm = axes_ * vec(m.arm), n = axes_ * vec(m.normal), t = axes_ * vec(m.tangent),
               s = n.cross(t);
    Vec3 c = n - n.dot(pose_.axis) * pose_.axis;
    const double across = c.norm();
    if (!(across > 0.5)) return false;
    c /= across;
    Vec3 moved, point;
    double slope = 0, bend = 0, f = 0, way2 = 0;
    for (int k = 0;; ++k) {
      const Vec3 turned = c - n, e = pose_.axis.cross(c);
      const double a = t.dot(turned), b = s.dot(turned);
      const double along_t = m.w0 * a + m.w1 * b, along_s = m.w1 * a + m.w2 * b;
      way2 = along_t * along_t + along_s * along_s;
      moved = along_t * t + along_s * s;
      point = arm + moved - (c.dot(moved) / (1 + c.dot(n))) * n;
      const Vec3 x = pose_.apart + point;
      const double et = e.dot(t), es = e.dot(s);
      f = c.dot(x);
      if (!(pose_.side * f > 0)) return false;  // the other side of the axis
      slope = e.dot(x);
      bend = m.w0 * et * et + 2 * m.w1 * et * es + m.w2 * es * es - f;
      if (!(-pose_.side * bend > 0)) return false;
      const double step = -slope / bend;
      if (k == kModelTurns || std::abs(step) < kModelAngle) break;
      c = (c + step * e).normalized();
    }
    // As in local_model.h, with one angle to be found instead of two.
    const double soft = 1 / std::abs(bend), angle2 = (c - n).squaredNorm(), angle = std::sqrt(angle2);
    const double second = m.rate * angle2, left = std::abs(slope) + kRemainderShare * 0.5 * second;
    const double gradient = std::abs(slope) + 0.5 * second;
    const double error = kRemainderSafety * (second * angle / 6 + gradient * gradient * soft);
    const double gap = pose_.side * pose_.radius - f;
    const double room = m.room - 0.5 * second;
    const bool valid = m.rate * (angle + 2 * soft * gradient) * soft <= 0.5 && room > 0 &&
                       way2 <= room * room && angle <= kLargestTurn;
    if (!valid || !(error <= 0.5 * tolerance_ * std::max(std::abs(gap), kForceDepth * size_)) ||
        !(left * soft <= tolerance_) || !(0.5 * second <= kLocalDrift * tolerance_ * size_))
      return false;
    set(gap, c, point, Rung::local_model, 0);
    contact_.where = surface_point(memory_.on_b);
    return true;
  }

  // Newton in the angle of c, by supports: also on creases and corners.
  bool by_supports() {
    SurfacePoint at = surface_point(memory_.on_b);
    if (!has_patch(shape_, at)) return false;
    if (shape_.support_excess > kSmallDent * tolerance_ * shape_.bounding_radius) return false;
    Vec3 y = pose_.apart + axes_ * (particle_.scale * evaluate0(shape_.patches[at.patch], at.u, at.v));
    y -= y.dot(pose_.axis) * pose_.axis;
    Vec3 c = pose_.side * y.normalized();
    for (int k = 1; k <= kRingSupports; ++k) {
      const Vec3 e = pose_.axis.cross(c), asked = axes_.transpose() * c;
      const Support s = find_hull_support(shape_, asked, &at, kRingSupport * shape_.bounding_radius);
      const Vec3 point = axes_ * (particle_.scale * s.point), x = pose_.apart + point;
      at = s.where;
      Mat2 turn;
      if (!support_turn(shape_, at, asked, asked, axes_.transpose() * e, axes_.transpose() * pose_.axis,
                        particle_.scale, &turn))
        return false;
      const double f = c.dot(x), bend = turn(0, 0) - f, step = -e.dot(x) / bend;
      if (!(-pose_.side * bend > 0) || !(std::abs(step) <= kLargestTurn)) return false;
      if (std::abs(step) <= kRingAngle) {
        set(pose_.side * pose_.radius - f, c, point, Rung::warm, k);
        contact_.where = at;
        memory_.on_b = point_memory(at);
        store(particle_.q, memory_.proof.q_b);
        drop_model(&memory_.model);
        return true;
      }
      c = (c + step * e).normalized();
    }
    return false;
  }

  // Lengths of the shape, its axes.
  bool newton() {
    SurfacePoint at = warm_point(memory_.on_b, shape_);
    if (at.patch < 0) return false;
    const Vec3 axis = axes_.transpose() * pose_.axis,
               apart = axes_.transpose() * pose_.apart / particle_.scale;
    JetLanes jet;
    for (int k = 1; k <= kDistanceIterations; ++k) {
      evaluate2(shape_.patches[at.patch], at.u, at.v, &jet);
      using Slot = JetLanes::Slot;
      const Vec3 x = jet.at(Slot::kS), su = jet.at(Slot::kSu), sv = jet.at(Slot::kSv);
      const double lu = su.squaredNorm(), lv = sv.squaredNorm();
      if (std::min(lu, lv) < kNearPole * kNearPole * std::max(lu, lv)) return false;
      const Vec3 n = su.cross(sv).normalized();
      Vec3 y = apart + x;
      y -= y.dot(axis) * axis;
      const double r = y.norm();
      const Vec3 c = pose_.side / r * y;
      if (!(c.dot(n) > 0)) return false;
      // Gradient and Hessian of y . y / 2.
      Lane8 g;
      dot(jet, y, &g);
      const double au = axis.dot(su), av = axis.dot(sv);
      const double huu = lu - au * au + g[3], huv = su.dot(sv) - au * av + g[4], hvv = lv - av * av + g[5];
      const double det = huu * hvv - huv * huv;
      if (!(-pose_.side * huu > 0 && det > kSingular * std::abs(huu * hvv))) return false;
      const double du = (huv * g[2] - hvv * g[1]) / det, dv = (huv * g[1] - huu * g[2]) / det;
      const double step = std::max(std::abs(du), std::abs(dv));
      if (!(step <= kLargestStep)) return false;
      const double chord2 = (c - n).squaredNorm();
      const SurfacePoint next{at.patch, at.u + du, at.v + dv};
      const bool inside = next.on_patch();
      const bool last =
          inside ? step * step <= std::max(tolerance_, kRoundoff) : chord2 <= kRingAngle * kRingAngle;
      if (last && certain(at, n, r, chord2)) {
        const SurfacePoint before = at;
        Vec3 point = x;
        if (inside) {
          at = next;
          point = taylor(jet, du, dv);
        }
        finish(before, at, point, apart, axis, jet, k);
        return true;
      }
      at = inside ? next : walk(shape_, at, du, dv);
    }
    return false;
  }

 private:
  // Whether the next step leaves nothing to be seen, and the point is the body's support.
  bool certain(const SurfacePoint& at, const Vec3& n, double r, double chord2) const {
    const RollingRadii radii = radii_at(shape_, at, nullptr, n);
    const double size = shape_.bounding_radius;
    const bool near = chord2 <= kNormalMargin * kNormalMargin && radii.near < kFarAway;
    if (!near && shape_.support_excess > kSmallDent * tolerance_ * size) return false;
    const double most = near ? radii.near : radii.outer;
    const double soft = pose_.side > 0 ? r - most : r;
    // On flats and ruled lines there is no such radius; d . x is right to the slope times the body's size.
    if (!(soft > 0) || !(most < kFarAway))
      return chord2 <= std::min(kRingAngle * kRingAngle, 0.01 * tolerance_ * tolerance_);
    const double enough = std::max(tolerance_, kRoundoff) * size;
    return 0.5 * most * chord2 * (1 + most / soft) <= enough && chord2 * size <= enough;
  }

  void finish(const SurfacePoint& base, const SurfacePoint& at, const Vec3& point, const Vec3& apart,
              const Vec3& axis, JetLanes& jet, int iterations) {
    Vec3 y = apart + point;
    y -= y.dot(axis) * axis;
    const double f = particle_.scale * pose_.side * y.norm();
    const double gap = pose_.side * pose_.radius - f;
    const double turned2_before = turned2(particle_.q, memory_.proof.q_b);
    set(gap, axes_ * (pose_.side * y.normalized()), axes_ * (particle_.scale * point), Rung::warm,
        iterations);
    contact_.where = at;
    remember_point(at, &memory_.on_b);
    store(particle_.q, memory_.proof.q_b);
    drop_model(&memory_.model);
    if (make_wall_model(particle_, base, turned2_before, gap, tolerance_, size_, jet, &memory_.model.b))
      memory_.model.unique = kCylinderModel;
  }

  void set(double gap, const Vec3& c, const Vec3& point, Rung rung, int iterations) {
    contact_.gap = gap;
    contact_.normal = -c;
    contact_.on_body = point;
    contact_.rung = rung;
    contact_.iterations = iterations;
  }

  const Particle& particle_;
  const Shape& shape_;
  const CylinderPose& pose_;
  const double tolerance_, size_;
  const Mat3 axes_;
  PairMemory& memory_;
  CylinderContact& contact_;
};

}  // namespace

PairMemory cylinder_memory(const Particle& particle, const SurfacePoint& where) {
  PairMemory m{};
  m.proof.stamp = stamp_of(particle);
  store(particle.q, m.proof.q_b);
  drop_proof(&m.proof);
  drop_model(&m.model);
  m.on_a.patch = -1;
  m.on_b = point_memory(where);
  return m;
}

bool follow_on_cylinder(const Particle& particle, const CylinderPose& pose, const ContactSettings& settings,
                        PairMemory* memory, CylinderContact* contact) {
  if (memory->proof.stamp != stamp_of(particle)) return false;
  Follower follower(particle, pose, settings, memory, contact);
  return follower.local() || follower.newton() || follower.by_supports();
}

}  // namespace nurbs

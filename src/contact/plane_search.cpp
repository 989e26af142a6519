// A particle against a plane: the direction is known (paper, Remark 1), so one support mapping is all a solve
// takes. The rungs are those of a pair, with a plane that does not turn.
#include <algorithm>
#include <cmath>

#include "contact/certificate.h"
#include "contact/ellipsoid_search.h"
#include "contact/pair_frame.h"
#include "contact/pair_memory.h"
#include "contact/pair_search.h"
#include "contact/sphere_search.h"
#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

// A support point with the surface around it, shape frame, scale 1.
struct WarmSupport {
  Support support;
  double attained;    // height along d of the surface point there: what the support's has moved on from
  SurfacePoint base;  // the parameters evaluated last
  JetLanes jet;       // the surface there
};

// Newton for the support in direction d from `at`, usually one evaluation: certified by the ball that rolls
// around the body, then moved on by the step already solved for. False where it leaves the patch, meets a
// pole or vanishing curvature, or needs more than kWarmIterations.
bool solve_warm(const Shape& shape, const Vec3& d, SurfacePoint at, double tolerance, WarmSupport* out) {
  using Slot = JetLanes::Slot;
  for (int k = 1; k <= kWarmIterations; ++k) {
    evaluate2(shape.patches[at.patch], at.u, at.v, &out->jet);
    const JetLanes& j = out->jet;
    const Vec3 su = j.at(Slot::kSu), sv = j.at(Slot::kSv), cross = su.cross(sv);
    const double lu = su.squaredNorm(), lv = sv.squaredNorm();
    if (std::min(lu, lv) < kNearPole * kNearPole * std::max(lu, lv)) return false;
    const Vec3 n = cross.normalized();
    Lane8 f;
    dot(j, d, &f);
    const double det = f[3] * f[5] - f[4] * f[4];
    if (!(f[3] < 0 && det > kSingular * f[3] * f[5])) return false;
    const double r = 1 / det, du = r * (f[4] * f[2] - f[5] * f[1]), dv = r * (f[4] * f[1] - f[3] * f[2]);
    const SurfacePoint next{at.patch, at.u + du, at.v + dv};
    if (!next.on_patch()) return false;
    const double excess =
        support_excess(shape, 1, radii_at(shape, at, nullptr, n), d, n, pole_noise(shape, std::min(lu, lv)));
    const double roundoff = kRoundoff * shape.bounding_radius;
    if (excess + roundoff <= tolerance &&
        (d - n).squaredNorm() * shape.bounding_radius <= std::max(tolerance, roundoff) &&
        turns_linearly(j, du, dv)) {
      Support& s = out->support;
      out->base = at;
      s.where = next;
      s.point = taylor(j, du, dv);
      s.h = d.dot(s.point);
      out->attained = std::min(f[0], s.h);
      s.upper = f[0] + excess + roundoff;
      s.iterations = k;
      s.converged = s.h >= f[0] - roundoff && s.h <= s.upper;
      return s.converged;
    }
    at = next;
  }
  return false;
}

class PlaneLadder {
 public:
  PlaneLadder(const Particle& particle, double height, const Vec3& normal, const ContactSettings& settings,
              PairMemory& memory)
      : particle_(particle),
        shape_(*particle.shape),
        radius_(particle.scale * shape_.bounding_radius),
        height_(height),
        normal_(normal),
        settings_(settings),
        tolerance_(settings.tolerance * radius_),
        memory_(memory) {}

  ContactResult run() {
    ContactResult r;
    const bool touched = memory_.proof.contact != 0;
    if (!touched && safe(&r)) return r;
    if (!finite(particle_)) return r;
    if (local(&r)) return r;
    solve(&r);
    return r;
  }

  // The rungs that evaluate surfaces.
  void solve(ContactResult* r) {
    if (!finite(particle_)) return;
    if (solve_sphere_on_plane(particle_, height_, normal_, settings_, memory_, r)) return;
    if (solve_ellipsoid_on_plane(particle_, height_, normal_, settings_, memory_, r)) return;
    const bool touched = memory_.proof.contact != 0;
    axes_ = particle_.q.toRotationMatrix();
    d_ = axes_.transpose() * -normal_;
    if (by_core(r)) return;
    if (!touched && bounds(r)) return;
    if (memory_.on_b.patch >= 0 && warm(r)) return;
    if (touched && bounds(r)) return;
    search(r);
  }

 private:
  // The budget of the last solve, as for a pair, with a plane that does not turn.
  bool safe(ContactResult* r) const {
    const double gap =
        std::max(height_ - radius_, proven_gap(memory_.proof, height_ * normal_, Quat::Identity(), 0,
                                               particle_.q, radius_, settings_.reach));
    if (!(gap > settings_.reach)) return false;
    set_apart(gap, Rung::safe, r);
    return true;
  }

  bool local(ContactResult* r) const {
    if (!(memory_.model.unique > 0)) return false;
    const Turn<double> identity = turn(Mat3::Identity());
    const LocalContact c =
        evaluate_local(memory_.model.a, memory_.model.b, identity, turn(particle_.q.toRotationMatrix()),
                       triple(height_ * normal_), 0.0);
    if (!serves(c, memory_.model.unique, settings_.tolerance, radius_)) return false;
    const double error = c.error + kRoundoff * radius_;
    r->rung = Rung::local_model;
    const Vec3 point = vec(c.point_b) - height_ * normal_;
    const double h = height_ - c.gap;
    set_contact(h, h - error, h + error, point, r);
    return true;
  }

  bool bounds(ContactResult* r) {
    const double lower = height_ - particle_.scale * shape_.atlas.support_upper(d_);
    if (!(lower > settings_.reach)) return false;
    remember_pose(lower);
    set_apart(lower, Rung::bounds, r);
    return true;
  }

  bool warm(ContactResult* r) {
    WarmSupport s;
    const SurfacePoint start = warm_point(memory_.on_b, shape_);
    if (!solve_warm(shape_, d_, start, settings_.tolerance * shape_.bounding_radius, &s)) return false;
    r->rung = Rung::warm;
    const double turned2_before = turned2(particle_.q, memory_.proof.q_b);
    finish(s.support, s.attained, r);
    if (r->status == Status::converged) remember_model(s, turned2_before, r->gap);
    return true;
  }

  // Sphero-polyhedra in closed form.
  bool by_core(ContactResult* r) {
    if (!PairFrame::is_swept(shape_, particle_.scale, tolerance_)) return false;
    const Support s = core_support(shape_, d_);
    r->rung = Rung::local_model;
    finish(s, 2 * s.h - s.upper, r);
    return true;
  }

  // The support mapping at large: across patches, from the last point or the atlas.
  void search(ContactResult* r) {
    const bool warm = memory_.on_b.patch >= 0;
    const SurfacePoint start = surface_point(memory_.on_b);
    r->rung = warm ? Rung::warm : Rung::cold;
    const double enough = kSupportShare * settings_.tolerance * shape_.bounding_radius;
    const Support s = find_hull_support(shape_, d_, warm ? &start : nullptr, enough);
    finish(s, s.h, r);
  }

  // `attained`: height of a point of the surface, which the support is not below.
  void finish(const Support& s, double attained, ContactResult* r) {
    r->iterations = s.iterations;
    const double scale = particle_.scale;
    set_contact(scale * s.h, scale * attained, scale * s.upper, axes_ * (scale * s.point), r);
    remember_pose(r->lower);
    remember_point(s.where, &memory_.on_b);
  }

  // From the support along the plane's normal, its bounds and its point.
  void set_contact(double h, double h_lower, double h_upper, const Vec3& point, ContactResult* r) const {
    r->normal = normal_;
    r->gap = height_ - h;
    r->lower = height_ - h_upper;
    r->upper = height_ - h_lower;
    r->point_b = point;
    r->point_a = point - r->gap * normal_;
    r->status = r->lower > settings_.reach          ? Status::separated
                : r->upper - r->lower <= tolerance_ ? Status::converged
                                                    : Status::unresolved;
  }

  void remember_pose(double lower) {
    drop_model(&memory_.model);
    set_proof(normal_, lower, height_ * normal_, Quat::Identity(), particle_.q, &memory_.proof);
    memory_.proof.contact = !(lower > settings_.reach);
  }

  // A plane asks one support only: the model needs no uniqueness, but no dents near either.
  void remember_model(WarmSupport& s, double turned2_before, double gap) {
    if (shape_.dented() && !(shape_.normal_map.radius_at(d_) < kFarAway)) return;
    if (!make_wall_model(particle_, s.base, turned2_before, gap, settings_.tolerance, radius_, s.jet,
                         &memory_.model.b))
      return;
    memory_.model.a = plane_model(normal_);
    memory_.model.unique = kFarAway;
  }

  const Particle& particle_;
  const Shape& shape_;
  const double radius_, height_;  // of the centre above the plane
  const Vec3& normal_;
  const ContactSettings& settings_;
  const double tolerance_;
  PairMemory& memory_;
  Mat3 axes_;
  Vec3 d_;  // towards the plane, shape axes
};

}  // namespace

ContactResult find_plane_contact(const Particle& particle, const Vec3& origin, const Vec3& normal,
                                 const ContactSettings& settings, double* memory) {
  if (!is_unit(particle.q)) {
    const Particle unit = with_unit_turn(particle);
    return is_unit(unit.q) ? find_plane_contact(unit, origin, normal, settings, memory) : ContactResult();
  }
  PairMemory& m = memory_at(memory);
  adopt(pair_stamp(stamp(normal), stamp(particle), Solver::ladder), &m);
  return PlaneLadder(particle, normal.dot(particle.x - origin), normal, settings, m).run();
}

ContactResult solve_plane_contact(const Particle& particle, double height, const Vec3& normal,
                                  const ContactSettings& settings, PairMemory& memory) {
  ContactResult r;
  PlaneLadder(particle, height, normal, settings, memory).solve(&r);
  return r;
}

}  // namespace nurbs

// See feature_search.h.
#include "contact/walls/feature_search.h"

#include <algorithm>
#include <cmath>

#include "body/support.h"
#include "contact/local_model.h"
#include "nurbs/jet_lanes.h"
#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

FeatureContact contact(const FeatureGap& at, const Vec3& d) {
  FeatureContact c;
  c.touching = at.gap < 0;
  c.gap = at.gap;
  c.normal = d;
  c.on_body = at.on_body;
  c.where = at.where;
  return c;
}

// A direction of the search on a line: d, f there, and f's slope when d turns towards `high`.
struct Turned {
  double angle;
  Vec3 d;
  FeatureGap at;
  double slope;
};

class LineSearch {
 public:
  LineSearch(const Particle& particle, const Vec3& a, const Vec3& direction, const Vec3& low,
             const Vec3& high, double radius, const SurfacePoint* start)
      : particle_(particle), a_(a), direction_(direction), radius_(radius), low_(low) {
    if (start) start_ = *start, started_ = true;
    // Turning from low towards high is turning about +-direction.
    side_ = (high - low.dot(high) * low).normalized();
    span_ = std::atan2(low.cross(high).norm(), low.dot(high));
  }

  FeatureContact run() {
    Turned low = look(0);
    if (!(low.at.gap < 0)) return {};
    if (span_ < kStraight) return finish(low, low);
    Turned high = look(span_);
    if (!(high.at.gap < 0)) return {};
    if (low.slope <= 0) return finish(low, low);
    if (high.slope >= 0) return finish(high, high);
    double weight_low = 1, weight_high = 1;  // of the slopes: Illinois
    for (int k = 0; k < kLineSearches; ++k) {
      const double width = high.angle - low.angle;
      if (width < kLineAngle) break;
      const Turned next = look(next_angle(k, low, high, weight_low, weight_high));
      if (!(next.at.gap < 0)) return {};
      const bool kink = same(next.at, low.at) || same(next.at, high.at);
      const double moved = std::min(next.angle - low.angle, high.angle - next.angle);
      if (next.slope > 0) {
        weight_high = raised_ == 1 ? 0.5 * weight_high : 1;
        weight_low = 1;
        low = next;
        raised_ = 1;
      } else {
        weight_low = raised_ == -1 ? 0.5 * weight_low : 1;
        weight_high = 1;
        high = next;
        raised_ = -1;
      }
      if (kink && across(low, high)) break;
      if (moved < kLineAngle && std::abs(next.slope) <= noise()) break;
    }
    return finish(low, high);
  }

 private:
  static constexpr double kStraight = 1e-13;   // rad: two normals are one
  static constexpr double kLineAngle = 1e-12;  // rad, of the bracket
  static constexpr int kLineSearches = 60;

  // Round-off of the body's points.
  double noise() const { return kRoundoff * 8 * particle_.scale * particle_.shape->bounding_radius; }
  static bool same(const FeatureGap& p, const FeatureGap& q) {
    return (p.on_body - q.on_body).squaredNorm() == 0;
  }
  // Of a corner, whatever parameters its supports have.
  bool is_one_point(const Vec3& chord) const { return chord.norm() <= noise(); }

  Turned look(double angle) {
    Turned t;
    t.angle = angle;
    t.d = (std::cos(angle) * low_ + std::sin(angle) * side_).normalized();
    t.at = gap_along(particle_, a_, t.d, started_ ? &start_ : nullptr);
    t.at.gap -= radius_;
    start_ = t.at.where;
    started_ = true;
    t.slope = slope_at(angle, t.at);
    return t;
  }
  // That f would have there, were this the support.
  double slope_at(double angle, const FeatureGap& at) const {
    const Vec3 turned = std::cos(angle) * side_ - std::sin(angle) * low_;
    return turned.dot(particle_.x - a_ + at.on_body);
  }

  // A corner at both ends is the support between them too, and d points at it where f is highest. The chord
  // between two supports has the normal that both share where f has a kink; a secant of the slopes leads to a
  // smooth maximum.
  double next_angle(int k, const Turned& low, const Turned& high, double weight_low,
                    double weight_high) const {
    const double width = high.angle - low.angle;
    double t = 0.5;
    const Vec3 chord = high.at.on_body - low.at.on_body;
    if (is_one_point(chord)) {
      const Vec3 y = particle_.x - a_ + low.at.on_body;
      const double angle = std::atan2(side_.dot(y), low_.dot(y));
      if (angle > low.angle && angle < high.angle) return angle;
    } else if (k % 3 == 1) {
      const double along_low = chord.dot(low.d), along_high = chord.dot(high.d);
      // d = cos low + sin side with d . chord = 0, between the two.
      if (along_low * along_high < 0) {
        const double c = low_.dot(chord), s = side_.dot(chord);
        double angle = std::atan2(-c, s);
        if (angle < low.angle) angle += M_PI;
        if (angle > high.angle) angle -= M_PI;
        if (angle > low.angle && angle < high.angle) return angle;
      }
    } else if (k % 3 == 0 || k > 6) {
      const double l = weight_low * low.slope, h = weight_high * high.slope;
      t = l / (l - h);
    }
    return low.angle + width * std::clamp(t, 1e-6, 1 - 1e-6);
  }

  // Whether both supports lie in one straight part of the body's outline, with the line's point between them:
  // the direction is its normal.
  bool across(const Turned& low, const Turned& high) const {
    const Vec3 chord = high.at.on_body - low.at.on_body;
    if (is_one_point(chord)) return false;
    const auto is_normal = [&](const Turned& t) {
      return std::abs(chord.dot(t.d)) <= noise() && slope_at(t.angle, low.at) >= 0 &&
             slope_at(t.angle, high.at) <= 0;
    };
    return is_normal(low) || is_normal(high);
  }

  // Between the two supports lies the point over the line.
  FeatureContact finish(const Turned& low, const Turned& high) const {
    const Turned& best = low.at.gap > high.at.gap ? low : high;
    FeatureContact c = contact(best.at, best.d);
    // Their own slopes are those of their own directions, which a kink found early leaves apart.
    const double to_low = slope_at(best.angle, low.at), to_high = slope_at(best.angle, high.at);
    if (to_low > 0 && to_high < 0)
      c.on_body = low.at.on_body + to_low / (to_low - to_high) * (high.at.on_body - low.at.on_body);
    c.along = direction_.dot(particle_.x - a_ + c.on_body);
    return c;
  }

  const Particle& particle_;
  const Vec3 a_, direction_;
  const double radius_;
  Vec3 low_, side_;
  double span_;
  SurfacePoint start_;
  bool started_ = false;
  int raised_ = 0;
};

// --- a point: the polytope of the support points met

constexpr int kPointCuts = 24;
constexpr int kPointNewton = 8;

// max over unit d of min over i of d . p_i, from the active sets of one, two and three points.
struct Cuts {
  Vec3 p[kPointCuts];
  int count = 0;

  double least(const Vec3& d) const {
    double value = d.dot(p[0]);
    for (int i = 1; i < count; ++i) value = std::min(value, d.dot(p[i]));
    return value;
  }
  // The normal to leave by: of the polytope's nearest face when the origin is inside, else the direction that
  // proves it outside.
  double best(Vec3* d) const {
    double most = -kFarAway;
    const auto offer = [&](const Vec3& v) {
      const double norm = v.norm();
      if (!(norm > 1e-300)) return;
      for (const double sign : {1.0, -1.0}) {
        const Vec3 u = sign / norm * v;
        const double value = least(u);
        if (value > most) most = value, *d = u;
      }
    };
    for (int i = 0; i < count; ++i) {
      offer(p[i]);
      for (int j = i + 1; j < count; ++j) {
        const Vec3 edge = p[j] - p[i];
        offer(p[i] - p[i].dot(edge) / std::max(edge.squaredNorm(), 1e-300) * edge);
        for (int k = j + 1; k < count; ++k) offer(edge.cross(p[k] - p[i]));
      }
    }
    return most;
  }
};

}  // namespace

FeatureGap gap_along(const Particle& particle, const Vec3& a, const Vec3& d, const SurfacePoint* start) {
  const Mat3 axes = particle.q.toRotationMatrix();
  const Support s = find_feature_support(*particle.shape, axes.transpose() * -d, start);
  FeatureGap g;
  g.on_body = axes * (particle.scale * s.point);
  g.gap = d.dot(particle.x - a) - particle.scale * s.h;
  g.where = s.where;
  return g;
}

FeatureContact find_line_contact(const Particle& particle, const Vec3& a, const Vec3& direction,
                                 const Vec3& low, const Vec3& high, double radius,
                                 const SurfacePoint* start) {
  return LineSearch(particle, a, direction, low, high, radius, start).run();
}

FeatureContact find_point_contact(const Particle& particle, const Vec3& a, const Vec3& guess,
                                  const SurfacePoint* start) {
  const Shape& shape = *particle.shape;
  const Mat3 axes = particle.q.toRotationMatrix();
  const double size = particle.scale * shape.bounding_radius;
  Cuts cuts;
  const auto keep = [&](const FeatureGap& g) {
    if (cuts.count < kPointCuts) cuts.p[cuts.count++] = particle.x - a + g.on_body;
  };
  Vec3 d = guess;
  FeatureGap g = gap_along(particle, a, d, start);
  keep(g);
  for (int k = 0; k < kPointNewton && g.gap < 0; ++k) {
    JetLanes jet;
    evaluate2(shape.patches[g.where.patch], g.where.u, g.where.v, &jet);
    SupportModel model;
    if (!make_support_model(axes, Vec3::Zero(), jet, LocalRate{0, 0, 0}, &model)) break;
    const Vec3 t = vec(model.tangent), n = vec(model.normal), s = n.cross(t);
    if (!((n + d).norm() < 1e-4)) break;  // a kink: the normal is not what was asked for
    // (W - overlap) tau = (x - a) across d.
    const Vec3 x = particle.x - a + g.on_body;
    const double w0 = particle.scale * model.w0 + g.gap, w1 = particle.scale * model.w1,
                 w2 = particle.scale * model.w2 + g.gap, det = w0 * w2 - w1 * w1;
    if (!(w0 > 0 && det > 0)) break;
    const double rt = t.dot(x), rs = s.dot(x);
    Vec3 tau = ((w2 * rt - w1 * rs) * t + (w0 * rs - w1 * rt) * s) / det;
    tau -= d.dot(tau) * d;
    const double step = tau.norm();
    if (step < 1e-12) return contact(g, d);
    if (step > 0.5) tau *= 0.5 / step;
    bool higher = false;
    for (int half = 0; half < 4; ++half, tau *= 0.3) {
      const Vec3 next = (d + tau).normalized();
      const FeatureGap there = gap_along(particle, a, next, &g.where);
      keep(there);
      if (!(there.gap > g.gap - kRoundoff * size)) continue;
      d = next;
      g = there;
      higher = true;
      break;
    }
    if (!higher) break;
    if (step < 1e-7) return contact(g, d);  // the next step is its square
  }
  if (!(g.gap < 0)) return {};
  // Kinks and flats.
  FeatureGap best = g;
  Vec3 best_d = d;
  for (const Vec3& side : {d.unitOrthogonal(), Vec3(-d.unitOrthogonal()), Vec3(d.cross(d.unitOrthogonal())),
                           Vec3(-d.cross(d.unitOrthogonal()))}) {
    const Vec3 tilted = (d + 0.3 * side).normalized();
    const FeatureGap there = gap_along(particle, a, tilted, &g.where);
    if (!(there.gap < 0)) return {};
    keep(there);
    if (there.gap > best.gap) best = there, best_d = tilted;
  }
  for (int k = cuts.count; k < kPointCuts; ++k) {
    Vec3 next;
    const double most = cuts.best(&next);
    if (most <= best.gap + 1e-12 * size) break;
    const FeatureGap there = gap_along(particle, a, next, nullptr);
    if (!(there.gap < 0)) return {};
    keep(there);
    if (there.gap > best.gap) best = there, best_d = next;
    if (there.gap >= most - 1e-12 * size) break;
  }
  FeatureContact c = contact(best, best_d);
  // The body's point under `a`: on a flat the support may be anywhere.
  c.on_body = a - particle.x + best.gap * best_d;
  return c;
}

}  // namespace nurbs

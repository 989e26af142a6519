// See feature_search.h.
#include "contact/walls/feature_search.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "body/support.h"
#include "contact/local_model.h"
#include "contact/pair_memory.h"
#include "contact/pair_search.h"
#include "contact/sphere_search.h"
#include "nurbs/jet_lanes.h"
#include "nurbs/tolerances.h"
#include "shapes/primitives.h"

namespace nurbs {
namespace {

// A direction of the search on a line: d, f there, and f's slope when d turns towards `high`.
struct Turned {
  double angle;
  Vec3 d;
  FeatureGap at;
  double slope;
};

class LineSearch {
 public:
  LineSearch(const Particle& particle, const Vec3& a, const Vec3& direction, const Arc& arc, double radius,
             const SurfacePoint* start)
      : particle_(particle),
        a_(a),
        direction_(direction),
        radius_(radius),
        low_(arc.low),
        side_(arc.side),
        span_(arc.span) {
    if (start) start_ = *start, started_ = true;
  }

  FeatureContact run() {
    Turned low = look(0);
    if (!(low.at.gap < 0)) return {};
    if (span_ < kStraight) return finish(low, low);
    Turned high = look(span_);
    if (!(high.at.gap < 0)) return {};
    if (low.slope <= 0) return finish(low, low);
    if (high.slope >= 0) return finish(high, high);
    return climb(low, high);
  }

  // The highest of all maxima; see find_highest_line_contact.
  FeatureContact run_over_all(double* angle) {
    FeatureContact c = find_highest(angle);
    c.along_low = c.along_high = c.along;
    if (!c.touching || particle_.shape->flats.empty()) return c;
    // Lines of the body along this one: tilted, the ends of them.
    const Vec3 across = c.normal.cross(direction_);
    for (const double tilt : {kTilt, -kTilt}) {
      const FeatureGap g = gap_along(particle_, a_, (c.normal + tilt * direction_).normalized(), &c.where);
      const Vec3 y = particle_.x - a_ + g.on_body;
      if (std::abs(across.dot(y)) > kTilt * kTilt * particle_.scale * particle_.shape->bounding_radius)
        continue;
      const double along = direction_.dot(y);
      c.along_low = std::min(c.along_low, along);
      c.along_high = std::max(c.along_high, along);
    }
    return c;
  }

 private:
  static constexpr double kStraight = 1e-13;   // rad: two normals are one
  static constexpr double kLineAngle = 1e-12;  // rad, of the bracket
  static constexpr double kNarrow = 0.1;       // rad: a bracket that has one maximum
  static constexpr double kTilt = 1e-6;        // rad: lines less apart are along each other
  static constexpr double kBeside = 1e-9;      // rad: beside a kink
  static constexpr int kLineSearches = 60;
  static constexpr double kLineLevel = 1e-9;  // of the overlap: maxima that are one
  static constexpr int kArcCuts = 48;

  FeatureContact find_highest(double* angle) {
    Turned met[kArcCuts];
    int count = 0;
    const auto highest = [&] {
      return static_cast<int>(
          std::max_element(met, met + count,
                           [](const Turned& s, const Turned& t) { return s.at.gap < t.at.gap; }) -
          met);
    };
    for (const double at : {0.0, 0.5 * span_, span_}) {
      met[count] = look(at);
      if (!(met[count++].at.gap < 0)) return {};
    }
    while (count < kArcCuts) {
      const double gap = met[highest()].at.gap, level = gap + kLineLevel * std::abs(gap) + noise();
      int top = -1, open = 0;
      double most = level, cut = 0;
      for (int i = 0; i + 1 < count; ++i) {
        double where;
        const double bound = bound_between(met[i], met[i + 1], &where);
        if (!(bound > level)) continue;
        ++open;
        if (bound > most) most = bound, top = i, cut = where;
      }
      if (top < 0) break;
      const Turned &low = met[top], &high = met[top + 1];
      const double width = high.angle - low.angle;
      if (width < kLineAngle) break;
      if (open == 1 && width < kNarrow && low.slope > 0 && high.slope < 0) {
        const FeatureContact c = climb(low, high);
        *angle = 0.5 * (low.angle + high.angle);
        return c;
      }
      const double margin = std::min(1e-3 * width, kLineAngle);
      const Turned next = look(std::clamp(cut, low.angle + margin, high.angle - margin));
      if (!(next.at.gap < 0)) return {};
      for (int i = count++; i > top + 1; --i) met[i] = met[i - 1];
      met[top + 1] = next;
    }
    const int best = highest();
    *angle = met[best].angle;
    // At a kink the directions on either side have its two supports.
    const double left = std::max(0.0, *angle - kBeside), right = std::min(span_, *angle + kBeside);
    if (!particle_.shape->smooth && left < *angle && *angle < right)
      return between(met[best], look(left), look(right));
    const bool up = best == 0 || (best + 1 < count && met[best].slope > 0);
    const int other = up ? best + 1 : best - 1;
    return up ? finish(met[best], met[other]) : finish(met[other], met[best]);
  }

  // f between two directions is at most what their supports would make of it, the lower of two sinusoids:
  // that is highest at an end, where they meet, or where the lower one is.
  double bound_between(const Turned& low, const Turned& high, double* where) const {
    const auto sinusoid = [&](const Turned& t) {
      const Vec3 y = particle_.x - a_ + t.at.on_body;
      return Vec2(low_.dot(y), side_.dot(y));
    };
    const Vec2 l = sinusoid(low), h = sinusoid(high);
    double most = -kFarAway;
    const auto offer = [&](double angle) {
      if (!(angle >= low.angle && angle <= high.angle)) return;
      const Vec2 d(std::cos(angle), std::sin(angle));
      const double value = std::min(d.dot(l), d.dot(h)) - radius_;
      if (value > most) most = value, *where = angle;
    };
    offer(low.angle);
    offer(high.angle);
    for (const Vec2& y : {Vec2(h[1] - l[1], l[0] - h[0]), l, h}) {
      const double angle = std::atan2(y[1], y[0]);
      offer(angle);
      offer(angle < 0 ? angle + M_PI : angle);
    }
    return most;
  }

  FeatureContact climb(Turned low, Turned high) {
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
    return between(low.at.gap > high.at.gap ? low : high, low, high);
  }

  FeatureContact between(const Turned& best, const Turned& low, const Turned& high) const {
    FeatureContact c = feature_contact(best.at, best.d);
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

// --- a point

constexpr int kPointNewton = 8;
constexpr double kBallShare = 0.25;  // of the bounding radius

// Newton to a normal of the body that goes through `a`, from a direction near it. False where it does not get
// there: kinks, flats, ruled lines. Not touching as soon as a direction says so.
bool find_foot(const Particle& particle, const Vec3& a, Vec3 d, const SurfacePoint* start,
               FeatureContact* out) {
  const Mat3 axes = particle.q.toRotationMatrix();
  const double size = particle.scale * particle.shape->bounding_radius;
  FeatureGap g = gap_along(particle, a, d, start);
  const auto end = [&] {
    *out = feature_contact(g, d);
    return true;
  };
  for (int k = 0; k < kPointNewton; ++k) {
    if (!(g.gap < 0)) return end();
    JetLanes jet;
    evaluate2(particle.shape->patches[g.where.patch], g.where.u, g.where.v, &jet);
    SupportModel model;
    if (!make_support_model(axes, Vec3::Zero(), jet, LocalRate{0, 0, 0}, &model)) return false;
    const Vec3 t = vec(model.tangent), n = vec(model.normal), s = n.cross(t);
    if (!((n + d).norm() < 1e-4)) return false;  // a kink: the normal is not what was asked for
    // (W - overlap) tau = (x - a) across d.
    const Vec3 x = particle.x - a + g.on_body;
    const double w0 = particle.scale * model.w0 + g.gap, w1 = particle.scale * model.w1,
                 w2 = particle.scale * model.w2 + g.gap, det = w0 * w2 - w1 * w1;
    if (!(w0 > 0 && det > 0)) return false;
    const double rt = t.dot(x), rs = s.dot(x);
    Vec3 tau = ((w2 * rt - w1 * rs) * t + (w0 * rs - w1 * rt) * s) / det;
    tau -= d.dot(tau) * d;
    const double step = tau.norm();
    if (step < 1e-12) return end();
    if (step > 0.5) tau *= 0.5 / step;
    bool higher = false;
    for (int half = 0; half < 4; ++half, tau *= 0.3) {
      const Vec3 next = (d + tau).normalized();
      const FeatureGap there = gap_along(particle, a, next, &g.where);
      if (!(there.gap > g.gap - kRoundoff * size)) continue;
      d = next;
      g = there;
      higher = true;
      break;
    }
    if (!higher) return false;
    if (step < 1e-7) return end();  // the next step is its square
  }
  return false;
}

// --- a polygon

constexpr int kApartSteps = 40;

// The point nearest to the origin of the line, plane or space through N + 1 points, if it lies between them:
// q0 + sum w_i (q_i - q0), square to all the sides.
template <int N>
bool foot_between(const Vec3* q, Vec3* y) {
  Eigen::Matrix<double, 3, N> sides;
  for (int i = 0; i < N; ++i) sides.col(i) = q[i + 1] - q[0];
  const Eigen::Matrix<double, N, N> gram = sides.transpose() * sides;
  const Eigen::Matrix<double, N, 1> w = gram.inverse() * (sides.transpose() * -q[0]);
  *y = q[0] + sides * w;
  return w.minCoeff() >= 0 && w.sum() <= 1;
}

// That of the hull of up to four points; leaves those that make it.
Vec3 nearest_to_origin(Vec3* p, int* count) {
  double least = kFarAway;
  Vec3 best = Vec3::Zero();
  int kept = 0;
  for (int set = 1; set < 1 << *count; ++set) {
    Vec3 q[4], y;
    int n = 0;
    for (int i = 0; i < *count; ++i)
      if (set >> i & 1) q[n++] = p[i];
    bool between = true;
    if (n == 1)
      y = q[0];
    else if (n == 2)
      between = foot_between<1>(q, &y);
    else if (n == 3)
      between = foot_between<2>(q, &y);
    else
      between = foot_between<3>(q, &y);
    if (between && y.squaredNorm() < least) least = y.squaredNorm(), best = y, kept = set;
  }
  int n = 0;
  for (int i = 0; i < *count; ++i)
    if (kept >> i & 1) p[n++] = p[i];
  *count = n;
  return best;
}

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

FeatureContact feature_contact(const FeatureGap& at, const Vec3& d) {
  FeatureContact c;
  c.touching = at.gap < 0;
  c.gap = at.gap;
  c.normal = d;
  c.on_body = at.on_body;
  c.where = at.where;
  return c;
}

Arc arc_between(const Vec3& low, const Vec3& high) {
  const double cosine = low.dot(high);
  return {low, (high - cosine * low).normalized(), std::atan2(low.cross(high).norm(), cosine)};
}

FeatureContact find_line_contact(const Particle& particle, const Vec3& a, const Vec3& direction,
                                 const Vec3& low, const Vec3& high, double radius,
                                 const SurfacePoint* start) {
  return LineSearch(particle, a, direction, arc_between(low, high), radius, start).run();
}

FeatureContact find_highest_line_contact(const Particle& particle, const Vec3& a, const Vec3& direction,
                                         const Arc& arc, const SurfacePoint* start, double* angle) {
  return LineSearch(particle, a, direction, arc, 0, start).run_over_all(angle);
}

bool is_clear_of(const Particle& particle, const Vec3* points, int count) {
  Vec3 simplex[4];
  int size = 0;
  Vec3 d = particle.x - points[0];
  for (int k = 0; k < kApartSteps; ++k) {
    if (!(d.norm() > kRoundoff * particle.scale * particle.shape->bounding_radius)) return false;
    d.normalize();
    const Vec3* far = std::max_element(points, points + count,
                                       [&](const Vec3& p, const Vec3& q) { return d.dot(p) < d.dot(q); });
    const FeatureGap g = gap_along(particle, *far, d, nullptr);
    if (g.gap > 0) return true;
    simplex[size++] = particle.x - *far + g.on_body;
    d = nearest_to_origin(simplex, &size);
    if (size == 4) return false;
  }
  return false;
}

// Gilbert, Johnson & Keerthi's distance of the point from the body's points in that plane, which are the
// supports along directions next to d.
bool has_point(const Particle& particle, const Vec3& point, const Vec3& d, const SurfacePoint& at) {
  constexpr double kTilt = 1e-6, kNear = 1e-4, kProgress = 0.1;
  const double near = kNear * particle.scale * particle.shape->bounding_radius;
  Vec3 simplex[4], y = particle.x - point + gap_along(particle, point, d, &at).on_body;
  int size = 0;
  simplex[size++] = y;
  for (int k = 0; k < kApartSteps && size < 4; ++k) {
    const Vec3 along = y - d.dot(y) * d;
    const double distance = along.norm();
    if (distance < near) return true;
    const Vec3 to = along / distance;
    const Vec3 q =
        particle.x - point + gap_along(particle, point, (d + kTilt * to).normalized(), &at).on_body;
    if (distance - q.dot(to) < kProgress * near) return false;
    simplex[size++] = q;
    y = nearest_to_origin(simplex, &size);
  }
  return size == 4;
}

namespace {

FeatureContact find_way_out(const Particle& particle, const Vec3& a, const ContactSettings& settings) {
  static const std::shared_ptr<const Shape> kBall = make_shape("ball", exact_ellipsoid(Vec3::Ones()));
  Particle ball;
  ball.shape = kBall.get();
  ball.x = a;
  ball.scale = kBallShare * particle.scale * particle.shape->bounding_radius;
  ContactSettings full = settings;
  full.reach = std::numeric_limits<double>::infinity();
  PairMemory memory{};
  const ContactResult r = find_contact(ball, particle, full, reinterpret_cast<double*>(&memory));
  FeatureContact c;
  c.gap = r.gap + ball.scale * roundness(*kBall).radius;
  c.touching = c.gap < 0;
  c.normal = r.normal;
  c.on_body = a - particle.x + c.gap * r.normal;
  c.where = warm_point(memory.on_b, *particle.shape);
  return c;
}

}  // namespace

bool find_only_way_out(const Particle& particle, const Vec3& a, const Vec3& guess, const SurfacePoint* start,
                       FeatureContact* out) {
  // A ball of the least curvature radius rolls inside: from no deeper than that, a normal is the shortest
  // way, and the only one.
  return find_foot(particle, a, guess, start, out) &&
         (!out->touching || -out->gap <= particle.scale * particle.shape->curvature.min_radius);
}

FeatureContact find_point_contact(const Particle& particle, const Vec3& a, const Vec3& guess,
                                  const ContactSettings& settings, const SurfacePoint* start) {
  FeatureContact c;
  return find_only_way_out(particle, a, guess, start, &c) ? c : find_way_out(particle, a, settings);
}

}  // namespace nurbs

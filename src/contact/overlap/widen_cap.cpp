// Rings about a minimum, each from where the last one ends; see widen_cap.h.
#include "contact/overlap/widen_cap.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "contact/local_bend.h"

namespace nurbs {
namespace {

constexpr int kMostPoints = 32;       // kept
constexpr double kWideArc = 0.7;      // cosine of half an arc that points are to have, where W is large
constexpr double kFlattest = 0.97;    // of the least W, that the level may be: next to no minimum
constexpr double kLeastRatio = 1.15;  // of a ring's angles
constexpr double kKeptRatio = 0.9;    // of what W at the minimum promises of it: W changes
constexpr double kMostRatio = 1e3;
constexpr int kPatience = 3;            // points more than foreseen, before the ring is made narrower
constexpr double kForeseen = 1.5;       // times the points left, that may be foreseen
constexpr double kOffNormals = 0.2;     // of the angle asked for, that points' normals may be off
constexpr double kArcRoundoff = 1e-10;  // rad
constexpr double kSameGap = 0.3;        // rad, between the middles of gaps
constexpr double kNarrowArc = 0.02;     // rad: points with less are let go

// e of a point, with y of it along d.
struct RingPoint {
  double y, length, azimuth;
  double half;  // of the arc that it has all over the ring
};

struct Arc {  // or ring
  double from, to;
};

class Rings {
 public:
  Rings(const PairFrame& pair, const CappedMinimum& m, const CapBalls& balls)
      : pair_(pair), m_(m), narrowest_(std::cos(balls.valid)) {
    const double both = balls.sum(), share = both > m.level ? m.level / both : 1;
    radius_a_ = share * balls.radius_a;
    radius_b_ = share * balls.radius_b;
    level_ = std::max(0.0, m.level - radius_a_ - radius_b_) + 8 * pair.noise;
    const Mat2 turn = m.turn - (radius_a_ + radius_b_) * Mat2::Identity();
    bend_ = extremes(turn);
    const Vec2 axis = least_axis(turn, bend_.least);
    valley_ = std::atan2(axis[1], axis[0]);
    if (bend_.least > 0) inverse_ = turn.inverse();
  }

  double widen(double proven, double wanted, int most, int* spent) {
    if (!(level_ < kFlattest * bend_.least)) return proven;
    const Promise valley = promise(1 / bend_.least);
    const double points = 0.5 * M_PI * (1 / valley.arc + 1 / promise(1 / bend_.most).arc);
    if (points * std::log(wanted / proven) > kForeseen * (most - *spent) * std::log(valley.ratio))
      return proven;
    while (wanted > kLeastRatio * proven) {
      const double to =
          close_ring(proven, std::min(wanted, kKeptRatio * valley.ratio * proven), points, most, spent);
      if (!(to > proven)) break;
      proven = to;
    }
    return proven;
  }

 private:
  // What a point gives, chosen so that half its arc is the same at both ends of a ring: that, and the ratio
  // of the ends. With m = e . W^-1 e for e of length 1 it lies e^2 m / 2 lower than the minimum's.
  struct Promise {
    double cosine, root, ratio, arc;
  };
  Promise promise(double m) const {
    const double lm = level_ * m, cosine = std::max(kWideArc, 0.5 * (1 + std::sqrt(std::min(lm, 1.0)))),
                 root = std::sqrt(std::max(0.0, cosine * cosine - lm)), sum = cosine + root;
    return {cosine, root, std::min(kMostRatio, sum * sum / lm), std::acos(cosine)};
  }

  // As far as the ring from an angle is covered, `to` at most; no further than that where it can't be.
  double close_ring(double from, double to, double points, int most, int* spent) {
    ring_ = {from, from};
    take_arcs();
    count_ = static_cast<int>(
        std::remove_if(point_, point_ + count_, [](const RingPoint& p) { return p.half < kNarrowArc; }) -
        point_);
    ring_.to = to;
    take_arcs();
    int left = static_cast<int>(points) + kPatience;
    double gap, last = std::numeric_limits<double>::quiet_NaN();
    while (find_gap(&gap)) {
      if (left-- == 0) {
        to = std::sqrt(from * to);
        left = kPatience;
        if (!(to > kLeastRatio * from)) return from;
        ring_.to = to;
        take_arcs();
        continue;
      }
      if (*spent >= most || count_ == kMostPoints) return from;
      ++*spent;
      // Where the last one did not go where it should have, W is another there.
      ask(gap, std::abs(std::remainder(gap - last, 2 * M_PI)) < kSameGap);
      last = gap;
    }
    return to;
  }

  // Half the lesser of the arcs at the ring's ends.
  double half_arc(const RingPoint& p) const {
    double c = 0;
    for (const double angle : {ring_.from, ring_.to})
      c = std::max(c, (level_ - p.y * std::cos(angle)) / (p.length * std::sin(angle)));
    return c < 1 ? std::acos(c) - kArcRoundoff : 0;
  }
  void take_arcs() {
    for (int k = 0; k < count_; ++k) point_[k].half = half_arc(point_[k]);
  }

  // The middle of the widest gap that the points' arcs leave; false where there is none.
  bool find_gap(double* middle) const {
    Arc arc[kMostPoints];
    int arcs = 0;
    for (int k = 0; k < count_; ++k) {
      const double half = point_[k].half;
      if (!(half > 0)) continue;
      const Arc made{point_[k].azimuth - half, point_[k].azimuth + half};
      int at = arcs++;
      for (; at > 0 && arc[at - 1].from > made.from; --at) arc[at] = arc[at - 1];
      arc[at] = made;
    }
    *middle = valley_;
    if (arcs == 0) return true;
    // Once around, from the end of those that reach past the first.
    double end = -kFarAway, widest = 0;
    for (int k = 0; k < arcs; ++k) end = std::max(end, arc[k].to - 2 * M_PI);
    end = std::max(end, arc[0].from);
    for (int k = 0; k <= arcs; ++k) {
      const double next = k < arcs ? arc[k].from : arc[0].from + 2 * M_PI;
      if (next - end > widest) {
        widest = next - end;
        *middle = 0.5 * (next + end);
      }
      if (k < arcs) end = std::max(end, arc[k].to);
    }
    return widest > 0;
  }

  // A point with e at an azimuth, as W at the minimum has it, or `there` the supports in that direction,
  // which reach it.
  void ask(double azimuth, bool there) {
    const Vec2 e(std::cos(azimuth), std::sin(azimuth));
    const double middle = std::sqrt(ring_.from * ring_.to);
    Vec2 x = middle * e;
    if (!there) {
      const Vec2 along = inverse_ * e;
      const double m = e.dot(along);
      const Promise p = promise(m);
      x = std::min(ring_.from * (p.cosine + p.root) / m, middle / along.norm()) * along;
    }
    const Vec3 d = (m_.d + x[0] * m_.t + x[1] * m_.u).normalized();
    const Support a = support(*pair_.a, d, m_.on_a, pair_.scale_a, radius_a_, x.norm()),
                  b = support(*pair_.b, pair_.direction_on_b(d), m_.on_b, pair_.scale_b, radius_b_, x.norm());
    const Vec3 n = pair_.turn * b.normal;
    if (a.normal.dot(m_.d) < narrowest_ || -n.dot(m_.d) < narrowest_) return;
    const Vec3 g = pair_.place_a(a.point) - radius_a_ * a.normal - pair_.place_b(b.point) + radius_b_ * n;
    const double gt = m_.t.dot(g), gu = m_.u.dot(g);
    RingPoint p{std::min(m_.d.dot(g), level_), std::hypot(gt, gu), std::atan2(gu, gt), 0};
    if (!(p.length > 0)) return;
    p.half = half_arc(p);
    point_[count_++] = p;
  }

  // Any point will do, but over dents, where balls are known of the hull's supports only.
  Support support(const Shape& shape, const Vec3& d, const SurfacePoint& at, double scale, double radius,
                  double angle) const {
    if (shape.dented() && radius > 0)
      return find_hull_support(shape, d, &at, kSupportShare * m_.tolerance / scale);
    return find_hull_support(shape, d, &at, kFarAway, kOffNormals * angle);
  }

  const PairFrame& pair_;
  const CappedMinimum& m_;
  const double narrowest_;  // cosine between normals and d
  double radius_a_, radius_b_, level_;
  Extremes bend_{0, 0};  // of W less the balls'
  double valley_;        // azimuth of the lesser
  Mat2 inverse_ = Mat2::Zero();
  Arc ring_{0, 0};  // angles from d
  RingPoint point_[kMostPoints];
  int count_ = 0;
};

}  // namespace

double widen_cap(const PairFrame& pair, const CappedMinimum& minimum, const CapBalls& balls, double proven,
                 double wanted, int most, int* spent) {
  wanted = std::min(wanted, balls.valid);
  return wanted > kLeastRatio * proven ? Rings(pair, minimum, balls).widen(proven, wanted, most, spent)
                                       : proven;
}

}  // namespace nurbs

// Descents, and intervals of the ratio of both bodies' heights; see ellipsoid_overlap.h.
#include "contact/overlap/ellipsoid_overlap.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "contact/local_bend.h"
#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

constexpr double kDepthShare = 0.5;     // of the tolerance, between the overlap and its level
constexpr double kRoundoffShare = 0.1;  // of it, that round-off of a test may take
constexpr double kNoise = 2e-15;        // of a matrix
constexpr int kMostTests = 200;         // 30 to 60 are usual; the polytope closes in as long
constexpr int kMostWeights = 100;       // m tried in one
constexpr double kWidestInterval = 1;   // interval, of the logarithm of the ratio
constexpr double kNoInterval = 1e-9;    // ... which is none any more
constexpr double kLargeRatio = 1e15;
constexpr double kLargeShare = 1e6;  // of a matrix, beyond which its last axis is nearly an eigenvector
constexpr double kNarrower = 0.4, kWider = 2;
constexpr double kLeastWeight = 1e-13, kFirstWeight = 1e-3;
constexpr double kLongestWeight = 5;  // of its logarithm in one step
constexpr int kDescentSteps = 60;     // 5 to 8 are usual
constexpr double kDescentTurn = 0.5;  // rad in one
constexpr double kStill = 1e-13;      // rad: a step that is none
constexpr double kOffCrease = 1e-9;   // rad
constexpr double kBeside = 1e-3;      // of the tolerance: directions lower by less are the same minimum's
constexpr double kBoundRoundoff = 1e-9;

// L D L' of a symmetric matrix; false where it is not positive definite.
class Cholesky {
 public:
  bool factorize(const Mat3& m) {
    d0_ = m(0, 0);
    if (!(d0_ > 0)) return false;
    l10_ = m(1, 0) / d0_;
    l20_ = m(2, 0) / d0_;
    d1_ = m(1, 1) - l10_ * m(1, 0);
    if (!(d1_ > 0)) return false;
    const double rest = m(2, 1) - l20_ * m(1, 0);
    l21_ = rest / d1_;
    d2_ = m(2, 2) - l20_ * m(2, 0) - l21_ * rest;
    return d2_ > 0;
  }
  Vec3 solve(const Vec3& b) const {
    const double y1 = b[1] - l10_ * b[0], y2 = b[2] - l20_ * b[0] - l21_ * y1;
    const double z = y2 / d2_, y = y1 / d1_ - l21_ * z;
    return {b[0] / d0_ - l10_ * y - l20_ * z, y, z};
  }

 private:
  double d0_, d1_, d2_, l10_, l20_, l21_;
};

// Axes of which the last is a segment's, as rows.
Mat3 axes_along(const SweptEllipsoid& segment) {
  int column;
  segment.root.colwise().squaredNorm().maxCoeff(&column);
  const Vec3 axis = segment.root.col(column).normalized();
  Mat3 axes;
  axes.row(0) = axis.unitOrthogonal();
  axes.row(1) = axis.cross(Vec3(axes.row(0)));
  axes.row(2) = axis;
  return axes;
}
SweptEllipsoid turned(const Mat3& axes, const SweptEllipsoid& e) {
  SweptEllipsoid t = e;
  t.root = axes * e.root * axes.transpose();
  if (e.is_segment()) t.root = Vec3(0, 0, e.most).asDiagonal();
  return t;
}

// B may be a point, or a segment along the last axis: its share of a matrix grows without bound towards
// directions square to it, and rounds no other entry so. A is none.
class Search {
 public:
  Search(const SweptEllipsoid& a, const SweptEllipsoid& b, const Vec3& offset, double tolerance)
      : a_(a),
        b_(b),
        offset_(offset),
        square_a_(a.root * a.root),
        square_b_(b.root * b.root),
        tolerance_(tolerance) {}

  bool run(const Vec3& start, LeastOverlap* found) {
    consider(start);
    if (!(level() > tolerance_ && prove())) return false;
    const double balls = a_.ball + b_.ball;
    *found = {best_d_, best_ + balls, level() + balls, tests_};
    return true;
  }

 private:
  struct Ratios {
    double from, to;
  };

  double overlap(const Vec3& d) const { return a_.height(d) + b_.height(d) - offset_.dot(d); }
  double level() const { return best_ - kDepthShare * tolerance_; }

  double least_ratio() const {
    return a_.least > 0 && b_.most > 0 ? a_.least / b_.most * (1 - kBoundRoundoff) : 0;
  }
  double most_ratio() const { return b_.least > 0 ? a_.most / b_.least * (1 + kBoundRoundoff) : kFarAway; }
  double ratio(const Vec3& d) const {
    const double low = b_.height(d);
    return low > 0 ? a_.height(d) / low : kFarAway;
  }

  // Goes down from d; of a segment as far as the directions square to it, where p has a crease, then along
  // that, and on where p falls off it.
  void consider(const Vec3& d) {
    Vec3 x = descend(d);
    take(x);
    if (!b_.is_segment()) return;
    x[2] = 0;
    x = descend_across(x.norm() > kNoDirection ? Vec3(x.normalized()) : Vec3(Vec3::UnitX()));
    take(x);
    const double slope = (a_.root.row(2) * (a_.root * x)).value() / a_.height(x) - offset_[2];
    if (!(std::abs(slope) > b_.most)) return;
    x[2] = std::copysign(kOffCrease, -slope);
    take(descend(x.normalized()));
  }
  void take(const Vec3& d) {
    if (const double p = overlap(d); p < best_) best_ = p, best_d_ = d;
  }

  // Newton with halved steps, its eigenvalues' signs made positive.
  Vec3 descend(Vec3 d) const {
    double p = overlap(d);
    for (int k = 0; k < kDescentSteps; ++k) {
      const Vec3 t = d.unitOrthogonal(), s = d.cross(t);
      Mat2 bend = -p * Mat2::Identity();
      Vec3 apart = -offset_;
      for (const SweptEllipsoid* body : {&a_, &b_}) {
        const RootSupport met = root_support(body->root, d, t, s);
        apart += met.point;
        bend += met.turn;
      }
      const Vec2 step = newton(bend, Vec2(apart.dot(t), apart.dot(s)));
      Vec3 by = step[0] * t + step[1] * s;
      if (b_.is_segment() && d[2] * (d[2] + by[2]) < 0) {
        by *= -d[2] / by[2];  // to the crease, if that is lower
        const Vec3 on(d[0] + by[0], d[1] + by[1], 0);
        if (on.norm() > kNoDirection && overlap(on.normalized()) < p) return on.normalized();
      }
      if (!halve_until_lower(&d, &p, by) || step.norm() < kStill) break;
    }
    return d;
  }
  static Vec2 newton(const Mat2& bend, const Vec2& slope) {
    const Extremes e = extremes(bend);
    const double angle = 0.5 * std::atan2(2 * bend(0, 1), bend(0, 0) - bend(1, 1));
    const Vec2 most(std::cos(angle), std::sin(angle)), least(-most[1], most[0]);
    const double flat = kRoundoff * std::max(std::abs(e.most), std::abs(e.least));
    const Vec2 step = -slope.dot(most) / std::max(std::abs(e.most), flat) * most -
                      slope.dot(least) / std::max(std::abs(e.least), flat) * least;
    const double length = step.norm();
    return length > kDescentTurn ? Vec2(kDescentTurn / length * step) : step;
  }
  bool halve_until_lower(Vec3* d, double* p, Vec3 by) const {
    for (; by.squaredNorm() > kStill * kStill * kStill; by *= 0.5) {
      const Vec3 next = (*d + by).normalized();
      const double there = overlap(next);
      if (!(there < *p)) continue;
      *d = next;
      *p = there;
      return true;
    }
    return false;
  }

  // The same along the great circle square to the segment, of which nothing is left there.
  Vec3 descend_across(Vec3 d) const {
    double p = overlap(d);
    for (int k = 0; k < kDescentSteps; ++k) {
      const Vec3 t(-d[1], d[0], 0), at = a_.root * d, at_t = a_.root * t;
      const double h = at.norm(), x = at.dot(at_t) / h, slope = x - offset_.dot(t),
                   bend = (at_t.squaredNorm() - x * x) / h - p;
      const double step =
          std::clamp(-slope / std::max(std::abs(bend), kRoundoff * a_.most), -kDescentTurn, kDescentTurn);
      if (!halve_until_lower(&d, &p, step * t) || std::abs(step) < kStill) break;
    }
    return d;
  }

  // From the ratio of the least overlap found, both ways.
  bool prove() {
    if (b_.most == 0) return only_one();
    const double low = least_ratio(), high = most_ratio(), first = std::clamp(ratio(best_d_), low, high);
    const double ha = a_.height(best_d_), hb = b_.height(best_d_);
    const double widest =
        std::min(kWidestInterval, std::sqrt(kDepthShare * tolerance_ * (ha + hb) / (ha * hb)));
    return go(first, high, widest) && go(first, low, widest);
  }

  // B is a ball.
  bool only_one() {
    double before;
    do {
      before = best_;
      Vec3 lower;
      weight_ = std::max(offset_.dot(best_d_) / level(), 0.0);
      if (overlaps({0, kFarAway}, &lower)) return true;
      if (lower.squaredNorm() > 0) consider(lower.normalized());
    } while (best_ < before && tests_ < kMostTests);
    return false;
  }

  // `width`: of the first interval, of the logarithm.
  bool go(double from, double end, double width) {
    weight_ = std::max(offset_.dot(best_d_) / level(), 0.0);
    while (from != end) {
      const bool up = end > from;
      const double to = next(from, end, width);
      Vec3 lower;
      if (overlaps(up ? Ratios{from, to} : Ratios{to, from}, &lower)) {
        from = to;
        width = std::min(kWider * width, kWidestInterval * (1 + std::abs(std::log(from))));
        continue;
      }
      if (tests_ > kMostTests || out_of_digits_) return false;
      const double before = best_;
      if (lower.squaredNorm() > 0) consider(lower.normalized());
      if (!(level() > tolerance_)) return false;
      if (best_ < before) {
        weight_ = std::max(offset_.dot(best_d_) / level(), 0.0);
        if (best_ < before - kBeside * tolerance_) continue;
      }
      width *= kNarrower;
      if (width < kNoInterval) return false;
    }
    return true;
  }
  // Ratios beyond all that matter are one interval.
  static double next(double from, double end, double width) {
    if (from >= kFarAway) return kLargeRatio;
    const double to = from * std::exp(end > from ? width : -width);
    if (end > from) return to >= std::min(end, kLargeRatio) ? end : to;
    return to <= std::max(end, 1 / kLargeRatio) ? end : to;
  }

  // The test; where it fails, *lower is a direction of less overlap, if one was found.
  bool overlaps(const Ratios& r, Vec3* lower) {
    ++tests_;
    *lower = Vec3::Zero();
    double of_a, of_b;
    if (r.to >= kFarAway) {
      of_a = 1, of_b = 1 + 2 * r.from;
    } else {
      of_a = 1 + 2 / (r.from + r.to);
      of_b = 1 + 2 * r.from * r.to / (r.from + r.to);
    }
    Mat3 m = of_a * square_a_ + of_b * square_b_;
    const double size2_a = of_a * a_.most * a_.most, size2_b = of_b * b_.most * b_.most, depth = level(),
                 depth2 = depth * depth, noise = kNoise * (size2_a + (b_.is_segment() ? 0 : size2_b));
    out_of_digits_ = noise > kRoundoffShare * tolerance_ * depth;
    m.diagonal().array() -= noise;
    if (b_.is_segment()) m(2, 2) -= kNoise * size2_b;
    // By N^-1 o . o as a function of m, log of the sum is convex in the logarithm of m: Newton, in a bracket.
    double low = 0, high = kFarAway, weight = std::max(weight_, kLeastWeight);
    for (int k = 0; k < kMostWeights; ++k) {
      Mat3 n = m;
      n.diagonal().array() -= (1 + weight) * depth2;
      Cholesky cholesky;
      if (!cholesky.factorize(n)) {
        high = weight;
        weight = low > 0 ? std::sqrt(low * high) : 0.1 * high;
        if (weight < kLeastWeight || high - low < kRoundoff * high) break;
        continue;
      }
      const Vec3 x = cholesky.solve(offset_);
      const double g = offset_.dot(x), sum = (1 + 1 / weight) * g;
      if (sum <= 1) {
        weight_ = weight;
        return true;
      }
      const Vec3 d = x.normalized();
      if (overlap(d) < depth) {
        *lower = d;
        return false;
      }
      const double first = depth2 * x.squaredNorm() / g,
                   second = 2 * depth2 * depth2 * x.dot(cholesky.solve(x)) / g;
      const double over = 1 / (1 + weight), rise = weight * first, slope = rise - over,
                   bend = weight * over * over + rise + weight * weight * second - rise * rise;
      (slope > 0 ? high : low) = weight;
      const double step = bend > 0 ? std::clamp(-slope / bend, -kLongestWeight, kLongestWeight)
                                   : std::copysign(kLongestWeight, -slope);
      double there = weight * std::exp(step);
      if (!(there > low && there < high))
        there = high < kFarAway ? std::sqrt(std::max(low, 1e-3 * high) * high) : 10 * low;
      if (!(std::abs(there - weight) > kRoundoff * weight)) break;
      weight = there;
    }
    *lower = least_axis(m);
    return false;
  }

  // Where offset has no share of the least eigenvector it is the one that N^-1 misses.
  Vec3 least_axis(const Mat3& m) const {
    Vec3 axis;
    if (m(2, 2) > kLargeShare * (m(0, 0) + m(1, 1))) {  // a segment's share: what is left square to it
      const Vec2 beside = m.block<2, 1>(0, 2) / m(2, 2);
      const Mat2 left = m.topLeftCorner<2, 2>() - m(2, 2) * beside * beside.transpose();
      const double most = 0.5 * std::atan2(2 * left(0, 1), left(0, 0) - left(1, 1));
      const Vec2 least(-std::sin(most), std::cos(most));
      axis = Vec3(least[0], least[1], -beside.dot(least));
    } else {
      Eigen::SelfAdjointEigenSolver<Mat3> solver;
      solver.computeDirect(m);
      axis = solver.eigenvectors().col(0);
    }
    return offset_.dot(axis) < 0 ? Vec3(-axis) : axis;
  }

  const SweptEllipsoid &a_, &b_;
  const Vec3 offset_;
  const Mat3 square_a_, square_b_;
  const double tolerance_;
  double best_ = kFarAway, weight_ = 0;
  Vec3 best_d_ = Vec3::UnitX();
  bool out_of_digits_ = false;
  int tests_ = 0;
};

}  // namespace

SweptEllipsoid SweptEllipsoid::of(const Ellipsoid& e, double scale, const Mat3& turn) {
  return {scale * (turn * e.root * turn.transpose()), scale * e.least(), scale * e.semi.maxCoeff(), 0};
}

SweptEllipsoid SweptEllipsoid::along(const Vec3& half, double ball) {
  SweptEllipsoid s{Mat3::Zero(), 0, half.norm(), ball};
  if (s.most > 0) s.root = half * half.transpose() / s.most;
  return s;
}

Vec3 SweptEllipsoid::point(const Vec3& d) const {
  const Vec3 at = root * d;
  const double h = at.norm();
  return h > kNoDirection * most ? Vec3(root * at / h) : Vec3::Zero();
}

bool find_least_overlap(const SweptEllipsoid& a, const SweptEllipsoid& b, const Vec3& offset,
                        const Vec3& start, double tolerance, LeastOverlap* found) {
  const SweptEllipsoid &one = a.least > 0 ? a : b, &other = a.least > 0 ? b : a;  // p is even in them
  if (!(one.least > 0)) return false;
  if (!other.is_segment()) return Search(one, other, offset, tolerance).run(start, found);
  const Mat3 axes = axes_along(other);
  if (!Search(turned(axes, one), turned(axes, other), axes * offset, tolerance).run(axes * start, found))
    return false;
  found->direction = axes.transpose() * found->direction;
  return true;
}

}  // namespace nurbs

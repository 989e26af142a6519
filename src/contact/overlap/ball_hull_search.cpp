// Every direction at which one, two or three balls' overlaps are stationary together; see ball_hull_search.h.
#include "contact/overlap/ball_hull_search.h"

#include <algorithm>
#include <cmath>

#include "contact/overlap/growing_hull.h"

namespace nurbs {
namespace {

constexpr int kMostTerms = kMostBalls * kMostBalls;
constexpr double kSameTerm = 0.05;   // of the tolerance: two that count as one
constexpr double kSameLine = 1e-15;  // sine between differences of centres: circles that are parallel
constexpr double kTouching = 1e-13;  // of a length of 1: circles that touch

struct Balls {
  int count = 0;            // none: not a hull of balls, or of too many
  Vec3 centre[kMostBalls];  // pair frame
  double radius[kMostBalls];
  double error = 0;
  bool whole = true;  // the body is their hull

  Balls(const Shape& shape, double scale, const Mat3& turn, const Vec3& offset) {
    const SpheroPolyhedron& core = shape.core;
    whole = core.found() || shape.ball_hull.found();
    const BallHull& hull = whole ? shape.ball_hull : shape.inner_balls;
    const std::vector<Vec3>& centres = core.found() ? core.points : hull.centres;
    if (centres.size() > kMostBalls) return;
    count = static_cast<int>(centres.size());
    for (int k = 0; k < count; ++k) {
      centre[k] = offset + scale * (turn * centres[k]);
      radius[k] = scale * (core.found() ? core.radius : hull.radii[k]);
    }
    error = scale * (core.found() ? core.error : hull.error);
  }
};

class BallHullSearch {
 public:
  BallHullSearch(const PairFrame& pair, const Balls& a, const Balls& b, double tolerance)
      : a_(a), b_(b), reach_(pair.reach), noise_(a.error + b.error + 16 * kRoundoff * pair.reach) {
    double left_out = 0;
    for (int i = 0; i < a.count; ++i)
      for (int j = 0; j < b.count; ++j) {
        const Term made{a.centre[i] - b.centre[j], a.radius[i] + b.radius[j], i, j};
        double apart = kFarAway;
        for (int k = 0; k < count_; ++k)
          apart = std::min(apart, (made.g - term_[k].g).norm() + std::abs(made.radius - term_[k].radius));
        if (apart <= kSameTerm * tolerance)
          left_out = std::max(left_out, apart);
        else
          term_[count_++] = made;
      }
    noise_ += left_out;
  }

  // False where round-off leaves it open, or no balls that touch along the direction.
  bool run() {
    consider(Vec3::UnitX(), 0, 0, 0);
    for (int i = 0; i < count_; ++i) {
      if (const double length = term_[i].g.norm(); length > noise_) consider(-term_[i].g / length, i, i, i);
      for (int j = i + 1; j < count_; ++j) {
        level_of_two(i, j);
        for (int k = j + 1; k < count_; ++k)
          if (!level_of_three(i, j, k)) return false;
      }
    }
    return off_ < kFarAway;
  }

  const Vec3& direction() const { return direction_; }
  double upper() const { return -least_ + noise_; }

  void fill(const PairFrame& pair, double lower, PolytopeResult* r) const {
    r->bracket.direction = direction_;
    r->bracket.lower = std::min(lower, -there_ - noise_);
    r->bracket.upper = upper();
    r->gap = -there_;
    r->converged = r->closed = true;
    r->iterations = 1;
    Vec3 a = Vec3::Zero(), b = Vec3::Zero();
    for (int n = 0; n < 3; ++n) {
      const int i = term_[active_[n]].i, j = term_[active_[n]].j;
      a += weights_[n] * (a_.centre[i] + a_.radius[i] * direction_);
      b += weights_[n] * (b_.centre[j] - b_.radius[j] * direction_);
    }
    set_points(pair, a, b, r);
  }
  double width() const { return 4 * noise_; }  // at most

 private:
  struct Term {
    Vec3 g;
    double radius;
    int i, j;  // whose balls'
  };

  double overlap(const Vec3& d) const {
    double most = -kFarAway;
    for (int k = 0; k < count_; ++k) most = std::max(most, d.dot(term_[k].g) + term_[k].radius);
    return most;
  }

  // Of directions as good as each other that at which the terms' gradients cancel best, if those terms are
  // the largest there.
  void consider(const Vec3& d, int i, int j, int k) {
    const double p = overlap(d), level = 2 * noise_;
    if (p > least_ + level) return;
    const auto across = [&](int n) -> Vec3 { return term_[n].g - d.dot(term_[n].g) * d; };
    const Vec3 x = across(i), y = across(j), z = across(k);
    Vec3 weights(1, 0, 0);
    if (j != k) {
      weights = nearest_on_triangle(x, y, z);
    } else if (const double apart2 = (x - y).squaredNorm(); apart2 > 0) {
      weights[1] = std::clamp(x.dot(x - y) / apart2, 0.0, 1.0);
      weights[0] = 1 - weights[1];
    }
    double off = (weights[0] * x + weights[1] * y + weights[2] * z).norm();
    const auto largest = [&](int n) { return d.dot(term_[n].g) + term_[n].radius >= p - level; };
    if (!(off < kFarAway && largest(i) && largest(j) && largest(k))) {
      // Of balls about one centre every direction is as good.
      i = 0;
      while (i < count_ && !(largest(i) && across(i).norm() <= noise_)) ++i;
      off = i < count_ ? across(i).norm() : kFarAway;
      weights = Vec3::UnitX();
      j = k = i;
    }
    if (p < least_ - level || off < off_) {
      off_ = off;
      direction_ = d;
      there_ = p;
      weights_ = weights;
      active_[0] = i;
      active_[1] = j;
      active_[2] = k;
    }
    least_ = std::min(p, least_);
  }

  // d . x = level of unit d.
  struct Circle {
    Vec3 x;
    double level;
  };
  Circle level(int i, int j) const { return {term_[i].g - term_[j].g, term_[j].radius - term_[i].radius}; }

  void level_of_two(int i, int j) {
    const Circle c = level(i, j);
    const double length = c.x.norm();
    if (!(length > kNoDirection * reach_) || std::abs(c.level) > length * (1 + kTouching)) return;
    const Vec3 u = c.x / length;
    const double cosine = std::clamp(c.level / length, -1.0, 1.0), sine = std::sqrt(1 - cosine * cosine);
    Vec3 e = term_[i].g - u.dot(term_[i].g) * u;
    const double across = e.norm();
    if (across > kRoundoff * reach_) {
      e /= across;
      e = (e - u.dot(e) * u).normalized();  // what cancelled of it left it hardly square to u
    } else {
      e = u.unitOrthogonal();
    }
    for (const double side : {-1.0, 1.0}) consider((cosine * u + side * sine * e).normalized(), i, j, j);
  }

  bool level_of_three(int i, int j, int k) {
    const Circle c = level(i, j), d = level(i, k);
    const Vec3 normal = c.x.cross(d.x);
    const double n2 = normal.squaredNorm(), lengths2 = c.x.squaredNorm() * d.x.squaredNorm();
    if (!(n2 > kSameLine * kSameLine * lengths2)) return true;
    const Vec3 over = d.x.cross(normal) / n2, under = normal.cross(c.x) / n2;
    const auto meeting = [&](double at_c, double at_d) -> Vec3 { return at_c * over + at_d * under; };
    Vec3 foot = meeting(c.level, d.level);
    foot += meeting(c.level - c.x.dot(foot), d.level - d.x.dot(foot));
    const double rest = 1 - foot.squaredNorm();
    if (rest < -kTouching * std::sqrt(lengths2 / n2)) return true;
    const double height = std::sqrt(std::max(0.0, rest) / n2);
    for (const double side : {-height, height}) {
      const Vec3 there = (foot + side * normal).normalized();
      if (std::max(std::abs(c.x.dot(there) - c.level), std::abs(d.x.dot(there) - d.level)) > noise_)
        return false;
      consider(there, i, j, k);
    }
    return true;
  }

  const Balls &a_, &b_;
  const double reach_;
  double noise_;
  int count_ = 0;
  Term term_[kMostTerms];
  double least_ = kFarAway, there_ = kFarAway;  // overlap, and in the direction chosen
  double off_ = kFarAway;                       // what its gradients leave
  Vec3 direction_ = Vec3::UnitX(), weights_ = Vec3::UnitX();
  int active_[3] = {0, 0, 0};
};

}  // namespace

bool search_ball_hulls(const PairFrame& pair, double tolerance, PolytopeResult* result, double* upper) {
  *upper = kFarAway;
  const auto some = [](const Shape& shape) { return shape.ball_hull.found() || shape.inner_balls.found(); };
  // Of points and a ball the polytope is.
  if (!some(*pair.a) && !some(*pair.b)) return false;
  const Balls a(*pair.a, pair.scale_a, Mat3::Identity(), Vec3::Zero()),
      b(*pair.b, pair.scale_b, pair.turn, pair.offset);
  if (a.count == 0 || b.count == 0) return false;
  BallHullSearch search(pair, a, b, tolerance);
  if (!(search.width() <= 0.5 * tolerance) || !search.run()) return false;
  *upper = search.upper();
  double lower = kFarAway;
  if (!(a.whole && b.whole)) {
    const auto [on_a, on_b] = hull_supports(pair, search.direction(), nullptr, nullptr, tolerance);
    lower = -pair.overlap_along(search.direction(), on_a.upper, on_b.upper);
    if (!(search.upper() - lower <= tolerance)) return false;
  }
  search.fill(pair, lower, result);
  return true;
}

}  // namespace nurbs

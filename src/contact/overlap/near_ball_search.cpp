// Pairs of pieces, the lowest bound first; see near_ball_search.h.
#include "contact/overlap/near_ball_search.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "contact/overlap/closing.h"
#include "nurbs/room.h"

namespace nurbs {
namespace {

constexpr int kMostPairs = 4096;     // open at once
constexpr long kMostWork = 1200000;  // coefficients looked at in all, some 20 ms; a pair of pieces counts ...
constexpr long kPairWork = 4;        // ... as so many, supports as those of half a patch of each
constexpr int kMostMade = 2048;      // pieces of a body that are made about an origin
constexpr int kMostLeft = 1024;      // that wait for another origin, and ...
constexpr int kMostCones = 64;       // ... cones of them
constexpr int kAlwaysEvaluated = 16;   // pairs ...
constexpr double kSpreadShare = 0.25;  // ... and those later that so much of their spread below ...
constexpr double kGain = 0.1;          // ... would gain as much, of the tolerance
constexpr double kSpent = 0.02;        // of the tolerance: what spreads less is not parted
constexpr int kAsked = 32;             // directions along which p is remembered
constexpr double kAsNear = 0.25;       // of a cone: p is not asked for again
constexpr double kStartNear = 0.3;     // rad: supports are searched from there
constexpr double kNearCones = 6;       // angles of a cone about which others are searched with it
constexpr int kMostOrigins = 200;
constexpr double kCosineRoundoff = 1e-15;
constexpr double kNoLength = 1e-100;   // has no direction, its square underflows
constexpr double kInside = 0.3;        // of the inner radius: where origins lie
constexpr double kNarrowerCone = 0.5;  // than the cone before, at most

// A body's pieces seen from an origin, and those that a pair has made besides.
class SeenPieces {
 public:
  explicit SeenPieces(const NearBall& body) : body_(body), known_(static_cast<int>(body.pieces.size())) {}
  // Seen from elsewhere none is known but the patches.
  void see_from(const Vec3& origin) {
    origin_ = origin;
    known_ = count_ = parted_ = 0;
    for (int k = 0; k < patches(); ++k) {
      made_.put(count_++, body_.whole(k, origin));
      work_ += size(k);
    }
  }
  int patches() const { return static_cast<int>(body_.patches.size()); }
  long work() const { return work_; }  // coefficients looked at
  const BallPiece& operator[](int k) const { return k < known_ ? body_.pieces[k] : made_[k - known_]; }
  // Number of the first of a piece's halves, or -1 where there is no more room.
  int halves(int k) {
    const BallPiece& piece = (*this)[k];
    if (piece.halves >= 0) return piece.halves;
    if (k < known_)
      for (int i = 0; i < parted_; ++i)
        if (leaf_[i] == k) return first_[i];
    if (count_ + 2 > kMostMade) return -1;
    work_ += 2 * size(piece.patch);
    BallPiece one, other;
    body_.halve(piece, origin_, &one, &other);
    const int first = known_ + count_;
    made_.put(count_++, one);
    made_.put(count_++, other);
    if (k < known_) {
      leaf_[parted_] = k;
      first_[parted_++] = first;
    } else {
      made_[k - known_].halves = first;
    }
    return first;
  }

  long size(int patch) const { return static_cast<long>(body_.patches[patch].net.size()); }

 private:
  const NearBall& body_;
  long work_ = 0;
  Vec3 origin_ = Vec3::Zero();
  int known_, count_ = 0, parted_ = 0;
  int leaf_[kMostMade / 2], first_[kMostMade / 2];  // halved, of the body's
  Room<BallPiece, kMostMade> made_;
};

// Directions within an angle, rad, of an axis, and what bounds p there.
struct Cone {
  Vec3 axis = Vec3::UnitX();
  double angle = M_PI;
  double bound = -kFarAway;
  bool meets(const Vec3& other, double sine, double cosine) const {
    if (angle >= M_PI || cosine <= 0) return true;
    const double sum = angle + std::asin(std::min(1.0, sine));
    return sum >= M_PI || other.dot(axis) >= std::cos(sum) - kCosineRoundoff;
  }
};

class NearBallSearch {
 public:
  NearBallSearch(const PairFrame& pair, double tolerance)
      : pair_(pair), tolerance_(tolerance), a_(pair.a->near_ball()), b_(pair.b->near_ball()) {}

  bool run(PolytopeResult* result) {
    evaluate(pair_.offset.norm() > kNoLength ? pair_.offset : Vec3(Vec3::UnitX()), 0);
    search(Cone());
    while (cones_ > 0) {
      const Cone next = more_[--cones_];
      if (next.bound < closed() && !is_exhausted() && origins_++ < kMostOrigins && look_along(next.axis))
        search(next);
      else
        least_ = std::min(least_, next.bound);
    }
    fill(result);
    return result->converged;
  }

 private:
  struct Open {
    double bound, spread;  // of p, and by how much p may be more where halves can tell
    double loss;           // by how much more for the origins
    int i, j;
    double sine;     // of the cone's angle
    Vec3 direction;  // where the bound is least
  };
  static bool above(const Open& x, const Open& y) { return x.bound > y.bound; }

  double closed() const { return best_ - kClosedShare * tolerance_; }

  // Directions in the cone: what is left of them waits for another origin.
  void search(const Cone& cone) {
    cone_ = cone;
    count_ = left_ = 0;
    bool room = true;
    for (int i = 0; i < a_.patches(); ++i)
      for (int j = 0; j < b_.patches() && room; ++j) room = open(i, j);
    if (!room) least_ = std::min(least_, cone.bound);  // some are not even bounded
    while (room && count_ > 0 && open_[0].bound < closed()) {
      const Open lowest = open_[0];
      std::pop_heap(open_.begin(), open_.begin() + count_, above);
      --count_;
      if (popped_++ < kAlwaysEvaluated || is_promising(lowest))
        evaluate(lowest.direction, kAsNear * lowest.sine);
      if (!(lowest.bound < closed()))
        least_ = std::min(least_, lowest.bound);
      else if (lowest.spread <= std::max(lowest.loss, kSpent * tolerance_))
        room = leave(lowest);
      else
        room = !is_exhausted() && part(lowest);
      if (!room) least_ = std::min(least_, lowest.bound);
    }
    if (count_ > 0) least_ = std::min(least_, open_[0].bound);
    gather();
  }

  bool is_exhausted() const {
    const long supports = evaluations_ * (a_.size(0) + b_.size(0)) / 2;
    return a_.work() + b_.work() + kPairWork * opened_ + supports > kMostWork;
  }
  // Whether p may well be less than it is known to be, where the bound is least.
  bool is_promising(const Open& pair) const {
    return pair.bound + kSpreadShare * (pair.spread + pair.loss) < best_ - kGain * tolerance_;
  }

  // False where there is no room left.
  bool part(const Open& pair) {
    const bool part_a = pair_.scale_a * a_[pair.i].lack >= pair_.scale_b * b_[pair.j].lack;
    const int first = part_a ? a_.halves(pair.i) : b_.halves(pair.j);
    if (first < 0) return false;
    return part_a ? open(first, pair.j) && open(first + 1, pair.j)
                  : open(pair.i, first) && open(pair.i, first + 1);
  }

  // Bounds p over the directions that are both pieces'; false where there is no room left.
  bool open(int i, int j) {
    ++opened_;
    const BallPiece &a = a_[i], &b = b_[j];
    const Vec3 axis_b = -(pair_.turn * b.axis);
    // Where the angles make less than pi together.
    if (a.cosine > -b.cosine && a.axis.dot(axis_b) < a.cosine * b.cosine - a.sine * b.sine - kCosineRoundoff)
      return true;
    const BallPiece& narrower = a.cosine > b.cosine ? a : b;
    const Vec3& axis = a.cosine > b.cosine ? a.axis : axis_b;
    if (!cone_.meets(axis, narrower.sine, narrower.cosine)) return true;
    const Vec3 g = pair_.scale_a * a.centre - (pair_.offset + pair_.scale_b * (pair_.turn * b.centre));
    const double length = g.norm(), along = axis.dot(g);
    Open made;
    made.i = i;
    made.j = j;
    made.direction = axis;
    made.sine = narrower.cosine > 0 ? narrower.sine : 1;
    made.loss = pair_.scale_a * a.loss + pair_.scale_b * b.loss;
    double least;                              // of d . g
    if (-along >= length * narrower.cosine) {  // -g is in the cone
      least = -length;
      if (length > kNoLength) made.direction = -g / length;
    } else {
      Vec3 across = g - along * axis;
      across -= axis.dot(across) * axis;  // what round-off has left along it
      const double off = across.norm();
      least = narrower.cosine * along - narrower.sine * off;
      if (off > kNoLength) made.direction = narrower.cosine * axis - narrower.sine / off * across;
    }
    made.bound = pair_.scale_a * a.radius + pair_.scale_b * b.radius - 4 * pair_.noise + least;
    made.spread = pair_.scale_a * a.lack + pair_.scale_b * b.lack + along - least;
    if (made.bound >= closed()) {
      least_ = std::min(least_, made.bound);
      return true;
    }
    if (count_ == kMostPairs) return false;
    open_[count_++] = made;
    std::push_heap(open_.begin(), open_.begin() + count_, above);
    return true;
  }

  // For another origin; false where there is no room left.
  bool leave(const Open& pair) {
    if (left_ == kMostLeft) return false;
    waits_[left_++] = pair;
    return true;
  }

  // Makes cones of the pairs that were left.
  void gather() {
    std::sort(waits_.begin(), waits_.begin() + left_,
              [](const Open& x, const Open& y) { return x.bound < y.bound; });
    while (left_ > 0) {
      const Open first = waits_[0];
      Cone cone{first.direction, 0, first.bound};
      const double near = kNearCones * first.sine;
      int kept = 0;
      for (int k = 0; k < left_; ++k) {
        const Open& pair = waits_[k];
        const double chord = (pair.direction - first.direction).norm();
        if (chord <= near && pair.sine <= near)
          cone.angle = std::max(
              cone.angle, 2 * (std::asin(std::min(1.0, 0.5 * chord)) + std::asin(std::min(1.0, pair.sine))));
        else
          waits_[kept++] = pair;
      }
      left_ = kept;
      if (cones_ < kMostCones && cone.angle <= kNarrowerCone * cone_.angle)
        more_[cones_++] = cone;
      else
        least_ = std::min(least_, cone.bound);
    }
  }

  // Moves both origins to where the bodies' supports along d are seen along it.
  bool look_along(const Vec3& d) {
    const auto look = [&](const Shape& shape, const Vec3& own, SeenPieces* pieces) {
      const Vec3 origin =
          find_hull_support(shape, own, nullptr, tolerance_).point - shape.near_ball().radius * own;
      if (!(origin.norm() < kInside * shape.inner_radius)) return false;
      pieces->see_from(origin);
      return true;
    };
    return look(*pair_.a, d, &a_) && look(*pair_.b, pair_.direction_on_b(d), &b_);
  }

  // p along a direction of any length, unless it was asked for within a chord of `near` lately.
  void evaluate(const Vec3& along, double near) {
    const Vec3 d = along.normalized();
    int nearest = -1;
    double least2 = kFarAway;
    for (int k = 0; k < std::min(evaluations_, kAsked); ++k)
      if (const double chord2 = (asked_[k].d - d).squaredNorm(); chord2 < least2)
        least2 = chord2, nearest = k;
    if (least2 <= near * near) return;
    const bool close = least2 < kStartNear * kStartNear;
    const auto [a, b] = hull_supports(pair_, d, close ? &asked_[nearest].on_a : nullptr,
                                      close ? &asked_[nearest].on_b : nullptr, tolerance_);
    asked_[evaluations_++ % kAsked] = {d, a.where, b.where};
    const double p = pair_.overlap_along(d, a.upper, b.upper);
    if (!(p < best_)) return;
    best_ = p;
    direction_ = d;
    on_a_ = a;
    on_b_ = b;
  }

  void fill(PolytopeResult* r) const {
    r->iterations = evaluations_;
    r->bracket = {-best_, std::max(-best_, -std::min(least_, best_) + pair_.noise), direction_, 0, 0};
    r->gap = -best_;
    r->converged = r->bracket.width() <= tolerance_;
    r->points = {on_a_.where, on_b_.where, pair_.place_a(on_a_.point), pair_.place_b(on_b_.point),
                 direction_,  -direction_};
    part_points(r);
  }

  const PairFrame& pair_;
  double tolerance_;
  SeenPieces a_, b_;
  long opened_ = 0;
  double best_ = kFarAway, least_ = kFarAway;
  Vec3 direction_ = Vec3::UnitX();
  Support on_a_, on_b_;
  int evaluations_ = 0, popped_ = 0, count_ = 0, left_ = 0, cones_ = 0, origins_ = 0;
  Cone cone_, more_[kMostCones];
  struct Asked {
    Vec3 d;
    SurfacePoint on_a, on_b;
  };
  std::array<Asked, kAsked> asked_;
  std::array<Open, kMostPairs> open_;  // a heap of `count_`
  std::array<Open, kMostLeft> waits_;
};

}  // namespace

bool are_near_balls(const PairFrame& pair) {
  return pair.a->near_ball().found() && pair.b->near_ball().found();
}

bool search_near_balls(const PairFrame& pair, double tolerance, PolytopeResult* result) {
  return NearBallSearch(pair, tolerance).run(result);
}

}  // namespace nurbs

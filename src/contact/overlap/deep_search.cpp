// Branch and bound over a cube map of directions; see deep_search.h.
#include "contact/overlap/deep_search.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "body/cube_map.h"
#include "contact/direction_search.h"
#include "contact/local_bend.h"
#include "contact/overlap/widen_cap.h"
#include "nurbs/wide.h"

namespace nurbs {
namespace {

constexpr int kFirstDepth = 2;      // 96 cells
constexpr int kNewtonDepth = 5;     // at which a cell that stays is looked into, and every other one below
constexpr int kSupportDepth = 6;    // from which supports are evaluated
constexpr int kBeforeWidening = 4;  // supports before a cap is widened, and between that and the next

// What may be spent.
struct Limits {
  int cells, deepest;      // halvings of a cell
  int supports, widening;  // points that caps are widened by
  int newtons, caps;
  bool capless;  // cells may do where the least minimum has no cap
};
constexpr Limits kUsual{800, 9, 28, 100, 12, 8, false}, kLast{60000, 20, 15000, 2000, 64, 32, true};
constexpr int kStretches = static_cast<int>(kStretchCaps.size()), kCaps = static_cast<int>(kInnerCaps.size());
constexpr double kLeastCap = 0.012;  // rad: about the best minimum; less would leave thousands of cells
constexpr std::array<double, 2> kWidened = {0.21, 0.42};  // rad, that caps are widened to in turn
constexpr double kAsLarge = 0.8;                          // times balls that hold less far, others serve too
constexpr double kSameBasin = 0.95;                       // cosine between a cell and a minimum of its own
constexpr double kSameLook = 0.993;                       // cosine between directions that searches begin in
constexpr double kWidestNearby = 0.4, kLeastNearby = 1e-4, kNextNearby = 0.8;  // rad: caps by W alone
constexpr double kFurthest = 0.5;        // rad, that points alone may reach ...
constexpr double kFurtherShare = 0.8;    // ... and of what they prove, so that something is left at the end
constexpr double kFromThreshold = 0.25;  // of the tolerance, between the least p found and what is proven
constexpr double kSlack = 0.02;          // of a stretch, given away for the tilt of its direction
constexpr double kCapRoundoff = 1e-7;    // rad: angles are arc cosines

// What the inner maps' caps have to reach by cells of a depth: half a cell's diagonal, and half of one of the
// atlas's.
constexpr int cap_of_depth(int depth) {
  return depth >= 5 ? 0 : 5 - depth;
}
constexpr double reach_of_depth(int depth) {
  return M_SQRT2 / (1 << depth) + M_SQRT2 / kAtlasCells;
}
static_assert(reach_of_depth(2) < kInnerCaps[3] && reach_of_depth(3) < kInnerCaps[2] &&
              reach_of_depth(4) < kInnerCaps[1] && reach_of_depth(5) < kInnerCaps[0]);

constexpr double kKeptAngle = 0.75;  // of a cap, where a proof is to outlive this step ...
constexpr double kKeptRise = 0.25;   // ... of p's rise over the cap, which cells lie above its least by

struct Cap {
  Vec3 d;
  double cosine;
  SurfacePoint on_a, on_b;  // of the minimum ...
  Mat2 turn;                // ... and W_A + W_B there, along d.unitOrthogonal() and square to it
  std::size_t widened;      // how often that was tried; kWidened.size(): no more
};

struct Grown {
  double angle, rise;  // of p above the level at the rim
};

// How far from a minimum p is proven, and least values of p and its slope there.
struct Reach {
  double angle, y, slope;
};

// One number: written as four and read as one, the stack of cells would wait for itself.
struct DirectionCell {
  std::uint64_t code;
  DirectionCell() = default;
  DirectionCell(int face, int depth, int i, int j)
      : code(static_cast<std::uint64_t>(face << 8 | depth) << 48 | static_cast<std::uint64_t>(i) << 24 |
             static_cast<std::uint64_t>(j)) {}
  int face() const { return static_cast<int>(code >> 56); }
  int depth() const { return code >> 48 & 255; }
  int i() const { return code >> 24 & 0xffffff; }
  int j() const { return code & 0xffffff; }
};
static_assert(kLast.deepest <= 24, "what a cell's number holds");

// The four corners and the middle of a cell, as D = +-axis + a * next axis + b * the one after.
struct Corners {
  int k;
  double sign, a, b;
  Lane4 at_a, at_b, length2;

  explicit Corners(const DirectionCell& c) : k(c.face() / 2), sign(c.face() % 2 ? -1 : 1) {
    const double half = 1.0 / (1 << c.depth());
    a = (2 * c.i() + 1) * half - 1;
    b = (2 * c.j() + 1) * half - 1;
    at_a = Lane4{a - half, a - half, a + half, a + half};
    at_b = Lane4{b - half, b + half, b - half, b + half};
    length2 = 1 + at_a * at_a + at_b * at_b;
  }
  // Chosen, not indexed: what is stored by one index and read by another waits.
  Vec3 middle() const { return k == 0 ? Vec3(sign, a, b) : k == 1 ? Vec3(b, sign, a) : Vec3(a, b, sign); }
  // Whether D . g >= level |D| at all four, level >= 0.
  bool above(const Vec3& g, double level) const {
    const double g0 = k == 0   ? g[0]
                      : k == 1 ? g[1]
                               : g[2],
                 g1 = k == 0   ? g[1]
                      : k == 1 ? g[2]
                               : g[0],
                 g2 = k == 0   ? g[2]
                      : k == 1 ? g[0]
                               : g[1];
    const Lane4 height = sign * g0 + g1 * at_a + g2 * at_b;
    const Mask4 below = (height < 0.0) | (height * height < level * level * length2);
    return none_of(below);
  }
};

template <const Limits& kLimits>
class DeepSearch {
 public:
  DeepSearch(const PairFrame& pair, double tolerance)
      : pair_(pair),
        inner_a_(pair.a->lazy_inner_map.known()),
        inner_b_(pair.b->lazy_inner_map.known()),
        tolerance_(tolerance),
        noise_(8 * pair.noise),
        widest_(pair.scale_a * pair.a->patch_curvature.max_radius +
                pair.scale_b * pair.b->patch_curvature.max_radius),
        dented_(pair.a->dented() || pair.b->dented()) {}

  bool run(JointSolution* best, DeepProof* proof) {
    keep_ = proof != nullptr;
    if (!serves()) return false;
    if (best->iterations > 0) consider(confirmed(*best));
    if (!first_cells() || !rest()) return false;
    finish(best);
    if (keep_) fill(proof);
    return true;
  }

  bool still_deepest(const DeepProof& proof, JointSolution* s) {
    if (!(proof.level > 0) || !serves()) return false;
    best_ = confirmed(*s);
    const double least = -best_.bracket.lower - kFromThreshold * tolerance_;
    if (!(least > tolerance_ && least <= proof.level - moved(proof) - noise_)) return false;
    threshold_ = least;
    const Vec3 before(proof.direction[0], proof.direction[1], proof.direction[2]);
    const double turned = angle_between(best_.bracket.direction, before) + kCapRoundoff;
    if (!(cap_about(best_, bend_at(best_), threshold_).angle >= proof.angle + turned)) return false;
    finish(s);
    return s->converged;
  }

 private:
  // DirectionAtlas::nearest, of an atlas of known size.
  static const InnerNode& nearest(const InnerMap& map, int face, double a, double b) {
    constexpr double kHalf = 0.5 * kAtlasCells;
    const int i = static_cast<int>(a * kHalf + (kHalf + 0.5)),
              j = static_cast<int>(b * kHalf + (kHalf + 0.5));
    return map.nodes[(face * (kAtlasCells + 1) + i) * (kAtlasCells + 1) + j];
  }
  static const InnerNode& nearest(const InnerMap& map, const Vec3& d) {
    const CubePoint c = to_cube(d);
    return nearest(map, c.face, c.a, c.b);
  }

  bool serves() const { return !inner_a_.nodes.empty() && !inner_b_.nodes.empty(); }
  // What cells, and caps about all minima but the least, are proven to lie above.
  double level() const { return threshold_ + margin_; }

  // By how much p may have changed, for any direction.
  double moved(const DeepProof& proof) const {
    const Quat q(pair_.turn);
    const Quat then(proof.turn[0], proof.turn[1], proof.turn[2], proof.turn[3]);
    const double apart = std::min((q.coeffs() - then.coeffs()).norm(), (q.coeffs() + then.coeffs()).norm());
    const Vec3 offset(proof.offset[0], proof.offset[1], proof.offset[2]);
    return (pair_.offset - offset).norm() + 2 * pair_.scale_b * pair_.b->bounding_radius * apart;
  }

  void fill(DeepProof* proof) const {
    const Quat q(pair_.turn);
    const Vec3& d = best_.bracket.direction;
    *proof = {{d[0], d[1], d[2]},
              kept_.angle,
              margin_ > 0 ? level() : 0,
              {pair_.offset[0], pair_.offset[1], pair_.offset[2]},
              {q.w(), q.x(), q.y(), q.z()}};
  }

  // Of two nodes, cut to the level in sum, and what they leave of it.
  struct Radii {
    double a, b, level;
  };
  Radii radii(const InnerNode& a, const InnerNode& b, int cap) const {
    const double ra = pair_.scale_a * a.radius[cap], rb = pair_.scale_b * b.radius[cap],
                 level = this->level();
    const double share = std::min(1.0, level / (ra + rb));
    return {share * ra, share * rb, std::max(0.0, level - share * (ra + rb))};
  }

  // Whether all directions of a cell have p >= level().
  bool excluded(const DirectionCell& cell, const Corners& corners) const {
    for (int k = 0; k < caps_; ++k)
      if (corners.above(cap_[k].d, cap_[k].cosine)) return true;
    const Vec3 middle = corners.middle();
    const InnerNode &a = nearest(inner_a_, cell.face(), corners.a, corners.b),
                    &b = nearest(inner_b_, pair_.direction_on_b(middle));
    const Radii r = radii(a, b, cap_of_depth(cell.depth()));
    const Vec3 g = pair_.scale_a * a.point - r.a * a.normal -
                   (pair_.offset + pair_.turn * (pair_.scale_b * b.point - r.b * b.normal));
    return corners.above(g, r.level + noise_);
  }

  // The same from the supports along the cell's middle, for cells so small that the nodes are far off.
  bool excluded_by_supports(const DirectionCell& cell, const Corners& corners) {
    if (++supports_ > kLimits.supports) return false;
    const Vec3 middle = corners.middle(), d = middle.normalized(), on_b = pair_.direction_on_b(d);
    const Radii r = radii(nearest(inner_a_, d), nearest(inner_b_, on_b), cap_of_depth(cell.depth()));
    const auto [a, b] = hull_supports(pair_, d, nullptr, nullptr, tolerance_);
    const Vec3 g =
        pair_.place_a(a.point) - r.a * a.normal - pair_.place_b(b.point) + r.b * (pair_.turn * b.normal);
    return corners.above(g, r.level + noise_);
  }

  // Newton from where the atlases have the supports along a direction (of any length). False where the search
  // can't go on.
  bool look(const Vec3& d) {
    if (newtons_ == kLimits.newtons) return false;
    looked_[newtons_++] = d.normalized();
    const Shape &a = *pair_.a, &b = *pair_.b;
    return go_from(a.atlas.place(d), b.atlas.place(pair_.direction_on_b(d)));
  }

  bool go_from(const SurfacePoint& on_a, const SurfacePoint& on_b) {
    const JointSolution s = solve_joint(pair_, on_a, on_b, tolerance_, kFarAway, kPolishIterations);
    iterations_ += s.iterations;
    return !(s.stationary || s.converged) || consider(confirmed(s));
  }

  // From a cell's middle. Newton may go uphill, to a maximum or a saddle: then from the supports along the
  // lowest direction that the atlases see downhill.
  bool look_around(const Vec3& d) {
    const int caps = caps_;
    if (!look(d)) return false;
    if (caps_ > caps && cap_[caps].d.dot(d) > kSameBasin) return true;
    const Vec3 lower = refine_guess(pair_, {d, atlas_overlap(pair_, d)}).d;
    const auto [a, b] = hull_supports(pair_, lower, nullptr, nullptr, tolerance_);
    return go_from(a.where, b.where);
  }

  // With the hulls' supports along its normal where dents may hide others, at points right to round-off.
  JointSolution confirmed(const JointSolution& s) const {
    if (!dented_) return s;
    JointSolution again =
        solve_joint(pair_, s.points.on_a, s.points.on_b, tolerance_, kFarAway, kPolishIterations);
    confirm_lower(pair_, tolerance_, &again);
    again.iterations += s.iterations;
    return again;
  }

  // Takes a local minimum: lowers the threshold to it if it is the least, makes a cap. False where it is the
  // least and has none.
  bool consider(const JointSolution& s) {
    const double least = -s.bracket.lower - kFromThreshold * tolerance_;
    const bool lowest = least < threshold_;
    if (!(least > tolerance_)) return closed_ = false;  // not deep
    const double rival = lowest ? threshold_ : least;
    if (lowest) {
      threshold_ = least;
      best_ = s;
    }
    margin_ = std::min(margin_, rival - threshold_);
    const Vec3& d = s.bracket.direction;
    for (int k = 0; k < caps_; ++k)
      if (d.dot(cap_[k].d) > 1 - 0.5 * kLeastCap * kLeastCap) return true;
    const LocalBend local = bend_at(s);
    Cap cap{d, 1, s.base_a, s.base_b, local.turn, local.reach > 0 ? 0 : kWidened.size()};
    const double level = lowest ? threshold_ : this->level();
    Grown grown = cap_about(s, local, level);
    if (grown.angle < kLeastCap)
      grown = {widened(cap, std::max(grown.angle, held(s, level)), kWidened[0], level), 0};
    if (lowest) {
      closed_ = grown.angle >= kLeastCap;
      best_cap_ = caps_;
      kept_ = grown;
      if (keep_ && grown.rise > 0 && kKeptAngle * grown.angle >= kLeastCap) {
        margin_ = std::min(rival - threshold_, kKeptRise * grown.rise);
        grown.angle *= kKeptAngle;
        whole_ = kept_.angle;
        kept_ = grown;
      }
    }
    if (grown.angle < kLeastCap) return !lowest || kLimits.capless;
    if (caps_ == kLimits.caps) return false;
    cap.cosine = std::cos(grown.angle);
    cap_[caps_++] = cap;
    return true;
  }

  // How far a minimum's points overlap by a level.
  double held(const JointSolution& s, double level) const {
    const Vec3 &d = s.bracket.direction, g = s.jet_a.at(JetLanes::kS) - s.jet_b.at(JetLanes::kS);
    const double y = d.dot(g), room = y - level - noise_, falls = (g - y * d).norm() + noise_;
    return room > 0 ? 2 * room / (falls + std::sqrt(falls * falls + 2 * y * room)) : 0;
  }

  // A cap widened by points from `proven` on, with the balls of the inner maps as far as they hold.
  double widened(const Cap& cap, double proven, double wanted, double level) {
    if (!(proven > 0) || cap.widened == kWidened.size()) return proven;
    const Vec3 &d = cap.d, t = d.unitOrthogonal(), on_b = pair_.direction_on_b(d);
    const CappedMinimum minimum{d, t, d.cross(t), cap.on_a, cap.on_b, cap.turn, level, tolerance_};
    const InnerNode &a = nearest(inner_a_, d), &b = nearest(inner_b_, on_b);
    const double off = this->off(d, on_b, a.normal, b.normal);
    CapBalls balls[kCaps + 1];  // none at last
    for (int k = 0; k < kCaps; ++k)
      balls[k] = {pair_.scale_a * a.radius[k], pair_.scale_b * b.radius[k], kInnerCaps[k] - off};
    for (int k = 0; k <= kCaps; ++k)
      if (balls[k].valid >= wanted || balls[k + 1].sum() <= kAsLarge * balls[k].sum())
        proven = widen_cap(pair_, minimum, balls[k], proven, wanted, kLimits.widening, &widening_);
    return proven;
  }

  // The cap nearest to a direction; whether it is wider now.
  bool widen_nearest(const Vec3& d) {
    if (caps_ == 0) return false;
    Cap* near = std::max_element(cap_, cap_ + caps_,
                                 [&](const Cap& a, const Cap& b) { return d.dot(a.d) < d.dot(b.d); });
    const double angle = std::acos(near->cosine);
    while (near->widened < kWidened.size()) {
      const double wider = widened(*near, angle, kWidened[near->widened], level());
      ++near->widened;
      if (!(wider > angle)) continue;
      near->cosine = std::cos(wider);
      return true;
    }
    return false;
  }

  // Goes on without a margin for the steps to come; false where there was none.
  bool give_up_margin() {
    if (!(margin_ > 0)) return false;
    margin_ = 0;
    cap_[best_cap_].cosine = std::cos(whole_);
    return true;
  }

  // By how much a direction is off two others, one of each body's, at most.
  static double off(const Vec3& d, const Vec3& on_b, const Vec3& near_d, const Vec3& near_on_b) {
    return std::acos(std::min(1.0, std::min(d.dot(near_d), on_b.dot(near_on_b)))) + kCapRoundoff;
  }

  // How far from a stationary direction p is proven to be at least a level.
  Grown cap_about(const JointSolution& s, const LocalBend& local, double level) const {
    const Vec3& d = s.bracket.direction;
    const Vec3 g = s.jet_a.at(JetLanes::kS) - s.jet_b.at(JetLanes::kS), on_b = pair_.direction_on_b(d);
    const InnerNode &na = nearest(inner_a_, d), &nb = nearest(inner_b_, on_b);
    const int cell_a = InnerMap::cell(d), cell_b = InnerMap::cell(on_b);
    const InnerStretch &sa = inner_a_.stretches[cell_a], &sb = inner_b_.stretches[cell_b];
    const double off_node = off(d, on_b, na.normal, nb.normal),
                 off_stretch = off(d, on_b, InnerMap::middle(cell_a), InnerMap::middle(cell_b));
    const double y0 = d.dot(g), angle = std::sqrt(s.bracket.angle2) + kPoleNormal;
    double falls = (g - y0 * d).norm();
    falls +=
        (angle < local.reach ? std::min(widest_, local.turn.trace() + local.rate * angle) : widest_) * angle;
    const auto widen = [&](Reach at) {
      for (int n = 0; n < kStretches + kCaps; ++n) {
        // Over the stretches' caps, then the radii's; each by the narrowest that reach as far.
        const double to =
            n < kStretches ? kStretchCaps[n] - off_stretch : kInnerCaps[n - kStretches] - off_node;
        const double step = to - at.angle;
        if (!(step > 0)) continue;
        int k = 0, r = 0;
        while (k < kStretches && kStretchCaps[k] - off_stretch < to) ++k;
        while (r < kCaps && kInnerCaps[r] - off_node < to) ++r;
        double m = 0;
        if (k < kStretches) m = stretched(d, to, k, sa, sb);
        if (r < kCaps) m = std::max(m, pair_.scale_a * na.radius[r] + pair_.scale_b * nb.radius[r]);
        // y'' + y = m. Falling, it has its least value where it turns; rising at first, at an end.
        const double above = at.y - m, slope = at.slope;
        const double end = m + above * std::cos(step) + slope * std::sin(step);
        const double least = slope < 0 ? m - std::hypot(above, slope) : std::min(at.y, end);
        if (!((slope >= 0 || above < 0) && least >= level + noise_)) break;
        at = {to, end, slope * std::cos(step) - above * std::sin(step)};
        if (at.slope < 0) break;
      }
      return at;
    };
    const Reach from = nearby({0, y0, -falls}, local, level);
    // Over dents another point may be the support from some angle on: no slope is known then but at d itself,
    // where what the points lack of the supports, l, takes it down by no more than sqrt(2 l m), and where the
    // points themselves are followed.
    const double lack = dented_ ? -s.bracket.lower - y0 : 0,
                 most = local.reach > 0 ? local.turn.trace() : kFarAway;
    Reach best = widen({0, y0, lack > 0 ? -falls - std::sqrt(2 * lack * most) : -falls});
    const Reach other = from.angle == 0 ? from : dented_ ? go_on(from, level) : widen(from);
    if (other.angle > best.angle) best = other;
    return {best.angle, best.y - level};
  }

  // On, by the points that lie there alone: p is at least their distance, y'' + y = 0. Not as far as that
  // comes down to the level again, so that cells there may lie above it.
  Reach go_on(const Reach& at, double level) const {
    const double most = std::hypot(at.y, at.slope), least = level + noise_;
    if (!(at.slope > 0 && most > least)) return at;
    const double turn = std::atan2(at.slope, at.y),
                 further = std::min(kFurtherShare * (turn + std::acos(least / most)), kFurthest);
    return {at.angle + further, most * std::cos(turn - further), -most * std::sin(further - turn)};
  }

  // From the start, d, by W at the points themselves and its rate, as far as that is known: for all t up to
  // the angle returned (0: none) y'' + y = m - rho t stays above the level,
  //     y >= y0 + s t + (m - y0) (1 - cos t) - rho t^3 / 6.
  Reach nearby(const Reach& start, const LocalBend& local, double level) const {
    const double m = extremes(local.turn).least, y0 = start.y, room = y0 - level - noise_;
    if (!(room > 0)) return {0, 0, 0};
    for (double to = local.reach; to >= kLeastNearby; to *= kNextNearby) {
      const double rise = m > y0 ? 1 - to * to / 12 : 1, bend = 0.5 * rise * (m - y0) - local.rate * to / 6;
      if (!stays_above(room, -start.slope, bend, to)) continue;
      const double c = std::cos(to), sine = std::sin(to);
      return {to, y0 * c + start.slope * sine + m * (1 - c) - local.rate * to * to * to / 6,
              (m - y0) * sine + start.slope * c - local.rate * to * to / 2};
    }
    return {0, 0, 0};
  }

  // Of both bodies together, along d.unitOrthogonal() and square to it.
  LocalBend bend_at(const JointSolution& s) const {
    const Vec3 &d = s.bracket.direction, t = d.unitOrthogonal(), u = d.cross(t);
    const LocalBend a = local_bend(*pair_.a, pair_.scale_a, s.base_a, s.jet_a, d, t, u),
                    b = local_bend(*pair_.b, pair_.scale_b, s.base_b, s.jet_b, -d, t, u);
    return {a.turn + b.turn, a.rate + b.rate, std::min({a.reach, b.reach, kWidestNearby})};
  }

  // Least eigenvalue of W_A + W_B within `angle` of d. For a unit v square to a direction there, v = cos e u
  // + sin e d with u square to d and |e| <= angle, so |f . v| >= cos(angle) |f . u| - sin(angle) |f . d|.
  double stretched(const Vec3& d, double angle, int k, const InnerStretch& a, const InnerStretch& b) const {
    const Vec3 fa(a.along[0], a.along[1], a.along[2]);
    const Vec3 fb = pair_.turn * Vec3(b.along[0], b.along[1], b.along[2]);
    const double c2 = std::cos(angle) * std::cos(angle), s2 = 1 - c2;
    const double most_a = pair_.scale_a * a.most[k], most_b = pair_.scale_b * b.most[k];
    const double ta = d.dot(fa), tb = d.dot(fb);
    const double lost = (1 / kSlack - 1) * s2 * (most_a * ta * ta + most_b * tb * tb);
    const double wa = (1 - kSlack) * c2 * most_a, wb = (1 - kSlack) * c2 * most_b;
    const double half = 0.5 * (wa * (fa.squaredNorm() - ta * ta) + wb * (fb.squaredNorm() - tb * tb));
    const double across = d.dot(fa.cross(fb)), det = wa * wb * across * across;
    const double least = half - std::sqrt(std::max(0.0, half * half - det));
    return pair_.scale_a * a.least[k] + pair_.scale_b * b.least[k] + least - lost;
  }

  // The coarse cells; the lowest of those that stay is looked into first.
  bool first_cells() {
    constexpr int n = 1 << kFirstDepth;
    DirectionGuess lowest{Vec3::Zero(), threshold_};
    for (int face = 0; face < 6; ++face)
      for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j) {
          const DirectionCell cell{face, kFirstDepth, i, j};
          const Corners corners(cell);
          if (threshold_ < kFarAway && excluded(cell, corners)) continue;
          cell_[count_++] = cell;
          const Vec3 d = corners.middle().normalized();
          const double p = atlas_overlap(pair_, d);
          if (p < lowest.p) lowest = {d, p};
        }
    cells_ = 6 * n * n;
    if (lowest.d.squaredNorm() > 0) look(refine_guess(pair_, lowest).d);
    if (!closed_ && threshold_ < kFarAway) leave_saddle();
    return closed_ || (kLimits.capless && threshold_ < kFarAway);
  }

  // Downhill from what is stationary and no minimum.
  void leave_saddle() {
    const Vec3 d = best_.bracket.direction;
    const Vec3 t = d.unitOrthogonal(), u = d.cross(t);
    const LocalBend local = bend_at(best_);
    const double least = extremes(local.turn).least, p = threshold_;
    if (!(local.reach > 0 && least < p)) return;
    const Vec2 axis = least_axis(local.turn, least);
    for (const double step : {0.1, -0.1, 0.3, -0.3})
      if (!look(d + step * (axis[0] * t + axis[1] * u)) || threshold_ < p) return;
  }

  bool rest() {
    while (count_ > 0) {
      if (++cells_ > kLimits.cells) return false;
      const DirectionCell cell = cell_[--count_];
      const Corners corners(cell);
      if (excluded(cell, corners)) continue;
      if (cell.depth() >= kNewtonDepth && (cell.depth() - kNewtonDepth) % 2 == 0 && may_look() &&
          is_new(cell, corners)) {
        const int caps = caps_;
        const double threshold = threshold_;
        if (!look_around(corners.middle().normalized())) return false;
        if ((caps_ > caps || threshold_ < threshold) && excluded(cell, corners)) continue;
      }
      if (cell.depth() >= kSupportDepth) {
        if (supports_ >= next_widening_) {
          next_widening_ = supports_ + kBeforeWidening;
          if (widen_nearest(corners.middle().normalized()) && excluded(cell, corners)) continue;
        }
        if (excluded_by_supports(cell, corners)) continue;
      }
      if (cell.depth() == kLimits.deepest) {
        if (give_up_margin() && excluded(cell, corners)) continue;
        return false;
      }
      const int depth = cell.depth() + 1, i = 2 * cell.i(), j = 2 * cell.j(), i1 = i + 1, j1 = j + 1;
      cell_[count_++] = DirectionCell(cell.face(), depth, i, j);
      cell_[count_++] = DirectionCell(cell.face(), depth, i, j1);
      cell_[count_++] = DirectionCell(cell.face(), depth, i1, j);
      cell_[count_++] = DirectionCell(cell.face(), depth, i1, j1);
    }
    return true;
  }

  // Where cells may not do without, it ends when no search is left.
  bool may_look() const { return !kLimits.capless || newtons_ < kLimits.newtons; }

  // Where no search has begun; of large cells those twice as far from every minimum as its cap reaches.
  bool is_new(const DirectionCell& cell, const Corners& corners) const {
    const Vec3 d = corners.middle().normalized();
    for (int k = 0; k < caps_ && cell.depth() == kNewtonDepth; ++k)
      if (1 - d.dot(cap_[k].d) < 4 * (1 - cap_[k].cosine)) return false;
    for (int k = 0; k < newtons_; ++k)
      if (d.dot(looked_[k]) > kSameLook) return false;
    return true;
  }

  void finish(JointSolution* best) const {
    const int spent = best->iterations + iterations_;
    *best = best_;
    best->iterations = spent;
    best->bracket.upper = -threshold_ + noise_;
    best->converged = best->bracket.width() <= tolerance_;
    best->gap = std::clamp(best->gap, best->bracket.lower, best->bracket.upper);
  }

  const PairFrame& pair_;
  const InnerMap &inner_a_, &inner_b_;
  const double tolerance_, noise_;
  const double widest_;  // sum of the bodies' largest curvature radii
  const bool dented_;
  double threshold_ = kFarAway, margin_ = 0;
  bool keep_ = false;    // the proof is to outlive this step
  bool closed_ = false;  // the least minimum found has a cap, this one
  int best_cap_ = 0;
  double whole_ = 0;  // its angle before it was cut for the steps to come
  Grown kept_{0, 0};
  JointSolution best_;
  int caps_ = 0, count_ = 0, cells_ = 0, newtons_ = 0, supports_ = 0, next_widening_ = kBeforeWidening,
      widening_ = 0, iterations_ = 0;
  Cap cap_[kLimits.caps];
  Vec3 looked_[kLimits.newtons];  // where searches began
  DirectionCell cell_[6 * (1 << kFirstDepth) * (1 << kFirstDepth) + 4 * kLimits.deepest];
};

}  // namespace

bool search_deep(const PairFrame& pair, double tolerance, JointSolution* best, DeepProof* proof,
                 DeepEffort effort) {
  if (effort == DeepEffort::last) return DeepSearch<kLast>(pair, tolerance).run(best, proof);
  return DeepSearch<kUsual>(pair, tolerance).run(best, proof);
}

bool still_deepest(const PairFrame& pair, double tolerance, const DeepProof& proof, JointSolution* s) {
  return DeepSearch<kUsual>(pair, tolerance).still_deepest(proof, s);
}

}  // namespace nurbs

// The search over directions on a growing hull of the configuration space obstacle; see polytope.h.
#include "contact/polytope.h"

#include <array>
#include <cmath>
#include <new>
#include <type_traits>

#include "body/cube_map.h"
#include "body/hull_point.h"
#include "contact/ball_hull_search.h"
#include "contact/cell_search.h"
#include "contact/growing_hull.h"
#include "contact/local_bend.h"
#include "contact/ring_search.h"
#include "contact/segment_search.h"

namespace nurbs {
namespace {

// Room for many, each made when it is put there.
template <class T, int N>
class Room {
  static_assert(std::is_trivially_destructible_v<T>);

 public:
  T& put(int k, const T& value) { return *new (bytes_ + k * sizeof(T)) T(value); }
  T& operator[](int k) { return *std::launder(reinterpret_cast<T*>(bytes_ + k * sizeof(T))); }
  const T& operator[](int k) const {
    return *std::launder(reinterpret_cast<const T*>(bytes_ + k * sizeof(T)));
  }

 private:
  alignas(T) unsigned char bytes_[N * sizeof(T)];
};

// What the hull's point of the same number came from.
struct Witness {
  Vec3 a, b;  // of the shrunk bodies
  Vec3 d;     // asked
  double p;   // upper bound of the overlap along it
  HullPlace on_a, on_b;
  bool cap;  // no point of the obstacle: see Search::cover
};

// Directions within `proven` of d have an overlap (of the cores) of at least `level`; those within `used` of
// it are given away to the hull's point `vertex`.
struct Cap {
  Vec3 d;
  double level;
  double proven, used;  // cosines
  double slope;         // of the overlap at d, at most
  int vertex, from;     // the minimum's own
};

// What is known of a body's inverse Weingarten maps W about a direction: from the support's, and balls.
struct Bend {
  LocalBend local;
  double least = 0;                                           // eigenvalue of its turn
  std::array<double, kInnerCaps.size()> ball{}, within{};     // radius for directions within an angle of d
  std::array<double, kStretchCaps.size()> stretch{}, near{};  // the same from finer cells
};

constexpr int kPaceFrom = 384, kPaceStep = 128;  // points at which the bracket's width is looked at
constexpr double kThinnest = 1e-12;              // of the larger body: heights of points' hulls
constexpr int kPointAttempts = 2;                // flat differences of points may have no hull
constexpr double kNearStart = 0.9995;            // cosine between directions nearer than the atlas's
constexpr int kBeforeRings = 64;                 // queries before rings of directions are looked for
constexpr int kBentBeforeRings = 95;             // ... of bodies without sharp edges, which caps may do for
constexpr int kAtPoles = 256;                    // ... and where the least overlap is along an axis
constexpr double kPolar = 0.1;                   // sine of the angle from it
constexpr int kMostIdle = 30;                    // queries in a row that leave the bracket as it is
constexpr double kOneMinimum = 1 - 1e-6;         // cosine above which Newton has come to one minimum again
constexpr double kFlatBend = 1e-3;               // of the overlap, of its bend along a crease
constexpr double kCapDepth = 0.4;  // of the tolerance, that a cap proves less than the least overlap
constexpr double kCapUsed = 0.8;   // of a cap's angle: the rest is for lower minima found later
constexpr double kWidestCap = 0.42, kLeastCap = 1e-4, kNextCap = 0.75;  // rad
constexpr double kPlaneBeyond = 4;     // times the least distance, squared: no triangle in it is nearer
constexpr double kFacing = 1e-6;       // of the smaller body: witnesses may be off each other by
constexpr double kFacingBetter = 0.1;  // of that, that better ones are to be off
constexpr int kMostFacing = 96;        // points spent on better ones
constexpr double kOffNormal = 1e-6;    // rad, given away for round-off
// A cap whose bodies are cut to their cores about it, below.
constexpr double kOffSupport = 1e-4;  // rad
constexpr int kBeforeCores = 96;      // points before that is tried ...
constexpr int kBetweenCores = 96;     // ... and again
constexpr double kSameBasin = 0.97;   // cosine
constexpr double kCoreDepth = 0.98;   // of the overlap
constexpr int kCorePoints = 320;      // spent on one
constexpr int kRim = 8;               // points that give away what is outside
constexpr double kWorthCores = 0.6;   // of the points that the minimum would cost without
constexpr std::array<double, 8> kCoreCaps = {0.4, 0.25, 0.16, 0.11, 0.075, 0.048, 0.03, 0.015};  // rad

// Brackets that close do so geometrically, if late; those that lose a power of the points only, as along flat
// valleys, are far from closed when the hull is full.
class Pace {
 public:
  bool is_hopeless(int points, double width, double tolerance) {
    if (points < next_) return false;
    const double rate = width / before_, steps = double(kHullVertices - points) / kPaceStep;
    const bool hopeless = before_ < kFarAway && width * std::pow(rate, steps) > tolerance;
    before_ = width;
    next_ = points + kPaceStep;
    return hopeless;
  }

 private:
  int next_ = kPaceFrom;
  double before_ = kFarAway;
};

// That of the points along the normal. Where the bracket stayed open, the least overlap seen: the hull errs
// to first order, the direction to second.
void set_gap(PolytopeResult* r) {
  const double apart = r->points.na.dot(r->points.b - r->points.a);
  r->gap = r->converged ? std::clamp(apart, r->bracket.lower, r->bracket.upper) : r->bracket.lower;
  part_points(r);
}

// Everything the search over directions keeps.
class Search {
 public:
  // `points`: of two sphero-polyhedra nothing else is left.
  Search(const PairFrame& pair, double tolerance, double joggle, bool points)
      : pair_(pair),
        tolerance_(tolerance),
        joggle_(joggle),
        points_a_(hull_points(*pair.a, pair.scale_a, tolerance)),
        points_b_(hull_points(*pair.b, pair.scale_b, tolerance)),
        error_(pair.scale_a * points_a_.error() + pair.scale_b * points_b_.error()),
        hull_(kSliver * pair.reach) {
    shrink_a_ = PairFrame::rolling_ball(*pair.a, pair.scale_a, tolerance);
    shrink_b_ = PairFrame::rolling_ball(*pair.b, pair.scale_b, tolerance);
    points_ = points && PairFrame::is_swept(*pair.a, pair.scale_a, tolerance) &&
              PairFrame::is_swept(*pair.b, pair.scale_b, tolerance);
    if (points_) {
      // The hull is their points' difference's, as exact as they are.
      shrink_a_ = pair.scale_a * pair.a->core.radius;
      shrink_b_ = pair.scale_b * pair.b->core.radius;
      shrink_ = shrink_a_ + shrink_b_;
      return;
    }
    (shrink_a_ < shrink_b_ ? shrink_a_ : shrink_b_) *= kCoreShare;
    shrink_ = shrink_a_ + shrink_b_;
  }

  // About the minimum at point `from` of another search, with cores that are those of the bodies for
  // directions within `valid` of it.
  Search(const Search& whole, int from, double valid, double shrink_a, double shrink_b)
      : pair_(whole.pair_),
        tolerance_(whole.tolerance_),
        joggle_(0),
        shrink_a_(shrink_a),
        shrink_b_(shrink_b),
        shrink_(shrink_a + shrink_b),
        points_a_(whole.points_a_),
        points_b_(whole.points_b_),
        error_(whole.error_),
        valid_(valid),
        middle_(whole.witness_[from].d),
        hull_(kSliver * whole.pair_.reach) {
    query(middle_, -1);
    witness_[0].on_a = whole.witness_[from].on_a;
    witness_[0].on_b = whole.witness_[from].on_b;
  }

  // The angle about the middle within which every direction is proven to have an overlap (of the cores) of
  // `level`, or 0; lowers that where it finds less. Directions d' with d' . G >= level for one of the points
  // G of the rim are given away; those are none within the angle, and all that are not within `valid`.
  double prove(double* level) {
    // A support that lacks a share of the tolerance belongs to a direction that is a little off.
    const double valid = valid_ - kOffSupport, angle = std::cos(M_PI / kRim) * valid * (1 - kOffNormal),
                 inner = 0.5 * angle, far = *level / std::sin(angle - inner), least = 0.9 * *level;
    const Vec3 t = middle_.unitOrthogonal(), s = middle_.cross(t);
    const auto give_away = [&](const Vec3& g) {
      witness_.put(hull_.points(), witness_[0]).cap = true;
      hull_.store(g);
    };
    for (int k = 0; k < kRim; ++k) {
      const double azimuth = 2 * M_PI * k / kRim;
      give_away(far * (std::cos(inner) * (std::cos(azimuth) * t + std::sin(azimuth) * s) -
                       std::sin(inner) * middle_));
    }
    give_away(-2 * *level * middle_);
    Vec3 across;
    if (!start_from_points(0, &across)) return 0;
    surround(0, 0);
    const double narrow = std::cos(valid);
    while (hull_.points() < kCorePoints) {
      *level = std::min(*level, -lower_ - kCapDepth * tolerance_ - shrink_);
      if (!(*level > least)) return 0;
      const int near = best_face();
      if (near < 0) return 0;
      if (near_ >= *level + roundoff()) return inner + std::asin(*level / far) * (1 - kOffNormal);
      if (!(direction_to_ask_.dot(middle_) > narrow)) return 0;
      const int v = query(direction_to_ask_, closest_of(hull_.face(near), direction_to_ask_));
      if (v < 0 || hull_.grow(v, least_height(), near) != GrowingHull::Growth::grown) return 0;
    }
    return 0;
  }

  // What is known of the gap besides.
  void bound(double upper) { upper_ = upper; }

  // Builds the first solid: along the seed and three directions that make a tetrahedron with it; while those
  // are flat, across the triangle (or the line) that they make.
  bool start(const Vec3& seed) {
    const Vec3 d = seed.squaredNorm() > 0 ? Vec3(seed.normalized()) : Vec3(Vec3::UnitX());
    const Vec3 t = d.unitOrthogonal(), s = d.cross(t);
    query(d, -1);
    for (const double angle : {0.0, 2.0943951023931953, 4.1887902047863905}) {
      const Vec3 beside = -d / 3 + 0.9428090415820634 * (std::cos(angle) * t + std::sin(angle) * s);
      take(beside, points_a_.near(beside), points_b_.near(pair_.direction_on_b(beside)));
    }
    for (int round = 0; round < kFlatRounds; ++round) {
      Vec3 across;
      // Points alone may be flat, and no hull of theirs any bound: balls are left on them then.
      const bool any = round + 1 == kFlatRounds && !points_;
      const double least = any ? 0 : round < kNeedleRound ? kFlatStart : kNeedleStart;
      if (start_from_points(least, &across)) return true;
      query(across, -1);
      query(-across, -1);
    }
    return false;
  }

  // Until `most` points are spent. May be gone on with.
  void run(double enough, int most) {
    settle(best_);
    double last = kFarAway, near_before = -kFarAway;
    Pace pace;
    std::array<short, 3> asked = {-1, -1, -1};
    Vec3 asked_along = Vec3::Zero();
    for (int idle = 0; hull_.points() < most; ++idle) {
      if (lower_caps_) lower_caps();
      const int near = best_face();
      if (near < 0 || upper_ - lower_ <= tolerance_ || lower_ > enough) return;
      if (!hopeless_ && pace.is_hopeless(hull_.points(), upper_ - lower_, tolerance_)) {
        hopeless_ = true;  // once
        return;
      }
      if (upper_ - lower_ < last || near_ > near_before) idle = 0;
      last = upper_ - lower_;
      near_before = std::max(near_, near_before);
      const std::array<short, 3> corners = hull_.face(near).vertex;
      // A face that outlives its own support never goes, unless its edge was asked and the other face went.
      if (idle > kMostIdle || (corners == asked && direction_to_ask_ == asked_along)) {
        stalled_ = true;
        return;
      }
      asked = corners;
      asked_along = direction_to_ask_;
      const int v = query(direction_to_ask_, closest_of(hull_.face(near), direction_to_ask_));
      if (v < 0 || upper_ - lower_ <= tolerance_) return;
      GrowingHull::Growth growth = hull_.grow(v, least_height(), near);
      // Beyond a needle's edge a point is hardly above either face.
      if (growth == GrowingHull::Growth::inside) growth = hull_.grow(v, 0.25 * roundoff(), near);
      if (growth != GrowingHull::Growth::grown) {
        stalled_ = true;
        return;
      }
      if (!points_ && hull_.points() >= before_cores_) {
        before_cores_ = hull_.points() + kBetweenCores;
        cover_by_cores();
      }
      const bool low = witness_[v].p + lower_ <= kPolishAbove * std::abs(lower_);
      if (!(low && settle(v)) && balances_ < kMostBalances) balance(corners, v);
    }
  }

  // Leaves minima alone: where a support's points lie close together (a small body on a crease), rings of
  // more of them break the hull.
  void let_be() {
    minima_ = kMostMinima;
    balances_ = kMostBalances;
  }

  bool only_points() const { return points_; }
  // Whether round-off ended the search, so that other directions may do better.
  bool stalled() const { return stalled_; }
  // Whether it was ended because its bracket would not close; it may be gone on with.
  bool hopeless() const { return hopeless_; }

  // What is known so far, without the contact points.
  PolytopeResult bracket() const {
    PolytopeResult r;
    r.iterations = queries_;
    r.bracket.lower = lower_;
    r.bracket.upper = std::max(upper_, lower_);
    r.converged = upper_ - lower_ <= tolerance_;
    r.bracket.direction = direction_;
    return r;
  }

  // Ends the search: the hull may be made again for the points.
  PolytopeResult result() {
    Vec3 a, b;
    find_witness(&a, &b);
    return with_points(a, b);
  }

  // Points for a bracket that was closed by other means.
  bool find_points(PolytopeResult* r) {
    lower_ = r->bracket.lower;
    upper_ = r->bracket.upper;
    direction_ = r->bracket.direction;
    if (!start(direction_)) return false;
    Vec3 a, b;
    refine_pair(&a, &b);
    const int spent = r->iterations;
    *r = with_points(a, b);
    r->iterations += spent;
    return r->converged;
  }

 private:
  PolytopeResult with_points(const Vec3& a, const Vec3& b) const {
    PolytopeResult r = bracket();
    r.points.na = direction_;
    r.points.nb = -direction_;
    const Witness& w = witness_[best_];
    // Onto the planes of the supports: means of others lie a little inside.
    r.points.a = a + (direction_.dot(w.a - a) + shrink_a_) * direction_;
    r.points.b = b + (direction_.dot(w.b - b) - shrink_b_) * direction_;
    r.points.on_a = surface_place(*pair_.a, w.on_a, direction_);
    r.points.on_b = surface_place(*pair_.b, w.on_b, pair_.direction_on_b(direction_));
    set_gap(&r);
    return r;
  }

  static HullPoints hull_points(const Shape& shape, double scale, double tolerance) {
    return HullPoints(shape, kSupportShare * tolerance / scale, kCoreError * tolerance / scale);
  }
  // On the patches: where to begin the next time, no more.
  static SurfacePoint surface_place(const Shape& shape, const HullPlace& at, const Vec3& d) {
    return at.on_surface.patch >= 0 ? at.on_surface : find_hull_support(shape, d, nullptr, kFarAway).where;
  }
  double roundoff() const { return kRoundoff * pair_.reach + 2 * joggle_ + error_; }
  // A point less high above a face than this is not worth adding: the bracket is as good as closed there.
  double least_height() const { return std::max(0.25 * roundoff(), kLeastHeight * tolerance_); }

  // Support pair along unit d as a new point; tightens the lower bound of the gap. `near`: a point whose
  // supports are worth starting from where they are nearer than the atlas's, or -1.
  int query(const Vec3& d, int near) {
    if (hull_.points() == kHullVertices) return -1;
    if (near >= 0 && d.dot(witness_[near].d) < kNearStart) near = -1;
    const HullPoint a = points_a_.along(d, near < 0 ? nullptr : &witness_[near].on_a),
                    b = points_b_.along(pair_.direction_on_b(d), near < 0 ? nullptr : &witness_[near].on_b);
    return take(d, a, b);
  }

  // The points of both bodies as the hull's next; not when it is full.
  int take(const Vec3& d, const HullPoint& a, const HullPoint& b) {
    const int v = hull_.points();
    const double p = pair_.overlap_along(d, a.upper, b.upper);
    // The centres of balls that touch there from inside lie in the cores, exactly.
    const Vec3 on_a = pair_.place_a(a.point) - shrink_a_ * a.normal,
               on_b = pair_.offset + pair_.turn * (pair_.scale_b * b.point - shrink_b_ * b.normal);
    witness_.put(v, {on_a, on_b, d, p, a.where, b.where, false});
    Vec3 g = on_a - on_b;
    if (joggle_ > 0) g += joggle_ * scatter(g);
    hull_.store(g);
    ++queries_;
    if (-p > lower_) {
      lower_ = -p;
      direction_ = d;
      best_ = v;
      for (int k = 0; k < caps_; ++k)
        lower_caps_ |= (p - shrink_) * cap_[k].used < cap_[k].level * cap_[k].proven;
    }
    return v;
  }

  // The tetrahedron of largest volume among the points, greedily, and the others onto it. False where it is
  // lower than `least` of its own size; `across` is then square to it.
  bool start_from_points(double least, Vec3* across) {
    int pick[4] = {0, 0, 0, 0};
    const auto g = [&](int k) -> const Vec3& { return hull_.point(k); };
    const auto pick_largest = [&](int want, const auto& measure) {
      double best = 0;
      for (int k = 1; k < hull_.points(); ++k) {
        const double m = measure(g(k) - g(0));
        if (m > best) {
          best = m;
          pick[want] = k;
        }
      }
      return best;
    };
    const double size = pick_largest(1, [](const Vec3& e) { return e.norm(); });
    const Vec3 line = g(pick[1]) - g(0);
    const double area = pick_largest(2, [&](const Vec3& e) { return line.cross(e).norm(); });
    if (!(area > least * size * size)) {
      *across = size > 0 ? line.unitOrthogonal() : witness_[0].d.unitOrthogonal();
      return false;
    }
    const Vec3 square = line.cross(g(pick[2]) - g(0));
    const double volume = pick_largest(3, [&](const Vec3& e) { return std::abs(e.dot(square)); });
    *across = square.normalized();
    if (!(volume > least * size * size * size)) return false;
    // Of points that are one to round-off the inside is none.
    if (points_ && !(volume > kThinnest * pair_.reach * square.norm())) return false;
    if (!hull_.start(pick[0], pick[1], pick[2], pick[3])) return false;
    for (int k = 0; k < hull_.points(); ++k)
      if (k != pick[0] && k != pick[1] && k != pick[2] && k != pick[3]) hull_.grow(k, least_height());
    return true;
  }

  // W_A + W_B of the cores at the supports of point v, in the tangent plane of d spanned by t and s: what
  // p(d) of the cores bends by there, but for p itself.
  bool core_turn(int v, const Vec3& d, const Vec3& t, const Vec3& s, Mat2* turn) const {
    if (points_) return false;
    Mat2 wa, wb;
    const Witness& w = witness_[v];
    const Mat3 back = pair_.turn.transpose();
    if (!points_a_.turn(w.on_a, d, w.d, t, s, &wa)) return false;
    if (!points_b_.turn(w.on_b, -(back * d), -(back * w.d), back * t, back * s, &wb)) return false;
    *turn = pair_.scale_a * wa + pair_.scale_b * wb - shrink_ * Mat2::Identity();
    return true;
  }

  // Goes from point v to the minimum of p that it is near and surrounds it. False where one has been
  // surrounded before or p has no smooth minimum.
  bool settle(int v) {
    if (minima_ == kMostMinima) return false;
    for (int k = 0; k < minima_; ++k)
      if (witness_[v].d.dot(minimum_[k]) > kSameMinimum) return false;
    bool smooth, known = false;
    v = polish(v, &smooth);
    for (int k = 0; k < minima_; ++k) known |= witness_[v].d.dot(minimum_[k]) > kOneMinimum;
    minimum_[minima_++] = witness_[v].d;
    if (!smooth || known) return false;
    if (witness_[v].p + lower_ <= kSurroundAbove * std::abs(lower_)) surround(v, cover(v));
    return true;
  }

  // Proves by second order that no direction near the minimum at point v has less than the least overlap
  // seen, less kCapDepth of the tolerance, T; the angle up to which, or 0. The hull gets a point G = T / cos
  // (angle) d: where d' . G is T or more, d' is in the cap, and proven; so that where the hull, G in it, has
  // its nearest face at t <= T, every direction overlaps by t.
  //
  // Along a great circle from d let p be the cores' overlap and L = d(t) . g that of the cores' points at v:
  // p - L >= 0 is at most e at d and p'' + p >= W_A + W_B less the cores' shrinking, m0 - rho t, by both
  // bodies' Bends. What is convex and at most e above 0 is no less than m0 (1 - cos(t - t0)) with t0 <=
  // sqrt(2 e / m0), and L >= y0 - s t - y0 t^2 / 2, so that with s' = s + sqrt(2 e m0)
  //     p >= y0 - s' t + (m0 - y0) t^2 / 2 (1 - t^2 / 12) - rho t^3 / 6,
  // the factor only where m0 > y0.
  double cover(int v) {
    if (points_) return 0;
    const Witness w = witness_[v];
    const Vec3 d = w.d, t = d.unitOrthogonal(), s = d.cross(t), g = hull_.point(v);
    const double level = -lower_ - kCapDepth * tolerance_ - shrink_;
    if (joggle_ > 0 || hull_.points() == kHullVertices || !(level > tolerance_)) return 0;
    const Mat3 back = pair_.turn.transpose();
    const Bend a = bend_of(*pair_.a, w.on_a, pair_.scale_a, d, t, s),
               b = bend_of(*pair_.b, w.on_b, pair_.scale_b, -(back * d), back * t, back * s);
    const double y0 = d.dot(g), slope = (g - y0 * d).norm() + kRoundoff * pair_.reach,
                 over = std::max(0.0, w.p - shrink_ - y0) + roundoff();
    double angle = 0;
    for (double to = kWidestCap; to > kLeastCap; to *= kNextCap) {
      double rate = 0;
      const Mat2 turn = least_turn(a, to, &rate) + least_turn(b, to, &rate);
      const double m = extremes(turn).least - shrink_;
      if (!(m > 0)) continue;
      const double rise = m > y0 ? (1 - to * to / 12) : 1, falls = slope + std::sqrt(2 * over * m),
                   bend = 0.5 * rise * (m - y0) - rate * to / 6, room = y0 - level;
      if (!(room > 0)) break;
      if (!stays_above(room, falls, bend, to)) continue;
      angle = to;
      break;
    }
    return angle > 0 ? add_cap(v, level, angle, slope) : 0;
  }

  double add_cap(int v, double level, double angle, double slope) {
    const Vec3 d = witness_[v].d;
    Cap cap{d, level, std::cos(angle), std::cos(kCapUsed * angle), slope, hull_.points(), v};
    hull_.store(level / cap.used * d);
    witness_.put(cap.vertex, witness_[v]).cap = true;
    cap_[caps_++] = cap;
    if (hull_.faces() > 0) hull_.grow(cap.vertex, least_height());
    return kCapUsed * angle;
  }

  // The same by a hull of its own, of what the bodies are without balls that roll inside as far as the
  // directions about the minimum can tell: those may be much larger than any that rolls all through them, and
  // a hull needs the fewer points the less bent the cores are.
  void cover_by_cores() {
    while (caps_ < kMostMinima && hull_.points() < kHullVertices) {
      const int near = best_face();
      if (near < 0 || upper_ - lower_ <= tolerance_) return;
      int v = -1;
      for (int k = 0; k < hull_.points(); ++k)
        if (!witness_[k].cap && witness_[k].d.dot(direction_to_ask_) > kSameBasin &&
            (v < 0 || witness_[k].p < witness_[v].p))
          v = k;
      if (v < 0 || !(witness_[v].p + lower_ <= kSurroundAbove * std::abs(lower_)) || !cover_by_cores(v))
        return;
    }
  }

  // About point v; false where it does not succeed, or has not before.
  bool cover_by_cores(int v) {
    if (joggle_ > 0 || tries_ == kMostMinima) return false;
    if (std::find(tried_, tried_ + tries_, v) != tried_ + tries_) return false;
    tried_[tries_++] = v;
    const Witness w = witness_[v];
    const Vec3 d = w.d, t = d.unitOrthogonal(), s = d.cross(t), g = hull_.point(v);
    const Mat3 back = pair_.turn.transpose();
    const Bend a = bend_of(*pair_.a, w.on_a, pair_.scale_a, d, t, s),
               b = bend_of(*pair_.b, w.on_b, pair_.scale_b, -(back * d), back * t, back * s);
    const double level = -lower_ - kCapDepth * tolerance_ - shrink_;
    Mat2 turn;
    Extremes seen{level, 4 * level};  // a guess, where there is a crease
    if (core_turn(v, d, t, s, &turn)) seen = extremes(turn);
    // What a hull needs, but for a factor, from an angle on to `ratio` times that.
    const auto points = [&](double cut, double ratio) {
      return std::sqrt(std::max(0.0, seen.least - cut) * (seen.most - cut)) * std::log(ratio);
    };
    const double finest = std::sqrt(tolerance_ / seen.most);
    double fewest = kWorthCores * points(0, kWidestRing / finest), valid = 0, cut_a = 0, cut_b = 0;
    for (const double to : kCoreCaps) {
      const double ra = least_radius(a, to), rb = least_radius(b, to), cut = ra + rb - shrink_;
      if (!(cut > 0 && to > finest)) continue;
      const double count = points(cut, to / finest) + points(0, kWidestRing / to);
      if (count < fewest) fewest = count, valid = to, cut_a = ra, cut_b = rb;
    }
    const double share = std::min(1.0, kCoreDepth * (level + shrink_) / (cut_a + cut_b));
    const double cut = share * (cut_a + cut_b) - shrink_;
    double there = level - cut;
    if (!(valid > 0 && level > tolerance_ && there > tolerance_)) return false;
    Search cores(*this, v, valid, share * cut_a, share * cut_b);
    const double angle = cores.prove(&there);
    queries_ += cores.queries_;
    if (angle > 0) add_cap(v, there + cut, angle, (g - d.dot(g) * d).norm() + kRoundoff * pair_.reach);
    if (cores.lower_ > lower_) {  // a lower minimum
      const int lower = query(cores.direction_, v);
      if (lower >= 0) hull_.grow(lower, least_height());
    }
    return angle > 0;
  }

  // Of a body in its own axes, lengths of the lab.
  Bend bend_of(const Shape& shape, const HullPlace& place, double scale, const Vec3& d, const Vec3& t,
               const Vec3& s) const {
    Bend bend;
    if (shape.dented() || shape.joint_slack > 0) return bend;
    const InnerMap& map = shape.lazy_inner_map.known();
    if (!map.nodes.empty()) {
      const InnerNode& node = map.nodes[shape.atlas.nearest(d)];
      const double off = angle_between(node.normal, d);
      for (std::size_t k = 0; k < kInnerCaps.size(); ++k) {
        bend.ball[k] = scale * node.radius[k];
        bend.within[k] = kInnerCaps[k] - off - kOffNormal;
      }
      const int cell = InnerMap::cell(d);
      const double beside = angle_between(InnerMap::middle(cell), d);
      for (std::size_t k = 0; k < kStretchCaps.size(); ++k) {
        bend.stretch[k] = scale * map.stretches[cell].least[k];
        bend.near[k] = kStretchCaps[k] - beside - kOffNormal;
      }
    }
    const SurfacePoint at = surface_place(shape, place, d);
    JetLanes jet;
    evaluate2(shape.patches[at.patch], at.u, at.v, &jet);
    nurbs::scale(scale, &jet);
    bend.local = local_bend(shape, scale, at, jet, d, t, s);
    bend.least = extremes(bend.local.turn).least;
    return bend;
  }

  // W is no less for directions within `to` of d.
  static double least_radius(const Bend& bend, double to) {
    double rate = 0;
    const Mat2 turn = least_turn(bend, to, &rate);
    return std::max(0.0, extremes(turn).least - rate * to);
  }

  // A lower bound of W at d, less `rate` times the angle, for directions within `to` of it.
  static Mat2 least_turn(const Bend& bend, double to, double* rate) {
    double ball = 0;
    for (std::size_t k = 0; k < kInnerCaps.size(); ++k)
      if (to <= bend.within[k]) ball = std::max(ball, bend.ball[k]);
    for (std::size_t k = 0; k < kStretchCaps.size(); ++k)
      if (to <= bend.near[k]) ball = std::max(ball, bend.stretch[k]);
    if (to <= bend.local.reach && bend.least - bend.local.rate * to > ball) {
      *rate += bend.local.rate;
      return bend.local.turn;
    }
    return ball * Mat2::Identity();
  }

  // A lower minimum was found: caps are proven for its level too, but the hull's points are those of the old
  // one. Where it is none of overlapping cores, the caps go: their points become their minima's own.
  void lower_caps() {
    lower_caps_ = false;
    const double level = -lower_ - kCapDepth * tolerance_ - shrink_;
    if (!(level > tolerance_)) drop_caps();
    for (int k = 0; k < caps_; ++k) {
      Cap& cap = cap_[k];
      cap.level = std::min(cap.level, level);
      hull_.move(cap.vertex, cap.level / cap.used * cap.d);
    }
    Vec3 across;
    if (!start_from_points(0, &across)) stalled_ = true;
  }

  // Newton on p(d): its gradient is the support pair's offset in the tangent plane, its Hessian W_A + W_B -
  // p.
  int polish(int v, bool* smooth) {
    *smooth = false;
    for (int k = 0; k < kPolishIterations; ++k) {
      const Vec3 d = witness_[v].d, t = d.unitOrthogonal(), s = d.cross(t), g = hull_.point(v);
      Mat2 hessian;
      if (!core_turn(v, d, t, s, &hessian)) break;
      hessian -= d.dot(g) * Mat2::Identity();
      const double det = hessian.determinant();
      if (!(hessian(0, 0) > 0 && det > kSingular * hessian(0, 0) * hessian(1, 1))) break;
      const Vec2 gradient(t.dot(g), s.dot(g));
      Vec2 step(hessian(0, 1) * gradient[1] - hessian(1, 1) * gradient[0],
                hessian(0, 1) * gradient[0] - hessian(0, 0) * gradient[1]);
      step /= det;
      const double length = step.norm();
      // What is left to gain is half of step . gradient.
      *smooth = !(-step.dot(gradient) > kPolishGain * tolerance_);
      if (*smooth) break;
      if (length > kLongestPolish) step *= kLongestPolish / length;
      const int next = query((d + step[0] * t + step[1] * s).normalized(), v);
      if (next < 0) break;
      if (hull_.faces() > 0) hull_.grow(next, least_height());
      if (!(witness_[next].p < witness_[v].p)) {  // round-off is all that is left
        *smooth = -step.dot(gradient) < tolerance_;
        break;
      }
      v = next;
    }
    return v;
  }

  // Where p(d) is least in a crease, two supports u and v are level (a cone's tip and its rim): Newton on p
  // along the crease, with the weights that leave no slope across it. Bends of a share of each support's.
  void balance(const std::array<short, 3>& corners, int v) {
    int u = v;
    for (const short k : corners)
      if (!witness_[k].cap &&
          (hull_.point(k) - hull_.point(v)).squaredNorm() > (hull_.point(u) - hull_.point(v)).squaredNorm())
        u = k;
    if (u == v) return;
    Vec3 d = witness_[v].d;
    for (int k = 0; k < kBalanceSteps; ++k) {
      const Vec3 gu = hull_.point(u), gv = hull_.point(v), apart = gu - gv;
      Vec3 e = apart - d.dot(apart) * d;
      const double length = e.norm();
      if (!(length > kNoDirection * pair_.reach)) return;
      e /= length;
      const Vec3 along = d.cross(e);
      const double share = -gv.dot(e) / length;
      if (!(share > 0 && share < 1)) return;
      const Vec3 g = share * gu + (1 - share) * gv;
      if (!(g.dot(d) < -(lower_ + shrink_))) return;  // nothing to gain
      Mat2 turn_u, turn_v;
      if (!core_turn(u, d, e, along, &turn_u) || !core_turn(v, d, e, along, &turn_v)) return;
      const double bend = share * turn_u(1, 1) + (1 - share) * turn_v(1, 1) - g.dot(d);
      // On an axis of revolution all directions round it are as good.
      double step = bend > kFlatBend * std::abs(g.dot(d)) ? -g.dot(along) / bend : 0;
      step = std::clamp(step, -kLongestPolish, kLongestPolish);
      const Vec3 next = (d - d.dot(apart) / length * e + step * along).normalized();
      if (!((next - d).squaredNorm() > kStationary * kStationary)) return;
      d = next;
      const int before = best_;
      ++balances_;
      const int w = query(d, v);
      if (w < 0) return;
      hull_.grow(w, least_height());
      if (best_ == before) return;
      ((hull_.point(w) - hull_.point(u)).squaredNorm() < (hull_.point(w) - hull_.point(v)).squaredNorm()
           ? u
           : v) = w;
    }
  }

  // Round a deep minimum d the hull's faces have to shrink to the root of the tolerance. Points x = W (n - d)
  // of a ring of normals n lie x . W^-1 x / 2 below d's plane; with them the hull reaches as far as d's along
  // every direction up to w / delta times the ring's (w: least eigenvalue of W, delta: depth). Rings that far
  // apart leave the search little else to find.
  void surround(int from, double covered) {
    const double depth = -(lower_ + shrink_);
    if (!(depth > 0)) return;
    const Vec3 d = witness_[from].d, t = d.unitOrthogonal(), s = d.cross(t);
    Mat2 turn;
    if (!core_turn(from, d, t, s, &turn)) return;
    const auto [least, most] = extremes(turn);
    if (!(least > kLeastSpread * depth)) return;
    const double angle = 0.5 * std::atan2(turn(0, 1), 0.5 * (turn(0, 0) - turn(1, 1)));
    const Vec3 long_axis = std::cos(angle) * t + std::sin(angle) * s, short_axis = d.cross(long_axis);
    const double ratio = std::clamp(kRingShare * least / depth, kLeastRing, kMostRing);
    double phase = 0;
    // r: root of twice the drop.
    const double widest = kWidestRing * std::sqrt(most);
    double r = std::sqrt(tolerance_);
    while (r < covered * std::sqrt(least) && r * ratio < widest) r *= ratio;
    for (; r < widest; r *= ratio) {
      for (int k = 0; k < 4; ++k) {
        const double x = r * std::cos(phase + 0.5 * M_PI * k) / std::sqrt(most),
                     y = r * std::sin(phase + 0.5 * M_PI * k) / std::sqrt(least);
        if (std::hypot(x, y) > std::min(kWidestTilted, 0.9 * valid_)) continue;
        const int v = query((d + x * long_axis + y * short_axis).normalized(), from);
        if (v < 0) return;
        hull_.grow(v, least_height());
      }
      phase += M_PI / 4;
    }
  }

  // In the unit cube, the same for equal points and in no relation for others.
  Vec3 scatter(const Vec3& g) const {
    const Vec3 x = (kJoggleWaves / pair_.reach) * g;
    return Vec3(std::sin(x[1] + 0.7 * x[2]), std::sin(x[2] + 0.6 * x[0]), std::sin(x[0] + 0.8 * x[1]));
  }

  // The face nearest to the origin, the direction to ask for it, and the upper bound of the gap it proves.
  int best_face() {
    const GrowingHull::Nearest near = hull_.nearest();
    if (near.face < 0) return -1;
    const GrowingHull::Face& f = hull_.face(near.face);
    const double distance = std::sqrt(near.distance2);
    near_ = near.inside ? distance : -distance;
    double below = near.inside ? distance : caps_ > 0 ? -kFarAway : -distance;
    for (int k = 0; k < caps_; ++k) {
      const Cap& c = cap_[k];
      // Else the hull gives away directions that are not proven, but along which d's points overlap.
      const bool proven = distance * c.used >= c.level * c.proven;
      below = std::min(below, proven ? c.level : c.used * distance - c.slope);
    }
    upper_ = std::min(upper_, -below - shrink_ + roundoff());
    const Vec3 closest = hull_.nearest_point(f);
    const bool plane = !f.sliver && (near.inside || f.weights.minCoeff() > 0 || !(distance > roundoff()));
    if (plane)
      direction_to_ask_ = f.normal;
    else if (distance > 0)
      direction_to_ask_ = away_from(f, near.inside ? Vec3(-closest) : closest);
    else
      return -1;
    return near.face;
  }

  int closest_of(const GrowingHull::Face& f, const Vec3& d) const {
    int best = f.vertex[0];
    for (const short v : f.vertex)
      if (d.dot(witness_[v].d) > d.dot(witness_[best].d)) best = v;
    return best;
  }

  // Unit direction from the nearest point to the origin, square to the face or edge it lies in: the origin
  // may be so near that the difference alone has lost the digits that separate flat faces.
  Vec3 away_from(const GrowingHull::Face& f, const Vec3& closest) const {
    int count = 0, zero = 0;
    for (int k = 0; k < 3; ++k) f.weights[k] > 0 ? ++count : zero = k;
    if (count != 2) return -closest.normalized();
    const int from = (zero + 1) % 3, to = (zero + 2) % 3;
    const GrowingHull::Face& other = hull_.face(f.across[from]);
    if (!f.sliver && !other.sliver) {
      // Between the normals of the two faces, where no far point rises above the edge.
      const double c = f.normal.dot(other.normal);
      const double wf = std::max(0.0, -(f.offset - c * other.offset)),
                   wo = std::max(0.0, -(other.offset - c * f.offset));
      const Vec3 d = wf * f.normal + wo * other.normal;
      if (d.squaredNorm() > 0 && d.dot(closest) < 0) return d.normalized();
    }
    const Vec3 edge = (hull_.point(f.vertex[to]) - hull_.point(f.vertex[from])).normalized();
    return (edge.dot(closest) * edge - closest).normalized();
  }

  // What the witnesses of direction_ are to be apart: the hull's point nearest to the origin or, when that is
  // inside, its foot on the supporting plane. (Of a flat of the obstacle, which is several triangles, or of
  // two equal minima other points would not face each other.)
  Vec3 target() const { return std::min(0.0, lower_ + shrink_) * -direction_; }

  // Points of the bodies that are as nearly so as the supports along direction_ or one of the hull's
  // triangles has them. About a minimum whose cap is proven the hull stays coarse, and what is given away
  // there belongs to neither body: where the supports do not face each other, as on ruled lines, it is made
  // again without.
  void find_witness(Vec3* a, Vec3* b) {
    if (find_nearest_pair(a, b).off <= kFacing * pair_.size || caps_ == 0) return;
    drop_caps();
    Vec3 across;
    if (start_from_points(0, &across)) refine_pair(a, b);
  }
  void refine_pair(Vec3* a, Vec3* b) {
    for (int k = 0; k < kMostFacing; ++k) {
      const Facing near = find_nearest_pair(a, b);
      if (near.off <= std::max(kFacingBetter * kFacing * pair_.size, roundoff()) || near.face < 0) return;
      const int v = query(near.towards.normalized(), closest_of(hull_.face(near.face), direction_));
      if (v < 0 || hull_.grow(v, 0.0, near.face) != GrowingHull::Growth::grown) return;
    }
  }
  // Their points become their minima's own; the surface has to be started again.
  void drop_caps() {
    for (int k = 0; k < caps_; ++k) {
      hull_.move(cap_[k].vertex, hull_.point(cap_[k].from));
      witness_[cap_[k].vertex] = witness_[cap_[k].from];
    }
    caps_ = 0;
  }

  // How far the pair of witnesses is from the target; the triangle nearest to that and the way there from it.
  struct Facing {
    double off;
    int face = -1;
    Vec3 towards = Vec3::Zero();
  };
  Facing find_nearest_pair(Vec3* a, Vec3* b) const {
    const Vec3 target = this->target();
    *a = witness_[best_].a;
    *b = witness_[best_].b;
    Facing near{(*a - *b - target).norm()};
    double best = kFarAway;
    Vec3 weights;
    for (int k = 0; k < hull_.faces(); ++k) {
      const GrowingHull::Face& f = hull_.face(k);
      if (!f.alive) continue;
      const double above = f.normal.dot(target) - f.offset;  // 0 of slivers
      if (above * above > kPlaneBeyond * best) continue;
      if (std::any_of(f.vertex.begin(), f.vertex.end(), [&](short v) { return witness_[v].cap; })) continue;
      const Vec3 &p = hull_.point(f.vertex[0]), &q = hull_.point(f.vertex[1]), &r = hull_.point(f.vertex[2]);
      const Vec3 w = nearest_on_triangle(p - target, q - target, r - target);
      const Vec3 towards = target - (w[0] * p + w[1] * q + w[2] * r);
      const double distance = towards.squaredNorm();
      if (!(distance < best)) continue;
      best = distance;
      near.face = k;
      near.towards = towards;
      weights = w;
    }
    if (near.face < 0 || !(std::sqrt(best) < near.off)) return near;
    near.off = std::sqrt(best);
    *a = *b = Vec3::Zero();
    for (int i = 0; i < 3; ++i) {
      const Witness& w = witness_[hull_.face(near.face).vertex[i]];
      *a += weights[i] * w.a;
      *b += weights[i] * w.b;
    }
    return near;
  }

  const PairFrame& pair_;
  double tolerance_, joggle_;
  double shrink_a_, shrink_b_, shrink_;
  HullPoints points_a_, points_b_;
  double error_;         // of their points
  bool points_ = false;  // are all that is left
  double valid_ = M_PI;  // what the cores hold for: directions within it of the middle
  Vec3 middle_ = Vec3::Zero();
  double lower_ = -kFarAway, upper_ = kFarAway, near_ = -kFarAway;
  Vec3 direction_ = Vec3::UnitX(), direction_to_ask_ = Vec3::UnitX();
  int best_ = 0, queries_ = 0, balances_ = 0, minima_ = 0;
  bool stalled_ = false, hopeless_ = false, lower_caps_ = false;
  int caps_ = 0;
  Cap cap_[kMostMinima];
  Vec3 minimum_[kMostMinima];           // directions surrounded
  int tried_[kMostMinima], tries_ = 0;  // points about which caps were tried by cores
  int before_cores_ = kBeforeCores;
  Room<Witness, kHullVertices> witness_;
  GrowingHull hull_;
};

// Along an axis of revolution, where a ring of directions is hardly one.
bool is_polar(const PairFrame& pair, const Vec3& d) {
  const auto along = [&](const Shape& shape, const Mat3& turn) {
    const Revolution& about = revolution_of(shape);
    return about.found && !shape.proofs.sphere && d.cross(turn * about.axis).squaredNorm() < kPolar * kPolar;
  };
  return along(*pair.a, Mat3::Identity()) || along(*pair.b, pair.turn);
}

// Rings and cells know few points of the bodies, which may not face each other where it takes three or four
// to carry the contact.
__attribute__((noinline)) void make_points_face(const PairFrame& pair, double tolerance, PolytopeResult* r) {
  const auto off = [](const PolytopeResult& x) {
    return (x.points.b - x.points.a).cross(x.bracket.direction).norm();
  };
  if (!(off(*r) > kFacing * pair.size)) return;
  PolytopeResult better = *r;
  if (Search(pair, tolerance, 0.0, false).find_points(&better) && off(better) < off(*r)) *r = better;
}

bool has_rings(const Shape& shape) {
  return revolution_of(shape).found || !shape.round_edges.empty();
}

// What two attempts know together: the narrower one's points, along the direction of the higher lower end.
PolytopeResult both(const PolytopeResult& x, const PolytopeResult& y, double tolerance) {
  PolytopeResult r = y.bracket.width() < x.bracket.width() ? y : x;
  const Bracket& higher = y.bracket.lower > x.bracket.lower ? y.bracket : x.bracket;
  r.bracket.lower = higher.lower;
  r.bracket.upper = std::max(std::min(x.bracket.upper, y.bracket.upper), higher.lower);
  r.bracket.direction = r.points.na = higher.direction;
  r.points.nb = -higher.direction;
  r.converged = r.bracket.width() <= tolerance;
  set_gap(&r);
  return r;
}

// What is left where a hull does not close.
bool search_last(const PairFrame& pair, double tolerance, PolytopeResult* best) {
  if (!search_rings(pair, tolerance, true, best) && !search_cells(pair, tolerance, best)) return false;
  make_points_face(pair, tolerance, best);
  return true;
}

}  // namespace

PolytopeResult solve_polytope(const PairFrame& pair, const Vec3& seed, double tolerance, double enough) {
  // A hull that round-off broke (coplanar faces) or that stalled is begun again from other directions, and
  // its vertices moved at random by far more than round-off and far less than the tolerance (Barber, Dobkin &
  // Huhdanpaa 1996, section 4: joggled input); the upper bound allows for it.
  PolytopeResult best;
  double upper = kFarAway;
  if (search_segments(pair, tolerance, &best) || search_ball_hulls(pair, tolerance, &best, &upper) ||
      search_segment_in_ellipsoid(pair, seed, tolerance, &best))
    return best;
  Vec3 from = seed;
  bool points = true;
  double searched = kFarAway;  // the lower end with which all that is left was tried in vain
  for (int attempt = 0; attempt < kHullAttempts; ++attempt) {
    const double joggle = attempt > 0 ? std::min(kJoggle * pair.reach, 0.05 * tolerance) : 0.0;
    Search search(pair, tolerance, joggle, points);
    search.bound(upper);
    if (attempt % 2 == 1) search.let_be();
    const bool started = search.start(from), flat = search.only_points() && !started;
    if (flat || attempt + 1 == kPointAttempts) points = false;
    if (flat) {  // the same attempt, with balls
      --attempt;
      continue;
    }
    if (started && attempt == 0 && (has_rings(*pair.a) || has_rings(*pair.b))) {
      const bool bent =
          !pair.a->lazy_inner_map.known().nodes.empty() && !pair.b->lazy_inner_map.known().nodes.empty();
      search.run(enough, bent ? kBentBeforeRings : kBeforeRings);
      best = search.bracket();
      if (!best.converged && is_polar(pair, best.bracket.direction)) {
        search.run(enough, kAtPoles);
        best = search.bracket();
      }
      if (!best.converged && search_rings(pair, tolerance, false, &best)) {
        make_points_face(pair, tolerance, &best);
        return best;
      }
    }
    if (started) search.run(enough, kHullVertices);
    if (search.hopeless() && (has_rings(*pair.a) || has_rings(*pair.b))) {
      best = search.bracket();
      if (search_last(pair, tolerance, &best)) return best;
      searched = best.bracket.lower;
      search.run(enough, kHullVertices);
    }
    const PolytopeResult result = search.result();
    const int spent = attempt > 0 ? best.iterations : 0;
    best = attempt == 0 || result.converged ? result : both(best, result, tolerance);
    best.iterations = spent + result.iterations;
    if (best.converged || best.bracket.lower > enough || (started && !search.stalled())) break;
    from = best.bracket.direction + kHullTurn * (attempt + 1) * Vec3(0.36, -0.48, 0.8);
  }
  if (!best.converged && !(best.bracket.lower > enough) && best.bracket.lower != searched)
    search_last(pair, tolerance, &best);
  return best;
}

}  // namespace nurbs

// Directions about minima that are proven to overlap deeper, and given away to the hull; see
// polytope_search.h.
#include <cmath>

#include "contact/overlap/closing.h"
#include "contact/overlap/polytope_search.h"

namespace nurbs {
namespace {

constexpr double kCapDepth = 0.4;  // of the tolerance, that a cap proves less than the least overlap
constexpr double kCapUsed = 0.8;   // of a cap's angle: the rest is for lower minima found later
constexpr double kWidestCap = 0.42, kNarrowestCap = 1e-4, kNextCap = 0.75;  // rad
// A cap whose bodies are cut to their cores about it:
constexpr double kOffSupport = 1e-4;   // rad
constexpr double kSameWitness = 0.97;  // cosine
constexpr int kCorePoints = 320;       // spent on one
constexpr int kRim = 8;                // points that give away what is outside
constexpr double kWorthCores = 0.6;    // of the points that the minimum would cost without
constexpr std::array<double, 8> kCoreCaps = {0.4, 0.25, 0.16, 0.11, 0.075, 0.048, 0.03, 0.015};  // rad

}  // namespace

// Proves by second order that no direction near the minimum at point v has less than the least overlap
// seen, less kCapDepth of the tolerance, T; the angle up to which, or 0. The hull gets a point G = T / cos
// (angle) d: where d' . G is T or more, d' is in the cap, and proven; so that where the hull, G in it, has
// its nearest face at t <= T, every direction overlaps by t.
//
// Along a great circle from d let p be the cores' overlap and L = d(t) . g that of the cores' points at v:
// p - L >= 0 is at most e at d and p'' + p >= W_A + W_B less the cores' shrinking, m0 - rho t, by both
// bodies' TurnBounds. What is convex and at most e above 0 is no less than m0 (1 - cos(t - t0)) with t0 <=
// sqrt(2 e / m0), and L >= y0 - s t - y0 t^2 / 2, so that with s' = s + sqrt(2 e m0)
//     p >= y0 - s' t + (m0 - y0) t^2 / 2 (1 - t^2 / 12) - rho t^3 / 6,
// the factor only where m0 > y0.
double PolytopeSearch::cover(int v) {
  if (points_) return 0;
  const Witness w = witness_[v];
  const Vec3 d = w.d, t = d.unitOrthogonal(), s = d.cross(t), g = hull_.point(v);
  const double level = cap_level();
  if (joggle_ > 0 || hull_.points() == kHullVertices || !(level > tolerance_)) return 0;
  const auto [a, b] = bends_at(v, t, s);
  const double y0 = d.dot(g), slope = (g - y0 * d).norm() + pair_.noise,
               over = std::max(0.0, w.p - shrink_ - y0) + roundoff() + pair_.rise;
  double angle = 0;
  for (double to = kWidestCap; to > kNarrowestCap; to *= kNextCap) {
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

double PolytopeSearch::add_cap(int v, double level, double angle, double slope) {
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
void PolytopeSearch::cover_by_cores() {
  while (caps_ < kMostMinima && hull_.points() < kHullVertices) {
    const int near = best_face();
    if (near < 0 || upper_ - lower_ <= tolerance_) return;
    int v = -1;
    for (int k = 0; k < hull_.points(); ++k)
      if (!witness_[k].cap && witness_[k].d.dot(direction_to_ask_) > kSameWitness &&
          (v < 0 || witness_[k].p < witness_[v].p))
        v = k;
    if (v < 0 || !(witness_[v].p + lower_ <= kSurroundAbove * std::abs(lower_)) || !cover_by_cores(v)) return;
  }
}

// About point v; false where it does not succeed, or has not before.
bool PolytopeSearch::cover_by_cores(int v) {
  if (joggle_ > 0 || tries_ == kMostMinima) return false;
  if (std::find(tried_, tried_ + tries_, v) != tried_ + tries_) return false;
  tried_[tries_++] = v;
  const Witness w = witness_[v];
  const Vec3 d = w.d, t = d.unitOrthogonal(), s = d.cross(t), g = hull_.point(v);
  const auto [a, b] = bends_at(v, t, s);
  const double level = cap_level();
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
  PolytopeSearch cores(*this, v, valid, share * cut_a, share * cut_b);
  const double angle = cores.prove(&there);
  queries_ += cores.queries_;
  if (angle > 0) add_cap(v, there + cut, angle, (g - d.dot(g) * d).norm() + pair_.noise);
  if (cores.lower_ > lower_) {  // a lower minimum
    const int lower = query(cores.direction_, v);
    if (lower >= 0) hull_.grow(lower, least_height());
  }
  return angle > 0;
}

PolytopeSearch::PolytopeSearch(const PolytopeSearch& whole, int from, double valid, double shrink_a,
                               double shrink_b)
    : pair_(whole.pair_),
      tolerance_(whole.tolerance_),
      joggle_(0),
      shrink_a_(shrink_a),
      shrink_b_(shrink_b),
      shrink_(shrink_a + shrink_b),
      points_a_(whole.points_a_),
      points_b_(whole.points_b_),
      error_(whole.error_),
      rise_(whole.pair_.rise),
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
double PolytopeSearch::prove(double* level) {
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
    *level = std::min(*level, cap_level());
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

double PolytopeSearch::cap_level() const {
  return -lower_ - kCapDepth * tolerance_ - shrink_;
}

PolytopeSearch::Bends PolytopeSearch::bends_at(int v, const Vec3& t, const Vec3& s) const {
  const Witness& w = witness_[v];
  const Mat3 back = pair_.turn.transpose();
  const Vec3 on_b = -(back * w.d);
  return {
      bound_turn(*pair_.a, pair_.scale_a, surface_place(*pair_.a, w.on_a, w.d), w.d, t, s),
      bound_turn(*pair_.b, pair_.scale_b, surface_place(*pair_.b, w.on_b, on_b), on_b, back * t, back * s)};
}

// A lower minimum was found: caps are proven for its level too, but the hull's points are those of the old
// one. Where it is none of overlapping cores, the caps go: their points become their minima's own.
void PolytopeSearch::lower_caps() {
  lower_caps_ = false;
  const double level = cap_level();
  if (!(level > tolerance_)) drop_caps();
  for (int k = 0; k < caps_; ++k) {
    Cap& cap = cap_[k];
    cap.level = std::min(cap.level, level);
    hull_.move(cap.vertex, cap.level / cap.used * cap.d);
  }
  Vec3 across;
  if (!start_from_points(0, &across)) stalled_ = true;
}

// Their points become their minima's own; the surface has to be started again.
void PolytopeSearch::drop_caps() {
  for (int k = 0; k < caps_; ++k) {
    hull_.move(cap_[k].vertex, hull_.point(cap_[k].from));
    witness_[cap_[k].vertex] = witness_[cap_[k].from];
  }
  caps_ = 0;
}

}  // namespace nurbs

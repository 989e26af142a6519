// The last rung: closed forms of overlap, polytopes, rings, cells, in the order of their cost; see
// polytope.h.
#include "contact/overlap/polytope.h"

#include <algorithm>

#include "contact/overlap/ball_hull_search.h"
#include "contact/overlap/cell_search.h"
#include "contact/overlap/near_ball_search.h"
#include "contact/overlap/polytope_search.h"
#include "contact/overlap/ring_search.h"
#include "contact/overlap/segment_search.h"

namespace nurbs {
namespace {

constexpr int kPointAttempts = 2;     // flat differences of points may have no hull
constexpr int kBeforeRings = 64;      // queries before rings of directions are looked for ...
constexpr int kBentBeforeRings = 95;  // ... of bodies without sharp edges, which caps may do for ...
constexpr int kAtPoles = 256;         // ... and where the least overlap is along an axis
constexpr double kBroken = 64;        // round-offs by which the ends of a bracket may cross
constexpr double kPolar = 0.1;        // sine of the angle from it
constexpr double kOneCentre =
    0.03;  // of the balls' radii inside: nearly balls further apart have one direction

// Along an axis of revolution, where a ring of directions is hardly one.
bool is_polar(const PairFrame& pair, const Vec3& d) {
  const auto along = [&](const Shape& shape, const Mat3& turn) {
    const Revolution& about = revolution_of(shape);
    return about.found && !shape.proofs.sphere && d.cross(turn * about.axis).squaredNorm() < kPolar * kPolar;
  };
  return along(*pair.a, Mat3::Identity()) || along(*pair.b, pair.turn);
}

// Rings and cells know few points of the bodies, which may not face each other where it takes three or four
// to carry the contact, or where many directions are nearly level: then the supports along the best do.
__attribute__((noinline)) void make_points_face(const PairFrame& pair, double tolerance, PolytopeResult* r) {
  use_supports(pair, tolerance, r);
  const double off = off_each_other(*r);
  if (!(off > kFacing * pair.size)) return;
  PolytopeResult better = *r;
  if (PolytopeSearch(pair, tolerance, 0.0, false).find_points(&better) && off_each_other(better) < off)
    *r = better;
}

// What the gap is at most, by the balls about the centres inside: of two nearly round bodies more than a hull
// of points can say.
double gap_of_inner_balls(const PairFrame& pair) {
  return pair.offset.norm() - pair.inner_radii() + pair.roundoff;
}

bool has_rings(const Shape& shape) {
  return revolution_of(shape).found || !shape.round_edges.empty();
}

// What two attempts know together: the narrower one's points, along the direction of the higher lower end.
PolytopeResult both(const PairFrame& pair, const PolytopeResult& x, const PolytopeResult& y,
                    double tolerance) {
  PolytopeResult r = y.bracket.width() < x.bracket.width() ? y : x;
  const Bracket& higher = y.bracket.lower > x.bracket.lower ? y.bracket : x.bracket;
  r.bracket.lower = higher.lower;
  // Lower ends are supports' and hold; an upper one below another's lower end is a broken hull's.
  const auto [low, high] = std::minmax({x.bracket.upper, y.bracket.upper});
  r.bracket.upper = std::max(low < higher.lower - kBroken * pair.roundoff ? high : low, higher.lower);
  r.bracket.direction = r.points.na = higher.direction;
  r.points.nb = -higher.direction;
  r.converged = r.bracket.width() <= tolerance;
  set_gap(&r);
  use_supports(pair, tolerance, &r);
  return r;
}

// What is left where a hull does not close.
bool search_last(const PairFrame& pair, double tolerance, PolytopeResult* best) {
  if (!search_rings(pair, tolerance, true, best) && !search_cells(pair, tolerance, best)) return false;
  make_points_face(pair, tolerance, best);
  return true;
}

}  // namespace

PolytopeResult solve_polytope(const PairFrame& pair, const Vec3& seed, double tolerance, double enough,
                              SearchedBalls* balls) {
  // A hull that round-off broke (coplanar faces) or that stalled is begun again from other directions, and
  // its vertices moved at random by far more than round-off and far less than the tolerance (Barber, Dobkin &
  // Huhdanpaa 1996, section 4: joggled input); the upper bound allows for it.
  PolytopeResult best;
  double upper = kFarAway;
  if (search_segments(pair, tolerance, &best) || search_ball_hulls(pair, tolerance, &best, &upper) ||
      search_segment_in_ellipsoid(pair, seed, tolerance, &best))
    return best;
  upper = std::min(upper, gap_of_inner_balls(pair));
  // Where parts of the bodies are parts of balls, those tell more; points that balls roll about, too.
  const bool near = are_near_balls(pair),
             near_first = near && pair.offset.norm() < kOneCentre * pair.inner_radii() &&
                          !pair.a->inner_balls.found() && !pair.b->inner_balls.found() &&
                          !pair.both_swept(tolerance);
  const auto among_balls = [&]() -> const PolytopeResult& {
    if (!*balls) search_near_balls(pair, tolerance, &balls->emplace());
    return **balls;
  };
  if (near_first) {
    if (among_balls().converged) return among_balls();
    upper = std::min(upper, among_balls().bracket.upper);
  }
  Vec3 from = seed;
  bool points = true;
  double searched = kFarAway;  // the lower end with which all that is left was tried in vain
  for (int attempt = 0; attempt < kHullAttempts; ++attempt) {
    const double joggle = attempt > 0 ? std::min(kJoggle * pair.reach, 0.05 * tolerance) : 0.0;
    PolytopeSearch search(pair, tolerance, joggle, points);
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
    best = attempt == 0 || result.converged ? result : both(pair, best, result, tolerance);
    best.iterations = spent + result.iterations;
    if (best.converged || best.bracket.lower > enough || (started && !search.stalled())) break;
    from = best.bracket.direction + kHullTurn * (attempt + 1) * Vec3(0.36, -0.48, 0.8);
  }
  if (!best.converged && !(best.bracket.lower > enough) && best.bracket.lower != searched)
    search_last(pair, tolerance, &best);
  if (near && !best.converged && !(best.bracket.lower > enough))
    best = both(pair, best, among_balls(), tolerance);
  return best;
}

__attribute__((noinline)) void find_points_again(const PairFrame& pair, double tolerance, PolytopeResult* r) {
  PolytopeResult better = *r;
  if (PolytopeSearch(pair, tolerance, 0.0, false).find_points(&better) && !better.inside) *r = better;
}

}  // namespace nurbs

// The hull's growth: which directions are asked for, and what they prove; see polytope_search.h.
#include "contact/overlap/polytope_search.h"

#include <algorithm>
#include <cmath>

#include "body/cube_map.h"

namespace nurbs {
namespace {

constexpr int kPaceFrom = 384, kPaceStep = 128;  // points at which the bracket's width is looked at
constexpr double kThinnest = 1e-12;              // of the larger body: heights of points' hulls
constexpr double kNearStart = 0.9995;            // cosine between directions nearer than the atlas's
constexpr int kMostIdle = 30;                    // queries in a row that leave the bracket as it is
constexpr double kOneMinimum = 1 - 1e-6;         // cosine above which Newton has come to one minimum again
constexpr double kFlatBend = 1e-3;               // of the overlap, of its bend along a crease
constexpr int kBetweenCores = 96;                // points between tries of caps by cores

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

}  // namespace

PolytopeSearch::PolytopeSearch(const PairFrame& pair, double tolerance, double joggle, bool points)
    : pair_(pair),
      tolerance_(tolerance),
      joggle_(joggle),
      points_a_(hull_points(*pair.a, pair.scale_a, tolerance)),
      points_b_(hull_points(*pair.b, pair.scale_b, tolerance)),
      error_(pair.scale_a * points_a_.error() + pair.scale_b * points_b_.error()),
      hull_(kSliver * pair.reach) {
  const PairFrame::RollingBall ball_a = pair.ball_for_mate(*pair.a, pair.scale_a, tolerance),
                               ball_b = pair.ball_for_mate(*pair.b, pair.scale_b, tolerance);
  shrink_a_ = ball_a.radius;
  shrink_b_ = ball_b.radius;
  rise_ = ball_a.rise + ball_b.rise;
  points_ = points && pair.both_swept(tolerance);
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

HullPoints PolytopeSearch::hull_points(const Shape& shape, double scale, double tolerance) {
  return HullPoints(shape, kSupportShare * tolerance / scale, kCoreError * tolerance / scale);
}

SurfacePoint PolytopeSearch::surface_place(const Shape& shape, const HullPlace& at, const Vec3& d) {
  return at.on_surface.patch >= 0 ? at.on_surface : find_hull_support(shape, d, nullptr, kFarAway).where;
}

bool PolytopeSearch::start(const Vec3& seed) {
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

void PolytopeSearch::run(double enough, int most) {
  settle(best_);
  double last = kFarAway, near_before = -kFarAway;
  Pace pace;
  std::array<short, 3> asked = {-1, -1, -1};
  Vec3 asked_along = Vec3::Zero();
  for (int idle = 0; hull_.points() < most; ++idle) {
    if (lower_caps_) lower_caps();
    const int near = best_face();
    if (near < 0 || is_broken() || upper_ - lower_ <= tolerance_ || lower_ > enough) return;
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
    if (v < 0 || is_broken() || upper_ - lower_ <= tolerance_) return;
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

void PolytopeSearch::let_be() {
  minima_ = kMostMinima;
  balances_ = kMostBalances;
}

// The supports' bound holds whatever the hull is: one that says less than that by more than round-off is
// none, and neither is anything else that it said.
bool PolytopeSearch::is_broken() {
  if (broken_ || !(upper_ < lower_ - 2 * roundoff())) return broken_;
  return stalled_ = broken_ = true;
}

PolytopeResult PolytopeSearch::bracket() const {
  PolytopeResult r;
  r.iterations = queries_;
  r.bracket.lower = lower_;
  r.bracket.upper = broken_ ? std::max(known_, lower_) : std::max(upper_, lower_);
  r.converged = r.bracket.upper - lower_ <= tolerance_;
  r.bracket.direction = direction_;
  return r;
}

int PolytopeSearch::query(const Vec3& d, int near) {
  if (hull_.points() == kHullVertices) return -1;
  if (near >= 0 && d.dot(witness_[near].d) < kNearStart) near = -1;
  const HullPoint a = points_a_.along(d, near < 0 ? nullptr : &witness_[near].on_a),
                  b = points_b_.along(pair_.direction_on_b(d), near < 0 ? nullptr : &witness_[near].on_b);
  return take(d, a, b);
}

int PolytopeSearch::take(const Vec3& d, const HullPoint& a, const HullPoint& b) {
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

bool PolytopeSearch::start_from_points(double least, Vec3* across) {
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

bool PolytopeSearch::core_turn(int v, const Vec3& d, const Vec3& t, const Vec3& s, Mat2* turn) const {
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
bool PolytopeSearch::settle(int v) {
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

// Newton on p(d): its gradient is the support pair's offset in the tangent plane, its Hessian W_A + W_B -
// p.
int PolytopeSearch::polish(int v, bool* smooth) {
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
void PolytopeSearch::balance(const std::array<short, 3>& corners, int v) {
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
    ((hull_.point(w) - hull_.point(u)).squaredNorm() < (hull_.point(w) - hull_.point(v)).squaredNorm() ? u
                                                                                                       : v) =
        w;
  }
}

// Round a deep minimum d the hull's faces have to shrink to the root of the tolerance. Points x = W (n - d)
// of a ring of normals n lie x . W^-1 x / 2 below d's plane; with them the hull reaches as far as d's along
// every direction up to w / delta times the ring's (w: least eigenvalue of W, delta: depth). Rings that far
// apart leave the search little else to find.
void PolytopeSearch::surround(int from, double covered) {
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

Vec3 PolytopeSearch::scatter(const Vec3& g) const {
  const Vec3 x = (kJoggleWaves / pair_.reach) * g;
  return Vec3(std::sin(x[1] + 0.7 * x[2]), std::sin(x[2] + 0.6 * x[0]), std::sin(x[0] + 0.8 * x[1]));
}

int PolytopeSearch::best_face() {
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

int PolytopeSearch::closest_of(const GrowingHull::Face& f, const Vec3& d) const {
  int best = f.vertex[0];
  for (const short v : f.vertex)
    if (d.dot(witness_[v].d) > d.dot(witness_[best].d)) best = v;
  return best;
}

// Unit direction from the nearest point to the origin, square to the face or edge it lies in: the origin
// may be so near that the difference alone has lost the digits that separate flat faces.
Vec3 PolytopeSearch::away_from(const GrowingHull::Face& f, const Vec3& closest) const {
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

}  // namespace nurbs

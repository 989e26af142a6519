// The search over directions on a growing hull of the configuration space obstacle; see polytope.h.
#include "contact/polytope.h"

#include <array>
#include <cmath>

#include "contact/growing_hull.h"
#include "contact/joint_newton.h"

namespace nurbs {
namespace {

// What the hull's point of the same number came from. Left uninitialised: hundreds lie on the stack.
struct Witness {
  Vec3 a, b;  // of the shrunk bodies
  Vec3 d;     // asked
  SurfacePoint on_a, on_b;
};

// d(support point)/d(direction) of a body at a surface point whose normal is d, in the tangent plane spanned
// by t and s: J (-H)^-1 J^T with J the tangents there and H the second derivatives of d . x. False where the
// surface has no such map.
bool support_turn(const Shape& shape, const SurfacePoint& at, const Vec3& d, const Vec3& t, const Vec3& s,
                  double scale, Mat2* turn) {
  const Jet2 j = evaluate2(shape.patches[at.patch], at.u, at.v);
  Mat2 tangents, bend;
  tangents << t.dot(j.su), t.dot(j.sv), s.dot(j.su), s.dot(j.sv);
  bend << -d.dot(j.suu), -d.dot(j.suv), -d.dot(j.suv), -d.dot(j.svv);
  const double det = bend.determinant();
  if (!(bend(0, 0) > 0 && det > kSingular * bend(0, 0) * bend(1, 1))) return false;
  Mat2 inverse;
  inverse << bend(1, 1), -bend(0, 1), -bend(0, 1), bend(0, 0);
  *turn = scale / det * tangents * inverse * tangents.transpose();
  return turn->allFinite();
}

// Everything the search over directions keeps.
class Search {
 public:
  Search(const PairFrame& pair, double tolerance, double joggle)
      : pair_(pair), tolerance_(tolerance), joggle_(joggle), hull_(kSliver * pair.reach) {
    shrink_a_ = pair.scale_a * pair.a->curvature.min_radius;
    shrink_b_ = pair.scale_b * pair.b->curvature.min_radius;
    (shrink_a_ < shrink_b_ ? shrink_a_ : shrink_b_) *= kCoreShare;
    shrink_ = shrink_a_ + shrink_b_;
  }

  // Builds the first solid: along the seed and three directions that make a tetrahedron with it; where those
  // are too flat, the axes as well.
  bool start(const Vec3& seed) {
    const Vec3 d = seed.squaredNorm() > 0 ? Vec3(seed.normalized()) : Vec3(Vec3::UnitX());
    const Vec3 t = d.unitOrthogonal(), s = d.cross(t);
    query(d, -1);
    for (const double angle : {0.0, 2.0943951023931953, 4.1887902047863905})
      query(-d / 3 + 0.9428090415820634 * (std::cos(angle) * t + std::sin(angle) * s), -1);
    if (start_from_points(kFlatStart)) return true;
    for (int k = 0; k < 3; ++k)
      for (const double sign : {1.0, -1.0}) query(sign * Vec3::Unit(k), -1);
    return start_from_points(0);
  }

  void run(double enough) {
    surround_best();
    int settled = best_, polishes = 0, since = 0;
    while (hull_.points() < kHullVertices) {
      const int near = best_face();
      if (near < 0 || upper_ - lower_ <= tolerance_ || lower_ > enough) return;
      if (best_ != settled && ++since > kPolishAfter && polishes < kMostPolishes) {
        // Another minimum than the seed's: straight to it.
        since = 0;
        ++polishes;
        if (polish()) surround_best();
        settled = best_;
        continue;
      }
      const int start = closest_of(hull_.face(near), direction_to_ask_);
      const int v = query(direction_to_ask_, start);
      if (v < 0 || upper_ - lower_ <= tolerance_) return;
      if (hull_.grow(v, least_height()) != GrowingHull::Growth::grown) return;
    }
  }

  PolytopeResult result() const {
    PolytopeResult r;
    r.iterations = queries_;
    r.bracket.lower = lower_;
    r.bracket.upper = std::max(upper_, lower_);
    r.converged = upper_ - lower_ <= tolerance_;
    r.bracket.direction = direction_;
    r.points.na = direction_;
    r.points.nb = -direction_;
    const Witness& w = witness_[best_];
    Vec3 a = w.a, b = w.b;
    find_witness(&a, &b);
    r.points.a = a + shrink_a_ * direction_;
    r.points.b = b - shrink_b_ * direction_;
    r.points.on_a = w.on_a;
    r.points.on_b = w.on_b;
    const double apart = direction_.dot(r.points.b - r.points.a);
    // Where the bracket stayed open, the least overlap seen: the hull errs to first order, the direction to
    // second.
    r.gap = r.converged ? std::clamp(apart, r.bracket.lower, r.bracket.upper) : r.bracket.lower;
    // The hull lies inside the obstacle, by less than the witnesses are known sideways.
    r.points.a += 0.5 * (apart - r.gap) * direction_;
    r.points.b -= 0.5 * (apart - r.gap) * direction_;
    return r;
  }

 private:
  double roundoff() const { return kRoundoff * pair_.reach + 2 * joggle_; }
  // A point less high above a face than this is not worth adding: the bracket is as good as closed there.
  double least_height() const { return std::max(0.25 * roundoff(), kLeastHeight * tolerance_); }

  // Support pair along unit d as a new point; tightens the lower bound of the gap. `near`: a point whose
  // supports are worth starting from, or -1.
  int query(const Vec3& d, int near) {
    const int v = hull_.points();
    if (v == kHullVertices) return -1;
    const Vec3 on_b = pair_.direction_on_b(d);
    const double enough = kSupportShare * tolerance_;
    const Support sa = find_hull_support(*pair_.a, d, near < 0 ? nullptr : &witness_[near].on_a,
                                         enough / pair_.scale_a),
                  sb = find_hull_support(*pair_.b, on_b, near < 0 ? nullptr : &witness_[near].on_b,
                                         enough / pair_.scale_b);
    Witness& w = witness_[v];
    w.a = pair_.place_a(sa.point) - shrink_a_ * d;
    w.b = pair_.place_b(sb.point) + shrink_b_ * d;
    w.d = d;
    w.on_a = sa.where;
    w.on_b = sb.where;
    Vec3 g = w.a - w.b;
    if (joggle_ > 0) g += joggle_ * scatter(g);
    hull_.store(g);
    ++queries_;
    const double p = pair_.scale_a * sa.upper + pair_.scale_b * sb.upper - d.dot(pair_.offset);
    if (-p > lower_) {
      lower_ = -p;
      direction_ = d;
      best_ = v;
    }
    return v;
  }

  // The tetrahedron of largest volume among the points, greedily, and the others onto it. False where it is
  // lower than `least` of its own size.
  bool start_from_points(double least) {
    int pick[4] = {0, -1, -1, -1};
    const auto g = [&](int k) -> const Vec3& { return hull_.point(k); };
    double size = 0, volume = 0;
    for (int want = 1; want < 4; ++want) {
      double best = 0;
      for (int k = 0; k < hull_.points(); ++k) {
        const Vec3 e = g(k) - g(pick[0]);
        double measure;
        if (want == 1)
          measure = e.norm();
        else if (want == 2)
          measure = e.cross(g(pick[1]) - g(pick[0])).norm();
        else
          measure = std::abs(e.dot((g(pick[1]) - g(pick[0])).cross(g(pick[2]) - g(pick[0]))));
        if (measure > best) {
          best = measure;
          pick[want] = k;
        }
      }
      if (pick[want] < 0) return false;
      (want == 1 ? size : volume) = best;
    }
    if (!(volume > least * size * size * size)) return false;
    if (!hull_.start(pick[0], pick[1], pick[2], pick[3])) return false;
    for (int k = 0; k < hull_.points(); ++k)
      if (k != pick[0] && k != pick[1] && k != pick[2] && k != pick[3]) hull_.grow(k, least_height());
    return true;
  }

  // Round a deep minimum d the hull's faces have to shrink to the root of the tolerance. Points x = W (n - d)
  // of a ring of normals n lie x . W^-1 x / 2 below d's plane; with them the hull reaches as far as d's along
  // every direction up to w / delta times the ring's (w: least eigenvalue of W, delta: depth). Rings that far
  // apart leave the search little else to find.
  void surround_best() {
    const double depth = -(lower_ + shrink_);
    if (!(depth > 0)) return;
    const int from = best_;
    const Vec3 d = direction_, t = d.unitOrthogonal(), s = d.cross(t);
    Mat2 wa, wb;
    const Witness& w = witness_[from];
    const bool round = support_turn(*pair_.a, w.on_a, d, t, s, pair_.scale_a, &wa) &&
                       support_turn(*pair_.b, w.on_b, pair_.direction_on_b(d), pair_.turn.transpose() * t,
                                    pair_.turn.transpose() * s, pair_.scale_b, &wb);
    if (!round) return;
    Mat2 along = wa + wb - shrink_ * Mat2::Identity();
    Mat2 axes = Mat2::Identity();
    const double mean = 0.5 * along.trace(), half = 0.5 * (along(0, 0) - along(1, 1)),
                 spread = std::hypot(half, along(0, 1)), least = mean - spread, most = mean + spread;
    if (!(least > kLeastSpread * depth)) return;
    const double angle = 0.5 * std::atan2(along(0, 1), half);
    axes << std::cos(angle), -std::sin(angle), std::sin(angle), std::cos(angle);
    const double ratio = std::clamp(kRingShare * least / depth, kLeastRing, kMostRing);
    double phase = 0;
    // r: root of twice the drop.
    for (double r = std::sqrt(tolerance_); r / std::sqrt(most) < kWidestRing; r *= ratio) {
      for (int k = 0; k < 4; ++k) {
        const double turn = phase + 0.5 * M_PI * k;
        const Vec2 tilt =
            axes * Vec2(r * std::cos(turn) / std::sqrt(most), r * std::sin(turn) / std::sqrt(least));
        if (tilt.norm() > kWidestTilted) continue;
        const int v = query((d + tilt[0] * t + tilt[1] * s).normalized(), from);
        if (v < 0) return;
        hull_.grow(v, least_height());
      }
      phase += M_PI / 4;
    }
  }

  // Newton from the best points to the minimum they are near.
  bool polish() {
    const Witness& w = witness_[best_];
    const JointSolution s = solve_joint(pair_, w.on_a, w.on_b, tolerance_, kFarAway, kPolishIterations);
    if (!s.converged && !s.stationary) return false;
    const int before = best_;
    const int v = query(s.normal, best_);
    if (v < 0) return false;
    hull_.grow(v, least_height());
    return best_ != before;
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
    upper_ = std::min(upper_, (near.inside ? -distance : distance) - shrink_ + roundoff());
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
    int on[3], count = 0;
    for (int k = 0; k < 3; ++k)
      if (f.weights[k] > 0) on[count++] = f.vertex[k];
    Vec3 d = -closest;
    if (count == 2) {
      const Vec3 edge = (hull_.point(on[1]) - hull_.point(on[0])).normalized();
      d -= edge.dot(d) * edge;
    }
    return d.normalized();
  }

  // The witnesses of direction_: the hull's point nearest to the origin or, when that is inside, to its foot
  // on the supporting plane. A flat of the obstacle is several triangles; witnesses from another one, or from
  // the far side of a body that has two equal minima, would not face each other.
  void find_witness(Vec3* a, Vec3* b) const {
    const Vec3 target = std::min(0.0, lower_ + shrink_) * -direction_;
    double best = kFarAway;
    for (int k = 0; k < hull_.faces(); ++k) {
      const GrowingHull::Face& f = hull_.face(k);
      if (!f.alive) continue;
      const Vec3 &p = hull_.point(f.vertex[0]), &q = hull_.point(f.vertex[1]), &r = hull_.point(f.vertex[2]);
      const Vec3 w = nearest_on_triangle(p - target, q - target, r - target);
      const double distance = (w[0] * p + w[1] * q + w[2] * r - target).squaredNorm();
      if (!(distance < best)) continue;
      best = distance;
      *a = *b = Vec3::Zero();
      for (int i = 0; i < 3; ++i) {
        *a += w[i] * witness_[f.vertex[i]].a;
        *b += w[i] * witness_[f.vertex[i]].b;
      }
    }
  }

  const PairFrame& pair_;
  double tolerance_, joggle_;
  double shrink_a_, shrink_b_, shrink_;
  double lower_ = -kFarAway, upper_ = kFarAway;
  Vec3 direction_ = Vec3::UnitX(), direction_to_ask_ = Vec3::UnitX();
  int best_ = 0, queries_ = 0;
  Witness witness_[kHullVertices];
  GrowingHull hull_;
};

}  // namespace

PolytopeResult solve_polytope(const PairFrame& pair, const Vec3& seed, double tolerance, double enough) {
  // A hull that round-off broke (coplanar faces) or that stalled is begun again from other directions, and
  // its vertices moved at random by far more than round-off and far less than the tolerance (Barber, Dobkin &
  // Huhdanpaa 1996, section 4: joggled input); the upper bound allows for it.
  PolytopeResult best;
  Vec3 from = seed;
  for (int attempt = 0; attempt < kHullAttempts; ++attempt) {
    const double joggle = attempt > 0 ? std::min(kJoggle * pair.reach, 0.05 * tolerance) : 0.0;
    Search search(pair, tolerance, joggle);
    if (search.start(from)) search.run(enough);
    const PolytopeResult result = search.result();
    const int spent = attempt > 0 ? best.iterations : 0;
    if (attempt == 0 || result.bracket.width() < best.bracket.width()) best = result;
    best.iterations = spent + result.iterations;
    if (best.converged || best.bracket.lower > enough) break;
    from = best.bracket.direction + kHullTurn * (attempt + 1) * Vec3(0.36, -0.48, 0.8);
  }
  return best;
}

}  // namespace nurbs

// Branch and bound over directions with second-order bounds; see cell_search.h.
#include "contact/overlap/cell_search.h"

#include <algorithm>
#include <cmath>

#include "body/cube_map.h"
#include "body/hull_point.h"
#include "contact/local_bend.h"
#include "contact/overlap/closing.h"

namespace nurbs {
namespace {

constexpr int kMostCells = 2400;
constexpr int kBeforeHopeless = 600;    // of them, after which a hopeless one ends
constexpr int kFirstCells = 2;          // per edge of the cube
constexpr int kMostHalvings = 26;       // halvings
constexpr int kPieces = 6;              // of a body that are looked at
constexpr int kMeans = 7;               // pairs of pieces that are weighed
constexpr double kMostNoise = 0.05;     // of the tolerance
constexpr double kWidest = 0.5;         // rad: no bends are asked for beyond
constexpr double kAxial = 3;            // of a cell's half width: nearer to an axis circles are points
constexpr double kRounded = 1 - 1e-12;  // of a profile's radii
constexpr double kCircleRate = 1.155;   // 2 / sqrt(3), of a circle's bend: see cell_search.h
constexpr double kNarrow = 2e-3;        // rad: in cells of less, three pieces may be level
constexpr double kWitness = 1e-3;       // rad, about the minimum, of pieces that may carry it

// In a body, and how the support bends from it on: see cell_search.h.
struct Piece {
  Vec3 x;
  Mat2 bend = Mat2::Zero();
  double rate = 0;
  double height = 0;
};

struct Pieces {
  int count = 0;
  Piece piece[kPieces];
  double upper = 0;  // of the support along d

  // Keeps the highest.
  void add(const Piece& p) {
    int k = count < kPieces ? count++ : kPieces;
    for (; k > 0 && (k == kPieces || piece[k - 1].height < p.height); --k)
      if (k < kPieces)
        piece[k] = piece[k - 1];
      else if (!(piece[k - 1].height < p.height))
        return;
    piece[k] = p;
  }
};

// Of one piece of each, or a mean of such.
struct Mean {
  Vec3 a, b;
  double y;
  Vec2 slope;
  Mat2 bend;
  double rate;

  static Mean of(const Mean& p, double wp, const Mean& q, double wq) {
    return {wp * p.a + wq * q.a,         wp * p.b + wq * q.b,       wp * p.y + wq * q.y,
            wp * p.slope + wq * q.slope, wp * p.bend + wq * q.bend, wp * p.rate + wq * q.rate};
  }
};

// One body: e = sign d, lengths of the lab, axes of the pair frame.
struct Side {
  const Shape* shape;
  double scale, sign;
  Mat3 turn;
  Vec3 centre;
  bool sphero, revolved;
  double ball = 0;  // of a sphero-polyhedron, left out of its pieces
  double error = 0;
  Vec3 axis, point;
};

class CellSearch {
 public:
  CellSearch(const PairFrame& pair, double tolerance)
      : pair_(pair),
        tolerance_(tolerance),
        a_(side(*pair.a, pair.scale_a, 1, Mat3::Identity(), Vec3::Zero())),
        b_(side(*pair.b, pair.scale_b, -1, pair.turn, pair.offset)),
        balls_(a_.ball + b_.ball),
        points_a_(*pair.a, kSupportShare * tolerance / pair.scale_a, kMostNoise * tolerance / pair.scale_a),
        points_b_(*pair.b, kSupportShare * tolerance / pair.scale_b, kMostNoise * tolerance / pair.scale_b),
        noise_(8 * pair.noise + a_.error + b_.error) {}

  bool run(PolytopeResult* result) {
    best_ = -result->bracket.lower;
    best_d_ = result->bracket.direction;
    if (!(serves(a_) && serves(b_) && best_ > tolerance_ && noise_ < kMostNoise * tolerance_)) return false;
    if (!close()) return false;
    fill(result);
    return true;
  }

 private:
  struct Cell {
    int face;
    double a, b, half;
  };

  static bool serves(const Side& s) { return s.sphero || s.revolved; }

  Side side(const Shape& shape, double scale, double sign, const Mat3& turn, const Vec3& centre) const {
    Side s{&shape, scale, sign, turn, centre, false, false, 0, 0, Vec3::Zero(), Vec3::Zero()};
    s.sphero = PairFrame::is_swept(shape, scale, tolerance_);
    s.revolved = !s.sphero && shape.revolution.found && !shape.meridian.empty() && !shape.proofs.sphere;
    if (s.sphero) {
      s.ball = scale * shape.core.radius;
      s.error = scale * shape.core.error;
    } else if (s.revolved) {
      s.axis = (turn * shape.revolution.axis).normalized();
      s.point = centre + scale * (turn * shape.revolution.point);
      s.error = scale * (shape.revolution.error + shape.meridian.error);
    }
    return s;
  }

  HullPoint hull_point(const Side& s, const Vec3& e) const {
    return (s.sign > 0 ? points_a_ : points_b_).along(s.turn.transpose() * e);
  }
  Support support(const Side& s, const Vec3& e) const {
    return find_hull_support(*s.shape, s.turn.transpose() * e, nullptr, kSupportShare * tolerance_ / s.scale);
  }

  // Pieces of a body for directions within `reach` of d, in whose tangent plane t and u are.
  void find(const Side& s, const Vec3& d, const Vec3& t, const Vec3& u, double reach, Pieces* out) const {
    const Vec3 e = s.sign * d;
    if (s.sphero)
      points(s, e, reach, out);
    else
      circles(s, e, t, u, reach, out);
  }

  void points(const Side& s, const Vec3& e, double reach, Pieces* out) const {
    const SpheroPolyhedron& core = s.shape->core;
    const Vec3 own = s.scale * (s.turn.transpose() * e);
    double most = -kFarAway;
    for (const Vec3& v : core.points) most = std::max(most, own.dot(v));
    const double near = most - 2 * reach * s.scale * s.shape->bounding_radius;
    for (const Vec3& v : core.points)
      if (const double h = own.dot(v); h >= near) {
        Piece p;
        p.x = s.centre + s.scale * (s.turn * v);
        p.height = h;
        out->add(p);
      }
    out->upper = most + s.ball + s.error + e.dot(s.centre);
  }

  void circles(const Side& s, const Vec3& e, const Vec3& t, const Vec3& u, double reach, Pieces* out) const {
    const HullPoint on = hull_point(s, e);
    out->upper = s.scale * on.upper + e.dot(s.centre);
    const double cosine = e.dot(s.axis);
    const Vec3 across = e - cosine * s.axis;
    const double sine = across.norm();
    const Vec3 n = s.turn * on.normal;
    const auto ball_within = [&](double chord) {
      const double range = kChord * chord;
      return range < kWidest ? kRounded * s.scale * s.shape->profile_radii.within(cosine, sine, range) : 0;
    };
    const double ball = ball_within(reach + (n - e).norm());
    circle(s, e, t, u, reach, s.centre + s.scale * (s.turn * on.point), n, ball, sine, out);
    if (!(sine > kAxial * reach) || reach > kWidest) return;
    // A crease, it may be, or a line that rounded edges bound: circles on either side.
    const Vec3 out_of_axis = across / sine, over = cosine * out_of_axis - sine * s.axis;
    for (const double off : {-reach, reach}) {
      const Vec3 other = (e + off * over).normalized();
      const HullPoint beside = hull_point(s, other);
      const Vec3 normal = s.turn * beside.normal;
      const double there = ball > 0 ? ball_within(reach + (normal - e).norm()) : 0;
      circle(s, e, t, u, reach, s.centre + s.scale * (s.turn * beside.point), normal, there, sine, out);
    }
  }

  // The circle through x, less a ball that touches it there from inside.
  void circle(const Side& s, const Vec3& e, const Vec3& t, const Vec3& u, double reach, const Vec3& x,
              const Vec3& n, double ball, double sine, Pieces* out) const {
    const Vec3 from = x - s.point;
    const double z = from.dot(s.axis), r = (from - z * s.axis).norm();
    const double nz = n.dot(s.axis), nr = (n - nz * s.axis).norm();
    Piece p;
    if (sine > kAxial * reach) {
      // The circle's own bend, outward or, where the ball is larger than the body is wide, inward.
      const Vec3 outward = (e - e.dot(s.axis) * s.axis) / sine, round = s.axis.cross(outward);
      const double left = r - ball * nr, least = sine - reach;
      const Vec2 along(round.dot(t), round.dot(u));
      p.x = s.point + left * outward + (z - ball * nz) * s.axis + ball * e;
      p.bend = ball * Mat2::Identity() + left / sine * along * along.transpose();
      p.rate =
          kCircleRate * std::abs(left) * std::min(1.0, std::abs(e.dot(s.axis)) + reach) / (least * least);
    } else {
      ball = nr * ball > r ? r / nr : ball;
      p.bend = ball * Mat2::Identity();
      p.x = x + ball * (e - n);
    }
    p.height = e.dot(p.x);
    out->add(p);
  }

  // y + s.x + x.H x / 2 over a box: x[0] (along `across`) in [from, to], |x[1]| <= side. Exact where the
  // least is on an edge of the box, as in a crease.
  static double least_in_box(const Mean& m, const Vec2& across, double from, double to, double side,
                             Vec2* where) {
    const Vec2 along(-across[1], across[0]);
    const Mat2 h = m.bend - m.y * Mat2::Identity();
    const double h00 = across.dot(h * across), h01 = across.dot(h * along), h11 = along.dot(h * along),
                 s0 = across.dot(m.slope), s1 = along.dot(m.slope);
    double least = kFarAway;
    const auto on_line = [&](double base, double slope, double bend, double low, double high, double* x) {
      double best = kFarAway;
      const auto at = [&](double z) {
        const double value = base + z * (slope + 0.5 * bend * z);
        if (value < best) best = value, *x = z;
      };
      at(low), at(high);
      if (bend > 0 && -slope > bend * low && -slope < bend * high) at(-slope / bend);
      return best;
    };
    const auto take = [&](double value, const Vec2& x) {
      if (value < least) least = value, *where = x;
    };
    double x = 0;
    for (const double e : {from, to})
      take(on_line(m.y + e * (s0 + 0.5 * h00 * e), s1 + h01 * e, h11, -side, side, &x),
           e * across + x * along);
    for (const double e : {-side, side})
      take(on_line(m.y + e * (s1 + 0.5 * h11 * e), s0 + h01 * e, h00, from, to, &x), x * across + e * along);
    // Inside, only if both bends are upwards.
    const double det = h00 * h11 - h01 * h01;
    if (h00 > 0 && det > 0) {
      const double x0 = (h01 * s1 - h11 * s0) / det, x1 = (h01 * s0 - h00 * s1) / det;
      if (x0 > from && x0 < to && std::abs(x1) < side)
        take(m.y + 0.5 * (s0 * x0 + s1 * x1), x0 * across + x1 * along);
    }
    return least;
  }

  // A cell about its middle: the angle, at most a right one, and its sine and cosine.
  struct Range {
    double angle, sine, cosine;
    explicit Range(double reach)
        : angle(std::min(reach, 0.5 * M_PI)), sine(std::sin(angle)), cosine(std::cos(angle)) {}
  };

  // What the cosines and the rate take from that within a range.
  static double left_out(const Mean& m, const Range& range) {
    const double half = 1 / (1 + range.cosine) - 0.5, down = std::max(0.0, m.y - extremes(m.bend).least);
    return half * down * range.sine * range.sine + m.rate * range.angle * range.angle * range.angle / 6;
  }

  static double least_of(const Mean& m, const Range& range, double left, Vec2* where) {
    const double r = range.sine;
    return least_in_box(m, Vec2::UnitX(), -r, r, r, where) - left;
  }

  // Of the higher of two, on either side of the line on which they are level. `left_p`, `left_q`: left out.
  static double least_of(const Mean& p, const Mean& q, const Range& range, double left_p, double left_q,
                         double enough, Vec2* where) {
    const Vec2 apart = q.slope - p.slope;
    const double steep = apart.norm(), r = range.sine;
    if (!(steep > 0)) return -kFarAway;
    const Vec2 across = apart / steep;
    const double level = std::clamp((p.y - q.y) / steep, -r, r);
    Vec2 other;
    const double low = least_in_box(p, across, -r, level, r, where) - left_p,
                 high = least_in_box(q, across, level, r, r, &other) - left_q;
    if (high < low) *where = other;
    const double least = std::min(low, high);
    // Where they are level is a line but to second order: in a strip along it that holds it, their mean that
    // is level across it.
    double share;
    if (least >= enough || !CellSearch::level(p, q, &share)) return least;
    const Mat2 differ = (q.bend - p.bend) - (q.y - p.y) * Mat2::Identity();
    const double strip = differ.norm() * r * r / steep;
    const double from = std::max(-r, level - strip), to = std::min(r, level + strip);
    const Mean both = Mean::of(p, 1 - share, q, share);
    Vec2 at;
    double better = least_in_box(both, across, from, to, r, &at) - left_out(both, range);
    const auto take = [&](double value, const Vec2& x) {
      if (value < better) better = value, at = x;
    };
    if (from > -r) take(least_in_box(p, across, -r, from, r, &other) - left_p, other);
    if (to < r) take(least_in_box(q, across, to, r, r, &other) - left_q, other);
    if (better > least) *where = at;
    return std::max(least, better);
  }

  // The best bound that the pieces give, alone, by two, and, where three are level, by their means.
  double bound(const Vec3& d, const Vec3& t, const Vec3& u, double reach, const Pieces& a, const Pieces& b,
               double enough, Vec2* where) const {
    Mean mean[kPieces * kPieces];
    const int count = means(d, t, u, a, b, mean);
    const Range range(reach);
    double best = -kFarAway, left[kMeans];
    for (int i = 0; i < count; ++i) left[i] = left_out(mean[i], range);
    Vec2 at;
    const auto take = [&](double least) {
      if (least > best) best = least, *where = at;
      return best >= enough;
    };
    for (int i = 0; i < count; ++i)
      if (take(least_of(mean[i], range, left[i], &at))) return best;
    for (int i = 0; i < count; ++i)
      for (int j = i + 1; j < count; ++j)
        if (take(least_of(mean[i], mean[j], range, left[i], left[j], enough, &at))) return best;
    if (reach > kNarrow) return best;
    for (int i = 0; i < count; ++i)
      for (int j = i + 1; j < count; ++j)
        for (int k = j + 1; k < count; ++k) {
          Vec3 w;
          if (!level(mean[i], mean[j], mean[k], &w)) continue;
          const Mean all = Mean::of(Mean::of(mean[i], w[0], mean[j], w[1]), 1, mean[k], w[2]);
          if (take(least_of(all, range, left_out(all, range), &at))) return best;
        }
    return best;
  }

  // All pairs of pieces, the highest first; the number kept.
  int means(const Vec3& d, const Vec3& t, const Vec3& u, const Pieces& a, const Pieces& b, Mean* mean) const {
    int count = 0;
    for (int i = 0; i < a.count; ++i)
      for (int j = 0; j < b.count; ++j) {
        const Piece &p = a.piece[i], &q = b.piece[j];
        const Vec3 g = p.x - q.x;
        mean[count++] = {p.x, q.x, d.dot(g), Vec2(t.dot(g), u.dot(g)), p.bend + q.bend, p.rate + q.rate};
      }
    const int kept = std::min(count, kMeans);
    std::partial_sort(mean, mean + kept, mean + count,
                      [](const Mean& x, const Mean& y) { return x.y > y.y; });
    return kept;
  }

  // The mean of two whose slope is least, if it is between them.
  static bool level(const Mean& p, const Mean& q, double* share) {
    const Vec2 apart = q.slope - p.slope;
    *share = -p.slope.dot(apart) / apart.squaredNorm();
    return *share > 0 && *share < 1;
  }
  // The mean of three without slope, if it is between them.
  static bool level(const Mean& p, const Mean& q, const Mean& r, Vec3* w) {
    const auto cross = [](const Vec2& x, const Vec2& y) { return x[0] * y[1] - x[1] * y[0]; };
    *w = Vec3(cross(q.slope, r.slope), cross(r.slope, p.slope), cross(p.slope, q.slope));
    const double sum = w->sum();
    if (!(std::abs(sum) > 0)) return false;
    *w /= sum;
    return w->minCoeff() > 0;
  }

  // Takes a direction, whose pieces these are, if p is less along it.
  void consider(const Vec3& d, const Pieces& a, const Pieces& b) {
    if (const double p = a.upper + b.upper; p < best_) best_ = p, best_d_ = d;
  }
  void consider(const Vec3& d) {
    Pieces a, b;
    const Vec3 t = d.unitOrthogonal(), u = d.cross(t);
    find(a_, d, t, u, kWitness, &a);
    find(b_, d, t, u, kWitness, &b);
    consider(d, a, b);
  }

  bool close() {
    Cell stack[6 * kFirstCells * kFirstCells + 3 * kMostHalvings + 4];
    int top = 0, cells = 0;
    for (int face = 0; face < 6; ++face)
      for (int i = 0; i < kFirstCells; ++i)
        for (int j = 0; j < kFirstCells; ++j)
          stack[top++] = {face, (2 * i + 1.0) / kFirstCells - 1, (2 * j + 1.0) / kFirstCells - 1,
                          1.0 / kFirstCells};
    const double smallest = 1.0 / kFirstCells / (1 << kMostHalvings) * 1.5;
    double closed = 0;  // of the cube's faces
    while (top > 0) {
      if (++cells > kMostCells || (cells > kBeforeHopeless && closed * kMostCells < kHopeless * cells))
        return false;
      const Cell cell = stack[--top];
      Vec3 d = from_cube(cell.face, cell.a, cell.b);
      // Within this of the middle: half the diagonal over |d| is the sine of no smaller angle.
      const double reach = M_SQRT2 * cell.half / d.norm() * (1 + 0.5 * cell.half);
      d.normalize();
      const Vec3 t = d.unitOrthogonal(), u = d.cross(t);
      Pieces a, b;
      find(a_, d, t, u, reach, &a);
      find(b_, d, t, u, reach, &b);
      consider(d, a, b);
      const double threshold = best_ - kClosedShare * tolerance_;
      Vec2 where;
      const double least = bound(d, t, u, reach, a, b, threshold - balls_ + noise_, &where) + balls_ - noise_;
      if (least >= threshold) {
        closed += cell.half * cell.half / 6;
        continue;
      }
      if (cell.half < 0.2) consider((d + where[0] * t + where[1] * u).normalized());
      if (cell.half < smallest) return false;
      const double half = 0.5 * cell.half;
      for (const double i : {-half, half})
        for (const double j : {-half, half}) stack[top++] = {cell.face, cell.a + i, cell.b + j, half};
    }
    cells_ = cells;
    return true;
  }

  void fill(PolytopeResult* r) const {
    r->iterations += cells_;
    const Vec3 d = best_d_;
    r->bracket.direction = d;
    r->bracket.lower = -best_;
    r->bracket.upper = -best_ + kClosedShare * tolerance_;
    r->converged = true;
    r->gap = r->bracket.lower;
    r->points.na = d;
    r->points.nb = -d;
    // The means that are as high there, the least slope first.
    const Vec3 t = d.unitOrthogonal(), u = d.cross(t);
    Pieces a, b;
    find(a_, d, t, u, kWitness, &a);
    find(b_, d, t, u, kWitness, &b);
    Mean mean[kPieces * kPieces];
    const int count = means(d, t, u, a, b, mean);
    Mean best = mean[0];
    double slope = kFarAway;
    const auto take = [&](const Mean& m) {
      if (m.y < mean[0].y - tolerance_ || !(m.slope.norm() < slope)) return;
      slope = m.slope.norm();
      best = m;
    };
    for (int i = 0; i < count; ++i) {
      take(mean[i]);
      for (int j = i + 1; j < count; ++j) {
        double share;
        if (level(mean[i], mean[j], &share)) take(Mean::of(mean[i], 1 - share, mean[j], share));
        Vec3 w;
        for (int k = j + 1; k < count; ++k)
          if (level(mean[i], mean[j], mean[k], &w))
            take(Mean::of(Mean::of(mean[i], w[0], mean[j], w[1]), 1, mean[k], w[2]));
      }
    }
    r->points.a = best.a + a_.ball * d;
    r->points.b = best.b - b_.ball * d;
    r->points.on_a = support(a_, d).where;
    r->points.on_b = support(b_, -d).where;
    part_points(r);
  }

  const PairFrame& pair_;
  const double tolerance_;
  const Side a_, b_;
  const double balls_;
  const HullPoints points_a_, points_b_;  // of bodies of revolution: by their meridians
  const double noise_;
  double best_ = kFarAway;
  Vec3 best_d_ = Vec3::UnitX();
  int cells_ = 0;
};

}  // namespace

bool search_cells(const PairFrame& pair, double tolerance, PolytopeResult* result) {
  return CellSearch(pair, tolerance).run(result);
}

}  // namespace nurbs

// See edge_search.h.
#include "contact/edge_search.h"

#include <algorithm>
#include <cmath>

#include "body/connectivity.h"
#include "contact/support_bracket.h"

namespace nurbs {
namespace {

constexpr int kEdgeIterations = 8;       // 1 or 2 are usual
constexpr double kLeastCrossing = 1e-4;  // sine of the angle between edges
constexpr double kGoesOn = 0.99;         // cosine of the angle between an edge and the one that it goes on as
constexpr double kAcross = 0.1;          // cosine between an edge and a normal that it may be square to
constexpr double kRoomyBall = 4;         // of the overlap: a ball that serves ...
constexpr double kLeastBall = 1e-3;      // ... and of the size
constexpr double kOffShare = 0.01;       // of lambda, that makes up for r

// What a contact point is free to move on: 2 parameters on a surface, 1 on an edge, none at a vertex.
struct Feature {
  int freedom = 2;
  int edge = -1;  // of the patch, as EdgeLink counts; of an edge

  bool along_v() const { return edge < 2; }  // the edge's free parameter
};

// Puts a point that is all but on a sharp edge there.
Feature feature_at(const Shape& shape, SurfacePoint* at) {
  Feature f;
  if (shape.smooth) return f;
  const double end[4] = {at->u, 1 - at->u, at->v, 1 - at->v};
  for (int edge = 0; edge < 4; ++edge) {
    if (end[edge] > kOnEdge) continue;
    const EdgeLink& link = shape.links[at->patch][edge];
    if (!link.opens()) continue;
    (edge < 2 ? at->u : at->v) = edge % 2;
    f.freedom = link.collapsed ? 0 : f.freedom - 1;
    f.edge = edge;
    if (f.freedom == 0) break;
  }
  return f;
}

// A corner of a patch, and a sharp edge that ends there.
struct EdgeEnd {
  SurfacePoint at;
  int edge;
};

// The sharp edges that end where a corner of a patch is, from patch to patch around it; a pole is the corners
// at both its ends.
class EdgesAround {
 public:
  EdgesAround(const Shape& shape, const SurfacePoint& at) : shape_(shape) {
    const bool on_u = at.u <= 0 || at.u >= 1, on_v = at.v <= 0 || at.v >= 1;
    const auto& links = shape.links[at.patch];
    const bool pole_u = on_u && links[edge_u(at)].collapsed, pole_v = on_v && links[edge_v(at)].collapsed;
    if (on_u && on_v) look_around(at);
    for (const double end : {0.0, 1.0}) {
      if (pole_v && end != at.u) look_around({at.patch, end, at.v});
      if (pole_u && end != at.v) look_around({at.patch, at.u, end});
    }
  }

  const EdgeEnd* begin() const { return end_; }
  const EdgeEnd* end() const { return end_ + count_; }

 private:
  static constexpr int kMost = 24, kMostPatches = 12;

  static int edge_u(const SurfacePoint& at) { return at.u <= 0 ? 0 : 1; }
  static int edge_v(const SurfacePoint& at) { return at.v <= 0 ? 2 : 3; }

  void look_around(const SurfacePoint& corner) {
    add(corner, edge_u(corner));
    add(corner, edge_v(corner));
    if (!turn(corner, edge_u(corner))) turn(corner, edge_v(corner));
  }
  // Whether that came full circle.
  bool turn(const SurfacePoint& corner, int through) {
    SurfacePoint at = corner;
    for (int k = 0; k < kMostPatches; ++k) {
      const EdgeLink& link = shape_.links[at.patch][through];
      if (link.patch < 0 || link.collapsed) return false;
      at = across(shape_.patches, link, at, through);
      at.u = std::round(at.u);
      at.v = std::round(at.v);
      if (at.patch == corner.patch && at.u == corner.u && at.v == corner.v) return true;
      through = link.edge == edge_u(at) ? edge_v(at) : edge_u(at);
      add(at, through);
    }
    return false;
  }
  void add(const SurfacePoint& at, int edge) {
    const EdgeLink& link = shape_.links[at.patch][edge];
    if (count_ < kMost && link.opens() && !link.collapsed) end_[count_++] = {at, edge};
  }

  const Shape& shape_;
  EdgeEnd end_[kMost];
  int count_ = 0;
};

// The derivative of an edge from one of its ends inward, axes of the shape.
Vec3 away_from(const Shape& shape, const EdgeEnd& end) {
  const Jet1 jet = evaluate1(shape.patches[end.at.patch], end.at.u, end.at.v);
  const bool v = end.edge < 2;
  return (v ? end.at.v : end.at.u) > 0.5 ? Vec3(-(v ? jet.sv : jet.su)) : (v ? jet.sv : jet.su);
}

// One body's point with its derivatives, pair frame, lengths of the lab.
struct Side {
  const Shape* shape;
  double scale;
  Feature feature;
  SurfacePoint at;
  JetLanes jet;
  Vec3 x, along, bend;  // the point; of an edge the tangent and second derivative by its parameter

  void evaluate(const PairFrame& pair, bool is_a) {
    evaluate2(shape->patches[at.patch], at.u, at.v, &jet);
    if (is_a)
      nurbs::scale(scale, &jet);
    else
      place(scale * pair.turn, pair.offset, &jet);
    x = jet.at(JetLanes::kS);
    const bool v = feature.along_v();
    along = jet.at(v ? JetLanes::kSv : JetLanes::kSu);
    bend = jet.at(v ? JetLanes::kSvv : JetLanes::kSuu);
  }
  // On the surface; false where the step leaves the patch, or is a long one.
  bool move(double du, double dv) {
    if (!(std::max(std::abs(du), std::abs(dv)) <= kLargestStep)) return false;
    at.u += du;
    at.v += dv;
    return at.on_patch();
  }
  // On the edge; where the step leaves it, to the start of the one that goes on from there.
  bool move(double t) {
    const double next = parameter() + t;
    if (next >= 0 && next <= 1) {
      set_parameter(next);
      return true;
    }
    set_parameter(next < 0 ? 0 : 1);
    const Vec3 ahead = -away_from(*shape, {at, feature.edge}).normalized();
    for (const EdgeEnd& end : EdgesAround(*shape, at))
      if (away_from(*shape, end).normalized().dot(ahead) > kGoesOn) {
        at = end.at;
        feature.edge = end.edge;
        return true;
      }
    return false;
  }
  double parameter() const { return feature.along_v() ? at.v : at.u; }
  void set_parameter(double t) { (feature.along_v() ? at.v : at.u) = t; }
  double speed() const { return along.norm(); }

  // Radius R of the header's bound.
  double radius() const {
    const EdgeCurve& curve = shape->edge_curves[at.patch][feature.edge];
    if (!curve.sharp()) return 0;
    const double t = parameter(), length = curve.speed * std::min(t, 1 - t);
    return scale * (curve.bend * length >= 1 ? 1 / curve.bend : length * (2 - curve.bend * length));
  }
};

struct Solved {
  Vec3 normal;  // from A to B
  int steps;
};

// Both edges: where they are square to the line between them.
bool solve_edges(const PairFrame& pair, Side& a, Side& b, const Vec3& direction, double tilt, Solved* out) {
  for (out->steps = 1; out->steps <= kEdgeIterations; ++out->steps) {
    a.evaluate(pair, true);
    b.evaluate(pair, false);
    const Vec3 g = a.x - b.x;
    const double fa = g.dot(a.along), fb = g.dot(b.along), ab = a.along.dot(b.along);
    const double haa = a.along.squaredNorm() + g.dot(a.bend), hbb = g.dot(b.bend) - b.along.squaredNorm();
    const double det = -haa * hbb - ab * ab;  // minus that of (haa, -ab; ab, hbb)
    if (!(det > kSingular * (std::abs(haa * hbb) + ab * ab))) return false;
    const double sa = (fa * hbb + fb * ab) / det, sb = (fb * haa - fa * ab) / det;
    const Vec3 square = a.along.cross(b.along);
    const double sine = square.norm();
    if (!(sine > kLeastCrossing * a.speed() * b.speed())) return false;
    out->normal = square / (square.dot(direction) > 0 ? sine : -sine);
    const double turn = std::abs(sa) * a.bend.norm() / a.speed() + std::abs(sb) * b.bend.norm() / b.speed();
    const double way = std::abs(sa) * a.speed() + std::abs(sb) * b.speed();
    if (turn * a.speed() * b.speed() <= tilt * sine && way <= kStationary * pair.reach) return true;
    if (!a.move(sa) || !b.move(sb)) return false;
  }
  return false;
}

// An edge or a vertex, and a surface: the edge is square to the surface's normal, on which its point lies.
bool solve_surface(const PairFrame& pair, Side& sharp, Side& round, bool sharp_is_a, double tilt,
                   Solved* out) {
  for (out->steps = 1; out->steps <= kEdgeIterations; ++out->steps) {
    sharp.evaluate(pair, sharp_is_a);
    round.evaluate(pair, !sharp_is_a);
    const Vec3 su = round.jet.at(JetLanes::kSu), sv = round.jet.at(JetLanes::kSv), cross = su.cross(sv);
    const double area2 = cross.squaredNorm();
    if (!(area2 > kPoleNormal * kPoleNormal * su.squaredNorm() * sv.squaredNorm())) return false;
    const Vec3 n = cross / std::sqrt(area2), g = sharp.x - round.x;
    Lane8 with_n, with_g;
    dot(round.jet, n, &with_n);
    dot(round.jet, g, &with_g);
    Mat2 first, second, metric;
    first << su.squaredNorm(), su.dot(sv), su.dot(sv), sv.squaredNorm();
    second << with_n[3], with_n[4], with_n[4], with_n[5];
    Mat2 m;
    m << with_g[3] - first(0, 0), with_g[4] - first(0, 1), with_g[4] - first(0, 1), with_g[5] - first(1, 1);
    const Vec2 f(with_g[1], with_g[2]);
    const double det = m.determinant();
    if (!(std::abs(det) > kSingular * area2)) return false;
    const Mat2 inverse = m.inverse();
    double step = 0;
    Vec2 on_round = -(inverse * f);
    if (sharp.feature.freedom == 1) {
      // n turns by -(second first^-1) along the tangents; the surface point follows the edge's.
      const Vec2 across(sharp.along.dot(su), sharp.along.dot(sv));
      const Vec2 turned = -(second * (first.inverse() * across));
      const Vec2 follow = -(inverse * across);
      const double slope = n.dot(sharp.bend) + turned.dot(follow);
      if (!(slope * pair.size > kFlatCurvature * sharp.along.squaredNorm())) return false;
      step = -(n.dot(sharp.along) + turned.dot(on_round)) / slope;
      on_round += step * follow;
    }
    out->normal = sharp_is_a ? Vec3(-n) : n;
    const Vec3 moved = on_round[0] * su + on_round[1] * sv;
    const Vec2 turn = second * on_round;
    const double way = moved.norm() + std::abs(step) * sharp.speed();
    const double angle2 = turn.dot(first.inverse() * turn);
    if (angle2 <= tilt * tilt && way <= kStationary * pair.reach) return true;
    if (!round.move(on_round[0], on_round[1])) return false;
    if (sharp.feature.freedom == 1 && !sharp.move(step)) return false;
  }
  return false;
}

// Most that the gap can be, of two edges that meet at points an overlap of `depth` along n and `off` across
// it apart.
double gap_of_edges(const PairFrame& pair, const Side& a, const Side& b, const Vec3& n, double depth,
                    double off) {
  if (!(depth > 0)) return std::hypot(depth, off);
  const double ra = a.radius(), rb = b.radius(), cosine = a.along.dot(b.along) / (a.speed() * b.speed());
  // Eigenvalues of ra t t' + rb s s', cos between t and s.
  const double mean = 0.5 * (ra + rb), det = ra * rb * (1 - cosine * cosine);
  const double least = det / (mean + std::sqrt(std::max(0.0, mean * mean - det)));
  const double lambda = 0.5 * (1 - kOffShare) * least;
  if (!(lambda > depth)) return kFarAway;
  const double c = depth / lambda - 1, along = pair.offset.dot(n), across = (pair.offset - along * n).norm();
  if (!(along >= 0) || !(pair.inner_radii() - along * c - across * std::sqrt(1 - c * c) >= depth))
    return kFarAway;
  return -depth + off * off / (2 * kOffShare * least);
}

Side side_at(const Shape& shape, double scale, const SurfacePoint& at) {
  Side side;
  side.shape = &shape;
  side.scale = scale;
  side.at = at;
  side.feature = feature_at(shape, &side.at);
  return side;
}

// A side that is on an edge, or at a vertex, on the edges there that d (unit, axes of the shape) may be
// square to; how many.
constexpr int kMostEdges = 3;
int edges_at(const Side& side, const Vec3& d, Side (&on)[kMostEdges]) {
  on[0] = side;
  if (side.feature.freedom == 1) return 1;
  int count = 0;
  for (const EdgeEnd& end : EdgesAround(*side.shape, side.at)) {
    if (count == kMostEdges) break;
    const Vec3 along = away_from(*side.shape, end).normalized();
    if (!(std::abs(along.dot(d)) <= kAcross)) continue;
    const bool known = std::any_of(on, on + count, [&](const Side& other) {
      return away_from(*side.shape, {other.at, other.feature.edge}).normalized().dot(along) > kGoesOn;
    });
    if (known) continue;
    on[count] = side;
    on[count].at = end.at;
    on[count++].feature = {1, end.edge};
  }
  return count;
}

bool meet(const PairFrame& pair, Side a, Side b, const Vec3& direction, double tolerance, double tilt,
          JointSolution* s) {
  const bool edges = a.feature.freedom == 1 && b.feature.freedom == 1;
  Solved solved;
  const bool found = edges                    ? solve_edges(pair, a, b, direction, tilt, &solved)
                     : b.feature.freedom == 2 ? solve_surface(pair, a, b, true, tilt, &solved)
                                              : solve_surface(pair, b, a, false, tilt, &solved);
  const Vec3& n = solved.normal;
  if (!found || !(n.dot(direction) > 0)) return false;
  PointPair p;
  p.on_a = a.at;
  p.on_b = b.at;
  p.a = a.x;
  p.b = b.x;
  double most = 0;  // that the gap can be, of edges
  if (edges) {
    const Vec3 g = p.a - p.b;
    const double depth = n.dot(g);
    most = gap_of_edges(pair, a, b, n, depth, (g - depth * n).norm()) + pair.roundoff + pair.joint_slack();
    if (!(most < kFarAway)) return false;
  }
  const auto [top_a, top_b] = hull_supports(pair, n, &a.at, &b.at, tolerance);
  const double overlap = pair.overlap_along(n, top_a.upper, top_b.upper);
  const double enough = std::max(kRoomyBall * std::abs(n.dot(p.a - p.b)), kLeastBall * pair.size);
  const auto ball = [&](const Side& side, const Vec3& d) {
    return side.feature.freedom == 2 ? touching_ball(*side.shape, side.at, d, side.scale, d, enough)
                                     : TouchingBall{0, d};
  };
  const Bracket bracket =
      edges ? Bracket{-overlap, most, n, 0, 0}
            : bracket_along(pair, n, overlap, p, ball(a, n), ball(b, pair.direction_on_b(n)));
  if (!(bracket.width() <= tolerance)) return false;
  s->set_met(p, bracket, solved.steps);
  return true;
}

}  // namespace

bool is_on_edge(const Shape& shape, const SurfacePoint& at) {
  SurfacePoint there = at;
  return feature_at(shape, &there).freedom < 2;
}

bool meet_edges(const PairFrame& pair, const Vec3& direction, double tolerance, double tilt,
                JointSolution* s) {
  if (!lies_on(*pair.a, s->points.on_a) || !lies_on(*pair.b, s->points.on_b)) return false;
  const Side a = side_at(*pair.a, pair.scale_a, s->points.on_a),
             b = side_at(*pair.b, pair.scale_b, s->points.on_b);
  const int free_a = a.feature.freedom, free_b = b.feature.freedom;
  if (free_a == 2 && free_b == 2) return false;
  if (free_a == 2 || free_b == 2 || (free_a == 1 && free_b == 1))
    return meet(pair, a, b, direction, tolerance, tilt, s);
  // The support of a straight edge along a normal of it is an end of it.
  Side on_a[kMostEdges], on_b[kMostEdges];
  const int count_a = edges_at(a, direction, on_a),
            count_b = edges_at(b, pair.direction_on_b(direction), on_b);
  for (int i = 0; i < count_a; ++i)
    for (int k = 0; k < count_b; ++k)
      if (meet(pair, on_a[i], on_b[k], direction, tolerance, tilt, s)) return true;
  return false;
}

}  // namespace nurbs

// See crease_search.h.
#include "contact/crease_search.h"

#include <algorithm>
#include <cmath>

#include "body/support_turn.h"
#include "contact/certificate.h"

namespace nurbs {
namespace {

// A ball that touches at a point from inside, lab lengths; `normal` outward there.
struct Ball {
  double radius;  // 0: none is known
  Vec3 normal;
};

// At a support point along `along` (shape axes); none where that is not the surface's normal.
Ball ball(const PairFrame& pair, const Shape& shape, const Support& at, double scale, const Vec3& along) {
  const bool met = (at.normal - along).squaredNorm() <= kStationary * kStationary;
  return {met ? std::min(scale * rolling_radii(shape, at.where, at.normal).inner, pair.reach) : 0, at.normal};
}

// The bracket at points p.a, p.b of the hulls whose supports along d are at most `upper` = p(d), with balls
// there whose normals are in their shapes' axes.
Bracket bracket_along(const PairFrame& pair, const Vec3& d, double upper, const PointPair& p, const Ball& a,
                      const Ball& b) {
  const Vec3 core = (p.b - b.radius * (pair.turn * b.normal)) - (p.a - a.radius * a.normal);
  const double slack = pair.scale_a * pair.a->joint_slack + pair.scale_b * pair.b->joint_slack;
  const double unique = a.radius + b.radius;
  const double most = core.dot(d) > 0 ? core.norm() - unique + slack + kRoundoff * pair.reach : kFarAway;
  return {-upper, most, d, 0, unique};
}

// W of a body at a support point, in the basis t, s of the pair frame.
bool turn_a(const PairFrame& pair, const Support& at, const Vec3& d, const Vec3& t, const Vec3& s, Mat2* w) {
  return support_turn(*pair.a, at.where, d, d, t, s, pair.scale_a, w);
}
bool turn_b(const PairFrame& pair, const Support& at, const Vec3& on_b, const Vec3& t, const Vec3& s,
            Mat2* w) {
  const Mat3 back = pair.turn.transpose();
  return support_turn(*pair.b, at.where, on_b, on_b, back * t, back * s, pair.scale_b, w);
}

// One body's two supports, and the other's.
struct Branches {
  bool of_a;  // whose they are
  Support two[2], one;
};

// The supports near those of the step before; false if it has no such points.
bool find_again(const PairFrame& pair, const Vec3& d, const JointSolution& s, const Bridge& bridge,
                Branches* out) {
  out->of_a = bridge.of_a != 0;
  const Shape &two = out->of_a ? *pair.a : *pair.b, &one = out->of_a ? *pair.b : *pair.a;
  const Vec3 on_b = pair.direction_on_b(d), on_two = out->of_a ? d : on_b, on_one = out->of_a ? on_b : d;
  const SurfacePoint other{static_cast<int>(bridge.patch), bridge.u, bridge.v};
  if (!(bridge.patch < static_cast<double>(two.patches.size())) || !other.on_patch()) return false;
  out->two[0] = find_support(two, on_two, out->of_a ? &s.points.on_a : &s.points.on_b);
  out->two[1] = find_support(two, on_two, &other);
  out->one = find_support(one, on_one, out->of_a ? &s.points.on_b : &s.points.on_a);
  return true;
}

// The body near a dent whose two supports are nearest to equally high.
bool find_branches(const PairFrame& pair, const Vec3& d, const JointSolution& s, Branches* out) {
  const Vec3 on_b = pair.direction_on_b(d);
  const Support a = find_support(*pair.a, d, &s.points.on_a), b = find_support(*pair.b, on_b, &s.points.on_b);
  Support other_a, other_b;
  const bool may_a = find_rival(*pair.a, d, a, &other_a), may_b = find_rival(*pair.b, on_b, b, &other_b);
  if (!may_a && !may_b) return false;
  out->of_a = may_a && (!may_b ||
                        pair.scale_a * std::abs(a.h - other_a.h) <= pair.scale_b * std::abs(b.h - other_b.h));
  out->two[0] = out->of_a ? a : b;
  out->two[1] = out->of_a ? other_a : other_b;
  out->one = out->of_a ? b : a;
  return true;
}

}  // namespace

bool meet_crease(const PairFrame& pair, const Vec3& direction, double tolerance, double tilt,
                 JointSolution* s) {
  PointPair p = s->points;
  Vec3 d = direction;
  for (int k = 0; k < kWarmIterations; ++k) {
    const Vec3 on_b = pair.direction_on_b(d);
    const auto [sa, sb] = hull_supports(pair, d, &p.on_a, &p.on_b, tolerance);
    p.a = pair.place_a(sa.point);
    p.b = pair.place_b(sb.point);
    p.on_a = sa.where;
    p.on_b = sb.where;
    const double upper = pair.overlap_along(d, sa.upper, sb.upper);
    const Bracket bracket = bracket_along(pair, d, upper, p, ball(pair, *pair.a, sa, pair.scale_a, d),
                                          ball(pair, *pair.b, sb, pair.scale_b, on_b));
    const Vec3 g = p.a - p.b, t = d.unitOrthogonal(), across = d.cross(t);
    Mat2 wa, wb;
    if (!turn_a(pair, sa, d, t, across, &wa) || !turn_b(pair, sb, on_b, t, across, &wb)) return false;
    const Mat2 hessian = wa + wb - d.dot(g) * Mat2::Identity();
    const double det = hessian.determinant();
    if (!(hessian(0, 0) > 0 && det > kSingular * hessian(0, 0) * hessian(1, 1))) return false;
    const Vec2 step = -hessian.inverse() * Vec2(t.dot(g), across.dot(g));
    if (bracket.width() <= tolerance && step.norm() <= tilt) {
      s->set_met(p, bracket, k + 1);
      return true;
    }
    if (!(step.norm() <= kNormalTrust)) return false;
    d = (d + step[0] * t + step[1] * across).normalized();
  }
  return false;
}

bool meet_bridge(const PairFrame& pair, const Vec3& direction, double tolerance, double tilt,
                 JointSolution* s, Bridge* bridge) {
  if (!pair.a->dented() && !pair.b->dented()) return false;
  Vec3 d = direction;
  Branches at;
  const bool known = bridge->known();
  if (!(known ? find_again(pair, d, *s, *bridge, &at) : find_branches(pair, d, *s, &at))) return false;
  double share = known ? bridge->share : -1;  // l; below 0: not known
  for (int k = 0; k < kBridgeIterations; ++k) {
    const Vec3 on_b = pair.direction_on_b(d);
    if (k > 0) {  // each from where it was
      const auto go_on = [&](const Shape& shape, const Vec3& along, Support* support) {
        *support = find_support(shape, along, &support->where);
      };
      for (Support& one_of : at.two) go_on(at.of_a ? *pair.a : *pair.b, at.of_a ? d : on_b, &one_of);
      go_on(at.of_a ? *pair.b : *pair.a, at.of_a ? on_b : d, &at.one);
    }
    const Vec3 t = d.unitOrthogonal(), across = d.cross(t);
    const auto place = [&](const Support& x, bool on_a) {
      return on_a ? pair.place_a(x.point) : pair.place_b(x.point);
    };
    const Vec3 x[2] = {place(at.two[0], at.of_a), place(at.two[1], at.of_a)}, y = place(at.one, !at.of_a);
    if (!((x[1] - x[0]).norm() > kSameSupport * pair.reach)) return false;  // one and the same
    Mat2 w[2], w_other;
    const auto turned = [&](const Support& of, bool on_a, Mat2* to) {
      return on_a ? turn_a(pair, of, d, t, across, to) : turn_b(pair, of, on_b, t, across, to);
    };
    if (!turned(at.two[0], at.of_a, &w[0]) || !turned(at.two[1], at.of_a, &w[1]) ||
        !turned(at.one, !at.of_a, &w_other))
      return false;
    Vec2 g[2];
    double p[2];
    for (int i = 0; i < 2; ++i) {
      const Vec3 apart = at.of_a ? x[i] - y : y - x[i];
      g[i] = {t.dot(apart), across.dot(apart)};
      p[i] = d.dot(apart);
    }
    const Vec2 e = g[0] - g[1];
    if (share < 0) share = std::clamp(-g[1].dot(e) / e.squaredNorm(), 0.0, 1.0);
    // Along e the supports become equal; square to it the mean's gradient vanishes.
    Mat2 hessian = share * w[0] + (1 - share) * w[1] + w_other;
    hessian -= (share * p[0] + (1 - share) * p[1]) * Mat2::Identity();
    const double length = e.norm();
    const Vec2 u = e / length, v(-u[1], u[0]);
    const double along = (p[1] - p[0]) / length;
    const double bend = v.dot(hessian * v);
    if (!(bend > 0)) return false;
    const double side = -(g[1].dot(v) + along * v.dot(hessian * u)) / bend;  // e has no part along v
    const Vec2 step = along * u + side * v;
    const double next = -u.dot(g[1] + hessian * step) / length;
    if (!(next >= 0 && next <= 1) || !(step.norm() <= kNormalTrust)) return false;
    if (step.norm() <= tilt && std::abs(next - share) * length <= kStationary * pair.reach + tilt * length) {
      PointPair points;
      const Vec3 met = next * x[0] + (1 - next) * x[1];
      const bool first = next >= 0.5;
      const Support &nearer = at.two[first ? 0 : 1], &other_one = at.two[first ? 1 : 0];
      points.a = at.of_a ? met : y;
      points.b = at.of_a ? y : met;
      points.on_a = at.of_a ? nearer.where : at.one.where;
      points.on_b = at.of_a ? at.one.where : nearer.where;
      const Support a = confirm_support(*pair.a, d, points.on_a),
                    b = confirm_support(*pair.b, on_b, points.on_b);
      const double upper = pair.overlap_along(d, a.upper, b.upper);
      const auto ball_at = [&](const Support& of, bool on_a) {
        return on_a ? ball(pair, *pair.a, of, pair.scale_a, d) : ball(pair, *pair.b, of, pair.scale_b, on_b);
      };
      // Between two balls of one radius rolls a third.
      const Ball two[2] = {ball_at(at.two[0], at.of_a), ball_at(at.two[1], at.of_a)};
      const Ball between{std::min(two[0].radius, two[1].radius),
                         next * two[0].normal + (1 - next) * two[1].normal},
          other = ball_at(at.one, !at.of_a);
      const Bracket bracket =
          bracket_along(pair, d, upper, points, at.of_a ? between : other, at.of_a ? other : between);
      if (!(bracket.width() <= tolerance)) return false;
      s->set_met(points, bracket, k + 1);
      *bridge = {static_cast<double>(other_one.where.patch), other_one.where.u, other_one.where.v,
                 at.of_a ? 1.0 : 0.0, first ? next : 1 - next};
      return true;
    }
    share = next;
    d = (d + step[0] * t + step[1] * across).normalized();
  }
  return false;
}

}  // namespace nurbs

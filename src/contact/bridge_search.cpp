// Newton over dents; see bridge_search.h.
#include "contact/bridge_search.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "body/support_turn.h"
#include "contact/dents.h"
#include "contact/support_bracket.h"

namespace nurbs {
namespace {

// The directions a step is taken in: a unit one and a basis square to it, axes of a shape.
struct Directions {
  Vec3 d, t, s;
};

// A body's support along directions near one, to second order: h(d + e) = h + e . x + e' W e / 2.
class Branch {
 public:
  Branch(const PairFrame& pair, bool of_a, const SurfacePoint& at)
      : shape_(of_a ? pair.a : pair.b), scale_(of_a ? pair.scale_a : pair.scale_b), at_(at) {}

  // From the surface where it was left; where a Newton step from there is none to be trusted, at the support,
  // which is searched from there. False where it has no such series.
  bool look(const Directions& along) {
    if (look_on_surface(along)) return true;
    const Support found = find_support(*shape_, along.d, &at_);
    at_ = found.where;
    normal_ = found.normal;
    point_ = found.point;
    height_ = found.h;
    missed2_ = 0;
    tangent_u_ = tangent_v_ = Vec3::Zero();
    return support_turn(*shape_, at_, along.d, along.d, along.t, along.s, scale_, &turn_);
  }

  // On to where the support along d, near the one before, is to first order.
  void go_on(const Vec3& d) {
    const Vec2 step = inverse_ * Vec2(d.dot(tangent_u_), d.dot(tangent_v_));
    const SurfacePoint next{at_.patch, at_.u + step[0], at_.v + step[1]};
    at_ = next.on_patch() ? next : walk(*shape_, at_, step[0], step[1]);
  }

  const SurfacePoint& where() const { return at_; }
  const Vec3& point() const { return point_; }    // shape axes and lengths
  const Vec3& normal() const { return normal_; }  // of the surface there
  double height() const { return height_; }
  const Mat2& turn() const { return turn_; }  // W, lab lengths
  // Whether the surface point is the support itself.
  bool met() const { return missed2_ <= kStationary * kStationary; }

 private:
  bool look_on_surface(const Directions& along) {
    const Vec3& d = along.d;
    const Jet2 j = evaluate2(shape_->patches[at_.patch], at_.u, at_.v);
    const double uu = -d.dot(j.suu), uv = -d.dot(j.suv), vv = -d.dot(j.svv), det = uu * vv - uv * uv;
    if (!(uu > 0 && det > kSingular * uu * vv)) return false;
    inverse_ << vv / det, -uv / det, -uv / det, uu / det;
    const Vec2 slope(d.dot(j.su), d.dot(j.sv)), step = inverse_ * slope;
    const SurfacePoint next{at_.patch, at_.u + step[0], at_.v + step[1]};
    if (!next.on_patch() || !(step.lpNorm<Eigen::Infinity>() <= kLargestStep)) return false;
    const Vec3 cross = j.su.cross(j.sv);
    const double area2 = cross.squaredNorm();
    if (!(area2 > kPoleNormal * kPoleNormal * j.su.squaredNorm() * j.sv.squaredNorm())) return false;
    normal_ = cross / std::sqrt(area2);
    if (!(d.dot(normal_) > 0)) return false;
    missed2_ = (normal_ - d).squaredNorm();
    point_ = j.s + step[0] * j.su + step[1] * j.sv;
    height_ = d.dot(j.s) + 0.5 * slope.dot(step);
    tangent_u_ = j.su;
    tangent_v_ = j.sv;
    Mat2 tangents;
    tangents << along.t.dot(j.su), along.t.dot(j.sv), along.s.dot(j.su), along.s.dot(j.sv);
    turn_.noalias() = scale_ * tangents * inverse_ * tangents.transpose();
    return true;
  }

  const Shape* shape_;
  double scale_;
  SurfacePoint at_;
  Vec3 point_, normal_, tangent_u_, tangent_v_;
  double missed2_ = 0;  // squared angle between the normal and d
  double height_ = 0;
  Mat2 inverse_, turn_;
};

// One body's two supports, and the other's.
struct Branches {
  bool of_a;  // whose they are
  Branch two[2], one;

  Branches(const PairFrame& pair, bool two_of_a, const SurfacePoint& first, const SurfacePoint& second,
           const SurfacePoint& other)
      : of_a(two_of_a),
        two{Branch(pair, two_of_a, first), Branch(pair, two_of_a, second)},
        one(pair, !two_of_a, other) {}
};

// The supports near those of the step before; none if the body has no such points.
std::optional<Branches> known_branches(const PairFrame& pair, const JointSolution& s, const Bridge& bridge) {
  const bool of_a = bridge.of_a != 0;
  const Shape& two = of_a ? *pair.a : *pair.b;
  const SurfacePoint other{static_cast<int>(bridge.patch), bridge.u, bridge.v};
  if (!(bridge.patch < static_cast<double>(two.patches.size())) || !other.on_patch()) return std::nullopt;
  const PointPair& p = s.points;
  return Branches(pair, of_a, of_a ? p.on_a : p.on_b, other, of_a ? p.on_b : p.on_a);
}

// The body near a dent whose two supports are nearest to equally high.
std::optional<Branches> find_branches(const PairFrame& pair, const Vec3& d, double tolerance,
                                      const JointSolution& s) {
  const Vec3 on_b = pair.direction_on_b(d);
  const Support a = find_support(*pair.a, d, &s.points.on_a), b = find_support(*pair.b, on_b, &s.points.on_b);
  Support other_a, other_b;
  const bool may_a = has_dents(*pair.a, pair.scale_a, tolerance) && find_rival(*pair.a, d, a, &other_a),
             may_b = has_dents(*pair.b, pair.scale_b, tolerance) && find_rival(*pair.b, on_b, b, &other_b);
  if (!may_a && !may_b) return std::nullopt;
  const bool of_a = may_a && (!may_b || pair.scale_a * std::abs(a.h - other_a.h) <=
                                            pair.scale_b * std::abs(b.h - other_b.h));
  return of_a ? Branches(pair, true, a.where, other_a.where, b.where)
              : Branches(pair, false, b.where, other_b.where, a.where);
}

}  // namespace

bool meet_bridge(const PairFrame& pair, const Vec3& direction, double tolerance, double tilt,
                 JointSolution* s, Bridge* bridge) {
  if (!has_dents(*pair.a, pair.scale_a, tolerance) && !has_dents(*pair.b, pair.scale_b, tolerance))
    return false;
  const bool known = bridge->known();
  std::optional<Branches> branches =
      known ? known_branches(pair, *s, *bridge) : find_branches(pair, direction, tolerance, *s);
  if (!branches) return false;
  Branches& at = *branches;
  Vec3 d = direction;
  double share = known ? bridge->share : -1;  // l; below 0: not known
  for (int k = 0; k < kBridgeIterations; ++k) {
    const Vec3 t = d.unitOrthogonal(), across = d.cross(t);
    const Directions on_a{d, t, across},
        on_b{pair.direction_on_b(d), pair.turn.transpose() * t, pair.turn.transpose() * across};
    const Directions &on_two = at.of_a ? on_a : on_b, &on_one = at.of_a ? on_b : on_a;
    if (k > 0) {
      at.two[0].go_on(on_two.d);
      at.two[1].go_on(on_two.d);
      at.one.go_on(on_one.d);
    }
    if (!at.two[0].look(on_two) || !at.two[1].look(on_two) || !at.one.look(on_one)) return false;
    const auto place = [&](const Branch& x, bool of_a) {
      return of_a ? pair.place_a(x.point()) : pair.place_b(x.point());
    };
    const Vec3 x[2] = {place(at.two[0], at.of_a), place(at.two[1], at.of_a)}, y = place(at.one, !at.of_a);
    if (!((x[1] - x[0]).norm() > kSameSupport * pair.reach)) return false;  // one and the same
    Vec2 g[2];
    double p[2];
    for (int i = 0; i < 2; ++i) {
      const Vec3 apart = at.of_a ? x[i] - y : y - x[i];
      g[i] = {t.dot(apart), across.dot(apart)};
      p[i] = at.of_a ? pair.overlap_along(d, at.two[i].height(), at.one.height())
                     : pair.overlap_along(d, at.one.height(), at.two[i].height());
    }
    const Vec2 e = g[0] - g[1];
    if (share < 0) share = std::clamp(-g[1].dot(e) / e.squaredNorm(), 0.0, 1.0);
    // Along e the supports become equal; square to it the mean's gradient vanishes.
    Mat2 hessian = share * at.two[0].turn() + (1 - share) * at.two[1].turn() + at.one.turn();
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
    if (step.norm() <= tilt && std::abs(next - share) * length <= kStationary * pair.reach + tilt * length &&
        at.two[0].met() && at.two[1].met() && at.one.met()) {
      const Vec3 met = next * x[0] + (1 - next) * x[1];
      const bool first = next >= 0.5;
      const SurfacePoint &nearer = at.two[first ? 0 : 1].where(), &farther = at.two[first ? 1 : 0].where();
      PointPair points;
      points.a = at.of_a ? met : y;
      points.b = at.of_a ? y : met;
      points.on_a = at.of_a ? nearer : at.one.where();
      points.on_b = at.of_a ? at.one.where() : nearer;
      const double upper = confirmed_heights({*pair.a, pair.scale_a, d, points.on_a},
                                             {*pair.b, pair.scale_b, on_b.d, points.on_b}, tolerance) -
                           d.dot(pair.offset);
      const auto ball_at = [&](const Branch& of, bool of_a) {
        return of_a ? touching_ball(*pair.a, of.where(), of.normal(), pair.scale_a, on_a.d)
                    : touching_ball(*pair.b, of.where(), of.normal(), pair.scale_b, on_b.d);
      };
      // Between two balls of one radius rolls a third.
      const TouchingBall two[2] = {ball_at(at.two[0], at.of_a), ball_at(at.two[1], at.of_a)};
      const TouchingBall between{std::min(two[0].radius, two[1].radius),
                                 next * two[0].normal + (1 - next) * two[1].normal},
          other = ball_at(at.one, !at.of_a);
      const Bracket bracket =
          bracket_along(pair, d, upper, points, at.of_a ? between : other, at.of_a ? other : between);
      if (!(bracket.width() <= tolerance)) return false;
      s->set_met(points, bracket, k + 1);
      *bridge = {static_cast<double>(farther.patch), farther.u, farther.v, at.of_a ? 1.0 : 0.0,
                 first ? next : 1 - next};
      return true;
    }
    share = next;
    d = (d + step[0] * t + step[1] * across).normalized();
  }
  return false;
}

}  // namespace nurbs

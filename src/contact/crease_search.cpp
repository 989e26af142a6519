// See crease_search.h.
#include "contact/crease_search.h"

#include <algorithm>
#include <cmath>

#include "body/support_turn.h"
#include "contact/support_bracket.h"

namespace nurbs {
namespace {

// W of a body at a support point, in the basis t, s of the pair frame.
bool turn_a(const PairFrame& pair, const Support& at, const Vec3& d, const Vec3& t, const Vec3& s, Mat2* w) {
  return support_turn(*pair.a, at.where, d, d, t, s, pair.scale_a, w);
}
bool turn_b(const PairFrame& pair, const Support& at, const Vec3& on_b, const Vec3& t, const Vec3& s,
            Mat2* w) {
  const Mat3 back = pair.turn.transpose();
  return support_turn(*pair.b, at.where, on_b, on_b, back * t, back * s, pair.scale_b, w);
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
    const Bracket bracket =
        bracket_along(pair, d, upper, p, touching_ball(*pair.a, sa.where, sa.normal, pair.scale_a, d),
                      touching_ball(*pair.b, sb.where, sb.normal, pair.scale_b, on_b));
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

}  // namespace nurbs

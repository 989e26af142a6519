// The map of support points, and which parameters an edge holds; see support_turn.h.
#include "body/support_turn.h"

#include "nurbs/tolerances.h"

namespace nurbs {

bool support_turn(const Shape& shape, const SurfacePoint& at, const Vec3& d, const Vec3& asked, const Vec3& t,
                  const Vec3& s, double scale, Mat2* turn) {
  const Jet2 j = evaluate2(shape.patches[at.patch], at.u, at.v);
  const auto held = [&](double x, const Vec3& tangent) {
    const double slope = asked.dot(tangent), length = tangent.norm();
    return !(length > kHeldSpeed * shape.bounding_radius) || (x <= kOnEdge && slope < -kHeldSlope * length) ||
           (x >= 1 - kOnEdge && slope > kHeldSlope * length);
  };
  const bool held_u = held(at.u, j.su), held_v = held(at.v, j.sv);
  turn->setZero();
  if (held_u && held_v) return true;
  if (held_u || held_v) {
    const Vec3& tangent = held_u ? j.sv : j.su;
    const double bend = -d.dot(held_u ? j.svv : j.suu);
    const Vec2 along(t.dot(tangent), s.dot(tangent));
    if (!(bend * shape.bounding_radius > kFlatCurvature * tangent.squaredNorm())) return false;
    *turn = scale / bend * along * along.transpose();
    return true;
  }
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

}  // namespace nurbs

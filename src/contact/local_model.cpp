// Second-order contact from stored points, normals and curvatures; see local_model.h.
#include "contact/local_model.h"

#include <algorithm>
#include <cmath>

#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

Vec3 vec(const double* x) {
  return {x[0], x[1], x[2]};
}

void store(const Vec3& v, double* x) {
  x[0] = v[0];
  x[1] = v[1];
  x[2] = v[2];
}

// Vectors of both bodies side by side: A's in the first lane, B's in the second.
struct Vec3x2 {
  Lane2 x, y, z;
  NURBS_INLINE Vec3 of(int body) const { return {x[body], y[body], z[body]}; }
};
NURBS_INLINE Vec3x2 both(const double* a, const double* b) {
  return {Lane2{a[0], b[0]}, Lane2{a[1], b[1]}, Lane2{a[2], b[2]}};
}
NURBS_INLINE Lane2 dot(const Vec3x2& a, const Vec3x2& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
NURBS_INLINE Vec3x2 sum(const Lane2& f, const Vec3x2& a, const Lane2& g, const Vec3x2& b) {
  return {f * a.x + g * b.x, f * a.y + g * b.y, f * a.z + g * b.z};
}
NURBS_INLINE Vec3x2 cross(const Vec3x2& a, const Vec3x2& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

// Both bodies' turns since the reference orientations, as matrices.
struct Turns {
  Vec3x2 row[3];

  NURBS_INLINE Turns(const Quat& a, const double* a0, const Quat& b, const double* b0) {
    const Lane2 w0{a0[0], b0[0]}, w1{a.w(), b.w()};
    const Vec3x2 v0 = both(a0 + 1, b0 + 1), v1 = both(a.coeffs().data(), b.coeffs().data());
    const Lane2 w = w1 * w0 + dot(v1, v0);  // q conj(q0)
    const Vec3x2 twist = cross(v1, v0), along = sum(w0, v1, -w1, v0);
    const Lane2 x = along.x - twist.x, y = along.y - twist.y, z = along.z - twist.z;
    const Lane2 x2 = x + x, y2 = y + y, z2 = z + z;
    row[0] = {1.0 - (y2 * y + z2 * z), x2 * y - z2 * w, x2 * z + y2 * w};
    row[1] = {x2 * y + z2 * w, 1.0 - (x2 * x + z2 * z), y2 * z - x2 * w};
    row[2] = {x2 * z - y2 * w, y2 * z + x2 * w, 1.0 - (x2 * x + y2 * y)};
  }
  NURBS_INLINE Vec3x2 operator()(const double* a, const double* b) const {
    const Vec3x2 v = both(a, b);
    return {dot(row[0], v), dot(row[1], v), dot(row[2], v)};
  }
};

}  // namespace

bool make_support_model(const Mat3& axes, const Vec3& center, const SurfacePoint& at, const JetLanes& jet,
                        double rate, SupportModel* model) {
  using Slot = JetLanes::Slot;
  const Vec3 su = jet.at(Slot::kSu), sv = jet.at(Slot::kSv), cross = su.cross(sv);
  const double area = cross.norm(), lu = su.norm(), lv = sv.norm();
  if (!(area > 0)) return false;
  const Vec3 n = cross / area, t = su / lu, s = n.cross(t);
  Lane8 bend;
  dot(jet, n, &bend);
  const double l = -bend[3], m = -bend[4], k = -bend[5], det = l * k - m * m;
  if (!(det > 0) || !(l > 0)) return false;
  // J = (lu, t.sv; 0, s.sv) takes parameters to the frame (t, s); W = J II^-1 J'.
  const double shear = t.dot(sv), height = s.dot(sv), r = 1 / det;
  const double across = r * (lu * k - shear * m), along = r * (shear * l - lu * m);
  model->w[0] = lu * across + shear * along;
  model->w[1] = height * along;
  model->w[2] = r * height * height * l;
  model->rate = rate;
  // Distance along the surface to the patch's edges, exact to first order in the parameters.
  const double across_u = area / lv * std::min(at.u, 1 - at.u),
               across_v = area / lu * std::min(at.v, 1 - at.v);
  model->room = kRoomShare * std::min(across_u, across_v);
  store(axes * (jet.at(Slot::kS) - center), model->arm);
  store(axes * n, model->normal);
  store(axes * t, model->tangent);
  return std::isfinite(model->w[0] + model->w[1] + model->w[2]) && std::isfinite(rate);
}

void limit_turn(const Shape& shape, double scale, double turn, SupportModel* model) {
  if (shape.normal_map.cells == 0) return;
  // W (d - n) is at least the least curvature radius times the turn.
  model->room = std::min(model->room, turn * scale * shape.patch_curvature.min_radius);
}

LocalContact evaluate_local(const LocalModel& model, const Quat& q_a, const double* q0_a, const Quat& q_b,
                            const double* q0_b, const Vec3& offset) {
  const SupportModel &ma = model.a, &mb = model.b;
  const Turns turns(q_a, q0_a, q_b, q0_b);
  const Vec3x2 arm = turns(ma.arm, mb.arm), t = turns(ma.tangent, mb.tangent),
               outward = turns(ma.normal, mb.normal), s = cross(outward, t);
  const Lane2 sign{1, -1};
  const Vec3x2 n{sign * outward.x, sign * outward.y, sign * outward.z};  // both from A towards B
  const Lane2 w0{ma.w[0], mb.w[0]}, w1{ma.w[1], mb.w[1]}, w2{ma.w[2], mb.w[2]};

  // One Newton step on p from d = n_A: (W_A + W_B - p) tau = -(g + W_B (n_A - n_B)) in the basis (t_A, s_A).
  const Vec3 na = n.of(0), ta = t.of(0), sa = s.of(0), tb = t.of(1), sb = s.of(1);
  const Vec3 g = arm.of(0) - arm.of(1) - offset, apart = na - n.of(1);
  const double p = na.dot(g), a1 = tb.dot(apart), b1 = sb.dot(apart);
  const double tt = tb.dot(ta), ts = tb.dot(sa), st = sb.dot(ta), ss = sb.dot(sa);
  const double* wb = mb.w;
  const double mt = wb[0] * a1 + wb[1] * b1, ms = wb[1] * a1 + wb[2] * b1;
  const double r1 = ta.dot(g) + tt * mt + st * ms, r2 = sa.dot(g) + ts * mt + ss * ms;
  const double m11 = ma.w[0] - p + tt * (wb[0] * tt + wb[1] * st) + st * (wb[1] * tt + wb[2] * st);
  const double m12 = ma.w[1] + tt * (wb[0] * ts + wb[1] * ss) + st * (wb[1] * ts + wb[2] * ss);
  const double m22 = ma.w[2] - p + ts * (wb[0] * ts + wb[1] * ss) + ss * (wb[1] * ts + wb[2] * ss);
  const double det = m11 * m22 - m12 * m12;
  LocalContact c;
  c.valid = det > 0 && m11 > 0;  // a minimum
  if (!c.valid) return c;
  const double r = 1 / det, x = r * (m12 * r2 - m22 * r1), y = r * (m12 * r1 - m11 * r2);
  c.normal = (na + x * ta + y * sa) / std::sqrt(1 + x * x + y * y);

  // Both support points there, p from them, and the remainder.
  const Lane2 zero{0, 0};
  const Vec3x2 d{c.normal[0] + zero, c.normal[1] + zero, c.normal[2] + zero};
  const Vec3x2 turn{d.x - n.x, d.y - n.y, d.z - n.z};
  const Lane2 a = dot(t, turn), b = dot(s, turn), along_t = w0 * a + w1 * b, along_s = w1 * a + w2 * b;
  const Vec3x2 moved = sum(along_t, t, along_s, s);
  const Lane2 drop = -dot(d, moved) / (1.0 + dot(d, n));
  const Vec3x2 v{moved.x + drop * n.x, moved.y + drop * n.y, moved.z + drop * n.z};
  c.point_a = arm.of(0) + v.of(0);
  c.point_b = offset + (arm.of(1) - v.of(1));
  const Vec3 between = c.point_b - c.point_a;
  c.gap = c.normal.dot(between);
  const Lane2 angle2 = dot(turn, turn), second = Lane2{ma.rate, mb.rate} * angle2;
  const double third = second[0] * std::sqrt(angle2[0]) + second[1] * std::sqrt(angle2[1]);
  // How far p's gradient may be from zero here: what one linear step left of it, and the maps' own remainder.
  // (x + y)^2 <= 2 x^2 + 2 y^2; det / trace is at most the least eigenvalue of p's Hessian.
  const double left2 = (between - c.gap * c.normal).squaredNorm(), own = 0.5 * (second[0] + second[1]);
  c.error = kRemainderSafety * (third / 6 + (left2 + own * own) * (m11 + m22) * r);
  c.drift = 0.5 * std::max(second[0], second[1]);
  const Lane2 stray2 = along_t * along_t + along_s * along_s;
  c.valid = stray2[0] <= ma.room * ma.room && stray2[1] <= mb.room * mb.room;
  return c;
}

LocalSupport evaluate_local_support(const SupportModel& model, const Quat& q, const double* q0,
                                    const Vec3& d) {
  const Mat3 turn = (q * Quat(q0[0], -q0[1], -q0[2], -q0[3])).toRotationMatrix();
  const Vec3 n = turn * vec(model.normal), t = turn * vec(model.tangent), s = n.cross(t), change = d - n;
  const double a = t.dot(change), b = s.dot(change), *w = model.w;
  const Vec3 moved = (w[0] * a + w[1] * b) * t + (w[1] * a + w[2] * b) * s;
  const double angle2 = change.squaredNorm();
  LocalSupport support;
  support.point = turn * vec(model.arm) + moved - d.dot(moved) / (1 + d.dot(n)) * n;
  support.h = d.dot(support.point);
  support.error = cubic_remainder(model.rate, angle2);
  support.drift = 0.5 * model.rate * angle2;
  support.valid = moved.norm() <= model.room;
  return support;
}

}  // namespace nurbs

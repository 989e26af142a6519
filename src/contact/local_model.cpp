// Second-order contact from stored points, normals and curvatures; see local_model.h.
#include "contact/local_model.h"

#include <algorithm>
#include <cmath>

#include "geometry/tolerances.h"

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

// A body's half turned to its present orientation.
struct Turned {
  Vec3 arm, normal, t, s;
  const double* w;

  Turned(const SupportModel& m, const Mat3& turn)
      : arm(turn * vec(m.arm)),
        normal(turn * vec(m.normal)),
        t(turn * vec(m.tangent)),
        s(normal.cross(t)),
        w(m.w) {}

  Vec3 map(const Vec3& x) const {  // W x
    const double a = t.dot(x), b = s.dot(x);
    return (w[0] * a + w[1] * b) * t + (w[1] * a + w[2] * b) * s;
  }

  // The model's support point in direction d, whose product with d is the model's h; moved = W (d - n). Exact
  // on a sphere.
  Vec3 point(const Vec3& d, const Vec3& moved) const {
    return arm + moved - d.dot(moved) / (1 + d.dot(normal)) * normal;
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
  const double across_u = area / lv * std::min(at.u, 1 - at.u), across_v = area / lu * std::min(at.v, 1 - at.v);
  model->room = kRoomShare * std::min(across_u, across_v);
  store(axes * (jet.at(Slot::kS) - center), model->arm);
  store(axes * n, model->normal);
  store(axes * t, model->tangent);
  return std::isfinite(model->w[0] + model->w[1] + model->w[2]) && std::isfinite(rate);
}

Mat3 turn_since(const Quat& q, const double* q0) {
  return (q * Quat(q0[0], -q0[1], -q0[2], -q0[3])).toRotationMatrix();
}

LocalContact evaluate_local(const LocalModel& model, const Mat3& turn_a, const Mat3& turn_b,
                            const Vec3& offset) {
  const Turned a(model.a, turn_a), b(model.b, turn_b);
  LocalContact c;
  const Vec3 d0 = (a.normal - b.normal).normalized();
  const Vec3 t1 = (a.t - d0.dot(a.t) * d0).normalized(), t2 = d0.cross(t1);
  const Vec3 g = a.arm - b.arm - offset;
  const double p = d0.dot(g);
  // P g + W_A (d - n_A) + W_B (d + n_B) - p tau = 0 with d = d0 + tau.
  const Vec3 residual = a.map(d0 - a.normal) + b.map(d0 + b.normal) + g;
  const Vec3 wa1 = a.map(t1), wa2 = a.map(t2), wb1 = b.map(t1), wb2 = b.map(t2);
  const double m11 = t1.dot(wa1) + t1.dot(wb1) - p, m12 = t1.dot(wa2) + t1.dot(wb2),
               m22 = t2.dot(wa2) + t2.dot(wb2) - p;
  const double r1 = t1.dot(residual), r2 = t2.dot(residual), det = m11 * m22 - m12 * m12;
  c.valid = det > 0 && m11 > 0;  // a minimum
  if (!c.valid) return c;
  const double x1 = (m12 * r2 - m22 * r1) / det, x2 = (m12 * r1 - m11 * r2) / det;
  c.normal = (d0 + x1 * t1 + x2 * t2).normalized();
  const Vec3 da = c.normal - a.normal, db = c.normal + b.normal;
  const Vec3 wa = a.map(da), wb = b.map(db);
  c.point_a = a.point(c.normal, wa);
  c.point_b = offset + b.point(-c.normal, -wb);
  c.gap = c.normal.dot(c.point_b - c.point_a);
  const double ta = da.norm(), tb = db.norm();
  // How far p's gradient may be from zero here: what one linear step left of it, and the maps' own remainder.
  const double slope = (c.point_b - c.point_a - c.gap * c.normal).norm() +
                       0.5 * (model.a.rate * ta * ta + model.b.rate * tb * tb);
  const double stiffness = det / (m11 + m22);  // at most the least eigenvalue of p's Hessian
  c.error = kRemainderSafety * ((model.a.rate * ta * ta * ta + model.b.rate * tb * tb * tb) / 6 +
                                0.5 * slope * slope / stiffness);
  c.drift = 0.5 * std::max(model.a.rate * ta * ta, model.b.rate * tb * tb);
  c.valid = wa.norm() <= model.a.room && wb.norm() <= model.b.room;
  return c;
}

LocalSupport evaluate_local_support(const SupportModel& model, const Mat3& turn, const Vec3& d) {
  const Turned body(model, turn);
  const Vec3 change = d - body.normal, moved = body.map(change);
  const double angle = change.norm();
  LocalSupport s;
  s.point = body.point(d, moved);
  s.h = d.dot(s.point);
  s.error = kRemainderSafety * model.rate * angle * angle * angle / 6;
  s.drift = 0.5 * model.rate * angle * angle;
  s.valid = moved.norm() <= model.room;
  return s;
}

}  // namespace nurbs

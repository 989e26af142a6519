// The certified local model: near a solved contact both bodies' support functions are known to second order,
// so the contact follows small motions without touching a surface.
//
// At a surface point a with outward unit normal n and inverse Weingarten map W (tangent plane to tangent
// plane, W = dx/dn)
//     h(d) = d.a + d' W d / (1 + d.n) + r,    |r| <= L t^3 / 6,    t = angle between d and n.
// For along the great circle from n to d, h'' + h = rho, the inverse Weingarten map along the circle, hence
// h(t) = d.a + integral of sin(t - s) rho(s) ds; rho = rho(0) gives the middle term (rho(0) (1 - cos t), a
// sphere exactly; the plain quadratic form would leave rho t^4 / 8 whatever L), and |rho(s) - rho(0)| <= L s
// the remainder. Hypotheses, all checked: L bounds |dW/dn| wherever the support point goes (LocalRate: proven
// around a), which holds as long as its way, at most |W (d - n)| + L t^2 / 2, is shorter than `room`; t is
// below kLargestTurn, where t^3 is at most kTurnOverChord times the cube of the chord |d - n| that stands for
// it here. a, n and W are kept in the body's own axes and turn with it, exactly.
//
// Minimising p(d) = h_A(d) + h_B(-d) - d . offset of the two quadratics over unit d is one 2 x 2 system; p at
// its solution d is wrong by what h is, and above its minimum by what is left of the gradient, g:
//     |error of the gap| <= (L_A t_A^3 + L_B t_B^3) / 6 + |g|^2 / (2 m)
// where m is a least eigenvalue of Hess p = W_A + W_B - p I from d to the minimum d*. Hypothesis: p stays
// convex on the way. With m0 the least eigenvalue of the models' Hessian, (W_A + W_B) changes by at most L_A
// t_A
// + L_B t_B from the models' to d and by (L_A + L_B) |d* - d| beyond; while that is at most m0 / 2, m >= m0 /
// 2 and |d* - d| <= 2 |g| / m0, so  L_A t_A + L_B t_B + 2 (L_A + L_B) |g| / m0 <= m0 / 2  is what is checked
// (p itself changes by less, by |g| |d* - d|, which kRemainderSafety has room for). The normal, and with it
// the force, errs to first order in that gradient: by |g| / m, in which the maps' remainder (L_A t_A^2 + L_B
// t_B^2) / 2 is a bound, and a loose one (kRemainderShare).
#pragma once

#include "contact/pair_frame.h"
#include "nurbs/jet_lanes.h"
#include "nurbs/tolerances.h"
#include "nurbs/wide.h"

namespace nurbs {

// One body's half of the model: axes of its shape, origin at its centre of mass, lengths of the lab.
template <class Real>
struct SupportModelOf {
  Triple<Real> arm;      // a
  Triple<Real> normal;   // n, outward
  Triple<Real> tangent;  // unit t, square to n; with s = n x t ...
  Real w0, w1, w2;       // ... W = w0 t t' + w1 (t s' + s t') + w2 s s'
  Real rate;             // L
  Real room;             // distance that the point may move while L holds
};
using SupportModel = SupportModelOf<double>;

// Both halves, and the overlap below which the contact is the only one: negative infinity for no model.
struct LocalModel {
  SupportModel a, b;
  double unique;
};
constexpr int kLocalModelSize = 29;  // doubles
static_assert(sizeof(LocalModel) == kLocalModelSize * sizeof(double));

template <class Real>
struct LocalContactOf {
  Triple<Real> normal;            // unit d, lab, from A towards B
  Triple<Real> point_a, point_b;  // from A's centre of mass, lab
  Real gap, error;                // |true gap - gap| <= error
  Real drift;                     // about how far the points may be from the true ones: L t^2 / 2
  Real tilt2;        // square of the angle, rad, that the normal may be off by: an estimate, see below
  Mask<Real> valid;  // false: outside what the model covers
};
using LocalContact = LocalContactOf<double>;

// Fills a body's half from the jet at its contact point, given in axes that `axes` turns into the body's
// own, lengths of the lab; `center` is the body's centre of mass there, `local` its rate and room, too. False
// where W is not finite and positive or there is no rate: the model then can't serve.
bool make_support_model(const Mat3& axes, const Vec3& center, const JetLanes& jet, const LocalRate& local,
                        SupportModel* model);

// The half of a plane that does not turn, or of a point of it: `normal` in its own axes.
SupportModel plane_model(const Vec3& normal);

// Bound on the third-order remainder of one body's half, a length, for a turn of the root of `angle2`.
template <class Real>
NURBS_INLINE Real cubic_remainder(const Real& rate, const Real& angle2) {
  return kRemainderSafety / 6 * rate * angle2 * root(angle2);
}

// Keeps the model from turns that may reach another support point: to `turn` (rad) at most. On bodies whose
// normal map says where those are; others have none.
void limit_turn(const Shape& shape, double turn, SupportModel* model);

// The contact now: `turn_a`, `turn_b` turn the bodies' axes into the lab's, B's centre is at `offset` from
// A's. `free` is 1, or 0 where the direction is A's normal whatever B does (A a plane). No surface
// evaluation; 50 ns one at a time, 10 ns side by side.
template <class Real>
NURBS_INLINE LocalContactOf<Real> evaluate_local(const SupportModelOf<Real>& ma,
                                                 const SupportModelOf<Real>& mb, const Turn<Real>& turn_a,
                                                 const Turn<Real>& turn_b, const Triple<Real>& offset,
                                                 const Real& free) {
  using V = Triple<Real>;
  const V arm_a = turn_a * ma.arm, na = turn_a * ma.normal, ta = turn_a * ma.tangent, sa = cross(na, ta);
  const V arm_b = turn_b * mb.arm, out_b = turn_b * mb.normal, tb = turn_b * mb.tangent,
          sb = cross(out_b, tb);

  // One Newton step on p from d = n_A: (W_A + W_B - p) tau = -(g + W_B (n_A + n_B)) in the basis (t_A, s_A).
  const V g = arm_a - arm_b - offset, apart = na + out_b;
  const Real p = dot(na, g), a1 = dot(tb, apart), b1 = dot(sb, apart);
  const Real tt = dot(tb, ta), ts = dot(tb, sa), st = dot(sb, ta), ss = dot(sb, sa);
  const Real mt = mb.w0 * a1 + mb.w1 * b1, ms = mb.w1 * a1 + mb.w2 * b1;
  const Real r1 = free * (dot(ta, g) + tt * mt + st * ms), r2 = free * (dot(sa, g) + ts * mt + ss * ms);
  const Real m11 = ma.w0 - p + tt * (mb.w0 * tt + mb.w1 * st) + st * (mb.w1 * tt + mb.w2 * st);
  const Real m12 = ma.w1 + tt * (mb.w0 * ts + mb.w1 * ss) + st * (mb.w1 * ts + mb.w2 * ss);
  const Real m22 = ma.w2 - p + ts * (mb.w0 * ts + mb.w1 * ss) + ss * (mb.w1 * ts + mb.w2 * ss);
  const Real det = m11 * m22 - m12 * m12;
  const Mask<Real> minimum = ((det > 0.0) & (m11 > 0.0)) | (free == 0.0);
  const Real r = 1.0 / select(minimum & (det != 0.0), det, all<Real>(1));
  const Real x = r * (m12 * r2 - m22 * r1), y = r * (m12 * r1 - m11 * r2);
  LocalContactOf<Real> c;
  c.normal = (1.0 / root(1.0 + x * x + y * y)) * (na + x * ta + y * sa);

  // Both support points there, p from them, and the remainder.
  const V& d = c.normal;
  const V turn_of_a = d - na, turn_of_b = V{} - d - out_b;
  const auto support = [&d](const SupportModelOf<Real>& m, const V& t, const V& s, const V& n,
                            const V& turned, const Real& towards, Real* stray2) {
    const Real a = dot(t, turned), b = dot(s, turned);
    const Real along_t = m.w0 * a + m.w1 * b, along_s = m.w1 * a + m.w2 * b;
    *stray2 = along_t * along_t + along_s * along_s;
    const V moved = along_t * t + along_s * s;
    return moved - (towards * dot(d, moved) / (1.0 + towards * dot(d, n))) * n;
  };
  Real stray2_a, stray2_b;
  c.point_a = arm_a + support(ma, ta, sa, na, turn_of_a, all<Real>(1), &stray2_a);
  c.point_b = offset + arm_b + support(mb, tb, sb, out_b, turn_of_b, all<Real>(-1), &stray2_b);
  const V between = c.point_b - c.point_a;
  c.gap = dot(d, between);
  c.point_a =
      select<Real>(free == 0.0, c.point_b - c.gap * d, c.point_a);  // of a plane, what B's point meets
  const Real angle2_a = dot(turn_of_a, turn_of_a), angle2_b = dot(turn_of_b, turn_of_b);
  const Real first_a = ma.rate * root(angle2_a), first_b = mb.rate * root(angle2_b);
  const Real second_a = ma.rate * angle2_a, second_b = mb.rate * angle2_b;
  const Real third = first_a * angle2_a + first_b * angle2_b;
  // How far p's gradient may be from zero here: what one linear step left of it, and the maps' own remainder.
  // (x + y)^2 <= 2 x^2 + 2 y^2; det / trace is at most the least eigenvalue of p's Hessian.
  const V across = between - c.gap * d;
  const Real left2 = free * dot(across, across), own = free * 0.5 * (second_a + second_b);
  const Real soft = (m11 + m22) * r;
  // |g|^2 <= 2 (left2 + own^2), so |g|^2 / (2 m) <= 2 (left2 + own^2) soft.
  c.error = kRemainderSafety * (third * (1.0 / 6) + 2.0 * (left2 + own * own) * soft);
  c.drift = 0.5 * larger(second_a, second_b);
  c.tilt2 = (left2 + kRemainderShare * kRemainderShare * own * own) * soft * soft;
  const Real to_minimum = 2.0 * soft * (root(left2) + own);
  const Mask<Real> convex =
      ((first_a + first_b + (ma.rate + mb.rate) * to_minimum) * soft <= 0.5) | (free == 0.0);
  const Real way_a = ma.room - 0.5 * second_a, way_b = mb.room - 0.5 * second_b;
  c.valid = minimum & convex & (way_a > 0.0) & (way_b > 0.0) & (stray2_a <= way_a * way_a) &
            (stray2_b <= way_b * way_b) & (larger(angle2_a, angle2_b) <= kLargestTurn * kLargestTurn);
  return c;
}

}  // namespace nurbs

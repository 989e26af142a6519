// The certified local model: near a solved contact both bodies' support functions are known to second order,
// so the contact follows small motions without touching a surface.
//
// At a surface point a with outward unit normal n and inverse Weingarten map W (tangent plane to tangent
// plane, W = dx/dn)
//     h(d) = d.a + d' W d / (1 + d.n) + r,    |r| <= L t^3 / 6,    t = angle between d and n.
// For along the great circle from n to d, h'' + h = rho, the inverse Weingarten map along the circle, hence
// h(t) = d.a + integral of sin(t - s) rho(s) ds; rho = rho(0) gives the middle term (rho(0) (1 - cos t), a
// sphere exactly; the plain quadratic form would leave rho t^4 / 8 whatever L), and |rho(s) - rho(0)| <= L s
// the remainder. L is a bound of |dW/dn| (Shape::curvature_rate), as long as the support point stays on the
// same Bezier patch: |W| |d - n| must be less than the distance to the patch's edges. a, n and W turn with
// their body, exactly. Minimising p(d) = h_A(d) + h_B(-d) - d . offset of the two quadratics over unit d is
// one 2 x 2 system; p at its solution d is wrong by what h is, and above its minimum by what is left of the
// gradient:
//     |error of the gap| <= (L_A t_A^3 + L_B t_B^3) / 6 + |grad p|^2 / (2 least eigenvalue of Hess p).
#pragma once

#include <cmath>

#include "contact/pair_frame.h"
#include "nurbs/tolerances.h"

namespace nurbs {

// One body's half of the model, in lab axes at the reference pose, lengths of the lab. Plain doubles.
struct SupportModel {
  double arm[3];      // a, from the centre of mass
  double normal[3];   // n
  double tangent[3];  // unit t, square to n; with s = n x t ...
  double w[3];        // ... W = w0 t t' + w1 (t s' + s t') + w2 s s'
  double rate;        // L
  double room;        // distance to the patch's edges, less a margin
};

struct LocalModel {
  SupportModel a, b;
};

struct LocalContact {
  Vec3 normal;            // unit d, lab
  Vec3 point_a, point_b;  // from A's centre of mass, lab
  double gap, error;      // |true gap - gap| <= error
  double drift;           // about how far the points may be from the true ones: L t^2 / 2
  bool valid;             // false: outside what the model covers
};

// Fills a body's half from the jet at its contact point `at`, given in axes that `axes` turns into the lab,
// lengths of the lab; `center` is the body's centre of mass there, `rate` its L. False where W is not finite
// and positive: the model then can't serve.
bool make_support_model(const Mat3& axes, const Vec3& center, const SurfacePoint& at, const JetLanes& jet,
                        double rate, SupportModel* model);

// Bound on the third-order remainder of one body's half, a length, for a turn of the root of `angle2`.
inline double cubic_remainder(double rate, double angle2) {
  return kRemainderSafety / 6 * rate * angle2 * std::sqrt(angle2);
}

// Keeps the model from turns that may reach another support point: to `turn` (rad) at most. On bodies whose
// normal map says where those are; others have none.
void limit_turn(const Shape& shape, double scale, double turn, SupportModel* model);

// One body, turned from q0 to q, against a fixed plane, whose direction d (unit, from the body into the
// plane) does not change.
struct LocalSupport {
  double h;      // d . point
  double error;  // |true h - h| <= error
  double drift;  // about how far the point may be from the true one
  Vec3 point;    // from the body's centre of mass, lab
  bool valid;
};
LocalSupport evaluate_local_support(const SupportModel& model, const Quat& q, const double* q0,
                                    const Vec3& d);

// The contact now: bodies turned from the reference orientations q0 (w x y z) to q, B's centre at `offset`
// from A's. No surface evaluation; ~50 ns.
LocalContact evaluate_local(const LocalModel& model, const Quat& q_a, const double* q0_a, const Quat& q_b,
                            const double* q0_b, const Vec3& offset);

}  // namespace nurbs

// Newton on the four surface parameters of a pair of contact points; formulas in joint_newton.h and design
// notes there.
#include "contact/joint_newton.h"

#include <algorithm>
#include <cmath>

#include "contact/dents.h"

namespace nurbs {
namespace {

using Slot = JetLanes::Slot;

// Both surfaces at the current parameters, in the pair frame.
NURBS_INLINE void evaluate(const PairFrame& pair, const Mat3& frame_b, JointSolution& s) {
  s.base_a = s.points.on_a;
  s.base_b = s.points.on_b;
  evaluate2(pair.a->patches[s.base_a.patch], s.base_a.u, s.base_a.v, &s.jet_a);
  evaluate2(pair.b->patches[s.base_b.patch], s.base_b.u, s.base_b.v, &s.jet_b);
  scale(pair.scale_a, &s.jet_a);
  place(frame_b, pair.offset, &s.jet_b);
}

// 2 x 2 matrices as plain numbers, which the compiler keeps in registers.
struct Symmetric {
  double a, b, c;  // a b; b c
  double det() const { return a * c - b * b; }
  // Determinant too small beside its products to be told from zero.
  bool singular() const { return !(std::abs(det()) > kSingular * (std::abs(a * c) + b * b)); }
  Symmetric inverse() const {
    const double r = 1 / det();
    return {r * c, -r * b, r * a};
  }
};
struct Square {
  double a, b, c, d;  // a b; c d
  double det() const { return a * d - b * c; }
  bool singular() const { return !(std::abs(det()) > kSingular * (std::abs(a * d) + std::abs(b * c))); }
  Square operator*(const Symmetric& m) const {
    return {a * m.a + b * m.b, a * m.b + b * m.c, c * m.a + d * m.b, c * m.b + d * m.c};
  }
  Square operator*(const Square& m) const {
    return {a * m.a + b * m.c, a * m.b + b * m.d, c * m.a + d * m.c, c * m.b + d * m.d};
  }
};

// The tangents and the fundamental forms of a surface; `along` is the direction the second form is taken in.
struct Forms {
  Vec3 su, sv;
  Symmetric first, second;
  Forms(const JetLanes& j, const Vec3& along) : su(j.at(Slot::kSu)), sv(j.at(Slot::kSv)) {
    Lane8 bend;
    dot(j, along, &bend);
    first = {su.squaredNorm(), su.dot(sv), sv.squaredNorm()};
    second = {bend[3], bend[4], bend[5]};
  }
};

struct Steps {
  Vec2 a, b;
  bool regular;
  Symmetric metric;  // of A, inverse
};

// One Newton system, eliminated by 2 x 2 blocks: the first (metric of A) is regular near any contact, the
// Schur complement is the relative curvature. n_A turns by Weingarten's equations, so with C = T' I_A^-1 the
// coordinates of B's tangents among A's, d(B_i . n_A) / dA_j = - sum_k C_ik n_A . A_kj, exactly.
NURBS_INLINE Steps newton_step(const PointPair& p, const JetLanes& ja, const Forms& a, const Forms& b) {
  const Vec3 g = p.a - p.b;
  Lane8 with_g;
  dot(ja, g, &with_g);
  const double f1u = with_g[1], f1v = with_g[2], f2u = b.su.dot(p.na), f2v = b.sv.dot(p.na);
  const Square across{b.su.dot(a.su), b.su.dot(a.sv), b.sv.dot(a.su), b.sv.dot(a.sv)};  // T'
  const Symmetric m11{a.first.a + with_g[3], a.first.b + with_g[4], a.first.c + with_g[5]};
  Steps steps;
  steps.a.setZero();
  steps.b.setZero();
  steps.regular = false;
  if (a.first.singular() || m11.singular()) return steps;
  steps.metric = a.first.inverse();
  const Symmetric inverse = m11.inverse();
  const Square left = across * steps.metric * a.second * inverse;
  const Square t{across.a, across.c, across.b, across.d};
  const Square bent = left * t;  // minus M21 M11^-1 T
  const Square schur{b.second.a - bent.a, b.second.b - bent.b, b.second.b - bent.c, b.second.c - bent.d};
  if (schur.singular()) return steps;
  const double r = -1 / schur.det(), ru = left.a * f1u + left.b * f1v + f2u,
               rv = left.c * f1u + left.d * f1v + f2v;
  const double bu = r * (schur.d * ru - schur.b * rv), bv = r * (schur.a * rv - schur.c * ru);
  const double au = t.a * bu + t.b * bv - f1u, av = t.c * bu + t.d * bv - f1v;
  steps.b = {bu, bv};
  steps.a = {inverse.a * au + inverse.b * av, inverse.b * au + inverse.c * av};
  const double largest =
      std::max(std::max(std::abs(steps.a[0]), std::abs(steps.a[1])), std::max(std::abs(bu), std::abs(bv)));
  steps.regular = std::isfinite(largest);
  if (largest > kLargestStep) {
    steps.a *= kLargestStep / largest;
    steps.b *= kLargestStep / largest;
  }
  return steps;
}

// Parameters after the step, crossing into neighbours where needed; the common case is no crossing.
NURBS_INLINE SurfacePoint advance(const Shape& shape, const SurfacePoint& p, const Vec2& d) {
  const SurfacePoint next{p.patch, p.u + d[0], p.v + d[1]};
  return next.on_patch() ? next : walk(shape, p, d[0], d[1]);
}

// Direction of the normal su x sv; next to a pole, where one of them is mostly round-off, its limit.
struct Normal {
  Vec3 direction;
  bool polar;
  double noise = 0;  // rad: of the tangents' round-off, where that counts; kNoNormal where there is none
};
NURBS_INLINE Normal outward(const JetLanes& j, const SurfacePoint& at, const Shape& shape, double scale) {
  const double size = scale * shape.bounding_radius;
  const Vec3 su = j.at(Slot::kSu), sv = j.at(Slot::kSv);
  const double lu = su.squaredNorm(), lv = sv.squaredNorm();
  constexpr double kLost = kPoleNormal * kPoleNormal, kFading = 1e4, kNear = kNearPole * kNearPole;
  Normal n{su.cross(sv), lu < kLost * lv || lv < kLost * lu};
  const double shorter = std::min(lu, lv);
  // Towards a pole a tangent fades; across a narrow strip it is short all along, and its limit says nothing.
  const bool fades = n.polar && j.at(Slot::kSuv).squaredNorm() > kFading * shorter;
  if (fades) {
    const Vec3 suv = j.at(Slot::kSuv);
    n.direction = lu < lv ? suv.cross(sv) : su.cross(suv);
    if ((lu < lv ? at.v : at.u) >= 0.5) n.direction = -n.direction;
  }
  const double area2 = n.direction.squaredNorm(), faded2 = fades ? j.at(Slot::kSuv).squaredNorm() : shorter,
               longer = std::max(lu, lv), speed2 = faded2 + longer;
  // The limit may be in line with the other tangent, as where a flat face narrows to a tip.
  if ((fades ? area2 < kNear * faded2 * longer : shorter < kNear * longer) ||
      area2 <= lost_area2(speed2, size))
    n.noise = area2 > 0 ? std::min(kNoNormal, kTangentNoise * size * std::sqrt(speed2 / area2)) : kNoNormal;
  n.noise = std::min(kNoNormal, n.noise + pole_noise(shape, std::max(faded2, shorter) / (scale * scale)));
  n.direction.normalize();
  return n;
}

// The normal after a step, not normalised: Weingarten's equations.
NURBS_INLINE Vec3 turned_normal(const Vec3& n, const Forms& f, const Symmetric& inverse, const Vec2& d) {
  const double hu = f.second.a * d[0] + f.second.b * d[1], hv = f.second.b * d[0] + f.second.c * d[1];
  return n - (inverse.a * hu + inverse.b * hv) * f.su - (inverse.b * hu + inverse.c * hv) * f.sv;
}

// Whether a step stays on its patch: along ruled lines, where nothing else holds it, it may go far beyond.
NURBS_INLINE bool stays_on_patch(const SurfacePoint& at, const Vec2& d) {
  const double u = at.u + d[0], v = at.v + d[1];
  return std::min(std::min(u, v), std::min(1 - u, 1 - v)) >= -kBeyondPatch;
}

// How far the points are from lying on one line along d, squared.
double misfit2(const Vec3& d, const Vec3& g) {
  return (g - d.dot(g) * d).squaredNorm();
}

// Spends a step already solved for on a second-order update of points and normal.
NURBS_INLINE bool refine(const PairFrame& pair, JointSolution& s, const Forms& a, const Forms& b,
                         const Steps& steps) {
  PointPair& p = s.points;
  if (!turns_linearly(s.jet_a, steps.a[0], steps.a[1]) || !turns_linearly(s.jet_b, steps.b[0], steps.b[1]) ||
      b.first.singular() || !stays_on_patch(p.on_a, steps.a) || !stays_on_patch(p.on_b, steps.b))
    return false;
  // b.second was taken along A's normal, which is -n_B here up to second order. The normal that turned less
  // is known better: a flat's, or that of much the larger body.
  const Vec3 of_a = turned_normal(p.na, a, steps.metric, steps.a),
             of_b = turned_normal(-p.nb, b, b.first.inverse(), steps.b);
  const double turn_a = (of_a - p.na).squaredNorm() + kNoTurn, turn_b = (of_b + p.nb).squaredNorm() + kNoTurn;
  const Vec3 normal = (turn_b * of_a + turn_a * of_b).normalized();
  const Vec3 at_a = taylor(s.jet_a, steps.a[0], steps.a[1]), at_b = taylor(s.jet_b, steps.b[0], steps.b[1]);
  const double noise = kRoundoff * pair.reach;
  if (!(misfit2(normal, at_b - at_a) <= kNearer2 * misfit2(p.na, p.b - p.a) + noise * noise)) return false;
  p.a = at_a;
  p.b = at_b;
  p.na = normal;
  p.nb = -normal;
  p.on_a = advance(*pair.a, p.on_a, steps.a);
  p.on_b = advance(*pair.b, p.on_b, steps.b);
  s.normal = normal;
  return true;
}

// Gap within the tolerance, and the points after one more Newton step too: near-spheres have the first long
// before the second.
bool close_enough(const Bracket& bracket, double tolerance, double size, double reach) {
  return bracket.width() <= tolerance && bracket.angle2 * size <= std::max(tolerance, kRoundoff * size) &&
         (reach <= kUnequalSizes * size || turn_error(bracket.angle2, reach) <= tolerance);
}

// What local maxima of both bodies may lack of their supports.
double hidden_by_dents(const PairFrame& pair) {
  return pair.scale_a * pair.a->support_excess + pair.scale_b * pair.b->support_excess;
}

// Next to a dent, whose allowance keeps the bracket open: the points after the step would close it but for
// that, so that only the supports along their normal are left to confirm. Else the points stay.
NURBS_INLINE bool settles(const PairFrame& pair, JointSolution& s, const Forms& a, const Forms& b,
                          const Steps& steps, double tolerance) {
  const double excess = hidden_by_dents(pair);
  if (!s.dented || !dents_count(excess, tolerance) || !(s.bracket.angle2 * pair.size <= tolerance))
    return false;
  const PointPair before = s.points;
  if (refine(pair, s, a, b, steps)) {
    s.gap = s.normal.dot(s.points.b - s.points.a);
    if (s.bracket.upper - s.gap <= 0.5 * tolerance) return true;
  }
  s.points = before;
  return false;
}

// Proven apart, and the bound is at most a third short of the distance: good enough to budget motion with.
bool far_enough(const Bracket& bracket, double enough) {
  return bracket.lower > enough && bracket.width() <= 0.5 * (bracket.lower - enough);
}

// Normals opposite and the points on one line along them.
bool is_stationary(const PairFrame& pair, const PointPair& p) {
  if (!((p.na + p.nb).squaredNorm() <= kStationary * kStationary && p.na.dot(p.nb) < 0)) return false;
  const double allowed = kStationary * pair.size;
  return misfit2((p.na - p.nb).normalized(), p.b - p.a) <= allowed * allowed;
}

// Where the second-order update was refused, the normals are off by the angle itself: one more evaluation,
// kept if it is nearer.
__attribute__((noinline)) void draw_nearer(const PairFrame& pair, const Steps& steps, double tolerance,
                                           double enough, JointSolution* s) {
  JointSolution next = solve_joint(pair, advance(*pair.a, s->points.on_a, steps.a),
                                   advance(*pair.b, s->points.on_b, steps.b), tolerance, enough, 1);
  if (!next.converged || !(next.bracket.angle2 < s->bracket.angle2)) return;
  next.iterations += s->iterations;
  *s = next;
}

}  // namespace

void JointSolution::set_met(const PointPair& at, const Bracket& along, int solved) {
  bracket = along;
  normal = along.direction;
  points = at;
  points.na = normal;
  points.nb = -normal;
  gap = std::clamp(normal.dot(at.b - at.a), along.lower, along.upper);
  iterations += solved;
  dented = true;
  converged = true;
}

JointSolution solve_joint(const PairFrame& pair, const SurfacePoint& on_a, const SurfacePoint& on_b,
                          double tolerance, double enough, int cap) {
  JointSolution out;
  PointPair& p = out.points;
  p.on_a = on_a;
  p.on_b = on_b;
  const Mat3 frame_b = pair.scale_b * pair.turn;
  for (out.iterations = 1;; ++out.iterations) {
    evaluate(pair, frame_b, out);
    p.a = out.jet_a.at(Slot::kS);
    p.b = out.jet_b.at(Slot::kS);
    const Normal na = outward(out.jet_a, p.on_a, *pair.a, pair.scale_a),
                 nb = outward(out.jet_b, p.on_b, *pair.b, pair.scale_b);
    p.na = na.direction;
    p.nb = nb.direction;
    out.bracket = certify(pair, p, na.noise, nb.noise);
    out.dented = out.bracket.dented;
    out.converged =
        close_enough(out.bracket, tolerance, pair.size, pair.reach) || far_enough(out.bracket, enough);
    out.stationary = !out.converged && is_stationary(pair, p);
    const Forms a(out.jet_a, p.na), b(out.jet_b, p.na);
    const Steps steps = newton_step(p, out.jet_a, a, b);
    const bool smooth = steps.regular && !na.polar && !nb.polar;
    if (!out.converged && !out.stationary && smooth && settles(pair, out, a, b, steps, tolerance)) {
      out.stationary = true;
      return out;
    }
    if (out.converged || out.stationary) {
      const bool refined = smooth && refine(pair, out, a, b, steps);
      if (!refined) out.normal = out.converged ? out.bracket.direction : Vec3((p.na - p.nb).normalized());
      out.gap = out.normal.dot(p.b - p.a);
      if (out.converged) out.gap = std::clamp(out.gap, out.bracket.lower, out.bracket.upper);
      if (!refined && steps.regular && out.converged && cap > 1 && !(out.bracket.lower > enough) &&
          out.bracket.angle2 * pair.size * pair.size > tolerance * tolerance)
        draw_nearer(pair, steps, tolerance, enough, &out);
      return out;
    }
    if (!steps.regular || out.iterations >= cap) break;
    p.on_a = advance(*pair.a, p.on_a, steps.a);
    p.on_b = advance(*pair.b, p.on_b, steps.b);
  }
  out.normal = out.bracket.direction;
  out.gap = out.normal.dot(p.b - p.a);
  return out;
}

void confirm_lower(const PairFrame& pair, double tolerance, JointSolution* s) {
  const double p =
      confirmed_heights(s->side_a(pair), s->side_b(pair), tolerance) - s->normal.dot(pair.offset);
  if (!(-p > s->bracket.lower)) return;
  s->bracket.lower = -p;
  s->bracket.direction = s->normal;
}

bool confirm_joint(const PairFrame& pair, double tolerance, JointSolution* s) {
  const double excess = hidden_by_dents(pair);
  if (!s->stationary || !dents_count(excess, tolerance) || s->bracket.width() > 2 * excess + tolerance)
    return false;
  confirm_lower(pair, tolerance, s);
  s->converged = s->bracket.width() <= tolerance;
  if (s->converged) s->gap = std::clamp(s->gap, s->bracket.lower, s->bracket.upper);
  return s->converged;
}

}  // namespace nurbs

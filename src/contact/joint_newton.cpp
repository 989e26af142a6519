// Newton on the four surface parameters of a pair of contact points; formulas in joint_newton.h and design
// notes there.
#include "contact/joint_newton.h"

#include <cmath>

namespace nurbs {
namespace {

// Both surfaces at the current parameters, in the pair frame.
void evaluate(const PairFrame& pair, const Mat3& frame_b, JointSolution& s) {
  s.base_a = s.points.on_a;
  s.base_b = s.points.on_b;
  s.jet_a = evaluate2(pair.a->patches[s.base_a.patch], s.base_a.u, s.base_a.v);
  const Jet2 b = evaluate2(pair.b->patches[s.base_b.patch], s.base_b.u, s.base_b.v);
  for (Vec3* x : {&s.jet_a.s, &s.jet_a.su, &s.jet_a.sv, &s.jet_a.suu, &s.jet_a.suv, &s.jet_a.svv})
    *x *= pair.scale_a;
  s.jet_b.s.noalias() = frame_b * b.s + pair.offset;
  s.jet_b.su.noalias() = frame_b * b.su;
  s.jet_b.sv.noalias() = frame_b * b.sv;
  s.jet_b.suu.noalias() = frame_b * b.suu;
  s.jet_b.suv.noalias() = frame_b * b.suv;
  s.jet_b.svv.noalias() = frame_b * b.svv;
}

struct Steps {
  Vec2 a, b;
  bool regular;
};

bool invert(const Mat2& m, Mat2* inverse) {
  const double det = m(0, 0) * m(1, 1) - m(0, 1) * m(1, 0);
  const double scale = std::abs(m(0, 0) * m(1, 1)) + std::abs(m(0, 1) * m(1, 0));
  if (!(std::abs(det) > kSingular * scale)) return false;
  const double r = 1 / det;
  *inverse << r * m(1, 1), -r * m(0, 1), -r * m(1, 0), r * m(0, 0);
  return true;
}

// One Newton system, eliminated by 2 x 2 blocks: the first (metric of A) is regular near any contact, the
// Schur complement is the relative curvature.
Steps newton_step(const Jet2& a, const Jet2& b, const Vec3& normal_a) {
  const Vec3 g = a.s - b.s;
  const Vec3 nu = a.suu.cross(a.sv) + a.su.cross(a.suv);
  const Vec3 nv = a.suv.cross(a.sv) + a.su.cross(a.svv);
  const Vec2 f1(g.dot(a.su), g.dot(a.sv)), f2(b.su.dot(normal_a), b.sv.dot(normal_a));
  Mat2 m11, m12, m21, m22;
  const double uv = a.su.dot(a.sv) + g.dot(a.suv);
  m11 << a.su.squaredNorm() + g.dot(a.suu), uv, uv, a.sv.squaredNorm() + g.dot(a.svv);
  m12 << -b.su.dot(a.su), -b.sv.dot(a.su), -b.su.dot(a.sv), -b.sv.dot(a.sv);
  m21 << b.su.dot(nu), b.su.dot(nv), b.sv.dot(nu), b.sv.dot(nv);
  const double bend = b.suv.dot(normal_a);
  m22 << b.suu.dot(normal_a), bend, bend, b.svv.dot(normal_a);
  Steps steps{Vec2::Zero(), Vec2::Zero(), false};
  Mat2 inverse11, inverse_schur;
  if (!invert(m11, &inverse11)) return steps;
  const Mat2 left = m21 * inverse11;
  if (!invert(m22 - left * m12, &inverse_schur)) return steps;
  steps.b = inverse_schur * (left * f1 - f2);
  steps.a = -(inverse11 * (f1 + m12 * steps.b));
  const double largest = std::max(steps.a.cwiseAbs().maxCoeff(), steps.b.cwiseAbs().maxCoeff());
  steps.regular = std::isfinite(largest);
  if (largest > kLargestStep) {
    steps.a *= kLargestStep / largest;
    steps.b *= kLargestStep / largest;
  }
  return steps;
}

Vec3 taylor(const Jet2& j, const Vec2& d) {
  return j.s + d[0] * (j.su + 0.5 * d[0] * j.suu + d[1] * j.suv) + d[1] * (j.sv + 0.5 * d[1] * j.svv);
}

bool inside(const SurfacePoint& p, const Vec2& d) {
  return p.u + d[0] >= 0 && p.u + d[0] <= 1 && p.v + d[1] >= 0 && p.v + d[1] <= 1;
}

// Parameters after the step, crossing into neighbours where needed; the common case is no crossing.
SurfacePoint advance(const Shape& shape, SurfacePoint p, const Vec2& d) {
  if (!inside(p, d)) return walk(shape, p, d[0], d[1]);
  p.u += d[0];
  p.v += d[1];
  return p;
}

// Direction of the normal su x sv; next to a pole, where one of them is mostly round-off, its limit.
struct Normal {
  Vec3 direction;
  bool polar;
};
Normal outward(const Jet2& j, const SurfacePoint& at) {
  const double lu = j.su.squaredNorm(), lv = j.sv.squaredNorm();
  constexpr double kLost = kPoleNormal * kPoleNormal;
  if (lu < kLost * lv) return {(at.v < 0.5 ? j.suv.cross(j.sv) : j.sv.cross(j.suv)).normalized(), true};
  if (lv < kLost * lu) return {(at.u < 0.5 ? j.su.cross(j.suv) : j.suv.cross(j.su)).normalized(), true};
  return {j.su.cross(j.sv).normalized(), false};
}

// Point and normal after a step, from the Taylor series. False where the second-order part of the normal is
// no small share of its turn: next to a pole the normal's length is of second order in the step and its
// direction therefore anything.
bool refine(const Shape& shape, const Jet2& j, const Vec2& d, SurfacePoint* at, Vec3* point, Vec3* normal) {
  const Vec3 change_u = d[0] * j.suu + d[1] * j.suv, change_v = d[0] * j.suv + d[1] * j.svv;
  const Vec3 area = (j.su + change_u).cross(j.sv + change_v), second = change_u.cross(change_v);
  const double length = area.norm();
  const Vec3 turned = area / length;
  const double tilt = (second - turned.dot(second) * turned).norm() / length;
  const double turn = (turned - *normal).norm();
  if (!(tilt <= kNormalTrust * turn + kNormalNoise) || !(turned.dot(*normal) > 0)) return false;
  *normal = turned;
  *point = taylor(j, d);
  *at = advance(shape, *at, d);
  return true;
}

// Gap within the tolerance, and the points after one more Newton step too: near-spheres have the first long
// before the second.
bool close_enough(const Bracket& bracket, double tolerance, double size) {
  return bracket.width() <= tolerance && bracket.angle2 * size <= std::max(tolerance, kRoundoff * size);
}

// Proven apart, and the bound is at most a third short of the distance: good enough to budget motion with.
bool far_enough(const Bracket& bracket, double enough) {
  return bracket.lower > enough && bracket.width() <= 0.5 * (bracket.lower - enough);
}

// How far the points are from lying on one line along the normals; a length.
double misfit(const PointPair& p) {
  const Vec3 d = (p.na - p.nb).normalized(), g = p.b - p.a;
  return (g - d.dot(g) * d).norm();
}

// Normals opposite and the points on one line along them.
bool is_stationary(const PairFrame& pair, const PointPair& p) {
  const Vec3 d = (p.na - p.nb).normalized();
  const Vec3 g = p.b - p.a;
  return (p.na + p.nb).norm() <= kStationary && (g - d.dot(g) * d).norm() <= kStationary * pair.size &&
         p.na.dot(p.nb) < 0;
}

}  // namespace

JointSolution solve_joint(const PairFrame& pair, const SurfacePoint& on_a, const SurfacePoint& on_b,
                          double tolerance, double enough, int cap) {
  JointSolution out;
  PointPair& p = out.points;
  p.on_a = on_a;
  p.on_b = on_b;
  const Mat3 frame_b = pair.scale_b * pair.turn;
  const Jet2 &ja = out.jet_a, &jb = out.jet_b;
  for (out.iterations = 0;;) {
    evaluate(pair, frame_b, out);
    p.a = ja.s;
    p.b = jb.s;
    const Normal na = outward(ja, p.on_a), nb = outward(jb, p.on_b);
    p.na = na.direction;
    p.nb = nb.direction;
    out.bracket = certify(pair, p);
    out.converged = close_enough(out.bracket, tolerance, pair.size) || far_enough(out.bracket, enough);
    out.stationary = is_stationary(pair, p);
    const Steps steps = newton_step(ja, jb, ja.su.cross(ja.sv));
    ++out.iterations;
    if (out.converged || out.stationary) {
      PointPair next = p;
      if (steps.regular && !na.polar && !nb.polar &&
          refine(*pair.a, ja, steps.a, &next.on_a, &next.a, &next.na) &&
          refine(*pair.b, jb, steps.b, &next.on_b, &next.b, &next.nb) &&
          misfit(next) <= misfit(p) + kRoundoff * pair.reach) {
        p = next;
        out.normal = (p.na - p.nb).normalized();
      } else {
        out.normal = out.converged ? out.bracket.direction : Vec3((p.na - p.nb).normalized());
      }
      out.gap = out.normal.dot(p.b - p.a);
      if (out.converged) out.gap = std::clamp(out.gap, out.bracket.lower, out.bracket.upper);
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

}  // namespace nurbs

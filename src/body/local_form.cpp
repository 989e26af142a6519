// Normal and curvatures of a patch at a point.
#include "body/local_form.h"

#include <algorithm>
#include <cmath>

#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

constexpr double kFormRoundoff = 32 * kRoundoff;

double tangent_size(const BezierPatch& patch) {
  const Jet1 j = evaluate1(patch, 0.5, 0.5);
  return j.su.norm() * j.sv.norm();
}

LocalForm from_jet(const Jet2& j, double u, double v) {
  LocalForm f;
  f.u = u;
  f.v = v;
  f.point = j.s;
  f.su = j.su;
  f.sv = j.sv;
  f.normal = j.su.cross(j.sv).normalized();
  f.first << j.su.dot(j.su), j.su.dot(j.sv), j.su.dot(j.sv), j.sv.dot(j.sv);
  f.second << -j.suu.dot(f.normal), -j.suv.dot(f.normal), -j.suv.dot(f.normal), -j.svv.dot(f.normal);
  // Orthonormal tangent axes t1 = su / |su| and t2 = n x t1 make the Weingarten map a symmetric 2x2 matrix.
  const double e = std::sqrt(f.first(0, 0)), w = j.su.cross(j.sv).norm() / e, g = f.first(0, 1) / e;
  Mat2 b;  // columns: t1, t2 in the basis (su, sv)
  b << 1 / e, -g / (e * w), 0, 1 / w;
  const Mat2 s = b.transpose() * f.second * b;
  const double mean = 0.5 * (s(0, 0) + s(1, 1));
  const double spread = std::hypot(0.5 * (s(0, 0) - s(1, 1)), s(0, 1));
  f.k_min = mean - spread;
  f.k_max = mean + spread;
  // Derivatives are off by ulps of all that they are made of, the normal by that over the sine.
  const double all = j.s.norm() + j.su.norm() + j.sv.norm() + j.suu.norm() + 2 * j.suv.norm() + j.svv.norm();
  const double metric = f.first.determinant() / f.first.trace();  // no more than its least eigenvalue
  f.noise = kFormRoundoff * all / (metric * f.sine());
  return f;
}

}  // namespace

LocalForm local_form(const BezierPatch& patch, double u, double v) {
  const double size = tangent_size(patch);
  Jet2 jet = evaluate2(patch, u, v);
  // Where speeds differ so much, the slower is round-off; weights make all speeds small in the middle.
  const auto regular = [size](const Jet2& j) {
    const double a = j.su.norm(), b = j.sv.norm();
    return j.su.cross(j.sv).norm() > kSingularCross * size && std::min(a, b) > kPoleNormal * std::max(a, b);
  };
  for (const double step : kInsets) {
    if (regular(jet)) break;
    u += step * (0.5 - u) * 2;
    v += step * (0.5 - v) * 2;
    jet = evaluate2(patch, u, v);
  }
  return from_jet(jet, u, v);
}

double normal_curvature(const LocalForm& f, const Vec3& t) {
  const Vec2 rhs(f.su.dot(t), f.sv.dot(t));
  const double det = f.first(0, 0) * f.first(1, 1) - f.first(0, 1) * f.first(0, 1);
  const Vec2 d((f.first(1, 1) * rhs[0] - f.first(0, 1) * rhs[1]) / det,
               (f.first(0, 0) * rhs[1] - f.first(0, 1) * rhs[0]) / det);
  return d.dot(f.second * d) / d.dot(f.first * d);
}

}  // namespace nurbs

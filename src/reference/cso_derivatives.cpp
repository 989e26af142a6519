// Derivatives of the paper's objectives, eqs 8-20.
#include "reference/cso_derivatives.h"

#include <algorithm>
#include <cmath>

namespace nurbs {
namespace {

// A support Hessian with a smaller ratio of determinant to squared norm counts as singular.
constexpr double kSingularSystem = 1e-14;

Vec2 dot_first(const Jet3& s, const Vec3& d) {
  return {d.dot(s.su), d.dot(s.sv)};
}

Mat2 dot_second(const Jet3& s, const Vec3& d) {
  Mat2 m;
  const double uv = d.dot(s.suv);
  m << d.dot(s.suu), uv, uv, d.dot(s.svv);
  return m;
}

// d . S_ijk x_j y_k.
Vec2 dot_third(const Jet3& s, const Vec3& d, const Vec2& x, const Vec2& y) {
  const double uu = x[0] * y[0], uv = x[0] * y[1] + x[1] * y[0], vv = x[1] * y[1];
  const double uuu = d.dot(s.suuu), uuv = d.dot(s.suuv), uvv = d.dot(s.suvv), vvv = d.dot(s.svvv);
  return {uuu * uu + uuv * uv + uvv * vv, uuv * uu + uvv * uv + vvv * vv};
}

Vec4 join(const Vec2& a, const Vec2& b) {
  return {a[0], a[1], b[0], b[1]};
}

}  // namespace

SphericalChart SphericalChart::choose(const Vec3& d) {
  SphericalChart chart;
  d.cwiseAbs().minCoeff(&chart.polar_axis);
  return chart;
}

Vec2 SphericalChart::angles(const Vec3& d) const {
  const double x = d[(polar_axis + 1) % 3], y = d[(polar_axis + 2) % 3], z = d[polar_axis];
  return {std::atan2(y, x), std::atan2(std::hypot(x, y), z)};
}

DirectionJet SphericalChart::direction(const Vec2& angles) const {
  const double cr = std::cos(angles[0]), sr = std::sin(angles[0]);
  const double cp = std::cos(angles[1]), sp = std::sin(angles[1]);
  const auto permuted = [this](double x, double y, double z) {
    Vec3 v;
    v[(polar_axis + 1) % 3] = x;
    v[(polar_axis + 2) % 3] = y;
    v[polar_axis] = z;
    return v;
  };
  DirectionJet jet;
  jet.d = permuted(cr * sp, sr * sp, cp);
  jet.d_rho = permuted(-sr * sp, cr * sp, 0);
  jet.d_phi = permuted(cr * cp, sr * cp, -sp);
  jet.d_rho_rho = permuted(-cr * sp, -sr * sp, 0);
  jet.d_rho_phi = permuted(-sr * cp, cr * cp, 0);
  jet.d_phi_phi = -jet.d;
  return jet;
}

Jet2 place(const Jet2& jet, double scale, const Mat3& rotation, const Vec3& origin) {
  const Mat3 m = scale * rotation;
  return {origin + m * jet.s, m * jet.su, m * jet.sv, m * jet.suu, m * jet.suv, m * jet.svv};
}

Jet3 place(const Jet3& jet, double scale, const Mat3& rotation, const Vec3& origin) {
  const Mat3 m = scale * rotation;
  return {origin + m * jet.s, m * jet.su,   m * jet.sv,   m * jet.suu,  m * jet.suv,
          m * jet.svv,        m * jet.suuu, m * jet.suuv, m * jet.suvv, m * jet.svvv};
}

Jet2 second_order_part(const Jet3& jet) {
  return {jet.s, jet.su, jet.sv, jet.suu, jet.suv, jet.svv};
}

GapObjective gap_objective(const Jet2& a, const Jet2& b) {
  const Vec3 g = a.s - b.s;
  GapObjective f;
  f.value = 0.5 * g.squaredNorm();
  f.gradient << g.dot(a.su), g.dot(a.sv), -g.dot(b.su), -g.dot(b.sv);
  Eigen::Matrix<double, 3, 4> tangents;  // d g / d eta
  tangents << a.su, a.sv, -b.su, -b.sv;
  f.hessian = tangents.transpose() * tangents;
  f.hessian(0, 0) += g.dot(a.suu);
  f.hessian(0, 1) += g.dot(a.suv);
  f.hessian(1, 0) += g.dot(a.suv);
  f.hessian(1, 1) += g.dot(a.svv);
  f.hessian(2, 2) -= g.dot(b.suu);
  f.hessian(2, 3) -= g.dot(b.suv);
  f.hessian(3, 2) -= g.dot(b.suv);
  f.hessian(3, 3) -= g.dot(b.svv);
  return f;
}

SupportSystem support_system(const Jet3& s, const Vec3& d, FreeParameters free) {
  const Mat2 m = dot_second(s, d);
  SupportSystem system;
  if (free.u && free.v) {
    const double det = m.determinant();
    system.regular = std::abs(det) > kSingularSystem * m.squaredNorm();
    if (system.regular) system.inverse << m(1, 1) / det, -m(0, 1) / det, -m(1, 0) / det, m(0, 0) / det;
  } else if (free.u || free.v) {
    const int i = free.u ? 0 : 1;
    system.regular = std::abs(m(i, i)) > kSingularSystem * m.norm();
    if (system.regular) system.inverse(i, i) = 1 / m(i, i);
  } else {
    system.regular = true;
  }
  return system;
}

Vec2 parameter_derivative(const Jet3& s, const SupportSystem& system, const Vec3& d_alpha) {
  return -(system.inverse * dot_first(s, d_alpha));
}

Vec2 parameter_second_derivative(const Jet3& s, const SupportSystem& system, const Vec3& d,
                                 const Vec3& d_alpha, const Vec3& d_beta, const Vec3& d_alpha_beta,
                                 const Vec2& eta_alpha, const Vec2& eta_beta) {
  const Vec2 right = dot_first(s, d_alpha_beta) + dot_second(s, d_alpha) * eta_beta +
                     dot_second(s, d_beta) * eta_alpha + dot_third(s, d, eta_alpha, eta_beta);
  return -(system.inverse * right);
}

ParameterJet parameter_jet(const Jet3& s, const DirectionJet& d, FreeParameters free) {
  const SupportSystem system = support_system(s, d.d, free);
  ParameterJet eta;
  eta.regular = system.regular;
  eta.rho = parameter_derivative(s, system, d.d_rho);
  eta.phi = parameter_derivative(s, system, d.d_phi);
  const auto second = [&](const Vec3& alpha, const Vec3& beta, const Vec3& alpha_beta, const Vec2& eta_alpha,
                          const Vec2& eta_beta) {
    return parameter_second_derivative(s, system, d.d, alpha, beta, alpha_beta, eta_alpha, eta_beta);
  };
  eta.rho_rho = second(d.d_rho, d.d_rho, d.d_rho_rho, eta.rho, eta.rho);
  eta.rho_phi = second(d.d_rho, d.d_phi, d.d_rho_phi, eta.rho, eta.phi);
  eta.phi_phi = second(d.d_phi, d.d_phi, d.d_phi_phi, eta.phi, eta.phi);
  return eta;
}

AngleObjective angle_objective(const GapObjective& f, const ParameterJet& a, const ParameterJet& b) {
  const Vec4 rho = join(a.rho, b.rho), phi = join(a.phi, b.phi);
  AngleObjective result;
  result.value = f.value;
  result.gradient << f.gradient.dot(rho), f.gradient.dot(phi);
  result.hessian(0, 0) = rho.dot(f.hessian * rho) + f.gradient.dot(join(a.rho_rho, b.rho_rho));
  result.hessian(1, 1) = phi.dot(f.hessian * phi) + f.gradient.dot(join(a.phi_phi, b.phi_phi));
  result.hessian(0, 1) = rho.dot(f.hessian * phi) + f.gradient.dot(join(a.rho_phi, b.rho_phi));
  result.hessian(1, 0) = result.hessian(0, 1);
  return result;
}

}  // namespace nurbs

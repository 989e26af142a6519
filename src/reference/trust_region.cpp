// The trust-region subproblem solved in the eigenbasis of the Hessian, and the radius rule.
#include "reference/trust_region.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

namespace nurbs {
namespace {

constexpr int kMaxSecularIterations = 60;
constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

// Below this ratio of actual to predicted reduction the region shrinks, above the other it may grow; a step
// is taken above kTake. The customary values of Nocedal & Wright algorithm 4.1.
constexpr double kShrinkBelow = 0.25, kGrowAbove = 0.75, kTake = 0.1;

// s_i = -gamma_i / (lambda_i + mu), components whose denominator vanishes left at zero (their gamma is zero
// too, or the caller makes up for them with the hard case).
template <int N>
Eigen::Matrix<double, N, 1> shifted_newton(const Eigen::Matrix<double, N, 1>& gamma,
                                           const Eigen::Matrix<double, N, 1>& lambda, double mu,
                                           double floor) {
  Eigen::Matrix<double, N, 1> s;
  for (int i = 0; i < N; ++i) s[i] = lambda[i] + mu > floor ? -gamma[i] / (lambda[i] + mu) : 0.0;
  return s;
}

// The shift mu in (low, low + |gamma| / radius] at which |s(mu)| = radius: Newton on 1/|s| - 1/radius, which
// is nearly linear in mu (Nocedal & Wright eq. 4.43), kept inside the bracket by bisection.
template <int N>
double boundary_shift(const Eigen::Matrix<double, N, 1>& gamma, const Eigen::Matrix<double, N, 1>& lambda,
                      double low, double radius, double floor) {
  double high = low + gamma.norm() / radius;
  double mu = high;
  for (int iteration = 0; iteration < kMaxSecularIterations; ++iteration) {
    const Eigen::Matrix<double, N, 1> s = shifted_newton<N>(gamma, lambda, mu, floor);
    const double length = s.norm();
    if (std::abs(length - radius) <= 1e-12 * radius) break;
    (length > radius ? low : high) = mu;
    double curvature = 0;
    for (int i = 0; i < N; ++i)
      if (lambda[i] + mu > floor) curvature += s[i] * s[i] / (lambda[i] + mu);
    const double newton = curvature > 0 ? mu + length * length / curvature * (length - radius) / radius : low;
    mu = newton > low && newton < high ? newton : 0.5 * (low + high);
    if (high - low <= 4 * kEpsilon * high) break;
  }
  return mu;
}

}  // namespace

template <int N>
TrustRegionStep<N> solve_trust_region(const Eigen::Matrix<double, N, 1>& gradient,
                                      const Eigen::Matrix<double, N, N>& hessian, double radius) {
  TrustRegionStep<N> result;
  if (!gradient.allFinite() || !hessian.allFinite() || !(radius > 0)) return result;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, N, N>> basis(hessian);
  const Eigen::Matrix<double, N, 1>& lambda = basis.eigenvalues();  // ascending
  const Eigen::Matrix<double, N, 1> gamma = basis.eigenvectors().transpose() * gradient;
  const double floor = 4 * kEpsilon * lambda.cwiseAbs().maxCoeff();

  Eigen::Matrix<double, N, 1> s = shifted_newton<N>(gamma, lambda, 0, floor);
  if (!(lambda[0] > floor && s.norm() <= radius)) {
    const double low = std::max(0.0, -lambda[0]);
    s = shifted_newton<N>(gamma, lambda, low, floor);
    double unreached = 0;  // gradient along directions whose curvature vanishes at this shift
    for (int i = 0; i < N; ++i)
      if (lambda[i] + low <= floor) unreached = std::max(unreached, std::abs(gamma[i]));
    const bool hard = s.norm() <= radius && unreached <= kEpsilon * gamma.norm();
    result.on_boundary = true;
    if (hard && lambda[0] <= floor && lambda[0] >= -floor) {
      result.on_boundary = false;  // flat and no gradient along it: the shortest minimiser
    } else if (hard) {
      s[0] = std::sqrt(std::max(0.0, radius * radius - s.squaredNorm()));
    } else {
      s = shifted_newton<N>(gamma, lambda, boundary_shift<N>(gamma, lambda, low, radius, floor), floor);
      if (s.norm() > radius) s *= radius / s.norm();
    }
  }
  result.step = basis.eigenvectors() * s;
  result.predicted = std::max(0.0, -gamma.dot(s) - 0.5 * s.dot(lambda.cwiseProduct(s)));
  return result;
}

template TrustRegionStep<2> solve_trust_region<2>(const Eigen::Matrix<double, 2, 1>&,
                                                  const Eigen::Matrix<double, 2, 2>&, double);
template TrustRegionStep<4> solve_trust_region<4>(const Eigen::Matrix<double, 4, 1>&,
                                                  const Eigen::Matrix<double, 4, 4>&, double);

bool TrustRegion::accept(double actual, double predicted, bool on_boundary, double step_length,
                         double noise) {
  if (predicted <= noise) {
    const bool take = actual >= -noise;
    if (!take) radius = 0.25 * step_length;
    return take;
  }
  const double ratio = actual / predicted;
  if (!(ratio >= kShrinkBelow))
    radius = 0.25 * std::min(radius, step_length);
  else if (ratio > kGrowAbove && on_boundary)
    radius = std::min(2 * radius, max_radius);
  return ratio > kTake;
}

}  // namespace nurbs

// The torque-free rigid body in closed form.
//
// Notation: e = 1 / inertia; axis 2 has the intermediate moment and axis 3 is the one that the angular
// momentum l circles about in the body. With alpha = e2 - e3, gamma = e1 - e2, beta = e1 - e3 (all of one
// sign, or zero) Euler's equations read l1' = -alpha l2 l3, l2' = beta l1 l3, l3' = -gamma l1 l2 and are
// solved by l1 = A cn, l2 = B sn, l3 = C dn of lambda t, where A^2 = l1^2 + (alpha / beta) l2^2, C^2 = l3^2 +
// (gamma / beta) l2^2, A^2 + C^2 = l^2, lambda^2 = alpha beta C^2, m lambda^2 = gamma beta A^2. Everything is
// computed in units of |l| and min(inertia), so that squares neither overflow nor underflow.
#include "motion/free_rotor.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

namespace nurbs {
namespace {

// Below this the complementary parameter is round-off of the angular momentum's square; K is then 38.
constexpr double kLeastParameter = 1e-32;

// Gauss-Legendre, 10 points on [-1, 1]: abscissae and weights of the positive half.
constexpr std::array<double, 5> kGaussNode = {0.1488743389816312109, 0.4333953941292471908,
                                              0.6794095682990244062, 0.8650633666889845107,
                                              0.9739065285171717201};
constexpr std::array<double, 5> kGaussWeight = {0.2955242247147528702, 0.2692667193099963551,
                                                0.2190863625159820440, 0.1494513491505805931,
                                                0.0666713443086881376};
// The precession integrand has no pole nearer to the real axis than 0.785 in lambda t, so that ten points on
// an interval of this length leave 1e-16.
constexpr double kGaussInterval = 0.5;

// One free motion: constants of Euler's equations in the axes and units of the file comment.
struct Motion {
  double rate;   // |l| / min(inertia), 1 / time
  Vec3 inverse;  // 1 / inertia
  Vec3 l;        // angular momentum at the start
  double alpha, beta, gamma;
  double lambda;  // 0 when l doesn't move in the body
  double m1;      // 1 - m
};

// Right-handed rows: body axes into the axes of the file comment.
Mat3 order_axes(const Vec3& inverse, const Vec3& l) {
  std::array<int, 3> axis = {0, 1, 2};
  std::stable_sort(axis.begin(), axis.end(), [&](int i, int j) { return inverse[i] > inverse[j]; });
  const auto pull = [&](int i) {
    return std::abs(inverse[axis[1]] - inverse[axis[i]]) * l[axis[i]] * l[axis[i]];
  };
  if (pull(0) > pull(2)) std::swap(axis[0], axis[2]);
  Mat3 rows = Mat3::Zero();
  for (int i = 0; i < 3; ++i) rows(i, axis[i]) = 1;
  if (rows.determinant() < 0) rows.row(1) *= -1;
  return rows;
}

// `axes` receives order_axes. The angular momentum is not zero.
Motion make_motion(const Vec3& inertia, const Vec3& l_body, Mat3& axes) {
  const double length = l_body.stableNorm();
  const Vec3 inverse = inertia.cwiseInverse() * inertia.minCoeff();
  axes = order_axes(inverse, l_body / length);
  Motion motion;
  motion.rate = length / inertia.minCoeff();
  motion.inverse = axes.cwiseAbs() * inverse;
  motion.l = axes * (l_body / length);
  motion.alpha = motion.inverse[1] - motion.inverse[2];
  motion.beta = motion.inverse[0] - motion.inverse[2];
  motion.gamma = motion.inverse[0] - motion.inverse[1];
  const Vec3 l_squared = motion.l.cwiseAbs2();
  const double pull1 = motion.gamma * l_squared[0];
  const double pull3 = motion.alpha * l_squared[2];
  const double beta_c2 = motion.beta * l_squared[2] + motion.gamma * l_squared[1];
  const double lambda2 = motion.alpha * beta_c2;
  // Within round-off of the intermediate axis (l1 is then smaller still) the body is taken to stay there.
  const bool moves = lambda2 > 0 && motion.beta * l_squared[2] / beta_c2 > kLeastParameter;
  motion.lambda = moves ? std::sqrt(lambda2) : 0;
  motion.m1 = moves ? std::clamp(motion.beta * (pull3 - pull1) / lambda2, kLeastParameter, 1.0) : 1;
  return motion;
}

// Angular momentum in the body after time t, by the addition theorem.
Vec3 momentum_after(const Motion& motion, double t) {
  if (motion.lambda == 0) return motion.l;
  const JacobiElliptic f = jacobi_elliptic(motion.lambda * t, motion.m1);
  const double s = f.sn / motion.lambda;
  const double l1 = motion.l[0], l2 = motion.l[1], l3 = motion.l[2];
  // 1 - m sn^2 sn^2 of the theorem without its cancellation.
  const double denominator = f.cn * f.cn + motion.alpha * motion.beta * l3 * l3 * s * s;
  return Vec3(l1 * f.cn - motion.alpha * l2 * l3 * s * f.dn, l2 * f.cn * f.dn + motion.beta * l1 * l3 * s,
              l3 * f.dn - motion.gamma * l1 * l2 * s * f.cn) /
         denominator;
}

// Precession of one body axis about the angular momentum. Of axes 1 and 3 the one further away is followed:
// it never comes nearer than 45 degrees. Its rate is |l| (base + rate / (1 + ratio l2^2)).
struct Precession {
  Vec3 axis;
  double base, rate, ratio;
  double n;  // ratio l2^2 = n sn^2
};

Precession make_precession(const Motion& motion) {
  const Vec3 l_squared = motion.l.cwiseAbs2();
  const double beta_a2 = motion.beta * l_squared[0] + motion.alpha * l_squared[1];
  const double beta_c2 = motion.beta * l_squared[2] + motion.gamma * l_squared[1];
  if (std::abs(beta_a2) > std::abs(beta_c2)) {
    const double n = motion.alpha == 0 ? 0 : motion.gamma / motion.alpha;
    return {Vec3::UnitZ(), motion.inverse[2], motion.beta, motion.gamma / beta_a2, n};
  }
  if (beta_c2 == 0) return {Vec3::UnitX(), motion.inverse[0], 0, 0, 0};
  return {Vec3::UnitX(), motion.inverse[0], -motion.beta, motion.alpha / beta_c2, beta_a2 / beta_c2};
}

// Integral of 1 / (1 + ratio l2^2) over [0, t].
double integrate_precession(const Motion& motion, const Precession& precession, double t) {
  const auto integrand = [&](double at) {
    const double l2 = momentum_after(motion, at)[1];
    return 1 / (1 + precession.ratio * l2 * l2);
  };
  if (motion.lambda == 0) return t * integrand(0);
  const int intervals = 1 + static_cast<int>(motion.lambda * std::abs(t) / kGaussInterval);
  const double half = t / (2 * intervals);
  double sum = 0;
  for (int i = 0; i < intervals; ++i) {
    const double middle = (2 * i + 1) * half;
    for (size_t k = 0; k < kGaussNode.size(); ++k)
      sum += kGaussWeight[k] *
             (integrand(middle - kGaussNode[k] * half) + integrand(middle + kGaussNode[k] * half));
  }
  return half * sum;
}

// Columns: a right-handed frame made of the unit angular momentum (last) and an axis across it.
Mat3 momentum_frame(const Vec3& axis, const Vec3& l_unit) {
  Mat3 frame;
  frame.col(0) = axis.cross(l_unit).normalized();
  frame.col(1) = l_unit.cross(frame.col(0));
  frame.col(2) = l_unit;
  return frame;
}

}  // namespace

JacobiElliptic jacobi_elliptic(double u, double m1) {
  constexpr int kMaxLevels = 16;             // quadratic convergence: 8 reach round-off from m1 = 1e-32
  if (std::abs(u) < 1e-8) return {u, 1, 1};  // to round-off
  if (m1 <= 0) {
    const double sech = 1 / std::cosh(u);
    return {std::tanh(u), sech, sech};
  }
  std::array<double, kMaxLevels> a, g;
  double mean = 1, product = m1;
  int levels = 0;
  double next = 1;
  while (levels < kMaxLevels) {
    const double root = std::sqrt(product);
    a[levels] = mean;
    g[levels] = root;
    ++levels;
    next = 0.5 * (mean + root);
    if (std::abs(mean - root) <= 1e-8 * mean) break;
    product = root * mean;
    mean = next;
  }
  const double sine = std::sin(next * u);
  if (sine == 0) return {0, std::cos(next * u), 1};
  // c is the ratio cn / sn times the mean of its level, d the dn of its level.
  double ratio = std::cos(next * u) / sine;
  double c = next * ratio;
  double d = 1;
  for (int i = levels - 1; i >= 0; --i) {
    ratio *= c;
    c *= d;
    d = (g[i] + ratio) / (a[i] + ratio);
    ratio = c / a[i];
  }
  const double sn = std::copysign(1 / std::sqrt(c * c + 1), sine);
  return {sn, c * sn, d};
}

CompleteElliptic complete_elliptic(double n, double m1) {
  constexpr int kMaxLevels = 64;
  double a = 1, g = std::sqrt(m1), p = std::sqrt(1 + n), q = 1, sum = 0;
  for (int i = 0; i < kMaxLevels; ++i) {
    sum += q;
    if (std::abs(a - g) <= 1e-16 * a && std::abs(q) <= 1e-17) break;
    const double ag = a * g, p2 = p * p;
    q *= 0.5 * (p2 - ag) / (p2 + ag);
    p = (p2 + ag) / (2 * p);
    a = 0.5 * (a + g);
    g = std::sqrt(ag);
  }
  const double k = M_PI / (2 * a);
  return {k, 0.5 * k * (2 - n / (1 + n) * sum)};
}

double free_rotor_period(const Vec3& inertia, const Vec3& angular_momentum_body) {
  constexpr double kNever = std::numeric_limits<double>::infinity();
  if (angular_momentum_body.isZero(0)) return kNever;
  Mat3 axes;
  const Motion motion = make_motion(inertia, angular_momentum_body, axes);
  if (motion.lambda == 0 || motion.m1 <= kLeastParameter) return kNever;
  return 4 * complete_elliptic(0, motion.m1).k / motion.lambda / motion.rate;
}

void advance_free_rotor(const Vec3& inertia, double dt, Quat& q, const Vec3& angular_momentum) {
  if (angular_momentum.isZero(0)) return;
  Mat3 axes;
  const Motion motion = make_motion(inertia, q.conjugate() * angular_momentum, axes);
  const Precession precession = make_precession(motion);

  // l2^2 repeats after half a period of l, where l1 and l2 have changed sign.
  const double time = motion.rate * dt;
  double remainder = time, integral = 0;
  Vec3 sign = Vec3::Ones();
  if (motion.lambda > 0) {
    const CompleteElliptic complete = complete_elliptic(precession.n, motion.m1);
    const double halves = std::nearbyint(motion.lambda * time / (2 * complete.k));
    remainder = time - halves * 2 * complete.k / motion.lambda;
    integral = halves * 2 * complete.pi / motion.lambda;
    if (std::fmod(halves, 2) != 0) sign << -1, -1, 1;
  }
  integral += integrate_precession(motion, precession, remainder);
  const double angle = precession.base * time + precession.rate * integral;

  const Vec3 l_end = momentum_after(motion, remainder).cwiseProduct(sign).normalized();
  const Mat3 turn =
      momentum_frame(precession.axis, motion.l) * momentum_frame(precession.axis, l_end).transpose();
  const Quat about_l(Eigen::AngleAxisd(std::remainder(angle, 2 * M_PI), angular_momentum.stableNormalized()));
  q = about_l * q * Quat(Mat3(axes.transpose() * turn * axes));
  q.normalize();
}

}  // namespace nurbs

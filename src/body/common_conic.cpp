// Conics through points of two curves; see common_conic.h.
#include "body/common_conic.h"

#include <Eigen/Eigenvalues>
#include <Eigen/SVD>
#include <cmath>

#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

constexpr int kPoints = 9;         // of each curve, that the conic is fitted to
constexpr int kConicHalvings = 4;  // of a curve, in pieces
constexpr double kWay = 0.5;       // cosine between a derivative and its piece's direction, at least ...
constexpr double kTilt = 0.5;      // ... and between the gradient and that, at most
constexpr double kSameWay = 0.1;   // of the curve's extent: apart by less, both go the same way round
constexpr double kNewton = 0.25;   // of what the gradient's bound allows

using Scalars = Bernstein<double>;

// q of (x, y, 1): x^2, x y, y^2, x, y, 1.
using Conic = Eigen::Matrix<double, 6, 1>;

Conic fit(const std::vector<Vec3>& points) {
  Eigen::MatrixXd rows(points.size(), 6);
  for (size_t k = 0; k < points.size(); ++k) {
    const double x = points[k][0], y = points[k][1];
    rows.row(static_cast<int>(k)) << x * x, x * y, y * y, x, y, 1;
  }
  return Eigen::JacobiSVD<Eigen::MatrixXd>(rows, Eigen::ComputeFullV).matrixV().col(5);
}

// The coordinates of homogeneous points in the plane's axes, as polynomials.
struct PlaneCurve {
  Scalars x, y, z, w;
  explicit PlaneCurve(const Homogeneous& curve) : w(weights(curve)) {
    for (const Vec4& p : curve) {
      x.push_back(p[0]);
      y.push_back(p[1]);
      z.push_back(p[2]);
    }
  }
};

Scalars combine(double a, const Scalars& f, double b, const Scalars& g, double c, const Scalars& h) {
  Scalars sum(f.size());
  for (size_t k = 0; k < f.size(); ++k) sum[k] = a * f[k] + b * g[k] + c * h[k];
  return sum;
}

// |f / w| along a curve, at most.
double most(const Scalars& f, const Scalars& w) {
  double most = 0;
  for (size_t k = 0; k < f.size(); ++k) most = std::max(most, std::abs(f[k]) / w[k]);
  return most;
}

// Bounds of a curve against the conic.
struct Fit {
  double value = 0;             // |q|, at most
  double gradient = kInfinity;  // |grad q|, at least
  double off = 0;               // distance from the plane
  bool forward = true;          // without turning back
};

// Derivatives up to `still` are none: what the last digits make of them where the parameter has no speed.
void see(const Homogeneous& curve, const Conic& q, double still, int depth, Fit* fit) {
  if (depth > 0) {
    const auto [first, second] = halve(curve);
    see(first, q, still, depth - 1, fit);
    see(second, q, still, depth - 1, fit);
    return;
  }
  const PlaneCurve p(curve);
  const Scalars gx = combine(2 * q[0], p.x, q[1], p.y, q[3], p.w),
                gy = combine(q[1], p.x, 2 * q[2], p.y, q[4], p.w),
                rest = combine(q[3], p.x, q[4], p.y, 2 * q[5], p.w);
  // 2 q = x gx + y gy + rest, homogeneous.
  Scalars value = multiply(p.x, gx, kProduct);
  const Scalars by_y = multiply(p.y, gy, kProduct), by_w = multiply(p.w, rest, kProduct),
                square = multiply(p.w, p.w, kProduct);
  for (size_t k = 0; k < value.size(); ++k) value[k] = 0.5 * (value[k] + by_y[k] + by_w[k]);
  fit->value = std::max(fit->value, most(value, square));
  fit->off = std::max(fit->off, most(p.z, p.w));
  const size_t middle = gx.size() / 2;
  const Vec2 steepest = Vec2(gx[middle], gy[middle]).normalized();
  const Vec3 way = (place(curve.back()) - place(curve.front())).normalized();
  for (size_t k = 0; k < gx.size(); ++k) {
    const Vec2 g(gx[k], gy[k]);
    fit->gradient = std::min(fit->gradient, g.dot(steepest) / p.w[k]);
    fit->forward &= std::abs(g.dot(way.head<2>())) <= kTilt * g.norm();
  }
  for (const Vec3& d : hodograph(curve)) fit->forward &= d.norm() <= still || d.dot(way) >= kWay * d.norm();
}

double distance(const Fit& f, const Conic& q) {
  const double bend = 2 * (std::abs(q[0]) + std::abs(q[1]) + std::abs(q[2]));
  if (!(f.forward && f.gradient > 0 && f.value * bend <= kNewton * f.gradient * f.gradient)) return kInfinity;
  return 2 * f.value / f.gradient + f.off;
}

}  // namespace

double common_conic_gap(const Homogeneous& one, const Homogeneous& other, bool reversed, double along) {
  std::vector<Vec3> points;
  for (const Homogeneous* curve : {&one, &other})
    for (int k = 0; k < kPoints; ++k) points.push_back(point_at(*curve, k / (kPoints - 1.0)));
  Vec3 centre = Vec3::Zero();
  for (const Vec3& x : points) centre += x / static_cast<double>(points.size());
  double size = 0;
  Mat3 spread = Mat3::Zero();
  for (Vec3& x : points) {
    x -= centre;
    size = std::max(size, x.norm());
    spread += x * x.transpose();
  }
  if (!(size > 0 && along <= kSameWay * size)) return kInfinity;
  const Eigen::SelfAdjointEigenSolver<Mat3> solver(spread);
  const Mat3 axes =
      solver.eigenvectors().rowwise().reverse().transpose() / size;  // the plane's, then its normal
  for (Vec3& x : points) x = axes * x;
  const Conic q = fit(points);
  double apart = 0;
  for (const Homogeneous* curve : {&one, &other}) {
    Homogeneous seen = *curve;
    for (Vec4& p : seen) p.head<3>() = axes * (p.head<3>() - p[3] * centre);
    Fit fit;
    const double still = kVanishing * largest(hodograph(seen));
    see(seen, q, still, kConicHalvings, &fit);
    apart += distance(fit, q);
  }
  const double ends = std::max((place(one.front()) - place(reversed ? other.back() : other.front())).norm(),
                               (place(one.back()) - place(reversed ? other.front() : other.back())).norm());
  return size * apart + 2 * ends;
}

}  // namespace nurbs

// See edge_curves.h.
#include "body/edge_curves.h"

#include <algorithm>
#include <cmath>

#include "body/connectivity.h"
#include "body/edge_polynomials.h"
#include "body/shape.h"
#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

constexpr int kEdgeHalvings = 7;
constexpr double kTight = 1.2;  // a bound is, over a value that occurs

// Polynomials along a piece of an edge.
struct Piece {
  Bernstein<Vec3> hodograph, binormal;  // N and N x N'
  Bernstein<double> weight;
};

// No |f| is smaller: the least part along the mean.
double least(const Bernstein<Vec3>& f) {
  Vec3 mean = Vec3::Zero();
  for (const Vec3& x : f) mean += x;
  if (!(mean.norm() > 0)) return 0;
  mean.normalize();
  double low = std::numeric_limits<double>::infinity();
  for (const Vec3& x : f) low = std::min(low, x.dot(mean));
  return std::max(0.0, low);
}

double bend_of(double weight, double binormal, double speed) {
  return weight * weight * binormal / (speed * speed * speed);
}

// `noise`: the round-off of binormals.
void bound(const Piece& piece, double noise, int depth, double* bend, double* speed) {
  const double w = *std::max_element(piece.weight.begin(), piece.weight.end());
  const double low = least(piece.hodograph);
  const double upper =
      low > 0 ? bend_of(w, largest(piece.binormal) + noise, low) : std::numeric_limits<double>::infinity();
  const auto at_end = [&](bool last) {
    const auto end = [last](const auto& f) { return last ? f.back() : f.front(); };
    return bend_of(end(piece.weight), end(piece.binormal).norm() + noise, end(piece.hodograph).norm());
  };
  if (depth == 0 || upper <= *bend || upper <= kTight * std::max(at_end(false), at_end(true))) {
    *bend = std::max(*bend, upper);
    *speed = std::min(*speed, low / (w * w));
    return;
  }
  auto [n0, n1] = halve(piece.hodograph);
  auto [b0, b1] = halve(piece.binormal);
  auto [w0, w1] = halve(piece.weight);
  bound({std::move(n0), std::move(b0), std::move(w0)}, noise, depth - 1, bend, speed);
  bound({std::move(n1), std::move(b1), std::move(w1)}, noise, depth - 1, bend, speed);
}

EdgeCurve curve_of(const BezierPatch& patch, int edge) {
  Homogeneous points = edge_net(patch, edge);
  count_from(Vec4(points.front()), &points);
  Piece piece;
  piece.weight = weights(points);
  piece.hodograph = hodograph(points);
  const Bernstein<Vec3> second = derivative(piece.hodograph);
  piece.binormal = multiply(piece.hodograph, second, kCross);
  const double noise = 64 * kRoundoff * largest(piece.hodograph) * largest(second);
  double bend = 0, speed = std::numeric_limits<double>::infinity();
  bound(piece, noise, kEdgeHalvings, &bend, &speed);
  constexpr float kUp = 1 + 1e-6F;  // single precision rounds
  EdgeCurve curve;
  if (!(bend < kFarAway && speed > 0)) return curve;
  curve.bend = static_cast<float>(bend) * kUp;
  curve.speed = static_cast<float>(speed) / kUp;
  return curve;
}

}  // namespace

EdgeCurves find_edge_curves(const Shape& shape) {
  EdgeCurves curves;
  visit_creases(shape.links, [&](int patch, int edge) {
    if (curves.empty()) curves.resize(shape.patches.size());
    const EdgeLink& link = shape.links[patch][edge];
    curves[patch][edge] = curve_of(shape.patches[patch], edge);
    curves[link.patch][link.edge] = curve_of(shape.patches[link.patch], link.edge);
  });
  return curves;
}

}  // namespace nurbs

// Mass properties by the divergence theorem and Gauss-Legendre quadrature.
#include "body/mass_properties.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>

#include "nurbs/gauss_rule.h"
#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

constexpr double kIntegralRoundoff = 1e-15;  // of a patch's integral
constexpr int kMaxHalvings = 16;  // of a cell in either direction; reached only at a singular patch corner
constexpr int kMostHalved = 20000, kMostHalvedPerPatch = 50;  // cells of a body; some 40 are usual at a
                                                              // singular corner, none elsewhere

// Volume, first moments x y z, second moments xx yy zz xy xz yz.
using Moments = Eigen::Array<double, 10, 1>;

struct Rectangle {
  double u0, v0, size_u, size_v;  // a rectangle of the patch's parameters
  std::array<Rectangle, 2> halves(bool along_u) const {
    const double hu = along_u ? 0.5 * size_u : size_u, hv = along_u ? size_v : 0.5 * size_v;
    return {Rectangle{u0, v0, hu, hv}, Rectangle{u0 + size_u - hu, v0 + size_v - hv, hu, hv}};
  }
};

Moments integrate_cell(const BezierPatch& patch, const Rectangle& cell, const GaussRule& rule,
                       const Vec3& reference) {
  Moments sum = Moments::Zero();
  const double area = cell.size_u * cell.size_v;
  for (size_t i = 0; i < rule.nodes.size(); ++i) {
    for (size_t j = 0; j < rule.nodes.size(); ++j) {
      const Jet1 s =
          evaluate1(patch, cell.u0 + cell.size_u * rule.nodes[i], cell.v0 + cell.size_v * rule.nodes[j]);
      const Vec3 x = s.s - reference;
      const double f = rule.weights[i] * rule.weights[j] * area * x.dot(s.su.cross(s.sv));
      Moments m;
      m << f / 3, f / 4 * x[0], f / 4 * x[1], f / 4 * x[2], f / 5 * x[0] * x[0], f / 5 * x[1] * x[1],
          f / 5 * x[2] * x[2], f / 5 * x[0] * x[1], f / 5 * x[0] * x[2], f / 5 * x[1] * x[2];
      sum += m;
    }
  }
  return sum;
}

// A cell is halved in the direction in which that changes most: next to a heavy control point the surface has
// its bend in a strip of the parameters.
struct AdaptiveRule {
  const BezierPatch& patch;
  const GaussRule& rule;
  const Vec3& reference;
  const Moments& allowed;
  int* left;  // cells

  // `halvings`: how often the cell may be halved in u and in v.
  Moments run(const Rectangle& cell, const Moments& whole, const std::array<int, 2>& halvings) const {
    Moments parts[2][2], sum[2];
    double change[2];
    for (const int way : {0, 1}) {
      const std::array<Rectangle, 2> halves = cell.halves(way == 0);
      for (int k = 0; k < 2; ++k) parts[way][k] = integrate_cell(patch, halves[k], rule, reference);
      sum[way] = parts[way][0] + parts[way][1];
      change[way] = halvings[way] > 0 ? ((sum[way] - whole).abs() / allowed).maxCoeff() : 0;
    }
    // Overflows make no number: halving would not end that.
    if (--*left < 0 || !(std::max(change[0], change[1]) > 1)) return sum[0] + sum[1] - whole;
    const int way = change[0] >= change[1] ? 0 : 1;
    std::array<int, 2> less = halvings;
    --less[way];
    const std::array<Rectangle, 2> halves = cell.halves(way == 0);
    return run(halves[0], parts[way][0], less) + run(halves[1], parts[way][1], less);
  }
};

// The same patch in other parameters, u -> c u / (1 + (c - 1) u) and v likewise, in which its corners weigh
// about the same: weights of 1e6 : 1 crowd it into 1e-6 of its parameters, which no node of a rule meets and
// halving finds by luck.
BezierPatch with_even_weights(BezierPatch patch) {
  const int p = patch.degree_u, q = patch.degree_v;
  const auto w = [&](int i, int j) { return std::log(patch.point(i, j)[3]); };
  const double u = 0.5 * (w(0, 0) - w(p, 0) + w(0, q) - w(p, q)) / p,
               v = 0.5 * (w(0, 0) - w(0, q) + w(p, 0) - w(p, q)) / q;
  if (std::max(std::abs(p * u), std::abs(q * v)) < std::log(kUnevenWeights)) return patch;
  for (int i = 0; i <= p; ++i)
    for (int j = 0; j <= q; ++j) patch.point(i, j) *= std::exp(i * u + j * v);
  return patch;
}

// Points per direction: exact for the second moments of a polynomial patch (degree 5 p - 1), a start for
// others.
int rule_size(const BezierPatch& patch) {
  const int degree = std::max(patch.degree_u, patch.degree_v);
  return patch.rational ? 2 * degree + 4 : (5 * degree + 1) / 2;
}

Vec3 middle_of_box(const std::vector<BezierPatch>& patches) {
  Eigen::AlignedBox3d box;
  for (const BezierPatch& patch : patches) {
    for (const Vec4& p : patch.points) box.extend(Vec3(p.head<3>() / p[3]));
  }
  return box.center();
}

// Sizes against which the errors of the moments are measured: V, V L_i, V L_i L_j with L_i the radius of
// gyration along axis i.
Moments moment_scales(const Moments& m) {
  const double volume = std::abs(m[0]);
  Vec3 length;
  for (int i = 0; i < 3; ++i) length[i] = std::sqrt(std::abs(m[4 + i]) / volume);
  Moments scale;
  scale << 1, length[0], length[1], length[2], length[0] * length[0], length[1] * length[1],
      length[2] * length[2], length[0] * length[1], length[0] * length[2], length[1] * length[2];
  return volume * scale;
}

MassProperties from_moments(const Moments& m, const Vec3& reference) {
  MassProperties mass;
  mass.volume = m[0];
  const Vec3 offset = Vec3(m[1], m[2], m[3]) / m[0];
  mass.center = reference + offset;
  Mat3 second;
  second << m[4], m[7], m[8], m[7], m[5], m[9], m[8], m[9], m[6];
  second -= m[0] * offset * offset.transpose();
  mass.inertia = second.trace() * Mat3::Identity() - second;
  return mass;
}

}  // namespace

MassProperties integrate_mass(const std::vector<BezierPatch>& given, bool* done) {
  std::vector<BezierPatch> patches;
  patches.reserve(given.size());
  for (const BezierPatch& patch : given) patches.push_back(patch.rational ? with_even_weights(patch) : patch);
  const Vec3 reference = middle_of_box(patches);
  std::vector<GaussRule> rules(5 * kMaxDegree + 1);
  for (const BezierPatch& patch : patches) {
    GaussRule& rule = rules[rule_size(patch)];
    if (rule.nodes.empty()) rule = gauss_rule(rule_size(patch));
  }
  const Rectangle all{0, 0, 1, 1};
  std::vector<Moments> whole;
  Moments total = Moments::Zero(), largest = Moments::Zero();
  for (const BezierPatch& patch : patches) {
    whole.push_back(integrate_cell(patch, all, rules[rule_size(patch)], reference));
    total += whole.back();
    largest = largest.max(whole.back().abs());
  }
  if (!(total[0] != 0)) return {};
  // Patches that cancel leave a volume below which there is round-off only.
  const Moments allowed = (kMomentTolerance * moment_scales(total)).max(kIntegralRoundoff * largest);
  int left = kMostHalved + kMostHalvedPerPatch * static_cast<int>(patches.size());
  total.setZero();
  for (size_t p = 0; p < patches.size(); ++p) {
    if (patches[p].rational)
      total += AdaptiveRule{patches[p], rules[rule_size(patches[p])], reference, allowed, &left}.run(
          all, whole[p], {kMaxHalvings, kMaxHalvings});
    else
      total += whole[p];
  }
  if (done) *done = left >= 0;
  return from_moments(total, reference);
}

PrincipalFrame principal_frame(const Mat3& tensor) {
  Mat3 clean = tensor;
  const double round_off = kMomentRoundoff * tensor.diagonal().cwiseAbs().maxCoeff();
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      if (i != j && std::abs(tensor(i, j)) <= round_off) clean(i, j) = 0;
    }
  }
  const Eigen::SelfAdjointEigenSolver<Mat3> solver(clean);
  Mat3 axes = solver.eigenvectors();
  if (axes.determinant() < 0) axes.col(2) = -axes.col(2);
  PrincipalFrame frame;
  frame.moments = solver.eigenvalues();
  frame.axes = Quat(axes).normalized();
  return frame;
}

}  // namespace nurbs

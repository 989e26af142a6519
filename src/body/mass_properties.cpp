// Mass properties by the divergence theorem and Gauss-Legendre quadrature.
#include "body/mass_properties.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "nurbs/gauss_rule.h"
#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

constexpr double kIntegralRoundoff = 1e-15;                         // of a patch's integral
constexpr int kMostQuartered = 20000, kMostQuarteredPerPatch = 50;  // cells of a body; some 40 are usual at a
                                                                    // singular corner, none elsewhere

// Volume, first moments x y z, second moments xx yy zz xy xz yz.
using Moments = Eigen::Array<double, 10, 1>;

struct Square {
  double u0, v0, size;  // a square of the patch's parameters
};

Moments integrate_cell(const BezierPatch& patch, const Square& cell, const GaussRule& rule,
                       const Vec3& reference) {
  Moments sum = Moments::Zero();
  for (size_t i = 0; i < rule.nodes.size(); ++i) {
    for (size_t j = 0; j < rule.nodes.size(); ++j) {
      const Jet1 s =
          evaluate1(patch, cell.u0 + cell.size * rule.nodes[i], cell.v0 + cell.size * rule.nodes[j]);
      const Vec3 x = s.s - reference;
      const double f = rule.weights[i] * rule.weights[j] * cell.size * cell.size * x.dot(s.su.cross(s.sv));
      Moments m;
      m << f / 3, f / 4 * x[0], f / 4 * x[1], f / 4 * x[2], f / 5 * x[0] * x[0], f / 5 * x[1] * x[1],
          f / 5 * x[2] * x[2], f / 5 * x[0] * x[1], f / 5 * x[0] * x[2], f / 5 * x[1] * x[2];
      sum += m;
    }
  }
  return sum;
}

Moments integrate_adaptively(const BezierPatch& patch, const Square& cell, const GaussRule& rule,
                             const Vec3& reference, const Moments& whole, const Moments& allowed,
                             int halvings, int* left) {
  const double h = 0.5 * cell.size;
  const Square quarters[4] = {{cell.u0, cell.v0, h},
                              {cell.u0, cell.v0 + h, h},
                              {cell.u0 + h, cell.v0, h},
                              {cell.u0 + h, cell.v0 + h, h}};
  Moments parts[4], sum = Moments::Zero();
  for (int q = 0; q < 4; ++q) {
    parts[q] = integrate_cell(patch, quarters[q], rule, reference);
    sum += parts[q];
  }
  // Overflows make no number: halving would not end that, but ten times.
  if (halvings == 0 || --*left < 0 || !((sum - whole).abs() > allowed).any()) return sum;
  sum.setZero();
  for (int q = 0; q < 4; ++q) {
    sum += integrate_adaptively(patch, quarters[q], rule, reference, parts[q], allowed, halvings - 1, left);
  }
  return sum;
}

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

MassProperties integrate_mass(const std::vector<BezierPatch>& given) {
  std::vector<BezierPatch> patches;
  patches.reserve(given.size());
  for (const BezierPatch& patch : given) patches.push_back(patch.rational ? with_even_weights(patch) : patch);
  const Vec3 reference = middle_of_box(patches);
  std::vector<GaussRule> rules(5 * kMaxDegree + 1);
  for (const BezierPatch& patch : patches) {
    GaussRule& rule = rules[rule_size(patch)];
    if (rule.nodes.empty()) rule = gauss_rule(rule_size(patch));
  }
  const Square all{0, 0, 1};
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
  int left = kMostQuartered + kMostQuarteredPerPatch * static_cast<int>(patches.size());
  total.setZero();
  for (size_t p = 0; p < patches.size(); ++p) {
    total += patches[p].rational ? integrate_adaptively(patches[p], all, rules[rule_size(patches[p])],
                                                        reference, whole[p], allowed, kMaxHalvings, &left)
                                 : whole[p];
  }
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

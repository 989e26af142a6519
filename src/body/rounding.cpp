// Centre and radius from two normals of a patch, the proof from its coefficients.
#include "body/rounding.h"

#include <algorithm>
#include <cmath>

#include "body/bounds.h"
#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

constexpr double kRounded = 1e-13;     // of a patch's size and of the squared radius: off its quadric
constexpr double kBentAnyhow = 1e-11;  // relative error of a curvature that is always allowed for

// Away from the patch's edges, which may be collapsed.
std::vector<PointAndNormal> samples_of(const BezierPatch& patch) {
  std::vector<PointAndNormal> samples;
  for (const double u : {0.05, 0.5, 0.95})
    for (const double v : {0.05, 0.5, 0.95}) {
      const Jet1 jet = evaluate1(patch, u, v);
      samples.push_back({jet.s, jet.su.cross(jet.sv).normalized()});
    }
  return samples;
}

bool is_plane(const BezierPatch& patch, const PointAndNormal& s, double size) {
  const bool bilinear = patch.degree_u == 1 && patch.degree_v == 1;
  const Vec3 n = bilinear ? bilinear_normal(patch) : s.n;
  return std::all_of(patch.points.begin(), patch.points.end(), [&](const Vec4& p) {
    return std::abs(n.dot(p.head<3>() / p[3] - s.x)) <= kRounded * size;
  });
}

// How far |map (x - centre)|^2 is from 1, at most.
double off_unit(BezierPatch patch, const Vec3& centre, const Mat3& map) {
  for (Vec4& p : patch.points) p.head<3>() = map * (p.head<3>() - p[3] * centre);
  return bound_off_unit_sphere(patch);
}

}  // namespace

double bent_by(const BezierPatch& patch) {
  const int n = 2 * std::max(patch.degree_u, patch.degree_v);
  return 16.0 * n * (n - 1);
}

double rounding(const BezierPatch& patch) {
  const std::vector<PointAndNormal> samples = samples_of(patch);
  const PointAndNormal* one = &samples[0];
  const PointAndNormal* two = &samples[0];
  double size = 0;
  for (const PointAndNormal& s : samples)
    for (const PointAndNormal& t : samples) {
      size = std::max(size, (s.x - t.x).norm());
      if ((s.n - t.n).squaredNorm() > (one->n - two->n).squaredNorm()) one = &s, two = &t;
    }
  const Vec3 turned = two->n - one->n;
  if (!(turned.norm() > kTwoNormals)) return is_plane(patch, samples[4], size) ? kFarAway : 0;
  const double radius = turned.dot(two->x - one->x) / turned.squaredNorm();
  if (!(radius > 0)) return 0;
  const Vec3 centre = one->x - radius * one->n, axis = one->n.cross(two->n).normalized();
  const Mat3 sphere = Mat3::Identity() / radius,
             cylinder = (Mat3::Identity() - axis * axis.transpose()) / radius;
  // Of a small part of a ball, or a narrow strip of a cylinder, an error of position bends more.
  const double in_u = (samples[7].n - samples[1].n).norm(), in_v = (samples[5].n - samples[3].n).norm();
  const double bend = bent_by(patch);
  const auto bent = [&](const Mat3& map, double angle) {
    const double off = off_unit(patch, centre, map);
    return off <= kRounded ? bend * off / std::min(1.0, angle * angle) : kFarAway;
  };
  const double error = std::min(bent(sphere, std::min(in_u, in_v)), bent(cylinder, std::max(in_u, in_v)));
  return std::max(radius * (1 - kBentAnyhow - error), 0.0);
}

double least_rounding(const std::vector<BezierPatch>& patches) {
  double least = kFarAway;
  for (const BezierPatch& patch : patches) {
    least = std::min(least, rounding(patch));
    if (!(least > 0)) return 0;
  }
  return least;
}

}  // namespace nurbs

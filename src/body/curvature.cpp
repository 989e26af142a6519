// Surface samples and curvature extremes.
#include "body/curvature.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "body/local_form.h"
#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

int samples_per_edge(size_t patches) {
  const double n = std::sqrt(kSurfaceSamples / static_cast<double>(patches));
  return std::clamp(static_cast<int>(std::lround(n)), kLeastPerEdge, kMostPerEdge);
}

double size_of(const std::vector<SurfaceSample>& samples) {
  double size = 0;
  for (const SurfaceSample& s : samples) size = std::max(size, s.point.norm());
  return size;
}

using CurvatureAt = std::function<double(double u, double v)>;

// Largest value of `k` near (u, v): pattern search in the unit square with a halving step.
double climb(const CurvatureAt& k, double u, double v, double step) {
  double best = k(u, v);
  for (int round = 0; round < kPatternRounds; ++round, step *= 0.5) {
    double next_u = u, next_v = v;
    for (int i = -1; i <= 1; ++i) {
      for (int j = -1; j <= 1; ++j) {
        const double a = std::clamp(u + i * step, 0.0, 1.0), b = std::clamp(v + j * step, 0.0, 1.0);
        const double value = k(a, b);
        if (value > best) best = value, next_u = a, next_v = b;
      }
    }
    u = next_u;
    v = next_v;
  }
  return best;
}

// Safe upper bound of `k` over a patch whose largest sample is at `start`.
double upper_curvature(const CurvatureAt& k, const SurfacePoint& start, double step) {
  const double best = climb(k, start.u, start.v, step);
  double change = 0;
  for (int i = -1; i <= 1; ++i) {
    for (int j = -1; j <= 1; ++j) {
      const double u = std::clamp(start.u + i * step, 0.0, 1.0), v = std::clamp(start.v + j * step, 0.0, 1.0);
      change = std::max(change, best - k(u, v));
    }
  }
  return best + kChangeShare * change + kCurvatureMargin * std::abs(best);
}

// Largest of sign * k over the patch's samples [first, last).
const SurfaceSample& extreme(const std::vector<SurfaceSample>& s, size_t first, size_t last, bool largest) {
  size_t best = first;
  for (size_t i = first + 1; i < last; ++i) {
    if (largest ? s[i].k_max > s[best].k_max : s[i].k_min < s[best].k_min) best = i;
  }
  return s[best];
}

}  // namespace

std::vector<SurfaceSample> sample_surface(const std::vector<BezierPatch>& patches) {
  const int n = samples_per_edge(patches.size());
  std::vector<SurfaceSample> samples;
  samples.reserve(patches.size() * n * n);
  for (size_t p = 0; p < patches.size(); ++p) {
    for (int i = 0; i < n; ++i) {
      for (int j = 0; j < n; ++j) {
        const LocalForm f = local_form(patches[p], i / (n - 1.0), j / (n - 1.0));
        const double spacing = std::max(f.su.norm(), f.sv.norm()) / (n - 1);
        samples.push_back({{static_cast<int>(p), f.u, f.v}, f.point, f.normal, f.k_min, f.k_max, spacing});
      }
    }
  }
  return samples;
}

CurvatureBounds bound_patch_curvature(const std::vector<BezierPatch>& patches,
                                      const std::vector<SurfaceSample>& samples) {
  const size_t per_patch = samples.size() / patches.size();
  const double step = 1.0 / (std::sqrt(static_cast<double>(per_patch)) - 1);
  double largest = 0, least = std::numeric_limits<double>::infinity();
  for (size_t p = 0; p < patches.size(); ++p) {
    const size_t first = p * per_patch, last = first + per_patch;
    const auto k_max = [&](double u, double v) { return local_form(patches[p], u, v).k_max; };
    const auto minus_k_min = [&](double u, double v) { return -local_form(patches[p], u, v).k_min; };
    largest = std::max(largest, upper_curvature(k_max, extreme(samples, first, last, true).where, step));
    least = std::min(least, -upper_curvature(minus_k_min, extreme(samples, first, last, false).where, step));
  }
  CurvatureBounds bounds;
  const bool flat = least <= kCurvatureNoise / size_of(samples);
  bounds.min_radius = largest > 0 ? 1 / largest : std::numeric_limits<double>::infinity();
  bounds.max_radius = flat ? std::numeric_limits<double>::infinity() : 1 / least;
  return bounds;
}

CurvatureBounds add_kinks(const CurvatureBounds& patches, const KinkSummary& kinks) {
  CurvatureBounds bounds = patches;
  if (kinks.convex > kNoKink) bounds.min_radius = 0;
  if (kinks.concave > kNoKink) bounds.max_radius = std::numeric_limits<double>::infinity();
  return bounds;
}

}  // namespace nurbs

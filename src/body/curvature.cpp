// Surface samples; kinks.
#include "body/curvature.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "body/local_form.h"
#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

int samples_per_edge(size_t patches) {
  const double n = std::sqrt(kSurfaceSamples / static_cast<double>(patches));
  return std::clamp(static_cast<int>(std::lround(n)), kLeastPerEdge, kMostPerEdge);
}

}  // namespace

std::vector<SurfaceSample> sample_surface(const std::vector<BezierPatch>& patches) {
  const int n = samples_per_edge(patches.size());
  std::vector<SurfaceSample> samples;
  samples.reserve(patches.size() * n * n);
  for (size_t p = 0; p < patches.size(); ++p) {
    std::vector<SurfaceSample> in_line;
    const size_t before = samples.size();
    for (int i = 0; i < n; ++i) {
      for (int j = 0; j < n; ++j) {
        const LocalForm f = local_form(patches[p], i / (n - 1.0), j / (n - 1.0));
        const double spacing = std::max(f.su.norm(), f.sv.norm()) / (n - 1);
        (f.in_line() ? in_line : samples)
            .push_back(
                {{static_cast<int>(p), f.u, f.v}, f.point, f.normal, f.k_min, f.k_max, f.noise, spacing});
      }
    }
    if (samples.size() == before) samples.insert(samples.end(), in_line.begin(), in_line.end());
  }
  return samples;
}

CurvatureBounds add_kinks(const CurvatureBounds& patches, const KinkSummary& kinks) {
  CurvatureBounds bounds = patches;
  if (kinks.convex > kNoKink) bounds.min_radius = 0;
  if (kinks.concave > kNoKink) bounds.max_radius = std::numeric_limits<double>::infinity();
  return bounds;
}

}  // namespace nurbs

// Words for Shape::proofs.
#include "body/proofs.h"

#include <cmath>
#include <cstdio>

#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

template <class... Values>
std::string format(const char* text, Values... values) {
  char line[256];
  std::snprintf(line, sizeof line, text, values...);
  return line;
}

}  // namespace

std::vector<std::string> describe_proofs(const Shape& shape) {
  const Proofs& p = shape.proofs;
  const CurvatureBounds& radii = shape.patch_curvature;
  std::vector<std::string> lines;
  if (p.sphere) {
    lines.push_back(format("proven: a sphere to %.0e of its radius", kSphere));
  } else if (p.convex) {
    lines.push_back(format("proven: no negative curvature inside the patches, %.3g %% flat or ruled",
                           100 * p.flat_share));
  } else {
    lines.push_back(format("not proven: curvature of %.3g %% of the surface (dents, inflections, tips)",
                           100 * p.unproven_share));
  }
  lines.push_back(format("proven: curvature radii from %.4g to %.4g (%.4g to %.4g occur), %d cells",
                         radii.min_radius, radii.max_radius, p.sphere ? radii.min_radius : p.seen_min,
                         p.sphere ? radii.max_radius : p.seen_max, p.cells));
  if (p.rate > 0 && !p.sphere)
    lines.push_back(
        format("proven: they change by at most %.3g a radian (%.3g occurs)", p.rate, p.seen_rate));
  lines.push_back(format("proven: joints gape by at most %.2g, open by %.3g and close by %.3g degrees",
                         p.joint_gap, p.opening * 180 / M_PI, p.closing * 180 / M_PI));
  if (shape.dented()) lines.push_back(format("measured, not proven: dents %.3g deep", shape.concavity));
  return lines;
}

}  // namespace nurbs

// Distances to kinked joints and the radii that hold there; see rolling.h.
#include "body/rolling.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "body/shape.h"
#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Least length of surface crossed per unit of u (and of v), square to the other parameter line.
std::array<double, 2> least_speed(const BezierPatch& patch) {
  std::array<double, 2> least{kInfinity, kInfinity};
  for (int i = 0; i <= kSpeedSamples; ++i)
    for (int j = 0; j <= kSpeedSamples; ++j) {
      const Jet1 jet = evaluate1(patch, double(i) / kSpeedSamples, double(j) / kSpeedSamples);
      const double area = jet.su.cross(jet.sv).norm(), lu = jet.su.norm(), lv = jet.sv.norm();
      least[0] = std::min(least[0], lv > 0 ? area / lv : 0);
      least[1] = std::min(least[1], lu > 0 ? area / lu : 0);
    }
  return {kSpeedSafety * least[0], kSpeedSafety * least[1]};
}

}  // namespace

JointDistance measure_joint_distance(const Shape& shape) {
  JointDistance joints;
  joints.width = kInfinity;
  for (size_t p = 0; p < shape.patches.size(); ++p) {
    const std::array<double, 2> least = least_speed(shape.patches[p]);
    std::array<double, 4> speed;
    for (int edge = 0; edge < 4; ++edge) {
      const double kink = shape.links[p][edge].kink;
      const bool kinked = std::abs(kink) > kNoKink;
      speed[edge] = kinked ? least[edge / 2] : kInfinity;
      if (kinked)
        (kink > 0 ? joints.convex : joints.concave) =
            std::max(kink > 0 ? joints.convex : joints.concave, std::abs(kink));
    }
    joints.width = std::min({joints.width, least[0], least[1]});
    joints.speed.push_back(speed);
  }
  return joints;
}

RollingRadii rolling_radii(const Shape& shape, const SurfacePoint& at, const Vec3& normal) {
  const JointDistance& joints = shape.joints;
  const CurvatureBounds& patch = shape.patch_curvature;
  const double near = shape.normal_map.cells > 0 ? shape.normal_map.radius_at(normal) : kInfinity;
  if (joints.none()) return {patch.min_radius, patch.max_radius, shape.support_excess, near};
  const std::array<double, 4>& speed = joints.speed[at.patch];
  // 0 * infinity is not a number: an edge at parameter distance 0 that is smooth must not count.
  double s = joints.width;
  const double parameter[4] = {at.u, 1 - at.u, at.v, 1 - at.v};
  for (int edge = 0; edge < 4; ++edge)
    if (speed[edge] < kInfinity) s = std::min(s, speed[edge] * std::max(0.0, parameter[edge]));
  RollingRadii radii{0.5 * patch.min_radius, patch.max_radius, shape.support_excess, near};
  if (joints.convex > 0) radii.inner = std::min(radii.inner, 0.25 * s / joints.convex);
  if (joints.concave > 0) {
    const bool clear = s >= patch.max_radius * joints.concave;
    radii.outer = clear ? 2 * patch.max_radius : kInfinity;
    if (clear) radii.slack = 0;
  }
  return radii;
}

}  // namespace nurbs

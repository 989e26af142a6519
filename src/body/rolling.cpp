// Distances to kinked joints and the radii that hold there; see rolling.h.
#include "body/rolling.h"

#include <algorithm>
#include <cmath>

#include "body/shape.h"
#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

// Least length of surface crossed per unit of u (and of v), square to the other parameter line.
std::array<double, 2> least_speed(const PatchRate& patch) {
  std::array<double, 2> least{kInfinity, kInfinity};
  for (const PatchRate::Cell& cell : patch.cells) {
    least[0] = std::min<double>(least[0], cell.speed_u);
    least[1] = std::min<double>(least[1], cell.speed_v);
  }
  return least;
}

// Ball that touches where the surface covers a disc of radius `cover` of the tangent plane.
double inscribed(const Shape& shape, double cover) {
  return cover * shape.inner_radius / (cover + shape.bounding_radius);
}

constexpr double kSineOfOne = 0.84;
constexpr double kNarrow = 0.1;  // of the bounding radius: patches whose width says little
constexpr double kSharp = 0.02;  // ... and balls that serve; smaller ones are looked into

// Ball that touches at a point, by what is known of the surface around it on its patch, and of bodies of
// revolution all round.
double local_ball(const Shape& shape, const SurfacePoint& at) {
  if (shape.rates.empty()) return 0;  // while the body is made
  const Meridian& m = shape.meridian;
  const int sector = m.exact ? m.sector_of[at.patch] : -1;
  const Alike alike = sector < 0                    ? Alike::none
                      : m.sectors[sector].arcs_in_u ? Alike::along_u
                                                    : Alike::along_v;
  const LocalRate here = rate_near(shape.rates[at.patch], at, alike);
  const double least = std::min(here.least, shape.bounding_radius);
  return std::min(least, inscribed(shape, kSineOfOne * std::min(here.room, least)));
}

}  // namespace

JointDistance measure_joint_distance(const Shape& shape) {
  JointDistance joints;
  joints.width = kInfinity;
  for (size_t p = 0; p < shape.patches.size(); ++p) {
    const std::array<double, 2> least = least_speed(shape.rates[p]);
    std::array<double, 4> speed;
    for (int edge = 0; edge < 4; ++edge) {
      const EdgeLink& link = shape.links[p][edge];
      const double angle = link.widest();
      speed[edge] = link.kinked() ? least[edge / 2] : kInfinity;
      if (link.kinked())
        (link.kink > 0 ? joints.convex : joints.concave) =
            std::max(link.kink > 0 ? joints.convex : joints.concave, angle);
    }
    joints.width = std::min({joints.width, least[0], least[1]});
    joints.speed.push_back(speed);
  }
  if (!joints.none() && joints.width < kNarrow * shape.bounding_radius)
    joints.segments = find_kink_segments(shape);
  return joints;
}

RollingRadii rolling_radii(const Shape& shape, const SurfacePoint& at, const Vec3& normal, double enough) {
  const JointDistance& joints = shape.joints;
  const CurvatureBounds& patch = shape.patch_curvature;
  const double near = shape.normal_map.cells > 0 ? shape.normal_map.radius_at(normal) : kInfinity;
  if (joints.none()) {
    const bool sharp = patch.min_radius < kSharp * shape.bounding_radius;
    return {sharp ? std::max(patch.min_radius, local_ball(shape, at)) : patch.min_radius, patch.max_radius,
            shape.support_excess, near};
  }
  const std::array<double, 4>& speed = joints.speed[at.patch];
  // 0 * infinity is not a number: an edge at parameter distance 0 that is smooth must not count.
  double s = joints.width;
  const double parameter[4] = {at.u, 1 - at.u, at.v, 1 - at.v};
  for (int edge = 0; edge < 4; ++edge)
    if (speed[edge] < kInfinity) s = std::min(s, speed[edge] * std::max(0.0, parameter[edge]));
  const double r0 = patch.min_radius;
  enough = std::min(enough, kSharp * shape.bounding_radius);
  const auto ball_clear_of = [&](double distance) {
    return std::min(r0, inscribed(shape, kSineOfOne * std::min(distance, r0)));
  };
  double inner = ball_clear_of(s);
  if (joints.convex <= kSmallKink) {
    double across_kinks = std::min(0.5 * r0, inscribed(shape, kSineOfOne * std::min(joints.width, r0)));
    if (joints.convex > 0) across_kinks = std::min(across_kinks, 0.25 * s / joints.convex);
    inner = std::max(inner, across_kinks);
  }
  if (inner < enough) inner = std::max(inner, local_ball(shape, at));
  if (inner < enough && !joints.segments.empty()) {
    const BezierPatch& on = shape.patches[at.patch];
    s = std::max(s, joints.segments.distance(at.patch, evaluate0(on, at.u, at.v)));
    inner = std::max(inner, ball_clear_of(s));
  }
  RollingRadii radii{inner, patch.max_radius, shape.support_excess, near};
  if (joints.concave > 0) {
    const bool clear = s >= patch.max_radius * joints.concave;
    radii.outer = clear ? 2 * patch.max_radius : kInfinity;
    if (clear) radii.slack = shape.joint_slack;
  }
  return radii;
}

}  // namespace nurbs

// See locate_point.h.
#include "body/locate_point.h"

#include <algorithm>
#include <cmath>

#include "body/connectivity.h"
#include "body/support.h"

namespace nurbs {
namespace {

constexpr double kLocated = 1e-7;
constexpr double kNearEdge = 1e-4;  // of a patch's parameters
constexpr int kIterations = 8, kPatchesTried = 12;

double miss(const Shape& shape, const SurfacePoint& at, const Vec3& x) {
  return (evaluate0(shape.patches[at.patch], at.u, at.v) - x).norm();
}

// On a sharp edge that is near, if x lies on it.
bool on_sharp_edge(const Shape& shape, const SurfacePoint& at, double near, const Vec3& x, double allowed,
                   SurfacePoint* found) {
  const double end[4] = {at.u, 1 - at.u, at.v, 1 - at.v};
  for (int edge = 0; edge < 4; ++edge) {
    const EdgeLink& link = shape.links[at.patch][edge];
    if (end[edge] > near || link.collapsed || !link.opens()) continue;
    const double from = edge < 2 ? at.v : at.u;
    const Vec2 to = edge_parameters(edge, closest_on_edge(shape.patches[at.patch], edge, x, from));
    *found = {at.patch, to[0], to[1]};
    if (miss(shape, *found, x) <= allowed) return true;
  }
  return false;
}

// By Newton from `at`; false where it ends elsewhere.
bool go_to(const Shape& shape, SurfacePoint at, const Vec3& x, double allowed, SurfacePoint* found) {
  for (int k = 0; k < kIterations; ++k) {
    const Jet1 j = evaluate1(shape.patches[at.patch], at.u, at.v);
    const Vec3 r = x - j.s;
    const double e = j.su.squaredNorm(), f = j.su.dot(j.sv), g = j.sv.squaredNorm(), area2 = e * g - f * f;
    if (!(area2 > kSingularMetric * e * g)) break;
    const double ru = r.dot(j.su), rv = r.dot(j.sv);
    const double du = std::clamp((g * ru - f * rv) / area2, -1.0, 1.0),
                 dv = std::clamp((e * rv - f * ru) / area2, -1.0, 1.0);
    if (std::max(std::abs(du), std::abs(dv)) <= kOnEdge) break;
    const SurfacePoint next{at.patch, at.u + du, at.v + dv};
    at = next.on_patch() ? next : walk(shape, at, du, dv);
  }
  if (!(miss(shape, at, x) <= allowed)) return false;
  if (!on_sharp_edge(shape, at, kNearEdge, x, allowed, found)) *found = at;
  return true;
}

}  // namespace

SurfacePoint locate_point(const Shape& shape, const SurfacePoint& start, const Vec3& x) {
  const double allowed = kLocated * shape.bounding_radius;
  SurfacePoint found;
  if (on_sharp_edge(shape, start, kOnEdge, x, allowed, &found) || go_to(shape, start, x, allowed, &found))
    return found;
  int tried = 0;
  for (int p = 0; p < static_cast<int>(shape.patches.size()) && tried < kPatchesTried; ++p) {
    if (!((x - shape.balls[p].center).norm() <= shape.balls[p].radius + allowed)) continue;
    ++tried;
    if (go_to(shape, {p, 0.5, 0.5}, x, allowed, &found)) return found;
  }
  return start;
}

}  // namespace nurbs

// Words for Shape::proofs.
#include "body/proofs.h"

#include <algorithm>
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

// The part of a patch about one of its corners, or about a collapsed edge, which is one point: its points
// near there, counterclockwise seen from outside.
struct Sector {
  Vec3 tip;
  std::vector<Vec3> arc, normals;
  bool counted = false;
};

constexpr double kSectorReach = 1e-3;  // of the patch's parameters: the arc's distance from the tip
constexpr int kSectorPoints = 24;

// `at(t)`: the arc's parameters for t in [0, 1].
template <class Arc>
Sector make_sector(const BezierPatch& patch, const Vec2& tip, const Arc& at) {
  Sector sector;
  sector.tip = evaluate0(patch, tip[0], tip[1]);
  for (int k = 0; k <= kSectorPoints; ++k) {
    const Vec2 t = at(k / double(kSectorPoints));
    const Jet1 jet = evaluate1(patch, t[0], t[1]);
    sector.arc.push_back(jet.s);
    sector.normals.push_back(jet.su.cross(jet.sv).normalized());
  }
  return sector;
}

void add_sectors(const Shape& shape, int p, std::vector<Sector>* sectors) {
  const BezierPatch& patch = shape.patches[p];
  const auto& links = shape.links[p];
  constexpr double e = kSectorReach;
  for (int edge = 0; edge < 4; ++edge) {
    if (!links[edge].collapsed) continue;
    const double deep = edge % 2 ? 1 - e : e;
    const bool rising = edge == 0 || edge == 3;
    sectors->push_back(make_sector(patch, edge < 2 ? Vec2(edge % 2, 0) : Vec2(0, edge % 2), [&](double t) {
      const double along = rising ? t : 1 - t;
      return edge < 2 ? Vec2(deep, along) : Vec2(along, deep);
    }));
  }
  for (int corner = 0; corner < 4; ++corner) {  // (0, 0), (1, 0), (1, 1), (0, 1): a quarter turn each
    const Vec2 tip(corner == 1 || corner == 2, corner >= 2);
    if (links[tip[0] > 0 ? 1 : 0].collapsed || links[tip[1] > 0 ? 3 : 2].collapsed) continue;
    sectors->push_back(make_sector(patch, tip, [&](double t) {
      const double angle = 0.5 * M_PI * (corner + t);
      // The ends lie on the edges exactly.
      const Vec2 at = tip + e * Vec2(std::cos(angle), std::sin(angle));
      return Vec2(at.cwiseMax(0).cwiseMin(1));
    }));
  }
}

// Turns that a sector makes about an axis through its tip.
double turns(const Sector& sector, const Vec3& axis) {
  double sum = 0;
  for (size_t k = 1; k < sector.arc.size(); ++k) {
    const Vec3 a = axis.cross(sector.arc[k - 1] - sector.tip), b = axis.cross(sector.arc[k] - sector.tip);
    sum += std::atan2(axis.dot(a.cross(b)), a.dot(b));
  }
  return sum / (2 * M_PI);
}

bool winds_once_everywhere(const Shape& shape) {
  std::vector<Sector> sectors;
  for (size_t p = 0; p < shape.patches.size(); ++p) add_sectors(shape, static_cast<int>(p), &sectors);
  const double apart = 2 * kJoinTolerance * shape.bounding_radius;
  for (Sector& first : sectors) {
    if (first.counted) continue;
    std::vector<Sector*> around;
    Vec3 axis = Vec3::Zero();
    for (Sector& s : sectors) {
      if (s.counted || !((s.tip - first.tip).norm() <= apart)) continue;
      s.counted = true;
      around.push_back(&s);
      for (const Vec3& n : s.normals) axis += n;
    }
    double sum = 0;
    for (const Sector* s : around) sum += turns(*s, axis.normalized());
    if (!(std::abs(sum - 1) < 0.25)) return false;
  }
  return true;
}

// How fast the tensor of curvature radii changes with the direction of the normal.
std::string rate_line(const Proofs& p) {
  if (p.unrated_share == 0)
    return format("proven: they change by at most %.3g a radian (%.3g occurs)", p.rate, p.seen_rate);
  return format("proven: but for %.2g %% of the surface they change by at most %.3g a radian (%.3g occurs)",
                100 * p.unrated_share, p.rate, p.seen_rate);
}

}  // namespace

bool proven_without_dents(const Shape& shape) {
  const Proofs& p = shape.proofs;
  if (!p.convex || !(p.closing <= kNoKink)) return false;
  for (const auto& links : shape.links)
    for (const EdgeLink& link : links)
      if (link.projected) return false;
  return winds_once_everywhere(shape);
}

std::vector<std::string> describe_proofs(const Shape& shape) {
  const Proofs& p = shape.proofs;
  const CurvatureBounds& radii = shape.patch_curvature;
  std::vector<std::string> lines;
  if (p.sphere) {
    lines.push_back(format("proven: a sphere to %.0e of its radius", kSphere));
  } else if (shape.ellipsoid.found) {
    const Vec3& semi = shape.ellipsoid.semi;
    lines.push_back(format("proven: an ellipsoid to %.0e of itself, semi-axes %.6g %.6g %.6g",
                           shape.ellipsoid.error, semi[0], semi[1], semi[2]));
  } else if (p.convex) {
    lines.push_back(format("proven: no negative curvature inside the patches, %.3g %% flat or ruled",
                           100 * p.flat_share));
  } else {
    lines.push_back(format("not proven: curvature of %.3g %% of the surface (dents, inflections, tips)",
                           100 * p.unproven_share));
  }
  if (!(p.seen_max > 0) && !p.sphere) {
    lines.push_back(format(p.convex ? "proven: curvature radii from %.4g: all faces are flat, %d cells"
                                    : "proven: curvature radii from %.4g, %d cells",
                           radii.min_radius, p.cells));
  } else {
    lines.push_back(format("proven: curvature radii from %.4g to %.4g (%.4g to %.4g occur), %d cells",
                           radii.min_radius, radii.max_radius, p.sphere ? radii.min_radius : p.seen_min,
                           p.sphere ? radii.max_radius : p.seen_max, p.cells));
    lines.push_back(rate_line(p));
  }
  lines.push_back(format("proven: joints gape by at most %.2g, open by %.3g and close by %.3g degrees",
                         p.joint_gap, p.opening * 180 / M_PI, p.closing * 180 / M_PI));
  const bool none = proven_without_dents(shape);
  if (none) lines.emplace_back("proven: no dents");
  if (!none && shape.concavity == 0)
    lines.emplace_back("not proven: that there are no dents; none was found");
  if (!none && shape.concavity > 0)
    lines.push_back(format("measured, not proven: dents %.3g deep", shape.concavity));
  if (shape.core.points.size() > 1)
    lines.push_back(
        format("from positions: a polyhedron of %zu points with a ball of radius %.6g about each, "
               "to %.1g",
               shape.core.points.size(), shape.core.radius, shape.core.error));
  return lines;
}

}  // namespace nurbs

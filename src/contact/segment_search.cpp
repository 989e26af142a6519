// Nearest points of two segments (Ericson 2005, section 5.1.9); see segment_search.h.
#include "contact/segment_search.h"

#include <algorithm>
#include <cmath>

namespace nurbs {
namespace {

constexpr double kParallel = 1e-20;  // squared sine, below which segments are

// A point, if `half` is 0.
struct Segment {
  Vec3 middle, half;
  Vec3 at(double t) const { return middle + t * half; }
  // Parameter of its point nearest to x.
  double nearest(const Vec3& x) const {
    const double length2 = half.squaredNorm();
    return length2 > 0 ? std::clamp(half.dot(x - middle) / length2, -1.0, 1.0) : 0.0;
  }
};

Segment segment_of(const SpheroPolyhedron& core, double scale, const Mat3& turn, const Vec3& offset) {
  const Vec3 p = offset + scale * (turn * core.points.front()),
             q = offset + scale * (turn * core.points.back());
  return {0.5 * (p + q), 0.5 * (p - q)};
}

}  // namespace

bool search_segments(const PairFrame& pair, double tolerance, PolytopeResult* result) {
  if (!PairFrame::is_swept(*pair.a, pair.scale_a, tolerance) ||
      !PairFrame::is_swept(*pair.b, pair.scale_b, tolerance))
    return false;
  const SpheroPolyhedron &core_a = pair.a->core, &core_b = pair.b->core;
  if (core_a.points.size() > 2 || core_b.points.size() > 2) return false;
  const Segment a = segment_of(core_a, pair.scale_a, Mat3::Identity(), Vec3::Zero()),
                b = segment_of(core_b, pair.scale_b, pair.turn, pair.offset);
  const double radius_a = pair.scale_a * core_a.radius, radius_b = pair.scale_b * core_b.radius,
               error = pair.scale_a * core_a.error + pair.scale_b * core_b.error + 4 * kRoundoff * pair.reach;
  const double aa = a.half.squaredNorm(), bb = b.half.squaredNorm(), ab = a.half.dot(b.half),
               det = aa * bb - ab * ab;
  const Vec3 across = a.half.cross(b.half), apart = b.middle - a.middle;
  double t = det > kParallel * aa * bb ? (apart.dot(a.half) * bb - apart.dot(b.half) * ab) / det : 0.0;
  t = std::clamp(t, -1.0, 1.0);
  const double s = b.nearest(a.at(t));
  t = a.nearest(b.at(s));
  const Vec3 x = a.at(t), y = b.at(s), between = y - x;
  const auto overlap = [&](const Vec3& d) {
    return std::abs(d.dot(a.half)) + std::abs(d.dot(b.half)) - d.dot(apart) + radius_a + radius_b + error;
  };
  double least = kFarAway;
  Vec3 normal = Vec3::UnitX();
  const auto consider = [&](const Vec3& along) {
    const double length = along.norm();
    if (!(length > 0)) return;
    const Vec3 d = along / length;
    if (const double p = overlap(d); p < least) least = p, normal = d;
  };
  consider(between);
  consider(across.dot(apart) < 0 ? Vec3(-across) : across);
  for (const Vec3& half : {a.half, b.half})  // on one line
    if (half.squaredNorm() > 0) consider(half.unitOrthogonal());
  const double upper = between.norm() - radius_a - radius_b + error;
  if (!(upper + least <= tolerance)) return false;
  PolytopeResult& r = *result;
  r.bracket.direction = normal;
  r.bracket.lower = -least;
  r.bracket.upper = std::max(upper, -least);
  r.converged = true;
  r.iterations = 1;
  r.gap = std::clamp(between.norm() - radius_a - radius_b, r.bracket.lower, r.bracket.upper);
  r.points.na = normal;
  r.points.nb = -normal;
  r.points.a = x + radius_a * normal;
  r.points.b = y - radius_b * normal;
  part_points(&r);
  r.points.on_a = find_hull_support(*pair.a, normal).where;
  r.points.on_b = find_hull_support(*pair.b, pair.direction_on_b(normal)).where;
  return true;
}

}  // namespace nurbs

// Nearest points of two segments (Ericson 2005, section 5.1.9), least overlap of a segment and an ellipsoid;
// see segment_search.h.
#include "contact/overlap/segment_search.h"

#include <algorithm>
#include <cmath>

#include "contact/overlap/ellipsoid_overlap.h"

namespace nurbs {
namespace {

constexpr double kParallel = 1e-20;   // squared sine, below which segments are
constexpr double kLevelShare = 0.25;  // of the tolerance: a segment's points as near as that are level

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
  if (!pair.both_swept(tolerance)) return false;
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
  set_points(pair, x + radius_a * normal, y - radius_b * normal, &r);
  return true;
}

bool search_segment_in_ellipsoid(const PairFrame& pair, const Vec3& seed, double tolerance,
                                 PolytopeResult* result) {
  // The ellipsoid stays where it is; everything is symmetric about the middles.
  const bool first = pair.a->ellipsoid.found;
  const Shape &round = first ? *pair.a : *pair.b, &swept = first ? *pair.b : *pair.a;
  const double scale = first ? pair.scale_a : pair.scale_b, scale_swept = first ? pair.scale_b : pair.scale_a;
  const double error = scale * round.ellipsoid.error * round.bounding_radius;
  if (!(round.ellipsoid.found && error <= kCoreError * tolerance) || swept.core.points.size() > 2 ||
      !PairFrame::is_swept(swept, scale_swept, tolerance))
    return false;
  const Mat3 turn = first ? Mat3::Identity() : pair.turn;
  const Vec3 center = first ? Vec3(Vec3::Zero()) : pair.offset;
  const Segment segment = first ? segment_of(swept.core, scale_swept, pair.turn, pair.offset)
                                : segment_of(swept.core, scale_swept, Mat3::Identity(), Vec3::Zero());
  const SweptEllipsoid a = SweptEllipsoid::of(round.ellipsoid, scale, turn),
                       b = SweptEllipsoid::along(segment.half, scale_swept * swept.core.radius);
  const Vec3 start =
      seed.squaredNorm() > 0 ? Vec3((first ? 1 : -1) * seed.normalized()) : Vec3(Vec3::UnitX());
  LeastOverlap least;
  if (!find_least_overlap(a, b, segment.middle - center, start, 0.5 * tolerance, &least)) return false;
  const Vec3& d = least.direction;  // from the ellipsoid
  const Vec3 on_round = center + a.point(d);
  // The end nearer to the ellipsoid, or any point that is as near to little of the tolerance.
  double t = segment.nearest(on_round);
  const double towards = d.dot(segment.half);
  if (std::abs(towards) + t * towards > kLevelShare * tolerance) t = towards > 0 ? -1 : 1;
  const Vec3 on_swept = segment.at(t) - b.ball * d;
  const double noise = error + scale_swept * swept.core.error + 4 * kRoundoff * pair.reach;
  PolytopeResult& r = *result;
  r.bracket.direction = first ? d : Vec3(-d);
  r.bracket.lower = -least.overlap - noise;
  r.bracket.upper = -least.level + noise;
  r.converged = r.closed = r.bracket.width() <= tolerance;
  r.iterations = least.tests;
  r.gap = -least.overlap;
  set_points(pair, first ? on_round : on_swept, first ? on_swept : on_round, &r);
  return r.converged;
}

}  // namespace nurbs

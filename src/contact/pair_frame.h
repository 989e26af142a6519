// Two placed bodies seen from body A: lengths of the lab, axes of A's shape, origin at A's centre of mass.
// Solving there keeps the digits of a pair far from the lab's origin, and gives every rank the same bits.
#pragma once

#include <algorithm>

#include "body/support.h"
#include "contact/contact.h"
#include "nurbs/tolerances.h"

namespace nurbs {

struct PairFrame {
  const Shape* a;
  const Shape* b;
  double scale_a, scale_b;
  Mat3 axes_a;      // A's shape axes into the lab
  Mat3 turn;        // B's shape axes into A's
  Vec3 offset;      // B's centre of mass
  double size;      // smaller bounding radius of the two, the scale of `tolerance`
  double reach;     // larger of them, the scale of round-off
  double roundoff;  // of a length
  double rise;      // what the balls that touch the bodies may be above them (small_kinks.h)
  double noise;     // both

  PairFrame(const Particle& pa, const Particle& pb)
      : a(pa.shape), b(pb.shape), scale_a(pa.scale), scale_b(pb.scale), axes_a(pa.q.toRotationMatrix()) {
    turn.noalias() = axes_a.transpose() * pb.q.toRotationMatrix();
    offset.noalias() = axes_a.transpose() * (pb.x - pa.x);
    const double ra = scale_a * a->bounding_radius, rb = scale_b * b->bounding_radius;
    size = ra < rb ? ra : rb;
    reach = ra < rb ? rb : ra;
    roundoff = kRoundoff * reach;
    rise = scale_a * a->small_kinks.slack + scale_b * b->small_kinks.slack;
    noise = roundoff + rise;
  }

  // Whether points and a ball stand for a body of the pair, to little more than round-off of the tolerance.
  static bool is_swept(const Shape& shape, double scale, double tolerance) {
    return shape.core.found() && scale * shape.core.error <= kCoreError * tolerance;
  }
  // For both: then they are points all but balls.
  bool both_swept(double tolerance) const {
    return is_swept(*a, scale_a, tolerance) && is_swept(*b, scale_b, tolerance);
  }
  // Radius of a ball that rolls inside. None that does is larger than the largest inside (a sphere's radii
  // are bounds of it).
  static double rolling_ball(const Shape& shape, double scale, double tolerance) {
    const double least = std::min(shape.curvature.min_radius, shape.inner_radius);
    return scale * (is_swept(shape, scale, tolerance) ? std::max(least, shape.core.radius) : least);
  }
  // The same, but for a rise above the body (small_kinks.h). With a much smaller mate it is that one's size
  // that counts.
  struct RollingBall {
    double radius, rise;
  };
  RollingBall ball_for_mate(const Shape& shape, double scale, double tolerance) const {
    const double most = rolling_ball(shape, scale, tolerance), met = shape.small_kinks.met,
                 slack = scale * shape.small_kinks.slack, enough = kMateSizes * size,
                 rise = 2 * enough * met * met;
    return rise < slack ? RollingBall{std::min(0.5 * most, enough), rise} : RollingBall{most, slack};
  }
  // Largest ball worth considering of those that touch a body, whose overlap with the other is `depth`. A
  // flat part has none; one as large as the other body's reach does.
  double largest_ball(const Shape& shape, double depth) const {
    const double enough = kMateSizes * size;
    return shape.small_kinks.slack > 0 && 2 * depth < enough ? std::min(reach, enough) : reach;
  }
  // By how much the gap may exceed that of balls of these radii that touch both bodies, their centres
  // `distance` apart, besides round-off: of p >= rho - distance cos t - (rho_a beta_a + rho_b beta_b) sin t
  // the least.
  double rise_between(double rho_a, double rho_b, double distance) const {
    if (!(rise > 0)) return 0;
    const double met = rho_a * a->small_kinks.met + rho_b * b->small_kinks.met;
    return std::min(rise, 0.5 * met * met / distance);
  }

  // Sides of joints that do not meet, of both (Shape::joint_slack).
  double joint_slack() const { return scale_a * a->joint_slack + scale_b * b->joint_slack; }
  // Of the balls about the centres inside, both.
  double inner_radii() const { return scale_a * a->inner_radius + scale_b * b->inner_radius; }

  Vec3 place_a(const Vec3& s) const { return scale_a * s; }
  Vec3 place_b(const Vec3& s) const { return offset + scale_b * (turn * s); }
  Vec3 direction_on_b(const Vec3& d) const {
    return turn.transpose() * -d;
  }  // the direction B's support is asked for

  // p(d) of support functions' values, shape lengths.
  double overlap_along(const Vec3& d, double h_a, double h_b) const {
    return scale_a * h_a + scale_b * h_b - d.dot(offset);
  }
};

// Both hulls' supports along unit d, right to kSupportShare of `tolerance` (a length). `on_a`, `on_b`: where
// the searches begin, or null.
struct SupportPair {
  Support a, b;
};
inline SupportPair hull_supports(const PairFrame& pair, const Vec3& d, const SurfacePoint* on_a,
                                 const SurfacePoint* on_b, double tolerance) {
  const double enough = kSupportShare * tolerance;
  return {find_hull_support(*pair.a, d, on_a, enough / pair.scale_a),
          find_hull_support(*pair.b, pair.direction_on_b(d), on_b, enough / pair.scale_b)};
}

// A pair of surface points with their outward unit normals, in the pair frame.
struct PointPair {
  SurfacePoint on_a, on_b;
  Vec3 a, b;    // positions
  Vec3 na, nb;  // outward unit normals; na is about -nb at a contact
};

}  // namespace nurbs

// A body against the sharp features of a wall: a line (the edge of a mesh, the axis of a cylinder) and a
// point (a vertex). As for a plane, the gap is the largest over the directions that the feature allows,
//
//     gap = max over unit d of f(d),    f(d) = min over b in B of d . (b - a) - radius,    a on the feature,
//
// with d square to a line, free at a point. d points from the wall to the body. f is concave near its maximum
// as long as the body's curvature radii there exceed the overlap; a direction with f > 0 proves the body
// clear of the whole feature and ends the search.
#pragma once

#include <cmath>

#include "contact/contact.h"

namespace nurbs {

struct FeatureContact {
  bool touching = false;                 // else nothing below means anything, but for points
  double gap = 0;                        // < 0
  Vec3 normal = Vec3::Zero();            // unit d, lab
  Vec3 on_body = Vec3::Zero();           // the body's deepest point, relative to its centre of mass, lab axes
  double along = 0;                      // place of it on the line, from `a`
  double along_low = 0, along_high = 0;  // of all points as deep (find_highest_line_contact)
  SurfacePoint where;                    // the body's surface point, to start from next time
};

// The directions square to a line from `low` on towards `side`, both unit, square to each other and to the
// line: d = cos(angle) low + sin(angle) side, 0 <= angle <= span <= pi.
struct Arc {
  Vec3 low, side;
  double span = 0;
  Vec3 end(int which) const { return which == 0 ? low : Vec3(std::cos(span) * low + std::sin(span) * side); }
};
// From one direction to another, not opposite ones.
Arc arc_between(const Vec3& low, const Vec3& high);

// A line through `a` with unit `direction`. `low` and `high` are unit, square to the line and less than half
// a turn apart, f rising from `low` towards `high` and falling from `high` towards `low` again: the maximum
// lies between them. Equal ones are the answer themselves. Bisection where f has a kink, secant where it is
// smooth: 3 to 8 support searches, fewer when the body is clear. The normal is right to 1e-11 rad.
FeatureContact find_line_contact(const Particle& particle, const Vec3& a, const Vec3& direction,
                                 const Vec3& low, const Vec3& high, double radius, const SurfacePoint* start);

// The highest maximum of f over the arc, whatever others there are: a body sharper than its overlap is deep
// has several. Every support bounds f above by a sinusoid, two of them on the interval between; the highest
// interval is cut where its two meet. `angle` receives the direction's, 0 or the span where f is highest at
// an end. Maxima that differ by less than 1e-9 of the overlap are taken for one.
FeatureContact find_highest_line_contact(const Particle& particle, const Vec3& a, const Vec3& direction,
                                         const Arc& arc, const SurfacePoint* start, double* angle);

// The shortest way out of the body for a point `a`, in any direction; `guess` is one near it. Newton by the
// body's curvature, 2 to 4 support searches; where that fails (kinks, flats) or another way may be shorter
// (deeper than the least curvature radius), by the contact of the body with a ball about the point, less the
// ball's radius.
FeatureContact find_point_contact(const Particle& particle, const Vec3& a, const Vec3& guess,
                                  const ContactSettings& settings, const SurfacePoint* start);

// The former alone: false where it fails or another way may be shorter. Not touching, `normal` is a direction
// with f >= 0.
bool find_only_way_out(const Particle& particle, const Vec3& a, const Vec3& guess, const SurfacePoint* start,
                       FeatureContact* out);

// The highest of f over the directions d with edge . d <= 0 for all `edges` of a vertex `a`, whatever other
// maxima there are; of those not above `level` (< 0) any. Branch and bound over spherical triangles, some 60
// support searches. The gap is right to 1e-9 of itself; on_body is the point over `a`, which the body has
// there if f is highest inside the cone. Not touching, `normal` is a direction of the cone with f >= 0; where
// the cone has none, the gap is -kFarAway.
FeatureContact find_highest_point_contact(const Particle& particle, const Vec3& a, const Vec3* edges,
                                          int count, double level, const SurfacePoint* start);

// Whether a direction parts the body from the convex hull of `count` points. Gilbert, Johnson & Keerthi 1988;
// not said of bodies that all but touch it.
bool is_clear_of(const Particle& particle, const Vec3* points, int count);

// Whether the body has a point where it touches its supporting plane with inward normal d: whether the
// contact of a vertex below, found as highest of some directions only, is the highest of those beside them
// too. To 1e-4 of its size; some support searches, one for round bodies. `at` is the body's support there.
bool has_point(const Particle& particle, const Vec3& point, const Vec3& d, const SurfacePoint& at);

// f(d) along a unit direction, with the body's support point.
struct FeatureGap {
  double gap;
  Vec3 on_body;
  SurfacePoint where;
};
FeatureGap gap_along(const Particle& particle, const Vec3& a, const Vec3& d, const SurfacePoint* start);
// The contact that it is, were f highest there.
FeatureContact feature_contact(const FeatureGap& at, const Vec3& d);

}  // namespace nurbs

// The polytope method: the fallback that needs nothing but support mappings, so it works on flats, creases,
// corners and vanishing curvature, and brackets the global minimum of p(d) whatever the overlap.
#pragma once

#include <optional>

#include "contact/certificate.h"
#include "contact/pair_frame.h"

namespace nurbs {

struct PolytopeResult {
  PointPair points;     // witness points; normals are set to the search direction
  Bracket bracket;      // certified, of the gap, over ALL directions
  double gap;           // direction . (b - a), inside the bracket
  int iterations;       // support pairs evaluated
  bool converged;       // bracket no wider than the tolerance
  bool closed = false;  // in closed form: points and direction want no polish
  bool inside = false;  // the points are means of others far inside the bodies, moved out to their planes
};

// Moves the points along the normal, half each, until they are the gap apart.
inline void part_points(PolytopeResult* r) {
  const Vec3& d = r->points.na;
  const Vec3 shift = 0.5 * (r->gap - d.dot(r->points.b - r->points.a)) * d;
  r->points.a -= shift;
  r->points.b += shift;
}

// Contact points along the bracket's direction that a closed form has found, the gap apart, and where the
// surfaces' searches begin the next time.
inline void set_points(const PairFrame& pair, const Vec3& a, const Vec3& b, PolytopeResult* r) {
  r->points.na = r->bracket.direction;
  r->points.nb = -r->points.na;
  r->points.a = a;
  r->points.b = b;
  part_points(r);
  r->points.on_a = find_feature_support(*pair.a, r->points.na).where;
  r->points.on_b = find_feature_support(*pair.b, pair.direction_on_b(r->points.na)).where;
}

// What the search among balls (near_ball_search.h) found of one pair, once it was made: the same whatever a
// polytope begins from.
using SearchedBalls = std::optional<PolytopeResult>;

// Grows a polytope inside the configuration space obstacle A - B (shrunk by a share of the bodies' least
// curvature radii, which are added back) from exact support points. While the origin is outside, the next
// direction is that of the polytope's nearest point, as in GJK, and |nearest point| bounds the gap above;
// once inside, the normal of the nearest face, as in EPA, and its distance bounds the overlap below. Every
// support gives the opposite bound p(d). Source: Gilbert, Johnson & Keerthi 1988; van den Bergen 2003, ch. 4,
// here on one growing hull for both phases, on exact surfaces and with rigorous bounds. `seed`: a direction
// worth trying first, or zero. Minima that want many points are surrounded by caps, which are proven by
// second order, or by a hull of their own: within an angle of a minimum the inner maps know larger balls than
// roll all through the bodies, and p(d) - r is the overlap of what is left without those, which bends less.
// Stops within `tolerance` (a length), when the gap is proven larger than `enough`, or at its caps. Works in
// fixed-size storage. `balls`: of the same pair and tolerance, kept from one call to the next.
PolytopeResult solve_polytope(const PairFrame& pair, const Vec3& seed, double tolerance, double enough,
                              SearchedBalls* balls);
inline PolytopeResult solve_polytope(const PairFrame& pair, const Vec3& seed, double tolerance,
                                     double enough) {
  SearchedBalls balls;
  return solve_polytope(pair, seed, tolerance, enough, &balls);
}

// Points of a bracket that were left so, from a hull that is made for them.
void find_points_again(const PairFrame& pair, double tolerance, PolytopeResult* r);

}  // namespace nurbs

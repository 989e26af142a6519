// Where a body's support set is more than a point: its flat faces, its straight creases, and the patches
// swept by straight lines of constant normal. Found once at load; empty, and free of cost, for round bodies.
#pragma once

#include <vector>

#include "body/convex_polygon.h"
#include "body/direction_atlas.h"
#include "nurbs/types.h"

namespace nurbs {

struct Shape;

// How far a face may be from its plane and a line from straight, in bounding radii: room for the decimals of
// a shape file. A contact's gap on such a face errs by as much.
constexpr double kFlatness = 1e-9;

// All in the shape's frame at scale 1. A face spans patches whose joints are smooth.
struct FlatFace {
  Vec3 normal = Vec3::Zero();    // outward, unit
  Vec3 axis_u = Vec3::Zero();    // unit, in the face; the second one is normal x axis_u
  double offset = 0;             // normal . x of its plane, > 0
  double slack = 0;              // by which the body, and the face's own patches, may be beside that plane
  int patch = 0;                 // one of its own
  double area = 0;               // of the true outline, as is
  Vec3 centroid = Vec3::Zero();  // ... its centroid
  bool round = false;            // `outline` is inscribed in the true outline, not equal to it
  std::vector<int> outline;      // vertices, counterclockwise from outside, at most kOutlinePoints
  std::vector<int> corners;      // at most kContactPoints of them, ascending in `outline`
  SideLines sides;               // of `outline`, in project()'s coordinates
  double radius = 0;             // of the circle about the centroid that holds it
  std::vector<double> weight;    // of the outline's vertices under a uniform load, sum 1: corner_weights

  Vec3 axis_v() const { return normal.cross(axis_u); }
  Vec2 project(const Vec3& x) const { return {axis_u.dot(x), axis_v().dot(x)}; }
};
template <class Archive>
void archive(Archive& a, FlatFace& s) {
  auto& [normal, axis_u, offset, slack, patch, area, centroid, round, outline, corners, sides, radius,
         weight] = s;
  a(normal, axis_u, offset, slack, patch, area, centroid, round, outline, corners, sides, radius, weight);
}

struct StraightEdge {             // a convex crease; collinear pieces are one
  int ends[2] = {0, 0};           // vertices
  Vec3 direction = Vec3::Zero();  // unit, from the first to the second
  double slack = 0;               // by which the surface may be beside it
};
template <class Archive>
void archive(Archive& a, StraightEdge& s) {
  auto& [ends, direction, slack] = s;
  a(ends, direction, slack);
}

// Straight parameter lines along which the normal is constant: cylinders, cones, rounded edges.
enum class Ruling : signed char { none, along_u, along_v };

struct FlatFeatures {
  std::vector<Vec3> vertices;  // ends of edges, corners of outlines; each place once
  std::vector<FlatFace> faces;
  std::vector<StraightEdge> edges;
  std::vector<Ruling> ruling;  // per patch; empty when there is none
  bool empty() const { return faces.empty() && edges.empty() && ruling.empty(); }
};
template <class Archive>
void archive(Archive& a, FlatFeatures& s) {
  auto& [vertices, faces, edges, ruling] = s;
  a(vertices, faces, edges, ruling);
}

// A face's patches have all control points within kFlatness of one plane, are joined through links, and lie
// on the body's convex hull. An outline of at most kOutlinePoints straight sides has exact corners; any other
// is given by the points of the true boundary furthest along kOutlinePoints equally spaced directions, so
// that a disc gets regular polygons on its rim (the first of them where a patch begins). Needs patches,
// links, bounds and atlas. Rulings are tested on a 9 x 9 grid per patch. Some ms, less without flat features.
FlatFeatures find_flat_features(const Shape& shape);

// The face whose normal is nearest to unit d, if the angle's cosine is above `cosine`; -1 without one.
// O(faces).
int nearest_face(const FlatFeatures& features, const Vec3& d, double cosine);

// The straight line of constant normal through a surface point, across patches as long as it goes straight
// on; or through one beside it: patches that the point lies on the joint with are tried, too, and those whose
// lines end at a joint with its own, wherever on that it is, as next to a rounded rim a small turn leads to
// them. Of several the one whose lower end is highest along d; of those that meet at a cone's tip the one
// whose other end is. False where there is none, or none whose normal is within `angle` (rad) of d.
struct RuledLine {
  Vec3 ends[2];
};
bool ruled_line(const Shape& shape, const SurfacePoint& at, const Vec3& d, double angle, RuledLine* line);

// A bound on the turn, rad, at most pi / 4, before d is square to one of these lines: only then can it hold
// the support point along d, which is at `where` now.
double turn_to_ruled_line(const Shape& shape, const SurfacePoint& where, const Vec3& d);

// The support set of a body in unit direction d (shape frame, scale 1) widened by `tolerance` (length): the
// face, else the crease, else the ruled line all of whose points have d . x >= h(d) - tolerance, and one of
// them nearly h(d); else the support point. A feature is taken whole or not at all: its points then belong to
// the body and not to d.
// One support search (0.3 to 2 us) and a loop over faces and creases.
struct SupportSet {
  int count = 0;  // 1: a point, 2: a segment, 3 or more: a polygon, counterclockwise from outside
  Vec3 point[kContactPoints];   // shape frame
  int vertex[kContactPoints];   // index in FlatFeatures::vertices, -1 where it has none
  int face = -1;                // the face, if it is one
  bool ruled = false;           // a segment that stays on the body only as long as d does
  double h = 0;                 // support function, at the ...
  Vec3 support = Vec3::Zero();  // ... support point, and ...
  SurfacePoint where;           // ... where it lies
};
SupportSet support_set(const Shape& shape, const Vec3& d, double tolerance);

// The least tolerance with which support_set() is more than a point; infinite without flat features near. No
// search: h is the support function along d, `where` the support point.
double feature_lag(const Shape& shape, const Vec3& d, double h, const SurfacePoint& where);

}  // namespace nurbs

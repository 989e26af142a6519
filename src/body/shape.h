// A shape: a closed convex body bounded by NURBS patches, with all that is derived from it once at load
// (Bezier patches, connectivity, mass properties, bounds, direction atlas). Immutable after make_shape; every
// particle of that shape shares it.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "body/direction_atlas.h"
#include "body/edge_curves.h"
#include "body/ellipsoid.h"
#include "body/flat_faces.h"
#include "body/inner_map.h"
#include "body/meridian.h"
#include "body/near_ball.h"
#include "body/near_revolution.h"
#include "body/normal_map.h"
#include "body/profile_radii.h"
#include "body/revolution.h"
#include "body/rolling.h"
#include "body/round_edges.h"
#include "body/small_kinks.h"
#include "body/sphero_polyhedron.h"
#include "body/support_cells.h"
#include "nurbs/bezier_patch.h"
#include "nurbs/nurbs_surface.h"
#include "nurbs/tolerances.h"
#include "nurbs/types.h"

namespace nurbs {

// Edges of a patch: 0 is u = 0, 1 is u = 1, 2 is v = 0, 3 is v = 1. The free parameter runs with v on edges 0
// and 1, with u on edges 2 and 3.
struct EdgeLink {
  int patch =
      -1;  // the Bezier patch on the other side (may be the same patch: a seam), or -1 on a collapsed edge
  int edge = -1;           // its edge
  bool reversed = false;   // the free parameter runs the other way there
  bool collapsed = false;  // the edge is a single point (a pole)
  bool projected = false;  // the other side's parameter has no closed form: the closest point's is taken
  double ratio = 1;        // otherwise it is r t / (1 + (r - 1) t), t counted as `reversed` says
  double gap = 0;          // bound of the distance of the two sides at these parameters, length
  double kink = 0;  // largest angle between the two normals along the edge, rad; > 0 opens (convex), < 0 is
                    // concave; on a collapsed edge: between the normals around the pole (0 where smooth)
  double kink_bound = 0;  // no angle between two normals there is larger than this, rad: proven

  bool opens() const { return kink > kSmoothKink; }  // to a sharp edge; at a pole: to a tip
  double widest() const { return std::max(std::abs(kink), kink_bound); }  // angle seen or allowed
  bool kinked() const { return widest() > kNoKink; }
};
template <class Archive>
void archive(Archive& a, EdgeLink& s) {
  auto& [patch, edge, reversed, collapsed, projected, ratio, gap, kink, kink_bound] = s;
  a(patch, edge, reversed, collapsed, projected, ratio, gap, kink, kink_bound);
}

struct MassProperties {  // of the uniform solid of unit density, at scale 1
  double volume = 0;
  Vec3 center = Vec3::Zero();   // centre of mass in the frame of the shape file
  Mat3 inertia = Mat3::Zero();  // about the centre of mass, axes of the shape file
};
template <class Archive>
void archive(Archive& a, MassProperties& s) {
  auto& [volume, center, inertia] = s;
  a(volume, center, inertia);
}

// Radii of curvature over the whole surface: every normal curvature lies in [1/max_radius, 1/min_radius].
// min_radius is 0 for a body with a convex crease or corner; max_radius is infinite for one with a flat part.
// Proven, see surface_bounds.h.
struct CurvatureBounds {
  double min_radius = 0;
  double max_radius = 0;
};
template <class Archive>
void archive(Archive& a, CurvatureBounds& s) {
  auto& [min_radius, max_radius] = s;
  a(min_radius, max_radius);
}

// How fast a patch's curvature changes, over a grid of kRateCells^2 rectangles of its parameters. Proven; see
// surface_bounds.h.
struct PatchRate {
  struct Cell {
    float rate = std::numeric_limits<float>::infinity();  // |dW/dn| is at most this here and in the cells
                                                          // around, W the map from turns of the normal to
                                                          // displacements; a length
    float speed_u = 0, speed_v = 0;  // a path there that changes u by du is at least speed_u |du| long
    float least = 0;                 // no curvature radius there is smaller
  };
  std::vector<Cell> cells;  // v fastest
};
template <class Archive>
void archive(Archive& a, PatchRate::Cell& s) {
  auto& [rate, speed_u, speed_v, least] = s;
  a(rate, speed_u, speed_v, least);
}
template <class Archive>
void archive(Archive& a, PatchRate& s) {
  auto& [cells] = s;
  a(cells);
}

// At a surface point: the rate, and the least curvature radius, hold as long as the point moves by less than
// `room`, a length. Infinite and 0 where nothing is proven: at poles, flats, inflections.
struct LocalRate {
  double rate, room, least;
};
// `alike`: the parameter along which the body is the same all round, beyond the patch too.
enum class Alike { none, along_u, along_v };
LocalRate rate_near(const PatchRate& patch, const SurfacePoint& at, Alike alike = Alike::none);

// What is proven of a body, and how tightly: for reports (nurbs-shape check).
struct Proofs {
  bool convex = false;        // no negative curvature inside the patches
  double flat_share = 0;      // of the patches' parameters: no curvature one way, to round-off
  double unproven_share = 0;  // ... curvature neither proven positive nor flat: dents, inflections, tips
  double seen_min = 0, seen_max = 0;  // curvature radii that occur, beside patch_curvature's bounds
  double rate = 0, seen_rate = 0;     // largest finite LocalRate::rate, and one that occurs
  double unrated_share = 0;           // of the patches' parameters: curved, without such a bound
  int cells = 0;                      // enclosed
  double joint_gap = 0;               // no two sides of a joint are further apart, length
  double opening = 0, closing = 0;    // no two normals at a joint make a larger angle, rad
  bool sphere = false;                // within kSphere of one
};
template <class Archive>
void archive(Archive& a, Proofs& s) {
  auto& [convex, flat_share, unproven_share, seen_min, seen_max, rate, seen_rate, unrated_share, cells,
         joint_gap, opening, closing, sphere] = s;
  a(convex, flat_share, unproven_share, seen_min, seen_max, rate, seen_rate, unrated_share, cells, joint_gap,
    opening, closing, sphere);
}

// Ball that holds a patch's control points, and so the patch.
struct PatchBall {
  Vec3 center;
  double radius;
};
template <class Archive>
void archive(Archive& a, PatchBall& s) {
  auto& [center, radius] = s;
  a(center, radius);
}

struct Shape {
  std::string name;
  std::uint64_t stamp = 0;  // of the surfaces' contents: the same on every rank and across restarts
  std::vector<NurbsSurface> surfaces;  // as read, turned outward (Su x Sv points out), frame of the file
  std::vector<BezierPatch> patches;    // exact Bezier split, moved so that the centre of mass is the origin
  std::vector<int> surface_of_patch;   // index into surfaces
  std::vector<std::array<EdgeLink, 4>> links;  // per Bezier patch
  std::vector<PatchBall> balls;                // per Bezier patch
  bool bilinear = false;                       // every patch is
  MassProperties mass;
  Mat3 gyration = Mat3::Zero();  // inertia / mass about the centre of mass, as used in motion
  Mat3 inverse_gyration = Mat3::Zero();
  bool sphere_like = false;                // the principal moments are equal to round-off
  Vec3 principal_gyration = Vec3::Zero();  // its eigenvalues, ascending
  Quat principal_axes = Quat::Identity();  // turns principal axes into shape axes
  double bounding_radius = 0;              // of the sphere about the centre of mass; never below the true one
  double inner_radius = 0;                 // of the largest sphere about the centre of mass inside the body;
                                           // never above the true one
  double concavity = 0;                    // depth of the deepest dent bridged by the convex hull, length
  double support_excess = 0;               // what a local maximum of d . x over the surface may lack of the
                                           // support function h(d): 0 if convex, see convexity.h
  double joint_slack = 0;                  // what gaps at joints add to that and to its certificates; 0 where
                                           // the sides meet to round-off
  double pole_spread = 0;                  // the most that points of a collapsed edge are apart; 0 where that
                                           // is round-off. Tangents there tell nothing of the body's normals.
  SmallKinks small_kinks;                  // at joints that count as smooth
  bool smooth = true;                      // no kink above kSmoothKink: normals are continuous
  CurvatureBounds curvature;               // of the body; any kink above 1e-7 rad makes it (0, infinity)
  CurvatureBounds patch_curvature;  // of the patches, and what small_kinks take; kinked joints left out
  std::vector<PatchRate> rates;     // per patch
  Proofs proofs;                    // how far the bounds above are proven, and how tight
  JointDistance joints;             // to kinked joints: where the patch curvatures hold for the body
  NormalMap normal_map;             // local bounds, for bodies with flats or dents
  DirectionAtlas atlas;
  LazyInnerMap lazy_inner_map;
  Lazy<NearBall> lazy_near_ball;        // balls inside piece by piece, if the body is nearly one
  SupportCells support_cells;           // where the hull's supports lie, near dents
  Ellipsoid ellipsoid;                  // that the body is, if it is one
  Revolution revolution;                // about an axis, if the body is one
  Meridian meridian;                    // whose profile this is; empty for other bodies
  NearRevolution near_revolution;       // what few digits keep the body from being
  ProfileRadii profile_radii;           // of that
  SpheroPolyhedron core;                // hull of points, and a ball, that the body is, if it is one
  BallHull ball_hull;                   // of a few balls, that the body is, if it is one
  BallHull inner_balls;                 // or holds, parts of whose surface are the body's
  std::vector<RoundEdges> round_edges;  // none of bodies of revolution
  EdgeCurves edge_curves;               // of sharp edges
  FlatFeatures flats;                   // faces, creases and ruled lines; empty for round bodies

  // Balls inside the body over directions, which spare deep contacts of round bodies a search. Made the first
  // time, before a run: 10 to 100 ms.
  const InnerMap& inner_map() const {
    return lazy_inner_map.get([this] { return make_inner_map(*this); });
  }
  // Balls inside it piece by piece, if the body is nearly one. Made the first time, some ms to 30 ms.
  const NearBall& near_ball() const {
    return lazy_near_ball.get([this] { return make_near_ball(*this); });
  }
  // Whether a local maximum of d . x may be no global one.
  bool dented() const { return support_excess > kRoundoff * bounding_radius; }
};

// What a normal may err by, rad, because a collapsed edge is no point: `shorter2` is the squared length of
// the shorter tangent at scale 1.
inline double pole_noise(const Shape& shape, double shorter2) {
  return shape.pole_spread > 0 ? kPoleSpreadSafety * shape.pole_spread / std::sqrt(shorter2) : 0;
}

// Whether there is such a point: memory may hold none, or one of another shape, or no numbers.
inline bool has_patch(const Shape& shape, const SurfacePoint& at) {
  return at.patch >= 0 && at.patch < static_cast<int>(shape.patches.size());
}
inline bool lies_on(const Shape& shape, const SurfacePoint& at) {
  return has_patch(shape, at) && at.on_patch();
}

// A shape that can't be used; what() is one line made for the user.
struct ShapeError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

// Builds and checks a shape. `gyration` overrides inertia / mass for bodies that are not uniform solids:
// symmetric, positive definite, no principal moment larger than the sum of the others. Throws ShapeError when
// the surfaces do not bound one closed convex body; appends to `warnings` what was repaired. Messages begin
// with "NAME: " and count patches (the surfaces of the file) from 0; u, v are in the surface's own knots, as
// read. Some ms to some tens of ms for six patches.
std::shared_ptr<const Shape> make_shape(const std::string& name, std::vector<NurbsSurface> surfaces,
                                        const std::optional<Mat3>& gyration = std::nullopt,
                                        std::vector<std::string>* warnings = nullptr);

// A shape as bytes, and from them: the same bits, for another process of this program, for a thousandth of
// the time that making it takes. `unpack` throws std::length_error on bytes that are no whole shape.
std::string pack(const Shape& shape);
std::shared_ptr<const Shape> unpack(const std::string& data);

}  // namespace nurbs

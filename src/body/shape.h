// A shape: a closed convex body bounded by NURBS patches, with all that is derived from it once at load
// (Bezier patches, connectivity, mass properties, bounds, direction atlas). Immutable after make_shape; every
// particle of that shape shares it.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "body/direction_atlas.h"
#include "body/normal_map.h"
#include "body/rolling.h"
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
  double kink = 0;  // largest angle between the two normals along the edge, rad; > 0 opens (convex), < 0 is
                    // concave; on a collapsed edge: between the normals around the pole (0 where smooth)
};

struct MassProperties {  // of the uniform solid of unit density, at scale 1
  double volume = 0;
  Vec3 center = Vec3::Zero();   // centre of mass in the frame of the shape file
  Mat3 inertia = Mat3::Zero();  // about the centre of mass, axes of the shape file
};

// Radii of curvature over the whole surface: every normal curvature lies in [1/max_radius, 1/min_radius].
// min_radius is 0 for a body with a convex crease or corner; max_radius is infinite for one with a flat part.
// Conservative: sampled, refined and widened, see curvature.h.
struct CurvatureBounds {
  double min_radius = 0;
  double max_radius = 0;
};

struct Shape {
  std::string name;
  std::uint64_t stamp = 0;  // of the surfaces' contents: the same on every rank and across restarts
  std::vector<NurbsSurface> surfaces;  // as read, turned outward (Su x Sv points out), frame of the file
  std::vector<BezierPatch> patches;    // exact Bezier split, moved so that the centre of mass is the origin
  std::vector<int> surface_of_patch;   // index into surfaces
  std::vector<std::array<EdgeLink, 4>> links;  // per Bezier patch
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
  bool smooth = true;                      // no kink above kSmoothKink: normals are continuous
  CurvatureBounds curvature;               // of the body; any kink above 1e-7 rad makes it (0, infinity)
  CurvatureBounds patch_curvature;         // of the patches alone, joints left out
  std::vector<double> curvature_rate;      // per patch, bound of |dW/dn|: curvature_rate.h
  JointDistance joints;                    // to kinked joints: where the patch curvatures hold for the body
  NormalMap normal_map;                    // local bounds, for bodies with flats or dents
  DirectionAtlas atlas;

  // Whether a local maximum of d . x may be no global one.
  bool dented() const { return support_excess > kRoundoff * bounding_radius; }
};

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

}  // namespace nurbs

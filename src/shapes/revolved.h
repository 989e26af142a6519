// Bodies of revolution from profiles of lines and circular arcs: exact rational patches.
#pragma once

#include <vector>

#include "nurbs/nurbs_surface.h"
#include "nurbs/types.h"

namespace nurbs {

// The NURBS curve of (r, z, weight), not homogeneous, turned about z: u runs round in four rational
// quadratics (NURBS Book, section 8.5), v along the curve, which goes from the lower end of the axis up for
// Su x Sv outward.
NurbsSurface surface_of_revolution(int degree, const std::vector<double>& knots,
                                   const std::vector<Vec3>& curve);
// The same of one Bezier segment.
NurbsSurface surface_of_revolution(const std::vector<Vec3>& segment);

// A convex profile in the half plane (r, z), r >= 0, from the lower pole (0, z0) to the upper one: lines, and
// arcs of conics as rational quadratics.
struct ProfileArc {
  Vec2 from, corner, to;  // corner: where the end tangents meet; unused for a line
  double weight;          // of the corner; 0 for a line
};
using Profile = std::vector<ProfileArc>;

// Of a convex polygon (r, z), from the lower end of the axis up to the upper one: corners, tips on the axis
// among them, become arcs that cut off at most `cut` of the corner, as far as the edges reach: half way where
// both ends are rounded. Convex and smooth by construction.
Profile rounded_profile(const std::vector<Vec2>& polygon, double cut);

// One surface per arc, axis z; u runs round, v up, Su x Sv outward. Lines become flat discs, cylinders or
// cones.
std::vector<NurbsSurface> revolve(const Profile& profile);

// Solids, centred at the middle of their height; every joint smooth.
std::vector<NurbsSurface> capsule(double radius, double length);  // length of the cylinder, > 0
// Cylinder with its rims rounded by `rim` <= radius, `height` / 2 (whole height).
std::vector<NurbsSurface> tablet(double radius, double height, double rim);
// Biconvex tablet: caps of spheres of radius `cap` over a band of height `band` >= 0, whose edges are rounded
// by `rim`. Lens: the same without a band. Throws ShapeError when no such body exists.
std::vector<NurbsSurface> biconvex_tablet(double radius, double band, double cap, double rim);
std::vector<NurbsSurface> lens(double radius, double cap, double rim);
// Halves of ellipsoids of revolution of heights `blunt` and `pointed` over a common circle.
std::vector<NurbsSurface> egg(double radius, double blunt, double pointed);

// Box of half extents h whose edges are cylinders and corners spheres of radius r <= the least of h: flat
// faces, 26 exact patches, fewer when r equals a half extent. Joints smooth.
std::vector<NurbsSurface> rounded_box(const Vec3& half_extents, double radius);

}  // namespace nurbs

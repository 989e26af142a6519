// Ready-made bodies as NURBS surfaces, in the layout a shape file holds: closed, oriented outward (Su x Sv
// points out), convex unless dents are mentioned. Lengths are the caller's. Arguments are taken as valid.
#pragma once

#include <vector>

#include "nurbs/nurbs_surface.h"
#include "nurbs/types.h"

namespace nurbs {

// Exact ellipsoid (sphere when the semi-axes are equal): six biquartic rational patches, Cobb's tiling of the
// sphere by a cube, scaled along the axes. Centred at the origin. Round-off only.
std::vector<NurbsSurface> exact_ellipsoid(const Vec3& semi_axes);

// The same by six bicubic polynomial patches fitted to the exact one (`spans` x `spans` Bezier pieces each).
// `error` receives the largest distance from the exact surface (a bound: that of the unit sphere times the
// largest semi-axis). Joints are smooth only to that order: one span 4e-4 and 1 degree on the sphere, two
// 9e-5 and 0.2, three 2e-5 and 0.07.
std::vector<NurbsSurface> fitted_ellipsoid(const Vec3& semi_axes, int spans = 1, double* error = nullptr);

// The same by six bicubic polynomial patches of one piece each whose joints are tangent-continuous to
// round-off, at the price of a larger `error` (0.15 % of the largest semi-axis). An affine image of one body
// of cubic symmetry.
std::vector<NurbsSurface> smooth_ellipsoid(const Vec3& semi_axes, double* error = nullptr);

// An asymmetric convex pebble of six bicubic patches with smooth joints, about 1 in radius, centre of mass at
// the origin. Every normal curvature lies in [0.5, 3].
std::vector<NurbsSurface> pebble();

// Blocky body |x/a|^e + |y/b|^e + |z/c|^e = 1 fitted by six bicubic B-spline patches; e = 2 is an ellipsoid,
// larger is blockier, e >= 2. `error` receives the largest distance from the exact surface, as in
// fitted_ellipsoid. Three spans: error 3e-4 to 4e-3, dents up to 1.3e-4 for e from 2.5 to 12. Faces are flat
// in the middle for e > 2; an even number of spans puts a knot there and dents them by up to 1e-3.
std::vector<NurbsSurface> fitted_superellipsoid(const Vec3& semi_axes, double exponent, int spans,
                                                double* error = nullptr);

// Ellipsoid of revolution about z as ONE biquadratic rational surface, exact: two poles and a seam. u runs
// round the equator, v from the south pole to the north pole.
std::vector<NurbsSurface> revolved_ellipsoid(double equatorial, double polar);

// Box with flat faces: six bilinear patches (creases and corners).
std::vector<NurbsSurface> box(const Vec3& half_extents);

// The six-patch bicubic body of smooth joints, near an ellipsoid, whose uniform solid has inertia / mass =
// `gyration` (symmetric, length squared) about its centre of mass, the origin, to round-off. Throws
// ShapeError when no solid has that tensor.
std::vector<NurbsSurface> ellipsoid_with_gyration(const Mat3& gyration);

}  // namespace nurbs

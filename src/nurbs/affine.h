// Affine maps of bodies, and the one that gives a body a wanted inertia. Affine maps keep degree, knots,
// weights, closure, convexity and smooth joints.
#pragma once

#include <vector>

#include "body/shape.h"

namespace nurbs {

// Mass properties of the uniform solid of unit density inside closed outward surfaces.
MassProperties solid_properties(const std::vector<NurbsSurface>& surfaces);

// Every control point x becomes a x + b. det(a) > 0 keeps the body outward.
void transform(std::vector<NurbsSurface>& surfaces, const Mat3& a, const Vec3& b);

// Moves the centre of mass to the origin, to round-off.
void center(std::vector<NurbsSurface>& surfaces);

// Maps the body by a symmetric positive matrix so that inertia / mass of the uniform solid about its centre
// of mass equals `gyration` (symmetric, length squared), and centres it. Closed form: with C, C' the
// covariances (second moments / volume) before and after, the map is C^-1/2 (C^1/2 C' C^1/2)^1/2 C^-1/2.
// Volume, hence density for a given mass, follows. Throws ShapeError unless the principal moments of
// `gyration` obey the strict triangle inequality, without which no solid has them.
void match_gyration(std::vector<NurbsSurface>& surfaces, const Mat3& gyration);

}  // namespace nurbs

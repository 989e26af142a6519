// Convex polyhedra whose edges and corners are rounded: flat faces, cylinders and spheres, exact.
#pragma once

#include <string>
#include <vector>

#include "nurbs/nurbs_surface.h"
#include "shapes/convex_hull.h"

namespace nurbs {

// The half space normal . x <= offset; `normal` unit.
struct HalfSpace {
  Vec3 normal;
  double offset;
};

constexpr double kSingleRoundoff = 1e-6;

// The facets of a hull, those in one plane, to `roundoff` of the extent, once; empty when there are more than
// `most`.
std::vector<HalfSpace> facets(const ConvexHull& hull, size_t most, double roundoff = kSingleRoundoff);

// The planes of a hull's largest faces where those are much larger than the rest, as with a box whose edges
// are round; the fewest first, at least four. Empty where no face stands out.
std::vector<std::vector<HalfSpace>> large_faces(const ConvexHull& hull);

// Half spaces that hold a hull, no corner of their intersection further than `excess` from it: the planes of
// its faces of some size, and the tangent planes that cut off most, which are then moved by `inward`. Empty
// when more than `most` are needed.
std::vector<HalfSpace> enclosing_faces(const ConvexHull& hull, const Vec3& inside, double excess,
                                       double inward, size_t most);

// Those of a Platonic solid with corners on the sphere of `radius` about the origin: tetrahedron, cube,
// octahedron, dodecahedron, icosahedron. Empty for another name.
std::vector<HalfSpace> platonic_solid(const std::string& name, double radius);

// What a ball of radius `rounding` covers that rolls all over the inside of the intersection of half spaces
// (its opening, a Minkowski sum of the eroded polyhedron and the ball): faces stay in their planes, edges
// become parts of cylinders, corners of spheres; tangent-continuous, closed and convex by construction. Faces
// of more than four sides are cut into quadrilaterals and at most one triangle, corners into quadrilaterals.
// `inside`: a point of the body. Throws ShapeError when the ball does not fit, or the half spaces are
// unbounded.
std::vector<NurbsSurface> rounded_polyhedron(const std::vector<HalfSpace>& faces, const Vec3& inside,
                                             double rounding);

}  // namespace nurbs

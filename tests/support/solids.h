// Solids whose support functions are known in closed form, written as NURBS surfaces in the ways that break
// contact searches: revolved about poles, made of patches with an edge collapsed to a point, weighted
// unevenly, turned against the file's axes. The closed forms share nothing with src/.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "contact/contact.h"
#include "support/random.h"

namespace nurbs::test {

struct Solid {
  std::shared_ptr<const Shape> shape;
  std::function<Vec3(const Vec3&)> support;  // point furthest along d (any length), frame of the shape: about
                                             // its centre of mass
  std::vector<Vec3> normals;  // of flat faces and other directions worth asking, frame of the shape
};

// The same on a placed body, from its centre, lab.
Vec3 support_of(const Solid& solid, const Particle& p, const Vec3& d);

// Furthest points along d, any length, of bodies about the origin, axes along the coordinates': an ellipsoid;
// a box of half edges `half`, and a disc about z of radius r and half thickness h, rounded by a ball.
Vec3 ellipsoid_support(const Vec3& d, const Vec3& semi_axes);
Vec3 box_support(const Vec3& d, const Vec3& half, double ball);
Vec3 disc_support(const Vec3& d, double r, double h, double ball);
// The six directions of the axes, and the two of z.
std::vector<Vec3> axes_normals();
std::vector<Vec3> poles();

// A body of surfaces whose support about the origin of their frame is `support`, turned by a random rotation.
Solid turned_solid(Random& random, const std::string& name, std::vector<NurbsSurface> surfaces,
                   std::function<Vec3(const Vec3&)> support, std::vector<Vec3> normals = {});

// Control points and weights to so many decimals, as a file has them.
std::vector<NurbsSurface> with_decimals(std::vector<NurbsSurface> surfaces, int decimals);

// Each turned by a random rotation baked into the control points, the weights of straight lines scaled by up
// to `weights` and its inverse.
Solid cone(Random& random, double radius, double height, double weights = 1);
Solid double_cone(Random& random, double radius, double below, double above, double weights = 1);
Solid cylinder(Random& random, double radius, double half_height, double weights = 1);
Solid frustum(Random& random, double low, double high, double height, double weights = 1);
Solid capsule(Random& random, double radius, double half_length);
// Two spherical caps of radius `bend` that meet at a crease of radius 1; bend > 1.
Solid lens(Random& random, double bend);
// The same, all but a ball, whose crease is `kink` rad.
Solid slight_lens(Random& random, double kink);
// What planes square to z leave of the unit sphere between `low` and `high`, both in [-1, 1].
Solid spherical_segment(Random& random, double low, double high);
// Two conics, of rational quadratics whose corners weigh `weight`, from poles at -below and above to a circle
// of radius 1: nearly cones for small weights, nearly a cylinder for large ones.
Solid conic_of_revolution(Random& random, double below, double above, double weight);
// The Reuleaux triangle of width 1, turned about its axis; and the prism over it.
Solid turned_reuleaux(Random& random);
Solid reuleaux_prism(Random& random, double half_height);
// Convex hull of two half circles of radius 1 in planes at right angles: halves of a double cone, one of them
// turned. Its surface unrolls into a plane.
Solid sphericon(Random& random);
// Convex hull of `points` points near a sphere squeezed along one axis, every face one bilinear patch with an
// edge collapsed to a corner.
Solid polyhedron(Random& random, int points, double squeeze, double weights = 1);
// The image of a solid by a random linear map of stretches between `least` and 1, not along its own axes.
Solid stretched(Random& random, const Solid& solid, double least);
// An exact ellipsoid of the library's, axes along the file's.
Solid ellipsoid_solid(const Vec3& axes);

}  // namespace nurbs::test

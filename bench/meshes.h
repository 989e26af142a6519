// Convex triangle meshes of a shape, as GJK libraries use them.
#pragma once

#include <array>
#include <vector>

#include "body/shape.h"

namespace nurbs::bench {

struct Mesh {
  std::vector<Vec3> vertices;                   // on the surface, shape frame, scale 1
  std::vector<std::array<int, 3>> triangles;    // of the vertices' convex hull, outward
  std::vector<int> neighbour_start, neighbour;  // of vertex i: neighbour[neighbour_start[i] ..)
};

// About `vertices` of them, spread evenly over the parameters of every patch; triangulated as their convex
// hull by edge flips, vertices that fall inside the hull are dropped. Under a second for 50,000.
Mesh tessellate(const Shape& shape, int vertices);

// Index of the vertex farthest along d. Small meshes are scanned, large ones climbed from `start`.
int farthest_vertex(const Mesh& mesh, const Vec3& d, int start);

}  // namespace nurbs::bench

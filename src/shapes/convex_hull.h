// Convex hulls of points (by Qhull): support function, distance of a point, mass.
#pragma once

#include <vector>

#include "body/shape.h"
#include "nurbs/types.h"
#include "shapes/triangle_mesh.h"

namespace nurbs {

// Nearest point to the origin of the simplex with `count` corners y, of which the last one brings it nearer
// than the others'; leaves in y those that it is a mean of.
Vec3 nearest_on_simplex(Vec3 (&y)[4], int& count);

class ConvexHull;

// n / h of the facets, n outward unit normals, h > 0 distances from the origin inside: the polar hull's
// vertices, whose support is the hull's gauge function.
std::vector<Vec3> polar_points(const ConvexHull& hull);

class ConvexHull {
 public:
  // Of finite points. Throws ShapeError when they lie in a plane, to within 1e-9 of their extent.
  explicit ConvexHull(const std::vector<Vec3>& points);

  // Its image x -> m x + shift, det m > 0: far cheaper than a hull of the image's points.
  ConvexHull image(const Mat3& m, const Vec3& shift) const;

  const TriangleMesh& mesh() const { return mesh_; }  // vertices, and triangles wound outward
  MassProperties properties() const { return mesh_properties(mesh_); }

  // A vertex furthest along d (any length), by climbing along edges from vertex `start`, or, of many, from
  // the one that a table has for the directions around d: a few steps whatever the start.
  int support(const Vec3& d, int start) const;

  // Upper bound of the distance from x to the hull, 0 inside: that to a point of it, found by Gilbert's,
  // Johnson's and Keerthi's algorithm to 1e-9 of the extent; the search ends early at `enough`. `start` as
  // above, and left at a vertex near x.
  double distance(const Vec3& x, double enough, int& start) const { return way(x, enough, start).norm(); }

  // From x to the point of the hull that this is the distance to; zero inside.
  Vec3 way(const Vec3& x, double enough, int& start) const;

 private:
  void measure();  // what depends on where the vertices are
  int climb(const Vec3& d, int start) const;

  TriangleMesh mesh_;
  std::vector<int> first_, neighbours_;  // of vertex i: [first_[i], first_[i + 1])
  std::vector<int> near_;  // by cells of directions (body/cube_map.h): the vertex furthest along their middle
  int cells_ = 0;          // along the edge of a face of the cube; 0: no table
  double extent_ = 0;
};

}  // namespace nurbs

// Direction atlas: a table of a body's support over a cube map of directions, made once per shape. It gives a
// start for every search and rigorous bounds on the support function at the cost of a few loads.
#pragma once

#include <cstdint>
#include <vector>

#include "nurbs/types.h"
#include "nurbs/wide.h"

namespace nurbs {

struct Shape;

// Where on a shape: a patch and its parameters.
struct SurfacePoint {
  int patch = 0;
  double u = 0.5, v = 0.5;

  bool on_patch() const { return u >= 0 && u <= 1 && v >= 0 && v <= 1; }
};
template <class Archive>
void archive(Archive& a, SurfacePoint& s) {
  auto& [patch, u, v] = s;
  a(patch, u, v);
}

struct DirectionAtlas {
  int cells = 0;                    // per cube edge: (cells + 1)^2 nodes per face, 6 faces
  std::vector<double> support;      // h at the unnormalised cube direction of each node (h is homogeneous)
  std::vector<Vec3> point;          // the support point there, shape frame, scale 1
  std::vector<SurfacePoint> where;  // and where it lies

  // Upper bound of h(d) for any d != 0: bilinear interpolation of nodal h, an upper bound because h is convex
  // and homogeneous and the interpolation is a convex combination of the node directions that equals d. ~5
  // ns.
  double support_upper(const Vec3& d) const;
  void support_upper(const Triple<Lane4>& d, Lane4* upper) const;  // of four at once
  // The node nearest to d; the (unnormalised) direction of a node: the largest component is +-1.
  int nearest(const Vec3& d) const;
  // Where the support along d may lie: between the supports of the nodes around it, where one patch holds all
  // four, else the nearest one's. A start for searches, second order in the nodes' distance. 15 ns.
  SurfacePoint place(const Vec3& d) const;
  // The four nodes around d.
  void cell(const Vec3& d, int (&nodes)[4]) const;
  Vec3 direction(int node) const;
  int nodes() const { return static_cast<int>(support.size()); }
};
template <class Archive>
void archive(Archive& a, DirectionAtlas& s) {
  auto& [cells, support, point, where] = s;
  a(cells, support, point, where);
}

// The atlas of a shape whose patches, links, bounds and curvatures are done. Milliseconds; 97 kB at 16 cells.
DirectionAtlas make_atlas(const Shape& shape, int cells);

}  // namespace nurbs

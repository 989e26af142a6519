// Directions as points on the faces of a cube, for tables over them.
#pragma once

#include <algorithm>
#include <cmath>

#include "nurbs/types.h"

namespace nurbs {

// Face 2k looks along +axis k, face 2k + 1 along -axis k: d = major * (+-axis k + a * next axis + b * the one
// after), a and b in [-1, 1]. A zero vector has major 0.
struct CubePoint {
  int face;
  double major, a, b;
};

inline CubePoint to_cube(const Vec3& d) {
  const double x = std::abs(d[0]), y = std::abs(d[1]), z = std::abs(d[2]);
  const int k = x >= y ? (x >= z ? 0 : 2) : (y >= z ? 1 : 2);
  const int k1 = k == 2 ? 0 : k + 1, k2 = k == 0 ? 2 : k - 1;
  const double major = std::abs(d[k]);
  return {2 * k + (d[k] < 0), major, d[k1] / major, d[k2] / major};
}

// Number of the cell that coordinate a or b lies in, of `cells` along the edge.
inline int cube_cell(double coordinate, int cells) {
  return std::clamp(static_cast<int>((coordinate + 1) * (0.5 * cells)), 0, cells - 1);
}

}  // namespace nurbs

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

// The way back, of length 1 / major.
inline Vec3 from_cube(int face, double a, double b) {
  const int k = face / 2;
  Vec3 d;
  d[k] = face % 2 ? -1 : 1;
  d[(k + 1) % 3] = a;
  d[(k + 2) % 3] = b;
  return d;
}
// Through the middle of cell (i, j) of a face; not unit.
inline Vec3 cell_middle(int face, int i, int j, int cells) {
  return from_cube(face, (2.0 * i + 1) / cells - 1, (2.0 * j + 1) / cells - 1);
}

constexpr double kBesideCap = 1e-9;  // of a face's half width: round-off of a cap's ends

// Number of the cell that coordinate a or b lies in, of `cells` along the edge.
inline int cube_cell(double coordinate, int cells) {
  return std::clamp(static_cast<int>((coordinate + 1) * (0.5 * cells)), 0, cells - 1);
}

// Calls visit(number) for every cell that a cap of directions, at most 0.3 rad wide, may touch: (face * cells
// + i) * cells + j. (Some more in the corners are called too; a face whose axis is at cosine 0.3 is out of
// reach.)
template <class Visit>
void visit_cells(const Vec3& center, double angle, int cells, const Visit& visit) {
  const double sine = std::sin(angle), sine2 = sine * sine;
  for (int k = 0; k < 3; ++k)
    for (const double side : {1.0, -1.0}) {
      const double major = side * center[k];
      if (major < 0.3) continue;
      // Between the two planes through the face's other axis that touch the cone: x / major of their normals.
      const double least = major * major - sine2;
      struct Range {
        double low, high;
      };
      const auto range = [&](double x) {
        if (!(least > 0)) return Range{-1, 1};
        const double root = sine * std::sqrt(x * x + least);
        return Range{(x * major - root) / least - kBesideCap, (x * major + root) / least + kBesideCap};
      };
      const Range a = range(center[(k + 1) % 3]), b = range(center[(k + 2) % 3]);
      if (a.low > 1 || a.high < -1 || b.low > 1 || b.high < -1) continue;
      const int face = (2 * k + (side < 0)) * cells;
      for (int i = cube_cell(a.low, cells); i <= cube_cell(a.high, cells); ++i)
        for (int j = cube_cell(b.low, cells); j <= cube_cell(b.high, cells); ++j)
          visit((face + i) * cells + j);
    }
}

}  // namespace nurbs

// Sharp edges as curves: how much they bend at most, proven. What a contact of two edges rests on
// (contact/edge_search.h).
#pragma once

#include <array>
#include <limits>
#include <vector>

#include "nurbs/types.h"

namespace nurbs {

struct Shape;

// Of an edge over its whole length; lengths of the shape frame.
struct EdgeCurve {
  float bend = std::numeric_limits<float>::infinity();  // its curvature is no larger, 1/length
  float speed = 0;                                      // |dx/dt| is no smaller, t in [0, 1]
  bool sharp() const { return speed > 0; }
};
template <class Archive>
void archive(Archive& a, EdgeCurve& s) {
  auto& [bend, speed] = s;
  a(bend, speed);
}

// Per patch, its edges as EdgeLink counts them; empty for bodies without sharp edges. Edges that open
// (convex kinks above kSmoothKink) are sharp; the others, and those whose bounds are not to be had, have no
// speed.
using EdgeCurves = std::vector<std::array<EdgeCurve, 4>>;

// Of a shape whose patches and links, with their kinks, are done. From the Bernstein form: with the
// homogeneous (X, w) and N = w X' - w' X, the curve's derivative is N / w^2 and its curvature
// w^2 |N x N'| / |N|^3.
EdgeCurves find_edge_curves(const Shape& shape);

}  // namespace nurbs

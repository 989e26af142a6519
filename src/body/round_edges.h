// Sharp edges that run round an axis, of bodies that need not: of sphericons, oblique cones, wedges with a
// round face, prisms over arcs. Deep contacts make rings of directions alike about them
// (contact/overlap/ring_search.h).
#pragma once

#include <cmath>
#include <vector>

#include "nurbs/types.h"

namespace nurbs {

struct Shape;

// Arcs of circles about one axis, at the same azimuths. Lengths of the shape frame.
struct RoundEdges {
  struct Circle {
    double radius, z;  // along the axis from `point`
  };
  Vec3 point, axis, start;    // the axis is unit, and so is the direction of azimuth 0, square to it
  double from = 0, to = 0;    // azimuths, rad; all round: 2 pi apart
  std::vector<Circle> edges;  // that lie on the body, but for `error`
  double error = 0;

  Vec3 outward(double azimuth) const {
    return std::cos(azimuth) * start + std::sin(azimuth) * axis.cross(start);
  }
  bool whole() const { return to - from >= 2 * M_PI; }
  // Whether all azimuths within `half` of one are the arcs'.
  bool holds(double azimuth, double half) const {
    const double after = azimuth - 2 * M_PI * std::floor((azimuth - half - from) / (2 * M_PI));
    return whole() || after + half <= to;
  }
};
template <class Archive>
void archive(Archive& a, RoundEdges::Circle& s) {
  auto& [radius, z] = s;
  a(radius, z);
}
template <class Archive>
void archive(Archive& a, RoundEdges& s) {
  auto& [point, axis, start, from, to, edges, error] = s;
  a(point, axis, start, from, to, edges, error);
}

// Of a shape whose patches, links and size are done. Edges count that open (convex kinks) and are rational
// quadratics, raised in degree it may be; parts of one circle that meet are put together.
std::vector<RoundEdges> find_round_edges(const Shape& shape);

}  // namespace nurbs

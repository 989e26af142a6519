// Sphero-polyhedra: what a ball sweeps whose centre moves in a convex polyhedron. Capsules, boxes and
// polyhedra with rounded edges are some, and polyhedra themselves, whose ball is a point.
#pragma once

#include <vector>

#include "nurbs/types.h"

namespace nurbs {

struct Shape;

// Lengths of the shape frame. For every unit d the body's support is max over points of d . x, and `radius`
// more, within `error`.
struct SpheroPolyhedron {
  // Where the ball rolls along an edge of the hull: its surface is straight from one end's ball to the
  // other's, with normals on an arc of less than half a circle.
  struct Edge {
    int ends[2];
    Vec3 along;     // unit; round it from `from` to `to` is right-handed
    Vec3 from, to;  // normals, unit, at the arc's ends
  };

  std::vector<Vec3> points;  // none: the body is no such one, or isn't known to be
  double radius = 0;
  double error = 0;
  std::vector<Edge> edges;  // all, parts of one arc each; none of a body whose straight lines aren't known

  // Whether these tell all that is known of straight lines.
  bool has_lines(bool ruled) const { return found() && (!ruled || !edges.empty()); }

  bool found() const { return !points.empty(); }
  // The number of the point that is farthest along d, of any length; the first of equal ones.
  int support(const Vec3& d) const {
    int best = 0;
    double most = d.dot(points[0]);
    for (int k = 1; k < static_cast<int>(points.size()); ++k)
      if (const double h = d.dot(points[k]); h > most) most = h, best = k;
    return best;
  }
};

template <class Archive>
void archive(Archive& a, SpheroPolyhedron::Edge& s) {
  auto& [ends, along, from, to] = s;
  a(ends, along, from, to);
}
template <class Archive>
void archive(Archive& a, SpheroPolyhedron& s) {
  auto& [points, radius, error, edges] = s;
  a(points, radius, error, edges);
}

// Of a shape of which all but the search tables is done. Found by positions:
//   * The body is in it: its patches are planar, or straight one way between edges that they share with parts
//     of balls, or parts of balls of `radius` about one of the points, proven from Bernstein coefficients.
//     Points inside a plane region or a straight line are no extreme ones, so the balls' parts have them all.
//   * It is in the body: where that has its support it is on such a part and, normals being continuous, in
//     the direction of its normal from the part's centre v, so that h(d) - radius is v . d there, continuous,
//     and as convex where two parts meet as h is: the largest of all v . d. This rests on normals and
//     convexity as measured (kinks, Shape::concavity), at slivers to round-off only.
// Of what few digits have moved (by 3e-11 of the body, at most), and where joints have kinks beyond
// round-off, the balls, smaller by `error`, are proven to lie inside instead. Polyhedra: bilinear patches,
// whose corners are of the body and have it in their hull.
SpheroPolyhedron find_sphero_polyhedron(const Shape& shape);

// Its edges, of a shape whose flat features are known: the straight lines of constant normal, through all
// patches that are none of a ball's or a face's. None unless every such patch has its place, with `radius`.
std::vector<SpheroPolyhedron::Edge> find_core_edges(const Shape& shape);

// Hulls of a few balls of different radii, as tapered capsules are; the tip of a cone is a ball of radius 0.
// For every unit d the body's support is max over balls of d . centre + radius, within `error`. Lengths of
// the shape frame.
struct BallHull {
  std::vector<Vec3> centres;  // none: the body is no such one, or isn't known to be
  std::vector<double> radii;
  double error = 0;

  bool found() const { return !centres.empty(); }
};
template <class Archive>
void archive(Archive& a, BallHull& s) {
  auto& [centres, radii, error] = s;
  a(centres, radii, error);
}
constexpr int kMostBalls = 4;

// Of two to kMostBalls balls. Found by positions as sphero-polyhedra are: every patch is part of a ball,
// proven, or planar, or straight one way between edges that it shares with those, up to few digits; that the
// hull of the balls is the body is measured besides, at samples of every patch's points and normals.
BallHull find_ball_hull(const Shape& shape);

// Balls inside the body, proven, that parts of its surface lie on (eggs, bullets, balls cut flat), and the
// same moved along the axis of a body of revolution as far as they stay inside: the body's support is no less
// than their hull's, and equal where it is on one of those parts. None of bodies that are such a hull. Of
// hulls that are found already nothing is asked. 1 to 20 ms where there are any.
BallHull find_inner_balls(const Shape& shape);

}  // namespace nurbs

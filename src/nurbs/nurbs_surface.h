// A tensor-product NURBS surface as a shape file gives it (The NURBS Book, section 4.4), evaluated by de Boor
// on the original knots, and its exact split into Bezier patches.
#pragma once

#include <string>
#include <vector>

#include "nurbs/bezier_patch.h"
#include "nurbs/types.h"

namespace nurbs {

struct NurbsSurface {
  int degree_u = 0, degree_v = 0;  // 1..kMaxDegree
  std::vector<double> knots_u,
      knots_v;                 // non-decreasing, size_u + degree_u + 1 and size_v + degree_v + 1 of them
  int size_u = 0, size_v = 0;  // control points in each direction
  std::vector<Vec4> points;    // homogeneous (w x, w y, w z, w), weight > 0, v fastest

  const Vec4& point(int i, int j) const { return points[static_cast<size_t>(i) * size_v + j]; }
  Vec4& point(int i, int j) { return points[static_cast<size_t>(i) * size_v + j]; }
};
template <class Archive>
void archive(Archive& a, NurbsSurface& s) {
  auto& [degree_u, degree_v, knots_u, knots_v, size_u, size_v, points] = s;
  a(degree_u, degree_v, knots_u, knots_v, size_u, size_v, points);
}

// What is wrong with the numbers of a surface, as one phrase with the offending value and its allowed range;
// empty when it can be evaluated. Checks degrees, counts, knots, weights and points, in that order.
std::string find_defect(const NurbsSurface& surface);

// A surface of one Bezier patch: homogeneous points, v fastest; knots 0 and 1.
NurbsSurface bezier_surface(int degree_u, int degree_v, std::vector<Vec4> points);

// Point at (u, v) of the surface's own knot domain [knots[degree], knots[size]], by de Boor's recurrence in
// homogeneous coordinates (NURBS Book, section 4.4 and A5.2's triangular scheme); parameters outside are
// clamped.
Vec3 evaluate(const NurbsSurface& surface, double u, double v);

// The Bezier patches of one surface, with the rectangle of knot domain each covers.
struct BezierPiece {
  BezierPatch patch;
  double u0, u1, v0, v1;  // patch (s, t) in [0,1]^2 is surface (u0 + s (u1 - u0), v0 + t (v1 - v0))
};

// Exact split at every distinct knot inside the domain, by blossoming: the Bezier point i of a span [a, b] is
// the blossom at p - i times a and i times b (Ramshaw 1989). Same result as NURBS Book A5.7, but it needs no
// clamped ends and takes interior knots of any multiplicity. Only convex combinations occur, so round-off is
// a few ulp. The pieces are ordered u-span major, v-span fastest. Equal weights are divided out (`rational` =
// false).
std::vector<BezierPiece> split_to_bezier(const NurbsSurface& surface);

// The Bezier points, homogeneous, over a non-empty span [knots_u[k], knots_u[k + 1]] of the curve that column
// j of the control net is in u.
std::vector<Vec4> bezier_points_u(const NurbsSurface& surface, int k, int j);

// The same surface with one more knot of u inside the domain, by Boehm's algorithm (NURBS Book A5.1 for one
// knot, which needs no clamped ends). `u` must not have its full multiplicity, the degree, yet.
NurbsSurface insert_knot_u(const NurbsSurface& surface, double u);

// The same surface with u and v exchanged, which turns Su x Sv round.
NurbsSurface swap_uv(const NurbsSurface& surface);

}  // namespace nurbs

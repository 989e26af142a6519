// The least overlap over all directions by cells, each bounded to second order: the last rung, where minima
// are so wide, or valleys so long, that neither a polytope nor rings of directions close the bracket.
#pragma once

#include "contact/overlap/polytope.h"

namespace nurbs {

// Improves `result`, the polytope's answer for overlapping bodies that are sphero-polyhedra or of revolution:
// bracket and, where it closes, points and normal. True when the bracket is closed.
//
// Of each body some pieces are known that lie in it, and how their supports bend: points of a sphero-
// polyhedron; circles of a body of revolution, with the balls that its profile holds there. For a direction
// at t from a cell's middle d, along unit u,
//     p >= y cos t + s.u sin t + w(u, u) (1 - cos t) - rate t^3 / 6
// of any piece of A and of B, and of every mean of such pairs (y = d . g, s = g across d, w the sum of the
// bends: the solution of y'' + y = w - rate t). Of two pairs that make a crease each is taken on its side;
// where three meet, their mean without slope. Cells of a cube map are halved until each lies above the least
// p found, less most of the tolerance. A cell costs some 1 us.
// A circle of radius R about the axis a has the support R s, s = |d x a|. Along a great circle d(t), whose
// plane's normal m is fixed, it bends by R (m.a)^2 / s^3, which changes by 3 R (m.a)^2 (d.a)(d'.a) / s^5 a
// radian; (m.a)^2 and (d'.a)^2 add up to s^2, so that is 2 / sqrt(3) R |d.a| / s^2 at most. With R < 0, where
// balls are wider than the body, too.
// Two pairs of a crease are level along a curve: between them, in a strip that holds it, their mean that has
// no slope across it lies below both and is as high to second order.
// Hypotheses: those of the pieces (body/sphero_polyhedron.h, body/profile_radii.h).
bool search_cells(const PairFrame& pair, double tolerance, PolytopeResult* result);

}  // namespace nurbs

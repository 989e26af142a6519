// Two hulls of a few balls each: the least overlap in closed form; and bodies that hold such hulls.
#pragma once

#include "contact/overlap/polytope.h"

namespace nurbs {

// Of bodies that are hulls of at most kMostBalls balls (body/sphero_polyhedron.h; balls and capsules too).
// With g_k and R_k the differences of a ball's centre of A and one of B and the sum of their radii,
//     p(d) = max over k of d . g_k + R_k,
// and its least value is one of
//   * along -g_k, where one of them is least,
//   * on the circle where two are equal, where they are least or largest on it,
//   * at the two directions where three are equal:
// at a minimum some of those that are equal there have gradients across d that a convex combination of
// cancels, of three of them at most. Where nearly parallel circles meet is not known well, but a direction at
// which three are equal to round-off is one of balls moved by as much, and the least value moves by no more.
// False where round-off leaves that open, and where the shapes are off such hulls by more than a share of the
// tolerance. p may be least over a whole region of directions, as of balls about one centre.
// Of bodies that such a hull is part of (Shape::inner_balls) p is no less than that: the search closes where
// their supports along its direction have no more, as along those of the balls' parts. *upper, if no
// +infinity then, bounds the gap above.
bool search_ball_hulls(const PairFrame& pair, double tolerance, PolytopeResult* result, double* upper);

}  // namespace nurbs

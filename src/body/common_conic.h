// Curves that are parts of one conic, whatever their parameters: arcs of circles and ellipses as CAD writes
// them, once of degree 2 and once of 4 or 5.
#pragma once

#include "body/edge_polynomials.h"

namespace nurbs {

// How far points of either of two curves are from the other one at most, where that is proven: both lie on
// one plane conic but for `off`, go along it without turning back, and have their ends together; else
// infinite. `along` bounds how far the curves are apart, any way: they take the same way from end to end.
//
// The conic q(x) = 0 is fitted to points of both. Where |q| <= r, |grad q| >= g and |r Hess q| <= g^2 / 4, a
// zero of q is no further than 2 r / g down its gradient. q and its gradient along a curve are bounded by the
// Bernstein coefficients of their numerators, in pieces. In a piece the curve's derivative is within 60
// degrees of a direction and the gradient's within 30 degrees of square to it, so that feet on the conic do
// not turn back; every foot of one curve is one of the other's then, but for those beyond its ends.
double common_conic_gap(const Homogeneous& one, const Homogeneous& other, bool reversed, double along);

}  // namespace nurbs

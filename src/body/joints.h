// What is proven of the joints between patches: how far apart their two sides are, and between which angles
// their normals meet. From polynomials along the joint in Bernstein form, not from samples.
#pragma once

#include <vector>

#include "body/shape.h"

namespace nurbs {

// Bound of the distance between the two sides of a joint, at the parameters that the link pairs: edge `edge`
// of `a` and the edge of `b` that `link` names. Halves the joint until the bound is within a tenth of a
// distance that occurs, or below round-off. Joints that are `projected` are followed piece by piece, chord by
// chord, which bounds straight ones tightly and others to some 1e-6 of their length.
double bound_joint_gap(const BezierPatch& a, int edge, const BezierPatch& b, const EdgeLink& link);

// The same of a collapsed edge: how far its points are from each other.
double bound_collapsed_edge(const BezierPatch& patch, int edge);

// Largest angle by which the outward normals open, and close, along a joint: none is larger, rad. Infinite
// where a side has no normal (but at the joint's ends, where a pole may be) or the link is `projected`.
struct KinkBounds {
  double opening = 0, closing = 0;
};
KinkBounds bound_kink(const BezierPatch& a, int edge, const BezierPatch& b, const EdgeLink& link);

// The same for the normals around a pole, which a collapsed edge is: no two of them make a larger angle.
// Infinite where there is no limit of the normals, as on a flat patch's corner.
double bound_pole_spread(const BezierPatch& patch, int edge);

// Parts of an edge, ranges of its parameter, in which it may bend up along the outward normal of its patch,
// which a convex body's do nowhere: there the normals between a sharp edge's sides belong to more points of
// the body than one. Proven of the others, up to round-off.
struct EdgePart {
  double from, to;
};
std::vector<EdgePart> find_dented_parts(const BezierPatch& patch, int edge);

}  // namespace nurbs

// Least overlap where a body of revolution makes rings of directions (nearly) alike: cones tip to tip, a tip
// against a vertex on its axis, spheroids on one axis. A polytope of points would need thousands of them.
#pragma once

#include "contact/overlap/polytope.h"

namespace nurbs {

// Improves `result`, the polytope's answer for overlapping bodies of which A or B is one of revolution about
// an axis or has edges that are: bracket and, where it closes, points and normal. True when the bracket is
// closed, to `tolerance` or what round-off leaves of it. `last`: the polytope did not close it; rings may be
// less alike then.
//
// With e = d (or -d, for B) at azimuth phi and angle alpha from the axis of K, the body of revolution,
// p >= r_K |e - (e.a) a| + z_K e.a - e.(o + x) for every circle (r_K, z_K) of K about its axis a and point x
// of the other body M; where M is of revolution too and its axis b near a, x is a circle of M's as well. At
// one phi each such bound is R sin alpha + Z cos alpha (of M's circle, its tangent), so that the greatest of
// them is the support function of points (R, Z) in the half plane and its minimum is the distance of their
// hull: exact and cheap. Over an interval of phi R is lowered by what it may change, which is only as much as
// the axes are apart, or two circles are weighed to second order, in which what they change by cancels at the
// minimum; intervals, and those of angles from the axis, are halved until that is little enough. No surface
// is evaluated for it but where a new circle is needed. Between two circles a body bends as its meridian does
// (body/profile_radii.h). A ball is of revolution about any axis: K's is taken. Of a body with sharp edges
// round an axis for part of a turn (body/round_edges.h) supports on them are circles for the azimuths that
// they reach, and points beyond; its other supports are points.
//
// Where few digits keep K or M from being of revolution (body/near_revolution.h), a circle is the body's own
// parameter line: its radius and height are those at the azimuth asked for, go on with their slopes there,
// and lose what the ripple may bend, or, further off, all that it may be off by. What p rises and falls by
// round the axis is then found by halving azimuths as before; balls along the meridian are the product's,
// less what the ripple changes by along it.
bool search_rings(const PairFrame& pair, double tolerance, bool last, PolytopeResult* result);

}  // namespace nurbs

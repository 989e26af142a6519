// Knots that a surface can do without: those that refining it has left.
#pragma once

#include "nurbs/nurbs_surface.h"

namespace nurbs {

// The same surface without the knots of u across which it is one polynomial: all that are left separate two,
// with their full multiplicity. `removed` receives how many places between spans are gone; 0: the surface is
// returned as it came. A span is joined to the next if both come out of their union, cut again, to
// kKnotRemoval times the degree of the largest coordinate, and if that needs no weights further
// apart than kJoinedWeights, or than a linear weight's would be, unless one is a sliver beside the other.
// O(n) for n control points, times the degree squared.
NurbsSurface remove_knots_u(const NurbsSurface& surface, int* removed);

}  // namespace nurbs

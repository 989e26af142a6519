// Where on its patches a point of a body lies.
#pragma once

#include "body/shape.h"

namespace nurbs {

// The surface point at x (shape frame), on a sharp edge exactly where x is on one. Newton on the distance
// from `start`, then from the middles of patches whose balls hold x: for points that searches over directions
// found, whose `start` may be any with the same support, such as the far end of a straight line. `start`
// where none is found within 1e-7 of the body's size. 0.1 to 0.3 us, some us where `start` does not lead
// there.
SurfacePoint locate_point(const Shape& shape, const SurfacePoint& start, const Vec3& x);

}  // namespace nurbs

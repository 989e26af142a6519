// Where on its patches a point of a body lies.
#pragma once

#include "body/shape.h"

namespace nurbs {

// The surface point at x (shape frame), from one near it or that a straight line or a flat leads from; on a
// sharp edge exactly where x is on one. `start` where none is found within kLocated of the body's size. Newton
// on the distance, for points that searches over directions found: their `start` may be any of those with
// the same support. 0.1 to 0.3 us.
SurfacePoint locate_point(const Shape& shape, const SurfacePoint& start, const Vec3& x);

}  // namespace nurbs

// Ruled lines near a surface point: wider than flat_faces.h's ruled_line(), for what may soon be one.
#pragma once

#include "body/flat_faces.h"

namespace nurbs {

// As ruled_line(), and of the patches joined to `at`'s own those whose lines end at the joint, wherever on
// its patch the point is: next to a rounded rim a small turn leads to them. Of all the one whose lower end is
// highest along d.
bool ruled_line_near(const Shape& shape, const SurfacePoint& at, const Vec3& d, double angle,
                     RuledLine* line);

}  // namespace nurbs

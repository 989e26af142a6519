// How a support point moves when its direction turns.
#pragma once

#include "body/support.h"

namespace nurbs {

// d(support point)/d(direction) of a body at its support point in direction d, in the tangent plane spanned
// by t and s (all in the shape's axes, `scale` times its lengths): J (-H)^-1 J^T with J the tangents there
// and H the second derivatives of d . x, both for the parameters that no edge holds back; `asked` says which
// those are. Zero where both are held (a corner). False where the surface has no such map.
bool support_turn(const Shape& shape, const SurfacePoint& at, const Vec3& d, const Vec3& asked, const Vec3& t,
                  const Vec3& s, double scale, Mat2* turn);

}  // namespace nurbs

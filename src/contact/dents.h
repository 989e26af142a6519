// What a dent near a contact may hide: another surface point that is higher along the normal.
#pragma once

#include <algorithm>
#include <limits>

#include "body/support.h"
#include "nurbs/tolerances.h"
#include "nurbs/wide.h"

namespace nurbs {

// One body of a contact: its contact point, and the contact's normal that looks out of it, shape axes.
struct NormalSide {
  const Shape& shape;
  double scale;
  Vec3 d;
  SurfacePoint at;
};

// Whether what dents may hide of a contact, `excess`, keeps its bracket open.
template <class Real>
NURBS_INLINE Mask<Real> dents_count(const Real& excess, const Real& tolerance) {
  return excess > 0.1 * tolerance;
}

// Whether the hull reaches beyond a body's surface by what counts: round-off of joints does not.
inline bool has_dents(const Shape& shape, double scale, double tolerance) {
  return shape.dented() && dents_count(scale * shape.support_excess, tolerance);
}

// h_A(d) + h_B(-d) at most, of the hulls, right to kSupportShare of `tolerance`; lengths of the lab. 0.1 us
// for each body, 0.4 us where a dent is near.
inline double confirmed_heights(const NormalSide& a, const NormalSide& b, double tolerance) {
  const auto height = [tolerance](const NormalSide& side) {
    return side.scale *
           confirm_support(side.shape, side.d, side.at, kSupportShare * tolerance / side.scale).upper;
  };
  return height(a) + height(b);
}

// Turn of the normal, rad, until another support point may take over. Two supports differ by at most the
// diameter times the turn more than they did.
inline double turn_to_rival(const NormalSide& a, const NormalSide& b) {
  const auto clear = [](const NormalSide& side) {
    const Support own = confirm_support(side.shape, side.d, side.at);
    Support rival;
    return find_rival(side.shape, side.d, own, &rival)
               ? std::max(0.0, own.h - rival.h) / side.shape.bounding_radius
               : std::numeric_limits<double>::infinity();
  };
  return std::min(0.25 * std::min(clear(a), clear(b)), kNormalMargin);
}

}  // namespace nurbs

// Bodies of revolution: found, and proven to be such, at load.
#pragma once

#include <vector>

#include "body/ellipsoid.h"
#include "nurbs/bezier_patch.h"
#include "nurbs/types.h"

namespace nurbs {

// An axis about which a body may be turned by any angle and stays where it is.
struct Revolution {
  bool found = false;
  Vec3 axis = Vec3::UnitZ();  // unit
  Vec3 point = Vec3::Zero();  // on it
  double error = 0;           // no point of the body turns out of it by more than this, a length
};
template <class Archive>
void archive(Archive& a, Revolution& s) {
  auto& [found, axis, point, error] = s;
  a(found, axis, point, error);
}

// Of a closed body about its centre of mass, the origin, and the ellipsoid that it is, if any. Every patch
// must lie in a plane square to the axis, or have parameter lines of one kind that are circular arcs about
// it, which is proven from Bernstein coefficients of height and squared radius: turning about the axis is
// then tangential to the whole surface. Or the body must be a spheroid. Patches that make such a body in yet
// other parameters are not found. `inertia` of the uniform solid, about the origin; `size`: bounding radius.
Revolution find_revolution(const std::vector<BezierPatch>& patches, const Mat3& inertia,
                           const Ellipsoid& ellipsoid, double size);

// The same of arcs that may be off by `allowed` of the size, and whatever the body is else.
Revolution find_revolution(const std::vector<BezierPatch>& patches, const Mat3& inertia, double size,
                           double allowed);

// By how much the heights of a patch's control points along `axis`, unit, differ: 0 in a plane square to it.
double out_of_plane(const BezierPatch& patch, const Vec3& axis);

}  // namespace nurbs

// Supports for searches over directions, which want points of the body's hull and not where they lie on its
// patches: in closed form where the body has one.
#pragma once

#include "body/shape.h"
#include "nurbs/types.h"

namespace nurbs {

// Where such a point came from, for searches beside it: a place of the meridian or of the patches, or
// neither.
struct HullPlace {
  Meridian::Place on_profile;
  SurfacePoint on_surface{-1, 0, 0};
};

// In the shape's axes, at scale 1.
struct HullPoint {
  Vec3 point;    // of the body, up to HullPoints::error
  Vec3 normal;   // unit, of the surface there; the direction itself where it has none of its own
  double upper;  // of the support function
  HullPlace where;
};

class HullPoints {
 public:
  // Of the upper bound and the point one may lack `enough` of the support, a length, or a few ulp of the
  // bounding radius; closed forms serve that are off the body by `allowed` at most.
  HullPoints(const Shape& shape, double enough, double allowed);

  // Of the hull's support along unit d. 20 ns of ellipsoids and sphero-polyhedra that serve, 0.1 us by a
  // meridian, else find_hull_support. `start` may be null.
  HullPoint along(const Vec3& d, const HullPlace* start = nullptr) const;
  // The same of a direction near d, as far as that spares a search, with an upper bound along d that is a
  // little loose: for a first solid. 60 ns.
  HullPoint near(const Vec3& d) const;
  // d(point)/d(direction) in the tangent plane of d spanned by t and s, of a point found along `asked`, which
  // is near d: what the support function bends by. Zero at corners, of rank 1 on edges. False where there is
  // none: on faces and lines, and along the axis of what turns about it.
  bool turn(const HullPlace& at, const Vec3& d, const Vec3& asked, const Vec3& t, const Vec3& s,
            Mat2* turn) const;
  double error() const { return error_; }

 private:
  enum class Form { ellipsoid, points, meridian, patches };
  HullPoint on_ellipsoid(const Vec3& d) const;
  HullPoint of_points(const Vec3& d) const;
  bool on_meridian(const Vec3& d, const HullPlace* start, HullPoint* found) const;
  HullPoint on_patches(const Vec3& d, const HullPlace* start) const;

  const Shape& shape_;
  double enough_, error_ = 0;
  Form form_;
};

}  // namespace nurbs

// The support mapping by brute force: shares the surfaces and their evaluation with the library, nothing
// else.
#pragma once

#include <Eigen/Core>

#include "body/shape.h"

namespace nurbs::test {

// A body as some thousand surface points, patch by patch on a grid that includes the edges.
class SurfaceCloud {
 public:
  explicit SurfaceCloud(const Shape& shape);

  // Largest d . x over the cloud: below the support function by up to some 1e-3.
  double coarse(const Vec3& d) const;
  // The support function: the highest point of every patch that comes near the highest, followed uphill.
  double exact(const Vec3& d) const { return exact_point(d).dot(d); }
  Vec3 exact_point(const Vec3& d) const;

 private:
  double parameter(int i) const { return i / double(per_side_ - 1); }

  const Shape& shape_;
  int per_side_;
  Eigen::Array<double, Eigen::Dynamic, 3> points_;
  mutable Eigen::ArrayXd heights_;
};

}  // namespace nurbs::test

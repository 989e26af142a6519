// Vector, matrix and quaternion types used throughout.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace nurbs {

using Vec2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;
using Vec4 = Eigen::Vector4d;
using Mat2 = Eigen::Matrix2d;
using Mat3 = Eigen::Matrix3d;
using Quat = Eigen::Quaterniond;  // constructor order (w, x, y, z)

}  // namespace nurbs

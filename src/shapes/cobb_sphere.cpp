// The exact sphere as six biquartic rational patches: J. E. Cobb, Tiling the Sphere with Rational Bezier
// Patches, University of Utah UUCS-88-009 (1988), rebuilt from its stereographic image.
#include <algorithm>
#include <cmath>

#include "shapes/cube_net.h"
#include "shapes/primitives.h"

namespace nurbs {
namespace {

// Biquadratic control net (W X, W Y, W) in the plane of the +z face's stereographic image, projected from the
// south pole. The face's four great-circle edges become arcs of 30 degrees of circles of radius sqrt 2 about
// (-+1, 0) and (0, -+1); the middle point is the origin with weight 1.
Vec3 planar_point(int i, int j) {
  const double corner = (std::sqrt(3.0) - 1) / 2, weight = std::cos(M_PI / 12);
  const double side = std::sqrt(2.0) - weight;  // weight * (sqrt 2 / weight - 1)
  const int a = i - 1, b = j - 1;
  if (a != 0 && b != 0) return {a * corner, b * corner, 1};
  if (a != 0 || b != 0) return {a * side, b * side, weight};
  return {0, 0, 1};
}

// Share of the product of the quadratic Bernstein polynomials a and b in the quartic a + b.
double product_share(int a, int b) {
  static constexpr double kTwo[] = {1, 2, 1}, kFour[] = {1, 4, 6, 4, 1};
  return kTwo[a] * kTwo[b] / kFour[a + b];
}

// Biquartic control point (i, j) of the +z face: inverse stereographic projection
// (2 X W, 2 Y W, W^2 - X^2 - Y^2 : W^2 + X^2 + Y^2) of the planar net, multiplied out.
Vec4 face_point(int i, int j) {
  Vec4 sum = Vec4::Zero();
  for (int a = std::max(0, i - 2); a <= std::min(2, i); ++a) {
    for (int b = std::max(0, j - 2); b <= std::min(2, j); ++b) {
      const Vec3 p = planar_point(a, b), q = planar_point(i - a, j - b);
      const double xx = p[0] * q[0] + p[1] * q[1], ww = p[2] * q[2];
      sum += product_share(a, i - a) * product_share(b, j - b) *
             Vec4(p[0] * q[2] + q[0] * p[2], p[1] * q[2] + q[1] * p[2], ww - xx, ww + xx);
    }
  }
  return sum;
}

}  // namespace

std::vector<NurbsSurface> exact_ellipsoid(const Vec3& semi_axes) {
  constexpr int kDegree = 4;
  const CubeNet net(kDegree + 1);
  std::vector<Vec4> points(net.count());
  for (int f = 0; f < kCubeFaces; ++f) {
    const CubeFace face = cube_face(f);
    for (int i = 0; i <= kDegree; ++i) {
      for (int j = 0; j <= kDegree; ++j) {
        const Vec4 local = face_point(i, j);
        Vec4& p = points[net.index(f, i, j)];
        p[face.u] = local[0] * semi_axes[face.u];
        p[face.v] = local[1] * semi_axes[face.v];
        p[face.axis] = (face.high ? local[2] : -local[2]) * semi_axes[face.axis];
        p[3] = local[3];
      }
    }
  }
  return cube_surfaces(net, kDegree, uniform_knots(kDegree, 1), points);
}

}  // namespace nurbs

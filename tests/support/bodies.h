// Bodies shared by the contact tests, and their supports by exhaustive search.
#pragma once

#include <algorithm>
#include <memory>
#include <vector>

#include "body/shape.h"
#include "body/support.h"
#include "shapes/primitives.h"
#include "shapes/revolved.h"
#include "support/as_surface.h"

namespace nurbs::test {

using ShapePointer = std::shared_ptr<const Shape>;

inline ShapePointer closed_ellipsoid() {  // known to be one
  static const ShapePointer s = make_shape("closed", exact_ellipsoid(Vec3(1, 0.8, 0.6)));
  return s;
}
inline ShapePointer ellipsoid() {
  static const ShapePointer s = as_surface(*make_shape("ellipsoid", exact_ellipsoid(Vec3(1, 0.8, 0.6))));
  return s;
}
inline ShapePointer sphere() {
  static const ShapePointer s = make_shape("sphere", exact_ellipsoid(Vec3(1, 1, 1)));
  return s;
}
inline ShapePointer disc() {
  static const ShapePointer s = as_surface(*make_shape("disc", exact_ellipsoid(Vec3(1, 1, 0.1))));
  return s;
}
inline ShapePointer kinked() {  // bicubic, smooth only to a few mrad at the joints
  static const ShapePointer s = make_shape("kinked", fitted_ellipsoid(Vec3(1, 0.8, 0.6)));
  return s;
}
inline ShapePointer smooth_pebble() {
  static const ShapePointer s = make_shape("pebble", pebble());
  return s;
}
inline ShapePointer polar() {  // one patch, two poles and a seam
  static const ShapePointer s = as_surface(*make_shape("polar", revolved_ellipsoid(1, 0.5)));
  return s;
}
inline ShapePointer cuboid() {
  static const ShapePointer s = make_shape("cuboid", box(Vec3(1, 0.8, 0.6)));
  return s;
}

// Half a ball of radius 1 on a cylinder with a flat base, the ball's centre at the origin.
inline std::vector<NurbsSurface> bullet(double length) {
  return revolve({{Vec2(0, -length), Vec2::Zero(), Vec2(1, -length), 0},
                  {Vec2(1, -length), Vec2::Zero(), Vec2(1, 0), 0},
                  {Vec2(1, 0), Vec2(1, 1), Vec2(0, 1), std::sqrt(0.5)}});
}

inline std::vector<ShapePointer> smooth_shapes() {
  return {sphere(), ellipsoid(), disc(), smooth_pebble(), polar(), closed_ellipsoid()};
}
inline std::vector<ShapePointer> all_shapes() {
  return {sphere(), ellipsoid(), disc(), smooth_pebble(), polar(), closed_ellipsoid(), kinked(), cuboid()};
}

// Local maxima of d . x from starts all over the surface: the highest, and the next one elsewhere.
struct Maxima {
  double best = -1e300, rival = -1e300;
};
inline Maxima all_maxima(const Shape& shape, const Vec3& d) {
  Maxima found;
  Vec3 point = Vec3::Zero();
  for (size_t p = 0; p < shape.patches.size(); ++p)
    for (const double u : {0.1, 0.5, 0.9})
      for (const double v : {0.1, 0.5, 0.9}) {
        const SurfacePoint start{static_cast<int>(p), u, v};
        const Support s = find_support(shape, d, &start);
        const bool elsewhere = (s.point - point).norm() > 1e-5;
        if (s.h > found.best) {
          if (elsewhere) found.rival = found.best;
          found.best = s.h;
          point = s.point;
        } else if (elsewhere) {
          found.rival = std::max(found.rival, s.h);
        }
      }
  return found;
}
inline double exhaustive_support(const Shape& shape, const Vec3& d) {
  return all_maxima(shape, d).best;
}

// The support by a grid on every patch, drawn together about its best point: nothing of the library's search.
// Good to round-off on patches with one maximum a grid cell.
inline double sampled_support(const Shape& shape, const Vec3& d) {
  double best = -1e300;
  for (const BezierPatch& patch : shape.patches) {
    Vec2 low(0, 0), high(1, 1);
    for (int zoom = 0; zoom < 12; ++zoom) {
      const int n = zoom == 0 ? 40 : 10;
      double here = -1e300;
      Vec2 at;
      for (int i = 0; i <= n; ++i)
        for (int j = 0; j <= n; ++j) {
          const Vec2 t = low + (high - low).cwiseProduct(Vec2(i, j) / n);
          const double h = evaluate0(patch, t[0], t[1]).dot(d);
          if (h > here) here = h, at = t;
        }
      best = std::max(best, here);
      const Vec2 cell = 2 * (high - low) / n;
      low = (at - cell).cwiseMax(0);
      high = (at + cell).cwiseMin(1);
    }
  }
  return best;
}

}  // namespace nurbs::test

// Bodies of the benchmarks; see bodies.h.
#include "bench/bodies.h"

#include "shapes/primitives.h"
#include "support/as_surface.h"

namespace nurbs::bench {
const std::vector<Body>& smooth_bodies() {
  static const std::vector<Body> bodies = [] {
    const Vec3 ellipsoid(1, 0.8, 0.6), disc(1, 1, 0.1);
    std::vector<Body> made{
        {"ellipsoid", "exact ellipsoid 1 : 0.8 : 0.6",
         test::as_surface(*make_shape("ellipsoid", exact_ellipsoid(ellipsoid))), ellipsoid},
        {"pebble", "pebble, bicubic", make_shape("pebble", pebble()), Vec3::Zero()},
        {"blocky", "superellipsoid, exponent 4, bicubic",
         make_shape("blocky", fitted_superellipsoid(Vec3(1, 0.9, 0.8), 4, 3)), Vec3::Zero()},
        {"disc", "exact ellipsoid 1 : 1 : 0.1", test::as_surface(*make_shape("disc", exact_ellipsoid(disc))),
         disc}};
    for (const Body& body : made) body.shape->inner_map();  // as a run does
    return made;
  }();
  return bodies;
}

const Body& closed_ellipsoid() {
  static const Body body{"closed form", "ellipsoid 1 : 0.8 : 0.6, in closed form",
                         make_shape("ellipsoid", exact_ellipsoid(Vec3(1, 0.8, 0.6))), Vec3(1, 0.8, 0.6)};
  return body;
}

}  // namespace nurbs::bench

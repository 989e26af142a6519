// Bodies as a host holds them, for the stages of a step.
#pragma once

#include <vector>

#include "scene/bodies.h"

namespace nurbs::test {

struct HostBodies {
  std::vector<const Shape*> shapes;                     // by index
  std::vector<double> x, v, w, q, mass, scale, radius;  // q: w x y z
  std::vector<int> shape, mask;

  int count() const { return static_cast<int>(mass.size()); }

  // Bodies at rest, of the first shape and unit mass, to be placed.
  void resize(std::size_t bodies) {
    x.resize(3 * bodies);
    v.resize(3 * bodies);
    w.resize(3 * bodies);
    q.resize(4 * bodies);
    mass.resize(bodies, 1);
    scale.resize(bodies);
    radius.resize(bodies);
    shape.resize(bodies);
    mask.resize(bodies, 1);
  }

  void place(std::size_t i, const Vec3& at, const Particle& p) {
    Vec3::Map(&x[3 * i]) = at;
    turn(i, p.q);
    scale[i] = p.scale;
    radius[i] = p.scale * p.shape->bounding_radius;
  }
  void turn(std::size_t i, const Quat& to) {
    q[4 * i] = to.w();
    q[4 * i + 1] = to.x();
    q[4 * i + 2] = to.y();
    q[4 * i + 3] = to.z();
  }

  BodyArrays arrays() const {
    BodyArrays a;
    a.count = count();
    a.x = x.data();
    a.velocity = v.data();
    a.spin = w.data();
    a.quaternion = q.data();
    a.mass = mass.data();
    a.scale = scale.data();
    a.radius = radius.data();
    a.shape = shape.data();
    a.shapes = shapes.data();
    a.mask = mask.data();
    return a;
  }
};

}  // namespace nurbs::test

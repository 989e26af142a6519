#include "scene/bodies.h"

#include <cmath>

#include "contact/pair_memory.h"

namespace nurbs {
namespace {

// Euler: I dw/dt = -w x I w, in shape axes, where I / mass is `gyration` at scale 1.
Vec3 spin_earlier(const Shape& shape, const Vec3& w, double dt) {
  return w + dt * (shape.inverse_gyration * w.cross(shape.gyration * w));
}

}  // namespace

Particle Bodies::read(int i) const {
  Particle p;
  p.shape = arrays_.shapes[arrays_.shape[i]];
  p.scale = arrays_.scale[i];
  p.x = Vec3::Map(arrays_.x + 3 * i);
  const double* q = arrays_.quaternion + 4 * i;
  p.q = Quat(q[0], q[1], q[2], q[3]);
  if (!(std::abs(p.q.squaredNorm() - 1) <= kUnitTurn)) p.q.normalize();
  return p;
}

void Bodies::update(const BodyArrays& arrays, double dt, bool renumbered) {
  arrays_ = arrays;
  reshaped_ = false;
  if (count() != arrays.count) {
    records_.resize(arrays.count);
    known_.resize(arrays.count);
    path_.resize(arrays.count);
    renumbered = true;
  }
  for (int i = 0; i < arrays.count; ++i) update(i, dt, renumbered);
}

void Bodies::update(int i, double dt, bool renumbered) {
  BodyRecord& r = records_[i];
  Known& known = known_[i];
  const Particle p = read(i);
  const Shape& shape = *p.shape;
  if (renumbered || known.scale != p.scale || known.shape != p.shape) {
    reshaped_ = reshaped_ || !renumbered;
    known.scale = p.scale;
    known.shape = p.shape;
    known.stamp = nurbs::stamp(p);
    path_[i] = 0;
  } else {
    path_[i] += (p.x - Vec3::Map(r.x)).norm();
    if (!shape.proofs.sphere) path_[i] += r.radius * std::sqrt(turned2(p.q, known.q));
  }
  store(p.q, known.q);
  store(p.x, r.x);
  r.radius = arrays_.radius[i];
  r.inner = p.scale * shape.inner_radius;
  r.free = 1;
  r.flat = shape.flats.empty() ? 0 : 1;
  const Mat3 turn = p.q.toRotationMatrix();
  Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>{r.turn} = turn;
  const Vec3 spin = Vec3::Map(arrays_.spin + 3 * i);
  store(Vec3::Map(arrays_.velocity + 3 * i), r.velocity);
  store(spin, r.spin);
  store(spin, r.spin_before);
  double* inertia = r.inverse_inertia;
  if (arrays_.mask[i] & arrays_.immobile) {
    r.inverse_mass = 0;
    for (int k = 0; k < 6; ++k) inertia[k] = 0;
    return;
  }
  r.inverse_mass = 1 / arrays_.mass[i];
  const double factor = r.inverse_mass / (p.scale * p.scale);
  if (shape.sphere_like) {
    const double value = factor / shape.principal_gyration[1];
    for (int k = 0; k < 6; ++k) inertia[k] = k < 3 ? value : 0;
    return;
  }
  store(turn * spin_earlier(shape, turn.transpose() * spin, dt), r.spin_before);
  const Mat3 inverse = factor * (turn * shape.inverse_gyration * turn.transpose());
  inertia[0] = inverse(0, 0);
  inertia[1] = inverse(1, 1);
  inertia[2] = inverse(2, 2);
  inertia[3] = inverse(0, 1);
  inertia[4] = inverse(0, 2);
  inertia[5] = inverse(1, 2);
}

std::size_t Bodies::bytes() const {
  return records_.capacity() * sizeof(BodyRecord) + known_.capacity() * sizeof(Known) +
         path_.capacity() * sizeof(double);
}

}  // namespace nurbs

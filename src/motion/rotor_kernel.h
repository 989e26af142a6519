// The arithmetic of rotor.h for as many bodies as a Lane holds (Lane2, Lane4, Lane8 give the same bits).
#pragma once

#include <cmath>
#include <cstring>

#include "motion/half_turn.h"
#include "motion/rotor.h"

namespace nurbs::rotor_kernel {

// Vectors, quaternions and matrices of many bodies. Eigen's own fixed-size code works on one body's numbers
// side by side, which is slower by half than not doing so.
template <class Lane>
struct Vector {
  Lane x, y, z;
};

template <class Lane>
struct Quaternion {
  Lane w, x, y, z;
};

template <class Lane>
struct Matrix {
  Lane xx, xy, xz, yx, yy, yz, zx, zy, zz;
};

template <class Lane>
NURBS_INLINE void product(const Quaternion<Lane>& a, const Quaternion<Lane>& b, Quaternion<Lane>* out) {
  *out = {a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z, a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
          a.w * b.y + a.y * b.w + a.z * b.x - a.x * b.z, a.w * b.z + a.z * b.w + a.x * b.y - a.y * b.x};
}

template <class Lane>
NURBS_INLINE void to_matrix(const Quaternion<Lane>& q, Matrix<Lane>* out) {
  const Lane x = 2 * q.x, y = 2 * q.y, z = 2 * q.z;
  const Lane wx = q.w * x, wy = q.w * y, wz = q.w * z, xx = q.x * x, xy = q.x * y, xz = q.x * z, yy = q.y * y,
             yz = q.y * z, zz = q.z * z;
  *out = {1 - (yy + zz), xy - wz, xz + wy, xy + wz, 1 - (xx + zz), yz - wx, xz - wy, yz + wx, 1 - (xx + yy)};
}

template <class Lane>
NURBS_INLINE void to_lab(const Matrix<Lane>& m, const Vector<Lane>& v, Vector<Lane>* out) {
  *out = {m.xx * v.x + m.xy * v.y + m.xz * v.z, m.yx * v.x + m.yy * v.y + m.yz * v.z,
          m.zx * v.x + m.zy * v.y + m.zz * v.z};
}

template <class Lane>
NURBS_INLINE void to_shape(const Matrix<Lane>& m, const Vector<Lane>& v, Vector<Lane>* out) {
  *out = {m.xx * v.x + m.yx * v.y + m.zx * v.z, m.xy * v.x + m.yy * v.y + m.zy * v.z,
          m.xz * v.x + m.yz * v.y + m.zz * v.z};
}

// Component of v along column `column` of the rotor's axes, and the vector of this length along it.
template <class Lane>
NURBS_INLINE void along(const Rotor& rotor, int column, const Vector<Lane>& v, Lane* out) {
  *out = rotor.axes(0, column) * v.x + rotor.axes(1, column) * v.y + rotor.axes(2, column) * v.z;
}

template <class Lane>
NURBS_INLINE void times(const Rotor& rotor, int column, const Lane& length, Vector<Lane>* out) {
  *out = {rotor.axes(0, column) * length, rotor.axes(1, column) * length, rotor.axes(2, column) * length};
}

template <class Lane>
NURBS_INLINE void add(const Vector<Lane>& v, Vector<Lane>* to) {
  to->x += v.x;
  to->y += v.y;
  to->z += v.z;
}

template <class Lane>
NURBS_INLINE void load(const double* from, Lane* to) {
  std::memcpy(to, from, sizeof(Lane));
}

template <class Lane>
NURBS_INLINE void store(const Lane& from, double* to) {
  std::memcpy(to, &from, sizeof(Lane));
}

template <class Lane>
NURBS_INLINE void load_momentum(const RotorBatch& batch, int lane, Vector<Lane>* momentum) {
  load(batch.momentum[0] + lane, &momentum->x);
  load(batch.momentum[1] + lane, &momentum->y);
  load(batch.momentum[2] + lane, &momentum->z);
}

template <class Lane>
NURBS_INLINE void load_q(const RotorBatch& batch, int lane, Quaternion<Lane>* q) {
  load(batch.q[0] + lane, &q->w);
  load(batch.q[1] + lane, &q->x);
  load(batch.q[2] + lane, &q->y);
  load(batch.q[3] + lane, &q->z);
}

template <class Lane>
NURBS_INLINE void store_q(const Quaternion<Lane>& q, RotorBatch* batch, int lane) {
  store(q.w, batch->q[0] + lane);
  store(q.x, batch->q[1] + lane);
  store(q.y, batch->q[2] + lane);
  store(q.z, batch->q[3] + lane);
}

// Brings quaternions back to unit length, which round-off moved them away from: one Newton step for 1 /
// length, that leaves 3/8 of the square of the error in length^2. What is further away is normalised.
template <class Lane>
NURBS_INLINE void renormalise(Quaternion<Lane>* q) {
  constexpr int kLanes = sizeof(Lane) / sizeof(double);
  constexpr double kNear = 1e-8;
  const Lane square = q->w * q->w + q->x * q->x + q->y * q->y + q->z * q->z;
  Lane factor = 1.5 - 0.5 * square;
  const auto near = (square < 1 + kNear) & (square > 1 - kNear);
  auto all = near[0];
  for (int k = 1; k < kLanes; ++k) all &= near[k];
  if (__builtin_expect(all == 0, 0))
    for (int k = 0; k < kLanes; ++k)
      if (!near[k]) factor[k] = 1 / std::sqrt(square[k]);
  *q = {q->w * factor, q->x * factor, q->y * factor, q->z * factor};
}

// What the angular velocity has besides middle * momentum, from the momentum l along rotor.axes (its third
// component does not matter); shape axes.
template <class Lane>
NURBS_INLINE void excess_velocity(const Rotor& rotor, const Vector<Lane>& l, Vector<Lane>* excess) {
  times(rotor, 1, Lane(rotor.second * l.y), excess);
  if (rotor.kind != Rotor::Kind::asymmetric) return;
  Vector<Lane> more;
  times(rotor, 0, Lane(rotor.first * l.x), &more);
  add(more, excess);
}

// inverse_size * (middle * momentum + excess), stored; `excess` in shape axes, not looked at for a sphere.
template <class Lane>
NURBS_INLINE void store_velocity(const Rotor& rotor, const Matrix<Lane>& turn, const Vector<Lane>& momentum,
                                 const Vector<Lane>& excess, const Lane& inverse_size, RotorBatch* batch,
                                 int lane) {
  Vector<Lane> velocity{rotor.middle * momentum.x, rotor.middle * momentum.y, rotor.middle * momentum.z};
  if (rotor.kind != Rotor::Kind::sphere) {
    Vector<Lane> more;
    to_lab(turn, excess, &more);
    add(more, &velocity);
  }
  store(Lane(inverse_size * velocity.x), batch->velocity[0] + lane);
  store(Lane(inverse_size * velocity.y), batch->velocity[1] + lane);
  store(Lane(inverse_size * velocity.z), batch->velocity[2] + lane);
}

// Quaternion (cosine, sine, 0, 0) of half an angle x about an axis, and what the whole angle does to the
// momentum in the body: it turns against the body.
template <class Lane>
struct AxisTurn {
  Lane cosine, sine;
};

template <class Lane>
NURBS_INLINE void axis_turn(const Lane& x, AxisTurn<Lane>* turn) {
  HalfTurn<Lane> half;
  half_turn(Lane(x * x), &half);
  *turn = {half.cosine, half.sinc * x};
}

template <class Lane>
NURBS_INLINE void turn_back(const AxisTurn<Lane>& turn, Lane* next, Lane* last) {
  const Lane cosine = 1 - 2 * turn.sine * turn.sine, sine = 2 * turn.sine * turn.cosine;
  const Lane before = *next;
  *next = before * cosine + *last * sine;
  *last = *last * cosine - before * sine;
}

// Rotations of an asymmetric body about its first, second and again first axis, in shape axes; `l`, the
// momentum along rotor.axes, goes with it.
template <class Lane>
NURBS_INLINE void turn_in_body(const Rotor& rotor, const Lane& time, Vector<Lane>* l, Quaternion<Lane>* q) {
  const Lane first = 0.25 * rotor.first * time, second = 0.5 * rotor.second * time;
  AxisTurn<Lane> a, b, c;
  axis_turn(Lane(first * l->x), &a);
  turn_back(a, &l->y, &l->z);
  axis_turn(Lane(second * l->y), &b);
  turn_back(b, &l->z, &l->x);
  axis_turn(Lane(first * l->x), &c);
  turn_back(c, &l->y, &l->z);

  // (a, 0, 0) (0, b, 0), then times (c, 0, 0).
  const Quaternion<Lane> two{a.cosine * b.cosine, a.sine * b.cosine, a.cosine * b.sine, a.sine * b.sine};
  Vector<Lane> x, y, z;
  times(rotor, 0, Lane(two.w * c.sine + two.x * c.cosine), &x);
  times(rotor, 1, Lane(two.y * c.cosine + two.z * c.sine), &y);
  times(rotor, 2, Lane(two.z * c.cosine - two.y * c.sine), &z);
  *q = {two.w * c.cosine - two.x * c.sine, x.x + y.x + z.x, x.y + y.y + z.y, x.z + y.z + z.z};
}

// As ::drift, of the bodies in lanes `lane` and following.
template <class Lane>
NURBS_INLINE void drift(const Rotor& rotor, double dt, RotorBatch* batch, int lane) {
  Vector<Lane> momentum;
  Quaternion<Lane> q;
  Lane inverse_size;
  load_momentum(*batch, lane, &momentum);
  load_q(*batch, lane, &q);
  load(batch->inverse_size + lane, &inverse_size);
  const Lane time = inverse_size * dt;

  Vector<Lane> l{}, excess{};
  Matrix<Lane> turn{};
  if (rotor.kind != Rotor::Kind::sphere) {
    Vector<Lane> in_shape;
    Quaternion<Lane> in_body, turned;
    to_matrix(q, &turn);
    to_shape(turn, momentum, &in_shape);
    along(rotor, 1, in_shape, &l.y);
    if (rotor.kind == Rotor::Kind::top) {
      AxisTurn<Lane> about;
      Vector<Lane> vector;
      axis_turn(Lane(0.5 * rotor.second * time * l.y), &about);
      times(rotor, 1, about.sine, &vector);
      in_body = {about.cosine, vector.x, vector.y, vector.z};
    } else {
      along(rotor, 0, in_shape, &l.x);
      along(rotor, 2, in_shape, &l.z);
      turn_in_body(rotor, time, &l, &in_body);
    }
    product(q, in_body, &turned);
    q = turned;
    excess_velocity(rotor, l, &excess);
  }

  const Lane half = 0.5 * rotor.middle * time;
  const Vector<Lane> x{half * momentum.x, half * momentum.y, half * momentum.z};
  HalfTurn<Lane> about;
  half_turn(Lane(x.x * x.x + x.y * x.y + x.z * x.z), &about);
  const Quaternion<Lane> about_momentum{about.cosine, about.sinc * x.x, about.sinc * x.y, about.sinc * x.z};
  Quaternion<Lane> turned;
  product(about_momentum, q, &turned);
  renormalise(&turned);
  store_q(turned, batch, lane);

  if (rotor.kind != Rotor::Kind::sphere) to_matrix(turned, &turn);
  store_velocity(rotor, turn, momentum, excess, inverse_size, batch, lane);
}

// As ::find_angular_velocity, of the bodies in lanes `lane` and following.
template <class Lane>
NURBS_INLINE void find_angular_velocity(const Rotor& rotor, RotorBatch* batch, int lane) {
  Vector<Lane> momentum, l{}, excess{};
  Lane inverse_size;
  load_momentum(*batch, lane, &momentum);
  load(batch->inverse_size + lane, &inverse_size);
  Matrix<Lane> turn{};
  if (rotor.kind != Rotor::Kind::sphere) {
    Quaternion<Lane> q;
    Vector<Lane> in_shape;
    load_q(*batch, lane, &q);
    to_matrix(q, &turn);
    to_shape(turn, momentum, &in_shape);
    along(rotor, 1, in_shape, &l.y);
    if (rotor.kind == Rotor::Kind::asymmetric) along(rotor, 0, in_shape, &l.x);
    excess_velocity(rotor, l, &excess);
  }
  store_velocity(rotor, turn, momentum, excess, inverse_size, batch, lane);
}

}  // namespace nurbs::rotor_kernel

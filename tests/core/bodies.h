// Bodies and random placements shared by the contact tests.
#pragma once

#include <cmath>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "body/shape.h"
#include "body/support.h"
#include "contact/contact.h"
#include "shapes/primitives.h"

namespace nurbs::test {

using ShapePointer = std::shared_ptr<const Shape>;

inline ShapePointer ellipsoid() {
  static const ShapePointer s = make_shape("ellipsoid", exact_ellipsoid(Vec3(1, 0.8, 0.6)));
  return s;
}
inline ShapePointer sphere() {
  static const ShapePointer s = make_shape("sphere", exact_ellipsoid(Vec3(1, 1, 1)));
  return s;
}
inline ShapePointer disc() {
  static const ShapePointer s = make_shape("disc", exact_ellipsoid(Vec3(1, 1, 0.1)));
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
  static const ShapePointer s = make_shape("polar", revolved_ellipsoid(1, 0.5));
  return s;
}
inline ShapePointer cuboid() {
  static const ShapePointer s = make_shape("cuboid", box(Vec3(1, 0.8, 0.6)));
  return s;
}

inline std::vector<ShapePointer> smooth_shapes() {
  return {sphere(), ellipsoid(), disc(), smooth_pebble(), polar()};
}
inline std::vector<ShapePointer> all_shapes() {
  return {sphere(), ellipsoid(), disc(), smooth_pebble(), polar(), kinked(), cuboid()};
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

class Random {
 public:
  explicit Random(unsigned seed) : engine_(seed) {}
  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  Vec3 direction() {
    std::normal_distribution<double> n;
    return Vec3(n(engine_), n(engine_), n(engine_)).normalized();
  }
  Quat turn() {
    std::normal_distribution<double> n;
    return Quat(n(engine_), n(engine_), n(engine_), n(engine_)).normalized();
  }
  // Turn by `angle` about a random axis.
  Quat turn_by(double angle) { return Quat(Eigen::AngleAxisd(angle, direction())); }

 private:
  std::mt19937_64 engine_;
};

struct Pair {
  Particle a, b;
};

// Random orientations; the supports along a random direction are `gap` apart (< 0: overlapping) along it, so
// the true gap is `gap` for smooth bodies that are apart or overlap little.
inline Pair random_pair(Random& random, const Shape& sa, const Shape& sb, double gap,
                        Vec3* direction = nullptr) {
  Pair pair;
  pair.a.shape = &sa;
  pair.b.shape = &sb;
  pair.a.q = random.turn();
  pair.b.q = random.turn();
  pair.b.scale = random.uniform(0.5, 1.5);
  const Vec3 d = random.direction();
  const Vec3 on_a = pair.a.q * find_support(sa, pair.a.q.conjugate() * d).point;
  const Vec3 on_b = pair.b.q * find_support(sb, pair.b.q.conjugate() * -d).point;
  pair.b.x = on_a - pair.b.scale * on_b + gap * d;
  if (direction) *direction = d;
  return pair;
}

// p(d) = h_A(d) + h_B(-d) - d . (x_B - x_A), d in the lab.
inline double overlap_along(const Particle& a, const Particle& b, const Vec3& d) {
  return a.scale * find_hull_support(*a.shape, a.q.conjugate() * d).h +
         b.scale * find_hull_support(*b.shape, b.q.conjugate() * -d).h - d.dot(b.x - a.x);
}

}  // namespace nurbs::test

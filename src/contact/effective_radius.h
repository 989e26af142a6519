// Effective radius of a contact by elliptical Hertz theory, from the curvature of both bodies where they
// touch.
#pragma once

#include "contact/pair_memory.h"

namespace nurbs {

// Where the effective radius exceeds this many times the smaller bounding radius, the contact counts as flat.
constexpr double kFlatRadius = 8;
// A surface whose normal is further from the contact's (rad, squared) meets it in a crease or a corner.
constexpr double kCreaseAngle2 = 0.05 * 0.05;
constexpr double kBesidePole = 1e-4;  // errors of truncation and of round-off are both below 1e-6 there

// Curvature of a body's surface at a contact: a symmetric tensor of the tangent plane in lab axes, 1 /
// length, positive for convex; zero for a plane. Unknown at creases and corners.
struct SurfaceCurvature {
  Mat3 tensor = Mat3::Zero();
  bool known = false;
};

// Of a body's surface at a point, from one evaluation (30 ns); `outward` is the contact's normal, away from
// the body. At a pole it is that beside it, kBesidePole of the patch away. Along a flat face's normal, and
// where an edge leans from it by less than kCreaseAngle2, it is the face's, wherever on it the point may be.
SurfaceCurvature curvature_at(const Particle& particle, const PointMemory& point, const Vec3& outward);
inline SurfaceCurvature plane_curvature() {
  return {Mat3::Zero(), true};
}

// Of a cylinder of this radius about a unit axis through `origin`, met at `point` with unit `normal` towards
// the body: negative where the body is inside.
SurfaceCurvature cylinder_curvature(const Vec3& origin, const Vec3& axis, double radius, const Vec3& point,
                                    const Vec3& normal);

// R_eff of two surfaces with the relative principal curvatures k_a, k_b (1 / length, > 0): the sphere on a
// plane that is as stiff, F = 4/3 E* sqrt(R_eff) overlap^1.5. With x = ln((k_a + k_b) / (2 sqrt(k_a k_b)))
//     R_eff = exp(0.33249 x + 0.07766 x^2 - 0.00461 x^3) / sqrt(k_a k_b),
// a fit to the elliptic integrals: sqrt(R_eff), and with it the force, is within 6e-5 up to k_b / k_a = 100.
double hertz_radius(double k_a, double k_b);

// Curvatures of two spheres that touch as the bodies do. Their sum is 1 / R_eff, divided as the bodies' mean
// curvatures are: two spheres get their own, a plane zero.
struct SphereCurvatures {
  double a, b;
};
// Where a curvature is unknown or the contact is flat (kFlatRadius) R_eff is `cap`, the smaller bounding
// radius. `plane`: A is one, or another wall; the whole is then B's.
SphereCurvatures sphere_curvatures(const SurfaceCurvature& a, const SurfaceCurvature& b, const Vec3& normal,
                                   double cap, bool plane);
inline SphereCurvatures flat_curvatures(double cap, bool plane) {
  return plane ? SphereCurvatures{0, 1 / cap} : SphereCurvatures{0.5 / cap, 0.5 / cap};
}

}  // namespace nurbs

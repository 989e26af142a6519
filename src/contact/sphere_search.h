// Bodies that are spheres, to round-off or within the tolerance, in closed form.
#pragma once

#include <cmath>

#include "contact/pair_memory.h"
#include "nurbs/tolerances.h"

namespace nurbs {

// How near a body is to a ball about its centre of mass, at scale 1. Proven, from its radii and curvature
// bounds (enclosures, not samples).
struct Roundness {
  double radius;  // the mean of inner and bounding radius
  double width;   // their difference
  double slope;   // no outward normal is further from the direction of its point than this, rad
};

// The support function h about the centre of mass lies between the two radii, which differ by `width`, and
// h'' + h along any great circle is a radius of curvature. Where h has slope g it goes on to change by g^2 /
// (2 m) at least, with m a bound of h'' of the right sign: g <= sqrt(2 width m), and the normal at the
// support point is atan(g / h) off its direction. What is a sphere to round-off (kSphere) is taken as one.
inline Roundness roundness(const Shape& s) {
  const double outer = s.bounding_radius, inner = s.inner_radius, width = outer - inner;
  const double bend = std::fmax(0, std::fmin(outer - s.curvature.min_radius, s.curvature.max_radius - inner));
  return {0.5 * (inner + outer), width, s.proofs.sphere ? kSphere : std::sqrt(2 * width * bend) / inner};
}

// Whether it is a ball as far as a gap right to `allowed` (length) and a normal right to `angle` (rad) can
// tell.
inline bool is_round(const Particle& p, double allowed, double angle) {
  return p.scale * (p.shape->bounding_radius - p.shape->inner_radius) <= allowed &&
         roundness(*p.shape).slope <= angle;
}

// Gap, normal along the line of centres and points of two such bodies, about 20 ns; false, and nothing done,
// where they are none or their centres coincide. The bracket is that of the balls inside and around the
// bodies, so that it holds whatever they are; its width is at most `tolerance` times the smaller bounding
// radius. The turns of the bodies don't enter. Where the result is no proof of distance, and the bodies are
// spheres to round-off, a local model that holds on all of the surface is left in `memory`; where they are
// spheres by tolerance only there is none, nor are there surface points.
bool solve_spheres(const Particle& a, const Particle& b, const ContactSettings& settings, PairMemory& memory,
                   ContactResult* r);

// The same of a body whose centre is `height` above a plane with unit `normal`; points as
// find_plane_contact's.
bool solve_sphere_on_plane(const Particle& particle, double height, const Vec3& normal,
                           const ContactSettings& settings, PairMemory& memory, ContactResult* r);

}  // namespace nurbs

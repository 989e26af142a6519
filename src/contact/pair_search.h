// The ladder for one neighbour pair, cheapest rung first, and the memory it keeps between steps.
#pragma once

#include "contact/contact.h"

namespace nurbs {

// Everything a pair remembers, as plain doubles. All zeros is an empty memory; memory of other bodies, of
// another size or another solver counts as empty. The layout is in pair_memory.h.
constexpr int kPairMemorySize = 54;

// Gap, normal and contact points of two particles. The rungs, each a function of pair_search.cpp: the budget
// of the last proof and the bounding spheres (7 ns); spheres and ellipsoids in closed form (20 and 170 ns;
// sphere_search.h, ellipsoid_search.h), sphero-polyhedra by the distance of their cores (0.1 us where the
// contact goes on; core_search.h); the direction atlases (80 ns); the local model (65 ns);
// Newton from the last contact (0.25 us, 0.7 us next to a dent, 1.5 us over it, 1 us on sharp edges and
// vertices; joint_newton.h, bridge_search.h, edge_search.h), where that is on a face or two straight creases
// along their known direction (0.5 us; flat_search.h); a cold start (2 us); the
// search over directions of deep pairs (10 us); the polytope (70 us and more). A pair that touched last time
// begins at the local model. Neither throws nor allocates, but for a shape's inner map, which is made where a
// bracket stays open without it (one deep pair in 5,000); always returns a bracket. Deep pairs of shapes
// whose inner maps are there (Shape::inner_map(), asked for before) take a tenth to a half less time; their
// bracket is another one of the same answer, within the tolerance.
//
// The overlap is the global minimum of p(d) over all directions, however deep. As such it changes by no more
// than the bodies' relative translation, and under a turn by no more than the way of the outermost point:
// overlap, size of the force and energy are continuous whatever the bodies do. Where another minimum takes
// over, normal and contact points jump. Smooth bodies that overlap by less than the sum of their least
// curvature radii have one minimum only.
//
// Accuracy, at `tolerance` t: the bracket of a converged gap is at most t times the smaller bounding radius
// wide; that is proven. The force is better, by estimates that are no proofs: the normal is right to about t
// rad, the overlap to about t times itself, or t times kForceDepth of the radius where it is shallower, hence
// a force kn overlap or kn overlap^1.5 along the normal to about t of its size. Newton's last update squares
// an angle of at most sqrt(t); the local model serves while what it left out says so. Not held to it:
// contacts that only the polytope resolves, on kinks and in deep overlap, and those next to a pole,
// where normals are right to about sqrt(t).
//
// Deterministic: the result depends only on the arguments, and callers pass the particles in tag order.
ContactResult find_contact(const Particle& a, const Particle& b, const ContactSettings& settings,
                           double* memory);

// The same for a plane through `origin` with unit `normal` (pointing to the particle's side). A is the plane,
// so result.normal equals `normal`; both points are relative to the PARTICLE's centre of mass here.
ContactResult find_plane_contact(const Particle& particle, const Vec3& origin, const Vec3& normal,
                                 const ContactSettings& settings, double* memory);

}  // namespace nurbs

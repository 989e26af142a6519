// Random pebbles: smooth, strictly convex, six bicubic patches of smooth joints.
#pragma once

#include <cstdint>
#include <vector>

#include "nurbs/nurbs_surface.h"

namespace nurbs {

// Elongation I/L and flatness S/I are those of the ellipsoid with the same second moments, its axes L >= I >=
// S along x, y, z; they are met to round-off. Roundness 1 is that ellipsoid's smooth body; less is a more
// angular one: the share of a ball in a Minkowski sum with a rounded random polyhedron, before stretching.
struct PebbleForm {
  double roundness = 0.5, elongation = 0.8, flatness = 0.7;  // in [0, 1], [0.2, 1], [0.2, 1]
  double radius = 1;                                         // of the sphere of the same volume
};

// The same on every machine for the same seed and form. Convex by its support function
//     h(n) = roundness |n| + (1 - roundness) (sum of max(0, v_k . n)^q)^(1/q),
// v_k scattered over a sphere; where the patches would lose that, the roundness used is raised step by step.
// About 5 ms.
std::vector<NurbsSurface> random_pebble(std::uint64_t seed, const PebbleForm& form);

}  // namespace nurbs

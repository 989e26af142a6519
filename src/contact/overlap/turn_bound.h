// Lower bounds of a body's inverse Weingarten map W about a direction, as far from it as anything is known.
#pragma once

#include <array>

#include "body/inner_map.h"
#include "contact/local_bend.h"

namespace nurbs {

constexpr double kOffNormal = 1e-6;  // rad, given away for round-off of angles

// From the support's own W and rate, and from the balls of the inner map; lengths of the lab.
struct TurnBound {
  LocalBend local;
  double least = 0;                                           // eigenvalue of its turn
  std::array<double, kInnerCaps.size()> ball{}, within{};     // radius for directions within an angle of d
  std::array<double, kStretchCaps.size()> stretch{}, near{};  // the same from finer cells
};

// Of a body in its own axes, `at` its support along unit d; t and s span the plane of d. Nothing is known of
// dented bodies and joints that gape.
TurnBound bound_turn(const Shape& shape, double scale, const SurfacePoint& at, const Vec3& d, const Vec3& t,
                     const Vec3& s);

// A lower bound of W at d, as a form, less `rate` (which is added to) times the angle, for directions within
// `to` of d, rad.
Mat2 least_turn(const TurnBound& bound, double to, double* rate);

// W is no less than this for directions within `to` of d.
double least_radius(const TurnBound& bound, double to);

}  // namespace nurbs

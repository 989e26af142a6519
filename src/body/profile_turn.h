// Which way and how fast a piece of a meridian turns, as polynomials.
#pragma once

#include <vector>

#include "body/meridian.h"
#include "nurbs/bernstein.h"

namespace nurbs {

// Of a rational curve (R, Z) / w, lengths over the body's size, with C = (R, Z, w): the velocity is N / w^2,
// N = (R'w - R w', Z'w - Z w'), and its curvature radius |N|^3 / (w^3 det(C, C', C'')).
struct ProfileTurn {
  Bernstein<Vec2> velocity;       // N
  Bernstein<double> det, weight;  // coefficients may be off by their noise
  double velocity_noise = 0, det_noise = 0;
  double side = 1;  // side * (N_z, -N_r) points out of the body; side * det >= 0 where it bulges
};

// `patches` say which side is outside.
ProfileTurn profile_turn(const Meridian& meridian, const Meridian::Piece& piece,
                         const std::vector<BezierPatch>& patches, double size);

// Per patch: whether a piece of the profile sweeps it that turns one way only, outward, and never faces the
// axis. No curvature of such a patch is negative, up to round-off: one is the profile's, the other how much
// the normal points away from the axis over the distance from it. Where that goes to zero, at the rim of a
// flat face, enclosures never show it. Proven from Bernstein coefficients.
std::vector<bool> bulging_patches(const Meridian& meridian, const std::vector<BezierPatch>& patches,
                                  double size);

}  // namespace nurbs

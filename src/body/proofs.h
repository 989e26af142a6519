// What is proven of a body, in words, for reports.
#pragma once

#include <string>
#include <vector>

#include "body/shape.h"

namespace nurbs {

// Whether a body is proven to have no dents at all, up to gaps at its joints and curvatures of round-off
// (kCurvatureNoise over its radius). Theorem (Tietze 1928, Nakajima 1928; van Heijenoort 1952 for surfaces
// that may pass through themselves): a closed, bounded, connected surface that is locally convex everywhere
// bounds a convex body. In space, single points need not be looked at if the surface winds about them once: a
// solid whose other points are all locally convex is so there too (Klee 1951). Hypotheses, each checked:
// closed, connected and facing one way (make_shape refuses the rest); inside the patches no enclosed cell has
// negative curvature; no joint closes by more than kNoKink, none is paired point by point; about each corner
// and pole the patches' directions add up to one turn, an integer, which is counted on samples.
bool proven_without_dents(const Shape& shape);

// One line each on convexity, curvature radii, their rate of change, joints and dents, with how tight the
// bounds are; and on what is not proven, if anything.
std::vector<std::string> describe_proofs(const Shape& shape);

}  // namespace nurbs

// What is proven of a body, in words, for reports.
#pragma once

#include <string>
#include <vector>

#include "body/shape.h"

namespace nurbs {

// One line each on convexity, curvature radii, their rate of change, joints and dents, with how tight the
// bounds are; and on what is not proven, if anything.
std::vector<std::string> describe_proofs(const Shape& shape);

}  // namespace nurbs

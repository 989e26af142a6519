// Where a corner of one patch lies inside the edge of another: the two sides of a joint are cut differently.
#pragma once

#include <vector>

#include "body/connectivity.h"

namespace nurbs {

// A corner inside edge `edge` of `patch` (numbered as in EdgeLink), at parameter `t` of it, in (0,1).
struct TJunction {
  int patch = 0, edge = 0;
  double t = 0;
};

// The corners of unmatched edges that lie on others within `tolerance` (length) and further than that from
// the ends and from each other: cutting the patches there makes the two sides agree, where they are the same
// curve. O(n^2) box tests for n unmatched edges.
std::vector<TJunction> find_t_junctions(const std::vector<BezierPatch>& patches, const PatchLinks& links,
                                        double tolerance);

}  // namespace nurbs

// Whether two bodies overlap, and not by how much.
#pragma once

#include <optional>

#include "contact/pair_frame.h"

namespace nurbs {

// The distance algorithm of Gilbert, Johnson & Keerthi (1988) on the supports: false where the bodies are
// apart by more than `tolerance` (a length) along some direction, true where points of both surround the
// origin of their difference, points that may lie outside by as much. Nothing where neither is seen in a few
// steps, as of bodies that hardly touch. 1 us as a rule, some 10 us where they nearly touch.
std::optional<bool> test_overlap(const PairFrame& pair, double tolerance);

}  // namespace nurbs

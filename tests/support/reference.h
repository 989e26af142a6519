// The answer that errors are measured against: a contact polished in long double with code of its own.
#pragma once

#include "support/pairs.h"

namespace nurbs::test {

struct Reference {
  double gap = 0;
  Vec3 normal = Vec3::Zero(), point_a = Vec3::Zero(), point_b = Vec3::Zero();  // as in ContactResult
  bool polished =
      false;  // false: Newton left the patches (contact on a kinked joint); ours at 1e-14 is given
};

// Ours at tolerance 1e-14 names the patches and the starting parameters; Newton on the four parameters in
// long double, on the Bezier control points as they are, gives the contact to about 1e-18. That it is the
// global one is what the certificate says, not this function.
Reference make_reference(const Pair& pair);

}  // namespace nurbs::test

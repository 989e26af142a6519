// Joints that count as smooth and are so but for kNoKink, as files of few digits have them: what they take
// from the balls that roll inside and around a body.
#pragma once

#include <algorithm>
#include <array>
#include <limits>
#include <vector>

#include "nurbs/types.h"

namespace nurbs {

struct EdgeLink;

// Along a great circle of directions from d let h be the support function, r a lower bound of the patches'
// radii, and beta a bound of the kinks that are met at once (kGapsCrossed of the largest). In the sense of
// measures h'' + h >= r but within the kinks' fans, which are beta wide, where it is not negative; so that
// what h has over a ball of radius r' < r that touches where d is supported is, t further on,
//     y(t) >= (r - r') (1 - cos t) - r beta sin t >= -r^2 beta^2 / (2 (r - r')).
// With r' = r (1 - share r) that is -beta^2 / (2 share), whatever r is: such balls rise above the body by no
// more than `slack`. A ball of r' <= r / 2 rises by at most r' beta sin t, and by 2 r' beta^2 wherever: next
// to a much smaller body, whose touching balls need not be larger than that, it is that body's size that
// counts. Of closing kinks the same holds of balls around it. Kinks one after the other bend what lies
// between them by `density` of a radius besides. Hypotheses: no more than kGapsCrossed are met at once, and
// in a radian no more than the body has patches.
struct SmallKinks {
  double met = 0;      // beta, rad; 0 where it is round-off
  double share = 0;    // over a length of scale 1
  double density = 0;  // kinks times patches, rad a rad
  double slack = 0;    // length of scale 1; 0 where it is round-off

  // A ball that rolls inside, by the patches' least radius; and around, by their largest.
  double inside(double radius) const {
    const double bent = radius * (1 - density);
    return 2 * share * bent < 1 ? bent * (1 - share * bent) : 0.25 / share;
  }
  double outside(double radius) const {
    const double bent = radius * (1 + density);
    return bent < std::numeric_limits<double>::infinity() ? bent * (1 + share * bent) : bent;
  }

  // What the support function may exceed a ball around the body by, `chord` from the direction in which that
  // touches: of the patches' largest radius, and of outside(that), where an infinite one serves.
  double excess(double radius, double chord) const { return radius * met * chord; }
  double excess_outside(double radius, double chord) const { return std::min(slack, excess(radius, chord)); }
};
template <class Archive>
void archive(Archive& a, SmallKinks& s) {
  auto& [met, share, density, slack] = s;
  a(met, share, density, slack);
}

// Of links whose kinks are bounded; `size`: bounding radius.
SmallKinks find_small_kinks(const std::vector<std::array<EdgeLink, 4>>& links, double size);

}  // namespace nurbs

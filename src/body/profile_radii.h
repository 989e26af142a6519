// How strongly a meridian bends, by the angle of its normal from the axis: what rings of directions about the
// axis (contact/overlap/ring_search.h) know of a body of revolution between two of its circles.
#pragma once

#include <vector>

#include "body/meridian.h"
#include "nurbs/tolerances.h"

namespace nurbs {

// With H(alpha) the support function of a profile in its half plane, alpha the angle from the axis,
//     H'' + H >= the cell's value   (as a measure: a line, or a bridged dent, adds to it)
// for all alpha of a cell. Radii are those of all points that have their normals there, proven from Bernstein
// coefficients; cells that kinks of more than kProfileKink reach into have 0.
struct ProfileRadii {
  // Lengths, of kProfileCells cells over the angle: a tree of minima, leaves last. Empty: nothing is known.
  std::vector<float> least;
  double kinks = 0;  // rad: of those left out, all together, which the above does not hold within

  // For all angles within `reach` (rad) of the one of this cosine and sine; 0 where nothing is known.
  double within(double cosine, double sine, double reach) const;
};
template <class Archive>
void archive(Archive& a, ProfileRadii& s) {
  auto& [least, kinks] = s;
  a(least, kinks);
}

// Of an empty meridian empty. `patches` say which side is outside. Kinks up to `kink` are left out. About 1
// ms.
ProfileRadii make_profile_radii(const Meridian& meridian, const std::vector<BezierPatch>& patches,
                                double size, double kink = kProfileKink);

}  // namespace nurbs

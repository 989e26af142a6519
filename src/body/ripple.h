// How a patch whose file has few digits is off the product of a profile and an arc that it would be: not by
// how much only, but how smoothly round the axis, so that what it is off by in one direction tells of those
// near.
#pragma once

#include <algorithm>
#include <vector>

#include "nurbs/types.h"

namespace nurbs {

// Homogeneous coordinates of a patch's net about an axis, arcs first. Longer than double: what is left of
// differences is the surface's own round-off, not theirs.
struct ArcNet {
  using Real = long double;
  using Point = Eigen::Matrix<Real, 4, 1>;
  int arc = 0, profile = 0;   // degrees
  std::vector<Point> points;  // x, y, z, w
  const Point& at(int i, int j) const { return points[static_cast<size_t>(i) * (profile + 1) + j]; }
};

// Of the points on one parameter line round the axis, as functions of the azimuth that the arc gives them:
// distance from the axis, in the half plane of that azimuth, and height, as a vector. Lengths.
struct Ripple {
  double most = 0;   // what it is off the product's circle by, at most
  double slope = 0;  // its first derivative by the azimuth, at most ...
  double bend = 0;   // ... and its second
  double along = 0;  // its first derivative by the profile's parameter, at most

  void include(const Ripple& other, double factor = 1) {
    most = std::max(most, factor * other.most);
    slope = std::max(slope, factor * other.slope);
    bend = std::max(bend, factor * other.bend);
    along = std::max(along, factor * other.along);
  }
  void add(double factor, const Ripple& other) {
    most += factor * other.most;
    slope += factor * other.slope;
    bend += factor * other.bend;
    along += factor * other.along;
  }
};
template <class Archive>
void archive(Archive& a, Ripple& s) {
  auto& [most, slope, bend, along] = s;
  a(most, slope, bend, along);
}

// Homogeneous coordinates of an arc of, nearly, a unit circle about the axis, in Bernstein form.
struct UnitArc {
  std::vector<long double> x, y, w;
};

// Of a net, and the product near it of the arc and a profile, of speed `speed` at most: for each of the
// profile's control points its share, so that at a parameter the ripple is no more than their mean by the
// rational Bernstein polynomials there (near a tip it is small). Proven from coefficients of parts of the
// arc; none where that is not proven to go round one way.
std::vector<Ripple> ripple_of(const ArcNet& net, const ArcNet& product, const UnitArc& arc, double speed);

}  // namespace nurbs

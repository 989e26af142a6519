// Bodies with dents too narrow or too shallow for samples to show, and the supports of their convex hulls,
// found from what they are made of.
#pragma once

#include <functional>
#include <vector>

#include "nurbs/nurbs_surface.h"
#include "nurbs/types.h"

namespace nurbs::test {

struct HiddenDent {
  std::vector<NurbsSurface> surfaces;        // of the file; nothing is centred
  Vec3 normal;                               // unit, of the hull over the dent
  double width = 0;                          // of the normals there, rad, roughly
  double depth = 0;                          // below the hull; 0: not known
  std::function<Vec3(const Vec3&)> support;  // of the hull along any direction
};

// Blocks, x and y from -1 to 1, with a flat base at z = -2 and z = f(x) - dome y^2 / 2 on top.
// f'' = -bend ((x - x0)^2 - w^2): a groove 2 w wide and 3 bend w^4 / 4 deep.
HiddenDent grooved_block(double bend, double w, double x0, double slope, double dome);
// f'' = -bend but at x0, where the slope rises by `close`: two panels that close by that, rad.
HiddenDent valley_block(double bend, double close, double x0, double slope, double dome);

// A frustum, radius 1 to 0.6 and height 2, of a ruled wall whose upper circle is parametrised by a factor of
// 1 + off: lines of equal parameter are no longer those of the cone, and lie inside it.
HiddenDent twisted_frustum(double off);

// A cone with a tip, radius 1, sheared so that it is no body of revolution, with a ring groove about the tip
// as of grooved_block: z = f(r), f'' = -bend ((r - r0)^2 - w^2), f' < 0.
HiddenDent ringed_cone(double bend, double w, double r0, double shear);

}  // namespace nurbs::test

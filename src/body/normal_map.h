// The normal map: over directions, how large a ball must be to roll around the body there, and where dents
// are. The body's one largest radius says little when it has a flat somewhere, and nothing when it has a
// dent.
#pragma once

#include <limits>
#include <vector>

#include "nurbs/types.h"

namespace nurbs {

struct Shape;
struct SurfaceBounds;

// Cells of a cube map. With r = radius_at(n) finite, no dent, flat, closing or gaping joint has a normal
// within kNormalMargin of n, and every curvature radius whose normal lies there is at most r. So the surface
// point x with normal n is the only one, h(n) = n.x, and for |d - n| <= kNormalMargin, by h'' + h <= r along
// the great circle,
//     h(d) <= d.x + r (1 - d.n).
// (A direction at which the Gauss map of a closed surface of genus 0 is regular has one preimage more of
// positive than of negative orientation; away from dents none is negative.)
struct NormalMap {
  int cells = 0;              // per cube edge; 0: not made, as the body's own largest radius serves
  std::vector<float> radius;  // per cell, infinite where nothing is promised
  double radius_at(const Vec3& normal) const;
};
template <class Archive>
void archive(Archive& a, NormalMap& s) {
  auto& [cells, radius] = s;
  a(cells, radius);
}

// Of a shape whose patches, links, bounds, dents and curvatures are done, if it has dents or its largest
// curvature radius exceeds kLongRadius bounding radii; empty for others. From the leaves of `bounds`, whose
// normals and radii are proven, halved further; cells that no leaf's normals reach are infinite, and so are
// the normals at closing or gaping joints, which are sampled and widened. Some ms to some tens of ms, 100 kB.
NormalMap make_normal_map(const Shape& shape, SurfaceBounds* bounds);

}  // namespace nurbs

// The inner map: over directions, balls that lie inside a body as far as those directions can tell. With two
// of them, one a body, whole ranges of directions are known to overlap by more than some depth without a
// support evaluated (contact/overlap/deep_search.h).
#pragma once

#include <array>
#include <utility>
#include <vector>

#include "nurbs/lazy.h"
#include "nurbs/types.h"

namespace nurbs {

struct Shape;

// rad: within these angles of a node's normal its radii hold, and of a cell's middle its eigenvalues.
constexpr std::array<double, 4> kInnerCaps = {0.14, 0.18, 0.27, 0.45};
constexpr std::array<double, 3> kStretchCaps = {0.05, 0.08, 0.12};
constexpr int kStretchCells = 32;  // per cube edge

// At each node of the direction atlas. Let W be the inverse Weingarten map (W = dx/dn) at a support point.
// Where every W that belongs to a direction within kInnerCaps[k] of `normal` has
//     W(v, v) >= radius[k]   for unit tangents v,
// h'' + h >= radius[k] along great circles there (in the sense of measures: where a flat or a groove adds to
// it, it adds what is positive), so that from `normal` on
//     h(d) >= d.point + radius[k] (1 - d.normal)   for unit d within kInnerCaps[k] of it.
// Hypotheses: the body's joints meet, `point` is the support there; but for the slack of
// small kinks (small_kinks.h). Of a dented body the same holds of its convex
// hull, with W of the surface's own points: a support of the hull is a point of the surface where the normal
// is d and no curvature is more than 1 / radius, so that the surface around it lies above a ball of that
// radius that touches there, and h, which is no less than that ball's, bends from d by its radius at least.
// (Not in a joint that closes: no support lies in there, but in one of its corners, where one side's normal
// is d. Those are a few directions; h bends as it does for all others.)
struct InnerNode {
  Vec3 point = Vec3::Zero();   // shape frame, scale 1
  Vec3 normal = Vec3::Zero();  // unit
  std::array<float, 4> radius = {0, 0, 0, 0};
};
static_assert(sizeof(InnerNode) == 64, "a line of cache");
template <class Archive>
void archive(Archive& a, InnerNode& s) {
  auto& [point, normal, radius] = s;
  a(point, normal, radius);
}

// The same, finer, and for bodies that bend much more one way than the other: in a cell of a cube map, within
// kStretchCaps[k] of its middle,
//     W(v, v) >= least[k] + most[k] (along . v)^2.
struct InnerStretch {
  std::array<float, 3> along = {0, 0, 0};  // unit, square to the middle
  std::array<float, 3> least = {0, 0, 0}, most = {0, 0, 0};
};
template <class Archive>
void archive(Archive& a, InnerStretch& s) {
  auto& [along, least, most] = s;
  a(along, least, most);
}

struct InnerMap {
  std::vector<InnerNode> nodes;  // none: the hypotheses do not hold, or nothing is known
  std::vector<InnerStretch> stretches;
  static int cell(const Vec3& d);  // that d lies in
  static Vec3 middle(int cell);    // unit, at most 0.045 rad from all that lies in it
};
template <class Archive>
void archive(Archive& a, InnerMap& s) {
  auto& [nodes, stretches] = s;
  a(nodes, stretches);
}

// Of a shape that is done. From leaves, whose normals and curvatures are proven; the normals between the
// sides of an opening joint have radius 0, as a crease has. Some tens of ms, 330 kB.
InnerMap make_inner_map(const Shape& shape);

// A shape's inner map: made before a run, as it costs more than many contacts. Pairs use those that are
// there, and ask themselves only where they find no answer otherwise.
using LazyInnerMap = Lazy<InnerMap>;
// Made on the other side where it was here.
template <class Archive>
void archive(Archive& a, LazyInnerMap& s) {
  bool made = s.made();
  InnerMap map = s.known();
  a(made, map);
  if (made) s.set(std::move(map));
}

}  // namespace nurbs

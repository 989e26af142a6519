// Which patch edges lie on each other, found from the geometry alone, and how the normals meet there.
#pragma once

#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include "body/shape.h"

namespace nurbs {

using PatchLinks = std::vector<std::array<EdgeLink, 4>>;

// Parameters of the point at `t` in [0,1] of an edge (numbered as in EdgeLink).
inline Vec2 edge_parameters(int edge, double t) {
  const double end = edge % 2;
  return edge < 2 ? Vec2(end, t) : Vec2(t, end);
}

// Control points of an edge, homogeneous, in the order of its parameter.
std::vector<Vec4> edge_net(const BezierPatch& patch, int edge);

// Calls visit(patch, edge) once for every joint, of the side that comes first, and every pole.
template <class Visit>
void visit_joints(const PatchLinks& links, const Visit& visit) {
  for (int p = 0; p < static_cast<int>(links.size()); ++p)
    for (int e = 0; e < 4; ++e) {
      const EdgeLink& link = links[p][e];
      if (link.patch >= 0 && (link.patch < p || (link.patch == p && link.edge < e))) continue;
      visit(p, e);
    }
}
// Of those the joints that open to a sharp edge.
template <class Visit>
void visit_creases(const PatchLinks& links, const Visit& visit) {
  visit_joints(links, [&](int p, int e) {
    const EdgeLink& link = links[p][e];
    if (link.patch >= 0 && !link.collapsed && link.opens()) visit(p, e);
  });
}

// The other end of a link: the parameter `t` of an edge as counted on its partner. Two rational curves that
// are the same curve differ by such a map, unless one runs through it twice (or is straight): those links are
// `projected`, and this is a guess.
inline double partner_parameter(const EdgeLink& link, double t) {
  const double s = link.reversed ? 1 - t : t;
  return link.ratio == 1 ? s : std::min(1.0, link.ratio * s / (1 + (link.ratio - 1) * s));
}

// The same where the parameter has to be looked for: that of the point of the partner's edge closest to x.
// Some 5 us; 0.2 us where Gauss-Newton from `guess`, if there is one, comes on to x.
double projected_parameter(const BezierPatch& partner, const EdgeLink& link, const Vec3& x,
                           double guess = -1);

// The parameter of an edge's point closest to x, by Gauss-Newton from one near it.
double closest_on_edge(const BezierPatch& patch, int edge, const Vec3& x, double from);

// The point `at` on edge `edge` of its patch as the patch across that edge, which `link` names, sees it.
inline SurfacePoint across(const std::vector<BezierPatch>& patches, const EdgeLink& link,
                           const SurfacePoint& at, int edge) {
  const double t = edge < 2 ? at.v : at.u;
  const double guess = partner_parameter(link, t);
  const Vec2 there = edge_parameters(
      link.edge, link.projected ? projected_parameter(patches[link.patch], link,
                                                      evaluate0(patches[at.patch], at.u, at.v), guess)
                                : guess);
  return {link.patch, there[0], there[1]};
}

constexpr double kShortestEdge =
    1e-4;  // of the tolerance: shorter edges are points, beside which there are no normals

struct UnmatchedEdge {
  int patch = -1, edge = -1;                  // an edge that nothing lies on; -1 when every edge is matched
  int nearest_patch = -1, nearest_edge = -1;  // the free edge that comes closest ...
  double gap = 0;                             // ... and how far the first reaches from it
};

// Pairs the edges of `patches` whose curves agree within `tolerance` (length), closest pairs first; an edge
// whose control points all lie within the tolerance is collapsed. Curves are compared as curves, so the two
// sides may be parametrised differently: the map between them goes into the link; the whole of one edge must
// lie on the whole of the other (t_junctions.h finds where it does not). O(n log n) for n patches. Returns
// the first edge left over, if any.
UnmatchedEdge connect_patches(const std::vector<BezierPatch>& patches, double tolerance, PatchLinks& links);

// The worst of a body's joints.
struct KinkSummary {
  double convex = 0, concave = 0;  // largest angles between normals that open and that close, rad, both >= 0
  double depth = 0;                // of the deepest groove that the convex hull bridges at a concave kink
  SurfacePoint deepest;            // where that is
  double excess = 0;               // how far one side of such a groove rises above the other's tangent plane
  double gap = 0;                  // no two sides of a joint, and no points of a pole, are further apart ...
  double pole_gap = 0;             // ... those of poles
};

// Fills EdgeLink::kink, kink_bound and gap from the normals on both sides, which must be consistently
// oriented. On a collapsed edge the kink is how far the normals around the pole spread from each other.
// Angles are the largest of kKinkSamples, `convex` and `concave` never below what joints.h proves once that
// is a kink. A groove's depth is that below the common tangent of the two sides, taken as arcs of their
// curvatures k across the edge: kink^2 / (2 (sqrt(k_a) + sqrt(k_b))^2), never more than that of two straight
// sides as wide as the patches.
KinkSummary measure_kinks(const std::vector<BezierPatch>& patches, PatchLinks& links);

// For each surface, whether it must be turned (u and v exchanged) to agree with the first surface of its
// connected part. `parts` receives the part each surface belongs to. Returns false if the patches close on a
// one-sided surface.
bool orient_surfaces(const PatchLinks& links, const std::vector<int>& surface_of_patch, int surfaces,
                     std::vector<bool>& turned, std::vector<int>& parts);

}  // namespace nurbs

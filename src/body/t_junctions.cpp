#include "body/t_junctions.h"

#include <algorithm>

namespace nurbs {
namespace {

struct FreeEdge {
  int patch = 0, edge = 0;
  Vec3 ends[2];
  Eigen::AlignedBox3d box;  // of its control points
};

Vec3 point_of(const BezierPatch& patch, int edge, double t) {
  const Vec2 at = edge_parameters(edge, t);
  return evaluate0(patch, at[0], at[1]);
}

std::vector<FreeEdge> free_edges(const std::vector<BezierPatch>& patches, const PatchLinks& links) {
  std::vector<FreeEdge> edges;
  for (int p = 0; p < static_cast<int>(patches.size()); ++p)
    for (int e = 0; e < 4; ++e) {
      if (links[p][e].patch >= 0 || links[p][e].collapsed) continue;
      FreeEdge edge{p, e, {point_of(patches[p], e, 0), point_of(patches[p], e, 1)}, {}};
      for (const Vec4& q : edge_net(patches[p], e)) edge.box.extend(Vec3(q.head<3>() / q[3]));
      edges.push_back(edge);
    }
  return edges;
}

// Adds the parameter of the edge's point closest to x, if that is where the edge must be cut.
void add_cut(const BezierPatch& patch, const FreeEdge& edge, const Vec3& x, double tolerance,
             std::vector<Vec3>& at, std::vector<TJunction>& cuts) {
  if (edge.box.squaredExteriorDistance(x) > tolerance * tolerance) return;
  const auto is_near = [&](const Vec3& other) { return (x - other).norm() <= tolerance; };
  if (is_near(edge.ends[0]) || is_near(edge.ends[1]) || std::any_of(at.begin(), at.end(), is_near)) return;
  EdgeLink onto;
  onto.edge = edge.edge;
  const double t = projected_parameter(patch, onto, x);
  if (!(t > 0 && t < 1) || !is_near(point_of(patch, edge.edge, t))) return;
  at.push_back(x);
  cuts.push_back({edge.patch, edge.edge, t});
}

}  // namespace

std::vector<TJunction> find_t_junctions(const std::vector<BezierPatch>& patches, const PatchLinks& links,
                                        double tolerance) {
  const std::vector<FreeEdge> edges = free_edges(patches, links);
  std::vector<TJunction> cuts;
  std::vector<Vec3> at;  // of this edge
  for (const FreeEdge& edge : edges) {
    at.clear();
    for (const FreeEdge& other : edges) {
      if (&other == &edge) continue;
      for (const Vec3& x : other.ends) add_cut(patches[edge.patch], edge, x, tolerance, at, cuts);
    }
  }
  return cuts;
}

}  // namespace nurbs

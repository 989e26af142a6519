// Welding, pieces, winding and moments of triangle meshes.
#include "shapes/triangle_mesh.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <unordered_map>

#include "nurbs/spatial_hash.h"

namespace nurbs {
namespace {

// Sets that grow together.
class Sets {
 public:
  explicit Sets(size_t count) : parent_(count) { std::iota(parent_.begin(), parent_.end(), 0); }
  int find(int i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  void join(int i, int j) {
    i = find(i);
    j = find(j);
    parent_[std::max(i, j)] = std::min(i, j);
  }

 private:
  std::vector<int> parent_;
};

// These triangles of a mesh and the points that they use. `place`: of the mesh's points in what is made;
// below 0 for those that no earlier call has used.
TriangleMesh with_own_points(const TriangleMesh& mesh, const std::vector<std::array<int, 3>>& triangles,
                             std::vector<int>& place) {
  TriangleMesh out;
  for (std::array<int, 3> t : triangles) {
    for (int& i : t) {
      if (place[i] < 0) {
        place[i] = static_cast<int>(out.points.size());
        out.points.push_back(mesh.points[i]);
      }
      i = place[i];
    }
    out.triangles.push_back(t);
  }
  return out;
}

// An edge's triangles: key is the smaller end, then the larger one; `forward` of the first one.
struct EdgeUse {
  int a, b, triangle;
  bool forward;
};

std::vector<EdgeUse> sorted_edges(const TriangleMesh& mesh) {
  std::vector<EdgeUse> edges;
  edges.reserve(3 * mesh.triangles.size());
  for (size_t t = 0; t < mesh.triangles.size(); ++t)
    for (int k = 0; k < 3; ++k) {
      const int i = mesh.triangles[t][k], j = mesh.triangles[t][(k + 1) % 3];
      edges.push_back({std::min(i, j), std::max(i, j), static_cast<int>(t), i < j});
    }
  std::sort(edges.begin(), edges.end(), [](const EdgeUse& x, const EdgeUse& y) {
    return std::array{x.a, x.b, x.triangle} < std::array{y.a, y.b, y.triangle};
  });
  return edges;
}

}  // namespace

Eigen::AlignedBox3d bounding_box(const std::vector<Vec3>& points) {
  Eigen::AlignedBox3d box;
  for (const Vec3& p : points) box.extend(p);
  return box;
}

Vec3 move_to_origin(std::vector<Vec3>& points) {
  const Vec3 middle = bounding_box(points).center();
  for (Vec3& p : points) p -= middle;
  return middle;
}

TriangleMesh drop_unused(const TriangleMesh& mesh) {
  std::vector<int> place(mesh.points.size(), -1);
  return with_own_points(mesh, mesh.triangles, place);
}

TriangleMesh weld(const TriangleMesh& mesh, double tolerance) {
  constexpr double kCell = 16, kLeast = 1e-9;  // of the tolerance; of the mesh's extent
  const double size =
      std::max({kCell * tolerance, kLeast * bounding_box(mesh.points).diagonal().norm(), 1e-300});
  SpatialHash cells;
  cells.clear(mesh.points.size());
  std::vector<int> place(mesh.points.size());
  TriangleMesh out;
  for (size_t k = 0; k < mesh.points.size(); ++k) {
    const Vec3& x = mesh.points[k];
    const int last = static_cast<int>(out.points.size());
    place[k] = last;
    cells.visit_near(x, tolerance, size, [&](int i) {
      if (i < place[k] && (out.points[i] - x).norm() <= tolerance) place[k] = i;
    });
    if (place[k] < last) continue;
    out.points.push_back(x);
    cells.add(SpatialHash::cell_of(x, size));
  }
  std::vector<std::pair<std::array<int, 3>, int>> keys;
  std::vector<std::array<int, 3>> kept;
  for (const auto& t : mesh.triangles) {
    const std::array<int, 3> u{place[t[0]], place[t[1]], place[t[2]]};
    if (u[0] == u[1] || u[1] == u[2] || u[2] == u[0]) continue;
    std::array<int, 3> key = u;
    std::sort(key.begin(), key.end());
    keys.emplace_back(key, static_cast<int>(kept.size()));
    kept.push_back(u);
  }
  std::sort(keys.begin(), keys.end());
  std::vector<bool> repeated(kept.size(), false);
  for (size_t k = 1; k < keys.size(); ++k)
    if (keys[k].first == keys[k - 1].first) repeated[keys[k].second] = true;
  for (size_t k = 0; k < kept.size(); ++k)
    if (!repeated[k]) out.triangles.push_back(kept[k]);
  return drop_unused(out);
}

std::vector<TriangleMesh> split_pieces(const TriangleMesh& mesh) {
  Sets sets(mesh.points.size());
  for (const auto& t : mesh.triangles) {
    sets.join(t[0], t[1]);
    sets.join(t[0], t[2]);
  }
  std::unordered_map<int, size_t> piece_of;
  std::vector<std::vector<std::array<int, 3>>> pieces;
  for (const auto& t : mesh.triangles) {
    const auto [it, fresh] = piece_of.emplace(sets.find(t[0]), pieces.size());
    if (fresh) pieces.emplace_back();
    pieces[it->second].push_back(t);
  }
  std::vector<std::pair<double, size_t>> order;
  for (size_t k = 0; k < pieces.size(); ++k) {
    Eigen::AlignedBox3d box;
    for (const auto& t : pieces[k])
      for (int i : t) box.extend(mesh.points[i]);
    order.emplace_back(-box.diagonal().norm(), k);
  }
  std::sort(order.begin(), order.end());
  std::vector<TriangleMesh> out;
  std::vector<int> place(mesh.points.size(), -1);
  out.reserve(order.size());
  for (const auto& [size, k] : order) out.push_back(with_own_points(mesh, pieces[k], place));
  return out;
}

MeshDefects orient(TriangleMesh& mesh) {
  MeshDefects out;
  const std::vector<EdgeUse> edges = sorted_edges(mesh);
  struct Neighbour {
    int triangle;
    bool agrees;
  };
  std::vector<std::vector<Neighbour>> beside(mesh.triangles.size());
  for (size_t k = 0, end; k < edges.size(); k = end) {
    end = k + 1;
    while (end < edges.size() && edges[end].a == edges[k].a && edges[end].b == edges[k].b) ++end;
    if (end - k == 1) {
      if (out.open_edges++ == 0) out.where = 0.5 * (mesh.points[edges[k].a] + mesh.points[edges[k].b]);
    } else if (end - k > 2) {
      ++out.wild_edges;
    } else {
      const bool agrees = edges[k].forward != edges[k + 1].forward;
      beside[edges[k].triangle].push_back({edges[k + 1].triangle, agrees});
      beside[edges[k + 1].triangle].push_back({edges[k].triangle, agrees});
    }
  }
  std::vector<signed char> side(mesh.triangles.size(), 0);
  std::vector<int> patch, sheet;
  for (size_t seed = 0; seed < mesh.triangles.size(); ++seed) {
    if (side[seed]) continue;
    side[seed] = 1;
    sheet.assign(1, static_cast<int>(seed));
    for (size_t k = 0; k < sheet.size(); ++k) {
      for (const Neighbour& n : beside[sheet[k]]) {
        const signed char wanted = n.agrees ? side[sheet[k]] : static_cast<signed char>(-side[sheet[k]]);
        if (side[n.triangle] == 0) {
          side[n.triangle] = wanted;
          sheet.push_back(n.triangle);
        } else if (side[n.triangle] != wanted) {
          out.one_sided = true;
        }
      }
    }
    double volume = 0;
    const Vec3 from = mesh.points[mesh.triangles[seed][0]];
    for (int t : sheet) {
      const auto& c = mesh.triangles[t];
      volume += side[t] *
                (mesh.points[c[0]] - from).dot((mesh.points[c[1]] - from).cross(mesh.points[c[2]] - from));
    }
    if (volume < 0)
      for (int t : sheet) side[t] = static_cast<signed char>(-side[t]);
  }
  for (size_t t = 0; t < side.size(); ++t) {
    if (side[t] > 0) continue;
    ++out.turned;
    std::swap(mesh.triangles[t][1], mesh.triangles[t][2]);
  }
  return out;
}

// Tetrahedra from a point amid to the triangles; second moments by the corners' sums.
MassProperties mesh_properties(const TriangleMesh& mesh) {
  const Vec3 from = mesh.points.empty() ? Vec3(Vec3::Zero()) : Vec3(bounding_box(mesh.points).center());
  double volume = 0;
  Vec3 first = Vec3::Zero();
  Mat3 second = Mat3::Zero();
  for (const auto& t : mesh.triangles) {
    const Vec3 a = mesh.points[t[0]] - from, b = mesh.points[t[1]] - from, c = mesh.points[t[2]] - from;
    const double v = a.dot(b.cross(c)) / 6;
    const Vec3 sum = a + b + c;
    volume += v;
    first += v / 4 * sum;
    second += v / 20 * (sum * sum.transpose() + a * a.transpose() + b * b.transpose() + c * c.transpose());
  }
  MassProperties out;
  out.volume = volume;
  if (!(volume != 0)) return out;
  const Vec3 offset = first / volume;
  out.center = from + offset;
  second -= volume * offset * offset.transpose();
  out.inertia = second.trace() * Mat3::Identity() - second;
  return out;
}

}  // namespace nurbs

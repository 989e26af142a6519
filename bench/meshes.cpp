// Tessellation, flips to the convex hull, and hill climbing.
#include "bench/meshes.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <unordered_map>
#include <utility>

#include "nurbs/bezier_patch.h"

namespace nurbs::bench {
namespace {

constexpr int kScanned = 64;         // meshes up to this many vertices are not climbed
constexpr double kSamePoint = 1e-9;  // of the bounding radius
constexpr double kCoplanar = 1e-13;  // of the bounding radius cubed

// Vertices merged by position through a hash of cells much larger than the merging distance.
class Welder {
 public:
  Welder(std::vector<Vec3>& vertices, double distance)
      : vertices_(vertices), distance_(distance), cell_(100 * distance) {}

  int add(const Vec3& x) {
    const std::array<std::int64_t, 3> c = {floor(x[0]), floor(x[1]), floor(x[2])};
    for (int k = 0; k < 27; ++k) {
      const auto found = cells_.find(key(c[0] + k % 3 - 1, c[1] + k / 3 % 3 - 1, c[2] + k / 9 - 1));
      if (found == cells_.end()) continue;
      for (int v : found->second)
        if ((vertices_[v] - x).norm() < distance_) return v;
    }
    const int index = static_cast<int>(vertices_.size());
    vertices_.push_back(x);
    cells_[key(c[0], c[1], c[2])].push_back(index);
    return index;
  }

 private:
  std::int64_t floor(double x) const { return static_cast<std::int64_t>(std::floor(x / cell_)); }
  static std::uint64_t key(std::int64_t i, std::int64_t j, std::int64_t k) {
    return (static_cast<std::uint64_t>(i) * 73856093u) ^ (static_cast<std::uint64_t>(j) * 19349663u << 20) ^
           (static_cast<std::uint64_t>(k) * 83492791u << 40);
  }
  std::vector<Vec3>& vertices_;
  double distance_, cell_;
  std::unordered_map<std::uint64_t, std::vector<int>> cells_;
};

// Turns a closed star-shaped triangulation into the convex hull of its vertices.
class Flipper {
 public:
  Flipper(const std::vector<Vec3>& vertices, std::vector<std::array<int, 3>>& triangles, double size)
      : vertices_(vertices), triangles_(triangles), slack_(kCoplanar * size * size * size) {
    for (int t = 0; t < static_cast<int>(triangles_.size()); ++t) link(t);
  }

  void run() {
    for (const auto& t : triangles_)
      for (int k = 0; k < 3; ++k)
        if (t[k] < t[(k + 1) % 3]) work_.push_back({t[k], t[(k + 1) % 3]});
    for (size_t cap = 40 * triangles_.size(); !work_.empty() && cap > 0; --cap) {
      const auto [a, b] = work_.back();
      work_.pop_back();
      mend(a, b);
    }
    triangles_.erase(
        std::remove_if(triangles_.begin(), triangles_.end(), [](const auto& t) { return t[0] < 0; }),
        triangles_.end());
  }

 private:
  static std::uint64_t key(int a, int b) {
    return static_cast<std::uint64_t>(a) << 32 | static_cast<unsigned>(b);
  }

  void link(int t) {
    for (int k = 0; k < 3; ++k) owner_[key(triangles_[t][k], triangles_[t][(k + 1) % 3])] = t;
  }
  void unlink(int t) {
    for (int k = 0; k < 3; ++k) owner_.erase(key(triangles_[t][k], triangles_[t][(k + 1) % 3]));
  }
  int triangle_at(int a, int b) const {
    const auto found = owner_.find(key(a, b));
    return found == owner_.end() ? -1 : found->second;
  }
  int opposite(int t, int a, int b) const {
    for (int v : triangles_[t])
      if (v != a && v != b) return v;
    return -1;
  }
  double volume(int a, int b, int c, int d) const {
    return (vertices_[b] - vertices_[a]).cross(vertices_[c] - vertices_[a]).dot(vertices_[d] - vertices_[a]);
  }
  bool outward(int a, int b, int c) const { return vertices_[a].cross(vertices_[b]).dot(vertices_[c]) > 0; }
  void replace(int t, std::array<int, 3> with) {
    triangles_[t] = with;
    link(t);
    for (int k = 0; k < 3; ++k) work_.push_back({with[k], with[(k + 1) % 3]});
  }

  // Flips the edge when it is reflex; where it can't be, drops an end that only three triangles meet in.
  void mend(int a, int b) {
    const int t = triangle_at(a, b), o = triangle_at(b, a);
    if (t < 0 || o < 0) return;
    const int c = opposite(t, a, b), d = opposite(o, a, b);
    if (volume(a, b, c, d) <= slack_) return;
    if (triangle_at(c, d) < 0 && triangle_at(d, c) < 0 && outward(c, a, d) && outward(d, b, c)) {
      unlink(t);
      unlink(o);
      replace(t, {c, a, d});
      replace(o, {d, b, c});
    } else if (!drop(a, b, c, d)) {
      drop(b, a, d, c);
    }
  }

  // Vertex a with neighbours b, c, d: (a b c), (a c d), (a d b) become (b c d).
  bool drop(int a, int b, int c, int d) {
    const int t0 = triangle_at(a, b), t1 = triangle_at(a, c), t2 = triangle_at(a, d);
    if (t0 < 0 || t1 < 0 || t2 < 0 || opposite(t1, a, c) != d || opposite(t2, a, d) != b) return false;
    for (int t : {t0, t1, t2}) unlink(t);
    triangles_[t1][0] = triangles_[t2][0] = -1;
    replace(t0, {b, c, d});
    return true;
  }

  const std::vector<Vec3>& vertices_;
  std::vector<std::array<int, 3>>& triangles_;
  double slack_;
  std::unordered_map<std::uint64_t, int> owner_;
  std::vector<std::pair<int, int>> work_;
};

// Renumbers to the vertices in use and lists each one's neighbours.
void compact(Mesh& mesh) {
  std::vector<int> number(mesh.vertices.size(), -1);
  std::vector<Vec3> used;
  for (auto& t : mesh.triangles)
    for (int& v : t) {
      if (number[v] < 0) {
        number[v] = static_cast<int>(used.size());
        used.push_back(mesh.vertices[v]);
      }
      v = number[v];
    }
  mesh.vertices = std::move(used);
  std::vector<std::vector<int>> around(mesh.vertices.size());
  for (const auto& t : mesh.triangles)
    for (int k = 0; k < 3; ++k) around[t[k]].push_back(t[(k + 1) % 3]);
  mesh.neighbour_start = {0};
  for (const auto& list : around) {
    mesh.neighbour.insert(mesh.neighbour.end(), list.begin(), list.end());
    mesh.neighbour_start.push_back(static_cast<int>(mesh.neighbour.size()));
  }
}

}  // namespace

Mesh tessellate(const Shape& shape, int vertices) {
  Mesh mesh;
  const int n =
      std::max(1, static_cast<int>(std::lround(std::sqrt((vertices - 2.0) / shape.patches.size()))));
  Welder welder(mesh.vertices, kSamePoint * shape.bounding_radius);
  std::vector<int> grid((n + 1) * (n + 1));
  const auto add = [&](int a, int b, int c) {
    if (a != b && b != c && c != a) mesh.triangles.push_back({a, b, c});
  };
  for (const BezierPatch& patch : shape.patches) {
    for (int i = 0; i <= n; ++i)
      for (int j = 0; j <= n; ++j)
        grid[i * (n + 1) + j] = welder.add(evaluate0(patch, double(i) / n, double(j) / n));
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j) {
        const int* g = &grid[i * (n + 1) + j];
        add(g[0], g[n + 1], g[n + 2]);
        add(g[0], g[n + 2], g[1]);
      }
  }
  Flipper(mesh.vertices, mesh.triangles, shape.bounding_radius).run();
  compact(mesh);
  return mesh;
}

int farthest_vertex(const Mesh& mesh, const Vec3& d, int start) {
  const int count = static_cast<int>(mesh.vertices.size());
  if (count <= kScanned) {
    int best = 0;
    for (int i = 1; i < count; ++i)
      if (d.dot(mesh.vertices[i]) > d.dot(mesh.vertices[best])) best = i;
    return best;
  }
  int at = start;
  double h = d.dot(mesh.vertices[at]);
  for (bool moved = true; moved;) {
    moved = false;
    for (int k = mesh.neighbour_start[at], end = mesh.neighbour_start[at + 1]; k < end; ++k) {
      const double other = d.dot(mesh.vertices[mesh.neighbour[k]]);
      if (other > h) {
        h = other;
        at = mesh.neighbour[k];
        moved = true;
        break;
      }
    }
  }
  return at;
}

}  // namespace nurbs::bench

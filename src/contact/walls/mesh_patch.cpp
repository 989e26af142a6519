// See mesh_patch.h.
#include "contact/walls/mesh_patch.h"

#include <algorithm>
#include <cmath>

namespace nurbs {
namespace {

Vec3 area_vector(const Triangle& t) {
  return 0.5 * (t[1] - t[0]).cross(t[2] - t[0]);
}

double longest_side2(const Triangle& t) {
  return std::max({(t[1] - t[0]).squaredNorm(), (t[2] - t[1]).squaredNorm(), (t[0] - t[2]).squaredNorm()});
}

// Twice the area over the squared longest side: below this a triangle has no plane of its own.
constexpr double kNoArea = 1e-12;
constexpr double kOnePlane = 1e-3;       // of the distance within which corners are one: planes are, at least
constexpr double kCellOfVertices = 16;   // of that distance
constexpr double kCellOfNormals = 0.01;  // in which planes are looked up by their normals ...
constexpr int kFewPlanes = 16;           // ... where there are more
constexpr double kNormalRoundoff = 1e-9;

}  // namespace

void MeshPatch::build(const Triangle* triangles, int count, double distance, double flat, double crack) {
  unbounded_ = false;
  weld(triangles, count, distance);
  if (crack > distance) close_cracks(crack);
  split_sides(std::max(crack, distance));
  find_planes(triangles, std::max(flat, kOnePlane * distance));
  find_edges();
  link_vertices();
  place();
  classify();
  for (Plane& p : planes_) p.expiry = -1e300;
}

void MeshPatch::build_plane(const Vec3& origin, const Vec3& normal) {
  unbounded_ = true;
  vertices_.clear();
  edges_.clear();
  cells_.clear();
  planes_.assign(1, {normal, origin, 0, 0, 0, -1e300, 0, 0, 0, 0, 0});
}

void MeshPatch::move_plane(const Vec3& origin, const Vec3& normal) {
  planes_[0].origin = origin;
  planes_[0].normal = normal;
}

void MeshPatch::move(const Triangle* triangles) {
  for (Vertex& v : vertices_) v.x = triangles[v.triangle][v.corner];
  for (Plane& p : planes_) {
    const Triangle& t = triangles[p.leader];
    p.normal = area_vector(t).normalized();
    p.origin = t[0];
  }
  place();
}

// Vertices, and cells as triangles of them.
void MeshPatch::weld(const Triangle* triangles, int count, double distance) {
  vertices_.clear();
  cells_.clear();
  corners_.clear();
  const double near2 = distance * distance, size = distance > 0 ? kCellOfVertices * distance : 1;
  vertices_by_place_.clear(count);
  cells_by_corners_.clear(count);
  for (int t = 0; t < count; ++t) {
    const Triangle& triangle = triangles[t];
    if (!(2 * area_vector(triangle).norm() > kNoArea * longest_side2(triangle))) continue;
    std::array<int, 3> at;
    for (int k = 0; k < 3; ++k) {
      const int last = static_cast<int>(vertices_.size());
      at[k] = last;
      vertices_by_place_.visit_near(triangle[k], distance, size, [&](int v) {
        if (v < at[k] && (vertices_[v].x - triangle[k]).squaredNorm() <= near2) at[k] = v;
      });
      if (at[k] < last) continue;
      vertices_.push_back({triangle[k], t, k, 0, 0, 0, 0, false});
      vertices_by_place_.add(SpatialHash::cell_of(triangle[k], size));
    }
    add_cell(at, t);
  }
}

// A triangle of three vertices, if it is one and there is none of them yet.
void MeshPatch::add_cell(const std::array<int, 3>& at, int triangle) {
  if (at[0] == at[1] || at[1] == at[2] || at[2] == at[0]) return;
  std::array<int, 3> sorted = at;
  std::sort(sorted.begin(), sorted.end());
  const SpatialHash::Cell key{double(sorted[0]), double(sorted[1]), double(sorted[2])};
  bool known = false;
  cells_by_corners_.visit(key, [&](int c) {
    known = known || std::is_permutation(at.begin(), at.end(), corners_.begin() + cells_[c].first);
  });
  if (known) return;
  cells_by_corners_.add(key);
  cells_.push_back({triangle, -1, static_cast<int>(corners_.size()), 3});
  corners_.insert(corners_.end(), at.begin(), at.end());
}

// The sides of triangles that no other has; cells are triangles still.
std::vector<MeshPatch::Key> MeshPatch::lonely_sides() {
  keys_.clear();
  for (std::size_t c = 0; c < cells_.size(); ++c)
    for (int k = 0; k < 3; ++k) {
      const int p = corners_[cells_[c].first + k], q = corners_[cells_[c].first + (k + 1) % 3];
      keys_.push_back({std::min(p, q), std::max(p, q), static_cast<int>(c), k});
    }
  const auto less = [](const Key& a, const Key& b) {
    return a.low != b.low ? a.low < b.low : a.high != b.high ? a.high < b.high : a.cell < b.cell;
  };
  std::sort(keys_.begin(), keys_.end(), less);
  std::vector<Key> lonely;
  for (std::size_t i = 0; i < keys_.size(); ++i) {
    const auto same = [&](std::size_t j) {
      return j < keys_.size() && keys_[j].low == keys_[i].low && keys_[j].high == keys_[i].high;
    };
    if (!same(i + 1) && (i == 0 || !same(i - 1))) lonely.push_back(keys_[i]);
  }
  return lonely;
}

// The vertices at the ends of sides, each once.
std::vector<int> MeshPatch::ends_of(const std::vector<Key>& sides) {
  std::vector<int> ends;
  for (const Key& side : sides) {
    ends.push_back(side.low);
    ends.push_back(side.high);
  }
  std::sort(ends.begin(), ends.end());
  ends.erase(std::unique(ends.begin(), ends.end()), ends.end());
  return ends;
}

// Makes one of the ends of lonely sides that are within a distance: the first, of those that are none's.
void MeshPatch::close_cracks(double distance) {
  const std::vector<int> ends = ends_of(lonely_sides());
  const double size = kCellOfVertices * distance;
  vertices_by_place_.clear(ends.size());
  std::vector<int> one(vertices_.size()), kept;
  for (std::size_t v = 0; v < one.size(); ++v) one[v] = static_cast<int>(v);
  bool any = false;
  for (const int end : ends) {
    const Vec3& x = vertices_[end].x;
    vertices_by_place_.visit_near(x, distance, size, [&](int k) {
      if (kept[k] < one[end] && (x - vertices_[kept[k]].x).squaredNorm() <= distance * distance)
        one[end] = kept[k];
    });
    if (one[end] == end) {
      kept.push_back(end);
      vertices_by_place_.add(SpatialHash::cell_of(x, size));
    } else {
      any = true;
    }
  }
  if (!any) return;
  std::vector<Cell> cells;
  std::vector<int> corners;
  cells.swap(cells_);
  corners.swap(corners_);
  cells_by_corners_.clear(cells.size());
  for (const Cell& cell : cells)
    add_cell({one[corners[cell.first]], one[corners[cell.first + 1]], one[corners[cell.first + 2]]},
             cell.triangle);
}

// Splits the sides without a partner where another such side's corner lies on them.
void MeshPatch::split_sides(double distance) {
  const std::vector<Key> lonely = lonely_sides();
  struct Split {
    int cell, slot;
    double along;
    int vertex;
  };
  std::vector<Split> splits;
  std::vector<int> ends = ends_of(lonely);
  const auto first_coordinate = [&](int v) { return vertices_[v].x[0]; };
  std::sort(ends.begin(), ends.end(), [&](int a, int b) {
    return first_coordinate(a) != first_coordinate(b) ? first_coordinate(a) < first_coordinate(b) : a < b;
  });
  for (const Key& side : lonely) {
    const Vec3 &p = vertices_[side.low].x, &q = vertices_[side.high].x, way = q - p;
    const double length2 = way.squaredNorm(), to = std::max(p[0], q[0]) + distance;
    const auto own = corners_.begin() + cells_[side.cell].first;  // and the third: a needle's
    auto end = std::lower_bound(ends.begin(), ends.end(), std::min(p[0], q[0]) - distance,
                                [&](int v, double x) { return first_coordinate(v) < x; });
    for (; end != ends.end() && first_coordinate(*end) <= to; ++end) {
      if (std::find(own, own + 3, *end) != own + 3) continue;
      const Vec3 x = vertices_[*end].x - p;
      const double t = x.dot(way) / length2;
      if (!(t > 0 && t < 1) || (x - t * way).squaredNorm() > distance * distance) continue;
      const bool forward = own[side.slot] == side.low;
      splits.push_back({side.cell, side.slot, forward ? t : 1 - t, *end});
    }
  }
  splits_.assign(corners_.size(), 0);
  if (splits.empty()) return;
  splits_.clear();
  std::sort(splits.begin(), splits.end(), [](const Split& a, const Split& b) {
    return a.cell != b.cell ? a.cell < b.cell : a.slot != b.slot ? a.slot < b.slot : a.along < b.along;
  });
  std::vector<int> old;
  old.swap(corners_);
  std::size_t next = 0;
  for (std::size_t c = 0; c < cells_.size(); ++c) {
    Cell& cell = cells_[c];
    const int from = cell.first;
    cell.first = static_cast<int>(corners_.size());
    for (int k = 0; k < 3; ++k) {
      corners_.push_back(old[from + k]);
      splits_.push_back(0);
      for (; next < splits.size() && splits[next].cell == static_cast<int>(c) && splits[next].slot == k;
           ++next) {
        corners_.push_back(splits[next].vertex);
        splits_.push_back(1);
      }
    }
    cell.corners = static_cast<int>(corners_.size()) - cell.first;
  }
}

bool MeshPatch::is_beside(const Cell& cell, int k, const Vec3& x) const {
  const int end = k + 1 < cell.corners ? k + 1 : 0;
  const auto at = [&](int i) -> const Vec3& { return vertices_[corners_[cell.first + i]].x; };
  const auto splits = [&](int i) { return splits_[cell.first + i] != 0; };
  if (!splits(k) && !splits(end)) return true;
  int from = k, to = end;
  while (splits(from)) --from;  // a cell begins with a corner of its own
  while (splits(to)) to = to + 1 < cell.corners ? to + 1 : 0;
  const Vec3 way = at(to) - at(from);
  return (!splits(k) || way.dot(x - at(k)) >= 0) && (!splits(end) || way.dot(x - at(end)) < 0);
}

// The first plane within a distance of a triangle's corners, or -1. Its normal is off the triangle's by no
// more than the distance over the triangle's least height allows, in sine: height over the plane is linear.
int MeshPatch::find_plane(const Triangle& t, double distance) const {
  const int none = static_cast<int>(planes_.size());
  int found = none;
  const auto look = [&](int p) {
    const auto height = [&](const Vec3& x) { return std::abs(planes_[p].normal.dot(x - planes_[p].origin)); };
    if (p < found && std::max({height(t[0]), height(t[1]), height(t[2])}) <= distance) found = p;
  };
  const Vec3 area = area_vector(t);
  const double least_height = 2 * area.norm() / std::sqrt(longest_side2(t)),
               off = 2.1 * distance / least_height + kNormalRoundoff;
  if (none <= kFewPlanes || !(off <= 0.5 * kCellOfNormals)) {
    for (int p = 0; p < found; ++p) look(p);
  } else {
    const Vec3 normal = area.normalized();
    planes_by_normal_.visit_near(normal, off, kCellOfNormals, look);
    planes_by_normal_.visit_near(-normal, off, kCellOfNormals, look);
  }
  return found < none ? found : -1;
}

// The largest triangles lay down the planes; those whose corners lie in one belong to it.
void MeshPatch::find_planes(const Triangle* triangles, double distance) {
  order_.resize(cells_.size());
  for (std::size_t c = 0; c < cells_.size(); ++c) order_[c] = static_cast<int>(c);
  std::vector<double> area(cells_.size());
  for (std::size_t c = 0; c < cells_.size(); ++c) area[c] = area_vector(triangles[cells_[c].triangle]).norm();
  std::stable_sort(order_.begin(), order_.end(), [&](int a, int b) { return area[a] > area[b]; });
  planes_.clear();
  planes_by_normal_.clear(cells_.size());
  for (const int c : order_) {
    const Triangle& t = triangles[cells_[c].triangle];
    int plane = find_plane(t, distance);
    if (plane < 0) {
      plane = static_cast<int>(planes_.size());
      planes_.push_back({area_vector(t).normalized(), t[0], 0, 0, cells_[c].triangle, 0, 0, 0, 0, 0, 0});
      planes_by_normal_.add(SpatialHash::cell_of(planes_.back().normal, kCellOfNormals));
    }
    cells_[c].plane = plane;
  }
  for (const Cell& cell : cells_) ++planes_[cell.plane].cells;
  int total = 0;
  for (Plane& p : planes_) {
    p.first = total;
    total += p.cells;
    p.cells = 0;
  }
  cells_in_.resize(total);
  for (std::size_t c = 0; c < cells_.size(); ++c) {
    Plane& p = planes_[cells_[c].plane];
    cells_in_[p.first + p.cells++] = static_cast<int>(c);
  }
}

void MeshPatch::find_edges() {
  keys_.clear();
  edge_of_.assign(corners_.size(), -1);
  for (std::size_t c = 0; c < cells_.size(); ++c) {
    const Cell& cell = cells_[c];
    for (int k = 0; k < cell.corners; ++k) {
      const int p = corners_[cell.first + k], q = corners_[cell.first + (k + 1) % cell.corners];
      keys_.push_back({std::min(p, q), std::max(p, q), static_cast<int>(c), k});
    }
  }
  std::sort(keys_.begin(), keys_.end(), [](const Key& a, const Key& b) {
    return a.low != b.low ? a.low < b.low : a.high != b.high ? a.high < b.high : a.cell < b.cell;
  });
  edges_.clear();
  sides_.clear();
  for (std::size_t i = 0; i < keys_.size(); ++i) {
    const Key& key = keys_[i];
    if (i == 0 || keys_[i - 1].low != key.low || keys_[i - 1].high != key.high)
      edges_.push_back({{key.low, key.high}, static_cast<int>(sides_.size()), 0, false, Vec3::Zero(), 0});
    Edge& e = edges_.back();
    ++e.sides;
    edge_of_[cells_[key.cell].first + key.slot] = static_cast<int>(edges_.size()) - 1;
    sides_.push_back({key.cell, 1});
  }
}

void MeshPatch::link_vertices() {
  for (Vertex& v : vertices_) v.edges = v.cells = 0, v.inner = false;
  const auto number = [&](auto each, std::vector<int>* list, auto count, auto first) {
    each([&](int v, int) { ++count(v); });
    int total = 0;
    for (std::size_t v = 0; v < vertices_.size(); ++v) {
      first(static_cast<int>(v)) = total;
      total += count(static_cast<int>(v));
      count(static_cast<int>(v)) = 0;
    }
    list->assign(total, 0);
    each([&](int v, int what) { (*list)[first(v) + count(v)++] = what; });
  };
  number(
      [&](auto visit) {
        for (std::size_t e = 0; e < edges_.size(); ++e)
          for (const int v : edges_[e].v) visit(v, static_cast<int>(e));
      },
      &edges_at_, [&](int v) -> int& { return vertices_[v].edges; },
      [&](int v) -> int& { return vertices_[v].first_edge; });
  number(
      [&](auto visit) {
        for (std::size_t c = 0; c < cells_.size(); ++c)
          for (int k = 0; k < cells_[c].corners; ++k)
            visit(corners_[cells_[c].first + k], static_cast<int>(c));
      },
      &cells_at_, [&](int v) -> int& { return vertices_[v].cells; },
      [&](int v) -> int& { return vertices_[v].first_cell; });
}

// What follows from the places of the vertices.
void MeshPatch::place() {
  forget_cells();
  for (Edge& e : edges_) {
    const Vec3 way = vertices_[e.v[1]].x - vertices_[e.v[0]].x;
    e.length = way.norm();
    e.direction = way / e.length;
  }
}

// On which side of its edges a cell lies, about the plane's normal, and what lies within one plane: motion
// does not change it.
void MeshPatch::classify() {
  for (Edge& e : edges_)
    for (int i = e.first_side; i < e.first_side + e.sides; ++i) {
      const Cell& cell = cells_[sides_[i].cell];
      const Vec3 across = planes_[cell.plane].normal.cross(e.direction);
      double most = 0;
      for (int k = 0; k < cell.corners; ++k) {
        const double off = across.dot(vertices_[corners_[cell.first + k]].x - vertices_[e.v[0]].x);
        if (std::abs(off) > std::abs(most)) most = off;
      }
      sides_[i].sign = most < 0 ? -1 : 1;
    }
  for (Edge& e : edges_)
    e.inner = e.sides == 2 &&
              cells_[sides_[e.first_side].cell].plane == cells_[sides_[e.first_side + 1].cell].plane &&
              sides_[e.first_side].sign != sides_[e.first_side + 1].sign;
  for (Vertex& v : vertices_) {
    v.inner = true;
    for (int i = 0; i < v.edges; ++i) v.inner = v.inner && edges_[edges_at_[v.first_edge + i]].inner;
  }
  signs_.assign(corners_.size(), 0);
  for (const Edge& e : edges_)
    for (int i = e.first_side; i < e.first_side + e.sides; ++i) {
      const Cell& cell = cells_[sides_[i].cell];
      for (int k = cell.first; k < cell.first + cell.corners; ++k)
        if (edge_of_[k] == static_cast<int>(&e - edges_.data())) signs_[k] = sides_[i].sign;
    }
  list_outlines();
}

// The edges and vertices of every plane that do not lie within it; an edge belongs to the planes of its
// cells.
void MeshPatch::list_outlines() {
  edges_in_.clear();
  vertices_in_.clear();
  for (Plane& p : planes_) {
    p.first_edge = static_cast<int>(edges_in_.size());
    p.first_vertex = static_cast<int>(vertices_in_.size());
    p.hint = cells_in_[p.first];
    for (int i = p.first; i < p.first + p.cells; ++i) {
      const Cell& cell = cells_[cells_in_[i]];
      for (int k = cell.first; k < cell.first + cell.corners; ++k) {
        if (!edges_[edge_of_[k]].inner) edges_in_.push_back(edge_of_[k]);
        if (!vertices_[corners_[k]].inner) vertices_in_.push_back(corners_[k]);
      }
    }
    const auto unique = [](std::vector<int>& list, int first) {
      std::sort(list.begin() + first, list.end());
      list.erase(std::unique(list.begin() + first, list.end()), list.end());
      return static_cast<int>(list.size()) - first;
    };
    p.edges = unique(edges_in_, p.first_edge);
    p.vertices = unique(vertices_in_, p.first_vertex);
  }
}

void MeshPatch::forget_cells() {
  outlines_.resize(std::max(outlines_.size(), planes_.size()));
  for (PlaneCells& cells : outlines_) {
    cells.corners.clear();
    cells.ends.clear();
    cells.border.clear();
  }
}

const PlaneCells& MeshPatch::cells_of(int number) {
  PlaneCells& out = outlines_[number];
  if (!out.ends.empty()) return out;
  const Plane& plane = planes_[number];
  for (int i = plane.first; i < plane.first + plane.cells; ++i) {
    const Cell& cell = cells_[cells_in_[i]];
    for (int k = 0; k < cell.corners; ++k) {
      const Vec3& x = vertices_[corners_[cell.first + k]].x;
      out.corners.push_back(x);
      if (edges_[edge_of_[cell.first + k]].inner) continue;
      out.border.push_back(x);
      out.border.push_back(vertices_[corners_[cell.first + (k + 1) % cell.corners]].x);
    }
    out.ends.push_back(static_cast<int>(out.corners.size()));
  }
  return out;
}

std::size_t MeshPatch::bytes() const {
  return vertices_.capacity() * sizeof(Vertex) + edges_.capacity() * sizeof(Edge) +
         sides_.capacity() * sizeof(Side) + cells_.capacity() * sizeof(Cell) +
         planes_.capacity() * sizeof(Plane) +
         (corners_.capacity() + edge_of_.capacity() + edges_at_.capacity() + cells_at_.capacity() +
          cells_in_.capacity() + order_.capacity()) *
             sizeof(int) +
         keys_.capacity() * sizeof(Key);
}

}  // namespace nurbs

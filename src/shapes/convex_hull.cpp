// Qhull's facets as a polytope with adjacency.
#include "shapes/convex_hull.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "body/cube_map.h"

extern "C" {
#include <libqhull_r/qhull_ra.h>
}

namespace nurbs {
namespace {

constexpr double kFlat = 1e-9;          // of the extent: points this near a plane have no hull
constexpr double kGjkTolerance = 1e-9;  // of the extent
constexpr int kGjkIterations = 100;
constexpr size_t kManyVertices = 300;  // from here on a table of starts pays: a climb crosses half the hull

// Whether points span less than three dimensions: their least extent along any of the principal axes.
bool is_flat(const std::vector<Vec3>& points) {
  if (points.size() < 4) return true;
  Vec3 mean = Vec3::Zero();
  for (const Vec3& p : points) mean += p / static_cast<double>(points.size());
  Mat3 spread = Mat3::Zero();
  for (const Vec3& p : points) spread += (p - mean) * (p - mean).transpose();
  const Eigen::SelfAdjointEigenSolver<Mat3> axes(spread);
  double least = 0, most = 0;
  for (const Vec3& p : points) {
    const Vec3 q = axes.eigenvectors().transpose() * (p - mean);
    least = std::max(least, std::abs(q[0]));
    most = std::max(most, std::abs(q[2]));
  }
  return !(least > kFlat * most);
}

// Triangles of the hull of `points`, wound outward; indices into points.
std::vector<std::array<int, 3>> hull_triangles(const std::vector<Vec3>& points) {
  std::vector<double> coordinates;
  coordinates.reserve(3 * points.size());
  for (const Vec3& p : points) coordinates.insert(coordinates.end(), {p[0], p[1], p[2]});
  qhT qh_state;
  qhT* qh = &qh_state;
  QHULL_LIB_CHECK
  qh_zero(qh, nullptr);
  std::FILE* quiet = std::fopen("/dev/null", "w");
  char options[] = "qhull Qt Q12";
  const int failed =
      qh_new_qhull(qh, 3, static_cast<int>(points.size()), coordinates.data(), False, options, quiet, quiet);
  std::vector<std::array<int, 3>> triangles;
  if (!failed) {
    facetT* facet;
    FORALLfacets {
      std::array<int, 3> t{};
      int k = 0;
      vertexT *vertex, **vertexp;
      FOREACHvertex_(facet->vertices) {
        if (k < 3) t[k] = qh_pointid(qh, vertex->point);
        ++k;
      }
      if (k != 3) continue;
      const Vec3 &a = points[t[0]], &b = points[t[1]], &c = points[t[2]];
      const Vec3 normal(facet->normal[0], facet->normal[1], facet->normal[2]);
      if ((b - a).cross(c - a).dot(normal) < 0) std::swap(t[1], t[2]);
      triangles.push_back(t);
    }
  }
  qh_freeqhull(qh, !qh_ALL);
  int left = 0, blocks = 0;
  qh_memfreeshort(qh, &left, &blocks);
  if (quiet) std::fclose(quiet);
  if (failed || triangles.size() < 4) throw ShapeError("the points have no convex hull with an inside");
  return triangles;
}

}  // namespace

// Which corners the nearest point needs (weights > 0): over all faces that have the last corner, the nearest
// point of the face's plane if it lies in the face.
Vec3 nearest_on_simplex(Vec3 (&y)[4], int& count) {
  double best = 1e300;
  Vec3 nearest = y[0];
  int best_mask = 1;
  for (int mask = 1 << (count - 1); mask < 1 << count; ++mask) {
    int at[4], n = 0;
    for (int k = 0; k < count; ++k)
      if (mask >> k & 1) at[n++] = k;
    Vec3 p = y[at[0]];
    bool inside = true;
    if (n == 2) {
      const Vec3 e = y[at[1]] - p;
      const double t = -p.dot(e) / e.squaredNorm();
      inside = t > 0 && t < 1;
      p += t * e;
    } else if (n == 3) {
      const Vec3 e = y[at[1]] - p, f = y[at[2]] - p;
      const double ee = e.dot(e), ef = e.dot(f), ff = f.dot(f), area2 = ee * ff - ef * ef;
      const double s = (-p.dot(e) * ff + p.dot(f) * ef) / area2, t = (-p.dot(f) * ee + p.dot(e) * ef) / area2;
      inside = area2 > 0 && s > 0 && t > 0 && s + t < 1;
      p += s * e + t * f;
    } else if (n == 4) {
      Mat3 edges;
      for (int k = 1; k < 4; ++k) edges.col(k - 1) = y[at[k]] - p;
      const Vec3 t = edges.inverse() * -p;
      inside = t.allFinite() && t.minCoeff() > 0 && t.sum() < 1;
      p.setZero();
    }
    const double d2 = p.squaredNorm();
    if (inside && d2 < best) best = d2, nearest = p, best_mask = mask;
  }
  int n = 0;
  for (int k = 0; k < count; ++k)
    if (best_mask >> k & 1) y[n++] = y[k];
  count = n;
  return nearest;
}

std::vector<Vec3> polar_points(const ConvexHull& hull) {
  std::vector<Vec3> out;
  const auto& p = hull.mesh().points;
  for (const auto& t : hull.mesh().triangles) {
    const Vec3 n = (p[t[1]] - p[t[0]]).cross(p[t[2]] - p[t[0]]);
    const double h = n.dot(p[t[0]]);
    if (h > 1e-9 * n.norm()) out.emplace_back(n / h);
  }
  return out;
}

ConvexHull::ConvexHull(const std::vector<Vec3>& points) {
  if (is_flat(points)) throw ShapeError("the points lie in a plane: their convex hull has no inside");
  TriangleMesh all{points, hull_triangles(points)};
  mesh_ = weld(all, 0);
  std::vector<std::vector<int>> beside(mesh_.points.size());
  for (const auto& t : mesh_.triangles)
    for (int k = 0; k < 3; ++k) {
      beside[t[k]].push_back(t[(k + 1) % 3]);
      beside[t[(k + 1) % 3]].push_back(t[k]);
    }
  first_.push_back(0);
  for (auto& list : beside) {
    std::sort(list.begin(), list.end());
    list.erase(std::unique(list.begin(), list.end()), list.end());
    neighbours_.insert(neighbours_.end(), list.begin(), list.end());
    first_.push_back(static_cast<int>(neighbours_.size()));
  }
  measure();
}

void ConvexHull::measure() {
  Eigen::AlignedBox3d box;
  for (const Vec3& p : mesh_.points) box.extend(p);
  extent_ = box.diagonal().norm();
  near_.clear();
  cells_ = 0;
  if (mesh_.points.size() < kManyVertices) return;
  const int cells = static_cast<int>(std::sqrt(static_cast<double>(mesh_.points.size()) / 6));  // one each
  for (int face = 0; face < 6; ++face)
    for (int i = 0; i < cells; ++i)
      for (int j = 0; j < cells; ++j)
        near_.push_back(climb(cell_middle(face, i, j, cells), near_.empty() ? 0 : near_.back()));
  cells_ = cells;
}

ConvexHull ConvexHull::image(const Mat3& m, const Vec3& shift) const {
  ConvexHull out = *this;
  for (Vec3& p : out.mesh_.points) p = m * p + shift;
  out.measure();
  return out;
}

int ConvexHull::support(const Vec3& d, int start) const {
  if (cells_ > 0 && d.squaredNorm() > 0) {
    const CubePoint c = to_cube(d);
    const int known = near_[(c.face * cells_ + cube_cell(c.a, cells_)) * cells_ + cube_cell(c.b, cells_)];
    if (d.dot(mesh_.points[known]) > d.dot(mesh_.points[start])) start = known;
  }
  return climb(d, start);
}

int ConvexHull::climb(const Vec3& d, int start) const {
  int at = start;
  double best = d.dot(mesh_.points[at]);
  for (bool climbs = true; climbs;) {
    climbs = false;
    int next = at;
    for (int k = first_[at]; k < first_[at + 1]; ++k) {
      const double h = d.dot(mesh_.points[neighbours_[k]]);
      if (h > best) best = h, next = neighbours_[k];
    }
    if (next != at) at = next, climbs = true;
  }
  return at;
}

Vec3 ConvexHull::way(const Vec3& x, double enough, int& start) const {
  Vec3 simplex[4] = {mesh_.points[start] - x};
  int count = 1;
  Vec3 nearest = simplex[0];
  for (int k = 0; k < kGjkIterations; ++k) {
    const double far = nearest.norm();
    if (far <= std::max(enough, kGjkTolerance * extent_))
      return far <= kGjkTolerance * extent_ ? Vec3(Vec3::Zero()) : nearest;
    start = support(-nearest, start);
    const Vec3 y = mesh_.points[start] - x;
    if (far * far - nearest.dot(y) <= kGjkTolerance * extent_ * far) return nearest;
    for (int i = 0; i < count; ++i)
      if (simplex[i] == y) return nearest;
    simplex[count++] = y;
    nearest = nearest_on_simplex(simplex, count);
    if (count == 4) return Vec3::Zero();
  }
  return nearest;
}

}  // namespace nurbs

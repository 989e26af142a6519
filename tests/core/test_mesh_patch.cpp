// Patches of fine meshes against counting, and planes against comparing every triangle with every plane.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "contact/walls/mesh_patch.h"
#include "support/random.h"

namespace nurbs::test_mesh_patch {
namespace {

using test::Random;

constexpr double kWeld = 1e-6;

// Two triangles for each of n x n cells of the unit square, under `height`, in any order and from any corner;
// every other one again.
std::vector<Triangle> sheet(int n, Random& random, const std::function<double(double, double)>& height) {
  const auto at = [&](int i, int j) {
    const double x = double(i) / n, y = double(j) / n;
    return Vec3(x, y, height(x, y));
  };
  std::vector<Triangle> all;
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) {
      all.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      all.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  for (std::size_t k = 0, count = all.size(); k < count; k += 2) all.push_back(all[k]);
  for (std::size_t k = all.size(); k-- > 1;) std::swap(all[k], all[random.below(static_cast<int>(k) + 1)]);
  for (Triangle& t : all) {
    std::rotate(t.begin(), t.begin() + random.below(3), t.end());
    if (random.below(2)) std::swap(t[0], t[1]);
  }
  return all;
}

double area(const Triangle& t) {
  return (t[1] - t[0]).cross(t[2] - t[0]).norm();
}

// The triangles in which planes begin, by the rule of find_planes: the largest first.
std::vector<int> leaders(const std::vector<Triangle>& triangles, const MeshPatch& patch, double distance) {
  std::vector<int> order;
  for (const MeshPatch::Cell& cell : patch.cells()) order.push_back(cell.triangle);
  std::vector<double> size;
  for (const Triangle& t : triangles) size.push_back(0.5 * area(t));
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return size[a] > size[b]; });
  std::vector<int> found;
  for (const int k : order) {
    const bool lies_in_one = std::any_of(found.begin(), found.end(), [&](int leader) {
      const Triangle& own = triangles[leader];
      const Vec3 normal = (own[1] - own[0]).cross(own[2] - own[0]).normalized();
      return std::all_of(triangles[k].begin(), triangles[k].end(),
                         [&](const Vec3& x) { return std::abs(normal.dot(x - own[0])) <= distance; });
    });
    if (!lies_in_one) found.push_back(k);
  }
  return found;
}

void expect_sheet(int n, const std::vector<Triangle>& triangles, double flat) {
  MeshPatch patch;
  patch.build(triangles.data(), static_cast<int>(triangles.size()), kWeld, flat, 100 * kWeld);
  EXPECT_EQ(patch.cells().size(), 2u * n * n);
  EXPECT_EQ(patch.vertices().size(), (n + 1u) * (n + 1u));
  EXPECT_EQ(patch.edges().size(), 3u * n * n + 2u * n);
  std::vector<int> planes;
  for (const MeshPatch::Plane& plane : patch.planes()) planes.push_back(plane.leader);
  EXPECT_EQ(planes, leaders(triangles, patch, std::max(flat, 1e-3 * kWeld)));
}

TEST(MeshPatch, fine_sheets_have_their_cells_corners_edges_and_planes) {
  Random random(77);
  for (const double flat : {kWeld, 1e-4, 3e-3}) {
    expect_sheet(40, sheet(40, random, [](double, double) { return 0.0; }), flat);
    expect_sheet(
        40, sheet(40, random, [](double x, double y) { return 0.1 * std::sin(9 * x) * std::cos(7 * y); }),
        flat);
    // Bent along one axis only, and hardly at all.
    expect_sheet(40, sheet(40, random, [](double x, double) { return 0.3 * x * x; }), flat);
    expect_sheet(40, sheet(40, random, [&](double, double) { return random.uniform(0, 1e-7); }), flat);
  }
}

// Gaps below `crack` close, those above stay: a strip whose triangles are a little apart.
TEST(MeshPatch, cracks_close_on_fine_sheets) {
  Random random(78);
  for (const double shift : {3e-5, 3e-4}) {
    std::vector<Triangle> triangles = sheet(30, random, [](double, double) { return 0.0; });
    for (Triangle& t : triangles)
      if ((t[0] + t[1] + t[2])[0] / 3 > 0.5)
        for (Vec3& x : t) x[0] += shift;
    MeshPatch patch;
    patch.build(triangles.data(), static_cast<int>(triangles.size()), kWeld, kWeld, 100 * kWeld);
    const unsigned more = shift < 100 * kWeld ? 0 : 30;
    EXPECT_EQ(patch.edges().size(), 3u * 900 + 60 + more) << shift;
    EXPECT_EQ(patch.planes().size(), 1u);
  }
}

}  // namespace
}  // namespace nurbs::test_mesh_patch

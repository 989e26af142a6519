// Adaptive quads of every patch, and the kinked joints, painted onto the cube map; see normal_map.h.
#include "body/normal_map.h"

#include <algorithm>
#include <cmath>

#include "body/connectivity.h"
#include "body/cube_map.h"
#include "body/curvature.h"
#include "body/local_form.h"
#include "body/shape.h"
#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Raises the radius of every cell that a cap of directions may touch.
void paint(const Vec3& center, double angle, double radius, NormalMap& map) {
  const float value = std::nextafter(static_cast<float>(radius), std::numeric_limits<float>::infinity());
  for (int k = 0; k < 3; ++k)
    for (const double side : {1.0, -1.0}) {
      const double major = side * center[k];
      if (major < 0.3) continue;  // further than a cap from this face: those are at most kNormalCap wide
      const double a = center[(k + 1) % 3] / major, b = center[(k + 2) % 3] / major;
      const double reach = 1.3 * angle * (1 + a * a + b * b);
      if (std::abs(a) - reach > 1 || std::abs(b) - reach > 1) continue;
      float* face = map.radius.data() + (2 * k + (side < 0)) * map.cells * map.cells;
      for (int i = cube_cell(a - reach, map.cells); i <= cube_cell(a + reach, map.cells); ++i)
        for (int j = cube_cell(b - reach, map.cells); j <= cube_cell(b + reach, map.cells); ++j)
          face[i * map.cells + j] = std::max(face[i * map.cells + j], value);
    }
}

class Painter {
 public:
  Painter(const Shape& shape, NormalMap& map)
      : shape_(shape), map_(map), flat_(kCurvatureNoise / shape.bounding_radius) {}

  void paint_patches() {
    for (size_t p = 0; p < shape_.patches.size(); ++p)
      for (int i = 0; i < kNormalQuads; ++i)
        for (int j = 0; j < kNormalQuads; ++j) paint_quad(shape_.patches[p], i, j, kNormalQuads, 0);
  }

  void paint_kinks() {
    for (size_t p = 0; p < shape_.patches.size(); ++p)
      for (int e = 0; e < 4; ++e)
        if (std::abs(shape_.links[p][e].kink) > kNoKink) paint_joint(static_cast<int>(p), e);
  }

 private:
  // Quad (i, j) of a patch cut into n x n.
  void paint_quad(const BezierPatch& patch, int i, int j, int n, int depth) {
    static constexpr double kAt[5][2] = {{0.5, 0.5}, {0, 0}, {1, 0}, {0, 1}, {1, 1}};
    Vec3 normal[5];
    double least = kInfinity, largest = 0, spread = 0;
    for (int k = 0; k < 5; ++k) {
      const LocalForm form = local_form(patch, (i + kAt[k][0]) / n, (j + kAt[k][1]) / n);
      normal[k] = form.normal;
      const double radius = form.k_min > flat_ ? 1 / form.k_min : kInfinity;
      least = std::min(least, radius);
      largest = std::max(largest, radius);
      spread = std::max(spread, angle_between(normal[0], normal[k]));
    }
    const bool even = largest <= kEvenRadius * least;  // infinity <= infinity: all flat or dented
    if ((spread > kNormalQuadAngle || !even) && depth < kNormalDepth) {
      for (int k = 0; k < 4; ++k) paint_quad(patch, 2 * i + k / 2, 2 * j + k % 2, 2 * n, depth + 1);
      return;
    }
    const double radius = even ? kRadiusSafety * largest : largest * (largest / least);
    paint(normal[0], kCapSafety * spread + kNormalMargin, radius, map_);
  }

  // The normals of both sides and those between.
  void paint_joint(int patch, int edge) {
    const EdgeLink& link = shape_.links[patch][edge];
    Vec3 before;
    for (int k = 0; k <= kNormalJointSamples; ++k) {
      const double t = static_cast<double>(k) / kNormalJointSamples;
      const Vec2 at = edge_parameters(edge, t);
      const Vec3 here = local_form(shape_.patches[patch], at[0], at[1]).normal;
      Vec3 there = here;
      if (link.patch >= 0) {
        const Vec2 other = edge_parameters(link.edge, partner_parameter(link, t));
        there = local_form(shape_.patches[link.patch], other[0], other[1]).normal;
      }
      const Vec3 middle = (here + there).normalized();
      const double step = k > 0 ? angle_between(before, middle) : 0;
      const double half = kJointCapSafety * angle_between(middle, here);
      paint(middle, std::min(kNormalCap, step + half + kNormalMargin), kInfinity, map_);
      before = middle;
    }
  }

  const Shape& shape_;
  NormalMap& map_;
  double flat_;  // curvatures up to this are none
};

}  // namespace

double NormalMap::radius_at(const Vec3& n) const {
  if (cells == 0) return kInfinity;
  const CubePoint c = to_cube(n);
  if (!(c.major > 0.5)) return kInfinity;  // no unit vector
  return radius[(c.face * cells + cube_cell(c.a, cells)) * cells + cube_cell(c.b, cells)];
}

NormalMap make_normal_map(const Shape& shape) {
  NormalMap map;
  if (!shape.dented() && shape.patch_curvature.max_radius <= kLongRadius * shape.bounding_radius) return map;
  map.cells = kNormalCells;
  map.radius.assign(6u * kNormalCells * kNormalCells, 0);
  Painter painter(shape, map);
  painter.paint_patches();
  painter.paint_kinks();
  for (float& radius : map.radius)  // a cell no normal was seen in: sharper than the samples
    if (radius == 0) radius = std::numeric_limits<float>::infinity();
  return map;
}

}  // namespace nurbs

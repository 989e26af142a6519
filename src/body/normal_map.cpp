// Leaves of every patch, and the kinked joints, painted onto the cube map; see normal_map.h.
#include "body/normal_map.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "body/connectivity.h"
#include "body/cube_map.h"
#include "body/joints.h"
#include "body/local_form.h"
#include "body/shape.h"
#include "body/surface_bounds.h"
#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

constexpr double kFanStep = 0.02;    // rad, between caps painted across a joint
constexpr double kNoValley = 1e-12;  // rad: normals' round-off

// Raises the radius of every cell that a cap of directions may touch.
void paint(const Vec3& center, double angle, double radius, NormalMap& map) {
  const float value = std::nextafter(static_cast<float>(radius), std::numeric_limits<float>::infinity());
  visit_cells(center, angle, map.cells,
              [&](int cell) { map.radius[cell] = std::max(map.radius[cell], value); });
}

// The same for caps of any width. By blocks of cells, of which those are passed over that a cap does not
// reach or that have as large radii already.
class WidePainter {
 public:
  void paint(const Vec3& center, double angle, double radius, NormalMap& map) {
    const float value = std::nextafter(static_cast<float>(radius), std::numeric_limits<float>::infinity());
    if (x_.empty()) set_up(map.cells);
    const double reach = angle + 1.5 / map.cells;  // half a cell's diagonal, at most
    const auto cosine_of = [](double wide) { return wide < M_PI ? std::cos(wide) - kRoundoff : -2; };
    const double cosine = cosine_of(reach), cosine_of_block = cosine_of(reach + widest_);
    for (Block& block : blocks_)
      if (block.least < value && center.dot(block.middle) >= cosine_of_block)
        paint(block, center, cosine, value, map);
  }

 private:
  static constexpr int kSide = 8;  // cells along a block's
  static_assert(kNormalCells % kSide == 0, "faces are whole blocks");
  struct Block {
    int first;         // cell
    Vec3 middle;       // unit
    float least = -1;  // radius of its cells, when it was painted last
  };

  void paint(Block& block, const Vec3& center, double cosine, float value, NormalMap& map) const {
    const double a = center[0], b = center[1], c = center[2];
    block.least = value;
    for (int row = 0; row < kSide; ++row) {
      const int first = block.first + row * map.cells;
      const double *x = x_.data() + first, *y = y_.data() + first, *z = z_.data() + first,
                   *norm = norm_.data() + first;
      float* const to = map.radius.data() + first;
      for (int k = 0; k < kSide; ++k) {  // a loop for vectors
        const float painted = a * x[k] + b * y[k] + c * z[k] >= cosine * norm[k] ? value : 0;
        to[k] = std::max(to[k], painted);
      }
      for (int k = 0; k < kSide; ++k) block.least = std::min(block.least, to[k]);
    }
  }

  void set_up(int cells) {
    for (int face = 0; face < 6; ++face)
      for (int i = 0; i < cells; ++i)
        for (int j = 0; j < cells; ++j) {
          const Vec3 d = cell_middle(face, i, j, cells);
          x_.push_back(d[0]);
          y_.push_back(d[1]);
          z_.push_back(d[2]);
          norm_.push_back(d.norm());
        }
    for (int face = 0; face < 6; ++face)
      for (int i = 0; i < cells; i += kSide)
        for (int j = 0; j < cells; j += kSide) {
          Block block{(face * cells + i) * cells + j, Vec3::Zero()};
          std::array<Vec3, 4> corner;
          for (int k = 0; k < 4; ++k) {
            corner[k] =
                cell_middle(face, i + k / 2 * (kSide - 1), j + k % 2 * (kSide - 1), cells).normalized();
            block.middle += corner[k];
          }
          block.middle.normalize();
          for (const Vec3& d : corner) widest_ = std::max(widest_, angle_between(d, block.middle));
          blocks_.push_back(block);
        }
  }

  std::vector<double> x_, y_, z_, norm_;  // through the cells' middles
  std::vector<Block> blocks_;
  double widest_ = 0;  // rad, of a block's cells' middles from its own
};

class Painter {
 public:
  Painter(const Shape& shape, NormalMap& map) : shape_(shape), map_(map) {}

  void paint_leaf(const Leaf& leaf) {
    const CellBounds& b = leaf.bounds;
    const double radius = b.convex ? b.max_radius : kInfinity;
    const double angle = b.regular ? b.cone + kNormalMargin : kInfinity;
    if (angle <= kNormalCap)
      paint(b.axis, angle, radius, map_);
    else
      wide_.paint(b.axis, angle, radius, map_);
  }

  // Creases that open are left as they are: on the surface at a small distance e outside they are tubes, and
  // corners at which all joints open are caps, of radius e and positive orientation, and in h'' + h they
  // count with radius 0. But a crease that runs through a dent makes a tube of negative orientation.
  void paint_joints() {
    const double gap = kJointRoundoff * shape_.bounding_radius;
    for (size_t p = 0; p < shape_.patches.size(); ++p)
      for (int e = 0; e < 4; ++e) {
        const EdgeLink& link = shape_.links[p][e];
        if (link.gap > gap ||
            (link.kinked() ? may_close(static_cast<int>(p), e) : may_hide_valley(static_cast<int>(p), e)))
          paint_joint(static_cast<int>(p), e);
        else if (shape_.dented() && link.kinked() && link.patch >= 0)
          for (const EdgePart& part : find_dented_parts(shape_.patches[p], e))
            paint_fan(static_cast<int>(p), e, part);
      }
  }

 private:
  bool may_close(int patch, int edge) const {
    const EdgeLink& link = shape_.links[patch][edge];
    return link.patch < 0 || link.kink < -kNoKink || closing(patch, edge) > kNoKink;
  }
  double closing(int patch, int edge) const {
    const EdgeLink& link = shape_.links[patch][edge];
    return bound_kink(shape_.patches[patch], edge, shape_.patches[link.patch], link).closing;
  }

  // Whether a joint that is no kink closes by enough to count where the body is as flat as it is there: it
  // hides the square of its angle, over the curvature.
  bool may_hide_valley(int patch, int edge) const {
    const EdgeLink& link = shape_.links[patch][edge];
    if (link.collapsed || link.patch < 0 || !(link.kink_bound > kNoValley)) return false;
    const double angle = closing(patch, edge);
    if (!(angle > kNoValley)) return false;
    double radius = 0;
    for (int k = 0; k <= kNormalJointSamples; ++k)
      radius = std::max(
          radius, map_.radius_at(sides(patch, edge, static_cast<double>(k) / kNormalJointSamples).here));
    return 0.5 * angle * angle * radius > kRoundoff * shape_.bounding_radius;
  }

  // The normals of a joint's two sides at its parameter t, the same twice where there is one.
  struct Sides {
    Vec3 here, there;
  };
  Sides sides(int patch, int edge, double t) const {
    const EdgeLink& link = shape_.links[patch][edge];
    const Vec2 at = edge_parameters(edge, t);
    const Vec3 here = local_form(shape_.patches[patch], at[0], at[1]).normal;
    if (link.patch < 0) return {here, here};
    const SurfacePoint other = across(shape_.patches, link, {patch, at[0], at[1]}, edge);
    return {here, local_form(shape_.patches[link.patch], other.u, other.v).normal};
  }

  // The normals of both sides and those between.
  void paint_joint(int patch, int edge) {
    Vec3 before;
    for (int k = 0; k <= kNormalJointSamples; ++k) {
      const auto [here, there] = sides(patch, edge, static_cast<double>(k) / kNormalJointSamples);
      const Vec3 middle = (here + there).normalized();
      const double step = k > 0 ? angle_between(before, middle) : 0;
      const double half = kJointCapSafety * angle_between(middle, here);
      paint(middle, std::min(kNormalCap, step + half + kNormalMargin), kInfinity, map_);
      before = middle;
    }
  }

  // The normals between both sides of a part of a joint, sampled at its ends and middle.
  void paint_fan(int patch, int edge, const EdgePart& part) {
    const double half = 0.5 * (part.to - part.from);
    const Sides middle = sides(patch, edge, part.from + half);
    double along = 0;
    for (const double t : {part.from, part.from + 2 * half}) {
      const Sides end = sides(patch, edge, t);
      along = std::max({along, angle_between(end.here, middle.here), angle_between(end.there, middle.there)});
    }
    const double width = angle_between(middle.here, middle.there);
    const int caps = 1 + static_cast<int>(width / kFanStep);
    for (int k = 0; k <= caps; ++k) {
      const double t = width * k / caps;
      const Vec3 between = std::sin(width - t) * middle.here + std::sin(t) * middle.there,
                 n = width > kNoKink ? Vec3(between.normalized()) : middle.here;
      wide_.paint(n, width / caps + kJointCapSafety * along + kNormalMargin, kInfinity, map_);
    }
  }

  const Shape& shape_;
  NormalMap& map_;
  WidePainter wide_;
};

}  // namespace

double NormalMap::radius_at(const Vec3& n) const {
  if (cells == 0) return kInfinity;
  const CubePoint c = to_cube(n);
  if (!(c.major > 0.5)) return kInfinity;  // no unit vector
  return radius[(c.face * cells + cube_cell(c.a, cells)) * cells + cube_cell(c.b, cells)];
}

NormalMap make_normal_map(const Shape& shape, SurfaceBounds* bounds) {
  NormalMap map;
  if (!shape.dented() && shape.patch_curvature.max_radius <= kLongRadius * shape.bounding_radius) return map;
  map.cells = kNormalCells;
  map.radius.assign(6u * kNormalCells * kNormalCells, 0);
  Painter painter(shape, map);
  const int patches = static_cast<int>(shape.patches.size());
  refine_normals(kRoundLeafAngle, kFlatLeafAngle, kEvenRadius,
                 kMostNormalCells + kMostCellsPerPatch * patches, bounds);
  for (const Leaf& leaf : bounds->leaves) painter.paint_leaf(leaf);
  painter.paint_joints();
  for (float& radius : map.radius)  // a cell that no normal reaches: on a crease
    if (radius == 0) radius = std::numeric_limits<float>::infinity();
  return map;
}

}  // namespace nurbs

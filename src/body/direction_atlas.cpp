// Nodes of the cube map (cube_map.h): a and b uniform in [-1, 1] on every face.
#include "body/direction_atlas.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "body/cube_map.h"
#include "body/shape.h"
#include "body/support.h"
#include "nurbs/tolerances.h"
#include "nurbs/wide.h"

namespace nurbs {
namespace {

constexpr double kWidestCell = 0.3;  // parameter: what is between nodes further apart may be anywhere

// Where in a cell a direction lies: the number of its first node, and how far on, of a cell, towards the next
// row and the next node of a row.
struct Place {
  int first;
  double s, t;
};
NURBS_INLINE Place place_in(const CubePoint& c, int cells) {
  const double half = 0.5 * cells, a = (c.a + 1) * half, b = (c.b + 1) * half;
  const int i = std::clamp(static_cast<int>(a), 0, cells - 1),
            j = std::clamp(static_cast<int>(b), 0, cells - 1);
  return {(c.face * (cells + 1) + i) * (cells + 1) + j, a - i, b - j};
}

}  // namespace

Vec3 DirectionAtlas::direction(int node) const {
  const int n = cells + 1;
  const int face = node / (n * n), i = node / n % n, j = node % n;
  return from_cube(face, -1.0 + 2.0 * i / cells, -1.0 + 2.0 * j / cells);
}

int DirectionAtlas::nearest(const Vec3& d) const {
  const CubePoint c = to_cube(d);
  if (!(c.major > 0)) return 0;
  const double half = 0.5 * cells;
  const int i = std::clamp(static_cast<int>((c.a + 1) * 2 * half + 1) / 2, 0, cells);
  const int j = std::clamp(static_cast<int>((c.b + 1) * 2 * half + 1) / 2, 0, cells);
  return (c.face * (cells + 1) + i) * (cells + 1) + j;
}

SurfacePoint DirectionAtlas::place(const Vec3& d) const {
  const CubePoint c = to_cube(d);
  if (!(c.major > 0)) return where[0];
  const auto [first, s, t] = place_in(c, cells);
  const SurfacePoint* const p = where.data() + first;
  const SurfacePoint* const q = p + cells + 1;
  const SurfacePoint& nearest = (s < 0.5 ? p : q)[t < 0.5 ? 0 : 1];
  const double weight[4] = {(1 - s) * (1 - t), (1 - s) * t, s * (1 - t), s * t};
  SurfacePoint between{nearest.patch, 0, 0};
  for (int k = 0; k < 4; ++k) {
    const SurfacePoint& node = (k < 2 ? p : q)[k % 2];
    // At poles and seams parameters jump.
    if (node.patch != nearest.patch ||
        std::max(std::abs(node.u - nearest.u), std::abs(node.v - nearest.v)) > kWidestCell)
      return nearest;
    between.u += weight[k] * node.u;
    between.v += weight[k] * node.v;
  }
  return between;
}

void DirectionAtlas::cell(const Vec3& d, int (&nodes)[4]) const {
  const CubePoint c = to_cube(d);
  const int first = place_in(c, cells).first;
  nodes[0] = first;
  nodes[1] = first + 1;
  nodes[2] = first + cells + 1;
  nodes[3] = first + cells + 2;
}

double DirectionAtlas::support_upper(const Vec3& d) const {
  const CubePoint c = to_cube(d);
  if (!(c.major > 0)) return 0;
  const auto [first, s, t] = place_in(c, cells);
  const double* h = support.data() + first;
  const double low = h[0] + t * (h[1] - h[0]);
  const double* k = h + cells + 1;
  const double high = k[0] + t * (k[1] - k[0]);
  return c.major * (low + s * (high - low));
}

void DirectionAtlas::support_upper(const Triple<Lane4>& d, Lane4* upper) const {
  using Ints = int __attribute__((vector_size(16)));
  const Lane4 zero = all<Lane4>(0), last = all<Lane4>(cells - 1), half = all<Lane4>(0.5 * cells);
  const Lane4 x = magnitude(d.x), y = magnitude(d.y), z = magnitude(d.z);
  const Mask4 on_x = (x >= y) & (x >= z), on_y = y >= z;  // where not on x
  const Lane4 towards = select(on_x, d.x, select(on_y, d.y, d.z)), major = magnitude(towards);
  const Lane4 a = (select(on_x, d.y, select(on_y, d.z, d.x)) / major + 1.0) * half,
              b = (select(on_x, d.z, select(on_y, d.x, d.y)) / major + 1.0) * half;
  const auto cell_of = [&](const Lane4& at) {  // 0 where d is none
    const Lane4 inside = select(at > 0.0, smaller(at, last), zero);
    return __builtin_convertvector(__builtin_convertvector(inside, Ints), Lane4);
  };
  const Lane4 i = cell_of(a), j = cell_of(b), s = a - i, t = b - j, row = all<Lane4>(cells + 1),
              face = select(on_x, zero, select(on_y, all<Lane4>(2), all<Lane4>(4))) +
                     select(towards < 0.0, all<Lane4>(1), zero);
  const Ints first = __builtin_convertvector((face * row + i) * row + j, Ints);
  Lane4 h0, h1, k0, k1;
  for (int l = 0; l < 4; ++l) {
    const double* const h = support.data() + first[l];
    h0[l] = h[0];
    h1[l] = h[1];
    k0[l] = h[cells + 1];
    k1[l] = h[cells + 2];
  }
  const Lane4 low = h0 + t * (h1 - h0), high = k0 + t * (k1 - k0);
  *upper = major * (low + s * (high - low));
}

namespace {

// A few points of every patch, to start the first support searches from; coordinates by kWidth side by side,
// the last ones repeated.
struct Samples {
  std::vector<SurfacePoint> where;
  std::vector<Triple<Wide>> points;
};

Samples sample_patches(const Shape& shape) {
  Samples samples;
  Vec3 point = Vec3::Zero();
  const auto add = [&](size_t number) {
    if (number % kWidth == 0) samples.points.emplace_back();
    set_lane(triple(point), static_cast<int>(number % kWidth), &samples.points.back());
  };
  for (size_t p = 0; p < shape.patches.size(); ++p)
    for (int i = 0; i < kAtlasSamples; ++i)
      for (int j = 0; j < kAtlasSamples; ++j) {
        const SurfacePoint at{static_cast<int>(p), (i + 0.5) / kAtlasSamples, (j + 0.5) / kAtlasSamples};
        point = evaluate0(shape.patches[p], at.u, at.v);
        add(samples.where.size());
        samples.where.push_back(at);
      }
  for (size_t number = samples.where.size(); number % kWidth != 0; ++number) add(number);
  return samples;
}

// The first of the highest ones.
const SurfacePoint& best_sample(const Samples& samples, const Vec3& d) {
  const Triple<Wide> to{all<Wide>(d[0]), all<Wide>(d[1]), all<Wide>(d[2])};
  Wide most = all<Wide>(-std::numeric_limits<double>::infinity()), block = all<Wide>(0);
  for (size_t k = 0; k < samples.points.size(); ++k) {
    const Wide height = dot(to, samples.points[k]);
    const WideMask higher = height > most;
    most = select(higher, height, most);
    block = select(higher, all<Wide>(static_cast<double>(k)), block);
  }
  size_t best = 0;
  double highest = -std::numeric_limits<double>::infinity();
  for (int l = 0; l < kWidth; ++l) {
    const size_t number = std::min(static_cast<size_t>(block[l]) * kWidth + l, samples.where.size() - 1);
    if (most[l] < highest || (most[l] == highest && number > best)) continue;
    highest = most[l];
    best = number;
  }
  return samples.where[best];
}

}  // namespace

DirectionAtlas make_atlas(const Shape& shape, int cells) {
  DirectionAtlas atlas;
  const Samples samples = sample_patches(shape);
  const size_t count = 6u * static_cast<size_t>((cells + 1) * (cells + 1));
  atlas.cells = cells;
  atlas.support.assign(count, 0);
  atlas.point.assign(count, Vec3::Zero());
  atlas.where.assign(count, SurfacePoint());
  for (size_t node = 0; node < count; ++node) {
    const Vec3 cube = atlas.direction(static_cast<int>(node));
    const double length = cube.norm();
    const Vec3 d = cube / length;
    const Support support = find_hull_support(shape, d, &best_sample(samples, d));
    atlas.support[node] = support.upper * length;
    atlas.point[node] = support.point;
    atlas.where[node] = support.where;
  }
  return atlas;
}

}  // namespace nurbs

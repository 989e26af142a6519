// What is proven of a body at load: every bound against dense evaluation, on bodies built to hide from
// samples.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "body/connectivity.h"
#include "body/enclosure.h"
#include "body/joints.h"
#include "body/local_form.h"
#include "body/proofs.h"
#include "body/shape.h"
#include "body/support.h"
#include "body/surface_bounds.h"
#include "contact/pair_search.h"
#include "io/pair_case.h"
#include "io/shape_file.h"
#include "nurbs/affine.h"
#include "nurbs/tolerances.h"
#include "shapes/primitives.h"
#include "shapes/revolved.h"
#include "support/bodies.h"
#include "support/cases.h"
#include "support/random.h"

namespace nurbs::test_proofs {
namespace {

using namespace test;
using Surfaces = std::vector<NurbsSurface>;

// The same surface at u = r s / (1 + (r - 1) s), likewise v: one Bezier piece's weights times powers.
void reparametrise(NurbsSurface& s, double along_u, double along_v) {
  for (int i = 0; i < s.size_u; ++i)
    for (int j = 0; j < s.size_v; ++j) s.point(i, j) *= std::pow(along_u, i) * std::pow(along_v, j);
}

Surfaces mismatched(Random& random, Surfaces body, double most) {
  for (NurbsSurface& s : body) {
    const double u = random.log_uniform(1 / most, most), v = random.log_uniform(1 / most, most);
    reparametrise(s, u, v);
  }
  return body;
}

// Largest |C(t, t, t)| at a point by finite differences of W along geodesics of the Gauss map: independent of
// the formula in enclosure.cpp.
Mat3 map_at(const BezierPatch& patch, double u, double v, Vec3* n) {
  const Jet2 j = evaluate2(patch, u, v);
  *n = j.su.cross(j.sv).normalized();
  Mat2 d;
  d << -n->dot(j.suu), -n->dot(j.suv), -n->dot(j.suv), -n->dot(j.svv);
  Eigen::Matrix<double, 3, 2> jacobian;
  jacobian << j.su, j.sv;
  return jacobian * d.inverse() * jacobian.transpose();
}
double rate_seen(const BezierPatch& patch, double u, double v) {
  double most = 0;
  for (const Vec2& step : {Vec2(1e-5, 0), Vec2(0, 1e-5), Vec2(1e-5, 1e-5), Vec2(1e-5, -1e-5)}) {
    Vec3 a, b;
    const Mat3 wa = map_at(patch, u - step[0], v - step[1], &a),
               wb = map_at(patch, u + step[0], v + step[1], &b);
    const Vec3 t = (b - a).normalized();
    // t' W t at both ends, t carried along the great circle.
    const Vec3 ta = (t - t.dot(a) * a).normalized(), tb = (t - t.dot(b) * b).normalized();
    most = std::max(most, std::abs(tb.dot(wb * tb) - ta.dot(wa * ta)) / angle_between(a, b));
  }
  return most;
}

// Every bound of a cell against points inside it.
void expect_encloses(const Shape& shape, int patch, const Cell& cell, Random& random) {
  const CellBounds b = enclose(shape.patches[patch], cell, {true, true});
  if (!b.regular) return;
  for (int k = 0; k < 12; ++k) {
    const double u = cell.u0 + cell.du * (k == 0 ? 0.5 : random.uniform(0, 1)),
                 v = cell.v0 + cell.dv * (k == 0 ? 0.5 : random.uniform(0, 1));
    const Jet2 j = evaluate2(shape.patches[patch], u, v);
    const Vec3 n = j.su.cross(j.sv);
    if (!(n.norm() > 1e-9 * j.su.norm() * j.sv.norm())) continue;
    ASSERT_LE(angle_between(b.axis, n), b.cone * (1 + 1e-9) + 1e-7) << shape.name;
    EXPECT_GE(n.norm() / j.sv.norm(), b.speed_u * (1 - 1e-9));
    EXPECT_GE(n.norm() / j.su.norm(), b.speed_v * (1 - 1e-9));
    const LocalForm f = local_form(shape.patches[patch], u, v);
    if (f.u != u || f.v != v) continue;
    EXPECT_GE(f.k_min, b.least_curvature - 1e-6 * f.k_max) << shape.name;
    EXPECT_LE(f.k_max, (1 + 1e-6) / b.min_radius) << shape.name;
    if (!b.convex) continue;
    EXPECT_LE(1 / f.k_min, b.max_radius * (1 + 1e-6)) << shape.name;
    if (b.rate < 1e300 && u > 1e-4 && v > 1e-4 && u < 1 - 1e-4 && v < 1 - 1e-4) {
      EXPECT_LE(rate_seen(shape.patches[patch], u, v), b.rate * 1.001 + 1e-5 * b.max_radius) << shape.name;
    }
  }
}

TEST(Enclosure, holds_at_every_point_of_every_cell) {
  Random random(7);
  std::vector<ShapePointer> shapes = {ellipsoid(), smooth_pebble(), polar(), kinked(), disc()};
  shapes.push_back(make_shape("needle", exact_ellipsoid({1, 0.05, 0.01})));
  shapes.push_back(make_shape("blocky", fitted_superellipsoid({1, 0.9, 0.8}, 4, 3)));
  shapes.push_back(make_shape("mismatched", mismatched(random, exact_ellipsoid({1, 0.7, 0.4}), 8)));
  for (const ShapePointer& shape : shapes)
    for (int trial = 0; trial < 60; ++trial) {
      const int patch = random.below(static_cast<int>(shape->patches.size()));
      Cell cell{patch};
      for (int edge = 0; edge < 4; ++edge)
        if (shape->links[patch][edge].collapsed) cell.pole = edge;
      for (int depth = random.whole(4, 14); depth > 0; --depth) {
        Cell a, b;
        halve(cell, random.below(2), &a, &b);
        cell = random.below(2) ? a : b;
      }
      expect_encloses(*shape, patch, cell, random);
    }
}

// As loading does, of cells of all kinds in one call: poles, weights, degrees, both orders of derivatives.
TEST(Enclosure, of_cells_side_by_side_is_that_of_each) {
  Random random(9);
  const std::vector<ShapePointer> shapes = {ellipsoid(), smooth_pebble(), polar(), kinked()};
  std::vector<Cell> cells(150);
  std::vector<Enclosed> all;
  for (Cell& cell : cells) {
    const Shape& shape = *shapes[random.below(4)];
    cell.patch = random.below(static_cast<int>(shape.patches.size()));
    for (int edge = 0; edge < 4; ++edge)
      if (shape.links[cell.patch][edge].collapsed) cell.pole = edge;
    for (int depth = random.whole(0, 8); depth > 0; --depth) {
      Cell a, b;
      halve(cell, random.below(2), &a, &b);
      cell = random.below(2) ? a : b;
    }
    all.push_back({&shape.patches[cell.patch], &cell, {random.below(2) == 1, random.below(2) == 1}, {}});
  }
  enclose(all.data(), static_cast<int>(all.size()));
  int rated = 0;
  for (const Enclosed& one : all) {
    Enclosed alone{one.patch, one.cell, one.wanted, {}};
    enclose(&alone, 1);
    const CellBounds &a = one.bounds, &b = alone.bounds;
    ASSERT_EQ(a.regular, b.regular);
    ASSERT_EQ(a.convex, b.convex);
    EXPECT_NEAR((a.axis - b.axis).norm(), 0, 1e-9);
    EXPECT_NEAR(a.cone, b.cone, 1e-9);
    const auto near = [](double x, double y) { return x == y || std::abs(x - y) <= 1e-7 * std::abs(y); };
    EXPECT_PRED2(near, a.min_radius, b.min_radius);
    EXPECT_PRED2(near, a.max_radius, b.max_radius);
    EXPECT_PRED2(near, a.rate, b.rate);
    EXPECT_PRED2(near, a.speed_u, b.speed_u);
    EXPECT_PRED2(near, a.stretch.most, b.stretch.most);
    EXPECT_PRED2(near, a.seen_rate, b.seen_rate);
    rated += a.rate > 0 && a.rate < 1e300;
  }
  EXPECT_GT(rated, 20);
}

// Sides of plates are needles: what is nothing of the body's size is an angle there.
TEST(Enclosure, of_needles_that_are_not_quite_plane) {
  Random random(8);
  int planes = 0;
  for (int trial = 0; trial < 200; ++trial) {
    const Vec3 half(1, random.uniform(0.3, 1), random.log_uniform(1e-5, 1));
    Surfaces body = box(half);
    transform(body, random.turn().toRotationMatrix(), Vec3::Zero());
    const Vec3 corner = body[0].point(0, 0).head<3>(),
               off = random.log_uniform(1e-16, 1e-13) * random.direction();
    for (NurbsSurface& s : body)
      for (int i = 0; i < s.size_u; ++i)
        for (int j = 0; j < s.size_v; ++j)
          if ((s.point(i, j).head<3>() - corner).norm() < 1e-9) s.point(i, j).head<3>() += off;
    const auto shape = make_shape("plate", body);
    using Long = Eigen::Matrix<long double, 3, 1>;
    for (const Leaf& leaf : bound_surface(*shape).leaves) {
      if (!leaf.bounds.regular) continue;
      const BezierPatch& patch = shape->patches[leaf.cell.patch];
      const auto at = [&](int i, int j) -> Long { return patch.point(i, j).head<3>().cast<long double>(); };
      planes += leaf.cell.du == 1 && leaf.cell.dv == 1;
      const Long axis = leaf.bounds.axis.cast<long double>().normalized();
      for (int k = 0; k < 8; ++k) {
        const long double u = leaf.cell.u0 + leaf.cell.du * (k % 2),
                          v = leaf.cell.v0 + leaf.cell.dv * (k / 2 % 2);
        const Long su = (1 - v) * (at(1, 0) - at(0, 0)) + v * (at(1, 1) - at(0, 1)),
                   sv = (1 - u) * (at(0, 1) - at(0, 0)) + u * (at(1, 1) - at(1, 0)), n = su.cross(sv);
        EXPECT_LE(axis.cross(n).norm() / n.norm(), leaf.bounds.cone + 4e-16) << half.transpose();
      }
    }
  }
  EXPECT_GT(planes, 1000);
}

TEST(Enclosure, turned_polar_cells_are_the_same) {
  // The pole at u = 0, u = 1, v = 0 and v = 1 of the same surface.
  const NurbsSurface original = revolved_ellipsoid(1, 0.6)[0];
  NurbsSurface swapped = swap_uv(original);
  std::vector<CellBounds> seen;
  for (const NurbsSurface& surface : {original, swapped}) {
    const auto shape = make_shape("turned", {surface});
    for (const BezierPatch& patch : shape->patches) {
      const size_t p = &patch - shape->patches.data();
      for (int edge = 0; edge < 4; ++edge) {
        if (!shape->links[p][edge].collapsed) continue;
        Cell cell{static_cast<int>(p)};
        cell.pole = edge;
        for (int k = 0; k < 4; ++k) {
          Cell across, beyond;
          halve(cell, edge < 2, &across, &beyond);
          cell = edge % 2 ? beyond : across;
          Cell first, second;
          halve(cell, edge >= 2, &first, &second);
          cell = k % 2 ? first : second;
        }
        const CellBounds b = enclose(patch, cell, {});
        EXPECT_TRUE(b.convex);
        EXPECT_LE(b.seen_max, b.max_radius);
        EXPECT_GE(b.seen_min, b.min_radius);
        EXPECT_LT(b.max_radius, 2 * b.seen_max);
      }
    }
  }
}

TEST(Radii, of_ellipsoids_to_1000_to_1_hold_and_are_tight) {
  Random random(11);
  const Vec3 given[] = {{1, 0.15, 0.03}, {1, 0.1, 0.01}, {1, 1, 0.001}, {1, 0.001, 0.001}, {1, 0.03, 0.001}};
  for (Vec3 a : given) {
    std::shuffle(a.data(), a.data() + 3, random.engine());
    const auto shape = make_shape("ellipsoid", exact_ellipsoid(a));
    std::sort(a.data(), a.data() + 3);
    const double least = a[0] * a[0] / a[2], most = a[2] * a[2] / a[0];
    EXPECT_LE(shape->patch_curvature.min_radius, least * (1 + 1e-9)) << a.transpose();
    EXPECT_GE(shape->patch_curvature.max_radius, most * (1 - 1e-9)) << a.transpose();
    EXPECT_GE(shape->patch_curvature.min_radius, 0.8 * least) << a.transpose();
    EXPECT_LE(shape->patch_curvature.max_radius, 1.2 * most) << a.transpose();
    EXPECT_TRUE(shape->proofs.convex) << a.transpose();
  }
}

TEST(Radii, see_a_spike_between_all_samples) {
  // A lens whose rim lies in a thousandth of its patch's parameter. The truth is the same surface at even
  // parameters, looked at densely.
  for (const double ratio : {1.0, 30.0, 1000.0}) {
    Surfaces body{surface_of_revolution({{0, -0.6, 1}, {1, -0.6, 1}, {1, 0, 1}, {1, 0.6, 1}, {0, 0.6, 1}})};
    const auto even = make_shape("even", body);
    double least = 1e300;
    for (const BezierPatch& patch : even->patches)
      for (int k = 1; k < 4000; ++k) least = std::min(least, 1 / local_form(patch, 0.5, k / 4000.0).k_max);
    for (int i = 0; i < body[0].size_u; ++i)
      for (int j = 0; j < body[0].size_v; ++j) body[0].point(i, j) *= std::pow(ratio, j);
    const auto shape = make_shape("spike", body);
    EXPECT_LE(shape->patch_curvature.min_radius, least * (1 + 1e-6)) << ratio;
    EXPECT_GE(shape->patch_curvature.min_radius, 0.5 * least) << ratio;
  }
}

// Nearly flat faces, curvature radii to a hundred times the body's size, joints that open by 0.3 degrees: all
// of it is proven, so that no contact needs the hull to confirm it.
TEST(Radii, of_nearly_flat_faces_are_proven) {
  const ShapePointer s = make_shape("blocky", fitted_superellipsoid({1, 1, 1}, 4, 5));
  EXPECT_TRUE(s->proofs.convex);
  EXPECT_GE(s->patch_curvature.min_radius, s->proofs.seen_min / 1.2);
  EXPECT_LE(s->patch_curvature.max_radius, 4 * s->proofs.seen_max);
  for (const float radius : s->normal_map.radius) EXPECT_LT(radius, 1e6f);
  for (const PatchRate& patch : s->rates)
    for (const PatchRate::Cell& cell : patch.cells) EXPECT_LT(cell.rate, 1e30f);
  // The map's promise against brute force: no surface point rises above the ball.
  Random random(5);
  for (int k = 0; k < 2000; ++k) {
    const SurfacePoint at{static_cast<int>(random.uniform(0, 0.999 * static_cast<double>(s->patches.size()))),
                          random.uniform(0, 1), random.uniform(0, 1)};
    const LocalForm f = local_form(s->patches[at.patch], at.u, at.v);
    const double r = s->normal_map.radius_at(f.normal);
    const Vec3 d = (f.normal + kNormalMargin * random.uniform(0, 1) * random.direction()).normalized();
    if ((d - f.normal).norm() > kNormalMargin) continue;
    EXPECT_LE(find_support(*s, d).h, d.dot(f.point) + 0.5 * r * (d - f.normal).squaredNorm() + 1e-14);
  }
}

// Fits of rough grains' hulls: cells there can be strips that bend more than they are wide, which halving
// along themselves for ever leaves without any bound. With no ball known that rolls inside, every contact
// took the fallback: a hundred times as long.
TEST(Radii, of_fitted_grains_are_proven) {
  for (const char* file : {"tests/cases/shape-bent-strips.json", "examples/shapes/asteroid.json"}) {
    const ShapePointer s = read_shape_file(file);
    EXPECT_TRUE(s->proofs.convex) << file;
    EXPECT_TRUE(proven_without_dents(*s)) << file;
    EXPECT_GE(s->patch_curvature.min_radius, s->proofs.seen_min / 1.2) << file;
    EXPECT_LT(s->proofs.cells, 250000) << file;
    // Against dense sampling: no curvature radius below the bound, none negative.
    Random random(3);
    for (int k = 0; k < 20000; ++k) {
      const int patch = random.below(static_cast<int>(s->patches.size()));
      const LocalForm f = local_form(s->patches[patch], random.uniform(0, 1), random.uniform(0, 1));
      EXPECT_GT(f.k_min, 0);
      EXPECT_LE(f.k_max * s->patch_curvature.min_radius, 1);
    }
  }
}

// --- spikes between samples
// ----------------------------------------------------------------------------------------------------

// A lens whose rim lies in a thousandth of its patch's parameter, near an end: 32 by 32 samples a patch,
// which see all of it at even parameters, miss it.
struct HiddenRim {
  ShapePointer even, hidden;
};
HiddenRim hidden_rim() {
  Surfaces body{surface_of_revolution({{0, -0.6, 1}, {1, -0.6, 1}, {1, 0, 1}, {1, 0.6, 1}, {0, 0.6, 1}})};
  HiddenRim h{make_shape("even", body), nullptr};
  for (int i = 0; i < body[0].size_u; ++i)
    for (int j = 0; j < body[0].size_v; ++j) body[0].point(i, j) *= std::pow(1e3, j);
  h.hidden = make_shape("hidden", body);
  return h;
}

template <class Visit>
void for_samples(const Shape& shape, int count, const Visit& visit) {
  for (size_t p = 0; p < shape.patches.size(); ++p)
    for (int i = 0; i < count; ++i)
      for (int j = 0; j < count; ++j)
        visit(SurfacePoint{static_cast<int>(p), (i + 0.5) / count, (j + 0.5) / count});
}

struct Seen {
  double least = 1e300, most = 0, rate = 0, outer = 0, top = -1e300;
};
// `sector`: of the patches' u only; the body is one of revolution.
Seen look(const Shape& shape, int count, const Vec3& d) {
  Seen seen;
  for_samples(shape, count, [&](const SurfacePoint& at) {
    const BezierPatch& patch = shape.patches[at.patch];
    const LocalForm f = local_form(patch, at.u, at.v);
    if (f.u != at.u || f.v != at.v) return;
    seen.least = std::min(seen.least, 1 / f.k_max);
    if (f.k_min > 1e-6) seen.most = std::max(seen.most, 1 / f.k_min);
    seen.outer = std::max(seen.outer, f.point.norm());
    seen.top = std::max(seen.top, d.dot(f.point));
    if (at.v > 1e-3 && at.v < 1 - 1e-3) seen.rate = std::max(seen.rate, rate_seen(patch, at.u, at.v));
  });
  return seen;
}

TEST(Spikes, are_in_every_enclosure_and_not_in_samples) {
  const HiddenRim rim = hidden_rim();
  const Vec3 d(1, 0, 0);
  const Seen truth = look(*rim.even, 200, d), sampled = look(*rim.hidden, 32, d);
  // What samples make of it.
  EXPECT_GT(sampled.least, 1.5 * truth.least);
  EXPECT_LT(sampled.outer, 0.95 * truth.outer);
  EXPECT_LT(sampled.top, 0.95 * truth.top);
  // What is proven of it.
  const Shape& s = *rim.hidden;
  EXPECT_LE(s.patch_curvature.min_radius, truth.least * (1 + 1e-6));
  EXPECT_GE(s.patch_curvature.min_radius, 0.5 * truth.least);
  EXPECT_GE(s.patch_curvature.max_radius, truth.most * (1 - 1e-6));
  EXPECT_GE(s.bounding_radius, truth.outer);
  EXPECT_LE(s.bounding_radius, truth.outer * (1 + 1e-2));
  EXPECT_LE(s.inner_radius, 0.6);  // half its height
  const Support top = find_hull_support(s, d);
  EXPECT_GE(top.upper, truth.top);
  EXPECT_NEAR(top.h, rim.even->bounding_radius, 1e-2);
  // The rates and normals of the rim at the parameters it has: u = r s / (1 + (r - 1) s) of the even ones.
  Random random(12);
  int finite = 0;
  for (int k = 0; k < 2000; ++k) {
    const double t = random.uniform(0.02, 0.98);
    const SurfacePoint at{random.below(static_cast<int>(s.patches.size())), random.uniform(0.01, 0.99),
                          t / (1e3 + (1 - 1e3) * t)};
    const LocalRate local = rate_near(s.rates[at.patch], at);
    if (!(local.rate < kFarAway)) continue;
    ++finite;
    EXPECT_LE(rate_seen(rim.even->patches[at.patch], at.u, t), local.rate * 1.001 + 1e-5);
  }
  EXPECT_TRUE(finite > 0 || s.proofs.rate == 0) << "no rate is promised near the rim, or it holds";
  for (int trial = 0; trial < 200; ++trial) {
    const int patch = random.below(static_cast<int>(s.patches.size()));
    Cell cell{patch};
    for (int depth = random.whole(4, 24); depth > 0; --depth) {
      Cell low, high;
      halve(cell, depth % 3 == 0 && random.below(2), &low, &high);
      cell = random.below(6) ? low : high;  // towards the rim
    }
    expect_encloses(s, patch, cell, random);
  }
}

TEST(Spikes, of_a_joint_are_bounded) {
  // Two flat patches along y whose second row rises by a hump of degree 9: the joint closes by up to 0.3 rad
  // in the hump; seen through weights that are powers of 1/100 it lies between the 17 samples.
  BezierPatch flat, humped;
  flat.degree_u = humped.degree_u = 1;
  flat.degree_v = humped.degree_v = 9;
  const double hump[10] = {0, 0, 0, 0, 0.8, 0.8, 0, 0, 0, 0};
  for (const double ratio : {1.0, 1e-2}) {
    flat.points.clear();
    humped.points.clear();
    for (int i = 0; i < 2; ++i)
      for (int j = 0; j < 10; ++j) {
        const double w = std::pow(ratio, j);
        flat.points.push_back(w * Vec4(i, j / 9.0, 0, 1));
        humped.points.push_back(w * Vec4(i - 1, j / 9.0, i == 0 ? hump[j] : 0, 1));
      }
    flat.rational = humped.rational = true;
    EdgeLink link;
    link.patch = 1;
    link.edge = 1;
    double dense = 0, coarse = 0;
    const auto angle = [&](double t) {
      const Jet1 a = evaluate1(flat, 0, t), b = evaluate1(humped, 1, t);
      return angle_between(a.su.cross(a.sv), b.su.cross(b.sv));
    };
    // Samples where the hump is, and 17 even ones.
    for (int k = 0; k <= 20000; ++k) {
      const double t = k / 20000.0;
      dense = std::max(dense, angle(t / (t + (1 - t) * ratio)));
    }
    for (int k = 0; k < kKinkSamples; ++k) coarse = std::max(coarse, angle(k / (kKinkSamples - 1.0)));
    const KinkBounds bounds = bound_kink(flat, 0, humped, link);
    EXPECT_GE(std::max(bounds.opening, bounds.closing), dense * (1 - 1e-9)) << ratio;
    EXPECT_LE(std::max(bounds.opening, bounds.closing), 1.2 * dense + 1e-9) << ratio;
    if (ratio < 1) {
      EXPECT_LT(coarse, 0.7 * dense) << "the samples see it: this shows nothing";
    }
  }
}

// --- dents
// ----------------------------------------------------------------------------------------------------

TEST(Dents, are_proven_absent_from_convex_bodies) {
  for (const ShapePointer& shape : {sphere(), ellipsoid(), disc(), smooth_pebble(), polar(), cuboid()})
    EXPECT_TRUE(proven_without_dents(*shape)) << shape->name;
  EXPECT_TRUE(proven_without_dents(*make_shape("rounded", rounded_box({1, 0.8, 0.6}, 0.1))));
}

// A control point pushed in by any amount: where the proof holds, no dense sample bends inward and none lies
// below another's tangent plane.
TEST(Dents, no_proof_where_there_is_one) {
  int proven = 0, dented = 0;
  for (const double share : {1e-6, 1e-4, 1e-3, 3e-3, 1e-2, 0.1, 0.2, 0.3, 0.4, 0.6}) {
    Surfaces body = pebble();
    Vec4& p = body[2].point(1, 2);
    p.head<3>() *= 1 - share;
    ShapePointer shape;
    try {
      shape = make_shape("pushed", body);
    } catch (const ShapeError&) {
      ++dented;
      continue;
    }
    double least = 1e300;
    for_samples(*shape, 60, [&](const SurfacePoint& at) {
      least = std::min(least, local_form(shape->patches[at.patch], at.u, at.v).k_min);
    });
    proven += proven_without_dents(*shape);
    dented += least < 0;
    if (least < 0) {
      EXPECT_FALSE(proven_without_dents(*shape)) << share;
    }
  }
  EXPECT_GT(proven, 1);
  EXPECT_GT(dented, 0);
  EXPECT_FALSE(proven_without_dents(*make_shape("blocky", fitted_superellipsoid({1, 0.9, 0.8}, 4, 3))));
}

TEST(Rates, hold_everywhere) {
  Random random(5);
  for (const ShapePointer& shape : {ellipsoid(), smooth_pebble(), disc(), kinked(), polar()}) {
    int finite = 0;
    for (int k = 0; k < 3000; ++k) {
      const SurfacePoint at{random.below(static_cast<int>(shape->patches.size())),
                            random.uniform(0.001, 0.999), random.uniform(0.001, 0.999)};
      const LocalRate local = rate_near(shape->rates[at.patch], at);
      if (!(local.rate < kFarAway)) continue;
      ++finite;
      EXPECT_LE(rate_seen(shape->patches[at.patch], at.u, at.v), local.rate * 1.001 + 1e-5) << shape->name;
      // As far as `room` goes, the same rate holds.
      const BezierPatch& patch = shape->patches[at.patch];
      const Vec3 x = evaluate0(patch, at.u, at.v);
      const SurfacePoint other{at.patch, std::clamp(at.u + random.uniform(-0.2, 0.2), 0.001, 0.999),
                               std::clamp(at.v + random.uniform(-0.2, 0.2), 0.001, 0.999)};
      if ((evaluate0(patch, other.u, other.v) - x).norm() < 0.9 * local.room) {
        EXPECT_LE(rate_seen(patch, other.u, other.v), local.rate * 1.001 + 1e-5) << shape->name;
      }
    }
    EXPECT_GT(finite, 2000) << shape->name;
  }
}

// A parameter of 1 + 2e-16 on a joint's other side made a step of 0 / 0, and a support of no number.
TEST(Joints, parameters_across_stay_inside_the_patch) {
  Random random(17);
  for (int k = 0; k < 100000; ++k) {
    EdgeLink link{};
    link.reversed = k % 2;
    link.ratio = std::pow(1e3, random.uniform(-1, 1));
    const double t = k % 3 ? random.uniform(0, 1) : 1 - std::pow(10, random.uniform(-17, -12));
    const double s = partner_parameter(link, t);
    ASSERT_TRUE(s >= 0 && s <= 1) << "ratio " << link.ratio << ", t = " << t << ": " << s - 1;
  }
}

TEST(Joints, mismatched_parameters_are_the_same_body) {
  Random random(3);
  const Vec3 axes(1, 0.8, 0.6);
  const auto plain = make_shape("plain", exact_ellipsoid(axes));
  for (int trial = 0; trial < 6; ++trial) {
    const auto shape =
        make_shape("mismatched", mismatched(random, exact_ellipsoid(axes), trial < 3 ? 3 : 20));
    EXPECT_TRUE(shape->smooth);
    EXPECT_LT(shape->proofs.joint_gap, 1e-14);
    EXPECT_LT(std::max(shape->proofs.opening, shape->proofs.closing), kNoKink);
    EXPECT_LT(shape->support_excess, 1e-20);
    EXPECT_TRUE(shape->proofs.convex);
    for (int k = 0; k < 300; ++k) {
      const Vec3 d = random.direction();
      const double h = axes.cwiseProduct(d).norm();
      const SurfacePoint start{random.below(6), random.uniform(0, 1), random.uniform(0, 1)};
      const Support s = find_support(*shape, d, &start);
      EXPECT_NEAR(s.h, h, 1e-14) << "trial " << trial;
      EXPECT_GE(s.upper, h - 1e-15);
      EXPECT_LT(s.upper - s.h, 1e-9);
    }
  }
}

TEST(Joints, straight_sides_of_any_parametrisation_join) {
  // A box whose face is biquadratic with uneven, though collinear, control points: no Moebius map relates it
  // to its bilinear neighbours.
  Surfaces body = box({1, 0.8, 0.6});
  NurbsSurface& face = body[0];
  const Vec4 corner[2][2] = {{face.point(0, 0), face.point(0, 1)}, {face.point(1, 0), face.point(1, 1)}};
  NurbsSurface finer;
  finer.degree_u = finer.degree_v = 2;
  finer.size_u = finer.size_v = 3;
  finer.knots_u = finer.knots_v = {0, 0, 0, 1, 1, 1};
  const double at[3] = {0, 0.3, 1};
  for (const double u : at)
    for (const double v : at)
      finer.points.push_back((1 - u) * ((1 - v) * corner[0][0] + v * corner[0][1]) +
                             u * ((1 - v) * corner[1][0] + v * corner[1][1]));
  face = finer;
  const auto shape = make_shape("box", body);
  EXPECT_LT(shape->proofs.joint_gap, 1e-12);
  Random random(2);
  for (int k = 0; k < 100; ++k) {
    const Vec3 d = random.direction();
    EXPECT_NEAR(find_support(*shape, d).h, Vec3(1, 0.8, 0.6).dot(d.cwiseAbs()), 1e-13);
  }
}

TEST(Joints, gap_is_bounded_between_the_samples) {
  // Two curves that meet at the five parameters at which edges are first compared, and not between them.
  BezierPatch flat, wavy;
  flat.degree_u = wavy.degree_u = 1;
  flat.degree_v = 1;
  wavy.degree_v = 7;
  flat.points = {{0, 0, 0, 1}, {0, 1, 0, 1}, {1, 0, 0, 1}, {1, 1, 0, 1}};
  // z = 1e-3 t (t - 1/4) (t - 1/2) (t - 3/4) (1 - t) (t + 1) (t + 2) in Bernstein form, by interpolation.
  const auto z = [](double t) {
    return 1e-3 * t * (t - 0.25) * (t - 0.5) * (t - 0.75) * (1 - t) * (t + 1) * (t + 2);
  };
  Eigen::Matrix<double, 8, 8> basis;
  Eigen::Matrix<double, 8, 1> value;
  for (int k = 0; k < 8; ++k) {
    const double t = k / 7.0;
    value[k] = z(t);
    double b = 1;
    for (int i = 0; i < 8; ++i) {
      basis(k, i) = b * std::pow(t, i) * std::pow(1 - t, 7 - i);
      b = b * (7 - i) / (i + 1);
    }
  }
  const Eigen::Matrix<double, 8, 1> c = basis.fullPivLu().solve(value);
  for (int i = 0; i < 2; ++i)
    for (int j = 0; j < 8; ++j) wavy.points.push_back(Vec4(-i, j / 7.0, c[j], 1));
  EdgeLink link;
  link.patch = 1;
  link.edge = 0;
  double most = 0;
  for (int k = 0; k <= 1000; ++k) most = std::max(most, std::abs(z(k / 1000.0)));
  const double bound = bound_joint_gap(flat, 0, wavy, link);
  EXPECT_GE(bound, most);
  EXPECT_LE(bound, 1.2 * most);
}

TEST(Joints, kinks_are_bounded_and_signed) {
  Random random(9);
  for (const ShapePointer& shape :
       {kinked(), cuboid(), make_shape("blocky", fitted_superellipsoid({1, 0.9, 0.8}, 4, 3))})
    for (size_t p = 0; p < shape->patches.size(); ++p)
      for (int e = 0; e < 4; ++e) {
        const EdgeLink& link = shape->links[p][e];
        EXPECT_LE(std::abs(link.kink), link.kink_bound * (1 + 1e-9) + 1e-12);
        const double t = random.uniform(0.01, 0.99);
        const Vec2 at = edge_parameters(e, t);
        const SurfacePoint other = across(shape->patches, link, {static_cast<int>(p), at[0], at[1]}, e);
        const LocalForm a = local_form(shape->patches[p], at[0], at[1]),
                        b = local_form(shape->patches[other.patch], other.u, other.v);
        EXPECT_LE(angle_between(a.normal, b.normal), link.kink_bound + 1e-9);
        EXPECT_LE((a.point - b.point).norm(), link.gap + 1e-14);
      }
}

// Gap of two bodies by minimising p over directions, supports by sampling: nothing of the ladder.
double least_overlap(const Particle& a, const Particle& b, const Vec3& near) {
  const auto p = [&](const Vec3& d) {
    return a.scale * sampled_support(*a.shape, a.q.conjugate() * d) +
           b.scale * sampled_support(*b.shape, b.q.conjugate() * Vec3(-d)) - d.dot(b.x - a.x);
  };
  Vec3 best = near.normalized();
  double least = p(best);
  for (double stride = 0.05; stride > 1e-9; stride *= 0.5)
    for (bool moved = true; moved;) {
      moved = false;
      const Vec3 t = best.unitOrthogonal(), s = best.cross(t);
      for (int k = 0; k < 8; ++k) {
        const Vec3 d =
            (best + stride * (std::cos(M_PI * k / 4) * t + std::sin(M_PI * k / 4) * s)).normalized();
        const double value = p(d);
        if (value < least - 1e-15) least = value, best = d, moved = true;
        if (moved) break;
      }
    }
  return least;
}

TEST(SavedCase, mismatched_joints) {
  const PairCase c = read_pair_case(case_file("mismatched-joints"));
  std::vector<double> memory(kPairMemorySize, 0.0);
  const ContactResult r = find_contact(c.a, c.b, c.settings, memory.data());
  EXPECT_NE(r.status, Status::unresolved);
  const double gap = -least_overlap(c.a, c.b, r.normal);
  EXPECT_NEAR(r.gap, gap, c.settings.tolerance + 1e-9);
  EXPECT_LE(r.lower, gap + 1e-9);
  EXPECT_GE(r.upper, gap - 1e-9);
}

TEST(SavedCase, too_deep_ellipsoid) {
  const PairCase c = read_pair_case(case_file("too-deep-ellipsoid-1-0.1-0.01"));
  std::vector<double> memory(kPairMemorySize, 0.0);
  const ContactResult r = find_contact(c.a, c.b, c.settings, memory.data());
  EXPECT_NE(r.status, Status::unresolved);
  EXPECT_NEAR(r.gap, -5.257e-4, 1e-7);
  EXPECT_LE(r.lower, r.gap);
}

TEST(SavedCase, joint_gaps_are_in_the_bracket) {
  const PairCase c = read_pair_case(case_file("joint-gaps"));
  EXPECT_GT(c.a.shape->joint_slack, 0);
  std::vector<double> memory(kPairMemorySize, 0.0);
  const ContactResult r = find_contact(c.a, c.b, c.settings, memory.data());
  const double gap = -least_overlap(c.a, c.b, r.normal);
  EXPECT_LE(r.lower, gap + 1e-12);
  EXPECT_GE(r.upper, gap - 1e-12);
}

// A short strip of a cylinder, twisted by what passes for round-off, is a saddle there.
TEST(Dents, are_left_open_where_round_off_twists_a_small_cylinder) {
  const auto flat_share = [](double twist) {
    const double length = 1e-5, w = std::cos(1e-5);
    BezierPatch strip;
    strip.degree_u = 1;
    strip.degree_v = 2;
    for (int i = 0; i < 2; ++i)
      for (int j = 0; j < 3; ++j) {
        const double angle = 1e-5 * (j - 1), r = 0.5 / (j == 1 ? w : 1), weight = j == 1 ? w : 1;
        const Vec3 x(r * std::sin(angle), -length * i,
                     0.5 + r * std::cos(angle) + (i == 1 && j == 2 ? twist : 0));
        strip.points.emplace_back(weight * x[0], weight * x[1], weight * x[2], weight);
      }
    Shape shape;
    shape.bounding_radius = 1;
    shape.patches = {strip};
    shape.links.resize(1);
    const SurfaceBounds bounds = bound_surface(shape, false);
    double flat = 0;
    for (const Leaf& leaf : bounds.leaves)
      if (is_flat(leaf.bounds, 1)) flat += leaf.cell.du * leaf.cell.dv;
    return flat;
  };
  EXPECT_EQ(flat_share(0), 1);
  EXPECT_LT(flat_share(8e-14), 1);
}

// On a lens that is nearly a ball the rim is a strip that positions, to round-off, don't tell from the ball.
TEST(Radii, of_a_narrow_rim) {
  for (const double over : {1e-3, 1e-6, 1e-9, 1e-11, 1e-13}) {
    const auto shape = make_shape("lens", lens(1, 1 + over, 0.1));
    EXPECT_LE(shape->patch_curvature.min_radius, 0.11) << over;
  }
}

// At the rim of a flat face the curvature about the axis falls to zero, which no cell shows: the profile
// does.
TEST(Dents, none_of_tablets_and_other_turned_bodies_with_flat_faces) {
  for (const Surfaces& body :
       {tablet(1, 0.6, 0.3), tablet(1, 0.8, 0.2), tablet(1e-6, 1e-6, 1e-7), tablet(1, 1, 1e-4),
        revolve(rounded_profile({Vec2(0, -1), Vec2(0.8, -1), Vec2(1, 0.2), Vec2(0, 0.7)}, 0.02))}) {
    const auto shape = make_shape("turned", body);
    EXPECT_TRUE(proven_without_dents(*shape));
  }
}

// A profile with a hollow, and one whose middle faces the axis, as deep as a file may have them.
TEST(Dents, of_turned_bodies_are_not_overlooked) {
  const double r = 1 - 5e-5;
  for (const Surfaces& body : {revolve(Profile{{Vec2(0, -1), Vec2(0.4, -1), Vec2(0.8, -1), 0},
                                               {Vec2(0.8, -1), Vec2(1, -1), Vec2(1, -0.8), std::sqrt(0.5)},
                                               {Vec2(1, -0.8), Vec2(r, 0), Vec2(1, 0.8), 1},
                                               {Vec2(1, 0.8), Vec2(1, 1), Vec2(0.8, 1), std::sqrt(0.5)},
                                               {Vec2(0.8, 1), Vec2(0.4, 1), Vec2(0, 1), 0}}),
                               revolve(Profile{{Vec2(0, -1 + 5e-5), Vec2(0.4, -1), Vec2(0.8, -1), 1},
                                               {Vec2(0.8, -1), Vec2(1, -1), Vec2(1, -0.8), std::sqrt(0.5)},
                                               {Vec2(1, -0.8), Vec2(1, 0), Vec2(1, 0.8), 0},
                                               {Vec2(1, 0.8), Vec2(1, 1), Vec2(0.8, 1), std::sqrt(0.5)},
                                               {Vec2(0.8, 1), Vec2(0.4, 1), Vec2(0, 1), 0}})}) {
    const auto shape = make_shape("turned", body);
    EXPECT_FALSE(shape->meridian.empty());
    EXPECT_GT(shape->concavity, 1e-6);
    EXPECT_FALSE(shape->proofs.convex);
  }
}

}  // namespace
}  // namespace nurbs::test_proofs

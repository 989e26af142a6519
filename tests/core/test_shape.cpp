// Shapes: joining, orientation, bounds, kinks, convexity, curvature, and every way a body can be refused.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "body/connectivity.h"
#include "body/shape.h"
#include "body/support.h"
#include "nurbs/bernstein.h"
#include "shapes/primitives.h"
#include "shapes/revolved.h"
#include "support/random.h"

namespace nurbs::test_shape {
namespace {

using test::Random;
using Surfaces = std::vector<NurbsSurface>;

void move(Surfaces& body, const Mat3& linear, const Vec3& offset) {
  for (NurbsSurface& s : body) {
    for (Vec4& p : s.points) p.head<3>() = (linear * p.head<3>() + p[3] * offset).eval();
  }
}

NurbsSurface reverse_u(const NurbsSurface& s) {
  NurbsSurface out = s;
  std::reverse(out.knots_u.begin(), out.knots_u.end());
  const double sum = s.knots_u.front() + s.knots_u.back();
  for (double& k : out.knots_u) k = sum - k;
  for (int i = 0; i < s.size_u; ++i) {
    for (int j = 0; j < s.size_v; ++j) out.point(i, j) = s.point(s.size_u - 1 - i, j);
  }
  return out;
}

// One of the eight ways to lay (u, v) over the same patch. Odd ones turn its normal round.
NurbsSurface relabel(NurbsSurface s, int way) {
  if (way & 4) s = swap_uv(reverse_u(s));  // quarter turn
  if (way & 2) s = swap_uv(reverse_u(swap_uv(reverse_u(s))));
  if (way & 1) s = swap_uv(s);
  return s;
}

std::shared_ptr<const Shape> build(Surfaces body, std::vector<std::string>* warnings = nullptr) {
  return make_shape("body", std::move(body), std::nullopt, warnings);
}

std::string error_of(const Surfaces& body, const std::optional<Mat3>& gyration = std::nullopt) {
  try {
    make_shape("body", body, gyration);
  } catch (const ShapeError& error) {
    return error.what();
  }
  return "accepted";
}

bool contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

// Every link leads to an edge that leads back and lies on the same points, and every normal points outward.
void expect_consistent(const Shape& shape, double tolerance = 1e-12) {
  ASSERT_EQ(shape.links.size(), shape.patches.size());
  for (size_t p = 0; p < shape.patches.size(); ++p) {
    for (int e = 0; e < 4; ++e) {
      const EdgeLink& link = shape.links[p][e];
      if (link.collapsed) {
        EXPECT_EQ(link.patch, -1);
        continue;
      }
      ASSERT_GE(link.patch, 0);
      const EdgeLink& back = shape.links[link.patch][link.edge];
      EXPECT_EQ(back.patch, static_cast<int>(p));
      EXPECT_EQ(back.edge, e);
      EXPECT_EQ(back.reversed, link.reversed);
      for (double t : {0.0, 0.3, 0.8}) {
        const Vec2 a = edge_parameters(e, t), b = edge_parameters(link.edge, partner_parameter(link, t));
        const Vec3 x = evaluate0(shape.patches[p], a[0], a[1]);
        const Vec3 y = evaluate0(shape.patches[link.patch], b[0], b[1]);
        EXPECT_LT((x - y).norm(), tolerance * shape.bounding_radius);
      }
    }
    const Jet1 j = evaluate1(shape.patches[p], 0.4, 0.6);
    EXPECT_GT(j.s.dot(j.su.cross(j.sv)), 0);
  }
}

// Body of revolution about z from a Bezier meridian (r, z), as one patch with two poles and a seam.
Surfaces revolve(const std::vector<Vec2>& meridian) {
  std::vector<Vec3> segment;
  for (const Vec2& m : meridian) segment.emplace_back(m[0], m[1], 1);
  return {surface_of_revolution(segment)};
}

// Meridian with a waist: r(s) = 4 a s + (6 b - 8 a) s^2 with s = t (1 - t), so for b < 0 the waist s = 1/4
// lies below the tangent line r = 4 a^2 / (8 a - 6 b) by `depth`.
struct Waisted {
  Surfaces body;
  double depth;
};
Waisted waisted(double b) {
  const double a = 1, c = 8 * a - 6 * b;
  const double top = 4 * a * a / c, waist = a - c / 16;
  return {revolve({{0, -1}, {a, -1}, {b, 0}, {a, 1}, {0, 1}}), top - waist};
}

// --- joining and orientation
// -------------------------------------------------------------------------------------

TEST(Connectivity, SixPatchesInEveryRandomLayout) {
  Random random(1);
  const Surfaces original = exact_ellipsoid({1, 1.5, 2});
  const double volume = build(original)->mass.volume;
  for (int trial = 0; trial < 20; ++trial) {
    Surfaces body = original;
    for (NurbsSurface& s : body) s = relabel(s, random.below(8));
    std::shuffle(body.begin(), body.end(), random.engine());
    move(body, random.turn().toRotationMatrix(), Vec3(5, -3, 2));
    std::vector<std::string> warnings;
    const auto shape = build(body, &warnings);
    expect_consistent(*shape);
    EXPECT_NEAR(shape->mass.volume, volume, 1e-10 * volume);
    EXPECT_TRUE(shape->smooth);
    int turned = 0;
    for (size_t i = 0; i < body.size(); ++i) turned += shape->surfaces[i].points != body[i].points;
    EXPECT_EQ(warnings.size(), turned > 0 ? 1u : 0u);
  }
}

TEST(Connectivity, BezierPiecesInsideASurfaceAreJoined) {
  const auto shape = build(fitted_ellipsoid({1, 1.2, 0.8}, 3));
  EXPECT_EQ(shape->patches.size(), 54u);
  expect_consistent(*shape, 1e-9);
}

TEST(Connectivity, OnePatchBodyHasPolesAndASeam) {
  const auto shape = build(revolved_ellipsoid(1, 2));
  expect_consistent(*shape);
  int poles = 0, seams = 0;
  for (const auto& links : shape->links) {
    for (const EdgeLink& link : links) poles += link.collapsed;
  }
  EXPECT_EQ(poles, 8);  // four quarters at each end
  for (size_t p = 0; p < shape->patches.size(); ++p) {
    seams += p < 2 && shape->links[p][0].patch == static_cast<int>(p) + 6;
  }
  EXPECT_EQ(seams, 2);
  EXPECT_TRUE(shape->smooth);
}

TEST(Connectivity, SidesMayBeParametrisedDifferently) {
  // Weights times powers of a constant: the same surface at u' = u / (u + c (1 - u)).
  Surfaces body = exact_ellipsoid({1, 1.5, 2});
  for (int i = 0; i < body[2].size_u; ++i) {
    for (int j = 0; j < body[2].size_v; ++j) body[2].point(i, j) *= std::pow(1.7, i) * std::pow(0.6, j);
  }
  const auto shape = build(body);
  EXPECT_TRUE(shape->smooth);
  EXPECT_NEAR(shape->mass.volume, 4 * M_PI, 1e-9);
  expect_consistent(*shape, 1);
}

// A cylinder of radius 1 and height 2 of `arcs` walls, whose circles run as s(t) of the parameter that those
// of the caps have, or a little off the circle.
Surfaces cylinder_of_other_parameters(int arcs, const Bernstein<double>& s, double off = 0) {
  Surfaces body;
  const auto times = [](double f, double g) { return f * g; };
  Bernstein<double> rest;
  for (const double x : s) rest.push_back(1 - x);
  const int degree = 2 * (static_cast<int>(s.size()) - 1);
  const Bernstein<double> basis[3] = {multiply(rest, rest, times), multiply(s, rest, times),
                                      multiply(s, s, times)};
  const double half = M_PI / arcs, w = std::cos(half);
  for (int k = 0; k < arcs; ++k) {
    std::vector<Vec4> arc;
    for (int i = -1; i <= 1; ++i) {
      const double turn = (2 * k + i) * half, r = i == 0 ? 1 / w : 1, weight = i == 0 ? w : 1;
      arc.push_back(weight * Vec4(r * std::cos(turn), r * std::sin(turn), 0, 1));
    }
    const auto level = [](const Vec4& p, double z) { return Vec4(p[0], p[1], z * p[3], p[3]); };
    std::vector<Vec4> wall, bottom, top;
    for (int i = 0; i <= degree; ++i) {
      Vec4 p = basis[0][i] * arc[0] + 2 * basis[1][i] * arc[1] + basis[2][i] * arc[2];
      if (i == degree / 2) p.head<2>() *= 1 + off;
      wall.insert(wall.end(), {level(p, -1), level(p, 1)});
    }
    for (const Vec4& p : arc) {
      bottom.insert(bottom.end(), {p[3] * Vec4(0, 0, -1, 1), level(p, -1)});
      top.insert(top.end(), {level(p, 1), p[3] * Vec4(0, 0, 1, 1)});
    }
    body.push_back(bezier_surface(degree, 1, wall));
    body.push_back(bezier_surface(2, 1, bottom));
    body.push_back(bezier_surface(2, 1, top));
  }
  return body;
}

TEST(Connectivity, SidesOnOneConicMayHaveAnyParameters) {
  Random random(3);
  const std::vector<Bernstein<double>> parameters = {
      {0, 0.5, 1},  {0, 0.499, 1},    {0, 0.45, 1}, {0, 0.3, 1},     // 2 m t (1 - t) + t^2
      {0, 0, 1},    {0, 1, 1},        {0, 0, 1, 1}, {0, 0, 0.7, 1},  // without speed at an end or both
      {0, 0, 0, 1}, {0, 0, 0.2, 1, 1}};
  for (const int arcs : {3, 4, 5, 7, 8})
    for (const Bernstein<double>& s : parameters) {
      SCOPED_TRACE(std::to_string(arcs) + " arcs, " + ::testing::PrintToString(s));
      Surfaces body = cylinder_of_other_parameters(arcs, s);
      for (NurbsSurface& face : body)  // round-off: no coefficient is zero by construction
        for (int i = 0; i < face.size_u; ++i)
          for (int j = 0; j < face.size_v; ++j) face.point(i, j).head<3>() += random.box(-2e-16, 2e-16);
      const auto shape = build(body);
      EXPECT_EQ(shape->joint_slack, 0);
      EXPECT_LT(shape->support_excess, 1e-12);
      EXPECT_NEAR(shape->mass.volume, 2 * M_PI, 1e-9);
      for (int k = 0; k < 50; ++k) {
        const Vec3 d = random.direction();
        EXPECT_NEAR(find_hull_support(*shape, d).h, std::hypot(d[0], d[1]) + std::abs(d[2]), 1e-13);
      }
    }
}

// An egg: half a ball below, half a spheroid of height 1.5 above, of which `around` and `up` are the
// parameters.
Surfaces egg_of_parameters(const Bernstein<double>& around, const Bernstein<double>& up) {
  const auto times = [](double f, double g) { return f * g; };
  const auto quarter = [&](const Bernstein<double>& s) {  // x, y, weight of the quarter circle at s(t)
    Bernstein<double> rest;
    for (const double x : s) rest.push_back(1 - x);
    const Bernstein<double> a = multiply(rest, rest, times), b = multiply(s, rest, times),
                            c = multiply(s, s, times);
    std::vector<Vec3> out;
    for (size_t i = 0; i < a.size(); ++i) {
      const double middle = M_SQRT1_2 * 2 * b[i];
      out.emplace_back(a[i] + middle, c[i] + middle, a[i] + middle + c[i]);
    }
    return out;
  };
  const std::vector<Vec3> circle = quarter(around), profile = quarter(up);
  Surfaces body;
  for (int octant = 0; octant < 8; ++octant) {
    const double x = octant & 1 ? -1 : 1, y = octant & 2 ? -1 : 1, z = octant & 4 ? -1 : 1.5;
    std::vector<Vec4> net;
    for (const Vec3& c : circle)
      for (const Vec3& p : profile)
        net.emplace_back(x * c[0] * p[0], y * c[1] * p[0], z * c[2] * p[1], c[2] * p[2]);
    body.push_back(
        bezier_surface(static_cast<int>(circle.size()) - 1, static_cast<int>(profile.size()) - 1, net));
  }
  return body;
}

// Where more rows than one lie on the pole, or the edge has no speed at its ends, normals round it are known.
TEST(Connectivity, PolesAreSmoothWhateverTheParameters) {
  Random random(5);
  const std::vector<Bernstein<double>> parameters = {{0, 1}, {0, 1, 1}, {0, 0, 1, 1}, {0, 0, 1}};
  for (const Bernstein<double>& around : parameters)
    for (const Bernstein<double>& up : parameters) {
      SCOPED_TRACE(::testing::PrintToString(around) + " " + ::testing::PrintToString(up));
      const auto shape = build(egg_of_parameters(around, up));
      for (const auto& links : shape->links)
        for (const EdgeLink& link : links)
          if (link.collapsed) {
            EXPECT_LT(link.kink_bound, 1e-6);
          }
      for (int k = 0; k < 20; ++k) {
        const Vec3 d = random.direction(), top(d[0], d[1], d[2] * (d[2] > 0 ? 1.5 : 1));
        EXPECT_NEAR(find_hull_support(*shape, d).h + shape->mass.center.dot(d), top.norm(), 1e-12);
      }
    }
}

// Gauss-Newton from a guess finds the place that the search of the whole edge does.
TEST(Connectivity, PlacesAcrossProjectedJointsAreFoundFromAGuess) {
  int projected = 0;
  for (const double m : {0.499, 0.3, 0.05}) {
    const auto shape = build(cylinder_of_other_parameters(4, {0, m, 1}));
    for (int p = 0; p < static_cast<int>(shape->patches.size()); ++p)
      for (int edge = 0; edge < 4; ++edge) {
        const EdgeLink& link = shape->links[p][edge];
        if (!link.projected) continue;
        ++projected;
        for (int k = 0; k <= 20; ++k) {
          const Vec2 at = edge_parameters(edge, k / 20.0);
          const Vec3 x = evaluate0(shape->patches[p], at[0], at[1]);
          const SurfacePoint found = across(shape->patches, link, {p, at[0], at[1]}, edge);
          const double t = link.edge < 2 ? found.v : found.u;
          EXPECT_LT((evaluate0(shape->patches[link.patch], found.u, found.v) - x).norm(), 1e-12);
          EXPECT_NEAR(t, projected_parameter(shape->patches[link.patch], link, x), 1e-9);
        }
      }
  }
  EXPECT_GE(projected, 3 * 16);
}

// Off the conic by what still is a gap, and by what is none.
TEST(Connectivity, SidesOffOneConicAreApart) {
  const auto shape = build(cylinder_of_other_parameters(12, {0, 0.45, 1}, 1e-7));
  EXPECT_GT(shape->joint_slack, 2e-8);
  EXPECT_TRUE(contains(error_of(cylinder_of_other_parameters(12, {0, 0.45, 1}, 1e-4)), "has no partner"));
}

// The same surface with a degree more in both parameters.
NurbsSurface elevated(const NurbsSurface& s) {
  const auto times = [](const Vec4& p, double f) { return Vec4(p * f); };
  const auto raise = [&](const std::vector<Vec4>& points, int rows, int columns) {  // along the columns
    std::vector<Vec4> out;
    for (int i = 0; i < rows; ++i)
      for (const Vec4& p :
           multiply(Bernstein<Vec4>(points.begin() + i * columns, points.begin() + (i + 1) * columns),
                    Bernstein<double>{1, 1}, times))
        out.push_back(p);
    return out;
  };
  const auto transposed = [](const std::vector<Vec4>& points, int rows, int columns) {
    std::vector<Vec4> out;
    for (int k = 0; k < columns; ++k)
      for (int i = 0; i < rows; ++i) out.push_back(points[i * columns + k]);
    return out;
  };
  const int u = s.size_u, v = s.size_v + 1;
  const std::vector<Vec4> in_v = raise(s.points, u, s.size_v);
  return bezier_surface(s.degree_u + 1, s.degree_v + 1,
                        transposed(raise(transposed(in_v, u, v), v, u), v, u + 1));
}

// Needles with joints round their tips: the closest point of the other side's curve may be beyond the tip.
TEST(Connectivity, SidesOfHairpinsAreFound) {
  Random random(9);
  for (int k = 0; k < 40; ++k) {
    Surfaces body = exact_ellipsoid({1, 1, 1});
    const Vec3 along = Vec3(random.uniform(-0.3, 0.3), 1, 1).normalized();  // a point of an edge of the cube
    const Mat3 turn = Quat::FromTwoVectors(along, Vec3::UnitX()).toRotationMatrix();
    NurbsSurface& other = body[random.below(body.size())];
    other = elevated(other);
    const double factor = random.log_uniform(0.1, 10), factor_v = random.log_uniform(0.1, 10);
    for (int i = 0; i < other.size_u; ++i)
      for (int j = 0; j < other.size_v; ++j) other.point(i, j) *= std::pow(factor, i) * std::pow(factor_v, j);
    const double length = random.log_uniform(10, 1000);
    move(body, turn, Vec3::Zero());
    for (NurbsSurface& s : body)
      for (Vec4& p : s.points) p[0] *= length;
    EXPECT_EQ(error_of(body), "accepted") << k;
  }
}

TEST(Connectivity, SmallGapsAreAcceptedLargeOnesNamed) {
  Surfaces body = exact_ellipsoid({1, 1, 1});
  for (Vec4& p : body[3].points) p[0] += 1e-6 * p[3];
  EXPECT_EQ(error_of(body), "accepted");
  for (Vec4& p : body[3].points) p[0] += 1e-4 * p[3];
  const std::string error = error_of(body);
  EXPECT_TRUE(contains(error, "body: patch ") && contains(error, "has no partner: the surface is open"))
      << error;
  EXPECT_TRUE(contains(error, "0.000101 away (allowed ")) << error;
}

TEST(Connectivity, OpenSurfaceNamesPatchAndEdge) {
  Surfaces body = box({1, 2, 3});
  body.erase(body.begin() + 5);
  const std::string error = error_of(body);
  EXPECT_TRUE(contains(error, "edge u=") || contains(error, "edge v=")) << error;
  EXPECT_TRUE(contains(error, "has no partner")) << error;
  Surfaces half = revolve({{0, -1}, {1, -1}, {1, 0}});
  EXPECT_TRUE(contains(error_of(half), "body: patch 0 edge v=1 (u=0..0.25) has no partner"))
      << error_of(half);
}

// The part of a surface from u = from to u = to, as a surface of its own.
NurbsSurface part_in_u(NurbsSurface s, double from, double to) {
  for (double u : {from, to})
    if (u > s.knots_u[s.degree_u] && u < s.knots_u[s.size_u])
      for (int k = 0; k < s.degree_u; ++k) s = insert_knot_u(s, u);
  NurbsSurface out = s;
  out.knots_u.clear();
  out.points.clear();
  for (double knot : s.knots_u)
    if (knot >= from && knot <= to) out.knots_u.push_back(knot);
  while (std::count(out.knots_u.begin(), out.knots_u.end(), from) <= s.degree_u)
    out.knots_u.insert(out.knots_u.begin(), from);
  while (std::count(out.knots_u.begin(), out.knots_u.end(), to) <= s.degree_u) out.knots_u.push_back(to);
  out.size_u = static_cast<int>(out.knots_u.size()) - s.degree_u - 1;
  const auto last = std::upper_bound(s.knots_u.begin(), s.knots_u.end(), from) - s.knots_u.begin() - 1;
  for (int i = 0; i < out.size_u; ++i)
    for (int j = 0; j < s.size_v; ++j)
      out.points.push_back(s.point(static_cast<int>(last) - s.degree_u + i, j));
  return out;
}

// Bodies with smooth, sharp and closing joints, and with poles.
std::vector<Surfaces> bodies_to_cut() {
  return {box({1, 2, 3}),
          exact_ellipsoid({1, 2, 3}),
          capsule(1, 2),
          revolve({{0, -1}, {1, -1}, {1, 1}, {0, 1}}),
          rounded_box({1, 1.5, 2}, 0.3),
          pebble(),
          tablet(1, 0.5, 0.1),
          revolve({{0, -1}, {1, -1}, {1, 0}, {0, 1}})};
}

// Knots that refinement has left, next to the ends too, are not where a body is cut.
TEST(Connectivity, NeedlessKnotsAreRemoved) {
  Random random(11);
  for (const Surfaces& whole : bodies_to_cut()) {
    const auto expected = build(whole);
    for (double share : {0.4, 0.03, 1e-7}) {
      Surfaces body = whole;
      for (NurbsSurface& s : body)
        for (int k = 0; k < 4; ++k) {
          const double from = s.knots_u[s.degree_u], length = s.knots_u[s.size_u] - from;
          s = swap_uv(insert_knot_u(s, from + length * (k < 2 ? share : 1 - share)));
        }
      const auto refined = build(body);
      EXPECT_EQ(refined->patches.size(), expected->patches.size());
      EXPECT_EQ(refined->joint_slack, expected->joint_slack);
      EXPECT_NEAR(refined->mass.volume, expected->mass.volume, 1e-13 * expected->mass.volume);
      EXPECT_EQ(refined->surfaces[0].knots_u, body[0].knots_u);
    }
  }
}

// ... nor where every face was refined elsewhere; one knot that round-off keeps does not bring all of them
// back.
TEST(Connectivity, NeedlessKnotsOfEveryFaceAreRemoved) {
  Random random(12);
  for (const Surfaces& whole : bodies_to_cut())
    for (int degrees : {0, 4}) {
      Surfaces body = whole;
      for (NurbsSurface& s : body) {
        if (s.size_u > s.degree_u + 1 || s.size_v > s.degree_v + 1)
          continue;  // elevated() takes Bezier patches
        for (int k = 0; k < degrees; ++k) s = elevated(s);
      }
      const size_t patches = build(body)->patches.size();
      for (NurbsSurface& s : body)
        for (int k = 0; k < 10; ++k) {
          const double from = s.knots_u[s.degree_u], length = s.knots_u[s.size_u] - from;
          s = swap_uv(insert_knot_u(s, from + length * random.uniform(0.02, 0.98)));
        }
      ASSERT_EQ(error_of(body), "accepted");
      EXPECT_LE(build(body)->patches.size(), 10 * patches);  // some 700 a face without
    }
}

// ... or has its own weights at every corner, so that the sides of a joint run at different speeds.
TEST(Connectivity, NeedlessKnotsBetweenUnevenWeightsAreRemoved) {
  Random random(13);
  for (double most : {4.0, 10.0, 100.0}) {
    Surfaces body;
    for (int face = 0; face < 8; ++face) {
      const Vec3 a((face & 1) ? -1 : 1, 0, 0), b(0, (face & 2) ? -1 : 1, 0), c(0, 0, (face & 4) ? -1 : 1);
      std::vector<Vec4> points;
      for (const Vec3& x : {a, c, b, c}) {
        const double w = random.log_uniform(1 / most, most);
        points.emplace_back(w * x[0], w * x[1], w * x[2], w);
      }
      body.push_back(bezier_surface(1, 1, points));
      for (int k = 0; k < 4; ++k)
        body.back() = swap_uv(insert_knot_u(body.back(), random.uniform(0.02, 0.98)));
    }
    ASSERT_EQ(error_of(body), "accepted") << most;
    EXPECT_EQ(build(body)->patches.size(), 8u) << most;
  }
}

// Knots so large that there is none between two of them: cutting ends, and what can't be cut is refused.
TEST(Connectivity, LargeKnotsEndCutting) {
  for (double large : {1e3, 1e11, 1e13, 1e15}) {
    Surfaces body = box({1, 2, 3});
    body.push_back(part_in_u(body[0], 0.37, 1));
    body[0] = part_in_u(body[0], 0, 0.37);
    for (size_t k = 1; k + 1 < body.size(); ++k) {
      for (double& knot : body[k].knots_u) knot += large;
      for (double& knot : body[k].knots_v) knot += large;
    }
    const std::string error = error_of(body);
    EXPECT_TRUE(large < 1e4 ? error == "accepted" : contains(error, "can't be cut there")) << error;
  }
}

// Knots on one side of a joint only, and faces in parts that end inside others' edges: both sides are cut.
TEST(Connectivity, TJunctionsAreCut) {
  Random random(10);
  for (const Surfaces& whole : bodies_to_cut()) {
    const auto expected = build(whole);
    for (int trial = 0; trial < 6; ++trial) {
      Surfaces body = whole;
      for (int k = 0; k <= trial % 3; ++k) {
        NurbsSurface& s = body[random.below(body.size())];
        if (random.below(2)) s = swap_uv(swap_uv(reverse_u(s)));
        if (random.below(2)) s = swap_uv(reverse_u(s));
        const double from = s.knots_u[s.degree_u], length = s.knots_u[s.size_u] - from;
        const double at = from + length * random.uniform(0.05, 0.95);
        if (trial < 3) {
          s = insert_knot_u(s, at);
        } else {
          const NurbsSurface rest = part_in_u(s, at, from + length);
          s = part_in_u(s, from, at);
          body.push_back(rest);
        }
      }
      std::shared_ptr<const Shape> cut;
      ASSERT_NO_THROW(cut = build(body)) << trial;
      EXPECT_NEAR(cut->mass.volume, expected->mass.volume, 1e-13 * expected->mass.volume);
      EXPECT_LT(cut->patches.size(), 8 * expected->patches.size());
      for (int k = 0; k < 20; ++k) {
        const Vec3 n = random.direction();
        EXPECT_NEAR(find_support(*cut, n).h, find_support(*expected, n).h, 1e-13 * expected->bounding_radius);
      }
    }
  }
}

// A part of a face that is missing is missed, whatever else is cut.
TEST(Connectivity, OpenBodiesWithTJunctionsAreRefused) {
  Surfaces body = box({1, 1, 1});
  body.push_back(part_in_u(body[0], 0, 0.4));
  body[0] = part_in_u(body[0], 0.4, 1);
  EXPECT_EQ(error_of(body), "accepted");
  body.pop_back();
  EXPECT_TRUE(contains(error_of(body), "has no partner: the surface is open")) << error_of(body);
}

TEST(Connectivity, TwoBodiesAreRefused) {
  Surfaces body = box({1, 1, 1}), other = box({1, 1, 1});
  move(other, Mat3::Identity(), Vec3(5, 0, 0));
  body.insert(body.end(), other.begin(), other.end());
  EXPECT_EQ(
      error_of(body),
      "body: patch 6 is not connected to patch 0: the surfaces bound more than one body, or are joined by "
      "faces of 1e-10 of its size");
}

TEST(Connectivity, OneSidedSurfaceIsRefused) {
  // A Moebius band closed along its rim by a collapsed patch: bilinear quads around a half-twisted strip.
  const auto corner = [](int k, double side) {
    const double a = 2 * M_PI * k / 3, half = side * (k == 3 ? -1 : 1);
    return Vec4(std::cos(a) * (2 + half * std::cos(a / 2)), std::sin(a) * (2 + half * std::cos(a / 2)),
                half * std::sin(a / 2) * (k == 3 ? 0 : 1), 1);
  };
  Surfaces body;
  NurbsSurface quad;
  quad.degree_u = quad.degree_v = 1;
  quad.size_u = quad.size_v = 2;
  quad.knots_u = quad.knots_v = {0, 0, 1, 1};
  const Vec4 apex(0, 0, 5, 1);
  const auto side = [&](int k, double s) { return k == 3 ? corner(0, -s) : corner(k, s); };
  for (int k = 0; k < 3; ++k) {
    quad.points = {side(k, -1), side(k, 1), side(k + 1, -1), side(k + 1, 1)};
    body.push_back(quad);
    for (double s : {-1.0, 1.0}) {
      quad.points = {side(k, s), apex, side(k + 1, s), apex};
      body.push_back(quad);
    }
  }
  EXPECT_EQ(error_of(body), "body: the patches close on a one-sided surface, which has no inside");
}

TEST(Orientation, InsideOutIsRepairedWithAWarning) {
  Surfaces body = exact_ellipsoid({1, 2, 3});
  for (NurbsSurface& s : body) s = swap_uv(s);
  std::vector<std::string> warnings;
  const auto shape = build(body, &warnings);
  expect_consistent(*shape);
  EXPECT_GT(shape->mass.volume, 0);
  EXPECT_GT(shape->mass.inertia(0, 0), 0);
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_EQ(warnings[0], "body: the body was inside out: every patch has been turned to face outward");
}

TEST(Orientation, SinglePatchesAreRepairedAndNamed) {
  Surfaces body = exact_ellipsoid({1, 2, 3});
  for (int i : {0, 4}) body[i] = swap_uv(body[i]);
  std::vector<std::string> warnings;
  expect_consistent(*build(body, &warnings));
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_EQ(warnings[0], "body: patches 0, 4 faced inward and have been turned outward");
}

TEST(Orientation, FlatBodyEnclosesNoVolume) {
  const NurbsSurface side = box({1, 1, 1})[0];
  EXPECT_TRUE(contains(error_of({side, side}), "body: the patches enclose no volume"))
      << error_of({side, side});
  EXPECT_NE(error_of(box({1, 1, 0})), "accepted");
  NurbsSurface point = box({1, 1, 1})[0];
  for (Vec4& p : point.points) p = Vec4(1, 2, 3, 1);
  EXPECT_EQ(error_of({point}), "body: all control points coincide");
  EXPECT_EQ(error_of({}), "body: no surfaces");
}

TEST(Shape, SurfaceDefectsNameThePatch) {
  Surfaces body = box({1, 1, 1});
  body[2].points[1][3] = -1;
  EXPECT_EQ(error_of(body), "body: patch 2: weight[1] = -1, must be > 0 and finite");
}

// --- bounds
// ----------------------------------------------------------------------------------------------------

TEST(Bounds, CentreOfMassIsTheOrigin) {
  Surfaces body = exact_ellipsoid({1, 2, 3});
  move(body, Mat3::Identity(), Vec3(10, -20, 30));
  const auto shape = build(body);
  EXPECT_LT((shape->mass.center - Vec3(10, -20, 30)).norm(), 1e-12);
  EXPECT_NEAR(evaluate0(shape->patches[0], 0.5, 0.5).norm(),
              evaluate0(build(exact_ellipsoid({1, 2, 3}))->patches[0], 0.5, 0.5).norm(), 1e-12);
}

TEST(Bounds, RadiiOfEllipsoidsAreTightAndSafe) {
  Random random(2);
  for (int trial = 0; trial < 10; ++trial) {
    const Vec3 a = random.box(0.2, 3);
    Surfaces body = exact_ellipsoid(a);
    move(body, random.turn().toRotationMatrix(), Vec3(1, 2, 3));
    const auto shape = build(body);
    EXPECT_GE(shape->bounding_radius, a.maxCoeff() * (1 - 1e-14));
    EXPECT_LE(shape->bounding_radius, a.maxCoeff() * (1 + 1e-6));
    EXPECT_LE(shape->inner_radius, a.minCoeff() * (1 + 1e-14));
    EXPECT_GE(shape->inner_radius, a.minCoeff() * (1 - 1e-6));
  }
}

TEST(Bounds, HoldEverySampledPoint) {
  for (const Surfaces& body :
       {pebble(), fitted_ellipsoid({1, 2, 0.7}, 1), revolved_ellipsoid(3, 1), box({1, 2, 3})}) {
    const auto shape = build(body);
    double least = std::numeric_limits<double>::infinity(), most = 0;
    for (const BezierPatch& patch : shape->patches) {
      for (int i = 0; i <= 60; ++i) {
        for (int j = 0; j <= 60; ++j) {
          const double r = evaluate0(patch, i / 60.0, j / 60.0).norm();
          least = std::min(least, r);
          most = std::max(most, r);
        }
      }
    }
    EXPECT_GE(shape->bounding_radius, most);
    EXPECT_LE(shape->bounding_radius, most * 1.001);
    EXPECT_LE(shape->inner_radius, least);
    EXPECT_GE(shape->inner_radius, least * 0.999);
  }
}

// --- kinks and curvature
// -----------------------------------------------------------------------------------------

TEST(Kinks, BoxEdgesOpenByARightAngle) {
  const auto shape = build(box({1, 2, 3}));
  for (const auto& links : shape->links) {
    for (const EdgeLink& link : links) EXPECT_NEAR(link.kink, M_PI / 2, 1e-14);
  }
  EXPECT_FALSE(shape->smooth);
  EXPECT_EQ(shape->curvature.min_radius, 0);
  EXPECT_EQ(shape->curvature.max_radius, std::numeric_limits<double>::infinity());
  EXPECT_LT(shape->concavity, 1e-14);
}

TEST(Kinks, ConePolesAreNotSmooth) {
  const auto shape = build(revolve({{0, -1}, {1, 0}, {0, 1}}));
  EXPECT_FALSE(shape->smooth);
  for (size_t p = 0; p < shape->links.size(); ++p) EXPECT_NEAR(shape->links[p][2].kink, M_PI / 3, 1e-3);
  EXPECT_EQ(shape->curvature.min_radius, 0);
}

TEST(Kinks, ImperfectBicubicJointsLoad) {
  std::vector<std::string> warnings;
  const auto shape = build(fitted_ellipsoid({1, 1.3, 0.8}, 1), &warnings);
  EXPECT_FALSE(shape->smooth);
  EXPECT_LT(shape->concavity, 1e-4);
  EXPECT_EQ(shape->curvature.min_radius, 0);
  EXPECT_GT(shape->patch_curvature.min_radius, 0.3);
}

TEST(Curvature, BoundsOfEllipsoidsHoldAndAreClose) {
  Random random(3);
  for (int trial = 0; trial < 10; ++trial) {
    Vec3 a = random.box(0.5, 2);
    const auto shape = build(exact_ellipsoid(a));
    std::sort(a.data(), a.data() + 3);
    const double least = a[0] * a[0] / a[2], most = a[2] * a[2] / a[0];
    EXPECT_LE(shape->curvature.min_radius, least);
    EXPECT_GE(shape->curvature.min_radius, 0.8 * least);
    EXPECT_GE(shape->curvature.max_radius, most);
    EXPECT_LE(shape->curvature.max_radius, 1.2 * most);
  }
}

TEST(Curvature, SphereIsRecognised) {
  for (const Surfaces& body : {exact_ellipsoid({2, 2, 2}), revolved_ellipsoid(2, 2)}) {
    const auto shape = build(body);
    EXPECT_NEAR(shape->curvature.min_radius, 2, 1e-5);
    EXPECT_NEAR(shape->curvature.max_radius, 2, 1e-5);
    EXPECT_NEAR(shape->inner_radius, shape->bounding_radius, 1e-12);
  }
}

TEST(Curvature, FlatPolesMakeTheLargestRadiusInfinite) {
  // Fourth-order contact with the plane z = -1 at the pole.
  const auto shape = build(revolve({{0, -1}, {0.5, -1}, {1, -1}, {1, 0}, {1, 1}, {0.5, 1}, {0, 1}}));
  EXPECT_EQ(shape->curvature.max_radius, std::numeric_limits<double>::infinity());
}

// --- convexity
// ---------------------------------------------------------------------------------------------------

TEST(Convexity, ShallowWaistIsAcceptedAndItsDepthReported) {
  for (double b : {-0.03, -0.05}) {
    const Waisted w = waisted(b);
    std::vector<std::string> warnings;
    const auto shape = build(w.body, &warnings);
    EXPECT_NEAR(shape->concavity / w.depth, 1, 0.02) << b;
    EXPECT_GT(shape->support_excess, 2 * w.depth);
    EXPECT_LT(shape->support_excess, 6 * w.depth);
    ASSERT_EQ(warnings.size(), 1u);
    EXPECT_TRUE(contains(warnings[0], "body: not quite convex: patch 0, u=")) << warnings[0];
    EXPECT_EQ(shape->curvature.max_radius, std::numeric_limits<double>::infinity());
  }
}

double number_after(const std::string& text, const std::string& name) {
  const size_t at = text.find(name);
  return at == std::string::npos ? kFarAway : std::stod(text.substr(at + name.size()));
}

// Places are known as far as depths are told apart, to a thousandth.
TEST(Convexity, DeepWaistIsRefusedWithItsPlaceAndDepth) {
  const Waisted w = waisted(-0.3);
  const std::string error = error_of(w.body);
  EXPECT_TRUE(contains(error, "body: not convex: patch 0, u=")) << error;
  EXPECT_NEAR(number_after(error, "v="), 0.5, 0.005) << error;
  EXPECT_NEAR(number_after(error, "depth ") / w.depth, 1, 0.05) << error;
}

TEST(Convexity, PlaceIsCountedAsInTheFileWhenThePatchWasTurned) {
  const std::string error = error_of({swap_uv(waisted(-0.3).body[0])});
  EXPECT_TRUE(contains(error, "patch 0, u=")) << error;
  EXPECT_NEAR(number_after(error, "u="), 0.5, 0.005) << error;
}

// Two caps of spheres of radius 1 that overlap: their common circle is a concave joint with this kink.
Surfaces overlapping_spheres(double kink) {
  const double end = M_PI / 2 + kink / 2;  // polar angle at which each cap stops, from its pole
  const double shift = std::cos(end), w = std::cos(end / 4);
  Surfaces body;
  for (double sign : {-1.0, 1.0}) {
    // The meridian in two rational quadratic arcs of half the angle each (NURBS Book, section 7.3).
    NurbsSurface s = revolve({{0, 0}, {0, 0}, {0, 0}, {0, 0}, {0, 0}})[0];
    s.degree_v = 2;
    s.knots_v = {0, 0, 0, 0.5, 0.5, 1, 1, 1};
    for (int i = 0; i < s.size_u; ++i) {
      const double wu = i % 2 ? std::sqrt(0.5) : 1;
      const double c[9] = {1, 1, 0, -1, -1, -1, 0, 1, 1}, d[9] = {0, 1, 1, 1, 0, -1, -1, -1, 0};
      for (int k = 0; k < 5; ++k) {
        const double angle = k * end / 4, wv = k % 2 ? w : 1, r = std::sin(angle) / wv;
        const double z = sign * (std::cos(angle) / wv - shift);
        s.point(i, k) = wu * wv * Vec4(r * c[i], r * d[i], z, 1);
      }
    }
    body.push_back(s);
  }
  return body;
}

TEST(Convexity, GrooveBetweenTwoSpheres) {
  for (double kink : {1e-4, 1e-3, 1e-2, 5e-2}) {
    const auto shape = build(overlapping_spheres(kink));
    EXPECT_NEAR(shape->concavity / (1 - std::cos(kink / 2)), 1, 0.02) << kink;
    EXPECT_NEAR(shape->support_excess / (1 - std::cos(kink)), 1, 0.02) << kink;
    EXPECT_FALSE(shape->smooth);
    EXPECT_EQ(shape->curvature.max_radius, std::numeric_limits<double>::infinity());
    double least = 0;
    for (const auto& links : shape->links) {
      for (const EdgeLink& link : links) least = std::min(least, link.kink);
    }
    EXPECT_NEAR(least, -kink, 1e-10);
  }
  EXPECT_TRUE(contains(error_of(overlapping_spheres(0.2)), "not convex: patch "))
      << error_of(overlapping_spheres(0.2));
}

TEST(Convexity, ConvexBodiesHaveNoDent) {
  for (const Surfaces& body : {pebble(), exact_ellipsoid({1, 2, 3}), exact_ellipsoid({1, 1, 0.01}),
                               revolved_ellipsoid(1, 5), overlapping_spheres(-0.3)}) {
    std::vector<std::string> warnings;
    const auto shape = build(body, &warnings);
    EXPECT_LT(shape->concavity, 1e-12 * shape->bounding_radius);
    EXPECT_LT(shape->support_excess, 1e-12 * shape->bounding_radius);
    for (const std::string& w : warnings) EXPECT_FALSE(contains(w, "convex")) << w;
  }
}

// --- gyration
// ----------------------------------------------------------------------------------------------------

TEST(Gyration, IsComputedForTheUniformSolid) {
  const auto shape = build(exact_ellipsoid({1, 2, 3}));
  EXPECT_LT((shape->principal_gyration - Vec3(1, 2, 2.6)).norm(), 1e-11);
  const Mat3 axes = shape->principal_axes.toRotationMatrix();
  const Mat3 back = axes * shape->principal_gyration.asDiagonal() * axes.transpose();
  EXPECT_LT((back - shape->gyration).norm(), 1e-12);
}

TEST(Gyration, GivenTensorReplacesIt) {
  Mat3 g;
  g << 2, 0.1, 0.2, 0.1, 2.5, 0.3, 0.2, 0.3, 3;
  const auto shape = make_shape("body", exact_ellipsoid({1, 2, 3}), g);
  EXPECT_EQ(shape->gyration, g);
  const Mat3 axes = shape->principal_axes.toRotationMatrix();
  EXPECT_LT((axes * shape->principal_gyration.asDiagonal() * axes.transpose() - g).norm(), 1e-14);
  EXPECT_LT(shape->principal_gyration[0], shape->principal_gyration[1]);
  EXPECT_LT(shape->principal_gyration[1], shape->principal_gyration[2]);
}

TEST(Gyration, ImpossibleTensorsAreRefused) {
  const Surfaces body = exact_ellipsoid({1, 1, 1});
  Mat3 g = Mat3::Identity();
  EXPECT_EQ(error_of(body, g), "accepted");
  g(0, 1) = 0.1;
  EXPECT_EQ(error_of(body, g), "body: gyration must be symmetric");
  g = Vec3(1, 1, -1).asDiagonal();
  EXPECT_TRUE(
      contains(error_of(body, g), "body: gyration must be positive definite: its eigenvalues are -1, 1, 1"));
  g = Vec3(1, 1, 2.5).asDiagonal();
  EXPECT_TRUE(contains(error_of(body, g), "must not exceed the sum of the others"));
  g(0, 0) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(error_of(body, g), "body: gyration must be finite");
  g = Vec3(0.6, 0.7, 1.1).asDiagonal();  // as of mass outside the ball
  EXPECT_TRUE(contains(error_of(body, g),
                       "largest eigenvalue is 1.1; it must not exceed the square of the "
                       "bounding radius, 1"));
}

}  // namespace
}  // namespace nurbs::test_shape

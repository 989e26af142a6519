// NURBS surfaces: de Boor against the basis functions' definition, and the exact split into Bezier patches.
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "nurbs/knot_removal.h"
#include "nurbs/nurbs_surface.h"
#include "support/random.h"

namespace nurbs::test_nurbs_surface {
namespace {

using test::Random;

// Knots on [0, 3] and outside: clamped or not, interior knots of multiplicity 1 .. degree. `size` receives
// the number of control points that belong to them.
std::vector<double> random_knots(Random& random, int degree, bool clamped, int& size) {
  std::vector<double> knots;
  double t = 0;
  for (int i = 0; i <= degree; ++i) knots.push_back(clamped ? 0 : -random.uniform(0, 1));
  std::sort(knots.begin(), knots.end());
  knots.back() = 0;
  const int interior = random.whole(0, 4);
  for (int i = 0; i < interior; ++i) {
    t += random.uniform(0.05, 0.6);
    const int multiplicity = random.whole(1, degree);
    knots.insert(knots.end(), multiplicity, t);
  }
  std::vector<double> tail;
  for (int i = 0; i <= degree; ++i) tail.push_back(clamped ? 3 : 3 + random.uniform(0, 1));
  std::sort(tail.begin(), tail.end());
  tail.front() = 3;
  knots.insert(knots.end(), tail.begin(), tail.end());
  size = static_cast<int>(knots.size()) - degree - 1;
  return knots;
}

NurbsSurface random_surface(Random& random, int degree_u, int degree_v, bool clamped, bool rational) {
  NurbsSurface s;
  s.degree_u = degree_u;
  s.degree_v = degree_v;
  s.knots_u = random_knots(random, degree_u, clamped, s.size_u);
  s.knots_v = random_knots(random, degree_v, clamped, s.size_v);
  for (int i = 0; i < s.size_u * s.size_v; ++i) {
    const double w = rational ? random.uniform(0.3, 3) : 1;
    s.points.push_back(w * Vec4(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1), 1));
  }
  return s;
}

// N_{i,p}(t) by its definition (NURBS Book, eq. 2.5), 0/0 = 0; t strictly inside a span.
double basis(const std::vector<double>& knots, int i, int p, double t) {
  if (p == 0) return knots[i] <= t && t < knots[i + 1] ? 1 : 0;
  const double a = knots[i + p] - knots[i], b = knots[i + p + 1] - knots[i + 1];
  const double left = a > 0 ? (t - knots[i]) / a * basis(knots, i, p - 1, t) : 0;
  const double right = b > 0 ? (knots[i + p + 1] - t) / b * basis(knots, i + 1, p - 1, t) : 0;
  return left + right;
}

Vec3 evaluate_by_definition(const NurbsSurface& s, double u, double v) {
  Vec4 sum = Vec4::Zero();
  for (int i = 0; i < s.size_u; ++i) {
    const double a = basis(s.knots_u, i, s.degree_u, u);
    if (a == 0) continue;
    for (int j = 0; j < s.size_v; ++j) sum += a * basis(s.knots_v, j, s.degree_v, v) * s.point(i, j);
  }
  return sum.head<3>() / sum[3];
}

TEST(NurbsSurface, DeBoorAgreesWithTheDefinitionOfTheBasis) {
  Random random(1);
  for (int trial = 0; trial < 100; ++trial) {
    const NurbsSurface s =
        random_surface(random, random.whole(1, 5), random.whole(1, 5), trial % 2, trial % 3);
    const double u = random.uniform(0, 3), v = random.uniform(0, 3);
    EXPECT_LT((evaluate(s, u, v) - evaluate_by_definition(s, u, v)).norm(), 1e-13) << "trial " << trial;
  }
}

TEST(NurbsSurface, BezierSplitAgreesWithDeBoorForEveryDegree) {
  Random random(2);
  for (int degree_u = 1; degree_u <= kMaxDegree; ++degree_u) {
    for (int degree_v = 1; degree_v <= kMaxDegree; ++degree_v) {
      for (int kind = 0; kind < 4; ++kind) {
        const NurbsSurface s = random_surface(random, degree_u, degree_v, kind % 2, kind / 2);
        for (const BezierPiece& piece : split_to_bezier(s)) {
          for (int k = 0; k < 4; ++k) {
            const double a = random.uniform(0, 1), b = random.uniform(0, 1);
            const Vec3 expected =
                evaluate(s, piece.u0 + a * (piece.u1 - piece.u0), piece.v0 + b * (piece.v1 - piece.v0));
            EXPECT_LT((evaluate0(piece.patch, a, b) - expected).norm(), 1e-13)
                << "degrees " << degree_u << ", " << degree_v << ", kind " << kind;
          }
        }
      }
    }
  }
}

TEST(NurbsSurface, PiecesTileTheDomainInOrder) {
  Random random(3);
  const NurbsSurface s = random_surface(random, 3, 2, false, true);
  const std::vector<BezierPiece> pieces = split_to_bezier(s);
  EXPECT_EQ(pieces.front().u0, 0);
  EXPECT_EQ(pieces.front().v0, 0);
  EXPECT_EQ(pieces.back().u1, 3);
  EXPECT_EQ(pieces.back().v1, 3);
  for (size_t i = 1; i < pieces.size(); ++i) {
    const bool same_row = pieces[i].u0 == pieces[i - 1].u0;
    EXPECT_EQ(same_row ? pieces[i].v0 : pieces[i].u0, same_row ? pieces[i - 1].v1 : pieces[i - 1].u1);
  }
}

TEST(NurbsSurface, EvaluatesAtBothEndsOfTheDomain) {
  Random random(4);
  const NurbsSurface s = random_surface(random, 3, 4, true, true);
  const Vec4& first = s.points.front();
  const Vec4& last = s.points.back();
  EXPECT_LT((evaluate(s, 0, 0) - first.head<3>() / first[3]).norm(), 1e-15);
  EXPECT_LT((evaluate(s, 3, 3) - last.head<3>() / last[3]).norm(), 1e-15);
  EXPECT_EQ(evaluate(s, 99, -99), evaluate(s, 3, 0));
}

TEST(NurbsSurface, BezierSurfaceIsItsOwnSplitToTheLastBit) {
  Random random(5);
  NurbsSurface s = random_surface(random, 4, 3, true, true);
  s.knots_u = {0, 0, 0, 0, 0, 1, 1, 1, 1, 1};
  s.knots_v = {0, 0, 0, 0, 1, 1, 1, 1};
  s.size_u = 5;
  s.size_v = 4;
  s.points.resize(20, Vec4(1, 2, 3, 1));
  const std::vector<BezierPiece> pieces = split_to_bezier(s);
  ASSERT_EQ(pieces.size(), 1u);
  EXPECT_TRUE(pieces[0].patch.rational);
  EXPECT_EQ(pieces[0].patch.points, s.points);
}

TEST(NurbsSurface, EqualWeightsAreDividedOut) {
  Random random(6);
  NurbsSurface s = random_surface(random, 3, 3, false, false);
  for (Vec4& p : s.points) p *= 0.7;
  for (const BezierPiece& piece : split_to_bezier(s)) {
    EXPECT_FALSE(piece.patch.rational);
    for (const Vec4& p : piece.patch.points) EXPECT_EQ(p[3], 1.0);
  }
  s.points[0] *= 1.5;
  EXPECT_TRUE(split_to_bezier(s)[0].patch.rational);
}

TEST(NurbsSurface, KnotsInsertedLeaveTheSurface) {
  Random random(8);
  for (int trial = 0; trial < 200; ++trial) {
    const NurbsSurface s =
        random_surface(random, random.whole(1, 9), random.whole(1, 9), trial % 2, trial % 3);
    NurbsSurface finer = s;
    for (int k = 0; k < 6; ++k) {
      double u = random.uniform(0, 3);
      if (k % 2) {  // one that is there
        u = finer.knots_u[random.whole(s.degree_u + 1, finer.size_u)];
        if (std::count(finer.knots_u.begin(), finer.knots_u.end(), u) >= s.degree_u || u >= 3) continue;
      }
      finer = insert_knot_u(finer, u);
      ASSERT_EQ(find_defect(finer), "");
      ASSERT_EQ(std::count(finer.knots_u.begin(), finer.knots_u.end(), u) > 0, true);
    }
    EXPECT_GT(finer.size_u, s.size_u);
    for (int k = 0; k < 10; ++k) {
      const double u = random.uniform(0, 3), v = random.uniform(0, 3);
      EXPECT_LT((evaluate(finer, u, v) - evaluate(s, u, v)).norm(), 1e-13) << "trial " << trial;
    }
  }
}

int spans_in_u(const NurbsSurface& s) {
  int spans = 0;
  for (int k = s.degree_u; k < s.size_u; ++k) spans += s.knots_u[k] < s.knots_u[k + 1];
  return spans;
}

// Knots inserted into surfaces of one and of more spans, some next to an end, are removed; those that
// separate two polynomials stay.
TEST(KnotRemoval, RemovesWhatRefinementAdded) {
  Random random(9);
  int left = 0;
  for (int trial = 0; trial < 600; ++trial) {
    const int degree = random.whole(1, kMaxDegree);
    NurbsSurface s = random_surface(random, degree, random.whole(1, 3), trial % 2, trial % 3);
    if (trial % 4 == 0) {
      s.size_u = degree + 1;
      s.knots_u.assign(2 * degree + 2, 0);
      std::fill(s.knots_u.begin() + degree + 1, s.knots_u.end(), 3);
      s.points.resize(static_cast<size_t>(s.size_u) * s.size_v);
    }
    int removed = -1;
    const NurbsSurface same = remove_knots_u(s, &removed);
    EXPECT_EQ(removed, 0);
    EXPECT_EQ(same.points, s.points);
    NurbsSurface finer = s;
    const int added = random.whole(1, 5);
    for (int k = 0; k < added; ++k) {
      const double u = random.below(3) ? random.uniform(0, 3) : 3 * random.log_uniform(1e-9, 1e-2);
      const int repeated = random.whole(1, degree);
      for (int i = 0; i < repeated; ++i) finer = insert_knot_u(finer, u);
    }
    const NurbsSurface simpler = remove_knots_u(finer, &removed);
    EXPECT_LE(removed, added);
    left += added - removed;
    if (removed == added) {
      EXPECT_EQ(spans_in_u(simpler), spans_in_u(s));
    }
    EXPECT_EQ(find_defect(simpler), "");
    for (int k = 0; k < 20; ++k) {
      const double u = random.uniform(0, 3), v = random.uniform(0, 3);
      EXPECT_LT((evaluate(simpler, u, v) - evaluate(s, u, v)).norm(), 1e-13) << "trial " << trial;
    }
  }
  EXPECT_LT(left, 20);  // by round-off
}

// Weights of the union would be too far apart, or negative: half a circle and more.
TEST(KnotRemoval, KeepsArcsShort) {
  const auto arc = [](double angle) {  // about the middle of it
    const double w = std::cos(0.5 * angle), s = std::sin(0.5 * angle);
    NurbsSurface out = bezier_surface(2, 1, {});
    for (const Vec3& p : {Vec3(w, -s, 1), Vec3(1, 0, w), Vec3(w, s, 1)})
      for (double z : {0, 1}) out.points.emplace_back(p[0], p[1], p[2] * z, p[2]);
    return out;
  };
  int removed = 0;
  for (double angle : {1.5, 2.5}) {
    remove_knots_u(insert_knot_u(arc(angle), 0.5), &removed);
    EXPECT_EQ(removed, 1) << angle;
  }
  remove_knots_u(insert_knot_u(arc(3.0), 0.5), &removed);
  EXPECT_EQ(removed, 0);
}

// Two spans that meet at a corner, of weights that grow from 1 to 1e14 in the second: beside those the corner
// is round-off in homogeneous coordinates.
TEST(KnotRemoval, KeepsCornersBesideLargeWeights) {
  for (double turn : {1.5, 1e-3, 1e-5, 1e-8})
    for (double ratio : {1.0, 1e3, 1e7}) {
      NurbsSurface s = bezier_surface(2, 1, {});
      s.knots_u = {0, 0, 0, 1, 1, 2, 2, 2};
      s.size_u = 5;
      const Vec2 places[] = {{0, 0},
                             {0.5, 0},
                             {1, 0},
                             {1 + 0.5 * std::cos(turn), 0.5 * std::sin(turn)},
                             {1 + std::cos(turn), std::sin(turn)}};
      for (int i = 0; i < 5; ++i) {
        const double w = std::pow(ratio, std::max(0, i - 2));
        for (double z : {0, 1}) s.points.emplace_back(w * places[i][0], w * places[i][1], w * z, w);
      }
      int removed = 0;
      remove_knots_u(s, &removed);
      EXPECT_EQ(removed, 0) << turn << " " << ratio;
    }
}

TEST(NurbsSurface, SwapExchangesTheParameters) {
  Random random(7);
  const NurbsSurface s = random_surface(random, 2, 5, false, true), t = swap_uv(s);
  for (int k = 0; k < 20; ++k) {
    const double u = random.uniform(0, 3), v = random.uniform(0, 3);
    EXPECT_LT((evaluate(s, u, v) - evaluate(t, v, u)).norm(), 1e-14);
  }
  EXPECT_EQ(swap_uv(t).points, s.points);
}

TEST(NurbsSurface, DefectsAreNamed) {
  Random random(8);
  const NurbsSurface good = random_surface(random, 3, 2, true, true);
  EXPECT_EQ(find_defect(good), "");
  const auto defect = [&](const auto& spoil) {
    NurbsSurface s = good;
    spoil(s);
    return find_defect(s);
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  using S = NurbsSurface;
  EXPECT_EQ(defect([](S& s) { s.degree_u = 0; }), "degree_u = 0, must be 1..9");
  EXPECT_EQ(defect([](S& s) { s.degree_v = 10; }), "degree_v = 10, must be 1..9");
  EXPECT_NE(defect([](S& s) { s.knots_u.pop_back(); }).find("knotvector_u has"), std::string::npos);
  EXPECT_NE(defect([](S& s) { s.knots_v.back() = 2; }).find("must not decrease"), std::string::npos);
  EXPECT_NE(defect([&](S& s) { s.knots_v[0] = nan; }).find("must be finite"), std::string::npos);
  EXPECT_NE(defect([](S& s) { s.points.pop_back(); }).find("control points, must be"), std::string::npos);
  EXPECT_NE(defect([](S& s) { s.points[2][3] = 0; }).find("weight[2] = 0, must be > 0"), std::string::npos);
  EXPECT_NE(defect([&](S& s) { s.points[2][3] = nan; }).find("weight[2] = nan"), std::string::npos);
  EXPECT_NE(defect([&](S& s) { s.points[1][2] = nan; }).find("has z = nan"), std::string::npos);
}

TEST(NurbsSurface, KnotMultiplicityIsLimited) {
  NurbsSurface s;
  s.degree_u = s.degree_v = 1;
  s.size_u = 4;
  s.size_v = 2;
  s.knots_v = {0, 0, 1, 1};
  s.points.assign(8, Vec4(0, 0, 0, 1));
  s.knots_u = {0, 0, 0.3, 0.6, 1, 1};
  EXPECT_EQ(find_defect(s), "");
  s.knots_u = {0, 0, 0.5, 0.5, 1, 1};
  EXPECT_NE(find_defect(s).find("the knot 0.5 is repeated more than 1 times"), std::string::npos);
  s.knots_u = {0, 0, 0, 0.5, 1, 1};
  EXPECT_NE(find_defect(s).find("the knot 0 is repeated more than 2 times"), std::string::npos);
  s.size_u = 2;
  s.points.resize(4);
  s.knots_u = {0, 1, 1, 2};
  EXPECT_NE(find_defect(s).find("empty domain"), std::string::npos);
}

}  // namespace
}  // namespace nurbs::test_nurbs_surface

// The paper's solver piece by piece: the trust-region step against its optimality conditions, every
// derivative of eqs 8-20 against finite differences, then whole solves against closed forms.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "body/shape.h"
#include "body/support.h"
#include "reference/cso.h"
#include "reference/cso_derivatives.h"
#include "reference/trust_region.h"
#include "shapes/primitives.h"
#include "support/allocations.h"
#include "support/random.h"

namespace nurbs::test_cso {
namespace {

test::Random& random_numbers() {
  static test::Random random(20240607);
  return random;
}
double uniform(double low, double high) {
  return random_numbers().uniform(low, high);
}
Vec3 random_direction() {
  return random_numbers().direction();
}
Quat random_turn() {
  return random_numbers().turn();
}

const Shape& pebble_shape() {
  static const auto shape = make_shape("pebble", pebble());
  return *shape;
}
const Shape& ellipsoid_shape() {
  static const auto shape = make_shape("ellipsoid", exact_ellipsoid(Vec3(1.0, 0.7, 0.5)));
  return *shape;
}
const Shape& sphere_shape() {
  static const auto shape = make_shape("sphere", exact_ellipsoid(Vec3(1, 1, 1)));
  return *shape;
}

// ---- trust region
// ---------------------------------------------------------------------------------------------

template <int N>
void expect_optimal(const Eigen::Matrix<double, N, 1>& g, const Eigen::Matrix<double, N, N>& h,
                    double radius) {
  const TrustRegionStep<N> r = solve_trust_region<N>(g, h, radius);
  const double length = r.step.norm(), scale = g.norm() + h.norm() * radius;
  ASSERT_LE(length, radius * (1 + 1e-10));
  EXPECT_NEAR(r.predicted, -g.dot(r.step) - 0.5 * r.step.dot(h * r.step), 1e-12 * scale * radius);
  // Nocedal & Wright theorem 4.1: (H + mu I) s = -g with mu >= 0, mu (radius - |s|) = 0, H + mu I >= 0.
  const double mu = length > 0 ? -(g + h * r.step).dot(r.step) / (length * length) : 0;
  EXPECT_LT((h * r.step + mu * r.step + g).norm(), 1e-9 * scale);
  EXPECT_GT(mu, -1e-9 * h.norm());
  if (!r.on_boundary) {
    EXPECT_LT(std::abs(mu), 1e-9 * h.norm());
  }
  // No sampled point of the region is lower.
  for (int k = 0; k < 50; ++k) {
    Eigen::Matrix<double, N, 1> s = Eigen::Matrix<double, N, 1>::Random();
    s *= radius * uniform(0, 1) / s.norm();
    EXPECT_LE(-g.dot(s) - 0.5 * s.dot(h * s), r.predicted + 1e-10 * scale * radius);
  }
}

template <int N>
void random_subproblems() {
  std::srand(1);
  for (int k = 0; k < 500; ++k) {
    Eigen::Matrix<double, N, N> h = Eigen::Matrix<double, N, N>::Random();
    h = (h + h.transpose()).eval();
    if (k % 3 == 0) h = (h * h).eval();  // positive definite
    expect_optimal<N>(Eigen::Matrix<double, N, 1>::Random(), h, std::pow(10.0, uniform(-3, 1)));
  }
}

TEST(TrustRegion, StepIsOptimalInTwoAndFourVariables) {
  random_subproblems<2>();
  random_subproblems<4>();
}

TEST(TrustRegion, HardCaseMovesAlongTheMostNegativeCurvature) {
  Mat2 h;
  h << -1, 0, 0, 2;
  const TrustRegionStep<2> r = solve_trust_region<2>(Vec2(0, 1), h, 2.0);
  EXPECT_TRUE(r.on_boundary);
  EXPECT_NEAR(r.step.norm(), 2.0, 1e-12);
  EXPECT_NEAR(r.step[1], -1.0 / 3, 1e-12);  // (2 + 1) s = -1
  expect_optimal<2>(Vec2(0, 1), h, 2.0);
}

TEST(TrustRegion, SingularAndNonFiniteInputsGiveFiniteSteps) {
  const TrustRegionStep<2> flat = solve_trust_region<2>(Vec2(0, 0), Mat2::Zero(), 1.0);
  EXPECT_EQ(flat.step.norm(), 0);
  const TrustRegionStep<2> slope = solve_trust_region<2>(Vec2(3, 4), Mat2::Zero(), 0.5);
  EXPECT_NEAR((slope.step - Vec2(-0.3, -0.4)).norm(), 0, 1e-12);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(solve_trust_region<2>(Vec2(nan, 0), Mat2::Identity(), 1.0).step.norm(), 0);
  EXPECT_EQ(solve_trust_region<2>(Vec2(1, 0), Mat2::Identity() * nan, 1.0).predicted, 0);
}

// ---- derivatives
// ----------------------------------------------------------------------------------------------

// Central differences with one Richardson step: error O(h^4).
template <class F>
auto derivative(const F& f, double h) {
  const auto wide = ((f(h) - f(-h)) / (2 * h)).eval();
  const auto narrow = ((f(h / 2) - f(-h / 2)) / h).eval();
  return ((4 * narrow - wide) / 3).eval();
}

TEST(CsoDerivatives, DirectionInSphericalAngles) {
  for (int axis = 0; axis < 3; ++axis) {
    const SphericalChart chart{axis};
    for (int k = 0; k < 20; ++k) {
      const Vec2 x(uniform(-3, 3), uniform(0.3, 2.8));
      const DirectionJet jet = chart.direction(x);
      EXPECT_NEAR(jet.d.norm(), 1, 1e-15);
      EXPECT_LT((chart.angles(jet.d) - x).norm(), 1e-14);
      const auto at = [&](double rho, double phi) { return chart.direction(x + Vec2(rho, phi)); };
      const double h = 1e-3;
      EXPECT_LT((jet.d_rho - derivative([&](double t) { return at(t, 0).d; }, h)).norm(), 1e-11);
      EXPECT_LT((jet.d_phi - derivative([&](double t) { return at(0, t).d; }, h)).norm(), 1e-11);
      EXPECT_LT((jet.d_rho_rho - derivative([&](double t) { return at(t, 0).d_rho; }, h)).norm(), 1e-11);
      EXPECT_LT((jet.d_rho_phi - derivative([&](double t) { return at(t, 0).d_phi; }, h)).norm(), 1e-11);
      EXPECT_LT((jet.d_rho_phi - derivative([&](double t) { return at(0, t).d_rho; }, h)).norm(), 1e-11);
      EXPECT_LT((jet.d_phi_phi - derivative([&](double t) { return at(0, t).d_phi; }, h)).norm(), 1e-11);
    }
  }
}

TEST(CsoDerivatives, ChosenChartKeepsAwayFromItsPoles) {
  for (int k = 0; k < 1000; ++k) {
    const Vec3 d = k < 3 ? Vec3(Vec3::Unit(k)) : random_direction();
    const SphericalChart chart = SphericalChart::choose(d);
    EXPECT_GE(std::sin(chart.angles(d)[1]), std::sqrt(2.0 / 3) - 1e-12);
    EXPECT_LT((chart.direction(chart.angles(d)).d - d).norm(), 1e-15);
  }
}

Jet3 placed(const Shape& shape, const SurfacePoint& at, double scale, const Mat3& turn, const Vec3& origin) {
  return place(evaluate3(shape.patches[at.patch], at.u, at.v), scale, turn, origin);
}

TEST(CsoDerivatives, GapObjectiveInSurfaceParameters) {
  const Shape& a = pebble_shape();
  const Shape& b = ellipsoid_shape();
  const Mat3 turn = random_turn().toRotationMatrix();
  for (int k = 0; k < 20; ++k) {
    const Vec4 x(uniform(0.1, 0.9), uniform(0.1, 0.9), uniform(0.1, 0.9), uniform(0.1, 0.9));
    const auto objective = [&](const Vec4& y) {
      return gap_objective(second_order_part(placed(a, {1, y[0], y[1]}, 1.3, Mat3::Identity(), Vec3::Zero())),
                           second_order_part(placed(b, {4, y[2], y[3]}, 0.8, turn, Vec3(0.4, 1.1, 0.9))));
    };
    const GapObjective f = objective(x);
    for (int i = 0; i < 4; ++i) {
      const auto value = [&](double t) {
        return Eigen::Matrix<double, 1, 1>(objective(x + t * Vec4::Unit(i)).value);
      };
      const auto gradient = [&](double t) { return objective(x + t * Vec4::Unit(i)).gradient; };
      EXPECT_NEAR(f.gradient[i], derivative(value, 1e-3)[0], 1e-8);
      EXPECT_LT((f.hessian.col(i) - derivative(gradient, 1e-3)).norm(), 1e-8);
    }
  }
}

// A support point well inside a patch, as a function of the angles of a chart, and what the implicit
// derivatives say.
struct SupportInAngles {
  const Shape& shape;
  SphericalChart chart;
  Vec2 angles;

  SurfacePoint at(const Vec2& x, const SurfacePoint* start = nullptr) const {
    return find_support(shape, chart.direction(x).d, start).where;
  }
  bool inside() const {
    const SurfacePoint p = at(angles);
    return std::min({p.u, 1 - p.u, p.v, 1 - p.v}) > 0.05;
  }
  ParameterJet jet(const Vec2& x) const {
    const SurfacePoint p = at(x);
    return parameter_jet(evaluate3(shape.patches[p.patch], p.u, p.v), chart.direction(x), {});
  }
};

class ImplicitDerivatives : public testing::TestWithParam<int> {
 protected:
  // Calls check(support) at random directions whose support points lie inside a patch.
  template <class Check>
  void at_random_directions(const Check& check) {
    const Shape& shape = GetParam() == 0 ? pebble_shape() : ellipsoid_shape();
    int checked = 0;
    for (int k = 0; k < 100 && checked < 20; ++k) {
      const SphericalChart chart{k % 3};
      const SupportInAngles support{shape, chart, Vec2(uniform(-3, 3), uniform(0.5, 2.6))};
      if (!support.inside()) continue;
      check(support);
      ++checked;
    }
    EXPECT_EQ(checked, 20);
  }
  static Vec2 parameters(const SurfacePoint& p) { return {p.u, p.v}; }
};

TEST_P(ImplicitDerivatives, FirstDerivativesOfSurfaceParameters) {
  at_random_directions([](const SupportInAngles& s) {
    const ParameterJet eta = s.jet(s.angles);
    ASSERT_TRUE(eta.regular);
    const double h = 1e-3;
    const auto along_rho = [&](double t) { return parameters(s.at(s.angles + Vec2(t, 0))); };
    const auto along_phi = [&](double t) { return parameters(s.at(s.angles + Vec2(0, t))); };
    EXPECT_LT((eta.rho - derivative(along_rho, h)).norm(), 1e-7);  // eq. 16
    EXPECT_LT((eta.phi - derivative(along_phi, h)).norm(), 1e-7);  // eq. 17
  });
}

TEST_P(ImplicitDerivatives, SecondDerivativesOfSurfaceParameters) {
  at_random_directions([](const SupportInAngles& s) {
    const ParameterJet eta = s.jet(s.angles);
    const double h = 1e-3;
    const auto rho_along_rho = [&](double t) { return s.jet(s.angles + Vec2(t, 0)).rho; };
    const auto rho_along_phi = [&](double t) { return s.jet(s.angles + Vec2(0, t)).rho; };
    const auto phi_along_rho = [&](double t) { return s.jet(s.angles + Vec2(t, 0)).phi; };
    const auto phi_along_phi = [&](double t) { return s.jet(s.angles + Vec2(0, t)).phi; };
    EXPECT_LT((eta.rho_rho - derivative(rho_along_rho, h)).norm(), 1e-6);  // eq. 18
    EXPECT_LT((eta.phi_phi - derivative(phi_along_phi, h)).norm(), 1e-6);  // eq. 19
    EXPECT_LT((eta.rho_phi - derivative(rho_along_phi, h)).norm(), 1e-6);  // eq. 20
    EXPECT_LT((eta.rho_phi - derivative(phi_along_rho, h)).norm(), 1e-6);
  });
}

INSTANTIATE_TEST_SUITE_P(Bodies, ImplicitDerivatives, testing::Values(0, 1));

TEST(CsoDerivatives, HeldParametersStayAndTheOtherFollowsItsEdge) {
  const Jet3 s = evaluate3(pebble_shape().patches[0], 0.3, 0.6);
  const Vec3 d = s.su.cross(s.sv).normalized();
  const SphericalChart chart = SphericalChart::choose(d);
  const DirectionJet jet = chart.direction(chart.angles(d));
  const ParameterJet on_edge = parameter_jet(s, jet, {false, true});
  EXPECT_TRUE(on_edge.regular);
  EXPECT_EQ(on_edge.rho[0], 0);
  EXPECT_EQ(on_edge.phi_phi[0], 0);
  EXPECT_NEAR(d.dot(s.svv) * on_edge.rho[1], -jet.d_rho.dot(s.sv), 1e-12);
  const ParameterJet on_corner = parameter_jet(s, jet, {false, false});
  EXPECT_TRUE(on_corner.regular);
  EXPECT_EQ(on_corner.rho.norm() + on_corner.phi.norm() + on_corner.rho_phi.norm(), 0);
}

// f2 of a pebble and an ellipsoid, as a function of the angles.
struct PairInAngles {
  SphericalChart chart;
  Mat3 turn;
  Vec3 offset;
  double scale_b;

  AngleObjective objective(const Vec2& x, bool* inside = nullptr) const {
    const DirectionJet d = chart.direction(x);
    const SurfacePoint p = find_support(pebble_shape(), d.d).where;
    const SurfacePoint q = find_support(ellipsoid_shape(), turn.transpose() * -d.d).where;
    if (inside) *inside = std::min({p.u, 1 - p.u, p.v, 1 - p.v, q.u, 1 - q.u, q.v, 1 - q.v}) > 0.05;
    const Jet3 a = placed(pebble_shape(), p, 1, Mat3::Identity(), Vec3::Zero());
    const Jet3 b = placed(ellipsoid_shape(), q, scale_b, turn, offset);
    return angle_objective(gap_objective(second_order_part(a), second_order_part(b)), parameter_jet(a, d, {}),
                           parameter_jet(b, d, {}));
  }
};

TEST(CsoDerivatives, GradientAndHessianOfF2) {
  int checked = 0;
  for (int k = 0; k < 200 && checked < 30; ++k) {
    const PairInAngles pair{SphericalChart{k % 3}, random_turn().toRotationMatrix(), 1.5 * random_direction(),
                            1.2};
    const Vec2 x(uniform(-3, 3), uniform(0.5, 2.6));
    bool inside = false;
    const AngleObjective f = pair.objective(x, &inside);
    if (!inside) continue;
    ++checked;
    for (int i = 0; i < 2; ++i) {
      const auto value = [&](double t) {
        return Eigen::Matrix<double, 1, 1>(pair.objective(x + t * Vec2::Unit(i)).value);
      };
      const auto gradient = [&](double t) { return pair.objective(x + t * Vec2::Unit(i)).gradient; };
      EXPECT_NEAR(f.gradient[i], derivative(value, 1e-3)[0], 1e-7);             // eq. 13
      EXPECT_LT((f.hessian.col(i) - derivative(gradient, 1e-3)).norm(), 1e-6);  // eqs 14, 15
    }
  }
  EXPECT_EQ(checked, 30);
}

// ---- whole solves
// ---------------------------------------------------------------------------------------------

Particle particle(const Shape& shape, double scale, const Vec3& x, const Quat& q) {
  Particle p;
  p.shape = &shape;
  p.scale = scale;
  p.x = x;
  p.q = q;
  return p;
}

void expect_consistent(const ContactResult& r, double size) {
  EXPECT_EQ(r.status, Status::converged);
  EXPECT_NEAR(r.normal.norm(), 1, 1e-14);
  EXPECT_NEAR(r.normal.dot(r.point_b - r.point_a), r.gap, 1e-13 * size);
  EXPECT_LT(((r.point_b - r.point_a) - r.gap * r.normal).norm(), 1e-8 * size);
  EXPECT_EQ(r.lower, r.gap);
  EXPECT_EQ(r.upper, r.gap);
}

TEST(Cso, SpheresMatchTheClosedForm) {
  for (int k = 0; k < 300; ++k) {
    const double ra = uniform(0.5, 2), rb = uniform(0.5, 2);
    const Vec3 d = k < 6 ? Vec3((k % 2 ? -1 : 1) * Vec3::Unit(k / 2)) : random_direction();
    const double distance = (ra + rb) * uniform(0.3, 1.7);
    const Vec3 xa(uniform(-5, 5), uniform(-5, 5), uniform(-5, 5));
    const Particle a = particle(sphere_shape(), ra, xa, random_turn());
    const Particle b = particle(sphere_shape(), rb, xa + distance * d, random_turn());
    const ContactResult r = solve_cso(a, b, 1e-12);
    const double exact = (b.x - a.x).norm() - ra - rb;
    ASSERT_NEAR(r.gap, exact, 1e-14 * (ra + rb + distance));
    EXPECT_LT((r.normal - d).norm(), 1e-10);
    EXPECT_LT((r.point_a - ra * d).norm(), 1e-10 * ra);
    expect_consistent(r, ra + rb);
  }
}

// Two copies of one body touching back to back at a chosen surface point, moved `gap` apart along the normal
// there: the answer is known whatever the body, as long as its curvature there is positive.
void expect_back_to_back(const Shape& shape, const SurfacePoint& at, double gap) {
  const Jet2 s = evaluate2(shape.patches[at.patch], at.u, at.v);
  const Vec3 n = s.su.cross(s.sv).normalized();
  const Quat qa = random_turn();
  const Vec3 normal = qa * n;
  // Half a turn about a tangent and any turn about the normal: B's own normal n there looks along -normal.
  const Quat half_turn(Eigen::AngleAxisd(M_PI, normal.unitOrthogonal()));
  const Quat qb = Quat(Eigen::AngleAxisd(uniform(-3, 3), normal)) * half_turn * qa;
  const Vec3 xa(uniform(-2, 2), uniform(-2, 2), uniform(-2, 2));
  const Particle a = particle(shape, 1, xa, qa);
  const Particle b = particle(shape, 1, xa + qa * s.s - qb * s.s + gap * normal, qb);
  const ContactResult r = solve_cso(a, b, 1e-11);
  EXPECT_NEAR(r.gap, gap, 1e-13);
  EXPECT_LT((r.normal - normal).norm(), 1e-9);
  EXPECT_LT((r.point_a - qa * s.s).norm(), 1e-9);
  expect_consistent(r, 1);
}

TEST(Cso, ContactsOnPatchEdgesAndThreePatchCorners) {
  for (const double gap : {0.1, 1e-6, -1e-6, -0.02}) {
    for (int patch = 0; patch < static_cast<int>(ellipsoid_shape().patches.size()); ++patch) {
      for (const double u : {0.0, 0.5, 1.0})
        for (const double v : {0.0, 0.37, 1.0}) {
          SCOPED_TRACE(testing::Message() << "gap " << gap << " patch " << patch << " u " << u << " v " << v);
          expect_back_to_back(ellipsoid_shape(), {patch, u, v}, gap);
        }
    }
  }
}

TEST(Cso, WarmStartFollowsATurningPairCheaply) {
  Particle a = particle(pebble_shape(), 1, Vec3::Zero(), random_turn());
  Particle b = particle(ellipsoid_shape(), 1.1, Vec3(1.2, 0.5, 0.3), random_turn());
  CsoStart start;
  int warm_iterations = 0;
  for (int step = 0; step < 100; ++step) {
    const ContactResult warm = solve_cso(a, b, 1e-9, &start);
    const ContactResult cold = solve_cso(a, b, 1e-9);
    ASSERT_TRUE(start.valid);
    EXPECT_EQ(warm.rung, step ? Rung::warm : Rung::cold);
    EXPECT_NEAR(warm.gap, cold.gap, 1e-12);
    EXPECT_LT((warm.normal - cold.normal).norm(), 1e-7);
    if (step) warm_iterations += warm.iterations;
    a.q = (a.q * Quat(Eigen::AngleAxisd(2e-3, Vec3::UnitX()))).normalized();
    b.q = (b.q * Quat(Eigen::AngleAxisd(2e-3, Vec3::UnitZ()))).normalized();
  }
  EXPECT_LE(warm_iterations, 4 * 99);
}

TEST(Cso, ResultDoesNotDependOnUnitsOrPlace) {
  const Quat qa = random_turn(), qb = random_turn();
  const Vec3 offset(1.1, 0.6, -0.2);
  const double gap = solve_cso(particle(pebble_shape(), 1, Vec3::Zero(), qa),
                               particle(ellipsoid_shape(), 0.9, offset, qb), 1e-12)
                         .gap;
  for (const double unit : {1e-6, 1e-3, 1e6}) {
    const ContactResult r = solve_cso(particle(pebble_shape(), unit, Vec3::Zero(), qa),
                                      particle(ellipsoid_shape(), 0.9 * unit, unit * offset, qb), 1e-12);
    EXPECT_NEAR(r.gap / unit, gap, 1e-13);
    EXPECT_EQ(r.status, Status::converged);
  }
}

TEST(Cso, AllocatesNothing) {
  const Particle a = particle(pebble_shape(), 1, Vec3::Zero(), random_turn());
  const Particle b = particle(ellipsoid_shape(), 1, Vec3(1.3, 0.4, 0.2), random_turn());
  const long before = test::allocations();
  const ContactResult r = solve_cso(a, b, 1e-9);
  EXPECT_EQ(test::allocations(), before);
  EXPECT_EQ(r.status, Status::converged);
}

// Bodies the paper's derivatives are not made for: creases, flats, poles, concentric copies. What is asked is
// a finite answer whose status is true: a converged result really is a stationary direction, an unresolved
// one really a bracket.
TEST(Cso, BodiesOutsideTheMethodEndHonestly) {
  const auto box_shape = make_shape("box", box(Vec3(1, 0.8, 0.6)));
  const auto revolved = make_shape("revolved", revolved_ellipsoid(1.0, 0.6));
  const Shape* shapes[] = {box_shape.get(), revolved.get(), &pebble_shape(), &sphere_shape()};
  for (int k = 0; k < 400; ++k) {
    const Shape& sa = *shapes[k % 4];
    const Shape& sb = *shapes[(k / 4) % 4];
    const double distance = k % 5 == 0 ? 0 : uniform(0, 3);
    const bool aligned = k % 3 == 0;
    const Particle a = particle(sa, 1, Vec3::Zero(), aligned ? Quat::Identity() : random_turn());
    const Particle b = particle(sb, 1, distance * (aligned ? Vec3(Vec3::UnitZ()) : random_direction()),
                                aligned ? Quat::Identity() : random_turn());
    SCOPED_TRACE(testing::Message() << sa.name << ' ' << sb.name << " pair " << k);
    const ContactResult r = solve_cso(a, b, 1e-9);
    ASSERT_TRUE(std::isfinite(r.gap) && r.normal.allFinite() && r.point_a.allFinite() &&
                r.point_b.allFinite());
    EXPECT_NEAR(r.normal.norm(), 1, 1e-12);
    EXPECT_LT(r.iterations, 1000);
    EXPECT_LE(r.lower, r.gap);
    EXPECT_GE(r.upper, r.gap);
    const double p = find_support(sa, a.q.conjugate() * r.normal).h +
                     find_support(sb, b.q.conjugate() * -r.normal).h - r.normal.dot(b.x);
    EXPECT_NEAR(r.gap, -p, 1e-9);  // the gap reported is the one along the normal reported
    if (r.status == Status::converged) {
      EXPECT_LT((r.point_b - r.point_a - r.gap * r.normal).norm(), 1e-6);
    }
  }
}

}  // namespace
}  // namespace nurbs::test_cso

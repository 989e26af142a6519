// Rotation of a free rigid body: the closed form against an independent integration, the schemes against the
// closed form, and the cases where formulas degenerate.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <vector>

#include "motion/free_rotor.h"
#include "motion/rotation.h"
#include "support/random.h"

namespace nurbs::test_rotation {
namespace {

using test::Random;

constexpr RotationScheme kSchemes[] = {RotationScheme::symplectic, RotationScheme::richardson,
                                       RotationScheme::exact};
const Vec3 kTop(1, 2, 3);
const double kEps = std::numeric_limits<double>::epsilon();

// Principal moments a solid can have: each below the sum of the other two.
Vec3 random_inertia(Random& random) {
  const Vec3 m = random.box(0.05, 2);
  return {m[1] + m[2], m[2] + m[0], m[0] + m[1]};
}

// Angle between two orientations; first order in the error, so good to round-off.
double angle_between(const Quat& a, const Quat& b) {
  return 2 * (a.conjugate() * b).vec().norm();
}

// Independent reference: dq/dt = q omega / 2 by Gragg's extrapolation of the modified midpoint rule (order
// 16), in extended precision because the motions near the separatrix magnify round-off.
using LongVec3 = Eigen::Matrix<long double, 3, 1>;
using LongVec4 = Eigen::Matrix<long double, 4, 1>;
using LongQuat = Eigen::Quaternion<long double>;

LongVec4 quaternion_rate(const LongVec4& coeffs, const LongVec3& inertia, const LongVec3& l_lab) {
  LongQuat q, spin;
  q.coeffs() = coeffs;
  spin.w() = 0;
  spin.vec() = 0.5L * LongVec3((q.conjugate() * l_lab).cwiseQuotient(inertia));
  return (q * spin).coeffs();
}

LongVec4 modified_midpoint(const LongVec4& start, const LongVec3& inertia, const LongVec3& l_lab,
                           long double t, int substeps) {
  LongVec4 before = start, now = start + t * quaternion_rate(start, inertia, l_lab);
  for (int i = 1; i < substeps; ++i) {
    const LongVec4 after = before + 2 * t * quaternion_rate(now, inertia, l_lab);
    before = now;
    now = after;
  }
  return 0.5L * (now + before + t * quaternion_rate(now, inertia, l_lab));
}

Quat integrate_reference(const Vec3& inertia_in, const Vec3& l_in, const Quat& start, double time,
                         int steps) {
  constexpr int kRows = 8;
  const LongVec3 inertia = inertia_in.cast<long double>(), l_lab = l_in.cast<long double>();
  LongQuat q = start.cast<long double>();
  const long double h = static_cast<long double>(time) / steps;
  for (int step = 0; step < steps; ++step) {
    std::vector<LongVec4> row;
    for (int k = 0; k < kRows; ++k) {
      const int substeps = 2 * (k + 1);
      LongVec4 value = modified_midpoint(q.coeffs(), inertia, l_lab, h / substeps, substeps);
      for (int j = 1; j <= k; ++j) {
        const long double ratio = static_cast<long double>(k + 1) / (k + 1 - j);
        const LongVec4 refined = value + (value - row[j - 1]) / (ratio * ratio - 1);
        row[j - 1] = value;
        value = refined;
      }
      row.push_back(value);
    }
    q.coeffs() = row.back();
    q.normalize();
  }
  return q.cast<double>();
}

Quat advance(RotationScheme scheme, const Vec3& inertia, const Vec3& l_lab, Quat q, double time, int steps,
             const Quat& axes = Quat::Identity()) {
  for (int i = 0; i < steps; ++i) rotate_free(scheme, inertia, axes, time / steps, q, l_lab);
  return q;
}

TEST(Elliptic, MeetsKnownValues) {
  // Abramowitz & Stegun 16: m = 1/2, u = K/2, where sn = (1 + k')^-1/2, cn = sqrt(k' / (1 + k')), dn =
  // sqrt(k').
  for (double m1 : {1.0, 0.9, 0.5, 0.1, 1e-3, 1e-8, 1e-16, 1e-30}) {
    const double kc = std::sqrt(m1);
    const double k = complete_elliptic(0, m1).k;
    const JacobiElliptic half = jacobi_elliptic(k / 2, m1);
    EXPECT_NEAR(half.sn, 1 / std::sqrt(1 + kc), 4 * kEps * (1 + k)) << m1;
    EXPECT_NEAR(half.cn, std::sqrt(kc / (1 + kc)), 4 * kEps * (1 + k)) << m1;
    EXPECT_NEAR(half.dn, std::sqrt(kc), 4 * kEps * (1 + k)) << m1;
  }
  EXPECT_NEAR(complete_elliptic(0, 0.5).k, 1.8540746773013719184, 4 * kEps);
  // m = 0: Pi(-n) = pi / 2 / sqrt(1 + n).
  for (double n : {0.0, 0.3, 1.0})
    EXPECT_NEAR(complete_elliptic(n, 1).pi, M_PI_2 / std::sqrt(1 + n), 4 * kEps);
}

TEST(Elliptic, SatisfiesIdentitiesAndDerivative) {
  Random random(1);
  for (int i = 0; i < 2000; ++i) {
    const double m1 = i % 2 ? random.uniform(0, 1) : std::pow(10, random.uniform(-20, 0));
    const double u = random.uniform(-20, 20);
    const JacobiElliptic f = jacobi_elliptic(u, m1);
    EXPECT_NEAR(f.sn * f.sn + f.cn * f.cn, 1, 8 * kEps);
    EXPECT_NEAR(f.dn * f.dn, m1 + (1 - m1) * f.cn * f.cn, 100 * kEps);
    const double h = 1e-3;
    const auto sn = [&](double at) { return jacobi_elliptic(at, m1).sn; };
    const double slope = (8 * (sn(u + h) - sn(u - h)) - sn(u + 2 * h) + sn(u - 2 * h)) / (12 * h);
    EXPECT_NEAR(slope, f.cn * f.dn, 1e-11) << u << " " << m1;
  }
}

TEST(Elliptic, CompletePiIsTheQuadrature) {
  for (double m1 : {1.0, 0.7, 0.2, 0.01})
    for (double n : {0.0, 0.2, 1.0}) {
      // The integrand in the amplitude is periodic: the trapezoidal rule converges geometrically.
      double sum = 0;
      constexpr int kPoints = 2000;
      for (int i = 0; i < kPoints; ++i) {
        const double s = std::pow(std::sin(M_PI * i / kPoints), 2);
        sum += 1 / ((1 + n * s) * std::sqrt(1 - (1 - m1) * s));
      }
      EXPECT_NEAR(complete_elliptic(n, m1).pi, M_PI_2 * sum / kPoints, 1e-14);
    }
}

TEST(FreeRotor, AgreesWithIndependentIntegration) {
  Random random(2);
  for (int i = 0; i < 60; ++i) {
    const Vec3 inertia = random_inertia(random);
    const Vec3 l = random.vector();
    const Quat q0 = random.turn();
    const double turn = l.norm() / inertia.minCoeff();  // fastest rate
    const double time = (i % 2 ? 1 : -1) * 20 / turn;
    const Quat reference = integrate_reference(inertia, l, q0, time, 100);
    Quat once = q0;
    advance_free_rotor(inertia, time, once, l);
    EXPECT_LT(angle_between(once, reference), 1e-12) << i;
    EXPECT_LT(angle_between(advance(RotationScheme::exact, inertia, l, q0, time, 37), reference), 1e-12) << i;
  }
}

TEST(FreeRotor, DzhanibekovOverManyPeriods) {
  const Quat q0 = Quat(0.6, -0.3, 0.5, 0.55).normalized();
  const Vec3 l = q0 * Vec3(0.1, 2, 0.2);
  const double period = free_rotor_period(kTop, q0.conjugate() * l);
  const double time = 20 * period;
  ASSERT_GT(time, 300);  // flips forty times in some 50 turns
  const Quat reference = integrate_reference(kTop, l, q0, time, 3000);
  Quat once = q0;
  advance_free_rotor(kTop, time, once, l);
  EXPECT_LT(angle_between(once, reference), 1e-11);
  // Each of 20,000 steps rounds the attitude, and forty passes near the separatrix magnify that a few hundred
  // times over: the last digits depend on how the compiler orders the sums.
  EXPECT_LT(angle_between(advance(RotationScheme::exact, kTop, l, q0, time, 20000), reference), 1e-9);
}

TEST(FreeRotor, FlipsAndComesBackAfterThePeriod) {
  const Vec3 l(1e-3, 2, 2e-3);
  const double period = free_rotor_period(kTop, l);
  Quat q = Quat::Identity();
  advance_free_rotor(kTop, period / 2, q, l);
  EXPECT_NEAR((q.conjugate() * l)[1], -2, 1e-5);
  advance_free_rotor(kTop, period / 2, q, l);
  EXPECT_LT((q.conjugate() * l - l).norm(), 1e-12);
}

// Half a flip of the Dzhanibekov top. (Whole periods end where Richardson's leading error term has
// cancelled.)
double slope_of_error(RotationScheme scheme) {
  const Quat q0 = Quat(0.6, -0.3, 0.5, 0.55).normalized();
  const Vec3 l = q0 * Vec3(0.1, 2, 0.2);
  const double time = 0.3 * free_rotor_period(kTop, q0.conjugate() * l);
  Quat exact = q0;
  advance_free_rotor(kTop, time, exact, l);
  const double coarse = angle_between(advance(scheme, kTop, l, q0, time, 1000), exact);
  const double fine = angle_between(advance(scheme, kTop, l, q0, time, 8000), exact);
  std::printf("error at %g time units a step %.3e, at an eighth of it %.3e\n", time / 1000, coarse, fine);
  EXPECT_LT(fine, 1e-5);
  return std::log(coarse / fine) / std::log(8);
}

TEST(Schemes, SymplecticIsSecondOrder) {
  EXPECT_NEAR(slope_of_error(RotationScheme::symplectic), 2, 0.05);
}
TEST(Schemes, RichardsonIsSecondOrder) {
  EXPECT_NEAR(slope_of_error(RotationScheme::richardson), 2, 0.05);
}

// Rotation about one axis at `rate`, `radians` in all, against the rotation matrix.
void expect_steady(RotationScheme scheme, const Vec3& inertia, const Quat& axes, const Quat& q0,
                   const Vec3& axis, double moment, double radians, double tolerance) {
  const double rate = 1.7;
  const Vec3 l = rate * moment * axis;
  Quat q = q0;
  for (int i = 0; i < 200; ++i) rotate_free(scheme, inertia, axes, radians / rate / 200, q, l);
  EXPECT_LT(angle_between(q, Quat(Eigen::AngleAxisd(radians, axis)) * q0), tolerance)
      << "scheme " << static_cast<int>(scheme) << " inertia " << inertia.transpose() << " moment " << moment;
}

TEST(Schemes, AreExactForSpheres) {
  Random random(3);
  for (RotationScheme scheme : kSchemes)
    for (int i = 0; i < 20; ++i) {
      const double moment = random.uniform(0.1, 2);
      const Vec3 axis = random.direction();
      expect_steady(scheme, Vec3::Constant(moment), random.turn(), random.turn(), axis, moment, 50, 1e-12);
    }
}

TEST(Schemes, AreExactAboutPrincipalAxes) {
  Random random(4);
  const Vec3 orders[] = {{1, 2, 2.5}, {2, 1, 2.5}, {2.5, 2, 1}, {2.5, 1, 2}};
  for (RotationScheme scheme : kSchemes)
    for (const Vec3& inertia : orders)
      for (int k = 0; k < 3; ++k) {
        const Quat axes = random.turn(), q0 = random.turn();
        // About the intermediate axis round-off grows exponentially: fewer radians.
        const double radians = inertia[k] == 2 ? 5 : 50;
        expect_steady(scheme, inertia, axes, q0, q0 * (axes * Vec3::Unit(k).eval()), inertia[k], radians,
                      1e-12);
      }
}

// A symmetric top precesses about l at |l| / I while it spins about its own axis at (1/J - 1/I) l3.
Quat symmetric_top(double across, double along, int axis, const Vec3& l, const Quat& q0, double time) {
  const double l3 = (q0.conjugate() * l)[axis];
  return Quat(Eigen::AngleAxisd(l.norm() / across * time, l.normalized())) * q0 *
         Quat(Eigen::AngleAxisd((1 / along - 1 / across) * l3 * time, Vec3::Unit(axis)));
}

TEST(Schemes, SymplecticAndExactAreExactForSymmetricTops) {
  Random random(4);
  for (RotationScheme scheme : {RotationScheme::symplectic, RotationScheme::exact})
    for (double ratio : {0.5, 1 - 1e-3, 1 - 1e-9, 1 - 1e-15, 1 + 1e-15, 1 + 1e-9, 1 + 1e-3, 1.9})
      for (int axis = 0; axis < 3; ++axis) {
        Vec3 inertia = Vec3::Constant(0.7);
        inertia[axis] = 0.7 * ratio;
        const Quat q0 = random.turn();
        const Vec3 l = random.vector();
        const Quat expected = symmetric_top(0.7, 0.7 * ratio, axis, l, q0, 20);
        EXPECT_LT(angle_between(advance(scheme, inertia, l, q0, 20, 100), expected), 2e-13)
            << ratio << " " << axis;
      }
}

TEST(Schemes, NearlySymmetricTopsFollowTheIndependentIntegration) {
  Random random(5);
  for (double split : {1e-2, 1e-4, 1e-8, 1e-12, 1e-15})
    for (int odd = 0; odd < 3; ++odd) {
      Vec3 inertia(1, 1 + split, 1 - 0.3 * split);
      inertia[odd] *= 1.5;
      const Quat q0 = random.turn();
      const Vec3 l = random.vector();
      const Quat reference = integrate_reference(inertia, l, q0, 15, 60);
      EXPECT_LT(angle_between(advance(RotationScheme::exact, inertia, l, q0, 15, 10), reference), 1e-12)
          << split;
    }
}

// Angular momenta on and beside every singular set: rest, the axes, the planes between them, the separatrix.
TEST(Schemes, NeverFailOnSingularMotions) {
  const double tiny[] = {0, 1e-300, 1e-160, 1e-30, 1e-17, 1e-12, 1e-8, 1};
  const Vec3 bodies[] = {{1, 2, 3},
                         {3, 1, 2},
                         {2, 2, 3},
                         {1, 2, 2},
                         {2, 3, 2},
                         {1, 1, 1},
                         {1e-20, 2e-20, 2.5e-20},
                         {1, 1 + 1e-15, 1 + 2e-15}};
  for (const Vec3& inertia : bodies)
    for (double x : tiny)
      for (double y : tiny)
        for (double z : tiny)
          for (RotationScheme scheme : kSchemes) {
            const Vec3 l = Vec3(x, -y, z) * inertia.maxCoeff();
            const Vec3 start = l.cwiseQuotient(inertia);
            for (double dt : {1e-7, 0.3, -5.0, 1000.0}) {
              Quat q = Quat(0.1, 0.7, -0.1, 0.7).normalized();
              const Vec3 l_lab = q * l;
              rotate_free(scheme, inertia, Quat::Identity(), dt, q, l_lab);
              ASSERT_TRUE(q.coeffs().allFinite()) << l.transpose() << " " << dt;
              ASSERT_NEAR(q.norm(), 1, 4 * kEps);
              if (scheme != RotationScheme::exact) continue;
              const Vec3 end = (q.conjugate() * l_lab).cwiseQuotient(inertia);
              ASSERT_NEAR(end.dot(inertia.cwiseProduct(end)), start.dot(inertia.cwiseProduct(start)),
                          1e-12 * inertia.maxCoeff() * start.squaredNorm())
                  << inertia.transpose() << " l " << l.transpose() << " dt " << dt;
            }
          }
}

TEST(FreeRotor, SeparatrixIsTheHyperbolicSolution) {
  // 2 E I2 = l^2: l1 and l3 = c sech, l2 = l tanh.
  const Vec3 inverse = kTop.cwiseInverse();
  const double alpha = inverse[1] - inverse[2], beta = inverse[0] - inverse[2],
               gamma = inverse[0] - inverse[1];
  const double length = 1.7;
  const Vec3 l0(length * std::sqrt(alpha / beta), 0, length * std::sqrt(gamma / beta));
  const double rate = length * std::sqrt(alpha * gamma);
  for (double t : {0.1, 1.0, -3.0, 5.0}) {
    Quat q = Quat::Identity();
    advance_free_rotor(kTop, t, q, l0);
    const Vec3 l = q.conjugate() * l0;
    const double sech = 1 / std::cosh(rate * t);
    EXPECT_LT((l - Vec3(l0[0] * sech, length * std::tanh(rate * t), l0[2] * sech)).norm(), 1e-13) << t;
  }
}

TEST(Schemes, AreTimeReversible) {
  Random random(6);
  for (int i = 0; i < 50; ++i) {
    const Vec3 inertia = random_inertia(random), l = random.vector();
    const Quat axes = random.turn(), q0 = random.turn();
    for (RotationScheme scheme : {RotationScheme::symplectic, RotationScheme::exact}) {
      const double time = 5 * inertia.minCoeff() / l.norm();
      Quat q = advance(scheme, inertia, l, q0, time, 100, axes);
      q = advance(scheme, inertia, l, q, -time, 100, axes);
      EXPECT_LT(angle_between(q, q0), 1e-12);
    }
  }
}

TEST(Schemes, EnergyIsConserved) {
  const Quat q0 = Quat::Identity();
  const Vec3 l(0.02, 2, 0.03);
  const auto energy = [&](const Quat& q) { return rotational_energy(l, q, Quat::Identity(), kTop); };
  const double start = energy(q0);
  const auto worst_error = [&](RotationScheme scheme, int steps, double dt) {
    Quat q = q0;
    double worst = 0;
    for (int i = 0; i < steps; ++i) {
      rotate_free(scheme, kTop, Quat::Identity(), dt, q, l);
      worst = std::max(worst, std::abs(energy(q) - start) / start);
    }
    return worst;
  };
  EXPECT_LT(worst_error(RotationScheme::exact, 100000, 0.05), 1e-12);
  // Symplectic: bounded, does not grow with time, falls as dt^2.
  const double early = worst_error(RotationScheme::symplectic, 5000, 0.05);
  EXPECT_LT(worst_error(RotationScheme::symplectic, 100000, 0.05), 1.2 * early);
  EXPECT_NEAR(early / worst_error(RotationScheme::symplectic, 20000, 0.0125), 16, 1.5);
}

TEST(Schemes, MomentumVelocityAndFramesAgree) {
  Random random(7);
  for (int i = 0; i < 50; ++i) {
    const Vec3 inertia = random_inertia(random), l = random.vector();
    const Quat axes = random.turn(), q = random.turn();
    const Mat3 turn = (q * axes).toRotationMatrix();
    const Mat3 tensor = turn * inertia.asDiagonal() * turn.transpose();
    const Vec3 omega = angular_velocity(l, q, axes, inertia);
    EXPECT_LT((tensor * omega - l).norm(), 1e-14 * l.norm() * 10);
    EXPECT_LT((angular_momentum(omega, q, axes, inertia) - l).norm(), 1e-14 * l.norm());
    EXPECT_NEAR(rotational_energy(l, q, axes, inertia), 0.5 * omega.dot(l), 1e-14 * omega.norm() * l.norm());
    // The drift's rate is omega, whatever the principal axes.
    for (RotationScheme scheme : kSchemes) {
      const double dt = 1e-5 / omega.norm();
      Quat ahead = q, behind = q;
      rotate_free(scheme, inertia, axes, dt, ahead, l);
      rotate_free(scheme, inertia, axes, -dt, behind, l);
      const Vec3 rate = (ahead * behind.conjugate()).vec() / dt;
      EXPECT_LT((rate - omega).norm(), 1e-8 * omega.norm());
    }
  }
}

}  // namespace
}  // namespace nurbs::test_rotation

// Bodies turned side by side (motion/rotor.h): the series, the length of the quaternion over many steps,
// equal moments, lanes; and the splitting against the same written out with sines.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>

#include "motion/rotation.h"
#include "motion/rotor.h"
#include "motion/rotor_kernel.h"

namespace nurbs::test_rotor {
namespace {

const double kEps = std::numeric_limits<double>::epsilon();
const Vec3 kSphere(0.4, 0.4, 0.4), kTop(0.4, 1, 1), kAsymmetric(0.65, 1, 1.25);

class Random {
 public:
  explicit Random(unsigned seed) : engine_(seed) {}
  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  Vec3 vector() { return {normal_(engine_), normal_(engine_), normal_(engine_)}; }
  Quat rotation() {
    return Quat(normal_(engine_), normal_(engine_), normal_(engine_), normal_(engine_)).normalized();
  }
  RotorBatch batch() {
    RotorBatch batch;
    for (int lane = 0; lane < RotorBatch::kBodies; ++lane) {
      batch.set_q(lane, rotation());
      batch.set_momentum(lane, vector());
      batch.inverse_size[lane] = uniform(0.2, 2);
    }
    return batch;
  }

 private:
  std::mt19937_64 engine_;
  std::normal_distribution<double> normal_;
};

template <class Lane>
void check_half_turn(double x) {
  const double square = x * x;
  Lane all;
  for (size_t k = 0; k < sizeof(Lane) / sizeof(double); ++k) all[k] = 0.01;
  all[1] = square;
  HalfTurn<Lane> got;
  half_turn(all, &got);
  // The angle that the rounded square stands for. Its own rounding is the caller's affair.
  const long double angle = std::sqrt(static_cast<long double>(square));
  const long double cosine = std::cos(angle), sinc = angle == 0 ? 1 : std::sin(angle) / angle;
  const double rounding = kEps * (1 + (x < 0.5 ? 0 : x));  // sqrt rounds the angle
  ASSERT_NEAR(static_cast<double>(got.cosine[1] - cosine), 0, rounding) << x;
  ASSERT_NEAR(static_cast<double>(got.sinc[1] - sinc), 0, rounding / std::max(1.0, x)) << x;
  ASSERT_NEAR(got.cosine[1] * got.cosine[1] + square * got.sinc[1] * got.sinc[1], 1, 4 * rounding) << x;
}

TEST(HalfTurn, IsGoodToAnUlpAtAllAngles) {
  Random random(1);
  for (int i = 0; i < 200000; ++i) {
    check_half_turn<Lane4>(random.uniform(0, 0.6));
    check_half_turn<Lane8>(std::pow(10, random.uniform(-20, 3)));
  }
  for (double x : {0.0, 1e-300, std::nextafter(0.5, 0), 0.5, std::nextafter(0.5, 1), M_PI_2, M_PI, 1e8})
    check_half_turn<Lane4>(x);
}

TEST(HalfTurn, PassesOnWhatIsNoNumber) {
  Lane4 square{std::nan(""), std::numeric_limits<double>::infinity(), 0, 0.1};
  HalfTurn<Lane4> got;
  half_turn(square, &got);
  EXPECT_TRUE(std::isnan(got.cosine[0]) && std::isnan(got.cosine[1]));
  EXPECT_EQ(got.cosine[2], 1);
  EXPECT_NEAR(got.cosine[3], std::cos(std::sqrt(0.1)), kEps);
}

TEST(Rotor, OrdersTheAxesAndFindsEqualMoments) {
  using Kind = Rotor::Kind;
  EXPECT_EQ(make_rotor(kSphere, Quat::Identity()).kind, Kind::sphere);
  EXPECT_EQ(make_rotor(kSphere + Vec3(0, 4e-16, -4e-16), Quat::Identity()).kind, Kind::sphere);
  EXPECT_EQ(make_rotor(Vec3(1, 1, 1 + 1e-9), Quat::Identity()).kind, Kind::top);
  EXPECT_EQ(make_rotor(Vec3(1 - 1e-9, 1, 1 + 1e-9), Quat::Identity()).kind, Kind::asymmetric);
  Random random(2);
  for (const Vec3& moments : {kTop, kAsymmetric})
    for (int shift = 0; shift < 6; ++shift) {
      Vec3 m(moments[shift % 3], moments[(shift + 1) % 3], moments[(shift + 2) % 3]);
      if (shift > 2) std::swap(m[0], m[1]);
      const Quat axes = random.rotation();
      const Rotor rotor = make_rotor(m, axes);
      EXPECT_EQ(rotor.middle, 1);
      EXPECT_EQ(rotor.kind == Kind::top, rotor.first == 0);
      EXPECT_NEAR(rotor.axes.determinant(), 1, 8 * kEps);
      // The tensor of inverse moments, both ways.
      const Vec3 inverse = Vec3(rotor.first, rotor.second, 0) + Vec3::Constant(rotor.middle);
      const Mat3 turn = axes.toRotationMatrix();
      EXPECT_LT((rotor.axes * inverse.asDiagonal() * rotor.axes.transpose() -
                 turn * m.cwiseInverse().asDiagonal() * turn.transpose())
                    .norm(),
                1e-14);
    }
}

// The splitting as Fasso's paper has it, one axis after the other.
Quat split_step(const Vec3& moments, const Quat& axes, double dt, const Quat& q, const Vec3& l, int middle) {
  Quat p = q * axes;
  const auto turn = [&](int axis, double time) {
    const double angle = (1 / moments[axis] - 1 / moments[middle]) * (p.conjugate() * l)[axis] * time;
    p = p * Quat(Eigen::AngleAxisd(angle, Vec3::Unit(axis)));
  };
  const int first = (middle + 1) % 3, second = (middle + 2) % 3;
  turn(first, 0.5 * dt);
  turn(second, dt);
  turn(first, 0.5 * dt);
  return Quat(Eigen::AngleAxisd(l.norm() / moments[middle] * dt, l.normalized())) * p * axes.conjugate();
}

TEST(Rotor, StepsAreThoseOfTheSplitting) {
  Random random(3);
  for (const Vec3& moments : {kSphere, kTop, kAsymmetric})
    for (double dt : {1e-6, 1e-3, 0.1, 1.0, 30.0}) {
      const Quat axes = random.rotation();
      const Rotor rotor = make_rotor(moments, axes);
      RotorBatch batch = random.batch();
      const RotorBatch start = batch;
      drift(rotor, dt, &batch);
      for (int lane = 0; lane < RotorBatch::kBodies; ++lane) {
        const Vec3 l(start.momentum[0][lane], start.momentum[1][lane], start.momentum[2][lane]);
        const Vec3 inertia = moments / start.inverse_size[lane];
        const Quat expected = split_step(inertia, axes, dt, start.get_q(lane), l, 1), got = batch.get_q(lane);
        const double radians = l.norm() * start.inverse_size[lane] * dt / moments.minCoeff();
        EXPECT_LT((expected.conjugate() * got).vec().norm(), 8 * kEps * (1 + radians) * (1 + radians))
            << moments.transpose() << " dt " << dt;
        EXPECT_NEAR(got.norm(), 1, 2 * kEps);
        const Vec3 velocity = angular_velocity(l, got, axes, inertia);
        EXPECT_LT((batch.get_velocity(lane) - velocity).norm(), 16 * kEps * (1 + radians) * velocity.norm());
      }
      find_angular_velocity(rotor, &batch);
      for (int lane = 0; lane < RotorBatch::kBodies; ++lane) {
        const Vec3 l(start.momentum[0][lane], start.momentum[1][lane], start.momentum[2][lane]);
        const Vec3 velocity =
            angular_velocity(l, batch.get_q(lane), axes, moments / start.inverse_size[lane]);
        EXPECT_LT((batch.get_velocity(lane) - velocity).norm(), 16 * kEps * velocity.norm());
      }
    }
}

// Of each rotor kernel, the bits must not tell which lane of how wide a register did the work, nor what the
// other lanes were doing (one of them may turn so far that it needs the library's sines).
template <class Lane>
void drift_by(const Rotor& rotor, double dt, RotorBatch* batch) {
  for (size_t lane = 0; lane < RotorBatch::kBodies; lane += sizeof(Lane) / sizeof(double))
    rotor_kernel::drift<Lane>(rotor, dt, batch, static_cast<int>(lane));
}

bool same_bits(const RotorBatch& a, const RotorBatch& b) {
  return std::memcmp(a.q, b.q, sizeof a.q) == 0 &&
         std::memcmp(a.velocity, b.velocity, sizeof a.velocity) == 0;
}

TEST(Rotor, BitsDoNotDependOnLaneNeighbourOrWidth) {
  Random random(4);
  for (const Vec3& moments : {kSphere, kTop, kAsymmetric})
    for (int i = 0; i < 200; ++i) {
      const Rotor rotor = make_rotor(moments, random.rotation());
      const double dt = std::pow(10, random.uniform(-5, 0.5));
      RotorBatch wide = random.batch();
      RotorBatch narrow = wide, host = wide;
      const RotorBatch start = wide;
      drift_by<Lane8>(rotor, dt, &wide);
      drift_by<Lane2>(rotor, dt, &narrow);
      drift(rotor, dt, &host);
      ASSERT_TRUE(same_bits(wide, narrow) && same_bits(wide, host));

      RotorBatch alone;
      alone.set_momentum(3, Vec3::Constant(1e3));
      alone.set_q(6, start.get_q(0));
      for (int k = 0; k < 3; ++k) alone.momentum[k][6] = start.momentum[k][0];
      alone.inverse_size[6] = start.inverse_size[0];
      drift(rotor, dt, &alone);
      ASSERT_EQ(alone.get_q(6).coeffs(), wide.get_q(0).coeffs());
      ASSERT_EQ(alone.get_velocity(6), wide.get_velocity(0));
    }
}

// Without a correction the lengths walk away from 1, by 3e-13 in so many steps if their errors are random,
// and by more where a body turns by the same angle every step.
#ifdef __SANITIZE_ADDRESS__
constexpr int kManySteps = 100000;
#else
constexpr int kManySteps = 10000000;
#endif

TEST(Rotor, QuaternionStaysUnitOverManySteps) {
  Random random(5);
  for (const Vec3& moments : {kSphere, kTop, kAsymmetric}) {
    const Rotor rotor = make_rotor(moments, random.rotation());
    RotorBatch batch = random.batch();
    double worst = 0;
    for (int step = 0; step < kManySteps; ++step) {
      drift(rotor, 1e-3, &batch);
      if (step % 100 != 0) continue;
      for (int lane = 0; lane < RotorBatch::kBodies; ++lane)
        worst = std::max(worst, std::abs(batch.get_q(lane).norm() - 1));
    }
    EXPECT_LE(worst, 2 * kEps) << moments.transpose();
  }
}

TEST(Rotor, MakesAQuaternionUnitThatIsNot) {
  Random random(6);
  for (double length : {1e-3, 0.9, 1 - 1e-7, 1 + 1e-10, 1.1, 1e3}) {
    RotorBatch batch = random.batch();
    for (int k = 0; k < 4; ++k) batch.q[k][5] *= length;
    drift(make_rotor(kSphere, Quat::Identity()), 1e-3, &batch);
    EXPECT_NEAR(batch.get_q(5).norm(), 1, 2 * kEps) << length;
  }
}

}  // namespace
}  // namespace nurbs::test_rotor

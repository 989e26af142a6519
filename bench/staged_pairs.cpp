#include "bench/staged_pairs.h"

namespace nurbs::bench {
namespace {

constexpr double kStep = 1e-5;  // of time; nothing depends on it

}  // namespace

StagedPairs::StagedPairs(const std::vector<std::vector<test::Pair>>& paths, int copies)
    : paths_(paths), shapes_{paths[0][0].a.shape} {
  const std::size_t count = paths.size() * copies, bodies = 2 * count;
  x_.resize(3 * bodies);
  q_.resize(4 * bodies);
  zeros_.resize(3 * bodies);
  ones_.assign(bodies, 1);
  scale_.resize(bodies);
  radius_.resize(bodies);
  shape_.assign(bodies, 0);
  mask_.assign(bodies, 1);
  proofs_.assign(count, PairProof{});
}

void StagedPairs::place(int i) {
  for (std::size_t k = 0; k < proofs_.size(); ++k) {
    const test::Pair& pair = paths_[k % paths_.size()][i];
    const Particle* of[] = {&pair.a, &pair.b};
    for (int side = 0; side < 2; ++side) {
      const std::size_t n = 2 * k + side;
      const Particle& p = *of[side];
      Vec3::Map(&x_[3 * n]) = p.x - pair.a.x;
      const double turn[] = {p.q.w(), p.q.x(), p.q.y(), p.q.z()};
      std::copy(turn, turn + 4, &q_[4 * n]);
      scale_[n] = p.scale;
      radius_[n] = p.scale * p.shape->bounding_radius;
    }
  }
  BodyArrays arrays;
  arrays.count = static_cast<int>(ones_.size());
  arrays.x = x_.data();
  arrays.velocity = arrays.spin = zeros_.data();
  arrays.quaternion = q_.data();
  arrays.mass = ones_.data();
  arrays.scale = scale_.data();
  arrays.radius = radius_.data();
  arrays.shape = shape_.data();
  arrays.shapes = shapes_.data();
  arrays.mask = mask_.data();
  bodies_.update(arrays, kStep, !begun_);
  if (begun_) return;
  begun_ = true;
  stages_.begin_neighbours();
  for (std::size_t k = 0; k < proofs_.size(); ++k)
    stages_.add_neighbour(static_cast<int>(2 * k), static_cast<int>(2 * k + 1), &proofs_[k]);
  stages_.end_neighbours();
}

void StagedPairs::compute() {
  ContactStages::Step step;
  step.bodies = &bodies_;
  step.owned = bodies_.count();
  step.dt = kStep;
  step.settings.reach = 0;
  step.laws = &law_;
  stages_.compute(step);
}

}  // namespace nurbs::bench

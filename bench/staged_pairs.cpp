#include "bench/staged_pairs.h"

namespace nurbs::bench {
namespace {

constexpr double kStep = 1e-5;  // of time; nothing depends on it

}  // namespace

StagedPairs::StagedPairs(const std::vector<std::vector<test::Pair>>& paths, int copies) : paths_(paths) {
  proofs_.assign(paths.size() * copies, PairProof{});
  held_.shapes = {paths[0][0].a.shape};
  held_.resize(2 * proofs_.size());
}

void StagedPairs::place(int i) {
  for (std::size_t k = 0; k < proofs_.size(); ++k) {
    const test::Pair& pair = paths_[k % paths_.size()][i];
    held_.place(2 * k, Vec3::Zero(), pair.a);
    held_.place(2 * k + 1, pair.b.x - pair.a.x, pair.b);
  }
  bodies_.update(held_.arrays(), kStep, !begun_);
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

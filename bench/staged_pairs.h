// Many pairs through the stages of a time step, far from each other: what a neighbour or a contact with its
// law costs there.
#pragma once

#include <vector>

#include "scene/contact_stages.h"
#include "support/host_bodies.h"
#include "support/pairs.h"

namespace nurbs::bench {

class StagedPairs {
 public:
  // paths[k][i] is pair k at step i; every pair is there `copies` times.
  StagedPairs(const std::vector<std::vector<test::Pair>>& paths, int copies);
  // All pairs at step i of their paths; the first call begins their contacts.
  void place(int i);
  void compute();  // the stages, the law included
  int pairs() const { return static_cast<int>(proofs_.size()); }
  const ContactCounts& counts() const { return stages_.counts(); }

 private:
  const std::vector<std::vector<test::Pair>>& paths_;
  test::HostBodies held_;
  std::vector<PairProof> proofs_;
  ContactCoefficients law_{1e3, 8e2, 0.1, 0.1, 0.4};
  Bodies bodies_;
  ContactStages stages_;
  bool begun_ = false;
};

}  // namespace nurbs::bench

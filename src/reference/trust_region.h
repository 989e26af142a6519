// Trust-region Newton for a handful of variables (Nocedal & Wright, Numerical Optimization, 2nd ed., chapter
// 4): the exact subproblem by eigen-decomposition, and the rule that grows and shrinks the region.
#pragma once

#include <Eigen/Core>

namespace nurbs {

template <int N>
struct TrustRegionStep {
  Eigen::Matrix<double, N, 1> step = Eigen::Matrix<double, N, 1>::Zero();
  double predicted = 0;      // reduction of the quadratic model, >= 0
  bool on_boundary = false;  // |step| = radius
};

// Minimises gradient . s + s . hessian s / 2 over |s| <= radius, globally (Nocedal & Wright theorem 4.1, with
// the hard case of their section 4.3). The (symmetric) Hessian may be indefinite or singular. Returns a zero
// step with zero predicted reduction when an input is not finite. No allocation. Instantiated for N = 2
// and 4.
template <int N>
TrustRegionStep<N> solve_trust_region(const Eigen::Matrix<double, N, 1>& gradient,
                                      const Eigen::Matrix<double, N, N>& hessian, double radius);

// The radius, and what to do with it after a trial step (Nocedal & Wright algorithm 4.1).
struct TrustRegion {
  double radius;
  double max_radius;

  // Updates the radius from the actual and predicted reduction of the objective; true when the step is to be
  // taken. A predicted reduction at or below `noise`, the round-off of the objective, is taken on trust only
  // if the actual one stays within noise: there the ratio of the two says nothing.
  bool accept(double actual, double predicted, bool on_boundary, double step_length, double noise);
};

}  // namespace nurbs

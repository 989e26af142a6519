// See gauss_rule.h.
#include "nurbs/gauss_rule.h"

#include <cmath>

namespace nurbs {

// Roots of the Legendre polynomial P_n by Newton from Chebyshev-like starts (Press et al., Numerical
// Recipes, 4.6).
GaussRule gauss_rule(int n) {
  GaussRule rule;
  rule.nodes.resize(n);
  rule.weights.resize(n);
  for (int i = 0; i < n; ++i) {
    double x = std::cos(M_PI * (i + 0.75) / (n + 0.5)), derivative = 1;
    for (int step = 0; step < 50; ++step) {
      double p = 1, before = 0;
      for (int k = 1; k <= n; ++k) {
        const double next = ((2 * k - 1) * x * p - (k - 1) * before) / k;
        before = p;
        p = next;
      }
      derivative = n * (x * p - before) / (x * x - 1);
      const double change = p / derivative;
      x -= change;
      if (std::abs(change) < 1e-15) break;
    }
    rule.nodes[i] = 0.5 * (1 - x);
    rule.weights[i] = 1 / ((1 - x * x) * derivative * derivative);
  }
  return rule;
}

}  // namespace nurbs

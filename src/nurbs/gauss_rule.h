// Gauss-Legendre quadrature.
#pragma once

#include <vector>

namespace nurbs {

struct GaussRule {
  std::vector<double> nodes, weights;  // on [0, 1]
};

// The rule of n points, exact for polynomials of degree 2 n - 1.
GaussRule gauss_rule(int n);

}  // namespace nurbs

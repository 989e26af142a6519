// Rigorous bounds of a body's distance from the origin, from control nets.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "nurbs/bernstein.h"
#include "nurbs/bezier_patch.h"

namespace nurbs {

// Calls visit(at, c, a, b) for all pairs of a patch's control points: a term of theirs is c times it in
// coefficient `at`, v fastest, of their product, which is to be divided by product_weight (NURBS Book,
// section 6.3: C(p,i) C(p,k) / C(2p,i+k)).
template <class Visit>
void visit_products(const BezierPatch& patch, const Visit& visit) {
  const int p = patch.degree_u, q = patch.degree_v;
  std::array<double, kMaxDegree + 1> cp, cq;
  for (int i = 0; i <= p; ++i) cp[i] = binomial(p, i);
  for (int j = 0; j <= q; ++j) cq[j] = binomial(q, j);
  for (int i = 0; i <= p; ++i)
    for (int j = 0; j <= q; ++j)
      for (int k = 0; k <= p; ++k)
        for (int l = 0; l <= q; ++l)
          visit(static_cast<std::size_t>(i + k) * (2 * q + 1) + (j + l), cp[i] * cp[k] * cq[j] * cq[l],
                patch.point(i, j), patch.point(k, l));
}
// Of coefficient `at`, degrees m and n.
inline double product_weight(int m, int n, std::size_t at) {
  const int i = static_cast<int>(at) / (n + 1), j = static_cast<int>(at) % (n + 1);
  return binomial(m, i) * binomial(n, j);
}

// (|x|^2 - less) w^2 and w^2 of a patch, Bernstein coefficients of twice its degrees, (i, j) at i (n + 1) +
// j.
struct SquaredDistance {
  int m = 0, n = 0;
  std::vector<double> num, den;
};
SquaredDistance squared_distance(const BezierPatch& patch, double less = 0);
// ||x|^2 - 1| is at most this on a patch.
double bound_off_unit_sphere(const BezierPatch& patch);
// Whether 1 - |x|^2 is proven to be at most `slack` on a patch, by halving; false where that takes too long.
bool lies_outside_unit_ball(const BezierPatch& patch, double slack);

// Unit normal of the plane nearest to a bilinear patch, along S_u x S_v: in the middle or at a corner, as a
// needle's long sides are all but parallel, of which round-off leaves little.
Vec3 bilinear_normal(const BezierPatch& patch);

struct RadiusBounds {
  double inner = 0;  // no surface point is nearer to the origin
  double outer = 0;  // none is farther
};

// Least and largest |x| over the patches, each rounded to the safe side: the Bernstein coefficients of |w
// x|^2 and w^2 bound their ratio over a patch, and the patch with the worst bound is halved until the bound
// and an actual surface point differ by less than 1e-6 (or a cap is reached: the bound is then safe but
// looser). For a sphere the coefficients are constant and the bounds equal the radius to round-off. About 1
// to 10 ms.
RadiusBounds bound_radius(const std::vector<BezierPatch>& patches);

}  // namespace nurbs

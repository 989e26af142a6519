// One rational Bezier patch and its evaluation: the kernel that every contact search spends its time in.
#pragma once

#include <vector>

#include "nurbs/jet_lanes.h"
#include "nurbs/types.h"

namespace nurbs {

constexpr int kMaxDegree = 9;

// Control net of a (rational) Bezier patch over [0,1]^2.
struct BezierPatch {
  int degree_u = 0, degree_v = 0;
  bool rational = true;  // false: every weight is 1 and the quotient rule is skipped
  std::vector<Vec4>
      points;  // homogeneous (w x, w y, w z, w), v fastest, (degree_u + 1) (degree_v + 1) of them

  const Vec4& point(int i, int j) const { return points[static_cast<size_t>(i) * (degree_v + 1) + j]; }
  Vec4& point(int i, int j) { return points[static_cast<size_t>(i) * (degree_v + 1) + j]; }
};
template <class Archive>
void archive(Archive& a, BezierPatch& s) {
  auto& [degree_u, degree_v, rational, points] = s;
  a(degree_u, degree_v, rational, points);
}

// Position and partial derivatives with respect to the patch parameters.
struct Jet1 {
  Vec3 s, su, sv;
};
struct Jet2 {
  Vec3 s, su, sv, suu, suv, svv;
};
struct Jet3 {
  Vec3 s, su, sv, suu, suv, svv, suuu, suuv, suvv, svvv;
};

// Evaluation at (u, v); parameters slightly outside [0,1] extrapolate the polynomial. Relative error a few
// ulp of the largest control point. No allocation. Cost on one 2.5 GHz AVX2 core: see bench/.
Vec3 evaluate0(const BezierPatch& patch, double u, double v);
Jet1 evaluate1(const BezierPatch& patch, double u, double v);
Jet2 evaluate2(const BezierPatch& patch, double u, double v);
void evaluate2(const BezierPatch& patch, double u, double v, JetLanes* out);
Jet3 evaluate3(const BezierPatch& patch, double u, double v);

}  // namespace nurbs

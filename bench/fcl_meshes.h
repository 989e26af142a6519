// FCL behind plain doubles. Its package is built for the baseline CPU, where Eigen aligns its types less than
// with AVX: the file that includes FCL's headers must be built so too, and shares no Eigen type with the
// rest.
#pragma once

#include <memory>

namespace nurbs::bench {

struct FclPose {
  int shape;       // as add_shape returned it
  double turn[9];  // rotation matrix, rows first
  double x[3];
};

struct FclAnswer {
  bool ok = false;
  double gap = 0;
  double normal[3] = {}, point_a[3] = {}, point_b[3] = {};  // world
};

class FclMeshes {
 public:
  explicit FclMeshes(double tolerance);
  ~FclMeshes();
  int add_shape(const double* vertices, int vertex_count, const int* triangles, int triangle_count);
  FclAnswer solve(const FclPose& a, const FclPose& b);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace nurbs::bench

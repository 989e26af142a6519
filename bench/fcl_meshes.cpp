// FCL's own GJK and EPA (GST_INDEP) on convex meshes; see fcl_meshes.h.
#include "bench/fcl_meshes.h"

#include <fcl/geometry/shape/convex.h>
#include <fcl/narrowphase/detail/gjk_solver_indep.h>

#include <cmath>
#include <vector>

namespace nurbs::bench {
namespace {

fcl::Transform3d place(const FclPose& p) {
  fcl::Transform3d t = fcl::Transform3d::Identity();
  t.linear() = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(p.turn);
  t.translation() = fcl::Vector3d(p.x[0], p.x[1], p.x[2]);
  return t;
}

void store(const fcl::Vector3d& v, double* to) {
  for (int k = 0; k < 3; ++k) to[k] = v[k];
}

}  // namespace

struct FclMeshes::State {
  fcl::detail::GJKSolver_indep<double> solver;
  std::vector<fcl::ContactPoint<double>> contacts;
  std::vector<std::unique_ptr<fcl::Convex<double>>> shapes;
};

FclMeshes::FclMeshes(double tolerance) : state_(std::make_unique<State>()) {
  auto& solver = state_->solver;
  solver.gjk_tolerance = solver.epa_tolerance = tolerance;
}

FclMeshes::~FclMeshes() = default;

int FclMeshes::add_shape(const double* vertices, int vertex_count, const int* triangles, int triangle_count) {
  auto points = std::make_shared<std::vector<fcl::Vector3d>>();
  for (int i = 0; i < vertex_count; ++i)
    points->emplace_back(vertices[3 * i], vertices[3 * i + 1], vertices[3 * i + 2]);
  auto faces = std::make_shared<std::vector<int>>();
  for (int i = 0; i < triangle_count; ++i)
    faces->insert(faces->end(), {3, triangles[3 * i], triangles[3 * i + 1], triangles[3 * i + 2]});
  state_->shapes.push_back(std::make_unique<fcl::Convex<double>>(points, triangle_count, faces));
  return static_cast<int>(state_->shapes.size()) - 1;
}

FclAnswer FclMeshes::solve(const FclPose& a, const FclPose& b) {
  const auto &shape_a = *state_->shapes[a.shape], &shape_b = *state_->shapes[b.shape];
  const fcl::Transform3d place_a = place(a), place_b = place(b);
  auto& contacts = state_->contacts;
  contacts.clear();
  FclAnswer answer;
  if (state_->solver.shapeIntersect(shape_a, place_a, shape_b, place_b, &contacts)) {
    if (contacts.empty()) return answer;
    const auto& c = contacts.front();
    answer.ok = true;
    const double depth = std::abs(c.penetration_depth);  // this solver reports it negative
    answer.gap = -depth;
    store(c.normal, answer.normal);
    store(c.pos + 0.5 * depth * c.normal, answer.point_a);
    store(c.pos - 0.5 * depth * c.normal, answer.point_b);
    return answer;
  }
  fcl::Vector3d on_a, on_b;
  answer.ok = state_->solver.shapeDistance(shape_a, place_a, shape_b, place_b, &answer.gap, &on_a, &on_b);
  store((on_b - on_a).normalized(), answer.normal);
  store(on_a, answer.point_a);
  store(on_b, answer.point_b);
  return answer;
}

}  // namespace nurbs::bench

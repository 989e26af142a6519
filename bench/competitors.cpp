// The methods that the benchmarks compare; see competitors.h.
#include "bench/competitors.h"

#include <ccd/ccd.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <utility>
#include <vector>

#include "bench/bodies.h"
#include "bench/fcl_meshes.h"
#include "bench/meshes.h"
#include "body/support.h"
#include "contact/pair_search.h"
#include "shapes/primitives.h"

namespace nurbs::bench {
namespace {

constexpr int kErrorDirections = 5000;  // sampled for a model's error
constexpr int kIterationCap = 1000;     // of libccd, whose default is none at all

std::string label(const std::string& base, int count) {
  return base + "-" + std::to_string(count);
}

// Worst difference of support functions over random directions, relative.
template <class ModelSupport>
double worst_support_error(const Shape& shape, ModelSupport&& model) {
  Random random(7);
  double worst = 0;
  for (int k = 0; k < kErrorDirections; ++k) {
    const Vec3 d = random.direction();
    worst = std::max(worst, std::abs(find_hull_support(shape, d).h - model(d)));
  }
  return worst / shape.bounding_radius;
}

// --- ours, cso
// -------------------------------------------------------------------------------------------------

Answer to_answer(const ContactResult& r) {
  return {r.status != Status::unresolved, r.gap, r.normal, r.point_a, r.point_b};
}

class Ladder : public Method {
 public:
  Ladder(Solver solver, double tolerance, bool warm) : warm_(warm) {
    settings_.solver = solver;
    settings_.tolerance = tolerance;
    begin_pair();
  }
  std::string name() const override {
    return std::string(settings_.solver == Solver::cso ? "cso" : "ours") + (warm_ ? "-warm" : "-cold");
  }
  void begin_pair() override { std::memset(memory_, 0, sizeof memory_); }
  Answer solve(const Particle& a, const Particle& b) override {
    if (!warm_) begin_pair();
    return to_answer(find_contact(a, b, settings_, memory_));
  }

 private:
  ContactSettings settings_;
  bool warm_;
  double memory_[kPairMemorySize];
};

// --- meshes
// ------------------------------------------------------------------------------------------------------

class MeshMethod : public Method {
 public:
  explicit MeshMethod(int vertices) : vertices_(vertices) {}
  double model_error(const Shape& shape) override { return mesh_error(shape, mesh(shape)); }

 protected:
  const Mesh& mesh(const Shape& shape) {
    const auto found = meshes_.find(&shape);
    if (found != meshes_.end()) return found->second;
    return meshes_.emplace(&shape, tessellate(shape, vertices_)).first->second;
  }
  int vertices_;

 private:
  std::map<const Shape*, Mesh> meshes_;
};

struct CcdBody {
  const Mesh* mesh;
  Mat3 turn;
  Vec3 x;
  double scale;
  mutable int at = 0;  // the climb starts where the last one ended
};

void ccd_support(const void* object, const ccd_vec3_t* dir, ccd_vec3_t* out) {
  const CcdBody& body = *static_cast<const CcdBody*>(object);
  const Vec3 d = body.turn.transpose() * Vec3(dir->v[0], dir->v[1], dir->v[2]);
  body.at = farthest_vertex(*body.mesh, d, body.at);
  const Vec3 v = body.x + body.scale * (body.turn * body.mesh->vertices[body.at]);
  ccdVec3Set(out, v[0], v[1], v[2]);
}

void ccd_center(const void* object, ccd_vec3_t* out) {
  const Vec3& x = static_cast<const CcdBody*>(object)->x;
  ccdVec3Set(out, x[0], x[1], x[2]);
}

class Libccd : public MeshMethod {
 public:
  Libccd(int vertices, CcdAlgorithm algorithm, double tolerance)
      : MeshMethod(vertices), algorithm_(algorithm) {
    CCD_INIT(&ccd_);
    ccd_.support1 = ccd_.support2 = ccd_support;
    ccd_.center1 = ccd_.center2 = ccd_center;
    ccd_.max_iterations = kIterationCap;
    ccd_.epa_tolerance = ccd_.mpr_tolerance = tolerance;
  }
  std::string name() const override {
    return label(algorithm_ == CcdAlgorithm::mpr ? "libccd-mpr" : "libccd-epa", vertices_);
  }
  Answer solve(const Particle& a, const Particle& b) override {
    const CcdBody body_a = place(a), body_b = place(b);
    ccd_real_t depth = 0;
    ccd_vec3_t dir, pos;
    const int outcome = algorithm_ == CcdAlgorithm::mpr
                            ? ccdMPRPenetration(&body_a, &body_b, &ccd_, &depth, &dir, &pos)
                            : ccdGJKPenetration(&body_a, &body_b, &ccd_, &depth, &dir, &pos);
    Answer answer;
    answer.ok = outcome != -2;
    if (outcome != 0) {
      answer.gap = std::numeric_limits<double>::infinity();
      return answer;
    }
    answer.gap = -depth;
    answer.normal = Vec3(dir.v[0], dir.v[1], dir.v[2]);
    const Vec3 middle = Vec3(pos.v[0], pos.v[1], pos.v[2]) - a.x;
    answer.point_a = middle + 0.5 * depth * answer.normal;
    answer.point_b = middle - 0.5 * depth * answer.normal;
    return answer;
  }

 private:
  CcdBody place(const Particle& p) { return {&mesh(*p.shape), p.q.toRotationMatrix(), p.x, p.scale}; }
  ccd_t ccd_;
  CcdAlgorithm algorithm_;
};

class Fcl : public MeshMethod {
 public:
  Fcl(int vertices, double tolerance) : MeshMethod(vertices), fcl_(tolerance) {}
  std::string name() const override { return label("fcl-epa", vertices_); }
  Answer solve(const Particle& a, const Particle& b) override {
    const FclAnswer r = fcl_.solve(place(a), place(b));
    return {r.ok, r.gap, Vec3(r.normal), Vec3(r.point_a) - a.x, Vec3(r.point_b) - a.x};
  }

 private:
  // FCL's meshes carry no scale: one per shape and scale.
  int convex(const Particle& p) {
    const auto key = std::make_pair(p.shape, p.scale);
    const auto found = convex_.find(key);
    if (found != convex_.end()) return found->second;
    const Mesh& m = mesh(*p.shape);
    std::vector<double> vertices;
    for (const Vec3& x : m.vertices)
      for (int k = 0; k < 3; ++k) vertices.push_back(p.scale * x[k]);
    const int made = fcl_.add_shape(vertices.data(), static_cast<int>(m.vertices.size()),
                                    m.triangles.data()->data(), static_cast<int>(m.triangles.size()));
    return convex_.emplace(key, made).first->second;
  }
  FclPose place(const Particle& p) {
    FclPose pose;
    pose.shape = convex(p);
    const Mat3 turn = p.q.toRotationMatrix();
    for (int i = 0; i < 3; ++i) {
      pose.x[i] = p.x[i];
      for (int j = 0; j < 3; ++j) pose.turn[3 * i + j] = turn(i, j);
    }
    return pose;
  }
  FclMeshes fcl_;
  std::map<std::pair<const Shape*, double>, int> convex_;
};

// --- best-fitting ellipsoid
// ----------------------------------------------------------------------------------------

class EllipsoidFit : public Method {
 public:
  EllipsoidFit() { begin_pair(); }
  std::string name() const override { return "ellipsoid-fit"; }
  double model_error(const Shape& shape) override {
    const Shape& fit = *model(shape);
    return worst_support_error(
        shape, [&](const Vec3& d) { return find_support(fit, shape.principal_axes.conjugate() * d).h; });
  }
  void begin_pair() override { std::memset(memory_, 0, sizeof memory_); }
  Answer solve(const Particle& a, const Particle& b) override {
    return to_answer(find_contact(place(a), place(b), ContactSettings(), memory_));
  }

 private:
  Particle place(const Particle& p) { return {model(*p.shape), p.scale, p.x, p.q * p.shape->principal_axes}; }
  // A uniform ellipsoid's moments / mass are (b^2 + c^2) / 5 and so on.
  const Shape* model(const Shape& shape) {
    auto& fit = fits_[&shape];
    if (!fit) {
      const Vec3& g = shape.principal_gyration;
      const Vec3 squares = 2.5 * (Vec3::Constant(g.sum()) - 2 * g);
      Vec3 axes = squares.cwiseSqrt();
      axes *= std::cbrt(shape.mass.volume / (4.0 / 3 * std::acos(-1.0) * axes.prod()));
      fit = make_shape("fit", exact_ellipsoid(axes));
    }
    return fit.get();
  }
  std::map<const Shape*, std::shared_ptr<const Shape>> fits_;
  double memory_[kPairMemorySize];
};

// --- sphere clump
// --------------------------------------------------------------------------------------------------

struct Ball {
  Vec3 x;
  double r;
};

struct SurfacePatchPoint {
  Vec3 x, n;
};

std::vector<SurfacePatchPoint> sample(const Shape& shape, int wanted) {
  std::vector<SurfacePatchPoint> points;
  const int n = std::max(2, static_cast<int>(std::sqrt(double(wanted) / shape.patches.size())));
  for (const BezierPatch& patch : shape.patches)
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j) {
        const Jet1 jet = evaluate1(patch, (i + 0.5) / n, (j + 0.5) / n);
        points.push_back({jet.s, jet.su.cross(jet.sv).normalized()});
      }
  return points;
}

// Largest ball inside the body that touches it at p: no other surface point may lie inside.
Ball touching_ball(const SurfacePatchPoint& p, const std::vector<SurfacePatchPoint>& surface,
                   double largest) {
  double r = largest;
  for (const auto& s : surface) {
    const Vec3 to = p.x - s.x;
    const double depth = p.n.dot(to);
    if (depth > 1e-12) r = std::min(r, 0.5 * to.squaredNorm() / depth);
  }
  return {p.x - r * p.n, r};
}

std::vector<Ball> make_balls(const Shape& shape, int count) {
  const std::vector<SurfacePatchPoint> surface = sample(shape, std::max(6000, 10 * count));
  std::vector<double> distance(surface.size(), std::numeric_limits<double>::infinity());
  std::vector<Ball> balls;
  size_t next = 0;
  for (int k = 0; k < count; ++k) {  // farthest point sampling
    balls.push_back(touching_ball(surface[next], surface, shape.bounding_radius));
    for (size_t i = 0; i < surface.size(); ++i)
      distance[i] = std::min(distance[i], (surface[i].x - surface[next].x).squaredNorm());
    next = std::max_element(distance.begin(), distance.end()) - distance.begin();
  }
  return balls;
}

class Clump : public Method {
 public:
  explicit Clump(int spheres) : spheres_(spheres) {}
  std::string name() const override { return label("clump", spheres_); }
  double model_error(const Shape& shape) override {
    const auto& list = balls(shape);
    return worst_support_error(shape, [&](const Vec3& d) {
      double h = -std::numeric_limits<double>::infinity();
      for (const Ball& ball : list) h = std::max(h, d.dot(ball.x) + ball.r);
      return h;
    });
  }
  Answer solve(const Particle& a, const Particle& b) override {
    const Vec3 offset = b.x - a.x;
    const double reach_a = a.scale * a.shape->bounding_radius, reach_b = b.scale * b.shape->bounding_radius;
    place(a, Vec3::Zero(), offset, reach_b, near_a_);
    place(b, offset, Vec3::Zero(), reach_a, near_b_);
    double least = std::numeric_limits<double>::infinity();
    const Ball *on_a = nullptr, *on_b = nullptr;
    for (const Ball& p : near_a_)
      for (const Ball& q : near_b_) {
        const double reach = least + p.r + q.r;
        if (reach < 0 || (q.x - p.x).squaredNorm() >= reach * reach) continue;
        least = (q.x - p.x).norm() - p.r - q.r;
        on_a = &p;
        on_b = &q;
      }
    Answer answer;
    answer.ok = true;
    answer.gap = least;
    if (!on_a) return answer;
    answer.normal = (on_b->x - on_a->x).normalized();
    answer.point_a = on_a->x + on_a->r * answer.normal;
    answer.point_b = on_b->x - on_b->r * answer.normal;
    return answer;
  }

 private:
  const std::vector<Ball>& balls(const Shape& shape) {
    auto& list = balls_[&shape];
    if (list.empty()) list = make_balls(shape, spheres_);
    return list;
  }
  void place(const Particle& p, const Vec3& x, const Vec3& other, double reach, std::vector<Ball>& out) {
    const Mat3 turn = p.q.toRotationMatrix();
    out.clear();
    for (const Ball& ball : balls(*p.shape)) {
      const Ball placed{x + p.scale * (turn * ball.x), p.scale * ball.r};
      if ((placed.x - other).squaredNorm() < (reach + placed.r) * (reach + placed.r)) out.push_back(placed);
    }
  }
  int spheres_;
  std::map<const Shape*, std::vector<Ball>> balls_;
  std::vector<Ball> near_a_, near_b_;
};

}  // namespace

double mesh_error(const Shape& shape, const Mesh& mesh) {
  int at = 0;
  return worst_support_error(
      shape, [&](const Vec3& d) { return d.dot(mesh.vertices[at = farthest_vertex(mesh, d, at)]); });
}

std::unique_ptr<Method> make_ours(double tolerance, bool warm) {
  return std::make_unique<Ladder>(Solver::ladder, tolerance, warm);
}
std::unique_ptr<Method> make_cso(double tolerance, bool warm) {
  return std::make_unique<Ladder>(Solver::cso, tolerance, warm);
}
std::unique_ptr<Method> make_libccd(int vertices, CcdAlgorithm algorithm, double tolerance) {
  return std::make_unique<Libccd>(vertices, algorithm, tolerance);
}
std::unique_ptr<Method> make_fcl(int vertices, double tolerance) {
  return std::make_unique<Fcl>(vertices, tolerance);
}
std::unique_ptr<Method> make_ellipsoid_fit() {
  return std::make_unique<EllipsoidFit>();
}
std::unique_ptr<Method> make_clump(int spheres) {
  return std::make_unique<Clump>(spheres);
}

}  // namespace nurbs::bench

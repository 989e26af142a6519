// Bullet 3's GJK and EPA (btGjkEpaSolver2, double precision) on the meshes' own support mapping, with the
// climb from the last vertex. Bullet's convex hull shape would scan every vertex.
#include <BulletCollision/CollisionShapes/btConvexInternalShape.h>
#include <BulletCollision/NarrowPhaseCollision/btGjkEpa2.h>

#include <map>

#include "bench/competitors.h"
#include "bench/meshes.h"

namespace nurbs::bench {
namespace {

Vec3 from_bullet(const btVector3& v) {
  return {v.x(), v.y(), v.z()};
}

class ClimbedShape : public btConvexInternalShape {
 public:
  ClimbedShape(const Mesh& mesh, double scale) : mesh_(mesh), scale_(scale) { m_collisionMargin = 0; }
  btVector3 localGetSupportingVertexWithoutMargin(const btVector3& d) const override {
    at_ = farthest_vertex(mesh_, from_bullet(d), at_);
    const Vec3 v = scale_ * mesh_.vertices[at_];
    return btVector3(v[0], v[1], v[2]);
  }
  void batchedUnitVectorGetSupportingVertexWithoutMargin(const btVector3* directions, btVector3* out,
                                                         int count) const override {
    for (int k = 0; k < count; ++k) out[k] = localGetSupportingVertexWithoutMargin(directions[k]);
  }
  void calculateLocalInertia(btScalar, btVector3& inertia) const override { inertia.setZero(); }
  const char* getName() const override { return "mesh"; }

 private:
  const Mesh& mesh_;
  double scale_;
  mutable int at_ = 0;
};

btTransform place(const Particle& p) {
  return btTransform(btQuaternion(p.q.x(), p.q.y(), p.q.z(), p.q.w()), btVector3(p.x[0], p.x[1], p.x[2]));
}

class Bullet : public Method {
 public:
  explicit Bullet(int vertices) : vertices_(vertices) {}
  std::string name() const override { return "bullet-epa-" + std::to_string(vertices_); }
  double model_error(const Shape& shape) override { return mesh_error(shape, mesh(shape)); }
  Answer solve(const Particle& a, const Particle& b) override {
    const ClimbedShape shape_a(mesh(*a.shape), a.scale), shape_b(mesh(*b.shape), b.scale);
    const Vec3 offset = b.x - a.x;
    const btVector3 guess(offset[0], offset[1], offset[2]);
    btGjkEpaSolver2::sResults r;
    Answer answer;
    answer.ok = btGjkEpaSolver2::Penetration(&shape_a, place(a), &shape_b, place(b), guess, r, false) ||
                btGjkEpaSolver2::Distance(&shape_a, place(a), &shape_b, place(b), guess, r);
    if (!answer.ok) return answer;
    answer.gap = r.distance;
    answer.point_a = from_bullet(r.witnesses[0]) - a.x;
    answer.point_b = from_bullet(r.witnesses[1]) - a.x;
    // Bullet's normal is in the frame of shape A, with a sign of its own; the witnesses settle that.
    answer.normal = a.q * from_bullet(r.normal).normalized();
    if (answer.gap * answer.normal.dot(answer.point_b - answer.point_a) < 0) answer.normal *= -1;
    return answer;
  }

 private:
  const Mesh& mesh(const Shape& shape) {
    const auto found = meshes_.find(&shape);
    if (found != meshes_.end()) return found->second;
    return meshes_.emplace(&shape, tessellate(shape, vertices_)).first->second;
  }
  int vertices_;
  std::map<const Shape*, Mesh> meshes_;
};

}  // namespace

std::unique_ptr<Method> make_bullet(int vertices) {
  return std::make_unique<Bullet>(vertices);
}

}  // namespace nurbs::bench

// See surface_wall.h.
#include "scene/surface_wall.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "contact/walls/cylinder_search.h"

namespace nurbs {
namespace {

constexpr double kMargin =
    0.2;  // of the bounding radius, between the body's sphere and triangles of no concern
constexpr double kWeld = 1e-6;  // of the bounding radius: corners of a mesh this close are one
constexpr double kCrack = 100;  // times that: borders this close are none
constexpr double kApart =
    0.01;  // of kWeld, by which meshes may have moved against each other and be as before
// What of a body's overlap its flat faces make of a bent mesh's unevenness: below it the mesh is flat to
// them. Bits of single precision that STL files round corners to would have them stand on points that come
// and go.
constexpr double kFlatShare = 5e-2;
constexpr double kMostFlat = 1e-4;    // of the bounding radius
constexpr double kFlatKept = 2;       // a patch is not made again while it is as flat but for this factor ...
constexpr double kFlatKeptBelow = 8;  // ... and this, where overlaps become less

Triangle triangle_at(const double* nodes, int number) {
  Triangle t;
  for (int k = 0; k < 3; ++k) t[k] = Vec3::Map(nodes + 9 * number + 3 * k);
  return t;
}

// Squared distance of a point from a triangle (Ericson 2005, section 5.1.5).
double distance2(const Triangle& t, const Vec3& x) {
  const Vec3 ab = t[1] - t[0], ac = t[2] - t[0], ap = x - t[0];
  const Vec3 n = ab.cross(ac);
  double least = kFarAway;
  bool inside = true;
  for (int k = 0; k < 3; ++k) {
    const Vec3 &p = t[k], way = t[(k + 1) % 3] - p, off = x - p;
    if (n.cross(way).dot(off) >= 0) continue;
    inside = false;
    const double s = std::clamp(off.dot(way) / way.squaredNorm(), 0.0, 1.0);
    least = std::min(least, (off - s * way).squaredNorm());
  }
  const double height = n.dot(ap);
  return inside ? height * height / n.squaredNorm() : least;
}

// Corners in the frame of another triangle: its first corner, its first side, its normal.
Triangle seen_from(const Triangle& other, const Triangle& t) {
  const Vec3 along = (other[1] - other[0]).normalized(),
             normal = along.cross(other[2] - other[0]).normalized(), across = normal.cross(along);
  Triangle out;
  for (int k = 0; k < 3; ++k) {
    const Vec3 x = t[k] - other[0];
    out[k] = Vec3(along.dot(x), across.dot(x), normal.dot(x));
  }
  return out;
}

// Angular velocity that three moving points have, by least squares of w x e = change of velocity along e.
Vec3 spin_of(const Triangle& x, const Triangle& v) {
  Mat3 sum = Mat3::Zero();
  Vec3 right = Vec3::Zero();
  for (int k = 0; k < 3; ++k) {
    const Vec3 e = x[(k + 1) % 3] - x[k], a = v[(k + 1) % 3] - v[k];
    sum += e.squaredNorm() * Mat3::Identity() - e * e.transpose();
    right += e.cross(a);
  }
  if (right.squaredNorm() == 0) return Vec3::Zero();
  return sum.inverse() * right;
}

// Velocity at a point of the triangle's plane, linear between the corners.
Vec3 velocity_at(const Triangle& x, const Triangle& v, const Vec3& at) {
  const Vec3 n = (x[1] - x[0]).cross(x[2] - x[0]);
  const double n2 = n.squaredNorm();
  if (!(n2 > 0)) return v[0];
  const double b = n.dot((at - x[0]).cross(x[2] - x[0])) / n2, c = n.dot((x[1] - x[0]).cross(at - x[0])) / n2;
  return v[0] + b * (v[1] - v[0]) + c * (v[2] - v[0]);
}

}  // namespace

void SurfaceWall::place(const Vec3& origin, const Vec3& axis, double radius, const WallMotion& motion) {
  origin_ = origin;
  axis_ = axis;
  radius_ = radius;
  motion_ = motion;
}

void SurfaceWall::begin_near(int bodies) {
  near_.clear();
  first_.assign(bodies + 1, 0);
  expiry_.assign(bodies, -kFarAway);
  stay_.assign(bodies, -kFarAway);
  patch_of_.assign(bodies, -1);
  patches_used_ = 0;
  path_ = 0;
}

// In an order that does not depend on who owns what.
void SurfaceWall::end_near(const std::vector<TriangleArray>& meshes) {
  if (kind_ == Kind::mesh)
    std::sort(near_.begin(), near_.end(), [&](const Near& a, const Near& b) {
      if (a.body != b.body) return a.body < b.body;
      if (a.mesh != b.mesh) return a.mesh < b.mesh;
      const TriangleArray& mesh = meshes[a.mesh];
      if (mesh.id[a.triangle] != mesh.id[b.triangle]) return mesh.id[a.triangle] < mesh.id[b.triangle];
      const double *x = mesh.nodes + 9 * a.triangle, *y = mesh.nodes + 9 * b.triangle;
      return std::lexicographical_compare(x, x + 3, y, y + 3);
    });
  bodies_near_ = 0;
  std::size_t k = 0;
  for (std::size_t body = 0; body + 1 < first_.size(); ++body) {
    first_[body] = static_cast<int>(k);
    while (k < near_.size() && near_[k].body == static_cast<int>(body)) ++k;
    bodies_near_ += static_cast<int>(k) > first_[body];
  }
  first_.back() = static_cast<int>(k);
}

void SurfaceWall::find(const ContactStages::Step& step, const std::vector<TriangleArray>& meshes,
                       double moved, PairProof* heads, ContactStages* stages) {
  path_ += moved;
  moves_ = moved > 0;
  still_ = kind_ == Kind::mesh && path_ == 0 &&
           std::all_of(meshes.begin(), meshes.end(), [](const TriangleArray& m) { return !m.velocity; });
  overflows_ = 0;
  if (step.bodies->reshaped()) {
    std::fill(expiry_.begin(), expiry_.end(), -kFarAway);
    std::fill(stay_.begin(), stay_.end(), -kFarAway);
    std::fill(patch_of_.begin(), patch_of_.end(), -1);
    patches_used_ = 0;
  }
  const double* path = step.bodies->path();
  for (int body = 0; body + 1 < static_cast<int>(first_.size()); ++body) {
    const bool near = first_[body] < first_[body + 1];
    std::int32_t* head = &heads[body].contact;
    if (*head == 0 && (!near || path[body] + path_ < expiry_[body])) continue;
    if (still_ && path[body] < stay_[body] && stages->stay(body, *head)) continue;
    if (near)
      find_for(body, step, meshes, head, stages);
    else
      stages->give(body, head, nullptr, 0);
  }
}

void SurfaceWall::find_for(int body, const ContactStages::Step& step,
                           const std::vector<TriangleArray>& meshes, std::int32_t* head,
                           ContactStages* stages) {
  FormerContact former[ContactStages::kMostListed];
  const int formers = stages->former(*head, former, former_memories_);
  const Particle particle = step.bodies->particle(body);
  if (!finite(particle)) return stages->give(body, head, nullptr, 0);
  if (kind_ == Kind::cylinder)
    find_cylinder_contacts(particle, origin_, axis_, radius_, step.settings,
                           step.bodies->path()[body] + path_, former, formers, survey_of(body, particle),
                           &contacts_);
  else
    find_in_mesh(body, step, meshes, former, formers);
  expiry_[body] = contacts_.expiry;
  stay_[body] = -kFarAway;
  if (still_ && !by_triangle_) {
    const Patch& patch = *patches_[patch_of_[body]];
    const double path = step.bodies->path()[body];
    stay_[body] = std::min(patch.until, one_face_until(particle, patch.mesh, path, contacts_));
  }
  overflows_ += contacts_.full;
  for (int k = 0; k < contacts_.count; ++k) {
    const SurfaceContact& c = contacts_.contact[k];
    WallContact& f = found_[k];
    f.weight = c.weight;
    f.name = name_of(c, body, meshes);
    f.region.reset();
    f.moves = moves_;
    f.face = still_ && c.piece == SurfaceContact::face;
    f.flat = kind_ == Kind::mesh ? patches_[patch_of_[body]]->flat : 0;
    if (c.flat) f.region = plane_region(patches_[patch_of_[body]]->mesh, c.plane, particle.x);
    f.path = step.bodies->path()[body] + path_;
    f.memory = c.memory;
    ContactResult& r = f.result;
    r = ContactResult{};
    r.status = c.converged ? Status::converged : Status::unresolved;
    r.rung = c.rung;
    r.iterations = c.iterations;
    r.gap = r.lower = r.upper = c.gap;
    r.normal = c.normal;
    r.point_b = particle.x + c.on_body;
    r.point_a = r.point_b - c.gap * c.normal;
    motion_at(c, r.point_a, body, meshes, &f);
  }
  const bool mesh = kind_ == Kind::mesh, cylinder = kind_ == Kind::cylinder;
  stages->give(body, head, found_, contacts_.count, cylinder || edged(*particle.shape), mesh);
}

// What a body keeps of a tube from step to step, if it does.
TubeSurvey* SurfaceWall::survey_of(int body, const Particle& particle) {
  if (!wants_survey(particle, radius_)) return nullptr;
  if (patch_of_[body] < 0) {
    if (patches_used_ == static_cast<int>(surveys_.size())) surveys_.emplace_back();
    patch_of_[body] = patches_used_++;
    surveys_[patch_of_[body]].room = 0;
  }
  return &surveys_[patch_of_[body]];
}

// The piece of the wall that a contact is with, whatever else is near.
std::uint64_t SurfaceWall::name_of(const SurfaceContact& c, int body,
                                   const std::vector<TriangleArray>& meshes) const {
  if (kind_ != Kind::mesh) return 0;
  const std::vector<int>& chosen = patches_[patch_of_[body]]->near;
  const Near& near = near_[chosen[c.of[0]]];
  const auto id = [&](int triangle) -> std::uint64_t {
    if (triangle < 0) return 0;
    const Near& n = near_[chosen[triangle]];
    return 1 + static_cast<std::uint64_t>(meshes[n.mesh].id[n.triangle]);
  };
  const bool vertex = c.piece == SurfaceContact::vertex || c.piece == SurfaceContact::under_vertex;
  const std::uint64_t second = vertex ? c.of[1] : id(c.of[1]);
  return (second << 35) ^ (id(c.of[0]) << 7) ^ static_cast<std::uint64_t>(near.mesh << 3 | c.piece);
}

// Bodies move little between two lists of neighbours: triangles further away than kMargin are left for later.
void SurfaceWall::choose(const BodyRecord& body, int number, double path,
                         const std::vector<TriangleArray>& meshes, Patch* patch) const {
  const Vec3 x = load(body.x);
  const double reach = (1 + kMargin) * body.radius;
  patch->near.clear();
  patch->until = path + kMargin * body.radius;
  for (int k = first_[number]; k < first_[number + 1]; ++k)
    if (distance2(triangle_at(meshes[near_[k].mesh].nodes, near_[k].triangle), x) <= reach * reach)
      patch->near.push_back(k);
}

// The length within which triangles are one plane to a body that overlaps as it was found to; that of its
// patch, if it will do.
double SurfaceWall::flatness(const BodyRecord& body, const Shape& shape, const Patch& patch) const {
  double overlap = 0;
  for (int k = 0; k < contacts_.count && edged(shape); ++k)
    overlap = std::max(overlap, -contacts_.contact[k].gap);
  const double flat = std::clamp(kFlatShare * overlap, kWeld * body.radius, kMostFlat * body.radius);
  return flat <= kFlatKept * patch.flat && flat >= patch.flat / kFlatKeptBelow ? patch.flat : flat;
}

void SurfaceWall::gather(const Patch& patch, const std::vector<TriangleArray>& meshes) {
  triangles_.clear();
  for (const int k : patch.near)
    triangles_.push_back(triangle_at(meshes[near_[k].mesh].nodes, near_[k].triangle));
}

// From the triangles gathered. Corners and planes of several meshes are one only while those keep together.
void SurfaceWall::build(double weld, Patch* patch) const {
  patch->mesh.build(triangles_.data(), static_cast<int>(triangles_.size()), weld, patch->flat, kCrack * weld);
  patch->poses.clear();
  if (patch->near.empty() || near_[patch->near.front()].mesh == near_[patch->near.back()].mesh) return;
  const auto area2 = [&](int k) {
    const Triangle& t = triangles_[k];
    return (t[1] - t[0]).cross(t[2] - t[0]).squaredNorm();
  };
  for (int k = 0; k < static_cast<int>(triangles_.size()); ++k)
    if (k == 0 || near_[patch->near[k]].mesh != near_[patch->near[k - 1]].mesh)
      patch->poses.push_back({k, {}});
    else if (area2(k) > area2(patch->poses.back().triangle))
      patch->poses.back().triangle = k;
  for (Patch::Pose& p : patch->poses)
    p.seen = seen_from(triangles_[patch->poses.front().triangle], triangles_[p.triangle]);
}

// Whether the meshes of a patch lie to each other as they did when it was built.
bool SurfaceWall::keeps_together(double weld, const Patch& patch) const {
  return std::all_of(patch.poses.begin(), patch.poses.end(), [&](const Patch::Pose& p) {
    const Triangle now = seen_from(triangles_[patch.poses.front().triangle], triangles_[p.triangle]);
    for (int k = 0; k < 3; ++k)
      if (!((now[k] - p.seen[k]).norm() <= kApart * weld)) return false;
    return true;
  });
}

void SurfaceWall::find_in_mesh(int body, const ContactStages::Step& step,
                               const std::vector<TriangleArray>& meshes, const FormerContact* former,
                               int count) {
  const Particle particle = step.bodies->particle(body);
  bool made = false;
  if (patch_of_[body] < 0) {
    made = true;
    if (patches_used_ == static_cast<int>(patches_.size())) patches_.push_back(std::make_unique<Patch>());
    patch_of_[body] = patches_used_++;
  }
  Patch& patch = *patches_[patch_of_[body]];
  const double path = step.bodies->path()[body] + path_;
  const auto search = [&] {
    find_surface_contacts(particle, patch.mesh, step.settings, path, former, count, &contacts_);
  };
  if (kind_ == Kind::plane) {
    patch.until = kFarAway;
    if (made)
      patch.mesh.build_plane(origin_, axis_);
    else
      patch.mesh.move_plane(origin_, axis_);
    return search();
  }
  const BodyRecord& record = step.bodies->record(body);
  const double weld = kWeld * record.radius;
  const bool anew = made || path > patch.until;
  if (made) patch.flat = weld;
  if (anew) choose(record, body, path, meshes, &patch);
  if (anew || path_ > 0) gather(patch, meshes);
  if (anew || (path_ > 0 && !keeps_together(weld, patch)))
    build(weld, &patch);
  else if (path_ > 0)
    patch.mesh.move(triangles_.data());
  search();
  if (const double flat = flatness(record, *particle.shape, patch); flat != patch.flat) {
    if (!anew && path_ == 0) gather(patch, meshes);  // else they were
    patch.flat = flat;
    build(weld, &patch);
    search();
  }
  contacts_.expiry = std::min(contacts_.expiry, patch.until);
}

void SurfaceWall::motion_at(const SurfaceContact& c, const Vec3& point, int body,
                            const std::vector<TriangleArray>& meshes, WallContact* out) const {
  out->mark = 0;
  if (kind_ != Kind::mesh) {
    out->spin = motion_.spin;
    out->velocity = motion_.velocity + motion_.spin.cross(point - motion_.centre);
    return;
  }
  const Near& near = near_[patches_[patch_of_[body]]->near[c.triangle]];
  const TriangleArray& mesh = meshes[near.mesh];
  out->mark = near.triangle * kMostMeshes + near.mesh;
  out->spin = out->velocity = Vec3::Zero();
  if (!mesh.velocity) return;
  const Triangle x = triangle_at(mesh.nodes, near.triangle), v = triangle_at(mesh.velocity, near.triangle);
  out->velocity = velocity_at(x, v, point);
  out->spin = spin_of(x, v);
}

std::size_t SurfaceWall::bytes() const {
  std::size_t sum = near_.capacity() * sizeof(Near) + first_.capacity() * sizeof(int) +
                    expiry_.capacity() * (sizeof(double) + sizeof(int));
  for (const auto& patch : patches_) sum += patch->mesh.bytes();
  sum += surveys_.size() * sizeof(TubeSurvey);
  return sum;
}

}  // namespace nurbs

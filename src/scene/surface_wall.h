// A wall that bodies meet in several places: triangle meshes, a cylinder, a plane that moves. Finds its
// contacts with every body near it, once a step, and hands them to the stages, which keep their history.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <vector>

#include "contact/walls/tube_search.h"
#include "scene/contact_stages.h"

namespace nurbs {

// Triangles as a host holds them: three nodes of three numbers each, contiguous.
struct TriangleArray {
  int count = 0;
  const double* nodes = nullptr;
  const double* velocity = nullptr;  // of the nodes, laid out alike; null where nothing moves
  const int* id = nullptr;           // the same on all ranks, images of a triangle across a border alike
};

// How a wall moves as a rigid body: velocity of the point that is at `centre`, and spin.
struct WallMotion {
  Vec3 centre = Vec3::Zero(), velocity = Vec3::Zero(), spin = Vec3::Zero();
};

class SurfaceWall {
 public:
  enum class Kind { mesh, plane, cylinder };
  explicit SurfaceWall(Kind kind = Kind::mesh) : kind_(kind) {}

  // Whether it matters on which of a plane's triangles a contact is.
  void count_by_triangle(bool matters) { by_triangle_ = matters; }

  // Pose of a plane (`axis` its normal) or of a cylinder (`axis` along it), and its motion.
  void place(const Vec3& origin, const Vec3& axis, double radius, const WallMotion& motion);

  // Who is near which triangle from now on; for a plane or cylinder mesh and triangle mean nothing, and every
  // body that may touch is added once. begin; a call per pair; end. Bodies are numbered below `bodies`.
  void begin_near(int bodies);
  void add_near(int body, int mesh, int triangle) { near_.push_back({body, mesh, triangle}); }
  void end_near(const std::vector<TriangleArray>& meshes);

  // Contacts of this step: to be called between begin_step and end_step of the stages. heads[i].contact: list
  // of body i. `moved`: a way that no point of the wall has exceeded since the last call.
  void find(const ContactStages::Step& step, const std::vector<TriangleArray>& meshes, double moved,
            PairProof* heads, ContactStages* stages);

  double neighbours() const { return static_cast<double>(bodies_near_); }
  // Bodies with more contacts than kSurfaceContacts, in the last step: the others are left out.
  int overflows() const { return overflows_; }
  // Mesh and triangle of a contact, by its mark.
  int mesh_of(int mark) const { return mark % kMostMeshes; }
  int triangle_of(int mark) const { return mark / kMostMeshes; }
  std::size_t bytes() const;

  static constexpr int kMostMeshes = 16;

 private:
  struct Near {
    int body, mesh, triangle;
  };
  void find_for(int body, const ContactStages::Step& step, const std::vector<TriangleArray>& meshes,
                std::int32_t* head, ContactStages* stages);
  void find_in_mesh(int body, const ContactStages::Step& step, const std::vector<TriangleArray>& meshes,
                    const FormerContact* former, int count);
  // A body's patch: its triangles near enough to be met before `until`.
  struct Patch {
    MeshPatch mesh;
    std::vector<int> near;  // numbers in near_
    double until = -kFarAway;
    double flat = 0;  // length within which triangles are taken for one plane
    // The largest triangle of each mesh, and where its corners were, seen from the first mesh's; none of one
    // mesh only.
    struct Pose {
      int triangle;  // number in near
      Triangle seen;
    };
    std::vector<Pose> poses;
  };
  void choose(const BodyRecord& body, int number, double path, const std::vector<TriangleArray>& meshes,
              Patch* patch) const;
  double flatness(const BodyRecord& body, const Shape& shape, const Patch& patch) const;
  void gather(const Patch& patch, const std::vector<TriangleArray>& meshes);
  void build(double weld, Patch* patch) const;
  bool keeps_together(double weld, const Patch& patch) const;
  TubeSurvey* survey_of(int body, const Particle& particle);
  std::uint64_t name_of(const SurfaceContact& c, int body, const std::vector<TriangleArray>& meshes) const;
  void motion_at(const SurfaceContact& c, const Vec3& point, int body,
                 const std::vector<TriangleArray>& meshes, WallContact* out) const;

  Kind kind_;
  Vec3 origin_ = Vec3::Zero(), axis_ = Vec3::UnitZ();
  double radius_ = 0;
  WallMotion motion_;
  std::vector<Near> near_;      // by body
  std::vector<int> first_;      // of each body in near_
  std::vector<double> expiry_;  // path up to which a body is clear of the wall
  std::vector<double> stay_;    // path up to which a body's one contact needs no search
  std::vector<int> patch_of_;   // body to patch or survey, -1: not made
  std::vector<std::unique_ptr<Patch>> patches_;
  std::deque<TubeSurvey> surveys_;  // of a tube
  int patches_used_ = 0, bodies_near_ = 0, overflows_ = 0;
  double path_ = 0;  // of the wall since the last end_near
  bool still_ = false, moves_ = false, by_triangle_ = true;
  std::vector<Triangle> triangles_;
  SurfaceContacts contacts_;
  WallContact found_[kSurfaceContacts];
  PairMemory former_memories_[ContactStages::kMostListed];
};

}  // namespace nurbs

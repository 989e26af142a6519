// fix wall/nurbs: walls for NURBS particles.
//   fix ID group wall/nurbs plane PX PY PZ NX NY NZ LAW [move ...]
//   fix ID group wall/nurbs cylinder x|y|z RADIUS C1 C2 LAW [move ...]
//   fix ID group wall/nurbs mesh MESHFIX [MESHFIX ...] LAW
// LAW: that of pair gran/nurbs,
//   kn KN kt KT [cn CN] [ct CT] mu MU
// or the host's contact models (host_models.h) with the atom type T for the wall's material:
//   type T [radius curvature|volume] model NORMAL [tangential T] ...
// A plane's normal points to the particles; C1, C2 are the cylinder's place across its axis, contact is from
// inside and outside; MESHFIX are the host's fix mesh/surface, which move with fix move/mesh. move: see
// wall_motion.h. Scalar: elastic energy. Vector: force of the particles on the wall (1-3) and its torque
// (4-6) about P, the axis' point, or the lab's origin for meshes.
#ifdef FIX_CLASS

FixStyle(wall/nurbs,FixWallNurbs)

#else

#ifndef LMP_FIX_WALL_NURBS_H
#define LMP_FIX_WALL_NURBS_H

#include <memory>
#include <string>
#include <vector>

#include "fix.h"
#include "liggghts/host_models.h"
#include "liggghts/nurbs_contact.h"
#include "liggghts/wall_motion.h"
#include "scene/surface_wall.h"

namespace LAMMPS_NS {

class FixWallNurbs : public Fix {
 public:
  FixWallNurbs(LAMMPS* lmp, int narg, char** arg);
  ~FixWallNurbs() override;

  // The walls of `lmp`, in the order of the input script.
  static std::vector<FixWallNurbs*> all(LAMMPS* lmp);

  void post_create() override;
  void pre_delete(bool unfixflag) override;
  int setmask() override;
  void init() override;
  void setup(int vflag) override;
  void post_run() override;
  void initial_integrate(int vflag) override;
  void pre_exchange() override;
  void setup_pre_force(int vflag) override;
  void pre_force(int) override {}
  void post_force(int vflag) override;
  void reset_dt() override { warn_time_step(); }
  double compute_scalar() override;
  double compute_vector(int n) override;

  void grow_arrays(int n) override;
  void copy_arrays(int from, int to, int delflag) override;
  void set_arrays(int i) override;
  int pack_exchange(int i, double* buffer) override;
  int unpack_exchange(int i, double* buffer) override;
  void write_restart(FILE* file) override;
  void restart(char* buffer) override;
  int pack_restart(int i, double* buffer) override;
  void unpack_restart(int i, int nth) override;
  int size_restart(int i) override;
  int maxsize_restart() override;
  double memory_usage() override;

  // The host makes room for the materials of the atom types that it knows to be in use.
  int min_type() override { return wall_type_; }
  int max_type() override { return wall_type_; }

  // This rank's share. Dissipation is counted while there is a compute nurbs/energy.
  nurbs::EnergyLedger energy() const { return stages_.stored().add(stages_.dissipated(), 1); }
  const nurbs_host::HostModels* models() const { return models_.get(); }
  const nurbs_host::ContactCounts& counts() const { return stages_.counts(); }
  void append_rows(int groupbit, std::vector<nurbs_host::ContactRow>& rows) const;
  // Doubles that any of this rank's particles sends at most.
  int most_exchanged();

 private:
  struct Mesh {
    std::string id;
    class FixMeshSurface* fix = nullptr;
    class FixNeighlistMesh* list = nullptr;
    bool serves = false;        // this wall has made the list that a servo wants
    std::vector<int> ids;       // of the triangles
    std::vector<double> nodes;  // of the last step
  };

  // Each returns the number of the first word that it has not read.
  int parse_plane(int narg, char** arg);
  int parse_cylinder(int narg, char** arg);
  int parse_mesh(int narg, char** arg);
  int parse_motion(int narg, char** arg);
  void parse_law(int first, int narg, char** arg);
  nurbs::PairProof& proof(int i) const { return *reinterpret_cast<nurbs::PairProof*>(proofs_[i]); }
  void serve(Mesh& mesh);
  void hand_in_neighbours();
  bool listed() const { return kind_ != Kind::plane || motion_.moves(); }  // contacts in lists by particle
  void place_surface();
  void hand_in_surface();
  double read_meshes(bool others);
  void check_meshes();
  void compute_surface(nurbs::ContactStages::Step& step);
  void tell_meshes();
  void sum_mesh_forces();
  int contacts_size(int i) const;
  struct Kept;
  double way_since(const Kept& kept) const;
  void warn_models(const class PairGranNurbs& pair);
  void warn_periodic();
  void warn_mesh_types();
  void warn_time_step();
  void warn_deep(const nurbs::DeepContacts& contacts, const char* when);
  void warn_left_out();

  using Kind = nurbs::SurfaceWall::Kind;
  Kind kind_ = Kind::plane;
  double radius_ = 0;  // of a cylinder, whose axis is normal_
  nurbs_host::WallMotion motion_;
  double time_ = 0, last_time_ = 0;  // of the motion; at the last search
  nurbs::SurfaceWall surface_;
  std::vector<Mesh> meshes_;
  std::vector<nurbs::TriangleArray> triangles_;
  bool meshes_checked_ = false;
  nurbs::Vec3 origin_ = nurbs::Vec3::Zero(), normal_ = nurbs::Vec3::UnitZ();
  nurbs::ContactCoefficients law_;                  // or ...
  int wall_type_ = 0;                               // its material, if these models serve
  std::unique_ptr<nurbs_host::HostModels> models_;  // ... the host's models
  nurbs::ContactSettings settings_ = nurbs_host::contacts_only();
  AtomVecNurbs* bodies_ = nullptr;
  int freeze_groupbit_ = 0;
  double** proofs_ = nullptr;  // a PairProof per owned particle
  nurbs::ContactStages stages_;
  nurbs::BodyRecord wall_{};
  bool ledger_ = false;
  bool was_another_kind_ = false;  // in the restart that is read
  bool periodic_warned_ = false, types_warned_ = false;
  bigint checked_particles_ = 0;  // when deep contacts were last looked for
  int last_tag_ = 0;              // the largest one then
  int most_overflows_ = 0;        // in a step of the run
  std::string last_warning_, last_deep_warning_, last_model_warning_;
};

}  // namespace LAMMPS_NS

#endif
#endif

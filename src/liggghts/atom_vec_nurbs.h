// atom_style nurbs: particles bounded by NURBS patches. Holds the shapes and the per-particle data: shape
// number, scale, density and quaternion beside the host's position, velocity and omega; carries them across
// ranks, restarts and data files.
#ifdef ATOM_CLASS

AtomStyle(nurbs,AtomVecNurbs)

#else

#ifndef LMP_ATOM_VEC_NURBS_H
#define LMP_ATOM_VEC_NURBS_H

#include <set>
#include <string>
#include <vector>

#include "atom_vec.h"
#include "contact/contact.h"
#include "liggghts/shape_library.h"
#include "motion/rotation.h"
#include "motion/rotor.h"
#include "scene/bodies.h"
#include "scene/insertion_site.h"

namespace LAMMPS_NS {

class AtomVecNurbs : public AtomVec {
 public:
  // The atom style of `lmp`; ends the run with "USER requires atom_style nurbs" when it is another.
  // Collective.
  static AtomVecNurbs* require(LAMMPS* lmp, const std::string& user);

  explicit AtomVecNurbs(LAMMPS* lmp);
  ~AtomVecNurbs() override;

  const ShapeLibrary& shapes() const { return shapes_; }

  // Of owned or ghost particle i: its shape, the factor on the shape's lengths, its placed body, and the
  // principal moments of inertia (about the shape's principal_axes).
  const nurbs::Shape* shape(int i) const { return shapes_.shape(shapetype_[i]); }
  double scale(int i) const { return scale_[i]; }
  nurbs::Particle particle(int i) const;
  nurbs::Vec3 principal_inertia(int i) const;

  // The bodies as the contacts of this step see them, owned and ghost ones: brought up to date by the first
  // who computes forces in a step. Particles of the group `immobile` (a group bit) are not moved by forces.
  const nurbs::Bodies& update_bodies(int immobile);
  const nurbs::Bodies& bodies() const { return bodies_; }

  int shape_number(int i) const { return shapetype_[i]; }

  // Angular momentum of owned particle i about its centre of mass, lab axes. Between steps `omega` is what
  // counts, so that any command or fix may set it. The momentum it was last made from is kept, and is used as
  // long as omega, orientation and size are to the last bit what they were then, so that a free particle
  // keeps its momentum to the last bit.
  nurbs::Vec3 angular_momentum(int i) const {
    return spin_is_kept(i) ? kept_momentum(i) : momentum_of_spin(i);
  }

  // The two halves of a step, after the angular momentum was kept by keep_momentum(i), of owned particles
  // `list` that share a shape: `count` of them, at most RotorBatch::kBodies. Turns them for a time dt at
  // constant angular momentum, and sets omega; sets omega alone.
  void keep_momentum(int i, const nurbs::Vec3& momentum) {
    for (int k = 0; k < 3; ++k) angmom_[i][k] = momentum[k];
  }
  void rotate(nurbs::RotationScheme scheme, const int* list, int count, double dt);
  void update_omega(const int* list, int count);

  // Makes particle i a body of this shape, scale, density and orientation (normalised), and sets what follows
  // from them: mass and bounding radius. The values must be valid.
  void set_body(int i, int shape_number, double scale, double density, const nurbs::Quat& orientation);

  // Turns particle i, whose omega stays.
  void turn(int i, const nurbs::Quat& by);

  // After the host has changed radii, densities or masses as those of spheres: what these mean here.
  void follow_set_commands();

  // create_atoms has made particles without saying what of; `set density` has said it.
  void density_wanted() { density_wanted_ = true; }
  void density_given() { density_wanted_ = false; }

  // A fix insert/* begins: the bodies that are there now, ghosts too, are what insertion_site() holds, until
  // the next begins. `radius`: the largest that will be inserted. Collective.
  void begin_insertion(double radius);
  // Whether that fix gives an orientation itself, so that templates draw none.
  void orient_insertion(bool given) { insertion_oriented_ = given; }
  bool insertion_oriented() const { return insertion_oriented_; }
  nurbs::InsertionSite& insertion_site();

  void settings(int narg, char** arg) override;
  void init() override;

  void grow(int n) override;
  void grow_reset() override;
  void copy(int from, int to, int delflag) override;

  int pack_comm(int n, int* list, double* buf, int pbc_flag, int* pbc) override;
  int pack_comm_vel(int n, int* list, double* buf, int pbc_flag, int* pbc) override;
  void unpack_comm(int n, int first, double* buf) override;
  void unpack_comm_vel(int n, int first, double* buf) override;
  int pack_reverse(int n, int first, double* buf) override;
  void unpack_reverse(int n, int* list, double* buf) override;
  int pack_border(int n, int* list, double* buf, int pbc_flag, int* pbc) override;
  int pack_border_vel(int n, int* list, double* buf, int pbc_flag, int* pbc) override;
  void unpack_border(int n, int first, double* buf) override;
  void unpack_border_vel(int n, int first, double* buf) override;
  int pack_exchange(int i, double* buf) override;
  int unpack_exchange(double* buf) override;

  int size_restart() override;
  int pack_restart(int i, double* buf) override;
  int unpack_restart(double* buf) override;
  void write_restart_settings(FILE* file) override { shapes_.write_restart(file); }
  void read_restart_settings(FILE* file) override { shapes_.read_restart(file); }

  void create_atom(int type, double* coord) override;
  void data_atom(double* coord, tagint image, char** values) override;
  void data_vel(int i, char** values) override;
  void pack_data(double** buf) override { pack_data(buf, 0); }
  void pack_data(double** buf, int tag_offset) override;
  void write_data(FILE* file, int n, double** buf) override;
  void pack_vel(double** buf) override { pack_vel(buf, 0); }
  void pack_vel(double** buf, int tag_offset) override;
  void write_vel(FILE* file, int n, double** buf) override;

  bigint memory_usage() override;

 private:
  // What keeps particle i from having a mass and a size; empty when nothing does.
  std::string check_size(int i) const;
  // Ends the run where two particles of a data file have one id.
  void check_ids();
  // What a periodic image adds to a ghost's position and (under fix deform) velocity.
  struct ImageShift {
    nurbs::Vec3 x = nurbs::Vec3::Zero();
    nurbs::Vec3 v = nurbs::Vec3::Zero();
  };
  enum class Stage { comm, border };
  ImageShift image_shift(int pbc_flag, const int* pbc, Stage stage) const;

  // What the kept angular momentum made, to see whether it still holds. `size` is 0 when there is none.
  struct SpinRecord {
    double omega[3] = {}, q[4] = {}, size = 0;
  };
  double size(int i) const { return rmass_[i] * scale_[i] * scale_[i]; }
  bool spin_is_kept(int i) const;
  nurbs::Vec3 kept_momentum(int i) const { return {angmom_[i][0], angmom_[i][1], angmom_[i][2]}; }
  nurbs::Vec3 momentum_of_spin(int i) const;
  void load_batch(const int* list, int count);
  void store_omega(int i, int lane);
  void store_q(int i, int lane);
  void record_spin(int i);

  void put_quaternion(int i, const nurbs::Quat& q);
  double* put_position(int i, const ImageShift& shift, double* p) const;
  double* put_orientation(int i, double* p) const;
  double* put_velocity(int i, const ImageShift& shift, double* p) const;
  double* put_body(int i, double* p) const;
  double* put_state(int i, double* p) const;
  double* put_border(int n, const int* list, const ImageShift& shift, bool velocity, double* p) const;
  double* get_position(int i, double* p);
  double* get_orientation(int i, double* p);
  double* get_velocity(int i, double* p);
  double* get_body(int i, double* p);
  double* get_state(int i, double* p);
  double* get_border(int n, int first, bool velocity, double* p);

  int append_atom(int type, const double* coord, tagint image);
  void warn_default_density();
  void check_wider_than_box();
  std::vector<nurbs::Particle> foreign_bodies(double radius) const;
  void follow_set_command(int i);
  void update_size(int i);
  std::string check_all_owned() const;

  ShapeLibrary shapes_;
  std::vector<const nurbs::Shape*> shape_table_;  // by shape number; [0] is none
  nurbs::Bodies bodies_;

  nurbs::InsertionSite site_;
  double site_size_ = 0;                  // > 0: to be filled when asked for
  std::vector<nurbs::Particle> foreign_;  // of other ranks and periodic images, while there are no ghosts

  // The host's arrays (owned by Atom), and the two that Atom has no place for.
  int *tag_ = nullptr, *type_ = nullptr, *mask_ = nullptr, *shapetype_ = nullptr;
  tagint* image_ = nullptr;
  double **x_ = nullptr, **v_ = nullptr, **f_ = nullptr, **omega_ = nullptr, **angmom_ = nullptr,
         **torque_ = nullptr, **quaternion_ = nullptr;
  double *radius_ = nullptr, *density_ = nullptr, *rmass_ = nullptr;
  double* scale_ = nullptr;
  std::vector<SpinRecord> spin_;

  bool density_wanted_ = false;
  bool insertion_oriented_ = false;
  bool data_read_ = false;      // atoms of a data file: their ids are to be looked at
  std::set<std::string> told_;  // warnings of host_rules.h
  nurbs::RotorBatch batch_;     // scratch
};

inline bool AtomVecNurbs::spin_is_kept(int i) const {
  const SpinRecord& made = spin_[i];
  bool kept = made.size == size(i);
  for (int k = 0; k < 3; ++k) kept &= made.omega[k] == omega_[i][k];
  for (int k = 0; k < 4; ++k) kept &= made.q[k] == quaternion_[i][k];
  return kept;
}

}  // namespace LAMMPS_NS

#endif
#endif

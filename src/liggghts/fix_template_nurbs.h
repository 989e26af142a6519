// fix particletemplate/nurbs: what the host's fix insert/* insert, by way of fix
// particledistribution/discrete.
//   fix ID group particletemplate/nurbs SEED atom_type T density constant D shape NAME
//       scale constant S | uniform LO HI | gaussian MU SIGMA
//       [orientation random | constant QW QX QY QZ] [overlap exact | sphere]
// and the host's keywords for all templates: region, region_variable, relative, volume_limit,
// additional_group. Scales are uniform or normal by number; normal ones stop at three SIGMA.
#ifdef FIX_CLASS

FixStyle(particletemplate/nurbs,FixTemplateNurbs)

#else

#ifndef LMP_FIX_TEMPLATE_NURBS_H
#define LMP_FIX_TEMPLATE_NURBS_H

#include <string>
#include <vector>

#include "fix_template_sphere.h"
#include "liggghts/atom_vec_nurbs.h"
#include "particleToInsert.h"
#include "scene/insertion_site.h"

namespace LAMMPS_NS {

// A template as the input script words it.
struct NurbsTemplate {
  enum class Spread { constant, uniform, gaussian };

  int shape = 0;  // number
  Spread spread = Spread::constant;
  double low = 1, high = 1;  // smallest and largest scale
  bool random = true;        // orientation; else `orientation`
  nurbs::Quat orientation = nurbs::Quat::Identity();
  nurbs::Overlap overlap = nurbs::Overlap::exact;
};

// One particle to be inserted.
class ParticleToInsertNurbs : public ParticleToInsert {
 public:
  ParticleToInsertNurbs(LAMMPS* lmp, const NurbsTemplate& model, RanPark* random,
                        FixPropertyAtom* release = nullptr);

  // Makes it a body of this size and density, not yet anywhere.
  void set_body(double scale, double density);

  int insert() override;
  int check_near_set_x_v_omega(double* x, double* v, double* omega, double* quat,
                               RegionNeighborList<interpolate_no>& list) override;
  int set_x_v_omega(double* x, double* v, double* omega, double* quat) override;
  void scale_pti(double factor) override;

 private:
  AtomVecNurbs& bodies() const;
  nurbs::Quat draw_orientation(const double* quat) const;
  void keep(const double* x, const double* v, const double* omega, const nurbs::Quat& q);

  const NurbsTemplate& model_;
  RanPark* random_;
  double scale_ = 1;
  nurbs::Quat q_ = nurbs::Quat::Identity();
};

class FixTemplateNurbs : public FixTemplateSphere {
 public:
  FixTemplateNurbs(LAMMPS* lmp, int narg, char** arg);
  ~FixTemplateNurbs() override;

  // Makes particle i, which is there, one that this template draws; the same on any rank. Its type stays.
  void make(int i);

  double min_rad() override;
  double max_rad() override;
  double max_r_bound() override { return max_rad(); }

  void randomize_single() override;
  void init_ptilist(int count, const bool single, FixPropertyAtom* const release) override;
  void randomize_ptilist(int count, int distribution_groupbit, int order) override;
  void direct_set_ptlist(const int i, const void* const data, const int distribution_groupbit,
                         const int order) override;
  unsigned int generate_hash() override;

 private:
  FixTemplateNurbs(LAMMPS* lmp, int narg, char** arg, std::vector<char*> host);
  const nurbs::Shape& shape() const;
  void parse(int narg, char** arg);
  void parse_scale(const char* kind, char** values);
  double draw_scale(RanPark& random) const;
  double expected_cube() const;
  void fill(ParticleToInsert* particle);

  AtomVecNurbs* bodies_;
  NurbsTemplate model_;
  int seed_;                            // as given
  FixPropertyAtom* release_ = nullptr;  // what the particles of the list are told of their release
};

}  // namespace LAMMPS_NS

#endif
#endif

// See host_models.h.
//
// The host instantiates its model templates for combinations of its own; here each of the five kinds is held
// by its virtual base. Compiled with hidden visibility (Makefile.package): copies of the host's templates
// must not take the place of its own, which its spheres use. Debian's headers lack the generated lists of
// models: model_lists/ has them.
#include "liggghts/host_models.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <sstream>

#include "atom.h"
#include "comm.h"
#include "error.h"
#include "force.h"
#include "modify.h"
#include "neighbor.h"
#include "update.h"
// After the host's classes that it uses.
#include "contact_models.h"
#include "global_properties.h"
#include "liggghts/host_error.h"
#include "utils.h"

namespace LAMMPS_NS::nurbs_host {

namespace host = LIGGGHTS::ContactModels;
using nurbs::ModelContact;
using nurbs::Vec3;

namespace {

struct Name {
  const char* name;
  int id;
};
constexpr Name kNormal[] = {
#define NORMAL_MODEL(identifier, name, constant) {#name, constant},
#include "style_normal_model.h"
#undef NORMAL_MODEL
};
constexpr Name kTangential[] = {
    {"off", host::TANGENTIAL_OFF},
#define TANGENTIAL_MODEL(identifier, name, constant) {#name, constant},
#include "style_tangential_model.h"
#undef TANGENTIAL_MODEL
};
constexpr Name kCohesion[] = {
    {"off", host::COHESION_OFF},
#define COHESION_MODEL(identifier, name, constant) {#name, constant},
#include "style_cohesion_model.h"
#undef COHESION_MODEL
};
constexpr Name kRolling[] = {
    {"off", host::ROLLING_OFF},
#define ROLLING_MODEL(identifier, name, constant) {#name, constant},
#include "style_rolling_model.h"
#undef ROLLING_MODEL
};

// One kind of model as the input script names it.
struct Choice {
  const char* kind;
  const Name *first, *last;
  Name chosen;
};

template <std::size_t n>
Choice choice(const char* kind, const Name (&names)[n], Name none) {
  return {kind, names, names + n, none};
}

// Liquid bridges read meshes, liquid content and arms of spheres.
bool needs_spheres(const std::string& name) {
  return name.find("capillary") != std::string::npos;
}

// Settings that make the models write to meshes, heat fixes or energy fixes, or read bonds.
bool refused_setting(const std::string& name) {
  return name.rfind("heating", 0) == 0 || name.rfind("compute", 0) == 0 || name.rfind("disable", 0) == 0;
}

}  // namespace

// The models of one combination, in the host's order.
class HostModels::Combination : public host::ContactModelBase, public LIGGGHTS::IContactHistorySetup {
 public:
  Combination(LAMMPS* lmp, bool wall, int normal, int tangential, int cohesion, int rolling)
      : ContactModelBase(lmp, wall), lmp_(lmp), ids{normal, tangential, cohesion, rolling} {
    if (normal == host::NORMAL_OFF) normal_.reset(new host::NormalModel<host::NORMAL_OFF>(lmp, this, this));
#define NORMAL_MODEL(identifier, name, constant) \
  if (normal == constant) normal_.reset(new host::NormalModel<host::identifier>(lmp, this, this));
#include "style_normal_model.h"
#undef NORMAL_MODEL
    if (cohesion == host::COHESION_OFF)
      cohesion_.reset(new host::CohesionModel<host::COHESION_OFF>(lmp, this, this));
#define COHESION_MODEL(identifier, name, constant) \
  if (cohesion == constant) cohesion_.reset(new host::CohesionModel<host::identifier>(lmp, this, this));
#include "style_cohesion_model.h"
#undef COHESION_MODEL
    if (tangential == host::TANGENTIAL_OFF)
      tangential_.reset(new host::TangentialModel<host::TANGENTIAL_OFF>(lmp, this, this));
#define TANGENTIAL_MODEL(identifier, name, constant) \
  if (tangential == constant) tangential_.reset(new host::TangentialModel<host::identifier>(lmp, this, this));
#include "style_tangential_model.h"
#undef TANGENTIAL_MODEL
    if (rolling == host::ROLLING_OFF)
      rolling_.reset(new host::RollingModel<host::ROLLING_OFF>(lmp, this, this));
#define ROLLING_MODEL(identifier, name, constant) \
  if (rolling == constant) rolling_.reset(new host::RollingModel<host::identifier>(lmp, this, this));
#include "style_rolling_model.h"
#undef ROLLING_MODEL
  }

  void tally_pp(double, int, int, int) override {}
  void tally_pw(double, int, int, int) override {}

  // The host turns the sign of a value marked "1" where it lists the pair the other way; here it never does.
  int add_history_value(std::string name, std::string) override {
    names.push_back(name);
    return static_cast<int>(names.size()) - 1;
  }
  // Where the tangential spring is in the history.
  int shear() const {
    return shear_;
  }

  // Empty, or what is wrong with the words.
  std::string set(int narg, char** arg) {
    Settings settings(lmp_);
    normal_->registerSettings(settings);
    cohesion_->registerSettings(settings);
    tangential_->registerSettings(settings);
    rolling_->registerSettings(settings);
    if (!settings.parseArguments(narg, arg)) return settings.error_message;
    normal_->postSettings(this, this);
    cohesion_->postSettings(this, this);
    tangential_->postSettings(this, this);
    rolling_->postSettings(this, this);
    shear_ = static_cast<int>(std::find(names.begin(), names.end(), "shearx") - names.begin());
    return "";
  }

  void connect(PropertyRegistry& registry) {
    normal_->connectToProperties(registry);
    cohesion_->connectToProperties(registry);
    tangential_->connectToProperties(registry);
    rolling_->connectToProperties(registry);
    friction_ = nullptr;
    if (ids[1] == host::TANGENTIAL_OFF) return;
    registry.registerProperty("coeffFrict", &MODEL_PARAMS::createCoeffFrict);
    registry.connect("coeffFrict", friction_, "pair gran/nurbs");
  }

  double exponent() const {
    return normal_->stressStrainExponent();
  }
  // Whether the normal force is kn times the overlap, but for damping.
  bool elastic() const {
    return ids[0] == host::HERTZ || ids[0] == host::HERTZ_STIFFNESS || ids[0] == host::HOOKE ||
           ids[0] == host::HOOKE_STIFFNESS;
  }
  bool cohesive() const {
    return ids[2] != host::COHESION_OFF;
  }

  void force(host::SurfacesIntersectData& s, host::ForceData& i, host::ForceData& j) {
    normal_->surfacesIntersect(s, i, j);
    cohesion_->surfacesIntersect(s, i, j);
    tangential_->surfacesIntersect(s, i, j);
    rolling_->surfacesIntersect(s, i, j);
  }

  // Energy of the cohesive force from the first touch to this overlap (< 0): it depends on the overlap alone.
  // Gauss-Legendre, exact for the models' polynomials in all but 1 / r^2.
  double cohesive_energy(const host::SurfacesIntersectData& s) {
    constexpr double at[] = {0.06943184420297371, 0.33000947820757187, 0.6699905217924281,
                             0.9305681557970263};
    constexpr double weight[] = {0.17392742256872692, 0.32607257743127307, 0.32607257743127307,
                                 0.17392742256872692};
    double energy = 0;
    for (int k = 0; k < 4; ++k) {
      host::SurfacesIntersectData there = s;
      host::ForceData i, j;
      there.deltan = at[k] * s.deltan;
      there.r = s.radsum - there.deltan;
      there.rsq = there.r * there.r;
      there.rinv = 1 / there.r;
      cohesion_->surfacesIntersect(there, i, j);
      energy += weight[k] * s.deltan * Vec3::Map(i.delta_F).dot(Vec3::Map(s.en));
    }
    return energy;
  }

  bool slides(const host::SurfacesIntersectData& s, double tangential) const {
    return friction_ != nullptr && tangential > 0 &&
           tangential >= (1 - 1e-9) * friction_[s.itype][s.jtype] * std::fabs(s.Fn);
  }

  std::vector<std::string> names;  // of the history values

 private:
  LAMMPS* lmp_;

 public:
  const int ids[4];  // normal, tangential, cohesion, rolling

 private:
  std::unique_ptr<host::NormalModelBase> normal_;
  std::unique_ptr<host::CohesionModelBase> cohesion_;
  std::unique_ptr<host::TangentialModelBase> tangential_;
  std::unique_ptr<host::RollingModelBase> rolling_;
  double** friction_ = nullptr;
  int shear_ = 0;
};

bool HostModels::named_by(int narg, char** arg) {
  return narg > 0 && (std::strcmp(arg[0], "model") == 0 || std::strcmp(arg[0], "radius") == 0);
}

HostModels::HostModels(LAMMPS* lmp, const std::string& user, int wall_type, int narg, char** arg)
    : lmp_(lmp), user_(user), wall_type_(wall_type) {
  build(narg, arg);
}

HostModels::HostModels(LAMMPS* lmp, const std::string& user, int wall_type, const std::string& text)
    : lmp_(lmp), user_(user), wall_type_(wall_type) {
  std::istringstream stream(text);
  std::vector<std::string> words;
  for (std::string word; stream >> word;) words.push_back(word);
  std::vector<char*> arg;
  for (std::string& word : words) arg.push_back(word.data());
  build(static_cast<int>(arg.size()), arg.data());
}

HostModels::~HostModels() = default;

void HostModels::build(int narg, char** arg) {
  for (int k = 0; k < narg; ++k) text_ += (k == 0 ? "" : " ") + std::string(arg[k]);
  if (narg > 0 && std::strcmp(arg[0], "radius") == 0) {
    const std::string value = narg > 1 ? arg[1] : "";
    if (value != "curvature" && value != "volume")
      fail_all(FLERR, lmp_, user_ + ": radius " + value + " must be curvature or volume");
    volume_radius_ = value == "volume";
    narg -= 2;
    arg += 2;
  }
  Choice choices[] = {
      choice("model", kNormal, {"off", host::NORMAL_OFF}), choice("tangential", kTangential, kTangential[0]),
      choice("cohesion", kCohesion, kCohesion[0]), choice("rolling_friction", kRolling, kRolling[0])};
  if (narg == 0 || std::strcmp(arg[0], "model") != 0)
    fail_all(FLERR, lmp_,
             user_ + ": the contact model must begin with model NORMAL" +
                 (narg > 0 && std::strcmp(arg[0], "kn") == 0 ? "; kn .. stands without a type" : ""));
  for (Choice& c : choices) {
    if (narg == 0 || std::strcmp(arg[0], c.kind) != 0) continue;
    const std::string name = narg > 1 ? arg[1] : "";
    if (needs_spheres(name))
      fail_all(
          FLERR, lmp_,
          user_ + ": " + c.kind + " " + name + " can't be used: its liquid bridges are those of spheres");
    const Name* found = std::find_if(c.first, c.last, [&](const Name& n) { return name == n.name; });
    if (found == c.last) {
      std::string message = user_ + ": " + c.kind + " " + name + " must be one of";
      for (const Name* n = c.first; n != c.last; ++n) message += std::string(" ") + n->name;
      fail_all(FLERR, lmp_, message);
    }
    c.chosen = *found;
    narg -= 2;
    arg += 2;
  }
  if (narg > 0 && std::strcmp(arg[0], "surface") == 0) {
    if (narg > 1 && std::strcmp(arg[1], "default") != 0)
      fail_all(FLERR, lmp_,
               user_ + ": surface " + arg[1] + " can't be used: the surfaces are those of the NURBS bodies");
    narg -= std::min(2, narg);
    arg += 2;
  }
  for (int k = 0; k < narg; k += 2) {
    for (const Choice& c : choices)
      if (std::strcmp(arg[k], c.kind) == 0)
        fail_all(FLERR, lmp_,
                 user_ + ": " + c.kind +
                     " is out of order; the order is model tangential cohesion rolling_friction");
    for (const char* first : {"tolerance", "solver", "radius"})
      if (std::strcmp(arg[k], first) == 0)
        fail_all(FLERR, lmp_, user_ + ": " + first + " must stand before model");
    if (k + 1 == narg) fail_all(FLERR, lmp_, user_ + ": setting " + arg[k] + " needs a value");
    if (refused_setting(arg[k]) && std::strcmp(arg[k + 1], "off") != 0)
      fail_all(FLERR, lmp_,
               user_ + ": setting " + arg[k] +
                   " can't be used with NURBS particles; compute nurbs/energy has the energies of contacts");
  }
  // The models of Luding's kind read each other's history.
  const bool adhesive = choices[0].chosen.id == host::LUDING || choices[0].chosen.id == host::EDINBURGH ||
                        choices[0].chosen.id == host::EDINBURGH_STIFFNESS ||
                        choices[0].chosen.id == host::THORNTON_NING;
  if (!adhesive &&
      (choices[1].chosen.id == host::TANGENTIAL_LUDING || choices[3].chosen.id == host::ROLLING_LUDING))
    fail_all(FLERR, lmp_,
             user_ +
                 ": tangential tan_luding and rolling_friction luding need model luding, edinburgh, "
                 "edinburgh/stiffness or thornton_ning");
  if (choices[0].chosen.id == host::EDINBURGH) {
    bool fixed = false;
    for (int k = 0; k < narg; k += 2)
      fixed = fixed || (std::strcmp(arg[k], "fixKc") == 0 && std::strcmp(arg[k + 1], "on") == 0);
    if (!fixed)
      fail_all(
          FLERR, lmp_,
          user_ +
              ": model edinburgh needs the setting fixKc on; without it the host's model may loop for ever");
  }
  models_ = std::make_unique<Combination>(lmp_, wall_type_ != 0, choices[0].chosen.id, choices[1].chosen.id,
                                          choices[2].chosen.id, choices[3].chosen.id);
  const std::string wrong = models_->set(narg, arg);
  if (!wrong.empty()) fail_all(FLERR, lmp_, user_ + ": " + wrong);
  std::uint32_t hash = 2166136261u;  // Fowler, Noll and Vo's: the same in every build
  for (const char c : layout()) hash = (hash ^ static_cast<unsigned char>(c)) * 16777619u;
  kind_ = hash;
  if (history_size() > nurbs::kMostModelMemory - nurbs::kModelMemory)
    fail_all(FLERR, lmp_, user_ + ": these models keep too much history");
}

void HostModels::init() {
  models_->connect(lmp_->force->registry);
}

std::string HostModels::layout() const {
  std::string all;
  for (const std::string& name : models_->names) all += name + " ";
  return all;
}

bool HostModels::matches(const std::string& kind, const std::string& name) const {
  const auto is = [&](const Name* first, const Name* last, int id) {
    const Name* found = std::find_if(first, last, [&](const Name& n) { return name == n.name; });
    return found != last && found->id == id;
  };
  if (kind == "normal") return is(std::begin(kNormal), std::end(kNormal), models_->ids[0]);
  if (kind == "tangential") return is(std::begin(kTangential), std::end(kTangential), models_->ids[1]);
  if (kind == "cohesion") return is(std::begin(kCohesion), std::end(kCohesion), models_->ids[2]);
  if (kind == "rolling_friction") return is(std::begin(kRolling), std::end(kRolling), models_->ids[3]);
  return false;
}

std::string HostModels::named(const std::string& kind) const {
  std::istringstream words(text_);
  for (std::string word; words >> word;)
    if (word == kind) return words >> word ? word : "";
  return "";
}

std::int64_t HostModels::hashcode() const {
  const int* id = models_->ids;
  return LIGGGHTS::Utils::generate_gran_hashcode(id[0], id[1], id[2], id[3], host::SURFACE_DEFAULT);
}

double HostModels::stress_strain_exponent() const {
  return models_->exponent();
}

std::string HostModels::unknown_energies() const {
  std::string unknown;
  if (!models_->elastic()) unknown += " the normal spring,";
  if (models_->ids[1] == host::TANGENTIAL_LUDING) unknown += " the tangential spring,";
  if (models_->ids[3] != host::ROLLING_OFF && models_->ids[3] != host::ROLLING_CDT)
    unknown += " the rolling spring,";
  if (!unknown.empty()) unknown.pop_back();
  return unknown;
}

int HostModels::history_size() const {
  return static_cast<int>(models_->names.size());
}

void HostModels::force(ModelContact& c) const {
  const bool wall = c.a < 0;
  // A pair is i = A, j = B; at a wall i is the particle, B. The host's normal points to i.
  const double sign = wall ? 1 : -1;
  const Vec3 en = sign * c.normal, v = sign * c.velocity, vt = v - v.dot(en) * en;
  const Atom* atom = lmp_->atom;
  int flags = 0;
  host::SurfacesIntersectData s;
  host::ForceData on_i, on_j;
  s.is_wall = wall;
  s.computeflag = 1;
  s.shearupdate = c.moves_on ? 1 : 0;
  s.contact_flags = &flags;
  s.contact_history = c.history;
  s.i = wall ? c.b : c.a;
  s.j = wall ? -wall_type_ : c.b;
  s.itype = atom->type[s.i];
  s.jtype = wall ? wall_type_ : atom->type[s.j];
  s.radi = wall ? c.radius_b : c.radius_a;
  s.radj = wall ? 0 : c.radius_b;
  s.radsum = s.radi + s.radj;
  s.deltan = c.overlap;
  s.r = s.radsum - c.overlap;
  s.rsq = s.r * s.r;
  s.rinv = 1 / s.r;
  Vec3::Map(s.en) = en;
  Vec3::Map(s.delta) = s.r * en;
  s.v_i = atom->v[s.i];
  s.v_j = wall ? nullptr : atom->v[s.j];
  s.omega_i = atom->omega[s.i];
  s.omega_j = wall ? nullptr : atom->omega[s.j];
  s.mi = wall ? c.mass_b : c.mass_a;
  s.mj = c.mass_b;
  s.meff = c.mass;
  s.vn = v.dot(en);
  s.vtr1 = vt[0];
  s.vtr2 = vt[1];
  s.vtr3 = vt[2];
  // As the host's spheres have it: of the particle against the wall, or of both about the contact.
  const double ci = (s.radi - 0.5 * c.overlap) * s.rinv, cj = (s.radj - 0.5 * c.overlap) * s.rinv;
  const Vec3 roll = wall ? Vec3(ci * c.spin) : Vec3(ci * Vec3::Map(s.omega_i) + cj * Vec3::Map(s.omega_j));
  s.wr1 = roll[0];
  s.wr2 = roll[1];
  s.wr3 = roll[2];
  s.cri = s.crj = 0;  // the force's torque is the caller's
  s.kn = s.kt = s.gamman = s.gammat = s.Fn = s.Ft = s.P_diss = 0;
  models_->force(s, on_i, on_j);

  c.force = sign * Vec3::Map(on_i.delta_F);
  c.torque = Vec3::Map(wall ? on_i.delta_torque : on_j.delta_torque);
  c.stiffness = s.kn > 0 ? s.kn : std::fabs(s.Fn) / c.overlap;
  c.slides = models_->slides(s, (c.force - c.force.dot(c.normal) * c.normal).norm());
  if (models_->elastic()) c.elastic_energy = s.kn * c.overlap * c.overlap / (1 + models_->exponent());
  c.normal_energy = c.elastic_energy;
  if (models_->cohesive()) c.normal_energy += models_->cohesive_energy(s);
  if (models_->ids[1] == host::TANGENTIAL_HISTORY)
    c.tangential_energy = 0.5 * s.kt * Vec3::Map(c.history + models_->shear()).squaredNorm();
}

}  // namespace LAMMPS_NS::nurbs_host

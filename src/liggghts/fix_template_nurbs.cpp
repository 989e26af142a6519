// fix particletemplate/nurbs. See fix_template_nurbs.h.
#include "liggghts/fix_template_nurbs.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "atom.h"
#include "force.h"
#include "liggghts/host_error.h"
#include "liggghts/nurbs_contact.h"
#include "probability_distribution.h"

namespace LAMMPS_NS {

using nurbs::Quat;
using nurbs::Vec3;
using nurbs_host::fail_all;
using Spread = NurbsTemplate::Spread;

namespace {

constexpr const char* kStyle = "Fix particletemplate/nurbs";
constexpr double kSigmas = 3;  // where a gaussian ends, as the host's do

// A keyword, the words that may follow it and how many values these take.
struct Choice {
  const char* word;
  int values;
};
struct Keyword {
  const char* name;
  bool ours;  // else the host's own
  bool required;
  std::vector<Choice> choices;  // empty: one value
};
const std::vector<Keyword>& keywords() {
  static const std::vector<Keyword> list = {
      {"atom_type", false, false, {}},
      {"density", false, true, {{"constant", 1}}},
      {"shape", true, true, {}},
      {"scale", true, true, {{"constant", 1}, {"uniform", 2}, {"gaussian", 2}}},
      {"orientation", true, false, {{"random", 0}, {"constant", 4}}},
      {"overlap", true, false, {{"exact", 0}, {"sphere", 0}}},
      {"region", false, false, {}},
      {"region_variable", false, false, {}},
      {"relative", false, false, {}},
      {"volume_limit", false, false, {}},
      {"additional_group", false, false, {}}};
  return list;
}

const Keyword* find_keyword(const char* name) {
  for (const Keyword& keyword : keywords())
    if (std::strcmp(keyword.name, name) == 0) return &keyword;
  return nullptr;
}

std::string list_of(const std::vector<std::string>& words) {
  std::string list;
  for (const std::string& word : words) list += (list.empty() ? "" : " ") + word;
  return list;
}

[[noreturn]] void unknown_keyword(LAMMPS* lmp, const char* word) {
  std::vector<std::string> known;
  for (const Keyword& keyword : keywords()) known.push_back(keyword.name);
  const std::string hint =
      std::strcmp(word, "radius") == 0 ? "; a NURBS particle's size is its shape's times scale" : "";
  fail_all(FLERR, lmp,
           std::string(kStyle) + ": unknown keyword " + word + hint + "; allowed are " + list_of(known));
}

// How many words keyword arg[k] takes with its values.
int length_of(LAMMPS* lmp, const Keyword& keyword, int k, int narg, char** arg) {
  const std::string what = std::string(kStyle) + ": keyword " + keyword.name;
  if (k + 1 == narg) fail_all(FLERR, lmp, what + " needs a value");
  if (keyword.choices.empty()) return 2;
  std::vector<std::string> allowed;
  for (const Choice& choice : keyword.choices) {
    allowed.push_back(choice.word);
    if (std::strcmp(choice.word, arg[k + 1]) != 0) continue;
    if (k + 2 + choice.values > narg)
      fail_all(FLERR, lmp,
               what + " " + choice.word + " needs " + std::to_string(choice.values) + " value" +
                   (choice.values > 1 ? "s" : ""));
    return 2 + choice.values;
  }
  fail_all(FLERR, lmp, what + " " + arg[k + 1] + " must be one of " + list_of(allowed));
}

// The host's template takes its own keywords only, and stops reading at any other: what is for it, after all
// has been checked.
std::vector<char*> host_arguments(LAMMPS* lmp, int narg, char** arg) {
  AtomVecNurbs::require(lmp, kStyle);
  if (narg < 4) fail_all(FLERR, lmp, std::string(kStyle) + " needs a seed");
  std::vector<char*> host(arg, arg + 4);
  std::vector<const Keyword*> given;
  for (int k = 4; k < narg;) {
    const Keyword* keyword = find_keyword(arg[k]);
    if (keyword == nullptr) unknown_keyword(lmp, arg[k]);
    if (std::find(given.begin(), given.end(), keyword) != given.end())
      fail_all(FLERR, lmp, std::string(kStyle) + ": keyword " + arg[k] + " is there twice");
    given.push_back(keyword);
    const int length = length_of(lmp, *keyword, k, narg, arg);
    if (std::strcmp(keyword->name, "density") == 0)
      nurbs_host::parse_positive(lmp, std::string(kStyle) + ": density", arg[k + 2]);
    if (!keyword->ours) host.insert(host.end(), arg + k, arg + k + length);
    k += length;
  }
  for (const Keyword& keyword : keywords())
    if (keyword.required && std::find(given.begin(), given.end(), &keyword) == given.end())
      fail_all(FLERR, lmp, std::string(kStyle) + ": missing keyword " + keyword.name);
  return host;
}

// Uniform over all orientations (Shoemake).
Quat random_orientation(RanPark& random) {
  const double share = random.uniform(), a = 2 * M_PI * random.uniform(), b = 2 * M_PI * random.uniform();
  const double s = std::sqrt(1 - share), t = std::sqrt(share);
  return Quat(t * std::cos(b), s * std::sin(a), s * std::cos(a), t * std::sin(b));
}

}  // namespace

ParticleToInsertNurbs::ParticleToInsertNurbs(LAMMPS* lmp, const NurbsTemplate& model, RanPark* random,
                                             FixPropertyAtom* release)
    : ParticleToInsert(lmp, 1, release), model_(model), random_(random) {}

AtomVecNurbs& ParticleToInsertNurbs::bodies() const {
  return static_cast<AtomVecNurbs&>(*atom->avec);
}

void ParticleToInsertNurbs::set_body(double scale, double density) {
  const nurbs::Shape& shape = *bodies().shapes().shape(model_.shape);
  scale_ = scale;
  radius_ins[0] = r_bound_ins = scale * shape.bounding_radius;
  density_ins = density;
  volume_ins = shape.mass.volume * scale * scale * scale;
  mass_ins = density_ins * volume_ins;
  for (int k = 0; k < 3; ++k) x_ins[0][k] = x_bound_ins[k] = v_ins[k] = omega_ins[k] = 0;
}

void ParticleToInsertNurbs::scale_pti(double factor) {
  set_body(factor * scale_, density_ins);
}

// The orientation a fix insert/* asks for turns the template's; a constant one stands for a random one.
Quat ParticleToInsertNurbs::draw_orientation(const double* quat) const {
  const Quat own = !model_.random                  ? model_.orientation
                   : bodies().insertion_oriented() ? Quat::Identity()
                                                   : random_orientation(*random_);
  return (Quat(quat[0], quat[1], quat[2], quat[3]) * own).normalized();
}

void ParticleToInsertNurbs::keep(const double* x, const double* v, const double* omega, const Quat& q) {
  for (int k = 0; k < 3; ++k) {
    x_ins[0][k] = x_bound_ins[k] = x[k];
    v_ins[k] = v[k];
    omega_ins[k] = omega[k];
  }
  q_ = q;
}

// The host's list knows spheres; the bodies have their own.
int ParticleToInsertNurbs::check_near_set_x_v_omega(double* x, double* v, double* omega, double* quat,
                                                    RegionNeighborList<interpolate_no>&) {
  nurbs::Particle body;
  body.shape = bodies().shapes().shape(model_.shape);
  body.scale = scale_;
  body.x = Vec3(x[0], x[1], x[2]);
  body.q = draw_orientation(quat);
  nurbs::InsertionSite& site = bodies().insertion_site();
  if (site.overlaps(body, model_.overlap)) return 0;
  site.add(body);
  keep(x, v, omega, body.q);
  return 1;
}

int ParticleToInsertNurbs::set_x_v_omega(double* x, double* v, double* omega, double* quat) {
  keep(x, v, omega, draw_orientation(quat));
  return 1;
}

int ParticleToInsertNurbs::insert() {
  const int inserted = ParticleToInsert::insert();
  bodies().set_body(atom->nlocal - 1, model_.shape, scale_, density_ins, q_);
  return inserted;
}

FixTemplateNurbs::FixTemplateNurbs(LAMMPS* lmp, int narg, char** arg)
    : FixTemplateNurbs(lmp, narg, arg, host_arguments(lmp, narg, arg)) {}

FixTemplateNurbs::FixTemplateNurbs(LAMMPS* lmp, int narg, char** arg, std::vector<char*> host)
    : FixTemplateSphere(lmp, static_cast<int>(host.size()), host.data()),
      bodies_(AtomVecNurbs::require(lmp, kStyle)),
      seed_(seed_mc) {
  if (force->cg_active()) fail_all(FLERR, lmp, std::string(kStyle) + " can't be used with coarsegraining");
  parse(narg, arg);
  volume_expect = shape().mass.volume * expected_cube();
  mass_expect = LMP_PROBABILITY_NS::expectancy(pdf_density) * volume_expect;
  delete pti;  // the host's own kind
  pti = new ParticleToInsertNurbs(lmp, model_, random_insertion);
}

FixTemplateNurbs::~FixTemplateNurbs() {
  delete_ptilist();
  delete pti;
}

const nurbs::Shape& FixTemplateNurbs::shape() const {
  return *bodies_->shapes().shape(model_.shape);
}

// The words have been checked by host_arguments.
void FixTemplateNurbs::parse(int narg, char** arg) {
  for (int k = 4; k < narg; k += length_of(lmp, *find_keyword(arg[k]), k, narg, arg)) {
    const std::string keyword = arg[k];
    if (keyword == "shape") {
      model_.shape = bodies_->shapes().require(kStyle, arg[k + 1]);
    } else if (keyword == "scale") {
      parse_scale(arg[k + 1], arg + k + 2);
    } else if (keyword == "orientation") {
      model_.random = std::strcmp(arg[k + 1], "random") == 0;
      if (!model_.random)
        model_.orientation =
            nurbs_host::parse_quaternion(lmp, std::string(kStyle) + ": orientation", arg + k + 2);
    } else if (keyword == "overlap") {
      model_.overlap = std::strcmp(arg[k + 1], "exact") == 0 ? nurbs::Overlap::exact : nurbs::Overlap::sphere;
    } else if (keyword == "atom_type" && !(1 <= atom_type && atom_type <= atom->ntypes)) {
      fail_all(FLERR, lmp,
               std::string(kStyle) + ": atom_type " + arg[k + 1] + " must be 1 to " +
                   std::to_string(atom->ntypes));
    }
  }
}

void FixTemplateNurbs::parse_scale(const char* kind, char** values) {
  const std::string what = std::string(kStyle) + ": scale " + kind;
  const double first = nurbs_host::parse_positive(lmp, what, values[0]);
  model_.low = model_.high = first;
  if (std::strcmp(kind, "constant") == 0) return;
  const double second = nurbs_host::parse_not_negative(lmp, what, values[1]);
  if (std::strcmp(kind, "uniform") == 0) {
    model_.spread = Spread::uniform;
    model_.high = second;
    if (second < first)
      fail_all(FLERR, lmp, what + " " + values[0] + " " + values[1] + ": LO must not be above HI");
    return;
  }
  model_.spread = Spread::gaussian;
  model_.low = first - kSigmas * second;
  model_.high = first + kSigmas * second;
  if (!(model_.low > 0))
    fail_all(FLERR, lmp, what + " " + values[0] + " " + values[1] + ": MU - 3 SIGMA must be > 0");
}

double FixTemplateNurbs::draw_scale(RanPark& random) const {
  const double middle = (model_.low + model_.high) / 2, half = (model_.high - model_.low) / 2;
  if (model_.spread == Spread::constant) return model_.low;
  if (model_.spread == Spread::uniform) return model_.low + 2 * half * random.uniform();
  double x;
  do x = random.gaussian();
  while (std::abs(x) > kSigmas);
  return middle + half / kSigmas * x;
}

// Of the scale's third power.
double FixTemplateNurbs::expected_cube() const {
  const double middle = (model_.low + model_.high) / 2, half = (model_.high - model_.low) / 2;
  double variance = 0;
  if (model_.spread == Spread::uniform) variance = half * half / 3;
  if (model_.spread == Spread::gaussian) {
    const double sigma = half / kSigmas, density = std::exp(-kSigmas * kSigmas / 2) / std::sqrt(2 * M_PI);
    variance = sigma * sigma * (1 - 2 * kSigmas * density / std::erf(kSigmas / std::sqrt(2)));
  }
  return middle * (middle * middle + 3 * variance);
}

double FixTemplateNurbs::min_rad() {
  return model_.low * shape().bounding_radius;
}

double FixTemplateNurbs::max_rad() {
  return model_.high * shape().bounding_radius;
}

void FixTemplateNurbs::fill(ParticleToInsert* particle) {
  particle->atom_type = atom_type;
  static_cast<ParticleToInsertNurbs*>(particle)->set_body(
      draw_scale(*random_insertion), LMP_PROBABILITY_NS::rand(pdf_density, random_insertion));
}

// By random numbers that belong to its place.
void FixTemplateNurbs::make(int i) {
  RanPark random(lmp, "15485863");
  random.reset(seed_, atom->x[i]);
  const double scale = draw_scale(random);
  const double density = LMP_PROBABILITY_NS::rand(pdf_density, &random);
  bodies_->set_body(i, model_.shape, scale, density,
                    model_.random ? random_orientation(random) : model_.orientation);
}

void FixTemplateNurbs::randomize_single() {
  fill(pti);
  pti->groupbit = groupbit;
}

// The host asks each of N templates for room for its share of a batch and N more: with a thousand templates
// that is a million particles, of which nearly all are never drawn. Those that are drawn are made then and
// kept.
void FixTemplateNurbs::init_ptilist(int count, const bool, FixPropertyAtom* const release) {
  if (pti_list != nullptr)
    fail_all(FLERR, lmp, std::string(kStyle) + ": its list of particles exists already");
  n_pti_max = count;
  pti_list = static_cast<ParticleToInsert**>(memory->smalloc(count * sizeof(ParticleToInsert*), "pti_list"));
  std::fill(pti_list, pti_list + count, nullptr);
  release_ = release;
}

// Called on all ranks when a fix insert/* begins.
void FixTemplateNurbs::randomize_ptilist(int count, int distribution_groupbit, int order) {
  bodies_->begin_insertion(max_rad());
  for (int i = 0; i < count; ++i) {
    if (pti_list[i] == nullptr)
      pti_list[i] = new ParticleToInsertNurbs(lmp, model_, random_insertion, release_);
    fill(pti_list[i]);
    pti_list[i]->groupbit = groupbit | distribution_groupbit;
    pti_list[i]->distorder = order;
  }
}

void FixTemplateNurbs::direct_set_ptlist(const int, const void* const, const int, const int) {
  nurbs_host::fail_one(
      lmp, std::string(kStyle) + " can't be used by insert/stream/predefined: its file is of spheres");
}

unsigned int FixTemplateNurbs::generate_hash() {
  unsigned int hash = 0, start = static_cast<unsigned int>(seed_orig) * 420001u;  // as the host's
  for (const int value : {atom_type, model_.shape, static_cast<int>(model_.spread),
                          static_cast<int>(model_.random), static_cast<int>(model_.overlap)})
    add_hash_value(value, start, hash);
  for (const double value :
       {model_.low, model_.high, LMP_PROBABILITY_NS::expectancy(pdf_density), model_.orientation.w(),
        model_.orientation.x(), model_.orientation.y(), model_.orientation.z()})
    add_hash_value(value, start, hash);
  return hash;
}

}  // namespace LAMMPS_NS

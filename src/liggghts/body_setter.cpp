// See body_setter.h.
#include "liggghts/body_setter.h"

#include <mpi.h>

#include <cmath>
#include <cstdint>
#include <cstring>

#include "atom.h"
#include "input.h"
#include "liggghts/host_error.h"
#include "liggghts/nurbs_contact.h"
#include "variable.h"

namespace LAMMPS_NS {

using nurbs::Quat;
using nurbs::Vec3;
using nurbs_host::fail_all;

namespace {

struct Word {
  const char* name;
  bool prefixed;
  int length;
};
constexpr Word kWords[] = {{"shape", true, 2},
                           {"scale", true, 2},
                           {"quat", false, 5},
                           {"quat/random", false, 2},
                           {"density", false, 2}};

// The k-th number in [0, 1) that belongs to a seed and a particle, whatever rank owns it (splitmix64).
double uniform(int seed, int tag, int k) {
  std::uint64_t z = (static_cast<std::uint64_t>(seed) << 32 | static_cast<std::uint32_t>(tag)) +
                    static_cast<std::uint64_t>(k + 1) * 0x9E3779B97F4A7C15u;
  z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
  z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
  return static_cast<double>((z ^ (z >> 31)) >> 11) * 0x1p-53;
}

}  // namespace

BodySetter::BodySetter(LAMMPS* lmp, const std::string& user, const std::string& prefix)
    : Pointers(lmp), user_(user), prefix_(prefix), bodies_(*AtomVecNurbs::require(lmp, user)) {}

int BodySetter::length(const char* word) const {
  for (const Word& known : kWords)
    if (word == (known.prefixed ? prefix_ : std::string()) + known.name) return known.length;
  return 0;
}

std::string BodySetter::words() const {
  std::string list;
  for (const Word& known : kWords)
    list += (list.empty() ? "" : " ") + (known.prefixed ? prefix_ : std::string()) + known.name;
  return list;
}

// A number, or a variable's value for every particle chosen.
std::vector<double> BodySetter::values(const char* text, const std::vector<int>& chosen, bool positive,
                                       const std::string& what) {
  if (std::strncmp(text, "v_", 2) != 0) {
    const double value =
        positive ? nurbs_host::parse_positive(lmp, what, text) : nurbs_host::parse_number(lmp, what, text);
    return std::vector<double>(chosen.size(), value);
  }
  const int variable = input->variable->find(const_cast<char*>(text + 2));
  if (variable < 0) fail_all(FLERR, lmp, what + ": there is no variable " + (text + 2));
  std::vector<double> found(chosen.size());
  if (input->variable->equalstyle(variable)) {
    found.assign(chosen.size(), input->variable->compute_equal(variable));
  } else if (input->variable->atomstyle(variable)) {
    std::vector<double> all(atom->nlocal + 1);
    input->variable->compute_atom(variable, 0, all.data(), 1, 0);
    for (std::size_t k = 0; k < chosen.size(); ++k) found[k] = all[chosen[k]];
  } else {
    fail_all(FLERR, lmp, what + ": variable " + (text + 2) + " must be of style equal or atom");
  }
  int bad = 0, any = 0;
  for (const double value : found) bad |= !std::isfinite(value) || (positive && value <= 0);
  MPI_Allreduce(&bad, &any, 1, MPI_INT, MPI_MAX, world);
  if (any)
    fail_all(FLERR, lmp,
             what + " = " + text + " must be a number" + (positive ? " > 0" : "") + " for every particle");
  return found;
}

void BodySetter::apply(int narg, char** arg, const std::vector<int>& chosen) {
  const std::string what = user_ + ": " + arg[0];
  if (narg < length(arg[0]))
    fail_all(
        FLERR, lmp,
        what + " needs " + std::to_string(length(arg[0]) - 1) + " value" + (length(arg[0]) > 2 ? "s" : ""));
  const auto set = [&](int i, int shape, double scale, double density, const Quat& q) {
    bodies_.set_body(i, shape, scale, density, q);
  };
  const std::string word =
      std::strncmp(arg[0], prefix_.c_str(), prefix_.size()) == 0 ? arg[0] + prefix_.size() : arg[0];
  if (word == "shape") {
    const int shape = bodies_.shapes().require(user_, arg[1]);
    for (const int i : chosen) set(i, shape, bodies_.scale(i), atom->density[i], bodies_.particle(i).q);
  } else if (word == "scale") {
    const std::vector<double> scale = values(arg[1], chosen, true, what);
    for (std::size_t k = 0; k < chosen.size(); ++k) {
      const int i = chosen[k];
      set(i, bodies_.shape_number(i), scale[k], atom->density[i], bodies_.particle(i).q);
    }
  } else if (word == "density") {
    const std::vector<double> density = values(arg[1], chosen, true, what);
    for (std::size_t k = 0; k < chosen.size(); ++k) {
      const int i = chosen[k];
      set(i, bodies_.shape_number(i), bodies_.scale(i), density[k], bodies_.particle(i).q);
    }
    bodies_.density_given();
  } else if (word == "quat/random") {
    const double seed = nurbs_host::parse_positive(lmp, what, arg[1]);
    if (seed != std::floor(seed) || seed > 0x7fffffff)
      fail_all(FLERR, lmp, what + " = " + arg[1] + " must be an integer > 0");
    for (const int i : chosen) {
      const double share = uniform(static_cast<int>(seed), atom->tag[i], 0);
      const double a = 2 * M_PI * uniform(static_cast<int>(seed), atom->tag[i], 1);
      const double b = 2 * M_PI * uniform(static_cast<int>(seed), atom->tag[i], 2);
      const double s = std::sqrt(1 - share), t = std::sqrt(share);
      set(i, bodies_.shape_number(i), bodies_.scale(i), atom->density[i],
          Quat(t * std::cos(b), s * std::sin(a), s * std::cos(a), t * std::sin(b)));
    }
  } else {
    std::vector<double> part[4];
    for (int k = 0; k < 4; ++k) part[k] = values(arg[1 + k], chosen, false, what);
    int bad = 0, any = 0;
    const auto axis = [&](std::size_t k) { return Vec3(part[0][k], part[1][k], part[2][k]); };
    for (std::size_t k = 0; k < chosen.size(); ++k) bad |= !(axis(k).stableNorm() > 0);
    MPI_Allreduce(&bad, &any, 1, MPI_INT, MPI_MAX, world);
    if (any) fail_all(FLERR, lmp, what + ": axis 0 0 0 must have a length > 0");
    for (std::size_t k = 0; k < chosen.size(); ++k) {
      const int i = chosen[k];
      const Quat q(Eigen::AngleAxisd(part[3][k] * M_PI / 180, axis(k).stableNormalized()));
      set(i, bodies_.shape_number(i), bodies_.scale(i), atom->density[i], q);
    }
  }
}

}  // namespace LAMMPS_NS

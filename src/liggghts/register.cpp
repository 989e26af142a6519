// How the packaged LIGGGHTS learns the NURBS styles. Debian's libliggghts.so has no plugin loader, but its
// own calls go through the dynamic symbol table: a definition of Atom::new_avec or Output::add_dump that
// comes earlier in symbol lookup (this executable, or libliggghts_nurbs.so under LD_PRELOAD) is the one that
// runs. Both definitions here serve the NURBS styles and hand everything else to the host's own function
// (dlsym RTLD_NEXT). The pair, fix, compute and command styles are put into the host's creator maps when
// `atom_style nurbs` is created, in an input script or by a restart.
//
// Not used in a LIGGGHTS source tree (`make -f Makefile.package install`): there the host's make finds the
// styles by the macros in their headers. To add a style, include its header in styles.h; nothing else.
#include <dlfcn.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>
#include <string>

#include "atom.h"
#include "atom_vec.h"
#include "compute.h"
#include "dump.h"
#include "error.h"
#include "fix.h"
#include "force.h"
#include "group.h"
#include "input.h"
#include "lammps.h"
#include "memory.h"
#include "modify.h"
#include "output.h"
#include "pair.h"
// Classes first; below, the same list is read again for each kind of style with the host's macros.
#include "liggghts/host_rules.h"
#include "liggghts/styles.h"

namespace {

using LAMMPS_NS::Compute;
using LAMMPS_NS::Fix;
using LAMMPS_NS::LAMMPS;
using LAMMPS_NS::Modify;
using LAMMPS_NS::Pair;

using ComputeCreator = Compute* (*)(LAMMPS*, int, int, char**);
using FixCreator = Fix* (*)(LAMMPS*, int, char**);
using ComputeMap = std::map<std::string, ComputeCreator>;
using FixMap = std::map<std::string, FixCreator>;

// Modify::fix_map and compute_map are not public. The rule that an explicit instantiation may name any member
// makes them reachable without changing the class's definition: AccessKey's friend functions return the
// members.
ComputeMap* Modify::*compute_map_member(int);
FixMap* Modify::*fix_map_member(int);

template <ComputeMap* Modify::*computes, FixMap* Modify::*fixes>
struct AccessKey {
  friend ComputeMap* Modify::*compute_map_member(int) { return computes; }
  friend FixMap* Modify::*fix_map_member(int) { return fixes; }
};
template struct AccessKey<&Modify::compute_map, &Modify::fix_map>;

// The same for Input::command_map.
using LAMMPS_NS::Input;
using CommandMap = std::map<std::string, void (*)(LAMMPS*, int, char**)>;
CommandMap* Input::*command_map_member(int);
template <CommandMap* Input::*commands>
struct InputAccessKey {
  friend CommandMap* Input::*command_map_member(int) { return commands; }
};
template struct InputAccessKey<&Input::command_map>;

template <class Style>
[[maybe_unused]] Pair* create_pair(LAMMPS* lmp) {
  return new Style(lmp);
}

template <class Style>
[[maybe_unused]] Fix* create_fix(LAMMPS* lmp, int narg, char** arg) {
  return new Style(lmp, narg, arg);
}

template <class Style>
[[maybe_unused]] void do_command(LAMMPS* lmp, int narg, char** arg) {
  Style(lmp).command(narg, arg);
}

template <class Style>
[[maybe_unused]] Compute* create_compute(LAMMPS* lmp, int iarg, int narg, char** arg) {
  return new Style(lmp, iarg, narg, arg);
}

// The host's own creators of fixes that NURBS particles refuse. Without this they would be refused when a run
// begins, after the host's words on what is missing in them.
FixMap& hosts_refused() {
  static FixMap creators;
  return creators;
}

Fix* create_unless_refused(LAMMPS* lmp, int narg, char** arg) {
  const char* style = arg[2];
  if (dynamic_cast<LAMMPS_NS::AtomVecNurbs*>(lmp->atom->avec) != nullptr)
    LAMMPS_NS::nurbs_host::refuse_fix(lmp, style);
  return hosts_refused().at(style)(lmp, narg, arg);
}

FixMap& hosts_meshes() {
  static FixMap creators;
  return creators;
}

Fix* create_mesh(LAMMPS* lmp, int narg, char** arg) {
  if (dynamic_cast<LAMMPS_NS::AtomVecNurbs*>(lmp->atom->avec) != nullptr)
    for (int k = 3; k + 1 < narg; ++k)
      if (std::strcmp(arg[k], "file") == 0) LAMMPS_NS::nurbs_host::check_stl(lmp, arg[2], arg[0], arg[k + 1]);
  const auto own =
      hosts_meshes().find(arg[2]);  // mesh/surface/stress and its like are modules of mesh/surface
  return (own != hosts_meshes().end() ? own->second : hosts_meshes().at("mesh/surface"))(lmp, narg, arg);
}

// Adds the styles to this LAMMPS instance's maps. Doing it twice does no harm: the last writer wins.
void register_styles(LAMMPS* lmp) {
  [[maybe_unused]] auto& pairs = *lmp->force->pair_map;
  [[maybe_unused]] FixMap& fixes = *(lmp->modify->*fix_map_member(0));
  [[maybe_unused]] ComputeMap& computes = *(lmp->modify->*compute_map_member(0));
#define PAIR_CLASS
#define PairStyle(key, Class) pairs[#key] = &create_pair<LAMMPS_NS::Class>;
#include "liggghts/styles.h"
#undef PairStyle
#undef PAIR_CLASS
#define FIX_CLASS
#define FixStyle(key, Class) fixes[#key] = &create_fix<LAMMPS_NS::Class>;
#include "liggghts/styles.h"
#undef FixStyle
#undef FIX_CLASS
  for (auto& [style, create] : fixes)
    if (create != &create_unless_refused && LAMMPS_NS::nurbs_host::is_refused_fix(style)) {
      hosts_refused()[style] = create;
      create = &create_unless_refused;
    } else if (create != &create_mesh && style.compare(0, 12, "mesh/surface") == 0) {
      hosts_meshes()[style] = create;
      create = &create_mesh;
    }
#define COMPUTE_CLASS
#define ComputeStyle(key, Class) computes[#key] = &create_compute<LAMMPS_NS::Class>;
#include "liggghts/styles.h"
#undef ComputeStyle
#undef COMPUTE_CLASS
  [[maybe_unused]] CommandMap& commands = *(lmp->input->*command_map_member(0));
#define COMMAND_CLASS
#define CommandStyle(key, Class) commands[#key] = &do_command<LAMMPS_NS::Class>;
#include "liggghts/styles.h"
#undef CommandStyle
#undef COMMAND_CLASS
}

// The host's own definition of a function this file also defines.
template <class Function>
Function host_function(const char* mangled_name) {
  void* symbol = dlsym(RTLD_NEXT, mangled_name);
  if (symbol == nullptr) {
    std::fprintf(
        stderr, "ERROR: this build of LIGGGHTS does not export %s; NURBS styles need LIGGGHTS-PUBLIC 3.8.0\n",
        mangled_name);
    std::abort();
  }
  Function function;
  std::memcpy(&function, &symbol, sizeof function);
  return function;
}

}  // namespace

namespace LAMMPS_NS {

AtomVec* Atom::new_avec(const char* style, char* suffix, int& sflag) {
#define ATOM_CLASS
#define AtomStyle(key, Class)          \
  if (std::strcmp(style, #key) == 0) { \
    sflag = 0;                         \
    register_styles(lmp);              \
    return new Class(lmp);             \
  }
#include "liggghts/styles.h"
#undef AtomStyle
#undef ATOM_CLASS
  using NewAvec = AtomVec* (*)(Atom*, const char*, char*, int&);
  static const auto host = host_function<NewAvec>("_ZN9LAMMPS_NS4Atom8new_avecEPKcPcRi");
  return host(this, style, suffix, sflag);
}

// The host creates dumps in one closed if-else chain. A NURBS dump therefore enters the list as a `dump
// custom` of the same ID, group, interval and file, through all of the host's checks, and then takes that
// one's place.
void Output::add_dump(int narg, char** arg) {
  using AddDump = void (*)(Output*, int, char**);
  static const auto host = host_function<AddDump>("_ZN9LAMMPS_NS6Output8add_dumpEiPPc");
  [[maybe_unused]] const auto enlist = [&](auto create) {
    std::string style = "custom", column = "id";
    char* placeholder[] = {arg[0], arg[1], style.data(), arg[3], arg[4], column.data()};
    host(this, 6, placeholder);
    Dump* ours = create();
    delete dump[ndump - 1];
    dump[ndump - 1] = ours;
  };
#define DUMP_CLASS
#define DumpStyle(key, Class) \
  if (narg >= 5 && std::strcmp(arg[2], #key) == 0) return enlist([&] { return new Class(lmp, narg, arg); });
#include "liggghts/styles.h"
#undef DumpStyle
#undef DUMP_CLASS
  host(this, narg, arg);
}

}  // namespace LAMMPS_NS

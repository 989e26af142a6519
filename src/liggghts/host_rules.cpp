// See host_rules.h.
#include "liggghts/host_rules.h"

#include <mpi.h>

#include <algorithm>
#include <cctype>
#include <cstring>
#include <fstream>
#include <iterator>
#include <string>

#include "atom.h"
#include "comm.h"
#include "domain.h"
#include "fix.h"
#include "fix_insert.h"
#include "fix_mesh_surface.h"
#include "fix_particledistribution_discrete.h"
#include "fix_property_global.h"
#include "force.h"
#include "group.h"
#include "lammps.h"
#include "liggghts/fix_template_nurbs.h"
#include "liggghts/host_error.h"
#include "liggghts/pair_gran_nurbs.h"
#include "modify.h"
#include "neighbor.h"
#include "update.h"

namespace LAMMPS_NS::nurbs_host {

namespace {

constexpr int kMulti = 2;     // of Neighbor::style, whose names are local to the host's files
constexpr int kMinimize = 2;  // of Update::whichflag

struct Rule {
  const char* prefix;  // of a fix style
  const char* instead;
};

// Take the particles for spheres, or know no torque.
constexpr Rule kRefused[] = {{"wall/gran", "; use fix wall/nurbs"},
                             {"wall/region", "; use fix wall/nurbs"},
                             {"wall/sph", "; use fix wall/nurbs"},
                             {"rigid", "; use fix nve/nurbs"},
                             {"multisphere", "; use fix nve/nurbs"},
                             {"concave", "; use fix nve/nurbs"},
                             {"multicontact", ""},
                             {"massflow/mesh/sieve", "; use fix wall/nurbs mesh and fix massflow/mesh"},
                             {"heat/gran", ""},
                             {"sph/", ""},
                             {"insert/stream/predefined", "; use fix insert/stream"}};

// Go on with the volume or cross-section of the bounding sphere.
constexpr Rule kSpherical[] = {{"couple/cfd", "drag and volume"},
                               {"buoyancy", "volume"},
                               {"ave/euler", "volume"},
                               {"continuum/weighted", "volume"},
                               {"transportequation", "size"}};

bool starts_with(const char* text, const char* prefix) {
  return std::strncmp(text, prefix, std::strlen(prefix)) == 0;
}

void warn_once(LAMMPS* lmp, std::set<std::string>* told, const std::string& message) {
  if (told->insert(message).second) warn(FLERR, lmp, message);
}

void check_settings(LAMMPS* lmp) {
  const auto refuse = [&](const std::string& what) { fail_all(FLERR, lmp, "atom_style nurbs " + what); };
  if (lmp->domain->dimension != 3) refuse("needs a 3d simulation");
  if (lmp->domain->is_wedge) refuse("cannot be used in a wedge domain");
  if (lmp->domain->triclinic)
    refuse(
        "cannot be used in a triclinic box, in which LIGGGHTS loses granular particles; use an orthogonal "
        "one");
  if (lmp->neighbor->style == kMulti)
    refuse("cannot be used with 'neighbor .. multi', which finds no contacts; use bin");
  if (starts_with(lmp->update->integrate_style, "respa"))
    refuse("cannot be used with 'run_style respa'; use verlet");
  if (lmp->update->whichflag == kMinimize)
    refuse("cannot be used with minimize: no orientation would be turned");
  if (!(lmp->update->dt > 0)) fail_all(FLERR, lmp, "timestep = " + show(lmp->update->dt) + " must be > 0");
  if (lmp->force->cg_active()) refuse("cannot be used with coarsegraining");
}

// A restart file doesn't hold it.
void warn_default_step(LAMMPS* lmp, std::set<std::string>* told) {
  if (lmp->update->timestep_set) return;
  warn_once(lmp, told,
            "There is no 'timestep' in the input script; LIGGGHTS's default of " + show(lmp->update->dt) +
                " is used");
}

// The pair style's own init has had its say by now.
void check_pair_style(LAMMPS* lmp, std::set<std::string>* told) {
  if (lmp->force->pair != nullptr && PairGranNurbs::find(lmp) == nullptr) refuse_pair_style(lmp);
  if (lmp->force->pair != nullptr) return;
  const std::string missing = "atom_style nurbs: there is no pair_style gran/nurbs";
  if (lmp->atom->sortfreq > 0 &&
      !(lmp->comm->cutghostuser > 0))  // would end in 'Atom sorting has bin size = 0.0'
    fail_all(FLERR, lmp, missing + "; for particles without contacts, say 'atom_modify sort 0 0'");
  if (lmp->atom->natoms > 1) warn_once(lmp, told, missing + ": particles go through each other");
}

// Particles may be meant to stand still, all of them hardly ever. Those that are still to be inserted may be
// all that a fix is for.
void warn_no_integrator(LAMMPS* lmp, std::set<std::string>* told) {
  if (lmp->update->nsteps == 0) return;
  int moved = 0, frozen = 0;
  bool inserts = false;
  for (int k = 0; k < lmp->modify->nfix; ++k) {
    Fix* fix = lmp->modify->fix[k];
    if (fix->time_integrate) moved |= fix->groupbit;
    if (std::strcmp(fix->style, "freeze") == 0) frozen |= fix->groupbit;
    inserts |= dynamic_cast<FixInsert*>(fix) != nullptr;
  }
  const Atom& atom = *lmp->atom;
  int mine[2] = {0, 0}, all[2] = {0, 0};  // that move, that are neither moved nor frozen
  for (int i = 0; i < atom.nlocal; ++i) {
    mine[0] += (atom.mask[i] & moved) != 0;
    mine[1] += (atom.mask[i] & (moved | frozen)) == 0;
  }
  MPI_Allreduce(mine, all, 2, MPI_INT, MPI_SUM, lmp->world);
  if (all[0] > 0 || (moved != 0 && inserts) || (all[1] == 0 && atom.natoms > 0)) return;
  warn_once(lmp, told, "No fix moves the particles: they stand still; 'fix ID all nve/nurbs' moves them");
}

void check_integrator(LAMMPS* lmp, const Fix& fix) {
  if (!fix.time_integrate || std::strcmp(fix.style, "nve/nurbs") == 0 || std::strcmp(fix.style, "move") == 0)
    return;
  fail_all(FLERR, lmp, name_of(fix) + " would move NURBS particles without turning them; use fix nve/nurbs");
}

// The host inserts when a run begins, after this.
void check_insertion(LAMMPS* lmp, Fix* fix) {
  auto* insert = dynamic_cast<FixInsert*>(fix);
  if (insert == nullptr) return;
  FixParticledistributionDiscrete* distribution = insert->get_distribution();
  for (int n = 0; n < distribution->n_particletemplates(); ++n) {
    const Fix* model = distribution->particletemplates()[n];
    if (dynamic_cast<const FixTemplateNurbs*>(model) == nullptr)
      fail_all(FLERR, lmp,
               name_of(*fix) + ": its template " + model->id + " is of " + model->style +
                   "; atom_style nurbs needs fix particletemplate/nurbs");
  }
}

// Properties that the host takes at any value: below 0 a contact would pull, or drive what it is to brake.
void check_materials(LAMMPS* lmp, Fix* fix) {
  auto* property = dynamic_cast<FixPropertyGlobal*>(fix);
  if (property == nullptr) return;
  const int types = lmp->atom->ntypes;
  if (property->check_fix("youngsModulus", "peratomtype", types, 0, "atom_style nurbs", false) != nullptr)
    for (int i = 0; i < types; ++i)
      if (const double value = property->compute_vector(i); !(value > 0))
        fail_all(FLERR, lmp,
                 name_of(*fix) + ": youngsModulus of type " + std::to_string(i + 1) + " = " + show(value) +
                     " must be > 0");
  for (const char* name : {"coefficientFriction", "coefficientRollingFriction",
                           "coefficientRollingViscousDamping", "kn", "kt", "gamman", "gammat"}) {
    if (property->check_fix(name, "peratomtypepair", types, types, "atom_style nurbs", false) == nullptr)
      continue;
    for (int i = 0; i < types; ++i)
      for (int j = i; j < types; ++j)
        if (const double value = property->compute_array(i, j); !(value >= 0))
          fail_all(FLERR, lmp,
                   name_of(*fix) + ": " + name + " of types " + std::to_string(i + 1) + " " +
                       std::to_string(j + 1) + " = " + show(value) + " must be >= 0");
  }
}

// A mesh that is neither a wall nor a face that particles are inserted or counted at. What uses one for
// contact or counting has the host make it a fix neighlist/mesh, named neighlist_USER_MESH.
void warn_idle_mesh(LAMMPS* lmp, Fix* fix, std::set<std::string>* told) {
  auto* mesh = dynamic_cast<FixMeshSurface*>(fix);
  if (mesh == nullptr || mesh->triMesh()->isInsertionMesh()) return;
  const std::string ending = std::string("_") + fix->id;
  for (int k = 0; k < lmp->modify->nfix; ++k) {
    const std::string id = lmp->modify->fix[k]->id;
    if (starts_with(lmp->modify->fix[k]->style, "neighlist/mesh") && id.size() > ending.size() &&
        id.compare(id.size() - ending.size(), ending.size(), ending) == 0)
      return;
  }
  warn_once(
      lmp, told,
      name_of(*fix) + " is no wall to the particles: they go through it; name it in fix wall/nurbs mesh");
}

// The host's fix freeze takes forces and torques off, not the motion that there is: a body may be meant to go
// on at its speed, but one that turns against its neighbours for ever is mostly forgotten.
void warn_frozen_motion(LAMMPS* lmp, const Fix& fix, std::set<std::string>* told) {
  if (std::strcmp(fix.style, "freeze") != 0) return;
  const Atom& atom = *lmp->atom;
  int mine = 0, all = 0;
  for (int i = 0; i < atom.nlocal; ++i) {
    if (!(atom.mask[i] & fix.groupbit)) continue;
    bool moves = false;
    for (int k = 0; k < 3; ++k) moves |= atom.v[i][k] != 0 || atom.omega[i][k] != 0;
    mine += moves;
  }
  MPI_Allreduce(&mine, &all, 1, MPI_INT, MPI_SUM, lmp->world);
  if (all == 0) return;
  const std::string group = lmp->group->names[fix.igroup];
  warn_once(lmp, told,
            name_of(fix) + ": " + std::to_string(all) +
                " of its particles go on moving as they do; to stop them say 'velocity " + group +
                " set 0 0 0' and 'set group " + group + " omegax 0 omegay 0 omegaz 0'");
}

void check_fix(LAMMPS* lmp, Fix* fix, std::set<std::string>* told) {
  refuse_fix(lmp, fix->style);
  for (const Rule& rule : kSpherical)
    if (starts_with(fix->style, rule.prefix))
      warn_once(lmp, told,
                name_of(*fix) + " goes on with the " + rule.instead + " of the particles' bounding spheres");
  if (fix->rad_mass_vary_flag)
    fail_all(FLERR, lmp,
             name_of(*fix) +
                 " changes diameters as those of spheres; use 'set group .. nurbs/scale S' between runs");
  warn_idle_mesh(lmp, fix, told);
  warn_frozen_motion(lmp, *fix, told);
  check_integrator(lmp, *fix);
  check_insertion(lmp, fix);
  check_materials(lmp, fix);
}

// Fixes of a restart file that the input script doesn't name again by their IDs and styles; of meshes only
// where there are such as are missed.
void warn_lost_fixes(LAMMPS* lmp, std::set<std::string>* told) {
  Modify& modify = *lmp->modify;
  bool meshes = false, new_meshes = false;
  for (int k = 0; k < modify.nfix; ++k) {
    if (dynamic_cast<FixMeshSurface*>(modify.fix[k]) == nullptr) continue;
    meshes = true;
    new_meshes |= !modify.have_restart_data(modify.fix[k]);
  }
  struct Lost {
    const char *style, *what, *missed;
    bool matters;
  };
  const Lost losses[] = {
      {"wall/nurbs", "contacts of", "a wall of another ID starts without them", true},
      {"move/mesh", "the motion of", "its mesh stands still, or begins a motion of another ID anew", meshes},
      {"mesh/surface", "the place of", "a mesh of another ID or style starts where its file has it",
       new_meshes}};
  for (const Lost& lost : losses)
    for (int k = 0; lost.matters; ++k) {
      char* id = modify.id_restart_data_global_style(lost.style, k);
      if (id == nullptr) break;
      const int here = modify.find_fix(id);
      if (here < 0 || !modify.have_restart_data(modify.fix[here]))
        warn_once(lmp, told,
                  std::string("The restart file holds ") + lost.what + " fix " + lost.style + " " + id +
                      ", which there is no longer: " + lost.missed);
    }
}

}  // namespace

void refuse_pair_style(LAMMPS* lmp) {
  fail_all(FLERR, lmp,
           std::string("atom_style nurbs needs pair_style gran/nurbs; pair_style ") + lmp->force->pair_style +
               " takes the particles for spheres");
}

bool is_refused_fix(const std::string& style) {
  return std::any_of(std::begin(kRefused), std::end(kRefused),
                     [&](const Rule& rule) { return starts_with(style.c_str(), rule.prefix); });
}

void refuse_fix(LAMMPS* lmp, const char* style) {
  for (const Rule& rule : kRefused)
    if (starts_with(style, rule.prefix))
      fail_all(FLERR, lmp,
               std::string("Fix ") + style + " can't be used with atom_style nurbs" + rule.instead);
}

void check_stl(LAMMPS* lmp, const char* style, const char* id, const char* file) {
  int cut = 0;
  if (lmp->comm->me == 0) {
    std::ifstream stream(file);
    std::string line, last;
    bool facets = false;
    for (int count = 0; std::getline(stream, line); ++count) {
      std::string word;  // of the line, in small letters, without blanks
      for (const char c : line)
        if (std::isspace(static_cast<unsigned char>(c)) == 0)
          word += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
      if (word.empty()) continue;
      if (count == 0 && !starts_with(word.c_str(), "solid")) break;
      if (starts_with(word.c_str(), "facet")) facets = true;
      last = word;
    }
    // A binary file's header may begin with 'solid' too, but has no lines of facets.
    cut = facets && !starts_with(last.c_str(), "endsolid");
  }
  MPI_Bcast(&cut, 1, MPI_INT, 0, lmp->world);
  if (cut != 0)
    fail_all(FLERR, lmp,
             std::string("Fix ") + style + " " + id + ": STL file " + file +
                 " does not end with endsolid; it must be whole");
}

void check_host(LAMMPS* lmp, std::set<std::string>* told) {
  check_settings(lmp);
  warn_default_step(lmp, told);
  check_pair_style(lmp, told);
  for (int k = 0; k < lmp->modify->nfix; ++k) check_fix(lmp, lmp->modify->fix[k], told);
  warn_no_integrator(lmp, told);
  warn_lost_fixes(lmp, told);
}

}  // namespace LAMMPS_NS::nurbs_host

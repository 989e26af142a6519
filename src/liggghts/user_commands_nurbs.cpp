// See user_commands_nurbs.h.
#include "liggghts/user_commands_nurbs.h"

#include <algorithm>
#include <climits>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <string>

#include "atom.h"
#include "comm.h"
#include "create_atoms.h"
#include "delete_atoms.h"
#include "displace_atoms.h"
#include "domain.h"
#include "force.h"
#include "group.h"
#include "liggghts/atom_vec_nurbs.h"
#include "liggghts/body_setter.h"
#include "liggghts/fix_contact_history_nurbs.h"
#include "liggghts/fix_template_nurbs.h"
#include "liggghts/host_error.h"
#include "liggghts/nurbs_contact.h"
#include "liggghts/pair_gran_nurbs.h"
#include "modify.h"
#include "read_dump.h"
#include "region.h"
#include "replicate.h"
#include "set.h"

namespace LAMMPS_NS {

using nurbs_host::fail_all;

AtomVecNurbs* UserCommandNurbs::bodies() const {
  return dynamic_cast<AtomVecNurbs*>(atom->avec);
}

// The owned particles that `set KIND WHICH` means.
std::vector<int> SetNurbs::chosen(const char* kind, char* which) const {
  std::vector<int> list;
  const std::string word = kind;
  const auto take = [&](auto is_meant) {
    for (int i = 0; i < atom->nlocal; ++i)
      if (is_meant(i)) list.push_back(i);
  };
  int low = 0, high = 0;
  if (word == "atom") {
    force->bounds(which, INT_MAX, low, high);
    take([&](int i) { return low <= atom->tag[i] && atom->tag[i] <= high; });
  } else if (word == "type") {
    force->bounds(which, atom->ntypes, low, high);
    take([&](int i) { return low <= atom->type[i] && atom->type[i] <= high; });
  } else if (word == "group") {
    const int number = group->find(which);
    if (number < 0) fail_all(FLERR, lmp, std::string("Set: there is no group ") + which);
    take([&](int i) { return atom->mask[i] & group->bitmask[number]; });
  } else if (word == "region") {
    const int number = domain->find_region(which);
    if (number < 0) fail_all(FLERR, lmp, std::string("Set: there is no region ") + which);
    domain->regions[number]->init();
    take([&](int i) { return domain->regions[number]->match(atom->x[i][0], atom->x[i][1], atom->x[i][2]); });
  } else {
    fail_all(FLERR, lmp, "Set: " + word + " must be one of atom type group region");
  }
  return list;
}

// Values that the host refuses by a line from every rank that has such particles.
void SetNurbs::check_value(const char* word, const char* text) const {
  if (std::strncmp(text, "v_", 2) == 0) return;
  if (std::strcmp(word, "mass") == 0) nurbs_host::parse_positive(lmp, "Set: mass", text);
  if (std::strcmp(word, "type") == 0) nurbs_host::parse_atom_type(lmp, "Set: type", text);
}

// Words between ours go to the host's command as they are.
void SetNurbs::command(int narg, char** arg) {
  const auto host = [&](int first, int end) {
    if (first == end && first > 2) return;
    std::vector<char*> words = {arg[0], arg[1]};
    words.insert(words.end(), arg + first, arg + end);
    Set(lmp).command(static_cast<int>(words.size()), words.data());
    bodies()->follow_set_commands();  // before ours make radius and mass of scale and density
  };
  if (bodies() == nullptr || domain->box_exist == 0 || atom->natoms == 0 || narg < 3)
    return Set(lmp).command(narg, arg);
  BodySetter setter(lmp, "Set", "nurbs/");
  int done = 2;
  for (int k = 2; k < narg;) {
    if (std::strncmp(arg[k], "nurbs/", 6) == 0 && setter.length(arg[k]) == 0)
      fail_all(FLERR, lmp,
               std::string("Set: unknown keyword ") + arg[k] + "; NURBS particles have " + setter.words());
    for (const char* word :
         {"shape", "scale", "quaternion", "orientation"})  // the host's shape is that of ellipsoids
      if (std::strcmp(arg[k], word) == 0)
        fail_all(FLERR, lmp,
                 std::string("Set: ") + arg[k] + " can't be set; NURBS particles have " + setter.words());
    if (std::strncmp(arg[k], "property/atom", 13) == 0) break;  // all that follows is its
    if (k + 1 < narg) check_value(arg[k], arg[k + 1]);
    const int length = setter.length(arg[k]);
    if (length == 0) {
      ++k;
      continue;
    }
    if (done < k) host(done, k);
    const std::vector<int> particles = chosen(arg[0], arg[1]);
    setter.apply(narg - k, arg + k, particles);
    int mine = static_cast<int>(particles.size()), all = 0;
    MPI_Allreduce(&mine, &all, 1, MPI_INT, MPI_SUM, world);
    if (comm->me == 0)
      for (FILE* stream : {screen, logfile})
        if (stream != nullptr) std::fprintf(stream, "  %d settings made for %s\n", all, arg[k]);
    k += length;
    done = k;
  }
  if (done < narg) host(done, narg);
}

// The host's command ends with particles on other ranks: first the turn.
void DisplaceAtomsNurbs::command(int narg, char** arg) {
  if (bodies() != nullptr && narg >= 9 && std::strcmp(arg[1], "rotate") == 0) {
    const int number = group->find(arg[0]);
    nurbs::Vec3 axis;
    for (int k = 0; k < 3; ++k)
      axis[k] = nurbs_host::parse_number(lmp, "Displace_atoms rotate: axis", arg[5 + k]);
    const double angle = nurbs_host::parse_number(lmp, "Displace_atoms rotate: angle", arg[8]) * M_PI / 180;
    if (number >= 0 && axis.stableNorm() > 0 && modify->nfix_restart_peratom == 0) {
      const nurbs::Quat turn(Eigen::AngleAxisd(angle, axis.stableNormalized()));
      for (int i = 0; i < atom->nlocal; ++i)
        if (atom->mask[i] & group->bitmask[number]) bodies()->turn(i, turn);
    }
  }
  DisplaceAtoms(lmp).command(narg, arg);
}

void CreateAtomsNurbs::command(int narg, char** arg) {
  if (bodies() == nullptr) return CreateAtoms(lmp).command(narg, arg);
  std::vector<char*> host;
  FixTemplateNurbs* model = nullptr;
  for (int k = 0; k < narg; ++k) {
    if (std::strcmp(arg[k], "template") != 0) {
      host.push_back(arg[k]);
      continue;
    }
    if (k + 1 == narg)
      fail_all(FLERR, lmp, "Create_atoms: keyword template needs the ID of a fix particletemplate/nurbs");
    const int number = modify->find_fix(arg[++k]);
    model = number < 0 ? nullptr : dynamic_cast<FixTemplateNurbs*>(modify->fix[number]);
    if (model == nullptr)
      fail_all(FLERR, lmp,
               std::string("Create_atoms: template ") + arg[k] + " is no fix particletemplate/nurbs");
  }
  const int before = atom->nlocal;
  CreateAtoms(lmp).command(static_cast<int>(host.size()), host.data());
  if (model == nullptr) return bodies()->density_wanted();
  for (int i = before; i < atom->nlocal; ++i) model->make(i);
}

// History goes by IDs. So these are compressed here, in their order, which says which body of a pair is A;
// the host's own way numbers by place in memory.
void DeleteAtomsNurbs::command(int narg, char** arg) {
  if (bodies() == nullptr) return DeleteAtoms(lmp).command(narg, arg);
  std::vector<char*> words(arg, arg + narg);
  bool compress = true;
  for (int k = 2; k + 1 < narg; ++k)
    if (std::strcmp(arg[k], "compress") == 0) compress = std::strcmp(arg[k + 1], "no") != 0;
  char keyword[] = "compress", no[] = "no";
  PairGranNurbs* pair = PairGranNurbs::find(lmp);
  const bool goes_on = pair != nullptr && pair->as_at_end();
  words.insert(words.end(), {keyword, no});
  DeleteAtoms(lmp).command(narg + 2, words.data());

  int mine = atom->nlocal, ranks = comm->nprocs;
  std::vector<int> counts(ranks), starts(ranks, 0), alive(atom->natoms);
  MPI_Allgather(&mine, 1, MPI_INT, counts.data(), 1, MPI_INT, world);
  for (int k = 1; k < ranks; ++k) starts[k] = starts[k - 1] + counts[k - 1];
  MPI_Allgatherv(atom->tag, mine, MPI_INT, alive.data(), counts.data(), starts.data(), MPI_INT, world);
  std::sort(alive.begin(), alive.end());
  if (auto* history =
          dynamic_cast<FixContactHistoryNurbs*>(modify->find_fix_style_strict("contacthistory", 0)))
    history->follow_ids(alive, compress);
  for (int i = 0; i < mine && compress; ++i) {
    const auto place = std::lower_bound(alive.begin(), alive.end(), atom->tag[i]);
    atom->tag[i] = 1 + static_cast<int>(place - alive.begin());
  }
  if (compress && atom->map_style) {
    atom->map_init();
    atom->map_set();
  }
  if (goes_on) pair->end_run();  // for those that are left, the next run is one with the last
}

void ReplicateNurbs::command(int narg, char** arg) {
  if (bodies() != nullptr)
    fail_all(FLERR, lmp,
             "Replicate can't be used with atom_style nurbs: write_data, and read copies with read_data");
  Replicate(lmp).command(narg, arg);
}

void ReadDumpNurbs::command(int narg, char** arg) {
  if (bodies() != nullptr)
    fail_all(FLERR, lmp,
             "Read_dump can't be used with atom_style nurbs: it sets no orientations; use read_data or "
             "read_restart");
  ReadDump(lmp).command(narg, arg);
}

}  // namespace LAMMPS_NS

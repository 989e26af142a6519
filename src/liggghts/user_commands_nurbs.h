// Commands of the host that do more, or less, with NURBS particles; with other atom styles they are the
// host's.
//   set atom|type|group|region WHICH [nurbs/shape NAME] [nurbs/scale S] [quat QX QY QZ ANGLE] [quat/random
//   SEED]
//       [density D] [the host's keywords]
//   displace_atoms GROUP rotate ...             turns the particles too
//   create_atoms TYPE ... [template ID]         as fix particletemplate/nurbs ID draws them
//   delete_atoms ...                            contacts keep their history, whatever IDs become
//   replicate, read_dump                        are refused: orientation, contacts or count would go wrong
// The host's make takes the last style of a name, in the order of the files' names: this one's is late.
#ifdef COMMAND_CLASS

CommandStyle(set, SetNurbs) CommandStyle(displace_atoms, DisplaceAtomsNurbs)
    CommandStyle(create_atoms, CreateAtomsNurbs) CommandStyle(replicate, ReplicateNurbs)
        CommandStyle(read_dump, ReadDumpNurbs) CommandStyle(delete_atoms, DeleteAtomsNurbs)

#else

#ifndef LMP_USER_COMMANDS_NURBS_H
#define LMP_USER_COMMANDS_NURBS_H

#include <vector>

#include "pointers.h"

namespace LAMMPS_NS {

class AtomVecNurbs;

class UserCommandNurbs : protected Pointers {
 public:
  explicit UserCommandNurbs(LAMMPS* lmp) : Pointers(lmp) {}

 protected:
  AtomVecNurbs* bodies() const;  // nullptr with another atom style
};

class SetNurbs : public UserCommandNurbs {
 public:
  using UserCommandNurbs::UserCommandNurbs;
  void command(int narg, char** arg);

 private:
  void check_value(const char* word, const char* text) const;
  std::vector<int> chosen(const char* kind, char* which) const;
};

class DisplaceAtomsNurbs : public UserCommandNurbs {
 public:
  using UserCommandNurbs::UserCommandNurbs;
  void command(int narg, char** arg);
};

class CreateAtomsNurbs : public UserCommandNurbs {
 public:
  using UserCommandNurbs::UserCommandNurbs;
  void command(int narg, char** arg);
};

class DeleteAtomsNurbs : public UserCommandNurbs {
 public:
  using UserCommandNurbs::UserCommandNurbs;
  void command(int narg, char** arg);
};

class ReplicateNurbs : public UserCommandNurbs {
 public:
  using UserCommandNurbs::UserCommandNurbs;
  void command(int narg, char** arg);
};

class ReadDumpNurbs : public UserCommandNurbs {
 public:
  using UserCommandNurbs::UserCommandNurbs;
  void command(int narg, char** arg);
};

}  // namespace LAMMPS_NS

#endif
#endif

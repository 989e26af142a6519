// The words by which an input script changes the shape, scale, orientation and density of particles that are
// there: of the commands set and create_atoms, and of fix set/nurbs.
#pragma once

#include <string>
#include <vector>

#include "liggghts/atom_vec_nurbs.h"
#include "pointers.h"

namespace LAMMPS_NS {

class BodySetter : protected Pointers {
 public:
  // `user` opens the error messages; `prefix` stands before the words shape and scale.
  BodySetter(LAMMPS* lmp, const std::string& user, const std::string& prefix);

  // How many words the keyword takes, itself included; 0 when it is none of these:
  //   shape NAME, scale S, quat QX QY QZ ANGLE (axis, degrees), quat/random SEED, density D.
  // S, D and the four of quat may be variables (v_NAME), of the kinds equal or atom.
  int length(const char* word) const;

  // Does what `arg` (`length` words, of which there are `narg`) says to the owned particles `chosen`. Ends
  // the run, with one line, when it can't be done; then nothing has changed. Collective.
  void apply(int narg, char** arg, const std::vector<int>& chosen);

  // The words, for messages.
  std::string words() const;

 private:
  std::vector<double> values(const char* text, const std::vector<int>& chosen, bool positive,
                             const std::string& what);

  std::string user_, prefix_;
  AtomVecNurbs& bodies_;
};

}  // namespace LAMMPS_NS

// The shapes of a simulation, as `atom_style nurbs` names them: shape number 1..count() in the order of the
// files. Every rank holds all of them; rank 0 keeps the text of their files, so that a restart file carries
// them.
#pragma once

#include <memory>
#include <string>
#include <unordered_map>
#include <vector>

#include "body/shape.h"
#include "lmptype.h"
#include "motion/rotor.h"
#include "pointers.h"

namespace LAMMPS_NS {

class ShapeLibrary : protected Pointers {
 public:
  explicit ShapeLibrary(LAMMPS* lmp) : Pointers(lmp) {}

  // Rank 0 reads the files; each rank makes its share of the shapes and gives them to the others. Collective.
  // A file that can't be read or is not a shape ends the run with one line naming it; repairs are warnings.
  void read_files(const std::vector<std::string>& files);

  // Writes all shapes to a restart file / reads them back. Writing: rank 0 only; reading: collective, `file`
  // open on rank 0 only.
  void write_restart(FILE* file) const;
  void read_restart(FILE* file);

  int count() const { return static_cast<int>(shapes_.size()); }

  // The shape of this number, 1..count(); not checked.
  const nurbs::Shape* shape(int number) const { return shapes_[number - 1].get(); }

  // The constants of its rotation, per mass and square of scale.
  const nurbs::Rotor& rotor(int number) const { return rotors_[number - 1]; }

  // The number of the first shape of this name, or 0 when there is none.
  int number_of(const std::string& name) const;

  // The same; ends the run, naming what there is, when there is none. `user` opens the message. Collective.
  int require(const std::string& user, const std::string& name) const;

 private:
  struct Source {
    std::string name;  // of the shape: the file's stem
    std::string file;  // as the user gave it, to word errors
    std::string text;  // the file's content; after build() on rank 0 only
  };

  std::string read_sources(const std::vector<std::string>& files);
  void share_sources();
  struct Made {
    std::shared_ptr<const nurbs::Shape> shape;
    std::vector<std::string> warnings;
    std::string failure;  // what is wrong with the file
  };
  std::vector<std::size_t> first_of_content() const;
  std::vector<int> deal(const std::vector<std::size_t>& first) const;
  std::vector<Made> make(const std::vector<std::size_t>& mine, bool mapped) const;
  void pass_on(int maker, Made& made) const;
  void build();

  std::vector<Source> sources_;
  std::vector<std::shared_ptr<const nurbs::Shape>> shapes_;
  std::vector<nurbs::Rotor> rotors_;
  std::unordered_map<std::string, int> numbers_;  // of the first shape of each name
};

}  // namespace LAMMPS_NS

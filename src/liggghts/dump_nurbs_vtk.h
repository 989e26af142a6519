// dump ID group nurbs/vtk N FILE-*.vtu: the exact surfaces of all particles of the group, one file per
// snapshot, and FILE.pvd, the list of snapshots with their times that ParaView opens as an animation.
#ifdef DUMP_CLASS

// clang-format off
DumpStyle(nurbs/vtk,DumpNurbsVtk)
// clang-format on

#else

#ifndef LMP_DUMP_NURBS_VTK_H
#define LMP_DUMP_NURBS_VTK_H

#include <functional>
#include <iosfwd>
#include <string>
#include <utility>
#include <vector>

#include "dump.h"
#include "io/vtu_file.h"

namespace LAMMPS_NS {

class DumpNurbsVtk : public Dump {
 public:
  DumpNurbsVtk(LAMMPS* lmp, int narg, char** arg);

  // Gathers the particles on rank 0, which writes them in the order of their ids. A file appears under its
  // name only when it is complete.
  void write() override;

 protected:
  void init_style() override;
  void write_header(bigint) override {}
  void pack(int* ids) override;
  void write_data(int n, double* particles) override;

 private:
  void read_film();
  void continue_film();
  bigint step_of(const std::string& file) const;
  void save_snapshot();
  void save(const std::string& file, const std::function<void(std::ostream&)>& content);

  std::string file_before_star_, file_after_star_;
  std::vector<nurbs::VtuBody> bodies_;                      // rank 0: gathered so far
  std::vector<std::pair<double, std::string> > snapshots_;  // rank 0: (time, file name without its folder)
  double earlier_time_ = 0;  // of the film, before the host began to count anew
};

}  // namespace LAMMPS_NS

#endif
#endif

// compute nurbs/atom. See compute_nurbs_atom.h.
#include "liggghts/compute_nurbs_atom.h"

#include <string>

#include "atom.h"
#include "liggghts/atom_vec_nurbs.h"
#include "liggghts/host_error.h"
#include "memory.h"
#include "update.h"

namespace LAMMPS_NS {

namespace {

constexpr const char* kNames[] = {"qw", "qx", "qy", "qz", "shape", "scale", "volume", "mass"};

}  // namespace

ComputeNurbsAtom::ComputeNurbsAtom(LAMMPS* lmp, int& iarg, int narg, char** arg)
    : Compute(lmp, iarg, narg, arg) {
  for (; iarg < narg; ++iarg) columns_.push_back(parse(lmp, arg[iarg]));
  if (columns_.empty())
    nurbs_host::fail_all(FLERR, lmp,
                         "Compute nurbs/atom needs names out of qw qx qy qz shape scale volume mass");
  vector_atom = nullptr;
  array_atom = nullptr;
  peratom_flag = 1;
  size_peratom_cols = columns_.size() == 1 ? 0 : static_cast<int>(columns_.size());
  AtomVecNurbs::require(lmp, "Compute nurbs/atom");
}

ComputeNurbsAtom::~ComputeNurbsAtom() {
  memory->destroy(vector_atom);
  memory->destroy(array_atom);
}

ComputeNurbsAtom::Value ComputeNurbsAtom::parse(LAMMPS* lmp, const char* name) {
  for (int k = 0; k < 8; ++k)
    if (name == std::string(kNames[k])) return static_cast<Value>(k);
  nurbs_host::fail_all(
      FLERR, lmp,
      std::string("Compute nurbs/atom: ") + name + " must be one of qw qx qy qz shape scale volume mass");
}

void ComputeNurbsAtom::init() {
  AtomVecNurbs::require(lmp, "Compute nurbs/atom");
}

// Room for all owned particles, one vector or one array as the host expects by the number of columns.
void ComputeNurbsAtom::grow() {
  if (atom->nlocal <= rows_) return;
  rows_ = atom->nmax;
  if (columns_.size() == 1)
    memory->grow(vector_atom, rows_, "nurbs/atom:vector");
  else
    memory->grow(array_atom, rows_, static_cast<int>(columns_.size()), "nurbs/atom:array");
}

double ComputeNurbsAtom::value(Value which, int i) const {
  const auto& bodies = static_cast<const AtomVecNurbs&>(*atom->avec);
  switch (which) {
    case Value::shape:
      return atom->shapetype[i];
    case Value::scale:
      return bodies.scale(i);
    case Value::volume:
      return atom->rmass[i] / atom->density[i];
    case Value::mass:
      return atom->rmass[i];
    default:
      return atom->quaternion[i][static_cast<int>(which)];
  }
}

void ComputeNurbsAtom::compute_peratom() {
  invoked_peratom = update->ntimestep;
  grow();
  for (int i = 0; i < atom->nlocal; ++i) {
    const bool selected = atom->mask[i] & groupbit;
    for (std::size_t k = 0; k < columns_.size(); ++k) {
      double& target = columns_.size() == 1 ? vector_atom[i] : array_atom[i][k];
      target = selected ? value(columns_[k], i) : 0;
    }
  }
}

double ComputeNurbsAtom::memory_usage() {
  return static_cast<double>(rows_ * columns_.size() * sizeof(double));
}

}  // namespace LAMMPS_NS

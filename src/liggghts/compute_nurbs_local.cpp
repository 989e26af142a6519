// See compute_nurbs_local.h.
#include "liggghts/compute_nurbs_local.h"

#include <string>

#include "liggghts/fix_wall_nurbs.h"
#include "liggghts/host_error.h"
#include "liggghts/pair_gran_nurbs.h"
#include "update.h"

namespace LAMMPS_NS {

using nurbs_host::ContactRow;

ComputeNurbsLocal::ComputeNurbsLocal(LAMMPS* lmp, int& iarg, int narg, char** arg)
    : Compute(lmp, iarg, narg, arg) {
  AtomVecNurbs::require(lmp, "Compute nurbs/local");
  for (; iarg < narg; ++iarg) columns_.push_back(parse(lmp, arg[iarg]));
  if (columns_.empty())
    nurbs_host::fail_all(
        FLERR, lmp,
        "Compute nurbs/local needs names out of id1 id2 gap nx ny nz px py pz fnx fny fnz ftx fty ftz");
  local_flag = 1;
  size_local_rows = 0;
  size_local_cols = columns_.size() == 1 ? 0 : static_cast<int>(columns_.size());
  resize(0);
}

ComputeNurbsLocal::~ComputeNurbsLocal() {
  vector_local = nullptr;
  array_local = nullptr;
}

int ComputeNurbsLocal::parse(LAMMPS* lmp, const char* name) {
  for (int k = 0; k < ContactRow::size; ++k)
    if (std::string(name) == ContactRow::name(k)) return k;
  nurbs_host::fail_all(FLERR, lmp,
                       std::string("Compute nurbs/local: ") + name +
                           " must be one of id1 id2 gap nx ny nz px py pz fnx fny fnz ftx fty ftz");
}

// The host reads a vector for one column, else rows by pointers.
void ComputeNurbsLocal::resize(int rows) {
  const size_t width = columns_.size();
  size_local_rows = rows;
  values_.resize(rows * width + 1);
  rows_.resize(rows + 1);
  for (int r = 0; r <= rows; ++r) rows_[r] = values_.data() + r * width;
  vector_local = values_.data();
  array_local = rows_.data();
}

void ComputeNurbsLocal::compute_local() {
  invoked_local = update->ntimestep;
  contacts_.clear();
  if (const PairGranNurbs* pair = PairGranNurbs::find(lmp)) pair->append_rows(groupbit, contacts_);
  for (const FixWallNurbs* wall : FixWallNurbs::all(lmp)) wall->append_rows(groupbit, contacts_);
  resize(static_cast<int>(contacts_.size()));
  double* value = values_.data();
  for (const ContactRow& contact : contacts_)
    for (const int column : columns_) *value++ = contact.value[column];
}

double ComputeNurbsLocal::memory_usage() {
  return static_cast<double>(values_.capacity() * sizeof(double) + contacts_.capacity() * sizeof(ContactRow));
}

}  // namespace LAMMPS_NS

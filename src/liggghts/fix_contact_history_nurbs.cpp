// See fix_contact_history_nurbs.h.
#include "liggghts/fix_contact_history_nurbs.h"

#include <algorithm>

#include "atom.h"
#include "comm.h"
#include "force.h"
#include "liggghts/nurbs_contact.h"
#include "liggghts/pair_gran_nurbs.h"
#include "modify.h"
#include "neigh_list.h"
#include "neighbor.h"

namespace LAMMPS_NS {

namespace {

constexpr int kTouching = 1, kRemembers = 2;

// The host looks for a pair style named exactly "gran" and uses what it finds unchecked. For the time of that
// call the pair style bears that name.
class BorrowedName {
 public:
  explicit BorrowedName(Force* force) : force_(force), own_(force->pair_style) { force_->pair_style = gran_; }
  ~BorrowedName() { force_->pair_style = own_; }
  BorrowedName(const BorrowedName&) = delete;
  BorrowedName& operator=(const BorrowedName&) = delete;

 private:
  Force* force_;
  char* own_;
  char gran_[5] = "gran";
};

}  // namespace

bool FixContactHistoryNurbs::serves_nurbs() const {
  return dynamic_cast<PairGranNurbs*>(force->pair) != nullptr;
}

void FixContactHistoryNurbs::init() {
  if (!serves_nurbs()) return FixContactHistory::init();
  const BorrowedName gran(force);
  FixContactHistory::init();
}

// As the host's, but the room for history grows with its length: the host's fixed page would be shorter than
// one particle's longest history.
void FixContactHistoryNurbs::allocate_pages() {
  if (ipage_ != nullptr && pgsize_ == neighbor->pgsize && oneatom_ == neighbor->oneatom) return;
  delete[] ipage_;
  delete[] dpage_;
  pgsize_ = neighbor->pgsize;
  oneatom_ = neighbor->oneatom;
  ipage_ = new MyPage<int>[comm->nthreads];
  dpage_ = new MyPage<double>[comm->nthreads];
  const int length = std::max(1, dnum_);
  for (int i = 0; i < comm->nthreads; ++i) {
    ipage_[i].init(oneatom_, pgsize_);
    dpage_[i].init(oneatom_ * length, pgsize_ * length);
  }
}

// Calls flag(contact flag, history) for every neighbour pair.
template <class Flag>
void FixContactHistoryNurbs::for_each_neighbour(Flag flag) const {
  const NeighList* list = pair_gran_->list;
  for (int ii = 0; ii < list->inum; ++ii) {
    const int i = list->ilist[ii];
    int* flags = list->listgranhistory->firstneigh[i];
    double* history = list->listgranhistory->firstdouble[i];
    for (int jj = 0; jj < list->numneigh[i]; ++jj)
      flag(flags[jj], history + static_cast<std::size_t>(jj) * dnum_);
  }
}

// The host keeps what has a contact flag. The flag must mean contact to all else, so it is raised for this
// call only.
void FixContactHistoryNurbs::pre_exchange() {
  if (!serves_nurbs()) return FixContactHistory::pre_exchange();
  for_each_neighbour([this](int& flag, const double* history) {
    if (std::any_of(history, history + dnum_, [](double value) { return value != 0; })) flag |= kRemembers;
  });
  FixContactHistory::pre_exchange();
  for_each_neighbour([](int& flag, const double*) { flag &= kTouching; });
  // The host takes the maximum over fixes of what one particle sends; walls send theirs beside this.
  const int walls = modify->n_fixes_style("wall/nurbs");
  comm->maxexchange_fix =
      std::max(comm->maxexchange_fix, (dnum_ + 1) * maxtouch_ + 1 + walls * nurbs_host::kHistorySize);
}

void FixContactHistoryNurbs::setup_pre_exchange() {
  if (computeflag_ != nullptr && *computeflag_) pre_exchange();
}

// The host's restarts within a run hold per-particle history of the last reneighbouring; this one is of this
// step.
void FixContactHistoryNurbs::write_restart(FILE* file) {
  setup_pre_exchange();
  double mine[2] = {dissipated_.damping, dissipated_.friction}, all[2] = {0, 0};
  MPI_Reduce(mine, all, 2, MPI_DOUBLE, MPI_SUM, 0, world);
  if (comm->me != 0) return;
  const double list[] = {static_cast<double>(dnum_), static_cast<double>(maxtouch_), all[0], all[1]};
  const int size = sizeof list;
  std::fwrite(&size, sizeof size, 1, file);
  std::fwrite(list, sizeof list, 1, file);
}

void FixContactHistoryNurbs::restart(char* buffer) {
  FixContactHistory::restart(buffer);
  const double* list = reinterpret_cast<const double*>(buffer);
  dissipated_ = nurbs::EnergyLedger{};
  if (comm->me != 0) return;
  dissipated_.damping = list[2];
  dissipated_.friction = list[3];
}

}  // namespace LAMMPS_NS

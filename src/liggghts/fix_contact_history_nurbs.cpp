// See fix_contact_history_nurbs.h.
#include "liggghts/fix_contact_history_nurbs.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include "atom.h"
#include "comm.h"
#include "force.h"
#include "liggghts/fix_wall_nurbs.h"
#include "liggghts/host_rules.h"
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

PairGranNurbs* FixContactHistoryNurbs::pair() const {
  return dynamic_cast<PairGranNurbs*>(force->pair);
}

// Whoever comes between this run and the next (delete_atoms, another pair_style) finds what is remembered
// here.
void FixContactHistoryNurbs::post_run() {
  FixContactHistory::post_run();
  if (!serves_nurbs()) return;
  setup_pre_exchange();
  pair()->end_run();
  pair()->warn_deep_run();
}

nurbs::ContactPool& FixContactHistoryNurbs::pool() const {
  return pair()->stages().pool();
}

void FixContactHistoryNurbs::bequeath(Legacy legacy) {
  legacy_ = std::move(legacy);
  orphaned_ = true;
  pair_gran_ = nullptr;
  computeflag_ = nullptr;
}

int FixContactHistoryNurbs::n_history_extra() {
  if (orphaned_) nurbs_host::refuse_pair_style(lmp);
  return 0;
}

FixContactHistoryNurbs::Legacy FixContactHistoryNurbs::inherit() {
  orphaned_ = false;
  return std::exchange(legacy_, Legacy{});
}

void FixContactHistoryNurbs::forget_contacts() {
  for (int i = 0; i < atom->nlocal; ++i)
    for (int n = 0; n < npartner_[i]; ++n) proof(i, n).contact = 0;
}

void FixContactHistoryNurbs::follow_ids(const std::vector<int>& alive, bool compress) {
  const auto place = [&](int tag) {
    return static_cast<int>(std::lower_bound(alive.begin(), alive.end(), tag) - alive.begin());
  };
  const auto lives = [&](int tag) { return std::binary_search(alive.begin(), alive.end(), tag); };
  for (int i = 0; i < atom->nlocal; ++i) {
    int kept = 0;
    for (int n = 0; n < npartner_[i]; ++n) {
      const int tag = partner_[i][n];
      if (!lives(tag)) continue;
      proof(i, kept) = proof(i, n);
      partner_[i][kept++] = compress ? place(tag) + 1 : tag;
    }
    npartner_[i] = kept;
  }
}

// Of particle i and its partner number n.
nurbs::PairProof& FixContactHistoryNurbs::proof(int i, int n) const {
  return *reinterpret_cast<nurbs::PairProof*>(contacthistory_[i] + static_cast<std::size_t>(n) * dnum_);
}

void FixContactHistoryNurbs::init() {
  if (orphaned_) return;  // no pair style has come after gran/nurbs
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
  if (orphaned_) return;
  if (!serves_nurbs()) return FixContactHistory::pre_exchange();
  if (computeflag_ == nullptr || !*computeflag_) return;  // all is here; the lists may be of other particles
  for_each_neighbour([this](int& flag, double* history) {
    auto& proof = *reinterpret_cast<nurbs::PairProof*>(history);
    if (!pool().holds(proof.contact)) proof.contact = 0;
    flag = (proof.contact != 0 ? kTouching : 0) | (proof.stamp != 0 ? kRemembers : 0);
  });
  FixContactHistory::pre_exchange();
  for_each_neighbour([](int& flag, const double*) { flag &= kTouching; });
  ask_for_room();
}

// The host takes the maximum over fixes of what one particle sends; walls send theirs beside this.
void FixContactHistoryNurbs::ask_for_room() {
  int most = 0;
  for (int i = 0; i < atom->nlocal; ++i) most = std::max(most, contacts_size(i));
  for (FixWallNurbs* wall : FixWallNurbs::all(lmp)) most += wall->most_exchanged();
  comm->maxexchange_fix = std::max(comm->maxexchange_fix, (dnum_ + 1) * maxtouch_ + 1 + most);
}

void FixContactHistoryNurbs::setup_pre_exchange() {
  if (computeflag_ != nullptr && *computeflag_) pre_exchange();
  if (serves_nurbs()) ask_for_room();
}

void FixContactHistoryNurbs::recall(int i, int tag, nurbs::PairProof* to) const {
  for (int n = 0; n < npartner_[i]; ++n)
    if (partner_[i][n] == tag) {
      *to = proof(i, n);
      return;
    }
}

// Between the bodies' centres, from A to B, when a contact last touched; false if it did not.
bool FixContactHistoryNurbs::offset(std::int32_t contact, nurbs::Vec3* apart) const {
  nurbs::ContactPool& contacts = pool();
  if (!contacts.holds(contact)) return false;
  const nurbs::FlatContact* flat = contacts.flat(contact);
  const nurbs::ContactBlock& block = flat ? flat->points : contacts.block(contact);
  for (int lane = 0; lane < nurbs::kBlock; ++lane) {
    if (flat ? !(block.used >> lane & 1) : lane != nurbs::ContactPool::lane(contact)) continue;
    nurbs::ContactState state;
    block.get(lane, nurbs::kStateField, nurbs::kContactStateSize, &state);
    if (state.active == 0) continue;
    *apart = nurbs::load(state.arm_a) - nurbs::load(state.arm_b);
    return true;
  }
  return false;
}

// What is proven of the bodies holds for any image of theirs.
void FixContactHistoryNurbs::recall(int i, int tag, const nurbs::Vec3& way, double images_apart,
                                    nurbs::PairProof* to) const {
  double nearest = 0.25 * images_apart * images_apart, most = -1e300;
  bool touched = false;
  for (int n = 0; n < npartner_[i]; ++n) {
    if (partner_[i][n] != tag) continue;
    nurbs::Vec3 apart;
    const bool touches = offset(proof(i, n).contact, &apart);
    const double distance = touches ? (apart - way).squaredNorm() : 0;
    const double along = nurbs::load(proof(i, n).direction).dot(way);
    if (touches ? distance < nearest : !touched && along > most) {
      if (touches) nearest = distance, touched = true;
      most = along;
      *to = proof(i, n);
      if (!touches) to->contact = 0;
    }
  }
}

int FixContactHistoryNurbs::contacts_size(int i) const {
  int size = 0;
  for (int n = 0; n < npartner_[i]; ++n)
    if (pool().holds(proof(i, n).contact)) size += pool().packed_size(proof(i, n).contact);
  return size;
}

// The contacts of particle i, behind its proofs and in their order.
int FixContactHistoryNurbs::put_contacts(int i, double* buffer) const {
  int m = 0;
  for (int n = 0; n < npartner_[i]; ++n)
    if (pool().holds(proof(i, n).contact)) m += pool().pack(proof(i, n).contact, buffer + m);
  return m;
}

// A number of another rank's or run's pool means only that a contact follows.
int FixContactHistoryNurbs::get_contacts(int i, const double* buffer) {
  int m = 0;
  for (int n = 0; n < npartner_[i]; ++n) {
    if (proof(i, n).contact == 0) continue;
    int size = 0;
    proof(i, n).contact = pool().unpack(buffer + m, &size);
    m += size;
  }
  return m;
}

int FixContactHistoryNurbs::pack_exchange(int i, double* buffer) {
  const int m = FixContactHistory::pack_exchange(i, buffer);
  return serves_nurbs() ? m + put_contacts(i, buffer + m) : m;
}

int FixContactHistoryNurbs::unpack_exchange(int i, double* buffer) {
  const int m = FixContactHistory::unpack_exchange(i, buffer);
  return serves_nurbs() ? m + get_contacts(i, buffer + m) : m;
}

int FixContactHistoryNurbs::size_restart(int i) {
  const int size = FixContactHistory::size_restart(i);
  return serves_nurbs() ? size + contacts_size(i) : size;
}

int FixContactHistoryNurbs::maxsize_restart() {
  const int size = FixContactHistory::maxsize_restart();
  if (!serves_nurbs()) return size;
  int mine = 0, most = 0;
  for (int i = 0; i < atom->nlocal; ++i) mine = std::max(mine, contacts_size(i));
  MPI_Allreduce(&mine, &most, 1, MPI_INT, MPI_MAX, world);
  return size + most;
}

int FixContactHistoryNurbs::pack_restart(int i, double* buffer) {
  int m = FixContactHistory::pack_restart(i, buffer);
  if (serves_nurbs()) m += put_contacts(i, buffer + m);
  buffer[0] = m;
  return m;
}

void FixContactHistoryNurbs::unpack_restart(int i, int nth) {
  FixContactHistory::unpack_restart(i, nth);
  if (!serves_nurbs()) return;
  const double* values = atom->extra[i];
  for (int k = 0; k < nth; ++k) values += static_cast<int>(*values);
  get_contacts(i, values + 2 + static_cast<std::size_t>(dnum_ + 1) * npartner_[i]);
}

// The host's restarts within a run hold per-particle history of the last reneighbouring; this one is of this
// step.
void FixContactHistoryNurbs::write_restart(FILE* file) {
  setup_pre_exchange();
  const nurbs::EnergyLedger done = serves_nurbs() ? pair()->stages().dissipated() : nurbs::EnergyLedger{};
  double mine[2] = {done.damping, done.friction}, all[2] = {0, 0};
  MPI_Reduce(mine, all, 2, MPI_DOUBLE, MPI_SUM, 0, world);
  const std::uint64_t print = serves_nurbs() ? pair()->last_fingerprint() : 0;
  if (comm->me != 0) return;
  double list[] = {static_cast<double>(dnum_), static_cast<double>(maxtouch_), all[0], all[1], 0};
  std::memcpy(list + 4, &print, sizeof print);
  const int size = sizeof list;
  std::fwrite(&size, sizeof size, 1, file);
  std::fwrite(list, sizeof list, 1, file);
}

void FixContactHistoryNurbs::restart(char* buffer) {
  FixContactHistory::restart(buffer);
  if (!serves_nurbs()) return;
  const double* list = reinterpret_cast<const double*>(buffer);
  std::uint64_t print = 0;
  std::memcpy(&print, list + 4, sizeof print);
  pair()->go_on_from(print);
  nurbs::EnergyLedger& done = pair()->stages().dissipated();
  done = nurbs::EnergyLedger{};
  if (comm->me != 0) return;
  done.damping = list[2];
  done.friction = list[3];
}

}  // namespace LAMMPS_NS

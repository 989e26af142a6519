// Stage (a) of a step: what the contacts want to know of every body, computed once per body.
#pragma once

#include <cstdint>
#include <new>
#include <vector>

#include "contact/contact.h"
#include "nurbs/types.h"

namespace nurbs {

// Memory of whole cache lines, which vectors are read from.
template <class T>
struct LineAllocator {
  using value_type = T;
  LineAllocator() = default;
  template <class U>
  LineAllocator(const LineAllocator<U>&) {}
  T* allocate(std::size_t n) { return static_cast<T*>(::operator new(n * sizeof(T), std::align_val_t(64))); }
  void deallocate(T* p, std::size_t) { ::operator delete(p, std::align_val_t(64)); }
  bool operator==(const LineAllocator&) const { return true; }
  bool operator!=(const LineAllocator&) const { return false; }
};
template <class T>
using LineVector = std::vector<T, LineAllocator<T>>;

inline void prefetch_lines(const void* from, std::size_t size) {
  for (std::size_t at = 0; at < size; at += 64) __builtin_prefetch(static_cast<const char*>(from) + at);
}

// The bodies as a host holds them, owned ones first. Lab axes; `quaternion` w x y z turns shape axes into the
// lab's, unit. Arrays are contiguous, three (four) numbers a body.
struct BodyArrays {
  int count = 0;
  const double *x = nullptr, *velocity = nullptr, *spin = nullptr, *quaternion = nullptr;
  const double *mass = nullptr, *scale = nullptr, *radius = nullptr;
  const int* shape = nullptr;            // index into shapes
  const Shape* const* shapes = nullptr;  // by that index
  const int* mask = nullptr;             // group bits ...
  int immobile = 0;                      // ... of bodies that nothing moves
};

// One body, four cache lines: the first two say where it is, the others how it moves.
struct alignas(64) BodyRecord {
  double x[3];
  double turn[9];  // shape axes into lab axes, by rows
  double radius;   // of the bounding sphere; a wall's is kFarAway, as is `inner`
  double free;     // 1; 0 for a wall, whose contact normal is its own whatever touches it
  double flat;     // 1 if the body has flat features (body/flat_faces.h)
  double inner;    // radius of the largest ball inside about the centre of mass
  double velocity[3], spin[3], spin_before[3];  // see BodyMotion
  double inverse_mass, inverse_inertia[6];      // xx yy zz xy xz yz, lab
};
static_assert(sizeof(BodyRecord) == 32 * sizeof(double));

class Bodies {
 public:
  // Brings all records up to date. `dt`: how long before now spin_before is. `renumbered`: the bodies may be
  // others than at the last call.
  void update(const BodyArrays& arrays, double dt, bool renumbered);

  int count() const { return static_cast<int>(records_.size()); }
  const BodyRecord& record(int i) const { return records_[i]; }
  const BodyArrays& arrays() const { return arrays_; }
  // Asks for what particle(i) reads.
  void prefetch(int i) const {
    __builtin_prefetch(&records_[i]);
    __builtin_prefetch(&known_[i]);
  }
  Particle particle(int i) const {
    const Known& k = known_[i];
    return {k.shape, k.scale, Vec3::Map(records_[i].x), Quat(k.q[0], k.q[1], k.q[2], k.q[3])};
  }

  // A way that no point of the body has exceeded since the last renumbering, centre's path and turns
  // together.
  const double* path() const { return path_.data(); }
  // Name of shape and size for proofs (contact/proof.h).
  std::uint64_t stamp(int i) const { return known_[i].stamp; }
  // Whether some body has changed its shape or size since the last call of update.
  bool reshaped() const { return reshaped_; }
  std::size_t bytes() const;

 private:
  struct alignas(64) Known {
    double q[4];
    double scale;
    const Shape* shape;
    std::uint64_t stamp;
  };
  Particle read(int i) const;
  void update(int i, double dt, bool renumbered);

  BodyArrays arrays_;
  LineVector<BodyRecord> records_;
  LineVector<Known> known_;
  std::vector<double> path_;
  bool reshaped_ = false;
};

}  // namespace nurbs

// Where contacts live: eight side by side in a block, field by field, so that the stages take them as
// vectors. Only pairs that touch, or were not proven apart, own one.
#pragma once

#include <array>
#include <cstring>

#include "contact/pair_memory.h"
#include "laws/contact_law.h"
#include "scene/bodies.h"

namespace nurbs {

// A contact as it travels between ranks and into restarts: plain doubles. Curvature tensors of both bodies at
// the contact are the inverses of model.a's and model.b's W where model.unique > 0.
struct ContactRecord {
  LocalModel model;
  PointMemory on_a, on_b;  // of the last solve
  ContactState state;      // of the law
  double torque[3];        // of the law beside its force, on B, lab axes
  double weight;           // share of the pair's stiffness that this contact has
  double feature;          // which of the pair's contacts it is; 0: the only one
};
constexpr int kContactSize = kLocalModelSize + 10 + kContactStateSize + 5;
static_assert(sizeof(ContactRecord) == kContactSize * sizeof(double));
constexpr int kStateField = kLocalModelSize + 10;

constexpr int kBlock = 8;

// Eight contacts.
struct alignas(64) ContactBlock {
  double field[kContactSize][kBlock];  // ContactRecord, transposed
  PairProof* proof[kBlock];            // of the neighbour that the contact belongs to ...
  int neighbour[kBlock];               // ... and its number
  int a[kBlock], b[kBlock];            // bodies; a < 0: the wall
  int law[kBlock];
  int fresh[kBlock];       // 1 + number of a result of this step; 0: none
  std::uint32_t used = 0;  // a bit a contact

  void get(int lane, int first, int count, void* to) const {
    double* values = static_cast<double*>(to);
    for (int k = 0; k < count; ++k) values[k] = field[first + k][lane];
  }
  void set(int lane, int first, int count, const void* from) {
    const double* values = static_cast<const double*>(from);
    for (int k = 0; k < count; ++k) field[first + k][lane] = values[k];
  }
};
static_assert(sizeof(ContactBlock) <= kBlock * 640, "a contact's memory");

// Contacts by number, from 1; 0 is none. Numbers stay until the contact is freed or the pool exchanged.
class ContactPool {
 public:
  std::int32_t add() {
    if (free_.empty()) {
      blocks_.emplace_back();
      std::memset(static_cast<void*>(&blocks_.back()), 0, sizeof(ContactBlock));
      for (int lane = kBlock; lane-- > 0;)
        free_.push_back(static_cast<std::int32_t>(blocks_.size() - 1) * kBlock + lane + 1);
    }
    const std::int32_t number = free_.back();
    free_.pop_back();
    block(number).used |= 1u << lane(number);
    return number;
  }
  std::int32_t add(const ContactRecord& record) {
    const std::int32_t number = add();
    block(number).set(lane(number), 0, kContactSize, &record);
    return number;
  }
  void remove(std::int32_t number) {
    block(number).used &= ~(1u << lane(number));
    free_.push_back(number);
  }
  bool holds(std::int32_t number) const {
    return number > 0 && static_cast<std::size_t>(number) <= blocks_.size() * kBlock &&
           (blocks_[(number - 1) / kBlock].used >> lane(number) & 1);
  }
  ContactRecord get(std::int32_t number) const {
    ContactRecord record;
    blocks_[(number - 1) / kBlock].get(lane(number), 0, kContactSize, &record);
    return record;
  }
  void clear() {
    blocks_.clear();
    free_.clear();
  }

  ContactBlock& block(std::int32_t number) { return blocks_[(number - 1) / kBlock]; }
  static int lane(std::int32_t number) { return (number - 1) % kBlock; }
  LineVector<ContactBlock>& blocks() { return blocks_; }
  const LineVector<ContactBlock>& blocks() const { return blocks_; }
  std::size_t bytes() const { return blocks_.capacity() * sizeof(ContactBlock); }

 private:
  LineVector<ContactBlock> blocks_;
  std::vector<std::int32_t> free_;
};

}  // namespace nurbs

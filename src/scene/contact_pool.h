// Where contacts live: eight side by side in a block, field by field, so that the stages take them as
// vectors. Only pairs that touch, or were not proven apart, own one.
#pragma once

#include <array>
#include <cstring>

#include "contact/contact_polygon.h"
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
  double flat;             // 0: the pair's only contact is this one; else its contacts are those of a polygon
};
constexpr int kContactSize = kLocalModelSize + 10 + kContactStateSize + 5;
static_assert(sizeof(ContactRecord) == kContactSize * sizeof(double));
constexpr int kStateField = kLocalModelSize + 10;

constexpr int kWeight = kContactSize - 2, kFlat = kContactSize - 1;

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

// The contacts of a pair whose flat faces, creases or ruled lines meet: a block of their own, lane by lane
// the points of the polygon. It hangs on the pair's contact, whose own state of the law is then empty.
struct FlatContact {
  ContactPolygon polygon;
  double beyond;  // energy over kn that round faces hold beside the points' own
  ContactBlock points;
};
struct FlatRecord {  // as it travels
  ContactPolygon polygon;
  ContactState state[kBlock];
};
constexpr int kFlatSize = sizeof(FlatRecord) / sizeof(double);
constexpr int kMostContactSize = kContactSize + kFlatSize;
static_assert(kContactPoints <= kBlock && sizeof(FlatRecord) % sizeof(double) == 0);

// Contacts by number, from 1; 0 is none. Numbers stay until the contact is removed.
class ContactPool {
 public:
  std::int32_t add(const ContactRecord& record) {
    const std::int32_t number = take(blocks_, free_);
    block(number).set(lane(number), 0, kContactSize, &record);
    return number;
  }
  void remove(std::int32_t number) {
    drop_flat(number);
    block(number).used &= ~(1u << lane(number));
    free_.push_back(number);
  }
  bool holds(std::int32_t number) const {
    return number > 0 && static_cast<std::size_t>(number) <= blocks_.size() * kBlock &&
           (blocks_[(number - 1) / kBlock].used >> lane(number) & 1);
  }

  // The polygon of a contact, or nullptr.
  FlatContact* flat(std::int32_t number) { return flat_of(block(number), lane(number)); }
  FlatContact* flat_of(const ContactBlock& block, int lane) {
    const int index = static_cast<int>(block.field[kFlat][lane]);
    return index == 0 ? nullptr : &flats_[index - 1];
  }
  // Gives a contact a polygon, without points; pointers to others' polygons become invalid.
  FlatContact& add_flat(std::int32_t number) {
    if (free_flats_.empty()) {
      flats_.emplace_back();
      free_flats_.push_back(static_cast<int>(flats_.size()));
    }
    const int index = free_flats_.back();
    free_flats_.pop_back();
    block(number).field[kFlat][lane(number)] = index;
    std::memset(static_cast<void*>(&flats_[index - 1]), 0, sizeof(FlatContact));
    return flats_[index - 1];
  }
  void drop_flat(std::int32_t number) {
    double& index = block(number).field[kFlat][lane(number)];
    if (index == 0) return;
    flats_[static_cast<int>(index) - 1].points.used = 0;
    free_flats_.push_back(static_cast<int>(index));
    index = 0;
  }

  // A contact with all that hangs on it as plain doubles, at most kMostContactSize of them: how many. And
  // back: a new contact, and how many doubles it took.
  int pack(std::int32_t number, double* to) const {
    ContactRecord record;
    const ContactBlock& from = blocks_[(number - 1) / kBlock];
    from.get(lane(number), 0, kContactSize, &record);
    std::memcpy(to, &record, sizeof record);
    if (record.flat == 0) return kContactSize;
    const FlatContact& flat = flats_[static_cast<int>(record.flat) - 1];
    FlatRecord points;
    points.polygon = flat.polygon;
    for (int k = 0; k < kBlock; ++k) flat.points.get(k, kStateField, kContactStateSize, &points.state[k]);
    std::memcpy(to + kContactSize, &points, sizeof points);
    return kMostContactSize;
  }
  int packed_size(std::int32_t number) const {
    return blocks_[(number - 1) / kBlock].field[kFlat][lane(number)] == 0 ? kContactSize : kMostContactSize;
  }
  std::int32_t unpack(const double* from, int* size) {
    ContactRecord record;
    std::memcpy(&record, from, sizeof record);
    const bool has_flat = record.flat != 0;
    record.flat = 0;
    const std::int32_t number = add(record);
    *size = kContactSize;
    if (!has_flat) return number;
    FlatRecord points;
    std::memcpy(&points, from + kContactSize, sizeof points);
    FlatContact& flat = add_flat(number);
    flat.polygon = points.polygon;
    flat.points.used = (1u << points.polygon.count) - 1;
    for (int k = 0; k < kBlock; ++k) flat.points.set(k, kStateField, kContactStateSize, &points.state[k]);
    *size = kMostContactSize;
    return number;
  }

  ContactBlock& block(std::int32_t number) { return blocks_[(number - 1) / kBlock]; }
  static int lane(std::int32_t number) { return (number - 1) % kBlock; }
  LineVector<ContactBlock>& blocks() { return blocks_; }
  const LineVector<ContactBlock>& blocks() const { return blocks_; }
  const LineVector<FlatContact>& flats() const { return flats_; }
  std::size_t bytes() const {
    return blocks_.capacity() * sizeof(ContactBlock) + flats_.capacity() * sizeof(FlatContact);
  }

 private:
  static std::int32_t take(LineVector<ContactBlock>& blocks, std::vector<std::int32_t>& free) {
    if (free.empty()) {
      blocks.emplace_back();
      std::memset(static_cast<void*>(&blocks.back()), 0, sizeof(ContactBlock));
      for (int lane = kBlock; lane-- > 0;)
        free.push_back(static_cast<std::int32_t>(blocks.size() - 1) * kBlock + lane + 1);
    }
    const std::int32_t number = free.back();
    free.pop_back();
    blocks[(number - 1) / kBlock].used |= 1u << lane(number);
    return number;
  }

  LineVector<ContactBlock> blocks_;
  std::vector<std::int32_t> free_;
  LineVector<FlatContact> flats_;
  std::vector<int> free_flats_;
};

}  // namespace nurbs

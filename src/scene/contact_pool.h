// Where contacts live: eight side by side in a block, field by field, so that the stages take them as
// vectors. Only pairs that touch, or were not proven apart, own one.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <functional>
#include <utility>

#include "contact/pair_memory.h"
#include "contact/polygons/contact_polygon.h"
#include "laws/contact_model.h"
#include "scene/bodies.h"

namespace nurbs {

// A contact as it travels between ranks and into restarts: plain doubles. Curvature tensors of both bodies at
// the contact are the inverses of model.a's and model.b's W where model.unique > 0.
struct ContactRecord {
  LocalModel model;        // or what stands in its place: EllipsoidPair, DeepProof
  PointMemory on_a, on_b;  // of the last solve
  ContactState state;      // of the law
  double torque[3];        // of the law beside its force, on B, lab axes
  double weight;           // share of the pair's stiffness that this contact has
  double flat;             // 0: the pair's only contact is this one; else its contacts are those of a polygon
  double shift;            // length of the overlap in which it is not felt
};
constexpr int kContactSize = kLocalModelSize + 10 + kContactStateSize + 6;
static_assert(sizeof(ContactRecord) == kContactSize * sizeof(double));
constexpr int kStateField = kLocalModelSize + 10, kStateNormal = kStateField + 3;

constexpr int kWeight = kContactSize - 3, kFlat = kContactSize - 2, kShift = kContactSize - 1;

constexpr int kBlock = 8;

// Eight contacts.
struct alignas(64) ContactBlock {
  double field[kContactSize][kBlock];  // ContactRecord, transposed
  PairProof* proof[kBlock];            // of the neighbour that the contact belongs to ...
  int neighbour[kBlock];               // ... and its number
  int a[kBlock], b[kBlock];            // bodies; a < 0: the wall
  int law[kBlock];
  int fresh[kBlock];       // 1 + number of a result of this step; 0: none
  double until[kBlock];    // way of the bodies: before it the contact is no polygon's, or, in lane 0 of a
                           // polygon's block, the body touches nowhere else
  std::uint32_t used = 0;  // a bit a contact

  void get(int lane, int first, int count, void* to) const {
    double* values = static_cast<double*>(to);
    for (int k = 0; k < count; ++k) values[k] = field[first + k][lane];
  }
  void set(int lane, int first, int count, const void* from) {
    const char* values = static_cast<const char*>(from);
    for (int k = 0; k < count; ++k)
      std::memcpy(&field[first + k][lane], values + k * sizeof(double), sizeof(double));
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
constexpr int kWithShifts = 1 << 16;  // in a packed record's `flat`, see ContactPool::pack
constexpr int kMostContactSize = kContactSize + kFlatSize + (1 + kBlock) * kMostModelMemory;
static_assert(kContactPoints <= kBlock && sizeof(FlatRecord) % sizeof(double) == 0);

// Contacts by number, from 1; 0 is none. Numbers stay until the contact is removed.
class ContactPool {
 public:
  std::int32_t add(const ContactRecord& record) {
    const std::int32_t number = take(blocks_, free_);
    block(number).set(lane(number), 0, kContactSize, &record);
    forget_way(number);
    if (memory_size_ != 0) {
      memory_.resize(blocks_.size() * kBlock * memory_size_);
      std::fill_n(memory(block(number), lane(number)), memory_size_, 0.0);
    }
    return number;
  }

  // Doubles that a contact model keeps beside every contact and every point of a polygon, at most
  // kMostModelMemory; none by default. To be said while there are no contacts.
  void set_memory_size(int size) { memory_size_ = size; }
  // Forgets all contacts.
  void clear() {
    const int size = memory_size_;
    *this = ContactPool{};
    memory_size_ = size;
  }
  int memory_size() const { return memory_size_; }
  // Those of a contact or a point.
  double* memory(const ContactBlock& block, int lane) {
    return const_cast<double*>(std::as_const(*this).memory(block, lane));
  }
  const double* memory(const ContactBlock& block, int lane) const {
    const auto index = [&](std::size_t number) { return (number * kBlock + lane) * memory_size_; };
    if (!is_polygon(block)) return memory_.data() + index(&block - blocks_.data());
    const auto from = reinterpret_cast<std::uintptr_t>(flats_.data());
    return flat_memory_.data() +
           index((reinterpret_cast<std::uintptr_t>(&block) - from) / sizeof(FlatContact));
  }
  // Whether a block holds the points of a polygon.
  bool is_polygon(const ContactBlock& block) const {
    return blocks_.empty() || std::less<>{}(&block, blocks_.data()) || std::less<>{}(&blocks_.back(), &block);
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
    return const_cast<FlatContact*>(std::as_const(*this).flat_of(block, lane));
  }
  const FlatContact* flat_of(const ContactBlock& block, int lane) const {
    const int index = static_cast<int>(block.field[kFlat][lane]);
    return index == 0 ? nullptr : &flats_[index - 1];
  }
  // The bodies' ways are counted anew.
  void forget_way(std::int32_t number) {
    block(number).until[lane(number)] = 0;
    if (FlatContact* polygon = flat(number)) polygon->points.until[0] = 0;
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
    if (memory_size_ != 0) {
      flat_memory_.resize(flats_.size() * kBlock * memory_size_);
      std::fill_n(memory(flats_[index - 1].points, 0), kBlock * memory_size_, 0.0);
    }
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
  // back: a new contact, and how many doubles it took. Its field `flat` then says what follows: 1 for a
  // polygon, twice the doubles of a model's memory, and kWithShifts, without which (as restarts once were) a
  // record ends with it and a polygon without its shift. Another model's memory is not taken.
  int pack(std::int32_t number, double* to) const {
    ContactRecord record;
    const ContactBlock& from = blocks_[(number - 1) / kBlock];
    from.get(lane(number), 0, kContactSize, &record);
    const int index = static_cast<int>(record.flat);
    record.flat = (index != 0 ? 1 : 0) + 2 * memory_size_ + kWithShifts;
    std::memcpy(to, &record, sizeof record);
    int size = kContactSize;
    const auto put = [&](const void* values, int count) {
      std::memcpy(to + size, values, count * sizeof(double));
      size += count;
    };
    if (memory_size_ != 0) put(memory(from, lane(number)), memory_size_);
    if (index == 0) return size;
    const FlatContact& flat = flats_[index - 1];
    FlatRecord points;
    points.polygon = flat.polygon;
    for (int k = 0; k < kBlock; ++k) flat.points.get(k, kStateField, kContactStateSize, &points.state[k]);
    put(&points, kFlatSize);
    if (memory_size_ != 0) put(memory(flat.points, 0), kBlock * memory_size_);
    return size;
  }
  int packed_size(std::int32_t number) const {
    const bool flat = blocks_[(number - 1) / kBlock].field[kFlat][lane(number)] != 0;
    return kContactSize + memory_size_ + (flat ? kFlatSize + kBlock * memory_size_ : 0);
  }
  std::int32_t unpack(const double* from, int* size) {
    ContactRecord record;
    std::memcpy(&record, from, sizeof record - sizeof record.shift);
    const bool shifts = record.flat >= kWithShifts;
    const int follows = static_cast<int>(record.flat) % kWithShifts, memory_size = follows / 2;
    *size = shifts ? kContactSize : kContactSize - 1;
    record.shift = shifts ? from[kShift] : 0;
    record.flat = 0;
    const std::int32_t number = add(record);
    const auto get_memory = [&](ContactBlock& to, int lane, int count) {
      if (memory_size == memory_size_ && memory_size != 0)
        std::copy_n(from + *size, count * memory_size, memory(to, lane));
      *size += count * memory_size;
    };
    get_memory(block(number), lane(number), 1);
    if (follows % 2 == 0) return number;
    FlatRecord points{};
    const int shift = shifts ? 1 : 0, polygon = sizeof points.polygon / sizeof(double) - 1 + shift;
    std::memcpy(static_cast<void*>(&points.polygon), from + *size, polygon * sizeof(double));
    std::memcpy(points.state, from + *size + polygon, sizeof points.state);
    *size += kFlatSize - 1 + shift;
    FlatContact& flat = add_flat(number);
    flat.polygon = points.polygon;
    flat.points.used = (1u << points.polygon.count) - 1;
    for (int k = 0; k < kBlock; ++k) {
      flat.points.set(k, kStateField, kContactStateSize, &points.state[k]);
      flat.points.field[kWeight][k] = points.polygon.factor * points.polygon.weight[k];
    }
    get_memory(flat.points, 0, kBlock);
    return number;
  }

  ContactBlock& block(std::int32_t number) { return blocks_[(number - 1) / kBlock]; }
  static int lane(std::int32_t number) { return (number - 1) % kBlock; }
  LineVector<ContactBlock>& blocks() { return blocks_; }
  const LineVector<ContactBlock>& blocks() const { return blocks_; }
  const LineVector<FlatContact>& flats() const { return flats_; }
  std::size_t bytes() const {
    return blocks_.capacity() * sizeof(ContactBlock) + flats_.capacity() * sizeof(FlatContact) +
           (memory_.capacity() + flat_memory_.capacity()) * sizeof(double);
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
  int memory_size_ = 0;
  std::vector<double> memory_, flat_memory_;  // by contact; by polygon and point
};

}  // namespace nurbs

// Items by the cell of space that they are in, for looking up what may be near a point. Cells that meet in
// one bucket are not told apart: what is found is to be compared.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <vector>

#include "nurbs/types.h"

namespace nurbs {

class SpatialHash {
 public:
  using Cell = std::array<double, 3>;  // whole numbers

  // For about so many items.
  void clear(std::size_t expected) {
    std::size_t buckets = 16;
    while (buckets < 2 * expected) buckets *= 2;
    head_.assign(buckets, -1);
    next_.clear();
  }
  // The next item; they are numbered from 0.
  void add(const Cell& cell) {
    int& head = head_[bucket(cell)];
    next_.push_back(head);
    head = static_cast<int>(next_.size()) - 1;
  }
  // Calls visit(item) for those of the cell, and others.
  template <typename Visit>
  void visit(const Cell& cell, Visit visit) const {
    for (int item = head_[bucket(cell)]; item >= 0; item = next_[item]) visit(item);
  }
  // Likewise for the cells, of that size, within a distance (max norm) of x: not more than half the size.
  template <typename Visit>
  void visit_near(const Vec3& x, double distance, double size, Visit visit) const {
    const Cell low = cell_of(x - Vec3::Constant(distance), size),
               high = cell_of(x + Vec3::Constant(distance), size);
    for (int k = 0; k < 8; ++k) {
      Cell cell = low;
      bool other = true;
      for (int c = 0; c < 3; ++c)
        if (k >> c & 1) {
          other = other && high[c] != low[c];
          cell[c] = high[c];
        }
      if (other) this->visit(cell, visit);
    }
  }
  static Cell cell_of(const Vec3& x, double size) {
    return {std::floor(x[0] / size) + 0.0, std::floor(x[1] / size) + 0.0, std::floor(x[2] / size) + 0.0};
  }

 private:
  std::size_t bucket(const Cell& cell) const {
    std::uint64_t h = 0;
    for (const double x : cell) {
      std::uint64_t bits;
      std::memcpy(&bits, &x, sizeof bits);
      h = (h ^ bits) * 0x9E3779B97F4A7C15u;
      h ^= h >> 29;
    }
    return h & (head_.size() - 1);
  }

  std::vector<int> head_, next_;
};

}  // namespace nurbs

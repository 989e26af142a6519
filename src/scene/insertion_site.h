// The bodies that stand where new ones are to be inserted, in cells, and whether a new one would overlap any.
#pragma once

#include <cstdint>
#include <unordered_map>
#include <vector>

#include "contact/contact.h"

namespace nurbs {

// When two bodies are in each other's way.
enum class Overlap {
  exact,  // unless their surfaces are proven apart
  sphere  // when their bounding spheres (about the centres of mass) meet
};

class InsertionSite {
 public:
  // Forgets all bodies. `size`: a typical bounding radius, a length > 0; cells are made for it, but bodies of
  // any size may stand in them: those some 15 times as large are asked one by one.
  void clear(double size);

  // Adds a body, wherever it is. Its shape must outlive the site.
  void add(const Particle& body);

  // Whether `body` would be in the way of one that was added.
  bool overlaps(const Particle& body, Overlap judge) const;

  int count() const { return static_cast<int>(bodies_.size()); }

 private:
  struct Cells {
    std::int64_t low[3], high[3];
  };
  Cells cells_of(const Particle& body) const;
  static bool many(const Cells& cells);
  template <class Visit>
  void for_each_cell(const Cells& cells, Visit visit) const;
  bool meets(const Particle& a, const Particle& b, Overlap judge) const;

  double cell_ = 1;
  std::vector<Particle> bodies_;
  std::unordered_map<std::uint64_t, std::vector<int>> cells_;  // bodies by cell; hashes may share an entry
  std::vector<int> large_;                                     // bodies that stand in too many cells
  mutable std::vector<int> asked_;                             // per body, the last question that met it
  mutable int question_ = 0;
};

}  // namespace nurbs

// See insertion_site.h.
#include "scene/insertion_site.h"

#include <algorithm>
#include <cmath>

#include "contact/overlap/overlap_test.h"
#include "contact/pair_search.h"

namespace nurbs {

namespace {

constexpr double kMostStoodIn = 4096;  // cells that a body is entered in
constexpr double kTolerance = 1e-6;  // of the gap, over the smaller bounding radius: closer counts as overlap

double reach_of(const Particle& body) {
  return body.scale * body.shape->bounding_radius;
}

// Of a cell; neighbours differ in more than low bits.
std::uint64_t key(std::int64_t i, std::int64_t j, std::int64_t k) {
  const auto mix = [](std::uint64_t h, std::int64_t n) {
    h = (h ^ static_cast<std::uint64_t>(n)) * 0x9E3779B97F4A7C15u;
    return h ^ (h >> 29);
  };
  return mix(mix(mix(0, i), j), k);
}

}  // namespace

void InsertionSite::clear(double size) {
  cell_ = 2 * size;
  bodies_.clear();
  cells_.clear();
  large_.clear();
  asked_.clear();
  question_ = 0;
}

InsertionSite::Cells InsertionSite::cells_of(const Particle& body) const {
  Cells cells;
  for (int k = 0; k < 3; ++k) {
    cells.low[k] = static_cast<std::int64_t>(std::floor((body.x[k] - reach_of(body)) / cell_));
    cells.high[k] = static_cast<std::int64_t>(std::floor((body.x[k] + reach_of(body)) / cell_));
  }
  return cells;
}

bool InsertionSite::many(const Cells& cells) {
  double count = 1;
  for (int k = 0; k < 3; ++k) count *= static_cast<double>(cells.high[k] - cells.low[k] + 1);
  return count > kMostStoodIn;
}

// Calls visit(key) until it returns false.
template <class Visit>
void InsertionSite::for_each_cell(const Cells& cells, Visit visit) const {
  for (std::int64_t i = cells.low[0]; i <= cells.high[0]; ++i)
    for (std::int64_t j = cells.low[1]; j <= cells.high[1]; ++j)
      for (std::int64_t k = cells.low[2]; k <= cells.high[2]; ++k)
        if (!visit(key(i, j, k))) return;
}

void InsertionSite::add(const Particle& body) {
  const int number = count();
  bodies_.push_back(body);
  asked_.push_back(0);
  const Cells cells = cells_of(body);
  if (many(cells)) {
    large_.push_back(number);
    return;
  }
  for_each_cell(cells, [&](std::uint64_t cell) {
    cells_[cell].push_back(number);
    return true;
  });
}

bool InsertionSite::meets(const Particle& a, const Particle& b, Overlap judge) const {
  const double distance2 = (a.x - b.x).squaredNorm();
  const double outer = reach_of(a) + reach_of(b);
  if (distance2 > outer * outer) return false;
  const double inner = a.scale * a.shape->inner_radius + b.scale * b.shape->inner_radius;
  if (judge == Overlap::sphere || distance2 <= inner * inner) return true;
  const PairFrame pair(a, b);
  if (const std::optional<bool> known = test_overlap(pair, kTolerance * pair.size)) return *known;
  ContactSettings settings;
  settings.tolerance = kTolerance;
  settings.reach = 0;
  double memory[kPairMemorySize] = {};
  return find_contact(a, b, settings, memory).status != Status::separated;
}

bool InsertionSite::overlaps(const Particle& body, Overlap judge) const {
  const Cells cells = cells_of(body);
  if (many(cells))
    return std::any_of(bodies_.begin(), bodies_.end(),
                       [&](const Particle& other) { return meets(other, body, judge); });
  if (std::any_of(large_.begin(), large_.end(),
                  [&](int number) { return meets(bodies_[number], body, judge); }))
    return true;
  ++question_;
  bool found = false;
  for_each_cell(cells, [&](std::uint64_t cell) {
    const auto entry = cells_.find(cell);
    if (entry == cells_.end()) return true;
    for (const int number : entry->second) {
      if (asked_[number] == question_) continue;
      asked_[number] = question_;
      if ((found = meets(bodies_[number], body, judge))) return false;
    }
    return true;
  });
  return found;
}

}  // namespace nurbs

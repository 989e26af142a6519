// How far a point of a body is from its kinked joints, at least: by chords of them. For bodies whose patches
// are narrow somewhere, as at poles, so that parameters say nothing (JointDistance::width).
#pragma once

#include <array>
#include <limits>
#include <vector>

#include "nurbs/types.h"

namespace nurbs {

struct Shape;

// Lengths of the shape frame. Per patch the chords that can be nearest to a point of it.
struct KinkSegments {
  static constexpr int kPack = 8;  // chords side by side
  struct Pack {
    // A chord runs from `from` by `along`; over2 is 1 / |along|^2, 0 for a point; the joint is no further
    // from it than `stray`.
    std::array<std::array<double, kPack>, 3> from, along;
    std::array<double, kPack> over2, stray;
  };
  std::vector<Pack> packs;
  std::vector<int> first;  // per patch, and one more

  bool empty() const { return first.empty(); }
  // No kinked joint is nearer to x, a point of that patch. 15 ns for eight chords.
  double distance(int patch, const Vec3& x) const;
};
template <class Archive>
void archive(Archive& a, KinkSegments::Pack& s) {
  auto& [from, along, over2, stray] = s;
  a(from, along, over2, stray);
}
template <class Archive>
void archive(Archive& a, KinkSegments& s) {
  auto& [packs, first] = s;
  a(packs, first);
}

// Of a shape whose patches, links and balls are done: of all joints with a kink above kNoKink, halved until
// they stray by a 250th of the bounding radius from their chords, by their control points.
KinkSegments find_kink_segments(const Shape& shape);

}  // namespace nurbs

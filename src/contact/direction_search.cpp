// Coarse scan and compass search over the direction atlases; see direction_search.h.
#include "contact/direction_search.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "body/cube_map.h"
#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

constexpr int kScanCount = 6 * kScanCells * kScanCells;
static_assert(kScanCount % 4 == 0, "four side by side");

// Unit directions through the middles of a coarse cube map.
const std::array<Triple<Lane4>, kScanCount / 4>& scan_directions() {
  static const std::array<Triple<Lane4>, kScanCount / 4> directions = [] {
    std::array<Triple<Lane4>, kScanCount / 4> d;
    int n = 0;
    for (int face = 0; face < 6; ++face)
      for (int i = 0; i < kScanCells; ++i)
        for (int j = 0; j < kScanCells; ++j, ++n)
          set_lane(triple(cell_middle(face, i, j, kScanCells).normalized()), n % 4, &d[n / 4]);
    return d;
  }();
  return directions;
}

}  // namespace

double atlas_overlap(const PairFrame& pair, const Vec3& d) {
  return pair.scale_a * pair.a->atlas.support_upper(d) +
         pair.scale_b * pair.b->atlas.support_upper(pair.direction_on_b(d)) - d.dot(pair.offset);
}

void atlas_overlaps(const PairFrame& pair, const Triple<Lane4>& d, Lane4* p) {
  const Mat3& q = pair.turn;
  const Triple<Lane4> on_b{-(q(0, 0) * d.x + q(1, 0) * d.y + q(2, 0) * d.z),
                           -(q(0, 1) * d.x + q(1, 1) * d.y + q(2, 1) * d.z),
                           -(q(0, 2) * d.x + q(1, 2) * d.y + q(2, 2) * d.z)};
  Lane4 a, b;
  pair.a->atlas.support_upper(d, &a);
  pair.b->atlas.support_upper(on_b, &b);
  const Vec3& o = pair.offset;
  *p = pair.scale_a * a + pair.scale_b * b - (d.x * o[0] + d.y * o[1] + d.z * o[2]);
}

// Compass search on the sphere: halves its stride until below the atlas's own resolution.
DirectionGuess refine_guess(const PairFrame& pair, DirectionGuess guess) {
  for (double stride = 1.0 / kScanCells; stride > 0.5 / kAtlasCells; stride *= 0.5) {
    const double length = 1 / std::sqrt(1 + stride * stride), across = stride * length;
    const Lane4 to_t{across, -across, 0, 0}, to_s{0, 0, across, -across};
    for (int move = 0; move < kScanMoves; ++move) {
      const Vec3 t = guess.d.unitOrthogonal(), s = guess.d.cross(t), middle = length * guess.d;
      const Triple<Lane4> d{middle[0] + t[0] * to_t + s[0] * to_s, middle[1] + t[1] * to_t + s[1] * to_s,
                            middle[2] + t[2] * to_t + s[2] * to_s};
      Lane4 p;
      atlas_overlaps(pair, d, &p);
      int best = 0;
      for (int l = 1; l < 4; ++l)
        if (p[l] < p[best]) best = l;
      if (!(p[best] < guess.p)) break;
      guess = {lane(d, best).normalized(), p[best]};
    }
  }
  return guess;
}

int guess_from_centres(const PairFrame& pair, DirectionGuess* guess) {
  const double distance = pair.offset.norm();
  if (!(distance > 0)) return 0;
  *guess = {pair.offset / distance, atlas_overlap(pair, pair.offset / distance)};
  return 1;
}

int guess_directions(const PairFrame& pair, DirectionGuess* guesses, int count) {
  int found = 0;
  const auto offer = [&](const DirectionGuess& g) {
    if (found == count && !(g.p < guesses[found - 1].p)) return;
    for (int k = 0; k < found; ++k)
      if (guesses[k].d.dot(g.d) > kDistinct) {  // the same basin: keep the better
        if (!(g.p < guesses[k].p)) return;
        std::copy(guesses + k + 1, guesses + found, guesses + k);
        --found;
        break;
      }
    int at = found < count ? found++ : count - 1;
    for (; at > 0 && g.p < guesses[at - 1].p; --at) guesses[at] = guesses[at - 1];
    guesses[at] = g;
  };
  for (const Triple<Lane4>& d : scan_directions()) {
    Lane4 p;
    atlas_overlaps(pair, d, &p);
    for (int l = 0; l < 4; ++l) offer({lane(d, l), p[l]});
  }
  return found;
}

}  // namespace nurbs

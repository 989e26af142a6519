// Coarse scan and compass search over the direction atlases; see direction_search.h.
#include "contact/direction_search.h"

#include <algorithm>
#include <array>

#include "body/cube_map.h"
#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

constexpr int kScanCount = 6 * kScanCells * kScanCells;

// Unit directions through the middles of a coarse cube map.
const std::array<Vec3, kScanCount>& scan_directions() {
  static const std::array<Vec3, kScanCount> directions = [] {
    std::array<Vec3, kScanCount> d;
    int n = 0;
    for (int face = 0; face < 6; ++face)
      for (int i = 0; i < kScanCells; ++i)
        for (int j = 0; j < kScanCells; ++j) d[n++] = cell_middle(face, i, j, kScanCells).normalized();
    return d;
  }();
  return directions;
}

}  // namespace

double atlas_overlap(const PairFrame& pair, const Vec3& d) {
  return pair.scale_a * pair.a->atlas.support_upper(d) +
         pair.scale_b * pair.b->atlas.support_upper(pair.direction_on_b(d)) - d.dot(pair.offset);
}

// Compass search on the sphere: halves its stride until below the atlas's own resolution.
DirectionGuess refine_guess(const PairFrame& pair, DirectionGuess guess) {
  for (double stride = 1.0 / kScanCells; stride > 0.5 / kAtlasCells; stride *= 0.5) {
    for (int move = 0; move < kScanMoves; ++move) {
      const Vec3 t = guess.d.unitOrthogonal(), s = guess.d.cross(t);
      DirectionGuess best = guess;
      for (const Vec3& step : {t, Vec3(-t), s, Vec3(-s)}) {
        const Vec3 d = (guess.d + stride * step).normalized();
        const double p = atlas_overlap(pair, d);
        if (p < best.p) best = {d, p};
      }
      if (!(best.p < guess.p)) break;
      guess = best;
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
  for (const Vec3& d : scan_directions()) offer({d, atlas_overlap(pair, d)});
  return found;
}

}  // namespace nurbs

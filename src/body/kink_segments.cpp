// See kink_segments.h.
#include "body/kink_segments.h"

#include <algorithm>
#include <cmath>

#include "body/connectivity.h"
#include "body/edge_polynomials.h"
#include "body/shape.h"
#include "nurbs/tolerances.h"
#include "nurbs/wide.h"

namespace nurbs {
namespace {

constexpr int kKinkHalvings = 6;
constexpr double kKinkStray = 4e-3;

struct ChordStretch {
  Chord chord;
  double stray;  // of the joint from it
};

void add(const Homogeneous& piece, double enough, double gap, int depth,
         std::vector<ChordStretch>* stretches) {
  const double off = stray(piece);
  if (off <= enough || depth == 0) {
    stretches->push_back({Chord(piece), off + gap});
    return;
  }
  const auto [low, high] = halve(piece);
  add(low, enough, gap, depth - 1, stretches);
  add(high, enough, gap, depth - 1, stretches);
}

// Each joint from the side that comes first, whose gap is counted; poles that are tips are kinked joints too.
std::vector<ChordStretch> all_stretches(const Shape& shape) {
  std::vector<ChordStretch> stretches;
  visit_joints(shape.links, [&](int patch, int edge) {
    const EdgeLink& link = shape.links[patch][edge];
    if (link.kinked())
      add(edge_net(shape.patches[patch], edge), kKinkStray * shape.bounding_radius, link.gap, kKinkHalvings,
          &stretches);
  });
  return stretches;
}

// Eight of what is far away.
KinkSegments::Pack empty_pack() {
  KinkSegments::Pack pack{};
  for (auto& coordinate : pack.from) coordinate.fill(kFarAway);
  return pack;
}

void set(int lane, const ChordStretch& s, double roundoff, KinkSegments::Pack* pack) {
  const Vec3 along = s.chord.to - s.chord.from;
  for (int i = 0; i < 3; ++i) {
    pack->from[i][lane] = s.chord.from[i];
    pack->along[i][lane] = along[i];
  }
  pack->over2[lane] = along.squaredNorm() > 0 ? 1 / along.squaredNorm() : 0;
  pack->stray[lane] = s.stray + roundoff;
}

}  // namespace

double KinkSegments::distance(int patch, const Vec3& x) const {
  Wide least = all<Wide>(std::numeric_limits<double>::infinity());
  for (int k = first[patch]; k < first[patch + 1]; ++k) {
    const Pack& p = packs[k];
    for (int l = 0; l < kPack; l += kWidth) {
      const auto three = [l](const std::array<std::array<double, kPack>, 3>& v) {
        return Triple<Wide>{load_wide(&v[0][l]), load_wide(&v[1][l]), load_wide(&v[2][l])};
      };
      const Triple<Wide> along = three(p.along),
                         y = Triple<Wide>{all<Wide>(x[0]), all<Wide>(x[1]), all<Wide>(x[2])} - three(p.from);
      const Wide t = smaller(larger(dot(y, along) * load_wide(&p.over2[l]), Wide{}), all<Wide>(1));
      const Triple<Wide> off = y - t * along;
      least = smaller(least, root(dot(off, off)) - load_wide(&p.stray[l]));
    }
  }
  double nearest = least[0];
  for (int l = 1; l < kWidth; ++l) nearest = std::min(nearest, least[l]);
  return std::max(0.0, nearest);
}

KinkSegments find_kink_segments(const Shape& shape) {
  KinkSegments segments;
  const std::vector<ChordStretch> stretches = all_stretches(shape);
  if (stretches.empty()) return segments;
  segments.first.push_back(0);
  std::vector<double> far(stretches.size());
  for (const PatchBall& ball : shape.balls) {
    double reach = std::numeric_limits<double>::infinity();  // of what is nearest to any point of the ball
    for (size_t k = 0; k < stretches.size(); ++k) {
      far[k] = stretches[k].chord.distance(ball.center);
      reach = std::min(reach, far[k] + stretches[k].stray);
    }
    reach += 2 * ball.radius;
    int count = 0;
    for (size_t k = 0; k < stretches.size(); ++k) {
      if (far[k] - stretches[k].stray > reach) continue;
      const int lane = count++ % KinkSegments::kPack;
      if (lane == 0) segments.packs.push_back(empty_pack());
      set(lane, stretches[k], kRoundoff * shape.bounding_radius, &segments.packs.back());
    }
    segments.first.push_back(static_cast<int>(segments.packs.size()));
  }
  return segments;
}

}  // namespace nurbs

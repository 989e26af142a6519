// See kink_segments.h.
#include "body/kink_segments.h"

#include <algorithm>
#include <cmath>

#include "body/connectivity.h"
#include "body/shape.h"
#include "nurbs/bernstein.h"
#include "nurbs/tolerances.h"
#include "nurbs/wide.h"

namespace nurbs {
namespace {

constexpr int kHalvings = 6;
constexpr double kKinkStray = 4e-3;

struct Chord {
  Vec3 from, to;
  double stray;
};

double from_chord(const Vec3& x, const Chord& c) {
  const Vec3 along = c.to - c.from, y = x - c.from;
  const double length2 = along.squaredNorm();
  const double t = length2 > 0 ? std::clamp(y.dot(along) / length2, 0.0, 1.0) : 0;
  return (y - t * along).norm();
}

void add(const Bernstein<Vec4>& piece, double enough, double gap, int depth, std::vector<Chord>* chords) {
  const auto place = [](const Vec4& p) { return Vec3(p.head<3>() / p[3]); };
  Chord chord{place(piece.front()), place(piece.back()), 0};
  for (const Vec4& p : piece) chord.stray = std::max(chord.stray, from_chord(place(p), chord));
  if (chord.stray <= enough || depth == 0) {
    chord.stray += gap;
    chords->push_back(chord);
    return;
  }
  const auto [low, high] = halve(piece);
  add(low, enough, gap, depth - 1, chords);
  add(high, enough, gap, depth - 1, chords);
}

// Each joint from the side that comes first, whose gap is counted; poles that are tips are kinked joints too.
std::vector<Chord> all_chords(const Shape& shape) {
  std::vector<Chord> chords;
  for (size_t p = 0; p < shape.patches.size(); ++p)
    for (int edge = 0; edge < 4; ++edge) {
      const EdgeLink& link = shape.links[p][edge];
      const bool seen = link.patch >= 0 && (link.patch < static_cast<int>(p) ||
                                            (link.patch == static_cast<int>(p) && link.edge < edge));
      if (!seen && std::max(std::abs(link.kink), link.kink_bound) > kNoKink)
        add(edge_net(shape.patches[p], edge), kKinkStray * shape.bounding_radius, link.gap, kHalvings,
            &chords);
    }
  return chords;
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
  const std::vector<Chord> chords = all_chords(shape);
  if (chords.empty()) return segments;
  segments.first.push_back(0);
  std::vector<double> far(chords.size());
  for (const PatchBall& ball : shape.balls) {
    double reach = std::numeric_limits<double>::infinity();  // of what is nearest to any point of the ball
    for (size_t c = 0; c < chords.size(); ++c) {
      far[c] = from_chord(ball.center, chords[c]);
      reach = std::min(reach, far[c] + chords[c].stray);
    }
    reach += 2 * ball.radius;
    int count = 0;
    for (size_t c = 0; c < chords.size(); ++c) {
      if (far[c] - chords[c].stray > reach) continue;
      const int l = count++ % KinkSegments::kPack;
      if (l == 0) {  // filled up with what is far away
        segments.packs.emplace_back();
        KinkSegments::Pack& pack = segments.packs.back();
        for (int i = 0; i < 3; ++i) {
          pack.from[i].fill(kFarAway);
          pack.along[i].fill(0);
        }
        pack.over2.fill(0);
        pack.stray.fill(0);
      }
      KinkSegments::Pack& pack = segments.packs.back();
      const Vec3 along = chords[c].to - chords[c].from;
      for (int i = 0; i < 3; ++i) {
        pack.from[i][l] = chords[c].from[i];
        pack.along[i][l] = along[i];
      }
      pack.over2[l] = along.squaredNorm() > 0 ? 1 / along.squaredNorm() : 0;
      pack.stray[l] = chords[c].stray + kRoundoff * shape.bounding_radius;
    }
    segments.first.push_back(static_cast<int>(segments.packs.size()));
  }
  return segments;
}

}  // namespace nurbs

#include "body/small_kinks.h"

#include <algorithm>
#include <cmath>

#include "body/shape.h"

namespace nurbs {
namespace {

constexpr double kNoTilt = 1e-14;     // rad
constexpr double kNoSlack = 4e-16;    // of the size: round-off
constexpr double kMostSlack = 4e-13;  // ... and what may be given away
constexpr double kLittle = 1e-2;      // of a radius of that size, to be lost before

}  // namespace

SmallKinks find_small_kinks(const std::vector<std::array<EdgeLink, 4>>& links, double size) {
  double kink = 0;
  for (const auto& patch : links)
    for (const EdgeLink& link : patch)
      if (!link.kinked()) kink = std::max(kink, link.widest());
  SmallKinks small;
  const double met = kGapsCrossed * kink, half = 0.5 * met * met;
  if (!(half > 0)) return small;
  if (met > kNoTilt) small.met = met;
  const double slack = size * std::clamp(half / kLittle, kNoSlack, kMostSlack);
  small.share = half / slack;
  small.density = kink * static_cast<double>(links.size());
  if (slack > kNoSlack * size) small.slack = slack;
  return small;
}

}  // namespace nurbs

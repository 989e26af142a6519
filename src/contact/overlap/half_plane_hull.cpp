// A walk along the plane hull (Jarvis 1973) with the comparisons side by side; see half_plane_hull.h.
#include "contact/overlap/half_plane_hull.h"

#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

// An angle between `above` and `below` up to which r s + z c, `high` at the one and `low` at the other, is at
// least `threshold`: it is linear along the chord.
Angle level_at(const Angle& above, const Angle& below, double high, double low, double threshold) {
  if (!(above.c * below.c + above.s * below.s > 0 && high > threshold && threshold > 0)) return above;
  const double t = (high - threshold) / (high - low);
  return unit({above.c + t * (below.c - above.c), above.s + t * (below.s - above.s)});
}

NURBS_INLINE WideMask lane_numbers() {
  WideMask n{};
  for (int k = 0; k < kWidth; ++k) n[k] = k;
  return n;
}

}  // namespace

Angle middle(const Angle& low, const Angle& high) {
  Angle sum{low.c + high.c, low.s + high.s};
  if (sum.c * sum.c + sum.s * sum.s < 1)
    sum = {high.s - low.s, low.c - high.c};  // square to their difference
  return unit(sum);
}

int HalfPlaneHull::highest(const Angle& e) const {
  Wide most = Wide{} - kFarAway;
  WideMask best = WideMask{}, number = lane_numbers();
  for (int k = 0; k < count_; k += kWidth, number += kWidth) {
    const Wide h = load_wide(r_ + k) * e.s + load_wide(z_ + k) * e.c;
    const WideMask higher = (h > most) & (number < count_);
    most = select(higher, h, most);
    best = higher ? number : best;
  }
  int top = 0;
  for (int k = 1; k < kWidth; ++k)
    if (most[k] > most[top] || (most[k] == most[top] && best[k] < best[top])) top = k;
  return static_cast<int>(best[top]);
}

int HalfPlaneHull::corner_after(int top, const Angle& now, double noise, Angle* next) const {
  const Wide zero{}, rt = zero + r_[top], zt = zero + z_[top];
  Wide best_c = zero + next->c, best_s = zero + next->s;
  WideMask best = WideMask{} - 1, number = lane_numbers(), level = WideMask{};
  for (int k = 0; k < count_; k += kWidth, number += kWidth) {
    // Where a point comes above `top`.
    const Wide c = load_wide(r_ + k) - rt, s = zt - load_wide(z_ + k);
    const Wide turn = now.c * s - now.s * c;
    const WideMask later = turn > noise;
    level |= ~later & (turn > -noise) & (now.c * c + now.s * s > noise);
    const WideMask sooner = later & (number < count_) & (s > 0.0) & (c * best_s - s * best_c > 0.0);
    best_c = select(sooner, c, best_c);
    best_s = select(sooner, s, best_s);
    best = sooner ? number : best;
  }
  if (!none_of(level)) {
    *next = now;
    return level_with(top, now, noise);
  }
  int over = top;
  for (int k = 0; k < kWidth; ++k) {
    if (best[k] < 0) continue;
    const Angle there{best_c[k], best_s[k]};
    const double before = cross(there, *next);
    if (!(before > 0 || (before == 0 && over != top && best[k] < over))) continue;
    over = static_cast<int>(best[k]);
    *next = there;
  }
  return over;
}

// Of points that are level now, as three on a line are, the one that rises most.
int HalfPlaneHull::level_with(int top, const Angle& now, double noise) const {
  int over = top;
  double steepest = noise;
  for (int k = 0; k < count_; ++k) {
    const Angle level{r_[k] - r_[top], z_[top] - z_[k]};
    const double turn = cross(now, level), rise = now.c * level.c + now.s * level.s;
    if (!(turn <= noise && turn > -noise && rise > steepest)) continue;
    over = k;
    steepest = rise;
  }
  return over;
}

HalfPlaneHull::Least HalfPlaneHull::least(const Angle& low, const Angle& high, double threshold,
                                          double noise) {
  for (int k = count_; k % kWidth != 0; ++k) r_[k] = r_[0], z_[k] = z_[0];  // compared, never taken
  int top = highest(low);
  Least least{height(top, low), low, top, top, low, high, 1};
  bool some = least.value < threshold, open = some;
  Angle now = low;
  for (int over = -1; over != top;) {
    if (over >= 0) top = over;
    Angle next = high;
    over = corner_after(top, now, noise, &next);
    ++least.corners;
    next = unit(next);
    const double h = height(top, next);
    if (h < least.value) least = {h, next, top, over, least.low, least.high, least.corners};
    if (h < threshold) {
      if (!some) least.low = level_at(now, next, height(top, now), h, threshold);
      some = open = true;
      least.high = high;
    } else if (open) {
      least.high = level_at(next, now, h, height(top, now), threshold);
      open = false;
    }
    now = next;
  }
  if (!(least.value > 0)) least.value = -kFarAway;
  return least;
}

}  // namespace nurbs

// See least_overlap.h.
#include "support/least_overlap.h"

#include <algorithm>
#include <cmath>
#include <map>

namespace nurbs::test {

const std::vector<Vec3>& spiral(int count) {
  static std::map<int, std::vector<Vec3>> made;
  std::vector<Vec3>& directions = made[count];
  for (int i = static_cast<int>(directions.size()); i < count; ++i) {
    const double z = 1 - (2 * i + 1) / double(count), r = std::sqrt(1 - z * z), angle = 2.399963229728653 * i;
    directions.emplace_back(r * std::cos(angle), r * std::sin(angle), z);
  }
  return directions;
}

std::vector<Vec3> starts_beside(const Vec3& d, double widest, Random& random) {
  std::vector<Vec3> starts = {d};
  for (double beside = 1e-9; beside < widest; beside *= 10)
    for (int i = 0; i < 4; ++i) starts.push_back((d + beside * random.direction()).normalized());
  return starts;
}

double least_overlap(const std::function<double(const Vec3&)>& p, const std::vector<Vec3>& starts,
                     const Compass& compass, Random random) {
  struct Place {
    double p;
    Vec3 d;
  };
  std::vector<Place> places, minima;
  for (const Vec3& d : starts) places.push_back({p(d), d});
  std::sort(places.begin(), places.end(), [](const Place& x, const Place& y) { return x.p < y.p; });
  for (const Place& s : places) {
    if (static_cast<int>(minima.size()) == compass.minima) break;
    const auto same = [&](const Place& m) { return m.d.dot(s.d) > compass.one_basin; };
    if (std::none_of(minima.begin(), minima.end(), same)) minima.push_back(s);
  }
  double least = 1e300;
  for (Place m : minima) {
    int moves = 0;
    for (double stride = compass.stride; stride > compass.finest && moves < compass.moves; ++moves) {
      const Vec3 t = m.d.cross(random.direction()).normalized(), s = m.d.cross(t);
      Place next = m;
      for (const Vec3& step : {t, Vec3(-t), s, Vec3(-s)}) {
        const Vec3 d = (m.d + stride * step).normalized();
        const double here = p(d);
        if (here < next.p) next = {here, d};
      }
      stride *= next.p < m.p ? compass.longer : compass.shorter;
      m = next;
    }
    least = std::min(least, m.p);
  }
  return least;
}

}  // namespace nurbs::test

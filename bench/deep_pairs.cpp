// Deep pairs against brute force: is the overlap the solver returns the global minimum of p(d)? Writes CSV.
//   deep_pairs OUT.csv [PAIRS]   (21600)
// The brute force shares the surfaces and their evaluation with the solver, nothing else. Supports: the
// furthest of some thousand surface points, refined in every patch that comes near it. Directions: 1500 over
// the whole sphere, every local minimum among them followed downhill by a compass search that turns at
// random. Times are of thrice all pairs in turn, the least of each pair, without what was solved before.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <string>
#include <vector>

#include "bench/bodies.h"
#include "bench/machine.h"
#include "contact/pair_search.h"
#include "shapes/primitives.h"
#include "support/surface_cloud.h"

namespace nurbs {
namespace {

using test::SurfaceCloud;

constexpr int kDirections = 1500;   // 0.09 rad apart
constexpr double kNeighbour = 0.2;  // rad: a direction lower than all this near is a local minimum
constexpr int kCircle = 360;        // directions on a great circle
constexpr int kTurns = 4;   // of the compass at one stride: p has creases where a body has corners or edges
constexpr int kRounds = 3;  // of all pairs, timed
constexpr double kWrong = 1e-8;  // of the smaller bounding radius; the solver is asked for 1e-9

const std::vector<Vec3>& directions() {
  static const std::vector<Vec3> all = [] {
    std::vector<Vec3> d;
    for (int i = 0; i < kDirections; ++i) {
      const double z = 1 - (2 * i + 1) / double(kDirections), r = std::sqrt(1 - z * z);
      const double angle = 2.399963229728653 * i;  // the golden one
      d.emplace_back(r * std::cos(angle), r * std::sin(angle), z);
    }
    return d;
  }();
  return all;
}

const std::vector<std::vector<int>>& neighbours() {
  static const std::vector<std::vector<int>> all = [] {
    std::vector<std::vector<int>> near(kDirections);
    for (int i = 0; i < kDirections; ++i)
      for (int j = 0; j < kDirections; ++j)
        if (i != j && directions()[i].dot(directions()[j]) > std::cos(kNeighbour)) near[i].push_back(j);
    return near;
  }();
  return all;
}

struct Placed {
  const SurfaceCloud &cloud_a, &cloud_b;
  Particle a, b;
  double coarse(const Vec3& d) const {
    return a.scale * cloud_a.coarse(a.q.conjugate() * d) + b.scale * cloud_b.coarse(b.q.conjugate() * -d) -
           d.dot(b.x - a.x);
  }
  double exact(const Vec3& d) const {
    return a.scale * cloud_a.exact(a.q.conjugate() * d) + b.scale * cloud_b.exact(b.q.conjugate() * -d) -
           d.dot(b.x - a.x);
  }
  // h_A(d) + h_B(-d) at directions().
  std::vector<double> scan() const {
    std::vector<double> h(kDirections);
    for (int n = 0; n < kDirections; ++n)
      h[n] = a.scale * cloud_a.coarse(a.q.conjugate() * directions()[n]) +
             b.scale * cloud_b.coarse(b.q.conjugate() * -directions()[n]);
    return h;
  }
};

struct Minimum {
  Vec3 d;
  double p;
};

Minimum descend(const Placed& pair, Minimum m, double least_stride, bench::Random& random) {
  int failures = 0;
  for (double stride = 0.05; stride > least_stride;) {
    const Vec3 t = m.d.cross(random.direction()).normalized(), s = m.d.cross(t);
    Minimum next = m;
    for (const Vec3& step : {t, Vec3(-t), s, Vec3(-s)}) {
      const Vec3 d = (m.d + stride * step).normalized();
      const double p = pair.exact(d);
      if (p < next.p) next = {d, p};
    }
    if (next.p < m.p) {
      failures = 0;
      stride *= 1.3;
    } else if (++failures == kTurns) {
      failures = 0;
      stride *= 0.5;
    }
    m = next;
  }
  return m;
}

// Least p on the great circle square to `pole`, the crease that four parallel edges of a box leave in p,
// where a compass does not get along: every local minimum of a scan by golden section.
Minimum least_on_circle(const Placed& pair, const Vec3& pole) {
  const Vec3 t = pole.unitOrthogonal(), s = pole.cross(t);
  const auto at = [&](double angle) -> Vec3 { return std::cos(angle) * t + std::sin(angle) * s; };
  const double step = 2 * M_PI / kCircle, golden = 0.6180339887498949;
  std::vector<double> p(kCircle);
  for (int i = 0; i < kCircle; ++i) p[i] = pair.coarse(at(i * step));
  Minimum best{t, 1e300};
  const double far = *std::min_element(p.begin(), p.end()) + 0.05 * std::min(pair.a.scale, pair.b.scale);
  for (int i = 0; i < kCircle; ++i) {
    if (p[i] > far || p[i] > p[(i + 1) % kCircle] || p[i] > p[(i + kCircle - 1) % kCircle]) continue;
    double low = (i - 1.5) * step, high = (i + 1.5) * step;
    double x = high - golden * (high - low), y = low + golden * (high - low);
    double px = pair.exact(at(x)), py = pair.exact(at(y));
    while (high - low > 1e-10) {
      if (px < py) {
        high = y;
        y = x;
        py = px;
        px = pair.exact(at(x = high - golden * (high - low)));
      } else {
        low = x;
        x = y;
        px = py;
        py = pair.exact(at(y = low + golden * (high - low)));
      }
    }
    if (px < best.p) best = {at(x), px};
    if (py < best.p) best = {at(y), py};
  }
  return best;
}

// All local minima of p found, the lowest first. `coarse`: of h_A(d) + h_B(-d) at directions().
std::vector<Minimum> brute_force(const Placed& pair, const std::vector<double>& coarse,
                                 bench::Random& random) {
  const Vec3 offset = pair.b.x - pair.a.x;
  std::vector<double> p(kDirections);
  for (int i = 0; i < kDirections; ++i) p[i] = coarse[i] - directions()[i].dot(offset);
  std::vector<Minimum> minima;
  const auto by_p = [](const Minimum& x, const Minimum& y) { return x.p < y.p; };
  for (int i = 0; i < kDirections; ++i) {
    const auto& near = neighbours()[i];
    if (std::any_of(near.begin(), near.end(), [&](int j) { return p[j] < p[i]; })) continue;
    Minimum m{directions()[i], pair.exact(directions()[i])};
    m = descend(pair, m, 1e-3, random);
    const auto same = [&](const Minimum& other) { return other.d.dot(m.d) > 1 - 0.5 * 0.05 * 0.05; };
    const auto found = std::find_if(minima.begin(), minima.end(), same);
    if (found == minima.end())
      minima.push_back(m);
    else if (m.p < found->p)
      *found = m;
  }
  std::sort(minima.begin(), minima.end(), by_p);
  const double far = minima.front().p + 1e-3;
  for (Minimum& m : minima)
    if (m.p < far) m = descend(pair, m, 2e-8, random);
  for (const Particle* particle : {&pair.a, &pair.b})
    if (particle->shape->name == "box")
      for (int k = 0; k < 3; ++k) {
        const Minimum m = least_on_circle(pair, particle->q * Vec3::Unit(k));
        if (m.p < minima.front().p) minima.front() = m;
      }
  std::sort(minima.begin(), minima.end(), by_p);
  return minima;
}

struct Row {
  long pairs = 0, wrong = 0, unresolved = 0, several = 0;
  double too_deep = 0, too_shallow = 0, brute_missed = 0;
  std::vector<double> microseconds;

  void add(const Row& r) {
    pairs += r.pairs;
    wrong += r.wrong;
    unresolved += r.unresolved;
    several += r.several;
    too_deep = std::max(too_deep, r.too_deep);
    too_shallow = std::max(too_shallow, r.too_shallow);
    brute_missed = std::max(brute_missed, r.brute_missed);
    microseconds.insert(microseconds.end(), r.microseconds.begin(), r.microseconds.end());
  }
  void write(std::FILE* out, const char* name) {
    std::sort(microseconds.begin(), microseconds.end());
    const size_t n = microseconds.size();
    std::fprintf(out, "%s,%ld,%ld,%ld,%ld,%.2g,%.2g,%.2g,%.1f,%.1f,%.1f\n", name, pairs, wrong, unresolved,
                 several, too_deep, too_shallow, brute_missed, microseconds[n / 2],
                 microseconds[n * 99 / 100], microseconds.back());
  }
};

std::vector<bench::Body> bodies() {
  std::vector<bench::Body> all = bench::smooth_bodies();
  const auto add = [&](const char* name, const std::vector<NurbsSurface>& surfaces) {
    all.push_back({name, "", make_shape(name, surfaces), Vec3::Zero()});
  };
  add("slender", exact_ellipsoid(Vec3(1, 0.3, 0.2)));
  add("polar", revolved_ellipsoid(1, 0.5));
  add("kinked", fitted_ellipsoid(Vec3(1, 0.8, 0.6)));
  add("box", box(Vec3(1, 0.8, 0.6)));
  return all;
}

// B on a random line from A's centre, so far out that the overlap is 0.1 to 1 of the smaller bounding radius,
// evenly, or as deep as concentric bodies of these orientations overlap.
void place(Placed& pair, const std::vector<double>& coarse, bench::Random& random) {
  const double size =
      std::min(pair.a.scale * pair.a.shape->bounding_radius, pair.b.scale * pair.b.shape->bounding_radius);
  const double most = *std::min_element(coarse.begin(), coarse.end()) / size;
  const double overlap = size * random.uniform(std::min(0.1, 0.9 * most), std::min(1.0, most));
  const Vec3 line = random.direction();
  double distance = 1e300;
  for (int i = 0; i < kDirections; ++i) {
    const double along = directions()[i].dot(line);
    if (along > 1e-3) distance = std::min(distance, (coarse[i] - overlap) / along);
  }
  pair.b.x = std::max(0.0, distance) * line;
}

void draw(const bench::Body& a, const bench::Body& b, Placed& pair, bench::Random& random) {
  pair.a = {a.shape.get(), 1, Vec3::Zero(), random.turn()};
  pair.b = {b.shape.get(), std::exp(random.uniform(std::log(0.3), std::log(3.0))), Vec3::Zero(),
            random.turn()};
  place(pair, pair.scan(), random);
}

int main_program(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: deep_pairs OUT.csv [PAIRS]\n");
    return 1;
  }
  const long pairs = argc > 2 ? std::atol(argv[2]) : 21600;
  std::FILE* out = std::fopen(argv[1], "w");
  if (!out) {
    std::fprintf(stderr, "cannot write %s\n", argv[1]);
    return 1;
  }
  const std::vector<bench::Body> all = bodies();
  std::vector<SurfaceCloud> clouds;
  for (const bench::Body& body : all) clouds.emplace_back(*body.shape);
  const int count = static_cast<int>(all.size());
  std::vector<std::pair<int, int>> combinations;
  for (int i = 0; i < count; ++i)
    for (int j = i; j < count; ++j) combinations.emplace_back(i, j);
  // Timed in turn, as a run meets them, before anything is judged.
  std::vector<Placed> placed;
  std::vector<bench::Random> randoms;
  for (long k = 0; k < pairs; ++k) {
    const auto [i, j] = combinations[k % combinations.size()];
    randoms.emplace_back(static_cast<unsigned>(k + 1));
    placed.push_back({clouds[i], clouds[j], {}, {}});
    draw(all[i], all[j], placed.back(), randoms.back());
  }
  std::vector<double> microseconds(pairs, 1e300);
  std::vector<ContactResult> results(pairs);
  for (const bench::Body& body : all) body.shape->inner_map();  // made once, as a run does
  for (int round = 0; round < kRounds; ++round)
    for (long k = 0; k < pairs; ++k) {
      double memory[kPairMemorySize] = {0};
      const double began = bench::thread_seconds();
      results[k] = find_contact(placed[k].a, placed[k].b, ContactSettings(), memory);
      const double us = 1e6 * (bench::thread_seconds() - began - bench::clock_cost());
      microseconds[k] = std::min(microseconds[k], us);
    }
  std::map<std::pair<int, int>, Row> rows;
  for (long k = 0; k < pairs; ++k) {
    const auto [i, j] = combinations[k % combinations.size()];
    const Placed& pair = placed[k];
    const ContactResult& r = results[k];
    const double size =
        std::min(pair.a.scale * pair.a.shape->bounding_radius, pair.b.scale * pair.b.shape->bounding_radius);
    const std::vector<Minimum> minima = brute_force(pair, pair.scan(), randoms[k]);
    Row& row = rows[{i, j}];
    row.microseconds.push_back(microseconds[k]);
    ++row.pairs;
    row.several += minima.size() > 1;
    row.unresolved += r.status != Status::converged;
    // The overlap must be attained along the normal, and no direction may have less.
    const double depth = -r.gap / size, along = pair.exact(r.normal) / size, least = minima.front().p / size;
    const double too_deep = depth - least, too_shallow = along - depth;
    row.too_deep = std::max(row.too_deep, too_deep);
    row.too_shallow = std::max(row.too_shallow, std::abs(too_shallow));
    row.brute_missed = std::max(row.brute_missed, -too_deep);
    if (r.status == Status::converged && too_deep <= kWrong && std::abs(too_shallow) <= kWrong) continue;
    ++row.wrong;
    std::fprintf(
        stderr, "pair %ld (%s, %s): status %d, overlap %.12g, along its normal %.12g, brute force %.12g\n", k,
        all[i].name.c_str(), all[j].name.c_str(), static_cast<int>(r.status), depth, along, least);
  }
  std::fprintf(out, "# %s\n", bench::machine_name().c_str());
  std::fprintf(out,
               "bodies,pairs,wrong,unresolved,several_minima,too_deep,off_normal,brute_missed,us_median,us_"
               "99,us_worst\n");
  Row total;
  for (auto& [which, row] : rows) {
    row.write(out, (all[which.first].name + " " + all[which.second].name).c_str());
    total.add(row);
  }
  total.write(out, "all");
  return std::fclose(out);
}

}  // namespace
}  // namespace nurbs

int main(int argc, char** argv) {
  return nurbs::main_program(argc, argv);
}

// The failure table: families of pairs x methods, how many answers fail and how. Writes CSV.
//   failure_table OUT.csv [SHARE [SECONDS [METHOD ...]]]
// SHARE of the pairs a family names (1); mesh methods spend at most SECONDS (10) a family; all methods or
// those named.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <vector>

#include "bench/competitors.h"
#include "bench/machine.h"
#include "support/families.h"

namespace nurbs {
namespace {

// Slower methods get fewer pairs.
struct Entry {
  std::string name;
  long most_pairs;
  std::function<std::unique_ptr<bench::Method>()> make;  // none: a solver of ours
  Solver solver;
  std::unique_ptr<bench::Method> method;
  std::map<const Shape*, double> mesh_error;  // of the shape at scale 1, length

  // Methods that keep a mesh per shape and scale are made anew now and then, to bound their memory.
  void renew() {
    if (make) method = make();
  }
};

constexpr double kMeshTolerance = 1e-6;  // of GJK and EPA, absolute, as their users set it
constexpr long kRenew = 200;             // pairs
constexpr int kOftenSeen = 20;           // times in a family: has its inner map then, as in a run

std::vector<Entry> all_methods() {
  std::vector<Entry> entries;
  const auto add = [&](const std::string& name, long most,
                       std::function<std::unique_ptr<bench::Method>()> make) {
    entries.push_back({name, most, std::move(make), Solver::ladder, nullptr, {}});
  };
  add("ours", 1000000, nullptr);
  add("cso", 10000, nullptr);
  entries.back().solver = Solver::cso;
  for (const int vertices : {500, 5000}) {
    const std::string size = "-" + std::to_string(vertices);
    const long few = vertices > 1000 ? 400 : 2000;
    add("libccd" + size, 2000,
        [=] { return bench::make_libccd(vertices, bench::CcdAlgorithm::gjk_epa, kMeshTolerance); });
    add("bullet" + size, few, [=] { return bench::make_bullet(vertices); });
    add("fcl" + size, few, [=] { return bench::make_fcl(vertices, kMeshTolerance); });
  }
  return entries;
}

double error_of(Entry& entry, const Particle& p) {
  const auto found = entry.mesh_error.find(p.shape);
  const double error = found != entry.mesh_error.end()
                           ? found->second
                           : entry.mesh_error[p.shape] =
                                 entry.method->model_error(*p.shape) * p.shape->bounding_radius;
  return error * p.scale;
}

families::Verdict judge_mesh(Entry& entry, const families::PairCase& c, const bench::Answer& given) {
  const double size =
      std::min(c.a.scale * c.a.shape->bounding_radius, c.b.scale * c.b.shape->bounding_radius);
  const double error = error_of(entry, c.a) + error_of(entry, c.b) + kMeshTolerance * size;
  families::Answer answer;
  answer.given = given.ok;
  answer.gap = given.gap;
  answer.normal = given.normal;
  answer.has_normal = std::isfinite(given.gap);
  if (given.gap == std::numeric_limits<double>::infinity())  // "apart" is all it says
    answer.gap = c.truth.gap > -2 * error ? c.truth.gap : 4 * error;
  return families::judge(c, answer, error);
}

struct Row {
  long pairs = 0, count[families::kFailures] = {0};
  std::vector<double> microseconds;
};

Row run(const families::Family& family, Entry& entry, double share, double seconds) {
  Row row;
  std::map<const Shape*, int> seen;
  const long pairs = std::min<long>(std::max<long>(1, std::lround(share * family.pairs)), entry.most_pairs);
  const double end = entry.make ? bench::thread_seconds() + seconds : 1e300;
  for (long k = 0; k < pairs && bench::thread_seconds() < end; ++k) {
    if (k % kRenew == 0) entry.renew();
    const families::PairCase c = families::pair_of(family, k);
    for (const Shape* shape : {c.a.shape, c.b.shape})
      if (++seen[shape] == kOftenSeen) shape->inner_map();
    families::Verdict verdict;
    double began = bench::thread_seconds();
    if (entry.method) {
      entry.method->solve(c.a, c.b);  // meshes are made before the clock starts
      began = bench::thread_seconds();
      const bench::Answer answer = entry.method->solve(c.a, c.b);
      row.microseconds.push_back(1e6 * (bench::thread_seconds() - began));
      verdict = judge_mesh(entry, c, answer);
    } else {
      const families::Answer answer = families::solve(c, entry.solver);
      row.microseconds.push_back(1e6 * (bench::thread_seconds() - began));
      verdict = families::judge(c, answer);
    }
    ++row.pairs;
    ++row.count[static_cast<int>(verdict.failure)];
    if (entry.name == "ours" && verdict.failure != families::Failure::none)
      std::fprintf(stderr, "ours fails: %s, pair %ld: %s, error %g\n", family.name, k,
                   families::kFailureNames[static_cast<int>(verdict.failure)], verdict.error);
  }
  std::sort(row.microseconds.begin(), row.microseconds.end());
  return row;
}

// Those that are named, or all if none is.
template <class T>
void keep_named(int count, char** names, std::vector<T>* all) {
  const auto named = [&](const T& entry) {
    return std::any_of(names, names + std::max(count, 0),
                       [&](const char* name) { return entry.name == std::string(name); });
  };
  if (std::none_of(all->begin(), all->end(), named)) return;
  all->erase(std::remove_if(all->begin(), all->end(), [&](const T& entry) { return !named(entry); }),
             all->end());
}

int main_program(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: failure_table OUT.csv [SHARE [SECONDS [METHOD or FAMILY ...]]]\n");
    return 1;
  }
  const double share = argc > 2 ? std::atof(argv[2]) : 1, seconds = argc > 3 ? std::atof(argv[3]) : 10;
  std::FILE* out = std::fopen(argv[1], "w");
  if (!out) {
    std::fprintf(stderr, "cannot write %s\n", argv[1]);
    return 1;
  }
  std::fprintf(out, "# %s\nfamily,method,pairs,failed", bench::machine_name().c_str());
  for (int k = 1; k < families::kFailures; ++k) std::fprintf(out, ",%s", families::kFailureNames[k]);
  std::fprintf(out, ",us_median,us_99,what\n");
  std::vector<Entry> entries = all_methods();
  std::vector<families::Family> all = families::all_families();
  keep_named(argc - 4, argv + 4, &entries);
  keep_named(argc - 4, argv + 4, &all);
  for (const families::Family& family : all)
    for (Entry& entry : entries) {
      const Row row = run(family, entry, share, seconds);
      std::fprintf(out, "%s,%s,%ld,%ld", family.name, entry.name.c_str(), row.pairs,
                   row.pairs - row.count[0]);
      for (int k = 1; k < families::kFailures; ++k) std::fprintf(out, ",%ld", row.count[k]);
      std::fprintf(out, ",%.2f,%.2f,\"%s\"\n", row.microseconds[row.microseconds.size() / 2],
                   row.microseconds[row.microseconds.size() * 99 / 100], family.what);
      std::fflush(out);
    }
  return std::fclose(out);
}

}  // namespace
}  // namespace nurbs

int main(int argc, char** argv) {
  return nurbs::main_program(argc, argv);
}

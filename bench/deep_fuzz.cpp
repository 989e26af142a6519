// Random bodies in random poses, most of them deep (tests/support/deep_fuzz.h): how many pairs are left
// unresolved or answered wrongly, and how long they take.
//   deep_fuzz [--seed N] [--pairs N] [--bodies N] [--poses NAME,..] [--judge SHARE] [--slow US] [--write DIR]
//             [--only K] [--kinds first|further]
// PAIRS (20000) of each kind of pose, of BODIES (96); SHARE (0.1) of the pairs is also compared with a search
// over directions that shares nothing with the solver, all of them with the overlap along their normal. Pairs
// that fail or take longer than US (1000) are listed, and written as pair cases (io/pair_case.h) to DIR. Exit
// status 1 if any failed.
#include "support/deep_fuzz.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

#include "bench/machine.h"
#include "contact/pair_search.h"
#include "io/pair_case.h"

namespace nurbs {
namespace {

using namespace deep_fuzz;

struct Arguments {
  std::uint64_t seed = 1;
  long pairs = 20000, only = -1;
  int bodies = 96;
  std::string poses, write;
  Kinds kinds = Kinds::first;
  double judge = 0.1, slow = 1000;
};

bool read(int argc, char** argv, Arguments* to) {
  for (int k = 1; k + 1 < argc; k += 2) {
    const std::string name = argv[k];
    const char* const value = argv[k + 1];
    if (name == "--seed")
      to->seed = std::strtoull(value, nullptr, 10);
    else if (name == "--pairs")
      to->pairs = std::atol(value);
    else if (name == "--only")
      to->only = std::atol(value);
    else if (name == "--bodies")
      to->bodies = std::atoi(value);
    else if (name == "--poses")
      to->poses = "," + std::string(value) + ",";
    else if (name == "--judge")
      to->judge = std::atof(value);
    else if (name == "--slow")
      to->slow = std::atof(value);
    else if (name == "--write")
      to->write = value;
    else if (name == "--kinds")
      to->kinds = std::strcmp(value, "further") == 0 ? Kinds::further : Kinds::first;
    else
      return false;
  }
  return argc % 2 == 1 && to->bodies > 0;
}

struct Timed {
  ContactResult result;
  double microseconds = 0;
};

// A slow one again: somebody else's work may have been in the caches.
Timed solve(const families::PairCase& c, double slow) {
  c.a.shape->inner_map();  // made once, as a run does
  c.b.shape->inner_map();
  Timed best;
  for (int k = 0; k < 3; ++k) {
    double memory[kPairMemorySize] = {0};
    ContactSettings settings;
    settings.tolerance = c.tolerance;
    const double began = bench::thread_seconds();
    const ContactResult r = find_contact(c.a, c.b, settings, memory);
    const double us = 1e6 * (bench::thread_seconds() - began - bench::clock_cost());
    if (k == 0 || us < best.microseconds) best = {r, us};
    if (best.microseconds < 0.5 * slow) break;
  }
  return best;
}

struct Row {
  long judged = 0, wrong = 0, unresolved = 0, slow = 0, separated = 0;
  std::vector<double> microseconds;

  void print(const char* name) {
    std::sort(microseconds.begin(), microseconds.end());
    const size_t n = microseconds.size();
    const auto quantile = [&](double q) { return microseconds[std::min(n - 1, static_cast<size_t>(q * n))]; };
    std::printf("%-9s %8zu %8ld %6ld %6ld %6ld %9ld %8.1f %8.1f %8.1f %8.1f\n", name, n, judged, wrong,
                unresolved, slow, separated, quantile(0.5), quantile(0.99), quantile(0.999),
                microseconds.back());
    std::fflush(stdout);
  }
  void add(const Row& r) {
    judged += r.judged;
    wrong += r.wrong;
    unresolved += r.unresolved;
    slow += r.slow;
    separated += r.separated;
    microseconds.insert(microseconds.end(), r.microseconds.begin(), r.microseconds.end());
  }
};

int main_program(int argc, char** argv) {
  Arguments arguments;
  if (!read(argc, argv, &arguments)) {
    std::fprintf(stderr,
                 "usage: deep_fuzz [--seed N] [--pairs N] [--bodies N] [--poses NAME,..] [--judge SHARE] "
                 "[--slow US] [--write DIR] [--only K] [--kinds first|further]\n");
    return 1;
  }
  const Fuzz fuzz(arguments.seed, arguments.bodies, arguments.kinds);
  std::printf("# %s; seed %llu, %d bodies\n%-9s %8s %8s %6s %6s %6s %9s %8s %8s %8s %8s\n",
              bench::machine_name().c_str(), static_cast<unsigned long long>(arguments.seed),
              arguments.bodies, "pose", "pairs", "judged", "wrong", "unres", "slow", "separated", "us_50",
              "us_99", "us_99.9", "us_worst");
  Row all;
  const long every = arguments.judge > 0 ? std::max(1L, std::lround(1 / arguments.judge)) : 0;
  for (int pose = 0; pose < kPoses; ++pose) {
    if (!arguments.poses.empty() &&
        arguments.poses.find("," + std::string(kPoseNames[pose]) + ",") == std::string::npos)
      continue;
    Row row;
    const long first = arguments.only < 0 ? 0 : arguments.only,
               end = arguments.only < 0 ? arguments.pairs : first + 1;
    for (long k = first; k < end; ++k) {
      const families::PairCase c = fuzz.pair(static_cast<Pose>(pose), k);
      const Timed t = solve(c, arguments.slow);
      families::Truth truth = c.truth;
      const bool searched = every > 0 && (k % every == 0 || arguments.only >= 0);
      if (searched) truth = fuzz.truth(c, static_cast<std::uint64_t>(k));
      const Judgement j = judge(fuzz, c, truth, t.result);
      row.judged += searched;
      row.microseconds.push_back(t.microseconds);
      const bool unresolved = t.result.status == Status::unresolved,
                 wrong = *j.wrong && std::strcmp(j.wrong, "unresolved") != 0,
                 slow = t.microseconds > arguments.slow;
      row.unresolved += unresolved;
      row.wrong += wrong;
      row.slow += slow;
      row.separated += t.result.status == Status::separated;
      if (!(unresolved || wrong || slow || arguments.only >= 0)) continue;
      std::fprintf(
          stderr,
          "%s %ld: %s %s, scale %.3g, %s%s, error %.3g of %.3g, gap %.9g, bracket %.3g, %d iterations, "
          "%.0f us\n",
          kPoseNames[pose], k, c.a.shape->name.c_str(), c.b.shape->name.c_str(), c.b.scale,
          *j.wrong ? j.wrong : "right", slow ? ", slow" : "", j.error, j.allowed, t.result.gap,
          t.result.upper - t.result.lower, t.result.iterations, t.microseconds);
      if (arguments.write.empty()) continue;
      ContactSettings settings;
      settings.tolerance = c.tolerance;
      const std::string file = arguments.write + "/" + kPoseNames[pose] + "-" +
                               std::to_string(arguments.seed) + "-" + std::to_string(k) + ".json";
      if (!write_pair_case(file, c.a, c.b, settings)) std::fprintf(stderr, "cannot write %s\n", file.c_str());
    }
    row.print(kPoseNames[pose]);
    all.add(row);
  }
  if (!all.microseconds.empty()) all.print("all");
  return all.wrong + all.unresolved > 0;
}

}  // namespace
}  // namespace nurbs

int main(int argc, char** argv) {
  return nurbs::main_program(argc, argv);
}

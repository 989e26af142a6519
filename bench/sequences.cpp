// Warm sequences: bodies that tumble about each other and on planes, memory kept from step to step, every
// answer judged (tests/support/sequences.h). Writes CSV, a line a pair of bodies as it is done.
//   sequences OUT.csv [STEPS [FIRST [COUNT [SEED]]]]
// STEPS (100000) of each; COUNT (all) of the pairs from the FIRST (0) on, so that a long run can be cut into
// slices. Exit status 1 if any answer was wrong or unresolved.
#include "support/sequences.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <utility>
#include <vector>

#include "bench/machine.h"

namespace nurbs {
namespace {

using sequences::Actor;
using sequences::Report;

// Every body on a plane; every one with itself, with the ball and with three others.
std::vector<std::pair<int, int>> schedule() {
  const int count = static_cast<int>(sequences::all_actors().size());
  int ball = 0;
  for (int k = 0; k < count; ++k)
    if (sequences::all_actors()[k].name == "ball") ball = k;
  std::vector<std::pair<int, int>> runs;
  for (int k = 0; k < count; ++k) {
    runs.emplace_back(k, -1);
    runs.emplace_back(k, k);
    runs.emplace_back(k, ball);
    for (const int other : {5, 11, 17}) runs.emplace_back(k, (k + other) % count);
  }
  return runs;
}

int main_program(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: sequences OUT.csv [STEPS [FIRST [COUNT [SEED]]]]\n");
    return 1;
  }
  const auto argument = [&](int k, long otherwise) { return argc > k ? std::atol(argv[k]) : otherwise; };
  const auto runs = schedule();
  const long steps = argument(2, 100000), all = static_cast<long>(runs.size()), first = argument(3, 0),
             end = std::min(all, first + argument(4, all));
  const auto seed = static_cast<std::uint64_t>(argument(5, 1));
  std::FILE* out = std::fopen(argv[1], "w");
  if (!out) {
    std::fprintf(stderr, "cannot write %s\n", argv[1]);
    return 1;
  }
  std::fprintf(out, "# %s\na,b,steps,judged,touching,unresolved,wrong,bracket,worst,seconds\n",
               bench::machine_name().c_str());
  long failed = 0;
  for (long k = first; k < end; ++k) {
    const Actor& a = sequences::all_actors()[runs[k].first];
    const Actor* b = runs[k].second < 0 ? nullptr : &sequences::all_actors()[runs[k].second];
    const double began = bench::thread_seconds();
    const std::uint64_t own = 1000 * seed + static_cast<std::uint64_t>(k);
    const Report r = b ? sequences::run_pair(a, *b, own, steps) : sequences::run_plane(a, own, steps);
    std::fprintf(out, "\"%s\",\"%s\",%ld,%ld,%ld,%ld,%ld,%ld,%.3g,%.1f\n", a.name.c_str(),
                 b ? b->name.c_str() : "plane", r.steps, r.judged, r.touching, r.unresolved, r.wrong,
                 r.bracket, r.worst, bench::thread_seconds() - began);
    std::fflush(out);
    if (r.failed())
      std::fprintf(stderr, "%ld: %s, %s: %ld unresolved, %ld wrong, %ld brackets; %s\n", k, a.name.c_str(),
                   b ? b->name.c_str() : "plane", r.unresolved, r.wrong, r.bracket, r.first.c_str());
    failed += r.failed();
  }
  std::fclose(out);
  std::fprintf(stderr, "%ld failed\n", failed);
  return failed > 0;
}

}  // namespace
}  // namespace nurbs

int main(int argc, char** argv) {
  return nurbs::main_program(argc, argv);
}

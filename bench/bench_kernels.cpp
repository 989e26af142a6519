// Google Benchmark of the kernels and of every rung of the ladder, with ratios to one second-derivative
// evaluation of the same surface. Usage: bench_kernels [--out=FILE.csv] [Google Benchmark options].
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <map>
#include <string>
#include <vector>

#include "bench/bodies.h"
#include "bench/machine.h"
#include "bench/staged_pairs.h"
#include "body/support.h"
#include "contact/direction_search.h"
#include "contact/pair_memory.h"
#include "contact/pair_search.h"
#include "contact/walls/cylinder_search.h"
#include "motion/rotor.h"
#include "nurbs/bezier_patch.h"

namespace nurbs::bench {
namespace {

constexpr int kPaths = 24, kSteps = 33;  // step 0 and 1 start the warm rungs
constexpr double kTurn = 2e-3;           // rad per step, either body
constexpr double kRest = 1e-6;           // of the size: motion of a resting pair since its last solve
constexpr int kBatches = 15;             // medians are of so many
constexpr int kColdPairs = 100000;
constexpr int kCopies = 20;  // of a path in the stages of a step

struct Scene {
  const Body* body;
  std::vector<std::vector<Pair>> paths;
  std::vector<Vec3> directions;
  std::vector<SurfacePoint> points;
};

constexpr int kClosedForm = -1;  // the body after the smooth ones

const Body& body_of(int which) {
  return which == kClosedForm ? closed_ellipsoid() : smooth_bodies()[which];
}

const Scene& scene(int which) {
  static std::map<int, Scene> scenes;
  const auto found = scenes.find(which);
  if (found != scenes.end()) return found->second;
  const Body& body = body_of(which);
  Random random(11);
  Scene s{&body, {}, {}, {}};
  for (int k = 0; k < kPaths; ++k) {
    const double overlap = std::pow(10.0, random.uniform(-4, -2));
    s.paths.push_back(
        test::tumble(random, test::random_pair_at(random, *body.shape, -overlap), kTurn, kSteps));
  }
  for (int k = 0; k < 256; ++k) {
    s.directions.push_back(random.direction());
    s.points.push_back({static_cast<int>(random.uniform(0, body.shape->patches.size() - 1e-9)),
                        random.uniform(0.05, 0.95), random.uniform(0.05, 0.95)});
  }
  return scenes.emplace(which, std::move(s)).first->second;
}

ContactSettings host_settings() {  // as the pair style asks: contacts only, tolerance 1e-9
  ContactSettings settings;
  settings.reach = 0;
  return settings;
}

// Time of this thread for a call, s.
template <class Call>
double timed(const Call& call) {
  const double cost = clock_cost(), start = thread_seconds();
  call();
  return thread_seconds() - start - cost;
}
// Ends the iteration of a kernel that times itself: so many calls took so long.
void set_time(benchmark::State& state, double seconds, int calls) {
  state.SetIterationTime(std::max(1e-9, seconds) / calls);
}

// --- surfaces and supports
// ------------------------------------------------------------------------------------------

void evaluate2_throughput(benchmark::State& state, int which) {
  const Scene& s = scene(which);
  const auto& patches = s.body->shape->patches;
  size_t k = 0;
  for (auto _ : state) {
    const SurfacePoint& p = s.points[k++ & 255];
    benchmark::DoNotOptimize(evaluate2(patches[p.patch], p.u, p.v));
  }
}

// Every evaluation waits for the one before.
void evaluate2_latency(benchmark::State& state, int which) {
  const Scene& s = scene(which);
  const auto& patches = s.body->shape->patches;
  size_t k = 0;
  double wait = 0;
  for (auto _ : state) {
    const SurfacePoint& p = s.points[k++ & 255];
    const Jet2 jet = evaluate2(patches[p.patch], p.u + wait, p.v);
    wait = 1e-300 * (jet.s[0] + jet.svv[2]);
  }
  benchmark::DoNotOptimize(wait);
}

void support_cold(benchmark::State& state, int which) {
  const Scene& s = scene(which);
  size_t k = 0;
  for (auto _ : state) benchmark::DoNotOptimize(find_hull_support(*s.body->shape, s.directions[k++ & 255]).h);
}

// From the support point of a direction 2e-3 rad away.
void support_warm(benchmark::State& state, int which) {
  const Scene& s = scene(which);
  std::vector<SurfacePoint> starts;
  for (const Vec3& d : s.directions)
    starts.push_back(find_support(*s.body->shape, (d + kTurn * d.unitOrthogonal()).normalized()).where);
  size_t k = 0;
  for (auto _ : state) {
    const size_t i = k++ & 255;
    benchmark::DoNotOptimize(find_hull_support(*s.body->shape, s.directions[i], &starts[i]).h);
  }
}

void support_upper(benchmark::State& state, int which) {
  const Scene& s = scene(which);
  size_t k = 0;
  for (auto _ : state) benchmark::DoNotOptimize(s.body->shape->atlas.support_upper(s.directions[k++ & 255]));
}

// --- rungs
// --------------------------------------------------------------------------------------------------------

// Runs `pairs` with their memories in turn; every answer must come from `rung`, or the benchmark is an error.
struct Rehearsed {
  std::vector<Pair> pairs;
  std::vector<std::array<double, kPairMemorySize>> memories;
};

void run_rung(benchmark::State& state, Rehearsed& r, Rung rung) {
  const ContactSettings settings = host_settings();
  for (size_t i = 0; i < r.pairs.size(); ++i) {
    auto memory = r.memories[i];
    if (find_contact(r.pairs[i].a, r.pairs[i].b, settings, memory.data()).rung != rung) {
      state.SkipWithError("answered by another rung");
      return;
    }
  }
  size_t k = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(find_contact(r.pairs[k].a, r.pairs[k].b, settings, r.memories[k].data()).gap);
    if (++k == r.pairs.size()) k = 0;
  }
}

// Apart by a few per cent, proven so a step ago, and not by the bounding spheres, which the host looks at
// first.
void budget(benchmark::State& state, int which) {
  Rehearsed r;
  for (const auto& path : scene(which).paths) {
    Pair pair = path[0];
    pair.b.x *= 1.1;
    std::array<double, kPairMemorySize> memory{};
    find_contact(pair.a, pair.b, host_settings(), memory.data());
    if (memory_at(memory.data()).proof.stamp == 0) continue;
    pair.b.x += 1e-6 * Vec3::Ones();
    if (find_contact(pair.a, pair.b, host_settings(), memory.data()).rung != Rung::safe) continue;
    r.pairs.push_back(pair);
    r.memories.push_back(memory);
  }
  run_rung(state, r, Rung::safe);
}

// Nothing is known, the bounding spheres meet, and one look at the atlases proves the pair apart. The memory
// is emptied again before each call.
void bounds(benchmark::State& state, int which) {
  std::vector<Pair> pairs;
  const ContactSettings settings = host_settings();
  std::array<double, kPairMemorySize> memory{};
  for (const auto& path : scene(which).paths)
    for (double away : {1.02, 1.05, 1.1, 1.15, 1.2}) {
      Pair pair = path[0];
      pair.b.x *= away;
      memory.fill(0);
      if (find_contact(pair.a, pair.b, settings, memory.data()).rung == Rung::bounds) pairs.push_back(pair);
    }
  if (pairs.empty()) {
    state.SkipWithError("no pair is rejected by bounds");
    return;
  }
  size_t k = 0;
  for (auto _ : state) {
    memory_at(memory.data()).proof.stamp = 0;  // nothing is known
    benchmark::DoNotOptimize(find_contact(pairs[k].a, pairs[k].b, settings, memory.data()).gap);
    if (++k == pairs.size()) k = 0;
  }
}

// Overlapping, moved and turned by 1e-6 since the last solve.
void resting(benchmark::State& state, int which) {
  Rehearsed r;
  Random random(5);
  for (const auto& path : scene(which).paths) {
    Pair pair = path[0];
    std::array<double, kPairMemorySize> memory{};
    const auto nudge = [&] {
      pair.a.q = (Quat(Eigen::AngleAxisd(kRest, random.direction())) * pair.a.q).normalized();
      pair.b.x += kRest * random.direction();
    };
    for (int k = 0; k < 4; ++k) {  // cold, warm, then the model
      find_contact(pair.a, pair.b, host_settings(), memory.data());
      nudge();
    }
    auto trial = memory;
    if (find_contact(pair.a, pair.b, host_settings(), trial.data()).rung != Rung::local_model) continue;
    r.pairs.push_back(pair);
    r.memories.push_back(memory);
  }
  state.counters["served"] = static_cast<double>(r.pairs.size()) / scene(which).paths.size();
  run_rung(state, r, Rung::local_model);
}

// A contact's life: both bodies turn 2e-3 rad a step. One iteration is one whole path.
void turning(benchmark::State& state, int which, Solver solver) {
  const Scene& s = scene(which);
  ContactSettings settings = host_settings();
  settings.solver = solver;
  double memory[kPairMemorySize];
  size_t k = 0, warm = 0, all = 0;
  for (auto _ : state) {
    const auto& path = s.paths[k];
    if (++k == s.paths.size()) k = 0;
    std::memset(memory, 0, sizeof memory);
    find_contact(path[0].a, path[0].b, settings, memory);
    find_contact(path[1].a, path[1].b, settings, memory);
    const double spent = timed([&] {
      for (int i = 2; i < kSteps; ++i) {
        const ContactResult r = find_contact(path[i].a, path[i].b, settings, memory);
        warm += r.rung == Rung::warm || r.rung == Rung::local_model;
        ++all;
      }
    });
    set_time(state, spent, kSteps - 2);
  }
  if (solver == Solver::ladder) state.counters["warm share"] = static_cast<double>(warm) / all;
}

// A body that turns `turn` rad a step, half sunk into a plane. One iteration is one whole path.
void plane(benchmark::State& state, int which, double turn) {
  const Scene& s = scene(which);
  const ContactSettings settings = host_settings();
  Random random(9);
  const Quat step(Eigen::AngleAxisd(turn, random.direction()));
  double memory[kPairMemorySize];
  size_t k = 0;
  for (auto _ : state) {
    std::vector<Particle> path{s.paths[k][0].a};
    if (++k == s.paths.size()) k = 0;
    while (path.size() < kSteps) {
      path.push_back(path.back());
      path.back().q = (step * path.back().q).normalized();
    }
    std::memset(memory, 0, sizeof memory);
    const Vec3 up(0, 0, 1), origin(0, 0, path[0].x[2]);
    for (int i = 0; i < 2; ++i) find_plane_contact(path[i], origin, up, settings, memory);
    const double spent = timed([&] {
      for (int i = 2; i < kSteps; ++i)
        benchmark::DoNotOptimize(find_plane_contact(path[i], origin, up, settings, memory).gap);
    });
    set_time(state, spent, kSteps - 2);
  }
}

// The same on the wall of a tube of ten times its size, as a wall keeps its contacts from step to step.
void tube(benchmark::State& state, int which, double turn) {
  const Scene& s = scene(which);
  const ContactSettings settings = host_settings();
  Random random(9);
  const Quat step(Eigen::AngleAxisd(turn, random.direction()));
  const Shape& shape = *s.body->shape;
  const double radius = 10 * shape.bounding_radius;
  const Vec3 axis(0, 0, 1), out(1, 0, 0);
  size_t k = 0;
  for (auto _ : state) {
    Particle body = s.paths[k][0].a;
    if (++k == s.paths.size()) k = 0;
    std::vector<Particle> path;
    while (path.size() < kSteps) {
      body.x = (radius - find_support(shape, body.q.conjugate() * out).h + 1e-3) * out;
      path.push_back(body);
      body.q = (step * body.q).normalized();
    }
    SurfaceContacts found;
    TubeSurvey survey;
    double spent = 0;
    for (int i = 0; i < kSteps; ++i) {
      const SurfaceContacts last = found;
      FormerContact former[kSurfaceContacts];
      for (int j = 0; j < last.count; ++j) former[j] = former_contact(last.contact[j]);
      const double step_time = timed([&] {
        find_cylinder_contacts(path[i], Vec3::Zero(), axis, radius, settings, 0, former, last.count, &survey,
                               &found);
      });
      if (i > 1) spent += step_time;
    }
    set_time(state, spent, kSteps - 2);
  }
}

void cold(benchmark::State& state, int which, Solver solver) {
  const Scene& s = scene(which);
  ContactSettings settings = host_settings();
  settings.solver = solver;
  std::array<double, kPairMemorySize> memory;
  size_t k = 0;
  for (auto _ : state) {
    const Pair& pair = s.paths[k % s.paths.size()][k / s.paths.size() % kSteps];
    ++k;
    memory.fill(0);
    benchmark::DoNotOptimize(find_contact(pair.a, pair.b, settings, memory.data()).gap);
  }
}

// The same in the stages of a step, eight pairs side by side where it can be, contacts with their law: per
// pair. Bodies that stay put but for `rest`, a neighbour's motion; in contact or, `away`, apart. One
// iteration is one step.
void staged_rest(benchmark::State& state, int which, double away) {
  Random random(7);
  std::vector<std::vector<Pair>> paths;
  for (const auto& path : scene(which).paths) {
    Pair pair = path[0];
    pair.b.x *= away;
    paths.push_back({pair, pair});
    paths.back()[1].b.x += kRest * random.direction();
    paths.back()[1].a.q = (Quat(Eigen::AngleAxisd(kRest, random.direction())) * pair.a.q).normalized();
  }
  StagedPairs pairs(paths, kCopies);
  for (int i = 0; i < 4; ++i) {
    pairs.place(i % 2);
    pairs.compute();
  }
  int i = 0;
  for (auto _ : state) {
    pairs.place(i++ % 2);
    set_time(state, timed([&] { pairs.compute(); }), pairs.pairs());
  }
  state.counters["served"] =
      pairs.counts().value[away > 1 ? ContactCounts::safe : ContactCounts::local_model] / pairs.pairs();
}

// One iteration is the whole of all paths.
void staged_turning(benchmark::State& state, int which) {
  const Scene& s = scene(which);
  double warm = 0;
  for (auto _ : state) {
    StagedPairs pairs(s.paths, kCopies);
    double spent = 0;
    for (int i = 0; i < kSteps; ++i) {
      pairs.place(i);
      const double step_time = timed([&] { pairs.compute(); });
      if (i < 2) continue;
      spent += step_time;
      warm = (pairs.counts().value[ContactCounts::warm] + pairs.counts().value[ContactCounts::local_model]) /
             pairs.pairs();
    }
    set_time(state, spent, (kSteps - 2) * pairs.pairs());
  }
  state.counters["warm share"] = warm;
}

// One body's part of a step: both half kicks of velocity and angular momentum, the drift of place and
// orientation, and the angular velocity at both ends, eight bodies a time. Free but for a small torque.
void integration(benchmark::State& state, int which) {
  struct Moving {
    Vec3 x, v, force, momentum, torque, omega;
    Quat q;
  };
  constexpr int kBatch = RotorBatch::kBodies, kBodyCount = 32 * kBatch;
  constexpr double dt = kTurn;  // at unit spin
  const Shape& shape = *scene(which).body->shape;
  const Rotor rotor = make_rotor(shape.principal_gyration, shape.principal_axes);
  Random random(13);
  std::vector<Moving> bodies;
  for (int k = 0; k < kBodyCount; ++k)
    bodies.push_back({random.direction(), random.direction(), random.direction(),
                      shape.principal_gyration[1] * random.direction(), 1e-3 * random.direction(),
                      Vec3::Zero(), Quat(Eigen::AngleAxisd(random.uniform(0, 3), random.direction()))});
  RotorBatch batch;
  const auto kick = [&](Moving* first) {
    for (int lane = 0; lane < kBatch; ++lane) {
      first[lane].v += 0.5 * dt * first[lane].force;
      first[lane].momentum += 0.5 * dt * first[lane].torque;
      batch.set_momentum(lane, first[lane].momentum);
      batch.set_q(lane, first[lane].q);
    }
  };
  int k = 0;
  while (state.KeepRunningBatch(kBatch)) {
    Moving* first = &bodies[k];
    k = (k + kBatch) % kBodyCount;
    kick(first);
    drift(rotor, dt, &batch);
    for (int lane = 0; lane < kBatch; ++lane) {
      first[lane].x += dt * first[lane].v;
      first[lane].q = batch.get_q(lane);
      first[lane].omega = batch.get_velocity(lane);
    }
    benchmark::ClobberMemory();
    kick(first);
    find_angular_velocity(rotor, &batch);
    for (int lane = 0; lane < kBatch; ++lane) first[lane].omega = batch.get_velocity(lane);
    benchmark::ClobberMemory();
  }
}

// --- rows
// ---------------------------------------------------------------------------------------------------------

struct Row {
  std::string body, kernel;
  std::vector<double> ns;
  std::map<std::string, double> counters;
};

double quantile(std::vector<double> x, double q) {
  std::sort(x.begin(), x.end());
  return x[static_cast<size_t>(q * (x.size() - 1) + 0.5)];
}

// Collects every repetition of every benchmark, named body/kernel.
class Collector : public benchmark::BenchmarkReporter {
 public:
  explicit Collector(const std::vector<std::string>& names) {  // rows in the order of registration
    for (const std::string& name : names) find(name);
  }
  bool ReportContext(const Context&) override { return true; }
  void ReportRuns(const std::vector<Run>& runs) override {
    for (const Run& run : runs) {
      if (run.run_type != Run::RT_Iteration) continue;
      const std::string& name = run.run_name.function_name;
      if (run.error_occurred) {
        std::printf("%s: %s\n", name.c_str(), run.error_message.c_str());
        continue;
      }
      Row& row = find(name);
      const bool manual = !run.run_name.time_type.empty();
      row.ns.push_back(manual ? run.GetAdjustedRealTime() : run.GetAdjustedCPUTime());
      for (const auto& c : run.counters) row.counters[c.first] = c.second;
    }
  }
  std::vector<Row> rows;

 private:
  Row& find(const std::string& name) {
    const size_t slash = name.find('/');
    const std::string body = name.substr(0, slash), kernel = name.substr(slash + 1);
    for (Row& row : rows)
      if (row.body == body && row.kernel == kernel) return row;
    rows.push_back({body, kernel, {}, {}});
    return rows.back();
  }
};

std::vector<std::string> register_all() {
  std::vector<std::string> names;
  for (int which = kClosedForm; which < static_cast<int>(smooth_bodies().size()); ++which) {
    const std::string body = body_of(which).name + "/";
    const auto add = [&](const char* kernel, auto&& f) {
      names.push_back(body + kernel);
      return benchmark::RegisterBenchmark((body + kernel).c_str(), f)->Repetitions(kBatches);
    };
    // Kernels that time themselves.
    const auto add_timed = [&](const char* kernel, int iterations, auto&& f) {
      add(kernel, f)->UseManualTime()->Iterations(iterations);
    };
    add("evaluate2 throughput", [=](benchmark::State& s) { evaluate2_throughput(s, which); });
    add("evaluate2 latency", [=](benchmark::State& s) { evaluate2_latency(s, which); });
    add("atlas support_upper", [=](benchmark::State& s) { support_upper(s, which); });
    add("support warm", [=](benchmark::State& s) { support_warm(s, which); });
    add("support cold", [=](benchmark::State& s) { support_cold(s, which); });
    add("skipped by budget", [=](benchmark::State& s) { budget(s, which); });
    add("rejected by bounds", [=](benchmark::State& s) { bounds(s, which); });
    add("resting", [=](benchmark::State& s) { resting(s, which); });
    add_timed("turning 2e-3", kPaths, [=](benchmark::State& s) { turning(s, which, Solver::ladder); });
    add_timed("turning 2e-3 cso", kPaths, [=](benchmark::State& s) { turning(s, which, Solver::cso); });
    add_timed("plane, turning 2e-3", kPaths, [=](benchmark::State& s) { plane(s, which, kTurn); });
    add_timed("plane, resting", kPaths, [=](benchmark::State& s) { plane(s, which, kRest); });
    add_timed("tube, turning 2e-3", kPaths, [=](benchmark::State& s) { tube(s, which, kTurn); });
    add_timed("tube, resting", kPaths, [=](benchmark::State& s) { tube(s, which, kRest); });
    add_timed("step: skipped neighbour", 50, [=](benchmark::State& s) { staged_rest(s, which, 1.1); });
    add_timed("step: resting contact", 50, [=](benchmark::State& s) { staged_rest(s, which, 1); });
    add_timed("step: turning contact", 2, [=](benchmark::State& s) { staged_turning(s, which); });
    add("integration", [=](benchmark::State& s) { integration(s, which); });
    add("cold", [=](benchmark::State& s) { cold(s, which, Solver::ladder); });
    add("cold cso", [=](benchmark::State& s) { cold(s, which, Solver::cso); });
  }
  return names;
}

// Time of each of many cold contacts at random poses and overlaps up to 1 %, the best of three.
Row cold_tail(const Body& body, int pairs, double* p99, double* worst, int* unresolved) {
  Random random(3);
  std::vector<double> ns;
  *unresolved = 0;
  for (int k = 0; k < pairs; ++k) {
    const Pair pair = test::random_pair_at(random, *body.shape, -random.uniform(1e-4, 1e-2));
    double best = 1;
    for (int repeat = 0; repeat < 3; ++repeat) {
      double memory[kPairMemorySize] = {};
      ContactResult r;
      best = std::min(best, timed([&] { r = find_contact(pair.a, pair.b, host_settings(), memory); }));
      *unresolved += repeat == 0 && r.status == Status::unresolved;
    }
    ns.push_back(1e9 * best);
  }
  *p99 = quantile(ns, 0.99);
  *worst = quantile(ns, 1);
  return {body.name, "cold any pose", ns, {}};
}

void write(std::ofstream& out, const Row& row, double median, double low, double high, double evaluation) {
  const double ratio = median / evaluation;
  std::printf("%-10s %-24s %10.1f ns  %9.2f x evaluate2", row.body.c_str(), row.kernel.c_str(), median,
              ratio);
  for (const auto& c : row.counters) std::printf("   %s %.3f", c.first.c_str(), c.second);
  std::printf("\n");
  out << row.body << "," << row.kernel << "," << median << "," << low << "," << high << "," << ratio << "\n";
}

}  // namespace
}  // namespace nurbs::bench

int main(int argc, char** argv) {
  using namespace nurbs::bench;
  std::string file = "kernels.csv";
  int cold_pairs = kColdPairs;
  std::vector<char*> rest;
  for (int k = 0; k < argc; ++k) {
    if (std::strncmp(argv[k], "--out=", 6) == 0)
      file = argv[k] + 6;
    else if (std::strncmp(argv[k], "--cold-pairs=", 13) == 0)
      cold_pairs = std::atoi(argv[k] + 13);
    else
      rest.push_back(argv[k]);
  }
  std::string interleave = "--benchmark_enable_random_interleaving=true", time = "--benchmark_min_time=0.01";
  rest.insert(rest.begin() + 1, {interleave.data(), time.data()});
  int count = static_cast<int>(rest.size());
  benchmark::Initialize(&count, rest.data());
  Collector collector(register_all());
  benchmark::RunSpecifiedBenchmarks(&collector);

  std::ofstream out(file);
  out << "# " << machine_name() << "; medians of " << kBatches
      << " batches, interleaved; of single contacts in the 'cold, any pose' rows\n"
      << "body,kernel,ns_median,ns_low,ns_high,ratio_to_evaluate2\n";
  std::map<std::string, double> evaluation;
  for (const Row& row : collector.rows)
    if (row.kernel == "evaluate2 throughput" && !row.ns.empty()) evaluation[row.body] = quantile(row.ns, 0.5);
  for (const Row& row : collector.rows) {
    if (row.ns.empty()) continue;
    write(out, row, quantile(row.ns, 0.5), quantile(row.ns, 0.1), quantile(row.ns, 0.9),
          evaluation[row.body]);
  }
  if (cold_pairs > 0)
    for (const Body& body : smooth_bodies()) {
      double p99, worst;
      int unresolved;
      const Row row = cold_tail(body, cold_pairs, &p99, &worst, &unresolved);
      write(out, row, quantile(row.ns, 0.5), quantile(row.ns, 0.01), p99, evaluation[body.name]);
      out << body.name << ",cold any pose worst," << worst << ",,,\n";
      std::printf("%-10s cold, any pose, %d pairs: 99 %% within %.0f ns, worst %.0f ns, unresolved %d\n",
                  body.name.c_str(), cold_pairs, p99, worst, unresolved);
    }
  return out ? 0 : 1;
}

// The accuracy-speed chart's data: error in gap, normal, contact points and force against time per contact,
// for every method and body, in one run. Usage: accuracy_speed OUT.csv [seconds per method and body, default
// 1].
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "bench/bodies.h"
#include "bench/competitors.h"
#include "bench/machine.h"
#include "support/ellipsoid_oracle.h"
#include "support/reference.h"

namespace nurbs::bench {
namespace {

constexpr int kPaths = 32, kSteps = 25;  // pairs, and time steps of each; step 0 starts the warm methods
constexpr double kTurn = 2e-3;           // rad per step, either body
constexpr int kRounds = 15;              // batches of every method, taken in turn
constexpr double kLargestReach = 1e6;    // answers wilder than this count as failed

struct Scene {
  const Body* body;
  std::vector<std::vector<Pair>> paths;
  std::vector<std::vector<Reference>> references;
};

Scene make_scene(const Body& body) {
  Random random(2026);
  Scene scene{&body, {}, {}};
  for (int k = 0; k < kPaths; ++k) {
    const double overlap = std::pow(10.0, random.uniform(-4, -2));
    scene.paths.push_back(
        test::tumble(random, test::random_pair_at(random, *body.shape, -overlap), kTurn, kSteps));
    std::vector<Reference> references;
    for (const Pair& pair : scene.paths.back()) references.push_back(make_reference(pair));
    scene.references.push_back(references);
  }
  return scene;
}

double size_of(const Pair& pair) {
  return std::min(pair.a.scale * pair.a.shape->bounding_radius, pair.b.scale * pair.b.shape->bounding_radius);
}

// How far the references are from the closed form of ellipsoids, and how many were polished.
void report_references(const Scene& scene) {
  int polished = 0, count = 0;
  double worst = 0;
  for (size_t i = 0; i < scene.paths.size(); ++i)
    for (size_t k = 0; k < scene.paths[i].size(); ++k, ++count) polished += scene.references[i][k].polished;
  if (scene.body->semi_axes.norm() > 0)
    for (size_t i = 0; i < scene.paths.size(); ++i) {
      const Pair& p = scene.paths[i].back();
      const auto a = oracle::make_ellipsoid(p.a.scale * scene.body->semi_axes, p.a.x, p.a.q);
      const auto b = oracle::make_ellipsoid(p.b.scale * scene.body->semi_axes, p.b.x, p.b.q);
      const auto exact = oracle::signed_distance(a, b);
      worst = std::max(worst, static_cast<double>(std::abs(exact.gap - scene.references[i].back().gap)));
    }
  std::printf("%s: %d references, %d polished in long double", scene.body->name.c_str(), count, polished);
  if (scene.body->semi_axes.norm() > 0) std::printf(", largest difference to the closed form %.1e", worst);
  std::printf("\n");
}

struct Entry {
  std::unique_ptr<Method> method;
  double setting;  // tolerance, vertices or spheres
  bool warm;
  std::vector<double> seconds;  // per contact, one per batch
  double spent = 0;
  std::vector<double> gap, normal, points;  // errors, relative or rad
  std::vector<double> force;                // of kn overlap along the normal, relative to it
  int failed = 0;
  double model_error = 0;
};

std::vector<Entry> make_entries(const Body& body) {
  std::vector<Entry> entries;
  const auto add = [&](std::unique_ptr<Method> method, double setting, bool warm) {
    Entry e;
    e.method = std::move(method);
    e.setting = setting;
    e.warm = warm;
    e.model_error = e.method->model_error(*body.shape);
    entries.push_back(std::move(e));
  };
  for (double tolerance : {1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-14})
    for (bool warm : {true, false}) {
      add(make_ours(tolerance, warm), tolerance, warm);
      add(make_cso(tolerance, warm), tolerance, warm);
    }
  for (int vertices : {50, 400, 2500, 10000, 50000}) {
    add(make_libccd(vertices, CcdAlgorithm::gjk_epa), vertices, false);
    add(make_libccd(vertices, CcdAlgorithm::mpr), vertices, false);
    add(make_bullet(vertices), vertices, false);
    if (vertices <= 2500) add(make_fcl(vertices), vertices, false);
  }
  add(make_ellipsoid_fit(), 0, true);
  for (int spheres : {10, 30, 100, 300, 1000}) add(make_clump(spheres), spheres, false);
  return entries;
}

// One batch: every path from its start; only the steps after the first are timed and kept.
double run_batch(const Scene& scene, Entry& e, std::vector<Answer>* answers) {
  double seconds = -clock_cost() * scene.paths.size();
  size_t kept = 0;
  for (const auto& path : scene.paths) {
    e.method->begin_pair();
    e.method->solve(path[0].a, path[0].b);
    const double start = thread_seconds();
    for (size_t k = 1; k < path.size(); ++k) (*answers)[kept++] = e.method->solve(path[k].a, path[k].b);
    seconds += thread_seconds() - start;
  }
  return seconds / kept;
}

void measure_errors(const Scene& scene, Entry& e, const std::vector<Answer>& answers) {
  size_t kept = 0;
  for (size_t i = 0; i < scene.paths.size(); ++i)
    for (size_t k = 1; k < scene.paths[i].size(); ++k) {
      const Answer& x = answers[kept++];
      const Reference& r = scene.references[i][k];
      const double size = size_of(scene.paths[i][k]);
      // A chart of contacts: "apart" is an answer only where there is a distance to go with it.
      if (!x.ok || !(std::abs(x.gap) < kLargestReach * size) || !x.normal.allFinite()) {
        ++e.failed;
        continue;
      }
      e.gap.push_back(std::abs(x.gap - r.gap) / size);
      e.normal.push_back(angle_between(x.normal, r.normal));
      e.force.push_back((std::min(x.gap, 0.0) * x.normal - r.gap * r.normal).norm() / std::abs(r.gap));
      e.points.push_back(std::max((x.point_a - r.point_a).norm(), (x.point_b - r.point_b).norm()) / size);
    }
}

double quantile(std::vector<double> x, double q) {
  if (x.empty()) return std::nan("");
  std::sort(x.begin(), x.end());
  return x[static_cast<size_t>(q * (x.size() - 1) + 0.5)];
}

void write_rows(std::ofstream& out, const Scene& scene, std::vector<Entry>& entries) {
  for (Entry& e : entries) {
    char row[640];
    int n = std::snprintf(row, sizeof row, "%s,%s,%g,%.3e,%zu,%d,%zu,%.1f,%.1f,%.1f",
                          scene.body->name.c_str(), e.method->name().c_str(), e.setting, e.model_error,
                          e.gap.size(), e.failed, e.seconds.size(), 1e9 * quantile(e.seconds, 0.5),
                          1e9 * quantile(e.seconds, 0), 1e9 * quantile(e.seconds, 0.75));
    for (const auto* x : {&e.gap, &e.normal, &e.points, &e.force})
      n += std::snprintf(row + n, sizeof row - n, ",%.3e,%.3e,%.3e", quantile(*x, 0.5), quantile(*x, 0.95),
                         quantile(*x, 1));
    out << row << "\n" << std::flush;
    std::printf("%s\n", row);
  }
}

void run_body(const Body& body, double budget, std::ofstream& out) {
  const Scene scene = make_scene(body);
  report_references(scene);
  std::vector<Entry> entries = make_entries(body);
  std::vector<Answer> answers(kPaths * (kSteps - 1));
  for (int round = 0; round < kRounds; ++round)
    for (Entry& e : entries) {
      if (round > 0 && e.spent > budget) continue;
      if (round == 0) {  // builds models and fills caches, untimed
        run_batch(scene, e, &answers);
        measure_errors(scene, e, answers);
      }
      e.seconds.push_back(run_batch(scene, e, &answers));
      e.spent += e.seconds.back() * answers.size();
    }
  write_rows(out, scene, entries);
}

}  // namespace
}  // namespace nurbs::bench

int main(int argc, char** argv) {
  using namespace nurbs::bench;
  if (argc < 2) {
    std::fprintf(stderr, "usage: accuracy_speed OUT.csv [seconds per method and body]\n");
    return 2;
  }
  std::ofstream out(argv[1]);
  out << "# " << machine_name() << "\n"
      << "body,method,setting,model_error,contacts,failed,batches,ns,ns_best,ns_75,gap_median,gap_95,gap_max,"
         "normal_median,normal_95,normal_max,points_median,points_95,points_max,"
         "force_median,force_95,force_max\n";
  for (const Body& body : smooth_bodies()) run_body(body, argc > 2 ? std::atof(argv[2]) : 1, out);
  return out ? 0 : 1;
}

// Pairs of a body with itself, posed first, then timed.
#include "tools/contact_cost.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <random>
#include <vector>

#include "contact/pair_search.h"

namespace nurbs {
namespace {

constexpr int kPairs = 25, kRests = 200, kTurns = 40, kColds = 3;
constexpr double kDepth = 1e-4;  // of the bounding radius
constexpr double kTurn = 1e-3;   // rad a step
constexpr int kApproaches = 4;   // until the overlap is about that

struct Poses {
  std::vector<Particle> a, b;
};

class Random {
 public:
  double normal() { return normal_(engine_); }
  Vec3 direction() {
    const double x = normal(), y = normal(), z = normal();
    return Vec3(x, y, z).normalized();
  }
  Quat turn() {
    const double w = normal(), x = normal(), y = normal(), z = normal();
    return Quat(w, x, y, z).normalized();
  }

 private:
  std::mt19937_64 engine_{1};
  std::normal_distribution<double> normal_;
};

// Moves b along the contact's normal until the bodies overlap by about kDepth.
void approach(const Shape& shape, const Particle& a, Particle& b, double* memory) {
  for (int k = 0; k < kApproaches; ++k) {
    const ContactResult r = find_contact(a, b, {}, memory);
    const double off = r.gap + kDepth * shape.bounding_radius;
    b.x -= off * (r.normal.norm() > 0.5 ? r.normal : Vec3((b.x - a.x).normalized()));
    if (std::abs(off) < 0.1 * kDepth * shape.bounding_radius) break;
  }
}

Poses poses(const Shape& shape, Random& random) {
  Poses out;
  Particle a{&shape, 1, Vec3::Zero(), random.turn()}, b{&shape, 1, Vec3::Zero(), random.turn()};
  b.x = 2 * shape.bounding_radius * random.direction();
  const Quat spin_a(Eigen::AngleAxisd(kTurn, random.direction())),
      spin_b(Eigen::AngleAxisd(kTurn, random.direction()));
  double memory[kPairMemorySize] = {0};
  for (int k = 0; k <= kTurns; ++k) {
    approach(shape, a, b, memory);
    out.a.push_back(a);
    out.b.push_back(b);
    a.q = (spin_a * a.q).normalized();
    b.q = (spin_b * b.q).normalized();
  }
  return out;
}

template <class Call>
double nanoseconds(int calls, const Call& call) {
  const auto begin = std::chrono::steady_clock::now();
  for (int k = 0; k < calls; ++k) call(k);
  return 1e9 * std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count() / calls;
}

double median(std::vector<double> x) {
  std::nth_element(x.begin(), x.begin() + static_cast<std::ptrdiff_t>(x.size() / 2), x.end());
  return x[x.size() / 2];
}

}  // namespace

ContactCost measure_contact_cost(const Shape& shape) {
  Random random;
  ContactSettings settings;
  settings.reach = 0;  // as the host asks
  std::vector<double> resting, turning, cold;
  ContactCost cost;
  for (int pair = 0; pair < kPairs; ++pair) {
    const Poses p = poses(shape, random);
    double memory[kPairMemorySize] = {0};
    ContactResult last;
    cold.push_back(nanoseconds(kColds, [&](int) {
      std::fill_n(memory, kPairMemorySize, 0.0);
      last = find_contact(p.a[0], p.b[0], settings, memory);
    }));
    cost.unresolved += last.status == Status::unresolved;
    resting.push_back(
        nanoseconds(kRests, [&](int) { last = find_contact(p.a[0], p.b[0], settings, memory); }));
    turning.push_back(
        nanoseconds(kTurns, [&](int k) { last = find_contact(p.a[k + 1], p.b[k + 1], settings, memory); }));
  }
  cost.resting = median(resting);
  cost.turning = median(turning);
  cost.cold = median(cold);
  return cost;
}

std::string cost_class(const ContactCost& cost) {
  if (cost.cold < 250) return "about a sphere's";
  if (cost.turning < 800) return "low, as of smooth ovals";
  if (cost.turning < 5000) return "middling, as of bodies with flat faces or fine detail";
  return "high: is a simpler body near enough (fit or simplify with another --tolerance)?";
}

}  // namespace nurbs

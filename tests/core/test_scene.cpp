// The stages of a step against the contact search and the law taken one pair at a time.
#include <gtest/gtest.h>

#include <map>

#include "contact/pair_search.h"
#include "scene/contact_stages.h"
#include "support/bodies.h"
#include "support/host_bodies.h"
#include "support/random.h"

namespace nurbs::test_scene {
namespace {

using test::Random;

// Thrown about in a small space above the plane z = 0.
struct Heap : test::HostBodies {
  std::vector<test::ShapePointer> kept;
  std::vector<int> types;
  double dt = 1e-3;

  Heap(Random& random, const std::vector<test::ShapePointer>& from, int count, double spread) : kept(from) {
    shapes.push_back(nullptr);
    for (const auto& s : kept) shapes.push_back(s.get());
    for (int i = 0; i < count; ++i) {
      const int which = 1 + i % static_cast<int>(kept.size());
      const double size = random.uniform(0.7, 1.3);
      const Quat turned = random.turn();
      for (int k = 0; k < 3; ++k) {
        x.push_back(random.uniform(-spread, spread) + (k == 2 ? spread : 0));
        v.push_back(random.uniform(-1, 1));
        w.push_back(random.uniform(-2, 2));
      }
      for (const double c : {turned.w(), turned.x(), turned.y(), turned.z()}) q.push_back(c);
      scale.push_back(size);
      mass.push_back(random.uniform(1, 2));
      radius.push_back(size * kept[which - 1]->bounding_radius);
      shape.push_back(which);
      mask.push_back(1);
      types.push_back(1);
    }
  }
  Particle particle(int i) const {
    Particle p;
    p.shape = shapes[shape[i]];
    p.scale = scale[i];
    p.x = Vec3::Map(&x[3 * i]);
    p.q = Quat(q[4 * i], q[4 * i + 1], q[4 * i + 2], q[4 * i + 3]);
    return p;
  }
  BodyMotion motion(int i) const {
    const Particle p = particle(i);
    return body_motion(Vec3::Map(&v[3 * i]), Vec3::Map(&w[3 * i]), mass[i],
                       mass[i] * p.scale * p.scale * p.shape->principal_gyration,
                       (p.q * p.shape->principal_axes).toRotationMatrix(), dt);
  }
  void move() {  // each about its place
    for (int i = 0; i < count(); ++i) {
      for (int k = 0; k < 3; ++k) x[3 * i + k] += dt * v[3 * i + k];
      const Vec3 by = dt * Vec3::Map(&w[3 * i]);
      turn(i, (Quat(Eigen::AngleAxisd(by.norm(), by.normalized())) * particle(i).q).normalized());
    }
  }
};

struct Loads {
  std::vector<Vec3> force, torque;
  explicit Loads(int n) : force(n, Vec3::Zero()), torque(n, Vec3::Zero()) {}
};

// The same step, pair by pair.
class OneByOne {
 public:
  OneByOne(const ContactSettings& settings, const ContactCoefficients& law)
      : settings_(settings), law_(law) {}
  EnergyLedger ledger;
  int contacts = 0;

  Loads pairs(const Heap& h) {
    Loads loads(h.count());
    for (int i = 0; i < h.count(); ++i)
      for (int j = i + 1; j < h.count(); ++j) {
        auto& [memory, state] = of_[{i, j}];
        const Particle a = h.particle(i), b = h.particle(j);
        const ContactResult r = find_contact(a, b, settings_, memory.data());
        step(r, pair_geometry(r, b.x - a.x), h, i, j, state, loads);
      }
    return loads;
  }
  Loads wall(const Heap& h) {
    Loads loads(h.count());
    for (int i = 0; i < h.count(); ++i) {
      auto& [memory, state] = of_[{-1, i}];
      const Particle p = h.particle(i);
      const ContactResult r = find_plane_contact(p, Vec3::Zero(), Vec3::UnitZ(), settings_, memory.data());
      step(r, wall_geometry(r, p.x), h, -1, i, state, loads);
    }
    return loads;
  }

 private:
  struct Memory {
    std::array<double, kPairMemorySize> memory{};
    ContactState state{};
  };
  void step(const ContactResult& r, const ContactGeometry& g, const Heap& h, int i, int j,
            ContactState& state, Loads& loads) {
    const BodyMotion a = i < 0 ? BodyMotion{} : h.motion(i), b = h.motion(j);
    EnergyLedger work;
    if (touches(r))
      advance_contact(law_, g, a, b, h.dt, state, work);
    else
      end_contact(law_, a, b, h.dt, state, work);
    ledger.damping += work.damping;
    ledger.friction += work.friction;
    if (state.active == 0) return;
    ++contacts;
    const Vec3 f = force_on_b(state);
    if (i >= 0) {
      loads.force[i] -= f;
      loads.torque[i] -= g.arm_a.cross(f);
    }
    loads.force[j] += f;
    loads.torque[j] += g.arm_b.cross(f);
  }
  ContactSettings settings_;
  ContactCoefficients law_;
  std::map<std::pair<int, int>, Memory> of_;
};

// Neighbours and proofs as a host keeps them.
struct Host {
  Bodies bodies;
  ContactStages stages;
  std::vector<PairProof> proofs;
  std::vector<std::pair<int, int>> pairs;
  ContactCoefficients law;
  BodyRecord plane{};

  Host(const ContactCoefficients& coefficients, std::vector<std::pair<int, int>> neighbours)
      : pairs(std::move(neighbours)), law(coefficients) {
    proofs.resize(pairs.size());
    for (int k = 0; k < 9; k += 4) plane.turn[k] = 1;
    plane.radius = kFarAway;
  }
  void hand_in() {
    stages.begin_neighbours();
    for (size_t k = 0; k < pairs.size(); ++k)
      stages.add_neighbour(pairs[k].first, pairs[k].second, &proofs[k]);
    stages.end_neighbours();
  }
  void compute(const Heap& h, const ContactSettings& settings, bool renumbered, bool ledger = true) {
    bodies.update(h.arrays(), h.dt, renumbered);
    if (renumbered) hand_in();
    ContactStages::Step step;
    step.bodies = &bodies;
    step.owned = h.count();
    step.dt = h.dt;
    step.ledger = ledger;
    step.settings = settings;
    step.laws = &law;
    if (pairs[0].first < 0) {
      step.wall = &plane;
      step.wall_normal = Vec3::UnitZ();
    }
    stages.compute(step);
  }
};

std::vector<std::pair<int, int>> all_pairs(int n) {
  std::vector<std::pair<int, int>> pairs;
  for (int i = 0; i < n; ++i)
    for (int j = i + 1; j < n; ++j) pairs.emplace_back(i, j);
  return pairs;
}
std::vector<std::pair<int, int>> with_wall(int n) {
  std::vector<std::pair<int, int>> pairs;
  for (int i = 0; i < n; ++i) pairs.emplace_back(-1, i);
  return pairs;
}

ContactSettings settings(double tolerance) {
  ContactSettings s;
  s.tolerance = tolerance;
  s.reach = 0;
  return s;
}

const ContactCoefficients kLaw{1e3, 5e2, 3, 1, 0.4};

void expect_equal(const Loads& direct, const ContactStages& stages, double tolerance, int step) {
  double size = 0;
  for (const Vec3& f : direct.force) size = std::max(size, f.norm());
  for (size_t i = 0; i < direct.force.size(); ++i) {
    const auto sum = stages.sum(static_cast<int>(i));
    ASSERT_LT((sum.force - direct.force[i]).norm(), tolerance * (1 + size))
        << "step " << step << " body " << i;
    ASSERT_LT((sum.torque - direct.torque[i]).norm(), tolerance * (1 + size))
        << "step " << step << " body " << i;
  }
}

void compare(bool wall, const std::vector<test::ShapePointer>& shapes, double speed, double tolerance) {
  Random random(7);
  Heap heap(random, shapes, 19, wall ? 1.2 : 1.8);
  heap.dt *= speed;
  const auto s = settings(1e-9);
  OneByOne direct(s, kLaw);
  Host host(kLaw, wall ? with_wall(heap.count()) : all_pairs(heap.count()));
  for (int step = 0; step < 150; ++step) {
    heap.move();
    host.compute(heap, s, step % 37 == 0);
    expect_equal(wall ? direct.wall(heap) : direct.pairs(heap), host.stages, tolerance, step);
    if (testing::Test::HasFatalFailure()) return;
  }
  EXPECT_GT(direct.contacts, 300);
  const EnergyLedger& done = host.stages.dissipated();
  EXPECT_NEAR(done.damping, direct.ledger.damping, 1e-6 * std::abs(direct.ledger.damping) + 1e-9);
  EXPECT_NEAR(done.friction, direct.ledger.friction, 1e-6 * std::abs(direct.ledger.friction) + 1e-9);
}

TEST(Stages, equal_the_pairs_one_by_one) {
  compare(false, {test::sphere(), test::ellipsoid(), test::smooth_pebble()}, 1, 1e-5);
}
TEST(Stages, equal_the_pairs_one_by_one_nearly_at_rest) {
  compare(false, {test::sphere(), test::ellipsoid(), test::smooth_pebble()}, 1e-3, 1e-5);
}
TEST(Stages, equal_plane_contacts_one_by_one) {
  compare(true, {test::sphere(), test::ellipsoid(), test::smooth_pebble()}, 1, 1e-5);
}
TEST(Stages, equal_plane_contacts_one_by_one_nearly_at_rest) {
  compare(true, {test::sphere(), test::ellipsoid(), test::smooth_pebble()}, 1e-3, 1e-5);
}

// Frictionless forces of coarse tolerances against those of the finest, body by body.
void compare_tolerances(bool wall, double speed) {
  constexpr double kFew = 4;
  const ContactCoefficients elastic{1e3, 0, 0, 0, 0};
  for (const double tolerance : {1e-4, 1e-6, 1e-9}) {
    Random random(9);
    Heap heap(random, {test::sphere(), test::ellipsoid(), test::smooth_pebble()}, 25, wall ? 1.2 : 2.2);
    heap.dt *= speed;
    const auto pairs = wall ? with_wall(heap.count()) : all_pairs(heap.count());
    Host coarse(elastic, pairs), fine(elastic, pairs);
    int loaded = 0;
    double worst = 0;
    for (int step = 0; step < 100; ++step) {
      heap.move();
      coarse.compute(heap, settings(tolerance), step == 0);
      fine.compute(heap, settings(1e-12),
                   step == 0);  // nearer to round-off deep pairs change rungs by chance
      for (int i = 0; i < heap.count(); ++i) {
        const auto a = coarse.stages.sum(i), b = fine.stages.sum(i);
        if (!(b.normal > 0)) continue;
        ++loaded;
        const double size = b.normal + elastic.kn * kForceDepth;
        const double error = (a.force - b.force).norm() / size;
        worst = std::max(worst, error / tolerance);
        ASSERT_LT(error, kFew * tolerance) << "step " << step << " body " << i << " of " << tolerance;
      }
    }
    EXPECT_GT(loaded, 500);
    testing::Test::RecordProperty("worst_" + std::to_string(tolerance), std::to_string(worst));
  }
}
TEST(Stages, forces_are_right_to_the_tolerance) {
  for (const double speed : {0.01, 0.1, 1.0}) compare_tolerances(false, speed);
}
TEST(Stages, wall_forces_are_right_to_the_tolerance) {
  for (const double speed : {0.01, 0.1, 1.0}) compare_tolerances(true, speed);
}

}  // namespace
}  // namespace nurbs::test_scene

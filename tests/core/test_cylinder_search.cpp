// Bodies in a tube: contacts are the maxima of the reach that dense sampling finds, a body that touches
// nothing is told how far it is from the wall, and a contact that is followed from step to step is the one
// that a search from scratch finds.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "contact/walls/cylinder_search.h"
#include "support/bodies.h"
#include "support/flat_bodies.h"
#include "support/random.h"
#include "support/solids.h"

namespace nurbs::test_cylinder_search {
namespace {

using namespace test;

constexpr int kAround = 2048;  // directions sampled
constexpr double kPath = 5;    // that the body has gone

SurfaceContacts find_from_scratch(const Particle& p, const Vec3& origin, const Vec3& axis, double radius) {
  SurfaceContacts found;
  find_cylinder_contacts(p, origin, axis, radius, {}, kPath, nullptr, 0, nullptr, &found);
  return found;
}

// The body's reach from the axis along all directions square to it, counted from u.
std::vector<double> reaches(const Particle& p, const Vec3& origin, const Vec3& u, const Vec3& v) {
  std::vector<double> f(kAround);
  for (int k = 0; k < kAround; ++k) {
    const double angle = 2 * M_PI * k / kAround;
    f[k] = -gap_along(p, origin, -(std::cos(angle) * u + std::sin(angle) * v), nullptr).gap;
  }
  return f;
}

TEST(CylinderSearch, contacts_inside_are_the_maxima_of_the_reach) {
  Random random(7);
  const ShapePointer shapes[] = {make_shape("tablet", rounded_cylinder(1, 0.4, 0.15)), cuboid(), ellipsoid(),
                                 smooth_pebble(), make_shape("can", cylinder(0.5, 1.2))};
  int touching = 0, apart = 0, measured = 0, several = 0, subtracting = 0;
  for (int n = 0; n < 250; ++n) {
    const Shape& shape = *shapes[n % 5];
    Particle p;
    p.shape = &shape;
    p.scale = random.uniform(0.5, 1.5);
    p.q = random.turn();
    const double size = p.scale * shape.bounding_radius, radius = size * random.log_uniform(1.02, 20);
    const Vec3 axis = random.direction(), u = axis.unitOrthogonal(), v = axis.cross(u),
               origin = random.box(-1, 1);
    const double turn = random.uniform(-M_PI, M_PI);
    p.x = origin + random.uniform(-2, 2) * axis +
          (radius - size * random.uniform(0.4, 1.1)) * (std::cos(turn) * u + std::sin(turn) * v);
    if (n % 7 == 0) p.x = origin;
    const std::vector<double> f = reaches(p, origin, u, v);
    const double most = *std::max_element(f.begin(), f.end()), coarse = radius * std::pow(M_PI / kAround, 2);
    const SurfaceContacts found = find_from_scratch(p, origin, axis, radius);
    if (std::abs(most - radius) < 2 * coarse) continue;
    SCOPED_TRACE(shape.name + " " + std::to_string(n));
    ASSERT_EQ(found.count > 0, most > radius);
    if (found.count == 0) {
      ++apart;
      EXPECT_LE(found.expiry - kPath, (1 + 1e-12) * (radius - most));
      const double away = (p.x - origin).cross(axis).norm();
      if (away + size > radius && found.expiry > kPath) {  // no news for the bounding sphere
        ++measured;
        EXPECT_GE(found.expiry - kPath, 0.45 * (radius - most) - coarse);
      }
      continue;
    }
    ++touching;
    several += found.count > 1;
    double deepest = 0;
    for (int k = 0; k < found.count; ++k) {
      const SurfaceContact& c = found.contact[k];
      deepest = std::max(deepest, -c.gap);
      subtracting += c.weight < 0;
      EXPECT_NEAR(c.normal.dot(axis), 0, 1e-14);
      // A maximum: no direction nearby reaches further; less far for a minimum.
      for (const double aside : {-1e-4, 1e-4}) {
        const Vec3 d = Eigen::AngleAxisd(aside, axis) * -c.normal;
        EXPECT_LE(c.weight * (-gap_along(p, origin, -d, nullptr).gap - (radius - c.gap)), 1e-12 * radius);
      }
    }
    EXPECT_GE(deepest, most - radius - 1e-12 * radius);
    EXPECT_LE(deepest, most - radius + coarse);
    // Every maximum that no other is near has its contact.
    const int near = 1 + static_cast<int>(std::max(2e-3, 0.02 * size / radius) / (2 * M_PI / kAround));
    for (int k = 0; k < kAround; ++k) {
      bool top = f[k] > radius;
      for (int j = 1; j <= near && top; ++j)
        top = f[k] > f[(k + j) % kAround] && f[k] > f[(k - j + kAround) % kAround];
      if (!top) continue;
      const double angle = 2 * M_PI * k / kAround;
      const Vec3 d = std::cos(angle) * u + std::sin(angle) * v;
      double nearest = -1;
      for (int j = 0; j < found.count; ++j)
        if (found.contact[j].weight > 0) nearest = std::max(nearest, -d.dot(found.contact[j].normal));
      EXPECT_GE(nearest, std::cos(2 * (near + 1) * 2 * M_PI / kAround)) << angle;
    }
  }
  EXPECT_GE(touching, 60);
  EXPECT_GE(apart, 25);
  EXPECT_GE(measured, 10);
  EXPECT_GE(several, 3);
  EXPECT_GE(subtracting, 1);
}

// Boxes along tubes far narrower than they are long: their edges, nearer to each other than a fiftieth of
// their length, were taken for one, which was none of them.
TEST(CylinderSearch, needles_in_narrow_tubes) {
  Random random(8);
  int several = 0;
  for (const double wide : {0.3, 0.1, 0.03, 0.01, 0.003}) {
    const auto needle = make_shape("needle", box(Vec3(1, wide, 0.8 * wide)));
    for (int k = 0; k < 40; ++k) {
      const Vec3 axis = random.direction(), origin = random.box(-1, 1);
      const Quat along = Quat::FromTwoVectors(Vec3::UnitX(), axis);
      Particle p{needle.get(), random.uniform(0.5, 2), Vec3::Zero(),
                 Quat(Eigen::AngleAxisd(random.uniform(-M_PI, M_PI), axis)) * along};
      Vec3 aside = 0.1 * wide * random.direction();
      aside -= aside.dot(axis) * axis;
      p.x = origin + random.uniform(-1, 1) * axis + p.scale * aside;
      const double radius = random.uniform(1.15, 1.27) * wide * p.scale;
      const SurfaceContacts found = find_from_scratch(p, origin, axis, radius);
      int met = 0;
      for (const double y : {-1.0, 1.0})
        for (const double z : {-0.8, 0.8}) {
          const double reach = (p.scale * (aside + p.q * Vec3(0, y * wide, z * wide))).norm();
          if (!(reach > radius)) continue;
          ++met;
          double nearest = 1;
          for (int i = 0; i < found.count; ++i)
            nearest = std::min(nearest, std::abs(found.contact[i].gap - (radius - reach)));
          EXPECT_LT(nearest, 1e-9 * p.scale) << wide << " " << k;
        }
      EXPECT_EQ(found.count, met) << wide << " " << k;
      several += met > 1;
    }
  }
  EXPECT_GT(several, 80);
}

// A ring of contacts is one contact, at round-off's place, whatever the body's poles do; beside the axis it
// is where the body is.
TEST(CylinderSearch, a_round_body_on_the_axis_of_a_narrower_tube_has_one_contact) {
  Random random(8);
  const ShapePointer shapes[] = {sphere(), make_shape("tablet", rounded_cylinder(1, 0.4, 0.15)), disc(),
                                 polar()};
  for (int n = 0; n < 80; ++n) {
    const Shape& shape = *shapes[n % 4];
    Particle p;
    p.shape = &shape;
    p.scale = random.uniform(0.5, 1.5);
    p.q = random.turn();
    // The tube is along the body's axis, which has its points furthest away in a ring.
    const Vec3 axis = p.q * Vec3::UnitZ(), origin = random.box(-1, 1);
    p.x = origin + random.uniform(-2, 2) * axis;
    const double reach = -gap_along(p, origin, -axis.unitOrthogonal(), nullptr).gap, radius = 0.97 * reach;
    SCOPED_TRACE(shape.name + " " + std::to_string(n));
    SurfaceContacts found = find_from_scratch(p, origin, axis, radius);
    ASSERT_EQ(found.count, 1);
    EXPECT_NEAR(found.contact[0].gap, radius - reach, 1e-12 * reach);
    const Vec3 aside = axis.unitOrthogonal();
    p.x += 1e-6 * reach * aside;
    found = find_from_scratch(p, origin, axis, radius);
    ASSERT_EQ(found.count, 1);
    EXPECT_NEAR(found.contact[0].gap, radius - (1 + 1e-6) * reach, 1e-12 * reach);
    EXPECT_NEAR(-found.contact[0].normal.dot(aside), 1, 1e-8);
  }
}

Vec3 across(const Particle& p, const Vec3& origin, const Vec3& axis) {
  const Vec3 apart = p.x - origin;
  return apart - apart.dot(axis) * axis;
}

// What a wall keeps of a body from step to step.
class Follower {
 public:
  void find(const Particle& p, const Vec3& origin, const Vec3& axis, double radius, SurfaceContacts* out) {
    FormerContact former[kSurfaceContacts];
    const int count = last_.count;
    for (int k = 0; k < count; ++k) former[k] = former_contact(last_.contact[k]);
    find_cylinder_contacts(p, origin, axis, radius, {}, kPath, former, count, &survey_, out);
    kept_ = survey_.room > 0 && survey_.pose.apart != across(p, origin, axis);
    last_ = *out;
  }
  // Whether the circle was not surveyed anew.
  bool kept() const { return kept_; }

 private:
  SurfaceContacts last_;
  TubeSurvey survey_;
  bool kept_ = false;
};

// A body that is turned and moved about by 1e-7 to 0.1 rad a step, in spells, through contact and out of it.
class Tumbling {
 public:
  Tumbling(Random& random, const Shape& shape, double side) : random_(random), side_(side) {
    p.shape = &shape;
    p.scale = random.log_uniform(0.01, 100);
    p.q = random.turn();
    size = p.scale * shape.bounding_radius;
    radius = size * (side > 0 ? random.log_uniform(1.3, 40) : random.log_uniform(0.05, 20));
    axis = random.direction();
    origin = size * random.box(-3, 3);
    ahead_ = axis.unitOrthogonal();
  }

  void step() {
    if (left_-- <= 0) {
      left_ = random_.whole(3, 12);
      turn_ = random_.below(4) ? random_.log_uniform(1e-7, 0.1) : 0;
      about_ = random_.direction();
      to_ = size * (random_.below(4) ? -random_.log_uniform(1e-7, 2e-2) : random_.log_uniform(1e-6, 1e-3));
      if (random_.below(3) == 0) gap_ = to_;
    }
    gap_ += 0.3 * (to_ - gap_);
    p.q = (Quat(Eigen::AngleAxisd(turn_, about_)) * p.q).normalized();
    ahead_ = Eigen::AngleAxisd(turn_ * size / radius, axis) * ahead_;
    along_ += 0.1 * turn_ * size;
    p.x = Vec3::Zero();
    double reach = -HUGE_VAL;
    for (int k = -3; k <= 3; ++k) {
      const Vec3 d = side_ * (Eigen::AngleAxisd(0.02 * k * size / radius, axis) * ahead_);
      reach = std::max(reach, -gap_along(p, Vec3::Zero(), -d, nullptr).gap);
    }
    p.x = origin + along_ * axis + (radius - side_ * (reach + gap_)) * ahead_;
  }

  // Turns a direction of the body to the wall, or along the axis, but for `off` rad.
  void lean(const Vec3& n, bool along, double off) {
    const Vec3 to = (along ? axis : ahead_) + off * random_.direction();
    p.q = Quat::FromTwoVectors(n, to.normalized());
  }
  bool inside() const { return (p.x - origin).cross(axis).norm() < radius; }
  // An upper bound of the gap.
  double apart() const {
    double reach = -HUGE_VAL;
    for (int k = -50; k <= 50; ++k) {
      const Vec3 d = Eigen::AngleAxisd(0.002 * k, axis) * ahead_;
      reach = std::max(reach, -gap_along(p, origin, -d, nullptr).gap);
    }
    return inside() ? std::max(0.0, radius - reach) : HUGE_VAL;
  }

  Particle p;
  Vec3 origin, axis;
  double radius, size;

 private:
  Random& random_;
  const double side_;
  Vec3 ahead_, about_;
  double turn_ = 0, gap_ = 0, to_ = 0, along_ = 0;
  int left_ = 0;
};

// By how much the reach falls between two contacts, below the lesser of them.
double fall_between(const Tumbling& body, const Vec3& n, const Vec3& m) {
  const auto reach = [&](const Vec3& d) { return -gap_along(body.p, body.origin, -d, nullptr).gap; };
  const double angle = std::atan2(body.axis.dot(n.cross(m)), n.dot(m));
  double least = HUGE_VAL;
  for (int k = 0; k <= 200; ++k)
    least = std::min(least, reach(Eigen::AngleAxisd(angle * k / 200, body.axis) * -n));
  return std::min(reach(-n), reach(-m)) - least;
}

// Contacts as a search from scratch finds them, to the default tolerance. One that is shallower than it may
// be missing, and so may one that the reach hardly falls from to another. Returns how many are.
int expect_same(const SurfaceContacts& found, const SurfaceContacts& reference, const Tumbling& body) {
  const double allowed = 2e-9 * body.size;
  int merged = 0;
  for (const bool back : {false, true}) {
    const SurfaceContacts &one = back ? reference : found, &other = back ? found : reference;
    for (int k = 0; k < one.count; ++k) {
      const SurfaceContact& c = one.contact[k];
      double nearest = HUGE_VAL;
      const SurfaceContact* same = nullptr;
      for (int j = 0; j < other.count; ++j) {
        const double apart = (other.contact[j].normal - c.normal).norm();
        if (apart < nearest) nearest = apart, same = &other.contact[j];
      }
      if (same == nullptr) {
        EXPECT_LT(-c.gap, allowed) << (back ? "lost" : "made up");
        continue;
      }
      if (nearest > 1e-7 && -c.gap < allowed) continue;
      if (nearest > 1e-7 && body.inside()) {
        // As F'' >= -F, a maximum is at most this above a minimum that far away.
        const double small = 0.5 * body.radius * std::pow(std::max(2e-3, 0.02 * body.size / body.radius), 2);
        EXPECT_LT(fall_between(body, c.normal, same->normal), back ? small : 10 * small)
            << (back ? "missing, " : "extra, ") << nearest << " away, gaps " << c.gap / body.size << " "
            << same->gap / body.size << ", tube " << body.radius / body.size << ", contacts " << found.count
            << " and " << reference.count;
        ++merged;
        continue;
      }
      EXPECT_NEAR(c.gap, same->gap, allowed);
      EXPECT_LT(nearest, 1e-7);
      if (nearest < 1e-8) {
        EXPECT_LT((c.on_body - same->on_body).norm(), 1e-6 * body.size);
      }
    }
  }
  if (found.count == 0) {
    EXPECT_LE(found.expiry - kPath, (1 + 1e-6) * body.apart());
  }
  return merged;
}

// One step: its contacts, followed, are those from scratch but for so many.
int step_and_compare(Tumbling& body, Follower& follower, SurfaceContacts* found) {
  body.step();
  follower.find(body.p, body.origin, body.axis, body.radius, found);
  return expect_same(*found, find_from_scratch(body.p, body.origin, body.axis, body.radius), body);
}

TEST(CylinderSearch, contacts_of_round_bodies_are_followed) {
  Random random(9);
  int touching = 0, followed = 0, modelled = 0;
  const ShapePointer shapes[] = {sphere(), ellipsoid(), closed_ellipsoid(), smooth_pebble(), polar(), disc()};
  for (int n = 0; n < 240; ++n) {
    const Shape& shape = *shapes[n % 6];
    Tumbling body(random, shape, n % 4 == 3 ? -1 : 1);
    Follower follower;
    for (int k = 0; k < 60; ++k) {
      SCOPED_TRACE(shape.name + " " + std::to_string(n) + " step " + std::to_string(k));
      SurfaceContacts found;
      EXPECT_EQ(step_and_compare(body, follower, &found), 0);
      for (int j = 0; j < found.count; ++j) {
        ++touching;
        followed += found.contact[j].iterations > 0;
        modelled += found.contact[j].rung == Rung::local_model;
      }
      if (HasFailure()) return;
    }
  }
  EXPECT_GT(touching, 6000);
  EXPECT_GT(followed, 0.2 * touching);
  EXPECT_GT(modelled, 0.4 * touching);
}

// Tablets, boxes and the like, also flat on the wall and along the axis. Mostly the circle is not looked at
// again.
TEST(CylinderSearch, contacts_of_bodies_with_flats_are_followed) {
  Random random(10);
  int touching = 0, several = 0, merged = 0, steps = 0, kept = 0;
  const ShapePointer shapes[] = {make_shape("tablet", rounded_cylinder(1, 0.4, 0.15)),
                                 make_shape("box", rounded_box(Vec3(1, 0.8, 0.6), 0.1)),
                                 cuboid(),
                                 make_shape("can", cylinder(0.5, 1.2)),
                                 kinked(),
                                 disc()};
  for (int n = 0; n < 480; ++n) {
    const Shape& shape = *shapes[n % 6];
    Tumbling body(random, shape, n % 16 == 15 ? -1 : 1);
    if (n / 6 % 3 > 0)
      body.lean(n % 2 ? Vec3::UnitX() : Vec3::UnitZ(), n / 6 % 3 == 1, random.log_uniform(1e-7, 0.1));
    Follower follower;
    for (int k = 0; k < 60; ++k) {
      SCOPED_TRACE(shape.name + " " + std::to_string(n) + " step " + std::to_string(k));
      SurfaceContacts found;
      merged += step_and_compare(body, follower, &found);
      ++steps;
      touching += found.count > 0;
      several += found.count > 1;
      kept += follower.kept();
      if (HasFailure()) return;
    }
  }
  EXPECT_GT(touching, 0.6 * steps);
  EXPECT_GT(several, 0.02 * steps);
  EXPECT_LT(merged, 0.003 * steps);
  EXPECT_GT(kept, 0.3 * steps);
}

// A prism pressed into a tube hardly wider touches along a dozen edges, all of them followed.
TEST(CylinderSearch, many_contacts_are_followed) {
  Random random(11);
  int most = 0;
  for (int n = 0; n < 12; ++n) {
    const int sides = 6 + n % 7;
    const ShapePointer shape = make_shape("prism", prism(sides, 1, 0.5));
    Particle p;
    p.shape = shape.get();
    const Vec3 axis = Vec3::UnitZ(), origin = random.box(-1, 1);
    const double radius = 1 - random.log_uniform(1e-4, 1e-3);
    Follower follower;
    for (int k = 0; k < 30; ++k) {
      p.x = origin + random.log_uniform(1e-9, 2e-5) * random.direction();
      p.q = (Quat(Eigen::AngleAxisd(random.log_uniform(1e-9, 1e-4), random.direction())) * p.q).normalized();
      SCOPED_TRACE(std::to_string(sides) + " sides, step " + std::to_string(k));
      SurfaceContacts found;
      follower.find(p, origin, axis, radius, &found);
      const SurfaceContacts reference = find_from_scratch(p, origin, axis, radius);
      EXPECT_EQ(found.count, reference.count);
      for (int i = 0; i < std::min(found.count, reference.count); ++i) EXPECT_LT(found.contact[i].gap, 0);
      most = std::max(most, found.count);
    }
  }
  EXPECT_GE(most, 8);
}

// Outside, in closed form: the largest over directions of what the solid's support leaves to the wall.
double gap_outside(const Solid& solid, const Particle& p, double radius, double* angle) {
  const auto gap = [&](double t) {
    const Vec3 d(std::cos(t), std::sin(t), 0);
    return d.dot(p.x + support_of(solid, p, -d)) - radius;
  };
  double best = -HUGE_VAL;
  for (int k = 0; k < kAround; ++k)
    if (const double t = 2 * M_PI * k / kAround; gap(t) > best) best = gap(*angle = t);
  double low = *angle - 2 * M_PI / kAround, high = *angle + 2 * M_PI / kAround;
  while (high - low > 1e-12) {
    const double x = low + 0.382 * (high - low), y = high - 0.382 * (high - low);
    (gap(x) > gap(y) ? high : low) = gap(x) > gap(y) ? y : x;
  }
  return gap(*angle = 0.5 * (low + high));
}

// Corners and tips are supports along many directions: the wall's normal is the one that points at them.
TEST(CylinderSearch, corners_and_tips_outside_touch_where_they_are_nearest) {
  Random random(14);
  const Vec3 half(1, 0.8, 0.6);
  std::vector<Solid> solids(1);
  solids[0].shape = make_shape("box", box(half));
  solids[0].support = [half](const Vec3& d) { return box_support(d, half, 0); };
  for (int k = 0; k < 3; ++k) {
    solids.push_back(cone(random, random.uniform(0.3, 1), random.uniform(0.5, 2)));
    solids.push_back(double_cone(random, 1, 0.5, 0.5));
    solids.push_back(polyhedron(random, 6, 1));
  }
  int touching = 0, apart = 0;
  for (int n = 0; n < 400; ++n) {
    const Solid& solid = solids[n % solids.size()];
    const double size = solid.shape->bounding_radius, radius = size * random.log_uniform(0.3, 30),
                 wanted = size * random.log_uniform(1e-5, 1e-3) * (n % 4 == 0 ? 1 : -1);
    Particle p{solid.shape.get(), 1, Vec3(2 * radius + 3 * size, 0, random.uniform(-5, 5)), random.turn()};
    double angle = 0, gap = gap_outside(solid, p, radius, &angle);
    for (int k = 0; k < 50 && std::abs(gap - wanted) > 1e-8 * size; ++k) {
      p.x += (wanted - gap) * Vec3(std::cos(angle), std::sin(angle), 0);
      gap = gap_outside(solid, p, radius, &angle);
    }
    SCOPED_TRACE(solid.shape->name + " " + std::to_string(n));
    const SurfaceContacts found = find_from_scratch(p, Vec3::Zero(), Vec3::UnitZ(), radius);
    ASSERT_EQ(found.count, gap < 0 ? 1 : 0);
    if (gap < 0) {
      ++touching;
      EXPECT_NEAR(found.contact[0].gap, gap, 1e-10 * size);
    } else {
      ++apart;
    }
  }
  EXPECT_GT(touching, 200);
  EXPECT_GT(apart, 50);
}

// A survey that outlives its contacts does not hide them when the body comes back to where it was.
TEST(CylinderSearch, contacts_in_a_tube_are_met_again_where_they_were_left) {
  Random random(15);
  const ShapePointer shapes[] = {make_shape("tablet", rounded_cylinder(1, 0.4, 0.15)),
                                 make_shape("rounded box", rounded_box(Vec3(1, 0.8, 0.6), 0.1)), cuboid(),
                                 cone(random, 1, 1).shape, polyhedron(random, 6, 1).shape};
  int met = 0;
  for (int n = 0; n < 300; ++n) {
    const Shape& shape = *shapes[n % 5];
    const double size = shape.bounding_radius, radius = size * random.log_uniform(1.1, 8);
    Particle p{&shape, 1, Vec3(radius - 1.1 * size, 0, 0), random.turn()};
    while (find_from_scratch(p, Vec3::Zero(), Vec3::UnitZ(), radius).count == 0) p.x[0] += 0.01 * size;
    Follower follower;
    SurfaceContacts first, away, again;
    follower.find(p, Vec3::Zero(), Vec3::UnitZ(), radius, &first);
    p.x[0] -= 0.3 * size;
    follower.find(p, Vec3::Zero(), Vec3::UnitZ(), radius, &away);
    if (away.count > 0) continue;
    p.x[0] += 0.3 * size;
    follower.find(p, Vec3::Zero(), Vec3::UnitZ(), radius, &again);
    SCOPED_TRACE(shape.name + " " + std::to_string(n));
    EXPECT_EQ(again.count, first.count);
    ++met;
  }
  EXPECT_GT(met, 200);
}

}  // namespace
}  // namespace nurbs::test_cylinder_search

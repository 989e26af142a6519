// Bodies in a tube: contacts are the maxima of the reach that dense sampling finds, and a body that touches
// nothing is told how far it is from the wall.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "contact/cylinder_search.h"
#include "support/bodies.h"
#include "support/flat_bodies.h"
#include "support/random.h"

namespace {

using namespace nurbs;
using namespace nurbs::test;

constexpr int kAround = 2048;  // directions sampled

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
  int touching = 0, apart = 0, measured = 0, several = 0;
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
    SurfaceContacts found;
    find_cylinder_contacts(p, origin, axis, radius, 5, &found);
    if (std::abs(most - radius) < 2 * coarse) continue;
    SCOPED_TRACE(shape.name + " " + std::to_string(n));
    ASSERT_EQ(found.count > 0, most > radius);
    if (found.count == 0) {
      ++apart;
      EXPECT_LE(found.expiry - 5, (1 + 1e-12) * (radius - most));
      const double away = (p.x - origin).cross(axis).norm();
      if (away + size > radius && found.expiry > 5) {  // no news for the bounding sphere
        ++measured;
        EXPECT_GE(found.expiry - 5, 0.45 * (radius - most) - coarse);
      }
      continue;
    }
    ++touching;
    several += found.count > 1;
    double deepest = 0;
    for (int k = 0; k < found.count; ++k) {
      const SurfaceContact& c = found.contact[k];
      deepest = std::max(deepest, -c.gap);
      EXPECT_NEAR(c.normal.dot(axis), 0, 1e-14);
      // A maximum: no direction nearby reaches further.
      for (const double aside : {-1e-4, 1e-4}) {
        const Vec3 d = Eigen::AngleAxisd(aside, axis) * -c.normal;
        EXPECT_LE(-gap_along(p, origin, -d, nullptr).gap, radius - c.gap + 1e-12 * radius);
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
      for (int j = 0; j < found.count; ++j) nearest = std::max(nearest, -d.dot(found.contact[j].normal));
      EXPECT_GE(nearest, std::cos(2 * (near + 1) * 2 * M_PI / kAround)) << angle;
    }
  }
  EXPECT_GE(touching, 60);
  EXPECT_GE(apart, 25);
  EXPECT_GE(measured, 10);
  EXPECT_GE(several, 3);
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
    SurfaceContacts found;
    find_cylinder_contacts(p, origin, axis, radius, 5, &found);
    ASSERT_EQ(found.count, 1);
    EXPECT_NEAR(found.contact[0].gap, radius - reach, 1e-12 * reach);
    const Vec3 aside = axis.unitOrthogonal();
    p.x += 1e-6 * reach * aside;
    find_cylinder_contacts(p, origin, axis, radius, 5, &found);
    ASSERT_EQ(found.count, 1);
    EXPECT_NEAR(found.contact[0].gap, radius - (1 + 1e-6) * reach, 1e-12 * reach);
    EXPECT_NEAR(-found.contact[0].normal.dot(aside), 1, 1e-8);
  }
}

}  // namespace

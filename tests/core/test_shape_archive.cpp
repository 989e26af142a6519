// Shapes as bytes and back: nothing is lost, no bit changes, and damaged bytes are refused.
#include <gtest/gtest.h>

#include <stdexcept>
#include <vector>

#include "body/shape.h"
#include "contact/pair_search.h"
#include "support/bodies.h"
#include "support/flat_bodies.h"

namespace nurbs::test_shape_archive {
namespace {

// Round, dented, with poles, flat faces, rulings, a meridian: every table of a shape is filled in one of
// them.
std::vector<test::ShapePointer> various() {
  std::vector<test::ShapePointer> shapes = test::all_shapes();
  shapes.push_back(make_shape("cylinder", test::cylinder(1, 0.8)));
  return shapes;
}

TEST(ShapeArchive, BytesComeBack) {
  bool flats = false, meridian = false, map = false, ellipsoid = false, rates = false, radii = false;
  for (const auto& shape : various()) {
    const std::string data = pack(*shape);
    const auto copy = unpack(data);
    EXPECT_EQ(pack(*copy), data) << shape->name;
    EXPECT_EQ(copy->name, shape->name);
    EXPECT_EQ(copy->stamp, shape->stamp);
    EXPECT_EQ(copy->mass.inertia, shape->mass.inertia);
    EXPECT_EQ(copy->principal_axes.coeffs(), shape->principal_axes.coeffs());
    EXPECT_EQ(copy->atlas.support, shape->atlas.support);
    EXPECT_EQ(copy->normal_map.radius, shape->normal_map.radius);
    EXPECT_EQ(copy->flats.faces.size(), shape->flats.faces.size());
    EXPECT_EQ(copy->proofs.seen_rate, shape->proofs.seen_rate);
    flats |= !shape->flats.faces.empty();
    meridian |= !shape->meridian.empty();
    map |= shape->normal_map.cells > 0;
    ellipsoid |= shape->ellipsoid.found;
    rates |= !shape->rates.empty();
    radii |= !shape->profile_radii.least.empty();
  }
  EXPECT_TRUE(flats && meridian && map && ellipsoid && rates && radii);
}

TEST(ShapeArchive, ContactsOfACopyAreThoseOfTheShape) {
  for (const auto& shape : various()) {
    const auto copy = unpack(pack(*shape));
    for (const double distance : {0.3, 1.2, 1.7}) {  // deep, touching, apart
      ContactResult results[2];
      int number = 0;
      for (const auto& body : {shape, copy}) {
        Particle a, b;
        a.shape = b.shape = body.get();
        a.scale = b.scale = 1;
        a.x = Vec3::Zero();
        b.x = shape->bounding_radius * distance * Vec3(0.48, 0.6, 0.64);
        a.q = Quat(0.9, 0.1, 0.2, 0.3).normalized();
        b.q = Quat(0.2, 0.7, -0.4, 0.3).normalized();
        ContactSettings settings;
        settings.tolerance = 1e-6;
        settings.reach = 0;
        double memory[kPairMemorySize] = {};
        results[number++] = find_contact(a, b, settings, memory);
      }
      EXPECT_EQ(results[0].status, results[1].status) << shape->name;
      EXPECT_EQ(results[0].gap, results[1].gap) << shape->name;
      EXPECT_EQ(results[0].normal, results[1].normal) << shape->name;
    }
  }
}

TEST(ShapeArchive, InnerMapGoesAlongIfThereIsOne) {
  const auto shape = test::smooth_pebble();
  const InnerMap& map = shape->inner_map();
  const auto copy = unpack(pack(*shape));
  ASSERT_TRUE(copy->lazy_inner_map.made());
  const InnerMap& again = copy->lazy_inner_map.known();
  ASSERT_EQ(map.nodes.size(), again.nodes.size());
  ASSERT_EQ(map.stretches.size(), again.stretches.size());
  for (size_t k = 0; k < map.nodes.size(); ++k) {
    EXPECT_EQ(map.nodes[k].radius, again.nodes[k].radius);
    EXPECT_EQ(map.nodes[k].point, again.nodes[k].point);
  }
  for (size_t k = 0; k < map.stretches.size(); ++k) EXPECT_EQ(map.stretches[k].most, again.stretches[k].most);
  const auto without = make_shape("without", pebble());
  EXPECT_FALSE(unpack(pack(*without))->lazy_inner_map.made());
}

TEST(ShapeArchive, DamagedBytesAreRefused) {
  const std::string data = pack(*test::sphere());
  for (const size_t kept : {size_t{0}, size_t{7}, data.size() / 2, data.size() - 1})
    EXPECT_THROW(unpack(data.substr(0, kept)), std::length_error);
  EXPECT_THROW(unpack(data + "x"), std::length_error);
}

}  // namespace
}  // namespace nurbs::test_shape_archive

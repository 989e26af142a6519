// Kernels on vectors of eight, of four and on single numbers: the vectors' width changes no bit of a result,
// and a single number differs by round-off only.
#include <gtest/gtest.h>

#include <random>

#include "contact/local_model.h"
#include "laws/linear_law.h"
#include "scene/contact_pool.h"

namespace nurbs::test_wide {
namespace {

class Numbers {
 public:
  double operator()(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  Triple<double> vector(double size) {
    return {size * (*this)(-1, 1), size * (*this)(-1, 1), size * (*this)(-1, 1)};
  }
  Triple<double> direction() {
    const Triple<double> v = vector(1);
    return (1.0 / root(dot(v, v))) * v;
  }
  Quat turn() { return Quat((*this)(-1, 1), (*this)(-1, 1), (*this)(-1, 1), (*this)(-1, 1)).normalized(); }

 private:
  std::mt19937_64 engine_{11};
};

// Values made of nothing but Reals, lane by lane.
template <template <class> class Value, class Real>
void put(const Value<double>& from, int lane, Value<Real>* to) {
  const auto* numbers = reinterpret_cast<const double*>(&from);
  auto* wide = reinterpret_cast<Real*>(to);
  for (size_t k = 0; k < sizeof from / sizeof(double); ++k) wide[k][lane] = numbers[k];
}
template <class Value>
double number(const Value& value, size_t k, int lane, int width) {
  return reinterpret_cast<const double*>(&value)[k * width + lane];
}
// Eight lanes, two times four, and eight single ones: the first `count` numbers of each.
template <class One, class Four, class Eight>
void expect_same(const One (&one)[8], const Four (&four)[2], const Eight& eight, size_t count) {
  for (int l = 0; l < 8; ++l)
    for (size_t k = 0; k < count; ++k) {
      const double a = number(eight, k, l, 8), b = number(four[l / 4], k, l % 4, 4),
                   c = number(one[l], k, 0, 1);
      ASSERT_EQ(a, b) << "number " << k;
      ASSERT_NEAR(a, c, 1e-11 * (1 + std::abs(c))) << "number " << k;
    }
}

SupportModel model(Numbers& random, double toward) {
  SupportModel m;
  m.normal = {toward + 0.01 * random(-1, 1), 0.01 * random(-1, 1), 0.01 * random(-1, 1)};
  m.normal = (1.0 / root(dot(m.normal, m.normal))) * m.normal;
  const Triple<double> t = cross(m.normal, random.direction());
  m.tangent = (1.0 / root(dot(t, t))) * t;
  m.arm = {toward * random(0.9, 1.1), random(-0.1, 0.1), random(-0.1, 0.1)};
  m.w0 = random(0.5, 2);
  m.w1 = random(-0.2, 0.2);
  m.w2 = random(0.5, 2);
  m.rate = random(0, 2);
  m.room = 1;
  return m;
}

template <class Real>
struct Pairing {
  SupportModelOf<Real> a{}, b{};
  Turn<Real> turn_a{}, turn_b{};
  Triple<Real> offset{};
  LocalContactOf<Real> evaluate(double free) const {
    return evaluate_local(a, b, turn_a, turn_b, offset, all<Real>(free));
  }
};

TEST(Wide, local_models_are_the_same_side_by_side) {
  Numbers random;
  for (int round = 0; round < 200; ++round) {
    Pairing<Lane8> eight;
    Pairing<Lane4> four[2];
    LocalContact one[8];
    const double free = round % 2;
    for (int l = 0; l < 8; ++l) {
      Pairing<double> p;
      p.a = model(random, 1);
      p.b = model(random, -1);
      p.turn_a = turn(Quat(1, 1e-3 * random(-1, 1), 1e-3 * random(-1, 1), 0).normalized().toRotationMatrix());
      p.turn_b = turn(Quat(1, 1e-3 * random(-1, 1), 0, 1e-3 * random(-1, 1)).normalized().toRotationMatrix());
      p.offset = {random(1.9, 2.1), random(-0.1, 0.1), random(-0.1, 0.1)};
      put<Pairing>(p, l, &eight);
      put<Pairing>(p, l % 4, &four[l / 4]);
      one[l] = p.evaluate(free);
    }
    const LocalContactOf<Lane8> of_eight = eight.evaluate(free);
    const LocalContactOf<Lane4> of_four[2] = {four[0].evaluate(free), four[1].evaluate(free)};
    expect_same(one, of_four, of_eight, 13);  // all but `valid`
    if (HasFatalFailure()) return;
    for (int l = 0; l < 8; ++l) {
      ASSERT_EQ(one[l].valid, of_eight.valid[l] != 0);
      ASSERT_EQ(one[l].valid, of_four[l / 4].valid[l % 4] != 0);
    }
  }
}

template <class Real>
struct Loaded {
  LinearLawOf<Real> law{};
  ContactGeometryOf<Real> g{};
  BodyMotionOf<Real> a{}, b{};
  ContactStateOf<Real> state{};
  ContactWorkOf<Real> work{};
  void advance() { advance_linear<Real, true>(law, g, a, b, 1e-3, &state, &work); }
};

TEST(Wide, the_law_is_the_same_side_by_side) {
  Numbers random;
  for (int round = 0; round < 300; ++round) {
    Loaded<Lane8> eight;
    Loaded<Lane4> four[2];
    ContactStateOf<double> states[8];
    ContactWorkOf<double> works[8];
    for (int l = 0; l < 8; ++l) {
      Loaded<double> p;
      p.law = {1e4, random(0, 1) < 0.2 ? 0.0 : 5e3, random(0, 1) < 0.3 ? 0.0 : 30.0,
               random(0, 1) < 0.3 ? 0.0 : 10.0, random(0, 0.6)};
      const Triple<double> n = random.direction();
      p.g = {random(1e-6, 1e-2), n, random.vector(1), random.vector(1)};
      const auto body = [&] {
        return BodyMotionOf<double>{random.vector(1),  random.vector(3), random.vector(3), random(0.5, 1),
                                    random(1, 2),      random(1, 2),     random(1, 2),     random(-0.2, 0.2),
                                    random(-0.2, 0.2), random(-0.2, 0.2)};
      };
      p.a = body();
      p.b = body();
      if (random(0, 1) < 0.8) {
        auto* numbers = reinterpret_cast<double*>(&p.state);
        for (int k = 0; k < kContactStateSize; ++k) numbers[k] = 1e-2 * random(-1, 1);
        const Triple<double> near = n + random.vector(0.01);
        p.state.normal = (1.0 / root(dot(near, near))) * near;
        p.state.active = 1;
        p.state.dt = random(0, 1) < 0.2 ? 0.0 : 1e-3;
        p.state.sliding = random(0, 1) < 0.5;
      }
      put<Loaded>(p, l, &eight);
      put<Loaded>(p, l % 4, &four[l / 4]);
      p.advance();
      states[l] = p.state;
      works[l] = p.work;
    }
    eight.advance();
    for (Loaded<Lane4>& f : four) f.advance();
    const ContactStateOf<Lane4> four_states[2] = {four[0].state, four[1].state};
    const ContactWorkOf<Lane4> four_works[2] = {four[0].work, four[1].work};
    expect_same(states, four_states, eight.state, kContactStateSize);
    expect_same(works, four_works, eight.work, 2);
    if (HasFatalFailure()) return;
  }
}

TEST(Wide, records_are_gathered_and_scattered) {
  double records[kWidth][16], back[kWidth][8];
  const double* of[kWidth];
  for (int l = 0; l < kWidth; ++l) {
    of[l] = records[l];
    for (int k = 0; k < 16; ++k) records[l][k] = 100 * l + k;
  }
  Wide fields[16];
  gather(of, fields);
  for (int l = 0; l < kWidth; ++l)
    for (int k = 0; k < 16; ++k) ASSERT_EQ(fields[k][l], 100 * l + k);
  scatter({fields[0], fields[1], fields[2], fields[3], fields[4], fields[5], fields[6], fields[7]}, back);
  for (int l = 0; l < kWidth; ++l)
    for (int k = 0; k < 8; ++k) ASSERT_EQ(back[l][k], 100 * l + k);
}

TEST(Memory, is_what_is_promised) {
  EXPECT_LE(sizeof(PairProof), 128u);
  EXPECT_LE(sizeof(ContactBlock), 640u * kBlock);
  ContactPool pool;
  std::vector<std::int32_t> numbers;
  for (int k = 0; k < 1000; ++k) numbers.push_back(pool.add(ContactRecord{}));
  EXPECT_LE(pool.blocks().size() * sizeof(ContactBlock), 640u * 1000 + sizeof(ContactBlock));
  for (const std::int32_t n : numbers) pool.remove(n);
  for (int k = 0; k < 1000; ++k) pool.add(ContactRecord{});  // what was freed is taken again
  EXPECT_EQ(pool.blocks().size(), 125u);
}

// What restarts held before contacts had shifts is read as it was: a record without its last double, and a
// polygon without its own.
TEST(Memory, records_without_shifts_are_read) {
  ContactPool pool;
  pool.set_memory_size(2);
  const std::int32_t number = pool.add(ContactRecord{});
  ContactBlock& block = pool.block(number);
  const int lane = ContactPool::lane(number);
  for (int k = 0; k < kContactSize; ++k)
    if (k != kFlat) block.field[k][lane] = k + 1;
  block.field[kShift][lane] = 0.25;
  pool.memory(block, lane)[1] = 7;
  FlatContact& flat = pool.add_flat(number);
  flat.polygon.count = 3;
  flat.polygon.factor = 2;
  flat.polygon.weight[1] = 0.5;
  flat.polygon.shift = 0.125;
  for (int k = 0; k < kBlock; ++k) flat.points.field[kStateField][k] = 10 + k;
  pool.memory(flat.points, 3)[0] = 9;
  double packed[kMostContactSize];
  const int size = pool.pack(number, packed);
  ASSERT_EQ(size, pool.packed_size(number));

  const auto expect = [&](const std::int32_t n, double shift, double of_polygon) {
    const ContactBlock& to = pool.block(n);
    const int l = ContactPool::lane(n);
    for (int k = 0; k < kContactSize; ++k)
      if (k != kFlat && k != kShift) {
        ASSERT_EQ(to.field[k][l], k + 1) << k;
      }
    EXPECT_EQ(to.field[kShift][l], shift);
    EXPECT_EQ(pool.memory(to, l)[1], 7);
    const FlatContact* polygon = pool.flat(n);
    ASSERT_NE(polygon, nullptr);
    EXPECT_EQ(polygon->polygon.count, 3);
    EXPECT_EQ(polygon->polygon.shift, of_polygon);
    EXPECT_EQ(polygon->points.field[kWeight][1], 1);
    for (int k = 0; k < kBlock; ++k) EXPECT_EQ(polygon->points.field[kStateField][k], 10 + k);
    EXPECT_EQ(pool.memory(polygon->points, 3)[0], 9);
  };
  int read = 0;
  expect(pool.unpack(packed, &read), 0.25, 0.125);
  EXPECT_EQ(read, size);

  std::vector<double> old(packed, packed + size);
  old[kFlat] -= kWithShifts;
  const int polygon = kContactSize + 2 + static_cast<int>(sizeof(ContactPolygon) / sizeof(double)) - 1;
  old.erase(old.begin() + polygon);
  old.erase(old.begin() + kShift);
  expect(pool.unpack(old.data(), &read), 0, 0);
  EXPECT_EQ(read, size - 2);
}

}  // namespace
}  // namespace nurbs::test_wide

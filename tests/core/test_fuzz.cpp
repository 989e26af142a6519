// What nobody would hand over on purpose, under sanitizers too (make sanitized-tests FUZZ=1): every family of
// pairs cold, warm and with memory that belongs to something else or is damaged; planes, meshes, edges,
// vertices and cylinders; and shape files that are cut, spoilt or hostile. Answers must be numbers, and right
// where the truth is known; files must be refused in one line or give a body that can be asked. NURBS_FUZZ=5
// in the environment does ten times as much, NURBS_FUZZ_SEED=n something else.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "body/support.h"
#include "contact/pair_memory.h"
#include "contact/pair_search.h"
#include "contact/walls/cylinder_search.h"
#include "contact/walls/feature_search.h"
#include "contact/walls/surface_search.h"
#include "io/shape_file.h"
#include "shapes/primitives.h"
#include "support/bodies.h"
#include "support/solid_families.h"

namespace nurbs::test_fuzz {
namespace {

using families::Failure;
using families::Family;
using families::Kind;
using test::Random;
using Memory = std::array<double, kPairMemorySize>;

// Making bodies is dear under sanitizers: one family in six, which ones the seed says, and fewer solids.
#ifdef __SANITIZE_ADDRESS__
constexpr int kFamilyStride = 6;
constexpr Kind kSomeKinds[] = {Kind::cone, Kind::lens};
#else
constexpr int kFamilyStride = 1;
constexpr Kind kSomeKinds[] = {Kind::cone, Kind::lens, Kind::polyhedron};
#endif

double setting(const char* name, double otherwise) {
  const char* text = std::getenv(name);
  return text ? std::atof(text) : otherwise;
}
int rounds(double usual) {
  return std::max(1, static_cast<int>(usual * setting("NURBS_FUZZ", 0.5)));
}
std::uint64_t seed(std::uint64_t test) {
  return 1000 * static_cast<std::uint64_t>(setting("NURBS_FUZZ_SEED", 0)) + test;
}

void expect_numbers(const ContactResult& r, const std::string& what) {
  ASSERT_TRUE(std::isfinite(r.gap) && r.normal.allFinite() && r.point_a.allFinite() && r.point_b.allFinite())
      << what;
  ASSERT_LE(r.lower, r.upper) << what;
  if (r.status == Status::converged) {
    ASSERT_NEAR(r.normal.norm(), 1, 1e-9) << what;
  }
}

// --- pairs
// ----------------------------------------------------------------------------------------------------

// The next pose of a body: a hair or half a turn away.
void disturb(Random& random, double size, Particle* p) {
  switch (random.below(4)) {
    case 0:
      p->q = random.turn();
      break;
    case 1:
      p->x += size * random.uniform(-1, 1) * random.direction();
      break;
    default:
      p->q = (random.turn_by(random.log_uniform(1e-12, 1)) * p->q).normalized();
      p->x += size * random.log_uniform(1e-12, 0.1) * random.direction();
  }
}

// A bit turned, a number exchanged, or the whole replaced by that of another pair.
void spoil(Random& random, const Memory& other, Memory* memory) {
  const double strange[] = {std::nan(""), 1 / 0.0, -1 / 0.0, 1e300, -1e300, 1e10, -1, 0, 65535, 5e-324, 2e9};
  const int where = random.below(kPairMemorySize);
  switch (random.below(4)) {
    case 0: {
      std::uint64_t bits;
      std::memcpy(&bits, &(*memory)[where], sizeof bits);
      bits ^= std::uint64_t(1) << random.below(64);
      std::memcpy(&(*memory)[where], &bits, sizeof bits);
      break;
    }
    case 1:
      (*memory)[where] = strange[random.below(11)];
      break;
    case 2: {  // all but the stamp
      const double stamp = (*memory)[0];
      *memory = other;
      std::memcpy(&(*memory)[0], &stamp, sizeof stamp);
      break;
    }
    default:
      *memory = other;
  }
}

TEST(Fuzz, pairs_of_every_family_cold_and_warm) {
  Random random(seed(1));
  Memory other{};
  int number_of_family = static_cast<int>(setting("NURBS_FUZZ_SEED", 0));
  for (const Family& family : families::all_families()) {
    if (++number_of_family % kFamilyStride != 0) continue;
    const int pairs = rounds(family.pairs > 20000 ? 6 : family.pairs > 5000 ? 3 : 1);
    for (int k = 0; k < pairs; ++k) {
      const long number = random.whole(0, 1 << 30);
      const families::PairCase c = families::pair_of(family, number);
      const std::string what = std::string(family.name) + ", pair " + std::to_string(number);
      const families::Verdict verdict = families::judge(c, families::solve(c, Solver::ladder));
      if (!c.overlap || verdict.failure != Failure::unresolved) {  // tips: test_failure_families counts them
        EXPECT_EQ(verdict.failure, Failure::none)
            << what << ": " << families::kFailureNames[static_cast<int>(verdict.failure)] << ", error "
            << verdict.error;
      }
      Particle a = c.a, b = c.b;
      const double size = std::min(a.scale * a.shape->bounding_radius, b.scale * b.shape->bounding_radius);
      ContactSettings settings;
      Memory memory{};
      for (int step = 0; step < 8; ++step) {
        settings.reach = random.below(3) ? 0 : 0.1 * size;
        settings.solver = random.below(16) ? Solver::ladder : Solver::cso;
        ContactResult r = find_contact(a, b, settings, memory.data());
        expect_numbers(r, what);
        settings.solver = Solver::ladder;
        Memory damaged = memory;
        spoil(random, other, &damaged);
        find_contact(a, b, settings, damaged.data());
        find_contact(b, a, settings, damaged.data());  // memory of the pair the other way round
        if (random.below(6) == 0) other = memory;
        disturb(random, size, random.below(2) ? &a : &b);
      }
      if (HasFatalFailure()) return;
    }
  }
}

std::vector<const Shape*> some_bodies() {
  static const std::vector<test::ShapePointer> kept = [] {
    std::vector<test::ShapePointer> bodies = test::all_shapes();
    for (const Kind kind : kSomeKinds) bodies.push_back(families::solids_of(kind)[0].shape);
    return bodies;
  }();
  std::vector<const Shape*> bodies;
  for (const auto& s : kept) bodies.push_back(s.get());
  return bodies;
}

TEST(Fuzz, planes_with_any_memory) {
  Random random(seed(2));
  Memory other{};
  for (const Shape* shape : some_bodies())
    for (int k = rounds(6); k > 0; --k) {
      Particle p{shape, random.log_uniform(1e-3, 1e3), Vec3::Zero(), random.turn()};
      const double size = p.scale * shape->bounding_radius;
      const Vec3 n = random.direction();
      Memory memory{};
      ContactSettings settings;
      for (int step = 0; step < 10; ++step) {
        const double h = p.scale * find_hull_support(*shape, p.q.conjugate() * -n).h;
        const double truth = size * random.sign() * random.log_uniform(1e-9, 1);
        const Vec3 origin = p.x - (h + truth) * n + size * n.cross(random.direction());
        settings.reach = random.below(2) ? 0 : size;
        const ContactResult r = find_plane_contact(p, origin, n, settings, memory.data());
        expect_numbers(r, shape->name);
        if (r.status == Status::converged) {
          ASSERT_NEAR(r.gap, truth, 3e-9 * size) << shape->name;
        } else {
          ASSERT_EQ(r.status, Status::separated) << shape->name;
          ASSERT_GT(truth, -1e-14 * size) << shape->name;
        }
        Memory damaged = memory;
        spoil(random, other, &damaged);
        find_plane_contact(p, origin, n, settings, damaged.data());
        if (random.below(5) == 0) other = memory;
        disturb(random, size, &p);
      }
    }
}

// --- walls
// ----------------------------------------------------------------------------------------------------

// Triangles about a body: a bumpy sheet, a fan about a vertex, needles, copies and points.
std::vector<Triangle> some_mesh(Random& random, double size) {
  std::vector<Triangle> mesh;
  const Vec3 apex = size * random.uniform(0, 1) * random.direction();
  const auto rim = [&](double angle) -> Vec3 {
    return size * Vec3(3 * std::cos(angle), 3 * std::sin(angle), random.uniform(-0.5, 0.5));
  };
  const int count = random.whole(1, 8);
  std::vector<Vec3> ring;
  for (int k = 0; k < count; ++k) ring.push_back(rim(2 * M_PI * k / count));
  for (int k = 0; k < count; ++k) mesh.push_back({apex, ring[k], ring[(k + 1) % count]});
  for (int k = random.below(4); k > 0; --k) {
    const Vec3 a = size * random.box(-1, 1), b = a + size * random.log_uniform(1e-12, 3) * random.direction(),
               c = random.below(3) ? Vec3(b + size * random.log_uniform(1e-15, 3) * random.direction()) : b;
    mesh.push_back({a, b, c});
  }
  if (random.below(4) == 0) mesh.push_back(mesh[random.below(static_cast<int>(mesh.size()))]);
  if (random.below(4) == 0) mesh.push_back({apex, apex, apex});
  std::shuffle(mesh.begin(), mesh.end(), random.engine());
  return mesh;
}

void expect_sane(const SurfaceContacts& contacts, double size, const std::string& what) {
  ASSERT_LE(contacts.count, kSurfaceContacts) << what;
  for (int k = 0; k < contacts.count; ++k) {
    const SurfaceContact& c = contacts.contact[k];
    ASSERT_TRUE(std::isfinite(c.weight)) << what;
    ASSERT_LE(c.gap, 0) << what;
    ASSERT_GE(c.gap, -10 * size) << what;
    ASSERT_NEAR(c.normal.norm(), 1, 1e-9) << what;
    ASSERT_LE(c.on_body.norm(), 1.001 * size) << what;
  }
}

TEST(Fuzz, meshes) {
  Random random(seed(3));
  for (const Shape* shape : some_bodies())
    for (int k = rounds(5); k > 0; --k) {
      Particle p{shape, random.log_uniform(1e-3, 1e3), Vec3::Zero(), random.turn()};
      const double size = p.scale * shape->bounding_radius;
      const std::vector<Triangle> mesh = some_mesh(random, size);
      MeshPatch patch;
      patch.build(mesh.data(), static_cast<int>(mesh.size()), random.below(2) ? 1e-7 * size : 0);
      ContactSettings settings;
      settings.reach = 0;
      SurfaceContacts before, now;
      double path = 0;
      for (int step = 0; step < 6; ++step) {
        std::vector<FormerContact> former;
        for (int i = 0; i < before.count; ++i) former.push_back(former_contact(before.contact[i]));
        now = SurfaceContacts();
        find_surface_contacts(p, patch, settings, path, former.data(), static_cast<int>(former.size()), &now);
        expect_sane(now, size, shape->name);
        if (HasFatalFailure()) return;
        before = now;
        disturb(random, size, &p);
        path += 4 * size;
      }
    }
}

TEST(Fuzz, edges_vertices_and_cylinders) {
  Random random(seed(4));
  for (const Shape* shape : some_bodies())
    for (int k = rounds(10); k > 0; --k) {
      Particle p{shape, random.log_uniform(1e-3, 1e3), Vec3::Zero(), random.turn()};
      const double size = p.scale * shape->bounding_radius;
      p.x = size * random.log_uniform(1e-6, 1e6) * random.direction();
      const Vec3 a = p.x + size * random.uniform(0, 1.2) * random.direction(), along = random.direction(),
                 low = along.unitOrthogonal();
      const Vec3 high = Eigen::AngleAxisd(random.log_uniform(1e-9, 3), along) * low;
      const SurfacePoint start{random.whole(-1, static_cast<int>(shape->patches.size())),
                               random.uniform(0, 1), random.uniform(0, 1)};
      const double radius = random.below(2) ? 0 : size * random.log_uniform(1e-3, 10);
      const FeatureContact line =
          find_line_contact(p, a, along, low, random.below(4) ? high : low, radius, &start);
      const FeatureContact point = find_point_contact(p, a, random.direction(), {}, &start);
      for (const FeatureContact& c : {line, point}) {
        if (!c.touching) continue;
        ASSERT_TRUE(std::isfinite(c.gap) && std::isfinite(c.along)) << shape->name;
        ASSERT_NEAR(c.normal.norm(), 1, 1e-9) << shape->name;
        ASSERT_LE(c.on_body.norm(), 1.001 * size) << shape->name;
      }
      SurfaceContacts contacts;
      find_cylinder_contacts(p, a, along, size * random.log_uniform(1e-3, 1e3), {}, 0, nullptr, 0, nullptr,
                             &contacts);
      for (int i = 0; i < contacts.count; ++i) {
        ASSERT_TRUE(std::isfinite(contacts.contact[i].gap)) << shape->name;
        ASSERT_NEAR(contacts.contact[i].normal.norm(), 1, 1e-9) << shape->name;
      }
    }
}

// --- shape files
// ----------------------------------------------------------------------------------------------

using Json = nlohmann::json;
using Surfaces = std::vector<NurbsSurface>;

#ifdef __SANITIZE_ADDRESS__
constexpr double kLongestLoad = 30;  // s
#else
constexpr double kLongestLoad = 3;
#endif
double processor_seconds() {
  return static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
}

// What became of a text: refused in one line, or a body that answers. Soon, whatever it holds.
enum class Fate { refused, accepted };
Fate load_shape(Random& random, const std::string& text) {
  std::shared_ptr<const Shape> shape;
  try {
    ShapeFileContent content = parse_shape(text, "stone.json");
    std::vector<std::string> warnings;
    shape = make_shape("stone", std::move(content.surfaces), content.gyration, &warnings);
  } catch (const ShapeError& error) {
    const std::string message = error.what();
    EXPECT_EQ(message.find("stone"), 0u) << message;
    EXPECT_EQ(message.find('\n'), std::string::npos) << message;
    EXPECT_LT(message.size(), 400u) << message;
    return Fate::refused;
  }
  const double size = shape->bounding_radius;
  EXPECT_TRUE(std::isfinite(size) && size > 0 && std::isfinite(shape->mass.volume));
  EXPECT_GE(size, shape->inner_radius);
  for (int k = 0; k < 8; ++k) {
    const Vec3 d = random.direction();
    const Support s = find_hull_support(*shape, d);
    EXPECT_TRUE(std::isfinite(s.h) && s.point.allFinite());
    EXPECT_LE(s.h, size * (1 + 1e-9));
    EXPECT_GE(s.upper, s.h);
    Particle a{shape.get(), 1, Vec3::Zero(), random.turn()}, b{shape.get(), 1, 1.5 * size * d, random.turn()};
    Memory memory{};
    const ContactResult pair = find_contact(a, b, ContactSettings(), memory.data());
    EXPECT_TRUE(std::isfinite(pair.gap));
    memory = {};
    const ContactResult plane = find_plane_contact(a, -0.9 * size * d, d, ContactSettings(), memory.data());
    EXPECT_TRUE(std::isfinite(plane.gap));
  }
  return Fate::accepted;
}

Fate load(Random& random, const std::string& text) {
  const double began = processor_seconds();
  const Fate fate = load_shape(random, text);
  EXPECT_LT(processor_seconds() - began, kLongestLoad) << text.substr(0, 20000);
  return fate;
}

std::string text_of(const Surfaces& surfaces) {
  return write_shape({surfaces, std::nullopt});
}

std::vector<Surfaces> originals() {
  std::vector<Surfaces> bodies = {exact_ellipsoid({1, 0.8, 0.6}), pebble(), box({1, 0.8, 0.6}),
                                  revolved_ellipsoid(1, 0.5)};
  for (const Kind kind : kSomeKinds) bodies.push_back(families::solids_of(kind)[0].shape->surfaces);
  return bodies;
}

TEST(FuzzFiles, cut_or_with_bytes_changed) {
  Random random(seed(5));
  int refused = 0;
  for (const Surfaces& body : originals()) {
    const std::string whole = text_of(body);
    for (int k = rounds(12); k > 0; --k) {
      std::string text = whole;
      if (k % 2)
        text.resize(random.below(static_cast<int>(whole.size())));
      else
        for (int n = random.whole(1, 4); n > 0; --n)
          text[random.below(static_cast<int>(text.size()))] =
              "0123456789-+.eE,[]{}\":\0\xff\n"[random.below(25)];
      refused += load(random, text) == Fate::refused;
    }
  }
  EXPECT_GT(refused, rounds(40));
}

// A value where a file has a number.
Json strange_number(Random& random) {
  switch (random.below(14)) {
    case 0:
      return 1e308;
    case 1:
      return -1e308;
    case 2:
      return nullptr;  // NaN, as JSON writes it
    case 3:
      return 5e-324;
    case 4:
      return 1e200;
    case 5:
      return 0;
    case 6:
      return -1;
    case 7:
      return 9;
    case 8:
      return 100000;
    case 9:
      return 2147483647;
    case 10:
      return 1e18;
    case 11:
      return random.sign() * random.log_uniform(1e-300, 1e300);
    case 12:
      return random.sign() * random.log_uniform(1e-20, 1e20);
    default:
      return random.uniform(-2, 2);
  }
}

// One of the numbers below a node, at random.
Json* some_number(Random& random, Json* node) {
  while (node->is_structured() && !node->empty())
    node = &*std::next(node->begin(), random.below(static_cast<int>(node->size())));
  return node;
}

TEST(FuzzFiles, hostile_numbers) {
  Random random(seed(6));
  const std::vector<Surfaces> bodies = originals();
  for (const Surfaces& body : bodies)
    for (int k = rounds(12); k > 0; --k) {
      Json root = Json::parse(text_of(body));
      for (int n = random.whole(1, 3); n > 0; --n)
        *some_number(random, &root["shape"]["data"]) = strange_number(random);
      load(random, root.dump());
    }
}

// Degenerate but well-formed: what a modeller might do.
void deform(Random& random, Surfaces* body) {
  NurbsSurface& s = (*body)[random.below(static_cast<int>(body->size()))];
  const int i = random.below(s.size_u), j = random.below(s.size_v);
  const Vec4 p = s.point(i, j);
  const auto set = [](Vec4* to, const Vec4& from) { *to = from * ((*to)[3] / from[3]); };
  switch (random.below(13)) {
    case 0:  // an edge to a point
      for (int k = 0; k < s.size_u; ++k) set(&s.point(k, random.below(2) ? 0 : s.size_v - 1), p);
      break;
    case 1:  // a patch to a point
      for (Vec4& x : s.points) set(&x, p);
      break;
    case 2:  // to a line
      for (int a = 0; a < s.size_u; ++a)
        for (int b = 0; b < s.size_v; ++b) set(&s.point(a, b), Vec4(s.point(0, b)));
      break;
    case 3:  // a control point on its neighbour, all of a row, or the second row on the edge: no tangent
      for (int b = 0; b < s.size_v; ++b) set(&s.point(1, b), Vec4(s.point(0, b)));
      break;
    case 4:
      s.point(i, j) *= random.log_uniform(1e-12, 1e12);  // weight
      break;
    case 5:  // a spike
      s.point(i, j).head<3>() *= 1 + random.sign() * random.log_uniform(1e-9, 10);
      break;
    case 6:
      body->push_back(Surfaces::value_type(s));
      break;
    case 7:
      if (body->size() > 1) body->erase(body->begin() + random.below(static_cast<int>(body->size())));
      break;
    case 8:
      s = swap_uv(s);
      break;
    case 9: {  // all bodies tiny, huge, flat or far away
      const double factor = random.log_uniform(1e-160, 1e160);
      const int axes = random.whole(1, 7);
      const Vec3 shift = random.below(3) ? Vec3::Zero() : Vec3(1e8 * random.direction());
      for (NurbsSurface& t : *body)
        for (Vec4& x : t.points) {
          for (int c = 0; c < 3; ++c)
            if (axes >> c & 1) x[c] *= factor;
          x.head<3>() += x[3] * shift;
        }
      break;
    }
    case 10: {  // a knot moved
      std::vector<double>& knots = random.below(2) ? s.knots_u : s.knots_v;
      knots[random.below(static_cast<int>(knots.size()))] = random.uniform(0, 1);
      std::sort(knots.begin(), knots.end());
      break;
    }
    case 11: {  // a knot repeated
      std::vector<double>& knots = random.below(2) ? s.knots_u : s.knots_v;
      const int at = random.below(static_cast<int>(knots.size()));
      for (int k = at; k < std::min<int>(at + random.whole(1, 4), static_cast<int>(knots.size())); ++k)
        knots[k] = knots[at];
      break;
    }
    default:  // rows of noise
      for (Vec4& x : s.points) x.head<3>() += x[3] * random.log_uniform(1e-9, 1e-1) * random.direction();
  }
}

TEST(FuzzFiles, degenerate_bodies) {
  Random random(seed(7));
  int accepted = 0;
  for (const Surfaces& body : originals())
    for (int k = rounds(10); k > 0; --k) {
      Surfaces spoilt = body;
      for (int n = random.whole(1, 2); n > 0; --n) deform(random, &spoilt);
      accepted += load(random, text_of(spoilt)) == Fate::accepted;
    }
  EXPECT_GT(accepted, 0);
}

// Degree 9 everywhere: elevated, which changes nothing, and by itself.
TEST(FuzzFiles, highest_degrees) {
  Random random(seed(8));
  Surfaces body = box({1, 0.8, 0.6});
  for (NurbsSurface& s : body) {
    const NurbsSurface flat = s;
    s.degree_u = s.degree_v = 9;
    s.size_u = s.size_v = 10;
    s.knots_u.assign(10, 0);
    s.knots_u.resize(20, 1);
    s.knots_v = s.knots_u;
    s.points.clear();
    for (int i = 0; i < 10; ++i)
      for (int j = 0; j < 10; ++j) {
        const double u = i / 9.0, v = j / 9.0;
        s.points.push_back((1 - u) * ((1 - v) * flat.point(0, 0) + v * flat.point(0, 1)) +
                           u * ((1 - v) * flat.point(1, 0) + v * flat.point(1, 1)));
      }
  }
  EXPECT_EQ(load(random, text_of(body)), Fate::accepted);
  for (int k = rounds(10); k > 0; --k) {
    Surfaces spoilt = body;
    deform(random, &spoilt);
    load(random, text_of(spoilt));
  }
}

// Counts that promise more than there is, and nesting without end.
TEST(FuzzFiles, huge_counts_and_deep_nesting) {
  Random random(seed(9));
  for (const char* key : {"size_u", "size_v", "degree_u", "degree_v"})
    for (const Json& count : {Json(100000), Json(99999), Json(2147483647), Json(1e18), Json(-1), Json(0)}) {
      Json root = Json::parse(text_of(box({1, 1, 1})));
      root["shape"]["data"][0][key] = count;
      EXPECT_EQ(load(random, root.dump()), Fate::refused);
      root["shape"]["data"][0]["size_u"] = root["shape"]["data"][0]["size_v"] = 100000;
      EXPECT_EQ(load(random, root.dump()), Fate::refused);
    }
  for (const char* open : {"[", "{\"shape\":"}) {
    std::string text;
    for (int k = 0; k < 100000; ++k) text += open;
    EXPECT_EQ(load(random, text), Fate::refused);
  }
}

}  // namespace
}  // namespace nurbs::test_fuzz

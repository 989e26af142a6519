// See sequences.h.
#include "support/sequences.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "contact/pair_search.h"
#include "nurbs/tolerances.h"
#include "shapes/primitives.h"
#include "shapes/random_pebble.h"
#include "shapes/revolved.h"
#include "shapes/rounded_polyhedron.h"
#include "support/as_surface.h"
#include "support/solid_families.h"

namespace nurbs::sequences {

using families::Kind;
using families::kKinds;
using test::Random;
using test::Solid;

namespace {

using Support = std::function<Vec3(const Vec3&)>;

// --- actors
// ----------------------------------------------------------------------------------------------------

// `support` about the origin of the surfaces' frame.
Actor closed_form(const std::string& name, std::vector<NurbsSurface> surfaces, Support support,
                  std::vector<Vec3> normals = {}) {
  Actor actor;
  actor.name = name;
  actor.solid.shape = make_shape(name, std::move(surfaces));
  const Vec3 center = actor.solid.shape->mass.center;
  actor.solid.support = [=](const Vec3& d) -> Vec3 { return support(d) - center; };
  actor.solid.normals = std::move(normals);
  return actor;
}

// The highest of a grid on every patch, the best few patches then sampled closer and closer about theirs.
class SampledSupport {
 public:
  explicit SampledSupport(std::shared_ptr<const Shape> shape) : shape_(std::move(shape)) {
    for (const BezierPatch& patch : shape_->patches)
      for (int i = 0; i <= kGrid; ++i)
        for (int j = 0; j <= kGrid; ++j)
          cloud_.push_back(evaluate0(patch, i / double(kGrid), j / double(kGrid)));
  }

  Vec3 operator()(const Vec3& d) const {
    const int each = (kGrid + 1) * (kGrid + 1), patches = static_cast<int>(shape_->patches.size());
    struct Top {
      double h;
      int at;
    };
    std::vector<Top> tops;
    double highest = -1e300;
    for (int p = 0; p < patches; ++p) {
      Top top{-1e300, 0};
      for (int k = p * each; k < (p + 1) * each; ++k) {
        const double h = cloud_[k].dot(d);
        if (h > top.h) top = {h, k};
      }
      tops.push_back(top);
      highest = std::max(highest, top.h);
    }
    Vec3 best = Vec3::Zero();
    double most = -1e300;
    for (const Top& top : tops) {
      if (top.h < highest - 2e-3 * shape_->bounding_radius) continue;
      const Vec3 x = closer(top.at / each, top.at % each, d);
      if (x.dot(d) > most) most = x.dot(d), best = x;
    }
    return best;
  }

 private:
  static constexpr int kGrid = 40;

  Vec3 closer(int p, int k, const Vec3& d) const {
    constexpr int n = 6;
    const BezierPatch& patch = shape_->patches[p];
    Vec2 middle = Vec2(k / (kGrid + 1), k % (kGrid + 1)) / kGrid;
    double half = 1.0 / kGrid, most = -1e300;
    Vec3 best = Vec3::Zero();
    for (int zoom = 0; zoom < 14; ++zoom, half *= 0.4) {
      const Vec2 about = middle;
      for (int i = -n; i <= n; i += 2)
        for (int j = -n; j <= n; j += 2) {
          const Vec2 at = (about + half / n * Vec2(i, j)).cwiseMax(0).cwiseMin(1);
          const Vec3 x = evaluate0(patch, at[0], at[1]);
          if (x.dot(d) > most) most = x.dot(d), best = x, middle = at;
        }
    }
    return best;
  }

  std::shared_ptr<const Shape> shape_;
  std::vector<Vec3> cloud_;
};

Actor sampled(const std::string& name, std::vector<NurbsSurface> surfaces, int every) {
  Actor actor;
  actor.name = name;
  actor.solid.shape = make_shape(name, std::move(surfaces));
  actor.solid.support = SampledSupport(actor.solid.shape);
  actor.accuracy = 1e-10;
  actor.every = every;
  return actor;
}

std::vector<Actor> make_actors() {
  std::vector<Actor> actors;
  const char* const kinds[] = {"cone", "cylinder", "capsule", "lens", "polyhedron"};
  for (int kind = 0; kind < kKinds; ++kind)
    for (size_t k = 0; k < 4; ++k) {
      Actor actor;
      actor.name = kinds[kind] + std::string(" ") + std::to_string(k);
      actor.solid = families::solids_of(static_cast<Kind>(kind))[k];
      actors.push_back(actor);
    }
  const std::vector<Vec3> ends = test::poles(), faces = test::axes_normals();
  actors.push_back(closed_form(
      "tablet", tablet(1, 0.6, 0.1), [](const Vec3& d) { return test::disc_support(d, 0.9, 0.2, 0.1); },
      ends));
  actors.push_back(closed_form(
      "coin", tablet(1, 0.1, 0.02), [](const Vec3& d) { return test::disc_support(d, 0.98, 0.03, 0.02); },
      ends));
  actors.push_back(closed_form(
      "rounded box", rounded_box({1, 0.7, 0.5}, 0.1),
      [](const Vec3& d) {
        return test::box_support(d, {0.9, 0.6, 0.4}, 0.1);
      },
      faces));
  actors.push_back(closed_form(
      "box", box({1, 0.8, 0.6}),
      [](const Vec3& d) {
        return test::box_support(d, {1, 0.8, 0.6}, 0);
      },
      faces));
  actors.push_back(closed_form("disc", exact_ellipsoid({1, 1, 0.05}), [](const Vec3& d) {
    return test::ellipsoid_support(d, {1, 1, 0.05});
  }));
  actors.push_back(
      closed_form("ball", exact_ellipsoid({1, 1, 1}), [](const Vec3& d) { return d.normalized(); }));
  Actor surface = actors[actors.size() - 2];
  surface.name = "disc, as a surface";
  surface.solid.shape = test::as_surface(*surface.solid.shape);
  actors.push_back(surface);
  const double rounding = 0.15;
  std::vector<Vec3> octahedron;
  for (const HalfSpace& face : platonic_solid("octahedron", 1)) octahedron.push_back(face.normal);
  actors.push_back(closed_form(
      "rounded octahedron", rounded_polyhedron(platonic_solid("octahedron", 1), Vec3::Zero(), rounding),
      [rounding](const Vec3& d) -> Vec3 {
        int k = 0;
        d.cwiseAbs().maxCoeff(&k);
        return (1 - std::sqrt(3.0) * rounding) * (d[k] < 0 ? -1 : 1) * Vec3::Unit(k) +
               rounding * d.normalized();
      },
      octahedron));
  actors.push_back(closed_form(
      "egg", egg(0.7, 0.5, 1.2),
      [](const Vec3& d) {
        return test::ellipsoid_support(d, {0.7, 0.7, d[2] > 0 ? 1.2 : 0.5});
      },
      ends));
  for (const double polar : {0.2, 3.0})  // one patch
    actors.push_back(closed_form(
        "polar " + std::to_string(polar).substr(0, 3), revolved_ellipsoid(1, polar),
        [polar](const Vec3& d) {
          return test::ellipsoid_support(d, {1, 1, polar});
        },
        ends));
  actors.push_back(sampled("pebble", pebble(), 20));
  actors.push_back(sampled("grain", random_pebble(5, PebbleForm()), 20));
  actors.push_back(sampled("blocky 4", fitted_superellipsoid({1, 0.9, 0.8}, 4, 3), 50));
  actors.push_back(sampled("blocky 8", fitted_superellipsoid({1, 0.9, 0.8}, 8, 5), 100));
  return actors;
}

// --- motion
// ----------------------------------------------------------------------------------------------------

// A direction and a gap that wander, and turns; spells of some hundred steps each have their own pace.
class Motion {
 public:
  explicit Motion(Random& random) : random_(random), d_(random.direction()) {}

  void step(Particle* a, Particle* b) {
    if (left_-- == 0) {
      left_ = random_.whole(50, 500);
      pace_ = random_.below(8) == 0 ? 0 : random_.log_uniform(1e-7, 0.3);
      axis_a_ = random_.direction();
      axis_b_ = random_.direction();
      axis_d_ = random_.direction();
      gap_pace_ = random_.log_uniform(1e-5, 0.3);
      depth_ = random_.log_uniform(1e-9, 0.1);
      if (random_.below(8) == 0 && a) a->q = random_.turn();
      if (random_.below(8) == 0 && b) b->q = random_.turn();
    }
    phase_ += gap_pace_;
    const auto turn = [](double angle, const Vec3& axis) { return Quat(Eigen::AngleAxisd(angle, axis)); };
    if (a && !still_a_) a->q = (turn(pace_, axis_a_) * a->q).normalized();
    if (b) b->q = (turn(0.7 * pace_, axis_b_) * b->q).normalized();
    d_ = (turn(pace_, axis_d_) * d_).normalized();
  }
  void hold_a() { still_a_ = true; }
  const Vec3& direction() const { return d_; }
  double gap() const { return depth_ * std::sin(phase_); }

 private:
  Random& random_;
  Vec3 d_, axis_a_, axis_b_, axis_d_;
  int left_ = 0;
  double pace_ = 0, gap_pace_ = 0, depth_ = 0, phase_ = 0;
  bool still_a_ = false;
};

Vec3 placed(const Solid& solid, const Particle& p, const Vec3& d) {
  return p.scale * (p.q * solid.support(p.q.conjugate() * d));
}

void note(Report* report, long step, const char* what, double is, double should) {
  if (!report->first.empty()) return;
  char line[160];
  std::snprintf(line, sizeof line, "step %ld: %s is %.17g, should be %.17g", step, what, is, should);
  report->first = line;
}

// The least p over directions near `from`, by a compass that turns at random, and where it is.
template <class Overlap>
double least_near(const Overlap& overlap, Vec3* d, double stride, double finest, Random& random) {
  double least = overlap(*d);
  for (int moves = 0; stride > finest && moves < 400; ++moves) {
    const Vec3 t = d->cross(random.direction()).normalized(), s = d->cross(t);
    Vec3 best = *d;
    double found = least;
    for (const Vec3& way : {t, Vec3(-t), s, Vec3(-s)}) {
      const Vec3 next = (*d + stride * way).normalized();
      const double p = overlap(next);
      if (p < found) found = p, best = next;
    }
    stride *= found < least ? 1.5 : 0.6;
    *d = best;
    least = found;
  }
  return least;
}

constexpr long kThorough = 2000;  // steps between two that are searched all over

}  // namespace

const std::vector<Actor>& all_actors() {
  static const std::vector<Actor> actors = make_actors();
  return actors;
}

Report run_pair(const Actor& actor_a, const Actor& actor_b, std::uint64_t seed, long steps) {
  Random random(seed);
  const Solid &sa = actor_a.solid, &sb = actor_b.solid;
  Particle a{sa.shape.get(), 1, Vec3::Zero(), random.turn()},
      b{sb.shape.get(), random.uniform(0.4, 1.2), Vec3::Zero(), random.turn()};
  const double ra = sa.shape->bounding_radius, rb = b.scale * sb.shape->bounding_radius,
               size = std::min(ra, rb), noise = actor_a.accuracy * ra + actor_b.accuracy * rb;
  const bool cheap = actor_a.every == 1 && actor_b.every == 1;
  const int every = std::max(actor_a.every, actor_b.every);
  double memory[kPairMemorySize] = {0};
  Motion motion(random);
  if (random.below(2)) motion.hold_a();
  Report report;
  Vec3 before = Vec3::UnitZ();
  for (; report.steps < steps; ++report.steps) {
    motion.step(&a, &b);
    const Vec3 d = motion.direction();
    const double gap = size * motion.gap();
    b.x = placed(sa, a, d) - placed(sb, b, -d) + gap * d;
    ContactSettings settings;
    settings.reach = report.steps % 3 ? 0 : std::numeric_limits<double>::infinity();
    const ContactResult r = find_contact(a, b, settings, memory);
    const double allowed = settings.tolerance * size + noise + 10 * kRoundoff * std::max(ra, rb);
    const auto overlap = [&](const Vec3& n) {
      return n.dot(placed(sa, a, n)) - n.dot(placed(sb, b, -n)) - n.dot(b.x);
    };
    const auto wrong = [&](const char* what, double is, double should) {
      ++report.wrong;
      note(&report, report.steps, what, is, should);
    };
    if (r.status == Status::unresolved) {
      ++report.unresolved;
      note(&report, report.steps, "unresolved, bracket", r.upper - r.lower, allowed);
    }
    if (!std::isfinite(r.gap)) wrong("gap", r.gap, gap);
    if (r.status == Status::separated) {  // a lower bound of the gap is enough
      if (gap > 0 && r.lower > gap + allowed) wrong("proven gap", r.lower, gap);
      if (gap <= 0 && -overlap(d) < -allowed && report.steps % every == 0) {
        // It may be apart though d does not part it: then some direction does.
        // A direction that parts them is a proof, whoever names it: a cold solve may.
        double none[kPairMemorySize] = {0};
        Vec3 n = find_contact(a, b, ContactSettings(), none).normal;
        if (!(overlap(d) > overlap(n))) n = d;
        for (int k = 0; k < 300; ++k) {
          const Vec3 other = k ? random.direction() : Vec3(b.x.normalized());
          if (overlap(other) < overlap(n)) n = other;
        }
        if (least_near(overlap, &n, 0.1, 1e-12, random) > allowed)
          wrong("touching, said apart", r.lower, gap);
      }
      continue;
    }
    ++report.touching;
    if (std::abs(r.normal.dot(r.point_b - r.point_a) - r.gap) > allowed)
      wrong("gap of the points", r.normal.dot(r.point_b - r.point_a), r.gap);
    if (gap > 0) {
      report.worst = std::max(report.worst, std::abs(r.gap - gap) / allowed);
      if (std::abs(r.gap - gap) > allowed) wrong("gap", r.gap, gap);
      if (r.lower > gap + noise + 1e-14 * size || r.upper < gap - noise - 1e-14 * size) {
        ++report.bracket;
        note(&report, report.steps, "bracket's end", r.lower > gap ? r.lower : r.upper, gap);
      }
    }
    if (report.steps % every != 0) continue;
    ++report.judged;
    const double along = -overlap(r.normal);
    report.worst = std::max(report.worst, std::abs(along - r.gap) / allowed);
    if (std::abs(along - r.gap) > allowed) wrong("gap", r.gap, along);
    // No direction parts the bodies sooner.
    double least = 1e300;
    const auto look = [&](const Vec3& n) { least = std::min(least, overlap(n)); };
    look(d);
    look(before);
    for (int k = cheap ? 24 : 8; k > 0; --k)
      look((r.normal + random.log_uniform(1e-7, 2) * random.direction()).normalized());
    if (cheap) {
      for (const Vec3& n : sa.normals) look(a.q * n);
      for (const Vec3& n : sb.normals) look(b.q * -n);
    }
    if (report.steps % (kThorough * every) == 0) {
      Vec3 best = r.normal;
      double lowest = 1e300;
      for (int k = cheap ? 1000 : 100; k > 0; --k) {
        const Vec3 n = random.direction();
        const double p = overlap(n);
        if (p < lowest) lowest = p, best = n;
      }
      least = std::min({least, least_near(overlap, &best, 0.1, 1e-12, random)});
      Vec3 near = r.normal;
      least = std::min(least, least_near(overlap, &near, 1e-3, 1e-12, random));
    }
    if (least < -r.gap - allowed) wrong("gap", r.gap, -least);
    before = r.normal;
  }
  return report;
}

Report run_plane(const Actor& actor, std::uint64_t seed, long steps) {
  Random random(seed);
  const Solid& solid = actor.solid;
  Particle p{solid.shape.get(), random.uniform(0.4, 1.2), Vec3::Zero(), random.turn()};
  const double size = p.scale * solid.shape->bounding_radius, noise = actor.accuracy * size;
  double memory[kPairMemorySize] = {0};
  Motion motion(random);
  Report report;
  for (; report.steps < steps; ++report.steps) {
    motion.step(&p, nullptr);
    const Vec3 n = random.below(1000) ? Vec3(Vec3::UnitZ()) : motion.direction();
    const double gap = size * motion.gap();
    const bool judged = report.steps % actor.every == 0;
    const Vec3 foot = placed(solid, p, -n);
    const Vec3 origin = (n.dot(foot) - gap) * n;
    ContactSettings settings;
    settings.reach = report.steps % 3 ? 0 : std::numeric_limits<double>::infinity();
    const ContactResult r = find_plane_contact(p, origin, n, settings, memory);
    const double allowed = settings.tolerance * size + noise + 10 * kRoundoff * size;
    const auto wrong = [&](const char* what, double is, double should) {
      ++report.wrong;
      note(&report, report.steps, what, is, should);
    };
    report.judged += judged;
    if (r.status == Status::unresolved) {
      ++report.unresolved;
      note(&report, report.steps, "unresolved, bracket", r.upper - r.lower, allowed);
    }
    if (r.status == Status::separated) {
      if (r.lower > gap + allowed) wrong("proven gap", r.lower, gap);
      continue;
    }
    ++report.touching;
    report.worst = std::max(report.worst, std::abs(r.gap - gap) / allowed);
    if (!(std::abs(r.gap - gap) <= allowed)) wrong("gap", r.gap, gap);
    if (r.lower > gap + noise + 1e-14 * size || r.upper < gap - noise - 1e-14 * size) {
      ++report.bracket;
      note(&report, report.steps, "bracket's end", r.lower > gap ? r.lower : r.upper, gap);
    }
  }
  return report;
}

}  // namespace nurbs::sequences

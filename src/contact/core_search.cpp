// See core_search.h.
#include "contact/core_search.h"

#include <cmath>
#include <cstring>

#include "contact/overlap/difference_simplex.h"

namespace nurbs {
namespace {

constexpr int kMostSteps = 40;       // 1 to 6 are usual
constexpr double kClosed = 4;        // round-offs of the larger body: of a bracket that is closed
constexpr double kOpen = 64;         // ... and of one that can't be closed further, at most
constexpr double kApartShare = 0.5;  // of what is proven beyond the reach, that the bracket may be open

// The nearest points of two cores, pair frame.
class CoreDistance {
 public:
  explicit CoreDistance(const PairFrame& pair)
      : pair_(pair), a_(pair.a->core), b_(pair.b->core), simplex_(pair.reach) {}

  void start(const LocalModel& last) {
    if (last.unique == kCorePair) {
      CorePair corners;
      std::memcpy(&corners, &last, sizeof corners);
      for (int k = 0; k < 3 && k < corners.count; ++k) add(corners.of_a[k], corners.of_b[k]);
    }
    if (simplex_.count() == 0) look(pair_.offset);
    if (simplex_.count() == 0) simplex_.add(difference(), i_, j_);
  }
  // Looks at the nearest points of what is known, and along the way between them; false where there is none.
  bool step(double least) {
    if (simplex_.surrounds_origin()) return false;
    const Vec3 way = simplex_.nearest();
    upper = way.norm();
    if (!(upper > least)) return false;
    direction = -1 / upper * way;
    look(direction);
    lower = -direction.dot(difference());
    return true;
  }
  bool grow() { return simplex_.add(difference(), i_, j_); }

  Vec3 point_a() const {
    return point([this](const auto& c) { return on_a(c.a); });
  }
  Vec3 point_b() const {
    return point([this](const auto& c) { return on_b(c.b); });
  }
  CorePair corners() const {
    CorePair out{};
    out.count = simplex_.count();
    for (int k = 0; k < simplex_.count(); ++k) {
      out.of_a[k] = simplex_.corner(k).a;
      out.of_b[k] = simplex_.corner(k).b;
    }
    return out;
  }

  double upper = 0, lower = 0;    // bounds of the distance
  Vec3 direction = Vec3::Zero();  // unit, from A to B

 private:
  void add(double i, double j) {
    if (!(i >= 0 && i < static_cast<double>(a_.points.size()) && j >= 0 &&
          j < static_cast<double>(b_.points.size())))
      return;
    i_ = static_cast<int>(i);
    j_ = static_cast<int>(j);
    simplex_.add(difference(), i_, j_);
  }
  void look(const Vec3& d) {
    i_ = a_.support(d);
    j_ = b_.support(pair_.direction_on_b(d));
  }
  Vec3 on_a(int k) const { return pair_.place_a(a_.points[k]); }
  Vec3 on_b(int k) const { return pair_.place_b(b_.points[k]); }
  Vec3 difference() const { return on_a(i_) - on_b(j_); }
  template <class Point>
  Vec3 point(const Point& of) const {
    Vec3 x = Vec3::Zero();
    for (int k = 0; k < simplex_.count(); ++k) x += simplex_.corner(k).weight * of(simplex_.corner(k));
    return x;
  }

  const PairFrame& pair_;
  const SpheroPolyhedron &a_, &b_;
  DifferenceSimplex simplex_;
  int i_ = 0, j_ = 0;
};

}  // namespace

bool solve_cores(const PairFrame& pair, double tolerance, const Particle& a, const Particle& b,
                 const ContactSettings& settings, PairMemory& memory, ContactResult* r) {
  if (!pair.both_swept(tolerance)) return give_up(kCorePair, &memory);
  const double radius_a = pair.scale_a * pair.a->core.radius, radius_b = pair.scale_b * pair.b->core.radius,
               radii = radius_a + radius_b;
  if (!(radii > 0)) return give_up(kCorePair, &memory);
  const double roundoff = kRoundoff * (pair.reach + pair.offset.lpNorm<1>()),
               slack = pair.scale_a * pair.a->core.error + pair.scale_b * pair.b->core.error + roundoff,
               least = kClosed * roundoff / settings.tolerance;
  CoreDistance cores(pair);
  cores.start(memory.model);
  bool apart = false;
  for (r->iterations = 1;; ++r->iterations) {
    if (r->iterations > kMostSteps || !cores.step(least)) return give_up(kCorePair, &memory);
    const double open = cores.upper - cores.lower, beyond = cores.lower - radii - slack - settings.reach;
    apart = beyond > 0 && open <= kApartShare * beyond;
    if (apart || open <= kClosed * roundoff) break;
    if (cores.grow()) continue;
    if (!(open <= kOpen * roundoff)) return give_up(kCorePair, &memory);
    break;
  }
  if (!apart && !(cores.upper - cores.lower + 2 * slack <= tolerance)) return give_up(kCorePair, &memory);

  r->rung = Rung::local_model;
  r->normal = pair.axes_a * cores.direction;
  r->gap = cores.upper - radii;
  r->lower = cores.lower - radii - slack;
  r->upper = r->gap + slack;
  r->point_a = pair.axes_a * (cores.point_a() + radius_a * cores.direction);
  r->point_b = pair.axes_a * (cores.point_b() - radius_b * cores.direction);
  r->status = r->lower > settings.reach ? Status::separated : Status::converged;
  const bool separated = r->status == Status::separated;
  if (separated) r->gap = r->lower;

  set_proof(r->normal, r->lower, b.x - a.x, a.q, b.q, &memory.proof);
  memory.proof.contact = !separated;
  memory.on_a.patch = memory.on_b.patch = -1;
  drop_model(&memory.model);
  if (separated) return true;
  const CorePair corners = cores.corners();
  std::memcpy(static_cast<void*>(&memory.model), &corners, sizeof corners);
  memory.model.unique = kCorePair;
  return true;
}

}  // namespace nurbs

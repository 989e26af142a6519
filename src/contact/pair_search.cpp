// The ladder: each rung answers or hands the pair on to the next, dearer one.
#include "contact/pair_search.h"

#include <cmath>
#include <cstring>
#include <limits>

#include "body/locate_point.h"
#include "contact/bridge_search.h"
#include "contact/core_search.h"
#include "contact/crease_search.h"
#include "contact/dents.h"
#include "contact/direction_search.h"
#include "contact/edge_search.h"
#include "contact/ellipsoid_search.h"
#include "contact/flat_search.h"
#include "contact/joint_newton.h"
#include "contact/overlap/deep_search.h"
#include "contact/overlap/polytope.h"
#include "contact/pair_frame.h"
#include "contact/pair_memory.h"
#include "contact/sphere_search.h"
#include "reference/cso.h"

namespace nurbs {
namespace {

constexpr double kGuessAbove = 0.1;    // of the smaller radius: a guess that much above the lowest is none
constexpr double kDeepGuess = 0.1;     // of it: deeper, what a scan found is not given to Newton
constexpr double kSameGuess = 0.9995;  // cosine between refined guesses: the atlases tell no more apart
constexpr double kOnFeature = 0.97;    // cosine between a direction and its support's normal: less on an edge
constexpr double kRoughSupport = 1e-5;  // of the body, that the supports Newton begins from may lack ...
constexpr double kRoughSlope = 2e-3;    // rad, ... and how far off they may be
constexpr double kNearlyClosed = 100;   // tolerances
constexpr double kOffSurface = 1e-7;    // of the body: polished points may be
constexpr double kNormalShare = 0.5;    // of the tolerance, by which the overlap along a normal may exceed it

bool set_separated(double lower, double reach, Rung rung, ContactResult* r) {
  if (!(lower > reach)) return false;
  set_apart(lower, rung, r);
  return true;
}

// Rung 1, no surface evaluation: what the last proof is still worth, then spheres.
NURBS_INLINE bool safe(const Particle& a, const Particle& b, double enough, const PairProof& proof,
                       ContactResult* r) {
  const double ra = a.scale * a.shape->bounding_radius, rb = b.scale * b.shape->bounding_radius;
  const Vec3 offset = b.x - a.x;
  if (set_separated(proven_gap(proof, offset, a.q, ra, b.q, rb, enough), enough, Rung::safe, r)) return true;
  const double spheres2 = offset.squaredNorm(), reach = ra + rb;
  constexpr double kRounded = 1 - 8 * kRoundoff;  // of the root and the difference
  return spheres2 > reach * reach &&
         set_separated((std::sqrt(spheres2) - reach) * kRounded, enough, Rung::safe, r);
}

// Moves the points along the normal until they are the gap apart: it was clamped into its bracket.
void agree(ContactResult* r) {
  const Vec3 shift = 0.5 * (r->gap - r->normal.dot(r->point_b - r->point_a)) * r->normal;
  r->point_a -= shift;
  r->point_b += shift;
}

class Ladder {
 public:
  Ladder(const Particle& a, const Particle& b, const ContactSettings& settings, PairMemory& memory)
      : a_(a), b_(b), settings_(settings), memory_(memory) {}

  // The rungs above the first. A pair that touched last time is looked for where it was.
  void climb(ContactResult* r) {
    if (!finite(a_) || !finite(b_)) return;
    if (local(r)) return;
    solve(r);
  }

  // The rungs that evaluate surfaces.
  __attribute__((noinline)) void solve(ContactResult* r) {
    if (solve_spheres(a_, b_, settings_, memory_, r)) return;
    if (solve_ellipsoids(a_, b_, settings_, memory_, r)) return;
    const bool touched = memory_.proof.contact != 0;
    const PairFrame pair(a_, b_);
    const double tolerance = std::max(settings_.tolerance * pair.size, kLeastTolerance * pair.reach);
    if (solve_cores(pair, tolerance, a_, b_, settings_, memory_, r)) return;
    if (!touched && bounds(pair, r)) return;
    if (memory_.on_a.patch >= 0 && warm(pair, tolerance, r)) return;
    if (touched && bounds(pair, r)) return;
    *r = cold(pair, tolerance, r->iterations);
  }

 private:
  // That the last solve's lower bound was taken along, pair frame. Needs a proof.
  Vec3 last_direction(const PairFrame& pair) const {
    return pair.axes_a.transpose() * load(memory_.proof.direction);
  }

  // Rung 2: the atlases along the last separating direction, or along the line of centres.
  bool bounds(const PairFrame& pair, ContactResult* r) {
    if (!std::isfinite(settings_.reach)) return false;
    const Vec3 d = has_proof(memory_.proof) ? last_direction(pair) : pair.offset.normalized();
    const double lower = -atlas_overlap(pair, d);
    if (!set_separated(lower, settings_.reach, Rung::bounds, r)) return false;
    remember_pose(pair, d, lower);
    return true;
  }

  // Rung 3: the quadratic model of the last solve. The model is not renewed: nothing accumulates.
  bool local(ContactResult* r) const {
    if (!(memory_.model.unique > 0)) return false;
    const double size = std::min(a_.scale * a_.shape->bounding_radius, b_.scale * b_.shape->bounding_radius);
    const Vec3 offset = b_.x - a_.x;
    const LocalContact c = evaluate_local(memory_.model.a, memory_.model.b, turn(a_.q.toRotationMatrix()),
                                          turn(b_.q.toRotationMatrix()), triple(offset), 1.0);
    if (!serves(c, memory_.model.unique, settings_.tolerance, size)) return false;
    set_local(c, offset, settings_.reach, r);
    return true;
  }

  // Where the contact would be, had it moved on as it last did; nothing solved.
  JointSolution warm_points(const PairFrame& pair) const {
    JointSolution s;
    s.iterations = 0;
    s.points.on_a = warm_point(memory_.on_a, *pair.a);
    s.points.on_b = warm_point(memory_.on_b, *pair.b);
    return s;
  }

  // Rung 4: Newton from there.
  bool warm(const PairFrame& pair, double tolerance, ContactResult* r) {
    if (meet_on_flat(pair, tolerance, r) || stay_on_bridge(pair, tolerance, r) ||
        stay_on_edge(pair, tolerance, r))
      return true;
    JointSolution s = solve_joint(pair, warm_point(memory_.on_a, *pair.a), warm_point(memory_.on_b, *pair.b),
                                  tolerance, settings_.reach, kWarmIterations);
    r->iterations = s.iterations;
    if (!s.converged && !confirm_joint(pair, tolerance, &s)) {
      if (meet_edge(pair, tolerance, &s, r)) return true;
      if (!is_too_deep(s)) return false;
      *r = deep(pair, tolerance, s);
      return true;
    }
    const double turned2_a = turned2(a_.q, memory_.proof.q_a), turned2_b = turned2(b_.q, memory_.proof.q_b);
    *r = finish(pair, s, s.normal, Rung::warm, s.iterations);
    if (r->status == Status::converged) remember_model(pair, s, turned2_a, turned2_b);
    return true;
  }

  // A face or a crease that the last direction belonged to.
  bool meet_on_flat(const PairFrame& pair, double tolerance, ContactResult* r) {
    if (!has_proof(memory_.proof) || (pair.a->flats.empty() && pair.b->flats.empty())) return false;
    JointSolution s = warm_points(pair);
    if (!meet_flat(pair, last_direction(pair), tolerance, &s)) return false;
    *r = finish(pair, s, s.normal, Rung::warm, s.iterations);
    return true;
  }

  // The sharp edges or the vertex that the contact lay on the last time.
  bool stay_on_edge(const PairFrame& pair, double tolerance, ContactResult* r) {
    if ((pair.a->smooth && pair.b->smooth) || !has_proof(memory_.proof)) return false;
    JointSolution s = warm_points(pair);
    if (!meet_edges(pair, last_direction(pair), tolerance, settings_.tolerance, &s)) return false;
    *r = finish(pair, s, s.normal, Rung::warm, s.iterations);
    return true;
  }

  // A contact on a crease or over a dent, where the surfaces have no common normal.
  bool meet_edge(const PairFrame& pair, double tolerance, JointSolution* s, ContactResult* r) {
    if (memory_.proof.contact == 0 || !has_proof(memory_.proof)) return false;
    const bool creased = !pair.a->smooth || !pair.b->smooth,
               dented =
                   has_dents(*pair.a, pair.scale_a, tolerance) || has_dents(*pair.b, pair.scale_b, tolerance);
    if (!creased && (!dented || is_too_deep(*s))) return false;
    const Vec3 d = last_direction(pair);
    Bridge bridge;
    if (!meet_bridge(pair, d, tolerance, settings_.tolerance, s, &bridge) &&
        !(creased && meet_crease(pair, d, tolerance, settings_.tolerance, s)))
      return false;
    *r = finish(pair, *s, s->normal, Rung::warm, s->iterations);
    if (bridge.known()) remember_bridge(bridge, *r);
    return true;
  }

  // The dent that the contact lay over the last time.
  bool stay_on_bridge(const PairFrame& pair, double tolerance, ContactResult* r) {
    if (memory_.model.unique != kBridge || memory_.proof.contact == 0 || !has_proof(memory_.proof))
      return false;
    Bridge bridge;
    std::memcpy(static_cast<void*>(&bridge), &memory_.model, sizeof bridge);
    JointSolution s;
    s.iterations = 0;
    s.points.on_a = surface_point(memory_.on_a);
    s.points.on_b = surface_point(memory_.on_b);
    if (!has_patch(*pair.a, s.points.on_a) || !has_patch(*pair.b, s.points.on_b) ||
        !meet_bridge(pair, last_direction(pair), tolerance, settings_.tolerance, &s, &bridge))
      return false;
    *r = finish(pair, s, s.normal, Rung::warm, s.iterations);
    remember_bridge(bridge, *r);
    return true;
  }

  void remember_bridge(const Bridge& bridge, const ContactResult& r) {
    if (r.status != Status::converged) return;
    static_assert(sizeof bridge <= 28 * sizeof(double), "in the place of the model's halves");
    std::memcpy(static_cast<void*>(&memory_.model), &bridge, sizeof bridge);
    memory_.model.unique = kBridge;
  }

  // A minimum of p that may not be the only one, whatever certificate: the polytope finds the others.
  static bool is_too_deep(const JointSolution& s) { return s.stationary && -s.gap > s.bracket.unique; }

  static Support rough_support(const Shape& shape, const Vec3& d) {
    return find_hull_support(shape, d, nullptr, kRoughSupport * shape.bounding_radius, kRoughSlope);
  }

  // Newton from the supports along a guessed direction, certified or not. False where a support lies on an
  // edge or a vertex: its surfaces have no such normal.
  bool polish(const PairFrame& pair, const DirectionGuess& guess, double tolerance, JointSolution* joint,
              int* spent) const {
    ++*spent;
    const Vec3 on_b = pair.direction_on_b(guess.d);
    const Support a = rough_support(*pair.a, guess.d);
    if (a.normal.dot(guess.d) < kOnFeature) return false;
    const Support b = rough_support(*pair.b, on_b);
    if (b.normal.dot(on_b) < kOnFeature) return false;
    *joint = solve_joint(pair, a.where, b.where, tolerance, settings_.reach, kPolishIterations);
    if (!joint->converged) confirm_joint(pair, tolerance, joint);
    *spent += joint->iterations;
    return true;
  }

  // The minimum of the last step as long as its proof lasts; then that and another proof, if they can be had.
  ContactResult deep(const PairFrame& pair, double tolerance, JointSolution& s) {
    static_assert(sizeof(DeepProof) <= 28 * sizeof(double), "in the place of the model's halves");
    const bool proven = memory_.model.unique == kDeepProof;
    DeepProof proof;
    std::memcpy(&proof, &memory_.model, sizeof proof);
    const bool lasts = proven && still_deepest(pair, tolerance, proof, &s);
    if (!lasts && !(search_deep(pair, tolerance, &s, &proof) && s.converged))
      return fallback(pair, &s, s.normal, tolerance, s.iterations);
    const ContactResult r = finish(pair, s, s.normal, lasts ? Rung::warm : Rung::fallback, s.iterations);
    if (r.status == Status::converged && proof.level > 0) {
      std::memcpy(static_cast<void*>(&memory_.model), &proof, sizeof proof);
      memory_.model.unique = kDeepProof;
    }
    return r;
  }

  // The line of centres leads to most contacts, and the certificate says when it did not: then the basins of
  // a scan over all directions, the lowest first, each once. Of bodies with creases or flats only the lowest
  // basin: there Newton seldom finds what it did not at first, and the polytope costs less than a few tries.
  // Where both bodies are a few points it costs less than the first; where the overlap is deep Newton proves
  // one in a hundred of what is scanned.
  ContactResult cold(const PairFrame& pair, double tolerance, int spent) {
    if (pair.both_swept(tolerance)) return fallback(pair, nullptr, pair.offset, tolerance, spent);
    JointSolution best;
    bool have = false;
    ContactResult answer;
    const auto answers = [&](const DirectionGuess& guess) {
      JointSolution joint;
      if (!polish(pair, guess, tolerance, &joint, &spent)) return false;
      if (joint.converged) {
        answer = finish(pair, joint, joint.normal, Rung::cold, spent);
        return true;
      }
      if (!joint.stationary || (have && joint.gap <= best.gap)) return false;
      best = joint;
      have = true;
      if (!is_too_deep(joint)) return false;
      answer = fallback(pair, &best, joint.normal, tolerance, spent);
      return true;
    };
    DirectionGuess guesses[kColdGuesses + 1];
    const int first = guess_from_centres(pair, guesses);
    if (first > 0 && answers(guesses[0] = refine_guess(pair, guesses[0]))) return answer;
    const int found = first + guess_directions(pair, guesses + first, kColdGuesses);
    guesses[first] = refine_guess(pair, guesses[first]);
    if (!(lowest_of(guesses, first + 1).p > kDeepGuess * pair.size)) {
      for (int k = first + 1; k < found; ++k) guesses[k] = refine_guess(pair, guesses[k]);
      const bool round = pair.a->curvature.min_radius > 0 && pair.b->curvature.min_radius > 0;
      const double most = lowest_of(guesses, found).p + (round ? kGuessAbove * pair.size : 0);
      for (int k = first; k < found; ++k)
        if (guesses[k].p <= most && !is_known(guesses, k) && answers(guesses[k])) return answer;
    }
    const Vec3 seed = lowest_of(guesses, found).d;
    JointSolution flat;
    flat.iterations = spent;
    flat.points.on_a = flat.points.on_b = SurfacePoint{-1, 0, 0};
    if (meet_flat(pair, seed, tolerance, &flat))
      return finish(pair, flat, flat.normal, Rung::cold, flat.iterations);
    return fallback(pair, have ? &best : nullptr, seed, tolerance, spent);
  }

  static const DirectionGuess& lowest_of(const DirectionGuess* guesses, int count) {
    return *std::min_element(guesses, guesses + count,
                             [](const DirectionGuess& x, const DirectionGuess& y) { return x.p < y.p; });
  }

  // Whether an earlier guess leads where guess number k does.
  static bool is_known(const DirectionGuess* guesses, int k) {
    return std::any_of(guesses, guesses + k,
                       [&](const DirectionGuess& g) { return g.d.dot(guesses[k].d) > kSameGuess; });
  }

  // Whether the overlap along a polished normal is that of a gap: of a body next to one much larger, or on a
  // flat, normals may be right to the tolerance of the angle, and the overlap along them not.
  static bool agrees(const PairFrame& pair, const JointSolution& s, double gap, double tolerance) {
    const auto [a, b] = hull_supports(pair, s.normal, &s.points.on_a, &s.points.on_b, tolerance);
    return -pair.overlap_along(s.normal, a.h, b.h) >= gap - kNormalShare * tolerance;
  }

  // Newton's last step is taken to second order: a long one, as along lines where nothing holds it, leads off
  // the surface.
  static bool is_on_surfaces(const PairFrame& pair, const PointPair& p) {
    const auto near = [&](const Shape& shape, const SurfacePoint& at, double scale, const Vec3& x) {
      return has_patch(shape, at) && (scale * evaluate0(shape.patches[at.patch], at.u, at.v) - x).norm() <=
                                         kOffSurface * scale * shape.bounding_radius;
    };
    return near(*pair.a, p.on_a, pair.scale_a, p.a) &&
           near(*pair.b, p.on_b, pair.scale_b, pair.turn.transpose() * (p.b - pair.offset));
  }

  // A bracket that stays open without the inner maps is worth them.
  ContactResult fallback(const PairFrame& pair, const JointSolution* known, const Vec3& seed,
                         double tolerance, int spent) {
    SearchedBalls balls;
    const ContactResult r = bracket(pair, known, seed, tolerance, spent, &balls);
    const LazyInnerMap &a = a_.shape->lazy_inner_map, &b = b_.shape->lazy_inner_map;
    if (r.status != Status::unresolved || (a.made() && b.made())) return r;
    const InnerMap &of_a = a_.shape->inner_map(), &of_b = b_.shape->inner_map();
    if (of_a.nodes.empty() && of_b.nodes.empty()) return r;
    return bracket(pair, known, seed, tolerance, r.iterations, &balls);
  }

  // The hull's points are where the bodies meet, but its places only have the same supports: for the next
  // step.
  static void locate(const PairFrame& pair, PointPair* p) {
    p->on_a = locate_point(*pair.a, p->on_a, p->a / pair.scale_a);
    p->on_b = locate_point(*pair.b, p->on_b, pair.turn.transpose() * (p->b - pair.offset) / pair.scale_b);
  }

  // The polytope brackets the global answer; a stationary point that lies inside its bracket is a better
  // estimate of points and normal than the polytope's own. Before it the search over directions, but with
  // faces and ruled lines, where that succeeds once in ten times, after it.
  ContactResult bracket(const PairFrame& pair, const JointSolution* known, const Vec3& seed, double tolerance,
                        int spent, SearchedBalls* balls) {
    JointSolution deep;
    deep.iterations = 0;
    if (known) deep = *known;
    const bool may_be_other = !known || is_too_deep(*known),
               faces = !pair.a->flats.empty() || !pair.b->flats.empty();
    const auto proves = [&] { return may_be_other && search_deep(pair, tolerance, &deep) && deep.converged; };
    const auto as_deep = [&] {
      return finish(pair, deep, deep.normal, Rung::fallback, spent + deep.iterations);
    };
    if (!faces && proves()) return as_deep();
    PolytopeResult hull =
        solve_polytope(pair, known ? known->normal : seed, tolerance, settings_.reach, balls);
    spent += hull.iterations;
    const auto is_open = [&] { return !hull.converged && !(hull.bracket.lower > settings_.reach); };
    // Whether a bracket closes that lacks little may depend on where the hull began.
    if (is_open() && hull.bracket.width() <= kNearlyClosed * tolerance) {
      const PolytopeResult again =
          solve_polytope(pair, -hull.bracket.direction, tolerance, settings_.reach, balls);
      spent += again.iterations;
      if (again.bracket.width() < hull.bracket.width()) hull = again;
    }
    if (faces && is_open() && proves()) return as_deep();
    if (hull.converged && (hull.closed || pair.both_swept(tolerance))) {
      locate(pair, &hull.points);
      return finish(pair, hull, hull.bracket.direction, Rung::fallback, spent);
    }
    JointSolution joint;
    bool polished = false;
    if (known && known->gap <= hull.bracket.upper && known->gap >= hull.bracket.lower - tolerance) {
      joint = *known;
      polished = true;
    } else {
      joint = solve_joint(pair, hull.points.on_a, hull.points.on_b, tolerance, settings_.reach,
                          kPolishIterations);
      spent += joint.iterations;
      if (joint.converged && agrees(pair, joint, joint.gap, tolerance))
        return finish(pair, joint, joint.normal, Rung::fallback, spent);
      polished =
          joint.stationary && joint.gap <= hull.bracket.upper && joint.gap >= hull.bracket.lower - tolerance;
    }
    const double lower = std::max(hull.bracket.lower, joint.bracket.lower);
    const double gap = std::clamp(joint.gap, lower, std::max(lower, hull.bracket.upper));
    if (polished && is_on_surfaces(pair, joint.points) && agrees(pair, joint, gap, tolerance)) {
      hull.points = joint.points;
      hull.bracket.direction = joint.normal;
      hull.bracket.lower = lower;
      hull.gap = gap;
    } else {
      if (hull.inside) find_points_again(pair, tolerance, &hull);
      locate(pair, &hull.points);
    }
    hull.converged = hull.converged || hull.bracket.width() <= tolerance;
    if (is_open()) {
      deep = joint;
      if (!joint.stationary) deep.iterations = 0;
      if (search_deep(pair, tolerance, &deep, nullptr, DeepEffort::last) && deep.converged) return as_deep();
    }
    return finish(pair, hull, hull.bracket.direction, Rung::fallback, spent);
  }

  template <class Solution>
  ContactResult finish(const PairFrame& pair, const Solution& s, const Vec3& normal, Rung rung,
                       int iterations) {
    remember_pose(pair, s.bracket.direction, s.bracket.lower);
    remember_points(s.points);
    ContactResult r;
    r.rung = rung;
    r.iterations = iterations;
    r.lower = s.bracket.lower;
    r.upper = s.bracket.upper;
    r.gap = s.gap;
    r.normal = pair.axes_a * normal;
    r.point_a = pair.axes_a * s.points.a;
    r.point_b = pair.axes_a * s.points.b;
    r.status = r.lower > settings_.reach ? Status::separated
               : s.converged             ? Status::converged
                                         : Status::unresolved;
    if (r.status == Status::separated)
      r.gap = r.lower;
    else
      agree(&r);
    return r;
  }

  void remember_pose(const PairFrame& pair, const Vec3& d, double lower) {
    drop_model(&memory_.model);  // a model belongs to the old reference
    set_proof(pair.axes_a * d, lower, b_.x - a_.x, a_.q, b_.q, &memory_.proof);
    memory_.proof.contact = !(lower > settings_.reach);
  }

  void remember_points(const PointPair& p) {
    remember_point(p.on_a, &memory_.on_a);
    remember_point(p.on_b, &memory_.on_b);
  }

  void remember_model(const PairFrame& pair, const JointSolution& s, double turned2_a, double turned2_b) {
    const ModelSide a{*pair.a, pair.scale_a, s.base_a, s.jet_a, Mat3::Identity(), Vec3::Zero(), turned2_a};
    const ModelSide b{*pair.b,     pair.scale_b, s.base_b, s.jet_b, pair.turn.transpose(),
                      pair.offset, turned2_b};
    const auto turn = [&] {
      return s.dented ? turn_to_rival(s.side_a(pair), s.side_b(pair)) : kNormalMargin;
    };
    make_local_model(
        a, b, [&] { return pair.turn; }, s.gap, settings_.tolerance, pair.size, 0.5 * s.bracket.unique, turn,
        &memory_.model);
  }

  const Particle &a_, &b_;
  const ContactSettings& settings_;
  PairMemory& memory_;
};

// Out of line: a pair skipped by its budget need not set up what the others use.
__attribute__((noinline)) void climb(const Particle& a, const Particle& b, const ContactSettings& settings,
                                     PairMemory& m, ContactResult* r) {
  Ladder(a, b, settings, m).climb(r);
}

}  // namespace

ContactResult find_contact(const Particle& a, const Particle& b, const ContactSettings& settings,
                           double* memory) {
  if (!is_unit(a.q) || !is_unit(b.q)) {
    const Particle unit_a = with_unit_turn(a), unit_b = with_unit_turn(b);
    if (is_unit(unit_a.q) && is_unit(unit_b.q)) return find_contact(unit_a, unit_b, settings, memory);
    return ContactResult();
  }
  if (settings.solver == Solver::cso) return find_contact_cso(a, b, settings, memory);
  PairMemory& m = memory_at(memory);
  adopt(pair_stamp(stamp(a), stamp(b), settings.solver), &m);
  ContactResult r;
  if (m.proof.contact != 0 || !safe(a, b, settings.reach, m.proof, &r)) climb(a, b, settings, m, &r);
  return r;
}

ContactResult solve_contact(const Particle& a, const Particle& b, const ContactSettings& settings,
                            PairMemory& memory) {
  ContactResult r;
  if (finite(a) && finite(b)) Ladder(a, b, settings, memory).solve(&r);
  return r;
}

}  // namespace nurbs

// The paper's solver: f1 gives a direction to start from, trust-region Newton on f2(rho, phi) finds the
// direction of maximum penetration (Craveiro & Gay Neto, section 4). Everything is computed in A's axes about
// A's centre of mass.
#include "reference/cso.h"

#include <algorithm>
#include <cmath>

#include "body/support.h"
#include "contact/pair_memory.h"
#include "reference/cso_derivatives.h"
#include "reference/trust_region.h"

namespace nurbs {
namespace {

// Caps. Smooth bodies take 3 to 8 iterations of either search; deep or nearly flat pairs some tens.
constexpr int kMaxNearestIterations = 40;
constexpr int kMaxAngleIterations = 60;
constexpr int kMaxDescentEvaluations = 60;
constexpr int kMaxRounds = 3;

// f1 only provides a start: it stops when its gradient is this small against the gap vector, or the gap
// vector this small against the bodies (the surfaces intersect).
constexpr double kNearestParallel = 1e-3;
constexpr double kNearestTouching = 1e-4;

constexpr double kFirstAngleRadius = 0.5, kMaxAngleRadius = 1.0, kSmallestAngleRadius = 1e-11;  // rad
constexpr double kMinSinPhi = 0.5;       // below it the chart is changed
constexpr double kHeldSlope = 1e-8;      // rad: an edge parameter with a larger slope is held by a crease
constexpr double kSlipRoundoff = 1e-14;  // of the extent: the tangential gap can't be made smaller

// Two placed bodies: B's frame seen from A's.
struct PlacedPair {
  const Shape& a;
  const Shape& b;
  double scale_a, scale_b;
  Mat3 rotation_b;  // B's axes into A's axes
  Vec3 center_b;    // in A's axes, about A's centre of mass
  double size;      // the smaller bounding radius
  double extent;    // of everything, for round-off
};

PlacedPair place_pair(const Particle& a, const Particle& b) {
  const double ra = a.scale * a.shape->bounding_radius, rb = b.scale * b.shape->bounding_radius;
  const Vec3 center_b = a.q.conjugate() * (b.x - a.x);
  const Mat3 rotation_b = (a.q.conjugate() * b.q).toRotationMatrix();
  return {*a.shape,   *b.shape, a.scale,          b.scale,
          rotation_b, center_b, std::min(ra, rb), ra + rb + center_b.norm()};
}

// ---- f1: points of the two surfaces near each other
// -----------------------------------------------------------

struct NearPoints {
  SurfacePoint on_a, on_b;
  Jet2 a, b;  // placed
};

NearPoints near_points(const PlacedPair& pair, const SurfacePoint& on_a, const SurfacePoint& on_b) {
  const Jet2 a = evaluate2(pair.a.patches[on_a.patch], on_a.u, on_a.v);
  const Jet2 b = evaluate2(pair.b.patches[on_b.patch], on_b.u, on_b.v);
  return {on_a, on_b, place(a, pair.scale_a, Mat3::Identity(), Vec3::Zero()),
          place(b, pair.scale_b, pair.rotation_b, pair.center_b)};
}

SurfacePoint atlas_start(const Shape& shape, const Vec3& d) {
  return shape.atlas.where.empty() ? SurfacePoint{} : shape.atlas.where[shape.atlas.nearest(d)];
}

// Length of a unit step of each parameter; the trust region is measured in lengths so that it means the same
// on large and small patches. Near a pole a parameter moves nothing: it then counts as a small length instead
// of none.
Vec4 parameter_lengths(const NearPoints& at, double size) {
  const Vec4 lengths(at.a.su.norm(), at.a.sv.norm(), at.b.su.norm(), at.b.sv.norm());
  return lengths.cwiseMax(1e-3 * size);
}

// Minimises f1 (eq. 8) over (uA, vA, uB, vB), crossing patches, from the atlas nodes facing each other along
// `d`. Coarse: the minimiser is only a start, and for intersecting bodies it is any point of the intersection
// curve.
NearPoints minimise_f1(const PlacedPair& pair, const Vec3& d, int& iterations) {
  NearPoints at =
      near_points(pair, atlas_start(pair.a, d), atlas_start(pair.b, pair.rotation_b.transpose() * -d));
  GapObjective f = gap_objective(at.a, at.b);
  TrustRegion region{0.5 * pair.size, 2 * pair.size};
  const double touching = 0.5 * std::pow(kNearestTouching * pair.size, 2);
  for (int i = 0; i < kMaxNearestIterations && f.value > touching; ++i, ++iterations) {
    const Vec4 lengths = parameter_lengths(at, pair.size);
    const Vec4 gradient = f.gradient.cwiseQuotient(lengths);
    if (gradient.norm() <= kNearestParallel * std::sqrt(2 * f.value)) break;
    const Mat4 hessian =
        lengths.cwiseInverse().asDiagonal() * f.hessian * lengths.cwiseInverse().asDiagonal();
    const TrustRegionStep<4> trial = solve_trust_region<4>(gradient, hessian, region.radius);
    const Vec4 step = trial.step.cwiseQuotient(lengths);
    const NearPoints next =
        near_points(pair, walk(pair.a, at.on_a, step[0], step[1]), walk(pair.b, at.on_b, step[2], step[3]));
    const GapObjective f_next = gap_objective(next.a, next.b);
    if (region.accept(f.value - f_next.value, trial.predicted, trial.on_boundary, trial.step.norm(),
                      1e-15 * f.value)) {
      at = next;
      f = f_next;
    }
    if (region.radius < 1e-9 * pair.size) break;
  }
  return at;
}

// The direction f1's minimiser suggests. Intersecting surfaces: the difference of the outer normals (paper,
// end of section 4). Apart: the gap vector itself. One body inside the other has parallel normals there, and
// the way out is along the normal of the outer one. `fallback` where none of these is defined (poles of the
// parametrisation).
Vec3 start_direction(const NearPoints& at, const Vec3& fallback) {
  const Vec3 normal_a = at.a.su.cross(at.a.sv).normalized(), normal_b = at.b.su.cross(at.b.sv).normalized();
  const Vec3 g = at.a.s - at.b.s;
  if (!normal_a.allFinite() || !normal_b.allFinite()) return fallback;
  if (normal_a.squaredNorm() < 0.5 || normal_b.squaredNorm() < 0.5) return fallback;
  const double length = g.norm();
  if (length > 0 && -normal_a.dot(g) > 0.99 * length && normal_b.dot(g) > 0.99 * length) return -g / length;
  if (normal_a.dot(normal_b) > 0.9) return g.dot(normal_a) > 0 ? normal_a : Vec3(-normal_b);
  return (normal_a - normal_b).normalized();
}

// ---- f2: the direction of maximum penetration
// -----------------------------------------------------------------

// Everything known at one direction.
struct AtDirection {
  Vec3 d = Vec3::Zero();
  SurfacePoint on_a, on_b;
  Vec3 a = Vec3::Zero(), b = Vec3::Zero();  // support points
  Vec3 g = Vec3::Zero();                    // a - b, eq. 7
  double p = 0;                             // d . g: overlap along d
  Vec3 slip = Vec3::Zero();                 // g - p d, gradient of p on the sphere; zero at a solution

  double f2() const { return 0.5 * g.squaredNorm(); }
};

// A start is worth nothing where the surface faces away from d: the far side is stationary too, a minimum.
// Nor at a pole of the parametrisation, where su x sv is round-off.
bool faces(const Shape& shape, const SurfacePoint& at, const Vec3& d) {
  const Jet1 s = evaluate1(shape.patches[at.patch], at.u, at.v);
  return d.dot(s.su.cross(s.sv)) > 1e-10 * shape.bounding_radius * shape.bounding_radius;
}

Support support_from(const Shape& shape, const Vec3& d, const SurfacePoint& start) {
  return find_hull_support(shape, d, faces(shape, start, d) ? &start : nullptr);
}

AtDirection look_along(const PlacedPair& pair, const Vec3& d, const SurfacePoint& on_a,
                       const SurfacePoint& on_b) {
  const Support a = support_from(pair.a, d, on_a);
  const Support b = support_from(pair.b, pair.rotation_b.transpose() * -d, on_b);
  AtDirection at;
  at.d = d;
  at.on_a = a.where;
  at.on_b = b.where;
  at.a = pair.scale_a * a.point;
  at.b = pair.center_b + pair.rotation_b * (pair.scale_b * b.point);
  at.g = at.a - at.b;
  at.p = d.dot(at.g);
  at.slip = at.g - at.p * d;
  return at;
}

bool held(double parameter, const Vec3& tangent, const Vec3& d) {
  return (parameter <= 0 || parameter >= 1) && std::abs(d.dot(tangent)) > kHeldSlope * tangent.norm();
}

FreeParameters free_parameters(const SurfacePoint& at, const Jet3& s, const Vec3& d) {
  return {!held(at.u, s.su, d), !held(at.v, s.sv, d)};
}

// Value, gradient and Hessian of f2 in the angles of `chart`. False where the implicit derivatives do not
// exist.
bool model_f2(const PlacedPair& pair, const AtDirection& at, const DirectionJet& direction,
              AngleObjective& f) {
  const Jet3 a = place(evaluate3(pair.a.patches[at.on_a.patch], at.on_a.u, at.on_a.v), pair.scale_a,
                       Mat3::Identity(), Vec3::Zero());
  const Jet3 b = place(evaluate3(pair.b.patches[at.on_b.patch], at.on_b.u, at.on_b.v), pair.scale_b,
                       pair.rotation_b, pair.center_b);
  const ParameterJet eta_a = parameter_jet(a, direction, free_parameters(at.on_a, a, at.d));
  const ParameterJet eta_b = parameter_jet(b, direction, free_parameters(at.on_b, b, at.d));
  if (!eta_a.regular || !eta_b.regular) return false;
  f = angle_objective(gap_objective(second_order_part(a), second_order_part(b)), eta_a, eta_b);
  return f.gradient.allFinite() && f.hessian.allFinite();
}

// Trust-region Newton on f2 until the gap vector is parallel to d (|slip| <= goal), or it stalls: at a point
// where f2 is stationary but g is not parallel to d, which needs vanishing curvature, or where its
// derivatives jump or do not exist.
void minimise_f2(const PlacedPair& pair, AtDirection& at, double goal, int& iterations) {
  SphericalChart chart = SphericalChart::choose(at.d);
  TrustRegion region{kFirstAngleRadius, kMaxAngleRadius};
  AngleObjective f;
  Vec2 angles = Vec2::Zero();
  bool moved = true;
  for (int i = 0; i < kMaxAngleIterations && at.slip.norm() > goal; ++i, ++iterations) {
    if (moved) {
      // The angles are singular at the poles of the chart: change to another polar axis long before.
      if (std::sin(chart.angles(at.d)[1]) < kMinSinPhi) chart = SphericalChart::choose(at.d);
      angles = chart.angles(at.d);
      if (!model_f2(pair, at, chart.direction(angles), f)) return;
    }
    const TrustRegionStep<2> trial = solve_trust_region<2>(f.gradient, f.hessian, region.radius);
    const double length = trial.step.norm();
    if (!(length > 0)) return;
    const Vec3 d = chart.direction(angles + trial.step).d;
    const AtDirection next = look_along(pair, d, at.on_a, at.on_b);
    const double noise = kSlipRoundoff * pair.extent * at.g.norm();  // of f2
    moved = region.accept(at.f2() - next.f2(), trial.predicted, trial.on_boundary, length, noise);
    // Where f2 is all round-off, the slip still tells better from worse.
    if (moved && trial.predicted <= noise && next.slip.norm() >= at.slip.norm()) return;
    if (moved) at = next;
    if (region.radius < kSmallestAngleRadius) return;
  }
}

// Where f2 can't go on, p can: its gradient, slip, exists at every d and vanishes only at solutions. Steepest
// descent with a step that adapts; not the paper's, whose bodies have regular derivatives everywhere.
void descend_p(const PlacedPair& pair, AtDirection& at, double goal, int& iterations) {
  double step = 1 / pair.extent;
  for (int i = 0; i < kMaxDescentEvaluations && at.slip.norm() > goal; ++i, ++iterations) {
    const Vec3 d = (at.d - step * at.slip).normalized();
    const AtDirection next = look_along(pair, d, at.on_a, at.on_b);
    const bool better = next.p < at.p - 1e-4 * step * at.slip.squaredNorm();
    step *= better ? 1.5 : 0.3;
    if (better) at = next;
  }
}

Vec3 center_direction(const PlacedPair& pair) {
  const double distance = pair.center_b.norm();
  return distance > 1e-12 * pair.size ? Vec3(pair.center_b / distance) : Vec3(Vec3::UnitX());
}

AtDirection cold_start(const PlacedPair& pair, int& iterations) {
  const Vec3 toward = center_direction(pair);
  const NearPoints near = minimise_f1(pair, toward, iterations);
  return look_along(pair, start_direction(near, toward), near.on_a, near.on_b);
}

AtDirection warm_start(const PlacedPair& pair, const Particle& a, const CsoStart& start) {
  return look_along(pair, (a.q.conjugate() * start.direction).normalized(), start.on_a, start.on_b);
}

ContactResult report(const Particle& a, const AtDirection& at, double accept, double size) {
  ContactResult result;
  result.gap = result.lower = result.upper = -at.p;
  result.normal = a.q * at.d;
  result.point_a = a.q * at.a;
  result.point_b = a.q * at.b;
  if (at.slip.norm() <= accept) {
    result.status = Status::converged;
  } else {
    // p(d) of any d bounds the overlap from above, and no pair of points is closer than the gap.
    result.status = Status::unresolved;
    result.upper = std::max(result.lower, at.g.norm() + 1e-15 * size);
  }
  return result;
}

}  // namespace

ContactResult solve_cso(const Particle& a, const Particle& b, double tolerance, CsoStart* start) {
  const PlacedPair pair = place_pair(a, b);
  const bool warm = start && start->valid;
  int iterations = 0;
  AtDirection at = warm ? warm_start(pair, a, *start) : cold_start(pair, iterations);

  // The slip is first order in the error of d, the gap second order: a slip of tolerance * size leaves normal
  // and points good to about the tolerance and the gap to its square. When round-off stops the search
  // earlier, a slip that still leaves the gap a thousandfold better than the tolerance counts as converged.
  const double goal = std::max(tolerance * pair.size, kSlipRoundoff * pair.extent);
  const double accept = std::max(goal, 1e-3 * std::sqrt(tolerance) * pair.size);
  Rung rung = warm ? Rung::warm : Rung::cold;
  for (int round = 0; round < kMaxRounds; ++round) {
    minimise_f2(pair, at, goal, iterations);
    if (at.slip.norm() <= accept) break;
    rung = Rung::fallback;
    descend_p(pair, at, goal, iterations);
    if (at.slip.norm() <= goal) break;
  }

  ContactResult result = report(a, at, accept, pair.extent);
  result.rung = rung;
  result.iterations = iterations;
  if (start) *start = {result.status == Status::converged, result.normal, at.on_a, at.on_b};
  return result;
}

ContactResult find_contact_cso(const Particle& a, const Particle& b, const ContactSettings& settings,
                               double* memory) {
  if (!finite(a) || !finite(b)) return {};
  PairMemory& m = memory_at(memory);
  adopt(pair_stamp(stamp(a), stamp(b), Solver::cso), &m);
  CsoStart start;
  start.valid = m.on_a.patch >= 0;
  start.direction = load(m.proof.direction);
  start.on_a = warm_point(m.on_a, *a.shape);
  start.on_b = warm_point(m.on_b, *b.shape);
  const ContactResult r = solve_cso(a, b, settings.tolerance, &start);
  const auto keep = [&](const SurfacePoint& at, PointMemory* to) {
    *to = point_memory(at);
    if (!start.valid) to->patch = -1;
  };
  store(start.direction, m.proof.direction);
  keep(start.on_a, &m.on_a);
  keep(start.on_b, &m.on_b);
  return r;
}

}  // namespace nurbs

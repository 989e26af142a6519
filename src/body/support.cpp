// Projected Newton for the support mapping: maximise d . s(u, v) over one patch's unit square; where the
// ascent leaves through an edge, continue in the neighbour if the ascent goes on there, otherwise stay on the
// edge (one variable) or the corner (none). The normal at the end certifies the answer; where there is none,
// or it is no proof (poles, creases, corners, dents), the patches are searched in Bernstein form.
#include "body/support.h"

#include <algorithm>
#include <cmath>

#include "body/connectivity.h"
#include "body/patch_maximum.h"
#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

constexpr double kFanSafety = 1.1;  // sines of slopes stand for angles
constexpr double kTopError = 10;    // times kFeatureSupport

// The end of edge `edge` in patch parameters, and which parameter is pinned on it.
bool pins_u(int edge) {
  return edge < 2;
}
double pinned_value(int edge) {
  return (edge == 1 || edge == 3) ? 1.0 : 0.0;
}

// Slope of f along the unit tangent pointing into the patch from one of its edges.
double inward_slope(const Jet1& jet, int edge, const Vec3& d) {
  const Vec3& across_edge = pins_u(edge) ? jet.su : jet.sv;
  const Vec3& along_edge = pins_u(edge) ? jet.sv : jet.su;
  Vec3 t = across_edge;
  const double along2 = along_edge.squaredNorm();
  if (along2 > 0) t -= along_edge * (along_edge.dot(across_edge) / along2);
  const double length = t.norm();
  if (!(length > 0)) return 0;
  const double slope = d.dot(t) / length;
  return pinned_value(edge) > 0 ? -slope : slope;
}

// Whether f ascends into the patch from a point of its edge `edge`. At the patch's corner the way in is
// narrower or wider than a right angle: there the other edge counts too, which two patches may share that a
// third one sees across neither.
bool ascends_into(const Jet1& jet, const SurfacePoint& at, int edge, const Vec3& d) {
  if (inward_slope(jet, edge, d) > kSlopeTolerance) return true;
  const double along = pins_u(edge) ? at.v : at.u;
  if (along > kOnEdge && along < 1 - kOnEdge) return false;
  const Vec3& other = pins_u(edge) ? jet.su : jet.sv;
  const double slope = pinned_value(edge) > 0 ? -d.dot(other) : d.dot(other);
  return slope > kSlopeTolerance * other.norm();
}

// First and second derivatives of f = d . s, and the first fundamental form.
struct Model {
  double gu, gv, huu, huv, hvv, e, f, g;
  Model(const Jet2& j, const Vec3& d)
      : gu(d.dot(j.su)),
        gv(d.dot(j.sv)),
        huu(d.dot(j.suu)),
        huv(d.dot(j.suv)),
        hvv(d.dot(j.svv)),
        e(j.su.squaredNorm()),
        f(j.su.dot(j.sv)),
        g(j.sv.squaredNorm()) {}
};

struct Step {
  double du = 0, dv = 0;
  double slope = 0;   // of f along the steepest free tangent direction
  double length = 0;  // of the step on the surface
};

// On one parameter; `size` is the body's.
Step ascend_along(double g, double h, double metric, double size) {
  Step step;
  if (!(metric > 0)) return step;
  step.slope = std::abs(g) / std::sqrt(metric);
  step.du = h * size < -kFlatCurvature * metric ? -g / h : (g > 0 ? 1.0 : g < 0 ? -1.0 : 0.0);
  step.du = std::clamp(step.du, -1.0, 1.0);
  step.length = std::abs(step.du) * std::sqrt(metric);
  return step;
}

// Newton step with the curvatures' absolute values, in an orthonormal frame of the tangent plane; along each
// principal direction at most a parameter unit. (Steepest ascent zigzags for ever where a body bends sharply
// one way and hardly the other.)
void saddle_free_step(const Model& m, double area2, Step* step) {
  const double shear = m.f / m.e, r = 1 / std::sqrt(m.e), s = std::sqrt(m.e / area2);
  const double g1 = r * m.gu, g2 = s * (m.gv - shear * m.gu);
  const double h11 = r * r * m.huu, h12 = r * s * (m.huv - shear * m.huu);
  const double h22 = s * s * (m.hvv - 2 * shear * m.huv + shear * shear * m.huu);
  const double mean = 0.5 * (h11 + h22), split = std::hypot(0.5 * (h11 - h22), h12);
  const double angle = 0.5 * std::atan2(2 * h12, h11 - h22), c = std::cos(angle), sn = std::sin(angle);
  const auto go = [&](double x, double y, double curvature) {
    const double slope = g1 * x + g2 * y, du = r * x - shear * s * y, dv = s * y;
    const double farthest = 1 / std::max(std::abs(du), std::abs(dv));
    const double newton = std::abs(curvature) * farthest > std::abs(slope) ? slope / std::abs(curvature)
                                                                           : std::copysign(farthest, slope);
    step->du += newton * du;
    step->dv += newton * dv;
  };
  go(c, sn, mean + split);
  go(-sn, c, mean - split);
}

// Newton step on the free parameters; `size` is the body's. Where the Hessian is not negative definite, a
// saddle-free one.
Step ascend(const Model& m, double size, bool free_u, bool free_v) {
  if (!free_u && !free_v) return {};
  if (!free_v) return ascend_along(m.gu, m.huu, m.e, size);
  if (!free_u) {
    Step step = ascend_along(m.gv, m.hvv, m.g, size);
    std::swap(step.du, step.dv);
    return step;
  }
  const double area2 = m.e * m.g - m.f * m.f;
  if (!(area2 > kSingularMetric * m.e * m.g) ||
      std::min(m.e, m.g) <
          kPoleMetric *
              std::max(m.e, m.g)) {  // a degenerate point: only the non-vanishing direction is usable
    if (m.e > m.g) return ascend_along(m.gu, m.huu, m.e, size);
    Step step = ascend_along(m.gv, m.hvv, m.g, size);
    std::swap(step.du, step.dv);
    return step;
  }
  Step step;
  const double slope2 = (m.g * m.gu * m.gu - 2 * m.f * m.gu * m.gv + m.e * m.gv * m.gv) / area2;
  step.slope = std::sqrt(std::max(0.0, slope2));
  const double det = m.huu * m.hvv - m.huv * m.huv;
  // det / area2 is the product of the curvatures of f along the surface, 1/length^2.
  if (m.huu < 0 && det * size * size > kFlatCurvature * kFlatCurvature * area2) {
    step.du = (-m.hvv * m.gu + m.huv * m.gv) / det;
    step.dv = (m.huv * m.gu - m.huu * m.gv) / det;
  } else {
    saddle_free_step(m, area2, &step);
  }
  const double largest = std::max(std::abs(step.du), std::abs(step.dv));
  if (largest > 1) {
    step.du /= largest;
    step.dv /= largest;
  }
  step.length = std::sqrt(
      std::max(0.0, m.e * step.du * step.du + 2 * m.f * step.du * step.dv + m.g * step.dv * step.dv));
  return step;
}

// Edge through which the ascent would leave the patch at a boundary point, or -1; skips edges in `closed`.
int leaving_edge(const SurfacePoint& at, const Model& m, unsigned closed) {
  if (at.u <= kOnEdge && m.gu < 0 && !(closed & 1u)) return 0;
  if (at.u >= 1 - kOnEdge && m.gu > 0 && !(closed & 2u)) return 1;
  if (at.v <= kOnEdge && m.gv < 0 && !(closed & 4u)) return 2;
  if (at.v >= 1 - kOnEdge && m.gv > 0 && !(closed & 8u)) return 3;
  return -1;
}

// Share of a step in one parameter that stays inside [0, 1].
double share_inside(double x, double dx) {
  if (x + dx < 0) return x / -dx;
  if (x + dx > 1) return (1 - x) / dx;
  return 1;
}

// Newton step that does not leave at once through an edge `at` lies on: if it would, though the gradient
// points inward, first along the edge alone. (With no slope left along the edge the full step points inward.)
Step inward_step(const Model& m, double size, const SurfacePoint& at, bool free_u, bool free_v) {
  const Step step = ascend(m, size, free_u, free_v);
  const auto leaves = [](double x, double dx) {
    return (x <= kOnEdge && dx < 0) || (x >= 1 - kOnEdge && dx > 0);
  };
  const bool leaves_u = leaves(at.u, step.du), leaves_v = leaves(at.v, step.dv);
  if (!leaves_u && !leaves_v) return step;
  Step along = ascend(m, size, free_u && !leaves_u, free_v && !leaves_v);
  along.slope = step.slope;
  return along;
}

// A surface normal and its error, rad; infinite where it is round-off (poles, collapsed edges). Next to a
// pole the shorter tangent has the round-off of the longer one.
struct Normal {
  Vec3 n;
  double noise;
};
Normal normal_at(const Shape& shape, const Vec3& su, const Vec3& sv) {
  const Vec3 cross = su.cross(sv);
  const double area2 = cross.squaredNorm(), product2 = su.squaredNorm() * sv.squaredNorm();
  const double least = kPoleSpeed * shape.bounding_radius;
  if (!(area2 > kLeastSine * kLeastSine * product2 && area2 > least * least * least * least))
    return {Vec3::Zero(), std::numeric_limits<double>::infinity()};
  const double area = std::sqrt(area2);
  Normal normal{cross / area, kNormalNoise * std::sqrt(product2) / area};
  const double shorter2 = std::min(su.squaredNorm(), sv.squaredNorm());
  if (shorter2 * shorter2 < kNearPole * kNearPole * product2)
    normal.noise += kTangentNoise * shape.bounding_radius / std::sqrt(shorter2);
  normal.noise += pole_noise(shape, shorter2);
  return normal;
}

// What h(d) may exceed d . (surface point) by: from the point's normal, as in contact/certificate.h. Infinite
// where there is none or it looks away from d.
double excess_at(const Shape& shape, const Vec3& d, const SurfacePoint& at, const Normal& normal) {
  if (!(d.dot(normal.n) > 0)) return std::numeric_limits<double>::infinity();
  const double chord = (d - normal.n).norm() + normal.noise, chord2 = chord * chord;
  return rolling_excess(rolling_radii(shape, at, normal.n), shape.small_kinks, shape.bounding_radius, chord2);
}

// The edge of its patch that a point lies on; -1 inside and at corners.
int edge_of(const SurfacePoint& at) {
  const int u = at.u <= 0 ? 0 : at.u >= 1 ? 1 : -1, v = at.v <= 0 ? 2 : at.v >= 1 ? 3 : -1;
  return u < 0 ? v : v < 0 ? u : -1;
}

// The same at a point x of a crease that opens. Of the directions m in the fan between its sides' normals x
// is the support: no other point has such a normal (normal_map.h, or the body has no dents at all). Beyond
// the fan h(d) <= d.x + r (1 - d.m), r the largest curvature radius near d; where there is none, by
// the slope times the body's diameter and what dents may hide. Infinite where there is no fan near d, or
// nothing is promised there.
double crease_excess(const Shape& shape, const Vec3& d, const SurfacePoint& at, const Jet2& jet) {
  constexpr double kNone = std::numeric_limits<double>::infinity();
  const int edge = edge_of(at);
  if (edge < 0 || shape.joints.none()) return kNone;
  const EdgeLink& link = shape.links[at.patch][edge];
  if (link.collapsed || link.patch < 0) return kNone;
  const bool round = shape.normal_map.cells == 0 && shape.joints.concave == 0 && shape.joint_slack == 0;
  const double radius = round ? shape.patch_curvature.max_radius : shape.normal_map.radius_at(d);
  const bool bent = radius < kFarAway, opening = shape.joints.concave == 0 && shape.joint_slack == 0;
  if (!bent && !opening) return kNone;
  const SurfacePoint q = across(shape.patches, link, at, edge);
  const Jet1 here{jet.s, jet.su, jet.sv}, there = evaluate1(shape.patches[q.patch], q.u, q.v);
  const Normal na = normal_at(shape, here.su, here.sv), nb = normal_at(shape, there.su, there.sv);
  if (!(std::max(na.noise, nb.noise) < kNormalMargin) || !(d.dot(na.n) > 0) || !(d.dot(nb.n) > 0))
    return kNone;
  // The slopes of d . x away from x: along the crease, and into either side.
  const Vec3& along = pins_u(edge) ? jet.sv : jet.su;
  const double chord = std::abs(d.dot(along)) / along.norm() + na.noise + nb.noise +
                       std::max(0.0, inward_slope(here, edge, d)) +
                       std::max(0.0, inward_slope(there, link.edge, d));
  if (!(chord <= 0.5 * kNormalMargin)) return kNone;
  return kFanSafety * rolling_excess(radius, shape.bounding_radius, chord * chord) +
         (bent ? shape.small_kinks.excess(radius, chord) : shape.small_kinks.slack) + link.gap +
         (bent ? 0 : shape.support_excess);
}

// Sets where a support is, its height along d and its normal; the normal's error with it.
Normal set_point(const Shape& shape, const Vec3& d, const SurfacePoint& at, const Vec3& x, const Vec3& su,
                 const Vec3& sv, Support* s) {
  const Normal normal = normal_at(shape, su, sv);
  s->where = at;
  s->point = x;
  s->normal = normal.noise <= kPoleNormal ? normal.n : d;
  s->h = d.dot(x);
  return normal;
}
Normal set_point(const Shape& shape, const Vec3& d, const SurfacePoint& at, Support* s) {
  const Jet1 jet = evaluate1(shape.patches[at.patch], at.u, at.v);
  return set_point(shape, d, at, jet.s, jet.su, jet.sv, s);
}

// No point of the body is higher along d than this, which is not below h, the height of one: h and `excess`,
// or of a sphero-polyhedron less.
double upper_bound(const Shape& shape, const Vec3& d, double h, double excess) {
  const double roundoff = kRoundoff * shape.bounding_radius, upper = h + excess + roundoff;
  const SpheroPolyhedron& core = shape.core;
  if (!core.found()) return upper;
  const double height = d.dot(core.points[core.support(d)]) + core.radius + core.error + roundoff;
  return std::min(upper, std::max(h, height));
}

// Ascent from `at` to a local maximum of d . s; inside of a patch to a slope of `flat`.
Support climb(const Shape& shape, const Vec3& d, SurfacePoint at, double flat = kSlopeTolerance) {
  Support best;
  const double size = shape.bounding_radius;
  const double least_gain = kRoundoff * size;
  Jet2 jet = evaluate2(shape.patches[at.patch], at.u, at.v);
  double f = d.dot(jet.s);
  double slope = 1;
  for (best.iterations = 1; best.iterations < kSupportIterations; ++best.iterations) {
    const Model model(jet, d);
    unsigned closed = 0;  // edges through which the ascent does not continue
    bool moved = false;
    for (int edge; (edge = leaving_edge(at, model, closed)) >= 0;) {
      closed |= 1u << edge;
      const EdgeLink& link = shape.links[at.patch][edge];
      if (link.collapsed || link.patch < 0) continue;
      const SurfacePoint q = across(shape.patches, link, at, edge);
      const Jet1 there = evaluate1(shape.patches[q.patch], q.u, q.v);
      moved = ascends_into(there, q, link.edge, d);
      if (!moved) continue;
      at = q;
      jet = evaluate2(shape.patches[at.patch], at.u, at.v);
      f = d.dot(jet.s);
      break;
    }
    if (moved) continue;
    const Step step = inward_step(model, size, at, !(closed & 3u), !(closed & 12u));
    slope = step.slope;
    if (step.length <= kStepTolerance * size || step.slope <= (closed ? kSlopeTolerance : flat)) {
      best.converged = true;
      break;
    }
    bool gained = false;
    // Cut where it meets an edge, not clamped: a clamped Newton step need not ascend.
    double scale = std::min(share_inside(at.u, step.du), share_inside(at.v, step.dv));
    for (int halving = 0; halving < kStepHalvings; ++halving, scale *= 0.5) {
      SurfacePoint q = at;
      q.u = std::clamp(at.u + scale * step.du, 0.0, 1.0);
      q.v = std::clamp(at.v + scale * step.dv, 0.0, 1.0);
      const Jet2 there = evaluate2(shape.patches[q.patch], q.u, q.v);
      const double f_there = d.dot(there.s);
      // Sufficient ascent (Nocedal & Wright, eq. 3.6a), up to round-off.
      if (f_there < f + kSufficientAscent * scale * (model.gu * step.du + model.gv * step.dv) - least_gain)
        continue;
      gained = f_there > f || halving == 0;
      at = q;
      jet = there;
      f = f_there;
      break;
    }
    if (!gained) {  // no ascent above round-off left
      best.converged = true;
      break;
    }
  }
  best.slope = slope;
  const Normal normal = set_point(shape, d, at, jet.s, jet.su, jet.sv, &best);
  double excess = excess_at(shape, d, at, normal);
  if (excess > kRoundoff * size) excess = std::min(excess, crease_excess(shape, d, at, jet));
  best.upper = upper_bound(shape, d, f, excess);
  return best;
}

double support_slack(const Shape& shape) {
  return kSupportSlack * kRoundoff * shape.bounding_radius;
}

// Over all patches.
void raise_all(const Shape& shape, const Vec3& d, Highest* top) {
  const double slack = support_slack(shape);
  for (size_t p = 0; p < shape.patches.size(); ++p) {
    const PatchBall& ball = shape.balls[p];
    if (d.dot(ball.center) + ball.radius > top->h + slack)
      raise(shape.patches[p], {static_cast<int>(p)}, d, slack, top);
  }
}

// The pieces of patches on which the support along d lies; nullptr where they are not kept: on bodies without
// dents, in directions that the normal map promises something of, and while the body is made.
const SupportCell* cell_of(const Shape& shape, const Vec3& d) {
  if (!shape.dented() || shape.atlas.cells == 0 || shape.normal_map.radius_at(d) < kFarAway) return nullptr;
  return shape.support_cells.at(shape, d);
}

// The highest of all patches, or of those of `cell`, knowing `low`, the height of some surface point and what
// it bounds.
Support search_patches(const Shape& shape, const Vec3& d, const Support& low, const SupportCell* cell) {
  const double slack = support_slack(shape);
  Highest top{low.where, low.h, low.h + slack, 0};
  if (cell)
    for (const PatchPiece& piece : cell->pieces) raise(shape.patches[piece.patch], piece, d, slack, &top);
  else
    raise_all(shape, d, &top);
  Support s;
  const Jet1 jet = evaluate1(shape.patches[top.where.patch], top.where.u, top.where.v);
  set_point(shape, d, top.where, jet.s, jet.su, jet.sv, &s);
  s.upper = std::max(std::min(top.upper, low.upper), s.h);  // of slivers the search is cut short
  s.slope = 0;
  s.iterations = low.iterations + top.boxes;
  s.converged = s.upper - s.h <= 2 * slack;
  return s;
}

// A start if it is a point of the body; nullptr if not, or if its parameters are no numbers.
const SurfacePoint* if_on_body(const Shape& shape, const SurfacePoint* start) {
  return start && lies_on(shape, *start) ? start : nullptr;
}

// From the start, or from the atlas. Bodies of bilinear patches have their support at a corner: nothing to
// climb.
Support begin(const Shape& shape, const Vec3& d, const SurfacePoint* start, double flat = kSlopeTolerance) {
  const SurfacePoint at = start ? *start : shape.atlas.place(d);
  if (!shape.bilinear) return climb(shape, d, at, flat);
  Support s;
  s.where = at;
  s.normal = d;
  s.h = d.dot(evaluate0(shape.patches[at.patch], at.u, at.v));
  s.upper = upper_bound(shape, d, s.h, std::numeric_limits<double>::infinity());
  return s;
}

bool is_certain(const Shape& shape, const Support& s, double enough) {
  return s.converged &&
         s.upper - s.h <= std::max(enough, 2 * kSupportSlack * kRoundoff * shape.bounding_radius);
}

// By the meridian; false where the body has none that is near `enough`, or round-off leaves it open.
bool find_on_meridian(const Shape& shape, const Vec3& d, const SurfacePoint* start, double enough,
                      Support* s) {
  MeridianSupport found;
  if (!shape.meridian.bounds_within(0.5 * enough) ||
      !find_meridian_support(shape.meridian, d, shape.bounding_radius, start, &found))
    return false;
  const Jet1 jet = evaluate1(shape.patches[found.where.patch], found.where.u, found.where.v);
  set_point(shape, d, found.where, jet.s, jet.su, jet.sv, s);
  s->upper = std::max(found.upper, s->h);
  s->slope = 0;
  s->iterations = 1;
  s->converged = true;
  return is_certain(shape, *s, enough);
}

}  // namespace

Support find_support(const Shape& shape, const Vec3& d, const SurfacePoint* start) {
  start = if_on_body(shape, start);
  if (Support s; find_on_meridian(shape, d, start, 0, &s)) return s;
  const Support local = begin(shape, d, start);
  if (is_certain(shape, local, 0) || (shape.dented() && std::isfinite(local.upper))) return local;
  return search_patches(shape, d, local, cell_of(shape, d));
}

Support find_hull_support(const Shape& shape, const Vec3& d, const SurfacePoint* start, double enough,
                          double flat) {
  start = if_on_body(shape, start);
  if (Support s; find_on_meridian(shape, d, start, enough, &s)) return s;
  Support local = begin(shape, d, start, flat);
  if (!is_certain(shape, local, enough) && local.slope > kSlopeTolerance && std::isfinite(local.upper))
    local = climb(shape, d, local.where);
  return is_certain(shape, local, enough) ? local : search_patches(shape, d, local, cell_of(shape, d));
}

Support find_feature_support(const Shape& shape, const Vec3& d, const SurfacePoint* start) {
  return find_hull_support(shape, d, start, kFeatureSupport * shape.bounding_radius);
}

Support core_support(const Shape& shape, const Vec3& d) {
  const SpheroPolyhedron& core = shape.core;
  Support s;
  s.where = {-1, 0, 0};
  s.point = core.points[core.support(d)] + core.radius * d;
  s.normal = d;
  s.h = d.dot(s.point);
  s.upper = s.h + core.error + kRoundoff * shape.bounding_radius;
  s.slope = 0;
  s.iterations = 1;
  s.converged = true;
  return s;
}

Support find_feature_top(const Shape& shape, const Vec3& d, const SurfacePoint* start) {
  const SpheroPolyhedron& core = shape.core;
  const bool known = core.has_lines(!shape.flats.ruling.empty()) &&
                     core.error <= kTopError * kFeatureSupport * shape.bounding_radius;
  return known ? core_support(shape, d) : find_feature_support(shape, d, start);
}

Support search_all_patches(const Shape& shape, const Vec3& d, const SurfacePoint& at) {
  Support low;
  low.where = at;
  low.h = d.dot(evaluate0(shape.patches[at.patch], at.u, at.v));
  low.upper = std::numeric_limits<double>::infinity();
  return search_patches(shape, d, low, nullptr);
}

Support look_at(const Shape& shape, const Vec3& d, const SurfacePoint& at) {
  Support s;
  set_point(shape, d, at, &s);
  s.upper = std::numeric_limits<double>::infinity();
  return s;
}

Support confirm_support(const Shape& shape, const Vec3& d, const SurfacePoint& at, double enough) {
  Support s;
  const Normal normal = set_point(shape, d, at, &s);
  s.upper = upper_bound(shape, d, s.h, excess_at(shape, d, at, normal));
  s.converged = true;
  if (is_certain(shape, s, enough)) return s;
  if (Support found; find_on_meridian(shape, d, &at, enough, &found)) return found;
  return search_patches(shape, d, s, cell_of(shape, d));
}

bool find_rival(const Shape& shape, const Vec3& d, const Support& best, Support* rival) {
  if (!shape.dented() || shape.normal_map.radius_at(d) < kFarAway)
    return false;  // no dent near d: the only point with this normal
  int nodes[4];
  shape.atlas.cell(d, nodes);
  bool found = false;
  for (const int node : nodes) {
    const Support other = climb(shape, d, shape.atlas.where[node]);
    if ((other.point - best.point).norm() <= kSameSupport * shape.bounding_radius) continue;
    if (!found || other.h > rival->h) *rival = other;
    found = true;
  }
  return found;
}

SurfacePoint walk(const Shape& shape, SurfacePoint at, double du, double dv) {
  for (int crossing = 0; crossing < 4; ++crossing) {
    // Fraction of the step at which it meets the first edge.
    double fraction = 1;
    int edge = -1;
    const auto meet = [&](double x, double dx, int low_edge) {
      const double to = dx < 0 ? -x / dx : dx > 0 ? (1 - x) / dx : 2;
      if (to < fraction) {
        fraction = std::max(0.0, to);
        edge = low_edge + (dx > 0);
      }
    };
    meet(at.u, du, 0);
    meet(at.v, dv, 2);
    at.u = std::clamp(at.u + fraction * du, 0.0, 1.0);
    at.v = std::clamp(at.v + fraction * dv, 0.0, 1.0);
    if (edge < 0) return at;
    const EdgeLink& link = shape.links[at.patch][edge];
    if (link.patch < 0 || link.collapsed) return at;
    // The rest of the step, as a tangent vector, in the neighbour's parameters.
    const Jet1 here = evaluate1(shape.patches[at.patch], at.u, at.v);
    const Vec3 rest = (1 - fraction) * (du * here.su + dv * here.sv);
    at = across(shape.patches, link, at, edge);
    const Jet1 there = evaluate1(shape.patches[at.patch], at.u, at.v);
    const double e = there.su.squaredNorm(), f = there.su.dot(there.sv), g = there.sv.squaredNorm();
    const double area2 = e * g - f * f;
    if (!(area2 > 0)) return at;
    const double a = there.su.dot(rest), b = there.sv.dot(rest);
    du = std::clamp((g * a - f * b) / area2, -1.0, 1.0);
    dv = std::clamp((e * b - f * a) / area2, -1.0, 1.0);
  }
  return at;
}

}  // namespace nurbs

// See joint_lanes.h; the formulas are joint_newton.cpp's and certificate.h's.
#include "contact/joint_lanes.h"

#include <algorithm>

#include "body/shape.h"
#include "contact/certificate.h"
#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

using Vec = Triple<Wide>;

NURBS_INLINE Wide norm2(const Vec& v) {
  return dot(v, v);
}
NURBS_INLINE Vec normalized(const Vec& v) {
  return (1.0 / root(norm2(v))) * v;
}

struct Surfaces {
  Vec s, su, sv, suu, suv, svv;
};
struct Sides {
  Surfaces at;                     // lab axes, from A's centre
  Vec normal;                      // outward, unit
  WideMask plain;                  // not next to a pole
  Wide inner, outer, slack, near;  // RollingRadii, lengths of the lab
  Wide met;                        // small kinks, rad
  Wide noise;                      // of the normal, rad
};

// Both tangents, fundamental forms, and the normal's own derivatives.
struct SymmetricLanes {
  Wide a, b, c;  // a b; b c
  NURBS_INLINE Wide det() const { return a * c - b * b; }
  NURBS_INLINE WideMask regular() const { return magnitude(det()) > kSingular * (magnitude(a * c) + b * b); }
  NURBS_INLINE SymmetricLanes inverse() const {
    const Wide r = 1.0 / det();
    return {r * c, -r * b, r * a};
  }
};
NURBS_INLINE SymmetricLanes first_form(const Surfaces& f) {
  return {norm2(f.su), dot(f.su, f.sv), norm2(f.sv)};
}
NURBS_INLINE SymmetricLanes second_form(const Surfaces& f, const Vec& along) {
  return {dot(f.suu, along), dot(f.suv, along), dot(f.svv, along)};
}

// The surfaces at the lanes' points, placed, with the radii that hold there.
NURBS_INLINE Sides look(unsigned open, const Shape* const (&shape)[kWidth], const SurfacePoint (&at)[kWidth],
                        const Wide& scale, const Turn<Wide>& turn, const JetLanes (&jet)[kWidth],
                        bool (&dented)[kWidth]) {
  Wide row[3][8];
  const double* from[kWidth];
  for (int k = 0; k < 3; ++k) {
    for (int l = 0; l < kWidth; ++l) from[l] = reinterpret_cast<const double*>(&jet[l].x + k);
    gather(from, row[k]);
  }
  const auto own = [&](JetLanes::Slot k) { return Vec{row[0][k], row[1][k], row[2][k]}; };
  Sides out;
  const Vec su = own(JetLanes::kSu), sv = own(JetLanes::kSv);
  const Wide lu = norm2(su), lv = norm2(sv);
  constexpr double kLost = kNearPole * kNearPole;  // nearer, round-off counts in the certificate
  out.plain = (lu >= kLost * lv) & (lv >= kLost * lu);
  const Vec area = cross(su, sv), n = normalized(area);
  out.inner = out.outer = out.slack = out.near = out.met = out.noise = Wide{};
  Wide size{};
  for (int l = 0; l < kWidth; ++l) {
    if (!(open >> l & 1)) continue;
    size[l] = shape[l]->bounding_radius;
    const RollingRadii r = radii_at(*shape[l], at[l], nullptr, lane(n, l));
    out.inner[l] = r.inner;
    out.outer[l] = r.outer;
    out.slack[l] = r.slack;
    out.near[l] = r.near;
    out.met[l] = shape[l]->small_kinks.met;
    out.noise[l] = pole_noise(*shape[l], std::min(lu[l], lv[l]));
    dented[l] = dented[l] || (r.slack > kRoundoff * shape[l]->bounding_radius && !(r.near < kFarAway));
  }
  out.plain &= (norm2(area) > lost_area2<Wide>(lu + lv, size)) & (out.noise < kNearPole);
  out.inner *= scale;
  out.outer *= scale;
  out.slack *= scale;
  out.near *= scale;
  const auto placed = [&](const Vec& v) { return scale * (turn * v); };
  out.normal = turn * n;
  out.at = {placed(own(JetLanes::kS)),
            placed(su),
            placed(sv),
            placed(own(JetLanes::kSuu)),
            placed(own(JetLanes::kSuv)),
            placed(own(JetLanes::kSvv))};
  return out;
}

// Excess of h(d) over d . (surface point), |d - n|^2 = least2, but for the normal's noise; of a body with
// this bounding radius.
NURBS_INLINE Wide excess(const Sides& side, const Wide& radius, const Wide& least2, bool any_noise) {
  const Wide chord2 = any_noise ? widened_chord2(least2, side.noise) : least2;
  const Wide chord = root(chord2), rolling = 0.5 * side.outer * chord2, wedge = 2.0 * radius * chord;
  const Wide near = side.near * (0.5 * chord2 + side.met * chord);
  return select((chord2 <= kNormalMargin * kNormalMargin) & (side.near < kFarAway), near,
                smaller(rolling, wedge) + side.slack);
}

struct BracketLanes {
  Wide lower, upper, angle2, unique;
  Vec direction;
  WideMask apart;  // the direction is that of the balls' centres
};

NURBS_INLINE BracketLanes certify(const JointLanes& pairs, const Sides& a, const Sides& b,
                                  const Wide& radius_a, const Wide& radius_b, const Wide& joint_slack,
                                  const Wide& noise, bool any_noise) {
  BracketLanes out;
  const Wide rho_a = smaller(a.inner, pairs.reach), rho_b = smaller(b.inner, pairs.reach);
  const Vec between = b.at.s - a.at.s, core = between + rho_a * a.normal - rho_b * b.normal;
  const Wide distance = root(norm2(core));
  out.apart = (dot(core, a.normal - b.normal) > 0.0) & (distance > kNoDirection * pairs.reach);
  out.direction = (1.0 / distance) * core;
  const Wide chord2_a = norm2(out.direction - a.normal), chord2_b = norm2(out.direction + b.normal);
  out.angle2 = larger(chord2_a, chord2_b);
  out.unique = rho_a + rho_b;
  out.upper = distance - rho_a - rho_b + joint_slack + noise;
  if (any_noise)
    out.upper += ball_beside<Wide>(rho_a, a.noise, root(chord2_a), distance) +
                 ball_beside<Wide>(rho_b, b.noise, root(chord2_b), distance);
  out.lower = dot(out.direction, between) - excess(a, radius_a, chord2_a, any_noise) -
              excess(b, radius_b, chord2_b, any_noise) - noise;
  return out;
}

struct StepLanes {
  Wide au, av, bu, bv;
  SymmetricLanes metric_a;  // inverse
  WideMask regular;         // and short
};

NURBS_INLINE StepLanes newton_step(const Sides& a, const Sides& b, const SymmetricLanes& first,
                                   const SymmetricLanes& bend_a, const SymmetricLanes& bend_b) {
  const Surfaces &fa = a.at, &fb = b.at;
  const Vec g = fa.s - fb.s;
  const Wide f1u = dot(fa.su, g), f1v = dot(fa.sv, g), f2u = dot(fb.su, a.normal), f2v = dot(fb.sv, a.normal);
  // T' = B's tangents on A's.
  const Wide uu = dot(fb.su, fa.su), uv = dot(fb.su, fa.sv), vu = dot(fb.sv, fa.su), vv = dot(fb.sv, fa.sv);
  const SymmetricLanes m11{first.a + dot(fa.suu, g), first.b + dot(fa.suv, g), first.c + dot(fa.svv, g)};
  StepLanes out;
  out.metric_a = first.inverse();
  const SymmetricLanes inverse = m11.inverse(), &i = out.metric_a;
  const Wide pa = uu * i.a + uv * i.b, pb = uu * i.b + uv * i.c, pc = vu * i.a + vv * i.b,
             pd = vu * i.b + vv * i.c;
  const Wide qa = pa * bend_a.a + pb * bend_a.b, qb = pa * bend_a.b + pb * bend_a.c,
             qc = pc * bend_a.a + pd * bend_a.b, qd = pc * bend_a.b + pd * bend_a.c;
  const Wide la = qa * inverse.a + qb * inverse.b, lb = qa * inverse.b + qb * inverse.c,
             lc = qc * inverse.a + qd * inverse.b, ld = qc * inverse.b + qd * inverse.c;
  const Wide sa = bend_b.a - (la * uu + lb * uv), sb = bend_b.b - (la * vu + lb * vv),
             sc = bend_b.b - (lc * uu + ld * uv), sd = bend_b.c - (lc * vu + ld * vv);
  const Wide det = sa * sd - sb * sc;
  const Wide r = -1.0 / det, ru = la * f1u + lb * f1v + f2u, rv = lc * f1u + ld * f1v + f2v;
  out.bu = r * (sd * ru - sb * rv);
  out.bv = r * (sa * rv - sc * ru);
  const Wide tu = uu * out.bu + vu * out.bv - f1u, tv = uv * out.bu + vv * out.bv - f1v;
  out.au = inverse.a * tu + inverse.b * tv;
  out.av = inverse.b * tu + inverse.c * tv;
  const Wide largest =
      larger(larger(magnitude(out.au), magnitude(out.av)), larger(magnitude(out.bu), magnitude(out.bv)));
  out.regular = first.regular() & m11.regular() &
                (magnitude(det) > kSingular * (magnitude(sa * sd) + magnitude(sb * sc))) &
                (largest <= kLargestStep);
  return out;
}

// Whether the tangents change so little in a step that the normal turns linearly.
NURBS_INLINE WideMask turns_linearly(const Surfaces& f, const SymmetricLanes& first, const Wide& du,
                                     const Wide& dv) {
  constexpr double kTrust = 0.5 * kNormalTrust * kNormalTrust;
  const Wide uu = du * du, vv = dv * dv, mixed = norm2(f.suv);
  return (uu * norm2(f.suu) + vv * mixed <= kTrust * first.a) &
         (uu * mixed + vv * norm2(f.svv) <= kTrust * first.c);
}

NURBS_INLINE Vec turned_normal(const Vec& n, const Surfaces& f, const SymmetricLanes& bend,
                               const SymmetricLanes& inverse, const Wide& du, const Wide& dv) {
  const Wide hu = bend.a * du + bend.b * dv, hv = bend.b * du + bend.c * dv;
  return n - (inverse.a * hu + inverse.b * hv) * f.su - (inverse.b * hu + inverse.c * hv) * f.sv;
}

NURBS_INLINE Vec taylor(const Surfaces& f, const Wide& du, const Wide& dv) {
  return f.s + du * f.su + dv * f.sv + (0.5 * du * du) * f.suu + (du * dv) * f.suv + (0.5 * dv * dv) * f.svv;
}

NURBS_INLINE Wide misfit2(const Vec& d, const Vec& g) {
  return norm2(g - dot(d, g) * d);
}

// The lanes' parameters.
struct Parameters {
  Wide au, av, bu, bv;
  NURBS_INLINE WideMask inside() const {
    return (au >= 0.0) & (au <= 1.0) & (av >= 0.0) & (av <= 1.0) & (bu >= 0.0) & (bu <= 1.0) & (bv >= 0.0) &
           (bv <= 1.0);
  }
};

// Closes the bracket of a lane that a dent's allowance keeps open, by the hulls' supports; false where they
// don't.
bool confirm(int l, JointLanes* pairs) {
  const Vec3 d = lane(pairs->normal, l);
  const double lower = d.dot(lane(pairs->offset, l)) -
                       confirmed_heights(pairs->side_a(l), pairs->side_b(l), pairs->tolerance[l]);
  if (lower > pairs->lower[l]) {
    pairs->lower[l] = lower;
    set_lane(triple(d), l, &pairs->direction);
  }
  pairs->gap[l] = std::clamp(pairs->gap[l], pairs->lower[l], pairs->upper[l]);
  return pairs->upper[l] - pairs->lower[l] <= pairs->tolerance[l];
}

}  // namespace

unsigned follow_joints(unsigned asked, double enough, JointLanes* pairs) {
  Wide radius_a{}, radius_b{}, joint_slack{}, small_kinks{};
  bool spread = false;  // of any pole
  Parameters at{};
  for (int l = 0; l < kWidth; ++l) {
    pairs->iterations[l] = 0;
    pairs->dented[l] = false;
    if (!(asked >> l & 1)) {
      pairs->jet_a[l] = pairs->jet_b[l] = JetLanes{};
      continue;
    }
    const Shape &a = *pairs->a[l], &b = *pairs->b[l];
    radius_a[l] = a.bounding_radius;
    radius_b[l] = b.bounding_radius;
    joint_slack[l] = pairs->scale_a[l] * a.joint_slack + pairs->scale_b[l] * b.joint_slack;
    small_kinks[l] = pairs->scale_a[l] * a.small_kinks.slack + pairs->scale_b[l] * b.small_kinks.slack;
    spread |= a.pole_spread > 0 || b.pole_spread > 0;
    at.au[l] = pairs->on_a[l].u;
    at.av[l] = pairs->on_a[l].v;
    at.bu[l] = pairs->on_b[l].u;
    at.bv[l] = pairs->on_b[l].v;
  }
  radius_a *= pairs->scale_a;
  radius_b *= pairs->scale_b;
  const Wide noise = kRoundoff * pairs->reach + small_kinks;

  unsigned open = asked, found = 0, failed = 0;
  for (int k = 0; k < kFollowedIterations && open != 0; ++k) {
    for (int l = 0; l < kWidth; ++l) {
      if (!(open >> l & 1)) continue;
      SurfacePoint &on_a = pairs->on_a[l], &on_b = pairs->on_b[l];
      on_a.u = at.au[l];
      on_a.v = at.av[l];
      on_b.u = at.bu[l];
      on_b.v = at.bv[l];
      evaluate2(pairs->a[l]->patches[on_a.patch], on_a.u, on_a.v, &pairs->jet_a[l]);
      evaluate2(pairs->b[l]->patches[on_b.patch], on_b.u, on_b.v, &pairs->jet_b[l]);
      ++pairs->iterations[l];
      pairs->dented[l] = false;
    }
    const Sides a =
        look(open, pairs->a, pairs->on_a, pairs->scale_a, pairs->turn_a, pairs->jet_a, pairs->dented);
    Sides b = look(open, pairs->b, pairs->on_b, pairs->scale_b, pairs->turn_b, pairs->jet_b, pairs->dented);
    b.at.s = b.at.s + pairs->offset;
    const BracketLanes bracket = certify(*pairs, a, b, radius_a, radius_b, joint_slack, noise, spread);
    const SymmetricLanes first_a = first_form(a.at), first_b = first_form(b.at),
                         bend_a = second_form(a.at, a.normal), bend_b = second_form(b.at, a.normal);
    const StepLanes step = newton_step(a, b, first_a, bend_a, bend_b);
    const Parameters next{at.au + step.au, at.av + step.av, at.bu + step.bu, at.bv + step.bv};
    const Wide tolerance = pairs->tolerance, width = bracket.upper - bracket.lower;
    const WideMask usual = mask_of(open) & step.regular & a.plain & b.plain & bracket.apart &
                           (bracket.lower <= enough) & next.inside();
    const WideMask close =
        (width <= tolerance) &
        (bracket.angle2 * pairs->size <= larger<Wide>(tolerance, kRoundoff * pairs->size)) &
        ((pairs->reach <= kUnequalSizes * pairs->size) |
         (turn_error(bracket.angle2, pairs->reach) <= tolerance));

    // The step spent on a second-order update of points and normal.
    const Vec of_a = turned_normal(a.normal, a.at, bend_a, step.metric_a, step.au, step.av),
              of_b = turned_normal(Vec{} - b.normal, b.at, bend_b, first_b.inverse(), step.bu, step.bv);
    const Wide turn_a = norm2(of_a - a.normal) + kNoTurn, turn_b = norm2(of_b + b.normal) + kNoTurn;
    const Vec normal = normalized(turn_b * of_a + turn_a * of_b);
    const Vec at_a = taylor(a.at, step.au, step.av), at_b = taylor(b.at, step.bu, step.bv);
    const Wide roundoff = kRoundoff * pairs->reach;
    const WideMask nearer =
        misfit2(normal, at_b - at_a) <= kNearer2 * misfit2(a.normal, b.at.s - a.at.s) + roundoff * roundoff;
    const WideMask refined = usual & nearer & first_b.regular() &
                             turns_linearly(a.at, first_a, step.au, step.av) &
                             turns_linearly(b.at, first_b, step.bu, step.bv);
    const Wide gap = dot(normal, at_b - at_a);
    unsigned dented = 0;
    for (int l = 0; l < kWidth; ++l) dented |= static_cast<unsigned>(pairs->dented[l]) << l;
    // Closed but for what a dent may hide.
    const WideMask settled = mask_of(dented) & dents_count<Wide>(a.slack + b.slack, tolerance) & ~close &
                             (bracket.angle2 * pairs->size <= tolerance) &
                             (bracket.upper - gap <= 0.5 * tolerance);
    const WideMask done = refined & (close | settled);
    const auto keep = [&done](const auto& now, auto* kept) { *kept = select(done, now, *kept); };
    keep(normal, &pairs->normal);
    keep(at_a, &pairs->point_a);
    keep(at_b, &pairs->point_b);
    keep(bracket.direction, &pairs->direction);
    keep(smaller(larger(gap, bracket.lower), bracket.upper), &pairs->gap);
    keep(bracket.lower, &pairs->lower);
    keep(bracket.upper, &pairs->upper);
    keep(bracket.unique, &pairs->unique);
    const unsigned now = bits_of(done), unproven = bits_of(done & settled);
    for (int l = 0; l < kWidth; ++l) {
      if (!(now >> l & 1)) continue;
      pairs->base_a[l] = pairs->on_a[l];
      pairs->base_b[l] = pairs->on_b[l];
      pairs->on_a[l].u = next.au[l];
      pairs->on_a[l].v = next.av[l];
      pairs->on_b[l].u = next.bu[l];
      pairs->on_b[l].v = next.bv[l];
      if ((unproven >> l & 1) && !confirm(l, pairs)) failed |= 1u << l;
    }
    found |= now;
    open = bits_of(usual & ~close & ~done);
    at = next;
  }
  return found & ~failed;
}

}  // namespace nurbs

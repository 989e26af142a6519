// Bodies that are ellipsoids (body/ellipsoid.h) in closed form: Newton on p(d) without a surface.
//
// With K = root R', R from the shape's axes into the lab's, an ellipsoid's support function is h(d) = |K d|,
// met at x = K' K d / h, and its second derivative over tangents t, s of the sphere of directions is
//     (K t . K s - (x . t)(x . s)) / h.
// p(d) = h_A(d) + h_B(d) - d . offset has the gradient x_A + x_B - offset across d and the Hessian of both
// less p; it is one 2 x 2 system a step. At any d
//     lower = -p(d) <= gap,
// and with y = x - d rho, rho = l^2 / h, l the least semi-axis, the ball of radius rho about y touches at x
// and lies in the body: for w from x with |w|^2 + 2 rho d . w <= 0, and M the matrix of the ellipsoid (M x =
// d / h, x' M x = 1),  (x + w)' M (x + w) = 1 + 2 d . w / h + w' M w <= 1 + |w|^2 (1 / l^2 - 1 / (rho h))
// = 1.  Hence
//     gap <= |b' - a'| - rho_A - rho_B,
// a' and b' the balls' centres: the certificate of certificate.h with normals that are d itself. Where the
// overlap is below rho_A + rho_B both bounds meet at the minimum, which is therefore the only one. That the
// bodies are ellipsoids up to `error` widens both.
#pragma once

#include "contact/pair_memory.h"
#include "nurbs/tolerances.h"
#include "nurbs/wide.h"

namespace nurbs {

// What such a pair remembers, in place of a local model, as plain doubles.
template <class Real>
struct EllipsoidPairOf {
  Triple<Real> direction;     // unit d, lab, of the last solve ...
  Triple<Real> change;        // ... and what it was less the one before
  Real root_a[6], root_b[6];  // Ellipsoid::root, xx yy zz xy xz yz, lengths of the lab; zeros: A is a plane
  Real least2_a, least2_b;    // squares of the least semi-axes
  Real error;                 // of both bodies, relative
};
using EllipsoidPair = EllipsoidPairOf<double>;
constexpr int kEllipsoidPairSize = 21;  // doubles
constexpr int kEllipsoidMotion = 6;     // of them, direction and change, which every step renews
static_assert(sizeof(EllipsoidPair) == kEllipsoidPairSize * sizeof(double));
static_assert(kEllipsoidPairSize < kLocalModelSize, "in the place of the model's halves");
constexpr double kEllipsoidPair = -2;  // LocalModel::unique of a memory that holds one

// K by rows; the square of the least semi-axis.
template <class Real>
struct PlacedEllipsoidOf {
  Triple<Real> row[3];
  Real least2;
};

template <class Real>
NURBS_INLINE PlacedEllipsoidOf<Real> place_ellipsoid(const Real (&root)[6], const Real& least2,
                                                     const Turn<Real>& turn) {
  const auto& r = turn.row;
  const Triple<Real> x{r[0].x, r[1].x, r[2].x}, y{r[0].y, r[1].y, r[2].y}, z{r[0].z, r[1].z, r[2].z};
  return {{root[0] * x + root[3] * y + root[4] * z, root[3] * x + root[1] * y + root[5] * z,
           root[4] * x + root[5] * y + root[2] * z},
          least2};
}

// The support of one of them along d, and how it changes along t and s.
template <class Real>
struct EllipsoidSideOf {
  Triple<Real> k, kt, ks;  // K of d, t, s
  Real over;               // 1 / h; anything for a plane, whose K is zero
  Real xt, xs;             // of the support point
};

// Both supports along d, with the second-order system there.
template <class Real>
struct EllipsoidStepOf {
  EllipsoidSideOf<Real> a, b;
  Real p;                          // p(d)
  Triple<Real> t, s;               // make a frame with d, in which are ...
  Real slope_t, slope_s;           // ... p's gradient,
  Real bend_tt, bend_ts, bend_ss;  // its Hessian on the sphere,
  Real x, y;                       // and Newton's step
  Real third;                      // about how large p's third derivative is, at most
  Real soft;                       // 1 / m or more, m the Hessian's least eigenvalue
  Mask<Real> minimum;              // the Hessian is positive definite
};

template <class Real>
NURBS_INLINE Triple<Real> image(const PlacedEllipsoidOf<Real>& e, const Triple<Real>& v) {
  return {dot(e.row[0], v), dot(e.row[1], v), dot(e.row[2], v)};
}

// `free` is 1, or 0 where d is given (A a plane).
template <class Real>
NURBS_INLINE EllipsoidStepOf<Real> newton_step(const PlacedEllipsoidOf<Real>& a,
                                               const PlacedEllipsoidOf<Real>& b, const Triple<Real>& offset,
                                               const Real& free, const Triple<Real>& d) {
  EllipsoidStepOf<Real> out;
  // An orthonormal frame (Duff et al. 2017).
  const Real one = all<Real>(1), side = select(d.z < 0.0, -one, one);
  const Real f = -1.0 / (side + d.z), g = d.x * d.y * f;
  out.t = {one + side * d.x * d.x * f, side * g, -side * d.x};
  out.s = {g, side + d.y * d.y * f, -d.y};
  out.p = -dot(offset, d);
  out.slope_t = -dot(offset, out.t);
  out.slope_s = -dot(offset, out.s);
  out.bend_tt = out.bend_ts = out.bend_ss = out.third = Real{};
  const auto add = [&](const PlacedEllipsoidOf<Real>& e, EllipsoidSideOf<Real>& side_of) {
    const Triple<Real> k = image(e, d), kt = image(e, out.t), ks = image(e, out.s);
    const Real h = root(dot(k, k)), over = 1.0 / select(h > 0.0, h, one);
    const Real xt = over * dot(k, kt), xs = over * dot(k, ks);
    out.p += h;
    out.slope_t += xt;
    out.slope_s += xs;
    const Real tt = over * (dot(kt, kt) - xt * xt), ss = over * (dot(ks, ks) - xs * xs);
    out.bend_tt += tt;
    out.bend_ts += over * (dot(kt, ks) - xt * xs);
    out.bend_ss += ss;
    out.third += 3.0 * over * (magnitude(xt) + magnitude(xs)) * (tt + ss);
    side_of = {k, kt, ks, over, xt, xs};
  };
  add(a, out.a);
  add(b, out.b);
  out.third += 3.0 * (magnitude(out.slope_t) + magnitude(out.slope_s));  // of the chart in which the step is
  out.bend_tt -= out.p;
  out.bend_ss -= out.p;
  const Real det = out.bend_tt * out.bend_ss - out.bend_ts * out.bend_ts;
  out.minimum = ((det > 0.0) & (out.bend_tt > 0.0)) | (free == 0.0);
  const Real r = free / select(det != 0.0, det, one);
  out.x = r * (out.bend_ts * out.slope_s - out.bend_ss * out.slope_t);
  out.y = r * (out.bend_ts * out.slope_t - out.bend_tt * out.slope_s);
  out.soft = (out.bend_tt + out.bend_ss) * r;
  return out;
}

// The direction after a step.
template <class Real>
NURBS_INLINE Triple<Real> turned(const Triple<Real>& d, const Triple<Real>& by) {
  const Triple<Real> to = d + by;
  return (1.0 / root(dot(to, to))) * to;
}

// Points and bounds, without the bodies' error and round-off.
template <class Real>
struct EllipsoidContactOf {
  Triple<Real> point_a, point_b;  // from A's centre, lab
  Real gap, lower;
  Real beyond;   // what the upper bound is above the lower; kFarAway without one
  Real across2;  // square of p's gradient where the bounds were taken
};

// Of a pair whose supports along some d are `apart` further than the balls' centres, at the square of p's
// gradient.
template <class Real>
NURBS_INLINE Real beyond(const Real& apart, const Real& across2, const Real& free) {
  const Real twice = root(apart * apart + across2) + magnitude(apart);
  return select((apart > 0.0) | (free == 0.0), across2 / select(twice > 0.0, twice, all<Real>(1)),
                all<Real>(kFarAway));
}

template <class Real>
NURBS_INLINE EllipsoidContactOf<Real> look_along(const PlacedEllipsoidOf<Real>& a,
                                                 const PlacedEllipsoidOf<Real>& b, const Triple<Real>& offset,
                                                 const Real& free, const Triple<Real>& d) {
  EllipsoidContactOf<Real> c;
  Real rho{};
  const auto support = [&](const PlacedEllipsoidOf<Real>& e) {
    const Triple<Real> k = image(e, d);
    const Real h = root(dot(k, k)), over = 1.0 / select(h > 0.0, h, all<Real>(1));
    rho += e.least2 * over;
    return over * (k.x * e.row[0] + k.y * e.row[1] + k.z * e.row[2]);
  };
  c.point_a = support(a);
  c.point_b = offset - support(b);
  const Triple<Real> between = c.point_b - c.point_a;
  c.gap = c.lower = dot(d, between);
  const Triple<Real> across = between - c.gap * d;
  c.across2 = free * dot(across, across);
  c.beyond = beyond<Real>(rho + c.gap, c.across2, free);
  c.point_a =
      select<Real>(free == 0.0, c.point_b - c.gap * d, c.point_a);  // of a plane, what B's point meets
  return c;
}

// The contact after Newton's step by Taylor's series, with the bounds from before it: points to the first
// order in the step, the gap to the second.
template <class Real>
NURBS_INLINE EllipsoidContactOf<Real> after(const EllipsoidStepOf<Real>& s, const PlacedEllipsoidOf<Real>& a,
                                            const PlacedEllipsoidOf<Real>& b, const Triple<Real>& offset,
                                            const Real& free, const Triple<Real>& d) {
  EllipsoidContactOf<Real> c;
  const auto support = [&s](const PlacedEllipsoidOf<Real>& e, const EllipsoidSideOf<Real>& at) {
    const Real along = 1.0 - at.over * (at.xt * s.x + at.xs * s.y);
    const Triple<Real> k = at.over * (along * at.k + s.x * at.kt + s.y * at.ks);
    return k.x * e.row[0] + k.y * e.row[1] + k.z * e.row[2];
  };
  c.point_a = support(a, s.a);
  c.point_b = offset - support(b, s.b);
  c.across2 = free * (s.slope_t * s.slope_t + s.slope_s * s.slope_s);
  c.lower = -s.p;
  c.beyond = beyond<Real>(a.least2 * s.a.over + b.least2 * s.b.over - s.p, c.across2, free);
  c.gap = c.lower + smaller(-0.5 * (s.slope_t * s.x + s.slope_s * s.y), c.beyond);
  c.point_a = select<Real>(free == 0.0, c.point_b - c.gap * d, c.point_a);
  return c;
}

// Whether that is good enough for the force: the overlap's error below half the tolerance times the overlap,
// and the normal's, `tilt2` its square, below the tolerance; no better than round-off allows.
template <class Real>
NURBS_INLINE Mask<Real> good_enough(const EllipsoidContactOf<Real>& c, const Real& tilt2, double tolerance,
                                    const Real& size, const Real& noise) {
  return (c.beyond <= 0.5 * tolerance * larger(magnitude(c.gap), kForceDepth * size) + noise) &
         ((tilt2 <= tolerance * tolerance) | (c.across2 <= noise * noise));
}

// Round-off of a gap: of supports and of the offset.
template <class Real>
NURBS_INLINE Real gap_roundoff(const Real& radius_a, const Real& radius_b, const Triple<Real>& offset) {
  return kRoundoff * (radius_a + radius_b + magnitude(offset.x) + magnitude(offset.y) + magnitude(offset.z));
}

// A contact that goes on.
template <class Real>
struct FollowedOf {
  Triple<Real> d;
  EllipsoidContactOf<Real> contact;
  Mask<Real> found;
};

// Newton from where d would be, had it moved on as it last did; one step is usual. By Newton's method a
// step's direction is then wrong by third soft step^2 / 2, to leading order, where the third derivative of h
// is at most 3 |x . t| t' h'' t / h along a tangent t. Only where `asked`; a lane that is good enough stays,
// whatever the others need.
template <class Real>
NURBS_INLINE FollowedOf<Real> follow(const EllipsoidPairOf<Real>& pair, const Turn<Real>& turn_a,
                                     const Turn<Real>& turn_b, const Triple<Real>& offset, const Real& free,
                                     double tolerance, const Real& size, const Real& noise,
                                     const Mask<Real>& asked) {
  const PlacedEllipsoidOf<Real> a = place_ellipsoid(pair.root_a, pair.least2_a, turn_a),
                                b = place_ellipsoid(pair.root_b, pair.least2_b, turn_b);
  FollowedOf<Real> out{};
  out.d = turned(pair.direction, free * pair.change);
  for (int k = 0; k < kEllipsoidSteps; ++k) {
    const Mask<Real> open = asked & !out.found;
    if (none_of(open)) break;
    const EllipsoidStepOf<Real> s = newton_step(a, b, offset, free, out.d);
    const EllipsoidContactOf<Real> c = after(s, a, b, offset, free, out.d);
    const Triple<Real> d = turned(out.d, s.x * s.t + s.y * s.s);
    const Real step2 = s.x * s.x + s.y * s.y, tilt = 0.5 * s.third * s.soft * step2;
    EllipsoidContactOf<Real>& kept = out.contact;
    kept.point_a = select<Real>(open, c.point_a, kept.point_a);
    kept.point_b = select<Real>(open, c.point_b, kept.point_b);
    kept.gap = select(open, c.gap, kept.gap);
    kept.lower = select(open, c.lower, kept.lower);
    out.d = select<Real>(open, d, out.d);
    out.found = out.found | (open & s.minimum & (step2 <= kEllipsoidNear * kEllipsoidNear) &
                             good_enough<Real>(c, tilt * tilt, tolerance, size, noise));
  }
  return out;
}

// Gap, normal and points of two such bodies, 0.17 us warm; false, and nothing done but what is remembered
// of such a pair dropped, where they are none as far as the tolerance can tell, overlap by more than the
// balls above, or Newton fails. Else the pair is proven apart, or the result converged; an EllipsoidPair is
// then left in `memory`, and no surface points.
bool solve_ellipsoids(const Particle& a, const Particle& b, const ContactSettings& settings,
                      PairMemory& memory, ContactResult* r);

// The same of a body whose centre is `height` above a plane with unit `normal`; points as
// find_plane_contact's.
bool solve_ellipsoid_on_plane(const Particle& particle, double height, const Vec3& normal,
                              const ContactSettings& settings, PairMemory& memory, ContactResult* r);

}  // namespace nurbs

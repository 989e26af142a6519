// Bounds of a cell's second and third order forms, once position and derivatives are known to first order:
// the second half of an enclosure (enclosure.h).
#pragma once

#include <array>
#include <cmath>
#include <limits>

#include "body/affine_form.h"
#include "nurbs/tolerances.h"

namespace nurbs::cells {

template <class Real>
NURBS_INLINE Real norm2(const Real& x, const Real& y) {  // lengths here are far from the range's ends
  return root(Real(x * x + y * y));
}
template <class Real>
NURBS_INLINE Real length_of(const Triple<Real>& v) {
  return root(dot(v, v));
}
template <class Real>
NURBS_INLINE Triple<Real> unit(const Triple<Real>& v) {
  return Real(1.0 / length_of(v)) * v;
}
// A unit vector at right angles to a unit one.
template <class Real>
NURBS_INLINE Triple<Real> square_to(const Triple<Real>& n) {
  const Mask<Real> upright = n.x * n.x + n.y * n.y < kSingularMetric * (n.z * n.z);
  return unit(select<Real>(upright, {Real{}, -n.z, n.y}, {-n.y, n.x, Real{}}));
}

// Symmetric 2 x 2.
template <class Real>
struct FormMatrix {
  Affine<Real> a, b, c;
  Affine<Real> det() const { return a * c - square(b); }
};

template <class Real>
struct Range {
  Real low, high;
};

// Of the eigenvalues, over the cell: each entry's linear part is that of one matrix, whose norm it is.
template <class Real>
Range<Real> eigenvalues(const FormMatrix<Real>& m) {
  const auto norm = [](const Real& a, const Real& b, const Real& c) -> Real {
    return magnitude(Real(0.5 * (a + c))) + norm2<Real>(0.5 * (a - c), b);
  };
  const Real mean = 0.5 * (m.a.c + m.c.c), split = norm2<Real>(0.5 * (m.a.c - m.c.c), m.b.c);
  const Real change = norm(m.a.a, m.b.a, m.c.a) + norm(m.a.b, m.b.b, m.c.b) +
                      root(Real(m.a.r * m.a.r + 2.0 * m.b.r * m.b.r + m.c.r * m.c.r));
  // Gershgorin's circles see that a ruled direction is flat however much the other one varies.
  const Real circles = smaller(m.c.low(), m.a.low()) - m.b.most();
  return {larger<Real>(circles, mean - split - change), mean + split + change};
}

template <class Real>
struct Stretches {
  Triple<Real> along;
  Real most, least;
  Mask<Real> found;
};

// In a basis that is principal in the middle, so that the remainders of entries that differ much do not mix:
// jt and `w` are the tangents and W in that of `axes`; 2 |w12 x y| <= |w12| (k x^2 + y^2 / k).
template <class Real>
Stretches<Real> stretch_of(const Affine<Real> (&jt)[2][2], const FormMatrix<Real>& form,
                           const Affine<Real>& factor, const FormMatrix<Real>& w,
                           const Triple<Real> (&axes)[3]) {
  // Half the angle of (w11 - w22, 2 w12), from its cosine.
  const Real zero{}, difference = w.a.c - w.c.c, across = 2.0 * w.b.c, size = norm2(difference, across);
  const Mask<Real> sized = size > 0.0, turned = across < 0.0;
  const Real cosine = select(sized, Real(difference / size), all<Real>(1));
  const Real x = root(larger<Real>(0.5 * (1.0 + cosine), zero)),
             other = root(larger<Real>(0.5 * (1.0 - cosine), zero)), y = select(turned, Real(-other), other);
  const Affine<Real> t[2][2] = {
      {scaled(x, jt[0][0]) + scaled(y, jt[1][0]), scaled(x, jt[0][1]) + scaled(y, jt[1][1])},
      {scaled(x, jt[1][0]) - scaled(y, jt[0][0]), scaled(x, jt[1][1]) - scaled(y, jt[0][1])}};
  const auto entry = [&](int k, int l) {
    return factor * ((form.c * t[k][0] - form.b * t[k][1]) * t[l][0] +
                     (form.a * t[k][1] - form.b * t[k][0]) * t[l][1]);
  };
  const Affine<Real> most = entry(0, 0), mixed = entry(0, 1), least = entry(1, 1);
  const Real k = root(Real(most.c / least.c));
  Stretches<Real> s;
  s.found = (most.c > 0.0) & (least.c > 0.0);
  s.along = x * axes[0] + y * axes[1];
  s.most = larger<Real>(most.low() - k * mixed.most(), zero);
  s.least = larger<Real>(smaller<Real>(least.low() - mixed.most() / k, s.most), zero);
  return s;
}

// Curvatures that need not be positive: D / |N| in a basis that is orthonormal in the middle. Its first
// vector along u or along v: either may be a ruling. NaN where there is no such basis.
template <class Real>
Range<Real> any_curvature(const AffineVector<Real>& ju, const AffineVector<Real>& jv,
                          const FormMatrix<Real>& d, const Range<Real>& length) {
  Real least = all<Real>(-std::numeric_limits<double>::infinity()),
       most = all<Real>(std::numeric_limits<double>::infinity());
  const Real none = all<Real>(std::numeric_limits<double>::quiet_NaN());
  for (const bool swapped : {false, true}) {
    const AffineVector<Real>&first = swapped ? jv : ju, &other = swapped ? ju : jv;
    const Triple<Real> a = first.center(), b = other.center();
    const Real l11 = length_of(a), l21 = dot(a, b) / l11, l22 = length_of(cross(a, b)) / l11;
    const Real b11 = 1.0 / l11, b22 = 1.0 / l22, b12 = -l21 / (l11 * l22);
    const Affine<Real>&e = swapped ? d.c : d.a, &g = swapped ? d.a : d.c;
    const FormMatrix<Real> bend{
        scaled<Real>(b11 * b11, e), scaled<Real>(b11 * b12, e) + scaled<Real>(b11 * b22, d.b),
        scaled<Real>(b12 * b12, e) + scaled<Real>(2.0 * b12 * b22, d.b) + scaled<Real>(b22 * b22, g)};
    const AffineVector<Real> t = scaled(b11, first), s = scaled(b12, first) + scaled(b22, other);
    const FormMatrix<Real> metric{dot(t, t), dot(t, s), dot(s, s)};
    const Range<Real> k = eigenvalues(bend), stretch = eigenvalues(metric);
    const Mask<Real> basis = (l11 > 0.0) & (l22 > 0.0), held = stretch.low > 0.0, negative = k.low < 0.0;
    const Real low = select(negative, Real(k.low / (stretch.low * length.low)),
                            Real(k.low / (stretch.high * length.high)));
    const Real high = larger<Real>(k.high, Real{}) / (stretch.low * length.low);
    least = select(basis, select(held, larger(low, least), least), none);
    most = select(basis, select(held, smaller(high, most), most), none);
  }
  return {least, most};
}

// Equal angles of half a turn.
inline const std::array<Vec2, kCubicAngles>& half_circle() {
  static const auto circle = [] {
    std::array<Vec2, kCubicAngles> at;
    for (int k = 0; k < kCubicAngles; ++k)
      at[k] = {std::cos(M_PI * k / kCubicAngles), std::sin(M_PI * k / kCubicAngles)};
    return at;
  }();
  return circle;
}

// The largest value of a cubic form on the unit circle; coefficients of x^3, x^2 y, x y^2, y^3 over
// binomials.
template <class Real>
Real largest_cubic(const Real& c0, const Real& c1, const Real& c2, const Real& c3) {
  // A trigonometric polynomial of degree 3 is at most 1 / cos(3 pi / points) times its largest value at that
  // many equal angles (Ehlich & Zeller 1964); an odd one needs half of them.
  Real most{};
  for (const Vec2& q : half_circle()) {
    const double x = q[0], y = q[1];
    const Real value = (x * x * x) * c0 + (3 * x * x * y) * c1 + (3 * x * y * y) * c2 + (y * y * y) * c3;
    most = larger(magnitude(value), most);
  }
  return most;
}

// A surface's derivatives in the middle of a cell.
template <class Real>
struct Middle {
  Triple<Real> u, v, uu, uv, vv, uuu, uuv, uvv, vvv;
};

// The largest third-order form C(t, t, t) = 3 t . x_ij p_i p_j + n . x_ijk p_i p_j p_k at a point, t unit, p
// = D^-1 J' t.
template <class Real>
Real rate_at(const Middle<Real>& j) {
  const Triple<Real> n = unit(cross(j.u, j.v)), first = square_to(n), second = cross(n, first);
  const Real e = -dot(n, j.uu), f = -dot(n, j.uv), g = -dot(n, j.vv), det = e * g - f * f;
  const Real t0 = dot(n, j.uuu), t1 = dot(n, j.uuv), t2 = dot(n, j.uvv), t3 = dot(n, j.vvv);
  const Triple<Real> along_u = Real(1.0 / det) * (g * j.u - f * j.v),
                     along_v = Real(1.0 / det) * (e * j.v - f * j.u);
  const Real u0 = dot(first, along_u), u1 = dot(second, along_u), v0 = dot(first, along_v),
             v1 = dot(second, along_v);
  const Real uu0 = dot(first, j.uu), uu1 = dot(second, j.uu), uv0 = dot(first, j.uv), uv1 = dot(second, j.uv),
             vv0 = dot(first, j.vv), vv1 = dot(second, j.vv);
  Real most{};
  for (const Vec2& t : half_circle()) {
    const double x = t[0], y = t[1];
    const Real p = x * u0 + y * u1, q = x * v0 + y * v1;
    const Real bend =
        p * p * (x * uu0 + y * uu1) + 2.0 * p * q * (x * uv0 + y * uv1) + q * q * (x * vv0 + y * vv1);
    const Real size =
        magnitude(Real(3.0 * bend + p * (p * (p * t0 + 3.0 * q * t1) + 3.0 * q * q * t2) + q * q * q * t3));
    most = larger(size, most);
  }
  return most;
}

}  // namespace nurbs::cells

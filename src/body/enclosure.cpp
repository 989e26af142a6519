// Cells of a patch and what holds all over them; the formulas are derived in enclosure.h.
#include "body/enclosure.h"

#include <array>
#include <limits>

#include "body/affine_form.h"
#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kTiny = std::numeric_limits<double>::min();

// Numbers of one cell, or of kWidth side by side.
template <class Real>
constexpr int kLanes = static_cast<int>(sizeof(Real) / sizeof(double));
NURBS_INLINE double get(double x, int) {
  return x;
}
NURBS_INLINE double get(const Wide& x, int lane) {
  return x[lane];
}
NURBS_INLINE void put(double value, int, double* x) {
  *x = value;
}
NURBS_INLINE void put(double value, int lane, Wide* x) {
  (*x)[lane] = value;
}
template <class Real>
NURBS_INLINE void put(const Vec3& value, int lane, Triple<Real>* x) {
  put(value[0], lane, &x->x);
  put(value[1], lane, &x->y);
  put(value[2], lane, &x->z);
}
template <class Real>
NURBS_INLINE void put(const Mat3& value, int lane, Turn<Real>* x) {
  for (int k = 0; k < 3; ++k) put(Vec3(value.row(k)), lane, &x->row[k]);
}

// Coordinates of a vector and a weight; side by side in one register, as GCC 12 takes them to be.
template <class Real>
struct Point {
  alignas(4 * sizeof(double)) alignas(Real) Real at[4];
};
// A net of at most kMaxDegree + 1 rows, v fastest.
template <class Real>
struct Net {
  int m = 0, n = 0;  // degrees
  Point<Real> c[(kMaxDegree + 1) * (kMaxDegree + 1)];
  Point<Real>& at(int i, int j) { return c[i * (n + 1) + j]; }
  const Point<Real>& at(int i, int j) const { return c[i * (n + 1) + j]; }
};
// Those coordinates that a net has: a patch that is not rational has no weights.
struct Coordinates {
  int first, end;
};

template <class Real>
void differ_u(const Net<Real>& f, Coordinates which, Net<Real>* d) {
  d->m = std::max(f.m - 1, 0);
  d->n = f.n;
  for (int i = 0; i <= d->m; ++i)
    for (int j = 0; j <= d->n; ++j)
      for (int k = which.first; k < which.end; ++k)
        d->at(i, j).at[k] = f.m > 0 ? Real(double(f.m) * (f.at(i + 1, j).at[k] - f.at(i, j).at[k])) : Real{};
}
template <class Real>
void differ_v(const Net<Real>& f, Coordinates which, Net<Real>* d) {
  d->m = f.m;
  d->n = std::max(f.n - 1, 0);
  for (int i = 0; i <= d->m; ++i)
    for (int j = 0; j <= d->n; ++j)
      for (int k = which.first; k < which.end; ++k)
        d->at(i, j).at[k] = f.n > 0 ? Real(double(f.n) * (f.at(i, j + 1).at[k] - f.at(i, j).at[k])) : Real{};
}

// A function and its derivatives up to the third order: vector and weight.
enum Order { k0, kU, kV, kUU, kUV, kVV, kUUU, kUUV, kUVV, kVVV, kOrders };
template <class Real>
struct Hull {
  AffineVector<Real> x;
  Affine<Real> w;
};
template <class Real>
using Hulls = std::array<Hull<Real>, kOrders>;

// The plane through the net's corners on the average, and how far the other coefficients are from it: a
// linear function is its own net at equally spaced parameters.
template <class Real>
Affine<Real> plane_of(const Net<Real>& f, int k, const Real& noise) {
  const Real &p = f.at(0, 0).at[k], &q = f.at(0, f.n).at[k], &r = f.at(f.m, 0).at[k],
             &s = f.at(f.m, f.n).at[k];
  Real c = 0.25 * (p + q + r + s);
  const Real a = 0.25 * (r + s - p - q), b = 0.25 * (q + s - p - r);
  const Real step_a = f.m > 0 ? Real((2.0 / f.m) * a) : Real{},
             step_b = f.n > 0 ? Real((2.0 / f.n) * b) : Real{};
  Real row = c;
  if (f.m > 0) row = row - a;
  if (f.n > 0) row = row - b;
  Real low = p - row, high = low;
  for (int i = 0; i <= f.m; ++i, row = row + step_a) {
    Real plane = row;
    for (int j = 0; j <= f.n; ++j, plane = plane + step_b) {
      const Real off = f.at(i, j).at[k] - plane;
      low = smaller(off, low);
      high = larger(off, high);
    }
  }
  return {c + 0.5 * (low + high), a, b, 0.5 * (high - low) + noise};
}
template <class Real>
void hull_of(const Net<Real>& f, Coordinates which, const Point<Real>& noise, double factor,
             Hull<Real>* hull) {
  Affine<Real>* const to[] = {&hull->x.x, &hull->x.y, &hull->x.z, &hull->w};
  for (int k = which.first; k < which.end; ++k) *to[k] = plane_of<Real>(f, k, factor * noise.at[k]);
}

// `noise`: bound of the round-off of a coefficient, which each difference at most doubles before its factor.
template <class Real>
void hulls_of(const Net<Real>& f, Coordinates which, const Point<Real>& noise, bool third, Hulls<Real>* h) {
  Net<Real> u, v, w;
  const double m = 2 * f.m, n = 2 * f.n;
  hull_of(f, which, noise, 1, &(*h)[k0]);
  differ_u(f, which, &u);
  hull_of(u, which, noise, m, &(*h)[kU]);
  differ_v(u, which, &v);
  hull_of(v, which, noise, m * n, &(*h)[kUV]);
  if (third) {
    differ_v(v, which, &w);
    hull_of(w, which, noise, m * n * n, &(*h)[kUVV]);
    differ_u(v, which, &w);
    hull_of(w, which, noise, m * m * n, &(*h)[kUUV]);
  }
  differ_u(u, which, &w);
  hull_of(w, which, noise, m * m, &(*h)[kUU]);
  if (third) {
    differ_u(w, which, &v);
    hull_of(v, which, noise, m * m * m, &(*h)[kUUU]);
  }
  differ_v(f, which, &v);
  hull_of(v, which, noise, n, &(*h)[kV]);
  differ_v(v, which, &w);
  hull_of(w, which, noise, n * n, &(*h)[kVV]);
  if (third) {
    differ_v(w, which, &v);
    hull_of(v, which, noise, n * n * n, &(*h)[kVVV]);
  }
}

template <class Real>
using Derivatives = std::array<AffineVector<Real>, kOrders>;

// Of the quotient x / w by Leibniz' rule; where w may vanish it says nothing. `rational`: else w is 1.
template <class Real>
void divide(const Hulls<Real>& h, bool rational, bool third, Derivatives<Real>* y) {
  if (!rational) {
    for (int k = 0; k < (third ? kOrders : kUUU); ++k) (*y)[k] = h[k].x;
    return;
  }
  const auto w = [&](Order k) -> const Affine<Real>& { return h[k].w; };
  const Affine<Real> one = inverse(w(k0));
  Derivatives<Real>& d = *y;
  d[k0] = one * h[k0].x;
  d[kU] = one * (h[kU].x - w(kU) * d[k0]);
  d[kV] = one * (h[kV].x - w(kV) * d[k0]);
  d[kUU] = one * (h[kUU].x - 2.0 * (w(kU) * d[kU]) - w(kUU) * d[k0]);
  d[kUV] = one * (h[kUV].x - w(kU) * d[kV] - w(kV) * d[kU] - w(kUV) * d[k0]);
  d[kVV] = one * (h[kVV].x - 2.0 * (w(kV) * d[kV]) - w(kVV) * d[k0]);
  if (!third) return;
  d[kUUU] = one * (h[kUUU].x - 3.0 * (w(kU) * d[kUU]) - 3.0 * (w(kUU) * d[kU]) - w(kUUU) * d[k0]);
  d[kUUV] = one * (h[kUUV].x - 2.0 * (w(kU) * d[kUV]) - w(kV) * d[kUU] - w(kUU) * d[kV] -
                   2.0 * (w(kUV) * d[kU]) - w(kUUV) * d[k0]);
  d[kUVV] = one * (h[kUVV].x - 2.0 * (w(kV) * d[kUV]) - w(kU) * d[kVV] - w(kVV) * d[kU] -
                   2.0 * (w(kUV) * d[kV]) - w(kUVV) * d[k0]);
  d[kVVV] = one * (h[kVVV].x - 3.0 * (w(kV) * d[kVV]) - 3.0 * (w(kVV) * d[kV]) - w(kVVV) * d[k0]);
}

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

// Equal angles of half a turn.
const std::array<Vec2, kCubicAngles>& half_circle() {
  static const auto circle = [] {
    std::array<Vec2, kCubicAngles> at;
    for (int k = 0; k < kCubicAngles; ++k)
      at[k] = {std::cos(M_PI * k / kCubicAngles), std::sin(M_PI * k / kCubicAngles)};
    return at;
  }();
  return circle;
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

// Coefficient (i, j) of a patch, turned so that the pole is at u = 0 (a rotation of the
// parameters: normals stay outward).
const Vec4& turned_point(const BezierPatch& patch, int pole, int i, int j) {
  const int p = patch.degree_u, q = patch.degree_v;
  const auto at = [&](int iu, int jv) -> const Vec4& { return patch.point(iu, jv); };
  switch (pole) {
    case 1:
      return at(p - i, q - j);
    case 2:
      return at(p - j, i);
    case 3:
      return at(j, q - i);
    default:
      return at(i, j);
  }
}

// The cell's distance from the pole, in parameters.
double from_pole(const Cell& c) {
  switch (c.pole) {
    case 0:
      return c.u0;
    case 1:
      return 1 - c.u0 - c.du;
    case 2:
      return c.v0;
    default:
      return 1 - c.v0 - c.dv;
  }
}

// Affine coordinates of a cell: x = origin + back y.
struct Frame {
  Vec3 origin;
  Mat3 back, to;
  double det;                                      // of `back`
  double least_curvature, min_radius, max_radius;  // in the middle of the cell; infinite where it is flat
};

// From the surface at the cell's middle: unit tangents, and the second form's mean of unit size along the
// third axis, which is the mean of the second derivatives (affine normal), or the normal if `upright`.
bool make_frame(const BezierPatch& patch, const Cell& cell, const Vec3& origin, bool upright, Frame* frame) {
  const Jet2 j = evaluate2(patch, cell.u0 + 0.5 * cell.du, cell.v0 + 0.5 * cell.dv);
  Vec3 su = cell.du * j.su, sv = cell.dv * j.sv;
  Vec3 suu = cell.du * cell.du * j.suu, suv = cell.du * cell.dv * j.suv, svv = cell.dv * cell.dv * j.svv;
  if (cell.pole >= 2) {
    std::swap(su, sv);
    std::swap(suu, svv);
  }
  if (cell.pole == 1 || cell.pole == 3) su = -su;
  if (cell.pole == 1 || cell.pole == 2) sv = -sv;
  if (cell.pole == 2 || cell.pole == 3) suv = -suv;  // one of u and v is turned round, and they are exchanged
  if (cell.pole >= 0) {                              // x_v = u z_v
    const double u = from_pole(cell) + 0.5 * (cell.pole < 2 ? cell.du : cell.dv);
    sv /= u;
    suv /= u;
    svv /= u * u;
  }
  const Vec3 n = su.cross(sv);
  const double e = -n.dot(suu), f = -n.dot(suv), g = -n.dot(svv), det = e * g - f * f;
  const double area = n.norm();
  if (!(area > 0)) return false;
  const double metric_e = su.squaredNorm(), metric_f = su.dot(sv), metric_g = sv.squaredNorm();
  const double mean = 0.5 * (metric_e * g - 2 * metric_f * f + metric_g * e) / (area * area * area),
               gauss = det / (area * area * area * area),
               split = std::sqrt(std::max(0.0, mean * mean - gauss));
  frame->least_curvature = mean > 0 ? gauss / (mean + split) : mean - split;
  frame->max_radius = frame->least_curvature > 0 ? 1 / frame->least_curvature : kInfinity;
  frame->min_radius = mean + split > 0 ? 1 / (mean + split) : kInfinity;
  Vec3 up = n / area;
  double height = std::sqrt(area);
  if (upright) {
    const double mean_form = 0.5 * (std::abs(e) + std::abs(g)) / area;
    if (mean_form > 0) height = mean_form;
  } else if (det > 0 && e > 0) {
    const Vec3 affine = -(g * suu - 2 * f * suv + e * svv) / (2 * det);  // n . affine = 1
    const double size = 0.5 * (e + g);                                   // = - n . (suu + svv) / 2
    up = size * affine;
    height = 1;
  }
  frame->origin = origin;
  frame->back << su, sv, height * up;
  frame->det = frame->back.determinant();
  if (!(frame->det > 0) || !std::isfinite(frame->det)) return false;
  frame->to = frame->back.inverse();
  return frame->to.allFinite();
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
  Real least = all<Real>(-kInfinity), most = all<Real>(kInfinity);
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

}  // namespace

void halve(const Cell& cell, bool in_u, Cell* first, Cell* second) {
  *first = *second = cell;
  if (in_u) {
    first->du = second->du = 0.5 * cell.du;
    second->u0 += 0.5 * cell.du;
  } else {
    first->dv = second->dv = 0.5 * cell.dv;
    second->v0 += 0.5 * cell.dv;
  }
}

namespace {

// What cells must have in common to be enclosed side by side.
struct Kind {
  int rows, columns;  // degrees, away from the pole and round it
  bool polar, touches, rational, rate, stretch;
  bool operator==(const Kind& o) const {
    return rows == o.rows && columns == o.columns && polar == o.polar && touches == o.touches &&
           rational == o.rational && rate == o.rate && stretch == o.stretch;
  }
};

// A cell in its frame.
struct Framed {
  const BezierPatch* patch;
  const Cell* cell;
  CellBounds* out;
  Kind kind;
  bool turned;
  double start, length;  // from the pole, in parameters
  Vec3 middle;
  Frame frame;
};

// False where there is no frame, and nothing is proven.
bool prepare(const BezierPatch& patch, const Cell& cell, Wanted wanted, bool upright, CellBounds* out,
             Framed* f) {
  *out = {};
  out->max_radius = out->rate = kInfinity;
  out->least_curvature = -kInfinity;
  out->doubt = kInfinity;
  out->split_u = cell.du >= cell.dv;
  f->patch = &patch;
  f->cell = &cell;
  f->out = out;
  const bool polar = cell.pole >= 0;
  f->turned = cell.pole >= 2;
  f->start = polar ? from_pole(cell) : 0;
  f->length = f->turned ? cell.dv : cell.du;
  const bool touches = polar && f->start == 0;
  f->kind = {f->turned ? patch.degree_v : patch.degree_u,
             f->turned ? patch.degree_u : patch.degree_v,
             polar,
             touches,
             patch.rational,
             wanted.rate && !touches,
             wanted.stretch};
  f->middle = evaluate0(patch, cell.u0 + 0.5 * cell.du, cell.v0 + 0.5 * cell.dv);
  if (!make_frame(patch, cell, f->middle, upright, &f->frame)) return false;
  out->seen_min = f->frame.min_radius;
  out->seen_max = f->frame.max_radius;
  out->seen_curvature = f->frame.least_curvature;
  return true;
}

// Parameters from `low` to `high` of a patch turned as its pole wants it.
struct Section {
  double low, high;
};
Section rows_of(const Cell& c) {
  const double u1 = c.u0 + c.du, v1 = c.v0 + c.dv;
  switch (c.pole) {
    case 1:
      return {1 - u1, 1 - c.u0};
    case 2:
      return {c.v0, v1};
    case 3:
      return {1 - v1, 1 - c.v0};
    default:
      return {c.u0, u1};
  }
}
Section columns_of(const Cell& c) {
  const double u1 = c.u0 + c.du, v1 = c.v0 + c.dv;
  switch (c.pole) {
    case 1:
      return {1 - v1, 1 - c.v0};
    case 2:
      return {1 - u1, 1 - c.u0};
    case 3:
      return {c.u0, u1};
    default:
      return {c.v0, v1};
  }
}

// De Casteljau at `high`, then what is left at `low`, of coefficients `stride` apart.
template <class Real>
void restrict_row(const Real& high, const Real& low_share, int degree, int stride, int k, Point<Real>* c) {
  const Real below = 1.0 - high, above = 1.0 - low_share;
  for (int step = 1; step <= degree; ++step)
    for (int i = degree; i >= step; --i)
      c[i * stride].at[k] = below * c[(i - 1) * stride].at[k] + high * c[i * stride].at[k];
  for (int step = 1; step <= degree; ++step)
    for (int i = 0; i <= degree - step; ++i)
      c[i * stride].at[k] = above * c[i * stride].at[k] + low_share * c[(i + 1) * stride].at[k];
}

// Where the cells are in their patches: each parameter's upper end, and the lower one's share of it.
template <class Real>
struct Sections {
  Real high_u, low_u, high_v, low_v;
};
template <class Real>
void restrict_net(const Sections<Real>& to, Coordinates which, Net<Real>* net) {
  const int row = net->n + 1;
  for (int k = which.first; k < which.end; ++k) {
    for (int j = 0; j < row; ++j) restrict_row(to.high_u, to.low_u, net->m, row, k, net->c + j);
    for (int i = 0; i <= net->m; ++i) restrict_row(to.high_v, to.low_v, net->n, 1, k, net->c + i * row);
  }
}

}  // namespace

std::vector<Vec4> net_of(const BezierPatch& patch, const Cell& cell) {
  Net<double> net;
  net.m = patch.degree_u;
  net.n = patch.degree_v;
  for (size_t i = 0; i < patch.points.size(); ++i)
    for (int k = 0; k < 4; ++k) net.c[i].at[k] = patch.points[i][k];
  const double u1 = cell.u0 + cell.du, v1 = cell.v0 + cell.dv;
  restrict_net<double>({u1, cell.u0 / u1, v1, cell.v0 / v1}, {0, 4}, &net);
  std::vector<Vec4> points;
  for (size_t i = 0; i < patch.points.size(); ++i) points.emplace_back(net.c[i].at);
  return points;
}

namespace {

template <class Real>
void take_middle(const Framed& f, int lane, Middle<Real>* to) {
  const Cell& c = *f.cell;
  const Jet3 j = evaluate3(*f.patch, c.u0 + 0.5 * c.du, c.v0 + 0.5 * c.dv);
  put(j.su, lane, &to->u);
  put(j.sv, lane, &to->v);
  put(j.suu, lane, &to->uu);
  put(j.suv, lane, &to->uv);
  put(j.svv, lane, &to->vv);
  put(j.suuu, lane, &to->uuu);
  put(j.suuv, lane, &to->uuv);
  put(j.suvv, lane, &to->uvv);
  put(j.svvv, lane, &to->vvv);
}

// Up to kLanes<Real> cells of one kind. Numbers of a cell of which something on the way is not proven mean
// nothing: `fill` takes none of them.
template <class Real>
class Enclosing {
 public:
  Enclosing(const Framed* const* cells, int count) : cells_(cells), count_(count), kind_(cells[0]->kind) {}

  void run() {
    take();
    differentiate();
    turn_to_middle();
    bound_normals();
    bound_curvature();
    if (any(proven_)) bound_radii();
    for (int l = 0; l < count_; ++l) fill(l);
  }

 private:
  static bool any(const Mask<Real>& mask) { return !none_of(mask); }
  static bool is(const Mask<Real>& mask, int lane) {
    if constexpr (kLanes<Real> == 1)
      return mask;
    else
      return mask[lane] != 0;
  }

  void take() {
    for (int l = 0; l < kLanes<Real>; ++l) {
      const Framed& f = *cells_[std::min(l, count_ - 1)];
      put(f.frame.back, l, &frame_back_);
      put(f.frame.to, l, &frame_to_);
      put(f.frame.det, l, &frame_det_);
      put(f.middle, l, &middle_);
      put(f.start, l, &start_);
      put(f.length, l, &length_);
      const Section rows = rows_of(*f.cell), columns = columns_of(*f.cell);
      put(rows.high, l, &sections_.high_u);
      put(rows.low / rows.high, l, &sections_.low_u);
      put(columns.high, l, &sections_.high_v);
      put(columns.low / columns.high, l, &sections_.low_v);
    }
    take_patches();
    take_nets();
  }

  // Whole nets, turned as the pole wants it.
  void take_patches() {
    net_.m = kind_.rows;
    net_.n = kind_.columns;
    bool one = true;
    for (int l = 1; l < count_; ++l)
      one &= cells_[l]->patch == cells_[0]->patch && cells_[l]->cell->pole == cells_[0]->cell->pole;
    for (int i = 0; i <= net_.m; ++i)
      for (int j = 0; j <= net_.n; ++j) {
        Point<Real>& to = net_.at(i, j);
        for (int l = 0; l < (one ? 1 : kLanes<Real>); ++l) {
          const Framed& f = *cells_[std::min(l, count_ - 1)];
          const Vec4& c = turned_point(*f.patch, f.cell->pole, i, j);
          for (int k = 0; k < 4; ++k)
            if (one)
              to.at[k] = all<Real>(c[k]);
            else
              put(c[k], l, &to.at[k]);
        }
      }
  }

  // The cells' nets in their frames' coordinates; of z, one degree less, where there is a pole. With the
  // round-off of the coefficients.
  void take_nets() {
    const Coordinates which{0, kind_.rational ? 4 : 3};
    if (kind_.polar) take_quotient();
    restrict_net(sections_, which, &net_);
    Real largest{}, heaviest = all<Real>(1);
    const int count = (net_.m + 1) * (net_.n + 1);
    for (int i = 0; i < count; ++i) {
      const Point<Real>& c = net_.c[i];
      for (int k = 0; k < 3; ++k) largest = larger(magnitude(c.at[k]), largest);
      if (kind_.rational) heaviest = i == 0 ? c.at[3] : larger(c.at[3], heaviest);
    }
    if (kind_.polar) {
      weight_ = net_;
      net_ = quotient_;
      restrict_net(sections_, {0, 3}, &net_);
      for (int i = 0; i < (net_.m + 1) * (net_.n + 1); ++i)
        turn_to_frame(Triple<Real>{Real{}, Real{}, Real{}}, &net_.c[i]);
    } else {
      for (int i = 0; i < count; ++i) {
        const Real w = kind_.rational ? net_.c[i].at[3] : all<Real>(1);
        turn_to_frame(w * middle_, &net_.c[i]);
      }
    }
    const Real farthest = larger(magnitude(middle_.x), larger(magnitude(middle_.y), magnitude(middle_.z)));
    const Real size = (kNetRoundoff * (kind_.polar ? kind_.rows : 1)) * (largest + heaviest * farthest);
    for (int k = 0; k < 3; ++k) {
      const Triple<Real>& row = frame_to_.row[k];
      noise_.at[k] = size * (magnitude(row.x) + magnitude(row.y) + magnitude(row.z));
    }
    noise_.at[3] = kNetRoundoff * heaviest;
  }

  void turn_to_frame(const Triple<Real>& origin, Point<Real>* c) const {
    const Triple<Real> y =
        frame_to_ * Triple<Real>{c->at[0] - origin.x, c->at[1] - origin.y, c->at[2] - origin.z};
    c->at[0] = y.x;
    c->at[1] = y.y;
    c->at[2] = y.z;
  }

  // z w, of the whole patch.
  void take_quotient() {
    quotient_.m = net_.m - 1;
    quotient_.n = net_.n;
    const Point<Real>& corner = net_.at(0, 0);
    for (int i = 1; i <= net_.m; ++i)
      for (int j = 0; j <= net_.n; ++j)
        for (int k = 0; k < 3; ++k)
          quotient_.at(i - 1, j).at[k] =
              (static_cast<double>(net_.m) / i) *
              (net_.at(i, j).at[k] - net_.at(i, j).at[3] * (corner.at[k] / corner.at[3]));
  }

  // Position and derivatives; the basis of the tangent plane, the normal N and the form D in that basis,
  // frame's coordinates.
  void differentiate() {
    const bool third = kind_.rate || kind_.polar;
    Hulls<Real> hulls;
    hulls_of(net_, {0, kind_.rational && !kind_.polar ? 4 : 3}, noise_, third, &hulls);
    if (kind_.polar && kind_.rational) hulls_of(weight_, {3, 4}, noise_, third, &hulls);
    const Real lightest = kind_.rational ? hulls[k0].w.low() : all<Real>(1);
    weighted_ = lightest > 0.0;
    divide(hulls, kind_.rational, third, &y_);
    tangent_u_ = y_[kU];
    tangent_v_ = y_[kV];
    uu_ = y_[kUU];
    uv_ = y_[kUV];
    vv_ = y_[kVV];
    if (kind_.polar) return differentiate_at_pole();
    normal_ = cross(tangent_u_, tangent_v_);
    form_ = {-1.0 * dot(normal_, uu_), -1.0 * dot(normal_, uv_), -1.0 * dot(normal_, vv_)};
  }

  void differentiate_at_pole() {
    u_ = {start_ + 0.5 * length_, 0.5 * length_, Real{}, Real{}};
    tangent_u_ = scaled(length_, y_[k0]) + u_ * y_[kU];
    normal_ = cross(tangent_u_, tangent_v_);
    uu_ = scaled<Real>(2.0 * length_, y_[kU]) + u_ * y_[kUU];
    form_.a = -1.0 * dot(normal_, uu_);
    form_.b = -1.0 * dot(normal_, y_[kUV]);
    if (kind_.touches) {
      const AffineVector<Real> normal_u = cross(uu_, y_[kV]) + cross(tangent_u_, y_[kUV]);
      form_.c = scaled<Real>(-1.0 / length_, dot(normal_u, y_[kVV]) + dot(normal_, y_[kUVV]));
    } else {
      over_u_ = inverse(u_);
      form_.c = -1.0 * (over_u_ * dot(normal_, y_[kVV]));
      uv_ = y_[kUV] + scaled(length_, over_u_ * y_[kV]);
      vv_ = over_u_ * y_[kVV];
    }
  }

  // Axes t1, t2, n of the cell's middle.
  void turn_to_middle() {
    const Triple<Real> n = normal_.center();
    const auto transposed = [](const Turn<Real>& m, const Triple<Real>& v) {
      return v.x * m.row[0] + v.y * m.row[1] + v.z * m.row[2];
    };
    axes_[2] = unit(transposed(frame_to_, n));
    axes_[0] = square_to(axes_[2]);
    axes_[1] = cross(axes_[2], axes_[0]);
    upright_ = weighted_ & (dot(axes_[2], axes_[2]) > 0.25);  // not if it is NaN
    Turn<Real> back, over;
    for (int k = 0; k < 3; ++k) {
      back.row[k] = transposed(frame_back_, axes_[k]);
      over.row[k] = frame_to_ * axes_[k];
    }
    back_ = back;
    m_ = over * normal_;
    det_ = form_.det();
  }

  void bound_normals() {
    const AffineVector<Real>&u = tangent_u_, &v = tangent_v_;
    const Real size = length_of(m_.center());
    const auto vary = [&](Real Affine<Real>::*part) -> Real {
      return magnitude(u.x.*part) + magnitude(u.y.*part) + magnitude(v.x.*part) + magnitude(v.y.*part) +
             (magnitude(m_.x.*part) + magnitude(m_.y.*part)) / size;
    };
    along_u_ = vary(&Affine<Real>::a) >= vary(&Affine<Real>::b);
    doubt_ = u.x.spread() + u.y.spread() + v.x.spread() + v.y.spread() +
             (m_.x.spread() + m_.y.spread() + m_.z.spread()) / size;
    regular_ = upright_ & (m_.z.low() > 0.0);
    slope_ = norm2(m_.x.most(), m_.y.most()) / m_.z.low();
    const Affine<Real> m2 = square(m_.x) + square(m_.y) + square(m_.z);
    long_ = regular_ & (m2.low() > 0.0);
    normal_length_ = root(m2);
  }

  void bound_curvature() {
    ju_ = back_ * tangent_u_;
    jv_ = back_ * tangent_v_;
    const auto size = [](const AffineVector<Real>& v) {
      return root((square(v.x) + square(v.y) + square(v.z)).high());
    };
    const Real area = frame_det_ * normal_length_.low();
    speed_u_ = area / size(jv_);
    speed_v_ = area / size(ju_);
    if (kind_.polar) speed_v_ = start_ * speed_v_;  // |x_v| = u |z_v|, |N| = u |N'|
    // Curvatures, which vary little along a nearly flat direction, where the radii vary much.
    curvature_ = any_curvature<Real>(ju_, jv_, form_, {normal_length_.low(), normal_length_.high()});
    proven_ = long_ & (det_.low() > 0.0) & (form_.a.low() > 0.0);
    const Mask<Real> positive = long_ & (curvature_.low > 0.0);
    if (kind_.rate && (any(proven_) || any(positive))) {
      Middle<Real> middle;
      for (int l = 0; l < kLanes<Real>; ++l) take_middle(*cells_[std::min(l, count_ - 1)], l, &middle);
      seen_rate_ = rate_at(middle);
    }
  }

  // Tangent vectors T_k that lie over t_k, and what parameters change by when the normal turns along them:
  // p_k = |N| D^-1 J' T_k; then W(T_k, T_l) = p_k . J' T_l.
  void bound_radii() {
    const Affine<Real> over_z = inverse(m_.z);
    inclined_[0] = m_.x * over_z;
    inclined_[1] = m_.y * over_z;
    const Affine<Real> factor = normal_length_ * inverse(det_);
    Affine<Real> jt[2][2];  // of T_k: along u, along v
    for (int k = 0; k < 2; ++k) {
      jt[k][0] = (k == 0 ? ju_.x : ju_.y) - inclined_[k] * ju_.z;
      jt[k][1] = (k == 0 ? jv_.x : jv_.y) - inclined_[k] * jv_.z;
      dp_[k][0] = factor * (form_.c * jt[k][0] - form_.b * jt[k][1]);
      dp_[k][1] = factor * (form_.a * jt[k][1] - form_.b * jt[k][0]);
    }
    const FormMatrix<Real> w{dp_[0][0] * jt[0][0] + dp_[0][1] * jt[0][1],
                             dp_[0][0] * jt[1][0] + dp_[0][1] * jt[1][1],
                             dp_[1][0] * jt[1][0] + dp_[1][1] * jt[1][1]};
    // A unit tangent is q1 T1 + q2 T2 with cos(cone) <= |q| <= 1.
    const Range<Real> radii = eigenvalues(w);
    const Real upright2 = 1.0 / (1.0 + slope_ * slope_);
    const Real shortest2 = normal_length_.low() * normal_length_.low();
    const Real product = shortest2 * shortest2 / det_.high() * frame_det_ * frame_det_;
    radii_ = {larger<Real>(product / radii.high, radii.low * upright2), radii.high};
    if (kind_.stretch) stretches_ = stretch_of(jt, form_, factor, w, axes_);
    if (kind_.rate) bound_rate();
  }

  // The third-order form C(t, t, t) = 3 t . x_ij p_i p_j + n . x_ijk p_i p_j p_k.
  void bound_rate() {
    using Form = Affine<Real>;
    const AffineVector<Real> at_uu = back_ * uu_, at_uv = back_ * uv_, at_vv = back_ * vv_;
    AffineVector<Real> uuu = y_[kUUU], uuv = y_[kUUV], uvv = y_[kUVV], vvv = y_[kVVV];  // x_ijk in the basis
    if (kind_.polar) {
      uuu = scaled<Real>(3.0 * length_, y_[kUU]) + u_ * y_[kUUU];
      uuv = y_[kUUV] + scaled<Real>(2.0 * length_, over_u_ * y_[kUV]);
      uvv = over_u_ * (y_[kUVV] + scaled(length_, over_u_ * y_[kVV]));
      vvv = over_u_ * (over_u_ * y_[kVVV]);
    }
    const Form shorter = inverse(normal_length_);
    const Form t0 = shorter * dot(normal_, uuu), t1 = shorter * dot(normal_, uuv),
               t2 = shorter * dot(normal_, uvv), t3 = shorter * dot(normal_, vvv);
    // Of the pairs (0, 0), (0, 1), (1, 1) of tangents.
    Form along[3][2], over_du[3], over_dv[3];
    for (int pair = 0; pair < 3; ++pair) {
      const Form(&a)[2] = dp_[pair / 2], (&b)[2] = dp_[(pair + 1) / 2];
      const Form u2 = a[0] * b[0], mixed = a[0] * b[1] + a[1] * b[0], v2 = a[1] * b[1];
      const AffineVector<Real> x = u2 * at_uu + mixed * at_uv + v2 * at_vv;
      along[pair][0] = x.x - inclined_[0] * x.z;
      along[pair][1] = x.y - inclined_[1] * x.z;
      over_du[pair] = u2 * t0 + mixed * t1 + v2 * t2;
      over_dv[pair] = u2 * t1 + mixed * t2 + v2 * t3;
    }
    const auto bend = [&](int pair, int k) { return dp_[k][0] * over_du[pair] + dp_[k][1] * over_dv[pair]; };
    const Form c[4] = {3.0 * along[0][0] + bend(0, 0), 2.0 * along[1][0] + along[0][1] + bend(0, 1),
                       2.0 * along[1][1] + along[2][0] + bend(1, 1), 3.0 * along[2][1] + bend(2, 1)};
    const double exact = 1 / std::cos(1.5 * M_PI / kCubicAngles);
    rate_ = exact * (largest_cubic(c[0].c, c[1].c, c[2].c, c[3].c) +
                     largest_cubic(c[0].a, c[1].a, c[2].a, c[3].a) +
                     largest_cubic(c[0].b, c[1].b, c[2].b, c[3].b)) +
            root(Real(c[0].r * c[0].r + 3.0 * c[1].r * c[1].r + 3.0 * c[2].r * c[2].r + c[3].r * c[3].r));
  }

  void fill(int l) const {
    const Framed& f = *cells_[l];
    CellBounds& out = *f.out;
    if (!is(upright_, l)) return;
    out.split_u = is(along_u_, l) != f.turned;
    out.doubt = get(doubt_, l);
    if (!is(regular_, l)) return;
    out.regular = true;
    out.axis = {get(axes_[2].x, l), get(axes_[2].y, l), get(axes_[2].z, l)};
    out.cone = std::atan(get(slope_, l));
    if (!is(long_, l)) return;
    out.speed_u = get(f.turned ? speed_v_ : speed_u_, l) / f.cell->du;
    out.speed_v = get(f.turned ? speed_u_ : speed_v_, l) / f.cell->dv;
    const double least = get(curvature_.low, l), most = get(curvature_.high, l);
    if (!std::isnan(least)) {
      out.least_curvature = least;
      out.min_radius = 1 / most;
    }
    out.convex = out.least_curvature > 0;
    if (out.convex) out.max_radius = 1 / out.least_curvature;
    const bool proven = is(proven_, l);
    if (kind_.rate && (out.convex || proven)) out.seen_rate = get(seen_rate_, l);
    if (!proven) return;
    out.convex = true;
    out.least_curvature = std::max(0.0, out.least_curvature);
    out.max_radius = std::min(out.max_radius, get(radii_.high, l));
    out.min_radius = std::max(out.min_radius, get(radii_.low, l));
    if (kind_.stretch && is(stretches_.found, l)) {
      const Triple<Real>& along = stretches_.along;
      out.stretch = {{get(along.x, l), get(along.y, l), get(along.z, l)},
                     get(stretches_.most, l),
                     get(stretches_.least, l)};
    }
    if (kind_.rate) out.rate = get(rate_, l);
  }

  const Framed* const* cells_;
  const int count_;
  const Kind kind_;
  Triple<Real> middle_;
  Sections<Real> sections_;
  Net<Real> net_, weight_, quotient_;
  Point<Real> noise_;
  Turn<Real> frame_back_, frame_to_, back_;
  Real frame_det_, start_, length_;
  Derivatives<Real> y_;
  AffineVector<Real> tangent_u_, tangent_v_, normal_, uu_, uv_, vv_;  // x_ij in the basis of the tangents
  FormMatrix<Real> form_;
  Affine<Real> u_, over_u_;                  // distance from the pole
  Mask<Real> weighted_, upright_, regular_;  // what is proven so far: weights, axes, normals, ...
  Mask<Real> long_, proven_;                 // ... their length, the sign of D
  Triple<Real> axes_[3];
  AffineVector<Real> m_;  // N over det, in those axes
  Affine<Real> det_, normal_length_;
  AffineVector<Real> ju_, jv_;
  Mask<Real> along_u_;
  Real doubt_, slope_, speed_u_, speed_v_, seen_rate_, rate_;
  Range<Real> curvature_, radii_;
  Affine<Real> inclined_[2], dp_[2][2];
  Stretches<Real> stretches_;
};

constexpr int kAtOnce = 64;  // cells prepared

void enclose_some(Enclosed* const* cells, CellBounds* const* out, int count, bool upright) {
  Framed framed[kAtOnce];
  const Framed* left[kAtOnce];
  int open = 0;
  for (int k = 0; k < count; ++k)
    if (prepare(*cells[k]->patch, *cells[k]->cell, cells[k]->wanted, upright, out[k], &framed[k]))
      left[open++] = &framed[k];
  while (open > 0) {
    const Framed* same[kWidth];
    int many = 0, others = 0;
    const Kind kind = left[0]->kind;
    for (int k = 0; k < open; ++k) {
      const bool taken = many < kWidth && left[k]->kind == kind;
      (taken ? same[many++] : left[others++]) = left[k];
    }
    open = others;
    if (many > 1)
      Enclosing<Wide>(same, many).run();
    else
      Enclosing<double>(same, 1).run();
  }
}

}  // namespace

void enclose(Enclosed* cells, int count) {
  for (int first = 0; first < count; first += kAtOnce) {
    Enclosed* some[kAtOnce];
    CellBounds* out[kAtOnce];
    const int many = std::min(count - first, kAtOnce);
    for (int k = 0; k < many; ++k) {
      some[k] = &cells[first + k];
      out[k] = &some[k]->bounds;
    }
    enclose_some(some, out, many, false);
    // At a flat pole the affine normal leans anywhere; what is proven in either frame is proven.
    CellBounds upright[kAtOnce], *again[kAtOnce];
    int doubtful = 0;
    for (int k = 0; k < many; ++k) {
      const Cell& cell = *some[k]->cell;
      if (out[k]->convex || cell.pole < 0 || from_pole(cell) > 0) continue;
      again[doubtful] = &upright[doubtful];
      some[doubtful++] = some[k];
    }
    if (doubtful == 0) continue;
    enclose_some(some, again, doubtful, true);
    for (int k = 0; k < doubtful; ++k) {
      CellBounds& bounds = some[k]->bounds;
      const CellBounds& other = upright[k];
      if (other.convex || (other.regular && other.min_radius > bounds.min_radius)) bounds = other;
    }
  }
}

CellBounds enclose(const BezierPatch& patch, const Cell& cell, Wanted wanted) {
  Enclosed one{&patch, &cell, wanted, {}};
  enclose(&one, 1);
  return one.bounds;
}

}  // namespace nurbs

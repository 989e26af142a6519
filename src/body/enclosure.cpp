// Cells of a patch and what holds all over them; the formulas are derived in enclosure.h.
#include "body/enclosure.h"

#include <array>
#include <limits>

#include "body/affine_form.h"
#include "nurbs/bernstein.h"
#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kTiny = std::numeric_limits<double>::min();

// A net of at most kMaxDegree + 1 rows, v fastest.
struct Net {
  int m = 0, n = 0;  // degrees
  std::array<Vec4, (kMaxDegree + 1) * (kMaxDegree + 1)> c;
  Vec4& at(int i, int j) { return c[i * (n + 1) + j]; }
  const Vec4& at(int i, int j) const { return c[i * (n + 1) + j]; }
};

void differ_u(const Net& f, Net* d) {
  d->m = std::max(f.m - 1, 0);
  d->n = f.n;
  for (int i = 0; i <= d->m; ++i)
    for (int j = 0; j <= d->n; ++j)
      d->at(i, j) = f.m > 0 ? Vec4(f.m * (f.at(i + 1, j) - f.at(i, j))) : Vec4(Vec4::Zero());
}
void differ_v(const Net& f, Net* d) {
  d->m = f.m;
  d->n = std::max(f.n - 1, 0);
  for (int i = 0; i <= d->m; ++i)
    for (int j = 0; j <= d->n; ++j)
      d->at(i, j) = f.n > 0 ? Vec4(f.n * (f.at(i, j + 1) - f.at(i, j))) : Vec4(Vec4::Zero());
}

// A function and its derivatives up to the third order: vector and weight.
enum Order { k0, kU, kV, kUU, kUV, kVV, kUUU, kUUV, kUVV, kVVV, kOrders };
struct Hull {
  AffineVector x;
  AffineForm w;
};
using Hulls = std::array<Hull, kOrders>;

// The plane through the net's corners on the average, and how far the other coefficients are from it: a
// linear function is its own net at equally spaced parameters.
void hull_of(const Net& f, const Vec4& noise, Hull* hull) {
  const Vec4 &p = f.at(0, 0), &q = f.at(0, f.n), &r = f.at(f.m, 0), &s = f.at(f.m, f.n);
  Vec4 c = 0.25 * (p + q + r + s), far = Vec4::Zero();
  const Vec4 a = 0.25 * (r + s - p - q), b = 0.25 * (q + s - p - r);
  Vec4 low = Vec4::Zero(), high = Vec4::Zero();
  const Vec4 step_a = f.m > 0 ? Vec4(2.0 / f.m * a) : Vec4(Vec4::Zero()),
             step_b = f.n > 0 ? Vec4(2.0 / f.n * b) : Vec4(Vec4::Zero());
  Vec4 row = c;
  if (f.m > 0) row -= a;
  if (f.n > 0) row -= b;
  low = high = p - row;
  for (int i = 0; i <= f.m; ++i, row += step_a) {
    Vec4 plane = row;
    for (int j = 0; j <= f.n; ++j, plane += step_b) {
      const Vec4 off = f.at(i, j) - plane;
      low = low.cwiseMin(off);
      high = high.cwiseMax(off);
    }
  }
  c += 0.5 * (low + high);
  far = 0.5 * (high - low) + noise;
  const auto form = [&](int k) { return AffineForm{c[k], a[k], b[k], far[k]}; };
  hull->x = {form(0), form(1), form(2)};
  hull->w = form(3);
}

// `noise`: bound of the round-off of a coefficient, which each difference at most doubles before its factor.
void hulls_of(const Net& f, const Vec4& noise, bool third, Hulls* h) {
  Net u, v, w;
  const double m = 2 * f.m, n = 2 * f.n;
  hull_of(f, noise, &(*h)[k0]);
  differ_u(f, &u);
  hull_of(u, m * noise, &(*h)[kU]);
  differ_v(u, &v);
  hull_of(v, m * n * noise, &(*h)[kUV]);
  if (third) {
    differ_v(v, &w);
    hull_of(w, m * n * n * noise, &(*h)[kUVV]);
    differ_u(v, &w);
    hull_of(w, m * m * n * noise, &(*h)[kUUV]);
  }
  differ_u(u, &w);
  hull_of(w, m * m * noise, &(*h)[kUU]);
  if (third) {
    differ_u(w, &v);
    hull_of(v, m * m * m * noise, &(*h)[kUUU]);
  }
  differ_v(f, &v);
  hull_of(v, n * noise, &(*h)[kV]);
  differ_v(v, &w);
  hull_of(w, n * n * noise, &(*h)[kVV]);
  if (third) {
    differ_v(w, &v);
    hull_of(v, n * n * n * noise, &(*h)[kVVV]);
  }
}

using Derivatives = std::array<AffineVector, kOrders>;

// Of the quotient x / w by Leibniz' rule. False if w may vanish. `rational`: else w is 1.
bool divide(const Hulls& h, bool rational, bool third, Derivatives* y) {
  if (!rational) {
    for (int k = 0; k < (third ? kOrders : kUUU); ++k) (*y)[k] = h[k].x;
    return true;
  }
  const auto w = [&](Order k) { return h[k].w; };
  if (!(w(k0).low() > 0)) return false;
  const AffineForm one = inverse(w(k0));
  Derivatives& d = *y;
  d[k0] = one * h[k0].x;
  d[kU] = one * (h[kU].x - w(kU) * d[k0]);
  d[kV] = one * (h[kV].x - w(kV) * d[k0]);
  d[kUU] = one * (h[kUU].x - 2 * (w(kU) * d[kU]) - w(kUU) * d[k0]);
  d[kUV] = one * (h[kUV].x - w(kU) * d[kV] - w(kV) * d[kU] - w(kUV) * d[k0]);
  d[kVV] = one * (h[kVV].x - 2 * (w(kV) * d[kV]) - w(kVV) * d[k0]);
  if (!third) return true;
  d[kUUU] = one * (h[kUUU].x - 3 * (w(kU) * d[kUU]) - 3 * (w(kUU) * d[kU]) - w(kUUU) * d[k0]);
  d[kUUV] = one * (h[kUUV].x - 2 * (w(kU) * d[kUV]) - w(kV) * d[kUU] - w(kUU) * d[kV] - 2 * (w(kUV) * d[kU]) -
                   w(kUUV) * d[k0]);
  d[kUVV] = one * (h[kUVV].x - 2 * (w(kV) * d[kUV]) - w(kU) * d[kVV] - w(kVV) * d[kU] - 2 * (w(kUV) * d[kV]) -
                   w(kUVV) * d[k0]);
  d[kVVV] = one * (h[kVVV].x - 3 * (w(kV) * d[kVV]) - 3 * (w(kVV) * d[kV]) - w(kVVV) * d[k0]);
  return true;
}

double norm2(double x, double y) {  // lengths here are far from the range's ends
  return std::sqrt(x * x + y * y);
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

// The largest third-order form C(t, t, t) = 3 t . x_ij p_i p_j + n . x_ijk p_i p_j p_k at a point, t unit, p
// = D^-1 J' t.
double rate_at(const BezierPatch& patch, double u, double v) {
  const Jet3 j = evaluate3(patch, u, v);
  const Vec3 n = j.su.cross(j.sv).normalized();
  const double e = -n.dot(j.suu), f = -n.dot(j.suv), g = -n.dot(j.svv), det = e * g - f * f;
  const double t0 = n.dot(j.suuu), t1 = n.dot(j.suuv), t2 = n.dot(j.suvv), t3 = n.dot(j.svvv);
  const Vec3 axis = n.unitOrthogonal();
  Eigen::Matrix<double, 2, 3> plane;
  plane << axis.transpose(), n.cross(axis).transpose();
  const Vec2 ju = plane * j.su, jv = plane * j.sv, uu = plane * j.suu, uv = plane * j.suv, vv = plane * j.svv;
  const Vec2 along_u = (g * ju - f * jv) / det, along_v = (e * jv - f * ju) / det;
  double most = 0;
  for (const Vec2& t : half_circle()) {
    const double p = along_u.dot(t), q = along_v.dot(t);
    const double second = p * p * t.dot(uu) + 2 * p * q * t.dot(uv) + q * q * t.dot(vv);
    most = std::max(most,
                    std::abs(3 * second + p * (p * (p * t0 + 3 * q * t1) + 3 * q * q * t2) + q * q * q * t3));
  }
  return most;
}

// Coefficient (i, j) of a net of degrees p, q, turned so that the pole is at u = 0 (a rotation of the
// parameters: normals stay outward).
const Vec4& turned_point(const Vec4* net, int p, int q, int pole, int i, int j) {
  const auto at = [&](int iu, int jv) -> const Vec4& { return net[iu * (q + 1) + jv]; };
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
struct FormMatrix {
  AffineForm a, b, c;
  AffineForm det() const { return a * c - square(b); }
};

struct Range {
  double low, high;
};

// Of the eigenvalues, over the cell: each entry's linear part is that of one matrix, whose norm it is.
Range eigenvalues(const FormMatrix& m) {
  const auto norm = [](double a, double b, double c) {
    return std::abs(0.5 * (a + c)) + norm2(0.5 * (a - c), b);
  };
  const double mean = 0.5 * (m.a.c + m.c.c), split = norm2(0.5 * (m.a.c - m.c.c), m.b.c);
  const double change = norm(m.a.a, m.b.a, m.c.a) + norm(m.a.b, m.b.b, m.c.b) +
                        std::sqrt(m.a.r * m.a.r + 2 * m.b.r * m.b.r + m.c.r * m.c.r);
  // Gershgorin's circles see that a ruled direction is flat however much the other one varies.
  const double circles = std::min(m.a.low(), m.c.low()) - m.b.most();
  return {std::max(mean - split - change, circles), mean + split + change};
}

// In a basis that is principal in the middle, so that the remainders of entries that differ much do not mix:
// jt and `w` are the tangents and W in that of `axes`; 2 |w12 x y| <= |w12| (k x^2 + y^2 / k).
Stretch stretch_of(const AffineForm (&jt)[2][2], const FormMatrix& form, const AffineForm& factor,
                   const FormMatrix& w, const Mat3& axes) {
  Stretch s;
  // Half the angle of (w11 - w22, 2 w12), from its cosine.
  const double difference = w.a.c - w.c.c, across = 2 * w.b.c, size = norm2(difference, across);
  const double cosine = size > 0 ? difference / size : 1;
  const double x = std::sqrt(std::max(0.0, 0.5 * (1 + cosine))),
               y = std::copysign(std::sqrt(std::max(0.0, 0.5 * (1 - cosine))), across);
  const AffineForm t[2][2] = {{x * jt[0][0] + y * jt[1][0], x * jt[0][1] + y * jt[1][1]},
                              {x * jt[1][0] - y * jt[0][0], x * jt[1][1] - y * jt[0][1]}};
  const auto entry = [&](int k, int l) {
    return factor * ((form.c * t[k][0] - form.b * t[k][1]) * t[l][0] +
                     (form.a * t[k][1] - form.b * t[k][0]) * t[l][1]);
  };
  const AffineForm most = entry(0, 0), mixed = entry(0, 1), least = entry(1, 1);
  if (!(most.c > 0 && least.c > 0)) return s;
  const double k = std::sqrt(most.c / least.c);
  s.along = x * axes.col(0) + y * axes.col(1);
  s.most = std::max(0.0, most.low() - k * mixed.most());
  s.least = std::max(0.0, std::min(s.most, least.low() - mixed.most() / k));
  return s;
}

double square2(double x) {
  return x * x;
}

// Curvatures that need not be positive: D / |N| in a basis that is orthonormal in the middle. Its first
// vector along u or along v: either may be a ruling.
void bound_any_curvature(const AffineVector& ju, const AffineVector& jv, const FormMatrix& d, Range length,
                         CellBounds* out) {
  double least = -kInfinity, most = kInfinity;
  for (const bool swapped : {false, true}) {
    const AffineVector &first = swapped ? jv : ju, &other = swapped ? ju : jv;
    const Vec3 a = first.center(), b = other.center();
    const double l11 = a.norm(), l21 = a.dot(b) / l11, l22 = a.cross(b).norm() / l11;
    if (!(l11 > 0) || !(l22 > 0)) return;
    const double b11 = 1 / l11, b22 = 1 / l22, b12 = -l21 / (l11 * l22);
    const AffineForm e = swapped ? d.c : d.a, g = swapped ? d.a : d.c;
    const FormMatrix bend{(b11 * b11) * e, (b11 * b12) * e + (b11 * b22) * d.b,
                          (b12 * b12) * e + (2 * b12 * b22) * d.b + (b22 * b22) * g};
    const AffineVector t = b11 * first, s = b12 * first + b22 * other;
    const FormMatrix metric{dot(t, t), dot(t, s), dot(s, s)};
    const Range k = eigenvalues(bend), stretch = eigenvalues(metric);
    if (!(stretch.low > 0)) continue;
    least = std::max(least,
                     k.low < 0 ? k.low / (stretch.low * length.low) : k.low / (stretch.high * length.high));
    most = std::min(most, std::max(k.high, 0.0) / (stretch.low * length.low));
  }
  out->least_curvature = least;
  out->min_radius = 1 / most;
}

// The largest value of a cubic form on the unit circle; coefficients of x^3, x^2 y, x y^2, y^3 over
// binomials.
double largest_cubic(double c0, double c1, double c2, double c3) {
  // A trigonometric polynomial of degree 3 is at most 1 / cos(3 pi / points) times its largest value at that
  // many equal angles (Ehlich & Zeller 1964); an odd one needs half of them.
  double most = 0;
  for (const Vec2& q : half_circle()) {
    const double x = q[0], y = q[1];
    most = std::max(most, std::abs(x * (x * (c0 * x + 3 * c1 * y) + 3 * c2 * y * y) + c3 * y * y * y));
  }
  return most;
}

}  // namespace

Cell whole_patch(const std::vector<BezierPatch>& patches, int patch) {
  Cell cell;
  cell.patch = patch;
  cell.net.assign(patches[patch].points);
  return cell;
}

void set_pole(const BezierPatch& patch, int edge, Cell* cell) {
  cell->pole = edge;
  const int p = patch.degree_u, q = patch.degree_v, n = edge < 2 ? p : q;
  const Vec4& corner = cell->net[edge % 2 ? cell->net.size() - 1 : 0];
  const Vec3 pole = corner.head<3>() / corner[3];
  cell->z.clear();
  for (int i = 0; i <= p; ++i)
    for (int j = 0; j <= q; ++j) {
      const int k = edge < 2 ? i : j, away = edge % 2 ? n - k : k;  // from the pole
      if (away == 0) continue;
      const Vec4& c = cell->net[i * (q + 1) + j];
      Vec4 z = Vec4::Zero();
      z.head<3>() = static_cast<double>(n) / away * (c.head<3>() - c[3] * pole);
      cell->z.push_back(z);
    }
}

void halve(const BezierPatch& patch, const Cell& cell, bool in_u, Cell* first, Cell* second) {
  *first = *second = cell;
  const int p = patch.degree_u, q = patch.degree_v;
  halve_net(first->net.data(), second->net.data(), p, q, in_u);
  if (cell.pole >= 0)
    halve_net(first->z.data(), second->z.data(), cell.pole < 2 ? p - 1 : p, cell.pole < 2 ? q : q - 1, in_u);
  if (in_u) {
    first->du = second->du = 0.5 * cell.du;
    second->u0 += 0.5 * cell.du;
  } else {
    first->dv = second->dv = 0.5 * cell.dv;
    second->v0 += 0.5 * cell.dv;
  }
}

namespace {

CellBounds enclose_in_frame(const BezierPatch& patch, const Cell& cell, Wanted wanted, bool upright) {
  CellBounds out;
  out.max_radius = out.rate = kInfinity;
  out.least_curvature = -kInfinity;
  out.doubt = kInfinity;
  out.split_u = cell.du >= cell.dv;
  const bool polar = cell.pole >= 0, turned = cell.pole >= 2;
  const int rows = turned ? patch.degree_v : patch.degree_u,
            columns = turned ? patch.degree_u : patch.degree_v;
  const bool third = wanted.rate || polar;
  const double start = polar ? from_pole(cell) : 0, length_u = turned ? cell.dv : cell.du;
  const bool touches = start == 0;
  const Vec3 middle = evaluate0(patch, cell.u0 + 0.5 * cell.du, cell.v0 + 0.5 * cell.dv);
  Frame frame;
  if (!make_frame(patch, cell, middle, upright, &frame)) return out;
  out.seen_min = frame.min_radius;
  out.seen_max = frame.max_radius;
  out.seen_curvature = frame.least_curvature;

  // The net in the frame's coordinates; of z, one degree less, where there is a pole.
  double largest = 0, heaviest = 0;
  Net net, weight;
  const int p = patch.degree_u, q = patch.degree_v;
  net.m = polar ? rows - 1 : rows;
  net.n = weight.n = columns;
  weight.m = rows;
  const int zp = turned || !polar ? p : p - 1, zq = turned ? q - 1 : q;
  for (int i = 0; i <= rows; ++i)
    for (int j = 0; j <= columns; ++j) {
      const Vec4& c = turned_point(cell.net.data(), p, q, cell.pole, i, j);
      largest = std::max(largest, c.head<3>().lpNorm<Eigen::Infinity>());
      heaviest = std::max(heaviest, c[3]);
      if (polar) {
        weight.at(i, j) = Vec4(0, 0, 0, c[3]);
        if (i == rows) continue;
        const Vec4& z = turned_point(cell.z.data(), zp, zq, cell.pole, i, j);
        net.at(i, j).head<3>() = frame.to * z.head<3>();
        net.at(i, j)[3] = 0;
      } else {
        net.at(i, j).head<3>() = frame.to * (c.head<3>() - c[3] * middle);
        net.at(i, j)[3] = c[3];
      }
    }
  Vec4 noise;
  noise.head<3>() = kNetRoundoff * (frame.to.cwiseAbs() *
                                    Vec3::Constant(largest + heaviest * middle.lpNorm<Eigen::Infinity>()));
  if (polar) noise.head<3>() *= rows;
  noise[3] = patch.rational ? kNetRoundoff * heaviest : 0;
  Hulls hulls;
  hulls_of(net, noise, third, &hulls);
  if (polar) {
    Hulls den;
    hulls_of(weight, noise, third, &den);
    for (int k = 0; k < kOrders; ++k) hulls[k].w = den[k].w;
  }
  Derivatives y;
  if (!divide(hulls, patch.rational, third, &y)) return out;

  // The basis of the tangent plane, the normal N and the form D in that basis, frame's coordinates.
  AffineVector tangent_u = y[kU], tangent_v = y[kV], normal;
  AffineVector uu = y[kUU], uv = y[kUV], vv = y[kVV];  // x_ij in that basis
  FormMatrix form;
  const AffineForm u{start + 0.5 * length_u, 0.5 * length_u, 0, 0};
  AffineForm over_u;
  if (polar) {
    tangent_u = length_u * y[k0] + u * y[kU];
    normal = cross(tangent_u, tangent_v);
    uu = (2 * length_u) * y[kU] + u * y[kUU];
    form = {-1.0 * dot(normal, uu), -1.0 * dot(normal, y[kUV]), {}};
    if (touches) {
      const AffineVector normal_u = cross(uu, y[kV]) + cross(tangent_u, y[kUV]);
      form.c = (-1 / length_u) * (dot(normal_u, y[kVV]) + dot(normal, y[kUVV]));
    } else {
      over_u = inverse(u);
      form.c = -1.0 * (over_u * dot(normal, y[kVV]));
      uv = y[kUV] + length_u * (over_u * y[kV]);
      vv = over_u * y[kVV];
    }
  } else {
    normal = cross(tangent_u, tangent_v);
    form = {-1.0 * dot(normal, uu), -1.0 * dot(normal, uv), -1.0 * dot(normal, vv)};
  }

  // Axes t1, t2, n of the cell's middle.
  Mat3 axes;
  axes.col(2) = (frame.to.transpose() * normal.center()).normalized();
  if (!axes.col(2).allFinite() || axes.col(2).norm() < 0.5) return out;
  axes.col(0) = axes.col(2).unitOrthogonal();
  axes.col(1) = axes.col(2).cross(axes.col(0));
  const Mat3 back = axes.transpose() * frame.back;
  const AffineVector m = (frame.to * axes).transpose() * normal;  // N over det
  const AffineForm det = form.det();
  const auto vary = [&](double AffineForm::*part) {
    double sum = 0;
    for (const AffineForm* f : {&tangent_u.x, &tangent_u.y, &tangent_v.x, &tangent_v.y})
      sum += std::abs(f->*part);
    for (const AffineForm* f : {&m.x, &m.y}) sum += std::abs(f->*part) / m.center().norm();
    return sum;
  };
  out.split_u = (vary(&AffineForm::a) >= vary(&AffineForm::b)) != turned;
  out.doubt = tangent_u.x.spread() + tangent_u.y.spread() + tangent_v.x.spread() + tangent_v.y.spread() +
              (m.x.spread() + m.y.spread() + m.z.spread()) / m.center().norm();
  if (!(m.z.low() > 0)) return out;
  out.regular = true;
  out.axis = axes.col(2);
  out.cone = std::atan(norm2(m.x.most(), m.y.most()) / m.z.low());
  const AffineForm m2 = square(m.x) + square(m.y) + square(m.z);
  if (!(m2.low() > 0)) return out;
  const AffineForm length = root(m2);
  const AffineVector ju = back * tangent_u, jv = back * tangent_v;
  const auto size = [](const AffineVector& v) {
    return std::sqrt((square(v.x) + square(v.y) + square(v.z)).high());
  };
  const double area = frame.det * length.low();
  double speed_u = area / size(jv), speed_v = area / size(ju);
  if (polar) speed_v *= start;  // |x_v| = u |z_v|, |N| = u |N'|
  if (turned) std::swap(speed_u, speed_v);
  out.speed_u = speed_u / cell.du;
  out.speed_v = speed_v / cell.dv;

  // Curvatures, which vary little along a nearly flat direction, where the radii below vary much.
  bound_any_curvature(ju, jv, form, {length.low(), length.high()}, &out);
  out.convex = out.least_curvature > 0;
  if (out.convex) out.max_radius = 1 / out.least_curvature;
  const bool rated = wanted.rate && !(polar && touches);
  if (rated && out.convex) out.seen_rate = rate_at(patch, cell.u0 + 0.5 * cell.du, cell.v0 + 0.5 * cell.dv);
  if (!(det.low() > 0 && form.a.low() > 0)) return out;
  out.convex = true;
  out.least_curvature = std::max(0.0, out.least_curvature);
  // Tangent vectors T_k that lie over t_k, and what parameters change by when the normal turns along them:
  // p_k = |N| D^-1 J' T_k; then W(T_k, T_l) = p_k . J' T_l.
  const AffineForm over_z = inverse(m.z), slope[2] = {m.x * over_z, m.y * over_z};
  const AffineForm factor = length * inverse(det);
  AffineForm jt[2][2], dp[2][2];  // of T_k: along u, along v
  for (int k = 0; k < 2; ++k) {
    jt[k][0] = (k == 0 ? ju.x : ju.y) - slope[k] * ju.z;
    jt[k][1] = (k == 0 ? jv.x : jv.y) - slope[k] * jv.z;
    dp[k][0] = factor * (form.c * jt[k][0] - form.b * jt[k][1]);
    dp[k][1] = factor * (form.a * jt[k][1] - form.b * jt[k][0]);
  }
  const FormMatrix w{dp[0][0] * jt[0][0] + dp[0][1] * jt[0][1], dp[0][0] * jt[1][0] + dp[0][1] * jt[1][1],
                     dp[1][0] * jt[1][0] + dp[1][1] * jt[1][1]};
  // A unit tangent is q1 T1 + q2 T2 with cos(cone) <= |q| <= 1.
  const Range radii = eigenvalues(w);
  const double upright2 = std::cos(out.cone) * std::cos(out.cone);
  out.max_radius = std::min(out.max_radius, radii.high);
  const double shortest2 = length.low() * length.low();
  const double product = shortest2 * shortest2 / det.high() * frame.det * frame.det;
  out.min_radius = std::max({out.min_radius, radii.low * upright2, product / radii.high});
  if (wanted.stretch) out.stretch = stretch_of(jt, form, factor, w, axes);
  if (!rated) return out;
  out.seen_rate = rate_at(patch, cell.u0 + 0.5 * cell.du, cell.v0 + 0.5 * cell.dv);

  // The third-order form C(t, t, t) = 3 t . x_ij p_i p_j + n . x_ijk p_i p_j p_k.
  const AffineVector at_uu = back * uu, at_uv = back * uv, at_vv = back * vv;
  const auto second = [&](int k, int l) {
    return (dp[k][0] * dp[l][0]) * at_uu + (dp[k][0] * dp[l][1] + dp[k][1] * dp[l][0]) * at_uv +
           (dp[k][1] * dp[l][1]) * at_vv;
  };
  const AffineVector x11 = second(0, 0), x12 = second(0, 1), x22 = second(1, 1);
  const auto along = [&](const AffineVector& x, int k) { return (k == 0 ? x.x : x.y) - slope[k] * x.z; };
  const AffineForm shorter = inverse(length);
  AffineVector uuu = y[kUUU], uuv = y[kUUV], uvv = y[kUVV], vvv = y[kVVV];  // x_ijk in the basis
  if (polar) {
    uuu = (3 * length_u) * y[kUU] + u * y[kUUU];
    uuv = y[kUUV] + (2 * length_u) * (over_u * y[kUV]);
    uvv = over_u * (y[kUVV] + length_u * (over_u * y[kVV]));
    vvv = over_u * (over_u * y[kVVV]);
  }
  const AffineForm t0 = shorter * dot(normal, uuu), t1 = shorter * dot(normal, uuv),
                   t2 = shorter * dot(normal, uvv), t3 = shorter * dot(normal, vvv);
  const auto bend = [&](int k, int l, int i) {
    const AffineForm u2 = dp[k][0] * dp[l][0], mixed = dp[k][0] * dp[l][1] + dp[k][1] * dp[l][0],
                     v2 = dp[k][1] * dp[l][1];
    return dp[i][0] * (u2 * t0 + mixed * t1 + v2 * t2) + dp[i][1] * (u2 * t1 + mixed * t2 + v2 * t3);
  };
  const AffineForm c[4] = {
      3 * along(x11, 0) + bend(0, 0, 0), 2 * along(x12, 0) + along(x11, 1) + bend(0, 0, 1),
      2 * along(x12, 1) + along(x22, 0) + bend(0, 1, 1), 3 * along(x22, 1) + bend(1, 1, 1)};
  const double exact = 1 / std::cos(1.5 * M_PI / kCubicAngles);
  out.rate =
      exact * (largest_cubic(c[0].c, c[1].c, c[2].c, c[3].c) + largest_cubic(c[0].a, c[1].a, c[2].a, c[3].a) +
               largest_cubic(c[0].b, c[1].b, c[2].b, c[3].b)) +
      std::sqrt(square2(c[0].r) + 3 * square2(c[1].r) + 3 * square2(c[2].r) + square2(c[3].r));
  return out;
}

}  // namespace

CellBounds enclose(const BezierPatch& patch, const Cell& cell, Wanted wanted) {
  const CellBounds bounds = enclose_in_frame(patch, cell, wanted, false);
  if (bounds.convex || cell.pole < 0 || from_pole(cell) > 0) return bounds;
  // At a flat pole the affine normal leans anywhere; what is proven in either frame is proven.
  CellBounds upright = enclose_in_frame(patch, cell, wanted, true);
  return upright.convex || (upright.regular && upright.min_radius > bounds.min_radius) ? upright : bounds;
}

}  // namespace nurbs

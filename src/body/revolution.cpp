// The axis from the arcs of a patch, the proof from what height and radius change along them.
#include "body/revolution.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "body/mass_properties.h"
#include "nurbs/bernstein.h"
#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

// Longer than double: what is left of the differences is the surface's own round-off, not theirs.
using Real = long double;
using Row = std::vector<Real>;
using Point = Eigen::Matrix<Real, 3, 1>;

// Line number i of a patch's control points across the arcs.
std::vector<Vec4> line_of(const BezierPatch& patch, bool arcs_in_u, int i) {
  std::vector<Vec4> line;
  const int n = arcs_in_u ? patch.degree_v : patch.degree_u;
  for (int k = 0; k <= n; ++k) line.push_back(arcs_in_u ? patch.point(i, k) : patch.point(k, i));
  return line;
}

// The axis and two directions that make a frame with it.
struct Axes {
  Point point, axis, t, s;
  explicit Axes(const Revolution& about) : point(about.point.cast<Real>()) {
    axis = about.axis.cast<Real>().normalized();
    t = axis.unitOrthogonal();
    s = axis.cross(t);
  }
};

// Height, weight, and the two coordinates across the axis, homogeneous, along one such line. Points within
// `noise` of the axis are moved onto it, and the surface by no more than the furthest of them.
struct Coordinates {
  Row x, y, z, w;
  Real moved = 0;
  Coordinates(const std::vector<Vec4>& line, const Axes& axes, double noise) {
    for (const Vec4& p : line) {
      const Real weight = p[3];
      const Point from = p.head<3>().cast<Real>() - weight * axes.point;
      const Real px = axes.t.dot(from), py = axes.s.dot(from), off = std::hypot(px, py) / weight;
      const bool on_axis = off <= noise;
      if (on_axis) moved = std::max(moved, off);
      x.push_back(on_axis ? 0 : px);
      y.push_back(on_axis ? 0 : py);
      z.push_back(axes.axis.dot(from));
      w.push_back(weight);
    }
  }
};

void add(Real factor, const Row& a, Row* sum) {
  if (sum->empty()) sum->resize(a.size(), 0);
  for (size_t k = 0; k < a.size(); ++k) (*sum)[k] += factor * a[k];
}

// How far points of the patch leave the arcs they should be on, a length; infinite where that is not small.
// `noise`: what points of the axis may be off it by.
double off_arcs(const BezierPatch& patch, bool arcs_in_u, const Revolution& about, double noise) {
  const Axes axes(about);
  const int n = arcs_in_u ? patch.degree_u : patch.degree_v;
  std::vector<Coordinates> lines;
  Real moved = 0;
  for (int i = 0; i <= n; ++i) {
    lines.emplace_back(line_of(patch, arcs_in_u, i), axes, noise);
    moved = std::max(moved, lines.back().moved);
  }
  const Coordinates& first = lines[0];
  Real height = 0;  // relative to the weights' product, coefficient by coefficient
  for (const Coordinates& line : lines) {
    const Row a = multiply(line.z, first.w), b = multiply(first.z, line.w), w = multiply(line.w, first.w);
    for (size_t k = 0; k < a.size(); ++k) height = std::max(height, std::abs(a[k] - b[k]) / w[k]);
  }
  const Row w2 = multiply(first.w, first.w);
  Row r2 = multiply(first.x, first.x);
  add(1, multiply(first.y, first.y), &r2);
  Real across = 0;  // relative to the squared radius
  for (int m = 0; m <= 2 * n; ++m) {
    Row squares, weights;
    for (int i = std::max(0, m - n); i <= std::min(n, m); ++i) {
      const Real share = static_cast<Real>(binomial(n, i)) * binomial(n, m - i) / binomial(2 * n, m);
      const Coordinates &a = lines[i], &b = lines[m - i];
      add(share, multiply(a.x, b.x), &squares);
      add(share, multiply(a.y, b.y), &squares);
      add(share, multiply(a.w, b.w), &weights);
    }
    const Row left = multiply(squares, w2), right = multiply(r2, weights);
    for (size_t k = 0; k < left.size(); ++k) {
      const Real off = std::abs(left[k] - right[k]);
      if (!(off > 0)) continue;
      if (!(right[k] > 0)) return std::numeric_limits<double>::infinity();
      across = std::max(across, off / right[k]);
    }
  }
  Real widest = 0;
  for (size_t k = 0; k < first.w.size(); ++k)
    widest = std::max(widest, std::hypot(first.x[k], first.y[k]) / first.w[k]);
  // Relatively, a radius errs by half of what its square does.
  const auto error = static_cast<double>(height + 0.5L * across * widest + moved);
  return std::isfinite(error) ? error : std::numeric_limits<double>::infinity();
}

// Of the widest bent line of control points: the normal of its plane, and the centre of the circle through
// its ends and its middle.
bool guess_axis(const std::vector<BezierPatch>& patches, bool arcs_in_u, Revolution* r) {
  double largest = 0;
  for (const BezierPatch& patch : patches) {
    if ((arcs_in_u ? patch.degree_u : patch.degree_v) < 2) continue;
    for (const double end : {0.0, 1.0}) {
      const auto at = [&](double t) {
        return arcs_in_u ? evaluate0(patch, t, end) : evaluate0(patch, end, t);
      };
      const Vec3 a = at(0), ab = at(0.5) - a, ac = at(1) - a, n = ab.cross(ac);
      if (!(n.norm() > largest)) continue;
      largest = n.norm();
      r->axis = n / largest;
      r->point =
          a + (ac.squaredNorm() * n.cross(ab) + ab.squaredNorm() * ac.cross(n)) / (2 * n.squaredNorm());
    }
  }
  return largest > 0;
}

// Of a body whose moments about two principal axes are alike, as those of a body of revolution are, the third
// one; none where all three are.
constexpr double kAlikeMoments = 1e-4;  // of the largest
bool guess_axis(const Mat3& inertia, Revolution* r) {
  const PrincipalFrame principal = principal_frame(inertia);
  const Vec3& m = principal.moments;  // ascending
  const double alike = kAlikeMoments * m[2];
  const bool low = m[1] - m[0] <= alike, high = m[2] - m[1] <= alike;
  if (low == high) return false;
  r->axis = principal.axes * Vec3::Unit(low ? 2 : 0);
  return true;
}

// Points of a patch on arcs about the axis: one line of parameters, from the profile's ends and inside.
constexpr int kOnArc = 6, kArcs = 5;
constexpr double kNoArcs = 1e-6;  // of the size: no refinement of the axis makes up for being off by more
using Ring = std::array<Point, kOnArc>;

// The Bernstein polynomials of a degree at `count` parameters from 0 to 1.
std::vector<Row> bases(int degree, int count) {
  std::vector<Row> all(count);
  for (int k = 0; k < count; ++k) {
    const Real t = static_cast<Real>(k) / (count - 1);
    for (int i = 0; i <= degree; ++i)
      all[k].push_back(static_cast<Real>(binomial(degree, i)) * std::pow(t, i) * std::pow(1 - t, degree - i));
  }
  return all;
}

std::vector<Ring> rings_of(const BezierPatch& patch, bool arcs_in_u) {
  const std::vector<Row> in_u = bases(patch.degree_u, arcs_in_u ? kOnArc : kArcs),
                         in_v = bases(patch.degree_v, arcs_in_u ? kArcs : kOnArc);
  std::vector<Ring> rings(kArcs);
  for (int l = 0; l < kArcs; ++l)
    for (int k = 0; k < kOnArc; ++k) {
      const Row &bu = in_u[arcs_in_u ? k : l], &bv = in_v[arcs_in_u ? l : k];
      Eigen::Matrix<Real, 4, 1> p = Eigen::Matrix<Real, 4, 1>::Zero();
      for (int i = 0; i <= patch.degree_u; ++i)
        for (int j = 0; j <= patch.degree_v; ++j) p += bu[i] * bv[j] * patch.point(i, j).cast<Real>();
      rings[l][k] = p.head<3>() / p[3];
    }
  return rings;
}

// Least squares of two unknowns.
struct Normals {
  Eigen::Matrix<Real, 2, 2> matrix = Eigen::Matrix<Real, 2, 2>::Zero();
  Eigen::Matrix<Real, 2, 1> right = Eigen::Matrix<Real, 2, 1>::Zero();
  void add(Real a, Real b, Real value) {
    const Eigen::Matrix<Real, 2, 1> row(a, b);
    matrix += row * row.transpose();
    right += value * row;
  }
  Point solve(const Axes& axes) const {  // along t and s
    if (!(std::abs(matrix.determinant()) > 0)) return Point::Zero();
    const Eigen::Matrix<Real, 2, 1> x = matrix.inverse() * right;
    return x[0] * axes.t + x[1] * axes.s;
  }
};

// The axis that all rings are nearest to being about: three points of one of them know it to some round-offs
// only. Lines that are off by more than `allowed`, a length, are none.
void settle_axis(const std::vector<BezierPatch>& patches, double size, double allowed, Revolution* r) {
  const Axes axes(*r);
  Normals tilt, shift;
  for (const BezierPatch& patch : patches) {
    Real least = std::numeric_limits<Real>::infinity();
    for (const bool arcs_in_u : {true, false}) {
      const std::vector<Ring> rings = rings_of(patch, arcs_in_u);
      Normals tilted = tilt, shifted = shift;
      Real off = 0;
      for (const Ring& ring : rings) {
        const auto radius = [&](const Point& x) {
          return std::hypot(axes.t.dot(x - axes.point), axes.s.dot(x - axes.point));
        };
        for (int k = 1; k < kOnArc; ++k) {
          const Point step = ring[k] - ring[0];
          const Real rise = axes.axis.dot(step), r0 = radius(ring[0]), rk = radius(ring[k]);
          off = std::max({off, std::abs(rise), std::abs(rk - r0)});
          tilted.add(axes.t.dot(step), axes.s.dot(step), -rise);
          if (!(std::min(r0, rk) > allowed)) continue;
          const Point e = (ring[k] - axes.point) / rk - (ring[0] - axes.point) / r0;
          shifted.add(axes.t.dot(e), axes.s.dot(e), rk - r0);
        }
      }
      least = std::min(least, off);
      if (!(off <= allowed)) continue;
      tilt = tilted;
      shift = shifted;
    }
    const double none = std::max(kNoArcs * size, allowed);
    if (least > none && out_of_plane(patch, r->axis) > none) return;  // no revolution
  }
  r->axis = (axes.axis + tilt.solve(axes)).normalized().cast<double>();
  r->point = (axes.point + shift.solve(axes)).cast<double>();
}

// An ellipsoid with two equal semi-axes, to round-off.
Revolution about_axis_of(const Ellipsoid& e, double size) {
  Revolution r;
  if (!e.found) return r;
  for (int k = 0; k < 3; ++k) {
    const double apart = std::abs(e.semi[(k + 1) % 3] - e.semi[(k + 2) % 3]);
    if (!(apart <= kArcError * size)) continue;
    r.found = true;
    r.axis = e.axes.col(k);
    r.error = 2 * (apart + e.error * size);
    return r;
  }
  return r;
}

}  // namespace

double out_of_plane(const BezierPatch& patch, const Vec3& axis) {
  double low = kFarAway, high = -kFarAway;
  for (const Vec4& p : patch.points) {
    const double z = axis.dot(p.head<3>()) / p[3];
    low = std::min(low, z);
    high = std::max(high, z);
  }
  return high - low;
}

Revolution find_revolution(const std::vector<BezierPatch>& patches, const Mat3& inertia, double size,
                           double allowed) {
  const double most = allowed * size;
  enum class From { arcs_in_u, arcs_in_v, moments };
  for (const From from : {From::arcs_in_u, From::arcs_in_v, From::moments}) {
    Revolution r;
    const bool guessed =
        from == From::moments ? guess_axis(inertia, &r) : guess_axis(patches, from == From::arcs_in_u, &r);
    if (!guessed) continue;
    for (int pass = 0; pass < 2; ++pass) settle_axis(patches, size, most, &r);  // the tilt moves the points
    for (const BezierPatch& patch : patches) {
      double error = out_of_plane(patch, r.axis);
      if (error > most) error = std::min(off_arcs(patch, true, r, most), off_arcs(patch, false, r, most));
      r.error = std::max(r.error, error);
      if (!(r.error <= most)) break;
    }
    if (!(r.error <= most)) continue;
    r.found = true;
    r.error *= 2;  // there and back
    return r;
  }
  return {};
}

Revolution find_revolution(const std::vector<BezierPatch>& patches, const Mat3& inertia,
                           const Ellipsoid& ellipsoid, double size) {
  const Revolution r = find_revolution(patches, inertia, size, kArcError);
  return r.found ? r : about_axis_of(ellipsoid, size);
}

}  // namespace nurbs

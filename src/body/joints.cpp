// Joints as polynomials of one variable; see joints.h.
#include "body/joints.h"

#include <algorithm>
#include <cmath>

#include "body/common_conic.h"
#include "body/connectivity.h"
#include "body/edge_polynomials.h"
#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

constexpr int kDentHalvings = 6;  // of an edge, in search of what bends up
constexpr double kBendNoise = 64;

using Scalars = Bernstein<double>;
using Vectors = Bernstein<Vec3>;

const auto kDot = [](const Vec3& x, const Vec3& y) { return x.dot(y); };

// Control points of the k-th row from an edge.
Homogeneous row(const BezierPatch& patch, int edge, int k) {
  Homogeneous points;
  const int n = edge < 2 ? patch.degree_v : patch.degree_u,
            depth = edge < 2 ? patch.degree_u : patch.degree_v;
  const int at = edge % 2 ? depth - k : k;
  for (int i = 0; i <= n; ++i) points.push_back(edge < 2 ? patch.point(at, i) : patch.point(i, at));
  return points;
}

// A polynomial along the far side of a link as one of the near side's parameter.
template <class T>
void count_as(const EdgeLink& link, Bernstein<T>* f) {
  reparametrise(link.ratio, f);
  if (link.reversed) std::reverse(f->begin(), f->end());
}

// A vector over a positive number, both polynomials.
struct Ratio {
  Vectors num;
  Scalars den;
  double upper() const {
    double most = 0;
    for (size_t i = 0; i < num.size(); ++i) most = std::max(most, num[i].norm() / den[i]);
    return most;
  }
  double at_ends() const {
    return std::max(num.front().norm() / den.front(), num.back().norm() / den.back());
  }
};

double bound(const Ratio& f, double reached, int depth) {
  const double upper = f.upper();
  reached = std::max(reached, f.at_ends());
  if (upper <= kJointTightness * reached || depth == 0) return upper;
  auto [n0, n1] = halve(f.num);
  auto [d0, d1] = halve(f.den);
  const double first = bound({std::move(n0), std::move(d0)}, reached, depth - 1);
  return std::max(
      first, bound({std::move(n1), std::move(d1)}, std::max(reached, first / kJointTightness), depth - 1));
}

// The part [from, to] of a curve.
Homogeneous part(const Homogeneous& curve, double from, double to) {
  const auto cut = [](Homogeneous c, double t, bool low) {
    const int n = static_cast<int>(c.size()) - 1;
    Homogeneous out(c);
    for (int i = 0; i <= n; ++i) {
      if (low)
        out[i] = c[0];
      else
        out[n - i] = c[n];
      for (int k = 0; k < n - i; ++k) {
        if (low) c[k] = (1 - t) * c[k] + t * c[k + 1];
      }
      if (!low)
        for (int k = n; k > i; --k) c[k] = (1 - t) * c[k - 1] + t * c[k];
    }
    return out;
  };
  // [0, to], then its upper part.
  Homogeneous low = cut(curve, to, true);
  return to > 0 ? cut(low, from / to, false) : low;
}

double bound_projected_gap(const BezierPatch& a, int edge, const BezierPatch& b, const EdgeLink& link) {
  const Homogeneous ca = row(a, edge, 0), cb = row(b, link.edge, 0);
  double gap = 0, before = link.reversed ? 1 : 0;
  double last_gap = (point_at(ca, 0) - point_at(cb, before)).norm();
  for (int k = 1; k <= kProjectedPieces; ++k) {
    const double t0 = (k - 1.0) / kProjectedPieces, t1 = double(k) / kProjectedPieces;
    const Vec2 at = edge_parameters(edge, t1);
    const double s = k == kProjectedPieces ? (link.reversed ? 0 : 1)
                                           : projected_parameter(b, link, evaluate0(a, at[0], at[1]));
    const double end_gap = (point_at(ca, t1) - point_at(cb, s)).norm();
    gap = std::max(gap, std::max(last_gap, end_gap) + stray(part(ca, t0, t1)) +
                            stray(part(cb, std::min(before, s), std::max(before, s))));
    before = s;
    last_gap = end_gap;
  }
  return std::min(gap, common_conic_gap(ca, cb, link.reversed, gap));
}

// Normal along an edge, outward, any length: w^3 (x_u cross x_v) of the homogeneous (X, w), by which it is
// w (X_u cross X_v) - w_v X_u cross X - w_u X cross X_v.
Vectors normal_along(const BezierPatch& patch, int edge) {
  Homogeneous here = row(patch, edge, 0), next = row(patch, edge, 1);
  const Vec4 first = here.front();
  count_from(first, &here);
  count_from(first, &next);
  const double n = edge < 2 ? patch.degree_u : patch.degree_v;
  Homogeneous across_edge = difference(next, here);
  for (Vec4& p : across_edge) p *= edge % 2 ? -n : n;
  const Homogeneous along = derivative(here);
  const Homogeneous &u = edge < 2 ? across_edge : along, &v = edge < 2 ? along : across_edge;
  const Vectors x = positions(here), xu = positions(u), xv = positions(v);
  Vectors sum = multiply(multiply(xu, xv, kCross), weights(here), kScale);
  sum = difference(sum, multiply(multiply(xu, x, kCross), weights(v), kScale));
  return difference(sum, multiply(multiply(x, xv, kCross), weights(u), kScale));
}

// Divides out the ends at which the normal vanishes: a pole lies there. Compared with the coefficients beside
// it: uneven parameters make those at the other end any size.
void remove_end_roots(Vectors* f) {
  const auto vanishes = [&] {
    const size_t last = std::min<size_t>(f->size() - 1, 3);
    double beside = 0;
    for (size_t k = 1; k <= last; ++k) beside = std::max(beside, (*f)[k].norm());
    return f->front().norm() <= kVanishing * beside;
  };
  for (int end = 0; end < 2; ++end) {
    while (f->size() > 1 && vanishes()) *f = without_root_at_0(*f);
    std::reverse(f->begin(), f->end());
  }
}

// Half-angle about `axis` of a cone that holds all coefficients, and so every value; infinite if none does.
double half_angle(const Vectors& f, Vec3* axis) {
  *axis = Vec3::Zero();
  for (const Vec3& x : f) *axis += x;
  double widest = 0;
  for (const Vec3& x : f) widest = std::max(widest, angle_between(*axis, x));
  return widest < 0.5 * M_PI && axis->norm() > 0 ? widest : kInfinity;
}

// Two normals and the edge's tangent along a part of a joint.
struct Meeting {
  Vectors a, b, along;
};

double angle_at_end(const Meeting& m, bool last) {
  return angle_between(last ? m.a.back() : m.a.front(), last ? m.b.back() : m.b.front());
}

void bound_meeting(const Meeting& m, int depth, double* opening, double* closing) {
  Vec3 axis_a, axis_b;
  double angle = half_angle(m.a, &axis_a) + half_angle(m.b, &axis_b) + angle_between(axis_a, axis_b);
  const Scalars dot = multiply(m.a, m.b, kDot);
  const Vectors cross = multiply(m.a, m.b, kCross);
  if (*std::min_element(dot.begin(), dot.end()) > 0)
    angle = std::min(angle, std::atan(Ratio{cross, dot}.upper()));
  const Scalars side = multiply(cross, m.along, kDot);
  const bool may_open = *std::max_element(side.begin(), side.end()) > 0,
             may_close = *std::min_element(side.begin(), side.end()) < 0;
  const double reached = std::max(angle_at_end(m, false), angle_at_end(m, true));
  const bool tight = angle <= kJointTightness * reached && may_open != may_close;
  const bool known = (!may_open || angle <= *opening) && (!may_close || angle <= *closing);
  if (tight || known || angle <= kNegligibleKink || depth == 0) {
    if (may_open) *opening = std::max(*opening, angle);
    if (may_close) *closing = std::max(*closing, angle);
    return;
  }
  auto [a0, a1] = halve(m.a);
  auto [b0, b1] = halve(m.b);
  auto [t0, t1] = halve(m.along);
  bound_meeting({std::move(a0), std::move(b0), std::move(t0)}, depth - 1, opening, closing);
  bound_meeting({std::move(a1), std::move(b1), std::move(t1)}, depth - 1, opening, closing);
}

// Along a part of an edge: a normal, and the curve's hodograph.
struct Bending {
  Vectors normal, hodograph;
};

void find_rising(const Bending& f, EdgePart range, int depth, std::vector<EdgePart>* parts) {
  const Scalars bend = multiply(f.normal, derivative(f.hodograph), kDot);
  const double noise = kBendNoise * kRoundoff * largest(f.normal) * largest(f.hodograph);
  if (*std::max_element(bend.begin(), bend.end()) <= noise) return;
  if (depth == 0) {
    parts->push_back(range);
    return;
  }
  auto [n0, n1] = halve(f.normal);
  auto [h0, h1] = halve(f.hodograph);
  const double middle = 0.5 * (range.from + range.to);
  find_rising({std::move(n0), std::move(h0)}, {range.from, middle}, depth - 1, parts);
  find_rising({std::move(n1), std::move(h1)}, {middle, range.to}, depth - 1, parts);
}

}  // namespace

double bound_joint_gap(const BezierPatch& a, int edge, const BezierPatch& b, const EdgeLink& link) {
  if (link.projected) return bound_projected_gap(a, edge, b, link);
  const Homogeneous ca = row(a, edge, 0);
  Homogeneous cb = row(b, link.edge, 0);
  count_as(link, &cb);
  const Ratio f{
      difference(multiply(positions(ca), weights(cb), kScale), multiply(positions(cb), weights(ca), kScale)),
      multiply(weights(ca), weights(cb), kProduct)};
  double size = 0;
  for (const Vec4& p : ca) size = std::max(size, p.head<3>().norm() / p[3]);
  const double upper = f.upper();
  return upper <= kJointRoundoff * size ? upper : bound(f, 0, kJointHalvings);
}

double bound_collapsed_edge(const BezierPatch& patch, int edge) {
  double most = 0;
  const Homogeneous points = row(patch, edge, 0);
  const Vec3 first = points.front().head<3>() / points.front()[3];
  for (const Vec4& p : points) most = std::max(most, (p.head<3>() / p[3] - first).norm());
  return 2 * most;
}

KinkBounds bound_kink(const BezierPatch& a, int edge, const BezierPatch& b, const EdgeLink& link) {
  KinkBounds bounds{kInfinity, kInfinity};
  if (link.projected) return bounds;
  Meeting m{normal_along(a, edge), normal_along(b, link.edge), {}};
  remove_end_roots(&m.a);
  remove_end_roots(&m.b);
  count_as(link, &m.b);
  // The tangent, any length, with a's surface on its left: w X' - X w'.
  Homogeneous here = row(a, edge, 0);
  count_from(Vec4(here.front()), &here);
  m.along = hodograph(here);
  if (edge == 0 || edge == 3)
    for (Vec3& t : m.along) t = -t;
  bounds = {0, 0};
  // Deeper than a gap: normals turn in a small part of uneven parameters.
  bound_meeting(m, 3 * kJointHalvings, &bounds.opening, &bounds.closing);
  return bounds;
}

double bound_pole_spread(const BezierPatch& patch, int edge) {
  const Homogeneous here = row(patch, edge, 0);
  const Vec3 pole = here.front().head<3>() / here.front()[3];
  const auto seen_from_pole = [&](int k) {
    Vectors q;
    for (const Vec4& p : row(patch, edge, k)) q.push_back(p.head<3>() - p[3] * pole);
    return q;
  };
  // Near the pole x = pole + u^k q / w, any factor, with q the first row, the k-th, that is not the pole too;
  // the normal is q cross q'.
  const int rows = edge < 2 ? patch.degree_u : patch.degree_v;
  const double far = largest(seen_from_pole(rows));
  Vectors q = seen_from_pole(1);
  for (int k = 2; k <= rows && largest(q) <= kVanishing * far; ++k) q = seen_from_pole(k);
  Vectors normal = multiply(q, derivative(q), kCross);
  const double size = largest(q);
  if (!(largest(normal) > kVanishing * size * size)) return kInfinity;
  remove_end_roots(&normal);
  Vec3 axis;
  return 2 * half_angle(normal, &axis);
}

std::vector<EdgePart> find_dented_parts(const BezierPatch& patch, int edge) {
  // Of even weights at both ends: uneven ones make uneven parts. The curve's derivative is N / w^2 with
  // the hodograph N, so that along a normal, square to N, its second one is that of N' / w^2.
  Homogeneous here = row(patch, edge, 0);
  const int degree = static_cast<int>(here.size()) - 1;
  const double ratio = std::pow(here.front()[3] / here.back()[3], 1.0 / degree);
  count_from(Vec4(here.front()), &here);
  Vectors normal = normal_along(patch, edge);
  reparametrise(ratio, &here);
  reparametrise(ratio, &normal);
  std::vector<EdgePart> parts;
  find_rising({normal, hodograph(here)}, {0, 1}, kDentHalvings, &parts);
  const auto at = [ratio](double t) { return ratio * t / (1 + (ratio - 1) * t); };
  for (EdgePart& part : parts) part = {at(part.from), at(part.to)};
  return parts;
}

}  // namespace nurbs

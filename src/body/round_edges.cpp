// Circles from the edges of patches, put together; see round_edges.h.
#include "body/round_edges.h"

#include <algorithm>
#include <cmath>

#include "body/connectivity.h"
#include "body/shape.h"
#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

constexpr double kSame = 1e-12;       // of the body's radius: positions
constexpr double kSameAngle = 1e-11;  // rad
constexpr double kFlattest = 1e-4;    // sine squared of half an arc's angle: flatter ones are none
constexpr double kWidest = 1e3;       // times the body's radius
constexpr double kError = 4 * kRoundoff;
constexpr int kMostEdges = 64;  // a body with more is left alone

using Curve = std::vector<Vec4>;  // homogeneous control points

// As one of lower degree, down to 2, while it is one (NURBS Book, section 5.6).
Curve reduced(Curve curve, double size) {
  for (int n = static_cast<int>(curve.size()) - 1; n > 2; --n) {
    Curve lower(n);
    lower[0] = curve[0];
    for (int k = 1; k < n; ++k) lower[k] = (n * curve[k] - k * lower[k - 1]) / (n - k);
    const Vec4 off = lower[n - 1] - curve[n];
    const double weight = kSame * curve[n][3];
    if (!(off.head<3>().norm() <= size * weight && std::abs(off[3]) <= weight)) break;
    curve = lower;
  }
  return curve;
}

// A rational quadratic of middle weight w, in standard form, is a circle's arc of half the angle acos w where
// its control polygon has equal legs and w is the cosine of the angle between a leg and the chord (NURBS
// Book, section 7.3).
bool find_circle(const Curve& c, double size, RoundEdges* out) {
  const double w = c[1][3] / std::sqrt(c[0][3] * c[2][3]), rest = 1 - w * w;
  if (!(w > 0 && rest > kFlattest)) return false;
  const Vec3 first = c[0].head<3>() / c[0][3], peak = c[1].head<3>() / c[1][3],
             last = c[2].head<3>() / c[2][3], chord = 0.5 * (first + last), up = peak - chord,
             half = 0.5 * (last - first);
  const double sine = std::sqrt(rest), radius = half.norm() / sine;
  const double off = std::hypot(up.dot(half) / radius, up.norm() - half.norm() * sine / w);
  if (!(radius > kSame * size && radius < kWidest * size && off <= kSame * size)) return false;
  const Vec3 along = up.normalized(), across = half.normalized();
  out->point = chord - radius * w * along;
  out->axis = along.cross(across);
  out->start = along;
  out->to = std::acos(w);
  out->from = -out->to;
  out->edges = {{radius, 0}};
  // The flatter the arc, the less its weights say of the radius.
  out->error = (off + kError * (half.norm() + up.norm())) / rest;
  return true;
}

bool same_azimuth(const Vec3& x, const Vec3& y) {
  return (x - y).norm() <= kSameAngle;
}
// Where b begins and ends, as a's azimuths run.
Vec3 begin_of(const RoundEdges& b, const RoundEdges& a) {
  return b.outward(a.axis.dot(b.axis) < 0 ? b.to : b.from);
}
Vec3 end_of(const RoundEdges& b, const RoundEdges& a) {
  return b.outward(a.axis.dot(b.axis) < 0 ? b.from : b.to);
}

// Whether a and b are parts of one circle that meet; a then is both.
bool join(RoundEdges* a, const RoundEdges& b, double size) {
  const double radius = a->edges[0].radius, tilt = a->axis.cross(b.axis).norm(),
               off = (a->point - b.point).norm() + std::abs(radius - b.edges[0].radius) + radius * tilt;
  if (a->whole() || !(off <= kSame * size)) return false;
  if (same_azimuth(a->outward(a->to), begin_of(b, *a)))
    a->to += b.to - b.from;
  else if (same_azimuth(a->outward(a->from), end_of(b, *a)))
    a->from -= b.to - b.from;
  else
    return false;
  a->error = std::max(a->error, b.error + off);
  if (a->to - a->from > 2 * M_PI - kSameAngle) a->to = a->from + 2 * M_PI;
  return true;
}

// Whether b's circle has a's axis and azimuths, and goes with a's.
bool group(RoundEdges* a, const RoundEdges& b, double size) {
  const Vec3 apart = b.point - a->point;
  const double z = a->axis.dot(apart), radius = b.edges[0].radius,
               off = (apart - z * a->axis).norm() + radius * a->axis.cross(b.axis).norm();
  if (!(off <= kSame * size) || a->whole() != b.whole()) return false;
  if (!a->whole() && !(same_azimuth(a->outward(a->from), begin_of(b, *a)) &&
                       std::abs(b.to - b.from - (a->to - a->from)) <= kSameAngle))
    return false;
  a->edges.push_back({radius, z});
  a->error = std::max(a->error, b.error + off);
  return true;
}

// Each taken by the first that does, over and over until none is.
template <class Take>
void merge(std::vector<RoundEdges>* all, const Take& take) {
  for (size_t before = all->size() + 1; all->size() < before;) {
    before = all->size();
    std::vector<RoundEdges> kept;
    for (const RoundEdges& e : *all)
      if (std::none_of(kept.begin(), kept.end(), [&](RoundEdges& other) { return take(&other, e); }))
        kept.push_back(e);
    *all = std::move(kept);
  }
}

}  // namespace

std::vector<RoundEdges> find_round_edges(const Shape& shape) {
  const double size = shape.bounding_radius;
  std::vector<RoundEdges> all;
  visit_creases(shape.links, [&](int patch, int edge) {
    const Curve curve = reduced(edge_net(shape.patches[patch], edge), size);
    RoundEdges found;
    if (curve.size() == 3 && find_circle(curve, size, &found)) all.push_back(found);
  });
  if (all.size() > kMostEdges) return {};
  merge(&all, [&](RoundEdges* a, const RoundEdges& b) { return join(a, b, size); });
  merge(&all, [&](RoundEdges* a, const RoundEdges& b) { return group(a, b, size); });
  for (RoundEdges& e : all) e.error += kError * size;
  return all;
}

}  // namespace nurbs

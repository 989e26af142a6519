// The contact points of a search that has ended; see polytope_search.h.
#include <algorithm>
#include <cmath>

#include "contact/overlap/polytope_search.h"

namespace nurbs {
namespace {

constexpr double kFacingBetter = 0.1;  // of kFacing, that better witnesses are to be off
constexpr int kMostFacing = 96;        // points spent on better ones
constexpr double kTilt = 1e-6;         // rad: what a support moves by tells faces from points
constexpr double kOnePoint = 1e-3;     // of the bounding radius, that it moves by where it is one

// Whether a point in the plane of the support along d, in the shape's axes, is beside the support, which is
// one point: not on a face or an edge.
bool is_beside(const HullPoints& points, double radius, const Vec3& d, const Vec3& x) {
  const Vec3 at = points.along(d).point, t = d.unitOrthogonal(), s = d.cross(t);
  if ((x - at).norm() < 2 * kOnePoint * radius) return false;
  for (const Vec3& way : {t, Vec3(-0.5 * t + 0.866 * s), Vec3(-0.5 * t - 0.866 * s)})
    if ((points.along((d + kTilt * way).normalized()).point - at).norm() > kOnePoint * radius) return false;
  return true;
}

}  // namespace

void set_gap(PolytopeResult* r) {
  const double apart = r->points.na.dot(r->points.b - r->points.a);
  r->gap = r->converged ? std::clamp(apart, r->bracket.lower, r->bracket.upper) : r->bracket.lower;
  part_points(r);
}

double off_each_other(const PolytopeResult& r) {
  return (r.points.b - r.points.a).cross(r.points.na).norm();
}

void use_supports(const PairFrame& pair, double tolerance, PolytopeResult* r) {
  const double off = off_each_other(*r);
  if (!(off > kFacing * pair.size)) return;
  PolytopeResult better = *r;
  const auto [a, b] = hull_supports(pair, r->points.na, nullptr, nullptr, tolerance);
  better.points = {a.where,      b.where,     pair.place_a(a.point), pair.place_b(b.point),
                   r->points.na, r->points.nb};
  part_points(&better);
  if (off_each_other(better) < off) *r = better;
}

PolytopeResult PolytopeSearch::result() {
  Vec3 a, b;
  find_witness(&a, &b);
  PolytopeResult r = with_points(a, b);
  use_supports(pair_, tolerance_, &r);
  return r;
}

bool PolytopeSearch::find_points(PolytopeResult* r) {
  lower_ = r->bracket.lower;
  upper_ = r->bracket.upper;
  direction_ = r->bracket.direction;
  if (!start(direction_)) return false;
  Vec3 a, b;
  FaceDistances distances;
  refine_pair(&distances, &a, &b);
  const int spent = r->iterations;
  *r = with_points(a, b);
  r->iterations += spent;
  return r->converged;
}

PolytopeResult PolytopeSearch::with_points(const Vec3& a, const Vec3& b) const {
  PolytopeResult r = bracket();
  r.points.na = direction_;
  r.points.nb = -direction_;
  const Witness& w = witness_[best_];
  // Onto the planes of the supports: means of others lie a little inside.
  r.points.a = a + (direction_.dot(w.a - a) + shrink_a_) * direction_;
  r.points.b = b + (direction_.dot(w.b - b) - shrink_b_) * direction_;
  r.points.on_a = surface_place(*pair_.a, w.on_a, direction_);
  r.points.on_b = surface_place(*pair_.b, w.on_b, pair_.direction_on_b(direction_));
  const double little = kFacing * pair_.size;
  r.inside = (direction_.dot(w.a - a) > little &&
              is_beside(points_a_, pair_.a->bounding_radius, direction_, r.points.a / pair_.scale_a)) ||
             (direction_.dot(b - w.b) > little &&
              is_beside(points_b_, pair_.b->bounding_radius, pair_.direction_on_b(direction_),
                        pair_.turn.transpose() * (r.points.b - pair_.offset) / pair_.scale_b));
  set_gap(&r);
  return r;
}

// What the witnesses of direction_ are to be apart: the origin's foot on the supporting plane. (Of a flat of
// the obstacle, which is several triangles, or of two equal minima other points would not face each other.)
Vec3 PolytopeSearch::target() const {
  return -(lower_ + shrink_) * direction_;
}

// Points of the bodies that are as nearly so as the supports along direction_ or one of the hull's
// triangles has them. About a minimum whose cap is proven the hull stays coarse, and what is given away
// there belongs to neither body: where the supports do not face each other, as on ruled lines, it is made
// again without; and a hull that closed with its first points, on faces, is made finer.
void PolytopeSearch::find_witness(Vec3* a, Vec3* b) {
  FaceDistances distances;
  if (find_nearest_pair(&distances, a, b).off <= kFacing * pair_.size) return;
  if (caps_ > 0) {
    drop_caps();
    Vec3 across;
    if (!start_from_points(0, &across)) return;
    distances.forget();
  }
  refine_pair(&distances, a, b);
}

void PolytopeSearch::refine_pair(FaceDistances* distances, Vec3* a, Vec3* b) {
  for (int k = 0; k < kMostFacing; ++k) {
    const Facing near = find_nearest_pair(distances, a, b);
    if (near.off <= std::max(kFacingBetter * kFacing * pair_.size, roundoff()) || near.face < 0) return;
    const int v = query(near.towards.normalized(), closest_of(hull_.face(near.face), direction_));
    if (v < 0 || hull_.grow(v, 0.0, near.face) != GrowingHull::Growth::grown) return;
  }
}

PolytopeSearch::Facing PolytopeSearch::find_nearest_pair(FaceDistances* distances, Vec3* a, Vec3* b) const {
  const Vec3 target = this->target();
  *a = witness_[best_].a;
  *b = witness_[best_].b;
  Facing near{(*a - *b - target).norm()};
  const auto is_cap = [&](short v) { return witness_[v].cap; };
  const auto [face, distance2] = distances->nearest(hull_, target, is_cap);
  if (face < 0) return near;
  const std::array<short, 3>& vertex = hull_.face(face).vertex;
  const Vec3 &p = hull_.point(vertex[0]), &q = hull_.point(vertex[1]), &r = hull_.point(vertex[2]);
  const Vec3 w = nearest_on_triangle(p - target, q - target, r - target);
  near.face = face;
  near.towards = target - (w[0] * p + w[1] * q + w[2] * r);
  if (!(std::sqrt(distance2) < near.off)) return near;
  near.off = std::sqrt(distance2);
  *a = *b = Vec3::Zero();
  for (int i = 0; i < 3; ++i) {
    *a += w[i] * witness_[vertex[i]].a;
    *b += w[i] * witness_[vertex[i]].b;
  }
  return near;
}

}  // namespace nurbs

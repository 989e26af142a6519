// See flat_search.h.
#include "contact/flat_search.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "body/flat_faces.h"

namespace nurbs {
namespace {

constexpr double kNearFace = 0.995;  // cosine between a face's normal and the direction given: 6 degrees
constexpr double kCrossing = 1e-3;   // sine of the angle between creases
constexpr double kMostAlong = 0.1;   // cosine between a crease and the direction given

// What the proof wants of the disc and the offset.
bool is_least(const PairFrame& pair, const Vec3& n, double overlap, double m) {
  if (!(m > 0)) return false;
  if (!(overlap > 0)) return true;
  const double along = pair.offset.dot(n), across = (pair.offset - along * n).norm();
  if (!(along >= overlap)) return false;
  const double norm2 = m * m + overlap * overlap;
  const double cosine = (overlap * overlap - m * m) / norm2, sine = 2 * m * overlap / norm2;
  return -along * cosine - across * sine >= overlap;
}

// The overlap along n between a point of A and one of B, at least as deep as the contact's, and at most it
// plus `excess`.
bool meet_along(const PairFrame& pair, const Vec3& n, const PointPair& points, double excess, double slack,
                double tolerance, JointSolution* s) {
  const double gap = n.dot(points.b - points.a);
  const double noise = slack + pair.joint_slack() + pair.roundoff;
  const Bracket bracket{gap - excess - noise, gap + noise, n, 0, 0};
  if (!(bracket.width() <= tolerance)) return false;
  s->set_met(points, bracket, 1);
  return true;
}

bool is_on(const Shape& shape, const FlatFace& face, const SurfacePoint& at) {
  const Vec3 x = evaluate0(shape.patches[at.patch], at.u, at.v);
  return std::abs(face.normal.dot(x) - face.offset) <= kFlatness * shape.bounding_radius;
}

// Owner: whose face it is, 0 for A.
bool meet_face(const PairFrame& pair, const Vec3& direction, int owner, double tolerance, JointSolution* s) {
  const bool of_a = owner == 0;
  const Shape &flat = of_a ? *pair.a : *pair.b, &other = of_a ? *pair.b : *pair.a;
  const Vec3 asked = of_a ? direction : pair.direction_on_b(direction);
  const int number = nearest_face(flat.flats, asked, kNearFace);
  if (number < 0) return false;
  const FlatFace& face = flat.flats.faces[number];
  const double scale = of_a ? pair.scale_a : pair.scale_b, other_scale = of_a ? pair.scale_b : pair.scale_a;
  const Vec3 outward = of_a ? face.normal : Vec3(pair.turn * face.normal);
  const Vec3 n = of_a ? outward : Vec3(-outward);  // from A to B
  const Vec3 into_other = of_a ? pair.direction_on_b(n) : n;
  const SurfacePoint& start = of_a ? s->points.on_b : s->points.on_a;
  const Support top = find_hull_support(other, into_other, &start, kSupportShare * tolerance / other_scale);
  const Vec3 y = of_a ? pair.place_b(top.point) : pair.place_a(top.point);
  const Vec3 y_on_face = (of_a ? y : Vec3(pair.turn.transpose() * (y - pair.offset))) / scale;

  const double inside = scale * face.sides.depth_inside(face.project(y_on_face));
  const double overlap = scale * (face.offset - face.normal.dot(y_on_face));
  if (!is_least(pair, n, overlap, inside)) return false;
  const Vec3 x = y + overlap * outward;
  PointPair points;
  points.a = of_a ? x : y;
  points.b = of_a ? y : x;
  // Where on the face matters to none; another search that begins there likes it near.
  const SurfacePoint& last = of_a ? s->points.on_a : s->points.on_b;
  const bool stays = last.patch >= 0 && is_on(flat, face, last);
  const SurfacePoint on_face = stays ? last : SurfacePoint{face.patch, 0.5, 0.5};
  points.on_a = of_a ? on_face : top.where;
  points.on_b = of_a ? top.where : on_face;
  return meet_along(pair, n, points, other_scale * (top.upper - top.h), scale * face.slack, tolerance, s);
}

// The crease that lies furthest along d, of those about square to it; nullptr without one.
const StraightEdge* furthest_crease(const FlatFeatures& flats, const Vec3& d) {
  const StraightEdge* best = nullptr;
  double most = -std::numeric_limits<double>::infinity();
  for (const StraightEdge& edge : flats.edges) {
    if (std::abs(edge.direction.dot(d)) > kMostAlong) continue;
    const double height = d.dot(flats.vertices[edge.ends[0]] + flats.vertices[edge.ends[1]]);
    if (height > most) most = height, best = &edge;
  }
  return best;
}

bool meet_creases(const PairFrame& pair, const Vec3& direction, double tolerance, JointSolution* s) {
  const FlatFeatures &flats_a = pair.a->flats, &flats_b = pair.b->flats;
  const StraightEdge* edge_a = furthest_crease(flats_a, direction);
  if (edge_a == nullptr) return false;
  const StraightEdge* edge_b = furthest_crease(flats_b, pair.direction_on_b(direction));
  if (edge_b == nullptr) return false;
  const Vec3 u = edge_a->direction, v = pair.turn * edge_b->direction;
  const Vec3 square = u.cross(v);
  const double sine = square.norm();
  if (!(sine > kCrossing)) return false;
  const Vec3 n = square.dot(direction) > 0 ? Vec3(square / sine) : Vec3(-square / sine);
  if (!(n.dot(direction) > kNearFace)) return false;

  // x on A's crease and y on B's, where y - x is along n.
  const auto &ends_a = edge_a->ends, &ends_b = edge_b->ends;
  const Vec3 x0 = pair.place_a(flats_a.vertices[ends_a[0]]), y0 = pair.place_b(flats_b.vertices[ends_b[0]]);
  const double length_a = pair.scale_a * (flats_a.vertices[ends_a[1]] - flats_a.vertices[ends_a[0]]).norm(),
               length_b = pair.scale_b * (flats_b.vertices[ends_b[1]] - flats_b.vertices[ends_b[0]]).norm();
  const Vec3 apart = y0 - x0, normal = square / (sine * sine);
  const double to_x = apart.cross(v).dot(normal), to_y = apart.cross(u).dot(normal);
  const double margin = std::min({to_x, length_a - to_x, to_y, length_b - to_y});
  PointPair points;
  points.a = x0 + to_x * u;
  points.b = y0 + to_y * v;
  const double overlap = n.dot(points.a - points.b);
  if (!is_least(pair, n, overlap, margin * sine)) return false;
  const auto [a, b] = hull_supports(pair, n, &s->points.on_a, &s->points.on_b, tolerance);
  points.on_a = a.where;
  points.on_b = b.where;
  const double p = pair.overlap_along(n, a.upper, b.upper);
  return meet_along(pair, n, points, std::max(0.0, p - overlap),
                    pair.scale_a * edge_a->slack + pair.scale_b * edge_b->slack, tolerance, s);
}

}  // namespace

bool meet_flat(const PairFrame& pair, const Vec3& direction, double tolerance, JointSolution* s) {
  if (!pair.a->flats.faces.empty() && meet_face(pair, direction, 0, tolerance, s)) return true;
  if (!pair.b->flats.faces.empty() && meet_face(pair, direction, 1, tolerance, s)) return true;
  return !pair.a->flats.edges.empty() && !pair.b->flats.edges.empty() &&
         meet_creases(pair, direction, tolerance, s);
}

}  // namespace nurbs

// Support sets (flat_faces.h): straight lines of constant normal followed across patches, and the choice
// between face, crease, line and point.
#include <algorithm>
#include <cmath>

#include "body/connectivity.h"
#include "body/shape.h"
#include "body/support.h"

namespace nurbs {
namespace {

constexpr double kBesideJoint = 1e-7;    // a parameter this near 0 or 1 may belong to the neighbour
constexpr double kStraightOn = 1e-8;     // rad, between the pieces of a line, and of their normals
constexpr double kTopParameter = 1e-15;  // to which the highest point of an edge is known
constexpr int kMostPieces = 16;          // patches that a line may cross to each side
constexpr double kLineAngle = M_PI / 4;  // nor is a line whose normal is further away
constexpr double kFaceCosine = 0.5;      // a face further away than 60 degrees is not asked
// Of the tolerance, that the nearest point of a feature may lag behind the support: half the overlap where a
// polygon is remade; where a ruled line has the support, a twentieth.
constexpr double kLag = 1.0 / 24, kNoLag = 1.0 / 240;

// Edge of a patch that ends its rulings, low or high.
int end_edge(Ruling ruling, bool high) {
  return (ruling == Ruling::along_u ? 0 : 2) + (high ? 1 : 0);
}

Vec3 normal_at(const Shape& shape, const SurfacePoint& at) {
  const Jet1 j = evaluate1(shape.patches[at.patch], at.u, at.v);
  return j.su.cross(j.sv).normalized();
}

// Follows the ruling of `at` to its low or high end, across patches while it goes straight on.
Vec3 follow(const Shape& shape, SurfacePoint at, bool high) {
  Vec3 end = Vec3::Zero();
  for (int piece = 0; piece < kMostPieces; ++piece) {
    const Ruling ruling = shape.flats.ruling[at.patch];
    const bool along_u = ruling == Ruling::along_u;
    SurfacePoint last = at;
    (along_u ? last.u : last.v) = high ? 1 : 0;
    const Vec3 from =
        evaluate0(shape.patches[at.patch], along_u ? 1 - last.u : last.u, along_u ? last.v : 1 - last.v);
    end = evaluate0(shape.patches[at.patch], last.u, last.v);
    const int edge = end_edge(ruling, high);
    const EdgeLink& link = shape.links[at.patch][edge];
    if (link.patch < 0 || link.collapsed || std::abs(link.kink) > kSmoothKink) return end;
    const Ruling next = shape.flats.ruling[link.patch];
    if (next == Ruling::none) return end;
    const bool starts_low = link.edge == end_edge(next, false);
    if (!starts_low && link.edge != end_edge(next, true)) return end;
    const SurfacePoint there = across(shape.patches, link, last, edge);
    SurfacePoint far = there;
    (next == Ruling::along_u ? far.u : far.v) = starts_low ? 1 : 0;
    const Vec3 on = evaluate0(shape.patches[far.patch], far.u, far.v) - end;
    if (angle_between(on, end - from) > kStraightOn) return end;
    at = there;
    high = starts_low;
  }
  return end;
}

bool line_through(const Shape& shape, SurfacePoint at, const Vec3& d, double angle, RuledLine* line) {
  const Ruling ruling = shape.flats.ruling[at.patch];
  if (ruling == Ruling::none) return false;
  // The normal is the same all along; in the middle it is safe from poles.
  (ruling == Ruling::along_u ? at.u : at.v) = 0.5;
  if (!(angle_between(normal_at(shape, at), d) <= angle)) return false;
  line->ends[0] = follow(shape, at, false);
  line->ends[1] = follow(shape, at, true);
  return true;
}

// Whether a point is where all rulings of its patch meet.
bool is_at_tip(const Shape& shape, const SurfacePoint& at) {
  const Ruling ruling = shape.flats.ruling[at.patch];
  if (ruling == Ruling::none) return false;
  const double t = ruling == Ruling::along_u ? at.u : at.v;
  return std::min(t, 1 - t) <= kBesideJoint && shape.links[at.patch][end_edge(ruling, t > 0.5)].collapsed;
}

// Where d . x is highest on an edge whose other points fall off to both sides: by the sign of the slope.
double top_of_edge(const BezierPatch& patch, int edge, const Vec3& d) {
  const auto slope = [&](double t) {
    const Vec2 at = edge_parameters(edge, t);
    const Jet1 j = evaluate1(patch, at[0], at[1]);
    return d.dot(edge < 2 ? j.sv : j.su);
  };
  if (!(slope(0) > 0)) return 0;
  if (!(slope(1) < 0)) return 1;
  double low = 0, high = 1;
  while (high - low > kTopParameter) {
    const double middle = 0.5 * (low + high);
    (slope(middle) > 0 ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

// Of the rulings that meet at a tip, which has the support, the one whose other end is highest along d. `at`:
// the tip, as one of the patches round it has it.
SurfacePoint at_tip(const Shape& shape, SurfacePoint at, const Vec3& d) {
  int from = -1;  // the side by which the patch was entered
  for (int piece = 0; piece < kMostPieces; ++piece) {
    const Ruling ruling = shape.flats.ruling[at.patch];
    const bool along_u = ruling == Ruling::along_u;
    const double tip = std::round(along_u ? at.u : at.v);
    double& round = along_u ? at.v : at.u;
    round = top_of_edge(shape.patches[at.patch], end_edge(ruling, tip == 0), d);
    if (round > 0 && round < 1) return at;
    const int side = end_edge(along_u ? Ruling::along_v : Ruling::along_u, round == 1);
    const EdgeLink& link = shape.links[at.patch][side];
    if (side == from || link.patch < 0 || link.collapsed) return at;
    const Ruling next = shape.flats.ruling[link.patch];
    if (next == Ruling::none || link.edge == end_edge(next, false) || link.edge == end_edge(next, true))
      return at;
    const SurfacePoint there = across(shape.patches, link, at, side);
    if (!is_at_tip(shape, there)) return at;
    from = link.edge;
    at = there;
  }
  return at;
}

void set_point(SupportSet& set, int i, const Vec3& point, int vertex) {
  set.point[i] = point;
  set.vertex[i] = vertex;
}

// Whether a neighbour's rulings end at the joint.
bool ends_ruling(const Shape& shape, const EdgeLink& link) {
  const Ruling ruling = shape.flats.ruling[link.patch];
  return ruling != Ruling::none &&
         (link.edge == end_edge(ruling, false) || link.edge == end_edge(ruling, true));
}

// Calls visit(line) for the lines of a sphero-polyhedron that end at the ball which has the support along d,
// each where its normal is nearest to d, and no further away than the angle.
template <class Visit>
void each_core_line(const SpheroPolyhedron& core, const Vec3& d, double angle, Visit visit) {
  const int top = core.support(d);
  const double least = std::cos(angle);
  for (const SpheroPolyhedron::Edge& edge : core.edges) {
    if (edge.ends[0] != top && edge.ends[1] != top) continue;
    const Vec3 round = edge.along.cross(d);  // square to both
    Vec3 normal;
    if (round.dot(edge.from) <= 0 && round.dot(edge.to) >= 0 && round.squaredNorm() > 0)
      normal = round.cross(edge.along).normalized();
    else
      normal = d.dot(edge.from) > d.dot(edge.to) ? edge.from : edge.to;
    if (!(normal.dot(d) >= least)) continue;
    visit(RuledLine{{core.points[edge.ends[0]] + core.radius * normal,
                     core.points[edge.ends[1]] + core.radius * normal}});
  }
}

// Calls visit(line) for the ruled lines through a surface point and beside it.
template <class Visit>
void each_line(const Shape& shape, const SurfacePoint& at, const Vec3& d, double angle, Visit visit) {
  if (shape.flats.ruling.empty()) return;
  if (!shape.core.edges.empty()) return each_core_line(shape.core, d, angle, visit);
  const auto try_at = [&](const SurfacePoint& place) {
    RuledLine line;
    if (line_through(shape, place, d, angle, &line)) visit(line);
  };
  try_at(is_at_tip(shape, at) ? at_tip(shape, at, d) : at);
  for (int edge = 0; edge < 4; ++edge) {
    const double off = edge == 0 ? at.u : edge == 1 ? 1 - at.u : edge == 2 ? at.v : 1 - at.v;
    const EdgeLink& link = shape.links[at.patch][edge];
    if (link.patch < 0 || link.collapsed) continue;
    if (off > kBesideJoint && !ends_ruling(shape, link)) continue;
    SurfacePoint on_edge = at;
    (edge < 2 ? on_edge.u : on_edge.v) = edge % 2;
    try_at(across(shape.patches, link, on_edge, edge));
  }
}

}  // namespace

bool ruled_line(const Shape& shape, const SurfacePoint& at, const Vec3& d, double angle, RuledLine* line) {
  double best = -kInfinity;
  each_line(shape, at, d, angle, [&](const RuledLine& other) {
    const double lowest = std::min(d.dot(other.ends[0]), d.dot(other.ends[1]));
    if (lowest > best) best = lowest, *line = other;
  });
  return best > -kInfinity;
}

double turn_to_ruled_line(const Shape& shape, const SurfacePoint& where, const Vec3& d) {
  double least = kLineAngle;
  each_line(shape, where, d, kLineAngle, [&](const RuledLine& line) {
    const Vec3 way = line.ends[1] - line.ends[0];
    least = std::min(least, std::abs(d.dot(way)) / way.norm());  // the sine, below the angle
  });
  return least;
}

SupportSet support_set(const Shape& shape, const Vec3& d, double tolerance) {
  const FlatFeatures& flats = shape.flats;
  const Support support = find_feature_top(shape, d);
  SupportSet set;
  set.where = support.where;
  set.h = support.h;
  set.support = support.point;
  const double slack = kFlatness * shape.bounding_radius;
  const auto inside = [&](const Vec3& x) { return d.dot(x) >= set.h - tolerance; };
  const auto bears = [&](const Vec3& x) { return d.dot(x) >= set.h - kLag * tolerance - slack; };
  const auto bears_all = [&](const Vec3& x) { return d.dot(x) >= set.h - kNoLag * tolerance - slack; };

  const int f = nearest_face(flats, d, kFaceCosine);
  if (f >= 0) {
    const std::vector<int>&corners = flats.faces[f].corners, &outline = flats.faces[f].outline;
    if (std::all_of(corners.begin(), corners.end(), [&](int v) { return inside(flats.vertices[v]); }) &&
        std::any_of(outline.begin(), outline.end(), [&](int v) { return bears(flats.vertices[v]); })) {
      for (const int v : corners) set_point(set, set.count++, flats.vertices[v], v);
      set.face = f;
      return set;
    }
  }
  double best = -kInfinity;
  for (const StraightEdge& edge : flats.edges) {
    const Vec3 &p = flats.vertices[edge.ends[0]], &q = flats.vertices[edge.ends[1]];
    if (!inside(p) || !inside(q) || !(bears(p) || bears(q)) || d.dot(p + q) <= best) continue;
    best = d.dot(p + q);
    set_point(set, 0, p, edge.ends[0]);
    set_point(set, 1, q, edge.ends[1]);
    set.count = 2;
  }
  if (set.count > 0 && (bears_all(set.point[0]) || bears_all(set.point[1]))) return set;
  RuledLine line;
  if (ruled_line(shape, support.where, d, kLineAngle, &line) && inside(line.ends[0]) &&
      inside(line.ends[1])) {
    set_point(set, 0, line.ends[0], -1);
    set_point(set, 1, line.ends[1], -1);
    set.count = 2;
    set.ruled = true;
    return set;
  }
  if (set.count > 0) return set;
  set_point(set, 0, support.point, -1);
  set.count = 1;
  return set;
}

double feature_lag(const Shape& shape, const Vec3& d, double h, const SurfacePoint& where) {
  const FlatFeatures& flats = shape.flats;
  double highest = -kInfinity;  // of the features' lowest points
  const int f = nearest_face(flats, d, kFaceCosine);
  if (f >= 0) {
    double lowest = kInfinity;
    for (const int v : flats.faces[f].corners) lowest = std::min(lowest, d.dot(flats.vertices[v]));
    highest = lowest;
  }
  for (const StraightEdge& edge : flats.edges)
    highest =
        std::max(highest, std::min(d.dot(flats.vertices[edge.ends[0]]), d.dot(flats.vertices[edge.ends[1]])));
  RuledLine line;
  if (ruled_line(shape, where, d, kLineAngle, &line))
    highest = std::max(highest, std::min(d.dot(line.ends[0]), d.dot(line.ends[1])));
  return h - highest;
}

}  // namespace nurbs

// Faces: planar patches grouped through links, their outline, area and centroid. Creases: straight edges with
// a kink, collinear pieces joined. Rulings: sampled.
#include "body/flat_faces.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "body/connectivity.h"
#include "body/local_form.h"
#include "body/shape.h"
#include "body/support.h"

namespace nurbs {
namespace {

constexpr int kCurveSamples = 32;           // per boundary curve
constexpr int kRulingSamples = 8;           // per parameter of a patch, intervals
constexpr double kSameNormal = 1e-9;        // rad, along a ruling
constexpr double kLeastSlenderness = 1e-9;  // of a ruling's length and a face's width, in bounding radii

Vec3 control_point(const Vec4& p) {
  return p.head<3>() / p[3];
}

struct Plane {
  Vec3 normal;
  double offset;
};

bool lies_in(const BezierPatch& patch, const Plane& plane, double tolerance) {
  return std::all_of(patch.points.begin(), patch.points.end(), [&](const Vec4& p) {
    return std::abs(plane.normal.dot(control_point(p)) - plane.offset) <= tolerance;
  });
}

Plane middle_plane(const BezierPatch& patch) {
  const LocalForm form = local_form(patch, 0.5, 0.5);
  return {form.normal, form.normal.dot(form.point)};
}

// One edge of a patch as a curve, the face to its left.
struct BoundaryCurve {
  const BezierPatch* patch;
  int edge;
  bool straight;

  bool backwards() const { return edge == 0 || edge == 3; }
  double parameter(double t) const { return backwards() ? 1 - t : t; }
  Vec3 point(double t) const {
    const Vec2 at = edge_parameters(edge, parameter(t));
    return evaluate0(*patch, at[0], at[1]);
  }
  Vec3 tangent(double t) const {
    const Vec2 at = edge_parameters(edge, parameter(t));
    const Jet1 j = evaluate1(*patch, at[0], at[1]);
    const Vec3 along = edge < 2 ? j.sv : j.su;
    return backwards() ? Vec3(-along) : along;
  }
};

// Control points of a patch's edge.
std::vector<Vec3> edge_points(const BezierPatch& patch, int edge) {
  std::vector<Vec3> points;
  for (const Vec4& p : edge_net(patch, edge)) points.push_back(control_point(p));
  return points;
}

// How far points are from the line through `from` along a unit vector.
double beside(const std::vector<Vec3>& points, const Vec3& from, const Vec3& along) {
  double most = 0;
  for (const Vec3& x : points) most = std::max(most, (x - from).cross(along).norm());
  return most;
}

bool is_straight(const BezierPatch& patch, int edge, double tolerance) {
  const std::vector<Vec3> points = edge_points(patch, edge);
  return beside(points, points.front(), (points.back() - points.front()).normalized()) <= tolerance;
}

// Calls visit(curve, t, weight) at Gauss points of all curves.
template <class Visit>
void integrate(const std::vector<BoundaryCurve>& boundary, const Visit& visit) {
  constexpr int kPieces = 16;
  constexpr double kNode[3] = {0.1127016653792583, 0.5, 0.8872983346207417};
  constexpr double kWeight[3] = {5.0 / 18, 8.0 / 18, 5.0 / 18};
  for (const BoundaryCurve& curve : boundary)
    for (int i = 0; i < kPieces; ++i)
      for (int k = 0; k < 3; ++k) visit(curve, (i + kNode[k]) / kPieces, kWeight[k] / kPieces);
}

// Parameter of the point of a curve furthest along e: the best sample, then golden-section search beside it.
double furthest_parameter(const BoundaryCurve& curve, const Vec3& e) {
  const int samples = curve.straight ? 1 : kCurveSamples;
  int best = 0;
  double most = -std::numeric_limits<double>::infinity();
  for (int k = 0; k <= samples; ++k) {
    const double f = e.dot(curve.point(k / double(samples)));
    if (f > most) most = f, best = k;
  }
  if (curve.straight) return best;
  double lo = std::max(0, best - 1) / double(samples), hi = std::min(samples, best + 1) / double(samples);
  // On the slope, not on the value, whose maximum is flat.
  if (e.dot(curve.tangent(lo)) <= 0) return lo;
  if (e.dot(curve.tangent(hi)) >= 0) return hi;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (lo + hi);
    (e.dot(curve.tangent(middle)) > 0 ? lo : hi) = middle;
  }
  return 0.5 * (lo + hi);
}

// Convex hull by monotone chain (Andrew 1979), collinear points dropped; counterclockwise.
std::vector<Vec2> convex_hull(std::vector<Vec2> points, double tolerance) {
  std::sort(points.begin(), points.end(),
            [](const Vec2& a, const Vec2& b) { return a[0] < b[0] || (a[0] == b[0] && a[1] < b[1]); });
  const auto chain = [&](auto first, auto last) {
    std::vector<Vec2> out;
    for (auto p = first; p != last; ++p) {
      while (!out.empty() && (*p - out.back()).norm() <= tolerance) out.pop_back();
      while (out.size() > 1) {
        const Vec2 a = out[out.size() - 2], along = *p - a;
        if (cross2(along, out.back() - a) < -tolerance * along.norm()) break;
        out.pop_back();
      }
      out.push_back(*p);
    }
    return out;
  };
  std::vector<Vec2> hull = chain(points.begin(), points.end());
  const std::vector<Vec2> upper = chain(points.rbegin(), points.rend());
  const auto add = [&](const Vec2& p) {
    for (const Vec2& q : hull)
      if ((p - q).norm() <= tolerance) return;
    hull.push_back(p);
  };
  for (const Vec2& p : upper) add(p);
  return hull;
}

class FaceFinder {
 public:
  explicit FaceFinder(const Shape& shape) : shape_(shape), tolerance_(kFlatness * shape.bounding_radius) {}

  FlatFeatures run() {
    find_faces();
    find_edges();
    find_rulings();
    return std::move(out_);
  }

 private:
  int vertex(const Vec3& x) {
    for (size_t i = 0; i < out_.vertices.size(); ++i)
      if ((out_.vertices[i] - x).norm() <= 4 * tolerance_) return static_cast<int>(i);
    out_.vertices.push_back(x);
    return static_cast<int>(out_.vertices.size()) - 1;
  }

  void find_faces() {
    const int patches = static_cast<int>(shape_.patches.size());
    group_.assign(patches, -1);
    std::vector<char> seen(patches, 0);
    for (int seed = 0; seed < patches; ++seed) {
      if (seen[seed]) continue;
      const Plane plane = middle_plane(shape_.patches[seed]);
      if (!lies_in(shape_.patches[seed], plane, tolerance_)) continue;
      std::vector<int> group = {seed};
      seen[seed] = 1;
      for (size_t k = 0; k < group.size(); ++k)
        for (const EdgeLink& link : shape_.links[group[k]]) {
          if (link.patch < 0 || seen[link.patch]) continue;
          if (!lies_in(shape_.patches[link.patch], plane, 2 * tolerance_)) continue;
          seen[link.patch] = 1;
          group.push_back(link.patch);
        }
      add_face(group);
    }
  }

  std::vector<BoundaryCurve> boundary_of(const std::vector<int>& group, int label) const {
    std::vector<BoundaryCurve> boundary;
    for (const int p : group)
      for (const int edge : {2, 1, 3, 0}) {
        const EdgeLink& link = shape_.links[p][edge];
        if (link.collapsed || (link.patch >= 0 && group_[link.patch] == label)) continue;
        boundary.push_back({&shape_.patches[p], edge, is_straight(shape_.patches[p], edge, tolerance_)});
      }
    return boundary;
  }

  void add_face(const std::vector<int>& group) {
    const int label = group[0];
    for (const int p : group) group_[p] = label;
    const std::vector<BoundaryCurve> boundary = boundary_of(group, label);
    FlatFace face;
    Vec3 twice_area = Vec3::Zero(), middle = Vec3::Zero();
    for (const BoundaryCurve& curve : boundary) middle += curve.point(0) / double(boundary.size());
    integrate(boundary, [&](const BoundaryCurve& curve, double t, double weight) {
      twice_area += weight * (curve.point(t) - middle).cross(curve.tangent(t));
    });
    face.area = 0.5 * twice_area.norm();
    if (!(face.area > kLeastSlenderness * std::pow(shape_.bounding_radius, 2))) return;
    face.normal = twice_area.normalized();
    face.centroid = middle;
    double total = 0, offset = 0;
    Vec3 sum = Vec3::Zero();
    integrate(boundary, [&](const BoundaryCurve& curve, double t, double weight) {
      const Vec3 x = curve.point(t), arm = x - middle;
      const double twice = weight * face.normal.dot(arm.cross(curve.tangent(t)));
      sum += twice / 3 * arm;  // of the triangle middle, x, x + dx: its area times its centroid
      total += weight;
      offset += weight * face.normal.dot(x);
    });
    face.centroid += sum / face.area;
    face.offset = offset / total;
    // On the hull, or no place to stand on.
    const Support top = find_hull_support(shape_, face.normal);
    if (top.h > face.offset + 4 * tolerance_ || !(face.offset > 0)) return;
    face.patch = label;
    face.slack = top.upper - face.offset;
    for (const int p : group)
      for (const Vec4& point : shape_.patches[p].points)
        face.slack = std::max(face.slack, std::abs(face.normal.dot(control_point(point)) - face.offset));
    const Vec3 arm = boundary[0].point(0) - face.centroid;
    face.axis_u = (arm - arm.dot(face.normal) * face.normal).normalized();
    outline(boundary, face);
    if (face.outline.size() < 3) return;
    thin_outline(face);
    out_.faces.push_back(face);
  }

  // Exact corners where the outline has few straight sides, else points furthest along equal directions.
  void outline(const std::vector<BoundaryCurve>& boundary, FlatFace& face) {
    bool straight = true;
    std::vector<Vec2> ends;
    for (const BoundaryCurve& curve : boundary) {
      straight = straight && curve.straight;
      ends.push_back(face.project(curve.point(0)));
      ends.push_back(face.project(curve.point(1)));
    }
    std::vector<Vec2> corners;
    if (straight) corners = convex_hull(ends, tolerance_);
    if (!straight || corners.size() > kOutlinePoints) {
      face.round = true;
      corners.clear();
      for (int k = 0; k < kOutlinePoints; ++k) corners.push_back(furthest_point(boundary, face, k));
      corners = convex_hull(corners, tolerance_);
    }
    for (const Vec2& c : corners) {
      const Vec3 x = face.offset * face.normal + lifted(face, c);
      face.outline.push_back(vertex(x));
    }
    // The corner first along axis_u opens the list.
    const auto first = std::max_element(face.outline.begin(), face.outline.end(), [&](int a, int b) {
      return face.axis_u.dot(out_.vertices[a]) < face.axis_u.dot(out_.vertices[b]);
    });
    std::rotate(face.outline.begin(), first, face.outline.end());
  }

  static Vec3 lifted(const FlatFace& face, const Vec2& at) {
    return at[0] * face.axis_u + at[1] * face.axis_v();
  }

  static Vec2 furthest_point(const std::vector<BoundaryCurve>& boundary, const FlatFace& face, int k) {
    const double angle = 2 * M_PI * k / kOutlinePoints;
    const Vec3 e = std::cos(angle) * face.axis_u + std::sin(angle) * face.axis_v();
    Vec3 best = Vec3::Zero();
    double most = -std::numeric_limits<double>::infinity();
    for (const BoundaryCurve& curve : boundary) {
      const Vec3 x = curve.point(furthest_parameter(curve, e));
      if (e.dot(x) > most) most = e.dot(x), best = x;
    }
    return face.project(best);
  }

  void thin_outline(FlatFace& face) const {
    ConvexPolygon polygon;
    for (const int v : face.outline) polygon.add(face.project(out_.vertices[v]));
    face.sides = SideLines(polygon);
    for (const int v : face.outline)
      face.radius = std::max(face.radius, (out_.vertices[v] - face.centroid).norm());
    face.weight.resize(face.outline.size());
    corner_weights(polygon, face.project(face.centroid), face.weight.data());
    int kept[ConvexPolygon::kMost];
    const int count = thin(polygon, kContactPoints, 0, kept);
    for (int i = 0; i < count; ++i) face.corners.push_back(face.outline[kept[i]]);
  }

  void find_edges() {
    std::vector<std::vector<Vec3>> creases;
    visit_creases(shape_.links, [&](int p, int e) {
      if (!is_straight(shape_.patches[p], e, tolerance_)) return;
      const BoundaryCurve curve{&shape_.patches[p], e, true};
      add_edge(curve.point(0), curve.point(1));
      creases.push_back(edge_points(shape_.patches[p], e));
    });
    for (StraightEdge& edge : out_.edges)
      for (const std::vector<Vec3>& points : creases)
        edge.slack = std::max(edge.slack, slack_of(points, edge));
  }

  // How far a crease is beside the straight edge that it belongs to; 0 if it belongs to another one.
  double slack_of(const std::vector<Vec3>& points, const StraightEdge& edge) const {
    const Vec3 &from = out_.vertices[edge.ends[0]], &to = out_.vertices[edge.ends[1]];
    if ((points.front() - from).cross(edge.direction).norm() > 4 * tolerance_) return 0;  // as most are
    const double off = beside(points, from, edge.direction);
    const double low = edge.direction.dot(points.front() - from),
                 high = edge.direction.dot(points.back() - from);
    const bool overlaps =
        std::max(low, high) > tolerance_ && std::min(low, high) < (to - from).norm() - tolerance_;
    return off <= 4 * tolerance_ && overlaps ? off : 0;
  }

  // A piece that goes straight on from an edge at hand lengthens it, and may close the gap to another one.
  void add_edge(const Vec3& from, const Vec3& to) {
    if ((to - from).norm() <= kLeastSlenderness * shape_.bounding_radius) return;
    StraightEdge edge{{vertex(from), vertex(to)}, (to - from).normalized()};
    for (size_t i = 0; i < out_.edges.size();) {
      if (!join(out_.edges[i], edge)) {
        ++i;
        continue;
      }
      out_.edges.erase(out_.edges.begin() + static_cast<std::ptrdiff_t>(i));
      i = 0;
    }
    out_.edges.push_back(edge);
  }

  bool join(const StraightEdge& other, StraightEdge& edge) const {
    for (int& mine : edge.ends)
      for (int k = 0; k < 2; ++k) {
        if (other.ends[k] != mine) continue;
        const Vec3& far = out_.vertices[other.ends[1 - k]];
        const Vec3 arm = far - out_.vertices[mine];
        const Vec3 outward = &mine == &edge.ends[1] ? edge.direction : Vec3(-edge.direction);
        if (arm.cross(outward).norm() > 4 * tolerance_ || arm.dot(outward) <= 0) continue;
        mine = other.ends[1 - k];
        edge.direction = (out_.vertices[edge.ends[1]] - out_.vertices[edge.ends[0]]).normalized();
        return true;
      }
    return false;
  }

  void find_rulings() {
    std::vector<Ruling> ruling(shape_.patches.size(), Ruling::none);
    bool any = false;
    for (size_t p = 0; p < shape_.patches.size(); ++p) {
      if (group_[p] >= 0) continue;
      for (const Ruling r : {Ruling::along_u, Ruling::along_v}) {
        if (!is_ruled(shape_.patches[p], r)) continue;
        ruling[p] = r;
        any = true;
        break;
      }
    }
    if (any) out_.ruling = std::move(ruling);
  }

  bool is_ruled(const BezierPatch& patch, Ruling ruling) const {
    const auto form = [&](double across, double along) {
      return ruling == Ruling::along_u ? local_form(patch, along, across) : local_form(patch, across, along);
    };
    const auto point = [&](double across, double along) {
      return ruling == Ruling::along_u ? evaluate0(patch, along, across) : evaluate0(patch, across, along);
    };
    for (int i = 0; i <= kRulingSamples; ++i) {
      const double across = i / double(kRulingSamples);
      const Vec3 from = point(across, 0), to = point(across, 1);
      if ((to - from).norm() <= kLeastSlenderness * shape_.bounding_radius) return false;
      const Vec3 along = (to - from).normalized();
      const Vec3 normal = form(across, 0.5).normal;
      for (int j = 0; j <= kRulingSamples; ++j) {
        const double t = j / double(kRulingSamples);
        if ((point(across, t) - from).cross(along).norm() > tolerance_) return false;
        if (t > 0 && t < 1 && angle_between(form(across, t).normal, normal) > kSameNormal) return false;
      }
    }
    return true;
  }

  const Shape& shape_;
  const double tolerance_;
  std::vector<int> group_;  // per patch: first patch of its planar group, or -1
  FlatFeatures out_;
};

}  // namespace

FlatFeatures find_flat_features(const Shape& shape) {
  return FaceFinder(shape).run();
}

int nearest_face(const FlatFeatures& features, const Vec3& d, double cosine) {
  int best = -1;
  for (size_t i = 0; i < features.faces.size(); ++i) {
    const double c = features.faces[i].normal.dot(d);
    if (c > cosine) cosine = c, best = static_cast<int>(i);
  }
  return best;
}

}  // namespace nurbs

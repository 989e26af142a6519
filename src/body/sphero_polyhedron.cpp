// Centres of the patches that lie on balls; see sphero_polyhedron.h.
#include "body/sphero_polyhedron.h"

#include <algorithm>
#include <cmath>

#include "body/bounds.h"
#include "body/connectivity.h"
#include "body/revolution.h"
#include "body/rounding.h"
#include "body/shape.h"

namespace nurbs {
namespace {

constexpr int kMostBalls = 64;
constexpr double kMostError = 5e-11;  // of the bounding radius
constexpr double kMostKink = 1e-6;    // rad
constexpr double kKinksMet = 16;      // one after the other between two points
constexpr double kNearCentre = 1e-3;  // of the radius: further ones are another point's
constexpr double kExact = 1e-13;      // of the bounding radius: off balls, planes and lines, round-off
constexpr double kNear = 3e-11;       // ... and few digits
constexpr double kSamePoint = 1e-12;  // of the bounding radius: of corners
constexpr double kOnePoint = 1e-9;    // ... and of centres: nearer ones are one that is not known well
constexpr int kHullSamples = 9;       // per patch and parameter
constexpr double kInside = 1e-12;     // of a ball's radius, that it may lie outside
constexpr double kWithin = 2;         // times what its part is off it: so much smaller ones lie inside
constexpr double kShared = 3;         // planes end in lines, and these in balls: each may be off
constexpr int kMoves = 40;            // halvings of how far a ball may be moved
constexpr double kMostOff = 1e-12;    // of the bounding radius: supports of the balls' hull and the body's

PointAndNormal sample(const BezierPatch& patch, double u, double v) {
  const Jet1 jet = evaluate1(patch, u, v);
  return {jet.s, jet.su.cross(jet.sv).normalized()};
}

BezierPatch seen_from(BezierPatch patch, const Vec3& centre, double radius) {
  for (Vec4& p : patch.points) p.head<3>() = (p.head<3>() - p[3] * centre) / radius;
  return patch;
}

// How far the squared distance of a patch's points from a centre is from radius^2, at most, over that.
double off_ball(const BezierPatch& patch, const Vec3& centre, double radius) {
  return bound_off_unit_sphere(seen_from(patch, centre, radius));
}

// The radius that two normals across a patch give, those that differ most, away from edges that may be
// collapsed.
struct Curved {
  double radius = 0, angle = 0;
};
Curved curved(const BezierPatch& patch) {
  const PointAndNormal corner[] = {sample(patch, 0.05, 0.05), sample(patch, 0.95, 0.05),
                                   sample(patch, 0.05, 0.95), sample(patch, 0.95, 0.95)};
  Curved out{0, kTwoNormals};
  for (const PointAndNormal& s : corner)
    for (const PointAndNormal& t : corner)
      if (const double apart = (s.n - t.n).norm(); apart > out.angle)
        out = {(s.n - t.n).dot(s.x - t.x) / (apart * apart), apart};
  return out;
}

// How far the lines of one parameter (v, or u) are from straight ones from edge to edge that control points
// divide alike, with weights in the same proportions: a length, of no patch that large infinite.
double off_lines(const BezierPatch& patch, bool along_v, double size) {
  const int lines = along_v ? patch.degree_u : patch.degree_v,
            last = along_v ? patch.degree_v : patch.degree_u;
  const auto point = [&](int line, int k) -> const Vec4& {
    return along_v ? patch.point(line, k) : patch.point(k, line);
  };
  if (last == 1) return 0;
  const auto at = [&](int line, int k) -> Vec3 { return point(line, k).head<3>() / point(line, k)[3]; };
  int longest = 0;
  for (int i = 1; i <= lines; ++i)
    if ((at(i, last) - at(i, 0)).norm() > (at(longest, last) - at(longest, 0)).norm()) longest = i;
  const Vec3 along = at(longest, last) - at(longest, 0);
  double off = 0;
  for (int k = 1; k < last; ++k) {
    const double share = along.dot(at(longest, k) - at(longest, 0)) / along.squaredNorm();
    const double weight = point(longest, k)[3] / point(longest, 0)[3];
    if (!(share >= 0 && share <= 1)) return kFarAway;
    for (int i = 0; i <= lines; ++i) {
      const Vec3 there = (1 - share) * at(i, 0) + share * at(i, last);
      off = std::max(off, (at(i, k) - there).norm());
      off = std::max(off, std::abs(point(i, k)[3] / point(i, 0)[3] / weight - 1) * size);
    }
  }
  return off;
}

class SpheroFinder {
 public:
  // `near`: of the bounding radius, what patches may be off balls, planes and straight lines.
  SpheroFinder(const Shape& shape, double near)
      : shape_(shape), near_(near * shape.bounding_radius), on_ball_(shape.patches.size(), false) {}

  SpheroPolyhedron polyhedron() const {
    SpheroPolyhedron out;
    for (const BezierPatch& patch : shape_.patches)
      for (const Vec4& p : patch.points) {
        const Vec3 x = p.head<3>() / p[3];
        const auto near = std::find_if(out.points.begin(), out.points.end(), [&](const Vec3& y) {
          return (x - y).norm() <= kSamePoint * shape_.bounding_radius;
        });
        if (near != out.points.end()) {
          out.error = std::max(out.error, (x - *near).norm());
          continue;
        }
        if (out.points.size() == kMostBalls) return {};
        out.points.push_back(x);
      }
    return out;
  }

  SpheroPolyhedron rounded() {
    if (!is_smooth()) return {};
    take_radius();
    if (!(out_.radius > 0) || !balls() || out_.points.empty() || !all_between()) return {};
    out_.error = error();
    if (!(out_.error <= kMostError * shape_.bounding_radius)) return {};
    if (is_exact() && kinks_are_no_edges()) {
      out_.error += 0.5 * kMostKink * kMostKink * out_.radius;
      return out_;
    }
    SpheroPolyhedron loose = out_;  // a part of a ball may reach beyond another one's by the kinks between
    loose.error += 2 * shape_.bounding_radius * largest_kink();
    const auto held = [&](const Vec3& point) { return is_inside(point, out_.radius - out_.error); };
    if (std::all_of(out_.points.begin(), out_.points.end(), held)) return out_;
    return is_exact() && loose.error <= kMostError * shape_.bounding_radius ? loose : SpheroPolyhedron();
  }

  BallHull hull() {
    BallHull out;
    if (!is_smooth(true) || !all_balls(&out) || !all_tips(&out)) return {};
    if (out.centres.size() < 2 || !all_between()) return {};
    const double off = off_hull(out);
    if (!(off <= std::max(kMostOff * shape_.bounding_radius, off_))) return {};
    out.error = error() + off;
    return out.error <= kMostError * shape_.bounding_radius ? out : BallHull();
  }

  BallHull inner() {
    BallHull on, out;
    all_balls(&on);  // as many as there is room for
    for (size_t k = 0; k < on.centres.size() && out.centres.size() < kMostBalls; ++k) {
      const Vec3& centre = on.centres[k];
      const double radius = on.radii[k] - (is_exact() ? 0 : kWithin * off_);
      if (!is_inside(centre, radius)) continue;
      const auto take = [&](const Vec3& at) {
        out.centres.push_back(at);
        out.radii.push_back(radius);
      };
      take(centre);
      out.error = std::max(out.error, (kExact + kInside) * shape_.bounding_radius);
      for (const double sign : {-1.0, 1.0}) {
        if (!shape_.revolution.found || out.centres.size() == kMostBalls) break;
        const Vec3 along = sign * shape_.revolution.axis;
        const auto holds = [&](double way) { return is_inside(centre + way * along, radius); };
        // Up to the highest point seen: what the surface leaves alone further out may lie outside of the
        // body.
        double inside = 0, outside = highest(along) - along.dot(centre);
        if (!(radius > shape_.concavity && outside > kNearCentre * radius && holds(kNearCentre * radius)))
          continue;
        for (int step = 0; step < kMoves; ++step) {
          const double way = 0.5 * (inside + outside);
          (holds(way) ? inside : outside) = way;
        }
        take(centre + inside * along);
      }
    }
    return out;
  }

 private:
  bool is_exact() const { return off_ <= kExact * shape_.bounding_radius && shape_.joint_slack == 0; }
  // What the hull of balls that patches were found on, or between, and the body may be apart.
  double error() const {
    const double apart = shape_.concavity + kJointRoundoff * shape_.bounding_radius;
    return is_exact() ? apart + off_balls_ : std::max(apart, kShared * off_ + shape_.joint_slack);
  }

  // That the surface leaves a ball alone, which so lies inside of the body if its centre does.
  bool is_inside(const Vec3& centre, double radius) const {
    return std::all_of(shape_.patches.begin(), shape_.patches.end(), [&](const BezierPatch& patch) {
      return lies_outside_unit_ball(seen_from(patch, centre, radius), kInside);
    });
  }

  // Of the patches' corners along unit d.
  double highest(const Vec3& d) const {
    double most = -kFarAway;
    for (const BezierPatch& patch : shape_.patches)
      for (const double u : {0.0, 1.0})
        for (const double v : {0.0, 1.0}) most = std::max(most, d.dot(evaluate0(patch, u, v)));
    return most;
  }

  // But for tips of cones, if those are let be.
  bool is_smooth(bool with_tips = false) const {
    for (const auto& links : shape_.links)
      for (const EdgeLink& link : links)
        if (!(std::abs(link.kink) <= kMostKink || (with_tips && link.collapsed))) return false;
    return true;
  }
  // What the support has over `radius` bends upwards at every edge between two points by the way between
  // them, and downwards at a kink by that times the radius. Points as near to each other as that are no
  // edge's: where two balls meet in a kink, the body is what they have in common and not their hull.
  bool kinks_are_no_edges() const {
    const double least = kKinksMet * out_.radius * largest_kink();
    for (size_t i = 0; i < out_.points.size(); ++i)
      for (size_t k = 0; k < i; ++k)
        if ((out_.points[i] - out_.points[k]).norm() < least) return false;
    return true;
  }
  double largest_kink() const {
    double most = 0;
    for (const auto& links : shape_.links)
      for (const EdgeLink& link : links) most = std::max(most, link.widest());
    return most;
  }
  bool all_between() {
    for (int k = 0; k < static_cast<int>(shape_.patches.size()); ++k)
      if (!on_ball_[k] && !is_between(k)) return false;
    return true;
  }

  // Of any radii, those first whose patches tell most; false if there are too many.
  bool all_balls(BallHull* out) {
    const int count = static_cast<int>(shape_.patches.size());
    std::vector<Curved> seen;
    std::vector<int> order;
    for (int k = 0; k < count; ++k) {
      seen.push_back(curved(shape_.patches[k]));
      order.push_back(k);
    }
    std::stable_sort(order.begin(), order.end(), [&](int x, int y) { return seen[x].angle > seen[y].angle; });
    for (const int k : order) {
      const BezierPatch& patch = shape_.patches[k];
      const auto holds = [&](const Vec3& centre, double radius) {
        return std::abs((sample(patch, 0.5, 0.5).x - centre).norm() - radius) <= kNearCentre * radius &&
               is_small(off_ball(patch, centre, radius) * radius);
      };
      for (size_t i = 0; i < out->centres.size() && !on_ball_[k]; ++i)
        on_ball_[k] = holds(out->centres[i], out->radii[i]);
      if (on_ball_[k] || !(seen[k].radius > 0) || !(seen[k].angle > kTwoNormals)) continue;
      const PointAndNormal middle = sample(patch, 0.5, 0.5);
      const Vec3 centre = middle.x - seen[k].radius * middle.n;
      if (!holds(centre, seen[k].radius)) continue;
      if (static_cast<int>(out->centres.size()) == kMostBalls || is_known(out->centres, centre)) return false;
      out->centres.push_back(centre);
      out->radii.push_back(seen[k].radius);
      on_ball_[k] = true;
    }
    return true;
  }

  // Tips of cones, as balls of radius 0; false if there are too many.
  bool all_tips(BallHull* out) const {
    for (size_t k = 0; k < shape_.links.size(); ++k)
      for (int edge = 0; edge < 4; ++edge) {
        const EdgeLink& link = shape_.links[k][edge];
        if (!link.collapsed || std::abs(link.kink) <= kMostKink) continue;
        const Vec2 at = edge_parameters(edge, 0.5);
        const Vec3 tip = evaluate0(shape_.patches[k], at[0], at[1]);
        const auto same = [&](const Vec3& x) {
          return (x - tip).norm() <= kSamePoint * shape_.bounding_radius;
        };
        if (std::any_of(out->centres.begin(), out->centres.end(), same)) continue;
        if (static_cast<int>(out->centres.size()) == kMostBalls) return false;
        out->centres.push_back(tip);
        out->radii.push_back(0);
      }
    return true;
  }

  // By how much the supports of the balls' hull differ from the body's, at most, along its patches' normals.
  double off_hull(const BallHull& hull) const {
    double most = 0;
    for (const BezierPatch& patch : shape_.patches)
      for (int i = 0; i < kHullSamples; ++i)
        for (int j = 0; j < kHullSamples; ++j) {
          const PointAndNormal s = sample(patch, (i + 0.5) / kHullSamples, (j + 0.5) / kHullSamples);
          double h = -kFarAway;
          for (size_t k = 0; k < hull.centres.size(); ++k)
            h = std::max(h, s.n.dot(hull.centres[k]) + hull.radii[k]);
          most = std::max(most, std::abs(h - s.n.dot(s.x)));
        }
    return most;
  }

  bool is_known(const std::vector<Vec3>& points, const Vec3& x) const {
    return std::any_of(points.begin(), points.end(),
                       [&](const Vec3& y) { return (x - y).norm() <= kOnePoint * shape_.bounding_radius; });
  }

  // Of a length, which then counts for the whole.
  bool is_small(double off) {
    if (!(off <= near_)) return false;
    off_ = std::max(off_, off);
    return true;
  }

  // Of the part of a ball whose normals differ most.
  void take_radius() {
    double widest = 0;
    for (const BezierPatch& patch : shape_.patches) {
      const Curved c = curved(patch);
      if (!(c.angle > widest && c.radius > 0)) continue;
      const PointAndNormal middle = sample(patch, 0.5, 0.5);
      if (!is_small(off_ball(patch, middle.x - c.radius * middle.n, c.radius) * c.radius)) continue;
      widest = c.angle;
      out_.radius = c.radius;
    }
  }

  // Takes every patch that lies on a ball of that radius; false if there are too many.
  bool balls() {
    for (int k = 0; k < static_cast<int>(shape_.patches.size()); ++k) {
      const BezierPatch& patch = shape_.patches[k];
      const PointAndNormal middle = sample(patch, 0.5, 0.5);
      const Vec3 centre = middle.x - out_.radius * middle.n;
      double off = kFarAway;
      const auto holds = [&](const Vec3& point) {
        return (point - centre).norm() <= kNearCentre * out_.radius &&
               is_small(off = off_ball(patch, point, out_.radius) * out_.radius);
      };
      if (std::none_of(out_.points.begin(), out_.points.end(), holds)) {
        if (!holds(centre)) continue;
        if (out_.points.size() == kMostBalls || is_known(out_.points, centre)) return false;
        out_.points.push_back(centre);
      }
      on_ball_[k] = true;
      off_balls_ = std::max(off_balls_, off);
    }
    return true;
  }

  // Whether a patch is plane, or ruled between parts of balls.
  bool is_between(int k) {
    const BezierPatch& patch = shape_.patches[k];
    if (rounding(patch) == kFarAway || is_small(out_of_plane(patch, sample(patch, 0.5, 0.5).n))) return true;
    const auto held = [&](int edge) {
      const EdgeLink& link = shape_.links[k][edge];
      return link.collapsed || (link.patch >= 0 && on_ball_[link.patch]);
    };
    const double size = shape_.bounding_radius;
    return (held(0) && held(1) && is_small(off_lines(patch, false, size))) ||
           (held(2) && held(3) && is_small(off_lines(patch, true, size)));
  }

  const Shape& shape_;
  const double near_;
  double off_ = 0;        // what patches were off what they were taken for, at most ...
  double off_balls_ = 0;  // ... and parts of the core's balls off those
  std::vector<bool> on_ball_;
  SpheroPolyhedron out_;
};

// Exactly, or else up to few digits.
template <class Form>
Form find(const Shape& shape, Form (SpheroFinder::*form)()) {
  for (const double near : {kExact, kNear})
    if (Form found = (SpheroFinder(shape, near).*form)(); found.found()) return found;
  return {};
}

}  // namespace

SpheroPolyhedron find_sphero_polyhedron(const Shape& shape) {
  return shape.bilinear ? SpheroFinder(shape, kExact).polyhedron() : find(shape, &SpheroFinder::rounded);
}

BallHull find_ball_hull(const Shape& shape) {
  return shape.bilinear ? BallHull() : find(shape, &SpheroFinder::hull);
}

BallHull find_inner_balls(const Shape& shape) {
  return shape.bilinear || shape.joint_slack > 0 ? BallHull() : find(shape, &SpheroFinder::inner);
}

}  // namespace nurbs

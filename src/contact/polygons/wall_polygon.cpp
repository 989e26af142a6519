// Polygons of a body on a plane, or on a region of one.
#include <cmath>
#include <vector>

#include "contact/polygons/polygon_points.h"

namespace nurbs {
namespace {

using namespace polygon;

// The support set that stands on a plane.
SupportSet standing_set(const Shape& shape, const Vec3& d, double tolerance) {
  SupportSet set = support_set(shape, d, tolerance);
  if (set.ruled && lean(shape, d, set.support, set.point[0], set.point[1]) > kLeaning * tolerance)
    set.count = 1;
  return set;
}

// How far a body may go before it has a flat feature within reach of a plane, where it has none now. `d`:
// towards the plane, shape axes.
double clear_way(const Particle& particle, const Vec3& d, double reach, const SupportSet& point) {
  const double room = feature_lag(*particle.shape, d, point.h, point.where) - reach / particle.scale;
  return kWayShare * particle.scale * std::clamp(room, 0.0, kMostRoom * particle.shape->bounding_radius);
}

// make_plane_polygon() of a support set that is more than a point.
bool stand_on_plane(const Particle& particle, const BodyFrame& frame, const SupportSet& set,
                    const Vec3& origin, const Vec3& normal, double reach, ContactPolygon* out) {
  const Shape& shape = *particle.shape;
  const auto height = [&](const Vec3& s) {
    return normal.dot(particle.x - origin + frame.scale * (frame.axes * s));
  };
  Candidates points;
  Vec2 centre = Vec2::Zero();
  const bool face = set.face >= 0;
  if (face) {
    const FlatFace& f = shape.flats.faces[set.face];
    for (const int v : f.corners) {
      const Vec3& s = shape.flats.vertices[v];
      points.add(f.project(s), s, height(s), vertex_id(1, v));
    }
    centre = f.project(f.centroid);
  } else {
    const double length = (set.point[1] - set.point[0]).norm();
    for (int i = 0; i < 2; ++i)
      points.add({i * length, 0}, set.point[i], height(set.point[i]), vertex_id(1, set.vertex[i]));
  }
  if (!finish(points, reach / frame.scale, face ? &centre : nullptr, out)) return false;
  if (face && shape.flats.faces[set.face].round) set_ring(shape, 1, set.face, out);
  out->factor = 1;
  store(normal, out->normal);
  out->room = kInfinity;
  set_marks(plane_frame(origin), frame, out);
  out->rolling = set.ruled ? 1 : 0;
  return true;
}

}  // namespace

bool make_plane_polygon(const Particle& particle, const Vec3& origin, const Vec3& normal, double reach,
                        ContactPolygon* out, double* clear) {
  *out = {};
  if (clear) *clear = 0;
  const Shape& shape = *particle.shape;
  if (shape.flats.empty()) return false;
  const BodyFrame frame = body_frame(particle);
  const Vec3 d = frame.axes.transpose() * -normal;
  const SupportSet set = standing_set(shape, d, reach / frame.scale);
  if (set.count > 1) return stand_on_plane(particle, frame, set, origin, normal, reach, out);
  if (clear) *clear = clear_way(particle, d, reach, set);
  return false;
}

namespace {

// What of a feature lies over a region.
class RegionClip {
 public:
  RegionClip(const PlaneRegion& region, double size)
      : plane(plane_along(region.origin, region.normal, region.normal.unitOrthogonal())),
        region_(region),
        slack_(kClipSlack * size) {}

  const ReferencePlane plane;

  // Corners of the hull of the part of a polygon; whether it is the whole polygon.
  bool polygon(const ConvexPolygon& subject, std::vector<Vec2>* hull) const {
    std::vector<Vec2> points;
    double area = 0;
    each_cell([&](const ConvexPolygon& cell) {
      const ConvexPolygon part = intersect(subject, cell, slack_);
      if (part.count < 3) return;
      area += polygon_area(part);
      points.insert(points.end(), part.corner, part.corner + part.count);
    });
    const double full = polygon_area(subject);
    if (area >= (1 - 1e-9) * full) return true;
    convex_hull(points, hull);
    return false;
  }
  // The smallest part [low, high] of a segment that has all of it over the region; whether it is the whole.
  bool segment(const Vec2& p, const Vec2& q, double* low, double* high) const {
    double covered = 0;
    *low = 1;
    *high = 0;
    each_cell([&](const ConvexPolygon& cell) {
      SegmentPart part;
      if (!clip_segment(cell, p, q, slack_, &part)) return;
      covered += part.t1 - part.t0;
      *low = std::min(*low, part.t0);
      *high = std::max(*high, part.t1);
    });
    return *low == 0 && *high == 1 && covered >= 1 - 1e-9;
  }
  // Distance of points from the region's border.
  double room(const ConvexPolygon& points) const {
    double least = kInfinity;
    const std::vector<Vec3>& border = region_.cells->border;
    for (std::size_t k = 0; k + 1 < border.size(); k += 2) {
      const Vec2 a = plane.project(border[k]), way = plane.project(border[k + 1]) - a;
      for (int i = 0; i < points.count; ++i) {
        const Vec2 x = points.corner[i] - a;
        const double t = std::clamp(x.dot(way) / way.squaredNorm(), 0.0, 1.0);
        least = std::min(least, (x - t * way).norm());
      }
    }
    return least;
  }

 private:
  template <class Visit>
  void each_cell(Visit visit) const {
    int first = 0;
    for (const int end : region_.cells->ends) {
      ConvexPolygon cell;
      for (int k = first; k < end && cell.count < kOutlinePoints; ++k)
        cell.add(plane.project(region_.cells->corners[k]));
      if (polygon_area(cell) < 0) std::reverse(cell.corner, cell.corner + cell.count);
      visit(cell);
      first = end;
    }
  }
  // Andrew's monotone chain.
  void convex_hull(std::vector<Vec2>& points, std::vector<Vec2>* hull) const {
    hull->clear();
    std::sort(points.begin(), points.end(),
              [](const Vec2& a, const Vec2& b) { return a[0] != b[0] ? a[0] < b[0] : a[1] < b[1]; });
    const auto chain = [&](auto from, auto to) {
      const std::size_t start = hull->size();
      for (auto p = from; p != to; ++p) {
        if (!hull->empty() && (*p - hull->back()).norm() <= 2 * slack_) continue;
        while (hull->size() > start + 1 &&
               cross2(hull->back() - (*hull)[hull->size() - 2], *p - hull->back()) <=
                   slack_ * (*p - (*hull)[hull->size() - 2]).norm())
          hull->pop_back();
        hull->push_back(*p);
      }
      if (!hull->empty()) hull->pop_back();  // the next chain begins with it
    };
    chain(points.begin(), points.end());
    chain(points.rbegin(), points.rend());
  }

  const PlaneRegion& region_;
  const double slack_;
};

}  // namespace

RegionContact make_region_polygon(const Particle& particle, const PlaneRegion& region, const Vec3& frame,
                                  double reach, ContactPolygon* out, double* clear) {
  *out = {};
  if (clear) *clear = 0;
  const Shape& shape = *particle.shape;
  if (shape.flats.empty()) return RegionContact::point;
  const Body body(1, particle, Vec3::Zero());
  const auto placed = [&](double room) {
    out->offset = region.normal.dot(region.origin - frame);
    out->room = room;
    set_marks(plane_frame(frame), body.frame, out);
    return RegionContact::polygon;
  };
  const Vec3 d = body.turned_back(-region.normal);
  const SupportSet set = standing_set(shape, d, reach / body.frame.scale);
  if (set.count < 2) {
    if (clear) *clear = clear_way(particle, d, reach, set);
    return RegionContact::point;
  }
  const auto whole = [&](double room) {
    const bool made = stand_on_plane(particle, body.frame, set, region.origin, region.normal, reach, out);
    return made ? placed(room) : RegionContact::point;
  };
  if (!region.cells) return whole(kInfinity);
  const RegionClip clip(region, body.radius());
  Candidates points;
  double size = 0;
  if (set.face >= 0) {
    const FlatFace& face = shape.flats.faces[set.face];
    ConvexPolygon subject;  // clockwise seen from the body's outside
    for (std::size_t i = face.outline.size(); i-- > 0;)
      subject.add(clip.plane.project(body.place(body.vertex(face.outline[i]))));
    std::vector<Vec2> hull;
    if (clip.polygon(subject, &hull)) return whole(clip.room(subject));
    if (hull.size() < 2) return RegionContact::clear;
    const Vec3 normal = body.turned(face.normal);
    const double level = body.frame.scale * face.offset - normal.dot(region.origin - body.frame.x);
    for (const Vec2& at : hull) {
      if (points.plane.count == ConvexPolygon::kMost) break;
      const Vec3 flat = clip.plane.lift(at, 0) - region.origin;
      const double h = (level - normal.dot(flat)) / normal.dot(region.normal);
      points.add(at, body.to_shape(clip.plane.lift(at, h)), h, 0);
    }
    for (int i = 0; i < points.plane.count; ++i)
      size = std::max(size, (points.plane.corner[i] - points.plane.corner[0]).norm());
  } else {
    const Vec3 p = body.place(set.point[0]), q = body.place(set.point[1]);
    double low = 0, high = 1;
    if (clip.segment(clip.plane.project(p), clip.plane.project(q), &low, &high)) {
      ConvexPolygon ends;
      ends.add(clip.plane.project(p));
      ends.add(clip.plane.project(q));
      return whole(clip.room(ends));
    }
    if (!(high > low)) return RegionContact::clear;
    size = (high - low) * (q - p).norm();
    for (const double t : {low, high}) {
      const Vec3 x = p + t * (q - p);
      points.add({t * (q - p).norm(), 0}, body.to_shape(x), clip.plane.height(x), 0);
    }
  }
  if (!finish(points, reach, nullptr, out)) return RegionContact::point;
  out->factor = 1;
  store(region.normal, out->normal);
  out->rolling = set.ruled ? 1 : 0;
  return placed(kSlideShare * size);
}

}  // namespace nurbs

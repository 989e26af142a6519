// What polygons are made of: placed bodies, planes, points on their way. For wall_polygon.cpp and
// pair_polygon.cpp.
#pragma once

#include <algorithm>
#include <cstdint>

#include "body/flat_faces.h"
#include "body/support.h"
#include "contact/polygons/contact_polygon.h"
#include "contact/proof.h"

namespace nurbs::polygon {

// Share of the room to a polygon, at most kMostRoom smaller bounding radii, that bodies may go: reach and
// overlap grow by up to five times the way, heights on inclined faces change by more than it.
constexpr double kWayShare = 0.1, kMostRoom = 0.3;

// Names of a polygon's points; 0: none.
std::uint32_t vertex_id(int body, int vertex);
std::uint32_t crossing_id(int side_of_a, int side_of_b);

// A body of the pair, placed relative to A's centre of mass.
struct Body {
  int index;  // 0: A, 1: B
  const Shape* shape;
  BodyFrame frame;

  Body(int i, const Particle& p, const Vec3& origin)
      : index(i), shape(p.shape), frame{p.scale, p.x - origin, p.q.toRotationMatrix(), p.shape} {}
  Vec3 place(const Vec3& s) const { return frame.x + frame.scale * (frame.axes * s); }
  Vec3 to_shape(const Vec3& x) const { return frame.axes.transpose() * (x - frame.x) / frame.scale; }
  Vec3 turned(const Vec3& s) const { return frame.axes * s; }
  Vec3 turned_back(const Vec3& x) const { return frame.axes.transpose() * x; }
  double radius() const { return frame.scale * shape->bounding_radius; }
  const Vec3& vertex(int v) const { return shape->flats.vertices[v]; }
};

// The reference plane with axes of its own, lab.
struct ReferencePlane {
  Vec3 origin, normal, u, v;
  double level;  // normal . (x - origin)

  Vec2 project(const Vec3& x) const { return {u.dot(x - origin), v.dot(x - origin)}; }
  double height(const Vec3& x) const { return normal.dot(x - origin) - level; }
  Vec3 lift(const Vec2& at, double height) const {
    return origin + at[0] * u + at[1] * v + (level + height) * normal;
  }
};
inline ReferencePlane plane_along(const Vec3& origin, const Vec3& normal, const Vec3& u) {
  return {origin, normal, u, normal.cross(u), 0};
}

// Points on their way into a polygon: in the plane, and on the incident body.
struct Candidates {
  ConvexPolygon plane;                 // a segment when count is 2
  Vec3 on_body[ConvexPolygon::kMost];  // shape axes, scale 1
  double gap[ConvexPolygon::kMost];
  std::uint32_t id[ConvexPolygon::kMost];

  void add(const Vec2& at, const Vec3& point, double height, std::uint32_t name) {
    on_body[plane.count] = point;
    gap[plane.count] = height;
    id[plane.count] = name;
    plane.add(at);
  }
  bool within(double most) const {
    return std::all_of(gap, gap + plane.count, [&](double g) { return g <= most; });
  }
  // Whether the contact is theirs: one of them is half as deep at least.
  bool bears(double overlap) const {
    return std::any_of(gap, gap + plane.count, [&](double g) { return g <= -0.5 * overlap; });
  }
};

// Of a polygon, and the two corners that are furthest apart.
double size_of(const ConvexPolygon& p, int* first, int* second);

// Thins and weighs; false when all of it is smaller than `least`. `centre`: of a uniform load, null: the
// centroid.
bool finish(const Candidates& from, double least, const Vec2* centre, ContactPolygon* out);

// What remains to be filled in once the points stand: the marks that tell sliding.
void set_marks(const BodyFrame& reference, const BodyFrame& incident, ContactPolygon* out);

// The outline's points that sector i of a round face stands for: [first, last).
struct Sector {
  int first, last;
};
inline Sector sector(int i, int points) {
  return {i * points / kContactPoints, (i + 1) * points / kContactPoints};
}

// A whole round face: eight sectors of its outline.
void set_ring(const Shape& shape, int body, int face, ContactPolygon* out);

// A ruled line beside a rounded rim or corner that bears at one end only is a point: with half its weights it
// would be half as stiff as the rim. What its far end may lag behind the support, of the reach: half the
// overlap when new, two when it is remade.
constexpr double kLeaning = 1.0 / 6;
// That lag along unit d, where the support is not on the line itself; 0 where it is.
double lean(const Shape& shape, const Vec3& d, const Vec3& support, const Vec3& p, const Vec3& q);

}  // namespace nurbs::polygon

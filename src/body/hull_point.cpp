// The closed forms; see hull_point.h.
#include "body/hull_point.h"

#include <cmath>

#include "body/support.h"
#include "body/support_turn.h"
#include "nurbs/tolerances.h"

namespace nurbs {

HullPoints::HullPoints(const Shape& shape, double enough, double allowed) : shape_(shape), enough_(enough) {
  const double of_ellipsoid = shape.ellipsoid.error * shape.bounding_radius;
  if (shape.ellipsoid.found && of_ellipsoid <= allowed) {
    form_ = Form::ellipsoid;
    error_ = of_ellipsoid;
  } else if (shape.core.found() && shape.core.error <= allowed) {
    form_ = Form::points;
    error_ = shape.core.error;
  } else if (shape.meridian.serves(allowed)) {
    form_ = Form::meridian;
    error_ = shape.meridian.error;
  } else {
    form_ = Form::patches;
  }
}

HullPoint HullPoints::along(const Vec3& d, const HullPlace* start) const {
  switch (form_) {
    case Form::ellipsoid:
      return on_ellipsoid(d);
    case Form::points:
      return of_points(d);
    case Form::meridian:
      if (HullPoint found; on_meridian(d, start, &found)) return found;
      break;
    case Form::patches:
      break;
  }
  return on_patches(d, start);
}

HullPoint HullPoints::near(const Vec3& d) const {
  if (form_ != Form::patches) return along(d);
  const DirectionAtlas& atlas = shape_.atlas;
  const int node = atlas.nearest(d);
  const Support s = look_at(shape_, atlas.direction(node).normalized(), atlas.where[node]);
  return {s.point, s.normal, atlas.support_upper(d), {{}, s.where}};
}

HullPoint HullPoints::on_ellipsoid(const Vec3& d) const {
  const Vec3 k = shape_.ellipsoid.root * d;
  const double h = k.norm();
  return {shape_.ellipsoid.root * k / h, d, h + error_ + kRoundoff * shape_.bounding_radius, {}};
}

HullPoint HullPoints::of_points(const Vec3& d) const {
  const Support s = core_support(shape_, d);
  return {s.point, d, s.upper, {}};
}

bool HullPoints::on_meridian(const Vec3& d, const HullPlace* start, HullPoint* found) const {
  const Meridian& m = shape_.meridian;
  const Vec3 e = m.axes * d;
  const double across = std::sqrt(e[0] * e[0] + e[1] * e[1]);
  ProfilePoint p;
  if (!find_profile_point(m, across, e[2], shape_.bounding_radius,
                          start ? start->on_profile : Meridian::Place(), &p))
    return false;
  const double x = across > 0 ? e[0] / across : 1, y = across > 0 ? e[1] / across : 0;
  found->point = m.point + m.axes.transpose() * Vec3(p.r * x, p.r * y, p.z);
  found->normal = m.axes.transpose() * Vec3(p.turn_r * x, p.turn_r * y, p.turn_z);
  found->upper = std::max(p.upper + d.dot(m.point) + error_, d.dot(found->point));
  found->where = {p.place, {-1, 0, 0}};
  return true;
}

HullPoint HullPoints::on_patches(const Vec3& d, const HullPlace* start) const {
  const bool known = start && start->on_surface.patch >= 0;
  const Support s = find_hull_support(shape_, d, known ? &start->on_surface : nullptr, enough_, kHullSlope);
  return {s.point, s.normal, s.upper, {{}, s.where}};
}

bool HullPoints::turn(const HullPlace& at, const Vec3& d, const Vec3& asked, const Vec3& t, const Vec3& s,
                      Mat2* turn) const {
  if (form_ == Form::ellipsoid) {
    *turn = root_support(shape_.ellipsoid.root, d, t, s).turn;
    return true;
  }
  if (form_ == Form::points) {
    *turn = shape_.core.radius * Mat2::Identity();
    return true;
  }
  if (at.on_profile.piece < 0) return support_turn(shape_, at.on_surface, d, asked, t, s, 1, turn);
  // Round the axis by the distance from it, and by the profile.
  const Meridian& m = shape_.meridian;
  const auto in_half_plane = [&m](const Vec3& x) {
    const Vec3 e = m.axes * x;
    return Vec2(std::sqrt(e[0] * e[0] + e[1] * e[1]), e[2]);
  };
  const Vec2 flat = in_half_plane(d);
  if (!(flat[0] > kNoDirection)) return false;
  const ProfileBend bend = profile_bend(m, at.on_profile, flat, in_half_plane(asked), shape_.bounding_radius);
  if (!std::isfinite(bend.radius)) return false;
  const Vec3 axis = m.axes.row(2);
  const Vec3 round = axis.cross(d) / flat[0], along = round.cross(d);
  const Vec2 of_round(t.dot(round), s.dot(round)), of_along(t.dot(along), s.dot(along));
  *turn = bend.r / flat[0] * of_round * of_round.transpose() + bend.radius * of_along * of_along.transpose();
  return true;
}

}  // namespace nurbs

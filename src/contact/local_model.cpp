// Making of the local models; see local_model.h.
#include "contact/local_model.h"

#include <algorithm>
#include <cmath>

#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

constexpr double kOfTurn = 0.9999;  // sines and chords stand for angles, of 0.01 rad at most

}  // namespace

bool make_support_model(const Mat3& axes, const Vec3& center, const JetLanes& jet, const LocalRate& local,
                        SupportModel* model) {
  if (!(local.rate < kFarAway)) return false;
  using Slot = JetLanes::Slot;
  const Vec3 su = jet.at(Slot::kSu), sv = jet.at(Slot::kSv), cross = su.cross(sv);
  const double area = cross.norm(), lu = su.norm();
  if (!(area > 0)) return false;
  const Vec3 n = cross / area, t = su / lu, s = n.cross(t);
  Lane8 bend;
  dot(jet, n, &bend);
  const double l = -bend[3], m = -bend[4], k = -bend[5], det = l * k - m * m;
  if (!(det > 0) || !(l > 0)) return false;
  // J = (lu, t.sv; 0, s.sv) takes parameters to the frame (t, s); W = J II^-1 J'.
  const double shear = t.dot(sv), height = s.dot(sv), r = 1 / det;
  const double across = r * (lu * k - shear * m), along = r * (shear * l - lu * m);
  model->w0 = lu * across + shear * along;
  model->w1 = height * along;
  model->w2 = r * height * height * l;
  model->rate = local.rate;
  model->room = local.room;
  model->arm = triple(axes * (jet.at(Slot::kS) - center));
  model->normal = triple(axes * n);
  model->tangent = triple(axes * t);
  return std::isfinite(model->w0 + model->w1 + model->w2);
}

SupportModel plane_model(const Vec3& normal) {
  SupportModel m{};
  m.normal = triple(normal);
  m.tangent = triple(normal.unitOrthogonal());
  m.room = kFarAway;
  return m;
}

void limit_turn(const Shape& shape, double turn, SupportModel* model) {
  if (shape.normal_map.cells == 0) return;
  // The way W (d - n) is at least W's least eigenvalue times the turn, seen along the tangent plane.
  const double least = 0.5 * (model->w0 + model->w2) - std::hypot(0.5 * (model->w0 - model->w2), model->w1);
  model->room = std::min(model->room, kOfTurn * turn * std::max(0.0, least));
}

}  // namespace nurbs

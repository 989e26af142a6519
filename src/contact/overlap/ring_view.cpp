#include "contact/overlap/ring_view.h"

namespace nurbs {
namespace {

constexpr double kCore = 1 - 1e-12;  // of the largest ball that rolls inside the mate
constexpr double kErrorShare = 0.2;  // of the tolerance, that what turns a body out of itself may take

// What a body nearly is, where it is none of revolution to enough of the tolerance; else null.
const NearRevolution* near_revolution(const Shape& shape, double scale, double tolerance) {
  const double error = shape.revolution.error + shape.meridian.error;
  if (shape.revolution.found && (scale * error <= kErrorShare * tolerance || !shape.near_revolution.found()))
    return nullptr;
  return &shape.near_revolution;
}

}  // namespace

RingView::RingView(const PairFrame& pair, bool k_is_a, bool core, double tolerance, const RoundEdges* part)
    : arcs(part) {
  sign = k_is_a ? 1 : -1;
  k = k_is_a ? pair.a : pair.b;
  m = k_is_a ? pair.b : pair.a;
  scale_k = k_is_a ? pair.scale_a : pair.scale_b;
  scale_m = k_is_a ? pair.scale_b : pair.scale_a;
  turn_k = k_is_a ? Mat3(Mat3::Identity()) : pair.turn;
  turn_m = k_is_a ? pair.turn : Mat3(Mat3::Identity());
  offset = sign * pair.offset;
  if (!arcs) near_k = near_revolution(*k, scale_k, tolerance);
  const Revolution& own = near_k ? near_k->revolution : k->revolution;
  axis = (turn_k * (arcs ? arcs->axis : own.axis)).normalized();
  point = scale_k * (turn_k * (arcs ? arcs->point : own.point));
  if (near_k) add_ripple(*near_k, scale_k);
  if (m->proofs.sphere) {  // any axis is its own
    mate_axis = axis;
    mate_point = Vec3::Zero();
    circles = true;
    mate_error = m->bounding_radius - m->inner_radius;
    return;
  }
  const NearRevolution* near = near_revolution(*m, scale_m, tolerance);
  const Revolution& mate = near ? near->revolution : m->revolution;
  mate_axis = (turn_m * mate.axis).normalized();
  if (mate_axis.dot(axis) < 0) {
    mate_axis = -mate_axis;
    turn_m_sign = -1;
  }
  mate_point = scale_m * (turn_m * mate.point);
  mate_error = m->revolution.error + m->meridian.error;
  const double sine = axis.cross(mate_axis).norm();
  circles = mate.found && sine < kNearAxis;
  if (circles) tilt = sine;
  if (circles && near) {
    near_m = near;
    add_ripple(*near_m, scale_m);
    mate_error = 0;
  }
  if (!core || near_m) return;
  ball = kCore * PairFrame::rolling_ball(*m, scale_m, tolerance);
  if (!near_k) ball_k = kCore * PairFrame::rolling_ball(*k, scale_k, tolerance);
  if (PairFrame::is_swept(*m, scale_m, tolerance)) swept = &m->core;
  for (const auto& [shape, scale] : {std::pair(m, scale_m), std::pair(k, scale_k)})
    if (PairFrame::is_swept(*shape, scale, tolerance)) error += scale * shape->core.error;
}

void RingView::use_points() {
  circles = false;
  tilt = 0;
  near_m = nullptr;
  ripple = {};
  seam = 0;
  if (near_k) add_ripple(*near_k, scale_k);
}

void RingView::add_ripple(const NearRevolution& near, double scale) {
  ripple.add(scale, near.meridian.ripple);
  seam += scale * near.meridian.seam;
}

}  // namespace nurbs

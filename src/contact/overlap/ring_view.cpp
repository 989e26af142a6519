#include "contact/overlap/ring_view.h"

namespace nurbs {
namespace {

constexpr double kCore = 1 - 1e-12;  // of the largest ball that rolls inside the mate

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
  if (!arcs && !k->revolution.found) near_k = &k->near_revolution;
  axis = (turn_k * (arcs ? arcs->axis : revolution_of(*k).axis)).normalized();
  point = scale_k * (turn_k * (arcs ? arcs->point : revolution_of(*k).point));
  if (near_k) add_ripple(*near_k, scale_k);
  if (m->proofs.sphere) {  // any axis is its own
    mate_axis = axis;
    mate_point = Vec3::Zero();
    circles = true;
    mate_error = m->bounding_radius - m->inner_radius;
    return;
  }
  const Revolution& mate = revolution_of(*m);
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
  if (circles && !m->revolution.found) {
    near_m = &m->near_revolution;
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

#include "contact/overlap/turn_bound.h"

namespace nurbs {

TurnBound bound_turn(const Shape& shape, double scale, const SurfacePoint& at, const Vec3& d, const Vec3& t,
                     const Vec3& s) {
  TurnBound bound;
  if (shape.dented() || shape.joint_slack > 0) return bound;
  const InnerMap& map = shape.lazy_inner_map.known();
  if (!map.nodes.empty()) {
    const InnerNode& node = map.nodes[shape.atlas.nearest(d)];
    const double off = angle_between(node.normal, d);
    for (std::size_t k = 0; k < kInnerCaps.size(); ++k) {
      bound.ball[k] = scale * node.radius[k];
      bound.within[k] = kInnerCaps[k] - off - kOffNormal;
    }
    const int cell = InnerMap::cell(d);
    const double beside = angle_between(InnerMap::middle(cell), d);
    for (std::size_t k = 0; k < kStretchCaps.size(); ++k) {
      bound.stretch[k] = scale * map.stretches[cell].least[k];
      bound.near[k] = kStretchCaps[k] - beside - kOffNormal;
    }
  }
  JetLanes jet;
  evaluate2(shape.patches[at.patch], at.u, at.v, &jet);
  nurbs::scale(scale, &jet);
  bound.local = local_bend(shape, scale, at, jet, d, t, s);
  bound.least = extremes(bound.local.turn).least;
  return bound;
}

Mat2 least_turn(const TurnBound& bound, double to, double* rate) {
  double ball = 0;
  for (std::size_t k = 0; k < kInnerCaps.size(); ++k)
    if (to <= bound.within[k]) ball = std::max(ball, bound.ball[k]);
  for (std::size_t k = 0; k < kStretchCaps.size(); ++k)
    if (to <= bound.near[k]) ball = std::max(ball, bound.stretch[k]);
  if (to <= bound.local.reach && bound.least - bound.local.rate * to > ball) {
    *rate += bound.local.rate;
    return bound.local.turn;
  }
  return ball * Mat2::Identity();
}

double least_radius(const TurnBound& bound, double to) {
  double rate = 0;
  const Mat2 turn = least_turn(bound, to, &rate);
  return std::max(0.0, extremes(turn).least - rate * to);
}

}  // namespace nurbs

// All axes of a pair, one after the other; see ring_search.h.
#include "contact/overlap/ring_search.h"

#include "contact/overlap/ring_sectors.h"

namespace nurbs {
namespace {

constexpr double kAllRings = 1.25;  // of what one search may spend, all axes together
constexpr double kLeastWidth =
    30 * kRoundoff;  // of the larger radius, of a bracket: what turns a body out of itself is part of it

// About the axis of K's revolution or, if not null, of these arcs.
bool search_about(const PairFrame& pair, bool k_is_a, const RoundEdges* arcs, double tolerance, bool last,
                  double* left, PolytopeResult* result) {
  const Shape &k = k_is_a ? *pair.a : *pair.b, &mate = k_is_a ? *pair.b : *pair.a;
  const double scale = k_is_a ? pair.scale_b : pair.scale_a;
  const bool round = PairFrame::rolling_ball(mate, scale, tolerance) > 0 && !mate.proofs.sphere;
  // Circles of a mate about nearly the same axis serve better, unless it ends in spheres.
  const Vec3 of_k = arcs ? arcs->axis : revolution_of(k).axis, of_mate = revolution_of(mate).axis,
             axis = k_is_a ? Vec3(pair.turn * of_mate) : of_mate,
             own = k_is_a ? of_k : Vec3(pair.turn * of_k);
  const bool near = revolution_of(mate).found && own.cross(axis).norm() < kNearAxis;
  for (const bool core : {false, true})
    if ((core ? round : near || !round) &&
        RingSectors(pair, k_is_a, core, tolerance, arcs).run(last, left, result))
      return true;
  return false;
}

bool search_axes(const PairFrame& pair, double tolerance, bool last, PolytopeResult* result) {
  double left = kAllRings;
  for (const bool k_is_a : {true, false}) {
    const Shape& k = k_is_a ? *pair.a : *pair.b;
    if (revolution_of(k).found && !k.proofs.sphere &&
        search_about(pair, k_is_a, nullptr, tolerance, last, &left, result))
      return true;
    for (const RoundEdges& arcs : k.round_edges)
      if (search_about(pair, k_is_a, &arcs, tolerance, last, &left, result)) return true;
  }
  return false;
}

}  // namespace

// As wide as asked for or, at last, where round-off leaves no such bracket, as wide as it leaves one.
bool search_rings(const PairFrame& pair, double tolerance, bool last, PolytopeResult* result) {
  const double least = kLeastWidth * pair.reach;
  return search_axes(pair, tolerance, last, result) ||
         (last && tolerance < least && search_axes(pair, least, last, result));
}

}  // namespace nurbs

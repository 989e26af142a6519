// Polygons that stand: evaluated from frozen points, judged, and what goes from one to the next.
#include "contact/polygons/contact_polygon.h"

#include <algorithm>
#include <cmath>

#include "contact/polygons/polygon_points.h"

namespace nurbs {
namespace {

using namespace polygon;

// One sector of a round face: the mean overlap over its weight (negative), or its least gap if it is open, at
// its centre of pressure (shape axes). gap = base + slope . x for a point x of the incident body.
double sector_gap(const FlatFeatures& flats, int face, int i, double base, const Vec3& slope, Vec3* place,
                  PolygonState* state, double* energy) {
  const FlatFace& f = flats.faces[face];
  const Sector s = sector(i, static_cast<int>(f.outline.size()));
  Vec3 pressed = Vec3::Zero();
  double force = 0, weight = 0, least = kInfinity;
  for (int k = s.first; k < s.last; ++k) {
    const Vec3& x = flats.vertices[f.outline[k]];
    const double gap = base + slope.dot(x), share = f.weight[k] * std::max(0.0, -gap);
    weight += f.weight[k];
    force += share;
    pressed += share * x;
    *energy -= share * std::min(0.0, gap);
    state->most = std::max(state->most, gap);
    if (gap < least) {
      least = gap;
      *place = x;
    }
  }
  state->least = std::min(state->least, least);
  if (!(force > 0)) return least;
  *place = pressed / force;
  return -force / weight;
}

}  // namespace

BodyFrame body_frame(const Particle& particle) {
  return {particle.scale, particle.x, particle.q.toRotationMatrix(), particle.shape};
}

BodyFrame plane_frame(const Vec3& origin) {
  return {1, origin, Mat3::Identity(), nullptr};
}

Vec3 middle_of(const ContactPolygon& polygon) {
  Vec3 middle = Vec3::Zero();
  for (int k = 0; k < polygon.count; ++k) middle += load(polygon.point[k]) / polygon.count;
  return middle;
}

PolygonState evaluate(const ContactPolygon& polygon, const BodyFrame& a, const BodyFrame& b) {
  PolygonState state;
  state.count = polygon.count;
  const bool a_is_reference = polygon.reference == 0;
  const BodyFrame &reference = a_is_reference ? a : b, &incident = a_is_reference ? b : a;
  const Vec3 outward = reference.axes * load(polygon.normal);
  state.normal = a_is_reference ? outward : Vec3(-outward);
  // Relative to the reference's centre, so that bodies far from the lab's origin keep their digits.
  const Vec3 apart = incident.x - reference.x;
  const double level = reference.scale * polygon.offset;
  state.least = kInfinity;
  state.most = -kInfinity;
  const Vec3 outward_on_incident = incident.scale * (incident.axes.transpose() * outward);
  const double base = outward.dot(apart) - level + polygon.shift;
  double energy = 0;
  for (int i = 0; i < polygon.count; ++i) {
    Vec3 place;
    double gap = 0;
    if (polygon.ring > 0) {
      gap = sector_gap(incident.shape->flats, polygon.ring - 1, i, base, outward_on_incident, &place, &state,
                       &energy);
    } else {
      place = load(polygon.point[i]);
      gap = base + outward_on_incident.dot(place);
      const double overlap = std::max(0.0, -gap);
      energy += polygon.weight[i] * overlap * overlap;
      state.least = std::min(state.least, gap);
      state.most = std::max(state.most, gap);
    }
    const Vec3 arm = incident.scale * (incident.axes * place);
    const Vec3 middle = arm - 0.5 * gap * outward;
    state.gap[i] = gap;
    (a_is_reference ? state.arm_b : state.arm_a)[i] = middle;
    (a_is_reference ? state.arm_a : state.arm_b)[i] = middle + apart;
  }
  state.energy = 0.5 * energy;
  if (polygon.count > 0 && polygon.room < kInfinity) {
    const auto lateral = [&](int i, const double* mark) {
      const Vec3 x =
          apart + incident.scale * (incident.axes * load(polygon.point[i])) - reference.axes * load(mark);
      return (x - outward.dot(x) * outward).norm();
    };
    state.slid = 2 * lateral(0, polygon.mark[0]) + lateral(polygon.far, polygon.mark[1]);
  }
  return state;
}

PolygonVerdict judge(const ContactPolygon& polygon, const PolygonState& state) {
  if (!(state.least < 0)) return PolygonVerdict::open;
  if (polygon.rolling != 0 || state.slid > polygon.room) return PolygonVerdict::moved;
  return state.most > 0 || polygon.count == 2 ? PolygonVerdict::tilted : PolygonVerdict::keep;
}

double support_gap(const ContactPolygon& polygon, const Particle* a, const Particle& b, const Vec3& origin) {
  const bool b_is_reference = polygon.reference == 1;
  const Particle& incident = b_is_reference ? *a : b;
  const Particle* reference = b_is_reference ? &b : a;
  Vec3 outward = load(polygon.normal);
  if (reference) outward = reference->q * outward;
  const Vec3 apart = incident.x - (reference ? reference->x : origin);
  const double level = (reference ? reference->scale : 1) * polygon.offset;
  const double h = find_feature_top(*incident.shape, incident.q.conjugate() * -outward).h;
  return outward.dot(apart) - incident.scale * h - level + polygon.shift;
}

static double outgrown_below(const PolygonState& state) {
  return state.least + kOutgrownShare * std::min(0.0, state.least);
}

bool outgrown(const PolygonState& state, double support_gap) {
  return support_gap < outgrown_below(state);
}

double still_holds(const PolygonState& state, double support_gap, double radius_a, double radius_b) {
  const double room = support_gap - outgrown_below(state);
  return 0.25 * std::max(0.0, room) * std::min(radius_a, radius_b) / std::max(radius_a, radius_b);
}

double stored_energy(const ContactPolygon& polygon, const PolygonState& state) {
  return polygon.factor * state.energy;
}

// Where a point, or the foot of its perpendicular, lies along a segment: 0 at its first point, 1 at the
// second.
static double along(const ContactPolygon& segment, const double* point) {
  const Vec3 from = load(segment.point[0]), way = load(segment.point[1]) - from;
  return (load(point) - from).dot(way) / way.squaredNorm();
}

bool rolled_along(const ContactPolygon& old, const ContactPolygon& polygon) {
  if (old.rolling == 0 || polygon.rolling == 0 || old.count != 2 || polygon.count != 2 ||
      old.reference != polygon.reference)
    return false;
  const Vec3 way = load(polygon.point[1]) - load(polygon.point[0]),
             old_way = load(old.point[1]) - load(old.point[0]);
  if (!(std::abs(way.dot(old_way)) >= kSameLine * way.norm() * old_way.norm())) return false;
  for (int i = 0; i < 2; ++i) {
    const double t = along(polygon, old.point[i]);
    if (!(t >= -kRolledPast && t <= 1 + kRolledPast)) return false;
  }
  return true;
}

double continuity_factor(double energy, double full) {
  return energy > 0 && full > 0 ? energy / full : 1;
}

// Newton on the root of the energy over the shift, which is convex and falls: from its left side it stays
// there.
PolygonState give_energy(double energy, double stiffest, const BodyFrame& a, const BodyFrame& b,
                         ContactPolygon* polygon) {
  constexpr int kSteps = 20;
  constexpr double kSameEnergy = 1e-13;
  const double most = std::max(stiffest, polygon->factor), kept = polygon->shift;
  polygon->shift = 0;
  const PolygonState whole = evaluate(*polygon, a, b);
  if (!(energy > 0)) {
    polygon->shift = std::max(0.0, -whole.least);
    return evaluate(*polygon, a, b);
  }
  if (!(whole.energy > 0)) return whole;
  polygon->factor = std::clamp(continuity_factor(energy, whole.energy), 1.0, most);
  if (energy >= whole.energy) return whole;
  polygon->shift = std::clamp(kept, 0.0, -whole.least);
  PolygonState state = evaluate(*polygon, a, b);
  for (int k = 0; k < kSteps && std::abs(state.energy - energy) > kSameEnergy * energy; ++k) {
    double force = 0;
    for (int i = 0; i < state.count; ++i) force += polygon->weight[i] * std::max(0.0, -state.gap[i]);
    const double root = std::sqrt(state.energy);
    polygon->shift = force > 0 ? std::max(0.0, polygon->shift + 2 * root * (root - std::sqrt(energy)) / force)
                               : 0.5 * polygon->shift;
    state = evaluate(*polygon, a, b);
  }
  return state;
}

double relax(ContactPolygon& polygon, const PolygonState& state, double share) {
  const double before = stored_energy(polygon, state);
  polygon.factor += share * (1 - polygon.factor);
  if (std::abs(1 - polygon.factor) < kRelaxed) polygon.factor = 1;
  return stored_energy(polygon, state) - before;
}

void match(const ContactPolygon& old_polygon, const PolygonState& old_state,
           const ContactPolygon& new_polygon, const PolygonState& new_state, int* source) {
  for (int i = 0; i < new_polygon.count; ++i) {
    source[i] = -1;
    double least = kInfinity;
    for (int j = 0; j < old_polygon.count; ++j) {
      if (new_polygon.id[i] != 0 && new_polygon.id[i] == old_polygon.id[j]) {
        source[i] = j;
        break;
      }
      const double d = (new_state.arm_a[i] - old_state.arm_a[j]).squaredNorm();
      if (d < least) least = d, source[i] = j;
    }
  }
}

}  // namespace nurbs

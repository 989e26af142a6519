// Energy at bent walls. A contact with one piece of a wall (a plane, an edge, a vertex) has a potential, but
// of a body with flat faces or sharp corners such contacts come and go at finite overlap: a corner leaves the
// prism over one triangle, a face comes to stand on a plane that its edge was on. Here the potentials are
// fitted together, so that the sum over a body's contacts is continuous in its pose:
//  - What the contacts that end hold is shared by those that begin. They do it in the middle of the step, as
//    half of its work is of the old force and half of the new one: that the energy is passed on in the new
//    pose would leave an error of first order in the step, of the difference of the forces.
//  - One that begins with less than its overlap makes has the wall *stand back* from it by a shift, in which
//    nothing is felt: it is as stiff as any other, and it gives back what it took. The shift goes when the
//    body comes out of it, and slowly under a body at rest.
//  - One that begins with more is stiffer by a weight, as a corner's is that comes down flat
//  (flat_stage.cpp).
//  - A contact that begins at its surface, and one that opens there, hold nothing, and nothing is shared.
// What finds no place is booked as damping. Friction springs go along as far as they lose by it.
#include "scene/wall_energy.h"

#include <algorithm>
#include <cmath>

#include "scene/contact_results.h"

namespace nurbs {
namespace {

constexpr double kSamePlane = 1e-9;  // of normals, and of the bounding radius: two planes are one
constexpr double kSameWay = 0.01;    // of a wall's way in a step by which its plane may be elsewhere
constexpr std::uint64_t kPiece = 7;  // bits of a name that say plane, edge or vertex; planes are 0

}  // namespace

// Of a contact of weight 1.
double ContactStages::unit_energy(std::int32_t number, int body, const ContactGeometry& g) {
  if (!(g.overlap > 0)) return 0;
  ContactBlock& block = pool_.block(number);
  const int lane = ContactPool::lane(number);
  block.b[lane] = body;
  if (step_.model != nullptr) return model_energy(block, lane, g);
  return 0.5 * step_.laws[block.law[lane]].kn * g.overlap * g.overlap;
}

// The overlap at which such a contact holds an energy.
double ContactStages::overlap_of(std::int32_t number, int body, ContactGeometry g, double energy) {
  const ContactBlock& block = pool_.block(number);
  if (step_.model == nullptr)
    return std::sqrt(2 * std::max(0.0, energy) / step_.laws[block.law[ContactPool::lane(number)]].kn);
  return overlap_holding(energy, g.overlap, [&](double overlap) {
    g.overlap = overlap;
    return unit_energy(number, body, g);
  });
}

// Of a polygon's points in this pose, or that of a share of a step `ago`, with the wall `shift` further back.
double ContactStages::polygon_energy(std::int32_t number, int body, double shift, double ago) {
  FlatContact& flat = *pool_.flat(number);
  ContactPolygon polygon = flat.polygon;
  polygon.offset -= shift;
  const Vec3 wall = wall_frame(-1 - number);
  const PolygonState state = ago > 0 ? evaluate(polygon, plane_frame(wall), frame_before(body, wall, ago))
                                     : polygon_state(polygon, body, wall, -1 - number);
  const ContactBlock& block = pool_.block(number);
  if (step_.model == nullptr)
    return step_.laws[block.law[ContactPool::lane(number)]].kn * stored_energy(polygon, state);
  return model_energy(polygon, state, -1 - number, body, point_memories(flat).data());
}

// By how much the wall moves along a contact's normal in half a step.
double ContactStages::half_way(std::int32_t number, const Vec3& normal) const {
  return 0.5 * step_.dt * normal.dot(load(partner(number).record.velocity));
}

// What a contact that ends holds in the middle of the step.
double ContactStages::leaving_energy(std::int32_t number, int body) {
  const ContactBlock& block = pool_.block(number);
  const int lane = ContactPool::lane(number);
  const BodyRecord &wall = partner(number).record, &b = record(body);
  if (const FlatContact* flat = pool_.flat(number)) {
    return polygon_energy(number, body, -half_way(number, load(flat->polygon.normal)), 0.5);
  }
  ContactState state;
  block.get(lane, kStateField, kContactStateSize, &state);
  if (state.active == 0) return 0;
  const Vec3 normal = load(state.normal), arm_a = load(state.arm_a), arm_b = load(state.arm_b);
  const Vec3 velocity =
      load(b.velocity) + load(b.spin).cross(arm_b) - load(wall.velocity) - load(wall.spin).cross(arm_a);
  const double overlap = state.overlap - 0.5 * step_.dt * normal.dot(velocity),
               weight = block.field[kWeight][lane];
  return weight * unit_energy(number, body, {overlap, normal, arm_a, arm_b});
}

// Whether a contact is with the piece of the wall that it was with before.
bool ContactStages::same_piece(std::int32_t number, int body, const WallContact& found) const {
  const Partner& p = partners_[number - 1];
  if (p.name == found.name) return true;
  if ((p.name & kPiece) != 0 || (found.name & kPiece) != 0) return false;
  const Vec3 normal = listed_normal(number);
  // The plane as it was, or where the wall's motion has brought it since.
  const Vec3 x = load(p.record.x), velocity = found.velocity + found.spin.cross(x - found.result.point_a);
  const Vec3& now = found.result.normal;
  const double radius = record(body).radius, level = now.dot(found.result.point_a);
  const double same = kSamePlane * radius + found.flat;
  for (const double dt : {0.0, step_.dt}) {
    const double turned = dt * found.spin.norm(), way = dt * velocity.norm();
    const Vec3 moved = (normal + dt * found.spin.cross(normal)).normalized();
    const double moved_level = moved.dot(x + dt * velocity) + p.level - normal.dot(x);
    if (radius * (moved - now).norm() < same + turned * turned * radius &&
        std::abs(level - moved_level) < same + turned * turned * radius + kSameWay * way)
      return true;
  }
  return false;
}

// Whether a contact's overlap is another one than the body's motion can have made of the last.
bool ContactStages::jumps(std::int32_t number, int body, const WallContact& found) const {
  const Partner& p = partners_[number - 1];
  const BodyRecord& b = record(body);
  const ContactBlock& block = pool_.blocks()[(number - 1) / kBlock];
  ContactState state;
  block.get(ContactPool::lane(number), kStateField, kContactStateSize, &state);
  if (state.active == 0) return false;
  const double way = step_.dt * ((load(b.velocity) - found.velocity).norm() +
                                 b.radius * (load(b.spin).norm() + found.spin.norm()));
  return std::abs(-found.result.gap - p.shift - state.overlap) >
         kArrival * way + kSamePlane * b.radius + found.flat;
}

// Gives a contact an energy, by the wall's shift or its weight.
void ContactStages::hold(Holding* h, int body, double energy) {
  Partner& p = partner(h->number);
  ContactBlock& block = pool_.block(h->number);
  const int lane = ContactPool::lane(h->number);
  if (FlatContact* flat = pool_.flat(h->number)) {
    if (energy > h->energy) {
      flat->polygon.factor *= energy / h->energy;
      return;
    }
    const double moved = half_way(h->number, load(flat->polygon.normal));
    double low = 0, high = h->geometry.overlap;
    for (int k = 0; k < 60; ++k) {
      const double middle = 0.5 * (low + high);
      (polygon_energy(h->number, body, middle + moved, 0.5) > energy ? low : high) = middle;
    }
    p.shift += high;
    return;
  }
  double& weight = block.field[kWeight][lane];
  const double before = weight;
  weight = sign(block, lane) * std::max(1.0, h->unit > 0 ? energy / h->unit : 1.0);
  const ContactGeometry middle = h->middle();
  p.shift = energy < h->unit
                ? std::min(middle.overlap - overlap_of(h->number, body, middle, energy), h->geometry.overlap)
                : 0;
  if (weight == before || step_.model != nullptr) return;
  // The friction spring keeps its force, but gains no energy.
  ContactState old, state{};
  block.get(lane, kStateField, kContactStateSize, &old);
  if (old.active == 0) return;
  const ContactCoefficients &all = step_.laws[block.law[lane]], law = scaled(all, std::abs(weight));
  const BodyMotion of_wall = motion_of(p.record), of_body = motion_of(record(body));
  finish(scaled(all, std::abs(before)), -1 - h->number, body, old);
  ContactGeometry g = h->geometry;
  g.overlap -= p.shift;
  take_over(law, g, of_wall, of_body, step_.dt, std::min(1.0, before / weight) * load(old.spring), &state);
  book(stored_energy(scaled(all, std::abs(before)), old).tangential_spring -
           stored_energy(law, state).tangential_spring,
       -1 - h->number, body);
  block.set(lane, kStateField, kContactStateSize, &state);
}

// Shares `left`, the energy of contacts that ended, among a body's contacts.
void ContactStages::balance(int body, Holding* holdings, int count, double left) {
  double begun = 0, held = 0, shifted = 0;
  for (int k = 0; k < count; ++k) {
    Holding& h = holdings[k];
    if (h.negative) {
      left += h.more * h.unit;
    } else {
      h.target = h.begins ? h.unit : h.energy;
      (h.begins ? begun : held) += h.target;
      shifted += h.begins ? 0 : std::max(0.0, h.unit - h.energy);
    }
  }
  left -= begun;
  const auto share = [&](double all, auto&& part) {
    const double given = std::clamp(left, -all, all);
    if (!(all > 0) || given == 0) return;
    for (int k = 0; k < count; ++k)
      if (!holdings[k].negative) holdings[k].target += given / all * part(holdings[k]);
    left -= given;
  };
  const auto begins = [](const Holding& h) { return h.begins ? h.unit : 0; };
  const auto holds = [](const Holding& h) { return h.begins ? 0 : h.energy; };
  const auto lacks = [](const Holding& h) { return h.begins ? 0 : std::max(0.0, h.unit - h.energy); };
  if (left < 0) {
    share(begun, begins);
    share(held, holds);
  } else {
    share(shifted, lacks);
    share((kStiffest - 1) * begun, [&](const Holding& h) { return (kStiffest - 1) * begins(h); });
    const auto room = [&](const Holding& h) {  // one that the wall stood back from wholly has it too
      const bool none = h.begins || !(h.energy > 0 || (h.unit > 0 && pool_.flat(h.number) == nullptr));
      return none ? 0 : std::max(0.0, kStiffest * h.unit - h.target);
    };
    double rest = 0;
    for (int k = 0; k < count; ++k)
      if (!holdings[k].negative) rest += room(holdings[k]);
    share(rest, room);
  }
  for (int k = 0; k < count; ++k) {
    Holding& h = holdings[k];
    if (!h.negative && (h.begins || h.target != h.energy)) hold(&h, body, h.target);
  }
  if (step_.model == nullptr) book(left, -1, body);
}

// Before the contacts found are made those of this step: `number` has the one that each is now, `known`
// whether it was there before; `left` is what those held that are not found again.
void ContactStages::balance_found(int body, WallContact* found, const std::int32_t* number, const bool* known,
                                  int count, double left) {
  Holding holdings[kMostListed];
  const BodyRecord& b = record(body);
  bool change = left != 0;
  for (int k = 0; k < count && !step_.setup; ++k) {
    Holding& h = holdings[k];
    const WallContact& f = found[k];
    Partner& p = partner(number[k]);
    ContactBlock& block = pool_.block(number[k]);
    const int lane = ContactPool::lane(number[k]);
    h = Holding{};
    h.number = number[k];
    h.negative = f.weight < 0;
    const double before = known[k] ? block.field[kWeight][lane] : 0;
    h.geometry = geometry_of(f, number[k], body);
    FlatContact* flat = pool_.flat(number[k]);
    const Vec3 velocity = load(b.velocity) + load(b.spin).cross(h.geometry.arm_b) - f.velocity;
    h.ago = 0.5 * step_.dt * f.result.normal.dot(velocity);
    h.begins = !known[k] || (before < 0) != h.negative || !same_piece(number[k], body, f) ||
               jumps(number[k], body, f);
    if (h.negative) h.more = (h.begins ? 0 : before) - f.weight;
    change = change || h.more != 0;
    if (h.begins) {
      if (known[k]) left += leaving_energy(number[k], body);
      if (!known[k] && -f.result.gap <= kArrival * step_.dt * velocity.norm() + kSamePlane * b.radius) {
        h.begins = false;  // it came to the surface in this step
      }
      change = change || h.begins;
    } else {
      p.shift = std::max(0.0, std::min(p.shift, -f.result.gap));
      if (flat && f.region) {  // the wall may have moved
        store(f.region->normal, flat->polygon.normal);
        flat->polygon.offset = f.region->normal.dot(f.region->origin - load(p.record.x)) - p.shift;
      }
      stand_closer(number[k], body, h.geometry);
    }
    if (h.negative || before < 0) block.field[kWeight][lane] = f.weight;
  }
  if (change && !step_.setup) {
    for (int k = 0; k < count; ++k) {
      Holding& h = holdings[k];
      if (const FlatContact* flat = pool_.flat(h.number)) {
        const double moved = half_way(h.number, load(flat->polygon.normal));
        h.energy = polygon_energy(h.number, body, moved, 0.5);
        h.unit = h.energy / flat->polygon.factor;
        continue;
      }
      const ContactBlock& block = pool_.block(h.number);
      const ContactGeometry middle = h.middle();
      h.unit = unit_energy(h.number, body, middle);
      ContactGeometry felt = middle;
      felt.overlap -= partner(h.number).shift;
      h.energy = std::abs(block.field[kWeight][ContactPool::lane(h.number)]) *
                 (felt.overlap == middle.overlap ? h.unit : unit_energy(h.number, body, felt));
    }
    balance(body, holdings, count, left);
  }
  for (int k = 0; k < count; ++k) stand_back(number[k], body, &found[k]);
}

// Under a body at rest the wall comes back; under one that has been on it for long, whose contacts hand over
// to each other without rest, as far as a shift is more than what is felt: they would pass it on and add to
// it, and the body would sink.
void ContactStages::stand_closer(std::int32_t number, int body, const ContactGeometry& g) {
  Partner& p = partner(number);
  const ContactBlock& block = pool_.block(number);
  const int lane = ContactPool::lane(number);
  FlatContact* flat = pool_.flat(number);
  ContactRest rest;
  if (flat) {
    rest = rest_of(*flat, flat->polygon.count, p.record, record(body));
  } else {
    ContactState state;
    block.get(lane, kStateField, kContactStateSize, &state);
    rest = rest_of(state, p.record, record(body));
  }
  p.age += rest.phase;
  if (p.shift == 0 || !(rest.rests || (p.age > kLasting && 2 * p.shift > g.overlap))) return;
  const double way = kRelaxation * rest.phase * p.shift;
  double energy = 0;
  if (flat) {
    energy = polygon_energy(number, body, -way) - polygon_energy(number, body, 0);
    flat->polygon.offset += way;
  } else {
    ContactGeometry before = g, after = g;
    before.overlap -= p.shift;
    after.overlap -= p.shift - way;
    energy =
        block.field[kWeight][lane] * (unit_energy(number, body, after) - unit_energy(number, body, before));
  }
  p.shift -= way;
  if (step_.model == nullptr) book(-energy, -1 - number, body);
}

// The wall as the contact feels it.
void ContactStages::stand_back(std::int32_t number, int body, WallContact* found) {
  Partner& p = partner(number);
  ContactResult& r = found->result;
  p.name = found->name;
  p.level = r.normal.dot(r.point_a);
  if (p.shift == 0) return;
  if (r.gap + p.shift >= 0 && found->weight > 0) note_depth(-1 - number, body, r.gap);  // not felt, yet there
  r.gap += p.shift;
  r.upper += p.shift;  // the lower bound stays: the body has not left the wall
  r.point_a -= p.shift * r.normal;
  if (found->region) found->region->origin -= p.shift * found->region->normal;
}

}  // namespace nurbs

// A contact model in the place of the linear law: contact by contact, with the model's memory beside the
// contact (laws/contact_model.h).
//
// Equivalent spheres. They are found where a contact begins and then kept, so that the contact's force has a
// potential; letting them follow the pose costs a bouncing ellipsoid 0.1 to 0.6 % of its energy. A collision
// takes about half a period of the contact's stiffness; a contact older than kFrozenPhase, one that rests or
// rolls, follows the bodies' curvatures slowly.
//
// Polygons (flat_stage.cpp). Every point asks the model for a contact of its overlap with the flat effective
// radius, or the spheres of the contact whose place it takes, and takes its weight's share of force, torque
// and energy: under a uniform gap the whole is one contact.
//
// Energy. What a model dissipates isn't known from its force. Booked is the energy that the contact took out
// of the motion (trapezoidal rule over velocities of half steps: what velocity Verlet does, but for terms of
// second order that telescope) less what its springs gained, so that the ledger closes for every model. Along
// the normal it is damping; across it, and of rolling, friction if the contact slides or rolls, else damping.
#include <algorithm>
#include <cmath>
#include <cstring>

#include "scene/contact_results.h"
#include "scene/wall_energy.h"

namespace nurbs {
namespace {

constexpr double kTurn = 6.283185307179586;
constexpr double kFrozenPhase = 5 * kTurn;   // of a contact whose spheres stay
constexpr double kRelaxedPhase = 5 * kTurn;  // in which older ones come to 1 / e of their way ...
constexpr double kStride = kTurn / 8;        // ... by small steps, so that few steps evaluate surfaces

double volume_curvature(const Particle& p) {
  return std::cbrt(2 * kTurn / (3 * p.shape->mass.volume)) / p.scale;  // (4 pi / 3 V)^(1/3)
}

// Rolling friction takes the effective radius for its lever, which is right for spheres. Of other bodies the
// lever is the height of their centres over the axis through the contact about which the torque turns, so
// that one rolls down slopes steeper than the coefficient. Torsion keeps the radius.
Vec3 rolling_torque(const ModelContact& c, const ContactGeometry& g) {
  const Vec3 torsion = c.torque.dot(g.normal) * g.normal, rolling = c.torque - torsion;
  const double size = rolling.norm();
  if (!(size > 0)) return c.torque;
  const auto height = [&](const Vec3& arm) { return arm.cross(rolling).norm() / size; };
  const double of_b = height(g.arm_b - 0.5 * g.overlap * g.normal);
  if (c.a < 0) return torsion + of_b / c.radius_b * rolling;
  const double of_a = height(g.arm_a + 0.5 * g.overlap * g.normal);
  if (!(of_a * of_b > 0)) return torsion;
  return torsion + of_a * of_b / (of_a + of_b) * (1 / c.radius_a + 1 / c.radius_b) * rolling;
}

}  // namespace

SphereCurvatures ContactStages::model_curvatures(const ContactBlock& block, int lane,
                                                 const ContactGeometry& g) const {
  const int a = block.a[lane], b = block.b[lane];
  const bool wall = a < 0;
  const Bodies& bodies = *step_.bodies;
  if (step_.model->volume_radius() || pool_.is_polygon(block)) return point_spheres(a, b);
  const double cap = wall ? record(b).radius : smaller_radius(a, b);
  PointMemory on[2];
  block.get(lane, kLocalModelSize, 10, on);
  const SurfaceCurvature of_b = curvature_at(bodies.particle(b), on[1], -g.normal);
  if (!wall)
    return sphere_curvatures(curvature_at(bodies.particle(a), on[0], g.normal), of_b, g.normal, cap, false);
  const Step::Cylinder& c = step_.cylinder;
  const Vec3 point = load(record(b).x) + g.arm_b;
  const SurfaceCurvature of_a =
      c.radius > 0 ? cylinder_curvature(c.origin, c.axis, c.radius, point, g.normal) : plane_curvature();
  return sphere_curvatures(of_a, of_b, g.normal, cap, true);
}

SphereCurvatures ContactStages::point_spheres(int a, int b) const {
  const bool wall = a < 0;
  const Bodies& bodies = *step_.bodies;
  if (step_.model->volume_radius())
    return {wall ? 0 : volume_curvature(bodies.particle(a)), volume_curvature(bodies.particle(b))};
  return flat_curvatures(wall ? record(b).radius : smaller_radius(a, b), wall);
}

void ContactStages::set_spheres(std::int32_t number, const SphereCurvatures& spheres) {
  ContactBlock& block = pool_.block(number);
  const int lane = ContactPool::lane(number);
  ModelMemory& own = begin_memory(block, lane);
  own.curvature_a = spheres.a;
  own.curvature_b = spheres.b;
}

// A contact's memory, empty if it is a new contact, or one of another model, by a restart.
ModelMemory& ContactStages::begin_memory(ContactBlock& block, int lane) {
  ModelMemory& own = model_memory(block, lane);
  if (own.kind != step_.model->kind()) {
    std::fill_n(pool_.memory(block, lane), pool_.memory_size(), 0.0);
    own.kind = step_.model->kind();
  }
  return own;
}

void ContactStages::forget_spheres(ContactBlock& block, int lane) {
  if (step_.model == nullptr) return;
  ModelMemory& own = model_memory(block, lane);
  own.curvature_a = own.curvature_b = 0;
}

void ContactStages::apply_model(ContactBlock& block, const Results& results) {
  for (int lane = 0; lane < kBlock; ++lane)
    if (results.touching[lane] != 0)
      ask_model(block, lane, results.geometry(lane),
                results.damper_share(lane, std::abs(block.field[kWeight][lane])), true);
}

// The question that a contact puts to the model, without its history.
ModelContact ContactStages::model_contact(int a, int b, const ContactGeometry& g,
                                          const ModelMemory& own) const {
  const BodyRecord &ra = record(a), &rb = record(b);
  ModelContact c;
  c.a = a;
  c.b = b;
  c.normal = g.normal;
  c.overlap = g.overlap;
  // A body that is flat where it touches is a very large sphere.
  constexpr double kLeast = 1e-6;
  const double least = kLeast * (own.curvature_a + own.curvature_b);
  c.radius_a = a < 0 ? 0 : 1 / std::max(own.curvature_a, least);
  c.radius_b = 1 / std::max(own.curvature_b, least);
  c.spin = load(rb.spin) - load(ra.spin);
  c.velocity = velocity_at(ra, rb, load(ra.spin), load(rb.spin), g.arm_a, g.arm_b);
  const double* mass = step_.bodies->arrays().mass;
  c.mass_b = mass[b];
  c.mass_a = a < 0 ? c.mass_b : mass[a];
  const double compliance = ra.inverse_mass + rb.inverse_mass;
  c.mass = a < 0 ? c.mass_b : compliance > 0 ? 1 / compliance : c.mass_a * c.mass_b / (c.mass_a + c.mass_b);
  return c;
}

// What contacts pass on of what the model would hold across the normal at a geometry, for the whole
// stiffness, with the history of a memory and these spheres: what pushes. Of a model that doesn't tell, a
// spring's.
double ContactStages::model_energy(int a, int b, const double* memory, const SphereCurvatures& spheres,
                                   const ContactGeometry& g) const {
  ModelMemory own;
  std::memcpy(&own, memory, sizeof own);
  own.curvature_a = spheres.a;
  own.curvature_b = spheres.b;
  double history[kMostModelMemory] = {};
  if (own.kind == step_.model->kind())
    std::copy_n(memory + kModelMemory, pool_.memory_size() - kModelMemory, history);
  ModelContact c = model_contact(a, b, g, own);
  c.moves_on = false;
  c.history = history;
  step_.model->force(c);
  return std::isfinite(c.elastic_energy) && c.elastic_energy > 0 ? c.elastic_energy
                                                                 : 0.5 * g.overlap * g.overlap;
}

// Spheres that a contact remembers, and whether it does.
bool ContactStages::knows_spheres(const double* memory) const {
  const auto& own = *reinterpret_cast<const ModelMemory*>(memory);
  return own.kind == step_.model->kind() && (own.curvature_a != 0 || own.curvature_b != 0);
}
static SphereCurvatures spheres_of(const double* memory) {
  const auto& own = *reinterpret_cast<const ModelMemory*>(memory);
  return {own.curvature_a, own.curvature_b};
}
SphereCurvatures ContactStages::inherited_spheres(const double* memory, int a, int b) const {
  return knows_spheres(memory) ? spheres_of(memory) : point_spheres(a, b);
}

// A contact's that has some, or those that it begins with.
SphereCurvatures ContactStages::kept_spheres(const ContactBlock& block, int lane,
                                             const ContactGeometry& g) const {
  const double* memory = pool_.memory(block, lane);
  return knows_spheres(memory) ? spheres_of(memory) : model_curvatures(block, lane, g);
}

// The same of a contact as it is.
double ContactStages::model_energy(const ContactBlock& block, int lane, const ContactGeometry& g) const {
  const double* memory = pool_.memory(block, lane);
  return model_energy(block.a[lane], block.b[lane], memory, kept_spheres(block, lane, g), g);
}

// Of a polygon's points, each with the history of a memory.
double ContactStages::model_energy(const ContactPolygon& polygon, const PolygonState& state, int a, int b,
                                   const double* const* memory) const {
  double sum = 0;
  for (int k = 0; k < polygon.count; ++k)
    if (state.gap[k] < 0)
      sum += polygon.weight[k] * model_energy(a, b, memory[k], inherited_spheres(memory[k], a, b),
                                              {-state.gap[k], state.normal, state.arm_a[k], state.arm_b[k]});
  return polygon.factor * sum;
}

// Nulls where no model serves.
ContactStages::PointMemories ContactStages::point_memories(const FlatContact& flat) const {
  PointMemories memory{};
  if (step_.model == nullptr) return memory;
  for (int k = 0; k < kContactPoints; ++k) memory[k] = pool_.memory(flat.points, k);
  return memory;
}

// What give_energy does, of a model's energy: by regula falsi on a power of it that is nearly linear in the
// shift, with halvings in between.
PolygonState ContactStages::give_model(ContactPolygon* polygon, int a, int b, double energy,
                                       const double* const* memory) const {
  constexpr int kSteps = 24, kHalved = 4;
  constexpr double kSameEnergy = 1e-12, kPower = 0.4;  // Hertz's overlap, of the energy
  const double most = std::max(kStiffest, polygon->factor), kept = polygon->shift;
  double held = 0;
  const auto at = [&](double shift) {
    polygon->shift = shift;
    const PolygonState state = polygon_state(*polygon, b, wall_frame(a), a);
    held = model_energy(*polygon, state, a, b, memory);
    return state;
  };
  polygon->factor = 1;
  PolygonState state = at(0);
  const double all = std::max(0.0, -state.least);
  if (!(energy > 0)) return at(all);
  if (!(held > 0)) return state;
  polygon->factor = std::clamp(continuity_factor(energy, held), 1.0, most);
  if (energy >= (1 - kSameEnergy) * held) return state;
  const double wanted = std::pow(energy, kPower);
  double low = 0, high = all, at_low = std::pow(held, kPower), at_high = 0;
  for (int k = 0; k < kSteps; ++k) {
    const double share = k % kHalved == kHalved - 1 ? 0.5 : (at_low - wanted) / (at_low - at_high);
    state = at(k == 0 && kept > 0 && kept < all ? kept : low + share * (high - low));
    if (std::abs(held - energy) <= kSameEnergy * energy) break;
    (held > energy ? low : high) = polygon->shift;
    (held > energy ? at_low : at_high) = std::pow(std::max(0.0, held), kPower);
  }
  return state;
}

// Dampers are linear in the velocity: it gets their share (Results::damper_share). Across the normal, where
// the model's springs follow it too, it stays.
void ContactStages::ask_model(ContactBlock& block, int lane, const ContactGeometry& g, double damper_share,
                              bool moves_on) {
  const int a = block.a[lane], b = block.b[lane];
  ModelMemory& own = begin_memory(block, lane);
  const ModelMemory old = own;
  ContactState before{}, state{};
  if (step_.ledger) block.get(lane, kStateField, kContactStateSize, &before);

  if (!knows_spheres(pool_.memory(block, lane))) {
    const SphereCurvatures k = model_curvatures(block, lane, g);
    own.curvature_a = k.a;
    own.curvature_b = k.b;
  }
  ModelContact c = model_contact(a, b, g, own);
  c.moves_on = moves_on;
  c.history = pool_.memory(block, lane) + kModelMemory;
  const Vec3 velocity = c.velocity;
  c.velocity -= (1 - damper_share) * velocity.dot(g.normal) * g.normal;
  step_.model->force(c);

  const double weight = block.field[kWeight][lane];
  const Vec3 force = weight * c.force, torque = weight * rolling_torque(c, g);
  if (!std::isfinite(force.sum() + torque.sum())) {
    counts_.value[ContactCounts::unresolved] += share(a, b);
    std::fill_n(pool_.memory(block, lane), pool_.memory_size(), 0.0);
    block.set(lane, kStateField, kContactStateSize, &state);
    return;
  }
  state.active = 1;
  state.dt = moves_on ? step_.dt : 0;
  state.overlap = g.overlap;
  store(g.normal, state.normal);
  store(g.arm_a, state.arm_a);
  store(g.arm_b, state.arm_b);
  state.rate = -velocity.dot(g.normal);
  store(Vec3(velocity + state.rate * g.normal), state.slip);
  state.normal_force = force.dot(g.normal);
  store(Vec3(force - state.normal_force * g.normal), state.tangential_force);
  state.sliding = c.slides ? 1 : 0;
  own.normal_energy = weight * c.normal_energy;
  own.tangential_energy = weight * c.tangential_energy;
  store(torque, own.torque);

  if (moves_on) {
    book_model(block, lane, before, old, state, own);
    const double last = own.phase;
    own.phase += std::sqrt(std::max(0.0, c.stiffness) / c.mass) * step_.dt;
    if (own.phase > kFrozenPhase && std::floor(own.phase / kStride) != std::floor(last / kStride)) {
      const SphereCurvatures k = model_curvatures(block, lane, g);
      const double part = kStride / (kStride + kRelaxedPhase);
      own.curvature_a += part * (k.a - own.curvature_a);
      own.curvature_b += part * (k.b - own.curvature_b);
    }
  }
  block.set(lane, kStateField, kContactStateSize, &state);
  load_model(block, lane, state);
}

// Adds a contact's load to the bodies.
void ContactStages::load_model(const ContactBlock& block, int lane, const ContactState& state) {
  if (state.active == 0) return;
  const Vec3 force = force_on_b(state), torque = load(model_memory(block, lane).torque);
  double on_a[8], on_b[8];
  store(force, on_b);
  store(Vec3(load(state.arm_b).cross(force) + torque), on_b + 3);
  store(Vec3(-force), on_a);
  store(Vec3(-load(state.arm_a).cross(force) - torque), on_a + 3);
  on_a[6] = on_b[6] = state.normal_force;
  on_a[7] = on_b[7] = 1;
  add_load(block.a[lane], on_a);
  add_load(block.b[lane], on_b);
}

// What the step from `before` to `now` dissipated; either may be no contact.
void ContactStages::book_model(const ContactBlock& block, int lane, const ContactState& before,
                               const ModelMemory& old, const ContactState& now, const ModelMemory& own) {
  if (!step_.ledger) return;
  const BodyRecord &a = record(block.a[lane]), &b = record(block.b[lane]);
  const auto powers = [&](const ContactState& s, const ModelMemory& m, bool earlier, double* p) {
    p[0] = p[1] = p[2] = 0;
    if (s.active == 0) return;
    const Vec3 spin_a = load(earlier ? a.spin_before : a.spin),
               spin_b = load(earlier ? b.spin_before : b.spin);
    const Vec3 v = velocity_at(a, b, spin_a, spin_b, load(s.arm_a), load(s.arm_b));
    p[0] = s.normal_force * load(s.normal).dot(v);
    p[1] = load(s.tangential_force).dot(v);
    p[2] = load(m.torque).dot(spin_b - spin_a);
  };
  double first[3], last[3];
  powers(before, old, true, first);
  powers(now, own, false, last);
  const double half = 0.5 * step_.dt;
  const double normal = -half * (first[0] + last[0]) - (own.normal_energy - old.normal_energy);
  const double across = -half * (first[1] + last[1]) - (own.tangential_energy - old.tangential_energy);
  const double rolling = -half * (first[2] + last[2]);
  EnergyLedger work;
  work.damping = normal;
  (before.sliding != 0 || now.sliding != 0 ? work.friction : work.damping) += across;
  work.friction += rolling;
  dissipated_.add(work, share(block.a[lane], block.b[lane]));
}

// Ends a contact: books what is left of it, and forgets it.
void ContactStages::finish_model(ContactBlock& block, int lane) {
  ContactState state;
  block.get(lane, kStateField, kContactStateSize, &state);
  if (state.active != 0)
    book_model(block, lane, state, model_memory(block, lane), ContactState{}, ModelMemory{});
  state = ContactState{};
  block.set(lane, kStateField, kContactStateSize, &state);
  std::fill_n(pool_.memory(block, lane), pool_.memory_size(), 0.0);
}

// A contact that takes another one's place: it has its history, its spheres, so that it is as stiff, and its
// age, with which they come to those of its own.
void ContactStages::take_over_model(const double* from, ContactBlock& block, int lane) {
  double* to = pool_.memory(block, lane);
  ModelMemory own{};
  const auto& old = *reinterpret_cast<const ModelMemory*>(from);
  own.kind = old.kind;
  own.curvature_a = old.curvature_a;
  own.curvature_b = old.curvature_b;
  own.phase = old.phase;
  std::memcpy(to, &own, sizeof own);
  std::copy_n(from + kModelMemory, pool_.memory_size() - kModelMemory, to + kModelMemory);
}

// The points of `flat` become those of `polygon`, each with the history of its source.
void ContactStages::remake_model(FlatContact& flat, const ContactPolygon& polygon, const int* source) {
  double old[kBlock][kMostModelMemory];
  for (int k = 0; k < kBlock; ++k) {
    std::copy_n(pool_.memory(flat.points, k), pool_.memory_size(), old[k]);
    finish_model(flat.points, k);
  }
  for (int k = 0; k < polygon.count; ++k) take_over_model(old[source[k]], flat.points, k);
  flat.polygon = polygon;
  flat.points.used = (1u << polygon.count) - 1;
}

// The points of a polygon end; their pair's single contact, if there is one, gets the history of the one that
// bore most.
void ContactStages::leave_model(ContactBlock& block, int lane, FlatContact& flat, const PolygonState& state,
                                double overlap, ContactState* single) {
  double memory[kMostModelMemory] = {};
  int most = 0;
  double borne = -1;
  for (int k = 0; k < state.count; ++k) {
    const double load_of = std::max(0.0, -state.gap[k]) * flat.polygon.weight[k];
    if (load_of > borne) borne = load_of, most = k;
  }
  std::copy_n(pool_.memory(flat.points, most), pool_.memory_size(), memory);
  for (int k = 0; k < state.count; ++k) finish_model(flat.points, k);
  if (!(overlap > 0)) {
    std::fill_n(pool_.memory(block, lane), pool_.memory_size(), 0.0);
    return;
  }
  take_over_model(memory, block, lane);
  single->active = 1;  // without a force yet: the weight it begins with stays
  single->dt = step_.dt;
  single->overlap = overlap;
  store(state.normal, single->normal);
  store(state.arm_a[most], single->arm_a);
  store(state.arm_b[most], single->arm_b);
}

}  // namespace nurbs

// The contacts of pairs whose flat faces, creases or ruled lines meet: several points with frozen weights, as
// contact/polygons/contact_polygon.h describes their life. A pair has either its one contact or those of a
// polygon.
#include <algorithm>
#include <cmath>

#include "scene/contact_results.h"
#include "scene/wall_energy.h"

namespace nurbs {
namespace {

constexpr double kSameNormal = 0.99;  // cosine between a contact's normals of two steps: 8 degrees
constexpr double kFewDigits = 1e-8;   // of the bounding radius
constexpr double kNoShift = 1e-12;    // of it: as good as 0

BodyFrame frame_of(const BodyRecord& r, double scale, const Shape* shape) {
  BodyFrame f;
  f.scale = scale;
  f.shape = shape;
  f.x = load(r.x);
  f.axes = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(r.turn);
  return f;
}

// A body, or the wall.
BodyFrame placed(const Bodies& bodies, const Vec3& wall, int i) {
  if (i < 0) return plane_frame(wall);
  const BodyArrays& arrays = bodies.arrays();
  return frame_of(bodies.record(i), arrays.scale[i], arrays.shapes[arrays.shape[i]]);
}

// Takes a part off a shift.
void come_closer(double part, double radius, double* shift) {
  *shift *= 1 - part;
  if (*shift < kNoShift * radius) *shift = 0;
}

void fill(const ContactPolygon& polygon, const PolygonState& state, const Vec3& offset, ContactBlock* points,
          ContactStages::Results* results) {
  double together = 0;
  for (int k = 0; k < kBlock; ++k) {
    const bool there = k < state.count;
    points->field[kWeight][k] = there ? polygon.factor * polygon.weight[k] : 0;
    points->field[kShift][k] = polygon.shift;
    results->gap[k] = results->lower[k] = there ? state.gap[k] : 1;
    results->touching[k] = there && state.gap[k] < 0;
    for (int i = 0; i < 3; ++i) {
      results->normal[i][k] = state.normal[i];
      results->point[i][k] = there ? state.arm_a[k][i] : 0;
      results->offset[i][k] = offset[i];
    }
    together += results->touching[k] * points->field[kWeight][k];
  }
  std::fill_n(results->together, kBlock, together);
}

}  // namespace

// The state of a contact that takes over from others: their spring, and no dissipation to be finished.
void take_over(const ContactCoefficients& law, const ContactGeometry& g, const BodyMotion& a,
               const BodyMotion& b, double dt, const Vec3& spring, ContactState* state) {
  *state = ContactState{};
  if (!(g.overlap > 0)) return;
  state->active = 1;
  store(g.normal, state->normal);
  store(spring, state->spring);
  if (!set_contact(law, g, a, b, *state)) return;
  state->dt = dt;
  state->damping_force = 0;
  for (int k = 0; k < 3; ++k) state->tangential_force[k] = -law.kt * state->spring[k];
}

bool ContactStages::may_be_flat(int a, int b) const {
  if (a < -1) return partners_[-2 - a].region.has_value() && step_.settings.solver == Solver::ladder;
  return record(b).flat != 0 && (a < 0 || record(a).flat != 0) && step_.settings.solver == Solver::ladder;
}

// The wall's point that a polygon's arms are counted from.
Vec3 ContactStages::wall_frame(int a) const {
  return a < 0 ? load(record(a).x) : Vec3(Vec3::Zero());
}

// What a contact's `until` is compared with: the bodies' paths. Of a pair, which may be on its way together,
// it is nothing, and `until` is how far B may still go as seen from A: less what the last step took.
double ContactStages::clear_way(int a, int b, double* until) const {
  if (a < 0) return path(a, b);
  const BodyRecord &ra = record(a), &rb = record(b);
  const Vec3 spin_a = load(ra.spin), spin_b = load(rb.spin);
  const Vec3 velocity = load(rb.velocity) - load(ra.velocity) - spin_a.cross(offset(a, b));
  *until -= step_.dt * (velocity.norm() + rb.radius * (spin_b - spin_a).norm());
  return 0;
}

// What a polygon's points hold: by the linear law U / kn, else what the model says, each with the history of
// a memory.
double ContactStages::energy_of(const ContactPolygon& polygon, const PolygonState& state, int a, int b,
                                const PointMemories& memory) const {
  return step_.model != nullptr ? model_energy(polygon, state, a, b, memory.data())
                                : stored_energy(polygon, state);
}

// By how much a polygon's plane stands back: a listed wall does it itself.
void ContactStages::stand_at(double shift, int a, ContactPolygon* polygon) {
  if (a >= -1) {
    polygon->shift = shift;
    return;
  }
  Partner& wall = partner(-1 - a);
  polygon->offset += wall.shift - shift;
  polygon->shift = 0;
  wall.shift = shift;
}

// The same of a listed contact that is a point, in the results of this step.
void ContactStages::stand_at(double shift, int a, int lane, Results* results) {
  Partner& wall = partner(-1 - a);
  const double way = shift - wall.shift;
  wall.shift = shift;
  // A polygon may be made there next.
  if (wall.region) wall.region->origin -= way * results->normal_of(lane);
  results->gap[lane] += way;
  results->touching[lane] = results->gap[lane] < 0;
  for (int k = 0; k < 3; ++k) results->point[k][lane] -= 0.5 * way * results->normal[k][lane];
}

// That energy to a polygon, by its factor or its shift; its state then.
PolygonState ContactStages::give(ContactPolygon* polygon, int a, int b, double energy,
                                 const PointMemories& memory) {
  const double before = polygon->shift + wall_shift(a);
  stand_at(0, a, polygon);
  polygon->shift = before;  // where the search for it begins
  PolygonState state;
  if (step_.model != nullptr) {
    state = give_model(polygon, a, b, energy, memory.data());
  } else {
    const Vec3 wall = wall_frame(a);
    state = give_energy(energy, kStiffest, placed(*step_.bodies, wall, a), placed(*step_.bodies, wall, b),
                        polygon);
  }
  stand_at(polygon->shift, a, polygon);
  return state;
}

// Energy that left the springs.
void ContactStages::book(double energy, int a, int b) {
  if (step_.ledger) dissipated_.damping += share(a, b) * energy;
}

static PolygonState now(const ContactPolygon& polygon, const Bodies& bodies, const Vec3& wall, int a, int b) {
  return evaluate(polygon, placed(bodies, wall, a), placed(bodies, wall, b));
}

PolygonState ContactStages::polygon_state(const ContactPolygon& polygon, int b, const Vec3& wall,
                                          int a) const {
  return now(polygon, *step_.bodies, wall, a, b);
}

// The polygon of two bodies that touch, or of a body and the wall; false where they meet at a point.
bool ContactStages::find_polygon(int a, int b, const Vec3& normal, double overlap, double reach,
                                 const ContactPolygon* old, ContactPolygon* polygon, double* clear,
                                 const SurfacePoint* starts) const {
  const Particle body = step_.bodies->particle(b);
  if (a < -1) {
    const std::optional<PlaneRegion>& region = partners_[-2 - a].region;
    return region.has_value() &&
           make_region_polygon(body, *region, wall_frame(a), reach, polygon, clear) ==
               RegionContact::polygon &&
           polygon->count >= 2;
  }
  const bool made =
      a < 0 ? make_plane_polygon(body, load(step_.wall->x), step_.wall_normal, reach, polygon, clear)
            : make_pair_polygon(step_.bodies->particle(a), body, normal, overlap, reach, old, polygon, clear,
                                starts);
  return made && polygon->count >= 2;
}

// Finishes the dissipation of a contact whose place others take.
void ContactStages::finish(const ContactCoefficients& law, int a, int b, const ContactState& state) {
  if (!step_.ledger) return;
  EnergyLedger work;
  finish_contact(law, motion_of(record(a)), motion_of(record(b)), step_.dt, state, work);
  dissipated_.add(work, share(a, b));
}

// Tries to turn a touching contact into several. The springs keep their energy across the normal; what they
// gain or lose along it is booked.
bool ContactStages::make_flat(ContactBlock& block, int lane, const Results& single) {
  const int a = block.a[lane], b = block.b[lane];
  const Vec3 normal = single.normal_of(lane);
  double before[3];
  block.get(lane, kStateNormal, 3, before);
  const double overlap = -single.gap[lane],
               last_overlap = block.field[kStateField + 2][lane] + single.shift[lane];
  const double way = clear_way(a, b, &block.until[lane]);
  block.until[lane] -= kClearTurn * smaller_radius(a, b) * (normal - load(before)).norm();
  if (a >= 0) block.until[lane] -= kClearGrowth * std::abs(overlap - last_overlap);
  // A region's plane may be another one than the last step's.
  if (a >= -1 && way < block.until[lane] && normal.dot(load(before)) > kSameNormal) return false;
  block.until[lane] = 0;
  ContactPolygon polygon;
  double clear = 0;
  PointMemory on[2];
  block.get(lane, kLocalModelSize, 10, on);
  SurfacePoint starts[2];
  for (int k = 0; k < 2; ++k) starts[k] = surface_point(on[k]);
  if (!find_polygon(a, b, normal, overlap, kReach * overlap, nullptr, &polygon, &clear, starts)) {
    block.until[lane] = way + clear;
    return false;
  }
  PolygonState state = now(polygon, *step_.bodies, wall_frame(a), a, b);
  if (!(state.energy > 0)) return false;
  const double weight = block.field[kWeight][lane];
  const ContactGeometry geometry = single.geometry(lane);
  const double energy = weight * (step_.model != nullptr ? model_energy(block, lane, geometry)
                                                         : 0.5 * geometry.overlap * geometry.overlap);
  PointMemories memory{};
  if (step_.model != nullptr) memory.fill(pool_.memory(block, lane));
  const double stood_back = wall_shift(a);
  state = give(&polygon, a, b, energy, memory);
  if (!(polygon.factor < kStiffest)) {
    stand_at(stood_back, a, &polygon);
    return false;
  }

  ContactState old;
  block.get(lane, kStateField, kContactStateSize, &old);
  // A contact that begins with an overlap of a few digits holds nothing, and the ratio is round-off's.
  if (old.active == 0 && single.shift[lane] == 0 && overlap < kFewDigits * record(b).radius) {
    polygon.factor = 1;
    stand_at(0, a, &polygon);
    state = now(polygon, *step_.bodies, wall_frame(a), a, b);
  }
  FlatContact& flat = pool_.add_flat(block.proof[lane]->contact);
  flat.polygon = polygon;
  flat.points.used = (1u << polygon.count) - 1;
  bind(block.proof[lane]->contact, block.proof[lane], block.neighbour[lane], a, b, block.law[lane]);
  if (old.active != 0 && step_.model != nullptr) {
    double memory[kMostModelMemory];
    std::copy_n(pool_.memory(block, lane), pool_.memory_size(), memory);
    finish_model(block, lane);
    for (int k = 0; k < polygon.count; ++k) take_over_model(memory, flat.points, k);
  } else if (old.active != 0) {
    const ContactCoefficients& all = step_.laws[block.law[lane]];
    const BodyMotion motion_a = motion_of(record(a)), motion_b = motion_of(record(b));
    finish(scaled(all, weight), a, b, old);
    double energy = stored_energy(scaled(all, weight), old).tangential_spring;
    for (int k = 0; k < polygon.count; ++k) {
      const ContactCoefficients own = scaled(all, polygon.factor * polygon.weight[k]);
      ContactState point;
      take_over(own, {-state.gap[k], state.normal, state.arm_a[k], state.arm_b[k]}, motion_a, motion_b,
                step_.dt, load(old.spring), &point);
      flat.points.set(k, kStateField, kContactStateSize, &point);
      energy -= stored_energy(own, point).tangential_spring;
    }
    book(energy, a, b);
  }
  const ContactState none{};
  block.set(lane, kStateField, kContactStateSize, &none);
  block.field[kWeight][lane] = 1;
  block.field[kShift][lane] = 0;
  counts_.value[ContactCounts::contacts] -= share(a, b) * single.touching[lane];  // its points count
  run_flat(block, lane, flat, state);
  return true;
}

// At the start of a run: whether the bodies are where the last step left them. Commands may have moved them.
bool ContactStages::stands_as_left(const FlatContact& flat, const PolygonState& state, int a, int b) const {
  const double same = same_place(a, b, offset(a, b));
  for (int k = 0; k < state.count; ++k) {
    ContactState point;
    flat.points.get(k, kStateField, kContactStateSize, &point);
    const ContactGeometry geometry{-state.gap[k], state.normal, state.arm_a[k], state.arm_b[k]};
    if (point.active != 0 ? !is_where_left(a, geometry, same, &point) : state.gap[k] < -same) return false;
  }
  return true;
}

// The pair's one contact again, as if there had been none.
void ContactStages::forget_flat(ContactBlock& block, int lane) {
  pool_.drop_flat(block.proof[lane]->contact);
  const ContactState none{};
  block.set(lane, kStateField, kContactStateSize, &none);
  block.field[kWeight][lane] = 1;
  block.field[kShift][lane] = 0;
  block.until[lane] = 0;
}

// One step of a pair that has a polygon; false when it has left it, and the single contact serves again.
bool ContactStages::serve_flat(ContactBlock& block, int lane, LeftPolygon* left) {
  const int a = block.a[lane], b = block.b[lane];
  FlatContact& flat = *pool_.flat_of(block, lane);
  PolygonState state = now(flat.polygon, *step_.bodies, wall_frame(a), a, b);
  if (step_.setup && !stands_as_left(flat, state, a, b)) {
    forget_flat(block, lane);
    return false;
  }
  // Of the points that bore in the last step, before others take their place.
  const bool adjusted = flat.polygon.factor != 1 || flat.polygon.shift != 0;
  const ContactRest rest = adjusted ? rest_of(flat, state.count, record(a), record(b)) : ContactRest{};
  const PolygonVerdict verdict = judge(flat.polygon, state);
  double& until = flat.points.until[0];
  const double way = clear_way(a, b, &until);
  if (!step_.setup && verdict != PolygonVerdict::keep &&
      !(verdict == PolygonVerdict::tilted && way < until)) {
    const Particle body = step_.bodies->particle(b);
    const Particle first = a < 0 ? Particle{} : step_.bodies->particle(a);
    bool stays = verdict != PolygonVerdict::open;
    double overlap = -state.least;
    if (stays) {
      double deepest = state.least;
      if (flat.polygon.rolling == 0)      // one that rolls is remade in any case
        deepest = block.fresh[lane] != 0  // the caller has sought it
                      ? fresh_[block.fresh[lane] - 1].gap
                      : support_gap(flat.polygon, a < 0 ? nullptr : &first, body, wall_frame(a));
      if (verdict == PolygonVerdict::moved || outgrown(state, deepest)) {
        overlap = std::max(overlap, -deepest);
        stays = remake(block, lane, flat, state, overlap);
        until = way;
      } else {
        const double radius = record(b).radius;
        until = way + still_holds(state, deepest, a < 0 ? radius : record(a).radius, radius);
      }
    }
    if (!stays) {
      *left = leave_flat(block, lane, flat, state, overlap);
      return false;
    }
  }
  if (!step_.setup && adjusted) relax_polygon(block, lane, rest, flat, &state);
  counts_.value[ContactCounts::local_model] += share(a, b);
  run_flat(block, lane, flat, state);
  return true;
}

// Towards the polygon's own stiffness and place, where it rests; to its stiffness from a greater one also
// where it lasts: what towers and shaken beds stand on would stay four times as stiff as the law, and as
// their step is for. What the springs give up or get is booked.
void ContactStages::relax_polygon(const ContactBlock& block, int lane, const ContactRest& rest,
                                  FlatContact& flat, PolygonState* state) {
  flat.polygon.age += static_cast<float>(rest.phase);
  const bool lasts = flat.polygon.age > kLasting && flat.polygon.factor > 1;
  if (!rest.rests && !lasts) return;
  const ContactCoefficients law =
      coefficients(block, lane);  // zeros where a model serves, which books itself
  double energy = 0;
  if (flat.polygon.shift != 0 && rest.rests) {
    energy -= law.kn * stored_energy(flat.polygon, *state);
    come_closer(kRelaxation * rest.phase, record(block.b[lane]).radius, &flat.polygon.shift);
    *state = now(flat.polygon, *step_.bodies, wall_frame(block.a[lane]), block.a[lane], block.b[lane]);
    energy += law.kn * stored_energy(flat.polygon, *state);
  }
  const double before = flat.polygon.factor;
  double tangential = 0;  // energy at factor 1
  for (int k = 0; k < state->count; ++k) {
    ContactState point;
    flat.points.get(k, kStateField, kContactStateSize, &point);
    tangential += flat.polygon.weight[k] * stored_energy(law, point).tangential_spring;
  }
  energy += law.kn * relax(flat.polygon, *state, kRelaxation * rest.phase);
  energy += (flat.polygon.factor - before) * tangential;
  book(-energy, block.a[lane], block.b[lane]);
}

// What of an overlap may have come to the surface in this step: what that holds no spring has held before,
// and it is none's share.
double ContactStages::arrival(int a, int b, const Vec3& normal, const Vec3& arm_a, const Vec3& arm_b) const {
  const BodyRecord &ra = record(a), &rb = record(b);
  const Vec3 velocity = velocity_at(ra, rb, load(ra.spin), load(rb.spin), arm_a, arm_b);
  return kArrival * step_.dt * std::max(0.0, -normal.dot(velocity));
}

// Where a body, or the wall, was a step ago, or another share of it.
BodyFrame ContactStages::frame_before(int i, const Vec3& wall, double ago) const {
  BodyFrame f = placed(*step_.bodies, wall, i);
  const BodyRecord& r = record(i);
  f.x -= ago * step_.dt * load(r.velocity);
  const Vec3 turn = -0.5 * ago * step_.dt * (load(r.spin) + load(r.spin_before));
  const double angle = turn.norm();
  if (angle > 0) f.axes = Eigen::AngleAxisd(angle, turn / angle).toRotationMatrix() * f.axes;
  return f;
}

// The energy of a line's points once the line has rolled on to where `polygon` is. The points that stay
// behind are lifted, which is of second order in the step and no work of the contact: it would grow softer
// with every step. The new points were as far from bearing a step ago, so that the mean of what both
// polygons' energies have changed by is the work, whatever a line's ends do: run askew, as on an oblique
// cone, or slide along it, as where the other body's line ends.
double ContactStages::energy_rolled(const FlatContact& flat, double energy, const ContactPolygon& polygon,
                                    double holds, int a, int b, const PointMemories& memory) const {
  const Vec3 wall = wall_frame(a);
  const BodyFrame first = frame_before(a, wall), second = frame_before(b, wall);
  const double old_before =
                   energy_of(flat.polygon, evaluate(flat.polygon, first, second), a, b, point_memories(flat)),
               new_before = energy_of(polygon, evaluate(polygon, first, second), a, b, memory);
  return std::max(0.0, energy + 0.5 * ((holds - new_before) - (energy - old_before)));
}

// What of a polygon's energy goes to another one, which would hold `holds`: springs keep theirs.
double ContactStages::kept_energy(const FlatContact& flat, const PolygonState& state,
                                  const ContactPolygon& polygon, const PolygonState& fresh, int a, int b,
                                  const PointMemories& memory, double holds) const {
  double held = energy_of(flat.polygon, state, a, b, point_memories(flat));
  if (rolled_along(flat.polygon, polygon)) return energy_rolled(flat, held, polygon, holds, a, b, memory);
  if (!(holds > held)) return held;
  const int deepest = static_cast<int>(std::min_element(fresh.gap, fresh.gap + fresh.count) - fresh.gap);
  const Vec3 &arm_a = fresh.arm_a[deepest], &arm_b = fresh.arm_b[deepest];
  const double way = arrival(a, b, state.normal, arm_a, arm_b);
  const double arrived = step_.model != nullptr
                             ? model_energy(a, b, memory[deepest], inherited_spheres(memory[deepest], a, b),
                                            {way, fresh.normal, arm_a, arm_b})
                             : 0.5 * way * way;
  return held + std::clamp(arrived, 0.0, holds - held);
}

// The polygon anew, after the points slid or the body tilted; histories go to the new points.
bool ContactStages::remake(ContactBlock& block, int lane, FlatContact& flat, PolygonState& state,
                           double overlap) {
  const int a = block.a[lane], b = block.b[lane];
  ContactPolygon polygon;
  overlap += flat.polygon.shift;
  const auto find = [&](double reach) {
    return find_polygon(a, b, state.normal, overlap, reach * overlap, &flat.polygon, &polygon);
  };
  if (!find(kKeptReach) && !find(kReach)) return false;  // a feature shorter than the reach is none
  // A face that a line rolls on to is a new polygon.
  if (flat.polygon.rolling != 0 && polygon.rolling == 0 && !find(2 * kReach)) return false;
  polygon.factor = flat.polygon.factor;
  polygon.shift = flat.polygon.shift;
  polygon.age = flat.polygon.age;
  PolygonState fresh = now(polygon, *step_.bodies, wall_frame(a), a, b);
  int source[kContactPoints];
  match(flat.polygon, state, polygon, fresh, source);
  PointMemories memory{};
  if (step_.model != nullptr)
    for (int k = 0; k < polygon.count; ++k) memory[k] = pool_.memory(flat.points, source[k]);
  const double holds = energy_of(polygon, fresh, a, b, memory);
  // What would make the springs too stiff they lose, which is booked.
  const double kept = kept_energy(flat, state, polygon, fresh, a, b, memory, holds);
  fresh = give(&polygon, a, b, kept, memory);
  if (step_.model != nullptr) {
    remake_model(flat, polygon, source);
    state = fresh;
    return true;
  }

  const ContactCoefficients& all = step_.laws[block.law[lane]];
  const BodyMotion motion_a = motion_of(record(a)), motion_b = motion_of(record(b));
  double energy = all.kn * (kept - stored_energy(polygon, fresh));
  ContactState old[kBlock];
  for (int k = 0; k < kBlock; ++k) {
    flat.points.get(k, kStateField, kContactStateSize, &old[k]);
    if (k >= state.count || old[k].active == 0) continue;
    const ContactCoefficients own = coefficients(flat.points, k);
    finish(own, a, b, old[k]);
    energy += stored_energy(own, old[k]).tangential_spring;
  }
  for (int k = 0; k < kBlock; ++k) {
    ContactState point{};
    if (k < polygon.count && old[source[k]].active != 0) {
      const ContactCoefficients own = scaled(all, polygon.factor * polygon.weight[k]);
      take_over(own, {-fresh.gap[k], fresh.normal, fresh.arm_a[k], fresh.arm_b[k]}, motion_a, motion_b,
                step_.dt, load(old[source[k]].spring), &point);
      energy -= stored_energy(own, point).tangential_spring;
    }
    flat.points.set(k, kStateField, kContactStateSize, &point);
  }
  book(energy, a, b);
  flat.polygon = polygon;
  flat.points.used = (1u << polygon.count) - 1;
  state = fresh;
  return true;
}

// Law and sums of the points.
void ContactStages::run_flat(ContactBlock& block, int lane, FlatContact& flat, const PolygonState& state) {
  const int a = block.a[lane], b = block.b[lane];
  Results results;
  fill(flat.polygon, state, offset(a, b), &flat.points, &results);
  flat.beyond = stored_energy(flat.polygon, state);
  note_depth(a, b, state.least - flat.polygon.shift - wall_shift(a));
  for (int k = 0; k < state.count; ++k) {
    if (step_.setup)
      start_run(flat.points, k, results);
    else if (results.touching[k] == 0)
      close(flat.points, k);
    counts_.value[ContactCounts::contacts] += share(a, b) * results.touching[k];
    flat.beyond -= 0.5 * flat.points.field[kWeight][k] * results.touching[k] * state.gap[k] * state.gap[k];
  }
  if (!step_.setup) apply_law(flat.points, results);
}

// The end of the polygon, and what it leaves to the pair's one contact, which settle_left places.
ContactStages::LeftPolygon ContactStages::leave_flat(ContactBlock& block, int lane, FlatContact& flat,
                                                     const PolygonState& state, double overlap) {
  const int a = block.a[lane], b = block.b[lane];
  LeftPolygon left;
  left.any = true;
  left.normal_energy = energy_of(flat.polygon, state, a, b, point_memories(flat));
  if (step_.model != nullptr) {
    ContactState single{};
    leave_model(block, lane, flat, state, overlap, &single);
    block.set(lane, kStateField, kContactStateSize, &single);
    pool_.drop_flat(block.proof[lane]->contact);
    return left;
  }
  left.normal_energy *= step_.laws[block.law[lane]].kn;
  double sum = 0;
  for (int k = 0; k < state.count; ++k) {
    ContactState point;
    flat.points.get(k, kStateField, kContactStateSize, &point);
    if (point.active == 0) continue;
    const ContactCoefficients own = coefficients(flat.points, k);
    finish(own, a, b, point);
    left.tangential_energy += stored_energy(own, point).tangential_spring;
    const double load_of = std::max(0.0, -state.gap[k]) * flat.polygon.weight[k];
    sum += load_of;
    left.spring += load_of * load(point.spring);
  }
  if (sum > 0) left.spring /= sum;
  pool_.drop_flat(block.proof[lane]->contact);
  return left;
}

// Back to one contact, at the point that the search found: it gets the springs' mean, and the weight at which
// it holds the polygon's energy. Its overlap is the least over all directions, not that along the face's
// normal. What its springs hold less than the polygon's did is booked.
void ContactStages::settle_left(ContactBlock& block, int lane, Results& results, const LeftPolygon& left) {
  const int a = block.a[lane], b = block.b[lane];
  if (a < -1) stand_at(0, a, lane, &results);
  const bool touching = results.touching[lane] != 0;
  ContactGeometry g = results.geometry(lane);
  const double overlap = -results.gap[lane], kn = step_.model != nullptr ? 0 : step_.laws[block.law[lane]].kn;
  const auto unit = [&](double to) {
    g.overlap = to;
    return step_.model != nullptr ? model_energy(block, lane, g) : 0.5 * kn * to * to;
  };
  const double full = touching ? unit(overlap) : 0;
  double held = left.normal_energy;
  if (touching)
    held += std::clamp(unit(arrival(a, b, g.normal, g.arm_a, g.arm_b)), 0.0, std::max(0.0, full - held));
  double &weight = block.field[kWeight][lane], &shift = block.field[kShift][lane];
  weight = full > 0 ? std::clamp(held / full, 1.0, kStiffest) : 1;
  shift = 0;
  if (full > 0 && weight > held / full)
    shift =
        overlap - (step_.model != nullptr ? overlap_holding(held, overlap, unit) : std::sqrt(2 * held / kn));
  if (a < -1) {
    stand_at(shift, a, lane, &results);
    shift = 0;
  }
  results.shift[lane] = shift;
  if (step_.model != nullptr) return;
  double energy = held + left.tangential_energy;
  ContactState single{};
  if (touching) {
    const ContactCoefficients own = scaled(step_.laws[block.law[lane]], weight);
    // Springs that more of the stiffness is taken for gain nothing by it.
    const double spring = 0.5 * own.kt * left.spring.squaredNorm();
    const double share_of = spring > left.tangential_energy ? std::sqrt(left.tangential_energy / spring) : 1;
    g = results.geometry(lane);
    take_over(own, g, motion_of(record(a)), motion_of(record(b)), step_.dt, share_of * left.spring, &single);
    energy -= 0.5 * own.kn * g.overlap * g.overlap + stored_energy(own, single).tangential_spring;
  }
  book(energy, a, b);
  block.set(lane, kStateField, kContactStateSize, &single);
}

// What of the overlap a contact that took over from a polygon doesn't feel: it goes as the bodies part, and
// where commands have moved them.
void ContactStages::stand_off(ContactBlock& block, int lane, Results& results) {
  double& shift = block.field[kShift][lane];
  if (shift == 0) return;
  const int a = block.a[lane], b = block.b[lane];
  const double overlap = results.touching[lane] != 0 ? -results.gap[lane] : 0;
  if (!step_.setup) shift = std::clamp(shift, 0.0, overlap);
  results.shift[lane] = std::min(shift, overlap);
  ContactState state;
  block.get(lane, kStateField, kContactStateSize, &state);
  if (step_.setup && state.active != 0 &&
      !is_where_left(a, results.geometry(lane), same_place(a, b, results.offset_of(lane)), &state))
    shift = results.shift[lane] = 0;
  if (overlap > results.shift[lane]) return;
  if (overlap > 0) note_depth(a, b, results.gap[lane]);
  results.touching[lane] = 0;
}

// A contact that was left with more than its stiffness, or that does not feel all of its overlap, gets back
// to its own as a polygon does.
void ContactStages::relax_single(ContactBlock& block, int lane, Results& results) {
  double &weight = block.field[kWeight][lane], &shift = block.field[kShift][lane];
  if ((weight == 1 && shift == 0) || weight < 0) return;
  if (block.field[kStateField][lane] == 0) return;  // it begins, with the weight that it was given
  const int a = block.a[lane], b = block.b[lane];
  ContactState state;
  block.get(lane, kStateField, kContactStateSize, &state);
  const ContactRest rest = rest_of(state, record(a), record(b));
  if (!rest.rests || (weight < 1 && step_.model != nullptr)) return;
  const double part = kRelaxation * rest.phase, change = part * (1 - weight);
  const double before = results.geometry(lane).overlap;
  come_closer(part, record(b).radius, &shift);
  results.shift[lane] = shift;
  const double after = results.geometry(lane).overlap;
  weight += change;
  if (step_.model != nullptr) return;  // what its springs give up is missing at the next step's balance
  const ContactCoefficients& law = step_.laws[block.law[lane]];
  book(-0.5 * (law.kn * (weight * after * after - (weight - change) * before * before) +
               change * law.kt * load(state.spring).squaredNorm()),
       a, b);
}

}  // namespace nurbs

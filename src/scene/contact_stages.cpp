#include "scene/contact_stages.h"

#include <algorithm>
#include <cmath>

#include "contact/ellipsoid_search.h"
#include "laws/linear_law.h"
#include "reference/cso.h"
#include "scene/block_lanes.h"
#include "scene/contact_results.h"

namespace nurbs {
namespace {

constexpr double kSamePose =
    1e-6;  // of the smaller radius: bodies that a new run finds nearer were not moved
constexpr double kStepsToMeet = 2, kStepsToPart = 4;  // see stays_near
constexpr double kBudgetShare = 1 - 1e-12;            // of a proven gap: sums of paths are rounded

NURBS_INLINE BodyMotionOf<Wide> gather_motion(const double* const (&record)[kWidth]) {
  Wide f[16];
  gather(record, f);
  return {{f[0], f[1], f[2]},
          {f[3], f[4], f[5]},
          {f[6], f[7], f[8]},
          f[9],
          f[10],
          f[11],
          f[12],
          f[13],
          f[14],
          f[15]};
}

// A body that came through a periodic edge is elsewhere on the plane at rest that it touches, and has not
// moved.
void follow_wrap(const ContactGeometry& g, double least, ContactState* state) {
  const Vec3 way = g.arm_a - g.arm_b - (load(state->arm_a) - load(state->arm_b));
  const Vec3 along = way - way.dot(g.normal) * g.normal;
  if (along.norm() > least) store(Vec3(load(state->arm_a) + along), state->arm_a);
}

}  // namespace

void ContactCounts::add(const ContactResult& result, double weight) {
  if (result.rung != Rung::none) value[safe + static_cast<int>(result.rung) - 1] += weight;
  if (touches(result)) value[contacts] += weight;
  value[iterations] += weight * result.iterations;
  if (result.status == Status::unresolved) value[unresolved] += weight;
}

// --- neighbours
// ----------------------------------------------------------------------------------------------

void ContactStages::begin_neighbours() {
  a_.clear();
  b_.clear();
  proofs_.clear();
}

// Contacts are put in the order of their neighbours, so that bodies' records are met again while cached.
void ContactStages::end_neighbours() {
  ContactPool old;
  std::swap(old, pool_);
  pool_.set_memory_size(old.memory_size());
  expiry_.assign(a_.size(), -kInfinity);
  for (std::size_t k = 0; k < a_.size(); ++k) {
    PairProof& proof = *proofs_[k];
    if (!old.holds(proof.contact)) {
      proof.contact = 0;
      continue;
    }
    double record[kMostContactSize];
    int size = 0;
    old.pack(proof.contact, record);
    proof.contact = pool_.unpack(record, &size);
    bind_neighbour(static_cast<int>(k));
    expiry_[k] = kInfinity;
  }
  renewed_ = true;
}

// Tells a contact, and its polygon, whose it is.
void ContactStages::bind(std::int32_t number, PairProof* proof, int neighbour, int a, int b, int law) {
  const auto set = [&](ContactBlock& block, int lane) {
    block.proof[lane] = proof;
    block.neighbour[lane] = neighbour;
    block.a[lane] = a;
    block.b[lane] = b;
    block.law[lane] = law;
    block.fresh[lane] = 0;
  };
  set(pool_.block(number), ContactPool::lane(number));
  if (FlatContact* flat = pool_.flat(number))
    for (int lane = 0; lane < kBlock; ++lane) set(flat->points, lane);
}
void ContactStages::bind_neighbour(int k) {
  bind(proofs_[k]->contact, proofs_[k], k, a_[k], b_[k], 0);
}

void ContactStages::set_law(int k) {
  const std::int32_t number = proofs_[k]->contact;
  const int law = law_of(a_[k], b_[k]);
  pool_.block(number).law[ContactPool::lane(number)] = law;
  if (FlatContact* flat = pool_.flat(number)) std::fill_n(flat->points.law, kBlock, law);
}

ContactCoefficients ContactStages::coefficients(const ContactBlock& block, int lane) const {
  if (step_.model != nullptr) return {};
  return scaled(step_.laws[block.law[lane]], std::abs(block.field[kWeight][lane]));
}

// A way that no point of the two has exceeded; of a listed wall it holds the body's.
double ContactStages::path(int a, int b) const {
  if (a < -1) return partners_[-2 - a].path;
  const double* path = step_.bodies->path();
  return (a < 0 ? 0 : path[a]) + path[b];
}

// How far the paths may go on until a neighbour that is `lower` apart may touch. A sphere's turns are no
// path, yet move its support by the round-off that it is known to.
double ContactStages::expiry(int k, double lower) const {
  const double size = record(b_[k]).radius + (a_[k] < 0 ? 0 : record(a_[k]).radius);
  return path(a_[k], b_[k]) + kBudgetShare * lower - 2 * kSphere * size;
}

std::uint64_t ContactStages::stamp_of(int a, int b) const {
  const Bodies& bodies = *step_.bodies;
  if (a < 0) return pair_stamp(stamp(step_.wall_normal), bodies.stamp(b), Solver::ladder);
  return pair_stamp(bodies.stamp(a), bodies.stamp(b), step_.settings.solver);
}

int ContactStages::law_of(int a, int b) const {
  return step_.types == nullptr ? 0 : step_.types[a] * step_.type_count + step_.types[b];
}

Vec3 ContactStages::offset(int a, int b) const {
  return load(record(b).x) - load(record(a).x);
}

double ContactStages::smaller_radius(int a, int b) const {
  return std::min(record(a).radius, record(b).radius);
}

// What was remembered of bodies as they are no longer, or by another solver, is dropped; the law's state
// stays.
void ContactStages::check_stamps() {
  neighbour_weight_ = 0;
  for (std::size_t k = 0; k < a_.size(); ++k) {
    neighbour_weight_ += share(a_[k], b_[k]);
    PairProof& proof = *proofs_[k];
    if (proof.contact == 0) {
      expiry_[k] = -kInfinity;
      continue;
    }
    ContactBlock& block = pool_.block(proof.contact);
    const int lane = ContactPool::lane(proof.contact);
    pool_.forget_way(proof.contact);
    set_law(static_cast<int>(k));
    const std::uint64_t stamp = stamp_of(a_[k], b_[k]);
    if (proof.stamp == stamp) continue;
    PairMemory empty{};
    adopt(stamp, &empty);
    empty.proof.contact = proof.contact;
    proof = empty.proof;
    block.set(lane, 0, kLocalModelSize, &empty.model);
    block.set(lane, kLocalModelSize, 10, &empty.on_a);
    pool_.drop_flat(proof.contact);
    forget_spheres(block, lane);
  }
}

// --- stage (b)
// -----------------------------------------------------------------------------------------------

// What a look at a pair, or its solution, reads.
void ContactStages::prefetch_pair(int a, int b, const PairProof* proof) const {
  if (a >= 0) step_.bodies->prefetch(a);
  step_.bodies->prefetch(b);
  prefetch_lines(proof, sizeof *proof);
}

void ContactStages::check_budgets() {
  const double* path = step_.bodies->path();
  const int count = static_cast<int>(a_.size());
  if (step_.wall != nullptr) {
    for (int k = 0; k < count; ++k)
      if (!(path[b_[k]] < expiry_[k])) look(k);
    return;
  }
  constexpr int kRun = 16;
  int k = 0;
  for (; k + kRun <= count; k += kRun) {
    const int *a = &a_[k], *b = &b_[k];
    const double* expiry = &expiry_[k];
    int over = 0;
    for (int n = 0; n < kRun; ++n) over += !(path[a[n]] + path[b[n]] < expiry[n]);
    if (over == 0) continue;
    int expired[kRun], found = 0;
    for (int n = 0; n < kRun; ++n) {
      if (path[a[n]] + path[b[n]] < expiry[n]) continue;
      prefetch_pair(a[n], b[n], proofs_[k + n]);
      expired[found++] = k + n;
    }
    for (int n = 0; n < found; ++n) look(expired[n]);
  }
  for (; k < count; ++k)
    if (!(path[a_[k]] + path[b_[k]] < expiry_[k])) look(k);
}

// Lower bound of the gap without a look at the surfaces: bounding spheres, and the last proof.
double ContactStages::proven(int k) const {
  const int a = a_[k], b = b_[k];
  const PairProof& proof = *proofs_[k];
  const BodyRecord& rb = record(b);
  const Particle body = step_.bodies->particle(b);
  if (a < 0) {
    const double height = step_.wall_normal.dot(offset(a, b));
    return std::max(height - rb.radius,
                    proven_gap(proof, height * step_.wall_normal, Quat::Identity(), 0, body.q, rb.radius, 0));
  }
  const Vec3 apart = offset(a, b);
  const double ra = record(a).radius, reach = ra + rb.radius, spheres2 = apart.squaredNorm();
  const double spheres = spheres2 > reach * reach ? std::sqrt(spheres2) - reach : -kInfinity;
  const Particle first = step_.bodies->particle(a);
  return std::max(spheres, proven_gap(proof, apart, first.q, ra, body.q, rb.radius, 0));
}

// Whether a pair proven `lower` apart may meet within so many steps of bodies that move on as they do: it is
// then cheaper to follow as a contact than to look at again and again.
bool ContactStages::stays_near(int a, int b, double lower, double steps) const {
  if (a < 0) return false;
  const auto way = [this](const BodyRecord& r) {
    return load(r.velocity).norm() + r.radius * load(r.spin).norm();
  };
  return lower < steps * step_.dt * (way(record(a)) + way(record(b)));
}

// A neighbour whose budget is used up: proven apart anew, or solved.
void ContactStages::look(int k) {
  const int a = a_[k], b = b_[k];
  PairProof& proof = *proofs_[k];
  PairMemory memory{};
  memory.proof = proof;
  adopt(stamp_of(a, b), &memory);
  if (proof.stamp != memory.proof.stamp) {
    proof = memory.proof;
    proof.on_a = proof.on_b = coarse(memory.on_a);
  } else {
    const double lower = proven(k);
    if (lower > 0) {
      expiry_[k] = expiry(k, lower);
      return;
    }
  }
  memory.on_a = fine(proof.on_a);
  memory.on_b = fine(proof.on_b);
  drop_model(&memory.model);
  const ContactResult r = search(a, b, memory);
  count(r, a, b);
  expiry_[k] = -kInfinity;
  if (r.rung == Rung::none && !touches(r)) return;  // poses that are no numbers
  const bool apart = r.lower > 0 || r.status == Status::separated;
  if (step_.setup && apart) return;
  const bool released = apart && !stays_near(a, b, r.lower, kStepsToMeet);
  proof = memory.proof;
  proof.on_a = coarse(memory.on_a);
  proof.on_b = coarse(memory.on_b);
  proof.contact = 0;
  if (released) {
    if (has_proof(proof)) expiry_[k] = expiry(k, r.lower);
    return;
  }
  ContactRecord record{memory.model, memory.on_a, memory.on_b, {}, {0, 0, 0}, 1, 0, 0};
  proof.contact = pool_.add(record);
  bind_neighbour(k);
  set_law(k);
  fresh_.push_back(r);
  pool_.block(proof.contact).fresh[ContactPool::lane(proof.contact)] = static_cast<int>(fresh_.size());
  expiry_[k] = kInfinity;
}

ContactResult ContactStages::search(int a, int b, PairMemory& memory) {
  const Particle body = step_.bodies->particle(b);
  if (a < 0) {
    const Vec3 apart = offset(a, b), normal = wall_normal(a);
    ContactResult r = solve_plane_contact(body, normal.dot(apart), normal, step_.settings, memory);
    // Its points are relative to the body.
    r.point_a += apart;
    r.point_b += apart;
    return r;
  }
  const Particle first = step_.bodies->particle(a);
  if (step_.settings.solver == Solver::cso)
    return find_contact_cso(first, body, step_.settings, reinterpret_cast<double*>(&memory));
  return solve_contact(first, body, step_.settings, memory);
}

void ContactStages::count(const ContactResult& r, int a, int b) {
  const double weight = share(a, b);
  counts_.add(r, weight);
  if (r.status == Status::unresolved && !unresolved_.any) {
    unresolved_.any = true;
    unresolved_.a = a;
    unresolved_.b = b;
    unresolved_.particle_b = step_.bodies->particle(b);
    if (a >= 0) unresolved_.particle_a = step_.bodies->particle(a);
  }
}

void ContactStages::note_depth(int a, int b, double gap) {
  const double radius = smaller_radius(a, b), thick = record(a).inner + record(b).inner;
  if (!step_.setup && -gap > DeepContacts::kThroughInRun * thick)
    deep_in_run_.through = std::max(deep_in_run_.through, -gap / thick);
  if (!(-gap > DeepContacts::kDepth * radius)) return;
  const double depth = -gap / radius;
  const auto add = [&](DeepContacts& to) {
    to.count += share(a, b);
    to.deepest = std::max(to.deepest, depth);
  };
  add(deep_);
  const auto inserted = [this](int i) { return i >= 0 && step_.tags[i] > step_.last_tag; };
  if (step_.tags != nullptr && (inserted(a) || inserted(b))) add(deep_inserted_);
  const bool flat = record(b).flat != 0 || (a >= 0 && record(a).flat != 0);
  if (step_.setup || depth <= (flat ? DeepContacts::kFlatInRun : DeepContacts::kRoundInRun)) return;
  add(deep_in_run_);
}

// --- stages (c) to (f)
// ---------------------------------------------------------------------------------------

void ContactStages::compute(const Step& step) {
  begin_step(step);
  if (renewed_ || step.bodies->reshaped() || step.setup) check_stamps();
  renewed_ = false;
  check_budgets();
  end_step(neighbour_weight_);
}

void ContactStages::begin_step(const Step& step) {
  step_ = step;
  counts_ = ContactCounts{};
  deep_ = deep_inserted_ = DeepContacts{};
  if (step.setup) deep_in_run_ = DeepContacts{};
  unresolved_ = Unresolved{};
  fresh_.clear();
  for (const int i : loaded_) sums_[i] = Accumulator{};
  loaded_.clear();
  if (static_cast<int>(sums_.size()) < step.owned) sums_.resize(step.owned, Accumulator{});
  wall_sum_ = Accumulator{};
}

void ContactStages::end_step(double neighbours) {
  LineVector<ContactBlock>& blocks = pool_.blocks();
  for (std::size_t k = 0; k < blocks.size(); ++k) {
    if (k + 1 < blocks.size()) prefetch(blocks[k + 1]);
    if (blocks[k].used != 0) compute_block(blocks[k]);
  }

  double others = 0;
  for (int n = ContactCounts::bounds; n <= ContactCounts::fallback; ++n) others += counts_.value[n];
  counts_.value[ContactCounts::neighbours] = neighbours;
  counts_.value[ContactCounts::safe] = std::max(0.0, neighbours - others);
  counts_.value[ContactCounts::deep] = deep_.count;
}

// What the coming block's local models and laws read: more contacts than a cache holds stream from memory,
// and the processor's own prefetching stops at the page that a block fills.
void ContactStages::prefetch(const ContactBlock& block) const {
  prefetch_lines(block.field, kLocalModelSize * sizeof *block.field);
  prefetch_lines(block.field[kStateField], sizeof block - offsetof(ContactBlock, field[kStateField]));
  if (step_.model != nullptr)
    prefetch_lines(pool_.memory(block, 0), kBlock * pool_.memory_size() * sizeof(double));
}

namespace {

// What a closed form says of kWidth contacts, and of which.
struct Answer {
  Triple<Wide> normal, point_a, point_b;  // from A's centre, lab
  Wide gap, lower;
  WideMask serves;
};

}  // namespace

// Stage (c) for the contacts first to first + kWidth - 1.
void ContactStages::serve(ContactBlock& block, int first, Results& results) const {
  const Wide unique = lanes(block, kUnique, first);
  std::memset(&results.served[first], 0, sizeof unique);
  const WideMask modelled = unique > 0.0, ellipsoids = unique == kEllipsoidPair;
  if (none_of(modelled | ellipsoids)) return;
  const double *of_a[kWidth], *of_b[kWidth];
  for (int l = 0; l < kWidth; ++l) {
    const bool used = block.used >> (first + l) & 1;
    const BodyRecord &ra = record(used ? block.a[first + l] : block.b[first]),
                     &rb = step_.bodies->record(used ? block.b[first + l] : 0);
    of_a[l] = ra.x;
    of_b[l] = rb.x;
  }
  const Pose a = gather_pose(of_a), b = gather_pose(of_b);
  const Triple<Wide> offset = b.x - a.x;
  const auto put = [first](const WideMask& mask, const Wide& w, double(&to)[kBlock]) {
    put_lanes(mask, w, first, to);
  };
  const auto put3 = [first](const WideMask& mask, const Triple<Wide>& w, double(&to)[3][kBlock]) {
    put_lanes(mask, w, first, to);
  };
  const Wide zero{}, one = all<Wide>(1);
  const auto answer = [&](const WideMask& asked, const Answer& c) {
    put(asked, c.gap, results.gap);
    put(asked, c.lower, results.lower);
    put3(asked, c.normal, results.normal);
    put3(asked, all<Wide>(0.5) * (c.point_a + c.point_b), results.point);
    put3(asked, offset, results.offset);
    put(asked, select((c.gap < 0.0) & (c.lower <= 0.0), one, zero), results.touching);
    put(asked, select(c.serves, one, zero), results.served);
  };
  const Wide size = smaller(a.radius, b.radius);
  if (!none_of(modelled)) {
    const LocalContactOf<Wide> c = evaluate_local(
        support_lanes(block, 0, first), support_lanes(block, 14, first), a.turn, b.turn, offset, a.free);
    const Wide roundoff = kRoundoff * (magnitude(offset.x) + magnitude(offset.y) + magnitude(offset.z));
    answer(modelled, {c.normal, c.point_a, c.point_b, c.gap, c.gap - c.error - roundoff,
                      serves<Wide>(c, unique, step_.settings.tolerance, size)});
  }
  if (none_of(ellipsoids)) return;
  EllipsoidPairOf<Wide> pair;
  Wide* const fields = reinterpret_cast<Wide*>(&pair);
  for (int k = 0; k < kEllipsoidPairSize; ++k) fields[k] = lanes(block, k, first);
  const Wide noise = gap_roundoff(a.radius, b.radius, offset);
  const FollowedOf<Wide> c =
      follow<Wide>(pair, a.turn, b.turn, offset, a.free, step_.settings.tolerance, size, noise, ellipsoids);
  answer(ellipsoids, {c.d, c.contact.point_a, c.contact.point_b, c.contact.gap,
                      c.contact.lower - pair.error * (a.radius + b.radius) - noise, c.found});
  if (step_.setup) return;
  pair.change = c.d - pair.direction;
  pair.direction = c.d;
  for (int k = 0; k < kEllipsoidMotion; ++k) put(c.found, fields[k], block.field[k]);
}

// Stage (d) for one contact.
void ContactStages::solve_lane(ContactBlock& block, int lane, Results& results) {
  const int a = block.a[lane], b = block.b[lane];
  PairMemory memory;
  memory.proof = *block.proof[lane];
  block.get(lane, kLocalModelSize, 10, &memory.on_a);
  if (is_mark(block.field[kUnique][lane]))
    block.get(lane, 0, kLocalModelSize, &memory.model);
  else
    drop_model(&memory.model);
  const ContactResult r = search(a, b, memory);
  count(r, a, b);
  results.set(lane, r, offset(a, b));
  if (r.status == Status::separated) results.lower[lane] = std::max(results.lower[lane], 0.0);
  if (step_.setup) return;  // what is remembered stays, so that a run in two parts moves as one
  const std::int32_t contact = block.proof[lane]->contact;
  *block.proof[lane] = memory.proof;
  block.proof[lane]->contact = contact;
  if (memory.model.unique > 0 || is_mark(memory.model.unique))
    block.set(lane, 0, kLocalModelSize, &memory.model);
  else
    block.field[kUnique][lane] = memory.model.unique;
  block.set(lane, kLocalModelSize, 10, &memory.on_a);
}

void ContactStages::compute_block(ContactBlock& block) {
  Results results;
  for (int first = 0; first < kBlock; first += kWidth) serve(block, first, results);
  for (int lane = 0; lane < kBlock; ++lane) {
    if (!(block.used >> lane & 1) || results.served[lane] != 0 || block.fresh[lane] != 0) continue;
    prefetch_pair(block.a[lane], block.b[lane], block.proof[lane]);
  }
  for (int first = 0; first < kBlock; first += kWidth) follow_surfaces(block, first, results);
  double touching = 0;
  for (int lane = 0; lane < kBlock; ++lane) {
    if (!(block.used >> lane & 1)) {
      results.touching[lane] = 0;
      continue;
    }
    const int a = block.a[lane], b = block.b[lane];
    LeftPolygon left;
    if (block.field[kFlat][lane] != 0 && serve_flat(block, lane, &left)) {
      results.touching[lane] = 0;
      continue;
    }
    const bool served = block.fresh[lane] == 0 && results.served[lane] != 0;
    if (block.fresh[lane] != 0) {
      results.set(lane, fresh_[block.fresh[lane] - 1], offset(a, b));
      block.fresh[lane] = 0;
    } else if (served) {
      const double weight = share(a, b);
      const bool followed = results.iterations[lane] != 0;
      counts_.value[followed ? ContactCounts::warm : ContactCounts::local_model] += weight;
      counts_.value[ContactCounts::contacts] += weight * results.touching[lane];
      counts_.value[ContactCounts::iterations] += weight * results.iterations[lane];
    } else {
      solve_lane(block, lane, results);
    }
    if (left.any) {
      settle_left(block, lane, results, left);
      // A listed one was a polygon still when the others were counted.
      if (a < -1) counts_.value[ContactCounts::contacts] += share(a, b) * results.touching[lane];
    }
    stand_off(block, lane, results);
    if (step_.setup) {
      const bool first = results.touching[lane] != 0 && block.field[kStateField][lane] == 0;
      if (first && may_be_flat(a, b) && make_flat(block, lane, results)) continue;
      start_run(block, lane, results);
      if (results.touching[lane] != 0 && sign(block, lane) > 0)
        note_depth(a, b, results.gap[lane] - wall_shift(a));
      continue;
    }
    if (results.touching[lane] != 0) {
      relax_single(block, lane, results);
      if (may_be_flat(a, b) && make_flat(block, lane, results)) {
        results.touching[lane] = 0;
        continue;
      }
      ++touching;
      if (sign(block, lane) > 0) note_depth(a, b, results.gap[lane] - wall_shift(a));
      continue;
    }
    close(block, lane);
    if (a < -1) continue;  // a listed contact is kept as long as the caller finds it
    if (!(results.lower[lane] > 0) || stays_near(a, b, results.lower[lane], kStepsToPart)) continue;
    if (served) {
      PairProof& proof = *block.proof[lane];
      const Vec3 apart = a < 0 ? Vec3(step_.wall_normal.dot(offset(a, b)) * step_.wall_normal) : offset(a, b);
      set_proof(results.normal_of(lane), results.lower[lane], apart,
                a < 0 ? Quat::Identity() : step_.bodies->particle(a).q, step_.bodies->particle(b).q, &proof);
    }
    release(block, lane, results.lower[lane]);
  }
  if (touching > 0) apply_law(block, results);
}

void ContactStages::apply_law(ContactBlock& block, const Results& results) {
  if (step_.model != nullptr) return apply_model(block, results);
  for (int first = 0; first < kBlock; first += kWidth)
    step_.ledger ? apply_law<true>(block, first, results) : apply_law<false>(block, first, results);
}

// A length: contacts that moved no further are where they were.
double ContactStages::same_place(int a, int b, const Vec3& apart) const {
  return std::min(10 * step_.settings.tolerance, kSamePose) * smaller_radius(a, b) +
         1e-13 * (apart.norm() + load(record(a).x).norm());
}

// Whether a contact is where its state was made.
bool ContactStages::is_where_left(int a, const ContactGeometry& geometry, double same,
                                  ContactState* state) const {
  if (a == -1) follow_wrap(geometry, same, state);
  return same_geometry(*state, geometry, same);
}

namespace {

// Forces on A and B and their torques. Not to be inlined: what is contracted to fused operations depends on
// where that is, and a run in two parts moves as one to the last bit.
struct ContactLoads {
  Triple<Wide> force, torque_a, torque_b;
  Wide pressed;
  void scatter(double (&load_a)[kWidth][8], double (&load_b)[kWidth][8]) const {
    const Wide zero{};
    nurbs::scatter({force.x, force.y, force.z, torque_b.x, torque_b.y, torque_b.z, pressed, all<Wide>(1)},
                   load_b);
    nurbs::scatter({zero - force.x, zero - force.y, zero - force.z, torque_a.x, torque_a.y, torque_a.z,
                    pressed, all<Wide>(1)},
                   load_a);
  }
};
[[gnu::noinline]] ContactLoads loads_of(const ContactStateOf<Wide>& state, const Wide& sign) {
  ContactLoads l;
  l.pressed = sign * state.normal_force;
  l.force = l.pressed * state.normal + sign * state.tangential_force;
  l.torque_a = cross(l.force, state.arm_a);
  l.torque_b = cross(state.arm_b, l.force);
  return l;
}

}  // namespace

// The state stays as it is when the bodies are where it was made, so that a run in two parts moves as one;
// else it is made anew.
void ContactStages::start_run(ContactBlock& block, int lane, const Results& results) {
  const int a = block.a[lane], b = block.b[lane];
  const ContactGeometry geometry = results.geometry(lane);
  ContactState state{};
  ContactCoefficients law = coefficients(block, lane);
  const double dampers = results.damper_share(lane, std::abs(block.field[kWeight][lane]));
  law.cn *= dampers;
  law.ct *= dampers;
  if (results.touching[lane] != 0) {
    block.get(lane, kStateField, kContactStateSize, &state);
    const bool same = is_where_left(a, geometry, same_place(a, b, results.offset_of(lane)), &state);
    const bool stays = same && state.dt > 0 && !step_.changed;
    if (step_.model != nullptr) {
      if (stays)
        load_model(block, lane, state);
      else
        ask_model(block, lane, geometry, dampers, false);
      return;
    }
    if (!stays && !set_contact(law, geometry, motion_of(record(a)), motion_of(record(b)), state))
      counts_.value[ContactCounts::unresolved] += share(a, b);
  }
  block.set(lane, kStateField, kContactStateSize, &state);
  if (state.active == 0) {
    return;
  }
  ContactStateOf<Wide> wide;
  double fields[kContactStateSize];
  std::memcpy(fields, &state, sizeof fields);
  for (int k = 0; k < kContactStateSize; ++k) reinterpret_cast<Wide*>(&wide)[k] = all<Wide>(fields[k]);
  const ContactLoads loads = loads_of(wide, all<Wide>(sign(block, lane)));
  double load_a[kWidth][8], load_b[kWidth][8];
  loads.scatter(load_a, load_b);
  add_load(a, load_a[0]);
  add_load(b, load_b[0]);
}

// Ends the law's part of a contact that has opened since the last step.
void ContactStages::close(ContactBlock& block, int lane) {
  if (block.field[kStateField][lane] == 0) return;
  double& weight = block.field[kWeight][lane];
  const double next = weight > 0 ? 1 : weight;  // when it begins again
  if (step_.model != nullptr) {
    finish_model(block, lane);
    weight = next;
    return;
  }
  ContactState state;
  block.get(lane, kStateField, kContactStateSize, &state);
  const int a = block.a[lane], b = block.b[lane];
  if (step_.ledger) {
    EnergyLedger work;
    end_contact(coefficients(block, lane), motion_of(record(a)), motion_of(record(b)), step_.dt, state, work);
    dissipated_.add(work, sign(block, lane) * share(a, b));
  }
  state = ContactState{};
  block.set(lane, kStateField, kContactStateSize, &state);
  weight = next;
}

// Makes a contact a mere neighbour, proven `lower` apart.
void ContactStages::release(ContactBlock& block, int lane, double lower) {
  PairProof& proof = *block.proof[lane];
  const int k = block.neighbour[lane];
  PointMemory on[2];
  block.get(lane, kLocalModelSize, 10, on);
  proof.on_a = coarse(on[0]);
  proof.on_b = coarse(on[1]);
  expiry_[k] = has_proof(proof) ? expiry(k, lower) : -kInfinity;
  pool_.remove(proof.contact);
  proof.contact = 0;
}

// Stages (e) and (f) for the contacts first to first + kWidth - 1.
template <bool ledger>
void ContactStages::apply_law(ContactBlock& block, int first, const Results& results) {
  const auto got = [first](const double(&from)[kBlock]) { return load_wide(&from[first]); };
  const Wide zero{};
  const WideMask touching = got(results.touching) != 0.0;
  if (none_of(touching)) return;
  const double *of_a[kWidth], *of_b[kWidth];
  LinearLawOf<Wide> law;
  for (int l = 0; l < kWidth; ++l) {
    const bool used = results.touching[first + l] != 0;
    of_a[l] = used ? record(block.a[first + l]).velocity : step_.bodies->record(0).velocity;
    of_b[l] = used ? record(block.b[first + l]).velocity : step_.bodies->record(0).velocity;
    const ContactCoefficients& c = step_.laws[used ? block.law[first + l] : 0];
    law.kn[l] = c.kn;
    law.kt[l] = c.kt;
    law.cn[l] = c.cn;
    law.ct[l] = c.ct;
    law.mu[l] = c.mu;
  }
  const Wide index = lanes(block, kWeight, first), weight = magnitude(index);
  law.kn *= weight;
  law.kt *= weight;
  const Wide dampers = weight / damper_divisor<Wide>(weight, got(results.together));
  law.cn *= dampers;
  law.ct *= dampers;
  const BodyMotionOf<Wide> a = gather_motion(of_a), b = gather_motion(of_b);
  ContactGeometryOf<Wide> g;
  g.overlap = zero - got(results.gap) - got(results.shift);
  g.normal = {got(results.normal[0]), got(results.normal[1]), got(results.normal[2])};
  g.arm_a = {got(results.point[0]), got(results.point[1]), got(results.point[2])};
  g.arm_b = g.arm_a - Triple<Wide>{got(results.offset[0]), got(results.offset[1]), got(results.offset[2])};

  ContactStateOf<Wide> state;
  Wide* const fields = reinterpret_cast<Wide*>(&state);
  for (int k = 0; k < kContactStateSize; ++k) fields[k] = lanes(block, kStateField + k, first);
  ContactWorkOf<Wide> work{};
  advance_linear<Wide, ledger>(law, g, a, b, step_.dt, &state, &work);

  const Wide sign = select(index < 0.0, all<Wide>(-1), all<Wide>(1));
  const ContactLoads loads = loads_of(state, sign);
  const Triple<Wide>&force = loads.force, &torque_a = loads.torque_a, &torque_b = loads.torque_b;
  const Wide sum = force.x + force.y + force.z + torque_a.x + torque_a.y + torque_a.z + torque_b.x +
                   torque_b.y + torque_b.z + state.rate + work.damping + work.friction;
  const WideMask good = touching & ((sum - sum) == 0.0);
  for (int k = 0; k < kContactStateSize; ++k) {
    const Wide keep = select(good, fields[k], zero);
    std::memcpy(&block.field[kStateField + k][first], &keep, sizeof keep);
  }
  double load_a[kWidth][8], load_b[kWidth][8];
  loads.scatter(load_a, load_b);
  for (int l = 0; l < kWidth; ++l) {
    if (results.touching[first + l] == 0) continue;
    const int body_a = block.a[first + l], body_b = block.b[first + l];
    if (!good[l]) {
      counts_.value[ContactCounts::unresolved] += share(body_a, body_b);
      continue;
    }
    add_load(body_a, load_a[l]);
    add_load(body_b, load_b[l]);
    if (ledger) {
      const double weight = sign[l] * share(body_a, body_b);
      dissipated_.damping += weight * work.damping[l];
      dissipated_.friction += weight * work.friction[l];
    }
  }
}

namespace {

// The load with its torque about the lab's origin instead of x.
const double* shifted(const double* load_of, const double* x, double* to) {
  std::memcpy(to, load_of, 8 * sizeof(double));
  store(Vec3(load(load_of + 3) + load(x).cross(load(load_of))), to + 3);
  return to;
}

}  // namespace

// Sums that keep what each addition loses (Neumaier's variant of Kahan's, by Knuth's two-sum): the same bits
// in whatever order the contacts come, but for the rounding of the rounding errors.
void ContactStages::add_load(int body, const double* load) {
  if (body >= step_.owned) return;
  Accumulator& to = body < 0 ? wall_sum_ : sums_[body];
  double about_origin[8];
  if (body < -1) load = shifted(load, record(body).x, about_origin);
  if (body >= 0 && to.high[7] == 0) loaded_.push_back(body);
  Lane8 x, high, low;
  std::memcpy(&x, load, sizeof x);
  std::memcpy(&high, to.high, sizeof high);
  std::memcpy(&low, to.low, sizeof low);
  const Lane8 sum = high + x, part = sum - high;
  low += (high - (sum - part)) + (x - part);
  std::memcpy(to.high, &sum, sizeof sum);
  std::memcpy(to.low, &low, sizeof low);
}

ContactStages::Sum ContactStages::total(const Accumulator& s) {
  double t[8];
  for (int k = 0; k < 8; ++k) t[k] = s.high[k] + s.low[k];
  return {load(t), load(t + 3), t[6]};
}

// --- reports
// -------------------------------------------------------------------------------------------------

ContactView ContactStages::view(const ContactBlock& block, int lane) const {
  const int a = block.a[lane], b = block.b[lane];
  ContactView v{a, b, share(a, b), block.proof[lane], coefficients(block, lane), {}, Vec3::Zero(), {}};
  block.get(lane, kStateField, kContactStateSize, &v.state);
  if (step_.model == nullptr) v.stored = stored_energy(v.law, v.state);
  v.state.overlap += block.field[kShift][lane];
  if (step_.model == nullptr) {
    if (block.field[kWeight][lane] < 0) {
      v.stored.normal_spring = -v.stored.normal_spring;
      v.stored.tangential_spring = -v.stored.tangential_spring;
      v.state.normal_force = -v.state.normal_force;
      for (double& f : v.state.tangential_force) f = -f;
    }
    return v;
  }
  const auto& memory = *reinterpret_cast<const ModelMemory*>(pool_.memory(block, lane));
  v.torque = load(memory.torque);
  v.stored.normal_spring = memory.normal_energy;
  v.stored.tangential_spring = memory.tangential_energy;
  return v;
}

EnergyLedger ContactStages::stored() const {
  EnergyLedger sum;
  for_each_contact([&](const ContactView& c) { sum.add(c.stored, c.share); });
  if (step_.model != nullptr) return sum;
  for (const FlatContact& flat : pool_.flats())
    if (flat.points.used != 0)
      sum.normal_spring +=
          share(flat.points.a[0], flat.points.b[0]) * step_.laws[flat.points.law[0]].kn * flat.beyond;
  return sum;
}

std::size_t ContactStages::bytes() const {
  return pool_.bytes() + sums_.capacity() * sizeof(Accumulator) +
         a_.capacity() * (2 * sizeof(int) + sizeof(void*) + sizeof(double));
}

}  // namespace nurbs

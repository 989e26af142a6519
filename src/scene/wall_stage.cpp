// Contacts with walls of many faces: the caller finds them anew every step (contact/walls/surface_search.h);
// here they get their history and go through the law with all others.
#include <algorithm>
#include <cmath>
#include <cstring>

#include "contact/walls/surface_search.h"
#include "scene/contact_results.h"

namespace nurbs {

static_assert(kSurfaceContacts <= ContactStages::kMostListed);
namespace {

constexpr double kSameSide = 0.7;             // cosine between normals: 45 degrees
constexpr int kListedSize = 18 + kProofSize;  // doubles of a listed contact beside its record: see pack_list

// The whole periods in a way; each has no component along the axes after its own.
Vec3 periods_in(const Vec3 (&period)[3], Vec3 way) {
  Vec3 sum = Vec3::Zero();
  for (int k = 2; k >= 0; --k) {
    if (period[k][k] == 0) continue;
    const Vec3 whole = std::round(way[k] / period[k][k]) * period[k];
    sum += whole;
    way -= whole;
  }
  return sum;
}

}  // namespace

std::int32_t ContactStages::add_listed(const ContactRecord& record) {
  return adopt_listed(pool_.add(record));
}

// Gives a contact of the pool its partner.
std::int32_t ContactStages::adopt_listed(std::int32_t number) {
  while (partners_.size() < static_cast<std::size_t>(number)) partners_.emplace_back();
  Partner& p = partner(number);
  p = Partner{};
  for (int k = 0; k < 9; k += 4) p.record.turn[k] = 1;
  p.record.radius = kFarAway;
  bind_listed(number, 0);
  return number;
}

// Tells the contact, and its polygon, whose it is.
void ContactStages::bind_listed(std::int32_t number, int body) {
  Partner& p = partner(number);
  p.proof.contact = number;
  bind(number, &p.proof, -1, -1 - number, body, step_.laws == nullptr ? 0 : law_of(-1, body));
}

void ContactStages::drop_listed(std::int32_t number) {
  pool_.remove(number);
  partner(number).next = 0;
}

// Of a contact without a force, which a wall stands back from, the law keeps none.
Vec3 ContactStages::listed_normal(std::int32_t number) const {
  const ContactBlock& block = pool_.blocks()[(number - 1) / kBlock];
  const int lane = ContactPool::lane(number);
  if (const FlatContact* flat = pool_.flat_of(block, lane)) return load(flat->polygon.normal);
  if (block.field[kStateField][lane] == 0) return load(partner(number).normal);
  double normal[3];
  block.get(lane, kStateNormal, 3, normal);
  return load(normal);
}

int ContactStages::former(std::int32_t head, FormerContact* contacts, PairMemory* memories) const {
  int count = 0;
  for (; head != 0 && count < kMostListed; head = partner(head).next) {
    const ContactBlock& block = pool_.blocks()[(head - 1) / kBlock];
    const int lane = ContactPool::lane(head);
    PairMemory& m = memories[count];
    FormerContact& c = contacts[count++];
    c = {listed_normal(head), &m, false};
    c.subtracts = sign(block, lane) < 0;
    if (const FlatContact* flat = pool_.flat_of(block, lane)) {
      c.flat = true;
      c.polygon = &flat->polygon;
      c.until = flat->points.until[0];
      c.frame = load(partner(head).record.x);
    }
    m.proof = partner(head).proof;
    block.get(lane, kLocalModelSize, 10, &m.on_a);
    block.get(lane, 0, kLocalModelSize, &m.model);
  }
  return count;
}

// What the contact is in this step, but for its state of the law.
void ContactStages::update_listed(std::int32_t number, int body, const WallContact& found, bool known) {
  Partner& p = partner(number);
  ContactBlock& block = pool_.block(number);
  const int lane = ContactPool::lane(number);
  const Vec3 x = load(p.record.x);
  if (!known || !step_.setup || step_.changed) {  // before a run begins, a wall's motion may not be there yet
    store(Vec3(found.velocity - found.spin.cross(found.result.point_a - x)), p.record.velocity);
    store(found.spin, p.record.spin);
    store(found.spin, p.record.spin_before);
  }
  p.mark = found.mark;
  p.region = found.region;
  p.path = found.path;
  store(load(step_.bodies->record(body).x), p.body);
  bind_listed(number, body);
  if (step_.bodies->reshaped()) pool_.forget_way(number);
  const std::uint64_t stamp = step_.bodies->stamp(body);
  if (p.stamp != 0 && p.stamp != stamp) forget_spheres(block, lane);
  p.stamp = stamp;
  if (FlatContact* flat = pool_.flat(number); flat && p.region) {  // the wall may have moved
    store(p.region->normal, flat->polygon.normal);
    flat->polygon.offset = p.region->normal.dot(p.region->origin - x);  // it stands back already
    // ... and the outline that the points slide over with it.
    const Vec3 velocity = load(p.record.velocity), spin = load(p.record.spin);
    if (known && found.moves && !step_.setup)
      for (double(&mark)[3] : flat->polygon.mark) {
        const Vec3 at = load(mark);
        store(Vec3(at + step_.dt * (velocity + spin.cross(at))), mark);
      }
  }
  if (found.weight < 0) block.field[kWeight][lane] = found.weight;
  store(found.result.normal, p.normal);
  p.follows = known && may_follow(number, body, found);
  if (p.follows) return;
  ContactResult r = found.result;
  r.point_a -= x;
  r.point_b -= x;
  fresh_.push_back(r);
  block.fresh[lane] = static_cast<int>(fresh_.size());
}

// Whether a contact that goes on can be followed by itself, as a neighbour's: it is at a point of a plane
// that stands still, passes through the contact's fixed point, and is the one its memory is of.
bool ContactStages::may_follow(std::int32_t number, int body, const WallContact& found) const {
  if (!found.face || found.weight < 0 || found.region.has_value() || step_.bodies->reshaped()) return false;
  const Partner& p = partner(number);
  const ContactBlock& block = pool_.blocks()[(number - 1) / kBlock];
  const int lane = ContactPool::lane(number);
  const double height = found.result.normal.dot(found.result.point_a - load(p.record.x));
  return p.shift == 0 && p.proof.stamp == found.memory.proof.stamp && block.field[kFlat][lane] == 0 &&
         std::abs(height) <= kRoundoff * (record(body).radius + load(p.record.x).norm());
}

bool ContactStages::stay(int body, std::int32_t head) {
  if (head == 0 || step_.setup) return false;
  Partner& p = partner(head);
  const ContactBlock& block = pool_.block(head);
  const int lane = ContactPool::lane(head);
  if (!p.follows || p.next != 0 || block.field[kStateField][lane] == 0) return false;
  // A run may begin with the velocity of a wall that has been stopped.
  if (!load(p.record.velocity).isZero(0) || !load(p.record.spin).isZero(0)) return false;
  store(load(step_.bodies->record(body).x), p.body);
  return true;
}

// A contact of the last step on a body's list: where it was, in lab axes.
struct ContactStages::Former {
  std::int32_t number;
  Vec3 normal, point;
  bool subtracts, flat, taken;
};

int ContactStages::list_former(int body, std::int32_t head, Former* former) {
  const BodyRecord& b = step_.bodies->record(body);
  int count = 0;
  for (std::int32_t n = head; n != 0 && count < kMostListed; n = partner(n).next) {
    ContactBlock& block = pool_.block(n);
    const int lane = ContactPool::lane(n);
    block.b[lane] = body;
    ContactState state;
    block.get(lane, kStateField, kContactStateSize, &state);
    BodyRecord& wall = partner(n).record;
    // A body that comes back through a periodic border takes its walls along.
    const Vec3 wrapped = periods_in(step_.period, load(b.x) - load(partner(n).body));
    if (!wrapped.isZero()) {
      store(Vec3(load(wall.x) + wrapped), wall.x);
      partner(n).level += listed_normal(n).dot(wrapped);
    }
    Former& f = former[count++];
    f = {n, listed_normal(n), load(wall.x) + load(state.arm_a), sign(block, lane) < 0, false, false};
    if (const FlatContact* flat = pool_.flat(n)) {
      const ContactPolygon& polygon = flat->polygon;
      f.flat = true;
      const Particle particle = step_.bodies->particle(body);
      f.point = particle.x + particle.scale * (particle.q * middle_of(polygon));
    }
  }
  return count;
}

// Which former contact each of those found goes on with: on the same piece of the wall, then nearest first.
// `number` of those that go on with none stays 0.
void ContactStages::pair_up(int body, Former* former, int formers, const WallContact* found, int count,
                            bool pieces, std::int32_t* number) const {
  const auto alike = [](const Former& f, const WallContact& w) { return f.subtracts == (w.weight < 0); };
  for (int k = 0; k < count && pieces; ++k)
    for (int i = 0; i < formers && number[k] == 0; ++i) {
      if (former[i].taken || !alike(former[i], found[k])) continue;
      if ((former[i].flat && !found[k].region) || !same_piece(former[i].number, body, found[k])) continue;
      former[i].taken = true;
      number[k] = former[i].number;
    }
  for (int pairs = std::min(formers, count); pairs-- > 0;) {
    int best_former = -1, best_found = -1;
    double least = kFarAway;
    for (int i = 0; i < formers; ++i)
      for (int k = 0; k < count && !former[i].taken; ++k) {
        if (number[k] != 0 || !alike(former[i], found[k])) continue;
        if (former[i].normal.dot(found[k].result.normal) < kSameSide) continue;
        if (pieces && former[i].flat) continue;  // a polygon stands on its plane
        const double d = (former[i].point - middle_of(found[k].result)).squaredNorm();
        if (d < least) least = d, best_former = i, best_found = k;
      }
    if (best_former < 0) break;
    former[best_former].taken = true;
    number[best_found] = former[best_former].number;
  }
}

void ContactStages::give(int body, std::int32_t* head, WallContact* found, int count, bool balanced,
                         bool pieces) {
  Former former[kMostListed];
  const int formers = list_former(body, *head, former);
  count = std::min(count, kMostListed);
  std::int32_t number[kMostListed] = {};
  pair_up(body, former, formers, found, count, balanced && pieces, number);

  double age = 0;
  for (int i = 0; i < formers; ++i) age = std::max(age, partner(former[i].number).age);
  bool known[kMostListed];
  for (int k = 0; k < count; ++k) {
    known[k] = number[k] != 0;
    if (known[k]) continue;
    const WallContact& f = found[k];
    number[k] = add_listed({f.memory.model, f.memory.on_a, f.memory.on_b, {}, {0, 0, 0}, 1, 0, 0});
    store(f.result.point_a, partner(number[k]).record.x);
    partner(number[k]).age = age;
    bind_listed(number[k], body);
  }
  // Some surface is counted twice and taken off: no contact is on its own.
  const bool reentrant = std::any_of(former, former + formers, [](const Former& f) { return f.subtracts; }) ||
                         std::any_of(found, found + count, [](const WallContact& w) { return w.weight < 0; });
  if (reentrant && step_.model != nullptr) {  // before what they hold is shared
    for (int k = 0; k < count; ++k)
      if (!known[k] && !step_.setup) inherit(number[k], body, former, formers, found[k]);
    level_spheres(body, found, number, count);
  }
  if (balanced) {
    double left = 0;
    for (int i = 0; i < formers && !step_.setup; ++i)
      if (!former[i].taken) left += leaving_energy(former[i].number, body);
    balance_found(body, found, number, known, count, left);
  }

  for (int k = 0; k < count; ++k) {
    const WallContact& f = found[k];
    const std::int32_t n = number[k];
    partner(n).record.inner = pieces ? 0 : kFarAway;  // a mesh is as thick as paper
    update_listed(n, body, f, known[k]);
    if (!partner(n).follows) {
      if (!known[k] || !step_.setup) {
        ContactBlock& block = pool_.block(n);
        const int lane = ContactPool::lane(n);
        partner(n).proof = f.memory.proof;
        block.set(lane, 0, kLocalModelSize, &f.memory.model);
        block.set(lane, kLocalModelSize, 10, &f.memory.on_a);
      }
      count_listed(f, n, body);
    }
    partner(n).proof.contact = n;
    if (!known[k] && reentrant && !step_.setup && step_.model == nullptr)
      inherit(n, body, former, formers, f);
  }
  for (int i = 0; i < formers; ++i)
    if (!former[i].taken) end_listed(former[i].number);
  std::int32_t* link = head;
  for (int k = 0; k < count; ++k) {
    *link = number[k];
    link = &partner(number[k]).next;
  }
  *link = 0;
}

// Before the wall stands back.
ContactGeometry ContactStages::geometry_of(const WallContact& found, std::int32_t number, int body) const {
  const Vec3 middle = middle_of(found.result);
  return {-found.result.gap, found.result.normal, middle - load(partner(number).record.x),
          middle - load(record(body).x)};
}

// What is taken off is as stiff as the softest contact that it is taken off from, and never pulls more than
// those push: on its flat face a body has another radius than at its edges.
void ContactStages::level_spheres(int body, const WallContact* found, const std::int32_t* number, int count) {
  if (step_.model->volume_radius()) return;
  double sharpest = 0;
  for (int k = 0; k < count; ++k) {
    if (found[k].weight < 0) continue;
    const SphereCurvatures spheres = pool_.flat(number[k]) != nullptr
                                         ? point_spheres(-1 - number[k], body)
                                         : kept_spheres(pool_.block(number[k]), ContactPool::lane(number[k]),
                                                        geometry_of(found[k], number[k], body));
    sharpest = std::max(sharpest, spheres.a + spheres.b);
  }
  for (int k = 0; k < count; ++k)
    if (found[k].weight < 0) set_spheres(number[k], {0, sharpest});
}

// Ends a contact that was not found again.
void ContactStages::end_listed(std::int32_t number) {
  ContactBlock& block = pool_.block(number);
  const int lane = ContactPool::lane(number);
  if (FlatContact* flat = pool_.flat(number)) {
    for (int k = 0; k < kBlock; ++k)
      if (flat->points.used >> k & 1) close(flat->points, k);
  }
  close(block, lane);
  drop_listed(number);
}

// A contact that appears with its counterpart, or in place of one, has the spring of the one it comes from.
void ContactStages::inherit(std::int32_t number, int body, const Former* former, int formers,
                            const WallContact& found) {
  const Former* parent = nullptr;
  const double radius = step_.bodies->record(body).radius;
  double least = 0.25 * radius * radius;
  for (int i = 0; i < formers; ++i) {
    const double d = (former[i].point - middle_of(found.result)).squaredNorm();
    if (former[i].normal.dot(found.result.normal) >= kSameSide && d < least) least = d, parent = former + i;
  }
  if (parent == nullptr) return;
  ContactState old, state;
  const ContactBlock& from = pool_.block(parent->number);
  const int from_lane = ContactPool::lane(parent->number);
  from.get(from_lane, kStateField, kContactStateSize, &old);
  if (old.active == 0) return;
  ContactBlock& block = pool_.block(number);
  const int lane = ContactPool::lane(number);
  if (step_.model != nullptr) return take_over_model(pool_.memory(from, from_lane), block, lane);
  const ContactCoefficients law = coefficients(block, lane);
  take_over(law, geometry_of(found, number, body), motion_of(partner(number).record), motion_of(record(body)),
            step_.dt, load(old.spring), &state);
  block.set(lane, kStateField, kContactStateSize, &state);
  if (step_.ledger && state.active != 0)
    dissipated_.damping -= sign(block, lane) * share(-1, body) * stored_energy(law, state).tangential_spring;
}

// A contact that takes another off is none to be counted, and of a polygon its points are.
void ContactStages::count_listed(const WallContact& found, std::int32_t number, int body) {
  if (found.weight < 0 || pool_.flat(number) != nullptr)
    counts_.value[ContactCounts::iterations] += found.result.iterations;
  else
    count(found.result, -1 - number, body);
}

// --- lists

void ContactStages::begin_lists() {
  for (Partner& p : partners_) p.seen = false;
}

void ContactStages::keep_list(int body, std::int32_t head) {
  for (; head != 0; head = partner(head).next) {
    partner(head).seen = true;
    pool_.forget_way(head);
    bind_listed(head, body);
  }
}

void ContactStages::end_lists() {
  for (std::size_t k = 0; k < partners_.size(); ++k) {
    const auto number = static_cast<std::int32_t>(k + 1);
    if (!partners_[k].seen && pool_.holds(number)) drop_listed(number);
  }
}

int ContactStages::list_size(std::int32_t head) const {
  int size = 1;
  for (; head != 0; head = partner(head).next) size += kListedSize + pool_.packed_size(head);
  return size;
}

int ContactStages::pack_list(std::int32_t head, double* to) const {
  int m = 1, count = 0;
  for (; head != 0; head = partner(head).next, ++count) {
    const Partner& p = partner(head);
    std::memcpy(to + m, p.record.x, 3 * sizeof(double));
    to[m + 3] = p.mark;
    std::memcpy(to + m + 4, p.body, 3 * sizeof(double));
    std::memcpy(to + m + 7, &p.name, sizeof p.name);
    to[m + 8] = p.level;
    to[m + 9] = p.shift;
    std::memcpy(to + m + 10, p.record.velocity, 3 * sizeof(double));
    std::memcpy(to + m + 13, p.record.spin, 3 * sizeof(double));
    to[m + 16] = p.age;
    std::memcpy(to + m + 17, &p.stamp, sizeof p.stamp);
    std::memcpy(to + m + 18, &p.proof, sizeof p.proof);
    m += kListedSize;
    const int size = pool_.pack(head, to + m);
    if (to[m + kStateField] == 0) std::memcpy(to + m + kStateNormal, p.normal, sizeof p.normal);
    m += size;
  }
  to[0] = count;
  return m;
}

std::int32_t ContactStages::unpack_list(const double* from, int* size) {
  std::int32_t first = 0;
  int m = 1;
  std::int32_t last = 0;
  for (int k = static_cast<int>(from[0]); k-- > 0;) {
    int record_size = 0;
    const double* values = from + m;
    const std::int32_t loose = pool_.unpack(values + kListedSize, &record_size);
    const std::int32_t number = adopt_listed(loose);
    Partner& p = partner(number);
    std::memcpy(p.normal, values + kListedSize + kStateNormal, sizeof p.normal);
    std::memcpy(p.record.x, values, 3 * sizeof(double));
    p.mark = static_cast<int>(values[3]);
    std::memcpy(p.body, values + 4, 3 * sizeof(double));
    std::memcpy(&p.name, values + 7, sizeof p.name);
    p.level = values[8];
    p.shift = values[9];
    std::memcpy(p.record.velocity, values + 10, 3 * sizeof(double));
    std::memcpy(p.record.spin, values + 13, 3 * sizeof(double));
    std::memcpy(p.record.spin_before, values + 13, 3 * sizeof(double));
    p.age = values[16];
    std::memcpy(&p.stamp, values + 17, sizeof p.stamp);
    std::memcpy(&p.proof, values + 18, sizeof p.proof);
    p.proof.contact = number;
    if (last == 0)
      first = number;
    else
      partner(last).next = number;
    last = number;
    m += kListedSize + record_size;
  }
  *size = m;
  return first;
}

}  // namespace nurbs

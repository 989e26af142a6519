// A time step of all contacts of one kind (pairs of bodies, or bodies and a wall), in stages over arrays:
//   (a) per body, once: scene/bodies.h
//   (b) budgets: neighbours that cannot have come together since they were proven apart
//   (c) local models of all contacts, closed forms of ellipsoids (eight side by side)
//   (d) solves for the rest: contacts that go on side by side, then the contact search, one pair at a time
//   (e) the law                               (eight side by side)
//   (f) sums of forces, independent of the order of the pairs
// (c) to (f) go block by block, while a block is in the cache. The host owns the proofs of its neighbours
// (they travel with its neighbour lists) and hands in who is whose neighbour; the contacts are owned here.
#pragma once

#include <array>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "contact/effective_radius.h"
#include "contact/walls/surface_search.h"
#include "laws/energy_ledger.h"
#include "scene/contact_pool.h"

namespace nurbs {

struct ContactRest;  // scene/wall_energy.h

// What came of the pairs in one step, in the order of compute nurbs/stats.
struct ContactCounts {
  enum Index {
    neighbours,
    safe,
    bounds,
    local_model,
    warm,
    cold,
    fallback,
    contacts,
    iterations,
    unresolved,
    deep,
    size
  };
  std::array<double, size> value{};
  void add(const ContactResult& result, double weight);
};

// Contacts that are too deep for a penalty law, of a step or of a run's steps.
struct DeepContacts {
  static constexpr double kDepth = 0.1;  // of the smaller bounding radius
  // In a run, where bodies with flat faces have gained energy under Hertz's law, and for others.
  static constexpr double kFlatInRun = 0.15, kRoundInRun = 0.3;
  // Of what the bodies are thick, the sum of the radii of balls inside both: from twice that on thin ones are
  // pushed out on the other side.
  static constexpr double kThroughInRun = 0.5;
  double count = 0, deepest = 0;  // of the smaller bounding radius
  double through = 0;             // deepest of what both are thick, beyond kThroughInRun
};

// Force and torque of one contact, as a host reports it.
struct ContactView {
  int a, b;      // bodies; a < 0: the wall
  double share;  // of the contact that is this rank's: a half where one body is a ghost
  PairProof* proof;
  ContactCoefficients law;  // with the contact's share of the stiffness; zeros where a model serves
  ContactState state;
  Vec3 torque;          // of a model beside that of the force, on B
  EnergyLedger stored;  // in its springs; negative, as the forces are, where it takes others off
};

// A contact of a body with a wall of many faces, found by the caller (contact/walls/surface_search.h).
struct WallContact {
  ContactResult result;  // points in lab axes from the lab's origin; A is the wall
  double weight = 1;     // +1, or below 0: what other contacts count twice
  Vec3 velocity = Vec3::Zero(), spin = Vec3::Zero();  // of the wall at point_a; lab
  bool moves = false;                                 // the wall itself, not its surface alone, as a belt's
  int mark = 0;                                       // the caller's
  // At a point of a plane that stands still: a contact that goes on there follows by itself.
  bool face = false;
  std::optional<PlaneRegion> region;  // that a flat feature of the body stands on, until the end of the step
  std::uint64_t name = 0;             // of the piece of the wall
  double flat = 0;                    // length by which planes may differ that are one to the body
  double path = 0;                    // of the body and the wall together, as Bodies::path
  PairMemory memory;
};

// Whether a result is a contact.
inline bool touches(const ContactResult& r) {
  return r.status != Status::separated && r.gap < 0 && r.normal.squaredNorm() > 0.5;
}

class ContactStages {
 public:
  struct Results;  // contact_results.h
  struct Step {
    const Bodies* bodies = nullptr;
    int owned = 0;  // bodies from here on are ghosts: they get no force, and their contacts count half
    double dt = 0;
    bool setup = false;    // forces before the first step of a run: nothing may move on
    bool changed = false;  // with setup: forces are not those of the step before, if there was one
    bool ledger = false;   // count what is dissipated
    ContactSettings settings;
    Vec3 period[3] = {Vec3::Zero(), Vec3::Zero(), Vec3::Zero()};  // of the box, x first; 0 where it ends
    // Laws by types of bodies: number types[a] * type_count + types[b]; without types number 0.
    const int* types = nullptr;
    int type_count = 0;
    const ContactCoefficients* laws = nullptr;
    // The host's numbers of the bodies; those beyond the last one have just been inserted. Without: none
    // have.
    const int* tags = nullptr;
    int last_tag = 0;
    // The wall's surface, where it is a cylinder; a model asks how it is bent.
    struct Cylinder {
      Vec3 origin = Vec3::Zero(), axis = Vec3::UnitZ();
      double radius = 0;  // 0: it is none
    } cylinder;
    // Serves instead of the laws, which are then not read. Its contacts' memory must have been allotted.
    const ContactModel* model = nullptr;
    // Partner of neighbours with a < 0: a plane through its x with this normal; free = 0, mass infinite.
    const BodyRecord* wall = nullptr;
    Vec3 wall_normal = Vec3::Zero();
  };
  struct Unresolved {
    bool any = false;
    int a = 0, b = 0;
    Particle particle_a, particle_b;
  };
  struct Sum {
    Vec3 force, torque;
    double normal;  // sum of the normal forces
  };

  // Who is whose neighbour from now on: begin, a call per pair (a is A of the pair, negative: the wall), end.
  // Contacts whose proofs do not come again are gone after end. The proofs must stay where they are until
  // then.
  void begin_neighbours();
  void add_neighbour(int a, int b, PairProof* proof) {
    a_.push_back(a);
    b_.push_back(b);
    proofs_.push_back(proof);
  }
  void end_neighbours();

  void compute(const Step& step);

  // Contacts that the caller finds itself every step, instead of neighbours. They are listed by body: a head,
  // the number of its first contact (0: none), travels with the body. A step is begin_step, give for every
  // body that touches or has a list, end_step. At most kMostListed a body.
  static constexpr int kMostListed = 64;
  void begin_step(const Step& step);
  // What came of the last step's contacts is carried over to those of this one by place and normal, whatever
  // part of the wall they were on; those without a successor are closed. `balanced`: contacts that come or go
  // at finite overlap neither bring nor, if it can be helped, take energy (wall_energy.cpp); `found` is
  // changed accordingly. `pieces`: of a wall that has some, by which contacts are told apart.
  void give(int body, std::int32_t* head, WallContact* found, int count, bool balanced = false,
            bool pieces = true);
  // In place of give, where the body's one contact still is the one with the face that the last give said: so
  // long it needs no search. False where it has none such, or not any more.
  bool stay(int body, std::int32_t head);
  void end_step(double neighbours);
  // A body's contacts of the last step, where the next search goes on, with room for their memories; how
  // many. Polygons are there until the next call of give.
  int former(std::int32_t head, FormerContact* contacts, PairMemory* memories) const;
  // After bodies were renumbered or have left: begin, a call per body with a list, end. Others are dropped.
  void begin_lists();
  void keep_list(int body, std::int32_t head);
  void end_lists();
  int list_size(std::int32_t head) const;  // doubles
  int pack_list(std::int32_t head, double* to) const;
  std::int32_t unpack_list(const double* from, int* size);
  // Of a contact with such a body a: its mark, and the wall's velocity at the contact point.
  int mark(int a) const { return partners_[-2 - a].mark; }
  Vec3 wall_velocity(const ContactView& c) const {
    const BodyRecord& wall = record(c.a);
    return load(wall.velocity) + load(wall.spin).cross(load(c.state.arm_a));
  }

  // Sums over the contacts of the last compute: of an owned body, and of the wall (torque about its x).
  // Bodies that are not among `loaded` have none.
  const std::vector<int>& loaded() const { return loaded_; }
  Sum sum(int i) const { return total(sums_[i]); }
  Sum wall_sum() const { return total(wall_sum_); }

  const ContactCounts& counts() const { return counts_; }
  const DeepContacts& deep() const { return deep_; }
  const DeepContacts& deep_inserted() const { return deep_inserted_; }  // those of inserted bodies
  const DeepContacts& deep_in_run() const { return deep_in_run_; }
  const Unresolved& unresolved() const { return unresolved_; }  // the first of the last compute
  EnergyLedger& dissipated() { return dissipated_; }
  const EnergyLedger& dissipated() const { return dissipated_; }
  EnergyLedger stored() const;
  ContactPool& pool() { return pool_; }
  const ContactPool& pool() const { return pool_; }
  std::size_t bytes() const;

  // Calls visit(ContactView) for every touching contact.
  template <class Visit>
  void for_each_contact(Visit visit) const {
    const auto each = [&](const ContactBlock& block) {
      for (int lane = 0; lane < kBlock; ++lane)
        if ((block.used >> lane & 1) && block.field[kStateField][lane] != 0) visit(view(block, lane));
    };
    for (const ContactBlock& block : pool_.blocks()) each(block);
    for (const FlatContact& flat : pool_.flats()) each(flat.points);
  }

 private:
  struct alignas(64) Accumulator {
    double high[8], low[8];  // force, torque, normal force, number of contacts; what was lost of them
  };
  static Sum total(const Accumulator& s);
  double share(int a, int b) const { return a < step_.owned && b < step_.owned ? 1 : 0.5; }
  ContactView view(const ContactBlock& block, int lane) const;
  const BodyRecord& record(int body) const {
    return body >= 0 ? step_.bodies->record(body) : body == -1 ? *step_.wall : partners_[-2 - body].record;
  }
  double path(int a, int b) const;
  double expiry(int k, double lower) const;
  std::uint64_t stamp_of(int a, int b) const;
  int law_of(int a, int b) const;
  Vec3 offset(int a, int b) const;
  double smaller_radius(int a, int b) const;

  ContactCoefficients coefficients(const ContactBlock& block, int lane) const;
  // -1 of a contact that takes off what others count twice.
  static int sign(const ContactBlock& block, int lane) { return block.field[kWeight][lane] < 0 ? -1 : 1; }

  void bind(std::int32_t number, PairProof* proof, int neighbour, int a, int b, int law);
  void bind_neighbour(int k);
  void set_law(int k);
  void check_stamps();
  void check_budgets();
  double proven(int k) const;
  bool stays_near(int a, int b, double lower, double steps) const;
  void look(int k);
  ContactResult search(int a, int b, PairMemory& memory);
  Vec3 wall_normal(int a) const { return a == -1 ? step_.wall_normal : load(partners_[-2 - a].normal); }
  void count(const ContactResult& result, int a, int b);
  void note_depth(int a, int b, double gap);

  void prefetch(const ContactBlock& block) const;
  void prefetch_pair(int a, int b, const PairProof* proof) const;
  void compute_block(ContactBlock& block);
  void serve(ContactBlock& block, int first, Results& results) const;
  void follow_surfaces(ContactBlock& block, int first, Results& results) const;
  void solve_lane(ContactBlock& block, int lane, Results& results);
  double same_place(int a, int b, const Vec3& apart) const;
  bool is_where_left(int a, const ContactGeometry& geometry, double same, ContactState* state) const;
  void start_run(ContactBlock& block, int lane, const Results& results);
  void close(ContactBlock& block, int lane);
  void release(ContactBlock& block, int lane, double lower);
  void apply_law(ContactBlock& block, const Results& results);
  template <bool ledger>
  void apply_law(ContactBlock& block, int first, const Results& results);

  // A contact model in the law's place: model_stage.cpp.
  ModelMemory& begin_memory(ContactBlock& block, int lane);
  ModelMemory& model_memory(const ContactBlock& block, int lane) {
    return *reinterpret_cast<ModelMemory*>(pool_.memory(block, lane));
  }
  using PointMemories = std::array<const double*, kContactPoints>;
  PointMemories point_memories(const FlatContact& flat) const;
  double model_energy(int a, int b, const double* memory, const SphereCurvatures& spheres,
                      const ContactGeometry& geometry) const;
  double model_energy(const ContactBlock& block, int lane, const ContactGeometry& geometry) const;
  double model_energy(const ContactPolygon& polygon, const PolygonState& state, int a, int b,
                      const double* const* memory) const;
  PolygonState give_model(ContactPolygon* polygon, int a, int b, double energy,
                          const double* const* memory) const;
  ModelContact model_contact(int a, int b, const ContactGeometry& geometry, const ModelMemory& own) const;
  SphereCurvatures point_spheres(int a, int b) const;                            // of a polygon's points ...
  SphereCurvatures inherited_spheres(const double* memory, int a, int b) const;  // ... or those remembered
  SphereCurvatures kept_spheres(const ContactBlock& block, int lane, const ContactGeometry& g) const;
  bool knows_spheres(const double* memory) const;
  void set_spheres(std::int32_t number, const SphereCurvatures& spheres);
  void forget_spheres(ContactBlock& block, int lane);  // of a body that is another now
  SphereCurvatures model_curvatures(const ContactBlock& block, int lane,
                                    const ContactGeometry& geometry) const;
  void apply_model(ContactBlock& block, const Results& results);
  void ask_model(ContactBlock& block, int lane, const ContactGeometry& geometry, double damper_share,
                 bool moves_on);
  void book_model(const ContactBlock& block, int lane, const ContactState& before, const ModelMemory& old,
                  const ContactState& now, const ModelMemory& own);
  void finish_model(ContactBlock& block, int lane);
  void take_over_model(const double* from, ContactBlock& block, int lane);
  void remake_model(FlatContact& flat, const ContactPolygon& polygon, const int* source);
  void leave_model(ContactBlock& block, int lane, FlatContact& flat, const PolygonState& state,
                   double overlap, ContactState* single);
  void load_model(const ContactBlock& block, int lane, const ContactState& state);

  // The wall's side of a listed contact, which is body -1 - number; wall_stage.cpp.
  struct Partner {
    BodyRecord record{};  // x: a fixed point near the contact
    PairProof proof{};
    std::int32_t next = 0;  // contact of the same body
    int mark = 0;
    bool seen = false;
    double body[3] = {};                // where the body was in the last step
    std::uint64_t stamp = 0;            // the body's then, if it is known
    std::optional<PlaneRegion> region;  // of this step
    double path = 0;                    // of wall and body
    double normal[3] = {};              // of the contact, as found last
    bool follows = false;               // it follows the face of that normal through record.x by itself
    // Of balanced contacts.
    std::uint64_t name = 0;  // of the piece of the wall
    double level = 0;        // normal . wall's point
    double shift = 0;        // by which the wall stands back, length
    double age = 0;          // of the body's unbroken contact with the wall, rad of its own oscillation
  };
  Partner& partner(std::int32_t number) { return partners_[number - 1]; }
  const Partner& partner(std::int32_t number) const { return partners_[number - 1]; }
  std::int32_t add_listed(const ContactRecord& record);
  std::int32_t adopt_listed(std::int32_t number);
  void bind_listed(std::int32_t number, int body);
  void drop_listed(std::int32_t number);
  Vec3 listed_normal(std::int32_t number) const;
  // By which a wall stands back from a body, a listed contact's side of which is `a`.
  double wall_shift(int a) const { return a < -1 ? partners_[-2 - a].shift : 0; }
  void end_listed(std::int32_t number);
  struct Former;
  int list_former(int body, std::int32_t head, Former* former);
  void pair_up(int body, Former* former, int formers, const WallContact* found, int count, bool pieces,
               std::int32_t* number) const;
  void inherit(std::int32_t number, int body, const Former* former, int formers, const WallContact& found);
  void count_listed(const WallContact& found, std::int32_t number, int body);
  ContactGeometry geometry_of(const WallContact& found, std::int32_t number, int body) const;
  void level_spheres(int body, const WallContact* found, const std::int32_t* number, int count);
  void update_listed(std::int32_t number, int body, const WallContact& found, bool known);
  bool may_follow(std::int32_t number, int body, const WallContact& found) const;

  // What contacts that take each other's place hold: wall_energy.cpp.
  struct Holding;
  double unit_energy(std::int32_t number, int body, const ContactGeometry& geometry);
  double overlap_of(std::int32_t number, int body, ContactGeometry geometry, double energy);
  double polygon_energy(std::int32_t number, int body, double shift, double ago = 0);
  double leaving_energy(std::int32_t number, int body);
  double half_way(std::int32_t number, const Vec3& normal) const;
  bool same_piece(std::int32_t number, int body, const WallContact& found) const;
  bool jumps(std::int32_t number, int body, const WallContact& found) const;
  PolygonState polygon_state(const ContactPolygon& polygon, int b, const Vec3& wall, int a) const;
  void balance_found(int body, WallContact* found, const std::int32_t* number, const bool* known, int count,
                     double left);
  void stand_closer(std::int32_t number, int body, const ContactGeometry& geometry);
  void hold(Holding* h, int body, double energy);
  void balance(int body, Holding* holdings, int count, double left);
  void stand_back(std::int32_t number, int body, WallContact* found);

  // Flat faces, creases and ruled lines: flat_stage.cpp.
  bool may_be_flat(int a, int b) const;
  double clear_way(int a, int b, double* until) const;
  Vec3 wall_frame(int a) const;
  bool find_polygon(int a, int b, const Vec3& normal, double overlap, double reach, const ContactPolygon* old,
                    ContactPolygon* polygon, double* clear = nullptr,
                    const SurfacePoint* starts = nullptr) const;
  void finish(const ContactCoefficients& law, int a, int b, const ContactState& state);
  bool make_flat(ContactBlock& block, int lane, const Results& single);
  struct LeftPolygon {  // what a polygon leaves behind
    bool any = false;
    double normal_energy = 0, tangential_energy = 0;
    Vec3 spring = Vec3::Zero();  // mean of the tangential springs, weighted with the normal ones
  };
  bool stands_as_left(const FlatContact& flat, const PolygonState& state, int a, int b) const;
  void forget_flat(ContactBlock& block, int lane);
  bool serve_flat(ContactBlock& block, int lane, LeftPolygon* left);
  bool remake(ContactBlock& block, int lane, FlatContact& flat, PolygonState& state, double overlap);
  BodyFrame frame_before(int i, const Vec3& wall, double ago = 1) const;
  double energy_rolled(const FlatContact& flat, double energy, const ContactPolygon& polygon, double holds,
                       int a, int b, const PointMemories& memory) const;
  double kept_energy(const FlatContact& flat, const PolygonState& state, const ContactPolygon& polygon,
                     const PolygonState& fresh, int a, int b, const PointMemories& memory,
                     double holds) const;
  void run_flat(ContactBlock& block, int lane, FlatContact& flat, const PolygonState& state);
  LeftPolygon leave_flat(ContactBlock& block, int lane, FlatContact& flat, const PolygonState& state,
                         double overlap);
  void settle_left(ContactBlock& block, int lane, Results& results, const LeftPolygon& left);
  double arrival(int a, int b, const Vec3& normal, const Vec3& arm_a, const Vec3& arm_b) const;
  double energy_of(const ContactPolygon& polygon, const PolygonState& state, int a, int b,
                   const PointMemories& memory) const;
  void relax_polygon(const ContactBlock& block, int lane, const ContactRest& rest, FlatContact& flat,
                     PolygonState* state);
  void stand_at(double shift, int a, ContactPolygon* polygon);
  void stand_at(double shift, int a, int lane, Results* results);
  PolygonState give(ContactPolygon* polygon, int a, int b, double energy, const PointMemories& memory);
  void stand_off(ContactBlock& block, int lane, Results& results);
  void relax_single(ContactBlock& block, int lane, Results& results);
  void book(double energy, int a, int b);
  void add_load(int body, const double* load);

  // By neighbour: bodies, proof, and the sum of the bodies' paths up to which they are known to be apart;
  // infinite for those that have a contact.
  std::vector<int> a_, b_;
  std::vector<PairProof*> proofs_;
  std::vector<double> expiry_;
  bool renewed_ = false;

  ContactPool pool_;
  std::deque<Partner> partners_;      // by contact number, from 1
  std::vector<ContactResult> fresh_;  // results of contacts that stage (b) found, or the caller
  LineVector<Accumulator> sums_;      // zero but for the loaded
  std::vector<int> loaded_;
  Accumulator wall_sum_{};
  double neighbour_weight_ = 0;
  Step step_;
  ContactCounts counts_;
  DeepContacts deep_, deep_inserted_, deep_in_run_;
  Unresolved unresolved_;
  EnergyLedger dissipated_;
};

}  // namespace nurbs

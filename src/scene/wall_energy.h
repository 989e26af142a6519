// What flat_stage.cpp and wall_energy.cpp agree on: how contacts that hand over to each other come back to
// their own stiffness.
#pragma once

#include <algorithm>
#include <cmath>

#include "scene/contact_results.h"

namespace nurbs {

// Of its distance to 1 that a factor moves in a radian of the contact's own oscillation, and of a wall's
// shift: a corner that has come down flat is up to four times too stiff, and the spring energy that it gives
// up is booked. Contacts wait for it until they rest: what raising a factor puts in is booked too, and is
// then no more than the springs hold under the bodies' weight.
constexpr double kRelaxation = 0.1;
// Of the speed and the acceleration of an oscillation as wide as its overlap, that a contact at rest has:
// small against both, whatever the time step. One that turns back in a bounce has the acceleration.
constexpr double kResting = 0.02;
constexpr double kLasting = 12;   // rad of a contact's oscillation: a bounce, which has pi, is over by then;
                                  // a factor falls then without rest too, as that takes energy out only
constexpr double kArrival = 1.1;  // ways of a step that a contact which begins at its surface is deep
constexpr double kStiffest = 8;   // factor or weight of a contact; four is what a corner needs

// How a contact moves beside its own oscillation, whose frequency is the root of force over overlap and
// reduced mass (by the sum of the inverse masses): by the last step's rate and this one's.
struct ContactRest {
  double phase = 0;  // of the oscillation in a step, rad, at most 1
  bool rests = false;
};
inline ContactRest rest_of(const ContactState& s, const BodyRecord& a, const BodyRecord& b) {
  ContactRest r;
  if (!(s.active != 0 && s.overlap > 0 && s.normal_force > 0)) return r;
  r.phase = std::min(1.0, s.dt * std::sqrt(s.normal_force / s.overlap * (a.inverse_mass + b.inverse_mass)));
  const Vec3 now = velocity_at(a, b, load(a.spin), load(b.spin), load(s.arm_a), load(s.arm_b));
  const double wide = kResting * s.overlap * r.phase, change = -now.dot(load(s.normal)) - s.rate;
  r.rests = std::abs(s.rate) * s.dt <= wide && std::abs(change) * s.dt <= wide * r.phase;
  return r;
}
// Of the first `count` points of a polygon: all of those that bear rest, and the slowest one's phase of those
// that push (a damper may hold back a spring). One on which none bears doesn't.
inline ContactRest rest_of(const FlatContact& flat, int count, const BodyRecord& a, const BodyRecord& b) {
  ContactRest all{1, true};
  bool bears = false;
  for (int k = 0; k < count; ++k) {
    ContactState point;
    flat.points.get(k, kStateField, kContactStateSize, &point);
    if (point.active == 0) continue;
    const ContactRest one = rest_of(point, a, b);
    if (one.phase > 0) all.phase = std::min(all.phase, one.phase);
    all.rests = all.rests && one.rests;
    bears = true;
  }
  return bears ? all : ContactRest{};
}

// The overlap at which a contact holds an energy, `unit(overlap)` of which is nearly a power; from an overlap
// at which it holds some.
template <class Unit>
double overlap_holding(double energy, double overlap, const Unit& unit) {
  if (!(energy > 0)) return 0;
  double power = 2.25;
  double held = unit(overlap);
  for (int k = 0; k < 8 && held > 0 && std::abs(held - energy) > 1e-9 * energy; ++k) {
    const double before = overlap, last = held;
    overlap *= std::pow(energy / held, 1 / power);
    held = unit(overlap);
    const double way = std::log(overlap / before);
    if (way != 0 && held > 0) power = std::clamp(std::log(held / last) / way, 1.0, 4.0);
  }
  return overlap;
}

// A contact of a body in the balance.
struct ContactStages::Holding {
  std::int32_t number = 0;
  bool begins = false;       // with this piece of the wall, at a finite overlap
  bool negative = false;     // takes others off ...
  double more = 0;           // ... more times than before
  ContactGeometry geometry;  // before the wall stands back
  double ago = 0;            // how much deeper it was half a step ago
  double unit = 0;           // energy without shift, at weight 1, then
  double energy = 0;         // as it is
  double target = 0;
  ContactGeometry middle() const {
    ContactGeometry g = geometry;
    g.overlap = std::max(0.0, g.overlap + ago);
    return g;
  }
};

}  // namespace nurbs

// See tube_search.h.
#include "contact/walls/tube_search.h"

#include <algorithm>
#include <cmath>

#include "body/support.h"
#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

constexpr double kWidestGap = 2;  // rad, between contacts that a minimum above the radius may part

static_assert(0.5 * kRingNormals + kSurveyRoom < kNormalMargin);

// F and its slope along the circle, from one support search.
struct Reach {
  double angle = 0, value = 0, slope = 0;
  Vec3 on_body = Vec3::Zero();
  SurfacePoint where;
};

class Tube {
 public:
  // `ahead`: where angles are counted from; zero: anywhere.
  Tube(const Particle& particle, const CylinderPose& pose, const Vec3& ahead)
      : particle_(particle),
        axes_(particle.q.toRotationMatrix()),
        axis_(pose.axis),
        u_(ahead.squaredNorm() > 0 ? Vec3((ahead - ahead.dot(pose.axis) * pose.axis).normalized())
                                   : pose.axis.unitOrthogonal()),
        v_(pose.axis.cross(u_)),
        apart_(pose.apart),
        nearest_(kNearestOnWall * std::min(particle.scale * particle.shape->bounding_radius, pose.radius)) {}

  // On the wall, of maxima that are not found as one.
  double nearest() const { return nearest_; }

  Vec3 direction(double angle) const { return std::cos(angle) * u_ + std::sin(angle) * v_; }
  double angle(const Vec3& d) const { return std::atan2(d.dot(v_), d.dot(u_)); }
  // `start`: where the search begins. F errs by kRingSupport at most.
  Reach look(double angle, const Reach* start = nullptr) const {
    Reach r;
    r.angle = angle;
    const double c = std::cos(angle), s = std::sin(angle);
    const Vec3 d = (c * u_ + s * v_).normalized(), e = c * v_ - s * u_;
    const Shape& shape = *particle_.shape;
    const Support found = find_hull_support(shape, axes_.transpose() * d, start ? &start->where : nullptr,
                                            kRingSupport * shape.bounding_radius);
    r.on_body = axes_ * (particle_.scale * found.point);
    r.where = found.where;
    r.value = d.dot(apart_) + particle_.scale * found.h;
    r.slope = e.dot(apart_ + r.on_body);
    return r;
  }

  // The maximum between a rise and a fall of F. The slope jumps where the body is flat.
  Reach top(Reach low, Reach high) const {
    double weight_low = 1, weight_high = 1;
    int raised = 0;
    for (int k = 0; k < 80 && high.angle - low.angle > 1e-13; ++k) {
      const double l = weight_low * low.slope, h = weight_high * high.slope;
      const double t = k % 4 == 3 ? 0.5 : std::clamp(l / (l - h), 1e-7, 1 - 1e-7);
      const double angle = low.angle + t * (high.angle - low.angle);
      const Reach next = look(angle, t < 0.5 ? &low : &high);
      const double moved = std::min(angle - low.angle, high.angle - angle);
      if (next.slope > 0) {
        weight_high = raised == 1 ? 0.5 * weight_high : 1;
        weight_low = 1;
        raised = 1;
        low = next;
      } else {
        weight_low = raised == -1 ? 0.5 * weight_low : 1;
        weight_high = 1;
        raised = -1;
        high = next;
      }
      if (moved < 1e-11 && std::abs(next.slope) < 1e-14 * particle_.scale * particle_.shape->bounding_radius)
        break;
    }
    Reach best = low.slope < -high.slope ? low : high;  // values near a maximum differ by round-off
    const double drop = low.slope - high.slope;
    if (low.slope > 0 && high.slope < 0 && drop > 0)
      best.on_body = low.on_body + low.slope / drop * (high.on_body - low.on_body);
    return best;
  }

  // The minimum between two maxima, where it is above `level`. Supports of the points found so far are F's
  // lower bounds: where those of a fall and a rise cross, it is the minimum if F is no more there.
  bool bottom(Reach low, Reach high, double level, Reach* found) const {
    const double noise = kRingSupport * particle_.scale * particle_.shape->bounding_radius;
    for (int k = 0; k < 60; ++k) {
      const Vec3 way = high.on_body - low.on_body;
      const double width = high.angle - low.angle, cross = std::atan2(-way.dot(u_), way.dot(v_));
      const double turn = std::remainder(cross - low.angle, M_PI),
                   secant = low.slope / (low.slope - high.slope);
      double t = k % 2 == 0 ? (turn < 0 ? turn + M_PI : turn) / width : secant;
      const bool inside = t > 1e-7 && t < 1 - 1e-7;
      if (!inside) t = 0.5;
      const double angle = low.angle + t * width;
      const Reach next = look(angle, t < 0.5 ? &low : &high);
      if (!(next.value > level)) return false;
      const Vec3 d = direction(angle);
      const double least = d.dot(apart_) + std::max(d.dot(low.on_body), d.dot(high.on_body));
      *found = next;
      if ((k % 2 == 0 && inside && next.value - least <= noise) || width < 1e-12) {
        // Of the points that are as far out, that where F does not turn.
        const Vec3 e = std::cos(angle) * v_ - std::sin(angle) * u_;
        const double l = e.dot(apart_ + low.on_body), h = e.dot(apart_ + high.on_body);
        if (h > l) found->on_body = low.on_body + std::clamp(-l / (h - l), 0.0, 1.0) * way;
        return true;
      }
      (next.slope < 0 ? low : high) = next;
    }
    return true;
  }

  // Whether maxima between two directions are nearer than nearest(): where F' = 0 twice, rho - F sums to
  // 0 in between, so that they are as far apart on the wall as the outline is long.
  bool is_short(const Reach& low, const Reach& high) const {
    const double width = high.angle - low.angle;
    if (!(width <= kNarrowArc)) return false;
    const Vec3 way = high.on_body - low.on_body, across = way - way.dot(axis_) * axis_;
    return across.norm() <= 0.99 * nearest_;
  }

  // Whether the body is more curved than `radius` between two directions, also after a turn of kSurveyRoom.
  bool round(double low, double high, double radius) const {
    const NormalMap& map = particle_.shape->normal_map;
    const double width = high - low;
    if (map.cells == 0 || !(width <= kNarrowArc)) return false;
    const int count = static_cast<int>(std::ceil(width / kRingNormals));
    for (int k = 0; k < count; ++k) {
      const Vec3 n = axes_.transpose() * direction(low + (k + 0.5) / count * width);
      if (!(particle_.scale * map.radius_at(n) < radius)) return false;
    }
    return true;
  }

 private:
  const Particle& particle_;
  const Mat3 axes_;
  const Vec3 axis_, u_, v_, apart_;
  const double nearest_;
};

// F is at most this between two directions less than pi apart: the support lines' corner, as F is sublinear.
double most_between(const Reach& low, const Reach& high) {
  const double c = std::cos(high.angle - low.angle), s = std::sin(high.angle - low.angle), l = low.value,
               h = high.value, ends = std::max(l, h);
  return h > c * l && l > c * h ? std::max(ends, std::sqrt(l * l + h * h - 2 * l * h * c) / s) : ends;
}

// A contact of the last step that was followed.
struct Known {
  CylinderContact contact;
  PairMemory memory;
  double angle = 0;
};

enum Kind : unsigned char {
  kAway,   // F stays below the radius,
  kRound,  // has one maximum at most above it in all such intervals side by side,
  kMixed,  // is round, beside an open one,
  kOpen,   // or nothing is known of it
};

// Room that is used again by every search of a thread.
struct TubeWorkspace {
  static constexpr int kMost = 512;
  // Directions in the order of their angles, closer together where F may exceed the radius, and what is
  // between each and the one before.
  Reach at[kMost];
  Kind kind[kMost];
  Known known[kSurfaceContacts], last;
  FormerContact maxima[kSurfaceContacts];
};
TubeWorkspace& tube_workspace() {
  static thread_local TubeWorkspace w;
  return w;
}

// Largest curvature radius of a body, its joints left out.
double flattest_radius(const Particle& particle) {
  return particle.scale * particle.shape->patch_curvature.max_radius;
}

class TubeSearch {
 public:
  TubeSearch(const Particle& particle, const CylinderPose& pose, const ContactSettings& settings,
             SurfaceContacts* out)
      : particle_(particle),
        pose_(pose),
        settings_(settings),
        size_(particle.scale * particle.shape->bounding_radius),
        distance_(pose.apart.norm() < pose.noise ? 0
                                                 : pose.apart.norm()),  // its direction would be round-off's
        tube_(particle, pose, distance_ > 0 ? pose.apart : Vec3::Zero()),
        out_(*out) {}

  // In the order of their angles, however they were found.
  void sort_around() {
    const auto before = [&](const SurfaceContact& a, const SurfaceContact& b) {
      return tube_.angle(-a.normal) < tube_.angle(-b.normal);
    };
    if (!std::is_sorted(out_.contact, out_.contact + out_.count, before))
      std::sort(out_.contact, out_.contact + out_.count, before);
  }

  // F - radius is a function on the circle, and the potentials of its maxima less those of its minima are as
  // smooth as that is: where a maximum and a minimum meet and are gone, nothing is lost. So minima between
  // contacts count against them. After sort_around().
  void take_off_minima() {
    double angle[kSurfaceContacts];
    const int count = out_.count;
    if (count < 2) return;
    for (int k = 0; k < count; ++k) angle[k] = tube_.angle(-out_.contact[k].normal);
    for (int from = 0; from < count; ++from) {
      const int to = (from + 1) % count;
      const double width = angle[to] - angle[from] + (to == 0 ? 2 * M_PI : 0);
      if (width > kWidestGap) continue;
      const Reach low = reach_at_contact(from, angle[from]), high = reach_at_contact(to, angle[from] + width);
      Reach least;
      if (!tube_.bottom(low, high, pose_.radius, &least)) continue;
      const Known k_least = known(least);
      SurfaceContact c = surface_contact(k_least.contact, k_least.memory);
      c.weight = -1;
      out_.add(c);
    }
  }

  bool is_single() const { return distance_ > 0 && !wants_survey(particle_, pose_.radius); }
  // The one maximum of a body that is more curved than the tube everywhere: a former contact's, or looked
  // for.
  double find_one(const FormerContact* former, int former_count) {
    const double flattest = flattest_radius(particle_);
    Known next;
    for (int k = 0; k < former_count; ++k) {
      if (!follow(*former[k].memory, &next)) continue;
      if (!(pose_.radius - next.contact.gap > flattest)) continue;  // lower, another maximum may be above it
      add(next);
      return std::min(next.contact.gap - kSameMaximum * pose_.radius, pose_.radius - flattest);
    }
    const Reach ahead = tube_.look(0);
    Reach other = ahead;
    const double side = ahead.slope > 0 ? 1 : -1;
    for (double turn = 0.05; turn < 1.6 && other.slope * side > 0; turn *= 2)
      other = tube_.look(side * turn, &other);
    if (other.slope * side > 0) return 0;
    const Reach top = ahead.slope == 0 ? ahead : side > 0 ? tube_.top(ahead, other) : tube_.top(other, ahead);
    add(known(top));
    return pose_.radius - std::max(top.value * (1 + 1e-9), flattest);
  }

  // Contacts on the whole circle.
  double find_all(const FormerContact* former, int former_count, TubeSurvey* survey) {
    known_count_ = 0;
    for (int k = 0; k < former_count && known_count_ < kSurfaceContacts; ++k)
      if (follow(*former[k].memory, &known_[known_count_])) ++known_count_;
    room_ = survey == nullptr ? 0 : kSurveyRoom * size_;
    for (int k = 0; k < known_count_ && room_ > 0; ++k)
      if (!tube_.round(known_[k].angle - 0.5 * kRingNormals, known_[k].angle + 0.5 * kRingNormals,
                       pose_.radius))
        room_ = kOpenSurveyRoom * size_;
    still_ = still_room();
    sample_circle();
    if (survey != nullptr) survey->count = survey->opens = 0, survey->wide = false;
    TubeSurvey::Arc* arc = nullptr;
    int highest = 0;
    for (int k = 1; k < count_; ++k) {
      const Reach &from = at_[k - 1], &to = at_[k];
      if (to.value > at_[highest].value) highest = k;
      if (kind_[k] != kRound) arc = nullptr;
      if (kind_[k] == kRound && arc == nullptr) arc = open_arc(k, survey);
      if (kind_[k] >= kMixed) note_open(from, to, kind_[k] == kMixed, survey);
      if (kind_[k] == kRound || kind_[k] == kMixed) bound_ = std::max({bound_, from.value, to.value});
      if (kind_[k] != kAway) {
        if (from.slope > 0 && to.slope <= 0)
          meet(settle(from, to), kind_[k], arc);
        else if (const Known* top = to.slope == 0 ? known_at(to.angle) : nullptr) {
          Reach least = from;  // F falls to begin with
          if (from.slope == 0 && tube_.bottom(from, to, -HUGE_VAL, &least))
            least_ = std::min(least_, least.value);
          meet(*top, kind_[k], arc);
        }
      }
      least_ = std::min(least_, to.value);
    }
    if (last_top_ > -HUGE_VAL) add(last_);
    if (out_.count == 0) add(known(at_[highest]));
    if (survey != nullptr) finish(survey);
    return pose_.radius - bound_ - kRingSupport * size_;
  }

  // Contacts in a survey's arcs; false where it holds no longer.
  bool find_in(TubeSurvey& survey, const FormerContact* former, int former_count, double* clear) {
    if (survey.stamp != stamp(particle_) || survey.radius != pose_.radius) return false;
    const double moved = moved_since(survey.pose);
    if (!(moved < survey.room)) return false;
    *clear = survey.room - moved;
    const bool open = survey.opens > 0 || survey.wide;
    const double stirred = open ? moved_since(survey.still_pose) : 0;
    const bool still = stirred < survey.still;
    if (survey.wide && !still) return false;
    bool met[TubeSurvey::kMostArcs] = {};
    int elsewhere = 0;
    for (int k = 0; k < former_count; ++k) {
      Known& next = known_[k];
      if (!follow(*former[k].memory, &next)) return false;
      for (int j = 0; j < k; ++j)  // two that have become one
        if (std::abs(std::remainder(next.angle - known_[j].angle, 2 * M_PI)) < kFinestRing) return false;
      TubeSurvey::Arc* arc = arc_of(survey, next.contact.normal);
      if (arc == nullptr && open) {
        ++elsewhere;
        if (!still) continue;
        if (!(next.contact.gap < 0)) return false;
        add(next);
        continue;
      }
      if (arc == nullptr || met[arc - survey.arc]) return false;
      met[arc - survey.arc] = true;
      add(next);
      if (next.contact.gap < 0) continue;
      arc->memory = next.memory;
      arc->clear = -HUGE_VAL;
      *clear = std::min(*clear, next.contact.gap);
    }
    for (int k = 0; k < survey.count; ++k) {
      TubeSurvey::Arc& arc = survey.arc[k];
      if (met[k]) continue;
      double gap = arc.clear - moved;
      if (!(gap > 0)) {  // one that now touches is found as from scratch
        Known next;
        if (!follow(arc.memory, &next) || arc_of(survey, next.contact.normal) != &arc || next.contact.gap < 0)
          return false;
        arc.memory = next.memory;
        gap = next.contact.gap;
      }
      *clear = std::min(*clear, gap);
    }
    known_count_ = former_count;
    if (open && still) {  // as many as then, or some are met again that were left since
      if (elsewhere != survey.open_count) return false;
      *clear = std::min(*clear, survey.still - stirred);
    }
    if (still || survey.opens == 0) return true;
    still_ = still_room();
    if (!find_in_open(survey, elsewhere, clear)) return false;
    survey.still_pose = {pose_.axis, pose_.apart, particle_.q};
    survey.still = still_;
    survey.open_count = contacts_outside_arcs(survey);
    return true;
  }

 private:
  bool follow(const PairMemory& from, Known* to) const {
    to->memory = from;
    if (!follow_on_cylinder(particle_, pose_, settings_, &to->memory, &to->contact)) return false;
    to->angle = tube_.angle(-to->contact.normal);
    return true;
  }

  Reach reach_at_contact(int number, double angle) const {
    const SurfaceContact& c = out_.contact[number];
    Reach r;
    r.angle = angle;
    r.value = pose_.radius - c.gap;
    r.on_body = c.on_body;
    r.where = warm_point(c.memory.on_b, *particle_.shape);
    return r;
  }

  void add(const Known& k) {
    if (k.contact.gap < 0) out_.add(surface_contact(k.contact, k.memory));
  }

  // Maxima as near as nearest() have F fall by less than twice this between them, for F'' >= -F; so do
  // those that come while F changes by less than this.
  double still_room() const { return std::pow(tube_.nearest(), 2) / (16 * pose_.radius); }

  // Contacts where a survey leaves it open, of which `expected` are followed: its directions are looked at
  // again.
  bool find_in_open(const TubeSurvey& survey, int expected, double* clear) {
    int met = 0;
    Reach low, high;
    for (int k = 0; k < survey.opens; ++k) {
      const TubeSurvey::Open& open = survey.open[k];
      const bool next = k > 0 && (open.low - survey.open[k - 1].high).squaredNorm() == 0;
      if (next) {
        low = high;
      } else {
        start_.where = open.at_low;
        low = tube_.look(tube_.angle(open.low), &start_);
      }
      start_.where = open.at_high;
      high = tube_.look(tube_.angle(open.high), &start_);
      if (!(high.angle > low.angle) || !(open.round || tube_.is_short(low, high))) return false;
      const double most = most_between(low, high) + kRingSupport * size_;
      if (!(low.slope > 0 && high.slope <= 0)) {
        *clear = std::min(*clear, pose_.radius - most);
        continue;
      }
      const Known top = settle(low, high);
      *clear = std::min(*clear, top.contact.gap);
      const bool known = known_at(top.angle) != nullptr;
      if (!known && top.contact.gap < 0) return false;  // it is found as from scratch
      if (top.contact.gap >= 0) still_ = std::min(still_, top.contact.gap);
      met += known;
      add(top);
    }
    return met == expected;
  }

  // F < distance cos(angle) + size: elsewhere it stays below `level`.
  void sample_circle() {
    const Reach ahead = tube_.look(0);
    const double level = std::min(pose_.radius - room_, 0.5 * (pose_.radius + ahead.value));
    const double reach =
        level - size_ > -distance_ ? std::acos(std::min((level - size_) / distance_, 1.0)) : M_PI;
    bound_ = level;
    double angles[kMostAngles];
    const int angle_count = choose_angles(reach, angles);
    Reach low = tube_.look(-reach, &ahead);
    at_[0] = low;
    count_ = 1;
    Reach last = low;  // all around: the same direction, with the same slope
    last.angle = reach;
    for (int k = 1; k < angle_count; ++k) {
      const Reach high = k + 1 == angle_count && reach == M_PI ? last : reach_at(angles[k], low);
      sample(low, high);
      low = high;
    }
    mark_mixed();
    if (reach == M_PI && kind_[1] != kAway && kind_[count_ - 1] != kAway) room_ = 0;
  }

  // The next maximum. A round body along the axis of a narrower tube touches it all around, where slopes are
  // round-off: of maxima that F does not fall between, the highest stands for all.
  void meet(const Known& top, Kind kind, TubeSurvey::Arc* arc) {
    const double gap = top.contact.gap, value = pose_.radius - gap;
    if (kind != kOpen) bound_ = std::max(bound_, value);
    const bool other = least_ < std::min(last_top_, value) - pose_.noise;
    if (other && last_top_ > -HUGE_VAL) add(last_);
    if (other || value > last_top_ + pose_.noise) last_ = top, last_top_ = value;
    least_ = value;
    if (kind >= kMixed && gap >= 0) still_ = std::min(still_, gap);
    if (arc != nullptr && gap < arc->clear) {
      arc->clear = gap;
      arc->memory = top.memory;
    }
  }

  // A round arc is by itself where F is low at both its ends.
  void mark_mixed() {
    const auto pass = [this](int from, int to, int step) {
      bool open = false;
      for (int k = from; k != to; k += step) {
        open = kind_[k] != kAway && (open || kind_[k] == kOpen);
        if (open && kind_[k] == kRound) kind_[k] = kMixed;
      }
    };
    pass(1, count_, 1);
    pass(count_ - 1, 0, -1);
  }

  // Directions to begin with: closer together about the maxima that are known.
  int choose_angles(double reach, double* angles) const {
    int count = 0;
    const auto put = [&](double angle) {
      if (std::abs(angle) < reach && count < kMostAngles - 2) angles[count++] = angle;
    };
    const int parts = static_cast<int>(std::ceil(2 * reach / kCoarsestRing));
    for (int k = 1; k < parts; ++k) {
      const double angle = (2.0 * k / parts - 1) * reach;
      bool near = false;
      for (int i = 0; i < known_count_; ++i) near = near || std::abs(angle - known_[i].angle) < kNearKnown;
      if (!near) put(angle);
    }
    for (int i = 0; i < known_count_; ++i) {
      put(known_[i].angle);
      const double gap = known_[i].contact.gap, below = std::max(-gap, 0.0) + room_;
      double step = 1.2 * std::sqrt(2 * below / (pose_.radius - gap));
      for (step = std::max(step, kFinestRing); step < 2 * kNearKnown; step *= kRingLadder) {
        put(known_[i].angle - step);
        put(known_[i].angle + step);
      }
    }
    angles[count++] = -reach;
    std::sort(angles, angles + count);
    const auto same = [](double a, double b) { return b - a < 0.5 * kFinestRing; };
    count = static_cast<int>(std::unique(angles, angles + count, same) - angles);
    if (count > 1 && reach - angles[count - 1] < 0.5 * kFinestRing) --count;
    angles[count++] = reach;
    for (int i = 0; i < known_count_; ++i)  // these stay what they are
      for (int k = 1; k + 1 < count; ++k)
        if (std::abs(angles[k] - known_[i].angle) < 0.5 * kFinestRing) angles[k] = known_[i].angle;
    return count;
  }
  // F at one of them.
  Reach reach_at(double angle, const Reach& low) {
    if (const Known* known = known_at(angle)) return reach_of(*known);
    const Known* start = nullptr;
    for (int i = 0; i < known_count_; ++i)
      if (std::abs(known_[i].angle - angle) < angle - low.angle) start = &known_[i];
    if (start == nullptr) return tube_.look(angle, &low);
    start_.where = start->contact.where;
    return tube_.look(angle, &start_);
  }
  const Known* known_at(double angle) const {
    const Known* found =
        std::find_if(known_, known_ + known_count_, [&](const Known& k) { return k.angle == angle; });
    return found == known_ + known_count_ ? nullptr : found;
  }
  Reach reach_of(const Known& k) const {
    Reach r;
    r.angle = k.angle;
    r.value = pose_.radius - k.contact.gap;
    r.on_body = k.contact.on_body;
    r.where = k.contact.where;
    return r;
  }

  // Where F stays below the radius, half of its distance from it is to be known.
  void sample(const Reach& low, const Reach& high) {
    const double width = high.angle - low.angle, ends = std::max(low.value, high.value),
                 most = most_between(low, high) * (1 + 1e-12) + kRingSupport * size_;
    const double finest = std::max(kFinestRing, tube_.nearest() / pose_.radius);
    const bool may = most > std::min(pose_.radius, 0.5 * (pose_.radius + ends));
    if (!(most > pose_.radius - room_) && !may) return push(high, kAway, most);
    if (tube_.round(low.angle, high.angle, pose_.radius - 2 * kSurveyRoom * size_))
      return push(high, kRound, most);
    if (tube_.is_short(low, high)) return push(high, kOpen, most);
    if ((may ? width > finest : width > kLooseArc) && count_ < kMost - kMostAngles - 32) {
      const Reach middle = tube_.look(0.5 * (low.angle + high.angle), low.value > high.value ? &low : &high);
      sample(low, middle);
      sample(middle, high);
      return;
    }
    if (!may) room_ = std::min(room_, pose_.radius - most);
    push(high, may ? kOpen : kAway, most);
  }
  void push(const Reach& high, Kind kind, double most) {
    bound_ = std::max(bound_, kind == kRound ? pose_.radius - 2 * kSurveyRoom * size_ : most);
    kind_[count_] = kind;
    at_[count_++] = high;
  }

  Known known(const Reach& top) const {
    Known k;
    k.contact.gap = pose_.radius - top.value;
    k.contact.normal = -tube_.direction(top.angle).normalized();
    k.contact.on_body = top.on_body;
    k.contact.where = top.where;
    k.contact.rung = Rung::warm;
    k.memory = cylinder_memory(particle_, top.where);
    k.angle = top.angle;
    return k;
  }

  // The maximum between two directions, as a former contact goes on if it does.
  Known settle(const Reach& from, const Reach& to) const {
    const auto between = [&](const Known& k) {
      return k.angle >= from.angle - kSameMaximum && k.angle <= to.angle + kSameMaximum;
    };
    for (int k = 0; k < known_count_; ++k)
      if (between(known_[k])) return known_[k];
    Known k;
    const Reach& higher = from.value > to.value ? from : to;
    if (follow(cylinder_memory(particle_, higher.where), &k) && between(k)) return k;
    return known(tube_.top(from, to));
  }

  void note_open(const Reach& from, const Reach& to, bool round, TubeSurvey* survey) {
    if (survey == nullptr) return;
    if (survey->opens == TubeSurvey::kMostOpen || !(round || tube_.is_short(from, to))) {
      survey->wide = true;
      return;
    }
    survey->open[survey->opens++] = {round, tube_.direction(from.angle), tube_.direction(to.angle),
                                     from.where, to.where};
  }

  TubeSurvey::Arc* open_arc(int first, TubeSurvey* survey) const {
    if (survey == nullptr) return nullptr;
    int last = first;
    while (last + 1 < count_ && kind_[last + 1] == kRound) ++last;
    const double low = at_[first - 1].angle, high = at_[last].angle;
    if (survey->count == TubeSurvey::kMostArcs) {
      survey->count = TubeSurvey::kMostArcs + 1;
      return nullptr;
    }
    if (survey->count > TubeSurvey::kMostArcs) return nullptr;
    TubeSurvey::Arc& arc = survey->arc[survey->count++];
    arc.middle = tube_.direction(0.5 * (low + high));
    arc.half = high - low < 0.9 * M_PI ? std::cos(0.5 * (high - low) + kSameMaximum) : HUGE_VAL;
    arc.clear = HUGE_VAL;
    return &arc;
  }

  void finish(TubeSurvey* survey) const {
    int kept = 0;
    const bool many = survey->count > TubeSurvey::kMostArcs;
    for (int k = 0; k < std::min(survey->count, TubeSurvey::kMostArcs); ++k)
      if (survey->arc[k].clear < HUGE_VAL) survey->arc[kept++] = survey->arc[k];
    survey->count = kept;
    survey->still = std::min(room_, still_);
    survey->room = many ? 0 : survey->wide ? survey->still : room_;
    survey->stamp = stamp(particle_);
    survey->radius = pose_.radius;
    survey->pose = survey->still_pose = {pose_.axis, pose_.apart, particle_.q};
    survey->open_count = contacts_outside_arcs(*survey);
  }

  // No value of F has changed by more since a pose. (Of a turned axis, directions square to it turn by as
  // much.)
  double moved_since(const TubeSurvey::Pose& s) const {
    const double q[4] = {s.q.w(), s.q.x(), s.q.y(), s.q.z()};
    return (pose_.apart - s.apart).norm() + size_ * std::sqrt(turned2(particle_.q, q)) +
           (pose_.axis - s.axis).norm() * (size_ + pose_.apart.norm());
  }

  // That a contact with this normal lies in, or nullptr.
  static TubeSurvey::Arc* arc_of(TubeSurvey& survey, const Vec3& normal) {
    for (int i = 0; i < survey.count; ++i)
      if (-normal.dot(survey.arc[i].middle) >= survey.arc[i].half) return &survey.arc[i];
    return nullptr;
  }
  int contacts_outside_arcs(TubeSurvey& survey) const {
    int count = 0;
    for (int k = 0; k < out_.count; ++k) count += arc_of(survey, out_.contact[k].normal) == nullptr;
    return count;
  }

  static constexpr int kMost = TubeWorkspace::kMost, kMostAngles = 64;
  const Particle& particle_;
  const CylinderPose& pose_;
  const ContactSettings& settings_;
  const double size_, distance_;
  const Tube tube_;
  SurfaceContacts& out_;
  double room_ = 0, still_ = 0, bound_ = 0;         // F is nowhere larger than the bound
  Known& last_ = tube_workspace().last;             // maximum met, which is a contact ...
  double last_top_ = -HUGE_VAL, least_ = HUGE_VAL;  // ... with this F, and the least F since then
  int count_ = 0, known_count_ = 0;
  Reach start_;
  Reach* const at_ = tube_workspace().at;
  Kind* const kind_ = tube_workspace().kind;
  Known* const known_ = tube_workspace().known;
};

}  // namespace

bool wants_survey(const Particle& particle, double radius) {
  return particle.shape->dented() || !(flattest_radius(particle) < radius);
}

SurfaceContact surface_contact(const CylinderContact& contact, const PairMemory& memory) {
  SurfaceContact c;
  c.gap = contact.gap;
  c.normal = contact.normal;
  c.on_body = contact.on_body;
  c.triangle = 0;
  c.rung = contact.rung;
  c.iterations = contact.iterations;
  c.memory = memory;
  return c;
}

double find_in_tube(const Particle& particle, const CylinderPose& pose, const ContactSettings& settings,
                    const FormerContact* former, int former_count, TubeSurvey* survey, SurfaceContacts* out) {
  TubeSearch search(particle, pose, settings, out);
  FormerContact* maxima = tube_workspace().maxima;
  int count = 0;
  for (int k = 0; k < std::min(former_count, kSurfaceContacts); ++k)
    if (!former[k].subtracts) maxima[count++] = former[k];
  if (search.is_single()) return search.find_one(maxima, count);
  double clear = 0;
  if (!(survey != nullptr && survey->room > 0 && search.find_in(*survey, maxima, count, &clear))) {
    out->count = 0;
    clear = search.find_all(maxima, count, survey);
  }
  search.sort_around();
  search.take_off_minima();
  return clear;
}

}  // namespace nurbs

// The search; see ring_sectors.h.
#include "contact/overlap/ring_sectors.h"

#include "contact/overlap/closing.h"

namespace nurbs {
namespace {

constexpr int kCircleCost = 4;             // ... sectors
constexpr double kMostSpent = 1000;        // sectors bounded, some 0.7 us each, and circles ...
constexpr double kMostSpentLast = 2400;    // ... where nothing else did
constexpr double kMostCompared = 4e5;      // circles in their hulls, 0.5 ns each
constexpr double kMostComparedLast = 4e6;  // ... where nothing else did
constexpr double kOnPace = 9;              // times the share closed, that may be spent where nothing else did
constexpr double kFirstSpent = 0.25;       // of either, after which a hopeless one ends ...
constexpr double kFirstSpentLast = 0.375;  // ... and where nothing else did
constexpr int kDeepestSector = 60;         // halvings of the azimuth
constexpr double kNearlyAlike = 0.1;  // of the body's radius: what directions of a ring may differ by ...
constexpr double kHardlyAlike = 0.4;  // ... where nothing else did
constexpr double kMostOff = 0.5;      // of the tolerance, that bodies may be off those of revolution
constexpr double kMeridianShare =
    0.4;  // of the tolerance, below which its width, not its circles, keeps a sector open
constexpr double kLeastTilt = 3e-3;  // sine between the axes from which the mate's tip may do better
constexpr int kFirstAngles = 7;
constexpr int kRippledCost = 3;           // sectors, as one of rippled circles, ...
constexpr double kFollowedCost = 25;      // ... besides one for so many that are followed
constexpr double kOnPaceRippled = 10;     // kOnPace ...
constexpr double kFirstSpentRippled = 1;  // ... and kFirstSpent of those
constexpr double kSameAngle = 1e-13;      // rad
constexpr SurfacePoint kAnywhere{-1, 0, 0};

}  // namespace

RingSectors::RingSectors(const PairFrame& pair, bool k_is_a, bool core, double tolerance,
                         const RoundEdges* arcs)
    : pair_(pair), view_(pair, k_is_a, core, tolerance, arcs), tolerance_(tolerance) {
  tangent_ = arcs ? Vec3(view_.turn_k * arcs->start) : view_.axis.unitOrthogonal();
  second_ = view_.axis.cross(tangent_);
  noise_ = 2 * (pair.noise + kRoundoff * pair.size) +
           view_.scale_k * (arcs           ? arcs->error
                            : view_.near_k ? 0.0
                                           : view_.k->revolution.error + view_.k->meridian.error) +
           (view_.circles ? view_.scale_m * view_.mate_error : 0.0) + view_.error;
}

bool RingSectors::run(bool last, double* left, PolytopeResult* result) {
  const Vec3 e = view_.sign * result->bracket.direction;
  const double depth = -kCoreDepth * result->bracket.lower;
  view_.ball = std::min(view_.ball, depth);
  view_.ball_k = std::min(view_.ball_k, std::max(0.0, depth - view_.ball));
  best_ = -result->bracket.lower - balls();
  best_e_ = e;
  if (!(best_ > tolerance_ && noise_ <= kMostOff * tolerance_) || !query(e)) return false;
  choose_mate(e);
  const double alike = differ() / (view_.scale_k * view_.k->bounding_radius);
  if (!(alike < (last ? kHardlyAlike : kNearlyAlike))) return false;
  if (last && view_.rippled() && alike < kNearlyAlike) return false;  // tried
  const Sector all = sector_at(azimuth(e), M_PI);
  for (int k = 0; k < kFirstAngles; ++k) {
    const double angle = M_PI * k / (kFirstAngles - 1);
    query(direction({std::cos(angle), std::sin(angle)}, all.u));
  }
  if (!close(all, last, left)) return false;
  fill(result);
  return true;
}

RingSectors::Sector RingSectors::sector_at(double phi, double half) {
  Sector s{phi, half, {1, 0}, {-1, 0}, 1, {std::cos(phi), std::sin(phi)}, {1, 0}};
  s.set_half(half);
  return s;
}

double RingSectors::differ() const {
  const double moved = view_.circles ? view_.tilt * view_.scale_m * view_.m->bounding_radius : 0;
  return view_.across(circle_[0].k).norm() + 2 * moved;
}

void RingSectors::choose_mate(const Vec3& e) {
  if (!(view_.tilt > kLeastTilt)) return;
  const double circles = differ();
  const RingView before = view_;
  view_.use_points();
  count_ = 0;
  query(e);
  if (differ() <= circles) return;
  view_ = before;
  count_ = 0;
  query(e);
}

// Of a rippled body any parameter line's point says of all directions what it says: its support is only worth
// finding where the bodies may overlap less than has been seen.
bool RingSectors::query(const Vec3& e) {
  if (count_ == kMostCircles) return false;
  ++queries_;
  const Vec3 own_k = view_.turn_k.transpose() * e, own_m = view_.turn_m.transpose() * -e;
  std::optional<Support> k, m;
  const auto find_support = [&](const Shape& shape, double scale, const Vec3& own,
                                std::optional<Support>* on) {
    if (!*on) *on = find_hull_support(shape, own, nullptr, kSupportShare * tolerance_ / scale, kHullSlope);
  };
  const auto find_supports = [&](bool of_k, bool of_m) {
    if (of_k) find_support(*view_.k, view_.scale_k, own_k, &k);
    if (of_m) find_support(*view_.m, view_.scale_m, own_m, &m);
  };
  Line line_k{}, line_m{};
  const auto find_lines = [&](const SurfacePoint& on_k, const SurfacePoint& on_m) {
    if (view_.near_k) line_k = line_of(*view_.k, view_.scale_k, view_.turn_k, e, on_k);
    if (view_.near_m) line_m = line_of(*view_.m, view_.scale_m, view_.turn_m, -e, on_m);
  };
  const auto overlap = [&] {
    return (k ? view_.scale_k * k->upper : e.dot(line_k.at)) +
           (m ? view_.scale_m * m->upper : -e.dot(line_m.at)) - balls() - e.dot(view_.offset);
  };
  find_lines(kAnywhere, kAnywhere);
  find_supports(!line_k.known, !line_m.known);
  const bool first = count_ == 0;
  if (first || overlap() < best_) {
    find_supports(true, true);
    const double p = overlap();
    const bool lower = p < best_;
    if (lower) {
      best_ = p;
      best_e_ = e;
    }
    if (lower || first) {
      on_k_ = k->where;
      on_m_ = m->where;
    }
    find_lines(k->where, m->where);  // along a straight profile any place is as good as another, but for this
  }
  Circle c;
  const Vec3 x = line_k.known ? line_k.at
                              : view_.turn_k * (view_.scale_k * k->point - view_.ball_k * k->normal),
             xm = line_m.known ? line_m.at : view_.turn_m * mate_core(*m, own_m);
  c.nk = line_k.known ? line_k.normal : view_.turn_k * k->normal;
  c.nm = -(line_m.known ? line_m.normal : view_.turn_m * m->normal);
  c.place_k = line_k.on.profile.place;
  c.place_m = line_m.on.profile.place;
  c.on_k = x - view_.point;
  c.z = view_.axis.dot(c.on_k);
  c.r = line_k.known ? view_.scale_k * line_k.on.r : view_.across(c.on_k).norm();
  c.lone = view_.arcs && !on_arcs(c);
  c.at = {view_.axis.dot(e), view_.across(e).norm()};
  c.middle = xm;
  c.rm = 0;
  if (view_.circles) {
    const Vec3 from = xm - view_.mate_point;
    c.middle = view_.mate_point + view_.mate_axis.dot(from) * view_.mate_axis;
    c.rm = line_m.known ? view_.scale_m * line_m.on.r : (xm - c.middle).norm();
  }
  c.k = view_.offset - view_.point + c.middle;
  const double around = c.at.s > 0 ? 1 / c.at.s : 0;
  const Angle u{around * tangent_.dot(e), around * second_.dot(e)};
  flat_[count_] = {
      c.at, u, c.rm, c.lone, flat(c.r, c.z, c.k), flat(0, 0, c.k - c.on_k), wave(e, line_k, line_m)};
  insert(c);
  return true;
}

RingSectors::Line RingSectors::line_of(const Shape& shape, double scale, const Mat3& turn, const Vec3& d,
                                       const SurfacePoint& support) {
  const NearRevolution& near = shape.near_revolution;
  const Vec3 own = turn.transpose() * d, axis = near.revolution.axis;
  Line line{};
  line.known = find_round_point(near.meridian, shape.patches, own, shape.bounding_radius, support, &line.on);
  if (!line.known) return line;
  const RoundPoint& on = line.on;
  const Vec3 across = (own - axis.dot(own) * axis).normalized();
  line.at = scale * (turn * (near.meridian.point + on.r * across + on.z * axis));
  line.normal = turn * (on.profile.turn_r * across + on.profile.turn_z * axis);
  return line;
}

RingSectors::Wave RingSectors::wave(const Vec3& e, const Line& k, const Line& m) const {
  Wave wave;
  if (!view_.rippled()) return wave;
  wave.phi = azimuth(e);
  if ((view_.near_k && !k.known) || (view_.near_m && !m.known)) {
    wave.ripple = view_.ripple;
  } else {
    wave.before = wave.after = M_PI;
    if (k.known) {
      wave.k_r = view_.scale_k * k.on.slope_r;
      wave.k_z = view_.scale_k * k.on.slope_z;
      wave.reach(k.on.before, k.on.after);
      wave.ripple.add(view_.scale_k, k.on.ripple);
    }
    if (m.known) {
      const bool against = view_.turn_m_sign < 0;
      wave.m_r = view_.turn_m_sign * view_.scale_m * m.on.slope_r;
      wave.m_z = view_.scale_m * m.on.slope_z;
      wave.reach(against ? m.on.after : m.on.before, against ? m.on.before : m.on.after);
      wave.ripple.add(view_.scale_m, m.on.ripple);
    }
    wave.steep = std::hypot(wave.k_r, wave.k_z) + std::hypot(wave.m_r, wave.m_z);
  }
  const double turn = std::min(M_PI_2, std::sqrt(2 * kRippleShare * tolerance_ / wave.ripple.bend));
  wave.near = {std::cos(turn), std::sin(turn)};
  return wave;
}

RingSectors::Flat RingSectors::flat(double r, double z, const Vec3& k) const {
  const double x = tangent_.dot(k), y = second_.dot(k);
  return {r, z - view_.axis.dot(k), x, y, std::sqrt(x * x + y * y)};
}

bool RingSectors::on_arcs(const Circle& c) const {
  const auto on = [&](const RoundEdges::Circle& edge) {
    return std::hypot(c.r - view_.scale_k * edge.radius, c.z - view_.scale_k * edge.z) <= noise_;
  };
  const auto& edges = view_.arcs->edges;
  return view_.arcs->holds(azimuth(c.on_k), 0) && std::any_of(edges.begin(), edges.end(), on);
}

Vec3 RingSectors::mate_core(const Support& on, const Vec3& own) const {
  const double left = view_.swept ? view_.scale_m * view_.swept->radius - view_.ball : -1;
  if (!view_.swept || left < 0) return view_.scale_m * on.point - view_.ball * on.normal;
  return view_.scale_m * view_.swept->points[view_.swept->support(own)] + left * own;
}

void RingSectors::insert(const Circle& c) {
  int at = count_;
  for (; at > 0 && cross(c.at, flat_[order_[at - 1]].at) > 0; --at) order_[at] = order_[at - 1];
  order_[at] = static_cast<short>(count_);
  circle_[count_++] = c;
}

bool RingSectors::was_asked(const Angle& at, const Sector& sector) const {
  if (!view_.rippled()) return false;
  return std::any_of(which_, which_ + chosen_, [&](int k) {
    return std::abs(cross(flat_[k].at, at)) <= kSameAngle &&
           std::abs(turn_to(sector, flat_[k].wave)) <= kSameAngle;
  });
}

void RingSectors::forget_far_from(const Sector& sector) {
  const auto off = [&](const FlatCircle& c) { return std::abs(turn_to(sector, c.wave)); };
  double offs[kMostCircles];
  for (int k = 0; k < count_; ++k) offs[k] = off(flat_[k]);
  std::nth_element(offs, offs + kMostCircles / 2, offs + count_);
  const double furthest = offs[kMostCircles / 2];
  const int before = count_;
  count_ = 0;
  for (int k = 0; k < before; ++k) {
    if (off(flat_[k]) > furthest) continue;
    const Circle kept = circle_[k];
    flat_[count_] = flat_[k];
    insert(kept);
  }
  dropped_ += before - count_;
}

bool RingSectors::close(const Sector& all, bool last, double* left) {
  const bool ample = last || view_.rippled();  // which are tried but once
  const double most_spent = ample ? kMostSpentLast : kMostSpent,
               most_compared = ample ? kMostComparedLast : kMostCompared,
               first_spent = view_.rippled() ? kFirstSpentRippled
                             : last          ? kFirstSpentLast
                                             : kFirstSpent;
  Sector stack[kDeepestSector + 2];
  int top = 0, sectors = 0;
  double closed = 0;
  stack[top++] = all;
  proven_ = kFarAway;
  while (top > 0) {
    sectors += view_.rippled() ? kRippledCost : 1;
    const double spent =
        std::max((sectors + kCircleCost * (count_ + dropped_) + followed_ / kFollowedCost) / most_spent,
                 compared_ / most_compared);
    const double pace = view_.rippled() ? kOnPaceRippled : kOnPace,
                 allowed = ample ? std::max(*left, pace * closed) : *left;
    if (spent > allowed || (spent > first_spent && closed < kHopeless * spent)) {
      *left -= spent;
      return false;
    }
    Sector& sector = stack[top - 1];
    const double threshold = best_ - kClosedShare * tolerance_;
    const Least wide = bound(sector, sector.half, threshold);
    if (wide.value >= threshold) {
      proven_ = std::min(proven_, wide.value);
      closed += sector.share;
      --top;
      continue;
    }
    proven_ = std::min(proven_, threshold);  // of the angles now left out
    sector.low = wide.low;
    sector.high = wide.high;
    const Least here = bound(sector, 0, threshold);
    bool narrower;
    const double second = second_order(sector, here, &narrower);
    if (second >= threshold) {
      proven_ = std::min(proven_, second);
      closed += sector.share;
      --top;
      continue;
    }
    if (here.value >= best_ - kMeridianShare * tolerance_ || was_asked(here.at, sector)) {
      if (top > kDeepestSector) return false;
      sector.share *= 0.5;
      Sector other = sector;
      if (narrower) {
        sector.high = other.low = middle(sector.low, sector.high);
      } else {
        sector.set_half(0.5 * sector.half);
        other = sector;
        sector.move(-1);
        other.move(1);
      }
      stack[top++] = other;
    } else {
      if (count_ == kMostCircles && view_.rippled()) forget_far_from(sector);
      if (!query(direction(here.at, sector.u))) return false;
    }
  }
  return best_ - proven_ <= tolerance_;
}

void RingSectors::fill(PolytopeResult* r) {
  r->iterations += queries_;
  const Vec3 d = view_.sign * best_e_;
  r->bracket.direction = d;
  r->bracket.lower = -best_ - balls();
  r->bracket.upper = std::max(-proven_ - balls(), r->bracket.lower);
  r->converged = true;
  r->points.na = d;
  r->points.nb = -d;
  const Sector there = sector_at(azimuth(best_e_), 0);
  if (dropped_ > 0) {  // the best direction's, it may be
    if (count_ == kMostCircles) forget_far_from(there);
    query(best_e_);
  }
  const Least least = bound(there, 0, -kFarAway);
  // The circles level there, so weighted that the witnesses face each other.
  const auto slope = [&](int k) { return hull_.r(k) * least.at.c - hull_.z(k) * least.at.s; };
  const double tp = slope(least.from), tq = slope(least.to);
  const double share = tp != tq ? std::clamp(tq / (tq - tp), 0.0, 1.0) : 1.0;
  Vec3 xk, xm, yk, ym;
  witness(which_[least.from], there, &xk, &xm);
  witness(which_[least.to], there, &yk, &ym);
  const Vec3 on_k = share * xk + (1 - share) * yk, on_m = share * xm + (1 - share) * ym;
  const bool k_is_a = view_.sign > 0;
  r->points.a = k_is_a ? on_k : on_m;
  r->points.b = pair_.offset + (k_is_a ? on_m : on_k);
  r->points.on_a = k_is_a ? on_k_ : on_m_;
  r->points.on_b = k_is_a ? on_m_ : on_k_;
  r->gap = r->bracket.lower;
  part_points(r);
}

void RingSectors::witness(int k, const Sector& there, Vec3* on_k, Vec3* on_m) const {
  Circle c = circle_[k];
  if (const Drift d = drift(flat_[k].wave, c.at, there, 0, reach_of(there)); d.followed)
    follow(flat_[k].wave, d.turn, &c);
  const Vec3 at = known(c, there.phi, 0).lone ? c.on_k : Vec3(c.r * outward(there.u) + c.z * view_.axis);
  *on_k = view_.point + at + view_.ball_k * best_e_;
  *on_m = c.middle - view_.ball * best_e_;
  if (!view_.circles) return;
  const Vec3 e = direction(c.at, there.u), square = e - view_.mate_axis.dot(e) * view_.mate_axis;
  if (square.norm() > kNoDirection) *on_m -= c.rm * square.normalized();
}

}  // namespace nurbs

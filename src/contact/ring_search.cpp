// Branch and bound over the azimuth, plane hulls over the angle from the axis; see ring_search.h.
#include "contact/ring_search.h"

#include <algorithm>
#include <cmath>

#include "contact/half_plane_hull.h"

namespace nurbs {
namespace {

constexpr int kMostCircles = HalfPlaneHull::kMost;  // supports evaluated, one as dear as ...
constexpr int kCircleCost = 4;                      // ... sectors
constexpr double kMostSpent = 1000;                 // sectors bounded, some 0.7 us each, and circles ...
constexpr double kMostSpentLast = 2400;             // ... where nothing else did
constexpr double kMostCompared = 4e5;               // circles in their hulls, 0.5 ns each
constexpr double kMostComparedLast = 4e6;           // ... where nothing else did
constexpr double kAllRings = 1.25;                  // of either, all axes together
constexpr double kOnPace = 9;              // times the share closed, that may be spent where nothing else did
constexpr double kFirstSpent = 0.25;       // of either, after which it ends ...
constexpr double kFirstSpentLast = 0.375;  // ... and where nothing else did
constexpr double kHopeless = 0.1;          // ... where less than this times its share of all is closed
constexpr int kDeepestSector = 60;         // halvings of the azimuth
constexpr double kNearAxis = 0.2;          // sine between the axes up to which both bodies' circles are used
constexpr double kNearlyAlike = 0.1;    // of the body's radius: what directions of a ring may differ by ...
constexpr double kHardlyAlike = 0.4;    // ... where nothing else did
constexpr double kMostNoise = 0.5;      // of the tolerance, that bodies may be off those of revolution
constexpr double kClosedShare = 0.9;    // of the tolerance at which a sector is closed ...
constexpr double kMeridianShare = 0.4;  // ... and below which its width, not its circles, keeps it open
constexpr double kLeastTilt = 3e-3;     // sine between the axes from which the mate's tip may do better
constexpr double kCore = 1 - 1e-12;     // of the largest ball that rolls inside the mate
constexpr double kCoreDepth = 0.98;     // ... and of the overlap
constexpr int kFirstAngles = 7;
constexpr int kBeside = 3;              // circles looked at on either side of a range of angles
constexpr double kNearAzimuth = 0.3;    // rad, of a circle's asked azimuth
constexpr double kChord = 1.05;         // up to 0.5 rad: no less than the angle over its chord or sine
constexpr double kWidestSecond = 0.88;  // cosine of that
constexpr int kRippledCost = 3;         // sectors, as one of rippled circles, ...
constexpr double kFollowedCost = 25;    // ... besides one for so many that are followed
constexpr double kOnPaceRippled = 3;
constexpr double kSameAngle = 1e-13;  // rad
constexpr double kOffRipple = 3;      // times the most it is off by, a circle is known all round
constexpr double kRippleShare = 0.2;  // of the tolerance, up to which rippled circles are followed anyway
constexpr double kLeastSine = 0.02;   // up to which lengths are taken off radii instead

// One body of revolution K and its mate M: axes and lengths of the pair frame, e = sign d.
struct View {
  const Shape *k, *m;
  double scale_k, scale_m, sign;
  Mat3 turn_k, turn_m;
  Vec3 axis, mate_axis;    // unit; the second one not against the first
  Vec3 offset;             // M's centre from K's
  Vec3 point, mate_point;  // on the axes, from the bodies' centres
  bool circles;            // of M are used
  double tilt = 0;         // sine between the axes, if so
  double mate_error = 0;   // what the mate turns out of itself by, a length of its shape
  double ball = 0;         // that rolls inside M, whose points are those of its core, the ball's centres ...
  double ball_k = 0;       // ... and inside K
  const SpheroPolyhedron* swept = nullptr;  // M, if it is one
  double error = 0;                         // of those that are
  const RoundEdges* arcs;                   // of K, where that is of revolution no further
  const NearRevolution* near_k = nullptr;   // that K nearly is, if it is one no further ...
  const NearRevolution* near_m = nullptr;   // ... and M, if its circles are used
  Ripple ripple;                            // of both together ...
  double seam = 0;                          // ... and where their patches meet
  double turn_m_sign = 1;                   // of M's azimuth, as K's grows

  View(const PairFrame& pair, bool k_is_a, bool core, double tolerance, const RoundEdges* part) : arcs(part) {
    sign = k_is_a ? 1 : -1;
    k = k_is_a ? pair.a : pair.b;
    m = k_is_a ? pair.b : pair.a;
    scale_k = k_is_a ? pair.scale_a : pair.scale_b;
    scale_m = k_is_a ? pair.scale_b : pair.scale_a;
    turn_k = k_is_a ? Mat3(Mat3::Identity()) : pair.turn;
    turn_m = k_is_a ? pair.turn : Mat3(Mat3::Identity());
    offset = sign * pair.offset;
    if (!arcs && !k->revolution.found) near_k = &k->near_revolution;
    axis = (turn_k * (arcs ? arcs->axis : revolution_of(*k).axis)).normalized();
    point = scale_k * (turn_k * (arcs ? arcs->point : revolution_of(*k).point));
    if (near_k) add_ripple(*near_k, scale_k);
    if (m->proofs.sphere) {  // any axis is its own
      mate_axis = axis;
      mate_point = Vec3::Zero();
      circles = true;
      mate_error = m->bounding_radius - m->inner_radius;
      return;
    }
    const Revolution& mate = revolution_of(*m);
    mate_axis = (turn_m * mate.axis).normalized();
    if (mate_axis.dot(axis) < 0) {
      mate_axis = -mate_axis;
      turn_m_sign = -1;
    }
    mate_point = scale_m * (turn_m * mate.point);
    mate_error = m->revolution.error + m->meridian.error;
    const double sine = axis.cross(mate_axis).norm();
    circles = mate.found && sine < kNearAxis;
    if (circles) tilt = sine;
    if (circles && !m->revolution.found) {
      near_m = &m->near_revolution;
      add_ripple(*near_m, scale_m);
      mate_error = 0;
    }
    if (!core || near_m) return;
    ball = kCore * PairFrame::rolling_ball(*m, scale_m, tolerance);
    if (!near_k) ball_k = kCore * PairFrame::rolling_ball(*k, scale_k, tolerance);
    if (PairFrame::is_swept(*m, scale_m, tolerance)) swept = &m->core;
    for (const auto& [shape, scale] : {std::pair(m, scale_m), std::pair(k, scale_k)})
      if (PairFrame::is_swept(*shape, scale, tolerance)) error += scale * shape->core.error;
  }
  Vec3 across(const Vec3& x) const { return x - axis.dot(x) * axis; }
  bool rippled() const { return near_k || near_m; }
  void use_points() {  // of M
    circles = false;
    tilt = 0;
    near_m = nullptr;
    ripple = {};
    seam = 0;
    if (near_k) add_ripple(*near_k, scale_k);
  }

 private:
  void add_ripple(const NearRevolution& near, double scale) {
    ripple.add(scale, near.meridian.ripple);
    seam += scale * near.meridian.seam;
  }
};

// What one support evaluation says of every direction.
struct Circle {
  double r, z;  // of K
  Vec3 middle;  // M's point, or the centre of its circle, from M's centre ...
  Vec3 k;       // ... and from K's `point`
  double rm;    // radius of that circle
  Angle at;     // angle from the axis it was asked for
  Vec3 nk, nm;  // the surfaces' own normals there, outward from K and into M
  Vec3 on_k;    // K's point, from `point`: of a circle, or an arc of one; or, `lone`, no other is known
  bool lone = false;
  Meridian::Place place_k, place_m;  // of rippled ones, whose normals are the products'
};

// How rippled circles change from the azimuth they were asked for, as K's grows by a rad; those of M by their
// radius and the height over M's centre. One patch each from `before` to `after` (rad, not negative).
struct Wave {
  double phi = 0, k_r = 0, k_z = 0, m_r = 0, m_z = 0, before = -1, after = -1;
  Ripple ripple;  // of both bodies' lines
  double steep() const { return std::hypot(k_r, k_z) + std::hypot(m_r, m_z); }
  void reach(double low, double high) {
    before = std::min(before, low);
    after = std::min(after, high);
  }
};

// What projections need of it, apart: they go through all.
struct Flat {
  double r, z;    // radius of K's, and its height over M's
  double x, y;    // of M's centre across the axis ...
  double length;  // ... and how far that is from it
};
struct FlatCircle {
  Angle at, u;  // angle from the axis and azimuth asked for
  double rm;
  bool lone;
  Flat whole, alone;  // as a circle, and as its point
  Wave wave;
};

double square(double x) {
  return x * x;
}

class RingSearch {
  using Least = HalfPlaneHull::Least;

 public:
  // `core`: of the bodies, and the balls that roll inside them, instead of the bodies.
  // `arcs`: of K, where that is not of revolution itself.
  RingSearch(const PairFrame& pair, bool k_is_a, bool core, double tolerance, const RoundEdges* arcs)
      : pair_(pair), view_(pair, k_is_a, core, tolerance, arcs), tolerance_(tolerance) {
    tangent_ = arcs ? Vec3(view_.turn_k * arcs->start) : view_.axis.unitOrthogonal();
    second_ = view_.axis.cross(tangent_);
    noise_ = 2 * kRoundoff *
                 (view_.scale_k * view_.k->bounding_radius + view_.scale_m * view_.m->bounding_radius) +
             view_.scale_k * (arcs           ? arcs->error
                              : view_.near_k ? 0.0
                                             : view_.k->revolution.error + view_.k->meridian.error) +
             (view_.circles ? view_.scale_m * view_.mate_error : 0.0) + view_.error;
  }

  // `left`: of what may be spent, less what is.
  bool run(bool last, double* left, PolytopeResult* result) {
    const Vec3 e = view_.sign * result->bracket.direction;
    const double depth = -kCoreDepth * result->bracket.lower;
    view_.ball = std::min(view_.ball, depth);
    view_.ball_k = std::min(view_.ball_k, std::max(0.0, depth - view_.ball));
    best_ = -result->bracket.lower - balls();
    best_e_ = e;
    if (!(best_ > tolerance_ && noise_ <= kMostNoise * tolerance_) || !query(e)) return false;
    choose_mate(e);
    on_k_ = last_k_;
    on_m_ = last_m_;
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

 private:
  struct Sector {
    double phi, half;
    Angle low, high;
    double share;   // halved with the sector
    Angle u, turn;  // cosine and sine of phi and of half

    void set_half(double to) {
      half = to;
      turn = {std::cos(to), std::sin(to)};
    }
    // By `half`, to either side (sign: 1, -1).
    void move(double sign) {
      phi += sign * half;
      u = unit({u.c * turn.c - sign * u.s * turn.s, u.s * turn.c + sign * u.c * turn.s});
    }
  };
  // Of all angles.
  static Sector sector_at(double phi, double half) {
    Sector s{phi, half, {1, 0}, {-1, 0}, 1, {std::cos(phi), std::sin(phi)}, {1, 0}};
    s.set_half(half);
    return s;
  }

  double balls() const { return view_.ball + view_.ball_k; }
  double azimuth(const Vec3& e) const { return std::atan2(second_.dot(e), tangent_.dot(e)); }
  Vec3 outward(const Angle& u) const { return u.c * tangent_ + u.s * second_; }
  Vec3 direction(const Angle& a, const Angle& u) const { return a.s * outward(u) + a.c * view_.axis; }

  // How much a turn about K's axis changes at the first direction.
  double differ() const {
    const double moved = view_.circles ? view_.tilt * view_.scale_m * view_.m->bounding_radius : 0;
    return view_.across(circle_[0].k).norm() + 2 * moved;
  }

  // M's circles or, if they change more, its points: a tip stays where it is however M is tilted.
  void choose_mate(const Vec3& e) {
    if (!(view_.tilt > kLeastTilt)) return;
    const double circles = differ();
    const View before = view_;
    view_.use_points();
    count_ = 0;
    query(e);
    if (differ() <= circles) return;
    view_ = before;
    count_ = 0;
    query(e);
  }

  bool query(const Vec3& e) {
    if (count_ == kMostCircles) return false;
    const double enough = kSupportShare * tolerance_;
    const Support k = find_hull_support(*view_.k, view_.turn_k.transpose() * e, nullptr,
                                        enough / view_.scale_k, kHullSlope),
                  m = find_hull_support(*view_.m, view_.turn_m.transpose() * -e, nullptr,
                                        enough / view_.scale_m, kHullSlope);
    ++queries_;
    Circle c;
    const Line line_k = view_.near_k ? line_of(*view_.k, view_.scale_k, view_.turn_k, e, k.where) : Line{},
               line_m = view_.near_m ? line_of(*view_.m, view_.scale_m, view_.turn_m, -e, m.where) : Line{};
    const Vec3 x = line_k.known ? line_k.at
                                : view_.turn_k * (view_.scale_k * k.point - view_.ball_k * k.normal),
               xm = line_m.known ? line_m.at : view_.turn_m * mate_core(m, view_.turn_m.transpose() * -e);
    c.nk = line_k.known ? line_k.normal : view_.turn_k * k.normal;
    c.nm = -(line_m.known ? line_m.normal : view_.turn_m * m.normal);
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
    const double p = view_.scale_k * k.upper + view_.scale_m * m.upper - balls() - e.dot(view_.offset);
    last_ = p;
    last_k_ = k.where;
    last_m_ = m.where;
    if (p < best_) {
      best_ = p;
      best_e_ = e;
      on_k_ = last_k_;
      on_m_ = last_m_;
    }
    return true;
  }

  // Of a rippled body, a parameter line round its axis that takes a support's place; pair frame.
  struct Line {
    bool known = false;
    Vec3 at, normal;  // in the half plane: how far a point is off that says nothing of its distance
    RoundPoint on;    // the body's own, scale 1
  };
  static Line line_of(const Shape& shape, double scale, const Mat3& turn, const Vec3& d,
                      const SurfacePoint& support) {
    const NearRevolution& near = shape.near_revolution;
    const Vec3 own = turn.transpose() * d, axis = near.revolution.axis;
    Line line{};
    line.known =
        find_round_point(near.meridian, shape.patches, own, shape.bounding_radius, support, &line.on);
    if (!line.known) return line;
    const RoundPoint& on = line.on;
    const Vec3 across = (own - axis.dot(own) * axis).normalized();
    line.at = scale * (turn * (near.meridian.point + on.r * across + on.z * axis));
    line.normal = turn * (on.profile.turn_r * across + on.profile.turn_z * axis);
    return line;
  }
  Wave wave(const Vec3& e, const Line& k, const Line& m) const {
    Wave wave;
    if (!view_.rippled()) return wave;
    wave.phi = azimuth(e);
    if ((view_.near_k && !k.known) || (view_.near_m && !m.known)) {
      wave.ripple = view_.ripple;
      return wave;
    }
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
    return wave;
  }

  Flat flat(double r, double z, const Vec3& k) const {
    const double x = tangent_.dot(k), y = second_.dot(k);
    return {r, z - view_.axis.dot(k), x, y, std::sqrt(x * x + y * y)};
  }

  bool on_arcs(const Circle& c) const {
    const auto on = [&](const RoundEdges::Circle& edge) {
      return std::hypot(c.r - view_.scale_k * edge.radius, c.z - view_.scale_k * edge.z) <= noise_;
    };
    const auto& edges = view_.arcs->edges;
    return view_.arcs->holds(azimuth(c.on_k), 0) && std::any_of(edges.begin(), edges.end(), on);
  }

  // Of the mate in its own axes: its core's support along unit `own`.
  Vec3 mate_core(const Support& on, const Vec3& own) const {
    const double left = view_.swept ? view_.scale_m * view_.swept->radius - view_.ball : -1;
    if (!view_.swept || left < 0) return view_.scale_m * on.point - view_.ball * on.normal;
    return view_.scale_m * view_.swept->points[view_.swept->support(own)] + left * own;
  }

  // To a sector's middle from where a circle was asked for, rad.
  static double turn_to(const Sector& sector, const Wave& w) {
    return std::remainder(sector.phi - w.phi, 2 * M_PI);
  }

  // The order of circles is that of the angles they were asked for. Chosen are those asked for in a sector,
  // and some on either side, of a mate's points some that were asked for at azimuths near the sector's.
  void choose(const Sector& sector, double half) {
    const auto before = [&](short c, const Angle& a) { return cross(flat_[c].at, a) > 0; };
    const short *const begin = order_, *const end = order_ + count_;
    const auto first = static_cast<int>(std::lower_bound(begin, end, sector.low, before) - begin),
               last = static_cast<int>(std::lower_bound(begin, end, sector.high, before) - begin);
    const double reach = std::max(kNearAzimuth, 2 * half);
    const Angle& u = sector.u;
    const auto near = [&](const FlatCircle& c) {
      if (view_.rippled()) {
        const double beyond = std::abs(turn_to(sector, c.wave)) - 2 * half;
        return !(beyond > 0) || c.wave.ripple.bend * beyond * beyond <= 2 * kRippleShare * tolerance_;
      }
      return (view_.circles && !c.lone) || reach > 1 || c.at.s == 0 ||
             2 - 2 * (c.u.c * u.c + c.u.s * u.s) <= square(reach);
    };
    chosen_ = 0;
    for (int i = first - 1, beside = 0; i >= 0 && beside < kBeside; --i) {
      const bool counts = near(flat_[order_[i]]);
      if (counts || first - i <= kBeside) which_[chosen_++] = order_[i];
      beside += counts;
    }
    for (int i = first; i < last; ++i) which_[chosen_++] = order_[i];
    for (int i = last, beside = 0; i < count_ && beside < kBeside; ++i) {
      const bool counts = near(flat_[order_[i]]);
      if (counts || i - last < kBeside) which_[chosen_++] = order_[i];
      beside += counts;
    }
  }
  void insert(const Circle& c) {
    int at = count_;
    for (; at > 0 && cross(c.at, flat_[order_[at - 1]].at) > 0; --at) order_[at] = order_[at - 1];
    order_[at] = static_cast<short>(count_);
    circle_[count_++] = c;
  }

  // Over the angles of a sector.
  struct Reach {
    double sine, cosine, across;  // least sine, largest |cosine|, least |e x b|
  };
  Reach reach_of(const Sector& sector) const {
    const double sine = std::min(sector.low.s, sector.high.s),
                 cosine = std::max(std::abs(sector.low.c), std::abs(sector.high.c));
    return {sine, cosine, sine * view_.axis.dot(view_.mate_axis) - view_.tilt};
  }
  // What M's circles of radius r lose at most when the azimuth turns by `half`: with y = e.b, |dy / dphi| <=
  // tilt, |d |e x b| / dphi| is at most 2 tilt, and |y| tilt / |e x b|.
  double turned(const Reach& reach, double half, double r) const {
    double rate = 2 * view_.tilt;
    if (reach.across > 0.5 * reach.sine)
      rate = std::min(rate, (reach.cosine + view_.tilt) * view_.tilt / reach.across);
    return rate * half * r;
  }

  // M's axis in the axes of an azimuth: u, a x u and a.
  Vec3 mate_axis_from(const Angle& u) const {
    const double x = tangent_.dot(view_.mate_axis), y = second_.dot(view_.mate_axis);
    return {x * u.c + y * u.s, y * u.c - x * u.s, view_.axis.dot(view_.mate_axis)};
  }
  // |e x b| for e at an angle in the half plane of an azimuth, and the point of M's unit circle that faces e,
  // in that azimuth's axes as b is. From cross products: 1 - (e.b)^2 would lose the digits where the axes are
  // nearly one.
  struct Facing {
    double sine;
    Vec3 point;
  };
  static Facing facing(const Angle& at, const Vec3& b) {
    const Vec3 cross = Vec3(at.s, 0, at.c).cross(b);
    const double sine = cross.norm();
    return {sine, b.cross(cross) / sine};
  }

  // A rippled circle at the azimuths within `half` of a sector's middle: that middle from where it was asked
  // for, if it is followed there, and what a direction loses besides at most. Those of M turn about M's axis:
  // |d psi / d phi - 1|, |d psi / d alpha| <= tilt / |e x b|.
  struct Drift {
    bool followed = false;
    double turn = 0, lost = 0;
  };
  Drift drift(const Wave& w, const Angle& at, const Sector& sector, double half, const Reach& over) const {
    if (!view_.rippled()) return {};
    Drift d{false, turn_to(sector, w), kOffRipple * w.ripple.most};
    double furthest = std::abs(d.turn) + half, tilted = 0;
    if (view_.near_m && view_.tilt > 0) {
      if (!(over.across > 0)) return d;
      double chord = 0;
      for (const Angle& a : {sector.low, sector.high})
        chord = std::max(chord, std::hypot(a.c - at.c, a.s - at.s));
      tilted = view_.tilt / over.across * (furthest + M_PI_2 * chord);
      furthest += tilted;
    }
    if (w.before < 0) return d;
    const double beyond =
        std::max({0.0, half + tilted - d.turn - w.before, d.turn + half + tilted - w.after});
    double lost = 0.5 * w.ripple.bend * square(furthest) + w.steep() * tilted;
    if (beyond > 0) lost += (w.ripple.slope + w.steep()) * beyond + view_.seam;
    if (!(lost < d.lost)) return d;
    d.followed = true;
    d.lost = lost;
    return d;
  }

  void follow(const Wave& w, double turn, Circle* c) const {
    c->r += turn * w.k_r;
    c->z += turn * w.k_z;
    c->rm += turn * w.m_r;
    c->k += turn * w.m_z * view_.mate_axis;
    c->middle += turn * w.m_z * view_.mate_axis;
  }

  // Whether the circles are known for azimuths within `half` of phi.
  bool reaches(double phi, double half) const { return !view_.arcs || view_.arcs->holds(phi, half); }
  // A circle as far as it goes: beyond the azimuths of an arc its point alone.
  Circle known(const Circle& c, double phi, double half) const {
    if (!c.lone && reaches(phi, half)) return c;
    Circle alone = c;
    alone.lone = true;
    alone.r = alone.z = 0;
    alone.k -= c.on_k;
    return alone;
  }

  // Of the chosen circles for azimuths within `half` of the sector's, that or 0.
  void project(const Sector& sector, double half) {
    const Angle &u = sector.u, turn = half > 0 ? sector.turn : Angle{1, 0};
    const Reach over = reach_of(sector);
    const double lost = over.sine > view_.tilt ? turned(over, half, 1) / over.sine : 0;
    const bool reaches = this->reaches(sector.phi, half);
    const Vec3 b = mate_axis_from(u);
    hull_.clear();
    lost_ = 0;
    if (view_.rippled()) followed_ += chosen_;
    for (int i = 0; i < chosen_; ++i) {
      const FlatCircle& c = flat_[which_[i]];
      const Flat& k = reaches && !c.lone ? c.whole : c.alone;
      const double along = k.x * u.c + k.y * u.s, across = k.y * u.c - k.x * u.s;
      // The most of it over the interval.
      const bool inside = half >= M_PI || along >= turn.c * k.length;
      const double reach =
          half > 0 ? (inside ? k.length : along * turn.c + std::abs(across) * turn.s) : along;
      const Drift drift = this->drift(c.wave, c.at, sector, half, over);
      double r = k.r - reach, z = k.z, rm = c.rm;
      if (drift.followed) {
        r += drift.turn * (c.wave.k_r - c.wave.m_z * b[0]);
        z += drift.turn * (c.wave.k_z - c.wave.m_z * b[2]);
        rm += drift.turn * c.wave.m_r;
      }
      double most = drift.lost + (drift.followed ? half * c.wave.steep() : 0);
      if (rm < 0) most -= rm;  // beyond the axis
      if (rm > 0) {
        const Facing m = facing(c.at, b);
        if (m.sine > kNoDirection) {  // else the tangent plane 0
          r += rm * (m.point[0] - lost);
          z += rm * m.point[2];
        }
      }
      if (most > 0) {
        if (over.sine > kLeastSine)
          r -= most / over.sine;
        else
          lost_ = std::max(lost_, most);
      }
      hull_.add(r, z);
    }
  }

  Least bound(const Sector& sector, double half, double threshold) {
    choose(sector, half);
    project(sector, half);
    const Reach over = reach_of(sector);
    double turned = 0;
    if (!(over.sine > view_.tilt)) {  // else circle by circle
      double widest = 0;
      for (int i = 0; i < chosen_; ++i) widest = std::max(widest, circle_[which_[i]].rm);
      turned = this->turned(over, half, widest);
    }
    turned += lost_;
    Least least =
        hull_.least(sector.low, sector.high, threshold + turned + noise_, 4 * kRoundoff * pair_.reach);
    least.value -= turned + noise_;
    compared_ += static_cast<long>(least.corners) * chosen_;
    return least;
  }

  // Least curvature radius along `v` of a body about the direction e (both in its axes), of lengths 1: for
  // directions within `reach` of e in their plane, or, `any`, of any tangent and all directions within reach.
  // 0 where nothing is known.
  double least_bend(const Shape& shape, const Vec3& e, const Vec3& v, double reach, bool any) const {
    const InnerMap& map = shape.lazy_inner_map.known();
    if (map.stretches.empty()) return 0;
    const int cell = InnerMap::cell(e);
    const double off = (e - InnerMap::middle(cell)).norm();
    for (int k = 0; k < static_cast<int>(kStretchCaps.size()); ++k) {
      if (!(kChord * (off + reach) <= kStretchCaps[k])) continue;
      const InnerStretch& s = map.stretches[cell];
      const Vec3 f(s.along[0], s.along[1], s.along[2]);
      const double along =
          any ? 0 : std::max(0.0, (1 - reach * reach) * std::abs(f.dot(v)) - kChord * reach * off);
      return s.least[k] + s.most[k] * along * along;
    }
    return 0;
  }

  // The same along the meridian of a body of revolution, `axis` its own, or of a ball, any axis.
  double meridian_bend(const Shape& shape, const Vec3& e, const Vec3& axis, double reach) const {
    const double cosine = e.dot(axis), sine = e.cross(axis).norm();
    const double radius = shape.proofs.sphere ? 0 : shape.profile_radii.within(cosine, sine, kChord * reach);
    if (!(sine > kNoDirection)) return radius;
    return std::max(radius, least_bend(shape, e, (axis - cosine * e) / sine, reach, false));
  }

  // The same of a rippled one that two lines are known of, less `off`, if that leaves enough of the
  // tolerance.
  double rippled_bend(const Shape& shape, double scale, const Vec3& e, double reach,
                      const Meridian::Place& one, const Meridian::Place& two, double* off) const {
    const ProfileBall ball =
        ball_within(shape.near_revolution, e, kChord * reach, one, two, shape.bounding_radius);
    if (!(scale * ball.off <= kRippleShare * tolerance_)) return 0;
    *off += scale * ball.off;
    return ball.radius;
  }

  // Balls that touch two circles from inside, wherever they and the sector's directions lie on the meridians:
  // their centres take the circles' place. Returns the sum of the balls' radii, K's and M's.
  // `off`: what that is less by.
  double round_off(const Sector& sector, const Angle& at, const Vec3& u, const Reach& over, Circle* one,
                   Circle* two, double* off) const {
    // By how much angles from an axis differ, as chords.
    const auto apart = [](const Vec3& axis, const Vec3& x, const Vec3& y) {
      const double s = x.cross(axis).norm() - y.cross(axis).norm(), c = axis.dot(x - y);
      return std::sqrt(s * s + c * c);
    };
    const Vec3 e = at.s * u + at.c * view_.axis;
    double range = 0, asked = 0;
    for (const Angle* a : {&sector.low, &sector.high})
      range = std::max(range, std::sqrt(square(a->c - at.c) + square(a->s - at.s)));
    for (const Circle* c : {one, two}) asked = std::max(asked, apart(view_.axis, c->nk, e));
    const Mat3 to_k = view_.turn_k.transpose(), to_m = view_.turn_m.transpose();
    double of_k = 0;
    const double reach_k = std::max(range, asked);
    if (view_.near_k)
      of_k = view_.scale_k *
             rippled_bend(*view_.k, view_.scale_k, to_k * e, reach_k, one->place_k, two->place_k, off);
    else if (!view_.arcs)
      of_k = view_.scale_k * meridian_bend(*view_.k, to_k * e, view_.k->revolution.axis, reach_k);
    of_k = std::max(0.0, of_k - view_.ball_k);
    for (Circle* c : {one, two}) {
      c->r -= of_k * view_.across(c->nk).norm();
      c->z -= of_k * c->nk.dot(view_.axis);
    }
    double of_m;
    asked = 0;
    if (view_.circles) {
      const Vec3& axis = view_.mate_axis;
      for (const Circle* c : {one, two}) asked = std::max(asked, apart(axis, c->nm, e));
      range += view_.tilt * sector.half / over.across;
      const double reach_m = std::max(range, asked);
      const Vec3 own = view_.m->proofs.sphere ? Vec3(to_m * axis) : view_.m->revolution.axis;
      of_m = view_.scale_m * (view_.near_m ? rippled_bend(*view_.m, view_.scale_m, to_m * -e, reach_m,
                                                          one->place_m, two->place_m, off)
                                           : meridian_bend(*view_.m, to_m * -e, own, reach_m));
      of_m = std::max(0.0, of_m - view_.ball);
      for (const Circle* c : {one, two}) of_m = std::min(of_m, c->rm / c->nm.cross(axis).norm());
      for (Circle* c : {one, two}) {
        c->rm -= of_m * c->nm.cross(axis).norm();
        c->k += of_m * c->nm.dot(axis) * axis;
      }
    } else {
      for (const Circle* c : {one, two}) asked = std::max(asked, (c->nm - e).norm());
      range += sector.half;
      of_m = view_.scale_m * least_bend(*view_.m, to_m * -e, Vec3::Zero(), std::max(range, asked), true);
      of_m = std::max(0.0, of_m - view_.ball);
      for (Circle* c : {one, two}) c->k += of_m * c->nm;
    }
    return of_k + of_m;
  }

  // Of one circle, or of two so weighted that nothing is to be gained by another angle: what they say of
  // (alpha, phi) near (at, sector.phi), to second order. With F = r |e x a| + z e.a + rho |e x b| - e.k, e of
  // the sector's angles and azimuths:
  //     F >= q cos(dalpha) + t sin(dalpha) + (f + g dalpha) dphi - bend dphi^2 / 2,  |g| <= twist,
  // since |e x b| is convex along the meridian, and by Taylor's theorem along the azimuth. The greatest of
  // all circles is no less, and what it says of the azimuth to first order cancels at the minimum. With y =
  // e.b, |dy / dphi| <= tilt, |dy / dalpha| <= 1 and |e x b|^2 = 1 - y^2, the derivatives of |e x b| are
  //     |by phi twice| <= (y'^2 + |y y''|) / |e x b| + y^2 y'^2 / |e x b|^3,
  //     |by alpha and phi| <= tilt (1 / |e x b| + |y| |cos alpha| / |e x b| + y^2 / |e x b|^3).
  // Where a meridian is known to bend by no less than R between the circles and in the sector (inner_map.h),
  // the body holds the balls of that radius that touch there from inside: circles of their centres, and R
  // more. `narrower`: the angles should be halved rather than the azimuths; they are where they reach far, as
  // from one minimum to another.
  double second_order(const Sector& sector, const Least& here, bool* narrower) const {
    const Vec3 u = outward(sector.u), across = view_.axis.cross(u);
    const double c = here.at.c, s = here.at.s;
    const auto too_far = [&](const Angle& a) { return !(c * a.c + s * a.s > kWidestSecond); };
    *narrower = too_far(sector.low) || too_far(sector.high);
    if (*narrower) return -kFarAway;
    const Reach over = reach_of(sector);
    const Vec3 b = mate_axis_from(sector.u);
    Facing m{1, Vec3::Zero()};
    double turned = 0;
    if (view_.circles) {
      m = facing(here.at, b);
      turned = s * m.point[1];
      if (!(over.across > 0.5 * over.sine)) return -kFarAway;
    }
    struct Slope {
      double q, t, f;
    };
    const auto slope = [&](const Circle& circle) {
      const double ps = circle.r - circle.k.dot(u) + circle.rm * m.point[0],
                   pc = circle.z - circle.k.dot(view_.axis) + circle.rm * m.point[2],
                   f = circle.rm * turned - s * circle.k.dot(across);
      return Slope{ps * s + pc * c, ps * c - pc * s, f};
    };
    double rippled = 0, steep = 0;
    const auto at_sector = [&](int k, double* wave_slope) {
      Circle circle = known(circle_[k], sector.phi, sector.half);
      const Wave& w = flat_[k].wave;
      const Drift drift = this->drift(w, circle.at, sector, sector.half, over);
      rippled = std::max(rippled, drift.lost);
      *wave_slope = 0;
      if (drift.followed) {
        steep = std::max(steep, w.steep());
        *wave_slope = s * w.k_r + c * w.k_z + m.sine * w.m_r - w.m_z * (s * b[0] + c * b[2]);
        follow(w, drift.turn, &circle);
      }
      if (circle.rm < 0) {  // beyond M's axis
        rippled -= circle.rm;
        circle.rm = 0;
      }
      return circle;
    };
    double wave_x, wave_y;
    Circle one = at_sector(which_[here.from], &wave_x), two = at_sector(which_[here.to], &wave_y);
    double off = 0;
    const double round = round_off(sector, here.at, u, over, &one, &two, &off) - rippled - off;
    Slope x = slope(one), y = slope(two);
    x.f += wave_x;
    y.f += wave_y;
    const double share = x.t * y.t < 0 ? y.t / (y.t - x.t) : x.q > y.q ? 1.0 : 0.0;
    const double q = share * x.q + (1 - share) * y.q, t = share * x.t + (1 - share) * y.t,
                 f = share * x.f + (1 - share) * y.f, rho = share * one.rm + (1 - share) * two.rm;
    const Vec3 k = view_.across(share * one.k + (1 - share) * two.k);
    const double tilt = view_.tilt, inverse = view_.circles ? 1 / over.across : 1.0,
                 cosine = over.cosine + tilt;  // of y
    const double h = sector.half, cube = square(cosine * inverse) * inverse, along = std::abs(k.dot(across)),
                 facing = k.dot(u),
                 near = h < 1 ? (facing > 0 ? facing * (1 - 0.5 * h * h) : facing) - along * h : -k.norm();
    const double bend = -(near > 0 ? over.sine * near : near) +
                        rho * tilt * ((tilt + cosine) * inverse + tilt * cube),
                 twist = over.cosine * along + rho * tilt * ((1 + cosine * over.cosine) * inverse + cube) +
                         kChord * steep;
    // Along the angles a sine, least at an end or, where it bends upwards, in between.
    double least = kFarAway;
    for (const double side : {t - kChord * twist * h, t + kChord * twist * h}) {
      const auto at = [&](const Angle& a, double* slope) {
        const double cd = c * a.c + s * a.s, sd = c * a.s - s * a.c;
        *slope = side * cd - q * sd;
        return q * cd + side * sd;
      };
      double first, last;
      least = std::min({least, at(sector.low, &first), at(sector.high, &last)});
      if (first < 0 && last > 0) least = std::min(least, -std::sqrt(q * q + side * side));
    }
    // Where the azimuth bends it upwards it has its least value inside.
    const double lost = -bend * h > std::abs(f) ? -0.5 * f * f / bend : std::abs(f) * h + 0.5 * bend * h * h;
    *narrower = q - least > lost + rippled;
    return round + least - lost - noise_;
  }

  // A rippled circle may be known in one direction only.
  bool was_asked(const Angle& at, const Sector& sector) const {
    if (!view_.rippled()) return false;
    return std::any_of(which_, which_ + chosen_, [&](int k) {
      return std::abs(cross(flat_[k].at, at)) <= kSameAngle &&
             std::abs(turn_to(sector, flat_[k].wave)) <= kSameAngle;
    });
  }

  // Rippled circles tell of azimuths near theirs, and those of sectors that are closed are done with.
  void forget_far_from(const Sector& sector) {
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

  bool close(const Sector& all, bool last, double* left) {
    const bool ample = last || view_.rippled();  // which are tried but once
    const double most_spent = ample ? kMostSpentLast : kMostSpent,
                 most_compared = ample ? kMostComparedLast : kMostCompared,
                 first_spent = ample ? kFirstSpentLast : kFirstSpent;
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

  void fill(PolytopeResult* r) {
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

  void witness(int k, const Sector& there, Vec3* on_k, Vec3* on_m) const {
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

  const PairFrame& pair_;
  View view_;
  const double tolerance_;
  Vec3 tangent_, second_;  // square to the axis
  double noise_;
  double best_ = kFarAway, proven_ = kFarAway, last_ = 0;
  Vec3 best_e_ = Vec3::UnitX();
  SurfacePoint on_k_, on_m_, last_k_, last_m_;
  int count_ = 0, dropped_ = 0, queries_ = 0;
  long compared_ = 0;  // circles, in plane hulls
  long followed_ = 0;  // rippled ones
  double lost_ = 0;    // of those in the hull, by ripples, where radii can't take it
  Circle circle_[kMostCircles];
  FlatCircle flat_[kMostCircles];
  short order_[kMostCircles];
  int chosen_ = 0, which_[kMostCircles];
  HalfPlaneHull hull_;  // of the chosen
};

// About the axis of K's revolution or, if not null, of these arcs.
bool search_about(const PairFrame& pair, bool k_is_a, const RoundEdges* arcs, double tolerance, bool last,
                  double* left, PolytopeResult* result) {
  const Shape &k = k_is_a ? *pair.a : *pair.b, &mate = k_is_a ? *pair.b : *pair.a;
  const double scale = k_is_a ? pair.scale_b : pair.scale_a;
  const bool round = PairFrame::rolling_ball(mate, scale, tolerance) > 0 && !mate.proofs.sphere;
  // Circles of a mate about nearly the same axis serve better, unless it ends in spheres.
  const Vec3 of_k = arcs ? arcs->axis : revolution_of(k).axis, of_mate = revolution_of(mate).axis,
             axis = k_is_a ? Vec3(pair.turn * of_mate) : of_mate,
             own = k_is_a ? of_k : Vec3(pair.turn * of_k);
  const bool near = revolution_of(mate).found && own.cross(axis).norm() < kNearAxis;
  for (const bool core : {false, true})
    if ((core ? round : near || !round) &&
        RingSearch(pair, k_is_a, core, tolerance, arcs).run(last, left, result))
      return true;
  return false;
}

}  // namespace

const Revolution& revolution_of(const Shape& shape) {
  return shape.revolution.found ? shape.revolution : shape.near_revolution.revolution;
}

bool search_rings(const PairFrame& pair, double tolerance, bool last, PolytopeResult* result) {
  double left = kAllRings;
  for (const bool k_is_a : {true, false}) {
    const Shape& k = k_is_a ? *pair.a : *pair.b;
    if (revolution_of(k).found && !k.proofs.sphere &&
        search_about(pair, k_is_a, nullptr, tolerance, last, &left, result))
      return true;
    for (const RoundEdges& arcs : k.round_edges)
      if (search_about(pair, k_is_a, &arcs, tolerance, last, &left, result)) return true;
  }
  return false;
}

}  // namespace nurbs

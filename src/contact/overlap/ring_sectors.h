// Branch and bound over sectors, ranges of azimuth and of angle from an axis, about one axis of one pair; the
// bounds are derived in ring_search.h. Two files: the search (ring_sectors.cpp), what circles say of a sector
// (ring_bounds.cpp).
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>

#include "contact/overlap/half_plane_hull.h"
#include "contact/overlap/polytope.h"
#include "contact/overlap/ring_view.h"

namespace nurbs {

class RingSectors {
 public:
  // `core`: of the bodies, and the balls that roll inside them, instead of the bodies.
  // `arcs`: of K, where that is not of revolution itself.
  RingSectors(const PairFrame& pair, bool k_is_a, bool core, double tolerance, const RoundEdges* arcs);

  // Improves `result` as search_rings does. `left`: of what may be spent, less what is.
  bool run(bool last, double* left, PolytopeResult* result);

 private:
  static constexpr int kMostCircles = HalfPlaneHull::kMost;  // supports evaluated
  // Of the tolerance, up to which rippled circles are followed anyway.
  static constexpr double kRippleShare = 0.2;
  using Least = HalfPlaneHull::Least;

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

  // How rippled circles change from the azimuth they were asked for, as K's grows by a rad; those of M by
  // their radius and the height over M's centre. One patch each from `before` to `after` (rad, not negative).
  struct Wave {
    double phi = 0, k_r = 0, k_z = 0, m_r = 0, m_z = 0, before = -1, after = -1;
    double steep = 0;  // all of them, at most
    Ripple ripple;     // of both bodies' lines
    Angle near{1, 0};  // how far from there it hardly tells
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
  static Sector sector_at(double phi, double half);

  double balls() const { return view_.ball + view_.ball_k; }
  double azimuth(const Vec3& e) const { return std::atan2(second_.dot(e), tangent_.dot(e)); }
  Vec3 outward(const Angle& u) const { return u.c * tangent_ + u.s * second_; }
  Vec3 direction(const Angle& a, const Angle& u) const { return a.s * outward(u) + a.c * view_.axis; }
  // How much a turn about K's axis changes at the first direction.
  double differ() const;
  // M's circles or, if they change more, its points: a tip stays where it is however M is tilted.
  void choose_mate(const Vec3& e);

  bool query(const Vec3& e);

  // Of a rippled body, a parameter line round its axis that takes a support's place; pair frame.
  struct Line {
    bool known = false;
    Vec3 at, normal;  // in the half plane: how far a point is off that says nothing of its distance
    RoundPoint on;    // the body's own, scale 1
  };
  static Line line_of(const Shape& shape, double scale, const Mat3& turn, const Vec3& d,
                      const SurfacePoint& support);
  Wave wave(const Vec3& e, const Line& k, const Line& m) const;
  Flat flat(double r, double z, const Vec3& k) const;
  bool on_arcs(const Circle& c) const;
  // Of the mate in its own axes: its core's support along unit `own`.
  Vec3 mate_core(const Support& on, const Vec3& own) const;
  void insert(const Circle& c);

  // A rippled circle may be known in one direction only.
  bool was_asked(const Angle& at, const Sector& sector) const;
  // Rippled circles tell of azimuths near theirs, and those of sectors that are closed are done with.
  void forget_far_from(const Sector& sector);
  bool close(const Sector& all, bool last, double* left);
  void fill(PolytopeResult* r);
  void witness(int k, const Sector& there, Vec3* on_k, Vec3* on_m) const;

  // The bounds.
  // To a sector's middle from where a circle was asked for, rad.
  static double turn_to(const Sector& sector, const Wave& w);
  // The order of circles is that of the angles they were asked for. Chosen are those asked for in a sector,
  // and some on either side, of a mate's points some that were asked for at azimuths near the sector's.
  void choose(const Sector& sector, double half);
  // Over the angles of a sector.
  struct Reach {
    double sine, cosine, across;  // least sine, largest |cosine|, least |e x b|
  };
  Reach reach_of(const Sector& sector) const;
  double turned(const Reach& reach, double half, double r) const;
  // M's axis in the axes of an azimuth: u, a x u and a.
  Vec3 mate_axis_from(const Angle& u) const;
  // |e x b| for e at an angle in the half plane of an azimuth, and the point of M's unit circle that faces e,
  // in that azimuth's axes as b is. From cross products: 1 - (e.b)^2 would lose the digits where the axes are
  // nearly one.
  struct Facing {
    double sine;
    Vec3 point;
  };
  static Facing facing(const Angle& at, const Vec3& b);
  // A rippled circle at the azimuths within `half` of a sector's middle: that middle from where it was asked
  // for, if it is followed there, and what a direction loses besides at most. Those of M turn about M's axis:
  // |d psi / d phi - 1|, |d psi / d alpha| <= tilt / |e x b|.
  struct Drift {
    bool followed = false;
    double turn = 0, lost = 0;
  };
  Drift drift(const Wave& w, const Angle& at, const Sector& sector, double half, const Reach& over) const;
  void follow(const Wave& w, double turn, Circle* c) const;
  // Whether the circles are known for azimuths within `half` of phi.
  bool reaches(double phi, double half) const { return !view_.arcs || view_.arcs->holds(phi, half); }
  // A circle as far as it goes: beyond the azimuths of an arc its point alone.
  Circle known(const Circle& c, double phi, double half) const;
  // Of the chosen circles for azimuths within `half` of the sector's, that or 0.
  void project(const Sector& sector, double half);
  Least bound(const Sector& sector, double half, double threshold);
  double rippled_bend(const Shape& shape, double scale, const Vec3& e, double reach,
                      const Meridian::Place& one, const Meridian::Place& two, double* off) const;
  double round_off(const Sector& sector, const Angle& at, const Vec3& u, const Reach& over, Circle* one,
                   Circle* two, double* off) const;
  double second_order(const Sector& sector, const Least& here, bool* narrower) const;

  const PairFrame& pair_;
  RingView view_;
  const double tolerance_;
  Vec3 tangent_, second_;  // square to the axis
  double noise_;
  double best_ = kFarAway, proven_ = kFarAway;
  Vec3 best_e_ = Vec3::UnitX();
  SurfacePoint on_k_, on_m_;
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

}  // namespace nurbs

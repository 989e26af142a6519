// One search of the polytope method (polytope.h): the growing hull of A - B, what its points came from, and
// what is proven about minima. Three files: directions to ask for (polytope_search.cpp), caps about minima
// (polytope_caps.cpp), the contact points at the end (polytope_points.cpp).
#pragma once

#include <array>

#include "body/hull_point.h"
#include "contact/overlap/face_distances.h"
#include "contact/overlap/growing_hull.h"
#include "contact/overlap/polytope.h"
#include "contact/overlap/turn_bound.h"
#include "nurbs/room.h"

namespace nurbs {

// That of the points along the normal, which are moved to be it apart. Where the bracket stayed open, the
// least overlap seen: the hull errs to first order, the direction to second.
void set_gap(PolytopeResult* r);

// How far the points are from lying on one line along the normal.
double off_each_other(const PolytopeResult& r);
// Where that is far: the supports along the normal, if they do better. Points in the middle of others are off
// the bodies where many directions are nearly level and few were asked.
void use_supports(const PairFrame& pair, double tolerance, PolytopeResult* r);

constexpr double kFacing = 1e-6;  // of the smaller body: witnesses may be off each other by

class PolytopeSearch {
 public:
  // `joggle`: a length, that the hull's points are moved by at random. `points`: of two sphero-polyhedra
  // nothing else is left.
  PolytopeSearch(const PairFrame& pair, double tolerance, double joggle, bool points);

  // What is known of the gap besides.
  void bound(double upper) { upper_ = known_ = upper; }
  // Leaves minima alone: where a support's points lie close together (a small body on a crease), rings of
  // more of them break the hull.
  void let_be();

  // Builds the first solid: along the seed and three directions that make a tetrahedron with it; while those
  // are flat, across the triangle (or the line) that they make. False where all are flat.
  bool start(const Vec3& seed);
  // Until the bracket is closed, the gap is above `enough`, or `most` points are spent. May be gone on with.
  void run(double enough, int most);

  bool only_points() const { return points_; }
  // Whether round-off ended the search, so that other directions may do better.
  bool stalled() const { return stalled_; }
  // Whether it was ended because its bracket would not close; it may be gone on with.
  bool hopeless() const { return hopeless_; }

  // What is known so far, without the contact points.
  PolytopeResult bracket() const;
  // Ends the search: the hull may be made again for the points.
  PolytopeResult result();
  // Points for a bracket that was closed by other means.
  bool find_points(PolytopeResult* r);

 private:
  // What the hull's point of the same number came from.
  struct Witness {
    Vec3 a, b;  // of the shrunk bodies
    Vec3 d;     // asked
    double p;   // upper bound of the overlap along it
    HullPlace on_a, on_b;
    bool cap;  // no point of the obstacle: see cover
  };
  // Directions within `proven` of d have an overlap (of the cores) of at least `level`; those within `used`
  // of it are given away to the hull's point `vertex`.
  struct Cap {
    Vec3 d;
    double level;
    double proven, used;  // cosines
    double slope;         // of the overlap at d, at most
    int vertex, from;     // the minimum's own
  };
  // How far the pair of witnesses is from the target; the triangle nearest to that and the way there from it.
  struct Facing {
    double off;
    int face = -1;
    Vec3 towards = Vec3::Zero();
  };

  // About the minimum at point `from` of another search, with cores that are those of the bodies for
  // directions within `valid` of it.
  PolytopeSearch(const PolytopeSearch& whole, int from, double valid, double shrink_a, double shrink_b);

  double roundoff() const { return pair_.roundoff + rise_ + 2 * joggle_ + error_; }
  bool is_broken();
  // A point less high above a face than this is not worth adding: the bracket is as good as closed there.
  double least_height() const { return std::max(0.25 * roundoff(), kLeastHeight * tolerance_); }
  static HullPoints hull_points(const Shape& shape, double scale, double tolerance);
  // On the patches: where to begin the next time, no more.
  static SurfacePoint surface_place(const Shape& shape, const HullPlace& at, const Vec3& d);

  // Support pair along unit d as a new point; tightens the lower bound of the gap. `near`: a point whose
  // supports are worth starting from where they are nearer than the atlas's, or -1. -1 when the hull is full.
  int query(const Vec3& d, int near);
  // The points of both bodies as the hull's next; not when it is full.
  int take(const Vec3& d, const HullPoint& a, const HullPoint& b);
  // The tetrahedron of largest volume among the points, greedily, and the others onto it. False where it is
  // lower than `least` of its own size; `across` is then square to it.
  bool start_from_points(double least, Vec3* across);
  // W_A + W_B of the cores at the supports of point v, in the tangent plane of d spanned by t and s: what
  // p(d) of the cores bends by there, but for p itself.
  bool core_turn(int v, const Vec3& d, const Vec3& t, const Vec3& s, Mat2* turn) const;
  // In the unit cube, the same for equal points and in no relation for others.
  Vec3 scatter(const Vec3& g) const;

  // Goes from point v to the minimum of p that it is near and surrounds it. False where one has been
  // surrounded before or p has no smooth minimum.
  bool settle(int v);
  int polish(int v, bool* smooth);
  void balance(const std::array<short, 3>& corners, int v);
  void surround(int from, double covered);
  // The face nearest to the origin, the direction to ask for it, and the upper bound of the gap it proves.
  int best_face();
  int closest_of(const GrowingHull::Face& f, const Vec3& d) const;
  Vec3 away_from(const GrowingHull::Face& f, const Vec3& closest) const;

  // What caps prove of the cores: the least overlap seen, less a share of the tolerance.
  double cap_level() const;
  double cover(int v);
  double add_cap(int v, double level, double angle, double slope);
  void cover_by_cores();
  bool cover_by_cores(int v);
  double prove(double* level);
  // What is known of W of both bodies about the direction of point v, in its plane spanned by t and s.
  struct Bends {
    TurnBound a, b;
  };
  Bends bends_at(int v, const Vec3& t, const Vec3& s) const;
  void lower_caps();
  void drop_caps();

  PolytopeResult with_points(const Vec3& a, const Vec3& b) const;
  Vec3 target() const;
  void find_witness(Vec3* a, Vec3* b);
  void refine_pair(FaceDistances* distances, Vec3* a, Vec3* b);
  Facing find_nearest_pair(FaceDistances* distances, Vec3* a, Vec3* b) const;

  static constexpr int kBeforeCores = 96;  // points before a cap by cores is tried

  const PairFrame& pair_;
  double tolerance_, joggle_;
  double shrink_a_, shrink_b_, shrink_;
  HullPoints points_a_, points_b_;
  double error_;         // of their points
  double rise_ = 0;      // above the bodies, of what they are shrunk by
  bool points_ = false;  // are all that is left
  double valid_ = M_PI;  // what the cores hold for: directions within it of the middle
  Vec3 middle_ = Vec3::Zero();
  double lower_ = -kFarAway, upper_ = kFarAway, near_ = -kFarAway;
  double known_ = kFarAway;  // upper end by other means than the hull
  Vec3 direction_ = Vec3::UnitX(), direction_to_ask_ = Vec3::UnitX();
  int best_ = 0, queries_ = 0, balances_ = 0, minima_ = 0;
  bool broken_ = false, stalled_ = false, hopeless_ = false, lower_caps_ = false;
  int caps_ = 0;
  Cap cap_[kMostMinima];
  Vec3 minimum_[kMostMinima];           // directions surrounded
  int tried_[kMostMinima], tries_ = 0;  // points about which caps were tried by cores
  int before_cores_ = kBeforeCores;
  Room<Witness, kHullVertices> witness_;
  GrowingHull hull_;
};

}  // namespace nurbs

// Convex polygons in a plane: intersection with the sources of every corner kept, thinning to few corners,
// and the weights that make a polygon's corners stand for a uniform load on it. No allocation.
#pragma once

#include <cstdint>
#include <vector>

#include "nurbs/types.h"

namespace nurbs {

constexpr int kOutlinePoints = 64;  // of a flat face: a round one is then inscribed to 0.12 % of its radius
constexpr int kContactPoints = 8;   // of a contact polygon

// Corners counterclockwise. Side i runs from corner i to corner i + 1 and came from side `side[i]` of the
// polygon `owner[i]`: 0 the first operand of intersect(), 1 the second.
struct ConvexPolygon {
  static constexpr int kMost = 2 * kOutlinePoints;
  int count = 0;
  Vec2 corner[kMost];
  int owner[kMost], side[kMost];

  void add(const Vec2& at, int from = 0, int index = 0) {
    corner[count] = at;
    owner[count] = from;
    side[count++] = index;
  }
  int next(int i) const { return i + 1 < count ? i + 1 : 0; }
  int before(int i) const { return i > 0 ? i - 1 : count - 1; }
};

inline double cross2(const Vec2& a, const Vec2& b) {
  return a[0] * b[1] - a[1] * b[0];
}

double polygon_area(const ConvexPolygon& polygon);
Vec2 polygon_centroid(const ConvexPolygon& polygon);  // its area must be > 0

// How far the corners of `points` at least are inside the polygon: signed distance to the nearest of the
// lines through its sides, < 0 outside.
double depth_inside(const ConvexPolygon& polygon, const ConvexPolygon& points);

// The lines through a polygon's sides, kept for one that is asked often.
class SideLines {
 public:
  SideLines() = default;
  explicit SideLines(const ConvexPolygon& polygon);
  double depth_inside(const Vec2& point) const;  // as above, of one point

 private:
  template <class Archive>
  friend void archive(Archive& a, SideLines& s) {
    auto& [x, y, offset] = s;
    a(x, y, offset);
  }

  std::vector<double> x_, y_, offset_;  // padded, so that several are looked at together
};

// `subject` cut by `window`, both of at most kOutlinePoints corners (Sutherland & Hodgman, Comm. ACM 17
// (1974) 32). Corners of `subject` outside by less than `slack` (length) count as inside, and corners closer
// than that are merged, so that coinciding sides do not breed corners. The result's owner 0 is `subject`, 1
// `window`. Empty when they do not overlap. O(n m).
ConvexPolygon intersect(const ConvexPolygon& subject, const ConvexPolygon& window, double slack);

// The part [t0, t1] of the segment p q inside the polygon (Cyrus & Beck), t in [0, 1], and the sides that cut
// it, -1 where its own end remains. An end outside by less than `slack` remains. False when nothing is left.
struct SegmentPart {
  double t0 = 0, t1 = 1;
  int side0 = -1, side1 = -1;
};
bool clip_segment(const ConvexPolygon& window, const Vec2& p, const Vec2& q, double slack, SegmentPart* part);

// Indices, ascending, of at most `most` corners to keep: the corner whose triangle with its neighbours is
// least goes first (Visvalingam & Whyatt 1993), ties within 1e-6 going to the one counted first from `lead`,
// which stays. A regular polygon keeps regular where it can. Returns how many. O(n^2).
int thin(const ConvexPolygon& polygon, int most, int lead, int* kept);

// Weights w > 0 of the corners, sum 1, whose centre sum_i w_i corner_i is `centre`. With the polygon's own
// centroid c they are those of a uniform load, w_i = (A_(i-1) + A_i) / (2 A), A_i the triangle c, corner i,
// corner i + 1: linear interpolation on the fan, the share of c given to the corners, which reproduces c
// exactly; continuous where corners merge or are born; equal on regular polygons and rectangles. Another
// `centre` (that of a polygon before it was thinned) is met by a factor linear in the plane. Second moments
// are larger than the uniform load's: 3 times on a rectangle.
void corner_weights(const ConvexPolygon& polygon, const Vec2& centre, double* weight);

}  // namespace nurbs

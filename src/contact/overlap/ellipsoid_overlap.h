// The least overlap of two bodies that are ellipsoids or capsules, however deep they lie in each other: one
// dimension is searched, and a step of it is a test of one 3 x 3 matrix.
#pragma once

#include "body/ellipsoid.h"
#include "nurbs/types.h"

namespace nurbs {

// What a ball sweeps whose centre moves in an ellipsoid: its support function is h(d) = |root d| + ball. The
// ellipsoid may be a segment (of rank 1), as a capsule's, or a point. Lengths, of any axes.
struct SweptEllipsoid {
  Mat3 root = Mat3::Zero();    // symmetric, no negative eigenvalue
  double least = 0, most = 0;  // semi-axes
  double ball = 0;

  // A body in its own axes, which `turn` turns into others; what a ball sweeps along `half` both ways.
  static SweptEllipsoid of(const Ellipsoid& e, double scale, const Mat3& turn);
  static SweptEllipsoid along(const Vec3& half, double ball);

  double height(const Vec3& d) const { return (root * d).norm(); }  // of the ellipsoid alone
  Vec3 point(const Vec3& d) const;  // ... and where; the centre where that is all of a segment
  bool is_segment() const { return least == 0 && most > 0; }
};

// The least of p(d) = h_A(d) + h_B(d) - offset . d over unit d and the direction it is met along; p is proven
// to be at least `level` everywhere.
struct LeastOverlap {
  Vec3 direction;
  double overlap, level;
  int tests;
};

// False where neither is round, the bodies overlap by less than `tolerance` without their balls, or round-off
// leaves it open (a size ratio of some 1e4). `level` is half of the tolerance below the overlap; `start`:
// unit, where to look first. 2 us, of which 1 is the proof.
//
// Proof, for a depth T of what is left of p without the balls. With r = |root_A d| / |root_B d| in [s, t], (r
// - s) (t - r) >= 0 makes 2 |root_A d| |root_B d| (s + t) >= 2 (|root_A d|^2 + s t |root_B d|^2), so that
//     (|root_A d| + |root_B d|)^2 >= d' M d,   M = (1 + 2 / (s + t)) root_A^2 + (1 + 2 s t / (s + t))
//     root_B^2,
// with equality where r is s or t, and for t = infinity M = root_A^2 + (1 + 2 s) root_B^2. What is to be
// shown of all d of such r is then d' M d >= (offset . d + T)^2. That holds if some m > 0 has
//     N = M - (1 + m) T^2 I positive definite   and   (1 + 1 / m) offset' N^-1 offset <= 1,
// for (offset . d + T)^2 <= (1 + 1 / m) (offset . d)^2 + (1 + m) T^2, and of all d only then (S-lemma:
// Yakubovich 1971; Boyd, El Ghaoui, Feron & Balakrishnan 1994, section 2.6.3). Intervals that cover all
// ratios prove T. Where no m serves, N^-1 offset is a direction of less than T for some ratio, and so
// altogether. About the least overlap an interval is as wide as the root of the tolerance, from there on they
// grow with the distance: some 30 are usual, also where a ring of directions is alike, or all are.
bool find_least_overlap(const SweptEllipsoid& a, const SweptEllipsoid& b, const Vec3& offset,
                        const Vec3& start, double tolerance, LeastOverlap* found);

}  // namespace nurbs

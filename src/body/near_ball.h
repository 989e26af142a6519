// Bodies that are nearly balls, as spheres from files of few digits are: balls inside them, piece by piece of
// their surface. About one centre two such bodies overlap by almost the same along all directions, so that
// neither curvature nor points tell which is the least (contact/overlap/near_ball_search.h).
#pragma once

#include <vector>

#include "nurbs/lazy.h"
#include "nurbs/types.h"

namespace nurbs {

struct Shape;

// The part [u0, u0 + du] x [v0, v0 + dv] of a patch, seen from an origin o: it is in the cone about `axis`
// whose angle has `cosine` and `sine`, and for unit d, where the ray from o along d leaves the body in it,
//     h(d) >= d . centre + radius,
// lengths of the shape frame, h the support function of the body's hull. Theorem: the ray leaves the body at
// a point x = o + s d of the piece, and h(d) >= d . o + s. Where no point of the piece has |x - centre| < r,
// s is no less than the larger root of |o + s d - centre| = r, so that with q = centre - o
//     h(d) >= d . centre + sqrt(r^2 - |q|^2 + (d . q)^2),
// where (d . q)^2 has a least value in the cone. As a ball's support is r + d . centre, what q has across d
// is lost: the loss is least where the body's normal leads through o. Hypotheses: |q| < r; the origin lies in
// the body, and its pieces leave no ray from there a way between them: they are widened, and their balls made
// smaller, by what joints and poles gape.
struct BallPiece {
  int patch;
  double u0, v0, du, dv;
  Vec3 axis;            // unit
  double cosine, sine;  // -1 and 0: all directions
  Vec3 centre;
  double radius;
  double lack;  // by how much it may be less than it could be, but for ...
  double loss;  // ... the origin's
  int halves;   // number of the first of its halves, which the other follows; -1 where they are not made
};

// Of a patch: x w^2, (|x|^2 - R^2) w^2 and w^2 in Bernstein form, with R a radius between the body's.
struct BallNet {
  using Coefficient = Eigen::Matrix<double, 5, 1>;
  int m = 0, n = 0;  // degrees
  std::vector<Coefficient> net;
};

struct NearBall {
  std::vector<BallNet> patches;   // none: the body is not nearly a ball
  std::vector<BallPiece> pieces;  // seen from the centre of mass; first the patches
  double radius = 0;              // R
  double gape = 0, widen = 0;     // of the balls' radii and of the angles

  bool found() const { return !patches.empty(); }
  // A patch seen from an origin, which lies in the body. 2 us.
  BallPiece whole(int patch, const Vec3& origin) const;
  // Makes the halves of a piece seen from there, without halves of theirs. 3 us.
  void halve(const BallPiece& piece, const Vec3& origin, BallPiece* first, BallPiece* second) const;
};

// Pieces are halved until they lack next to nothing or are many: from there on pairs halve them. Some ms to
// 10 ms, 150 bytes a piece.
NearBall make_near_ball(const Shape& shape);

}  // namespace nurbs

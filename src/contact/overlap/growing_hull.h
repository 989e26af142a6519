// A convex hull that grows by one point at a time and knows which of its triangles is nearest to the origin:
// the structure under the polytope method (polytope.h).
#pragma once

#include <array>

#include "nurbs/tolerances.h"
#include "nurbs/types.h"
#include "nurbs/wide.h"

namespace nurbs {

// Nearest point to the origin on a triangle, as barycentric weights (Ericson 2005, section 5.1.5).
Vec3 nearest_on_triangle(const Vec3& a, const Vec3& b, const Vec3& c);

// The surface is closed at all times: triangles with outward normals, every edge between two of them. Points
// are convex combinations of what was given, so whatever round-off does to its convexity the solid it bounds
// lies in their hull, and the distance of the origin from its triangles bounds the hull's from inside. A
// failure leaves the hull as it was. Fixed-size storage, left uninitialised.
class GrowingHull {
 public:
  struct Face {
    std::array<short, 3> vertex;  // counterclockwise from outside
    std::array<short, 3> across;  // face on the other side of the edge vertex[k] -> vertex[k + 1]
    bool alive;
    bool sliver;    // lower than `sliver_height`: normal and offset mean nothing
    bool needle;    // low, but no sliver
    Vec3 normal;    // unit
    double offset;  // normal . vertex: signed distance of its plane from the origin
    Vec3 weights;   // of its point nearest to the origin, once that was asked for
  };
  enum class Growth {
    grown,
    inside,  // the point is not above any face by more than `eps`
    full,    // of vertices or faces
    broken,  // round-off: what the point sees is no disc
  };

  // `sliver_height` (length): of triangles whose normals are round-off.
  explicit GrowingHull(double sliver_height) : sliver_(sliver_height) {}

  // Keeps a point without adding it to the surface; its number, or -1 when full.
  int store(const Vec3& point);
  // Puts a stored point elsewhere: the surface has to be started again.
  void move(int k, const Vec3& point) { point_[k] = point; }
  // Starts from four stored points; false when they span no volume. Starting again drops the old surface.
  bool start(int a, int b, int c, int d);
  // Adds a stored point: the triangles that it sees make way for a fan over their horizon. `below`: a
  // triangle that it ought to see, or -1. (Needles' normals are mostly round-off: far from them they seem to
  // be seen.)
  Growth grow(int point, double eps, int below = -1);

  int points() const { return points_; }
  const Vec3& point(int k) const { return point_[k]; }
  int faces() const { return faces_; }  // numbers given so far, dead ones included
  const Face& face(int k) const { return face_[k]; }
  Vec3 nearest_point(const Face& f) const {
    return f.weights[0] * point_[f.vertex[0]] + f.weights[1] * point_[f.vertex[1]] +
           f.weights[2] * point_[f.vertex[2]];
  }

  // The triangle nearest to the origin and which side the origin is on; of several as near, the one whose
  // nearest point is least on its edges.
  struct Nearest {
    int face;  // -1: no surface
    double distance2;
    bool inside;
  };
  Nearest nearest();

  // Whether every edge joins two living triangles that agree on it (for tests).
  bool closed() const;

 private:
  struct Edge {
    short from, to;
    short outside, slot;  // the face that stays, and which of its edges this is
  };
  void set(int f, int a, int b, int c);
  void drop(int f);
  void find_foot(int f);
  bool holds_foot(Face& face) const;
  void make_sliver(Face& face);
  double least_distance2() const;
  int highest_seen_from(const Vec3& p, double* height) const;
  bool find_visible(const Vec3& p, int first, double threshold);
  bool chain_horizon();
  bool fan(int point);
  Growth add(int point, int first, double level);

  double sliver_;
  int points_ = 0, faces_ = 0;
  Vec3 point_[kHullVertices];
  Face face_[kHullFaces];
  // How far a face's nearest point is from the origin, squared; its plane's, which is no more, until that is
  // asked for (`foot_`); far away of dead ones, and up to the next multiple of kWidth.
  alignas(64) double distance2_[kHullFaces + kWidth];
  bool foot_[kHullFaces];
  int behind_ = 0;  // living faces whose plane has the origin in front of it
  // Of one growth: faces seen, their horizon in order round; numbers of dead faces to give again.
  int visible_ = 0, edges_ = 0, free_ = 0;
  short seen_[kHullFaces], free_list_[kHullFaces];
  bool marked_[kHullFaces];
  Edge edge_[kHullFaces];
  short edge_from_[kHullVertices];
};

}  // namespace nurbs

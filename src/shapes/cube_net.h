// Control points of six patches over the faces of a cube, stored once where patches share them, so that
// neighbours agree on their common edge bit for bit and the body is closed exactly.
#pragma once

#include <array>
#include <vector>

#include "nurbs/nurbs_surface.h"
#include "nurbs/types.h"

namespace nurbs {

constexpr int kCubeFaces = 6;

// A face lies at the high or low end of `axis`; u runs along axis `u`, v along axis `v`, with u x v outward.
struct CubeFace {
  int axis;
  bool high;
  int u, v;
};
// Face f: +x -x +y -y +z -z.
CubeFace cube_face(int f);

// Direction (not normalised) of the point (s, t) in [-1,1]^2 of a face of the cube of half edge 1.
Vec3 cube_direction(int f, double s, double t);

// Index table of the lattice {0..size-1}^3's surface points; every face carries size x size of them.
class CubeNet {
 public:
  explicit CubeNet(int size);
  int size() const { return size_; }
  int count() const { return count_; }                 // size^3 - (size - 2)^3
  int index(const std::array<int, 3>& lattice) const;  // of a lattice point on the surface of the cube
  int index(int f, int i, int j) const;                // of control point (i, j) of face f

 private:
  int size_, count_ = 0;
  std::vector<int> table_;
};

// The six surfaces of degree x degree over the same knots in both directions, from homogeneous points by net
// index.
std::vector<NurbsSurface> cube_surfaces(const CubeNet& net, int degree, const std::vector<double>& knots,
                                        const std::vector<Vec4>& points);

// Clamped knots on [0, 1] with `spans` equal spans.
std::vector<double> uniform_knots(int degree, int spans);

}  // namespace nurbs

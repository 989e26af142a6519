// Shared control points of six patches over a cube.
#include "shapes/cube_net.h"

namespace nurbs {

CubeFace cube_face(int f) {
  const int a = f / 2, b = (a + 1) % 3, c = (a + 2) % 3;
  return f % 2 == 0 ? CubeFace{a, true, b, c} : CubeFace{a, false, c, b};
}

Vec3 cube_direction(int f, double s, double t) {
  const CubeFace face = cube_face(f);
  Vec3 d;
  d[face.axis] = face.high ? 1 : -1;
  d[face.u] = s;
  d[face.v] = t;
  return d;
}

CubeNet::CubeNet(int size) : size_(size), table_(static_cast<size_t>(size) * size * size, -1) {
  for (int f = 0; f < kCubeFaces; ++f) {
    const CubeFace face = cube_face(f);
    for (int i = 0; i < size; ++i) {
      for (int j = 0; j < size; ++j) {
        std::array<int, 3> p{};
        p[face.axis] = face.high ? size - 1 : 0;
        p[face.u] = i;
        p[face.v] = j;
        int& entry = table_[(static_cast<size_t>(p[0]) * size + p[1]) * size + p[2]];
        if (entry < 0) entry = count_++;
      }
    }
  }
}

int CubeNet::index(const std::array<int, 3>& p) const {
  return table_[(static_cast<size_t>(p[0]) * size_ + p[1]) * size_ + p[2]];
}

int CubeNet::index(int f, int i, int j) const {
  const CubeFace face = cube_face(f);
  std::array<int, 3> p{};
  p[face.axis] = face.high ? size_ - 1 : 0;
  p[face.u] = i;
  p[face.v] = j;
  return index(p);
}

std::vector<NurbsSurface> cube_surfaces(const CubeNet& net, int degree, const std::vector<double>& knots,
                                        const std::vector<Vec4>& points) {
  std::vector<NurbsSurface> surfaces(kCubeFaces);
  for (int f = 0; f < kCubeFaces; ++f) {
    NurbsSurface& s = surfaces[f];
    s.degree_u = s.degree_v = degree;
    s.knots_u = s.knots_v = knots;
    s.size_u = s.size_v = net.size();
    for (int i = 0; i < net.size(); ++i) {
      for (int j = 0; j < net.size(); ++j) s.points.push_back(points[net.index(f, i, j)]);
    }
  }
  return surfaces;
}

std::vector<double> uniform_knots(int degree, int spans) {
  std::vector<double> knots(degree, 0.0);
  for (int k = 0; k <= spans; ++k) knots.push_back(static_cast<double>(k) / spans);
  knots.insert(knots.end(), degree, 1.0);
  return knots;
}

}  // namespace nurbs

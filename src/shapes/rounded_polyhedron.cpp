// Eroded polyhedron by polarity, its faces, edges and corners, and a patch or two for each.
#include "shapes/rounded_polyhedron.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <map>
#include <set>
#include <utility>

#include "body/shape.h"

namespace nurbs {
namespace {

constexpr double kSameSide = 0.9;    // cosine of normals: narrow triangles within a plane have poor ones
constexpr double kSamePoint = 1e-9;  // of the extent
constexpr double kBlunt = 2e-5;      // least |S_u x S_v| over the extent squared that tells a patch's plane
// Triangles looked at for the planes of large faces, by how much those are larger than the next one, and of
// how many faces such a body has at the most.
constexpr size_t kLargestTriangles = 200, kMostLargeFaces = 30;
constexpr double kMuchLarger = 2.5, kSamePlane = 1e-3;

constexpr double kSomeSize = 0.01;  // of a hull's surface: faces that an enclosing polyhedron keeps

// A face of the eroded polyhedron: unit normal and vertices, counterclockwise from outside.
struct Face {
  Vec3 normal;
  std::vector<int> loop;
};

struct Polyhedron {
  std::vector<Vec3> points;
  std::vector<Face> faces;
};

Vec3 facet_normal(const TriangleMesh& mesh, const std::array<int, 3>& t) {
  const auto& p = mesh.points;
  return (p[t[1]] - p[t[0]]).cross(p[t[2]] - p[t[0]]);
}

double extent(const std::vector<Vec3>& points) {
  Eigen::AlignedBox3d box;
  for (const Vec3& p : points) box.extend(p);
  return box.diagonal().norm();
}

// The points where the planes of the eroded half spaces meet: the facets of the polar points about `inside`.
std::vector<Vec3> eroded_corners(const std::vector<HalfSpace>& faces, const Vec3& inside, double rounding) {
  std::vector<Vec3> polar;
  for (const HalfSpace& f : faces) {
    const double room = f.offset - f.normal.dot(inside) - rounding;
    if (!(room > 0)) throw ShapeError("the rounding's radius is too large: no ball of it fits in the body");
    polar.emplace_back(f.normal / room);
  }
  const ConvexHull hull(polar);
  std::vector<Vec3> corners;
  for (const auto& t : hull.mesh().triangles) {
    const auto& q = hull.mesh().points;
    const Vec3 n = facet_normal(hull.mesh(), t);
    if (!(n.dot(q[t[0]]) > 1e-9 * n.norm() * q[t[0]].norm()))
      throw ShapeError("the faces do not close around the body");
    Mat3 planes;  // q . x = 1: solved as they are, for a narrow triangle's own plane has lost digits
    planes << q[t[0]].transpose(), q[t[1]].transpose(), q[t[2]].transpose();
    corners.emplace_back(planes.fullPivLu().solve(Vec3::Ones()));
  }
  const double same = kSamePoint * extent(corners);
  std::vector<Vec3> distinct;
  for (const Vec3& c : corners)
    if (std::none_of(distinct.begin(), distinct.end(), [&](const Vec3& d) { return (c - d).norm() < same; }))
      distinct.push_back(c);
  for (Vec3& c : distinct) c += inside;
  return distinct;
}

// Faces of a hull, triangles of one plane joined, their outline in order. Normals are those of the half
// spaces given, which are exact.
Polyhedron join_faces(const ConvexHull& hull, const std::vector<HalfSpace>& known) {
  Polyhedron out{hull.mesh().points, {}};
  std::vector<std::set<std::pair<int, int>>> outline;  // per face: edges that no other triangle of it has
  std::vector<int> of_space(known.size(), -1);
  for (const auto& t : hull.mesh().triangles) {
    const Vec3 n = facet_normal(hull.mesh(), t).normalized();
    size_t best = 0;
    for (size_t k = 1; k < known.size(); ++k)
      if (known[k].normal.dot(n) > known[best].normal.dot(n)) best = k;
    if (of_space[best] < 0) {
      of_space[best] = static_cast<int>(out.faces.size());
      out.faces.push_back({known[best].normal, {}});
      outline.emplace_back();
    }
    auto& edges = outline[of_space[best]];
    for (int k = 0; k < 3; ++k) {
      const int a = t[k], b = t[(k + 1) % 3];
      if (edges.erase({b, a}) == 0) edges.insert({a, b});
    }
  }
  for (size_t f = 0; f < out.faces.size(); ++f) {
    const std::map<int, int> next(outline[f].begin(), outline[f].end());
    const int first = next.begin()->first;
    int at = first;
    do {
      out.faces[f].loop.push_back(at);
      const auto step = next.find(at);
      if (step == next.end()) throw ShapeError("the polyhedron's faces are too small to tell apart");
      at = step->second;
    } while (at != first && out.faces[f].loop.size() <= next.size());
    if (at != first || out.faces[f].loop.size() != outline[f].size())
      throw ShapeError("the polyhedron's faces are too small to tell apart");
  }
  return out;
}

// --- patches

std::vector<double> bezier_knots(int degree) {
  std::vector<double> knots(degree + 1, 0.0);
  knots.insert(knots.end(), degree + 1, 1.0);
  return knots;
}

NurbsSurface bezier(int p, int q, std::vector<Vec4> points) {
  NurbsSurface s;
  s.degree_u = p;
  s.degree_v = q;
  s.size_u = p + 1;
  s.size_v = q + 1;
  s.knots_u = bezier_knots(p);
  s.knots_v = bezier_knots(q);
  s.points = std::move(points);
  return s;
}

Vec4 homogeneous(const Vec3& x, double w) {
  return {w * x[0], w * x[1], w * x[2], w};
}

// The corners of a convex polygon as quadrilaterals and at most one triangle (its first corner twice).
std::vector<std::array<int, 4>> quadrilaterals(int corners) {
  std::vector<std::array<int, 4>> out;
  for (int k = 1; k + 1 < corners; k += 2) {
    if (k + 2 < corners)
      out.push_back({0, k, k + 1, k + 2});
    else
      out.push_back({0, 0, k, k + 1});
  }
  return out;
}

// |S_u x S_v| where it is least, at a corner of a quadrilateral; of a triangle, whose first corner is there
// twice, twice the area.
double least_area(const std::vector<Vec3>& x, const std::array<int, 4>& q) {
  const auto at = [&](int k, int before, int behind) {
    return (x[q[behind]] - x[q[k]]).cross(x[q[before]] - x[q[k]]).norm();
  };
  if (q[0] == q[1]) return at(1, 3, 2);
  return std::min({at(0, 3, 1), at(1, 0, 2), at(2, 1, 3), at(3, 2, 0)});
}

// A convex polygon in a plane as quadrilaterals and triangles, those with next to no angle at a corner as two
// triangles: there the parameters have no directions that tell the plane.
std::vector<std::array<int, 4>> well_shaped(const std::vector<Vec3>& corners, double size) {
  std::vector<std::array<int, 4>> out;
  for (const std::array<int, 4>& q : quadrilaterals(static_cast<int>(corners.size()))) {
    const auto& [a, b, c, d] = q;
    if (a == b || least_area(corners, q) > kBlunt * size * size) {
      out.push_back(q);
      continue;
    }
    const std::array<int, 4> one[2] = {{a, a, b, c}, {a, a, c, d}}, other[2] = {{b, b, c, d}, {b, b, d, a}};
    const auto least = [&](const std::array<int, 4>(&pair)[2]) {
      return std::min(least_area(corners, pair[0]), least_area(corners, pair[1]));
    };
    const auto& best = least(one) < least(other) ? other : one;
    out.insert(out.end(), best, best + 2);
  }
  return out;
}

// Counterclockwise: u runs from the first side (corners 0, 1) to the opposite one, v along it.
NurbsSurface flat_patch(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
  return bezier(1, 1, {homogeneous(a, 1), homogeneous(b, 1), homogeneous(d, 1), homogeneous(c, 1)});
}

// Part of a cylinder about the edge from p to q, between the normals m and n.
NurbsSurface edge_patch(const Vec3& p, const Vec3& q, const Vec3& m, const Vec3& n, double radius) {
  const double cosine = m.dot(n), w = std::sqrt(0.5 * (1 + cosine));
  const Vec3 normals[3] = {m, (m + n) / (1 + cosine), n};
  std::vector<Vec4> points;
  for (const Vec3& x : {p, q})
    for (int k = 0; k < 3; ++k) points.push_back(homogeneous(x + radius * normals[k], k == 1 ? w : 1));
  return bezier(1, 2, std::move(points));
}

// Part of a unit sphere between great arcs. It is projected from the point opposite `middle` to a plane,
// where its sides are arcs of circles, rational quadratics; the Coons patch between them, in homogeneous
// coordinates, is biquadratic, and what lies above it on the sphere is biquartic.
class SpherePatch {
 public:
  SpherePatch(const std::array<Vec3, 4>& corners, const Vec3& middle) {
    up_ = middle;
    x_ = up_.unitOrthogonal();
    y_ = up_.cross(x_);
    for (int k = 0; k < 4; ++k) corner_[k] = project(corners[k]);
  }

  NurbsSurface surface(const Vec3& center, double radius) const {
    // Sides: v runs on 0 -> 1 (u = 0) and 3 -> 2 (u = 1), u on 0 -> 3 (v = 0) and 1 -> 2 (v = 1).
    const Arc low = arc(0, 1), high = arc(3, 2), left = arc(0, 3), right = arc(1, 2);
    std::array<std::array<Vec3, 3>, 3> net;
    const double share[3] = {0, 0.5, 1};
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) {
        const double u = share[i], v = share[j];
        const Vec3 corners =
            (1 - u) * ((1 - v) * low[0] + v * low[2]) + u * ((1 - v) * high[0] + v * high[2]);
        net[i][j] = (1 - u) * low[j] + u * high[j] + (1 - v) * left[i] + v * right[i] - corners;
      }
    return lift(net, center, radius);
  }

 private:
  using Complex = std::complex<double>;
  using Arc = std::array<Vec3, 3>;  // homogeneous: w x, w y, w

  Complex project(const Vec3& n) const { return Complex(n.dot(x_), n.dot(y_)) / (1 + n.dot(up_)); }

  // The great arc between two corners: (1 - t) s + t e s' of the spinors s = (z, 1), s' = (z', 1), with the
  // phase e that makes their product real; in homogeneous coordinates (a conj(b), |b|^2).
  Arc arc(int k, int l) const {
    const Complex z = corner_[k], zl = corner_[l];
    if (k == l || z == zl) return {point(z, 1), point(z, 1), point(z, 1)};
    const Complex product = std::conj(z) * zl + 1.0, phase = std::conj(product) / std::abs(product);
    const Complex a[2] = {z, phase * zl}, b[2] = {1, phase};
    const Complex mixed = 0.5 * (a[0] * std::conj(b[1]) + a[1] * std::conj(b[0]));
    const double weight = (b[0] * std::conj(b[1])).real();
    return {point(z, 1), Vec3(mixed.real(), mixed.imag(), weight), point(zl, 1)};
  }
  static Vec3 point(const Complex& z, double w) { return {w * z.real(), w * z.imag(), w}; }

  // (2 x w, 2 y w, w^2 - x^2 - y^2) over w^2 + x^2 + y^2: products of biquadratic Bernstein forms.
  NurbsSurface lift(const std::array<std::array<Vec3, 3>, 3>& net, const Vec3& center, double radius) const {
    constexpr double kBinomial2[3] = {1, 2, 1}, kBinomial4[5] = {1, 4, 6, 4, 1};
    std::array<std::array<Vec4, 5>, 5> sum;
    for (auto& row : sum) row.fill(Vec4::Zero());
    for (int i = 0; i < 9; ++i)
      for (int j = 0; j < 9; ++j) {
        const Vec3 &p = net[i / 3][i % 3], &q = net[j / 3][j % 3];
        const double factor = kBinomial2[i / 3] * kBinomial2[i % 3] * kBinomial2[j / 3] * kBinomial2[j % 3];
        const double flat = p[0] * q[0] + p[1] * q[1], w = p[2] * q[2];
        sum[i / 3 + j / 3][i % 3 + j % 3] +=
            factor * Vec4(p[0] * q[2] + p[2] * q[0], p[1] * q[2] + p[2] * q[1], w - flat, w + flat);
      }
    std::vector<Vec4> points;
    for (int i = 0; i < 5; ++i)
      for (int j = 0; j < 5; ++j) {
        const Vec4 h = sum[i][j] / (kBinomial4[i] * kBinomial4[j]);
        Vec4 x;
        x.head<3>() = radius * (h[0] * x_ + h[1] * y_ + h[2] * up_) + h[3] * center;
        x[3] = h[3];
        points.push_back(x);
      }
    return bezier(4, 4, std::move(points));
  }

  Vec3 up_, x_, y_;
  Complex corner_[4];
};

// Makes edges that patches share the same bits: corners are computed once, per vertex and face.
class Rounder {
 public:
  Rounder(const Polyhedron& solid, double rounding)
      : solid_(solid), rounding_(rounding), size_(extent(solid.points)) {}

  std::vector<NurbsSurface> run() {
    for (size_t f = 0; f < solid_.faces.size(); ++f) add_face(static_cast<int>(f));
    for (size_t v = 0; v < solid_.points.size(); ++v) around_.push_back(around(static_cast<int>(v)));
    halved_ = std::any_of(around_.begin(), around_.end(), [](const auto& a) { return a.size() % 2 == 1; });
    for (const auto& [edge, face] : of_edge_) add_edge(edge, face);
    for (size_t v = 0; v < solid_.points.size(); ++v) add_corner(static_cast<int>(v));
    return std::move(out_);
  }

 private:
  Vec3 corner(int vertex, int face) const {
    return solid_.points[vertex] + rounding_ * solid_.faces[face].normal;
  }

  void add_face(int f) {
    const std::vector<int>& loop = solid_.faces[f].loop;
    const int n = static_cast<int>(loop.size());
    for (int k = 0; k < n; ++k) of_edge_[{loop[k], loop[(k + 1) % n]}] = f;
    std::vector<Vec3> corners;
    corners.reserve(loop.size());
    for (const int v : loop) corners.push_back(corner(v, f));
    for (const auto& [a, b, c, d] : well_shaped(corners, size_))
      out_.push_back(flat_patch(corners[a], corners[b], corners[c], corners[d]));
  }

  void add_edge(const std::pair<int, int>& edge, int face) {
    if (edge.first > edge.second) return;
    const auto other = of_edge_.find({edge.second, edge.first});
    if (other == of_edge_.end()) throw ShapeError("the polyhedron's faces are too small to tell apart");
    const Vec3 &p = solid_.points[edge.first], &q = solid_.points[edge.second];
    const Vec3 &m = solid_.faces[other->second].normal, &n = solid_.faces[face].normal;
    if (!halved_) return out_.push_back(edge_patch(p, q, m, n, rounding_));
    const Vec3 middle = (m + n).normalized();
    out_.push_back(edge_patch(p, q, m, middle, rounding_));
    out_.push_back(edge_patch(p, q, middle, n, rounding_));
  }

  // The faces around a vertex, counterclockwise from outside.
  std::vector<int> around(int vertex) const {
    std::map<int, int> next;  // by face: the one behind the edge that leaves the vertex last
    for (size_t f = 0; f < solid_.faces.size(); ++f) {
      const std::vector<int>& loop = solid_.faces[f].loop;
      const auto at = std::find(loop.begin(), loop.end(), vertex);
      if (at == loop.end()) continue;
      const int before = at == loop.begin() ? loop.back() : *(at - 1);
      const auto other = of_edge_.find({vertex, before});
      if (other != of_edge_.end()) next[static_cast<int>(f)] = other->second;
    }
    std::vector<int> faces;
    if (next.empty()) return faces;
    int f = next.begin()->first;
    do {
      faces.push_back(f);
      f = next.at(f);
    } while (f != faces[0] && faces.size() < next.size());
    return faces;
  }

  void add_corner(int vertex) {
    std::vector<Vec3> normals;
    Vec3 middle = Vec3::Zero();
    for (const int f : around_[vertex]) {
      normals.push_back(solid_.faces[f].normal);
      middle += normals.back();
    }
    middle.normalize();
    const int n = static_cast<int>(normals.size());
    const auto add = [&](const std::array<Vec3, 4>& corners) {
      out_.push_back(SpherePatch(corners, middle).surface(solid_.points[vertex], rounding_));
    };
    if (!halved_)
      for (const auto& [a, b, c, d] : quadrilaterals(n))
        add({normals[a], normals[b], normals[c], normals[d]});
    else
      for (int k = 0; k < n; ++k) {
        const Vec3 &here = normals[k], &before = normals[(k + n - 1) % n], &behind = normals[(k + 1) % n];
        add({middle, (before + here).normalized(), here, (here + behind).normalized()});
      }
  }

  const Polyhedron& solid_;
  const double rounding_, size_;
  std::map<std::pair<int, int>, int> of_edge_;  // the face to the left of a directed edge
  std::vector<std::vector<int>> around_;        // faces of each vertex
  bool halved_ = false;  // all arcs at corners, so that a corner of any number of faces is of quadrilaterals
  std::vector<NurbsSurface> out_;
};

// Normals of a hull's faces of more than this share of its surface: triangles of one plane count together.
std::vector<Vec3> faces_of_size(const ConvexHull& hull, double share) {
  std::vector<Vec3> normals;  // as long as twice the areas
  double whole = 0;
  for (const auto& t : hull.mesh().triangles) {
    normals.push_back(facet_normal(hull.mesh(), t));
    whole += normals.back().norm();
  }
  std::stable_sort(normals.begin(), normals.end(),
                   [](const Vec3& a, const Vec3& b) { return a.squaredNorm() > b.squaredNorm(); });
  std::vector<std::pair<Vec3, double>> faces;
  for (size_t k = 0; k < normals.size(); ++k) {
    const double area = normals[k].norm();
    if (!(area > 0)) break;
    const Vec3 n = normals[k] / area;
    const auto of = std::find_if(faces.begin(), faces.end(), [&](const auto& f) {
      return f.first.dot(n) > kSameSide && f.first.cross(n).norm() < kSamePlane;
    });
    if (of != faces.end())
      of->second += area;
    else if (k < kLargestTriangles)
      faces.emplace_back(n, area);
  }
  std::vector<Vec3> out;
  for (const auto& [n, area] : faces)
    if (area > share * whole) out.push_back(n);
  return out;
}

}  // namespace

std::vector<HalfSpace> facets(const ConvexHull& hull, size_t most, double roundoff) {
  const std::vector<Vec3>& points = hull.mesh().points;
  const double size = extent(points);
  struct Facet {
    Vec3 normal;  // as long as twice the area
    std::array<int, 3> corners;
  };
  std::vector<Facet> facets;
  for (const auto& t : hull.mesh().triangles) facets.push_back({facet_normal(hull.mesh(), t), t});
  // The largest first: their normals are what rounded coordinates leave of a face's.
  std::stable_sort(facets.begin(), facets.end(), [](const Facet& a, const Facet& b) {
    return a.normal.squaredNorm() > b.normal.squaredNorm();
  });
  std::vector<HalfSpace> out;
  for (const Facet& f : facets) {
    const Vec3 n = f.normal.normalized();
    if (!n.allFinite()) continue;
    double h = -1e300;
    for (const int k : f.corners) h = std::max(h, n.dot(points[k]));
    const auto same = [&](const HalfSpace& s) {
      return s.normal.dot(n) > kSameSide && std::all_of(f.corners.begin(), f.corners.end(), [&](int k) {
               return std::abs(s.offset - s.normal.dot(points[k])) < roundoff * size;
             });
    };
    if (std::any_of(out.begin(), out.end(), same)) continue;
    if (out.size() == most) return {};
    out.push_back({n, h});
  }
  for (HalfSpace& s : out)
    for (const Vec3& p : hull.mesh().points) s.offset = std::max(s.offset, s.normal.dot(p));
  return out;
}

std::vector<std::vector<HalfSpace>> large_faces(const ConvexHull& hull) {
  const std::vector<Vec3>& points = hull.mesh().points;
  const double near = kSingleRoundoff * extent(points);
  struct Triangle {
    Vec3 normal;  // as long as twice the area
    Vec3 corner;
  };
  std::vector<Triangle> all;
  for (const auto& t : hull.mesh().triangles) all.push_back({facet_normal(hull.mesh(), t), points[t[0]]});
  const auto larger = [](const Triangle& a, const Triangle& b) {
    return a.normal.squaredNorm() > b.normal.squaredNorm();
  };
  std::stable_sort(all.begin(), all.end(), larger);
  struct Plane {
    HalfSpace space;
    double area;
  };
  std::vector<Plane> planes;
  for (size_t k = 0; k < all.size(); ++k) {
    const double area = all[k].normal.norm();
    const Vec3 n = all[k].normal / area;
    if (!n.allFinite()) continue;
    const auto same = [&](const Plane& p) {
      return p.space.normal.dot(n) > kSameSide &&
             std::abs(p.space.normal.dot(all[k].corner) - p.space.offset) < near &&
             p.space.normal.cross(n).norm() < kSamePlane;
    };
    const auto of = std::find_if(planes.begin(), planes.end(), same);
    if (of != planes.end())
      of->area += area;
    else if (k < kLargestTriangles)
      planes.push_back({{n, n.dot(all[k].corner)}, area});
  }
  std::stable_sort(planes.begin(), planes.end(),
                   [](const Plane& a, const Plane& b) { return a.area > b.area; });
  std::vector<std::vector<HalfSpace>> out;
  for (size_t k = 4; k < planes.size() && k <= kMostLargeFaces; ++k) {
    if (planes[k - 1].area < kMuchLarger * planes[k].area) continue;
    out.emplace_back();
    for (size_t i = 0; i < k; ++i) out.back().push_back(planes[i].space);
  }
  return out;
}

// Sandwich approximation: the corner furthest from the hull is cut off by the plane that is normal to the way
// there, which touches the hull; in the end planes go without which no corner is too far.
std::vector<HalfSpace> enclosing_faces(const ConvexHull& hull, const Vec3& inside, double excess,
                                       double inward, size_t most) {
  int vertex = 0;
  const auto touching = [&](const Vec3& n) {
    vertex = hull.support(n, vertex);
    return HalfSpace{n, n.dot(hull.mesh().points[vertex])};
  };
  std::vector<HalfSpace> out;
  for (const Vec3& n : faces_of_size(hull, kSomeSize)) out.push_back(touching(n));
  const size_t kept = out.size();
  const Vec3 extent = bounding_box(hull.mesh().points).sizes();
  for (int k = 0; k < 6; ++k) {  // they bound it, however flat
    const Vec3 across = Vec3::Unit(k / 2).cwiseQuotient(extent);
    out.push_back(touching((k & 1 ? -1.0 : 1.0) * across.normalized()));
  }
  std::map<std::array<double, 3>, Vec3> ways;  // from corners that were looked at
  const auto furthest = [&](const std::vector<HalfSpace>& faces) {
    Vec3 best = Vec3::Zero();
    for (const Vec3& c : eroded_corners(faces, inside, 0)) {
      const auto [at, fresh] = ways.try_emplace({c[0], c[1], c[2]});
      if (fresh) at->second = hull.way(c, 0, vertex);
      if (at->second.squaredNorm() > best.squaredNorm()) best = at->second;
    }
    return best;
  };
  for (;;) {
    const Vec3 way = furthest(out);
    if (way.norm() <= excess) break;
    if (out.size() >= most + 6) return {};
    out.push_back(touching(-way.normalized()));
  }
  for (size_t k = out.size(); k-- > kept;) {
    std::vector<HalfSpace> fewer = out;
    fewer.erase(fewer.begin() + static_cast<std::ptrdiff_t>(k));
    try {
      if (furthest(fewer).norm() <= excess) out = std::move(fewer);
    } catch (const ShapeError&) {  // the rest is unbounded
    }
  }
  for (size_t k = kept; k < out.size(); ++k) out[k].offset -= inward;
  return out.size() <= most ? out : std::vector<HalfSpace>();
}

std::vector<HalfSpace> platonic_solid(const std::string& name, double radius) {
  const double golden = 0.5 * (1 + std::sqrt(5.0));
  std::vector<Vec3> points;
  const auto cyclic = [&points](double a, double b) {  // (0, +-a, +-b) and its cyclic permutations
    for (int axis = 0; axis < 3; ++axis)
      for (int signs = 0; signs < 4; ++signs) {
        Vec3 p = Vec3::Zero();
        p[(axis + 1) % 3] = signs & 1 ? -a : a;
        p[(axis + 2) % 3] = signs & 2 ? -b : b;
        points.push_back(p);
      }
  };
  const auto cube = [&points](bool odd) {
    for (int k = 0; k < 8; ++k)
      if (odd || (k & 1) == ((k >> 1 & 1) ^ (k >> 2)))
        points.emplace_back(k & 1 ? 1 : -1, k & 2 ? 1 : -1, k & 4 ? 1 : -1);
  };
  if (name == "tetrahedron") {
    cube(false);
  } else if (name == "cube") {
    cube(true);
  } else if (name == "octahedron") {
    for (int k = 0; k < 6; ++k) points.emplace_back((k & 1 ? -1 : 1) * Vec3::Unit(k / 2));
  } else if (name == "dodecahedron") {
    cube(true);
    cyclic(1 / golden, golden);
  } else if (name == "icosahedron") {
    cyclic(1, golden);
  } else {
    return {};
  }
  for (Vec3& p : points) p *= radius / p.norm();
  return facets(ConvexHull(points), 20);
}

std::vector<NurbsSurface> rounded_polyhedron(const std::vector<HalfSpace>& faces, const Vec3& inside,
                                             double rounding) {
  const ConvexHull hull(eroded_corners(faces, inside, rounding));
  return Rounder(join_faces(hull, faces), rounding).run();
}

}  // namespace nurbs

// Profiles revolved about z, and triangulated hulls; see solids.h.
#include "support/solids.h"

#include <algorithm>
#include <cmath>

#include "shapes/primitives.h"
#include "shapes/revolved.h"

namespace nurbs::test {
namespace {

// One point of a profile: radius, height, weight.
using Profile = std::vector<Vec3>;

// Full turn of a profile of Bezier pieces of `degree` about z, bottom to top.
NurbsSurface revolve(const Profile& profile, int degree) {
  const int pieces = (static_cast<int>(profile.size()) - 1) / degree;
  std::vector<double> knots{0};
  for (int k = 0; k <= pieces; ++k) knots.insert(knots.end(), degree, double(k) / pieces);
  knots.push_back(1);
  return surface_of_revolution(degree, knots, profile);
}

// Any weights leave straight lines where they are.
Profile polyline(Random& random, const std::vector<Vec2>& points, double weights) {
  Profile profile;
  for (const Vec2& p : points)
    profile.push_back({p[0], p[1], weights > 1 ? random.log_uniform(1 / weights, weights) : 1.0});
  return profile;
}

// Of the convex hull of circles and points on the axis.
std::function<Vec3(const Vec3&)> support_of_circles(std::vector<Vec2> circles) {
  return [circles](const Vec3& d) -> Vec3 {
    const double across = std::hypot(d[0], d[1]);
    Vec3 best = Vec3::Zero();
    double most = -1e300;
    for (const Vec2& c : circles) {
      const double h = c[0] * across + c[1] * d[2];
      if (!(h > most)) continue;
      most = h;
      best = across > 0 ? Vec3(c[0] * d[0] / across, c[0] * d[1] / across, c[1]) : Vec3(c[0], 0, c[1]);
    }
    return best;
  };
}

Solid revolved_polyline(Random& random, const std::string& name, const std::vector<Vec2>& points,
                        double weights) {
  return turned_solid(random, name, {revolve(polyline(random, points, weights), 1)},
                      support_of_circles(points), poles());
}

double sign_of(double x) {
  return x < 0 ? -1 : 1;
}

}  // namespace

Vec3 support_of(const Solid& solid, const Particle& p, const Vec3& d) {
  return p.scale * (p.q * solid.support(p.q.conjugate() * d));
}

Vec3 ellipsoid_support(const Vec3& d, const Vec3& semi_axes) {
  const Vec3 y = semi_axes.cwiseProduct(d);
  return semi_axes.cwiseProduct(y) / y.norm();
}

Vec3 box_support(const Vec3& d, const Vec3& half, double ball) {
  Vec3 x = ball * d.normalized();
  for (int k = 0; k < 3; ++k) x[k] += sign_of(d[k]) * half[k];
  return x;
}

Vec3 disc_support(const Vec3& d, double r, double h, double ball) {
  const double across = std::hypot(d[0], d[1]);
  Vec3 x(0, 0, sign_of(d[2]) * h);
  if (across > 0) x.head<2>() = r / across * d.head<2>();
  return x + ball * d.normalized();
}

std::vector<Vec3> axes_normals() {
  std::vector<Vec3> normals;
  for (int axis = 0; axis < 3; ++axis)
    for (const double side : {1.0, -1.0}) normals.push_back(side * Vec3::Unit(axis));
  return normals;
}

std::vector<Vec3> poles() {
  return {Vec3::UnitZ(), -Vec3::UnitZ()};
}

std::vector<NurbsSurface> with_decimals(std::vector<NurbsSurface> surfaces, int decimals) {
  const double unit = std::pow(10.0, -decimals);
  for (NurbsSurface& s : surfaces)
    for (Vec4& p : s.points) {
      const double w = std::max(1.0, std::round(p[3] / unit)) * unit;
      for (int k = 0; k < 3; ++k) p[k] = w * std::round(p[k] / p[3] / unit) * unit;
      p[3] = w;
    }
  return surfaces;
}

Solid turned_solid(Random& random, const std::string& name, std::vector<NurbsSurface> surfaces,
                   std::function<Vec3(const Vec3&)> support, std::vector<Vec3> normals) {
  const Mat3 turn = random.turn().toRotationMatrix();
  for (NurbsSurface& s : surfaces)
    for (Vec4& p : s.points) p.head<3>() = (turn * p.head<3>()).eval();
  Solid solid;
  solid.shape = make_shape(name, std::move(surfaces));
  const Vec3 center = solid.shape->mass.center;
  solid.support = [=](const Vec3& d) -> Vec3 { return turn * support(turn.transpose() * d) - center; };
  for (const Vec3& n : normals) solid.normals.push_back(turn * n);
  return solid;
}

Solid cone(Random& random, double radius, double height, double weights) {
  return revolved_polyline(random, "cone", {{0, 0}, {radius, 0}, {0, height}}, weights);
}

Solid double_cone(Random& random, double radius, double below, double above, double weights) {
  return revolved_polyline(random, "double cone", {{0, -below}, {radius, 0}, {0, above}}, weights);
}

Solid cylinder(Random& random, double radius, double half, double weights) {
  return revolved_polyline(random, "cylinder", {{0, -half}, {radius, -half}, {radius, half}, {0, half}},
                           weights);
}

Solid frustum(Random& random, double low, double high, double height, double weights) {
  return revolved_polyline(random, "frustum", {{0, 0}, {low, 0}, {high, height}, {0, height}}, weights);
}

Solid capsule(Random& random, double r, double half) {
  const double w = std::sqrt(0.5);
  const Profile profile = {{0, -half - r, 1}, {r, -half - r, w}, {r, -half, 1},   {r, 0, 1},
                           {r, half, 1},      {r, half + r, w},  {0, half + r, 1}};
  const auto support = [=](const Vec3& d) -> Vec3 {
    return r * d.normalized() + (d[2] > 0 ? half : -half) * Vec3::UnitZ();
  };
  return turned_solid(random, "capsule", {revolve(profile, 2)}, support, {});
}

namespace {

// `low`: centre of a cap's sphere below the crease.
Solid lens_of(Random& random, double low) {
  const double bend = std::hypot(1, low);
  const double half = 0.5 * std::atan2(1, low);  // half of the cap's angle from its pole to the crease
  const double top = bend - low, reach = bend * std::tan(half), w = std::cos(half);
  const Profile profile = {{0, -top, 1}, {reach, -top, w}, {1, 0, 1}, {reach, top, w}, {0, top, 1}};
  const auto support = [=](const Vec3& d) -> Vec3 {
    const Vec3 n = d.normalized();
    const double across = std::hypot(n[0], n[1]);
    if (bend * std::abs(n[2]) > low) return bend * n - (n[2] > 0 ? low : -low) * Vec3::UnitZ();
    return Vec3(n[0] / across, n[1] / across, 0);
  };
  return turned_solid(random, "lens", {revolve(profile, 2)}, support, poles());
}

}  // namespace

Solid lens(Random& random, double bend) {
  return lens_of(random, std::sqrt(bend * bend - 1));
}
Solid slight_lens(Random& random, double kink) {
  return lens_of(random, std::tan(0.5 * kink));
}

Solid spherical_segment(Random& random, double low, double high) {
  const double from = std::asin(low), to = std::asin(high), half = 0.25 * (to - from);
  const auto at = [&](double angle, double radius, double weight) {
    return Vec3(std::max(0.0, radius * std::cos(angle)), radius * std::sin(angle), weight);
  };
  const double reach = 1 / std::cos(half), w = std::cos(half);
  std::vector<NurbsSurface> surfaces;
  if (low > -1) surfaces.push_back(revolve({{0, low, 1}, at(from, 1, 1)}, 1));
  surfaces.push_back(revolve({at(from, 1, 1), at(from + half, reach, w), at(from + 2 * half, 1, 1),
                              at(to - half, reach, w), at(to, 1, 1)},
                             2));
  if (high < 1) surfaces.push_back(revolve({at(to, 1, 1), {0, high, 1}}, 1));
  const auto support = [=](const Vec3& d) -> Vec3 {
    const Vec3 n = d.normalized();
    const double z = std::clamp(n[2], low, high), across = std::hypot(n[0], n[1]);
    const double r = std::sqrt(1 - z * z);
    return across > 0 ? Vec3(r * n[0] / across, r * n[1] / across, z) : Vec3(r, 0, z);
  };
  return turned_solid(random, "spherical segment", surfaces, support, poles());
}

Solid conic_of_revolution(Random& random, double below, double above, double weight) {
  const Profile profile = {{0, -below, 1}, {1, -below, weight}, {1, 0, 1}, {1, above, weight}, {0, above, 1}};
  const auto support = [=](const Vec3& d) -> Vec3 {
    const double a = std::hypot(d[0], d[1]), height = d[2] > 0 ? above : -below, b = std::abs(height * d[2]);
    // The conic from (0, 1) to (1, 0) is (2 w q + q^2, 1 + 2 w q) / (1 + 2 w q + q^2), its corner (1, 1);
    // along (a, b) it is highest where b w q^2 - (a - b) q - a w = 0.
    const double w = weight, c = a - b;
    double q;
    const double root = std::sqrt(c * c + 4 * a * b * w * w);
    if (c > 0)
      q = b > 0 ? (c + root) / (2 * b * w) : 1e300;
    else
      q = root - c > 0 ? 2 * a * w / (root - c) : 0;
    double r, z;
    if (q <= 1) {
      const double whole = 1 + 2 * w * q + q * q;
      r = (2 * w * q + q * q) / whole;
      z = (1 + 2 * w * q) / whole;
    } else {
      const double k = 1 / q, whole = 1 + 2 * w * k + k * k;
      r = (2 * w * k + 1) / whole;
      z = (k * k + 2 * w * k) / whole;
    }
    return a > 0 ? Vec3(r * d[0] / a, r * d[1] / a, height * z) : Vec3(0, 0, height);
  };
  return turned_solid(random, "conic", {revolve(profile, 2)}, support, poles());
}

namespace {

constexpr int kSides = 3;

// The Reuleaux triangle of width 1 about the origin: corners, counterclockwise, the first one up.
Vec2 reuleaux_corner(int k) {
  const double angle = M_PI * (0.5 + 2.0 / 3 * k);
  return Vec2(std::cos(angle), std::sin(angle)) / std::sqrt(3.0);
}
Vec2 reuleaux_support(const Vec2& d) {
  const Vec2 n = d.normalized();
  for (int k = 0; k < kSides; ++k) {  // the arc about a corner faces away from it
    const Vec2 away = -reuleaux_corner(k).normalized();
    if (n.dot(away) >= std::cos(M_PI / 6)) return reuleaux_corner(k) + n;
  }
  int best = 0;
  for (int k = 1; k < kSides; ++k)
    if (n.dot(reuleaux_corner(k)) > n.dot(reuleaux_corner(best))) best = k;
  return reuleaux_corner(best);
}
// Where the end tangents of the arc of 60 degrees about a corner meet.
Vec2 reuleaux_tangents(int k) {
  return reuleaux_corner(k) - reuleaux_corner(k).normalized() / std::cos(M_PI / 6);
}

// A rational quadratic arc, a line of points, from one end to the other: v fastest.
NurbsSurface ruled(const Vec3 (&low)[3], const Vec3 (&high)[3], double weight) {
  std::vector<Vec4> net;
  for (int k = 0; k < 3; ++k) {
    const double w = k == 1 ? weight : 1;
    for (const Vec3* x : {&low[k], &high[k]}) net.emplace_back(w * (*x)[0], w * (*x)[1], w * (*x)[2], w);
  }
  return bezier_surface(2, 1, std::move(net));
}

}  // namespace

Solid turned_reuleaux(Random& random) {
  const double w = std::cos(M_PI / 12), wide = std::cos(M_PI / 6);
  const Vec2 top = reuleaux_corner(0), right = reuleaux_corner(2);
  // From the lowest point, below the top, half an arc to the right; then the arc about the left corner.
  const double half = M_PI / 12;
  const Vec2 bottom(0, top[1] - 1), turn(std::tan(half), top[1] - 1), corner = reuleaux_tangents(1);
  std::vector<NurbsSurface> surfaces = {
      revolve({{bottom[0], bottom[1], 1}, {turn[0], turn[1], w}, {right[0], right[1], 1}}, 2),
      revolve({{right[0], right[1], 1}, {corner[0], corner[1], wide}, {0, top[1], 1}}, 2)};
  const auto support = [](const Vec3& d) -> Vec3 {
    const double across = std::hypot(d[0], d[1]);
    const Vec2 x = reuleaux_support(Vec2(across, d[2]));
    return across > 0 ? Vec3(x[0] * d[0] / across, x[0] * d[1] / across, x[1]) : Vec3(0, 0, x[1]);
  };
  return turned_solid(random, "turned Reuleaux", surfaces, support, poles());
}

Solid reuleaux_prism(Random& random, double half) {
  std::vector<NurbsSurface> surfaces;
  std::vector<Vec3> normals = poles();
  const double w = std::cos(M_PI / 6);
  for (int k = 0; k < kSides; ++k) {
    const Vec2 arc[3] = {reuleaux_corner((k + 1) % 3), reuleaux_tangents(k), reuleaux_corner((k + 2) % 3)};
    Vec3 low[3], high[3];
    const Vec3 bottom[3] = {{0, 0, -half}, {0, 0, -half}, {0, 0, -half}},
               top[3] = {{0, 0, half}, {0, 0, half}, {0, 0, half}};
    for (int i = 0; i < 3; ++i) {
      low[i] = {arc[i][0], arc[i][1], -half};
      high[i] = {arc[i][0], arc[i][1], half};
    }
    surfaces.push_back(ruled(low, high, w));
    surfaces.push_back(ruled(high, top, w));
    surfaces.push_back(ruled(bottom, low, w));
    const Vec2 n = -reuleaux_corner(k).normalized();
    normals.emplace_back(n[0], n[1], 0);
    normals.emplace_back(-n[0], -n[1], 0);
  }
  const auto support = [half](const Vec3& d) -> Vec3 {
    const double z = d[2] < 0 ? -half : half;
    if (!(std::hypot(d[0], d[1]) > 0)) return Vec3(0, 0, z);
    const Vec2 x = reuleaux_support(d.head<2>());
    return Vec3(x[0], x[1], z);
  };
  return turned_solid(random, "Reuleaux prism", surfaces, support, normals);
}

Solid sphericon(Random& random) {
  // A half circle in z = 0, y <= 0, and the tips of its half of the double cone; the other half is its image.
  Mat3 other;
  other << 0, 0, 1, 0, -1, 0, 1, 0, 0;
  const Vec3 arcs[2][3] = {{{-1, 0, 0}, {-1, -1, 0}, {0, -1, 0}}, {{0, -1, 0}, {1, -1, 0}, {1, 0, 0}}};
  std::vector<NurbsSurface> surfaces;
  for (const Mat3& m : {Mat3(Mat3::Identity()), other})
    for (const auto& arc : arcs) {
      Vec3 rim[3], up[3], down[3];
      for (int k = 0; k < 3; ++k) {
        rim[k] = m * arc[k];
        up[k] = m * Vec3::UnitZ();
        down[k] = m * -Vec3::UnitZ();
      }
      surfaces.push_back(ruled(rim, up, std::sqrt(0.5)));
      surfaces.push_back(ruled(down, rim, std::sqrt(0.5)));
    }
  const auto half_circle = [](const Vec3& d) -> Vec3 {
    const double across = std::hypot(d[0], d[1]);
    if (d[1] < 0 && across > 0) return Vec3(d[0] / across, d[1] / across, 0);
    return Vec3(sign_of(d[0]), 0, 0);
  };
  const auto support = [=](const Vec3& d) -> Vec3 {
    const Vec3 x = half_circle(d), y = other * half_circle(other.transpose() * d);
    return d.dot(x) >= d.dot(y) ? x : y;
  };
  std::vector<Vec3> normals;
  for (const double x : {1.0, -1.0})
    for (const double z : {1.0, -1.0}) normals.push_back(Vec3(x, 0, z).normalized());
  return turned_solid(random, "sphericon", surfaces, support, normals);
}

Solid stretched(Random& random, const Solid& solid, double least) {
  const Mat3 turn = random.turn().toRotationMatrix();
  Vec3 axes(1, 1, 1);
  for (int k = 1; k < 3; ++k) axes[k] = random.log_uniform(least, 1);
  const Mat3 map = axes.asDiagonal() * turn;
  std::vector<NurbsSurface> surfaces = solid.shape->surfaces;
  for (NurbsSurface& s : surfaces)
    for (Vec4& p : s.points) p.head<3>() = (map * p.head<3>()).eval();
  const Vec3 center = solid.shape->mass.center;
  const auto support = [map, center, of = solid.support](const Vec3& d) -> Vec3 {
    return map * (of(map.transpose() * d) + center);
  };
  std::vector<Vec3> normals;
  const Mat3 inverse = map.inverse().transpose();
  for (const Vec3& n : solid.normals) normals.push_back((inverse * n).normalized());
  return turned_solid(random, "stretched " + solid.shape->name, std::move(surfaces), support, normals);
}

Solid polyhedron(Random& random, int points, double squeeze, double weights) {
  std::vector<Vec3> corners;
  for (int k = 0; k < points; ++k)
    corners.push_back(random.uniform(0.7, 1) * random.direction().cwiseProduct(Vec3(1, 1, squeeze)));
  std::vector<NurbsSurface> faces;
  std::vector<Vec3> normals;
  const auto weight = [&] { return weights > 1 ? random.log_uniform(1 / weights, weights) : 1.0; };
  for (int i = 0; i < points; ++i)
    for (int j = 0; j < points; ++j)
      for (int k = 0; k < points; ++k) {
        if (i >= j || i >= k || j == k) continue;  // each face once, i its least corner
        const Vec3 n = (corners[j] - corners[i]).cross(corners[k] - corners[i]);
        if (std::any_of(corners.begin(), corners.end(),
                        [&](const Vec3& x) { return n.dot(x - corners[i]) > 1e-14; }))
          continue;
        NurbsSurface s;
        s.degree_u = s.degree_v = 1;
        s.size_u = s.size_v = 2;
        s.knots_u = s.knots_v = {0, 0, 1, 1};
        const Vec3 at[4] = {corners[i], corners[k], corners[j], corners[k]};  // the edge v = 1 is corner k
        for (const Vec3& x : at) {
          const double w = weight();
          s.points.emplace_back(w * x[0], w * x[1], w * x[2], w);
        }
        faces.push_back(s);
        normals.push_back(n.normalized());
      }
  const auto support = [corners](const Vec3& d) -> Vec3 {
    return *std::max_element(corners.begin(), corners.end(),
                             [&](const Vec3& x, const Vec3& y) { return d.dot(x) < d.dot(y); });
  };
  return turned_solid(random, "polyhedron", std::move(faces), support, normals);
}

Solid ellipsoid_solid(const Vec3& axes) {
  Solid solid;
  solid.shape = make_shape("ellipsoid", exact_ellipsoid(axes));
  solid.support = [axes](const Vec3& d) { return ellipsoid_support(d, axes); };
  return solid;
}

}  // namespace nurbs::test

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

Solid lens(Random& random, double bend) {
  const double low = std::sqrt(bend * bend - 1);  // centre of a cap's sphere below the crease
  const double half = 0.5 * std::asin(1 / bend);  // half of the cap's angle from its pole to the crease
  const double top = bend - low, reach = bend * std::tan(half), w = std::cos(half);
  const Profile profile = {{0, -top, 1}, {reach, -top, w}, {1, 0, 1}, {reach, top, w}, {0, top, 1}};
  const auto support = [=](const Vec3& d) -> Vec3 {
    const Vec3 n = d.normalized();
    const double across = std::hypot(n[0], n[1]);
    if (bend * across < 1) return bend * n - (n[2] > 0 ? low : -low) * Vec3::UnitZ();
    return Vec3(n[0] / across, n[1] / across, 0);
  };
  return turned_solid(random, "lens", {revolve(profile, 2)}, support, poles());
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

// Support functions of random rounded polyhedra, interpolated by directions.
#include "shapes/random_pebble.h"

#include <algorithm>
#include <cmath>

#include "body/local_form.h"
#include "nurbs/affine.h"
#include "shapes/convex_fit.h"
#include "shapes/smooth_cube.h"

namespace nurbs {
namespace {

constexpr int kCorners = 14;
constexpr double kPower = 9;           // q: of the rounded polyhedron
constexpr double kRaise = 0.1;         // of the roundness, until the patches are convex
constexpr double kRoundEnough = 0.05;  // wanted, of a body of radius 1
constexpr int kCheckGrid = 16;

// SplitMix64 (Steele, Lea & Flood 2014): standard distributions differ between libraries.
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed * 0x9e3779b97f4a7c15ull + 0x632be59bd9b4e019ull) {}
  double uniform() {
    std::uint64_t z = state_ += 0x9e3779b97f4a7c15ull;
    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9ull;
    z = (z ^ z >> 27) * 0x94d049bb133111ebull;
    return static_cast<double>((z ^ z >> 31) >> 11) * 0x1p-53;
  }

 private:
  std::uint64_t state_;
};

// Directions of a Fibonacci lattice, shaken, of random length.
std::vector<Vec3> random_corners(std::uint64_t seed) {
  Random random(seed);
  std::vector<Vec3> corners;
  const double turn = 2 * M_PI * random.uniform();
  for (int k = 0; k < kCorners; ++k) {
    const double z = 1 - 2 * (k + 0.1 + 0.8 * random.uniform()) / kCorners;
    const double angle = turn + 2.399963229728653 * k + 1.2 * (random.uniform() - 0.5),
                 s = std::sqrt(1 - z * z);
    corners.push_back((0.75 + 0.35 * random.uniform()) * Vec3(s * std::cos(angle), s * std::sin(angle), z));
  }
  return corners;
}

// Gradient of the support function: the point with unit normal n.
Vec3 pebble_point(const std::vector<Vec3>& corners, double roundness, const Vec3& n) {
  double sum = 0;
  Vec3 slope = Vec3::Zero();
  for (const Vec3& v : corners) {
    const double along = v.dot(n);
    if (along <= 0) continue;
    const double power = std::pow(along, kPower - 1);
    sum += power * along;
    slope += power * v;
  }
  return roundness * n + (1 - roundness) * std::pow(sum, 1 / kPower - 1) * slope;
}

double least_curvature(const std::vector<NurbsSurface>& surfaces) {
  double least = 1e300;
  for (const NurbsSurface& s : surfaces)
    for (const BezierPiece& piece : split_to_bezier(s))
      for (int i = 0; i <= kCheckGrid; ++i)
        for (int j = 0; j <= kCheckGrid; ++j)
          least = std::min(least, local_form(piece.patch, static_cast<double>(i) / kCheckGrid,
                                             static_cast<double>(j) / kCheckGrid)
                                      .k_min);
  return least;
}

// Semi-axes 1, elongation, elongation * flatness of the ellipsoid of the same moments, then the volume.
void give_form(std::vector<NurbsSurface>& body, const PebbleForm& form) {
  const double a = 1, b = form.elongation, c = form.elongation * form.flatness;
  match_gyration(
      body, Vec3(b * b + c * c, a * a + c * c, a * a + b * b).asDiagonal() * Mat3(0.2 * Mat3::Identity()));
  const double radius = std::cbrt(3 * solid_properties(body).volume / (4 * M_PI));
  transform(body, form.radius / radius * Mat3::Identity(), Vec3::Zero());
}

}  // namespace

std::vector<NurbsSurface> random_pebble(std::uint64_t seed, const PebbleForm& form) {
  static const SmoothCube cube(3, 1);
  const std::vector<Vec3> corners = random_corners(seed);
  for (double roundness = form.roundness;; roundness = std::min(1.0, roundness + kRaise)) {
    const auto target = [&](int face, double u, double v) {
      const Vec3 d = cube_direction(face, std::tan((2 * u - 1) * M_PI / 4), std::tan((2 * v - 1) * M_PI / 4));
      return pebble_point(corners, roundness, d.normalized());
    };
    std::vector<NurbsSurface> body = cube.surfaces(fit_points(cube, target));
    if (roundness < 1 && least_curvature(body) < kRoundEnough) continue;
    give_form(body, form);
    return body;
  }
}

}  // namespace nurbs

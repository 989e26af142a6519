// How each family is built and where its truth comes from; see families.h.
#include "support/families.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <memory>

#include "body/support.h"
#include "contact/joint_lanes.h"
#include "contact/pair_memory.h"
#include "contact/pair_search.h"
#include "nurbs/tolerances.h"
#include "shapes/gauge_fit.h"
#include "shapes/hull_fit.h"
#include "shapes/primitives.h"
#include "shapes/revolved.h"
#include "support/as_surface.h"
#include "support/ellipsoid_oracle.h"
#include "support/least_overlap.h"
#include "support/pairs.h"
#include "support/solid_families.h"

namespace nurbs::families {

namespace {

// --- bodies
// ----------------------------------------------------------------------------------------------------

struct Body {
  std::shared_ptr<const Shape> shape;
  Vec3 semi_axes = Vec3::Zero();  // of an ellipsoid, half extents of a box; else zero
  const Shape& operator*() const { return *shape; }
};

Body make_body(const std::string& name, std::vector<NurbsSurface> surfaces,
               const Vec3& semi_axes = Vec3::Zero()) {
  return {make_shape(name, std::move(surfaces)), semi_axes};
}

// Ellipsoids and boxes by their axes, made once.
const Body& ellipsoid(const Vec3& axes) {
  static std::map<std::array<double, 3>, Body> made;
  Body& body = made[{axes[0], axes[1], axes[2]}];
  if (!body.shape) body = make_body("ellipsoid", exact_ellipsoid(axes), axes);
  return body;
}
const Body& cuboid(const Vec3& half) {
  static std::map<std::array<double, 3>, Body> made;
  Body& body = made[{half[0], half[1], half[2]}];
  if (!body.shape) body = make_body("box", box(half), half);
  return body;
}
const Body& revolved(double equatorial, double polar) {
  static std::map<std::array<double, 2>, Body> made;
  Body& body = made[{equatorial, polar}];
  if (!body.shape)
    body = make_body("revolved", revolved_ellipsoid(equatorial, polar), Vec3(equatorial, equatorial, polar));
  return body;
}

std::vector<NurbsSurface> scaled(std::vector<NurbsSurface> surfaces, double factor) {
  for (NurbsSurface& s : surfaces)
    for (Vec4& p : s.points) p.head<3>() *= factor;
  return surfaces;
}

const Body& pebble_of_size(double factor) {
  static std::map<double, Body> made;
  Body& body = made[factor];
  if (!body.shape) body = make_body("pebble", scaled(pebble(), factor));
  return body;
}

// Edge curves of the pebble moved along their radii by `share`: every joint opens (> 0) or is dented (< 0).
const Body& ridged(double share) {
  static std::map<double, Body> made;
  Body& body = made[share];
  if (body.shape) return body;
  std::vector<NurbsSurface> surfaces = pebble();
  for (NurbsSurface& s : surfaces)
    for (int i = 0; i < s.size_u; ++i)
      for (int j = 0; j < s.size_v; ++j)
        if (i == 0 || j == 0 || i == s.size_u - 1 || j == s.size_v - 1) s.point(i, j).head<3>() *= 1 + share;
  return body = make_body("ridged", surfaces);
}
const Body& kinked() {
  static const Body body = make_body("kinked", fitted_ellipsoid(Vec3(1, 0.8, 0.6)));
  return body;
}
const Body& blocky() {
  static const Body body = make_body("blocky", fitted_superellipsoid(Vec3(1, 0.9, 0.8), 6, 3));
  return body;
}

// A puck: caps of curvature `flatness`, radius 0.8, run tangentially into a rounded rim of radius 1. One
// surface of revolution, quadratic. Away from the rim the cap is the parabola z = h - flatness r^2 / 2.
constexpr double kPuckHeight = 0.2, kPuckCap = 0.8;
const Body& puck(double flatness) {
  static std::map<double, Body> made;
  Body& body = made[flatness];
  if (body.shape) return body;
  const double drop = 0.5 * flatness * kPuckCap * kPuckCap, top = kPuckHeight, round = std::sqrt(0.5);
  const double rim_slope = 2 * drop / kPuckCap, tangent = top - drop - rim_slope * (1 - kPuckCap);
  const Vec3 half[5] = {
      {1, 0, 1}, {1, tangent, round}, {kPuckCap, top - drop, 1}, {0.5 * kPuckCap, top, 1}, {0, top, 1}};
  std::vector<Vec3> curve;  // from the lower pole up
  for (int j = 4; j > 0; --j) curve.emplace_back(half[j][0], -half[j][1], half[j][2]);
  curve.insert(curve.end(), half, half + 5);
  return body = make_body(
             "puck", {surface_of_revolution(2, {0, 0, 0, 0.25, 0.25, 0.5, 0.5, 0.75, 0.75, 1, 1, 1}, curve)});
}

// --- placing
// ---------------------------------------------------------------------------------------------------

// A surface point with its outward normal, shape frame.
struct Spot {
  Vec3 point, normal;
};

Spot spot_at(const Body& body, int patch, double u, double v) {
  const Jet1 jet = evaluate1((*body).patches[patch], u, v);
  return {jet.s, jet.su.cross(jet.sv).normalized()};
}
Spot random_spot(const Body& body, Random& random) {
  const int patch = random.below(static_cast<int>((*body).patches.size()));
  return spot_at(body, patch, random.uniform(0.02, 0.98), random.uniform(0.02, 0.98));
}
// Support point of an ellipsoid about its centre, in closed form.
Spot ellipsoid_spot(const Body& body, const Vec3& d) {
  return {test::ellipsoid_support(d, body.semi_axes), d};
}
// On a face of a box, `inset` inside its edges.
Spot face_spot(const Body& body, Random& random, int axis, double inset) {
  Spot spot{Vec3::Zero(), Vec3::Zero()};
  for (int k = 0; k < 3; ++k)
    spot.point[k] = random.uniform(-1, 1) * std::max(0.0, body.semi_axes[k] - inset);
  spot.normal[axis] = random.sign();
  spot.point[axis] = spot.normal[axis] * body.semi_axes[axis];
  return spot;
}
Spot cap_spot(Random& random, double flatness, double largest) {
  const double r = random.below(4) ? random.uniform(0, largest) : random.log_uniform(1e-12, largest);
  const double angle = random.uniform(0, 2 * M_PI), side = random.sign();
  const Vec3 out(std::cos(angle), std::sin(angle), 0);
  return {r * out + side * (kPuckHeight - 0.5 * flatness * r * r) * Vec3::UnitZ(),
          (flatness * r * out + side * Vec3::UnitZ()).normalized()};
}

// The rotation of least angle that takes unit x to unit y, after a random one that keeps clear of opposite
// vectors, where it is ill-conditioned, then a random spin about y.
Quat random_turn_taking(const Vec3& x, const Vec3& y, Random& random) {
  Quat first = random.turn();
  while ((first * x).dot(y) < -0.5) first = random.turn();
  const Quat onto = Quat::FromTwoVectors(first * x, y);
  return (Quat(Eigen::AngleAxisd(random.uniform(0, 2 * M_PI), y)) * onto * first).normalized();
}

struct Side {
  const Body& body;
  double scale;
  Spot spot;
};

// The two spots face each other `gap` apart. That is the gap of bodies that are apart; and of smooth bodies
// that overlap by less than the sum of their least curvature radii (the balls of those radii that roll inside
// them are then apart, certificate.h), to which the depth is cut.
PairCase place(Random& random, const Side& a, const Side& b, double gap, const Vec3& origin = Vec3::Zero()) {
  PairCase c;
  const double safe = a.scale * (*a.body).curvature.min_radius + b.scale * (*b.body).curvature.min_radius;
  gap = std::max(gap, -0.5 * safe);
  c.a = {a.body.shape.get(), a.scale, origin, random.turn()};
  const Vec3 n = (c.a.q * a.spot.normal).normalized();
  c.b = {b.body.shape.get(), b.scale, origin, random_turn_taking(b.spot.normal, -n, random)};
  c.b.x = origin + (a.scale * (c.a.q * a.spot.point) + gap * n - b.scale * (c.b.q * b.spot.point));
  c.truth.gap = gap;
  c.truth.has_normal = true;
  c.truth.normal = n;
  return c;
}

double size_of(const Side& a, const Side& b) {
  return std::min(a.scale * (*a.body).bounding_radius, b.scale * (*b.body).bounding_radius);
}
double signed_gap(Random& random, double size, double least, double most) {
  return random.sign() * size * random.log_uniform(least, most);
}

// --- truths
// ----------------------------------------------------------------------------------------------------

// Least overlap over 500 directions, the best few of them refined by a compass that turns at random.
Truth search_truth(const PairCase& c, Random& random) {
  test::Compass compass;
  compass.minima = 5;
  compass.one_basin = 0.95;
  compass.stride = 0.1;
  compass.finest = 1e-7;
  compass.longer = 1.2;
  compass.shorter = 0.5;
  compass.moves = std::numeric_limits<int>::max();
  Truth truth;
  truth.known = Known::bound;
  const auto overlap = [&](const Vec3& d) { return test::overlap_along(c.a, c.b, d); };
  truth.gap = -test::least_overlap(overlap, test::spiral(500), compass, random);
  return truth;
}

// Both bodies ellipsoids: their supports in closed form, long double.
Truth oracle_truth(const PairCase& c, const Body& a, const Body& b) {
  const oracle::Ellipsoid ea = oracle::make_ellipsoid(c.a.scale * a.semi_axes, c.a.x, c.a.q);
  const oracle::Ellipsoid eb = oracle::make_ellipsoid(c.b.scale * b.semi_axes, c.b.x, c.b.q);
  const oracle::Answer answer = oracle::signed_distance(ea, eb, 600);
  Truth truth;
  truth.gap = static_cast<double>(answer.gap);
  truth.normal = answer.normal.cast<double>();
  truth.margin = static_cast<double>(answer.gap - answer.runner_up);
  truth.has_normal = truth.margin > 1e-6 * std::abs(truth.gap);
  return truth;
}

// Overlapping boxes: least overlap over the 15 candidate axes (Gottschalk et al. 1996).
double box_overlap(const PairCase& c, const Vec3& half_a, const Vec3& half_b) {
  const Mat3 ra = c.a.q.toRotationMatrix(), rb = c.b.q.toRotationMatrix();
  double least = 1e300;
  const auto try_axis = [&](const Vec3& axis) {
    const double length = axis.norm();
    if (length < 1e-9) return;
    const Vec3 d = axis / length;
    least = std::min(least, c.a.scale * (ra.transpose() * d).cwiseAbs().dot(half_a) +
                                c.b.scale * (rb.transpose() * d).cwiseAbs().dot(half_b) -
                                std::abs(d.dot(c.b.x - c.a.x)));
  };
  for (int i = 0; i < 3; ++i) {
    try_axis(ra.col(i));
    try_axis(rb.col(i));
    for (int j = 0; j < 3; ++j) try_axis(ra.col(i).cross(rb.col(j)));
  }
  return least;
}

// --- families
// --------------------------------------------------------------------------------------------------

const Body& some_smooth_body(Random& random) {
  switch (random.below(5)) {
    case 0:
      return ellipsoid(Vec3(1, 0.8, 0.6));
    case 1:
      return pebble_of_size(1);
    case 2:
      return ellipsoid(Vec3(1, 1, 0.1));
    case 3:
      return ellipsoid(Vec3(1, 1, 1));
    default:
      return ellipsoid(Vec3(1, 0.3, 0.2));
  }
}

PairCase smooth_pair(Random& random, double least, double most, double scale_b = 1,
                     const Vec3& origin = Vec3::Zero()) {
  const Body &body_a = some_smooth_body(random), &body_b = some_smooth_body(random);
  const Side a{body_a, 1, random_spot(body_a, random)}, b{body_b, scale_b, random_spot(body_b, random)};
  return place(random, a, b, signed_gap(random, size_of(a, b), least, most), origin);
}

PairCase slender(Random& random, long) {
  const Body& body = ellipsoid(Vec3(0.05, 0.07, 0.15));
  const Side a{body, 1, ellipsoid_spot(body, random.direction())};
  const Side b{body, 1, ellipsoid_spot(body, random.direction())};
  return place(random, a, b, signed_gap(random, 0.15, 1e-9, 1e-2));
}

PairCase tiny_gap(Random& random, long) {
  PairCase c = smooth_pair(random, 1e-12, 1e-7);
  c.tolerance = 1e-13;
  return c;
}

PairCase size_ratio(Random& random, long) {
  PairCase c = smooth_pair(random, 1e-6, 0.1, random.log_uniform(1e-3, 1e3));
  return c;
}

// Tolerance at the round-off of the smaller or the larger body.
PairCase round_off(Random& random, long) {
  PairCase c = size_ratio(random, 0);
  c.tolerance = random.log_uniform(1e-16, 1e-12);
  return c;
}

double small_tilt(Random& random) {
  return random.below(4) == 0 ? 0.0 : random.log_uniform(1e-12, 0.1);
}
Vec3 tilted_axis(Random& random) {
  const double angle = random.uniform(0, 2 * M_PI), tilt = small_tilt(random);
  return Vec3(std::sin(tilt) * std::cos(angle), std::sin(tilt) * std::sin(angle),
              random.sign() * std::cos(tilt));
}

const Body& some_disc(Random& random) {
  switch (random.below(3)) {
    case 0:
      return ellipsoid(Vec3(1, 1, 0.1));
    case 1:
      return ellipsoid(Vec3(1, 1, 0.02));
    default:
      return revolved(1, 0.1);
  }
}
// Flat side or, one time in three, any side, its rim included.
Spot disc_spot(const Body& disc, Random& random) {
  return ellipsoid_spot(disc, random.below(3) ? tilted_axis(random) : random.direction());
}

PairCase disc_on_plate(Random& random, long) {
  const Body& body = some_disc(random);
  const Body& plate = cuboid(Vec3(3, 3, 0.2));
  const Side a{plate, 1, face_spot(plate, random, 2, 1)};
  const Side b{body, random.uniform(0.5, 1), disc_spot(body, random)};
  return place(random, a, b, signed_gap(random, size_of(a, b), 1e-10, 1e-2));
}

PairCase disc_on_disc(Random& random, long) {
  const Body &body_a = some_disc(random), &body_b = some_disc(random);
  const Side a{body_a, 1, disc_spot(body_a, random)};
  const Side b{body_b, random.uniform(0.3, 1), disc_spot(body_b, random)};
  return place(random, a, b, signed_gap(random, size_of(a, b), 1e-10, 1e-2));
}

// Boxes face to face, turned in the plane and tilted a little. Apart, the lowest corner of B lies over A's
// face, which makes its height the distance.
PairCase aligned_faces(Random& random, long) {
  const Vec3 half_a(1, 0.8, 0.6), half_b(0.7, 0.9, 0.5);
  const bool apart = random.below(2);
  const Quat frame = random.below(3) ? random.turn() : Quat::Identity();
  const double spin = random.below(2) ? random.uniform(0, 2 * M_PI) : 0.5 * M_PI * random.below(4);
  const double tilt = small_tilt(random), angle = random.uniform(0, 2 * M_PI);
  const Quat tilting(Eigen::AngleAxisd(tilt, Vec3(std::cos(angle), std::sin(angle), 0)));
  const Quat turn = tilting * Quat(Eigen::AngleAxisd(spin, Vec3::UnitZ()));
  const double scale = random.uniform(0.2, apart ? 0.75 / half_b.norm() : 1.0);
  const double depth = random.below(5) ? random.log_uniform(1e-12, 0.1) * scale : 0.0;
  const double gap = apart ? depth : -depth;
  const double height = scale * (turn.toRotationMatrix().transpose() * Vec3::UnitZ()).cwiseAbs().dot(half_b);
  const double room = apart ? 0.0 : 0.5;
  Vec3 shift(0, 0, half_a[2] + height + gap);
  for (int k = 0; k < 2; ++k)
    shift[k] = random.uniform(-1, 1) * std::max(0.0, half_a[k] - scale * half_b.norm() + room);
  PairCase c;
  c.a = {cuboid(half_a).shape.get(), 1, Vec3::Zero(), frame};
  c.b = {cuboid(half_b).shape.get(), scale, frame * shift, (frame * turn).normalized()};
  c.truth.gap = apart ? gap : -box_overlap(c, half_a, half_b);
  if (!apart && c.truth.gap > 0)
    c.truth.known = Known::bound;  // B hangs over so far that it is past the edge
  return c;
}

// Boxes with parallel axes: faces, edges and corners meet exactly.
PairCase parallel_boxes(Random& random, long) {
  const Vec3 half_a(1, 0.8, 0.6), half_b(0.7, 0.9, 0.5);
  PairCase c;
  const Quat frame = random.below(3) ? random.turn() : Quat::Identity();
  c.a = {cuboid(half_a).shape.get(), 1, Vec3::Zero(), frame};
  c.b = {cuboid(half_b).shape.get(), random.uniform(0.2, 1), Vec3::Zero(), frame};
  Vec3 shift, apart;
  double least = 1e300;
  const int outside = random.below(8);  // axes along which the boxes are apart
  for (int k = 0; k < 3; ++k) {
    const double sum = half_a[k] + c.b.scale * half_b[k];
    const double gap = random.log_uniform(1e-12, 0.3) * c.b.scale;
    const double overlap = outside >> k & 1 ? -gap : random.below(2) ? gap : random.uniform(0, sum);
    shift[k] = random.sign() * (sum - overlap);
    apart[k] = std::max(0.0, -overlap);
    least = std::min(least, overlap);
  }
  c.b.x = frame * shift;
  c.truth.gap = outside ? apart.norm() : -least;
  return c;
}

// Bodies of revolution on one axis, pole to pole.
PairCase coaxial(Random& random, long) {
  const auto body = [&]() -> const Body& {
    switch (random.below(5)) {
      case 0:
        return revolved(1, 0.5);
      case 1:
        return revolved(0.5, 1);
      case 2:
        return ellipsoid(Vec3(1, 1, 0.3));
      case 3:
        return ellipsoid(Vec3(0.4, 0.4, 1));
      default:
        return ellipsoid(Vec3(1, 1, 1));
    }
  };
  const Body &body_a = body(), &body_b = body();
  const Side a{body_a, 1, {body_a.semi_axes[2] * Vec3::UnitZ(), Vec3::UnitZ()}};
  const Side b{body_b, random.uniform(0.3, 1), {-body_b.semi_axes[2] * Vec3::UnitZ(), -Vec3::UnitZ()}};
  PairCase c = place(random, a, b, signed_gap(random, size_of(a, b), 1e-10, 0.2));
  if (random.below(2)) {  // in one frame, the common axis along a coordinate axis
    c.a.q = c.b.q = random.below(2) ? Quat::Identity() : random.turn();
    c.truth.normal = c.a.q * Vec3::UnitZ();
    c.b.x = (a.scale * body_a.semi_axes[2] + b.scale * body_b.semi_axes[2] + c.truth.gap) * c.truth.normal;
  }
  return c;
}

// One centre, parallel axes: every direction of least half-widths is as good as its opposite.
PairCase concentric(Random& random, long) {
  const Vec3 axes[] = {Vec3(1, 0.8, 0.6), Vec3(1, 1, 1), Vec3(1, 1, 0.1), Vec3(1, 0.3, 0.2), Vec3(1, 1, 0.5)};
  const int i = random.below(6), j = random.below(6);
  const auto body = [&](int k) -> const Body& {
    return k < 4 ? ellipsoid(axes[k]) : k == 4 ? revolved(1, 0.5) : cuboid(axes[0]);
  };
  const Body &a = body(i), &b = body(j);
  PairCase c;
  const double scale = random.below(2) ? 1.0 : random.log_uniform(0.01, 1);
  const Quat frame = random.below(2) ? Quat::Identity() : random.turn();
  c.a = {a.shape.get(), 1, Vec3::Zero(), frame};
  c.b = {b.shape.get(), scale, Vec3::Zero(), frame};
  c.truth.gap = -(a.semi_axes[2] + scale * b.semi_axes[2]);  // both thinnest along z
  return c;
}

// Any overlap down to one body swallowed whole and to centres a hair apart; ellipsoids, so that the oracle
// knows.
PairCase deep(Random& random, long) {
  const Vec3 axes[] = {Vec3(1, 0.8, 0.6), Vec3(1, 1, 0.1), Vec3(1, 0.3, 0.2), Vec3(0.05, 0.07, 0.15)};
  const Body &a = ellipsoid(axes[random.below(4)]), &b = ellipsoid(axes[random.below(4)]);
  PairCase c;
  c.a = {a.shape.get(), 1, Vec3::Zero(), random.turn()};
  c.b = {b.shape.get(), random.log_uniform(0.1, 1), Vec3::Zero(), random.turn()};
  const double size = std::min((*a).bounding_radius, c.b.scale * (*b).bounding_radius);
  const double offset = random.below(2) ? random.uniform(0, 1) : random.log_uniform(1e-9, 1);
  c.b.x = offset * size * random.direction();
  c.truth = oracle_truth(c, a, b);
  return c;
}

// The same for bodies without a closed form; the truth is searched.
PairCase deep_general(Random& random, long) {
  const auto body = [&]() -> const Body& {
    switch (random.below(4)) {
      case 0:
        return pebble_of_size(1);
      case 1:
        return blocky();
      case 2:
        return cuboid(Vec3(1, 0.8, 0.6));
      default:
        return kinked();
    }
  };
  const Body &a = body(), &b = body();
  PairCase c;
  c.a = {a.shape.get(), 1, Vec3::Zero(), random.turn()};
  c.b = {b.shape.get(), random.log_uniform(0.2, 1), random.uniform(0, 1.2) * random.direction(),
         random.turn()};
  c.truth = search_truth(c, random);
  return c;
}

PairCase far_away(Random& random, long) {
  return smooth_pair(random, 1e-8, 1e-2, random.uniform(0.5, 1.5), 1e5 * random.direction());
}

// Shapes given in metres, of micrometres and of kilometres; and unit shapes scaled so.
PairCase units(Random& random, long) {
  const double unit = random.below(2) ? 1e-6 : 1e3;
  const bool in_file = random.below(2);
  const auto side = [&]() -> Side {
    const double file = in_file ? unit : 1, scale = (in_file ? 1 : unit) * random.uniform(0.5, 1.5);
    const Body& body = random.below(2) ? pebble_of_size(file) : ellipsoid(file * Vec3(1, 0.8, 0.6));
    return {body, scale, random_spot(body, random)};
  };
  const Side a = side(), b = side();
  return place(random, a, b, signed_gap(random, size_of(a, b), 1e-8, 1e-1));
}

// Within 1e-12 of a patch edge, on it, or at a corner where three patches meet.
PairCase on_joint(Random& random, bool corner) {
  const auto side = [&]() -> Side {
    const Body& body = random.below(2) ? ellipsoid(Vec3(1, 0.8, 0.6)) : pebble_of_size(1);
    const auto near = [&] {
      const double off = random.below(2) ? 0.0 : random.log_uniform(1e-14, 1e-3);
      return random.below(2) ? off : 1 - off;
    };
    const int patch = random.below(static_cast<int>((*body).patches.size()));
    double u = near(), v = corner ? near() : random.uniform(0, 1);
    if (random.below(2)) std::swap(u, v);
    return {body, random.uniform(0.5, 1.5), spot_at(body, patch, u, v)};
  };
  const Side a = side(), b = side();
  return place(random, a, b, signed_gap(random, size_of(a, b), 1e-9, 0.1));
}
PairCase on_edge(Random& random, long) {
  return on_joint(random, false);
}
PairCase on_corner(Random& random, long) {
  return on_joint(random, true);
}

// On and around the poles of one-patch bodies.
PairCase on_pole(Random& random, long) {
  const auto near_pole = [&](const Body& body) {
    const double off = random.below(3) == 0 ? 0.0 : random.log_uniform(1e-15, 0.1);
    const double angle = random.uniform(0, 2 * M_PI);
    return ellipsoid_spot(body,
                          Vec3(off * std::cos(angle), off * std::sin(angle), random.sign()).normalized());
  };
  const auto polar = [&]() -> const Body& { return random.below(2) ? revolved(1, 0.5) : revolved(0.5, 1); };
  const Body& body_a = polar();
  const Body& body_b = random.below(2) ? polar() : pebble_of_size(1);
  const Side a{body_a, 1, near_pole(body_a)};
  const Side b{body_b, random.uniform(0.5, 1.5),
               body_b.semi_axes[0] > 0 ? near_pole(body_b) : random_spot(body_b, random)};
  return place(random, a, b, signed_gap(random, size_of(a, b), 1e-9, 0.1));
}

PairCase spinning(Random& random, long) {
  PairCase c = smooth_pair(random, 1e-8, 1e-2, random.uniform(0.5, 1.5));
  c.warm = true;
  c.a_before = c.a;
  c.b_before = c.b;
  c.a_before.q = random.turn();
  c.b_before.q = random.turn();
  c.b_before.x = c.b.x + random.uniform(0, 0.3) * random.direction();
  return c;
}

PairCase near_planar(Random& random, long) {
  const double flatness[] = {1e-6, 1e-4};
  const auto side = [&]() -> Side {
    const double flat = flatness[random.below(2)];
    const Body& body = puck(flat);
    return {body, random.uniform(0.5, 1), cap_spot(random, flat, 0.75)};
  };
  const Side a = side();
  if (random.below(2)) {
    const Side b = side();
    return place(random, a, b, signed_gap(random, size_of(a, b), 1e-9, 1e-2));
  }
  const Body& other = some_smooth_body(random);
  const Side b{other, random.uniform(0.3, 1), random_spot(other, random)};
  return place(random, a, b, signed_gap(random, size_of(a, b), 1e-9, 1e-2));
}

// Flat faces that only a tensor-product fit makes: blocky bodies face to face and on plates.
PairCase blocky_faces(Random& random, long) {
  PairCase c;
  const bool plate = random.below(2);
  const Body& a = plate ? cuboid(Vec3(3, 3, 0.2)) : blocky();
  const Quat frame = random.turn();
  c.a = {a.shape.get(), 1, Vec3::Zero(), frame};
  const double tilt = small_tilt(random), angle = random.uniform(0, 2 * M_PI);
  const Quat tilting(Eigen::AngleAxisd(tilt, Vec3(std::cos(angle), std::sin(angle), 0)));
  c.b = {blocky().shape.get(), random.uniform(0.5, 1), Vec3::Zero(),
         (frame * tilting * Quat(Eigen::AngleAxisd(random.uniform(0, 6.28), Vec3::UnitZ()))).normalized()};
  const Vec3 n = frame * Vec3::UnitZ();
  const Vec3 shift = frame * Vec3(random.uniform(-0.4, 0.4), random.uniform(-0.4, 0.4), 0);
  c.b.x = shift;
  const double touching = test::overlap_along(c.a, c.b, n);
  c.b.x = shift + (touching + signed_gap(random, 1, 1e-9, 0.05)) * n;
  c.truth = search_truth(c, random);
  return c;
}

// Bodies whose joints open by some mrad or are dented; apart, two supports of the hulls that face each other
// are the answer; overlapping, it is searched.
PairCase imperfect(Random& random, const Body& a, const Body& b) {
  PairCase c;
  c.a = {a.shape.get(), 1, Vec3::Zero(), random.turn()};
  c.b = {b.shape.get(), random.uniform(0.5, 1.5), Vec3::Zero(), random.turn()};
  // Half of them at a joint of A: along a normal there.
  Vec3 d = random.direction();
  if (random.below(2)) {
    const Spot spot = spot_at(a, random.below(static_cast<int>((*a).patches.size())), random.below(2),
                              random.below(2) ? random.uniform(0, 1) : random.below(2));
    d = (c.a.q * (spot.normal + 1e-3 * random.direction())).normalized();
  }
  const double gap = signed_gap(random, 1, 1e-8, 1e-2);
  const Support on_a = find_hull_support(*a, c.a.q.conjugate() * d);
  const Support on_b = find_hull_support(*b, c.b.q.conjugate() * -d);
  c.b.x = c.a.q * on_a.point + gap * d - c.b.scale * (c.b.q * on_b.point);
  if (gap > 0) {
    c.truth.gap = gap;
    c.truth.has_normal = true;
    c.truth.normal = d;
  } else {
    c.truth = search_truth(c, random);
  }
  return c;
}
PairCase kinked_pair(Random& random, long) {
  const auto body = [&]() -> const Body& { return random.below(2) ? kinked() : ridged(1e-3); };
  const Body &a = body(), &b = random.below(3) ? body() : pebble_of_size(1);
  return imperfect(random, a, b);
}
PairCase dented_pair(Random& random, long) {
  const auto body = [&]() -> const Body& { return random.below(2) ? ridged(-2e-4) : blocky(); };
  const Body &a = body(), &b = random.below(3) ? body() : pebble_of_size(1);
  return imperfect(random, a, b);
}

// Ellipsoids to 1000 : 1. Apart, the gap is by construction; overlaps are shallower than the sharpest tip.
PairCase eccentric(Random& random, long) {
  const Vec3 axes[] = {Vec3(1, 0.15, 0.03), Vec3(1, 0.1, 0.01),   Vec3(1, 1, 0.01),
                       Vec3(1, 0.02, 0.02), Vec3(1, 0.03, 0.001), Vec3(1, 1, 0.001)};
  const Body &body_a = ellipsoid(axes[random.below(6)]), &body_b = ellipsoid(axes[random.below(6)]);
  const Side a{body_a, 1, ellipsoid_spot(body_a, random.direction())};
  const Side b{body_b, random.uniform(0.5, 1.5), ellipsoid_spot(body_b, random.direction())};
  return place(random, a, b, signed_gap(random, size_of(a, b), 1e-9, 1e-2));
}

// Ellipsoids to 30 : 1 that overlap by more than the sharpest tip has radius.
PairCase eccentric_deep(Random& random, long) {
  const Vec3 axes[] = {Vec3(1, 0.15, 0.03), Vec3(1, 0.1, 0.1), Vec3(1, 1, 0.05), Vec3(1, 0.5, 0.1)};
  const Body &a = ellipsoid(axes[random.below(4)]), &b = ellipsoid(axes[random.below(4)]);
  const Spot on_a = ellipsoid_spot(a, random.direction()), on_b = ellipsoid_spot(b, random.direction());
  PairCase c = place(random, {a, 1, on_a}, {b, random.uniform(0.5, 1.5), on_b}, 1e-3);
  c.b.x -= random.log_uniform(2e-3, 3e-2) * c.truth.normal;
  c.truth = oracle_truth(c, a, b);
  return c;
}

// An ellipsoid whose every patch has parameters of its own, u' = u / (u + c (1 - u)): the same surface.
const Body& mismatched(int way) {
  static std::map<int, Body> made;
  Body& body = made[way];
  if (body.shape) return body;
  Random random(100 + way);
  const Vec3 axes = way % 2 ? Vec3(1, 0.8, 0.6) : Vec3(1, 0.4, 0.3);
  std::vector<NurbsSurface> surfaces = exact_ellipsoid(axes);
  for (NurbsSurface& s : surfaces) {
    const double u = random.log_uniform(0.1, 10), v = random.log_uniform(0.1, 10);
    for (int i = 0; i < s.size_u; ++i)
      for (int j = 0; j < s.size_v; ++j) s.point(i, j) *= std::pow(u, i) * std::pow(v, j);
  }
  return body = make_body("mismatched", std::move(surfaces), axes);
}
PairCase mismatched_joints(Random& random, long) {
  const auto side = [&]() -> Side {
    const Body& body = mismatched(random.below(6));
    const bool joint = random.below(2);
    const double t = random.uniform(0, 1);
    return {body, random.uniform(0.5, 1.5),
            joint ? spot_at(body, random.below(6), 0, t) : random_spot(body, random)};
  };
  const Side a = side(), b = side();
  return place(random, a, b, signed_gap(random, size_of(a, b), 1e-9, 1e-2));
}

// Control points as a file with few digits has them: joints gape by that.
const Body& rounded(int digits) {
  static std::map<int, Body> made;
  Body& body = made[digits];
  if (body.shape) return body;
  return body = make_body("rounded", test::with_decimals(exact_ellipsoid(Vec3(1, 0.8, 0.6)), digits));
}
PairCase rounded_digits(Random& random, long) {
  const Body &a = rounded(random.whole(6, 12)),
             &b = random.below(2) ? rounded(random.whole(6, 12)) : pebble_of_size(1);
  return imperfect(random, a, b);
}

// The hull of points off an ellipsoid by up to `rough`, about 1 in size, round the origin.
ConvexHull rough_hull(unsigned seed, int count, double rough) {
  Random random(seed);
  const Vec3 axes(random.uniform(0.9, 1.5), 1, random.uniform(0.6, 1));
  std::vector<Vec3> points;
  for (int k = 0; k < count; ++k)
    points.push_back(random.uniform(1 - rough, 1) * axes.cwiseProduct(random.direction()));
  return ConvexHull(points);
}

// What `nurbs-shape fit` makes of irregular hulls: polynomial patches, and rational ones of 2, 4 and 6 spans
// of a gauge function, to 5, 5, 2 and 1 %.
constexpr int kGrains = 5;
const Body& grain(int which) {
  static Body made[kGrains];
  Body& body = made[which];
  if (body.shape) return body;
  if (which < 2) {
    HullFitOptions options;
    options.tolerance = 0.05;
    options.spans = 1;
    return body = {fit_hull(rough_hull(which, 200, 0.1), options).shape};
  }
  GaugeFitOptions options;
  const double share[] = {0.05, 0.02, 0.01};
  options.inward = options.outward = share[which - 2];
  options.least_curvature = 0.05;
  const int spans = 2 * (which - 1);
  return body = make_body(
             "grain", fit_gauge(4, spans, rough_hull(which, 300, 2 * share[which - 2]), options).surfaces);
}
PairCase fitted_grains(Random& random, long) {
  const Body &a = grain(random.below(kGrains)), &cube = cuboid(Vec3(1, 0.8, 0.6));
  const int other = random.below(8);
  const Body& b = other == 0 ? pebble_of_size(1) : other == 1 ? cube : grain(random.below(kGrains));
  PairCase c;
  if (random.below(4)) {
    c = imperfect(random, a, b);
  } else {  // deeper
    c.a = {a.shape.get(), 1, Vec3::Zero(), random.turn()};
    c.b = {b.shape.get(), random.log_uniform(0.2, 1), random.uniform(0.3, 1.5) * random.direction(),
           random.turn()};
    c.truth = search_truth(c, random);
  }
  if (random.below(3) == 0) {
    c.warm = true;
    c.a_before = c.a;
    c.b_before = c.b;
    c.b_before.q = (random.turn_by(random.log_uniform(1e-4, 0.1)) * c.b.q).normalized();
  }
  return c;
}

}  // namespace

const std::vector<Family>& all_families() {
  constexpr long kMany = 100000, kSearched = 5000;
  static const std::vector<Family> ovals = {
      {"slender", "slender ellipsoids .05/.07/.15, gaps 1e-9..1e-2 of the size, both signs", kMany, slender},
      {"tiny gap", "gaps 1e-12..1e-7 of the size, both signs, tolerance 1e-13", kMany, tiny_gap},
      {"size ratio", "sizes up to 1000 : 1", kMany, size_ratio},
      {"round-off", "the same with tolerances 1e-16..1e-12", kMany, round_off},
      {"disc on plate", "thin discs on a box's face, flat, tilted by 1e-12..0.1 and on the rim", kMany,
       disc_on_plate},
      {"disc on disc", "thin discs on each other", kMany, disc_on_disc},
      {"aligned faces", "boxes face to face, tilted by 0..0.1", kMany, aligned_faces},
      {"parallel boxes", "boxes with parallel axes: faces, edges, corners", kMany, parallel_boxes},
      {"coaxial", "bodies of revolution on one axis, pole to pole", kMany, coaxial},
      {"concentric", "one centre, parallel axes: no unique answer", kMany, concentric},
      {"deep", "ellipsoids overlapping by any amount, down to full containment", 20000, deep},
      {"deep general", "pebbles, blocky and kinked bodies, boxes, the same", kSearched, deep_general},
      {"far away", "coordinates 1e5 sizes from the origin", kMany, far_away},
      {"units", "micrometres and kilometres", kMany, units},
      {"patch edge", "contact on a patch edge", kMany, on_edge},
      {"patch corner", "contact on a three-patch corner", kMany, on_corner},
      {"pole", "contact on and around a pole", kMany, on_pole},
      {"spinning", "remembered from quite another pose", kMany, spinning},
      {"near planar", "caps of curvature 1e-6 and 1e-4 of the mean", kMany, near_planar},
      {"blocky faces", "fitted flat faces on each other and on plates", kSearched, blocky_faces},
      {"kinked", "joints open by mrad", kSearched, kinked_pair},
      {"dented", "joints dented by 1e-4", kSearched, dented_pair},
      {"eccentric", "ellipsoids to 1000 : 1", kMany, eccentric},
      {"eccentric deep", "ellipsoids to 30 : 1 that overlap by more than their tips' radii", kSearched,
       eccentric_deep},
      {"mismatched joints", "patches each with parameters of its own", kMany, mismatched_joints},
      {"rounded digits", "control points of 6 to 12 decimals: joints gape", kSearched, rounded_digits},
      {"fitted grains", "fits of irregular hulls to 5, 2 and 1 %, shallow and deep", kSearched,
       fitted_grains},
  };
  static const std::vector<Family> all = [] {
    std::vector<Family> joined = ovals;
    joined.insert(joined.end(), solid_families().begin(), solid_families().end());
    return joined;
  }();
  return all;
}

// Every other pair knows of no closed form.
const Shape* surface_of(const Shape* shape) {
  static std::map<const Shape*, std::shared_ptr<const Shape>> made;
  if (!shape->ellipsoid.found) return shape;
  std::shared_ptr<const Shape>& surface = made[shape];
  if (!surface) surface = test::as_surface(*shape);
  return surface.get();
}

PairCase pair_of(const Family& family, long k) {
  unsigned long seed = 1469598103934665603ul;
  for (const char* c = family.name; *c; ++c) seed = (seed ^ static_cast<unsigned char>(*c)) * 1099511628211ul;
  Random random(seed + static_cast<unsigned long>(k));
  PairCase pair = family.make(random, k);
  if (k % 2 == 0) return pair;
  for (const Shape** shape : {&pair.a.shape, &pair.b.shape, &pair.a_before.shape, &pair.b_before.shape})
    if (*shape) *shape = surface_of(*shape);
  return pair;
}

// --- judging
// ---------------------------------------------------------------------------------------------------

const char* const kFailureNames[kFailures] = {"none",    "no_answer", "not_a_number", "unresolved", "sign",
                                              "flipped", "error",     "bracket",      "points"};

Verdict judge(const PairCase& c, const Answer& r, double mesh_error) {
  Verdict v;
  const double ra = c.a.scale * c.a.shape->bounding_radius, rb = c.b.scale * c.b.shape->bounding_radius;
  const double far = std::max(c.a.x.cwiseAbs().maxCoeff(), c.b.x.cwiseAbs().maxCoeff());
  const double roundoff = 10 * kRoundoff * std::max(ra, rb) + 5e-16 * far + c.rounded;
  v.allowed = c.tolerance * std::min(ra, rb) + roundoff + 2 * mesh_error;
  const auto fail = [&](Failure f) {
    v.failure = f;
    return v;
  };
  if (!r.given) return fail(Failure::no_answer);
  if (!std::isfinite(r.gap) || (r.has_normal && !r.normal.allFinite())) return fail(Failure::not_a_number);
  if (r.unresolved) return fail(Failure::unresolved);
  // Any normal shows that the gap is at least -p(normal); a searched truth may be no better.
  const auto overlap = [&c](const Vec3& d) {
    return c.overlap ? c.overlap(d) : test::overlap_along(c.a, c.b, d);
  };
  const double along = r.has_normal ? -overlap(r.normal.normalized()) : -kFarAway;
  const double truth = c.truth.known == Known::bound ? std::max(c.truth.gap, along) : c.truth.gap;
  v.error = std::abs(r.gap - truth);
  if (r.gap * truth < 0 && std::min(std::abs(r.gap), std::abs(truth)) > v.allowed) return fail(Failure::sign);
  const bool one_normal = c.truth.has_normal && c.truth.margin > v.allowed;
  if (r.has_normal && one_normal && !(r.normal.dot(c.truth.normal) > 0)) return fail(Failure::flipped);
  if (mesh_error == 0 && r.has_normal) v.error = std::max(v.error, std::abs(along - r.gap));
  if (!(v.error <= v.allowed)) return fail(Failure::error);
  if (mesh_error > 0) return v;
  if (r.has_bracket) {
    // A search may have missed the last digits of the least overlap, and the normal need not be the
    // bracket's.
    const double above = c.truth.known == Known::bound ? v.allowed : roundoff;
    if (!(r.lower <= truth + above && r.upper >= truth - roundoff && r.upper - r.lower <= v.allowed))
      return fail(Failure::bracket);
  }
  if (r.has_points && !(std::abs(r.normal.dot(r.point_b - r.point_a) - r.gap) <= v.allowed))
    return fail(Failure::points);
  return v;
}

Answer solve(const PairCase& c, Solver solver) {
  double memory[kPairMemorySize] = {0};
  ContactSettings settings;
  settings.solver = solver;
  settings.tolerance = c.tolerance;
  if (c.warm) find_contact(c.a_before, c.b_before, settings, memory);
  const ContactResult r = find_contact(c.a, c.b, settings, memory);
  Answer answer;
  answer.unresolved = r.status == Status::unresolved;
  answer.gap = r.gap;
  answer.has_normal = answer.has_points = true;
  answer.normal = r.normal;
  answer.point_a = r.point_a;
  answer.point_b = r.point_b;
  answer.has_bracket = solver == Solver::ladder;
  answer.rung = static_cast<int>(r.rung);
  answer.lower = r.lower;
  answer.upper = r.upper;
  return answer;
}

Answer follow(const PairCase& c, int lane) {
  double memory[kPairMemorySize] = {0};
  ContactSettings settings;
  settings.tolerance = c.tolerance;
  const double small = 1e-3;
  Particle before = c.b;
  before.q = (Quat(Eigen::AngleAxisd(small, Vec3(0.6, -0.48, 0.64))) * c.b.q).normalized();
  before.x += small * c.b.scale * c.b.shape->bounding_radius * Vec3(0.48, 0.64, 0.6);
  find_contact(c.a, before, settings, memory);
  const PairMemory& known = memory_at(memory);
  Answer answer;
  answer.given = false;
  const SurfacePoint on_a = warm_point(known.on_a, *c.a.shape), on_b = warm_point(known.on_b, *c.b.shape);
  if (known.on_a.patch < 0 || known.on_b.patch < 0) return answer;

  JointLanes pairs{};
  const auto set_turn = [&](const Quat& q, Turn<Wide>* to) {
    const Turn<double> m = turn(q.normalized().toRotationMatrix());
    for (int k = 0; k < 3; ++k) set_lane(m.row[k], lane, &to->row[k]);
  };
  const double ra = c.a.scale * c.a.shape->bounding_radius, rb = c.b.scale * c.b.shape->bounding_radius;
  const Vec3 offset = c.b.x - c.a.x;
  pairs.a[lane] = c.a.shape;
  pairs.b[lane] = c.b.shape;
  pairs.on_a[lane] = on_a;
  pairs.on_b[lane] = on_b;
  pairs.scale_a[lane] = c.a.scale;
  pairs.scale_b[lane] = c.b.scale;
  set_turn(c.a.q, &pairs.turn_a);
  set_turn(c.b.q, &pairs.turn_b);
  set_lane(triple(offset), lane, &pairs.offset);
  pairs.size[lane] = std::min(ra, rb);
  pairs.reach[lane] = std::max(ra, rb);
  pairs.tolerance[lane] = std::max(c.tolerance * std::min(ra, rb), kLeastTolerance * std::max(ra, rb));
  if (follow_joints(1u << lane, std::numeric_limits<double>::infinity(), &pairs) == 0) return answer;
  answer.given = answer.has_normal = answer.has_bracket = answer.has_points = true;
  answer.rung = static_cast<int>(Rung::warm);
  answer.gap = pairs.gap[lane];
  answer.lower = pairs.lower[lane];
  answer.upper = pairs.upper[lane];
  answer.normal = nurbs::lane(pairs.normal, lane);
  // As a result's, whose points are the gap apart.
  answer.point_a = nurbs::lane(pairs.point_a, lane);
  answer.point_b = nurbs::lane(pairs.point_b, lane);
  const Vec3 shift = 0.5 * (answer.gap - answer.normal.dot(answer.point_b - answer.point_a)) * answer.normal;
  answer.point_a -= shift;
  answer.point_b += shift;
  return answer;
}

}  // namespace nurbs::families

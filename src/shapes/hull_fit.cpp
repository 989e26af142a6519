// The ladder of bodies tried, in a frame in which the hull is about as wide in all directions; certificates.
#include "shapes/hull_fit.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <optional>
#include <queue>
#include <set>

#include "body/mass_properties.h"
#include "body/support.h"
#include "nurbs/affine.h"
#include "nurbs/bernstein.h"
#include "shapes/convex_fit.h"
#include "shapes/gauge_fit.h"
#include "shapes/primitives.h"
#include "shapes/revolved.h"
#include "shapes/rounded_polyhedron.h"

namespace nurbs {
namespace {

// Degree and spans of the bodies tried, by number of control points: polynomial ones, then by gauge
// functions.
constexpr int kLadder[][2] = {{3, 1}, {4, 1}, {3, 2}, {4, 2}, {3, 3}, {4, 3}, {3, 4}};
constexpr int kGaugeLadder[][2] = {{4, 4}, {4, 6}, {4, 8}, {4, 10}, {4, 12}};
constexpr int kCostlySpans = 4;     // polynomial fits take 10 s from here on ...
constexpr double kNear = 1.5;       // ... and need a last error of less than this times the tolerance
constexpr double kNearMiss = 1.25;  // times the tolerance
constexpr double kStricter[] = {0.8, 0.65,
                                0.5};  // of the tolerance: what a rung is asked for that just misses it
constexpr double kCrystalNear = 1.3;   // ... and for a higher degree of crystals
constexpr double kPolynomialGain =
    1.6;                         // error of the first gauge function over polynomial ones', at the most
constexpr int kMostDents = 2;    // polynomial bodies near enough but dented: no more are tried then
constexpr double kSteepest = 3;  // power of the spans by which an error falls, at the most, and with edges:
constexpr double kGaugeSteepest = 2;  // .. of hulls for which polynomial patches were too few
constexpr double kRaised = 2;         // largest gain of a degree: rungs that need more of it are skipped
constexpr double kPolynomialRate = 0.4, kRaisedLater = 1.2;  // of an error's fall as the last ones tell it
constexpr double kCurvatureShare = 3;  // least curvature over the tolerance, both relative
constexpr double kLeastCurvature = 0.002, kMostCurvature = 0.1;
constexpr double kGaugeCurvatures[] = {10, 3, 1};  // over the tolerance: the first that can be had
// Least height of a cap of curvature 1 over a triangle of area 1: the squared radius of its circle, halved.
const double kTriangleBulge = 2 / (3 * std::sqrt(3.0));
constexpr double kGaugeHope = 1.03;  // times the tolerance, of an error to be expected: not worth a try
constexpr double kGaugeGain = 1.4;   // largest fall of the error by asking for less curvature
constexpr int kFurther = 2;          // rungs tried beyond a body that is near enough, but not proven convex
constexpr double kSurelyTooCoarse = 3;  // times the tolerance: no freer fit is tried
// A fit that aims at far less than it can reach weighs distances so heavily that it loses convexity: the aim
// falls from kFirstAim (of the radius) with what has been reached.
constexpr double kFirstAim = 0.06, kAimShare = 0.6;
constexpr double kAim = 0.97, kOutwardAim = 0.93;  // of a tolerance, left to samples
// Distance from its ray that costs a point as much as an error of the tolerance: free too early, the points
// crowd.
constexpr double kFirstSlide = 0.05, kFreeSlide = 0.15;
constexpr double kPlaneShare = 0.02;  // of the tolerance: faces that are plane to this may be one
// Faces of a polyhedron with rounded edges, which bodies of a few keep whatever else would do. Of more, its
// contacts take 3 to 5 times as long at rest as a spline's, and 3 to 10 times as they begin: splines of fewer
// points are tried first.
constexpr size_t kFlatFaces = 12, kMostFaces = 60;
constexpr size_t kMostFacesAtLast = 300;  // where nothing else is within the tolerance: seconds to load
// Its control points for every face but two: three faces meet at most corners of an eroded polyhedron, three
// patches of 25 points at each, two of 6 along an edge.
constexpr size_t kPointsPerFace = 194;
constexpr double kSharper = 0.5;  // of the tolerance: where estimates of what gauge functions can do end
// Spans from which a gauge function takes 5 s, and what times the tolerance the last error must be where a
// crystal's polyhedron does.
constexpr int kCostlyGauge = 10;
constexpr double kCostlyNear = 1.1;
constexpr double kEstimate = 1.1;  // times the tolerance, as estimates are 5 % off
// Growth of the power of the spans by which an error falls, from two rungs to the next.
constexpr double kRateGain = 1;
constexpr int kBisections = 14;      // of a rounding that the hull has already ...
constexpr double kSurelyNear = 0.1;  // ... unless it is as near as this share of the tolerance
constexpr int kRoundings = 2;        // ... whose radius is found by the distance of the first one
constexpr double kLeastCut = 0.01;   // of the tolerance, of a corner that a rounding takes
// How far a polyhedron of few faces may stand out of a hull before it is moved inward, and by how much; and
// of one too thin for that. Shares of the tolerance.
constexpr double kExcess = 1.4, kExcessInward = 0.6, kThinExcess = 0.9;
constexpr int kMoreRoundings = 5;  // .. of a polyhedron of other faces than the hull's
constexpr int kHalvings = 12;      // ... and that is halved where it fits nowhere
constexpr int kRimPoints = 96;     // of a circle, at which its distance from the hull is looked at
constexpr double kRimCut = 0.7,
                 kChordCut = 0.25;    // of the tolerance: what corners and a coarser profile take
constexpr size_t kMostProfile = 400;  // corners of the hull's own profile ...
constexpr size_t kMostCorners = 12;   // ... and of the coarser one: rounder bodies are for splines
// Half a body's thickness over the tolerance, below which errors across it count as if it were so thick: by
// up to 1 / kThin of the thickness. Where that leaves another volume, a stricter fit is tried.
constexpr double kThin = 2, kStrictThin = 10;
constexpr double kVolumeError = 0.1;
constexpr size_t kStrictPoints = 602;  // seconds
constexpr int kClosestSteps = 40;
constexpr double kClosestStride = 0.3;  // parameters
constexpr double kFootSlope = 1e-6;     // rad off the normal: a foot point
constexpr double kSingularFoot = 1e-6;  // sine between the tangents, below which there is no normal
constexpr int kMostPieces = 200000;

// --- certificates

// Upper bound of the distance from a point to the body by Gilbert's, Johnson's and Keerthi's algorithm:
// slower than Newton's method, but it always closes in.
double distance_by_supports(const Shape& shape, const Vec3& v, double enough) {
  Vec3 simplex[4] = {find_support(shape, v.normalized()).point - v};
  int count = 1;
  Vec3 nearest = simplex[0];
  for (int k = 0; k < kClosestSteps; ++k) {
    const double far = nearest.norm();
    if (far <= enough || far <= 1e-12 * shape.bounding_radius) return far;
    const Vec3 y = find_support(shape, -nearest / far).point - v;
    if (far * far - nearest.dot(y) <= 1e-9 * shape.bounding_radius * far) return far;
    simplex[count++] = y;
    nearest = nearest_on_simplex(simplex, count);
    if (count == 4) return 0;
  }
  return nearest.norm();
}

// Whether v lies between s, a point of the body, and the ball inside it about the origin.
bool in_cone_of_inner_ball(const Shape& shape, const Vec3& s, const Vec3& v) {
  const Vec3 way = v - s;
  const double along = -s.dot(way);
  const bool before = along >= way.squaredNorm();  // the ray's nearest point to the origin comes after v
  const Vec3 nearest = before ? Vec3(s + way * (along / way.squaredNorm())) : v;
  return nearest.norm() <= shape.inner_radius;
}

// Upper bound of the distance from a point to the body, 0 where it is inside: Newton's method for the closest
// surface point, whose distance is a bound; where that shows too little, supports.
double distance_to_body(const Shape& shape, const Vec3& v, double enough) {
  SurfacePoint at = find_support(shape, v.normalized()).where;
  double best = 1e300;
  for (int k = 0; k < kClosestSteps; ++k) {
    const Jet2 j = evaluate2(shape.patches[at.patch], at.u, at.v);
    const Vec3 off = v - j.s, cross = j.su.cross(j.sv);
    best = std::min(best, off.norm());
    if (best <= enough) return best;
    if (in_cone_of_inner_ball(shape, j.s, v)) return 0;
    if (!(cross.norm() > kSingularFoot * j.su.norm() * j.sv.norm())) break;
    if (off.cross(cross).norm() <= kFootSlope * off.norm() * cross.norm()) {
      if (off.dot(cross) > 0) return best;
      break;
    }
    Mat2 hessian;
    hessian << j.su.dot(j.su) - off.dot(j.suu), j.su.dot(j.sv) - off.dot(j.suv),
        j.su.dot(j.sv) - off.dot(j.suv), j.sv.dot(j.sv) - off.dot(j.svv);
    if (hessian.determinant() <= 0 || hessian(0, 0) <= 0)
      hessian << j.su.dot(j.su), j.su.dot(j.sv), j.su.dot(j.sv), j.sv.dot(j.sv);
    Vec2 step = hessian.inverse() * Vec2(off.dot(j.su), off.dot(j.sv));
    if (!step.allFinite() || step.norm() < 1e-14) break;
    if (step.norm() > kClosestStride) step *= kClosestStride / step.norm();
    at = walk(shape, at, step[0], step[1]);
  }
  return std::min(best, distance_by_supports(shape, v, enough));
}

struct HullPiece {
  BezierPatch patch;
  double bound;  // of its distance to the hull
  int vertex;    // of the hull, near it
  bool operator<(const HullPiece& other) const { return bound < other.bound; }
};

// Largest distance of the control points to the hull, or `most` if that is more.
double control_distance(const BezierPatch& patch, const ConvexHull& hull, double most, int& vertex) {
  for (const Vec4& p : patch.points) most = std::max(most, hull.distance(p.head<3>() / p[3], most, vertex));
  return most;
}

std::pair<BezierPatch, BezierPatch> halve(const BezierPatch& patch, bool in_u) {
  std::pair<BezierPatch, BezierPatch> out{patch, patch};
  halve_net(out.first.points.data(), out.second.points.data(), patch.degree_u, patch.degree_v, in_u);
  return out;
}

double outward_distance(const Shape& shape, const ConvexHull& hull, double resolution) {
  std::priority_queue<HullPiece> pieces;
  double found = 0;
  int vertex = 0;
  const auto add = [&](const BezierPatch& patch) {
    found = std::max(found, hull.distance(evaluate0(patch, 0.5, 0.5), found, vertex));
    pieces.push({patch, control_distance(patch, hull, found, vertex), vertex});
  };
  for (const BezierPatch& patch : shape.patches) {
    BezierPatch moved = patch;
    for (Vec4& p : moved.points) p.head<3>() += p[3] * shape.mass.center;
    add(moved);
  }
  for (int k = 0; k < kMostPieces && pieces.top().bound > found + resolution; ++k) {
    const HullPiece worst = pieces.top();
    pieces.pop();
    vertex = worst.vertex;
    const auto halves = halve(worst.patch, true);
    for (const BezierPatch& half : {halves.first, halves.second}) {
      const auto quarters = halve(half, false);
      add(quarters.first);
      add(quarters.second);
    }
  }
  return pieces.top().bound;
}

// --- fits

// The map that makes the hull's moments those of a unit ball, about its centre of mass; and the metric of
// distances (ConvexFitOptions), by which those along an axis of less than kThin tolerances count the more.
struct Frame {
  Vec3 center;
  Mat3 to, from, metric;
};

Eigen::SelfAdjointEigenSolver<Mat3> principal_axes(const MassProperties& mass) {
  const Mat3 gyration = mass.inertia / mass.volume;
  const Mat3 covariance = 0.5 * gyration.trace() * Mat3::Identity() - gyration;
  return Eigen::SelfAdjointEigenSolver<Mat3>(5 * covariance);
}

// Semi-axes of the ellipsoid of the same moments, ascending.
Vec3 principal_lengths(const MassProperties& mass) {
  return principal_axes(mass).eigenvalues().cwiseMax(0).cwiseSqrt();
}

Frame even_frame(const MassProperties& mass, double tolerance, double thin) {
  const Eigen::SelfAdjointEigenSolver<Mat3> axes = principal_axes(mass);
  const Vec3 lengths = principal_lengths(mass).cwiseMax(thin * tolerance);
  const Mat3 metric =
      axes.eigenvectors() * lengths.cwiseInverse().asDiagonal() * axes.eigenvectors().transpose();
  return {mass.center, axes.operatorInverseSqrt(), axes.operatorSqrt(), metric};
}

double bounding_radius(const ConvexHull& hull, const Vec3& center) {
  double radius = 0;
  for (const Vec3& p : hull.mesh().points) radius = std::max(radius, (p - center).norm());
  return radius;
}

// Signed distance from the hull along the facet that a point's ray meets: the ray's facet is the support
// point of the polar hull, whose vertices are n / h of the facets.
class RayTarget {
 public:
  explicit RayTarget(const ConvexHull& hull) : polar_(polar_points(hull)) {}

  TargetOffset operator()(const Vec3& x, int& hint) const {
    hint = polar_.support(x, hint);
    const Vec3& q = polar_.mesh().points[hint];
    const double h = 1 / q.norm();
    return {h * (q.dot(x) - 1), h * q};
  }

 private:
  ConvexHull polar_;
};

// Directions about which a hull may be one of revolution: its principal axes, which are no help where two
// moments are equal by chance, and the normals of its two largest facets.
std::vector<Vec3> likely_axes(const ConvexHull& hull, const MassProperties& mass) {
  const PrincipalFrame frame = principal_frame(mass.inertia / mass.volume);
  const Mat3 axes = frame.axes.toRotationMatrix();
  std::vector<Vec3> out = {axes.col(0), axes.col(1), axes.col(2)};
  std::vector<Vec3> normals;  // as long as twice the areas
  const auto& p = hull.mesh().points;
  for (const auto& t : hull.mesh().triangles) normals.push_back((p[t[1]] - p[t[0]]).cross(p[t[2]] - p[t[0]]));
  std::vector<Vec3> largest = normals;
  const auto longer = [](const Vec3& a, const Vec3& b) { return a.squaredNorm() > b.squaredNorm(); };
  const size_t few = std::min<size_t>(largest.size(), 20);
  std::partial_sort(largest.begin(), largest.begin() + static_cast<std::ptrdiff_t>(few), largest.end(),
                    longer);
  std::vector<std::pair<double, Vec3>> facets;
  for (size_t k = 0; k < few; ++k) {
    const Vec3 n = largest[k].normalized();
    double area = 0;
    for (const Vec3& m : normals)
      if (m.cross(n).norm() < 1e-5 * m.norm() && m.dot(n) > 0) area += m.norm();
    facets.emplace_back(area, n);
  }
  std::sort(facets.begin(), facets.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
  for (const auto& [area, n] : facets) {
    if (out.size() == 5) break;
    if (out.size() == 4 && out[3].cross(n).norm() < 1e-5) continue;
    out.push_back(n);
  }
  return out;
}

// The convex polygon (r, z), from the lower end of the axis up to the upper one, of a hull turned about an
// axis through `center`.
std::vector<Vec2> profile_about(const ConvexHull& hull, const Vec3& center, const Vec3& axis) {
  std::vector<Vec2> all;
  double low = 1e300, high = -1e300;
  for (const Vec3& x : hull.mesh().points) {
    const double z = axis.dot(x - center);
    all.emplace_back((x - center - z * axis).norm(), z);
    low = std::min(low, z);
    high = std::max(high, z);
  }
  const double size = high - low, same = 1e-6 * size;  // as single precision leaves it
  std::sort(all.begin(), all.end(),
            [](const Vec2& a, const Vec2& b) { return a[1] < b[1] || (a[1] == b[1] && a[0] < b[0]); });
  all.emplace_back(0, high);
  // The side away from the axis of their hull (Andrew's chain).
  std::vector<Vec2> chain = {Vec2(0, low)};
  for (Vec2 p : all) {
    if (p[1] - low < same) p[1] = low;
    if (high - p[1] < same) p[1] = high;
    if (p[0] < same) p[0] = 0;
    while (chain.size() > 1) {
      const Vec2 e = chain.back() - chain[chain.size() - 2], f = p - chain.back();
      if (e[0] * f[1] - e[1] * f[0] > same * (e.norm() + f.norm())) break;
      chain.pop_back();
    }
    if ((p - chain.back()).norm() > same) chain.push_back(p);
  }
  return chain;
}

// Corners left out, the least needed first, while none is further than `error` from the polygon.
std::vector<Vec2> simplified(std::vector<Vec2> polygon, double error) {
  const std::vector<Vec2> all = polygon;
  const auto distance = [&](const Vec2& p, const std::vector<Vec2>& line) {
    double least = 1e300;
    for (size_t k = 1; k < line.size(); ++k) {
      const Vec2 e = line[k] - line[k - 1];
      const double t = std::clamp((p - line[k - 1]).dot(e) / e.squaredNorm(), 0.0, 1.0);
      least = std::min(least, (p - line[k - 1] - t * e).norm());
    }
    return least;
  };
  while (polygon.size() > 3) {
    size_t best = 0;
    double least = error;
    for (size_t k = 1; k + 1 < polygon.size(); ++k) {
      std::vector<Vec2> shorter = polygon;
      shorter.erase(shorter.begin() + static_cast<std::ptrdiff_t>(k));
      // The corner itself is mostly what is furthest: most others need not be looked at.
      double most = distance(polygon[k], shorter);
      for (size_t i = 0; i < all.size() && most <= least; ++i)
        most = std::max(most, distance(all[i], shorter));
      if (most <= least) least = most, best = k;
    }
    if (best == 0) break;
    polygon.erase(polygon.begin() + static_cast<std::ptrdiff_t>(best));
  }
  return polygon;
}

Vec3 ray(int face, double u, double v) {
  return cube_direction(face, std::tan((2 * u - 1) * M_PI / 4), std::tan((2 * v - 1) * M_PI / 4))
      .normalized();
}

std::string percent(double x) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g %%", 100 * x);
  return text;
}

// How an error falls as a power of the number of spans, from the last two it was found for.
class ErrorFall {
 public:
  void add(int spans, double error) {
    if (spans_ > 0 && spans > spans_) power_ = std::log(error_ / error) / std::log(spans / double(spans_));
    spans_ = spans;
    error_ = error;
  }
  double at(int spans) const {
    return spans > spans_ && power_ < 1e9 ? error_ * std::pow(spans_ / double(spans), power_) : 0;
  }

 private:
  int spans_ = 0;
  double error_ = 0, power_ = 1e10;
};

class HullFitter {
 public:
  // `spline_points`: the most of splines, where that is less than the most of any body; 0: any number.
  HullFitter(const ConvexHull& hull, const HullFitOptions& options, double thin, double volume_error,
             size_t spline_points = 0)
      : hull_(hull),
        options_(options),
        spline_points_(spline_points > 0 ? spline_points : options.most_points),
        volume_error_(volume_error),
        mass_(hull.properties()) {
    radius_ = bounding_radius(hull, mass_.center);
    tolerance_ = options.tolerance * radius_;
    frame_ = even_frame(mass_, tolerance_, thin);
  }

  HullFit run() {
    if (options_.spans == 0 && try_sphere()) return best_;
    const ConvexHull even_hull = hull_.image(frame_.to, -frame_.to * frame_.center);
    const RayTarget target(even_hull);
    const auto& p = even_hull.mesh().points;
    for (const auto& t : even_hull.mesh().triangles)
      face_area_ = std::max(face_area_, 0.5 * (p[t[1]] - p[t[0]]).cross(p[t[2]] - p[t[0]]).norm());
    const bool any = options_.spans == 0;
    int further = 0;
    for (const auto& [degree, spans] : kLadder) {
      if ((!any && spans != options_.spans) || too_many(degree, spans)) continue;
      if (spans > 1 && any && (try_revolution() || try_faces(points_of(degree, spans)))) return best_;
      if (any && too_coarse(degree, spans)) continue;
      if (any && spans > 1 && dents_ == kMostDents) break;
      if (any && spans > 1 && !polynomials_may_do(even_hull)) break;
      if (try_rung(degree, spans, target)) return best_;
      if (!best_.shape || further++ < kFurther) continue;
      if (best_.shape->patch_curvature.min_radius > 0) return best_;
      further = 0;
      break;  // no ball rolls inside of it: its contacts would be dear
    }
    for (int degree : {3, 4})
      if (!any && try_gauge(degree, options_.spans, even_hull)) return best_;
    for (const auto& [degree, spans] : kGaugeLadder) {
      if (!any || too_many(degree, spans)) break;
      if (try_faces(points_of(degree, spans))) return best_;
      if (!gauge_may_do(spans, even_hull)) continue;
      if (try_gauge(degree, spans, even_hull)) return best_;
      if (best_.shape && further++ == kFurther) break;
    }
    if (any && !best_.shape && spline_points_ == 0 && try_faces(kMostFaces * kPointsPerFace)) return best_;
    if (best_.shape) return best_;  // its convexity is measured, not proven
    if (any && spline_points_ == 0 && (try_few_faces() || try_polyhedron(kMostFacesAtLast))) return best_;
    if (best_.shape) return best_;
    if (spline_points_ > 0)
      throw ShapeError("no body of at most " + std::to_string(spline_points_) +
                       " control points is within the tolerance of " + percent(options_.tolerance) +
                       " of the hull");
    throw ShapeError("no body of up to " + std::to_string(most_points_) +
                     " control points is within the tolerance of " + percent(options_.tolerance) +
                     " of the hull" + (least_ < kFar ? "; the best is within " + percent(least_) : "") +
                     ": raise the tolerance, or, as flat faces and sharp edges want many points, take them "
                     "from `make` or `import`");
  }

 private:
  bool try_sphere() {
    double inner = 1e300;
    const auto& p = hull_.mesh().points;
    for (const auto& t : hull_.mesh().triangles) {
      const Vec3 n = (p[t[1]] - p[t[0]]).cross(p[t[2]] - p[t[0]]);
      inner = std::min(inner, n.dot(p[t[0]] - mass_.center) / std::max(n.norm(), 1e-300));
    }
    if (radius_ - inner > 2.5 * tolerance_) return false;
    const double volume_radius = std::cbrt(3 * mass_.volume / (4 * M_PI));
    for (double radius : {volume_radius, 0.5 * (radius_ + inner)}) {
      std::vector<NurbsSurface> body = exact_ellipsoid(Vec3::Constant(radius));
      transform(body, Mat3::Identity(), mass_.center);
      if (too_many(body)) return false;
      if (judge(std::move(body), "sphere")) return true;
    }
    return false;
  }

  static size_t points_of(int degree, int spans) {
    const size_t size = SmoothCube::net_size(degree, spans);
    return kCubeFaces * size * size;
  }

  bool too_many(int degree, int spans) const {
    return spline_points_ > 0 && points_of(degree, spans) > spline_points_;
  }
  bool too_many(const std::vector<NurbsSurface>& body) const {
    return options_.most_points > 0 && control_points(body) > options_.most_points;
  }

  // Faces of a hull that is a polyhedron of up to kMostFaces, 0 where it is not.
  size_t crystal_faces() {
    if (!crystal_faces_) crystal_faces_ = facets(hull_, kMostFaces, face_roundoff()).size();
    return *crystal_faces_;
  }
  double face_roundoff() const { return std::max(kSingleRoundoff, kPlaneShare * options_.tolerance); }

  // Whether the error so far can't fall to the tolerance by going to this rung, or the rung costs too much
  // for what it may bring.
  bool too_coarse(int degree, int spans) {
    if (spans > 1 && dear_crystal(degree, spans)) return true;
    if (!(start_error_ < kFar)) return spans >= kCostlySpans;
    const double gain =
        std::pow(spans / double(start_spans_), kSteepest) * (degree > start_degree_ ? kRaised : 1);
    if (start_error_ > gain * tolerance_ || (spans >= kCostlySpans && start_error_ > kNear * tolerance_))
      return true;
    // With edges, errors fall slowly: as they did, and a little faster.
    int last = spans;
    while (last > 1 && !(polynomial_error_[last - 1] < kFar)) --last;
    if (spans < 3 || last < 2 || !(polynomial_error_[last - 2] < kFar)) return false;
    const double now = polynomial_error_[last - 1], before = polynomial_error_[last - 2];
    const double rate =
        kPolynomialRate + std::max(0.0, std::log(before / now) / std::log(last / (last - 1.0)));
    const double raised = degree > start_degree_ ? kRaisedLater : 1;
    return now * std::pow(last / double(spans), rate) > raised * tolerance_;
  }

  // Whether this rung is left out for a crystal, whose edges polynomials round but slowly: where its lower
  // degree was far off, and where gauge functions do, within a second, with at most half as many points more.
  bool dear_crystal(int degree, int spans) {
    if (crystal_faces() == 0 || gauge_error_ > tolerance_) return false;
    if (degree > 3 && polynomial_error_[spans - 1] > kCrystalNear * tolerance_) return true;
    return 3 * points_of(degree, spans) > 2 * points_of(kGaugeLadder[0][0], kGaugeLadder[0][1]);
  }

  // A body of revolution of few corners, as cylinders and cones are: flat faces and straight sides stay so,
  // rims and tips are rounded.
  bool try_revolution() {
    if (revolution_tried_) return false;
    revolution_tried_ = true;
    for (const Vec3& axis : likely_axes(hull_, mass_)) {
      std::vector<Vec2> polygon = profile_about(hull_, mass_.center, axis);
      if (polygon.size() > kMostProfile) continue;
      Mat3 turn;
      turn << axis.unitOrthogonal(), axis.cross(axis.unitOrthogonal()), axis;
      // The circles lie outside of a faceted hull by up to this, over their radius.
      double outside = 0;
      int vertex = 0;
      for (const Vec2& p : polygon)
        for (int k = 0; k < kRimPoints && p[0] > 0 && outside * p[0] <= 2 * tolerance_; ++k) {
          const double angle = 2 * M_PI * (k + 0.3) / kRimPoints;
          const Vec3 x = mass_.center + turn * Vec3(p[0] * std::cos(angle), p[0] * std::sin(angle), p[1]);
          outside = std::max(outside, hull_.distance(x, outside * p[0], vertex) / p[0]);
        }
      double widest = 0;
      for (const Vec2& p : polygon) widest = std::max(widest, p[0]);
      const double left = 0.97 * tolerance_ - 0.5 * outside * widest;
      if (!(left > 0.2 * tolerance_)) continue;
      for (Vec2& p : polygon) p[0] *= 1 - 0.5 * outside;
      const std::vector<Vec2> few = simplified(polygon, kChordCut * left);
      if (few.size() > kMostCorners) continue;
      const double cut = few.size() < polygon.size() ? kRimCut * left : left;
      std::vector<NurbsSurface> body = revolve(rounded_profile(few, cut));
      if (too_many(body)) continue;
      transform(body, turn, mass_.center);
      const std::string kind =
          "body of revolution, its rims rounded, " + std::to_string(body.size()) + " surfaces";
      if (judge(std::move(body), kind, true)) return true;
    }
    return false;
  }

  // Polyhedra of a few faces, or of no more control points than these.
  bool try_faces(size_t points) {
    const size_t faces = std::clamp(points / kPointsPerFace + 2, kFlatFaces, kMostFaces);
    return try_polyhedron(faces) || try_round_edges(faces);
  }

  // The hull of a few faces with its edges rounded, as far as its corners allow: creases are dear to splines.
  // Rounded coordinates far from the origin leave faces less plane than single precision does near it.
  bool try_polyhedron(size_t most_faces) {
    if (most_faces_tried_ >= most_faces) return false;
    most_faces_tried_ = most_faces;
    for (double roundoff : {face_roundoff(), kSingleRoundoff}) {
      const std::vector<HalfSpace> faces = facets(hull_, most_faces, roundoff);
      if (faces.empty() || !faces_tried_.insert(faces.size()).second) continue;
      if (try_rounded(faces)) return true;
    }
    return false;
  }

  // A polyhedron whose edges are round already, by more than the tolerance allows: of a rounding too small
  // the body stands out of the hull, of one too large it stays behind. Bisection to where both are equal.
  bool try_round_edges(size_t most_faces) {
    if (!large_faces_) large_faces_ = large_faces(hull_);
    for (const std::vector<HalfSpace>& faces : *large_faces_) {
      if (faces.size() > most_faces || !round_edges_tried_.insert(faces.size()).second) continue;
      double low = 0, high = kFar, least = kFar;
      for (const HalfSpace& f : faces) high = std::min(high, f.offset - f.normal.dot(mass_.center));
      std::vector<NurbsSurface> best;
      for (int k = 0; k < kBisections && least > kSurelyNear * tolerance_; ++k) {
        const double rounding = 0.5 * (low + high);
        try {
          const auto body = make_shape("fit", rounded_polyhedron(faces, mass_.center, rounding));
          if (too_many(body->surfaces)) break;
          const HullDistance d = hull_distance(*body, hull_, 0.01 * tolerance_);
          if (d.worst() < least) {
            least = d.worst();
            best = body->surfaces;
          }
          (d.outward > d.inward ? low : high) = rounding;
        } catch (const ShapeError&) {  // too round, or its faces don't close
          high = rounding;
        }
      }
      if (!best.empty() && judge(std::move(best), rounded_kind(faces.size()), true)) return true;
    }
    return false;
  }

  // A polyhedron about the hull of fewer faces than it has; those that are not the hull's are moved inward by
  // nearly half of what it stands out, and its edges rounded by what that leaves of the tolerance.
  bool try_few_faces() {
    for (const auto& [excess, inward] : {std::pair(kExcess, kExcessInward), std::pair(kThinExcess, 0.0)}) {
      std::vector<HalfSpace> faces;
      try {
        faces =
            enclosing_faces(hull_, mass_.center, excess * tolerance_, inward * tolerance_, kMostFacesAtLast);
      } catch (const ShapeError&) {  // flatter than its digits tell
      }
      const size_t own = facets(hull_, kMostFacesAtLast, face_roundoff()).size();
      if (faces.empty() || (own > 0 && own <= faces.size())) continue;
      if (try_rounded(faces, inward * tolerance_)) return true;
    }
    return false;
  }

  static std::string rounded_kind(size_t faces) {
    return "polyhedron of " + std::to_string(faces) + " faces with rounded edges";
  }

  // `inward`: how far inside of the hull faces are.
  bool try_rounded(const std::vector<HalfSpace>& faces, double inward = 0) {
    const std::string kind = rounded_kind(faces.size());
    const auto rounded = [&](double rounding) {
      return make_shape("fit", rounded_polyhedron(faces, mass_.center, rounding));
    };
    double rounding = tolerance_ - inward;
    std::string why;
    const int most = inward > 0 ? kMoreRoundings : kRoundings;
    for (int k = 0, halved = 0; k < most && halved <= kHalvings;) {
      try {
        const auto body = rounded(rounding);
        if (too_many(body->surfaces)) return false;
        const bool to_judge = ++k >= kRoundings;
        if (to_judge && judge(body->surfaces, kind, true)) return true;
        const HullDistance d = to_judge ? judged_ : hull_distance(*body, hull_, 0.01 * tolerance_);
        // A corner's distance grows with it.
        const double cut = (inward > 0 ? d.inward : d.worst()) - inward;
        const double next = rounding * (kAim * tolerance_ - inward) / std::max(cut, kLeastCut * tolerance_);
        rounding = halved > 0 ? std::min(next, rounding) : next;
      } catch (const ShapeError& error) {  // too round for a thin body
        why = error.what();
        rounding *= 0.5;
        k = 0;
        ++halved;
      }
    }
    if (!why.empty()) say(kind + ": " + why);
    return false;
  }

  bool try_rung(int degree, int spans, const RayTarget& target) {
    const SmoothCube cube(degree, spans);
    most_points_ = std::max(most_points_, cube.count());
    const auto start = [&](int f, double u, double v) -> Vec3 {
      if (!start_.empty()) return evaluate(start_[f], u, v);
      return 0.9 * ray(f, u, v);
    };
    const OffsetTarget offset = [&](const Vec3& x, const Vec3&, int& hint) { return target(x, hint); };
    ConvexFit fit;
    fit.points = fit_points(cube, start);
    double aim = std::max(tolerance_, std::min(kFirstAim * radius_, start_error_));
    for (;;) {
      fit = fit_convex(cube, fit.points, offset, aimed_at(aim));
      if (fit.error < start_error_) {
        start_error_ = fit.error;
        start_degree_ = degree;
        start_spans_ = spans;
        start_ = cube.surfaces(fit.points);
      }
      if (fit.error > aim || aim <= tolerance_) break;
      aim = std::max(tolerance_, kAimShare * fit.error);
    }
    ConvexFitOptions free = aimed_at(tolerance_);
    free.slide = kFreeSlide;
    if (fit.error > tolerance_ && fit.error < kSurelyTooCoarse * tolerance_) {
      ConvexFit freed = fit_convex(cube, fit.points, offset, free);
      if (freed.error < fit.error) fit = std::move(freed);
    }
    const double reached = fit.error / radius_;
    const std::string kind = rung_name("", degree, spans, cube.count());
    if (fit.error > 1.5 * tolerance_) {
      polynomial_error_[spans - 1] = std::min(polynomial_error_[spans - 1], fit.error);
      say(kind + (fit.error < kFar ? ": off by about " + percent(reached) : ": not convex"));
      if (fit.error < kFar) least_ = std::min(least_, reached);
      return false;
    }
    double certified = 0;
    bool accepted = false;
    const char* note = "";
    const auto accept = [&](const ConvexFit& found) {
      std::vector<NurbsSurface> body = cube.surfaces(found.points);
      transform(body, frame_.from, frame_.center);
      const bool good = judge(std::move(body), kind, false, note);
      if (certified == 0) certified = judged_.worst();
      accepted = accepted || good;
      return good;
    };
    bool good = accept(fit);
    // A rung that just misses the tolerance may be within it where more is asked of it.
    for (const double share : kStricter) {
      if (good || spans >= kCostlySpans || !(certified > tolerance_) || certified > kNearMiss * tolerance_)
        break;
      ConvexFit strict = fit_convex(cube, fit.points, offset, aimed_at(share * tolerance_));
      if (!(strict.error < fit.error)) break;
      fit = std::move(strict);
      certified = 0;
      note = ", asked to be nearer";
      good = accept(fit);
    }
    double& error = polynomial_error_[spans - 1];
    error = std::min(error, std::max(fit.error, certified));
    note = ", asked to be rounder";
    if (good || fit.error <= tolerance_) raise_curvature(cube, fit, offset, free, accept);
    return accepted;
  }

  // What the first rung of gauge functions can reach tells soon what polynomial patches of about as many
  // points can.
  bool polynomials_may_do(const ConvexHull& even) {
    if (gauge_spans_ == 0) estimate_gauge(kGaugeLadder[0], even);
    return gauge_error_ < kPolynomialGain * tolerance_;
  }

  // What gauge functions of so many spans can reach at all.
  void estimate_gauge(const int (&rung)[2], const ConvexHull& even) {
    GaugeFitOptions options = gauge_options();
    options.least_curvature = kLeastCurvature;
    options.inward *= kSharper;  // so that it goes on beyond the tolerance
    options.outward *= kSharper;
    const double before = gauge_error_;
    gauge_error_ = fit_gauge(rung[0], rung[1], even, options).error * kSharper * kAim * tolerance_;
    if (gauge_spans_ > 0 && rung[1] > gauge_spans_)
      gauge_power_ = kRateGain + std::log(before / gauge_error_) / std::log(rung[1] / double(gauge_spans_));
    gauge_spans_ = rung[1];
    if (gauge_error_ <= tolerance_) return;
    const int count = SmoothCube(rung[0], rung[1]).count();
    most_points_ = std::max(most_points_, count);
    least_ = std::min(least_, gauge_error_ / radius_);
    say(rung_name("rational ", rung[0], rung[1], count) + ": off by about " +
        percent(gauge_error_ / radius_) + " at the least");
  }

  // Whether the error of the last rung can fall to the tolerance with so many spans; the second one tells how
  // fast it does, which is slowly where edges are sharp.
  bool gauge_may_do(int spans, const ConvexHull& even) {
    if (crystal_faces() > 0 && spans >= kCostlyGauge && gauge_error_ > kCostlyNear * tolerance_) return false;
    const auto may = [&] {
      const double falls = std::pow(gauge_spans_ / double(spans), gauge_power_);
      return gauge_spans_ == 0 || gauge_error_ * falls <= kEstimate * tolerance_;
    };
    if (may() && gauge_spans_ == kGaugeLadder[0][1] && spans > kGaugeLadder[1][1])
      estimate_gauge(kGaugeLadder[1], even);
    return may();
  }

  // More points, but sure to converge.
  bool try_gauge(int degree, int spans, const ConvexHull& even) {
    const int count = SmoothCube(degree, spans).count();
    most_points_ = std::max(most_points_, count);
    const std::string kind = rung_name("rational ", degree, spans, count);
    GaugeFitOptions options = gauge_options();
    for (size_t which = 0; which < std::size(kGaugeCurvatures); ++which) {
      const double share = kGaugeCurvatures[which];
      ErrorFall& fall = gauge_fall_[which];
      if (fall.at(spans) > kGaugeHope * tolerance_) continue;  // as curvature lets it fall
      options.least_curvature = std::clamp(share * tolerance_ / radius_, kLeastCurvature, kMostCurvature);
      // A face bulges by no more than from its corners, as low as they may be, to as high as it may be.
      const double bulge = kTriangleBulge * options.least_curvature * face_area_;
      if (which + 1 < std::size(kGaugeCurvatures) && bulge > 2 * tolerance_ / radius_) continue;
      for (int pass = 0; pass < 2; ++pass) {  // what certifies further away is asked to be nearer
        GaugeFit fit = fit_gauge(degree, spans, even, options);
        gauge_error_ = fit.error * kAim * tolerance_;
        gauge_spans_ = spans;
        if (pass == 0) fall.add(spans, gauge_error_);
        if (fit.error > 1 / kAim) break;  // the certificate decides
        transform(fit.surfaces, frame_.from, frame_.center);
        if (judge(std::move(fit.surfaces), kind, false, pass > 0 ? ", asked to be nearer" : "")) return true;
        if (judged_.worst() <= tolerance_) return false;
        options.inward *= std::min(1.0, kAim * tolerance_ / judged_.inward);
        options.outward *= std::min(1.0, kAim * tolerance_ / judged_.outward);
      }
      if (gauge_error_ < kAim * tolerance_ || gauge_error_ > kGaugeGain * tolerance_) break;
    }
    if (gauge_error_ > kAim * tolerance_) {
      say(kind + ": off by about " + percent(gauge_error_ / radius_));
      least_ = std::min(least_, gauge_error_ / radius_);
    }
    return false;
  }

  static std::string rung_name(const std::string& prefix, int degree, int spans, int count) {
    return prefix + (degree == 3 ? "bicubic" : "biquartic") + ", " + std::to_string(spans) + " x " +
           std::to_string(spans) + " spans, " + std::to_string(count) + " control points";
  }

  GaugeFitOptions gauge_options() const {
    GaugeFitOptions options;
    options.inward = kAim * tolerance_;
    options.outward = kOutwardAim * tolerance_;
    options.metric = frame_.metric;
    return options;
  }

  ConvexFitOptions aimed_at(double aim) const {
    ConvexFitOptions options;
    options.tolerance = kAim * aim;
    options.slide = kFirstSlide;
    options.least_curvature =
        std::clamp(kCurvatureShare * options.tolerance / radius_, kLeastCurvature, kMostCurvature);
    options.most_curvature = radius_ / options.tolerance;
    options.metric = frame_.metric;
    return options;
  }

  // Whether a body loads without a dent, is near enough and proven convex, with a ball that rolls inside:
  // keeps it then, and the first one for which that can't be proven, whose contacts are dear. `convex`: by
  // construction; `note`: how this trial of a kind differs from its first.
  bool judge(std::vector<NurbsSurface> surfaces, const std::string& kind, bool convex = false,
             const char* note = "") {
    HullFit now;
    now.surfaces = std::move(surfaces);
    now.radius = radius_;
    now.kind = kind;
    judged_ = {};
    std::vector<std::string> warnings;
    try {
      now.shape = make_shape("fit", now.surfaces, std::nullopt, &warnings);
    } catch (const ShapeError& error) {
      say(kind + note + ": " + error.what());
      return false;
    }
    if (!warnings.empty() || now.shape->concavity > 1e-9 * radius_) {
      say(kind + note + ": dented");
      ++dents_;
      return false;
    }
    now.distance = judged_ = hull_distance(*now.shape, hull_, 0.01 * tolerance_);
    const double error = now.distance.worst() / radius_;
    const CurvatureBounds& curvature = now.shape->patch_curvature;
    const bool proven = (convex || now.shape->proofs.convex) && curvature.min_radius > 0;
    char radii[96];
    std::snprintf(radii, sizeof radii, ", curvature radius %.3g to %.3g of its radius",
                  curvature.min_radius / radius_, curvature.max_radius / radius_);
    say(kind + note + ": within " + percent(error) + radii + (proven ? "" : ", not proven convex"));
    least_ = std::min(least_, error);
    if (error > options_.tolerance) return false;
    if (std::abs(now.shape->mass.volume / mass_.volume - 1) > volume_error_) return false;
    if (proven || !best_.shape) best_ = std::move(now);
    return proven;
  }

  void say(const std::string& line) const {
    if (options_.progress) options_.progress(line);
  }

  const ConvexHull& hull_;
  const HullFitOptions& options_;
  size_t spline_points_;
  double volume_error_;  // of bodies that are taken, at the most
  MassProperties mass_;
  Frame frame_;
  static constexpr double kFar = 1e299;
  int most_points_ = 0;
  double radius_ = 0, tolerance_ = 0, least_ = kFar, start_error_ = kFar;
  std::vector<NurbsSurface> start_;
  std::array<double, 4> polynomial_error_ = {kFar, kFar, kFar, kFar};  // by spans - 1
  int dents_ = 0, start_degree_ = 0, start_spans_ = 0, gauge_spans_ = 0;
  double gauge_error_ = kFar, gauge_power_ = kGaugeSteepest;
  double face_area_ = 0;  // of the hull's largest triangle, where it is about as wide in all directions
  HullDistance judged_;   // of the last body that loaded without a dent
  ErrorFall gauge_fall_[std::size(kGaugeCurvatures)];
  std::optional<size_t> crystal_faces_;
  size_t most_faces_tried_ = 0;   // of polyhedra
  std::set<size_t> faces_tried_;  // of each of them
  std::optional<std::vector<std::vector<HalfSpace>>> large_faces_;
  std::set<size_t> round_edges_tried_;  // numbers of faces
  bool revolution_tried_ = false;
  HullFit best_;
};

}  // namespace

size_t control_points(const std::vector<NurbsSurface>& surfaces) {
  size_t count = 0;
  for (const NurbsSurface& s : surfaces) count += s.points.size();
  return count;
}

HullDistance hull_distance(const Shape& shape, const ConvexHull& hull, double resolution) {
  HullDistance out;
  out.outward = outward_distance(shape, hull, resolution);
  for (const Vec3& p : hull.mesh().points)
    out.inward = std::max(out.inward, distance_to_body(shape, p - shape.mass.center, out.inward));
  return out;
}

namespace {

HullFit fit_near_one(const ConvexHull& hull, const HullFitOptions& options) {
  HullFit fit = HullFitter(hull, options, kThin, std::numeric_limits<double>::infinity()).run();
  const MassProperties own = hull.properties();
  const auto error = [&](const HullFit& f) { return std::abs(f.shape->mass.volume / own.volume - 1); };
  const bool thin = principal_lengths(own)[0] < kThin * options.tolerance * fit.radius;
  if (!thin || error(fit) < kVolumeError) return fit;
  if (options.progress) options.progress("its volume is off by " + percent(error(fit)) + ":");
  const size_t points =
      options.most_points > 0 ? std::min(options.most_points, kStrictPoints) : kStrictPoints;
  try {
    HullFit strict = HullFitter(hull, options, kStrictThin, kVolumeError, points).run();
    if (error(strict) < error(fit)) return strict;
  } catch (const ShapeError&) {  // a body that is so thin wants more points than that
  }
  return fit;
}

}  // namespace

// At a scale at which the radius is about 1, so that no unit of length is too small or too large.
HullFit fit_hull(const ConvexHull& hull, const HullFitOptions& options) {
  const int power = std::ilogb(std::sqrt(2.0) * bounding_radius(hull, hull.properties().center));
  if (power == 0) return fit_near_one(hull, options);
  const ConvexHull near_one = hull.image(std::ldexp(1.0, -power) * Mat3::Identity(), Vec3::Zero());
  HullFit fit = fit_near_one(near_one, options);
  const double scale = std::ldexp(1.0, power);
  transform(fit.surfaces, scale * Mat3::Identity(), Vec3::Zero());
  fit.shape = make_shape("fit", fit.surfaces);
  fit.radius *= scale;
  fit.distance.outward *= scale;
  fit.distance.inward *= scale;
  return fit;
}

}  // namespace nurbs

// Dents: coarse search among samples, then exact supports at the worst of them.
#include "body/convexity.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <utility>

#include "body/joints.h"
#include "body/local_form.h"
#include "body/support.h"
#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

constexpr size_t kClimbs = 4;             // places that are refined
constexpr size_t kInwardPlaces = 8;       // of cells that bend inward, of either kind
constexpr double kLeastDepth = 0.25;      // of the excess: a shallow dent's is about that at least
constexpr int kMostTangents = 40;         // in the search for the hull's plane, per direction ...
constexpr double kTiltTolerance = 1e-10;  // ... or until its rise is known to this, of that at the ends

// Every k-th sample so that at most `most` remain.
std::vector<int> thin_out(size_t count, int most) {
  std::vector<int> chosen;
  const size_t stride = std::max<size_t>((count + most - 1) / most, 1);
  for (size_t i = 0; i < count; i += stride) chosen.push_back(static_cast<int>(i));
  return chosen;
}

// Vectors as one array per coordinate, so that the loops over them vectorise.
struct Columns {
  std::vector<double> x, y, z;
  void add(const Vec3& a) {
    x.push_back(a[0]);
    y.push_back(a[1]);
    z.push_back(a[2]);
  }
  size_t size() const { return x.size(); }
  Vec3 at(size_t i) const { return {x[i], y[i], z[i]}; }
};

// Some of the samples.
struct Clouds {
  Columns points, normals;
  std::vector<SurfacePoint> places;
};

Clouds choose(const std::vector<SurfaceSample>& samples, int most) {
  Clouds clouds;
  for (int i : thin_out(samples.size(), most)) {
    clouds.points.add(samples[i].point);
    clouds.normals.add(samples[i].normal);
    clouds.places.push_back(samples[i].where);
  }
  return clouds;
}

// Largest projection of the points onto each normal.
std::vector<double> sampled_support(const Clouds& c) {
  std::vector<double> support(c.points.size(), -kInfinity);
  for (size_t i = 0; i < c.points.size(); ++i) {
    const double px = c.points.x[i], py = c.points.y[i], pz = c.points.z[i];
    for (size_t j = 0; j < support.size(); ++j) {
      const double p = c.normals.x[j] * px + c.normals.y[j] * py + c.normals.z[j] * pz;
      support[j] = p > support[j] ? p : support[j];
    }
  }
  return support;
}

// Depth of each point below the supporting planes of the normals.
std::vector<double> sampled_depth(const Clouds& c, const std::vector<double>& support) {
  std::vector<double> depth(c.points.size(), kInfinity);
  for (size_t j = 0; j < support.size(); ++j) {
    const double nx = c.normals.x[j], ny = c.normals.y[j], nz = c.normals.z[j], h = support[j];
    for (size_t i = 0; i < depth.size(); ++i) {
      const double below = h - (c.points.x[i] * nx + c.points.y[i] * ny + c.points.z[i] * nz);
      depth[i] = below < depth[i] ? below : depth[i];
    }
  }
  return depth;
}

size_t index_of_largest(const std::vector<double>& v) {
  return static_cast<size_t>(std::max_element(v.begin(), v.end()) - v.begin());
}

// Planes through surface points, in the axes (t1, t2, n) of a dent: the rise of the k-th above the dent's
// point along the direction (a, b, 1) is (a, b, 1) . plane.
using Planes = std::vector<Vec3>;

// A convex function of one variable where it was asked for: a slope there, and one along what is held fixed.
struct Tangent {
  double at, value, slope, across;
};

// Minimum of a convex, piecewise linear function on [-range, range]: where the tangents on either side of it
// meet, which become two of its pieces (Kelley 1960, in one dimension).
template <class Function>
Tangent minimise(const Function& f, double range) {
  Tangent lo = f(-range), hi = f(range);
  if (!(lo.slope < 0)) return lo;
  if (!(hi.slope > 0)) return hi;
  const double enough = kTiltTolerance * (std::abs(lo.value) + std::abs(hi.value));
  for (int i = 0;; ++i) {
    const double apart = hi.slope - lo.slope;
    const double meet = (lo.value - lo.slope * lo.at - (hi.value - hi.slope * hi.at)) / apart;
    Tangent t = f(std::clamp(meet, lo.at, hi.at));
    if (!(t.value > lo.value + lo.slope * (t.at - lo.at) + enough) || i == kMostTangents) {
      t.slope = 0;
      t.across = (hi.slope * lo.across - lo.slope * hi.across) / apart;
      return t;
    }
    (t.slope < 0 ? lo : hi) = t;
  }
}

// The highest of the planes at a tilt, as a function of b.
Tangent highest(const Planes& planes, double a, double b) {
  Tangent most{b, -kInfinity, 0, 0};
  for (const Vec3& p : planes)
    if (const double rise = a * p[0] + b * p[1] + p[2]; rise > most.value) most = {b, rise, p[1], p[0]};
  return most;
}

// The tilt (a, b) at which the planes rise least, and that rise.
Vec3 least_rise(const Planes& planes, double tilt) {
  const auto inner = [&](double a) {
    return minimise([&](double b) { return highest(planes, a, b); }, tilt);
  };
  const auto outer = [&](double a) {
    const Tangent t = inner(a);
    return Tangent{a, t.value, t.across, 0};
  };
  const double a = minimise(outer, tilt).at;
  const Tangent best = inner(a);
  return {a, best.at, best.value};
}

// What the round-off of the normal at a point raises the body by, seen along it: of needles, much.
double raised_by_roundoff(const Shape& shape, const SurfacePoint& at) {
  const BezierPatch& patch = shape.patches[at.patch];
  const LocalForm form = local_form(patch, at.u, at.v);  // beside a pole
  const Jet1 jet = evaluate1(patch, form.u, form.v);
  const double area = jet.su.cross(jet.sv).norm(), size = shape.bounding_radius;
  const double angle = kTangentNoise * size * (jet.su.norm() + jet.sv.norm()) / std::max(area, 1e-300);
  const double raised = 2 * size * std::min(angle, 1.0);
  return raised > kNoDent * size ? raised : 0;
}

// Measures dents at single points of a shape.
class Probe {
 public:
  Probe(const Shape& shape, const Clouds& clouds, double spacing)
      : shape_(shape), clouds_(clouds), spacing_(spacing) {}

  // h(n) - n . x at a point, where that has a normal.
  double excess(const SurfacePoint& at) const {
    const LocalForm f = form(at);
    if (f.in_line()) return 0;  // seen beside it
    double most = 0;
    for (const Vec3& y : supports(f.normal, at)) most = std::max(most, f.normal.dot(y - f.point));
    return std::max(0.0, most - raised_by_roundoff(shape_, at));
  }

  // Distance along the normal from a point to the hull's boundary: by duality the least of h(d) - d . x over
  // the directions d = n + a t1 + b t2, a convex function of (a, b), found by cutting planes (Kelley 1960).
  double depth(const SurfacePoint& at) const {
    const LocalForm f = form(at);
    double upper = excess(at);
    // In a shallow dent the hull's plane is tilted by at most about sqrt(2 excess / radius).
    const double tilt = std::min(kWidestTilt, 4 * std::sqrt(2 * upper / shape_.bounding_radius));
    Mat3 axes;
    axes.col(0) = f.normal.unitOrthogonal();
    axes.col(1) = f.normal.cross(axes.col(0));
    axes.col(2) = f.normal;
    Planes planes = {Vec3::Zero()};  // x itself
    Vec3 best = Vec3::Zero();
    for (int cut = 0; cut < kMostCuts && upper > kNoDent * shape_.bounding_radius; ++cut) {
      const Vec3 d(best[0], best[1], 1);
      const size_t before = planes.size();
      for (const Vec3& y : supports((axes * d).normalized(), at)) {
        planes.push_back(axes.transpose() * (y - f.point));
      }
      double rise = 0;
      for (size_t k = before; k < planes.size(); ++k) rise = std::max(rise, planes[k].dot(d));
      upper = std::min(upper, rise);
      best = least_rise(planes, tilt);
      if (upper - best[2] <= kDepthTolerance * upper) break;
    }
    return upper > kNoDent * shape_.bounding_radius ? upper : 0;
  }

 private:
  LocalForm form(const SurfacePoint& at) const { return local_form(shape_.patches[at.patch], at.u, at.v); }

  // Local support points along unit d: from the best sample and from around `near`, where a shallow dent's
  // rims are.
  std::array<Vec3, 5> supports(const Vec3& d, const SurfacePoint& near) const {
    size_t best = 0;
    double most = -kInfinity;
    for (size_t i = 0; i < clouds_.points.size(); ++i) {
      const double p = d[0] * clouds_.points.x[i] + d[1] * clouds_.points.y[i] + d[2] * clouds_.points.z[i];
      if (p > most) most = p, best = i;
    }
    std::array<Vec3, 5> points;
    points[4] = find_support(shape_, d, &clouds_.places[best]).point;
    for (int side = 0; side < 4; ++side) {
      const double step = side % 2 ? spacing_ : -spacing_;
      const SurfacePoint start = walk(shape_, near, side < 2 ? step : 0, side < 2 ? 0 : step);
      points[side] = find_support(shape_, d, &start).point;
    }
    return points;
  }

  const Shape& shape_;
  const Clouds& clouds_;
  double spacing_;
};

using Measure = std::function<double(const SurfacePoint&)>;

// How often the step is halved, and what a better place is better by, relatively.
struct Climb {
  int rounds;
  double gain;
};
constexpr Climb kToExcess = {12, 0};  // grooves are narrower than samples lie apart
constexpr Climb kToDepth = {kPlaceRounds, kDepthTolerance};

// Largest value of `measure` near `at` within its patch, by compass search; moves `at` there.
double climb(const Measure& measure, SurfacePoint& at, double step, const Climb& how) {
  double best = measure(at);
  for (int round = 0; round < how.rounds; ++round, step *= 0.5) {
    const SurfacePoint from = at;
    for (int side = 0; side < 4; ++side) {
      SurfacePoint next = from;
      double& moved = side < 2 ? next.u : next.v;
      moved = std::clamp(moved + (side % 2 ? step : -step), 0.0, 1.0);
      const double value = measure(next);
      if (value > (1 + how.gain) * best) best = value, at = next;
    }
  }
  return best;
}

// The worst of `places` by `measure`: the few where it is most, refined.
double worst_of(const Measure& measure, const std::vector<SurfacePoint>& places, double step,
                const Climb& how, SurfacePoint& where) {
  std::vector<std::pair<double, SurfacePoint>> found;
  found.reserve(places.size());
  for (const SurfacePoint& place : places) found.push_back({measure(place), place});
  const auto first = [](const auto& a, const auto& b) { return a.first > b.first; };
  std::stable_sort(found.begin(), found.end(), first);
  if (found.size() > kClimbs) found.resize(kClimbs);
  for (auto& [value, place] : found) value = climb(measure, place, step, how);
  const auto& [value, place] = *std::min_element(found.begin(), found.end(), first);
  where = place;
  return value;
}

// A sample of every patch that bends inward by more than its own round-off, if by less than what is noise
// elsewhere: twisted walls between curves that are nearly alike.
std::vector<SurfacePoint> places_hardly_hollow(const std::vector<SurfaceSample>& samples, double size) {
  std::vector<SurfacePoint> places;
  double most = 0;
  for (const SurfaceSample& s : samples) {
    const double hollow = -s.k_min - std::max(s.noise, kHollowNoise / size);
    if (!(hollow > 0 && s.k_min >= -kCurvatureNoise / size)) continue;
    const bool same = !places.empty() && places.back().patch == s.where.patch;
    if (same && hollow <= most) continue;
    if (same)
      places.back() = s.where;
    else
      places.push_back(s.where);
    most = hollow;
  }
  return places;
}

const SurfaceSample& most_concave(const std::vector<SurfaceSample>& samples) {
  const auto bend = [](const SurfaceSample& s) { return s.k_min * s.spacing * s.spacing; };
  return *std::min_element(samples.begin(), samples.end(),
                           [&](const SurfaceSample& a, const SurfaceSample& b) { return bend(a) < bend(b); });
}

// Of the cells that bend inward by more than round-off two of every patch, the worst of all first: that which
// does most, and that which does for its size.
std::vector<SurfacePoint> places_inward(const SurfaceBounds& bounds, double size) {
  struct Worst {
    double bend = 0;
    SurfacePoint where;
  };
  std::vector<std::array<Worst, 2>> of(bounds.even.size());
  for (const auto* leaves : {&bounds.leaves, &bounds.hollows})
    for (const Leaf& leaf : *leaves) {
      if (leaf.bounds.convex || !is_hollow(leaf.bounds, size)) continue;
      const double seen = leaf.bounds.seen_curvature, bend[] = {seen * leaf.cell.du * leaf.cell.dv, seen};
      for (int k = 0; k < 2; ++k)
        if (Worst& worst = of[leaf.cell.patch][k]; bend[k] < worst.bend) worst = {bend[k], leaf.middle};
    }
  std::vector<SurfacePoint> places;
  for (int k = 0; k < 2; ++k) {
    std::vector<Worst> worst;
    for (const auto& w : of)
      if (w[k].bend < 0) worst.push_back(w[k]);
    std::sort(worst.begin(), worst.end(), [](const Worst& a, const Worst& b) { return a.bend < b.bend; });
    if (worst.size() > kInwardPlaces) worst.resize(kInwardPlaces);
    for (const Worst& w : worst) places.push_back(w.where);
  }
  return places;
}

// Some points of every sharp edge that bends outward: faces that are ruled show no curvature there.
std::vector<SurfacePoint> places_on_dented_edges(const PatchLinks& links,
                                                 const std::vector<BezierPatch>& patches) {
  std::vector<SurfacePoint> places;
  visit_creases(links, [&](int patch, int edge) {
    const std::vector<EdgePart> parts = find_dented_parts(patches[patch], edge);
    if (parts.empty()) return;
    for (const size_t k : {size_t{0}, parts.size() / 2, parts.size() - 1}) {
      const Vec2 at = edge_parameters(edge, 0.5 * (parts[k].from + parts[k].to));
      places.push_back({patch, at[0], at[1]});
    }
  });
  return places;
}

}  // namespace

Dent find_dent(const Shape& shape, const std::vector<SurfaceSample>& samples, const SurfaceBounds& bounds,
               const KinkSummary& kinks) {
  const double size = shape.bounding_radius;
  const std::vector<SurfacePoint> inward = places_inward(bounds, size);
  const SurfaceSample& concave = most_concave(samples);
  std::vector<SurfacePoint> places = places_on_dented_edges(shape.links, shape.patches);
  const std::vector<SurfacePoint> hollow = places_hardly_hollow(samples, size);
  const bool clearly = !inward.empty() || !places.empty() || kinks.concave > kNoKink ||
                       kinks.excess > kNoDent * size || concave.k_min < -kCurvatureNoise / size,
             suspect = clearly || !hollow.empty();
  const Clouds clouds = choose(samples, suspect ? kPairsIfDented : kPairsIfConvex);
  const std::vector<double> support = sampled_support(clouds), depth = sampled_depth(clouds, support);
  std::vector<double> excess = support;
  for (size_t j = 0; j < excess.size(); ++j)
    excess[j] -= clouds.normals.at(j).dot(clouds.points.at(j)) + raised_by_roundoff(shape, clouds.places[j]);
  const size_t deepest = index_of_largest(depth), highest = index_of_largest(excess);

  Dent dent;
  dent.depth = kinks.depth;
  dent.where = kinks.deepest;
  dent.excess = kinks.excess;
  if (!suspect && excess[highest] <= kNoDent * size) return dent;

  const size_t per_patch = samples.size() / shape.patches.size();
  const double step = 1 / (std::sqrt(static_cast<double>(per_patch)) - 1);
  const Clouds starts = choose(samples, kDentStarts);
  const Probe probe(shape, starts, step);
  SurfacePoint where;
  places.insert(places.end(), {clouds.places[highest], clouds.places[deepest], concave.where, kinks.deepest});
  places.insert(places.end(), inward.begin(), inward.end());
  const auto excess_at = [&](const auto& at) { return probe.excess(at); };
  const double twisted = hollow.empty() ? 0 : worst_of(excess_at, hollow, step, kToExcess, where),
               seen = std::max(twisted, worst_of(excess_at, places, step, kToExcess, where));
  if (!clearly && seen <= kNoDent * size) return dent;
  double found = worst_of([&](const auto& at) { return probe.depth(at); }, places, step, kToDepth, where);
  dent.excess = std::max({dent.excess, seen, probe.excess(where)});
  // Of walls hardly twisted the hull's plane is lost in round-off.
  found = std::max(found, kLeastDepth * twisted);
  if (found > dent.depth) {
    dent.depth = found;
    dent.where = where;
  }
  return dent;
}

}  // namespace nurbs

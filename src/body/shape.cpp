// From the surfaces of a file to a body: split, joined, turned outward, weighed, centred, checked.
#include "body/shape.h"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "body/bounds.h"
#include "body/connectivity.h"
#include "body/convexity.h"
#include "body/joints.h"
#include "body/mass_properties.h"
#include "body/profile_turn.h"
#include "body/rounding.h"
#include "body/surface_bounds.h"
#include "body/t_junctions.h"
#include "nurbs/knot_removal.h"
#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

// Diagonal of the box, in the file's units: second moments and squared forms stay within doubles.
constexpr double kLeastSize = 1e-30, kMostSize = 1e30;

// Cuts at T-junctions may go round and round a body: they end at so many patches.
constexpr size_t kMostCut = 256, kMostCutOfOne = 8;
constexpr double kGapOfDigits = 1e-6;  // of the tolerance: round-off of joined spans
constexpr double kSameCut = 1e-6;      // of an edge: cuts so near are tried as one

// A shape under construction, with what its messages need.
struct Draft {
  Shape shape;
  std::vector<NurbsSurface> cut;  // the shape's surfaces with the knots at which they are cut into patches
  std::vector<BezierPiece>
      pieces;                // knot rectangle of each Bezier patch; their patches are moved to the shape
  std::vector<bool> turned;  // surfaces whose u and v were exchanged
  std::vector<std::string> warnings;
};

std::string number(double x) {
  std::ostringstream out;
  out.precision(6);
  out << x;
  return out.str();
}

void check_surfaces(const std::vector<NurbsSurface>& surfaces) {
  if (surfaces.empty()) throw ShapeError("no surfaces");
  for (size_t i = 0; i < surfaces.size(); ++i) {
    const std::string defect = find_defect(surfaces[i]);
    if (!defect.empty()) throw ShapeError("patch " + std::to_string(i) + ": " + defect);
  }
}

Vec3 sides_of_box(const std::vector<BezierPatch>& patches) {
  Eigen::AlignedBox3d box;
  for (const BezierPatch& patch : patches) {
    for (const Vec4& p : patch.points) box.extend(Vec3(p.head<3>() / p[3]));
  }
  return box.diagonal();
}
double diagonal(const std::vector<BezierPatch>& patches) {
  return sides_of_box(patches).norm();
}

void split(Draft& draft) {
  Shape& s = draft.shape;
  s.patches.clear();
  s.surface_of_patch.clear();
  draft.pieces.clear();
  for (size_t i = 0; i < draft.cut.size(); ++i) {
    for (BezierPiece& piece : split_to_bezier(draft.cut[i])) {
      s.patches.push_back(std::move(piece.patch));
      s.surface_of_patch.push_back(static_cast<int>(i));
      draft.pieces.push_back(std::move(piece));
    }
  }
}

// "patch 3 edge u=1" of a Bezier patch's edge.
std::string edge_name(const Draft& draft, int patch, int edge) {
  const BezierPiece& piece = draft.pieces[patch];
  const double at[4] = {piece.u0, piece.u1, piece.v0, piece.v1};
  const int surface = draft.shape.surface_of_patch[patch];
  const NurbsSurface& s = draft.shape.surfaces[surface];
  std::string name =
      "patch " + std::to_string(surface) + " edge " + (edge < 2 ? "u=" : "v=") + number(at[edge]);
  const bool whole = edge < 2 ? piece.v0 == s.knots_v[s.degree_v] && piece.v1 == s.knots_v[s.size_v]
                              : piece.u0 == s.knots_u[s.degree_u] && piece.u1 == s.knots_u[s.size_u];
  if (whole) return name;
  const double from = edge < 2 ? piece.v0 : piece.u0, to = edge < 2 ? piece.v1 : piece.u1;
  return name + " (" + (edge < 2 ? "v=" : "u=") + number(from) + ".." + number(to) + ")";
}

size_t most_patches(size_t uncut) {
  return kMostCutOfOne * uncut + kMostCut;
}

// Inserts knots where corners of other patches lie inside edges that nothing matches. A knot runs across its
// surface, and may end inside an edge of the next: false once there is no such place.
bool cut_at_t_junctions(Draft& draft, double tolerance) {
  const Shape& s = draft.shape;
  const std::vector<TJunction> cuts = find_t_junctions(s.patches, s.links, tolerance);
  for (const TJunction& cut : cuts) {
    const BezierPiece& piece = draft.pieces[cut.patch];
    NurbsSurface& surface = draft.cut[s.surface_of_patch[cut.patch]];
    const bool in_v = cut.edge < 2;
    const double from = in_v ? piece.v0 : piece.u0, to = in_v ? piece.v1 : piece.u1,
                 at = from + cut.t * (to - from);
    const std::vector<double>& knots = in_v ? surface.knots_v : surface.knots_u;
    const auto is_same = [&](double knot) {
      return knot > from && knot < to && std::abs(knot - at) <= kSameCut * (to - from);
    };
    // (Large knots close to each other may leave no room.)
    if (!(at > from && at < to) || std::any_of(knots.begin(), knots.end(), is_same)) continue;
    surface = in_v ? swap_uv(insert_knot_u(swap_uv(surface), at)) : insert_knot_u(surface, at);
  }
  return !cuts.empty();
}

// No two sides of a joint, and no points of a pole, are further apart.
double widest_gap(const Shape& s) {
  double widest = 0;
  visit_joints(s.links, [&](int p, int e) {
    const EdgeLink& link = s.links[p][e];
    widest = std::max(widest, link.collapsed ? bound_collapsed_edge(s.patches[p], e)
                                             : bound_joint_gap(s.patches[p], e, s.patches[link.patch], link));
  });
  return widest;
}

// Joins the patches, cut where corners meet edges at such as these take. What is left over, if any.
UnmatchedEdge join_patches(Draft& draft, double tolerance) {
  Shape& s = draft.shape;
  UnmatchedEdge left = connect_patches(s.patches, tolerance, s.links);
  const size_t most = most_patches(s.patches.size());
  for (size_t before = 0; left.patch >= 0 && s.patches.size() != before && s.patches.size() <= most;) {
    before = s.patches.size();
    if (!cut_at_t_junctions(draft, tolerance)) break;
    split(draft);
    left = connect_patches(s.patches, tolerance, s.links);
  }
  return left;
}

// Joins the surfaces cut at as few of their knots as they can do with; false, and nothing changes, if they
// need all, or are no fewer patches, or do not close the body as well as those it has, if they do (`closed`).
bool join_without_needless_knots(Draft& draft, double tolerance, bool closed) {
  std::vector<NurbsSurface> simpler;
  int removed = 0;
  for (const NurbsSurface& surface : draft.shape.surfaces) {
    // The lower degree first: the points come out of it with less round-off for the other.
    const bool turn = surface.degree_v < surface.degree_u;
    int first = 0, second = 0;
    const NurbsSurface once = remove_knots_u(turn ? swap_uv(surface) : surface, &first),
                       twice = remove_knots_u(swap_uv(once), &second);
    simpler.push_back(turn ? twice : swap_uv(twice));
    removed += first + second;
  }
  if (removed == 0) return false;
  // One without gaps stays so: supports cost more where there are any.
  const double own = closed ? widest_gap(draft.shape) : 0;
  const double none = 0.25 * kJointRoundoff / kJoinTolerance * tolerance;
  const double allowed = closed && own <= none ? none : std::max(2 * own, kGapOfDigits * tolerance);
  const size_t patches = draft.shape.patches.size();
  std::swap(draft.cut, simpler);
  split(draft);
  if (join_patches(draft, tolerance).patch < 0 && widest_gap(draft.shape) <= allowed &&
      (draft.shape.patches.size() < patches || !closed))
    return true;
  std::swap(draft.cut, simpler);
  split(draft);
  connect_patches(draft.shape.patches, tolerance, draft.shape.links);
  return false;
}

void connect(Draft& draft) {
  Shape& s = draft.shape;
  const double size = diagonal(s.patches);
  if (!(size > 0)) throw ShapeError("all control points coincide");
  if (!(size >= kLeastSize && size <= kMostSize)) {
    throw ShapeError("the control points' box has a diagonal of " + number(size) + ", must be " +
                     number(kLeastSize) + ".." + number(kMostSize));
  }
  const double tolerance = kJoinTolerance * size;
  UnmatchedEdge left = connect_patches(s.patches, tolerance, s.links);
  const bool closed = left.patch < 0;
  if (join_without_needless_knots(draft, tolerance, closed) || closed) return;
  std::string message = edge_name(draft, left.patch, left.edge) + " has no partner: the surface is open";
  if (left.nearest_patch >= 0 && left.gap <= tolerance) {
    message = edge_name(draft, left.patch, left.edge) + " has no partner: it lies along " +
              edge_name(draft, left.nearest_patch, left.nearest_edge) +
              ", which ends elsewhere and can't be cut there";
  } else if (left.nearest_patch >= 0) {
    message += ", the nearest free edge is " + edge_name(draft, left.nearest_patch, left.nearest_edge) +
               ", " + number(left.gap) + " away (allowed " + number(tolerance) + ")";
  }
  const size_t most = most_patches(s.patches.size());
  left = join_patches(draft, tolerance);
  if (left.patch < 0) return;
  if (s.patches.size() > most)
    message = "the patches are cut otherwise at either side of joints; cut alike they would be more than " +
              std::to_string(most);
  throw ShapeError(message);
}

// One closed body: consistent sides everywhere, and connected.
std::vector<bool> sides_to_turn(const Draft& draft) {
  const int count = static_cast<int>(draft.shape.surfaces.size());
  std::vector<bool> turned;
  std::vector<int> parts;
  if (!orient_surfaces(draft.shape.links, draft.shape.surface_of_patch, count, turned, parts)) {
    throw ShapeError("the patches close on a one-sided surface, which has no inside");
  }
  for (int i = 0; i < count; ++i) {
    if (parts[i] == 0) continue;
    throw ShapeError(
        "patch " + std::to_string(i) +
        " is not connected to patch 0: the surfaces bound more than one body, or are joined by faces of " +
        number(kShortestEdge * kJoinTolerance) + " of its size");
  }
  return turned;
}

// Turns the surfaces marked, and does again what depends on it.
void turn_surfaces(Draft& draft, const std::vector<bool>& turn) {
  if (std::none_of(turn.begin(), turn.end(), [](bool t) { return t; })) return;
  for (size_t i = 0; i < turn.size(); ++i) {
    if (!turn[i]) continue;
    draft.shape.surfaces[i] = swap_uv(draft.shape.surfaces[i]);
    draft.cut[i] = swap_uv(draft.cut[i]);
    draft.turned[i] = !draft.turned[i];
  }
  split(draft);
  join_patches(draft, kJoinTolerance * diagonal(draft.shape.patches));
}

void warn_of_turned(Draft& draft) {
  std::string list;
  size_t count = 0;
  for (size_t i = 0; i < draft.turned.size(); ++i) {
    if (!draft.turned[i]) continue;
    list += (count++ ? ", " : "") + std::to_string(i);
  }
  if (count == 0) return;
  if (count == draft.turned.size()) {
    draft.warnings.push_back("the body was inside out: every patch has been turned to face outward");
  } else {
    draft.warnings.push_back((count == 1 ? "patch " : "patches ") + list + " faced inward and " +
                             (count == 1 ? "has" : "have") + " been turned outward");
  }
}

// Faces every surface outward and weighs the body.
void orient_and_weigh(Draft& draft) {
  Shape& s = draft.shape;
  draft.turned.assign(s.surfaces.size(), false);
  turn_surfaces(draft, sides_to_turn(draft));
  const Vec3 sides = sides_of_box(s.patches);
  const double size = sides.norm();
  if (!(sides.minCoeff() > kLeastVolume * size))
    throw ShapeError("the patches enclose no volume: they are flat");
  bool done = true;
  s.mass = integrate_mass(s.patches, &done);
  if (!done) draft.warnings.push_back("the weights are too uneven for mass and inertia to be right to 1e-11");
  if (s.mass.volume < 0) {
    turn_surfaces(draft, std::vector<bool>(s.surfaces.size(), true));
    s.mass.volume = -s.mass.volume;
    s.mass.inertia = -s.mass.inertia;
  }
  if (!(s.mass.volume > kLeastVolume * size * size * size)) {
    throw ShapeError("the patches enclose no volume, or too little beside their extent: " +
                     number(s.mass.volume) + " in a box of diagonal " + number(size));
  }
  warn_of_turned(draft);
}

void move_to_center(Shape& s) {
  for (BezierPatch& patch : s.patches) {
    for (Vec4& p : patch.points) p.head<3>() -= p[3] * s.mass.center;
  }
}

// Patch and parameters as the file counts them.
std::string place(const Draft& draft, const SurfacePoint& at) {
  const BezierPiece& piece = draft.pieces[at.patch];
  double u = piece.u0 + at.u * (piece.u1 - piece.u0), v = piece.v0 + at.v * (piece.v1 - piece.v0);
  const int surface = draft.shape.surface_of_patch[at.patch];
  if (draft.turned[surface]) std::swap(u, v);
  return "patch " + std::to_string(surface) + ", u=" + number(u) + ", v=" + number(v);
}

// Refuses dents that the convex hull can't stand for, and mentions others.
void judge_dent(Draft& draft, const Dent& dent) {
  const double radius = draft.shape.bounding_radius, allowed = kAllowedDent * radius;
  if (dent.depth > allowed) {
    throw ShapeError("not convex: " + place(draft, dent.where) + ", depth " + number(dent.depth) +
                     " (allowed " + number(allowed) + ")");
  }
  if (dent.depth > kUnmentionedDent * radius) {
    draft.warnings.push_back("not quite convex: " + place(draft, dent.where) + ", depth " +
                             number(dent.depth) + "; contact bridges it with the convex hull");
  }
}

bool is_sphere(const Shape& s) {
  return s.inner_radius >= (1 - kSphere) * s.bounding_radius;
}

// What is within kSphere of a sphere is treated as one: its curvature does not change.
void take_as_sphere(const Shape& s, SurfaceBounds* bounds) {
  bounds->radii = {s.bounding_radius, s.bounding_radius};
  for (PatchRate& patch : bounds->rates)
    for (PatchRate::Cell& cell : patch.cells)
      if (std::isfinite(cell.rate)) cell.rate = static_cast<float>(kSphere * s.bounding_radius);
}

Proofs summarise(const Shape& s, const SurfaceBounds& bounds, const KinkSummary& kinks) {
  Proofs proofs;
  const std::vector<bool> bulging = bulging_patches(s.meridian, s.patches, s.bounding_radius);
  for (const Leaf& leaf : bounds.leaves) {
    const double share = leaf.cell.du * leaf.cell.dv / static_cast<double>(s.patches.size());
    const CellBounds& cell = leaf.bounds;
    const bool swept = !cell.convex && bulging[leaf.cell.patch],
               flat = is_flat(cell, s.bounding_radius) ||
                      (swept && cell.seen_curvature <= kCurvatureNoise / s.bounding_radius);
    if (flat || swept)
      proofs.flat_share += share;
    else if (!cell.convex)
      proofs.unproven_share += share;
    if (!flat && !std::isfinite(cell.rate)) proofs.unrated_share += share;
  }
  proofs.convex = proofs.unproven_share == 0;
  proofs.seen_min = bounds.seen_min;
  proofs.seen_max = bounds.seen_max;
  proofs.seen_rate = bounds.seen_rate;
  for (const PatchRate& patch : bounds.rates)
    for (const PatchRate::Cell& cell : patch.cells)
      if (std::isfinite(cell.rate)) proofs.rate = std::max<double>(proofs.rate, cell.rate);
  proofs.cells = bounds.cells;
  proofs.joint_gap = kinks.gap;
  proofs.opening = kinks.convex;
  proofs.closing = kinks.concave;
  proofs.sphere = is_sphere(s);
  return proofs;
}

// What the search over patches needs (patch_maximum.h).
void enclose_patches(Shape& s) {
  s.bilinear = true;
  for (const BezierPatch& patch : s.patches) {
    s.bilinear &= patch.degree_u == 1 && patch.degree_v == 1;
    Eigen::AlignedBox3d box;
    for (const Vec4& p : patch.points) box.extend(Vec3(p.head<3>() / p[3]));
    PatchBall ball{box.center(), 0};
    for (const Vec4& p : patch.points)
      ball.radius = std::max(ball.radius, (p.head<3>() / p[3] - ball.center).norm());
    ball.radius *= 1 + 8 * kRoundoff;
    s.balls.push_back(ball);
  }
}

// The body's size, form and search tables. Each needs some of those above it.
void measure(Draft& draft) {
  Shape& s = draft.shape;
  enclose_patches(s);
  const RadiusBounds radius = bound_radius(s.patches);
  s.bounding_radius = radius.outer;
  s.inner_radius = radius.inner;
  const KinkSummary kinks = measure_kinks(s.patches, s.links);
  s.smooth = std::max(kinks.convex, kinks.concave) <= kSmoothKink;
  if (kinks.gap > kJointRoundoff * s.bounding_radius) s.joint_slack = kGapsCrossed * kinks.gap;
  s.ellipsoid = find_ellipsoid(s.patches, s.mass.inertia / s.mass.volume);
  s.revolution = find_revolution(s.patches, s.mass.inertia, s.ellipsoid, s.bounding_radius);
  if (s.joint_slack == 0) s.meridian = make_meridian(s.patches, s.revolution, s.bounding_radius);
  if (s.joint_slack > 0 || !(s.revolution.found && s.revolution.error <= kExactTurn * s.bounding_radius))
    s.near_revolution = find_near_revolution(s.patches, s.mass.inertia, s.bounding_radius);
  SurfaceBounds bounds = bound_surface(s, is_sphere(s));
  if (is_sphere(s)) take_as_sphere(s, &bounds);
  const double rounding = least_rounding(s.patches);
  if (rounding < kFarAway) bounds.radii.min_radius = std::max(bounds.radii.min_radius, rounding);
  s.proofs = summarise(s, bounds, kinks);
  if (kinks.pole_gap > kJointRoundoff * s.bounding_radius) s.pole_spread = kinks.pole_gap;
  s.small_kinks = find_small_kinks(s.links, s.bounding_radius);
  s.patch_curvature = {s.small_kinks.inside(bounds.radii.min_radius),
                       s.small_kinks.outside(bounds.radii.max_radius)};
  s.curvature = add_kinks(s.patch_curvature, kinks);
  const Dent dent = find_dent(s, sample_surface(s.patches), bounds, kinks);
  judge_dent(draft, dent);
  s.concavity = dent.depth;
  s.support_excess = dent.excess + s.joint_slack;
  s.core = find_sphero_polyhedron(s);
  if (!s.core.found()) s.ball_hull = find_ball_hull(s);
  if (!s.core.found() && !s.ball_hull.found()) s.inner_balls = find_inner_balls(s);
  if (!s.revolution.found && s.joint_slack == 0) s.round_edges = find_round_edges(s);
  s.edge_curves = find_edge_curves(s);
  s.rates = std::move(bounds.rates);
  s.joints = measure_joint_distance(s);
  s.normal_map = make_normal_map(s, &bounds);
  s.profile_radii = make_profile_radii(s.meridian, s.patches, s.bounding_radius);
  s.atlas = make_atlas(s, kAtlasCells);
}

void check_gyration(const Mat3& given) {
  if (!given.allFinite()) throw ShapeError("gyration must be finite");
  if ((given - given.transpose()).cwiseAbs().maxCoeff() > kGivenAsymmetry * given.cwiseAbs().maxCoeff()) {
    throw ShapeError("gyration must be symmetric");
  }
  const Vec3 m = principal_frame(given).moments;
  const std::string values = number(m[0]) + ", " + number(m[1]) + ", " + number(m[2]);
  if (!(m[0] > 0)) throw ShapeError("gyration must be positive definite: its eigenvalues are " + values);
  if (m[2] > (m[0] + m[1]) * (1 + kGivenExcess)) {
    throw ShapeError("gyration is not that of a body: its eigenvalues are " + values +
                     ", the largest must not exceed the sum of the others");
  }
}

// Mass can't be further from the centre of mass than the body reaches.
void check_size(const Shape& s) {
  const double most = s.principal_gyration[2], allowed = s.bounding_radius * s.bounding_radius;
  if (most > allowed * (1 + kGivenExcess))
    throw ShapeError("gyration is that of a larger body: its largest eigenvalue is " + number(most) +
                     "; it must not exceed the square of the bounding radius, " + number(allowed));
}

void set_gyration(Shape& s, const Mat3& gyration) {
  const PrincipalFrame frame = principal_frame(gyration);
  s.gyration = gyration;
  s.inverse_gyration = gyration.inverse();
  s.principal_gyration = frame.moments;
  s.principal_axes = frame.axes;
  s.sphere_like = frame.moments[2] - frame.moments[0] <= kMomentRoundoff * frame.moments[2];
}

// FNV-1a (Fowler, Noll & Vo) over the bytes of the surfaces.
std::uint64_t content_stamp(const Shape& s) {
  std::uint64_t hash = 0xcbf29ce484222325ull;
  const auto add = [&hash](const void* data, size_t bytes) {
    for (size_t k = 0; k < bytes; ++k)
      hash = (hash ^ static_cast<const unsigned char*>(data)[k]) * 0x100000001b3ull;
  };
  for (const NurbsSurface& surface : s.surfaces) {
    add(surface.knots_u.data(), surface.knots_u.size() * sizeof(double));
    add(surface.knots_v.data(), surface.knots_v.size() * sizeof(double));
    add(surface.points.data(), surface.points.size() * sizeof surface.points[0]);
  }
  return hash;
}

void build(Draft& draft, const std::optional<Mat3>& gyration) {
  check_surfaces(draft.shape.surfaces);
  draft.cut = draft.shape.surfaces;
  split(draft);
  connect(draft);
  orient_and_weigh(draft);
  move_to_center(draft.shape);
  if (gyration) check_gyration(*gyration);
  set_gyration(draft.shape, gyration ? *gyration : Mat3(draft.shape.mass.inertia / draft.shape.mass.volume));
  measure(draft);
  if (gyration) check_size(draft.shape);
  draft.shape.stamp = content_stamp(draft.shape);
  draft.shape.flats = find_flat_features(draft.shape);
  draft.shape.core.edges = find_core_edges(draft.shape);
}

}  // namespace

std::shared_ptr<const Shape> make_shape(const std::string& name, std::vector<NurbsSurface> surfaces,
                                        const std::optional<Mat3>& gyration,
                                        std::vector<std::string>* warnings) {
  Draft draft;
  draft.shape.name = name;
  draft.shape.surfaces = std::move(surfaces);
  try {
    build(draft, gyration);
  } catch (const ShapeError& error) {
    throw ShapeError(name + ": " + error.what());
  }
  if (warnings) {
    for (const std::string& w : draft.warnings) warnings->emplace_back(name).append(": ").append(w);
  }
  return std::make_shared<const Shape>(std::move(draft.shape));
}

}  // namespace nurbs

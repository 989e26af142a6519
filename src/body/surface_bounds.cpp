// Halving of cells, level by level; see surface_bounds.h.
#include "body/surface_bounds.h"

#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <queue>

#include "body/bounds.h"
#include "body/rounding.h"
#include "nurbs/bernstein.h"
#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

// Cells spent on the least radius, over kMostCells: loose, it costs every turning contact of the body a cold
// solve.
constexpr int kLeastRadiusBudget = 4;
constexpr double kSharpBend = 0.02;      // of the bounding radius: a body's least radius
constexpr double kLocalTightness = 0.4;  // of a cell's least radius and the one in its middle
constexpr int kLocalCellsPerPatch = 100;
// The same for the proof of convexity, where no hollow is seen: without it every support is doubted.
constexpr int kConvexBudget = 6;
// And for hollows that the middles of large cells miss.
constexpr int kHuntCells = 6000, kHuntCellsPerPatch = 200;
constexpr int kBlindPerPatch = 4;       // cells without bounds that are gone down into: at tips none come
constexpr double kLeastHollow = 1e-12;  // share of the bounding radius that one may be deep
constexpr double kUnknownBend = 1e6;    // over that radius: of cells without bounds
constexpr double kAsHollow = 2;         // times what is seen: a cell hides nothing worse
constexpr double kAlike = 0.99;         // of what halves hide
// Halvings of a patch on a ball: parameters that still fold are a sliver's.
constexpr int kDeepestOnBall = 10;
constexpr double kPlaneTilt = 1e-6;     // rad: more of a tilt within a patch is no plane's round-off
constexpr double kSurelyTurned = 1e-6;  // least over largest coefficient of a volume: far above round-off
constexpr double kMostBent = 0.1;  // of a curvature: a patch on a ball in which it is known worse is a sliver
constexpr double kBent = 1e-3;     // over the bounding radius: a curvature worth it

bool smooth_pole(const EdgeLink& link, double size) {
  return link.collapsed && link.kink_bound <= kNoKink && link.gap <= kJointRoundoff * size;
}

// Strips at poles first, so that cells lie in one or outside. Of a patch with a pole at either end each half
// has its own; one with poles at neighbouring edges has none that serves.
std::vector<Cell> first_cells(const Shape& shape, int patch) {
  const auto& links = shape.links[patch];
  const Cell whole{patch};
  const auto smooth = [&](int edge) { return smooth_pole(links[edge], shape.bounding_radius); };
  std::vector<Cell> cells;
  for (const int low : {0, 2}) {
    if (!links[low].collapsed && !links[low + 1].collapsed) continue;
    if (links[2 - low].collapsed || links[3 - low].collapsed) return {whole};
    for (const int edge : {low, low + 1}) {
      Cell c = whole;
      const int pole = smooth(edge)                                           ? edge
                       : !links[edge].collapsed && smooth(low + 1 - edge % 2) ? low + 1 - edge % 2
                                                                              : -1;
      if (pole >= 0) c.pole = pole;
      Cell first, second;
      halve(c, edge < 2, &first, &second);
      c = edge % 2 ? second : first;
      while (links[edge].collapsed && (edge < 2 ? c.du : c.dv) > kPoleStrip) {
        Cell lower, upper;
        halve(c, edge < 2, &lower, &upper);
        if (edge % 2) std::swap(lower, upper);
        cells.push_back(upper);
        c = lower;
      }
      cells.push_back(c);
    }
    return cells;
  }
  return {whole};
}

// Bounds of a bilinear patch that is a convex quadrilateral, or a triangle, in a plane up to round-off: of a
// needle, or with a collapsed edge, its parameters are so uneven that enclosures of them show nothing.
std::optional<CellBounds> plane_bounds(const BezierPatch& patch, double size) {
  if (patch.degree_u != 1 || patch.degree_v != 1 || patch.rational) return std::nullopt;
  const auto corner = [&](int i, int j) { return Vec3(patch.point(i, j).head<3>()); };
  const Vec3 a = corner(0, 0), b = corner(0, 1), c = corner(1, 0), d = corner(1, 1);
  const Vec3 twice = 0.5 * ((c - a) + (d - b)).cross((b - a) + (d - c));  // as long as twice the area
  const double area = twice.norm();
  if (!(area > 0)) return std::nullopt;
  const Vec3 n = bilinear_normal(patch);
  if (!(n.dot(twice) > 0)) return std::nullopt;
  double off = 0;
  for (const Vec3& p : {b, c, d})
    off = std::max(off, std::abs(n.dot(p - a)) + std::numeric_limits<double>::epsilon() * (p - a).norm());
  if (!(off <= kNoDent * size)) return std::nullopt;
  // x_u x x_v is bilinear here: positive where it is so at the corners.
  const double jacobian[4] = {n.dot((c - a).cross(b - a)), n.dot((d - b).cross(b - a)),
                              n.dot((c - a).cross(d - c)), n.dot((d - b).cross(d - c))};
  const double least = *std::min_element(jacobian, jacobian + 4);
  if (!(least >= -kNoDent * area)) return std::nullopt;
  // Corners where it vanishes are those of a collapsed edge, towards which the tangents do so too.
  double sure = area;
  for (const double j : jacobian)
    if (j > kNoDent * area) sure = std::min(sure, j);
  const double du = std::max((c - a).norm(), (d - b).norm()), dv = std::max((b - a).norm(), (d - c).norm());
  // Off the plane a tangent goes 2 off at most, and x_uv 4 off: of a needle that is much of an angle, and of
  // a curvature, which a triangle has none of.
  const double tilt = 2 * off * (du + dv) / sure;
  const bool triangle = a == b || a == c || b == d || c == d;
  if (!(tilt < kPlaneTilt && (triangle || 4 * off * size <= kCurvatureNoise * sure))) return std::nullopt;
  CellBounds out;
  out.regular = true;
  out.axis = n;
  out.cone = kNoDent + tilt;
  out.min_radius = size / kCurvatureNoise;
  out.max_radius = out.rate = kInfinity;
  out.speed_u = dv > 0 ? std::max(least, 0.0) / dv : 0;
  out.speed_v = du > 0 ? std::max(least, 0.0) / du : 0;
  return out;
}

// Whether a patch is an arc of a conic moved along a straight line, up to round-off, bulging outward: no
// curvature is negative then, which enclosures of a small part of a large body can't tell from round-off.
bool is_bulging_cylinder(const BezierPatch& patch, double size) {
  const bool along_u = patch.degree_u == 1;
  if ((along_u ? patch.degree_v : patch.degree_u) != 2 || (along_u ? patch.degree_u : patch.degree_v) != 1)
    return false;
  Vec3 ends[2][3];
  for (int k = 0; k < 3; ++k) {
    const Vec4 &a = along_u ? patch.point(0, k) : patch.point(k, 0),
               &b = along_u ? patch.point(1, k) : patch.point(k, 1);
    if (!(std::abs(a[3] / b[3] - 1) <= kNoDent)) return false;
    ends[0][k] = a.head<3>() / a[3];
    ends[1][k] = b.head<3>() / b[3];
  }
  const Vec3 line = ends[1][1] - ends[0][1];
  double off = 0;
  for (int k : {0, 2}) off = std::max(off, (ends[1][k] - ends[0][k] - line).norm());
  const Vec3 *x = ends[0], chord = x[2] - x[0], normal = along_u ? line.cross(chord) : chord.cross(line);
  const double rise = normal.dot(x[1] - x[0]);
  if (!(off <= kNoDent * size && rise > kNoDent * size * normal.norm())) return false;
  // Lines that are not quite parallel twist a small patch: its least curvature is then the square of x_uv
  // over the sides' lengths, over the arc's curvature, below 0.
  const double twist = 4 * off / line.norm(), arc = rise / normal.norm();
  return twist * twist <= kCurvatureNoise / size * arc;
}

// A Bernstein net of two parameters, and the products of such nets.
template <class T>
struct NetForm {
  NetForm(int m, int n, const T& zero) : m(m), n(n), at((m + 1) * (n + 1), zero) {}
  T& operator()(int i, int j) { return at[i * (n + 1) + j]; }
  const T& operator()(int i, int j) const { return at[i * (n + 1) + j]; }
  int m, n;
  std::vector<T> at;
};
template <class T, class S, class Product>
auto multiplied(const NetForm<T>& f, const NetForm<S>& g, const Product& product) {
  using Value = decltype(product(f(0, 0), g(0, 0)));
  NetForm<Value> out(f.m + g.m, f.n + g.n, product(f(0, 0), g(0, 0)) * 0.0);
  std::vector<double> in_u, in_v;
  for (int i = 0; i <= f.m; ++i)
    for (int k = 0; k <= g.m; ++k)
      in_u.push_back(binomial(f.m, i) * binomial(g.m, k) / binomial(f.m + g.m, i + k));
  for (int j = 0; j <= f.n; ++j)
    for (int l = 0; l <= g.n; ++l)
      in_v.push_back(binomial(f.n, j) * binomial(g.n, l) / binomial(f.n + g.n, j + l));
  for (int i = 0; i <= f.m; ++i)
    for (int k = 0; k <= g.m; ++k)
      for (int j = 0; j <= f.n; ++j)
        for (int l = 0; l <= g.n; ++l)
          out(i + k, j + l) += in_u[i * (g.m + 1) + k] * in_v[j * (g.n + 1) + l] * product(f(i, j), g(k, l));
  return out;
}

struct Ball {
  Vec3 center = Vec3::Zero();
  double radius = 0;  // 0: none
  double bent = 0;    // relative error that round-off of positions leaves to curvatures of a small patch ...
  double tilt = 0;    // ... and to its normals, rad
  double width = 0;   // of the patch, length
};

bool may_be_round(const BezierPatch& patch) {
  return patch.rational && patch.degree_u >= 2 && patch.degree_v >= 2;
}

// The ball, if a patch bulges outward on it, up to round-off, and is wide enough to have its curvature; else
// none. |x - c|^2 - r^2 is a rational function, and bounded by its net.
Ball lies_on(Ball ball, const BezierPatch& patch, double size) {
  const int p = patch.degree_u, q = patch.degree_v;
  if (ball.radius == 0 || !may_be_round(patch)) return {};
  NetForm<Vec4> net(p, q, Vec4::Zero());  // about the centre
  double lightest = kInfinity;
  for (int i = 0; i <= p; ++i)
    for (int j = 0; j <= q; ++j) {
      net(i, j) = patch.point(i, j);
      net(i, j).head<3>() -= net(i, j)[3] * ball.center;
      lightest = std::min(lightest, net(i, j)[3]);
    }
  const auto off = multiplied(net, net, [&](const Vec4& a, const Vec4& b) {
    return a.head<3>().dot(b.head<3>()) - ball.radius * ball.radius * a[3] * b[3];
  });
  double most = 0;  // distance from the ball
  for (const double f : off.at)
    most = std::max(most, std::abs(f) / (2 * ball.radius * lightest * lightest) + kRoundoff * ball.radius);
  if (!(most <= kNoDent * size)) return {};
  const Jet1 j = evaluate1(patch, 0.5, 0.5);
  const Vec3 normal = j.su.cross(j.sv);
  if (!(normal.dot(j.s - ball.center) > 0)) return {};
  ball.width = std::min(normal.norm() / std::max(j.su.norm(), j.sv.norm()), ball.radius);
  ball.bent = bent_by(patch) * most * ball.radius / (ball.width * ball.width);
  ball.tilt = bent_by(patch) * most / ball.width;
  return ball.bent < kMostBent ? ball : Ball{};
}

// The ball on which a patch lies, if any.
Ball ball_of(const BezierPatch& patch, double size) {
  if (!may_be_round(patch)) return {};
  // 2 x . c = |x|^2 about a point of it, at eight places all round: of a small patch four lie in a plane.
  Eigen::Matrix<double, 8, 3> places;
  Eigen::Matrix<double, 8, 1> squares;
  const Vec3 middle = evaluate0(patch, 0.5, 0.5);
  int row = 0;
  for (const double u : {0.0, 0.5, 1.0})
    for (const double v : {0.0, 0.5, 1.0}) {
      if (u == 0.5 && v == 0.5) continue;
      const Vec3 x = evaluate0(patch, u, v) - middle;
      places.row(row) = 2 * x.transpose();
      squares[row++] = x.squaredNorm();
    }
  const Vec3 to_center = places.colPivHouseholderQr().solve(squares), center = middle + to_center;
  Ball ball;
  ball.center = center;
  ball.radius = to_center.norm();
  return ball.radius < kLongRadius * size ? lies_on(ball, patch, size) : Ball{};
}

// Whether the net of (x - c) . x_u x x_v shows that a patch on a ball has a normal all over a cell, whatever
// the angle of its parameter lines: fills in all that is known of it then.
void on_ball(const Ball& ball, const BezierPatch& patch, Leaf* leaf) {
  if (ball.radius == 0) return;
  CellBounds& out = leaf->bounds;
  const int p = patch.degree_u, q = patch.degree_v;
  if (!out.regular) {
    NetForm<Vec3> x(p, q, Vec3::Zero()), u(p - 1, q, Vec3::Zero()), v(p, q - 1, Vec3::Zero());
    const std::vector<Vec4> net = net_of(patch, leaf->cell);
    double heaviest = 0, lightest = kInfinity, weight_u = 0, weight_v = 0, speed_u = 0, speed_v = 0;
    Vec3 axis = Vec3::Zero();
    const auto weight = [&](int i, int j) { return net[i * (q + 1) + j][3]; };
    for (int i = 0; i <= p; ++i)
      for (int j = 0; j <= q; ++j) {
        const Vec4& c = net[i * (q + 1) + j];
        x(i, j) = c.head<3>() - c[3] * ball.center;
        axis += x(i, j);
        heaviest = std::max(heaviest, c[3]);
        lightest = std::min(lightest, c[3]);
      }
    for (int i = 0; i <= p; ++i)
      for (int j = 0; j <= q; ++j) {
        if (i < p) {
          u(i, j) = p * (x(i + 1, j) - x(i, j));
          speed_u = std::max(speed_u, u(i, j).norm());
          weight_u = std::max(weight_u, p * std::abs(weight(i + 1, j) - weight(i, j)));
        }
        if (j < q) {
          v(i, j) = q * (x(i, j + 1) - x(i, j));
          speed_v = std::max(speed_v, v(i, j).norm());
          weight_v = std::max(weight_v, q * std::abs(weight(i, j + 1) - weight(i, j)));
        }
      }
    const auto normal = multiplied(u, v, [](const Vec3& a, const Vec3& b) -> Vec3 { return a.cross(b); });
    const auto volume = multiplied(x, normal, [](const Vec3& a, const Vec3& b) { return a.dot(b); });
    const auto [least, most] = std::minmax_element(volume.at.begin(), volume.at.end());
    if (!(*least > kSurelyTurned * *most)) return;
    out.regular = true;
    out.axis = axis.normalized();
    out.cone = 0;
    double farthest = 0;
    for (const Vec3& y : x.at) {  // the surface lies in the cone of its net
      out.cone = std::max(out.cone, std::atan2(out.axis.cross(y).norm(), out.axis.dot(y)));
      farthest = std::max(farthest, y.norm());
    }
    out.cone += ball.tilt;
    const double area = *least / (heaviest * heaviest * heaviest * ball.radius), w2 = lightest * lightest;
    out.speed_u = area * w2 / ((speed_v * heaviest + farthest * weight_v) * leaf->cell.du);
    out.speed_v = area * w2 / ((speed_u * heaviest + farthest * weight_u) * leaf->cell.dv);
    out.doubt = 0;
  }
  out.convex = true;
  out.min_radius = ball.radius * (1 - ball.bent);
  out.max_radius = ball.radius / (1 - ball.bent);
  out.least_curvature = 1 / out.max_radius;
  // Another derivative, as the one from tilt to bend.
  out.rate = ball.bent * ball.radius * bent_by(patch) * ball.radius / ball.width;
}

bool in_pole_strip(const Shape& shape, const Cell& c) {
  const auto& links = shape.links[c.patch];
  return (links[0].collapsed && c.u0 < kPoleStrip) || (links[1].collapsed && c.u0 + c.du > 1 - kPoleStrip) ||
         (links[2].collapsed && c.v0 < kPoleStrip) || (links[3].collapsed && c.v0 + c.dv > 1 - kPoleStrip);
}

// What holds all over a cell holds in its halves, whose own bounds may be wider where they are bent strips.
void inherit(const CellBounds& whole, CellBounds* half) {
  if (whole.regular && (!half->regular || half->cone > whole.cone)) {
    half->regular = true;
    half->axis = whole.axis;
    half->cone = whole.cone;
  }
  half->convex = half->convex || whole.convex;
  half->min_radius = std::max(half->min_radius, whole.min_radius);
  half->max_radius = std::min(half->max_radius, whole.max_radius);
  half->least_curvature = std::max(half->least_curvature, whole.least_curvature);
  half->rate = std::min(half->rate, whole.rate);
  half->speed_u = std::max(half->speed_u, whole.speed_u);
  half->speed_v = std::max(half->speed_v, whole.speed_v);
}

using Halves = std::pair<Leaf, Leaf>;
constexpr int kSplitAtOnce = 16;  // leaves whose halves are enclosed side by side

// A leaf to be halved, of which patch; `ball` may be null.
struct Splitting {
  const BezierPatch* patch;
  Wanted wanted;
  const Ball* ball;
  const Leaf* leaf = nullptr;
  bool in_u = false;
  Halves* to = nullptr;
};

void halve_all(const std::vector<Splitting>& all, int* cells) {
  std::vector<Enclosed> halves;
  halves.reserve(2 * all.size());
  for (const Splitting& s : all) {
    halve(s.leaf->cell, s.in_u, &s.to->first.cell, &s.to->second.cell);
    for (Leaf* half : {&s.to->first, &s.to->second}) halves.push_back({s.patch, &half->cell, s.wanted, {}});
  }
  enclose(halves.data(), static_cast<int>(halves.size()));
  *cells += static_cast<int>(halves.size());
  const Enclosed* next = halves.data();
  for (const Splitting& s : all)
    for (Leaf* half : {&s.to->first, &s.to->second}) {
      half->bounds = (next++)->bounds;
      inherit(s.leaf->bounds, &half->bounds);
      if (s.ball) on_ball(*s.ball, *s.patch, half);
    }
}

// Halves of leaves the better way: where little is known yet both ways are tried, since a needle's cells are
// a thousand times longer than wide. A way is as good as the better half: the other one may hold what makes
// the doubt. Where neither helps the cell is a strip that bends more than it is wide, and is cut across.
// `all` has the likely way; results in its `to`.
void split_all(const std::vector<Splitting>& all, int* cells) {
  halve_all(all, cells);
  std::vector<Splitting> doubtful;
  for (const Splitting& s : all) {
    const CellBounds& b = s.leaf->bounds;
    if (!((b.convex || b.doubt < kLittleDoubt) && b.cone < kWideCone)) doubtful.push_back(s);
  }
  if (doubtful.empty()) return;
  std::vector<Halves> others(doubtful.size());
  for (size_t k = 0; k < doubtful.size(); ++k) {
    doubtful[k].in_u = !doubtful[k].in_u;
    doubtful[k].to = &others[k];
  }
  halve_all(doubtful, cells);
  const auto doubt = [](const Halves& p) { return std::min(p.first.bounds.doubt, p.second.bounds.doubt); };
  size_t next = 0;
  for (const Splitting& s : all) {
    if (next == doubtful.size() || doubtful[next].leaf != s.leaf) continue;
    Halves& other = others[next++];
    const Leaf& leaf = *s.leaf;
    const bool neither = std::min(doubt(*s.to), doubt(other)) >= leaf.bounds.doubt;
    const bool turn = neither ? (leaf.cell.du >= leaf.cell.dv) != s.in_u : doubt(other) < doubt(*s.to);
    if (turn) std::swap(*s.to, other);
  }
}

// Halves leaves that `wants`, level by level, while `cells` is below `most`; `in` says where and how a leaf
// is (but for which way), `see` sees each half before its leaf is replaced.
template <class Wants, class In, class See>
void halve_leaves(const Wants& wants, const In& in, const See& see, int most, std::vector<Leaf>* leaves,
                  int* cells) {
  std::vector<int> level(leaves->size()), next, chosen;
  std::iota(level.begin(), level.end(), 0);
  std::vector<Splitting> splittings;
  std::array<Halves, kSplitAtOnce> halves;
  while (!level.empty() && *cells < most) {
    next.clear();
    for (size_t at = 0; at < level.size();) {
      splittings.clear();
      chosen.clear();
      for (; at < level.size() && static_cast<int>(chosen.size()) < kSplitAtOnce; ++at) {
        const Leaf& leaf = (*leaves)[level[at]];
        if (*cells + 2 * static_cast<int>(chosen.size()) >= most || !wants(leaf)) continue;
        Splitting s = in(leaf);
        s.leaf = &leaf;
        s.in_u = leaf.bounds.split_u;
        s.to = &halves[chosen.size()];
        splittings.push_back(s);
        chosen.push_back(level[at]);
      }
      split_all(splittings, cells);
      for (size_t k = 0; k < chosen.size(); ++k) {
        auto& [a, b] = halves[k];
        see(a);
        see(b);
        Leaf& leaf = (*leaves)[chosen[k]];
        a.depth = b.depth = leaf.depth + 1;
        leaf = a;
        next.push_back(chosen[k]);
        next.push_back(static_cast<int>(leaves->size()));
        leaves->push_back(b);
      }
    }
    level.swap(next);
  }
}

// u = r s / (1 + (r - 1) s), s the parameter of the even patch.
struct Change {
  double ratio = 1;
  double at(double s) const { return ratio == 1 ? s : ratio * s / (1 + (ratio - 1) * s); }
  double slope(double s) const { return ratio / ((1 + (ratio - 1) * s) * (1 + (ratio - 1) * s)); }
  double largest_slope(double from, double to) const { return std::max(slope(from), slope(to)); }
};

// Makes the weights of opposite corners equal on the average, by powers of a ratio; returns the ratios of u,
// v.
std::pair<Change, Change> even_out(BezierPatch* patch) {
  const int m = patch->degree_u, n = patch->degree_v;
  const double a = patch->point(0, 0)[3], b = patch->point(0, n)[3], c = patch->point(m, 0)[3],
               d = patch->point(m, n)[3];
  const auto ratio = [](double first, double last, int degree) {
    const double r = std::pow(first / last, 0.5 / degree);
    return Change{std::abs(r - 1) < kEvenWeights ? 1 : r};
  };
  const Change u = ratio(a * b, c * d, m), v = ratio(a * c, b * d, n);
  for (int i = 0; i <= m; ++i)
    for (int j = 0; j <= n; ++j) patch->point(i, j) *= std::pow(u.ratio, i) * std::pow(v.ratio, j);
  return {u, v};
}

class Bounder {
 public:
  Bounder(const Shape& shape, Wanted wanted)
      : shape_(shape),
        wanted_(wanted),
        patches_(static_cast<int>(shape.patches.size())),
        seen_rate_(shape.patches.size(), 0) {}

  SurfaceBounds run(bool sphere) {
    sphere_ = sphere;
    out_.seen_min = kInfinity;
    out_.even = shape_.patches;
    for (BezierPatch& patch : out_.even) {
      changes_.push_back(even_out(&patch));
      const auto& links = shape_.links[balls_.size()];  // at poles cells are of another kind
      const bool pole = std::any_of(links.begin(), links.end(),
                                    [&](const auto& l) { return smooth_pole(l, shape_.bounding_radius); });
      balls_.push_back(pole ? Ball{} : ball_of(patch, shape_.bounding_radius));
    }
    share_balls();
    for (int p = 0; p < patches_; ++p) {
      if (const auto plane = plane_bounds(out_.even[p], shape_.bounding_radius)) {
        out_.leaves.push_back({Cell{p}, *plane, {}, kDeepestCell});  // nothing is left to find
        ++out_.cells;
        continue;
      }
      const bool bulging = is_bulging_cylinder(shape_.patches[p], shape_.bounding_radius);
      const double known = rounding(shape_.patches[p]);
      // Planes, whose radius is infinite, are looked at all the same.
      const double round = std::max(known < kFarAway ? known : 0, balls_[p].radius * (1 - balls_[p].bent));
      for (Cell& c : first_cells(shape_, p)) {
        Leaf leaf;
        leaf.cell = c;
        leaf.bounds = enclose(out_.even[p], leaf.cell, wanted(leaf.cell));
        on_ball(balls_[p], out_.even[p], &leaf);
        leaf.bounds.min_radius = std::max(leaf.bounds.min_radius, round);
        if (bulging || !(known < kFarAway))
          leaf.bounds.least_curvature = std::max(leaf.bounds.least_curvature, 0.0);
        ++out_.cells;
        see(leaf);
        out_.leaves.push_back(leaf);
      }
    }
    std::vector<Leaf> first = out_.leaves;
    const int most = kMostCells + kMostCellsPerPatch * patches_;
    if (!sphere_)
      halve_while([this](const Leaf& leaf) { return least_loose(leaf); }, kLeastRadiusBudget * most);
    const int base = std::max(most, out_.cells + most / 2);
    halve_while([this](const Leaf& leaf) { return leaf.depth < kDeepestUnproven && unproven(leaf); }, base);
    halve_while([this](const Leaf& leaf) { return !hollow_ && unproven(leaf) && bent(leaf); },
                kConvexBudget * most);
    if (!sphere_) hunt_hollows(std::move(first), out_.cells + kHuntCells + kHuntCellsPerPatch * patches_);
    halve_while([this](const Leaf& leaf) { return radii_loose(leaf); },
                std::max(most, out_.cells + most / 2));
    if (!wanted_.rate) return leave();
    if (bends_sharply())
      halve_while([this](const Leaf& leaf) { return loose_here(leaf); },
                  out_.cells + kLocalCellsPerPatch * patches_);
    begin_rates();
    const int enough = out_.cells + kMostRateCells + kMostCellsPerPatch * patches_;
    halve_while([this](const Leaf& leaf) { return unrated(leaf) && rate_loose(leaf); }, enough);
    halve_while([this](const Leaf& leaf) { return rate_loose(leaf); }, enough);
    return leave();
  }

 private:
  SurfaceBounds leave() {
    finish();
    return std::move(out_);
  }

  // A sliver of a ball tells little of it: a neighbour may know.
  void share_balls() {
    const std::vector<Ball> own = balls_;
    for (int p = 0; p < patches_; ++p)
      for (const EdgeLink& link : shape_.links[p]) {
        if (balls_[p].radius > 0 || smooth_pole(link, shape_.bounding_radius)) break;
        if (link.patch < 0) continue;
        balls_[p] = lies_on(own[link.patch], out_.even[p], shape_.bounding_radius);
      }
  }

  bool wants_rate(const Cell& c) const { return with_rates_ && !in_pole_strip(shape_, c); }
  Wanted wanted(const Cell& c) const { return {wants_rate(c), wanted_.stretch}; }

  // Radii come first, without rates, which cost as much again.
  void begin_rates() {
    with_rates_ = true;
    std::vector<Enclosed> cells;
    std::vector<Leaf*> leaves;
    for (Leaf& leaf : out_.leaves) {
      const Cell& c = leaf.cell;
      if (!leaf.bounds.convex || !wants_rate(c)) continue;
      cells.push_back({&out_.even[c.patch], &c, {true, wanted_.stretch}, {}});
      leaves.push_back(&leaf);
    }
    enclose(cells.data(), static_cast<int>(cells.size()));
    for (size_t k = 0; k < leaves.size(); ++k) {
      Leaf& leaf = *leaves[k];
      inherit(leaf.bounds, &cells[k].bounds);
      leaf.bounds = cells[k].bounds;
      on_ball(balls_[leaf.cell.patch], *cells[k].patch, &leaf);
      see_rate(leaf);
    }
  }
  void see_rate(const Leaf& leaf) {
    const double seen = leaf.bounds.seen_rate;
    double& most = seen_rate_[leaf.cell.patch];
    if (seen < kUselessRate * shape_.bounding_radius) most = std::max(most, seen);
  }

  void see(const Leaf& leaf) {
    const CellBounds& b = leaf.bounds;
    if (b.seen_min > 0) out_.seen_min = std::min(out_.seen_min, b.seen_min);
    if (b.seen_curvature > 0) out_.seen_max = std::max(out_.seen_max, b.seen_max);
    hollow_ |= is_hollow(b, shape_.bounding_radius);
    see_rate(leaf);
  }

  // What is not loose stays so, as what is seen can only move the aims outward: leaves are looked at once.
  template <class Loose>
  void halve_while(const Loose& loose, int most_cells) {
    halve_leaves([&](const Leaf& leaf) { return leaf.depth < kDeepestCell && loose(leaf); },
                 [this](const Leaf& leaf) {
                   const Cell& c = leaf.cell;
                   return Splitting{&out_.even[c.patch], wanted(c), &balls_[c.patch]};
                 },
                 [this](const Leaf& half) { see(half); }, most_cells, &out_.leaves, &out_.cells);
  }

  // The least radius first: with none at all no ball rolls inside, and every answer is dear.
  bool least_loose(const Leaf& leaf) const {
    const bool normals = leaf.bounds.regular || left_as_sliver(leaf);
    return !normals || leaf.bounds.min_radius < out_.seen_min / kRadiusTightness;
  }

  bool left_as_sliver(const Leaf& leaf) const {
    return balls_[leaf.cell.patch].radius > 0 && leaf.depth >= kDeepestOnBall;
  }

  bool unproven(const Leaf& leaf) const {
    const CellBounds& b = leaf.bounds;
    return !left_as_sliver(leaf) && !b.convex && b.seen_curvature > 0 && !is_flat(b, shape_.bounding_radius);
  }

  // How deep a hollow may be, roughly, over the bounding radius, that a leaf has not shown; 0 if none.
  double hidden_hollow(const Leaf& leaf) const {
    const CellBounds& b = leaf.bounds;
    const double size = shape_.bounding_radius;
    if (b.convex || is_flat(b, size) || left_as_sliver(leaf) || leaf.depth >= kDeepestUnproven) return 0;
    const double known = std::max(0.0, -kAsHollow * b.seen_curvature),
                 bend = has_bounds(leaf) ? size * (-b.least_curvature - known) : kUnknownBend;
    return std::max(0.0, bend) * leaf.cell.du * leaf.cell.dv;
  }
  static bool has_bounds(const Leaf& leaf) {
    return leaf.bounds.regular && leaf.bounds.least_curvature > -kInfinity;
  }

  // Goes down into the cells that may hide most, one after the other, `cells` allowing, to where they may
  // hide most: into grooves much narrower than their patch. From its first cells, `leaves`, of patches that
  // the leaves left open: those may have been cut into strips by then.
  void hunt_hollows(std::vector<Leaf> leaves, int cells) {
    std::vector<char> left(patches_, false);
    for (const Leaf& leaf : out_.leaves) left[leaf.cell.patch] |= hidden_hollow(leaf) > kLeastHollow;
    using Entry = std::pair<double, int>;
    std::array<std::priority_queue<Entry>, 2> open;  // with bounds, and without, in turn
    const auto enter = [&](int k) {
      const double hidden = hidden_hollow(leaves[k]);
      if (hidden > kLeastHollow) open[!has_bounds(leaves[k])].push({hidden, k});
    };
    const auto note = [&](const Leaf& leaf) {
      if (is_hollow(leaf.bounds, shape_.bounding_radius)) out_.hollows.push_back(leaf);
    };
    for (int k = 0; k < static_cast<int>(leaves.size()); ++k)
      if (left[leaves[k].cell.patch]) {
        note(leaves[k]);
        enter(k);
      }
    int blind = kBlindPerPatch * patches_;
    for (int turn = 0; out_.cells < cells; turn = 1 - turn) {
      const bool seeing = open[1].empty() || blind == 0 || (turn == 0 && !open[0].empty());
      auto& next = open[seeing ? 0 : 1];
      if (next.empty()) break;
      if (!seeing) --blind;
      int k = next.top().second;
      next.pop();
      while (hidden_hollow(leaves[k]) > kLeastHollow) {
        leaves.push_back(halve_either_way(&leaves[k]));
        const int other = static_cast<int>(leaves.size()) - 1;
        note(leaves[k]);
        note(leaves[other]);
        const bool worse = hidden_hollow(leaves[other]) > hidden_hollow(leaves[k]);
        enter(worse ? k : other);
        if (worse) k = other;
      }
    }
  }
  // The way that leaves less hidden, or across. *leaf becomes the first half; returns the second.
  Leaf halve_either_way(Leaf* leaf) {
    const int p = leaf->cell.patch;
    Halves ways[2];
    std::vector<Splitting> splittings;
    for (const bool in_u : {false, true})
      splittings.push_back({&out_.even[p], wanted(leaf->cell), &balls_[p], leaf, in_u, &ways[in_u]});
    halve_all(splittings, &out_.cells);
    const auto hidden = [&](const Halves& h) { return hidden_hollow(h.first) + hidden_hollow(h.second); };
    const double along[] = {hidden(ways[0]), hidden(ways[1])};
    const bool alike = std::min(along[0], along[1]) > kAlike * std::max(along[0], along[1]);
    auto& [a, b] = ways[alike ? leaf->cell.du >= leaf->cell.dv : along[1] < along[0]];
    a.depth = b.depth = leaf->depth + 1;
    see(a);
    see(b);
    *leaf = a;
    return b;
  }

  bool bent(const Leaf& leaf) const { return leaf.bounds.seen_curvature > kBent / shape_.bounding_radius; }

  bool radii_loose(const Leaf& leaf) const {
    const CellBounds& b = leaf.bounds;
    if (!b.convex || sphere_) return false;
    return b.min_radius < out_.seen_min / kRadiusTightness || b.max_radius > kRadiusTightness * out_.seen_max;
  }

  // Somewhere, so that elsewhere its least radius says nothing: tips, needles' ends, hardly rounded edges.
  bool bends_sharply() const {
    return std::any_of(out_.leaves.begin(), out_.leaves.end(), [this](const Leaf& leaf) {
      return leaf.bounds.min_radius < kSharpBend * shape_.bounding_radius;
    });
  }
  // As far as the grids of radii (PatchRate) can tell.
  bool loose_here(const Leaf& leaf) const {
    return std::max(leaf.cell.du, leaf.cell.dv) > 0.5 / kRateCells &&
           leaf.bounds.min_radius < kLocalTightness * leaf.bounds.seen_min;
  }

  bool unrated(const Leaf& leaf) const { return !(leaf.bounds.rate < kInfinity) && wants_rate(leaf.cell); }

  bool rate_loose(const Leaf& leaf) const {
    const CellBounds& b = leaf.bounds;
    if (sphere_) return b.convex && unrated(leaf);
    if (!b.convex || b.seen_rate == 0 || b.seen_rate > kUselessRate * shape_.bounding_radius) return false;
    const double floor = std::max(kRateFloor * seen_rate_[leaf.cell.patch], kSmallRate * out_.seen_max);
    return b.rate > kRateTightness * std::max(b.seen_rate, floor);
  }

  void set_middle(Leaf* leaf) const {
    const Cell& c = leaf->cell;
    const auto& [u, v] = changes_[c.patch];
    leaf->middle = {c.patch, u.at(c.u0 + 0.5 * c.du), v.at(c.v0 + 0.5 * c.dv)};
  }

  void finish() {
    CurvatureBounds& radii = out_.radii;
    radii.min_radius = kInfinity;
    for (Leaf& leaf : out_.hollows) set_middle(&leaf);
    for (Leaf& leaf : out_.leaves) {
      set_middle(&leaf);
      radii.min_radius = std::min(radii.min_radius, leaf.bounds.min_radius);
      radii.max_radius = std::max(radii.max_radius, leaf.bounds.max_radius);
    }
    for (const double rate : seen_rate_) out_.seen_rate = std::max(out_.seen_rate, rate);
    fill_rates();
  }

  // The grids, each cell from the leaves that reach into it or the cells around it.
  void fill_rates() {
    constexpr int n = kRateCells;
    PatchRate::Cell none;
    none.rate = 0;
    none.speed_u = none.speed_v = none.least = std::numeric_limits<float>::infinity();
    out_.rates.resize(patches_);
    for (PatchRate& r : out_.rates) r.cells.assign(n * n, none);
    const auto up = [](double x) {
      return x == 0 ? 0.0f : std::nextafter(static_cast<float>(x), std::numeric_limits<float>::infinity());
    };
    const auto down = [](double x) { return std::nextafter(static_cast<float>(x), 0.0f); };
    // Cells that a leaf or its rim touches, and those around them.
    const auto first_of = [](double x) { return static_cast<int>(std::floor(x * n - kGridRoundoff)) - 1; };
    const auto last_of = [](double x) { return static_cast<int>(std::floor(x * n + kGridRoundoff)) + 1; };
    for (const Leaf& leaf : out_.leaves) {
      const Cell& c = leaf.cell;
      const CellBounds& b = leaf.bounds;
      const auto& [u, v] = changes_[c.patch];
      const double fastest_u = u.largest_slope(c.u0, c.u0 + c.du),
                   fastest_v = v.largest_slope(c.v0, c.v0 + c.dv);
      const int i0 = first_of(u.at(c.u0)), i1 = last_of(u.at(c.u0 + c.du)), j0 = first_of(v.at(c.v0)),
                j1 = last_of(v.at(c.v0 + c.dv));
      for (int i = std::max(i0, 0); i <= std::min(i1, n - 1); ++i)
        for (int j = std::max(j0, 0); j <= std::min(j1, n - 1); ++j) {
          PatchRate::Cell& cell = out_.rates[c.patch].cells[i * n + j];
          cell.rate = std::max(cell.rate, up(b.rate));
          cell.speed_u = std::min(cell.speed_u, down(b.speed_u / fastest_u));
          cell.speed_v = std::min(cell.speed_v, down(b.speed_v / fastest_v));
          cell.least = std::min(cell.least, down(b.min_radius));
        }
    }
  }

  const Shape& shape_;
  const Wanted wanted_;
  const int patches_;
  bool with_rates_ = false, sphere_ = false, hollow_ = false;
  std::vector<std::pair<Change, Change>> changes_;
  std::vector<double> seen_rate_;
  std::vector<Ball> balls_;
  SurfaceBounds out_;
};

}  // namespace

LocalRate rate_near(const PatchRate& patch, const SurfacePoint& at, Alike alike) {
  constexpr int n = kRateCells;
  const int i = std::clamp(static_cast<int>(at.u * n), 0, n - 1),
            j = std::clamp(static_cast<int>(at.v * n), 0, n - 1);
  const PatchRate::Cell& cell = patch.cells[i * n + j];
  // To the rim of the three by three cells around, within the patch.
  const auto across = [](double x, int k) {
    return std::min(x - std::max(k - 1.0, 0.0) / n, std::min(k + 2.0, 1.0 * n) / n - x);
  };
  double room = std::numeric_limits<double>::infinity();
  if (alike != Alike::along_u) room = std::min(room, cell.speed_u * across(at.u, i));
  if (alike != Alike::along_v) room = std::min(room, cell.speed_v * across(at.v, j));
  return {cell.rate, std::max(room, 0.0), cell.least};
}

bool is_flat(const CellBounds& b, double size) {
  const double noise = kCurvatureNoise / size;
  return b.regular && !b.convex && b.least_curvature >= -noise && b.seen_curvature <= noise;
}

bool is_hollow(const CellBounds& b, double size) {
  return b.seen_curvature < -kCurvatureNoise / size;
}

SurfaceBounds bound_surface(const Shape& shape, bool sphere, Wanted wanted) {
  return Bounder(shape, wanted).run(sphere);
}

namespace {

// Halves leaves while they are loose and `spent` is below `cells`.
template <class Loose>
void refine(const Loose& loose, int cells, Wanted wanted, int* spent, SurfaceBounds* bounds) {
  halve_leaves(
      [&](const Leaf& leaf) { return loose(leaf.bounds) && leaf.cell.du * leaf.cell.dv >= kLeastNormalCell; },
      [&](const Leaf& leaf) {
        return Splitting{&bounds->even[leaf.cell.patch], wanted, nullptr};
      },
      [](const Leaf&) {}, cells, &bounds->leaves, spent);
}

}  // namespace

void refine_normals(double round, double flat, double spread, int cells, SurfaceBounds* bounds) {
  int spent = 0;
  // What has no normals yet first: it would leave nothing of the map.
  for (const bool wide : {true, false}) {
    const auto loose = [&](const CellBounds& b) {
      if (!b.regular || b.cone > (wide ? kNormalCap : b.convex ? round : flat)) return true;
      return !wide && b.convex && b.max_radius > spread * b.seen_max;
    };
    refine(loose, cells, {}, &spent, bounds);
  }
}

void refine_stretches(double cone, double tightness, int cells, SurfaceBounds* bounds) {
  int spent = 0;
  for (const double first :
       {2.0, 1.4, 1.2, 1.0}) {  // what is worst of all first: the rest may be all there is
    const double aim = std::max(first, tightness);
    const auto loose = [&](const CellBounds& b) {
      return b.regular && b.convex && b.cone > cone && aim * b.stretch.least < b.seen_min;
    };
    refine(loose, cells, {false, true}, &spent, bounds);
  }
}

}  // namespace nurbs

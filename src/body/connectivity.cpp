// Edge matching: candidates by end points and middle, then curve against curve.
#include "body/connectivity.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "body/joints.h"
#include "body/local_form.h"
#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

struct Edge {
  int patch = 0, edge = 0;
  std::array<Vec3, kEdgeSamples> at;  // points at t = 0, 1/4, .., 1
  double length = 0;                  // how far its control points are from the first at most
  bool collapsed = false;
};

Vec3 edge_point(const BezierPatch& patch, int edge, double t) {
  const Vec2 p = edge_parameters(edge, t);
  return evaluate0(patch, p[0], p[1]);
}

Edge make_edge(const BezierPatch& patch, int index, int edge, double tolerance) {
  Edge e;
  e.patch = index;
  e.edge = edge;
  for (int k = 0; k < kEdgeSamples; ++k) e.at[k] = edge_point(patch, edge, k / (kEdgeSamples - 1.0));
  e.length = 0.5 * bound_collapsed_edge(patch, edge);
  e.collapsed = e.length <= tolerance;
  return e;
}

// Parameter of the point of an edge closest to x: golden-section search about every sample of a row that is
// nearer than those beside it, for the sides of a hairpin may both be near.
double closest_parameter(const BezierPatch& patch, int edge, const Vec3& x) {
  const auto distance2 = [&](double t) { return (edge_point(patch, edge, t) - x).squaredNorm(); };
  std::array<double, kProjectionSamples + 1> at;
  for (int k = 0; k <= kProjectionSamples; ++k) at[k] = distance2(k / double(kProjectionSamples));
  double best = 0, least = std::numeric_limits<double>::infinity();
  for (int k = 0; k <= kProjectionSamples; ++k) {
    if ((k > 0 && at[k - 1] < at[k]) || (k < kProjectionSamples && at[k + 1] <= at[k])) continue;
    double lo = std::max(0, k - 1) / double(kProjectionSamples),
           hi = std::min(kProjectionSamples, k + 1) / double(kProjectionSamples);
    constexpr double kGolden = 0.6180339887498949;
    for (int i = 0; i < kProjectionSections; ++i) {
      const double a = hi - kGolden * (hi - lo), b = lo + kGolden * (hi - lo);
      const bool left = distance2(a) < distance2(b);
      (left ? hi : lo) = left ? b : a;
    }
    const double found = distance2(0.5 * (lo + hi));
    if (found < least) least = found, best = 0.5 * (lo + hi);
  }
  return best;
}

constexpr double kOnCurve = 1e-12;     // of an edge's chord: what is no further away lies on the edge
constexpr double kNoGap = 1e-6;        // of the tolerance: sides so near have the same parameters
constexpr double kNotByChance = 1e-2;  // share of a gap that better parameters leave
constexpr double kShortGap = 1e-3;     // of a short edge: what its partner may be off

// Largest distance of the samples of `a` from the curve `b`, whatever the parametrisation.
double reach_from(const std::vector<BezierPatch>& patches, const Edge& a, const Edge& b) {
  double reach = 0;
  for (const Vec3& x : a.at) {
    const double t = closest_parameter(patches[b.patch], b.edge, x);
    reach = std::max(reach, (edge_point(patches[b.patch], b.edge, t) - x).norm());
  }
  return reach;
}

// The same where their ends agree. The middle of b must lie on a too: otherwise b could be a longer curve
// between the same ends.
double curve_gap(const std::vector<BezierPatch>& patches, const Edge& a, const Edge& b) {
  const Vec3& middle = b.at[kEdgeSamples / 2];
  const double t = closest_parameter(patches[a.patch], a.edge, middle);
  return std::max(reach_from(patches, a, b), (edge_point(patches[a.patch], a.edge, t) - middle).norm());
}

// Two edges that agree. `a` < `b` are indices; the rest is a's link to b, see EdgeLink.
struct Candidate {
  int a = 0, b = 0;
  bool reversed = false, projected = false;
  double ratio = 1, gap = 0;
};

EdgeLink link_of(const Candidate& c, const Edge& to) {
  EdgeLink link;
  link.patch = to.patch;
  link.edge = to.edge;
  link.reversed = c.reversed;
  link.projected = c.projected;
  link.ratio = c.ratio;
  return link;
}

// The same link from the other side.
Candidate turned(Candidate c) {
  std::swap(c.a, c.b);
  if (!c.reversed) c.ratio = 1 / c.ratio;
  return c;
}

bool ends_agree(const Edge& a, const Edge& b, bool reversed, double tolerance) {
  const Vec3& first = reversed ? b.at.back() : b.at.front();
  const Vec3& last = reversed ? b.at.front() : b.at.back();
  return (a.at.front() - first).norm() <= tolerance && (a.at.back() - last).norm() <= tolerance;
}

// The ratio of the map that takes a's point at quarter `k` of its parameter to the closest point of b.
double ratio_between(const std::vector<BezierPatch>& patches, const Edge& a, const Edge& b, bool reversed,
                     int k) {
  const Vec3& x = a.at[k * (kEdgeSamples - 1) / 4];
  const double t = closest_parameter(patches[b.patch], b.edge, x), from = (reversed ? 4 - k : k) / 4.0,
               to = std::clamp(closest_on_edge(patches[b.patch], b.edge, x, t), 1e-6, 1 - 1e-6);
  return to / (1 - to) * (1 - from) / from;
}

// The same from the weights at the ends, exactly: in t / (1 - t) a map of that form multiplies the k-th
// weight by ratio^k. 1 where the degrees differ.
double ratio_of_weights(const std::vector<BezierPatch>& patches, const Edge& a, const Edge& b,
                        bool reversed) {
  const auto weights = [&](const Edge& e, double(&end)[2]) {
    const BezierPatch& patch = patches[e.patch];
    for (int k = 0; k < 2; ++k) {
      const Vec2 at = edge_parameters(e.edge, k);
      end[k] = patch.point(at[0] > 0.5 ? patch.degree_u : 0, at[1] > 0.5 ? patch.degree_v : 0)[3];
    }
    return e.edge < 2 ? patch.degree_v : patch.degree_u;
  };
  double of_a[2], of_b[2];
  const int degree = weights(a, of_a);
  if (weights(b, of_b) != degree) return 1;
  if (reversed) std::swap(of_a[0], of_a[1]);
  return std::pow((of_a[1] / of_a[0]) / (of_b[1] / of_b[0]), 1.0 / degree);
}

void add_candidates(const std::vector<BezierPatch>& patches, const std::vector<Edge>& edges, int first,
                    int second, double tolerance, std::vector<Candidate>& out) {
  const Edge &a = edges[std::min(first, second)], &b = edges[std::max(first, second)];
  for (bool reversed : {false, true}) {
    if (!ends_agree(a, b, reversed, tolerance)) continue;
    Candidate c{std::min(first, second), std::max(first, second), reversed};
    const auto gap = [&](const Candidate& k) {
      return bound_joint_gap(patches[a.patch], a.edge, patches[b.patch], link_of(k, b));
    };
    c.gap = gap(c);
    if (c.gap > kNoGap * tolerance) {  // other parameters may fit better, among rounded digits by chance
      const double share = c.gap > kSameParameters * tolerance ? 0.5 : kNotByChance;
      const auto with = [&](double ratio) {
        Candidate other = c;
        other.ratio = ratio;
        other.gap = gap(other);
        if (other.gap < share * c.gap) c = other;
      };
      with(ratio_of_weights(patches, a, b, reversed));
      // Round a needle's tip the closest point of the middle may be the other side's.
      for (const int quarter : {2, 1, 3})
        if (quarter == 2 || c.gap > tolerance) with(ratio_between(patches, a, b, reversed, quarter));
    }
    const bool closed = (a.at.front() - a.at.back()).norm() <= tolerance;
    if (c.gap > kSameParameters * tolerance && !closed && curve_gap(patches, a, b) <= tolerance) {
      Candidate other = c;
      other.ratio = 1;
      other.projected = true;
      other.gap = gap(other);
      if (c.gap > tolerance || other.gap < kNotByChance * c.gap) c = other;
    }
    if (c.gap <= tolerance) out.push_back(c);
  }
}

// All pairs of edges that agree. Edges are swept in the order of the x coordinate of the middle of their
// ends, which does not depend on direction. An edge no longer than the tolerance, as across a narrow band, is
// one where another is the same to little of its length; else it is taken for a point.
std::vector<Candidate> find_candidates(const std::vector<BezierPatch>& patches,
                                       const std::vector<Edge>& edges, double tolerance) {
  const auto key = [&](int e) { return 0.5 * (edges[e].at.front()[0] + edges[e].at.back()[0]); };
  std::vector<int> order;
  for (int e = 0; e < static_cast<int>(edges.size()); ++e) {
    if (edges[e].length > kShortestEdge * tolerance) order.push_back(e);
  }
  std::sort(order.begin(), order.end(),
            [&](int a, int b) { return key(a) != key(b) ? key(a) < key(b) : a < b; });
  std::vector<Candidate> out;
  for (size_t i = 0; i < order.size(); ++i) {
    for (size_t j = i + 1; j < order.size() && key(order[j]) - key(order[i]) <= tolerance; ++j) {
      const Edge &a = edges[order[i]], &b = edges[order[j]];
      if (a.collapsed != b.collapsed) continue;
      const double allowed = a.collapsed ? kShortGap * std::min(a.length, b.length) : tolerance;
      add_candidates(patches, edges, order[i], order[j], allowed, out);
    }
  }
  std::sort(out.begin(), out.end(), [](const Candidate& p, const Candidate& q) {
    return p.gap != q.gap ? p.gap < q.gap : p.a != q.a ? p.a < q.a : p.b < q.b;
  });
  return out;
}

void join(const Edge& a, const Edge& b, const Candidate& c, PatchLinks& links) {
  links[a.patch][a.edge] = link_of(c, b);
  links[b.patch][b.edge] = link_of(turned(c), a);
}

UnmatchedEdge describe_unmatched(const std::vector<BezierPatch>& patches, const std::vector<Edge>& edges,
                                 const PatchLinks& links, int left) {
  UnmatchedEdge out;
  out.patch = edges[left].patch;
  out.edge = edges[left].edge;
  out.gap = std::numeric_limits<double>::infinity();
  for (int e = 0; e < static_cast<int>(edges.size()); ++e) {
    const bool free = links[edges[e].patch][edges[e].edge].patch < 0 && !edges[e].collapsed;
    if (e == left || !free) continue;
    const double gap = reach_from(patches, edges[left], edges[e]);
    if (gap >= out.gap) continue;
    out.gap = gap;
    out.nearest_patch = edges[e].patch;
    out.nearest_edge = edges[e].edge;
  }
  return out;
}

// Signed angle from the normal of `a` to that of `b` at a common point; positive where b's surface bends
// away. `along` is the direction in which the edge runs with a's surface on its left, seen from outside.
double signed_angle(const Vec3& normal_a, const Vec3& normal_b, const Vec3& along) {
  const double angle = angle_between(normal_a, normal_b);
  return along.cross(normal_a).dot(normal_b) >= 0 ? angle : -angle;
}

// Adds the groove between two sides, along edges ea and eb, that meet at a concave angle; see measure_kinks.
void add_groove(double angle, const LocalForm& a, const LocalForm& b, int p, int ea, int eb,
                const Vec3& outward, KinkSummary& worst) {
  const auto width_of = [](const LocalForm& f, int e) { return (e < 2 ? f.su : f.sv).norm(); };
  const double wa = width_of(a, ea), wb = width_of(b, eb);
  const double ka = normal_curvature(a, outward), kb = normal_curvature(b, outward),
               flatter = std::min(ka, kb);
  double depth = wa > 0 && wb > 0 ? angle * wa * wb / (wa + wb) : 0,
         excess = angle * std::max(wa, wb);  // of straight sides
  if (flatter > 0) {
    const double roots = std::sqrt(ka) + std::sqrt(kb);
    depth = std::min(depth, angle * angle / (2 * roots * roots));
    excess = std::min(excess, angle * angle / (2 * flatter));
  }
  worst.concave = std::max(worst.concave, angle);
  worst.excess = std::max(worst.excess, excess);
  if (depth <= worst.depth) return;
  worst.depth = depth;
  worst.deepest = {p, a.u, a.v};
}

// Of the edge, not of a parameter line beside it, which weights may slant any way; where the edge has none
// (an end at a pole), of the form nearby.
Vec3 edge_tangent(const BezierPatch& patch, int edge, const Vec2& at, const LocalForm& near) {
  const Jet1 jet = evaluate1(patch, at[0], at[1]);
  const Vec3 own = edge < 2 ? jet.sv : jet.su, beside = edge < 2 ? near.sv : near.su;
  const double length = (edge_point(patch, edge, 1) - edge_point(patch, edge, 0)).norm();
  return own.norm() > kNoDirection * length ? own : beside;
}

// What both sides are like at a point of their joint.
struct JointSample {
  Vec2 at;
  LocalForm a, b;
  bool counts;  // an end of the edge may be a pole, where the kink has no meaning; the next sample sees it
  double sine() const { return std::min(a.sine(), b.sine()); }
};

std::array<JointSample, kKinkSamples> sample_joint(const std::vector<BezierPatch>& patches, int p, int e,
                                                   const EdgeLink& link) {
  std::array<JointSample, kKinkSamples> samples;
  for (int k = 0; k < kKinkSamples; ++k) {
    JointSample& s = samples[k];
    const double t = k / (kKinkSamples - 1.0);
    s.at = edge_parameters(e, t);
    s.a = local_form(patches[p], s.at[0], s.at[1]);
    const double guess = link.projected ? projected_parameter(patches[link.patch], link, s.a.point)
                                        : partner_parameter(link, t);
    const Vec2 there =
        edge_parameters(link.edge, closest_on_edge(patches[link.patch], link.edge, s.a.point, guess));
    s.b = local_form(patches[link.patch], there[0], there[1]);
    const bool end = k == 0 || k == kKinkSamples - 1;
    s.counts = !end || (Vec2(s.a.u, s.a.v) == s.at && Vec2(s.b.u, s.b.v) == there);
  }
  return samples;
}

double edge_kink(const std::vector<BezierPatch>& patches, int p, int e, const EdgeLink& link,
                 KinkSummary& worst) {
  double kink = 0, most = 0;
  const bool forward = e == 1 || e == 2;  // the free parameter runs with the patch on its left
  const std::array<JointSample, kKinkSamples> samples = sample_joint(patches, p, e, link);
  for (const JointSample& s : samples) most = std::max(most, s.sine());
  for (const JointSample& s : samples) {
    // Where tangents come into line, normals are what the last digits of the control points make of them.
    if (!s.counts || s.sine() < std::min(kJointSine, kJointSineShare * most)) continue;
    const Vec3 along = (forward ? 1.0 : -1.0) * edge_tangent(patches[p], e, s.at, s.a);
    const double angle = signed_angle(s.a.normal, s.b.normal, along);
    if (angle < 0) add_groove(-angle, s.a, s.b, p, e, link.edge, along.cross(s.a.normal), worst);
    worst.convex = std::max(worst.convex, angle);
    if (std::abs(angle) > std::abs(kink)) kink = angle;
  }
  return kink;
}

double spread_of_normals(const BezierPatch& patch, int edge, double inset) {
  std::array<Vec3, kKinkSamples> normal;
  double longest = 0, spread = 0;
  for (int k = 0; k < kKinkSamples; ++k) {
    Vec2 at = edge_parameters(edge, k / (kKinkSamples - 1.0));
    at[edge < 2 ? 0 : 1] += edge % 2 ? -inset : inset;
    const Jet1 j = evaluate1(patch, at[0], at[1]);
    normal[k] = j.su.cross(j.sv);
    longest = std::max(longest, normal[k].norm());
  }
  const auto is_none = [&](const Vec3& n) {
    return n.norm() <= kVanishing * longest;
  };  // no speed along the edge
  for (const Vec3& a : normal) {
    if (is_none(a)) continue;
    for (const Vec3& b : normal)
      if (!is_none(b)) spread = std::max(spread, angle_between(a, b));
  }
  return spread;
}

// Spread of the normals in the limit at the pole: what is left after extrapolating the part proportional to
// the distance from it, which any smooth pole has.
double pole_kink(const BezierPatch& patch, int edge) {
  const double far = spread_of_normals(patch, edge, 2 * kPoleInset),
               near = spread_of_normals(patch, edge, kPoleInset);
  return std::clamp(2 * near - far, 0.0, M_PI);
}

// Direction, +1 or -1, in which the free parameter of an edge runs round the patch, counter-clockwise being
// +1.
int boundary_sense(int edge) {
  return edge == 1 || edge == 2 ? 1 : -1;
}

}  // namespace

double closest_on_edge(const BezierPatch& patch, int edge, const Vec3& x, double from) {
  double t = from;
  for (int i = 0; i < 8; ++i) {
    const Vec2 p = edge_parameters(edge, t);
    const Jet1 j = evaluate1(patch, p[0], p[1]);
    const Vec3& along = edge < 2 ? j.sv : j.su;
    const double length2 = along.squaredNorm(), before = t;
    if (!(length2 > 0)) break;
    t = std::clamp(t + (x - j.s).dot(along) / length2, 0.0, 1.0);
    if (std::abs(t - before) < kParameterRoundoff) break;
  }
  return t;
}

double projected_parameter(const BezierPatch& partner, const EdgeLink& link, const Vec3& x, double guess) {
  if (guess >= 0) {
    const double t = closest_on_edge(partner, link.edge, x, guess);
    const Vec3 chord = edge_point(partner, link.edge, 1) - edge_point(partner, link.edge, 0);
    if ((edge_point(partner, link.edge, t) - x).norm() <= kOnCurve * chord.norm()) return t;
  }
  return closest_on_edge(partner, link.edge, x, closest_parameter(partner, link.edge, x));
}

std::vector<Vec4> edge_net(const BezierPatch& patch, int edge) {
  std::vector<Vec4> net;
  const int last = edge < 2 ? patch.degree_v : patch.degree_u;
  for (int k = 0; k <= last; ++k)
    net.push_back(edge < 2 ? patch.point(edge == 0 ? 0 : patch.degree_u, k)
                           : patch.point(k, edge == 2 ? 0 : patch.degree_v));
  return net;
}

UnmatchedEdge connect_patches(const std::vector<BezierPatch>& patches, double tolerance, PatchLinks& links) {
  links.assign(patches.size(), {});
  std::vector<Edge> edges;
  for (size_t p = 0; p < patches.size(); ++p) {
    for (int e = 0; e < 4; ++e) {
      edges.push_back(make_edge(patches[p], static_cast<int>(p), e, tolerance));
      links[p][e].collapsed = edges.back().collapsed;
    }
  }
  for (const Candidate& c : find_candidates(patches, edges, tolerance)) {
    const Edge &a = edges[c.a], &b = edges[c.b];
    if (links[a.patch][a.edge].patch < 0 && links[b.patch][b.edge].patch < 0) join(a, b, c, links);
  }
  for (size_t i = 0; i < edges.size(); ++i) {
    const EdgeLink& link = links[edges[i].patch][edges[i].edge];
    if (link.patch < 0 && !link.collapsed)
      return describe_unmatched(patches, edges, links, static_cast<int>(i));
  }
  return {};
}

KinkSummary measure_kinks(const std::vector<BezierPatch>& patches, PatchLinks& links) {
  KinkSummary worst;
  for (size_t p = 0; p < links.size(); ++p) {
    for (int e = 0; e < 4; ++e) {
      EdgeLink& link = links[p][e];
      if (link.collapsed) {
        link.gap = bound_collapsed_edge(patches[p], e);
        link.kink_bound = std::min(M_PI, bound_pole_spread(patches[p], e));
        link.kink = link.kink_bound <= kNoKink ? 0 : pole_kink(patches[p], e);
        worst.convex = std::max(worst.convex, link.kink);
        worst.pole_gap = std::max(worst.pole_gap, link.gap);
      } else {
        link.gap = bound_joint_gap(patches[p], e, patches[link.patch], link);
        const KinkBounds bounds = bound_kink(patches[p], e, patches[link.patch], link);
        link.kink_bound = std::min(M_PI, std::max(bounds.opening, bounds.closing));
        link.kink = edge_kink(patches, static_cast<int>(p), e, link, worst);
        if (!link.projected) {
          if (bounds.opening > kNoKink) worst.convex = std::max(worst.convex, std::min(M_PI, bounds.opening));
          if (bounds.closing > kNoKink)
            worst.concave = std::max(worst.concave, std::min(M_PI, bounds.closing));
        }
      }
      worst.gap = std::max(worst.gap, link.gap);
    }
  }
  return worst;
}

bool orient_surfaces(const PatchLinks& links, const std::vector<int>& surface_of_patch, int surfaces,
                     std::vector<bool>& turned, std::vector<int>& parts) {
  struct Relation {
    int other;
    bool opposite;
  };
  std::vector<std::vector<Relation>> relations(surfaces);
  for (size_t p = 0; p < links.size(); ++p) {
    for (int e = 0; e < 4; ++e) {
      const EdgeLink& link = links[p][e];
      if (link.patch < 0) continue;
      // Two patches agree when each runs the common edge against the other.
      const int sense = boundary_sense(e) * boundary_sense(link.edge) * (link.reversed ? -1 : 1);
      relations[surface_of_patch[p]].push_back({surface_of_patch[link.patch], sense > 0});
    }
  }
  turned.assign(surfaces, false);
  parts.assign(surfaces, -1);
  int part = 0;
  for (int seed = 0; seed < surfaces; ++seed) {
    if (parts[seed] >= 0) continue;
    std::vector<int> open = {seed};
    parts[seed] = part;
    while (!open.empty()) {
      const int s = open.back();
      open.pop_back();
      for (const Relation& r : relations[s]) {
        const bool wanted = turned[s] != r.opposite;
        if (parts[r.other] < 0) {
          parts[r.other] = part;
          turned[r.other] = wanted;
          open.push_back(r.other);
        } else if (turned[r.other] != wanted) {
          return false;
        }
      }
    }
    ++part;
  }
  return true;
}

}  // namespace nurbs

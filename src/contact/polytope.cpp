// A growing convex hull of points of the configuration space obstacle; see polytope.h.
#include "contact/polytope.h"

#include <array>
#include <cmath>

namespace nurbs {
namespace {

struct Vertex {  // left uninitialised: hundreds lie on the stack
  Vec3 g;        // a - b
  Vec3 a, b;
  int patch_a, patch_b;
  double u_a, v_a, u_b, v_b;
};

struct Face {
  std::array<int, 3> vertex;
  std::array<int, 3> across;  // face on the other side of the edge vertex[k] -> vertex[k + 1]
  Vec3 normal;                // unit, outward
  double offset;              // normal . vertex: signed distance of the plane from the origin
  bool alive;
};

// Nearest point to the origin on a triangle, as barycentric weights (Ericson 2005, section 5.1.5).
Vec3 nearest_on_triangle(const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 ab = b - a, ac = c - a;
  const double d1 = -ab.dot(a), d2 = -ac.dot(a);
  if (d1 <= 0 && d2 <= 0) return {1, 0, 0};
  const double d3 = -ab.dot(b), d4 = -ac.dot(b);
  if (d3 >= 0 && d4 <= d3) return {0, 1, 0};
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) {
    const double t = d1 / (d1 - d3);
    return {1 - t, t, 0};
  }
  const double d5 = -ab.dot(c), d6 = -ac.dot(c);
  if (d6 >= 0 && d5 <= d6) return {0, 0, 1};
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) {
    const double t = d2 / (d2 - d6);
    return {1 - t, 0, t};
  }
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
    const double t = (d4 - d3) / ((d4 - d3) + (d5 - d6));
    return {0, 1 - t, t};
  }
  const double sum = va + vb + vc;
  if (!(sum > 0)) return {1, 0, 0};
  return {va / sum, vb / sum, vc / sum};
}

int count_positive(const Vec3& w) {
  return (w[0] > 0) + (w[1] > 0) + (w[2] > 0);
}

class Hull {
 public:
  int vertices = 0, faces = 0;
  bool broken = false;  // by round-off: the faces no longer close
  double sliver = 0;    // height below which a triangle's normal is round-off; a length
  Vertex vertex[kHullVertices];
  Face face[kHullFaces];

  // Starts from four vertices of positive volume; false when they are flat.
  bool start(int a, int b, int c, int d) {
    const Vec3 &p = vertex[a].g, &q = vertex[b].g, &r = vertex[c].g, &s = vertex[d].g;
    const double volume = (q - p).cross(r - p).dot(s - p);
    if (volume == 0 || !std::isfinite(volume)) return false;
    if (volume > 0) std::swap(b, c);
    // Outward faces of the tetrahedron and who lies across each edge.
    add(a, b, c, {1, 2, 3});
    add(b, a, d, {0, 3, 2});
    add(c, b, d, {0, 1, 3});
    add(a, c, d, {0, 2, 1});
    return true;
  }

  // Adds the last vertex to the hull: removes the faces it sees and closes the horizon. False when it sees
  // none (it lies inside up to round-off) or storage ends.
  bool grow(int v, double eps) {
    const Vec3& g = vertex[v].g;
    int seen = -1;
    double best = eps;
    for (int f = 0; f < faces; ++f) {
      if (!face[f].alive) continue;
      const double height = face[f].normal.dot(g) - face[f].offset;
      if (height > best) {
        best = height;
        seen = f;
      }
    }
    if (seen < 0) return false;
    broken = !replace_visible(v, seen);
    return !broken;
  }

 private:
  struct Edge {
    int from, to, outside;  // outside: the face that stays
  };
  Edge horizon[kHullFaces];
  int stack[kHullFaces];
  int freed[kHullFaces];
  int freed_count = 0;

  void set(int f, int a, int b, int c, const std::array<int, 3>& across) {
    Face& n = face[f];
    n.vertex = {a, b, c};
    n.across = across;
    const Vec3 &p = vertex[a].g, &q = vertex[b].g, &r = vertex[c].g;
    Vec3 m = (q - p).cross(r - p);
    const double length = m.norm();
    const double base2 = std::max({(q - p).squaredNorm(), (r - q).squaredNorm(), (p - r).squaredNorm()});
    if (length * length > sliver * sliver * base2) {
      n.normal = m / length;
      n.offset = std::min({n.normal.dot(p), n.normal.dot(q), n.normal.dot(r)});
    } else {  // never chosen, seen by nothing
      n.normal = Vec3::Zero();
      n.offset = kFarAway;
    }
    n.alive = true;
  }

  void add(int a, int b, int c, const std::array<int, 3>& across) { set(faces++, a, b, c, across); }

  bool replace_visible(int v, int first) {
    const Vec3 g = vertex[v].g;
    int top = 0, edges = 0;
    int removed = 0;
    stack[top++] = first;
    face[first].alive = false;
    freed[freed_count + removed++] = first;
    while (top > 0) {
      const int f = stack[--top];
      for (int k = 0; k < 3; ++k) {
        const int n = face[f].across[k];
        if (!face[n].alive) continue;
        const bool sliver = face[n].offset >= kFarAway;
        if (sliver || face[n].normal.dot(g) > face[n].offset) {
          face[n].alive = false;
          freed[freed_count + removed++] = n;
          stack[top++] = n;
        }
      }
    }
    for (int r = 0; r < removed; ++r) {
      const Face& f = face[freed[freed_count + r]];
      for (int k = 0; k < 3; ++k)
        if (face[f.across[k]].alive) horizon[edges++] = {f.vertex[k], f.vertex[(k + 1) % 3], f.across[k]};
    }
    freed_count += removed;
    if (edges < 3) return false;
    // A fan over the horizon, chained edge by edge.
    int first_new = -1, previous = -1;
    int at = 0;
    for (int step = 0; step < edges; ++step) {
      const Edge& e = horizon[at];
      int f;
      if (freed_count > 0)
        f = freed[--freed_count];
      else if (faces < kHullFaces)
        f = faces++;
      else
        return false;
      set(f, e.from, e.to, v, {e.outside, -1, previous});
      Face& outside = face[e.outside];
      for (int k = 0; k < 3; ++k)
        if (outside.vertex[k] == e.to && outside.vertex[(k + 1) % 3] == e.from) outside.across[k] = f;
      if (previous >= 0) face[previous].across[1] = f;
      if (first_new < 0) first_new = f;
      previous = f;
      if (step + 1 == edges) break;
      int next = -1;
      for (int k = 0; k < edges; ++k)
        if (horizon[k].from == e.to) next = k;
      if (next < 0) return false;
      at = next;
    }
    face[previous].across[1] = first_new;
    face[first_new].across[2] = previous;
    return horizon[at].to == horizon[0].from;
  }
};

// Everything the search over directions keeps.
class Search {
 public:
  Search(const PairFrame& pair, double tolerance, double joggle)
      : pair_(pair), tolerance_(tolerance), joggle_(joggle) {
    shrink_a_ = pair.scale_a * pair.a->curvature.min_radius;
    shrink_b_ = pair.scale_b * pair.b->curvature.min_radius;
    (shrink_a_ < shrink_b_ ? shrink_a_ : shrink_b_) *= kCoreShare;
    shrink_ = shrink_a_ + shrink_b_;
    hull_.sliver = kSliver * pair.reach;
  }

  // Support pair along unit d as a new vertex; tightens the lower bound of the gap.
  int query(const Vec3& d) {
    if (hull_.vertices == kHullVertices) return -1;
    const Vec3 on_b = pair_.direction_on_b(d);
    const Support sa = find_hull_support(*pair_.a, d), sb = find_hull_support(*pair_.b, on_b);
    Vertex& v = hull_.vertex[hull_.vertices];
    v.a = pair_.place_a(sa.point) - shrink_a_ * d;
    v.b = pair_.place_b(sb.point) + shrink_b_ * d;
    v.g = v.a - v.b;
    if (joggle_ > 0) v.g += joggle_ * scatter(v.g);
    v.patch_a = sa.where.patch;
    v.u_a = sa.where.u;
    v.v_a = sa.where.v;
    v.patch_b = sb.where.patch;
    v.u_b = sb.where.u;
    v.v_b = sb.where.v;
    ++queries_;
    const double p = pair_.scale_a * sa.upper + pair_.scale_b * sb.upper - d.dot(pair_.offset);
    if (-p > lower_) {
      lower_ = -p;
      direction_ = d;
      best_ = hull_.vertices;
    }
    return hull_.vertices++;
  }

  bool start(const Vec3& seed) {
    // A regular tetrahedron of directions turned towards the seed, then the six axes until a volume is found.
    const Vec3 d = seed.squaredNorm() > 0 ? Vec3(seed.normalized()) : Vec3(Vec3::UnitX());
    const Vec3 t = d.unitOrthogonal(), s = d.cross(t);
    query(d);
    for (const double angle : {0.0, 2.0943951023931953, 4.1887902047863905})
      query(-d / 3 + 0.9428090415820634 * (std::cos(angle) * t + std::sin(angle) * s));
    for (int k = 0; k < 3; ++k)
      for (const double sign : {1.0, -1.0}) query(sign * Vec3::Unit(k));
    // The tetrahedron of largest volume among the ten, greedily.
    int pick[4] = {0, -1, -1, -1};
    const auto g = [&](int k) -> const Vec3& { return hull_.vertex[k].g; };
    for (int want = 1; want < 4; ++want) {
      double best = 0;
      for (int k = 0; k < hull_.vertices; ++k) {
        const Vec3 e = g(k) - g(pick[0]);
        double measure;
        if (want == 1)
          measure = e.norm();
        else if (want == 2)
          measure = e.cross(g(pick[1]) - g(pick[0])).norm();
        else
          measure = std::abs(e.dot((g(pick[1]) - g(pick[0])).cross(g(pick[2]) - g(pick[0]))));
        if (measure > best) {
          best = measure;
          pick[want] = k;
        }
      }
      if (pick[want] < 0) return false;
    }
    if (!hull_.start(pick[0], pick[1], pick[2], pick[3])) return false;
    for (int k = 0; k < hull_.vertices; ++k)
      if (k != pick[0] && k != pick[1] && k != pick[2] && k != pick[3]) hull_.grow(k, roundoff());
    return !hull_.broken;
  }

  // Round a deep minimum the hull's faces have to shrink to the root of the tolerance. Supports along rings
  // of directions about the seed, each wider than the one inside it, leave the search little else to find.
  void surround_seed() {
    if (best_ != 0 || lower_ > -shrink_) return;  // the seed is not the minimum, or the cores are apart
    const Vec3 d = direction_, t = d.unitOrthogonal(), s = d.cross(t);
    double phase = 0;
    for (double angle = std::sqrt(tolerance_ / pair_.size); angle < kWidestRing; angle *= kRingRatio) {
      for (int k = 0; k < 3; ++k) {
        const double turn = phase + 2 * M_PI / 3 * k;
        const int v = query((d + angle * (std::cos(turn) * t + std::sin(turn) * s)).normalized());
        if (v < 0 || !hull_.grow(v, 0.25 * roundoff())) return;
      }
      phase += M_PI / 3;
    }
  }

  void run(double enough) {
    surround_seed();
    if (hull_.broken) return;
    for (int step = 0; step < kHullVertices; ++step) {
      const Vec3 d = next_direction();
      if (upper_ - lower_ <= tolerance_ || lower_ > enough) return;
      const int v = query(d);
      if (v < 0) return;
      if (upper_ - lower_ <= tolerance_) return;
      if (!hull_.grow(v, 0.25 * roundoff())) return;
    }
  }

  PolytopeResult result() const {
    PolytopeResult r;
    r.iterations = queries_;
    r.bracket.lower = lower_;
    r.bracket.upper = std::max(upper_, lower_);
    r.converged = upper_ - lower_ <= tolerance_;
    r.bracket.direction = direction_;
    r.points.na = direction_;
    r.points.nb = -direction_;
    const Vertex& v = hull_.vertex[best_];
    Vec3 a = v.a, b = v.b;
    find_witness(&a, &b);
    r.points.a = a + shrink_a_ * direction_;
    r.points.b = b - shrink_b_ * direction_;
    r.points.on_a = {v.patch_a, v.u_a, v.v_a};
    r.points.on_b = {v.patch_b, v.u_b, v.v_b};
    const double apart = direction_.dot(r.points.b - r.points.a);
    r.gap = std::clamp(apart, r.bracket.lower, r.bracket.upper);
    // The hull lies inside the obstacle, by less than the witnesses are known sideways.
    r.points.a += 0.5 * (apart - r.gap) * direction_;
    r.points.b -= 0.5 * (apart - r.gap) * direction_;
    return r;
  }

 private:
  double roundoff() const { return kRoundoff * pair_.reach + 2 * joggle_; }

  // In the unit cube, the same for equal points and in no relation for others.
  Vec3 scatter(const Vec3& g) const {
    const Vec3 x = (kJoggleWaves / pair_.reach) * g;
    return Vec3(std::sin(x[1] + 0.7 * x[2]), std::sin(x[2] + 0.6 * x[0]), std::sin(x[0] + 0.8 * x[1]));
  }

  // Direction to ask next, and the upper bound of the gap the hull proves.
  Vec3 next_direction() {
    int nearest = -1;
    double least = kFarAway;
    for (int f = 0; f < hull_.faces; ++f)
      if (hull_.face[f].alive && hull_.face[f].offset < least) {
        least = hull_.face[f].offset;
        nearest = f;
      }
    if (nearest < 0) return direction_;
    if (least >= 0) {  // origin inside
      upper_ = -least - shrink_ + roundoff();
      return hull_.face[nearest].normal;
    }
    double best = kFarAway;
    Vec3 closest = Vec3::Zero(), weights = Vec3::Zero();
    const Face* feature = nullptr;
    for (int k = 0; k < hull_.faces; ++k) {
      const Face& f = hull_.face[k];
      if (!f.alive || f.offset > 0) continue;
      const Vec3 w = nearest_on_triangle(g(f, 0), g(f, 1), g(f, 2));
      const Vec3 x = w[0] * g(f, 0) + w[1] * g(f, 1) + w[2] * g(f, 2);
      const double distance = x.squaredNorm();
      // Of features as near as each other the largest: the origin's foot may be a hair inside an edge.
      const bool larger = feature && count_positive(w) > count_positive(weights);
      if (distance < best * (1 - kTie) || (larger && distance <= best * (1 + kTie))) {
        best = distance;
        closest = x;
        weights = w;
        feature = &f;
      }
    }
    const double distance = std::sqrt(best);
    upper_ = distance - shrink_ + roundoff();
    const bool clear = feature && distance > roundoff();
    return clear ? away_from(*feature, weights, closest) : hull_.face[nearest].normal;
  }

  const Vec3& g(const Face& f, int k) const { return hull_.vertex[f.vertex[k]].g; }

  // Unit direction from the nearest point to the origin, square to the face or edge it lies in: the origin
  // may be so near that the difference alone has lost the digits that separate flat faces.
  Vec3 away_from(const Face& f, const Vec3& w, const Vec3& closest) const {
    int on[3], count = 0;
    for (int k = 0; k < 3; ++k)
      if (w[k] > 0) on[count++] = k;
    if (count == 3) return f.normal;
    Vec3 d = -closest;
    if (count == 2) {
      const Vec3 edge = (g(f, on[1]) - g(f, on[0])).normalized();
      d -= edge.dot(d) * edge;
    }
    return d.normalized();
  }

  // The witnesses of direction_: the hull's point nearest to the origin or, when that is inside, to its foot
  // on the supporting plane. A flat of the obstacle is several triangles; witnesses from another one, or from
  // the far side of a body that has two equal minima, would not face each other.
  void find_witness(Vec3* a, Vec3* b) const {
    const Vec3 target = std::min(0.0, lower_ + shrink_) * -direction_;
    double best = kFarAway;
    for (int k = 0; k < hull_.faces; ++k) {
      const Face& f = hull_.face[k];
      if (!f.alive) continue;
      const Vec3 w = nearest_on_triangle(g(f, 0) - target, g(f, 1) - target, g(f, 2) - target);
      const double distance = (w[0] * g(f, 0) + w[1] * g(f, 1) + w[2] * g(f, 2) - target).squaredNorm();
      if (!(distance < best)) continue;
      best = distance;
      *a = *b = Vec3::Zero();
      for (int i = 0; i < 3; ++i) {
        *a += w[i] * hull_.vertex[f.vertex[i]].a;
        *b += w[i] * hull_.vertex[f.vertex[i]].b;
      }
    }
  }

  const PairFrame& pair_;
  double tolerance_, joggle_;
  double shrink_a_, shrink_b_, shrink_;
  double lower_ = -kFarAway, upper_ = kFarAway;
  Vec3 direction_ = Vec3::UnitX();
  int best_ = 0, queries_ = 0;
  Hull hull_;
};

}  // namespace

PolytopeResult solve_polytope(const PairFrame& pair, const Vec3& seed, double tolerance, double enough) {
  // A hull that round-off broke (coplanar faces) or that stalled is begun again from other directions, and
  // its vertices moved at random by far more than round-off and far less than the tolerance (Barber, Dobkin &
  // Huhdanpaa 1996, section 4: joggled input); the upper bound allows for it.
  PolytopeResult best;
  Vec3 from = seed;
  for (int attempt = 0; attempt < kHullAttempts; ++attempt) {
    const double joggle = attempt > 0 ? std::min(kJoggle * pair.reach, 0.05 * tolerance) : 0.0;
    Search search(pair, tolerance, joggle);
    if (search.start(from)) search.run(enough);
    const PolytopeResult result = search.result();
    const int spent = attempt > 0 ? best.iterations : 0;
    if (attempt == 0 || result.bracket.width() < best.bracket.width()) best = result;
    best.iterations = spent + result.iterations;
    if (best.converged || best.bracket.lower > enough) break;
    from = best.bracket.direction + kHullTurn * (attempt + 1) * Vec3(0.36, -0.48, 0.8);
  }
  return best;
}

}  // namespace nurbs

// Horizon by flood fill from the highest face, checked to be one closed loop before anything is changed.
#include "contact/overlap/growing_hull.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace nurbs {
namespace {

constexpr double kNeedle = 1e-3;   // height over length
constexpr double kFootNoise = 64;  // round-offs of the furthest corner, between a plane and its foot

int count_positive(const Vec3& w) {
  return (w[0] > 0) + (w[1] > 0) + (w[2] > 0);
}

// A triangle's edges, with which its normal is taken: of a needle, the longer ones differ by less than their
// round-off.
struct Edges {
  Vec3 ab, bc, ca;
  double lab, lbc, lca;  // squared lengths
  Edges(const Vec3& a, const Vec3& b, const Vec3& c)
      : ab(b - a),
        bc(c - b),
        ca(a - c),
        lab(ab.squaredNorm()),
        lbc(bc.squaredNorm()),
        lca(ca.squaredNorm()) {}
  // Twice the area times the normal, from the two shorter edges.
  NURBS_INLINE Vec3 normal() const {
    if (lbc >= lab && lbc >= lca) return ca.cross(ab);
    return lca >= lab ? ab.cross(bc) : bc.cross(ca);
  }
  double longest2() const { return std::max({lab, lbc, lca}); }
  int longest() const { return lab >= lbc && lab >= lca ? 0 : lbc >= lca ? 1 : 2; }
  const Vec3& side(int k) const { return k == 0 ? ab : k == 1 ? bc : ca; }
  // A normal made square to the longest side to round-off: a needle's corners may be far from where that
  // matters.
  Vec3 upright(const Vec3& n) const {
    const Vec3& long_side = side(longest());
    return n - n.dot(long_side) / longest2() * long_side;
  }
};

// Weights of the plane's foot, from the longest edge: how far from it, as a share of the third corner's
// height over it, then where along it. Of a needle the share is hardly known, but no error of it moves the
// foot along.
Vec3 foot_weights(const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3* const corner[3] = {&a, &b, &c};
  const Edges edges(a, b, c);
  const int i = edges.longest(), j = (i + 1) % 3, k = (i + 2) % 3;
  const Vec3 &p = *corner[i], &q = *corner[j], &r = *corner[k], &edge = edges.side(i);
  const double length2 = edges.longest2();
  // From the nearer ends, where differences keep their digits: 0 at p, 1 at q.
  const auto along = [&](const Vec3& x, bool from_q) {
    return from_q ? 1 + edge.dot(x - q) / length2 : edge.dot(x - p) / length2;
  };
  const auto beside = [&](const Vec3& x, double t, bool from_q) {
    return from_q ? Vec3(x - q - (t - 1) * edge) : Vec3(x - p - t * edge);
  };
  const Vec3 origin = Vec3::Zero();
  const bool near_q = q.squaredNorm() < p.squaredNorm(),
             side_q = (r - q).squaredNorm() < (r - p).squaredNorm();
  const double t = along(origin, near_q), tr = along(r, side_q);
  const Vec3 up = beside(r, tr, side_q);
  Vec3 w;
  w[k] = beside(origin, t, near_q).dot(up) / up.squaredNorm();
  w[j] = t - w[k] * tr;
  w[i] = 1 - w[j] - w[k];
  return w;
}

}  // namespace

// Corners may be a million times as far from the origin as its nearest point: differences are taken from the
// corner nearest to the origin, where they keep their digits, and the normal is of the two shorter edges.
Vec3 nearest_on_triangle(const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3* const corner[3] = {&a, &b, &c};
  const double far[3] = {a.squaredNorm(), b.squaredNorm(), c.squaredNorm()};
  const int i = far[0] <= far[1] ? (far[0] <= far[2] ? 0 : 2) : (far[1] <= far[2] ? 1 : 2), j = (i + 1) % 3,
            k = (i + 2) % 3;
  const Vec3 &p = *corner[i], &q = *corner[j], &r = *corner[k];
  const Vec3 pq = q - p, pr = r - p;
  const double dq = -pq.dot(p), dr = -pr.dot(p);
  Vec3 w = Vec3::Zero();
  w[i] = 1;
  if (dq <= 0 && dr <= 0) return w;
  const Vec3 n = Edges(a, b, c).normal();
  // No further than to the corner: of an edge that is round-off next to its distance the share is any.
  const auto on_edge = [&](int to, double along, const Vec3& edge) {
    const double length2 = edge.squaredNorm(), t = along < length2 ? along / length2 : 1;
    w[to] = t;
    w[i] = 1 - t;
    return w;
  };
  // q and r are further away than p: no other corner can be the nearest, nor an edge's far half from p.
  const double wr = n.dot(p.cross(pq)), wq = n.dot(pr.cross(p));
  if (wr <= 0 && dq >= 0) return on_edge(j, dq, pq);
  if (wq <= 0 && dr >= 0) return on_edge(k, dr, pr);
  const Vec3 qr = r - q;
  const double wp = n.dot((far[j] <= far[k] ? q : r).cross(qr));
  if (wp <= 0) {
    const double length2 = qr.squaredNorm();
    const double t = far[j] <= far[k] ? -qr.dot(q) / length2 : 1 - qr.dot(r) / length2;
    if (!(t >= 0 && t <= 1)) return w;
    w[i] = 0;
    w[j] = 1 - t;
    w[k] = t;
    return w;
  }
  const double sum = wp + wq + wr;
  if (!(sum > 0)) return w;
  w[i] = wp / sum;
  w[j] = wq / sum;
  w[k] = wr / sum;
  return w;
}

int GrowingHull::store(const Vec3& point) {
  if (points_ == kHullVertices) return -1;
  point_[points_] = point;
  edge_from_[points_] = -1;
  return points_++;
}

void GrowingHull::set(int f, int a, int b, int c) {
  Face& face = face_[f];
  face.vertex = {static_cast<short>(a), static_cast<short>(b), static_cast<short>(c)};
  face.alive = true;
  marked_[f] = false;
  const Vec3 &p = point_[a], &q = point_[b], &r = point_[c];
  const Edges edges(p, q, r);
  const Vec3 m = edges.normal();
  const double area2 = m.squaredNorm();
  face.sliver = !(area2 > sliver_ * sliver_ * edges.longest2());
  if (face.sliver)
    face.normal.setZero();
  else
    face.normal = 1 / std::sqrt(area2) * m;
  face.needle = !face.sliver && area2 < kNeedle * kNeedle * edges.longest2() * edges.longest2();
  if (face.needle) face.normal = edges.upright(face.normal).normalized();
  face.offset = std::min({face.normal.dot(p), face.normal.dot(q), face.normal.dot(r)});
  behind_ += face.offset < 0;
  foot_[f] = false;
  distance2_[f] = face.offset * face.offset;
}

void GrowingHull::drop(int f) {
  face_[f].alive = false;
  behind_ -= face_[f].offset < 0;
  distance2_[f] = kFarAway;
}

// The plane's own foot where it lies inside, which is exact to round-off however far the corners are.
void GrowingHull::find_foot(int f) {
  Face& face = face_[f];
  foot_[f] = true;
  face.weights = nearest_on_triangle(point_[face.vertex[0]], point_[face.vertex[1]], point_[face.vertex[2]]);
  if (count_positive(face.weights) == 3 && !face.sliver) {
    if (holds_foot(face)) return;
    make_sliver(face);
  }
  distance2_[f] = nearest_point(face).squaredNorm();
  if (!face.needle) return;
  // Even the edge that the foot is beyond may be taken wrongly.
  Face other = face;
  other.weights = foot_weights(point_[face.vertex[0]], point_[face.vertex[1]], point_[face.vertex[2]]);
  const double distance2 = nearest_point(other).squaredNorm();
  if (!(other.weights.minCoeff() > 0) || !(distance2 < distance2_[f])) return;
  face.weights = other.weights;
  distance2_[f] = distance2;
}

// Whether a triangle has its plane's foot where its weights say, those settled once if need be: of a needle
// with corners far away the plane may be mostly round-off.
bool GrowingHull::holds_foot(Face& face) const {
  const Vec3 &p = point_[face.vertex[0]], &q = point_[face.vertex[1]], &r = point_[face.vertex[2]];
  const double far = std::sqrt(std::max({p.squaredNorm(), q.squaredNorm(), r.squaredNorm()})),
               most = std::abs(face.offset) + kFootNoise * kRoundoff * far;
  const Vec3 x = nearest_point(face), pq = q - p, pr = r - p;
  if (x.squaredNorm() <= most * most) return true;
  const double qq = pq.squaredNorm(), rr = pr.squaredNorm(), qr = pq.dot(pr), det = qq * rr - qr * qr,
               xq = x.dot(pq), xr = x.dot(pr), dq = (qr * xr - rr * xq) / det, dr = (qr * xq - qq * xr) / det;
  const Vec3 settled = face.weights + Vec3(-dq - dr, dq, dr);
  for (const Vec3& w : {Vec3(settled / settled.sum()), foot_weights(p, q, r)}) {
    if (!(w.minCoeff() > 0)) continue;
    face.weights = w;
    if (nearest_point(face).squaredNorm() <= most * most) return true;
  }
  return false;
}

void GrowingHull::make_sliver(Face& face) {
  behind_ -= face.offset < 0;
  face.sliver = true;
  face.needle = false;
  face.normal.setZero();
  face.offset = 0;
}

bool GrowingHull::start(int a, int b, int c, int d) {
  const Vec3 &p = point_[a], &q = point_[b], &r = point_[c], &s = point_[d];
  const double volume = (q - p).cross(r - p).dot(s - p);
  faces_ = free_ = behind_ = 0;
  if (volume == 0 || !std::isfinite(volume)) return false;
  if (volume > 0) std::swap(b, c);
  std::fill(distance2_, distance2_ + kWidth, kFarAway);
  set(0, a, b, c);
  set(1, b, a, d);
  set(2, c, b, d);
  set(3, a, c, d);
  face_[0].across = {1, 2, 3};
  face_[1].across = {0, 3, 2};
  face_[2].across = {0, 1, 3};
  face_[3].across = {0, 2, 1};
  faces_ = 4;
  return true;
}

int GrowingHull::highest_seen_from(const Vec3& p, double* height) const {
  int best = -1;
  for (int f = 0; f < faces_; ++f) {
    if (!face_[f].alive || face_[f].sliver) continue;
    const double h = face_[f].normal.dot(p) - face_[f].offset;
    if (h > *height) {
      *height = h;
      best = f;
    }
  }
  return best;
}

bool GrowingHull::find_visible(const Vec3& p, int first, double threshold) {
  for (int k = 0; k < visible_; ++k) marked_[seen_[k]] = false;
  visible_ = edges_ = 0;
  seen_[visible_++] = static_cast<short>(first);
  marked_[first] = true;
  for (int k = 0; k < visible_; ++k)
    for (const short n : face_[seen_[k]].across) {
      if (marked_[n]) continue;
      const Face& f = face_[n];
      if (!f.sliver && !(f.normal.dot(p) - f.offset > threshold)) continue;
      marked_[n] = true;
      seen_[visible_++] = n;
    }
  for (int k = 0; k < visible_; ++k) {
    const Face& f = face_[seen_[k]];
    for (int e = 0; e < 3; ++e) {
      const short n = f.across[e];
      if (marked_[n]) continue;
      const short from = f.vertex[e], to = f.vertex[(e + 1) % 3];
      short slot = 0;
      while (slot < 3 && !(face_[n].vertex[slot] == to && face_[n].vertex[(slot + 1) % 3] == from)) ++slot;
      if (slot == 3) return false;
      edge_[edges_++] = {from, to, n, slot};
    }
  }
  return chain_horizon();
}

// Puts the horizon's edges in order round it; false unless they are one loop that meets no vertex twice.
bool GrowingHull::chain_horizon() {
  bool simple = edges_ >= 3;
  for (int k = 0; k < edges_; ++k) {
    if (edge_from_[edge_[k].from] >= 0) simple = false;
    edge_from_[edge_[k].from] = static_cast<short>(k);
  }
  for (int k = 0; simple && k + 1 < edges_; ++k) {
    const int next = edge_from_[edge_[k].to];
    if (next <= k) {
      simple = false;
      break;
    }
    std::swap(edge_[k + 1], edge_[next]);
    edge_from_[edge_[next].from] = static_cast<short>(next);
    edge_from_[edge_[k + 1].from] = static_cast<short>(k + 1);
  }
  if (simple) simple = edge_[edges_ - 1].to == edge_[0].from;
  for (int k = 0; k < edges_; ++k) edge_from_[edge_[k].from] = -1;
  return simple;
}

bool GrowingHull::fan(int point) {
  if (faces_ + std::max(0, edges_ - visible_ - free_) > kHullFaces) return false;
  for (int k = 0; k < visible_; ++k) {
    drop(seen_[k]);
    marked_[seen_[k]] = false;
    free_list_[free_++] = seen_[k];
  }
  visible_ = 0;
  short first = -1, previous = -1;
  for (int k = 0; k < edges_; ++k) {
    const Edge& e = edge_[k];
    if (free_ == 0 && faces_ % kWidth == 0) std::fill_n(distance2_ + faces_, kWidth, kFarAway);
    const short f = free_ > 0 ? free_list_[--free_] : static_cast<short>(faces_++);
    set(f, e.from, e.to, point);
    face_[f].across = {e.outside, -1, previous};
    face_[e.outside].across[e.slot] = f;
    if (previous >= 0) face_[previous].across[1] = f;
    if (first < 0) first = f;
    previous = f;
  }
  face_[previous].across[1] = first;
  face_[first].across[2] = previous;
  return true;
}

GrowingHull::Growth GrowingHull::grow(int point, double eps, int below) {
  const Vec3& p = point_[point];
  if (below >= 0) {
    const double height = face_[below].normal.dot(p) - face_[below].offset;
    if (height > eps && add(point, below, std::min(eps, 0.5 * height)) == Growth::grown) return Growth::grown;
  }
  double height = eps;
  const int first = highest_seen_from(p, &height);
  return first < 0 ? Growth::inside : add(point, first, std::min(eps, 0.5 * height));
}

// A face that the point is level with, up to round-off, may count either way; one of them makes a disc.
GrowingHull::Growth GrowingHull::add(int point, int first, double level) {
  for (const double threshold : {0.0, level, -level})
    if (find_visible(point_[point], first, threshold)) return fan(point) ? Growth::grown : Growth::full;
  return Growth::broken;
}

double GrowingHull::least_distance2() const {
  Wide least = load_wide(distance2_);
  for (int k = kWidth; k < faces_; k += kWidth) {
    const Wide next = load_wide(distance2_ + k);
    least = next < least ? next : least;
  }
  double best = least[0];
  for (int k = 1; k < kWidth; ++k) best = std::min(best, least[k]);
  return best;
}

// Feet are looked for where planes are nearer than all others' feet or planes.
GrowingHull::Nearest GrowingHull::nearest() {
  if (faces_ == 0) return {-1, kFarAway, true};
  for (;;) {
    const double within = least_distance2() * (1 + kTie);
    Nearest best{-1, kFarAway, behind_ == 0};
    int corners = 0;
    const auto look = [&](int k) {
      if (!foot_[k] && !(distance2_[k] > within)) find_foot(k);
      if (distance2_[k] > within) return;
      const int on = count_positive(face_[k].weights);
      if (on <= corners) return;
      best.face = k;
      best.distance2 = distance2_[k];
      corners = on;
    };
    for (int first = 0; first < faces_; first += kWidth) {
      if (none_of(~(load_wide(distance2_ + first) > within))) continue;
      for (int k = first; k < std::min(first + kWidth, faces_); ++k) look(k);
    }
    if (best.face >= 0 || !(within < kFarAway)) return best;
  }
}

bool GrowingHull::closed() const {
  for (int k = 0; k < faces_; ++k) {
    if (!face_[k].alive) continue;
    for (int e = 0; e < 3; ++e) {
      const short n = face_[k].across[e];
      if (n < 0 || n >= faces_ || !face_[n].alive) return false;
      int found = 0;
      for (int s = 0; s < 3; ++s)
        found += face_[n].across[s] == k && face_[n].vertex[s] == face_[k].vertex[(e + 1) % 3] &&
                 face_[n].vertex[(s + 1) % 3] == face_[k].vertex[e];
      if (found != 1) return false;
    }
  }
  return faces_ > 0;
}

}  // namespace nurbs

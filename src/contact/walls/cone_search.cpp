// The highest of f over the normals of a vertex; see find_highest_point_contact in feature_search.h.
//
// f is the least of the linear functions d . c over the body's points c (seen from the vertex), so that
// supports at the corners of a spherical triangle bound it there: with d = x / |x|, x on the flat triangle,
//
//     f(d) = f(x) / |x| <= max over x of the least x . c of the three supports,    while that is below zero,
//
// which is highest at a corner, on a side where two functions meet, or inside where all three do. The highest
// triangle is looked at there, and halved.
#include <algorithm>
#include <cmath>
#include <vector>

#include "contact/walls/feature_search.h"
#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

constexpr double kLevel = 1e-9;   // of the overlap: maxima that are one
constexpr double kNone = 1e-12;   // sides of a cone that are next to nothing
constexpr int kMostLooks = 2000;  // of which some 60 are needed

// A direction, the body's point there as seen from the vertex, and f.
struct Look {
  Vec3 d, c;
  FeatureGap at;
};

struct Piece {
  int corner[3];
  double bound;  // of f
  Vec3 where;    // it is taken there, not unit
};

struct Room {
  std::vector<Look> looks;
  std::vector<Piece> pieces;  // a heap by bound
  std::vector<Vec3> polygon, clipped;
};

class ConeSearch {
 public:
  ConeSearch(const Particle& particle, const Vec3& a, const SurfacePoint* start, Room* room)
      : particle_(particle), a_(a), looks_(room->looks), pieces_(room->pieces), room_(*room) {
    looks_.clear();
    pieces_.clear();
    if (start) start_ = *start, started_ = true;
  }

  FeatureContact run(const Vec3* edges, int count, double level) {
    FeatureContact none;
    none.touching = true;
    none.gap = -kFarAway;
    if (!cover(edges, count)) return clear();
    while (!pieces_.empty() && static_cast<int>(looks_.size()) < kMostLooks) {
      std::pop_heap(pieces_.begin(), pieces_.end(), lower);
      const Piece top = pieces_.back();
      pieces_.pop_back();
      const double best = best_ < 0 ? level : std::max(level, looks_[best_].at.gap);
      if (!(top.bound > best + kLevel * std::abs(best) + noise())) break;
      if (!look(top.where) || !halve(top)) return clear();
    }
    if (best_ < 0) return none;
    const Look& b = looks_[best_];
    FeatureContact c;
    c.touching = true;
    c.gap = b.at.gap;
    c.normal = b.d;
    c.on_body = b.at.on_body;
    c.where = b.at.where;
    return c;
  }

 private:
  static bool lower(const Piece& p, const Piece& q) { return p.bound < q.bound; }
  double noise() const { return kRoundoff * 8 * particle_.scale * particle_.shape->bounding_radius; }

  // The octants of the sphere as far as they lie in the cone, as triangles. False where the body is clear.
  bool cover(const Vec3* edges, int count) {
    for (int octant = 0; octant < 8; ++octant) {
      std::vector<Vec3>& polygon = room_.polygon;
      polygon.clear();
      for (int k = 0; k < 3; ++k) polygon.push_back((octant >> k & 1 ? -1 : 1) * Vec3::Unit(k));
      for (int i = 0; i < count && !polygon.empty(); ++i) clip(edges[i]);
      if (polygon.size() < 3) continue;
      const int first = static_cast<int>(looks_.size()), corners = static_cast<int>(polygon.size());
      for (const Vec3& d : polygon)
        if (!look(d)) return false;
      for (int k = 1; k + 1 < corners; ++k) add({{first, first + k, first + k + 1}, 0, Vec3::Zero()}, 0);
    }
    return true;
  }

  // What of the polygon's cone is not on the side that `edge` points to.
  void clip(const Vec3& edge) {
    std::vector<Vec3>& in = room_.polygon;
    std::vector<Vec3>& out = room_.clipped;
    out.clear();
    for (std::size_t k = 0; k < in.size(); ++k) {
      const Vec3 &p = in[k], &q = in[(k + 1) % in.size()];
      const double hp = edge.dot(p), hq = edge.dot(q);
      if (hp <= kNone) out.push_back(p);
      if ((hp > kNone && hq < -kNone) || (hp < -kNone && hq > kNone))
        out.push_back((hp * q - hq * p).normalized() * (hp > hq ? 1 : -1));
    }
    in.swap(out);
  }

  // f in a direction; false where it parts the body from the vertex.
  bool look(const Vec3& way) {
    Look l;
    l.d = way.normalized();
    l.at = gap_along(particle_, a_, l.d, started_ ? &start_ : nullptr);
    l.c = particle_.x - a_ + l.at.on_body;
    start_ = l.at.where;
    started_ = true;
    looks_.push_back(l);
    if (best_ < 0 || l.at.gap > looks_[best_].at.gap) best_ = static_cast<int>(looks_.size()) - 1;
    return l.at.gap < 0;
  }

  FeatureContact clear() const {
    FeatureContact c;
    c.gap = looks_.back().at.gap;
    c.normal = looks_.back().d;
    return c;
  }

  // Its longest side is cut in two.
  bool halve(const Piece& piece) {
    int longest = 0;
    double most = -1;
    for (int k = 0; k < 3; ++k) {
      const double side = (looks_[piece.corner[k]].d - looks_[piece.corner[(k + 1) % 3]].d).squaredNorm();
      if (side > most) most = side, longest = k;
    }
    const int p = piece.corner[longest], q = piece.corner[(longest + 1) % 3],
              r = piece.corner[(longest + 2) % 3];
    if (!look(looks_[p].d + looks_[q].d)) return false;
    const int middle = static_cast<int>(looks_.size()) - 1;
    add({{p, middle, r}, 0, Vec3::Zero()}, piece.bound);
    add({{middle, q, r}, 0, Vec3::Zero()}, piece.bound);
    return true;
  }

  // With its bound, which is no more than that of the piece it comes from.
  void add(Piece piece, double bound) {
    double m[3][3];  // support i at corner k
    for (int i = 0; i < 3; ++i)
      for (int k = 0; k < 3; ++k) m[i][k] = looks_[piece.corner[i]].c.dot(looks_[piece.corner[k]].d);
    piece.bound = -kFarAway;
    const auto offer = [&](double w0, double w1, double w2) {
      double least = kFarAway;
      for (const auto& row : m) least = std::min(least, w0 * row[0] + w1 * row[1] + w2 * row[2]);
      if (!(least > piece.bound)) return;
      piece.bound = least;
      piece.where =
          w0 * looks_[piece.corner[0]].d + w1 * looks_[piece.corner[1]].d + w2 * looks_[piece.corner[2]].d;
    };
    offer(1, 0, 0);
    offer(0, 1, 0);
    offer(0, 0, 1);
    for (int i = 0; i < 3; ++i) {
      const double *p = m[i], *q = m[(i + 1) % 3];
      for (int k = 0; k < 3; ++k) {  // on the side from corner k
        const int l = (k + 1) % 3;
        const double from = p[k] - q[k], to = p[l] - q[l];
        if (!(from * to < 0)) continue;
        double w[3] = {0, 0, 0};
        w[k] = to / (to - from);
        w[l] = 1 - w[k];
        offer(w[0], w[1], w[2]);
      }
    }
    const Vec3 first(m[0][0] - m[1][0], m[0][1] - m[1][1], m[0][2] - m[1][2]);
    const Vec3 second(m[0][0] - m[2][0], m[0][1] - m[2][1], m[0][2] - m[2][2]);
    Vec3 w = first.cross(second);
    if (w.sum() != 0) {
      w /= w.sum();
      if (w.minCoeff() > 0) offer(w[0], w[1], w[2]);
    }
    piece.bound = std::min(piece.bound, bound);
    pieces_.push_back(piece);
    std::push_heap(pieces_.begin(), pieces_.end(), lower);
  }

  const Particle& particle_;
  const Vec3 a_;
  std::vector<Look>& looks_;
  std::vector<Piece>& pieces_;
  Room& room_;
  int best_ = -1;
  SurfacePoint start_;
  bool started_ = false;
};

}  // namespace

FeatureContact find_highest_point_contact(const Particle& particle, const Vec3& a, const Vec3* edges,
                                          int count, double level, const SurfacePoint* start) {
  static thread_local Room room;
  return ConeSearch(particle, a, start, &room).run(edges, count, level);
}

}  // namespace nurbs

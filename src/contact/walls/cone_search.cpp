// The highest of f over the normals of a vertex; see find_highest_point_contact in feature_search.h.
//
// f is the least of the linear functions d . c over the body's points c (seen from the vertex), concave but
// for the length of d. Every support is one of them, so that some bound f on a spherical triangle: with
// d = x / |x|, x on the flat triangle,
//
//     f(d) = f(x) / |x| <= max over x of the least x . c,    while that is below zero,
//
// a linear program, whose answer is at a corner, on a side where two functions meet, or inside where three
// do. The highest triangle is looked at there, which cuts its bound (Kelley 1960), and halved where that no
// longer helps: what is left is then the length, a share of f of an eighth of the squared side.
#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "contact/walls/feature_search.h"
#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

constexpr double kSameHeight = 1e-9;  // of the overlap: maxima that are one ...
constexpr double kSize = 1e-12;       // ... and of the bounding radius
constexpr double kNone = 1e-12;       // sides of a cone that are next to nothing
constexpr int kMostLooks = 400;       // of which some 60 are needed
constexpr int kMostCuts = 6;
constexpr double kProgress = 0.5;  // of a bound's way down to the best, that a cut must make for another

// A direction, the body's point there as seen from the vertex, and f.
struct Look {
  Vec3 d, c;
  FeatureGap at;
};

struct Piece {
  std::array<int, 3> corner;
  int cut[kMostCuts];  // looks whose supports bound f here, beside those of the corners
  int cuts = 0;
  double bound = 0;  // of f
  Vec3 where;        // it is taken there, not unit
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
    if (!cover(edges, count)) return last();
    while (!pieces_.empty() && static_cast<int>(looks_.size()) < kMostLooks) {
      std::pop_heap(pieces_.begin(), pieces_.end(), lower);
      Piece top = pieces_.back();
      pieces_.pop_back();
      const double best = best_ < 0 ? level : std::max(level, looks_[best_].at.gap);
      if (!(top.bound > best + kSameHeight * std::abs(best) + kSize * size_)) break;
      if (!look(top.where)) return last();
      add_cut(&top);
      const double before = top.bound, above = looks_[best_].at.gap;
      bind(&top);
      if (top.bound - above < kProgress * (before - above))
        push(top);
      else if (!halve(top))
        return last();
    }
    if (best_ >= 0) return over_vertex(looks_[best_]);
    FeatureContact none;
    none.touching = true;
    none.gap = -kFarAway;
    return none;
  }

 private:
  static bool lower(const Piece& p, const Piece& q) { return p.bound < q.bound; }

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
      for (int k = 1; k + 1 < corners; ++k)
        add(Piece{{{first, first + k, first + k + 1}}, {}, 0, kFarAway, Vec3::Zero()});
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

  // Of the supports at the maximum some mean lies over the vertex, along d, and d is its normal; of a face or
  // a straight side, any point of which may have been found, it is the place that is pressed.
  FeatureContact over_vertex(const Look& best) const {
    FeatureContact c = feature_contact(best.at, best.d);
    c.on_body = a_ - particle_.x + c.gap * c.normal;
    return c;
  }

  FeatureContact last() const { return feature_contact(looks_.back().at, looks_.back().d); }

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
    for (const int end : {p, q}) {
      Piece half = piece;
      half.corner = {end, middle, r};
      add(half);
    }
    return true;
  }

  // The last look as a cut, in place of the oldest where there is no more room.
  void add_cut(Piece* piece) const {
    if (piece->cuts == kMostCuts) {
      std::copy(piece->cut + 1, piece->cut + kMostCuts, piece->cut);
      --piece->cuts;
    }
    piece->cut[piece->cuts++] = static_cast<int>(looks_.size()) - 1;
  }

  void add(Piece piece) {
    bind(&piece);
    push(piece);
  }

  void push(const Piece& piece) {
    pieces_.push_back(piece);
    std::push_heap(pieces_.begin(), pieces_.end(), lower);
  }

  // The piece's bound, which is no more than it was.
  void bind(Piece* piece) const {
    constexpr int kMost = 3 + kMostCuts;
    Vec3 m[kMost];  // of every support, at the three corners
    const int count = 3 + piece->cuts;
    for (int i = 0; i < count; ++i) {
      const Vec3& c = looks_[i < 3 ? piece->corner[i] : piece->cut[i - 3]].c;
      for (int k = 0; k < 3; ++k) m[i][k] = c.dot(looks_[piece->corner[k]].d);
    }
    double most = -kFarAway;
    Vec3 at = Vec3::Zero();
    const auto offer = [&](const Vec3& w) {
      double least = kFarAway;
      for (int i = 0; i < count && least > most; ++i) least = std::min(least, w.dot(m[i]));
      if (least > most) most = least, at = w;
    };
    for (int k = 0; k < 3; ++k) offer(Vec3::Unit(k));
    for (int i = 0; i < count; ++i)
      for (int j = i + 1; j < count; ++j) {
        const Vec3 apart = m[i] - m[j];
        for (int k = 0; k < 3; ++k) {  // on the side from corner k
          const double from = apart[k], to = apart[(k + 1) % 3];
          if (!(from * to < 0)) continue;
          Vec3 w = Vec3::Zero();
          w[k] = to / (to - from);
          w[(k + 1) % 3] = 1 - w[k];
          offer(w);
        }
        for (int l = j + 1; l < count; ++l) {
          Vec3 w = apart.cross(m[i] - m[l]);
          const double sum = w.sum();
          if (sum == 0) continue;
          w /= sum;
          if (w.minCoeff() > 0) offer(w);
        }
      }
    piece->bound = std::min(piece->bound, most);
    piece->where = Vec3::Zero();
    for (int k = 0; k < 3; ++k) piece->where += at[k] * looks_[piece->corner[k]].d;
  }

  const Particle& particle_;
  const Vec3 a_;
  const double size_ = particle_.scale * particle_.shape->bounding_radius;
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

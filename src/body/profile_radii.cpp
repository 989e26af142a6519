// See profile_radii.h.
#include "body/profile_radii.h"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "body/profile_turn.h"
#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

constexpr int kMostDepth = 18;           // halvings of a piece
constexpr double kLeafCells = 0.5;       // that a leaf's normals may cover
constexpr double kLeafSpread = 0.98;     // least over largest radius of a leaf ...
constexpr double kNearlyStraight = 1e3;  // ... unless it bends by less than this over the body's size
constexpr double kSamePlace = 1e-12;     // of the body's size
constexpr double kArcSpread = 1 - 1e-9;  // least over largest radius of a circle's arc
constexpr double kBesideCell = 1e-9;     // cells: round-off of a normal's place
constexpr double kWidestReach = 0.5;     // rad

// From 0, against the axis, to 1, along it: monotone in the angle. Normals that round-off turns beyond the
// axis belong to its end.
double place_of(const Vec2& n) {
  if (!(n[0] > 0)) return n[1] > 0 ? 1 : 0;
  return 0.5 * (1 + n[1] / (n[0] + std::abs(n[1])));
}

// Between two places, and what round-off may add.
struct Cells {
  int first, last;
};
Cells cells_of(double from, double to) {
  const auto cell = [](double place) {
    return std::clamp(static_cast<int>(std::floor(place)), 0, kProfileCells - 1);
  };
  return {cell(std::min(from, to) * kProfileCells - kBesideCell),
          cell(std::max(from, to) * kProfileCells + kBesideCell)};
}

// Of minima over 2, 4, .. cells, before the cells; the first number means nothing.
std::vector<float> tree_of(const std::vector<float>& cells) {
  const std::size_t count = cells.size();
  std::vector<float> tree(count, 0);
  tree.insert(tree.end(), cells.begin(), cells.end());
  for (std::size_t k = count - 1; k > 0; --k) tree[k] = std::min(tree[2 * k], tree[2 * k + 1]);
  return tree;
}

double largest(const Bernstein<double>& row) {
  double most = 0;
  for (const double x : row) most = std::max(most, std::abs(x));
  return most;
}
double longest(const Bernstein<Vec2>& rows) {
  double most = 0;
  for (const Vec2& x : rows) most = std::max(most, x.norm());
  return most;
}

Vec2 square_to(const Vec2& tangent, double side) {
  return side * Vec2(tangent[1], -tangent[0]);
}

// A stretch of a piece, lengths over the body's size.
struct ProfileLeaf {
  Bernstein<Vec2> n;  // velocity times w^2
  Bernstein<double> det, w;
};

class RadiiPainter {
 public:
  RadiiPainter(double size, double kink) : size_(size), kink_(kink), cell_(kProfileCells, kFarAway) {}

  // Paints a piece; false where its normals cannot be told.
  bool paint(const Meridian::Piece& piece, ProfileTurn turn) {
    noise_n_ = turn.velocity_noise;
    noise_det_ = turn.det_noise;
    side_ = turn.side;
    const auto at = [&](int i) { return Vec2(Vec2(piece.r[i], piece.z[i]) / (size_ * piece.w[i])); };
    const Bernstein<Vec2>& n = turn.velocity;
    add_end(at(0), end_of(n.begin(), n.end()));
    add_end(at(piece.degree), end_of(n.rbegin(), n.rend()));
    if (paint_arc(turn)) return true;
    return examine({std::move(turn.velocity), std::move(turn.det), std::move(turn.weight)}, kMostDepth);
  }

  // The fans of normals at kinks, where the radius is 0. Ends without another meet the axis, or the rim of a
  // flat face square to it.
  bool paint_kinks() {
    double low = kFarAway, high = -kFarAway;
    for (const End& e : ends_) {
      low = std::min(low, e.at[1]);
      high = std::max(high, e.at[1]);
    }
    for (const End& e : ends_) {
      bool met = false;
      for (const End& f : ends_)
        if (&e != &f && (e.at - f.at).norm() <= kSamePlace) {
          met = true;
          fan(e.normal, f.normal);
        }
      const bool top = e.at[1] >= high - kSamePlace, bottom = e.at[1] <= low + kSamePlace;
      if (e.at[0] <= kSamePlace)
        fan(e.normal, Vec2(0, e.at[1] > 0.5 * (low + high) ? 1 : -1));
      else if (!met && top != bottom)
        fan(e.normal, Vec2(0, top ? 1 : -1));
      else if (!met)
        return false;
    }
    return true;
  }

  double kinks() const { return kinks_; }
  std::vector<float> radii() const {
    std::vector<float> least;
    for (const double x : cell_)
      least.push_back(x < kFarAway ? std::nextafter(static_cast<float>(size_ * x), 0.0F) : 0.0F);
    return least;
  }

 private:
  struct End {
    Vec2 at, normal;
  };

  void add_end(const Vec2& at, const Vec2& velocity) {
    ends_.push_back({at, square_to(velocity, side_).normalized()});
  }
  // The first velocity that is one.
  template <class Iterator>
  Vec2 end_of(Iterator from, Iterator to) const {
    while (from + 1 != to && !(from->norm() > noise_n_)) ++from;
    return *from;
  }
  static Vec2 middle_of(const Bernstein<Vec2>& n) {
    Vec2 sum = Vec2::Zero();
    for (const Vec2& x : n) sum += x;
    return sum;
  }

  void fan(const Vec2& a, const Vec2& b) {
    const double angle = std::abs(std::atan2(a[0] * b[1] - a[1] * b[0], a.dot(b)));
    if (angle > kink_)
      put(place_of(a), place_of(b), 0);
    else if (angle > kProfileKink)
      kinks_ += angle;
  }
  void put(double from, double to, double radius) {
    const Cells cells = cells_of(from, to);
    for (int k = cells.first; k <= cells.last; ++k) cell_[k] = std::min(cell_[k], radius);
  }

  // All of a piece that is an arc of a circle at once. With |N|^2 >= m w^2, from coefficients of one degree,
  // and |det| <= b the radius |N|^3 / (w^3 |det|) is no less than m^(3/2) / b.
  bool paint_arc(const ProfileTurn& turn) {
    const Bernstein<Vec2>& n = turn.velocity;
    const auto dot = [](const Vec2& a, const Vec2& b) -> double { return a.dot(b); };
    const Bernstein<double> speed2 = multiply(n, n, dot);
    Bernstein<double> w2 = multiply(turn.weight, turn.weight);
    if (w2.size() < speed2.size()) w2 = multiply(w2, Bernstein<double>(speed2.size() - w2.size() + 1, 1.0));
    if (w2.size() != speed2.size()) return false;
    double least = kFarAway, most = 0;  // of the squared speed over w^2
    const double noise = 4 * noise_n_ * longest(n);
    for (std::size_t i = 0; i < w2.size(); ++i) {
      if (!(w2[i] > 0)) return false;
      least = std::min(least, (speed2[i] - noise) / w2[i]);
      most = std::max(most, (speed2[i] + noise) / w2[i]);
    }
    const auto [low, high] = std::minmax_element(turn.det.begin(), turn.det.end());
    const double bend = largest(turn.det) + noise_det_, least_bend = std::max(*low, -*high) - noise_det_;
    if (!(least > 0 && least_bend > 0)) return false;
    const double radius = least * std::sqrt(least) / bend;
    if (!(radius >= kArcSpread * most * std::sqrt(most) / least_bend)) return false;
    // It turns one way; by less than half a circle if no velocity is against their sum.
    const Vec2 sum = middle_of(n);
    for (const Vec2& x : n)
      if (!(x.dot(sum) > noise_n_ * sum.norm())) return false;
    put(place_of(square_to(n.front(), side_)), place_of(square_to(n.back(), side_)), radius);
    return true;
  }

  bool examine(ProfileLeaf leaf, int depth) {
    const Vec2 sum = middle_of(leaf.n);
    const double length = sum.norm();
    const Vec2 along = sum / length, across(-along[1], along[0]);
    double slowest = kFarAway, left = 0, right = 0;  // tangents of the velocities' angles from the middle
    bool told = length > 0;
    for (const Vec2& x : leaf.n) {
      const double forward = x.dot(along), side = x.dot(across);
      slowest = std::min(slowest, forward);
      if (x.norm() <= noise_n_) continue;  // a cusp's, or a pole's: says nothing of the direction
      if (!(forward > 0)) {
        told = false;
        continue;
      }
      left = std::max(left, side / forward);
      right = std::min(right, side / forward);
    }
    slowest = std::max(0.0, slowest - noise_n_);
    const auto [least_w, most_w] = std::minmax_element(leaf.w.begin(), leaf.w.end());
    const double bend = largest(leaf.det) + noise_det_;
    const double w = *most_w, radius = slowest * slowest * slowest / (w * w * w * bend);
    double from = 0, to = 1;
    if (told) {
      from = place_of(square_to(along + left * across, side_));
      to = place_of(square_to(along + right * across, side_));
    }
    bool done = told && std::abs(to - from) * kProfileCells <= kLeafCells;
    if (done && radius < kNearlyStraight) {
      double least_bend = kFarAway;
      for (const double x : leaf.det) least_bend = std::min(least_bend, std::abs(x));
      const double fastest = longest(leaf.n), v = *least_w;
      done = radius * v * v * v * least_bend >= kLeafSpread * fastest * fastest * fastest;
    }
    if (done || (told && depth == 0)) {
      put(from, to, radius);
      return true;
    }
    if (depth == 0) return false;
    ProfileLeaf other;
    std::tie(leaf.n, other.n) = halve(std::move(leaf.n));
    std::tie(leaf.det, other.det) = halve(std::move(leaf.det));
    std::tie(leaf.w, other.w) = halve(std::move(leaf.w));
    return examine(std::move(leaf), depth - 1) && examine(std::move(other), depth - 1);
  }

  const double size_, kink_;
  double kinks_ = 0;
  std::vector<double> cell_;  // radius over the body's size
  std::vector<End> ends_;
  double side_ = 1, noise_n_ = 0, noise_det_ = 0;
};

}  // namespace

double ProfileRadii::within(double cosine, double sine, double reach) const {
  if (least.empty() || !(reach < kWidestReach)) return 0;
  const double c = std::cos(reach), s = std::sin(reach);
  const Vec2 low(sine * c - cosine * s, cosine * c + sine * s),
      high(sine * c + cosine * s, cosine * c - sine * s);
  const Cells cells = cells_of(place_of(low), place_of(high));
  float radius = least[kProfileCells + cells.first];
  int from = cells.first + kProfileCells, to = cells.last + kProfileCells + 1;
  for (; from < to; from /= 2, to /= 2) {
    if (from % 2 == 1) radius = std::min(radius, least[from++]);
    if (to % 2 == 1) radius = std::min(radius, least[--to]);
  }
  return radius;
}

ProfileRadii make_profile_radii(const Meridian& m, const std::vector<BezierPatch>& patches, double size,
                                double kink) {
  if (m.empty()) return {};
  RadiiPainter painter(size, kink);
  for (const Meridian::Piece& piece : m.pieces)
    if (!painter.paint(piece, profile_turn(m, piece, patches, size))) return {};
  if (!painter.paint_kinks()) return {};
  return {tree_of(painter.radii()), painter.kinks()};
}

}  // namespace nurbs

// A ball fitted to every piece's Bernstein coefficients; see near_ball.h.
#include "body/near_ball.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <queue>
#include <utility>

#include "body/bounds.h"
#include "body/shape.h"
#include "nurbs/bernstein.h"

namespace nurbs {
namespace {

constexpr double kNearly = 8e-3;              // of the bounding radius, that the inner one lacks
constexpr int kMostPatches = 128;             // pairs of patches are looked at one by one
constexpr std::size_t kMostWork = 4000 * 81;  // coefficients of all pieces
constexpr double kLack = 1.5e-11;             // of the bounding radius, at which pieces are not halved
constexpr double kConeMargin = 1e-12;         // rad
constexpr double kLeastBulge = 1e-10;         // determinant of a piece's second moments over their product

using Coefficient = BallNet::Coefficient;
Vec3 point(const Coefficient& c) {
  return c.head<3>() / c[4];
}

BallNet net_of(const BezierPatch& patch, double radius) {
  BallNet out{2 * patch.degree_u, 2 * patch.degree_v, {}};
  out.net.assign(static_cast<std::size_t>(out.m + 1) * (out.n + 1), Coefficient::Zero());
  visit_products(patch, [&](std::size_t at, double c, const Vec4& a, const Vec4& b) {
    const double weight = a[3] * b[3];
    out.net[at].head<3>() += c * b[3] * a.head<3>();
    out.net[at][3] += c * (a.head<3>().dot(b.head<3>()) - radius * radius * weight);
    out.net[at][4] += c * weight;
  });
  for (std::size_t at = 0; at < out.net.size(); ++at) out.net[at] /= product_weight(out.m, out.n, at);
  return out;
}

// A net on part of its patch.
class NetPart {
 public:
  NetPart(const BallNet& whole, const BallPiece& p) : m_(whole.m), n_(whole.n) {
    std::copy(whole.net.begin(), whole.net.end(), c_.begin());
    const int row = n_ + 1;
    for (int j = 0; j < row; ++j) restrict_row(c_.data() + j, m_, row, p.u0, p.u0 + p.du);
    for (int i = 0; i <= m_; ++i) restrict_row(c_.data() + i * row, n_, 1, p.v0, p.v0 + p.dv);
  }
  // Keeps the first half, the other goes to `other`.
  void halve(bool in_u, NetPart* other) {
    other->m_ = m_;
    other->n_ = n_;
    halve_net(c_.data(), other->c_.data(), m_, n_, in_u);
  }
  NetPart() = default;

  const Coefficient* begin() const { return c_.data(); }
  const Coefficient* end() const { return c_.data() + static_cast<std::ptrdiff_t>(m_ + 1) * (n_ + 1); }
  bool is_longer_in_u() const {
    const auto at = [&](int i, int j) { return point(c_[static_cast<std::size_t>(i) * (n_ + 1) + j]); };
    double u = 0, v = 0;
    for (int j = 0; j <= n_; ++j) u = std::max(u, (at(m_, j) - at(0, j)).squaredNorm());
    for (int i = 0; i <= m_; ++i) v = std::max(v, (at(i, n_) - at(i, 0)).squaredNorm());
    return u >= v;
  }

 private:
  // To [low, high], by de Casteljau's steps at both.
  static void restrict_row(Coefficient* c, int degree, int stride, double low, double high) {
    if (high < 1)
      for (int step = 1; step <= degree; ++step)
        for (int i = degree; i >= step; --i)
          c[i * stride] += (1 - high) * (c[(i - 1) * stride] - c[i * stride]);
    if (low > 0)
      for (int step = 1; step <= degree; ++step)
        for (int i = 0; i <= degree - step; ++i)
          c[i * stride] += (low / high) * (c[(i + 1) * stride] - c[i * stride]);
  }

  int m_ = 0, n_ = 0;
  std::array<Coefficient, (2 * kMaxDegree + 1) * (2 * kMaxDegree + 1)> c_;
};

// Fills in the cone and the ball.
void fit(const NetPart& part, const NearBall& body, const Vec3& origin, BallPiece* piece) {
  Vec3 middle = Vec3::Zero();
  double height = 0;  // of |x|^2 - R^2
  for (const Coefficient& c : part) {
    middle += point(c);
    height += c[3] / c[4];
  }
  const auto count = static_cast<double>(part.end() - part.begin());
  middle /= count;
  height /= count;
  piece->axis = (middle - origin).normalized();
  // The slope of |x|^2 - R^2, by least squares: twice the ball's centre. Its share along the axis takes the
  // mean bend; of narrow pieces it is left out.
  Mat3 frame;
  frame.col(0) = piece->axis.unitOrthogonal();
  frame.col(1) = piece->axis.cross(frame.col(0));
  frame.col(2) = piece->axis;
  Mat3 square = Mat3::Zero();
  Vec3 right = Vec3::Zero();
  double chord2 = 0, farthest = 0;
  for (const Coefficient& c : part) {
    const Vec3 x = point(c), off = frame.transpose() * (x - middle);
    square += off * off.transpose();
    right += (c[3] / c[4] - height) * off;
    chord2 = std::max(chord2, ((x - origin).normalized() - piece->axis).squaredNorm());
    farthest = std::max(farthest, x.squaredNorm());
  }
  Vec3 slope = Vec3::Zero();
  const Vec3 scale = square.diagonal();
  const Mat2 across = square.topLeftCorner<2, 2>();
  if (square.determinant() > kLeastBulge * scale[0] * scale[1] * scale[2])
    slope = square.inverse() * right;
  else if (across.determinant() > kSingular * scale[0] * scale[1])
    slope.head<2>() = across.inverse() * right.head<2>();
  piece->centre = 0.5 * frame * slope;
  double least = kFarAway, most = -kFarAway;
  for (const Coefficient& c : part) {
    const double off = (c[3] - 2 * piece->centre.dot(c.head<3>())) / c[4];
    least = std::min(least, off);
    most = std::max(most, off);
  }
  // A cone of less than half the space is convex: what holds the control points holds the piece.
  const double angle = chord2 < 1 ? 2 * std::asin(0.5 * std::sqrt(chord2)) + body.widen : M_PI;
  piece->cosine = chord2 < 1 ? std::cos(angle) : -1;
  piece->sine = chord2 < 1 ? std::sin(angle) : 0;
  const Vec3 q = piece->centre - origin;
  const double q2 = q.squaredNorm(), q_along = std::abs(q.dot(piece->axis)),
               kept =
                   q_along * piece->cosine - std::sqrt(std::max(0.0, q2 - q_along * q_along)) * piece->sine,
               kept2 = kept > 0 ? kept * kept : 0,
               inside2 = body.radius * body.radius + least + piece->centre.squaredNorm() - q2 -
                         kBernsteinRoundoff * farthest;
  // With the origin outside the ball no more is known than that the body holds it.
  const bool inside = inside2 > 0;
  const double radius = inside ? std::sqrt(inside2 + kept2) : -std::sqrt(q2);
  piece->radius = radius - body.gape;
  piece->lack = inside
                    ? std::sqrt(inside2 + kept2 + most - least) - radius + std::sqrt(q2) * (1 - piece->cosine)
                    : body.radius;
  piece->loss = inside ? 0.5 * (q2 - kept2) / radius : 0;
  piece->halves = -1;
}

}  // namespace

BallPiece NearBall::whole(int patch, const Vec3& origin) const {
  BallPiece piece{patch, 0, 0, 1, 1, Vec3::Zero(), -1, 0, Vec3::Zero(), 0, 0, 0, -1};
  fit(NetPart(patches[patch], piece), *this, origin, &piece);
  return piece;
}

void NearBall::halve(const BallPiece& piece, const Vec3& origin, BallPiece* first, BallPiece* second) const {
  NetPart part(patches[piece.patch], piece), other;
  const bool in_u = part.is_longer_in_u();
  part.halve(in_u, &other);
  *first = *second = piece;
  if (in_u) {
    first->du = second->du = 0.5 * piece.du;
    second->u0 += first->du;
  } else {
    first->dv = second->dv = 0.5 * piece.dv;
    second->v0 += first->dv;
  }
  fit(part, *this, origin, first);
  fit(other, *this, origin, second);
}

NearBall make_near_ball(const Shape& shape) {
  NearBall out;
  const double size = shape.bounding_radius;
  if (!(shape.inner_radius >= (1 - kNearly) * size) || shape.patches.size() > kMostPatches) return out;
  out.radius = 0.5 * (size + shape.inner_radius);
  out.gape = shape.proofs.joint_gap;
  out.widen = 2 * out.gape / shape.inner_radius + kConeMargin;
  std::priority_queue<std::pair<double, int>> lacking;
  const auto put = [&](const BallPiece& piece) {
    if (piece.lack > kLack * size) lacking.push({piece.lack, static_cast<int>(out.pieces.size())});
    out.pieces.push_back(piece);
  };
  for (int k = 0; k < static_cast<int>(shape.patches.size()); ++k) {
    out.patches.push_back(net_of(shape.patches[k], out.radius));
    put(out.whole(k, Vec3::Zero()));
  }
  std::size_t largest = 0;
  for (const BallNet& patch : out.patches) largest = std::max(largest, patch.net.size());
  while (!lacking.empty() && (out.pieces.size() + 2) * largest <= kMostWork) {
    const int k = lacking.top().second;
    lacking.pop();
    BallPiece first, second;
    out.halve(out.pieces[k], Vec3::Zero(), &first, &second);
    out.pieces[k].halves = static_cast<int>(out.pieces.size());
    put(first);
    put(second);
  }
  return out;
}

}  // namespace nurbs

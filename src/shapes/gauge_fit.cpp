// A barrier method over the splines of a gauge function.
#include "shapes/gauge_fit.h"

#include <Eigen/Dense>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <utility>

#include "shapes/smooth_cube.h"

namespace nurbs {
namespace {

using Vector = Eigen::VectorXd;
using Sparse = Eigen::SparseMatrix<double>;

constexpr int kSteps = 120, kCentreSteps = 4;
constexpr double kFirstRoom = 1.5;  // allowed error over that of the ball the fit starts from
constexpr double kMargin = 1.01;    // allowed error over the one found, where it must be raised
constexpr double kPullGrowth = 4;   // of the pull on the allowed error, after steps of kFreeStep or more
constexpr double kFreeStep = 0.5;   // share of Newton's step
constexpr double kGap = 0.01;       // share of the allowed error: so near to the least one it ends
constexpr double kForms = 0.5;      // weight of log det of curvature, that of a distance being 1
constexpr double kKept = 0.95;      // share of the present curvature that may be asked to stay
constexpr double kBacktrack = 0.6, kShortest = 1e-4;
constexpr double kRegular = 1e-9;  // of the conditions' block of the matrix

using Shares = SmoothCube::Shares;  // in g, g_a, g_b, g_aa, g_ab, g_bb

// A ray: its point of the cube, with the derivatives there by the face's parameters.
struct Ray {
  int piece;
  Vec3 y, ya, yb;
  double target;  // the hull's gauge

  // The gauge function's gradient, from its values on the face.
  Vec3 gradient(double g, double ga, double gb) const {
    const Vec3 n = ya.cross(yb);
    return ga * ya + gb * yb + n * ((g - ga * ya.dot(y) - gb * yb.dot(y)) / n.dot(y));
  }
};

struct Place : Ray {  // of the grid, where the body may be outside and must be convex
  int shares;
  double wanted;     // distance along the facet over the relative difference of gauges, in distances wanted
  Mat2 first;        // of the present body: its curvatures are those of g's second derivatives over this form
  double curvature;  // asked for
};

struct Vertex : Ray {  // of the hull, where the body may be inside
  Shares shares;
  double wanted;
};

double least_root(const Mat2& second, const Mat2& first) {  // of det(second - k first) = 0
  const double mean =
      0.5 * (first(0, 0) * second(1, 1) + first(1, 1) * second(0, 0)) - first(0, 1) * second(0, 1);
  const double det = first.determinant();
  return (mean - std::sqrt(std::max(mean * mean - det * second.determinant(), 0.0))) / det;
}

// Terms of Newton's step of one piece; `border`: mixed derivatives by the allowed error.
struct Sums {
  explicit Sums(int n)
      : matrix(Eigen::MatrixXd::Zero(n, n)),
        load(Vector::Zero(n)),
        border(Vector::Zero(n)),
        rows(n, kBatch) {}
  void add(const Vector& row) {
    rows.col(batch++) = row;
    if (batch == kBatch) flush();
  }
  void flush() {
    if (batch > 0) matrix.selfadjointView<Eigen::Lower>().rankUpdate(rows.leftCols(batch));
    batch = 0;
  }
  static constexpr int kBatch = 64;
  Eigen::MatrixXd matrix;
  Vector load, border;
  Eigen::MatrixXd rows;
  int batch = 0;
};

class Barrier {
  static constexpr double kOutside = 1e300;

 public:
  Barrier(int degree, int spans, const ConvexHull& hull, const GaugeFitOptions& options)
      : cube_(degree, spans, CubeKind::gauge), options_(options) {
    make_places(hull);
    for (const Vec3& v : hull.mesh().points) add_vertex(v);
    make_matrix();
  }

  GaugeFit run() {
    gauge_ = ball();
    refer();
    allowed_ = kFirstRoom * worst();
    const double terms =
        (1 + 2 * kForms) * static_cast<double>(places_.size()) + static_cast<double>(vertices_.size());
    pull_ = terms / allowed_;
    int centred = 0;
    for (int k = 0; k < kSteps && centred < kCentreSteps; ++k) {
      const double length = newton();
      if (length == 0) break;
      if (met_) {
        centred += length == 1;
        continue;
      }
      if (length < kFreeStep && allowed_ > 1) continue;
      if (terms < kGap * allowed_ * pull_) break;
      refer();
      allowed_ = std::max(allowed_, kMargin * worst());
      met_ = worst() * kMargin <= 1 && allowed_ <= kMargin;
      if (met_) allowed_ = 1;
      pull_ *= kPullGrowth;
    }
    gauge_ = cube_.tidied(gauge_);
    return {cube_.surfaces(gauge_), worst()};
  }

 private:
  int piece(int f, int a, int b) const { return (f * cube_.spans() + a) * cube_.spans() + b; }

  static Ray make_ray(int piece, int f, const Vec3& y, double target) {
    const Vec3 middle = cube_direction(f, 0, 0);
    return {piece, y, cube_direction(f, 1, 0) - middle, cube_direction(f, 0, 1) - middle, target};
  }

  void make_places(const ConvexHull& hull) {
    const ConvexHull polar(polar_points(hull));
    const int spans = cube_.spans(), p = cube_.degree(), n = spans == 1 ? 13 : p + 5;
    const auto at = [&](int k) { return k / (n - 1.0); };
    std::vector<SmoothCube::Basis> bases;
    for (int a = 0; a < spans; ++a)
      for (int i = 0; i < n; ++i) bases.push_back(cube_.basis(a, at(i)));
    for (int a = 0; a < spans; ++a)
      for (int b = 0; b < spans; ++b)
        for (int i = 0; i < n; ++i)
          for (int j = 0; j < n; ++j) shares_.push_back(cube_.shares(bases[a * n + i], bases[b * n + j]));
    int facet = 0;
    for (SmoothCube::Piece& of : cube_.pieces()) {
      const int f = of.face, a = of.a, b = of.b;
      const int k = static_cast<int>(columns_.size());
      columns_.push_back(std::move(of.columns));
      for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j) {
          const Vec3 y = cube_direction(f, cube_.parameter(a, at(i)), cube_.parameter(b, at(j)));
          facet = polar.support(y, facet);
          const Vec3& q = polar.mesh().points[facet];
          Place s;
          static_cast<Ray&>(s) = make_ray(k, f, y, q.dot(y));
          s.shares = ((a * spans + b) * n + i) * n + j;
          s.wanted = 1 / ((options_.metric * q).norm() * options_.outward);
          places_.push_back(s);
        }
    }
  }

  void add_vertex(const Vec3& v) {
    int axis = 0;
    const double size = v.cwiseAbs().maxCoeff(&axis);
    const int f = 2 * axis + (v[axis] > 0 ? 0 : 1);
    const CubeFace face = cube_face(f);
    int span[2];
    SmoothCube::Basis basis[2];
    for (int d = 0; d < 2; ++d) {
      const double x = v[d == 0 ? face.u : face.v] / size;
      const int a = span[d] = cube_.span_of(x);
      basis[d] =
          cube_.basis(a, (x - cube_.parameter(a, 0)) / (cube_.parameter(a, 1) - cube_.parameter(a, 0)));
    }
    Vertex s;
    static_cast<Ray&>(s) = make_ray(piece(f, span[0], span[1]), f, v / size, 1 / size);
    s.shares = cube_.shares(basis[0], basis[1]);
    vertices_.push_back(std::move(s));
  }

  Vector local(const Vector& g, int piece) const {
    const std::vector<int>& columns = columns_[piece];
    Vector out(columns.size());
    for (size_t c = 0; c < columns.size(); ++c) out[c] = g[columns[c]];
    return out;
  }

  // Forms, normals and the curvature asked for, of the present body: held in a step.
  void refer() {
    for (Place& s : places_) {
      const Eigen::Matrix<double, 1, 6> j = local(gauge_, s.piece).transpose() * shares_[s.shares];
      const double g = j[0];
      const Vec3 xa = s.ya / g - s.y * (j[1] / (g * g)), xb = s.yb / g - s.y * (j[2] / (g * g));
      s.first << xa.dot(xa), xa.dot(xb), xa.dot(xb), xb.dot(xb);
      s.first *= g * s.gradient(g, j[1], j[2]).norm();
      Mat2 second;
      second << j[3], j[4], j[4], j[5];
      s.curvature = std::min(options_.least_curvature, kKept * least_root(second, s.first));
    }
    for (Vertex& s : vertices_) {
      const Eigen::Matrix<double, 1, 6> j = local(gauge_, s.piece).transpose() * s.shares;
      s.wanted = 1 / ((options_.metric * s.gradient(j[0], j[1], j[2])).norm() * options_.inward);
    }
  }

  // Largest distance over that wanted.
  double worst() const {
    double out = 0;
    for (const Place& s : places_)
      out = std::max(out, s.wanted * (s.target / local(gauge_, s.piece).dot(shares_[s.shares].col(0)) - 1));
    for (const Vertex& s : vertices_)
      out = std::max(out, s.wanted * (local(gauge_, s.piece).dot(s.shares.col(0)) / s.target - 1));
    return out;
  }

  struct ByAllowed {  // derivatives by the allowed error
    double first = 0, second = 0;
  };

  // The pull on the allowed error less the logarithms of what the bounds leave; kOutside where one is broken.
  // With `sums`, the terms of Newton's step.
  double barrier(const Vector& g, double allowed, std::vector<Sums>* sums, ByAllowed& by) const {
    double value = pull_ * allowed;
    by = {pull_, 0};
    int now = -1;
    Vector net;
    for (const Place& s : places_) {
      if (s.piece != now) net = local(g, now = s.piece);
      const Shares& share = shares_[s.shares];
      const Eigen::Matrix<double, 1, 6> j = net.transpose() * share;
      const double least = 1 / (1 + allowed / s.wanted), left = j[0] / s.target - least;
      const double l = j[3] - s.curvature * s.first(0, 0), m = j[4] - s.curvature * s.first(0, 1),
                   n = j[5] - s.curvature * s.first(1, 1), det = l * n - m * m;
      if (!(left > 0) || !(l > 0) || !(det > 0)) return kOutside;
      value -= std::log(left) + kForms * std::log(det);
      if (!sums) continue;
      Sums& to = (*sums)[s.piece];
      const double slope = 1 / (s.target * left), d = least * least / (s.wanted * left);
      to.load -= slope * share.col(0);
      to.add(slope * share.col(0));
      to.border += slope * d * share.col(0);
      by.first -= d;
      by.second += d * d + 2 * d * least / s.wanted;
      // V = [l m; m n], V^-1 = L L^T with L = [a b; 0 c]: rows of L^T dV L.
      const double a = 1 / std::sqrt(l), c = std::sqrt(l / det), b = -m / l * c;
      const Vector aa = a * a * share.col(3);
      const Vector cc = b * b * share.col(3) + 2 * b * c * share.col(4) + c * c * share.col(5);
      to.load -= kForms * (aa + cc);
      to.add(std::sqrt(kForms) * aa);
      to.add(std::sqrt(kForms) * cc);
      to.add(std::sqrt(2 * kForms) * (a * b * share.col(3) + a * c * share.col(4)));
    }
    for (const Vertex& s : vertices_) {
      const double left = allowed / s.wanted - (local(g, s.piece).dot(s.shares.col(0)) / s.target - 1);
      if (!(left > 0)) return kOutside;
      value -= std::log(left);
      if (!sums) continue;
      Sums& to = (*sums)[s.piece];
      const double slope = 1 / (s.target * left), d = 1 / (s.wanted * left);
      to.load += slope * s.shares.col(0);
      to.add(slope * s.shares.col(0));
      to.border -= slope * d * s.shares.col(0);
      by.first -= d;
      by.second += d * d;
    }
    return value;
  }

  // [H C^T; C -eps], H empty.
  void make_matrix() {
    const int count = cube_.count(), size = count + static_cast<int>(cube_.conditions().rows());
    std::vector<Eigen::Triplet<double>> entries;
    for (const auto& columns : columns_)
      for (int i : columns)
        for (int j : columns)
          if (i >= j) entries.emplace_back(i, j, 0);
    const Sparse& c = cube_.conditions();
    for (int column = 0; column < c.outerSize(); ++column)
      for (Sparse::InnerIterator it(c, column); it; ++it)
        entries.emplace_back(count + it.row(), it.col(), it.value());
    for (int k = count; k < size; ++k) entries.emplace_back(k, k, -kRegular);
    matrix_.resize(size, size);
    matrix_.setFromTriplets(entries.begin(), entries.end());
    solver_.analyzePattern(matrix_);
  }

  // Newton's step as far as the barrier falls; its share taken, 0 where none is.
  double newton() {
    std::vector<Sums> sums(columns_.size(), Sums(static_cast<int>(columns_[0].size())));
    ByAllowed by;
    const double before = barrier(gauge_, allowed_, &sums, by);
    if (!(before < kOutside)) return 0;
    const int count = cube_.count();
    Vector right = Vector::Zero(matrix_.rows()), border = right;
    double trace = 0;
    for (size_t p = 0; p < columns_.size(); ++p) {
      sums[p].flush();
      trace += sums[p].matrix.trace();
      for (size_t c = 0; c < columns_[p].size(); ++c) {
        right[columns_[p][c]] -= sums[p].load[c];
        border[columns_[p][c]] += sums[p].border[c];
      }
    }
    const double scale = count / trace;
    put(sums, scale);
    right *= scale;
    border *= scale;
    right.tail(matrix_.rows() - count) = -(cube_.conditions() * gauge_);
    solver_.factorize(matrix_);
    if (solver_.info() != Eigen::Success) return 0;
    Vector step = solve(right).head(count);
    double more = 0;
    if (!met_) {
      const Vector along = solve(border).head(count);
      const Vector b = border.head(count);
      more = -(by.first * scale + b.dot(step)) / (by.second * scale - b.dot(along));
      step -= more * along;
    }
    for (double length = 1; length > kShortest; length *= kBacktrack) {
      const Vector trial = gauge_ + length * step;
      if (!(barrier(trial, allowed_ + length * more, nullptr, by) < before)) continue;
      gauge_ = trial;
      allowed_ += length * more;
      return length;
    }
    return 0;
  }

  void put(const std::vector<Sums>& sums, double scale) {
    for (int column = 0; column < cube_.count(); ++column)
      for (Sparse::InnerIterator it(matrix_, column); it; ++it)
        if (it.row() < cube_.count()) it.valueRef() = 0;
    for (size_t p = 0; p < columns_.size(); ++p) {
      const std::vector<int>& columns = columns_[p];
      for (size_t i = 0; i < columns.size(); ++i)
        for (size_t j = 0; j <= i; ++j)
          matrix_.coeffRef(std::max(columns[i], columns[j]), std::min(columns[i], columns[j])) +=
              scale * sums[p].matrix(static_cast<int>(i), static_cast<int>(j));
    }
  }

  Vector solve(const Vector& right) const {  // refined once
    const Vector x = solver_.solve(right);
    return x + Vector(solver_.solve(right - matrix_.selfadjointView<Eigen::Lower>() * x));
  }

  // The gauge of a ball of the vertices' mean radius: the nearest splines.
  Vector ball() const {
    double radius = 0;
    for (const Vertex& v : vertices_) radius += v.y.norm() / v.target / static_cast<double>(vertices_.size());
    Vector right = Vector::Zero(matrix_.rows());
    std::vector<Eigen::Triplet<double>> entries;
    for (const Place& s : places_) {
      const std::vector<int>& columns = columns_[s.piece];
      const auto& share = shares_[s.shares].col(0);
      for (size_t i = 0; i < columns.size(); ++i) {
        right[columns[i]] += share[i] * s.y.norm() / radius;
        for (size_t j = 0; j < columns.size(); ++j)
          if (columns[i] >= columns[j]) entries.emplace_back(columns[i], columns[j], share[i] * share[j]);
      }
    }
    Sparse mass(matrix_.rows(), matrix_.cols());
    mass.setFromTriplets(entries.begin(), entries.end());
    const Eigen::SimplicialLDLT<Sparse, Eigen::Lower> solver(Sparse(matrix_ + mass));
    return Vector(solver.solve(right)).head(cube_.count());
  }

  SmoothCube cube_;
  const GaugeFitOptions& options_;
  std::vector<std::vector<int>> columns_;  // of every piece: its control points
  std::vector<Shares> shares_;             // of a face's places
  std::vector<Place> places_;
  std::vector<Vertex> vertices_;
  Sparse matrix_;
  Eigen::SimplicialLDLT<Sparse, Eigen::Lower> solver_;
  Vector gauge_;
  double allowed_ = 0;  // largest distance over that wanted
  double pull_ = 0;     // on the allowed error
  bool met_ = false;
};

}  // namespace

GaugeFit fit_gauge(int degree, int spans, const ConvexHull& hull, const GaugeFitOptions& options) {
  return Barrier(degree, spans, hull, options).run();
}

}  // namespace nurbs

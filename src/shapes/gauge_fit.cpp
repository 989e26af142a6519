// A primal-dual interior-point method over the splines of a gauge function.
#include "shapes/gauge_fit.h"

#include <Eigen/Dense>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "shapes/smooth_cube.h"

namespace nurbs {
namespace {

using Vector = Eigen::VectorXd;
using Sparse = Eigen::SparseMatrix<double>;

constexpr int kSteps = 60;
constexpr int kCentreSteps = 12;       // at the most ...
constexpr double kCentred = 0.1;       // ... and until no slack changes by more than this share
constexpr int kDenser = 3;             // times that places are added where there are dents between others
constexpr double kFirstRoom = 1.5;     // allowed error over that of the ball the fit starts from
constexpr double kNearly = 1.03;       // of the distances wanted: from there on the centre is looked for ...
constexpr double kRoom = 1.005;        // ... of what the distances wanted, or this times those reached, leave
constexpr double kMostChange = 0.5;    // share of the gauge that a step may change
constexpr double kGap = 0.01;          // share of the allowed error: so near to the least one it ends
constexpr double kFarGap = 0.04;       // .. where that one is too far
constexpr double kForms = 0.5;         // weight of log det of curvature, that of a distance being 1
constexpr double kInside = 0.97;       // of the way to a bound
constexpr double kShortest = 1e-4;     // steps: nothing more is to be had
constexpr double kReserve = 0.25;      // share of the least curvature that is wanted between places
constexpr double kNewSlack = 0.1;      // of a place added, over its form's trace
constexpr double kLeastPush = 0.5;     // outward bounds' weight over their distance from the hull
constexpr double kFirstInside = 0.1;   // least slack of a place's inward bound at first, of the distance
constexpr double kRegularised = 1e-9;  // of the conditions' block of the matrix

// A bound's slack and multiplier, the residual of the slack, changes of both in a step, the product of those
// that the first, affine step would make, and the bound's weight where the centre is looked for.
struct Slack {
  double s = 1, z = 1, residual = 0, ds = 0, dz = 0, affine = 0, weight = 1;
};

// The same of a symmetric matrix that is to be positive definite.
struct FormSlack {
  Mat2 s, z, residual, ds, dz, affine = Mat2::Zero();
};

Mat2 symmetric(const Mat2& m) {
  return 0.5 * (m + m.transpose());
}

double least_root(const Mat2& second, const Mat2& first) {  // of det(second - k first) = 0
  const double mean =
      0.5 * (first(0, 0) * second(1, 1) + first(1, 1) * second(0, 0)) - first(0, 1) * second(0, 1);
  const double det = first.determinant();
  return (mean - std::sqrt(std::max(mean * mean - det * second.determinant(), 0.0))) / det;
}

// A ray: its point of the cube, with the derivatives there by the face's parameters.
struct Ray {
  Vec3 y, ya, yb;
  double target;  // the hull's gauge

  // The gauge function's gradient, from its values on the face.
  Vec3 gradient(double g, double ga, double gb) const {
    const Vec3 n = ya.cross(yb);
    return ga * ya + gb * yb + n * ((g - ga * ya.dot(y) - gb * yb.dot(y)) / n.dot(y));
  }

  // Of the body along the face's parameters: its curvatures are those of g's second derivatives over it.
  Mat2 first_form(double g, double ga, double gb) const {
    const Vec3 xa = ya / g - y * (ga / (g * g)), xb = yb / g - y * (gb / (g * g));
    Mat2 out;
    out << xa.dot(xa), xa.dot(xb), xa.dot(xb), xb.dot(xb);
    return out * (g * gradient(g, ga, gb).norm());
  }
};

struct Place : Ray {  // of the grid, where the body may be outside and must be convex
  int shares;
  double wanted;       // distance along the facet over the relative difference of gauges, in distances wanted
  double inward = 1;   // the same of distances inward, along the body's normal
  Mat2 first;          // form of the present body, held in a step
  bool apart = false;  // between the others: only for its curvature
  Slack distance, inside;
  FormSlack form;
};

using Jet = Eigen::Matrix<double, 1, 6>;  // g, g_a, g_b, g_aa, g_ab, g_bb

Mat2 second_form(const Jet& j) {
  Mat2 out;
  out << j[3], j[4], j[4], j[5];
  return out;
}

template <int kDegree>
class InteriorPoint {
  static constexpr int kLocal = (kDegree + 1) * (kDegree + 1);  // control points of a piece
  using Local = Eigen::Matrix<double, kLocal, 1>;
  using Shares = Eigen::Matrix<double, kLocal, 6>;  // in a Jet

  struct Vertex : Ray {                       // of the hull, where the body may be inside
    Eigen::Matrix<double, kLocal, 3> shares;  // in g, g_a, g_b
    double wanted;
    Slack distance;
  };

  struct Piece {
    std::vector<int> columns;
    std::vector<Place> places;
    std::vector<Vertex> vertices;
    std::vector<int> entries;  // of its matrix, column by column of the lower triangle, among the whole one's
  };

  // Terms of a step: of one piece's matrix, its right side, its mixed derivatives by the allowed error.
  struct Sums {
    void clear() {
      matrix.setZero();
      load.setZero();
      border.setZero();
    }
    template <typename Row>
    void add(const Row& row) {
      rows.col(batch++) = row;
      if (batch == kBatch) flush();
    }
    void flush() {
      if (batch > 0) matrix.template selfadjointView<Eigen::Lower>().rankUpdate(rows.leftCols(batch));
      batch = 0;
    }
    static constexpr int kBatch = 64;
    Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(kLocal, kLocal);
    Local load = Local::Zero(), border = Local::Zero();
    Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(kLocal, kBatch);
    int batch = 0;
  };

 public:
  InteriorPoint(int spans, const ConvexHull& hull, const GaugeFitOptions& options)
      : cube_(kDegree, spans, CubeKind::gauge), options_(options), places_(spans == 1 ? 13 : kDegree + 5) {
    make_places(hull);
    for (const Vec3& v : hull.mesh().points) add_vertex(v);
    make_matrix();
  }

  GaugeFit run() {
    gauge_ = ball();
    refer();
    allowed_ = kFirstRoom * worst();
    begin();
    bool met = false;
    for (int k = 0; k < kSteps && !met; ++k) {
      if (!descend()) break;
      refer();
      met = worst() <= 1 && is_convex();
      const double gap = terms_ * mean_product();
      if (gap < kGap * allowed_ || (gap < kFarGap * allowed_ && allowed_ - gap > kNearly)) break;
    }
    if (worst() <= kNearly) centre();
    gauge_ = cube_.tidied(gauge_);
    return {cube_.surfaces(gauge_), worst()};
  }

 private:
  static Ray make_ray(int f, const Vec3& y, double target) {
    const Vec3 middle = cube_direction(f, 0, 0);
    return {y, cube_direction(f, 1, 0) - middle, cube_direction(f, 0, 1) - middle, target};
  }

  void make_places(const ConvexHull& hull) {
    const ConvexHull polar(polar_points(hull));
    const int spans = cube_.spans(), n = places_;
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
      pieces_.emplace_back();
      Piece& piece = pieces_.back();
      piece.columns = std::move(of.columns);
      for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j) {
          const Vec3 y = cube_direction(f, cube_.parameter(a, at(i)), cube_.parameter(b, at(j)));
          facet = polar.support(y, facet);
          const Vec3& q = polar.mesh().points[facet];
          Place s;
          static_cast<Ray&>(s) = make_ray(f, y, q.dot(y));
          s.shares = ((a * spans + b) * n + i) * n + j;
          s.wanted = 1 / ((options_.metric * q).norm() * options_.outward);
          piece.places.push_back(s);
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
    static_cast<Ray&>(s) = make_ray(f, v / size, 1 / size);
    s.shares = cube_.shares(basis[0], basis[1]).leftCols(3);
    pieces_[(f * cube_.spans() + span[0]) * cube_.spans() + span[1]].vertices.push_back(std::move(s));
  }

  static Local local(const Vector& g, const Piece& piece) {
    Local out;
    for (int c = 0; c < kLocal; ++c) out[c] = g[piece.columns[c]];
    return out;
  }
  Jet jet(const Local& net, const Place& s) const { return net.transpose() * shares_[s.shares]; }
  // What is to be positive definite.
  Mat2 form(const Jet& j, const Place& s) const {
    return second_form(j) - options_.least_curvature * s.first;
  }

  double wanted_inward(const Ray& ray, double g, double ga, double gb) const {
    return 1 / ((options_.metric * ray.gradient(g, ga, gb)).norm() * options_.inward);
  }

  // First forms and normals of the present body: held in a step.
  void refer() {
    for (Piece& piece : pieces_) {
      const Local net = local(gauge_, piece);
      for (Place& s : piece.places) {
        const Jet j = jet(net, s);
        s.first = s.first_form(j[0], j[1], j[2]);
        s.inward = wanted_inward(s, j[0], j[1], j[2]);
      }
      for (Vertex& s : piece.vertices) {
        const Eigen::Matrix<double, 1, 3> j = net.transpose() * s.shares;
        s.wanted = wanted_inward(s, j[0], j[1], j[2]);
      }
    }
  }

  // Largest distance over that wanted.
  double worst() const {
    double out = 0;
    for (const Piece& piece : pieces_) {
      const Local net = local(gauge_, piece);
      for (const Place& s : piece.places)
        if (!s.apart) out = std::max(out, s.wanted * (s.target / net.dot(shares_[s.shares].col(0)) - 1));
      for (const Vertex& s : piece.vertices)
        out = std::max(out, s.wanted * (net.dot(s.shares.col(0)) / s.target - 1));
    }
    return out;
  }

  bool is_convex() const {
    for (const Piece& piece : pieces_) {
      const Local net = local(gauge_, piece);
      for (const Place& s : piece.places) {
        const Jet j = jet(net, s);
        if (!(j[3] > 0 && j[3] * j[5] > j[4] * j[4])) return false;
      }
    }
    return true;
  }

  // --- bounds: what is left to them, linear in the splines, and by the allowed error t

  struct Left {
    double value, by_allowed, bend;  // first and second derivative by t
    double share;                    // of g in `value`
  };
  static Left left(const Place& s, double g, double t) {
    const double least = 1 / (1 + t / s.wanted), by = least * least / s.wanted;
    return {g / s.target - least, by, -2 * by * least / s.wanted, 1 / s.target};
  }
  static Left left_inside(const Ray& s, double wanted, double g, double t) {
    return {t / wanted - (g / s.target - 1), 1 / wanted, 0, -1 / s.target};
  }
  static Left left(const Vertex& s, double g, double t) { return left_inside(s, s.wanted, g, t); }
  static Left left_inside(const Place& s, double g, double t) { return left_inside(s, s.inward, g, t); }

  // The distances that are bounded at a place, where the gauge is g.
  template <typename AnyPlace, typename Do>
  void for_bounds(AnyPlace& s, double g, const Do& act) const {
    if (s.apart) return;
    act(s.distance, left(s, g, allowed_));
    if (centring_) act(s.inside, left_inside(s, g, allowed_));
  }

  // Slacks as the ball leaves them, multipliers of one product with which the pull on t is in balance.
  void begin() {
    double pull = 0;
    terms_ = 0;
    const auto start = [&](Slack& slack, const Left& c) {
      slack.s = c.value;
      pull += c.by_allowed / c.value;
      terms_ += 1;
    };
    for (Piece& piece : pieces_) {
      const Local net = local(gauge_, piece);
      for (Place& s : piece.places) {
        const Jet j = jet(net, s);
        start(s.distance, left(s, j[0], allowed_));
        s.form.s = form(j, s);
        terms_ += 2 * kForms;
      }
      for (Vertex& s : piece.vertices) start(s.distance, left(s, net.dot(s.shares.col(0)), allowed_));
    }
    for (Piece& piece : pieces_) {
      for (Place& s : piece.places) {
        s.distance.z = 1 / (pull * s.distance.s);
        s.form.z = kForms / pull * s.form.s.inverse();
      }
      for (Vertex& s : piece.vertices) s.distance.z = 1 / (pull * s.distance.s);
    }
  }

  template <typename Do>
  void for_slacks(const Do& act) {
    for (Piece& piece : pieces_) {
      for (Place& s : piece.places) {
        if (s.apart) continue;
        act(s.distance);
        if (centring_) act(s.inside);
      }
      for (Vertex& s : piece.vertices) act(s.distance);
    }
  }
  template <typename Do>
  void for_forms(const Do& act) {
    for (Piece& piece : pieces_)
      for (Place& s : piece.places) act(s.form);
  }

  // Mean product of slacks and multipliers; after steps of these lengths.
  double mean_product(double primal = 0, double dual = 0) {
    double sum = 0;
    for_slacks([&](const Slack& c) { sum += (c.s + primal * c.ds) * (c.z + dual * c.dz); });
    for_forms(
        [&](const FormSlack& c) { sum += (c.s + primal * c.ds).cwiseProduct(c.z + dual * c.dz).sum(); });
    return sum / terms_;
  }

  // --- steps

  // [H C^T; C -eps], H empty, and where the pieces' entries are.
  void make_matrix() {
    const int count = cube_.count(), size = count + static_cast<int>(cube_.conditions().rows());
    std::vector<Eigen::Triplet<double>> entries;
    for (const Piece& piece : pieces_)
      for (int i : piece.columns)
        for (int j : piece.columns)
          if (i >= j) entries.emplace_back(i, j, 0);
    const Sparse& c = cube_.conditions();
    for (int column = 0; column < c.outerSize(); ++column)
      for (Sparse::InnerIterator it(c, column); it; ++it)
        entries.emplace_back(count + it.row(), it.col(), it.value());
    for (int k = count; k < size; ++k) entries.emplace_back(k, k, -kRegularised);
    matrix_.resize(size, size);
    matrix_.setFromTriplets(entries.begin(), entries.end());
    matrix_.makeCompressed();
    empty_ = Vector::Map(matrix_.valuePtr(), matrix_.nonZeros());
    solver_.analyzePattern(matrix_);
    for (Piece& piece : pieces_)
      for (int j = 0; j < kLocal; ++j)
        for (int i = j; i < kLocal; ++i) {
          const auto [column, row] = std::minmax(piece.columns[i], piece.columns[j]);
          const int* begin = matrix_.innerIndexPtr() + matrix_.outerIndexPtr()[column];
          const int* end = matrix_.innerIndexPtr() + matrix_.outerIndexPtr()[column + 1];
          piece.entries.push_back(
              static_cast<int>(std::lower_bound(begin, end, row) - matrix_.innerIndexPtr()));
        }
  }

  struct Right {
    Vector splines;
    double allowed = 0;
  };

  // The right side of a step towards products of `product`, less those of the affine step where `corrected`:
  // what balances the pull on t and the bounds' pushes.
  Right right_side(double product, bool corrected) {
    Right out{Vector::Zero(matrix_.rows()), -1};
    for (Piece& piece : pieces_) {
      const Local net = local(gauge_, piece);
      Local load = Local::Zero();
      const auto push = [&](const Slack& c, const Left& l, const auto& share) {
        const double q = (c.weight * product - (corrected ? c.affine : 0)) / c.s - c.z / c.s * c.residual;
        load += q * l.share * share;
        out.allowed += q * l.by_allowed;
      };
      for (const Place& s : piece.places) {
        const auto& share = shares_[s.shares];
        for_bounds(s, net.dot(share.col(0)),
                   [&](const Slack& c, const Left& l) { push(c, l, share.col(0)); });
        const FormSlack& c = s.form;
        const Mat2 inverse = c.s.inverse();
        Mat2 q = kForms * product * inverse - symmetric(inverse * c.residual * c.z);
        if (corrected) q -= c.affine;
        load += q(0, 0) * share.col(3) + 2 * q(0, 1) * share.col(4) + q(1, 1) * share.col(5);
      }
      for (const Vertex& s : piece.vertices)
        push(s.distance, left(s, net.dot(s.shares.col(0)), allowed_), s.shares.col(0));
      for (int k = 0; k < kLocal; ++k) out.splines[piece.columns[k]] += load[k];
    }
    out.splines.tail(matrix_.rows() - cube_.count()) = -(cube_.conditions() * gauge_) / scale_;
    return out;
  }

  // Residuals, and the matrix of a step (scaled to entries of about 1) with its border; false where it is not
  // to be had.
  bool assemble() {
    Vector::Map(matrix_.valuePtr(), matrix_.nonZeros()).setZero();
    border_ = Vector::Zero(matrix_.rows());
    corner_ = 0;
    double trace = 0, *const value = matrix_.valuePtr();
    for (Piece& piece : pieces_) {
      const Local net = local(gauge_, piece);
      sums_.clear();
      const auto bound = [&](Slack& c, const Left& l, const auto& share) {
        c.residual = l.value - c.s;
        const double weight = c.z / c.s;
        sums_.add(std::sqrt(weight) * l.share * share);
        sums_.border += weight * l.by_allowed * l.share * share;
        corner_ += weight * l.by_allowed * l.by_allowed - c.z * l.bend;
      };
      for (Place& s : piece.places) {
        const auto& share = shares_[s.shares];
        const Jet j = net.transpose() * share;
        for_bounds(s, j[0], [&](Slack& c, const Left& l) { bound(c, l, share.col(0)); });
        s.form.residual = form(j, s) - s.form.s;
        add_form(s.form, share);
      }
      for (Vertex& s : piece.vertices)
        bound(s.distance, left(s, net.dot(s.shares.col(0)), allowed_), s.shares.col(0));
      sums_.flush();
      trace += sums_.matrix.trace();
      for (int k = 0; k < kLocal; ++k) border_[piece.columns[k]] += sums_.border[k];
      size_t k = 0;
      for (int j = 0; j < kLocal; ++j)
        for (int i = j; i < kLocal; ++i) value[piece.entries[k++]] += sums_.matrix(i, j);
    }
    scale_ = cube_.count() / trace;
    Vector::Map(value, matrix_.nonZeros()) = scale_ * Vector::Map(value, matrix_.nonZeros()) + empty_;
    border_ *= scale_;
    corner_ *= scale_;
    solver_.factorize(matrix_);
    return solver_.info() == Eigen::Success;
  }

  // The form tr(D S^-1 D Z) of a change D of the matrix, as the squares of three rows.
  void add_form(const FormSlack& c, const Shares& share) {
    const Mat2 x = c.s.inverse();
    const Mat2& z = c.z;
    const double b00 = x(0, 0) * z(0, 0), b10 = x(0, 1) * z(0, 0) + x(0, 0) * z(0, 1),
                 b20 = x(0, 1) * z(0, 1), b11 = x(1, 1) * z(0, 0) + 2 * x(0, 1) * z(0, 1) + x(0, 0) * z(1, 1),
                 b21 = x(1, 1) * z(0, 1) + x(0, 1) * z(1, 1), b22 = x(1, 1) * z(1, 1);
    const double l00 = std::sqrt(std::max(b00, 1e-300)), l10 = b10 / l00, l20 = b20 / l00;
    const double l11 = std::sqrt(std::max(b11 - l10 * l10, 1e-300)), l21 = (b21 - l20 * l10) / l11;
    const double l22 = std::sqrt(std::max(b22 - l20 * l20 - l21 * l21, 0.0));
    sums_.add(l00 * share.col(3) + l10 * share.col(4) + l20 * share.col(5));
    sums_.add(l11 * share.col(4) + l21 * share.col(5));
    sums_.add(l22 * share.col(5));
  }

  Vector solve(const Vector& right) const {  // refined once
    const Vector x = solver_.solve(right);
    return x + Vector(solver_.solve(right - matrix_.selfadjointView<Eigen::Lower>() * x));
  }

  // Step of the splines and of t (where free), and what follows for slacks and multipliers.
  void take(const Right& right, double product, bool corrected, bool free) {
    step_ = solve(scale_ * right.splines).head(cube_.count());
    more_ = 0;
    if (free) {
      const auto b = border_.head(cube_.count());
      more_ = (scale_ * right.allowed - b.dot(step_)) / (corner_ - b.dot(along_));
      step_ -= more_ * along_;
    }
    for (Piece& piece : pieces_) {
      const Local net = local(gauge_, piece), change = local(step_, piece);
      const auto follow = [&](Slack& c, const Left& l, double by) {
        c.ds = l.share * by + l.by_allowed * more_ + c.residual;
        c.dz = (c.weight * product - (corrected ? c.affine : 0)) / c.s - c.z - c.z / c.s * c.ds;
      };
      for (Place& s : piece.places) {
        const auto& share = shares_[s.shares];
        const Jet by = change.transpose() * share;
        for_bounds(s, net.dot(share.col(0)), [&](Slack& c, const Left& l) { follow(c, l, by[0]); });
        FormSlack& c = s.form;
        const Mat2 inverse = c.s.inverse();
        c.ds = second_form(by) + c.residual;
        c.dz = kForms * product * inverse - c.z - symmetric(inverse * c.ds * c.z);
        if (corrected) c.dz -= c.affine;
      }
      for (Vertex& s : piece.vertices)
        follow(s.distance, left(s, net.dot(s.shares.col(0)), allowed_), change.dot(s.shares.col(0)));
    }
  }

  // Of the last step: the shares at which slacks and multipliers come to their bounds, 1 at the most.
  std::pair<double, double> room() {
    double primal = 0, dual = 0;  // inverse, largest
    for_slacks([&](const Slack& c) {
      primal = std::max(primal, -c.ds / c.s);
      dual = std::max(dual, -c.dz / c.z);
    });
    for_forms([&](const FormSlack& c) {
      primal = std::max(primal, -least_root(c.ds, c.s));
      dual = std::max(dual, -least_root(c.dz, c.z));
    });
    const double change = kInside / kMostChange * (step_.array() / gauge_.array()).abs().maxCoeff();
    primal = std::max(primal, change);
    return {std::min(1.0, kInside / primal), std::min(1.0, kInside / dual)};
  }

  void go(double primal, double dual) {
    gauge_ += primal * step_;
    allowed_ += primal * more_;
    for_slacks([&](Slack& c) {
      c.s += primal * c.ds;
      c.z += dual * c.dz;
    });
    for_forms([&](FormSlack& c) {
      c.s += primal * c.ds;
      c.z += dual * c.dz;
    });
  }

  // Mehrotra's predictor and corrector towards the least t; false where no step is left.
  bool descend() {
    const double product = mean_product();
    if (!assemble()) return false;
    along_ = solve(border_).head(cube_.count());
    take(right_side(0, false), 0, false, true);
    const auto [primal, dual] = room();
    const double ratio = std::max(mean_product(primal, dual), 0.0) / product;
    const double next = std::clamp(ratio * ratio * ratio, 1e-4, 0.8) * product;
    for_slacks([](Slack& c) { c.affine = c.ds * c.dz; });
    for_forms([](FormSlack& c) { c.affine = symmetric(c.s.inverse() * c.ds * c.dz); });
    take(right_side(next, true), next, true, true);
    const auto [p, d] = room();
    if (!std::isfinite(p + d + more_) || std::max(p, d) < kShortest) return false;
    go(p, d);
    return true;
  }

  // Bounds both ways at the places, those outward of a weight with which all pushes at the hull cancel when
  // it grows or shrinks: the vertices' and the curvature's would press the body to one side.
  void balance() {
    centring_ = true;
    for (Piece& piece : pieces_) {
      const Local net = local(gauge_, piece);
      const double bounds =
          1 + static_cast<double>(piece.vertices.size()) / static_cast<double>(piece.places.size());
      for (Place& s : piece.places) {
        const double outside = left(s, s.target, allowed_).value,
                     inside = left_inside(s, s.target, allowed_).value;
        s.distance.weight = outside * std::max(bounds / inside - 2 * kForms, kLeastPush);
        const double value = left_inside(s, net.dot(shares_[s.shares].col(0)), allowed_).value;
        s.inside.s = std::max(value, kFirstInside * inside);
        s.inside.z = 1 / s.inside.s;
      }
    }
  }

  // The centre of what distances of those wanted leave, where curvature is far from its bounds. Where the
  // body is dented between places, more are added.
  void centre() {
    const double product = mean_product();
    for_slacks([&](Slack& c) { c.z /= product; });
    for_forms([&](FormSlack& c) { c.z /= product; });
    allowed_ = std::max(1.0, kRoom * worst());
    balance();
    for (int round = 0; round <= kDenser; ++round) {
      const Vector before = gauge_;
      for (int k = 0; k < kCentreSteps; ++k) {
        if (!assemble()) break;
        take(right_side(1, false), 1, false, false);
        const auto [p, d] = room();
        if (!std::isfinite(p + d)) break;
        double change = 0;
        for_slacks([&](const Slack& c) { change = std::max(change, std::abs(c.ds) / c.s); });
        go(p, d);
        refer();
        if (p == 1 && change < kCentred) break;
      }
      if (!(worst() <= kRoom * allowed_) || !is_convex()) {
        if (round > 0) gauge_ = before;
        return;
      }
      if (round == kDenser || add_places() == 0) return;
    }
  }

  // Places where the body lacks curvature between those there are.
  size_t add_places() {
    const int spans = cube_.spans(), n = 2 * places_ - 1;
    std::vector<SmoothCube::Basis> bases;
    for (int a = 0; a < spans; ++a)
      for (int i = 0; i < n; ++i) bases.push_back(cube_.basis(a, i / (n - 1.0)));
    size_t added = 0;
    for (size_t p = 0; p < pieces_.size(); ++p) {
      Piece& piece = pieces_[p];
      const int b = static_cast<int>(p) % spans, a = static_cast<int>(p) / spans % spans,
                f = static_cast<int>(p) / (spans * spans);
      const Local net = local(gauge_, piece);
      const Eigen::Map<const Eigen::Matrix<double, kDegree + 1, kDegree + 1, Eigen::RowMajor>> square(
          net.data());
      for (int j = 0; j < n; ++j) {
        const SmoothCube::Basis& v = bases[b * n + j];
        using Line = Eigen::Matrix<double, kDegree + 1, 1>;
        const Line value = square * Eigen::Map<const Line>(v.value),
                   slope = square * Eigen::Map<const Line>(v.slope),
                   bend = square * Eigen::Map<const Line>(v.bend);
        for (int i = 0; i < n; ++i) {
          if (i % 2 == 0 && j % 2 == 0) continue;
          const SmoothCube::Basis& u = bases[a * n + i];
          const Eigen::Map<const Line> u0(u.value), u1(u.slope), u2(u.bend);
          Jet at;
          at << u0.dot(value), u1.dot(value), u0.dot(slope), u2.dot(value), u1.dot(slope), u0.dot(bend);
          Place s;
          static_cast<Ray&>(s) = make_ray(
              f, cube_direction(f, cube_.parameter(a, i / (n - 1.0)), cube_.parameter(b, j / (n - 1.0))), 1);
          s.first = s.first_form(at[0], at[1], at[2]);
          if (least_root(second_form(at), s.first) > kReserve * options_.least_curvature) continue;
          s.apart = true;
          s.wanted = 1;
          s.shares = static_cast<int>(shares_.size());
          shares_.push_back(cube_.shares(u, v));
          const Mat2 now = form(at, s);
          const double shift =
              std::max(kNewSlack * std::abs(now.trace()) - least_root(now, Mat2::Identity()), 0.0);
          s.form.s = now + shift * Mat2::Identity();
          s.form.z = kForms * s.form.s.inverse();
          piece.places.push_back(s);
          terms_ += 2 * kForms;
          ++added;
        }
      }
    }
    return added;
  }

  // The gauge of a ball of the vertices' mean radius: the nearest splines.
  Vector ball() const {
    double radius = 0, count = 0;
    for (const Piece& piece : pieces_)
      for (const Vertex& v : piece.vertices) {
        radius += v.y.norm() / v.target;
        count += 1;
      }
    radius /= count;
    Vector right = Vector::Zero(matrix_.rows());
    std::vector<Eigen::Triplet<double>> entries;
    for (const Piece& piece : pieces_) {
      const std::vector<int>& columns = piece.columns;
      Eigen::MatrixXd mass = Eigen::MatrixXd::Zero(kLocal, kLocal);
      for (const Place& s : piece.places) {
        const auto share = shares_[s.shares].col(0);
        mass += share * share.transpose();
        for (int i = 0; i < kLocal; ++i) right[columns[i]] += share[i] * s.y.norm() / radius;
      }
      for (int i = 0; i < kLocal; ++i)
        for (int j = 0; j < kLocal; ++j)
          if (columns[i] >= columns[j]) entries.emplace_back(columns[i], columns[j], mass(i, j));
    }
    Sparse mass(matrix_.rows(), matrix_.cols());
    mass.setFromTriplets(entries.begin(), entries.end());
    const Eigen::SimplicialLDLT<Sparse, Eigen::Lower> solver(Sparse(matrix_ + mass));
    return Vector(solver.solve(right)).head(cube_.count());
  }

  SmoothCube cube_;
  const GaugeFitOptions& options_;
  int places_;                  // of a piece, along one parameter
  std::vector<Piece> pieces_;   // by face and spans
  std::vector<Shares> shares_;  // of a face's places, then of those added
  Sums sums_;
  Sparse matrix_;
  Vector empty_;  // its entries without those of the pieces
  Eigen::SimplicialLDLT<Sparse, Eigen::Lower> solver_;
  double scale_ = 1, corner_ = 0;  // of the matrix; its second derivative by t
  Vector border_, along_;          // mixed derivatives by t, and the step that t's change asks for
  Vector gauge_, step_;
  double allowed_ = 0, more_ = 0;  // t: largest distance over that wanted; its step
  double terms_ = 0;               // of the products' mean
  bool centring_ = false;          // places are bounded inward, too
};

}  // namespace

GaugeFit fit_gauge(int degree, int spans, const ConvexHull& hull, const GaugeFitOptions& options) {
  if (degree == 3) return InteriorPoint<3>(spans, hull, options).run();
  if (degree == 4) return InteriorPoint<4>(spans, hull, options).run();
  throw std::invalid_argument("fit_gauge: degree must be 3 or 4");
}

}  // namespace nurbs

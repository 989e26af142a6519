// Damped Gauss-Newton over nets of smooth joints, with penalties on lacking curvature.
#include "shapes/convex_fit.h"

#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>

namespace nurbs {
namespace {

using Vector = Eigen::VectorXd;
using Sparse = Eigen::SparseMatrix<double>;

constexpr int kRounds = 9;              // of reweighting
constexpr int kIterations = 12;         // in each
constexpr double kSmallestGain = 2e-3;  // relative fall of the cost at which a round ends
constexpr double kFirstDamping = 1e-2, kLeastDamping = 1e-6, kLargestDamping = 1e4;
constexpr double kFirstFairing = 1e-3, kLeastFairing = 1e-6, kFairingFall = 0.2;
constexpr double kFirstPenalty = 10, kPenaltyGrowth = 6;
constexpr double kCalm = 0.3;       // share of its weight that a sample without error keeps
constexpr double kMostAsked = 0.3;  // curvature
constexpr double kCutSlope = 1.2;   // distance of a corner cut off over that of the surface below it, about
constexpr int kRaises = 5;          // of the least curvature, by a factor of two
constexpr double kHopeless = 5;     // times the tolerance after kHopeRounds rounds: given up
constexpr int kHopeRounds = 5;
constexpr double kSpeed2 = 2.5;            // squared speed of the parameters, about
constexpr double kRegular = 1e-9;          // of the conditions' block of the matrix
constexpr double kCurvatureReserve = 0.5;  // share of the least curvature that must be met

// Values and derivatives of the splines of one span at a grid's places, the same for u and v.
class Grid {
 public:
  Grid(const SmoothCube& cube, int places) : places_(places) {
    for (int a = 0; a < cube.spans(); ++a)
      for (int k = 0; k < places; ++k) table_.push_back(cube.basis(a, k / (places - 1.0)));
  }
  int places() const { return places_; }
  const SmoothCube::Basis& at(int a, int k) const { return table_[a * places_ + k]; }

 private:
  int places_;
  std::vector<SmoothCube::Basis> table_;
};

using Piece = SmoothCube::Piece;
using Shares = SmoothCube::Shares;

NetPoints gather(const Piece& piece, const NetPoints& points) {
  NetPoints out(piece.columns.size(), 3);
  for (size_t c = 0; c < piece.columns.size(); ++c) out.row(c) = points.row(piece.columns[c]);
  return out;
}

// The surface at a sample.
struct Local {
  Vec3 x, xu, xv, xuu, xuv, xvv, normal;
  double area;              // |xu x xv|
  double e, f, g, l, m, n;  // first and second form, the latter positive where convex

  double least_curvature() const {  // the smaller root k of det(II - k I) = 0
    const double mean = 0.5 * (e * n + g * l) - f * m, i = area * area;
    return (mean - std::sqrt(std::max(mean * mean - i * (l * n - m * m), 0.0))) / i;
  }
};

Local local_surface(const NetPoints& points, const Shares& s) {
  const Eigen::Matrix<double, 3, 6> jet = points.transpose().lazyProduct(s);
  Local out;
  out.x = jet.col(0);
  out.xu = jet.col(1);
  out.xv = jet.col(2);
  out.xuu = jet.col(3);
  out.xuv = jet.col(4);
  out.xvv = jet.col(5);
  const Vec3 cross = out.xu.cross(out.xv);
  out.area = std::max(cross.norm(), 1e-300);
  out.normal = cross / out.area;
  out.e = out.xu.squaredNorm();
  out.f = out.xu.dot(out.xv);
  out.g = out.xv.squaredNorm();
  out.l = -out.normal.dot(out.xuu);
  out.m = -out.normal.dot(out.xuv);
  out.n = -out.normal.dot(out.xvv);
  return out;
}

// How far II - k I is from positive (sign 1) or from negative (sign -1), and along which direction (a, b) of
// the parameters, a^2 + b^2 = 1: the forms themselves, not their quotient, so that it stays smooth where the
// parameters crowd.
struct Excess {
  double value, a, b;
};
Excess curvature_excess(const Local& s, double k, double sign) {
  const double l = sign * (k * s.e - s.l), m = sign * (k * s.f - s.m), n = sign * (k * s.g - s.n);
  const double half = 0.5 * (l - n), spread = std::sqrt(half * half + m * m);
  const double angle = 0.5 * std::atan2(m, half);
  return {0.5 * (l + n) + spread, std::cos(angle), std::sin(angle)};
}

// The matrix of one Gauss-Newton step, [H C^T; C -eps]: its pattern is analysed once.
class System {
 public:
  System(const SmoothCube& cube, const std::vector<Piece>& pieces) : unknowns_(3 * cube.count()) {
    const Sparse& c = cube.conditions();
    const int size = unknowns_ + 3 * static_cast<int>(c.rows());
    std::vector<Eigen::Triplet<double>> entries;
    for (const Piece& piece : pieces) {
      for (int i : piece.columns)
        for (int j : piece.columns)
          if (i >= j) add_block(entries, 3 * i, 3 * j);
    }
    const size_t dense = entries.size();
    for (int column = 0; column < c.outerSize(); ++column)
      for (Sparse::InnerIterator it(c, column); it; ++it)
        for (int x = 0; x < 3; ++x)
          entries.emplace_back(unknowns_ + 3 * it.row() + x, 3 * it.col() + x, it.value());
    for (int k = unknowns_; k < size; ++k) entries.emplace_back(k, k, -kRegular);
    for (size_t k = 0; k < dense; ++k)
      entries[k] = Eigen::Triplet<double>(entries[k].row(), entries[k].col(), 0);
    matrix_.resize(size, size);
    matrix_.setFromTriplets(entries.begin(), entries.end());
    matrix_.makeCompressed();
    fixed_ = Vector::Map(matrix_.valuePtr(), matrix_.nonZeros());
    solver_.analyzePattern(matrix_);
    place(pieces);
  }

  void clear() { Vector::Map(matrix_.valuePtr(), matrix_.nonZeros()) = fixed_; }

  // Adds the lower triangle of a piece's matrix, unknowns x, y, z of each of its points.
  void add(int piece, const Eigen::MatrixXd& local) {
    const std::vector<int>& at = places_[piece];
    double* value = matrix_.valuePtr();
    size_t k = 0;
    for (int j = 0; j < local.cols(); ++j)
      for (int i = j; i < local.rows(); ++i) value[at[k++]] += local(i, j);
  }

  bool factorize() {
    solver_.factorize(matrix_);
    return solver_.info() == Eigen::Success;
  }

  // Step of the net with conditions . step = 0, for a gradient.
  NetPoints step(const Vector& gradient) const {
    Vector right = Vector::Zero(matrix_.rows());
    right.head(unknowns_) = -gradient;
    const Vector solution = solver_.solve(right);
    return Eigen::Map<const NetPoints>(solution.data(), unknowns_ / 3, 3);
  }

 private:
  static void add_block(std::vector<Eigen::Triplet<double>>& entries, int row, int column) {
    for (int x = 0; x < 3; ++x)
      for (int y = 0; y < 3; ++y)
        if (row + x >= column + y) entries.emplace_back(row + x, column + y, 0);
  }

  void place(const std::vector<Piece>& pieces) {
    const auto find = [&](int row, int column) {
      const int* begin = matrix_.innerIndexPtr() + matrix_.outerIndexPtr()[column];
      const int* end = matrix_.innerIndexPtr() + matrix_.outerIndexPtr()[column + 1];
      return static_cast<int>(std::lower_bound(begin, end, row) - matrix_.innerIndexPtr());
    };
    for (const Piece& piece : pieces) {
      std::vector<int> at;
      const int n = 3 * static_cast<int>(piece.columns.size());
      for (int j = 0; j < n; ++j)
        for (int i = j; i < n; ++i) {
          const int row = 3 * piece.columns[i / 3] + i % 3, column = 3 * piece.columns[j / 3] + j % 3;
          at.push_back(find(std::max(row, column), std::min(row, column)));
        }
      places_.push_back(std::move(at));
    }
  }

  int unknowns_;
  Sparse matrix_;
  Vector fixed_;
  Eigen::SimplicialLDLT<Sparse, Eigen::Lower> solver_;
  std::vector<std::vector<int>> places_;
};

class Fitter {
  static constexpr double kOutside = 1e300;

 public:
  Fitter(const SmoothCube& cube, const OffsetTarget& target, const ConvexFitOptions& options)
      : cube_(cube),
        target_(target),
        options_(options),
        grid_(cube, cube.spans() == 1   ? 19
                    : cube.spans() == 2 ? 13
                                        : 2 * cube.degree() + 3),
        check_(cube, grid_.places() + 4),
        pieces_(cube.pieces()),
        system_(cube, pieces_) {
    const size_t samples = pieces_.size() * grid_.places() * grid_.places();
    weight_.assign(samples, 1);
    penalty_.assign(samples, kFirstPenalty);
    least_.assign(samples, options.least_curvature);
    hint_.assign(samples, 0);
    check_hint_.assign(pieces_.size() * check_.places() * check_.places(), 0);
    for (const Piece& piece : pieces_)
      for (int i = 0; i < grid_.places(); ++i)
        for (int j = 0; j < grid_.places(); ++j) {
          const double u = (piece.a + i / (grid_.places() - 1.0)) / cube.spans(),
                       v = (piece.b + j / (grid_.places() - 1.0)) / cube.spans();
          rays_.push_back(
              cube_direction(piece.face, std::tan((2 * u - 1) * M_PI / 4), std::tan((2 * v - 1) * M_PI / 4))
                  .normalized());
        }
    for (int a = 0; a < cube.spans(); ++a)
      for (int b = 0; b < cube.spans(); ++b)
        for (int i = 0; i < grid_.places(); ++i)
          for (int j = 0; j < grid_.places(); ++j)
            shares_.push_back(cube.shares(grid_.at(a, i), grid_.at(b, j)));
  }

  ConvexFit run(const NetPoints& start) {
    points_ = start;
    ConvexFit best;
    best.points = start;
    best.error = kOutside;
    for (int round = 0; round < kRounds; ++round) {
      descend();
      const ConvexFit now = measure();
      if (now.least_curvature > 0 && now.error < best.error) best = now;
      if (best.error <= options_.tolerance) break;
      if (round + 1 >= kHopeRounds && now.error > kHopeless * options_.tolerance) break;
      fairing_ = std::max(kFairingFall * fairing_, kLeastFairing);
      reweight();
    }
    best.last = points_;
    return best;
  }

 private:
  const Shares& shares(const Piece& piece, int i, int j) const {
    const int n = grid_.places();
    return shares_[static_cast<size_t>((piece.a * cube_.spans() + piece.b) * n + i) * n + j];
  }

  // Errors in tolerances, inside ones counted more.
  double scale(const TargetOffset& t) const {
    const double cut = t.distance < 0 ? options_.cut_weight : 1;
    return cut / ((options_.metric * t.gradient).norm() * options_.tolerance);
  }

  // Sums of one piece: its matrix (lower triangle, unknowns x, y, z of each point) and gradient.
  struct Sums {
    explicit Sums(int n)
        : matrix(Eigen::MatrixXd::Zero(3 * n, 3 * n)), load(NetPoints::Zero(n, 3)), rows(3 * n, kBatch) {}

    void add(const NetPoints& row, double residual, double weight) {
      load += weight * residual * row;
      rows.col(batch++) = std::sqrt(weight) * Eigen::Map<const Vector>(row.data(), row.size());
      if (batch == kBatch) flush();
    }
    void flush() {
      if (batch == 0) return;
      matrix.selfadjointView<Eigen::Lower>().rankUpdate(rows.leftCols(batch));
      batch = 0;
    }

    static constexpr int kBatch = 48;
    Eigen::MatrixXd matrix;
    NetPoints load;
    Eigen::MatrixXd rows;
    int batch = 0;
  };

  // Distance from the target.
  double add_offset(const Local& f, const Shares& s, size_t at, double share, Sums* sums) {
    const TargetOffset t = target_(f.x, f.normal, hint_[at]);
    const double w = scale(t), residual = w * t.distance, weight = share * weight_[at];
    if (sums) sums->add(w * s.col(0) * t.gradient.transpose(), residual, weight);
    return weight * residual * residual;
  }

  // Penalty where the surface is too flat or hollow, and where it bends too much.
  double add_curvature(const Local& f, const Shares& s, size_t at, double share, Sums* sums) {
    double cost = 0;
    for (int k = 0; k < 2; ++k) {
      const double bound = k ? options_.most_curvature : least_[at], sign = k ? -1 : 1;
      const Excess excess = curvature_excess(f, bound, sign);
      if (excess.value <= 0) continue;
      const double unit = 1 / (kSpeed2 * (k ? bound : options_.least_curvature)),
                   weight = share * (k ? kFirstPenalty : penalty_[at]);
      cost += weight * unit * unit * excess.value * excess.value;
      if (!sums) continue;
      const double a = excess.a, b = excess.b;  // sign (k |x_w|^2 + n . x_ww) along w = (a, b)
      const Vec3 bend = a * a * f.xuu + 2 * a * b * f.xuv + b * b * f.xvv;
      const Vec3 q = bend - f.normal * f.normal.dot(bend);  // for n's turn
      const Vec3 by_u = f.xv.cross(q) / f.area + 2 * bound * a * (a * f.xu + b * f.xv),
                 by_v = q.cross(f.xu) / f.area + 2 * bound * b * (a * f.xu + b * f.xv);
      const Vector second = a * a * s.col(3) + 2 * a * b * s.col(4) + b * b * s.col(5);
      sums->add(
          sign * unit *
              (second * f.normal.transpose() + s.col(1) * by_u.transpose() + s.col(2) * by_v.transpose()),
          unit * excess.value, weight);
    }
    return cost;
  }

  // Keeps the parametrisation near that by rays from the origin, and the net smooth.
  double add_order(const Local& f, const Shares& s, const Vec3& ray, double share, double damping,
                   Sums* sums) {
    const double hold = share / (options_.slide * options_.slide);
    const Vec3 aside = f.x - ray * ray.dot(f.x);
    if (sums) {
      sums->load += hold * s.col(0) * aside.transpose();
      sums->load +=
          share * fairing_ *
          (s.col(3) * f.xuu.transpose() + 2 * s.col(4) * f.xuv.transpose() + s.col(5) * f.xvv.transpose());
      const Mat3 across = hold * (Mat3::Identity() - ray * ray.transpose());
      const double stay = share * damping / (options_.tolerance * options_.tolerance);
      for (int j = 0; j < s.rows(); ++j)
        for (int i = j; i < s.rows(); ++i) {
          const double mass = s(i, 0) * s(j, 0),
                       rough = s(i, 3) * s(j, 3) + 2 * s(i, 4) * s(j, 4) + s(i, 5) * s(j, 5);
          Mat3 block = mass * across;
          block.diagonal().array() += stay * mass + share * fairing_ * rough;
          sums->matrix.block<3, 3>(3 * i, 3 * j) += block;
        }
    }
    return hold * aside.squaredNorm() +
           share * fairing_ * (f.xuu.squaredNorm() + 2 * f.xuv.squaredNorm() + f.xvv.squaredNorm());
  }

  // Cost of a net; with `gradient`, the system and gradient of the step as well. Curvature is looked at on a
  // grid twice as fine as the support function.
  double assemble(const NetPoints& points, Vector* gradient, double damping) {
    const int places = grid_.places(), n = static_cast<int>(pieces_[0].columns.size());
    const double fine = 1.0 / static_cast<double>(penalty_.size()), coarse = 4 * fine;
    double cost = 0;
    if (gradient) {
      gradient->setZero(3 * points.rows());
      system_.clear();
    }
    size_t at = 0;
    for (size_t p = 0; p < pieces_.size(); ++p) {
      const NetPoints local = gather(pieces_[p], points);
      Sums sums(n);
      Sums* const to = gradient ? &sums : nullptr;
      for (int i = 0; i < places; ++i) {
        for (int j = 0; j < places; ++j, ++at) {
          const Shares& s = shares(pieces_[p], i, j);
          const Local f = local_surface(local, s);
          cost += add_curvature(f, s, at, fine, to);
          if (i % 2 || j % 2) continue;
          cost += add_offset(f, s, at, coarse, to);
          cost += add_order(f, s, rays_[at], coarse, damping, to);
        }
      }
      if (!gradient) continue;
      sums.flush();
      system_.add(static_cast<int>(p), sums.matrix);
      for (int i = 0; i < n; ++i)
        gradient->segment<3>(3 * pieces_[p].columns[i]) += sums.load.row(i).transpose();
    }
    return cost;
  }

  void descend() {
    Vector gradient;
    double damping = std::clamp(damping_, kLeastDamping, kLargestDamping / 100);
    double cost = assemble(points_, &gradient, damping);
    for (int k = 0; k < kIterations && damping < kLargestDamping; ++k) {
      if (!system_.factorize()) {
        damping *= 10;
        assemble(points_, &gradient, damping);
        continue;
      }
      const NetPoints trial = points_ + system_.step(gradient);
      const double next = trial.allFinite() ? assemble(trial, nullptr, 0) : 1e300;
      const bool better = next < cost;
      damping = better ? std::max(damping / 4, kLeastDamping) : damping * 8;
      if (better) {
        points_ = trial;
        const bool done = cost - next < kSmallestGain * cost;
        cost = next;
        if (done) break;
      }
      if (k + 1 < kIterations) assemble(points_, &gradient, damping);
    }
    damping_ = damping;
  }

  // Error and least curvature on the finer grid. Where curvature lacks there, the samples around are asked
  // for more.
  ConvexFit measure() {
    ConvexFit out;
    out.points = points_;
    out.least_curvature = 1e300;
    size_t at = 0;
    const int places = grid_.places();
    for (size_t p = 0; p < pieces_.size(); ++p) {
      const Piece& piece = pieces_[p];
      const NetPoints local = gather(piece, points_);
      for (int i = 0; i < check_.places(); ++i)
        for (int j = 0; j < check_.places(); ++j, ++at) {
          const Local f = local_surface(local, cube_.shares(check_.at(piece.a, i), check_.at(piece.b, j)));
          const TargetOffset t = target_(f.x, f.normal, check_hint_[at]);
          const double cut = t.distance < 0 ? kCutSlope : 1;
          out.error = std::max(out.error, cut * std::abs(t.distance) / (options_.metric * t.gradient).norm());
          const double curvature = f.least_curvature();
          out.least_curvature = std::min(out.least_curvature, curvature);
          const double lack = kCurvatureReserve * options_.least_curvature - curvature;
          if (!(lack > 0)) continue;
          const double a = i * (places - 1.0) / (check_.places() - 1),
                       b = j * (places - 1.0) / (check_.places() - 1);
          for (int corner = 0; corner < 4; ++corner) {
            const int k = static_cast<int>(corner & 1 ? std::ceil(a) : std::floor(a)),
                      l = static_cast<int>(corner & 2 ? std::ceil(b) : std::floor(b));
            double& asked = least_[(p * places + k) * places + l];
            asked = std::min(asked + lack, kMostAsked);
          }
        }
    }
    return out;
  }

  // Lawson's weights: what errs most counts more in the next round, and so does a lack of curvature.
  void reweight() {
    std::vector<double> error(weight_.size(), 0);
    size_t at = 0;
    double most = 0, sum = 0;
    for (const Piece& piece : pieces_) {
      const NetPoints local = gather(piece, points_);
      for (int i = 0; i < grid_.places(); ++i)
        for (int j = 0; j < grid_.places(); ++j, ++at) {
          const Local f = local_surface(local, shares(piece, i, j));
          if (f.least_curvature() < kCurvatureReserve * options_.least_curvature)
            penalty_[at] *= kPenaltyGrowth;
          if (i % 2 || j % 2) continue;
          const TargetOffset t = target_(f.x, f.normal, hint_[at]);
          error[at] = std::abs(t.distance) * scale(t);
          most = std::max(most, error[at]);
        }
    }
    if (!(most > 0)) return;
    for (size_t k = 0; k < weight_.size(); ++k) {
      weight_[k] *= kCalm + error[k] / most;
      sum += weight_[k];
    }
    for (double& w : weight_) w *= static_cast<double>(weight_.size()) / sum;
  }

  const SmoothCube& cube_;
  const OffsetTarget& target_;
  const ConvexFitOptions& options_;
  Grid grid_, check_;
  std::vector<Piece> pieces_;
  System system_;
  std::vector<Shares> shares_;
  std::vector<Vec3> rays_;
  std::vector<double> weight_, penalty_;
  std::vector<double> least_;  // curvature asked for at a sample: more where it lacks between samples
  std::vector<int> hint_, check_hint_;
  NetPoints points_;
  double fairing_ = kFirstFairing, damping_ = kFirstDamping;
};

}  // namespace

ConvexFit fit_convex(const SmoothCube& cube, const NetPoints& start, const OffsetTarget& target,
                     const ConvexFitOptions& options) {
  ConvexFit fit = Fitter(cube, target, options).run(start);
  fit.points = cube.tidied(fit.points);
  return fit;
}

ConvexFit raise_curvature(const SmoothCube& cube, ConvexFit fit, const OffsetTarget& target,
                          ConvexFitOptions options, const std::function<bool(const ConvexFit&)>& accept) {
  for (int k = 0; k < kRaises; ++k) {
    options.least_curvature *= 2;
    ConvexFit raised = fit_convex(cube, fit.points, target, options);
    if (raised.error > options.tolerance || raised.least_curvature <= fit.least_curvature) break;
    if (!accept(raised)) break;
    fit = std::move(raised);
  }
  return fit;
}

NetPoints fit_points(const SmoothCube& cube, const NetTarget& target) {
  const std::vector<Piece> pieces = cube.pieces();
  const Grid grid(cube, cube.degree() + 3);
  const Sparse& c = cube.conditions();
  const int count = cube.count(), size = count + static_cast<int>(c.rows());
  std::vector<Eigen::Triplet<double>> entries;
  Eigen::MatrixXd right = Eigen::MatrixXd::Zero(size, 3);
  for (const Piece& piece : pieces) {
    const int n = static_cast<int>(piece.columns.size());
    Eigen::MatrixXd mass = Eigen::MatrixXd::Zero(n, n);
    for (int i = 0; i < grid.places(); ++i)
      for (int j = 0; j < grid.places(); ++j) {
        const Vector s = cube.shares(grid.at(piece.a, i), grid.at(piece.b, j)).col(0);
        const double u = (piece.a + i / (grid.places() - 1.0)) / cube.spans(),
                     v = (piece.b + j / (grid.places() - 1.0)) / cube.spans();
        const Vec3 x = target(piece.face, u, v);
        mass += s * s.transpose();
        for (int k = 0; k < n; ++k) right.row(piece.columns[k]) += s[k] * x.transpose();
      }
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j)
        if (piece.columns[i] >= piece.columns[j])
          entries.emplace_back(piece.columns[i], piece.columns[j], mass(i, j));
  }
  for (int column = 0; column < c.outerSize(); ++column)
    for (Sparse::InnerIterator it(c, column); it; ++it)
      entries.emplace_back(count + it.row(), it.col(), it.value());
  for (int k = count; k < size; ++k) entries.emplace_back(k, k, -kRegular);
  Sparse matrix(size, size);
  matrix.setFromTriplets(entries.begin(), entries.end());
  const Eigen::SimplicialLDLT<Sparse, Eigen::Lower> solver(matrix);
  NetPoints points = Eigen::MatrixXd(solver.solve(right)).topRows(count);
  points = cube.tidied(points);
  return points;
}

}  // namespace nurbs

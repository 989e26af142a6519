// Fit of six bicubic patches over a cube to a given body.
#include "shapes/surface_fit.h"

#include <Eigen/Dense>
#include <Eigen/Sparse>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "shapes/cube_net.h"

namespace nurbs {
namespace {

using Sparse = Eigen::SparseMatrix<double>;
using Columns = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;  // x, y, z of each unknown
using Vector = Eigen::VectorXd;
constexpr int kCubic = 3, kAlive = 16;  // control points that act on one piece
// Samples of the fit per span, and at least per patch, in each direction; and of the grid that measures the
// error.
constexpr int kFitPoints = 5, kLeastFitPoints = 10, kErrorPoints = 24;
constexpr int kMostIterations = 100;
constexpr double kFirstLambda = 1e-2, kLeastLambda = 1e-4,
                 kLargestLambda = 1e6;  // relative to the mass matrix
constexpr double kSmallestFall = 3e-4;  // relative fall of the sum of squares at which the iteration stops

// Values and first derivatives at t of the four cubic B-splines alive on the span from knot k.
struct CubicBasis {
  std::array<double, 4> value, slope;
};

CubicBasis cubic_basis(const std::vector<double>& knots, int k, double t) {
  std::array<double, 4> b{1, 0, 0, 0}, quadratic{};
  for (int p = 1; p <= kCubic; ++p) {  // NURBS Book A2.2
    if (p == kCubic) quadratic = b;
    double saved = 0;
    for (int r = 0; r < p; ++r) {
      const double right = knots[k + r + 1], left = knots[k + 1 - p + r];
      const double share = b[r] / (right - left);
      b[r] = saved + (right - t) * share;
      saved = (t - left) * share;
    }
    b[p] = saved;
  }
  CubicBasis out{b, {}};
  for (int r = 0; r <= kCubic; ++r) {  // NURBS Book eq. 2.7
    const int i = k - kCubic + r;
    const double before = r > 0 ? quadratic[r - 1] / (knots[i + kCubic] - knots[i]) : 0;
    const double after = r < kCubic ? quadratic[r] / (knots[i + kCubic + 1] - knots[i + 1]) : 0;
    out.slope[r] = kCubic * (before - after);
  }
  return out;
}

// One sample of a piece: what its position and derivatives take from each of the piece's control points.
using Share = Eigen::Matrix<double, kAlive, 1>;
struct Sample {
  Share s, su, sv;
  Vec3 direction;  // unit; equal steps of u or v are equal angles
};

struct SpanPiece {
  std::array<int, kAlive> columns;  // net indices of its control points
  std::vector<Sample> samples;
};

Sample make_sample(const CubicBasis& u, const CubicBasis& v) {
  Sample sample;
  for (int k = 0; k < kAlive; ++k) {
    sample.s[k] = u.value[k / 4] * v.value[k % 4];
    sample.su[k] = u.slope[k / 4] * v.value[k % 4];
    sample.sv[k] = u.value[k / 4] * v.slope[k % 4];
  }
  return sample;
}

// Samples at the parameters `at` of one span, relative to it, in both directions.
std::vector<SpanPiece> make_pieces(const CubeNet& net, const std::vector<double>& knots, int spans,
                                   const std::vector<double>& at) {
  std::vector<SpanPiece> pieces;
  const auto angle = [](double t) { return std::tan((2 * t - 1) * M_PI / 4); };
  for (int k = 0; k < kCubeFaces * spans * spans; ++k) {
    const int f = k / (spans * spans), a = k / spans % spans, b = k % spans;
    SpanPiece piece;
    for (int c = 0; c < kAlive; ++c) piece.columns[c] = net.index(f, a + c / 4, b + c % 4);
    for (double s : at) {
      for (double t : at) {
        const double u = (a + s) / spans, v = (b + t) / spans;
        piece.samples.push_back(
            make_sample(cubic_basis(knots, kCubic + a, u), cubic_basis(knots, kCubic + b, v)));
        piece.samples.back().direction = cube_direction(f, angle(u), angle(v)).normalized();
      }
    }
    pieces.push_back(std::move(piece));
  }
  return pieces;
}

std::vector<double> midpoints(int count) {
  std::vector<double> at;
  for (int k = 0; k < count; ++k) at.push_back((k + 0.5) / count);
  return at;
}

std::vector<double> grid(int count) {
  std::vector<double> at;
  for (int k = 0; k <= count; ++k) at.push_back(static_cast<double>(k) / count);
  return at;
}

// The rows of the smooth-joint condition of one edge of the cube: along `axis`, at the ends b, c of the other
// two.
void add_smooth_edge(const CubeNet& net, int axis, bool b, bool c, std::vector<Vector>& rows) {
  const int last = net.size() - 1;
  const auto unit = [&](int k, int ib, int ic) {
    std::array<int, 3> p{};
    p[axis] = k;
    p[(axis + 1) % 3] = ib;
    p[(axis + 2) % 3] = ic;
    return Vector(Vector::Unit(net.count(), net.index(p)));
  };
  const int b0 = b ? last : 0, b1 = b ? last - 1 : 1, c0 = c ? last : 0, c1 = c ? last - 1 : 1;
  Vector tangent[3];
  for (int j = 0; j < 3; ++j) tangent[j] = unit(j + 1, b0, c0) - unit(j, b0, c0);
  const Vector product[4] = {-tangent[0], (tangent[0] - 2 * tangent[1]) / 3,
                             (2 * tangent[1] - tangent[2]) / 3,
                             tangent[2]};  // (2t - 1) e'(t) in cubic Bernstein form
  for (int k = 0; k < 4; ++k)
    rows.push_back(unit(k, b1, c0) + unit(k, b0, c1) - 2 * unit(k, b0, c0) - product[k]);
}

// Columns: an orthonormal basis of the control nets allowed by `joints`.
Sparse allowed_nets(const CubeNet& net, Joints joints) {
  Sparse basis(net.count(), net.count());
  basis.setIdentity();
  if (joints == Joints::kKinked) return basis;
  std::vector<Vector> rows;
  for (int edge = 0; edge < 12; ++edge) add_smooth_edge(net, edge / 4, edge & 1, edge & 2, rows);
  Eigen::MatrixXd conditions(rows.size(), net.count());
  for (size_t r = 0; r < rows.size(); ++r) conditions.row(r) = rows[r];
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(conditions, Eigen::ComputeFullV);
  const int rank = static_cast<int>((svd.singularValues().array() > 1e-9 * svd.singularValues()[0]).count());
  return Eigen::MatrixXd(svd.matrixV().rightCols(net.count() - rank)).sparseView();
}

// Control points of one piece, one per row.
Eigen::Matrix<double, kAlive, 3> gather(const SpanPiece& piece, const Columns& points) {
  Eigen::Matrix<double, kAlive, 3> out;
  for (int c = 0; c < kAlive; ++c) out.row(c) = points.row(piece.columns[c]);
  return out;
}

SurfaceOffset offset_at(const FitTarget& target, const Eigen::Matrix<double, kAlive, 3>& points,
                        const Sample& sample) {
  const Vec3 su = points.transpose() * sample.su, sv = points.transpose() * sample.sv;
  return target.offset(points.transpose() * sample.s, su.cross(sv).normalized());
}

// Normal equations of a least-squares problem in the control points, unknowns ordered x, y, z of each point.
struct NormalEquations {
  Sparse matrix;
  Vector load;
  double cost = 0;  // sum of squares
};

// The same matrix for each of x, y, z.
Sparse for_each_coordinate(const Sparse& m) {
  std::vector<Eigen::Triplet<double>> entries;
  for (int column = 0; column < m.outerSize(); ++column) {
    for (Sparse::InnerIterator it(m, column); it; ++it) {
      for (int c = 0; c < 3; ++c) entries.emplace_back(3 * it.row() + c, 3 * it.col() + c, it.value());
    }
  }
  Sparse out(3 * m.rows(), 3 * m.cols());
  out.setFromTriplets(entries.begin(), entries.end());
  return out;
}

// Sum over samples of offset^2 + slope_weight^2 ((gradient . su)^2 + (gradient . sv)^2), linearised about
// `points` with the gradient held fixed.
NormalEquations offset_equations(const FitTarget& target, const std::vector<SpanPiece>& pieces,
                                 const Columns& points, double slope_weight, const Sparse& fairing,
                                 bool cost_only) {
  NormalEquations out;
  out.load = Vector::Zero(3 * points.rows());
  std::vector<Eigen::Triplet<double>> entries;
  for (const SpanPiece& piece : pieces) {
    const auto local = gather(piece, points);
    Eigen::Matrix<double, 3 * kAlive, 3 * kAlive> matrix = decltype(matrix)::Zero();
    Eigen::Matrix<double, 3 * kAlive, 1> load = decltype(load)::Zero(), row;
    const auto add = [&](const Share& share, const Vec3& gradient, double residual, double weight) {
      out.cost += weight * weight * residual * residual;
      if (cost_only) return;
      for (int c = 0; c < kAlive; ++c) row.segment<3>(3 * c) = weight * share[c] * gradient;
      matrix.noalias() += row * row.transpose();
      load += weight * residual * row;
    };
    for (const Sample& sample : piece.samples) {
      const SurfaceOffset offset = offset_at(target, local, sample);
      add(sample.s, offset.gradient, offset.distance, 1);
      if (slope_weight > 0) {
        add(sample.su, offset.gradient, offset.gradient.dot(local.transpose() * sample.su), slope_weight);
        add(sample.sv, offset.gradient, offset.gradient.dot(local.transpose() * sample.sv), slope_weight);
      }
    }
    if (cost_only) continue;
    for (int a = 0; a < 3 * kAlive; ++a) {
      const int i = 3 * piece.columns[a / 3] + a % 3;
      out.load[i] += load[a];
      for (int b = 0; b < 3 * kAlive; ++b)
        entries.emplace_back(i, 3 * piece.columns[b / 3] + b % 3, matrix(a, b));
    }
  }
  out.matrix.resize(out.load.size(), out.load.size());
  out.matrix.setFromTriplets(entries.begin(), entries.end());
  const Columns rough = fairing * points;
  out.cost += rough.cwiseProduct(points).sum();
  out.load += Eigen::Map<const Vector>(rough.data(), rough.size());
  out.matrix += for_each_coordinate(fairing);
  return out;
}

// Mass matrix of the samples, per coordinate, and the load of the fit to the target's starting
// parametrisation.
std::pair<Sparse, Columns> mass_equations(const FitTarget& target, const std::vector<SpanPiece>& pieces,
                                          int count) {
  Columns load = Columns::Zero(count, 3);
  std::vector<Eigen::Triplet<double>> entries;
  for (const SpanPiece& piece : pieces) {
    Eigen::Matrix<double, kAlive, kAlive> local = decltype(local)::Zero();
    for (const Sample& sample : piece.samples) {
      local.noalias() += sample.s * sample.s.transpose();
      const Vec3 wanted = target.point(sample.direction);
      for (int c = 0; c < kAlive; ++c) load.row(piece.columns[c]) += sample.s[c] * wanted.transpose();
    }
    for (int a = 0; a < kAlive; ++a) {
      for (int b = 0; b < kAlive; ++b) entries.emplace_back(piece.columns[a], piece.columns[b], local(a, b));
    }
  }
  Sparse mass(count, count);
  mass.setFromTriplets(entries.begin(), entries.end());
  return {mass, load};
}

// Sum of squared second differences of the control points along u and v, as a matrix (Eilers and Marx 1996).
Sparse roughness(const CubeNet& net) {
  std::vector<Eigen::Triplet<double>> entries;
  const auto add = [&](const std::array<int, 3>& line) {
    constexpr double kDifference[3] = {1, -2, 1};
    for (int a = 0; a < 9; ++a)
      entries.emplace_back(line[a / 3], line[a % 3], kDifference[a / 3] * kDifference[a % 3]);
  };
  for (int f = 0; f < kCubeFaces; ++f) {
    for (int i = 0; i < net.size(); ++i) {
      for (int j = 0; j + 2 < net.size(); ++j) {
        add({net.index(f, i, j), net.index(f, i, j + 1), net.index(f, i, j + 2)});
        add({net.index(f, j, i), net.index(f, j + 1, i), net.index(f, j + 2, i)});
      }
    }
  }
  Sparse out(net.count(), net.count());
  out.setFromTriplets(entries.begin(), entries.end());
  return out;
}

Vector solve(const Sparse& matrix, const Vector& load) {
  return Eigen::SimplicialLDLT<Sparse>(matrix).solve(load);
}

// Levenberg-Marquardt over the nets spanned by `basis`, damped by the mass matrix (so by how far the surface
// moves).
Columns fit_points(const FitTarget& target, const std::vector<SpanPiece>& pieces, const Sparse& basis,
                   double slope_weight, const Sparse& fairing) {
  const int count = static_cast<int>(basis.rows());
  const auto [mass, load] = mass_equations(target, pieces, count);
  const Sparse reduced_mass = basis.transpose() * mass * basis, basis3 = for_each_coordinate(basis);
  const Sparse inertia = for_each_coordinate(reduced_mass);
  Columns points(count, 3);
  for (int c = 0; c < 3; ++c) points.col(c) = basis * solve(reduced_mass, basis.transpose() * load.col(c));

  NormalEquations now = offset_equations(target, pieces, points, slope_weight, fairing, false);
  double damping = kFirstLambda;
  for (int k = 0; k < kMostIterations && damping < kLargestLambda; ++k) {
    const Sparse matrix = Sparse(basis3.transpose() * now.matrix * basis3) + damping * inertia;
    const Vector step = basis3 * solve(matrix, basis3.transpose() * now.load);
    const Columns trial = points - Eigen::Map<const Columns>(step.data(), count, 3);
    const double cost = offset_equations(target, pieces, trial, slope_weight, fairing, true).cost;
    if (!(cost < now.cost)) {
      damping *= 4;
      continue;
    }
    const bool done = now.cost - cost < kSmallestFall * now.cost;
    points = trial;
    if (done) break;
    now = offset_equations(target, pieces, points, slope_weight, fairing, false);
    damping = std::max(damping / 3, kLeastLambda);
  }
  return points;
}

double largest_offset(const FitTarget& target, const std::vector<SpanPiece>& pieces, const Columns& points) {
  double largest = 0;
  for (const SpanPiece& piece : pieces) {
    const auto local = gather(piece, points);
    for (const Sample& sample : piece.samples) {
      largest = std::max(largest, std::abs(offset_at(target, local, sample).distance));
    }
  }
  return largest;
}

}  // namespace

SurfaceFit fit_cube_body(const FitTarget& target, const FitOptions& options) {
  const int spans = options.spans;
  const CubeNet net(spans + kCubic);
  const std::vector<double> knots = uniform_knots(kCubic, spans);
  const Sparse basis = allowed_nets(net, spans == 1 ? options.joints : Joints::kKinked);
  const int samples = std::max(kFitPoints, kLeastFitPoints / spans);
  const double slope_weight = options.slope_weight / spans;
  const Columns points = fit_points(target, make_pieces(net, knots, spans, midpoints(samples)), basis,
                                    slope_weight, roughness(net) * (options.fairing * samples * samples));

  SurfaceFit fit;
  fit.error = largest_offset(target, make_pieces(net, knots, spans, grid(kErrorPoints)), points);
  std::vector<Vec4> homogeneous;
  for (int k = 0; k < points.rows(); ++k)
    homogeneous.emplace_back(points(k, 0), points(k, 1), points(k, 2), 1);
  fit.surfaces = cube_surfaces(net, kCubic, knots, homogeneous);
  return fit;
}

}  // namespace nurbs

// See meridian.h. Bernstein coefficients bound a polynomial (bernstein.h); a piece split where d . x is
// highest has no coefficient above zero on either side, up to round-off, wherever it is concave there.
#include "body/meridian.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "nurbs/bernstein.h"
#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

constexpr double kTurn = 6.283185307179586;  // rad
constexpr double kRippledOver = 1e-4;        // rad: overlap of patches that are rippled, all round

// --- made once

using Real = ArcNet::Real;
using Real3 = Eigen::Matrix<Real, 3, 1>;

ArcNet net_about(const BezierPatch& patch, bool arcs_in_u, const Meridian& m) {
  ArcNet net;
  net.arc = arcs_in_u ? patch.degree_u : patch.degree_v;
  net.profile = arcs_in_u ? patch.degree_v : patch.degree_u;
  const Eigen::Matrix<Real, 3, 3> axes = m.axes.cast<Real>();
  for (int i = 0; i <= net.arc; ++i)
    for (int j = 0; j <= net.profile; ++j) {
      const ArcNet::Point p = (arcs_in_u ? patch.point(i, j) : patch.point(j, i)).cast<Real>();
      const Real3 from = axes * (p.head<3>() - p[3] * m.point.cast<Real>());
      net.points.emplace_back(from[0], from[1], from[2], p[3]);
    }
  return net;
}

// Angle from one vector to another.
double turn(Real x0, Real y0, Real x1, Real y1) {
  return static_cast<double>(std::atan2(x0 * y1 - y0 * x1, x0 * x1 + y0 * y1));
}

// What one thing leaves another by: how far it reaches beyond it, and how much it lacks.
struct Off {
  double beyond = 0, lack = 0;
  double most() const { return std::max(beyond, lack); }
  void include(const Off& other) {
    beyond = std::max(beyond, other.beyond);
    lack = std::max(lack, other.lack);
  }
};

// An arc its unit circle, of its radius: from the coefficients of x^2 + y^2 - w^2.
Off off_circle(const Meridian::Sector& s, const Meridian::Row& weight) {
  Real most = 0, least = 0;
  for (int m = 0; m <= 2 * s.degree; ++m) {
    Real beyond = 0, square = 0;
    for (int i = std::max(0, m - s.degree); i <= std::min(s.degree, m); ++i) {
      const int k = m - i;
      const Real share = static_cast<Real>(binomial(s.degree, i)) * binomial(s.degree, k);
      const Real w2 = static_cast<Real>(weight[i]) * weight[k];
      square += share * w2;
      beyond += share * (static_cast<Real>(s.x[i]) * s.x[k] + static_cast<Real>(s.y[i]) * s.y[k] - w2);
    }
    most = std::max(most, beyond / square);
    least = std::min(least, beyond / square);
  }
  return {static_cast<double>(0.5L * most), static_cast<double>(1 - std::sqrt(std::max<Real>(0, 1 + least)))};
}

// Profile and arc whose product the net is, and what it leaves that by, lengths. `rippled`: whether how is
// asked for; where it is not known, the net is none.
Off factorise(const ArcNet& net, bool rippled, Meridian::Piece* piece, Meridian::Sector* sector) {
  const Off none{kFarAway, kFarAway};
  int widest = 0;
  Real r = 0;
  for (int j = 0; j <= net.profile; ++j) {
    const Real off = net.at(0, j).head<2>().norm();
    if (off > r) r = off, widest = j;
  }
  if (!(r > 0)) return none;
  Meridian::Row weight{};  // of the arc
  sector->degree = net.arc;
  for (int i = 0; i <= net.arc; ++i) {
    const ArcNet::Point& p = net.at(i, widest);
    sector->x[i] = static_cast<double>(p[0] / r);
    sector->y[i] = static_cast<double>(p[1] / r);
    weight[i] = static_cast<double>(p[3] / net.at(0, widest)[3]);
  }
  piece->degree = net.profile;
  double speed = 0, least = kFarAway, most = 0, furthest = 0;
  for (int j = 0; j <= net.profile; ++j) {
    const ArcNet::Point& p = net.at(0, j);
    piece->r[j] = static_cast<double>(p[0] * sector->x[0] + p[1] * sector->y[0]);
    piece->z[j] = static_cast<double>(p[2]);
    piece->w[j] = static_cast<double>(p[3]);
    least = std::min(least, piece->w[j]);
    most = std::max(most, piece->w[j]);
    furthest = std::max(furthest, std::abs(piece->r[j]) / piece->w[j]);
    if (j > 0)
      speed = std::max(speed, std::hypot(piece->r[j] / piece->w[j] - piece->r[j - 1] / piece->w[j - 1],
                                         piece->z[j] / piece->w[j] - piece->z[j - 1] / piece->w[j - 1]));
  }
  // Floater, Derivatives of rational Bezier curves, 1992.
  piece->speed = net.profile * speed * (most / least) * (most / least);
  Real error = 0;
  ArcNet product{net.arc, net.profile, {}};
  for (int i = 0; i <= net.arc; ++i)
    for (int j = 0; j <= net.profile; ++j) {
      const ArcNet::Point& p = net.at(i, j);
      const Real pr = piece->r[j];
      const ArcNet::Point made(pr * sector->x[i], pr * sector->y[i],
                               static_cast<Real>(piece->z[j]) * weight[i],
                               static_cast<Real>(piece->w[j]) * weight[i]);
      product.points.push_back(made);
      const Real off = (p - made).head<3>().norm() + std::abs(p[3] - made[3]) * p.head<3>().norm() / p[3];
      error = std::max(error, off / p[3]);
    }
  sector->begin = std::atan2(sector->y[0], sector->x[0]);
  sector->sweep = 0;  // by the way the control points go round, less than half a turn each
  for (int i = 0; i < net.arc; ++i)
    sector->sweep += turn(sector->x[i], sector->y[i], sector->x[i + 1], sector->y[i + 1]);
  const Off circle = off_circle(*sector, weight), off{static_cast<double>(error) + furthest * circle.beyond,
                                                      static_cast<double>(error) + furthest * circle.lack};
  if (rippled) {
    const auto row = [&](const Meridian::Row& r) {
      return std::vector<Real>(r.begin(), r.begin() + net.arc + 1);
    };
    piece->ripple = ripple_of(net, product, {row(sector->x), row(sector->y), row(weight)}, piece->speed);
    if (piece->ripple.empty()) return none;
  }
  return off;
}

// How far apart two pieces are, run through the same or opposite ways, their weights' difference counted with
// the body's size.
double off_by(const Meridian::Piece& a, const Meridian::Piece& b, bool backwards, double size) {
  if (a.degree != b.degree) return kFarAway;
  double most = 0;
  for (int i = 0; i <= a.degree; ++i) {
    const int k = backwards ? b.degree - i : i;
    const double weight = a.w[i] / a.w[0] - b.w[k] / b.w[backwards ? b.degree : 0];
    most = std::max(most, std::hypot(a.r[i] / a.w[i] - b.r[k] / b.w[k], a.z[i] / a.w[i] - b.z[k] / b.w[k]) +
                              std::abs(weight) * size);
  }
  return most;
}

// The ratio of their weights at one control point to that at another, at most.
double weights_apart(const Meridian::Piece& a, const Meridian::Piece& b, bool backwards) {
  double least = kFarAway, most = 0;
  for (int i = 0; i <= a.degree; ++i) {
    const double ratio = a.w[i] / b.w[backwards ? b.degree - i : i];
    least = std::min(least, ratio);
    most = std::max(most, ratio);
  }
  return most / least;
}

// Control points of the line at an end of a patch's arcs, along the piece.
std::vector<Vec4> line_at_end(const Meridian::Sector& s, const BezierPatch& patch, bool last) {
  const int n = s.arcs_in_u ? patch.degree_v : patch.degree_u, i = last ? s.degree : 0;
  std::vector<Vec4> line;
  for (int j = 0; j <= n; ++j) {
    const int k = s.backwards ? n - j : j;
    line.push_back(s.arcs_in_u ? patch.point(i, k) : patch.point(k, i));
  }
  return line;
}

// How far apart, at most, the lines are with which sectors that follow each other meet: where each end's is
// nearest to one of another sector.
double seam_of(const std::vector<Meridian::Sector>& sectors, const std::vector<BezierPatch>& patches,
               double size) {
  std::vector<std::vector<Vec4>> lines;
  for (const Meridian::Sector& s : sectors)
    for (const bool last : {false, true}) lines.push_back(line_at_end(s, patches[s.patch], last));
  const auto apart = [&](const std::vector<Vec4>& a, const std::vector<Vec4>& b) {
    double most = 0;
    for (size_t j = 0; j < a.size(); ++j)
      most = std::max(most, (a[j].head<3>() / a[j][3] - b[j].head<3>() / b[j][3]).norm() +
                                size * std::abs(a[j][3] / a[0][3] - b[j][3] / b[0][3]));
    return most;
  };
  double most = 0;
  for (size_t k = 0; k < lines.size(); ++k) {
    double least = kFarAway;
    for (size_t l = 0; l < lines.size(); ++l)
      if (l != k && (lines.size() == 2 || l / 2 != k / 2)) least = std::min(least, apart(lines[k], lines[l]));
    most = std::max(most, least);
  }
  return most;
}

// Value and two derivatives of a polynomial in Bernstein form.
struct Jet {
  double f, f1, f2;
};
Jet evaluate(const Meridian::Row& b, int n, double t) {
  const double s = 1 - t;
  const auto quadratic = [&](double b0, double b1, double b2) {
    const double c0 = s * b0 + t * b1, c1 = s * b1 + t * b2;
    return Jet{s * c0 + t * c1, n * (c1 - c0), n * (n - 1) * (b2 - 2 * b1 + b0)};
  };
  if (n == 2) return quadratic(b[0], b[1], b[2]);
  if (n == 0) return {b[0], 0, 0};
  if (n == 1) return {s * b[0] + t * b[1], b[1] - b[0], 0};
  Meridian::Row c = b;
  for (int k = n; k > 2; --k)
    for (int i = 0; i < k; ++i) c[i] = s * c[i] + t * c[i + 1];
  return quadratic(c[0], c[1], c[2]);
}

// --- the support of the profile

// PiecePart of a piece: coefficients of f = dr r + dz z - level w, and of w.
struct PiecePart {
  int piece, degree;
  double from, to;  // parameters of the piece
  Meridian::Row f, w;

  // No point of it is further above the level than this times its weight.
  bool below(double more) const {
    for (int i = 0; i <= degree; ++i)
      if (f[i] > more * w[i]) return false;
    return true;
  }
};

Jet quotient(const Jet& f, const Jet& w) {
  const double over = 1 / w.f, q = f.f * over, q1 = (f.f1 - q * w.f1) * over;
  return {q, q1, (f.f2 - 2 * q1 * w.f1 - q * w.f2) * over};
}
// f / w of a part.
Jet quotient(const PiecePart& part, double t) {
  return quotient(evaluate(part.f, part.degree, t), evaluate(part.w, part.degree, t));
}
Jet quotient(const Meridian::Piece& piece, const Meridian::Row& row, double t) {
  return quotient(evaluate(row, piece.degree, t), evaluate(piece.w, piece.degree, t));
}

// Whether f - above w is concave all over the part, and by its slope where it is `at` rises by less than more
// times the weight.
bool concave_below(const PiecePart& part, double above, const Jet& at, double weight_at, double more) {
  double bend = kFarAway, least = part.w[0];  // -f'' at least, over n (n - 1)
  const auto g = [&](int i) { return part.f[i] - above * part.w[i]; };
  for (int i = 0; i + 2 <= part.degree; ++i) bend = std::min(bend, 2 * g(i + 1) - g(i) - g(i + 2));
  for (int i = 1; i <= part.degree; ++i) least = std::min(least, part.w[i]);
  if (part.degree < 2) bend = 0;
  if (!(bend >= 0)) return false;
  const double slope = std::abs(at.f1) * weight_at, second = bend * part.degree * (part.degree - 1);
  const double rise = slope * slope < 2 * second * slope ? slope * slope / (2 * second) : slope;
  return rise <= more * least;
}

// Place number of a table over directions of the half plane, from -axis to axis.
double place_in_table(double dr, double dz) {
  return 0.5 * kMeridianStarts * (1 + dz / (dr + std::abs(dz)));
}

class ProfileSearch {
 public:
  ProfileSearch(const Meridian& m, double dr, double dz, double size)
      : m_(m), dr_(dr), dz_(dz), size_(size) {}

  // From the table, or from `last` where that is no lower: on a line it stays there.
  bool run_from_table(const Meridian::Place& last) {
    const double place = place_in_table(dr_, dz_);
    const int low = std::clamp(static_cast<int>(place), 0, kMeridianStarts - 1);
    Meridian::Place from = m_.starts[low];
    if (const Meridian::Place& next = m_.starts[low + 1]; next.piece == from.piece)
      from.t += std::clamp(place - low, 0.0, 1.0) * (next.t - from.t);
    else if (place - low > 0.5)
      from = next;
    if (last.piece >= 0 && height_at(last) >= height_at(from) - slack()) from = last;
    return run(from);
  }
  // From the start; whether it is proven that nothing is higher than height() + slack().
  bool run(const Meridian::Place& start) {
    PiecePart part = whole(start.piece, 0);
    double t = start.t;
    const Top top = climb(part, &t);
    level_ = top.at.f;
    best_ = {start.piece, t};
    for (int i = 0; i <= part.degree; ++i) part.f[i] -= level_ * part.w[i];
    if (!concave_below(part, 0, top.at, top.weight, slack()) && !part.below(slack()) &&
        !split(part, t, kMeridianDepth))
      return false;
    for (int p = 0; p < static_cast<int>(m_.pieces.size()); ++p)
      if (p != start.piece && !look_at(p)) return false;
    return true;
  }
  double height_at(const Meridian::Place& at) const { return quotient(whole(at.piece, 0), at.t).f; }
  Meridian::Place best() const { return best_; }
  double height() const { return level_ + above_; }
  double slack() const { return kRoundoff * size_; }

 private:
  PiecePart whole(int piece, double level) const {
    const Meridian::Piece& p = m_.pieces[piece];
    PiecePart part{piece, p.degree, 0, 1, {}, p.w};
    for (int i = 0; i <= p.degree; ++i) part.f[i] = dr_ * p.r[i] + dz_ * p.z[i] - level * p.w[i];
    return part;
  }
  bool look_at(int piece) {
    const Meridian::Piece& p = m_.pieces[piece];
    const double most = level_ + above_ + slack();
    bool below = true;
    for (int i = 0; i <= p.degree; ++i) below &= dr_ * p.r[i] + dz_ * p.z[i] <= most * p.w[i];
    return below || examine(whole(piece, level_), kMeridianDepth);
  }

  // Newton's last place, of where it goes from there f differs by less than round-off.
  struct Top {
    Jet at;
    double weight;
  };
  // From *t to a local maximum. Where the slope is round-off *t stays.
  Top climb(const PiecePart& part, double* t) const {
    const double speed = (part.to - part.from) * m_.pieces[part.piece].speed, noise = kRoundoff * size_;
    Jet at = quotient(part, *t);
    double last = *t;
    for (int k = 0; k < kMeridianSteps; ++k) {
      const double slope = std::abs(at.f1);
      if (slope <= kMeridianSlope * noise) break;
      double to = at.f2 < 0 ? *t - at.f1 / at.f2 : at.f1 > 0 ? 1.0 : 0.0;
      to = std::clamp(to, 0.0, 1.0);
      const double step = std::abs(to - *t);
      if (step * speed <= kMeridianStep * size_ && slope * step <= kMeridianSlope * noise) {
        *t = to;  // not evaluated: as good as it gets
        break;
      }
      Jet there = quotient(part, to);
      for (int halving = 0; there.f < at.f - noise && halving < kMeridianHalvings; ++halving) {
        to = 0.5 * (to + *t);
        there = quotient(part, to);
      }
      if (there.f < at.f - noise || to == *t) break;
      at = there;
      *t = last = to;
    }
    return {at, evaluate(part.w, part.degree, last).f};
  }

  bool examine(const PiecePart& part, int depth) {
    if (part.below(above_ + slack())) return true;
    if (depth == 0) return false;
    double t = 0.5;
    const Top top = climb(part, &t);
    if (top.at.f > above_) {
      above_ = top.at.f;
      best_ = {part.piece, part.from + t * (part.to - part.from)};
    }
    return concave_below(part, top.at.f, top.at, top.weight, above_ - top.at.f + slack()) ||
           part.below(above_ + slack()) || split(part, t, depth);
  }

  // De Casteljau at t, or in the middle where that is too near an end.
  bool split(const PiecePart& part, double t, int depth) {
    if (!(t > kMeridianEnd && t < 1 - kMeridianEnd)) t = 0.5;
    PiecePart low = part, high = part;
    low.to = high.from = part.from + t * (part.to - part.from);
    for (int i = 0; i <= part.degree; ++i) {
      low.f[i] = high.f[0];
      low.w[i] = high.w[0];
      for (int k = 0; k < part.degree - i; ++k) {
        high.f[k] += t * (high.f[k + 1] - high.f[k]);
        high.w[k] += t * (high.w[k + 1] - high.w[k]);
      }
    }
    return examine(low, depth - 1) && examine(high, depth - 1);
  }

  const Meridian& m_;
  const double dr_, dz_, size_;
  double level_ = 0, above_ = 0;
  Meridian::Place best_;
};

// --- round the axis

double wrap(double angle) {  // into (-pi, pi]
  return angle - kTurn * std::round(angle / kTurn);
}

// The piece that a patch sweeps.
int piece_swept(const Meridian& m, const Meridian::Sector& sector) {
  const auto number = static_cast<int>(&sector - m.sectors.data());
  int piece = 0;
  while (number >= m.pieces[piece].first_sector + m.pieces[piece].sectors) ++piece;
  return piece;
}

// At a place where the profile has its support along (dr, dz), but for `upper`.
ProfilePoint profile_point(const Meridian& m, const Meridian::Place& place, double dr, double dz,
                           double size) {
  ProfilePoint found;
  found.place = place;
  const Meridian::Piece& piece = m.pieces[place.piece];
  const Jet r = quotient(piece, piece.r, place.t), z = quotient(piece, piece.z, place.t);
  const double speed = std::hypot(r.f1, z.f1), side = dr * z.f1 - dz * r.f1 < 0 ? -1 : 1;
  found.r = r.f;
  found.z = z.f;
  const bool normal = speed > kHeldSpeed * size;
  found.turn_r = normal ? side * z.f1 / speed : dr;
  found.turn_z = normal ? -side * r.f1 / speed : dz;
  return found;
}

Ripple ripple_at(const Meridian::Piece& piece, double t) {
  Ripple r;
  const double weight = evaluate(piece.w, piece.degree, t).f;
  for (int j = 0; j <= piece.degree; ++j)
    r.add(
        binomial(piece.degree, j) * std::pow(t, j) * std::pow(1 - t, piece.degree - j) * piece.w[j] / weight,
        piece.ripple[j]);
  return r;
}

// Of a point on a patch that a piece sweeps; and back, `u` the arc's parameter.
Meridian::Place place_on(const Meridian& m, const Meridian::Sector& sector, const SurfacePoint& at) {
  const double t = sector.arcs_in_u ? at.v : at.u;
  return {piece_swept(m, sector), sector.backwards ? 1 - t : t};
}
SurfacePoint point_on(const Meridian::Sector& sector, double u, const Meridian::Place& place) {
  const double t = sector.backwards ? 1 - place.t : place.t;
  return {sector.patch, sector.arcs_in_u ? u : t, sector.arcs_in_u ? t : u};
}

// The arc's parameter where it points along (x, y), of angle `angle`; false where Newton is not sure.
bool parameter_of(const Meridian::Sector& s, double x, double y, double angle, double* u) {
  double share = wrap(angle - (s.begin + 0.5 * s.sweep)) / s.sweep + 0.5;
  if (!(std::abs(share - 0.5) <= 0.5 + kMeridianOver)) return false;
  share = std::clamp(share, 0.0, 1.0);
  Meridian::Row across{};
  for (int i = 0; i <= s.degree; ++i) across[i] = s.y[i] * x - s.x[i] * y;
  for (int k = 0; k < kMeridianSteps; ++k) {
    const Jet f = evaluate(across, s.degree, share);
    const double to = std::clamp(share - f.f / f.f1, 0.0, 1.0);
    if (!std::isfinite(to)) return false;
    const bool done = std::abs(to - share) <= kMeridianTurn;
    share = to;
    if (done) {
      Meridian::Row along{};
      for (int i = 0; i <= s.degree; ++i) along[i] = s.x[i] * x + s.y[i] * y;
      *u = share;
      return evaluate(along, s.degree, share).f > 0;
    }
  }
  return false;
}

// The sector of a piece that has a place along (x, y), and the arc's parameter there; `first` is looked at
// first, if it is one. Null where none is sure.
const Meridian::Sector* sector_along(const Meridian& m, const Meridian::Piece& piece,
                                     const Meridian::Sector* first, double x, double y, double angle,
                                     double* u) {
  if (first && parameter_of(*first, x, y, angle, u)) return first;
  for (int k = 0; k < piece.sectors; ++k) {
    const Meridian::Sector& sector = m.sectors[piece.first_sector + k];
    if (&sector != first && parameter_of(sector, x, y, angle, u)) return &sector;
  }
  return nullptr;
}

}  // namespace

Meridian make_meridian(const std::vector<BezierPatch>& patches, const Revolution& revolution, double size,
                       double allowed) {
  if (!revolution.found) return {};
  Meridian m;
  const Vec3 across = revolution.axis.unitOrthogonal();
  m.axes.row(0) = across;
  m.axes.row(1) = revolution.axis.cross(across);
  m.axes.row(2) = revolution.axis;
  m.point = revolution.point;
  m.sector_of.assign(patches.size(), -1);
  const double close = allowed * size;
  const bool rippled = allowed > kMeridianError;
  struct Found {
    Meridian::Piece piece;
    std::vector<Meridian::Sector> sectors;
  };
  std::vector<Found> all;
  Off all_off;
  for (size_t p = 0; p < patches.size(); ++p) {
    Meridian::Piece piece;
    Meridian::Sector sector;
    Off off{kFarAway, kFarAway};
    for (const bool arcs_in_u : {true, false}) {
      Meridian::Piece profile;
      Meridian::Sector arc;
      const Off o = factorise(net_about(patches[p], arcs_in_u, m), rippled, &profile, &arc);
      if (!(o.most() < off.most()) || arc.sweep == 0) continue;
      off = o;
      piece = profile;
      sector = arc;
      sector.arcs_in_u = arcs_in_u;
    }
    if (!(off.most() <= close)) {
      if (!(out_of_plane(patches[p], revolution.axis) <= close)) return {};
      continue;
    }
    sector.patch = static_cast<int>(p);
    Found* mine = nullptr;
    for (Found& f : all)
      for (const bool backwards : {false, true}) {
        const double apart = mine ? kFarAway : off_by(f.piece, piece, backwards, size);
        if (!(apart <= close)) continue;
        mine = &f;
        sector.backwards = backwards;
        off.beyond += apart;
        off.lack += apart;
        for (Ripple& r : piece.ripple) r.most += apart;
      }
    all_off.include(off);
    if (!mine) {
      all.push_back({piece, {}});
      mine = &all.back();
    }
    if (sector.backwards) std::reverse(piece.ripple.begin(), piece.ripple.end());
    const double apart = weights_apart(mine->piece, piece, sector.backwards);
    for (size_t k = 0; k < piece.ripple.size(); ++k) mine->piece.ripple[k].include(piece.ripple[k], apart);
    for (const Ripple& r : piece.ripple) m.ripple.include(r);
    mine->sectors.push_back(sector);
  }
  for (Found& f : all) {
    double turn = 0;
    for (const Meridian::Sector& s : f.sectors) turn += std::abs(s.sweep);
    if (!(std::abs(turn - kTurn) <= (rippled ? kRippledOver : kMeridianOver))) return {};
    if (rippled) m.seam = std::max(m.seam, f.sectors.size() * seam_of(f.sectors, patches, size));
    f.piece.first_sector = static_cast<int>(m.sectors.size());
    f.piece.sectors = static_cast<int>(f.sectors.size());
    for (const Meridian::Sector& s : f.sectors) {
      m.sector_of[s.patch] = static_cast<int>(m.sectors.size());
      m.sectors.push_back(s);
    }
    m.pieces.push_back(f.piece);
  }
  if (m.pieces.empty() || !(all_off.most() <= close)) return {};
  const double roundoff = kMeridianSame * size;
  m.beyond = all_off.beyond;
  m.error = all_off.most();
  m.bounds = m.beyond <= roundoff;
  m.exact = m.error <= roundoff;
  for (int k = 0; k <= kMeridianStarts; ++k) {
    const double at = 2.0 * k / kMeridianStarts - 1, dr = 1 - std::abs(at), length = std::hypot(dr, at);
    Meridian::Place best;
    double height = -kFarAway;
    for (int p = 0; p < static_cast<int>(m.pieces.size()); ++p) {
      ProfileSearch search(m, dr / length, at / length, size);
      if (!search.run({p, 0.5})) continue;
      if (search.height() > height) height = search.height(), best = search.best();
    }
    if (best.piece < 0) return {};
    m.starts.push_back(best);
  }
  return m;
}

ProfileBend profile_bend(const Meridian& m, const Meridian::Place& at, const Vec2& d, const Vec2& asked,
                         double size) {
  const Meridian::Piece& piece = m.pieces[at.piece];
  const Jet r = quotient(piece, piece.r, at.t), z = quotient(piece, piece.z, at.t);
  const double speed2 = r.f1 * r.f1 + z.f1 * z.f1, speed = std::sqrt(speed2),
               slope = asked[0] * r.f1 + asked[1] * z.f1, bend = -(d[0] * r.f2 + d[1] * z.f2);
  if (!(speed > kHeldSpeed * size) || (at.t <= kOnEdge && slope < -kHeldSlope * speed) ||
      (at.t >= 1 - kOnEdge && slope > kHeldSlope * speed))
    return {r.f, 0};
  const bool bent = bend * size > kFlatCurvature * speed2;
  return {r.f, bent ? speed2 / bend : std::numeric_limits<double>::infinity()};
}

bool find_profile_point(const Meridian& m, double dr, double dz, double size, const Meridian::Place& start,
                        ProfilePoint* found) {
  ProfileSearch search(m, dr, dz, size);
  if (!search.run_from_table(start)) return false;
  *found = profile_point(m, search.best(), dr, dz, size);
  found->upper = search.height() + search.slack();
  return true;
}

bool find_meridian_support(const Meridian& m, const Vec3& d, double size, const SurfacePoint* start,
                           MeridianSupport* found) {
  const Vec3 e = m.axes * d;
  const double dr = std::hypot(e[0], e[1]);
  const bool started = start && m.sector_of[start->patch] >= 0;
  const Meridian::Sector* last = started ? &m.sectors[m.sector_of[start->patch]] : nullptr;
  Meridian::Place from;
  if (last) from = place_on(m, *last, *start);
  ProfileSearch search(m, dr, e[2], size);
  if (!search.run_from_table(from)) return false;
  const Meridian::Place best = search.best();
  const Meridian::Piece& piece = m.pieces[best.piece];

  const auto put = [&](const Meridian::Sector& sector, double u) {
    found->where = point_on(sector, u, best);
    found->upper = search.height() + d.dot(m.point) + search.slack() + m.beyond;
    return true;
  };
  const bool stays = last && piece_swept(m, *last) == best.piece;
  if (!(dr > kRoundoff)) {  // along the axis: all round it are as high
    return stays ? put(*last, last->arcs_in_u ? start->u : start->v) : put(m.sectors[piece.first_sector], 0);
  }
  const double x = e[0] / dr, y = e[1] / dr, angle = std::atan2(y, x);
  double u;
  const Meridian::Sector* there = sector_along(m, piece, stays ? last : nullptr, x, y, angle, &u);
  return there && put(*there, u);
}

bool find_round_point(const Meridian& m, const std::vector<BezierPatch>& patches, const Vec3& d, double size,
                      const SurfacePoint& support, RoundPoint* found) {
  const Vec3 e = m.axes * d;
  const double dr = std::hypot(e[0], e[1]);
  if (!(dr > kRoundoff)) return false;
  Meridian::Place best;
  if (support.patch >= 0 && m.sector_of[support.patch] >= 0) {
    best = place_on(m, m.sectors[m.sector_of[support.patch]], support);
  } else {
    ProfileSearch search(m, dr, e[2], size);
    if (!search.run_from_table({})) return false;
    best = search.best();
  }
  const Meridian::Piece& piece = m.pieces[best.piece];
  const double x = e[0] / dr, y = e[1] / dr, angle = std::atan2(y, x);
  double u;
  const Meridian::Sector* there = sector_along(m, piece, nullptr, x, y, angle, &u);
  if (!there) return false;
  const Meridian::Sector& sector = *there;
  found->where = point_on(sector, u, best);
  found->profile = profile_point(m, best, dr, e[2], size);
  found->ripple = ripple_at(piece, best.t);
  const Jet1 jet = evaluate1(patches[sector.patch], found->where.u, found->where.v);
  const Jet ax = evaluate(sector.x, sector.degree, u), ay = evaluate(sector.y, sector.degree, u);
  const double turn = (ax.f * ay.f1 - ay.f * ax.f1) / (ax.f * ax.f + ay.f * ay.f);  // of the arc, by u
  const Vec3 at = m.axes * (jet.s - m.point), by_u = m.axes * (sector.arcs_in_u ? jet.su : jet.sv);
  found->r = x * at[0] + y * at[1];
  found->z = at[2];
  found->slope_r = x * at[1] - y * at[0] + (x * by_u[0] + y * by_u[1]) / turn;
  found->slope_z = by_u[2] / turn;
  const double from_begin = wrap(angle - sector.begin) * (sector.sweep < 0 ? -1 : 1),
               passed = std::clamp(from_begin < -kMeridianOver ? from_begin + kTurn : from_begin, 0.0,
                                   std::abs(sector.sweep)),
               left = std::abs(sector.sweep) - passed;
  found->before = sector.sweep < 0 ? left : passed;
  found->after = sector.sweep < 0 ? passed : left;
  return true;
}

}  // namespace nurbs

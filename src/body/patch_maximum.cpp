// Branch and bound on d . s(u, v) over one patch; see patch_maximum.h.
#include "body/patch_maximum.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "nurbs/bernstein.h"
#include "nurbs/tolerances.h"
#include "nurbs/wide.h"

namespace nurbs {
namespace {

constexpr int kMost = (kMaxDegree + 1) * (kMaxDegree + 1);
constexpr int kBeforeTurning = 40;  // boxes looked at

// A piece [u0, u1] x [v0, v1] of the patch with the coefficients of d . wx - h0 w and of w on it. A degree of
// 0 means that the piece is an edge.
struct Box {
  int nu, nv;
  bool rational;
  double u0, u1, v0, v1;
  double f[kMost], w[kMost];

  int size() const { return (nu + 1) * (nv + 1); }
  bool bicubic() const { return nu == 3 && nv == 3; }
  double weight(int k) const { return rational ? w[k] : 1.0; }
  void set_header(const Box& other) {
    nu = other.nu;
    nv = other.nv;
    rational = other.rational;
    u0 = other.u0;
    u1 = other.u1;
    v0 = other.v0;
    v1 = other.v1;
  }
};

void copy(const Box& from, Box* to) {
  to->set_header(from);
  std::copy_n(from.f, from.size(), to->f);
  if (from.rational) std::copy_n(from.w, from.size(), to->w);
}

// --- the same for bicubic nets, the usual ones: a row of four coefficients in a register

struct LaneRows {
  Lane4 r[4];
  LaneRows() = default;
  NURBS_INLINE explicit LaneRows(const double* c) { std::memcpy(r, c, sizeof r); }
  NURBS_INLINE LaneRows turned() const {
    LaneRows t = *this;
    transpose({r[0], r[1], r[2], r[3]}, t.r);
    return t;
  }
  NURBS_INLINE void store(double* c) const { std::memcpy(c, r, sizeof r); }
};
NURBS_INLINE double highest(const Lane4& a) {
  return std::max(std::max(a[0], a[1]), std::max(a[2], a[3]));
}

// De Casteljau at t between rows: r[0] to r[3] become those of [0, t], or of [t, 1].
NURBS_INLINE void cut_rows(double t, bool keep_low, LaneRows* c) {
  const double s = 1 - t;
  Lane4(&r)[4] = c->r;
  const Lane4 a = s * r[0] + t * r[1], b = s * r[1] + t * r[2], d = s * r[2] + t * r[3];
  const Lane4 ab = s * a + t * b, bd = s * b + t * d, at = s * ab + t * bd;
  if (keep_low) {
    r[1] = a;
    r[2] = ab;
    r[3] = at;
  } else {
    r[0] = at;
    r[1] = bd;
    r[2] = d;
  }
}
NURBS_INLINE void cut_rows(double from, double to, LaneRows* c) {
  if (to < 1) cut_rows(to, true, c);
  if (from > 0) cut_rows(from / to, false, c);
}

// The same of any line of coefficients.
void cut_line(double* c, int degree, int stride, double from, double to) {
  if (to < 1)
    for (int i = 1; i <= degree; ++i)
      for (int k = degree; k >= i; --k) c[k * stride] = (1 - to) * c[(k - 1) * stride] + to * c[k * stride];
  const double t = from / to;
  if (t > 0)
    for (int i = 1; i <= degree; ++i)
      for (int k = 0; k <= degree - i; ++k) c[k * stride] = (1 - t) * c[k * stride] + t * c[(k + 1) * stride];
}

// The net of a piece of the patch from the patch's.
NURBS_INLINE void cut(const PatchPiece& to, LaneRows* net) {
  cut_rows(to.u0, to.u1, net);
  if (to.v0 == 0 && to.v1 == 1) return;
  *net = net->turned();
  cut_rows(to.v0, to.v1, net);
  *net = net->turned();
}
void cut(const PatchPiece& to, int nu, int nv, double* c) {
  const int row = nv + 1;
  for (int j = 0; j < row; ++j) cut_line(c + j, nu, row, to.u0, to.u1);
  for (int i = 0; i <= nu; ++i) cut_line(c + i * row, nv, 1, to.v0, to.v1);
}

// `low` into both halves.
NURBS_INLINE void halve_bicubic(double* low, double* high, bool along_u) {
  LaneRows c(low);
  if (!along_u) c = c.turned();
  const Lane4 a = 0.5 * (c.r[0] + c.r[1]), b = 0.5 * (c.r[1] + c.r[2]), d = 0.5 * (c.r[2] + c.r[3]);
  const Lane4 ab = 0.5 * (a + b), bd = 0.5 * (b + d), middle = 0.5 * (ab + bd);
  LaneRows first = c, second = c;
  first.r[1] = a;
  first.r[2] = ab;
  first.r[3] = second.r[0] = middle;
  second.r[1] = bd;
  second.r[2] = d;
  if (!along_u) {
    first = first.turned();
    second = second.turned();
  }
  first.store(low);
  second.store(high);
}

void halve_box(const Box& box, bool along_u, Box* low, Box* high) {
  copy(box, low);
  high->set_header(box);
  if (along_u)
    low->u1 = high->u0 = 0.5 * (box.u0 + box.u1);
  else
    low->v1 = high->v0 = 0.5 * (box.v0 + box.v1);
  const auto both = [&](double* first, double* second) {
    if (box.bicubic())
      halve_bicubic(first, second, along_u);
    else
      halve_net(first, second, box.nu, box.nv, along_u);
  };
  both(low->f, high->f);
  if (box.rational) both(low->w, high->w);
}

// Keeps one edge of the box: `high` u (or v) only.
void keep_edge(bool along_u, bool high, Box* box) {
  const int row = box->nv + 1;
  if (along_u) {
    const int from = high ? box->nu * row : 0;
    for (int j = 0; j < row; ++j) {
      box->f[j] = box->f[from + j];
      if (box->rational) box->w[j] = box->w[from + j];
    }
    box->nu = 0;
    (high ? box->u0 : box->u1) = high ? box->u1 : box->u0;
  } else {
    const int from = high ? box->nv : 0;
    for (int i = 0; i <= box->nu; ++i) {
      box->f[i] = box->f[i * row + from];
      if (box->rational) box->w[i] = box->w[i * row + from];
    }
    box->nv = 0;
    (high ? box->v0 : box->v1) = high ? box->v1 : box->v0;
  }
}

// Value and two derivatives at t of one line of coefficients.
void evaluate_line(const double* c, int degree, int stride, double t, double (&out)[3]) {
  double a[kMaxDegree + 1] = {};
  for (int i = 0; i <= degree; ++i) a[i] = c[i * stride];
  const double s = 1 - t;
  out[1] = out[2] = 0;
  for (int left = degree; left > 0; --left) {
    if (left == 2) out[2] = degree * (degree - 1) * (a[2] - 2 * a[1] + a[0]);
    if (left == 1) out[1] = degree * (a[1] - a[0]);
    for (int i = 0; i < left; ++i) a[i] = s * a[i] + t * a[i + 1];
  }
  out[0] = a[0];
}

struct Taylor {
  double f, fu, fv, fuu, fuv, fvv;
};
Taylor evaluate_net(const double* c, int nu, int nv, double s, double t) {
  double line[3][kMaxDegree + 1];
  for (int i = 0; i <= nu; ++i) {
    double out[3];
    evaluate_line(c + i * (nv + 1), nv, 1, t, out);
    for (int k = 0; k < 3; ++k) line[k][i] = out[k];
  }
  double a[3], b[3], d[3];
  evaluate_line(line[0], nu, 1, s, a);
  evaluate_line(line[1], nu, 1, s, b);
  evaluate_line(line[2], nu, 1, s, d);
  return {a[0], a[1], b[0], a[2], b[1], d[0]};
}

Taylor evaluate_bicubic(const double* c, double s, double t) {
  const LaneRows x(c);
  const double r = 1 - s, q = 1 - t;
  const Lane4 a = r * x.r[0] + s * x.r[1], b = r * x.r[1] + s * x.r[2], d = r * x.r[2] + s * x.r[3];
  const Lane4 ab = r * a + s * b, bd = r * b + s * d;
  const Lane4 f = r * ab + s * bd, fu = 3.0 * (bd - ab), fuu = 6.0 * (d - 2.0 * b + a);
  const Lane4 value{q * q * q, 3 * q * q * t, 3 * q * t * t, t * t * t},
      slope{-3 * q * q, 3 * q * (q - 2 * t), 3 * t * (2 * q - t), 3 * t * t},
      bend{6 * q, 6 * (t - 2 * q), 6 * (q - 2 * t), 6 * t};
  Lane4 first[4], second[4];
  transpose({f * value, fu * value, f * slope, fuu * value}, first);
  transpose({fu * slope, f * bend, f, f}, second);
  const Lane4 one = first[0] + first[1] + first[2] + first[3],
              two = second[0] + second[1] + second[2] + second[3];
  return {one[0], one[1], one[2], one[3], two[0], two[1]};
}

struct Range {
  double low = kFarAway, high = -kFarAway;
  void add(double x) {
    low = std::min(low, x);
    high = std::max(high, x);
  }
  bool one_way() const { return high <= 0 || low >= 0; }
  double magnitude() const { return std::max(std::abs(low), std::abs(high)); }
};

// What the coefficients of the box's f - level w say of it.
struct Bounds {
  Range g, gu, gv, guu, guv, gvv;  // first and second differences, not times the degrees
};
void net_differences(const double* g, int nu, int nv, Bounds* b) {
  const int row = nv + 1;
  for (int i = 0; i <= nu; ++i)
    for (int j = 0; j <= nv; ++j) {
      const double* c = g + i * row + j;
      // The analyzer does not see that boxes hold as many coefficients as their degrees say.
      // NOLINTBEGIN(clang-analyzer-core.*)
      if (i < nu) b->gu.add(c[row] - c[0]);
      if (j < nv) b->gv.add(c[1] - c[0]);
      // NOLINTEND(clang-analyzer-core.*)
      if (i < nu && j < nv) b->guv.add(c[row + 1] - c[row] - c[1] + c[0]);
      if (i + 1 < nu) b->guu.add(c[2 * row] - 2 * c[row] + c[0]);
      if (j + 1 < nv) b->gvv.add(c[2] - 2 * c[1] + c[0]);
    }
}

void difference_bicubic(const double* g, Bounds* b) {
  const LaneRows c(g);
  // Neighbours in a row; the last counts twice.
  const auto step = [](const Lane4& r) {
    const Lane4 d = __builtin_shufflevector(r, r, 1, 2, 3, 3) - __builtin_shufflevector(r, r, 0, 1, 2, 2);
    return d;
  };
  const Lane4 u[3] = {c.r[1] - c.r[0], c.r[2] - c.r[1], c.r[3] - c.r[2]};
  const Lane4 v[4] = {step(c.r[0]), step(c.r[1]), step(c.r[2]), step(c.r[3])};
  const Lane4 uu[2] = {u[1] - u[0], u[2] - u[1]};
  Lane4 vv[4];
  for (int i = 0; i < 4; ++i) {
    const Lane4 after = __builtin_shufflevector(v[i], v[i], 1, 2, 2, 2),
                before = __builtin_shufflevector(v[i], v[i], 0, 1, 1, 1);
    vv[i] = after - before;
  }
  const Lane4 mixed[3] = {v[1] - v[0], v[2] - v[1], v[3] - v[2]};
  const auto least = [](const Lane4& p, const Lane4& q, const Lane4& r, const Lane4& s) {
    return smaller(smaller(p, q), smaller(r, s));
  };
  const auto most = [](const Lane4& p, const Lane4& q, const Lane4& r, const Lane4& s) {
    return larger(larger(p, q), larger(r, s));
  };
  Lane4 low[4], high[4];
  transpose({least(u[0], u[1], u[2], u[2]), least(v[0], v[1], v[2], v[3]), smaller(uu[0], uu[1]),
             least(vv[0], vv[1], vv[2], vv[3])},
            low);
  transpose({most(u[0], u[1], u[2], u[2]), most(v[0], v[1], v[2], v[3]), larger(uu[0], uu[1]),
             most(vv[0], vv[1], vv[2], vv[3])},
            high);
  const Lane4 lows = least(low[0], low[1], low[2], low[3]), highs = most(high[0], high[1], high[2], high[3]);
  b->gu = {lows[0], highs[0]};
  b->gv = {lows[1], highs[1]};
  b->guu = {lows[2], highs[2]};
  b->gvv = {lows[3], highs[3]};
  const Lane4 zero{0, 0, 0, 0};
  b->guv = {-highest(larger<Lane4>(zero - mixed[0], larger<Lane4>(zero - mixed[1], zero - mixed[2]))),
            highest(larger(mixed[0], larger(mixed[1], mixed[2])))};
}

Bounds bounds_of(const Box& box, bool bicubic, const double* g) {
  Bounds b;
  if (bicubic)
    difference_bicubic(g, &b);
  else
    net_differences(g, box.nu, box.nv, &b);
  return b;
}

// Second derivatives of a box, all as coefficients of the box's own degrees.
struct Hessian {
  double uu[kMost], uv[kMost], vv[kMost];
};
// Raises the degree of `rows` polynomials from n by one: `apart` between them, `stride` between the
// coefficients of one.
void elevate(double* c, int n, int stride, int rows, int apart) {
  for (int r = 0; r < rows; ++r) {
    double* x = c + r * apart;
    x[(n + 1) * stride] = x[n * stride];
    for (int i = n; i > 0; --i) {
      const double share = i / (n + 1.0);
      x[i * stride] = share * x[(i - 1) * stride] + (1 - share) * x[i * stride];
    }
  }
}
void second_derivatives(const double* g, int nu, int nv, Hessian* h) {
  const int row = nv + 1;
  for (int i = 0; i <= nu; ++i)
    for (int j = 0; j <= nv; ++j) {
      const double* c = g + i * row + j;
      if (i + 1 < nu) h->uu[i * row + j] = nu * (nu - 1) * (c[2 * row] - 2 * c[row] + c[0]);
      if (j + 1 < nv) h->vv[i * row + j] = nv * (nv - 1) * (c[2] - 2 * c[1] + c[0]);
      if (i < nu && j < nv) h->uv[i * row + j] = nu * nv * (c[row + 1] - c[row] - c[1] + c[0]);
    }
  for (const int n : {nu - 2, nu - 1}) elevate(h->uu, n, row, nv + 1, 1);
  for (const int n : {nv - 2, nv - 1}) elevate(h->vv, n, 1, nu + 1, row);
  elevate(h->uv, nv - 1, 1, nu, row);
  elevate(h->uv, nu - 1, row, nv + 1, 1);
}

// How a box's f is bent, at least, along parameters turned by an angle: what is concave.
struct Bend {
  double a = 0, c = 0;  // downwards, along the first and across
  double share = 0;     // that the mixed term leaves; 0: nothing is proven
  double cosine = 1, sine = 0;
};

class Search {
 public:
  Search(const BezierPatch& patch, const PatchPiece& piece, const Vec3& d, double slack, Highest* best)
      : patch_(patch), piece_(piece), d_(d), slack_(slack), h0_(best->h), best_(best) {}

  void run() {
    Box& root = stack_[0];
    root.nu = patch_.degree_u;
    root.nv = patch_.degree_v;
    root.rational = patch_.rational;
    root.u0 = piece_.u0;
    root.u1 = piece_.u1;
    root.v0 = piece_.v0;
    root.v1 = piece_.v1;
    set_root(&root);
    double over = 0;  // of boxes given up, above h0
    int top = 1;
    for (; top > 0; ++boxes_) {
      Box& box = stack_[top - 1];
      ++best_->boxes;
      const Next next = look_at(box);
      if (next == Next::done) {
        --top;
        continue;
      }
      if (boxes_ >= kMaximumBoxes || top + 1 > kMaximumDepth) {
        over = std::max(over, highest_coefficient(box));
        --top;
        continue;
      }
      Box& low = stack_[top];
      if (next == Next::edges) {
        copy(box, &low);
        keep_edge(edges_along_u_, false, &low);
        keep_edge(edges_along_u_, true, &box);
      } else {
        Box& high = stack_[top + 1];
        halve_box(box, next == Next::halve_u, &low, &high);
        if (highest_coefficient(low) >= highest_coefficient(high)) {
          copy(high, &box);
        } else {
          copy(low, &box);
          copy(high, &low);
        }
      }
      ++top;
    }
    best_->upper = std::max({best_->upper, best_->h + slack_, h0_ + over});
  }

 private:
  enum class Next { done, edges, halve_u, halve_v };

  void set_root(Box* root) const {
    if (root->bicubic()) {  // four points at a time, and all in registers until the rows are stored
      LaneRows f, w;
      for (int i = 0; i < 4; ++i) {
        Lane4 p[4], q[4];
        for (int k = 0; k < 4; ++k) std::memcpy(&p[k], patch_.points[4 * i + k].data(), sizeof p[k]);
        transpose({p[0], p[1], p[2], p[3]}, q);
        f.r[i] = d_[0] * q[0] + d_[1] * q[1] + d_[2] * q[2] - h0_ * q[3];
        w.r[i] = q[3];
      }
      cut(piece_, &f);
      f.store(root->f);
      if (!root->rational) return;
      cut(piece_, &w);
      w.store(root->w);
      return;
    }
    for (int k = 0; k < root->size(); ++k) {
      const Vec4& p = patch_.points[k];
      root->f[k] = d_.dot(p.head<3>()) - h0_ * p[3];
      if (root->rational) root->w[k] = p[3];
    }
    if (piece_.whole()) return;
    cut(piece_, root->nu, root->nv, root->f);
    if (root->rational) cut(piece_, root->nu, root->nv, root->w);
  }

  static double highest_coefficient(const Box& box) {
    double most = -kFarAway;
    for (int k = 0; k < box.size(); ++k) most = std::max(most, box.f[k] / box.weight(k));
    return most;
  }

  void offer(double u, double v, double height) {
    if (!(h0_ + height > best_->h)) return;
    best_->h = h0_ + height;
    best_->where = {piece_.patch, u, v};
  }
  void offer_corner(const Box& box, bool high_u, bool high_v) {
    const int k = (high_u ? box.nu * (box.nv + 1) : 0) + (high_v ? box.nv : 0);
    offer(high_u ? box.u1 : box.u0, high_v ? box.v1 : box.v0, box.f[k] / box.weight(k));
  }

  // Coefficients of f - level w; whether any is positive.
  bool lower(const Box& box, bool bicubic, double* g) {
    const double level = level_ = best_->h - h0_ + slack_;
    if (bicubic) {
      LaneRows c(box.f);
      const LaneRows w(box.rational ? box.w : box.f);
      for (int i = 0; i < 4; ++i) c.r[i] -= box.rational ? Lane4(level * w.r[i]) : Lane4{} + level;
      c.store(g);
      return highest(larger(larger(c.r[0], c.r[1]), larger(c.r[2], c.r[3]))) > 0;
    }
    double most = -kFarAway;
    const int n = box.size();
    if (box.rational)
      for (int k = 0; k < n; ++k) g[k] = box.f[k] - level * box.w[k], most = std::max(most, g[k]);
    else
      for (int k = 0; k < n; ++k) g[k] = box.f[k] - level, most = std::max(most, g[k]);
    return most > 0;
  }

  Next look_at(Box& box) {
    double g[kMost];
    for (;;) {
      const bool bicubic = box.bicubic();
      if (!lower(box, bicubic, g)) return Next::done;
      const double before = best_->h;
      offer_corner(box, false, false);
      if (box.nu > 0) offer_corner(box, true, false);
      if (box.nv > 0) offer_corner(box, false, true);
      if (box.nu > 0 && box.nv > 0) offer_corner(box, true, true);
      if (box.nu == 0 && box.nv == 0) return Next::done;
      if (best_->h > before && !lower(box, bicubic, g)) return Next::done;
      const Bounds b = bounds_of(box, bicubic, g);
      bool one_u = box.nu > 0 && b.gu.one_way(), one_v = box.nv > 0 && b.gv.one_way();
      if (box.rational && (one_u || one_v)) stays_monotone(box, bicubic, b, &one_u, &one_v);
      if (one_u || one_v) {
        if (one_u) keep_edge(true, b.gu.high > 0, &box);
        if (one_v) keep_edge(false, b.gv.high > 0, &box);
        continue;
      }
      if (box.nu == 1 || box.nv == 1) {
        edges_along_u_ = box.nu == 1;
        return Next::edges;
      }
      const double top = best_->h;
      if (concave(box, bicubic, g, b)) return Next::done;
      if (best_->h > top) continue;
      if (box.nu == 0) return Next::halve_v;
      if (box.nv == 0) return Next::halve_u;
      const double bend_u = box.nu * (box.nu - 1) * b.guu.magnitude(),
                   bend_v = box.nv * (box.nv - 1) * b.gvv.magnitude();
      return bend_u > bend_v ? Next::halve_u : Next::halve_v;
    }
  }

  // Whether f - level w, monotone at this level, is so, the same way, at all levels that points of the box
  // may have: the differences are affine in the level. Otherwise its edge, once it has raised best, would say
  // nothing of the inside.
  static void stays_monotone(const Box& box, bool bicubic, const Bounds& b, bool* one_u, bool* one_v) {
    const double level = highest_coefficient(box);
    double g[kMost];
    for (int k = 0; k < box.size(); ++k) g[k] = box.f[k] - level * box.w[k];
    const Bounds top = bounds_of(box, bicubic, g);
    const auto same_way = [](const Range& p, const Range& q) {
      return (p.high <= 0 && q.high <= 0) || (p.low >= 0 && q.low >= 0);
    };
    *one_u = *one_u && same_way(b.gu, top.gu);
    *one_v = *one_v && same_way(b.gv, top.gv);
  }

  // Along the Hessian's own axes in the middle: where the height falls by less and less along a line that
  // crosses the parameters, as from a corner that is straight, only there the mixed term is small.
  static Bend turned_bend(const Box& box, const double* g) {
    Hessian h{};
    second_derivatives(g, box.nu, box.nv, &h);
    const int n = (box.nu + 1) * (box.nv + 1);
    double uu = 0, uv = 0, vv = 0;
    for (int k = 0; k < n; ++k) uu += h.uu[k], uv += h.uv[k], vv += h.vv[k];
    const double angle = 0.5 * std::atan2(2 * uv, uu - vv);
    Bend bend;
    bend.cosine = std::cos(angle);
    bend.sine = std::sin(angle);
    const double cc = bend.cosine * bend.cosine, ss = bend.sine * bend.sine, cs = bend.cosine * bend.sine;
    double mixed = 0;
    bend.a = bend.c = kFarAway;
    for (int k = 0; k < n; ++k) {
      bend.a = std::min(bend.a, -(cc * h.uu[k] + 2 * cs * h.uv[k] + ss * h.vv[k]));
      bend.c = std::min(bend.c, -(ss * h.uu[k] - 2 * cs * h.uv[k] + cc * h.vv[k]));
      mixed = std::max(mixed, std::abs(cs * (h.vv[k] - h.uu[k]) + (cc - ss) * h.uv[k]));
    }
    if (bend.a > 0 && bend.c > 0) bend.share = 1 - mixed / std::sqrt(bend.a * bend.c);
    return bend;
  }

  // Whether g is concave on the box and, from the gradient at its maximum there, proven not to be positive.
  // May instead raise best, which lowers g.
  bool concave(const Box& box, bool bicubic, const double* g, const Bounds& b) {
    const bool u = box.nu > 0, v = box.nv > 0;
    Bend bend;
    bend.a = u ? -box.nu * (box.nu - 1) * b.guu.high : 1;
    bend.c = v ? -box.nv * (box.nv - 1) * b.gvv.high : 1;
    if (!(bend.a > 0 && bend.c > 0)) return false;
    bend.share = 1;
    if (u && v) bend.share -= box.nu * box.nv * b.guv.magnitude() / std::sqrt(bend.a * bend.c);
    if (!(bend.share > kConcaveShare) && boxes_ > kBeforeTurning && box.nu > 1 && box.nv > 1)
      bend = turned_bend(box, g);
    if (!(bend.share > kConcaveShare)) return false;
    const double width_u = box.u1 - box.u0, width_v = box.v1 - box.v0;
    double s = 0.5, t = 0.5;
    const SurfacePoint& at = best_->where;
    if (at.patch == piece_.patch && at.u >= box.u0 && at.u <= box.u1 && at.v >= box.v0 && at.v <= box.v1) {
      if (u) s = (at.u - box.u0) / width_u;
      if (v) t = (at.v - box.v0) / width_v;
    }
    for (int k = 0;; ++k) {
      const Taylor x = bicubic ? evaluate_bicubic(g, s, t) : evaluate_net(g, box.nu, box.nv, s, t);
      // What the bounds hold back is no slope.
      const bool at_u = !u || (s <= 0 && x.fu < 0) || (s >= 1 && x.fu > 0);
      const bool at_v = !v || (t <= 0 && x.fv < 0) || (t >= 1 && x.fv > 0);
      const double gu = at_u ? 0 : x.fu, gv = at_v ? 0 : x.fv;
      const double along = bend.cosine * gu + bend.sine * gv, across = bend.cosine * gv - bend.sine * gu;
      const double rest = 0.5 * (along * along / bend.a + across * across / bend.c) / bend.share;
      if (x.f + rest <= 0) return true;
      const double weight = box.rational ? evaluate_net(box.w, box.nu, box.nv, s, t).f : 1;
      double s_next = s, t_next = t;
      const double det = x.fuu * x.fvv - x.fuv * x.fuv;
      if (at_v && !at_u) s_next = s - x.fu / x.fuu;
      if (at_u && !at_v) t_next = t - x.fv / x.fvv;
      if (!at_u && !at_v) {
        s_next = s + (-x.fvv * x.fu + x.fuv * x.fv) / det;
        t_next = t + (x.fuv * x.fu - x.fuu * x.fv) / det;
      }
      s_next = std::clamp(s_next, 0.0, 1.0);
      t_next = std::clamp(t_next, 0.0, 1.0);
      const bool still = !(s_next != s || t_next != t);
      if (rest <= kConcaveRest * slack_ * weight || still || k == kConcaveSteps) {
        offer(box.u0 + s * width_u, box.v0 + t * width_v, level_ + x.f / weight);
        return false;
      }
      s = s_next;
      t = t_next;
    }
  }

  const BezierPatch& patch_;
  const PatchPiece& piece_;
  const Vec3& d_;
  const double slack_, h0_;
  Highest* best_;
  double level_ = 0;  // of the coefficients last taken
  bool edges_along_u_ = false;
  int boxes_ = 0;                 // looked at
  Box stack_[kMaximumDepth + 2];  // left uninitialised
};

// A bilinear patch lies in the hull of its corners, whatever its weights.
void raise_to_corner(const BezierPatch& patch, int index, const Vec3& d, double slack, Highest* best) {
  ++best->boxes;
  for (int k = 0; k < 4; ++k) {
    const Vec4& p = patch.points[k];
    const double h = d.dot(p.head<3>()) / p[3];
    if (!(h > best->h)) continue;
    best->h = h;
    best->where = {index, k > 1 ? 1.0 : 0.0, k % 2 == 1 ? 1.0 : 0.0};
  }
  best->upper = std::max(best->upper, best->h + slack);
}

}  // namespace

void raise(const BezierPatch& patch, const PatchPiece& piece, const Vec3& d, double slack, Highest* best) {
  if (patch.degree_u == 1 && patch.degree_v == 1) return raise_to_corner(patch, piece.patch, d, slack, best);
  Search(patch, piece, d, slack, best).run();
}

}  // namespace nurbs

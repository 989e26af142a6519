// Cells of a patch and what holds all over them; the formulas are derived in enclosure.h.
#include "body/enclosure.h"

#include <array>
#include <limits>

#include "body/affine_form.h"
#include "body/cell_forms.h"
#include "body/cell_frame.h"
#include "body/cell_net.h"
#include "nurbs/tolerances.h"

namespace nurbs {

using namespace cells;

void halve(const Cell& cell, bool in_u, Cell* first, Cell* second) {
  *first = *second = cell;
  if (in_u) {
    first->du = second->du = 0.5 * cell.du;
    second->u0 += 0.5 * cell.du;
  } else {
    first->dv = second->dv = 0.5 * cell.dv;
    second->v0 += 0.5 * cell.dv;
  }
}

std::vector<Vec4> net_of(const BezierPatch& patch, const Cell& cell) {
  Net<double> net;
  net.m = patch.degree_u;
  net.n = patch.degree_v;
  for (size_t i = 0; i < patch.points.size(); ++i)
    for (int k = 0; k < 4; ++k) net.c[i].at[k] = patch.points[i][k];
  const double u1 = cell.u0 + cell.du, v1 = cell.v0 + cell.dv;
  restrict_net<double>({u1, cell.u0 / u1, v1, cell.v0 / v1}, {0, 4}, &net);
  std::vector<Vec4> points;
  for (size_t i = 0; i < patch.points.size(); ++i) points.emplace_back(net.c[i].at);
  return points;
}

namespace {

constexpr double kTiny = std::numeric_limits<double>::min();

// What cells must have in common to be enclosed side by side.
struct Kind {
  int rows, columns;  // degrees, away from the pole and round it
  bool polar, touches, rational, rate, stretch;
  bool operator==(const Kind& o) const {
    return rows == o.rows && columns == o.columns && polar == o.polar && touches == o.touches &&
           rational == o.rational && rate == o.rate && stretch == o.stretch;
  }
};

// A cell in its frame.
struct Framed {
  const BezierPatch* patch;
  const Cell* cell;
  CellBounds* out;
  Kind kind;
  bool turned;
  double start, length;  // from the pole, in parameters
  Vec3 middle;
  Frame frame;
};

// False where there is no frame, and nothing is proven.
bool prepare(const BezierPatch& patch, const Cell& cell, Wanted wanted, bool upright, CellBounds* out,
             Framed* f) {
  *out = {};
  out->max_radius = out->rate = kInfinity;
  out->least_curvature = -kInfinity;
  out->doubt = kInfinity;
  out->split_u = cell.du >= cell.dv;
  f->patch = &patch;
  f->cell = &cell;
  f->out = out;
  const bool polar = cell.pole >= 0;
  f->turned = cell.pole >= 2;
  f->start = polar ? from_pole(cell) : 0;
  f->length = f->turned ? cell.dv : cell.du;
  const bool touches = polar && f->start == 0;
  f->kind = {f->turned ? patch.degree_v : patch.degree_u,
             f->turned ? patch.degree_u : patch.degree_v,
             polar,
             touches,
             patch.rational,
             wanted.rate && !touches,
             wanted.stretch};
  f->middle = evaluate0(patch, cell.u0 + 0.5 * cell.du, cell.v0 + 0.5 * cell.dv);
  if (!make_frame(patch, cell, f->middle, upright, &f->frame)) return false;
  out->seen_min = f->frame.min_radius;
  out->seen_max = f->frame.max_radius;
  out->seen_curvature = f->frame.least_curvature;
  return true;
}

template <class Real>
void take_middle(const Framed& f, int lane, Middle<Real>* to) {
  const Cell& c = *f.cell;
  const Jet3 j = evaluate3(*f.patch, c.u0 + 0.5 * c.du, c.v0 + 0.5 * c.dv);
  put(j.su, lane, &to->u);
  put(j.sv, lane, &to->v);
  put(j.suu, lane, &to->uu);
  put(j.suv, lane, &to->uv);
  put(j.svv, lane, &to->vv);
  put(j.suuu, lane, &to->uuu);
  put(j.suuv, lane, &to->uuv);
  put(j.suvv, lane, &to->uvv);
  put(j.svvv, lane, &to->vvv);
}

// Up to kLanes<Real> cells of one kind. Numbers of a cell of which something on the way is not proven mean
// nothing: `fill` takes none of them.
template <class Real>
class Enclosing {
 public:
  Enclosing(const Framed* const* cells, int count) : cells_(cells), count_(count), kind_(cells[0]->kind) {}

  void run() {
    take();
    differentiate();
    turn_to_middle();
    bound_normals();
    bound_curvature();
    if (any(proven_)) bound_radii();
    for (int l = 0; l < count_; ++l) fill(l);
  }

 private:
  static bool any(const Mask<Real>& mask) { return !none_of(mask); }
  static bool is(const Mask<Real>& mask, int lane) {
    if constexpr (kLanes<Real> == 1)
      return mask;
    else
      return mask[lane] != 0;
  }

  void take() {
    for (int l = 0; l < kLanes<Real>; ++l) {
      const Framed& f = *cells_[std::min(l, count_ - 1)];
      put(f.frame.back, l, &frame_back_);
      put(f.frame.to, l, &frame_to_);
      put(f.frame.det, l, &frame_det_);
      put(f.middle, l, &middle_);
      put(f.start, l, &start_);
      put(f.length, l, &length_);
      const Section rows = rows_of(*f.cell), columns = columns_of(*f.cell);
      put(rows.high, l, &sections_.high_u);
      put(rows.low / rows.high, l, &sections_.low_u);
      put(columns.high, l, &sections_.high_v);
      put(columns.low / columns.high, l, &sections_.low_v);
    }
    take_patches();
    take_nets();
  }

  // Whole nets, turned as the pole wants it.
  void take_patches() {
    net_.m = kind_.rows;
    net_.n = kind_.columns;
    bool one = true;
    for (int l = 1; l < count_; ++l)
      one &= cells_[l]->patch == cells_[0]->patch && cells_[l]->cell->pole == cells_[0]->cell->pole;
    for (int i = 0; i <= net_.m; ++i)
      for (int j = 0; j <= net_.n; ++j) {
        Point<Real>& to = net_.at(i, j);
        for (int l = 0; l < (one ? 1 : kLanes<Real>); ++l) {
          const Framed& f = *cells_[std::min(l, count_ - 1)];
          const Vec4& c = turned_point(*f.patch, f.cell->pole, i, j);
          for (int k = 0; k < 4; ++k)
            if (one)
              to.at[k] = all<Real>(c[k]);
            else
              put(c[k], l, &to.at[k]);
        }
      }
  }

  // The cells' nets in their frames' coordinates; of z, one degree less, where there is a pole. With the
  // round-off of the coefficients.
  void take_nets() {
    const Coordinates which{0, kind_.rational ? 4 : 3};
    if (kind_.polar) take_quotient();
    restrict_net(sections_, which, &net_);
    Real largest{}, heaviest = all<Real>(1);
    const int count = (net_.m + 1) * (net_.n + 1);
    for (int i = 0; i < count; ++i) {
      const Point<Real>& c = net_.c[i];
      for (int k = 0; k < 3; ++k) largest = larger(magnitude(c.at[k]), largest);
      if (kind_.rational) heaviest = i == 0 ? c.at[3] : larger(c.at[3], heaviest);
    }
    if (kind_.polar) {
      weight_ = net_;
      net_ = quotient_;
      restrict_net(sections_, {0, 3}, &net_);
      for (int i = 0; i < (net_.m + 1) * (net_.n + 1); ++i)
        turn_to_frame(Triple<Real>{Real{}, Real{}, Real{}}, &net_.c[i]);
    } else {
      for (int i = 0; i < count; ++i) {
        const Real w = kind_.rational ? net_.c[i].at[3] : all<Real>(1);
        turn_to_frame(w * middle_, &net_.c[i]);
      }
    }
    const Real farthest = larger(magnitude(middle_.x), larger(magnitude(middle_.y), magnitude(middle_.z)));
    const Real size = (kNetRoundoff * (kind_.polar ? kind_.rows : 1)) * (largest + heaviest * farthest);
    for (int k = 0; k < 3; ++k) {
      const Triple<Real>& row = frame_to_.row[k];
      noise_.at[k] = size * (magnitude(row.x) + magnitude(row.y) + magnitude(row.z));
    }
    noise_.at[3] = kNetRoundoff * heaviest;
  }

  void turn_to_frame(const Triple<Real>& origin, Point<Real>* c) const {
    const Triple<Real> y =
        frame_to_ * Triple<Real>{c->at[0] - origin.x, c->at[1] - origin.y, c->at[2] - origin.z};
    c->at[0] = y.x;
    c->at[1] = y.y;
    c->at[2] = y.z;
  }

  // z w, of the whole patch.
  void take_quotient() {
    quotient_.m = net_.m - 1;
    quotient_.n = net_.n;
    const Point<Real>& corner = net_.at(0, 0);
    for (int i = 1; i <= net_.m; ++i)
      for (int j = 0; j <= net_.n; ++j)
        for (int k = 0; k < 3; ++k)
          quotient_.at(i - 1, j).at[k] =
              (static_cast<double>(net_.m) / i) *
              (net_.at(i, j).at[k] - net_.at(i, j).at[3] * (corner.at[k] / corner.at[3]));
  }

  // Position and derivatives; the basis of the tangent plane, the normal N and the form D in that basis,
  // frame's coordinates.
  void differentiate() {
    const bool third = kind_.rate || kind_.polar;
    Hulls<Real> hulls;
    hulls_of(net_, {0, kind_.rational && !kind_.polar ? 4 : 3}, noise_, third, &hulls);
    if (kind_.polar && kind_.rational) hulls_of(weight_, {3, 4}, noise_, third, &hulls);
    const Real lightest = kind_.rational ? hulls[k0].w.low() : all<Real>(1);
    weighted_ = lightest > 0.0;
    divide(hulls, kind_.rational, third, &y_);
    tangent_u_ = y_[kU];
    tangent_v_ = y_[kV];
    uu_ = y_[kUU];
    uv_ = y_[kUV];
    vv_ = y_[kVV];
    if (kind_.polar) return differentiate_at_pole();
    normal_ = cross(tangent_u_, tangent_v_);
    form_ = {-1.0 * dot(normal_, uu_), -1.0 * dot(normal_, uv_), -1.0 * dot(normal_, vv_)};
  }

  void differentiate_at_pole() {
    u_ = {start_ + 0.5 * length_, 0.5 * length_, Real{}, Real{}};
    tangent_u_ = scaled(length_, y_[k0]) + u_ * y_[kU];
    normal_ = cross(tangent_u_, tangent_v_);
    uu_ = scaled<Real>(2.0 * length_, y_[kU]) + u_ * y_[kUU];
    form_.a = -1.0 * dot(normal_, uu_);
    form_.b = -1.0 * dot(normal_, y_[kUV]);
    if (kind_.touches) {
      const AffineVector<Real> normal_u = cross(uu_, y_[kV]) + cross(tangent_u_, y_[kUV]);
      form_.c = scaled<Real>(-1.0 / length_, dot(normal_u, y_[kVV]) + dot(normal_, y_[kUVV]));
    } else {
      over_u_ = inverse(u_);
      form_.c = -1.0 * (over_u_ * dot(normal_, y_[kVV]));
      uv_ = y_[kUV] + scaled(length_, over_u_ * y_[kV]);
      vv_ = over_u_ * y_[kVV];
    }
  }

  // Axes t1, t2, n of the cell's middle.
  void turn_to_middle() {
    const Triple<Real> n = normal_.center();
    const auto transposed = [](const Turn<Real>& m, const Triple<Real>& v) {
      return v.x * m.row[0] + v.y * m.row[1] + v.z * m.row[2];
    };
    axes_[2] = unit(transposed(frame_to_, n));
    axes_[0] = square_to(axes_[2]);
    axes_[1] = cross(axes_[2], axes_[0]);
    upright_ = weighted_ & (dot(axes_[2], axes_[2]) > 0.25);  // not if it is NaN
    Turn<Real> back, over;
    for (int k = 0; k < 3; ++k) {
      back.row[k] = transposed(frame_back_, axes_[k]);
      over.row[k] = frame_to_ * axes_[k];
    }
    back_ = back;
    m_ = over * normal_;
    det_ = form_.det();
  }

  void bound_normals() {
    const AffineVector<Real>&u = tangent_u_, &v = tangent_v_;
    const Real size = length_of(m_.center());
    const auto vary = [&](Real Affine<Real>::*part) -> Real {
      return magnitude(u.x.*part) + magnitude(u.y.*part) + magnitude(v.x.*part) + magnitude(v.y.*part) +
             (magnitude(m_.x.*part) + magnitude(m_.y.*part)) / size;
    };
    along_u_ = vary(&Affine<Real>::a) >= vary(&Affine<Real>::b);
    doubt_ = u.x.spread() + u.y.spread() + v.x.spread() + v.y.spread() +
             (m_.x.spread() + m_.y.spread() + m_.z.spread()) / size;
    regular_ = upright_ & (m_.z.low() > 0.0);
    slope_ = norm2(m_.x.most(), m_.y.most()) / m_.z.low();
    const Affine<Real> m2 = square(m_.x) + square(m_.y) + square(m_.z);
    long_ = regular_ & (m2.low() > 0.0);
    normal_length_ = root(m2);
  }

  void bound_curvature() {
    ju_ = back_ * tangent_u_;
    jv_ = back_ * tangent_v_;
    const auto size = [](const AffineVector<Real>& v) {
      return root((square(v.x) + square(v.y) + square(v.z)).high());
    };
    const Real area = frame_det_ * normal_length_.low();
    speed_u_ = area / size(jv_);
    speed_v_ = area / size(ju_);
    if (kind_.polar) speed_v_ = start_ * speed_v_;  // |x_v| = u |z_v|, |N| = u |N'|
    // Curvatures, which vary little along a nearly flat direction, where the radii vary much.
    curvature_ = any_curvature<Real>(ju_, jv_, form_, {normal_length_.low(), normal_length_.high()});
    proven_ = long_ & (det_.low() > 0.0) & (form_.a.low() > 0.0);
    const Mask<Real> positive = long_ & (curvature_.low > 0.0);
    if (kind_.rate && (any(proven_) || any(positive))) {
      Middle<Real> middle;
      for (int l = 0; l < kLanes<Real>; ++l) take_middle(*cells_[std::min(l, count_ - 1)], l, &middle);
      seen_rate_ = rate_at(middle);
    }
  }

  // Tangent vectors T_k that lie over t_k, and what parameters change by when the normal turns along them:
  // p_k = |N| D^-1 J' T_k; then W(T_k, T_l) = p_k . J' T_l.
  void bound_radii() {
    const Affine<Real> over_z = inverse(m_.z);
    inclined_[0] = m_.x * over_z;
    inclined_[1] = m_.y * over_z;
    const Affine<Real> factor = normal_length_ * inverse(det_);
    Affine<Real> jt[2][2];  // of T_k: along u, along v
    for (int k = 0; k < 2; ++k) {
      jt[k][0] = (k == 0 ? ju_.x : ju_.y) - inclined_[k] * ju_.z;
      jt[k][1] = (k == 0 ? jv_.x : jv_.y) - inclined_[k] * jv_.z;
      dp_[k][0] = factor * (form_.c * jt[k][0] - form_.b * jt[k][1]);
      dp_[k][1] = factor * (form_.a * jt[k][1] - form_.b * jt[k][0]);
    }
    const FormMatrix<Real> w{dp_[0][0] * jt[0][0] + dp_[0][1] * jt[0][1],
                             dp_[0][0] * jt[1][0] + dp_[0][1] * jt[1][1],
                             dp_[1][0] * jt[1][0] + dp_[1][1] * jt[1][1]};
    // A unit tangent is q1 T1 + q2 T2 with cos(cone) <= |q| <= 1.
    const Range<Real> radii = eigenvalues(w);
    const Real upright2 = 1.0 / (1.0 + slope_ * slope_);
    const Real shortest2 = normal_length_.low() * normal_length_.low();
    const Real product = shortest2 * shortest2 / det_.high() * frame_det_ * frame_det_;
    radii_ = {larger<Real>(product / radii.high, radii.low * upright2), radii.high};
    if (kind_.stretch) stretches_ = stretch_of(jt, form_, factor, w, axes_);
    if (kind_.rate) bound_rate();
  }

  // The third-order form C(t, t, t) = 3 t . x_ij p_i p_j + n . x_ijk p_i p_j p_k.
  void bound_rate() {
    using Form = Affine<Real>;
    const AffineVector<Real> at_uu = back_ * uu_, at_uv = back_ * uv_, at_vv = back_ * vv_;
    AffineVector<Real> uuu = y_[kUUU], uuv = y_[kUUV], uvv = y_[kUVV], vvv = y_[kVVV];  // x_ijk in the basis
    if (kind_.polar) {
      uuu = scaled<Real>(3.0 * length_, y_[kUU]) + u_ * y_[kUUU];
      uuv = y_[kUUV] + scaled<Real>(2.0 * length_, over_u_ * y_[kUV]);
      uvv = over_u_ * (y_[kUVV] + scaled(length_, over_u_ * y_[kVV]));
      vvv = over_u_ * (over_u_ * y_[kVVV]);
    }
    const Form shorter = inverse(normal_length_);
    const Form t0 = shorter * dot(normal_, uuu), t1 = shorter * dot(normal_, uuv),
               t2 = shorter * dot(normal_, uvv), t3 = shorter * dot(normal_, vvv);
    // Of the pairs (0, 0), (0, 1), (1, 1) of tangents.
    Form along[3][2], over_du[3], over_dv[3];
    for (int pair = 0; pair < 3; ++pair) {
      const Form(&a)[2] = dp_[pair / 2], (&b)[2] = dp_[(pair + 1) / 2];
      const Form u2 = a[0] * b[0], mixed = a[0] * b[1] + a[1] * b[0], v2 = a[1] * b[1];
      const AffineVector<Real> x = u2 * at_uu + mixed * at_uv + v2 * at_vv;
      along[pair][0] = x.x - inclined_[0] * x.z;
      along[pair][1] = x.y - inclined_[1] * x.z;
      over_du[pair] = u2 * t0 + mixed * t1 + v2 * t2;
      over_dv[pair] = u2 * t1 + mixed * t2 + v2 * t3;
    }
    const auto bend = [&](int pair, int k) { return dp_[k][0] * over_du[pair] + dp_[k][1] * over_dv[pair]; };
    const Form c[4] = {3.0 * along[0][0] + bend(0, 0), 2.0 * along[1][0] + along[0][1] + bend(0, 1),
                       2.0 * along[1][1] + along[2][0] + bend(1, 1), 3.0 * along[2][1] + bend(2, 1)};
    const double exact = 1 / std::cos(1.5 * M_PI / kCubicAngles);
    rate_ = exact * (largest_cubic(c[0].c, c[1].c, c[2].c, c[3].c) +
                     largest_cubic(c[0].a, c[1].a, c[2].a, c[3].a) +
                     largest_cubic(c[0].b, c[1].b, c[2].b, c[3].b)) +
            root(Real(c[0].r * c[0].r + 3.0 * c[1].r * c[1].r + 3.0 * c[2].r * c[2].r + c[3].r * c[3].r));
  }

  void fill(int l) const {
    const Framed& f = *cells_[l];
    CellBounds& out = *f.out;
    if (!is(upright_, l)) return;
    out.split_u = is(along_u_, l) != f.turned;
    out.doubt = get(doubt_, l);
    if (!is(regular_, l)) return;
    out.regular = true;
    out.axis = {get(axes_[2].x, l), get(axes_[2].y, l), get(axes_[2].z, l)};
    out.cone = std::atan(get(slope_, l));
    if (!is(long_, l)) return;
    out.speed_u = get(f.turned ? speed_v_ : speed_u_, l) / f.cell->du;
    out.speed_v = get(f.turned ? speed_u_ : speed_v_, l) / f.cell->dv;
    const double least = get(curvature_.low, l), most = get(curvature_.high, l);
    if (!std::isnan(least)) {
      out.least_curvature = least;
      out.min_radius = 1 / most;
    }
    out.convex = out.least_curvature > 0;
    if (out.convex) out.max_radius = 1 / out.least_curvature;
    const bool proven = is(proven_, l);
    if (kind_.rate && (out.convex || proven)) out.seen_rate = get(seen_rate_, l);
    if (!proven) return;
    out.convex = true;
    out.least_curvature = std::max(0.0, out.least_curvature);
    out.max_radius = std::min(out.max_radius, get(radii_.high, l));
    out.min_radius = std::max(out.min_radius, get(radii_.low, l));
    if (kind_.stretch && is(stretches_.found, l)) {
      const Triple<Real>& along = stretches_.along;
      out.stretch = {{get(along.x, l), get(along.y, l), get(along.z, l)},
                     get(stretches_.most, l),
                     get(stretches_.least, l)};
    }
    if (kind_.rate) out.rate = get(rate_, l);
  }

  const Framed* const* cells_;
  const int count_;
  const Kind kind_;
  Triple<Real> middle_;
  Sections<Real> sections_;
  Net<Real> net_, weight_, quotient_;
  Point<Real> noise_;
  Turn<Real> frame_back_, frame_to_, back_;
  Real frame_det_, start_, length_;
  Derivatives<Real> y_;
  AffineVector<Real> tangent_u_, tangent_v_, normal_, uu_, uv_, vv_;  // x_ij in the basis of the tangents
  FormMatrix<Real> form_;
  Affine<Real> u_, over_u_;                  // distance from the pole
  Mask<Real> weighted_, upright_, regular_;  // what is proven so far: weights, axes, normals, ...
  Mask<Real> long_, proven_;                 // ... their length, the sign of D
  Triple<Real> axes_[3];
  AffineVector<Real> m_;  // N over det, in those axes
  Affine<Real> det_, normal_length_;
  AffineVector<Real> ju_, jv_;
  Mask<Real> along_u_;
  Real doubt_, slope_, speed_u_, speed_v_, seen_rate_, rate_;
  Range<Real> curvature_, radii_;
  Affine<Real> inclined_[2], dp_[2][2];
  Stretches<Real> stretches_;
};

constexpr int kAtOnce = 64;  // cells prepared

void enclose_some(Enclosed* const* cells, CellBounds* const* out, int count, bool upright) {
  Framed framed[kAtOnce];
  const Framed* left[kAtOnce];
  int open = 0;
  for (int k = 0; k < count; ++k)
    if (prepare(*cells[k]->patch, *cells[k]->cell, cells[k]->wanted, upright, out[k], &framed[k]))
      left[open++] = &framed[k];
  while (open > 0) {
    const Framed* same[kWidth];
    int many = 0, others = 0;
    const Kind kind = left[0]->kind;
    for (int k = 0; k < open; ++k) {
      const bool taken = many < kWidth && left[k]->kind == kind;
      (taken ? same[many++] : left[others++]) = left[k];
    }
    open = others;
    if (many > 1)
      Enclosing<Wide>(same, many).run();
    else
      Enclosing<double>(same, 1).run();
  }
}

}  // namespace

void enclose(Enclosed* cells, int count) {
  for (int first = 0; first < count; first += kAtOnce) {
    Enclosed* some[kAtOnce];
    CellBounds* out[kAtOnce];
    const int many = std::min(count - first, kAtOnce);
    for (int k = 0; k < many; ++k) {
      some[k] = &cells[first + k];
      out[k] = &some[k]->bounds;
    }
    enclose_some(some, out, many, false);
    // At a flat pole the affine normal leans anywhere; what is proven in either frame is proven.
    CellBounds upright[kAtOnce], *again[kAtOnce];
    int doubtful = 0;
    for (int k = 0; k < many; ++k) {
      const Cell& cell = *some[k]->cell;
      if (out[k]->convex || cell.pole < 0 || from_pole(cell) > 0) continue;
      again[doubtful] = &upright[doubtful];
      some[doubtful++] = some[k];
    }
    if (doubtful == 0) continue;
    enclose_some(some, again, doubtful, true);
    for (int k = 0; k < doubtful; ++k) {
      CellBounds& bounds = some[k]->bounds;
      const CellBounds& other = upright[k];
      if (other.convex || (other.regular && other.min_radius > bounds.min_radius)) bounds = other;
    }
  }
}

CellBounds enclose(const BezierPatch& patch, const Cell& cell, Wanted wanted) {
  Enclosed one{&patch, &cell, wanted, {}};
  enclose(&one, 1);
  return one.bounds;
}

}  // namespace nurbs

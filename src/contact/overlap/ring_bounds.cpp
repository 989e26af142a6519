// What circles say of a sector; derived in ring_search.h and below.
#include "contact/overlap/closing.h"
#include "contact/overlap/ring_sectors.h"

namespace nurbs {
namespace {

constexpr int kCirclesBeside = 3;       // circles looked at on either side of a range of angles
constexpr double kNearAzimuth = 0.3;    // rad, of a circle's asked azimuth
constexpr double kWidestSecond = 0.88;  // cosine of that
constexpr double kOffRipple = 3;        // times the most it is off by, a circle is known all round
constexpr double kNextFar = 1e-3;       // sine between the angles of rippled circles that are not
constexpr double kSteepSine = 0.02;     // up to which lengths are taken off radii instead

double square(double x) {
  return x * x;
}

// Least curvature radius along `v` of a body about the direction e (both in its axes), of lengths 1: for
// directions within `reach` of e in their plane, or, `any`, of any tangent and all directions within reach.
// 0 where nothing is known.
double least_bend(const Shape& shape, const Vec3& e, const Vec3& v, double reach, bool any) {
  const InnerMap& map = shape.lazy_inner_map.known();
  if (map.stretches.empty()) return 0;
  const int cell = InnerMap::cell(e);
  const double off = (e - InnerMap::middle(cell)).norm();
  for (int k = 0; k < static_cast<int>(kStretchCaps.size()); ++k) {
    if (!(kChord * (off + reach) <= kStretchCaps[k])) continue;
    const InnerStretch& s = map.stretches[cell];
    const Vec3 f(s.along[0], s.along[1], s.along[2]);
    const double along =
        any ? 0 : std::max(0.0, (1 - reach * reach) * std::abs(f.dot(v)) - kChord * reach * off);
    return s.least[k] + s.most[k] * along * along;
  }
  return 0;
}

// The same along the meridian of a body of revolution, `axis` its own, or of a ball, any axis.
double meridian_bend(const Shape& shape, const Vec3& e, const Vec3& axis, double reach) {
  const double cosine = e.dot(axis), sine = e.cross(axis).norm();
  const double radius = shape.proofs.sphere ? 0 : shape.profile_radii.within(cosine, sine, kChord * reach);
  if (!(sine > kNoDirection)) return radius;
  return std::max(radius, least_bend(shape, e, (axis - cosine * e) / sine, reach, false));
}

}  // namespace

double RingSectors::turn_to(const Sector& sector, const Wave& w) {
  const double turn = sector.phi - w.phi;
  return turn - 2 * M_PI * std::nearbyint(turn * (0.5 / M_PI));
}

void RingSectors::choose(const Sector& sector, double half) {
  const auto before = [&](short c, const Angle& a) { return cross(flat_[c].at, a) > 0; };
  const short *const begin = order_, *const end = order_ + count_;
  const auto first = static_cast<int>(std::lower_bound(begin, end, sector.low, before) - begin),
             last = static_cast<int>(std::lower_bound(begin, end, sector.high, before) - begin);
  const double reach = std::max(kNearAzimuth, 2 * half);
  const Angle& u = sector.u;
  const bool wide = 2 * half > M_PI_2;
  const Angle once = half > 0 ? sector.turn : Angle{1, 0}, twice{1 - 2 * square(once.s), 2 * once.s * once.c};
  const auto near = [&](const FlatCircle& c) {
    if (view_.rippled())
      return wide || c.u.c * u.c + c.u.s * u.s >= twice.c * c.wave.near.c - twice.s * c.wave.near.s;
    return (view_.circles && !c.lone) || reach > 1 || c.at.s == 0 ||
           2 - 2 * (c.u.c * u.c + c.u.s * u.s) <= square(reach);
  };
  chosen_ = 0;
  for (int i = first - 1, beside = 0; i >= 0 && beside < kCirclesBeside; --i) {
    const bool counts = near(flat_[order_[i]]);
    if (counts || first - i <= kCirclesBeside) which_[chosen_++] = order_[i];
    beside += counts;
  }
  const FlatCircle* before_it = nullptr;  // of those far off one an angle tells as much as all
  for (int i = first; i < last; ++i) {
    const FlatCircle& c = flat_[order_[i]];
    if (view_.rippled() && before_it && !(cross(before_it->at, c.at) > kNextFar) && !near(c)) continue;
    which_[chosen_++] = order_[i];
    before_it = &c;
  }
  for (int i = last, beside = 0; i < count_ && beside < kCirclesBeside; ++i) {
    const bool counts = near(flat_[order_[i]]);
    if (counts || i - last < kCirclesBeside) which_[chosen_++] = order_[i];
    beside += counts;
  }
}

RingSectors::Reach RingSectors::reach_of(const Sector& sector) const {
  const double sine = std::min(sector.low.s, sector.high.s),
               cosine = std::max(std::abs(sector.low.c), std::abs(sector.high.c));
  return {sine, cosine, sine * view_.axis.dot(view_.mate_axis) - view_.tilt};
}

// What M's circles of radius r lose at most when the azimuth turns by `half`: with y = e.b, |dy / dphi| <=
// tilt, |d |e x b| / dphi| is at most 2 tilt, and |y| tilt / |e x b|.
double RingSectors::turned(const Reach& reach, double half, double r) const {
  double rate = 2 * view_.tilt;
  if (reach.across > 0.5 * reach.sine)
    rate = std::min(rate, (reach.cosine + view_.tilt) * view_.tilt / reach.across);
  return rate * half * r;
}

Vec3 RingSectors::mate_axis_from(const Angle& u) const {
  const double x = tangent_.dot(view_.mate_axis), y = second_.dot(view_.mate_axis);
  return {x * u.c + y * u.s, y * u.c - x * u.s, view_.axis.dot(view_.mate_axis)};
}

RingSectors::Facing RingSectors::facing(const Angle& at, const Vec3& b) {
  const Vec3 cross = Vec3(at.s, 0, at.c).cross(b);
  const double sine = cross.norm();
  return {sine, b.cross(cross) / sine};
}

RingSectors::Drift RingSectors::drift(const Wave& w, const Angle& at, const Sector& sector, double half,
                                      const Reach& over) const {
  if (!view_.rippled()) return {};
  Drift d{false, turn_to(sector, w), kOffRipple * w.ripple.most};
  double furthest = std::abs(d.turn) + half, tilted = 0;
  if (w.before < 0 || !(0.5 * w.ripple.bend * square(furthest) < d.lost)) return d;
  if (view_.near_m && view_.tilt > 0) {
    if (!(over.across > 0)) return d;
    double chord = 0;
    for (const Angle& a : {sector.low, sector.high})
      chord = std::max(chord, square(a.c - at.c) + square(a.s - at.s));
    tilted = view_.tilt / over.across * (furthest + M_PI_2 * std::sqrt(chord));
    furthest += tilted;
  }
  const double beyond = std::max({0.0, half + tilted - d.turn - w.before, d.turn + half + tilted - w.after});
  double lost = 0.5 * w.ripple.bend * square(furthest) + w.steep * tilted;
  if (beyond > 0) lost += (w.ripple.slope + w.steep) * beyond + view_.seam;
  if (!(lost < d.lost)) return d;
  d.followed = true;
  d.lost = lost;
  return d;
}

void RingSectors::follow(const Wave& w, double turn, Circle* c) const {
  c->r += turn * w.k_r;
  c->z += turn * w.k_z;
  c->rm += turn * w.m_r;
  c->k += turn * w.m_z * view_.mate_axis;
  c->middle += turn * w.m_z * view_.mate_axis;
}

RingSectors::Circle RingSectors::known(const Circle& c, double phi, double half) const {
  if (!c.lone && reaches(phi, half)) return c;
  Circle alone = c;
  alone.lone = true;
  alone.r = alone.z = 0;
  alone.k -= c.on_k;
  return alone;
}

void RingSectors::project(const Sector& sector, double half) {
  const Angle &u = sector.u, turn = half > 0 ? sector.turn : Angle{1, 0};
  const Reach over = reach_of(sector);
  const double lost = over.sine > view_.tilt ? turned(over, half, 1) / over.sine : 0;
  const bool reaches = this->reaches(sector.phi, half);
  const Vec3 b = mate_axis_from(u);
  hull_.clear();
  lost_ = 0;
  if (view_.rippled()) followed_ += chosen_;
  for (int i = 0; i < chosen_; ++i) {
    const FlatCircle& c = flat_[which_[i]];
    const Flat& k = reaches && !c.lone ? c.whole : c.alone;
    const double along = k.x * u.c + k.y * u.s, across = k.y * u.c - k.x * u.s;
    // The most of it over the interval.
    const bool inside = half >= M_PI || along >= turn.c * k.length;
    const double reach = half > 0 ? (inside ? k.length : along * turn.c + std::abs(across) * turn.s) : along;
    const Drift drift = this->drift(c.wave, c.at, sector, half, over);
    double r = k.r - reach, z = k.z, rm = c.rm;
    if (drift.followed) {
      r += drift.turn * (c.wave.k_r - c.wave.m_z * b[0]);
      z += drift.turn * (c.wave.k_z - c.wave.m_z * b[2]);
      rm += drift.turn * c.wave.m_r;
    }
    double most = drift.lost + (drift.followed ? half * c.wave.steep : 0);
    if (rm < 0) most -= rm;  // beyond the axis
    if (rm > 0) {
      const Facing m = facing(c.at, b);
      if (m.sine > kNoDirection) {  // else the tangent plane 0
        r += rm * (m.point[0] - lost);
        z += rm * m.point[2];
      }
    }
    if (most > 0) {
      if (over.sine > kSteepSine)
        r -= most / over.sine;
      else
        lost_ = std::max(lost_, most);
    }
    hull_.add(r, z);
  }
}

RingSectors::Least RingSectors::bound(const Sector& sector, double half, double threshold) {
  choose(sector, half);
  project(sector, half);
  const Reach over = reach_of(sector);
  double turned = 0;
  if (!(over.sine > view_.tilt)) {  // else circle by circle
    double widest = 0;
    for (int i = 0; i < chosen_; ++i) widest = std::max(widest, circle_[which_[i]].rm);
    turned = this->turned(over, half, widest);
  }
  turned += lost_;
  Least least =
      hull_.least(sector.low, sector.high, threshold + turned + noise_, 4 * kRoundoff * pair_.reach);
  least.value -= turned + noise_;
  compared_ += static_cast<long>(least.corners) * chosen_;
  return least;
}

// The same of a rippled one that two lines are known of, less `off`, if that leaves enough of the
// tolerance.
double RingSectors::rippled_bend(const Shape& shape, double scale, const Vec3& e, double reach,
                                 const Meridian::Place& one, const Meridian::Place& two, double* off) const {
  const ProfileBall ball =
      ball_within(shape.near_revolution, e, kChord * reach, one, two, shape.bounding_radius);
  if (!(scale * ball.off <= kRippleShare * tolerance_)) return 0;
  *off += scale * ball.off;
  return ball.radius;
}

// Balls that touch two circles from inside, wherever they and the sector's directions lie on the meridians:
// their centres take the circles' place. Returns the sum of the balls' radii, K's and M's.
// `off`: what that is less by.
double RingSectors::round_off(const Sector& sector, const Angle& at, const Vec3& u, const Reach& over,
                              Circle* one, Circle* two, double* off) const {
  // By how much angles from an axis differ, as chords.
  const auto apart = [](const Vec3& axis, const Vec3& x, const Vec3& y) {
    const double s = x.cross(axis).norm() - y.cross(axis).norm(), c = axis.dot(x - y);
    return std::sqrt(s * s + c * c);
  };
  const Vec3 e = at.s * u + at.c * view_.axis;
  double range = 0, asked = 0;
  for (const Angle* a : {&sector.low, &sector.high})
    range = std::max(range, std::sqrt(square(a->c - at.c) + square(a->s - at.s)));
  for (const Circle* c : {one, two}) asked = std::max(asked, apart(view_.axis, c->nk, e));
  const Mat3 to_k = view_.turn_k.transpose(), to_m = view_.turn_m.transpose();
  double of_k = 0;
  const double reach_k = std::max(range, asked);
  if (view_.near_k)
    of_k = view_.scale_k *
           rippled_bend(*view_.k, view_.scale_k, to_k * e, reach_k, one->place_k, two->place_k, off);
  else if (!view_.arcs)
    of_k = view_.scale_k * meridian_bend(*view_.k, to_k * e, view_.k->revolution.axis, reach_k);
  of_k = std::max(0.0, of_k - view_.ball_k);
  for (Circle* c : {one, two}) {
    c->r -= of_k * view_.across(c->nk).norm();
    c->z -= of_k * c->nk.dot(view_.axis);
  }
  double of_m;
  asked = 0;
  if (view_.circles) {
    const Vec3& axis = view_.mate_axis;
    for (const Circle* c : {one, two}) asked = std::max(asked, apart(axis, c->nm, e));
    range += view_.tilt * sector.half / over.across;
    const double reach_m = std::max(range, asked);
    const Vec3 own = view_.m->proofs.sphere ? Vec3(to_m * axis) : view_.m->revolution.axis;
    of_m = view_.scale_m * (view_.near_m ? rippled_bend(*view_.m, view_.scale_m, to_m * -e, reach_m,
                                                        one->place_m, two->place_m, off)
                                         : meridian_bend(*view_.m, to_m * -e, own, reach_m));
    of_m = std::max(0.0, of_m - view_.ball);
    for (const Circle* c : {one, two}) of_m = std::min(of_m, c->rm / c->nm.cross(axis).norm());
    for (Circle* c : {one, two}) {
      c->rm -= of_m * c->nm.cross(axis).norm();
      c->k += of_m * c->nm.dot(axis) * axis;
    }
  } else {
    for (const Circle* c : {one, two}) asked = std::max(asked, (c->nm - e).norm());
    range += sector.half;
    of_m = view_.scale_m * least_bend(*view_.m, to_m * -e, Vec3::Zero(), std::max(range, asked), true);
    of_m = std::max(0.0, of_m - view_.ball);
    for (Circle* c : {one, two}) c->k += of_m * c->nm;
  }
  return of_k + of_m;
}

// Of one circle, or of two so weighted that nothing is to be gained by another angle: what they say of
// (alpha, phi) near (at, sector.phi), to second order. With F = r |e x a| + z e.a + rho |e x b| - e.k, e of
// the sector's angles and azimuths:
//     F >= q cos(dalpha) + t sin(dalpha) + (f + g dalpha) dphi - bend dphi^2 / 2,  |g| <= twist,
// since |e x b| is convex along the meridian, and by Taylor's theorem along the azimuth. The greatest of
// all circles is no less, and what it says of the azimuth to first order cancels at the minimum. With y =
// e.b, |dy / dphi| <= tilt, |dy / dalpha| <= 1 and |e x b|^2 = 1 - y^2, the derivatives of |e x b| are
//     |by phi twice| <= (y'^2 + |y y''|) / |e x b| + y^2 y'^2 / |e x b|^3,
//     |by alpha and phi| <= tilt (1 / |e x b| + |y| |cos alpha| / |e x b| + y^2 / |e x b|^3).
// Where a meridian is known to bend by no less than R between the circles and in the sector (inner_map.h),
// the body holds the balls of that radius that touch there from inside: circles of their centres, and R
// more. `narrower`: the angles should be halved rather than the azimuths; they are where they reach far, as
// from one minimum to another.
double RingSectors::second_order(const Sector& sector, const Least& here, bool* narrower) const {
  const Vec3 u = outward(sector.u), across = view_.axis.cross(u);
  const double c = here.at.c, s = here.at.s;
  const auto too_far = [&](const Angle& a) { return !(c * a.c + s * a.s > kWidestSecond); };
  *narrower = too_far(sector.low) || too_far(sector.high);
  if (*narrower) return -kFarAway;
  const Reach over = reach_of(sector);
  const Vec3 b = mate_axis_from(sector.u);
  Facing m{1, Vec3::Zero()};
  double turned = 0;
  if (view_.circles) {
    m = facing(here.at, b);
    turned = s * m.point[1];
    if (!(over.across > 0.5 * over.sine)) return -kFarAway;
  }
  struct Slope {
    double q, t, f;
  };
  const auto slope = [&](const Circle& circle) {
    const double ps = circle.r - circle.k.dot(u) + circle.rm * m.point[0],
                 pc = circle.z - circle.k.dot(view_.axis) + circle.rm * m.point[2],
                 f = circle.rm * turned - s * circle.k.dot(across);
    return Slope{ps * s + pc * c, ps * c - pc * s, f};
  };
  double rippled = 0, steep = 0;
  const auto at_sector = [&](int k, double* wave_slope) {
    Circle circle = known(circle_[k], sector.phi, sector.half);
    const Wave& w = flat_[k].wave;
    const Drift drift = this->drift(w, circle.at, sector, sector.half, over);
    rippled = std::max(rippled, drift.lost);
    *wave_slope = 0;
    if (drift.followed) {
      steep = std::max(steep, w.steep);
      *wave_slope = s * w.k_r + c * w.k_z + m.sine * w.m_r - w.m_z * (s * b[0] + c * b[2]);
      follow(w, drift.turn, &circle);
    }
    if (circle.rm < 0) {  // beyond M's axis
      rippled -= circle.rm;
      circle.rm = 0;
    }
    return circle;
  };
  double wave_x, wave_y;
  Circle one = at_sector(which_[here.from], &wave_x), two = at_sector(which_[here.to], &wave_y);
  double off = 0;
  const double round = round_off(sector, here.at, u, over, &one, &two, &off) - rippled - off;
  Slope x = slope(one), y = slope(two);
  x.f += wave_x;
  y.f += wave_y;
  const double share = x.t * y.t < 0 ? y.t / (y.t - x.t) : x.q > y.q ? 1.0 : 0.0;
  const double q = share * x.q + (1 - share) * y.q, t = share * x.t + (1 - share) * y.t,
               f = share * x.f + (1 - share) * y.f, rho = share * one.rm + (1 - share) * two.rm;
  const Vec3 k = view_.across(share * one.k + (1 - share) * two.k);
  const double tilt = view_.tilt, inverse = view_.circles ? 1 / over.across : 1.0,
               cosine = over.cosine + tilt;  // of y
  const double h = sector.half, cube = square(cosine * inverse) * inverse, along = std::abs(k.dot(across)),
               facing = k.dot(u),
               near = h < 1 ? (facing > 0 ? facing * (1 - 0.5 * h * h) : facing) - along * h : -k.norm();
  const double bend = -(near > 0 ? over.sine * near : near) +
                      rho * tilt * ((tilt + cosine) * inverse + tilt * cube),
               twist = over.cosine * along + rho * tilt * ((1 + cosine * over.cosine) * inverse + cube) +
                       kChord * steep;
  // Along the angles a sine, least at an end or, where it bends upwards, in between.
  double least = kFarAway;
  for (const double side : {t - kChord * twist * h, t + kChord * twist * h}) {
    const auto at = [&](const Angle& a, double* slope) {
      const double cd = c * a.c + s * a.s, sd = c * a.s - s * a.c;
      *slope = side * cd - q * sd;
      return q * cd + side * sd;
    };
    double first, last;
    least = std::min({least, at(sector.low, &first), at(sector.high, &last)});
    if (first < 0 && last > 0) least = std::min(least, -std::sqrt(q * q + side * side));
  }
  // Where the azimuth bends it upwards it has its least value inside.
  const double lost = -bend * h > std::abs(f) ? -0.5 * f * f / bend : std::abs(f) * h + 0.5 * bend * h * h;
  *narrower = q - least > lost + rippled;
  return round + least - lost - noise_;
}

}  // namespace nurbs

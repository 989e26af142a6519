// Clipping, thinning and weighing of convex polygons.
#include "body/convex_polygon.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

namespace nurbs {
namespace {

constexpr std::size_t kSides = 8;         // sides looked at together
constexpr double kEqualTriangles = 1e-6;  // relative: triangles that count as equal when thinning
constexpr double kSameCentre = 1e-26;     // squared shift, relative to the squared size, that is round-off
constexpr double kThin = 1e-10;           // squared width to length of a polygon too thin to shift across
constexpr double kLeastWeight = 0.1;      // of a corner's own share, after moving the centre

// The line through a side: distance(x) > 0 to its left.
struct SideLine {
  Vec2 normal = Vec2::Zero();
  double offset = 0;

  SideLine(const ConvexPolygon& polygon, int side) {
    const Vec2& from = polygon.corner[side];
    const Vec2 along = polygon.corner[polygon.next(side)] - from;
    const double length = along.norm();
    if (!(length > 0)) {  // a side without length cuts nothing off
      offset = -std::numeric_limits<double>::infinity();
      return;
    }
    normal = Vec2(-along[1], along[0]) / length;
    offset = normal.dot(from);
  }
  double distance(const Vec2& x) const { return normal.dot(x) - offset; }
};

// Whether side `cut` of `window` has a corner of `subject` more than `slack` outside. `lowest`: the corner
// that was furthest outside the side before, near which this one's is: the distance falls and rises once
// round a convex polygon, so that all sides together look at each corner a few times.
bool cuts(const ConvexPolygon& subject, const ConvexPolygon& window, int cut, double slack, int* lowest) {
  const Vec2 &from = window.corner[cut], along = window.corner[window.next(cut)] - from;
  const auto inside = [&](int i) { return cross2(along, subject.corner[i] - from); };  // times the length
  int at = *lowest < subject.count ? *lowest : 0;
  double least = inside(at);
  for (const bool forwards : {true, false})
    for (int k = 0; k < subject.count; ++k) {
      const int next = forwards ? subject.next(at) : subject.before(at);
      const double there = inside(next);
      if (there > least) break;
      least = there;
      at = next;
    }
  *lowest = at;
  return least < 0 && least * least > slack * slack * along.squaredNorm();
}

// Keeps what lies left of side `cut` of `window`.
void cut_by(ConvexPolygon& subject, const ConvexPolygon& window, int cut, double slack) {
  const SideLine line(window, cut);
  double distance[ConvexPolygon::kMost];
  for (int i = 0; i < subject.count; ++i) distance[i] = line.distance(subject.corner[i]);
  ConvexPolygon out;
  for (int i = 0; i < subject.count; ++i) {
    const int j = subject.next(i);
    const double here = distance[i], there = distance[j];
    const bool in = here >= -slack, next_in = there >= -slack;
    if (in && out.count < ConvexPolygon::kMost) out.add(subject.corner[i], subject.owner[i], subject.side[i]);
    if (in != next_in && out.count < ConvexPolygon::kMost) {
      const double t = std::clamp(here / (here - there), 0.0, 1.0);
      const Vec2 at = subject.corner[i] + t * (subject.corner[j] - subject.corner[i]);
      if (in)
        out.add(at, 1, cut);
      else
        out.add(at, subject.owner[i], subject.side[i]);
    }
  }
  subject = out;
}

// Drops sides shorter than `slack`: their second end then joins the sides before and after.
void merge_corners(ConvexPolygon& p, double slack) {
  int count = 0;
  for (int i = 0; i < p.count; ++i) {
    if ((p.corner[i] - p.corner[p.next(i)]).norm() <= slack) continue;
    p.corner[count] = p.corner[i];
    p.owner[count] = p.owner[i];
    p.side[count++] = p.side[i];
  }
  p.count = count;
}

}  // namespace

double polygon_area(const ConvexPolygon& p) {
  double twice = 0;
  for (int i = 1; i + 1 < p.count; ++i)
    twice += cross2(p.corner[i] - p.corner[0], p.corner[i + 1] - p.corner[0]);
  return 0.5 * twice;
}

Vec2 polygon_centroid(const ConvexPolygon& p) {
  double twice = 0;
  Vec2 sum = Vec2::Zero();
  for (int i = 1; i + 1 < p.count; ++i) {
    const Vec2 a = p.corner[i] - p.corner[0], b = p.corner[i + 1] - p.corner[0];
    const double area = cross2(a, b);
    twice += area;
    sum += area * (a + b);
  }
  return p.corner[0] + sum / (3 * twice);
}

double depth_inside(const ConvexPolygon& polygon, const ConvexPolygon& points) {
  double least = std::numeric_limits<double>::infinity();
  for (int i = 0; i < polygon.count; ++i) {
    const SideLine line(polygon, i);
    for (int k = 0; k < points.count; ++k) least = std::min(least, line.distance(points.corner[k]));
  }
  return least;
}

SideLines::SideLines(const ConvexPolygon& polygon) {
  for (int i = 0; i < polygon.count; ++i) {
    const SideLine line(polygon, i);
    x_.push_back(line.normal[0]);
    y_.push_back(line.normal[1]);
    offset_.push_back(line.offset);
  }
  const std::size_t padded = (x_.size() + kSides - 1) / kSides * kSides;
  x_.resize(padded, 0);
  y_.resize(padded, 0);
  offset_.resize(padded, -std::numeric_limits<double>::infinity());
}

double SideLines::depth_inside(const Vec2& point) const {
  double least[kSides];
  std::fill(least, least + kSides, std::numeric_limits<double>::infinity());
  for (std::size_t i = 0; i < x_.size(); i += kSides)
    for (std::size_t k = 0; k < kSides; ++k) {
      const double d = x_[i + k] * point[0] + y_[i + k] * point[1] - offset_[i + k];
      least[k] = d < least[k] ? d : least[k];
    }
  return *std::min_element(least, least + kSides);
}

ConvexPolygon intersect(const ConvexPolygon& subject, const ConvexPolygon& window, double slack) {
  ConvexPolygon p = subject;
  for (int i = 0; i < p.count; ++i) {
    p.owner[i] = 0;
    p.side[i] = i;
  }
  int lowest = 0;
  for (int i = 0; i < window.count && p.count > 0; ++i)
    if (cuts(p, window, i, slack, &lowest)) cut_by(p, window, i, slack);
  merge_corners(p, slack);
  if (p.count < 3) p.count = 0;
  return p;
}

bool clip_segment(const ConvexPolygon& window, const Vec2& p, const Vec2& q, double slack,
                  SegmentPart* part) {
  *part = {};
  for (int i = 0; i < window.count; ++i) {
    const SideLine line(window, i);
    const double at_p = line.distance(p), at_q = line.distance(q);
    const bool p_in = at_p >= -slack, q_in = at_q >= -slack;
    if (!p_in && !q_in) return false;
    if (p_in && q_in) continue;
    const double t = std::clamp(at_p / (at_p - at_q), 0.0, 1.0);
    if (!p_in && t > part->t0) {
      part->t0 = t;
      part->side0 = i;
    }
    if (!q_in && t < part->t1) {
      part->t1 = t;
      part->side1 = i;
    }
  }
  return part->t1 > part->t0;
}

int thin(const ConvexPolygon& polygon, int most, int lead, int* kept) {
  int list[ConvexPolygon::kMost];
  int count = polygon.count;
  for (int i = 0; i < count; ++i) list[i] = (lead + i) % polygon.count;
  while (count > most) {
    double least = std::numeric_limits<double>::infinity();
    int drop = 1;
    for (int i = 1; i < count; ++i) {
      const Vec2& at = polygon.corner[list[i]];
      const double area =
          cross2(at - polygon.corner[list[i - 1]], polygon.corner[list[i + 1 < count ? i + 1 : 0]] - at);
      if (area < least * (1 - kEqualTriangles)) {
        least = area;
        drop = i;
      }
    }
    std::copy(list + drop + 1, list + count, list + drop);
    --count;
  }
  std::copy(list, list + count, kept);
  std::sort(kept, kept + count);
  return count;
}

void corner_weights(const ConvexPolygon& p, const Vec2& centre, double* weight) {
  const Vec2 c = polygon_centroid(p);
  const double share = 0.25 / polygon_area(p);  // a triangle's area is half the cross product
  for (int i = 0; i < p.count; ++i) weight[i] = 0;
  for (int i = 0; i < p.count; ++i) {
    const int j = p.next(i);
    const double part = share * std::max(0.0, cross2(p.corner[i] - c, p.corner[j] - c));
    weight[i] += part;
    weight[j] += part;
  }
  const Vec2 shift = centre - c;
  Mat2 spread = Mat2::Zero();
  for (int i = 0; i < p.count; ++i) spread += weight[i] * (p.corner[i] - c) * (p.corner[i] - c).transpose();
  const double size = spread.trace();
  if (!(shift.squaredNorm() > kSameCentre * size && spread.determinant() > kThin * size * size)) return;
  Vec2 slope = spread.inverse() * shift;
  double lowest = 0;
  for (int i = 0; i < p.count; ++i) lowest = std::min(lowest, slope.dot(p.corner[i] - c));
  if (lowest < kLeastWeight - 1) slope *= (kLeastWeight - 1) / lowest;
  for (int i = 0; i < p.count; ++i) weight[i] *= 1 + slope.dot(p.corner[i] - c);
}

}  // namespace nurbs

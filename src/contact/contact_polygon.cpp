// Contact polygons: made from faces, creases and ruled lines by clipping in the reference plane; evaluated
// from frozen points.
#include "contact/contact_polygon.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "body/flat_faces.h"
#include "body/support.h"

namespace nurbs {
namespace {

constexpr double kFaceCosine = 0.5;  // a face further than 60 degrees from the contact's normal is not asked
constexpr double kOtherFaceCosine = 0.3;  // nor may one further than 72 degrees soon be
constexpr double kLineAngle = 0.8;        // rad, the same for the normal of a ruled line
constexpr double kBesideLine = 1e-8;      // of the bounding radius: a support point this near a line is on it
constexpr double kLeaning = 1.0 / 6;      // of the reach: half the overlap when new, two when it is remade
constexpr double kThinnest = 1e-7;        // width to length of a polygon below which it is a segment
constexpr double kInfinite = std::numeric_limits<double>::infinity();

// Share of the room to a polygon, at most kMostRoom smaller bounding radii, that bodies may go: reach and
// overlap grow by up to five times the way, heights on inclined faces change by more than it.
constexpr double kWayShare = 0.1, kMostRoom = 0.3;

constexpr double kMostAcross = 0.1;  // rad: one step of the search for the least overlap across lines
constexpr int kAcrossSteps = 12;     // of them; 2 to 3 are usual

void store(const Vec3& v, double* out) {
  for (int k = 0; k < 3; ++k) out[k] = v[k];
}
Vec3 load(const double* v) {
  return {v[0], v[1], v[2]};
}

std::uint32_t vertex_id(int body, int vertex) {
  return vertex < 0 ? 0 : static_cast<std::uint32_t>(1 + body) << 30 | static_cast<std::uint32_t>(vertex);
}
std::uint32_t crossing_id(int side_of_a, int side_of_b) {
  return 3u << 30 | (static_cast<std::uint32_t>(side_of_a) & 0x7fffu) << 15 |
         (static_cast<std::uint32_t>(side_of_b) & 0x7fffu);
}

// A body of the pair, placed relative to A's centre of mass.
struct Body {
  int index;  // 0: A, 1: B
  const Shape* shape;
  BodyFrame frame;

  Body(int i, const Particle& p, const Vec3& origin)
      : index(i), shape(p.shape), frame{p.scale, p.x - origin, p.q.toRotationMatrix(), p.shape} {}
  Vec3 place(const Vec3& s) const { return frame.x + frame.scale * (frame.axes * s); }
  Vec3 to_shape(const Vec3& x) const { return frame.axes.transpose() * (x - frame.x) / frame.scale; }
  Vec3 turned(const Vec3& s) const { return frame.axes * s; }
  Vec3 turned_back(const Vec3& x) const { return frame.axes.transpose() * x; }
  double radius() const { return frame.scale * shape->bounding_radius; }
  const Vec3& vertex(int v) const { return shape->flats.vertices[v]; }
};

// The reference plane with axes of its own, lab.
struct ReferencePlane {
  Vec3 origin, normal, u, v;
  double level;  // normal . (x - origin)

  Vec2 project(const Vec3& x) const { return {u.dot(x - origin), v.dot(x - origin)}; }
  double height(const Vec3& x) const { return normal.dot(x - origin) - level; }
  Vec3 lift(const Vec2& at, double height) const {
    return origin + at[0] * u + at[1] * v + (level + height) * normal;
  }
};
ReferencePlane plane_along(const Vec3& origin, const Vec3& normal, const Vec3& u) {
  return {origin, normal, u, normal.cross(u), 0};
}

// Points on their way into a polygon: in the plane, and on the incident body.
struct Candidates {
  ConvexPolygon plane;                 // a segment when count is 2
  Vec3 on_body[ConvexPolygon::kMost];  // shape axes, scale 1
  double gap[ConvexPolygon::kMost];
  std::uint32_t id[ConvexPolygon::kMost];

  void add(const Vec2& at, const Vec3& point, double height, std::uint32_t name) {
    on_body[plane.count] = point;
    gap[plane.count] = height;
    id[plane.count] = name;
    plane.add(at);
  }
  bool within(double most) const {
    return std::all_of(gap, gap + plane.count, [&](double g) { return g <= most; });
  }
};

double size_of(const ConvexPolygon& p, int* first, int* second) {
  double most = 0;
  for (int i = 0; i < p.count; ++i)
    for (int j = i + 1; j < p.count; ++j) {
      const double d = (p.corner[i] - p.corner[j]).squaredNorm();
      if (d <= most) continue;
      most = d;
      *first = i;
      *second = j;
    }
  return std::sqrt(most);
}

void set_point(const Candidates& from, int i, double weight, ContactPolygon* out) {
  store(from.on_body[i], out->point[out->count]);
  out->weight[out->count] = weight;
  out->id[out->count++] = from.id[i];
}

// Thins and weighs; false when all of it is smaller than `least`. `centre`: of a uniform load, null: the
// centroid.
bool finish(const Candidates& from, double least, const Vec2* centre, ContactPolygon* out) {
  out->count = 0;
  int first = 0, second = 0;
  const double size = from.plane.count > 1 ? size_of(from.plane, &first, &second) : 0;
  if (!(size > least)) return false;
  if (from.plane.count == 2 || polygon_area(from.plane) <= kThinnest * size * size) {
    set_point(from, first, 0.5, out);
    set_point(from, second, 0.5, out);
    return true;
  }
  int kept[ConvexPolygon::kMost];
  const int count = thin(from.plane, kContactPoints, 0, kept);
  ConvexPolygon few;
  for (int i = 0; i < count; ++i) few.add(from.plane.corner[kept[i]]);
  double weight[ConvexPolygon::kMost];
  corner_weights(few, centre ? *centre : polygon_centroid(from.plane), weight);
  for (int i = 0; i < count; ++i) set_point(from, kept[i], weight[i], out);
  return true;
}

// What remains to be filled in once the points stand: the marks that tell sliding.
void set_marks(const BodyFrame& reference, const BodyFrame& incident, ContactPolygon* out) {
  const auto in_reference = [&](int i) -> Vec3 {
    const Vec3 x = incident.x + incident.scale * (incident.axes * load(out->point[i]));
    return reference.axes.transpose() * (x - reference.x);
  };
  const Vec3 zero = in_reference(0);
  double most = 0;
  out->far = 0;
  for (int i = 1; i < out->count; ++i) {
    const double d = (in_reference(i) - zero).squaredNorm();
    if (d > most) most = d, out->far = i;
  }
  store(zero, out->mark[0]);
  store(in_reference(out->far), out->mark[1]);
}

// The outline's points that sector i of a round face stands for: [first, last).
struct Sector {
  int first, last;
};
Sector sector(int i, int points) {
  return {i * points / kContactPoints, (i + 1) * points / kContactPoints};
}

// A whole round face: eight sectors of its outline.
void set_ring(const Shape& shape, int body, int face, ContactPolygon* out) {
  const FlatFace& f = shape.flats.faces[face];
  const int points = static_cast<int>(f.outline.size());
  if (points < 2 * kContactPoints) return;
  out->ring = face + 1;
  out->count = kContactPoints;
  for (int i = 0; i < kContactPoints; ++i) {
    const Sector s = sector(i, points);
    out->weight[i] = 0;
    for (int k = s.first; k < s.last; ++k) out->weight[i] += f.weight[k];
    const int middle = f.outline[(s.first + s.last) / 2];
    store(shape.flats.vertices[middle], out->point[i]);
    out->id[i] = vertex_id(body, middle);
  }
}

// Whether a body's support point is one of a ruled line of its. Pairs ask for it, so that lines beside
// rounded rims, which lean, make polygons on walls only: of undamped pairs those lose energy.
bool is_on_line(const Shape& shape, const Vec3& support, const Vec3& p, const Vec3& q) {
  const Vec3 way = q - p, off = support - p;
  const double t = std::clamp(off.dot(way) / way.squaredNorm(), 0.0, 1.0);
  return (off - t * way).norm() <= kBesideLine * shape.bounding_radius;
}

// The support set that stands on a plane. A ruled line beside a rounded rim that bears at one end only is a
// point: with half its weights it would be half as stiff as the rim.
SupportSet standing_set(const Shape& shape, const Vec3& d, double tolerance) {
  SupportSet set = support_set(shape, d, tolerance);
  const bool leans = set.ruled && !is_on_line(shape, set.support, set.point[0], set.point[1]) &&
                     set.h - std::min(d.dot(set.point[0]), d.dot(set.point[1])) > kLeaning * tolerance;
  if (leans) set.count = 1;
  return set;
}

// One attempt at a pair's polygon with a given face as the reference.
class FaceContact {
 public:
  FaceContact(const Body& reference, const FlatFace& face, const Body& incident)
      : reference_(reference), face_(face), incident_(incident) {
    plane_ = {reference.frame.x, reference.turned(face.normal), reference.turned(face.axis_u),
              reference.turned(face.axis_v()), reference.frame.scale * face.offset};
    slack_ = kClipSlack * std::max(reference.radius(), incident.radius());
  }

  // Overlap along the face's normal; where it exceeds `most`, a lower bound above that may be given.
  double depth(double most) const {
    const Shape& shape = *incident_.shape;
    const Vec3& node = shape.atlas.point[shape.atlas.nearest(down())];
    const double least = -plane_.height(incident_.place(node));
    if (least > most) return least;
    const double h = find_hull_support(shape, down()).h;
    return plane_.level - (plane_.normal.dot(incident_.frame.x - plane_.origin) - incident_.frame.scale * h);
  }

  // How far all points of both bodies may go while something of whatever may lie over the reference face is
  // sure to be higher than `most`, so that make() fails; 0 where that is not seen.
  double room(double most) {
    double least = face_room(opposite(), most);
    if (!(least > 0)) return 0;
    for (const StraightEdge& edge : incident_.shape->flats.edges) {
      if (!(least > 0)) return 0;
      least = std::min(least,
                       segment_room({incident_.vertex(edge.ends[0]), incident_.vertex(edge.ends[1])}, most));
    }
    if (!(least > 0)) return 0;
    RuledLine line;
    Vec3 support;
    return incident_line(&line, &support) ? std::min(least, segment_room(line.ends, most)) : least;
  }

  // `swallowed`: the reference face lies inside the incident one.
  bool make(double overlap, double reach, ContactPolygon* out, bool* swallowed) {
    *swallowed = false;
    const double most = reach - overlap;
    if (!face_points(most, swallowed) && !crease_points(most) && !line_points(most)) return false;
    if (!finish(points_, reach, nullptr, out)) return false;
    out->reference = reference_.index;
    if (whole_ && ring_ >= 0) set_ring(*incident_.shape, incident_.index, ring_, out);
    out->factor = 1;
    store(face_.normal, out->normal);
    out->offset = face_.offset;
    set_marks(reference_.frame, incident_.frame, out);
    out->rolling = ruled_ ? 1 : 0;
    set_room(out);
    return true;
  }

 private:
  // Towards the reference plane, axes of the incident body's shape.
  Vec3 down() const { return incident_.turned_back(-plane_.normal); }

  std::uint32_t crossing(int side_of_reference, int side_of_incident) const {
    return reference_.index == 0 ? crossing_id(side_of_reference, side_of_incident)
                                 : crossing_id(side_of_incident, side_of_reference);
  }

  // The reference's outline.
  const ConvexPolygon& window() const {
    if (window_.count == 0)
      for (const int v : face_.outline) window_.add(plane_.project(reference_.place(reference_.vertex(v))));
    return window_;
  }

  // The incident face opposite the reference, in the reference plane.
  struct Opposite {
    int face;  // -1: none
    Vec3 normal;
    double level;
  };
  // Counterclockwise seen from the incident body's outside is clockwise about the reference's normal.
  static int vertex(const FlatFace& face, int i) {
    const int n = static_cast<int>(face.outline.size());
    return face.outline[n - 1 - i % n];
  }
  Opposite opposite() const {
    Opposite o;
    const FlatFeatures& flats = incident_.shape->flats;
    o.face = nearest_face(flats, down(), kFaceCosine);
    if (o.face < 0) return o;
    const FlatFace& face = flats.faces[o.face];
    o.normal = incident_.turned(face.normal);
    o.level = incident_.frame.scale * face.offset - o.normal.dot(plane_.origin - incident_.frame.x);
    return o;
  }
  // Of the incident face over a place of the reference plane.
  double height(const Opposite& o, const Vec2& at) const {
    return (o.level - at[0] * o.normal.dot(plane_.u) - at[1] * o.normal.dot(plane_.v)) /
               o.normal.dot(plane_.normal) -
           plane_.level;
  }

  // How far inside the two outlines a place of the reference plane is, along that at least.
  double inside_reference(const Vec2& at) const {
    const double scale = reference_.frame.scale;
    return scale * face_.sides.depth_inside(at / scale);
  }
  double inside(const Opposite& o, const Vec2& at, double over) const {
    const FlatFace& face = incident_.shape->flats.faces[o.face];
    const Vec3 on_face = incident_.to_shape(plane_.lift(at, over));
    return -o.normal.dot(plane_.normal) * incident_.frame.scale *
           face.sides.depth_inside(face.project(on_face));
  }

  // Of room(): the face opposite is either elsewhere, or has a place over the reference that is high.
  double face_room(const Opposite& o, double most) const {
    if (o.face < 0) return kInfinite;
    const FlatFace& face = incident_.shape->flats.faces[o.face];
    const Vec2 middle = plane_.project(reference_.place(face_.centroid)),
               other = plane_.project(incident_.place(face.centroid));
    double best =
        (middle - other).norm() - reference_.frame.scale * face_.radius - incident_.frame.scale * face.radius;
    if (best > 0) return best;
    for (const double t : {0.0, 0.5, 1.0}) {
      const Vec2 at = middle + t * (other - middle);
      const double over = height(o, at), high = over - most;
      if (high > best) best = std::max(best, std::min({high, inside_reference(at), inside(o, at, over)}));
    }
    return std::max(best, 0.0);
  }
  double segment_room(const Vec3 (&ends)[2], double most) const {
    const Vec3 p = incident_.place(ends[0]), q = incident_.place(ends[1]);
    const double gap_p = plane_.height(p), gap_q = plane_.height(q);
    double best = std::min(gap_p, gap_q) - most;
    if (best > 0) return best;
    const Vec2 at_p = plane_.project(p), at_q = plane_.project(q);
    SegmentPart part;
    if (!clip_segment(window(), at_p, at_q, slack_, &part)) return 0;
    for (const double s : {0.1, 0.5, 0.9}) {
      const double t = part.t0 + s * (part.t1 - part.t0), high = gap_p + t * (gap_q - gap_p) - most;
      if (high > best) best = std::max(best, std::min(high, inside_reference(at_p + t * (at_q - at_p))));
    }
    return std::max(best, 0.0);
  }

  bool face_points(double most, bool* swallowed) {
    const Opposite o = opposite();
    if (o.face < 0 || face_room(o, most) > 0) return false;
    const FlatFace& face = incident_.shape->flats.faces[o.face];
    ConvexPolygon outline;
    for (int i = 0; i < static_cast<int>(face.outline.size()); ++i)
      outline.add(plane_.project(incident_.place(incident_.vertex(vertex(face, i)))));
    const ConvexPolygon cut = intersect(outline, window(), slack_);
    if (cut.count < 3) return false;
    points_.plane.count = 0;
    whole_ = true;
    if (face.round) ring_ = o.face;
    *swallowed = true;
    for (int i = 0; i < cut.count; ++i) {
      const int b = cut.before(i);
      const bool own = cut.owner[b] == 0 && cut.owner[i] == 0,
                 others = cut.owner[b] == 1 && cut.owner[i] == 1;
      whole_ = whole_ && own;
      *swallowed = *swallowed && others;
      if (own) {
        const int v = vertex(face, cut.side[i]);
        const Vec3& point = incident_.vertex(v);
        points_.add(cut.corner[i], point, plane_.height(incident_.place(point)),
                    vertex_id(incident_.index, v));
        continue;
      }
      const Vec2& at = cut.corner[i];
      const double over = height(o, at);
      std::uint32_t id = 0;
      if (others) {
        id = vertex_id(reference_.index, face_.outline[cut.side[i]]);
      } else {
        const int mine = cut.owner[b] == 0 ? cut.side[b] : cut.side[i];
        const int other = cut.owner[b] == 1 ? cut.side[b] : cut.side[i];
        id = crossing(face_.outline[other],
                      vertex(face, mine + 1));  // a side is named by where it starts from outside
      }
      points_.add(at, incident_.to_shape(plane_.lift(at, over)), over, id);
    }
    return points_.within(most);
  }

  // The part of a segment of the incident body over the reference face; false unless it is within reach.
  bool segment(const Vec3 (&ends)[2], const int (&vertex)[2], double most, Candidates* out,
               bool* uncut) const {
    const Vec3 p = incident_.place(ends[0]), q = incident_.place(ends[1]);
    const double gap_p = plane_.height(p), gap_q = plane_.height(q);
    if (std::min(gap_p, gap_q) > most) return false;
    const Vec2 at_p = plane_.project(p), at_q = plane_.project(q);
    SegmentPart part;
    if (!clip_segment(window(), at_p, at_q, slack_, &part)) return false;
    out->plane.count = 0;
    const auto add = [&](double t, int side, int end) {
      const std::uint32_t id = vertex[end] < 0 ? 0
                               : side < 0      ? vertex_id(incident_.index, vertex[end])
                                               : crossing(face_.outline[side], vertex[0]);
      out->add(at_p + t * (at_q - at_p), ends[0] + t * (ends[1] - ends[0]), gap_p + t * (gap_q - gap_p), id);
    };
    add(part.t0, part.side0, 0);
    add(part.t1, part.side1, 1);
    *uncut = part.side0 < 0 && part.side1 < 0;
    return out->within(most);
  }

  bool crease_points(double most) {
    bool found = false;
    for (const StraightEdge& edge : incident_.shape->flats.edges) {
      Candidates other;
      bool uncut = false;
      if (!segment({incident_.vertex(edge.ends[0]), incident_.vertex(edge.ends[1])}, edge.ends, most, &other,
                   &uncut))
        continue;
      if (found && other.gap[0] + other.gap[1] >= points_.gap[0] + points_.gap[1]) continue;
      found = true;
      whole_ = uncut;
      copy_segment(other);
    }
    return found;
  }

  void copy_segment(const Candidates& other) {
    points_.plane.count = 0;
    for (int i = 0; i < 2; ++i)
      points_.add(other.plane.corner[i], other.on_body[i], other.gap[i], other.id[i]);
  }

  // The incident body's ruled line that is deepest, and its support point.
  bool incident_line(RuledLine* line, Vec3* support) const {
    const Shape& shape = *incident_.shape;
    if (shape.flats.ruling.empty()) return false;
    const Support s = find_hull_support(shape, down());
    *support = s.point;
    return ruled_line(shape, s.where, down(), kLineAngle, line);
  }

  bool line_points(double most) {
    RuledLine line;
    Vec3 support;
    if (!incident_line(&line, &support) ||
        !is_on_line(*incident_.shape, support, line.ends[0], line.ends[1]) ||
        !segment(line.ends, {-1, -1}, most, &points_, &whole_))
      return false;
    ruled_ = true;
    return true;
  }

  void set_room(ContactPolygon* out) const {
    int i = 0, j = 0;
    double room = kSlideShare * size_of(points_.plane, &i, &j);
    if (whole_) room = std::max(room, depth_inside(window(), points_.plane));
    out->room = room;
  }

  const Body& reference_;
  const FlatFace& face_;
  const Body& incident_;
  ReferencePlane plane_;
  double slack_;
  mutable ConvexPolygon window_;  // made when it is first asked for
  Candidates points_;
  bool whole_ = false;  // every point is the incident body's own
  bool ruled_ = false;
  int ring_ = -1;  // the incident face if it is round
};

struct Line {
  Vec3 ends[2];  // lab, from A's centre of mass
  int vertex[2];
  bool ruled;
};

// A crease or ruled line that supports the body in lab direction d, to `tolerance`.
bool support_line(const Body& body, const Vec3& d, double tolerance, Line* line) {
  const SupportSet set = support_set(*body.shape, body.turned_back(d), tolerance / body.frame.scale);
  if (set.count != 2 || (set.ruled && !is_on_line(*body.shape, set.support, set.point[0], set.point[1])))
    return false;
  for (int i = 0; i < 2; ++i) {
    line->ends[i] = body.place(set.point[i]);
    line->vertex[i] = set.vertex[i];
  }
  line->ruled = set.ruled;
  return true;
}

// Two lines: the reference plane goes through A's, as square to the contact's normal as it can.
struct LinePair {
  Line a, b;
  ReferencePlane plane;
  double length;  // of A's
  Vec2 p, q;      // ends of B's in the plane, along A's line and sideways

  // Sideways from A's line, at most.
  double aside() const { return std::max(std::abs(p[1]), std::abs(q[1])); }
};

LinePair pair_of(const Line& a, const Line& b, const Vec3& d) {
  const Vec3 u = (a.ends[1] - a.ends[0]).normalized();
  const Vec3 normal = (d - d.dot(u) * u).normalized();
  LinePair lines{a, b, plane_along(a.ends[0], normal, u), u.dot(a.ends[1] - a.ends[0]), {}, {}};
  lines.p = lines.plane.project(b.ends[0]);
  lines.q = lines.plane.project(b.ends[1]);
  return lines;
}

// The direction across u, near d, along which two bodies overlap least: where the points furthest along it
// lie over each other. By secants, kept between sides once both are known.
Vec3 least_across(const Body& a, const Body& b, const Vec3& u, const Vec3& d) {
  const Vec3 middle = (d - d.dot(u) * u).normalized(), side = u.cross(middle);
  const double size = a.radius() + b.radius();
  const auto along = [&](double angle) -> Vec3 { return std::cos(angle) * middle + std::sin(angle) * side; };
  const auto slope = [&](double angle) {  // of the overlap
    const Vec3 e = along(angle), x = a.place(find_hull_support(*a.shape, a.turned_back(e)).point),
               y = b.place(find_hull_support(*b.shape, b.turned_back(-e)).point);
    return (x - y).dot(u.cross(e));
  };
  double last = 0, at_last = slope(last), angle = std::clamp(-at_last / size, -kMostAcross, kMostAcross);
  double low = at_last < 0 ? 0 : -kInfinite, high = at_last > 0 ? 0 : kInfinite;
  for (int k = 0; k < kAcrossSteps && angle != last; ++k) {
    const double here = slope(angle);
    (here < 0 ? low : high) = angle;
    if (std::abs(here) <= kRoundoff * size) break;
    const double rate = (here - at_last) / (angle - last);
    double next = rate > 0 ? angle - here / rate : angle - std::copysign(kMostAcross, here);
    next = std::clamp(next, angle - kMostAcross, angle + kMostAcross);
    if (!(next > low && next < high)) {
      if (!(high - low < kInfinite)) break;
      next = 0.5 * (low + high);
    }
    last = angle;
    at_last = here;
    angle = next;
  }
  return along(angle);
}

// Two parallel lines. `room`, where there are none: how far points may go before there may be. `rolls`: they
// were so before, and the normal has turned with A, not to where the lines have gone.
bool line_contact(const Body& a, const Body& b, Vec3 d, double overlap, double reach,
                  const SurfacePoint* starts, bool rolls, ContactPolygon* out, double* room) {
  // Both bodies need a feature that lags no more than that behind their support.
  const auto lag = [](const Body& body, const Vec3& along, const SurfacePoint* start) {
    const Vec3 on_body = body.turned_back(along);
    const Support top = find_hull_support(*body.shape, on_body, start);
    return body.frame.scale * feature_lag(*body.shape, on_body, top.h, top.where);
  };
  const FlatFeatures &flats_a = a.shape->flats, &flats_b = b.shape->flats;
  *room = kInfinite;
  if ((flats_a.edges.empty() && flats_a.ruling.empty()) || (flats_b.edges.empty() && flats_b.ruling.empty()))
    return false;
  *room = lag(a, d, starts ? &starts[0] : nullptr) - reach;
  if (*room > 0) return false;
  *room = lag(b, -d, starts ? &starts[1] : nullptr) - reach;
  if (*room > 0) return false;
  *room = 0;
  Line on_a, on_b;
  if (!support_line(a, d, reach, &on_a)) return false;
  if (rolls) {
    d = least_across(a, b, (on_a.ends[1] - on_a.ends[0]).normalized(), d);
    if (!support_line(a, d, reach, &on_a)) return false;
  }
  if (!support_line(b, -d, reach, &on_b)) return false;
  const LinePair lines = pair_of(on_a, on_b, d);
  const ReferencePlane& plane = lines.plane;
  const double length = lines.length;
  const Vec2 &p = lines.p, &q = lines.q;
  // Lines further apart sideways than this touch at one point.
  if (lines.aside() > reach) {
    *room = 0.5 * (lines.aside() - reach);
    return false;
  }
  Candidates points;
  bool whole = true;
  for (int i = 0; i < 2; ++i) {
    const Vec2 &mine = i == 0 ? p : q, &other = i == 0 ? q : p;
    const double at = std::clamp(mine[0], 0.0, length);
    const bool cut = at != mine[0];
    const double t = cut ? (at - mine[0]) / (other[0] - mine[0]) : 0;
    if (!(t >= 0 && t < 1)) return false;
    whole = whole && !cut;
    const Vec3 x = on_b.ends[i] + t * (on_b.ends[1 - i] - on_b.ends[i]);
    points.add(plane.project(x), b.to_shape(x), plane.height(x),
               cut ? vertex_id(0, on_a.vertex[at > 0 ? 1 : 0]) : vertex_id(1, on_b.vertex[i]));
  }
  if (!points.within(reach - overlap) || !finish(points, reach, nullptr, out)) return false;
  out->reference = 0;
  out->factor = 1;
  const Vec3 local = a.turned_back(plane.normal);
  store(local, out->normal);
  out->offset = local.dot(a.to_shape(on_a.ends[0]));
  set_marks(a.frame, b.frame, out);
  out->rolling = on_a.ruled || on_b.ruled ? 1 : 0;
  out->room = kSlideShare * length;
  return true;
}

}  // namespace

BodyFrame body_frame(const Particle& particle) {
  return {particle.scale, particle.x, particle.q.toRotationMatrix(), particle.shape};
}

BodyFrame plane_frame(const Vec3& origin) {
  return {1, origin, Mat3::Identity(), nullptr};
}

namespace {

// How far a body may go before it has a flat feature within reach of a plane, where it has none now. `d`:
// towards the plane, shape axes.
double clear_way(const Particle& particle, const Vec3& d, double reach, const SupportSet& point) {
  const double room = feature_lag(*particle.shape, d, point.h, point.where) - reach / particle.scale;
  return kWayShare * particle.scale * std::clamp(room, 0.0, kMostRoom * particle.shape->bounding_radius);
}

// make_plane_polygon() of a support set that is more than a point.
bool stand_on_plane(const Particle& particle, const BodyFrame& frame, const SupportSet& set,
                    const Vec3& origin, const Vec3& normal, double reach, ContactPolygon* out) {
  const Shape& shape = *particle.shape;
  const auto height = [&](const Vec3& s) {
    return normal.dot(particle.x - origin + frame.scale * (frame.axes * s));
  };
  Candidates points;
  Vec2 centre = Vec2::Zero();
  const bool face = set.face >= 0;
  if (face) {
    const FlatFace& f = shape.flats.faces[set.face];
    for (const int v : f.corners) {
      const Vec3& s = shape.flats.vertices[v];
      points.add(f.project(s), s, height(s), vertex_id(1, v));
    }
    centre = f.project(f.centroid);
  } else {
    const double length = (set.point[1] - set.point[0]).norm();
    for (int i = 0; i < 2; ++i)
      points.add({i * length, 0}, set.point[i], height(set.point[i]), vertex_id(1, set.vertex[i]));
  }
  if (!finish(points, reach / frame.scale, face ? &centre : nullptr, out)) return false;
  if (face && shape.flats.faces[set.face].round) set_ring(shape, 1, set.face, out);
  out->factor = 1;
  store(normal, out->normal);
  out->room = kInfinite;
  set_marks(plane_frame(origin), frame, out);
  out->rolling = set.ruled ? 1 : 0;
  return true;
}

}  // namespace

bool make_plane_polygon(const Particle& particle, const Vec3& origin, const Vec3& normal, double reach,
                        ContactPolygon* out, double* clear) {
  *out = {};
  if (clear) *clear = 0;
  const Shape& shape = *particle.shape;
  if (shape.flats.empty()) return false;
  const BodyFrame frame = body_frame(particle);
  const Vec3 d = frame.axes.transpose() * -normal;
  const SupportSet set = standing_set(shape, d, reach / frame.scale);
  if (set.count > 1) return stand_on_plane(particle, frame, set, origin, normal, reach, out);
  if (clear) *clear = clear_way(particle, d, reach, set);
  return false;
}

namespace {

// What of a feature lies over a region.
class RegionClip {
 public:
  RegionClip(const PlaneRegion& region, double size)
      : plane(plane_along(region.origin, region.normal, region.normal.unitOrthogonal())),
        region_(region),
        slack_(kClipSlack * size) {}

  const ReferencePlane plane;

  // Corners of the hull of the part of a polygon; whether it is the whole polygon.
  bool polygon(const ConvexPolygon& subject, std::vector<Vec2>* hull) const {
    std::vector<Vec2> points;
    double area = 0;
    each_cell([&](const ConvexPolygon& cell) {
      const ConvexPolygon part = intersect(subject, cell, slack_);
      if (part.count < 3) return;
      area += polygon_area(part);
      points.insert(points.end(), part.corner, part.corner + part.count);
    });
    const double full = polygon_area(subject);
    if (area >= (1 - 1e-9) * full) return true;
    convex_hull(points, hull);
    return false;
  }
  // The smallest part [low, high] of a segment that has all of it over the region; whether it is the whole.
  bool segment(const Vec2& p, const Vec2& q, double* low, double* high) const {
    double covered = 0;
    *low = 1;
    *high = 0;
    each_cell([&](const ConvexPolygon& cell) {
      SegmentPart part;
      if (!clip_segment(cell, p, q, slack_, &part)) return;
      covered += part.t1 - part.t0;
      *low = std::min(*low, part.t0);
      *high = std::max(*high, part.t1);
    });
    return *low == 0 && *high == 1 && covered >= 1 - 1e-9;
  }
  // Distance of points from the region's border.
  double room(const ConvexPolygon& points) const {
    double least = kInfinite;
    const std::vector<Vec3>& border = region_.cells->border;
    for (std::size_t k = 0; k + 1 < border.size(); k += 2) {
      const Vec2 a = plane.project(border[k]), way = plane.project(border[k + 1]) - a;
      for (int i = 0; i < points.count; ++i) {
        const Vec2 x = points.corner[i] - a;
        const double t = std::clamp(x.dot(way) / way.squaredNorm(), 0.0, 1.0);
        least = std::min(least, (x - t * way).norm());
      }
    }
    return least;
  }

 private:
  template <class Visit>
  void each_cell(Visit visit) const {
    int first = 0;
    for (const int end : region_.cells->ends) {
      ConvexPolygon cell;
      for (int k = first; k < end && cell.count < kOutlinePoints; ++k)
        cell.add(plane.project(region_.cells->corners[k]));
      if (polygon_area(cell) < 0) std::reverse(cell.corner, cell.corner + cell.count);
      visit(cell);
      first = end;
    }
  }
  // Andrew's monotone chain.
  void convex_hull(std::vector<Vec2>& points, std::vector<Vec2>* hull) const {
    hull->clear();
    std::sort(points.begin(), points.end(),
              [](const Vec2& a, const Vec2& b) { return a[0] != b[0] ? a[0] < b[0] : a[1] < b[1]; });
    const auto chain = [&](auto from, auto to) {
      const std::size_t start = hull->size();
      for (auto p = from; p != to; ++p) {
        if (!hull->empty() && (*p - hull->back()).norm() <= 2 * slack_) continue;
        while (hull->size() > start + 1 &&
               cross2(hull->back() - (*hull)[hull->size() - 2], *p - hull->back()) <=
                   slack_ * (*p - (*hull)[hull->size() - 2]).norm())
          hull->pop_back();
        hull->push_back(*p);
      }
      if (!hull->empty()) hull->pop_back();  // the next chain begins with it
    };
    chain(points.begin(), points.end());
    chain(points.rbegin(), points.rend());
  }

  const PlaneRegion& region_;
  const double slack_;
};

}  // namespace

RegionContact make_region_polygon(const Particle& particle, const PlaneRegion& region, const Vec3& frame,
                                  double reach, ContactPolygon* out, double* clear) {
  *out = {};
  if (clear) *clear = 0;
  const Shape& shape = *particle.shape;
  if (shape.flats.empty()) return RegionContact::point;
  const Body body(1, particle, Vec3::Zero());
  const auto placed = [&](double room) {
    out->offset = region.normal.dot(region.origin - frame);
    out->room = room;
    set_marks(plane_frame(frame), body.frame, out);
    return RegionContact::polygon;
  };
  const Vec3 d = body.turned_back(-region.normal);
  const SupportSet set = standing_set(shape, d, reach / body.frame.scale);
  if (set.count < 2) {
    if (clear) *clear = clear_way(particle, d, reach, set);
    return RegionContact::point;
  }
  const auto whole = [&](double room) {
    const bool made = stand_on_plane(particle, body.frame, set, region.origin, region.normal, reach, out);
    return made ? placed(room) : RegionContact::point;
  };
  if (!region.cells) return whole(kInfinite);
  const RegionClip clip(region, body.radius());
  Candidates points;
  double size = 0;
  if (set.face >= 0) {
    const FlatFace& face = shape.flats.faces[set.face];
    ConvexPolygon subject;  // clockwise seen from the body's outside
    for (std::size_t i = face.outline.size(); i-- > 0;)
      subject.add(clip.plane.project(body.place(body.vertex(face.outline[i]))));
    std::vector<Vec2> hull;
    if (clip.polygon(subject, &hull)) return whole(clip.room(subject));
    if (hull.size() < 2) return RegionContact::clear;
    const Vec3 normal = body.turned(face.normal);
    const double level = body.frame.scale * face.offset - normal.dot(region.origin - body.frame.x);
    for (const Vec2& at : hull) {
      if (points.plane.count == ConvexPolygon::kMost) break;
      const Vec3 flat = clip.plane.lift(at, 0) - region.origin;
      const double h = (level - normal.dot(flat)) / normal.dot(region.normal);
      points.add(at, body.to_shape(clip.plane.lift(at, h)), h, 0);
    }
    for (int i = 0; i < points.plane.count; ++i)
      size = std::max(size, (points.plane.corner[i] - points.plane.corner[0]).norm());
  } else {
    const Vec3 p = body.place(set.point[0]), q = body.place(set.point[1]);
    double low = 0, high = 1;
    if (clip.segment(clip.plane.project(p), clip.plane.project(q), &low, &high)) {
      ConvexPolygon ends;
      ends.add(clip.plane.project(p));
      ends.add(clip.plane.project(q));
      return whole(clip.room(ends));
    }
    if (!(high > low)) return RegionContact::clear;
    size = (high - low) * (q - p).norm();
    for (const double t : {low, high}) {
      const Vec3 x = p + t * (q - p);
      points.add({t * (q - p).norm(), 0}, body.to_shape(x), clip.plane.height(x), 0);
    }
  }
  if (!finish(points, reach, nullptr, out)) return RegionContact::point;
  out->factor = 1;
  store(region.normal, out->normal);
  out->rolling = set.ruled ? 1 : 0;
  return placed(kSlideShare * size);
}

bool make_pair_polygon(const Particle& pa, const Particle& pb, const Vec3& normal, double overlap,
                       double reach, const ContactPolygon* old, ContactPolygon* out, double* clear,
                       const SurfacePoint* starts) {
  *out = {};
  if (clear) *clear = 0;
  if (pa.shape->flats.empty() || pb.shape->flats.empty()) return false;
  const Body a(0, pa, pa.x), b(1, pb, pa.x);
  const double most = overlap + reach;
  const auto contact = [&](int reference, int face) {
    const Body &owner = reference == 0 ? a : b, &other = reference == 0 ? b : a;
    return FaceContact(owner, owner.shape->flats.faces[face], other);
  };
  const Vec3 towards[2] = {a.turned_back(normal), b.turned_back(-normal)};
  const int nearest[2] = {nearest_face(a.shape->flats, towards[0], kFaceCosine),
                          nearest_face(b.shape->flats, towards[1], kFaceCosine)};
  double depth[2] = {kInfinite, kInfinite};  // along the normals of the two faces
  for (int k = 0; k < 2; ++k)
    if (nearest[k] >= 0) depth[k] = contact(k, nearest[k]).depth(most);
  int first = old && old->count > 0 && old->reference == 1 ? 1 : 0;
  if (!(depth[first] <= most) || depth[1 - first] < depth[first] - kReferenceShare * overlap)
    first = 1 - first;

  const auto attempt = [&](int reference, ContactPolygon* polygon, bool* swallowed) {
    return depth[reference] <= most &&
           contact(reference, nearest[reference]).make(overlap, reach, polygon, swallowed);
  };
  bool swallowed = false;
  if (attempt(first, out, &swallowed)) {
    ContactPolygon other = {};
    bool again = false;
    if (swallowed && attempt(1 - first, &other, &again) && !again) *out = other;
    return true;
  }
  if (attempt(1 - first, out, &swallowed)) return true;
  double room = 0;
  const bool rolls = old && old->count == 2 && old->rolling != 0;
  if (line_contact(a, b, normal, overlap, reach, starts, rolls, out, &room)) return true;
  *out = {};
  if (!clear) return false;
  // Other faces may become the nearest ones.
  for (int k = 0; k < 2; ++k) {
    const std::vector<FlatFace>& faces = (k == 0 ? a : b).shape->flats.faces;
    for (int face = 0; face < static_cast<int>(faces.size()) && room > 0; ++face) {
      if (faces[face].normal.dot(towards[k]) < kOtherFaceCosine) continue;
      FaceContact other = contact(k, face);
      const double overlap_of = face == nearest[k] ? depth[k] : other.depth(most);
      room = std::min(room, overlap_of > most ? overlap_of - most : other.room(reach - overlap));
    }
  }
  const double smaller = std::min(a.radius(), b.radius()), larger = std::max(a.radius(), b.radius());
  *clear = kWayShare * std::min(room, kMostRoom * smaller) * smaller / larger;
  return false;
}

namespace {

// One sector of a round face: the mean overlap over its weight (negative), or its least gap if it is open, at
// its centre of pressure (shape axes). gap = base + slope . x for a point x of the incident body.
double sector_gap(const FlatFeatures& flats, int face, int i, double base, const Vec3& slope, Vec3* place,
                  PolygonState* state, double* energy) {
  const FlatFace& f = flats.faces[face];
  const Sector s = sector(i, static_cast<int>(f.outline.size()));
  Vec3 pressed = Vec3::Zero();
  double force = 0, weight = 0, least = kInfinite;
  for (int k = s.first; k < s.last; ++k) {
    const Vec3& x = flats.vertices[f.outline[k]];
    const double gap = base + slope.dot(x), share = f.weight[k] * std::max(0.0, -gap);
    weight += f.weight[k];
    force += share;
    pressed += share * x;
    *energy -= share * std::min(0.0, gap);
    state->most = std::max(state->most, gap);
    if (gap < least) {
      least = gap;
      *place = x;
    }
  }
  state->least = std::min(state->least, least);
  if (!(force > 0)) return least;
  *place = pressed / force;
  return -force / weight;
}

}  // namespace

PolygonState evaluate(const ContactPolygon& polygon, const BodyFrame& a, const BodyFrame& b) {
  PolygonState state;
  state.count = polygon.count;
  const bool a_is_reference = polygon.reference == 0;
  const BodyFrame &reference = a_is_reference ? a : b, &incident = a_is_reference ? b : a;
  const Vec3 outward = reference.axes * load(polygon.normal);
  state.normal = a_is_reference ? outward : Vec3(-outward);
  // Relative to the reference's centre, so that bodies far from the lab's origin keep their digits.
  const Vec3 apart = incident.x - reference.x;
  const double level = reference.scale * polygon.offset;
  state.least = kInfinite;
  state.most = -kInfinite;
  const Vec3 outward_on_incident = incident.scale * (incident.axes.transpose() * outward);
  const double base = outward.dot(apart) - level;
  double energy = 0;
  for (int i = 0; i < polygon.count; ++i) {
    Vec3 place;
    double gap = 0;
    if (polygon.ring > 0) {
      gap = sector_gap(incident.shape->flats, polygon.ring - 1, i, base, outward_on_incident, &place, &state,
                       &energy);
    } else {
      place = load(polygon.point[i]);
      gap = base + outward_on_incident.dot(place);
      const double overlap = std::max(0.0, -gap);
      energy += polygon.weight[i] * overlap * overlap;
      state.least = std::min(state.least, gap);
      state.most = std::max(state.most, gap);
    }
    const Vec3 arm = incident.scale * (incident.axes * place);
    const Vec3 middle = arm - 0.5 * gap * outward;
    state.gap[i] = gap;
    (a_is_reference ? state.arm_b : state.arm_a)[i] = middle;
    (a_is_reference ? state.arm_a : state.arm_b)[i] = middle + apart;
  }
  state.energy = 0.5 * energy;
  if (polygon.count > 0 && polygon.room < kInfinite) {
    const auto lateral = [&](int i, const double* mark) {
      const Vec3 x =
          apart + incident.scale * (incident.axes * load(polygon.point[i])) - reference.axes * load(mark);
      return (x - outward.dot(x) * outward).norm();
    };
    state.slid = 2 * lateral(0, polygon.mark[0]) + lateral(polygon.far, polygon.mark[1]);
  }
  return state;
}

PolygonVerdict judge(const ContactPolygon& polygon, const PolygonState& state) {
  if (!(state.least < 0)) return PolygonVerdict::open;
  if (polygon.rolling != 0 || state.slid > polygon.room) return PolygonVerdict::moved;
  return state.most > 0 || polygon.count == 2 ? PolygonVerdict::tilted : PolygonVerdict::keep;
}

double support_gap(const ContactPolygon& polygon, const Particle* a, const Particle& b, const Vec3& origin) {
  const bool b_is_reference = polygon.reference == 1;
  const Particle& incident = b_is_reference ? *a : b;
  const Particle* reference = b_is_reference ? &b : a;
  Vec3 outward = load(polygon.normal);
  if (reference) outward = reference->q * outward;
  const Vec3 apart = incident.x - (reference ? reference->x : origin);
  const double level = (reference ? reference->scale : 1) * polygon.offset;
  const double h = find_hull_support(*incident.shape, incident.q.conjugate() * -outward).h;
  return outward.dot(apart) - incident.scale * h - level;
}

static double outgrown_below(const PolygonState& state) {
  return state.least + kOutgrownShare * std::min(0.0, state.least);
}

bool outgrown(const PolygonState& state, double support_gap) {
  return support_gap < outgrown_below(state);
}

double still_holds(const PolygonState& state, double support_gap, double radius_a, double radius_b) {
  const double room = support_gap - outgrown_below(state);
  return 0.25 * std::max(0.0, room) * std::min(radius_a, radius_b) / std::max(radius_a, radius_b);
}

double stored_energy(const ContactPolygon& polygon, const PolygonState& state) {
  return polygon.factor * state.energy;
}

double energy_after_rolling(const ContactPolygon& old, const ContactPolygon& polygon,
                            const PolygonState& state) {
  const Vec3 from = load(polygon.point[0]), way = load(polygon.point[1]) - from;
  PolygonState rolled = state;
  rolled.energy = 0;
  for (int i = 0; i < 2; ++i) {
    const double t = (load(old.point[i]) - from).dot(way) / way.squaredNorm();
    const double overlap = std::max(0.0, -(state.gap[0] + t * (state.gap[1] - state.gap[0])));
    rolled.energy += 0.5 * old.weight[i] * overlap * overlap;
  }
  return stored_energy(old, rolled);
}

double continuity_factor(double energy, const ContactPolygon& polygon, const PolygonState& state) {
  ContactPolygon unit = polygon;
  unit.factor = 1;
  const double full = stored_energy(unit, state);
  return energy > 0 && full > 0 ? energy / full : 1;
}

double relax(ContactPolygon& polygon, const PolygonState& state, double share) {
  const double before = stored_energy(polygon, state);
  polygon.factor += share * (1 - polygon.factor);
  return stored_energy(polygon, state) - before;
}

void match(const ContactPolygon& old_polygon, const PolygonState& old_state,
           const ContactPolygon& new_polygon, const PolygonState& new_state, int* source) {
  for (int i = 0; i < new_polygon.count; ++i) {
    source[i] = -1;
    double least = kInfinite;
    for (int j = 0; j < old_polygon.count; ++j) {
      if (new_polygon.id[i] != 0 && new_polygon.id[i] == old_polygon.id[j]) {
        source[i] = j;
        break;
      }
      const double d = (new_state.arm_a[i] - old_state.arm_a[j]).squaredNorm();
      if (d < least) least = d, source[i] = j;
    }
  }
}

}  // namespace nurbs

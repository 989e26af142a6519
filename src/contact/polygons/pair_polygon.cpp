// Polygons of two bodies: a face of one clips what the other has opposite, or two lines share a segment.
#include <cmath>

#include "body/local_form.h"
#include "contact/polygons/polygon_points.h"

namespace nurbs {
namespace {

using namespace polygon;

constexpr double kFaceCosine = 0.5;  // a face further than 60 degrees from the contact's normal is not asked
constexpr double kOtherFaceCosine = 0.3;  // nor may one further than 72 degrees soon be
constexpr double kLineAngle = 0.8;        // rad, the same for the normal of a ruled line
// A face's normal is the contact's to 8 degrees, or its overlap along that is hardly more than the least.
constexpr double kSameWay = 0.99, kOtherWay = 1.1;
// Of the deepest place over a face, that a new and an old polygon on it must have at least.
constexpr double kNewDepth = 0.5, kKeptDepth = 0.25;
constexpr double kPairShare = 0.5;    // as kWayShare, where the overlap's growth counts by itself
constexpr double kSameLength = 1e-6;  // of the bounding radius: lines as long
constexpr double kBeside = 0.01, kKeptBeside = 0.02;  // of the overlap, that lines beside each other may lack
constexpr double kMostAcross = 0.1;  // rad: one step of the search for the least overlap across lines
constexpr int kAcrossSteps = 12;     // of them; 2 to 3 are usual

// How far a pair may go before `d`, which a body's support point is along, may come so near to square to a
// ruled line, `lag` behind the support, that it lags by `most`: before that no such line supports the body.
// Relative turns are ways, at the smaller radius at least; of those of the normal each takes kClearTurn of
// it.
double turn_room(const Body& body, const SurfacePoint& where, const Vec3& d, double lag, double most,
                 double smaller) {
  constexpr double kMostTurn = 0.3;
  if (!(lag > most)) return 0;
  const double turn = std::min(kMostTurn, turn_to_ruled_line(*body.shape, where, d));
  return (1 - most / lag) * turn * smaller / (kPairShare * (1 + 1 / kClearTurn));
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
    const double h = find_feature_top(shape, down()).h;
    return plane_.level - (plane_.normal.dot(incident_.frame.x - plane_.origin) - incident_.frame.scale * h);
  }

  // How far all points of both bodies may go while something of whatever may lie over the reference face is
  // sure to be higher than `most`, so that make() fails, or to lean too far for `reach`; 0 where that is not
  // seen.
  double room(double most, double reach) {
    const Opposite o = opposite();
    double least = face_room(o, most);
    if (least == 0) least = shared_room(o, most);
    for (const StraightEdge& edge : incident_.shape->flats.edges) {
      if (!(least > 0)) return 0;
      least = std::min(least,
                       segment_room({incident_.vertex(edge.ends[0]), incident_.vertex(edge.ends[1])}, most));
    }
    if (!(least > 0)) return 0;
    RuledLine line;
    Support support;
    if (!incident_line(&line, &support)) return least;
    double of_line = segment_room(line.ends, most);
    if (of_line == 0)
      of_line = turn_room(incident_, support.where, down(), lean_of(line, support), kLeaning * reach,
                          std::min(reference_.radius(), incident_.radius()));
    return std::min(least, of_line);
  }

  // `depth`: overlap along the face's normal; `kept`: share of what lies deepest over the face that its
  // points must have. `swallowed`: the reference face lies inside the incident one.
  bool make(double overlap, double reach, double depth, double kept, ContactPolygon* out, bool* swallowed) {
    *swallowed = false;
    const double most = reach - overlap;
    if (!face_points(most, swallowed) || !bears_deepest(kept, overlap, depth)) {
      *swallowed = false;
      ring_ = -1;
      if (!crease_points(overlap, most) && !line_points(overlap, reach)) return false;
    }
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
    if (o.face < 0) return kInfinity;
    const FlatFace& face = incident_.shape->flats.faces[o.face];
    const Vec2 middle = plane_.project(reference_.place(face_.centroid)),
               other = plane_.project(incident_.place(face.centroid));
    double best =
        (middle - other).norm() - reference_.frame.scale * face_.radius - incident_.frame.scale * face.radius;
    if (best > 0) return best;
    best = 0;
    for (const double t : {0.0, 0.5, 1.0})
      best = std::max(best, room_at(o, middle + t * (other - middle), most, best));
    return best;
  }
  // How far inside both outlines, and above `most`, a place is; `best` where it can't be more.
  double room_at(const Opposite& o, const Vec2& at, double most, double best) const {
    const double over = height(o, at), high = over - most;
    return high > best ? std::min({high, inside_reference(at), inside(o, at, over)}) : best;
  }
  // The same from the part that the outlines share: on the way from its highest corner to its middle.
  double shared_room(const Opposite& o, double most) const {
    const ConvexPolygon cut = shared(o);
    if (cut.count < 3) return 0;
    int highest = 0;
    for (int i = 1; i < cut.count; ++i)
      if (height(o, cut.corner[i]) > height(o, cut.corner[highest])) highest = i;
    const Vec2 from = cut.corner[highest], to = polygon_centroid(cut);
    double best = 0;
    for (const double t : {0.1, 0.3, 0.6})
      best = std::max(best, room_at(o, from + t * (to - from), most, best));
    return best;
  }
  ConvexPolygon shared(const Opposite& o) const {
    const FlatFace& face = incident_.shape->flats.faces[o.face];
    ConvexPolygon outline;
    for (int i = 0; i < static_cast<int>(face.outline.size()); ++i)
      outline.add(plane_.project(incident_.place(incident_.vertex(vertex(face, i)))));
    return intersect(outline, window(), slack_);
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
    const ConvexPolygon cut = shared(o);
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

  // Whether the face's points are as deep as what else of the incident body lies over the reference face:
  // where that leans, a rounded edge may be deeper; and as deep as the bodies overlap.
  bool bears_deepest(double kept, double overlap, double depth) const {
    const double deepest = *std::min_element(points_.gap, points_.gap + points_.plane.count);
    if (deepest <= -kept * depth) return true;
    if (deepest > -kept * overlap) return false;
    const Support top = find_feature_top(*incident_.shape, down());
    return inside_reference(plane_.project(incident_.place(top.point))) < 0;
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

  bool crease_points(double overlap, double most) {
    bool found = false;
    for (const StraightEdge& edge : incident_.shape->flats.edges) {
      Candidates other;
      bool uncut = false;
      if (!segment({incident_.vertex(edge.ends[0]), incident_.vertex(edge.ends[1])}, edge.ends, most, &other,
                   &uncut) ||
          !other.bears(overlap))
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
  bool incident_line(RuledLine* line, Support* support) const {
    const Shape& shape = *incident_.shape;
    if (shape.flats.ruling.empty()) return false;
    *support = find_feature_top(shape, down());
    return ruled_line(shape, support->where, down(), kLineAngle, line);
  }

  // By how much it lags behind that, a length.
  double lean_of(const RuledLine& line, const Support& support) const {
    return incident_.frame.scale * lean(*incident_.shape, down(), support.point, line.ends[0], line.ends[1]);
  }

  bool line_points(double overlap, double reach) {
    RuledLine line;
    Support support;
    if (!incident_line(&line, &support) || lean_of(line, support) > kLeaning * reach ||
        !segment(line.ends, {-1, -1}, reach - overlap, &points_, &whole_) || !points_.bears(overlap))
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
  SurfacePoint where;  // the support it was found by
};

// A crease or ruled line that supports the body in lab direction d, to `tolerance`. `room`, where there is
// none: how far the pair may go before there may be.
bool support_line(const Body& body, const Vec3& d, double tolerance, double smaller, Line* line,
                  double* room) {
  const Vec3 on_body = body.turned_back(d);
  const SupportSet set = support_set(*body.shape, on_body, tolerance / body.frame.scale);
  const double most = kLeaning * tolerance,
               lag = set.count == 2 && set.ruled ? body.frame.scale * lean(*body.shape, on_body, set.support,
                                                                           set.point[0], set.point[1])
                                                 : kInfinity;
  if (set.count != 2 || (set.ruled && lag > most)) {
    *room = body.shape->flats.edges.empty() && set.face < 0
                ? turn_room(body, set.where, on_body, lag, most, smaller)
                : 0;
    return false;
  }
  for (int i = 0; i < 2; ++i) {
    line->ends[i] = body.place(set.point[i]);
    line->vertex[i] = set.vertex[i];
  }
  line->ruled = set.ruled;
  line->where = set.where;
  return true;
}

// Of a body's side across a line of it, lab; 0 of a crease.
double radius_across(const Body& body, const Line& line, const Vec3& across) {
  if (!line.ruled) return 0;
  if (!has_patch(*body.shape, line.where)) return body.radius();
  const BezierPatch& patch = body.shape->patches[line.where.patch];
  const double bend =
      normal_curvature(local_form(patch, line.where.u, line.where.v), body.turned_back(across));
  return bend > 0 ? body.frame.scale / bend : kInfinity;
}

// Two lines: the reference plane goes through A's, as square to the contact's normal as it can.
struct LinePair {
  Line a, b;
  ReferencePlane plane;
  double length;  // of A's
  Vec2 p, q;      // ends of B's in the plane, along A's line and sideways

  const Vec2& end(int i) const { return i == 0 ? p : q; }
  // Where B's line is cut at its end `i`, 0 there, as it reaches past A's; 1 and more if all of it does.
  double cut(int i) const {
    const double from = end(i)[0], at = std::clamp(from, 0.0, length);
    return at == from ? 0 : (at - from) / (end(1 - i)[0] - from);
  }
  // Sideways from A's line, at most, where they lie beside each other.
  double aside() const {
    double most = 0;
    for (int i = 0; i < 2; ++i) {
      const double t = std::clamp(cut(i), 0.0, 1.0);
      most = std::max(most, std::abs(end(i)[1] + t * (end(1 - i)[1] - end(i)[1])));
    }
    return most;
  }
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
    const Vec3 e = along(angle), x = a.place(find_feature_top(*a.shape, a.turned_back(e)).point),
               y = b.place(find_feature_top(*b.shape, b.turned_back(-e)).point);
    return (x - y).dot(u.cross(e));
  };
  double last = 0, at_last = slope(last), angle = std::clamp(-at_last / size, -kMostAcross, kMostAcross);
  double low = at_last < 0 ? 0 : -kInfinity, high = at_last > 0 ? 0 : kInfinity;
  for (int k = 0; k < kAcrossSteps && angle != last; ++k) {
    const double here = slope(angle);
    (here < 0 ? low : high) = angle;
    if (std::abs(here) <= kRoundoff * size) break;
    const double rate = (here - at_last) / (angle - last);
    double next = rate > 0 ? angle - here / rate : angle - std::copysign(kMostAcross, here);
    next = std::clamp(next, angle - kMostAcross, angle + kMostAcross);
    if (!(next > low && next < high)) {
      if (!(high - low < kInfinity)) break;
      next = 0.5 * (low + high);
    }
    last = angle;
    at_last = here;
    angle = next;
  }
  return along(angle);
}

// Whether both bodies have a feature that lags no more than `reach` behind their support; `room`, where they
// have none: how far the pair may go before they may. `longest`: of B if the ruled line at its support is
// longer than A's, else of A.
bool may_share_line(const Body& a, const Body& b, const Vec3& d, double reach, const SurfacePoint* starts,
                    double* room, int* longest) {
  const auto has_lines = [](const Body& body) {
    return !body.shape->flats.edges.empty() || !body.shape->flats.ruling.empty();
  };
  *room = kInfinity;
  if (!has_lines(a) || !has_lines(b)) return false;
  double length[2] = {0, 0};
  for (const Body* body : {&a, &b}) {
    const Vec3 on_body = body->turned_back(body->index == 0 ? d : Vec3(-d));
    const Support top = find_feature_top(*body->shape, on_body, starts ? &starts[body->index] : nullptr);
    *room = body->frame.scale * feature_lag(*body->shape, on_body, top.h, top.where) - reach;
    if (*room > 0) return false;
    RuledLine line;
    if (!body->shape->flats.ruling.empty() && ruled_line(*body->shape, top.where, on_body, kLineAngle, &line))
      length[body->index] = body->frame.scale * (line.ends[1] - line.ends[0]).norm();
  }
  *longest = length[1] > length[0] + kSameLength * a.radius() ? 1 : 0;
  return true;
}

// Two parallel lines; ruled ones in the plane across which the bodies overlap least. A is the reference here:
// the body with the longer line, whatever its index, for the shorter one is beside it all along. `room`,
// where there are none: how far points may go before there may be. `rolls`: they were so before, and the
// normal has turned with A, not to where the lines have gone.
bool line_contact(const Body& a, const Body& b, Vec3 d, double overlap, double reach, bool rolls,
                  ContactPolygon* out, double* room) {
  *room = 0;
  const double smaller = std::min(a.radius(), b.radius());
  Line on_a, on_b;
  if (!support_line(a, d, reach, smaller, &on_a, room)) return false;
  const auto to_least = [&] {
    d = least_across(a, b, (on_a.ends[1] - on_a.ends[0]).normalized(), d);
    return support_line(a, d, reach, smaller, &on_a, room);
  };
  if (rolls && !to_least()) return false;
  if (!support_line(b, -d, reach, smaller, &on_b, room)) return false;
  if (!rolls && (on_a.ruled || on_b.ruled) &&
      (!to_least() || !support_line(b, -d, reach, smaller, &on_b, room)))
    return false;
  const LinePair lines = pair_of(on_a, on_b, d);
  const ReferencePlane& plane = lines.plane;
  // Lines further apart sideways than this touch at one point. Where they are, round sides overlap by less:
  // s apart by s^2 / 2 (R_A + R_B).
  const double round = radius_across(a, on_a, plane.v) + radius_across(b, on_b, plane.v),
               lost = (rolls ? kKeptBeside : kBeside) * overlap,
               most = round > 0 ? std::min(reach, std::sqrt(2 * round * lost)) : reach;
  if (lines.aside() > most) {
    *room = 0.5 * (lines.aside() - most);
    return false;
  }
  Candidates points;
  for (int i = 0; i < 2; ++i) {
    const double t = lines.cut(i);
    if (!(t >= 0 && t < 1)) return false;
    const Vec3 x = on_b.ends[i] + t * (on_b.ends[1 - i] - on_b.ends[i]);
    points.add(plane.project(x), b.to_shape(x), plane.height(x),
               t > 0 ? vertex_id(a.index, on_a.vertex[lines.end(i)[0] > 0 ? 1 : 0])
                     : vertex_id(b.index, on_b.vertex[i]));
  }
  if (!points.within(reach - overlap) || !points.bears(overlap) || !finish(points, reach, nullptr, out))
    return false;
  out->reference = a.index;
  out->factor = 1;
  const Vec3 local = a.turned_back(plane.normal);
  store(local, out->normal);
  out->offset = local.dot(a.to_shape(on_a.ends[0]));
  set_marks(a.frame, b.frame, out);
  out->rolling = on_a.ruled || on_b.ruled ? 1 : 0;
  out->room = kSlideShare * lines.length;
  return true;
}

}  // namespace

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
  double depth[2] = {kInfinity, kInfinity};  // along the normals of the two faces
  for (int k = 0; k < 2; ++k)
    if (nearest[k] >= 0) depth[k] = contact(k, nearest[k]).depth(most);
  int first = old && old->count > 0 && old->reference == 1 ? 1 : 0;
  if (!(depth[first] <= most) || depth[1 - first] < depth[first] - kReferenceShare * overlap)
    first = 1 - first;

  const double other_way = old ? 0 : kOtherWay * overlap;
  const auto may_serve = [&](int k) {
    return depth[k] <= other_way ||
           (depth[k] <= most &&
            (k == 0 ? a : b).shape->flats.faces[nearest[k]].normal.dot(towards[k]) >= kSameWay);
  };
  const auto attempt = [&](int reference, ContactPolygon* polygon, bool* swallowed) {
    return nearest[reference] >= 0 && may_serve(reference) &&
           contact(reference, nearest[reference])
               .make(overlap, reach, depth[reference], old ? kKeptDepth : kNewDepth, polygon, swallowed);
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
  int reference = 0;
  if (may_share_line(a, b, normal, reach, starts, &room, &reference)) {
    const bool rolls = old && old->count == 2 && old->rolling != 0;
    if (rolls) reference = old->reference;
    const bool found = reference == 0 ? line_contact(a, b, normal, overlap, reach, rolls, out, &room)
                                      : line_contact(b, a, -normal, overlap, reach, rolls, out, &room);
    if (found) return true;
  }
  *out = {};
  if (!clear) return false;
  // Other faces may become the nearest ones.
  for (int k = 0; k < 2; ++k) {
    const std::vector<FlatFace>& faces = (k == 0 ? a : b).shape->flats.faces;
    for (int face = 0; face < static_cast<int>(faces.size()) && room > 0; ++face) {
      if (faces[face].normal.dot(towards[k]) < kOtherFaceCosine) continue;
      FaceContact other = contact(k, face);
      const double overlap_of = face == nearest[k] ? depth[k] : other.depth(most);
      room = std::min(room, overlap_of > most ? overlap_of - most : other.room(reach - overlap, reach));
    }
  }
  const double smaller = std::min(a.radius(), b.radius()), larger = std::max(a.radius(), b.radius());
  *clear = kPairShare * std::min(room, kMostRoom * smaller) * smaller / larger;
  return false;
}

}  // namespace nurbs

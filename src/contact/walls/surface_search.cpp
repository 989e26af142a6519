// See surface_search.h.
#include "contact/walls/surface_search.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

constexpr int kFewCells = 4;             // of a plane, up to which each is looked at on its own
constexpr double kOneSlope = 0.8;        // cosine
constexpr double kSamePlane = 1 - 1e-6;  // cosine: a former contact's polygon stood on this plane
constexpr double kBluntest = 0.5;        // of the curvature radius: deeper overlaps find the body sharp
constexpr double kSameNormal = 0.9;      // cosine: a former contact this near has a start for the search

// A plane that the body overlaps.
struct ActivePlane {
  bool active = false;
  bool claimed = false;  // by a flat feature
  bool stands = false;   // its polygon of the last step bears all over
  Vec3 normal;           // towards the body
  Vec3 deepest;          // the body's point, relative to its centre
  ContactResult result;
  PairMemory memory;
  int contact = -1;  // of what was found
};

// An edge as the body meets it.
struct MetEdge {
  enum State { unmet, unknown, clear, along, before, beyond } state = unmet;  // beyond: past v[1]
  int contact = -1;
};

// From the point of an edge that is nearest to x.
Vec3 from_edge(const MeshPatch& patch, const MeshPatch::Edge& e, const Vec3& x) {
  const Vec3 apart = x - patch.vertices()[e.v[0]].x;
  return apart - std::clamp(apart.dot(e.direction), 0.0, e.length) * e.direction;
}

// An edge as a piece of a line.
struct Stretch {
  int edge;
  double from, to;
};

// Room that is used again by every search of a thread.
struct Workspace {
  std::vector<ActivePlane> planes;
  std::vector<MetEdge> edges;
  std::vector<int> active;
  std::vector<Stretch> line;
  std::vector<Vec3> corners;
};
Workspace& workspace() {
  static thread_local Workspace w;
  return w;
}

class SurfaceSearch {
 public:
  SurfaceSearch(const Particle& particle, MeshPatch& patch, const ContactSettings& settings, double path,
                const FormerContact* former, int former_count, SurfaceContacts* out)
      : particle_(particle),
        patch_(patch),
        settings_(settings),
        path_(path),
        radius_(particle.scale * particle.shape->bounding_radius),
        former_(former),
        former_count_(former_count),
        out_(*out),
        planes_(workspace().planes),
        edges_(workspace().edges) {}

  void run() {
    out_.count = 0;
    out_.full = false;
    std::vector<int>& active = workspace().active;
    active.clear();
    planes_.resize(std::max(planes_.size(), patch_.planes().size()));
    out_.expiry = kFarAway;
    for (std::size_t p = 0; p < patch_.planes().size(); ++p) {
      if (look_at_plane(static_cast<int>(p))) active.push_back(static_cast<int>(p));
      out_.expiry = std::min(out_.expiry, patch_.planes()[p].expiry);
    }
    if (active.empty()) return;
    for (const int p : active) {
      planes_[p].claimed = !particle_.shape->flats.empty() && stand_on(p);
      if (!planes_[p].claimed) touch_face(p);
    }
    // Edges and vertices belong to several planes: each is met with the first.
    if (edges_.size() < patch_.edges().size()) edges_.resize(patch_.edges().size());
    for (const int p : active) {
      const MeshPatch::Plane& plane = patch_.planes()[p];
      for (int i = 0; i < plane.edges; ++i) edges_[patch_.edge_in(plane.first_edge + i)] = MetEdge{};
    }
    for (const int p : active) {
      const MeshPatch::Plane& plane = patch_.planes()[p];
      for (int i = 0; i < plane.edges; ++i) {
        const int e = patch_.edge_in(plane.first_edge + i);
        if (edges_[e].state == MetEdge::unmet) touch_edge(e);
      }
    }
    for (const int p : active) {
      const MeshPatch::Plane& plane = patch_.planes()[p];
      for (int i = 0; i < plane.vertices; ++i) {
        const int v = patch_.vertex_in(plane.first_vertex + i);
        if (first_plane_of(patch_.vertices()[v]) == p) touch_vertex(v);
      }
    }
    leave_out_dropped();
    if (out_.count > 0) out_.expiry = -kFarAway;
  }

 private:
  const PairMemory* start_for(const Vec3& normal) const {
    const PairMemory* best = nullptr;
    double most = kSameNormal;
    for (int k = 0; k < former_count_; ++k) {
      const double cosine = former_[k].normal.dot(normal);
      if (cosine > most) most = cosine, best = former_[k].memory;
    }
    return best;
  }
  const SurfacePoint* point_for(const Vec3& normal, SurfacePoint* point) const {
    const PairMemory* memory = start_for(normal);
    if (!memory || !(memory->on_b.patch >= 0)) return nullptr;
    *point = surface_point(memory->on_b);
    return point;
  }

  // The deepest point of a polygon that overlaps the plane.
  static bool deepest_point(const PolygonState& state, double* gap, Vec3* on_body) {
    *gap = 0;
    for (int k = 0; k < state.count; ++k)
      if (state.gap[k] < *gap) {
        *gap = state.gap[k];
        *on_body = state.arm_b[k] + 0.5 * state.gap[k] * state.normal;
      }
    return *gap < 0;
  }

  // Whether a polygon over the region overlaps it, and its deepest point.
  bool polygon_over(const PlaneRegion& region, double reach, double* gap, Vec3* on_body,
                    double* clear = nullptr) const {
    ContactPolygon polygon;
    if (make_region_polygon(particle_, region, particle_.x, reach, &polygon, clear) != RegionContact::polygon)
      return false;
    const PolygonState state = evaluate(polygon, plane_frame(particle_.x), body_frame(particle_));
    return deepest_point(state, gap, on_body);
  }

  // Whether a polygon of the last step stands on the plane and has the body's deepest point, so that no
  // search is needed: with all the points of a face, as long as it is known to, or, to be remade, on a line
  // that rolls.
  bool stands_on(const MeshPatch::Plane& plane, ActivePlane* met) const {
    for (int k = 0; k < former_count_; ++k) {
      const FormerContact& f = former_[k];
      if (!f.polygon || !(f.normal.dot(met->normal) > kSamePlane)) continue;
      ContactPolygon polygon = *f.polygon;
      for (int i = 0; i < 3; ++i) polygon.normal[i] = met->normal[i];
      polygon.offset = met->normal.dot(plane.origin - f.frame);  // it may have moved, or stand back
      const PolygonState state = evaluate(polygon, plane_frame(f.frame), body_frame(particle_));
      const PolygonVerdict verdict = judge(polygon, state);
      const bool bears =
          verdict == PolygonVerdict::keep || (verdict == PolygonVerdict::tilted && path_ < f.until) ||
          (verdict == PolygonVerdict::moved && polygon.rolling != 0 && state.slid <= polygon.room);
      if (!bears) continue;
      if (std::abs(polygon.offset - f.polygon->offset) > -state.least) continue;  // another plane
      met->result = ContactResult{};
      met->result.status = Status::converged;
      met->result.rung = Rung::local_model;
      met->memory = *f.memory;
      met->memory.proof.contact = 1;
      return deepest_point(state, &met->result.gap, &met->deepest);
    }
    return false;
  }

  // Whether a flat feature of the body stands on the plane, over a part of it that is wall.
  bool stand_on(int number) {
    const ActivePlane& met = planes_[number];
    bool stands = met.stands;
    for (int k = 0; k < former_count_ && !stands; ++k)
      stands = former_[k].flat && former_[k].normal.dot(met.normal) > kSamePlane;
    const bool unbounded = patch_.unbounded(), over = met.stands || unbounded || cell_below(number) >= 0;
    const int triangle = unbounded ? 0 : patch_.planes()[number].leader;
    if (!stands) {
      // Where several planes of about one slope are met, the surface is bent under the body, and its features
      // stand on points.
      for (const int other : workspace().active)
        if (other != number && planes_[other].normal.dot(met.normal) > kOneSlope) return false;
    }
    if (!stands || !over) {
      MeshPatch::Plane& plane = patch_.planes()[number];
      if (!stands &&
          path_ + kClearTurn * radius_ * (met.normal - plane.pointed_normal).norm() < plane.pointed)
        return false;
      const PlaneRegion region = plane_region(patch_, number, particle_.x);
      const double reach = stands ? kKeptReach : kReach;
      double gap = 0, clear = 0;
      Vec3 on_body = Vec3::Zero();
      if (!polygon_over(region, -reach * met.result.gap, &gap, &on_body, &clear)) {
        plane.pointed = stands ? -kFarAway : path_ + clear;
        plane.pointed_normal = met.normal;
        return false;
      }
      if (!over) {  // the plane's deepest point is beside the wall; the polygon's is on it
        if (!polygon_over(region, -reach * gap, &gap, &on_body)) return false;
        return add_plane(number, triangle, true, gap, on_body);
      }
    }
    return add_plane(number, triangle, true, met.result.gap, met.deepest);
  }

  bool stood_on(const Vec3& normal) const {
    for (int k = 0; k < former_count_; ++k)
      if (former_[k].normal.dot(normal) > kSamePlane) return true;
    return false;
  }

  // Lower bound of the gap to the cells of a plane: along the line from the point of a cell that is nearest
  // to the body's centre, by the atlas.
  double clearance(const MeshPatch::Plane& plane) const {
    double least = kFarAway;
    for (int i = 0; i < plane.cells && least > 0; ++i) {
      const Vec3 way = particle_.x - nearest(patch_.cells()[patch_.cell_in(plane.first + i)], plane);
      const double distance = way.norm();
      if (!(distance > 0)) return 0;
      const double sphere = distance - radius_;
      if (sphere > 0) {
        least = std::min(least, sphere);
        continue;
      }
      const double h =
          particle_.scale * particle_.shape->atlas.support_upper(particle_.q.conjugate() * (-way / distance));
      least = std::min(least, distance - h - kRoundoff * radius_);
    }
    return least;
  }
  // The point of a cell that is nearest to the body's centre.
  Vec3 nearest(const MeshPatch::Cell& cell, const MeshPatch::Plane& plane) const {
    const Vec3& c = particle_.x;
    bool inside = true;
    double least2 = kFarAway;
    Vec3 best = Vec3::Zero();
    for (int k = 0; k < cell.corners; ++k) {
      const MeshPatch::Edge& e = patch_.edges()[patch_.edge_of(cell.first + k)];
      const Vec3& a = patch_.vertices()[e.v[0]].x;
      const Vec3 off = c - a;
      if (patch_.sign_of(cell.first + k) * plane.normal.cross(e.direction).dot(off) >= 0) continue;
      inside = false;
      const Vec3 y = a + std::clamp(e.direction.dot(off), 0.0, e.length) * e.direction;
      if ((c - y).squaredNorm() < least2) least2 = (c - y).squaredNorm(), best = y;
    }
    return inside ? Vec3(c - plane.normal.dot(c - plane.origin) * plane.normal) : best;
  }

  // The ladder of a plane; true if the body overlaps it.
  bool look_at_plane(int number) {
    MeshPatch::Plane& plane = patch_.planes()[number];
    ActivePlane& met = planes_[number];
    met.active = met.stands = met.claimed = false;
    met.contact = -1;
    if (path_ < plane.expiry) return false;
    const double height = plane.normal.dot(particle_.x - plane.origin);
    if (std::abs(height) > radius_) {
      plane.expiry = path_ + (1 - 1e-12) * (std::abs(height) - radius_);
      return false;
    }
    met.normal = height < 0 ? Vec3(-plane.normal) : plane.normal;
    if (stands_on(plane, &met)) return met.active = met.stands = true;
    // A corner that came under a cell from beside it need not meet the cell itself, but stays its contact.
    if (plane.cells > 0 && plane.cells <= kFewCells && !(edged(*particle_.shape) && stood_on(met.normal))) {
      const double clear = clearance(plane);
      if (clear > 0) {
        plane.expiry = path_ + (1 - 1e-12) * clear;
        return false;
      }
    }
    PairMemory& memory = met.memory;
    if (const PairMemory* from = start_for(met.normal)) {
      memory = *from;
      const std::uint64_t name = pair_stamp(stamp(met.normal), stamp(particle_), Solver::ladder);
      if (memory.proof.stamp != name) {  // another plane: only where to start is worth keeping
        memory.proof.stamp = name;
        drop_proof(&memory.proof);
        drop_model(&memory.model);
      }
      memory.proof.contact = 1;
    } else {
      memory = PairMemory{};
    }
    met.result = find_plane_contact(particle_, plane.origin, met.normal, settings_,
                                    reinterpret_cast<double*>(&memory));
    const ContactResult& r = met.result;
    if (r.status == Status::separated || !(r.gap < 0)) {
      if (r.lower > 0) plane.expiry = path_ + (1 - 1e-12) * r.lower;
      return false;
    }
    met.deepest = r.point_b;
    met.active = true;
    return true;
  }

  // How far the plane's deepest point of the body is on the side of an edge to which `sign` belongs.
  double inside(const ActivePlane& met, const MeshPatch::Plane& plane, const MeshPatch::Edge& e) const {
    const Vec3 x = particle_.x - patch_.vertices()[e.v[0]].x + met.deepest;
    return plane.normal.cross(e.direction).dot(x);
  }
  // Whether a cell has the deepest point. Borders of the plane are no part of it, cuts within it are.
  bool holds(int number, const ActivePlane& met) const {
    const MeshPatch::Cell& cell = patch_.cells()[number];
    const MeshPatch::Plane& plane = patch_.planes()[cell.plane];
    for (int k = 0; k < cell.corners; ++k) {
      const int edge = patch_.edge_of(cell.first + k);
      const MeshPatch::Edge& e = patch_.edges()[edge];
      const double s = patch_.sign_of(cell.first + k) * inside(met, plane, e);
      if (!(e.inner ? s >= 0 : s > 0)) return false;
    }
    return true;
  }

  // The cell that has the plane's deepest point, or -1; the one that had it in the last step has it mostly
  // again.
  int cell_below(int number) {
    MeshPatch::Plane& plane = patch_.planes()[number];
    for (int i = -1; i < plane.cells; ++i) {
      const int cell = i < 0 ? plane.hint : patch_.cell_in(plane.first + i);
      if (!holds(cell, planes_[number])) continue;
      plane.hint = cell;
      return cell;
    }
    return -1;
  }

  // Whether a point is above, or below, a cell of a plane.
  bool is_over(int number, const Vec3& x) const {
    const MeshPatch::Plane& plane = patch_.planes()[number];
    for (int i = 0; i < plane.cells; ++i)
      if (in_cell(patch_.cells()[patch_.cell_in(plane.first + i)], x)) return true;
    return false;
  }
  bool in_cell(const MeshPatch::Cell& cell, const Vec3& x) const {
    const Vec3& normal = patch_.planes()[cell.plane].normal;
    for (int k = cell.first; k < cell.first + cell.corners; ++k) {
      const MeshPatch::Edge& e = patch_.edges()[patch_.edge_of(k)];
      const double s = normal.cross(e.direction).dot(x - patch_.vertices()[e.v[0]].x);
      if (!(patch_.sign_of(k) * s > -kWithin * radius_)) return false;
    }
    return true;
  }

  void touch_face(int number) {
    const ActivePlane& met = planes_[number];
    const int cell = patch_.unbounded() ? -1 : cell_below(number);
    if (!patch_.unbounded() && cell < 0) return;
    add_plane(number, cell < 0 ? 0 : patch_.cells()[cell].triangle, false, met.result.gap, met.deepest);
  }

  // Whether the deepest point of a body is over a face that the body does not meet: it may be on the other
  // side of the plane, as the body passes by the face's border.
  bool passes_by(int number, const Vec3& deepest, double gap) const {
    if (patch_.unbounded() || !finds_sharp(gap)) return false;
    // Of the line from the centre to the deepest point, all of which the body has, the point in the plane.
    const double slope = planes_[number].normal.dot(-deepest);
    if (slope > 0 && is_over(number, particle_.x + deepest + gap / slope * deepest)) return false;
    const MeshPatch::Plane& plane = patch_.planes()[number];
    for (int i = 0; i < plane.cells; ++i) {
      const MeshPatch::Cell& cell = patch_.cells()[patch_.cell_in(plane.first + i)];
      if (!in_cell(cell, particle_.x + deepest)) continue;
      std::vector<Vec3>& corners = workspace().corners;
      corners.clear();
      for (int k = cell.first; k < cell.first + cell.corners; ++k)
        corners.push_back(patch_.vertices()[patch_.corner(k)].x);
      if (!is_clear_of(particle_, corners.data(), cell.corners)) return false;
    }
    return true;
  }

  bool add_plane(int number, int triangle, bool flat, double gap, const Vec3& on_body) {
    ActivePlane& met = planes_[number];
    if (passes_by(number, on_body, gap)) return false;
    SurfaceContact c;
    c.flat = flat;
    c.gap = gap;
    c.normal = met.normal;
    c.on_body = on_body;
    c.triangle = triangle;
    c.plane = number;
    c.of[0] = patch_.unbounded() ? 0 : patch_.planes()[number].leader;
    c.rung = met.result.rung;
    c.iterations = met.result.iterations;
    c.converged = met.result.status == Status::converged;
    c.memory = met.memory;
    met.contact = add(c);
    return true;
  }

  // Number of the contact, -1 where there is no more room.
  int add(const SurfaceContact& c) {
    if (out_.count < kSurfaceContacts) dropped_[out_.count] = false;
    out_.add(c);
    return out_.full ? -1 : out_.count - 1;
  }
  void leave_out_dropped() {
    int kept = 0;
    for (int i = 0; i < out_.count; ++i) {
      if (dropped_[i]) continue;
      if (kept < i) out_.contact[kept] = out_.contact[i];
      ++kept;
    }
    out_.count = kept;
  }

  // --- edges and vertices that stand out, against bodies sharper than their overlap with a plane is deep
  //
  // There the heights have several maxima, and a face may have the deepest point of a body that is behind its
  // plane by all its size and over its border by next to nothing. The wall about a convex edge or vertex is a
  // wedge or a cone, and the way out of it is the shortest along any normal that it has there. A contact with
  // a piece of it that is deeper than that is none.

  // Whether a body is too sharp for its overlap with the planes to have one maximum over directions.
  bool finds_sharp(double gap) const {
    const Shape& shape = *particle_.shape;
    return edged(shape) || -gap > kBluntest * particle_.scale * shape.curvature.min_radius;
  }

  // What the faces about a vertex make: a convex cone that has the body's centre outside or inside, or
  // something else.
  enum class Cone { outside, around, other };
  Cone cone_at(int number) const {
    const MeshPatch::Vertex& v = patch_.vertices()[number];
    bool outside = false;
    for (int i = 0; i < v.cells; ++i) {
      const Vec3& n = patch_.planes()[patch_.cells()[patch_.cell_at(v.first_cell + i)].plane].normal;
      double low = 0, high = 0;
      for (int k = 0; k < v.edges; ++k) {
        const MeshPatch::Edge& e = patch_.edges()[patch_.edge_at(v.first_edge + k)];
        if (e.sides != 2) return Cone::other;
        const double height = (e.v[0] == number ? 1 : -1) * n.dot(e.direction);
        low = std::min(low, height);
        high = std::max(high, height);
      }
      if (std::min(-low, high) > kOneSide) return Cone::other;
      const double off = n.dot(particle_.x - v.x);
      outside = outside || (high > -low ? off < 0 : off > 0);
    }
    return outside ? Cone::outside : Cone::around;
  }

  // The normals of the wall at an edge that stands out towards the body: from one face's to the other's,
  // whatever side of the planes the body's centre is on; at a border, the half turn from one side to the
  // other. False at an edge that does not.
  bool outer_arc(const MeshPatch::Edge& e, Arc* arc) const {
    if (e.inner || e.sides > 2) return false;
    Vec3 inward[2], normal[2];
    for (int i = 0; i < e.sides; ++i) {
      normal[i] = patch_.planes()[plane_of(e, i)].normal;
      inward[i] = into(e, i);
    }
    const Vec3 off = particle_.x - patch_.vertices()[e.v[0]].x;
    if (e.sides == 1) {
      if (normal[0].dot(off) < 0) normal[0] = -normal[0];
      *arc = {normal[0], -inward[0], M_PI};
      return true;
    }
    // The body is between the faces if its centre is on the other's side of each; where the centre is beyond
    // an end, the vertex there knows better.
    const double along = e.direction.dot(off);
    const Cone cone = along < 0 ? cone_at(e.v[0]) : along > e.length ? cone_at(e.v[1]) : Cone::other;
    if (cone == Cone::around) return false;
    const double across = inward[0].cross(inward[1]).dot(e.direction);
    if (cone == Cone::other && inward[0].cross(off).dot(e.direction) * across >= 0 &&
        off.cross(inward[1]).dot(e.direction) * across >= 0)
      return false;
    for (int i = 0; i < 2; ++i)
      if (inward[1 - i].dot(normal[i]) > 0) normal[i] = -normal[i];
    const double cosine = normal[0].dot(normal[1]);
    const Vec3 side = normal[1] - cosine * normal[0];
    if (!(side.norm() > 1e-12)) return false;
    *arc = {normal[0], side.normalized(), std::atan2(normal[0].cross(normal[1]).norm(), cosine)};
    return true;
  }

  int plane_of(const MeshPatch::Edge& e, int side) const {
    return patch_.cells()[patch_.side(e.first_side + side).cell].plane;
  }
  // The contact of a piece, unless there is none or it was dropped.
  const SurfaceContact* kept(int contact) const {
    return contact < 0 || dropped_[contact] ? nullptr : &out_.contact[contact];
  }
  Vec3 on_wall(const SurfaceContact& c) const { return particle_.x + c.on_body - c.gap * c.normal; }

  // From an edge into the cell of a side of it.
  Vec3 into(const MeshPatch::Edge& e, int side) const {
    const MeshPatch::Side& s = patch_.side(e.first_side + side);
    return s.sign * patch_.planes()[patch_.cells()[s.cell].plane].normal.cross(e.direction);
  }

  // The contact of the plane of an edge's side, if it is where a wedge about the edge has it and the way out
  // of the wedge may be shorter: along a normal of it turned by t, the deepest point of the body, `in` from
  // the edge, is deeper than -gap cos(t) + in sin(t).
  const SurfaceContact* contact_beside(const MeshPatch::Edge& e, int side, const Arc& arc, double low,
                                       double high) const {
    const SurfaceContact* c = kept(planes_[plane_of(e, side)].contact);
    if (!c) return nullptr;
    const Vec3 inward = into(e, side), y = on_wall(*c) - patch_.vertices()[e.v[0]].x;
    const double in = inward.dot(y), along = e.direction.dot(y);
    if (in < -kWithin * radius_ || along < low + c->gap || along > high - c->gap) return nullptr;
    const bool behind = e.sides == 2 && c->normal.dot(arc.end(side)) < 0;  // its way out leads into the wall
    if (!behind && in * std::sin(arc.span) >= -c->gap * (1 - std::cos(arc.span))) return nullptr;
    return c;
  }

  // Leaves a contact out, for another if there is one.
  void drop(const SurfaceContact* c, int other = -1) {
    if (!c) return;
    const auto number = c - out_.contact;
    dropped_[number] = true;
    instead_[number] = other;
  }
  // The one that is kept for a contact, itself if it is; -1 for none.
  int instead_of(int contact) const {
    while (contact >= 0 && dropped_[contact]) contact = instead_[contact];
    return contact;
  }

  // Whether a contact is deeper than a way out that leaves it out. A flat feature that stands on a plane is
  // not given up for a little.
  static bool deeper(const SurfaceContact* c, double gap) {
    return !c || (c->flat ? kStanding : 1) * c->gap < gap;
  }

  // The edges that go on straight from one, between the same planes, as pieces of its line.
  const std::vector<Stretch>& straight_on(int number) {
    std::vector<Stretch>& line = workspace().line;
    const MeshPatch::Edge& e = patch_.edges()[number];
    line.assign(1, {number, 0, e.length});
    for (const int way : {1, 0}) {
      int last = number, v = e.v[way];
      double at = way ? e.length : 0;
      for (bool found = true; found && line.size() < patch_.edges().size();) {
        found = false;
        const MeshPatch::Vertex& vertex = patch_.vertices()[v];
        for (int i = 0; i < vertex.edges && !found; ++i) {
          const int next = patch_.edge_at(vertex.first_edge + i);
          const MeshPatch::Edge& n = patch_.edges()[next];
          const double sign = (n.v[0] == v ? 1 : -1) * (way ? 1 : -1);
          found = next != last && !n.inner && sign * n.direction.dot(e.direction) > kStraightOn &&
                  same_planes(n, e);
          if (!found) continue;
          const double to = at + (way ? n.length : -n.length);
          line.push_back({next, std::min(at, to), std::max(at, to)});
          at = to;
          v = n.v[n.v[0] == v ? 1 : 0];
          last = next;
        }
      }
    }
    return line;
  }
  bool same_planes(const MeshPatch::Edge& a, const MeshPatch::Edge& b) const {
    if (a.sides != b.sides) return false;
    if (a.sides == 1) return plane_of(a, 0) == plane_of(b, 0);
    return (plane_of(a, 0) == plane_of(b, 0) && plane_of(a, 1) == plane_of(b, 1)) ||
           (plane_of(a, 0) == plane_of(b, 1) && plane_of(a, 1) == plane_of(b, 0));
  }
  // Whether edges that go straight on meet at a vertex.
  bool is_on_line(int number) const {
    const MeshPatch::Vertex& v = patch_.vertices()[number];
    for (int i = 0; i < v.edges; ++i)
      for (int k = 0; k < i; ++k) {
        const MeshPatch::Edge &a = patch_.edges()[patch_.edge_at(v.first_edge + i)],
                              &b = patch_.edges()[patch_.edge_at(v.first_edge + k)];
        if (!a.inner && !b.inner && std::abs(a.direction.dot(b.direction)) > kStraightOn) return true;
      }
    return false;
  }

  // Whether the body meets a piece of a line: it may meet the line beyond, and be deepest over the piece.
  bool meets(const Vec3& a, const Vec3& direction, double low, double high) const {
    const Vec3 ends[2] = {a + low * direction, a + high * direction};
    return !is_clear_of(particle_, ends, 2);
  }

  // An edge that stands out, with those that go straight on from it.
  void touch_outer_edge(int number, const Arc& arc, bool active) {
    const MeshPatch::Edge& e = patch_.edges()[number];
    const Vec3& a = patch_.vertices()[e.v[0]].x;
    const std::vector<Stretch>& line = straight_on(number);
    double low = 0, high = 0;
    for (const Stretch& piece : line) {
      low = std::min(low, piece.from);
      high = std::max(high, piece.to);
    }
    const auto say = [&](MetEdge::State state) {
      for (const Stretch& piece : line) edges_[piece.edge].state = state;
    };
    say(MetEdge::unknown);
    const Vec3 apart = particle_.x - a;
    if ((apart - std::clamp(apart.dot(e.direction), low, high) * e.direction).squaredNorm() >
        radius_ * radius_)
      return say(MetEdge::clear);
    const SurfaceContact* beside[2] = {nullptr, nullptr};
    bool free = active;  // no face of it has the body
    for (int i = 0; i < e.sides; ++i) {
      const int p = plane_of(e, i);
      if (!planes_[p].active) continue;
      beside[i] = contact_beside(e, i, arc, low, high);
      if (planes_[p].claimed) free = false;
      if (patch_.side(e.first_side + i).sign * inside(planes_[p], patch_.planes()[p], e) > 0 &&
          kept(planes_[p].contact))
        free = false;
    }
    if (!free && !beside[0] && !beside[1]) return;
    double angle = 0;
    SurfacePoint start;
    FeatureContact f =
        find_highest_line_contact(particle_, a, e.direction, arc, point_for(arc.low, &start), &angle);
    if (!f.touching) {  // nor are they, whatever their planes say
      for (const SurfaceContact* c : beside) drop(c);
      return say(MetEdge::clear);
    }
    // Of a line of the body that lies along the edge, the middle of what is over it.
    if (f.along_low < high && f.along_high > low && f.along_high - f.along_low > kLineLength * radius_) {
      const double middle = 0.5 * (std::max(f.along_low, low) + std::min(f.along_high, high));
      f.on_body += (middle - f.along) * e.direction;
      f.along = middle;
    }
    int owner = -1;
    for (const Stretch& piece : line) {
      edges_[piece.edge].state = f.along < piece.from ? MetEdge::before : MetEdge::beyond;
      if (f.along > low && f.along < high && f.along >= piece.from && f.along <= piece.to &&
          (owner < 0 || piece.edge < owner))
        owner = piece.edge;
    }
    // At an end of the arc a face has it, but for a line of the body that lies along the face: the plane's
    // deepest point may be its end that is not over the face.
    const int end = angle <= 0 ? 0 : angle >= arc.span ? 1 : -1;
    ActivePlane* face = end >= 0 && end < e.sides ? &planes_[plane_of(e, end)] : nullptr;
    const int opposite = face && e.sides == 2 ? instead_of(planes_[plane_of(e, 1 - end)].contact) : -1;
    const bool lies = face && face->active && !(opposite >= 0 && out_.contact[opposite].gap > f.gap) &&
                      instead_of(face->contact) < 0 && face->normal.dot(f.normal) > kSamePlane &&
                      (std::abs(into(e, end).dot(apart + f.on_body)) < kWithin * radius_ ||
                       is_over(plane_of(e, end), particle_.x + f.on_body));
    if ((end < 0 || lies) && owner >= 0 && deeper(beside[0], f.gap) && deeper(beside[1], f.gap) &&
        !(e.sides == 1 && covered(f, patch_.side(e.first_side).cell)) && meets(a, e.direction, low, high)) {
      edges_[owner].state = MetEdge::along;
      const MeshPatch::Edge& o = patch_.edges()[owner];
      const auto triangle = [&](int i) {
        return patch_.cells()[patch_.side(o.first_side + i).cell].triangle;
      };
      SurfaceContact c = surface_contact(f, triangle(0));
      c.piece = SurfaceContact::edge;
      c.of[0] = triangle(0);
      c.of[1] = o.sides > 1 ? triangle(1) : -1;
      const int contact = edges_[owner].contact = add(c);
      for (const SurfaceContact* other : beside) drop(other, contact);
      if (face) face->contact = contact;
      return;
    }
    // The way out of the one face leads out of the other, if it is shorter.
    for (int i = 0; i < 2 && e.sides == 2; ++i) {
      const SurfaceContact* other = beside[1 - i];
      const int there = instead_of(planes_[plane_of(e, i)].contact);
      if (other && there >= 0 && kept(there) != other && out_.contact[there].gap > other->gap &&
          f.gap > other->gap)
        drop(other, there);
    }
  }

  // A vertex all of whose edges stand out; false where one does not.
  bool touch_outer_vertex(int number, const Vec3& guess) {
    const MeshPatch::Vertex& v = patch_.vertices()[number];
    const Cone cone = cone_at(number);
    if (cone == Cone::around) return false;
    if (is_on_line(number)) return true;  // a place of an edge, no more
    Arc arc;
    for (int i = 0; i < v.edges && cone == Cone::other; ++i) {
      const MeshPatch::Edge& e = patch_.edges()[patch_.edge_at(v.first_edge + i)];
      if (!e.inner && !outer_arc(e, &arc)) return false;
    }
    // Of its pieces' contacts the shallowest leads out of all of them. Those further away than a few times
    // their depth have no shorter way out here.
    const SurfaceContact* near[kSurfaceContacts];
    int count = 0;
    bool touched = false;
    double most = -kFarAway;
    const auto is_normal = [&](const Vec3& d) {
      for (int i = 0; i < v.edges; ++i) {
        const MeshPatch::Edge& e = patch_.edges()[patch_.edge_at(v.first_edge + i)];
        if ((e.v[0] == number ? 1 : -1) * e.direction.dot(d) > kOneSide) return false;
      }
      return true;
    };
    const auto offer = [&](int contact) {
      const SurfaceContact* c = kept(contact);
      if (!c || std::find(near, near + count, c) != near + count) return;
      if (is_normal(c->normal)) {
        touched = true;
        most = std::max(most, c->gap);
      }
      if ((on_wall(*c) - v.x).norm() <= -kNearVertex * c->gap) near[count++] = c;
    };
    for (int i = 0; i < v.edges; ++i) {
      const int e = patch_.edge_at(v.first_edge + i);
      if (patch_.edges()[e].inner) continue;
      offer(edges_[e].contact);
      if (edges_[e].state == MetEdge::clear) return true;
    }
    for (int i = 0; i < v.cells; ++i)
      offer(planes_[patch_.cells()[patch_.cell_at(v.first_cell + i)].plane].contact);
    if (touched && count == 0) return true;
    SurfacePoint start;
    FeatureContact f = find_point_contact(particle_, v.x, guess, settings_, point_for(guess, &start));
    if (!f.touching && count > 0) {  // nor are its pieces, where a direction parts the body from all of them
      if (!is_normal(f.normal)) f = find_way_out(particle_, v.x, settings_);
      if (is_normal(f.normal)) most = kFarAway;
    }
    const bool out = f.touching && is_normal(f.normal) && f.gap > most + kWithin * radius_;
    if (out) most = f.gap;
    int best = -1;
    if (out) {
      SurfaceContact c = surface_contact(f, patch_.cells()[patch_.cell_at(v.first_cell)].triangle);
      c.piece = SurfaceContact::vertex;
      c.of[0] = v.triangle;
      c.of[1] = v.corner;
      best = add(c);
    }
    for (int i = 0; i < count; ++i)
      if (near[i]->gap < most) drop(near[i], best);
    return true;
  }

  // Directions around an edge between which the contact's lies: the slope of f, when d turns about the edge,
  // changes from rising to falling there.
  struct Range {
    Vec3 low, high;
  };
  bool range(const MeshPatch::Edge& e, Range* r) const {
    const Vec3 a = patch_.vertices()[e.v[0]].x;
    const ActivePlane& first = planes_[patch_.cells()[patch_.side(e.first_side).cell].plane];
    double low = -kFarAway, high = kFarAway;
    for (int i = e.first_side; i < e.first_side + e.sides; ++i) {
      const ActivePlane& met = planes_[patch_.cells()[patch_.side(i).cell].plane];
      const double angle =
          std::atan2(e.direction.dot(first.normal.cross(met.normal)), first.normal.dot(met.normal));
      const double slope = e.direction.cross(met.normal).dot(particle_.x - a + met.deepest);
      if (slope > 0) {
        if (angle > low) low = angle, r->low = met.normal;
      } else if (angle < high) {
        high = angle;
        r->high = met.normal;
      }
    }
    if (low > -kFarAway && high < kFarAway) return high >= low;
    // A border: the direction turns outward, to the side at most.
    if (low > -kFarAway)
      r->high = e.direction.cross(r->low);
    else
      r->low = -e.direction.cross(r->high);
    return true;
  }

  int first_plane_of(const MeshPatch::Edge& e) const {
    return patch_.cells()[patch_.side(e.first_side).cell].plane;
  }
  int first_plane_of(const MeshPatch::Vertex& v) const {
    return patch_.cells()[patch_.cell_at(v.first_cell)].plane;
  }

  // A corner of the body sharper than its overlap is deep: f has no maximum between the planes, and the
  // shallower one takes over at once.
  FeatureContact pointed(const MeshPatch::Edge& e) const {
    const ActivePlane* shallowest = nullptr;
    for (int i = e.first_side; i < e.first_side + e.sides; ++i) {
      const ActivePlane& met = planes_[patch_.cells()[patch_.side(i).cell].plane];
      if (!shallowest || met.result.gap > shallowest->result.gap) shallowest = &met;
    }
    FeatureContact f = at_plane(*shallowest);
    f.along = e.direction.dot(particle_.x + f.on_body - patch_.vertices()[e.v[0]].x);
    return f;
  }

  FeatureContact at_plane(const ActivePlane& met) const {
    FeatureContact f;
    f.touching = true;
    f.gap = met.result.gap;
    f.normal = met.normal;
    f.on_body = met.deepest;
    f.where = warm_point(met.memory.on_b, *particle_.shape);
    return f;
  }

  bool all_open(const MeshPatch::Edge& e) const {
    for (int i = e.first_side; i < e.first_side + e.sides; ++i) {
      const ActivePlane& met = planes_[patch_.cells()[patch_.side(i).cell].plane];
      if (!met.active || met.claimed) return false;
    }
    return true;
  }

  void touch_edge(int number) {
    const MeshPatch::Edge& e = patch_.edges()[number];
    if (e.inner) return;
    double deepest = 0;
    bool active = true;
    for (int i = 0; i < e.sides; ++i) {
      const ActivePlane& met = planes_[plane_of(e, i)];
      active = active && met.active;
      if (met.active) deepest = std::min(deepest, met.result.gap);
    }
    edges_[number].state = MetEdge::unknown;
    Arc arc;
    if (finds_sharp(deepest) && outer_arc(e, &arc)) return touch_outer_edge(number, arc, active);
    if (!all_open(e)) return;
    int weight = 1;
    for (int i = e.first_side; i < e.first_side + e.sides; ++i) {
      const MeshPatch::Side& side = patch_.side(i);
      const int plane = patch_.cells()[side.cell].plane;
      if (side.sign * inside(planes_[plane], patch_.planes()[plane], e) > 0) --weight;
    }
    if (weight == 0) return;
    const Vec3& a = patch_.vertices()[e.v[0]].x;
    if (from_edge(patch_, e, particle_.x).squaredNorm() > radius_ * radius_) {
      edges_[number].state = MetEdge::clear;
      return;
    }
    Range r;
    SurfacePoint start;
    const bool smooth = range(e, &r);
    const FeatureContact f =
        smooth ? find_line_contact(particle_, a, e.direction, r.low, r.high, 0, point_for(r.low, &start))
               : pointed(e);
    MetEdge& met = edges_[number];
    met.state = !f.touching             ? MetEdge::clear
                : !(f.along > 0)        ? MetEdge::before
                : !(f.along < e.length) ? MetEdge::beyond
                                        : MetEdge::along;
    if (met.state != MetEdge::along) return;
    if (e.sides == 1 && covered(f, patch_.side(e.first_side).cell)) return;
    if (finds_sharp(deepest) && !meets(a, e.direction, 0, e.length)) return;
    const auto triangle = [&](int i) { return patch_.cells()[patch_.side(e.first_side + i).cell].triangle; };
    add_feature(f, weight, triangle(0), smooth ? SurfaceContact::edge : SurfaceContact::under_edge,
                triangle(0), e.sides > 1 ? triangle(1) : -1);
  }

  // Whether a point of a border lies within another cell: meshes that overlap themselves have no border
  // there.
  bool covered(const FeatureContact& f, int own) const {
    const Vec3 y = particle_.x + f.on_body - f.gap * f.normal;
    for (std::size_t c = 0; c < patch_.cells().size(); ++c) {
      const MeshPatch::Cell& cell = patch_.cells()[c];
      if (static_cast<int>(c) == own || !planes_[cell.plane].active) continue;
      const MeshPatch::Plane& plane = patch_.planes()[cell.plane];
      if (std::abs(plane.normal.dot(y - plane.origin)) > kWithin * radius_) continue;
      if (in_cell(cell, y)) return true;
    }
    return false;
  }

  void touch_vertex(int number) {
    const MeshPatch::Vertex& v = patch_.vertices()[number];
    if (v.inner || v.cells == 0) return;
    if ((particle_.x - v.x).squaredNorm() > radius_ * radius_) return;
    const ActivePlane* shallowest = nullptr;
    bool claimed = false;
    double deepest = 0;
    for (int i = 0; i < v.cells; ++i) {
      const int plane = patch_.cells()[patch_.cell_at(v.first_cell + i)].plane;
      const ActivePlane& met = planes_[plane];
      if (!met.active) return;
      claimed = claimed || met.claimed;
      deepest = std::min(deepest, met.result.gap);
      if (!shallowest || met.result.gap > shallowest->result.gap) shallowest = &met;
    }
    if (finds_sharp(deepest) && touch_outer_vertex(number, shallowest->normal)) return;
    if (claimed) return;
    if (edged(*particle_.shape) && lies_under(number))
      return add_feature(at_plane(*shallowest), 1, patch_.cells()[patch_.cell_at(v.first_cell)].triangle,
                         SurfaceContact::under_vertex, v.triangle, v.corner);
    for (int i = 0; i < v.edges; ++i)
      if (state(patch_.edge_at(v.first_edge + i)) == MetEdge::clear) return;
    SurfacePoint start;
    const FeatureContact f = find_point_contact(particle_, v.x, shallowest->normal, settings_,
                                                point_for(shallowest->normal, &start));
    if (!f.touching) return;
    int weight = 1;
    for (int i = 0; i < v.edges; ++i) {
      const int e = patch_.edge_at(v.first_edge + i);
      if (climbs(e, number, f.normal)) weight -= 1 - patch_.edges()[e].sides;
    }
    for (int i = 0; i < v.cells; ++i)
      if (cell_climbs(patch_.cell_at(v.first_cell + i), number, f.normal)) --weight;
    if (weight == 0) return;
    add_feature(f, weight, patch_.cells()[patch_.cell_at(v.first_cell)].triangle, SurfaceContact::vertex,
                v.triangle, v.corner);
  }

  // Whether a corner of the body is in a pit below a vertex: beyond the ends of all its edges, so that no
  // triangle or edge has it.
  bool lies_under(int number) const {
    const MeshPatch::Vertex& v = patch_.vertices()[number];
    for (int i = 0; i < v.edges; ++i) {
      const MeshPatch::Edge& e = patch_.edges()[patch_.edge_at(v.first_edge + i)];
      if (e.sides < 2) return false;
      const Vec3 away = e.v[0] == number ? e.direction : Vec3(-e.direction);
      for (int k = 0; k < v.cells; ++k) {
        const ActivePlane& met = planes_[patch_.cells()[patch_.cell_at(v.first_cell + k)].plane];
        if (away.dot(particle_.x + met.deepest - v.x) > 0) return false;
      }
    }
    return true;
  }

  // Edges within a plane are not met.
  MetEdge::State state(int edge) const {
    return patch_.edges()[edge].inner ? MetEdge::unknown : edges_[edge].state;
  }

  // Whether an edge climbs along d from its end at a vertex; by where the body met the edge, if it did.
  bool climbs(int edge, int vertex, const Vec3& d) const {
    const MeshPatch::Edge& e = patch_.edges()[edge];
    const bool first = e.v[0] == vertex;
    switch (state(edge)) {
      case MetEdge::along:
        return true;
      case MetEdge::before:
        return !first;
      case MetEdge::beyond:
        return first;
      default:
        return (first ? 1 : -1) * e.direction.dot(d) > 0;
    }
  }
  bool cell_climbs(int number, int vertex, const Vec3& d) const {
    const MeshPatch::Cell& cell = patch_.cells()[number];
    for (int k = 0; k < cell.corners; ++k) {
      if (patch_.corner(cell.first + k) != vertex) continue;
      const int before = patch_.edge_of(cell.first + (k + cell.corners - 1) % cell.corners);
      return climbs(patch_.edge_of(cell.first + k), vertex, d) || climbs(before, vertex, d);
    }
    return false;
  }

  void add_feature(const FeatureContact& f, int weight, int triangle, SurfaceContact::Piece piece, int first,
                   int second) {
    const Shape& shape = *particle_.shape;
    if (weight < 0 && edged(shape) && -f.gap > kBluntest * particle_.scale * shape.curvature.min_radius)
      return;
    SurfaceContact c = surface_contact(f, triangle);
    c.weight = weight;
    c.piece = piece;
    c.of[0] = first;
    c.of[1] = second;
    add(c);
  }

  static constexpr double kNearVertex = 4;  // overlaps
  static constexpr double kOneSide = 1e-9;  // rad
  static constexpr double kStanding = 0.5;
  static constexpr double kLineLength = 1e-4;       // of the bounding radius: of a point there is less
  static constexpr double kStraightOn = 1 - 1e-12;  // cosine
  static constexpr double kWithin = 1e-9;           // of the bounding radius: on a cell

  const Particle& particle_;
  MeshPatch& patch_;
  const ContactSettings& settings_;
  const double path_, radius_;
  const FormerContact* former_;
  const int former_count_;
  SurfaceContacts& out_;
  bool dropped_[kSurfaceContacts];
  int instead_[kSurfaceContacts];  // of those that are: a contact added later, or -1
  std::vector<ActivePlane>& planes_;
  std::vector<MetEdge>& edges_;
};

}  // namespace

PlaneRegion plane_region(MeshPatch& patch, int number, const Vec3& body) {
  const MeshPatch::Plane& plane = patch.planes()[number];
  const bool below = plane.normal.dot(body - plane.origin) < 0;
  return {plane.origin, below ? Vec3(-plane.normal) : plane.normal,
          patch.unbounded() ? nullptr : &patch.cells_of(number)};
}

void SurfaceContacts::add(const SurfaceContact& c) {
  if (count == kSurfaceContacts) {
    full = true;
    return;
  }
  contact[count++] = c;
}

SurfaceContact surface_contact(const FeatureContact& f, int triangle) {
  SurfaceContact c;
  c.gap = f.gap;
  c.normal = f.normal;
  c.on_body = f.on_body;
  c.triangle = triangle;
  c.rung = Rung::warm;
  c.memory = PairMemory{};
  drop_proof(&c.memory.proof);
  drop_model(&c.memory.model);
  c.memory.on_a.patch = -1;
  c.memory.on_b = point_memory(f.where);
  c.memory.proof.stamp = 1;
  return c;
}

void find_surface_contacts(const Particle& particle, MeshPatch& patch, const ContactSettings& settings,
                           double path, const FormerContact* former, int former_count, SurfaceContacts* out) {
  SurfaceSearch(particle, patch, settings, path, former, former_count, out).run();
}

double one_face_until(const Particle& particle, const MeshPatch& patch, double path,
                      const SurfaceContacts& found) {
  if (found.count != 1) return -kFarAway;
  const SurfaceContact& c = found.contact[0];
  if (c.piece != SurfaceContact::face || c.flat || c.plane < 0) return -kFarAway;
  double until = kFarAway;
  for (std::size_t p = 0; p < patch.planes().size(); ++p)
    if (static_cast<int>(p) != c.plane) until = std::min(until, patch.planes()[p].expiry);
  const MeshPatch::Plane& plane = patch.planes()[c.plane];
  if (!particle.shape->flats.empty()) {  // that it meets the plane at a point was asked in another pose
    if (c.normal != plane.pointed_normal) return -kFarAway;
    until = std::min(until, plane.pointed);
  }
  const double radius = particle.scale * particle.shape->bounding_radius;
  for (int i = plane.first_edge; i < plane.first_edge + plane.edges && until > path; ++i) {
    const MeshPatch::Edge& e = patch.edges()[patch.edge_in(i)];
    until = std::min(until, path + (1 - 1e-12) * from_edge(patch, e, particle.x).norm() - radius);
  }
  return until;
}

}  // namespace nurbs

// Planes and their faces; see surface_search.h.
#include "contact/walls/surface_search.h"

#include <algorithm>
#include <cmath>

#include "contact/walls/surface_pieces.h"
#include "nurbs/tolerances.h"

namespace nurbs {

Workspace& workspace() {
  static thread_local Workspace w;
  return w;
}

void SurfaceSearch::run() {
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
  if (out_.count == 0 && !out_.full && edged(*particle_.shape)) touch_any(active);
  if (out_.count > 0) out_.expiry = -kFarAway;
}

// A sharp body that pokes through the wall beside the line where that turns up: the deepest point is beyond
// the line, so that no face has it, and the body is clear of the plane on the other side, or of the line. The
// contact is that of the shallowest plane that the body crosses within a cell.
void SurfaceSearch::touch_any(const std::vector<int>& active) {
  int shallowest = -1, cell = -1;
  for (const int p : active) {
    const ActivePlane& met = planes_[p];
    if (met.result.gap < -kPoked * radius_ || !(met.normal.dot(met.deepest) < 0)) continue;
    if (shallowest >= 0 && met.result.gap <= planes_[shallowest].result.gap) continue;
    const int crossed = cell_with(p, crossing(p, met.deepest, met.result.gap));
    if (crossed >= 0) shallowest = p, cell = crossed;
  }
  if (cell < 0) return touch_any_end(active);
  const ActivePlane& met = planes_[shallowest];
  add_plane(shallowest, patch_.cells()[cell].triangle, false, met.result.gap, met.deepest);
}

// ... or of the shallowest edge whose line has the body just past an end, of those beside which it meets a
// face.
void SurfaceSearch::touch_any_end(const std::vector<int>& active) {
  const FeatureContact* shallowest = nullptr;
  int at = -1;
  for (const int p : active) {
    const MeshPatch::Plane& plane = patch_.planes()[p];
    for (int i = plane.first_edge; i < plane.first_edge + plane.edges; ++i) {
      const int number = patch_.edge_in(i);
      const MetEdge& met = edges_[number];
      if (met.state != MetEdge::before && met.state != MetEdge::beyond) continue;
      if (met.past.gap < -kPoked * radius_ || (shallowest && met.past.gap <= shallowest->gap)) continue;
      const MeshPatch::Edge& e = patch_.edges()[number];
      const int v = e.v[met.state == MetEdge::beyond];
      if (!is_near(met.past, patch_.vertices()[v].x)) continue;
      bool meets = false;
      for (int s = e.first_side; s < e.first_side + e.sides && !meets; ++s)
        meets = meets_cell(patch_.side(s).cell);
      if (!meets) continue;
      shallowest = &met.past;
      at = v;
    }
  }
  if (shallowest) add_vertex(*shallowest, 1, patch_.vertices()[at], SurfaceContact::vertex);
}

const PairMemory* SurfaceSearch::start_for(const Vec3& normal) const {
  const PairMemory* best = nullptr;
  double most = kSameNormal;
  for (int k = 0; k < former_count_; ++k) {
    const double cosine = former_[k].normal.dot(normal);
    if (cosine > most) most = cosine, best = former_[k].memory;
  }
  return best;
}

const SurfacePoint* SurfaceSearch::point_for(const Vec3& normal, SurfacePoint* point) const {
  const PairMemory* memory = start_for(normal);
  if (!memory || !(memory->on_b.patch >= 0)) return nullptr;
  *point = surface_point(memory->on_b);
  return point;
}

// The deepest point of a polygon that overlaps the plane.
bool SurfaceSearch::deepest_point(const PolygonState& state, double* gap, Vec3* on_body) {
  *gap = 0;
  for (int k = 0; k < state.count; ++k)
    if (state.gap[k] < *gap) {
      *gap = state.gap[k];
      *on_body = state.arm_b[k] + 0.5 * state.gap[k] * state.normal;
    }
  return *gap < 0;
}

// Whether a polygon over the region overlaps it, and its deepest point.
bool SurfaceSearch::polygon_over(const PlaneRegion& region, double reach, double* gap, Vec3* on_body,
                                 double* clear) const {
  ContactPolygon polygon;
  if (make_region_polygon(particle_, region, particle_.x, reach, &polygon, clear) != RegionContact::polygon)
    return false;
  const PolygonState state = evaluate(polygon, plane_frame(particle_.x), body_frame(particle_));
  return deepest_point(state, gap, on_body);
}

// Whether a polygon of the last step stands on the plane and has the body's deepest point, so that no
// search is needed: with all the points of a face, as long as it is known to, or, to be remade, on a line
// that rolls.
bool SurfaceSearch::stands_on(const MeshPatch::Plane& plane, ActivePlane* met) const {
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
bool SurfaceSearch::stand_on(int number) {
  const ActivePlane& met = planes_[number];
  bool stands = met.stands;
  for (int k = 0; k < former_count_ && !stands; ++k)
    stands = former_[k].flat && former_[k].normal.dot(met.normal) > kSamePlane;
  const bool over = met.stands || patch_.unbounded() || cell_below(number) >= 0;
  if (!stands) {
    // Where several planes of about one slope are met, the surface is bent under the body, and its features
    // stand on points.
    for (const int other : workspace().active)
      if (other != number && planes_[other].normal.dot(met.normal) > kOneSlope) return false;
  }
  if (!stands || !over) {
    MeshPatch::Plane& plane = patch_.planes()[number];
    if (!stands && path_ + kClearTurn * radius_ * (met.normal - plane.pointed_normal).norm() < plane.pointed)
      return false;
    const PlaneRegion region = plane_region(patch_, number, particle_.x);
    const double reach = stands ? kKeptReach : kReach;
    double gap = 0, clear = 0;
    Vec3 on_body = Vec3::Zero();
    if (!polygon_over(region, -reach * met.result.gap, &gap, &on_body, &clear) &&
        !(stands && polygon_over(region, -kReach * met.result.gap, &gap, &on_body))) {
      plane.pointed = stands ? -kFarAway : path_ + clear;
      plane.pointed_normal = met.normal;
      return false;
    }
    if (!over) {  // the plane's deepest point is beside the wall; the polygon's is on it
      const double from = gap;
      if (!polygon_over(region, -reach * from, &gap, &on_body) &&
          !(stands && polygon_over(region, -kReach * from, &gap, &on_body)))
        return false;
      return add_plane(number, triangle_under(number, on_body), true, gap, on_body);
    }
  }
  return add_plane(number, triangle_under(number, met.deepest), true, met.result.gap, met.deepest);
}

// Of a plane, that under the middle of the polygon that stood on it, or else under the deepest point: what
// moves, or is told of the force.
int SurfaceSearch::triangle_under(int number, const Vec3& deepest) {
  if (patch_.unbounded()) return 0;
  MeshPatch::Plane& plane = patch_.planes()[number];
  Vec3 middle = deepest;
  for (int k = 0; k < former_count_; ++k) {
    const FormerContact& f = former_[k];
    if (!f.polygon || !(f.normal.dot(planes_[number].normal) > kSamePlane)) continue;
    middle = particle_.scale * (particle_.q * middle_of(*f.polygon));
  }
  for (const Vec3& x : {middle, deepest}) {
    const Vec3 at = particle_.x + x;
    const int cell = in_cell(patch_.cells()[plane.hint], at) ? plane.hint : cell_with(number, at);
    if (cell < 0) continue;
    plane.hint = cell;
    return patch_.cells()[cell].triangle;
  }
  return plane.leader;
}

bool SurfaceSearch::stood_on(const Vec3& normal) const {
  for (int k = 0; k < former_count_; ++k)
    if (former_[k].normal.dot(normal) > kSamePlane) return true;
  return false;
}

// Lower bound of the gap to the cells of a plane: along the line from the point of a cell that is nearest
// to the body's centre, by the atlas.
double SurfaceSearch::clearance(const MeshPatch::Plane& plane) const {
  double least = kFarAway;
  for (int i = 0; i < plane.cells && least > 0; ++i) {
    const Vec3 way =
        particle_.x - nearest(patch_.cells()[patch_.cell_in(plane.first + i)], plane, particle_.x);
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

// The point of a cell that is nearest to c.
Vec3 SurfaceSearch::nearest(const MeshPatch::Cell& cell, const MeshPatch::Plane& plane, const Vec3& c) const {
  bool inside = true;
  double least2 = kFarAway;
  Vec3 best = Vec3::Zero();
  for (int k = 0; k < cell.corners; ++k) {
    const MeshPatch::Edge& e = patch_.edges()[patch_.edge_of(cell.first + k)];
    const Vec3& a = patch_.vertices()[e.v[0]].x;
    const Vec3 off = c - a;
    if (patch_.sign_of(cell.first + k) * plane.normal.cross(e.direction).dot(off) >= 0 ||
        !patch_.bounds(cell, k, c))
      continue;
    inside = false;
    const Vec3 y = a + std::clamp(e.direction.dot(off), 0.0, e.length) * e.direction;
    if ((c - y).squaredNorm() < least2) least2 = (c - y).squaredNorm(), best = y;
  }
  return inside ? Vec3(c - plane.normal.dot(c - plane.origin) * plane.normal) : best;
}

// The ladder of a plane; true if the body overlaps it.
bool SurfaceSearch::look_at_plane(int number) {
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
  met.result =
      find_plane_contact(particle_, plane.origin, met.normal, settings_, reinterpret_cast<double*>(&memory));
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
double SurfaceSearch::inside(const ActivePlane& met, const MeshPatch::Plane& plane,
                             const MeshPatch::Edge& e) const {
  const Vec3 x = particle_.x - patch_.vertices()[e.v[0]].x + met.deepest;
  return plane.normal.cross(e.direction).dot(x);
}

// Whether a sharp body overlaps both planes of a steep valley. It has a contact with each, as with two walls:
// behind the one its deepest point is as far beyond the edge as it overlaps the other.
bool SurfaceSearch::is_steep_valley(const MeshPatch::Edge& e) const {
  if (e.inner || e.sides != 2) return false;
  const ActivePlane &one = planes_[plane_of(e, 0)], &other = planes_[plane_of(e, 1)];
  if (!one.active || !other.active || !(one.normal.dot(other.normal) <= kSteep)) return false;
  const double shallower = std::max(one.result.gap, other.result.gap);
  return shallower >= -kPoked * radius_ && finds_sharp(std::min(one.result.gap, other.result.gap)) &&
         into(e, 0).dot(other.normal) > 0 && into(e, 1).dot(one.normal) > 0;
}

// Whether a cell has the deepest point. Borders of the plane are no part of it, cuts within it are.
bool SurfaceSearch::holds(int number, const ActivePlane& met) const {
  const MeshPatch::Cell& cell = patch_.cells()[number];
  const MeshPatch::Plane& plane = patch_.planes()[cell.plane];
  const Vec3 x = particle_.x + met.deepest;
  for (int k = 0; k < cell.corners; ++k) {
    const MeshPatch::Edge& e = patch_.edges()[patch_.edge_of(cell.first + k)];
    const double s = patch_.sign_of(cell.first + k) * inside(met, plane, e);
    if (!(e.inner ? s >= 0 : s > 0) && patch_.bounds(cell, k, x)) return false;
  }
  return true;
}

// The cell that has the plane's deepest point, or -1; the one that had it in the last step has it mostly
// again.
int SurfaceSearch::cell_below(int number) {
  MeshPatch::Plane& plane = patch_.planes()[number];
  for (int i = -1; i < plane.cells; ++i) {
    const int cell = i < 0 ? plane.hint : patch_.cell_in(plane.first + i);
    if (!holds(cell, planes_[number])) continue;
    plane.hint = cell;
    return cell;
  }
  return cell_above_valley(number);
}

// The cell of a plane whose deepest point is beyond the bottom of a steep valley, or of several at a vertex:
// of the plane, the point that is nearest is on no other border. -1 if there is none, or the body meets
// neither the plane's cells nor those across.
int SurfaceSearch::cell_above_valley(int number) const {
  const ActivePlane& met = planes_[number];
  const MeshPatch::Plane& plane = patch_.planes()[number];
  const auto steep = [&](int i) {
    return is_steep_valley(patch_.edges()[patch_.edge_in(plane.first_edge + i)]);
  };
  bool any = false;
  for (int i = 0; i < plane.edges && !any; ++i) any = steep(i);
  if (!any) return -1;
  const Vec3 x = particle_.x + met.deepest;
  int cell = -1;
  Vec3 best = x;
  for (int i = 0; i < plane.cells; ++i) {
    const int here = patch_.cell_in(plane.first + i);
    const Vec3 y = nearest(patch_.cells()[here], plane, x);
    if (cell < 0 || (y - x).squaredNorm() < (best - x).squaredNorm()) cell = here, best = y;
  }
  bool meets = false;
  for (int i = 0; i < plane.edges; ++i) {
    const MeshPatch::Edge& e = patch_.edges()[patch_.edge_in(plane.first_edge + i)];
    if (!(from_edge(patch_, e, best).norm() < kWithin * radius_)) continue;
    if (!steep(i)) return -1;
    const int first = plane_of(e, 0);
    meets = meets || meets_cells(first == number ? plane_of(e, 1) : first);
  }
  return (meets || meets_cells(number)) && crosses_wall(met.deepest) ? cell : -1;
}

// Whether the body meets a cell of the plane.
bool SurfaceSearch::meets_cells(int number) const {
  const MeshPatch::Plane& plane = patch_.planes()[number];
  for (int i = 0; i < plane.cells; ++i) {
    const int here = patch_.cell_in(plane.first + i);
    const Vec3 y = nearest(patch_.cells()[here], plane, particle_.x);
    if ((particle_.x - y).norm() < radius_ && meets_cell(here)) return true;
  }
  return false;
}

// The cell of a plane that a point is above, or below; -1: none.
int SurfaceSearch::cell_with(int number, const Vec3& x) const {
  const MeshPatch::Plane& plane = patch_.planes()[number];
  for (int i = 0; i < plane.cells; ++i) {
    const int cell = patch_.cell_in(plane.first + i);
    if (in_cell(patch_.cells()[cell], x)) return cell;
  }
  return -1;
}

// Of the line from the centre to the deepest point, all of which the body has, the point in the plane; the
// centre is above it.
Vec3 SurfaceSearch::crossing(int number, const Vec3& deepest, double gap) const {
  return particle_.x + deepest - gap / planes_[number].normal.dot(deepest) * deepest;
}

bool SurfaceSearch::in_cell(const MeshPatch::Cell& cell, const Vec3& x) const {
  const Vec3& normal = patch_.planes()[cell.plane].normal;
  for (int k = 0; k < cell.corners; ++k) {
    const MeshPatch::Edge& e = patch_.edges()[patch_.edge_of(cell.first + k)];
    const double s = normal.cross(e.direction).dot(x - patch_.vertices()[e.v[0]].x);
    if (!(patch_.sign_of(cell.first + k) * s > -kWithin * radius_) && patch_.bounds(cell, k, x)) return false;
  }
  return true;
}

void SurfaceSearch::touch_face(int number) {
  const ActivePlane& met = planes_[number];
  const int cell = patch_.unbounded() ? -1 : cell_below(number);
  if (!patch_.unbounded() && cell < 0) return;
  add_plane(number, cell < 0 ? 0 : patch_.cells()[cell].triangle, false, met.result.gap, met.deepest);
}

// Whether the deepest point of a body is over a face that the body does not meet: it may be on the other
// side of the plane, as the body passes by the face's border.
bool SurfaceSearch::passes_by(int number, const Vec3& deepest, double gap) const {
  if (patch_.unbounded() || !finds_sharp(gap)) return false;
  if (planes_[number].normal.dot(deepest) < 0 && cell_with(number, crossing(number, deepest, gap)) >= 0)
    return false;
  const MeshPatch::Plane& plane = patch_.planes()[number];
  const Vec3 x = particle_.x + deepest;
  if (cell_with(number, x) < 0) return false;
  if (reaches_round(number, deepest, gap)) return true;
  if (meets_cells(number)) return false;
  // A sharp body may be in the wall by a neighbour of the cell that it is over, and meet the face nowhere.
  for (int i = 0; i < plane.cells; ++i) {
    const int here = patch_.cell_in(plane.first + i);
    const MeshPatch::Cell& cell = patch_.cells()[here];
    if (!in_cell(cell, x)) continue;
    for (int k = cell.first; k < cell.first + cell.corners; ++k) {
      const MeshPatch::Edge& e = patch_.edges()[patch_.edge_of(k)];
      if (e.inner || e.sides != 2) continue;
      for (int s = e.first_side; s < e.first_side + 2; ++s)
        if (patch_.side(s).cell != here && meets_cell(patch_.side(s).cell)) return false;
    }
  }
  return true;
}

// Whether a body whose deepest point is over a face has gone there round a border of the wall, or not through
// the wall at all, as from without round what is a valley on the face's other side; and has little of the
// face but what an edge meets: the point of the face above the deepest one is not in the body.
bool SurfaceSearch::reaches_round(int number, const Vec3& deepest, double gap) const {
  const MeshPatch::Plane& plane = patch_.planes()[number];
  const Vec3& normal = planes_[number].normal;
  if (!(normal.dot(deepest) < 0)) return false;
  const Vec3 above = particle_.x + deepest - gap * normal, way = crossing(number, deepest, gap) - above;
  double last = 0;
  bool border = false;
  for (int i = 0; i < plane.edges; ++i) {
    const MeshPatch::Edge& e = patch_.edges()[patch_.edge_in(plane.first_edge + i)];
    if (e.inner) continue;
    const Vec3 to = patch_.vertices()[e.v[0]].x - above, across = e.direction.cross(normal);
    const double t = to.dot(across) / way.dot(across), along = (t * way - to).dot(e.direction);
    if (!(t > last && t < 1 && along >= 0 && along <= e.length)) continue;
    last = t;
    border = e.sides == 1;
  }
  if (last == 0) return false;
  // Of a sharp body that is thick enough the border's own contact says more.
  const bool passes =
      (border && is_thinner(gap)) || (!(border && edged(*particle_.shape)) && !crosses_wall(deepest));
  return passes && is_clear_of(particle_, &above, 1);
}

// Whether the line from the body's centre to a point of it goes through the wall.
bool SurfaceSearch::crosses_wall(const Vec3& to) const {
  return std::any_of(patch_.cells().begin(), patch_.cells().end(), [&](const MeshPatch::Cell& cell) {
    const MeshPatch::Plane& plane = patch_.planes()[cell.plane];
    const double from = plane.normal.dot(particle_.x - plane.origin), way = plane.normal.dot(to);
    return from * (from + way) < 0 && in_cell(cell, particle_.x - from / way * to);
  });
}

// Whether no direction parts the body from a cell.
bool SurfaceSearch::meets_cell(int number) const {
  const MeshPatch::Cell& cell = patch_.cells()[number];
  std::vector<Vec3>& corners = workspace().corners;
  corners.clear();
  for (int k = cell.first; k < cell.first + cell.corners; ++k)
    corners.push_back(patch_.vertices()[patch_.corner(k)].x);
  return !is_clear_of(particle_, corners.data(), static_cast<int>(corners.size()));
}

bool SurfaceSearch::add_plane(int number, int triangle, bool flat, double gap, const Vec3& on_body) {
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
int SurfaceSearch::add(const SurfaceContact& c) {
  if (out_.count < kSurfaceContacts) dropped_[out_.count] = false;
  out_.add(c);
  return out_.full ? -1 : out_.count - 1;
}

void SurfaceSearch::leave_out_dropped() {
  int kept = 0;
  for (int i = 0; i < out_.count; ++i) {
    if (dropped_[i]) continue;
    if (kept < i) out_.contact[kept] = out_.contact[i];
    ++kept;
  }
  out_.count = kept;
}

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

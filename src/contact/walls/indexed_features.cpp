// Edges and vertices of a mesh as far as the index of the height there counts (surface_search.h).
#include <algorithm>
#include <cmath>

#include "contact/walls/surface_pieces.h"
#include "nurbs/tolerances.h"

namespace nurbs {

bool SurfaceSearch::range(const MeshPatch::Edge& e, Range* r) const {
  const Vec3 a = patch_.vertices()[e.v[0]].x;
  const ActivePlane& first = planes_[plane_of(e, 0)];
  double low = -kFarAway, high = kFarAway;
  for (int i = 0; i < e.sides; ++i) {
    const ActivePlane& met = planes_[plane_of(e, i)];
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

int SurfaceSearch::first_plane_of(const MeshPatch::Vertex& v) const {
  return patch_.cells()[patch_.cell_at(v.first_cell)].plane;
}

// Of the planes at an edge, all met.
int SurfaceSearch::shallowest_beside(const MeshPatch::Edge& e) const {
  int shallowest = plane_of(e, 0);
  for (int i = 1; i < e.sides; ++i) {
    const int p = plane_of(e, i);
    if (planes_[p].result.gap > planes_[shallowest].result.gap) shallowest = p;
  }
  return shallowest;
}

// A corner of the body sharper than its overlap is deep: f has no maximum between the planes, and the
// shallower one takes over at once.
FeatureContact SurfaceSearch::pointed(const MeshPatch::Edge& e) const {
  FeatureContact f = at_plane(planes_[shallowest_beside(e)]);
  f.along = e.direction.dot(particle_.x + f.on_body - patch_.vertices()[e.v[0]].x);
  return f;
}

FeatureContact SurfaceSearch::at_plane(const ActivePlane& met) const {
  FeatureContact f;
  f.touching = true;
  f.gap = met.result.gap;
  f.normal = met.normal;
  f.on_body = met.deepest;
  f.where = warm_point(met.memory.on_b, *particle_.shape);
  return f;
}

bool SurfaceSearch::all_open(const MeshPatch::Edge& e) const {
  for (int i = 0; i < e.sides; ++i) {
    const ActivePlane& met = planes_[plane_of(e, i)];
    if (!met.active || met.claimed) return false;
  }
  return true;
}

// Whether the plane of an edge's side has its deepest point on that side.
bool SurfaceSearch::has_deepest(const MeshPatch::Edge& e, int side) const {
  const int plane = plane_of(e, side);
  return patch_.side(e.first_side + side).sign * inside(planes_[plane], patch_.planes()[plane], e) > 0;
}

void SurfaceSearch::touch_edge(int number) {
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
  if (!all_open(e) || is_steep_valley(e)) return;
  int weight = 1;
  for (int i = 0; i < e.sides; ++i)
    if (has_deepest(e, i)) --weight;
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
  met.past = f;
  if (met.state != MetEdge::along) return;
  if (e.sides == 1 && covered(f, straight_on(number))) return;
  // It may meet the line beyond, and be deepest over the edge.
  const Vec3 ends[2] = {a, a + e.length * e.direction};
  if (finds_sharp(deepest) && is_clear_of(particle_, ends, 2)) return;
  if (!smooth && reaches_round(shallowest_beside(e), f.on_body, f.gap)) return;
  add_edge(f, weight, e, smooth ? SurfaceContact::edge : SurfaceContact::under_edge);
}

// Whether a point of a border lies within another cell: meshes that overlap themselves have no border
// there.
bool SurfaceSearch::covered(const FeatureContact& f, const std::vector<Stretch>& line) const {
  const Vec3 y = on_wall(f);
  const auto cell_at = [&](const Stretch& piece) {
    return patch_.side(patch_.edges()[piece.edge].first_side).cell;
  };
  const auto of_line = [&](int c) {
    return std::any_of(line.begin(), line.end(), [&](const Stretch& piece) { return cell_at(piece) == c; });
  };
  const int own = patch_.cells()[cell_at(line.front())].plane;
  for (std::size_t c = 0; c < patch_.cells().size(); ++c) {
    const MeshPatch::Cell& cell = patch_.cells()[c];
    if (!planes_[cell.plane].active || of_line(static_cast<int>(c))) continue;
    // What is one plane to the patch may be off it by more.
    const MeshPatch::Plane& plane = patch_.planes()[cell.plane];
    if (cell.plane != own && std::abs(plane.normal.dot(y - plane.origin)) > kWithin * radius_) continue;
    if (in_cell(cell, y)) return true;
  }
  return false;
}

void SurfaceSearch::touch_vertex(int number) {
  const MeshPatch::Vertex& v = patch_.vertices()[number];
  if (v.inner || v.cells == 0) return;
  if ((particle_.x - v.x).squaredNorm() > radius_ * radius_) return;
  const ActivePlane* shallowest = &planes_[first_plane_of(v)];
  bool claimed = false;
  double deepest = 0;
  for (int i = 0; i < v.cells; ++i) {
    const int plane = patch_.cells()[patch_.cell_at(v.first_cell + i)].plane;
    const ActivePlane& met = planes_[plane];
    if (!met.active) return;
    claimed = claimed || met.claimed;
    deepest = std::min(deepest, met.result.gap);
    if (met.result.gap > shallowest->result.gap) shallowest = &met;
  }
  const bool sharp = finds_sharp(deepest);
  if (sharp && touch_outer_vertex(number, shallowest->normal)) return;
  if (claimed) return;
  if (edged(*particle_.shape) && lies_under(number)) {
    if (const ActivePlane* over = plane_over(v))
      add_vertex(at_plane(*over), 1, v, SurfaceContact::under_vertex);
    return;
  }
  if (!touch_indexed_vertex(number, shallowest->normal) && sharp) touch_between_ridges(number);
}

// The vertex by its index; false where it has no contact.
bool SurfaceSearch::touch_indexed_vertex(int number, const Vec3& guess) {
  const MeshPatch::Vertex& v = patch_.vertices()[number];
  for (int i = 0; i < v.edges; ++i)
    if (state(patch_.edge_at(v.first_edge + i)) == MetEdge::clear) return false;
  SurfacePoint start;
  const FeatureContact f = find_point_contact(particle_, v.x, guess, settings_, point_for(guess, &start));
  if (!f.touching) return false;
  int weight = 1;
  for (int i = 0; i < v.edges; ++i) {
    const int e = patch_.edge_at(v.first_edge + i);
    if (!patch_.edges()[e].inner && climbs(e, number, f.normal)) weight -= 1 - patch_.edges()[e].sides;
  }
  weight -= climbing_faces(number, f.normal);
  return weight != 0 && add_vertex(f, weight, v, SurfaceContact::vertex) >= 0;
}

// Whether a corner of the body is in a pit below a vertex: beyond the ends of all its edges, so that no
// triangle or edge has it.
bool SurfaceSearch::lies_under(int number) const {
  const MeshPatch::Vertex& v = patch_.vertices()[number];
  for (int i = 0; i < v.edges; ++i) {
    const MeshPatch::Edge& e = patch_.edges()[patch_.edge_at(v.first_edge + i)];
    if (e.sides < 2) return false;
    for (int k = 0; k < v.cells; ++k) {
      const ActivePlane& met = planes_[patch_.cells()[patch_.cell_at(v.first_cell + k)].plane];
      if (away(e, number) * e.direction.dot(particle_.x + met.deepest - v.x) > 0) return false;
    }
  }
  return true;
}

// Of the planes at the vertex of a pit the shallowest that is without a contact, as are those that it bends
// into; nullptr if there is none.
const ActivePlane* SurfaceSearch::plane_over(const MeshPatch::Vertex& v) const {
  const auto at = [&](int i) { return &planes_[patch_.cells()[patch_.cell_at(v.first_cell + i)].plane]; };
  const ActivePlane* shallowest = nullptr;
  for (int i = 0; i < v.cells; ++i) {
    bool met = false;
    for (int k = 0; k < v.cells; ++k)
      met = met || (at(k)->contact >= 0 && at(k)->normal.dot(at(i)->normal) > kSteep);
    if (!met && (!shallowest || at(i)->result.gap > shallowest->result.gap)) shallowest = at(i);
  }
  return shallowest;
}

// Edges within a plane are not met.
MetEdge::State SurfaceSearch::state(int edge) const {
  return patch_.edges()[edge].inner ? MetEdge::unknown : edges_[edge].state;
}

// Whether an edge climbs along d from its end at a vertex; by where the body met the edge, if it did.
bool SurfaceSearch::climbs(int edge, int vertex, const Vec3& d) const {
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
      return away(e, vertex) * e.direction.dot(d) > 0;
  }
}

// How many of the faces at a vertex climb along d from it: at one of their edges there. Cells that a cut
// within a plane parts are one face, and whether the cut climbs says nothing: where the body met the edges
// says more than d, which the cut has nothing else to go by.
int SurfaceSearch::climbing_faces(int number, const Vec3& d) {
  const MeshPatch::Vertex& v = patch_.vertices()[number];
  std::vector<FaceAtVertex>& faces = workspace().faces;
  faces.clear();
  for (int i = 0; i < v.cells; ++i) {
    const MeshPatch::Cell& cell = patch_.cells()[patch_.cell_at(v.first_cell + i)];
    for (int k = 0; k < cell.corners; ++k) {
      if (patch_.corner(cell.first + k) != number) continue;
      FaceAtVertex face{{patch_.edge_of(cell.first + (k + cell.corners - 1) % cell.corners),
                         patch_.edge_of(cell.first + k)},
                        false};
      for (int& edge : face.edges) {
        face.climbs = face.climbs || (!patch_.edges()[edge].inner && climbs(edge, number, d));
        if (!patch_.edges()[edge].inner) edge = -1;  // it parts faces
      }
      faces.push_back(face);
      break;
    }
  }
  // Join those that a cut parts, until none is left.
  for (std::size_t i = 0; i < faces.size(); ++i)
    for (std::size_t j = i + 1; j < faces.size(); ++j)
      for (int side = 0; side < 2; ++side) {
        FaceAtVertex &one = faces[i], &other = faces[j];
        const int cut = one.edges[side];
        if (cut < 0 || (other.edges[0] != cut && other.edges[1] != cut)) continue;
        one.edges[side] = other.edges[other.edges[0] == cut ? 1 : 0];
        one.climbs = one.climbs || other.climbs;
        faces.erase(faces.begin() + static_cast<long>(j));
        j = i;  // others may follow at the new side
        break;
      }
  return static_cast<int>(
      std::count_if(faces.begin(), faces.end(), [](const FaceAtVertex& s) { return s.climbs; }));
}

int SurfaceSearch::add_edge(const FeatureContact& f, int weight, const MeshPatch::Edge& e,
                            SurfaceContact::Piece piece) {
  const auto triangle = [&](int i) { return patch_.cells()[patch_.side(e.first_side + i).cell].triangle; };
  return add_feature(f, weight, triangle(0), piece, triangle(0), e.sides > 1 ? triangle(1) : -1);
}

int SurfaceSearch::add_vertex(const FeatureContact& f, int weight, const MeshPatch::Vertex& v,
                              SurfaceContact::Piece piece) {
  return add_feature(f, weight, patch_.cells()[patch_.cell_at(v.first_cell)].triangle, piece, v.triangle,
                     v.corner);
}

// Number of the contact; -1 where it is not one or there is no more room.
int SurfaceSearch::add_feature(const FeatureContact& f, int weight, int triangle, SurfaceContact::Piece piece,
                               int first, int second) {
  const Shape& shape = *particle_.shape;
  if (weight < 0 && edged(shape) && -f.gap > kBluntest * particle_.scale * shape.curvature.min_radius)
    return -1;
  SurfaceContact c = surface_contact(f, triangle);
  c.weight = weight;
  c.piece = piece;
  c.of[0] = first;
  c.of[1] = second;
  return add(c);
}

}  // namespace nurbs

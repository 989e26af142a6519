// Edges and vertices that stand out, against bodies sharper than their overlap with a plane is deep. There
// the heights have several maxima, and a face may have the deepest point of a body that is behind its plane
// by all its size and over its border by next to nothing. The wall about a convex edge or vertex is a wedge
// or a cone, and the way out of it is the shortest along any normal that it has there. A contact with a piece
// of it that is deeper than that is none.
#include <algorithm>
#include <cmath>

#include "contact/walls/surface_pieces.h"
#include "nurbs/tolerances.h"

namespace nurbs {

// Whether a body is too sharp for its overlap with the planes to have one maximum over directions.
bool SurfaceSearch::finds_sharp(double gap) const {
  const Shape& shape = *particle_.shape;
  return edged(shape) || -gap > kBluntest * particle_.scale * shape.curvature.min_radius;
}

// The ways from a vertex along its edges and, where another triangle's side goes straight on through it, into
// that, square to the side.
const std::vector<Vec3>& SurfaceSearch::ways_from(int number) const {
  const MeshPatch::Vertex& v = patch_.vertices()[number];
  std::vector<Vec3>& ways = workspace().ways;
  ways.clear();
  for (int i = 0; i < v.edges; ++i) {
    const MeshPatch::Edge& e = patch_.edges()[patch_.edge_at(v.first_edge + i)];
    ways.push_back(away(e, number) * e.direction);
  }
  for (int i = 0; i < v.cells; ++i) {
    const MeshPatch::Cell& cell = patch_.cells()[patch_.cell_at(v.first_cell + i)];
    for (int k = cell.first; cell.corners > 3 && k < cell.first + cell.corners; ++k)
      if (patch_.corner(k) == number && patch_.splits_side(k))
        ways.push_back(patch_.sign_of(k) *
                       patch_.planes()[cell.plane].normal.cross(patch_.edges()[patch_.edge_of(k)].direction));
  }
  return ways;
}

SurfaceSearch::Cone SurfaceSearch::cone_at(int number) const {
  const MeshPatch::Vertex& v = patch_.vertices()[number];
  for (int k = 0; k < v.edges; ++k)
    if (patch_.edges()[patch_.edge_at(v.first_edge + k)].sides != 2) return Cone::other;
  const std::vector<Vec3>& ways = ways_from(number);
  bool outside = false;
  for (int i = 0; i < v.cells; ++i) {
    const Vec3& n = patch_.planes()[patch_.cells()[patch_.cell_at(v.first_cell + i)].plane].normal;
    double low = 0, high = 0;
    for (const Vec3& way : ways) {
      low = std::min(low, n.dot(way));
      high = std::max(high, n.dot(way));
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
bool SurfaceSearch::outer_arc(const MeshPatch::Edge& e, Arc* arc) const {
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
  if (!(normal[0].cross(normal[1]).norm() > 1e-12)) return false;
  *arc = arc_between(normal[0], normal[1]);
  return true;
}

int SurfaceSearch::plane_of(const MeshPatch::Edge& e, int side) const {
  return patch_.cells()[patch_.side(e.first_side + side).cell].plane;
}

// The contact of a piece, unless there is none or it was dropped.
const SurfaceContact* SurfaceSearch::kept(int contact) const {
  return contact < 0 || dropped_[contact] ? nullptr : &out_.contact[contact];
}

// From an edge into the cell of a side of it.
Vec3 SurfaceSearch::into(const MeshPatch::Edge& e, int side) const {
  const MeshPatch::Side& s = patch_.side(e.first_side + side);
  return s.sign * patch_.planes()[patch_.cells()[s.cell].plane].normal.cross(e.direction);
}

// The contact of the plane of an edge's side, if it is where a wedge about the edge has it and the way out
// of the wedge may be shorter: along a normal of it turned by t, the deepest point of the body, `in` from
// the edge, is deeper than -gap cos(t) + in sin(t).
const SurfaceContact* SurfaceSearch::contact_beside(const MeshPatch::Edge& e, int side, const Arc& arc,
                                                    double low, double high) const {
  const SurfaceContact* c = kept(planes_[plane_of(e, side)].contact);
  if (!c) return nullptr;
  const Vec3 inward = into(e, side), y = on_wall(*c) - patch_.vertices()[e.v[0]].x;
  const double in = inward.dot(y), along = e.direction.dot(y);
  if (in < -kWithin * radius_ || along < low + c->gap || along > high - c->gap) return nullptr;
  if (!leads_in(c, e, side, arc) && in * std::sin(arc.span) >= -c->gap * (1 - std::cos(arc.span)))
    return nullptr;
  return c;
}

// Whether the way out of a contact with the plane of an edge's side leads into the wall: it is from behind.
bool SurfaceSearch::leads_in(const SurfaceContact* c, const MeshPatch::Edge& e, int side, const Arc& arc) {
  return c && e.sides == 2 && c->normal.dot(arc.end(side)) < 0;
}

// Leaves a contact out, for another if there is one.
void SurfaceSearch::drop(const SurfaceContact* c, int other) {
  if (!c) return;
  const auto number = c - out_.contact;
  dropped_[number] = true;
  instead_[number] = other;
}

// The one that is kept for a contact, itself if it is; -1 for none.
int SurfaceSearch::instead_of(int contact) const {
  while (contact >= 0 && dropped_[contact]) contact = instead_[contact];
  return contact;
}

// Whether a contact is deeper than a way out that leaves it out. A flat feature that stands on a plane is
// not given up for a little.
bool SurfaceSearch::deeper(const SurfaceContact* c, double gap) {
  return !c || (c->flat ? kStanding : 1) * c->gap < gap;
}

// The edges that go on straight from one, between the same planes, as pieces of its line.
const std::vector<Stretch>& SurfaceSearch::straight_on(int number) {
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
        const double sign = away(n, v) * (way ? 1 : -1);
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

bool SurfaceSearch::same_planes(const MeshPatch::Edge& a, const MeshPatch::Edge& b) const {
  if (a.sides != b.sides) return false;
  if (a.sides == 1) return plane_of(a, 0) == plane_of(b, 0);
  return (plane_of(a, 0) == plane_of(b, 0) && plane_of(a, 1) == plane_of(b, 1)) ||
         (plane_of(a, 0) == plane_of(b, 1) && plane_of(a, 1) == plane_of(b, 0));
}

// Whether edges that go straight on meet at a vertex.
bool SurfaceSearch::is_on_line(int number) const {
  const MeshPatch::Vertex& v = patch_.vertices()[number];
  for (int i = 0; i < v.edges; ++i)
    for (int k = 0; k < i; ++k) {
      const MeshPatch::Edge &a = patch_.edges()[patch_.edge_at(v.first_edge + i)],
                            &b = patch_.edges()[patch_.edge_at(v.first_edge + k)];
      if (!a.inner && !b.inner && std::abs(a.direction.dot(b.direction)) > kStraightOn) return true;
    }
  return false;
}

// Whether the body meets a face beside a line, from without if it is thinner than it is deep: it may meet the
// line beyond, and be deepest over this piece; or be in the valley that the line makes on the wall's other
// side, beside its end.
bool SurfaceSearch::meets(const std::vector<Stretch>& line, const MeshPatch::Edge& e, const Arc& arc,
                          double gap) {
  const Vec3 off = particle_.x - patch_.vertices()[e.v[0]].x;
  const bool thin = is_thinner(gap);
  return std::any_of(line.begin(), line.end(), [&](const Stretch& piece) {
    const MeshPatch::Edge& here = patch_.edges()[piece.edge];
    for (int i = 0; i < here.sides; ++i) {
      const Vec3 out = e.sides == 1 || plane_of(here, i) == plane_of(e, 0) ? arc.end(0) : arc.end(1);
      if ((!thin || out.dot(off) > 0) && meets_cell(patch_.side(here.first_side + i).cell)) return true;
    }
    return false;
  });
}

// Whether the body comes to its deepest point at a line through a face of it, and not beside that: on the
// wall's other side the line may be a valley's, that the body has next to nothing of. Asked of bodies deeper
// there than a ball inside them is thick; what is less deep is near the line.
bool SurfaceSearch::enters(const FeatureContact& f, const std::vector<Stretch>& line,
                           const MeshPatch::Edge& e, const Arc& arc) {
  if (e.sides == 1 || !is_thinner(f.gap)) return true;
  const Vec3 off = particle_.x - patch_.vertices()[e.v[0]].x;
  for (const Stretch& piece : line) {  // beside an end the cone there may say it
    const MeshPatch::Edge& here = patch_.edges()[piece.edge];
    for (const int v : here.v) {
      const double along = (patch_.vertices()[v].x - patch_.vertices()[e.v[0]].x).dot(e.direction);
      const bool is_end = std::all_of(line.begin(), line.end(), [&](const Stretch& s) {
        return along < 0.5 * (piece.from + piece.to) ? piece.from <= s.from : piece.to >= s.to;
      });
      const double past =
          along < 0.5 * (piece.from + piece.to) ? along - off.dot(e.direction) : off.dot(e.direction) - along;
      if (is_end && past > 0 && cone_at(v) == Cone::outside) return true;
    }
  }
  double way = 0;
  int side = -1;
  for (int i = 0; i < 2; ++i) {
    const double from = arc.end(i).dot(off), to = arc.end(i).dot(off + f.on_body);
    if (from > 0 && to < 0 && from / (from - to) > way) way = from / (from - to), side = i;
  }
  return side < 0 || cell_with(plane_of(e, side), particle_.x + way * f.on_body) >= 0;
}

// ... and at a vertex: that none of its normals parts them is true also of a vertex on the wall's far side.
bool SurfaceSearch::meets(const MeshPatch::Vertex& v) const {
  for (int i = 0; i < v.cells; ++i)
    if (meets_cell(patch_.cell_at(v.first_cell + i))) return true;
  return false;
}

// An edge that stands out, with those that go straight on from it.
void SurfaceSearch::touch_outer_edge(int number, const Arc& arc, bool active) {
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
  if ((apart - std::clamp(apart.dot(e.direction), low, high) * e.direction).squaredNorm() > radius_ * radius_)
    return say(MetEdge::clear);
  const SurfaceContact* beside[2] = {nullptr, nullptr};
  bool free = active;  // no face of it has the body
  for (int i = 0; i < e.sides; ++i) {
    const int p = plane_of(e, i);
    if (!planes_[p].active) continue;
    beside[i] = contact_beside(e, i, arc, low, high);
    if (planes_[p].claimed) free = false;
    if (has_deepest(e, i) && kept(planes_[p].contact)) free = false;
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
    const bool same_way = patch_.edges()[piece.edge].direction.dot(e.direction) > 0;
    edges_[piece.edge].state = f.along >= piece.from && f.along <= piece.to ? MetEdge::along
                               : (f.along < piece.from) == same_way         ? MetEdge::before
                                                                            : MetEdge::beyond;
    if (edges_[piece.edge].state != MetEdge::along) edges_[piece.edge].past = f;
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
                     cell_with(plane_of(e, end), particle_.x + f.on_body) >= 0) &&
                    !passes_by(plane_of(e, end), f.on_body, f.gap);
  const auto gives_way = [&](int side) {
    return leads_in(beside[side], e, side, arc) || deeper(beside[side], f.gap);
  };
  if ((end < 0 || lies) && owner >= 0 && gives_way(0) && gives_way(1) &&
      !(e.sides == 1 && covered(f, line)) && meets(line, e, arc, f.gap) && enters(f, line, e, arc)) {
    edges_[owner].state = MetEdge::along;
    const int contact = edges_[owner].contact = add_edge(f, 1, patch_.edges()[owner], SurfaceContact::edge);
    for (const SurfaceContact* other : beside) drop(other, contact);
    if (face) face->contact = contact;
    return;
  }
  // The way out of the one face leads out of the other, if it is shorter or the other's leads in.
  for (int i = 0; i < 2 && e.sides == 2; ++i) {
    const SurfaceContact* other = beside[1 - i];
    const int there = instead_of(planes_[plane_of(e, i)].contact);
    if (!other || there < 0 || leads_in(&out_.contact[there], e, i, arc)) continue;
    // As short is short enough, once: at the line itself a corner is over both faces.
    const double as_short = other->gap - kWithin * radius_;
    const bool shorter =
        &out_.contact[there] != other && out_.contact[there].gap > as_short && f.gap > as_short;
    if (shorter || leads_in(other, e, 1 - i, arc)) drop(other, there);
  }
}

// A vertex all of whose edges stand out, or a peak between ridges and valleys that no piece of it leads out
// of; false at any other.
bool SurfaceSearch::touch_outer_vertex(int number, const Vec3& guess) {
  const MeshPatch::Vertex& v = patch_.vertices()[number];
  const Cone cone = cone_at(number);
  if (cone == Cone::around) return false;
  if (is_on_line(number)) return true;  // a place of an edge, no more
  Arc arc;
  bool valleys = false;
  for (int i = 0; i < v.edges && cone == Cone::other; ++i) {
    const MeshPatch::Edge& e = patch_.edges()[patch_.edge_at(v.first_edge + i)];
    valleys = valleys || (!e.inner && !outer_arc(e, &arc));
  }
  // Of its pieces' contacts the shallowest leads out of all of them. Those further away than a few times
  // their depth have no shorter way out here.
  const SurfaceContact* near[kSurfaceContacts];
  int count = 0;
  bool touched = false;
  double most = -kFarAway;
  const std::vector<Vec3>& ways = ways_from(number);
  const auto is_normal = [&](const Vec3& d) {
    return std::all_of(ways.begin(), ways.end(), [&](const Vec3& e) { return e.dot(d) <= kOneSide; });
  };
  const auto offer = [&](int contact) {
    const SurfaceContact* c = kept(contact);
    if (!c || std::find(near, near + count, c) != near + count) return;
    if (is_normal(c->normal)) {
      touched = true;
      most = std::max(most, c->gap);
    }
    if (is_near(*c, v.x)) near[count++] = c;
  };
  for (int i = 0; i < v.edges; ++i) {
    const int e = patch_.edge_at(v.first_edge + i);
    if (patch_.edges()[e].inner) continue;
    offer(edges_[e].contact);
    if (edges_[e].state == MetEdge::clear) return !valleys;
  }
  for (int i = 0; i < v.cells; ++i)
    offer(planes_[patch_.cells()[patch_.cell_at(v.first_cell + i)].plane].contact);
  if (touched && count == 0) return true;
  SurfacePoint start;
  const SurfacePoint* from = point_for(guess, &start);
  FeatureContact f;
  bool own = find_only_way_out(particle_, v.x, guess, from, &f);
  if (!own || (!f.touching && !is_normal(f.normal))) {
    f = find_highest_point_contact(particle_, v.x, ways.data(), static_cast<int>(ways.size()), most, from);
    if (valleys && (f.gap < -kPoked * radius_ || f.normal.dot(particle_.x - v.x) <= 0)) return false;
    // Where f is highest at the border of the normals and goes on to rise, an edge has the contact; it may go
    // on along a crease only, as where the body's edge crosses one of the vertex's beyond its other end.
    const auto goes_on = [&](const Vec3& e) {
      return e.dot(f.normal) > -kBorder &&
             gap_along(particle_, v.x, (f.normal + 10 * kBorder * e).normalized(), &f.where).gap > f.gap;
    };
    own = f.touching && f.gap > most && std::none_of(ways.begin(), ways.end(), goes_on) && meets(v) &&
          has_point(particle_, particle_.x + f.on_body, f.normal, f.where);
  }
  if (!f.touching) most = kFarAway;  // nor are its pieces, where a normal parts the body from all of them
  int best = -1;
  if (own && f.touching && is_normal(f.normal) && f.gap > most + kWithin * radius_) {
    most = f.gap;
    best = add_vertex(f, 1, v, SurfaceContact::vertex);
  }
  for (int i = 0; i < count; ++i)
    if (near[i]->gap < most) drop(near[i], best);
  return best >= 0 || !valleys;
}

// A peak between ridges that is in a sharp edge of the body: each ridge has the edge past the peak, and for
// every normal of the edge one of them climbs, so that no piece has a contact. As the edge goes on it comes
// to one of the ridges; until then the contact is the shallowest of theirs, at the peak.
void SurfaceSearch::touch_between_ridges(int number) {
  const MeshPatch::Vertex& v = patch_.vertices()[number];
  const FeatureContact* shallowest = nullptr;
  const auto has_contact = [&](int contact) {
    const SurfaceContact* c = kept(contact);
    return c && is_near(*c, v.x);
  };
  for (int i = 0; i < v.edges; ++i) {
    const int number_of = patch_.edge_at(v.first_edge + i);
    const MeshPatch::Edge& e = patch_.edges()[number_of];
    const MetEdge& met = edges_[number_of];
    Arc arc;
    if (e.inner) continue;
    if (has_contact(met.contact)) return;
    if (!outer_arc(e, &arc)) continue;
    if (met.state != (away(e, number) > 0 ? MetEdge::before : MetEdge::beyond)) return;
    if (!shallowest || met.past.gap > shallowest->gap) shallowest = &met.past;
  }
  if (!shallowest || shallowest->gap < -kPoked * radius_) return;
  for (int i = 0; i < v.cells; ++i)
    if (has_contact(planes_[patch_.cells()[patch_.cell_at(v.first_cell + i)].plane].contact)) return;
  if (!is_clear_of(particle_, &v.x, 1)) add_vertex(*shallowest, 1, v, SurfaceContact::vertex);
}

}  // namespace nurbs

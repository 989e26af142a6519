// One search for a body's contacts with the pieces of a triangle mesh (surface_search.h): planes and their
// faces (surface_search.cpp), edges and vertices by their index (indexed_features.cpp), and those that stand
// out, against bodies that have several maxima there (outer_features.cpp). What each does is said there.
#pragma once

#include <algorithm>
#include <vector>

#include "contact/walls/surface_search.h"

namespace nurbs {

constexpr int kFewCells = 4;       // of a plane, up to which each is looked at on its own
constexpr double kOneSlope = 0.8;  // cosine
constexpr double kSteep = 0.5;     // cosine between the normals of two planes that meet in a steep valley
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
  FeatureContact past;  // met before or beyond: where the edge's line has it
};

// From the point of an edge that is nearest to x.
inline Vec3 from_edge(const MeshPatch& patch, const MeshPatch::Edge& e, const Vec3& x) {
  const Vec3 apart = x - patch.vertices()[e.v[0]].x;
  return apart - std::clamp(apart.dot(e.direction), 0.0, e.length) * e.direction;
}

// The sign of an edge's direction as it leads away from one of its vertices.
inline double away(const MeshPatch::Edge& e, int vertex) {
  return e.v[0] == vertex ? 1 : -1;
}

// An edge as a piece of a line.
struct Stretch {
  int edge;
  double from, to;
};

// What a face has at a vertex: its two edges there, -1 for those that part it from another face.
struct FaceAtVertex {
  int edges[2];
  bool climbs;
};

// Room that is used again by every search of a thread.
struct Workspace {
  std::vector<ActivePlane> planes;
  std::vector<MetEdge> edges;
  std::vector<int> active;
  std::vector<Stretch> line;
  std::vector<FaceAtVertex> faces;
  std::vector<Vec3> corners, ways;  // of a cell; that lead away from a vertex
};
Workspace& workspace();

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

  void run();

 private:
  // What the faces about a vertex make: a convex cone that has the body's centre outside or inside, or
  // something else.
  enum class Cone { outside, around, other };
  // Directions around an edge between which the contact's lies: the slope of f, when d turns about the edge,
  // changes from rising to falling there.
  struct Range {
    Vec3 low, high;
  };

  // Planes and their faces.
  const PairMemory* start_for(const Vec3& normal) const;
  const SurfacePoint* point_for(const Vec3& normal, SurfacePoint* point) const;
  static bool deepest_point(const PolygonState& state, double* gap, Vec3* on_body);
  bool polygon_over(const PlaneRegion& region, double reach, double* gap, Vec3* on_body,
                    double* clear = nullptr) const;
  bool stands_on(const MeshPatch::Plane& plane, ActivePlane* met) const;
  bool stand_on(int number);
  bool stood_on(const Vec3& normal) const;
  double clearance(const MeshPatch::Plane& plane) const;
  Vec3 nearest(const MeshPatch::Cell& cell, const MeshPatch::Plane& plane, const Vec3& c) const;
  bool look_at_plane(int number);
  bool is_steep_valley(const MeshPatch::Edge& e) const;
  double inside(const ActivePlane& met, const MeshPatch::Plane& plane, const MeshPatch::Edge& e) const;
  bool holds(int number, const ActivePlane& met) const;
  int cell_below(int number);
  int cell_above_valley(int number) const;
  bool meets_cells(int number) const;
  int triangle_under(int number, const Vec3& deepest);
  int cell_with(int number, const Vec3& x) const;
  Vec3 crossing(int number, const Vec3& deepest, double gap) const;
  bool in_cell(const MeshPatch::Cell& cell, const Vec3& x) const;
  void touch_face(int number);
  bool is_thinner(double gap) const { return -gap > particle_.scale * particle_.shape->inner_radius; }
  bool reaches_round(int number, const Vec3& deepest, double gap) const;
  bool crosses_wall(const Vec3& to) const;
  bool meets_cell(int number) const;
  bool passes_by(int number, const Vec3& deepest, double gap) const;
  bool add_plane(int number, int triangle, bool flat, double gap, const Vec3& on_body);
  int add(const SurfaceContact& c);
  void leave_out_dropped();
  void touch_any(const std::vector<int>& active);
  void touch_any_end(const std::vector<int>& active);

  // Edges and vertices by their index.
  bool range(const MeshPatch::Edge& e, Range* r) const;
  int first_plane_of(const MeshPatch::Vertex& v) const;
  int shallowest_beside(const MeshPatch::Edge& e) const;
  FeatureContact pointed(const MeshPatch::Edge& e) const;
  FeatureContact at_plane(const ActivePlane& met) const;
  bool all_open(const MeshPatch::Edge& e) const;
  bool has_deepest(const MeshPatch::Edge& e, int side) const;
  void touch_edge(int number);
  bool covered(const FeatureContact& f, const std::vector<Stretch>& line) const;
  void touch_vertex(int number);
  bool touch_indexed_vertex(int number, const Vec3& guess);
  bool lies_under(int number) const;
  const ActivePlane* plane_over(const MeshPatch::Vertex& v) const;
  MetEdge::State state(int edge) const;
  bool climbs(int edge, int vertex, const Vec3& d) const;
  int climbing_faces(int number, const Vec3& d);
  int add_edge(const FeatureContact& f, int weight, const MeshPatch::Edge& e, SurfaceContact::Piece piece);
  int add_vertex(const FeatureContact& f, int weight, const MeshPatch::Vertex& v,
                 SurfaceContact::Piece piece);
  int add_feature(const FeatureContact& f, int weight, int triangle, SurfaceContact::Piece piece, int first,
                  int second);

  // Edges and vertices that stand out.
  bool finds_sharp(double gap) const;
  const std::vector<Vec3>& ways_from(int number) const;
  Cone cone_at(int number) const;
  bool outer_arc(const MeshPatch::Edge& e, Arc* arc) const;
  int plane_of(const MeshPatch::Edge& e, int side) const;
  const SurfaceContact* kept(int contact) const;
  // Of a SurfaceContact or a FeatureContact.
  template <class Contact>
  Vec3 on_wall(const Contact& c) const {
    return particle_.x + c.on_body - c.gap * c.normal;
  }
  template <class Contact>
  bool is_near(const Contact& c, const Vec3& vertex) const {
    return (on_wall(c) - vertex).norm() <= -kNearVertex * c.gap;
  }
  Vec3 into(const MeshPatch::Edge& e, int side) const;
  const SurfaceContact* contact_beside(const MeshPatch::Edge& e, int side, const Arc& arc, double low,
                                       double high) const;
  static bool leads_in(const SurfaceContact* c, const MeshPatch::Edge& e, int side, const Arc& arc);
  void drop(const SurfaceContact* c, int other = -1);
  int instead_of(int contact) const;
  static bool deeper(const SurfaceContact* c, double gap);
  const std::vector<Stretch>& straight_on(int number);
  bool same_planes(const MeshPatch::Edge& a, const MeshPatch::Edge& b) const;
  bool is_on_line(int number) const;
  bool meets(const std::vector<Stretch>& line, const MeshPatch::Edge& e, const Arc& arc, double gap);
  bool meets(const MeshPatch::Vertex& v) const;
  bool enters(const FeatureContact& f, const std::vector<Stretch>& line, const MeshPatch::Edge& e,
              const Arc& arc);
  void touch_outer_edge(int number, const Arc& arc, bool active);
  bool touch_outer_vertex(int number, const Vec3& guess);
  void touch_between_ridges(int number);

  static constexpr double kNearVertex = 4;     // overlaps: contacts that a way out there may be shorter than
  static constexpr double kOneSide = 1e-9;     // rad: square to an edge
  static constexpr double kBorder = 1e-7;      // rad, of the normals at a vertex
  static constexpr double kStanding = 0.5;     // of a standing feature's overlap: ways out shorter than that
  static constexpr double kLineLength = 1e-4;  // of the bounding radius: of a point there is less
  static constexpr double kStraightOn = 1 - 1e-12;  // cosine
  static constexpr double kWithin = 1e-9;           // of the bounding radius: on a cell
  static constexpr double kPoked =
      0.1;  // of the bounding radius: deeper planes have nothing to do with the wall

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

}  // namespace nurbs

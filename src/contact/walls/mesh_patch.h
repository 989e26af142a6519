// The piece of a triangle mesh near one body, as cells, edges and vertices that know each other. Triangles in
// one plane form one *plane*, whatever way they are cut; an edge between two of them is no edge. Corners that
// lie on the side of another triangle split that side, so that meshes that do not conform have no false
// borders. Nothing is asked of orientation: both sides of a triangle are wall.
#pragma once

#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include "contact/walls/plane_region.h"
#include "nurbs/spatial_hash.h"

namespace nurbs {

using Triangle = std::array<Vec3, 3>;

class MeshPatch {
 public:
  struct Vertex {
    Vec3 x;
    int triangle, corner;   // where it comes from
    int first_edge, edges;  // in edges_at()
    int first_cell, cells;  // in cells_at()
    bool inner;             // within one plane: nothing touches it but the plane
  };
  struct Edge {
    int v[2];
    int first_side, sides;  // of the cells that meet here, in side()
    bool inner;             // between two cells of one plane
    Vec3 direction;         // unit, from v[0] to v[1]
    double length;
  };
  struct Side {
    int cell;
    double sign;  // of (cell - edge) . (plane's normal x edge's direction)
  };
  struct Cell {
    int triangle, plane;
    int first, corners;  // corner(first + k), edge_of(first + k) from corner k to k + 1
  };
  struct Plane {
    Vec3 normal;  // unit; either way
    Vec3 origin;
    int first, cells;            // cell numbers in cells_in()
    int leader;                  // the triangle whose plane it is
    double expiry;               // of the caller: a path up to which the body is clear of it
    int first_edge, edges;       // that are not inner, in edge_in()
    int first_vertex, vertices;  // likewise, in vertex_in()
    int hint;                    // cell that had a point last
    // Of the caller: a path up to which the body meets the plane, then with this normal, at a point.
    double pointed = -1e300;
    Vec3 pointed_normal = Vec3::Zero();
  };

  // From triangles in an order that does not depend on ranks; corners closer than `weld` (length) are one.
  // Triangles without area are left out, and those with the corners of an earlier one. Triangles within
  // `flat` (length) of a larger one's plane lie in it. Borders within `crack` (length) of each other are
  // none: files of few digits open them where triangles do not conform. O(n log n) in the number of
  // triangles, as a rule.
  void build(const Triangle* triangles, int count, double weld, double flat = 0, double crack = 0);
  // A single plane without bounds.
  void build_plane(const Vec3& origin, const Vec3& normal);
  // The same triangles somewhere else.
  void move(const Triangle* triangles);
  void move_plane(const Vec3& origin, const Vec3& normal);

  bool unbounded() const { return unbounded_; }
  const std::vector<Vertex>& vertices() const { return vertices_; }
  const std::vector<Edge>& edges() const { return edges_; }
  const std::vector<Cell>& cells() const { return cells_; }
  std::vector<Plane>& planes() { return planes_; }
  const std::vector<Plane>& planes() const { return planes_; }
  const Side& side(int i) const { return sides_[i]; }
  int edge_at(int i) const { return edges_at_[i]; }
  int cell_at(int i) const { return cells_at_[i]; }
  int cell_in(int i) const { return cells_in_[i]; }
  int edge_in(int i) const { return edges_in_[i]; }
  int vertex_in(int i) const { return vertices_in_[i]; }
  double sign_of(int i) const { return signs_[i]; }  // of the cell of corner i about its side from there
  int corner(int i) const { return corners_[i]; }
  int edge_of(int i) const { return edge_of_[i]; }
  // Whether the side from a cell's corner k on is what bounds the cell beside x: of a triangle's side that
  // corners of others split it is the piece that x is beside. Those corners are off the side by round-off,
  // where the pieces' lines, taken for endless, would leave wedges that no cell has.
  bool bounds(const Cell& cell, int k, const Vec3& x) const {
    return cell.corners == 3 || is_beside(cell, k, x);
  }
  // Whether the corner is another triangle's, on a side of the cell's own.
  bool splits_side(int i) const { return splits_[i] != 0; }
  // What of a plane is wall; stays until the triangles move.
  const PlaneCells& cells_of(int plane);
  std::size_t bytes() const;

 private:
  struct Key {
    int low, high, cell, slot;
  };
  void weld(const Triangle* triangles, int count, double distance);
  void add_cell(const std::array<int, 3>& at, int triangle);
  std::vector<Key> lonely_sides();
  static std::vector<int> ends_of(const std::vector<Key>& sides);
  void close_cracks(double distance);
  bool is_beside(const Cell& cell, int k, const Vec3& x) const;
  void split_sides(double distance);
  int find_plane(const Triangle& t, double distance) const;
  void find_planes(const Triangle* triangles, double distance);
  void find_edges();
  void link_vertices();
  void place();
  void classify();
  void list_outlines();
  void forget_cells();

  std::vector<Vertex> vertices_;
  std::vector<Edge> edges_;
  std::vector<Side> sides_;
  std::vector<Cell> cells_;
  std::vector<Plane> planes_;
  std::vector<int> corners_, edge_of_, edges_at_, cells_at_, cells_in_, edges_in_, vertices_in_, order_;
  std::vector<double> signs_;
  std::vector<char> splits_;  // corners of other triangles, on a side of the cell's own
  std::vector<Key> keys_;
  SpatialHash vertices_by_place_, cells_by_corners_, planes_by_normal_;
  std::vector<PlaneCells> outlines_;  // by plane; empty until asked for
  bool unbounded_ = false;
};

}  // namespace nurbs

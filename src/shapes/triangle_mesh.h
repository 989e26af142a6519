// Triangle meshes as they come from scanners and CAD: made one closed surface with an inside, or refused.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <string>
#include <vector>

#include "body/shape.h"
#include "nurbs/types.h"

namespace nurbs {

struct TriangleMesh {
  std::vector<Vec3> points;
  std::vector<std::array<int, 3>> triangles;
};

Eigen::AlignedBox3d bounding_box(const std::vector<Vec3>& points);

// Moves points so that the middle of their bounding box is the origin; returns where it was.
Vec3 move_to_origin(std::vector<Vec3>& points);

// Without the points that no triangle uses; the others in the order of their use.
TriangleMesh drop_unused(const TriangleMesh& mesh);

// A point within `tolerance` (length) of an earlier one that stays becomes that; triangles that lose a corner
// go, and so do repeated ones. Points no triangle uses go too.
TriangleMesh weld(const TriangleMesh& mesh, double tolerance);

// The connected pieces (over shared points), largest bounding box first.
std::vector<TriangleMesh> split_pieces(const TriangleMesh& mesh);

// How a piece fails to bound a solid.
struct MeshDefects {
  int open_edges = 0;  // with one triangle
  int wild_edges = 0;  // with more than two
  int turned = 0;      // triangles whose winding disagreed and was turned
  bool one_sided = false;
  Vec3 where = Vec3::Zero();  // the middle of an open edge
};

// Winds all triangles alike, outward; says what is wrong.
MeshDefects orient(TriangleMesh& mesh);

// Of the uniform solid of unit density inside a closed mesh, wound outward. Exact.
MassProperties mesh_properties(const TriangleMesh& mesh);

}  // namespace nurbs

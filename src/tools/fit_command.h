// The fit of meshes, for commands that make their own.
#pragma once

#include <string>
#include <vector>

#include "body/shape.h"
#include "shapes/triangle_mesh.h"

namespace nurbs {

struct FitArguments {
  std::string file, output, tolerance = "1%", patches, keep, piece;
  std::string inexact;  // of a solid: why its faces are not taken as they are
  double sag =
      0;  // share of the radius by which the mesh may miss what it stands for; taken off the tolerance
};

// Fits, writes and reports as `nurbs-shape fit` does; throws UsageError or ShapeError with nothing written.
void fit_mesh(const FitArguments& a, const TriangleMesh& raw);

// Whether a body, moved by `place`, is so far from the origin that its coordinates may lose digits.
bool is_far(const Shape& shape, const Vec3& place = Vec3::Zero());

// Moves the surfaces of a body that was made about the origin to its `place` in `file`, unless that is so far
// away that they lose digits which joints and curvatures need: says so then, and leaves them.
void put_in_place(const std::string& file, const Shape& about_origin, const Vec3& place,
                  std::vector<NurbsSurface>& surfaces);

// The share that --tolerance states; throws UsageError.
double fit_tolerance(const std::string& command, const std::string& text);

}  // namespace nurbs

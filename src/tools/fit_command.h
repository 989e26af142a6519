// The fit of meshes, for commands that make their own.
#pragma once

#include <memory>
#include <string>

#include "io/shape_file.h"
#include "shapes/triangle_mesh.h"

namespace nurbs {

struct FitArguments {
  std::string file, output, tolerance = "1%", patches, keep, piece;
  double sag =
      0;  // share of the radius by which the mesh may miss what it stands for; taken off the tolerance
};

// Fits, writes and reports as `nurbs-shape fit` does; throws UsageError or ShapeError with nothing written.
void fit_mesh(const FitArguments& a, const TriangleMesh& raw);

// Moves a body that was made about the origin to its `place` in `file`, unless that is so far away that
// coordinates lose digits which its joints and curvatures need: says so then, and leaves it. What is written.
std::shared_ptr<const Shape> put_in_place(const std::string& file, const std::string& output,
                                          const Vec3& place, ShapeFileContent& content);

// The share that --tolerance states; throws UsageError.
double fit_tolerance(const std::string& command, const std::string& text);

}  // namespace nurbs

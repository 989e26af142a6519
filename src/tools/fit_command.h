// The fit of meshes, for commands that make their own.
#pragma once

#include <string>

#include "shapes/triangle_mesh.h"

namespace nurbs {

struct FitArguments {
  std::string file, output, tolerance = "1%", patches, keep, piece;
  double sag =
      0;  // share of the radius by which the mesh may miss what it stands for; taken off the tolerance
};

// Fits, writes and reports as `nurbs-shape fit` does; throws UsageError or ShapeError with nothing written.
void fit_mesh(const FitArguments& a, const TriangleMesh& raw);

// The share that --tolerance states; throws UsageError.
double fit_tolerance(const std::string& command, const std::string& text);

}  // namespace nurbs

// Solids of CAD files (STEP, IGES, BREP) through Open CASCADE. Only cad_file.cpp includes it, and nurbs-shape
// alone links it; built without it, every function here throws an error that says so.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "body/shape.h"
#include "shapes/triangle_mesh.h"

namespace nurbs {

// One solid. Lengths are `scale` times the millimetres (BREP: units) of the file.
struct CadSolid {
  std::string name;  // as in the file, may be empty
  std::string unit;  // of length in the file; empty: it names none
  int faces = 0, cavities = 0;
  int beside = 0;  // faces of the file that belong to no solid, and to none here
  Vec3 extent;     // of its bounding box
  // Its faces as patches, exactly: those whose outline is a rectangle of parameters as they are, plane ones
  // as a quadrilateral or a fan about a point inside.
  std::optional<std::vector<NurbsSurface>> exact;
  std::string trimmed;  // why there is no exact form
  // Its outer shell in triangles with corners on the surface, off by about `deflection` (a length) at most.
  std::function<TriangleMesh(double deflection)> tessellate;
};

// The solids of `file`, told apart by its ending: .step, .stp, .iges, .igs, .brep. Faces that bound no solid
// are sewn. Throws ShapeError, one line that begins with the file's name.
std::vector<CadSolid> read_cad_file(const std::string& file, double scale);

// Writes the body as one closed solid of B-spline faces, millimetres being the shape's lengths times `scale`.
// Returns the solid's volume in mm^3, as Open CASCADE integrates it. Throws ShapeError.
double write_step_file(const Shape& shape, double scale, const std::string& file);

}  // namespace nurbs

// Triangle meshes from STL (ASCII and binary), OBJ and PLY (ASCII and binary) files.
#pragma once

#include <string>

#include "shapes/triangle_mesh.h"

namespace nurbs {

// Reads `file`, told apart by its content and ending; polygons are cut into fans. Points as they are in the
// file, not welded. Throws ShapeError, one line that names the file, what is wrong and where.
TriangleMesh read_mesh_file(const std::string& file);

}  // namespace nurbs

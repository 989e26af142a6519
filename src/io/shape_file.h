// Shape files: JSON in the layout of NURBS-Python (geomdl); see README, "Shapes".
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "body/shape.h"

namespace nurbs {

struct ShapeFileContent {
  std::vector<NurbsSurface> surfaces;
  std::optional<Mat3> gyration;
  std::vector<std::string> warnings = {};  // of what was read; without the file's name
};

// Parses and validates the text of a shape file; `file` is only used to word errors. Points are Cartesian,
// weights optional (all 1), keys not known are ignored. Throws ShapeError, one line naming file, patch
// (counted from 0), value and allowed range.
ShapeFileContent parse_shape(const std::string& text, const std::string& file);

// The text of a shape file, numbers at full precision. parse_shape(write_shape(c)) == c bit for bit for
// whatever came from a file or has weights 1; a product w x that no Cartesian x reproduces comes back 1 ulp
// off, once.
std::string write_shape(const ShapeFileContent& content);

// The decimals that all coordinates of the control points get by with; 0 where those are more than 10.
int few_decimals(const std::vector<NurbsSurface>& surfaces);

// Reads `file` and builds its shape; the shape's name is the file's stem. Throws ShapeError; errors and
// warnings begin with "FILE: ".
std::shared_ptr<const Shape> read_shape_file(const std::string& file,
                                             std::vector<std::string>* warnings = nullptr);

}  // namespace nurbs

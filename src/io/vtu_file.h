// A scene of placed bodies as a VTK unstructured grid (.vtu): their exact surfaces, one rational Bezier cell
// per patch, which ParaView and VTK draw as curved surfaces.
#pragma once

#include <iosfwd>
#include <string>
#include <utility>
#include <vector>

#include "body/shape.h"
#include "nurbs/types.h"

namespace nurbs {

// One body of the scene. Lab frame; `orientation` turns the shape's axes (centre of mass at the origin) into
// it.
struct VtuBody {
  int id = 0, type = 0;
  int shape = 0;  // index into the shapes, counted from 0
  double scale = 1;
  Vec3 position = Vec3::Zero();
  Quat orientation = Quat::Identity();
  Vec3 velocity = Vec3::Zero(), omega = Vec3::Zero();
};

// Writes the scene, in the order of `bodies`. Points are 64-bit floats. Point data: RationalWeights. Cell
// data: HigherOrderDegrees, id, type, shape (counted from 1, as users do), patch, velocity and omega of the
// body. The first array of each is also named as the attribute of that name: without that VTK takes every
// weight as 1 and guesses the degrees. XML with inline base64, in the machine's byte order. Memory is
// constant; check `out` afterwards.
void write_vtu(std::ostream& out, const std::vector<VtuBody>& bodies, const std::vector<const Shape*>& shapes,
               double time);

// Writes a ParaView collection (.pvd): which file shows which time. Entries are (time, file name).
void write_pvd(std::ostream& out, const std::vector<std::pair<double, std::string>>& entries);
// Entries of a collection written by write_pvd; lines that are none are passed over.
std::vector<std::pair<double, std::string>> read_pvd(std::istream& in);

}  // namespace nurbs

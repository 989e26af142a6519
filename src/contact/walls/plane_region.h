// The part of a plane that is wall.
#pragma once

#include <vector>

#include "nurbs/types.h"

namespace nurbs {

// Convex cells of one plane, as a triangle mesh has them, lab.
struct PlaneCells {
  std::vector<Vec3> corners;  // in order around each
  std::vector<int> ends;      // behind each cell's last corner
  std::vector<Vec3> border;   // pairs of ends of the sides that no two cells share
};

struct PlaneRegion {
  Vec3 origin = Vec3::Zero(), normal = Vec3::Zero();  // unit, towards the particle
  const PlaneCells* cells = nullptr;                  // null: all of the plane
};

}  // namespace nurbs

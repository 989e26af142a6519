// A contact of a body with a cylinder that goes on from the last step.
//
// Contacts are stationary values of F(c) = h(c) + c . apart over the unit c square to the cylinder's axis, h
// the body's support function, `apart` its centre seen from the axis. With a turn of c
//     F'' = rho - F,    rho the curvature radius of the body's outline along the axis.
// Inside the cylinder they are maxima, c points outward and gap = radius - F; outside they are minima with F
// < 0, c points at the axis and gap = -radius - F. c is the body's outward normal there, -c the contact's. A
// body that is more curved than the tube (rho < radius) about c has no other maximum above the radius near:
// see tube_search.h.
#pragma once

#include "contact/contact.h"
#include "contact/pair_memory.h"
#include "contact/walls/feature_search.h"

namespace nurbs {

// A cylinder and a body's centre. The axis is unit, `apart` square to it.
struct CylinderPose {
  Vec3 axis, apart;
  double radius;
  double side;   // 1: the body is inside, -1: outside
  double noise;  // round-off of `apart` and of the body's reach, length
};

struct CylinderContact {
  double gap = 0;               // of the stationary value; not negative where the body has left the wall
  Vec3 normal = Vec3::Zero();   // unit, lab, from the wall to the body
  Vec3 on_body = Vec3::Zero();  // the body's point, relative to its centre of mass, lab axes
  SurfacePoint where;
  Rung rung = Rung::none;
  int iterations = 0;
};

// LocalModel::unique of a memory whose model.b is a support model for a cylinder; model.a then means nothing.
constexpr double kCylinderModel = -3;

// What a contact that was found otherwise leaves for the next step.
PairMemory cylinder_memory(const Particle& particle, const SurfacePoint& where);

// The stationary value next to the last one: by the body's local model there (50 ns), where its errors leave
// the overlap and the normal as right as `settings` ask (pair_memory.h), else by Newton on the surface, for
// the stationary distance from the axis (0.1 us an iteration), else, on creases and corners too, by Newton in
// c over supports. False where that leads nowhere: on ruled lines and flats, on dents, after long ways. The
// memory then stays as it is.
bool follow_on_cylinder(const Particle& particle, const CylinderPose& pose, const ContactSettings& settings,
                        PairMemory* memory, CylinderContact* contact);

}  // namespace nurbs

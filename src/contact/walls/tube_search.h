// All contacts of a body inside a cylinder: the maxima above the radius of its distance from the axis,
//
//     F(d) = max over b in B of d . (b - axis),    d unit, square to the axis.
//
// With a turn of d, F'' = rho - F, rho the curvature radius of the body's outline along the axis. Where rho <
// radius in an arc of less than half a turn, F has one maximum above the radius there at most: F - radius
// would, between two of them, stay negative for half a turn (Sturm). So a body that is everywhere more curved
// than the tube has one contact. On others (flats, ruled lines) the circle is sampled once, and split into
// what F is proven to stay `room` below the radius in, and arcs whose maxima are followed
// (cylinder_follow.h) until the body has moved by `room`. Between two contacts F may have a minimum above the
// radius: that is one of weight -1, as in the valleys of meshes (surface_search.h).
#pragma once

#include "contact/walls/cylinder_follow.h"
#include "contact/walls/surface_search.h"

namespace nurbs {

// What was found of the circle around a body, and from where. Empty when `room` is 0.
struct TubeSurvey {
  static constexpr int kMostArcs = 4, kMostOpen = 10;
  struct Arc {
    Vec3 middle;        // unit, lab
    double half;        // cosine of half its width
    double clear;       // by which F stayed below the radius then; not positive with a contact
    PairMemory memory;  // of its maximum, where that is no contact
  };
  // Two directions between which the outline is too short for two contacts, though not proven round; or
  // round, beside such.
  struct Open {
    bool round;
    Vec3 low, high;  // unit, lab
    SurfacePoint at_low, at_high;
  };
  struct Pose {
    Vec3 axis, apart;  // of the tube, and the body's centre from it
    Quat q;
  };
  double room = 0;          // that the body may move from `pose`
  double still = 0;         // ... and from `still_pose` until other contacts may be between such directions
  std::uint64_t stamp = 0;  // of the body
  double radius = 0;
  Pose pose, still_pose;
  int count = 0, opens = 0;
  bool wide = false;   // something else is open: nothing holds beyond `still`
  int open_count = 0;  // contacts at `still_pose` that lie in none of the arcs
  Arc arc[kMostArcs];
  Open open[kMostOpen];
};

// Whether a body has a tube's survey to be kept from step to step: for others there is nothing to survey.
bool wants_survey(const Particle& particle, double radius);

// Adds all contacts to `out`, empty before; where there is none, returns a bound by which the body is clear
// of the wall, or 0. `survey` may be nullptr. One Newton or local model a contact as long as the survey
// holds, or if the body wants none; else one search of 4 to 6 supports, or some 20 to 40 around the circle:
// maxima there closer than 2e-3 rad, or than a fiftieth of the body on the wall, are found as one unless the
// body is proven more curved than the tube about them.
double find_in_tube(const Particle& particle, const CylinderPose& pose, const ContactSettings& settings,
                    const FormerContact* former, int former_count, TubeSurvey* survey, SurfaceContacts* out);

// The contact of a body, with what it leaves for the next step.
SurfaceContact surface_contact(const CylinderContact& contact, const PairMemory& memory);

}  // namespace nurbs

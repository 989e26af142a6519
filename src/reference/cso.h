// The paper's own method (Craveiro & Gay Neto, eqs 8-20), kept as the reference solver.
#pragma once

#include "body/shape.h"
#include "contact/contact.h"

namespace nurbs {

struct CsoStart {  // where to begin; all-default means a cold start
  bool valid = false;
  Vec3 direction = Vec3::Zero();  // A towards B, lab axes
  SurfacePoint on_a, on_b;
};

// Minimises f2(rho, phi) = |g|^2/2 by trust-region Newton with support mappings inside. Cold start: the f1
// minimiser's normals (eq. 8). `start`, when given, is used if valid and receives the solution.
ContactResult solve_cso(const Particle& a, const Particle& b, double tolerance, CsoStart* start = nullptr);

// The same with what find_contact keeps for a pair (kPairMemorySize doubles): starts from the last solution.
ContactResult find_contact_cso(const Particle& a, const Particle& b, const ContactSettings& settings,
                               double* memory);

}  // namespace nurbs

// All contacts of a convex body with an infinite cylinder, from outside or inside.
//
// Directions d square to the axis are enough. Outside, the two are convex: one contact, the line contact of
// the axis with the cylinder's radius. Inside, the body's distance from the axis,
//     F(d) = max over b in B of d . (b - axis),
// has a maximum for every place where the body leans on the wall: contacts are all the local maxima of F
// above the radius. An oblong body across a tube has two.
#pragma once

#include "contact/walls/tube_search.h"

namespace nurbs {

// The body is inside when its centre of mass is. Normals point to the body. `path`: see surface_search.h;
// without a contact, `expiry` says how far the body is from one. `former`: contacts of the last step, which
// are followed (cylinder_follow.h); `survey`: what the last steps found around the body (tube_search.h), or
// nullptr. 0.1 to 0.2 us where that serves; else one search of 4 to 6 supports, or of some 20 to 40 inside a
// tube whose radius is less than one of the body's radii of curvature, or where it has flats.
void find_cylinder_contacts(const Particle& particle, const Vec3& origin, const Vec3& axis, double radius,
                            const ContactSettings& settings, double path, const FormerContact* former,
                            int former_count, TubeSurvey* survey, SurfaceContacts* out);

}  // namespace nurbs

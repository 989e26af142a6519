// All contacts of a convex body with a triangle mesh near it.
//
// Let phi(s) be what a penalty law makes of the gap between the body and a convex piece s of the wall (a
// triangle, an edge, a vertex). For a body that overlaps by less than its curvature radii,
//
//     U = sum over triangles phi(T) - sum over edges (k - 1) phi(E) + sum over vertices c phi(V)
//
// (k triangles at an edge; c such that the coefficients of all pieces around a vertex add up to 1) is a
// valuation: cutting a triangle in two changes nothing, so U does not know the mesh, and it is as smooth as
// phi and the gaps are. Where the piece's nearest point lies on its border, phi of the piece is that of the
// border, and almost all cancels. What is left at a feature is the index of Banchoff (J. Diff. Geom. 1 (1967)
// 245) of the height along its contact direction d there,
//
//     1 - (cells above) - sum over edges above (1 - k),      above: climbs along d from the feature,
//
// which is 1 in the face, at a convex edge or vertex, 0 where the surface passes through, and -1 at the
// bottom of a valley so shallow that the body reaches it: its two walls then count the overlap twice.
// Contacts with a negative weight take that back, and a body rolling in a faceted trough feels one surface. A
// sharp valley gives two contacts, as its bottom line does not touch.
//
// A body sharper than its overlap with a plane is deep has several maxima over directions: a face may have
// its deepest point, behind the plane by all its size and over the border by next to nothing, or not meet it
// at all. At edges that stand out towards the body, and borders, the contact is then the highest of all
// maxima over the normals that the wall has there, from one face's to the other's; at vertices all of whose
// edges do, over the cone of normals there, where an interior one is highest. Contacts of the pieces beside
// that are deeper are left out, as are those whose way out leads into the wall, and those of faces, edges and
// vertices where the body is clear of the wall about them (GJK).
#pragma once

#include "contact/pair_memory.h"
#include "contact/polygons/contact_polygon.h"
#include "contact/walls/feature_search.h"
#include "contact/walls/mesh_patch.h"

namespace nurbs {

struct SurfaceContact {
  double weight = 1;            // index of the feature
  double gap = 0;               // < 0
  Vec3 normal = Vec3::Zero();   // unit, lab, from the wall to the body
  Vec3 on_body = Vec3::Zero();  // deepest point, relative to the body's centre of mass, lab axes
  int triangle = -1;            // one that has the point, as numbered in the patch
  int plane = -1;               // of the patch, for faces; else -1
  // The piece of the wall: a plane and its leading triangle, an edge and the first two at it, a vertex as a
  // triangle and its corner. `under`: below a valley's edge or vertex, by the shallower plane.
  enum Piece { face, edge, vertex, under_edge, under_vertex } piece = face;
  int of[2] = {-1, -1};
  bool flat = false;  // a flat face, crease or ruled line stands on the plane
  Rung rung = Rung::none;
  int iterations = 0;
  bool converged = true;
  PairMemory memory;  // for the next step
};

// A contact of the last step.
struct FormerContact {
  Vec3 normal;
  const PairMemory* memory;
  bool flat;                                // has a polygon ...
  const ContactPolygon* polygon = nullptr;  // ... this one, if it is known, ...
  Vec3 frame = Vec3::Zero();                // ... with arms from this fixed point of the wall, ...
  double until = -kFarAway;                 // ... beside which the body touches nowhere before this path
  bool subtracts = false;                   // its weight is negative
};

inline FormerContact former_contact(const SurfaceContact& c) {
  FormerContact f{c.normal, &c.memory, c.flat};
  f.subtracts = c.weight < 0;
  return f;
}

constexpr int kSurfaceContacts = 64;

struct SurfaceContacts {
  int count = 0;
  SurfaceContact contact[kSurfaceContacts];
  double expiry = -kFarAway;  // path up to which the body is clear of all planes, when there is no contact
  bool full = false;          // more than kSurfaceContacts: the others are left out
  void add(const SurfaceContact& c);
};

// The contact at an edge, a vertex or a line of the wall; nothing of it is proven beyond this pose.
SurfaceContact surface_contact(const FeatureContact& f, int triangle);

// Whether a body has flat faces, creases or corners, so that its contacts with pieces of a bent wall come and
// go at finite overlap.
inline bool edged(const Shape& shape) {
  return !shape.smooth || !shape.flats.empty();
}

// The region that a plane of the patch is, until the patch changes.
PlaneRegion plane_region(MeshPatch& patch, int plane, const Vec3& body);

// A body whose flat face, crease or ruled line stands on a plane has one contact with all of that plane, and
// none with its edges: contact_polygon.h has the points. Where a body is sharper than its overlap is deep,
// gaps at edges are no critical values, and nothing is taken off: its contacts come and go at finite overlap,
// and scene/wall_energy.cpp sees to it that their energies add up.
//
// `path`: the body's and the wall's, as in Bodies::path; planes that the body is proven clear of are not
// looked at before it has gone far enough. `former`: contacts of the last step, whose memory is gone on from.
void find_surface_contacts(const Particle& particle, MeshPatch& patch, const ContactSettings& settings,
                           double path, const FormerContact* former, int former_count, SurfaceContacts* out);

// The path up to which a body that has one contact, at a point of a plane's face, has no other and that one
// on the same face, however it moves: all of the plane that it can reach is wall, and other planes are out of
// its reach. For walls that stand still; not above `path` where that is not known.
double one_face_until(const Particle& particle, const MeshPatch& patch, double path,
                      const SurfaceContacts& found);

}  // namespace nurbs

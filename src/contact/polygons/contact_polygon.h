// Several contacts of one pair: where flat faces, creases or ruled lines meet a plane or each other, the
// contact is a polygon of up to eight points with frozen places and weights,
//
//     U = factor kn sum_i w_i min(0, gap_i)^2 / 2,        sum_i w_i = 1.
//
// One body (or the plane) is the *reference*: it owns a plane and its normal. The other one is *incident*: it
// owns the points. (Box2D's and Bullet's reference face; there points are remade every step, here they stay,
// as otherwise U is no function of the poses.) gap_i is the distance of the body-fixed point i from the
// body-fixed plane, so that the force factor w_i kn |gap_i| along the normal, acting on both bodies at the
// same place, is exactly - dU/d(pose) of both, rotation of the reference body included.
//
// Conventions as in contact.h: the normal points from A to B, gaps are negative in overlap; for a plane A is
// the plane. Shape axes and scale 1 inside ContactPolygon, lab axes and lengths outside. Nothing here
// allocates, throws or prints.
//
// Life of a contact, by the caller:
//  1. Single point (ladder) with overlap delta > 0: try make_*_polygon with reach = max(kReach delta, the
//     overlap at rest). count = 0: stay with the single point. Asking at the first touch is best: U is then
//     nothing.
//  2. Hand-over: give_energy(U before / kn, ..) keeps U continuous. A polygon that would hold less is stiffer
//     by its factor (a corner that comes down flat: up to 4), and relax(polygon, state, dt / time) brings
//     that to 1 over some periods of a contact that rests or lasts, and returns the work / kn that this puts
//     into the springs, < 0, to be booked. In one that would hold more the reference plane stands back by a
//     shift, in which nothing is felt: it is as stiff as any other and gives back what it took, where a small
//     factor would let bodies sink into each other. The shift goes under bodies at rest. A contact that opens
//     (U = 0) starts again.
//  3. Every step: evaluate, then judge.
//     keep:   forces from the state.
//     open:   no point overlaps. Back to the single point and to 1.
//     moved:  the points slid over the reference outline by more than `room`, or they belong to a ruled line,
//             which rolls (points that stay behind on it would drive it on): remake. Book the jump
//             stored_energy(new) - stored_energy(old), or take it up as in 2. It is of second order:
//             none under a uniform gap, whatever the weights.
//     tilted: some points are open, or it stands on a crease, so the body may touch elsewhere: compare with
//             support_gap (one support search) by outgrown(); only if that says so, remake. That it does not
//             holds for the way `still_holds`. Where all points
//             of a face are closed it can't be: beside a face the body falls away.
//     A remake takes kKeptReach. One that yields count = 0 hands back to a single point, likewise.
//     What came to the surface within the step, as a face does whose other edge comes down, nothing has held
//     before, and is added.
//  4. match() tells from which old point every new one inherits its history. A spring xi_i is a displacement,
//     its force w_i kt xi_i: copying it keeps the sum under a plain slide, whatever the weights.
//
// Limits. A disc's rim is as soft as its springs: it tips early by some (m g / kn / radius)^(2/5) rad, the
// same way all round. Second moments of corner springs are up to three times those of a uniform bedding.
// Round faces cut by a border, or that are the reference, are polygons of eight points.
#pragma once

#include <cstdint>
#include <type_traits>

#include "body/convex_polygon.h"
#include "contact/contact.h"
#include "contact/walls/plane_region.h"

namespace nurbs {

// --- tolerances
constexpr double kReach = 3;  // overlaps by which points of one feature may lag behind the deepest when the
                              // contact is new (a box on the brink of tipping needs 1) ...
constexpr double kKeptReach = 12;     // ... and when a polygon is remade: a leaning body stands on few points
constexpr double kSlideShare = 1e-3;  // of the polygon's size that cut points may slide before a remake: a
                                      // jump of the torque by 5e-4, of U by 1e-7
constexpr double kReferenceShare = 0.05;  // of the overlap by which the other face must be the shallower one
                                          // to become the reference
constexpr double kOutgrownShare = 0.1;    // of the overlap by which the body may be deeper than its points
constexpr double kSameLine = 0.99;        // cosine between a line and the one it rolled to ...
constexpr double kRolledPast = 0.5;       // ... and of its length that the old one may reach past it
constexpr double kRelaxed = 1e-8;         // of the factor: as good as 1
constexpr double kClearTurn = 0.2;   // of the smaller bounding radius: what a contact's normal that turns
                                     // by 1 rad takes off its clear way
constexpr double kClearGrowth = 2;   // what an overlap of two bodies that changes by 1 takes off it
constexpr double kClipSlack = 1e-9;  // of the larger bounding radius: places that count as equal

struct ContactPolygon {
  std::int32_t count;      // 0: none; 2: a segment; 3 to 8: in order around the polygon
  std::int32_t reference;  // 0: A (or the plane), 1: B
  std::int32_t ring;     // > 0: a whole round face, number ring - 1; the points stand for eighths of its rim
  std::int32_t rolling;  // 1: remake every step, the points follow a ruled line
  std::int32_t far;      // the point furthest from point 0
  float age;             // by the caller: how long factor or shift have been its, rad of its oscillation
  double normal[3];      // outward, of the reference plane, in its shape axes (a plane: lab axes)
  double offset;         // normal . x of that plane, scale 1 (a plane: 0, from its origin)
  double factor;         // see above; 1 unless set by the caller
  double room;           // lateral motion until it must be remade, length
  double mark[2][3];     // points 0 and `far` in the reference's axes when made, length
  double point[kContactPoints][3];   // incident shape axes, scale 1
  double weight[kContactPoints];     // sum 1
  std::uint32_t id[kContactPoints];  // vertices or sides that made it, for either reference; 0 unknown
  double shift;  // by which the reference plane stands back, length: gaps are counted from there
};
static_assert(std::is_trivially_copyable_v<ContactPolygon> && sizeof(ContactPolygon) == 416);

// Mean of the points, incident shape axes, scale 1.
Vec3 middle_of(const ContactPolygon& polygon);

// A placed body as evaluation needs it; a plane is one with scale 1 and the lab's axes at its origin.
struct BodyFrame {
  double scale = 1;
  Vec3 x = Vec3::Zero();
  Mat3 axes = Mat3::Identity();  // shape into lab
  const Shape* shape = nullptr;  // read only for round faces
};
BodyFrame body_frame(const Particle& particle);
BodyFrame plane_frame(const Vec3& origin);

// The contact of a particle (B) with the plane through `origin` with unit `normal` towards the particle (A).
// The face, crease or ruled line takes part whole if all its points lag behind the deepest one by at most
// `reach` (length); false and count = 0 where none does. 0.8 us for a box, 2.5 us for a disc,
// 11 us for a rounded box: mostly one support search from a cold start.
//
// `clear`, of this and the others, is set where the answer is no: how far the bodies' points may go, paths of
// both together, before it can be another one; 0 where that is not known. It holds for contacts whose overlap
// grows by no more than they go; of the normal's turns kClearTurn is to be taken off. Of two bodies it
// is how far B's points may go as seen from A, and of the overlap's changes kClearGrowth is to be taken off.
bool make_plane_polygon(const Particle& particle, const Vec3& origin, const Vec3& normal, double reach,
                        ContactPolygon* out, double* clear = nullptr);

// The contact of a particle with a region of a plane. `frame`: the fixed point of the wall that arms and
// marks are counted from. Of a face, crease or ruled line that reaches over the border the part over the
// region counts: its points are the corners of the hull of that part, which need not be convex itself.
// `clear`: a feature meets the plane, but not over the region.
enum class RegionContact { point, clear, polygon };
RegionContact make_region_polygon(const Particle& particle, const PlaneRegion& region, const Vec3& frame,
                                  double reach, ContactPolygon* out, double* clear = nullptr);

// The contact of two particles touching with `normal` (A to B, lab) and `overlap`, as the ladder found them;
// the normal need only be good to some degrees, as the faces supply theirs. Candidates for the reference are
// the face of each body nearest to the normal, if the overlap along its normal is at most overlap + reach;
// the shallower one is taken (separating axis), within kReferenceShare the one `old` (may be null) had, else
// A, except that a face lying inside the other is incident. The incident face is clipped by the reference's
// outline; if its clipped points are not all within reach, a crease, then a ruled line of the incident body,
// is clipped instead. Without a face, two parallel lines give the segment they share, with the longer one in
// the reference plane (of equal ones A's), across which the bodies overlap least. Round sides whose lines
// cross share one while it would lack a hundredth of the overlap at most where they lie beside each other.
// Crossing edges, and corners on faces, are single points: false, count = 0. 1.5 us for two boxes, 15 to 30
// us for discs and rounded boxes, of which support searches from cold starts are the most. `starts`: surface
// points of A and B near the contact, where searches begin; may be null.
bool make_pair_polygon(const Particle& a, const Particle& b, const Vec3& normal, double overlap, double reach,
                       const ContactPolygon* old, ContactPolygon* out, double* clear = nullptr,
                       const SurfacePoint* starts = nullptr);

// Where the points are now. Of a whole round face the normal springs stand on all the points of its outline
// (64, fixed weights FlatFace::weight), so that it has no preferred directions and never needs a remake while
// it leans. They are summed by eighths: each has the resultant of its springs, weight kn |gap|, at their
// centre of pressure, which moves along the rim; U is the sum over the single springs.
struct PolygonState {
  int count = 0;
  Vec3 normal;  // A to B, lab
  double gap[kContactPoints];
  Vec3 arm_a[kContactPoints];  // midpoint between point and plane from A's centre (the plane's origin) ...
  Vec3 arm_b[kContactPoints];  // ... and from B's; lab axes
  double least = 0, most = 0;  // of the gaps, of single points
  double energy = 0;           // U / (factor kn)
  double slid = 0;             // bound on any point's lateral motion over the reference since it was made
};
// About 0.2 us, round faces included.
PolygonState evaluate(const ContactPolygon& polygon, const BodyFrame& a, const BodyFrame& b);

enum class PolygonVerdict { keep, open, moved, tilted };
PolygonVerdict judge(const ContactPolygon& polygon, const PolygonState& state);

// Gap of the incident body's deepest point below the reference plane: one support search, 0.3 to 2 us. `a`
// null for a plane, whose origin is `origin`.
double support_gap(const ContactPolygon& polygon, const Particle* a, const Particle& b,
                   const Vec3& origin = Vec3::Zero());
// Whether the incident body touches deeper than the points say.
bool outgrown(const PolygonState& state, double support_gap);

// The way (paths of both bodies together, radii in lengths) until it may.
double still_holds(const PolygonState& state, double support_gap, double radius_a, double radius_b);

// U / kn, the factor included.
double stored_energy(const ContactPolygon& polygon, const PolygonState& state);

// Whether the polygon is a segment of the line that `old`, of the same bodies, has rolled to: along it, and
// not much shorter. Another edge of the body is not.
bool rolled_along(const ContactPolygon& old, const ContactPolygon& polygon);

// The factor that gives an energy to a polygon that holds `full` at factor 1; 1 where one of the two is none.
double continuity_factor(double energy, double full);
// Gives it that energy by its factor where it holds less, up to `stiffest` (or what it had), and where it
// holds more by its shift, after what its factor had over 1. Returns the state then.
PolygonState give_energy(double energy, double stiffest, const BodyFrame& a, const BodyFrame& b,
                         ContactPolygon* polygon);
// Moves the factor to 1 by `share` in [0, 1] of its distance; returns the change of U / kn.
double relax(ContactPolygon& polygon, const PolygonState& state, double share);

// For every point of the new polygon the old one whose history it takes over: that of the same id, else the
// nearest in the lab. Always one, as long as the old polygon has points; several may share one.
void match(const ContactPolygon& old_polygon, const PolygonState& old_state,
           const ContactPolygon& new_polygon, const PolygonState& new_state, int* source);

}  // namespace nurbs

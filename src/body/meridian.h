// The meridian of a body of revolution: its support is a plane curve's.
#pragma once

#include <array>
#include <vector>

#include "body/direction_atlas.h"
#include "body/revolution.h"
#include "body/ripple.h"
#include "nurbs/bezier_patch.h"
#include "nurbs/tolerances.h"
#include "nurbs/types.h"

namespace nurbs {

// Of a body whose patches are products of a profile and an arc: point = axis point + r(t) e(s) + z(t) axis.
// Empty for all others. Lengths and axes are the shape frame's.
struct Meridian {
  using Row = std::array<double, kMaxDegree + 1>;
  struct Piece {  // of the profile, in Bernstein form
    int degree = 0;
    Row r{}, z{}, w{};           // homogeneous: distance from the axis, height over the axis point, weight
    double speed = 0;            // |d(r, z)/dt| is at most this
    std::vector<Ripple> ripple;  // shares of its control points, of all patches; none: of round-off only
    int first_sector = 0, sectors = 0;  // the patches that it sweeps
  };
  struct Sector {  // of one patch round the axis
    int patch = 0;
    bool arcs_in_u = true;        // which of its parameters runs round
    bool backwards = false;       // its other one runs against the piece's
    int degree = 0;               // of the arc
    Row x{}, y{};                 // homogeneous, of a circle of radius 1
    double begin = 0, sweep = 0;  // angles of its ends, rad; signed
  };
  struct Place {
    int piece = -1;
    double t = 0;
  };
  std::vector<Piece> pieces;
  std::vector<Sector> sectors;
  std::vector<Place> starts;     // of supports, over directions
  std::vector<int> sector_of;    // per patch; -1: of a plane that other patches bound
  Mat3 axes = Mat3::Identity();  // rows: two across the axis, and the axis
  Vec3 point = Vec3::Zero();     // on it
  double beyond = 0;             // by how much the body's support may exceed that of the above
  double error = 0;              // and by how much it may differ from it
  bool bounds = false;           // the former is round-off
  bool exact = false;            // both are
  Ripple ripple;                 // of all, at most
  double seam = 0;               // what their lines round the axis are off where they meet, all round

  bool empty() const { return pieces.empty(); }
  // Whether there is one whose support bounds the body's, but for `allowed` or round-off.
  bool bounds_within(double allowed) const { return !empty() && (bounds || beyond <= allowed); }
  // Whether there is one that is the body, but for that.
  bool serves(double allowed) const { return !empty() && (exact || error <= allowed); }
};
template <class Archive>
void archive(Archive& a, Meridian::Piece& s) {
  auto& [degree, r, z, w, speed, ripple, first_sector, sectors] = s;
  a(degree, r, z, w, speed, ripple, first_sector, sectors);
}
template <class Archive>
void archive(Archive& a, Meridian::Sector& s) {
  auto& [patch, arcs_in_u, backwards, degree, x, y, begin, sweep] = s;
  a(patch, arcs_in_u, backwards, degree, x, y, begin, sweep);
}
template <class Archive>
void archive(Archive& a, Meridian::Place& s) {
  auto& [piece, t] = s;
  a(piece, t);
}
template <class Archive>
void archive(Archive& a, Meridian& s) {
  auto& [pieces, sectors, starts, sector_of, axes, point, beyond, error, bounds, exact, ripple, seam] = s;
  a(pieces, sectors, starts, sector_of, axes, point, beyond, error, bounds, exact, ripple, seam);
}

// Of a body of revolution whose joints meet to round-off, or that `allowed` lets ripple: then gaps round the
// axis are the seam's, and gaps along the profile its pieces' ends'. `size`: bounding radius. Patches in a
// plane square to the axis need not be such products: the rest bounds them. Few digits may keep a body off it
// by `allowed` of the size: it then serves where that is little of what is asked for, or as the product that
// the ripple is off of.
Meridian make_meridian(const std::vector<BezierPatch>& patches, const Revolution& revolution, double size,
                       double allowed = kMeridianError);

// A point of the profile, in the half plane of its axis, lengths of the shape.
struct ProfilePoint {
  Meridian::Place place;
  double r = 0, z = 0;            // distance from the axis, height over the axis point
  double turn_r = 0, turn_z = 0;  // outward normal, unit
  double upper = 0;               // of the support function
};
// Where the profile has its support along (dr, dz), unit, dr >= 0; false where round-off leaves it open.
// `start`: chooses among points that are as high, or a place of no piece. The profile's pieces are climbed by
// Newton, and by Bernstein coefficients no point of any is higher than `upper`: dents, creases, lines and
// poles change nothing. 0.1 us, no allocation.
bool find_profile_point(const Meridian& meridian, double dr, double dz, double size,
                        const Meridian::Place& start, ProfilePoint* found);
// At such a place, found along `asked`: the distance from the axis, and what the place moves by per turn of a
// direction d near that, which is the profile's radius of curvature, 0 at an end that holds it, infinite on a
// line. Directions as (dr, dz).
struct ProfileBend {
  double r, radius;
};
ProfileBend profile_bend(const Meridian& meridian, const Meridian::Place& place, const Vec2& d,
                         const Vec2& asked, double size);

struct MeridianSupport {
  SurfacePoint where;
  double upper;  // of the support function
};

// The same of a body along d, unit, and where on its patches that is. `start`: a point of the body, or
// nullptr. 0.1 to 0.2 us.
bool find_meridian_support(const Meridian& meridian, const Vec3& d, double size, const SurfacePoint* start,
                           MeridianSupport* found);

// A point of the body itself on a parameter line round the axis, at the azimuth of a direction: that of its
// support along it or, where that is on no such line or not given, of the profile's. As functions of the
// azimuth phi (of the patch's arc) its distance r from the axis and height z are, from `before` to `after`
// (r, z)(phi) = (r, z) + phi (slope_r, slope_z) but for the ripple's bend phi^2 / 2, and at any other azimuth
// the body holds a point that is within twice the ripple's most of (r, z).
struct RoundPoint {
  SurfacePoint where;
  ProfilePoint profile;           // of the product, `upper` left out
  double r, z, slope_r, slope_z;  // height over the axis point; slopes per rad
  double before, after;           // rad, not negative
  Ripple ripple;                  // of that line
};
// Along unit d; false along the axis, or where round-off leaves it open. `support`: patch -1 for none. 0.3
// us, no allocation.
bool find_round_point(const Meridian& meridian, const std::vector<BezierPatch>& patches, const Vec3& d,
                      double size, const SurfacePoint& support, RoundPoint* found);

}  // namespace nurbs

// Bodies that files of few digits keep from being ones of revolution: about the axis they are rippled. Deep
// contacts make rings of directions alike about it but for that (contact/overlap/ring_search.h).
#pragma once

#include <vector>

#include "body/meridian.h"
#include "body/profile_radii.h"

namespace nurbs {

struct Shape;

struct NearRevolution {
  Revolution revolution;  // of the body that it nearly is; `error`: between that and itself
  Meridian meridian;      // of that, with the ripple
  ProfileRadii radii;     // of that

  bool found() const { return !meridian.empty(); }
};
template <class Archive>
void archive(Archive& a, NearRevolution& s) {
  auto& [revolution, meridian, radii] = s;
  a(revolution, meridian, radii);
}

// Of a body that is none of revolution itself, or only to more than round-off, or whose joints gape; off one
// by no more than kNearRevolution of its size.
NearRevolution find_near_revolution(const std::vector<BezierPatch>& patches, const Mat3& inertia,
                                    double size);

// What a shape is turned about, exactly or but for few digits; `found` is false of others.
const Revolution& revolution_of(const Shape& shape);

// How the body bends along its meridian about a direction `own`, unit, shape frame: with places of the
// profile and their points P and normals n (RoundPoint), for every direction d in the half plane of the
// azimuth that is at an angle within `reach` of own's
//     h(d) >= d . (P - radius n) + radius - off,
// P on the lines of those places at that azimuth. Lengths of scale 1; radius 0 where nothing is known.
struct ProfileBall {
  double radius = 0, off = 0;
};
ProfileBall ball_within(const NearRevolution& near, const Vec3& own, double reach, const Meridian::Place& one,
                        const Meridian::Place& two, double size);

}  // namespace nurbs

// Contacts of sharp edges and of vertices that go on: Newton on the parameters that they leave free.
#pragma once

#include "contact/joint_newton.h"
#include "contact/pair_frame.h"

namespace nurbs {

// From the points s->points, one at least on a sharp edge or vertex: the stationary pair of the edge with the
// other body's surface or edge, or of the vertex with its surface; `direction` (unit, pair frame) is near its
// normal. True: *s is converged, its bracket no wider than `tolerance` (a length) and its normal right to
// `tilt` rad; else *s stays. Two evaluations a step, then two hull supports; 1 us.
//
// Against a surface the certificate is that of certificate.h, with no ball at the edge or vertex. Two edges
// that overlap have no ball at all; for them, with a and b the points, n the unit normal square to the unit
// tangents t_A, t_B, and a - b = delta n + r, r square to n:
//     an edge whose curvature is at most k over a length L either side of a is no further than k s^2 / 2 from
//     its tangent at s, so that for every unit d
//         h_A(d) >= d . a + max over s of (|d . t_A| s - k s^2 / 2) >= d . a + R_A (d . t_A)^2 / 2,
//     R = 1 / k where k L >= 1, else L (2 - k L) (both sides are equal at |d . t| = 1, and the left is convex
//     and linear from k L on). At an angle t from n, with lambda half the least eigenvalue of R_A t_A t_A' +
//     R_B t_B t_B' square to n, and |r| sin t <= e lambda sin^2 t + |r|^2 / (4 e lambda),
//         p(d) >= delta cos t + (1 - e) lambda sin^2 t - |r|^2 / (4 e lambda),
//     which but for the last term is at least delta as long as (1 - e) lambda (1 + cos t) >= delta, until
//     past a right angle. From there on p(d) >= I_A + I_B - d . offset, I the radii of balls about the
//     centres inside, which rises with t if offset . n >= 0, so that it is at least delta if it is so there.
// Then the gap is at most -delta, but for that term. Hypotheses: both bodies hold their edges and those
// balls.
bool meet_edges(const PairFrame& pair, const Vec3& direction, double tolerance, double tilt,
                JointSolution* s);

// Whether a point lies on a sharp edge or a vertex of its body.
bool is_on_edge(const Shape& shape, const SurfacePoint& at);

}  // namespace nurbs

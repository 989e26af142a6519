// The derivatives the paper's solver needs (Craveiro & Gay Neto, eqs 8-20): the gap objective in the four
// surface parameters, the direction in spherical angles, the surface parameters of a support point as
// functions of those angles, and from them the gradient and Hessian of f2(rho, phi). Everything is one
// arithmetic step per function; all vectors of one call are in one common frame.
#pragma once

#include "nurbs/bezier_patch.h"
#include "nurbs/types.h"

namespace nurbs {

using Mat4 = Eigen::Matrix4d;

// A direction in spherical angles (eq. 9) with its derivatives.
struct DirectionJet {
  Vec3 d, d_rho, d_phi, d_rho_rho, d_rho_phi, d_phi_phi;
};

// Eq. 9 with its polar axis along a coordinate axis of choice: 2 is the paper's chart, 0 and 1 permute it
// cyclically. At sin(phi) = 0 the azimuth rho means nothing and d/d rho vanishes, so a search keeps away from
// the poles of the chart it is in: `choose` takes the coordinate axis furthest from a direction, which gives
// sin(phi) >= sqrt(2/3).
struct SphericalChart {
  int polar_axis = 2;

  static SphericalChart choose(const Vec3& d);
  Vec2 angles(const Vec3& d) const;  // (rho, phi) of a unit direction
  DirectionJet direction(const Vec2& angles) const;
};

// The body's surface at a support point, placed: position x0 + Q0 s scale and derivatives, eq. 6.
Jet2 place(const Jet2& jet, double scale, const Mat3& rotation, const Vec3& origin);
Jet3 place(const Jet3& jet, double scale, const Mat3& rotation, const Vec3& origin);
Jet2 second_order_part(const Jet3& jet);

// f = |A - B|^2 / 2 as a function of eta = (uA, vA, uB, vB): f1 of eq. 8, and f2 of eq. 10 before its
// parameters are tied to the angles.
struct GapObjective {
  double value = 0;
  Vec4 gradient = Vec4::Zero();
  Mat4 hessian = Mat4::Zero();
};
GapObjective gap_objective(const Jet2& a, const Jet2& b);

// Which parameters of a support point are free: eqs 12 hold for these. A support point held at a crease of
// the surface (u or v at the patch's edge and the slope there not zero) keeps that parameter while d turns a
// little.
struct FreeParameters {
  bool u = true, v = true;
};

// Inverse of the Hessian of d . S over the free parameters (zero elsewhere), the matrix of all the linear
// systems 16-20. `regular` is false when it can't be inverted: a pole of the parametrisation or vanishing
// curvature.
struct SupportSystem {
  Mat2 inverse = Mat2::Zero();
  bool regular = false;
};
SupportSystem support_system(const Jet3& s, const Vec3& d, FreeParameters free);

// d eta / d alpha, eqs 16 and 17: from d . S_i = 0 follows d_alpha . S_i + d . S_ij eta_j,alpha = 0.
Vec2 parameter_derivative(const Jet3& s, const SupportSystem& system, const Vec3& d_alpha);

// d^2 eta / d alpha d beta, eqs 18-20, by differentiating once more:
// d_alpha_beta . S_i + d_alpha . S_ij eta_j,beta + d_beta . S_ij eta_j,alpha + d . S_ijk eta_j,alpha
// eta_k,beta
// + d . S_ij eta_j,alpha_beta = 0. Third surface derivatives enter here.
Vec2 parameter_second_derivative(const Jet3& s, const SupportSystem& system, const Vec3& d,
                                 const Vec3& d_alpha, const Vec3& d_beta, const Vec3& d_alpha_beta,
                                 const Vec2& eta_alpha, const Vec2& eta_beta);

// All five for one body.
struct ParameterJet {
  Vec2 rho, phi, rho_rho, rho_phi, phi_phi;
  bool regular = false;
};
ParameterJet parameter_jet(const Jet3& s, const DirectionJet& d, FreeParameters free);

// f2 as a function of (rho, phi): value, gradient (eq. 13), Hessian (eqs 14, 15). As printed, eqs 14 and 15
// abbreviate the chain rule to the diagonal d^2 f2 / d eta_i^2; what is computed is the full double sum over
// i and j, with the mixed second derivatives d^2 f2 / d eta_i d eta_j, without which the Hessian is wrong.
struct AngleObjective {
  double value = 0;
  Vec2 gradient = Vec2::Zero();
  Mat2 hessian = Mat2::Zero();
};
AngleObjective angle_objective(const GapObjective& f, const ParameterJet& a, const ParameterJet& b);

}  // namespace nurbs

// What has been proven of a pair that does not touch, as one value: along which direction, how large a gap,
// at which pose, of which bodies and by which solver. It is set as a whole and dropped as a whole.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>

#include "contact/contact.h"
#include "nurbs/tolerances.h"

namespace nurbs {

// Names the bodies and the solver that a proof or a warm start belongs to; never 0. Two different sizes or
// shapes share a stamp once in 2^64.
inline std::uint64_t mix(std::uint64_t x) {  // splitmix64's finaliser (Steele, Lea & Flood 2014)
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ull;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebull;
  return x ^ (x >> 31);
}
inline std::uint64_t body_stamp(std::uint64_t shape, double scale) {
  std::uint64_t bits;
  std::memcpy(&bits, &scale, sizeof bits);
  return mix(bits + 0x9e3779b97f4a7c15ull * shape);
}
inline std::uint64_t pair_stamp(std::uint64_t a, std::uint64_t b, Solver solver) {
  return mix(a + 3 * b + static_cast<std::uint64_t>(solver)) | 1;
}

// A surface point to start from, coarse: 1.5e-5 of a patch.
struct CoarsePoint {
  std::uint16_t patch, u, v;
};

// Plain values, so that it lives in the host's contact history. All zeros: nothing is known.
struct PairProof {
  double direction[3];  // unit d, lab, along which at the reference pose the gap was proven to be ...
  double bound;         // ... at least bound + d . (x_B - x_A)
  double q_a[4];        // reference orientations, w x y z
  double q_b[4];
  std::uint64_t stamp;     // of the bodies and the solver; 0: nothing is known
  CoarsePoint on_a, on_b;  // support points of the last solve
  std::int32_t contact;    // the host's: number of the pair's contact, 0 without one
};
constexpr int kProofSize = 15;  // doubles
static_assert(sizeof(PairProof) == kProofSize * sizeof(double));
static_assert(sizeof(PairProof) <= 128, "a neighbour's memory");

inline void store(const Vec3& v, double* to) {
  std::memcpy(to, v.data(), 3 * sizeof(double));
}
inline Vec3 load(const double* from) {
  return {from[0], from[1], from[2]};
}
inline void store(const Quat& q, double* to) {
  to[0] = q.w();
  to[1] = q.x();
  to[2] = q.y();
  to[3] = q.z();
}

// |q - q0| of unit quaternions is 2 sin(angle / 4); a point at distance R from the centre has moved by
// 2 R sin(angle / 2) <= 2 R |q - q0|. Here (2 |q - q0|)^2.
inline double turned2(const Quat& q, const double* q0) {
  const double w = q.w() - q0[0], x = q.x() - q0[1], y = q.y() - q0[2], z = q.z() - q0[3];
  return 4 * (w * w + x * x + y * y + z * z);
}

inline bool has_proof(const PairProof& proof) {
  return proof.stamp != 0 && proof.bound > -kFarAway;
}
inline void drop_proof(PairProof* proof) {
  proof->bound = -std::numeric_limits<double>::infinity();
}

// Proves `lower` along the unit d (lab) for the present pose.
inline void set_proof(const Vec3& d, double lower, const Vec3& offset, const Quat& q_a, const Quat& q_b,
                      PairProof* proof) {
  store(d, proof->direction);
  proof->bound = lower - d.dot(offset);
  store(q_a, proof->q_a);
  store(q_b, proof->q_b);
}

// Lower bound of the gap from the proof. d is fixed in the lab: lower <= d . offset0 - h_A(d) - h_B(-d).
// Since then the offset has changed by an exactly known vector, and no point of K has moved relative to its
// centre by more than 2 R_K |q_K - q0_K|, so neither has its support. Hence
//     gap >= bound + d . offset - 2 R_A |q_A - q0_A| - 2 R_B |q_B - q0_B|.
// Nothing is assumed of how the bodies moved in between. `enough`: a bound above it may be a weaker one.
inline double proven_gap(const PairProof& proof, const Vec3& offset, const Quat& q_a, double radius_a,
                         const Quat& q_b, double radius_b, double enough) {
  const double roundoff = 4 * kRoundoff * (radius_a + radius_b + std::abs(proof.bound));
  const double straight = proof.bound + load(proof.direction).dot(offset) - roundoff;
  const double a2 = radius_a * radius_a * turned2(q_a, proof.q_a),
               b2 = radius_b * radius_b * turned2(q_b, proof.q_b);
  const double quick = straight - std::sqrt(2 * (a2 + b2));  // x + y <= sqrt(2 x^2 + 2 y^2)
  return quick > enough ? quick : straight - std::sqrt(a2) - std::sqrt(b2);
}

}  // namespace nurbs

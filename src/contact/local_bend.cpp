// Lower bounds of W about a support point; see local_bend.h.
#include "contact/local_bend.h"

#include "contact/pair_memory.h"
#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

constexpr double kMostOff = 1e-3;     // rad, between a normal and the direction
constexpr double kRoundedOff = 1e-6;  // of angles, by frames and square roots

}  // namespace

LocalBend local_bend(const Shape& shape, double scale, const SurfacePoint& at, const JetLanes& jet,
                     const Vec3& d, const Vec3& t, const Vec3& s) {
  const LocalRate local = local_rate(shape, scale, at);
  SupportModel model;
  if (!make_support_model(Mat3::Identity(), Vec3::Zero(), jet, local, &model)) return {};
  const Vec3 n = vec(model.normal), along = vec(model.tangent), across = n.cross(along);
  const double off = (n - d).norm() * (1 + kRoundedOff) + kPoleNormal;
  if (!(off <= kMostOff)) return {};
  const Vec2 x(t.dot(along), s.dot(along)), y(t.dot(across), s.dot(across));
  const Mat2 mixed = x * y.transpose();
  LocalBend bend;
  bend.turn =
      model.w0 * x * x.transpose() + model.w1 * (mixed + mixed.transpose()) + model.w2 * y * y.transpose();
  const double most = bend.turn.trace();
  bend.turn -= 2 * off * (most + local.rate) * Mat2::Identity();
  bend.rate = local.rate;
  // The point goes no further than most t + rate t^2 / 2.
  bend.reach =
      2 * local.room / (most + std::sqrt(most * most + 2 * local.rate * local.room)) * (1 - kRoundedOff) -
      off;
  return bend;
}

}  // namespace nurbs

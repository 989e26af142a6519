// See effective_radius.h.
#include "contact/effective_radius.h"

#include <cmath>

#include "body/flat_faces.h"
#include "contact/sphere_search.h"

namespace nurbs {
namespace {

// Of |root^-1 y| = 1 where its normal is n, y in shape axes: the surface's second fundamental form is the
// quadric's matrix M across n over |M y| = 1 / h.
SurfaceCurvature ellipsoid_curvature(const Particle& particle, const Vec3& outward) {
  const Ellipsoid& e = particle.shape->ellipsoid;
  const Mat3 axes = particle.q.toRotationMatrix() * e.axes;
  const Mat3 m = axes * e.semi.cwiseAbs2().cwiseInverse().asDiagonal() * axes.transpose();
  const double h = e.semi.cwiseProduct(axes.transpose() * outward).norm();
  const Mat3 across = Mat3::Identity() - outward * outward.transpose();
  return {h / particle.scale * (across * m * across), true};
}

// Of a sphero-polyhedron where its normal is n: as bent as the ball but along the core's points that are
// level there.
SurfaceCurvature core_curvature(const Particle& particle, const Vec3& outward) {
  constexpr double kLevel = 1e-8;  // of the distance to the highest of them
  const SpheroPolyhedron& core = particle.shape->core;
  const Vec3 n = particle.q.conjugate() * outward;
  const Vec3& top = core.points[core.support(n)];
  Vec3 along = Vec3::Zero();
  for (const Vec3& x : core.points) {
    const Vec3 way = x - top;
    const double length = way.norm();
    if (length == 0 || n.dot(way) < -kLevel * length) continue;
    if (along.cross(way).norm() > kLevel * length) return plane_curvature();
    along = way / length;
  }
  const Vec3 axis = particle.q * along;
  const Mat3 across = Mat3::Identity() - outward * outward.transpose() - axis * axis.transpose();
  return {across / (particle.scale * core.radius), true};
}

// Squared angle (rad) within which a contact's normal is a flat face's, with the errors of searches.
constexpr double kFaceAngle2 = 1e-4 * 1e-4;

bool meets_face(const Particle& particle, const Vec3& outward, double angle2) {
  const FlatFeatures& flats = particle.shape->flats;
  return !flats.faces.empty() && nearest_face(flats, particle.q.conjugate() * outward, 1 - 0.5 * angle2) >= 0;
}

// II in the orthonormal frame (t, s): J^-T II J^-1, with J = (lu, t.sv; 0, s.sv) from parameters to the
// frame.
SurfaceCurvature curvature_of_patch(const Particle& particle, const PointMemory& point, const Vec3& outward) {
  if (!(point.patch >= 0) && particle.shape->ellipsoid.found) return ellipsoid_curvature(particle, outward);
  if (!(point.patch >= 0)) {  // solved as a sphere or by its core, or not at all
    if (particle.shape->core.radius > 0) return core_curvature(particle, outward);
    const Roundness round = roundness(*particle.shape);
    if (!(round.slope * round.slope < kCreaseAngle2)) return {};
    return {(Mat3::Identity() - outward * outward.transpose()) / (particle.scale * round.radius), true};
  }
  using Slot = JetLanes::Slot;
  const SurfacePoint at = surface_point(point);
  if (!has_patch(*particle.shape, at)) return {};
  const BezierPatch& patch = particle.shape->patches[at.patch];
  JetLanes jet;
  evaluate2(patch, at.u, at.v, &jet);
  const double shortest = std::fmin(jet.at(Slot::kSu).norm(), jet.at(Slot::kSv).norm());
  if (shortest < kBesidePole * particle.shape->bounding_radius) {
    const auto beside = [](double x) { return std::fmin(std::fmax(x, kBesidePole), 1 - kBesidePole); };
    evaluate2(patch, beside(at.u), beside(at.v), &jet);
  }
  scale(particle.scale, &jet);
  const Vec3 su = jet.at(Slot::kSu), sv = jet.at(Slot::kSv), cross = su.cross(sv);
  const double area = cross.norm(), lu = su.norm();
  if (!(area > 0)) return {};
  const Vec3 n = cross / area, t = su / lu, s = n.cross(t);
  const Mat3 axes = particle.q.toRotationMatrix();
  if (!((axes * n - outward).squaredNorm() < kCreaseAngle2)) return {};
  Lane8 bend;
  dot(jet, n, &bend);
  const double l = -bend[3], m = -bend[4], k = -bend[5], shear = t.dot(sv), height = s.dot(sv);
  const double tt = l / (lu * lu), ts = (m - shear / lu * l) / (lu * height);
  const double ss = (k - 2 * shear / lu * m + shear * shear * tt) / (height * height);
  const Vec3 lab_t = axes * t, lab_s = axes * s;
  SurfaceCurvature c;
  c.tensor = tt * lab_t * lab_t.transpose() + ts * (lab_t * lab_s.transpose() + lab_s * lab_t.transpose()) +
             ss * lab_s * lab_s.transpose();
  c.known = c.tensor.allFinite();
  return c;
}

}  // namespace

// What a search remembers of a flat face is any point of it: also one of its corners, on another patch.
SurfaceCurvature curvature_at(const Particle& particle, const PointMemory& point, const Vec3& outward) {
  if (meets_face(particle, outward, kFaceAngle2)) return plane_curvature();
  const SurfaceCurvature c = curvature_of_patch(particle, point, outward);
  return !c.known && meets_face(particle, outward, kCreaseAngle2) ? plane_curvature() : c;
}

SurfaceCurvature cylinder_curvature(const Vec3& origin, const Vec3& axis, double radius, const Vec3& point,
                                    const Vec3& normal) {
  const Vec3 around = axis.cross(normal);
  const double sign = (point - origin).dot(normal - normal.dot(axis) * axis) < 0 ? -1 : 1;
  return {sign / radius * around * around.transpose(), true};
}

double hertz_radius(double k_a, double k_b) {
  const double mean = std::sqrt(k_a * k_b), x = std::log(0.5 * (k_a + k_b) / mean);
  return std::exp(x * (0.33249 + x * (0.07766 - 0.00461 * x))) / mean;
}

SphereCurvatures sphere_curvatures(const SurfaceCurvature& a, const SurfaceCurvature& b, const Vec3& normal,
                                   double cap, bool plane) {
  if (!a.known || !b.known) return flat_curvatures(cap, plane);
  const Vec3 t = normal.unitOrthogonal(), s = normal.cross(t);
  const Mat3 sum = a.tensor + b.tensor;
  const double tt = t.dot(sum * t), ts = t.dot(sum * s), ss = s.dot(sum * s);
  const double mean = 0.5 * (tt + ss), half = std::hypot(0.5 * (tt - ss), ts);
  if (!(mean - half > 1e-12 * mean)) return flat_curvatures(cap, plane);
  const double curvature = 1 / hertz_radius(mean - half, mean + half);
  if (!(curvature * cap * kFlatRadius >= 1)) return flat_curvatures(cap, plane);
  if (plane) return {0, curvature};
  const double of_a = std::fmax(0, a.tensor.trace()), of_b = std::fmax(0, b.tensor.trace());
  return {curvature * of_a / (of_a + of_b), curvature * of_b / (of_a + of_b)};
}

}  // namespace nurbs

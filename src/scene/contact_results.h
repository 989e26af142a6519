// What the stages of a step hand on to each other about the eight contacts of a block.
#pragma once

#include "nurbs/wide.h"
#include "scene/contact_stages.h"

namespace nurbs {

// A body as the law sees it.
inline BodyMotion motion_of(const BodyRecord& r) {
  BodyMotion m;
  m.velocity = load(r.velocity);
  m.spin = load(r.spin);
  m.spin_before = load(r.spin_before);
  m.inverse_mass = r.inverse_mass;
  const double* i = r.inverse_inertia;
  m.inverse_inertia << i[0], i[3], i[4], i[3], i[1], i[5], i[4], i[5], i[2];
  return m;
}

// Of B relative to A at a contact point.
inline Vec3 velocity_at(const BodyRecord& a, const BodyRecord& b, const Vec3& spin_a, const Vec3& spin_b,
                        const Vec3& arm_a, const Vec3& arm_b) {
  return load(b.velocity) + spin_b.cross(arm_b) - load(a.velocity) - spin_a.cross(arm_a);
}

// Of the two contact points.
inline Vec3 middle_of(const ContactResult& r) {
  return 0.5 * (r.point_a + r.point_b);
}

// The state of a contact that takes over from others: their spring, and no dissipation to be finished.
void take_over(const ContactCoefficients& law, const ContactGeometry& g, const BodyMotion& a,
               const BodyMotion& b, double dt, const Vec3& spring, ContactState* state);

// Of a contact's weight times the law's dampers. Contacts, or points together, that are stiffer than the law
// says, because they took over from others, have dampers that grow as the root of the stiffness, so that the
// ratio of damping, and with it the restitution, is the law's.
template <class Real>
NURBS_INLINE Real damper_divisor(const Real& weight, const Real& together) {
  return root(larger<Real>(all<Real>(1), larger<Real>(weight, together)));
}

// Geometry in lab axes from A's centre of mass.
struct alignas(64) ContactStages::Results {
  double gap[kBlock], lower[kBlock];
  double normal[3][kBlock], point[3][kBlock], offset[3][kBlock];  // point: midpoint of the two
  double touching[kBlock] = {};                                   // 1 or 0
  double shift[kBlock] = {};                                      // overlap that isn't felt, length
  double together[kBlock] = {};  // of a polygon's points: the weights of those that bear, summed
  double served[kBlock] = {};
  int iterations[kBlock] = {};  // of those served by Newton

  void set(int lane, const ContactResult& r, const Vec3& separation) {
    gap[lane] = r.gap;
    lower[lane] = r.lower;
    touching[lane] = touches(r);
    const Vec3 middle = middle_of(r);
    for (int k = 0; k < 3; ++k) {
      normal[k][lane] = r.normal[k];
      point[k][lane] = middle[k];
      offset[k][lane] = separation[k];
    }
  }
  double damper_share(int lane, double weight) const {
    return 1 / damper_divisor<double>(weight, together[lane]);
  }
  Vec3 normal_of(int lane) const { return {normal[0][lane], normal[1][lane], normal[2][lane]}; }
  Vec3 offset_of(int lane) const { return {offset[0][lane], offset[1][lane], offset[2][lane]}; }
  ContactGeometry geometry(int lane) const {
    const Vec3 middle(point[0][lane], point[1][lane], point[2][lane]);
    return {-gap[lane] - shift[lane], normal_of(lane), middle, middle - offset_of(lane)};
  }
};

}  // namespace nurbs

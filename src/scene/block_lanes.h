// The contacts of a block as vectors: those from `first` to first + kWidth - 1.
#pragma once

#include "contact/local_model.h"
#include "scene/contact_pool.h"

namespace nurbs {

constexpr int kUnique = kLocalModelSize - 1;  // field of a block

// Numbers of a field, and of three and more from there on.
NURBS_INLINE Wide lanes(const ContactBlock& block, int field, int first) {
  return load_wide(&block.field[field][first]);
}
NURBS_INLINE Triple<Wide> lanes3(const ContactBlock& block, int field, int first) {
  return {lanes(block, field, first), lanes(block, field + 1, first), lanes(block, field + 2, first)};
}
NURBS_INLINE SupportModelOf<Wide> support_lanes(const ContactBlock& block, int field, int first) {
  return {lanes3(block, field, first),     lanes3(block, field + 3, first), lanes3(block, field + 6, first),
          lanes(block, field + 9, first),  lanes(block, field + 10, first), lanes(block, field + 11, first),
          lanes(block, field + 12, first), lanes(block, field + 13, first)};
}

struct Pose {
  Triple<Wide> x;
  Turn<Wide> turn;
  Wide radius, free;
};
NURBS_INLINE Pose gather_pose(const double* const (&record)[kWidth]) {
  Wide f[16];
  gather(record, f);
  return {{f[0], f[1], f[2]}, {{{f[3], f[4], f[5]}, {f[6], f[7], f[8]}, {f[9], f[10], f[11]}}}, f[12], f[13]};
}

// Into the lanes of the mask.
NURBS_INLINE void put_lanes(const WideMask& mask, const Wide& w, int first, double (&to)[kBlock]) {
  Wide old;
  std::memcpy(&old, &to[first], sizeof old);
  old = select(mask, w, old);
  std::memcpy(&to[first], &old, sizeof old);
}
NURBS_INLINE void put_lanes(const WideMask& mask, const Triple<Wide>& w, int first, double (&to)[3][kBlock]) {
  put_lanes(mask, w.x, first, to[0]);
  put_lanes(mask, w.y, first, to[1]);
  put_lanes(mask, w.z, first, to[2]);
}

}  // namespace nurbs

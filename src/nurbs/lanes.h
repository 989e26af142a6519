// Numbers side by side in one register: the compiler's vector types, lowered to whatever the ARCH has. Passed
// by reference or inlined only, so that no calling convention depends on the ARCH.
#pragma once

#include <cstring>

#include "nurbs/types.h"

#define NURBS_INLINE inline __attribute__((always_inline))

namespace nurbs {

using Lane2 = double __attribute__((vector_size(16)));
using Lane4 = double __attribute__((vector_size(32)));
using Lane8 = double __attribute__((vector_size(64)));

NURBS_INLINE void load(const Vec4& from, Lane4& to) {
  std::memcpy(&to, from.data(), sizeof to);
}

NURBS_INLINE void to_vec3(const Lane4& lanes, Vec3& out) {
  out[0] = lanes[0];
  out[1] = lanes[1];
  out[2] = lanes[2];
}

NURBS_INLINE void join(const Lane4& low, const Lane4& high, Lane8& out) {
  std::memcpy(&out, &low, sizeof low);
  std::memcpy(reinterpret_cast<double*>(&out) + 4, &high, sizeof high);
}

// Columns of a 4 x 4 block of numbers given by its rows.
NURBS_INLINE void transpose(const Lane4 (&&row)[4], Lane4 (&column)[4]) {
  const Lane4 even01 = __builtin_shufflevector(row[0], row[1], 0, 4, 2, 6);
  const Lane4 odd01 = __builtin_shufflevector(row[0], row[1], 1, 5, 3, 7);
  const Lane4 even23 = __builtin_shufflevector(row[2], row[3], 0, 4, 2, 6);
  const Lane4 odd23 = __builtin_shufflevector(row[2], row[3], 1, 5, 3, 7);
  column[0] = __builtin_shufflevector(even01, even23, 0, 1, 4, 5);
  column[1] = __builtin_shufflevector(odd01, odd23, 0, 1, 4, 5);
  column[2] = __builtin_shufflevector(even01, even23, 2, 3, 6, 7);
  column[3] = __builtin_shufflevector(odd01, odd23, 2, 3, 6, 7);
}

}  // namespace nurbs

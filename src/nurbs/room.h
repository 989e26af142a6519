// Fixed room for objects that are made one by one, as they are needed.
#pragma once

#include <new>
#include <type_traits>

namespace nurbs {

// Room for many, each made when it is put there.
template <class T, int N>
class Room {
  static_assert(std::is_trivially_destructible_v<T>);

 public:
  T& put(int k, const T& value) { return *new (bytes_ + k * sizeof(T)) T(value); }
  T& operator[](int k) { return *std::launder(reinterpret_cast<T*>(bytes_ + k * sizeof(T))); }
  const T& operator[](int k) const {
    return *std::launder(reinterpret_cast<const T*>(bytes_ + k * sizeof(T)));
  }

 private:
  alignas(T) unsigned char bytes_[N * sizeof(T)];
};

}  // namespace nurbs

// Structs as bytes, for another process of the same program on a machine of the same kind, and back with the
// same bits. A struct that takes part has beside it a function
//     template <class Archive>
//     void archive(Archive& a, Struct& s) {
//       auto& [x, y] = s;
//       a(x, y);
//     }
// that names all its fields: a field that is added later and not named does not compile.
#pragma once

#include <array>
#include <cstring>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <vector>

#include "nurbs/types.h"

namespace nurbs {

template <class T>
struct IsMatrix : std::false_type {};
template <class Real, int kRows, int kColumns>
struct IsMatrix<Eigen::Matrix<Real, kRows, kColumns>>
    : std::bool_constant<kRows != Eigen::Dynamic && kColumns != Eigen::Dynamic> {};

// Numbers and small matrices of them, whose bytes say all.
template <class T>
constexpr bool kPlain = std::is_arithmetic_v<T> || std::is_enum_v<T> || IsMatrix<T>::value;

// What both directions share: `Direction::bytes(data, size)` writes them or fills them in, `length(n)`
// likewise.
template <class Direction>
class Archive {
 public:
  template <class... Fields>
  void operator()(Fields&... fields) {
    (each(fields), ...);
  }

 private:
  Direction& direction() { return static_cast<Direction&>(*this); }

  template <class T>
  void each(T& x) {
    if constexpr (kPlain<T>)
      direction().bytes(&x, sizeof x);
    else
      archive(direction(), x);
  }
  void each(Quat& q) { each(q.coeffs()); }
  void each(std::string& text) {
    direction().length(text);
    direction().bytes(text.data(), text.size());
  }
  template <class T, std::size_t kCount>
  void each(T (&items)[kCount]) {
    for (T& item : items) each(item);
  }
  template <class T, std::size_t kCount>
  void each(std::array<T, kCount>& items) {
    for (T& item : items) each(item);
  }
  template <class T>
  void each(std::vector<T>& items) {
    direction().length(items);
    if constexpr (kPlain<T>)
      direction().bytes(items.data(), items.size() * sizeof(T));
    else
      for (T& item : items) each(item);
  }
};

class Writer : public Archive<Writer> {
 public:
  std::string data;

  void bytes(const void* from, std::size_t size) { data.append(static_cast<const char*>(from), size); }
  template <class Container>
  void length(const Container& items) {
    const std::size_t size = items.size();
    bytes(&size, sizeof size);
  }
};

// Throws std::length_error where the bytes end too soon.
class Reader : public Archive<Reader> {
 public:
  explicit Reader(const std::string& data) : data_(data) {}

  void bytes(void* to, std::size_t size) {
    need(size);
    if (size > 0) std::memcpy(to, data_.data() + at_, size);
    at_ += size;
  }
  template <class Container>
  void length(Container& items) {
    std::size_t size = 0;
    bytes(&size, sizeof size);
    need(size);  // every item takes a byte at least
    items.resize(size);
  }
  bool at_end() const { return at_ == data_.size(); }

 private:
  void need(std::size_t size) const {
    if (data_.size() - at_ < size) throw std::length_error("an archive ends too soon");
  }

  const std::string& data_;
  std::size_t at_ = 0;
};

}  // namespace nurbs

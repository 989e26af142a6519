// A body whose closed form is left unused.
#pragma once

#include <memory>

#include "body/shape.h"

namespace nurbs::test {

// An ellipsoid that the contact search takes as it takes any other body.
inline std::shared_ptr<const Shape> as_surface(const Shape& body) {
  auto copy = std::make_shared<Shape>(body);
  copy->ellipsoid = Ellipsoid();
  return copy;
}

}  // namespace nurbs::test

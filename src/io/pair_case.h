// One pair of particles as a file: written when a contact could not be certified, read back by a test that
// replays it.
#pragma once

#include <array>
#include <memory>
#include <string>

#include "contact/contact.h"

namespace nurbs {

struct PairCase {
  std::shared_ptr<const Shape> shape_a, shape_b;
  Particle a, b;
  ContactSettings settings;
};

// Writes both shapes, poses (hexadecimal floating point: every bit, and numbers that are none) and settings
// as JSON. Returns false when the file can't be written; never throws.
bool write_pair_case(const std::string& file, const Particle& a, const Particle& b,
                     const ContactSettings& settings);

// Without the shapes' inner maps: after Shape::inner_map() of both the bits are those of a run. Throws
// ShapeError naming the file and what is wrong with it.
PairCase read_pair_case(const std::string& file);

}  // namespace nurbs

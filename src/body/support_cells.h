// Where the support of a body's hull can lie, by cells of directions: near dents and closing joints a normal
// proves nothing, and what would have to be searched is the whole body.
#pragma once

#include <array>
#include <atomic>
#include <memory>
#include <vector>

#include "body/patch_maximum.h"
#include "nurbs/types.h"

namespace nurbs {

struct Shape;

// Pieces of patches, by patch, that hold every surface point that is highest along some direction of a cell.
struct SupportCell {
  std::vector<PatchPiece> pieces;
};

// The cells of a cube map, each made when it is first asked for. What is in it depends on the body alone, so
// it does not matter who asked first. Any thread may ask, and copies share them.
class SupportCells {
 public:
  // That d lies in; nullptr if d is no unit vector. Some ns; 10 us the first time, 100 bytes of memory then.
  const SupportCell* at(const Shape& shape, const Vec3& d) const;

 private:
  struct Block;
  struct Made {
    ~Made();
    std::array<std::atomic<Block*>, 384> blocks{};
  };
  std::shared_ptr<Made> made_ = std::make_shared<Made>();
};

}  // namespace nurbs

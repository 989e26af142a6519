// Halving of patches against a cone of directions; see support_cells.h.
#include "body/support_cells.h"

#include <algorithm>
#include <cmath>

#include "body/cube_map.h"
#include "body/shape.h"
#include "body/support.h"
#include "nurbs/bernstein.h"
#include "nurbs/tolerances.h"
#include "nurbs/wide.h"

namespace nurbs {
namespace {

constexpr int kBlockEdge = 8, kBlocksPerEdge = kSupportCells / kBlockEdge;
static_assert(kSupportCells % kBlockEdge == 0);
constexpr int kMostPoints = (kMaxDegree + 1) * (kMaxDegree + 1);

// Let y be a surface point and d_1 to d_4 the corners of a cell, so that every d in it is a sum of positive
// multiples of them. If d_k . (p - y) < 0 for all control points p of a piece of a patch with positive
// weights, then d . (x - y) < 0 for all its points x, which are convex combinations of them: x is below y
// along every d in the cell, and so is no support there. Nothing is asked of the body.
class CellMaker {
 public:
  CellMaker(const Shape& shape, int face, int i, int j) : shape_(shape) {
    const auto at = [](int n) { return 2.0 * n / kSupportCells - 1; };
    for (int k = 0; k < 4; ++k) {
      const Vec3 d = from_cube(face, at(i + k / 2), at(j + k % 2));
      x_[k] = d[0];
      y_[k] = d[1];
      z_[k] = d[2];
      longest_ = std::max(longest_, d.norm());
    }
    const Vec3 middle = cell_middle(face, i, j, kSupportCells).normalized();
    below_ = search_all_patches(shape, middle, shape.atlas.where[shape.atlas.nearest(middle)]).point;
    round_off_ = kSupportCellMargin * longest_ * shape.bounding_radius;
  }

  SupportCell make() {
    SupportCell cell;
    for (size_t p = 0; p < shape_.patches.size(); ++p) {
      const PatchBall& ball = shape_.balls[p];
      const Vec3 center = ball.center - below_;
      if (!reaches(Lane4{center[0], center[1], center[2], 1}, longest_ * ball.radius)) continue;
      const BezierPatch& patch = shape_.patches[p];
      nu_ = patch.degree_u;
      nv_ = patch.degree_v;
      Lane4 net[kMostPoints];
      for (size_t k = 0; k < patch.points.size(); ++k) {
        const Vec4& q = patch.points[k];
        net[k] = Lane4{q[0] - q[3] * below_[0], q[1] - q[3] * below_[1], q[2] - q[3] * below_[2], q[3]};
      }
      piece_ = {static_cast<int>(p), 2, -1, 2, -1};
      visit(net, 0, 1, 0, 1);
      if (piece_.u0 < piece_.u1) cell.pieces.push_back(piece_);
    }
    return cell;
  }

 private:
  // Whether e, homogeneous and seen from y, raised by `by`, is above y along a corner.
  bool reaches(const Lane4& e, double by) const {
    const Lane4 height = x_ * e[0] + y_ * e[1] + z_ * e[2] + round_off_ * e[3] + by;
    return !none_of(Mask4(height >= 0.0));
  }
  bool reaches(const Lane4* net) const {
    const int count = (nu_ + 1) * (nv_ + 1);
    Lane4 most{-1, -1, -1, -1};
    for (int k = 0; k < count; ++k) {
      const Lane4& e = net[k];
      most = larger<Lane4>(most, x_ * e[0] + y_ * e[1] + z_ * e[2] + round_off_ * e[3]);
    }
    return !none_of(Mask4(most >= 0.0));
  }

  // Widens the piece by what is left of a box when it is halved to the end; the net is used up.
  void visit(Lane4* net, float u0, float u1, float v0, float v1) {
    if (u0 >= piece_.u0 && u1 <= piece_.u1 && v0 >= piece_.v0 && v1 <= piece_.v1) return;
    if (!reaches(net)) return;
    constexpr float kLeast = 1.0F / kSupportPieces;
    const float du = u1 - u0, dv = v1 - v0;
    if (std::max(du, dv) <= kLeast) {
      piece_ = {piece_.patch, std::min(piece_.u0, u0), std::max(piece_.u1, u1), std::min(piece_.v0, v0),
                std::max(piece_.v1, v1)};
      return;
    }
    Lane4 high[kMostPoints];
    halve_net(net, high, nu_, nv_, du >= dv);
    if (du >= dv) {
      visit(net, u0, u0 + 0.5F * du, v0, v1);
      visit(high, u0 + 0.5F * du, u1, v0, v1);
    } else {
      visit(net, u0, u1, v0, v0 + 0.5F * dv);
      visit(high, u0, u1, v0 + 0.5F * dv, v1);
    }
  }

  const Shape& shape_;
  Lane4 x_, y_, z_;  // of the corners
  double longest_ = 0, round_off_ = 0;
  Vec3 below_;
  int nu_ = 0, nv_ = 0;
  PatchPiece piece_;
};

// What is at `to`, made if there is nothing. Of two threads that make it at once one throws its own away.
template <class T, class Make>
T* get(std::atomic<T*>* to, const Make& make) {
  T* there = to->load(std::memory_order_acquire);
  if (there) return there;
  T* const mine = make();
  if (to->compare_exchange_strong(there, mine, std::memory_order_acq_rel)) return mine;
  delete mine;
  return there;
}

}  // namespace

struct SupportCells::Block {
  std::array<std::atomic<SupportCell*>, kBlockEdge * kBlockEdge> cells{};
  ~Block() {
    for (const auto& cell : cells) delete cell.load();
  }
};

SupportCells::Made::~Made() {
  for (const auto& block : blocks) delete block.load();
}

const SupportCell* SupportCells::at(const Shape& shape, const Vec3& d) const {
  static_assert(6 * kBlocksPerEdge * kBlocksPerEdge == std::tuple_size<decltype(Made::blocks)>());
  const CubePoint c = to_cube(d);
  if (!(c.major > 0.5)) return nullptr;
  const int i = cube_cell(c.a, kSupportCells), j = cube_cell(c.b, kSupportCells);
  const int block = (c.face * kBlocksPerEdge + i / kBlockEdge) * kBlocksPerEdge + j / kBlockEdge;
  Block* const of = get(&made_->blocks[block], [] { return new Block; });
  return get(&of->cells[i % kBlockEdge * kBlockEdge + j % kBlockEdge],
             [&] { return new SupportCell(CellMaker(shape, c.face, i, j).make()); });
}

}  // namespace nurbs

// Stage (d) for contacts that go on: Newton on the surfaces, side by side (contact/joint_lanes.h). What is
// not found here is solved one at a time.
#include <limits>

#include "contact/edge_search.h"
#include "contact/joint_lanes.h"
#include "scene/block_lanes.h"
#include "scene/contact_results.h"

namespace nurbs {
namespace {

constexpr int kPoints = kLocalModelSize;  // field of on_a; on_b follows

// Whether a contact was solved on both surfaces the last time, and a plain Newton may go on from there.
bool goes_on(const ContactBlock& block, int lane) {
  return (block.used >> lane & 1) && block.fresh[lane] == 0 && block.a[lane] >= 0 &&
         block.field[kFlat][lane] == 0 && !is_mark(block.field[kUnique][lane]) &&
         block.field[kPoints][lane] >= 0 && block.field[kPoints + 5][lane] >= 0;
}

}  // namespace

void ContactStages::follow_surfaces(ContactBlock& block, int first, Results& results) const {
  if (step_.wall != nullptr || step_.settings.solver != Solver::ladder) return;
  JointLanes pairs;
  PointMemory points[kWidth][2];
  unsigned asked = 0;
  const double *of_a[kWidth], *of_b[kWidth];
  for (int l = 0; l < kWidth; ++l) {
    const int lane = first + l;
    of_a[l] = of_b[l] = step_.bodies->record(0).x;
    pairs.scale_a[l] = pairs.scale_b[l] = 1;
    if (results.served[lane] != 0 || !goes_on(block, lane)) continue;
    const int a = block.a[lane], b = block.b[lane];
    const Particle pa = step_.bodies->particle(a), pb = step_.bodies->particle(b);
    // Have a closed form.
    if ((pa.shape->ellipsoid.found && pb.shape->ellipsoid.found) ||
        (pa.shape->core.found() && pb.shape->core.found()))
      continue;
    block.get(lane, kPoints, 10, points[l]);
    pairs.on_a[l] = warm_point(points[l][0], *pa.shape);
    pairs.on_b[l] = warm_point(points[l][1], *pb.shape);
    // Those go on by their own Newton.
    if (is_on_edge(*pa.shape, pairs.on_a[l]) || is_on_edge(*pb.shape, pairs.on_b[l])) continue;
    pairs.a[l] = pa.shape;
    pairs.b[l] = pb.shape;
    pairs.scale_a[l] = pa.scale;
    pairs.scale_b[l] = pb.scale;
    of_a[l] = record(a).x;
    of_b[l] = record(b).x;
    asked |= 1u << l;
  }
  if (asked == 0) return;
  const Pose a = gather_pose(of_a), b = gather_pose(of_b);
  pairs.turn_a = a.turn;
  pairs.turn_b = b.turn;
  pairs.offset = b.x - a.x;
  pairs.size = smaller(a.radius, b.radius);
  pairs.reach = larger(a.radius, b.radius);
  pairs.tolerance = larger<Wide>(step_.settings.tolerance * pairs.size, kLeastTolerance * pairs.reach);
  const unsigned found = follow_joints(asked, std::numeric_limits<double>::infinity(), &pairs);
  if (found == 0) return;

  const WideMask mask = mask_of(found);
  const Wide one = all<Wide>(1);
  put_lanes(mask, pairs.gap, first, results.gap);
  put_lanes(mask, pairs.lower, first, results.lower);
  put_lanes(mask, pairs.normal, first, results.normal);
  put_lanes(mask, all<Wide>(0.5) * (pairs.point_a + pairs.point_b), first, results.point);
  put_lanes(mask, pairs.offset, first, results.offset);
  put_lanes(mask, select((pairs.gap < 0.0) & (pairs.lower <= 0.0), one, Wide{}), first, results.touching);
  put_lanes(mask, one, first, results.served);
  for (int l = 0; l < kWidth; ++l)
    if (found >> l & 1) results.iterations[first + l] = pairs.iterations[l];
  if (step_.setup) return;  // what is remembered stays, so that a run in two parts moves as one

  for (int l = 0; l < kWidth; ++l) {
    if (!(found >> l & 1)) continue;
    const int lane = first + l;
    const Particle pa = step_.bodies->particle(block.a[lane]), pb = step_.bodies->particle(block.b[lane]);
    PairProof& proof = *block.proof[lane];
    LocalModel model;
    drop_model(&model);
    scale(pa.scale, &pairs.jet_a[l]);
    scale(pb.scale, &pairs.jet_b[l]);
    const auto side = [](const Particle& p, const SurfacePoint& at, const JetLanes& jet, const double* q) {
      return ModelSide{*p.shape, p.scale, at, jet, Mat3::Identity(), Vec3::Zero(), turned2(p.q, q)};
    };
    const ModelSide side_a = side(pa, pairs.base_a[l], pairs.jet_a[l], proof.q_a),
                    side_b = side(pb, pairs.base_b[l], pairs.jet_b[l], proof.q_b);
    const auto turn = [&] {
      return pairs.dented[l] ? turn_to_rival(pairs.side_a(l), pairs.side_b(l)) : kNormalMargin;
    };
    const auto turn_b = [&] { return (pa.q.conjugate() * pb.q).toRotationMatrix(); };
    make_local_model(side_a, side_b, turn_b, pairs.gap[l], step_.settings.tolerance, pairs.size[l],
                     0.5 * pairs.unique[l], turn, &model);
    if (model.unique > 0)
      block.set(lane, 0, kLocalModelSize, &model);
    else
      block.field[kUnique][lane] = model.unique;
    remember_point(pairs.on_a[l], &points[l][0]);
    remember_point(pairs.on_b[l], &points[l][1]);
    block.set(lane, kPoints, 10, points[l]);
    set_proof(nurbs::lane(pairs.direction, l), pairs.lower[l], nurbs::lane(pairs.offset, l), pa.q, pb.q,
              &proof);
  }
}

}  // namespace nurbs

// The edges of a sphero-polyhedron's core: see sphero_polyhedron.h.
#include <algorithm>
#include <cmath>

#include "body/rounding.h"
#include "body/shape.h"

namespace nurbs {
namespace {

constexpr double kThere = 2 * kFlatness;  // of the bounding radius: off a core's point
constexpr double kOwnNormal = 1e-6;       // rad, of a line from the normal that it is sought by
constexpr double kOnFaceCosine = 1 - 1e-12;
constexpr double kLeastArc = 0.1;  // cosine between the middle of an arc and its ends

class CoreEdges {
 public:
  explicit CoreEdges(const Shape& shape) : shape_(shape) {}

  std::vector<SpheroPolyhedron::Edge> run() {
    const FlatFeatures& flats = shape_.flats;
    if (!(shape_.core.radius > 0) || flats.ruling.empty()) return {};
    for (int p = 0; p < static_cast<int>(shape_.patches.size()); ++p)
      if (!(flats.ruling[p] != Ruling::none ? add(p) : is_elsewhere(p))) return {};
    return std::move(out_);
  }

 private:
  PointAndNormal at(const SurfacePoint& place) const {
    const Jet1 jet = evaluate1(shape_.patches[place.patch], place.u, place.v);
    return {jet.s, jet.su.cross(jet.sv).normalized()};
  }
  bool near(const Vec3& x, const Vec3& y) const { return (x - y).norm() <= kThere * shape_.bounding_radius; }
  // The number of the point that the ball is about which touches at x; -1 without one.
  int point(const Vec3& x, const Vec3& normal) const {
    const std::vector<Vec3>& points = shape_.core.points;
    const Vec3 centre = x - shape_.core.radius * normal;
    for (size_t k = 0; k < points.size(); ++k)
      if (near(points[k], centre)) return static_cast<int>(k);
    return -1;
  }

  bool add(int patch) {
    const bool along_u = shape_.flats.ruling[patch] == Ruling::along_u;
    const auto place = [&](double across) {
      return along_u ? SurfacePoint{patch, 0.5, across} : SurfacePoint{patch, across, 0.5};
    };
    const PointAndNormal middle = at(place(0.5));
    RuledLine line;
    if (!ruled_line(shape_, place(0.5), middle.n, kOwnNormal, &line)) return false;
    SpheroPolyhedron::Edge edge{};
    for (int k = 0; k < 2; ++k)
      if ((edge.ends[k] = point(line.ends[k], middle.n)) < 0) return false;
    if (edge.ends[0] == edge.ends[1]) return false;
    const Vec3& end = shape_.core.points[edge.ends[0]];
    edge.along = (shape_.core.points[edge.ends[1]] - end).normalized();
    const PointAndNormal low = at(place(0)), high = at(place(1));
    for (const PointAndNormal& side : {low, high}) {
      const Vec3 centre = side.x - shape_.core.radius * side.n;
      if (!(side.n.dot(middle.n) >= kLeastArc) ||
          !near(centre, end + edge.along.dot(centre - end) * edge.along))
        return false;
    }
    edge.from = low.n;
    edge.to = high.n;
    if (edge.along.dot(edge.from.cross(edge.to)) < 0) std::swap(edge.from, edge.to);
    out_.push_back(edge);
    return true;
  }

  // Part of a ball or of a face.
  bool is_elsewhere(int patch) const {
    const PointAndNormal middle = at({patch, 0.5, 0.5});
    return point(middle.x, middle.n) >= 0 || nearest_face(shape_.flats, middle.n, kOnFaceCosine) >= 0;
  }

  const Shape& shape_;
  std::vector<SpheroPolyhedron::Edge> out_;
};

}  // namespace

std::vector<SpheroPolyhedron::Edge> find_core_edges(const Shape& shape) {
  return CoreEdges(shape).run();
}

}  // namespace nurbs

// See polygon_points.h.
#include "contact/polygons/polygon_points.h"

#include <cmath>

namespace nurbs::polygon {
namespace {

constexpr double kBesideLine = 1e-8;  // of the bounding radius: a support point this near a line is on it
constexpr double kThinnest = 1e-7;    // width to length of a polygon below which it is a segment

void set_point(const Candidates& from, int i, double weight, ContactPolygon* out) {
  store(from.on_body[i], out->point[out->count]);
  out->weight[out->count] = weight;
  out->id[out->count++] = from.id[i];
}

}  // namespace

std::uint32_t vertex_id(int body, int vertex) {
  return vertex < 0 ? 0 : static_cast<std::uint32_t>(1 + body) << 30 | static_cast<std::uint32_t>(vertex);
}
std::uint32_t crossing_id(int side_of_a, int side_of_b) {
  return 3u << 30 | (static_cast<std::uint32_t>(side_of_a) & 0x7fffu) << 15 |
         (static_cast<std::uint32_t>(side_of_b) & 0x7fffu);
}

double size_of(const ConvexPolygon& p, int* first, int* second) {
  double most = 0;
  for (int i = 0; i < p.count; ++i)
    for (int j = i + 1; j < p.count; ++j) {
      const double d = (p.corner[i] - p.corner[j]).squaredNorm();
      if (d <= most) continue;
      most = d;
      *first = i;
      *second = j;
    }
  return std::sqrt(most);
}

bool finish(const Candidates& from, double least, const Vec2* centre, ContactPolygon* out) {
  out->count = 0;
  int first = 0, second = 0;
  const double size = from.plane.count > 1 ? size_of(from.plane, &first, &second) : 0;
  if (!(size > least)) return false;
  if (from.plane.count == 2 || polygon_area(from.plane) <= kThinnest * size * size) {
    set_point(from, first, 0.5, out);
    set_point(from, second, 0.5, out);
    return true;
  }
  int kept[ConvexPolygon::kMost];
  const int count = thin(from.plane, kContactPoints, 0, kept);
  ConvexPolygon few;
  for (int i = 0; i < count; ++i) few.add(from.plane.corner[kept[i]]);
  double weight[ConvexPolygon::kMost];
  corner_weights(few, centre ? *centre : polygon_centroid(from.plane), weight);
  for (int i = 0; i < count; ++i) set_point(from, kept[i], weight[i], out);
  return true;
}

void set_marks(const BodyFrame& reference, const BodyFrame& incident, ContactPolygon* out) {
  const auto in_reference = [&](int i) -> Vec3 {
    const Vec3 x = incident.x + incident.scale * (incident.axes * load(out->point[i]));
    return reference.axes.transpose() * (x - reference.x);
  };
  const Vec3 zero = in_reference(0);
  double most = 0;
  out->far = 0;
  for (int i = 1; i < out->count; ++i) {
    const double d = (in_reference(i) - zero).squaredNorm();
    if (d > most) most = d, out->far = i;
  }
  store(zero, out->mark[0]);
  store(in_reference(out->far), out->mark[1]);
}

void set_ring(const Shape& shape, int body, int face, ContactPolygon* out) {
  const FlatFace& f = shape.flats.faces[face];
  const int points = static_cast<int>(f.outline.size());
  if (points < 2 * kContactPoints) return;
  out->ring = face + 1;
  out->count = kContactPoints;
  for (int i = 0; i < kContactPoints; ++i) {
    const Sector s = sector(i, points);
    out->weight[i] = 0;
    for (int k = s.first; k < s.last; ++k) out->weight[i] += f.weight[k];
    const int middle = f.outline[(s.first + s.last) / 2];
    store(shape.flats.vertices[middle], out->point[i]);
    out->id[i] = vertex_id(body, middle);
  }
}

double lean(const Shape& shape, const Vec3& d, const Vec3& support, const Vec3& p, const Vec3& q) {
  const Vec3 way = q - p, off = support - p;
  const double t = std::clamp(off.dot(way) / way.squaredNorm(), 0.0, 1.0);
  if ((off - t * way).norm() <= kBesideLine * shape.bounding_radius) return 0;
  return std::max(0.0, d.dot(support) - std::min(d.dot(p), d.dot(q)));
}

}  // namespace nurbs::polygon

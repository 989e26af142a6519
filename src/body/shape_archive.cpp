// Shapes as bytes: see shape.h, and nurbs/archive.h for how.
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>

#include "body/shape.h"
#include "nurbs/archive.h"

namespace nurbs {

template <class Archive>
void archive(Archive& a, Shape& s) {
  auto& [name, stamp, surfaces, patches, surface_of_patch, links, balls, bilinear, mass, gyration,
         inverse_gyration, sphere_like, principal_gyration, principal_axes, bounding_radius, inner_radius,
         concavity, support_excess, joint_slack, pole_spread, small_kinks, smooth, curvature, patch_curvature,
         rates, proofs, joints, normal_map, atlas, lazy_inner_map, lazy_near_ball, support_cells, ellipsoid,
         revolution, meridian, near_revolution, profile_radii, core, ball_hull, inner_balls, round_edges,
         edge_curves, flats] = s;
  static_cast<void>(lazy_near_ball);  // both made again where they are asked for, from the rest
  static_cast<void>(support_cells);
  a(name, stamp, surfaces, patches, surface_of_patch, links, balls, bilinear, mass, gyration,
    inverse_gyration, sphere_like, principal_gyration, principal_axes, bounding_radius, inner_radius,
    concavity, support_excess, joint_slack, pole_spread, small_kinks, smooth, curvature, patch_curvature,
    rates, proofs, joints, normal_map, atlas, lazy_inner_map, ellipsoid, revolution, meridian,
    near_revolution, profile_radii, core, ball_hull, inner_balls, round_edges, edge_curves, flats);
}

std::string pack(const Shape& shape) {
  Writer writer;
  archive(writer, const_cast<Shape&>(shape));  // a writer changes nothing
  return std::move(writer.data);
}

std::shared_ptr<const Shape> unpack(const std::string& data) {
  Reader reader(data);
  const auto shape = std::make_shared<Shape>();
  archive(reader, *shape);
  if (!reader.at_end()) throw std::length_error("an archive is longer than its shape");
  return shape;
}

}  // namespace nurbs

#include "body/cell_frame.h"

#include <cmath>
#include <utility>

namespace nurbs::cells {
namespace {

Section section(const Cell& c, bool in_v, bool backwards) {
  const double low = in_v ? c.v0 : c.u0, high = low + (in_v ? c.dv : c.du);
  return backwards ? Section{1 - high, 1 - low} : Section{low, high};
}

}  // namespace

const Vec4& turned_point(const BezierPatch& patch, int pole, int i, int j) {
  const int p = patch.degree_u, q = patch.degree_v;
  const auto at = [&](int iu, int jv) -> const Vec4& { return patch.point(iu, jv); };
  switch (pole) {
    case 1:
      return at(p - i, q - j);
    case 2:
      return at(p - j, i);
    case 3:
      return at(j, q - i);
    default:
      return at(i, j);
  }
}

double from_pole(const Cell& c) {
  switch (c.pole) {
    case 0:
      return c.u0;
    case 1:
      return 1 - c.u0 - c.du;
    case 2:
      return c.v0;
    default:
      return 1 - c.v0 - c.dv;
  }
}

Section rows_of(const Cell& c) {
  return section(c, c.pole >= 2, c.pole == 1 || c.pole == 3);
}
Section columns_of(const Cell& c) {
  return section(c, c.pole < 2, c.pole == 1 || c.pole == 2);
}

bool make_frame(const BezierPatch& patch, const Cell& cell, const Vec3& origin, bool upright, Frame* frame) {
  const Jet2 j = evaluate2(patch, cell.u0 + 0.5 * cell.du, cell.v0 + 0.5 * cell.dv);
  Vec3 su = cell.du * j.su, sv = cell.dv * j.sv;
  Vec3 suu = cell.du * cell.du * j.suu, suv = cell.du * cell.dv * j.suv, svv = cell.dv * cell.dv * j.svv;
  if (cell.pole >= 2) {
    std::swap(su, sv);
    std::swap(suu, svv);
  }
  if (cell.pole == 1 || cell.pole == 3) su = -su;
  if (cell.pole == 1 || cell.pole == 2) sv = -sv;
  if (cell.pole == 2 || cell.pole == 3) suv = -suv;  // one of u and v is turned round, and they are exchanged
  if (cell.pole >= 0) {                              // x_v = u z_v
    const double u = from_pole(cell) + 0.5 * (cell.pole < 2 ? cell.du : cell.dv);
    sv /= u;
    suv /= u;
    svv /= u * u;
  }
  const Vec3 n = su.cross(sv);
  const double e = -n.dot(suu), f = -n.dot(suv), g = -n.dot(svv), det = e * g - f * f;
  const double area = n.norm();
  if (!(area > 0)) return false;
  const double metric_e = su.squaredNorm(), metric_f = su.dot(sv), metric_g = sv.squaredNorm();
  const double mean = 0.5 * (metric_e * g - 2 * metric_f * f + metric_g * e) / (area * area * area),
               gauss = det / (area * area * area * area),
               split = std::sqrt(std::max(0.0, mean * mean - gauss));
  frame->least_curvature = mean > 0 ? gauss / (mean + split) : mean - split;
  frame->max_radius = frame->least_curvature > 0 ? 1 / frame->least_curvature : kInfinity;
  frame->min_radius = mean + split > 0 ? 1 / (mean + split) : kInfinity;
  Vec3 up = n / area;
  double height = std::sqrt(area);
  if (upright) {
    const double mean_form = 0.5 * (std::abs(e) + std::abs(g)) / area;
    if (mean_form > 0) height = mean_form;
  } else if (det > 0 && e > 0) {
    const Vec3 affine = -(g * suu - 2 * f * suv + e * svv) / (2 * det);  // n . affine = 1
    const double size = 0.5 * (e + g);                                   // = - n . (suu + svv) / 2
    up = size * affine;
    height = 1;
  }
  frame->origin = origin;
  frame->back << su, sv, height * up;
  frame->det = frame->back.determinant();
  if (!(frame->det > 0) || !std::isfinite(frame->det)) return false;
  frame->to = frame->back.inverse();
  return frame->to.allFinite();
}

}  // namespace nurbs::cells

// See profile_turn.h.
#include "body/profile_turn.h"

#include <algorithm>

#include "nurbs/tolerances.h"

namespace nurbs {
namespace {

double longest(const Bernstein<Vec3>& row) {
  double most = 0;
  for (const Vec3& x : row) most = std::max(most, x.norm());
  return most;
}

bool bulges(const Meridian::Piece& piece, const ProfileTurn& turn, double size) {
  for (int i = 0; i <= piece.degree; ++i)
    if (!(piece.r[i] >= -kRoundoff * size)) return false;
  return std::all_of(turn.velocity.begin(), turn.velocity.end(),
                     [&](const Vec2& n) { return turn.side * n[1] >= -turn.velocity_noise; }) &&
         std::all_of(turn.det.begin(), turn.det.end(),
                     [&](double x) { return turn.side * x >= -turn.det_noise; });
}

}  // namespace

ProfileTurn profile_turn(const Meridian& meridian, const Meridian::Piece& piece,
                         const std::vector<BezierPatch>& patches, double size) {
  ProfileTurn turn;
  Bernstein<Vec3> c;
  Bernstein<Vec2> x;
  for (int i = 0; i <= piece.degree; ++i) {
    c.emplace_back(piece.r[i] / size, piece.z[i] / size, piece.w[i]);
    x.push_back(c[i].head<2>());
    turn.weight.push_back(c[i][2]);
  }
  const auto by = [](const Vec2& a, double b) -> Vec2 { return a * b; };
  const Bernstein<Vec3> first = derivative(c), second = derivative(first);
  turn.velocity =
      difference(multiply(derivative(x), turn.weight, by), multiply(x, derivative(turn.weight), by));
  turn.det = multiply(multiply(c, first, [](const Vec3& a, const Vec3& b) -> Vec3 { return a.cross(b); }),
                      second, [](const Vec3& a, const Vec3& b) { return a.dot(b); });
  turn.velocity_noise = kRoundoff * longest(c) * longest(first);
  turn.det_noise = turn.velocity_noise * longest(second);
  const Jet1 middle = evaluate1(patches[meridian.sectors[piece.first_sector].patch], 0.5, 0.5);
  const Vec3 at = meridian.axes * (middle.s - meridian.point),
             normal = meridian.axes * middle.su.cross(middle.sv);
  const Vec2 outward(normal.head<2>().dot(at.head<2>().normalized()), normal[2]),
      n = halve(turn.velocity).first.back();  // at the middle
  turn.side = outward[0] * n[1] - outward[1] * n[0] > 0 ? 1 : -1;
  return turn;
}

std::vector<bool> bulging_patches(const Meridian& meridian, const std::vector<BezierPatch>& patches,
                                  double size) {
  std::vector<bool> bulging(patches.size(), false);
  if (!meridian.exact) return bulging;
  for (const Meridian::Piece& piece : meridian.pieces) {
    const bool all = bulges(piece, profile_turn(meridian, piece, patches, size), size);
    for (int k = piece.first_sector; k < piece.first_sector + piece.sectors; ++k)
      bulging[meridian.sectors[k].patch] = all;
  }
  return bulging;
}

}  // namespace nurbs

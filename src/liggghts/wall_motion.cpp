// See wall_motion.h.
#include "liggghts/wall_motion.h"

#include <cmath>
#include <cstring>

#include "liggghts/host_error.h"
#include "liggghts/nurbs_contact.h"

namespace LAMMPS_NS::nurbs_host {

using nurbs::Vec3;

int WallMotion::parse(LAMMPS* lmp, const std::string& user, int narg, char** arg) {
  int at = 0;
  const auto word = [&](const char* expected) {
    if (at < narg && std::strcmp(arg[at], expected) == 0) {
      ++at;
      return;
    }
    fail_all(
        FLERR, lmp,
        user + ": move: expected " + expected + (at < narg ? std::string(" instead of ") + arg[at] : ""));
  };
  const auto number = [&](const char* what) {
    if (at >= narg) fail_all(FLERR, lmp, user + ": move: " + what + " is missing");
    return parse_number(lmp, user + ": move: " + what, arg[at++]);
  };
  const auto vector = [&](const char* what) {
    const double x = number(what), y = number(what), z = number(what);
    return Vec3(x, y, z);
  };
  const auto period = [&] {
    word("period");
    if (at >= narg) fail_all(FLERR, lmp, user + ": move: period is missing");
    const double value = parse_number(lmp, user + ": move: period", arg[at++]);
    if (value == 0) fail_all(FLERR, lmp, user + ": move: period = 0 must not be 0");
    return 2 * M_PI / value;
  };
  const std::string kind = narg > 0 ? arg[at++] : "";
  if (kind_ != none) fail_all(FLERR, lmp, user + ": move is there twice");
  if (kind == "linear") {
    kind_ = linear;
    vector_ = vector("velocity");
  } else if (kind == "rotate") {
    kind_ = rotate;
    word("origin");
    centre_ = vector("origin");
    word("axis");
    vector_ = vector("axis");
    if (!(vector_.norm() > 0))
      fail_all(FLERR, lmp, user + ": move rotate: axis = 0 0 0 must have a length > 0");
    vector_.normalize();
    rate_ = period();
  } else if (kind == "wiggle") {
    kind_ = wiggle;
    word("amplitude");
    vector_ = vector("amplitude");
    rate_ = period();
  } else {
    fail_all(FLERR, lmp, user + ": move " + kind + " must be linear, rotate or wiggle");
  }
  return at;
}

Vec3 WallMotion::point(const Vec3& x, double time) const {
  if (kind_ == linear) return x + time * vector_;
  if (kind_ == wiggle) return x + std::sin(rate_ * time) * vector_;
  if (kind_ == rotate) return centre_ + direction(x - centre_, time);
  return x;
}

Vec3 WallMotion::direction(const Vec3& d, double time) const {
  if (kind_ != rotate) return d;
  return Eigen::AngleAxisd(rate_ * time, vector_) * d;
}

nurbs::WallMotion WallMotion::velocity(double time) const {
  nurbs::WallMotion m;
  if (kind_ == linear) m.velocity = vector_;
  if (kind_ == wiggle) m.velocity = rate_ * std::cos(rate_ * time) * vector_;
  if (kind_ == rotate) {
    m.centre = centre_;
    m.spin = rate_ * vector_;
  }
  return m;
}

double WallMotion::way(const Vec3& about, double reach, double from, double to) const {
  if (kind_ == rotate) return std::abs(rate_ * (to - from)) * ((about - centre_).norm() + reach);
  return (point(Vec3::Zero(), to) - point(Vec3::Zero(), from)).norm();
}

}  // namespace LAMMPS_NS::nurbs_host

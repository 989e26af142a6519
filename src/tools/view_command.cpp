// nurbs-shape view, export: a body for other programs, as exact faces (STEP), exact cells (VTU), triangles
// (STL) or a picture (PNG).
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <memory>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "body/support.h"
#include "io/shape_file.h"
#include "io/vtu_file.h"
#include "nurbs/tolerances.h"
#include "tools/cad_file.h"
#include "tools/command.h"

namespace nurbs {
namespace {

struct Arguments {
  std::string file, output, tolerance = "0.1%", unit = "mm";
  bool has_tolerance = false, has_unit = false;  // given
};

constexpr double kSingle = 6e-8, kStepShare = 0.1;  // round-off of STL; of the tolerance, at most
constexpr int kMostCells = 400;                     // of an STL grid, per Bezier patch parameter

std::shared_ptr<const Shape> load(const std::string& file) {
  std::vector<std::string> warnings;
  auto shape = read_shape_file(file, &warnings);
  print_warnings(warnings);
  return shape;
}

std::string vtu(const Shape& shape) {
  VtuBody body;
  body.id = body.type = 1;
  body.position = shape.mass.center;
  std::ostringstream out;
  write_vtu(out, {body}, {&shape}, 0);
  return out.str();
}

// Cells per parameter so that no chord of a circle of the patches' sharpest bend is off by more than `error`.
int cells_for(const BezierPatch& patch, double error) {
  double bend = 0;
  for (int i = 0; i <= 8; ++i)
    for (int j = 0; j <= 8; ++j) {
      const Jet2 s = evaluate2(patch, i / 8.0, j / 8.0);
      bend = std::max(bend, s.suu.norm() + 2 * s.suv.norm() + s.svv.norm());
    }
  return std::min(static_cast<int>(std::ceil(std::sqrt(bend / (8 * error)))) + 1, kMostCells);
}

void put(std::string& out, const Vec3& v) {
  for (int c = 0; c < 3; ++c) {
    const float x = static_cast<float>(v[c]);
    std::uint32_t bits;
    std::memcpy(&bits, &x, sizeof bits);
    for (int k = 0; k < 4; ++k) out += static_cast<char>(bits >> 8 * k & 255);
  }
}

// The patches' corners, (0, 0), (1, 0), (0, 1), (1, 1): of all that meet the first one's, so that none is
// doubled.
std::vector<std::array<Vec3, 4>> common_corners(const Shape& shape) {
  const double apart = 2 * kJoinTolerance * shape.bounding_radius;
  std::vector<Vec3> known;
  std::vector<std::array<Vec3, 4>> corners;
  for (const BezierPatch& patch : shape.patches) {
    corners.emplace_back();
    for (int k = 0; k < 4; ++k) {
      const Vec3 x = evaluate0(patch, k % 2, k / 2);
      const auto same =
          std::find_if(known.begin(), known.end(), [&](const Vec3& y) { return (x - y).norm() <= apart; });
      corners.back()[k] = same == known.end() ? x : *same;
      if (same == known.end()) known.push_back(x);
    }
  }
  return corners;
}

// Point (i, j) of a grid over a patch; on an edge that of the first of its two patches, whose parameters may
// run otherwise, so that triangles meet.
Vec3 grid_point(const Shape& shape, const std::vector<std::array<Vec3, 4>>& corners, int patch, int i, int j,
                int cells) {
  const auto inside = [cells](int k) { return k > 0 && k < cells; };
  const auto corner = [&] { return corners[patch][(i > 0 ? 1 : 0) + (j > 0 ? 2 : 0)]; };
  if (!inside(i) && !inside(j)) return corner();
  if (inside(i) != inside(j)) {
    const int edge = inside(j) ? (i > 0 ? 1 : 0) : (j > 0 ? 3 : 2), k = inside(j) ? j : i;
    const EdgeLink& link = shape.links[patch][edge];
    if (link.collapsed) return corner();
    if (link.patch >= 0 && std::pair(link.patch, link.edge) < std::pair(patch, edge)) {
      const int there = link.reversed ? cells - k : k, end = link.edge % 2 ? cells : 0;
      patch = link.patch;
      i = link.edge < 2 ? end : there;
      j = link.edge < 2 ? there : end;
    }
  }
  return evaluate0(shape.patches[patch], static_cast<double>(i) / cells, static_cast<double>(j) / cells);
}

// Binary STL of the body, its centre of mass at `place`. All patches share one number of cells per parameter,
// so that edges meet.
std::string stl(const Shape& shape, const Vec3& place, double error, size_t* count) {
  int cells = 2;
  for (const BezierPatch& patch : shape.patches) cells = std::max(cells, cells_for(patch, error));
  const std::vector<std::array<Vec3, 4>> corners = common_corners(shape);
  std::string body;
  std::uint32_t triangles = 0;
  for (int patch = 0; patch < static_cast<int>(shape.patches.size()); ++patch) {
    // As they are written: what is doubled then is none of a triangle's three.
    const auto at = [&](int i, int j) -> Vec3 {
      return (grid_point(shape, corners, patch, i, j, cells) + place).cast<float>().cast<double>();
    };
    for (int i = 0; i < cells; ++i)
      for (int j = 0; j < cells; ++j) {
        const Vec3 p[4] = {at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)};
        for (const auto& [b, c] : {std::pair{1, 2}, std::pair{2, 3}}) {
          if (p[0] == p[b] || p[0] == p[c] || p[b] == p[c]) continue;  // at a pole
          put(body, (p[b] - p[0]).cross(p[c] - p[0]).stableNormalized());
          put(body, p[0]);
          put(body, p[b]);
          put(body, p[c]);
          body.append(2, '\0');
          ++triangles;
        }
      }
  }
  std::string out = "NURBS body " + shape.name;
  out.resize(80, ' ');
  for (int k = 0; k < 4; ++k) out += static_cast<char>(triangles >> 8 * k & 255);
  *count = triangles;
  return out + body;
}

Vec3 box_extent(const Shape& shape) {
  Vec3 extent;
  for (int k = 0; k < 3; ++k)
    extent[k] = find_support(shape, Vec3::Unit(k)).point[k] - find_support(shape, -Vec3::Unit(k)).point[k];
  return extent;
}

void export_step(const Arguments& a, const Shape& shape, double unit) {
  const std::string draft = a.output + "." + std::to_string(getpid()) + ".tmp";
  double volume = 0;
  try {
    volume = write_step_file(shape, unit, draft);
    if (std::rename(draft.c_str(), a.output.c_str()) != 0) throw ShapeError(std::strerror(errno));
  } catch (const ShapeError& error) {
    std::remove(draft.c_str());
    throw ShapeError(a.output + ": " + error.what());
  }
  std::printf("%s: solid of %.6g mm^3, %s mm\n", a.output.c_str(), volume,
              format_box(unit * box_extent(shape)).c_str());
}

void export_shape(const Arguments& a) {
  const double share = parse_share("export: --tolerance", a.tolerance, 0.1);
  const std::string kind = ending(a.output);
  const bool is_step = kind == ".step" || kind == ".stp";
  if (kind != ".stl" && kind != ".vtu" && !is_step)
    throw UsageError("export: ending '" + kind + "' is not known; -o takes .stl, .vtu, .step or .stp");
  if (a.has_unit && !is_step)
    throw UsageError("export: --unit is for .step and .stp: a " + kind + " file's lengths are the shape's");
  if (a.has_tolerance && kind != ".stl")
    throw UsageError("export: --tolerance is for .stl: a " + kind + " file is exact");
  const double unit = parse_unit("export", a.unit);
  const auto shape = load(a.file);
  if (is_step) return export_step(a, *shape, unit);
  if (kind == ".vtu") {
    write_whole(a.output, vtu(*shape));
    std::printf("%s: %zu exact cells\n", a.output.c_str(), shape->patches.size());
    return;
  }
  Vec3 place = shape->mass.center;
  if (kSingle * place.norm() > kStepShare * share * shape->bounding_radius) {
    std::printf("%s: far from the origin; the triangles lie about it, moved by %.17g %.17g %.17g\n",
                a.file.c_str(), -place[0], -place[1], -place[2]);
    place.setZero();
  }
  size_t triangles = 0;
  write_whole(a.output, stl(*shape, place, share * shape->bounding_radius, &triangles));
  std::printf("%s: %zu triangles\n", a.output.c_str(), triangles);
}

// The picture is drawn by a Python script beside the program or in the source tree.
std::string find_script() {
  std::error_code error;
  const std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe", error);
  for (const auto& folder : {program.parent_path(), program.parent_path().parent_path() / "src/tools"}) {
    const auto script = folder / "view_shape.py";
    if (std::filesystem::exists(script, error)) return script.string();
  }
  throw std::runtime_error(
      "view: view_shape.py is neither beside the program nor in ../src/tools: -o FILE.vtu needs no script");
}

std::string quoted(const std::string& word) {
  std::string out = "'";
  for (char c : word) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return out + "'";
}

void view(const Arguments& a) {
  const std::string kind = ending(a.output);
  if (kind != ".png" && kind != ".vtu")
    throw UsageError("view: ending '" + kind + "' is not known; -o takes .png or .vtu");
  const auto shape = load(a.file);
  if (kind == ".vtu") {
    write_whole(a.output, vtu(*shape));
  } else {
    const std::string mesh = a.output + "." + std::to_string(getpid()) + ".stl", draft = mesh + ".png";
    size_t triangles = 0;
    write_whole(mesh, stl(*shape, Vec3::Zero(), 1e-3 * shape->bounding_radius, &triangles));
    const std::string command = "/usr/bin/python3 -W ignore " + quoted(find_script()) + " " + quoted(draft) +
                                " " + quoted(mesh) + " >/dev/null 2>&1";
    const int status = std::system(command.c_str());
    std::remove(mesh.c_str());
    if (status != 0 || std::rename(draft.c_str(), a.output.c_str()) != 0) {
      std::remove(draft.c_str());
      throw std::runtime_error("view: can't draw " + a.output +
                               ": needs python3-vtk9, and xvfb where there is no display");
    }
  }
  std::printf("%s\n", a.output.c_str());
}

}  // namespace

Command add_export(CLI::App& app) {
  CLI::App* command =
      app.add_subcommand("export", "writes STEP, STL triangles or VTU cells for other programs");
  command->formatter(std::make_shared<Help>("nurbs-shape export FILE [options] -o FILE.step|stl|vtu"));
  const auto a = std::make_shared<Arguments>();
  command->add_option("FILE", a->file, "shape file")->required();
  command
      ->add_option(
          "-o", a->output,
          "file to write: .step or .stp (exact faces), .stl (triangles), or .vtu (exact rational Bezier "
          "cells)")
      ->type_name("FILE")
      ->required();
  command->add_option("--tolerance", a->tolerance, "of STL triangles, of the bounding radius, default 0.1%")
      ->type_name("T");
  command
      ->add_option(
          "--unit", a->unit,
          "of STEP: the shape file's unit of length, um, mm, cm, m, in or a number of mm; default mm")
      ->type_name("U");
  command->footer("Example: nurbs-shape export grain.json --unit m -o grain.step\n");
  return {command, [a, command] {
            a->has_tolerance = command->count("--tolerance") > 0;
            a->has_unit = command->count("--unit") > 0;
            export_shape(*a);
          }};
}

Command add_view(CLI::App& app) {
  CLI::App* command =
      app.add_subcommand("view", "draws a picture (PNG), or writes exact cells for ParaView (VTU)");
  command->formatter(std::make_shared<Help>("nurbs-shape view FILE -o FILE.png|vtu"));
  const auto a = std::make_shared<Arguments>();
  command->add_option("FILE", a->file, "shape file")->required();
  command->add_option("-o", a->output, "file to write: .png (picture), or .vtu (exact rational Bezier cells)")
      ->type_name("FILE")
      ->required();
  command->footer("Example: nurbs-shape view grain.json -o grain.png\n");
  return {command, [a] { view(*a); }};
}

}  // namespace nurbs

// nurbs-shape fit, simplify: smooth convex bodies for meshes and for shapes finer than needed.
#include "tools/fit_command.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>

#include "body/mass_properties.h"
#include "io/mesh_file.h"
#include "io/shape_file.h"
#include "nurbs/affine.h"
#include "shapes/hull_fit.h"
#include "tools/command.h"

namespace nurbs {
namespace {

constexpr double kFinest = 2e-4, kCoarsest = 0.5;
constexpr double kWeld = 1e-7;                              // of the extent: points closer are one
constexpr double kLeastExtent = 1e-29, kMostExtent = 1e29;  // a shape file's are 1e-30 to 1e30
constexpr double kFarthest = 1e9;                           // of the extent: distance from the origin
constexpr double kSurelyKept = 10, kFarthestKept = 1e3;     // radii from the origin at which a body is left
constexpr double kLeastExcess = 1e-12;  // of the radius: no tolerance of a contact is finer
// Volume of a hull beyond its mesh's, over that: of solids that are not convex, and of which that is warned.
constexpr double kSomeAdded = 0.01, kMuchAdded = 0.1;
constexpr int kSampleGrid =
    64;  // per patch parameter of a body to simplify, over all Bezier patches of a side

double extent(const TriangleMesh& mesh) {
  return bounding_box(mesh.points).diagonal().norm();
}

std::string piece_list(const std::vector<TriangleMesh>& pieces) {
  std::string list;
  for (size_t k = 0; k < pieces.size() && k < 6; ++k)
    list += (k ? ", " : "") + std::to_string(k + 1) + ": " + std::to_string(pieces[k].triangles.size()) +
            " triangles, " + format("%.4g", extent(pieces[k])) + " across";
  return list + (pieces.size() > 6 ? ", .." : "");
}

size_t chosen_piece(const FitArguments& a, const std::vector<TriangleMesh>& pieces) {
  if (pieces.size() == 1) {
    if (!a.piece.empty() && a.piece != "largest" && a.piece != "1")
      throw UsageError("fit: --piece is " + a.piece + ", but " + a.file + " has one piece");
    return 0;
  }
  if (a.piece == "largest") return 0;
  for (size_t k = 0; k < pieces.size(); ++k)
    if (a.piece == std::to_string(k + 1)) return k;
  const std::string count = std::to_string(pieces.size());
  if (!a.piece.empty()) throw UsageError("fit: --piece is " + a.piece + ", must be largest or 1 to " + count);
  throw ShapeError(a.file + ": has " + count + " pieces (" + piece_list(pieces) +
                   "): choose with --piece largest or a number");
}

// One closed piece, wound outward.
TriangleMesh closed_piece(const FitArguments& a, const TriangleMesh& raw) {
  const double size = extent(raw);
  if (!(size > 0)) throw ShapeError(a.file + ": all points coincide");
  if (!(size >= kLeastExtent && size <= kMostExtent))
    throw ShapeError(a.file + ": its extent is " + format("%.3g", size) + ", must be 1e-29 to 1e29");
  double farthest = 0;
  for (const Vec3& p : raw.points) farthest = std::max(farthest, p.norm());
  if (farthest > kFarthest * size)
    throw ShapeError(a.file + ": lies " + format("%.2g", farthest / size) +
                     " times its size from the origin, which leaves its coordinates too few digits: move it");
  const std::vector<TriangleMesh> pieces = split_pieces(weld(raw, kWeld * size));
  if (pieces.empty()) throw ShapeError(a.file + ": no triangle has an area");
  TriangleMesh mesh = pieces[chosen_piece(a, pieces)];
  const MeshDefects defects = orient(mesh);
  std::printf("%s: %zu triangles, %zu points", a.file.c_str(), raw.triangles.size(), raw.points.size());
  if (mesh.points.size() < raw.points.size()) std::printf(", %zu after welding", mesh.points.size());
  if (pieces.size() > 1) std::printf(", piece of %zu", pieces.size());
  if (defects.turned > 0) std::printf(", %d triangles wound the other way and turned", defects.turned);
  std::printf("\n");
  if (defects.open_edges > 0)
    throw ShapeError(a.file + ": is open: " + std::to_string(defects.open_edges) +
                     " edges have one triangle, one near " + format("%.4g ", defects.where[0]) +
                     format("%.4g ", defects.where[1]) + format("%.4g", defects.where[2]) +
                     "; close the mesh first");
  if (defects.wild_edges > 0)
    throw ShapeError(a.file + ": " + std::to_string(defects.wild_edges) +
                     " edges have more than two triangles: the mesh bounds no solid");
  if (defects.one_sided) throw ShapeError(a.file + ": the mesh is one-sided and has no inside");
  return mesh;
}

int spans_of(const std::string& patches) {
  if (patches.empty()) return 0;
  for (int spans : {1, 2, 3, 4, 6, 8, 10, 12})
    if (patches == std::to_string(6 * spans * spans)) return spans;
  throw UsageError("--patches is " + patches + ", must be 6, 24, 54, 96, 216, 384, 600 or 864");
}

// Whether coordinates that lost digits tell less of a body, by which contacts are found. That it is proven
// convex, which digits leave first at narrow rims of flat faces, serves none that its supports don't.
bool is_worse(const Shape& a, const Shape& b) {
  return (b.smooth && !a.smooth) || a.support_excess > b.support_excess + kLeastExcess * a.bounding_radius ||
         (b.proofs.sphere && !a.proofs.sphere) || (b.ellipsoid.found && !a.ellipsoid.found) ||
         a.patch_curvature.min_radius < 0.5 * b.patch_curvature.min_radius;
}

double worst_kink(const Shape& shape) {
  double worst = 0;
  for (const auto& edges : shape.links)
    for (const EdgeLink& link : edges) worst = std::max(worst, std::abs(link.kink));
  return worst * 180 / M_PI;
}

// Largest relative difference of the principal moments per mass.
double moment_error(const MassProperties& a, const MassProperties& b) {
  const Mat3 ga = a.inertia / a.volume, gb = b.inertia / b.volume;
  return (ga - gb).norm() / gb.norm();
}

void print_differences(const char* to, const MassProperties& fit, const MassProperties& reference,
                       double radius) {
  std::printf("against %s: volume %+.3g %%, centre off by %.3g %% of the radius, inertia / mass by %.3g %%\n",
              to, 100 * (fit.volume / reference.volume - 1),
              100 * (fit.center - reference.center).norm() / radius, 100 * moment_error(fit, reference));
}

HullFit fit_with_progress(const ConvexHull& hull, double tolerance, int spans, size_t most_points = 0) {
  HullFitOptions options;
  options.most_points = most_points;
  options.tolerance = tolerance;
  options.spans = spans;
  options.progress = [](const std::string& line) {
    std::printf("  %s\n", line.c_str());
    std::fflush(stdout);
  };
  return fit_hull(hull, options);
}

}  // namespace

bool is_far(const Shape& shape, const Vec3& place) {
  return (shape.mass.center + place).norm() > kSurelyKept * shape.bounding_radius;
}

void put_in_place(const std::string& file, const Shape& about_origin, const Vec3& place,
                  std::vector<NurbsSurface>& surfaces) {
  const double radii = (about_origin.mass.center + place).norm() / about_origin.bounding_radius;
  if (radii <= kFarthestKept) {
    std::vector<NurbsSurface> placed = surfaces;
    transform(placed, Mat3::Identity(), place);
    if (!is_far(about_origin, place) || !is_worse(*make_shape(file, placed), about_origin)) {
      surfaces = std::move(placed);
      return;
    }
  }
  std::printf("%s: lies %.2g radii from the origin; moved to it, by %.17g %.17g %.17g, for the digits\n",
              file.c_str(), radii, -place[0], -place[1], -place[2]);
}

double fit_tolerance(const std::string& command, const std::string& text) {
  const double tolerance = parse_share(command + ": --tolerance", text, kCoarsest);
  if (tolerance < kFinest)
    throw UsageError(command + ": --tolerance is " + text + ", must be 0.02% at least");
  return tolerance;
}

void fit_mesh(const FitArguments& a, const TriangleMesh& raw) {
  const double tolerance = fit_tolerance("fit", a.tolerance) - a.sag;
  const int spans = spans_of(a.patches);
  bool keep_volume = false, keep_inertia = false;
  if (!a.keep.empty()) {
    keep_volume = a.keep.find("volume") != std::string::npos;
    keep_inertia = a.keep.find("inertia") != std::string::npos;
    if (a.keep != "volume" && a.keep != "inertia" && a.keep != "volume,inertia" && a.keep != "inertia,volume")
      throw UsageError("fit: --keep is " + a.keep + ", must be volume, inertia or volume,inertia");
  }
  TriangleMesh mesh = closed_piece(a, raw);
  const Vec3 place = move_to_origin(mesh.points);  // all else is about the origin
  const MassProperties own = mesh_properties(mesh);
  if (!(own.volume > 0)) throw ShapeError(a.file + ": encloses no volume");
  std::unique_ptr<ConvexHull> hull;
  HullFit best;
  try {
    hull = std::make_unique<ConvexHull>(mesh.points);
    const double added = hull->properties().volume / own.volume - 1;
    std::printf("convex hull: %zu vertices, adds %.3g %% to the mesh's volume of %.6g\n",
                hull->mesh().points.size(), 100 * added, own.volume);
    if (!a.inexact.empty())
      std::printf("not exact: %s; fitted\n",
                  added > kSomeAdded ? "the solid is not convex" : a.inexact.c_str());
    if (added > kMuchAdded)
      print_warnings({a.file + ": is not convex: its convex hull has " + format("%.3g", 100 * added) +
                      " % more volume, and the body made is that of the hull"});
    best = fit_with_progress(*hull, tolerance, spans);
  } catch (const ShapeError& error) {
    const std::string less = a.sag > 0 ? " (--tolerance less what the solid's triangles miss)" : "";
    throw ShapeError(a.file + ": " + error.what() + less);
  }
  ShapeFileContent content{best.surfaces, std::nullopt};
  MassProperties mass = best.shape->mass;
  if (keep_volume) {
    const double scale = std::cbrt(own.volume / mass.volume);
    transform(content.surfaces, scale * Mat3::Identity(), (1 - scale) * mass.center);
    mass = solid_properties(content.surfaces);
  }
  if (keep_inertia) content.gyration = own.inertia / own.volume;
  const auto centered = keep_volume ? make_shape("fit", content.surfaces) : best.shape;
  put_in_place(a.file, *centered, place, content.surfaces);
  const auto shape = make_shape(a.output, content.surfaces, content.gyration);
  if (keep_inertia) mass.inertia = own.inertia / own.volume * mass.volume;
  write_whole(a.output, write_shape(content));
  std::printf(
      "%s: %s; %zu patches, %zu control points in the file, where patches repeat the edges they share\n",
      a.output.c_str(), best.kind.c_str(), content.surfaces.size(), control_points(content.surfaces));
  std::printf("distance from the hull: %.3g %% outward, %.3g %% inward of its radius %.6g (bounds)\n",
              100 * best.distance.outward / best.radius, 100 * best.distance.inward / best.radius,
              best.radius);
  if (keep_volume) {
    const HullDistance kept = hull_distance(*centered, *hull, 0.01 * tolerance * best.radius);
    std::printf("after scaling to the mesh's volume: %.3g %% outward, %.3g %% inward\n",
                100 * kept.outward / best.radius, 100 * kept.inward / best.radius);
  }
  std::printf("joints smooth to %.2g degrees; curvature radius %.4g to %.4g\n", worst_kink(*shape),
              shape->patch_curvature.min_radius, shape->patch_curvature.max_radius);
  if (!(shape->patch_curvature.min_radius > 0))
    std::printf("no least curvature radius is proven, which makes contacts dear: try another tolerance\n");
  print_differences("the hull", mass, hull->properties(), best.radius);
  print_differences("the mesh", mass, own, best.radius);
}

namespace {

// Points of a body, about its centre, on a grid over every Bezier patch, about as dense whatever the patches.
std::vector<Vec3> sample(const Shape& shape) {
  const int n =
      std::clamp(static_cast<int>(kSampleGrid * std::sqrt(6.0 / static_cast<double>(shape.patches.size()))),
                 4, 2 * kSampleGrid);
  std::vector<Vec3> points;
  for (const BezierPatch& patch : shape.patches)
    for (int i = 0; i <= n; ++i)
      for (int j = 0; j <= n; ++j)
        points.push_back(evaluate0(patch, static_cast<double>(i) / n, static_cast<double>(j) / n));
  return points;
}

// Why there is no body of fewer control points.
std::string why_no_simpler(const Shape& shape, const std::string& tolerance) {
  const size_t own = control_points(shape.surfaces);
  const std::string count = std::to_string(own);
  if (shape.proofs.sphere)
    return "nothing is simpler: it is a sphere, of " + count +
           " control points, whose contacts are by a formula";
  if (own <= kLeastPoints)
    return "nothing is simpler: it has " + count + " control points, smooth bodies of any form have " +
           std::to_string(kLeastPoints) + " at least, and no special one of fewer is within " + tolerance;
  return "no body of fewer than its " + count + " control points is within " + tolerance;
}

void simplify(const FitArguments& a) {
  check_output("simplify", a.file, a.output);
  const double tolerance = parse_share("simplify: --tolerance", a.tolerance, kCoarsest);
  std::vector<std::string> warnings;
  const auto read = read_shape_file(a.file, &warnings);
  print_warnings(warnings);
  const Vec3 place = read->mass.center;
  std::vector<NurbsSurface> about_origin = read->surfaces;
  transform(about_origin, Mat3::Identity(), -place);
  const auto shape = make_shape(a.file, about_origin);
  const size_t own = control_points(shape->surfaces);
  const auto fail = [&] { throw ShapeError(a.file + ": " + why_no_simpler(*shape, a.tolerance)); };
  if (shape->proofs.sphere) fail();
  std::unique_ptr<ConvexHull> hull;
  HullFit best;
  double sag = 0;  // of the body over the hull of its samples
  try {
    hull = std::make_unique<ConvexHull>(sample(*shape));
    const double radius = shape->bounding_radius;
    sag = hull_distance(*shape, *hull, 0.01 * tolerance * radius).outward / radius;
    if (sag > 0.5 * tolerance)
      throw ShapeError("the tolerance of " + a.tolerance + " is finer than the body is sampled, " +
                       format("%.2g", 200 * sag) + " % at least");
  } catch (const ShapeError& error) {
    throw ShapeError(a.file + ": " + error.what());
  }
  const int spans = spans_of(a.patches);
  try {
    best = fit_with_progress(*hull, tolerance - sag, spans, own - 1);
  } catch (const ShapeError&) {
    fail();
  }
  if (control_points(best.surfaces) >= own) fail();
  ShapeFileContent content{best.surfaces, std::nullopt};
  if ((read->gyration - read->mass.inertia / read->mass.volume).norm() > 1e-9 * read->gyration.norm())
    content.gyration = read->gyration;  // given in the file
  put_in_place(a.file, *best.shape, place, content.surfaces);
  make_shape(a.output, content.surfaces, content.gyration);  // it loads
  write_whole(a.output, write_shape(content));
  std::printf("%s: %s; %zu control points in place of %zu\n", a.output.c_str(), best.kind.c_str(),
              control_points(best.surfaces), own);
  std::printf("distance from %s: %.3g %% outward, %.3g %% inward of its radius (bounds)\n", a.file.c_str(),
              100 * best.distance.outward / best.radius, 100 * (best.distance.inward / best.radius + sag));
  print_differences("the body", best.shape->mass, shape->mass, best.radius);
}

constexpr char kFitNotes[] =
    "The mesh must be closed; points may be doubled, triangles wound either way. The body is a smooth "
    "convex\n"
    "one near the mesh's convex hull: the simplest of a sphere and six bicubic or biquartic patches,\n"
    "polynomial of 1 to 4 spans, rational of 4, 6, 8, 10, 12, whose largest distance from the hull, either\n"
    "way, is proven to be within the tolerance, a share of the hull's largest radius about its centre of\n"
    "mass, and which is proven convex where one is; its flattest places bulge by what the tolerance leaves,\n"
    "which keeps contacts cheap. Cylinders, cones and others of revolution with few edges, and polyhedra of\n"
    "up to 12 faces keep their flat faces and get edges as round as the tolerance allows; so do those of\n"
    "up to 60 for which smooth patches need as many points; edges that are round already keep their\n"
    "radius. Where nothing else is near enough, up to 300 faces stand about the hull, as few as do, of "
    "which\n"
    "those of its flat faces stay in place. Bodies with sharp edges want many points: better take them from\n"
    "`make` or `import`.\n"
    "It lies where the mesh does; from so far away that its coordinates would lose digits it is moved to "
    "the\n"
    "origin, by what is printed.\n"
    "Example: nurbs-shape fit grain.stl --tolerance 2% -o grain.json\n";

}  // namespace

Command add_fit(CLI::App& app) {
  CLI::App* command = app.add_subcommand("fit", "fits a smooth convex body to a mesh (STL, OBJ, PLY)");
  command->formatter(std::make_shared<Help>("nurbs-shape fit MESH [options] -o FILE"));
  command->footer(kFitNotes);
  const auto a = std::make_shared<FitArguments>();
  command->add_option("MESH", a->file, "mesh file")->required();
  command->add_option("-o", a->output, "shape file to write")->type_name("FILE")->required();
  command->add_option("--tolerance", a->tolerance, "as 2% or 0.02, default 1%")->type_name("T");
  command
      ->add_option("--patches", a->patches,
                   "6, 24, 54, 96, 216, 384, 600 or 864 Bezier patches; default: as few as do")
      ->type_name("N");
  command
      ->add_option("--keep", a->keep,
                   "volume (scales the body) and/or inertia (written beside it) of the mesh, not of its hull")
      ->type_name("WHAT");
  command->add_option("--piece", a->piece, "of a mesh of several pieces: largest, or its number")
      ->type_name("P");
  return {command, [a] {
            check_output("fit", a->file, a->output);
            fit_tolerance("fit", a->tolerance);
            fit_mesh(*a, read_mesh_file(a->file));
          }};
}

Command add_simplify(CLI::App& app) {
  CLI::App* command = app.add_subcommand("simplify", "fewer control points within a tolerance");
  command->formatter(std::make_shared<Help>("nurbs-shape simplify FILE --tolerance T -o FILE"));
  const auto a = std::make_shared<FitArguments>();
  command->add_option("FILE", a->file, "shape file")->required();
  command->add_option("-o", a->output, "shape file to write")->type_name("FILE")->required();
  command->add_option("--tolerance", a->tolerance, "as 2% or 0.02 of the body's radius, default 1%")
      ->type_name("T");
  command->add_option("--patches", a->patches, "as for fit")->type_name("N");
  command->footer("Example: nurbs-shape simplify grain.json --tolerance 8% -o coarse.json\n");
  return {command, [a] { simplify(*a); }};
}

}  // namespace nurbs

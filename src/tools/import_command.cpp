// nurbs-shape import: bodies of CAD files, exactly where their faces allow it, fitted where not.
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>

#include "io/shape_file.h"
#include "nurbs/affine.h"
#include "tools/cad_file.h"
#include "tools/command.h"
#include "tools/fit_command.h"

namespace nurbs {
namespace {

constexpr double kSagShare = 0.1;  // of the tolerance, left to the triangles a fit begins with

constexpr double kSecondsToRead = 10, kSecondsPerMegabyte = 10, kSecondsToMesh = 30;  // of a processor

struct Arguments {
  std::string file, output, tolerance = "1%", unit = "mm", solid;
};

std::string counted(int n, const char* one, const char* many) {
  return std::to_string(n) + " " + (n == 1 ? one : many);
}

std::string describe(const CadSolid& solid) {
  return (solid.name.empty() ? "" : "'" + solid.name + "', ") + counted(solid.faces, "face", "faces") + ", " +
         format_box(solid.extent);
}

std::string list(const std::vector<CadSolid>& solids) {
  std::string out;
  for (size_t k = 0; k < solids.size() && k < 6; ++k)
    out += (k ? "; " : "") + std::to_string(k + 1) + ": " + describe(solids[k]);
  return out + (solids.size() > 6 ? "; .." : "");
}

const CadSolid& chosen(const Arguments& a, const std::vector<CadSolid>& solids) {
  const std::string count = std::to_string(solids.size());
  for (size_t k = 0; k < solids.size(); ++k)
    if (a.solid == std::to_string(k + 1)) return solids[k];
  if (!a.solid.empty())
    throw UsageError("import: --solid is " + a.solid + ", must be " +
                     (solids.size() == 1 ? "1, the only one of " + a.file : "1 to " + count));
  if (solids.size() > 1)
    throw ShapeError(a.file + ": has " + count + " solids (" + list(solids) + "): choose with --solid N");
  return solids[0];
}

// Writes the exact body; says why not where there is none that loads.
std::string take_exact(const Arguments& a, const CadSolid& solid) {
  if (!solid.exact) return solid.trimmed;
  std::vector<std::string> warnings;
  std::shared_ptr<const Shape> shape;
  try {  // twice: that patches of CAD files face either way is no news
    shape = make_shape(a.file, *solid.exact);
    shape = make_shape(a.file, shape->surfaces, std::nullopt, &warnings);
  } catch (const ShapeError& error) {
    const std::string why = error.what();
    return why.rfind(a.file + ": ", 0) == 0 ? why.substr(a.file.size() + 2) : why;
  }
  if (is_far(*shape)) {
    const Vec3 place = shape->mass.center;
    std::vector<NurbsSurface> surfaces = shape->surfaces;
    transform(surfaces, Mat3::Identity(), -place);
    put_in_place(a.file, *make_shape(a.file, surfaces), place, surfaces);
    shape = make_shape(a.output, surfaces);
  }
  write_whole(a.output, write_shape({shape->surfaces, std::nullopt}));
  print_warnings(warnings);
  std::printf("%s: exact, %zu patches, volume %.10g, bounding radius %.6g\n", a.output.c_str(),
              shape->surfaces.size(), shape->mass.volume, shape->bounding_radius);
  return "";
}

// From now on this process may use so many more seconds of a processor; none given: as many as it likes.
void limit_time(std::optional<double> seconds) {
  rusage used{};
  getrusage(RUSAGE_SELF, &used);
  rlimit limit{};
  getrlimit(RLIMIT_CPU, &limit);
  limit.rlim_cur = limit.rlim_max;
  if (seconds)
    limit.rlim_cur = std::min(
        limit.rlim_max, static_cast<rlim_t>(static_cast<double>(used.ru_utime.tv_sec) + std::ceil(*seconds)));
  setrlimit(RLIMIT_CPU, &limit);
}

// Open CASCADE dies or runs on for ever on some damaged files. Goes on in a child process; the parent waits,
// ends as the child does, and where that was killed throws ShapeError.
void continue_in_child(const std::string& file) {
  std::fflush(nullptr);
  const pid_t child = fork();
  if (child < 0) throw std::runtime_error("import: can't start a process");
  if (child == 0) {
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    const rlimit no_core{0, 0};
    setrlimit(RLIMIT_CORE, &no_core);
    return;
  }
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  if (WIFEXITED(status)) std::_Exit(WEXITSTATUS(status));
  throw ShapeError(file + (WTERMSIG(status) == SIGXCPU
                               ? ": is damaged or too large: Open CASCADE takes too long over it"
                               : ": is damaged: Open CASCADE fails on it with signal " +
                                     std::to_string(WTERMSIG(status))));
}

std::vector<CadSolid> read_in_time(const std::string& file, double scale) {
  std::error_code error;
  const auto bytes = std::filesystem::file_size(file, error);
  limit_time(kSecondsToRead + (error ? 0 : kSecondsPerMegabyte * 1e-6 * static_cast<double>(bytes)));
  std::vector<CadSolid> solids = read_cad_file(file, scale);
  limit_time(std::nullopt);
  return solids;
}

void import(const Arguments& a) {
  check_output("import", a.file, a.output);
  const double tolerance = fit_tolerance("import", a.tolerance);
  const double unit = parse_unit("import", a.unit);
  continue_in_child(a.file);
  const std::vector<CadSolid> solids = read_in_time(a.file, 1 / unit);
  const CadSolid& solid = chosen(a, solids);
  if (!(solid.extent.maxCoeff() > 0 && std::isfinite(solid.extent.norm())))
    throw ShapeError(a.file + ": the solid has no finite extent");
  const bool is_name = std::isalpha(static_cast<unsigned char>(a.unit[0])) != 0;
  std::printf("%s: solid of %s in %s; the file %s\n", a.file.c_str(), describe(solid).c_str(),
              (is_name ? a.unit : "units of " + a.unit + " mm").c_str(),
              solid.unit.empty() ? "names no unit" : ("is in " + solid.unit).c_str());
  if (solid.cavities > 0)
    print_warnings(
        {a.file + ": " + counted(solid.cavities, "cavity inside is", "cavities inside are") + " left out"});
  if (solid.beside > 0)
    print_warnings(
        {a.file + ": " +
         counted(solid.beside, "face that belongs to no solid is", "faces that belong to no solid are") +
         " left out"});
  FitArguments f;
  f.inexact = take_exact(a, solid);
  if (f.inexact.empty()) return;
  f.file = a.file;
  f.output = a.output;
  f.tolerance = a.tolerance;
  f.sag = kSagShare * tolerance;
  const double deflection = f.sag * 0.5 * solid.extent.maxCoeff();  // half the extent is below the radius
  TriangleMesh mesh;
  try {
    limit_time(kSecondsToMesh);
    mesh = solid.tessellate(deflection);
    limit_time(std::nullopt);
  } catch (const ShapeError& error) {
    throw ShapeError(a.file + ": " + error.what());
  }
  fit_mesh(f, mesh);
  std::printf("the triangles' corners lie on the solid, their insides within %.3g %% of the radius\n",
              100 * f.sag);
}

constexpr char kNotes[] =
    "Faces whose outline is a rectangle of their parameters (whole spheres, cylinders, splines, fillets) and "
    "plane "
    "faces\n"
    "between them become patches exactly. A solid with other faces, or with dents, gets the body that `fit` "
    "finds "
    "for its\n"
    "triangles, with the distance printed. Lengths are the file's in millimetres (BREP has no unit: as they "
    "are) over\n"
    "those of --unit.\n"
    "Example: nurbs-shape import part.step --unit m -o part.json    for a deck in SI units\n";

}  // namespace

Command add_import(CLI::App& app) {
  CLI::App* command = app.add_subcommand("import", "takes a solid from a CAD file (STEP, IGES, BREP)");
  command->formatter(
      std::make_shared<Help>("nurbs-shape import FILE.step|stp|iges|igs|brep [options] -o FILE"));
  command->footer(kNotes);
  const auto a = std::make_shared<Arguments>();
  command->add_option("FILE", a->file, "CAD file")->required();
  command->add_option("-o", a->output, "shape file to write")->type_name("FILE")->required();
  command->add_option("--tolerance", a->tolerance, "of a fit, where one is needed, as 2% or 0.02, default 1%")
      ->type_name("T");
  command
      ->add_option("--unit", a->unit,
                   "the shape file's unit of length: um, mm, cm, m, in or a number of mm; default mm")
      ->type_name("U");
  command->add_option("--solid", a->solid, "of a file with several: its number")->type_name("N");
  return {command, [a] { import(*a); }};
}

}  // namespace nurbs

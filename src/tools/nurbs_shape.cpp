// nurbs-shape: makes, describes and checks shape files.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "body/mass_properties.h"
#include "body/proofs.h"
#include "body/shape.h"
#include "body/support.h"
#include "io/mesh_file.h"
#include "io/shape_file.h"
#include "nurbs/affine.h"
#include "nurbs/gauss_rule.h"
#include "shapes/primitives.h"
#include "shapes/random_pebble.h"
#include "shapes/revolved.h"
#include "shapes/rounded_polyhedron.h"
#include "shapes/superellipsoid.h"
#include "tools/command.h"
#include "tools/contact_cost.h"
#include "tools/fit_command.h"

namespace {

using namespace nurbs;
using Surfaces = std::vector<NurbsSurface>;

constexpr char kExamples[] =
    "Examples:\n"
    "  nurbs-shape make ellipsoid --axes 0.012,0.008,0.006 -o ellipsoid.json\n"
    "  nurbs-shape make superellipsoid --axes 1,1,2 --exponent 4 --tolerance 0.1% -o blocky.json\n"
    "  nurbs-shape make inertia --inertia 1.0,0.9,0.8,-0.04,0.02,0.09 --mass 2 stone.json\n"
    "  nurbs-shape fit grain.stl --tolerance 2% -o grain.json\n"
    "  nurbs-shape import part.step --unit m -o part.json\n"
    "  nurbs-shape info ellipsoid.json\n"
    "  nurbs-shape check ellipsoid.json\n";

constexpr char kInertiaNotes[] =
    "XY is the tensor's element, -sum of m x y. With --mass, shape and size are fixed and the density "
    "follows and\n"
    "is printed; with --density the mass follows; with both the mass is met and the density must agree to "
    "0.1 %.";

constexpr double kNoDent = 1e-12;  // of the bounding radius: shallower, contacts cost as without

// --- Options
// -------------------------------------------------------------------------------------------------

struct Argument {
  const char *name, *value, *about;
  bool needed = false;  // its usage line names it
};

std::string usage(const std::string& kind, const std::vector<Argument>& options) {
  std::string line = "nurbs-shape make " + kind;
  bool more = false;
  for (const Argument& a : options) {
    if (a.needed) line += std::string(" ") + a.name + " " + a.value;
    more |= !a.needed;
  }
  return line + (more ? " [options]" : "") + " -o FILE";
}

// The arguments of one kind of body, each used at most once and none unknown.
class Options {
 public:
  Options(CLI::App* command, const std::vector<Argument>& allowed) : command_(command) {
    command->allow_extras();
    for (const Argument& a : allowed) add(a.name, a.value, a.about);
    file_ = add("-o,FILE", "FILE", "shape file to write; with or without -o");
  }

  // What CLI11 leaves over or can't judge; throws UsageError.
  void check() const {
    for (const std::string& left : command_->remaining())
      if (is_option(left))
        fail("unknown option " + left.substr(0, left.find('=')) + "; allowed are " + allowed());
    const std::vector<std::string> files = plain_and_output();
    for (const std::string& file : files) {
      if (!is_number_like(file)) continue;
      fail(option_before_file() + " takes its numbers with commas and no blanks, as 1,2,3, and " + file +
           " follows after a blank");
    }
    for (const CLI::Option* option : command_->get_options()) {
      if (option == file_ || option->count() == 0) continue;
      if (option->count() > 1) fail(option->get_name() + " is given twice");
      if (is_option(option->results()[0])) fail(option->get_name() + " needs a value");
    }
    if (files.size() > 1) fail("the output file is given twice: " + files[0] + " and " + files[1]);
    if (files.empty() || files[0].empty()) fail("no output file: add -o FILE");
  }

  std::string output() const { return file_->results()[0]; }

  // Numbers separated by commas, all in [lo, hi].
  std::vector<double> numbers(const std::string& name, size_t count, double lo, double hi) const {
    if (!has(name)) fail(name + " is missing");
    const std::string& text = command_->get_option(name)->results()[0];
    std::vector<double> out;
    for (size_t begin = 0; begin <= text.size();) {
      const size_t end = std::min(text.find(',', begin), text.size());
      out.push_back(number(name, text.substr(begin, end - begin), lo, hi));
      begin = end + 1;
    }
    if (out.size() != count) {
      fail(name + " has " + std::to_string(out.size()) + " numbers, must have " + std::to_string(count) +
           " separated by commas");
    }
    return out;
  }

  // One or more numbers.
  std::vector<double> numbers_up_to(const std::string& name, size_t most, double lo, double hi) const {
    const std::string& text = command_->get_option(name)->results()[0];
    const size_t count = static_cast<size_t>(std::count(text.begin(), text.end(), ',')) + 1;
    return numbers(name, std::min(count, most), lo, hi);
  }

  double number(const std::string& name, double otherwise, double lo, double hi) const {
    return has(name) ? numbers(name, 1, lo, hi)[0] : otherwise;
  }

  double positive(const std::string& name) const { return numbers(name, 1, kLeast, kMost)[0]; }
  double positive(const std::string& name, double otherwise) const {
    return has(name) ? positive(name) : otherwise;
  }

  // The value as given.
  std::string text(const std::string& name) const {
    if (!has(name)) fail(name + " is missing");
    return command_->get_option(name)->results()[0];
  }

  double length(const std::string& name) const { return numbers(name, 1, kLeastLength, kMostLength)[0]; }
  double length(const std::string& name, double otherwise) const {
    return has(name) ? length(name) : otherwise;
  }

  Vec3 axes() const {
    const std::vector<double> a = numbers("--axes", 3, kLeastLength, kMostLength);
    return {a[0], a[1], a[2]};
  }

  int spans(int otherwise) const {
    const double n = number("--spans", otherwise, 1, 12);
    if (n != std::floor(n)) fail("--spans must be a whole number in 1..12");
    return static_cast<int>(n);
  }

  bool has(const std::string& name) const { return command_->count(name) > 0; }

  [[noreturn]] void fail(const std::string& what) const {
    throw UsageError("make " + command_->get_name() + ": " + what);
  }

  static constexpr double kLeast = 1e-150, kMost = 1e150;
  static constexpr double kLeastLength = 1e-29, kMostLength = 1e29;  // a shape file's extents: 1e-30 to 1e30

 private:
  static bool is_number_like(const std::string& text) {
    return text.find_first_of("0123456789") != std::string::npos &&
           text.find_first_not_of("0123456789.,+-eE") == std::string::npos;
  }
  static bool is_option(const std::string& text) {
    return text.size() > 1 && text[0] == '-' && !is_number_like(text);
  }

  CLI::Option* add(const char* names, const char* value, const char* about) {
    return command_
        ->add_option(
            names, [](const CLI::results_t&) { return true; }, about)
        ->type_name(value)
        ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  }

  std::string allowed() const {
    std::string list;
    for (const CLI::Option* option : command_->get_options())
      if (option != command_->get_help_ptr() && option != file_) list += option->get_name() + " ";
    return list + "-o";
  }

  std::vector<std::string> plain_and_output() const {
    std::vector<std::string> files = file_->results();
    for (const std::string& left : command_->remaining()) files.push_back(left);
    return files;
  }

  std::string option_before_file() const {
    std::string name = file_->get_name();
    for (const CLI::Option* option : command_->parse_order()) {
      if (option == file_) break;
      name = option->get_name();
    }
    return name;
  }

  double number(const std::string& name, const std::string& text, double lo, double hi) const {
    double value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size())
      fail(name + " '" + text + "' is not a number");
    if (!(value >= lo && value <= hi)) {
      const bool any_positive = lo == kLeast || lo == kLeastLength;
      fail(name + " is " + text + ", must be " +
           (any_positive && value <= 0 ? "> 0" : "in " + format("%g", lo) + ".." + format("%g", hi)));
    }
    return value;
  }

  CLI::App* command_;
  CLI::Option* file_;
};

// --- make
// ----------------------------------------------------------------------------------------------------

struct Body {
  Surfaces surfaces;
  std::string note;  // what the maker has to say about it
};

std::string fit_note(double error) {
  return "largest distance from the exact surface " + format("%.3g", error);
}

Body make_sphere(const Options& options) {
  return {exact_ellipsoid(Vec3::Constant(options.length("--radius", 1))), ""};
}

Body make_ellipsoid(const Options& options) {
  return {exact_ellipsoid(options.axes()), ""};
}

Body make_box(const Options& options) {
  return {box(options.axes()), ""};
}

Body make_revolved(const Options& options) {
  const double equatorial = options.length("--equatorial"), polar = options.length("--polar");
  return {revolved_ellipsoid(equatorial, polar), ""};
}

Body make_fitted(const Options& options) {
  double error = 0;
  const Vec3 axes = options.axes();
  Surfaces surfaces = fitted_ellipsoid(axes, options.spans(1), &error);
  return {std::move(surfaces), fit_note(error)};
}

Body make_smooth(const Options& options) {
  double error = 0;
  Surfaces surfaces = smooth_ellipsoid(options.axes(), &error);
  return {std::move(surfaces), fit_note(error)};
}

constexpr double kFinestSuperellipsoid = 1e-4;

Body make_superellipsoid(const Options& options) {
  const Vec3 axes = options.axes();
  const double exponent = options.numbers("--exponent", 1, 2, 12)[0];
  if (options.has("--spans")) {
    if (options.has("--tolerance")) options.fail("--spans and --tolerance exclude each other");
    double error = 0;
    Surfaces surfaces = fitted_superellipsoid(axes, exponent, options.spans(3), &error);
    return {std::move(surfaces), fit_note(error)};
  }
  const std::string text = options.has("--tolerance") ? options.text("--tolerance") : "0.2%";
  const double tolerance = parse_share("make superellipsoid: --tolerance", text, 0.05);
  if (tolerance < kFinestSuperellipsoid) options.fail("--tolerance is " + text + ", must be 0.01% at least");
  Superellipsoid body = convex_superellipsoid(axes, exponent, tolerance);
  return {std::move(body.surfaces), fit_note(body.error)};
}

// A share in [lo, 1], or a range of them "LO,HI".
std::array<double, 2> range(const Options& options, const std::string& name, double otherwise, double lo) {
  if (!options.has(name)) return {otherwise, otherwise};
  const std::vector<double> x = options.numbers_up_to(name, 2, lo, 1);
  if (x.front() > x.back())
    options.fail(name + " runs from " + format("%g", x.front()) + " down to " + format("%g", x.back()));
  return {x.front(), x.back()};
}

std::uint64_t whole(const Options& options, const std::string& name, double otherwise, double lo, double hi) {
  const double n = options.number(name, otherwise, lo, hi);
  if (n != std::floor(n)) options.fail(name + " must be a whole number");
  return static_cast<std::uint64_t>(n);
}

constexpr double kMostSeed = 9e15;

Body make_pebble(const Options& options) {
  const double radius = options.length("--radius", 1);
  if (options.has("--seed")) {
    PebbleForm form;
    form.radius = radius;
    form.roundness = options.number("--roundness", form.roundness, 0, 1);
    form.elongation = options.number("--elongation", form.elongation, 0.2, 1);
    form.flatness = options.number("--flatness", form.flatness, 0.2, 1);
    return {random_pebble(whole(options, "--seed", 1, 0, kMostSeed), form), ""};
  }
  for (const char* name : {"--roundness", "--elongation", "--flatness"})
    if (options.has(name)) options.fail(std::string(name) + " is for random pebbles: add --seed");
  Surfaces surfaces = pebble();
  transform(surfaces, radius * Mat3::Identity(), Vec3::Zero());
  return {std::move(surfaces), ""};
}

// The surfaces turned outward, as the loader turns them.
Body outward(const Options& options, Surfaces surfaces) {
  return {make_shape(options.output(), std::move(surfaces))->surfaces, ""};
}

Body make_capsule(const Options& options) {
  const double radius = options.length("--radius");
  return {capsule(radius, options.length("--length")), ""};
}

// The rim's rounding, which must leave some of the body.
double rim_below(const Options& options, double radius) {
  const double rim = options.length("--rim");
  if (!(rim < radius))
    options.fail("--rim is " + format("%g", rim) + ", must be less than --radius, " + format("%g", radius));
  return rim;
}

// The radius of domes, of a half sphere at the least.
double cap_from(const Options& options, double radius) {
  const double cap = options.length("--cap");
  if (!(cap >= radius))
    options.fail("--cap is " + format("%g", cap) + ", must be --radius, " + format("%g", radius) +
                 ", at least");
  return cap;
}

Body make_tablet(const Options& options) {
  const double radius = options.length("--radius"), rim = rim_below(options, radius);
  if (!options.has("--cap")) {
    const double height = options.length("--height");
    if (!(rim <= 0.5 * height))
      options.fail("--rim is " + format("%g", rim) + ", must be at most half of --height, " +
                   format("%g", 0.5 * height));
    return {tablet(radius, height, rim), ""};
  }
  const double band = options.numbers("--height", 1, 0, Options::kMostLength)[0];
  return {biconvex_tablet(radius, band, cap_from(options, radius), rim), ""};
}

Body make_lens(const Options& options) {
  const double radius = options.length("--radius"), cap = cap_from(options, radius);
  return {lens(radius, cap, rim_below(options, radius)), ""};
}

Body make_egg(const Options& options) {
  const double radius = options.length("--radius"), blunt = options.length("--blunt");
  return {egg(radius, blunt, options.length("--pointed")), ""};
}

Body make_rounded_box(const Options& options) {
  const Vec3 axes = options.axes();
  const double rounding = options.length("--rounding");
  if (rounding > axes.minCoeff())
    options.fail("--rounding is " + format("%g", rounding) + ", must be at most the least half edge, " +
                 format("%g", axes.minCoeff()));
  return outward(options, rounded_box(axes, rounding));
}

constexpr int kMostFacets = 300;

Body make_rounded_polyhedron(const Options& options) {
  if (options.has("--solid") == options.has("--mesh"))
    options.fail("one of --solid and --mesh says which polyhedron");
  const double rounding = options.length("--rounding");
  if (options.has("--solid")) {
    const double radius = options.length("--radius", 1);
    const std::vector<HalfSpace> faces = platonic_solid(options.text("--solid"), radius);
    if (faces.empty())
      options.fail("--solid is " + options.text("--solid") +
                   ", must be tetrahedron, cube, octahedron, dodecahedron or icosahedron");
    if (rounding >= faces[0].offset)
      options.fail("--rounding is " + format("%g", rounding) + ", must be below the inner radius, " +
                   format("%.6g", faces[0].offset));
    return outward(options, rounded_polyhedron(faces, Vec3::Zero(), rounding));
  }
  if (options.has("--radius")) options.fail("--radius is for --solid: a mesh has its own size");
  const std::string file = options.text("--mesh");
  check_output("make rounded-polyhedron", file, options.output());
  try {
    std::vector<Vec3> points = read_mesh_file(file).points;
    const Vec3 place = move_to_origin(points);
    const ConvexHull hull(points);
    const std::vector<HalfSpace> faces = facets(hull, kMostFacets);
    if (faces.empty())
      throw ShapeError("its hull has more than " + std::to_string(kMostFacets) + " faces: use fit");
    std::vector<NurbsSurface> surfaces = rounded_polyhedron(faces, hull.properties().center, rounding);
    put_in_place(file, *make_shape(file, surfaces), place, surfaces);
    return outward(options, std::move(surfaces));
  } catch (const ShapeError& error) {
    const std::string what = error.what();
    throw ShapeError(what.rfind(file, 0) == 0 ? what : file + ": " + what);
  }
}

Body make_inertia(const Options& options) {
  const std::vector<double> j = options.numbers("--inertia", 6, -Options::kMost, Options::kMost);
  Mat3 inertia;
  inertia << j[0], j[3], j[4], j[3], j[1], j[5], j[4], j[5], j[2];
  const bool has_mass = options.has("--mass"), has_density = options.has("--density");
  if (!has_mass && !has_density) options.fail("--mass or --density is missing");
  const double wanted_mass = options.positive("--mass", 1), wanted_density = options.positive("--density", 1);
  Body body{ellipsoid_with_gyration(inertia / wanted_mass), ""};
  double volume = solid_properties(body.surfaces).volume, mass = wanted_mass;
  if (!has_mass) {  // scaling by s takes the inertia at fixed density along as s^5
    const double scale = std::pow(wanted_mass / (volume * wanted_density), 0.2);
    transform(body.surfaces, scale * Mat3::Identity(), Vec3::Zero());
    volume *= scale * scale * scale;
    mass = wanted_density * volume;
  }
  const double density = mass / volume;
  if (has_density && std::abs(density / wanted_density - 1) > 1e-3) {
    options.fail("--density is " + format("%g", wanted_density) + ", must be within 0.1 % of " +
                 format("%.6g", density) + " for a near-ellipsoid of this mass and inertia");
  }
  body.note =
      "mass " + format("%.10g", mass) + " and the given inertia at density " + format("%.10g", density);
  return body;
}

struct Maker {
  const char *kind, *about;
  std::vector<Argument> options;
  Body (*make)(const Options&);
  const char* example;  // options of one
  const char* notes = "";
};

const std::vector<Maker>& makers() {
  static const Argument kRadius{"--radius", "R", "default 1, which is 1 m in a deck of SI units"},
      kAxes{"--axes", "A,B,C", "semi-axes", true},
      kSpans{"--spans", "N", "of a patch in each direction, 1 to 12, default 1: more fit better"};
  static const Argument kOuter{"--radius", "R", "of the body, across its axis", true},
      kRim{"--rim", "R", "radius of the rim's rounding", true};
  static const std::vector<Maker> kMakers = {
      {"sphere", "exact, six biquartic rational patches", {kRadius}, make_sphere, "--radius 0.005"},
      {"ellipsoid",
       "exact, six biquartic rational patches",
       {kAxes},
       make_ellipsoid,
       "--axes 0.012,0.008,0.006"},
      {"fitted-ellipsoid",
       "six bicubic patches, joints nearly smooth",
       {kAxes, kSpans},
       make_fitted,
       "--axes 0.012,0.008,0.006 --spans 2"},
      {"smooth-ellipsoid",
       "six bicubic patches, joints smooth",
       {kAxes},
       make_smooth,
       "--axes 0.012,0.008,0.006"},
      {"pebble",
       "asymmetric, six bicubic patches, joints smooth; with --seed a random one",
       {kRadius,
        {"--seed", "N", "whole number: its own pebble for each; --radius is that of the same volume"},
        {"--roundness", "R", "0 to 1, default 0.5: 1 is an ellipsoid, less more angular"},
        {"--elongation", "E", "second over first axis, 0.2 to 1, default 0.8"},
        {"--flatness", "F", "third over second axis, 0.2 to 1, default 0.7"}},
       make_pebble,
       "--seed 7 --radius 0.005 --roundness 0.6 --elongation 0.8 --flatness 0.6"},
      {"capsule",
       "exact: cylinder with half spheres, axis z",
       {kOuter, {"--length", "L", "of the cylinder", true}},
       make_capsule,
       "--radius 0.003 --length 0.01"},
      {"tablet",
       "exact: cylinder with rounded rims, axis z; biconvex with --cap, the radius of its domes",
       {kOuter,
        {"--height", "H",
         "of the whole tablet from face to face; with --cap of its cylindrical band alone, 0 for none", true},
        kRim,
        {"--cap", "C", "makes both faces domes, of this radius of curvature, at least that of the tablet"}},
       make_tablet,
       "--radius 0.004 --height 0.003 --rim 0.0005"},
      {"lens",
       "exact: two spherical caps with a rounded rim, axis z",
       {kOuter, {"--cap", "C", "radius of the caps", true}, kRim},
       make_lens,
       "--radius 0.005 --cap 0.008 --rim 0.0003"},
      {"egg",
       "exact: halves of two ellipsoids of revolution, axis z",
       {kOuter, {"--blunt", "A", "height of the blunt half", true}, {"--pointed", "B", "of the other", true}},
       make_egg,
       "--radius 0.004 --blunt 0.004 --pointed 0.006"},
      {"rounded-box",
       "exact: flat faces, edges of cylinders, corners of spheres",
       {{"--axes", "A,B,C", "half edges", true}, {"--rounding", "R", "radius of edges and corners", true}},
       make_rounded_box,
       "--axes 0.01,0.008,0.006 --rounding 0.001"},
      {"rounded-polyhedron",
       "exact: flat faces, edges of cylinders, corners of spheres",
       {{"--solid", "NAME", "tetrahedron, cube, octahedron, dodecahedron or icosahedron"},
        {"--radius", "R", "of the sharp solid's corners, default 1"},
        {"--mesh", "FILE", "instead of --solid: the convex hull of a mesh (STL, OBJ, PLY)"},
        {"--rounding", "R", "radius of edges and corners; faces stay where they are", true}},
       make_rounded_polyhedron,
       "--solid octahedron --radius 0.01 --rounding 0.001"},
      {"superellipsoid",
       "|x/A|^E + |y/B|^E + |z/C|^E = 1, fitted: strictly convex, joints smooth",
       {kAxes,
        {"--exponent", "E", "2 to 12", true},
        {"--tolerance", "T",
         "share of the largest semi-axis, as 0.2%, the default: flat faces bulge by up to this"},
        {"--spans", "N",
         "instead, 1 to 12: bicubic, of N x N spans a patch, faces flat and slightly dented, joints kinked"}},
       make_superellipsoid,
       "--axes 1,1,2 --exponent 4 --tolerance 0.1%"},
      {"revolved",
       "exact ellipsoid, one rational patch, axis z",
       {{"--equatorial", "A", "semi-axis", true}, {"--polar", "C", "semi-axis", true}},
       make_revolved,
       "--equatorial 0.01 --polar 0.005"},
      {"box",
       "six flat faces",
       {{"--axes", "A,B,C", "half edges", true}},
       make_box,
       "--axes 0.01,0.008,0.006"},
      {"inertia",
       "near-ellipsoid of six bicubic patches with this inertia tensor about its centre of mass, the origin",
       {{"--inertia", "XX,YY,ZZ,XY,XZ,YZ", "of the solid, about its centre of mass", true},
        {"--mass", "M", "this, or --density, or both"},
        {"--density", "D", "of the uniform solid"}},
       make_inertia,
       "--inertia 1.0,0.9,0.8,-0.04,0.02,0.09 --mass 2",
       kInertiaNotes},
  };
  return kMakers;
}

// The host wants primes above 10000 for seeds.
int next_prime(int n) {
  for (;;) {
    ++n;
    bool prime = n > 2 && n % 2 == 1;
    for (int d = 3; prime && d * d <= n; d += 2) prime = n % d != 0;
    if (prime) return n;
  }
}

// Many random pebbles, and a deck that inserts them.
const std::vector<Argument> kPebblesOptions = {
    {"--count", "N", "1 to 100000", true},
    {"--seed", "N", "whole number, default 1"},
    {"--radius", "R", "of the sphere of the same volume, default 1, which is 1 m in a deck of SI units"},
    {"--roundness", "LO,HI", "drawn from this range, or one number; default 0.3,0.8"},
    {"--elongation", "LO,HI", "default 0.6,1"},
    {"--flatness", "LO,HI", "default 0.5,1"}};
constexpr char kPebblesNotes[] =
    "Writes FILE_1.json .. FILE_N.json and FILE.deck, whose lines (atom_style, particletemplate, a "
    "distribution of equal\n"
    "shares) go into a deck; a .json at the end of FILE is left out.";

void make_pebbles(const Options& options) {
  options.check();
  std::string stem = options.output();
  if (stem.size() > 5 && stem.substr(stem.size() - 5) == ".json") stem.resize(stem.size() - 5);
  const std::string name = std::filesystem::path(stem).filename().string();
  if (name.find_first_of(" \t\n$#&*\"'") != std::string::npos)
    throw UsageError("make pebbles: -o " + stem +
                     ": a deck can't name such files; no blanks, quotes nor any of $ # & *");
  std::string id = name;  // of fixes: the host takes letters, digits and underscores
  for (char& c : id)
    if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
  options.numbers("--count", 1, 1, 100000);
  const std::uint64_t count = whole(options, "--count", 1, 1, 100000),
                      seed = whole(options, "--seed", 1, 0, kMostSeed);
  const double radius = options.length("--radius", 1);
  const auto both = [](double lo, double hi) { return std::array{lo, hi}; };
  const auto roundness = options.has("--roundness") ? range(options, "--roundness", 0, 0) : both(0.3, 0.8);
  const auto elongation = options.has("--elongation") ? range(options, "--elongation", 0, 0.2) : both(0.6, 1);
  const auto flatness = options.has("--flatness") ? range(options, "--flatness", 0, 0.2) : both(0.5, 1);
  std::vector<std::string> files;
  int prime = 100000;
  std::string style = "atom_style nurbs", templates, distribution;
  for (std::uint64_t k = 0; k < count; ++k) {
    const auto draw = [&](const std::array<double, 2>& r, double step) {  // a lattice of low discrepancy
      return r[0] + (r[1] - r[0]) * std::fmod(0.5 + step * static_cast<double>(k + 1 + seed % 100003), 1.0);
    };
    const PebbleForm form{draw(roundness, 0.8191725133961645), draw(elongation, 0.6710436067037893),
                          draw(flatness, 0.5497004779019703), radius};
    files.push_back(write_shape({random_pebble(seed * 1000003 + k, form), std::nullopt}));
    const std::string number = std::to_string(k + 1);
    style += " &\n  " + name + "_" + number + ".json";
    templates += "fix " + id + "_" + number + " all particletemplate/nurbs " +
                 std::to_string(prime = next_prime(prime)) + " atom_type 1 density constant 2500 shape " +
                 name + "_" + number + " scale constant 1\n";
    distribution += " &\n  " + id + "_" + number + " " + format("%.9g", 1 / static_cast<double>(count));
  }
  for (std::uint64_t k = 0; k < count; ++k)
    write_whole(stem + "_" + std::to_string(k + 1) + ".json", files[k]);
  write_whole(stem + ".deck", style + "\n\n" + templates + "fix " + id +
                                  " all particledistribution/discrete 15485863 " + std::to_string(count) +
                                  distribution + "\n");
  std::printf("%s_1.json to %s_%llu.json, %s.deck; radius %g%s\n", stem.c_str(), stem.c_str(),
              static_cast<unsigned long long>(count), stem.c_str(), radius,
              options.has("--radius") ? "" : " (the default: 1 m in a deck of SI units; see --radius)");
}

void make(const Maker& maker, const Options& options) {
  options.check();
  const std::string file = options.output();
  check_output("make " + std::string(maker.kind), "", file);
  Body body = maker.make(options);
  std::vector<std::string> warnings;
  const auto shape = make_shape(file, body.surfaces, std::nullopt, &warnings);
  write_whole(file, write_shape({std::move(body.surfaces), std::nullopt}));
  print_warnings(warnings);
  std::printf("%s: %zu patches, volume %.10g, bounding radius %.6g\n", file.c_str(), shape->surfaces.size(),
              shape->mass.volume, shape->bounding_radius);
  if (!body.note.empty()) std::printf("%s\n", body.note.c_str());
}

// --- info, check
// ---------------------------------------------------------------------------------------------

size_t memory(const Shape& shape) {
  size_t bytes = sizeof shape;
  for (const NurbsSurface& s : shape.surfaces) {
    bytes +=
        sizeof s + sizeof(Vec4) * s.points.size() + sizeof(double) * (s.knots_u.size() + s.knots_v.size());
  }
  for (const BezierPatch& p : shape.patches) bytes += sizeof p + sizeof(Vec4) * p.points.size();
  // The inner map comes with the first deep overlap.
  const size_t atlas_node = sizeof(double) + sizeof(Vec3) + sizeof(SurfacePoint);
  bytes += sizeof(float) * shape.normal_map.radius.size();
  return bytes + sizeof(shape.links[0]) * shape.links.size() + atlas_node * shape.atlas.support.size();
}

struct Kinks {
  double opening = 0, closing = 0;  // degrees
};

Kinks worst_kinks(const Shape& shape) {
  Kinks worst;
  for (const auto& edges : shape.links) {
    for (const EdgeLink& link : edges) {
      worst.opening = std::max(worst.opening, link.kink * 180 / M_PI);
      worst.closing = std::max(worst.closing, -link.kink * 180 / M_PI);
    }
  }
  return worst;
}

// "6 bicubic"-like: how many surfaces of which degrees, rational or not.
void print_surfaces(const Shape& shape) {
  std::map<std::string, int> kinds;
  for (const NurbsSurface& s : shape.surfaces) {
    const bool rational =
        std::any_of(s.points.begin(), s.points.end(), [&](const Vec4& p) { return p[3] != s.points[0][3]; });
    ++kinds["degree " + std::to_string(s.degree_u) + " x " + std::to_string(s.degree_v) + ", " +
            std::to_string(s.size_u) + " x " + std::to_string(s.size_v) + " control points, " +
            (rational ? "rational" : "polynomial")];
  }
  for (const auto& [kind, count] : kinds) std::printf("patches            %d of %s\n", count, kind.c_str());
  std::printf("Bezier patches     %zu\n", shape.patches.size());
}

void print_mass(const Shape& shape) {
  const MassProperties& m = shape.mass;
  const Mat3& g = shape.gyration;
  std::printf("volume             %.12g\n", m.volume);
  std::printf("centre of mass     %.12g %.12g %.12g\n", m.center[0], m.center[1], m.center[2]);
  std::printf("inertia / mass     xx %.12g yy %.12g zz %.12g\n", g(0, 0), g(1, 1), g(2, 2));
  std::printf("                   xy %.12g xz %.12g yz %.12g\n", g(0, 1), g(0, 2), g(1, 2));
  const Vec3& p = shape.principal_gyration;
  std::printf("  principal        %.12g %.12g %.12g\n", p[0], p[1], p[2]);
}

double surface_area(const Shape& shape) {  // by Gauss's rule of four points on a grid of cells
  constexpr int kGrid = 12;
  const GaussRule rule = gauss_rule(4);
  double area = 0;
  for (const BezierPatch& patch : shape.patches)
    for (int i = 0; i < 4 * kGrid; ++i)
      for (int j = 0; j < 4 * kGrid; ++j) {
        const Jet1 s =
            evaluate1(patch, (i / 4 + rule.nodes[i % 4]) / kGrid, (j / 4 + rule.nodes[j % 4]) / kGrid);
        area += s.su.cross(s.sv).norm() * rule.weights[i % 4] * rule.weights[j % 4] / (kGrid * kGrid);
      }
  return area;
}

// What the field describes grains by; axes are those of the ellipsoid with the same second moments.
void print_descriptors(const Shape& shape) {
  const double volume = shape.mass.volume, area = surface_area(shape),
               radius = std::cbrt(3 * volume / (4 * M_PI));
  const PrincipalFrame frame = principal_frame(shape.mass.inertia / volume);
  const Vec3& m = frame.moments;  // ascending: the first is about the longest axis
  const double half = 0.5 * m.sum();
  const Vec3 axes = (5 * (Vec3::Constant(half) - m)).cwiseMax(0).cwiseSqrt();
  const Mat3 turn = frame.axes.toRotationMatrix();
  std::printf("surface            %.6g\n", area);
  std::printf("equivalent radius  %.6g (sphere of the same volume)\n", radius);
  std::printf("sphericity         %.5g (surface of that sphere over the body's)\n",
              4 * M_PI * radius * radius / area);
  std::printf("semi-axes          %.6g %.6g %.6g (ellipsoid of the same moments)\n", axes[0], axes[1],
              axes[2]);
  std::printf("elongation I/L     %.5g\n", axes[1] / axes[0]);
  std::printf("flatness S/I       %.5g\n", axes[2] / axes[1]);
  for (int k = 0; k < 3; ++k)
    std::printf("  axis %d           %.6g %.6g %.6g\n", k + 1, turn(0, k), turn(1, k), turn(2, k));
}

// What contacts cost, and why.
void print_cost(const Shape& shape) {
  const ContactCost cost = measure_contact_cost(shape);
  std::printf("cost of a contact  %s\n", cost_class(cost).c_str());
  std::printf(
      "  of its like, here  %.0f ns a step at rest, %.0f ns turning (1 mrad a step), %.0f ns when it "
      "begins\n",
      cost.resting, cost.turning, cost.cold);
  if (cost.unresolved > 0)
    std::printf("  unresolved       %d of those that begin: an estimate serves\n", cost.unresolved);
  std::printf("kind               %s\n",
              shape.proofs.sphere     ? "sphere: contacts by a formula, nothing is searched"
              : shape.ellipsoid.found ? "ellipsoid: contacts by a formula, nothing is searched"
              : !shape.smooth         ? "with sharp edges: contacts that begin at one need a slower search"
              : shape.concavity > kUnmentionedDent * shape.bounding_radius
                  ? "dented: touches as its convex hull does, without the dents"
              : std::isinf(shape.patch_curvature.max_radius)
                  ? "smooth with flats: faces that lie on each other touch at up to eight points"
                  : "smooth, strictly convex: round everywhere, which makes contacts fastest");
}

void print_form(const Shape& shape) {
  const Kinks kinks = worst_kinks(shape);
  std::printf("bounding radius    %.12g (farthest point from the centre of mass)\n", shape.bounding_radius);
  std::printf("inner radius       %.12g (of a ball about the centre of mass that fits inside)\n",
              shape.inner_radius);
  std::printf("curvature radius   %.6g to %.6g inside the patches\n", shape.patch_curvature.min_radius,
              shape.patch_curvature.max_radius);
  std::printf("sharpest joint     %.3g degrees outward, %.3g inward%s\n", kinks.opening, kinks.closing,
              shape.smooth ? " (smooth: no edges)" : "");
  std::printf("deepest dent       %.3g (%.3g of the bounding radius)\n", shape.concavity,
              shape.concavity / shape.bounding_radius);
  std::printf("memory             %.1f kB, whatever the number of particles\n",
              static_cast<double>(memory(shape)) / 1024);
}

// Where the dents are what rounding the control points left.
void print_decimals(const Shape& shape, const char* label) {
  const int decimals = few_decimals(shape.surfaces);
  if (decimals == 0 || !(shape.concavity > kNoDent * shape.bounding_radius) ||
      shape.concavity > std::pow(10.0, -decimals))
    return;
  std::printf(
      "%sthe dents are what its %d decimals leave; with 11 or more straight sides are straight, and contacts "
      "along them cheaper\n",
      label, decimals);
}

void info(const std::string& file) {
  std::vector<std::string> warnings;
  const auto shape = read_shape_file(file, &warnings);
  print_warnings(warnings);
  std::printf("shape              %s\n", shape->name.c_str());
  print_surfaces(*shape);
  print_mass(*shape);
  print_form(*shape);
  print_descriptors(*shape);
  print_cost(*shape);
  print_decimals(*shape, "digits             ");
}

void check(const std::string& file) {
  std::vector<std::string> warnings;
  const auto shape = read_shape_file(file, &warnings);
  print_warnings(warnings);
  const Kinks kinks = worst_kinks(*shape);
  std::printf("%s: usable: closed, outward%s, %zu patches, sharpest joint %.3g degrees, deepest dent %.3g\n",
              file.c_str(), warnings.empty() ? ", convex" : "", shape->surfaces.size(),
              std::max(kinks.opening, kinks.closing), shape->concavity);
  for (const std::string& line : describe_proofs(*shape)) std::printf("  %s\n", line.c_str());
  print_decimals(*shape, "  ");
}

// Sub-command `make`, with one of its own for every kind of body.
CLI::App* add_make(CLI::App& app, std::vector<Options>& options) {
  CLI::App* command = app.add_subcommand("make", "makes a shape file");
  command->allow_extras();
  command->formatter(std::make_shared<Help>(
      "nurbs-shape make KIND [options] -o FILE\n       nurbs-shape make KIND [options] FILE"));
  for (const Maker& maker : makers()) {
    CLI::App* kind = command->add_subcommand(maker.kind, maker.about);
    kind->formatter(std::make_shared<Help>(usage(maker.kind, maker.options)));
    const std::string notes = maker.notes;
    kind->footer(notes + (notes.empty() ? "" : "\n") + "Example: nurbs-shape make " + maker.kind + " " +
                 maker.example + " -o " + maker.kind + ".json\n");
    options.emplace_back(kind, maker.options);
  }
  CLI::App* pebbles =
      command->add_subcommand("pebbles", "many random pebbles, as one distribution for a deck");
  pebbles->formatter(std::make_shared<Help>(usage("pebbles", kPebblesOptions)));
  pebbles->footer(std::string(kPebblesNotes) +
                  "\nExample: nurbs-shape make pebbles --count 20 --seed 3 --roundness 0.4,0.7 -o gravel\n");
  options.emplace_back(pebbles, kPebblesOptions);
  return command;
}

void run(CLI::App& app, int argc, char** argv) {
  app.formatter(std::make_shared<Help>("nurbs-shape COMMAND .."));
  app.footer(kExamples);
  std::vector<Options> options;  // of makers(), in order
  const CLI::App* maker = add_make(app, options);
  std::string file;
  const auto add_reader = [&](const std::string& name, const std::string& about) {
    CLI::App* command = app.add_subcommand(name, about);
    command->formatter(std::make_shared<Help>("nurbs-shape " + name + " FILE"));
    command->add_option("FILE", file, "shape file")->required();
    command->footer("Example: nurbs-shape " + name + " grain.json\n");
    return command;
  };
  const CLI::App* describer = add_reader("info", "describes a shape");
  const CLI::App* checker =
      add_reader("check", "exits with 0 if the file is a usable shape, 1 with the reason if not");
  const Command commands[] = {add_fit(app), add_simplify(app), add_import(app), add_export(app),
                              add_view(app)};
  app.parse(argc, argv);

  for (const Command& command : commands)
    if (command.parser->parsed()) return command.run();

  if (describer->parsed()) return info(file);
  if (checker->parsed()) return check(file);
  if (!maker->parsed()) throw UsageError("no command; see nurbs-shape --help");
  for (size_t k = 0; k < makers().size(); ++k)
    if (maker->got_subcommand(makers()[k].kind)) return make(makers()[k], options[k]);
  if (maker->got_subcommand("pebbles")) return make_pebbles(options.back());
  const std::vector<std::string> left = maker->remaining();
  throw UsageError("make: " + (left.empty() ? "no kind" : "unknown kind '" + left[0] + "'") +
                   "; see nurbs-shape make --help");
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("makes, describes and checks shape files", "nurbs-shape");
  try {
    run(app, argc, argv);
    return 0;
  } catch (const CLI::CallForHelp&) {
    std::fputs(app.help().c_str(), stdout);
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "ERROR: %s\n", error.what());
    return 1;
  }
}

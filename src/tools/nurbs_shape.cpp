// nurbs-shape: makes, describes and checks shape files.
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <exception>
#include <fstream>
#include <functional>
#include <map>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "body/shape.h"
#include "io/shape_file.h"
#include "nurbs/affine.h"
#include "shapes/primitives.h"

namespace {

using namespace nurbs;
using Surfaces = std::vector<NurbsSurface>;

constexpr char kUsage[] =
    "usage: nurbs-shape make KIND [options] -o FILE   make a shape file; FILE alone, without -o, does too\n"
    "       nurbs-shape info FILE                     describe a shape\n"
    "       nurbs-shape check FILE                    exit 0 if FILE is a usable shape, 1 with the reason if "
    "not\n"
    "       nurbs-shape [COMMAND] --help\n";

constexpr char kMakeUsage[] =
    "usage: nurbs-shape make KIND [options] -o FILE\n"
    "       nurbs-shape make KIND [options] FILE\n"
    "\n"
    "  sphere            [--radius R]                            exact, six biquartic rational patches\n"
    "  ellipsoid         --axes A,B,C                            exact, six biquartic rational patches\n"
    "  fitted-ellipsoid  --axes A,B,C [--spans N]                six bicubic patches, joints nearly smooth\n"
    "  smooth-ellipsoid  --axes A,B,C                            six bicubic patches, joints smooth\n"
    "  pebble            [--radius R]                            asymmetric, six bicubic patches, joints "
    "smooth\n"
    "  superellipsoid    --axes A,B,C --exponent E [--spans N]   |x/A|^E + |y/B|^E + |z/C|^E = 1, fitted\n"
    "  revolved          --equatorial A --polar C                exact, one rational patch, axis z\n"
    "  box               --axes A,B,C                            six flat faces\n"
    "  inertia           --inertia XX,YY,ZZ,XY,XZ,YZ and --mass M or --density D or both\n"
    "                    near-ellipsoid of six bicubic patches whose uniform solid has this inertia tensor "
    "about\n"
    "                    its centre of mass, the origin (XY is the tensor's element, -sum of m x y)\n"
    "\n"
    "A, B, C are semi-axes (half edges of the box); N (1..12, default 1, superellipsoid 3) is the number of "
    "spans of a\n"
    "patch in each direction: more fit better, odd numbers dent flat faces less. Default radius: 1.\n"
    "--inertia fixes shape and size with --mass; the density follows and is printed. With --density the mass "
    "follows.\n"
    "With both the mass is met and the density must agree to 0.1 %.\n";

struct UsageError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

std::string format(const char* pattern, double value) {
  char text[64];
  std::snprintf(text, sizeof text, pattern, value);
  return text;
}

// --- Options
// -------------------------------------------------------------------------------------------------

// Options of one command, each used at most once and none unknown.
class Options {
 public:
  // Splits `arguments` into --NAME VALUE or --NAME=VALUE with NAME in `allowed`, "-o FILE" and at most one
  // plain FILE, which means the same.
  Options(std::string command, const std::vector<std::string>& allowed,
          const std::vector<std::string>& arguments)
      : command_(std::move(command)) {
    std::string last;  // the option before, if it was not the file
    for (size_t k = 0; k < arguments.size(); ++k) {
      std::string name = arguments[k], value;
      if (!is_option(name)) {
        if (!last.empty() && is_number_like(name)) {
          fail(last + " takes its numbers with commas and no blanks, as 1,2,3, and " + name +
               " follows after a blank");
        }
        value = std::exchange(name, "-o");
      } else {
        const size_t equals = name.find('=');
        if (equals != std::string::npos) value = name.substr(equals + 1);
        name.resize(std::min(equals, name.size()));
        if (name != "-o" && std::find(allowed.begin(), allowed.end(), name) == allowed.end()) {
          std::string list;
          for (const std::string& option : allowed) list += option + " ";
          fail("unknown option " + name + "; allowed are " + list + "-o");
        }
        if (equals == std::string::npos) {
          if (++k == arguments.size() || is_option(arguments[k])) fail(name + " needs a value");
          value = arguments[k];
        }
      }
      last = name == "-o" ? "" : name;
      if (const auto [first, fresh] = values_.emplace(name, value); !fresh) {
        if (name == "-o") fail("the output file is given twice: " + first->second + " and " + value);
        fail(name + " is given twice");
      }
    }
  }

  std::string output() {
    const auto file = find("-o");
    if (!file || file->empty()) fail("no output file: add -o FILE");
    return *file;
  }

  // Numbers separated by commas, all in [lo, hi].
  std::vector<double> numbers(const std::string& name, size_t count, double lo, double hi) {
    const auto text = find(name);
    if (!text) fail(name + " is missing");
    std::vector<double> out;
    for (size_t begin = 0; begin <= text->size();) {
      const size_t end = std::min(text->find(',', begin), text->size());
      out.push_back(number(name, text->substr(begin, end - begin), lo, hi));
      begin = end + 1;
    }
    if (out.size() != count) {
      fail(name + " has " + std::to_string(out.size()) + " numbers, must have " + std::to_string(count) +
           " separated by commas");
    }
    return out;
  }

  double number(const std::string& name, double otherwise, double lo, double hi) {
    return has(name) ? numbers(name, 1, lo, hi)[0] : otherwise;
  }

  double positive(const std::string& name) { return numbers(name, 1, kLeast, kMost)[0]; }
  double positive(const std::string& name, double otherwise) {
    return has(name) ? positive(name) : otherwise;
  }

  Vec3 axes() {
    const std::vector<double> a = numbers("--axes", 3, kLeast, kMost);
    return {a[0], a[1], a[2]};
  }

  int spans(int otherwise) {
    const double n = number("--spans", otherwise, 1, 12);
    if (n != std::floor(n)) fail("--spans must be a whole number in 1..12");
    return static_cast<int>(n);
  }

  bool has(const std::string& name) const { return values_.count(name) > 0; }

  [[noreturn]] void fail(const std::string& what) const { throw UsageError(command_ + ": " + what); }

  static constexpr double kLeast = 1e-150, kMost = 1e150;

 private:
  static bool is_number_like(const std::string& text) {
    return text.find_first_of("0123456789") != std::string::npos &&
           text.find_first_not_of("0123456789.,+-eE") == std::string::npos;
  }
  static bool is_option(const std::string& text) {
    return text.size() > 1 && text[0] == '-' && !is_number_like(text);
  }

  const std::string* find(const std::string& name) const {
    const auto found = values_.find(name);
    return found == values_.end() ? nullptr : &found->second;
  }

  double number(const std::string& name, const std::string& text, double lo, double hi) const {
    double value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size())
      fail(name + " '" + text + "' is not a number");
    if (!(value >= lo && value <= hi)) {
      const bool any_positive = lo == kLeast && hi == kMost;
      fail(name + " is " + text + ", must be " +
           (any_positive ? "> 0" : "in " + format("%g", lo) + ".." + format("%g", hi)));
    }
    return value;
  }

  std::string command_;
  std::map<std::string, std::string> values_;
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

Body make_sphere(Options& options) {
  return {exact_ellipsoid(Vec3::Constant(options.positive("--radius", 1))), ""};
}

Body make_ellipsoid(Options& options) {
  return {exact_ellipsoid(options.axes()), ""};
}

Body make_box(Options& options) {
  return {box(options.axes()), ""};
}

Body make_revolved(Options& options) {
  const double equatorial = options.positive("--equatorial"), polar = options.positive("--polar");
  return {revolved_ellipsoid(equatorial, polar), ""};
}

Body make_fitted(Options& options) {
  double error = 0;
  const Vec3 axes = options.axes();
  Surfaces surfaces = fitted_ellipsoid(axes, options.spans(1), &error);
  return {std::move(surfaces), fit_note(error)};
}

Body make_smooth(Options& options) {
  double error = 0;
  Surfaces surfaces = smooth_ellipsoid(options.axes(), &error);
  return {std::move(surfaces), fit_note(error)};
}

Body make_superellipsoid(Options& options) {
  double error = 0;
  const Vec3 axes = options.axes();
  const double exponent = options.numbers("--exponent", 1, 2, 12)[0];
  Surfaces surfaces = fitted_superellipsoid(axes, exponent, options.spans(3), &error);
  return {std::move(surfaces), fit_note(error)};
}

Body make_pebble(Options& options) {
  Surfaces surfaces = pebble();
  transform(surfaces, options.positive("--radius", 1) * Mat3::Identity(), Vec3::Zero());
  return {std::move(surfaces), ""};
}

Body make_inertia(Options& options) {
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
  std::vector<std::string> options;
  std::function<Body(Options&)> make;
};

const std::map<std::string, Maker>& makers() {
  static const std::map<std::string, Maker> kMakers = {
      {"sphere", {{"--radius"}, make_sphere}},
      {"ellipsoid", {{"--axes"}, make_ellipsoid}},
      {"fitted-ellipsoid", {{"--axes", "--spans"}, make_fitted}},
      {"smooth-ellipsoid", {{"--axes"}, make_smooth}},
      {"pebble", {{"--radius"}, make_pebble}},
      {"superellipsoid", {{"--axes", "--exponent", "--spans"}, make_superellipsoid}},
      {"revolved", {{"--equatorial", "--polar"}, make_revolved}},
      {"box", {{"--axes"}, make_box}},
      {"inertia", {{"--inertia", "--mass", "--density"}, make_inertia}},
  };
  return kMakers;
}

// Writes beside `file` and renames, so that `file` is whole or untouched.
void write_whole(const std::string& file, const std::string& text) {
  const std::string draft = file + "." + std::to_string(getpid()) + ".tmp";
  std::ofstream out(draft, std::ios::binary);
  out << text;
  out.close();
  if (!out || std::rename(draft.c_str(), file.c_str()) != 0) {
    const std::string reason = std::strerror(errno);
    std::remove(draft.c_str());
    throw std::runtime_error("can't write " + file + ": " + reason);
  }
}

void print_warnings(const std::vector<std::string>& warnings) {
  for (const std::string& warning : warnings) std::fprintf(stderr, "WARNING: %s\n", warning.c_str());
}

int make(std::vector<std::string> arguments) {
  const auto found = makers().find(arguments[0]);
  if (found == makers().end()) {
    throw UsageError("make: unknown kind '" + arguments[0] + "'; see nurbs-shape make --help");
  }
  arguments.erase(arguments.begin());
  Options options("make " + found->first, found->second.options, arguments);
  const std::string file = options.output();
  Body body = found->second.make(options);
  std::vector<std::string> warnings;
  const auto shape = make_shape(file, body.surfaces, std::nullopt, &warnings);
  write_whole(file, write_shape({std::move(body.surfaces), std::nullopt}));
  print_warnings(warnings);
  std::printf("%s: %zu patches, volume %.10g, bounding radius %.6g\n", file.c_str(), shape->surfaces.size(),
              shape->mass.volume, shape->bounding_radius);
  if (!body.note.empty()) std::printf("%s\n", body.note.c_str());
  return 0;
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
  std::printf("centre of mass     %.6g %.6g %.6g\n", m.center[0], m.center[1], m.center[2]);
  std::printf("inertia / mass     xx %.12g yy %.12g zz %.12g\n", g(0, 0), g(1, 1), g(2, 2));
  std::printf("                   xy %.12g xz %.12g yz %.12g\n", g(0, 1), g(0, 2), g(1, 2));
  const Vec3& p = shape.principal_gyration;
  std::printf("  principal        %.12g %.12g %.12g\n", p[0], p[1], p[2]);
}

void print_form(const Shape& shape) {
  const Kinks kinks = worst_kinks(shape);
  std::printf("bounding radius    %.12g\n", shape.bounding_radius);
  std::printf("inner radius       %.12g\n", shape.inner_radius);
  std::printf("curvature radius   %.6g to %.6g inside the patches\n", shape.patch_curvature.min_radius,
              shape.patch_curvature.max_radius);
  std::printf("worst kink         %.3g degrees opening, %.3g closing%s\n", kinks.opening, kinks.closing,
              shape.smooth ? " (smooth)" : "");
  std::printf("concavity          %.3g (%.3g of the bounding radius)\n", shape.concavity,
              shape.concavity / shape.bounding_radius);
  std::printf("memory             %.1f kB\n", static_cast<double>(memory(shape)) / 1024);
}

int info(const std::string& file) {
  std::vector<std::string> warnings;
  const auto shape = read_shape_file(file, &warnings);
  print_warnings(warnings);
  std::printf("shape              %s\n", shape->name.c_str());
  print_surfaces(*shape);
  print_mass(*shape);
  print_form(*shape);
  return 0;
}

int check(const std::string& file) {
  std::vector<std::string> warnings;
  const auto shape = read_shape_file(file, &warnings);
  print_warnings(warnings);
  const Kinks kinks = worst_kinks(*shape);
  std::printf("%s: usable: closed, outward%s, %zu patches, worst kink %.3g degrees, concavity %.3g\n",
              file.c_str(), warnings.empty() ? ", convex" : "", shape->surfaces.size(),
              std::max(kinks.opening, kinks.closing), shape->concavity);
  return 0;
}

int run(const std::vector<std::string>& arguments) {
  if (arguments.empty()) throw UsageError("no command; see nurbs-shape --help");
  const std::string& command = arguments[0];
  const bool help = std::any_of(arguments.begin(), arguments.end(),
                                [](const std::string& a) { return a == "--help" || a == "-h"; });
  if (help) {
    std::fputs(command == "make" ? kMakeUsage : kUsage, stdout);
    return 0;
  }
  if (command == "make") {
    if (arguments.size() < 2) throw UsageError("make: no kind; see nurbs-shape make --help");
    return make({arguments.begin() + 1, arguments.end()});
  }
  if (command == "info" || command == "check") {
    if (arguments.size() != 2) throw UsageError(command + ": give one shape file");
    return command == "info" ? info(arguments[1]) : check(arguments[1]);
  }
  throw UsageError("unknown command '" + command + "'; see nurbs-shape --help");
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run({argv + 1, argv + argc});
  } catch (const std::exception& error) {
    std::fprintf(stderr, "ERROR: %s\n", error.what());
    return 1;
  }
}

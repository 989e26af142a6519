// Reading and writing shape files: every look into the JSON is checked, so that a user sees what is wrong and
// where.
#include "io/shape_file.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <sstream>

namespace nurbs {
namespace {

using Json = nlohmann::json;

// A value as an error quotes it: short, on one line.
std::string quote(const Json& value) {
  std::string text = value.dump(-1, ' ', false, Json::error_handler_t::replace);
  if (text.size() > 40) text = text.substr(0, 37) + "...";
  return text;
}

// Where in a file we are, to begin messages with: "pebble.json: patch 3: ".
struct Place {
  std::string prefix;
  [[noreturn]] void fail(const std::string& what) const { throw ShapeError(prefix + what); }
};

const Json& member(const Json& object, const char* key, const Place& place) {
  if (!object.is_object())
    place.fail("expected an object with \"" + std::string(key) + "\", found " + quote(object));
  const auto it = object.find(key);
  if (it == object.end()) place.fail("\"" + std::string(key) + "\" is missing");
  return *it;
}

// Whole numbers as JSON writes them, 3 or 3.0.
long long integer(const Json& object, const char* key, long long least, long long most, const Place& place) {
  const Json& value = member(object, key, place);
  const double x = value.is_number() ? value.get<double>() : std::nan("");
  if (!(x >= static_cast<double>(least) && x <= static_cast<double>(most) && x == std::floor(x))) {
    place.fail("\"" + std::string(key) + "\" = " + quote(value) + ", must be a whole number " +
               std::to_string(least) + ".." + std::to_string(most));
  }
  return static_cast<long long>(x);
}

double finite_number(const Json& value, const std::string& what, const Place& place) {
  const double x = value.is_number() ? value.get<double>() : std::nan("");
  if (!std::isfinite(x)) place.fail(what + " = " + quote(value) + ", must be a finite number");
  return x;
}

const Json& array(const Json& object, const char* key, const Place& place) {
  const Json& value = member(object, key, place);
  if (!value.is_array()) place.fail("\"" + std::string(key) + "\" must be an array, found " + quote(value));
  return value;
}

std::vector<double> numbers(const Json& object, const char* key, const Place& place) {
  const Json& values = array(object, key, place);
  std::vector<double> out;
  out.reserve(values.size());
  for (size_t i = 0; i < values.size(); ++i) {
    out.push_back(finite_number(values[i], std::string(key) + "[" + std::to_string(i) + "]", place));
  }
  return out;
}

void require_count(size_t found, size_t expected, const char* what, const std::string& formula,
                   const Place& place) {
  if (found == expected) return;
  place.fail("\"" + std::string(what) + "\" has " + std::to_string(found) + " entries, must have " + formula +
             " = " + std::to_string(expected));
}

bool has_weights(const Json& net) {
  return net.contains("weights") && !net["weights"].is_null();
}

// A factor common to a patch's weights means nothing: the power of two of the largest, where it is so far
// from 1 that squares might leave the range of numbers, else 0.
int common_power(const std::vector<double>& weights) {
  constexpr int kFar = 64;
  const double largest = *std::max_element(weights.begin(), weights.end());
  const int power = largest > 0 ? std::ilogb(largest) : 0;
  return std::abs(power) > kFar ? power : 0;
}

std::vector<Vec4> parse_points(const Json& net, size_t expected, const Place& place) {
  const Json& points = array(net, "points", place);
  require_count(points.size(), expected, "points", "size_u * size_v", place);
  std::vector<double> weights(expected, 1.0);
  if (has_weights(net)) {
    weights = numbers(net, "weights", place);
    require_count(weights.size(), expected, "weights", "size_u * size_v", place);
  }
  std::vector<Vec4> out(expected);
  const int power = common_power(weights);
  for (size_t i = 0; i < expected; ++i) {
    const std::string name = "points[" + std::to_string(i) + "]";
    if (!points[i].is_array() || points[i].size() != 3) {
      place.fail(name + " = " + quote(points[i]) + ", must be 3 coordinates");
    }
    if (!(weights[i] > 0))
      place.fail("weights[" + std::to_string(i) + "] = " + quote(net["weights"][i]) + ", must be > 0");
    const double w = std::ldexp(weights[i], -power);
    for (int c = 0; c < 3; ++c) {
      out[i][c] = w * finite_number(points[i][c], name + "[" + std::to_string(c) + "]", place);
    }
    out[i][3] = w;
  }
  return out;
}

NurbsSurface parse_surface(const Json& data, const Place& place) {
  constexpr int kMostPoints = 100000;  // per direction: keeps size_u * size_v within range
  if (data.is_object() && data.contains("dimension")) integer(data, "dimension", 3, 3, place);
  NurbsSurface s;
  s.degree_u = static_cast<int>(integer(data, "degree_u", 1, kMaxDegree, place));
  s.degree_v = static_cast<int>(integer(data, "degree_v", 1, kMaxDegree, place));
  s.size_u = static_cast<int>(integer(data, "size_u", s.degree_u + 1, kMostPoints, place));
  s.size_v = static_cast<int>(integer(data, "size_v", s.degree_v + 1, kMostPoints, place));
  s.knots_u = numbers(data, "knotvector_u", place);
  s.knots_v = numbers(data, "knotvector_v", place);
  require_count(s.knots_u.size(), s.size_u + s.degree_u + 1u, "knotvector_u", "size_u + degree_u + 1", place);
  require_count(s.knots_v.size(), s.size_v + s.degree_v + 1u, "knotvector_v", "size_v + degree_v + 1", place);
  s.points =
      parse_points(member(data, "control_points", place), static_cast<size_t>(s.size_u) * s.size_v, place);
  const std::string defect = find_defect(s);
  if (!defect.empty()) place.fail(defect);
  return s;
}

// Says that it is rational, and not how.
bool has_lost_weights(const Json& data) {
  return data.contains("rational") && data["rational"] == true && !has_weights(data["control_points"]);
}

Mat3 parse_gyration(const Json& root, const Place& place) {
  const std::vector<double> g = numbers(root, "gyration", place);
  if (g.size() != 6)
    place.fail("\"gyration\" has " + std::to_string(g.size()) + " numbers, must have 6: xx yy zz xy xz yz");
  Mat3 m;
  m << g[0], g[3], g[4], g[3], g[1], g[5], g[4], g[5], g[2];
  return m;
}

// "byte 1234 (line 56)" of the text.
std::string position(const std::string& text, size_t byte) {
  const size_t end = std::min(byte, text.size());
  const auto lines = std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(end), '\n');
  return "byte " + std::to_string(byte) + " (line " + std::to_string(lines + 1) + ")";
}

// What makes a shape of a mesh or a CAD file, which this text may be.
std::string maker_of(const std::string& text) {
  const auto begins = [&](const char* word) { return text.compare(0, std::strlen(word), word) == 0; };
  if (begins("solid") || begins("ply") || begins("v ") || begins("# ") || begins("o "))
    return "; of a mesh, 'nurbs-shape fit' makes a shape";
  if (begins("ISO-10303") || begins("DBRep_DrawableShape"))
    return "; of a solid, 'nurbs-shape import' makes a shape";
  return "";
}

Json parse_json(const std::string& text, const Place& place) {
  constexpr int kDeepest = 64;  // quotes and destructors go down by recursion
  if (text.find_first_not_of(" \t\r\n") == std::string::npos) place.fail("the file is empty");
  try {
    return Json::parse(text, [&](int depth, Json::parse_event_t, const Json&) {
      if (depth > kDeepest) place.fail("nested deeper than " + std::to_string(kDeepest) + " levels");
      return true;
    });
  } catch (const Json::parse_error& error) {
    const bool at_end = error.byte > text.size();
    place.fail("not valid JSON at " + position(text, error.byte) +
               (at_end ? ": the file ends too early" : ": unexpected character" + maker_of(text)));
  } catch (const Json::exception&) {
    place.fail("not valid JSON: a number is out of range");
  }
}

const Json& surface_list(const Json& shape, const Place& place) {
  const Json& data = array(shape, "data", place);
  if (shape.contains("type") && shape["type"] != "surface") {
    place.fail("\"type\" = " + quote(shape["type"]) + ", must be \"surface\"");
  }
  if (data.empty()) place.fail("\"data\" holds no surface, must hold at least 1");
  if (shape.contains("count") && shape["count"] != data.size()) {
    place.fail("\"count\" = " + quote(shape["count"]) + ", but \"data\" holds " +
               std::to_string(data.size()) + " surfaces");
  }
  return data;
}

// The Cartesian x for which w * x is `product` again; where none exists, the closest quotient.
double exact_quotient(double product, double w) {
  const double x = product / w;
  double below = x, above = x;
  for (int i = 0; i < 3; ++i) {
    if (w * below == product) return below;
    if (w * above == product) return above;
    below = std::nextafter(below, -std::numeric_limits<double>::infinity());
    above = std::nextafter(above, std::numeric_limits<double>::infinity());
  }
  return x;
}

Json surface_to_json(const NurbsSurface& s) {
  Json points = Json::array(), weights = Json::array();
  bool rational = false;
  for (const Vec4& p : s.points) {
    Json point = Json::array();
    for (int c = 0; c < 3; ++c) point.push_back(exact_quotient(p[c], p[3]));
    points.push_back(point);
    weights.push_back(p[3]);
    rational = rational || p[3] != 1;
  }
  Json net = {{"points", points}};
  if (rational) net["weights"] = weights;
  return {{"rational", rational},      {"dimension", 3},
          {"degree_u", s.degree_u},    {"degree_v", s.degree_v},
          {"knotvector_u", s.knots_u}, {"knotvector_v", s.knots_v},
          {"size_u", s.size_u},        {"size_v", s.size_v},
          {"control_points", net}};
}

std::string read_text(const std::string& file) {
  std::error_code error;
  if (std::filesystem::is_directory(file, error))
    throw ShapeError(file + ": is a directory, not a shape file");
  std::ifstream in(file, std::ios::binary);
  if (!in) throw ShapeError(file + ": cannot open shape file");
  std::ostringstream text;
  text << in.rdbuf();
  if (in.bad()) throw ShapeError(file + ": cannot read shape file");
  return text.str();
}

}  // namespace

ShapeFileContent parse_shape(const std::string& text, const std::string& file) {
  const Place top{file + ": "};
  const Json root = parse_json(text, top);
  const Json& shape = member(root, "shape", top);
  const Json& data = surface_list(shape, top);
  ShapeFileContent content;
  for (size_t i = 0; i < data.size(); ++i) {
    content.surfaces.push_back(parse_surface(data[i], {file + ": patch " + std::to_string(i) + ": "}));
  }
  if (root.contains("gyration")) content.gyration = parse_gyration(root, top);
  if (const size_t lost = std::count_if(data.begin(), data.end(), has_lost_weights); lost > 0)
    content.warnings.push_back("\"rational\" is true, but " + std::to_string(lost) + " of " +
                               std::to_string(data.size()) +
                               " patches have no \"weights\"; theirs are taken as 1");
  return content;
}

std::string write_shape(const ShapeFileContent& content) {
  Json data = Json::array();
  for (const NurbsSurface& s : content.surfaces) data.push_back(surface_to_json(s));
  Json root = {{"shape", {{"type", "surface"}, {"count", data.size()}, {"data", data}}}};
  if (content.gyration) {
    const Mat3& g = *content.gyration;
    root["gyration"] = {g(0, 0), g(1, 1), g(2, 2), g(0, 1), g(0, 2), g(1, 2)};
  }
  return root.dump(1) + "\n";
}

int few_decimals(const std::vector<NurbsSurface>& surfaces) {
  constexpr int kMost = 10;
  int decimals = 0;
  double unit = 1;
  for (const NurbsSurface& s : surfaces)
    for (const Vec4& p : s.points)
      for (int c = 0; c < 3; ++c) {
        const double x = p[c] / p[3];
        const auto whole = [&] {
          return std::abs(x * unit - std::round(x * unit)) <= 1e-15 * unit * std::abs(x);
        };
        for (; !whole(); unit *= 10)
          if (++decimals > kMost) return 0;
      }
  return decimals;
}

std::shared_ptr<const Shape> read_shape_file(const std::string& file, std::vector<std::string>* warnings) {
  ShapeFileContent content = parse_shape(read_text(file), file);
  const std::string name = std::filesystem::path(file).stem().string();
  const auto with_file = [&](const std::string& message) { return file + message.substr(name.size()); };
  std::vector<std::string> found;
  std::shared_ptr<const Shape> shape;
  try {
    shape = make_shape(name, std::move(content.surfaces), content.gyration, &found);
  } catch (const ShapeError& error) {
    throw ShapeError(with_file(error.what()));
  }
  if (warnings) {
    for (const std::string& w : content.warnings)
      warnings->push_back(std::string(file).append(": ").append(w));
    for (const std::string& w : found) warnings->push_back(with_file(w));
  }
  return shape;
}

}  // namespace nurbs

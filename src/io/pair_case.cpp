// Pair cases as JSON; see pair_case.h.
#include "io/pair_case.h"

#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "io/shape_file.h"

namespace nurbs {
namespace {

using nlohmann::json;

std::string exact(double x) {
  char text[64];
  std::snprintf(text, sizeof text, "%a", x);
  return text;
}

double number(const json& value) {
  return std::strtod(value.get<std::string>().c_str(), nullptr);
}

// Every bit of the homogeneous control points, which a shape file's points and weights would lose.
json to_json(const NurbsSurface& s) {
  json out;
  out["degrees"] = {s.degree_u, s.degree_v};
  out["sizes"] = {s.size_u, s.size_v};
  for (const double k : s.knots_u) out["knots_u"].push_back(exact(k));
  for (const double k : s.knots_v) out["knots_v"].push_back(exact(k));
  for (const Vec4& p : s.points)
    for (int k = 0; k < 4; ++k) out["points"].push_back(exact(p[k]));
  return out;
}

NurbsSurface surface_from_json(const json& in) {
  NurbsSurface s;
  s.degree_u = in.at("degrees").at(0);
  s.degree_v = in.at("degrees").at(1);
  s.size_u = in.at("sizes").at(0);
  s.size_v = in.at("sizes").at(1);
  for (const json& k : in.at("knots_u")) s.knots_u.push_back(number(k));
  for (const json& k : in.at("knots_v")) s.knots_v.push_back(number(k));
  const json& points = in.at("points");
  for (size_t k = 0; k + 3 < points.size(); k += 4)
    s.points.emplace_back(number(points[k]), number(points[k + 1]), number(points[k + 2]),
                          number(points[k + 3]));
  return s;
}

json to_json(const Particle& p) {
  json out;
  out["name"] = p.shape->name;
  out["shape"] = json::parse(write_shape({p.shape->surfaces, p.shape->gyration}));
  for (const NurbsSurface& s : p.shape->surfaces) out["exact"].push_back(to_json(s));
  for (int k = 0; k < 9; ++k) out["exact_gyration"].push_back(exact(p.shape->gyration(k / 3, k % 3)));
  out["scale"] = exact(p.scale);
  for (int k = 0; k < 3; ++k) out["x"].push_back(exact(p.x[k]));
  for (const double q : {p.q.w(), p.q.x(), p.q.y(), p.q.z()}) out["q"].push_back(exact(q));
  return out;
}

Particle from_json(const json& in, const std::string& file, std::shared_ptr<const Shape>* shape) {
  ShapeFileContent content = parse_shape(in.at("shape").dump(), file);
  if (in.contains("exact")) {  // older cases have the shape alone
    content.surfaces.clear();
    for (const json& s : in.at("exact")) content.surfaces.push_back(surface_from_json(s));
    Mat3 gyration;
    for (int k = 0; k < 9; ++k) gyration(k / 3, k % 3) = number(in.at("exact_gyration").at(k));
    content.gyration = gyration;
  }
  *shape = make_shape(in.at("name").get<std::string>(), content.surfaces, content.gyration);
  Particle p;
  p.shape = shape->get();
  p.scale = number(in.at("scale"));
  for (int k = 0; k < 3; ++k) p.x[k] = number(in.at("x").at(k));
  const json& q = in.at("q");
  p.q = Quat(number(q.at(0)), number(q.at(1)), number(q.at(2)), number(q.at(3)));
  return p;
}

}  // namespace

bool write_pair_case(const std::string& file, const Particle& a, const Particle& b,
                     const ContactSettings& settings) try {
  json out;
  out["tolerance"] = exact(settings.tolerance);
  out["reach"] = exact(settings.reach);
  out["solver"] = settings.solver == Solver::cso ? "cso" : "default";
  out["a"] = to_json(a);
  out["b"] = to_json(b);
  std::ofstream stream(file);
  stream << out.dump(1) << '\n';
  stream.close();
  return stream.good();
} catch (const std::exception&) {
  return false;
}

PairCase read_pair_case(const std::string& file) try {
  std::ifstream stream(file);
  if (!stream) throw ShapeError("can't read it");
  std::ostringstream text;
  text << stream.rdbuf();
  const json in = json::parse(text.str());
  PairCase out;
  out.settings.tolerance = number(in.at("tolerance"));
  out.settings.reach = number(in.at("reach"));
  out.settings.solver = in.at("solver") == "cso" ? Solver::cso : Solver::ladder;
  out.a = from_json(in.at("a"), file, &out.shape_a);
  out.b = from_json(in.at("b"), file, &out.shape_b);
  return out;
} catch (const std::exception& error) {
  throw ShapeError("pair case " + file + ": " + error.what());
}

}  // namespace nurbs

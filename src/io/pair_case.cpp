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

json to_json(const Particle& p) {
  json out;
  out["name"] = p.shape->name;
  out["shape"] = json::parse(write_shape({p.shape->surfaces, p.shape->gyration}));
  out["scale"] = exact(p.scale);
  for (int k = 0; k < 3; ++k) out["x"].push_back(exact(p.x[k]));
  for (const double q : {p.q.w(), p.q.x(), p.q.y(), p.q.z()}) out["q"].push_back(exact(q));
  return out;
}

Particle from_json(const json& in, const std::string& file, std::shared_ptr<const Shape>* shape) {
  const ShapeFileContent content = parse_shape(in.at("shape").dump(), file);
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

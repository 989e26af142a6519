// Shape files: the geomdl layout, bit-for-bit round trips, and a clear message for whatever can be wrong.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>

#include "io/shape_file.h"
#include "shapes/primitives.h"
#include "support/random.h"
#include "support/solids.h"

namespace nurbs::test_shape_file {
namespace {

using Json = nlohmann::json;

// A box as geomdl writes it, with keys this program does not know.
Json box_json() {
  Json data = Json::array();
  for (const NurbsSurface& s : box({1, 2, 3})) {
    Json points = Json::array();
    for (const Vec4& p : s.points) points.push_back({p[0], p[1], p[2]});
    data.push_back({{"rational", true},
                    {"dimension", 3},
                    {"degree_u", 1},
                    {"degree_v", 1},
                    {"knotvector_u", {0, 0, 1, 1}},
                    {"knotvector_v", {0.0, 0.0, 1.0, 1.0}},
                    {"size_u", 2},
                    {"size_v", 2},
                    {"control_points", {{"points", points}, {"weights", {1, 1, 1, 1.0}}}},
                    {"delta", {0.05, 0.05}},
                    {"trims", {{"count", 0}, {"data", Json::array()}}}});
  }
  return {{"shape", {{"type", "surface"}, {"count", 6}, {"data", data}}}};
}

// A file of its own per test, removed with it.
class TemporaryFile {
 public:
  explicit TemporaryFile(const std::string& text) {
    const auto* test = testing::UnitTest::GetInstance()->current_test_info();
    const std::string folder = "nurbs_" + std::to_string(getpid()) + "_" + test->name();
    folder_ = std::filesystem::temp_directory_path() / folder;
    std::filesystem::create_directories(folder_);
    std::ofstream(path()) << text;
  }
  ~TemporaryFile() { std::filesystem::remove_all(folder_); }
  std::string path() const { return (folder_ / "stone.json").string(); }
  std::string folder() const { return folder_.string(); }

 private:
  std::filesystem::path folder_;
};

std::string parse_error(const std::string& text) {
  try {
    parse_shape(text, "stone.json");
  } catch (const ShapeError& error) {
    return error.what();
  }
  return "accepted";
}

std::string read_error(const std::string& file) {
  try {
    read_shape_file(file);
  } catch (const ShapeError& error) {
    return error.what();
  }
  return "accepted";
}

// The error after `spoil` has changed the box.
template <class Spoil>
std::string error_after(const Spoil& spoil) {
  Json root = box_json();
  spoil(root["shape"]["data"][2], root);
  return parse_error(root.dump());
}

void expect_same(const ShapeFileContent& a, const ShapeFileContent& b) {
  ASSERT_EQ(a.surfaces.size(), b.surfaces.size());
  for (size_t i = 0; i < a.surfaces.size(); ++i) {
    const NurbsSurface &s = a.surfaces[i], &t = b.surfaces[i];
    EXPECT_EQ(s.degree_u, t.degree_u);
    EXPECT_EQ(s.degree_v, t.degree_v);
    EXPECT_EQ(s.size_u, t.size_u);
    EXPECT_EQ(s.size_v, t.size_v);
    EXPECT_EQ(s.knots_u, t.knots_u);
    EXPECT_EQ(s.knots_v, t.knots_v);
    EXPECT_EQ(s.points, t.points);
  }
  ASSERT_EQ(a.gyration.has_value(), b.gyration.has_value());
  if (a.gyration) {
    EXPECT_EQ(*a.gyration, *b.gyration);
  }
}

TEST(ShapeFile, ReadsTheLayoutOfGeomdl) {
  const ShapeFileContent content = parse_shape(box_json().dump(2), "stone.json");
  expect_same(content, {box({1, 2, 3}), std::nullopt});
}

TEST(ShapeFile, WeightsAreOptionalAndPointsCartesian) {
  Json root = box_json();
  Json& net = root["shape"]["data"][0]["control_points"];
  net.erase("weights");
  const ShapeFileContent without = parse_shape(root.dump(), "stone.json");
  EXPECT_EQ(without.surfaces[0].points[3][3], 1);
  EXPECT_EQ(without.warnings, std::vector<std::string>{
                                  "\"rational\" is true, but 1 of 6 patches have no \"weights\"; theirs are "
                                  "taken as 1"});
  root["shape"]["data"][0]["rational"] = false;
  EXPECT_TRUE(parse_shape(root.dump(), "stone.json").warnings.empty());
  net["weights"] = {1, 1, 1, 2};
  net["points"][3] = {1, 2, 3};
  const ShapeFileContent weighted = parse_shape(root.dump(), "stone.json");
  EXPECT_EQ(weighted.surfaces[0].points[3], Vec4(2, 4, 6, 2));
  EXPECT_TRUE(weighted.warnings.empty());
}

TEST(ShapeFile, AFactorOfAllWeightsMeansNothing) {
  const ShapeFileContent plain = parse_shape(box_json().dump(), "stone.json");
  for (const double factor : {0x1p-660, 0x1p-1060, 0x1p990}) {
    Json root = box_json();
    for (Json& patch : root["shape"]["data"])
      for (Json& w : patch["control_points"]["weights"]) w = factor * w.get<double>();
    const ShapeFileContent scaled = parse_shape(root.dump(), "stone.json");
    for (size_t k = 0; k < plain.surfaces.size(); ++k)
      EXPECT_EQ(scaled.surfaces[k].points, plain.surfaces[k].points) << factor;
  }
}

TEST(ShapeFile, DecimalsAreCounted) {
  std::vector<NurbsSurface> surfaces = exact_ellipsoid({1, 0.8, 0.6});
  EXPECT_EQ(few_decimals(surfaces), 0);
  for (const int digits : {3, 7, 10}) EXPECT_EQ(few_decimals(test::with_decimals(surfaces, digits)), digits);
  EXPECT_EQ(few_decimals(test::with_decimals(surfaces, 11)), 0);
  EXPECT_EQ(few_decimals(box({1.5, 2, 3})), 1);
}

TEST(ShapeFile, NameIsTheStemAndTheBodyIsBuilt) {
  const TemporaryFile file(box_json().dump());
  const auto shape = read_shape_file(file.path());
  EXPECT_EQ(shape->name, "stone");
  EXPECT_NEAR(shape->mass.volume, 48, 1e-12);
}

TEST(ShapeFile, RoundTripBitForBit) {
  test::Random random(1);
  for (int trial = 0; trial < 20; ++trial) {
    ShapeFileContent content;
    content.surfaces = exact_ellipsoid({1, 1, 1});
    for (NurbsSurface& s : content.surfaces) {
      for (Vec4& p : s.points) {  // as a file gives them: products of a weight and Cartesian coordinates
        const double w = random.uniform(0.1, 5), scale = std::pow(10, random.uniform(-8, 8));
        const double x = scale * random.uniform(-1, 1), y = scale * random.uniform(-1, 1);
        p = Vec4(w * x, w * y, w * 0.1, w);
      }
    }
    if (trial % 2) {
      Mat3 g;
      g << 1.1, 0.1, 0.2, 0.1, 1.3, 1 / 3.0, 0.2, 1 / 3.0, 1.7;
      content.gyration = g;
    }
    expect_same(parse_shape(write_shape(content), "stone.json"), content);
  }
}

TEST(ShapeFile, PolynomialBodiesRoundTripBitForBit) {
  ShapeFileContent content{exact_ellipsoid({1, 2, 3}), std::nullopt};
  for (NurbsSurface& s : content.surfaces) {
    for (Vec4& p : s.points) p[3] = 1;
  }
  const std::string text = write_shape(content);
  EXPECT_EQ(text.find("weights"), std::string::npos);
  expect_same(parse_shape(text, "stone.json"), content);
}

TEST(ShapeFile, ASecondRoundTripChangesNothing) {
  const ShapeFileContent content{exact_ellipsoid({1, 2, 3}), std::nullopt};
  const ShapeFileContent once = parse_shape(write_shape(content), "stone.json");
  expect_same(parse_shape(write_shape(once), "stone.json"), once);
  for (size_t i = 0; i < content.surfaces.size(); ++i) {
    for (size_t k = 0; k < content.surfaces[i].points.size(); ++k) {
      EXPECT_LT((content.surfaces[i].points[k] - once.surfaces[i].points[k]).norm(), 1e-15);
    }
  }
}

TEST(ShapeFile, GyrationIsUsed) {
  Json root = box_json();
  root["gyration"] = {1, 1.5, 2, 0.1, 0.2, 0.3};
  const auto shape = read_shape_file(TemporaryFile(root.dump()).path());
  EXPECT_EQ(shape->gyration(0, 2), 0.2);
  EXPECT_EQ(shape->gyration(2, 1), 0.3);
  root["gyration"] = {1, 1, 5, 0, 0, 0};
  const TemporaryFile file(root.dump());
  EXPECT_EQ(read_error(file.path()), file.path() +
                                         ": gyration is not that of a body: its eigenvalues are 1, 1, 5, "
                                         "the largest must not exceed the sum of the others");
  root["gyration"] = {1, 1, 5};
  EXPECT_EQ(parse_error(root.dump()),
            "stone.json: \"gyration\" has 3 numbers, must have 6: xx yy zz xy xz yz");
  root["gyration"] = "heavy";
  EXPECT_EQ(parse_error(root.dump()), "stone.json: \"gyration\" must be an array, found \"heavy\"");
}

TEST(ShapeFile, WarningsNameTheFile) {
  Json root = box_json();
  Json& points = root["shape"]["data"][4]["control_points"]["points"];
  std::swap(points[1], points[2]);
  const TemporaryFile file(root.dump());
  std::vector<std::string> warnings;
  read_shape_file(file.path(), &warnings);
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_EQ(warnings[0], file.path() + ": patch 4 faced inward and has been turned outward");
}

// --- errors
// ----------------------------------------------------------------------------------------------------

TEST(ShapeFileErrors, MissingFileAndFolder) {
  const TemporaryFile file("");
  EXPECT_EQ(read_error("no/such/stone.json"), "no/such/stone.json: cannot open shape file");
  EXPECT_EQ(read_error(file.folder()), file.folder() + ": is a directory, not a shape file");
  EXPECT_EQ(read_error(file.path()), file.path() + ": the file is empty");
}

TEST(ShapeFileErrors, NotJson) {
  EXPECT_EQ(parse_error("solid cube\nfacet"),
            "stone.json: not valid JSON at byte 1 (line 1): unexpected character; of a mesh, 'nurbs-shape "
            "fit' makes a "
            "shape");
  EXPECT_EQ(parse_error("{\"shape\":\n {]"),
            "stone.json: not valid JSON at byte 13 (line 2): unexpected character");
  EXPECT_EQ(parse_error("[1e999]"), "stone.json: not valid JSON: a number is out of range");
  EXPECT_NE(parse_error(std::string("{\"shape\": NaN}")).find("not valid JSON at byte 11"),
            std::string::npos);
  const std::string deep = std::string(100000, '[') + std::string(100000, ']');
  EXPECT_EQ(parse_error(deep), "stone.json: nested deeper than 64 levels");
  EXPECT_EQ(parse_error("{\"shape\": " + deep + "}"), "stone.json: nested deeper than 64 levels");
}

TEST(ShapeFileErrors, TruncatedAnywhereIsReportedWithItsPosition) {
  const std::string text = box_json().dump();
  for (size_t length = 1; length < text.size(); length += 7) {
    const std::string error = parse_error(text.substr(0, length));
    EXPECT_NE(error.find("stone.json: not valid JSON at byte "), std::string::npos)
        << length << ": " << error;
    EXPECT_NE(error.find("the file ends too early"), std::string::npos) << length << ": " << error;
  }
}

TEST(ShapeFileErrors, MissingParts) {
  EXPECT_EQ(parse_error("{}"), "stone.json: \"shape\" is missing");
  EXPECT_EQ(parse_error("[]"), "stone.json: expected an object with \"shape\", found []");
  EXPECT_EQ(error_after([](Json& s, Json&) { s.erase("degree_u"); }),
            "stone.json: patch 2: \"degree_u\" is missing");
  EXPECT_EQ(error_after([](Json& s, Json&) { s["control_points"].erase("points"); }),
            "stone.json: patch 2: \"points\" is missing");
  EXPECT_EQ(error_after([](Json&, Json& root) { root["shape"]["data"] = Json::array(); }),
            "stone.json: \"data\" holds no surface, must hold at least 1");
  EXPECT_EQ(error_after([](Json&, Json& root) { root["shape"]["type"] = "curve"; }),
            "stone.json: \"type\" = \"curve\", must be \"surface\"");
}

TEST(ShapeFileErrors, WrongCounts) {
  EXPECT_EQ(error_after([](Json&, Json& root) { root["shape"]["count"] = 7; }),
            "stone.json: \"count\" = 7, but \"data\" holds 6 surfaces");
  EXPECT_EQ(error_after([](Json& s, Json&) { s["knotvector_u"].push_back(1); }),
            "stone.json: patch 2: \"knotvector_u\" has 5 entries, must have size_u + degree_u + 1 = 4");
  EXPECT_EQ(error_after([](Json& s, Json&) { s["control_points"]["points"].erase(3); }),
            "stone.json: patch 2: \"points\" has 3 entries, must have size_u * size_v = 4");
  EXPECT_EQ(error_after([](Json& s, Json&) { s["control_points"]["weights"].erase(3); }),
            "stone.json: patch 2: \"weights\" has 3 entries, must have size_u * size_v = 4");
  EXPECT_EQ(error_after([](Json& s, Json&) {
              s["control_points"]["points"][1] = {1, 2};
            }),
            "stone.json: patch 2: points[1] = [1,2], must be 3 coordinates");
  EXPECT_EQ(error_after([](Json& s, Json&) { s["size_v"] = 1; }),
            "stone.json: patch 2: \"size_v\" = 1, must be a whole number 2..100000");
  EXPECT_EQ(error_after([](Json& s, Json&) { s["dimension"] = 2; }),
            "stone.json: patch 2: \"dimension\" = 2, must be a whole number 3..3");
}

TEST(ShapeFileErrors, Degrees) {
  for (const Json& degree : {Json(0), Json(10), Json(-1), Json(1.5), Json("cubic"), Json(1e300)}) {
    EXPECT_EQ(error_after([&](Json& s, Json&) { s["degree_u"] = degree; }),
              "stone.json: patch 2: \"degree_u\" = " + degree.dump() + ", must be a whole number 1..9");
  }
}

TEST(ShapeFileErrors, Knots) {
  EXPECT_EQ(error_after([](Json& s, Json&) {
              s["knotvector_v"] = {0, 0, 1, 0.5};
            }),
            "stone.json: patch 2: knotvector_v[3] = 0.5 is less than the knot before it, 1: knots must not "
            "decrease");
  EXPECT_EQ(error_after([](Json& s, Json&) {
              s["knotvector_v"] = {0, 0, 0, 1};
            }),
            "stone.json: patch 2: knotvector_v: the knot 0 is repeated more than 2 times, the most allowed "
            "at an end "
            "for degree 1");
  EXPECT_EQ(error_after([](Json& s, Json&) { s["knotvector_v"][1] = "zero"; }),
            "stone.json: patch 2: knotvector_v[1] = \"zero\", must be a finite number");
  EXPECT_EQ(error_after([](Json& s, Json&) { s["knotvector_v"][1] = nullptr; }),
            "stone.json: patch 2: knotvector_v[1] = null, must be a finite number");
}

TEST(ShapeFileErrors, WeightsAndPoints) {
  EXPECT_EQ(error_after([](Json& s, Json&) { s["control_points"]["weights"][1] = 0; }),
            "stone.json: patch 2: weights[1] = 0, must be > 0");
  EXPECT_EQ(error_after([](Json& s, Json&) { s["control_points"]["weights"][1] = -2.5; }),
            "stone.json: patch 2: weights[1] = -2.5, must be > 0");
  EXPECT_EQ(error_after([](Json& s, Json&) { s["control_points"]["weights"][1] = nullptr; }),
            "stone.json: patch 2: weights[1] = null, must be a finite number");
  EXPECT_EQ(error_after([](Json& s, Json&) { s["control_points"]["points"][1][2] = nullptr; }),
            "stone.json: patch 2: points[1][2] = null, must be a finite number");
  EXPECT_EQ(error_after([](Json& s, Json&) {
              s["control_points"]["points"][1][2] = 1e308;
              s["control_points"]["weights"][1] = 100;
            }),
            "stone.json: patch 2: control point 1 has z = inf, must be finite");
}

TEST(ShapeFileErrors, BodyErrorsNameTheFile) {
  Json root = box_json();
  root["shape"]["data"].erase(5);
  root["shape"]["count"] = 5;
  const TemporaryFile file(root.dump());
  const std::string error = read_error(file.path());
  EXPECT_EQ(error.find(file.path() + ": patch "), 0u) << error;
  EXPECT_NE(error.find("has no partner: the surface is open"), std::string::npos) << error;
}

// Replaces every value in the file, one at a time, by values of every other type.
void for_each_spoiled(Json& root, Json& node, const std::function<void(const Json&)>& visit) {
  const Json original = node;
  for (const Json& wrong : {Json(nullptr), Json(true), Json("text"), Json(-1), Json(2.5), Json(1e300),
                            Json::array(), Json::object(), Json({1, "a"}), Json({{"points", 3}})}) {
    node = wrong;
    visit(root);
  }
  node = original;
  if (!node.is_structured()) return;
  for (auto& child : node) for_each_spoiled(root, child, visit);
}

TEST(ShapeFileErrors, WrongTypesAnywhereGiveOneLineOrAShape) {
  Json root = box_json();
  root["gyration"] = {1, 1, 1, 0, 0, 0};
  root["shape"]["data"].erase(root["shape"]["data"].begin() + 1, root["shape"]["data"].end());
  root["shape"]["count"] = 1;
  int refused = 0, accepted = 0;
  for_each_spoiled(root, root, [&](const Json& spoiled) {
    const std::string error = parse_error(spoiled.dump());
    (error == "accepted" ? accepted : refused)++;
    if (error == "accepted") return;
    EXPECT_EQ(error.find("stone.json: "), 0u) << error;
    EXPECT_EQ(error.find('\n'), std::string::npos) << error;
    EXPECT_LT(error.size(), 200u) << error;
  });
  EXPECT_GT(refused, 300);
  EXPECT_GT(accepted, 30);  // keys that are ignored
}

}  // namespace
}  // namespace nurbs::test_shape_file

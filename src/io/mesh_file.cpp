// Readers of mesh files.
#include "io/mesh_file.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>

namespace nurbs {
namespace {

constexpr size_t kMostTriangles = 50'000'000;

std::string read_all(const std::string& file) {
  std::error_code error;
  if (std::filesystem::is_directory(file, error))
    throw ShapeError(file + ": is a directory, not a mesh file");
  std::ifstream in(file, std::ios::binary);
  if (!in) throw ShapeError(file + ": cannot open mesh file");
  std::string text((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  if (in.bad()) throw ShapeError(file + ": cannot read mesh file");
  if (text.empty()) throw ShapeError(file + ": the file is empty");
  return text;
}

// Lines as they are read here: no byte order mark, no carriage returns, lines joined that a backslash
// continues.
std::string plain_lines(std::string text) {
  if (text.compare(0, 3, "\xEF\xBB\xBF") == 0) text.erase(0, 3);
  for (size_t k = 0; k < text.size(); ++k)
    if (text[k] == '\r') text[k] = k + 1 < text.size() && text[k + 1] == '\n' ? ' ' : '\n';
  for (size_t at = text.find('\\'); at != std::string::npos; at = text.find('\\', at + 1)) {
    const size_t end = text.find_first_not_of(" \t", at + 1);
    if (end != std::string::npos && text[end] == '\n') text[at] = text[end] = ' ';
  }
  return text;
}

std::string lower(std::string s) {
  std::transform(s.begin(), s.end(), s.begin(), [](unsigned char c) { return std::tolower(c); });
  return s;
}

[[noreturn]] void fail(const std::string& file, const std::string& what) {
  throw ShapeError(file + ": " + what);
}

// Whether a word is a finite number and nothing else.
bool whole_number(const std::string& word, double& x) {
  char* end = nullptr;
  x = std::strtod(word.c_str(), &end);
  return end != word.c_str() && *end == 0 && std::isfinite(x);
}

// Words of a text, with the line they are on.
class Words {
 public:
  Words(const std::string& file, const std::string& text) : file_(file), text_(text) {}

  bool next(std::string& word) {
    while (at_ < text_.size() && std::isspace(static_cast<unsigned char>(text_[at_])))
      line_ += text_[at_++] == '\n';
    const size_t begin = at_;
    while (at_ < text_.size() && !std::isspace(static_cast<unsigned char>(text_[at_]))) ++at_;
    word.assign(text_, begin, at_ - begin);
    return !word.empty();
  }
  double number(const char* what) {
    std::string word;
    if (!next(word)) bad(std::string("ends before ") + what);
    double x = 0;
    if (!whole_number(word, x)) bad("'" + word.substr(0, 40) + "' is not a finite number for " + what);
    return x;
  }
  void skip_line() {
    while (at_ < text_.size() && text_[at_] != '\n') ++at_;
  }
  [[noreturn]] void bad(const std::string& what) const {
    fail(file_, "line " + std::to_string(line_) + ": " + what);
  }

 private:
  const std::string &file_, &text_;
  size_t at_ = 0;
  long line_ = 1;
};

void add_triangle(TriangleMesh& mesh, const Vec3& a, const Vec3& b, const Vec3& c) {
  const int first = static_cast<int>(mesh.points.size());
  mesh.points.insert(mesh.points.end(), {a, b, c});
  mesh.triangles.push_back({first, first + 1, first + 2});
}

std::uint32_t little_endian(const char* p) {
  std::uint32_t x = 0;
  for (int k = 3; k >= 0; --k) x = x << 8 | static_cast<unsigned char>(p[k]);
  return x;
}

float little_float(const char* p) {
  const std::uint32_t bits = little_endian(p);
  float x;
  std::memcpy(&x, &bits, sizeof x);
  return x;
}

// 80 bytes, the count, then 50 bytes a triangle.
TriangleMesh read_binary_stl(const std::string& file, const std::string& text) {
  if (text.size() < 84) fail(file, "binary STL ends in its header");
  const size_t count = little_endian(&text[80]);
  if (text.size() < 84 + 50 * count)
    fail(file, "binary STL of " + std::to_string(count) + " triangles ends after " +
                   std::to_string((text.size() - 84) / 50));
  if (const size_t more = text.size() - 84 - 50 * count; more > 0 && more % 50 == 0)
    fail(file, "binary STL of " + std::to_string(count) + " triangles, by its header, holds " +
                   std::to_string(more / 50) + " more");
  TriangleMesh mesh;
  for (size_t k = 0; k < count; ++k) {
    Vec3 corner[3];
    for (int i = 0; i < 3; ++i)
      for (int c = 0; c < 3; ++c) {
        corner[i][c] = little_float(&text[84 + 50 * k + 12 + 12 * i + 4 * c]);
        if (!std::isfinite(corner[i][c]))
          fail(file, "triangle " + std::to_string(k) + " has a corner that is not finite");
      }
    add_triangle(mesh, corner[0], corner[1], corner[2]);
  }
  return mesh;
}

TriangleMesh read_ascii_stl(const std::string& file, const std::string& raw) {
  const std::string text = plain_lines(raw);
  Words words(file, text);
  TriangleMesh mesh;
  std::string word;
  std::vector<Vec3> corners;
  bool in_loop = false, ended = false;
  while (words.next(word)) {
    word = lower(word);
    if (word == "solid" || word == "endsolid") {
      ended = word == "endsolid";
      words.skip_line();
    } else if (word == "outer") {
      corners.clear();
      in_loop = true;
    } else if (word == "vertex") {
      if (!in_loop) words.bad("vertex outside of a loop");
      const double x = words.number("a coordinate"), y = words.number("a coordinate"),
                   z = words.number("a coordinate");
      corners.emplace_back(x, y, z);
    } else if (word == "endloop") {
      if (corners.size() != 3)
        words.bad("a loop of " + std::to_string(corners.size()) + " vertices, must have 3");
      add_triangle(mesh, corners[0], corners[1], corners[2]);
      in_loop = false;
    } else if (word == "facet") {
      words.skip_line();  // the normal, which the winding says too
    } else if (word != "loop" && word != "endfacet") {
      words.bad("unexpected '" + word.substr(0, 40) + "'");
    }
  }
  if (in_loop || !ended) fail(file, "ASCII STL ends too early, without endsolid");
  return mesh;
}

TriangleMesh read_stl(const std::string& file, const std::string& text) {
  const bool sized =
      text.size() >= 84 && text.size() == 84 + 50 * static_cast<size_t>(little_endian(&text[80]));
  if (!sized && text.find('\0') == std::string::npos) {
    const size_t mark = text.compare(0, 3, "\xEF\xBB\xBF") == 0 ? 3 : 0;
    const size_t start = text.find_first_not_of(" \t\r\n", mark);
    if (start != std::string::npos && lower(text.substr(start, 5)) == "solid")
      return read_ascii_stl(file, text);
    fail(file, "is no STL file: it begins neither with 'solid' nor as a binary one");
  }
  return read_binary_stl(file, text);
}

void add_fan(TriangleMesh& mesh, const std::vector<int>& corners) {
  for (size_t k = 2; k < corners.size(); ++k)
    mesh.triangles.push_back({corners[0], corners[k - 1], corners[k]});
}

TriangleMesh read_obj(const std::string& file, const std::string& text) {
  TriangleMesh mesh;
  std::istringstream in(plain_lines(text));
  std::string row;
  for (long line = 1; std::getline(in, row); ++line) {
    const auto bad = [&](const std::string& what) {
      fail(file, "line " + std::to_string(line) + ": " + what);
    };
    std::istringstream words(row);
    std::string kind;
    words >> kind;
    if (kind == "v") {
      Vec3 p;
      std::string word;
      for (int c = 0; c < 3; ++c)
        if (!(words >> word) || !whole_number(word, p[c])) bad("a vertex needs three finite numbers");
      mesh.points.push_back(p);
    } else if (kind == "f") {
      std::vector<int> corners;
      std::string word;
      while (words >> word) {
        if (word[0] == '#') break;
        char* end = nullptr;
        const long index = std::strtol(word.c_str(), &end, 10);
        const long count = static_cast<long>(mesh.points.size());
        const long at = index < 0 ? count + index : index - 1;
        if ((*end != 0 && *end != '/') || end == word.c_str() || at < 0 || at >= count)
          bad("face corner '" + word.substr(0, 40) + "', must name one of " + std::to_string(count) +
              " vertices");
        corners.push_back(static_cast<int>(at));
      }
      if (corners.size() < 3)
        bad("a face of " + std::to_string(corners.size()) + " corners, must have 3 at least");
      add_fan(mesh, corners);
    }
  }
  return mesh;
}

// --- PLY

struct Property {
  std::string name, type, count_type;  // count_type: of a list
};
struct Element {
  std::string name;
  size_t count = 0;
  std::vector<Property> properties;
};

int size_of(const std::string& type) {
  if (type == "char" || type == "uchar" || type == "int8" || type == "uint8") return 1;
  if (type == "short" || type == "ushort" || type == "int16" || type == "uint16") return 2;
  if (type == "int" || type == "uint" || type == "int32" || type == "uint32" || type == "float" ||
      type == "float32")
    return 4;
  if (type == "double" || type == "float64") return 8;
  return 0;
}

class PlyReader {
 public:
  PlyReader(const std::string& file, const std::string& text) : file_(file), text_(text) { read_header(); }

  TriangleMesh read() {
    TriangleMesh mesh;
    for (const Element& e : elements_)
      for (size_t k = 0; k < e.count; ++k) read_row(e, mesh);
    for (const auto& t : mesh.triangles)
      for (int i : t)
        if (i < 0 || static_cast<size_t>(i) >= mesh.points.size())
          fail(file_,
               "a face names vertex " + std::to_string(i) + " of " + std::to_string(mesh.points.size()));
    return mesh;
  }

 private:
  void read_header() {
    std::string format;
    for (bool first = true;; first = false) {
      const size_t end = text_.find_first_of("\r\n", at_);
      if (end == std::string::npos) fail(file_, "the PLY header does not end");
      const std::string row = text_.substr(at_, end - at_);
      at_ = end + (text_.compare(end, 2, "\r\n") == 0 ? 2 : 1);
      std::istringstream words(row);
      std::string word;
      words >> word;
      if (first || word == "comment" || word == "obj_info") continue;
      if (word == "format") words >> format;
      if (word == "end_header") break;
      if (word == "element") {
        Element e;
        if (!(words >> e.name >> e.count) || e.count > kMostTriangles)
          fail(file_, "bad PLY header line '" + row + "'");
        elements_.push_back(e);
      } else if (word == "property") {
        Property p;
        words >> p.type;
        if (p.type == "list") words >> p.count_type >> p.type;
        words >> p.name;
        if (elements_.empty() || !size_of(p.type) || (!p.count_type.empty() && !size_of(p.count_type)))
          fail(file_, "bad PLY header line '" + row + "'");
        elements_.back().properties.push_back(p);
      }
    }
    check_elements();
    ascii_ = format == "ascii";
    swap_ = format == "binary_big_endian";
    if (!ascii_ && !swap_ && format != "binary_little_endian")
      fail(file_, "PLY format '" + format + "' is not known");
  }

  void check_elements() const {
    int coordinates = 0;
    bool corners = false;
    for (const Element& e : elements_)
      for (const Property& p : e.properties) {
        coordinates += e.name == "vertex" && p.count_type.empty() && is_coordinate(p);
        corners = corners || (e.name == "face" && names_corners(p));
      }
    if (coordinates != 3) fail(file_, "the PLY vertices have no x, y and z");
    if (!corners) fail(file_, "the PLY file has no faces with a list vertex_indices");
  }

  static bool is_coordinate(const Property& p) { return p.name == "x" || p.name == "y" || p.name == "z"; }
  static bool names_corners(const Property& p) {
    return !p.count_type.empty() && (p.name == "vertex_indices" || p.name == "vertex_index");
  }

  double value(const std::string& type) {
    if (ascii_) {
      while (at_ < text_.size() && std::isspace(static_cast<unsigned char>(text_[at_]))) ++at_;
      const char* begin = text_.c_str() + at_;
      char* end = nullptr;
      const double x = std::strtod(begin, &end);
      if (end == begin || (*end != 0 && !std::isspace(static_cast<unsigned char>(*end))))
        fail(file_, "the PLY file ends too early or holds what is no number");
      at_ += static_cast<size_t>(end - begin);
      return x;
    }
    const size_t size = static_cast<size_t>(size_of(type));
    if (at_ + size > text_.size()) fail(file_, "the PLY file ends too early");
    char bytes[8] = {};
    for (size_t k = 0; k < size && k < sizeof bytes; ++k) bytes[k] = text_[at_ + (swap_ ? size - 1 - k : k)];
    at_ += size;
    const auto as = [&](auto x) {
      std::memcpy(&x, bytes, sizeof x);
      return static_cast<double>(x);
    };
    if (type == "float" || type == "float32") return as(float());
    if (size == 8) return as(double());
    const bool is_unsigned = type[0] == 'u';
    if (size == 1) return is_unsigned ? as(std::uint8_t()) : as(std::int8_t());
    if (size == 2) return is_unsigned ? as(std::uint16_t()) : as(std::int16_t());
    return is_unsigned ? as(std::uint32_t()) : as(std::int32_t());
  }

  void read_row(const Element& e, TriangleMesh& mesh) {
    Vec3 point(0, 0, 0);
    std::vector<int> corners;
    for (const Property& p : e.properties) {
      if (p.count_type.empty()) {
        const double x = value(p.type);
        if (is_coordinate(p)) point[p.name[0] - 'x'] = x;
        continue;
      }
      const double count = value(p.count_type);
      if (!(count >= 0 && count <= 1e6 && count == std::floor(count)))
        fail(file_, "a PLY list of impossible length");
      const bool is_face = names_corners(p);
      for (int k = 0; k < static_cast<int>(count); ++k) {
        const double index = value(p.type);
        if (is_face && index != std::floor(index))
          fail(file_, "a face names a vertex by what is no whole number");
        if (is_face) corners.push_back(index >= 0 && index < 2e9 ? static_cast<int>(index) : -1);
      }
    }
    if (e.name == "vertex") {
      if (!point.allFinite()) fail(file_, "vertex " + std::to_string(mesh.points.size()) + " is not finite");
      mesh.points.push_back(point);
    }
    if (e.name == "face") add_fan(mesh, corners);
  }

  const std::string &file_, &text_;
  size_t at_ = 0;
  bool ascii_ = false, swap_ = false;
  std::vector<Element> elements_;
};

}  // namespace

TriangleMesh read_mesh_file(const std::string& file) {
  const std::string text = read_all(file);
  const std::string ending = lower(std::filesystem::path(file).extension().string());
  TriangleMesh mesh;
  if (text.compare(0, 4, "ply\n") == 0 || text.compare(0, 4, "ply\r") == 0) {
    mesh = PlyReader(file, text).read();
  } else if (ending == ".obj") {
    mesh = read_obj(file, text);
  } else if (ending == ".stl") {
    mesh = read_stl(file, text);
  } else if (ending == ".ply") {
    fail(file, "is no PLY file: it does not begin with 'ply'");
  } else {
    fail(file, "ending '" + ending + "' is not known; a mesh is .stl, .obj or .ply");
  }
  if (mesh.triangles.empty()) fail(file, "holds no triangles");
  return drop_unused(mesh);  // a stray vertex far away would make the body look small
}

}  // namespace nurbs
